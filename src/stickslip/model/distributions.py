"""The distributions that come with the package, for the thresholds of contacts and for
their initial stretchings.

A threshold is a stretching at which a contact breaks. Of a distribution that extends
below zero only the positive part is used.
"""

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from stickslip.arrays import Array, ComplexArray, Range
from stickslip.errors import InputError, number, numbers, whole
from stickslip.model.distribution import DISTRIBUTIONS as DISTRIBUTIONS
from stickslip.model.distribution import NEGLIGIBLE as NEGLIGIBLE
from stickslip.model.distribution import (
    TRAPEZOID,
    Transforms,
    bin_of,
    sums_beyond,
    transforms_on_a_path,
)
from stickslip.model.distribution import Distribution as Distribution
from stickslip.model.distribution import excess as excess
from stickslip.model.distribution import register as register
from stickslip.model.records import Number, Part

LARGEST_STRETCHING = 1e12  # in ``x_s``: beyond any distribution of contacts


# With this bound the twentieth power of a stretching is still finite.
_BOUNDS: Any = {"at_least": -LARGEST_STRETCHING, "at_most": LARGEST_STRETCHING}
Stretching = Annotated[float, Number(**_BOUNDS, hint="in x_s")]
Width = Annotated[float, Number(at_least=0, at_most=LARGEST_STRETCHING, hint="in x_s")]
Above0 = Annotated[float, Number(above=0, at_most=LARGEST_STRETCHING, hint="in x_s")]


