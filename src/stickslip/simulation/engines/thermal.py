"""N contacts that break by thermal activation, event by event.

Without ageing and by `Bell` they share a clock, `stickslip.kernels.thermal_clock`; all others are in boxes, see
`stickslip.simulation.engines.contacts`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from stickslip.model import (
    Bell,
    Contacts,
    Delay,
    DelayModel,
)
from stickslip.model.distributions import Distribution
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
from stickslip.sliding.lives import hazard_of

if TYPE_CHECKING:
    from stickslip.kernels.between_events import Piece, Sampling
    from stickslip.kernels.oscillator import Slider as SliderConstants

Array = NDArray[np.float64]

_BLOCK = 16_384
"""Random numbers drawn at once. The same seed gives another run with another length."""
_EVENTS = 200_000
"""Events in an advance."""
_POOL = 65_536
"""Lives to choose from, at least, for a start in steady sliding."""


def _first_sliding(
    beginning: Beginning,
    count: int,
    rng: np.random.Generator,
    newborns: Callable[[np.random.Generator, int], Array],
    lives: Callable[[Array], Array],
) -> tuple[Array, Array, Array]:
    """Draw stretchings and thresholds in steady sliding (detached contacts last), and when the latter re-attach.

    ``P_c(x_c)`` times the survival up to ``x``: contacts that break late are met more often, at any stretching before.
    `newborns` draws thresholds, `lives` the stretchings at which contacts of given ones break.
    """
    velocity, delay = beginning.velocity, beginning.interface.delay
    threshold = newborns(rng, max(_POOL, 4 * count))
    reached = lives(threshold)
    attached = round(count * float(reached.mean() / (reached.mean() + velocity * delay.moment(1))))
    which = rng.choice(threshold.size, attached, p=reached / reached.sum())
    none = np.zeros(count - attached)
    x = np.append(reached[which] * rng.random(attached), none)
    return x, np.append(threshold[which], none), pending_times(delay, none.size, rng)


class Thermal(Engine, Protocol):
    """What the two engines share: they go from event to event, fed with random numbers in blocks of a fixed length."""

    columns: ClassVar[tuple[str, ...]] = COLUMNS
    angle: ClassVar[float] = 0.1
    mechanisms: ClassVar[frozenset[str]] = frozenset({"temperature", "sliding_force"})

    _state: Any
    _draws: Any
    _distribution: Distribution
    _delay: DelayModel
    _sliding_force: float
    _rngs: list[np.random.Generator]
    """Of initial stretchings, thresholds and delays, as without temperature, and of breaks."""
    slider: SliderConstants

    @property
    def _kernel(self) -> Any:
        """The kernel, a module."""
        ...

    def _begin(self, beginning: Beginning, method: Contacts) -> None:
        """Take what does not depend on how contacts break."""
        interface = beginning.interface
        self._distribution, self._delay = interface.threshold_distribution, interface.delay
        self._sliding_force = interface.sliding_force
        self._rngs = [np.random.default_rng(part) for part in np.random.SeedSequence(method.seed).spawn(4)]
        self.slider = slider_constants(beginning.slider)

    def _contacts(self, beginning: Beginning, count: int) -> tuple[Array, Array, Array]:
        """Draw stretchings, thresholds and times of re-attachment of all contacts."""
        rng = self._rngs[0]
        if beginning.sliding:
            return _first_sliding(
                beginning, count, rng, self._newborns, lambda strength: self._lives(strength, beginning.velocity)
            )
        return first_contacts(beginning, count, rng)

    def _newborns(self, rng: np.random.Generator, size: int) -> Array:
        """Draw thresholds."""
        return self._distribution.sample(rng, size)

    def _lives(self, threshold: Array, velocity: float) -> Array:
        """Draw the stretchings at which newborn contacts break in steady sliding."""
        ...

    def _variates(self, size: int) -> Array:
        """Draw the random numbers that decide when contacts break."""
        ...

    def _go(self, piece: Piece, sampling: Sampling, left: int) -> int:
        """Go on with the kernel until it has a reason to come back."""
        ...

    def _mend(self, why: int) -> bool:
        """Do what the kernel has come back for; whether it can go on."""
        del why
        return False

    def _refill(self, first: bool = False) -> None:
        """Draw what is used up."""
        kernel, counts = self._kernel, self._state.counts
        _, threshold_rng, delay_rng, _ = self._rngs
        fixed = self._delay.time if isinstance(self._delay, Delay) else math.nan
        draws = kernel.Draws(np.empty(0), np.empty(0), np.empty(0), fixed) if first else self._draws
        if counts[kernel.DRAWN] >= draws.thresholds.size:
            draws = draws._replace(thresholds=self._newborns(threshold_rng, _BLOCK))
            counts[kernel.DRAWN] = 0
        if counts[kernel.VARIED] + kernel.NEED > draws.variates.size:
            draws = draws._replace(variates=self._variates(_BLOCK))
            counts[kernel.VARIED] = 0
        if math.isnan(draws.fixed_delay) and counts[kernel.DELAYED] >= draws.delays.size:
            draws = draws._replace(delays=self._delay.sample(delay_rng, _BLOCK))
            counts[kernel.DELAYED] = 0
        self._draws = draws

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        from stickslip.kernels import between_events as shared

        motion = self._state.motion
        return float(motion[shared.TIME]), float(motion[shared.POSITION])

    def contact_force(self) -> float:
        """Friction force now, per contact."""
        from stickslip.kernels.between_events import friction

        return float(friction(self._state.motion, self._state.counts, self._sliding_force, self._state.contacts.size))

    def stretchings(self) -> Stretchings:
        """Stretchings of the attached contacts now."""
        return self._stretchings(self.here()[1])

    def _stretchings(self, X: float) -> Stretchings:
        contacts = self._state.contacts
        x = np.asarray(X - contacts["birth"][contacts["threshold"] > 0])
        return Stretchings(x, np.full(x.size, 1.0 / contacts.size), cells=False)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some events."""
        from stickslip.kernels import between_events as shared

        counts, motion = self._state.counts, self._state.motion
        sampling = shared.Sampling(leg.times, np.empty((leg.times.size, len(COLUMNS))))
        seen: list[Stretchings] = []
        counts[shared.SAMPLE] = 0
        last = int(counts[shared.EVENTS]) + _EVENTS
        looks = (*leg.looks, math.inf)
        while True:
            piece = shared.Piece(leg.drive, leg.end, leg.stop, looks[len(seen)])
            why = self._go(piece, sampling, last - int(counts[shared.EVENTS]))
            if why == shared.DRAWS_USED_UP:
                self._refill()
            elif why == shared.LOOK:  # before the flight that passes it, so that none is cut in two
                seen.append(self._stretchings(float(motion[shared.LOOKED])))
            elif not self._mend(why):
                break
        while looks[len(seen)] <= motion[shared.TIME]:  # at the very end
            seen.append(self.stretchings())
        rows = sampling.samples[: counts[shared.SAMPLE]]
        return Advance(rows, tuple(seen), over=why != shared.BUDGET_SPENT)


