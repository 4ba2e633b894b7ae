"""The event engine by itself: its queue, its closed forms, and its sums."""

import heapq
import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from stickslip.kernels import events as kernel
from stickslip.kernels import flight as flights
from stickslip.kernels.drive import DRAWS_USED_UP, FINISHED, Piece, Quadratic, Sampling
from stickslip.kernels.event_queue import (
    clear,
    drop,
    first_slot,
    make_queue,
    peek,
    pop,
    push,
    size,
    used,
)
from stickslip.kernels.motion import make_motion
from stickslip.kernels.oscillator import Slider


class Rig(NamedTuple):
    """Slider, and the delay of every contact: NaN for random ones."""

    slider: Slider
    delay: float


# ------------------------------------------------------------------------------------------------ the bucket queue


keys = st.one_of(
    st.floats(-5, 5),
    st.integers(-3, 3).map(float),  # many equal keys, and keys on the edges of bins
    st.floats(-1e6, 1e6),  # many turns of the wheel ahead
)
steps = st.lists(st.one_of(keys, st.none()), max_size=60)  # a key to push, or a pop


@settings(max_examples=60)
@given(st.lists(st.tuples(st.floats(-5, 5), st.booleans(), st.integers(0, 11)), max_size=200), st.floats(0.01, 3.0))
def test_entries_that_are_dropped_anywhere_leave_room_for_others(steps, width):
    """A queue of 12 entries, pushed and dropped at will: places are used again, entries are moved together."""
    queue = make_queue(12, 16, width)
    held: dict[int, float] = {}
    for slot, (key, drops, which) in enumerate(steps):
        places = {int(queue.entries[i]["slot"]): i for i in range(used(queue)) if queue.entries[i]["key"] < math.inf}
        assert {other: float(queue.entries[place]["key"]) for other, place in places.items()} == held
        if held and (drops or len(held) == 12):
            gone = sorted(held)[which % len(held)]
            drop(queue, places[gone])
            del held[gone]
        else:
            assert float(queue.entries[push(queue, key, slot)]["key"]) == key
            held[slot] = key
        if which % 3 == 0:
            assert peek(queue) == min(held.values(), default=math.inf)
    assert size(queue) == len(held)


@settings(max_examples=60)
@given(steps, st.sampled_from([16, 64]), st.sampled_from([0.01, 0.3, 1.0, 50.0]), st.floats(-3, 3))
def test_the_queue_gives_what_a_heap_gives(steps, bins, width, start):
    queue = make_queue(40, bins, width)
    clear(queue, start)
    heap: list[tuple[float, int]] = []
    slots_of: dict[float, set[int]] = {}
    for slot, key in enumerate(steps):
        assert peek(queue) == (heap[0][0] if heap else math.inf)
        assert size(queue) == len(heap)
        if key is not None and len(heap) < 40:
            push(queue, key, slot)
            heapq.heappush(heap, (key, slot))
            slots_of.setdefault(key, set()).add(slot)
        elif key is None and heap:
            smallest, _ = heapq.heappop(heap)
            # Among equal keys any order will do; each slot comes once.
            slots_of[smallest].remove(first_slot(queue))
            pop(queue)
    rest = []
    while (key := peek(queue)) < math.inf:
        slots_of[key].remove(first_slot(queue))
        rest.append(key)
        pop(queue)
    assert rest == sorted(key for key, _ in heap)
    assert not any(slots_of.values())


# ------------------------------------------------------------------------------------------------ between events

COEFFICIENTS = [
    # eta, w2, v, f0, f1, f2: under, over, critically and not damped, and all terms of the force
    (200.0, 3e4, 1.0, 50.0, 2e4, 0.0),
    (200.0, 1e4, 1.0, -300.0, 2e4, 5e3),
    (42.4, 3e4, -2.0, 1e3, -1e4, 1e3),
    (0.0, 2e4, 0.5, 10.0, 0.0, 0.0),
    (1e5, 3e4, 1.0, -8e4, 2e4, 0.0),
    (1e3, 1.0, 3.0, 5.0, -1.0, 2.0),
    (2.0, 1.0, 1.0, 0.0, 0.0, 0.0),
    (2.0, 1.0000001, 1.0, 0.5, 0.0, 0.0),
]


def flight_of(eta, w2, v, f0, f1, f2):
    return flights.take_off(eta, w2, flights.NEAR / (eta + math.sqrt(w2)), v, f0, f1, f2)


