"""Steps within a record: times at which the level or the amplitude of a force changes
permanently.
"""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import stdtrit

from stickslip.measure.features import MOST, STEADY, TINY, longest_wait
from stickslip.measure.slips import Slips, weighted_median
from stickslip.measure.trace import (
    CHANCE,
    FEWEST_CYCLES,
    FEWEST_READINGS,
    Array,
    Trace,
)

_MOST_BLOCKS = 64  # blocks of a record, between which steps are looked for
_UNLOADED_TIMES = 5.0  # see `_unloaded_intervals`; a convention
_SMOOTHED = 5  # samples of a running median, which removes noise and single spikes
# fraction of a change that a step makes from two blocks to the next two: else it is a
# drift
AT_ONCE = 0.75
# smallest steps: of the level, one standard deviation; of the amplitude, a factor of 2
LARGE = np.array([1.0, math.log(2.0)])


def segments(trace: Trace, found: Slips) -> list[Trace]:
    """Return the parts of a trace between steps of its level or amplitude, and pauses,
    in order; empty if there are none.
    """
    times = _pauses(trace, found)
    count = min(_MOST_BLOCKS, trace.t.size // FEWEST_READINGS)
    if found.size >= FEWEST_CYCLES:
        usual = weighted_median(found.waits, found.drops[1:] ** 2)
        count = min(count, int(trace.length / usual))
    if count >= 2 * FEWEST_CYCLES and np.ptp(trace.force):
        times += _steps(trace, count)
    return _between(trace, times)


def pulls(trace: Trace) -> list[Trace]:
    """Return the parts of a trace in which the bench is loaded; the trace itself if the
    bench never rests unloaded, or if the parts differ in direction.
    """
    size = np.abs(median_filter(trace.force, _SMOOTHED, mode="nearest"))
    rests = _unloaded_intervals(trace.t, size <= TINY * size.max())
    if not rests:
        return [trace]
    begins = [0, *(end for _, end in rests)]
    ends = [*(begin for begin, _ in rests), size.size]
    parts = []
    for begin, end in zip(begins, ends, strict=True):
        if begin < end < size.size:
            end = _before_unloading(size, begin, end)
        if end - begin >= FEWEST_READINGS:
            last = np.nextafter(trace.t[end - 1], np.inf)
            parts.append(trace.part(trace.t[begin], last))
    signs = {math.copysign(1.0, np.median(part.force)) for part in parts}
    return parts if len(signs) == 1 else [trace]


def _unloaded_intervals(t: Array, near: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the intervals in which the bench is unloaded, as pairs of their first
    sample and the first sample after them.

    A steady climb to the largest force spends the fraction `TINY` of its time near
    zero: a bench that stays there `_UNLOADED_TIMES` times as long is unloaded, both in
    all of the record and beside each pull.
    """
    if near.mean() < _UNLOADED_TIMES * TINY:
        return []
    edges = [0, *(np.flatnonzero(np.diff(near)) + 1).tolist(), near.size]
    runs = [*pairwise(edges)]
    lasts = [t[end - 1] - t[begin] for begin, end in runs]
    found = []
    for i, (begin, end) in enumerate(runs):
        beside = [*lasts[i - 1 : i], *lasts[i + 1 : i + 2]]
        is_long = lasts[i] >= _UNLOADED_TIMES * TINY * max(beside, default=math.inf)
        if near[begin] and is_long and end - begin >= FEWEST_READINGS:
            found.append((begin, end))
    return found


def _before_unloading(size: Array, begin: int, end: int) -> int:
    """Return the sample of a pull from which on it is only unloaded: the first after
    the last force above the median of its second half.
    """
    usual = np.median(size[(begin + end) // 2 : end])
    return begin + int(np.flatnonzero(size[begin:end] >= usual)[-1]) + 1


def parts_between_pauses(trace: Trace, found: Slips) -> list[Trace]:
    """Return the parts of a trace between the pauses of its drops; empty if there is no
    pause.
    """
    return _between(trace, _pauses(trace, found))


def _between(trace: Trace, times: list[float]) -> list[Trace]:
    """Return the parts of a trace between times, without those with few readings."""
    if not times:
        return []
    ends = [-math.inf, *sorted(times), math.inf]
    parts = [trace.part(*pair) for pair in pairwise(ends)]
    return [part for part in parts if part.t.size >= FEWEST_READINGS]


def _steps(trace: Trace, count: int) -> list[float]:
    """Return the times of steps of the level or the amplitude, from `count` blocks of
    the force.
    """
    first = trace.t.size % count
    blocks = trace.force[first:].reshape(count, -1)
    series = _levels_and_amplitudes(blocks)
    edges = _edges(series / _noise(series))
    times = []
    for begin, edge, end in zip(edges, edges[1:], edges[2:], strict=False):
        if not _is_step(series[:, begin:edge], series[:, edge:end]):
            continue
        size = blocks.shape[1]
        start = first + size * (edge - 2)
        at = start + _likeliest(trace.force[start : start + 4 * size])
        times.append(float(trace.t[at]))
    return times


def _levels_and_amplitudes(blocks: Array) -> Array:
    """Return the means of blocks, over their median scatter, and the logarithms of
    their scatter.
    """
    scatter = blocks.std(axis=1)
    scale = np.median(scatter) or scatter.max()
    levels = blocks.mean(axis=1) / scale
    return np.array([levels, np.log(np.maximum(scatter / scale, 1e-6))])


def _noise(series: Array) -> Array:
    """Return the noise of each series, corrected for the correlation of neighbours.

    It comes from medians of differences, which steps do not change. In a series with
    the correlation r, squared differences of next neighbours but one are 1 + r times
    those of neighbours, and means scatter as if the variance were (1 + r)/(1 - r)
    times as large.
    """
    one = np.maximum(_scatter(np.diff(series)), STEADY)
    two = np.maximum(_scatter(series[:, 2:] - series[:, :-2]), STEADY)
    r = np.clip((two / one) ** 2 - 1.0, 0.0, 0.99)
    return np.asarray(one * np.sqrt(0.5 * (1.0 + r)) / (1.0 - r))


def _is_step(before: Array, after: Array) -> bool:
    """Whether one of two series makes a sudden, significant step from one segment to
    the next.

    The error is that of the segments themselves, with Student's t, so that a passing
    peak is no step.
    """
    error = np.hypot(_error(before), _error(after))
    shorter = min(before.shape[1], after.shape[1])
    chance = stdtrit(shorter - 1, 1.0 - CHANCE)
    change = after.mean(axis=1) - before.mean(axis=1)
    near = after[:, :2].mean(axis=1) - before[:, -2:].mean(axis=1)
    is_large = np.abs(change) >= np.maximum(LARGE, chance * error[:, 0])
    at_once = near * change >= AT_ONCE * change**2
    return bool(np.any(is_large & at_once))


def _scatter(series: Array) -> Array:
    """Return the standard deviation about zero of each series, from the median."""
    return 1.4826 * np.median(np.abs(series), axis=1, keepdims=True)


def _error(part: Array) -> Array:
    """Return the standard error of the level of each series."""
    usual = np.median(part, axis=1, keepdims=True)
    return _scatter(part - usual) / math.sqrt(part.shape[1])


def _pauses(trace: Trace, found: Slips) -> list[float]:
    """Return the times at which a series of drops of a measured force ends and at which
    the next begins: where a wait is longer than expected by chance. A series whose last
    drops are less than half of the typical one fades rather than ends.
    """
    waits = found.waits
    if not trace.measured or waits.size < FEWEST_CYCLES:
        return []
    usual = weighted_median(waits, waits)
    full = found.typical(found.drops)
    all_waits = np.diff([trace.t[0], *found.times, trace.t[-1]])
    times = list[float]()
    for i in np.flatnonzero(all_waits > longest_wait(waits)).tolist():
        last = found.drops[max(i - FEWEST_CYCLES, 0) : i]
        if i > 0 and np.median(last) >= MOST * full:
            times.append(trace.t[found.end[i - 1]])
        if i < found.size:
            times.append(found.times[i] - usual)
    return times


def _edges(series: Array) -> list[int]:
    """Return the edges of the segments with the least sum of squared residuals, plus a
    price for each segment (dynamic programming).
    """
    count = series.shape[1]
    padded = np.pad(series, ((0, 0), (1, 0)))
    sums = padded.cumsum(axis=1)
    squares = (padded**2).sum(axis=0).cumsum()
    # A false step reduces the sum of squares of two series of unit variance by this
    # much by chance (chi squared with two degrees of freedom).
    price = 2.0 * math.log(count / CHANCE)
    least = np.full(count + 1, math.inf)
    least[0] = 0.0
    edges = {0: [0]}
    for end in range(FEWEST_CYCLES, count + 1):
        begins = np.arange(end - FEWEST_CYCLES + 1)
        totals = sums[:, [end]] - sums[:, begins]
        explained = (totals**2).sum(axis=0) / (end - begins)
        rest = squares[end] - squares[begins] - explained
        costs = least[begins] + rest + price
        begin = int(np.argmin(costs))
        least[end] = costs[begin]
        edges[end] = [*edges[begin], end]
    return edges[count]


def _likeliest(force: Array) -> int:
    """Return the sample at which mean and scatter of a force most likely change, if
    both sides are normally distributed.
    """
    count = np.arange(2, force.size - 1)
    rest = force - force.mean()
    floor = 1e-12 * (rest**2).sum() + 1e-300
    likely = np.zeros(count.size)
    for direction in (1, -1):
        mean = rest[::direction].cumsum()[1:-2] / count
        square = (rest[::direction] ** 2).cumsum()[1:-2] / count
        variance = np.maximum(square - mean**2, floor)
        likely += (count * np.log(variance))[::direction]
    return int(count[np.argmin(likely)])
