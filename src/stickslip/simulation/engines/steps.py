"""What the engines share that take steps of time: `stickslip.kernels.stepping`."""

from __future__ import annotations

import math
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from stickslip.kernels.drive import Quadratic, Stop, holds
from stickslip.kernels.stepping import Course
from stickslip.simulation.engines.base import MOTION, Advance, Beginning, Engine, Leg, looks_aside, slider_constants

Array = NDArray[np.float64]


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
    budget: int
    """Steps in an advance: some 50 ms."""

    def take(self, course: Course) -> Array:
        """Follow a course, and return the samples of `stickslip.kernels.stepping`."""
        ...

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        return float(self.state[0]), float(self.state[1])

    def advance(self, leg: Leg) -> Advance:
        """Go on by some steps, at most to the one that would pass a look."""
        times = np.minimum(leg.times, leg.end)
        wanted = times.size
        if wanted == 0 or times[-1] < leg.end:
            times = np.append(times, leg.end)
        before, look = self.here()[0], leg.looks[0] if leg.looks else math.inf
        course = Course(leg.drive, self.slider, times, self.longest, self.reach, leg.stop, look, self.budget)
        samples = self.take(course)[:wanted]
        now = self.here()[0]
        over = has_stopped(leg.stop, samples) or now >= leg.end
        # A course that has not gone a step stands before its look.
        seen = looks_aside(self, leg, look if now == before and not over else now)
        return Advance(samples[:, [0, 1, 3, 4]], seen, over)

    def settle(self, beginning: Beginning) -> None:
        """Let the contacts settle: slide rigidly at the first velocity up to time and position 0, unseen."""
        self.slider = slider_constants(None)
        start, position = self.here()
        leg = Leg(Quadratic(start, position, beginning.velocity, 0.0), 0.0, np.empty(0), Stop())
        while not self.advance(leg).over:
            pass
        self.state[:2] = 0.0


def has_stopped(stop: Stop, samples: Array) -> bool:
    """Whether the condition holds at the last sample."""
    return len(samples) > 0 and holds(stop, samples[-1, 0], samples[-1, 2])
