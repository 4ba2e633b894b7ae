"""N contacts under a slider, event by event: no time step and no loop over contacts.

Between two events the slider is a damped oscillator of known stiffness (the spring and the attached contacts), pulled
by a known drive: its motion is known in closed form. The next event is the earliest of

- the slider reaching the nearest breaking position, ahead (``birth position + threshold``) or behind
  (``birth position - threshold``),
- the next rebirth of a broken contact,
- the end of the piece of the drive.

Breaking positions and rebirth times wait in bucket queues, whose cost does not grow with the number of contacts; the
force needs two running sums, whatever that number. Samples are read off the closed form inside the interval where they
fall, so that sampling never changes the motion.

Symbols as in the paper, Eq. (11), per contact: ``K``, ``M``, ``eta``, slider position ``X``, drive position ``D``.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined

Floats = NDArray[np.float64]
Indices = NDArray[np.int32]
Counts = NDArray[np.int64]
Records = NDArray[np.void]

# Fields used together lie together: one cache line an entry, one a contact.
ENTRY = np.dtype([("key", np.float64), ("slot", np.int32), ("link", np.int32)])
CONTACT = np.dtype([("birth", np.float64), ("threshold", np.float64)])

# Why `advance` returned.
REACHED_END = 0
CONDITION_HELD = 1
THRESHOLDS_USED_UP = 2
DELAYS_USED_UP = 3
BUDGET_SPENT = 4
LOOK = 5


# ---------------------------------------------------------------------------------------------------------------------
# The bucket queue: entries (key, slot) in bins of equal width; only the bin in use is kept sorted.
# ---------------------------------------------------------------------------------------------------------------------


class Queue(NamedTuple):
    """Entries waiting in order of their key.

    ``head[b]`` starts the chain of bin number ``b`` modulo their count. The bin in use lies sorted in ``front_key``
    and ``front_slot``, between ``counts[FIRST]`` and ``counts[LAST]``.
    """

    head: Indices
    entries: Records
    front_key: Floats
    front_slot: Indices
    counts: Counts
    per_bin: float  # bins per unit of key


_FREE = 0  # first entry of the chain of freed ones
_UNUSED = 1  # entries beyond this one were never used
_CHAINED = 2  # how many entries lie in bins
_BIN = 3  # number of the bin in use
_FIRST = 4
_LAST = 5

_NEAR_CACHE = 65_536  # contacts, at 16 bytes each, that the near caches of a core hold


def make_queue(capacity: int, bins: int, width: float) -> Queue:
    """Return an empty queue.

    Parameters
    ----------
    capacity : int
        Largest number of entries.
    bins : int
        Number of bins; a power of two.
    width : float
        Width of a bin, in the unit of the key. Any width is right; the best holds a dozen entries.
    """
    queue = Queue(
        head=np.empty(bins, np.int32),
        entries=np.empty(capacity, ENTRY),
        front_key=np.empty(capacity),
        front_slot=np.empty(capacity, np.int32),
        counts=np.zeros(6, np.int64),
        per_bin=1.0 / width,
    )
    _clear(queue, 0.0)
    return queue


@bare
def _clear(queue: Queue, key: float) -> None:
    """Empty the queue and put the bin of `key` in use."""
    queue.head[:] = -1
    counts = queue.counts
    counts[_FREE] = -1
    counts[_UNUSED] = 0
    counts[_CHAINED] = 0
    counts[_BIN] = math.floor(key * queue.per_bin)
    counts[_FIRST] = 0
    counts[_LAST] = 0


@inlined
def _is_full(queue: Queue) -> bool:
    counts = queue.counts
    in_front = counts[_LAST] - counts[_FIRST]
    return bool(counts[_CHAINED] + in_front >= queue.entries.size)


@inlined
def _chain(queue: Queue, key: float, slot: int) -> None:
    """Put an entry into its bin."""
    counts = queue.counts
    entry = counts[_FREE]
    if entry >= 0:
        counts[_FREE] = queue.entries[entry]["link"]
    else:
        entry = counts[_UNUSED]
        counts[_UNUSED] += 1
    bin_ = math.floor(key * queue.per_bin) & (queue.head.size - 1)
    queue.entries[entry]["key"] = key
    queue.entries[entry]["slot"] = slot
    queue.entries[entry]["link"] = queue.head[bin_]
    queue.head[bin_] = entry
    counts[_CHAINED] += 1


@inlined
def _push(queue: Queue, key: float, slot: int) -> None:
    """Add an entry; the queue must not be full."""
    counts = queue.counts
    bin_ = math.floor(key * queue.per_bin)
    if bin_ < counts[_BIN] or counts[_FIRST] == counts[_LAST]:
        _return_front(queue)
        counts[_BIN] = min(counts[_BIN], bin_ - 1)
    if bin_ > counts[_BIN]:
        _chain(queue, key, slot)
        return
    first, last = counts[_FIRST], counts[_LAST]
    if last == queue.front_key.size:
        for i in range(first, last):
            queue.front_key[i - first] = queue.front_key[i]
            queue.front_slot[i - first] = queue.front_slot[i]
        first, last = 0, last - first
    place = last
    while place > first and queue.front_key[place - 1] > key:
        queue.front_key[place] = queue.front_key[place - 1]
        queue.front_slot[place] = queue.front_slot[place - 1]
        place -= 1
    queue.front_key[place] = key
    queue.front_slot[place] = slot
    counts[_FIRST] = first
    counts[_LAST] = last + 1


@inlined
def _return_front(queue: Queue) -> None:
    """Send the front back to its bin: something smaller has come, as when the slider turns back."""
    counts = queue.counts
    first, last = counts[_FIRST], counts[_LAST]
    counts[_FIRST] = counts[_LAST] = 0
    for i in range(first, last):
        _chain(queue, queue.front_key[i], queue.front_slot[i])


@inlined
def _peek(queue: Queue) -> float:
    """Smallest key; infinite if the queue is empty. Its slot is then ``front_slot[counts[FIRST]]``."""
    counts = queue.counts
    if counts[_FIRST] == counts[_LAST]:
        if counts[_CHAINED] == 0:
            return np.inf
        counts[_FIRST] = counts[_LAST] = 0
        empty_bins = 0
        while counts[_LAST] == 0:
            if empty_bins > queue.head.size:
                counts[_BIN] = _lowest_bin(queue) - 1
            counts[_BIN] += 1
            empty_bins += 1
            if queue.head[counts[_BIN] & (queue.head.size - 1)] >= 0:
                _load(queue)
    return float(queue.front_key[counts[_FIRST]])


@inlined
def _pop(queue: Queue) -> None:
    """Drop the entry with the smallest key; the queue must have been peeked at."""
    queue.counts[_FIRST] += 1


@bare
def _lowest_bin(queue: Queue) -> int:
    lowest = np.inf
    for chain in range(queue.head.size):
        entry = queue.head[chain]
        while entry >= 0:
            lowest = min(lowest, queue.entries[entry]["key"])
            entry = queue.entries[entry]["link"]
    return math.floor(lowest * queue.per_bin)


@inlined
def _load(queue: Queue) -> None:
    """Move the entries of the bin in use from its chain to the front, and sort them."""
    counts = queue.counts
    bin_ = counts[_BIN]
    chain = bin_ & (queue.head.size - 1)
    entry = queue.head[chain]
    kept = -1
    count = 0
    while entry >= 0:
        following = queue.entries[entry]["link"]
        if math.floor(queue.entries[entry]["key"] * queue.per_bin) == bin_:
            queue.front_key[count] = queue.entries[entry]["key"]
            queue.front_slot[count] = queue.entries[entry]["slot"]
            count += 1
            queue.entries[entry]["link"] = counts[_FREE]
            counts[_FREE] = entry
        else:  # an entry of a later turn of the wheel
            queue.entries[entry]["link"] = kept
            kept = entry
        entry = following
    queue.head[chain] = kept
    counts[_CHAINED] -= count
    counts[_LAST] = count
    _sort_front(queue, count)


@inlined
def _sort_front(queue: Queue, count: int) -> None:
    # A chain holds its newest entry first; rebirth times come in order, so reversed they are sorted already.
    keys, slots = queue.front_key, queue.front_slot
    for i in range(count // 2):
        j = count - 1 - i
        keys[i], keys[j] = keys[j], keys[i]
        slots[i], slots[j] = slots[j], slots[i]
    gap = 1
    while gap < count // 9:
        gap = 3 * gap + 1
    while gap > 0:  # Shell's sort: bins are short, and it needs no memory
        for i in range(gap, count):
            key, slot = keys[i], slots[i]
            j = i
            while j >= gap and keys[j - gap] > key:
                keys[j] = keys[j - gap]
                slots[j] = slots[j - gap]
                j -= gap
            keys[j] = key
            slots[j] = slot
        gap //= 3


# ---------------------------------------------------------------------------------------------------------------------
# The state and what moves it
# ---------------------------------------------------------------------------------------------------------------------


class Rig(NamedTuple):
    """Constants of the motion, per contact: ``K``, ``1/M`` and ``eta`` of Eq. (11).

    With all three zero the slider keeps its velocity whatever the force: rigid motion. `fixed_delay` is the delay of
    every broken contact, infinite for none to come back, or NaN to take delays from the array handed to `advance`.
    """

    K: float
    inverse_mass: float
    eta: float
    fixed_delay: float


class Piece(NamedTuple):
    """A piece of the drive: ``D = D0 + v0 (t-t0) + a (t-t0)^2/2`` up to `end`, or to a condition seen at a sample.

    Conditions: 0 none; 1 slider at least `stop_value` away from `X0`; 2 and 3 driving force at least / at most
    `stop_value`. `look` is a time at which the caller wants to look at the contacts: `advance` then returns before
    the flight that passes it, so that looking changes nothing.
    """

    t0: float
    end: float
    D0: float
    v0: float
    a: float
    stop_kind: int
    stop_value: float
    X0: float
    look: float


class State(NamedTuple):
    """All that the next step needs: contacts, queues, motion.

    ``contacts`` holds birth position and threshold, shape (N,); a threshold of 0 marks a detached contact. ``ahead`` is
    keyed by ``birth + threshold``, ``behind`` by ``threshold - birth``, ``rebirths`` by time. Entries of ``ahead`` and
    ``behind`` outlive their contact and are recognised as stale when they come up.
    """

    contacts: Records
    ahead: Queue
    behind: Queue
    rebirths: Queue
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
_HALF_SHARE = 10  # 1/(2 N)
# state.counts
ATTACHED = 0
SAMPLE = 1  # next sample
THRESHOLD = 2  # next threshold of those handed in
DELAY = 3
BREAKS = 4
EVENTS = 5

# columns of the samples
COLUMNS = ("X", "velocity", "F_c", "attached", "stored", "work", "damped", "broken")


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
        Times of rebirth of the detached contacts; infinite for those that stay detached.
    scale_time : float
        Typical delay, for the width of the bins of rebirth times.
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
        rebirths=make_queue(N + 64, _power_of_two(N / 8, N), time_width),
        motion=np.zeros(11),
        counts=np.zeros(6, np.int64),
        cuts=np.zeros(16),
    )
    state.motion[POSITION] = X
    state.motion[VELOCITY] = velocity
    state.motion[_HALF_SHARE] = 0.5 / N
    state.counts[ATTACHED] = int(attached.sum())
    first_detached = N - pending.size
    for i in np.flatnonzero(np.isfinite(pending)):
        _push(state.rebirths, float(pending[i]), first_detached + int(i))
    _rebuild(state, state.ahead, 1.0)
    _rebuild(state, state.behind, -1.0)
    _sum_again(state)
    return state


def contact_force(state: State) -> float:
    """Force of the contacts, per contact."""
    x = state.motion[POSITION] - state.motion[_REFERENCE]
    return float((state.counts[ATTACHED] * x - state.motion[_SUM]) / state.contacts.size)


def stretchings(state: State) -> Floats:
    """Stretchings of the attached contacts at the time of a look."""
    contacts = state.contacts[state.contacts["threshold"] > 0]
    return np.asarray(state.motion[LOOKED] - contacts["birth"])


def _power_of_two(wanted: float, most: int) -> int:
    return 1 << max(4, min(math.ceil(math.log2(max(wanted, 1.0))), math.ceil(math.log2(most + 1))))


@bare
def _rebuild(state: State, queue: Queue, side: float) -> None:
    """Fill a queue of breaking positions anew from the attached contacts, leaving stale entries out."""
    _clear(queue, side * state.motion[POSITION])
    for i in range(state.contacts.size):
        if state.contacts[i]["threshold"] > 0:
            _push(queue, state.contacts[i]["threshold"] + side * state.contacts[i]["birth"], i)


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
    """A contact is born, unstretched, where the slider is."""
    X = state.motion[POSITION]
    state.contacts[slot]["birth"] = X
    state.contacts[slot]["threshold"] = threshold
    y = X - state.motion[_REFERENCE]
    state.motion[_SUM] += y
    state.motion[_SQUARES] += y * y
    state.counts[ATTACHED] += 1
    if _is_full(state.ahead):
        _rebuild(state, state.ahead, 1.0)
    else:
        _push(state.ahead, threshold + X, slot)
    if _is_full(state.behind):
        # Happens once in about 2 N births: a good moment to sum again, too.
        _rebuild(state, state.behind, -1.0)
        _sum_again(state)
    else:
        _push(state.behind, threshold - X, slot)


@inlined
def _detach(state: State, slot: int) -> None:
    """A contact breaks, stretched to its threshold; its entry in the other queue goes stale."""
    y = state.contacts[slot]["birth"] - state.motion[_REFERENCE]
    state.motion[_SUM] -= y
    state.motion[_SQUARES] -= y * y
    state.motion[BROKEN] += state.contacts[slot]["threshold"] ** 2 * state.motion[_HALF_SHARE]
    state.contacts[slot]["threshold"] = 0.0
    state.counts[ATTACHED] -= 1
    state.counts[BREAKS] += 1


@inlined
def _fetch(state: State, queue: Queue, bin_: int) -> None:
    """Read the contacts of a bin just put in use, all at once: one by one, each would be waited for.

    Only where they lie outside the near caches.
    """
    counts = queue.counts
    if state.contacts.size > _NEAR_CACHE and counts[_BIN] != bin_:
        total = 0.0
        for i in range(counts[_FIRST], counts[_LAST]):
            total += state.contacts[queue.front_slot[i]]["birth"]
        state.cuts[0] = total  # so that the reads are not dropped


@inlined
def _next_break(state: State, queue: Queue, side: float) -> float:
    """Smallest key of a contact that is still attached; stale entries are dropped on the way."""
    while True:
        bin_ = queue.counts[_BIN]
        key = _peek(queue)
        if key == np.inf:
            return key
        _fetch(state, queue, bin_)
        slot = queue.front_slot[queue.counts[_FIRST]]
        threshold = state.contacts[slot]["threshold"]
        if threshold > 0 and threshold + side * state.contacts[slot]["birth"] == key:
            return key
        _pop(queue)


# ---------------------------------------------------------------------------------------------------------------------
# The motion between two events
# ---------------------------------------------------------------------------------------------------------------------


class Flight(NamedTuple):
    """Motion between two events, as displacement ``y(h)`` a time ``h`` after the first.

    ``y = q0 + q1 h + q2 h^2`` plus a free oscillation that starts from ``(y0, v0)``; ``c2 ... c8`` are the Taylor
    coefficients, used while ``h`` is at most `near`.
    """

    eta: float
    w2: float  # squared angular frequency (K + n/N)/M
    inverse: float  # 1/w2
    q0: float
    q1: float
    q2: float
    y0: float
    v0: float
    v: float
    c2: float
    c3: float
    c4: float
    c5: float
    c6: float
    c7: float
    c8: float
    near: float


# (eta + w) h up to here, w with all contacts attached: eight Taylor terms leave an error under 1e-14 of the velocity,
_NEAR = 0.06
_MIDDLE = 0.3  # and up to here, twelve
_DIED_OUT = 40.0  # a free oscillation that has decayed by exp of this is less than rounding
_LEGS = 16.0  # flights of more legs than this go through the closed form


@inlined
def _flight(eta: float, w2: float, near: float, v: float, f0: float, f1: float, f2: float) -> Flight:
    """Solve ``y'' + eta y' + w2 y = f0 + f1 h + f2 h^2`` from ``y = 0, y' = v``."""
    q0, q1, q2, inverse = 0.0, v, 0.0, 0.0
    if w2 > 0:  # else rigid motion
        inverse = 1.0 / w2
        q2 = f2 * inverse
        q1 = (f1 - 2.0 * eta * q2) * inverse
        q0 = (f0 - eta * q1 - 2.0 * q2) * inverse
    c2 = 0.5 * (f0 - eta * v)
    c3 = (f1 - w2 * v - 2.0 * eta * c2) * (1.0 / 6.0)
    c4 = (f2 - w2 * c2 - 3.0 * eta * c3) * (1.0 / 12.0)
    c5 = (-w2 * c3 - 4.0 * eta * c4) * (1.0 / 20.0)
    c6 = (-w2 * c4 - 5.0 * eta * c5) * (1.0 / 30.0)
    c7 = (-w2 * c5 - 6.0 * eta * c6) * (1.0 / 42.0)
    c8 = (-w2 * c6 - 7.0 * eta * c7) * (1.0 / 56.0)
    return Flight(eta, w2, inverse, q0, q1, q2, -q0, v - q1, v, c2, c3, c4, c5, c6, c7, c8, near)


@inlined
def _taylor(f: Flight, h: float) -> tuple[float, float]:
    """Displacement and velocity by the Taylor expansion, within `_MIDDLE`."""
    tail, slope = 0.0, 0.0
    if h > f.near:
        c9 = (-f.w2 * f.c7 - 8.0 * f.eta * f.c8) * (1.0 / 72.0)
        c10 = (-f.w2 * f.c8 - 9.0 * f.eta * c9) * (1.0 / 90.0)
        c11 = (-f.w2 * c9 - 10.0 * f.eta * c10) * (1.0 / 110.0)
        c12 = (-f.w2 * c10 - 11.0 * f.eta * c11) * (1.0 / 132.0)
        tail = h * (c9 + h * (c10 + h * (c11 + h * c12)))
        slope = h * (9.0 * c9 + h * (10.0 * c10 + h * (11.0 * c11 + h * 12.0 * c12)))
    y = f.v + h * (f.c2 + h * (f.c3 + h * (f.c4 + h * (f.c5 + h * (f.c6 + h * (f.c7 + h * (f.c8 + tail)))))))
    v = 5.0 * f.c5 + h * (6.0 * f.c6 + h * (7.0 * f.c7 + h * (8.0 * f.c8 + slope)))
    v = f.v + h * (2.0 * f.c2 + h * (3.0 * f.c3 + h * (4.0 * f.c4 + h * v)))
    return h * y, v


@inlined
def _free(f: Flight, h: float) -> tuple[float, float]:
    """Responses of the free oscillator at `h` to a unit displacement and to a unit velocity."""
    g = 0.5 * f.eta
    d = g * g - f.w2
    if d < 0:
        w = math.sqrt(-d)
        decay = math.exp(-g * h)
        sine = decay * math.sin(w * h) / w
        return decay * math.cos(w * h) + g * sine, sine
    b = math.sqrt(d)
    if b * h < 1e-3:
        decay = math.exp(-g * h)
        z = d * h * h
        sine = decay * h * (1.0 + z / 6.0 + z * z / 120.0)
        return decay * (1.0 + 0.5 * z + z * z / 24.0) + g * sine, sine
    fast, slow = g + b, f.w2 / (g + b)
    e_fast, e_slow = math.exp(-fast * h), math.exp(-slow * h)
    return (fast * e_slow - slow * e_fast) / (2.0 * b), (e_slow - e_fast) / (2.0 * b)


@inlined
def _far(f: Flight, h: float) -> tuple[float, float]:
    """Displacement and velocity by the closed form."""
    c, s = _free(f, h)
    y = f.q0 + f.q1 * h + f.q2 * h * h + f.y0 * c + f.v0 * s
    v = f.q1 + 2.0 * f.q2 * h + f.v0 * c + 2.0 * (f.c2 - f.q2) * s
    return y, v


@inlined
def _at(f: Flight, h: float) -> tuple[float, float]:
    """Displacement and velocity a time `h` into the flight."""
    return _taylor(f, h) if h <= f.near * (_MIDDLE / _NEAR) else _far(f, h)


@bare
def _derivative(f: Flight, order: int, h: float) -> tuple[float, float]:
    """Displacement, velocity, acceleration or jerk (order 0 to 3), and the next derivative, by the closed form."""
    v, a = f.v0, 2.0 * (f.c2 - f.q2)
    g = 0.5 * f.eta
    if f.w2 < 0.5 * g * g:
        # Two modes, far apart. Derivatives of their sum would lose the slow one in the rounding of the fast one.
        b = math.sqrt(g * g - f.w2)
        fast, slow = g + b, f.w2 / (g + b)
        fast_a = 0.5 * fast * (a + slow * v) / b * math.exp(-fast * h)
        slow_a = -0.5 * slow * (a + fast * v) / b * math.exp(-slow * h)
        y, v = fast_a / (fast * fast) + slow_a / (slow * slow), -fast_a / fast - slow_a / slow
        a, j = fast_a + slow_a, -fast * fast_a - slow * slow_a
        k = fast * fast * fast_a + slow * slow * slow_a
    else:
        c, s = _free(f, h)
        y, v = f.y0 * c + v * s, v * c + a * s
        a = -f.eta * v - f.w2 * y
        j = -f.eta * a - f.w2 * v
        k = -f.eta * j - f.w2 * a
    if order == 0:
        return f.q0 + f.q1 * h + f.q2 * h * h + y, f.q1 + 2.0 * f.q2 * h + v
    if order == 1:
        return f.q1 + 2.0 * f.q2 * h + v, 2.0 * f.q2 + a
    if order == 2:
        return 2.0 * f.q2 + a, j
    return j, k


@bare
def _start(f: Flight, order: int) -> float:
    """Velocity, acceleration or jerk (order 1 to 3) just after the start: where it is 0, the first that is not."""
    if order == 1 and f.v != 0.0:
        return f.v
    if order <= 2 and f.c2 != 0.0:
        return f.c2
    return f.c3 if f.c3 != 0.0 else f.c4


@bare
def _root(f: Flight, order: int, value: float, low: float, high: float) -> float:
    """Where a derivative, monotone from `low` to `high`, takes a value: Newton, kept inside by bisection."""
    rising = _derivative(f, order, high)[0] > _derivative(f, order, low)[0]
    h = 0.5 * (low + high)
    for _ in range(200):
        gap, slope = _derivative(f, order, h)
        gap -= value
        if gap == 0.0:
            return h
        if (gap > 0) == rising:
            high = h
        else:
            low = h
        following = h - gap / slope if slope != 0.0 else low
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - h) <= 4e-16 * h or following <= low or following >= high:
            return following
        h = following
    return h


@bare
def _first_crossing(f: Flight, to_ahead: float, to_behind: float, most: float, cuts: Floats) -> tuple[float, int]:
    """First time up to `most` at which the displacement reaches `to_ahead` or `-to_behind`, and which: 1 or -1.

    With neither, the end of the stretch that was searched and 0: `most` or, if sooner, a quarter of a period. The
    stretch is cut where the jerk vanishes (at most once within a quarter of a period, being a free oscillation),
    then where the acceleration does, then the velocity: on each part the displacement is monotone and no crossing can
    hide. A vanishing derivative shows by its signs at the two ends of a part. They are right only while the free
    oscillation is more than rounding, hence a first cut where it has died out: beyond, the motion is a parabola.
    """
    g2 = f.w2 - 0.25 * f.eta * f.eta
    decay = 0.5 * f.eta  # of the slowest part of the free oscillation
    if g2 > 0.0:
        most = min(most, 0.5 * math.pi / math.sqrt(g2))
    elif f.w2 > 0.0:
        decay = f.w2 / (decay + math.sqrt(-g2))
    else:  # rigid motion
        distance = to_ahead if f.v > 0 else to_behind
        if f.v == 0.0 or most * abs(f.v) < distance:
            return most, 0
        return distance / abs(f.v), 1 if f.v > 0 else -1
    if f.v != 0.0:  # most often the crossing comes soon: a short stretch has no turns and needs no roots
        most = min(most, 4.0 * (to_ahead if f.v > 0 else to_behind) / abs(f.v))
    cuts[0], cuts[1] = 0.0, most
    count = 2
    if decay * most > _DIED_OUT:
        cuts[1], cuts[2] = _DIED_OUT / decay, most
        count = 3
    for order in (3, 2, 1):
        i = 0
        left = _start(f, order)
        while i + 1 < count:
            right = _derivative(f, order, cuts[i + 1])[0]
            if left * right < 0.0:
                root = _root(f, order, 0.0, cuts[i], cuts[i + 1])
                if cuts[i] < root < cuts[i + 1]:
                    for j in range(count, i + 1, -1):
                        cuts[j] = cuts[j - 1]
                    cuts[i + 1] = root
                    count += 1
                    i += 1
            left = right
            i += 1
    for i in range(count - 1):
        y = _derivative(f, 0, cuts[i + 1])[0]
        if y >= to_ahead:
            return _root(f, 0, to_ahead, cuts[i], cuts[i + 1]), 1
        if y <= -to_behind:
            return _root(f, 0, -to_behind, cuts[i], cuts[i + 1]), -1
    return most, 0


@inlined
def _soon(f: Flight, distance: float, most: float) -> tuple[float, float, float, int, bool]:
    """Try the common case: a short flight at nearly constant velocity.

    Returns the time to travel the signed `distance`, or at most `most` of it; the displacement and the velocity then;
    1 if the distance is reached and 0 if not; and whether the case applies: the velocity keeps at least half its
    value, and the flight lasts no longer than a few times what the Taylor expansion can do. A flight longer than the
    expansion reaches is flown in legs.
    """
    slowness = 1.0 / f.v
    h = distance * slowness
    reach = f.near * (_MIDDLE / _NEAR)
    longest = min(most, 2.0 * h)
    if longest > reach:
        if longest > _LEGS * reach:
            return 0.0, 0.0, 0.0, 0, False
        longest = most = reach
    if not longest * (2.0 * abs(f.c2) + longest * (3.0 * abs(f.c3) + longest * 4.0 * abs(f.c4))) < 0.4 * abs(f.v):
        return 0.0, 0.0, 0.0, 0, False
    if most < 2.0 * h:
        y, v = _taylor(f, most)
        if abs(y) < abs(distance):
            return most, y, v, 0, True
    bend = f.c2 * h * slowness
    h *= 1.0 - bend + 2.0 * bend * bend - f.c3 * h * h * slowness  # the series, inverted
    v = f.v
    for _ in range(6):  # Newton; from a guess this good one turn does, mostly
        y, v = _taylor(f, h)
        step = (distance - y) / v
        h += step
        if abs(step) <= 1e-6 * h:  # the next would be less than its square
            v += step * (2.0 * f.c2 + 6.0 * f.c3 * h)
            break
    return min(max(h, 0.0), most), distance, v, 1, True


@inlined
def _energies(
    f: Flight, h: float, y: float, v: float, force: float, K: float, drive_v: float, drive_a: float
) -> tuple[float, float]:
    """Work of the drive and integral of the squared velocity over a time `h`, in closed form.

    `force` is the driving force at the start. The free oscillation ``u`` obeys ``u'' + eta u' + w2 u = 0``, hence
    ``(u'^2 + w2 u^2)/2`` falls at the rate ``eta u'^2`` and the integral of ``u`` follows from the change of ``u'``
    and ``u``.
    """
    h2 = h * h
    u = y - (f.q0 + f.q1 * h + f.q2 * h2)
    du = v - (f.q1 + 2.0 * f.q2 * h)
    change = u - f.y0
    area = -((du - f.v0) + f.eta * change) * f.inverse
    path = f.q0 * h + 0.5 * f.q1 * h2 + f.q2 * h2 * h / 3.0 + area
    work = drive_v * (force * h + K * (0.5 * drive_v * h2 + drive_a * h2 * h / 6.0 - path))
    if drive_a != 0.0:
        moment = -(h * du - change + f.eta * (h * u - area)) * f.inverse
        path_moment = 0.5 * f.q0 * h2 + f.q1 * h2 * h / 3.0 + 0.25 * f.q2 * h2 * h2 + moment
        pull = 0.5 * force * h2 + K * (drive_v * h2 * h / 3.0 + 0.125 * drive_a * h2 * h2 - path_moment)
        work += drive_a * pull
    squares = f.q1 * f.q1 * h + 2.0 * f.q1 * f.q2 * h2 + 4.0 / 3.0 * f.q2 * f.q2 * h2 * h
    squares += 2.0 * f.q1 * change + 4.0 * f.q2 * (h * u - area)
    if f.eta > 0.0:
        squares += 0.5 * ((f.v0 - du) * (f.v0 + du) + f.w2 * (f.y0 - u) * (f.y0 + u)) / f.eta
    return work, squares


# ---------------------------------------------------------------------------------------------------------------------
# The engine
# ---------------------------------------------------------------------------------------------------------------------


@bare
def advance(
    state: State,
    rig: Rig,
    piece: Piece,
    sample_times: Floats,
    samples: Floats,
    thresholds: Floats,
    delays: Floats,
    budget: int,
) -> int:
    """Move the state on, event by event, until a reason to stop.

    Parameters
    ----------
    state : State
        Changed in place. ``counts[SAMPLE]``, ``counts[THRESHOLD]`` and ``counts[DELAY]`` say how far the arrays below
        are filled or used.
    rig : Rig
    piece : Piece
    sample_times : array, shape (n,)
        Rising times at which to sample; those up to ``piece.end`` are filled.
    samples : array, shape (n, 8)
        Filled with `COLUMNS`: position, velocity, force of the contacts, attached fraction, energy stored in contacts,
        and, accumulated since the start, work of the drive, energy lost to damping and in breaks; all per contact.
    thresholds, delays : array
        Thresholds for newborn contacts and, unless the delay is fixed, delays for broken ones, in the order of use.
    budget : int
        Return after about this many events, so that a caller can show progress or be interrupted.

    Returns
    -------
    int
        `REACHED_END`, `CONDITION_HELD`, `THRESHOLDS_USED_UP`, `DELAYS_USED_UP`, `BUDGET_SPENT` or `LOOK`.
    """
    motion, counts = state.motion, state.counts
    N = float(state.contacts.size)
    random_delay = math.isnan(rig.fixed_delay)
    rigid = rig.inverse_mass == 0.0
    share = 1.0 / N
    drag = rig.eta / rig.inverse_mass if rig.inverse_mass > 0 else 0.0
    fastest = rig.eta + math.sqrt((rig.K + 1.0) * rig.inverse_mass)
    near = _NEAR / fastest if fastest > 0 else np.inf
    to_go = budget
    ahead = _next_break(state, state.ahead, 1.0)
    rebirth = _peek(state.rebirths)
    while True:
        if counts[THRESHOLD] >= thresholds.size:
            return THRESHOLDS_USED_UP
        if random_delay and counts[DELAY] >= delays.size:
            return DELAYS_USED_UP
        if to_go <= 0:
            return BUDGET_SPENT
        to_go -= 1

        t, X, v = motion[TIME], motion[POSITION], motion[VELOCITY]
        since = t - piece.t0
        drive_v = piece.v0 + piece.a * since
        D = piece.D0 + (piece.v0 + 0.5 * piece.a * since) * since
        n = float(counts[ATTACHED])
        F_d = rig.K * (D - X)
        F_c = (n * (X - motion[_REFERENCE]) - motion[_SUM]) * share
        flight = _flight(
            rig.eta,
            (rig.K + n * share) * rig.inverse_mass,
            near,
            v,
            (F_d - F_c) * rig.inverse_mass,
            rig.K * drive_v * rig.inverse_mass,
            0.5 * rig.K * piece.a * rig.inverse_mass,
        )

        # How long this flight lasts, and what ends it: a break (1 ahead, -1 behind), or the limit (0).
        limit = min(rebirth, piece.end)
        most = max(limit - t, 0.0)
        to_ahead = max(ahead - X, 0.0)
        h, y, u, side, applies = 0.0, 0.0, v, 1, to_ahead == 0.0
        if not applies and v > 0.0:
            h, y, u, side, applies = _soon(flight, to_ahead, most)
        if not applies:
            # Only now the queue behind is asked: while the slider moves on, none of its contacts can break.
            behind = _next_break(state, state.behind, -1.0)
            to_behind = max(behind + X, 0.0)
            h, y, u, side, applies = 0.0, 0.0, v, 1, to_behind == 0.0
            if not applies and v < 0.0:
                h, y, u, side, applies = _soon(flight, -to_behind, most)
            side = -side
            if not applies:
                h, side = _first_crossing(flight, to_ahead, to_behind, most, state.cuts)
                y, u = _at(flight, h)
        ends_at = limit if side == 0 and h == most else t + h

        if ends_at > piece.look and t <= piece.look:
            motion[LOOKED] = X + _at(flight, piece.look - t)[0]
            return LOOK

        # Samples that fall inside.
        while counts[SAMPLE] < sample_times.size and sample_times[counts[SAMPLE]] <= min(ends_at, piece.end):
            i = counts[SAMPLE]
            part = sample_times[i] - t
            y_part, u_part = _at(flight, part)
            x = X + y_part - motion[_REFERENCE]
            samples[i, 0] = X + y_part
            samples[i, 1] = u_part
            samples[i, 2] = (n * x - motion[_SUM]) * share
            samples[i, 3] = n / N
            samples[i, 4] = 0.5 * (n * x * x - 2.0 * x * motion[_SUM] + motion[_SQUARES]) * share
            samples[i, 5], samples[i, 6], samples[i, 7] = motion[WORK], motion[DAMPED], motion[BROKEN]
            if not rigid:
                work, squares = _energies(flight, part, y_part, u_part, F_d, rig.K, drive_v, piece.a)
                samples[i, 5] += work
                samples[i, 6] += drag * squares
            counts[SAMPLE] += 1
            if piece.stop_kind != 0:
                later = sample_times[i] - piece.t0
                pull = rig.K * (piece.D0 + (piece.v0 + 0.5 * piece.a * later) * later - samples[i, 0])
                if (
                    (piece.stop_kind == 1 and abs(samples[i, 0] - piece.X0) >= piece.stop_value)
                    or (piece.stop_kind == 2 and pull >= piece.stop_value)
                    or (piece.stop_kind == 3 and pull <= piece.stop_value)
                ):
                    motion[TIME], motion[POSITION], motion[VELOCITY] = sample_times[i], X + y_part, u_part
                    motion[WORK], motion[DAMPED] = samples[i, 5], samples[i, 6]
                    return CONDITION_HELD

        # Fly.
        if not rigid:
            work, squares = _energies(flight, h, y, u, F_d, rig.K, drive_v, piece.a)
            motion[WORK] += work
            motion[DAMPED] += drag * squares
        motion[TIME] = ends_at
        motion[VELOCITY] = u
        motion[POSITION] = X + y
        counts[EVENTS] += 1

        # What happens there.
        if side != 0:
            queue = state.ahead if side == 1 else state.behind
            slot = queue.front_slot[queue.counts[_FIRST]]
            motion[POSITION] = state.contacts[slot]["birth"] + side * state.contacts[slot]["threshold"]
            _pop(queue)
            _detach(state, slot)
            delay = rig.fixed_delay
            if random_delay:
                delay = delays[counts[DELAY]]
                counts[DELAY] += 1
            if delay == 0.0:
                _attach(state, slot, thresholds[counts[THRESHOLD]])
                counts[THRESHOLD] += 1
            elif delay < np.inf:
                _push(state.rebirths, ends_at + delay, slot)
                rebirth = _peek(state.rebirths)
        elif ends_at == rebirth:
            slot = state.rebirths.front_slot[state.rebirths.counts[_FIRST]]
            _pop(state.rebirths)
            _attach(state, slot, thresholds[counts[THRESHOLD]])
            counts[THRESHOLD] += 1
            bin_ = state.rebirths.counts[_BIN]
            rebirth = _peek(state.rebirths)
            _fetch(state, state.rebirths, bin_)
        elif ends_at >= piece.end:
            return REACHED_END
        ahead = _next_break(state, state.ahead, 1.0)
