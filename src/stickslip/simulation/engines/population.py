"""Infinitely many contacts: the master equation, Eqs. (1)-(4), on the cohorts of `stickslip.kernels.cohorts`."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.model import Interface, MasterEquation, Slider
from stickslip.model.distribution import check_density
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
from stickslip.simulation.engines.beginnings import initial_nodes, survival_table

if TYPE_CHECKING:
    from stickslip.kernels import cohorts as kernel

Array = NDArray[np.float64]

_STEPS = 5_000
"""Steps in an advance."""


@solves(MasterEquation)
class Population(Engine):
    """Cohorts of contacts that attached together."""

    columns = COLUMNS
    angle = 0.1

    def __init__(self, beginning: Beginning, method: MasterEquation) -> None:
        from stickslip.kernels import cohorts as kernel

        self._interface, self._cells, self._memoryless = beginning.interface, float(method.cells), method.memoryless
        self._table, self._delays = self._thresholds(), self._times_until_attached()
        self.slider = slider_constants(beginning.slider)
        if beginning.sliding:
            attached = beginning.attached
            x, fraction = kernel.smooth_sliding(self._table, self._cells, attached)
            rate = attached * beginning.velocity / self._interface.threshold_distribution.moment(1)
        else:
            (x, fraction), rate = initial_nodes(self._interface), 0.0
        self._state = kernel.initial_state(
            self._table, self._delays, x, fraction, velocity=beginning.slider_velocity, rate=rate
        )

    @staticmethod
    def check(interface: Interface, method: MasterEquation) -> None:  # noqa: ARG004
        """Raise `InputError` for thresholds without a density."""
        check_density(interface.threshold_distribution)

    def _thresholds(self) -> kernel.Table:
        from stickslip.kernels import cohorts as kernel

        return kernel.tabulate(*survival_table(self._interface.threshold_distribution))

    def _times_until_attached(self) -> kernel.Delays:
        from stickslip.kernels import cohorts as kernel

        return kernel.Delays(*self._interface.delay.quadrature(), self._memoryless)

    @property
    def state(self) -> kernel.State:
        """What the kernel goes on from; it never changes one."""
        return self._state

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        from stickslip.kernels import cohorts as kernel

        return float(self._state.scalar[kernel.TIME]), float(self._state.scalar[kernel.POSITION])

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        from stickslip.kernels import cohorts as kernel

        return float(self._state.scalar[kernel.CONTACT_FORCE])

    def stretchings(self) -> Stretchings:
        """Stretchings of the cohorts now."""
        from stickslip.kernels import cohorts as kernel

        return Stretchings(*kernel.stretchings(self._state), cells=True)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some steps."""
        from stickslip.kernels import cohorts as kernel

        before = self.copy()
        done = kernel.advance(
            self._state,
            self._table,
            self._delays,
            self.slider,
            leg.drive,
            until=leg.end,
            times=leg.times,
            cells=self._cells,
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

        Detached contacts stay so for the same fraction of the new delay. Cohorts keep what is attached of them.

        Raises
        ------
        InputError
            If the delay is not the old one scaled.
        """
        from stickslip.kernels import cohorts as kernel

        turned = self.copy()
        turned._interface, turned.slider = interface, slider_constants(slider)
        state = turned._state = copy.deepcopy(self._state)
        scalar, cohort, broken, used = state.scalar, state.cohort, state.broken, state.used
        if interface.delay != self._interface.delay:
            turned._delays = turned._times_until_attached()
            ratio = _stretched(self._delays, turned._delays)
            n = used[1]
            broken[0, :n] = scalar[kernel.TIME] - ratio * (scalar[kernel.TIME] - broken[0, :n])
            state.cursor[:] = 0
        if interface.thresholds != self._interface.thresholds:
            turned._table = turned._thresholds()
            n = used[0]
            fraction = np.array([kernel.survival(turned._table, reach) for reach in cohort[kernel.REACH, :n]])
            held = fraction > kernel.EXTINCT  # the others break as soon as they are stretched further
            cohort[kernel.MASS, :n] = np.where(held, cohort[kernel.ALIVE, :n] / np.where(held, fraction, 1.0), 0.0)
        return turned


def _stretched(old: kernel.Delays, new: kernel.Delays) -> float:
    """Ratio of two distributions of delays that differ in scale only."""
    if old.time.size == new.time.size and old.time.size and np.allclose(old.weight, new.weight, rtol=1e-6):
        ratio = float(new.time.max() / old.time.max()) if old.time.max() > 0 else float("nan")
        if np.allclose(new.time, ratio * old.time, rtol=1e-6) and ratio > 0:
            return ratio
    raise InputError(
        "Interface.delay: a cycle can be carried over only to a delay that is the old one scaled (the parameter DELAY "
        "does that); use is_sustained() afresh at each value"
    )
