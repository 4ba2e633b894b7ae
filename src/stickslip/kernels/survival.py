"""A decreasing function of one variable, such as the survival of thresholds, as a table of polynomials."""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .records import Floats
from .rules import GAUSS, WEIGHT

DEGREE = 5
GONE = 1e-13  # fraction of contacts so small that none of them is left


class Table(NamedTuple):
    """Polynomials of degree `DEGREE` on cells of one width, made by `tabulate`; a cell that holds a knot has two."""

    pieces: Floats
    """Shape (2 n_cells, 2 + DEGREE + 1): left end of each piece, infinite if there is no second; one over its width;
    its coefficients."""
    inverse: float  # one over the width of a cell
    bottom: float  # below it the function is 1
    low: float  # where it begins: below it is what it is there
    top: float  # from it on the function is 0


_NODE = 0.5 * (1.0 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1)))
_FIT = np.linalg.inv(np.vander(_NODE, increasing=True))
_CHECK = (np.arange(DEGREE) + 1.0) / (DEGREE + 1)


def tabulate(
    function: Callable[[Floats], Floats],
    top: float,
    knots: Floats,
    tolerance: float = 2e-13,
    most: int = 2**14,
    low: float = 0.0,
) -> Table:
    """Tabulate a function from `low` to `top`, in cells so narrow that it is met to the tolerance, or in the most."""
    count = 64
    while True:
        width = (top - low) / count
        left = low + width * np.arange(count)
        right = left + width
        first, second = right.copy(), left.copy()
        for knot in knots:
            cell = min(int((knot - low) / width), count - 1)
            if left[cell] < knot < right[cell]:
                first[cell] = second[cell] = knot
        pieces = np.zeros((count, 2, DEGREE + 3))
        worst = 0.0
        for side, (a, b) in enumerate(((left, first), (second, right))):
            x = a[:, None] + (b - a)[:, None] * _NODE
            pieces[:, side, 0], pieces[:, side, 1] = a, 1.0 / (b - a)
            pieces[:, side, 2:] = function(x) @ _FIT.T
            fitted = pieces[:, side, 2:] @ np.vander(_CHECK, DEGREE + 1, increasing=True).T
            worst = max(
                worst, np.abs(fitted - function(np.asarray(a[:, None] + (b - a)[:, None] * _CHECK, float))).max()
            )
        if worst < tolerance or 2 * count > most:
            break
        count *= 2
    one = np.flatnonzero(function(np.asarray(left + width, float)) < function(np.full(1, low)) * (1.0 - 1e-15))
    bottom = float(left[one[0]]) if one.size else top
    pieces[second == left, 1, 0] = np.inf
    return Table(pieces.reshape(2 * count, -1), 1.0 / width, bottom, low, top)


@inlined
def value_and_slope(table: Table, x: float) -> tuple[float, float]:
    """Value and slope."""
    if x >= table.top:
        return 0.0, 0.0
    x = max(x, table.low)
    i = 2 * min(int((x - table.low) * table.inverse), table.pieces.shape[0] // 2 - 1)
    if x >= table.pieces[i + 1, 0]:
        i += 1
    scale = table.pieces[i, 1]
    u = (x - table.pieces[i, 0]) * scale
    total, slope = table.pieces[i, DEGREE + 2], 0.0
    for k in range(DEGREE + 1, 1, -1):
        slope = slope * u + total
        total = total * u + table.pieces[i, k]
    return total, slope * scale


@inlined
def value_at(table: Table, x: float) -> float:
    """Value alone."""
    return value_and_slope(table, x)[0]


@bare
def _fill(table: Table, x: Floats, values: Floats) -> None:
    for i in range(x.size):
        values[i] = value_at(table, x[i])


def values_at(table: Table, x: Floats) -> Floats:
    """Values at many places."""
    values = np.empty(x.size)
    _fill(table, x, values)
    return values


def widest(table: Table, knots: Floats, tolerance: float, most: float, order: int) -> float:
    """Width of a window, up to `most`, of which nodes of Gauss give the mean of ``x**order`` times the function.

    To the tolerance, wherever the window lies between two knots.
    """
    edges = np.unique([0.0, *knots, table.top])
    width = min(most, 0.5 * table.top)
    fine = (np.arange(8)[:, None] + GAUSS).ravel() / 8
    weights = np.tile(WEIGHT / 8, 8)
    while True:
        worst = 0.0
        for low, high in pairwise(edges.tolist()):
            if high - low < 1e-6 * width:
                continue
            size = min(width, 0.999 * (high - low))
            start = np.linspace(low, high - size, 64)[:, None]
            sums = []
            for node, weight in ((GAUSS, WEIGHT), (fine, weights)):
                x = start + size * node
                sums.append((x**order * values_at(table, x.ravel()).reshape(x.shape)) @ weight)
            worst = max(worst, float(np.abs(sums[0] - sums[1]).max()))
        if worst <= tolerance or width < 1e-4 * most:
            return width
        width *= 0.9


EMPTY = Table(np.zeros((2, DEGREE + 3)), 1.0, 0.0, 0.0, 0.0)  # the table of nothing


@inlined
def drawn(rng: np.random.Generator, count: float, held: float) -> float:
    """How many of a number break if each holds with a probability."""
    if held >= 1.0 - GONE or count == 0.0:  # rounding draws no number
        return 0.0
    if held <= 0.0:
        return count
    return float(rng.binomial(np.int64(count), 1.0 - held))
