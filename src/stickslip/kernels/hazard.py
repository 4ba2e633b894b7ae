"""Rates of thermally activated breaking, and thresholds that grow with age by a fixed
rule.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .records import Floats

BELL, PARABOLIC, BARRIER = range(3)

TOP = 1e-9
"""Smallest distance to the top of a barrier, over the threshold: there the slope of
Kramers' prefactor diverges.
"""


class Hazard(NamedTuple):
    """Kind of barrier, attempt rate, and its parameters.

    `BELL`: `width` is the activation width; `PARABOLIC`: the temperature. `BARRIER` has
    a `height` over the temperature, a `power`, and `kramers`: 1 for Kramers' prefactor,
    else 0. Only the functions of this file depend on the kind: another barrier adds one
    case to each.
    """

    kind: int
    attempts: float
    width: float
    height: float
    power: float
    kramers: float


NONE = Hazard(BELL, 0.0, 1.0, 1.0, 1.0, 0.0)  # no temperature: no attempts


@inlined
def is_exponential(hazard: Hazard) -> bool:
    """Return whether the rates of two contacts differ by a factor that does not depend
    on their common stretching: Bell's rate.
    """
    return hazard.kind == BELL and hazard.attempts > 0.0


@inlined
def log_rate(hazard: Hazard, x: float, threshold: float) -> tuple[float, float, float]:
    """Return the logarithm of the rate over the attempt rate, and its derivatives in
    the stretching ``x >= 0`` and in the threshold.
    """
    width = hazard.width
    if hazard.kind == BELL:
        return (x - threshold) / width, 1.0 / width, -1.0 / width
    if hazard.kind == PARABOLIC:
        exponent = 0.5 * (x - threshold) * (x + threshold) / width
        return exponent, x / width, -threshold / width
    left = max(1.0 - x / threshold, TOP)
    p = hazard.power
    log_left = math.log(left)
    height = hazard.height * math.exp(p * log_left)  # twice as fast as `**`
    exponent = -height
    along = p * height / (left * threshold)
    if hazard.kramers != 0.0 and p > 1.0:
        exponent += (p - 1.0) * log_left
        along -= (p - 1.0) / (threshold * left)
    return exponent, along, -along * x / threshold


@inlined
def rate(hazard: Hazard, x: float, threshold: float) -> float:
    """Return the rate at which a contact breaks whose stretching ``x``, of either sign,
    is within its threshold.
    """
    return hazard.attempts * math.exp(log_rate(hazard, abs(x), threshold)[0])


@inlined
def largest_rate(hazard: Hazard, x: float, threshold: float) -> float:
    """Return the largest rate of contacts stretched by no more than ``x`` with
    thresholds of at least `threshold`.
    """
    exponent, along, _ = log_rate(hazard, x, threshold)
    # with Kramers' prefactor the rate falls again just below the threshold
    if along < 0.0:
        part = (hazard.power - 1.0) / (hazard.power * hazard.height)
        top = part ** (1.0 / hazard.power)
        exponent = log_rate(hazard, threshold * (1.0 - min(top, 1.0)), threshold)[0]
    return hazard.attempts * math.exp(exponent)


@inlined
def height(hazard: Hazard, x: float, threshold: float) -> float:
    """Return the remaining height of the barrier, over the temperature, of a contact
    stretched by ``x >= 0``.
    """
    if hazard.kind == BELL:
        return (threshold - x) / hazard.width
    if hazard.kind == PARABOLIC:
        return 0.5 * (threshold - x) * (threshold + x) / hazard.width
    log_left = math.log(max(1.0 - x / threshold, TOP))
    return hazard.height * math.exp(hazard.power * log_left)


@inlined
def stretching_at(hazard: Hazard, height: float, threshold: float) -> float:
    """Return the stretching at which the barrier has this `height` left; below 0 if it
    is never so high.
    """
    if hazard.kind == BELL:
        return threshold - hazard.width * height
    if hazard.kind == PARABOLIC:
        return math.sqrt(max(threshold * threshold - 2.0 * hazard.width * height, 0.0))
    log_part = math.log(max(height, 1e-300) / hazard.height)
    return threshold * (1.0 - math.exp(log_part / hazard.power))


@inlined
def steepest(hazard: Hazard, x: float, threshold: float) -> float:
    """Return a bound on the slope of the logarithm of the rate in the stretching, up to
    ``x``, for thresholds of at least `threshold`.
    """
    if hazard.kind == BELL:
        return 1.0 / hazard.width
    if hazard.kind == PARABOLIC:
        return x / hazard.width
    return hazard.height * hazard.power / threshold


@inlined
def longest_fold(
    hazard: Hazard,
    folds: float,
    x: float,
    end: float,
    threshold: float,
) -> float:
    """Return a bound on the distance in which the rate grows by a number of `folds`
    (powers of e) where its logarithm is not linear; infinite for Bell's rate.

    The contact is stretched by ``x`` and meets its threshold at `end`; its present
    threshold is `threshold`.
    """
    if hazard.kind == BELL:
        return math.inf
    if hazard.kind == PARABOLIC:
        return folds / (x / hazard.width + 1.0 / math.sqrt(hazard.width))
    fine = 0.5 * (threshold - x) + 1e-3 * end / hazard.height
    if hazard.kramers != 0.0:
        fine = min(fine, 0.5 * (end - x) + 10.0 * TOP * end)
    return fine


def taken_off(hazard: Hazard, x: Floats) -> tuple[Floats, Floats]:
    """Return by how much a stretching lowers a barrier, in units of its width: the
    slope, and the amount itself.
    """
    return (x, 0.5 * x**2) if hazard.kind == PARABOLIC else (np.ones_like(x), x)


def stretching_with(hazard: Hazard, taken: Floats, least: Floats) -> Floats:
    """Return the stretching that lowers a barrier by an amount; `least` where that is
    0 or less.
    """
    if hazard.kind != PARABOLIC:
        return taken
    return np.sqrt(np.maximum(2.0 * taken, least**2))


EXPONENTIAL, LOGARITHMIC, TABULATED = range(3)
LOG_AGE, LOG_FACTOR, POWER, LOWEST = range(4)
"""Rows of a table of growth, one column per node: the logarithm of the age, that of the
factor there, the slope of the second in the first, and the lowest factor of all later
nodes.
"""
_AT_NODE = 1e-9  # fraction of an age within which a node counts as passed
_NO_TABLE = np.empty((4, 0))


class Growth(NamedTuple):
    """How thresholds grow with age.

    `kind` `EXPONENTIAL`: from a newborn's threshold to the strength,
    ``f = s - (s - second) exp(-first age)``; `LOGARITHMIC`: from the strength,
    ``f = s + first ln(1 + age/second)``; `TABULATED`: ``f = s g(age)`` by the `table`,
    between the ages `second` and `first`, constant beyond. With `first` 0 thresholds do
    not grow.
    """

    kind: int
    first: float
    second: float
    table: Floats = _NO_TABLE


FIXED = Growth(LOGARITHMIC, 0.0, 1.0)  # thresholds that do not grow


@inlined
def _node_before(table: Floats, log_age: float) -> int:
    """Return the last node of a table that is not older than an age; -1 if all are."""
    low = -1
    high = table.shape[1]
    # ends: the interval between the two is halved in each turn
    while high - low > 1:
        middle = (low + high) // 2
        if table[LOG_AGE, middle] <= log_age:
            low = middle
        else:
            high = middle
    return low


@bare
def _factor(growth: Growth, age: float) -> tuple[float, float]:
    """Return the factor of a tabulated threshold at an age, and its slope, from the
    cubic between two nodes that has their values and slopes.
    """
    table = growth.table
    if age <= growth.second:
        return math.exp(table[LOG_FACTOR, 0]), 0.0
    if age >= growth.first:
        return math.exp(table[LOG_FACTOR, table.shape[1] - 1]), 0.0
    at = math.log(age)
    # an age next to the last node may round to it
    i = min(max(_node_before(table, at), 0), table.shape[1] - 2)
    span = table[LOG_AGE, i + 1] - table[LOG_AGE, i]
    u = (at - table[LOG_AGE, i]) / span
    rise = table[LOG_FACTOR, i + 1] - table[LOG_FACTOR, i]
    begin = span * table[POWER, i]
    end = span * table[POWER, i + 1]
    second = 3.0 * rise - 2.0 * begin - end
    third = begin + end - 2.0 * rise
    factor = math.exp(table[LOG_FACTOR, i] + u * (begin + u * (second + u * third)))
    power = (begin + u * (2.0 * second + 3.0 * u * third)) / span
    return factor, factor * power / age


@bare
def grown(growth: Growth, age: float) -> tuple[float, float, float, float]:
    """Return factor and addend of a growing threshold,
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
    if growth.kind == TABULATED:
        factor, faster = _factor(growth, age)
        return factor, 0.0, faster, 0.0
    return (
        1.0,
        growth.first * np.log1p(age / growth.second),
        0.0,
        growth.first / (growth.second + age),
    )