@pytest.mark.parametrize("numbers", COEFFICIENTS)
@pytest.mark.eq(11)
def test_a_flight_solves_the_equation_of_motion(numbers):
    eta, w2, v, f0, f1, f2 = numbers
    flight = flight_of(*numbers)
    unit = 1.0 / (eta + math.sqrt(w2))
    h = unit * np.array([0.01, 0.05, 0.07, 0.2, 0.299, 0.301, 1.0, 3.0, 12.0])

    def slope(t, state):
        y, u, _, _ = state
        return [u, f0 + f1 * t + f2 * t * t - eta * u - w2 * y, y, u * u]

    exact = solve_ivp(slope, (0, h[-1]), [0, v, 0, 0], "DOP853", h, rtol=1e-13, atol=1e-18, max_step=0.2 * unit).y
    got = np.array([flights.at(flight, float(t)) for t in h]).T
    # The closed form carries how far the slider lags behind a slow drive, and rounds as it does.
    lag = 1e-15 * (abs(flight.q0) + abs(flight.q1) * unit)
    scale = np.maximum(np.abs(exact[:2]), [[abs(v) * unit], [abs(v)]])
    assert np.all(np.abs(got - exact[:2]) < 1e-11 * scale + [[lag], [lag / unit]])
    for order in range(3):
        for t in h.tolist():
            here, slope_here = flights.derivative(flight, order, t)
            step = 1e-4 * unit
            before, after = (flights.derivative(flight, order, t + side * step)[0] for side in (-1, 1))
            size = (abs(v) + abs(f0) * unit + abs(f1) * unit**2) / unit ** (order - 1)
            slack = 1e-6 * size / unit + lag / unit**order / step
            assert (after - before) / (2 * step) == pytest.approx(slope_here, abs=slack)
            if order < 2:
                assert here == pytest.approx(flights.at(flight, t)[order], abs=1e-10 * size + lag / unit**order)


def crossed(flight, walls, most, times, slack):
    """Look for the first crossing of two walls; until then no sample at these times may lie beyond one."""
    h, side = flights.first_crossing(flight, *walls, most, np.zeros(16))
    assert 0 < h <= most
    before = np.array([flights.far(flight, float(t))[0] for t in times if t < h])
    assert np.all((before <= walls[0] + slack) & (before >= -walls[1] - slack))
    if side:
        assert flights.far(flight, h)[0] == pytest.approx(walls[0] if side == 1 else -walls[1], abs=slack)


@settings(max_examples=200)
@given(
    st.sampled_from(COEFFICIENTS),
    st.floats(-3, 3),
    st.tuples(st.floats(0.01, 3), st.floats(0.01, 3)),
    st.floats(0.1, 20),
)
def test_the_first_crossing_is_the_first(numbers, v, walls, reach):
    eta, w2, _, *force = numbers
    unit = 1.0 / (eta + math.sqrt(w2))
    flight = flight_of(eta, w2, v, *force)
    slack = 1e-9 * unit + 4e-14 * (abs(flight.q0) + abs(flight.y0))
    crossed(flight, np.array(walls) * unit, reach * unit, np.linspace(0, reach * unit, 2000), slack)


@settings(max_examples=200)
@given(
    damping=st.one_of(st.floats(-2, 4).map(lambda power: 10**power), st.floats(-1e-4, 1e-4).map(lambda by: 1 + by)),
    lasting=st.floats(-1, 5),
    end=st.one_of(st.floats(-1.1, -0.9), st.floats(-3, 1)),
    force=st.one_of(st.just(0.0), st.floats(-1, 1)),
    walls=st.tuples(st.floats(0.05, 1.1), st.floats(0.05, 1.1)),
)
@pytest.mark.eq(11)
def test_no_crossing_hides_behind_a_turn_of_the_drive(damping, lasting, end, force, walls):
    """From rest, under a drive that turns once, for up to 1e5 times the slowest relaxation, of any damping ratio."""
    w2, speed = 3e4, 0.1
    g = damping * math.sqrt(w2)
    slowest = g if damping <= 1 else w2 / (g + math.sqrt(g * g - w2))
    most = 10**lasting / slowest
    # The force on the slider changes at a rate that is `end` times as large in the end, the other way if negative.
    rate = 0.7 * w2 * speed
    flight = flight_of(2 * g, w2, 0.0, force * w2 * speed / slowest, rate, 0.5 * rate * (end - 1) / most)
    t = np.concatenate([np.geomspace(1e-6 * most, most, 200), np.linspace(0, most, 300)])
    farthest = np.abs([flights.at(flight, float(time))[0] for time in t]).max()
    slack = 1e-12 * (abs(flight.q0) + abs(flight.y0) + abs(flight.q1) * most + abs(flight.q2) * most**2)
    crossed(flight, np.array(walls) * farthest + slack, most, t, slack)


