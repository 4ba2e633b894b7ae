"""The event engine by itself: its queue, its closed forms, and its sums."""

import math
from functools import reduce

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.errors import InputError
from stickslip.kernels import events, hazard
from stickslip.kernels import flight as flights
from stickslip.kernels.drive import Quadratic, Stop
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
from stickslip.kernels.thinning import Rule, box_of, threshold_now
from stickslip.simulation.driver import follow
from stickslip.simulation.engines import Beginning, Leg, contacts

keys = st.one_of(
    st.floats(-5, 5),
    st.integers(-3, 3).map(float),  # many equal keys, and keys on edges of bins
    st.floats(-1e6, 1e6),  # many turns of the wheel ahead
)
places = st.tuples(st.one_of(keys, st.none(), st.just(math.nan)), st.integers(0, 11))
steps = st.lists(places, max_size=200)
"""A key to push; None to remove the smallest, NaN to remove any."""


BINS = st.sampled_from([16, 64])
WIDTHS = st.sampled_from([0.01, 0.3, 1.0, 50.0])


@settings(max_examples=100)
@given(steps, BINS, WIDTHS, st.floats(-3, 3))
def test_the_queue_gives_the_smallest_and_reuses_room(steps, bins, width, start):
    """With 12 entries: places are reused; equal keys come in any order."""
    queue = make_queue(12, bins, width)
    clear(queue, start)
    held: dict[int, float] = {}
    for slot, (key, which) in enumerate(steps):
        entries = {i: queue.entries[i] for i in range(used(queue))}
        kept = {i: each for i, each in entries.items() if each["key"] < math.inf}
        places = {int(each["slot"]): i for i, each in kept.items()}
        assert {int(each["slot"]): float(each["key"]) for each in kept.values()} == held
        if key is None and held:
            assert peek(queue) == min(held.values()) == held.pop(first_slot(queue))
            pop(queue)
        elif held and (key is None or math.isnan(key) or len(held) == 12):
            gone = sorted(held)[which % len(held)]
            drop(queue, places[gone])
            del held[gone]
        elif key is not None and not math.isnan(key):
            assert float(queue.entries[push(queue, key, slot)]["key"]) == key
            held[slot] = key
        if which % 3 == 0:
            assert peek(queue) == min(held.values(), default=math.inf)
        assert size(queue) == len(held)


