"""Thermally activated contacts, N or infinitely many; velocity steps and holds."""

import math

import numpy as np
import pytest
from benches import oscillations, rigidly

import stickslip as ss

NARROW = ss.Gaussian(mean=1.0, std=0.1)
WIDE = ss.Gaussian(mean=1.0, std=0.3)
BELL = ss.Bell(width=0.01, attempts=1e6)
GROWING = ss.LogarithmicGrowth(slope=0.02, time=1e-3)
T = ss.Interface(thresholds=WIDE, activation=BELL)
LT = ss.Interface(thresholds=WIDE, activation=BELL, ageing=GROWING)


def narrow(activation, **fields):
    return ss.Interface(thresholds=NARROW, activation=activation, **fields)


def of_areas(kept, activation=None):
    areas = ss.model.Areas(ss.Exponential(mean=1.0), kept=kept)
    return ss.Interface(areas=areas, activation=activation)


def noisy(activation, std=0.1, delay=0.0, newborn=0.3):
    thresholds = ss.Gaussian(mean=1.0, std=std)
    again = {"ageing": ss.Langevin(rate=1.5, newborn=newborn), "delay": ss.Delay(delay)}
    return ss.Interface(thresholds=thresholds, activation=activation, **again)


BARRIERS = {
    "bell": BELL,
    "parabolic": ss.model.Parabolic(temperature=0.02, attempts=1e4),
    "barrier, Kramers": ss.Barrier(height=60.0, attempts=1e5, kramers=True),
}
LOW = ss.Barrier(height=50.0, power=1.0, attempts=1e6)
COHORTS = {
    "bell": (T, 1.0),
    "bell, slow": (T, 0.01),
    "bell, fast": (T, 100.0),
    "bell, narrow": (narrow(BELL), 1.0),
    "bell, nearly without temperature": (narrow(BELL), 1e4),
    "bell, thresholds met": (narrow(BELL), 1e6),
    "bell, seldom": (narrow(ss.Bell(width=0.05, attempts=1e6)), 0.01),
    "bell, delay": (narrow(BELL, delay=ss.Delay(0.01)), 0.9972),
    "bell, growing": (LT, 1.0),
    "bell, growing, fast": (LT, 1162.0),
    "parabolic": (narrow(ss.model.Parabolic(temperature=0.01, attempts=1e6)), 1.0),
    "parabolic, hot": (narrow(ss.model.Parabolic(temperature=0.05, attempts=1e6)), 1.0),
}
"""Interfaces that both solvers accept, and velocities."""
ONE_BY_ONE = {}
for name, heat in BARRIERS.items():
    ONE_BY_ONE[f"noise, {name}"] = (noisy(heat, delay=0.2), 2.0, 0.25, 0.5, 2_000)
for name, kramers in (("plain", False), ("Kramers", True)):
    heat = ss.Barrier(height=100, attempts=1e6, kramers=kramers)
    ONE_BY_ONE[f"barrier, {name}"] = (narrow(heat), 1.0, 0.3, 0.5, 5_000)
# Forces of contacts go up to their areas; a site keeps its area for ever.
for heat in (None, LOW):
    fresh, site = of_areas(False, heat), of_areas(True, heat)
    ONE_BY_ONE[f"areas, fresh, {heat}"] = (fresh, 1.0, 0.9, 1.0, 20_000)
    ONE_BY_ONE[f"areas, site, {heat}"] = (site, 1.0, 0.6, 6.0, 20_000)
"""Interface, velocity, bound of a contact's force scatter, correlation length."""


def slide(interface, velocity, method, distance):
    """Friction force on a rigid slider that starts in steady sliding."""
    times = np.linspace(0.0, distance / velocity, 201)
    drive = ss.constant(velocity, times[-1])
    return rigidly(interface, method, drive, times)["friction_force"]


def lasting(names, *long):
    slow = {name: pytest.mark.slow for name in names if name.startswith(long)}
    return [pytest.param(name, marks=slow.get(name, ())) for name in names]


@pytest.mark.parametrize("name", lasting(COHORTS, "parabolic, hot"))
def test_cohorts_slide_with_the_steady_force(name):
    interface, velocity = COHORTS[name]
    run = slide(interface, velocity, ss.MasterEquation(), 0.2)
    assert run == pytest.approx(ss.kinetic_friction(interface, velocity), abs=1.5e-4)


@pytest.mark.parametrize("name", lasting([*COHORTS, *ONE_BY_ONE], "noise"))
def test_contacts_slide_with_the_steady_force(name):
    # The force of one contact has a standard deviation of .3 at most, and a correlation
    # length of .5.
    usual = 0.3, 0.5, 5_000
    both = COHORTS | ONE_BY_ONE
    interface, velocity, scatter, forgets, count = (*both[name], *usual)[:5]
    run = slide(interface, velocity, ss.Contacts(count, seed=5), 6.0)
    error = scatter / math.sqrt(count * 6.0 / forgets)
    force = ss.kinetic_friction(interface, velocity)
    assert run.mean() == pytest.approx(force, abs=4 * error)


