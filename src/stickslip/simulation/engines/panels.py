"""The master equation, Eqs. (1)-(4), on the panels of `stickslip.kernels.panels`: for N contacts or infinitely many."""

import copy
import math
from functools import lru_cache
from itertools import pairwise
from typing import Self

import numpy as np

from stickslip.errors import InputError
from stickslip.kernels import panel_state as kernel
from stickslip.kernels.cohorts import MASS, REACH, gauss_rule, spread_out
from stickslip.kernels.finite_population import counted
from stickslip.kernels.panel_state import UNSTRETCHED, Accuracy, Delays, Newborn
from stickslip.kernels.panels import advance
from stickslip.kernels.rules import GAUSS, WEIGHT, P, Q
from stickslip.kernels.survival import EMPTY, tabulate, values_at, widest
from stickslip.model import Delay, DelayModel, Interface, MasterEquation, OnArrest, Population, Slider
from stickslip.model.distributions import Distribution
from stickslip.model.newborn import mean_life, stretching_nodes
from stickslip.model.records import hashable
from stickslip.model.rig import Rig
from stickslip.simulation.engines.base import Array, Beginning, Cohorts, Stretchings, slider_constants, solves
from stickslip.simulation.engines.beginnings import end_and_knots, survival_of
from stickslip.simulation.work import Course, Part, oscillation, sampling

_SAFETY = 1e-4, 0.87
"""Tolerance of a step for an error of 1e-4, and the power by which it falls: errors of steps fall a little faster."""
_AT_KNOTS = 0.3  # part of the tolerance of a step that is left where the survival has knots
_BROKEN = 0.02  # fraction of all contacts that may break in a step where they are counted, for an error of 1e-4
_GRAIN = 0.15
"""Distance of contacts that may count as if they had attached at one place, in standard deviations of thresholds."""
_PANELS = 1e-4, 1.5e-5  # seconds over a mean threshold, and over a radian in which the slider rings after a slip
_OF_RANDOM_DELAYS, _OF_CORNERS = 5.0, 3.0
"""So many times that with random delays, and with a distribution of thresholds that has corners."""
_FINE = 2.5e-3  # distance of the stretchings shown, in ``x_s``


