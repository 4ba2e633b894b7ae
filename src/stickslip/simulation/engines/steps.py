"""What the engines share that take steps of time: `stickslip.kernels.stepping`."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from stickslip.simulation.engines.base import MOTION, Advance, Beginning, Engine, Leg, looks_aside, slider_constants

if TYPE_CHECKING:
    from stickslip.kernels.drive import Stop
    from stickslip.kernels.stepping import Course

Array = NDArray[np.float64]

_SAMPLES = 256
"""Samples in an advance."""


class Steps(Engine, Protocol):
    """An engine that takes steps of time, and samples no energies."""

    columns: ClassVar[tuple[str, ...]] = MOTION
    angle: ClassVar[float] = 0.35  # that of its steps: samples finer than that show no more

    state: Array
    """Time, position of the slider, and what else the kernel keeps there."""
    longest: float
    """Largest step of time."""
    reach: float
    """Largest way of the slider in a step."""

    def take(self, course: Course) -> Array:
        """Follow a course, and return the samples of `stickslip.kernels.stepping`."""
        ...

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        return float(self.state[0]), float(self.state[1])

    def advance(self, leg: Leg) -> Advance:
        """Go on by a block of samples, or to the end."""
        from stickslip.kernels.stepping import Course

        times = np.minimum(leg.times[:_SAMPLES], leg.end)
        wanted = times.size
        if wanted == leg.times.size and (wanted == 0 or times[-1] < leg.end):
            times = np.append(times, leg.end)
        looking = bool(leg.looks) and leg.looks[0] <= times[-1]
        before = self.copy() if looking else self
        samples = self.take(Course(leg.drive, self.slider, times, self.longest, self.reach, leg.stop))[:wanted]
        now = self.here()[0]
        looks = looks_aside(before, leg, now) if looking else ()
        return Advance(samples[:, [0, 1, 3, 4]], looks, over=has_stopped(leg.stop, samples) or now >= leg.end)

    def settle(self, beginning: Beginning, time: float) -> None:
        """Let the contacts settle: slide rigidly at the first velocity for a time, unseen."""
        from stickslip.kernels.drive import Quadratic, Stop

        self.slider = slider_constants(None)
        leg = Leg(Quadratic(0.0, 0.0, beginning.velocity, 0.0), time, np.empty(0), Stop())
        while not self.advance(leg).over:
            pass


def has_stopped(stop: Stop, samples: Array) -> bool:
    """Whether the condition holds at the last sample."""
    from stickslip.kernels.drive import holds

    return len(samples) > 0 and holds(stop, samples[-1, 0], samples[-1, 2])
