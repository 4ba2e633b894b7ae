"""Thermal activation in steady sliding, its linear response, and rate-and-state
friction of contacts.

Numbers like those of the papers are for Gaussian thresholds of mean 1, attempts 1e6 and
a time of ageing of 1e-3; each was computed by two independent programs, to the
tolerance beside it.
"""

import ast
import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from benches import WARM
from drawn import assert_drawn, assert_kept
from other_units import rescaled
from refusals import refused
from scipy import integrate
from scipy.signal import lfilter
from test_noise import DRAWN

import stickslip as ss
from stickslip.cli import main
from stickslip.errors import InputError, UndecidedError
from stickslip.rate_state import RateAndState, finite_step, fit_rate_and_state
from stickslip.stability import dynamic_stiffness, friction_slope


def contacts(
    std=0.3,
    *,
    width=0.01,
    ageing=None,
    delay=0.0,
    thresholds=None,
    activation=None,
    sliding_force=0.0,
):
    activation = activation or (ss.Bell(width=width, attempts=1e6) if width else None)
    if isinstance(ageing, float):
        ageing = ss.LogarithmicGrowth(slope=ageing, time=1e-3)
    return ss.Interface(
        thresholds=thresholds or ss.Gaussian(mean=1.0, std=std),
        activation=activation,
        ageing=ageing,
        delay=ss.Delay(delay),
        sliding_force=sliding_force,
    )


def parabolic(temperature):
    return ss.model.Parabolic(temperature=temperature, attempts=1e6)


def barrier(power, kramers, height=100):
    return ss.Barrier(height=height, attempts=1e6, power=power, kramers=kramers)


def bench(interface, stiffness=1.0, velocity=1.0):
    slider = ss.Slider(stiffness=stiffness, mass=0.0, damping=0.0)
    return ss.Rig(interface, slider, ss.constant(velocity))


THERMAL = contacts()
AGEING = contacts(ageing=0.02)
LOG_NORMAL = contacts(thresholds=ss.LogNormal(mean=1.0, std=math.sqrt(math.e - 1.0)))
GROWN = ss.ExponentialGrowth(rate=2.0, newborn=0.2)
# Fast contacts break little above the strength of newborns, F = f_0/2 + rate f_0
# (<f_end> - f_0)/(2 v).
FAST = contacts(0.2, width=None, ageing=ss.ExponentialGrowth(rate=1.0, newborn=0.5))
PARABOLIC = contacts(0.1, activation=parabolic(0.01))
EVEN = contacts(thresholds=ss.Exponential(mean=1.0))
AGED = contacts(0.1, width=None, ageing=ss.Langevin(rate=1.0))
HARD = {"width": None, "sliding_force": 0.3}
fitted = lru_cache(ss.rate_and_state)


# ---------------------------------------------------------------- steady force


@pytest.mark.parametrize(
    ("interface", "velocity", "force", "slope"),
    [  # each with its tolerance
        (contacts(0.1), 1.0, (0.45670, 1e-4), (0.004938, 2e-5)),
        (THERMAL, 1.0, (0.50096, 2e-4), (0.004455, 3e-5)),
        (PARABOLIC, 1.0, (0.45415, 1e-4), (0.005473, 3e-5)),
        (AGEING, 1.0, (0.56522, 2e-4), (-0.00464, 3e-5)),
        (LOG_NORMAL, 0.01, (1.4254, 5e-4), None),
        (LOG_NORMAL, 1.0, (1.4017, 5e-4), (-0.0050, 1e-4)),
        (EVEN, 1.0, (0.99984, 2e-5), (0.0, 2e-5)),
        (FAST, 100.0, (0.25 + 0.125 / 100.0, 1e-5), (-0.125 / 100.0, 2e-5)),
    ],
)
def test_force_in_steady_sliding_and_its_slope(interface, velocity, force, slope):
    value, error = force
    assert ss.kinetic_friction(interface, velocity) == pytest.approx(value, abs=error)
    if slope is not None:
        value, error = slope
        assert friction_slope(interface, velocity) == pytest.approx(value, abs=error)


