"""What engines that follow cohorts share: a state with a record of motion, which their kernel never changes."""

from __future__ import annotations

import copy
from typing import Any, Self

import numpy as np

from stickslip.kernels.drive import PAUSED
from stickslip.simulation.engines.base import COLUMNS, Advance, Array, Engine, Leg, looks_aside


class Cohorts(Engine):
    """Contacts that attached together, as one; a class says which kernel follows them, and what it is told."""

    columns = COLUMNS
    angle = 0.1
    _state: Any

    def go_on(self, leg: Leg) -> tuple[Any, Array, int]:
        """Follow a leg for some steps; the state then, the samples, and why the kernel came back."""
        raise NotImplementedError

    @property
    def state(self) -> Any:
        """What the kernel goes on from; it never changes one."""
        return self._state

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        return float(self._state.motion.time), float(self._state.motion.position)

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        return float(self._state.motion.contact_force)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some steps."""
        before = self.copy()
        self._state, rows, reason = self.go_on(leg)
        return Advance(rows, looks_aside(before, leg, self.here()[0]), over=reason != PAUSED)

    def copy(self) -> Self:
        """Return an engine in the same state that goes its own way."""
        return copy.copy(self)


def sampled(rows: Any) -> Array:
    """Return records of motion, which begin with what a run samples, as `COLUMNS`."""
    return np.asarray(rows).view(float).reshape(len(rows), len(rows.dtype))[:, : len(COLUMNS)]
