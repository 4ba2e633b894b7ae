"""Distributions of stretchings: a density, and everything that follows from it.

A class gives at least `Distribution.density`; all other methods have a default by
quadrature or root finding, which a class overrides where a closed form is faster or
more accurate. `register` gives it the name that rig files use.
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
"""Tail probability that a table of a distribution leaves out (the double precision of
a probability).
"""


class Distribution(Record):
    """A probability distribution on stretchings.

    A new distribution is a frozen dataclass that derives from this class and gives
    `density`, of integral 1. Its `knots` must hold the places where the density jumps;
    places where it bends may be added for speed. The rest follows.
    """

    def density(self, x: ArrayLike) -> Array:
        """Probability density at stretching `x`."""
        raise NotImplementedError

    @property
    def knots(self) -> tuple[float, ...]:
        """Stretchings where the density jumps; solvers treat both sides apart."""
        return ()

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``, at each `x`."""
        table = table_of(hashable(self))
        low = np.clip(np.asarray(x, dtype=float), table.edges[0], table.edges[-1])
        panel = bin_of(table.edges, low)
        beyond = sums_beyond(np.sum(table.weight * table.x**order, axis=1))
        y, weight = nodes_between(low, table.edges[panel + 1])
        rest = np.sum(weight * _density(self, y) * y**order, axis=-1) / table.total
        # If x is the beginning of a panel, this is the sum over the whole panel to
        # rounding.
        return np.asarray(rest + beyond[panel + 1])

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability; by default found as a root
        within a panel.
        """
        table = table_of(hashable(self))
        wanted = np.clip(np.asarray(probability, dtype=float), 0.0, table.survival[0])
        panel = bin_of(-table.survival, -wanted)
        low = table.edges[panel]
        high = table.edges[panel + 1]
        # The sums over panels are rounded differently from the integral within one:
        # pin both ends of a panel to the former.
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

        By default by quadrature, on panels as fine as `q` requires.
        """
        flat = q.ravel()
        result = np.empty((2, q.size), dtype=complex)
        scale = np.ceil(np.log2(np.maximum(np.abs(flat), 2.0**-20)))
        for power in np.unique(scale).tolist():
            own = np.flatnonzero(scale == power)
            # A lower bound of Re q that takes few different values, so that the cached
            # nodes are used again.
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

        By default estimated from the density: minus infinity if its support is bounded,
        0 if it decays ever more slowly, else minus the decay rate of its tail.
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
        """Whether all values are equal, to within rounding."""
        return self.standard_deviation() <= 1e-7 * self.moment(1)

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` independent values with the given generator."""
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
    """The part of another distribution above 0, or above the size of a stretching.

    With a `stretching` ``x_0``, only values above ``|x_0|`` are kept, and ``x_0`` is
    subtracted from them.
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
        """The lower end, and the jumps above it."""
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
    that no density resolves them.
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
    """Index of the bin between increasing edges that holds each value or is nearest."""
    return np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)


def sums_beyond(values: Array) -> Array:
    """Sum of all values beyond each edge of their bins: one more sum than values."""
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
    """The density of a distribution at Gauss-Legendre nodes, on panels on which the
    quadrature is exact to rounding.
    """

    edges: Array  #: ends of the panels, shape (n + 1,)
    x: Array  #: nodes, shape (n, 16)
    weight: Array  #: weights times density, shape (n, 16); their sum is 1
    survival: Array  #: probability beyond each edge, shape (n + 1,)
    total: float  #: integral of the density as it was given: 1 to within a millionth


# powers of two from well below any distribution up to the largest stretching, 1e12
_OCTAVES = np.ldexp(1.0, np.arange(-60, 41))
_FIRST = np.unique(
    np.concatenate(
        [_OCTAVES[:-1, None] * np.linspace(1, 2, 9), [_OCTAVES[-1:].repeat(9)]]
    )
)


# most panels of a table; the narrowest densities need about 4000
_PANELS = 1 << 15
# relative change below which a panel that stops converging has reached the rounding of
# its density: for a relative width of 1e-3 its logarithm is a difference of terms of
# 1e6
_ROUNDED = 1e-9
# absolute change that counts as rounding on any panel
_TAIL = 1e-18


@lru_cache(maxsize=64)
def table_of(distribution: Distribution) -> QuadratureTable:
    """Return the table of a distribution, its panels halved until the integrals no
    longer change.

    Raises `InputError` if the density is negative or not finite somewhere, or its
    integral is not 1: a peak narrower than a hundredth of its position may be missed
    unless it is among the `knots`.
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
    """Return the left ends of the panels after halving each until its integral changes
    by no more than rounding.

    Where the density is smooth, each halving reduces the change a thousandfold; where
    it bends or jumps, only the panel there is halved again. If the change is small but
    stops decreasing, it is the rounding error of the density itself: halving stops.
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
        # a relative tolerance, so that far tails are accurate as well
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
    """Raise `InputError` if the remaining changes by halving are not small."""
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


# |q| times the width of a panel, up to which sixteen nodes integrate ``exp(-q x)`` to
# rounding
_TURN = 8.0
_NODES = 1 << 20  # most nodes of a transform
# step of the trapezoidal rule over the half-width of the strip in which the integrand
# is analytic and bounded: its error is exp(-2 pi/.17), below rounding
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
    # far to the left of the abscissa the result is infinite, as for closed forms
    with np.errstate(over="ignore", invalid="ignore"):
        for part in np.array_split(np.arange(q.size), max(q.size // 128, 1)):
            # A product of matrices would start BLAS threads, which wait actively.
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
    # tails, and panels where the integrand has decayed, are below rounding
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
    """Transforms of orders 0 and 1 along a path rotated off the real axis, for
    densities without a closed form.

    On this path ``exp(-q x)`` decays instead of oscillating, and the same few hundred
    nodes serve all `q` with ``Im q >= 0``. The trapezoidal rule converges
    exponentially.
    """
    # The path is rotated for Im q > 0; below the real axis the transform is the complex
    # conjugate of that at conj(q).
    below = q.imag < 0
    mean, slope = _sums(np.where(below, np.conj(q), q).ravel(), x, weight).reshape(
        2, *q.shape
    )
    return np.where(below, np.conj(mean), mean), np.where(below, np.conj(slope), slope)
