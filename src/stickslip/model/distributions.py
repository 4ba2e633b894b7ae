"""Distributions for the thresholds of contacts and for their initial stretchings.

Every distribution answers the same few questions (`Distribution`), so that every solver takes every distribution. A
threshold is a stretching at which a contact breaks, hence positive: a distribution that reaches below zero is
conditioned on positive values by `positive` when it is used for thresholds, and taken as it is when it is used for
initial stretchings.

Natural units: stretchings in units of ``x_s = f_s/k``.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Protocol, Self, cast, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from stickslip.errors import InputError, instance, number, numbers, sequence, whole

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

NEGLIGIBLE = 1e-16
"""Probability below which the tail of a distribution is left out of a table (double precision of a probability)."""

LARGEST_STRETCHING = 1e12
"""In ``x_s``: beyond any distribution of contacts."""


def _stretching(place: str, value: object, *, above: float | None = None, at_least: float | None = None) -> float:
    """Check a stretching; the twentieth power of the largest is still a number."""
    if above is None and at_least is None:
        at_least = -LARGEST_STRETCHING
    return number(place, value, above=above, at_least=at_least, at_most=LARGEST_STRETCHING, hint="in x_s")


@runtime_checkable
class Distribution(Protocol):
    """A probability distribution on stretchings.

    A new distribution gives `density`, `partial_moment`, `inverse_survival`, `laplace` and `positive`; the rest
    follows.
    """

    def density(self, x: ArrayLike) -> Array:
        """Probability density at stretching `x`."""
        ...

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        ...

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        ...

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)`` at complex `q`: minus the slope of the transform for order 1."""
        ...

    def positive(self) -> Distribution:
        """Return the distribution conditioned on positive values."""
        ...

    @property
    def knots(self) -> tuple[float, ...]:
        """Stretchings where the density jumps (a solver may have to look at both sides)."""
        return ()

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


def excess(distribution: Distribution, x: ArrayLike, order: int) -> Array:
    """Mean of ``max(x_s - x, 0)**order / order!``: the survival function integrated `order` times from above."""
    x = np.asarray(x, dtype=float)
    total = np.zeros_like(x)
    for power in range(order + 1):
        factor = math.comb(order, power) / math.factorial(order)
        total += factor * (-x) ** (order - power) * distribution.partial_moment(x, power)
    return total


def one_valued(distribution: Distribution) -> bool:
    """Whether thresholds are too close to each other for anything to be computed from their density."""
    return distribution.standard_deviation() <= 1e-7 * distribution.moment(1)