@solves(Contacts, temperature=(Bell,))
class Clocked(Thermal):
    """Contacts that do not age, by `Bell`: they share a clock."""

    @property
    def _kernel(self) -> Any:
        """The kernel, a module."""
        from stickslip.kernels import thermal_clock

        return thermal_clock

    def __init__(self, beginning: Beginning, method: Contacts) -> None:
        from stickslip.kernels import between_events as shared

        self._begin(beginning, method)
        kernel = self._kernel
        hazard = hazard_of(beginning.interface.temperature)
        self._bell = kernel.Bell(hazard.scale, hazard.attempts)
        x, threshold, pending = self._contacts(beginning, method.count)
        self._state = kernel.make_state(-x, threshold, pending, self._delay.moment(1), beginning.slider_velocity)
        self._state.counts[shared.SLIDE] = int(beginning.sliding and self._sliding_force > 0)
        for side in (1.0, -1.0):
            kernel.wind(self._state, self._bell, side, self._variates(method.count))
        self._refill(first=True)

    def _lives(self, threshold: Array, velocity: float) -> Array:
        """Draw the stretchings at which newborn contacts break in steady sliding: in closed form."""
        width, attempts = self._bell
        variate = np.log(self._rngs[0].standard_exponential(threshold.size) * velocity / (attempts * width))
        return np.asarray(np.minimum(width * np.logaddexp(0.0, threshold / width + variate), threshold))

    def _variates(self, size: int) -> Array:
        """Draw logarithms of exponential variates."""
        return np.asarray(np.log(self._rngs[3].standard_exponential(size)))

    def _go(self, piece: Piece, sampling: Sampling, left: int) -> int:
        """Go on with the kernel; thresholds wait in queues of their own from when they may be met."""
        kernel = self._kernel
        if not self._state.counts[kernel.CAPPED]:
            fastest = self._fastest(piece)
            if fastest > self._bell.width * self._bell.attempts / 40.0:  # one in e^40 lives so long
                self._state = kernel.with_caps(self._state)
        return int(
            kernel.advance(
                self._state, self.slider, self._sliding_force, self._bell, piece, sampling, self._draws, left
            )
        )

    def _fastest(self, piece: Piece) -> float:
        """Largest velocity that the slider may come to, by what contacts and spring can hold."""
        drive = piece.drive
        end = drive.velocity + drive.acceleration * (piece.end - drive.start)
        fastest = max(abs(drive.velocity), abs(end))
        if math.isinf(self.slider.stiffness):
            return fastest
        if self.slider.mass == 0:  # it leaps
            return math.inf
        most = self._distribution.support[1]
        return fastest + most * math.sqrt((1.0 + 1.0 / self.slider.stiffness) / self.slider.mass)

    def _mend(self, why: int) -> bool:
        """Wind a clock that is too far ahead; whether it was that."""
        from stickslip.kernels import between_events as shared

        kernel = self._kernel
        if why not in (shared.WIND, shared.WIND_BACK):
            return False
        side = 1.0 if why == shared.WIND else -1.0
        kernel.wind(self._state, self._bell, side, self._variates(self._state.contacts.size))
        return True
