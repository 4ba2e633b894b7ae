"""The linear response of contacts whose thresholds age by `Langevin`.

The dynamic stiffness comes from the linearised kinetic equation of Eqs. (13)-(17), see
`stickslip.kernels.langevin_response`; it has no closed form. In units of ``rate**2`` it depends on the
reduced speed ``u = v/(rate**2 f_0)`` and on ``s/rate**2`` alone, so one table serves all rates, speeds and rigs: what a
life contributes is computed on the imaginary axis at fixed values of u, when they are first needed, and interpolated
between them. Delays enter in closed form.
Off the axis, for growth rates, each point is computed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import InputError, UndecidedError
from stickslip.model import DelayModel, Interface, Langevin
from stickslip.model.distributions import Gaussian
from stickslip.stability.impedances import Impedance, is_plain, natural_frequencies
from stickslip.stability.neutral import features, neutral_frequencies
from stickslip.stability.response import Array, ComplexArray, Precision, Scan, distinct_roots
from stickslip.theory import gaussian_ageing

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

ACCURACY = 1e-3
"""Of a tabulated kappa, per contact; about sharp resonances at low speed it is some times less."""

_PER_DECADE = 48
"""Reduced speeds in the table."""
_SLOWEST, _FASTEST = 1e-3, 50.0
"""Reduced speeds for which the response is computed."""
_POINT = 80
"""Cells of the margin where one point is asked for; one extrapolation to half their width."""
_ROUGH = 30
"""Cells of the margin for roots that are looked for, not polished."""
_LIVES = 4.0
"""How quickly a mode may decay to be looked for, per mean life."""
_LOWEST = 0.01
"""Phase of a life down to which the table goes; below it kappa is in proportion to the frequency."""


@dataclass(frozen=True, kw_only=True)
class AgedResponse:
    """The linear response of ageing contacts with a Gaussian distribution of thresholds and a delay."""

    ageing: Langevin
    distribution: Gaussian
    delay: DelayModel

    inert: ClassVar[bool] = False
    # The response is computed on grids that vary with the rig; counts come from a table, crossings do not.
    precision: ClassVar[Precision] = Precision(step=1e-3, settled=1e-5, slack=1e-3)

    def stiffness(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)`` on the imaginary axis, from the table; `velocity` and `s` broadcast."""
        speed, s = np.broadcast_arrays(np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex))
        kappa = np.empty(s.shape, dtype=complex)
        for v in np.unique(speed):
            here = speed == v
            kappa[here] = self._on_axis(self._reduced(float(v)), s[here].imag / self._square)
        return kappa

    def exact(self, velocity: ArrayLike, s: ArrayLike, *, cells: int = _POINT) -> ComplexArray:
        """``kappa(s)`` at any s not far left of the axis, a millisecond a point; `velocity` and `s` broadcast."""
        speed, s = np.broadcast_arrays(np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex))
        kappa = np.empty(s.shape, dtype=complex)
        for v in np.unique(speed):
            here = speed == v
            p = s[here] / self._square
            parts, rest = _life(self._reduced(float(v)), *self._shape, p, cells)
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

    def loss(self, body: Impedance, velocity: float | Array, omega: Array) -> Array:
        """``Im(Z + kappa)``."""
        s = 1j * omega
        return np.asarray((body(s) + self.stiffness(velocity, s)).imag)

    def scan(self, body: Impedance, velocity: float, softest: float | None) -> Scan:
        """`loss` at all frequencies at which the response turns, whatever the rig."""
        del softest
        omega = self.frequencies(velocity)
        if not is_plain(body):
            omega = np.union1d(omega, features(body, omega, body(1j * omega)))
        return Scan(omega, self.loss(body, velocity, omega))

    def count(self, body: Impedance, velocity: float) -> int:
        """Count the roots of ``Z + kappa`` with ``Re s > 0``, from the neutral frequencies."""
        (neutral,) = neutral_frequencies(self, body, [velocity])
        near = np.flatnonzero(np.abs(neutral.extra) < ACCURACY)
        if near.size:
            raise UndecidedError(
                f"smooth sliding at velocity {velocity:g} is neutral to within the accuracy of the response "
                f"({ACCURACY:g} of the stiffness of the contacts), at angular frequency {neutral.omega[near[0]]:.5g}: "
                "on its stability boundary; move a parameter to one side"
            )
        return neutral.unstable()

    def rightmost(self, body: Impedance, velocity: float) -> complex:
        """Return the rightmost root of ``Z + kappa`` among those found; growing ones are confirmed by their count."""
        growing = self.count(body, velocity)

        def value(s: complex) -> complex:
            points = np.array([s])
            return complex((body(points) + self.exact(velocity, points))[0])

        near = self.roots(body, velocity, np.empty(0, dtype=complex))
        polished = [root for root in (_secant(value, s, 1e-9) for s in near[:6].tolist()) if root is not None]
        roots = distinct_roots(np.array(polished, dtype=complex), 1.0 / velocity)
        found = int(np.sum(np.where(roots.imag > 0, 2, 1)[roots.real > 0]))
        if found == growing and roots.size:
            return complex(roots[0])
        if growing:
            raise UndecidedError(
                f"smooth sliding at velocity {velocity:g} has {growing} growing modes, not all of which were found"
            )
        raise UndecidedError(
            f"smooth sliding at velocity {velocity:g} is stable; its modes decay too quickly to be followed from the "
            "axis"
        )

    def roots(self, body: Impedance, velocity: float, starts: ComplexArray) -> ComplexArray:
        """Return the roots not far from the axis, rightmost first: by secants from the dips along the axis."""
        del starts  # those along the axis cost as much to correct as to find
        omega = self.frequencies(velocity)
        own = natural_frequencies(body)
        size = np.abs(body(1j * omega) + self.stiffness(velocity, 1j * omega))
        dip = np.flatnonzero((size[1:-1] < size[:-2]) & (size[1:-1] <= size[2:])) + 1
        dip = dip[np.argsort(size[dip])][:5]

        def value(points: ComplexArray) -> ComplexArray:
            return np.asarray(body(points) + self.exact(velocity, points, cells=_ROUGH))

        real = np.geomspace(omega[0], omega[-1], 40)
        turned = np.flatnonzero(np.diff(np.sign(value(real + 0j).real)))
        starts = np.concatenate([1j * omega[dip], own[own.imag > 0], np.sqrt(real[turned] * real[turned + 1])])
        # Further left what many lives have left behind grows beyond all bounds, and the errors of the grid with it.
        left = -_LIVES / self.life(velocity)
        before, s = starts * (1 + 0.02j * (starts.imag != 0) - 0.05 * (starts.imag == 0)), starts.copy()
        f_before, f = value(before), value(s)
        settled = np.zeros(s.shape, dtype=bool)
        with np.errstate(all="ignore"):
            for _ in range(25):
                step = np.where(settled | (f == f_before), 0.0, -f * (s - before) / (f - f_before))
                step *= np.minimum(1.0, 0.3 * np.abs(s) / np.maximum(np.abs(step), 1e-300))
                before, f_before, s = s, f, s + step
                settled |= np.abs(step) < 1e-6 * np.abs(s)
                s[s.real < left] = np.nan
                busy = np.isfinite(s) & ~settled
                if not busy.any():
                    break
                f = f.copy()
                f[busy] = value(s[busy])
        return distinct_roots(s[settled & np.isfinite(s)], 1e-3 / float(omega[0]))

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
            unit = self._square * self.distribution.mean
            raise InputError(
                f"velocity = {velocity:g}: the stability of ageing contacts is computed between {_SLOWEST * unit:g} "
                f"and {_FASTEST * unit:g} ({_SLOWEST:g} to {_FASTEST:g} times rate^2 f_0)"
            )
        return u

    def _on_axis(self, u: float, w: Array) -> ComplexArray:
        """Kappa at a reduced speed and reduced frequencies, by cubic interpolation between four rows of the table."""
        place = math.log10(u) * _PER_DECADE
        first = math.floor(place) - 1
        t = place - first - 1
        weights = (
            -t * (t - 1) * (t - 2) / 6,
            (t + 1) * (t - 1) * (t - 2) / 2,
            -(t + 1) * t * (t - 2) / 2,
            (t + 1) * t * (t - 1) / 6,
        )
        unit = u + u * u
        top = _top(u, self._shape[0])
        size = np.clip(np.abs(w), _LOWEST * unit, top)
        parts, rest = np.zeros((4, size.size), dtype=complex), 0.0
        for k, weight in enumerate(weights):
            if weight != 0.0:
                row, held = _row(*self._shape, first + k)
                # At the same phase of a life neighbouring speeds are alike.
                parts += weight * row(np.log(size / unit))
                rest += weight * held
        kappa = self._join(1j * size, parts, rest)
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
    return AgedResponse(ageing=ageing, distribution=distribution, delay=interface.delay)


