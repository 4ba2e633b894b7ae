"""The noise of N contacts in steady sliding: theory against closed forms, and against
runs of as many contacts.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import InputError
from stickslip.sliding.drawn import DrawnResponse
from stickslip.stability import contact_noise, dynamic_stiffness

SLIDER = ss.Slider(stiffness=3.0, mass=1e-3, damping=40.0)
TENTHS = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.2), delay=ss.Delay(0.1))
SCATTERED = ss.RandomDelay(mean=0.1, std=0.08, negative="redraw")
ALIKE = ss.Gaussian(mean=0.2, std=0.0)
ON_AREAS = {"thresholds": None, "areas": ss.model.Areas(ss.Exponential(mean=1.0))}
WEIBULL = replace(TENTHS, thresholds=ss.Weibull(scale=1.1, shape=2.5))
STRETCHED = {"newborn": ss.Uniform(low=-0.1, high=0.4), "sliding_force": 0.2}
DRAWN = {  # newborns with different stretchings, contacts of different areas
    "newborns": replace(WEIBULL, **STRETCHED),
    "areas": replace(TENTHS, sliding_force=0.1, **ON_AREAS),
}
INTERFACES = {
    "delay": TENTHS,
    "none": ss.Interface(thresholds=ss.LogNormal(mean=1.0, std=0.4)),
    "random delay": ss.Interface(thresholds=ss.Gamma(1.0, 0.6), delay=SCATTERED),
    "sliding force": replace(TENTHS, sliding_force=0.3, newborn=ALIKE),
    "Bell": replace(TENTHS, activation=ss.Bell(width=0.02, attempts=1e4)),
    "growth": replace(TENTHS, ageing=ss.LogarithmicGrowth(slope=0.02, time=1e-3)),
    "Langevin": replace(TENTHS, ageing=ss.Langevin(rate=1.5, newborn=0.2)),
} | DRAWN


def rig_of(interface, count=1000, slider=SLIDER, velocity=1.0):
    how = {"method": ss.Contacts(count), "start": ss.FromSliding()}
    return ss.Rig(interface, slider, ss.constant(velocity), **how)


def in_runs(rig, noise, error, seeds=3):
    """Fluctuations of force and velocity in runs over those of theory, to an error."""
    warm = 20.0 * noise.memory
    duration = noise.memory / (2.0 * error**2 * seeds)
    interval = min(noise.memory / 15.0, 0.05 / rig.velocity)
    # variance that subtracting the mean of a run removes, times its length
    white = float(noise.spectrum.spring_force[0]) / 2.0
    force = []
    velocity = []
    for seed in range(seeds):
        drive = ss.constant(rig.velocity, duration=warm + duration)
        how = {"method": replace(rig.method, seed=seed)}
        how["output"] = ss.Output(interval=interval)
        run = ss.simulate(rig.replace(drive=drive), **how).sel(time=slice(warm, None))
        force.append(float(run.spring_force.var()) + white / duration)
        velocity.append(float(run.velocity.var()))
    ratio = math.sqrt(np.mean(force)) / noise.spring_force
    return ratio, math.sqrt(np.mean(velocity)) / noise.velocity


@pytest.mark.parametrize("interface", INTERFACES.values(), ids=INTERFACES)
def test_contacts_fluctuate_as_theory_says(interface):
    """Within three standard errors, plus 1 % for terms beyond leading order."""
    rig = rig_of(interface)
    noise = contact_noise(rig)
    assert noise.relative_velocity < 0.2
    force, velocity = in_runs(rig, noise, error=0.015)
    assert force == pytest.approx(1.0, abs=0.055)
    assert velocity == pytest.approx(1.0, abs=0.055)  # it decorrelates faster


LIGHT = {  # rate, std, newborn; stiffness, mass, damping
    "tenths": (0.63, 0.153, 0.0, 0.57, 4e-5, 11.0),
    "narrow": (0.6, 0.11, 0.0, 0.51, 1e-5, 30.0),
    "broad": (0.45, 0.19, 0.0, 0.8, 1e-4, 9.0),
    "newborn": (0.55, 0.13, 0.03, 0.7, 5e-5, 12.0),
}


def light_rig(rate, std, newborn, stiffness, mass, damping):
    ageing = ss.Langevin(rate=rate, newborn=newborn)
    interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=std), ageing=ageing)
    slider = ss.Slider(stiffness=stiffness, mass=mass, damping=damping)
    rig = rig_of(interface, 1000, slider)
    assert ss.stability.count_unstable(rig) == 0
    return rig


@pytest.mark.parametrize("numbers", LIGHT.values(), ids=LIGHT)
def test_a_light_slider_on_ageing_contacts_is_as_steady_as_theory_says(numbers):
    """If stable, it responds within the contacts' memory; three standard errors."""
    rig = light_rig(*numbers)
    force, _ = in_runs(rig, contact_noise(rig), error=0.05)
    assert force == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("numbers", LIGHT.values(), ids=LIGHT)
def test_a_light_slider_on_a_kinetic_equation_that_ages_settles(numbers):
    rig = replace(light_rig(*numbers), method=ss.MasterEquation())
    drive = ss.constant(1.0, duration=12.0)
    run = ss.simulate(rig.replace(drive=drive)).sel(time=slice(8.0, None))
    # A run is accurate to its rtol times the mean threshold, 1, and no better.
    assert run.spring_force.std() < rig.method.rtol


@pytest.mark.slow
def test_a_population_fluctuates_as_theory_says():
    rig = replace(rig_of(TENTHS), method=ss.Population(100_000))
    force, _ = in_runs(rig, contact_noise(rig), error=0.03)
    assert force == pytest.approx(1.0, abs=0.1)


