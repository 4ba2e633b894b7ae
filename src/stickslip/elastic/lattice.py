"""Steady fronts in a chain whose contacts all break at one threshold and stay detached,
by the Wiener-Hopf method.

In units of the block spacing and of the time that sound takes from block to block, with
``kappa = 1/k_b``, ``Kh = K/k_b``, ``alpha = eta sqrt(M/k_b)``,
``zeta = c_b/sqrt(M k_b)`` and ``T = 1/v``,

    L0(s) = s^2 + alpha s + Kh + (1 + zeta s)(2 - 2 cosh sT)
    L1 = L0 + kappa
    G = L0/L1 = G+ G-

``L0`` and ``L1`` are the stiffnesses for a wave of the front's speed behind and ahead
of it. A front of speed `v` needs the prestress
``G-(0) = sqrt(G(0)) exp((1/pi) Int_0^inf arg G(i w) dw/w)``, which is
``(tau_0 - f_d)/(f_s - f_d)``.
"""

import math
from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from scipy.integrate import tanhsinh
from scipy.optimize import elementwise

from stickslip.arrays import Array
from stickslip.loops import HALVINGS, bounded
from stickslip.model import ElasticBody

_LEAST = 1e-100  # a frequency next to 0 whose square does not underflow
# frequency beyond which the phase is averaged over the waves of the lattice; the error
# is 1/SMOOTH^2
# is 1/SMOOTH^2
SMOOTH = 2000.0


@lru_cache(maxsize=4096)
def lattice_prestress(speed: float, body: ElasticBody) -> float:
    """Return the prestress, ``(tau_0 - f_d)/(f_s - f_d)``, of a front of a given speed
    in a chain.

    The speed is in units of the speed of sound; the result is accurate to 1e-7 down to
    a hundredth of it.
    """
    # contacts, leaf springs, damping and viscosity relative to the bulk
    impedance = math.sqrt(body.mass * body.coupling)
    period = 1.0 / speed
    kappa = 1.0 / body.coupling
    leaf = body.leaf / body.coupling
    alpha = body.damping * body.mass / impedance
    zeta = body.viscosity / impedance
    # G has a zero of this order at s = 0, which belongs to G+; it is divided out as
    # s/(s + 1).
    order = 0 if leaf > 0 else 1 if alpha > 0 else 2
    slope = (leaf, alpha, 1.0 - period * period)[order]
    # No force resists behind the front, and no loss takes up the waves ahead of it.
    if slope <= 0:
        return 0.0
    edges, rough = _panels(kappa, leaf, alpha, zeta, period)

    def phase_over_frequency(w: Array) -> Array:
        wave = np.where(w > rough, 2.0, _bulk(w, period))
        loss = w * (alpha + zeta * wave)
        stiffness = wave - w * w + leaf
        behind = np.arctan2(loss, stiffness)
        ahead = np.arctan2(loss, stiffness + kappa)
        divided = order * np.arctan2(1.0, w)
        return np.asarray((behind - ahead - divided) / w)

    ends = np.append(edges[1:], np.inf)
    # minlevel: nodes crowd at the ends, where the phase jumps in a chain without
    # damping
    found = tanhsinh(
        phase_over_frequency, edges, ends, atol=1e-9, rtol=1e-8, minlevel=5
    )
    at_zero = math.sqrt(slope / (leaf + kappa))
    return at_zero * math.exp(found.integral.sum() / math.pi)


def _panels(
    kappa: float,
    leaf: float,
    alpha: float,
    zeta: float,
    period: float,
) -> tuple[Array, float]:
    """Return frequencies between which the phase is smooth, and the frequency beyond
    which it is averaged.
    """
    turns = np.empty(0)
    if period > 1.0:  # where the real part of L0 turns back: w = T sin(wT)
        count = int(8 * period * period) + 200
        grid = np.linspace(0.0, period, count)[1:]
        turns = _zeros(lambda w: period * np.sin(w * period) - w, grid)
    marks = [turns]
    for spring in (leaf, leaf + kappa):  # where the real parts of L0 and L1 are zero
        highest = math.sqrt(spring + 4.0)
        ends = np.concatenate([[1e-12], turns, [1.001 * highest]])
        marks.append(_zeros(partial(_real_part, spring, period), ends))
    steps = np.unique(np.concatenate(marks))
    if alpha == zeta == 0:  # the phase is constant between its steps
        return np.append(_LEAST, steps), math.inf
    rough = max(20.0, SMOOTH * min(1.0, math.sqrt(zeta)))
    start = float(np.max(steps, initial=1.0, where=steps < rough))
    panels = [start]
    added = bounded("lattice: panels", HALVINGS + math.ceil(rough * period))
    while panels[-1] < rough:
        next(added)
        width = min(panels[-1], 25.0 / period)
        panels.append(panels[-1] + width)
    edges = np.unique(np.concatenate([[_LEAST], steps, panels]))
    return edges, panels[-1]


def _real_part(spring: float, period: float, w: Array) -> Array:
    """Real part of the stiffness of a wave with a given spring to each block."""
    return spring - w * w + _bulk(w, period)


def _bulk(w: Array, period: float) -> Array:
    """Stiffness of the bulk to a wave, ``2 - 2 cos(w T)``."""
    return 4.0 * np.sin(0.5 * w * period) ** 2


def _zeros(function: Callable[[Array], Array], grid: Array) -> Array:
    """Find zeros of a function between neighbours of a grid where its sign changes."""
    value = function(grid)
    changes = value[:-1] * value[1:] < 0
    at = np.flatnonzero(changes)
    found = elementwise.find_root(function, (grid[at], grid[at + 1]))
    return found.x
