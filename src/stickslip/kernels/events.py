"""N contacts under a slider, event by event: no time step and no loop over contacts.

Between two events the slider is a damped oscillator of known stiffness (the spring and the attached contacts), pulled
by a known drive: its motion is known in closed form (`flight`). The next event is the earliest of

- the slider reaching the nearest breaking position, ahead (``birth position + threshold``) or behind
  (``birth position - threshold``),
- the next re-attachment of a broken contact,
- the end of the piece of the drive.

Breaking positions and times of re-attachment wait in bucket queues (`event_queue`), whose cost does not grow with the
number of contacts; the force needs two running sums, whatever that number. Samples are read off the closed form inside
the interval where they fall, so that sampling never changes the motion.

Symbols as in the paper, Eq. (11), per contact: ``K``, ``M``, ``eta``, slider position ``X``, drive position ``D``.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .drive import NOWHERE, Quadratic, Stop, holds
from .event_queue import BIN, FIRST, LAST, Queue, clear, first_slot, is_full, make_queue, peek, pop, push
from .flight import NEAR, Flight, at, energies, first_crossing, soon, take_off
from .oscillator import Slider

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]
Records = NDArray[np.void]

# Fields used together lie together: four contacts a cache line.
CONTACT = np.dtype([("birth", np.float64), ("threshold", np.float64)])

_NEAR_CACHE = 65_536  # contacts, at 16 bytes each, that the near caches of a core hold

# Why `advance` returned.
REACHED_END = 0
CONDITION_HELD = 1
THRESHOLDS_USED_UP = 2
DELAYS_USED_UP = 3
BUDGET_SPENT = 4
LOOK = 5


# ---------------------------------------------------------------------------------------------------------------------
# The state and what changes it
# ---------------------------------------------------------------------------------------------------------------------


class Piece(NamedTuple):
    """A piece of the drive up to `end`, or to a condition seen at a sample.

    `look` is a time at which the caller wants to look at the contacts: `advance` then returns before the flight that
    passes it, so that looking changes nothing.
    """

    drive: Quadratic
    end: float
    stop: Stop = Stop()
    look: float = math.inf


class Sampling(NamedTuple):
    """Rising times at which to sample, shape (n,), and the samples, shape (n, 8), filled with `COLUMNS`.

    Position, velocity, friction force, attached fraction, energy stored in contacts, and, accumulated since the
    start, work of the drive, energy lost to damping and in breaks; all per contact.
    """

    times: Floats
    samples: Floats


class Draws(NamedTuple):
    """Random numbers in the order of use: thresholds of contacts that attach, and delays of those that break.

    `fixed_delay` is the delay of all, infinite for none to re-attach, or NaN to take them from `delays`.
    """

    thresholds: Floats
    delays: Floats
    fixed_delay: float


class State(NamedTuple):
    """All that the next step needs: contacts, queues, motion.

    ``contacts`` holds birth position and threshold, shape (N,); a threshold of 0 marks a detached contact. ``ahead`` is
    keyed by ``birth + threshold``, ``behind`` by ``threshold - birth``, ``waiting``, of detached contacts, by time.
    Entries of ``ahead`` and ``behind`` outlive their contact and are recognised as stale when they come up.
    """

    contacts: Records
    ahead: Queue
    behind: Queue
    waiting: Queue
    motion: Floats
    counts: Counts
    cuts: Floats


# state.motion
TIME = 0
POSITION = 1
VELOCITY = 2
_SUM = 3  # sum of (birth - reference) over attached contacts
_SQUARES = 4  # sum of (birth - reference)**2
_REFERENCE = 5
WORK = 6  # of the drive, per contact, since the start
DAMPED = 7  # dissipated by damping
BROKEN = 8  # lost in breaks
LOOKED = 9  # position of the slider at the time of a look
_HALF = 10  # 1/(2 N)
# state.counts
ATTACHED = 0
SAMPLE = 1  # next sample
THRESHOLD = 2  # next threshold of those handed in
DELAY = 3
BREAKS = 4
EVENTS = 5

# columns of the samples
COLUMNS = ("displacement", "velocity", "friction_force", "attached", "stored", "work", "damped", "broken")


def make_state(
    birth: Floats,
    threshold: Floats,
    pending: Floats,
    scale_time: float,
    X: float = 0.0,
    velocity: float = 0.0,
) -> State:
    """Return the state of an interface.

    Parameters
    ----------
    birth, threshold : array, shape (N,)
        Slider position at which each contact has no stretching, and its threshold; the last ``len(pending)`` contacts
        are detached and must have threshold 0.
    pending : array, shape (n,)
        Times of re-attachment of the detached contacts; infinite for those that stay detached.
    scale_time : float
        Typical delay, for the width of the bins of times of re-attachment.
    X, velocity : float
        Position and velocity of the slider at time 0.
    """
    N = birth.size
    contacts = np.empty(N, CONTACT)
    contacts["birth"], contacts["threshold"] = birth, threshold
    attached = threshold > 0
    typical = threshold[attached][:4096] if attached.any() else np.ones(1)
    low, high = np.quantile(typical, [0.05, 0.95])
    # A dozen contacts in a bin where breaking positions are densest; at most some four empty bins per contact.
    reach = 2.0 * float(typical.max())
    width = max(40.0 * float(high - low) / N, reach / (2.0 * N), 1e-9 * reach)
    bins = _power_of_two(reach / width, 4 * N)
    time_width = 16.0 * scale_time / N if 0 < scale_time < math.inf else 1.0
    state = State(
        contacts=contacts,
        ahead=make_queue(2 * N + 64, bins, width),
        behind=make_queue(3 * N + 64, bins, width),
        waiting=make_queue(N + 64, _power_of_two(N / 8, N), time_width),
        motion=np.zeros(11),
        counts=np.zeros(6, np.int64),
        cuts=np.zeros(16),
    )
    state.motion[POSITION] = X
    state.motion[VELOCITY] = velocity
    state.motion[_HALF] = 0.5 / N
    state.counts[ATTACHED] = int(attached.sum())
    first_detached = N - pending.size
    for i in np.flatnonzero(np.isfinite(pending)):
        push(state.waiting, float(pending[i]), first_detached + int(i))
    _rebuild(state, state.ahead, 1.0)
    _rebuild(state, state.behind, -1.0)
    _sum_again(state)
    return state


def contact_force(state: State) -> float:
    """Force of the contacts, per contact."""
    x = state.motion[POSITION] - state.motion[_REFERENCE]
    return float((state.counts[ATTACHED] * x - state.motion[_SUM]) / state.contacts.size)


def stretchings(state: State, X: float) -> Floats:
    """Stretchings of the attached contacts with the slider at `X`: its own place, or that of a look, `LOOKED`."""
    contacts = state.contacts[state.contacts["threshold"] > 0]
    return np.asarray(X - contacts["birth"])


def _power_of_two(wanted: float, most: int) -> int:
    return 1 << max(4, min(math.ceil(math.log2(max(wanted, 1.0))), math.ceil(math.log2(most + 1))))


@bare
def _rebuild(state: State, queue: Queue, side: float) -> None:
    """Fill a queue of breaking positions anew from the attached contacts, leaving stale entries out."""
    clear(queue, side * state.motion[POSITION])
    for i in range(state.contacts.size):
        if state.contacts[i]["threshold"] > 0:
            push(queue, state.contacts[i]["threshold"] + side * state.contacts[i]["birth"], i)


@bare
def _sum_again(state: State) -> None:
    """Sum the birth positions afresh, about the present position: rounding cannot pile up."""
    reference = state.motion[POSITION]
    total, squares = 0.0, 0.0
    for i in range(state.contacts.size):
        if state.contacts[i]["threshold"] > 0:
            y = state.contacts[i]["birth"] - reference
            total += y
            squares += y * y
    state.motion[_SUM] = total
    state.motion[_SQUARES] = squares
    state.motion[_REFERENCE] = reference


@inlined
def _attach(state: State, slot: int, threshold: float) -> None:
    """A contact attaches, unstretched, where the slider is."""
    X = state.motion[POSITION]
    state.contacts[slot]["birth"] = X
    state.contacts[slot]["threshold"] = threshold
    y = X - state.motion[_REFERENCE]
    state.motion[_SUM] += y
    state.motion[_SQUARES] += y * y
    state.counts[ATTACHED] += 1
    if is_full(state.ahead):
        _rebuild(state, state.ahead, 1.0)
    else:
        push(state.ahead, threshold + X, slot)
    if is_full(state.behind):
        # Happens once in about 2 N attachments: a good moment to sum again, too.
        _rebuild(state, state.behind, -1.0)
        _sum_again(state)
    else:
        push(state.behind, threshold - X, slot)


@inlined
def _detach(state: State, slot: int) -> None:
    """A contact breaks, stretched to its threshold; its entry in the other queue goes stale."""
    y = state.contacts[slot]["birth"] - state.motion[_REFERENCE]
    state.motion[_SUM] -= y
    state.motion[_SQUARES] -= y * y
    state.motion[BROKEN] += state.contacts[slot]["threshold"] ** 2 * state.motion[_HALF]
    state.contacts[slot]["threshold"] = 0.0
    state.counts[ATTACHED] -= 1
    state.counts[BREAKS] += 1


@inlined
def _fetch(state: State, queue: Queue, bin_: int) -> None:
    """Read the contacts of a bin just put in use, all at once: one by one, each would be waited for.

    Only where they lie outside the near caches.
    """
    counts = queue.counts
    if state.contacts.size > _NEAR_CACHE and counts[BIN] != bin_:
        total = 0.0
        for i in range(counts[FIRST], counts[LAST]):
            total += state.contacts[queue.front_slot[i]]["birth"]
        state.cuts[0] = total  # so that the reads are not dropped


@inlined
def _next_break(state: State, queue: Queue, side: float) -> float:
    """Smallest key of a contact that is still attached; stale entries are dropped on the way."""
    while True:
        bin_ = queue.counts[BIN]
        key = peek(queue)
        if key == np.inf:
            return key
        _fetch(state, queue, bin_)
        slot = first_slot(queue)
        threshold = state.contacts[slot]["threshold"]
        if threshold > 0 and threshold + side * state.contacts[slot]["birth"] == key:
            return key
        pop(queue)


# ---------------------------------------------------------------------------------------------------------------------
# The engine
# ---------------------------------------------------------------------------------------------------------------------


class _Constants(NamedTuple):
    """What does not change: Eq. (11) with all of its numbers 0 for rigid motion, and ``1/N``.

    `near` is the time up to which the short Taylor expansion does.
    """

    K: float
    inverse_mass: float
    eta: float
    drag: float
    near: float
    N: float
    part: float
    rigid: bool


class _Leg(NamedTuple):
    """A flight from one event towards the next: where it begins, with which forces, and its motion."""

    t: float
    X: float
    n: float
    F_d: float
    drive_v: float
    flight: Flight


@inlined
def _constants(slider: Slider, N: float) -> _Constants:
    if math.isinf(slider.stiffness):  # without forces the slider keeps its velocity
        return _Constants(0.0, 0.0, 0.0, 0.0, math.inf, N, 1.0 / N, True)
    inverse_mass = 1.0 / slider.mass
    drag = slider.damping / inverse_mass
    fastest = slider.damping + math.sqrt((slider.stiffness + 1.0) * inverse_mass)
    return _Constants(slider.stiffness, inverse_mass, slider.damping, drag, NEAR / fastest, N, 1.0 / N, False)


@inlined
def _begin(state: State, drive: Quadratic, c: _Constants) -> _Leg:
    """Motion from here on, if nothing happened."""
    motion = state.motion
    t, X, v = motion[TIME], motion[POSITION], motion[VELOCITY]
    since = t - drive.start
    drive_v = drive.velocity + drive.acceleration * since
    D = drive.position + (drive.velocity + 0.5 * drive.acceleration * since) * since
    n = float(state.counts[ATTACHED])
    F_d = c.K * (D - X)
    F_c = (n * (X - motion[_REFERENCE]) - motion[_SUM]) * c.part
    flight = take_off(
        c.eta,
        (c.K + n * c.part) * c.inverse_mass,
        c.near,
        v,
        (F_d - F_c) * c.inverse_mass,
        c.K * drive_v * c.inverse_mass,
        0.5 * c.K * drive.acceleration * c.inverse_mass,
    )
    return _Leg(t, X, n, F_d, drive_v, flight)


@inlined
def _next_event(state: State, leg: _Leg, ahead: float, most: float) -> tuple[float, float, float, int]:
    """How long the flight lasts, at most `most`; displacement and velocity then; and what ends it.

    1 and -1: a break ahead or behind; 0: the limit, or the end of what was searched.
    """
    v = leg.flight.v
    to_ahead = max(ahead - leg.X, 0.0)
    h, y, u, side, applies = 0.0, 0.0, v, 1, to_ahead == 0.0
    if not applies and v > 0.0:
        h, y, u, side, applies = soon(leg.flight, to_ahead, most)
    if not applies:
        # Only now the queue behind is asked: while the slider moves on, none of its contacts can break.
        behind = _next_break(state, state.behind, -1.0)
        to_behind = max(behind + leg.X, 0.0)
        h, y, u, side, applies = 0.0, 0.0, v, 1, to_behind == 0.0
        if not applies and v < 0.0:
            h, y, u, side, applies = soon(leg.flight, -to_behind, most)
        side = -side
        if not applies:
            h, side = first_crossing(leg.flight, to_ahead, to_behind, most, state.cuts)
            y, u = at(leg.flight, h)
    return h, y, u, side


@inlined
def _sample(state: State, row: Floats, leg: _Leg, part: float, acceleration: float, c: _Constants) -> None:
    """Fill a row with what the flight passes a time `part` after its beginning."""
    motion, n = state.motion, leg.n
    y, u = at(leg.flight, part)
    x = leg.X + y - motion[_REFERENCE]
    row[0] = leg.X + y
    row[1] = u
    row[2] = (n * x - motion[_SUM]) * c.part
    row[3] = n / c.N
    row[4] = 0.5 * (n * x * x - 2.0 * x * motion[_SUM] + motion[_SQUARES]) * c.part
    row[5], row[6], row[7] = motion[WORK], motion[DAMPED], motion[BROKEN]
    if not c.rigid:
        work, squares = energies(leg.flight, part, y, u, leg.F_d, c.K, leg.drive_v, acceleration)
        row[5] += work
        row[6] += c.drag * squares


@inlined
def _sample_until(state: State, piece: Piece, sampling: Sampling, leg: _Leg, end: float, c: _Constants) -> bool:
    """Fill the samples up to `end`, or to the first at which the condition holds, and go there; whether it does."""
    motion, counts, drive = state.motion, state.counts, piece.drive
    while counts[SAMPLE] < sampling.times.size and sampling.times[counts[SAMPLE]] <= end:
        time, row = sampling.times[counts[SAMPLE]], sampling.samples[counts[SAMPLE]]
        _sample(state, row, leg, time - leg.t, drive.acceleration, c)
        counts[SAMPLE] += 1
        if piece.stop.kind != NOWHERE:
            later = time - drive.start
            D = drive.position + (drive.velocity + 0.5 * drive.acceleration * later) * later
            if holds(piece.stop, row[0], c.K * (D - row[0])):
                motion[TIME], motion[POSITION], motion[VELOCITY] = time, row[0], row[1]
                motion[WORK], motion[DAMPED] = row[5], row[6]
                return True
    return False


@inlined
def _fly(
    state: State, leg: _Leg, h: float, y: float, u: float, ends_at: float, acceleration: float, c: _Constants
) -> None:
    """Make the end of the flight the state."""
    motion = state.motion
    if not c.rigid:
        work, squares = energies(leg.flight, h, y, u, leg.F_d, c.K, leg.drive_v, acceleration)
        motion[WORK] += work
        motion[DAMPED] += c.drag * squares
    motion[TIME] = ends_at
    motion[VELOCITY] = u
    motion[POSITION] = leg.X + y
    state.counts[EVENTS] += 1


@inlined
def _take_threshold(state: State, draws: Draws) -> float:
    state.counts[THRESHOLD] += 1
    return float(draws.thresholds[state.counts[THRESHOLD] - 1])


@inlined
def _break(state: State, side: int, draws: Draws) -> bool:
    """Break the first contact ahead or behind; whether it waits for its re-attachment."""
    queue = state.ahead if side == 1 else state.behind
    slot = first_slot(queue)
    state.motion[POSITION] = state.contacts[slot]["birth"] + side * state.contacts[slot]["threshold"]
    pop(queue)
    _detach(state, slot)
    delay = draws.fixed_delay
    if math.isnan(delay):
        delay = draws.delays[state.counts[DELAY]]
        state.counts[DELAY] += 1
    if delay == 0.0:
        _attach(state, slot, _take_threshold(state, draws))
        return False
    if delay < np.inf:
        push(state.waiting, state.motion[TIME] + delay, slot)
        return True
    return False


@inlined
def _re_attach(state: State, draws: Draws) -> float:
    """Attach the first contact that waits; the time of the next."""
    slot = first_slot(state.waiting)
    pop(state.waiting)
    _attach(state, slot, _take_threshold(state, draws))
    bin_ = state.waiting.counts[BIN]
    following = peek(state.waiting)
    _fetch(state, state.waiting, bin_)
    return following


@bare
def advance(state: State, slider: Slider, piece: Piece, sampling: Sampling, draws: Draws, budget: int) -> int:
    """Move the state on, event by event, until a reason to stop.

    Parameters
    ----------
    state : State
        Changed in place. ``counts[SAMPLE]``, ``counts[THRESHOLD]`` and ``counts[DELAY]`` say how far the samples are
        filled and the draws used.
    slider : Slider
        In rigid motion the slider keeps its velocity, whatever the drive.
    piece : Piece
    sampling : Sampling
        Samples up to the end of the piece are filled.
    draws : Draws
    budget : int
        Return after about this many events, so that a caller can show progress or be interrupted.

    Returns
    -------
    int
        `REACHED_END`, `CONDITION_HELD`, `THRESHOLDS_USED_UP`, `DELAYS_USED_UP`, `BUDGET_SPENT` or `LOOK`.
    """
    counts, acceleration = state.counts, piece.drive.acceleration
    c = _constants(slider, float(state.contacts.size))
    random_delay = math.isnan(draws.fixed_delay)
    to_go = budget
    ahead = _next_break(state, state.ahead, 1.0)
    attachment = peek(state.waiting)
    while True:
        if counts[THRESHOLD] >= draws.thresholds.size:
            return THRESHOLDS_USED_UP
        if random_delay and counts[DELAY] >= draws.delays.size:
            return DELAYS_USED_UP
        if to_go <= 0:
            return BUDGET_SPENT
        to_go -= 1

        leg = _begin(state, piece.drive, c)
        limit = min(attachment, piece.end)
        most = max(limit - leg.t, 0.0)
        h, y, u, side = _next_event(state, leg, ahead, most)
        ends_at = limit if side == 0 and h == most else leg.t + h

        if ends_at > piece.look and leg.t <= piece.look:
            state.motion[LOOKED] = leg.X + at(leg.flight, piece.look - leg.t)[0]
            return LOOK
        if _sample_until(state, piece, sampling, leg, min(ends_at, piece.end), c):
            return CONDITION_HELD
        _fly(state, leg, h, y, u, ends_at, acceleration, c)
        if side != 0:
            if _break(state, side, draws):
                attachment = peek(state.waiting)
        elif ends_at == attachment:
            attachment = _re_attach(state, draws)
        elif ends_at >= piece.end:
            return REACHED_END
        ahead = _next_break(state, state.ahead, 1.0)