@pytest.mark.parametrize(
    "interface",
    [
        contacts(0.2, width=0.02, delay=0.2, sliding_force=0.3),
        contacts(ageing=0.02, delay=0.05, sliding_force=0.2),
        contacts(0.1, activation=barrier(1.0, False), delay=0.1, sliding_force=0.6),
        contacts(0.2, ageing=GROWN, delay=0.2, **HARD),
        THERMAL,
        contacts(ageing=ss.ExponentialGrowth(rate=2.0, newborn=0.5)),
        contacts(width=None, ageing=0.02),
        contacts(width=None, delay=0.1),
        contacts(width=None, thresholds=ss.Gamma(mean=1.0, std=0.5), delay=0.02),
        contacts(0.1, width=None, ageing=ss.Langevin(rate=1.5)),
        contacts(0.1, width=None, ageing=ss.Langevin(rate=1.0, newborn=0.3), delay=0.2),
        *DRAWN.values(),
    ],
)
def test_the_slope_is_that_of_the_force_and_of_slow_perturbations(interface):
    speed = 0.8
    step = 0.02
    slope = friction_slope(interface, speed)
    speeds = (speed * math.exp(sign * step) for sign in (1, -1))
    up, down = (ss.kinetic_friction(interface, each) for each in speeds)
    assert slope == pytest.approx((up - down) / (2 * step), abs=2e-4)
    slow = complex(dynamic_stiffness(interface, speed, 1e-5j * speed))
    assert slow / 1e-5j == pytest.approx(slope, abs=1e-5)


def by_quadrature(barrier, thresholds, velocity):
    """The steady force from survival, on a grid of stretchings and thresholds."""
    threshold = np.linspace(1e-3, 3.0, 600)
    part = np.linspace(0.0, 1.0, 2001)[:, None]
    x = part * threshold
    if isinstance(barrier, ss.Bell):
        hazard = np.exp((x - threshold) / barrier.width)
    elif isinstance(barrier, ss.model.Parabolic):
        hazard = np.exp((x**2 - threshold**2) / (2.0 * barrier.temperature))
    else:
        height = barrier.height * (1.0 - part) ** barrier.power
        hazard = np.exp(-height) * np.ones_like(x)
        hazard *= (1.0 - part) ** (barrier.power - 1.0) if barrier.kramers else 1.0
    broken = integrate.cumulative_trapezoid(hazard, x, axis=0, initial=0.0)
    held = np.exp(-barrier.attempts / velocity * broken)
    density = thresholds.density(threshold)
    work, way = (integrate.trapezoid(each, x, axis=0) for each in (x * held, held))
    return (work @ density) / (way @ density)


@pytest.mark.parametrize(
    ("activation", "velocity"),
    [
        (ss.Bell(width=0.01, attempts=1e6), 0.01),
        (ss.Bell(width=0.01, attempts=1e6), 100.0),
        (ss.Bell(width=0.01, attempts=1e6), 1e6),
        (ss.Bell(width=0.05, attempts=1e6), 0.01),
        (parabolic(0.01), 1.0),
        (parabolic(0.05), 1.0),
        (barrier(1.0, kramers=False), 1.0),
        (barrier(1.5, kramers=False), 1.0),
        (barrier(1.5, kramers=True), 1.0),
        (barrier(1.5, kramers=True), 1e5),
        (barrier(2.0, kramers=False, height=20), 1e3),
        (barrier(2.0, kramers=True), 1.0),
    ],
    ids=str,
)
def test_every_barrier_by_quadrature(activation, velocity):
    for std in (0.1, 0.3):
        interface = contacts(std, activation=activation)
        force = by_quadrature(activation, interface.threshold_distribution, velocity)
        found = ss.kinetic_friction(interface, velocity)
        assert found == pytest.approx(force, abs=1e-4)


KEPT = ss.model.Areas(ss.Exponential(mean=1.0), kept=True)
AREAS = ss.Interface(areas=KEPT)


