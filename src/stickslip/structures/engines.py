"""The engine of a run as an element, with a prescribed motion of the slider."""

import math
from typing import NamedTuple

import numpy as np

from stickslip.errors import InputError
from stickslip.kernels.drive import Quadratic, Stop
from stickslip.model.methods import Contacts, Method
from stickslip.simulation.engines.base import COLUMNS, Beginning, Engine, Leg, advances

# distance, in x_s, below which hardly any contact breaks, and rounding dominates
# differences of energy
_SHORT = 1e-6


class _Content(NamedTuple):
    """State of an engine, with its last force and energies."""

    engine: Engine
    force: float
    energies: tuple[float, float]


class DrivenEngine:
    """An engine with a slider that moves along lines; the impulse is integrated by
    Simpson's rule from three forces per step.

    For single contacts, whose force jumps, the impulse follows from their work.
    """

    def __init__(
        self,
        beginning: Beginning,
        method: Method,
        kind: type[Engine],
    ) -> None:
        interface = beginning.interface
        if interface.areas is not None:
            raise InputError(
                f"Interface.areas = {interface.areas}: not available with Element "
                "together with ageing or activation; leave one out",
                "Interface.areas",
            )
        engine = kind(beginning, method)
        self._one_by_one = isinstance(method, Contacts)
        self._has_energies = len(kind.columns) == len(COLUMNS)
        stored = engine.stretchings()
        energy = 0.5 * float(stored.fraction @ stored.stretching**2)
        self._now = _Content(engine, engine.contact_force(), (energy, 0.0))

    @property
    def here(self) -> tuple[float, float]:
        """Time and displacement of the slider."""
        return self._now.engine.here()

    @property
    def force(self) -> float:
        """Present friction force."""
        return self._now.force

    def step(
        self,
        dt: float,
        velocity: float,
        displacement: float,
    ) -> tuple[float, float, float]:
        """Move the slider along a line, whatever its velocity at the start of the step;
        return force, impulse and stiffness.
        """
        del velocity
        engine, force, energies = self._now
        t, x = engine.here()
        v = (displacement - x) / dt
        times = t + dt * np.array([0.5, 1.0])
        leg = Leg(Quadratic(t, x, v, 0.0), float(times[1]), times, Stop())
        rows = np.concatenate([passed.rows for passed in advances(engine, leg)])
        middle, end = rows[:, 2].tolist()
        impulse = dt * (force + 4.0 * middle + end) / 6.0
        after = (math.nan, math.nan)
        if self._has_energies:
            after = float(rows[1, 4]), float(rows[1, 7])
            if self._one_by_one and abs(displacement - x) > _SHORT:
                impulse = (sum(after) - sum(energies)) / v
        self._now = _Content(engine, end, after)
        return end, impulse, float(rows[1, 3])

    def energies(self) -> tuple[float, float]:
        """Return the energy stored, and the energy lost since the start; NaN if they
        are not known.
        """
        return self._now.energies

    def next_event(self) -> tuple[float, float, float]:
        """Raise `InputError`: the next event is not known."""
        raise InputError(
            "Element.next_event: contacts that age or break by chance, or are not "
            "simulated singly, have no next event that is known; use Contacts "
            "without ageing and activation"
        )

    def save(self) -> _Content:
        """Return the state."""
        return self._now._replace(engine=self._now.engine.copy())

    def load(self, content: _Content) -> None:
        """Restore a state that `save` returned."""
        self._now = content._replace(engine=content.engine.copy())
