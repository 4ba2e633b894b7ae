"""Pieces of constant speed of a measured displacement; each starts at the time at which
the lines through both sides cross.
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
    SAME_SPEED,
    Array,
    neighbour_correlation,
)
from stickslip.rate_state.fitting import Estimate

# Readings are averaged to at most this many points; a displacement that never has a
# constant speed then takes a second.
_MOST_POINTS = 10_000
# Fewest groups whose median gives the noise: thirty steps, each of which disturbs two
# or three groups, do not change it.
_FEWEST_GROUPS = 256
_FEWEST_POINTS = 3  # fewest points of a line: two always lie on one


class SteadyPiece(NamedTuple):
    """A time interval of constant speed."""

    begin: float  # time
    end: float  # time
    velocity: Estimate
    place: float  # displacement at the beginning
    begin_error: float = 0.0  # error of `begin`, at which lines cross

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
    """A line through the points from `first` to before `end`."""

    first: int
    end: int
    time: float  # mean time
    place: float  # mean displacement
    slope: Estimate

    def at(self, time: float) -> float:
        return float(self.place + self.slope * (time - self.time))


_Run = list[_Line]  # successive lines of one speed


class _Points(NamedTuple):
    """Displacement over time: means of neighbouring readings, and their noise."""

    t: Array
    x: Array
    noise: float

    def edges(self) -> list[int]:
        """Return the edges of the lines with the least sum of squared residuals, plus a
        price for each line: optimal partitioning with pruning (Killick, Fearnhead and
        Eckley 2012).
        """
        t, x, noise = self
        # a false line reduces the sum of squares by this much by chance (chi squared
        # with two degrees of freedom)
        price = 2.0 * noise**2 * math.log(t.size / CHANCE)
        least = np.full(t.size + 1, -price)
        begin = np.zeros(t.size + 1, dtype=int)
        # Sums over the points of a line from each start that is tried, relative to its
        # first point: cumulative sums over all points would lose the digits of a short
        # piece.
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
            # prune the starts that cannot be best for any later end, either
            kept = costs - price <= least[end]
            tried = np.append(tried[kept], min(end, t.size - 1))
            sums = np.append(sums[:, kept], np.zeros((5, 1)), axis=1)
        edges = [t.size]
        turns = bounded("edges of pieces", t.size + 1)
        while next(turns) and edges[-1] > 0:
            edges.append(int(begin[edges[-1]]))
        return edges[::-1]

    def line(self, first: int, end: int) -> _Line:
        """Return the line through the points from `first` to before `end`."""
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
        """Return the slope of one line through all points of a run."""
        return self.line(run[0].first, run[-1].end).slope

    def alike(self, lines: list[_Line]) -> list[_Run]:
        """Return runs of successive lines of the same speed; the lines that differ
        least are joined first.
        """
        runs = [[line] for line in lines]
        turns = bounded("pieces of one speed", len(runs) + 1)
        while next(turns) and len(runs) > 1:
            apart = [_difference(a, b) for a, b in pairwise(map(self.speed, runs))]
            k = int(np.argmin(apart))
            if apart[k] >= math.log1p(SAME_SPEED):
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
        # noise may shift the edge while the lines are within three standard deviations
        apart = ERRORS * noise / abs(steeper) if steeper else 0.0
        beyond = max(first - last, float(t[1] - t[0]) * _FEWEST_POINTS, apart)
        gap = float(before.at(0.0) - after.at(0.0))
        crossing = gap / steeper if steeper else math.nan
        if not last - beyond <= crossing <= first + beyond:
            return Estimate(0.5 * (last + first), beyond)
        # the error of a line at its end is 2/sqrt(n) times the noise of its n points
        parts = [4.0 / (line.end - line.first) for line in (before, after)]
        return Estimate(crossing, noise * math.sqrt(sum(parts)) / abs(steeper))


def find_pieces(time: Array, place: Array) -> tuple[list[SteadyPiece], Array]:
    """Return the pieces of constant speed of a displacement over time, and the
    displacement without its noise.

    The displacement is divided into lines with the least sum of squared residuals, plus
    a price for each line, by which a false line reduces that sum by chance. Neighbours
    whose speeds differ by less than a quarter are one piece, as a drive may fluctuate
    by that much.
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
            # noise shifts the edge of a line by some points, but hardly the crossing
            parts[b[0].first] = float(crossing)
    which = np.searchsorted([*parts.values()], when)
    values = np.array([(line.place, line.slope, line.time) for line in lines], float)
    level, slope, middle = values[which].T
    clean = place[0] + level + slope * (when - middle)
    # correlated residuals are not noise, but motion of the load point
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
    return found, clean + neighbour_correlation(rest) * rest


def _noise(t: Array, x: Array) -> float:
    """Return the standard deviation of independent noise about lines.

    It is the largest of estimates from groups of several sizes, as correlated noise
    gives a larger one in larger groups.
    """
    resolution = np.diff(np.unique(x)).min(initial=math.inf)
    # at least the rounding of sums of squares for exact lines
    found = [1e-5 * float(np.ptp(x))]
    if resolution < math.inf:
        found.append(float(resolution) / math.sqrt(12.0))
    size = 1
    turns = bounded("sizes of groups", HALVINGS)
    while next(turns) and t.size // size >= min(_FEWEST_GROUPS, t.size):
        when = _means(t, size)
        where = _means(x, size)
        # deviation from the line between the neighbours
        late = (when[1:-1] - when[:-2]) / (when[2:] - when[:-2])
        early = 1.0 - late
        off = where[1:-1] - early * where[:-2] - late * where[2:]
        off /= np.sqrt(1.0 + early**2 + late**2)
        scatter = 1.4826 * float(np.median(np.abs(off)))
        found.append(scatter * math.sqrt(size))
        size *= 2
    return max(found)


def _means(values: Array, size: int) -> Array:
    """Return the means of groups of `size` neighbours."""
    count = values.size // size
    mean: Array = values[: count * size].reshape(count, size).mean(axis=1)
    return mean


def _difference(one: Estimate, other: Estimate) -> float:
    """Return the absolute logarithm of the ratio of two speeds: 0 if they do not differ
    significantly, infinite if they differ in sign, or one is 0.
    """
    if abs(one - other) < ERRORS * math.hypot(one.error, other.error):
        return 0.0
    return abs(math.log(one / other)) if one * other > 0.0 else math.inf
