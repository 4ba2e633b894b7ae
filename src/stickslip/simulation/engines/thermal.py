"""N contacts that break by thermal activation, event by event: `stickslip.kernels.thermal_clock`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.model import Bell, Contacts, Delay, DelayModel, Interface
from stickslip.simulation.engines.base import (
    COLUMNS,
    Advance,
    Beginning,
    Engine,
    Leg,
    Stretchings,
    slider_constants,
    solves,
)
from stickslip.simulation.engines.beginnings import first_contacts, pending_times

if TYPE_CHECKING:
    from stickslip.kernels.thermal_clock import Draws

Array = NDArray[np.float64]

_BLOCK = 16_384
"""Random numbers drawn at once. The same seed gives another run with another length."""
_EVENTS = 200_000
"""Events in an advance."""
_POOL = 65_536
"""Lives to choose from for a start in steady sliding."""


def four_generators(seed: int) -> list[np.random.Generator]:
    """Return four streams: of initial stretchings, thresholds and delays, as without temperature, and of breaks."""
    return [np.random.default_rng(part) for part in np.random.SeedSequence(seed).spawn(4)]


def first_sliding(
    beginning: Beginning, count: int, rng: np.random.Generator, lives: Any
) -> tuple[Array, Array, Array]:
    """Draw contacts in steady sliding with temperature: stretchings, thresholds, and when detached ones re-attach.

    Contacts that break late are met more often, at any stretching on the way: ``P_c(x_c)`` times the survival.

    Parameters
    ----------
    beginning : Beginning
    count : int
    rng : numpy.random.Generator
    lives : callable
        Stretchings at which contacts of these thresholds break, drawn one by one.
    """
    velocity, delay = beginning.velocity, beginning.interface.delay
    threshold = beginning.interface.threshold_distribution.sample(rng, max(_POOL, 4 * count))
    reached = lives(threshold)
    fraction = reached.mean() / (reached.mean() + velocity * delay.moment(1))
    attached = round(count * fraction)
    which = rng.choice(threshold.size, attached, p=reached / reached.sum())
    pending = pending_times(delay, count - attached, rng)
    x = reached[which] * rng.random(attached)
    none = np.zeros(count - attached)
    return np.append(x, none), np.append(threshold[which], none), pending



@solves(Contacts, temperature=(Bell,))
class Clocked(Engine):
    """Contacts without ageing that share a clock; fed with random numbers in blocks of a fixed length."""

    columns = COLUMNS
    angle = 0.1
    mechanisms = frozenset({"temperature", "sliding_force"})

    def __init__(self, beginning: Beginning, method: Contacts) -> None:
        from stickslip.kernels import thermal_clock as kernel

        interface = beginning.interface
        assert isinstance(interface.temperature, Bell)
        self._bell = kernel.Bell(interface.temperature.width, interface.temperature.attempts)
        self._distribution, self._delay = interface.threshold_distribution, interface.delay
        self._f_d = interface.sliding_force
        initial, self._threshold_rng, self._delay_rng, self._rng = four_generators(method.seed)
        if beginning.sliding:
            x, threshold, pending = first_sliding(
                beginning, method.count, initial, lambda xi: self._lives(xi, beginning.velocity, initial)
            )
        else:
            x, threshold, pending = first_contacts(beginning, method.count, initial)
        self.slider = slider_constants(beginning.slider)
        self._state = kernel.make_state(
            -x, threshold, pending, self._delay.moment(1), self._bell.width, beginning.slider_velocity
        )
        if beginning.sliding and self._f_d > 0:
            self._state.counts[kernel.SLIDE] = 1
        for side in (1.0, -1.0):
            kernel.wind(self._state, self._bell, side, self._variates(method.count))
        fixed = self._delay.time if isinstance(self._delay, Delay) else math.nan
        self._draws = kernel.Draws(np.empty(0), np.empty(0), np.empty(0), fixed)
        self._refill(all_of_them=True)

    def _lives(self, threshold: Array, velocity: float, rng: np.random.Generator) -> Array:
        """Draw the stretchings at which contacts break in steady sliding."""
        width, attempts = self._bell
        with np.errstate(over="ignore"):
            reached = width * np.logaddexp(
                0.0, threshold / width + np.log(rng.standard_exponential(threshold.size) * velocity / (attempts * width))
            )
        return np.asarray(np.minimum(reached, threshold))

    def _variates(self, size: int) -> Array:
        return np.asarray(np.log(self._rng.standard_exponential(size)))

    def _refill(self, all_of_them: bool = False) -> None:
        """Draw what is used up."""
        from stickslip.kernels import thermal_clock as kernel

        counts, draws = self._state.counts, self._draws
        if all_of_them or counts[kernel.DRAWN] >= draws.thresholds.size:
            draws = draws._replace(thresholds=self._distribution.sample(self._threshold_rng, _BLOCK))
            counts[kernel.DRAWN] = 0
        if all_of_them or counts[kernel.VARIED] >= draws.variates.size:
            draws = draws._replace(variates=self._variates(_BLOCK))
            counts[kernel.VARIED] = 0
        if math.isnan(draws.fixed_delay) and (all_of_them or counts[kernel.DELAYED] >= draws.delays.size):
            draws = draws._replace(delays=self._delay.sample(self._delay_rng, _BLOCK))
            counts[kernel.DELAYED] = 0
        self._draws = draws

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        from stickslip.kernels import thermal_clock as kernel

        return float(self._state.motion[kernel.TIME]), float(self._state.motion[kernel.POSITION])

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        from stickslip.kernels import thermal_clock as kernel

        return kernel.contact_force(self._state, self._f_d)

    def stretchings(self) -> Stretchings:
        """Stretchings of the attached contacts now."""
        return self._stretchings(self.here()[1])

    def _stretchings(self, X: float) -> Stretchings:
        contacts = self._state.contacts
        x = X - contacts["birth"][contacts["threshold"] > 0]
        return Stretchings(np.asarray(x), np.full(x.size, 1.0 / contacts.size), cells=False)

    def _fastest(self, leg: Leg) -> float:
        """Largest velocity that the slider may come to."""
        drive = max(abs(float(leg.drive_velocity(np.asarray(t)))) for t in (self.here()[0], leg.end))
        if math.isinf(self.slider.stiffness):
            return drive
        if self.slider.mass == 0:
            return math.inf
        most = self._distribution.support[1]
        return drive + most * math.sqrt((1.0 + 1.0 / self.slider.stiffness) / self.slider.mass)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some events."""
        from stickslip.kernels import thermal_clock as kernel

        state, counts = self._state, self._state.counts
        if counts[kernel.CAPPED] == 0 and self._fastest(leg) > self._bell.width * self._bell.attempts / 40.0:
            state = self._state = kernel.with_caps(state)
        sampling = kernel.Sampling(leg.times, np.empty((leg.times.size, len(COLUMNS))))
        seen: list[Stretchings] = []
        counts[kernel.SAMPLE] = 0
        last = int(counts[kernel.EVENTS]) + _EVENTS
        looks = (*leg.looks, math.inf)
        while True:
            piece = kernel.Piece(leg.drive, leg.end, leg.stop, looks[len(seen)])
            left = last - int(counts[kernel.EVENTS])
            why = kernel.advance(state, self.slider, self._f_d, self._bell, piece, sampling, self._draws, left)
            if why == kernel.DRAWS_USED_UP:
                self._refill()
            elif why == kernel.WIND:
                kernel.wind(state, self._bell, 1.0, self._variates(state.contacts.size))
            elif why == kernel.WIND_BACK:
                kernel.wind(state, self._bell, -1.0, self._variates(state.contacts.size))
            elif why == kernel.LOOK:  # before the flight that passes it, so that none is cut in two
                seen.append(self._stretchings(float(state.motion[kernel.LOOKED])))
            else:
                break
        while looks[len(seen)] <= state.motion[kernel.TIME]:  # at the very end
            seen.append(self.stretchings())
        rows = sampling.samples[: counts[kernel.SAMPLE]]
        return Advance(rows, tuple(seen), over=why != kernel.BUDGET_SPENT)
