"""The rigid slider on its driving spring."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.model.records import Number, Record


@dataclass(frozen=True, kw_only=True)
class Slider(Record):
    """The slider and its driving spring, Eq. (11), per contact.

    As a function it is their mechanical impedance ``Z(s) = M s^2 + M eta s + K``, force over displacement.

    Parameters
    ----------
    stiffness : float
        Stiffness of the driving spring ``K/N`` in units of ``k``.
    mass : float
        ``M/N`` in units of ``f_s * time**2 / x_s``. Zero is the massless limit: theory of stability only.
    damping : float
        ``eta`` in 1/time.
    """

    stiffness: Annotated[float, Number("k", above=0, hint="K/N")]
    mass: Annotated[float, Number("f_s time^2/x_s", at_least=0, hint="M/N")]
    damping: Annotated[float, Number("1/time", at_least=0, hint="eta")]

    def __call__(self, s: NDArray[Any], /) -> NDArray[Any]:
        """Force over displacement for motion as ``exp(s t)``, at each `s` in 1/time."""
        return np.asarray(self.stiffness + self.mass * s * (s + self.damping), dtype=complex)

    @property
    def frequency(self) -> float:
        """Angular frequency ``Omega = sqrt(K/M)`` of the slider on its spring alone; infinite without mass."""
        return math.sqrt(self.stiffness / self.mass) if self.mass > 0 else math.inf

    @property
    def damping_ratio(self) -> float:
        """Damping ratio ``zeta = eta/(2 Omega)`` of the slider on its spring alone; zero without mass."""
        return 0.5 * self.damping / self.frequency