@solves(MasterEquation)
@solves(Population)
class Panels(Cohorts):
    """Cohorts of contacts that attached in the same step: fractions of infinitely many, or counted."""

    mechanisms = frozenset({"sliding_force", "newborn", "on_arrest"})
    smooth = True
    kernel = advance
    steps = 2_000

    def __init__(self, beginning: Beginning, method: MasterEquation | Population) -> None:
        self._method, self.slider = method, slider_constants(beginning.slider)
        interface, count = beginning.interface, method.count if isinstance(method, Population) else 0
        self._interface, distribution = interface, interface.threshold_distribution
        self._case = kernel.Case(
            survival_of(distribution),
            _delays(hashable(interface.delay), method),
            self.slider,
            _accuracy(hashable(distribution), method.rtol, count),
            newborn=_newborn(hashable(distribution), hashable(interface.newborn), method.rtol),
            sliding_force=interface.sliding_force,
        )
        attached, rate = 1.0, 0.0
        if beginning.sliding:
            attached = beginning.attached
            rate = attached * beginning.velocity / mean_life(interface)[0]
            x, fraction = _lives_met(distribution, self._case.newborn, self._case.accuracy)
        else:
            x, fraction = _nodes(interface.initial, distribution, self._case.accuracy)
        self.state = kernel.initial_state(
            self._case.table,
            self._case.delays,
            x,
            attached * fraction,
            velocity=beginning.slider_velocity,
            rate=rate,
            element=interface.sliding_force if beginning.sliding else 0.0,
        )
        if isinstance(method, Population):
            grain = _GRAIN * distribution.standard_deviation() * min(math.sqrt(method.rtol / 1e-4), 2.0)
            finite = kernel.FiniteNumber(float(count), np.random.default_rng(method.seed), grain)
            self._case = self._case._replace(finite=finite)
            self.state = counted(self.state, self._case, count)

    @staticmethod
    def cost(rig: Rig, method: MasterEquation | Population, course: Course) -> tuple[Part, ...]:
        """Return the work of a run, by part: panels are of fifth order."""
        interface, finer = rig.interface, 1e-4 / method.rtol
        harder = 1.0 if isinstance(interface.delay, Delay) else _OF_RANDOM_DELAYS
        if any(0.0 < knot < math.inf for knot in interface.threshold_distribution.knots):
            harder *= _OF_CORNERS
        ringing = course.ringing if interface.delay.moment(1) > 0 else 0.0
        steps = _PANELS[0] * (course.distance + course.shaken) + _PANELS[1] * ringing
        path = course.distance + course.shaken + 0.01 * course.ringing
        what, seconds = f"a path of {path:.2g} mean thresholds", harder * finer ** (1 / 6) * steps
        part = Part("simulation.rtol", method.rtol, None, -1 / 6, what, seconds)
        return *oscillation(rig, course.turns), part, sampling(rig, course.turns)

    def stretchings(self) -> Stretchings:
        """Stretchings of the attached contacts now, those that attached in one step spread over its panel."""
        state = self.state
        place, mass, reach = spread_out(state.cohorts[:, : state.used.cohorts], _FINE)
        fraction = mass * values_at(self._case.table, reach)
        kept = fraction > 0.0
        return Stretchings(self.here()[1] - place[kept], fraction[kept], cells=True)

    def copy(self) -> Self:
        """Return an engine in the same state that goes its own way."""
        other = super().copy()  # what the kernel takes, it leaves as it is, but for random numbers
        if self._case.finite.contacts:
            other._case = self._case._replace(finite=copy.deepcopy(self._case.finite))
        return other

    def turned(self, interface: Interface, slider: Slider) -> Self:
        """Return an engine that goes on with other contacts and another slider; forces, positions and masses stay.

        Detached contacts stay so for the same fraction of the new delay. Cohorts keep what is attached of them.
        """
        turned, case = self.copy(), self._case
        turned._interface, turned.slider = interface, slider_constants(slider)
        turned._case = case._replace(slider=turned.slider)
        state = turned.state = copy.deepcopy(self.state)
        past = state.panels[: state.used.panels]
        if interface.delay != self._interface.delay:
            delays = _delays(hashable(interface.delay), self._method)
            ratio, now = _stretched(case.delays, delays), state.motion.time
            past[:, 0] = now - ratio * (now - past[:, 0])
            past[:, 1] *= ratio
            state.rough[:] = now - ratio * (now - state.rough)
            turned._case = turned._case._replace(delays=delays)
        if interface.thresholds != self._interface.thresholds:
            distribution = interface.threshold_distribution
            table, accuracy = survival_of(distribution), _accuracy(hashable(distribution), self._method.rtol, 0)
            n = state.used.cohorts
            reach, mass = state.cohorts[REACH, :n], state.cohorts[MASS, :n]
            old, new = (values_at(one, reach.ravel()).reshape(reach.shape) for one in (case.table, table))
            held = new > 1e-12  # the others break at once
            mass[:] = np.where(held, mass * old / np.where(held, new, 1.0), 0.0)
            lost = state.motion.mass_in - float((mass * new).sum())
            state.motion.mass_in -= lost
            state.motion.attached -= lost
            state.motion.mass_out += lost
            past[:, 2 : 3 + P] -= lost  # it re-attaches with what breaks in the next step
            turned._case = turned._case._replace(table=table, accuracy=accuracy)
        return turned


def _stretched(old: kernel.Delays, new: kernel.Delays) -> float:
    """Ratio of two distributions of delays that differ in scale only."""
    if old.time.size == new.time.size and np.allclose(old.weight, new.weight, rtol=1e-6) and old.mean > 0:
        ratio = new.mean / old.mean
        same = np.allclose(new.time, ratio * old.time, rtol=1e-6)
        same = same and math.isclose(old.fraction, new.fraction, rel_tol=1e-6)
        if same and (old.fraction == 0.0 or math.isclose(new.continuous.top, ratio * old.continuous.top, rel_tol=1e-6)):
            return ratio
    raise InputError(
        "Interface.delay: a cycle can be carried over only to a delay that is the old one scaled (the parameter DELAY "
        "does that); use is_sustained() afresh at each value"
    )


def _tolerance(rtol: float) -> float:
    return _SAFETY[0] * float((rtol / 1e-4) ** _SAFETY[1])


@lru_cache(maxsize=64)
def _accuracy(distribution: Distribution, rtol: float, count: int) -> kernel.Accuracy:
    """Tolerance of a step, and the widest panel on which a sum over nodes is good to it.

    Of counted contacts, what re-attaches is as rough as the breaks were, and what fluctuates does so a few breaks at
    a time.
    """
    table, tolerance = survival_of(distribution), _tolerance(rtol)
    if table.knots.size:  # where the order is lost, and again a delay later
        tolerance *= _AT_KNOTS
    width = widest(table, tolerance, 0.3 * distribution.moment(1), order=1)
    if not count:
        return Accuracy(tolerance, width)
    return Accuracy(tolerance, width, 1.0 / math.sqrt(count), _BROKEN * math.sqrt(rtol / 1e-4))


