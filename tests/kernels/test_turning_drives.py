"""Random rigs, from ringing to a thousandfold overdamped, under drives that reverse.

Both solvers cover long intervals in one closed form; a slider that reverses within one
must still break all contacts that it reaches. The checks hold for every rig: no force
beyond the thresholds, balances that close, and the same motion as a plain loop in small
steps and as the other solver.
"""

import math
from dataclasses import dataclass
from functools import reduce

import numpy as np
import pytest
from benches import imbalance
from scipy.linalg import expm

import stickslip as ss
from stickslip.kernels import events as kernel
from stickslip.kernels.drive import (
    FINISHED,
    Piece,
    Quadratic,
    Sampling,
    drive_at,
    turns_at,
)
from stickslip.kernels.event_motion import make_motion
from stickslip.kernels.oscillator import Slider
from stickslip.simulation.driver import follow
from stickslip.simulation.engines import Beginning, engine_of
from stickslip.simulation.engines.base import Advance

BROAD = ss.Uniform(low=0.3, high=1.7)
COARSE = ss.MasterEquation(rtol=2e-4)
ONE_RUN = 10.0 * COARSE.rtol  # accuracy of the slider's position
QUICK = 8
ALL = 312


def seeds(quick):
    """Return all seeds, marking as slow those that are not quick."""
    slow = pytest.mark.slow
    return [pytest.param(n, marks=() if n in quick else slow) for n in range(ALL)]


every_rig = pytest.mark.parametrize("seed", seeds(range(QUICK)))


@dataclass(frozen=True)
class Case:
    """A slider, its damping ratio with all contacts attached, and its drive."""

    slider: ss.Slider
    ratio: float
    drive: ss.model.Drive

    @property
    def omega(self) -> float:
        """Angular frequency with all contacts attached."""
        return math.sqrt((self.slider.stiffness + 1.0) / self.slider.mass)


def case_of(seed):
    """A random rig whose drive reverses in each of one to three pieces, with breaks."""
    rng = np.random.default_rng([seed, 2024])
    ratio, stiffness, omega = 10 ** rng.uniform([-2, math.log10(0.3), 0], [3, 1, 2])
    mass = (stiffness + 1.0) / omega**2
    slider = ss.Slider(stiffness=stiffness, mass=mass, damping=2.0 * ratio * omega)
    pieces = []
    for _ in range(rng.integers(1, 4)):
        # Long compared with the slowest relaxation, which in most pieces decays
        # completely.
        duration = 10 ** rng.uniform(1.5, 3.3) * max(ratio, 1.0) / omega
        farthest = rng.uniform(0.3, 3.0) * (stiffness + 1.0) / stiffness
        velocity = rng.choice([-1, 1]) * 4.0 * farthest / duration
        end = -velocity * (1.0 if rng.random() < 0.4 else rng.uniform(0.5, 1.5))
        pieces.append(ss.ramp(velocity, end, duration))
    return Case(slider, ratio, reduce(ss.model.Drive.then, pieces))


def delay_of(seed, drive):
    """No delay, an infinite one, or some part of a piece."""
    return ss.Delay([0.0, math.inf, 0.02 * drive.pieces[0].duration][seed % 3])


def run_of(case, delay, method, samples=2000):
    interface = ss.Interface(thresholds=BROAD, delay=delay)
    output = ss.Output(interval=case.drive.duration / samples)
    rig = ss.Rig(interface, case.slider, case.drive)
    return ss.simulate(rig, method=method, output=output)


def matrix_of(slider, held):
    """Rates of slider and drive, position to acceleration, and the contacts' force."""
    matrix = np.zeros((6, 6))
    matrix[0, 1] = matrix[2, 3] = matrix[3, 4] = 1.0
    held += slider.stiffness
    matrix[1] = -held, -slider.damping * slider.mass, slider.stiffness, 0.0, 0.0, 1.0
    matrix[1] /= slider.mass
    return matrix


