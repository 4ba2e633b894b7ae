"""Rates at which contacts break by thermal activation."""

import math
from typing import NamedTuple

from ._jit import inlined

BELL, PARABOLIC, BARRIER = range(3)

TOP = 1e-9
"""Nearest to the top of a barrier, over the threshold: there the slope of Kramers' prefactor grows beyond bounds."""


class Hazard(NamedTuple):
    """Kind of barrier, attempt rate, and its numbers.

    `BELL`: `scale` is the width. `PARABOLIC`: the temperature. `BARRIER`: the height; with `power`, and `kramers` 1 for
    Kramers' prefactor, else 0.
    """

    kind: int
    attempts: float
    scale: float
    power: float
    kramers: float


NONE = Hazard(BELL, 0.0, 1.0, 1.0, 0.0)
"""No temperature: it is never tried."""


@inlined
def log_rate(hazard: Hazard, x: float, threshold: float) -> tuple[float, float, float]:
    """Logarithm of the rate over the attempts; its derivatives in the stretching ``x >= 0`` and in the threshold."""
    scale = hazard.scale
    if hazard.kind == BELL:
        return (x - threshold) / scale, 1.0 / scale, -1.0 / scale
    if hazard.kind == PARABOLIC:
        return 0.5 * (x - threshold) * (x + threshold) / scale, x / scale, -threshold / scale
    left, p = max(1.0 - x / threshold, TOP), hazard.power
    along = scale * p * left ** (p - 1.0) / threshold
    exponent = -scale * left**p
    if hazard.kramers != 0.0 and p > 1.0:
        exponent += (p - 1.0) * math.log(left)
        along -= (p - 1.0) / (threshold * left)
    return exponent, along, -along * x / threshold


@inlined
def rate(hazard: Hazard, x: float, threshold: float) -> float:
    """Rate at which a contact breaks that is stretched by ``x`` of either sign, within its threshold."""
    return hazard.attempts * math.exp(log_rate(hazard, abs(x), threshold)[0])


@inlined
def largest_rate(hazard: Hazard, x: float, threshold: float) -> float:
    """Largest rate of contacts stretched by no more than ``x`` on thresholds of at least `threshold`."""
    if hazard.kind == BARRIER and hazard.kramers != 0.0:
        # With the prefactor the rate falls again on the last bit of the way.
        top = ((hazard.power - 1.0) / (hazard.power * hazard.scale)) ** (1.0 / hazard.power)
        return rate(hazard, min(x, threshold * (1.0 - min(top, 1.0))), threshold)
    return rate(hazard, x, threshold)


@inlined
def steepness(hazard: Hazard, x: float, threshold: float) -> float:
    """Length over which the rate grows by a factor of e, about."""
    x = abs(x)
    if hazard.kind == BELL:
        return hazard.scale
    if hazard.kind == PARABOLIC:
        return hazard.scale / max(x, math.sqrt(hazard.scale))
    left = max(1.0 - x / threshold, (1.0 / hazard.scale) ** (1.0 / hazard.power))
    return float(threshold / (hazard.scale * hazard.power * left ** (hazard.power - 1.0)))
