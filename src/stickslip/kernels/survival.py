"""A decreasing function of one variable, such as the survival of thresholds, as a table of polynomials."""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .records import Floats
from .rules import GAUSS, WEIGHT

DEGREE = 5


class Table(NamedTuple):
    """Polynomials of degree `DEGREE` on cells of one width, made by `tabulate`; a cell that holds a knot has two."""

    pieces: (
        Floats  # shape (n_cells, 2, 2 + DEGREE + 1): left end and one over the width of each piece; its coefficients
    )
    split: Floats  # shape (n_cells,): where the second piece of a cell begins; infinite if there is none
    inverse: float  # one over the width of a cell
    bottom: float  # below it the function is 1
    top: float  # from it on the function is 0
    knots: Floats  # where the slope jumps, between 0 and `top`


_NODE = 0.5 * (1.0 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1)))
_FIT = np.linalg.inv(np.vander(_NODE, increasing=True))
_CHECK = (np.arange(DEGREE) + 1.0) / (DEGREE + 1)


def tabulate(
    function: Callable[[Floats], Floats], top: float, knots: Floats, tolerance: float = 2e-13, most: int = 2**14
) -> Table:
    """Tabulate a function from 0 to `top`, in cells so narrow that it is met to the tolerance, or in the most."""
    count = 64
    while True:
        width = top / count
        left = width * np.arange(count)
        right = left + width
        split = np.full(count, np.inf)
        first = right.copy()
        for knot in knots:
            cell = min(int(knot / width), count - 1)
            if left[cell] < knot < right[cell]:
                split[cell] = first[cell] = knot
        second = np.where(np.isfinite(split), split, left)
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
    one = np.flatnonzero(function(np.asarray(left + width, float)) < function(np.zeros(1)) * (1.0 - 1e-15))
    bottom = float(left[one[0]]) if one.size else top
    return Table(pieces, split, 1.0 / width, bottom, top, np.asarray(knots, float))


@inlined
def value_and_slope(table: Table, x: float) -> tuple[float, float]:
    """Value and slope at ``x >= 0``."""
    if x >= table.top:
        return 0.0, 0.0
    i = min(int(x * table.inverse), table.split.size - 1)
    side = 1 if x >= table.split[i] else 0
    scale = table.pieces[i, side, 1]
    u = (x - table.pieces[i, side, 0]) * scale
    total, slope = table.pieces[i, side, DEGREE + 2], 0.0
    for k in range(DEGREE + 1, 1, -1):
        slope = slope * u + total
        total = total * u + table.pieces[i, side, k]
    return total, slope * scale


@inlined
def value_at(table: Table, x: float) -> float:
    """Value at ``x >= 0``."""
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


def widest(table: Table, tolerance: float, most: float, order: int) -> float:
    """Width of a window, up to `most`, of which nodes of Gauss give the mean of ``x**order`` times the function.

    To the tolerance, wherever the window lies between two knots.
    """
    edges = np.unique([0.0, *table.knots, table.top])
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


EMPTY = Table(np.zeros((1, 2, DEGREE + 3)), np.full(1, np.inf), 1.0, 0.0, 0.0, np.empty(0))  # the table of nothing
