"""The distribution of stretchings in smooth sliding."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, instance
from stickslip.model.distribution import Distribution, register
from stickslip.model.quadrature import laplace_of_nodes, panels

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@register("steady state")
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
        object.__setattr__(self, "thresholds", self.thresholds.positive())

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
                small, laplace_of_nodes(np.where(small, q, 0.0), x, weight * self.density(x), order), result
            )
        return np.asarray(result)

    @property
    def leftmost(self) -> float:
        """That of the thresholds: the tails are alike."""
        return self.thresholds.leftmost

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


@lru_cache(maxsize=16)
def _steady_table(distribution: SteadyState) -> tuple[Array, Array]:
    grid = np.linspace(0.0, distribution.thresholds.support[1], 4001)
    return grid, distribution.survival(grid)
