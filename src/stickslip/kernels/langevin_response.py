"""Linear response of ageing contacts about steady sliding, from Eqs. (11) and (13)-(17); see `langevin`.

The density of the margin over the age is perturbed by the extra drift ``-d xi/dt - (xi(t) - xi(attachment)) rate^2``;
the births, counted by the local time of the margin at its boundary, follow from the conservation of contacts. The
response of survivors is the density times the slope of the adjoint solution, which is smooth at any s: large imaginary
s costs no finer grid.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import jit
from .drift_diffusion import bernoulli_slope
from .langevin import Langevin, Life, density_by_age, fine_nodes, life_at, margin_rates

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

NO_DELAY = np.zeros(1)


class _Future(NamedTuple):
    """What is still to come at an age, for all margins and all Laplace variables, and room to solve for it.

    `value`, shape (4, margins, n): real and imaginary parts of the life, then of the work. They lie apart and all
    variables side by side, so that the inner loops run on vectors. `known` is the right-hand side, `upper` the
    elimination.
    """

    value: Floats
    known: Floats
    upper: Floats


class _Variables(NamedTuple):
    """Laplace variables, real and imaginary parts."""

    re: Floats
    im: Floats


@jit
def _step_back(
    future: _Future, p: _Variables, up: Floats, down: Floats, da: float, implicit: float, gain: float
) -> None:
    """From one age to the one before: `da` of life and `gain` of work are added, and contacts wander by the rates."""
    value, known, upper = future
    m, count, explicit = value.shape[1] - 1, p.re.size, da - implicit
    for i in range(1, m + 1):
        off, on, below, above = explicit * down[i], explicit * up[i], implicit * down[i], implicit * up[i]
        stay = 1.0 - off - on
        k = min(i + 1, m)
        for part in range(2):
            x, y = value[2 * part], value[2 * part + 1]
            bx, by = known[2 * part], known[2 * part + 1]
            more = da if part == 0 else gain
            for q in range(count):
                still, turn = stay - explicit * p.re[q], -explicit * p.im[q]
                bx[i, q] = still * x[i, q] - turn * y[i, q] + off * x[i - 1, q] + on * x[k, q] + more
                by[i, q] = still * y[i, q] + turn * x[i, q] + off * y[i - 1, q] + on * y[k, q]
        for q in range(count):
            dx = 1.0 + implicit * p.re[q] + above + below - below * upper[0, i - 1, q]
            dy = implicit * p.im[q] - below * upper[1, i - 1, q]
            size = 1.0 / (dx * dx + dy * dy)
            px, py = dx * size, -dy * size
            fx, fy = known[0, i, q] + below * known[0, i - 1, q], known[1, i, q] + below * known[1, i - 1, q]
            gx, gy = known[2, i, q] + below * known[2, i - 1, q], known[3, i, q] + below * known[3, i - 1, q]
            known[0, i, q], known[1, i, q] = fx * px - fy * py, fx * py + fy * px
            known[2, i, q], known[3, i, q] = gx * px - gy * py, gx * py + gy * px
            upper[0, i, q], upper[1, i, q] = above * px, above * py
    value[:, m] = known[:, m]
    for i in range(m - 1, 0, -1):
        for part in range(2):
            x, y = value[2 * part], value[2 * part + 1]
            for q in range(count):
                cx, cy = upper[0, i, q], upper[1, i, q]
                x[i, q] = known[2 * part, i, q] + cx * x[i + 1, q] - cy * y[i + 1, q]
                y[i, q] = known[2 * part + 1, i, q] + cx * y[i + 1, q] + cy * x[i + 1, q]


@jit
def _weights(z: Floats, c: float, mass: Floats, ahead: Floats, back: Floats) -> None:
    """What a unit of extra drift does to the density at an age, as weights of differences of what is to come.

    `ahead` weighs the difference to the node above, `back` that to the node below.
    """
    m = z.size - 1
    for i in range(1, m + 1):
        h = z[i] - z[i - 1]
        slope = bernoulli_slope((c - 0.5 * (z[i - 1] + z[i])) * h)
        back[i] = -slope * mass[i] / (0.5 * (z[i + 1] - z[i - 1]) if i < m else 0.5 * h)
        if i > 1:
            ahead[i - 1] = (1.0 + slope) * mass[i - 1] / (0.5 * (z[i] - z[i - 2]))


@jit
def _weigh(value: Floats, ahead: Floats, back: Floats, total: Floats) -> None:
    """What a unit of extra drift at an age would add in all: density times slope of what is to come."""
    m = value.shape[1] - 1
    total[:] = 0.0
    for part in range(4):
        x, sum_ = value[part], total[part]
        for i in range(1, m + 1):
            k = min(i + 1, m)
            for q in range(sum_.size):
                sum_[q] += ahead[i] * (x[k, q] - x[i, q]) + back[i] * (x[i, q] - x[i - 1, q])


@jit
def _extra_drift(p: complex, age: float, da: float) -> tuple[complex, complex]:
    """Integrals of the extra drift ``e^{-pa} - 1 - p`` over an interval of ages, times the two hat functions there.

    What it multiplies is linear between the nodes; the exponential is integrated exactly. In units of `da`.
    """
    turn = p * da
    if abs(turn) < 1e-2:
        whole = 1.0 - turn / 2.0 + turn * turn / 6.0 - turn**3 / 24.0
        ramp = 0.5 - turn / 3.0 + turn * turn / 8.0 - turn**3 / 30.0
    else:
        e = np.exp(-turn)
        whole = (1.0 - e) / turn
        ramp = (1.0 - e * (1.0 + turn)) / (turn * turn)
    wave, half = np.exp(-p * age), 0.5 * (1.0 + p)
    return wave * (whole - ramp) - half, wave * ramp - half


@jit
def _transforms(life: Life, s: Complex, z: Floats, age: Floats, mass: Floats) -> Complex:
    """Transforms of one life at Laplace variables `s`, and of its response to a perturbed slider; shape (4, n).

    ``int S e^{-sa}``, ``int u a S e^{-sa}``, and the same two of the perturbation of S.
    """
    u, delta = life.u, life.delta
    m, n, count = z.size - 1, age.size - 1, s.size
    c0, r = (1.0 - u) / delta, u / delta
    p = _Variables(s.real.copy(), s.imag.copy())
    up, down, ahead, back = np.zeros(m + 1), np.zeros(m + 1), np.zeros(m + 1), np.zeros(m + 1)
    future = _Future(np.zeros((4, m + 1, count)), np.zeros((4, m + 1, count)), np.zeros((2, m + 1, count)))
    slope = np.zeros((4, count))
    response, later = np.zeros((count, 2), dtype=np.complex128), np.zeros((count, 2), dtype=np.complex128)
    for j in range(n - 1, -1, -1):
        da = age[j + 1] - age[j]
        middle = 0.5 * (age[j + 1] + age[j])
        margin_rates(z, c0 - r * middle, up, down)
        # Crank-Nicolson, but for the oldest ages, which damp its ringing.
        _step_back(future, p, up, down, da, (0.5 if j < n - 8 else 1.0) * da, da * u * middle)
        _weights(z, c0 - r * age[j], mass[j], ahead, back)
        _weigh(future.value, ahead, back, slope)
        for q in range(count):
            here, there = _extra_drift(s[q], age[j], da)
            first, second = complex(slope[0, q], slope[1, q]), complex(slope[2, q], slope[3, q])
            response[q, 0] += da * (first * here + later[q, 0] * there)
            response[q, 1] += da * (second * here + later[q, 1] * there)
            later[q, 0], later[q, 1] = first, second
    answer = np.empty((4, count), dtype=np.complex128)
    i = int(np.searchsorted(z, life.newborn / delta)) if life.newborn > 0.0 else 1
    w = mass[0, i] if life.newborn > 0.0 else 1.0
    # The half cell at the boundary belongs to the life of a contact that attaches on it, too.
    edge = 0.5 * z[1] * z[1] if life.newborn <= 0.0 else 0.0
    for q in range(count):
        lower, higher = future.value[:, i - 1, q], future.value[:, i, q]
        answer[0, q] = (1.0 - w) * complex(lower[0], lower[1]) + w * complex(higher[0], higher[1]) + edge
        answer[1, q] = (1.0 - w) * complex(lower[2], lower[3]) + w * complex(higher[2], higher[3])
        answer[2, q], answer[3, q] = response[q, 0] / delta, response[q, 1] / delta
    return answer


@jit
def life_transforms(life: Life, p: Complex, cells: int) -> Complex:
    """What one life contributes to the dynamic stiffness, at one resolution; see `dynamic_stiffness`.

    Parameters
    ----------
    life : Life
    p : ndarray of complex, shape (n,)
        Laplace variable in units of rate^2.
    cells : int
        Cells of the margin.

    Returns
    -------
    ndarray of complex, shape (4, n + 1)
        For each `p`, and last for 0: ``int S e^{-pa}``, ``int u a S e^{-pa}``, and the same two of the perturbation of
        the survivors S by a slider that is perturbed by ``e^{pa}``.
    """
    z, age = fine_nodes(life, cells)
    mass = density_by_age(life, z, age)
    return _transforms(life, np.append(p, np.zeros(1, dtype=np.complex128)), z, age, mass)


@jit
def _dynamic_stiffness(velocity: float, langevin: Langevin, s: Complex, delays: Floats, cells: int) -> Complex:
    """`dynamic_stiffness` at one resolution."""
    square = langevin.rate * langevin.rate
    parts = life_transforms(life_at(velocity, langevin), s / square, cells)
    rest = parts[0, s.size].real
    held = rest + np.mean(delays) * square
    kappa = np.empty(s.size, dtype=np.complex128)
    for k in range(s.size):
        p = s[k] / square
        away = 0j  # detached contacts, per birth
        if np.max(delays) > 0.0 and p != 0.0:
            e = np.mean(np.exp(-s[k] * delays))
            away = (1.0 - e) / (p * e)
        life, work, less, lost = parts[0, k], parts[1, k], parts[2, k], parts[3, k]
        kappa[k] = (rest - life + lost - less * work / (life + away)) / held
    return kappa


@jit
def dynamic_stiffness(
    velocity: float, langevin: Langevin, s: Complex, delays: Floats = NO_DELAY, cells: int = 80
) -> Complex:
    """Dynamic stiffness of ageing contacts about steady sliding.

    A slider at ``X = velocity t + xi e^{st}`` feels the force ``F + kappa(s) xi e^{st}``; with a mass on a spring,
    the roots of ``M s^2 + M eta s + K + kappa(s) = 0`` are the modes of smooth sliding. kappa depends on
    ``velocity/(rate^2 mean)`` and ``s/rate^2`` only, tends to ``s dF/dv`` for small s and to 1 for large s.

    Parameters
    ----------
    velocity : float
        Sliding velocity, above 0.
    langevin : Langevin
    s : ndarray of complex, shape (n,)
        Laplace variable, per time.
    delays : ndarray, shape (d,)
        Delays after breaking, equally likely; they need a newborn threshold above 0.
    cells : int
        Cells of the margin on the coarser of two grids, which one Richardson extrapolation joins; 80 gives some 2e-4
        for ``|s|`` below ten times rate^2, 2e-3 at a hundred times.

    Returns
    -------
    ndarray of complex, shape (n,)
        kappa, per contact, in units of the contact stiffness.
    """
    coarse = _dynamic_stiffness(velocity, langevin, s, delays, cells)
    return (4.0 * _dynamic_stiffness(velocity, langevin, s, delays, 2 * cells) - coarse) / 3.0
