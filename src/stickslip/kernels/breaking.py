"""What is left of contacts that attached together, whatever makes them break: two numbers that never fall.

A contact of strength ``s`` has broken once the largest ``(|x| - addend)/factor`` of its life, its `reach`, is beyond
``s``: of thresholds that do not grow the largest stretching. By `Bell` it breaks before, at the rate
``a exp((|x| - s)/A)``: it survives with ``exp(-exp((u - s)/A))``, where its `clock` ``u = A ln(a G)`` holds the
integral ``G`` of ``exp(|x|/A)`` over its life, whatever the strength. So the fraction of newborns that survives is a
function of the two, which is one of ``u`` alone unless contacts are pulled faster than they break by heat.

In a step the slider goes along a polynomial. On the side ahead of all that attached behind it ``G`` grows by an
integral that they share, but for a factor; and on the other side by another.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .hazard import Growth, grown
from .records import Floats, Record
from .rules import MONOMIAL, NODE, P, along, fit, gauss
from .survival import Table, value_and_slope, value_at

NEVER = -1e9  # the clock of a contact that was never tried
CERTAIN = 3.7  # ``exp(-exp(CERTAIN))`` is less than rounding
_SURE = 37.0  # and so is ``exp(-_SURE)``

_THREE, _OF_THREE = gauss(3)
_EIGHT, _OF_EIGHT = gauss(8)


class Breaking(NamedTuple):
    """How contacts break."""

    thresholds: Table  # survival of strengths, by the reach
    knots: Floats  # where its slope jumps, if cohorts are cut there
    blurred: Table  # the same at a temperature, by the clock
    width: float  # activation width; 0: there is no temperature
    attempts: float
    growth: Growth


X, CURVE, LENGTH, MOMENTS, AHEAD, AHEAD_SINCE, BACK, BACK_SINCE = range(8)
AHEAD_PULLED, BACK_PULLED = 8, 9 + P
"""Rows of the way of the slider in a step, shape (10 + 2 P, P + 1): its place at start and nodes, and coefficients of
the polynomial through them; the length of the step in time, and room. Then what clocks gain up to each node, and from
the node before it, where the slider is above the contact, and the same where it is below; and for each node how that up
to it follows the slider's places at all nodes, on either side."""


def a_way() -> Floats:
    """Return room for a way."""
    return np.zeros((10 + 2 * P, P + 1))


@inlined
def is_fixed(breaking: Breaking) -> bool:
    """Whether contacts break at thresholds that do not grow, and only there."""
    return bool(breaking.width == 0.0 and breaking.growth.first == 0.0)


@inlined
def reach_at(growth: Growth, x: float, age: float) -> float:
    """Strength of a contact of this age whose threshold is met at a stretching ``x >= 0``."""
    if growth.first == 0.0:
        return x
    factor, addend, _, _ = grown(growth, age)
    return float((x - addend) / factor) if x > addend or factor > 0.0 else 0.0


@inlined
def later(width: float, u: float, w: float) -> float:
    """Clock after both of two gains."""
    return max(u, w) + width * math.log1p(math.exp(-abs(u - w) / width))


# ---------------- What survives


@bare
def survival(breaking: Breaking, u: float, r: float) -> tuple[float, float, float]:
    """Fraction that survives a clock and a reach; its slopes in the two."""
    if breaking.width == 0.0:
        held, by_reach = value_and_slope(breaking.thresholds, max(r, 0.0))
        return held, 0.0, by_reach
    d = (u - r) / breaking.width
    if r <= breaking.thresholds.bottom or d > CERTAIN:
        held, by_clock = value_and_slope(breaking.blurred, u)
        return held, by_clock, 0.0
    held, by_reach = value_and_slope(breaking.thresholds, r)
    if d < -_SURE:
        return held, 0.0, by_reach
    here = math.exp(-math.exp(d))
    return _beyond(breaking, d, r, held), (1.0 - here) * value_and_slope(breaking.blurred, u)[1], here * by_reach


@bare
def _beyond(breaking: Breaking, d: float, r: float, held: float) -> float:
    """What survives where strengths below `r` matter: ``Int J_c(max(r, u - A ln E)) exp(-E) dE``, by panels."""
    total, begin, size, end = held * math.exp(-math.exp(d)), 0.0, 0.5, max(d, 0.0) + _SURE
    while begin < end:
        for k in range(_THREE.size):
            t = begin + size * _THREE[k]
            s = d - t
            left = value_at(breaking.thresholds, r + breaking.width * t)
            total += size * _OF_THREE[k] * left * math.exp(s - math.exp(s))
        begin += size
        size = min(1.15 * size, 4.0) if begin > d + 2.0 else 0.5
    return min(total, held)


@bare
def _fill(breaking: Breaking, u: Floats, r: Floats, values: Floats) -> None:
    for i in range(u.size):
        values[i] = survival(breaking, u[i], r[i])[0]


def survivals(breaking: Breaking, u: Floats, r: Floats) -> Floats:
    """Fractions that survive, of any shape."""
    values = np.empty(u.size)
    _fill(breaking, u.ravel(), r.ravel(), values)
    return values.reshape(u.shape)


# ---------------- Clocks


