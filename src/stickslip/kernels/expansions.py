"""Exponential and logarithm by their expansions: of small arguments, in a third of the time of the library's."""

import math

from ._jit import inlined


@inlined
def expm1(u: float) -> float:
    """``exp(u) - 1`` for ``|u| <= 1/4``, to 3e-13: pairs of terms side by side, none waits for another."""
    u2 = u * u
    u4 = u2 * u2
    low = (1.0 + u * (1 / 2)) + u2 * ((1 / 6) + u * (1 / 24))
    high = ((1 / 120) + u * (1 / 720)) + u2 * ((1 / 5040) + u * (1 / 40320))
    return u * (low + u4 * (high + u4 * (1 / 362880)))


@inlined
def grown_by(u: float) -> float:
    """``exp(u) - 1`` of any argument; beyond 300, as large."""
    return expm1(u) if abs(u) < 0.25 else math.expm1(min(u, 300.0))


@inlined
def log1p(run: float) -> float:
    """``ln(1 + run)``."""
    if not abs(run) < 0.1:
        return math.log1p(run)
    s = run / (2.0 + run)
    s2 = s * s
    return 2.0 * s * (1.0 + s2 * ((1 / 3 + s2 * (1 / 5)) + s2 * s2 * ((1 / 7 + s2 * (1 / 9)) + s2 * s2 * (1 / 11))))
