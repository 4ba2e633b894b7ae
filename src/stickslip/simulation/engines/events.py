"""N contacts, event by event, exact for their number: `stickslip.kernels.events`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.model import Contacts, Delay, Interface, OnArrest
from stickslip.simulation.engines.base import (
    COLUMNS,
    Advance,
    Beginning,
    Engine,
    Individuals,
    Leg,
    Stretchings,
    slider_constants,
    solves,
)
from stickslip.simulation.engines.beginnings import first_contacts, generators, later_generators, newborns

if TYPE_CHECKING:
    from stickslip.kernels import events as kernel

Array = NDArray[np.float64]

_BLOCK = 16_384
"""Random numbers drawn at once. The same seed gives another run with another length."""
_EVENTS = 400_000
"""Events in an advance: some 50 ms."""


@solves(Contacts)
class Events(Engine):
    """Contacts whose next event is always known; fed with random numbers in blocks of a fixed length."""

    columns = COLUMNS
    angle = 0.1
    mechanisms = frozenset({"sliding_force", "newborn", "track_scatter", "on_arrest"})

    def __init__(self, beginning: Beginning, method: Contacts) -> None:
        from stickslip.kernels import events as kernel

        self._interface, self._delay = beginning.interface, beginning.interface.delay
        initial, self._threshold_rng, self._delay_rng = generators(method.seed)
        self._births_rng, self._track_rng = later_generators(method.seed)
        self._factor = self._next_track()
        x, threshold, pending = first_contacts(beginning, method.count, initial, self._factor)
        self._state = kernel.make_state(
            -x,
            threshold,
            pending,
            self._delay.moment(1),
            velocity=beginning.slider_velocity,
            sliding_force=self._interface.sliding_force,
            slides=int(beginning.sliding),
        )
        self.slider = slider_constants(beginning.slider)
        fixed = self._delay.moment(1) if isinstance(self._delay, Delay | OnArrest) else math.nan
        arrests = bool(self._interface.mechanisms & {"track_scatter", "on_arrest"})
        self._draws = self._with_thresholds(kernel.Draws(np.empty(0), np.empty(0), fixed, arrests=arrests))

    @staticmethod
    def check(interface: Interface, method: Contacts) -> None:  # noqa: ARG004
        """Raise `InputError` for contacts that could break and re-attach for ever at one moment."""
        if {"newborn", "track_scatter"} <= interface.mechanisms and interface.delay.moment(1) == 0:
            raise InputError(
                f"Interface.delay = {interface.delay}: with both newborn stretchings and track_scatter contacts may "
                "break as soon as they re-attach; give a delay above 0, or leave out one of the two",
                "Interface.delay",
            )

    def _next_track(self) -> float:
        """Draw the factor that the thresholds have in common until the next arrest."""
        scatter = self._interface.track_scatter
        if scatter == 0.0:
            return 1.0
        variance = math.log1p(scatter * scatter)
        return math.exp(math.sqrt(variance) * self._track_rng.standard_normal() - 0.5 * variance)

    def _with_thresholds(self, draws: kernel.Draws) -> kernel.Draws:
        """Return the draws with new thresholds of contacts that attach; fewer where they are soon out of date."""
        count = min(_BLOCK, 2 * self._state.size) if self._interface.track_scatter else _BLOCK
        x, threshold = newborns(self._interface, count, self._factor, self._births_rng, self._threshold_rng)
        return draws._replace(thresholds=threshold, stretchings=x)

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        from stickslip.kernels import between_events as shared

        return float(self._state.motion[shared.TIME]), float(self._state.motion[shared.POSITION])

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        from stickslip.kernels import events as kernel

        return kernel.contact_force(self._state)

    def stretchings(self) -> Stretchings:
        """Stretchings of the attached contacts now."""
        return self._stretchings(self.here()[1])

    def individuals(self) -> Individuals:
        """Every contact by itself, now."""
        from stickslip.kernels import events as kernel

        stretching, attached = np.zeros(self._state.size), np.zeros(self._state.size, dtype=bool)
        contacts = kernel.attached_contacts(self._state)
        stretching[contacts["slot"]] = self.here()[1] - contacts["birth"]
        attached[contacts["slot"]] = True
        return Individuals(stretching, attached)

    def _stretchings(self, X: float) -> Stretchings:
        from stickslip.kernels import events as kernel

        x = kernel.stretchings(self._state, X)
        return Stretchings(x, np.full(x.size, 1.0 / self._state.size), cells=False)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some events."""
        from stickslip.kernels import between_events as shared
        from stickslip.kernels import events as kernel

        state = self._state
        sampling = shared.Sampling(leg.times, np.empty((leg.times.size, len(COLUMNS))))
        seen: list[Stretchings] = []
        state.counts[shared.SAMPLE] = 0
        last = int(state.counts[shared.EVENTS]) + _EVENTS
        looks = (*leg.looks, math.inf)
        while True:
            piece = shared.Piece(leg.drive, leg.end, leg.stop, looks[len(seen)])
            left = last - int(state.counts[shared.EVENTS])
            why = kernel.advance(state, self.slider, piece, sampling, self._draws, left)
            if why == kernel.THRESHOLDS_USED_UP:
                self._draws = self._with_thresholds(self._draws)
                state.counts[kernel.THRESHOLD] = 0
            elif why == kernel.ARRESTED:
                if self._interface.track_scatter:
                    self._factor = self._next_track()
                    self._draws = self._with_thresholds(self._draws)
                    state.counts[kernel.THRESHOLD] = 0
                if isinstance(self._delay, OnArrest):
                    kernel.re_attach_all(state)
            elif why == kernel.DELAYS_USED_UP:
                self._draws = self._draws._replace(delays=self._delay.sample(self._delay_rng, _BLOCK))
                state.counts[kernel.DELAY] = 0
            elif why == shared.LOOK:  # before the flight that passes it, so that none is cut in two
                seen.append(self._stretchings(float(state.motion[shared.LOOKED])))
            else:
                break
        while looks[len(seen)] <= state.motion[shared.TIME]:  # at the very end
            seen.append(self.stretchings())
        rows = sampling.samples[: state.counts[shared.SAMPLE]]
        return Advance(rows, tuple(seen), over=why != shared.BUDGET_SPENT)
