"""Thresholds that grow with the age of a contact by a fixed rule."""

import math
from typing import NamedTuple

import numpy as np

from ._jit import inlined, jit

EXPONENTIAL = 0
LOGARITHMIC = 1


class Growth(NamedTuple):
    """How thresholds grow with age.

    `kind` `EXPONENTIAL`: from a newborn's threshold to the strength, ``f = s - (s - second) exp(-first age)``;
    `LOGARITHMIC`: from the strength, ``f = s + first ln(1 + age/second)``. With `first` 0 thresholds do not grow.
    """

    kind: int
    first: float
    second: float


FIXED = Growth(LOGARITHMIC, 0.0, 1.0)
"""Thresholds that do not grow."""


@jit
def grown(growth: Growth, age: float) -> tuple[float, float, float, float]:
    """Factor and addend of a growing threshold, ``f(age) = strength factor + addend``, and the slopes of the two."""
    if growth.kind == EXPONENTIAL:
        old = -np.expm1(-growth.first * age)
        young = 1.0 - old
        return old, growth.second * young, growth.first * young, -growth.first * growth.second * young
    return 1.0, growth.first * np.log1p(age / growth.second), 0.0, growth.first / (growth.second + age)


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