# ---------------- limits and accounts


def test_without_attempts_cohorts_are_those_without_temperature():
    start = ss.Gaussian(mean=0.0, std=0.05)
    cold = ss.Interface(thresholds=NARROW, initial=start)
    hardly = ss.Bell(width=0.01, attempts=1e-9)
    barely = ss.Interface(thresholds=NARROW, initial=start, activation=hardly)
    exact = ss.rigid_slide(cold, 2.0)
    run = ss.rigid_slide(barely, 2.0, method=ss.MasterEquation())
    expected = np.interp(run.displacement, exact.displacement, exact.friction_force)
    np.testing.assert_allclose(run.friction_force, expected, atol=5e-5)


SHARP = ss.Bell(width=1e-3, attempts=1e6)
COLD = ss.model.Parabolic(temperature=1e-3, attempts=1e6)
NOT_FIXED = {
    "bell": {"activation": BELL},
    "bell, wide": {"activation": ss.Bell(width=0.1, attempts=1e6)},
    "bell, sharp": {"activation": ss.Bell(width=1e-4, attempts=1e6)},
    "logarithmic": {"ageing": GROWING},
    "exponential": {"ageing": ss.ExponentialGrowth(rate=2.0, newborn=0.3)},
    "bell, logarithmic": {"activation": BELL, "ageing": GROWING},
    "bell, sharp, logarithmic": {"activation": SHARP, "ageing": GROWING},
    "parabolic": {"activation": ss.model.Parabolic(temperature=0.01, attempts=1e6)},
    "parabolic, sharp": {"activation": COLD},
}
STOP_AND_BACK = ss.constant(0.0, 10.0).then(ss.constant(-1.0, 1.5))
THERE_AND_BACK = ss.constant(1.0, 1.5).then(STOP_AND_BACK)


# with a wide one most contacts break as they attach, and 1e-7 takes many steps
@pytest.mark.slow
@pytest.mark.parametrize("name", NOT_FIXED)
def test_the_tolerance_is_met_through_slips_holds_and_turns(name):
    """As a root mean square over a run, with activation or with growth."""
    interface = narrow(**{"activation": None} | NOT_FIXED[name], delay=ss.Delay(0.1))
    slider = ss.Slider(stiffness=20.0, mass=1e-3, damping=50.0)
    rig = ss.Rig(interface, slider, THERE_AND_BACK, output=ss.Output(interval=0.02))
    methods = (ss.MasterEquation(rtol=rtol) for rtol in (1e-7, 1e-4, 1e-5, 1e-6))
    exact, *found = (ss.simulate(rig, method=method).spring_force for method in methods)
    for force, rtol in zip(found, (1e-4, 1e-5, 1e-6), strict=True):
        assert float(((force - exact) ** 2).mean()) ** 0.5 < rtol


# ---------------- contacts of different areas


def test_contacts_of_one_area_are_contacts():
    """With all areas 1: the same run as without areas, by the engine without them."""
    one = ss.Gaussian(mean=1.0, std=0.0)
    slider = ss.Slider(stiffness=2.0, mass=1e-2, damping=20.0)
    drive = ss.constant(1.0, 1.5).then(ss.constant(-1.0, 1.5))
    drive = drive.then(ss.constant(0.0, 2.0)).then(ss.constant(2.0, 0.7))
    kept = ss.model.Areas(one, kept=True)
    interfaces = [
        ss.Interface(**contacts, delay=ss.Delay(0.1))
        for contacts in (
            {"thresholds": one},
            {"areas": kept},
            {"areas": ss.model.Areas(one)},
        )
    ]
    method = ss.Contacts(60)
    rigs = (ss.Rig(interface, slider, drive, method=method) for interface in interfaces)
    runs = [ss.simulate(rig) for rig in rigs]
    for name in ("friction_force", "displacement", "broken_energy"):
        for run in runs[1:]:
            np.testing.assert_allclose(run[name], runs[0][name], rtol=0, atol=1e-9)


# ---------------- thresholds that age by Langevin


@pytest.mark.parametrize("name", BARRIERS)
def test_thresholds_with_little_noise_grow_by_a_rule(name):
    """With less noise the lives become those of thresholds that grow by a rule."""
    growing = ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=1e-6),
        activation=BARRIERS[name],
        ageing=ss.ExponentialGrowth(rate=1.5**2, newborn=0.3),
    )
    exact = ss.kinetic_friction(growing, 1.0)
    few = (noisy(BARRIERS[name], std=std) for std in (0.04, 0.02))
    off = [abs(ss.kinetic_friction(interface, 1.0) - exact) for interface in few]
    assert off[1] < 4e-3
    # second order in the noise; the equation is solved to 1e-4
    assert off[1] < 0.4 * off[0] + 1e-4