COEFFICIENTS = [
    # eta, w2, v, f0, f1, f2: under, over, critically and not damped, and all terms of
    # the force
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
    step = flights.NEAR / (eta + math.sqrt(w2))
    return flights.take_off(eta, w2, step, v, f0, f1, f2)


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

    exact = {"rtol": 1e-13, "atol": 1e-18, "max_step": 0.2 * unit}
    exact = solve_ivp(slope, (0, h[-1]), [0, v, 0, 0], "DOP853", h, **exact).y
    got = np.array([flights.at(flight, float(t)) for t in h]).T
    # The closed form contains the lag behind a slow drive, and has its rounding.
    lag = 1e-15 * (abs(flight.q0) + abs(flight.q1) * unit)
    scale = np.maximum(np.abs(exact[:2]), [[abs(v) * unit], [abs(v)]])
    assert np.all(np.abs(got - exact[:2]) < 1e-11 * scale + [[lag], [lag / unit]])
    for order in range(3):
        for t in h.tolist():
            here, slope_here = flights.derivative(flight, order, t)
            step = 1e-4 * unit
            both = (flights.derivative(flight, order, t + by) for by in (-step, step))
            before, after = (each[0] for each in both)
            size = (abs(v) + abs(f0) * unit + abs(f1) * unit**2) / unit ** (order - 1)
            slack = 1e-6 * size / unit + lag / unit**order / step
            assert (after - before) / (2 * step) == pytest.approx(slope_here, abs=slack)
            if order < 2:
                error = 1e-10 * size + lag / unit**order
                assert here == pytest.approx(flights.at(flight, t)[order], abs=error)


def crossed(flight, walls, most, times, slack):
    """Find the first crossing of two limits; no sample before may lie beyond one."""
    h, side = flights.first_crossing(flight, *walls, most, np.zeros(16))
    assert 0 < h <= most
    before = np.array([flights.far(flight, float(t))[0] for t in times if t < h])
    assert np.all((before <= walls[0] + slack) & (before >= -walls[1] - slack))
    if side:
        wall = walls[0] if side == 1 else -walls[1]
        assert flights.far(flight, h)[0] == pytest.approx(wall, abs=slack)


POWERS = st.floats(-2, 4).map(lambda power: 10**power)
NEARLY_ONE = st.floats(-1e-4, 1e-4).map(lambda by: 1 + by)


@settings(max_examples=200)
@given(
    damping=st.one_of(POWERS, NEARLY_ONE),
    lasting=st.floats(-1, 5),
    end=st.one_of(st.floats(-1.1, -0.9), st.floats(-3, 1)),
    force=st.one_of(st.just(0.0), st.floats(-1, 1)),
    walls=st.tuples(st.floats(0.05, 1.1), st.floats(0.05, 1.1)),
)
@pytest.mark.eq(11)
def test_no_crossing_hides_behind_a_turn(damping, lasting, end, force, walls):
    """From rest, through reversals, up to 1e5 relaxations, at any damping ratio."""
    w2 = 3e4
    speed = 0.1
    g = damping * math.sqrt(w2)
    slowest = g if damping <= 1 else w2 / (g + math.sqrt(g * g - w2))
    most = 10**lasting / slowest
    # The rate of change of the force is `end` times as large at the end, and opposite
    # if `end` is negative.
    rate = 0.7 * w2 * speed
    turn = 0.5 * rate * (end - 1) / most
    flight = flight_of(2 * g, w2, 0.0, force * w2 * speed / slowest, rate, turn)
    early = np.geomspace(1e-6 * most, most, 200)
    t = np.append(early, np.linspace(0, most, 300))
    farthest = np.abs([flights.at(flight, float(time))[0] for time in t]).max()
    pulled = abs(flight.q0) + abs(flight.q1) * most + abs(flight.q2) * most**2
    slack = 1e-12 * (abs(flight.y0) + pulled)
    crossed(flight, np.array(walls) * farthest + slack, most, t, slack)


def test_pauses_change_nothing(monkeypatch):
    thresholds = ss.Gaussian(mean=1.0, std=0.1)
    interface = ss.Interface(thresholds=thresholds, delay=ss.Delay(0.1))
    slider = ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)
    drive = ss.constant(1.0, 5.0)
    rig = ss.Rig(interface, slider, drive, method=ss.Contacts(50, seed=1))
    whole = ss.simulate(rig)
    monkeypatch.setattr(contacts, "_EVENTS", 11)
    assert ss.simulate(rig).identical(whole)


@pytest.mark.parametrize("N", [1, 2, 13, 300])
def test_sums_and_queues_survive_many_rebuilds(N):
    """Back and forth: entries expire on both sides, and queues are refilled often."""
    interface = ss.Interface(thresholds=ss.Uniform(low=0.01, high=0.05))
    method = ss.Contacts(N, seed=5)
    slider = ss.Slider(stiffness=4.0, mass=1e-2, damping=3.0)
    engine = contacts.EventByEvent(Beginning(interface, slider, 1.0), method)
    both_ways = ss.constant(1.0, 1.0).then(ss.constant(-1.0, 1.0))
    drive = reduce(ss.model.Drive.then, 10 * [both_ways])
    lost = follow(engine, drive, 0.0, np.array([0.0, 20.0]))["broken_energy"]
    x, _, _ = engine.stretchings()
    assert x.size == N
    assert np.abs(x).max() <= 0.05 * (1 + 1e-12)
    assert lost[-1] > 100 * 0.5 * 0.03**2  # each has broken more than a hundred times
    assert engine.contact_force() == pytest.approx(np.mean(x), abs=1e-12)


