"""Steady fronts in a bar on contacts with any distribution of thresholds, by shooting.

Behind ``U`` ahead of the front all contacts are stretched to ``tau_0``; as the bar moves on they break, and carry
``F(U) = f_d + (U - f_d) J_c(U)/J_c(tau_0)``. In units of ``sqrt(k_b/k)`` blocks the front is that of a bistable medium,

    U'' + C U' + K (D - U) - F(U) = 0,

with one eigenvalue `C`, positive if the front advances. Inertia enters by ``v = c/sqrt(1 + M eta^2/C^2)`` alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from stickslip.model.distributions import Distribution

Array = NDArray[np.float64]

CELLS = 1500
"""Steps of the shooting on either side of the matching point."""


class Medium(NamedTuple):
    """A bar on its contacts, per contact."""

    thresholds: Distribution
    sliding_force: float
    leaf: float


def excess(medium: Medium, prestress: float, x: Array) -> Array:
    """Return ``K (D - U) - F(U)``: what drives the bar forward where it has moved to ``U = x``."""
    thresholds, sliding, leaf = medium
    attached = thresholds.survival(x) / float(thresholds.survival(prestress))
    return np.asarray(prestress - leaf * (x - prestress) - sliding - (x - sliding) * attached)


def rest_behind(medium: Medium, prestress: float) -> float:
    """Displacement at which the bar comes to rest behind a front; infinite without leaf springs."""
    thresholds, sliding, leaf = medium
    if leaf == 0:
        return math.inf
    far = prestress + (prestress - sliding) / leaf
    if float(thresholds.survival(far)) <= 1e-14 * float(thresholds.survival(prestress)):
        return far
    # Some contacts are still attached there; the bar rests earlier. Without a place to rest there is no front.
    x = np.linspace(prestress, far, 4001)[1:]
    driven = np.flatnonzero(excess(medium, prestress, x) > 0)
    if driven.size == 0:
        return prestress
    last = x[driven[-1]]
    return float(brentq(lambda u: float(excess(medium, prestress, np.asarray(u))), last, min(far, last + x[1] - x[0])))


def gain(medium: Medium, prestress: float) -> float:
    """Return the work that a front has to spare per contact, the area under `excess`: none at the threshold."""
    thresholds, sliding, leaf = medium
    end = rest_behind(medium, prestress)
    if prestress <= sliding or end == prestress:
        return -math.inf
    if math.isinf(end):
        return math.inf

    def spent(x: float) -> float:
        """Minus the integral of ``(u - f_d) J_c(u)`` over ``u > x``: by parts, moments of the thresholds beyond x."""
        none, one, two = (float(thresholds.partial_moment(x, n)) for n in (0, 1, 2))
        return 0.5 * (none * (x - sliding) ** 2 - two + 2 * sliding * one - sliding**2 * none)

    moved = end - prestress
    contacts = (spent(end) - spent(prestress)) / float(thresholds.survival(prestress))
    return (prestress - sliding) * moved - 0.5 * leaf * moved**2 - contacts


def threshold(medium: Medium) -> float:
    """Return the smallest prestress with a front: equal areas above and below 0 of `excess` (Maxwell's rule)."""
    thresholds, sliding, leaf = medium
    if leaf == 0:
        return sliding

    def sign(prestress: float) -> float:
        return max(gain(medium, prestress), -1.0)

    top = float(thresholds.inverse_survival(np.array(1e-3)))
    grid = np.linspace(sliding, max(top, sliding * (1 + 1e-9)), 200)
    first = next((i for i, x in enumerate(grid) if sign(float(x)) > 0), None)
    if first is None:
        return math.inf
    return float(brentq(sign, grid[first - 1], grid[first], xtol=1e-13))


def shoot(medium: Medium, prestress: float) -> float:
    """Return the eigenvalue `C` of the front; 0 if there is none that advances, infinity if all contacts give way."""
    thresholds, leaf = medium.thresholds, medium.leaf
    if gain(medium, prestress) <= 0:
        return 0.0
    low, high = thresholds.support
    end = rest_behind(medium, prestress)
    start, stop = max(prestress, low), min(high, end)
    x = np.linspace(start, stop, 8001)
    force = excess(medium, prestress, x)
    held = np.flatnonzero(force < 0)
    if held.size == 0:  # the contacts ahead give way by themselves
        return math.inf
    middle = float(x[held[-1] + 1])
    rise = np.linspace(start, middle, 2 * CELLS + 1)
    fall = np.linspace(stop, middle, 2 * CELLS + 1)
    rising, falling = excess(medium, prestress, rise).tolist(), excess(medium, prestress, fall).tolist()
    tiny = 1e-6 * (1.0 + prestress)
    ahead_slope = float((excess(medium, prestress, np.asarray(prestress + tiny))) / tiny)
    behind_slope = -leaf if stop < end else float(-excess(medium, prestress, np.asarray(end - tiny)) / tiny)

    def mismatch(c: float) -> float:
        ahead = 0.5 * (c + math.sqrt(c * c - 4 * ahead_slope))
        behind = 0.5 * (math.sqrt(c * c - 4 * behind_slope) - c)
        if stop < end:  # detached contacts only, to the end: exact
            last = float(excess(medium, prestress, np.asarray(stop)))
            slope = 2 * last / (c + math.sqrt(c * c + 4 * leaf))
        else:
            slope = 0.0
        return _carry(rising, rise, c, ahead, ahead * (start - prestress)) - _carry(falling, fall, c, -behind, slope)

    top = 1.0
    while mismatch(top) < 0:
        top *= 2.0
    bottom = top
    while mismatch(bottom) >= 0:
        bottom *= 0.5
        if bottom < 1e-9:
            return 0.0
    return float(brentq(mismatch, bottom, top, xtol=1e-12, rtol=1e-12))


def _carry(force: list[float], x: Array, c: float, ratio: float, slope: float) -> float:
    """Carry ``p = -U'`` along `x` by ``p dp/dU = C p - force`` (Runge-Kutta, with the force at half steps)."""
    step = float(x[2] - x[0])
    first = 0
    if slope == 0.0:  # the point of rest itself: leave it along its own direction
        slope, first = ratio * step, 1
    p = slope
    for i in range(first, len(force) // 2):
        here, half, there = force[2 * i], force[2 * i + 1], force[2 * i + 2]
        a = c - here / p
        b = c - half / max(p + 0.5 * step * a, 1e-300)
        d = c - half / max(p + 0.5 * step * b, 1e-300)
        e = c - there / max(p + step * d, 1e-300)
        p += step * (a + 2 * (b + d) + e) / 6.0
        if not p > 0.0:
            return 0.0
    return p
