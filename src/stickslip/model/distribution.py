"""Distributions of stretchings: a density, and all that follows from it.

A class of its own gives `Distribution.density`; everything else has a default by
quadrature or root finding, which a class that knows better overrides for speed and
accuracy. `register` gives it the name that rig files use.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import elementwise

from stickslip.arrays import Array, ComplexArray, Nodes, Range
from stickslip.errors import InputError
from stickslip.loops import HALVINGS, bounded
from stickslip.model.records import Number, Part, Record, hashable, registry

Transforms = tuple[ComplexArray, ComplexArray]
"""Means of ``exp(-q x)`` and of ``x exp(-q x)``."""

NEGLIGIBLE = 1e-16
"""Probability below which the tail of a distribution is left out of a table (double
precision of a probability).
"""


class Distribution(Record):
    """A probability distribution on stretchings.

    A new distribution is a frozen dataclass that derives from this class and gives
    `density`, of integral 1; the places where it jumps belong into `knots`, and those
    where it bends make it faster there. The rest follows.
    """

    def density(self, x: ArrayLike) -> Array:
        """Probability density at stretching `x`."""
        raise NotImplementedError

    @property
    def knots(self) -> tuple[float, ...]:
        """Stretchings where the density jumps (a solver may have to look at both
        sides).
        """
        return ()

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        table = table_of(hashable(self))
        low = np.clip(np.asarray(x, dtype=float), table.edges[0], table.edges[-1])
        panel = bin_of(table.edges, low)
        beyond = sums_beyond(np.sum(table.weight * table.x**order, axis=1))
        y, weight = nodes_between(low, table.edges[panel + 1])
        rest = np.sum(weight * _density(self, y) * y**order, axis=-1) / table.total
        # Where a panel is entered at its very beginning, the sum over all of it is the
        # same.
        return np.asarray(rest + beyond[panel + 1])

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability; by default by root finding
        within a panel.
        """
        table = table_of(hashable(self))
        wanted = np.clip(np.asarray(probability, dtype=float), 0.0, table.survival[0])
        panel = bin_of(-table.survival, -wanted)
        low = table.edges[panel]
        high = table.edges[panel + 1]
        # The sums over panels are rounded differently from those within one: pin both
        # ends to the former.
        top = table.survival[panel]
        bottom = table.survival[panel + 1]

        def lacking(
            x: Array,
            p: Array,
            a: Array,
            b: Array,
            s: Array,
            t: Array,
        ) -> Array:
            inside = np.clip(Distribution.partial_moment(self, x, 0), t, s)
            return np.where(x <= a, s, np.where(x >= b, t, inside)) - p

        return elementwise.find_root(
            lacking,
            (low, high),
            args=(wanted, low, high, top, bottom),
        ).x

    def transform(self, q: ComplexArray) -> Transforms:
        """Means of ``exp(-q x)`` and of ``x exp(-q x)`` at complex `q`, ``Re q`` not
        far below 0.

        By default on panels as fine as `q` needs them.
        """
        flat = q.ravel()
        result = np.empty((2, q.size), dtype=complex)
        scale = np.ceil(np.log2(np.maximum(np.abs(flat), 2.0**-20)))
        for power in np.unique(scale).tolist():
            own = np.flatnonzero(scale == power)
            # A bound with few different values: the nodes are kept.
            least = (
                math.floor(4.0 * float(np.min(flat[own].real)) / 2.0**power)
                * 2.0**power
                / 4.0
            )
            result[:, own] = _sums(
                flat[own], *_fine_nodes(hashable(self), power, least)
            )
        mean, slope = result.reshape(2, *q.shape)
        return mean, slope

    def laplace(self, q: ArrayLike) -> ComplexArray:
        """Mean of ``exp(-q x)`` at complex `q`."""
        return self.transform(np.asarray(q, dtype=complex))[0]

    @property
    def leftmost(self) -> float:
        """Abscissa of convergence: `laplace` exists to the right of it.

        By default read off the density: minus infinity where it ends, 0 where it decays
        ever more slowly, else minus the rate at which its tail decays.
        """
        near, far = self.inverse_survival(np.array([1e-8, 1e-13]))
        if float(self.density(2.0 * far + 1.0)) == 0.0:
            return -math.inf
        early, late = (float(self.hazard(x)) for x in (near, far))
        return 0.0 if late < 0.999 * early else -late

    def positive(self) -> "Distribution":
        """Return the distribution conditioned on positive values."""
        above = float(self.survival(0.0))
        if above < 1e-6:
            raise InputError(
                f"{self}: less than one value in a million lies above 0, where "
                "thresholds are; give larger ones"
            )
        return self if above > 1.0 - 1e-15 else Positive(whole=self)

    def survival(self, x: ArrayLike) -> Array:
        """Probability ``J_c(x)`` of a threshold beyond `x`, Eq. (3)."""
        return self.partial_moment(x, 0)

    def hazard(self, x: ArrayLike) -> Array:
        """Breaking rate per unit stretching ``P(x) = P_c(x)/J_c(x)``, Eq. (3);
        infinite beyond the support.
        """
        survival = self.survival(x)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(survival > 0, self.density(x) / survival, np.inf)

    def moment(self, order: int) -> float:
        """Mean of ``x**order``."""
        return float(self.partial_moment(-np.inf, order))

    def standard_deviation(self) -> float:
        """Root mean square distance from the mean."""
        mean = self.moment(1)
        return math.sqrt(max(self.moment(2) - mean * mean, 0.0))

    @property
    def single(self) -> bool:
        """Whether all values are one and the same, to within rounding."""
        return self.standard_deviation() <= 1e-7 * self.moment(1)

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` independent values with the generator handed in."""
        return self.inverse_survival(rng.random(size))

    def sample_beyond(self, rng: np.random.Generator, bound: ArrayLike) -> Array:
        """Draw one value for each entry of `bound`, conditioned on exceeding it."""
        bound = np.asarray(bound, dtype=float)
        uniform = 1.0 - rng.random(bound.shape)
        return np.asarray(
            np.maximum(self.inverse_survival(uniform * self.survival(bound)), bound)
        )

    @property
    def support(self) -> Range:
        """Interval that holds all but a negligible part of the probability on each
        side.
        """
        low, high = self.inverse_survival(np.array([1.0 - NEGLIGIBLE, NEGLIGIBLE]))
        return float(low), float(high)


@dataclass(frozen=True, kw_only=True)
class Positive(Distribution):
    """The positive part of another distribution, or its part beyond the size of a
    stretching, counted from there.
    """

    whole: Annotated[Distribution, Part("a distribution")]
    stretching: Annotated[float, Number(hint="in x_s")] = 0.0

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        y = np.asarray(x, dtype=float) + self.stretching
        begin = abs(self.stretching)
        return np.where(
            y > begin,
            self.whole.density(y) / self.whole.survival(begin),
            0.0,
        )

    @property
    def leftmost(self) -> float:
        """Abscissa of the whole: its tail is the same."""
        return self.whole.leftmost

    @property
    def knots(self) -> tuple[float, ...]:
        """Its beginning, and the jumps above."""
        begin = abs(self.stretching)
        return (
            begin - self.stretching,
            *(knot - self.stretching for knot in self.whole.knots if knot > begin),
        )


DISTRIBUTIONS, register = registry("distribution")
"""The distributions that rig files can name; ``@register("triangular")`` gives a
class its name there.
"""


def check_density(thresholds: Distribution) -> None:
    """Raise `InputError` for thresholds without a density, or so close to each other
    that none resolves them.
    """
    thresholds.density(0.0)
    if thresholds.single:
        raise InputError(
            f"Interface.thresholds = {thresholds}: all thresholds are next to equal, "
            "and no density resolves them; "
            "give them a larger standard deviation, or use the method Contacts"
        )


def excess(distribution: Distribution, x: ArrayLike, order: int) -> Array:
    """Mean of ``max(x_s - x, 0)**order / order!``: the survival function integrated
    `order` times from above.
    """
    x = np.asarray(x, dtype=float)
    total = np.zeros_like(x)
    for power in range(order + 1):
        factor = math.comb(order, power) / math.factorial(order)
        total += (
            factor * (-x) ** (order - power) * distribution.partial_moment(x, power)
        )
    return total


def bin_of(edges: Array, x: Array) -> NDArray[np.intp]:
    """Number of the bin between rising edges that holds each value, or is nearest."""
    return np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)


def sums_beyond(values: Array) -> Array:
    """Sum of all values from each edge between them on: one more than there are."""
    return np.append(np.cumsum(values[::-1])[::-1], 0.0)


_legendre = lru_cache(np.polynomial.legendre.leggauss)


def nodes_between(left: Array, right: Array, count: int = 16) -> Nodes:
    """Nodes and weights of Gauss-Legendre quadrature between pairs of edges, shapes
    (..., count).
    """
    node, weight = _legendre(count)
    half = 0.5 * (right - left)[..., None]
    return left[..., None] + half * (1.0 + node), half * weight


class QuadratureTable(NamedTuple):
    """The density of a distribution on panels on each of which Gauss-Legendre
    quadrature is exact to rounding.
    """

    edges: Array  #: ends of the panels, shape (n + 1,)
    x: Array  #: nodes, shape (n, 16)
    weight: Array  #: weights times density, shape (n, 16); their sum is 1
    survival: Array  #: probability beyond each edge, shape (n + 1,)
    total: float  #: integral of the density as it was given: 1 to within a millionth


# up to the largest stretching there may be
_OCTAVES = np.ldexp(1.0, np.arange(-60, 41))
_FIRST = np.unique(
    np.concatenate(
        [_OCTAVES[:-1, None] * np.linspace(1, 2, 9), [_OCTAVES[-1:].repeat(9)]]
    )
)


# most panels of a table; the narrowest densities take some 4000
_PANELS = 1 << 15
# change of a panel, over its integral, below which one that stalls is rounding: the
# logarithm of a density of relative width 1e-3 is a difference of terms of 1e6
_ROUNDED = 1e-9
# probability that is below rounding on any of the panels
_TAIL = 1e-18


@lru_cache(maxsize=64)
def table_of(distribution: Distribution) -> QuadratureTable:
    """Return the table of a distribution, its panels halved until halving changes
    nothing.

    Raises `InputError` if the density is negative or no number somewhere, or its
    integral is not 1: peaks narrower than a hundredth of their place may be missed
    unless they are among the `knots`.
    """
    knots = np.array([knot for knot in distribution.knots if math.isfinite(knot)])
    edges = np.union1d(np.concatenate([-_FIRST, [0.0], _FIRST]), knots)
    begins = _resolved(distribution, edges[:-1], edges[1:])
    edges = np.append(begins, edges[-1])
    x, weight = nodes_between(edges[:-1], edges[1:])
    weight = weight * _density(distribution, x)
    held = np.flatnonzero(weight.sum(axis=1))
    total = float(weight.sum())
    if not abs(total - 1.0) < 1e-6:
        raise InputError(
            f"{distribution}: the integral of its density is {total:.8g}, must be 1; "
            "normalise it, or give the "
            "places of narrow peaks and jumps as its knots"
        )
    part = slice(held[0], held[-1] + 1)
    weight = weight[part] / total
    survival = sums_beyond(weight.sum(axis=1))
    return QuadratureTable(
        edges[held[0] : held[-1] + 2],
        x[part],
        weight,
        survival,
        total,
    )


def _resolved(distribution: Distribution, left: Array, right: Array) -> Array:
    """Return where the panels begin once these are halved until halving changes
    nothing, or nothing but rounding.

    Where the density is smooth, each halving reduces the change a thousandfold; where
    it bends or jumps, only the panel there is halved again. Where the change is small
    but shrinks no more, it is the rounding of the density itself: halving stops.
    """

    def integral(left: Array, right: Array) -> Array:
        x, weight = nodes_between(left, right)
        return np.asarray(np.sum(weight * _density(distribution, x), axis=1))

    whole = integral(left, right)
    before = np.full_like(whole, np.inf)
    stalled = np.zeros(whole.shape, dtype=int)
    kept: list[Array] = []
    panels = 0
    turns = bounded("QuadratureTable: panels", HALVINGS)
    while left.size:
        next(turns)
        middle = 0.5 * (left + right)
        first = integral(left, middle)
        second = integral(middle, right)
        halves = np.abs(first + second)
        change = np.abs(first + second - whole)
        relative = np.divide(
            change,
            halves,
            out=np.zeros_like(change),
            where=halves > 0,
        )
        stalled = np.where(relative > 0.25 * before, stalled + 1, 0)
        # Relative, so that far tails are right as well.
        coarse = change > 1e-13 * halves + 1e-25
        coarse &= (stalled < 2) | (change > _ROUNDED * halves + _TAIL)
        coarse &= right - left > 1e-15 * np.maximum(np.abs(left), np.abs(right))
        kept.append(left[~coarse])
        panels += kept[-1].size
        if panels + 2 * np.count_nonzero(coarse) > _PANELS:
            _check_noise(distribution, left[coarse], change[coarse])
            kept.append(left[coarse])
            break
        middle = middle[coarse]
        whole = np.r_[first[coarse], second[coarse]]
        before = np.tile(relative[coarse], 2)
        stalled = np.tile(stalled[coarse], 2)
        left = np.r_[left[coarse], middle]
        right = np.r_[middle, right[coarse]]
    return np.sort(np.concatenate(kept))


def _check_noise(distribution: Distribution, left: Array, change: Array) -> None:
    """Raise `InputError` if what halving still changes is not small."""
    if change.sum() < 1e-6:
        return
    place = left[int(np.argmax(change))]
    raise InputError(
        f"{distribution}: {_PANELS} panels do not resolve its density near x = "
        f"{place:.6g}; give one without noise, and the places of jumps as its knots"
    )


def _density(distribution: Distribution, x: Array) -> Array:
    with np.errstate(all="ignore"):
        density = np.asarray(distribution.density(x), dtype=float)
    wrong = ~(np.isfinite(density) & (density >= 0))
    if wrong.any():
        at = np.unravel_index(int(np.argmax(wrong)), wrong.shape)
        raise InputError(
            f"{distribution}: its density is {density[at]:g} at x = {x[at]:g}; it must "
            "be a number of 0 or above, "
            "0 where there are no contacts"
        )
    return density


# phase of ``exp(-q x)`` across a panel: sixteen nodes are then exact to rounding
_TURN = 8.0
_NODES = 1 << 20  # most nodes of a transform
# its width over that of the strip on either side in which an integrand is bounded:
# exp(-2 pi/.17)
TRAPEZOID = 0.17


def _sums(
    q: ComplexArray,
    x: Array | ComplexArray,
    weight: Array | ComplexArray,
) -> ComplexArray:
    """Sums of ``exp(-q x)`` and of ``x exp(-q x)`` over weighted nodes, shape (2,
    q.size).
    """
    found = np.empty((2, q.size), dtype=complex)
    # not a number too far left, as for closed forms
    with np.errstate(over="ignore", invalid="ignore"):
        for part in np.array_split(np.arange(q.size), max(q.size // 128, 1)):
            # no product of matrices: its threads would spin
            each = weight * np.exp(-np.multiply.outer(q[part], x))
            found[:, part] = each.sum(axis=1), (each * x).sum(axis=1)
    return found


@lru_cache(maxsize=64)
def _fine_nodes(
    distribution: Distribution,
    power: float,
    least: float,
) -> Nodes:
    """Nodes and weights for ``|q|`` up to 2 to the `power` and ``Re q >= least``."""
    table = table_of(hashable(distribution))
    with np.errstate(over="ignore", invalid="ignore"):
        part = table.weight.sum(axis=1) * np.exp(
            -least * (table.edges[:-1] - table.edges[0])
        )
    # tails, and panels on which all has decayed, are below rounding
    kept = ~(part <= 1e-20 * part.max())
    left = table.edges[:-1][kept]
    right = table.edges[1:][kept]
    pieces = np.maximum(np.ceil((right - left) * 2.0**power / _TURN), 1.0)
    if pieces.sum() * 16 > _NODES:
        raise InputError(
            f"{distribution}: its transform at |q| of {2.0**power:.3g} takes more than "
            f"{_NODES} nodes; give the "
            "distribution a method transform(q) of its own"
        )
    count = pieces.astype(int)
    step = np.repeat((right - left) / pieces, count)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    x, weight = nodes_between(
        np.repeat(left, count) + number * step,
        np.repeat(left, count) + (number + 1) * step,
    )
    return x.ravel(), (weight * _density(distribution, x) / table.total).ravel()


def transforms_on_a_path(
    q: ComplexArray,
    x: ComplexArray,
    weight: ComplexArray,
) -> Transforms:
    """Transforms of orders 0 and 1 on a path turned off the real axis, for densities
    without a closed form.

    There ``exp(-q x)`` decays instead of oscillating, and the same few hundred nodes do
    for all `q` with ``Im q >= 0``. The trapezoidal rule converges exponentially.
    """
    # The path is turned for Im q > 0; below the real axis the transform is the
    # conjugate of its mirror image.
    below = q.imag < 0
    mean, slope = _sums(np.where(below, np.conj(q), q).ravel(), x, weight).reshape(
        2, *q.shape
    )
    return np.where(below, np.conj(mean), mean), np.where(below, np.conj(slope), slope)
