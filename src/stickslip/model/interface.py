"""The records that describe a rig: the interface, the delay or ageing of its contacts, and the slider.

Natural units throughout: contact stiffness ``k = 1``, mean threshold force ``f_s = 1``, hence stretchings in units of
``x_s = f_s/k``; everything per contact. Time is in any unit the user likes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from stickslip.errors import InputError, instance, number, shown
from stickslip.model.distributions import Distribution, Gaussian

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

NegativeDelay = Literal["clip", "redraw", "fold"]


@runtime_checkable
class DelayModel(Protocol):
    """How long a broken contact stays detached: `Delay`, `RandomDelay`, or a distribution of the user's own."""

    def moment(self, order: int) -> float:
        """Mean of ``tau**order``."""
        ...

    def laplace(self, s: ArrayLike) -> ComplexArray:
        """Mean of ``exp(-s tau)`` at complex `s`."""
        ...

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` delays."""
        ...

    def quadrature(self) -> tuple[Array, Array]:
        """Rising delays and their weights, for the mean of a smooth function of the delay."""
        ...


@dataclass(frozen=True)
class Delay(DelayModel):
    """The same delay time for every broken contact: 0 for none, infinity for contacts that never re-attach."""

    time: float

    def __post_init__(self) -> None:
        checked = number("Delay.time", self.time, at_least=0, infinite=True, hint="the delay time tau_d")
        object.__setattr__(self, "time", checked)

    def moment(self, order: int) -> float:
        """Mean of ``tau**order``."""
        return self.time**order

    def laplace(self, s: ArrayLike) -> ComplexArray:
        """Mean of ``exp(-s tau)``."""
        s = np.asarray(s, dtype=complex)
        return np.zeros_like(s) if math.isinf(self.time) else np.asarray(np.exp(-s * self.time))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Return `size` times the delay; no random number is drawn."""
        del rng
        return np.full(size, self.time)

    def quadrature(self) -> tuple[Array, Array]:
        """One node of weight 1; no node when contacts never re-attach."""
        count = 0 if math.isinf(self.time) else 1
        return np.full(count, self.time), np.ones(count)


@dataclass(frozen=True, kw_only=True)
class RandomDelay(DelayModel):
    """Delay times drawn from a Gaussian, with the fate of negative draws stated.

    Parameters
    ----------
    mean, std : float
        Mean and standard deviation of the Gaussian, before negative draws are dealt with.
    negative : {"clip", "redraw", "fold"}
        A negative draw becomes 0, is drawn again, or changes sign. The paper does not say which it used, and its
        Fig. 7b depends on it.
    """

    mean: float
    std: float
    negative: NegativeDelay = "clip"

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", number("RandomDelay.mean", self.mean, at_least=0))
        object.__setattr__(self, "std", number("RandomDelay.std", self.std, above=0))
        if self.std < 1e-9 * self.mean:
            raise InputError(f"RandomDelay.std = {self.std:g}: too small beside {self.mean:g}; use Delay instead")
        if self.negative not in get_args(NegativeDelay):
            allowed = ", ".join(get_args(NegativeDelay))
            raise InputError(f"RandomDelay.negative = {shown(self.negative)}: must be one of {allowed}")

    def _parts(self) -> tuple[float, list[tuple[float, float]]]:
        """Weight of the atom at zero, and (weight, mean) of each Gaussian cut off below zero."""
        positive = float(special.ndtr(self.mean / self.std))
        match self.negative:
            case "clip":
                return 1.0 - positive, [(positive, self.mean)]
            case "redraw":
                return 0.0, [(1.0, self.mean)]
            case "fold":
                return 0.0, [(positive, self.mean), (1.0 - positive, -self.mean)]

    def _gaussian_parts(self) -> list[tuple[float, Gaussian]]:
        # A folded tail too thin to matter is also too thin for a distribution of its own.
        kept = [(weight, mean) for weight, mean in self._parts()[1] if weight > 2e-6]
        total = sum(weight for weight, _ in kept) / (1.0 - self._parts()[0])
        return [(w / total, Gaussian(mean=mean, std=self.std, lower=0.0)) for w, mean in kept]

    def moment(self, order: int) -> float:
        """Mean of ``tau**order``."""
        atom = self._parts()[0] if order == 0 else 0.0
        return atom + sum(weight * distribution.moment(order) for weight, distribution in self._gaussian_parts())

    def laplace(self, s: ArrayLike) -> ComplexArray:
        """Mean of ``exp(-s tau)``."""
        s = np.asarray(s, dtype=complex)
        total = np.full_like(s, self._parts()[0])
        for weight, distribution in self._gaussian_parts():
            total = total + weight * distribution.laplace(s)
        return total

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` delays."""
        if self.negative == "redraw":
            return Gaussian(mean=self.mean, std=self.std, lower=0.0).sample(rng, size)
        values = rng.normal(self.mean, self.std, size)
        return np.maximum(values, 0.0) if self.negative == "clip" else np.abs(values)

    def quadrature(self) -> tuple[Array, Array]:
        """Gauss-Legendre nodes on the continuous part, and the atom at zero if negative draws are clipped."""
        parts = self._gaussian_parts()
        low = min(distribution.support[0] for _, distribution in parts)
        high = max(distribution.support[1] for _, distribution in parts)
        node, weight = np.polynomial.legendre.leggauss(96)
        tau = low + 0.5 * (high - low) * (1 + node)
        density = sum((w * distribution.density(tau) for w, distribution in parts), start=np.zeros_like(tau))
        weights = 0.5 * (high - low) * weight * density
        atom = self._parts()[0]
        weights *= (1.0 - atom) / weights.sum()
        if atom > 0:
            tau, weights = np.append(0.0, tau), np.append(atom, weights)
        return tau, weights


@dataclass(frozen=True, kw_only=True)
class Langevin:
    """Thresholds that age towards the interface's Gaussian distribution as an Ornstein-Uhlenbeck process, Eqs. (13)-(16).

    ``df = beta^2 (f_0 - f) dt + beta delta f_0 sqrt(2) dW``, with ``f_0`` and ``delta`` the mean and the relative
    standard deviation of ``Interface.thresholds``.

    Parameters
    ----------
    rate : float
        ``beta``, in 1/sqrt(time): thresholds reach their stationary distribution within a time ``beta**-2``.
    newborn : float
        Threshold force of a newborn contact, in units of ``f_s``.
    """

    rate: float
    newborn: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "rate", number("Langevin.rate", self.rate, above=0, hint="beta"))
        object.__setattr__(self, "newborn", number("Langevin.newborn", self.newborn, at_least=0))


@dataclass(frozen=True, kw_only=True)
class ExponentialGrowth:
    """Thresholds that grow as ``f(t) = f_end - (f_end - newborn) exp(-rate t)``.

    ``f_end`` is drawn from the interface's distribution of thresholds at birth; `rate` is in 1/time, `newborn` in
    ``f_s``.
    """

    rate: float
    newborn: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "rate", number("ExponentialGrowth.rate", self.rate, above=0))
        object.__setattr__(self, "newborn", number("ExponentialGrowth.newborn", self.newborn, at_least=0))


@dataclass(frozen=True, kw_only=True)
class LogarithmicGrowth:
    """Thresholds that grow as ``f(t) = f_0 + slope ln(1 + t/time)``, the ageing of creeping asperities.

    ``f_0`` is drawn from the interface's distribution of thresholds at birth; `slope` is in ``f_s``, `time` in time.
    """

    slope: float
    time: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "slope", number("LogarithmicGrowth.slope", self.slope, at_least=0))
        object.__setattr__(self, "time", number("LogarithmicGrowth.time", self.time, above=0))


Strengthening = Langevin | ExponentialGrowth | LogarithmicGrowth


@dataclass(frozen=True, kw_only=True)
class Interface:
    """An interface made of many contacts.

    Parameters
    ----------
    thresholds : Distribution
        Distribution of the stretchings at which contacts break, ``P_c``; conditioned on positive values by the solvers.
    initial : Distribution
        Distribution of the stretchings at the start, ``Q(x; X=0)``; a contact that starts at ``x_0`` has a threshold
        beyond ``|x_0|``. `SteadyState` starts from the distribution of smooth sliding.
    delay : DelayModel
        How long a broken contact stays detached.
    ageing : Strengthening, optional
        How thresholds grow with the age of a contact; by default they do not.
    """

    thresholds: Distribution
    initial: Distribution = Gaussian(mean=0.0, std=0.01)
    delay: DelayModel = Delay(0.0)
    ageing: Strengthening | None = None

    def __post_init__(self) -> None:
        instance(
            "Interface.thresholds", self.thresholds, Distribution, "a distribution, such as Gaussian(mean=1.0, std=0.1)"
        )
        instance(
            "Interface.initial", self.initial, Distribution, "a distribution, such as Gaussian(mean=0.0, std=0.01)"
        )
        instance("Interface.delay", self.delay, DelayModel, "a delay, such as Delay(0.2)")
        if self.ageing is not None:
            instance("Interface.ageing", self.ageing, Strengthening, "a ageing model, such as Langevin(rate=1.5)")
        lost = self.initial_loss
        if lost > 1e-3:
            raise InputError(
                f"Interface.initial = {self.initial}: {100 * lost:.3g} % of the contacts would start beyond the "
                f"largest threshold ({self.threshold_distribution.support[1]:g}); narrow it or bring it nearer to 0"
            )

    @cached_property
    def threshold_distribution(self) -> Distribution:
        """The distribution of thresholds conditioned on positive values, as every solver uses it."""
        return self.thresholds.positive()

    @property
    def initial_loss(self) -> float:
        """Fraction of the initial distribution that lies beyond the largest threshold on either side."""
        high = self.threshold_distribution.support[1]
        beyond = self.initial.survival([high, -high])
        return float(beyond[0] + 1.0 - beyond[1])


@dataclass(frozen=True, kw_only=True)
class Slider:
    """The slider and its driving spring, Eq. (11), per contact.

    Parameters
    ----------
    stiffness : float
        Stiffness of the driving spring ``K/N`` in units of ``k``.
    mass : float
        ``M/N`` in units of ``f_s * time**2 / x_s``. Zero is the massless limit: theory of stability only.
    damping : float
        ``eta`` in 1/time.
    """

    stiffness: float
    mass: float
    damping: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "stiffness", number("Slider.stiffness", self.stiffness, above=0, hint="K/N"))
        object.__setattr__(self, "mass", number("Slider.mass", self.mass, at_least=0, hint="M/N"))
        object.__setattr__(self, "damping", number("Slider.damping", self.damping, at_least=0, hint="eta"))

    @property
    def frequency(self) -> float:
        """Angular frequency ``Omega = sqrt(K/M)`` of the slider on its spring alone; infinite without mass."""
        return math.sqrt(self.stiffness / self.mass) if self.mass > 0 else math.inf


@dataclass(frozen=True, kw_only=True)
class PaperCase:
    """Parameters of one figure of the paper."""

    interface: Interface
    slider: Slider
    velocity: float
    contacts: int


def _relative(ratio: float, stiffness: float, mass: float) -> float:
    return ratio * math.sqrt(stiffness / mass)


_NARROW = Gaussian(mean=0.0, std=0.01)
_TENTH = Gaussian(mean=1.0, std=0.1)

FIG1 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW),
    slider=Slider(stiffness=2.0, mass=1e-4, damping=200.0),
    velocity=1.0,
    contacts=1_000,
)
FIG2 = FIG1
FIG3 = FIG1
FIG4 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, delay=Delay(0.2)),
    slider=Slider(stiffness=2.0, mass=1e-4, damping=200.0),
    velocity=1.0,
    contacts=10_000,
)
FIG5 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, delay=Delay(math.inf)),
    slider=FIG4.slider,
    velocity=1.0,
    contacts=10_000,
)
FIG6 = PaperCase(
    interface=FIG4.interface,
    slider=Slider(stiffness=2.0, mass=1e-4, damping=_relative(0.3, 2.0, 1e-4)),
    velocity=1.0,
    contacts=10_000,
)
FIG7 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, delay=Delay(0.1)),
    slider=FIG6.slider,
    velocity=1.0,
    contacts=10_000,
)
FIG8 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, ageing=Langevin(rate=1.5)),
    slider=Slider(stiffness=1.0, mass=1e-4, damping=_relative(0.1, 1.0, 1e-4)),
    velocity=1.0,
    contacts=2_000,
)
FIG9 = FIG8
FIG10 = FIG8
FIG11 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, ageing=Langevin(rate=1.0)),
    slider=FIG8.slider,
    velocity=1.0,
    contacts=2_000,
)
