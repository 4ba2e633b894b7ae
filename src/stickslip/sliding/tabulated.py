"""Linear responses that take the transforms of a life from a table.

A life is computed and tabulated without the delay after it, whose phase may turn many
times as fast; the delay enters in closed form.
"""

import math
from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import ClassVar, Self

import numpy as np
from scipy.interpolate import CubicSpline

from stickslip.model import Delay, Interface
from stickslip.sliding.response import (
    Array,
    ComplexArray,
    Fluctuations,
    Parts,
    Response,
    ResponseScales,
    Unperturbed,
)

# steps of frequencies, and most steps where the lives come from the table
FEW_STEPS = 8_000
_MOST_STEPS = 16 * FEW_STEPS


@dataclass(frozen=True)
class TabulatedResponse(Response):
    """The linear response of contacts whose lives are known without their delay.

    A model of contacts defines `transforms`, their `life_table`, `parts_of`, `life_of`,
    `mean_distance` and `wave_numbers`.
    """

    interface: Interface

    has_denominator: ClassVar[bool] = True

    @abstractmethod
    def transforms(self, velocity: float, q: ComplexArray) -> ComplexArray:
        """Four transforms of a life at wave numbers, shape (4, q.size)."""

    @abstractmethod
    def life_table(self, velocity: float) -> "CubicSpline[np.complex128]":
        """Transforms along the axis, over the logarithm of the wave number."""

    @abstractmethod
    def parts_of(
        self,
        velocity: float,
        q: ComplexArray,
        missing: ComplexArray,
        transforms: ComplexArray,
    ) -> Parts:
        """Return the parts of kappa from the transforms of a life; `missing` is
        ``1 - E``.
        """

    @abstractmethod
    def life_of(
        self, velocity: float, q: ComplexArray, transforms: ComplexArray
    ) -> Unperturbed:
        """Return an unperturbed life from its transforms."""

    @abstractmethod
    def mean_distance(self, velocity: float) -> float:
        """Return the mean distance slid in a life."""

    @abstractmethod
    def wave_numbers(self, away: float, most: int) -> Array:
        """Return wave numbers, in at most `most` steps, that resolve contacts which
        stay detached over the distance `away`.
        """

    @cached_property
    def without_delay(self) -> Self:
        """The response of the same contacts without a delay."""
        return replace(self, interface=replace(self.interface, delay=Delay(0.0)))

    def fluctuations(self, velocity: float, s: ComplexArray) -> Fluctuations:
        return self._fluctuations(velocity, s, self.transforms(velocity, s / velocity))

    def along_axis(self, velocity: float, omega: Array) -> Fluctuations:
        found = self._tabulated(velocity, omega)
        return self._fluctuations(velocity, 1j * omega, found)

    def parts_at(self, velocity: float, s: ComplexArray) -> Parts:
        if self.inert:
            return super().parts_at(velocity, s)
        return self._parts(velocity, s, self.transforms(velocity, s / velocity))

    def sampled(self, velocity: float, top: float) -> tuple[Array, Parts]:
        del top  # the frequencies extend to where the phase is constant
        return _kept_sample(self, velocity)

    def sample(self, velocity: float) -> tuple[Array, Parts]:
        """Return `sampled`, which no body changes."""
        omega = self._followed(velocity, _MOST_STEPS)
        found = self._tabulated(velocity, omega)
        return omega, self._parts(velocity, 1j * omega, found)

    def frequencies(self, velocity: float, top: float) -> Array:
        del top
        return self._followed(velocity, FEW_STEPS)

    def cycle(self, velocity: float) -> float:
        """Mean time between two attachments of a contact."""
        detached = self.interface.delay.moment(1)
        return self.mean_distance(velocity) / velocity + detached

    def scales(self, velocity: float) -> ResponseScales:
        cycle = self.cycle(velocity)
        return ResponseScales(
            cycle,
            cycle,
            cycle,
            fastest=math.inf,
            leftmost=-8.0 / cycle,
        )

    def _followed(self, velocity: float, most: int) -> Array:
        """Return frequencies, in at most `most` steps, that resolve contacts and
        delays.
        """
        away = velocity * self.interface.delay.longest
        return velocity * self.wave_numbers(away, most)

    def _tabulated(self, velocity: float, omega: Array) -> ComplexArray:
        """Return the transforms of a life along the axis, computed beyond the table."""
        y = omega / velocity
        table = self.without_delay.life_table(velocity)
        low, high = np.exp(table.x[[0, -1]])
        inside = (y >= low) & (y <= high)
        found = np.empty((4, y.size), dtype=complex)
        found[:, inside] = table(np.log(y[inside]))
        found[:, ~inside] = self.transforms(velocity, 1j * y[~inside])
        return found

    def _parts(
        self, velocity: float, s: ComplexArray, transforms: ComplexArray
    ) -> Parts:
        missing = np.asarray(self.interface.delay.absence(s))
        return self.parts_of(velocity, s / velocity, missing, transforms)

    def _fluctuations(
        self, velocity: float, s: ComplexArray, transforms: ComplexArray
    ) -> Fluctuations:
        delay = self.interface.delay
        q = s / velocity
        missing = np.asarray(delay.absence(s))
        away = velocity * delay.moment(1)
        life = self.life_of(velocity, q, transforms)
        noise = life.noise(q, missing, away, self.interface.sliding_force) / velocity
        kappa = self.parts_of(velocity, q, missing, transforms).kappa
        return Fluctuations(kappa, noise)


@lru_cache(maxsize=4)  # of some megabytes each
def _kept_sample(response: TabulatedResponse, velocity: float) -> tuple[Array, Parts]:
    return response.sample(velocity)
