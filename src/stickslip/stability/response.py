"""The dynamic stiffness of an interface: how its force answers a small shake of a smoothly sliding slider.

With ``P^`` the Laplace transform of the distribution of thresholds, ``E(s) = <exp(-s tau)>`` that of the delay, ``q =
s/v`` and ``h(q) = Int x J_c(x) exp(-q x) dx``,

    kappa(s) = - q h(q) (1 - E(s)) / [(m1 + v <tau>) (1 - E(s) P^(q))]

per contact, in units of ``k``. It is not in the paper: it is Eqs. (1)-(4) with the delay, linearised about
the steady state. Two facts carry the search for unstable modes:

* ``1 - E P^`` has a positive real part for ``Re s >= 0, s != 0``, so ``kappa`` has no pole there;
* whatever the delay, ``E`` lies in the unit disc, so ``kappa(i w)`` lies in the disc through 0 about
  ``c = -q h (1 - conj P^)/((1 - |P^|^2)(m1 + v <tau>))``. A frequency at which ``-Z`` lies outside that disc
  holds no mode.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, UndecidedError, instance, number, shown
from stickslip.model import Delay, DelayModel, Interface
from stickslip.model.distributions import Distribution, Exponential, Gamma, Gaussian, LogNormal, Weibull, one_valued
from stickslip.stability.aged import AgedResponse, aged_response

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]

STEP = 0.2
"""Phase (rad) that the fastest part of the response may turn between neighbours of a scan; a full turn is 6.3."""

SCAN_LIMIT = 1 << 21
"""Largest number of frequencies in a scan."""


def dynamic_stiffness(interface: Interface, velocity: float, s: ArrayLike) -> ComplexArray:
    """Force of the interface over displacement for motion ``v t + small exp(s t)``, per contact.

    Parameters
    ----------
    interface : Interface
        The contacts. Without delay the answer is 0 at every `s`.
    velocity : float
        Speed of smooth sliding, in ``x_s`` per time.
    s : array_like of complex
        Growth rate plus ``i`` times angular frequency, in 1/time; on the imaginary axis and to its right for
        every distribution, to its left as far as the distribution of thresholds has a transform.

    Returns
    -------
    ndarray of complex, shape of `s`
        ``kappa(s)`` in units of ``k``; tends to ``s dF_k/dv`` for ``s -> 0``.

    Raises
    ------
    InputError
        If contacts never re-attach (no steady sliding), age otherwise than by `Langevin`, or all share one threshold
        and one delay; if `s` lies where the transform does not exist or overflows.

    Notes
    -----
    Distributions without a closed transform (`LogNormal`, `Weibull`) cost some ten microseconds a point. The relative
    error is about 1e-12, for distributions with very heavy tails down to 1e-8 at small `s`; with thresholds that age
    2e-4.
    """
    speed = number("velocity", velocity, above=0, hint="in x_s per time")
    try:
        points = np.asarray(s, dtype=complex)
    except (TypeError, ValueError):
        raise InputError(f"s = {shown(s)}: must be a complex number, or an array of them (in 1/time)") from None
    response = respond(interface)
    if isinstance(response, AgedResponse):
        return response.exact(speed, points)
    furthest = float(np.min(points.real, initial=0.0))
    if furthest <= response.leftmost * speed and furthest < 0:
        raise InputError(
            f"s = {furthest:g}: the distribution of thresholds has no transform at or left of "
            f"Re s = {response.leftmost * speed:g}; stay to its right"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        kappa = response.stiffness(speed, points)
    if not np.all(np.isfinite(kappa)):
        raise InputError(f"s = {furthest:g}: too far left of the imaginary axis, exp(-s x/v) overflows; stay nearer 0")
    return kappa


@dataclass(frozen=True, kw_only=True, eq=False)
class Axis:
    """What a distribution of thresholds contributes on the imaginary axis ``q = i y``, whatever the delay and the speed."""

    y: Array
    complement: ComplexArray
    """``1 - P^``."""
    shape: ComplexArray
    """``H = q h(q)``."""
    centre: ComplexArray
    """Centre of the disc that holds ``kappa`` times ``m1 + v <tau>``, for any delay."""


@dataclass(frozen=True, kw_only=True)
class Response:
    """The linear response of contacts with a distribution of thresholds and a delay."""

    distribution: Distribution
    delay: DelayModel

    @cached_property
    def mean_threshold(self) -> float:
        """``m1``, in ``x_s``."""
        return self.distribution.moment(1)

    @cached_property
    def std(self) -> float:
        """Standard deviation of the thresholds, in ``x_s``."""
        return self.distribution.standard_deviation()

    @cached_property
    def mean_delay(self) -> float:
        """``<tau>``, in the unit of time."""
        return self.delay.moment(1)

    @property
    def inert(self) -> bool:
        """Whether ``kappa = 0`` at every `s`: contacts that come back at once."""
        return self.mean_delay == 0

    @cached_property
    def leftmost(self) -> float:
        """Abscissa of convergence of the transform of the distribution, in ``q = s/v``."""
        return _abscissa(self.distribution)

    def scale(self, velocity: float | Array) -> Array:
        """``m1 + v <tau>``: mean distance the slider goes between two births of a contact, in ``x_s``."""
        return np.asarray(self.mean_threshold + velocity * self.mean_delay)

    def reach(self, velocity: float) -> float:
        """Distance over which the response remembers, in ``x_s``: the largest threshold and the longest delay."""
        return _largest(_key(self.distribution)) + velocity * _longest(_key(self.delay))

    def stiffness(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)``; `velocity` and `s` broadcast."""
        speed, s = np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex)
        if self.inert:
            return np.zeros(np.broadcast_shapes(speed.shape, s.shape), dtype=complex)
        numerator, denominator = self.parts(speed, s)
        return np.asarray(np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator != 0))

    def parts(self, velocity: float | Array, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Numerator and denominator of ``kappa``, both without poles where the transforms exist."""
        complement, shape = transforms(self.distribution, s / velocity)
        missing = absence(self.delay, s)
        numerator: ComplexArray = -shape * missing / self.scale(velocity)
        return numerator, missing + (1.0 - missing) * complement

    def axis_parts(self, velocity: float, axis: Axis) -> tuple[ComplexArray, ComplexArray]:
        """`parts` on the imaginary axis, with the fraction of the distribution taken from a table."""
        missing = absence(self.delay, 1j * velocity * axis.y)
        numerator: ComplexArray = -axis.shape * missing / self.scale(velocity)
        denominator: ComplexArray = missing + (1.0 - missing) * axis.complement
        return numerator, denominator

    def axis(self, velocity: float, top: float) -> Axis:
        """Table of the distribution up to the frequency `top` or beyond, fine enough for this speed and delay."""
        return self._table(self.reach(velocity), top / velocity)

    def coarse_axis(self, top: float) -> Axis:
        """Table of the distribution up to ``y = top`` or beyond, fine enough for all that does not depend on the delay."""
        return self._table(_largest(_key(self.distribution)), top)

    def _table(self, reach: float, top: float) -> Axis:
        # Steps and counts are powers of 2, so that neighbouring speeds share a table.
        step = 2.0 ** math.floor(math.log2(STEP / reach))
        count = 1 << max(6, math.ceil(math.log2(top / step + 2)))
        if count > SCAN_LIMIT:
            raise UndecidedError(
                f"the response has to be followed over more than {SCAN_LIMIT} frequencies: the contacts remember "
                f"{reach:g} x_s, and may outweigh the rig up to wavelengths of {2 * math.pi / top:g} x_s; "
                "give the rig some damping, or the thresholds more standard deviation"
            )
        return _axis(_key(self.distribution), step, count)


@lru_cache(maxsize=256)
def _respond(distribution: Distribution, delay: DelayModel) -> Response:
    mean = delay.moment(1)
    if not math.isfinite(mean):
        raise InputError(
            "Interface.delay: contacts never re-attach, so there is no smooth sliding to be stable or not; "
            "give a finite delay"
        )
    if mean > 0 and one_valued(distribution):
        raise InputError(
            "Interface.thresholds: all contacts share one threshold and are slow to forget how they started; "
            "stability is not computed for them: give the thresholds a standard deviation above 0"
        )
    return Response(distribution=distribution, delay=delay)


def respond(interface: Interface) -> Response | AgedResponse:
    """Return the linear response of an interface. A new kind of ageing is to be answered for here.

    Raises
    ------
    InputError
        If the interface has no steady sliding, or one whose response is not known.
    """
    instance("interface", interface, Interface, "an Interface")
    if interface.ageing is not None:
        return aged_response(interface)
    return _respond(_key(interface.threshold_distribution), _key(interface.delay))


def _key(distribution: Distribution | DelayModel) -> Any:
    """Return the distribution, checked to be fit for the key of a table."""
    try:
        hash(distribution)
    except TypeError as error:
        raise InputError(f"{distribution!r}: a distribution must be hashable; make it a frozen dataclass") from error
    return distribution


# ---------------------------------------------------------------- transforms without cancellation


def transforms(distribution: Distribution, q: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return ``1 - P^(q)`` and ``H(q) = q h(q) = (1 - P^)/q + P^'``, by series in the moments where `q` is small."""
    radius, a, b = _series(_key(distribution))
    q = np.asarray(q, dtype=complex)
    small = np.abs(q) < radius
    if not small.any():
        return _outer(distribution, q)
    complement, shape = np.empty_like(q), np.empty_like(q)
    inner = q[small]
    complement[small] = inner * np.polynomial.polynomial.polyval(inner, a)
    shape[small] = inner * np.polynomial.polynomial.polyval(inner, b)
    if not small.all():
        complement[~small], shape[~small] = _outer(distribution, q[~small])
    return complement, shape


def _outer(distribution: Distribution, q: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    mean, slope = _laplace(distribution, q)
    return 1.0 - mean, (1.0 - mean) / q - slope


def _laplace(distribution: Distribution, q: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return ``P^(q)`` and ``-P^'(q)``."""
    match distribution:
        case LogNormal() | Weibull():
            x, weight = _turned_nodes(distribution)
        case Gaussian() if distribution.std > 0:
            # By parts: one transform instead of two
            mean = distribution.laplace(q)
            cut = (
                distribution.density(distribution.lower) * np.exp(-q * distribution.lower)
                if math.isfinite(distribution.lower)
                else 0.0
            )
            return mean, (distribution.mean - q * distribution.std**2) * mean + distribution.std**2 * cut
        case _:
            return distribution.laplace(q), distribution.laplace(q, 1)
    # The path is turned for Im q > 0; below the real axis the transform is the conjugate of its mirror image.
    upper = np.where(q.imag < 0, np.conj(q), q).ravel()
    both = np.empty((2, upper.size), dtype=complex)
    kernel = np.stack([weight, weight * x], axis=1)
    for start in range(0, upper.size, 256):
        part = slice(start, start + 256)
        both[:, part] = (np.exp(-upper[part, None] * x) @ kernel).T
    mean, slope = both.reshape(2, *q.shape)
    below = q.imag < 0
    return np.where(below, np.conj(mean), mean), np.where(below, np.conj(slope), slope)


@lru_cache(maxsize=64)
def _turned_nodes(distribution: LogNormal | Weibull) -> tuple[ComplexArray, ComplexArray]:
    """Nodes and weights for transforms without a closed form, on a path turned off the real axis.

    There ``exp(-q x)`` decays instead of oscillating, and the same few hundred nodes do for all `q` with
    ``Im q >= 0``. (`Distribution.laplace` keeps to the real axis; its cost grows with ``|Im q|``.) The trapezoidal
    rule converges exponentially.
    """
    if isinstance(distribution, LogNormal):
        # x = exp(log_mean + log_spread (z - i turn)): the density grows by exp(turn^2/2), at most 90.
        turn = min(3.0, 0.7 / distribution.log_spread)
        z = np.arange(-9.0, 9.0, 0.04) - 1j * turn
        x, weight = np.exp(distribution.log_mean + distribution.log_spread * z), np.exp(-0.5 * z * z)
        return x, weight / weight.sum()
    # x = scale t^(1/shape), with t = exp(y) turned
    turn = 0.7 * min(1.0, distribution.shape)
    t = np.exp(np.arange(-40.0, 4.2, 0.05) - 1j * turn)
    weight = t * np.exp(-t)
    return distribution.scale * t ** (1 / distribution.shape), weight / weight.sum()


def absence(delay: DelayModel, s: ComplexArray) -> ComplexArray:
    """Return ``1 - E(s)`` without cancellation at small `s`."""
    s = np.asarray(s, dtype=complex)
    if isinstance(delay, Delay):
        return np.asarray(-np.expm1(-s * delay.time))
    missing = np.asarray(1.0 - delay.laplace(s))
    one, two, three = (delay.moment(n) for n in (1, 2, 3))
    small = np.abs(s) * three < 1e-4 * two
    return np.where(small, s * (one - s * (two / 2 - s * three / 6)), missing)


@lru_cache(maxsize=256)
def _series(distribution: Distribution) -> tuple[float, Array, Array]:
    """Radius within which the series hold to 1e-15, and the coefficients of ``(1 - P^)/q`` and ``H/q``."""
    moments = np.array([distribution.moment(n) for n in range(21)])
    factorial = np.cumprod(np.concatenate([[1.0], np.arange(1.0, 21.0)]))
    n = np.arange(19)
    signs = (-1.0) ** n
    first, second = (
        signs * moments[1:20] / factorial[1:20],
        signs * moments[2:21] / (factorial[:19] * (n + 2)),
    )
    best, terms = 0.0, 2
    with np.errstate(all="ignore"):
        for count in range(3, 19):
            ratio = max(abs(first[count] / first[0]), abs(second[count] / second[0]))
            radius = float((1e-15 / ratio) ** (1.0 / count)) if math.isfinite(ratio) else 0.0
            if radius > best:
                best, terms = radius, count
    # A tenth of the width of the distribution: beyond it the closed form loses nothing.
    return min(best, 0.5 / moments[1]), first[:terms], second[:terms]


def _abscissa(distribution: Distribution) -> float:
    match distribution:
        case Exponential():
            return -1.0 / distribution.mean
        case Gamma():
            return -1.0 / distribution.scale
        case LogNormal():
            return 0.0
        case Weibull():
            return (
                0.0 if distribution.shape < 1 else -1.0 / distribution.scale if distribution.shape == 1 else -math.inf
            )
    return -math.inf if math.isfinite(distribution.support[1]) else 0.0


@lru_cache(maxsize=256)
def _largest(distribution: Distribution) -> float:
    # One contact in 1e5 beyond it moves the response by no more than 1e-5.
    return (
        float(distribution.inverse_survival(np.array(1e-5)))
        if not one_valued(distribution)
        else distribution.moment(1)
    )


@lru_cache(maxsize=256)
def _longest(delay: DelayModel) -> float:
    tau, weight = delay.quadrature()
    beyond = np.cumsum(weight[::-1])[::-1]
    return float(np.max(tau[beyond > 1e-5], initial=delay.moment(1)))


@lru_cache(maxsize=32)
def _axis(distribution: Distribution, step: float, count: int) -> Axis:
    # Below the first step frequencies are spaced in proportion: slow modes of soft springs.
    slow = step * np.geomspace(1e-4, 1.0, 40, endpoint=False)
    y = np.concatenate([slow, step * np.arange(1, count + 1)])
    complement, shape = transforms(distribution, 1j * y)
    # 1 - |P^|^2 = 2 Re(1 - P^) - |1 - P^|^2
    room = 2 * complement.real - np.abs(complement) ** 2
    if np.any(room <= 0):
        raise UndecidedError(
            f"the thresholds ({distribution}) are so close together that the response cannot be told from one without memory "
            "loss in double precision; give them more standard deviation"
        )
    return Axis(y=y, complement=complement, shape=shape, centre=-shape * np.conj(complement) / room)
