"""Steady sliding of contacts that keep their thresholds and break at them alone: a closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stickslip.errors import InputError
from stickslip.model import Interface
from stickslip.model.newborn import as_unstretched, mean_life
from stickslip.sliding.response import Array, check_delay
from stickslip.sliding.unaged import UnagedResponse


@dataclass(frozen=True, kw_only=True)
class ClosedForm:
    """Steady sliding without ageing and temperature."""

    interface: Interface

    def __post_init__(self) -> None:
        self.interface.allow(("sliding_force", "newborn"), "smooth sliding")

    @property
    def slow_limit(self) -> str | None:
        """Why there is no limit of slow sliding, if so."""
        return None if math.isfinite(self.interface.delay.moment(1)) else "with an infinite delay no slow limit is left"

    def fractions(self, velocity: Array) -> Array:
        """Fractions of attached contacts, ``1/(1 + v <tau>/<x_s - x_0>)``, Eq. (10)."""
        return np.asarray(1.0 / (1.0 + velocity * self.interface.delay.moment(1) / mean_life(self.interface).path))

    @property
    def _attached_force(self) -> float:
        life = mean_life(self.interface)
        return life.work / life.path

    def force(self, velocity: Array) -> Array:
        """Force per contact, attached and detached."""
        attached = self.fractions(velocity)
        return self._attached_force * attached + self.interface.sliding_force * (1.0 - attached)

    def slope(self, velocity: Array) -> Array:
        """Slope of the force in ln v."""
        attached = self.fractions(velocity)
        return -(self._attached_force - self.interface.sliding_force) * attached * (1.0 - attached)

    def response(self) -> UnagedResponse:
        """Return the linear response."""
        thresholds, sliding_force = as_unstretched(self.interface)
        delay = self.interface.delay
        check_delay(delay)
        if delay.moment(1) > 0 and thresholds.single:
            raise InputError(
                "Interface.thresholds: all contacts share one threshold and are slow to forget how they started; "
                "stability is not computed for them: give the thresholds a standard deviation above 0"
            )
        return UnagedResponse(distribution=thresholds, delay=delay, sliding_force=sliding_force)
