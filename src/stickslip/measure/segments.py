"""Steps within a record: where the level or the amplitude of a force changes for
good.
"""

import math
from itertools import pairwise

import numpy as np
from scipy.special import stdtrit

from stickslip.measure.features import STEADY, longest_wait
from stickslip.measure.slips import Slips, weighted_median
from stickslip.measure.trace import (
    CHANCE,
    FEWEST_CYCLES,
    FEWEST_READINGS,
    Array,
    Trace,
)

_MOST_BLOCKS = 64
AT_ONCE = 0.75  # of a change comes from two blocks to the next two: else it is a drift
# steps of the level by the scatter about it, of the amplitude by half or twice
LARGE = np.array([1.0, math.log(2.0)])


def segments(trace: Trace, found: Slips) -> list[Trace]:
    """The parts of a trace between steps of its level or amplitude, in turn; none
    where there is no step.
    """
    times = _pauses(trace, found)
    count = min(_MOST_BLOCKS, trace.t.size // FEWEST_READINGS)
    if found.size >= FEWEST_CYCLES:
        usual = weighted_median(np.diff(found.times), found.drops[1:] ** 2)
        count = min(count, int(np.ptp(trace.t) / usual))
    if count >= 2 * FEWEST_CYCLES and np.ptp(trace.force):
        times += _steps(trace, count)
    ends = [-math.inf, *sorted(times), math.inf]
    parts = [trace.part(*pair) for pair in pairwise(ends)] if times else []
    return [part for part in parts if part.t.size >= FEWEST_READINGS]


def _steps(trace: Trace, count: int) -> list[float]:
    """When the level or the amplitude of so many blocks of a force steps."""
    first = trace.t.size % count
    blocks = trace.force[first:].reshape(count, -1)
    scatter = blocks.std(axis=1)
    scale = float(np.median(scatter)) or float(scatter.max())
    scatter = np.maximum(scatter / scale, 1e-6)
    series = np.array([blocks.mean(axis=1) / scale, np.log(scatter)])
    # By medians, which steps do not move. Of a series with a memory r, differences of
    # the next but one are larger by 1 + r in squares, and means scatter as if it were
    # larger by (1 + r)/(1 - r).
    one, two = (
        np.maximum(_scatter(series[:, k:] - series[:, :-k], 0.0), STEADY)
        for k in (1, 2)
    )
    r = np.clip((two / one) ** 2 - 1.0, 0.0, 0.99)
    noise = one * np.sqrt(0.5 * (1.0 + r)) / (1.0 - r)
    edges = _edges(series / noise[:, None])
    times = []
    for begin, edge, end in zip(edges, edges[1:], edges[2:], strict=False):
        before = series[:, begin:edge]
        after = series[:, edge:end]
        # By the scatter of either segment, and Student's t: a peak that comes and goes
        # has no level of its own.
        error = np.hypot(*(_error(part) for part in (before, after)))
        chance = stdtrit(min(edge - begin, end - edge) - 1, 1.0 - CHANCE)
        change = after.mean(axis=1) - before.mean(axis=1)
        near = after[:, :2].mean(axis=1) - before[:, -2:].mean(axis=1)
        steps = np.abs(change) >= np.maximum(LARGE, chance * error)
        at_once = near * change >= AT_ONCE * change**2
        if np.any(steps & at_once):
            begins = first + blocks.shape[1] * (edge - 2)
            about = slice(begins, begins + 4 * blocks.shape[1])
            times.append(float(trace.t[about][_likeliest(trace.force[about])]))
    return times


def _scatter(series: Array, about: Array | float) -> Array:
    """Standard deviation of each series by the median."""
    return np.asarray(1.4826 * np.median(np.abs(series - about), axis=1))


def _error(part: Array) -> Array:
    """Standard error of the level of each series."""
    usual = np.median(part, axis=1, keepdims=True)
    return _scatter(part, usual) / math.sqrt(part.shape[1])


def _pauses(trace: Trace, found: Slips) -> list[float]:
    """When the drops of a bench end and begin again: where a wait is longer than
    chance makes it.
    """
    waits = np.diff(found.times)
    if not trace.measured or waits.size < FEWEST_CYCLES:
        return []
    usual = weighted_median(waits, waits)
    ends = trace.t[found.end]
    begins = found.times - usual
    all_waits = np.diff([trace.t[0], *found.times, trace.t[-1]])
    times = list[float]()
    for i in np.flatnonzero(all_waits > longest_wait(waits)).tolist():
        times += [*ends[max(i - 1, 0) : i], *begins[i : i + 1]]
    return times


def _edges(series: Array) -> list[int]:
    """Where the segments begin that leave least squares, each at a price, and where
    the last one ends.
    """
    count = series.shape[1]
    padded = np.pad(series, ((0, 0), (1, 0)))
    sums = padded.cumsum(axis=1)
    squares = (padded**2).sum(axis=0).cumsum()
    # So much does a step that is none take off two series of unit scatter by chance
    # (chi squared with two degrees).
    price = 2.0 * math.log(count / CHANCE)
    at = np.arange(count + 1)
    lasts = np.maximum(at[:, None] - at, 1)
    means = ((sums[:, :, None] - sums[:, None, :]) ** 2).sum(axis=0) / lasts
    within = squares[:, None] - squares - means + price
    least = np.full(count + 1, math.inf)
    least[0] = 0.0
    edges = {0: [0]}
    for end in range(FEWEST_CYCLES, count + 1):
        starts = slice(0, end - FEWEST_CYCLES + 1)
        total = least[starts] + within[end, starts]
        begin = int(np.argmin(total))
        least[end] = total[begin]
        edges[end] = [*edges[begin], end]
    return edges[count]


def _likeliest(force: Array) -> int:
    """Sample at which mean and scatter of a force change, by the likelihood of two
    normal distributions.
    """
    count = np.arange(2, force.size - 1)
    rest = force - force.mean()
    floor = 1e-12 * float((rest**2).sum()) + 1e-300
    likely = np.zeros(count.size)
    for way in (1, -1):
        mean = rest[::way].cumsum()[1:-2] / count
        square = (rest[::way] ** 2).cumsum()[1:-2] / count
        variance = np.maximum(square - mean**2, floor)
        likely += (count * np.log(variance))[::way]
    return int(count[np.argmin(likely)])
