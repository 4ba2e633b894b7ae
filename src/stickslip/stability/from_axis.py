"""Roots of ``Z + kappa`` from the imaginary axis: for responses without a bound that would let turns be counted.

Growing modes are counted from the neutral frequencies, and looked for by secants from the dips of ``|Z + kappa|``
along the axis.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import UndecidedError
from stickslip.stability.impedances import Impedance, is_plain, natural_frequencies
from stickslip.stability.neutral import features, neutral_frequencies
from stickslip.stability.response import Array, ComplexArray, Precision, Scan, distinct_roots


class Known(NamedTuple):
    """Kappa at one velocity, whatever the rig: along the imaginary axis and at some points of the real one."""

    omega: Array
    on_axis: ComplexArray
    real: Array
    on_real: ComplexArray


class FromAxis(ABC):
    """A response that is known along the imaginary axis, and can be followed from there.

    A model of contacts gives `stiffness`, `exact`, `frequencies`, `quickest`, and how accurate they are.
    """

    inert: ClassVar[bool] = False
    precision: ClassVar[Precision]
    accuracy: ClassVar[float]
    """Of kappa, per contact."""

    @abstractmethod
    def stiffness(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)`` on the imaginary axis; `velocity` and `s` broadcast."""

    @abstractmethod
    def exact(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)`` at any s not far left of the axis; `velocity` and `s` broadcast."""

    @abstractmethod
    def frequencies(self, velocity: float) -> Array:
        """Angular frequencies that follow every turn of kappa."""

    @abstractmethod
    def quickest(self, velocity: float) -> float:
        """Decay rate beyond which no mode is looked for: what many lives have left behind grows beyond all bounds."""

    def beside_axis(self, velocity: float, s: ComplexArray) -> ComplexArray:
        """``kappa(s)`` to the right of the axis and not far left of it; not finite where it overflows."""
        return self.exact(velocity, s)

    def beyond(self, body: Impedance, omega: Array) -> Array:
        """Frequencies of a rig that `frequencies` may lack."""
        return np.empty(0) if is_plain(body) else features(body, omega, body(1j * omega))

    def loss(self, body: Impedance, velocity: float | Array, omega: Array) -> Array:
        """``Im(Z + kappa)``."""
        s = 1j * omega
        return np.asarray((body(s) + self.stiffness(velocity, s)).imag)

    def scan(self, body: Impedance, velocity: float, softest: float | None) -> Scan:
        """`loss` at all frequencies at which the response turns, and those of the rig."""
        del softest
        omega, kappa, *_ = known(self, velocity)
        value = np.asarray((body(1j * omega) + kappa).imag)
        more = self.beyond(body, omega)
        if more.size:
            order = np.argsort(np.concatenate([omega, more]), kind="stable")
            value = np.concatenate([value, self.loss(body, velocity, more)])[order]
            omega = np.concatenate([omega, more])[order]
        return Scan(omega, value)

    def count(self, body: Impedance, velocity: float) -> int:
        """Count the roots of ``Z + kappa`` with ``Re s > 0``, from the neutral frequencies.

        Raises
        ------
        UndecidedError
            If a mode is neutral to within the accuracy.
        """
        (neutral,) = neutral_frequencies(self, body, [velocity])
        near = np.flatnonzero(np.abs(neutral.extra) < self.accuracy)
        if near.size:
            raise UndecidedError(
                f"smooth sliding at velocity {velocity:g} x_s/time is neutral to within the accuracy of the response "
                f"({self.accuracy:g} of the stiffness of the contacts), at angular frequency "
                f"{neutral.omega[near[0]]:.5g}: on its stability boundary; move a parameter to one side"
            )
        return neutral.unstable()

    def rightmost(self, body: Impedance, velocity: float) -> complex:
        """Return the rightmost root of ``Z + kappa`` among those found; growing ones are confirmed by their count.

        Raises
        ------
        UndecidedError
            If growing modes are missing, or none is found.
        """
        growing = self.count(body, velocity)

        def value(s: complex) -> complex:
            points = np.array([s])
            return complex((body(points) + self.exact(velocity, points))[0])

        near = self.roots(body, velocity, np.empty(0, dtype=complex))
        polished = [root for root in (_secant(value, s, 1e-9) for s in near[:6].tolist()) if root is not None]
        roots = distinct_roots(np.array(polished, dtype=complex), 1.0 / velocity)
        found = int(np.sum(np.where(roots.imag > 0, 2, 1)[roots.real > 0]))
        if found == growing and roots.size:
            return complex(roots[0])
        if growing:
            raise UndecidedError(
                f"smooth sliding at velocity {velocity:g} x_s/time has {growing} growing modes, not all of which "
                "were found"
            )
        raise UndecidedError(
            f"smooth sliding at velocity {velocity:g} x_s/time is stable; "
            "its modes decay too quickly to be followed from the axis"
        )

    def roots(self, body: Impedance, velocity: float, starts: ComplexArray) -> ComplexArray:
        """Return the roots not far from the axis, rightmost first: by secants from `starts`, or dips along the axis."""
        omega, on_axis, real, on_real = known(self, velocity)
        if starts.size == 0:
            own = natural_frequencies(body)
            size = np.abs(body(1j * omega) + on_axis)
            dip = np.flatnonzero((size[1:-1] < size[:-2]) & (size[1:-1] <= size[2:])) + 1
            dip = dip[np.argsort(size[dip])][:5]
            turned = np.flatnonzero(np.diff(np.sign((body(real + 0j) + on_real).real)))
            starts = np.concatenate([1j * omega[dip], own[own.imag > 0], np.sqrt(real[turned] * real[turned + 1])])

        def value(points: ComplexArray) -> ComplexArray:
            return np.asarray(body(points) + self.beside_axis(velocity, points))

        quickest = self.quickest(velocity)
        before, s = starts * (1 + 0.02j * (starts.imag != 0) - 0.05 * (starts.imag == 0)), starts.copy()
        settled = np.zeros(s.shape, dtype=bool)
        with np.errstate(all="ignore"):  # what lies so far to the left that it has no number is dropped
            f_before, f = value(before), value(s)
            for _ in range(25):
                step = np.where(settled | (f == f_before), 0.0, -f * (s - before) / (f - f_before))
                step *= np.minimum(1.0, 0.3 * np.abs(s) / np.maximum(np.abs(step), 1e-300))
                before, f_before, s = s, f, s + step
                settled |= np.abs(step) < 1e-6 * np.abs(s)
                s[s.real < -quickest] = np.nan
                busy = np.isfinite(s) & ~settled
                if not busy.any():
                    break
                f = f.copy()
                f[busy] = value(s[busy])
        return distinct_roots(s[settled & np.isfinite(s)], 1e-3 / float(omega[0]))


@lru_cache(maxsize=64)
def known(response: FromAxis, velocity: float) -> Known:
    """Return kappa at one velocity, whatever the rig."""
    omega = response.frequencies(velocity)
    real = np.geomspace(omega[0], omega[-1], 40)
    return Known(omega, response.stiffness(velocity, 1j * omega), real, response.beside_axis(velocity, real + 0j))


def _secant(function: Callable[[complex], complex], start: complex, tolerance: float) -> complex | None:
    """Root near a start; None where the search does not settle."""
    before, s = start * (1 + 1e-3j), start
    f_before, f = function(before), function(s)
    for _ in range(20):
        if f == f_before:
            return s
        step = -f * (s - before) / (f - f_before)
        if not abs(step) < 0.3 * abs(s):
            return None
        before, f_before, s = s, f, s + step
        if abs(step) < tolerance * abs(s):
            return complex(s.real, abs(s.imag))
        f = function(s)
    return None
