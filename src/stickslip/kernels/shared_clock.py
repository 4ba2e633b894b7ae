"""One clock for all contacts that break by Bell's rate at thresholds that do not grow:
one box for all of them.

A contact that attached at ``b`` with threshold ``s`` breaks at the rate
``w exp((|X - b| - s)/A)``. Breaks are proposed at the rate
``w exp((X - b - s)/A) + w exp((b - X - s)/A)``, and accepted with the part that the
true rate has of it. Each of the two terms is the same for all contacts but for a
factor: those of the first are proposed when the clock ``Z = w Int exp(X/A) dt`` has run
on by ``exp((b + s)/A) E``, with ``E`` drawn from ``exp(-E)``; a second clock goes by
``-X`` and ``b - s``.

While the slider stays in a window, its edge stands for ``X``: the clocks then run
evenly in time, and a proposal is accepted with the probability ``exp((X - edge)/A)``
besides. Readings are kept as lengths, ``A ln Z``: proposals wait in a bucket queue as
positions do. A clock by which nobody can break is not kept, and one that the slider has
left far behind has lost its digits: breaks have no memory, so that a clock can be
wound, and its readings drawn, at any time.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .event_queue import Queue, size, used
from .hazard import LOGARITHMIC, is_exponential
from .records import Floats, Record, blank, record
from .thinning import CHANCE, Rule
from .tournament import enter, play, smallest, tournaments

# widths that a clock is wound behind the slider, and that the slider may retreat before
# it is wound again
_LAG = 30.0
# widths from the slider to an edge of the window, at least and about at most
_SPAN = 0.25, 1e3
# exponents beyond which the smaller of two terms is less than the rounding of the other
_FAR = 36.0
# breaks, of all contacts until the window is laid anew, that do not come
_NEVER = 1e-15


_DIAL = record("edge reading pace top safe first due", counts="kept")
"""One of the two clocks: of contacts stretched forwards, or backwards with all
positions mirrored.

