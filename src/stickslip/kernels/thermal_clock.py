"""N contacts that break by Bell's rate, event by event: all share one clock.

A contact that attached at ``X_b`` with threshold ``x_c`` breaks at the rate ``w exp((|X - X_b| - x_c)/A)``. While it is
stretched forwards the integral of that is ``exp(-(X_b + x_c)/A)`` times ``Z = w Int exp(X/A) dt``, which is the same
for all: it breaks when ``Z`` reaches ``Z_birth + exp((X_b + x_c)/A) E``, with ``E`` drawn once from ``exp(-E)``. The
clock is kept as a length, ``Y = A ln Z``: then the breaks wait in the bucket queue of `event_queue`, in `Y` as they
would in `X` without temperature, and in the limit ``A -> 0`` they do wait in `X`. In a hold the clock runs on.

Contacts that are stretched backwards have a clock of their own, ``w Int exp(-X/A) dt``. A contact changes from one to
the other where it is not stretched, and draws afresh: breaks have no memory. The positions where that is lie in two
stacks, with the slider between: what attached last is passed first.

Where the slider may move so fast that a contact meets its threshold before it breaks (``v > w A/40``) these wait in
queues as well, as in `events`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .between_events import (
    BUDGET_SPENT,
    CONDITION_HELD,
    COUNTS,
    DRAWS_USED_UP,
    LOOK,
    LOOKED,
    MOTION,
    POSITION,
    REACHED_END,
    SLIDE,
    TIME,
    VELOCITY,
    WIND,
    WIND_BACK,
    Constants,
    Leg,
    Piece,
    Sampling,
    balance,
    constants,
    count_in,
    count_out,
    crossing,
    detached_edges,
    drive_now,
    fly,
    is_straight,
    sample_until,
    set_out,
    sum_again,
    turned,
    until_turning,
)
from .event_queue import Queue, clear, first_slot, is_full, make_queue, peek, pop, push
from .expansions import expm1, grown_by, log1p
from .flight import NEAR, at, settled
from .oscillator import Slider

Floats = NDArray[np.float64]
Indices = NDArray[np.int32]
Counts = NDArray[np.int64]
Records = NDArray[np.void]

CONTACT = np.dtype([("birth", np.float64), ("threshold", np.float64), ("key", np.float64)])
PLACE = np.dtype([("birth", np.float64), ("slot", np.int64)])

# Further floats and counts, behind those of `between_events`.
CLOCK, CLOCK_BACK = MOTION, MOTION + 1
FLOATS = MOTION + 2
AHEAD, BEHIND, DRAWN, VARIED, DELAYED, CAPPED = range(COUNTS, COUNTS + 6)

NEED = 2
"""Variates that an event may need, at most."""
LAG = 30.0
"""Widths: a clock is set so many widths behind the slider, and again when it is as far ahead: digits are kept."""
_STILL = 1e-4  # widths of oscillation that make no difference
_STEP = 0.125  # widths that the slider goes between two looks at the clock; its error is 3e-7


class Bell(NamedTuple):
    """Width ``A`` and attempt rate ``w``."""

    width: float
    attempts: float


class Draws(NamedTuple):
    """Random numbers in the order of use: thresholds, and logarithms of exponential variates; delays of breaks.

    `fixed_delay` is the delay of all, infinite for none to re-attach, or NaN to take them from `delays`.
    """

    thresholds: Floats
    variates: Floats
    delays: Floats
    fixed_delay: float


class State(NamedTuple):
    """Contacts, clocks and motion.

    ``clock`` and ``clock_back`` hold the contacts stretched forwards and backwards, by the reading at which they break.
    ``under`` and ``over``, sorted towards the slider, hold the places of birth behind and ahead of it. ``cap`` and
    ``cap_back`` are keyed by thresholds as in `events`; ``waiting``, of detached contacts, by time. A threshold of 0
    marks a detached contact; entries of contacts that are no more are passed over when they come up.
    """

    contacts: Records
    clock: Queue
    clock_back: Queue
    under: Records
    over: Records
    cap: Queue
    cap_back: Queue
    waiting: Queue
    motion: Floats
    counts: Counts
    cuts: Floats


def make_state(
    birth: Floats,
    threshold: Floats,
    pending: Floats,
    scale_time: float,
    velocity: float,
) -> State:
    """Return the state of an interface at time 0, the slider at 0; the clocks are wound by `wind`.

    Parameters
    ----------
    birth, threshold : ndarray, shape (N,)
        As in `events.make_state`.
    pending : ndarray, shape (n,)
        Times of re-attachment of the last contacts, which are detached.
    scale_time : float
        Typical delay.
    velocity : float
        Of the slider.
    """
    N = birth.size
    contacts = np.zeros(N, CONTACT)
    contacts["birth"], contacts["threshold"] = birth, threshold
    attached = threshold > 0
    typical = threshold[attached][:4096] if attached.any() else np.ones(1)
    # A dozen contacts break on the width of a bin in smooth sliding.
    reach, bin_ = 2.0 * float(typical.max()), 12.0 * float(typical.mean()) / N
    bins = _power_of_two(reach / bin_, N / 4)
    time_width = 16.0 * scale_time / N if 0 < scale_time < math.inf else 1.0
    state = State(
        contacts=contacts,
        clock=make_queue(2 * N + 64, bins, bin_),
        clock_back=make_queue(2 * N + 64, bins, bin_),
        under=np.zeros(2 * N + 64, PLACE),
        over=np.zeros(2 * N + 64, PLACE),
        cap=make_queue(16, 16, bin_),
        cap_back=make_queue(16, 16, bin_),
        waiting=make_queue(N + 64, _power_of_two(N / 8, N), time_width),
        motion=np.zeros(FLOATS),
        counts=np.zeros(COUNTS + 6, np.int64),
        cuts=np.zeros(16),
    )
    state.motion[VELOCITY] = velocity
    first_detached = N - pending.size
    for i in np.flatnonzero(np.isfinite(pending)):
        push(state.waiting, float(pending[i]), first_detached + int(i))
    order = np.argsort(birth[attached], kind="stable")
    slots = np.flatnonzero(attached)[order]
    under, over = slots[birth[slots] <= 0.0], slots[birth[slots] > 0.0][::-1]
    for stack, held, count in ((state.under, under, AHEAD), (state.over, over, BEHIND)):
        stack["birth"][: held.size], stack["slot"][: held.size] = birth[held], held
        state.counts[count] = held.size
    sum_again(state.motion, state.counts, contacts)
    return state


def with_caps(state: State) -> State:
    """Return the state with queues of thresholds: the slider may move so fast that contacts meet them."""
    room, bins, width = state.clock.capacity, state.clock.newest.size, 1.0 / state.clock.per_bin
    state = state._replace(cap=make_queue(room, bins, width), cap_back=make_queue(room, bins, width))
    state.counts[CAPPED] = 1
    _cap_again(state, state.cap, 1.0)
    _cap_again(state, state.cap_back, -1.0)
    return state


def _power_of_two(wanted: float, most: float) -> int:
    return 1 << max(4, min(math.ceil(math.log2(max(wanted, 1.0))), math.ceil(math.log2(most + 1))))


# ---------------------------------------------------------------------------------------------------------------------
# What changes the state
# ---------------------------------------------------------------------------------------------------------------------


@inlined
def _reading(now: float, at_rest: float, width: float, variate: float) -> float:
    """Reading of a clock at which a contact breaks: ``A ln(exp(now/A) + exp(at_rest/A) E)``; `variate` is ln E."""
    ratio = (at_rest - now) / width + variate
    if ratio > 36.0:
        return now + width * ratio
    return now + width * math.log1p(math.exp(ratio))


@bare
def _cap_again(state: State, queue: Queue, side: float) -> None:
    """Fill a queue of thresholds anew from the attached contacts."""
    clear(queue, side * state.motion[POSITION])
    for i in range(state.contacts.size):
        if state.contacts[i]["threshold"] > 0:
            push(queue, state.contacts[i]["threshold"] + side * state.contacts[i]["birth"], i)


@bare
def wind(state: State, bell: Bell, side: float, variates: Floats) -> None:
    """Set a clock behind the slider, and draw anew when its contacts break: breaks have no memory.

    Parameters
    ----------
    state : State
    bell : Bell
    side : float
        1 for the clock of contacts stretched forwards, -1 for the other.
    variates : ndarray, shape (N,)
        Logarithms of exponential variates.
    """
    X = side * state.motion[POSITION]
    now = X - LAG * bell.width
    state.motion[CLOCK if side > 0 else CLOCK_BACK] = now
    queue = state.clock if side > 0 else state.clock_back
    clear(queue, now)
    stack = state.under if side > 0 else state.over
    count = _tidied(state, stack, state.counts[AHEAD if side > 0 else BEHIND])
    state.counts[AHEAD if side > 0 else BEHIND] = count
    for i in range(count):
        slot = stack[i]["slot"]
        rest = side * state.contacts[slot]["birth"] + state.contacts[slot]["threshold"]
        key = _reading(now, rest, bell.width, variates[i])
        state.contacts[slot]["key"] = key
        push(queue, key, slot)


@bare
def _again(state: State, queue: Queue, stack: Records, count: int, now: float) -> None:
    """Fill the queue of a clock anew from the contacts of a tidy stack, leaving stale entries out."""
    clear(queue, now)
    for i in range(count):
        push(queue, state.contacts[stack[i]["slot"]]["key"], stack[i]["slot"])


@bare
def _tidied(state: State, stack: Records, count: int) -> int:
    """Leave out of a stack what is no more attached there; how many stay."""
    kept = 0
    for i in range(count):
        slot = stack[i]["slot"]
        if state.contacts[slot]["threshold"] > 0.0 and state.contacts[slot]["birth"] == stack[i]["birth"]:
            stack[kept]["birth"], stack[kept]["slot"] = stack[i]["birth"], slot
            kept += 1
    return kept


@inlined
def _stand(state: State, stack: Records, which: int, slot: int, birth: float) -> None:
    """Put a contact on top of a stack."""
    if state.counts[which] == stack.size:
        state.counts[which] = _tidied(state, stack, stack.size)
        sum_again(state.motion, state.counts, state.contacts)
    stack[state.counts[which]]["birth"] = birth
    stack[state.counts[which]]["slot"] = slot
    state.counts[which] += 1


@inlined
def _top(state: State, stack: Records, which: int) -> int:
    """Slot of the contact on top of a stack, -1 if it is empty; stale ones are dropped on the way."""
    while state.counts[which] > 0:
        place = state.counts[which] - 1
        slot = int(stack[place]["slot"])
        if state.contacts[slot]["threshold"] > 0.0 and state.contacts[slot]["birth"] == stack[place]["birth"]:
            return slot
        state.counts[which] = place
    return -1


@inlined
def _enter(state: State, bell: Bell, slot: int, side: float, variate: float) -> None:
    """A contact is subject to the clock of the side that it is stretched to from now on."""
    clock, which = (CLOCK, AHEAD) if side > 0 else (CLOCK_BACK, BEHIND)
    queue = state.clock if side > 0 else state.clock_back
    stack = state.under if side > 0 else state.over
    birth = state.contacts[slot]["birth"]
    key = _reading(state.motion[clock], side * birth + state.contacts[slot]["threshold"], bell.width, variate)
    state.contacts[slot]["key"] = key
    _stand(state, stack, which, slot, birth)
    if is_full(queue):
        state.counts[which] = _tidied(state, stack, state.counts[which])
        _again(state, queue, stack, state.counts[which], state.motion[clock])
    else:
        push(queue, key, slot)


@inlined
def _attach(state: State, bell: Bell, slot: int, draws: Draws, c: Constants) -> None:
    """A contact attaches, unstretched, where the slider is."""
    drawn = state.counts[DRAWN]
    state.counts[DRAWN] = drawn + 1
    X, threshold = state.motion[POSITION], draws.thresholds[drawn]
    state.contacts[slot]["birth"] = X
    state.contacts[slot]["threshold"] = threshold
    count_in(state.motion, state.counts, c)
    # Stretched to the side that the slider comes to next, it changes at once if that is not this one.
    _enter(state, bell, slot, 1.0, draws.variates[state.counts[VARIED]])
    state.counts[VARIED] += 1
    if state.counts[CAPPED] != 0:
        if is_full(state.cap):
            _cap_again(state, state.cap, 1.0)
        else:
            push(state.cap, threshold + X, slot)
        if is_full(state.cap_back):
            _cap_again(state, state.cap_back, -1.0)
        else:
            push(state.cap_back, threshold - X, slot)


@inlined
def _next_reading(state: State, queue: Queue) -> float:
    """Smallest reading at which a contact of a clock breaks; stale entries are dropped on the way."""
    while True:
        key = peek(queue)
        if key == np.inf:
            return key
        slot = first_slot(queue)
        if state.contacts[slot]["threshold"] > 0 and state.contacts[slot]["key"] == key:
            return key
        pop(queue)


@inlined
def _next_cap(state: State, queue: Queue, side: float) -> float:
    """Smallest key of a threshold of a contact that is still attached."""
    while True:
        key = peek(queue)
        if key == np.inf:
            return key
        slot = first_slot(queue)
        threshold = state.contacts[slot]["threshold"]
        if threshold > 0 and threshold + side * state.contacts[slot]["birth"] == key:
            return key
        pop(queue)


# ---------------------------------------------------------------------------------------------------------------------
# The engine
# ---------------------------------------------------------------------------------------------------------------------

# What ends a flight.
_NOTHING, _BREAK, _BREAK_BACK, _PLACE, _PLACE_BACK, _CAP, _CAP_BACK, _SLIDES, _SLIDES_BACK, _TURNS = range(10)


@inlined
def _integral(rate: float, h: float, y: float, v: float, u: float, per_width: float) -> float:
    """What a clock of this rate runs on by in a flight of `h`, by the corrected trapezoidal rule, relative to it."""
    more = expm1(y * per_width)
    return rate * h * (1.0 + 0.5 * more + h * (1 / 12.0) * per_width * (v - u - u * more))


@inlined
def _smooth(leg: Leg, h: float, width: float) -> float:
    """Longest flight up to `h` that the clocks can follow in one piece: the slider neither goes far nor oscillates."""
    f = leg.motion
    allowed = _STEP * width
    if h * (abs(f.v) + h * abs(f.c2)) > allowed:
        h = min(h, allowed / (abs(f.v) + math.sqrt(abs(f.c2) * allowed)))
    return settled(f, h, _STILL * width) if h > f.near * (0.7 / NEAR) else h


@inlined
def _until(
    leg: Leg, guess: float, h: float, rate: float, need: float, side: float, per_width: float
) -> tuple[float, float, float, bool]:
    """Time within `h` at which a clock has run on by `need`, the displacement and velocity then, and whether it has.

    Newton's method from a guess; kept inside by bisection.
    """
    f = leg.motion
    low, high = 0.0, h
    t = min(guess, h)
    y, u = at(f, t)
    for _ in range(60):
        miss = _integral(rate, t, side * y, side * f.v, side * u, per_width) - need
        if miss == 0.0:  # as where a contact breaks as soon as it attaches
            return t, y, u, True
        if miss > 0.0:
            high = t
        elif t == h:
            return h, y, u, False
        else:
            low = t
        step = miss / (rate * (1.0 + expm1(side * y * per_width)))
        following = t - step
        if not low <= following <= high:
            following = 0.5 * (low + high) if miss > 0.0 or high < h else h
        small = abs(following - t) <= 1e-5 * t  # the next step would be less than its square
        if small and t <= f.near:
            more, bent = following - t, 2.0 * f.c2 + t * (6.0 * f.c3 + t * 12.0 * f.c4)
            return following, y + more * (u + 0.5 * more * bent), u + more * bent, True
        t = following
        y, u = at(f, t)
        if small:
            return t, y, u, True
    return t, y, u, True


@inlined
def _positions(state: State, c: Constants) -> tuple[float, int, float, int]:
    """Nearest positions ahead and behind where something happens, and what."""
    motion, counts = state.motion, state.counts
    ahead, what = np.inf, _NOTHING
    slot = _top(state, state.over, BEHIND)
    if slot >= 0:
        ahead, what = state.contacts[slot]["birth"], _PLACE
    behind, what_back = -np.inf, _NOTHING
    slot = _top(state, state.under, AHEAD)
    if slot >= 0:
        behind, what_back = state.contacts[slot]["birth"], _PLACE_BACK
    if counts[CAPPED] != 0:
        key = _next_cap(state, state.cap, 1.0)
        if key < ahead:
            ahead, what = key, _CAP
        key = _next_cap(state, state.cap_back, -1.0)
        if -key > behind:
            behind, what_back = -key, _CAP_BACK
    if c.f_d > 0.0:
        edge, edge_back = detached_edges(motion, counts, c)
        if edge < ahead:
            ahead, what = edge, _SLIDES
        if edge_back > behind:
            behind, what_back = edge_back, _SLIDES_BACK
    return ahead, what, behind, what_back


@inlined
def _flight(
    state: State, leg: Leg, bell: Bell, most: float, c: Constants
) -> tuple[float, float, float, int, float, float]:
    """How long the flight lasts, at most `most`; displacement and velocity then; what ends it; readings of the clocks.

    Pieces in which nothing happens are flights of their own.
    """
    motion, counts, A = state.motion, state.counts, bell.width
    per_width = 1.0 / A
    clock, clock_back = motion[CLOCK], motion[CLOCK_BACK]
    ahead, what, behind, what_back = _positions(state, c)
    to_ahead, to_behind = ahead - leg.X, leg.X - behind
    v = leg.motion.v
    rate = need = 0.0
    reading = guess = np.inf
    if counts[AHEAD] > 0:
        reading = _next_reading(state, state.clock)
        rate = bell.attempts * math.exp((leg.X - clock) * per_width)
        need = grown_by((reading - clock) * per_width)
        guess = need / rate
        bend = 0.5 * guess * v * per_width
        if abs(bend) < 0.2:  # at constant velocity, the logarithm of 1 + 2 bend
            guess *= 1.0 - bend * (1.0 - bend * (4.0 / 3.0) * (1.0 - 1.5 * bend))
        else:
            guess /= 1.0 + max(bend, -0.5)
    h = _smooth(leg, min(most, 2.0 * guess), A)
    happens = _NOTHING
    y, u = 0.0, v
    if guess <= 1.2 * h:
        h, y, u, breaks = _until(leg, guess, h, rate, need, 1.0, per_width)
        if breaks:
            happens = _BREAK
    else:
        y, u = at(leg.motion, h)
    if abs(y) > 0.25 * A:
        happens = _NOTHING
        while abs(y) > 0.25 * A:
            h *= 0.5
            y, u = at(leg.motion, h)
    if not is_straight(leg, h, y, u, to_ahead, to_behind):
        sooner, y, u, side = crossing(leg, to_ahead, to_behind, h, state.cuts)
        if side != 0 or sooner < h:
            h, happens = sooner, _NOTHING
        if side != 0:
            happens = what if side > 0 else what_back
    if c.f_d > 0.0 and counts[SLIDE] * u < 0.0 and counts[SLIDE] * v > 0.0:
        h, happens = until_turning(leg.motion, h), _TURNS
        y, u = at(leg.motion, h)
        u = 0.0
    if counts[BEHIND] > 0:
        reading_back = _next_reading(state, state.clock_back)
        rate_back = bell.attempts * math.exp((-leg.X - clock_back) * per_width)
        need_back = grown_by((reading_back - clock_back) * per_width)
        run_back = _integral(rate_back, h, -y, -v, -u, per_width)
        if run_back >= need_back:
            h, y, u, _ = _until(leg, need_back / rate_back, h, rate_back, need_back, -1.0, per_width)
            happens = _BREAK_BACK
            clock_back = reading_back
        else:
            clock_back += A * log1p(run_back)
    else:  # a clock by which nobody goes comes along, or it would be left so far behind that its rate has no number
        clock_back = max(clock_back, -leg.X - y - LAG * A)
    if happens == _BREAK:
        clock = reading
    elif rate > 0.0:
        run = _integral(rate, h, y, v, u, per_width)
        if run >= need:  # the guess was far off
            h, y, u, _ = _until(leg, guess, h, rate, need, 1.0, per_width)
            happens, clock = _BREAK, reading
        else:
            clock += A * log1p(run)
    else:
        clock = max(clock, leg.X + y - LAG * A)
    return h, y, u, happens, clock, clock_back


@bare
def _run_on(motion: Floats, leg: Leg, bell: Bell, h: float, y: float, u: float) -> None:
    """Let the clocks run on through a part of a flight."""
    A, v = bell.width, leg.motion.v
    rate = bell.attempts * math.exp((leg.X - motion[CLOCK]) / A)
    motion[CLOCK] += A * math.log1p(_integral(rate, h, y, v, u, 1.0 / A))
    rate = bell.attempts * math.exp((-leg.X - motion[CLOCK_BACK]) / A)
    motion[CLOCK_BACK] += A * math.log1p(_integral(rate, h, -y, -v, -u, 1.0 / A))


@inlined
def _let_go(state: State, slot: int, draws: Draws, c: Constants) -> int:
    """Break a contact; the slot that attaches at once, -1 for none."""
    count_out(state.motion, state.counts, state.contacts[slot]["birth"], c)
    state.contacts[slot]["threshold"] = 0.0
    delay = draws.fixed_delay
    if math.isnan(delay):
        delay = draws.delays[state.counts[DELAYED]]
        state.counts[DELAYED] += 1
    if delay == 0.0:
        return slot
    if delay < np.inf:
        push(state.waiting, state.motion[TIME] + delay, slot)
    return -1


@bare
def _happen(state: State, happens: int, draws: Draws, bell: Bell, c: Constants) -> int:
    """Let happen what has ended a flight, other than a break by the clock ahead; the slot that breaks, -1 for none."""
    motion, counts = state.motion, state.counts
    if happens == _BREAK_BACK:
        slot = first_slot(state.clock_back)
        pop(state.clock_back)
        return slot
    if happens in (_CAP, _CAP_BACK):
        queue, side = (state.cap, 1.0) if happens == _CAP else (state.cap_back, -1.0)
        slot = first_slot(queue)
        pop(queue)
        motion[POSITION] = state.contacts[slot]["birth"] + side * state.contacts[slot]["threshold"]
        return slot
    if happens in (_PLACE, _PLACE_BACK):
        side = 1.0 if happens == _PLACE else -1.0
        slot = _top(state, state.over, BEHIND) if happens == _PLACE else _top(state, state.under, AHEAD)
        motion[POSITION] = state.contacts[slot]["birth"]
        counts[BEHIND if happens == _PLACE else AHEAD] -= 1
        _enter(state, bell, slot, side, draws.variates[counts[VARIED]])
        counts[VARIED] += 1
    elif happens == _TURNS:
        turned(motion, counts, c, -float(counts[SLIDE]))
    else:
        counts[SLIDE] = 1 if happens == _SLIDES else -1
    return -1


@bare
def _renew(state: State, slot: int, draws: Draws, bell: Bell, c: Constants) -> None:
    """Break a contact, and attach it again if that happens at once."""
    attaching = _let_go(state, slot, draws, c)
    if attaching >= 0:
        _attach(state, bell, attaching, draws, c)


@bare
def _leap(state: State, piece: Piece, draws: Draws, bell: Bell, c: Constants) -> tuple[bool, int]:
    """Take a slider without mass towards its balance; whether it is there, or else the slot that breaks before."""
    motion, counts = state.motion, state.counts
    goal = balance(motion, counts, piece.drive, c)
    ahead, what, behind, what_back = _positions(state, c)
    turned(motion, counts, c, goal - motion[POSITION])
    if goal > ahead:
        motion[POSITION] = ahead
        return False, _happen(state, what, draws, bell, c)
    if goal < behind:
        motion[POSITION] = behind
        return False, _happen(state, what_back, draws, bell, c)
    motion[POSITION] = goal
    return True, -1


@bare
def advance(
    state: State, slider: Slider, f_d: float, bell: Bell, piece: Piece, sampling: Sampling, draws: Draws, budget: int
) -> int:
    """Move the state on, event by event, until a reason to stop.

    Parameters
    ----------
    state : State
        Changed in place. Its counts say how far the samples are filled and the draws used.
    slider : Slider
        In rigid motion the slider moves with the drive; without mass it is in balance.
    f_d : float
        Sliding force of detached contacts.
    bell : Bell
    piece : Piece
    sampling : Sampling
    draws : Draws
    budget : int
        Return after about this many events.

    Returns
    -------
    int
        A reason, of `between_events`.
    """
    motion, counts, acceleration = state.motion, state.counts, piece.drive.acceleration
    c = constants(slider, f_d, float(state.contacts.size))
    random_delay, waits = math.isnan(draws.fixed_delay), draws.fixed_delay != 0.0
    to_go = budget
    attachment = peek(state.waiting)
    while True:
        if counts[DRAWN] >= draws.thresholds.size or counts[VARIED] + NEED > draws.variates.size:
            return DRAWS_USED_UP
        if random_delay and counts[DELAYED] >= draws.delays.size:
            return DRAWS_USED_UP
        if to_go <= 0:
            return BUDGET_SPENT
        to_go -= 1
        far = LAG * bell.width
        if motion[CLOCK] - motion[POSITION] > far:
            return WIND
        if motion[CLOCK_BACK] + motion[POSITION] > far:
            if counts[BEHIND] > 0:
                return WIND_BACK
            motion[CLOCK_BACK] = -motion[POSITION] - far
        if c.massless:
            there, slot = _leap(state, piece, draws, bell, c)
            if not there:
                if slot >= 0:
                    _renew(state, slot, draws, bell, c)
                attachment = peek(state.waiting)
                continue
        elif f_d > 0.0 and counts[SLIDE] != 0:
            v = drive_now(piece.drive, motion[TIME])[1] if c.rigid else motion[VELOCITY]
            if v * counts[SLIDE] <= 0.0:  # elastic while it rests; if it goes on, it slides at once
                turned(motion, counts, c, -float(counts[SLIDE]))

        leg = set_out(motion, counts, piece.drive, c)
        limit = min(attachment, piece.end)
        most = max(limit - leg.t, 0.0)
        h, y, u, happens, clock, clock_back = _flight(state, leg, bell, most, c)
        ends_at = limit if happens == _NOTHING and h == most else leg.t + h

        if ends_at > piece.look and leg.t <= piece.look:
            motion[LOOKED] = leg.X + at(leg.motion, piece.look - leg.t)[0]
            return LOOK
        if sample_until(motion, counts, piece, sampling, leg, min(ends_at, piece.end), c):
            part, y, u = motion[TIME] - leg.t, motion[POSITION] - leg.X, motion[VELOCITY]
            _run_on(motion, leg, bell, part, y, u)
            return CONDITION_HELD
        fly(motion, counts, leg, h, y, u, ends_at, acceleration, c)
        motion[CLOCK], motion[CLOCK_BACK] = clock, clock_back
        attaching = -1
        if happens == _BREAK:
            slot = first_slot(state.clock)
            pop(state.clock)
            attaching = _let_go(state, slot, draws, c)
        elif happens != _NOTHING:
            slot = _happen(state, happens, draws, bell, c)
            if slot >= 0:
                _renew(state, slot, draws, bell, c)
        elif ends_at == attachment:
            attaching = first_slot(state.waiting)
            pop(state.waiting)
        elif ends_at >= piece.end:
            return REACHED_END
        if attaching >= 0:
            _attach(state, bell, attaching, draws, c)
        if waits:
            attachment = peek(state.waiting)
