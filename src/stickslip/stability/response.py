"""What stability asks of the contacts: their linear response, whatever makes it.

A slider in smooth sliding is perturbed a little, ``exp(s t)``; the contacts answer with their dynamic stiffness
``kappa(s)``, per contact, in units of ``k``. Contacts that do not age have it in closed form
(`stickslip.stability.unaged`), those that age by `Langevin` in a table (`stickslip.stability.aged`).
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.stability.impedances import Impedance

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]

SCAN_LIMIT = 1 << 21
"""Largest number of frequencies in a scan."""


class Scan(NamedTuple):
    """Rising angular frequencies, and a quantity that has the zeros of ``Im(Z + kappa)`` between them."""

    omega: Array
    value: Array


class Precision(NamedTuple):
    """How far a response can be trusted, for what is computed from it."""

    step: float
    """Difference of logarithms at which a slope is least in error."""
    settled: float
    """Newton step in logarithms below which another one gains nothing; 0 to go on down to rounding."""
    slack: float
    """Relative distance between a crossing and the change of the count that belongs to it."""


class Response(Protocol):
    """The linear response of the contacts of an interface."""

    @property
    def inert(self) -> bool:
        """Whether ``kappa = 0`` at every `s`."""
        ...

    @property
    def precision(self) -> Precision:
        """How far the response can be trusted."""
        ...

    def stiffness(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)`` on the imaginary axis, many points at once; `velocity` and `s` broadcast."""
        ...

    def exact(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)`` as accurate as may be, off the axis as well; `velocity` and `s` broadcast.

        Raises
        ------
        InputError
            If `s` lies where the response does not exist.
        """
        ...

    def loss(self, body: Impedance, velocity: float | Array, omega: Array) -> Array:
        """Quantity that has the zeros of ``Im(Z + kappa)`` at ``s = i omega``, without its sharp peaks."""
        ...

    def scan(self, body: Impedance, velocity: float, softest: float | None) -> Scan:
        """`loss` along the axis, fine enough to see every zero, up to where there are no more.

        With `softest` given, for every rig with the same losses and masses and a static stiffness of at least that.
        """
        ...

    def count(self, body: Impedance, velocity: float) -> int:
        """Count the roots of ``Z + kappa`` with ``Re s > 0``."""
        ...

    def rightmost(self, body: Impedance, velocity: float) -> complex:
        """Return the root of ``Z + kappa`` with the largest real part, one of a pair."""
        ...

    def roots(self, body: Impedance, velocity: float, starts: ComplexArray) -> ComplexArray:
        """Return roots near those of a neighbouring rig, rightmost first; without any, roots near the axis."""
        ...


def distinct_roots(s: ComplexArray, cycle: float) -> ComplexArray:
    """One of each root and of each conjugate pair, rightmost first."""
    s = np.where(s.imag < 0, np.conj(s), s)
    s = np.where(np.abs(s.imag) < 1e-9 / cycle, s.real + 0j, s)
    distinct: list[complex] = []
    for root in s[np.argsort(-s.real, kind="stable")].tolist():
        if not any(abs(root - other) < 1e-8 * (abs(root) + 1 / cycle) for other in distinct):
            distinct.append(root)
    return np.array(distinct, dtype=complex)