The edge of the window on the side of larger rates; the reading when the window was
laid, and the rate of the clock over its value then; the largest edge since it was
wound. The window does for contacts that attach with thresholds beyond `safe`. Then the
reading of the next proposal, as it was seen last, and its time.
"""

_WINDOW = record("low high since until", counts="wanted")
"""Where and until when the clocks run evenly, and how many variates are wanted to
wind them.
"""


class Clock(NamedTuple):
    """The two clocks, ahead first, and a tournament each of the readings at which
    contacts are proposed.
    """

    window: Record  # shape (1,)
    dials: Record  # shape (2,)
    readings: Floats


def make_clock(contacts: int) -> Clock:
    """Return a clock that is wound as soon as time goes on; one of no contacts never
    is.
    """
    window = blank(_WINDOW, 1)
    dials = blank(_DIAL, 2)
    window.low = -np.inf
    window.high = np.inf
    window.until = -np.inf if contacts else np.inf
    return Clock(window, dials, tournaments(np.full((2, max(contacts, 1)), np.inf)))


@inlined
def is_shared(rule: Rule) -> bool:
    """Whether contacts share a clock."""
    growth = rule.growth
    fixed = growth.kind == LOGARITHMIC and growth.first == 0.0
    return is_exponential(rule.hazard) and fixed


@inlined
def runs_evenly(clock: Clock, m: Record) -> bool:
    """Whether the slider is in the window."""
    window = clock.window[0]
    return bool(window.low < m.position < window.high and m.time < window.until)


@inlined
def _strikes(clock: Clock, side: int, width: float) -> float:
    """Time of the next proposal."""
    reading = smallest(clock.readings[side])
    dial = clock.dials[side]
    if reading != dial.first:
        dial.first = reading
        dial.due = (
            clock.window[0].since
            + math.expm1((reading - dial.reading) / width) / dial.pace
        )
    return float(dial.due)


@inlined
def strikes(clock: Clock, rule: Rule, now: float) -> tuple[float, int]:
    """Time of the next proposal, and of which clock."""
    ahead = _strikes(clock, 0, rule.hazard.width)
    behind = _strikes(clock, 1, rule.hazard.width)
    return max(min(ahead, behind), now), int(behind < ahead)


@inlined
def chance(
    clock: Clock,
    side: int,
    rule: Rule,
    X: float,
    x: float,
) -> float:
    """Probability that a proposal is accepted, of a contact stretched by `x`."""
    width = rule.hazard.width
    sign = 1 - 2 * side
    return math.exp((sign * X - clock.dials[side].edge) / width) / (
        1.0 + math.exp(-2.0 * abs(x) / width)
    )


@inlined
def _reading(
    clock: Clock,
    side: int,
    rest: float,
    width: float,
    time: float,
    variate: float,
) -> float:
    """Draw the reading at which a contact is proposed whose threshold is at `rest`,
    mirrored behind.
    """
    dial = clock.dials[side]
    passed = dial.pace * (time - clock.window[0].since)
    ratio = math.log(-math.log1p(-variate))
    # then what has passed is less than rounding
    if (rest - dial.reading) / width + ratio - passed > _FAR:
        return float(rest + width * ratio)
    now = dial.reading + width * math.log1p(passed)
    return float(now + width * math.log1p(math.exp((rest - now) / width + ratio)))


@inlined
def propose(
    clock: Clock,
    side: int,
    slot: int,
    rest: float,
    contacts: int,
    rule: Rule,
    m: Record,
    variates: Floats,
) -> None:
    """Draw when a clock proposes a contact that it keeps; reset a window that does not
    contain it.
    """
    dial = clock.dials[side]
    if rest < dial.safe:
        clock.window[0].until = -np.inf
    if dial.kept:
        reading = _reading(
            clock,
            side,
            rest,
            rule.hazard.width,
            m.time,
            variates[m.variates_used],
        )
        enter(clock.readings[side], contacts, slot, reading)
        m.variates_used += 1


@inlined
def forget(clock: Clock, slot: int, contacts: int) -> None:
    """Remove a contact that breaks from the clocks."""
    for side in range(2):
        if clock.dials[side].kept:
            enter(clock.readings[side], contacts, slot, np.inf)


@bare
def wind(
    clock: Clock,
    rule: Rule,
    m: Record,
    held: Queue,
    first: float,
    first_behind: float,
    variates: Floats,
) -> bool:
    """Set the window about the slider and wind the clocks where due; return False if
    too few variates are left.

    `held` are the attached contacts; no threshold is met ahead before `first`, behind
    before `first_behind`, mirrored.
    """
    window = clock.window[0]
    N = held.capacity
    width = rule.hazard.width
    attempts = rule.hazard.attempts
    onwards = m.direction > 0
    span = _SPAN[0] * width
    to_go = (first if onwards else first_behind) - m.direction * m.position
    reach = span
    # ends: the reach doubles in each turn
    while reach < _SPAN[1] * width:
        if N * attempts * math.exp(
            (2.0 * reach - to_go) / width
        ) * 2.0 * reach > CHANCE * abs(m.velocity):
            break
        reach *= 2.0
    low = m.position - (span if onwards else reach)
    high = m.position + (reach if onwards else span)
    until = 2.0 * m.time + 1.0 / (N * attempts)

    wanted = 0
    for side in range(2):
        dial = clock.dials[side]
        edge = high if side == 0 else -low
        nearest = first if side == 0 else first_behind
        dial.safe = edge + width * math.log(N * attempts * (until - m.time) / _NEVER)
        if dial.kept and edge < dial.top - _LAG * width:
            dial.kept = 0
            clock.readings[side, :] = np.inf
        if not dial.kept and nearest < dial.safe:
            wanted += size(held)
    window.wanted = wanted
    if m.variates_used + wanted > variates.size:
        return False

    passed = m.time - window.since
    window.low = low
    window.high = high
    window.since = m.time
    window.until = until
    window.wanted = 0
    for side in range(2):
        dial = clock.dials[side]
        edge = high if side == 0 else -low
        nearest = first if side == 0 else first_behind
        wound = edge - _LAG * width
        if dial.kept:
            dial.reading = max(
                dial.reading + width * math.log1p(dial.pace * passed), wound
            )
            dial.top = max(dial.top, edge)
        else:
            dial.reading = wound
            dial.top = edge
        dial.first = np.nan
        dial.edge = edge
        dial.pace = attempts * math.exp((edge - dial.reading) / width)
        if not dial.kept and nearest < dial.safe:
            dial.kept = 1
            _wind(clock, side, rule, m, held, variates)
        if dial.kept:  # a wide window is one for the nearest threshold that there is
            dial.safe = nearest if reach > span and onwards == (side == 0) else -np.inf
    return True


@bare
def _wind(
    clock: Clock,
    side: int,
    rule: Rule,
    m: Record,
    held: Queue,
    variates: Floats,
) -> None:
    """Draw all readings of a clock."""
    for place in range(used(held)):
        contact = held.entries[place]
        if contact["key"] < np.inf:
            rest = contact["threshold"] + (1 - 2 * side) * contact["birth"]
            reading = _reading(
                clock,
                side,
                rest,
                rule.hazard.width,
                m.time,
                variates[m.variates_used],
            )
            clock.readings[side, contact["slot"] - held.capacity] = reading
            m.variates_used += 1
    play(clock.readings[side : side + 1], held.capacity)