def plain(case, birth, threshold, newborn, delay, times):
    """Return position, force and number of attached contacts, in small steps that check
    each contact.

    The slider's equation is linear while the same contacts hold: a step is a matrix
    exponential. Where a contact would be stretched beyond its threshold, or the slider
    reverses close to it, the moment is found by bisection.
    """
    slider = case.slider
    N = len(birth)
    birth, threshold = np.array(birth), np.array(threshold)
    holds = np.ones(N, bool)
    back = np.full(N, math.inf)
    newborn = iter(newborn)
    known = {}

    def go(state, dt):
        if (n, dt) not in known:
            known[n, dt] = expm(matrix_of(slider, n / N) * dt)
        return known[n, dt] @ state

    def broken(state, margin=0.0):
        return holds & (np.abs(state[0] - birth) >= threshold - margin)

    def first(state, dt, happens):
        """Time in (0, dt] at which something first happens, as it has by the end."""
        low = 0.0
        high = dt
        while high - low > 1e-14 * dt and low < 0.5 * (low + high) < high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if happens(go(state, middle)) else (middle, high)
            known.pop((n, middle), None)
        return high

    rows = []
    t, n, state = 0.0, N, np.append(np.zeros(5), birth.sum() / N)
    ends = np.cumsum([piece.duration for piece in case.drive.pieces])
    for piece, end in zip(case.drive.pieces, ends, strict=True):
        state[3] = piece.start
        state[4] = piece.acceleration
        steps = piece.duration * case.omega / 0.2 if case.ratio < 3.0 else 0.0
        pace = piece.duration / max(steps, 2000.0)
        while t < end:
            due = times[len(rows)] if len(rows) < len(times) else math.inf
            stop = min(end, back.min(), due)
            dt = pace if t + pace < stop else stop - t
            if dt > 0.0:
                there = go(state, dt)
                way = dt * (abs(state[1]) + abs(there[1]))
                if state[1] * there[1] < 0.0 and broken(there, way).any():
                    # The farthest point may lie within the step and be too far.
                    sign = np.sign(there[1])
                    dt = first(state, dt, lambda at, sign=sign: at[1] * sign >= 0.0)
                    there = go(state, dt)
                    there[1] = sign * 1e-300
                if broken(there).any():
                    dt = first(state, dt, lambda at: broken(at).any())
                    there = go(state, dt)
                t = stop if t + dt >= stop else t + dt
                state = there
                for i in np.flatnonzero(broken(state)):
                    holds[i] = False
                    back[i] = t + delay
                    n, state[5] = n - 1, birth[holds].sum() / N
                if len(known) > 200:
                    known.clear()
            if back.min() <= t:
                for i in np.flatnonzero(back <= t):
                    holds[i] = True
                    back[i] = math.inf
                    birth[i] = state[0]
                    threshold[i] = next(newborn)
                    n, state[5] = n + 1, birth[holds].sum() / N
            while len(rows) < len(times) and times[len(rows)] <= t:
                force = np.sum(state[0] - birth[holds]) / N
                rows.append((state[0], force, holds.mean()))
    return np.array(rows)


@pytest.mark.takes(4)  # the loop is plain Python
@pytest.mark.parametrize("seed", seeds({0, 1, 3, 5, 6, 7}))
@pytest.mark.eq(11)
def test_contacts_move_as_in_a_plain_loop(seed):
    case = case_of(seed)
    rng = np.random.default_rng([seed, 7])
    N = int(rng.integers(1, 7))
    birth = -rng.normal(0.0, 0.1, N)
    threshold = rng.uniform(0.4, 1.6, N)
    newborn = rng.uniform(0.3, 1.7, 4000)
    delay = [math.inf, 0.03 * case.drive.pieces[0].duration, 0.0][seed % 3]
    times = case.drive.duration * np.linspace(0.0, 0.999, 200)
    none = np.zeros(0)
    state = kernel.make_state(birth, threshold, none, threshold, 0.1, make_motion())
    slider = Slider(case.slider.stiffness, case.slider.mass, case.slider.damping)
    samples = np.full((times.size, 8), np.nan)
    sampling = Sampling(times, samples)
    draws = kernel.ContactDraws(newborn, np.empty(0), delay)
    begin = 0.0
    place = 0.0
    for piece in case.drive.pieces:
        end = begin + piece.duration
        drive = Piece(Quadratic(begin, place, piece.start, piece.acceleration), end)
        # with `None`, as the engine passes it; else it is compiled again
        how = sampling, draws, 10**8, None
        assert kernel.advance_events(state, slider, drive, *how) == FINISHED
        begin = end
        place = place + 0.5 * (piece.start + piece.end) * piece.duration
    exact = plain(case, birth, threshold, newborn, delay, times)
    assert np.abs(samples[:, [0, 2, 3]] - exact).max() < 1e-6


