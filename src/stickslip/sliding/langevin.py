"""Steady sliding of contacts whose thresholds age by `Langevin`: force and linear response.

The force comes from the stationary kinetic equation of Eqs. (13)-(17), the dynamic stiffness from the linearised one,
see `stickslip.kernels.langevin_response`; it has no closed form. In units of
``rate**2`` it depends on the reduced speed ``u = v/(rate**2 f_0)`` and on ``s/rate**2`` alone, so one table serves all
rates, speeds and rigs: what a life contributes is computed on the imaginary axis at fixed values of u, when they are
first needed, and interpolated between them. Delays enter in closed form. At a speed for which it is asked for, the
response is computed without the table: some ten milliseconds, and then some ten microseconds for each point on the axis
or off it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.errors import InputError, instance
from stickslip.model import DelayModel, Interface, Langevin
from stickslip.model.distributions import Gaussian
from stickslip.sliding.lives import hazard_of
from stickslip.sliding.response import (
    Array,
    ComplexArray,
    Parts,
    Precision,
    Response,
    Sliding,
    check_delay,
    speed_by_speed,
)

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

    from stickslip.kernels.langevin import Langevin as Constants
    from stickslip.kernels.langevin_response import Excursions

_PER_DECADE, _ABOUT_ONE = 12.0, 5.0
"""Reduced speeds in the table, and how many more where newborns just leave their boundary (`_place`)."""
_STENCIL = 8
"""Rows of the table from which kappa is interpolated."""
_SLOWEST, _FASTEST = 1e-3, 50.0
"""Reduced speeds for which the response is computed."""
_RESOLVED = 1e-12, 1e6
"""Speeds over ``rate**2`` between which the stationary kinetic equation is resolved."""
_LOWEST, _HIGHEST = 0.01, 1e6
"""Phases of a life down to which the table goes, and up to which; below, kappa is in proportion to the frequency."""


@dataclass(frozen=True, kw_only=True)
class AgedResponse(Response):
    """The linear response of ageing contacts with a Gaussian distribution of thresholds and a delay."""

    ageing: Langevin
    distribution: Gaussian
    delay: DelayModel

    # Of the table; about sharp resonances at low speed it is some times less. Counts come from it, crossings do not.
    precision: ClassVar[Precision] = Precision(accuracy=1e-3, step=1e-4, settled=1e-5, slack=1e-3)
    lives: ClassVar[float] = 4.0

    def axis_parts(self, velocity: float | Array, omega: Array) -> Parts:
        """Kappa on the imaginary axis, from the table."""
        return speed_by_speed(self._on_axis, velocity, 1j * omega)

    def parts(self, velocity: float | Array, s: ComplexArray) -> Parts:
        """Kappa at any s not far left of the axis, without the table."""
        return speed_by_speed(self._at_points, velocity, s)

    def _at_points(self, velocity: float, s: ComplexArray) -> ComplexArray:
        p = s / self._square
        return self._join(p, *_life(self._reduced(velocity), *self._shape, p))

    def frequencies(self, velocity: float, top: float) -> Array:
        """Angular frequencies that follow every turn of kappa, and beyond which its loss is positive."""
        del top
        u = self._reduced(velocity)
        longest = 1.0 / (u + u * u) + float(np.max(self._delays[0], initial=0.0))
        fine = np.arange(1.0, 4000.0) * 0.2 / longest
        highest = _top(u, self._shape[0])
        w = np.union1d(np.geomspace(1e-4 / longest, highest, 240), fine[fine < highest])
        return np.asarray(w * self._square)

    def cycle(self, velocity: float) -> float:
        """About how long a contact lives."""
        u = self._reduced(velocity)
        return 1.0 / ((u + u * u) * self._square)

    @cached_property
    def _square(self) -> float:
        return self.ageing.rate**2

    @cached_property
    def _shape(self) -> tuple[float, float]:
        """Standard deviation of thresholds and strength of newborns, in units of the mean threshold."""
        return self.distribution.std / self.distribution.mean, self.ageing.newborn / self.distribution.mean

    @cached_property
    def _delays(self) -> tuple[Array, Array]:
        """Delays in units of ``rate**-2``, and their weights."""
        delay, weight = self.delay.quadrature()
        return delay * self._square, weight

    def _reduced(self, velocity: float) -> float:
        u = velocity / (self._square * self.distribution.mean)
        if not _SLOWEST <= u <= _FASTEST:
            raise InputError(
                f"velocity: is {u:.3g} times that of ageing, rate^2 times the mean threshold; the stability of ageing "
                f"contacts is computed from {_SLOWEST:g} to {_FASTEST:g} times it"
            )
        return u

    def _on_axis(self, velocity: float, s: ComplexArray) -> ComplexArray:
        """Kappa on the imaginary axis, from the table."""
        u, w = self._reduced(velocity), np.asarray(s.imag / self._square, dtype=float)
        unit = u + u * u
        top = _top(u, self._shape[0])
        size = np.clip(np.abs(w), _LOWEST * unit, top)
        parts, rest = _at(u, *self._shape)
        kappa = self._join(1j * size, parts(np.log(size / unit)), rest)
        slow, fast = np.abs(w) / size, top / np.maximum(np.abs(w), top)
        kappa = np.where(slow < 1, slow * slow * kappa.real + 1j * slow * kappa.imag, kappa)
        kappa = 1.0 - (1.0 - kappa) * fast ** (0.5 if self.ageing.newborn == 0 else 1.0)
        return np.asarray(np.where(w < 0, np.conj(kappa), kappa))

    def _join(self, p: ComplexArray, parts: ComplexArray, rest: float) -> ComplexArray:
        """Kappa from the transforms of a life and of the delay."""
        life, work, less, lost = parts
        tau, weight = self._delays
        if tau.max(initial=0.0) == 0.0:
            again = less * work / life
        else:
            back = np.exp(-np.multiply.outer(p, tau)) @ weight
            away = (-np.expm1(-np.multiply.outer(p, tau))) @ weight
            again = np.zeros_like(p)
            moves = p != 0
            again[moves] = (less * work * back * p)[moves] / (life * back * p + away)[moves]
        kappa = (rest - life + lost - again) / (rest + float(tau @ weight))
        return np.asarray(np.where(p == 0, 0.0, kappa))


class ByKineticEquation(Sliding):
    """Steady sliding of contacts whose thresholds age by `Langevin`."""

    def __post_init__(self) -> None:
        self.interface.allow(("temperature",), "smooth sliding of thresholds that age by Langevin")

    def force(self, velocity: Array) -> Array:
        """Force per contact, by the stationary kinetic equation of Eqs. (13)-(17)."""
        from stickslip.kernels import langevin_steady

        constants, delay = ageing_constants(self.interface), self.interface.delay.moment(1)
        for value in (float(velocity.min()), float(velocity.max())):
            if not _RESOLVED[0] <= (relative := value / constants.rate**2) <= _RESOLVED[1]:
                raise InputError(
                    f"kinetic_friction: velocity = {value:g} is {relative:.3g} times rate**2 = "
                    f"{constants.rate**2:.3g} of the ageing: must be between {_RESOLVED[0]:g} and {_RESOLVED[1]:g} "
                    "times; beyond, the force cannot be resolved"
                )
        return langevin_steady.steady_friction(velocity, constants, delay, hazard=hazard_of(self.interface.temperature))

    def response(self) -> AgedResponse:
        """Return the linear response."""
        self.interface.allow((), "the linear response of thresholds that age by Langevin")
        check_delay(self.interface.delay)
        ageing, distribution = gaussian_ageing(self.interface)
        return AgedResponse(ageing=ageing, distribution=distribution, delay=self.interface.delay)


@lru_cache(maxsize=64)
def _known(u: float, delta: float, newborn: float) -> Excursions:
    """What is the same at all Laplace variables: some milliseconds."""
    from stickslip.kernels.langevin import Life
    from stickslip.kernels.langevin_response import excursions

    try:
        return excursions(Life(u, delta, newborn))
    except ValueError:
        raise InputError(
            f"Interface.thresholds: their standard deviation is {delta:.3g} of the mean; the linear response of ageing "
            "contacts cannot be resolved with so little scatter; give more, or simulate(...)",
            "Interface.thresholds",
        ) from None


def _life(u: float, delta: float, newborn: float, p: ComplexArray) -> tuple[ComplexArray, float]:
    """Transforms of one life, shape (4, n), and its mean length (1 for newborns without strength)."""
    from stickslip.kernels.langevin_response import life_transforms

    points = np.append(np.asarray(p, dtype=np.complex128).ravel(), 0.0)
    parts = life_transforms(_known(u, delta, newborn), points)
    if newborn == 0:  # lives from the boundary are known up to a factor
        parts /= parts[0, -1].real
    return parts[:, :-1].reshape(4, *p.shape), float(parts[0, -1].real)


def _top(u: float, delta: float) -> float:
    """Frequency, in units of ``rate**2``, up to which the table goes; above it kappa nears 1 as a power of it.

    Contacts driven into their boundary forget at the rate ``((u - 1)/delta)**2``, and only faster perturbations find
    springs.
    """
    return max(100.0, 100.0 * (max(u - 1.0, 0.0) / delta) ** 2)


def _place(u: float, delta: float) -> float:
    """Place of a reduced speed in the table: as its logarithm, and closer where newborns come to leave their boundary.

    From excursions that live long to ones that are pressed down it takes a change of u by `delta` about 1.
    """
    return _PER_DECADE * math.log10(u) + _ABOUT_ONE * math.asinh((u - 1.0) / (2.0 * delta))


@lru_cache(maxsize=256)
def _at(u: float, delta: float, newborn: float) -> tuple[CubicSpline[Any], float]:
    """Transforms of a life over the logarithm of its phase, and its mean length, between the rows of the table."""
    from scipy.interpolate import CubicSpline, KroghInterpolator

    place = _place(u, delta)
    numbers = math.floor(place) - _STENCIL // 2 + 1 + np.arange(_STENCIL)
    rows, rests = zip(*(_row(delta, newborn, number) for number in numbers.tolist()), strict=True)
    # At the same phase of a life neighbouring speeds are alike.
    parts, rest = (KroghInterpolator(numbers, np.array(each))(place) for each in (rows, rests))
    return CubicSpline(np.log(_phases(delta)), parts, axis=1), float(rest)


@lru_cache(maxsize=2048)
def _row(delta: float, newborn: float, number: int) -> tuple[ComplexArray, float]:
    """One row of the table: transforms of a life at its phases, and its mean length."""
    from scipy.optimize import brentq

    u = math.exp(brentq(lambda x: _place(math.exp(x), delta) - number, -60.0, 60.0))
    return _life(u, delta, newborn, 1j * (u + u * u) * _phases(delta))


@lru_cache(maxsize=64)
def _phases(delta: float) -> Array:
    """Phases of a life in the table: lives are in step for as many turns as their scatter allows."""
    turning = np.arange(0.3, max(30.0, min(3.0 / delta, 100.0)), 0.3)
    low, high = np.geomspace(_LOWEST, 0.3, 14, endpoint=False), np.geomspace(turning[-1], _HIGHEST, 70)[1:]
    return np.concatenate([low, turning, high])


def gaussian_ageing(interface: Interface) -> tuple[Langevin, Gaussian]:
    """Return the ageing and the stationary distribution of thresholds for the kinetic equation of Eqs. (13)-(17).

    Raises `InputError` if thresholds do not age by `Langevin` from a Gaussian, or a delay meets newborns without
    strength.
    """
    instance("interface", interface, Interface, "an Interface")
    ageing, distribution = interface.ageing, interface.thresholds
    if not isinstance(ageing, Langevin):
        raise InputError(
            f"Interface.ageing = {ageing}: the kinetic equation, and with it the stability of smooth sliding, "
            "is known for ageing by Langevin(rate, newborn) only; use that, or ageing=None"
        )
    if (
        not isinstance(distribution, Gaussian)
        or distribution.lower > 0
        or distribution.mean <= 0
        or distribution.std <= 0
    ):
        raise InputError(
            f"Interface.thresholds = {distribution}: thresholds that age by Langevin have a Gaussian as their "
            "stationary distribution, Eq. (17): give Gaussian(mean, std), both above 0 and not cut off above 0"
        )
    if interface.delay.moment(1) > 0 and ageing.newborn == 0:
        raise InputError(
            f"Langevin.newborn = 0 with Interface.delay = {interface.delay}: newborns without strength break at once "
            "and without end, and a delay after each break leaves none that holds; give newborn > 0 or no delay"
        )
    if interface.temperature is not None and ageing.newborn == 0:
        raise InputError(
            "Langevin.newborn = 0 with Interface.temperature: newborns without strength break at once and without "
            "end; give newborn > 0"
        )
    return ageing, distribution


def ageing_constants(interface: Interface) -> Constants:
    """Return what the kernels know of ageing by `Langevin`; raises what `gaussian_ageing` does."""
    from stickslip.kernels.langevin import Langevin as Constants

    ageing, distribution = gaussian_ageing(interface)
    return Constants(ageing.rate, distribution.mean, distribution.std, ageing.newborn)