@dataclass(frozen=True, kw_only=True)
class Gaussian(Distribution):
    """Gaussian distribution, optionally cut off from below; a standard deviation of zero puts all stretchings at the mean.

    Parameters
    ----------
    mean, std : float
        Centre and standard deviation before the cut, in units of ``x_s``. The paper's ``Delta f_s/f_s`` and
        ``Delta f_0/f_s`` are standard deviations.
    lower : float
        Values at or below it are drawn again.
    """

    mean: float
    std: float
    lower: float = -math.inf

    def __post_init__(self) -> None:
        _set(self, "mean", _stretching("Gaussian.mean", self.mean))
        _set(self, "std", _stretching("Gaussian.std", self.std, at_least=0))
        _set(self, "lower", number("Gaussian.lower", self.lower, infinite=True))
        if self._beyond_lower() < 1e-6:
            raise InputError(
                f"Gaussian.lower = {self.lower:g}: less than one value in a million lies above it; "
                f"raise the mean ({self.mean:g}) or the standard deviation ({self.std:g})"
            )

    def _z(self, x: ArrayLike) -> Array:
        return (np.asarray(x, dtype=float) - self.mean) / self.std

    def _beyond_lower(self) -> float:
        if self.std == 0:
            return float(self.mean > self.lower)
        return float(special.ndtr(-self._z(self.lower)))

    @property
    def own_std(self) -> float:
        """The parameter ``std``, which `with_std` sets."""
        return self.std

    def with_std(self, value: float) -> Gaussian:
        """Return the distribution with another standard deviation, at the same mean."""
        return replace(self, std=value)

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        if self.std == 0:
            raise InputError(
                "Gaussian.std = 0: a distribution with all its values at one point has no density; "
                "give a standard deviation above 0, or use the method Contacts"
            )
        x = np.asarray(x, dtype=float)
        bell = np.exp(-0.5 * self._z(x) ** 2) / (math.sqrt(2 * math.pi) * self.std)
        return np.where(x >= self.lower, bell / self._beyond_lower(), 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``, by recursion in the order."""
        low = np.maximum(np.asarray(x, dtype=float), self.lower)
        if self.std == 0:
            return np.where(low < self.mean, self.mean**order, 0.0)
        finite = np.where(np.isfinite(low), low, 0.0)
        z = self._z(low)
        edge = self.std * np.exp(-0.5 * z**2) / math.sqrt(2 * math.pi)
        moments = [special.ndtr(-z)]
        for n in range(1, order + 1):
            earlier = (n - 1) * self.std**2 * moments[n - 2] if n > 1 else 0.0
            moments.append(self.mean * moments[n - 1] + earlier + finite ** (n - 1) * edge)
        return np.asarray(moments[order] / self._beyond_lower())

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        tail = np.asarray(probability, dtype=float) * self._beyond_lower()
        return np.asarray(self.mean - self.std * special.ndtri(tail))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` values; those at or below `lower` are drawn again."""
        values = rng.normal(self.mean, self.std, size)
        while (again := np.flatnonzero(values <= self.lower)).size:
            values[again] = rng.normal(self.mean, self.std, again.size)
        return values

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)``, through the scaled error function so that nothing overflows early."""
        q = np.asarray(q, dtype=complex)
        if self.std == 0:
            return np.asarray(self.mean**order * np.exp(-q * self.mean))
        variance = self.std**2
        if math.isinf(self.lower):
            kept = np.exp(-q * self.mean + 0.5 * q * q * variance)
            edge = np.zeros_like(kept)
        else:
            # erfcx keeps exp(large) * erfc(large) together: no overflow on either side of the cut.
            z = (self.lower - self.mean + q * variance) / (self.std * math.sqrt(2))
            at_cut = np.exp(-q * self.lower - 0.5 * float(self._z(self.lower)) ** 2)
            right = z.real >= 0
            part = 0.5 * at_cut * special.erfcx(np.where(right, z, -z))
            left = np.where(right, 0.0, q)
            kept = np.where(right, part, np.exp(-left * self.mean + 0.5 * left * left * variance) - part)
            edge = at_cut / math.sqrt(2 * math.pi) * self.std
        if order == 1:
            kept = (self.mean - q * self.std**2) * kept + edge
        elif order != 0:
            raise InputError(f"laplace(order={order}): only orders 0 and 1 are defined")
        return np.asarray(kept / self._beyond_lower())

    def positive(self) -> Gaussian:
        """Return the distribution cut off at zero."""
        return replace(self, lower=max(self.lower, 0.0))

    @property
    def knots(self) -> tuple[float, ...]:
        """The cut, where there is one, or the single value of a distribution without standard deviation."""
        if self.std == 0:
            return (self.mean,)
        return () if math.isinf(self.lower) else (self.lower,)

    @property
    def support(self) -> tuple[float, float]:
        """Interval that holds all but a negligible part of the probability on each side."""
        low, high = special.ndtri(NEGLIGIBLE / 2), special.ndtri(NEGLIGIBLE / 2 * self._beyond_lower())
        return max(self.lower, self.mean + low * self.std), self.mean - high * self.std


@dataclass(frozen=True, kw_only=True)
class Uniform(Distribution):
    """Rectangular distribution on ``[low, high]``."""

    low: float
    high: float

    def __post_init__(self) -> None:
        _set(self, "low", _stretching("Uniform.low", self.low))
        _set(self, "high", _stretching("Uniform.high", self.high, above=self.low))

    @property
    def own_std(self) -> float:
        """The standard deviation, which `with_std` sets."""
        return self.standard_deviation()

    def with_std(self, value: float) -> Uniform:
        """Return the distribution with another standard deviation, at the same mean."""
        middle = 0.5 * (self.low + self.high)
        return Uniform(low=middle - math.sqrt(3) * value, high=middle + math.sqrt(3) * value)

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        x = np.asarray(x, dtype=float)
        return np.where((x >= self.low) & (x <= self.high), 1.0 / (self.high - self.low), 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        low = np.clip(np.asarray(x, dtype=float), self.low, self.high)
        return np.asarray((self.high ** (order + 1) - low ** (order + 1)) / ((order + 1) * (self.high - self.low)))

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        return np.asarray(self.high - np.asarray(probability, dtype=float) * (self.high - self.low))

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)``."""
        return _laplace_of_bins(q, np.array([self.low, self.high]), np.array([1.0]), order)

    def positive(self) -> Uniform:
        """Return the distribution on the positive part of its interval."""
        if self.high <= 0:
            raise InputError(f"Uniform.high = {self.high:g}: must be above 0 for a distribution of thresholds")
        return replace(self, low=max(self.low, 0.0))

    @property
    def knots(self) -> tuple[float, ...]:
        """The two ends."""
        return (self.low, self.high)

    @property
    def support(self) -> tuple[float, float]:
        """The interval itself."""
        return self.low, self.high


