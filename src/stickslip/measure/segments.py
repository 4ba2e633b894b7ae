"""Steps within a record: where the level or the amplitude of a force changes for
good.
"""

import math
from itertools import pairwise

import numpy as np
from scipy.special import stdtrit

from stickslip.loops import bounded
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
    usual = (
        weighted_median(np.diff(found.times), found.drops[1:] ** 2)
        if found.size >= FEWEST_CYCLES
        else 0.0
    )
    count = min(
        _MOST_BLOCKS,
        trace.t.size // FEWEST_READINGS,
        int(np.ptp(trace.t) / (usual or 1e-300)),
    )
    if not np.ptp(trace.force):
        return []
    if count < 2 * FEWEST_CYCLES:
        return _between(trace, _pauses(trace, found))
    blocks = trace.force[trace.t.size % count :].reshape(count, -1)
    firsts = trace.t.size % count + blocks.shape[1] * np.arange(count + 1)
    scatter = blocks.std(axis=1)
    scale = float(np.median(scatter)) or float(scatter.max())
    series = np.array(
        [blocks.mean(axis=1) / scale, np.log(np.maximum(scatter, 1e-6 * scale))]
    )
    # By medians, which steps do not move. Of a series with a memory r, differences of
    # the next but one are larger by 1 + r in squares, and means scatter as if it were
    # larger by (1 + r)/(1 - r).
    one, two = (
        1.4826 * np.median(np.abs(series[:, k:] - series[:, :-k]), axis=1)
        for k in (1, 2)
    )
    r = np.clip((two / np.maximum(one, STEADY)) ** 2 - 1.0, 0.0, 0.99)
    noise = np.maximum(one, STEADY) * np.sqrt(0.5 * (1.0 + r)) / (1.0 - r)
    edges = _edges(series / noise[:, None])
    times = _pauses(trace, found)
    for begin, edge, end in zip(edges, edges[1:], edges[2:], strict=False):
        # By the scatter of either segment, and Student's t: a peak that comes and goes
        # has no level of its own.
        beside = series[:, begin:edge], series[:, edge:end]
        scatters = [
            np.median(np.abs(part - np.median(part, axis=1)[:, None]), axis=1)
            for part in beside
        ]
        errors = [
            1.4826 * each / math.sqrt(part.shape[1])
            for each, part in zip(scatters, beside, strict=True)
        ]
        least = np.maximum(
            LARGE,
            stdtrit(min(edge - begin, end - edge) - 1, 1.0 - CHANCE)
            * np.hypot(*errors),
        )
        change, near = (
            series[:, edge:after].mean(axis=1) - series[:, before:edge].mean(axis=1)
            for before, after in ((begin, end), (edge - 2, edge + 2))
        )
        if np.any((np.abs(change) >= least) & (near * change >= AT_ONCE * change**2)):
            about = slice(firsts[edge - 2], firsts[edge + 2])
            times.append(float(trace.t[about][_step(trace.force[about])]))
    return _between(trace, times)


def _between(trace: Trace, times: list[float]) -> list[Trace]:
    """What lies between times, in turn, as far as it can be judged; none without a
    time.
    """
    if not times:
        return []
    parts = [
        trace.part(*pair) for pair in pairwise([-math.inf, *sorted(times), math.inf])
    ]
    return [part for part in parts if part.t.size >= FEWEST_READINGS]


def _pauses(trace: Trace, found: Slips) -> list[float]:
    """When the drops of a bench end and begin again: where a wait is longer than
    chance makes it.
    """
    waits = np.diff(found.times)
    if not trace.measured or waits.size < FEWEST_CYCLES:
        return []
    longest = longest_wait(waits)
    usual = weighted_median(waits, waits)
    times = list[float]()
    if found.times[0] - trace.t[0] > longest:
        times.append(float(found.times[0]) - usual)
    for i in np.flatnonzero(np.append(waits, trace.t[-1] - found.times[-1]) > longest):
        times.append(float(trace.t[found.end[i]]))
        if i + 1 < found.size:
            times.append(float(found.times[i + 1]) - usual)
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
    least = np.full(count + 1, math.inf)
    came = np.zeros(count + 1, dtype=int)
    least[0] = 0.0
    lasts = np.maximum(np.arange(count + 1)[:, None] - np.arange(count + 1), 1)
    within = (
        squares[:, None]
        - squares
        - ((sums[:, :, None] - sums[:, None, :]) ** 2).sum(axis=0) / lasts
    )
    for end in range(FEWEST_CYCLES, count + 1):
        total = (
            least[: end - FEWEST_CYCLES + 1]
            + within[end, : end - FEWEST_CYCLES + 1]
            + price
        )
        came[end] = int(np.argmin(total))
        least[end] = float(total.min())
    edges = [count]
    turns = bounded("segments", count)
    while edges[0]:
        next(turns)
        edges.insert(0, int(came[edges[0]]))
    return edges


def _step(force: Array) -> int:
    """Sample at which mean and scatter of a force change, by the likelihood of two
    normal distributions.
    """
    count = np.arange(2, force.size - 1)
    rest = force - force.mean()
    likely = np.zeros(count.size)
    floor = 1e-12 * float(rest @ rest) + 1e-300
    for way in (slice(None), slice(None, None, -1)):
        sums = rest[way].cumsum()[1:-2]
        squares = (rest[way] ** 2).cumsum()[1:-2]
        many = count
        likely += (
            many * np.log(np.maximum(squares / many - (sums / many) ** 2, floor))
        )[way]
    return int(count[np.argmin(likely)])
