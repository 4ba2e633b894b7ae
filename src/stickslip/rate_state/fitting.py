"""Least squares for rate-and-state parameters: in logarithms, from several starts, with honest errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from stickslip.errors import UndecidedError
from stickslip.rate_state.laws import Law, RateAndState, small_step

Array = NDArray[np.float64]

_LEAST = 1e-7
"""Smallest a, b over the largest change of the force: 0, for a logarithm."""


class Fit(NamedTuple):
    """Best values, their standard errors, the root of the mean square residual, and the curve."""

    value: Array
    error: Array
    rms: float
    curve: Array


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
    freedom = max(data.size - value.size, 1)
    _, singular, turned = np.linalg.svd(np.asarray(best.jac), full_matrices=False)
    kept = singular > 1e-12 * singular[0]
    deviation = np.sqrt(np.sum((turned[kept] / singular[kept, None]) ** 2, axis=0) * 2.0 * best.cost / freedom)
    error = np.where(logarithmic, value * deviation, deviation)
    return Fit(value, error, scale * math.sqrt(2.0 * best.cost / data.size), model(value))


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