def test_on_a_stiff_spring_the_noise_is_that_of_the_contacts(distribution):
    """It has a closed form, except for fluctuations faster than the slider."""
    velocity = 0.7
    force = 0.3
    delay = 0.2
    moment = [distribution.positive().moment(order) for order in range(4)]
    slider = ss.Slider(stiffness=1e4, mass=1e-4, damping=2e4)
    for tau, pull in ((0.0, 0.0), (delay, 0.0), (delay, force)):
        contacts = ss.Interface(thresholds=distribution, delay=ss.Delay(tau))
        interface = replace(contacts, sliding_force=pull)
        way = moment[1] + velocity * tau
        square = (moment[3] / 3.0 + pull**2 * velocity * tau) / way
        mean = (moment[2] / 2.0 + pull * velocity * tau) / way
        found = contact_noise(rig_of(interface, 100, slider, velocity))
        found = found.spring_force**2 * 100
        # squares, by time
        jumps = (moment[2] - 2.0 * pull * moment[1] + 2.0 * pull**2) * velocity / way
        lost = 4.0 * jumps / (math.pi * slider.frequency)
        assert found == pytest.approx(square - mean**2, abs=lost + 1e-4 * square)


# the contacts of the latter break together
@pytest.mark.parametrize(("std", "sliding_force"), [(0.2, 0.0), (0.04, 0.3)])
def test_newborns_that_scatter_hardly_answer_as_those_that_do_not(std, sliding_force):
    thresholds = ss.Gaussian(mean=1.0, std=std)
    born = (ss.Gaussian(mean=0.2, std=part * std) for part in (0.0, 5e-4))
    contacts = replace(TENTHS, thresholds=thresholds, sliding_force=sliding_force)
    alike, nearly = (replace(contacts, newborn=x) for x in born)
    s = 1j * np.array([0.01, 1.0, 6.0, 30.0, 300.0])
    kappa = dynamic_stiffness(alike, 1.0, s)
    assert dynamic_stiffness(nearly, 1.0, s) == pytest.approx(kappa, abs=1e-6)
    stiff = replace(SLIDER, stiffness=30.0)
    rigs = (rig_of(interface, slider=stiff) for interface in (alike, nearly))
    sizes = [contact_noise(rig).spring_force for rig in rigs]
    assert sizes[1] == pytest.approx(sizes[0], rel=1e-6)


def test_how_many_contacts_a_size_takes():
    noise = contact_noise(rig_of(TENTHS, 400))
    least = noise.contacts_for(0.01)
    assert contact_noise(rig_of(TENTHS, least)).relative_force <= 0.01
    assert contact_noise(rig_of(TENTHS), contacts=least - 1).relative_force > 0.01
    many = 5.0 * contact_noise(rig_of(TENTHS, 10_000)).spring_force
    assert noise.spring_force == pytest.approx(many, rel=1e-12)


def test_near_the_limit_the_noise_grows_and_is_remembered_for_half_the_time_of_decay():
    """The slowest mode then dominates; its size goes as the root of its decay time."""
    narrow = replace(TENTHS, thresholds=ss.Gaussian(mean=1.0, std=0.1))
    rig = rig_of(narrow, slider=ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4))
    edge = ss.critical(rig, "delay", between=(0.05, 0.3)).edges[0].value
    rigs = (rig.replace(delay=edge * part) for part in (0.99, 0.998))
    near, nearer = map(contact_noise, rigs)
    for noise in (near, nearer):
        assert noise.memory == pytest.approx(-0.5 / noise.growth_rate, rel=0.1)
    ratio = pytest.approx(math.sqrt(nearer.memory / near.memory), rel=0.05)
    assert nearer.spring_force / near.spring_force == ratio
    with pytest.raises(InputError, match="unstable, with 2 growing modes"):
        contact_noise(rig.replace(delay=1.01 * edge))


def test_spectra_hold_the_sizes_in_the_units_of_the_rig():
    natural = contact_noise(rig_of(TENTHS))
    scales = ss.model.Scales(force=300.0, stretching=2e-6, time=1e-3)
    found = contact_noise(replace(rig_of(TENTHS), scales=scales))
    for name, unit in (("spring_force", "f_s"), ("velocity", "x_s/time")):
        expected = scales.unit(unit) * getattr(natural, name)
        assert getattr(found, name) == pytest.approx(expected, rel=1e-12)
        square = float(found.spectrum[name].integrate("frequency"))
        # by the trapezoidal rule
        assert square == pytest.approx(getattr(found, name) ** 2, rel=0.02)
    assert found.spectrum.velocity.units == "(m/s)^2 / Hz"
    said = "smooth sliding with 1000 contacts: the spring force fluctuates by 2"
    assert str(found).startswith(said)
    assert found.plot().axes[0].get_xlabel() == "frequency [Hz]"
    assert found.to_dict()["contacts_for_5_percent"] == natural.contacts_for(0.05)


def test_beyond_linear_theory_the_answer_says_so():
    few = contact_noise(rig_of(TENTHS, 3))
    assert not few.linear
    least = few.contacts_for(1.0, of="velocity")
    assert f"theory holds from {least} contacts on" in str(few)


def test_contacts_that_draw_answer_beyond_all_memory():
    """Beyond all frequencies that nodes resolve: no wave number is summed."""
    interface = ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=0.2),
        newborn=ss.Gaussian(mean=0.2, std=0.1),
        delay=ss.Delay(0.1),
    )
    s = np.array([1e5j, 1e6j])
    alone = DrawnResponse(interface).fluctuations(1.0, s).kappa
    with_slow = DrawnResponse(interface).fluctuations(1.0, np.append(s, 1j)).kappa
    assert alone.tolist() == with_slow[:2].tolist()