@register("gaussian")
@dataclass(frozen=True)
class Gaussian(Distribution):
    """Gaussian distribution, optionally cut off from below; with a standard deviation
    of 0 all values equal the mean.

    Parameters
    ----------
    mean, std : float
        Centre and standard deviation before the cut, in units of ``x_s``. The paper's
        ``Delta f_s/f_s`` and ``Delta f_0/f_s`` are standard deviations.
    lower : float
        Values at or below it are drawn again.
    """

    mean: Stretching
    std: Width
    _: KW_ONLY
    lower: Annotated[float, Number(infinite=True)] = -math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        if self._beyond_lower() < 1e-6:
            raise InputError(
                f"Gaussian.lower = {self.lower:g}: less than one value in a million "
                "lies above it; "
                f"raise the mean ({self.mean:g}) or the standard deviation "
                f"({self.std:g})"
            )

    def _z(self, x: ArrayLike) -> Array:
        away = np.asarray(x, dtype=float) - self.mean
        return away / self.std if self.std > 0 else np.where(away < 0, -np.inf, np.inf)

    def _beyond_lower(self) -> float:
        return float(special.ndtr(-self._z(self.lower)))

    def density(self, x: ArrayLike) -> Array:
        if self.std == 0:
            raise InputError(
                "Gaussian.std = 0: a distribution with all its values at one point has "
                "no density; "
                "give a standard deviation above 0, or use the method Contacts"
            )
        x = np.asarray(x, dtype=float)
        bell = np.exp(-0.5 * self._z(x) ** 2) / (math.sqrt(2 * math.pi) * self.std)
        return np.where(x >= self.lower, bell / self._beyond_lower(), 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        low = np.maximum(np.asarray(x, dtype=float), self.lower)
        z = self._z(low)
        finite = np.where(np.isfinite(low), low, 0.0)
        edge = self.std * np.exp(-0.5 * z**2) / math.sqrt(2 * math.pi)
        moments = [special.ndtr(-z)]
        for n in range(1, order + 1):
            earlier = (n - 1) * self.std**2 * moments[n - 2] if n > 1 else 0.0
            moments.append(
                self.mean * moments[n - 1] + earlier + finite ** (n - 1) * edge
            )
        return np.asarray(moments[order] / self._beyond_lower())

    def inverse_survival(self, probability: ArrayLike) -> Array:
        tail = np.asarray(probability, dtype=float) * self._beyond_lower()
        return np.asarray(self.mean - self.std * special.ndtri(tail))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        values = rng.normal(self.mean, self.std, size)
        cut = values <= self.lower
        values[cut] = self.inverse_survival(1.0 - rng.random(int(cut.sum())))
        return values

    def transform(self, q: ComplexArray) -> Transforms:
        variance = self.std**2
        if math.isinf(self.lower) or variance == 0:
            mean = np.exp(-q * self.mean + 0.5 * q * q * variance)
            return mean, (self.mean - q * variance) * mean
        # erfcx evaluates exp(large) * erfc(large) as one function, so that neither side
        # of the cut overflows.
        z = (self.lower - self.mean + q * variance) / (self.std * math.sqrt(2))
        at_cut = np.exp(-q * self.lower - 0.5 * float(self._z(self.lower)) ** 2)
        right = z.real >= 0
        part = 0.5 * at_cut * special.erfcx(np.where(right, z, -z))
        left = np.where(right, 0.0, q)
        kept = np.where(
            right,
            part,
            np.exp(-left * self.mean + 0.5 * left * left * variance) - part,
        )
        slope = (self.mean - q * variance) * kept + at_cut / math.sqrt(
            2 * math.pi
        ) * self.std
        return kept / self._beyond_lower(), slope / self._beyond_lower()

    leftmost = -math.inf

    def positive(self) -> Self:
        return replace(self, lower=max(self.lower, 0.0))

    @property
    def knots(self) -> tuple[float, ...]:
        return () if math.isinf(self.lower) else (self.lower,)

    @property
    def support(self) -> Range:
        low = special.ndtri(NEGLIGIBLE / 2)
        high = special.ndtri(NEGLIGIBLE / 2 * self._beyond_lower())
        return max(self.lower, self.mean + low * self.std), self.mean - high * self.std


_Bins = tuple[Array, Array]
"""Rising edges, and the probability between them."""


class _Histogram(Distribution):
    """A distribution whose density is constant within each of several bins."""

    @property
    def _bins(self) -> _Bins:
        """Rising edges, and the probability between them."""
        raise NotImplementedError

    @property
    def std(self) -> float:
        """The standard deviation, which `with_std` sets."""
        return self.standard_deviation()

    def with_std(self, value: float) -> Self:
        """Return the distribution stretched about its mean to another standard
        deviation.
        """
        mean = self.moment(1)
        ratio = value / self.standard_deviation()
        return self._with((mean + ratio * (self._bins[0] - mean)).tolist())

    def _with(self, edges: Sequence[float]) -> Self:
        """Return the distribution with the same weights between other edges."""
        raise NotImplementedError

    def density(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        edges, weights = self._bins
        inside = (x >= edges[0]) & (x <= edges[-1])
        return np.where(inside, (weights / np.diff(edges))[bin_of(edges, x)], 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        edges, weights = self._bins
        heights = weights / np.diff(edges)
        low = np.clip(np.asarray(x, dtype=float), edges[0], edges[-1])
        powers = edges ** (order + 1) / (order + 1)
        beyond = sums_beyond(heights * np.diff(powers))
        bin_ = bin_of(edges, low)
        rest = heights[bin_] * (powers[bin_ + 1] - low ** (order + 1) / (order + 1))
        return np.asarray(rest + beyond[bin_ + 1])

    def inverse_survival(self, probability: ArrayLike) -> Array:
        edges, weights = self._bins
        survival = sums_beyond(weights)
        p = np.asarray(probability, dtype=float)
        return np.asarray(np.interp(p, survival[::-1], edges[::-1]))

    def transform(self, q: ComplexArray) -> Transforms:
        edges, weights = self._bins
        q = q[..., None]
        centre = 0.5 * (edges[1:] + edges[:-1])
        half = 0.5 * np.diff(edges)
        z = np.where(q * half == 0, 1e-30, q * half)
        # exp(-q c) sinh(z)/z and its derivative: modified Bessel functions of orders
        # 1/2 and 3/2, scaled so that they do not overflow.
        scale = weights * np.sqrt(0.5 * np.pi / z) * np.exp(np.abs(z.real) - q * centre)
        even = scale * special.ive(0.5, z)
        odd = scale * special.ive(1.5, z)
        return np.sum(even, axis=-1), np.sum(centre * even - half * odd, axis=-1)

    leftmost = -math.inf

    @property
    def knots(self) -> tuple[float, ...]:
        return tuple(self._bins[0].tolist())

    @property
    def support(self) -> Range:
        return self.knots[0], self.knots[-1]


@register("uniform")
@dataclass(frozen=True)
class Uniform(_Histogram):
    """Rectangular distribution on ``[low, high]``."""

    low: Stretching
    high: Stretching

    def __post_init__(self) -> None:
        super().__post_init__()
        number("Uniform.high", self.high, above=self.low, hint="in x_s")

    @property
    def _bins(self) -> _Bins:
        return np.array([self.low, self.high]), np.ones(1)

    def _with(self, edges: Sequence[float]) -> Self:
        return replace(self, low=edges[0], high=edges[1])


def _above_0(x: ArrayLike) -> Array:
    """Values, with those at 0 or below replaced by the smallest positive number."""
    return np.asarray(np.maximum(np.asarray(x, dtype=float), np.finfo(float).tiny))


_Form = tuple[float, float, float]
"""Scale, shape and power."""


class _PowerOfGamma(Distribution):
    """Values ``scale t**(1/power)``, where `t` has a gamma distribution of the given
    shape and of scale 1.
    """

    @property
    def _form(self) -> _Form:
        """Scale, shape and power."""
        raise NotImplementedError

    def density(self, x: ArrayLike) -> Array:
        scale, shape, power = self._form
        u = np.asarray(x, dtype=float) / scale
        inside = _above_0(u)
        rest = (shape * power - 1.0) * np.log(inside) - special.gammaln(shape)
        return np.where(u >= 0, power / scale * np.exp(rest - inside**power), 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        scale, shape, power = self._form
        with np.errstate(over="ignore"):  # t = inf: no probability is left beyond
            t = (np.maximum(np.asarray(x, dtype=float), 0.0) / scale) ** power
        more = order / power
        return np.asarray(
            scale**order
            * special.poch(shape, more)
            * special.gammaincc(shape + more, t)
        )

    def inverse_survival(self, probability: ArrayLike) -> Array:
        scale, shape, power = self._form
        p = np.asarray(probability, dtype=float)
        t = -np.log(p) if shape == 1 else special.gammainccinv(shape, p)
        return np.asarray(scale * t ** (1.0 / power))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        scale, shape, power = self._form
        return _above_0(scale * rng.standard_gamma(shape, size) ** (1.0 / power))

    def transform(self, q: ComplexArray) -> Transforms:
        scale, shape, power = self._form
        if power == 1:
            base = 1.0 + scale * q
            return base**-shape, scale * shape * base ** (-shape - 1.0)
        turn = 0.7 * min(1.0, power)  # angle of the path to the real axis
        t = np.exp(np.arange(-40.0, 4.8, TRAPEZOID * turn) - 1j * turn)
        weight = t**shape * np.exp(-t)
        return transforms_on_a_path(
            q,
            scale * t ** (1.0 / power),
            weight / weight.sum(),
        )

    @property
    def leftmost(self) -> float:
        scale, _, power = self._form
        return 0.0 if power < 1 else -1.0 / scale if power == 1 else -math.inf

    knots = (0.0,)


@register("exponential")
@dataclass(frozen=True)
class Exponential(_PowerOfGamma):
    """Exponential distribution: the breaking rate does not depend on the stretching."""

    mean: Above0

    @property
    def _form(self) -> _Form:
        return self.mean, 1.0, 1.0


@register("gamma")
@dataclass(frozen=True)
class Gamma(_PowerOfGamma):
    """Gamma distribution with the given mean and standard deviation."""

    mean: Above0
    std: Above0

    @property
    def _form(self) -> _Form:
        return self.std**2 / self.mean, (self.mean / self.std) ** 2, 1.0


@register("lognormal")
@dataclass(frozen=True)
class LogNormal(Distribution):
    """Log-normal distribution with the given mean and standard deviation (of the
    stretching, not of its logarithm).
    """

    mean: Above0
    std: Above0

    @property
    def log_std(self) -> float:
        """Standard deviation of the logarithm."""
        return math.sqrt(math.log1p((self.std / self.mean) ** 2))

    @property
    def log_mean(self) -> float:
        """Mean of the logarithm."""
        return math.log(self.mean) - 0.5 * self.log_std**2

    def _log(self, order: int = 0) -> Gaussian:
        """Distribution of the logarithm, with each value weighted by its power of the
        given order.
        """
        return Gaussian(self.log_mean + order * self.log_std**2, self.log_std)

    def density(self, x: ArrayLike) -> Array:
        above = _above_0(x)
        return self._log().density(np.log(above)) / above

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        # high moments of a wide distribution may overflow
        with np.errstate(over="ignore"):
            all_of_it = np.exp(
                order * self.log_mean + 0.5 * (order * self.log_std) ** 2
            )
        return np.asarray(all_of_it * self._log(order).survival(np.log(_above_0(x))))

    def inverse_survival(self, probability: ArrayLike) -> Array:
        return np.exp(self._log().inverse_survival(probability))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        return rng.lognormal(self.log_mean, self.log_std, size)

    def transform(self, q: ComplexArray) -> Transforms:
        # The path x = exp(log_mean + log_std (z - i turn)) enlarges the density by
        # exp(turn^2/2), at most 90.
        turn = min(3.0, 0.7 / self.log_std)
        z = np.arange(-9.0, 9.0, TRAPEZOID * turn) - 1j * turn
        x = np.exp(self.log_mean + self.log_std * z)
        weight = np.exp(-0.5 * z * z)
        return transforms_on_a_path(q, x, weight / weight.sum())

    leftmost = 0.0


@register("weibull")
@dataclass(frozen=True)
class Weibull(_PowerOfGamma):
    """Weibull distribution, of the weakest of many links:
    ``J_c(x) = exp(-(x/scale)**shape)``.
    """

    scale: Above0
    shape: Annotated[float, Number(at_least=0.1)]

    @property
    def _form(self) -> _Form:
        return self.scale, 1.0, self.shape


@register("empirical")
@dataclass(frozen=True)
class Empirical(_Histogram):
    """A measured distribution: a histogram, its density constant within each bin.

    Parameters
    ----------
    edges : sequence of float, shape (n + 1,)
        Increasing edges of the bins.
    weights : sequence of float, shape (n,)
        Non-negative weights of the bins; stored normalised to a sum of 1.
    """

    edges: tuple[Annotated[float, Number(**_BOUNDS, hint="edges of bins, in x_s")], ...]
    weights: tuple[Annotated[float, Number(at_least=0, hint="weights of bins")], ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        edges = self.edges
        weights = self.weights
        if len(edges) != len(weights) + 1 or len(weights) == 0:
            raise InputError(
                f"Empirical: {len(edges)} edges and {len(weights)} weights: must be "
                "one edge more than weights"
            )
        if any(right <= left for left, right in pairwise(edges)):
            raise InputError("Empirical.edges: must rise from each edge to the next")
        total = math.fsum(weights)
        if total <= 0:
            raise InputError("Empirical.weights: must have a positive sum")
        if abs(total - 1.0) <= 4e-16:
            # Already normalised: keep the weights to the bit, so that a distribution
            # made from these fields compares equal.
            total = 1.0
        object.__setattr__(self, "weights", tuple(w / total for w in weights))

    @classmethod
    def from_samples(cls, samples: ArrayLike, bins: int | None = None) -> Self:
        """Make the histogram of measured values: at least two different finite values,
        else `InputError`.

        The `bins` have equal widths; by default numpy's rule ``"auto"`` sets their
        number.
        """
        values = np.ravel(numbers("Empirical.from_samples", samples))
        if np.ptp(values) == 0:
            raise InputError(
                "Empirical.from_samples: needs at least two different values, all "
                "finite"
            )
        if bins is not None:
            bins = whole(
                "Empirical.from_samples: bins",
                bins,
                at_least=1,
                at_most=10_000_000,
            )
        counts, edges = np.histogram(values, bins="auto" if bins is None else bins)
        return cls(
            edges=tuple(edges.tolist()), weights=tuple(counts.astype(float).tolist())
        )

    @property
    def _bins(self) -> _Bins:
        return np.array(self.edges), np.array(self.weights)

    def _with(self, edges: Sequence[float]) -> Self:
        return replace(self, edges=tuple(edges))


@register("steady state")
@dataclass(frozen=True, kw_only=True)
class SteadyState(Distribution):
    """Stretchings of smooth sliding without delay: ``Q_s(x) = J_c(x)/<x_s>``, the fixed
    point of Eq. (1).

    Used as ``initial=``, with the `thresholds` of the same interface, it starts the
    interface in its final state: the force stays at ``F_k``.
    """

    thresholds: Annotated[
        Distribution, Part("a distribution, such as Gaussian(mean=1.0, std=0.1)")
    ]

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "thresholds", self.thresholds.positive())

    def density(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        return np.where(
            x >= 0,
            self.thresholds.survival(np.maximum(x, 0.0)) / self.thresholds.moment(1),
            0.0,
        )

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        x = np.maximum(np.asarray(x, dtype=float), 0.0)
        distribution = self.thresholds
        n = order + 1
        finite = np.where(np.isfinite(x), x, 0.0)
        beyond = finite**n * distribution.survival(x)
        return np.asarray(
            (distribution.partial_moment(x, n) - beyond) / (n * distribution.moment(1))
        )

    knots = (0.0,)

    @property
    def support(self) -> Range:
        return 0.0, self.thresholds.support[1]
