"""Cohorts of the solvers of second order: what attached in a step, and what has
broken since, for the delays.
"""

from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .records import Counts, Floats

PLACE, MASS, REACH, ALIVE = range(4)
"""Rows of cohorts: where they attached, how many did, the largest stretching so far,
how many are left.
"""
KEPT = 1024  # steps of which breaks are remembered, at first


class Delays(NamedTuple):
    """Times until a broken contact re-attaches, and their weights; none: it never
    does.
    """

    time: Floats
    weight: Floats


class History(NamedTuple):
    """What has broken up to each of the last steps, in a ring, for one population or
    n.
    """

    times: Floats  # shape (kept,)
    # shape (kept, n), or (kept, n delays) where it is drawn how long each waits
    broken: Floats
    entered: Counts  # shape (1,): steps entered so far
    cursor: Counts  # shape (delays,): step at or before the time one delay ago


def first_history(delays: Delays, rate: Floats) -> History:
    """Return the history at time 0, after breaks at a constant rate in each of its
    columns.
    """
    times = np.zeros(KEPT)
    broken = np.zeros((KEPT, rate.size))
    times[0] = -max([1.0, *delays.time])
    broken[0] = rate * times[0]
    return History(times, broken, np.array([2]), np.zeros(delays.time.size, np.int64))


def longer(history: History) -> History:
    """Return a history with twice the room."""
    kept = history.times.size
    entered = int(history.entered[0])
    steps = np.arange(max(entered - kept, 0), entered)
    times = np.zeros(2 * kept)
    broken = np.zeros((2 * kept, history.broken.shape[1]))
    times[steps % (2 * kept)] = history.times[steps % kept]
    broken[steps % (2 * kept)] = history.broken[steps % kept]
    return history._replace(times=times, broken=broken)


@inlined
def has_room(history: History) -> bool:
    """Whether another step can be entered, and nothing is lost that has still to
    re-attach.
    """
    oldest = history.entered[0] - 1
    for k in range(history.cursor.size):
        oldest = min(oldest, history.cursor[k])
    return bool(history.entered[0] - oldest < history.times.size)


@bare
def due(history: History, delays: Delays, dt: float, found: Floats) -> float:
    """Find all that is to have re-attached a time `dt` after the last step, of what
    broke before it.

    Returns the fraction of what breaks in that time that re-attaches in it, too.
    """
    times = history.times
    kept = history.times.size
    last = history.entered[0] - 1
    now = times[last % kept]
    columns = history.broken.shape[1] // found.size
    fraction = 0.0
    found[:] = 0.0
    for k in range(delays.time.size):
        i = history.cursor[k]
        then = now + dt - delays.time[k]
        weight = delays.weight[k]
        c, share = (k, 1.0) if columns > 1 else (0, weight)
        while i < last - 1 and times[(i + 1) % kept] <= now - delays.time[k]:
            i += 1
        history.cursor[k] = i
        if then >= now:
            fraction += weight * (then - now) / dt
            for j in range(found.size):
                found[j] += share * history.broken[last % kept, columns * j + c]
            continue
        while i < last - 1 and times[(i + 1) % kept] <= then:
            i += 1
        a = i % kept
        b = (i + 1) % kept
        u = (then - times[a]) / (times[b] - times[a])
        for j in range(found.size):
            before = history.broken[a, columns * j + c]
            after = history.broken[b, columns * j + c]
            found[j] += share * (before + u * (after - before))
    return fraction


@inlined
def join(
    cohort: Floats, i: int, place: float, alive: float, row: int, value: float
) -> None:
    """Let what attached at a place join a cohort close by, at the place that is
    their mean; so with another row.
    """
    total = alive + cohort[ALIVE, i]
    part = alive / total
    cohort[PLACE, i] += part * (place - cohort[PLACE, i])
    cohort[row, i] += part * (value - cohort[row, i])
    cohort[ALIVE, i] = total