@pytest.mark.parametrize(
    ("kept", "cold", "warm"), [(False, 0.75, 0.5832), (True, 0.5, 0.3935)]
)
def test_contacts_of_different_areas(kept, cold, warm):
    interface = ss.Interface(areas=replace(KEPT, kept=kept))
    assert ss.kinetic_friction(interface) == pytest.approx(cold, abs=1e-6)
    activated = replace(interface, activation=barrier(1.0, kramers=False, height=50))
    assert ss.kinetic_friction(activated, 1.0) == pytest.approx(warm, abs=1e-4)
    delayed = replace(activated, delay=ss.Delay(0.2), sliding_force=0.3)
    for moved in (activated, delayed):
        up, down = (ss.kinetic_friction(moved, v) for v in (1.01, 1.0 / 1.01))
        slope = (up - down) / (2.0 * math.log(1.01))
        assert friction_slope(moved, 1.0) == pytest.approx(slope, rel=1e-3)
    # <k x^2/2>/(<x> + v tau), and the mean of k x^2/2/(x + v tau), x the root of the
    # area.
    root, share = np.polynomial.legendre.leggauss(400)
    x = 4.0 * (1.0 + root)
    weight = 4.0 * share * 2.0 * x * np.exp(-(x**2))
    work = weight * 0.5 * x**3
    expected = work.sum() / (weight @ x + 1.0) if not kept else np.sum(work / (x + 1.0))
    late = replace(interface, delay=ss.Delay(1.0))
    assert ss.kinetic_friction(late, 1.0) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("interface", "between", "kind", "velocity", "force"),
    [
        (AGEING, (0.01, 1e5), "minimum", 1162, 0.53898),
        (contacts(0.1, delay=0.01), (0.01, 100), "maximum", 0.9972, 0.45169),
    ],
)
def test_velocities_where_friction_turns(interface, between, kind, velocity, force):
    (found,) = ss.stability.turning_velocities(interface, between=between)
    assert found.kind == kind
    assert found.velocity == pytest.approx(velocity, rel=0.01)
    assert found.force == pytest.approx(force, abs=2e-4)
    assert not ss.stability.turning_velocities(THERMAL, between=(0.01, 100))


@pytest.mark.parametrize(
    "thresholds",
    [ss.Gaussian(1.0, 0.3), ss.Gamma(1.0, 0.5), ss.Uniform(0.5, 1.5)],
    ids=str,
)
@pytest.mark.parametrize(
    ("change", "highest"), [({"width": 1e-10}, 2.0), ({"ageing": 1e-12}, 3.5)], ids=str
)
def test_without_width_or_growth_contacts_are_as_without_both(
    thresholds, change, highest
):
    cold = contacts(thresholds=thresholds, width=None, delay=0.1)
    s = 1j * np.logspace(-2.0, highest, 9)
    warm = contacts(thresholds=thresholds, delay=0.1, **{"width": None} | change)
    force = ss.kinetic_friction(cold, 1.0)
    assert ss.kinetic_friction(warm, 1.0) == pytest.approx(force, abs=1e-9)
    kappa = dynamic_stiffness(cold, 1.0, s)
    assert np.max(np.abs(dynamic_stiffness(warm, 1.0, s) - kappa)) < 1e-8


def test_contacts_that_break_at_a_constant_rate_are_as_a_maxwell_element():
    width, rate, delay = 1e4, 95.0, 0.01
    bell = ss.Bell(width=width, attempts=rate * np.exp(1.0 / width))
    interface = contacts(std=0.0, activation=bell, delay=delay)
    s = 1j * np.logspace(0.0, 5.0, 11)
    expected = s / (s + rate) / (1.0 + rate * delay)
    off = dynamic_stiffness(interface, 1.0, s) / expected - 1.0
    assert np.max(np.abs(off)) < 1.0 / width


# ---------------------------------------------------------------- linear response


@pytest.mark.parametrize(
    ("interface", "s", "kappa", "tolerance"),
    [
        (THERMAL, 3j, -0.01093 + 0.01754j, 0.01),
        (AGEING, 1j, -0.00424 - 0.00370j, 0.01),
        (contacts(ageing=0.02, delay=0.05), 2j, -0.0406 - 0.0481j, 0.01),
        (THERMAL, 1e5j, 1.0, 2e-3),  # to a fast perturbation contacts are springs
    ],
)
def test_dynamic_stiffness(interface, s, kappa, tolerance):
    found = complex(dynamic_stiffness(interface, 1.0, s))
    assert abs(found - kappa) < tolerance * abs(kappa)


