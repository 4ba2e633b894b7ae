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

Detached contacts that carry a force slide together: one element, elastic with the contacts' stiffness up to that force
and plastic beyond, follows the slider for all of them. It yields where the slider passes one of two positions, and is
elastic again once the slider turns round: two more kinds of events, and no friction with a jump.

Symbols as in the paper, Eq. (11), per contact: ``K``, ``M``, ``eta``, slider position ``X``, drive position ``D``.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .between_events import (
    ANCHOR,
    ATTACHED,
    BREAKS,
    BROKEN,
    BUDGET_SPENT,
    CONDITION_HELD,
    COUNTS,
    LOOK,
    LOOKED,
    MOTION,
    POSITION,
    REACHED_END,
    REFERENCE,
    SLIDE,
    SQUARES,
    SUM,
    TIME,
    VELOCITY,
    Constants,
    Leg,
    Piece,
    Sampling,
    constants,
    detached_stretching,
    fly,
    friction,
    sample_until,
    set_out,
)
from .drive import Quadratic
from .event_queue import ENTRY, MOVED, Queue, clear, drop, first_place, first_slot, make_queue, peek, pop, push, used
from .flight import Flight, at, first_crossing, first_turn, heading, out_of_reach, soon
from .oscillator import Slider

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]
Records = NDArray[np.void]

# Fields used together lie together: two contacts a cache line.
CONTACT = np.dtype([*ENTRY.descr, ("birth", np.float64), ("threshold", np.float64)])

# Why `advance` returned, besides the reasons of `between_events`.
THRESHOLDS_USED_UP = 10
DELAYS_USED_UP = 11
ARRESTED = 12


# ---------------------------------------------------------------------------------------------------------------------
# The state and what changes it
# ---------------------------------------------------------------------------------------------------------------------


class Draws(NamedTuple):
    """Random numbers in the order of use: thresholds of contacts that attach, and delays of those that break.

    `fixed_delay` is the delay of all, infinite for none to re-attach, or NaN to take them from `delays`. Contacts
    attach with the `stretchings` along the motion; without any, unstretched. With `arrests`, `advance` returns when the
    slider first stops after a break.
    """

    thresholds: Floats
    delays: Floats
    fixed_delay: float
    stretchings: Floats = np.empty(0)
    arrests: bool = False


class State(NamedTuple):
    """All that the next step needs: contacts, queues, motion.

    ``ahead``, keyed by ``birth + threshold``, is where attached contacts live: what breaks next lies together. Its
    slots are the contacts' numbers, `other` the places in ``behind``, keyed by ``threshold - birth``, whose slots are
    the places in ``ahead``. ``waiting``, of detached contacts, is keyed by time. A slider that moves on, or back by
    less than a threshold, breaks none behind: until one comes near, a bound stands for the queue ``behind``, which is
    then filled and kept for a while.
    """

    size: int
    ahead: Queue
    behind: Queue
    waiting: Queue
    motion: Floats
    counts: Counts
    cuts: Floats


# Further floats and counts, behind those of `between_events`.
_YIELD = MOTION  # force at which the element of the detached contacts yields
_LEAST = MOTION + 1  # no attached contact has a smaller key in ``behind``
THRESHOLD = COUNTS  # next threshold of those handed in
DELAY = COUNTS + 1
_LEFT = COUNTS + 2  # the side at which the element yielded just now, until the slider turns round: 1, -1, or 0 for none
_DIRECTION = COUNTS + 3  # in which the slider moved last: 1 or -1
_AT_ARREST = COUNTS + 4  # breaks up to the last arrest
_KEPT = COUNTS + 5  # whether ``behind`` is kept
_SUMMED = COUNTS + 6  # attachments since the last summing up


