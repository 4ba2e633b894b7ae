"""The distribution of stretchings in smooth sliding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.model.distribution import Distribution, register
from stickslip.model.records import Part

Array = NDArray[np.float64]


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

    thresholds: Annotated[Distribution, Part("a distribution, such as Gaussian(mean=1.0, std=0.1)")]

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "thresholds", self.thresholds.positive())

    @property
    def _scale(self) -> float:
        return self.thresholds.moment(1)

    def density(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        return np.where(x >= 0, self.thresholds.survival(np.maximum(x, 0.0)) / self._scale, 0.0)

    def partial_moment(self, x: ArrayLike, order: int) -> Array:
        x = np.maximum(np.asarray(x, dtype=float), 0.0)
        distribution, n = self.thresholds, order + 1
        beyond = np.where(np.isfinite(x), np.where(np.isfinite(x), x, 0.0) ** n * distribution.survival(x), 0.0)
        return np.asarray((distribution.partial_moment(x, n) - beyond) / (n * self._scale))

    @property
    def leftmost(self) -> float:
        return self.thresholds.leftmost

    knots = (0.0,)

    @property
    def support(self) -> tuple[float, float]:
        return 0.0, self.thresholds.support[1]
