"""Linear response of ageing contacts about steady sliding, from Eqs. (11) and
(13)-(17); see `langevin`.

If the displacement of the slider is perturbed by ``e^{pt}``, the level of a contact
that attached at age 0 is perturbed by ``e^{pa} - 1``. A level that is raised at one age
only removes the contacts that are about to break then and would otherwise have lived on
as excursions from there: with ``w(s, a)`` the survival of an excursion that begins at
age s,

    dS(a) = int_0^a w(s, a - s) (e^{ps} - 1) dS(s)/delta.

Survival and excursions do not depend on p. The contribution of one life to the dynamic
stiffness consists of their transforms, which polynomials have in closed form at any p.
"""

from typing import NamedTuple

import numpy as np

from ._jit import jit
from .langevin import Life, longest_age
from .langevin_survival import NODE, P, panel_ages, panel_edges, survive
from .quadrature import gauss
from .records import Complexes, Counts, Floats

_LEGENDRE = np.ascontiguousarray(
    np.linalg.inv(np.polynomial.legendre.legvander(2.0 * NODE - 1.0, P))
)
"""Coefficients of Legendre polynomials from values at the nodes."""
_FINE, _FINE_WEIGHT = gauss(32)
_ON_FINE = np.polynomial.legendre.legvander(2.0 * _FINE - 1.0, P) @ _LEGENDRE


class Excursions(NamedTuple):
    """Survival at one velocity, on panels of the age: of a contact, and of excursions
    that begin at some ages.
    """

    life: Life
    edges: Floats  # of the panels
    age: Floats  # shape (nodes,)
    start: Floats  # shape (n,): ages at which the excursions begin
    slope: Floats  # shape (n, n): slopes of a polynomial in the start from its values
    survivors: Floats  # shape (nodes,)
    # shape (nodes, 3 n): survivors times polynomials of the start; excursions,
    # alternately plain and times age
    lifetimes: Floats
    # shape (nodes,): number of columns of `lifetimes` to use: in the others nobody is
    # left
    alive: Counts


@jit
def _starts(life: Life) -> int:
    """Return the number of ages at which excursions begin: the slower the slider, the
    more sharply lives end.
    """
    return int(
        14.0
        + longest_age(life)
        * life.u
        / life.delta
        * (0.7 + 0.4 * max(-np.log(life.u), 0.0))
    )


