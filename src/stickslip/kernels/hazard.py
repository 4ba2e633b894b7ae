"""How contacts come to break: rates of thermal activation, and thresholds that grow
with age by a fixed rule.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import inlined, jit

BELL, PARABOLIC, BARRIER = range(3)

TOP = 1e-9
"""Nearest to the top of a barrier, over the threshold: there the slope of Kramers'
prefactor grows beyond bounds.
"""


class Hazard(NamedTuple):
    """Kind of barrier, attempt rate, and its numbers.

    `BELL`: `scale` is the width. `PARABOLIC`: the temperature. `BARRIER`: the height;
    with `power`, and `kramers` 1 for Kramers' prefactor, else 0.
    """

    kind: int
    attempts: float
    scale: float
    power: float
    kramers: float


NONE = Hazard(BELL, 0.0, 1.0, 1.0, 0.0)  # no temperature: it is never tried


@inlined
def log_rate(hazard: Hazard, x: float, threshold: float) -> tuple[float, float, float]:
    """Logarithm of the rate over the attempts; its derivatives in the stretching
    ``x >= 0`` and in the threshold.
    """
    scale = hazard.scale
    if hazard.kind == BELL:
        return (x - threshold) / scale, 1.0 / scale, -1.0 / scale
    if hazard.kind == PARABOLIC:
        return (
            0.5 * (x - threshold) * (x + threshold) / scale,
            x / scale,
            -threshold / scale,
        )
    left = max(1.0 - x / threshold, TOP)
    p = hazard.power
    log_left = math.log(left)
    height = scale * math.exp(p * log_left)  # half the time of a power
    exponent = -height
    along = p * height / (left * threshold)
    if hazard.kramers != 0.0 and p > 1.0:
        exponent += (p - 1.0) * log_left
        along -= (p - 1.0) / (threshold * left)
    return exponent, along, -along * x / threshold


@inlined
def rate(hazard: Hazard, x: float, threshold: float) -> float:
    """Rate at which a contact breaks that is stretched by ``x`` of either sign,
    within its threshold.
    """
    return hazard.attempts * math.exp(log_rate(hazard, abs(x), threshold)[0])


@inlined
def largest_rate(hazard: Hazard, x: float, threshold: float) -> float:
    """Largest rate of contacts stretched by no more than ``x`` on thresholds of at
    least `threshold`.
    """
    exponent, along, _ = log_rate(hazard, x, threshold)
    # with Kramers' prefactor the rate falls again on the last bit of the way
    if along < 0.0:
        top = ((hazard.power - 1.0) / (hazard.power * hazard.scale)) ** (
            1.0 / hazard.power
        )
        exponent = log_rate(hazard, threshold * (1.0 - min(top, 1.0)), threshold)[0]
    return hazard.attempts * math.exp(exponent)


@inlined
def height(hazard: Hazard, x: float, threshold: float) -> float:
    """Height of the barrier that is left, over the temperature, of a contact
    stretched by ``x >= 0``.
    """
    if hazard.kind == BELL:
        return (threshold - x) / hazard.scale
    if hazard.kind == PARABOLIC:
        return 0.5 * (threshold - x) * (threshold + x) / hazard.scale
    return hazard.scale * math.exp(
        hazard.power * math.log(max(1.0 - x / threshold, TOP))
    )


@inlined
def stretching_at(hazard: Hazard, height: float, threshold: float) -> float:
    """Stretching at which so much is left of the barrier; below 0 if it never is as
    high.
    """
    if hazard.kind == BELL:
        return threshold - hazard.scale * height
    if hazard.kind == PARABOLIC:
        return math.sqrt(max(threshold * threshold - 2.0 * hazard.scale * height, 0.0))
    return threshold * (
        1.0 - math.exp(math.log(max(height, 1e-300) / hazard.scale) / hazard.power)
    )


EXPONENTIAL, LOGARITHMIC = range(2)


class Growth(NamedTuple):
    """How thresholds grow with age.

    `kind` `EXPONENTIAL`: from a newborn's threshold to the strength,
    ``f = s - (s - second) exp(-first age)``; `LOGARITHMIC`: from the strength,
    ``f = s + first ln(1 + age/second)``. With `first` 0 thresholds do not grow.
    """

    kind: int
    first: float
    second: float


FIXED = Growth(LOGARITHMIC, 0.0, 1.0)  # thresholds that do not grow


@jit
def grown(growth: Growth, age: float) -> tuple[float, float, float, float]:
    """Factor and addend of a growing threshold,
    ``f(age) = strength factor + addend``, and the slopes of the two.
    """
    if growth.kind == EXPONENTIAL:
        old = -np.expm1(-growth.first * age)
        young = 1.0 - old
        return (
            old,
            growth.second * young,
            growth.first * young,
            -growth.first * growth.second * young,
        )
    if growth.first == 0.0:
        return 1.0, 0.0, 0.0, 0.0
    return (
        1.0,
        growth.first * np.log1p(age / growth.second),
        0.0,
        growth.first / (growth.second + age),
    )


@inlined
def threshold_at(growth: Growth, strength: float, age: float) -> float:
    """Threshold of a contact of this strength and age."""
    factor, addend, _, _ = grown(growth, age)
    return float(strength * factor + addend)


@inlined
def ageing_time(growth: Growth, age: float) -> float:
    """Time in which a threshold does not grow much more."""
    if growth.kind == EXPONENTIAL:
        return 0.25 / growth.first
    return math.inf if growth.first == 0.0 else age + growth.second
