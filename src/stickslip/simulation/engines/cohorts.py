"""What engines that follow cohorts share: a state with a record of motion, which their kernel never changes."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any, ClassVar, Self

import numpy as np

from stickslip.errors import UndecidedError
from stickslip.kernels.drive import PAUSED, UNSOLVED
from stickslip.simulation.engines.base import COLUMNS, Advance, Engine, Leg, looks_aside


class Cohorts(Engine):
    """Contacts that attached together, as one; a class says which kernel follows them, and what it is told."""

    columns = COLUMNS
    angle = 0.1
    kernel: ClassVar[Callable[..., Any]]
    """Goes on from a state, in a case, to a time, with samples and a condition, by so many steps."""
    steps: ClassVar[int]
    """Steps in an advance."""
    state: Any
    _case: Any
    _method: Any

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        return float(self.state.motion.time), float(self.state.motion.position)

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        return float(self.state.motion.contact_force)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some steps."""
        before, case = self.copy(), self._case._replace(drive=leg.drive)
        self.state, records, reason = type(self).kernel(self.state, case, leg.end, leg.times, leg.stop, self.steps)
        if reason == UNSOLVED:
            raise UndecidedError(
                f"{self._method}: no step, however short, can be solved from here on; use another rtol, or Contacts"
            )
        # Records of motion begin with what a run samples.
        rows = np.asarray(records).view(float).reshape(len(records), len(records.dtype))[:, : len(COLUMNS)]
        return Advance(rows, looks_aside(before, leg, self.here()[0]), over=reason != PAUSED)

    def copy(self) -> Self:
        """Return an engine in the same state that goes its own way."""
        return copy.copy(self)
