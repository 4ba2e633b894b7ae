"""Linear stability of smooth sliding on contacts whose thresholds age by `Langevin`.

The dynamic stiffness comes from the linearised kinetic equation of Eqs. (13)-(17), see
`stickslip.kernels.ageing.dynamic_stiffness_ageing`; it has no closed form and costs some ten milliseconds a point, so
curves are followed on few frequencies, refined where they turn.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import UndecidedError
from stickslip.model import Delay, Interface
from stickslip.stability.rigs import Impedance, natural_frequencies
from stickslip.theory import gaussian_ageing

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]

_COARSE, _FINE = 40, 80
"""Cells of the gap: some 1e-3, and 2e-4."""

_TURN = 0.6
"""Largest angle (rad) between neighbours on the curve that is followed about the origin."""

_PER_DECADE = 10
"""Speeds per decade at which growing modes are counted; a window of speeds narrower than that may be missed."""


def aged_stiffness(interface: Interface, velocity: float, s: ComplexArray, *, cells: int = _FINE) -> ComplexArray:
    """``kappa(s)`` about steady sliding, per contact."""
    from stickslip.kernels.ageing import dynamic_stiffness_ageing

    ageing, law = gaussian_ageing(interface)
    delay = interface.delay
    delays = np.array([delay.time]) if isinstance(delay, Delay) else delay.sample(np.random.default_rng(0), 1024)
    points = np.asarray(s, dtype=np.complex128)
    kappa = dynamic_stiffness_ageing(
        velocity, ageing.rate, law.spread, points.ravel(), ageing.newborn, law.mean, delays, cells
    )
    return np.asarray(kappa.reshape(points.shape))


class _Curve:
    """``Z + kappa`` along the positive imaginary axis, fine enough to follow its angle."""

    def __init__(self, interface: Interface, rig: Impedance, velocity: float) -> None:
        ageing, law = gaussian_ageing(interface)
        own = float(np.max(np.abs(natural_frequencies(rig)), initial=0.0))
        slow = min(ageing.rate**2, velocity / law.mean)
        top = 3.0 * max(own, 3.0 * ageing.rate**2, 3.0 * velocity / law.mean)
        self.omega = np.geomspace(0.01 * slow, top, 48)
        self.z = rig(1j * self.omega)
        self.kappa = aged_stiffness(interface, velocity, 1j * self.omega, cells=_COARSE)
        for _ in range(14):
            # Beyond the top neither the interface nor its share in the sum turns the curve any more.
            if abs(np.angle(1 + self.kappa[-1] / self.z[-1])) < 0.3 and abs(self.kappa[-1]) < 1.5:
                break
            self._add(interface, rig, velocity, self.omega[-1:] * 1.6)
        for _ in range(12):
            value = self.value
            coarse = np.abs(np.angle(value[1:] / value[:-1])) > _TURN
            if not coarse.any():
                return
            if np.min(np.diff(self.omega)[coarse] / self.omega[1:][coarse]) < 1e-3:
                break
            self._add(interface, rig, velocity, np.sqrt(self.omega[1:] * self.omega[:-1])[coarse])
        at = float(self.omega[np.argmin(np.abs(self.value))])
        raise UndecidedError(
            f"smooth sliding at velocity {velocity:g} is neutral to within the accuracy of the response (1e-3), at "
            f"angular frequency {at:.5g}: on its stability boundary; move a parameter to one side"
        )

    def _add(self, interface: Interface, rig: Impedance, velocity: float, omega: Array) -> None:
        all_omega = np.concatenate([self.omega, omega])
        order = np.argsort(all_omega)
        more = aged_stiffness(interface, velocity, 1j * omega, cells=_COARSE)
        self.kappa = np.concatenate([self.kappa, more])[order]
        self.z = np.concatenate([self.z, rig(1j * omega)])[order]
        self.omega = all_omega[order]

    @property
    def value(self) -> ComplexArray:
        """``Z + kappa``."""
        return np.asarray(self.z + self.kappa)

    def unstable(self) -> int:
        """Roots with ``Re s > 0``: kappa and Z have no poles there."""
        value = self.value
        turned = float(np.sum(np.angle(value[1:] / value[:-1]))) + float(np.angle(value[0]))
        z = complex(self.z[-1])
        angle_z = math.atan2(max(z.imag, 0.0), z.real)
        return round((angle_z + float(np.angle(value[-1] / z)) - turned) / math.pi)

    def nearest(self) -> ComplexArray:
        """Points on the axis where the curve dips towards the origin."""
        size = np.abs(self.value)
        dip = np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])) + 1
        return np.asarray(1j * self.omega[dip])


def count_aged(interface: Interface, rig: Impedance, velocity: float) -> int:
    """Number of growing modes of smooth sliding, by the argument principle."""
    return _Curve(interface, rig, velocity).unstable()


def rightmost_aged(interface: Interface, rig: Impedance, velocity: float) -> complex:
    """The fastest growing mode, all of them found.

    Raises
    ------
    UndecidedError
        If no mode grows (how fast the slowest decays is not computed), or not all growing modes were reached.
    """
    curve = _Curve(interface, rig, velocity)
    count = curve.unstable()
    if count == 0:
        raise UndecidedError(
            f"smooth sliding at velocity {velocity:g} is stable; how fast its slowest mode dies out is not computed "
            "for thresholds that age"
        )

    def value(s: complex) -> complex:
        points = np.array([s])
        return complex((rig(points) + aged_stiffness(interface, velocity, points))[0])

    roots: list[complex] = []
    for start in curve.nearest().tolist():
        for share in (0.0, 0.3, 1.0):
            root = _secant(value, start + share * abs(start), 1e-7)
            if root is not None and root.real > 0 and all(abs(root - r) > 1e-4 * abs(root) for r in roots):
                roots.append(root)
        if sum(2 if abs(r.imag) > 1e-6 * abs(r) else 1 for r in roots) >= count:
            return max(roots, key=lambda r: r.real)
    raise UndecidedError(
        f"smooth sliding at velocity {velocity:g} has {count} growing modes, not all of which were found: {roots}"
    )


def _secant(function: Any, start: complex, tolerance: float) -> complex | None:
    """Root near a start, its imaginary part made 0 or above; None where the search does not settle."""
    s, before = start, start * (1 + 0.02j)
    f, f_before = function(s), function(before)
    for _ in range(30):
        if f == f_before:
            return None
        step = -f * (s - before) / (f - f_before)
        step *= min(1.0, 0.5 * abs(s) / abs(step)) if step else 1.0
        before, f_before, s = s, f, s + step
        if s.real < -0.3 * abs(s):
            return None
        if abs(step) < tolerance * abs(s):
            return complex(s.real, abs(s.imag))
        f = function(s)
    return None


def crossings_aged(
    interface: Interface, rig: Impedance, between: tuple[float, float]
) -> tuple[tuple[int, int], list[tuple[float, float, int, int]]]:
    """Growing modes at both ends of a range of speeds, and speed, frequency and counts on both sides of each change."""
    low, high = between
    speeds = np.geomspace(low, high, max(2, math.ceil(_PER_DECADE * math.log10(high / low)) + 1))
    counts = [count_aged(interface, rig, v) for v in speeds.tolist()]
    found: list[tuple[float, float, int, int]] = []

    def split(left: float, n_left: int, right: float, n_right: int) -> None:
        if n_left == n_right:
            return
        middle = math.sqrt(left * right)
        curve = None
        if right > 1.02 * left:
            try:
                curve = _Curve(interface, rig, middle)
            except UndecidedError:
                curve = None  # so near the boundary that it is found from here
        if curve is None:
            speed, omega = _neutral(interface, rig, middle, left, right)
            found.append((speed, omega, n_left, n_right))
            return
        split(left, n_left, middle, curve.unstable())
        split(middle, curve.unstable(), right, n_right)

    for i in range(len(counts) - 1):
        split(float(speeds[i]), counts[i], float(speeds[i + 1]), counts[i + 1])
    return (counts[0], counts[-1]), found


def _neutral(interface: Interface, rig: Impedance, start: float, left: float, right: float) -> tuple[float, float]:
    """Speed and angular frequency with ``Z(i omega) + kappa(i omega) = 0``, by Newton's method in their logarithms."""

    def value(speed: float, omega: Array) -> ComplexArray:
        return np.asarray(rig(1j * omega) + aged_stiffness(interface, speed, 1j * omega))

    own = float(np.max(np.abs(natural_frequencies(rig)), initial=0.0))
    omega = np.geomspace(0.03 * start, 3.0 * max(own, 10.0 * start), 60)
    w, v = float(omega[np.argmin(np.abs(value(start, omega)))]), start
    for _ in range(12):
        f, f_w = value(v, np.array([w, w * 1.001]))
        f_v = value(v * 1.001, np.array([w]))[0]
        by_w, by_v = (f_w - f) / 0.001, (f_v - f) / 0.001
        matrix = np.array([[by_w.real, by_v.real], [by_w.imag, by_v.imag]])
        step = np.clip(np.linalg.solve(matrix, [-f.real, -f.imag]), -0.3, 0.3)
        w, v = w * math.exp(step[0]), v * math.exp(step[1])
        if np.max(np.abs(step)) < 1e-5:
            break
    if not left * 0.97 <= v <= right * 1.03:
        raise UndecidedError(
            f"the number of growing modes changes between velocity {left:g} and {right:g}, "
            "but no neutral mode was found"
        )
    return v, w
