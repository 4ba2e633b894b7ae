"""What engines have in common that follow cohorts: a state of scalars and cohorts, which their kernel never changes."""

from __future__ import annotations

import copy
from types import ModuleType
from typing import Any, Self

from stickslip.simulation.engines.base import COLUMNS, Advance, Array, Engine, Leg, looks_aside


class Cohorts(Engine):
    """Contacts that attached together, as one; a subclass says which kernel follows them, and what it is told."""

    columns = COLUMNS
    angle = 0.1
    _state: Any

    @staticmethod
    def module() -> ModuleType:
        """Return the module of the state, which names its scalars `TIME`, `POSITION` and `CONTACT_FORCE`."""
        raise NotImplementedError

    def go_on(self, leg: Leg) -> tuple[Any, Array, int]:
        """Follow a leg for some steps; the state then, the samples, and why the kernel came back."""
        raise NotImplementedError

    @property
    def state(self) -> Any:
        """What the kernel goes on from; it never changes one."""
        return self._state

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        kernel = self.module()
        return float(self._state.scalar[kernel.TIME]), float(self._state.scalar[kernel.POSITION])

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        return float(self._state.scalar[self.module().CONTACT_FORCE])

    def advance(self, leg: Leg) -> Advance:
        """Go on by some steps."""
        before = self.copy()
        self._state, rows, reason = self.go_on(leg)
        return Advance(rows, looks_aside(before, leg, self.here()[0]), over=reason != self.module().PAUSED)

    def copy(self) -> Self:
        """Return an engine in the same state that goes its own way."""
        return copy.copy(self)