def test_noisy_thresholds_that_are_never_tried_are_those_without_temperature():
    cold = noisy(None)
    barely = noisy(ss.Bell(width=0.01, attempts=1e-9))
    force = ss.kinetic_friction(cold, 1.0)
    assert ss.kinetic_friction(barely, 1.0) == pytest.approx(force, abs=1e-5)


# ---------------- steps and holds


VELOCITY_STEPS = (T, 0.00955, 0.00447), (LT, 0.00943, -0.00461)


@pytest.mark.parametrize(("interface", "rise", "end"), VELOCITY_STEPS)
def test_a_velocity_step(interface, rise, end):
    """The direct effect is nearly the width; in the end ageing decides, too."""
    run = ss.velocity_step(interface, before=1.0, after=10.0, distance=6.0)
    step = int(np.argmin(np.abs(run.time.to_numpy())))
    assert (run.time[step].item(), run.displacement[step].item()) == (0.0, 0.0)
    # over a twentieth of the distance, at the speed before
    assert np.diff(run.time[: step + 1]) == pytest.approx(0.3 / step)
    force = (run.friction_force - float(run.friction_force[step])) / math.log(10)
    assert float(force.max()) == pytest.approx(rise, rel=0.01)
    assert float(force[-1]) == pytest.approx(end, rel=0.02)


def aged(growth, delay):
    return ss.Interface(thresholds=NARROW, ageing=growth, delay=ss.Delay(delay))


EXPONENTIAL = ss.ExponentialGrowth(rate=2.0, newborn=0.3)
STEPS = {
    "bell": (T, {}),
    "bell, growing": (LT, {}),
    "bell, on a spring": (T, {"stiffness": 0.1}),
}
for delay in (0.0, 0.2):
    STEPS[f"logarithmic, delay {delay}"] = (aged(GROWING, delay), {})
    STEPS[f"exponential, delay {delay}"] = (aged(EXPONENTIAL, delay), {})


@pytest.mark.parametrize("name", STEPS)
def test_a_velocity_step_of_contacts_is_that_of_cohorts(name):
    interface, spring = STEPS[name]
    given = {"before": 1.0, "after": 10.0, "distance": 3.0, "points": 200} | spring
    cohorts = ss.velocity_step(interface, **given)
    force = cohorts.friction_force
    steady = ss.kinetic_friction(interface, 1.0)
    error = 2e-5 if interface.activation is None else 1.5e-4
    assert float(force[0]) == pytest.approx(steady, abs=error)
    contacts = ss.velocity_step(interface, **given, method=ss.Contacts(40_000, seed=4))
    # Stretchings scatter by .36, and the initial lives are drawn from four times as
    # many: .36 sqrt(5/4).
    away = float(np.abs(contacts.friction_force - force).max())
    assert away < 4 * 0.4 / math.sqrt(40_000)
    if spring:  # in equilibrium throughout: the spring force is the friction force
        way = np.where(cohorts.time > 0, 10.0, 1.0) * cohorts.time
        pull = 0.1 * (way - cohorts.displacement)
        np.testing.assert_allclose(pull - pull[0], force - force[0], atol=2e-6)


@pytest.mark.takes(7)
def test_exponential_thresholds_are_rate_and_state():
    """``A/(1-A) ln 2 exp(-x)`` above that before, once the contacts are taut."""
    heat = ss.Bell(width=0.03, attempts=1e6)
    interface = ss.Interface(thresholds=ss.Exponential(mean=1.0), activation=heat)
    run = ss.velocity_step(interface, before=1.0, after=2.0, distance=1.2)
    change = run.friction_force - float(run.friction_force[0])
    values = np.interp([0.3, 0.5, 1.0], run.displacement, change)
    assert values == pytest.approx([0.0159, 0.0130, 0.0079], abs=8e-4)


GROWN = ss.Interface(thresholds=NARROW, ageing=GROWING)
HEALING = (GROWN, 0.02 * math.log(10)), (LT, 0.0451)


@pytest.mark.parametrize(("interface", "healing"), HEALING)
def test_contacts_heal_by_the_slope_of_their_growth(interface, healing):
    """Cold, a contact breaks at its threshold, raised by ``c ln(1 + t/t_0)``."""
    run = ss.slide_hold_slide(interface, velocity=1.0, holds=(1e3, 1e4))
    assert float(run.peak[1] - run.peak[0]) == pytest.approx(healing, rel=0.01)
    if interface.activation is None:
        assert run.relaxation.to_numpy() == pytest.approx(0.0, abs=1e-9)


