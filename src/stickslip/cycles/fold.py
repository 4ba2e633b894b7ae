"""The fold of a cycle, from cycles that are held up while they shrink.

A run near a fold takes long to show its fate: it lingers where the fold was, and the longer the closer it is. So the
parameter is varied from cycle to cycle such that the amplitude shrinks slowly, through that of the fold. How much it
shrinks in a cycle depends, near a fold, on the amplitude itself and on the parameter in this cycle and in the few
before it, of which the stretched contacts tell. A fit of that to all the cycles gives the value at which a cycle of
each amplitude would neither grow nor shrink; the fold is where that value turns.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stickslip.cycles.edges import Edge
from stickslip.cycles.ride import Ride, extreme
from stickslip.model.parameters import Parameter

Array = NDArray[np.float64]

_MOST = 70
"""Cycles after which to give up."""
_LATEST = 18, 24
"""So many of the last cycles are fitted; the two fits tell the error."""
_MEMORY = 4
"""Cycles, this one and those before it, in which the value of the parameter counts."""
_WEIGHTS = np.array([0.4, 0.4, 0.2])
"""About how much it counts in the last three, the oldest first: enough to steer by."""
_FIRST = 0.05
"""Largest first change of the logarithm of the parameter."""
_STRIDE = 0.1
"""Largest change of the logarithm of the parameter from cycle to cycle."""
_EACH, _SPAN = 0.92, 10
"""Ratio of one amplitude aimed at to the one before, and the most cycles on the way to it."""
_REST = 1.5e-3
"""What a fit may leave, as a change of the logarithm of the parameter: twice that of a cycle that is known to 1e-4."""
_PAST = 0.2
"""How far the logarithm of the parameter has come back where the fold was missed."""
FINEST = 3e-3
"""Relative width of the bracket. Folds found so lie up to .1 % from the middle of what runs bracket with a fixed delay
(Figs. 6 and 7), and .18 % with a random one, where that bracket is itself .15 % wide."""


class _Steered:
    """Goes on by one cycle after the other, from a quarter of a period after the force was lowest to the next."""

    def __init__(self, parameter: Parameter, ride: Ride, period: float) -> None:
        self._parameter, self._ride, self._period = parameter, ride, period
        self._lowest, in_step = 0.0, False
        self._on(1.3 * period)
        for _ in range(2):
            in_step = self._on(max(self._until_next(), 0.3 * period))[1]
            if in_step:
                break
        self.in_step = in_step

    def _until_next(self) -> float:
        ahead = self._lowest + 1.25 * self._period - self._ride.engine.here()[0]
        return ahead if ahead > 0.0 else ahead + self._period

    def _on(self, duration: float) -> tuple[float, bool]:
        self._ride, (t, force, speed) = self._ride.on(duration * self._ride.rig.velocity)
        slope = self._ride.rig.slider.stiffness * (self._ride.rig.velocity - speed)
        low, high = int(np.argmin(force)), int(np.argmax(force))
        self._lowest = float(t[low])
        oscillation = extreme(t, force, slope, high) - extreme(t, force, slope, low)
        return oscillation, high < low and 0.3 * t.size < low < 0.95 * t.size

    def cycle(self, place: float) -> float | None:
        """Peak to peak of the next cycle, with another value of the parameter; None if there is no such cycle."""
        before, velocity = self._lowest, self._ride.rig.velocity
        self._ride = self._ride.turned(self._parameter.set(self._ride.rig, math.exp(place)))
        self._period *= velocity / self._ride.rig.velocity
        oscillation, in_step = self._on(self._until_next())
        self._period = self._lowest - before
        return oscillation if in_step and self._period > 0.0 else None


def held_fold(
    parameter: Parameter, ride: Ride, value: float, period: float, decays_at: float, tolerance: float
) -> Edge | None:
    """Look for the fold between a value, of which the settled cycle is given, and one at which it decays.

    Parameters
    ----------
    parameter : Parameter
    ride : Ride
        With the settled cycle.
    value, period : float
        Of it.
    decays_at : float
    tolerance : float
        Relative width of the bracket about the fold that is asked for.

    Returns
    -------
    Edge or None
        None if there is no fold, or the cycle is not one of single slips that are alike, or the fits disagree, or a
        narrower bracket is asked for than this gives.
    """
    if not period > 0.0 or tolerance < FINEST:
        return None
    steered = _Steered(parameter, ride, period)
    begin, end = math.log(value), math.log(decays_at)
    way = math.copysign(1.0, end - begin)
    place, sizes = [], []

    def go(there: float) -> bool:
        size = steered.cycle(there)
        if size is None or size <= 0.0:
            return False
        place.append(there)
        sizes.append(size)
        return True

    if not steered.in_step or not all(go(begin) for _ in range(3)) or np.ptp(sizes) > 0.01 * sizes[0]:
        return None
    first = sizes[-1]
    there = begin + way * min(0.5 * abs(end - begin), _FIRST)
    if not all(go(there) for _ in range(3)):
        return None
    answer = 1.5 * (sizes[-1] - sizes[-2]) / (there - begin)  # of the drift to the parameter; some of it comes later
    if answer * way >= 0.0:
        return None
    aim, tried = _EACH * sizes[-1], 0
    while len(sizes) < _MOST:
        drift = sizes[-1] - sizes[-2]
        balanced = float(_WEIGHTS @ place[-3:]) - drift / answer
        wanted = 0.25 * (aim - sizes[-1] - 1.5 * drift)
        there = balanced + float(np.clip(wanted, -0.03 * first, 0.03 * first)) / answer
        if not go(min(max(there, place[-1] - _STRIDE), place[-1] + _STRIDE)):
            return None
        tried += 1
        still = abs(sizes[-1] - sizes[-2]) < 2e-3 * first and abs(sizes[-1] - aim) < 0.012 * first
        if tried >= _SPAN or (2 * tried >= _SPAN and still):
            aim, tried = _EACH * aim, 0
            if sizes[-1] < 0.25 * first or way * (place[-1] - max(place, key=lambda one: way * one)) < -_PAST:
                return None
            fits = [_fitted(np.array(place), np.array(sizes), count) for count in _LATEST]
            if fits[0][0] * way < 0.0:
                answer = float(np.clip(fits[0][0] / answer, 0.5, 2.0)) * answer
            if all(one * way < 0.0 for one, _ in fits) and abs(fits[1][1] - fits[0][1]) < 0.2 * FINEST:
                fold = 0.5 * (fits[0][1] + fits[1][1])
                beyond, before = fold + 0.5 * way * FINEST, fold - 0.5 * way * FINEST
                if way * (end - fold) < 0.0 or way * (before - begin) < 0.0:
                    return None
                return Edge.between(math.exp(beyond), math.exp(before), "fold")
    return None


def _fitted(place: Array, sizes: Array, count: int) -> tuple[float, float]:
    """How the drift answers to the parameter in the last cycles, and its logarithm at the fold; NaN if not told."""
    if sizes.size < count + _MEMORY + 3:
        return math.nan, math.nan
    last = np.arange(sizes.size - count, sizes.size)
    before, drift = sizes[last - 1], sizes[last] - sizes[last - 1]
    x = (before - before.mean()) / max(float(np.ptp(before)), 1e-300)
    recent = np.stack([place[last - i] for i in range(_MEMORY)], axis=1) - place[last].mean()
    matrix = np.column_stack([recent, np.ones(count), x, x * x])
    fit, *_ = np.linalg.lstsq(matrix, drift, rcond=1e-10)
    answer, (level, slope, bend) = float(fit[:_MEMORY].sum()), fit[_MEMORY:].tolist()
    rest = float(np.sqrt(np.mean((matrix @ fit - drift) ** 2)))
    # Where smaller cycles and larger ones shrink alike there is a fold between them.
    turn = -slope / (2.0 * bend) if bend < 0.0 else math.inf
    inside = x.min() < turn < x.max() and rest < _REST * abs(answer)
    return answer, float(place[last].mean() - (level + 0.5 * slope * turn) / answer) if inside else math.nan