# ------------------------------------------------------------------------------------------------ event by event


def pulled(rig, birth, threshold, pending, thresholds, delays, drive, times, X=0.0, velocity=0.0):
    """Run the engine over one piece of a drive; samples, the state at the end, and why it stopped."""
    given = (np.asarray(part, float) for part in (birth, threshold, pending))
    state = kernel.make_state(*given, 0.1, make_motion(X, velocity))
    D0, v0, a, end = drive
    samples = np.full((times.size, 8), np.nan)
    piece, sampling = Piece(Quadratic(0.0, D0, v0, a), end), Sampling(times, samples)
    why = kernel.advance(state, rig.slider, piece, sampling, kernel.Draws(thresholds, delays, rig.delay), 10**9)
    return samples, state, why


def test_blocks_of_random_numbers_and_budgets_change_nothing():
    """Thresholds handed over in blocks, and returns in between, leave every number as it is."""
    rng = np.random.default_rng(1)
    N = 50
    rig = Rig(Slider(2.0, 1e-4, 200.0), 0.1)
    birth, threshold = rng.normal(0, 0.01, N), rng.normal(1, 0.1, N)
    all_thresholds = rng.normal(1, 0.1, 4_000)
    drive, times = (0.0, 1.0, 0.0, 5.0), np.linspace(0, 5, 51)
    whole, end_state, _ = pulled(rig, birth, threshold, [], all_thresholds, np.empty(0), drive, times)
    state = kernel.make_state(birth, threshold, np.empty(0), 0.1, make_motion())
    samples = np.full((times.size, 8), np.nan)
    piece, sampling = Piece(Quadratic(0.0, 0.0, 1.0, 0.0), 5.0), Sampling(times, samples)
    blocks = iter(np.split(all_thresholds, range(7, 4_000, 7)))
    draws = kernel.Draws(next(blocks), np.empty(0), rig.delay)
    while (why := kernel.advance(state, rig.slider, piece, sampling, draws, 11)) != FINISHED:
        if why == DRAWS_USED_UP:
            draws, state.motion[0].thresholds_used = draws._replace(thresholds=next(blocks)), 0
    np.testing.assert_array_equal(samples, whole)
    end, whole_end = state.motion[0].copy(), end_state.motion[0]
    assert end.thresholds_used == (whole_end.thresholds_used - 1) % 7 + 1
    end.thresholds_used = whole_end.thresholds_used
    assert end == whole_end


@pytest.mark.parametrize("N", [1, 2, 13, 300])
def test_sums_and_queues_survive_many_rebuilds(N):
    """A slider pulled to and fro: entries go stale on both sides, and both queues are filled anew many times."""
    rng = np.random.default_rng(5)
    slider, sampling = Slider(4.0, 1e-2, 3.0), Sampling(np.empty(0), np.empty((0, 8)))
    thresholds = rng.uniform(0.01, 0.05, 400_000)
    state = kernel.make_state(np.zeros(N), rng.uniform(0.01, 0.05, N), np.empty(0), 0.0, make_motion())
    t, D, velocity, used = 0.0, 0.0, 1.0, 0
    for _ in range(20):
        piece = Piece(Quadratic(t, D, velocity, 0.0), t + 1.0)
        why = kernel.advance(state, slider, piece, sampling, kernel.Draws(thresholds[used:], np.empty(0), 0.0), 10**9)
        used += state.motion[0].thresholds_used
        state.motion[0].thresholds_used = 0
        assert why == FINISHED
        t, D, velocity = t + 1.0, D + velocity, -velocity
    contacts = kernel.attached_contacts(state)
    x = state.motion[0].position - contacts["birth"]
    assert used == state.motion[0].breaks
    assert used > 20 * N * 5
    assert state.motion[0].attached == N
    assert np.all(np.abs(x) <= contacts["threshold"] * (1 + 1e-12))
    assert kernel.force_of(state) == pytest.approx(np.mean(x), abs=1e-12)