@every_rig
@pytest.mark.parametrize(
    ("method", "slack"), [(ss.Contacts(500, seed=3), 1e-9), (COARSE, ONE_RUN)]
)
@pytest.mark.eq(4, 11)
def test_forces_stay_within_the_thresholds_and_balances_close(seed, method, slack):
    case = case_of(seed)
    delay = delay_of(seed, case.drive)
    run = run_of(case, delay, method)
    attached = run["attached"].to_numpy()
    force = np.abs(run["friction_force"].to_numpy())
    assert np.all(force <= BROAD.high * attached + slack)
    assert imbalance(run) < slack
    assert np.all((attached >= 0.0) & (attached <= 1.0 + 1e-11))
    if delay.time == 0.0:
        assert attached == pytest.approx(1.0, abs=1e-11)
    # between the ends of a step of the master equation each value has its error
    if delay.time == math.inf:
        most = 2.0 * COARSE.rtol if method is COARSE else 1e-12
        assert np.all(np.diff(attached) <= most)


@pytest.mark.parametrize("damping", [10.0, 1e3, 1e4, 1e6])
@pytest.mark.parametrize(
    ("ageing", "method"),
    [
        (ss.Langevin(rate=0.1), ss.Contacts(50, seed=1)),
        (ss.Langevin(rate=0.1), COARSE),
        (ss.LogarithmicGrowth(slope=0.1, time=1.0), ss.Contacts(50, seed=1)),
    ],
    ids=["contacts", "kinetic equation", "growing"],
)
@pytest.mark.eq(11)
def test_ageing_contacts_hold_a_slider_as_springs_do(damping, ageing, method):
    """Below all thresholds contacts are springs, for up to 5e5 of the fastest
    relaxation times.
    """
    thresholds = ss.Gaussian(mean=1.0, std=0.1)
    initial = ss.Gaussian(mean=0.0, std=1e-9)
    interface = ss.Interface(thresholds=thresholds, initial=initial, ageing=ageing)
    slider = ss.Slider(stiffness=2.0, mass=1e-4, damping=damping)
    duration = max(1.0, 5e-5 * damping)
    drive = ss.ramp(1.2 / duration, -1.2 / duration, duration)
    rig = ss.Rig(interface, slider, drive)
    run = ss.simulate(rig, method=method, output=ss.Output(interval=duration / 20))
    (piece,) = drive.pieces
    start = np.array([0.0, 0.0, 0.0, piece.start, piece.acceleration, 0.0])
    matrix = matrix_of(slider, 1.0)
    exact = [(expm(matrix * t) @ start)[0] for t in run["time"].to_numpy()]
    for name in ("displacement", "friction_force"):
        assert run[name].to_numpy() == pytest.approx(exact, abs=1e-7)


def pieces_of(seed):
    """Holds, ramps that reverse and jumps of the velocity, at odd times."""
    rng = np.random.default_rng([seed, 31])
    drive = ss.constant(rng.uniform(0.3, 2.0), rng.uniform(0.1, 5.0))
    for kind in rng.integers(0, 3, rng.integers(2, 7)):
        duration = rng.uniform(0.1, 3.0)
        v, w = rng.uniform(0.2, 2.0, 2)
        turning = ss.ramp(v, -w, duration)
        held, back = ss.constant(0.0, duration), ss.constant(-v, duration)
        piece = (held, turning, back)[kind]
        drive = drive.then(piece)
    return drive


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("sliding", [0.0, 0.2])
def test_a_chain_in_balance_gets_to_the_end_of_every_drive(seed, sliding):
    drive = pieces_of(seed)
    fields = {"delay": ss.Delay(0.05), "sliding_force": sliding}
    interface = ss.Interface(thresholds=ss.Gaussian(1.0, 0.1), **fields)
    chain = ss.Chain(blocks=1, coupling=3.0, mass=0.03, damping=6.0, side=2.0)
    calls = iter(range(50))

    def report(_):
        assert next(calls, None) is not None, "the run stands still"

    rig = ss.Rig(interface, chain, drive, method=ss.QuasiStatic(20))
    run = ss.simulate(rig, progress=report)
    assert run["time"][-1] == pytest.approx(drive.duration, rel=1e-9)
    assert np.isfinite(run["friction_force"]).all()