HOLDS = {"T": (T, -0.0874, 0.0048), "LT": (LT, -0.0461, 0.0889)}


@pytest.mark.takes(4)
@pytest.mark.parametrize("name", HOLDS)
def test_slide_hold_slide(name):
    interface, relaxation, peak = HOLDS[name]
    run = ss.slide_hold_slide(interface, velocity=1.0, holds=(100.0,))
    assert float(run.relaxation[0]) == pytest.approx(relaxation, abs=3e-4)
    assert float(run.peak[0]) == pytest.approx(peak, abs=3e-4)
    assert 0.13 < float(run.slip_to_peak[0]) < 0.34
    how = {"velocity": 1.0, "holds": (100.0,), "method": ss.Contacts(20_000, seed=8)}
    contacts = ss.slide_hold_slide(interface, **how)
    error = 0.3 / math.sqrt(20_000)
    assert float(contacts.relaxation[0]) == pytest.approx(relaxation, abs=4 * error)
    assert float(contacts.peak[0]) == pytest.approx(peak, abs=4 * error)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "growth", "frequency"),
    [(0.0200, 0.0240, 2.370), (0.0216, -0.0239, 2.458)],
)
def test_a_spring_decides_whether_a_small_step_grows(stiffness, growth, frequency):
    step = {"before": 1.0, "after": 1.003, "distance": 25.0}
    late = ss.velocity_step(LT, **step, stiffness=stiffness).sel(time=slice(6.0, None))
    interval = float(late.time[1] - late.time[0])
    found = oscillations(late.friction_force.to_numpy(), interval)
    # in a unit of displacement
    found = found[np.argmin(np.abs(found - complex(growth, frequency)))] / 1.003
    assert found.real == pytest.approx(growth, abs=0.001)
    assert found.imag == pytest.approx(frequency, rel=0.001)


def test_a_rig_has_its_own_units():
    scales = ss.model.Scales(force=50.0, stretching=2e-6, time=1e-3)
    slider = ss.Slider(stiffness=1.0, mass=1e-3, damping=1.0)
    rig = ss.Rig(T, slider, ss.constant(1.0), scales=scales)
    natural = ss.velocity_step(T, before=1.0, after=10.0, distance=1.0, points=50)
    run = ss.velocity_step(rig, before="2 mm/s", after=0.02, distance="2 um", points=50)
    assert run.friction_force.units == "N"
    assert run.velocity.units == "m/s"
    force = 50.0 * natural.friction_force
    np.testing.assert_allclose(run.friction_force, force, rtol=1e-12)
    held = ss.slide_hold_slide(rig, velocity=2e-3, holds=("100 ms",))
    assert float(held.hold[0]) == pytest.approx(0.1)
    assert held.slip_to_peak.units == "m"
    assert float(held.peak[0]) == pytest.approx(50.0 * 0.00484, rel=1e-2)


# ---------------- far from contacts, and at rest


def test_a_slider_that_flies_far_from_all_its_contacts_comes_down_again():
    """All contacts are detached for hundreds of widths: the clocks must follow."""
    fields = {"delay": ss.Delay(0.5), "activation": ss.Bell(width=0.01, attempts=1e4)}
    interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), **fields)
    slider = ss.Slider(stiffness=0.01, mass=2.6e-5, damping=4.0)
    drive = ss.constant(-1.0, 200.0)
    rig = ss.Rig(interface, slider, drive, method=ss.Contacts(50, seed=1))
    run = ss.simulate(rig, output=ss.Output(interval=0.01))
    assert float(np.abs(run.velocity).max()) > 100.0
    assert float(run.attached.min()) == 0.0
    assert bool(np.isfinite(run.friction_force).all())
    assert float(np.abs(run.friction_force).max()) < 1.2


def test_what_breaks_by_heat_at_rest_pulls_neither_way():
    """Detached contacts carry a force only once the slider moves."""
    interface = ss.Interface(
        thresholds=NARROW,
        initial=ss.Uniform(low=-0.5, high=0.5),
        delay=ss.Delay(1.0),
        sliding_force=0.3,
        activation=ss.Bell(width=0.1, attempts=1e4),
    )
    slider = ss.Slider(stiffness=50.0, mass=1.0, damping=5.0)
    rig = ss.Rig(interface, slider, ss.constant(0.0, 2.0))
    how = {"method": ss.Contacts(4_000, seed=1), "output": ss.Output(interval=0.05)}
    run = ss.simulate(rig, start=ss.FromRest(), **how)
    assert float(run["attached"].min()) < 0.2
    # Stretchings scatter by less than .5 over the root of the number.
    assert np.abs(run["friction_force"].to_numpy()).max() < 4 * 0.5 / np.sqrt(4_000)
