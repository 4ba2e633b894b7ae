"""Rules of integration and interpolation on a panel: a time step in which all variables
are polynomials.

A panel has `P` Radau nodes after its start, at which equations are solved, and `Q`
Gauss nodes, at which events in it are represented: the integral of a smooth function
over the panel is a sum over them.
"""

import numpy as np

from ._jit import bare, inlined
from .records import Complexes, Floats

Numbers = Floats | Complexes

P = 5  # nodes of a step after its start; the order of the scheme is ``P + 1``
# nodes for the contacts that attach in a step; they integrate polynomials up to order
# ``2 Q - 1``
Q = 4


def powers(nodes: Floats) -> Floats:
    """Coefficients of the polynomials that are 1 at one node and 0 at all others."""
    return np.ascontiguousarray(np.linalg.inv(np.vander(nodes, increasing=True)))


def _values(nodes: Floats, points: Floats) -> Floats:
    return np.asarray(np.vander(points, nodes.size, increasing=True) @ powers(nodes))


def _slopes(nodes: Floats, points: Floats) -> Floats:
    power = np.arange(nodes.size)
    return np.asarray(
        (power * points[:, None] ** np.maximum(power - 1, 0)) @ powers(nodes)
    )


def integrals(nodes: Floats) -> Floats:
    """Integrals from 0 to each node of the polynomials that are 1 at one node and 0 at
    all others.
    """
    power = np.arange(1, nodes.size + 1)
    return np.ascontiguousarray((nodes[:, None] ** power / power) @ powers(nodes))


def radau(count: int) -> Floats:
    """Radau nodes on (0, 1]: where the Legendre polynomials of the last two orders are
    equal; the last is 1.
    """
    difference = np.zeros(count + 1)
    difference[count] = 1.0
    difference[count - 1] = -1.0
    # from numpy 2.5 on the roots are complex numbers, with imaginary parts of 0
    roots = np.real(np.polynomial.legendre.legroots(difference))
    places = np.sort(0.5 * (1.0 + roots))
    places[-1] = 1.0
    return np.asarray(places)


def gauss(count: int) -> tuple[Floats, Floats]:
    """Gauss nodes and weights on (0, 1)."""
    x, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (1.0 + x), 0.5 * weight


def lobatto(order: int) -> Floats:
    """Lobatto nodes: the ends of [0, 1], and the extremes of the Legendre polynomial of
    an order.
    """
    inner = np.polynomial.legendre.Legendre.basis(order).deriv().roots()
    return np.asarray(
        0.5 * (1.0 + np.concatenate([[-1.0], np.sort(inner.real), [1.0]]))
    )


# start and nodes of a step, as fractions of it, shape (P + 1,)
NODE = np.append(0.0, radau(P))
COLLOCATION = integrals(NODE[1:])
"""Integrals up to each node from the values at the nodes, without the start: the scheme
Radau IIA.
"""
INTEGRAL = integrals(NODE)  # the same from the values at the start and the nodes
MONOMIAL = powers(NODE)  # coefficients of the polynomial through start and nodes
SLOPES = np.ascontiguousarray(_slopes(NODE, NODE))  # slopes at start and nodes
GAUSS, WEIGHT = gauss(Q)
"""Gauss nodes and weights, shape (Q,)."""
# coefficients of the polynomial through the Gauss nodes
GAUSS_MONOMIAL = powers(GAUSS)
PART = np.stack([_values(NODE, u * GAUSS) for u in NODE[1:]])
"""Values at the Gauss nodes between the start and each node, shape (P, Q, P + 1)."""
INCREASE = np.stack(
    [_slopes(NODE, u * GAUSS) * (u * WEIGHT)[:, None] for u in NODE[1:]]
)
"""Slopes at the same points times weights: the part of an increase that belongs to each
Gauss node.
"""
_CHEBYSHEV = np.linalg.inv(np.polynomial.chebyshev.chebvander(2 * NODE - 1, P))
LAST = np.ascontiguousarray(_CHEBYSHEV[P - 2 :])
"""Coefficients of the last three Chebyshev polynomials, which show whether the
polynomial is resolved.
"""


@inlined
def dot(weights: Floats, row: Floats) -> float:
    """Sum of the products of two rows."""
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
    """Value at ``0 <= u <= 1`` of a polynomial from `fit`."""
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
    """Bracket, by bisection between two points, where a polynomial crosses a level in
    the direction of `sign`.
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
    """Value at ``0 <= u <= 1`` of the polynomial through values at start and nodes, so
    computed that the value at the start is exact.
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
    """Solve a small system in place, without pivoting, as collocation matrices are
    close to the identity or diagonal.
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
    """Value at ``0 <= u <= 1`` of the polynomial through values at start and nodes;
    `curve` is filled with its coefficients.
    """
    fit(row, curve)
    return along(curve, u)
