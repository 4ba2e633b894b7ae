"""Survival of ageing contacts at constant velocity, from a Volterra equation in their
age; see `langevin`.

In units of their standard deviation about the mean, thresholds are an
Ornstein-Uhlenbeck process, whose transition probabilities are known. A contact breaks
where its threshold first meets its *level*, the force of its stretching, which rises by
``u/delta`` per age. A free threshold that is above its level at an age either has not
met it, or met it at some age s and rose above it again:

    Q(a | start) = S(a) - int Q(a | level at s) dS(s),

with ``Q`` the fraction of free thresholds above the level. Integrated by parts this is
an equation of the second kind for the survivors S, whose kernel is the inverse square
root of the lag times a smooth function. It is satisfied at the nodes of panels on which
S is a polynomial; on the first one, a polynomial of the root of the age over that root.

A contact that attaches on its own level has the survival of an excursion, per unit of
its entrance measure (its slope in the margin, in units of the standard deviation).
"""

import math

import numpy as np

from ._jit import jit
from .langevin import Life, longest_age
from .quadrature import gauss, lobatto
from .records import Floats

# order of the polynomials; a panel has ``P + 1`` nodes, of which the first is the last
# one of the panel before
P = 10


NODE = lobatto(P)
_BARYCENTRIC = np.array(
    [1.0 / np.prod(node - np.delete(NODE, j)) for j, node in enumerate(NODE)]
)
_GAUSS, _WEIGHT = gauss(12)
_HEIGHT = 1.0 / math.sqrt(2.0 * math.pi)
_FORGOTTEN = 36.0  # lag after which free thresholds have forgotten where they were
_NOBODY = 1e-14  # survivors below this are taken as none
# longest panel, in units of the time in which the level crosses one standard deviation
# of the free thresholds
_WIDEST = 2.5


@jit
def panel_edges(life: Life) -> Floats:
    """Return the edges of the panels of the age: lengths double at first, as far as the
    motion of the level is resolved.
    """
    rise = life.u / life.delta
    end = longest_age(life)
    lowest = -1.0 / life.delta
    highest = max((life.u * end - 1.0) / life.delta, (life.newborn - 1.0) / life.delta)
    edges = np.empty(1 << 16)
    fastest = max(1.0, abs(lowest + rise), abs(highest + rise))
    edges[0] = 0.0
    edges[1] = min(0.25 / fastest**2, 0.1 * end)
    k = 1
    while edges[k] < end and k + 1 < edges.size:
        age = edges[k]
        fastest = max(
            abs(lowest * math.exp(-age) + rise), abs(highest * math.exp(-age) + rise)
        )
        edges[k + 1] = age + min(
            age, _WIDEST * math.sqrt(-math.expm1(-2.0 * age)) / fastest
        )
        k += 1
    if edges[k] < end:
        raise ValueError(
            "a life of contacts is not resolved in 65,536 parts: their thresholds "
            "scatter too little"
        )
    edges[k] = end
    return edges[: k + 1].copy()


@jit
def panel_ages(edges: Floats) -> Floats:
    """Return the ages at the nodes of the panels, shape (panels, P + 1)."""
    age = np.empty((edges.size - 1, P + 1))
    age[0] = edges[1] * NODE**2
    for k in range(1, edges.size - 1):
        age[k] = edges[k] + (edges[k + 1] - edges[k]) * NODE
    return age


@jit
def interpolate(
    edges: Floats,
    k: int,
    age: float,
    row: Floats,
) -> None:
    """Fill the weights of panel `k`'s nodes for the survivors at one of its ages."""
    x = (
        math.sqrt(age / edges[1])
        if k == 0
        else (age - edges[k]) / (edges[k + 1] - edges[k])
    )
    total = 0.0
    for j in range(P + 1):
        d = x - NODE[j]
        if d == 0.0:
            row[:] = 0.0
            row[j] = 1.0
            total = 1.0
            break
        row[j] = _BARYCENTRIC[j] / d
        total += row[j]
    if k == 0:
        total *= x
    for j in range(P + 1):
        row[j] /= total


@jit
def _kernels(
    levels: Floats,
    rise: float,
    lag: float,
    weight: float,
    kernel: Floats,
) -> bool:
    """Fill the slope of ``Q`` in the lag between two moments on the level, times a
    weight; return whether any of it matters.
    """
    stay = math.exp(-lag)
    gone = -math.expm1(-lag)
    variance = gone * (1.0 + stay)
    matters = False
    turn = stay / math.sqrt(variance)
    for b in range(levels.size):
        free = -(levels[b] * gone / stay + rise * lag) * turn
        kernel[b] = 0.0
        if free * free < 80.0:
            slope = (
                turn * (rise * lag - levels[b] - rise) - free * stay * stay / variance
            )
            kernel[b] = weight * _HEIGHT * math.exp(-0.5 * free * free) * slope
            matters = True
    return matters


