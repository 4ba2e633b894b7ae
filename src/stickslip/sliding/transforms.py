"""What a distribution of thresholds contributes to the linear response, without cancellation and in tables."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from stickslip.errors import UndecidedError
from stickslip.model.distributions import Distribution
from stickslip.model.quadrature import hashable
from stickslip.sliding.response import Array, ComplexArray


class Axis(NamedTuple):
    """What a distribution contributes on the imaginary axis ``q = i y``, whatever the delay and the speed."""

    y: Array
    complement: ComplexArray
    """``1 - P^``."""
    shape: ComplexArray
    """``H = q h(q)``."""
    centre: ComplexArray
    """Centre of the disc that holds ``kappa`` times ``m1 + v <tau>``, for any delay and no sliding force."""
    loss: Array
    """``|1 - P^|^2/(1 - |P^|^2)``: what a unit of sliding force adds to the centre."""


@lru_cache(maxsize=32)
def axis_table(distribution: Distribution, step: float, count: int) -> Axis:
    """Table at `count` equal steps, and below the first one."""
    # Below the first step frequencies are spaced in proportion: slow modes of soft springs.
    slow = step * np.geomspace(1e-4, 1.0, 40, endpoint=False)
    y = np.concatenate([slow, step * np.arange(1, count + 1)])
    complement, shape = transforms(distribution, 1j * y)
    # 1 - |P^|^2 = 2 Re(1 - P^) - |1 - P^|^2
    room = 2 * complement.real - np.abs(complement) ** 2
    if np.any(room <= 0):
        raise UndecidedError(
            f"the thresholds ({distribution}) are so close together that the response cannot be told from one without "
            "memory loss in double precision; give them more standard deviation"
        )
    return Axis(
        y=y,
        complement=complement,
        shape=shape,
        centre=-shape * np.conj(complement) / room,
        loss=np.abs(complement) ** 2 / room,
    )


def transforms(distribution: Distribution, q: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return ``1 - P^(q)`` and ``H(q) = q h(q) = (1 - P^)/q + P^'``, by series in the moments where `q` is small."""
    radius, a, b = _series(hashable(distribution))
    q = np.asarray(q, dtype=complex)
    small = np.abs(q) < radius
    if not small.any():
        return _outer(distribution, q)
    complement, shape = np.empty_like(q), np.empty_like(q)
    inner = q[small]
    complement[small] = inner * np.polynomial.polynomial.polyval(inner, a)
    shape[small] = inner * np.polynomial.polynomial.polyval(inner, b)
    if not small.all():
        complement[~small], shape[~small] = _outer(distribution, q[~small])
    return complement, shape


def _outer(distribution: Distribution, q: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    mean, slope = distribution.transform(np.asarray(q, dtype=np.complex128))
    return 1.0 - mean, (1.0 - mean) / q - slope


@lru_cache(maxsize=256)
def _series(distribution: Distribution) -> tuple[float, Array, Array]:
    """Radius within which the series hold to 1e-15, and the coefficients of ``(1 - P^)/q`` and ``H/q``."""
    moments = np.array([distribution.moment(n) for n in range(21)])
    factorial = np.cumprod(np.concatenate([[1.0], np.arange(1.0, 21.0)]))
    n = np.arange(19)
    signs = (-1.0) ** n
    first, second = (
        signs * moments[1:20] / factorial[1:20],
        signs * moments[2:21] / (factorial[:19] * (n + 2)),
    )
    best, terms = 0.0, 2
    with np.errstate(all="ignore"):
        for count in range(3, 19):
            ratio = max(abs(first[count] / first[0]), abs(second[count] / second[0]))
            radius = float((1e-15 / ratio) ** (1.0 / count)) if math.isfinite(ratio) else 0.0
            if radius > best:
                best, terms = radius, count
    # A tenth of the width of the distribution: beyond it the closed form loses nothing.
    return min(best, 0.5 / moments[1]), first[:terms], second[:terms]
