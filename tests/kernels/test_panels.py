"""The master equation on panels: conserving, of high order where smooth, else to its
tolerance.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import expm

from stickslip.kernels import panels, survival
from stickslip.kernels.drive import FINISHED, Quadratic
from stickslip.kernels.effective_stretching import Breaking
from stickslip.kernels.hazard import FIXED
from stickslip.kernels.oscillator import RIGID, Slider, is_rigid, response
from stickslip.kernels.panel_state import (
    Accuracy,
    Case,
    Delays,
    PanelsState,
    initial_state,
)
from stickslip.kernels.quadrature import GAUSS, WEIGHT
from stickslip.model.distributions import Exponential, Gaussian, Uniform, excess

GAUSSIAN = Gaussian(mean=1.0, std=0.1)
SLIDER = Slider(stiffness=2.0, mass=1e-4, damping=200.0)  # of Fig. 4


@pytest.fixture
def regular(distribution):
    """A distribution whose survival has no infinite slope at 0."""
    if distribution.density(1e-9) > 5:
        pytest.skip("its start is singular")
    return distribution


@cache
def breaking(distribution):
    """A case with fixed thresholds."""
    distribution = distribution.positive()
    top = float(distribution.inverse_survival(1e-13))
    knots = np.array([at for at in distribution.knots if 0 < at <= top * 1.000001])
    top = 1.02 * top if knots.size and knots[-1] > 0.999999 * top else top
    table = survival.tabulate(distribution.survival, top, knots)
    return Breaking(table, knots, table, 0.0, 0.0, FIXED)


def after(*times):
    times = np.array(times, float)
    weights = np.full(times.size, 1.0 / max(times.size, 1))
    mean = float(times @ weights)
    return Delays(times, weights, survival.EMPTY, 0.0, 1.0, mean, False, False)


NO_DELAY = after(0.0)
NEVER_BACK = after()


def narrow(std=0.01):
    """Relaxed contacts: Gauss nodes on panels of a bell curve."""
    edges = np.linspace(-7 * std, 7 * std, 33)
    x = edges[:-1, None] + np.diff(edges)[:, None] * GAUSS
    weight = np.exp(-0.5 * (x / std) ** 2) * WEIGHT
    return x, weight / weight.sum()


AT_REST = np.zeros((1, 4)), np.full((1, 4), 0.25)


@cache
def accuracy(distribution, tolerance):
    contacts = breaking(distribution)
    table = contacts.thresholds, contacts.knots
    return Accuracy(tolerance, survival.widest(*table, tolerance, 0.3, order=1))


def run(
    duration,
    *,
    distribution=GAUSSIAN,
    delays=NO_DELAY,
    slider=SLIDER,
    velocity=1.0,
    start=None,
    pull=None,
    times=None,
    tolerance=1e-5,
    **options,
):
    """Pull contacts at constant velocity, from rest or a state; sampled every 0.01."""
    contacts = breaking(distribution)
    state = start or initial_state(contacts, delays, *narrow(), velocity=velocity)
    motion = state.motion
    spring = 0.0 if is_rigid(slider) else motion.drive_force / slider.stiffness
    drive = pull or Quadratic(motion.time, motion.position + spring, velocity, 0.0)
    case = Case(contacts, delays, slider, accuracy(distribution, tolerance), drive)
    every = motion.time + np.arange(0.0, duration + 1e-9, 0.01)
    passed = every if times is None else times
    end = motion.time + duration
    return Run(*panels.advance_panels(state, case, end, passed, **options))


class Run(NamedTuple):
    """What `panels.advance_panels` returns."""

    state: PanelsState
    rows: np.recarray
    reason: int


# ---------------------------------------------------------------- parts


DAMPED = (0.01, 200, 2e4), (0.3, 42, 2e4), (1, 200, 1e4), (0.2, 10, -300)
UNDAMPED = (0.5, 0, 0), (100, 200, 3e4), (5, 1e4, 1)


@pytest.mark.parametrize(("t", "eta", "w"), [*DAMPED, *UNDAMPED])
def test_response_is_the_matrix_exponential_for_every_kind_of_damping(t, eta, w):
    chain = np.diag([0.0, 1, 1, 1], 1)[:5, :5]
    chain[0, 1] = 1
    chain[1, 0] = -w
    chain[1, 1] = -eta
    chain[1, 2] = 1
    exact = expm(chain * t)
    found = response(float(t), float(eta), float(w))
    assert found == pytest.approx([exact[1, 1], *exact[0, 1:]], rel=1e-10, abs=1e-14)


@pytest.mark.eq(3)
def test_table_gives_the_survival_to_rounding(regular):
    table = breaking(regular).thresholds
    x = np.random.default_rng(1).uniform(0.0, 1.1 * table.top, 2000)
    expected = regular.positive().survival(x)
    assert survival.values_at(table, x) == pytest.approx(expected, abs=1e-12)


# ---------------------------------------------------------------- closed forms


@pytest.mark.eq(11)
@pytest.mark.parametrize("damping", [20.0, 2 * math.sqrt(3.0 / 1e-4), 1000.0])
def test_nothing_breaks_the_slider_is_an_oscillator(damping):
    slider = SLIDER._replace(damping=damping)
    pull = Quadratic(0.0, 0.05, 0.3, 0.4)
    strong = Uniform(low=5.0, high=6.0)
    start = initial_state(breaking(strong), NO_DELAY, *AT_REST, velocity=2.0)
    how = {"slider": slider, "start": start, "pull": pull, "tolerance": 1e-10}
    rows = run(1.0, distribution=strong, **how).rows
    # state: X, V, 1, t, t^2/2
    K = slider.stiffness
    M = slider.mass
    chain = np.zeros((5, 5))
    chain[0, 1] = 1
    chain[3, 2] = 1
    chain[4, 3] = 1
    pulled = np.array([pull.position, pull.velocity, pull.acceleration]) * K / M
    chain[1] = [-(K + 1) / M, -damping, *pulled]
    exact = np.array([expm(chain * t) @ [0, 2, 1, 0, 0] for t in rows.time])
    assert rows.position == pytest.approx(exact[:, 0], abs=1e-9)
    # Between nodes the velocity is the slope of the position.
    error = 1e-7 * math.sqrt((K + 1) / M)
    assert rows.velocity == pytest.approx(exact[:, 1], abs=error)
    assert rows.contact_force == pytest.approx(exact[:, 0], abs=1e-9)
    speed = pull.velocity + 0.5 * pull.acceleration * rows.time
    far = pull.position + rows.time * speed
    assert rows.drive_force == pytest.approx(K * (far - exact[:, 0]), abs=2e-9)


@pytest.mark.eq(1, 3, 4)
def test_contacts_that_never_come_back_follow_the_survival_there_and_back(regular):
    distribution = regular
    start = initial_state(breaking(distribution), NEVER_BACK, *AT_REST)
    how = {"distribution": distribution, "delays": NEVER_BACK, "slider": RIGID}
    out = run(0.81, start=start, **how)
    back = run(2.02, start=out.state, velocity=-1.0, **how)
    rows = np.concatenate([out.rows, back.rows]).view(np.recarray)
    furthest = np.maximum.accumulate(np.abs(rows.position))
    attached = distribution.positive().survival(furthest)
    # between the ends of a step, to its tolerance
    assert rows.attached == pytest.approx(attached, abs=3e-4)
    at_ends = [out.rows[-1], back.rows[-1]]
    reached = distribution.positive().survival([0.81, 1.21])
    assert [row.attached for row in at_ends] == pytest.approx(reached, abs=1e-11)
    forces = [0.81 * reached[0], -1.21 * reached[1]]
    assert [row.contact_force for row in at_ends] == pytest.approx(forces, abs=1e-11)


@pytest.mark.eq(1, 2, 4)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_exponential_thresholds_have_a_closed_form(tolerance):
    exponential = Exponential(mean=1.0)
    start = initial_state(breaking(exponential), NO_DELAY, *AT_REST)
    how = {"distribution": exponential, "slider": RIGID, "start": start}
    rows = run(3.0, tolerance=tolerance, **how).rows
    off = rows.contact_force - (1 - np.exp(-rows.position))
    assert np.abs(off).max() < 3 * tolerance


# --------------------------------------------------------- conservation and fixed point


@pytest.mark.parametrize("times", [(), (0.0,), (0.2,), (0.0, 0.1, 0.35)])
def test_mass_is_conserved_to_rounding(distribution, times):
    how = {"distribution": distribution, "delays": after(*times), "tolerance": 1e-3}
    motion = run(3.0, **how).state.motion
    assert motion.mass_in + motion.mass_out == pytest.approx(1.0, abs=1e-12)
    assert motion.mass_out > -1e-3  # to the tolerance


# ---------------------------------------------------------------- order of convergence


SOME_DELAYS = NEVER_BACK, NO_DELAY, after(0.2), after(0.1, 0.2, 0.3)


@pytest.mark.parametrize("delays", SOME_DELAYS)
def test_fourth_order_and_more_in_the_number_of_steps_through_a_slip(delays):
    exact = run(2.0, delays=delays, tolerance=1e-10).rows
    steps = []
    errors = []
    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7):
        found = run(2.0, delays=delays, tolerance=tolerance)
        used = found.state.used
        steps.append(used.steps - used.rejected)
        off = found.rows.drive_force - exact.drive_force
        errors.append(np.sqrt(np.mean(off**2)))
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] > 4.0


# -------------------------------------------------------------- any direction of motion


def test_a_ringing_slider_breaks_what_its_widest_swing_reaches():
    # Released with a stretched spring and no damping: the first oscillation decides
    # what breaks, however long the steps.
    slider = SLIDER._replace(damping=0.0)
    start = initial_state(breaking(GAUSSIAN), NEVER_BACK, *AT_REST)
    pull = Quadratic(0.0, 0.70, 0.0, 0.0)
    how = {"delays": NEVER_BACK, "slider": slider, "start": start, "pull": pull}
    runs = (run(0.2, tolerance=tolerance, **how) for tolerance in (1e-4, 1e-7))
    found = [each.state.motion.attached for each in runs]
    # Energy: 1/2 K D^2 = 1/2 K (D - A)^2 + Int_0^A x J dx at the end of the
    # oscillation.
    oscillation = np.linspace(0.8, 1.1, 300_001)
    distribution = GAUSSIAN.positive()
    at_turn = excess(distribution, oscillation, 2)
    at_turn += oscillation * excess(distribution, oscillation, 1)
    pulled = excess(distribution, 0.0, 2) - at_turn
    widest = np.interp(0.0, pulled - oscillation * (1.4 - oscillation), oscillation)
    assert found == pytest.approx([float(distribution.survival(widest))] * 2, abs=2e-5)


# ---------------------------------------------------------------- the paper's runs


@pytest.mark.eq(10)
def test_memoryless_approximation_is_exact_for_the_mean_force_of_steady_sliding():
    delays = NO_DELAY._replace(mean=0.2, memoryless=True)
    rows = run(40.0, delays=delays, slider=RIGID, velocity=1.5).rows
    steady = 1.01 / 2 / (1 + 1.5 * 0.2)
    assert rows[-500:].contact_force.mean() == pytest.approx(steady, rel=1e-4)
    assert rows[-500:].attached.mean() == pytest.approx(1 / (1 + 1.5 * 0.2), rel=1e-4)


# ---------------------------------------------------------------- control


def test_slow_and_resting_sliders_need_few_steps():
    how = {"delays": after(0.2), "times": np.zeros(0)}
    slow = run(5e4, velocity=1e-4, max_steps=20_000, **how)
    assert slow.reason == FINISHED
    rest = run(1e6, start=slow.state, velocity=0.0, max_steps=5_000, **how)
    assert rest.reason == FINISHED
    assert rest.state.motion.mass_out == pytest.approx(0.0, abs=1e-12)
    assert rest.state.used.cohorts < 1000


def test_distributions_all_but_equal_do_not_stall_it():
    alike = Uniform(low=1.0, high=1.0 + 1e-7)
    progress = run(3.0, distribution=alike, delays=after(0.1), max_steps=50_000)
    assert progress.reason == FINISHED
    # The attached mass jumps where all had broken at once: a step there that was not
    # solved is never accepted.
    motion = progress.state.motion
    moving = 0.5 * SLIDER.mass * motion.velocity**2
    pulled = 0.5 * motion.drive_force**2 / SLIDER.stiffness
    held = moving + pulled + motion.stored
    assert motion.work == pytest.approx(held + motion.damped + motion.lost, abs=1e-4)
    assert motion.attached == pytest.approx(motion.mass_in, abs=1e-9)