@lru_cache(maxsize=64)
def _delays(delay: DelayModel, method: MasterEquation | Population) -> kernel.Delays:
    """Times until a broken contact re-attaches, as the kernel takes them."""
    mean, arrest = delay.moment(1), isinstance(delay, OnArrest)
    if isinstance(method, MasterEquation) and method.memoryless:
        return Delays(np.zeros(1), np.ones(1), EMPTY, 0.0, 1.0, mean, arrest, True)
    (time, weight), continuous = delay.parts()
    if not continuous:
        return Delays(time, weight, EMPTY, 0.0, 1.0, mean, arrest, False)
    fraction = sum(part for part, _ in continuous)
    top = max(end_and_knots(distribution)[0] for _, distribution in continuous)

    def survival(t: Array) -> Array:
        return np.asarray(sum(part / fraction * distribution.survival(t) for part, distribution in continuous))

    table = tabulate(survival, top, np.empty(0))
    grain = widest(table, _tolerance(method.rtol), 0.3 * mean, order=0)
    return Delays(time, weight, table, fraction, grain, mean, arrest, False)


@lru_cache(maxsize=64)
def _newborn(thresholds: Distribution, newborn: Distribution | None, rtol: float) -> kernel.Newborn:
    """Stretchings of contacts that attach: as few as give their force to the tolerance, however far they are pulled."""
    if newborn is None:
        return UNSTRETCHED
    x, weight = stretching_nodes(newborn, thresholds, finer=4)
    way = np.linspace(0.0, 2.0 * end_and_knots(thresholds)[0], 200)[:, None]

    def survival(x: Array) -> Array:
        return np.maximum(thresholds.survival(np.abs(x)), 1e-300)

    def pulled(x: Array, weight: Array) -> Array:
        far = way + x
        held = thresholds.survival(np.maximum(np.abs(far), np.abs(x))) / survival(x)
        return np.asarray((held * far) @ weight)

    exact, tolerance = pulled(x, weight), _tolerance(rtol)
    for count in (1, 2, 3, 4, 6, 8, 12, 16, 24, 32):
        if count >= x.size:
            break
        nodes, part = gauss_rule(x, weight, count)
        if np.abs(pulled(nodes, part) - exact).max() < tolerance:
            x, weight = nodes, part
            break
    return Newborn(x, weight, weight / survival(x))


def _lives_met(thresholds: Distribution, newborn: kernel.Newborn, accuracy: kernel.Accuracy) -> tuple[Array, Array]:
    """Nodes, and weights of sum 1, of the stretchings in steady sliding: those on the way from each newborn one."""
    end, parts = end_and_knots(thresholds)[0], []
    for begin, mass in zip(newborn.stretching, newborn.mass, strict=True):
        x, weight = _on_panels({abs(begin), *_knots(thresholds)}, begin, end, accuracy.width)
        parts.append((x, mass * weight * thresholds.survival(np.maximum(np.abs(x), abs(begin)))))
    x, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    return _of_weight(x, weight)


def _nodes(initial: Distribution, thresholds: Distribution, accuracy: kernel.Accuracy) -> tuple[Array, Array]:
    """Initial stretchings at nodes of Gauss, and the weight of each, of sum 1; both of shape (n, Q).

    The panels lie between the jumps of both distributions.
    """
    std = initial.standard_deviation()
    if std == 0:
        return np.full((1, Q), initial.moment(1)), WEIGHT[None]
    (low, high), end = initial.support, end_and_knots(thresholds)[0]
    # Weights of a bell as wide as that are good to the tolerance.
    width = min(std * min(1.5 * (accuracy.tolerance / 1e-5) ** (0.5 / Q), 1.0), accuracy.width)
    x, weight = _on_panels({*initial.knots, *_knots(thresholds)}, max(low, -end), min(high, end), width)
    return _of_weight(x, weight * initial.density(x) * (thresholds.survival(np.abs(x)) > 1e-12))


def _knots(thresholds: Distribution) -> set[float]:
    """Stretchings of either sign at which the survival is not smooth."""
    return {0.0, *thresholds.knots, *(-knot for knot in thresholds.knots)}


def _on_panels(knots: set[float], low: float, high: float, width: float) -> tuple[Array, Array]:
    """Nodes and weights of Gauss on panels no wider than `width`, between these knots; both of shape (n, Q)."""
    edges = [low, *(knot for knot in sorted(knots) if low < knot < high), high]
    parts = [np.linspace(a, b, math.ceil((b - a) / width) + 1) for a, b in pairwise(edges)]
    left, right = (np.concatenate(ends)[:, None] for ends in zip(*((p[:-1], p[1:]) for p in parts), strict=True))
    return left + (right - left) * GAUSS, (right - left) * WEIGHT


def _of_weight(x: Array, weight: Array) -> tuple[Array, Array]:
    """The panels that weigh anything, with weights of sum 1."""
    kept = weight.sum(axis=1) > 1e-17
    return x[kept], weight[kept] / weight[kept].sum()
