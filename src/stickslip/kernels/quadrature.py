"""Rules of integration and interpolation on a panel: a step of time, in which all is a
polynomial.

A panel has `P` nodes of Radau behind its start, at which equations are met, and `Q`
nodes of Gauss, which stand for what happens in it: the integral of anything smooth over
the panel is a sum over them.
"""

import numpy as np

from ._jit import bare, inlined
from .records import Complexes, Floats

Numbers = Floats | Complexes

P = 5  # nodes of a step behind its start; its order is ``P + 1``
# nodes that stand for what attaches in a step; they integrate polynomials up to order
# ``2 Q - 1``
Q = 4


def _powers(nodes: Floats) -> Floats:
    """Coefficients of the polynomials that are 1 at one node and 0 at the others."""
    return np.ascontiguousarray(np.linalg.inv(np.vander(nodes, increasing=True)))


def _values(nodes: Floats, points: Floats) -> Floats:
    return np.asarray(np.vander(points, nodes.size, increasing=True) @ _powers(nodes))


def _slopes(nodes: Floats, points: Floats) -> Floats:
    power = np.arange(nodes.size)
    return np.asarray(
        (power * points[:, None] ** np.maximum(power - 1, 0)) @ _powers(nodes)
    )


def integrals(nodes: Floats) -> Floats:
    """Integrals from 0 to each node of the polynomials that are 1 at one node and 0
    at the others.
    """
    power = np.arange(1, nodes.size + 1)
    return np.ascontiguousarray((nodes[:, None] ** power / power) @ _powers(nodes))


def radau(count: int) -> Floats:
    """Places on (0, 1] where the Legendre polynomials of the last two orders are
    equal; the last is 1.
    """
    difference = np.zeros(count + 1)
    difference[count] = 1.0
    difference[count - 1] = -1.0
    # from numpy 2.5 on complex, whatever they are
    roots = np.real(np.polynomial.legendre.legroots(difference))
    places = np.sort(0.5 * (1.0 + roots))
    places[-1] = 1.0
    return np.asarray(places)


def gauss(count: int) -> tuple[Floats, Floats]:
    """Nodes and weights of Gauss on (0, 1)."""
    x, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (1.0 + x), 0.5 * weight


def lobatto(order: int) -> Floats:
    """Ends of [0, 1], and where the Legendre polynomial of an order is steepest or
    lowest.
    """
    inner = np.polynomial.legendre.Legendre.basis(order).deriv().roots()
    return np.asarray(
        0.5 * (1.0 + np.concatenate([[-1.0], np.sort(inner.real), [1.0]]))
    )


# start and nodes of a step, as fractions of it, shape (P + 1,)
NODE = np.append(0.0, radau(P))
COLLOCATION = integrals(NODE[1:])
"""Integrals up to each node from the values at the nodes, the start left out: the
scheme Radau IIA.
"""
INTEGRAL = integrals(NODE)  # the same from the values at the start and the nodes
MONOMIAL = _powers(NODE)  # coefficients of the polynomial through start and nodes
SLOPES = np.ascontiguousarray(_slopes(NODE, NODE))  # slopes at start and nodes
GAUSS, WEIGHT = gauss(Q)
"""Nodes and weights of Gauss, shape (Q,)."""
# coefficients of the polynomial through the nodes of Gauss
GAUSS_MONOMIAL = _powers(GAUSS)
PART = np.stack([_values(NODE, u * GAUSS) for u in NODE[1:]])
"""Values at the nodes of Gauss between the start and each node, shape (P, Q, P + 1)."""
INCREASE = np.stack(
    [_slopes(NODE, u * GAUSS) * (u * WEIGHT)[:, None] for u in NODE[1:]]
)
"""Slopes there times weights: what part of an increase belongs to each node of
Gauss.
"""
_CHEBYSHEV = np.linalg.inv(np.polynomial.chebyshev.chebvander(2 * NODE - 1, P))
LAST = np.ascontiguousarray(_CHEBYSHEV[P - 2 :])
"""Coefficients of the last three Chebyshev polynomials: they tell whether the
polynomial is resolved.
"""


@inlined
def dot(weights: Floats, row: Floats) -> float:
    """Sum of products."""
    total = 0.0
    for i in range(weights.size):
        total += weights[i] * row[i]
    return total


@bare
def fit(row: Floats, curve: Floats) -> None:
    """Find the coefficients of the polynomial through values at start and nodes."""
    for a in range(P + 1):
        curve[a] = dot(MONOMIAL[a], row)


@inlined
def along(curve: Floats, u: float) -> float:
    """Value at ``0 <= u <= 1`` of a polynomial that `fit` has found."""
    total = curve[P]
    for a in range(P - 1, -1, -1):
        total = total * u + curve[a]
    return float(total)


@inlined
def bisect(
    curve: Floats,
    level: float,
    sign: float,
    low: float,
    high: float,
    times: int,
) -> tuple[float, float]:
    """Bracket where a polynomial crosses a level, in the direction of `sign`, between
    two places, by bisection.
    """
    for _ in range(times):
        middle = 0.5 * (low + high)
        if (along(curve, middle) - level) * sign > 0.0:
            high = middle
        else:
            low = middle
    return low, high


@bare
def between(row: Floats, u: float) -> float:
    """Value at ``0 <= u <= 1`` of the polynomial through values at start and nodes;
    that at the start stays exact.
    """
    total = 0.0
    base = row[0]
    for a in range(P, 0, -1):
        c = 0.0
        for b in range(1, P + 1):
            c += MONOMIAL[a, b] * (row[b] - base)
        total = (total + c) * u
    return float(base + total)


@inlined
def solve(matrix: Numbers, value: Numbers) -> None:
    """Solve a small system in place, without pivoting: collocation matrices are near
    the identity or diagonal.
    """
    n = value.size
    for k in range(n):
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, n):
            factor = matrix[i, k] * inverse
            for j in range(k + 1, n):
                matrix[i, j] -= factor * matrix[k, j]
            value[i] -= factor * value[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            value[k] -= matrix[k, j] * value[j]
        value[k] /= matrix[k, k]


@inlined
def value(row: Floats, curve: Floats, u: float) -> float:
    """Value at ``0 <= u <= 1`` of the polynomial through values at start and nodes,
    which it leaves in `curve`.
    """
    fit(row, curve)
    return along(curve, u)