@pytest.mark.parametrize(
    ("std", "width", "stiffness", "frequency"),
    [
        (0.1, 0.01, 0.02347, 2.608),
        (0.3, 0.01, 0.02081, 2.415),
        (0.5, 0.01, 0.01669, 2.086),
        (0.3, 1e-5, 0.02057, 5.216),
        (0.3, None, 0.02041, 5.238),
    ],
)
def test_critical_spring(std, width, stiffness, frequency):
    held = bench(contacts(std, width=width, ageing=0.02))
    (edge,) = ss.critical(held, "stiffness", between=(0.002, 0.5)).edges
    assert edge.value == pytest.approx(stiffness, rel=0.01)
    assert edge.frequency == pytest.approx(frequency, rel=0.01)
    assert edge.regains_stability


@pytest.mark.slow
def test_iterates_that_overflow_do_not_end_the_search_for_roots():
    heavy = ss.LogNormal(mean=1.0, std=0.8)
    held = bench(contacts(width=None, ageing=0.1, thresholds=heavy), 0.5, 3.0)
    held = held.replace(mass=1e-4, damping=10.0)
    with pytest.raises(ss.UndecidedError, match="as the tail of the distribution"):
        ss.growth_rate(held)


def test_contacts_that_give_way_at_once_have_a_real_mode_without_mass_and_damping():
    rig = bench(contacts(width=None, ageing=0.02), stiffness=0.01)
    assert ss.stability.count_unstable(rig) == 1
    s = ss.growth_rate(rig)
    assert s.imag == 0
    kappa = complex(dynamic_stiffness(rig.interface, 1.0, s))
    assert kappa == pytest.approx(-0.01, rel=1e-6)
    assert ss.stability.count_unstable(rig.replace(stiffness=0.0175)) == 3
    wide = bench(contacts(0.5, width=None, ageing=0.02))
    told = str(ss.critical(wide, "stiffness", between=(0.001, 0.9)))
    assert "regains stability at 0.017524" in told
    assert ss.stability.critical_spring(wide) == pytest.approx(0.01752424, rel=1e-5)
    values = [1.0], [0.01, 0.0175, 0.019, 0.021]
    found = ss.stability_map(rig, over=("velocity", "stiffness"), values=values)
    assert found["unstable_modes"].to_numpy().ravel().tolist() == [1, 3, 2, 0]


# ---------------------------------------------------------------- steps of contacts


def test_a_step_on_a_stiff_spring_is_nearly_that_of_a_rigid_slider():
    """The slider lags behind the drive by the force over the stiffness."""
    how = {"method": ss.MasterEquation(rtol=1e-7)}
    rigid, force = finite_step(AGEING, 1.0, 10.0, 2.0, **how)
    away = []
    for stiffness in (1e2, 1e4):
        lead, soft = finite_step(AGEING, 1.0, 10.0, 2.0, stiffness=stiffness, **how)
        away.append(stiffness * np.abs(np.interp(rigid, lead, soft) - force).max())
    assert away[1] == pytest.approx(away[0], rel=0.02)
    assert 0.0 < away[0] < 0.1


SLOW = [contacts(activation=parabolic(0.01)), contacts(ageing=0.02, delay=0.001)]


@pytest.mark.parametrize(
    "interface", [AGEING, *(pytest.param(one, marks=pytest.mark.slow) for one in SLOW)]
)
def test_finite_steps_that_are_small_are_the_linear_one(interface):
    x = np.array([0.02, 0.1, 0.5, 2.0, 3.9])
    size = math.log(1.1)
    # Terms even in the size of the step, and the error of the level, cancel between up
    # and down.
    sizes = math.exp(size), math.exp(-size)
    steps = (finite_step(interface, 1.0, each, 4.0) for each in sizes)
    up, down = (np.interp(x, *step) for step in steps)
    expected = ss.rate_state.small_step(interface, 1.0, x)
    assert 0.5 * (up - down) / size == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize(
    "interface", [contacts(width=None, delay=0.3), contacts(ageing=0.02, delay=0.3)]
)
def test_a_sudden_step_finds_the_contacts_that_are_attached(interface):
    slider = ss.Slider(stiffness=1.0, mass=1e-3, damping=60.0)
    rig = replace(bench(interface), slider=slider, start=ss.FromSliding())
    rig = replace(rig, drive=ss.constant(1.0, 4.0))
    run = ss.simulate(rig, method=ss.Contacts(20_000, seed=1))
    attached = float(run["attached"].mean())
    found = ss.rate_and_state(interface).contact_stiffness
    assert found == pytest.approx(attached, abs=5e-3)
    assert attached < 0.9
    assert fitted(AGEING).contact_stiffness == 1.0