@jit
def excursions(life: Life) -> Excursions:
    """Return the survival at one velocity of a contact and of excursions, for
    `life_transforms`.
    """
    edges = panel_edges(life)
    rise = life.u / life.delta
    count = _starts(life)
    angle = np.pi * (np.arange(count) + 0.5) / count
    start = 0.5 * edges[-1] * (1.0 - np.cos(angle))  # nodes of Chebyshev
    barycentric = np.sin(angle)
    barycentric[1::2] *= -1.0
    slope = np.zeros((count, count))
    for b in range(count):
        for c in range(count):
            if b != c:
                slope[b, c] = barycentric[c] / barycentric[b] / (start[b] - start[c])
        slope[b, b] = -np.sum(slope[b])
    margin = np.zeros(count + 1)
    margin[0] = life.newborn / life.delta
    levels = np.append(np.zeros(1), start) * rise - 1.0 / life.delta
    survival = survive(edges, rise, levels, margin).reshape(-1, count + 1)
    age = panel_ages(edges).ravel()
    lifetimes = np.empty((age.size, 3 * count))
    alive = np.full(age.size, count)
    for i in range(age.size):
        off = age[i] - start
        row = barycentric / np.where(off == 0.0, 1e-300, off)
        lifetimes[i, :count] = survival[i, 0] * row / np.sum(row)
        lifetimes[i, count::2] = survival[i, 1:]
        lifetimes[i, count + 1 :: 2] = age[i] * survival[i, 1:]
        while alive[i] < 3 * count and survival[i, 1 + (alive[i] - count) // 2] != 0.0:
            alive[i] += 2
    return Excursions(
        life,
        edges,
        age,
        start,
        slope,
        survival[:, 0].copy(),
        lifetimes,
        alive,
    )


@jit
def _legendre_transforms(z: complex, out: Complexes) -> None:
    """Compute ``int P_n(x) exp(-z (1 + x)) dx`` from -1 to 1 for all orders, by their
    recursion upwards or downwards.
    """
    size = abs(z)
    far = np.exp(-2.0 * z)
    if size < 1e-8:
        out[:] = 0.0
        out[0] = 2.0 - 2.0 * z
        out[1] = -2.0 * z / 3.0
        return
    first = (
        (1.0 - far) / z
        if size > 1e-3
        else 2.0 * (1.0 - z * (1.0 - z * (2.0 - z) / 3.0))
    )
    if size > P:
        out[0] = first
        out[1] = (first - 1.0 - far) / z
        for n in range(1, P):
            out[n + 1] = out[n - 1] + (2 * n + 1) / z * out[n]
        return
    above = 0j
    here = 1e-250 + 0j
    for n in range(P + 24, 0, -1):
        above, here = here, above - (2 * n + 1) / z * here
        if n <= P + 1:
            out[n - 1] = here
        if abs(here) > 1e100:
            above = above * 1e-150
            here = here * 1e-150
            for m in range(n - 1, P + 1):
                out[m] *= 1e-150
    factor = first / out[0]
    for n in range(P + 1):
        out[n] *= factor


@jit
def _transform_weights(edges: Floats, p: complex, weight: Complexes) -> None:
    """Fill the weights with which the values at the nodes of all panels enter the
    Laplace transform.
    """
    weight[0] = 0.0
    for i in range(_FINE.size):
        part = 2.0 * edges[1] * _FINE_WEIGHT[i] * np.exp(-p * edges[1] * _FINE[i] ** 2)
        for j in range(P + 1):
            weight[0, j] += part * _ON_FINE[i, j]
    legendre = np.empty(P + 1, dtype=np.complex128)
    for k in range(1, edges.size - 1):
        half = 0.5 * (edges[k + 1] - edges[k])
        _legendre_transforms(p * half, legendre)
        size = half * np.exp(-p * edges[k])
        for j in range(P + 1):
            total = 0j
            for n in range(P + 1):
                total += legendre[n] * _LEGENDRE[n, j]
            weight[k, j] = size * total


@jit
def _transform(
    known: Excursions,
    p: complex,
    real: Floats,
    imaginary: Floats,
) -> tuple[complex, complex]:
    """Return the transforms of the survivors and of their age; store those of the
    excursions as real and imaginary parts.
    """
    edges = known.edges
    age = known.age
    lifetimes = known.lifetimes
    weight = np.empty((edges.size - 1, P + 1), dtype=np.complex128)
    _transform_weights(edges, p, weight)
    real[:] = 0.0
    imaginary[:] = 0.0
    whole = 0j
    moment = 0j
    for i, w in enumerate(weight.ravel()):
        whole += w * known.survivors[i]
        moment += w * known.survivors[i] * age[i]
        for b in range(known.alive[i]):
            real[b] += w.real * lifetimes[i, b]
            imaginary[b] += w.imag * lifetimes[i, b]
    return whole, moment


@jit
def life_transforms(known: Excursions, p: Complexes) -> Complexes:
    """Return the contribution of one life to the dynamic stiffness at Laplace variables
    `p` in units of rate^2, shape (4, n).

    ``int S e^{-pa}``, ``int u a S e^{-pa}``, and the same two of the perturbation of
    the survivors S by a slider that is perturbed by ``e^{pa}``.
    """
    count = known.start.size
    u = known.life.u
    real = np.empty(3 * count)
    imaginary = np.empty(3 * count)
    _transform(known, 0j, real, imaginary)
    still = real[:count].copy()
    answer = np.empty((4, p.size), dtype=np.complex128)
    for q in range(p.size):
        answer[0, q], moment = _transform(known, p[q], real, imaginary)
        answer[1, q] = u * moment
        both = real + 1j * imaginary
        by = both[:count]
        life = both[count::2]
        age = both[count + 1 :: 2]
        # Integrated by parts: the survivors may change infinitely fast, the
        # contribution of the excursions does not.
        shift = -p[q] * by
        for c in range(count):
            shift += known.slope[c] * (by[c] - still[c])
        answer[2, q] = np.sum(shift * life) / known.life.delta
        answer[3, q] = np.sum(shift * u * (known.start * life + age)) / known.life.delta
    return answer
