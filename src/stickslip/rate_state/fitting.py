"""Least squares for rate-and-state parameters: in logarithms, from several starts, with honest errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from stickslip.answers import plain
from stickslip.errors import UndecidedError
from stickslip.model.units import SI, engineering
from stickslip.rate_state.laws import Law, RateAndState, small_step

Array = NDArray[np.float64]

_LEAST = 1e-7
"""Smallest a, b over the largest change of the force: 0, for a logarithm."""


class Estimate(float):
    """A value that was fitted, with its standard error: a number like others, that has `error`."""

    error: float

    def __new__(cls, value: float, error: float = 0.0) -> Estimate:
        """Take a value and its standard error."""
        one = super().__new__(cls, value)
        one.error = float(error)
        return one

    def words(self, unit: str = "") -> str:
        """``(8.602 ± 0.082) N``: to two digits of the error, in one unit; SI units but s get a prefix."""
        value, error = float(self), self.error
        if unit in SI.values() and unit != "s" and value:
            digits, unit = engineering(value, unit, 15).split(" ")
            value, error = float(digits), error * float(digits) / value
        if not error > 0:
            said = f"{value:.4g}"
        else:
            places = max(1 - math.floor(math.log10(error)), 0) if math.isfinite(error) else 0
            brief = places <= 8 and error < 1e6
            said = f"{value:.{places}f} ± {error:.{places}f}" if brief else f"{value:.4g} ± {error:.2g}"
        if not unit:
            return said
        return f"({said}) {unit}" if "±" in said else f"{said} {unit}"

    def scaled(self, factor: float) -> Estimate:
        """In another unit."""
        return Estimate(self * factor, self.error * factor)


def errors(answer: object) -> dict[str, Any]:
    """Standard errors of the estimates of an answer, as plain values by their names."""
    return {f"{name}_error": plain(one.error) for name, one in vars(answer).items() if isinstance(one, Estimate)}


class Fit(NamedTuple):
    """Best values, their covariance, the root of the mean square residual, the curve, and whether it converged."""

    value: Array
    covariance: Array
    rms: float
    curve: Array
    converged: bool

    @property
    def error(self) -> Array:
        """Standard errors."""
        return np.sqrt(np.diag(self.covariance))


def least_squares(
    model: Callable[[Array], Array],
    data: Array,
    starts: Sequence[Array],
    logarithmic: Array,
    lowest: Array,
    highest: Array,
    tolerance: float = 1e-10,
    most: int = 200,
) -> Fit:
    """Fit a model from several starts; errors from the curvature at the best one and the residuals.

    Parameters
    ----------
    model : callable
        Values to a curve as long as `data`; NaN where the model has none.
    data : ndarray
    starts : sequence of ndarray
    logarithmic : ndarray of bool
        Which values are fitted by their logarithms.
    lowest, highest : ndarray
        Bounds of the values.
    tolerance : float
        Relative change of the values and of the sum of squares below which it stops.
    most : int
        Steps after which it stops, too.

    Raises
    ------
    UndecidedError
        If no start leads anywhere.
    """

    def values(place: Array) -> Array:
        return np.where(logarithmic, np.exp(np.where(logarithmic, place, 0.0)), place)

    def places(value: Array) -> Array:
        return np.where(logarithmic, np.log(np.where(logarithmic, value, 1.0)), value)

    scale = float(np.ptp(data)) or 1.0

    def residual(place: Array) -> Array:
        try:
            off = (model(values(place)) - data) / scale
        except UndecidedError:
            return np.full(data.size, 1e3)
        return np.clip(np.nan_to_num(off, nan=1e3, posinf=1e3, neginf=1e3), -1e3, 1e3)

    low, high = places(lowest), places(highest)
    best = None
    for start in starts:
        inside = np.clip(places(start), low + 1e-9, high - 1e-9)
        found = optimize.least_squares(
            residual, inside, bounds=(low, high), x_scale="jac", xtol=tolerance, ftol=tolerance, max_nfev=most
        )
        if best is None or found.cost < best.cost:
            best = found
    if best is None or 2.0 * best.cost / data.size > 1e4:
        raise UndecidedError("no rate-and-state parameters fit: the slider runs away for all that were tried")
    value = values(best.x)
    _, singular, turned = np.linalg.svd(np.asarray(best.jac), full_matrices=False)
    # What the curve does not depend on has an error that is large, not one of 0.
    turned = turned / np.maximum(singular, np.finfo(float).eps * max(singular[0], 1e-100))[:, None]
    by_place = turned.T @ turned * 2.0 * best.cost / max(data.size - value.size, 1)
    slope = np.where(logarithmic, value, 1.0)
    covariance = by_place * np.outer(slope, slope)
    rms = scale * math.sqrt(2.0 * best.cost / data.size)
    return Fit(value, covariance, rms, model(value), best.status > 0)


def fit_step(slip: Array, rise: Array, ratio: float, law: Law, stiffness: float, near: Array) -> tuple[Fit, float]:
    """Fit a, b, D to the force after a step of the velocity by a factor, on a known spring, from values near by.

    Returns
    -------
    (Fit, float)
        Values ``a, b, D``, and the misfit: rms over the range of the force, that before the step included.
    """

    def model(value: Array) -> Array:
        one = RateAndState(law=law, a=value[0], b=value[1], distance=value[2])
        return one.step(slip, ratio, stiffness=stiffness)

    return _fit_abd(model, slip, rise, [near])


def fit_small_step(slip: Array, rise: Array, stiffness: float) -> tuple[Fit, float]:
    """Fit a, b, D to a step response over ``ln`` of the ratio: the same for both laws."""
    direct, reach = float(np.max(np.abs(rise))), float(slip[-1])
    evolution = max(direct - float(rise[-1]), 0.05 * direct)
    starts = [np.array([direct, evolution, part * reach]) for part in (0.02, 0.05, 0.15)]
    return _fit_abd(lambda value: small_step(value[0], value[1], value[2], stiffness, slip), slip, rise, starts)


def _fit_abd(model: Callable[[Array], Array], slip: Array, rise: Array, starts: Sequence[Array]) -> tuple[Fit, float]:
    largest, reach = float(np.max(np.abs(rise))), float(slip[-1])
    lowest = np.array([_LEAST * largest, _LEAST * largest, 1e-4 * reach])
    highest = np.array([1e3 * largest, 1e3 * largest, 10.0 * reach])
    found = least_squares(model, rise, starts, np.ones(3, dtype=bool), lowest, highest)
    return found, found.rms / float(np.ptp(np.append(rise, 0.0)))