# ---------------------------------------------------------------- the two laws

TIME = np.arange(0.0, 41.0)
PULL = np.where(TIME < 10, 1.0, 10.0)
BY_AGEING = [0.60720485, 0.60186637, 0.5840091, 0.58563096, 0.58899543]
BY_SLIP = [0.60839299, 0.6146288, 0.61663335, 0.61451424, 0.61239234]


@pytest.mark.parametrize(
    ("law", "a", "b", "friction"),
    [("ageing", 0.005, 0.01, BY_AGEING), ("slip", 0.01, 0.005, BY_SLIP)],
)
def test_published_arrays_of_the_forward_model(law, a, b, friction):
    one = RateAndState(law=law, a=a, b=b, distance=10.0)
    assert one.critical_stiffness() == pytest.approx(5e-4 if law == "ageing" else 0.0)
    in_series = one.critical_stiffness(contact_stiffness=1e-3)
    assert in_series == pytest.approx(1e-3 if law == "ageing" else 0.0)
    found = 0.6 + one.slide(TIME, PULL, stiffness=1e-3)[0, 11:16]
    assert found == pytest.approx(friction, abs=1e-7)


@pytest.mark.parametrize("law", ["ageing", "slip"])
def test_small_steps_of_both_laws_are_the_linear_one(law):
    x = np.array([0.05, 0.3, 1.0, 4.0])
    one = RateAndState(law=law, a=0.0106, b=0.0154, distance=0.31)
    found = one.step(x, 1.0005, stiffness=1.0) / math.log(1.0005)
    assert found == pytest.approx(one.small_step(x, stiffness=1.0), abs=1e-5)


# ---------------------------------------------------------------- the verdict


@pytest.mark.takes(5)  # computes two transforms of the response to a step
def test_the_verdict_is_in_units_of_the_thresholds():
    one = fitted(AGEING)
    four = ss.rate_and_state(rescaled(AGEING, 4), 4)
    expected = [4 * one.a, 4 * one.b, 4 * one.distance]
    assert [four.a, four.b, four.distance] == pytest.approx(expected, rel=1e-3)


def test_a_direct_effect_that_is_missing_is_told_with_its_size():
    # half of the contacts are attached
    interface = contacts(0.1, width=None, delay=1.0)
    fit = ss.rate_and_state(interface)
    s = 200j
    kappa = dynamic_stiffness(interface, 1.0, s)
    direct = (1.0 / (1.0 / kappa - 1.0 / 0.5) / s).real  # a dashpot in series with them
    assert fit.contact_stiffness == pytest.approx(0.5)
    reason = f"no direct effect: a = {direct:.2g} at high frequency"
    assert fit.reason.startswith(reason)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("interface", "holds", "word"),
    [
        (contacts(0.1, width=None, delay=0.1), False, "no direct effect"),
        (AGED, False, "no direct effect"),
        (contacts(width=None, ageing=0.02), False, "no direct effect"),
        (contacts(0.1), False, "the misfit of"),
        (THERMAL, True, "slip"),
        (contacts(ageing=0.01), True, "ageing"),
        (contacts(0.1, ageing=0.02), False, "the misfit of"),
        (AGEING, True, "ageing"),
        (contacts(ageing=0.02, delay=0.001), False, "b changes by"),
        (contacts(ageing=0.02, delay=0.05), False, "the misfit of"),
        (contacts(activation=parabolic(0.01)), True, "slip"),
    ],
)
def test_verdicts(interface, holds, word):
    fit = ss.rate_and_state(interface)
    assert fit.holds is holds
    assert word in (fit.law if holds else fit.reason)


