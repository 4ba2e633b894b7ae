"""Least squares in logarithms, from several starts, and numbers with the error of a
fit.
"""

import math
from collections.abc import Callable, Sequence
from numbers import Real
from typing import Any, NamedTuple, Self

import numpy as np
from scipy import optimize

from stickslip.errors import UndecidedError
from stickslip.measure.trace import Array
from stickslip.words import prefixed


def _keeping_error(operation: Callable[[Any, Any], tuple[Any, Any]]) -> Any:
    """Return a method of `Estimate` for an operation, a function that returns the value
    and its slope.

    With an exact number, the result is an estimate, whose error is multiplied by the
    absolute slope. With an array, or with another estimate, whose covariance would be
    needed, it is a plain value.
    """

    def method(one: "Estimate", other: Any) -> Any:
        exact = isinstance(other, Real) and not isinstance(other, Estimate)
        plain = float(other) if isinstance(other, Real) else other
        value, slope = operation(float(one), plain)
        return Estimate(value, abs(slope) * one.error) if exact else value

    return method


class Estimate(float):
    """A fitted value with its standard `error`; otherwise it behaves like a float."""

    error: float

    def __new__(cls, value: float, error: float = 0.0) -> Self:
        """Make an estimate of a value and its standard error."""
        one = super().__new__(cls, value)
        one.error = float(error)
        return one

    # higher than that of numpy's numbers, so that ``np.float64(3.0)*e`` uses `__rmul__`
    __array_priority__ = 100.0

    __mul__ = __rmul__ = _keeping_error(lambda x, y: (x * y, y))
    __truediv__ = _keeping_error(lambda x, y: (x / y, 1.0 / y))
    __rtruediv__ = _keeping_error(lambda x, y: (y / x, y / x**2))
    __add__ = __radd__ = _keeping_error(lambda x, y: (x + y, 1.0))
    __sub__ = _keeping_error(lambda x, y: (x - y, 1.0))
    __rsub__ = _keeping_error(lambda x, y: (y - x, 1.0))

    __pow__ = _keeping_error(lambda x, y: (x**y, y * x ** (y - 1.0)))
    __rpow__ = _keeping_error(lambda x, y: (y**x, y**x * np.log(y)))

    def __round__(self, digits: Any = None) -> Any:
        """Return the rounded value, with its error."""
        return Estimate(round(float(self), digits or 0), self.error)

    def _stepped(self, other: object) -> Any:
        """Raise `TypeError`: an integer quotient has no error, as it jumps."""
        raise TypeError(
            f"{self.words()}: an integer quotient by {other!r} has no error; use "
            "float(...) of it"
        )

    __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = _stepped
    __divmod__ = __rdivmod__ = _stepped

    def __neg__(self) -> "Estimate":
        """Return the negative value, with its error."""
        return Estimate(-float(self), self.error)

    def __abs__(self) -> "Estimate":
        """Return the absolute value, with its error."""
        return Estimate(abs(float(self)), self.error)

    def words(self, unit: str = "") -> str:
        """Return value and error in words, such as ``(8.602 ± 0.082) N``: with two
        digits of the error, and the SI prefix of the larger of the two.
        """
        divisor, unit = prefixed(max(abs(self), self.error), unit)
        value = float(self) / divisor
        error = self.error / divisor
        if not error > 0:
            return f"{value:.4g} {unit}".rstrip()
        both = f"{value:.4g} ± {error:.2g}"
        if 1e-7 <= error < 1e6:
            places = max(1 - math.floor(math.log10(error)), 0)
            both = f"{value:.{places}f} ± {error:.{places}f}"
        return f"({both}) {unit}" if unit else both


class LeastSquaresFit(NamedTuple):
    """Result of least squares."""

    value: Array  # of each parameter
    covariance: Array
    rms: float  # of the residuals
    misfit: float  # the rms over the range of the data
    curve: Array  # the model at the data
    converged: bool

    def estimates(self, inflation: float = 1.0) -> list[Estimate]:
        """Return the values with their standard errors, times `inflation`."""
        return [
            *map(Estimate, self.value, inflation * np.sqrt(np.diag(self.covariance)))
        ]


def least_squares(
    model: Callable[[Array], Array],
    data: Array,
    starts: Sequence[Array],
    low: Array,
    high: Array,
    *,
    tolerance: float = 1e-10,
    most: int = 200,
) -> LeastSquaresFit:
    """Return the best of several fits of a model, each from another start; parameters
    whose ranges are positive are fitted by their logarithms.

    The model may return NaN, or raise `UndecidedError`, where it has no result.
    """
    logarithmic = low > 0
    scale = float(np.ptp(data)) or 1.0

    def values(place: Array) -> Array:
        return np.exp(place, where=logarithmic, out=place.copy())

    def places(value: Array) -> Array:
        return np.log(value, where=logarithmic, out=value.copy())

    def residual(place: Array) -> Array:
        try:
            off = np.clip((model(values(place)) - data) / scale, -1e3, 1e3)
            return np.nan_to_num(off, nan=1e3)
        except UndecidedError:
            return np.full(data.size, 1e3)

    least = places(low)
    largest = places(high)
    fits = (
        optimize.least_squares(
            residual,
            np.clip(places(start), least + 1e-9, largest - 1e-9),
            bounds=(least, largest),
            x_scale="jac",
            xtol=tolerance,
            ftol=tolerance,
            max_nfev=most,
        )
        for start in starts
    )
    best = min(fits, key=lambda one: one.cost)
    square = 2.0 * best.cost
    value = values(best.x)
    if square / data.size > 1e4:
        raise UndecidedError(
            "no rate-and-state parameters fit: the slider runs away with all that "
            "were tried"
        )
    # a parameter on which the curve does not depend must get a large error, not 0
    _, singular, turned = np.linalg.svd(np.asarray(best.jac), full_matrices=False)
    turned = (
        turned
        / np.maximum(singular, np.finfo(float).eps * max(singular[0], 1e-100))[:, None]
    )
    turned = turned * np.where(logarithmic, value, 1.0)
    covariance = turned.T @ turned * square / max(data.size - value.size, 1)
    misfit = math.sqrt(square / data.size)
    return LeastSquaresFit(
        value,
        covariance,
        scale * misfit,
        misfit,
        model(value),
        best.status > 0,
    )
