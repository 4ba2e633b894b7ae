"""Pieces of constant speed of a measured displacement, and when each begins: where
lines through both sides cross.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from stickslip.loops import HALVINGS, bounded
from stickslip.measure.trace import (
    CHANCE,
    CONSTANT_DRIVE,
    ERRORS,
    RESTS,
    Array,
    memory,
)
from stickslip.rate_state.fitting import Estimate

# Means of neighbouring readings that are searched, at most: one that is never still
# takes a second for as many.
_MOST_POINTS = 10_000
# Groups in which the noise is judged by its median, at least: thirty steps, each of
# which disturbs two or three of them, do not move it.
_FEWEST_GROUPS = 256
_FEWEST_POINTS = 3  # a line goes through two, whatever they are


class SteadyPiece(NamedTuple):
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

    def steps_to(self, later: "SteadyPiece") -> bool:
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

    def at(self, time: float) -> float:
        return float(self.place + self.slope * (time - self.time))


_Run = list[_Line]  # of one speed


class _Points(NamedTuple):
    """Displacement over time: means of neighbouring readings, and their noise."""

    t: Array
    x: Array
    noise: float

    def edges(self) -> list[int]:
        """Return the begins of the lines that leave least squares, each at a price, and
        the end of the last one: optimal partitioning, pruned (Killick, Fearnhead and
        Eckley 2012).
        """
        t, x, noise = self
        # A line that is none takes off so much by chance (chi squared with two
        # degrees).
        price = 2.0 * noise**2 * math.log(t.size / CHANCE)
        least = np.full(t.size + 1, -price)
        begin = np.zeros(t.size + 1, dtype=int)
        # Sums over the points from each begin that is tried, about its first one: of
        # all points, they would lose the digits of a short piece.
        tried = np.array([0])
        sums = np.zeros((5, 1))
        for end in range(1, t.size + 1):
            u = t[end - 1] - t[tried]
            w = x[end - 1] - x[tried]
            sums += [u, w, u * u, u * w, w * w]
            u1, w1, uu, uw, ww = sums
            n = end - tried
            spread = np.maximum(uu - u1 * u1 / n, 1e-300)
            along = uw - u1 * w1 / n
            rest = ww - w1 * w1 / n - along**2 / spread
            rest = np.maximum(rest, 0.0)
            rest[n < _FEWEST_POINTS] = 0.0
            costs = least[tried] + rest + price
            best = int(np.argmin(costs))
            least[end] = costs[best]
            begin[end] = tried[best]
            # What a later end could not take off either is not tried again.
            kept = costs - price <= least[end]
            tried = np.append(tried[kept], min(end, t.size - 1))
            sums = np.append(sums[:, kept], np.zeros((5, 1)), axis=1)
        edges = [t.size]
        turns = bounded("edges of pieces", t.size + 1)
        while next(turns) and edges[-1] > 0:
            edges.append(int(begin[edges[-1]]))
        return edges[::-1]

    def line(self, first: int, end: int) -> _Line:
        """Line through some points."""
        when = self.t[first:end]
        where = self.x[first:end]
        middle = float(when.mean())
        level = float(where.mean())
        away = when - middle
        square = float(away @ away)
        slope = Estimate(0.0, math.inf)
        if square > 0.0:
            rise = float(away @ (where - level)) / square
            slope = Estimate(rise, self.noise / math.sqrt(square))
        return _Line(first, end, middle, level, slope)

    def speed(self, run: _Run) -> Estimate:
        """Slope of one line through all points of a run."""
        return self.line(run[0].first, run[-1].end).slope

    def alike(self, lines: list[_Line]) -> list[_Run]:
        """Join neighbours of the same speed, those that differ least first."""
        runs = [[line] for line in lines]
        turns = bounded("pieces of one speed", len(runs) + 1)
        while next(turns) and len(runs) > 1:
            apart = [_difference(a, b) for a, b in pairwise(map(self.speed, runs))]
            k = int(np.argmin(apart))
            if apart[k] >= math.log1p(RESTS):
                break
            runs[k : k + 2] = [runs[k] + runs[k + 1]]
        return runs

    def crossing(self, before: _Line, after: _Line) -> Estimate:
        """Return the time at which two lines cross, or the middle between them if they
        cross elsewhere.
        """
        t, _, noise = self
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
        # The end of a line through n points errs by 2/sqrt(n) of their noise.
        parts = [4.0 / (line.end - line.first) for line in (before, after)]
        return Estimate(crossing, noise * math.sqrt(sum(parts)) / abs(steeper))


def find_pieces(time: Array, place: Array) -> tuple[list[SteadyPiece], Array]:
    """Find the pieces of constant speed of a displacement over time, and the
    displacement without its noise.

    The displacement is cut into lines that leave least squares, each at the price of
    what chance would take off. Neighbours whose speeds differ by less than a quarter
    are one piece: so much a drive fluctuates by itself.
    """
    size = -(-time.size // _MOST_POINTS)
    when = time - time[0]
    t = _means(when, size)
    x = _means(place - place[0], size)
    points = _Points(t, x, _noise(t, x))
    lines = [points.line(*ends) for ends in pairwise(points.edges())]
    parts = {b.first: 0.5 * (t[a.end - 1] + t[b.first]) for a, b in pairwise(lines)}
    runs = points.alike([one for one in lines if one.end - one.first >= _FEWEST_POINTS])
    crossings = [points.crossing(a[-1], b[0]) for a, b in pairwise(runs)]
    for crossing, (a, b) in zip(crossings, pairwise(runs), strict=True):
        if a[-1].end == b[0].first:
            # Noise shifts where the lines part by some points, not where they cross.
            parts[b[0].first] = float(crossing)
    which = np.searchsorted([*parts.values()], when)
    values = np.array([(line.place, line.slope, line.time) for line in lines], float)
    level, slope, middle = values[which].T
    clean = place[0] + level + slope * (when - middle)
    # What is alike from reading to reading is no noise: the load point moved so.
    rest = place - clean
    found = list[SteadyPiece]()
    fastest = 0.0
    ends = [Estimate(0.0), *crossings, Estimate(t[-1])]
    for (begin, end), run in zip(pairwise(ends), runs, strict=False):
        velocity = points.speed(run)
        slowest = max(ERRORS * velocity.error, CONSTANT_DRIVE * fastest)
        fastest = abs(velocity)
        if fastest < slowest:
            velocity = Estimate(0.0, velocity.error)
        piece = SteadyPiece(
            begin=float(time[0] + begin),
            end=float(time[0] + end),
            velocity=velocity,
            place=float(place[0] + run[0].at(begin)),
            begin_error=begin.error,
        )
        found.append(piece)
    return found, clean + memory(rest) * rest


def _noise(t: Array, x: Array) -> float:
    """Standard deviation of the displacement about lines, as if its points were
    independent: the largest from groups of several sizes, as correlated noise scatters
    more in larger groups.
    """
    resolution = np.diff(np.unique(x)).min(initial=math.inf)
    # What sums of squares leave of exact lines, and of rounding.
    found = [1e-5 * float(np.ptp(x))]
    if resolution < math.inf:
        found.append(float(resolution) / math.sqrt(12.0))
    size = 1
    turns = bounded("sizes of groups", HALVINGS)
    while next(turns) and t.size // size >= min(_FEWEST_GROUPS, t.size):
        when = _means(t, size)
        where = _means(x, size)
        # off the line between the neighbours
        late = (when[1:-1] - when[:-2]) / (when[2:] - when[:-2])
        early = 1.0 - late
        off = where[1:-1] - early * where[:-2] - late * where[2:]
        off /= np.sqrt(1.0 + early**2 + late**2)
        scatter = 1.4826 * float(np.median(np.abs(off)))
        found.append(scatter * math.sqrt(size))
        size *= 2
    return max(found)


def _means(values: Array, size: int) -> Array:
    """Means of groups of neighbours."""
    count = values.size // size
    mean: Array = values[: count * size].reshape(count, size).mean(axis=1)
    return mean


def _difference(one: Estimate, other: Estimate) -> float:
    """Logarithm of the ratio of two speeds; 0 where neither differs from rest,
    or both from each other.
    """
    if abs(one - other) < ERRORS * math.hypot(one.error, other.error):
        return 0.0
    return abs(math.log(one / other)) if one * other > 0.0 else math.inf
