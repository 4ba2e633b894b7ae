"""The exact rule ("thinning") by which contacts break whose breaking rate or threshold
is not fixed.

While a contact's stretching stays within a box, and for a time, its breaking rate is at
most that of the box. A break is proposed at this rate, and accepted with the ratio of
the true rate to it. If the contact leaves its box before, or the time is over, or the
proposal is rejected, it gets another box: wide where it seldom breaks, narrow where it
is about to break, given the speed of the slider. Some six boxes suffice for a life.
Nothing is assumed about the motion of the slider: it may reverse, slip and rest.

Without temperature a threshold that grows needs no time limit: a box reaches up to the
present threshold, and is followed by another if the threshold has grown meanwhile. A
contact whose threshold grows from 0 has no box at first: it holds if the threshold
grows faster than the stretching at the present speed.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .hazard import (
    EXPONENTIAL,
    Growth,
    Hazard,
    ageing_time,
    height,
    largest_rate,
    rate,
    sinks,
    stretching_at,
    threshold_at,
)
from .records import Floats

CHANCE = 0.2  # proposals that a contact expects on its way through a box
_AT_REST = 1e-200  # a speed
# A contact breaks this fraction of its strength below its threshold: otherwise boxes
# would approach the threshold without end.
_MET = 1e-9
YOUTH = 0.01
"""Times of growth for which a threshold that grows from 0 is assumed to hold its
contact, and after which one that could not hold is tried again.
"""


class Rule(NamedTuple):
    """How contacts break and how their thresholds grow.

    `as_stiff`: the stiffness of a contact is proportional to its strength, see
    `Interface.areas`, and growth rules give forces; otherwise the stiffness is 1.
    """

    hazard: Hazard
    growth: Growth
    as_stiff: bool = False


class Box(NamedTuple):
    """Bounds of a box: largest stretching, duration, and largest rate within; if the
    duration is 0 the contact breaks at once.
    """

    reach: float
    time: float
    most: float


@inlined
def threshold_now(rule: Rule, strength: float, age: float) -> float:
    """Return the stretching at which a contact of this strength and age breaks."""
    k = strength if rule.as_stiff else 1.0  # stiffness, which turns it into a force
    return threshold_at(rule.growth, k * strength, age) / k


@inlined
def grows_from_nothing(growth: Growth) -> bool:
    """Return whether newborns have a threshold of 0."""
    return growth.kind == EXPONENTIAL and growth.second <= 0.0


@inlined
def can_hold(rule: Rule, strength: float, speed: float) -> bool:
    """Return whether a threshold that grows from 0 keeps ahead of the stretching at
    this speed.
    """
    return threshold_now(rule, strength, math.inf) * rule.growth.first > abs(speed)


@inlined
def is_met(
    x: float,
    threshold: float,
    strength: float,
    rounding: float,
) -> bool:
    """Return whether a contact has reached its threshold; its stretching has a rounding
    error.
    """
    return abs(x) + rounding >= threshold - _MET * strength


@inlined
def box_of(
    rule: Rule,
    x: float,
    strength: float,
    age: float,
    speed: float,
    rounding: float,
) -> Box:
    """Return the box of a contact that is stretched by ``|x|``, to within a rounding
    error, with the slider at this speed.

    A threshold that falls shortens the time of the box, until the lowest threshold is
    at least half of the way from the stretching to the present one: by more than the
    rounding, or the contact would leave the box where it is.
    """
    x = abs(x)
    growth = rule.growth
    hazard = rule.hazard
    threshold = threshold_now(rule, strength, age)
    if threshold <= 0.0 and x == 0.0 and can_hold(rule, strength, speed):
        # At constant speed the stretching would overtake only after twice this number
        # of times of growth.
        lead = 1.0 - abs(speed) / (
            threshold_now(rule, strength, math.inf) * growth.first
        )
        time = min(YOUTH, 0.5 * lead) / growth.first
        return Box(threshold_now(rule, strength, time), time, 0.0)
    if is_met(x, threshold, strength, rounding):
        return Box(x, 0.0, 0.0)
    time = ageing_time(growth, age)
    lowest = threshold
    sinking = sinks(growth, strength, age, threshold)
    if sinking:
        lowest = min(threshold, threshold_now(rule, strength, age + time))
        # ends: the time is halved, down to rounding
        while lowest < 0.5 * (x + threshold):
            time *= 0.5
            if time <= 1e-13 * (1.0 + age):
                return Box(x, 0.0, 0.0)
            lowest = min(threshold, threshold_now(rule, strength, age + time))
    if hazard.attempts == 0.0:
        return Box(lowest, time if sinking else math.inf, 0.0)
    # stretching at which the rate has grown by a factor of e
    finest = left = max(height(hazard, x, lowest) - 1.0, 0.0)
    reach = stretching_at(hazard, left, lowest)
    often = CHANCE * max(abs(speed), _AT_REST) / hazard.attempts
    if math.log((reach - x) / often) < finest:
        width = lowest - x
        for _ in range(2):  # twice suffices: only the logarithm of the width enters
            left = max(min(math.log(width / often), finest), 0.0)
            reach = stretching_at(hazard, left, lowest)
            width = reach - x
    most = (
        largest_rate(hazard, reach, lowest)
        if hazard.kramers != 0.0
        else hazard.attempts * math.exp(-left)
    )
    # if the threshold does not fall, the rate falls with age, and a longer time is
    # valid if a proposal is unlikely
    if not sinking:
        time = max(time, CHANCE / most)
    return Box(reach, time, most)


@bare
def lifetimes(
    rule: Rule,
    start: Floats,
    strength: Floats,
    velocity: float,
    variates: Floats,
    reached: Floats,
) -> tuple[int, int]:
    """Draw the stretchings at which newborns break at a steady velocity, from numbers
    between 0 and 1.

    Returns how many stretchings were drawn, and in how many boxes.
    """
    used = 0
    boxes = 0
    for i in range(strength.size):
        x = start[i]
        # ends: each box uses up a variate
        while True:
            if used + 2 > variates.size:
                return i, boxes
            boxes += 1
            box = box_of(
                rule,
                x,
                strength[i],
                (x - start[i]) / velocity,
                velocity,
                0.0,
            )
            if box.time == 0.0:
                break
            end = min(box.reach, x + velocity * box.time)
            used += 1
            wait = (
                -math.log(1.0 - variates[used - 1]) / box.most
                if box.most > 0.0
                else np.inf
            )
            x = min(x + velocity * wait, end)
            if x < end:
                used += 1
                threshold = threshold_now(rule, strength[i], (x - start[i]) / velocity)
                if variates[used - 1] * box.most < rate(rule.hazard, x, threshold):
                    break
        reached[i] = x
    return strength.size, boxes