@inlined
def threshold_at(growth: Growth, strength: float, age: float) -> float:
    """Return the threshold of a contact of this strength and age."""
    factor, addend, _, _ = grown(growth, age)
    return float(strength * factor + addend)


@inlined
def growing_time(growth: Growth) -> float:
    """Return the time scale on which the thresholds of newborns grow; above 0."""
    return 1.0 / growth.first if growth.kind == EXPONENTIAL else growth.second


def is_separable(hazard: Hazard, growth: Growth) -> bool:
    """Return whether the breaking rate is a function of stretching and age times a
    function of strength.
    """
    if hazard.kind == PARABOLIC:
        return growth.kind == LOGARITHMIC and growth.first == 0.0
    return hazard.kind == BELL and growth.kind == LOGARITHMIC


@inlined
def ageing_time(growth: Growth, age: float) -> float:
    """Return a time in which a threshold grows little; with a table, one in which it
    only rises or only falls.
    """
    if growth.kind == EXPONENTIAL:
        return 0.25 / growth.first
    if growth.kind == TABULATED:
        if age <= growth.second * (1.0 - _AT_NODE):
            return growth.second - age
        if age >= growth.first * (1.0 - _AT_NODE):
            return math.inf
        i = _node_before(growth.table, math.log(age) + _AT_NODE)
        i = min(i, growth.table.shape[1] - 2)
        return math.exp(growth.table[LOG_AGE, i + 1]) - age
    return math.inf if growth.first == 0.0 else age + growth.second


@inlined
def sinks(
    growth: Growth,
    strength: float,
    age: float,
    threshold: float,
) -> bool:
    """Return whether a threshold, known at this age, will be lower at a later age."""
    if growth.kind == EXPONENTIAL:
        return threshold > strength
    if growth.kind != TABULATED or age >= growth.first * (1.0 - _AT_NODE):
        return False
    i = -1
    if age > growth.second:
        i = _node_before(growth.table, math.log(age) + _AT_NODE)
    lowest = growth.table[LOWEST, max(i, 0)]
    return strength * math.exp(lowest) < threshold * (1.0 - _AT_NODE)
