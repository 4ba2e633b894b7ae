"""What is known of steady sliding, whatever the contacts: force, slope and linear response."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NoReturn, Protocol

import numpy as np

from stickslip.model import Interface
from stickslip.sliding.response import Array, Response


class Sliding(Protocol):
    """Steady sliding of an interface, in natural units per contact."""

    @property
    def slow_limit(self) -> str | None:
        """Why there is no limit of slow sliding; None if there is one."""
        ...

    def force(self, velocity: Array) -> Array:
        """Force at velocities above 0, or at 0 if there is a limit of slow sliding."""
        ...

    def slope(self, velocity: Array) -> Array:
        """Slope of the force in the logarithm of the velocity."""
        ...

    def response(self) -> Response:
        """Return the linear response."""
        ...


def slope_by_differences(force: Callable[[Array], Array], velocity: Array) -> Array:
    """Slope of a force in the logarithm of the velocity, to fourth order in a step of 5 %."""
    step = 0.05
    near = [force(velocity * math.exp(step * k)) for k in (-2, -1, 1, 2)]
    return np.asarray((8.0 * (near[2] - near[1]) - (near[3] - near[0])) / (12.0 * step))


def refuse(interface: Interface, mechanism: str, who: str) -> NoReturn:
    """Raise the `InputError` that `who` cannot take a mechanism which the interface has."""
    interface.allow(interface.mechanisms - {mechanism}, who)
    raise AssertionError(mechanism)