@pytest.mark.parametrize("seed", range(40))
def test_a_piece_of_a_drive_turns_once(seed):
    rng = np.random.default_rng([seed, 32])
    start, velocity, acceleration = rng.uniform(-10.0, 10.0, 3)
    drive = Quadratic(start, 0.0, velocity, acceleration)
    turn = turns_at(drive, -1e6)
    assert abs(drive_at(drive, turn)[1]) < 1e-12
    assert turns_at(drive, turn) == math.inf


AGEING = ss.Langevin(rate=0.3, newborn=0.2)
GROWING = ss.LogarithmicGrowth(slope=0.05, time=0.1)
HOT = ss.Bell(width=0.02, attempts=1e3)
FREE = ss.Slider(stiffness=1.0, mass=0.03, damping=6.0)
BAR = ss.Chain(blocks=2, coupling=3.0, mass=0.03, damping=6.0, side=2.0)
COHORTS = ss.MasterEquation(rtol=1e-2)
OF_ALL = {
    "contacts": ({}, FREE, ss.Contacts(20, seed=1)),
    "contacts that age": ({"ageing": AGEING}, FREE, ss.Contacts(10)),
    "contacts that grow": ({"ageing": GROWING}, FREE, ss.Contacts(10)),
    "hot contacts": ({"activation": HOT}, FREE, ss.Contacts(10)),
    "master equation": ({}, FREE, COHORTS),
    "kinetic equation": ({"ageing": AGEING, "delay": ss.Delay(0.0)}, FREE, COHORTS),
    "blocks": ({}, BAR, ss.Contacts(10)),
    "counted contacts": ({}, FREE, ss.Population(20, rtol=1e-2)),
    "blocks in balance": ({}, BAR, ss.QuasiStatic(10)),
    "blocks in balance that slide": ({"sliding_force": 0.2}, BAR, ss.QuasiStatic(10)),
}


@pytest.mark.parametrize("name", OF_ALL)
@pytest.mark.parametrize("seed", range(3))
def test_engines_get_to_the_end_of_every_drive(seed, name):
    parts, slider, method = OF_ALL[name]
    usual = {"thresholds": ss.Gaussian(1.0, 0.1), "delay": ss.Delay(0.05)}
    interface = ss.Interface(**usual | parts)
    drive = pieces_of(seed)
    run = ss.simulate(ss.Rig(interface, slider, drive, method=method))
    assert run["time"][-1] == pytest.approx(drive.duration, rel=1e-9)
    assert np.isfinite(run["friction_force"]).all()


@pytest.mark.parametrize("method", [ss.Contacts(20), ss.MasterEquation(rtol=1e-2)])
def test_an_engine_that_stands_still_is_no_run_without_end(method):
    interface = ss.Interface(thresholds=ss.Gaussian(1.0, 0.1))
    solver = engine_of(interface, method)

    class Stuck(solver):
        def advance(self, leg):
            if self.here()[0] > 0.0:
                none = np.empty((0, len(self.columns)))
                return Advance(none, (), over=False)
            return super().advance(leg._replace(end=0.5))._replace(over=False)

    engine = Stuck(Beginning(interface, FREE, 1.0), method)
    with pytest.raises(RuntimeError, match=r"^Stuck: stands still at t = 0\.\d+ on"):
        follow(engine, ss.constant(1.0, 1.0), 0.0, np.zeros(1))