def test_parameters_of_a_step_and_what_they_get_wrong():
    thermal = fitted(THERMAL)
    ageing = fitted(AGEING)
    assert (thermal.law, ageing.law) == ("slip", "ageing")
    for fit, expected in (
        (thermal, [0.0111, 0.0067, 0.226]),
        (ageing, [0.0111, 0.0157, 0.251]),
    ):
        assert [fit.a, fit.b, fit.distance] == pytest.approx(expected, rel=0.03)
    assert ageing.step_misfit == pytest.approx(0.023, rel=0.05)
    assert ageing.exact_critical_stiffness == pytest.approx(0.02081, rel=0.01)
    assert ageing.critical_stiffness == pytest.approx(0.0188, rel=0.03)
    assert ageing.danger == "too low"
    assert "too low, on the unsafe side" in str(ageing)
    # Peaks after holds grow by the slope of ageing, more than b gives.
    assert ageing.healing_over_b == pytest.approx(4 / 3, rel=0.06)
    assert thermal.exact_critical_stiffness == thermal.critical_stiffness == 0


def test_healing_is_the_growth_of_the_peaks_for_each_decade_of_the_hold():
    peaks = ("hold", [4.0, 7.0, 3.0], {"units": "N"})
    forces = dict.fromkeys(("relaxation", "peak", "slip_to_peak"), peaks)
    run = xr.Dataset(forces, {"hold": ("hold", [10.0, 1000.0, 1.0], {"units": "s"})})
    found = ss.rate_state.healing(run, b=1.5 / math.log(10.0))
    assert found.hold == (1.0, 10.0, 1000.0)
    assert found.per_decade == pytest.approx((1.0, 1.5))
    times = "1.5 N per decade of hold time, 1.00 times what rate and state predicts"
    assert times in str(found)
    ss.plot.peaks_after_holds(run, found.by_rate_and_state)


# ---------------------------------------------------------------- measured steps

TRUE = RateAndState(law="slip", a=0.01, b=0.014, distance=5.0)


def step_of(time, pull, *, noise=3e-4, seed=3, memory=0.0):
    """A trace of a spring-slider, with noise of exponential correlation."""
    white = np.random.default_rng(seed).normal(size=time.size)
    rough = lfilter([math.sqrt(1.0 - memory**2)], [1.0, -memory], white)
    friction = 0.6 + TRUE.slide(time, pull, stiffness=0.01)[0] + noise * rough
    return xr.Dataset({"friction": ("time", friction)}, coords={"time": time})


def slow_step(**how):
    time = np.linspace(0.0, 60.0, 601)
    trace = step_of(time, np.where(time < 10, 1.0, 3.0), **how)
    return fit_rate_and_state(trace, at=10.0, before=1.0, after=3.0, law="slip")


@pytest.mark.parametrize("count", [4, pytest.param(200, marks=pytest.mark.slow)])
def test_errors_of_fitted_steps_are_honest(count):
    fits = [slow_step(seed=seed) for seed in range(count)]
    truth = {"a": 0.01, "b": 0.014, "distance": 5.0, "stiffness": 0.01}
    found = [[(getattr(fit, key) - truth[key]) for key in truth] for fit in fits]
    found /= np.array([[getattr(fit, key).error for key in truth] for fit in fits])
    assert np.all(np.abs(found) < 4.5)
    if count >= 200:
        assert np.all(np.abs(np.std(found, axis=0) - 1.0) < 0.2)  # 1/sqrt(2 n) is .05
        assert np.all(np.abs(np.mean(found, axis=0)) < 4 * 1.2 / math.sqrt(count))


def test_errors_grow_with_the_likeness_of_neighbours():
    """Of noise with exponential correlation n samples are worth n (1 - r)/(1 + r)."""
    usual = slow_step()
    alike = slow_step(memory=0.8)
    ratios = [
        getattr(alike, name).error / getattr(usual, name).error
        for name in ("a", "b", "distance")
    ]
    grown = np.exp(np.mean(np.log(ratios)))
    assert grown == pytest.approx(math.sqrt(1.8 / 0.2), rel=0.25)


SOON = 2.5e-3 * np.arange(-400, 400)
FAST = step_of(SOON, np.where(SOON < 0, 10.0, 100.0))
GIVEN = {"at": 0.0, "before": 10.0, "after": 100.0}


