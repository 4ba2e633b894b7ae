"""The linear response of contacts whose thresholds do not age, and the roots it makes with a rig.

With ``P^`` the Laplace transform of the distribution of thresholds, ``E(s) = <exp(-s tau)>`` that of the delay, ``q =
s/v``, ``h(q) = Int x J_c(x) exp(-q x) dx`` and ``f_d`` the force of a detached contact,

    kappa(s) = (1 - E(s)) W(q) / [(m1 + v <tau>) (1 - E(s) P^(q))],   W = f_d (1 - P^) - q h(q)

per contact, in units of ``k``. It is not in the paper: it is Eqs. (1)-(4) with the delay, linearised about
the steady state. Two facts carry the search for unstable modes:

* ``1 - E P^`` has a positive real part for ``Re s >= 0, s != 0``, so ``kappa`` has no pole there;
* whatever the delay, ``E`` lies in the unit disc, so ``kappa(i w)`` lies in the disc through 0 about
  ``c = W (1 - conj P^)/((1 - |P^|^2)(m1 + v <tau>))``. A frequency at which ``-Z`` lies outside that disc
  holds no mode. At high frequencies ``q h`` vanishes and ``f_d`` stays: a disc about ``f_d/(m1 + v <tau>)``.

Contacts that re-attach with one and the same stretching ``x_0`` answer like unstretched ones with the thresholds ``x_s
- x_0`` and the sliding force ``f_d - x_0``, which may be negative.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, UndecidedError
from stickslip.model import DelayModel
from stickslip.model.distributions import Distribution
from stickslip.model.quadrature import hashable
from stickslip.stability.impedances import (
    Impedance,
    Modes,
    RadiationDamping,
    SpringMassDamper,
    is_plain,
    natural_frequencies,
    poles,
    resonances,
)
from stickslip.stability.neutral import features, neutral_frequencies
from stickslip.stability.response import SCAN_LIMIT, Array, ComplexArray, Precision, Scan, distinct_roots
from stickslip.stability.transforms import Axis, axis_table, transforms

STEP = 0.2
"""Phase (rad) that the fastest part of the response may turn between neighbours of a scan; a full turn is 6.3."""


@dataclass(frozen=True, kw_only=True)
class UnagedResponse:
    """The linear response of contacts with a distribution of thresholds and a delay."""

    distribution: Distribution
    delay: DelayModel
    sliding_force: float = 0.0

    precision: ClassVar[Precision] = Precision(step=1e-6, settled=0.0, slack=1e-12)

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
        return self.distribution.leftmost

    def scale(self, velocity: float | Array) -> Array:
        """``m1 + v <tau>``: mean distance the slider goes between two births of a contact, in ``x_s``."""
        return np.asarray(self.mean_threshold + velocity * self.mean_delay)

    def pace(self, velocity: float) -> float:
        """Time by which growth and decay are measured: the cycle of a contact, or the delay if it slides with a force.

        At high frequencies the delay is all that is left of the response, and ``f_d`` keeps it from fading.
        """
        cycle = float(self.scale(velocity)) / velocity
        return cycle if self.sliding_force == 0 or self.inert else min(cycle, self.mean_delay)

    def reach(self, velocity: float) -> float:
        """Distance over which the response remembers, in ``x_s``: the largest threshold and the longest delay."""
        return self._largest + velocity * self._longest

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
        missing = np.asarray(self.delay.absence(s))
        numerator: ComplexArray = self._given_up(complement, shape) * missing / self.scale(velocity)
        return numerator, missing + (1.0 - missing) * complement

    def _given_up(self, complement: ComplexArray, shape: ComplexArray) -> ComplexArray:
        """``W``; without a sliding force just ``-q h``."""
        return -shape if self.sliding_force == 0 else self.sliding_force * complement - shape

    def axis_parts(self, velocity: float, axis: Axis) -> tuple[ComplexArray, ComplexArray]:
        """`parts` on the imaginary axis, with the fraction of the distribution taken from a table."""
        missing = np.asarray(self.delay.absence(1j * velocity * axis.y))
        numerator: ComplexArray = self._given_up(axis.complement, axis.shape) * missing / self.scale(velocity)
        denominator: ComplexArray = missing + (1.0 - missing) * axis.complement
        return numerator, denominator

    def axis(self, velocity: float, top: float) -> Axis:
        """Table of the distribution up to the frequency `top` or beyond, fine enough for this speed and delay."""
        return self._table(self.reach(velocity), top / velocity)

    def coarse_axis(self, top: float) -> Axis:
        """Table of the distribution up to ``y = top`` or beyond, fine enough for all but the delay."""
        return self._table(self._largest, top)

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
        return axis_table(hashable(self.distribution), step, count)

    @cached_property
    def _largest(self) -> float:
        # One contact in 1e5 beyond it moves the response by no more than 1e-5.
        distribution = self.distribution
        return distribution.moment(1) if distribution.single else float(distribution.inverse_survival(np.array(1e-5)))

    @cached_property
    def _longest(self) -> float:
        return self.delay.longest

    def exact(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)`` where the transform of the distribution exists; `velocity` and `s` broadcast."""
        speed, points = np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex)
        furthest = float(np.min(points.real, initial=0.0))
        limit = self.leftmost * float(np.min(speed))
        if furthest <= limit and furthest < 0:
            raise InputError(
                f"s = {furthest:g}: the distribution of thresholds has no transform at or left of "
                f"Re s = {limit:g}; stay to its right"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            kappa = self.stiffness(speed, points)
        if not np.all(np.isfinite(kappa)):
            raise InputError(
                f"s = {furthest:g}: too far left of the imaginary axis, exp(-s x/v) overflows; stay nearer 0"
            )
        return kappa

    def loss(self, body: Impedance, velocity: float | Array, omega: Array) -> Array:
        """``Im(Z + kappa) |denominator|^2``: the same zeros as ``Im(Z + kappa)``, without its sharp peaks."""
        s = 1j * omega
        numerator, denominator = self.parts(velocity, s)
        return np.asarray(body(s).imag * np.abs(denominator) ** 2 + (numerator * np.conj(denominator)).imag)

    def scan(self, body: Impedance, velocity: float, softest: float | None) -> Scan:
        """`loss` from a table, up to where it can have no more zeros, whatever the delay."""
        if self.inert:
            return Scan(np.empty(0), np.empty(0))
        top = _doubtful_below(self, body, velocity, softest)
        if top == 0:
            return Scan(np.empty(0), np.empty(0))
        axis = self.axis(velocity, top)
        stop = int(np.searchsorted(velocity * axis.y, top)) + 2
        part = axis.up_to(stop)
        omega = velocity * part.y
        z = body(1j * omega)
        numerator, denominator = self.axis_parts(velocity, part)
        value = z.imag * np.abs(denominator) ** 2 + (numerator * np.conj(denominator)).imag
        if not is_plain(body):
            more = features(body, omega, z)
            order = np.argsort(np.concatenate([omega, more]), kind="stable")
            value = np.concatenate([value, self.loss(body, velocity, more)])[order]
            omega = np.concatenate([omega, more])[order]
        return Scan(omega, value)

    def count(self, body: Impedance, velocity: float) -> int:
        """Count the roots of ``Z + kappa`` with ``Re s > 0``, by the argument principle along the imaginary axis."""
        return 0 if self.inert else _count(self, body, velocity)

    def rightmost(self, body: Impedance, velocity: float) -> complex:
        """Return the rightmost root of ``Z + kappa``, confirmed by the argument principle on a line left of it."""
        return _rightmost(self, body, velocity)

    def roots(self, body: Impedance, velocity: float, starts: ComplexArray) -> ComplexArray:
        """Return the roots that Newton's method reaches from `starts`, rightmost first; by default from the axis."""
        limit = -math.inf if self.inert else self.leftmost * velocity
        if starts.size == 0:
            starts = np.concatenate(
                [
                    natural_frequencies(body),
                    _starts_on_real_axis(self, body, velocity, limit),
                    _starts_from_line(self, body, velocity, 0.0),
                ]
            )
        return _roots_from(self, body, velocity, starts, limit)


@lru_cache(maxsize=256)
def unaged_response(distribution: Distribution, delay: DelayModel, sliding_force: float = 0.0) -> UnagedResponse:
    """Return the response of contacts that do not age.

    Raises
    ------
    InputError
        If contacts never re-attach, or all share one threshold.
    """
    mean = delay.moment(1)
    if not math.isfinite(mean):
        raise InputError(
            "Interface.delay: contacts never re-attach, so there is no smooth sliding to be stable or not; "
            "give a finite delay"
        )
    if mean > 0 and distribution.single:
        raise InputError(
            "Interface.thresholds: all contacts share one threshold and are slow to forget how they started; "
            "stability is not computed for them: give the thresholds a standard deviation above 0"
        )
    return UnagedResponse(distribution=distribution, delay=delay, sliding_force=sliding_force)


# ---------------------------------------------------------------- how far to scan


def _doubtful_below(response: UnagedResponse, body: Impedance, velocity: float, softest: float | None) -> float:
    """Frequency above which the disc that holds kappa, whatever the delay, rules out neutral modes; 0 for all."""
    scale = float(response.scale(velocity))
    held = None if softest is None else softest - float(body(np.zeros(1, dtype=complex))[0].real)
    special = np.concatenate([resonances(body), np.abs(natural_frequencies(body))]) / velocity
    top = 8.0 / response.std
    while True:
        axis = response.coarse_axis(top)
        last = axis.y.size // 4
        disc, end = axis.centre + response.sliding_force * axis.loss, float(axis.y[-1])
        tail = _Tail.of(response.sliding_force, axis, last)
        own = special[special < end]
        y = np.concatenate([axis.y, own])
        order = np.argsort(y, kind="stable")
        y = y[order]
        centre = np.concatenate([disc, np.interp(own, axis.y, disc)])[order]
        z = body(1j * velocity * y)
        if np.any(z.imag < -1e-9 * np.abs(z)):
            at = float(velocity * y[np.argmin(z.imag / np.abs(z))])
            raise InputError(
                f"body: Im Z(i w) < 0 at w = {at:.4g}: the rig puts energy in; "
                "give one that only takes it out (damping of 0 or above)"
            )
        clear = _clear(z, centre, scale, held)
        if clear[y > axis.y[-last]].all() and _clear_beyond(body, velocity, end, special, tail, scale, held):
            break
        top *= 2
    doubtful = np.flatnonzero(~clear)
    return float(velocity * y[min(doubtful[-1] + 2, y.size - 1)]) if doubtful.size else 0.0


class _Tail(NamedTuple):
    """Bounds beyond a table on the discs that hold kappa, whatever the delay: of their size, and of how far below."""

    worst: float
    deficit: float

    @classmethod
    def of(cls, sliding_force: float, axis: Axis, last: int) -> _Tail:
        centre = axis.centre[-last:]
        # |1 - P^|^2/(1 - |P^|^2) <= (1 + |P^|)/(1 - |P^|), which tends to 1
        far = float(np.max(np.abs(1.0 - axis.complement[-last:])))
        force = abs(sliding_force) * (1.0 + far) / max(1.0 - far, 1e-300)
        return cls(
            float(np.max(np.abs(centre))) + force,
            float(np.max(np.abs(centre) * (1 - 1e-14) - centre.imag)) + force,
        )


def _clear_beyond(
    body: Impedance, velocity: float, end: float, special: Array, tail: _Tail, scale: float, held: float | None
) -> bool:
    """Whether it stays so beyond the table: the response only shrinks there, but the rig may have features."""
    worst, deficit = tail
    if is_plain(body) and body(np.array([1j * velocity * end]))[0].imag * scale >= deficit:
        return True
    z = body(1j * velocity * np.sort(np.concatenate([end * np.geomspace(1, 1e6, 200), special[special >= end]])))
    # A disc as large as any in the tail, and as far below the upper axis
    disc = complex(math.sqrt(max(deficit * (2 * worst - deficit), 0.0)), worst - deficit)
    return bool(_clear(z, np.full(z.shape, disc), scale, held).all())


def _clear(z: ComplexArray, centre: ComplexArray, scale: float, held: float | None) -> NDArray[np.bool_]:
    """Whether no delay could make the mode at each frequency neutral (with `held`: nor on any stiffer spring)."""
    radius = np.abs(centre)
    lossy = z.imag * scale >= radius - centre.imag - 1e-14 * radius
    real = z.real + (held or 0.0)
    distance = np.abs(z) if held is None else np.where(real > 0, np.hypot(real, z.imag), np.abs(z.imag))
    strong = distance * scale > 2 * (1 + 1e-9) * radius
    # Between two frequencies on either side of a resonance |Z| may be small.
    turning = real[1:] * real[:-1] <= 0
    strong[1:] &= ~turning
    strong[:-1] &= ~turning
    return np.asarray(lossy | strong)


# ---------------------------------------------------------------- the argument principle


def _count(response: UnagedResponse, body: Impedance, velocity: float) -> int:
    """Roots with ``Re s > 0``.

    Between two neighbouring frequencies the curve stays inside an ellipse about its two values, of a size that follows
    from the moments of the distributions; frequencies are added until no ellipse holds 0, so that no turn is missed
    (for a rig given as a function its slope is sampled instead).
    """
    scan = response.scan(body, velocity, None)
    if scan.omega.size == 0:
        return 0
    start, end = _quiet_below(response, body, velocity), float(scan.omega[-1])
    if start >= end:
        return 0
    omega = np.union1d(scan.omega[(scan.omega > start)], np.geomspace(start, end, 200))
    omega[0], omega[-1] = start, end
    product, denominator = _product(response, body, velocity, 1j * omega)
    for _ in range(60):
        gap = np.diff(omega)
        slope = _slope_bound(response, body, velocity, omega)
        sure = np.abs(product[1:]) + np.abs(product[:-1]) > slope * gap
        if sure.all():
            break
        if omega.size > SCAN_LIMIT or np.min(gap[~sure] / omega[1:][~sure]) < 1e-12:
            at = float(omega[1:][~sure][np.argmin(np.abs(product[1:][~sure]))])
            raise UndecidedError(
                f"smooth sliding at velocity {velocity:g} x_s/time is neutral to within rounding, at angular frequency "
                f"{at:.9g}: on its stability boundary; move a parameter to one side"
            )
        new = 0.5 * (omega[1:] + omega[:-1])[~sure]
        new_product, new_denominator = _product(response, body, velocity, 1j * new)
        order = np.argsort(np.concatenate([omega, new]), kind="stable")
        omega = np.concatenate([omega, new])[order]
        product = np.concatenate([product, new_product])[order]
        denominator = np.concatenate([denominator, new_denominator])[order]
    turned = float(np.sum(np.angle(product[1:] / product[:-1])))
    # Re(denominator) > 0 and Im Z >= 0 on the axis: their angles need no following.
    turned -= float(np.angle(denominator[-1]) - np.angle(denominator[0]))
    first, last = product[0] / denominator[0], product[-1] / denominator[-1]
    z_last = body(1j * omega[-1:])[0]
    angle_z = math.atan2(max(z_last.imag, 0.0), z_last.real)
    loops = (turned + np.angle(first) - angle_z - np.angle(last / z_last)) / (2 * math.pi)
    return -2 * round(float(loops))


def _product(
    response: UnagedResponse, body: Impedance, velocity: float, s: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """``(Z + kappa)`` times the denominator of kappa, and that denominator."""
    if response.inert:
        return body(s), np.ones_like(s)
    numerator, denominator = response.parts(velocity, s)
    return body(s) * denominator + numerator, denominator


def _quiet_below(response: UnagedResponse, body: Impedance, velocity: float) -> float:
    """Frequency below which ``|kappa| < Z(0)/2`` and ``|Z - Z(0)| < Z(0)/4``: no root there."""
    m1, m2 = response.distribution.moment(1), response.distribution.moment(2)
    tau1, tau2 = response.delay.moment(1), response.delay.moment(2)
    cycle, square = m1 / velocity + tau1, m2 / velocity**2 + 2 * m1 * tau1 / velocity + tau2
    held = float(body(np.zeros(1, dtype=complex))[0].real)
    slow = m2 + 2 * abs(response.sliding_force) * m1  # |W| is at most half of it times w/v
    omega = min(cycle / square, held * (velocity * cycle) ** 2 / (2 * slow * tau1))
    while abs(complex(body(np.array([1j * omega]))[0]) - held) > 0.25 * held:
        omega *= 0.5
    return omega


def _slope_bound(response: UnagedResponse, body: Impedance, velocity: float, omega: Array) -> Array:
    """Bound of ``|d product / d omega|`` on each interval, from ``|E|, |P^| <= 1`` and the moments."""
    m1, m2, tau1 = response.distribution.moment(1), response.distribution.moment(2), response.delay.moment(1)
    z = body(1j * omega)
    left, right = omega[:-1], omega[1:]
    of_contacts = (3 * m2 / velocity + 2 * m1 * tau1) / response.scale(velocity)
    of_contacts = of_contacts + 2 * abs(response.sliding_force) / velocity  # |1 - P^| <= 2, its slope at most m1/v
    match body:
        case SpringMassDamper(mass=mass):
            drag = mass * body.damping
        case RadiationDamping(mass=mass):
            drag = body.radiation
        case _:
            middle = body(0.5j * (left + right))
            z_slope = 3 * np.maximum(np.abs(middle - z[:-1]), np.abs(z[1:] - middle)) / (0.5 * (right - left))
            z_size = 1.5 * np.maximum(np.maximum(np.abs(z[:-1]), np.abs(z[1:])), np.abs(middle))
            return np.asarray(z_size * (tau1 + m1 / velocity) + 2 * z_slope + of_contacts)
    z_slope = np.hypot(2 * mass * right, drag)
    z_size = np.hypot(np.maximum(np.abs(z[:-1].real), np.abs(z[1:].real)), z[1:].imag)
    return np.asarray(z_size * (tau1 + m1 / velocity) + 2 * z_slope + of_contacts)


def _is_rightmost(
    response: UnagedResponse, body: Impedance, velocity: float, roots: ComplexArray, limit: float
) -> bool:
    """Whether no root lies to the right of the first one, from a count to the right of a line just left of it."""
    cycle = float(response.scale(velocity)) / velocity
    best = float(roots[0].real)
    after = roots.real[roots.real < best - 1e-6 / cycle]
    gap = best - max(float(after[0]) if after.size else -math.inf, limit, best - 0.2 / cycle)
    line = best - 0.5 * gap
    found = int(np.sum(np.where(roots.imag > 0, 2, 1)[roots.real > line]))
    return _count_right_of(response, body, velocity, line) == found


def _count_right_of(response: UnagedResponse, body: Impedance, velocity: float, line: float) -> int | None:
    """Number of roots with ``Re s > line``, by the argument principle; None where phases cannot be followed."""
    reach = response.reach(velocity) / velocity
    own = natural_frequencies(body)
    held = poles(body)
    fine_top = 10 / reach if response.inert else 8.0 * velocity / response.std
    top = max(fine_top, 2.0 * float(np.max(np.abs(np.concatenate([own, held])), initial=0.0)), 10 / reach)
    near = [root.imag + max(abs(root.real - line), 1e-9 * abs(root)) * np.sinh(np.linspace(-6, 6, 121)) for root in own]
    for _ in range(30):
        fine = np.arange(0.0, min(top, fine_top), STEP / reach)
        omega = np.union1d(
            np.concatenate([fine, np.zeros(1), resonances(body), *near]), np.geomspace(1e-6 / reach, top, 400)
        )
        omega = omega[(omega >= 0) & (omega <= top)]
        with np.errstate(all="ignore"):
            s = line + 1j * omega
            product, _ = _product(response, body, velocity, s)
            ratio = product / body(s)
        if not np.all(np.isfinite(product)):
            return None
        if np.all(np.abs(ratio[omega >= 0.7 * top] - 1) < 0.7):
            break
        top *= 2
        if top > fine_top * 2:
            fine_top *= 2
        if fine.size > 1 << 15:
            return None
    for _ in range(40):
        with np.errstate(all="ignore"):
            turn = np.angle(product[1:] / product[:-1])
        coarse = ~(np.abs(turn) < 0.7) & (np.diff(omega) > 1e-12 * top)
        if not coarse.any():
            break
        new = 0.5 * (omega[1:] + omega[:-1])[coarse]
        order = np.argsort(np.concatenate([omega, new]), kind="stable")
        product = np.concatenate([product, _product(response, body, velocity, line + 1j * new)[0]])[order]
        omega = np.concatenate([omega, new])[order]
    along = float(np.sum(np.angle(product[1:] / product[:-1])))
    end = line + 1j * omega[-1]
    arc = abs(end) * np.exp(1j * np.linspace(0.0, np.angle(end), 2001))
    z = body(arc)
    around = float(np.sum(np.angle(z[1:] / z[:-1])))
    around += float(np.angle(product[-1] / z[-1]))
    zeros = (around - along) / math.pi
    if abs(zeros - round(zeros)) > 0.1:
        return None
    brought_in = 1 if line < 0 and not response.inert else 0  # the denominator vanishes at s = 0
    return round(zeros) - brought_in + int(np.sum(held.real > line))


# ---------------------------------------------------------------- Newton's method


def _rightmost(response: UnagedResponse, body: Impedance, velocity: float) -> complex:
    """Newton's method from starts all along the axis finds candidates; a count left of the best one confirms it."""
    limit = -math.inf if response.inert else response.leftmost * velocity
    (neutral,) = neutral_frequencies(response, body, [velocity])
    growing = neutral.unstable()
    cycle = response.pace(velocity)
    # Steps to one side of the axis, in units of the inverse memory of the response.
    steps = (0.0, 0.3, 1.0, 3.0, 0.1) if growing else (0.0, -0.1, -0.4, -1.0, -3.0, -8.0) if limit < 0 else ()
    starts = np.concatenate(
        [
            natural_frequencies(body),
            1j * neutral.omega[np.isfinite(neutral.omega)],
            _starts_on_real_axis(response, body, velocity, limit),
        ]
    )
    for step in steps:
        starts = np.concatenate([starts, _starts_from_line(response, body, velocity, max(step / cycle, 0.9 * limit))])
        roots = _roots_from(response, body, velocity, starts, limit)
        if roots.size == 0:
            continue
        right = roots[roots.real > 0]
        if growing and growing == int(np.sum(np.where(right.imag > 0, 2, 1))):
            return complex(roots[0])
        if not growing and roots[0].real <= 0 and _is_rightmost(response, body, velocity, roots, limit):
            return complex(roots[0])
        starts = roots
    if math.isfinite(limit) and growing == 0:
        raise UndecidedError(
            f"smooth sliding at velocity {velocity:g} x_s/time is stable, but no mode decays more slowly than the tail "
            f"of the distribution of thresholds (Re s = {limit:g}): there is no slowest mode to give; count_unstable() "
            "says 0"
        )
    raise UndecidedError(
        f"smooth sliding at velocity {velocity:g} x_s/time: no root of Z(s) + kappa(s) could be confirmed as the one "
        f"furthest right; {growing} of them grow"
    )


def _starts_from_line(response: UnagedResponse, body: Impedance, velocity: float, line: float) -> ComplexArray:
    """Where Newton's method would go in one step from points along a line: the roots near it, and some more."""
    cycle = float(response.scale(velocity)) / velocity
    memory = response.reach(velocity) / velocity
    top = 10.0 / cycle
    if not response.inert:
        top += 5.0 * velocity / response.std
    elif not natural_frequencies(body).size:
        top = 1e4 * top
    omega = np.arange(0.5, min(top * memory / STEP, 6_000)) * STEP / memory
    if response.sliding_force != 0 and not response.inert:
        cycle = response.pace(velocity)
        far = max(_doubtful_below(response, body, velocity, None), top)
        spacing = max(STEP / response.delay.longest, (far - top) / 6_000)
        omega, top = np.append(omega, np.arange(top, far, spacing)), far
    if line == 0.0 and not response.inert:
        axis = response.axis(velocity, top)
        omega = velocity * axis.y
        numerator, denominator = response.axis_parts(velocity, axis)
        value: ComplexArray = body(1j * omega) * denominator + numerator
    else:
        with np.errstate(all="ignore"):
            value = _product(response, body, velocity, line + 1j * omega)[0]
    s = line + 1j * omega
    with np.errstate(all="ignore"):
        if not response.inert:
            value = value / s
        step = -value / (-1j * np.gradient(value, omega))
    size = np.abs(step)
    # One start from each dip of the step along the line; roots further off have no dip of their own.
    dip = np.isfinite(size) & (size < 5.0 / cycle)
    dip[1:-1] &= (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    return np.asarray((s + step)[dip])


def _starts_on_real_axis(response: UnagedResponse, body: Impedance, velocity: float, limit: float) -> ComplexArray:
    """Where ``Z + kappa`` changes sign on the real axis, from the limit (or as far left as matters) on."""
    cycle = float(response.scale(velocity)) / velocity
    # Far right kappa falls as v/(s (m1 + v <tau>)).
    soft = (
        0.0 if response.inert else velocity / float(response.scale(velocity) * body(np.zeros(1, dtype=complex))[0].real)
    )
    top = 10 * max(1 / cycle, soft, float(np.max(np.abs(natural_frequencies(body)), initial=0.0)))
    right = np.geomspace(1e-3 / cycle, top, 200)
    left = -np.geomspace(1e-3 / cycle, min(10 / cycle, -0.99 * limit), 60)[::-1] if limit < 0 else np.empty(0)
    starts = []
    for s in (left, right):
        if s.size:
            with np.errstate(all="ignore"):
                value = (_product(response, body, velocity, s + 0j)[0] / s).real
            at = np.flatnonzero(value[1:] * value[:-1] < 0)
            starts.append(0.5 * (s[at] + s[at + 1]))
    return np.concatenate(starts) + 0j


def _roots_from(
    response: UnagedResponse, body: Impedance, velocity: float, starts: ComplexArray, limit: float
) -> ComplexArray:
    """Distinct roots to the right of a limit reached by Newton's method; one of each pair, rightmost first."""
    cycle = float(response.scale(velocity)) / velocity
    radius = 1e-3 / cycle
    if isinstance(body, Modes):
        radius = min(radius, 1e-2 * float(np.min(np.abs(natural_frequencies(body).real))))
    with np.errstate(all="ignore"):
        s, settled = _newton(response, body, velocity, starts.astype(complex), radius, 1.0 / response.pace(velocity))
    return distinct_roots(s[settled & np.isfinite(s) & (s.real > limit)], cycle)


def _newton(
    response: UnagedResponse, body: Impedance, velocity: float, s: ComplexArray, radius: float, longest: float
) -> tuple[ComplexArray, NDArray[np.bool_]]:
    """Newton's method on ``product/s`` from many starts; slopes from Cauchy's integral on a small circle."""
    corner = np.append(0.0, np.exp(1j * math.pi * np.array([0.25, 0.75, 1.25, 1.75])))[:, None]

    def reduced(points: ComplexArray) -> ComplexArray:
        value = _product(response, body, velocity, points)[0]
        return value if response.inert else value / points

    settled = np.zeros(s.shape, dtype=bool)
    active = np.arange(s.size)
    last = np.full(s.shape, np.inf)
    for _ in range(30):
        here = s[active]
        around = reduced((here + radius * corner).ravel()).reshape(5, -1)
        slope = np.mean(around[1:] * np.conj(corner[1:]), axis=0) / radius
        step = -around[0] / slope
        size = np.abs(step)
        # Steps that no longer shrink are rounding; one that was large must not be taken in full.
        finished = (size < 1e-10 * (np.abs(here) + longest)) & (size > 0.1 * last[active])
        finished |= size < 1e-15 * np.abs(here)
        step = np.where(size > longest, step * longest / size, step)
        s[active] = here + step
        last[active] = size
        settled[active[finished]] = True
        active = active[~finished & np.isfinite(s[active])]
        if active.size == 0:
            break
    settled |= last < 1e-11 * (np.abs(s) + longest)
    return s, settled
