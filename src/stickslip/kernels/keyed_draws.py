"""Random numbers that are a function of a contact and the number of its life, whatever
the order in which they are drawn.

Uniform numbers are those of Threefry-2x32 with 20 rounds (Salmon et al., "Parallel
random numbers: as easy as 1, 2, 3", SC 2011): it hashes a key and a counter by sums,
rotations and exclusive ors of 32-bit words. The words are kept in 64 bits, so that
plain Python computes the same numbers. Other distributions follow through a table of
their quantiles.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .records import Counts, Floats

_WORD = 0xFFFFFFFF
_PARITY = 0x1BD11BDA  # of the key schedule
_TURNS = ((17, 29, 16, 24), (13, 15, 26, 6))

_DEGREE = 7
# on a piece from -1 to 1: on one from 0 to 1 the fit would lose three more digits
_NODE = -np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
_FIT = np.linalg.inv(np.vander(_NODE, increasing=True))
_CHECK = -np.cos(np.pi * (np.arange(_DEGREE) + 1.0) / (_DEGREE + 1))
_AT_CHECK = np.vander(_CHECK, _DEGREE + 1, increasing=True).T
# the largest error over the size of the value, and how often a piece is halved for it
_TOLERANCE, _HALVED = 1e-13, 7
_NARROW = 1e-14  # pieces narrower than this are lost in the rounding of probabilities
_LAST = 1.0 - 2.0**-53


class Quantiles(NamedTuple):
    """Quantiles of several distributions ("kinds"): polynomials on pieces of the
    probability.

    The pieces of kind ``j`` are those from ``first[j]`` to ``first[j + 1]``. `edges`
    are their left ends; a row of `pieces`, shape (n, 9), holds one over half the width
    and the coefficients.
    """

    first: Counts
    edges: Floats
    pieces: Floats


class Portion(NamedTuple):
    """One distribution of a mixture: its `weight`, its `value` as a function of the
    probability `p` with which it is exceeded, and the probabilities at which that
    function jumps or bends.
    """

    weight: float
    value: Callable[[Floats], Floats]
    knots: Floats = np.empty(0)


def tabulate_quantiles(kinds: list[list[Portion]]) -> Quantiles:
    """Tabulate mixtures of distributions, one for each kind."""
    octaves = 0.5 ** np.arange(1, 53)
    ends = np.concatenate([[0.0, 1.0], octaves, 1.0 - octaves])
    first = [0]
    edges = list[Floats]()
    pieces = list[Floats]()
    for portions in kinds:
        below = 0.0
        for weight, value, knots in portions:
            left, found = _tabulated(value, np.unique(np.append(ends, knots)))
            found[:, 0] /= weight
            edges.append(below + weight * left)
            pieces.append(found)
            below += weight
        first.append(sum(map(len, edges)))
    return Quantiles(np.array(first), np.concatenate(edges), np.concatenate(pieces))


def _tabulated(
    value: Callable[[Floats], Floats], ends: Floats
) -> tuple[Floats, Floats]:
    """Return the left ends of the pieces, halved where needed, and the pieces."""
    left = ends[:-1]
    right = ends[1:]
    done = list[tuple[Floats, Floats]]()
    usual = abs(float(value(np.full(1, 0.5))[0]))
    for turn in range(_HALVED + 1):
        half = 0.5 * (right - left)[:, None]
        middle = 0.5 * (right + left)[:, None]
        values = value(np.minimum(middle + half * _NODE, _LAST))
        still = np.ptp(values, axis=1) == 0.0  # constant, also where it is infinite
        fitted = np.zeros_like(values)
        fitted[still, 0] = values[still, 0]
        fitted[~still] = values[~still] @ _FIT.T
        right_values = value(np.minimum(middle + half * _CHECK, _LAST))
        size = np.abs(values).max(axis=1) + usual
        missed = np.abs(fitted @ _AT_CHECK - right_values).max(axis=1)
        rough = ~still & (missed > _TOLERANCE * size)
        rough &= (2.0 * half[:, 0] > _NARROW) & (turn < _HALVED)
        done.append((left[~rough], np.hstack([1.0 / half, fitted])[~rough]))
        between = middle[rough, 0]
        left, right = (
            np.append(left[rough], between),
            np.append(between, right[rough]),
        )
        if not left.size:
            break
    edges, pieces = (np.concatenate(each) for each in zip(*done, strict=True))
    order = np.argsort(edges)
    return edges[order], pieces[order]


@bare
def quantile(table: Quantiles, kind: int, p: float) -> float:
    """Return the value of a kind that is exceeded with the probability `p`."""
    low = table.first[kind]
    high = table.first[kind + 1]
    # ends: the pieces looked at become half as many in each turn
    while high - low > 1:
        middle = (low + high) // 2
        if table.edges[middle] <= p:
            low = middle
        else:
            high = middle
    u = (p - table.edges[low]) * table.pieces[low, 0] - 1.0
    total = table.pieces[low, _DEGREE + 1]
    for k in range(_DEGREE, 0, -1):
        total = total * u + table.pieces[low, k]
    return float(total)


@bare
def threefry(key: tuple[int, int], counter: tuple[int, int]) -> tuple[int, int]:
    """Hash a counter of two 32-bit words to two other words."""
    low, high = key
    third = _PARITY ^ low ^ high
    a = (counter[0] + low) & _WORD
    b = (counter[1] + high) & _WORD
    for group in range(1, 6):
        for by in _TURNS[group % 2]:
            a = (a + b) & _WORD
            b = (((b << by) | (b >> (32 - by))) & _WORD) ^ a
        a = (a + high) & _WORD
        b = (b + third + group) & _WORD
        low, high, third = high, third, low
    return a, b


@inlined
def uniform(key: tuple[int, int], counter: tuple[int, int]) -> float:
    """Return a uniform number of 53 bits, above 0 and below 1."""
    a, b = threefry(key, counter)
    return float(((a << 20) | (b >> 12)) + 0.5) * 2.0**-52