@pytest.mark.parametrize("at", [-0.0125, 0.0125, 0.05])
def test_the_time_of_a_step_is_fitted(at):
    """400 Hz, 10 to 100 um/s; the time given is 12 ms early, or 12 or 50 ms late."""
    given = GIVEN | {"at": at, "law": "slip"}
    fit = fit_rate_and_state(FAST, **given)
    found = fit.at, fit.distance, fit.stiffness, fit.a_minus_b
    for value, true in zip(found, (0.0, 5.0, 0.01, -0.004), strict=True):
        assert abs(value - true) < 3.0 * value.error
    moved = FAST.assign(displacement=("time", np.where(SOON < 0, 10.0, 100.0) * SOON))
    assert ss.rate_state.velocity_step_in(moved, **GIVEN).measured
    # there are more samples before than after
    short = fit_rate_and_state(FAST, **given, span=(10.0, 20.0))
    assert abs(short.at) < 3.0 * short.at.error


DATA = Path(__file__).parent / "data"


def test_a_measured_step_on_basalt():
    trace = ss.read_trace(DATA / "giacomel_basalt_step.txt")
    given = {"at": 11676.28, "before": 3.0, "after": 10.0, "span": (5.0, 120.0)}
    step = ss.rate_state.velocity_step_in(trace, **given, bins=200)
    laws = "slip", "ageing"
    slip, ageing = (fit_rate_and_state(step, law=law, trend=True) for law in laws)
    for fit, expected in (
        (slip, [0.00961, 0.00945, 7.9]),
        (ageing, [0.00933, 0.00904, 5.8]),
    ):
        assert [fit.a, fit.b, fit.distance] == pytest.approx(expected, rel=0.05)
    # with bins of a displacement without noise, .14 um; 5.0e-4 with it
    assert max(slip.rms, ageing.rms) < 5.5e-4
    picture = ss.plot.velocity_step(step, [slip, ageing], ["slip law", "ageing law"])
    assert_drawn(picture, "velocity_step")
    assert_kept(f"{slip}\n{ageing}\n", "velocity_step_told")


# ------------------------------------------------------------- files for other programs

SCALES = ss.model.Scales(force=768.0, stretching=2e-6, time=1.0)


def exported(interface, program, fit=None, **given):
    given = {"scales": SCALES, "load": "2 kN", "area": "1 cm^2"} | given
    fit = fit or fitted(interface)
    return ss.rate_state.export_rate_and_state(fit, program, **given)


def test_exports_are_scripts_in_si_units(tmp_path):
    fit = fitted(AGEING)
    text = exported(AGEING, "qdyn", path=tmp_path / "fault.py")
    assert (tmp_path / "fault.py").read_text() == text
    (assigned,) = (n for n in ast.parse(text).body if isinstance(n, ast.Assign))
    given = ast.literal_eval(assigned.value)
    law = given["SET_DICT_RSF"]
    assert (given["SIGMA"], law["THETA_LAW"]) == (pytest.approx(2e7), 1)
    assert law["A"] * 2000.0 / SCALES.force == pytest.approx(fit.a)
    # quantities in SI units are not scaled twice
    assert exported(AGEING, "qdyn", fit=fit.in_units(SCALES)) == text
    for program in ("diabayes", "rsfmodel"):
        ast.parse(exported(AGEING, program))
    # A scenario: tandem asks for boundary, mu and eta, and slips forward under a
    # traction below 0.
    fault = exported(AGEING, "tandem")
    for name in ("boundary", "mu", "eta", "tau_pre", "sn_pre"):
        assert f"\nfunction Fault:{name}(x, y" in fault
    assert "\nfunction Fault:sn_pre(x, y) return 20.0 end" in fault
    # in the units of the rig, as a, b and D are
    assert "a step from 2 um/s to 20 um/s" in fault


# ---------------------------------------------------------------- what is refused