def make_state(
    birth: Floats,
    threshold: Floats,
    pending: Floats,
    scale_time: float,
    X: float = 0.0,
    velocity: float = 0.0,
    sliding_force: float = 0.0,
    slides: int = 0,
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
    sliding_force : float
        Force at which the element of the detached contacts yields.
    slides : int
        1 or -1 if it yields already, ahead or behind.
    """
    N = birth.size
    attached = np.flatnonzero(threshold > 0)
    typical = threshold[attached][:4096] if attached.size else np.ones(1)
    # A dozen contacts break on the width of a bin in smooth sliding.
    reach, width = 2.0 * float(typical.max()), 12.0 * float(typical.mean()) / N
    bins = _power_of_two(reach / width, N / 4)
    time_width = 16.0 * scale_time / N if 0 < scale_time < math.inf else 1.0
    state = State(
        size=N,
        ahead=make_queue(N, bins, width, CONTACT),
        behind=make_queue(N, bins, width),
        waiting=make_queue(N, _power_of_two(N / 8, N), time_width),
        motion=np.zeros(MOTION + 2),
        counts=np.zeros(COUNTS + 7, np.int64),
        cuts=np.zeros(16),
    )
    state.motion[POSITION] = state.motion[ANCHOR] = X
    state.motion[_YIELD] = sliding_force
    state.counts[SLIDE] = slides
    state.counts[_DIRECTION] = -1 if velocity < 0 else 1
    state.motion[VELOCITY] = velocity
    state.counts[ATTACHED] = attached.size
    first_detached = N - pending.size
    for i in np.flatnonzero(np.isfinite(pending)):
        push(state.waiting, float(pending[i]), first_detached + int(i))
    clear(state.ahead, X)
    _fill(state, attached, birth, threshold)
    _sum_again(state)
    return state


@bare
def _fill(state: State, slots: Counts, birth: Floats, threshold: Floats) -> None:
    """Put contacts where attached ones live."""
    for slot in slots:
        place = push(state.ahead, threshold[slot] + birth[slot], slot)
        state.ahead.entries[place]["birth"] = birth[slot]
        state.ahead.entries[place]["threshold"] = threshold[slot]


def contact_force(state: State) -> float:
    """Force of the contacts, per contact."""
    return float(friction(state.motion, state.counts, state.motion[_YIELD], float(state.size)))


def attached_contacts(state: State) -> Records:
    """Return the attached contacts: number (`slot`), birth position and threshold of each."""
    entries = state.ahead.entries[: used(state.ahead)]
    return entries[entries["key"] < np.inf]


def stretchings(state: State, X: float) -> Floats:
    """Stretchings of the attached contacts with the slider at `X`: its own place, or that of a look, `LOOKED`."""
    return np.asarray(X - attached_contacts(state)["birth"])


def _power_of_two(wanted: float, most: float) -> int:
    return 1 << max(4, min(math.ceil(math.log2(max(wanted, 1.0))), math.ceil(math.log2(most + 1))))


@inlined
def _slid_energy(state: State, part: float, f_d: float) -> float:
    """Energy that a detached contact holds; `part` is ``1/N``."""
    if f_d == 0.0:
        return 0.0
    return float(0.5 * part * detached_stretching(state.motion, state.counts, f_d, state.motion[POSITION]) ** 2)


@bare
def _keep_behind(state: State) -> None:
    """Fill the queue of those behind, and keep it from now on."""
    contacts = state.ahead.entries
    clear(state.behind, -state.motion[POSITION])
    for place in range(used(state.ahead)):
        if contacts[place]["key"] < np.inf:
            key = contacts[place]["threshold"] - contacts[place]["birth"]
            contacts[place]["other"] = push(state.behind, key, place)
    state.ahead.counts[MOVED] = 0
    state.counts[_KEPT] = 1


@bare
def _sum_again(state: State) -> None:
    """Sum the birth positions afresh, about the present position: rounding cannot pile up; and the bound behind."""
    reference = state.motion[POSITION]
    total, squares, least = 0.0, 0.0, np.inf
    contacts = state.ahead.entries
    for place in range(used(state.ahead)):
        if contacts[place]["key"] < np.inf:
            y = contacts[place]["birth"] - reference
            total += y
            squares += y * y
            least = min(least, contacts[place]["threshold"] - contacts[place]["birth"])
    state.motion[_LEAST] = least
    state.counts[_SUMMED] = 0
    state.motion[SUM] = total
    state.motion[SQUARES] = squares
    state.motion[REFERENCE] = reference


@inlined
def _attach(state: State, slot: int, threshold: float, stretching: float, c: Constants) -> None:
    """A contact attaches where the slider is; it lets go of the force it slid with, and is stretched anew."""
    X = state.motion[POSITION]
    state.motion[BROKEN] += _slid_energy(state, c.part, c.f_d)
    if stretching != 0.0:
        state.motion[BROKEN] -= 0.5 * stretching**2 * c.part
        X -= state.counts[_DIRECTION] * stretching
    y = X - state.motion[REFERENCE]
    state.motion[SUM] += y
    state.motion[SQUARES] += y * y
    state.counts[ATTACHED] += 1
    contacts = state.ahead.entries
    place = push(state.ahead, threshold + X, slot)
    contacts[place]["birth"] = X
    contacts[place]["threshold"] = threshold
    state.motion[_LEAST] = min(state.motion[_LEAST], threshold - X)
    if state.counts[_KEPT]:
        contacts[place]["other"] = push(state.behind, threshold - X, place)
    state.counts[_SUMMED] += 1
    if state.counts[_SUMMED] > 2 * state.size + 64 or state.ahead.counts[MOVED] or state.behind.counts[MOVED]:
        _sum_again(state)
        state.counts[_KEPT] = state.ahead.counts[MOVED] = state.behind.counts[MOVED] = 0


@inlined
def _detach(state: State, place: int, c: Constants) -> None:
    """The contact at a place breaks, stretched to its threshold, and slides on."""
    contact = state.ahead.entries[place]
    state.motion[BROKEN] -= _slid_energy(state, c.part, c.f_d)
    y = contact["birth"] - state.motion[REFERENCE]
    state.motion[SUM] -= y
    state.motion[SQUARES] -= y * y
    state.motion[BROKEN] += 0.5 * contact["threshold"] ** 2 * c.part
    if state.counts[_KEPT]:
        drop(state.behind, contact["other"])
    drop(state.ahead, place)
    state.counts[ATTACHED] -= 1
    state.counts[BREAKS] += 1


# ---------------------------------------------------------------------------------------------------------------------
# The engine
# ---------------------------------------------------------------------------------------------------------------------


class _Edges(NamedTuple):
    """The element of the detached contacts yields where the slider passes `ahead` or `behind`.

    With `watch`, the flight ends where the slider turns round.
    """

    ahead: float
    behind: float
    watch: bool


@inlined
def _element_turns(state: State, flight: Flight) -> bool:
    """Whether the element of the detached contacts ceases to yield, or yields again, as the slider sets out."""
    counts = state.counts
    slides, left = counts[SLIDE], counts[_LEFT]
    if slides != 0 and heading(flight) * slides < 0.0:
        state.motion[ANCHOR] = state.motion[POSITION] - slides * state.motion[_YIELD]
        counts[SLIDE], counts[_LEFT] = 0, slides
        return True
    if left != 0 and heading(flight) * left > 0.0:
        counts[SLIDE], counts[_LEFT] = left, 0
        return True
    return False


@inlined
def _begin(state: State, drive: Quadratic, arrests: bool, c: Constants) -> tuple[Leg, _Edges]:
    """Motion from here on, if nothing happened."""
    motion, counts = state.motion, state.counts
    leg = set_out(motion, counts, drive, c)
    ahead, behind = np.inf, -np.inf
    watch = arrests and counts[BREAKS] > counts[_AT_ARREST]
    if c.f_d > 0.0:
        if _element_turns(state, leg.motion):
            leg = set_out(motion, counts, drive, c)
        if counts[SLIDE] == 0:
            ahead = motion[ANCHOR] + c.f_d if counts[_LEFT] != 1 else np.inf
            behind = motion[ANCHOR] - c.f_d if counts[_LEFT] != -1 else -np.inf
        watch = watch or counts[SLIDE] != 0 or counts[_LEFT] != 0
    return leg, _Edges(ahead, behind, watch)


_TURN = 2  # ends a flight where the slider turns round


@inlined
def _next_event(state: State, leg: Leg, edges: _Edges, ahead: float, most: float) -> tuple[float, float, float, int]:
    """How long the flight lasts, at most `most`; displacement and velocity then; and what ends it.

    1 and -1: a break ahead or behind, or the element of the detached contacts yields there; `_TURN`; 0: the limit, or
    the end of what was searched.
    """
    v = leg.motion.v
    to_ahead = max(min(ahead, edges.ahead) - leg.X, 0.0)
    h, y, u, side, applies = 0.0, 0.0, v, 1, to_ahead == 0.0
    if not applies and v > 0.0:
        h, y, u, side, applies = soon(leg.motion, to_ahead, most)
    if not applies:
        # Only now those behind are looked at: while the slider moves on, none of them can break.
        behind = peek(state.behind) if state.counts[_KEPT] else state.motion[_LEAST]
        to_behind = max(min(behind, -edges.behind) + leg.X, 0.0)
        h, y, u, side, applies = 0.0, 0.0, v, 1, to_behind == 0.0
        if not applies and v < 0.0:
            h, y, u, side, applies = soon(leg.motion, -to_behind, most)
        side = -side
        if not applies:
            h, side = (0.0 if edges.watch else out_of_reach(leg.motion, to_ahead, to_behind, most)), 0
            if h == 0.0:
                h, side = first_crossing(leg.motion, to_ahead, to_behind, most, state.cuts)
            turn = first_turn(leg.motion, h, state.cuts) if edges.watch else np.inf
            if turn <= h:
                h, side = turn, _TURN
            y, u = at(leg.motion, h)
            if side == _TURN:
                u = 0.0
    return h, y, u, side


@inlined
def _attach_next(state: State, slot: int, draws: Draws, c: Constants) -> None:
    """Attach a contact with the next threshold, and the stretching that goes with it."""
    i = state.counts[THRESHOLD]
    state.counts[THRESHOLD] = i + 1
    _attach(state, slot, draws.thresholds[i], draws.stretchings[i] if draws.stretchings.size else 0.0, c)


@inlined
def _yields(state: State, edges: _Edges, side: int, ahead: float) -> bool:
    """Whether it is the element of the detached contacts that gives way, not a contact; it yields from here on."""
    limit = edges.ahead if side == 1 else edges.behind
    if not (limit < ahead if side == 1 else -limit < peek(state.behind)):
        return False
    state.motion[POSITION] = limit
    state.counts[SLIDE], state.counts[_LEFT] = side, 0
    return True


@inlined
def _turn(state: State, arrests: bool) -> bool:
    """The slider turns round; whether it has stopped after a break."""
    counts = state.counts
    counts[_LEFT] = 0
    if arrests and counts[BREAKS] > counts[_AT_ARREST]:
        counts[_AT_ARREST] = counts[BREAKS]
        return True
    return False


def re_attach_all(state: State) -> None:
    """Make all detached contacts re-attach now."""
    detached = np.ones(state.size, dtype=bool)
    detached[attached_contacts(state)["slot"]] = False
    for slot in np.flatnonzero(detached):
        push(state.waiting, float(state.motion[TIME]), int(slot))


@inlined
def _break(state: State, side: int, draws: Draws, c: Constants) -> bool:
    """Break the first contact ahead or behind; whether it waits for its re-attachment."""
    place = first_place(state.ahead) if side == 1 else first_slot(state.behind)
    contact = state.ahead.entries[place]
    slot = contact["slot"]
    state.motion[POSITION] = contact["birth"] + side * contact["threshold"]
    _detach(state, place, c)
    delay = draws.fixed_delay
    if math.isnan(delay):
        delay = draws.delays[state.counts[DELAY]]
        state.counts[DELAY] += 1
    if delay == 0.0:
        _attach_next(state, slot, draws, c)
        return False
    if delay < np.inf:
        push(state.waiting, state.motion[TIME] + delay, slot)
        return True
    return False


@inlined
def _re_attach(state: State, draws: Draws, c: Constants) -> float:
    """Attach the first contact that waits; the time of the next."""
    slot = first_slot(state.waiting)
    pop(state.waiting)
    _attach_next(state, slot, draws, c)
    return peek(state.waiting)


@bare
def advance(state: State, slider: Slider, piece: Piece, sampling: Sampling, draws: Draws, budget: int) -> int:
    """Move the state on, event by event, until a reason to stop.

    Parameters
    ----------
    state : State
        Changed in place. ``counts[SAMPLE]``, ``counts[THRESHOLD]`` and ``counts[DELAY]`` say how far the samples are
        filled and the draws used.
    slider : Slider
        In rigid motion the slider moves with the drive.
    piece : Piece
    sampling : Sampling
        Samples up to the end of the piece are filled.
    draws : Draws
    budget : int
        Return after about this many events, so that a caller can show progress or be interrupted.

    Returns
    -------
    int
        `REACHED_END`, `CONDITION_HELD`, `THRESHOLDS_USED_UP`, `DELAYS_USED_UP`, `BUDGET_SPENT`, `LOOK` or `ARRESTED`.
    """
    counts, acceleration = state.counts, piece.drive.acceleration
    c = constants(slider, state.motion[_YIELD], float(state.size))
    random_delay = math.isnan(draws.fixed_delay)
    to_go = budget
    ahead = peek(state.ahead)
    attachment = peek(state.waiting)
    while True:
        if counts[THRESHOLD] >= draws.thresholds.size:
            return THRESHOLDS_USED_UP
        if random_delay and counts[DELAY] >= draws.delays.size:
            return DELAYS_USED_UP
        if to_go <= 0:
            return BUDGET_SPENT
        to_go -= 1

        leg, edges = _begin(state, piece.drive, draws.arrests, c)
        limit = min(attachment, piece.end)
        most = max(limit - leg.t, 0.0)
        h, y, u, side = _next_event(state, leg, edges, ahead, most)
        if side == -1 and not counts[_KEPT]:
            _keep_behind(state)
            continue
        ends_at = limit if side == 0 and h == most else leg.t + h

        if ends_at > piece.look and leg.t <= piece.look:
            state.motion[LOOKED] = leg.X + at(leg.motion, piece.look - leg.t)[0]
            return LOOK
        if sample_until(state.motion, counts, piece, sampling, leg, min(ends_at, piece.end), c):
            return CONDITION_HELD
        fly(state.motion, counts, leg, h, y, u, ends_at, acceleration, c)
        if u != 0.0:
            counts[_DIRECTION] = 1 if u > 0.0 else -1
        if side == _TURN:
            if _turn(state, draws.arrests):
                return ARRESTED
        elif side != 0:
            if not _yields(state, edges, side, ahead) and _break(state, side, draws, c):
                attachment = peek(state.waiting)
        elif ends_at == attachment:
            attachment = _re_attach(state, draws, c)
        elif ends_at >= piece.end:
            return REACHED_END
        ahead = peek(state.ahead)
