"""The linear response of contacts whose thresholds age by `Langevin`.

The dynamic stiffness comes from the linearised kinetic equation of Eqs. (13)-(17), see
`stickslip.kernels.langevin_response`; it has no closed form. In units of ``rate**2`` it depends on the
reduced speed ``u = v/(rate**2 f_0)`` and on ``s/rate**2`` alone, so one table serves all rates, speeds and rigs: what a
life contributes is computed on the imaginary axis at fixed values of u, when they are first needed, and interpolated
between them. Delays enter in closed form. At a speed for which it is asked for, the response is computed without the
table: some ten milliseconds, and then some ten microseconds for each point on the axis or off it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import InputError
from stickslip.model import DelayModel, Interface, Langevin
from stickslip.model.distributions import Gaussian
from stickslip.model.quadrature import hashable
from stickslip.stability.from_axis import FromAxis
from stickslip.stability.response import Array, ComplexArray, Precision
from stickslip.theory import gaussian_ageing

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

    from stickslip.kernels.langevin_response import Excursions

_PER_DECADE, _ABOUT_ONE = 12.0, 5.0
"""Reduced speeds in the table, and how many more where newborns just leave their boundary (`_place`)."""
_STENCIL = 8
"""Rows of the table from which kappa is interpolated."""
_SLOWEST, _FASTEST = 1e-3, 50.0
"""Reduced speeds for which the response is computed."""
_LIVES = 4.0
"""How quickly a mode may decay to be looked for, per mean life."""
_LOWEST, _HIGHEST = 0.01, 1e6
"""Phases of a life down to which the table goes, and up to which; below, kappa is in proportion to the frequency."""


@dataclass(frozen=True, kw_only=True)
class AgedResponse(FromAxis):
    """The linear response of ageing contacts with a Gaussian distribution of thresholds and a delay."""

    ageing: Langevin
    distribution: Gaussian
    delay: DelayModel

    # Of the table; about sharp resonances at low speed it is some times less.
    accuracy: ClassVar[float] = 1e-3
    # Counts come from a table, crossings do not.
    precision: ClassVar[Precision] = Precision(step=1e-4, settled=1e-5, slack=1e-3)

    def stiffness(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)`` on the imaginary axis, from the table; `velocity` and `s` broadcast."""
        speed, s = np.broadcast_arrays(np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex))
        kappa = np.empty(s.shape, dtype=complex)
        for v in np.unique(speed):
            here = speed == v
            kappa[here] = self._on_axis(self._reduced(float(v)), s[here].imag / self._square)
        return kappa

    def exact(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)`` at any s not far left of the axis; `velocity` and `s` broadcast."""
        speed, s = np.broadcast_arrays(np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex))
        kappa = np.empty(s.shape, dtype=complex)
        for v in np.unique(speed):
            here = speed == v
            p = s[here] / self._square
            parts, rest = _life(self._reduced(float(v)), *self._shape, p)
            kappa[here] = self._join(p, parts, rest)
        return kappa

    def frequencies(self, velocity: float) -> Array:
        """Angular frequencies that follow every turn of kappa, and beyond which its loss is positive."""
        u = self._reduced(velocity)
        longest = 1.0 / (u + u * u) + float(np.max(self._delays[0], initial=0.0))
        fine = np.arange(1.0, 4000.0) * 0.2 / longest
        top = _top(u, self._shape[0])
        w = np.union1d(np.geomspace(1e-4 / longest, top, 240), fine[fine < top])
        return np.asarray(w * self._square)

    def quickest(self, velocity: float) -> float:
        """Decay rate beyond which no mode is looked for."""
        return _LIVES / self.life(velocity)

    def life(self, velocity: float) -> float:
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

    def _on_axis(self, u: float, w: Array) -> ComplexArray:
        """Kappa at a reduced speed and reduced frequencies, from the table."""
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


def aged_response(interface: Interface) -> AgedResponse:
    """Return the linear response of ageing contacts.

    Raises
    ------
    InputError
        If thresholds do not age by `Langevin` from a Gaussian, a delay meets newborns without strength, or contacts
        never re-attach.
    """
    ageing, distribution = gaussian_ageing(interface)
    if not math.isfinite(interface.delay.moment(1)):
        raise InputError(
            "Interface.delay: contacts never re-attach, so there is no smooth sliding to be stable or not; "
            "give a finite delay"
        )
    return AgedResponse(ageing=ageing, distribution=distribution, delay=hashable(interface.delay))


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
    from scipy.interpolate import CubicSpline

    place = _place(u, delta)
    first = math.floor(place) - _STENCIL // 2 + 1
    offset = place - first - np.arange(_STENCIL)
    parts, rest = np.zeros((4, _phases(delta).size), dtype=complex), 0.0
    for k in range(_STENCIL):
        others = np.delete(offset, k)
        weight = float(np.prod(others / (others - offset[k])))
        if weight != 0.0:
            row, held = _row(delta, newborn, first + k)
            # At the same phase of a life neighbouring speeds are alike.
            parts += weight * row
            rest += weight * held
    return CubicSpline(np.log(_phases(delta)), parts, axis=1), rest


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