@jit
def _remember(
    edges: Floats,
    k: int,
    age: float,
    levels: Floats,
    rise: float,
    survivors: Floats,
    matrix: Floats,
    known: Floats,
) -> None:
    """Add to the equations the thresholds that rose above their level again, at an age
    of panel `k` with these `levels`.

    Those that met it within the panel go into the row `matrix` of the equations, shape
    (P + 1, n); those that met it before go into `known`.
    """
    count = levels.size
    fastest = 1e-9
    row = np.empty(P + 1)
    kernel = np.empty(levels.size)
    for level in levels:
        fastest = max(fastest, abs(level + rise))
    far = math.sqrt(min(0.5 * age, _FORGOTTEN))
    # first integrate over short lags, then over early ages, both by their roots
    for early in range(2 if 0.5 * age < _FORGOTTEN else 1):
        left = 0.0
        right = min(far, math.sqrt(edges[1]) if early else 2.0 / fastest)
        # ends: each panel doubles the distance covered
        while left < far:
            matters = False
            for q in range(_GAUSS.size):
                x = left + (right - left) * _GAUSS[q]
                then = x * x if early else age - x * x
                weight = 2.0 * x * (right - left) * _WEIGHT[q]
                if not _kernels(
                    levels,
                    rise,
                    age - x * x if early else x * x,
                    weight,
                    kernel,
                ):
                    continue
                matters = True
                m = k
                while edges[m] > then:
                    m -= 1
                interpolate(edges, m, then, row)
                for j in range(P + 1):
                    for b in range(count):
                        if m == k:
                            matrix[j, b] -= row[j] * kernel[b]
                        else:
                            known[b] += row[j] * survivors[m, j, b] * kernel[b]
            if not (matters or early):
                break
            left = right
            right = min(2.0 * right, far)
            if right > 0.75 * far:
                right = far


@jit
def survive(
    edges: Floats,
    rise: float,
    start: Floats,
    margin: Floats,
) -> Floats:
    """Return the survivors at the nodes of the panels, shape (panels, P + 1, n); on the
    first panel times the root of the age.

    `start` are levels at age 0, in rising order, so that survivors run out at the last
    ones first; `margin` is how far above them the newborns' thresholds are, 0 for an
    excursion.
    """
    count = start.size
    age = panel_ages(edges)
    survivors = np.zeros((edges.size - 1, P + 1, count))
    matrix = np.empty((P + 1, P + 1, count))
    known = np.empty((P + 1, count))
    for b in range(count):
        survivors[0, 0, b] = (
            0.0 if margin[b] > 0.0 else 1.0 / math.sqrt(math.pi * edges[1])
        )
    for k in range(edges.size - 1):
        if k > 0:
            survivors[k, 0] = survivors[k - 1, P]
            while count > 1 and abs(survivors[k, 0, count - 1]) < _NOBODY:
                survivors[k, 0, count - 1] = 0.0
                count -= 1
        matrix[:] = 0.0
        known[:] = 0.0
        for i in range(1, P + 1):
            a = age[k, i]
            stay = math.exp(-a)
            sigma = math.sqrt(-math.expm1(-2.0 * a))
            for b in range(count):
                free = (start[b] * math.expm1(-a) - rise * a) / sigma
                if margin[b] > 0.0:
                    above = free + margin[b] * stay / sigma
                    known[i, b] = 0.5 * (
                        math.erf(above / math.sqrt(2.0))
                        - math.erf(free / math.sqrt(2.0))
                    )
                else:
                    known[i, b] = _HEIGHT * math.exp(-0.5 * free * free) * stay / sigma
                matrix[i, i, b] = 0.5 / (NODE[i] if k == 0 else 1.0)
            _remember(
                edges,
                k,
                a,
                start[:count] + rise * a,
                rise,
                survivors,
                matrix[i],
                known[i],
            )
        for b in range(count):
            right = known[1:, b] - matrix[1:, 0, b] * survivors[k, 0, b]
            survivors[k, 1:, b] = np.linalg.solve(matrix[1:, 1:, b].copy(), right)
    return survivors
