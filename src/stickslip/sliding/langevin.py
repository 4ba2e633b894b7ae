"""Steady sliding of contacts whose thresholds age by `Langevin`: force and linear
response.

The force comes from the stationary kinetic equation of Eqs. (13)-(17), the dynamic
stiffness from the linearised one, see `stickslip.kernels.langevin_response`; it has no
closed form. In units of ``rate**2`` it depends only on the reduced speed
``u = v/(rate**2 f_0)`` and on ``s/rate**2``. The transforms of a life take about ten
milliseconds for each reduced speed, and about ten microseconds for each further point.
Delays enter in closed form.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np

from stickslip.errors import InputError, instance
from stickslip.kernels import langevin_steady
from stickslip.kernels.langevin import Langevin as Constants
from stickslip.kernels.langevin import Life
from stickslip.kernels.langevin_response import Excursions, excursions, life_transforms
from stickslip.model import DelayModel, Interface, Langevin
from stickslip.model.distributions import Gaussian
from stickslip.sliding.lifetimes import hazard_of
from stickslip.sliding.response import (
    STEP,
    Array,
    ComplexArray,
    Fluctuations,
    Response,
    ResponseScales,
    perturbed,
    stretched,
)

# reduced speeds between which the response is computed
_SLOWEST = 1e-3
_FASTEST = 50.0
# speeds over ``rate**2`` between which the stationary kinetic equation is resolved
_RESOLVED = 1e-12, 1e6


@dataclass(frozen=True, kw_only=True)
class AgedResponse(Response):
    """The linear response of ageing contacts with a Gaussian distribution of
    thresholds and a delay.
    """

    constants: Constants
    delay: DelayModel

    accuracy: ClassVar[float] = 1e-3

    def fluctuations(self, velocity: float, s: ComplexArray) -> Fluctuations:
        u = self._reduced(velocity)
        p = s / self._square
        top = 1j * self._highest(u)
        fast = np.abs(p) > abs(top)
        points = np.append(np.where(fast, top, p), top)
        (life, work, less, lost), (rest, done) = _life(u, *self._shape, points)
        missing = np.asarray(self.delay.absence(points * self._square))
        away = self.delay.moment(1) * self._square
        transforms = rest - life, work, -less, -lost
        found = perturbed(transforms, points, missing, rest, away, force=0.0).kappa
        free = stretched(points, rest - life, work / u, rest, done / u)
        noise = free.noise(points, missing, away, force=0.0)
        noise *= (u * self.constants.mean) ** 2 / self._square
        # For a fast perturbation attached contacts are springs, except near their
        # thresholds, where they diffuse: kappa falls short by C/sqrt(p) + D/p, with
        # real C and D. Noise falls with the square of the frequency.
        attached = rest / (rest + away)
        short = attached - found[-1]
        first = short.real * np.sqrt(2.0 * abs(top))
        second = -(short.real + short.imag) * abs(top)
        kappa = np.where(fast, attached - first / np.sqrt(p) - second / p, found[:-1])
        return Fluctuations(
            kappa, np.where(fast, noise[-1] * np.abs(top / p) ** 2, noise[:-1])
        )

    def _highest(self, u: float) -> float:
        """Frequency, in units of ``rate**2``, up to which the panels of a life resolve
        a perturbation.
        """
        return 25.0 / float(_kept_excursions(u, *self._shape).edges[1])

    def frequencies(self, velocity: float, top: float) -> Array:
        del top
        u = self._reduced(velocity)
        longest = 1.0 / (u + u * u) + self.delay.longest * self._square
        step = STEP / longest
        highest = self._highest(u)
        top = min(4000.0 * step, 0.5 * highest)
        slow = np.geomspace(5e-4 * step, step, 60)
        fast = np.geomspace(top, highest, 90)
        return np.asarray(
            self._square
            * np.concatenate(
                [slow, np.arange(2.0 * step, top - 0.5 * step, step), fast]
            )
        )

    def scales(self, velocity: float) -> ResponseScales:
        u = self._reduced(velocity)
        cycle = 1.0 / ((u + u * u) * self._square)
        return ResponseScales(
            cycle,
            cycle,
            cycle,
            fastest=np.inf,
            leftmost=-4.0 / cycle,
        )

    @cached_property
    def _square(self) -> float:
        return self.constants.rate**2

    @cached_property
    def _shape(self) -> tuple[float, float]:
        """Standard deviation of thresholds and strength of newborns, in units of the
        mean threshold.
        """
        return (
            self.constants.std / self.constants.mean,
            self.constants.newborn / self.constants.mean,
        )

    def _reduced(self, velocity: float) -> float:
        u = velocity / (self._square * self.constants.mean)
        if not _SLOWEST <= u <= _FASTEST:
            raise InputError(
                f"velocity: is {u:.3g} times that of ageing, rate^2 times the mean "
                "threshold; the stability of ageing "
                f"contacts is computed from {_SLOWEST:g} to {_FASTEST:g} times it"
            )
        return u


def force(interface: Interface, velocity: Array) -> Array:
    """Force per contact at velocities, by the stationary kinetic equation of Eqs.
    (13)-(17).
    """
    constants = ageing_constants(interface)
    delay = interface.delay.moment(1)
    for value in (float(velocity.min()), float(velocity.max())):
        if not _RESOLVED[0] <= (relative := value / constants.rate**2) <= _RESOLVED[1]:
            raise InputError(
                f"kinetic_friction: velocity = {value:g} is {relative:.3g} times "
                "rate**2 = "
                f"{constants.rate**2:.3g} of the ageing: must be between "
                f"{_RESOLVED[0]:g} and {_RESOLVED[1]:g} "
                "times; beyond, the force cannot be resolved"
            )
    return langevin_steady.steady_friction(
        velocity,
        constants,
        delay,
        hazard=hazard_of(interface.activation),
    )


def response(interface: Interface) -> AgedResponse:
    """Return the linear response of thresholds that age by `Langevin`."""
    interface.allow(
        ("ageing",), "the linear response of thresholds that age by Langevin"
    )
    return AgedResponse(constants=ageing_constants(interface), delay=interface.delay)


@lru_cache(maxsize=64)
def _kept_excursions(u: float, delta: float, newborn: float) -> Excursions:
    """Return the part of a response that is equal for all Laplace variables; takes
    some milliseconds.
    """
    try:
        return excursions(Life(u, delta, newborn))
    except ValueError:
        raise InputError(
            f"Interface.thresholds: their standard deviation is {delta:.3g} of the "
            "mean; the linear response of ageing "
            "contacts cannot be resolved with so little scatter; give more, or "
            "simulate(...)",
            "Interface.thresholds",
        ) from None


def _life(
    u: float,
    delta: float,
    newborn: float,
    p: ComplexArray,
) -> tuple[ComplexArray, tuple[float, float]]:
    """Transforms of one life, shape (4, n), its mean length (1 for newborns without
    strength) and its work.
    """
    points = np.append(np.asarray(p, dtype=np.complex128).ravel(), 0.0)
    parts = life_transforms(_kept_excursions(u, delta, newborn), points)
    if newborn == 0:  # lifetimes from the boundary are known up to a factor
        parts /= parts[0, -1].real
    return parts[:, :-1].reshape(4, *p.shape), (
        float(parts[0, -1].real),
        float(parts[1, -1].real),
    )


def ageing_constants(interface: Interface) -> Constants:
    """Return the constants of the kinetic equation, Eqs. (13)-(17), of an interface.

    Raises `InputError` if thresholds do not age by `Langevin` from a Gaussian, or if
    newborns without strength have a delay or thermal activation.
    """
    instance("interface", interface, Interface, "an Interface")
    ageing = interface.ageing
    distribution = interface.thresholds
    if not isinstance(ageing, Langevin):
        raise InputError(
            f"Interface.ageing = {ageing}: the kinetic equation, and with it the "
            "stability of smooth sliding, "
            "is known for ageing by Langevin(rate, newborn) only; use that, or "
            "ageing=None"
        )
    if not (
        isinstance(distribution, Gaussian)
        and distribution.lower <= 0 < min(distribution.mean, distribution.std)
    ):
        raise InputError(
            f"Interface.thresholds = {distribution}: thresholds that age by Langevin "
            "have a Gaussian as their "
            "stationary distribution, Eq. (17): give Gaussian(mean, std), both above 0 "
            "and not cut off above 0"
        )
    breaking = "activation" if interface.activation is not None else "delay"
    if ageing.newborn == 0 and (
        breaking == "activation" or interface.delay.moment(1) > 0
    ):
        raise InputError(
            f"Langevin.newborn = 0 with Interface.{breaking}: contacts with zero "
            "threshold break as soon as they "
            "attach; give newborn > 0"
        )
    return Constants(ageing.rate, distribution.mean, distribution.std, ageing.newborn)
