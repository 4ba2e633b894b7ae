"""Single contacts as an element: they start as those of a run, and then draw their own
random numbers.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from stickslip.arrays import Array
from stickslip.kernels import element as kernel
from stickslip.kernels.keyed_draws import Portion, tabulate_quantiles
from stickslip.kernels.survival import EMPTY
from stickslip.model import Contacts, Delay, Interface, LogNormal, OnArrest
from stickslip.model.distributions import Distribution
from stickslip.model.records import hashable
from stickslip.simulation.engines.base import Beginning
from stickslip.simulation.engines.contacts import EventByEvent
from stickslip.simulation.engines.start import survival_of


def element_of(beginning: Beginning, method: Contacts) -> kernel.ElementState:
    """Return the contacts of a run of the same method at its start, as an element.

    Later draws use random numbers of the element.
    """
    drawn = EventByEvent(beginning, method).attachments()
    low, high = np.random.SeedSequence(method.seed).generate_state(2).tolist()
    interface = beginning.interface
    slides = beginning.sliding and interface.sliding_force > 0.0
    return kernel.make_element(
        drawn.birth,
        drawn.threshold,
        drawn.until,
        (low, high),
        draws_of(hashable(interface)),
        drawn.factor,
        interface.sliding_force if slides else 0.0,
    )


@lru_cache(maxsize=32)
def draws_of(interface: Interface) -> kernel.Draws:
    """Return the distributions from which contacts of an interface draw."""
    thresholds = interface.threshold_distribution
    delay = interface.delay
    newborn = interface.newborn
    scatter = interface.slip_to_slip_scatter
    fixed = math.nan
    if isinstance(delay, Delay | OnArrest):
        fixed = math.inf if isinstance(delay, OnArrest) else delay.time
    kinds = [
        [_whole(thresholds)],
        [_within(newborn, thresholds.support[1], interface)] if newborn else [],
        _delays(interface) if math.isnan(fixed) else [],
        [_whole(LogNormal(mean=1.0, std=scatter))] if scatter else [],
    ]
    return kernel.Draws(
        tabulate_quantiles(kinds),
        survival_of(thresholds) if newborn else EMPTY,
        fixed,
        interface.sliding_force,
        newborn is not None,
        isinstance(delay, OnArrest),
        scatter > 0.0,
        interface.areas is not None,
        interface.keeps_areas,
    )


def _knots(distribution: Distribution) -> Array:
    """Return the probabilities at which the quantile function of a distribution is not
    smooth.
    """
    knots = np.array(distribution.knots)
    survival = distribution.survival(knots) if knots.size else knots
    return np.asarray(survival[(survival > 0.0) & (survival < 1.0)])


def _whole(distribution: Distribution, weight: float = 1.0) -> Portion:
    """Return a distribution as a portion."""
    return Portion(weight, distribution.inverse_survival, _knots(distribution))


def _within(newborn: Distribution, strongest: float, interface: Interface) -> Portion:
    """Return the distribution of newborn stretchings, truncated to those that the
    strongest contact can bear.
    """
    largest = strongest if interface.areas is None else math.sqrt(strongest)
    bottom, top = newborn.survival([largest, -largest])
    part = float(top - bottom)

    def value(p: Array) -> Array:
        return newborn.inverse_survival(bottom + part * p)

    knots = (_knots(newborn) - bottom) / part
    return Portion(1.0, value, knots[(knots > 0.0) & (knots < 1.0)])


def _constant(time: float) -> Callable[[Array], Array]:
    return lambda p: np.full(p.shape, time)


def _delays(interface: Interface) -> list[Portion]:
    """Return the portions of the delays: fixed times, distributions, and infinity."""
    (times, weights), rest = interface.delay.parts()
    portions = [
        Portion(weight, _constant(time))
        for time, weight in zip(times.tolist(), weights.tolist(), strict=True)
        if weight > 0.0
    ]
    portions += [_whole(distribution, part) for part, distribution in rest]
    never = 1.0 - sum(portion.weight for portion in portions)
    if never > 1e-9:
        portions.append(Portion(never, _constant(math.inf)))
    return portions


class ContactByContact:
    """Contacts with thresholds of their own, each simulated by itself."""

    def __init__(self, beginning: Beginning, method: Contacts) -> None:
        self.state = element_of(beginning, method)

    @property
    def here(self) -> tuple[float, float]:
        """Time and displacement of the slider."""
        m = self.state.motion[0]
        return float(m.time), float(m.position)

    @property
    def force(self) -> float:
        """Present friction force."""
        return kernel.force_of(self.state)

    def step(
        self,
        dt: float,
        velocity: float,
        displacement: float,
    ) -> tuple[float, float, float]:
        """Move the slider to a displacement in a time; return force, impulse and
        stiffness.
        """
        return kernel.step(self.state, dt, velocity, displacement)

    def energies(self) -> tuple[float, float]:
        """Return the energy stored, and the energy lost since the start."""
        lost = float(self.state.motion[0].lost) / self.state.contacts.size
        return kernel.energy_of(self.state), lost

    def next_event(self) -> tuple[float, float, float]:
        """Return the distances forward and back until a contact breaks, and the time
        until one re-attaches.
        """
        ahead, behind = kernel.next_break(self.state)
        return ahead, behind, kernel.next_attachment(self.state)

    def save(self) -> bytes:
        """Return the state as bytes."""
        return self.state.memory.tobytes()

    def load(self, content: bytes) -> None:
        """Restore a state that `save` returned."""
        self.state.memory[:] = np.frombuffer(content)