@dataclass(frozen=True, kw_only=True)
class Exponential(Distribution):
    """Exponential distribution: a contact that has no memory of its stretching."""

    mean: float

    def __post_init__(self) -> None:
        _set(self, "mean", _stretching("Exponential.mean", self.mean, above=0))

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        x = np.asarray(x, dtype=float)
        return np.where(x >= 0, np.exp(-np.maximum(x, 0.0) / self.mean) / self.mean, 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        u = np.maximum(np.asarray(x, dtype=float), 0.0) / self.mean
        scale = self.mean**order * math.factorial(order)
        return np.asarray(scale * special.gammaincc(order + 1.0, u))

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        return np.asarray(-self.mean * np.log(np.asarray(probability, dtype=float)))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` values."""
        return rng.exponential(self.mean, size)

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)``."""
        return np.asarray(
            math.factorial(order) * self.mean**order / (1 + self.mean * np.asarray(q, dtype=complex)) ** (order + 1)
        )

    def positive(self) -> Exponential:
        """Return the distribution itself: it is positive."""
        return self

    @property
    def knots(self) -> tuple[float, ...]:
        """Zero, where the density starts."""
        return (0.0,)


@dataclass(frozen=True, kw_only=True)
class Gamma(Distribution):
    """Gamma distribution with the given mean and standard deviation."""

    mean: float
    std: float

    def __post_init__(self) -> None:
        _set(self, "mean", _stretching("Gamma.mean", self.mean, above=0))
        _set(self, "std", _stretching("Gamma.std", self.std, above=0))

    @property
    def shape(self) -> float:
        """Shape parameter ``(mean/standard deviation)**2``."""
        return (self.mean / self.std) ** 2

    @property
    def scale(self) -> float:
        """Scale parameter ``std**2/mean``."""
        return self.std**2 / self.mean

    @property
    def own_std(self) -> float:
        """The parameter ``std``, which `with_std` sets."""
        return self.std

    def with_std(self, value: float) -> Gamma:
        """Return the distribution with another standard deviation, at the same mean."""
        return replace(self, std=value)

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        u = np.asarray(x, dtype=float) / self.scale
        inside = np.maximum(u, np.finfo(float).tiny)
        bell = np.exp((self.shape - 1) * np.log(inside) - inside - special.gammaln(self.shape)) / self.scale
        return np.where(u >= 0, bell, 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        u = np.maximum(np.asarray(x, dtype=float), 0.0) / self.scale
        scale = self.scale**order * float(special.poch(self.shape, order))
        return np.asarray(scale * special.gammaincc(self.shape + order, u))

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        return np.asarray(self.scale * special.gammainccinv(self.shape, np.asarray(probability, dtype=float)))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` values; an underflow to zero is lifted to the smallest number."""
        return np.maximum(rng.gamma(self.shape, self.scale, size), np.finfo(float).tiny)

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)``."""
        factor = self.scale**order * float(special.poch(self.shape, order))
        return np.asarray(factor * (1 + self.scale * np.asarray(q, dtype=complex)) ** (-self.shape - order))

    def positive(self) -> Gamma:
        """Return the distribution itself: it is positive."""
        return self

    @property
    def knots(self) -> tuple[float, ...]:
        """Zero, where the density may start with a jump."""
        return (0.0,)


@dataclass(frozen=True, kw_only=True)
class LogNormal(Distribution):
    """Log-normal distribution with the given mean and standard deviation (of the stretching, not of its logarithm)."""

    mean: float
    std: float

    def __post_init__(self) -> None:
        _set(self, "mean", _stretching("LogNormal.mean", self.mean, above=0))
        _set(self, "std", _stretching("LogNormal.std", self.std, above=0))

    @property
    def log_spread(self) -> float:
        """Standard deviation of the logarithm."""
        return math.sqrt(math.log1p((self.std / self.mean) ** 2))

    @property
    def log_mean(self) -> float:
        """Mean of the logarithm."""
        return math.log(self.mean) - 0.5 * self.log_spread**2

    def _z(self, x: ArrayLike) -> Array:
        logarithm = np.log(np.maximum(np.asarray(x, dtype=float), np.finfo(float).tiny))
        return np.asarray((logarithm - self.log_mean) / self.log_spread)

    @property
    def own_std(self) -> float:
        """The parameter ``std``, which `with_std` sets."""
        return self.std

    def with_std(self, value: float) -> LogNormal:
        """Return the distribution with another standard deviation, at the same mean."""
        return replace(self, std=value)

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        x = np.asarray(x, dtype=float)
        bell = np.exp(-0.5 * self._z(x) ** 2) / (math.sqrt(2 * math.pi) * self.log_spread)
        return np.where(x > 0, bell / np.maximum(x, np.finfo(float).tiny), 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        scale = math.exp(order * self.log_mean + 0.5 * (order * self.log_spread) ** 2)
        x = np.asarray(x, dtype=float)
        return np.where(x > 0, scale * special.ndtr(order * self.log_spread - self._z(x)), scale)

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        z = -special.ndtri(np.asarray(probability, dtype=float))
        return np.asarray(np.exp(self.log_mean + self.log_spread * z))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` values."""
        return rng.lognormal(self.log_mean, self.log_spread, size)

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)``, by quadrature in the logarithm (there is no closed form)."""
        # The phase q x turns fastest where the density is still felt, about five deviations up.
        per_turn = 17 * float(self.inverse_survival(1e-7)) * self.log_spread / 6
        return _laplace_on_a_ray(q, order, self._on_a_ray, 2.0 * self.log_spread, 12, per_turn)

    def _on_a_ray(self, angle: float, count: int, growing: bool) -> tuple[ComplexArray, ComplexArray]:
        del growing  # the transform has no value there
        # Turning x by an angle shifts z by an imaginary number; beyond two standard deviations the density would grow.
        node, weight = panels(-8.5, 8.5, count)
        z = node - 1j * angle / self.log_spread
        x = np.asarray(np.exp(self.log_mean + self.log_spread * z))
        return x, np.asarray(np.log(weight) - 0.5 * z * z - 0.5 * math.log(2 * math.pi))

    def positive(self) -> LogNormal:
        """Return the distribution itself: it is positive."""
        return self


@dataclass(frozen=True, kw_only=True)
class Weibull(Distribution):
    """Weibull distribution: ``J_c(x) = exp(-(x/scale)**shape)``, the weakest link of many."""

    scale: float
    shape: float

    def __post_init__(self) -> None:
        _set(self, "scale", _stretching("Weibull.scale", self.scale, above=0))
        _set(self, "shape", number("Weibull.shape", self.shape, at_least=0.1))

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        u = np.asarray(x, dtype=float) / self.scale
        inside = np.maximum(u, np.finfo(float).tiny)
        bell = self.shape / self.scale * inside ** (self.shape - 1) * np.exp(-(inside**self.shape))
        return np.where(u >= 0, bell, 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        u = (np.maximum(np.asarray(x, dtype=float), 0.0) / self.scale) ** self.shape
        a = 1.0 + order / self.shape
        return np.asarray(self.scale**order * special.gamma(a) * special.gammaincc(a, u))

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        return np.asarray(self.scale * (-np.log(np.asarray(probability, dtype=float))) ** (1 / self.shape))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` values; an underflow to zero is lifted to the smallest number."""
        return np.maximum(self.scale * rng.weibull(self.shape, size), np.finfo(float).tiny)

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)``, by quadrature in the logarithm of the hazard (no closed form)."""
        per_turn = 4 * float(self.inverse_survival(1e-9)) / self.shape
        return _laplace_on_a_ray(q, order, self._on_a_ray, 1.2 / self.shape, 24, per_turn)

    def _on_a_ray(self, angle: float, count: int, growing: bool) -> tuple[ComplexArray, ComplexArray]:
        # Turning x by an angle turns (x/scale)**shape by `shape` times as much, which must stay below a right angle.
        turn = np.exp(-1j * angle * self.shape)
        y, weight = panels(-40.0, 6.6 if growing else 3.7 - math.log(turn.real), count)
        x = np.asarray(self.scale * np.exp(y / self.shape - 1j * angle))
        return x, np.asarray(np.log(weight) + y - 1j * angle * self.shape - np.exp(y) * turn)

    def positive(self) -> Weibull:
        """Return the distribution itself: it is positive."""
        return self

    @property
    def knots(self) -> tuple[float, ...]:
        """Zero, where the density may start with a jump."""
        return (0.0,)


@dataclass(frozen=True, kw_only=True)
class Empirical(Distribution):
    """A measured distribution: a histogram, its density constant within each bin.

    Parameters
    ----------
    edges : sequence of float, shape (n + 1,)
        Rising edges of the bins.
    weights : sequence of float, shape (n,)
        Non-negative weights of the bins; stored normalised to a sum of one.

    See Also
    --------
    Empirical.from_samples : make the histogram from measured values.
    """

    edges: tuple[float, ...]
    weights: tuple[float, ...]

    def __post_init__(self) -> None:
        edges, weights = (
            sequence(f"Empirical.{name}", getattr(self, name), "a list of numbers") for name in ("edges", "weights")
        )
        edges = tuple(_stretching(f"Empirical.edges[{i}]", edge) for i, edge in enumerate(edges))
        weights = tuple(number(f"Empirical.weights[{i}]", weight, at_least=0) for i, weight in enumerate(weights))
        if len(edges) != len(weights) + 1 or len(weights) == 0:
            raise InputError(
                f"Empirical: {len(edges)} edges and {len(weights)} weights: must be one edge more than weights"
            )
        if any(right <= left for left, right in pairwise(edges)):
            raise InputError("Empirical.edges: must rise from each edge to the next")
        total = math.fsum(weights)
        if total <= 0:
            raise InputError("Empirical.weights: must have a positive sum")
        if abs(total - 1.0) <= 4e-16:
            total = 1.0  # normalised already: a distribution made again from its fields is the same distribution
        _set(self, "edges", edges)
        _set(self, "weights", tuple(w / total for w in weights))

    @classmethod
    def from_samples(cls, samples: ArrayLike, bins: int | None = None) -> Self:
        """Make the histogram of measured values.

        Parameters
        ----------
        samples : array_like
            At least two different finite values.
        bins : int, optional
            Number of equal bins; by default numpy's rule ``"auto"``.

        Raises
        ------
        InputError
            If there are fewer than two different values, or one is not finite.
        """
        values = np.ravel(numbers("Empirical.from_samples", samples))
        if np.ptp(values) == 0:
            raise InputError("Empirical.from_samples: needs at least two different values, all finite")
        if bins is not None:
            bins = whole("Empirical.from_samples: bins", bins, at_least=1, at_most=10_000_000)
        counts, edges = np.histogram(values, bins="auto" if bins is None else bins)
        return cls(edges=tuple(edges.tolist()), weights=tuple(counts.astype(float).tolist()))

    @property
    def own_std(self) -> float:
        """The standard deviation, which `with_std` sets."""
        return self.standard_deviation()

    def with_std(self, value: float) -> Empirical:
        """Return the distribution stretched about its mean to another standard deviation."""
        mean, ratio = self.moment(1), value / self.standard_deviation()
        return replace(self, edges=tuple(mean + ratio * (edge - mean) for edge in self.edges))

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        x = np.asarray(x, dtype=float)
        edges, weights = np.array(self.edges), np.array(self.weights)
        bin_ = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, weights.size - 1)
        inside = (x >= edges[0]) & (x <= edges[-1])
        return np.where(inside, (weights / np.diff(edges))[bin_], 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``."""
        edges, weights = np.array(self.edges), np.array(self.weights)
        heights = weights / np.diff(edges)
        low = np.clip(np.asarray(x, dtype=float), edges[0], edges[-1])
        powers = edges ** (order + 1) / (order + 1)
        beyond = np.append(np.cumsum((heights * np.diff(powers))[::-1])[::-1], 0.0)
        bin_ = np.clip(np.searchsorted(edges, low, side="right") - 1, 0, weights.size - 1)
        rest = heights[bin_] * (powers[bin_ + 1] - low ** (order + 1) / (order + 1))
        return np.asarray(rest + beyond[bin_ + 1])

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability."""
        survival = np.append(np.cumsum(np.array(self.weights)[::-1])[::-1], 0.0)
        return np.asarray(np.interp(np.asarray(probability, dtype=float), survival[::-1], np.array(self.edges)[::-1]))

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)``."""
        return _laplace_of_bins(q, np.array(self.edges), np.array(self.weights), order)

    def positive(self) -> Empirical:
        """Return the part of the histogram above zero."""
        if self.edges[0] >= 0:
            return self
        if self.edges[-1] <= 0:
            raise InputError(
                f"Empirical.edges[-1] = {self.edges[-1]:g}: a distribution of thresholds needs values above 0"
            )
        first = int(np.searchsorted(self.edges, 0.0, side="right")) - 1
        left, right = self.edges[first], self.edges[first + 1]
        share = self.weights[first] * right / (right - left)
        return Empirical(edges=(0.0, *self.edges[first + 1 :]), weights=(share, *self.weights[first + 1 :]))

    @property
    def knots(self) -> tuple[float, ...]:
        """All edges."""
        return self.edges

    @property
    def support(self) -> tuple[float, float]:
        """The first and the last edge."""
        return self.edges[0], self.edges[-1]


@dataclass(frozen=True, kw_only=True)
class SteadyState(Distribution):
    """Stretchings of smooth sliding without delay: ``Q_s(x) = J_c(x)/<x_s>``, the fixed point of Eq. (1).

    Used as ``initial=``, it makes the interface start in the state it ends in: the force stays at ``F_k``.

    Parameters
    ----------
    thresholds : Distribution
        The distribution of thresholds of the same interface.
    """

    thresholds: Distribution

    def __post_init__(self) -> None:
        instance(
            "SteadyState.thresholds",
            self.thresholds,
            Distribution,
            "a distribution, such as Gaussian(mean=1.0, std=0.1)",
        )
        _set(self, "thresholds", self.thresholds.positive())

    @property
    def _scale(self) -> float:
        return self.thresholds.moment(1)

    def density(self, x: ArrayLike) -> Array:
        """Probability density at `x`."""
        x = np.asarray(x, dtype=float)
        return np.where(x >= 0, self.thresholds.survival(np.maximum(x, 0.0)) / self._scale, 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        """Integral of ``y**order`` times the density over ``y > x``, by parts."""
        x = np.maximum(np.asarray(x, dtype=float), 0.0)
        distribution, n = self.thresholds, order + 1
        beyond = np.where(np.isfinite(x), np.where(np.isfinite(x), x, 0.0) ** n * distribution.survival(x), 0.0)
        return np.asarray((distribution.partial_moment(x, n) - beyond) / (n * self._scale))

    def inverse_survival(self, probability: ArrayLike) -> Array:
        """Stretching exceeded with the given probability, by Newton steps from a table."""
        wanted = np.asarray(probability, dtype=float)
        grid, survival = _steady_table(self)
        # The survival is convex: from the left, Newton's steps never overshoot.
        place = np.clip(np.searchsorted(-survival, -wanted, side="right") - 1, 0, grid.size - 2)
        x, end = grid[place], grid[place + 1]
        for _ in range(60):
            slope = np.maximum(self.density(x), 1e-300)
            step = np.minimum(np.maximum((self.survival(x) - wanted) / slope, 0.0), end - x)
            x = x + step
            if not np.any(step > 4e-16 * x):
                break
        return np.asarray(x)

    def laplace(self, q: ArrayLike, order: int = 0) -> ComplexArray:
        """Mean of ``x**order * exp(-q x)``: ``(1 - P^(q))/(q <x_s>)``, or by quadrature where that cancels."""
        if order not in (0, 1):
            raise InputError(f"laplace(order={order}): only orders 0 and 1 are defined")
        q = np.asarray(q, dtype=complex)
        high = self.thresholds.support[1]
        small = np.abs(q) * high <= 30.0
        safe = np.where(small, 1.0, q)
        result = (1.0 - self.thresholds.laplace(safe)) / (safe * self._scale)
        if order == 1:
            result = (result - self.thresholds.laplace(safe, 1) / self._scale) / safe
        if np.any(small):
            edges = [0.0, *(knot for knot in self.thresholds.knots if 0.0 < knot < high), high]
            parts = [panels(a, b, 8 + math.ceil(48 * (b - a) / high)) for a, b in pairwise(edges)]
            x, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
            result = np.where(
                small, _laplace_of_nodes(np.where(small, q, 0.0), x, weight * self.density(x), order), result
            )
        return np.asarray(result)

    def positive(self) -> SteadyState:
        """Return the distribution itself: it is positive."""
        return self

    @property
    def knots(self) -> tuple[float, ...]:
        """Zero, where the density starts."""
        return (0.0,)

    @property
    def support(self) -> tuple[float, float]:
        """From zero to the largest threshold."""
        return 0.0, self.thresholds.support[1]


DISTRIBUTIONS: tuple[type[Distribution], ...] = (
    Gaussian,
    Uniform,
    Exponential,
    Gamma,
    LogNormal,
    Weibull,
    Empirical,
    SteadyState,
)


@lru_cache(maxsize=16)
def _steady_table(distribution: SteadyState) -> tuple[Array, Array]:
    grid = np.linspace(0.0, distribution.thresholds.support[1], 4001)
    return grid, distribution.survival(grid)


def _set(record: object, field: str, value: object) -> None:
    object.__setattr__(record, field, value)


@lru_cache(maxsize=64)
def panels(low: float, high: float, count: int) -> tuple[Array, Array]:
    """Nodes and weights of composite Gauss-Legendre quadrature with `count` panels of 16 nodes."""
    node, weight = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(low, high, count + 1)
    half = 0.5 * np.diff(edges)[:, None]
    x = edges[:-1, None] + half * (1 + node)
    return x.ravel(), (half * weight).ravel()


def _laplace_of_nodes(q: ArrayLike, x: Array, weight: Array, order: int) -> ComplexArray:
    q = np.asarray(q, dtype=complex)
    weighted = weight * x**order
    flat = np.array([np.exp(-value * x) @ weighted for value in q.ravel()], dtype=complex)
    return flat.reshape(q.shape)


def _laplace_on_a_ray(
    q: ArrayLike,
    order: int,
    nodes: Callable[[float, int, bool], tuple[ComplexArray, ComplexArray]],
    largest_angle: float,
    fewest: int,
    per_turn: float,
) -> ComplexArray:
    """Transform of an analytic density, on a ray turned towards the direction in which ``exp(-q x)`` decays.

    On the real axis ``exp(-q x)`` turns ever faster with `q`, and so many more nodes would be needed. ``nodes(angle,
    count, growing)`` gives places, and the logarithms of their weights, on `count` panels of the ray ``x exp(-i
    angle)``, further out where ``exp(-q x)`` is `growing`; on the real axis `fewest` panels and `per_turn` for each
    unit of ``|q|`` are enough.
    """
    q = np.asarray(q, dtype=complex)
    result = np.empty(q.size, dtype=complex)
    for i, value in enumerate(q.ravel().tolist()):
        count, angle = fewest + int(per_turn * abs(value)), 0.0
        if count > _MOST and value.real >= 0:
            angle = math.copysign(min(abs(cmath.phase(value)), largest_angle), value.imag)
            count = _MOST
        x, log_weight = nodes(angle, 32 * math.ceil(count / 32), value.real < 0)  # few counts: the panels are kept
        result[i] = np.sum(x**order * np.exp(log_weight - value * x))
    return result.reshape(q.shape)


_MOST = 256  # panels: enough on a ray, whatever q


def _laplace_of_bins(q: ArrayLike, edges: Array, weights: Array, order: int) -> ComplexArray:
    """Transform of a histogram, bin by bin about its middle: ``exp(-q c) sinh(q w)/(q w)`` and its slope."""
    q = np.asarray(q, dtype=complex)[..., None]
    centre, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    z = q * half
    small = np.abs(z) < 1e-2
    safe = np.where(small, 1.0, z)
    # The shift by exp(-q left) keeps sinh of a large argument from overflowing.
    ratio = np.where(small, 0.0, -np.expm1(-2 * safe) / (2 * safe))
    even = np.where(small, (1 + z * z / 6 + z**4 / 120) * np.exp(-z), ratio)
    start = np.exp(-q * (centre - half))
    if order == 0:
        return cast(ComplexArray, np.sum(weights * start * even, axis=-1))
    if order != 1:
        raise InputError(f"laplace(order={order}): only orders 0 and 1 are defined")
    cosh = 0.5 * (1 + np.exp(-2 * safe))
    odd = np.where(small, (z / 3 + z**3 / 30) * np.exp(-z), (cosh - even) / safe)
    return cast(ComplexArray, np.sum(weights * start * (centre * even - half * odd), axis=-1))
