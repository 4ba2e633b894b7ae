"""Pieces of constant speed of a measured displacement, and when each begins: where
lines through both sides cross.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from stickslip.measure.trace import CHANCE, CONSTANT_DRIVE, ERRORS, RESTS, Array
from stickslip.rate_state.fitting import Estimate

# Means of neighbouring readings that are searched, at most: one that is never still
# takes a second for as many.
_MOST_POINTS = 10_000
# Groups in which the noise is judged by its median, at least: thirty steps, each of
# which disturbs two or three of them, do not move it.
_FEWEST_GROUPS = 256
_FEWEST_POINTS = 3  # a line goes through two, whatever they are


class Piece(NamedTuple):
    """A stretch of time at a constant speed."""

    begin: float  # times
    end: float
    velocity: Estimate
    place: float  # displacement at its begin
    begin_error: float = 0.0  # of the time at which lines cross

    @property
    def is_rest(self) -> bool:
        """Whether the load point rests."""
        return self.velocity == 0.0

    def steps_to(self, later: "Piece") -> bool:
        """Whether the velocity steps from this piece to a later one: both move, in
        the same direction.
        """
        return bool(self.velocity * later.velocity > 0.0)


class _Line(NamedTuple):
    """Line through the points of a stretch, from one to before another."""

    first: int
    end: int
    time: float  # mean
    place: float
    slope: Estimate
    error: float  # of its mean

    def at(self, time: Array | float) -> Array:
        return np.asarray(self.place + self.slope * (np.asarray(time) - self.time))


def find_pieces(time: Array, place: Array) -> tuple[list[Piece], Array]:
    """Find the pieces of constant speed of a displacement over time, and the
    displacement without its noise.

    The displacement is cut into lines that leave least squares, each at the price of
    what chance would take off. Neighbours whose speeds differ by less than a quarter
    are one piece: so much a drive fluctuates by itself.
    """
    size = -(-time.size // _MOST_POINTS)
    count = time.size // size
    t, x = (
        values[: count * size].reshape(count, size).mean(axis=1)
        for values in (time - time[0], place - place[0])
    )
    single, noise = _noise(t, x)
    lines = [
        _line(t, x, first, end, noise) for first, end in pairwise(_edges(t, x, noise))
    ]
    clean = np.concatenate([line.at(t[line.first : line.end]) for line in lines])
    long = [line for line in lines if line.end - line.first >= _FEWEST_POINTS]
    runs = _alike(t, x, [[line] for line in long], noise)
    crossings = [_crossing(a[-1], b[0], t, noise) for a, b in pairwise(runs)]
    for crossing, (a, b) in zip(crossings, pairwise(runs), strict=True):
        if a[-1].end == b[0].first:
            # Noise shifts where the lines part by some points, not where they cross.
            part = slice(a[-1].first, b[0].end)
            early = t[part] < float(crossing)
            clean[part] = np.where(early, a[-1].at(t[part]), b[0].at(t[part]))
    # What the noise of single readings does not explain, the load point did.
    rest = x - clean
    moved = max(1.0 - single**2 / max(float(rest.var()), 1e-300), 0.0)
    clean += moved * rest
    smooth = place[0] + np.interp(time - time[0], t, clean)
    if not runs:
        return [], smooth
    begins = [Estimate(0.0), *crossings]
    ends = [*map(float, crossings), float(t[-1])]
    found = list[Piece]()
    for begin, end, run in zip(begins, ends, runs, strict=True):
        velocity = _joined(t, x, run, noise).slope
        fastest = max((abs(one.velocity) for one in found[-1:]), default=0.0)
        if abs(velocity) < max(ERRORS * velocity.error, CONSTANT_DRIVE * fastest):
            velocity = Estimate(0.0, velocity.error)
        found.append(
            Piece(
                begin=float(time[0]) + float(begin),
                end=float(time[0] + end),
                velocity=velocity,
                place=float(place[0] + run[0].at(float(begin))),
                begin_error=begin.error,
            )
        )
    return found, smooth


def _noise(t: Array, x: Array) -> tuple[float, float]:
    """Standard deviations of the displacement about lines, as independent points would
    scatter: by single points, and the largest of groups of several sizes, since what
    has a memory scatters more in larger ones.
    """
    steps = np.abs(np.diff(x))
    resolution = float(np.min(steps, where=steps > 0, initial=math.inf))
    # What sums of squares leave of exact lines, and of rounding.
    found = 1e-5 * float(np.ptp(x))
    if math.isfinite(resolution):
        found = max(found, resolution / math.sqrt(12.0))
    single = found
    size = 1
    while t.size // size >= min(_FEWEST_GROUPS, t.size):
        count = t.size // size
        when, where = (
            values[: count * size].reshape(count, size).mean(axis=1)
            for values in (t, x)
        )
        part = (when[1:-1] - when[:-2]) / (when[2:] - when[:-2])
        off = where[1:-1] - (1.0 - part) * where[:-2] - part * where[2:]
        off /= np.sqrt(1.0 + part**2 + (1.0 - part) ** 2)
        scatter = 1.4826 * float(np.median(np.abs(off))) * math.sqrt(size)
        if size == 1:
            single = max(single, scatter)
        found = max(found, scatter)
        size *= 2
    return single, found


def _edges(t: Array, x: Array, noise: float) -> list[int]:
    """Where the lines begin that leave least squares, each at a price, and where the
    last one ends: optimal partitioning, pruned (Killick, Fearnhead and Eckley 2012).
    """
    sums = np.array([np.ones(t.size), t, x, t * t, t * x, x * x])
    sums = np.pad(sums, ((0, 0), (1, 0))).cumsum(axis=1)
    # A line that is none takes off so much by chance (chi squared with two degrees).
    price = 2.0 * noise**2 * math.log(t.size / CHANCE)
    least = np.full(t.size + 1, -price)
    begin = np.zeros(t.size + 1, dtype=int)
    tried = np.array([0])
    for end in range(1, t.size + 1):
        n, t1, x1, tt, tx, xx = sums[:, end, None] - sums[:, tried]
        spread = np.maximum(tt - t1 * t1 / n, 1e-300)
        rest = xx - x1 * x1 / n - (tx - t1 * x1 / n) ** 2 / spread
        rest = np.where(n < _FEWEST_POINTS, 0.0, np.maximum(rest, 0.0))
        costs = least[tried] + rest + price
        best = int(np.argmin(costs))
        least[end] = costs[best]
        begin[end] = tried[best]
        # What a later end could not take off either is not tried again.
        tried = np.append(tried[costs - price <= least[end]], end)
    edges = [t.size]
    while edges[-1] > 0:
        edges.append(int(begin[edges[-1]]))
    return edges[::-1]


def _line(t: Array, x: Array, first: int, end: int, noise: float) -> _Line:
    when = t[first:end]
    middle = float(when.mean())
    level = float(x[first:end].mean())
    square = float(((when - middle) ** 2).sum())
    slope = float(((when - middle) * (x[first:end] - level)).sum()) / (square or 1.0)
    error = noise / math.sqrt(square) if square > 0 else math.inf
    mean_error = noise / math.sqrt(end - first)
    return _Line(first, end, middle, level, Estimate(slope, error), mean_error)


def _joined(t: Array, x: Array, run: list[_Line], noise: float) -> _Line:
    return _line(t, x, run[0].first, run[-1].end, noise)


def _alike(
    t: Array, x: Array, runs: list[list[_Line]], noise: float
) -> list[list[_Line]]:
    """Join neighbours of the same speed, those that differ least first."""
    while len(runs) > 1:
        slopes = [_joined(t, x, run, noise).slope for run in runs]
        apart = [_difference(a, b) for a, b in pairwise(slopes)]
        k = int(np.argmin(apart))
        if apart[k] >= math.log1p(RESTS):
            break
        runs = [*runs[:k], runs[k] + runs[k + 1], *runs[k + 2 :]]
    return runs


def _difference(one: Estimate, other: Estimate) -> float:
    """Logarithm of the ratio of two speeds; 0 where neither can be told from rest,
    or both from each other.
    """
    if abs(one - other) < ERRORS * math.hypot(one.error, other.error):
        return 0.0
    return abs(math.log(one / other)) if one * other > 0.0 else math.inf


def _crossing(before: _Line, after: _Line, t: Array, noise: float) -> Estimate:
    """When two lines cross, or the middle between them if they cross elsewhere."""
    last = float(t[before.end - 1])
    first = float(t[after.first])
    steeper = float(after.slope - before.slope)
    # Until the lines are that far apart, noise may shift where they part.
    apart = ERRORS * noise / abs(steeper) if steeper else 0.0
    beyond = max(first - last, float(t[1] - t[0]) * _FEWEST_POINTS, apart)
    gap = float(before.at(0.0) - after.at(0.0))
    crossing = gap / steeper if steeper else math.nan
    if not last - beyond <= crossing <= first + beyond:
        return Estimate(0.5 * (last + first), beyond)
    errors = [
        error
        for line in (before, after)
        for error in (line.error, line.slope.error * (crossing - line.time))
    ]
    return Estimate(crossing, math.hypot(*errors) / abs(steeper))