LANGEVIN = replace(THERMAL, ageing=ss.Langevin(rate=1.0))
RUNS_AWAY = RateAndState(law="slip", a=0.005, b=0.01, distance=10.0)
REFUSED = (
    lambda: RUNS_AWAY.slide(TIME, PULL, stiffness=1e-3),
    "runs away",
    lambda: ss.static_friction(AREAS),
    lambda: ss.growth_rate(bench(AREAS)),
    lambda: ss.rate_and_state(AREAS),
    lambda: ss.velocity_step(AREAS, before=1.0, after=2.0, distance=1.0),
    r"Interface\.areas = Areas\(.*\): not available with",
    lambda: replace(AREAS, activation=ss.Bell(width=0.01, attempts=1e6)),
    "not available with activation",
    lambda: dynamic_stiffness(replace(THERMAL, delay=ss.Delay(math.inf)), 1.0, 1j),
    "never re-attach",
    lambda: ss.rate_and_state(contacts(width=None)),
    "does not change with the velocity",
    lambda: ss.kinetic_friction(LANGEVIN, 1.0),
    r"Langevin\.newborn = 0 with Interface\.activation: .*; give newborn > 0",
    lambda: ss.rate_and_state(replace(THERMAL, delay=ss.Delay(0.1)), 1e5),
    r"^velocity = 1e\+05: contacts stay detached over",
    lambda: ss.kinetic_friction(THERMAL, 0.0),
    "there is no slow limit",
    lambda: exported(THERMAL, "tandem"),
    "has only the ageing law",
    lambda: exported(contacts(width=None, delay=0.1), "qdyn"),
    "is not rate-and-state",
    lambda: exported(AGEING, "qdyn", area=None),
    "area: is missing",
    lambda: exported(AGEING, "qdyn", load="2 m"),
    "load = '2 m': is not in a unit of 'N'",
    lambda: fit_rate_and_state(FAST.sel(time=slice(None, 0.03)), **GIVEN, law="slip"),
    "^at = 0: 12 samples after the step; there must be at least 30",
    lambda: fit_rate_and_state(FAST, at=0.0, before=100.0, after=10.0, law="slip"),
    "^not identified: .*swapped",
    lambda: fit_rate_and_state(ss.rate_state.velocity_step_in(FAST, **GIVEN), at=0.0),
    r"at = 0\.0: must be left out where data is a Step",
    lambda: fit_rate_and_state(FAST, **GIVEN, span=(5.0,)),
    r"^span = \(5\.0,\): must be displacements before and after",
    lambda: fit_rate_and_state(FAST[{"time": slice(None, None, -1)}], **GIVEN),
    "^data: its times do not rise",
    lambda: ss.rate_state.healing(FAST, 1.0),
    "^healing: run: has no holds",
    lambda: fit_rate_and_state(0.0 * FAST + 0.6, **GIVEN),
    r"the friction is 0\.6 throughout",
)


@refused(*REFUSED)
def test_what_is_refused(call, message):
    with pytest.raises((InputError, UndecidedError), match=message):
        call()


# ------------------------------------------------------------ rig files and the command


@pytest.fixture
def warm(tmp_path):
    path = tmp_path / "warm.toml"
    path.write_text(WARM)
    return path


def test_temperature_in_a_rig_file(warm):
    bell = ss.read_rig(warm).natural.interface.activation
    assert bell.width == pytest.approx(1.380649e-23 * 293 / (1e9 * 0.4e-27))
    assert bell.attempts == pytest.approx(1e6)
    kelvin = 'temperature = "293 K"'
    bell = 'kind = "bell"'
    for here, instead, message in (
        (kelvin, 'temperature = "20 m"', "= '20 m': is not in a unit of 'K'"),
        ('shear_strength = "1 GPa"\n', "", "interface.activation.shear_strength"),
        (bell, 'kind = "arrhenius"', "must be one of the known kinds"),
        (bell, 'kind = "bell"\nwidth = "20 nm"', "not both"),
    ):
        warm.write_text(WARM.replace(here, instead))
        with pytest.raises(InputError, match=message):
            ss.read_rig(warm)


BASALT = DATA / "giacomel_basalt_step.txt"
STEP = ["--step-at", "11676.28 s", "--from", "3 um/s", "--to", "10 um/s"]


@pytest.mark.takes(5)  # two fits to a measured step, a response to a step
def test_the_command_writes_pictures_and_scripts(warm, tmp_path, capsys):
    picture = tmp_path / "step.png"
    script = tmp_path / "qdyn.py"
    drawn = ["rsf", str(BASALT), *STEP, "--law", "slip", "--plot", str(picture)]
    assert main(drawn) == 0
    assert picture.stat().st_size > 10_000
    loaded = ["--load", "2 kN", "--area", "1 cm^2"]
    assert main(["rsf", str(warm), "--export", "qdyn", *loaded, "-o", str(script)]) == 0
    assert capsys.readouterr().out.endswith(f"qdyn: {script}\n")