def _life(u: float, delta: float, newborn: float, p: ComplexArray, cells: int) -> tuple[ComplexArray, float]:
    """Transforms of one life, shape (4, n), and its mean length (1 for newborns without strength), from two grids."""
    from stickslip.kernels.langevin import Life
    from stickslip.kernels.langevin_response import life_transforms

    points = np.asarray(p, dtype=np.complex128).ravel()
    coarse, fine = (life_transforms(Life(u, delta, newborn), points, n) for n in (cells, 2 * cells))
    if newborn == 0:  # lives from the boundary are known up to a factor that depends on the grid
        coarse, fine = coarse / coarse[0, -1], fine / fine[0, -1]
    parts = (4.0 * fine - coarse) / 3.0
    return parts[:, :-1].reshape(4, *p.shape), float(parts[0, -1].real)


def _top(u: float, delta: float) -> float:
    """Frequency, in units of ``rate**2``, up to which the table goes; above it kappa nears 1 as a power of it.

    Contacts driven into their boundary forget at the rate ``((u - 1)/delta)**2``, and only faster shakes find springs.
    """
    return max(100.0, 100.0 * (max(u - 1.0, 0.0) / delta) ** 2)


@lru_cache(maxsize=2048)
def _row(delta: float, newborn: float, number: int) -> tuple[CubicSpline[Any], float]:
    """One row of the table: transforms of a life over the logarithm of its phase, and its mean length."""
    from scipy.interpolate import CubicSpline

    u = 10.0 ** (number / _PER_DECADE)
    unit = u + u * u
    # Lives are in step for as many turns as their scatter allows.
    turning = np.arange(0.3, max(30.0, min(3.0 / delta, 100.0)), 0.3 if u > 0.15 else 0.2)
    top = 2.0 * _top(u, delta) / unit
    beyond = np.geomspace(turning[-1], max(top, 2.0 * turning[-1]), 70)[1:]
    phase = np.concatenate([np.geomspace(_LOWEST, 0.3, 20, endpoint=False), turning, beyond])
    phase = phase[: int(np.searchsorted(phase, top)) + 4]
    # The slower the slide, the thinner is the layer of gaps that are about to close.
    cells = 40 if u > 0.15 else 60 if u > 0.04 else 80
    parts, rest = _life(u, delta, newborn, 1j * unit * phase, cells)
    return CubicSpline(np.log(phase), parts, axis=1), rest


def _secant(function: Callable[[complex], complex], start: complex, tolerance: float) -> complex | None:
    """Root near a start; None where the search does not settle."""
    before, s = start * (1 + 1e-3j), start
    f_before, f = function(before), function(s)
    for _ in range(20):
        if f == f_before:
            return s
        step = -f * (s - before) / (f - f_before)
        if not abs(step) < 0.3 * abs(s):
            return None
        before, f_before, s = s, f, s + step
        if abs(step) < tolerance * abs(s):
            return complex(s.real, abs(s.imag))
        f = function(s)
    return None