RATES = st.floats(0.1, 3.0)
FORCES = st.floats(0.1, 2.0)


@settings(max_examples=300)
@given(RATES, FORCES, FORCES, st.floats(0.0, 10.0), st.floats(-8.5, 0.0))
def test_a_box_reaches_halfway_to_a_threshold(rate, newborn, strength, age, gap):
    """However near to a rising or falling threshold, it never leaves its box."""
    rule = Rule(hazard.NONE, hazard.Growth(hazard.EXPONENTIAL, rate, newborn))
    threshold = threshold_now(rule, strength, age)
    x = threshold - strength * 10.0**gap
    assume(x >= 0.0)
    box = box_of(rule, x, strength, age, 1.0, 0.0)
    assert box.time > 0.0
    assert box.reach - x >= 0.49 * (threshold - x)


@pytest.mark.parametrize(
    "mechanism",
    [
        {"ageing": ss.LogarithmicGrowth(slope=0.01, time=1.0)},
        {"ageing": ss.ExponentialGrowth(rate=0.5, newborn=0.1)},
        {"ageing": ss.model.TabulatedGrowth((0.1, 0.5, 2.0), (0.6, 1.0, 0.8))},
        {"activation": ss.model.Parabolic(temperature=0.01, attempts=1e3)},
    ],
)
def test_thresholds_below_the_rounding_of_positions_break(mechanism):
    """One threshold in twenty is below the rounding of the slider's position."""
    fields = {"delay": ss.Delay(0.05), **mechanism}
    interface = ss.Interface(thresholds=ss.Gamma(mean=1.0, std=2.0), **fields)
    slider = ss.Slider(stiffness=5.0, mass=1e-3, damping=50.0)
    how = {"method": ss.Contacts(50, seed=3), "start": ss.FromSliding()}
    rig = ss.Rig(interface, slider, ss.constant(1.0, 200.0), **how)
    run = ss.simulate(rig, output=ss.Output(interval=0.01))
    # each many correlation times of the force long
    means = run.spring_force[1:].to_numpy().reshape(20, -1).mean(axis=1)
    mean = ss.kinetic_friction(interface, 1.0) + slider.mass * slider.damping
    assert abs(means.mean() - mean) < 4.0 * means.std(ddof=1) / math.sqrt(20)


def test_time_goes_on_where_a_slider_slips_as_fast_as_thresholds_grow():
    """Long after the start the rounding of time exceeds the remaining distance."""
    growth = ss.LogarithmicGrowth(slope=0.0554, time=0.0424)
    interface = ss.Interface(thresholds=ss.Exponential(mean=1.0), ageing=growth)
    slider = ss.Slider(stiffness=0.825, mass=1.87e-4, damping=11.0)
    method = ss.Contacts(160, seed=1)
    engine = contacts.EventByEvent(Beginning(interface, slider, 0.1), method)
    rest = Quadratic(0.0, 0.0, 0.0, 0.0)
    drive = Quadratic(1e4, 0.0, 0.1, 0.0)
    assert engine.advance(Leg(rest, 1e4, np.empty(0), Stop())).over
    # some 3e4 events
    assert engine.advance(Leg(drive, 1e4 + 200.0, np.empty(0), Stop())).over


def test_a_run_whose_numbers_stop_being_finite_names_the_moment(monkeypatch):
    rig = ss.Rig(
        ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1)),
        ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4),
        ss.constant(1.0, duration=1.0),
        method=ss.Contacts(10, seed=1),
        output=ss.Output(interval=0.01),
    )
    advance = events.advance_events

    def overflow(state, slider, piece, sampling, *rest):
        why = advance(state, slider, piece, sampling, *rest)
        sampling.samples[10:, 0] = np.nan
        return why

    monkeypatch.setattr(events, "advance_events", overflow)
    message = r"from t = 0\.1 on the numbers of the run are not finite: .*mass"
    with pytest.raises(InputError, match=message):
        ss.simulate(rig)
