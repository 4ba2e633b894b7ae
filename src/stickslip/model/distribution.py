"""What a distribution of stretchings is: a density, and what follows from it.

A class of its own gives `Distribution.density`; everything else has a default by quadrature or root finding, which a
class that knows better overrides for speed and accuracy. `register` gives it the name that rig files use.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, ComplexArray
from stickslip.errors import InputError
from stickslip.model.quadrature import inverse_survival_of, partial_moment_of, transforms_of
from stickslip.model.records import Record
from stickslip.model.registry import registry

NEGLIGIBLE = 1e-16
"""Probability below which the tail of a distribution is left out of a table (double precision of a probability)."""


class Distribution(Record):
    """A probability distribution on stretchings.

    A new distribution is a frozen dataclass that derives from this class and gives `density`, of integral 1; the places
    where it jumps belong into `knots`, and those where it bends make it faster there. The rest follows.
    """

    def density(self, x: ArrayLike) -> Array:
        """Probability density at stretching `x`."""
        raise NotImplementedError

    @property
    def knots(self) -> tuple[float, ...]:
        """Stretchings where the density jumps (a solver may have to look at both sides)."""
        return ()

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        return partial_moment_of(self, x, order)

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        return inverse_survival_of(self, probability)

    def transform(self, q: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Means of ``exp(-q x)`` and of ``x exp(-q x)`` at complex `q`, ``Re q`` not far below 0."""
        return transforms_of(self, q)

    def laplace(self, q: ArrayLike) -> ComplexArray:
        """Mean of ``exp(-q x)`` at complex `q`."""
        return np.asarray(self.transform(np.asarray(q, dtype=complex))[0])

    @property
    def leftmost(self) -> float:
        """Abscissa of convergence: `laplace` exists to the right of it.

        By default told from the density: minus infinity where it ends, 0 where it decays ever more slowly, else minus
        the rate at which its tail decays.
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
                f"{self}: less than one value in a million lies above 0, where thresholds are; give larger ones"
            )
        return self if above > 1.0 - 1e-15 else Positive(whole=self)

    def survival(self, x: ArrayLike) -> Array:
        """Probability ``J_c(x)`` of a threshold beyond `x`, Eq. (3)."""
        return self.partial_moment(x, 0)

    def hazard(self, x: ArrayLike) -> Array:
        """Breaking rate per unit stretching ``P(x) = P_c(x)/J_c(x)``, Eq. (3); infinite beyond the support."""
        density, survival = self.density(x), self.survival(x)
        unbounded = np.full_like(density, np.inf)
        return np.asarray(np.divide(density, survival, out=unbounded, where=survival > 0), dtype=float)

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
        return np.asarray(np.maximum(self.inverse_survival(uniform * self.survival(bound)), bound))

    @property
    def support(self) -> tuple[float, float]:
        """Interval that holds all but a negligible part of the probability on each side."""
        low, high = self.inverse_survival(np.array([1.0 - NEGLIGIBLE, NEGLIGIBLE]))
        return float(low), float(high)


@dataclass(frozen=True, kw_only=True)
class Positive(Distribution):
    """The positive part of another distribution, or its part beyond the size of a stretching, counted from there."""

    whole: Distribution
    stretching: float = 0.0

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        y, begin = np.asarray(x, dtype=float) + self.stretching, abs(self.stretching)
        return np.where(y > begin, self.whole.density(y) / self.whole.survival(begin), 0.0)

    @property
    def leftmost(self) -> float:
        """That of the whole: its tail is the same."""
        return self.whole.leftmost

    @property
    def knots(self) -> tuple[float, ...]:
        """Where it begins, and what jumps there are above."""
        begin = abs(self.stretching)
        return (begin - self.stretching, *(knot - self.stretching for knot in self.whole.knots if knot > begin))


DISTRIBUTIONS, register = registry("distribution")
"""The distributions that rig files can name; ``@register("triangular")`` gives a class its name there."""


def check_density(thresholds: Distribution) -> None:
    """Raise `InputError` for thresholds without a density, or so close to each other that none resolves them."""
    thresholds.density(0.0)
    if thresholds.single:
        raise InputError(
            f"Interface.thresholds = {thresholds}: all thresholds are next to equal, and no density resolves them; "
            "give them a larger standard deviation, or use the method Contacts"
        )


def excess(distribution: Distribution, x: ArrayLike, order: int) -> Array:
    """Mean of ``max(x_s - x, 0)**order / order!``: the survival function integrated `order` times from above."""
    x = np.asarray(x, dtype=float)
    total = np.zeros_like(x)
    for power in range(order + 1):
        factor = math.comb(order, power) / math.factorial(order)
        total += factor * (-x) ** (order - power) * distribution.partial_moment(x, power)
    return total
