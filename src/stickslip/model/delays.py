"""Time that a broken contact stays detached."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from stickslip.arrays import Array, ComplexArray, Nodes
from stickslip.errors import InputError
from stickslip.model.distribution import nodes_between
from stickslip.model.distributions import Distribution, Gaussian
from stickslip.model.records import Number, Record, registry

Parts = tuple[Nodes, list[tuple[float, Distribution]]]
NegativeDelay = Literal["clip", "redraw", "fold"]


class DelayModel(Record):
    """Time that a broken contact stays detached: `Delay`, `RandomDelay`, or a
    distribution of the user's own.

    A user's distribution gives `sample`, and `parts` or `quadrature`; the other methods
    follow from these.
    """

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """Draw `size` delays."""
        raise NotImplementedError

    def parts(self) -> Parts:
        """Discrete delays with their weights, and continuous distributions with theirs;
        by default discrete delays only.

        If the weights sum to less than 1, the rest is the fraction of contacts that
        never re-attach in smooth sliding.
        """
        return self.quadrature(), []

    def quadrature(self) -> Nodes:
        """Increasing delays and their weights, for the mean of a smooth function of the
        delay.
        """
        (tau, weight), rest = self.parts()
        if not rest:
            return tau, weight
        low, high = np.array([distribution.support for _, distribution in rest]).T
        node, density = nodes_between(low.min(), high.max(), 96)
        density = density * sum(
            part * distribution.density(node) for part, distribution in rest
        )
        density *= sum(part for part, _ in rest) / density.sum()
        return np.append(tau, node), np.append(weight, density)

    def moment(self, order: int) -> float:
        """Mean of ``tau**order``."""
        if order == 0:
            return 1.0
        (tau, weight), rest = self.parts()
        if weight.sum() + sum(part for part, _ in rest) < 1.0 - 1e-9:
            return math.inf
        mean = sum(part * distribution.moment(order) for part, distribution in rest)
        return float(weight @ tau**order + mean)

    def laplace(self, s: ArrayLike) -> ComplexArray:
        """Mean of ``exp(-s tau)`` at complex `s`."""
        s = np.asarray(s, dtype=complex)
        (tau, weight), rest = self.parts()
        total = np.exp(-s[..., None] * tau) @ weight
        return total + sum(
            part * distribution.laplace(s) for part, distribution in rest
        )

    def absence(self, s: ArrayLike) -> ComplexArray:
        """``1 - laplace(s)``, without cancellation at small `s`."""
        s = np.asarray(s, dtype=complex)
        missing = 1.0 - self.laplace(s)
        one, two, three = self._moments
        if math.isinf(one):
            return missing
        small = np.abs(s) * three < 1e-4 * two
        return np.where(small, s * (one - s * (two / 2 - s * three / 6)), missing)

    @cached_property
    def _moments(self) -> tuple[float, float, float]:
        return self.moment(1), self.moment(2), self.moment(3)

    @cached_property
    def longest(self) -> float:
        """Delay that one contact in 1e5 exceeds."""
        tau, weight = self.quadrature()
        beyond = np.cumsum(weight[::-1])[::-1]
        return float(np.max(tau[beyond > 1e-5], initial=self.moment(1)))


DELAYS, register = registry("delay")
"""The delays that rig files can name; ``@register("constant rate")`` gives a class
its name there.
"""


@register("fixed")
@dataclass(frozen=True)
class Delay(DelayModel):
    """The same delay time for every broken contact: 0 for none, infinity for
    contacts that never re-attach.
    """

    time: Annotated[
        float, Number("time", at_least=0, infinite=True, hint="the delay time tau_d")
    ]

    @property
    def mean(self) -> float:
        return self.time

    def with_mean(self, value: float) -> Self:
        """Return the delay with another time."""
        return replace(self, time=value)

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        del rng
        return np.full(size, self.time)

    def quadrature(self) -> Nodes:
        count = 0 if math.isinf(self.time) else 1
        return np.full(count, self.time), np.ones(count)

    def absence(self, s: ArrayLike) -> ComplexArray:
        s = np.asarray(s, dtype=complex)
        return np.ones_like(s) if math.isinf(self.time) else -np.expm1(-s * self.time)


@register("on arrest")
@dataclass(frozen=True)
class OnArrest(DelayModel):
    """Broken contacts re-attach when the slider next stops, however long that takes:
    never, in smooth sliding.

    This is the limit of a delay much longer than a slip and much shorter than the
    interval between slips.
    """

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        del rng
        return np.full(size, math.inf)

    def quadrature(self) -> Nodes:
        return np.empty(0), np.empty(0)


@register("random")
@dataclass(frozen=True, kw_only=True)
class RandomDelay(DelayModel):
    """Delay times drawn from a Gaussian, with a rule for negative draws.

    Parameters
    ----------
    mean, std : float
        Mean and standard deviation of the Gaussian, before the rule for negative draws
        is applied.
    negative : {"clip", "redraw", "fold"}
        A negative draw becomes 0, is drawn again, or changes sign. The paper does not
        say which it used, and its Fig. 7b depends on it.
    """

    mean: Annotated[float, Number("time", at_least=0)]
    std: Annotated[float, Number("time", above=0)]
    negative: NegativeDelay = "clip"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.std < 1e-9 * self.mean:
            raise InputError(
                f"RandomDelay.std = {self.std:g}: too small beside {self.mean:g}; use "
                "Delay instead"
            )

    def with_mean(self, value: float) -> Self:
        """Return the delays with another mean, the standard deviation scaled in
        proportion.
        """
        if self.mean == 0:
            raise InputError(
                f"{self!r}: cannot be scaled; use Delay(time), or a mean above 0"
            )
        return replace(self, mean=value, std=self.std * value / self.mean)

    @cached_property
    def _parts(self) -> Parts:
        positive = float(special.ndtr(self.mean / self.std))
        clipped = self.negative == "clip" and positive < 1.0
        atom = np.array([1.0 - positive] if clipped else [])
        halves = [(positive, self.mean)]
        if self.negative == "fold":
            halves.append((1.0 - positive, -self.mean))
        # A folded tail of so little weight does not matter, and has too little
        # probability to be normalised as a distribution.
        kept = [(part, mean) for part, mean in halves if part > 2e-6]
        total = sum(part for part, _ in kept) / (1.0 - atom.sum())
        cut = [
            (part / total, Gaussian(mean=mean, std=self.std, lower=0.0))
            for part, mean in kept
        ]
        return (np.zeros_like(atom), atom), list(cut)

    def parts(self) -> Parts:
        return self._parts

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        if self.negative == "redraw":
            return Gaussian(mean=self.mean, std=self.std, lower=0.0).sample(rng, size)
        values = rng.normal(self.mean, self.std, size)
        return np.maximum(values, 0.0) if self.negative == "clip" else np.abs(values)
