"""Steady fronts in a bar on contacts with any distribution of thresholds, by shooting.

Where the bar has not moved, ahead of the front, all contacts are stretched to
``tau_0``; as it moves to the displacement ``U`` they break, and carry
``F(U) = f_d + (U - f_d) J_c(U)/J_c(tau_0)``. In units of ``sqrt(k_b/k)`` blocks the
front is that of a bistable medium,

    U'' + C U' + K (D - U) - F(U) = 0,

with one eigenvalue `C`, positive if the front advances. Inertia enters only through
``v = c/sqrt(1 + M eta^2/C^2)``.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import odeint
from scipy.optimize import brentq

from stickslip.arrays import Array
from stickslip.loops import HALVINGS, bounded
from stickslip.model.distributions import Distribution


class Medium(NamedTuple):
    """A bar on its contacts ahead of a front, per contact."""

    thresholds: Distribution
    sliding_force: float
    leaf: float
    prestress: float

    def excess(self, x: Array | float) -> Array:
        """Force ``K (D - U) - F(U)`` that drives the bar forward at the displacement
        ``U = x``.
        """
        attached = self.thresholds.survival(x) / self.attached
        held = self.leaf * (x - self.prestress) + (x - self.sliding_force) * attached
        return self.prestress - self.sliding_force - held

    @property
    def attached(self) -> float:
        """Fraction of the contacts that are attached ahead of the front."""
        return float(self.thresholds.survival(self.prestress))

    @property
    def rest(self) -> float:
        """Displacement at which the bar comes to rest behind a front; infinite without
        leaf springs.
        """
        if self.leaf == 0:
            return math.inf
        far = self.prestress + (self.prestress - self.sliding_force) / self.leaf
        if float(self.thresholds.survival(far)) <= 1e-14 * self.attached:
            return far
        # Some contacts are still attached there, so the bar comes to rest earlier.
        # Without such a place there is no front.
        x = np.linspace(self.prestress, far, 4001)[1:]
        driven = np.flatnonzero(self.excess(x) > 0)
        if driven.size == 0:
            return self.prestress
        last = x[driven[-1]]
        return float(
            brentq(lambda u: float(self.excess(u)), last, min(far, last + x[1] - x[0]))
        )

    @property
    def gain(self) -> float:
        """Energy per contact that a front has to spare, the area under `excess`; 0 at
        the threshold.
        """
        sliding = self.sliding_force
        end = self.rest
        if self.prestress <= sliding or end == self.prestress:
            return -math.inf
        if math.isinf(end):
            return math.inf

        def spent(x: float) -> float:
            """Minus the integral of ``(u - f_d) J_c(u)`` over ``u > x``, by parts from
            the partial moments of the thresholds.
            """
            none, one, two = (
                float(self.thresholds.partial_moment(x, n)) for n in (0, 1, 2)
            )
            return 0.5 * (
                none * (x - sliding) ** 2 - two + 2 * sliding * one - sliding**2 * none
            )

        moved = end - self.prestress
        contacts = (spent(end) - spent(self.prestress)) / self.attached
        driven = (self.prestress - sliding) * moved
        return driven - 0.5 * self.leaf * moved**2 - contacts


def rising(
    lack: Callable[[float], float],
    low: float,
    high: float,
    step: float,
) -> float:
    """Find where a function increases through 0; 0 if it does not.

    The bracket is extended by a factor until it holds the zero.
    """
    turns = bounded("rising", HALVINGS)
    while lack(low) > 0:
        next(turns)
        low, high = low / step, low
        if low < 1e-9:
            return 0.0
    turns = bounded("rising", HALVINGS)
    while lack(high) < 0:
        next(turns)
        low = high
        high = high * step
    return float(brentq(lack, low, high, xtol=1e-14, rtol=1e-12))


def threshold(medium: Medium) -> float:
    """Return the smallest prestress with a front, by equal areas of `excess` above and
    below 0 (Maxwell's rule).
    """
    sliding = medium.sliding_force
    if medium.leaf == 0:
        return sliding

    def sign(prestress: float) -> float:
        return max(medium._replace(prestress=prestress).gain, -1.0)

    top = float(medium.thresholds.inverse_survival(np.array(1e-3)))
    grid = np.linspace(sliding, max(top, sliding * (1 + 1e-9)), 200)
    first = next((i for i, x in enumerate(grid) if sign(float(x)) > 0), None)
    if first is None:
        return math.inf
    return float(brentq(sign, grid[first - 1], grid[first], xtol=1e-13))


def shoot(medium: Medium) -> float:
    """Return the eigenvalue `C` of the front; 0 if no front advances, infinity if all
    contacts break by themselves.

    With ``p = -U'`` the derivative of the energy ``p^2/2`` by `U` is ``C p - excess``;
    it is integrated from both ends.
    """
    if medium.gain <= 0:
        return 0.0
    tiny = 1e-6 * (1.0 + medium.prestress)
    low, high = medium.thresholds.support
    start = max(medium.prestress + tiny, low)
    stop = min(high, medium.rest - tiny)
    x = np.linspace(start, stop, 8001)
    force = medium.excess(x)
    held = np.flatnonzero(force < 0)
    if held.size == 0:  # the contacts ahead break by themselves
        return math.inf
    middle = x[held[-1] + 1]
    # Between the places of rest and these ends the force is linear.
    ahead = -force[0] / (start - medium.prestress)
    behind = force[-1] / (medium.rest - stop)

    def mismatch(c: float) -> float:
        def carried(p: float, begin: float) -> float:
            def growth(energy: Array, u: float) -> float:
                return c * math.sqrt(2.0 * max(energy[0], 0.0)) - float(
                    np.interp(u, x, force)
                )

            return float(
                odeint(
                    growth,
                    0.5 * p * p,
                    [begin, middle],
                    rtol=1e-8,
                    atol=1e-12,
                    mxstep=20_000,
                )[-1, 0]
            )

        first = 0.5 * (c + math.sqrt(c * c + 4.0 * ahead)) * (start - medium.prestress)
        last = 2.0 * force[-1] / (c + math.sqrt(c * c + 4.0 * behind))
        return carried(first, start) - carried(last, stop)

    return rising(mismatch, 1.0, 1.0, 2.0)
