"""The linear response of contacts whose thresholds do not age, in closed form.

With ``P^`` the Laplace transform of the distribution of thresholds,
``E(s) = <exp(-s tau)>`` that of the delay, ``q = s/v``,
``h(q) = Int x J_c(x) exp(-q x) dx`` and ``f_d`` the force of a detached contact,

    kappa(s) = (1 - E(s)) W(q) / [(m1 + v <tau>) (1 - E(s) P^(q))]
    W = f_d (1 - P^) - q h(q)

per contact, in units of ``k``. It is not in the paper: it is Eqs. (1)-(4) with the
delay, linearised about the steady state. Two facts guide the search for unstable modes:

* ``1 - E P^`` has a positive real part for ``Re s >= 0, s != 0``, so ``kappa`` has no
  pole there;
* for any delay, ``E`` lies in the unit disc, so ``kappa(i w)`` lies in the disc through
  0 about ``c = W (1 - conj P^)/((1 - |P^|^2)(m1 + v <tau>))``. A frequency at which
  ``-Z`` lies outside that disc has no mode. At high frequencies ``q h`` vanishes and
  ``f_d`` remains: a disc about ``f_d/(m1 + v <tau>)``.

Contacts that all re-attach with the same stretching ``x_0`` respond like unstretched
ones with the thresholds ``x_s - x_0`` and the sliding force ``f_d - x_0``, which may be
negative.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from numpy.polynomial import chebyshev

from stickslip.errors import InputError, UndecidedError
from stickslip.model import DelayModel, Interface
from stickslip.model.distributions import (
    Distribution,
)
from stickslip.model.newborn import as_unstretched, mean_life
from stickslip.model.records import hashable
from stickslip.sliding.response import (
    SCAN_LIMIT,
    STEP,
    Array,
    ComplexArray,
    Fluctuations,
    MeanLifetimes,
    Parts,
    Response,
    ResponseScales,
    stretched,
)

# wave number times the standard deviation of thresholds, beyond which P^ is negligible
_REMEMBERED = 100.0
_NOTHING = 1e-15  # P^ below this is rounding of 1
_FEWEST = 64  # wave numbers of a table
_DEGREE = 48  # of the polynomials that interpolate over an octave of frequencies
_MOST_STEPS = 6_000  # steps of frequencies, beyond which the delay alone sets the step


@dataclass(frozen=True, kw_only=True)
class UnagedResponse(Response):
    """The linear response of contacts with a distribution of thresholds and a delay."""

    distribution: Distribution
    delay: DelayModel
    sliding_force: float = 0.0

    accuracy: ClassVar[float] = 1e-12
    has_denominator: ClassVar[bool] = True
    certain: ClassVar[bool] = True

    @property
    def inert(self) -> bool:
        """Whether contacts re-attach at once."""
        return self._means[1] == 0

    def _path(self, velocity: float | Array) -> Array:
        """``m1 + v <tau>``: mean distance between two attachments of a contact, in
        ``x_s``.
        """
        return np.asarray(self._means[0] + velocity * self._means[1])

    def scales(self, velocity: float) -> ResponseScales:
        _, delay, scatter = self._means
        cycle = float(self._path(velocity)) / velocity
        memory = self._largest / velocity + self.delay.longest
        if self.inert:
            return ResponseScales(cycle, cycle, memory, fastest=0.0, leftmost=-math.inf)
        # At high frequencies only the delay affects the response, which f_d keeps from
        # fading.
        pace = cycle if self.sliding_force == 0 else min(cycle, delay)
        # The scatter of the thresholds limits the memory of contacts; their transform
        # has an abscissa of convergence.
        fastest = 8.0 * velocity / scatter
        return ResponseScales(
            cycle,
            pace,
            memory,
            fastest,
            self.distribution.leftmost * velocity,
        )

    def parts(self, velocity: float | Array, s: ComplexArray) -> Parts:
        if self.inert:
            none = np.zeros(
                np.broadcast_shapes(np.shape(velocity), np.shape(s)), dtype=complex
            )
            return Parts(none, np.ones_like(none))
        return self._joined(velocity, s, *transforms(self.distribution, s / velocity))

    def _joined(
        self,
        velocity: float | Array,
        s: ComplexArray,
        complement: ComplexArray,
        shape: ComplexArray,
    ) -> Parts:
        missing = np.asarray(self.delay.absence(s))
        given_up = self.sliding_force * complement - shape
        return Parts(
            given_up * missing / self._path(velocity),
            missing + (1.0 - missing) * complement,
        )

    def fluctuations(self, velocity: float, s: ComplexArray) -> Fluctuations:
        mean, delay, scatter = self._means
        q = np.asarray(s / velocity, dtype=np.complex128)
        remembered = np.abs(q) * scatter < _REMEMBERED
        complement = np.ones_like(q)
        shape = 1.0 / q
        complement[remembered], shape[remembered] = transforms(
            self.distribution, q[remembered]
        )
        numerator, denominator = self._joined(velocity, s, complement, shape)
        life = stretched(
            q,
            mean - complement / q,
            shape / q,
            mean,
            0.5 * self.distribution.moment(2),
        )
        noise = (
            life.noise(q, self.delay.absence(s), velocity * delay, self.sliding_force)
            / velocity
        )
        return Fluctuations(numerator / denominator, noise)

    def sampled(self, velocity: float, top: float) -> tuple[Array, Parts]:
        """Return frequencies up to `top` or just beyond, and the parts there from a
        table of the distribution.
        """
        if self.inert:
            return super().sampled(velocity, top)
        reach = velocity * self.scales(velocity).memory
        y, complement, shape = axis_table(
            hashable(self.distribution), *_steps(reach, top / velocity)
        )
        stop = int(np.searchsorted(velocity * y, top)) + 2
        omega = velocity * y[:stop]
        return omega, self._joined(
            velocity,
            1j * omega,
            complement[:stop],
            shape[:stop],
        )

    def frequencies(self, velocity: float, top: float) -> Array:
        """Angular frequencies up to `top`, with the step that the memory of contacts
        requires, then with that of the delay.
        """
        step = STEP / self.scales(velocity).memory
        omega = np.arange(0.5, min(top / step, _MOST_STEPS)) * step
        if self.sliding_force == 0 or self.inert or top <= _MOST_STEPS * step:
            return omega
        begin = _MOST_STEPS * step
        coarse = max(STEP / self.delay.longest, (top - begin) / _MOST_STEPS)
        return np.append(omega, np.arange(begin, top, coarse))

    def discs(self, velocity: float, top: float) -> tuple[Array, ComplexArray]:
        y, centre = _discs(
            hashable(self.distribution),
            self.sliding_force,
            *_steps(self._largest, top / velocity),
        )
        return velocity * y, np.asarray(centre / self._path(velocity))

    @cached_property
    def _means(self) -> tuple[float, float, float]:
        """Mean threshold and delay, and the standard deviation of the thresholds."""
        return (
            self.distribution.moment(1),
            self.delay.moment(1),
            self.distribution.standard_deviation(),
        )

    @cached_property
    def _largest(self) -> float:
        # One contact in 1e5 beyond it changes the response by no more than 1e-5.
        distribution = self.distribution
        return (
            distribution.moment(1)
            if distribution.single
            else float(distribution.inverse_survival(np.array(1e-5)))
        )


def mean_lives(interface: Interface, velocity: float) -> MeanLifetimes:
    """Return the mean life without ageing and thermal activation, equal at all
    velocities.
    """
    del velocity
    return MeanLifetimes(*np.array([[*mean_life(interface), 0.0, 0.0, 1.0]]).T)


def response(interface: Interface) -> Response:
    """Return the linear response; raises `InputError` if all contacts share one
    threshold and re-attach later.
    """
    if interface.newborn is not None and interface.newborn.standard_deviation() > 0:
        from stickslip.sliding.drawn import DrawnResponse

        return DrawnResponse(interface)
    thresholds, sliding_force = as_unstretched(interface)
    delay = interface.delay
    if delay.moment(1) > 0 and thresholds.single:
        raise InputError(
            "Interface.thresholds: all contacts share one threshold and are slow to "
            "forget how they started; "
            "stability is not computed for them: give the thresholds a standard "
            "deviation above 0"
        )
    return UnagedResponse(
        distribution=thresholds,
        delay=delay,
        sliding_force=sliding_force,
    )


def _steps(reach: float, top: float) -> tuple[float, int]:
    """Step and number of wave numbers up to `top` that resolve contacts with a memory
    of `reach`, in ``x_s``.
    """
    # powers of 2, so that neighbouring speeds share a table
    step = 2.0 ** math.floor(math.log2(STEP / reach))
    count = max(_FEWEST, 1 << math.ceil(math.log2(top / step + 2)))
    if count > SCAN_LIMIT:
        raise UndecidedError(
            f"the response has to be followed over more than {SCAN_LIMIT} "
            "frequencies: the contacts remember "
            f"{reach:g} x_s, and may outweigh the rig up to wavelengths of "
            f"{2 * math.pi / top:g} x_s; "
            "give the rig some damping, or the thresholds a larger standard "
            "deviation"
        )
    return step, count


@lru_cache(maxsize=4)
def _discs(
    distribution: Distribution,
    sliding_force: float,
    step: float,
    count: int,
) -> tuple[Array, ComplexArray]:
    """Wave numbers, and the centres of the discs there, for contacts that re-attach
    immediately.
    """
    y, complement, shape = axis_table(distribution, step, count)
    lost = np.abs(complement) ** 2
    room = 2 * complement.real - lost  # 1 - |P^|^2
    if np.any(room <= 0):
        raise UndecidedError(
            f"the thresholds ({distribution}) are so close together that "
            "double precision cannot resolve how "
            "the contacts lose their memory; give them a larger standard deviation"
        )
    held = sliding_force * lost / room
    centre = held - shape * np.conj(complement) / room
    # Beyond the table discs only shrink: take one as large as any in its last quarter,
    # and extending as far below the real axis. It extends there by `held` in the end,
    # as the rest fades.
    tail = slice(-(centre.size // 4), None)
    last = centre[tail]
    worst = float(np.max(np.abs(last)))
    below = np.abs(last) * (1 - 1e-14) - last.imag
    deficit = float(max(np.max(below), np.max(held[tail])))
    shrinking = complex(
        math.sqrt(max(deficit * (2 * worst - deficit), 0.0)), worst - deficit
    )
    far = y[-1] * np.geomspace(1.0, 1e6, 200)[1:]
    return np.append(y, far), np.append(centre, np.full(far.size, shrinking))


@lru_cache(maxsize=16)  # the longest table takes 80 MB
def axis_table(
    distribution: Distribution,
    step: float,
    count: int,
) -> tuple[Array, ComplexArray, ComplexArray]:
    """Wave numbers in `count` equal steps (`count` and the step are powers of 2) and
    below the first, and the `transforms` there on the imaginary axis.
    """
    # geometric below the first step, for slow modes of soft springs
    y = np.append(
        step * np.geomspace(1e-4, 1.0, 40, endpoint=False),
        step * np.arange(1.0, count + 1.0),
    )
    if count == _FEWEST:
        return y, *transforms(distribution, 1j * y)
    # a longer table keeps the values of a shorter one
    known = axis_table(distribution, step, count // 2)
    new = 1j * y[known[0].size :]
    # where P^ is negligible in half of a table, it is so beyond
    if np.all(np.abs(1.0 - known[1][-(count // 4) :]) < _NOTHING):
        more = np.ones_like(new), 1.0 / new
    else:
        more = _along_octave(distribution, new)
    return y, np.append(known[1], more[0]), np.append(known[2], more[1])


def _along_octave(
    distribution: Distribution, q: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """`transforms` at rising wave numbers, by polynomials where these are exact to
    rounding: of a smooth density, once the contacts turn no more.
    """
    if q.size > 8 * _DEGREE:
        place = (2.0 * q.imag - q[-1].imag - q[0].imag) / (q[-1] - q[0]).imag
        node = chebyshev.chebpts1(_DEGREE)
        basis = chebyshev.chebvander(node, _DEGREE - 1).T / (0.5 * _DEGREE)
        basis[0] *= 0.5
        complement, shape = transforms(distribution, np.interp(node, place, q))
        # not the complement, which is 1 to rounding
        series = np.stack([1.0 - complement, shape]) @ basis.T
        if np.abs(series[:, -4:]).max() < _NOTHING:
            mean, shape = chebyshev.chebval(place, series.T)
            return 1.0 - mean, shape
    return transforms(distribution, q)


def transforms(
    distribution: Distribution, q: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return ``1 - P^(q)`` and ``H(q) = q h(q) = (1 - P^)/q + P^'``, by series in
    the moments where `q` is small.
    """
    radius, a, b = _series(hashable(distribution))
    q = np.asarray(q, dtype=np.complex128)
    small = np.abs(q) < radius
    complement = np.empty_like(q)
    shape = np.empty_like(q)
    inner = q[small]
    outer = q[~small]
    if inner.size:
        complement[small] = inner * np.polynomial.polynomial.polyval(inner, a)
        shape[small] = inner * np.polynomial.polynomial.polyval(inner, b)
    mean, slope = distribution.transform(outer)
    complement[~small] = 1.0 - mean
    shape[~small] = (1.0 - mean) / outer - slope
    return complement, shape


@lru_cache(maxsize=256)
def _series(distribution: Distribution) -> tuple[float, Array, Array]:
    """Radius within which the series are accurate to 1e-15, and the coefficients of
    ``(1 - P^)/q`` and ``H/q``.
    """
    moments = np.array([distribution.moment(n) for n in range(21)])
    factorial = np.cumprod(np.concatenate([[1.0], np.arange(1.0, 21.0)]))
    n = np.arange(19)
    signs = (-1.0) ** n
    first = signs * moments[1:20] / factorial[1:20]
    second = signs * moments[2:21] / (factorial[:19] * (n + 2))
    with np.errstate(all="ignore"):
        ratio = np.maximum(np.abs(first / first[0]), np.abs(second / second[0]))
        radius = (1e-15 / ratio[3:]) ** (1.0 / n[3:])
    radius[~np.isfinite(radius)] = 0.0
    terms = 3 + int(np.argmax(radius))
    # at most a tenth of the distribution's width: beyond, the closed form is accurate
    best = min(float(radius.max()), 0.5 / moments[1])
    return best, first[:terms], second[:terms]