@bare
def _gain(way: Floats, moments: Floats, breaking: Breaking, begin: float, end: float, b: float, sign: float) -> float:
    """What a clock gains between two parts of a step on one side of a place `b`: ``A ln a Int exp(sign (x - b)/A)``.

    By panels from the end where the exponent is largest, the longer the less they matter, while they matter at all: a
    panel's error is below ``1e-10`` of the integral. Leaves the first `moments` of the part of the step under it.
    """
    A, many = breaking.width, moments.size
    for i in range(many):
        moments[i] = 0.0
    first, last = sign * (along(way[CURVE], begin) - b) / A, sign * (along(way[CURVE], end) - b) / A
    step, top = begin - end, last
    here, u = last, end
    if first > last:
        step, top, here, u = end - begin, first, first, begin
    left, size = 1.0, 1.0
    while left > 1e-14:
        size = min(size, left)
        there = sign * (along(way[CURVE], u + size * step) - b) / A
        if abs(there - here) > 4.0 + 0.5 * (top - here) and size > 1e-9:
            size *= 0.5
            continue
        if there > top:  # it turns on the way
            for i in range(many):
                moments[i] *= math.exp(max(top - there, -700.0))
            top = there
        for k in range(_EIGHT.size):
            part = u + size * step * _EIGHT[k]
            power = size * _OF_EIGHT[k] * math.exp(min(sign * (along(way[CURVE], part) - b) / A - top, 40.0))
            for i in range(many):
                moments[i] += power
                power *= part
        u, here, left = u + size * step, there, left - size
        if here < top - _SURE:
            break
        size *= 2.0
    total = moments[0]
    for i in range(many):
        moments[i] /= total
    return float(A * (top + math.log(max(breaking.attempts * way[LENGTH, 0] * abs(step) * total, 1e-300))))


@bare
def run_clocks(way: Floats, nodes: Record, breaking: Breaking, dt: float) -> None:
    """Note where the slider is at the nodes of a step, and what clocks gain up to there."""
    for k in range(P + 1):
        way[X, k] = nodes[k].x
    way[LENGTH, 0] = dt
    if breaking.width == 0.0:
        return
    fit(way[X], way[CURVE])
    way[AHEAD, 0] = way[BACK, 0] = NEVER
    for k in range(1, P + 1):
        for row, pulled, sign in ((AHEAD, AHEAD_PULLED, 1.0), (BACK, BACK_PULLED, -1.0)):
            way[row + 1, k] = gain = _gain(way, way[MOMENTS], breaking, NODE[k - 1], NODE[k], 0.0, sign)
            way[row, k] = total = later(breaking.width, way[row, k - 1], gain)
            part = math.exp((gain - total) / breaking.width)
            for i in range(P + 1):
                more = 0.0
                for a in range(P + 1):
                    more += MONOMIAL[a, i] * way[MOMENTS, a]
                way[pulled + k, i] = (1.0 - part) * way[pulled + k - 1, i] + part * more


@bare
def gain_of_interval(way: Floats, breaking: Breaking, b: float, begin: float, k: int) -> float:
    """What the clock of contacts at a place gains before a node, from the node before it or from a later `begin`."""
    a, x0, x1 = NODE[k - 1], way[X, k - 1] - b, way[X, k] - b
    if begin > a:
        a, x0 = begin, along(way[CURVE], begin) - b
    if x0 * x1 < 0.0 and min(abs(x0), abs(x1)) > 1e-14:
        low, high, sign = a, NODE[k], 1.0 if x1 > 0.0 else -1.0
        for _ in range(40):
            u = 0.5 * (low + high)
            if (along(way[CURVE], u) - b) * sign > 0.0:
                high = u
            else:
                low = u
        before = _gain(way, way[MOMENTS, :1], breaking, a, low, b, -sign) if low > a else NEVER
        return later(breaking.width, before, _gain(way, way[MOMENTS, :1], breaking, low, NODE[k], b, sign))
    sign = 1.0 if x0 + x1 >= 0.0 else -1.0
    if begin > NODE[k - 1]:
        return _gain(way, way[MOMENTS, :1], breaking, begin, NODE[k], b, sign)
    return float(way[AHEAD_SINCE, k] - b if sign > 0.0 else way[BACK_SINCE, k] + b)


@bare
def gain_since_start(
    way: Floats, breaking: Breaking, b: float, before: float, k: int, low: float, high: float
) -> float:
    """What the clock of contacts at a place gains up to a node: `before` up to the last one, on a way within bounds."""
    if b <= low:
        return float(way[AHEAD, k] - b)
    if b >= high:
        return float(way[BACK, k] + b)
    return later(breaking.width, before if k > 1 else NEVER, gain_of_interval(way, breaking, b, 0.0, k))


@bare
def carried(
    way: Floats, breaking: Breaking, b: float, u: float, r: float, age: float, begin: float, k: int
) -> tuple[float, float]:
    """Clock and reach at a node of a step of contacts at a place that had these, and this age, in a part of it."""
    for i in range(1, k + 1):
        if NODE[i] > begin:
            r = max(r, reach_at(breaking.growth, abs(way[X, i] - b), age + (NODE[i] - begin) * way[LENGTH, 0]))
            if breaking.width > 0.0:
                u = later(breaking.width, u, gain_of_interval(way, breaking, b, begin, i))
    return u, r
