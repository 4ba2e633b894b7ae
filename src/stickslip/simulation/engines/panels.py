"""Infinitely many contacts: the master equation, Eqs. (1)-(4), on the panels of `stickslip.kernels.panels`."""

from __future__ import annotations

import copy
import math
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.model import DelayModel, Interface, MasterEquation, OnArrest, Slider
from stickslip.model.distribution import check_density
from stickslip.model.distributions import Distribution, SteadyState
from stickslip.model.quadrature import hashable
from stickslip.simulation.engines.base import (
    COLUMNS,
    Advance,
    Beginning,
    Engine,
    Leg,
    Stretchings,
    looks_aside,
    slider_constants,
    solves,
)
from stickslip.simulation.engines.beginnings import end_and_knots, survival_of

if TYPE_CHECKING:
    from stickslip.kernels import panel_state as kernel

Array = NDArray[np.float64]

_STEPS = 2_000
"""Steps in an advance."""
_SAFETY = 1e-4, 0.87
"""Tolerance of a step for an error of 1e-4, and the power by which it falls: errors of steps fall a little faster."""
_AT_KNOTS = 0.3
"""Part of the tolerance of a step that is left where the survival has knots."""
_FINE = 2.5e-3
"""Distance of the stretchings shown, in ``x_s``."""


