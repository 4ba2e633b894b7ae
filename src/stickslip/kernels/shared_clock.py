"""One clock for all contacts that break by Bell's rate at thresholds that do not grow:
they share one box.

A contact that attached at ``b`` with threshold ``s`` breaks at the rate
``w exp((|X - b| - s)/A)``. Breaks are proposed at the larger rate
``w exp((X - b - s)/A) + w exp((b - X - s)/A)``, and accepted with the ratio of the true
rate to it. Each of the two terms is the same for all contacts except for a constant
factor. A contact is proposed by the first term when the clock ``Z = w Int exp(X/A) dt``
has advanced by ``exp((b + s)/A) E``, with ``E`` drawn from ``exp(-E)``; a second clock
runs with ``-X`` and ``b - s``.

While the slider stays in a window, the edge of the window replaces ``X``: the clocks
then run evenly in time, and a proposal must also be accepted with the probability
``exp((X - edge)/A)``. Readings are stored as lengths, ``A ln Z``: proposals wait in a
bucket queue like positions. A clock by which no contact can break is not kept, and one
that the slider has left far behind has lost its digits. Since breaks have no memory, a
clock can be wound, and its readings drawn anew, at any time.
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

# In units of the activation width: how far behind the slider a clock is wound, and how
# far the slider may retreat before it is wound again.
_LAG = 30.0
# In units of the width: least and approximately largest distance from the slider to an
# edge of the window.
_SPAN = 0.25, 1e3
# exponent beyond which the smaller of two terms is below the rounding of the larger
_FAR = 36.0
# expected breaks, of all contacts until the window is set anew, that are neglected
_NEVER = 1e-15


_DIAL = record("edge reading pace top safe first due", counts="kept")
"""One of the two clocks: for contacts stretched forwards, or backwards with all
positions mirrored.

The edge of the window on the side of larger rates; the reading when the window was set,
and the rate of the clock over its value then; the largest edge since it was wound. The
window is valid for contacts that attach with thresholds beyond `safe`. Then the reading
of the next proposal when it was last computed, and its time.
"""

_WINDOW = record("low high since until", counts="wanted")
"""Positions and time between which the clocks run evenly, and how many variates are
needed to wind them.
"""


class Clock(NamedTuple):
    """The two clocks, the one for contacts ahead first, and for each a tournament of
    the readings at which contacts are proposed.
    """

    window: Record  # shape (1,)
    dials: Record  # shape (2,)
    readings: Floats


def make_clock(contacts: int) -> Clock:
    """Return a clock that is wound at the first event; without contacts it never is."""
    window = blank(_WINDOW, 1)
    dials = blank(_DIAL, 2)
    window.low = -np.inf
    window.high = np.inf
    window.until = -np.inf if contacts else np.inf
    return Clock(window, dials, tournaments(np.full((2, max(contacts, 1)), np.inf)))


@inlined
def is_shared(rule: Rule) -> bool:
    """Return whether contacts share a clock."""
    growth = rule.growth
    fixed = growth.kind == LOGARITHMIC and growth.first == 0.0
    return is_exponential(rule.hazard) and fixed


@inlined
def runs_evenly(clock: Clock, m: Record) -> bool:
    """Return whether the slider is in the window, so that the clocks run evenly."""
    window = clock.window[0]
    return bool(window.low < m.position < window.high and m.time < window.until)


@inlined
def _strikes(clock: Clock, side: int, width: float) -> float:
    """Return the time of the next proposal of one clock."""
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
    """Return the time of the next proposal, and which clock makes it."""
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
    """Return the probability that the proposal of a contact stretched by `x` is
    accepted.
    """
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
    """Draw the reading at which a contact is proposed that meets its threshold with the
    slider at `rest` (for the clock behind, at ``-rest``).
    """
    dial = clock.dials[side]
    passed = dial.pace * (time - clock.window[0].since)
    ratio = math.log(-math.log1p(-variate))
    # then the time that has passed is below rounding
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
    """Draw when a clock, if it is kept, proposes a contact; end the window if the
    contact's threshold is not beyond `safe`.
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
    """Set the window about the slider and wind the clocks that need it; return False if
    too few variates are left.

    `held` are the attached contacts. No threshold is met before the slider reaches
    `first` ahead, or ``-first_behind`` behind.
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
        if dial.kept:  # a wide window is valid only for the present nearest threshold
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
