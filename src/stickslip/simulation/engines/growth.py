"""N contacts whose thresholds grow with age by a fixed rule: `stickslip.kernels.growth`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stickslip.model import Contacts, ExponentialGrowth, LogarithmicGrowth
from stickslip.simulation.engines.base import Beginning, Individuals, Stretchings, slider_constants, solves
from stickslip.simulation.engines.beginnings import (
    attached_now,
    first_contacts,
    generators,
    pending_times,
    pool_of_delays,
)
from stickslip.simulation.engines.steps import Steps
from stickslip.theory import growth_model, lives

if TYPE_CHECKING:
    from stickslip.kernels.stepping import Course

Array = NDArray[np.float64]

_STEP = 0.02
"""Way of the slider in a step, in mean thresholds."""
_POOL = 65_536
"""Strengths to choose from."""
_BUDGET = 1_000_000
"""Steps of a contact in an advance."""


@solves(Contacts, ExponentialGrowth, LogarithmicGrowth)
class GrowingContacts(Steps):
    """Contacts with a strength and a time of attachment each."""

    longest = math.inf

    def __init__(self, beginning: Beginning, method: Contacts) -> None:
        from stickslip.kernels.growth import Growing

        interface = beginning.interface
        self.reach = _STEP * interface.threshold_distribution.moment(1)
        self.budget = max(_BUDGET // method.count, 1)
        initial, thresholds, delays = generators(method.seed)
        self._rng, self._growth = thresholds, growth_model(interface)
        self._pool = interface.threshold_distribution.sample(thresholds, _POOL)
        self._delays = pool_of_delays(interface.delay, delays)
        self.slider = slider_constants(beginning.slider)
        if beginning.sliding:
            x, strength, attach = self._steady(beginning, method.count, initial)
        else:
            # Growth towards a strength has come to its end; growth without end begins.
            attached_at = -math.inf if isinstance(interface.ageing, ExponentialGrowth) else 0.0
            x, strength, _ = first_contacts(beginning, method.count, initial)
            attach = np.full(method.count, attached_at)
        self._contacts = Growing(x, strength, attach)
        self.state = np.array([0.0, 0.0, beginning.slider_velocity, 0.0])

    def _steady(self, beginning: Beginning, count: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Stretchings, strengths, times of attachment in steady sliding: long lives are met more often, at any age."""
        velocity, delay = beginning.velocity, beginning.interface.delay
        life = lives(self._growth, self._pool, velocity)
        fraction = life.mean() / (life.mean() + delay.moment(1)) if life.any() else 0.0
        attached = round(count * fraction)
        which = rng.choice(self._pool.size, attached, p=life / life.sum()) if attached else np.empty(0, dtype=int)
        age = rng.random(attached) * life[which]
        detached = count - attached
        pending = pending_times(delay, detached, rng)
        strength = np.append(self._pool[which], rng.choice(self._pool, detached))
        return np.append(velocity * age, np.zeros(detached)), strength, np.append(-age, pending)

    def stretchings(self) -> Stretchings:
        """Stretchings of the attached contacts now."""
        return attached_now(self._contacts.stretching, self._contacts.attach, self.state[0])

    def individuals(self) -> Individuals:
        """Every contact by itself, now."""
        return Individuals(self._contacts.stretching.copy(), self._contacts.attach <= self.state[0])

    def take(self, course: Course) -> Array:
        """Follow a course, and return the samples."""
        from stickslip.kernels.growth import advance_growing

        pools = self._pool, self._delays
        return advance_growing(self.state, self._contacts, course, self._growth, *pools, self._rng)
