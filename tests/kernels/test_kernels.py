"""The small kernels, each against the function it replaces; engines made of them have
their own tests.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from stickslip.kernels import flight as flights
from stickslip.kernels import hazard, tournament, turning_points
from stickslip.kernels.drive import Quadratic, drive_at
from stickslip.kernels.hazard import BARRIER, BELL, PARABOLIC, Hazard
from stickslip.kernels.oscillator import Load, Motion, Slider, travel

changes = st.lists(
    st.tuples(st.integers(0, 10_000), st.floats(0, 1) | st.just(math.inf)), max_size=80
)


@settings(max_examples=100)
@given(st.sampled_from([1, 2, 7, 8, 9, 63, 64, 65, 600]), changes)
def test_a_tournament_knows_the_smallest_and_whose_it_is(slots, steps):
    trees = tournament.tournaments(np.full((2, slots), math.inf))
    numbers = np.full(slots, np.inf)
    for slot, value in steps:
        numbers[slot % slots] = value
        tournament.enter(trees[1], slots, slot % slots, value)
        assert tournament.smallest(trees[1]) == numbers.min()
        assert tournament.winner(trees[1], slots) == np.argmin(numbers)
    played = trees.copy()
    played[:, :-slots] = -1.0
    tournament.play(played, slots)
    assert np.array_equal(played, trees)  # the other tree has not changed
    assert trees.shape[1] >= slots


def plain_turns(force, drop, rise):
    """Return the peaks, each confirmed by a drop, and the troughs after them."""
    found = []
    falling = False
    best = 0
    for i, value in enumerate(force):
        if (value < force[best]) if falling else (value > force[best]):
            best = i
        elif abs(value - force[best]) >= (rise if falling else drop):
            found.append(best)
            falling = not falling
            best = i
    peaks = found[::2]
    troughs = found[1::2]
    return peaks[: len(troughs)], troughs


@settings(max_examples=200)
@given(
    st.lists(st.integers(-6, 6).map(float), min_size=1, max_size=80),
    st.integers(1, 5),
    st.integers(1, 5),
)
def test_turning_points(force, drop, rise):
    peaks, troughs = turning_points.pick(np.array(force), float(drop), float(rise))
    assert (peaks.tolist(), troughs.tolist()) == plain_turns(force, drop, rise)


@pytest.mark.parametrize(
    ("noise", "resolution", "error"),
    [(0.0, 0.0, 0.1), (0.0, 0.5, 0.4), (0.1, 0.0, 0.5)],
)
def test_a_saw_is_seen_as_it_is_sampled(noise, resolution, error):
    """Samples miss a peak by at most one step of the slope; noise and rounding add."""
    peaks = np.array([9.0, 10.0, 8.0, 11.0, 9.0, 10.0])
    troughs = np.array([2.0, 3.0, 1.0, 4.0, 2.0, 3.0])
    seen = np.full((2, 4), np.nan)
    sampling = turning_points.Recording(0.1, noise, resolution, 2.0, 2.0)
    rng = np.random.default_rng(1)
    assert turning_points.observe(peaks, troughs, sampling, rng, seen) == 4
    assert seen[0] == pytest.approx(peaks[1:5], abs=error)
    assert seen[1] == pytest.approx(troughs[1:5], abs=error)
    if resolution:
        assert np.all(seen / resolution == np.round(seen / resolution))
    else:
        assert np.all(seen[0] <= peaks[1:5] + 4 * noise)
        assert np.all(seen[1] >= troughs[1:5] - 4 * noise)
    few = np.full((2, 9), np.nan)
    # there are no more
    rng = np.random.default_rng(1)
    assert turning_points.observe(peaks, troughs, sampling, rng, few) == 4


HAZARDS = [
    Hazard(BELL, 3.0, 0.05, 1.0, 1.0, 0.0),
    Hazard(PARABOLIC, 3.0, 0.02, 1.0, 1.0, 0.0),
    Hazard(BARRIER, 3.0, 1.0, 20.0, 1.5, 0.0),
    Hazard(BARRIER, 3.0, 1.0, 20.0, 1.5, 1.0),
    Hazard(BARRIER, 3.0, 1.0, 20.0, 1.0, 1.0),
]


def plain_rate(held, x, threshold):
    """The rate as in the docstrings of `Bell`, `Parabolic` and `Barrier`."""
    if held.kind == BELL:
        return held.attempts * math.exp((abs(x) - threshold) / held.width)
    if held.kind == PARABOLIC:
        return held.attempts * math.exp(-(threshold**2 - x**2) / (2.0 * held.width))
    left = 1.0 - abs(x) / threshold
    prefactor = left ** (held.power - 1.0) if held.kramers else 1.0
    return held.attempts * prefactor * math.exp(-held.height * left**held.power)


@pytest.mark.parametrize("held", HAZARDS)
@pytest.mark.parametrize(("x", "threshold"), [(0.3, 1.1), (-0.5, 0.9), (0.85, 0.9)])
def test_rates_and_their_slopes(held, x, threshold):
    rate = pytest.approx(plain_rate(held, x, threshold), rel=1e-12)
    assert hazard.rate(held, x, threshold) == rate
    log, *slopes = hazard.log_rate(held, abs(x), threshold)
    assert held.attempts * math.exp(log) == rate
    if not held.kramers:
        left = hazard.height(held, abs(x), threshold)
        assert left == pytest.approx(-log, rel=1e-12)
        found = hazard.stretching_at(held, left, threshold)
        assert found == pytest.approx(abs(x), rel=1e-12)
    at = np.array([abs(x), threshold])
    by_differences = [
        (
            math.log(plain_rate(held, *(at + step)))
            - math.log(plain_rate(held, *(at - step)))
        )
        / 2e-6
        for step in 1e-6 * np.eye(2)
    ]
    assert slopes == pytest.approx(by_differences, rel=1e-6)


@pytest.mark.parametrize("held", HAZARDS)
@pytest.mark.parametrize("x", [0.1, 0.7, 0.99999])
def test_the_largest_rate_is_that_of_the_worst_contact(held, x):
    rates = [plain_rate(held, each, 1.0) for each in np.linspace(0.0, x, 200_001)]
    assert hazard.largest_rate(held, x, 1.0) == pytest.approx(max(rates), rel=1e-4)


FLIGHTS = [
    # eta, w2, v, f0, f1: oscillation, creep, critical damping
    (2.0, 900.0, 0.3, 20.0, 3.0),
    (0.5, 400.0, -0.4, -8.0, -2.0),
    (0.0, 400.0, 0.1, 4.0, 0.0),
    (90.0, 900.0, 0.3, 20.0, 3.0),
    (60.0, 900.0, 0.3, 20.0, -3.0),
]


@pytest.mark.parametrize(("eta", "w2", "v", "f0", "f1"), FLIGHTS)
def test_out_of_reach_is_out_of_reach(eta, w2, v, f0, f1):
    step = flights.NEAR / (eta + math.sqrt(w2))
    flight = flights.take_off(eta, w2, step, v, f0, f1, 0.0)
    t = np.linspace(0.0, 60.0, 200_001)
    y = np.array([flights.far(flight, h)[0] for h in t.tolist()])
    for ahead, behind in ((0.2, 0.15), (0.15, 0.2), (0.02, 0.03)):
        most = flights.out_of_reach(flight, ahead, behind, 50.0)
        before = y[t < most]
        assert np.all((before < ahead) & (before > -behind))
        assert most == 0.0 or w2 > 0.25 * eta * eta


@pytest.mark.parametrize(
    # the quadratures are of fourth order in the last doubling
    ("mass", "damping", "length", "tolerance"),
    [
        (0.02, 40.0, 0.3, 1e-5),
        (1.0, 2.0, 0.3, 1e-5),
        (1.0, 2.0, 1.0, 5e-4),
        (0.02, 3.0, 0.05, 1e-6),
    ],
)
def test_work_of_the_oscillator(mass, damping, length, tolerance):
    """Against the integrated equation of motion, through reversals and slow breaks."""
    K = 1.5
    begin = 0.1
    start = Motion(0.1, 0.15, -0.4)
    drive = Quadratic(0.0, 0.2, -1.0, 2.0)
    load = Load(0.1, 0.5, 0.7, -0.3)

    def slope(t, state):
        X, V, _, _ = state
        D, velocity = drive_at(drive, begin + t)
        held = load.stiffness * (X - start.X) - load.loss * t - 0.5 * load.ramp * t * t
        pull = K * (D - X)
        forces = (pull - load.force - held) / mass
        return [V, forces - damping * V, pull * velocity, V * V]

    how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    exact = solve_ivp(slope, (0, length), [start.X, start.V, 0, 0], **how)
    X, V, work, squares = exact.y[:, -1]
    got = travel(Slider(K, mass, damping), drive, start, load, length)
    assert pytest.approx([X, V], abs=1e-12) == [got.X, got.V]
    assert [got.work, got.squares] == pytest.approx([work, squares], abs=tolerance)
