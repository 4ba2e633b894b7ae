"""How long a broken contact stays detached."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from stickslip.errors import InputError
from stickslip.model.distributions import Distribution, Gaussian
from stickslip.model.records import Number, check
from stickslip.model.registry import registrar

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_NODE, _WEIGHT = np.polynomial.legendre.leggauss(96)
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

    def parts(self) -> tuple[tuple[Array, Array], list[tuple[float, Distribution]]]:
        """Given times and their weights, and the distributions of the rest with theirs; by default given times only."""
        return self.quadrature(), []

    def absence(self, s: ArrayLike) -> ComplexArray:
        """``1 - laplace(s)``, without cancellation at small `s`."""
        s = np.asarray(s, dtype=complex)
        missing = np.asarray(1.0 - self.laplace(s))
        one, two, three = (self.moment(n) for n in (1, 2, 3))
        small = np.abs(s) * three < 1e-4 * two
        return np.where(small, s * (one - s * (two / 2 - s * three / 6)), missing)

    @property
    def longest(self) -> float:
        """Delay that one contact in 1e5 exceeds."""
        tau, weight = self.quadrature()
        beyond = np.cumsum(weight[::-1])[::-1]
        return float(np.max(tau[beyond > 1e-5], initial=self.moment(1)))


DELAYS: dict[str, type] = {}
"""The delays that rig files can name."""

register = registrar(DELAYS, "delay")
"""Class decorator: ``@register("constant rate")`` gives a delay the name that rig files use."""


@register("fixed")
@dataclass(frozen=True)
class Delay(DelayModel):
    """The same delay time for every broken contact: 0 for none, infinity for contacts that never re-attach."""

    time: Annotated[float, Number("time", at_least=0, infinite=True, hint="the delay time tau_d")]

    def __post_init__(self) -> None:
        check(self)

    @property
    def mean(self) -> float:
        return self.time

    def with_mean(self, value: float) -> Delay:
        """Return a delay of another time."""
        return Delay(value)

    def moment(self, order: int) -> float:
        return self.time**order

    def laplace(self, s: ArrayLike) -> ComplexArray:
        s = np.asarray(s, dtype=complex)
        return np.zeros_like(s) if math.isinf(self.time) else np.asarray(np.exp(-s * self.time))

    def absence(self, s: ArrayLike) -> ComplexArray:
        s = np.asarray(s, dtype=complex)
        return np.ones_like(s) if math.isinf(self.time) else np.asarray(-np.expm1(-s * self.time))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        del rng
        return np.full(size, self.time)

    def quadrature(self) -> tuple[Array, Array]:
        count = 0 if math.isinf(self.time) else 1
        return np.full(count, self.time), np.ones(count)


@register("on arrest")
@dataclass(frozen=True)
class OnArrest(DelayModel):
    """Broken contacts re-attach when the slider next stops, however long that takes: never, in smooth sliding.

    What a delay much longer than a slip and much shorter than the time between slips comes to.
    """

    def moment(self, order: int) -> float:
        return 1.0 if order == 0 else math.inf

    def laplace(self, s: ArrayLike) -> ComplexArray:
        return np.zeros_like(np.asarray(s, dtype=complex))

    def absence(self, s: ArrayLike) -> ComplexArray:
        return np.ones_like(np.asarray(s, dtype=complex))

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        del rng
        return np.full(size, math.inf)

    def quadrature(self) -> tuple[Array, Array]:
        return np.empty(0), np.empty(0)


@register("random")
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

    mean: Annotated[float, Number("time", at_least=0)]
    std: Annotated[float, Number("time", above=0)]
    negative: NegativeDelay = "clip"

    def __post_init__(self) -> None:
        check(self)
        if self.std < 1e-9 * self.mean:
            raise InputError(f"RandomDelay.std = {self.std:g}: too small beside {self.mean:g}; use Delay instead")

    def with_mean(self, value: float) -> RandomDelay:
        """Return the delays scaled to another mean, the standard deviation in proportion."""
        if self.mean == 0:
            raise InputError(f"{self!r}: cannot be scaled; use Delay(time), or a mean above 0")
        return replace(self, mean=value, std=self.std * value / self.mean)

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

    @cached_property
    def _gaussian_parts(self) -> list[tuple[float, Gaussian]]:
        # A folded tail too thin to matter is also too thin for a distribution of its own.
        kept = [(weight, mean) for weight, mean in self._parts()[1] if weight > 2e-6]
        total = sum(weight for weight, _ in kept) / (1.0 - self._parts()[0])
        return [(w / total, Gaussian(mean=mean, std=self.std, lower=0.0)) for w, mean in kept]

    def parts(self) -> tuple[tuple[Array, Array], list[tuple[float, Distribution]]]:
        atom = self._parts()[0]
        gaussians: list[tuple[float, Distribution]] = list(self._gaussian_parts)
        return (np.zeros(1 if atom > 0 else 0), np.full(1 if atom > 0 else 0, atom)), gaussians

    def moment(self, order: int) -> float:
        atom = self._parts()[0] if order == 0 else 0.0
        return atom + sum(weight * distribution.moment(order) for weight, distribution in self._gaussian_parts)

    def laplace(self, s: ArrayLike) -> ComplexArray:
        s = np.asarray(s, dtype=complex)
        total = np.full_like(s, self._parts()[0])
        for weight, distribution in self._gaussian_parts:
            total = total + weight * distribution.laplace(s)
        return total

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        if self.negative == "redraw":
            return Gaussian(mean=self.mean, std=self.std, lower=0.0).sample(rng, size)
        values = rng.normal(self.mean, self.std, size)
        return np.maximum(values, 0.0) if self.negative == "clip" else np.abs(values)

    def quadrature(self) -> tuple[Array, Array]:
        """Gauss-Legendre nodes on the continuous part, and the atom at zero if negative draws are clipped."""
        parts = self._gaussian_parts
        low = min(distribution.support[0] for _, distribution in parts)
        high = max(distribution.support[1] for _, distribution in parts)
        tau = low + 0.5 * (high - low) * (1 + _NODE)
        density = sum((w * distribution.density(tau) for w, distribution in parts), start=np.zeros_like(tau))
        weights = 0.5 * (high - low) * _WEIGHT * density
        atom = self._parts()[0]
        weights *= (1.0 - atom) / weights.sum()
        if atom > 0:
            tau, weights = np.append(0.0, tau), np.append(atom, weights)
        return tau, weights
