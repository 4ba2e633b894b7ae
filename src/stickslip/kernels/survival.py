"""Tables of polynomials for a decreasing function of one variable, such as the survival
of thresholds.
"""

from bisect import bisect_left
from collections.abc import Callable
from itertools import pairwise
from math import comb
from typing import NamedTuple

import numpy as np

from ._jit import inlined, jit
from .quadrature import GAUSS, WEIGHT
from .records import Floats

DEGREE = 5
_POWERS = range(DEGREE + 1)
GONE = 1e-13  # fractions of contacts below this are taken as 0


class SurvivalTable(NamedTuple):
    """Polynomials of degree `DEGREE` on cells of equal width, made by `tabulate`; a
    cell that contains a knot has two.
    """

    pieces: Floats
    """Shape (2 n_cells, 2 + DEGREE + 1), a row per piece: its left end (infinite if the
    cell has no second piece), one over its width, its coefficients.
    """
    inverse: float  # one over the width of a cell
    bottom: float  # below it the function is 1
    low: float  # left end of the table; the function is constant below it
    top: float  # the function is 0 from here on


_NODE = 0.5 * (1.0 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1)))
_FIT = np.linalg.inv(np.vander(_NODE, increasing=True))
# places between the nodes, where errors are largest
_CHECK = 0.5 * (1.0 - np.cos(np.pi * (np.arange(DEGREE) + 1.0) / (DEGREE + 1)))
_HALF = np.array(
    [
        [
            [comb(k, j) * half ** max(k - j, 0) / 2.0**k for j in _POWERS]
            for k in _POWERS
        ]
        for half in (0, 1)
    ]
)
"""Matrices that turn the coefficients on a cell into those on its two halves."""


def tabulate(
    function: Callable[[Floats], Floats],
    top: float,
    knots: Floats,
    tolerance: float = 2e-13,
    most: int = 2**14,
    low: float = 0.0,
) -> SurvivalTable:
    """Tabulate a function from `low` to `top`, in cells narrow enough for the
    tolerance, or in the `most` cells.

    Where a cell is accurate enough, its halves keep its polynomial.
    """
    pieces = np.zeros((128, DEGREE + 3))
    rough = np.arange(64)
    check = np.vander(_CHECK, DEGREE + 1, increasing=True).T
    # ends: the number of cells doubles in each turn, up to the most
    while True:
        count = len(pieces) // 2
        width = (top - low) / count
        left = low + width * rough
        right = left + width
        inner = right.copy()
        for knot in knots:
            inner[(left < knot) & (knot < right)] = knot
        cut = inner < right
        a = np.append(left, inner[cut])[:, None]
        b = np.append(inner, right[cut])[:, None]
        fitted = function(a + (b - a) * _NODE) @ _FIT.T
        missed = (
            np.abs(fitted @ check - function(a + (b - a) * _CHECK)).max(axis=1)
            >= tolerance
        )
        place = np.append(2 * rough, 2 * rough[cut] + 1)
        pieces[2 * rough + 1, 0] = np.inf
        pieces[place] = np.hstack([a, 1.0 / (b - a), fitted])
        if not missed.any() or 2 * count > most:
            break
        again = np.unique(np.append(place[missed] // 2, rough[cut]))
        halves = np.full((count, 2, 2, DEGREE + 3), np.inf)
        halves[..., 0, 0] = low + 0.5 * width * np.arange(2 * count).reshape(count, 2)
        halves[..., 0, 1] = 2.0 / width
        halves[..., 0, 2:] = np.einsum("ck,hkj->chj", pieces[::2, 2:], _HALF)
        pieces = halves.reshape(4 * count, -1)
        rough = np.append(2 * again, 2 * again + 1)
    whole = function(np.full(1, low)) * (1.0 - 1e-15)
    full = bisect_left(
        range(count),
        True,
        key=lambda i: bool(function(np.full(1, low + width * (i + 1.0))) < whole),
    )
    return SurvivalTable(
        pieces,
        1.0 / width,
        low + width * full,
        low,
        top,
    )


@inlined
def value_and_slope(table: SurvivalTable, x: float) -> tuple[float, float]:
    """Return value and slope of the function."""
    if x >= table.top:
        return 0.0, 0.0
    x = max(x, table.low)
    i = 2 * min(int((x - table.low) * table.inverse), table.pieces.shape[0] // 2 - 1)
    if x >= table.pieces[i + 1, 0]:
        i += 1
    scale = table.pieces[i, 1]
    u = (x - table.pieces[i, 0]) * scale
    total = table.pieces[i, DEGREE + 2]
    slope = 0.0
    for k in range(DEGREE + 1, 1, -1):
        slope = slope * u + total
        total = total * u + table.pieces[i, k]
    return total, slope * scale


@inlined
def value_at(table: SurvivalTable, x: float) -> float:
    """Return the value of the function."""
    return value_and_slope(table, x)[0]


@jit
def values_at(table: SurvivalTable, x: Floats) -> Floats:
    """Return the values of the function at many places."""
    values = np.empty(x.size)
    for i in range(x.size):
        values[i] = value_at(table, x[i])
    return values


def widest(
    table: SurvivalTable,
    knots: Floats,
    tolerance: float,
    most: float,
    order: int,
) -> float:
    """Return the width of a window, up to `most`, in which Gauss nodes give the mean of
    ``x**order`` times the function to the tolerance, wherever the window lies between
    two knots.
    """
    edges = np.unique([0.0, *knots, table.top])
    width = min(most, 0.5 * table.top)
    fine = (np.arange(8)[:, None] + GAUSS).ravel() / 8
    weights = np.tile(WEIGHT / 8, 8)
    # ends: the width shrinks by a tenth in each turn
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
                sums.append(
                    (x**order * values_at(table, x.ravel()).reshape(x.shape)) @ weight
                )
            worst = max(worst, float(np.abs(sums[0] - sums[1]).max()))
        if worst <= tolerance or width < 1e-4 * most:
            return width
        width *= 0.9


EMPTY = SurvivalTable(
    np.zeros((2, DEGREE + 3)),
    1.0,
    0.0,
    0.0,
    0.0,
)  # a table of the function 0


@inlined
def drawn(rng: np.random.Generator, count: float, held: float) -> float:
    """Draw how many of `count` contacts break, each holding with probability `held`."""
    if held >= 1.0 - GONE or count == 0.0:  # differs from certainty by rounding only
        return 0.0
    if held <= 0.0:
        return count
    return float(rng.binomial(np.int64(count), 1.0 - held))
