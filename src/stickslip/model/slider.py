"""The rigid slider on its driving spring."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stickslip.errors import number


@dataclass(frozen=True, kw_only=True)
class Slider:
    """The slider and its driving spring, Eq. (11), per contact.

    Parameters
    ----------
    stiffness : float
        Stiffness of the driving spring ``K/N`` in units of ``k``.
    mass : float
        ``M/N`` in units of ``f_s * time**2 / x_s``. Zero is the massless limit: theory of stability only.
    damping : float
        ``eta`` in 1/time.
    """

    stiffness: float
    mass: float
    damping: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "stiffness", number("Slider.stiffness", self.stiffness, above=0, hint="K/N"))
        object.__setattr__(self, "mass", number("Slider.mass", self.mass, at_least=0, hint="M/N"))
        object.__setattr__(self, "damping", number("Slider.damping", self.damping, at_least=0, hint="eta"))

    @property
    def frequency(self) -> float:
        """Angular frequency ``Omega = sqrt(K/M)`` of the slider on its spring alone; infinite without mass."""
        return math.sqrt(self.stiffness / self.mass) if self.mass > 0 else math.inf