@solves(MasterEquation)
class Panels(Engine):
    """Groups of contacts that attached in the same step."""

    columns = COLUMNS
    angle = 0.1
    mechanisms = frozenset({"on_arrest"})

    def __init__(self, beginning: Beginning, method: MasterEquation) -> None:
        from stickslip.kernels import panel_state as kernel

        self._interface, self._method = beginning.interface, method
        distribution = beginning.interface.threshold_distribution
        self._thresholds, self._accuracy = (
            survival_of(distribution),
            _accuracy(hashable(distribution), method.rtol),
        )
        self._delays = _delays(hashable(beginning.interface.delay), method)
        self.slider = slider_constants(beginning.slider)
        if beginning.sliding:
            initial: Distribution = SteadyState(thresholds=distribution)
            attached = beginning.attached
            rate = attached * beginning.velocity / distribution.moment(1)
        else:
            initial, attached, rate = beginning.interface.initial, 1.0, 0.0
        x, fraction = _nodes(initial, distribution, self._accuracy)
        self._state = kernel.initial_state(
            self._thresholds, self._delays, x, attached * fraction, velocity=beginning.slider_velocity, rate=rate
        )

    @staticmethod
    def check(interface: Interface, method: MasterEquation) -> None:  # noqa: ARG004
        """Raise `InputError` for thresholds without a density."""
        check_density(interface.threshold_distribution)

    @property
    def state(self) -> kernel.State:
        """What the kernel goes on from; it never changes one."""
        return self._state

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        from stickslip.kernels import panel_state as kernel

        return float(self._state.scalar[kernel.TIME]), float(self._state.scalar[kernel.POSITION])

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        from stickslip.kernels import panel_state as kernel

        return float(self._state.scalar[kernel.CONTACT_FORCE])

    def stretchings(self) -> Stretchings:
        """Stretchings of the attached contacts now, those that attached in one step spread over its panel."""
        from stickslip.kernels import panel_state as kernel
        from stickslip.kernels.groups import spread_out
        from stickslip.kernels.survival import values_at

        state = self._state
        place, mass, reach = spread_out(state.groups[:, : state.used[kernel.GROUPS]], _FINE)
        fraction = mass * values_at(self._thresholds, reach)
        kept = fraction > 0.0
        return Stretchings(self.here()[1] - place[kept], fraction[kept], cells=True)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some steps."""
        from stickslip.kernels import panel_state as kernel
        from stickslip.kernels.panels import advance

        before = self.copy()
        done = advance(
            self._state,
            self._thresholds,
            self._delays,
            self.slider,
            leg.drive,
            until=leg.end,
            times=leg.times,
            accuracy=self._accuracy,
            stop=leg.stop,
            max_steps=_STEPS,
        )
        self._state = done.state
        sampled = [kernel.POSITION, kernel.VELOCITY, kernel.CONTACT_FORCE, kernel.ATTACHED]
        energies = [kernel.STORED, kernel.WORK, kernel.DAMPED, kernel.LOST]
        return Advance(
            done.rows[:, sampled + energies],
            looks_aside(before, leg, self.here()[0]),
            over=done.reason != kernel.PAUSED,
        )

    def copy(self) -> Self:
        """Return an engine in the same state that goes its own way."""
        return copy.copy(self)  # what the kernel takes, it leaves as it is

    def turned(self, interface: Interface, slider: Slider) -> Self:
        """Return an engine that goes on with other contacts and another slider; forces, positions and masses stay.

        Detached contacts stay so for the same fraction of the new delay. Groups keep what is attached of them.

        Raises
        ------
        InputError
            If the delay is not the old one scaled.
        """
        from stickslip.kernels import panel_state as kernel
        from stickslip.kernels.groups import MASS, REACH
        from stickslip.kernels.rules import P
        from stickslip.kernels.survival import values_at

        turned = self.copy()
        turned._interface, turned.slider = interface, slider_constants(slider)
        state = turned._state = copy.deepcopy(self._state)
        if interface.delay != self._interface.delay:
            turned._delays = _delays(hashable(interface.delay), self._method)
            ratio, now = _stretched(self._delays, turned._delays), state.scalar[kernel.TIME]
            panels = state.panels[: state.used[kernel.PANELS]]
            panels[:, 0] = now - ratio * (now - panels[:, 0])
            panels[:, 1] *= ratio
            state.rough[:] = now - ratio * (now - state.rough)
            state.cursor[:] = 0
        if interface.thresholds != self._interface.thresholds:
            distribution = interface.threshold_distribution
            turned._thresholds = survival_of(distribution)
            turned._accuracy = _accuracy(hashable(distribution), self._method.rtol)
            n = state.used[kernel.GROUPS]
            reach, mass = state.groups[REACH, :n], state.groups[MASS, :n]
            old, new = (
                values_at(table, reach.ravel()).reshape(reach.shape) for table in (self._thresholds, turned._thresholds)
            )
            held = new > 1e-12  # the others break at once
            mass[:] = np.where(held, mass * old / np.where(held, new, 1.0), 0.0)
            lost = state.scalar[kernel.MASS_IN] - float((mass * new).sum())
            state.scalar[[kernel.MASS_IN, kernel.ATTACHED]] -= lost
            state.scalar[kernel.MASS_OUT] += lost
            # It re-attaches with what breaks in the next step.
            past = state.panels[: int(state.used[kernel.PANELS])]
            past[:, 2 : 3 + P] -= lost
        return turned


def _stretched(old: kernel.Delays, new: kernel.Delays) -> float:
    """Ratio of two distributions of delays that differ in scale only."""
    if old.time.size == new.time.size and np.allclose(old.weight, new.weight, rtol=1e-6) and old.mean > 0:
        ratio = new.mean / old.mean
        same = np.allclose(new.time, ratio * old.time, rtol=1e-6) and math.isclose(old.share, new.share, rel_tol=1e-6)
        if same and (old.share == 0.0 or math.isclose(new.spread.top, ratio * old.spread.top, rel_tol=1e-6)):
            return ratio
    raise InputError(
        "Interface.delay: a cycle can be carried over only to a delay that is the old one scaled (the parameter DELAY "
        "does that); use is_sustained() afresh at each value"
    )


# ---------------------------------------------------------------------------------------------------------------------
# Tables
# ---------------------------------------------------------------------------------------------------------------------


def _tolerance(rtol: float) -> float:
    return _SAFETY[0] * float((rtol / 1e-4) ** _SAFETY[1])


@lru_cache(maxsize=64)
def _accuracy(distribution: Distribution, rtol: float) -> kernel.Accuracy:
    """Tolerance of a step, and the widest panel on which a sum over nodes is good to it."""
    from stickslip.kernels.panel_state import Accuracy
    from stickslip.kernels.survival import widest

    table, tolerance = survival_of(distribution), _tolerance(rtol)
    if table.knots.size:  # where the order is lost, and again a delay later
        tolerance *= _AT_KNOTS
    return Accuracy(tolerance, widest(table, tolerance, 0.3 * distribution.moment(1), order=1))


@lru_cache(maxsize=64)
def _delays(delay: DelayModel, method: MasterEquation) -> kernel.Delays:
    """Times until a broken contact re-attaches, as the kernel takes them."""
    from stickslip.kernels.panel_state import Delays
    from stickslip.kernels.survival import EMPTY, tabulate, widest

    mean, arrest = delay.moment(1), isinstance(delay, OnArrest)
    if method.memoryless:
        return Delays(np.zeros(1), np.ones(1), EMPTY, 0.0, 1.0, mean, arrest, True)
    (time, weight), spread = delay.parts()
    if not spread:
        return Delays(time, weight, EMPTY, 0.0, 1.0, mean, arrest, False)
    share = sum(part for part, _ in spread)
    top = max(end_and_knots(distribution)[0] for _, distribution in spread)

    def survival(t: Array) -> Array:
        return np.asarray(sum(part / share * distribution.survival(t) for part, distribution in spread))

    table = tabulate(survival, top, np.empty(0))
    grain = widest(table, _tolerance(method.rtol), 0.3 * mean, order=0)
    return Delays(time, weight, table, share, grain, mean, arrest, False)


def _nodes(initial: Distribution, thresholds: Distribution, accuracy: kernel.Accuracy) -> tuple[Array, Array]:
    """Initial stretchings at nodes of Gauss, and the weight of each, of sum 1; both of shape (n, Q).

    The panels lie between the jumps of both distributions.
    """
    from stickslip.kernels.rules import GAUSS, WEIGHT, Q

    std = initial.standard_deviation()
    if std == 0:
        return np.full((1, Q), initial.moment(1)), WEIGHT[None]
    (low, high), end = initial.support, end_and_knots(thresholds)[0]
    low, high = max(low, -end), min(high, end)
    knots = {*initial.knots, *thresholds.knots, *(-knot for knot in thresholds.knots), 0.0}
    edges = [low, *(knot for knot in sorted(knots) if low < knot < high), high]
    # Weights of a bell as wide as that are good to the tolerance.
    width = min(std * min(1.5 * (accuracy.tolerance / 1e-5) ** (0.5 / Q), 1.0), accuracy.width)
    parts = [np.linspace(a, b, math.ceil((b - a) / width) + 1) for a, b in pairwise(edges)]
    left, right = (np.concatenate(ends)[:, None] for ends in zip(*((p[:-1], p[1:]) for p in parts), strict=True))
    x = left + (right - left) * GAUSS
    weight = (right - left) * WEIGHT * initial.density(x) * (thresholds.survival(np.abs(x)) > 1e-12)
    kept = weight.sum(axis=1) > 1e-17
    return x[kept], weight[kept] / weight[kept].sum()
