"""The linear response of contacts that break by temperature, or whose thresholds grow by a fixed rule.

A perturbation ``eps exp(s t)`` of the slider changes the hazard of a contact by its rate's slope along its life, and
moves the moment at which it meets its threshold. With ``q = s/v``, ``S`` the survival and ``r`` the rate per length,

    U(x) = Int_0^x r_x(x') exp(-q (x - x')) dx',  Rc = Int_0^x r_x dx'
    L = <Int (U - exp(-q x) Rc) S dx> + <(1 - exp(-q x_c)) S(x_c)/(1 - f'/v)>,   Y the same with x before it
    B = q E L/(1 - E (1 - q S^))
    kappa = [M_0 - S^ + B W - Y - f_d (B S^ - L)]/(M_0 + v <tau>)

per contact, in units of ``k``, with ``S^, W`` the transforms of the survival and of ``x`` times it, ``E(s) =
<exp(-s tau)>``, and ``f_d`` the force of detached contacts. Without temperature and growth it is the response of
`stickslip.stability.unaged`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import InputError
from stickslip.lives import held, lives_of
from stickslip.model import Bell, Interface
from stickslip.stability.from_axis import FromAxis
from stickslip.stability.impedances import Impedance, natural_frequencies
from stickslip.stability.response import Array, ComplexArray, Precision

_LIVES = 8.0
"""How quickly a mode may decay to be looked for, per mean life."""


@dataclass(frozen=True, kw_only=True)
class ActivatedResponse(FromAxis):
    """The linear response of contacts with temperature or with thresholds that grow by a fixed rule."""

    interface: Interface

    accuracy: ClassVar[float] = 1e-8
    # From octave to octave of the frequency the panels change.
    precision: ClassVar[Precision] = Precision(step=1e-4, settled=1e-9, slack=1e-6)

    def stiffness(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)``; `velocity` and `s` broadcast."""
        speeds, points = np.broadcast_arrays(np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex))
        speed, s = speeds.ravel(), points.ravel()
        kappa = np.zeros(s.shape, dtype=complex)
        for v in np.unique(speed):
            # Octaves of the wave number have panels of their own.
            octave = np.ceil(np.log2(np.maximum(np.abs(s) / v, 4.0)))
            fast = (np.abs(s) / v > self._fastest) & (s.real > -0.1 * np.abs(s))
            octave[fast] = math.inf
            for one in np.unique(octave[(speed == v) & (s != 0)]):
                here = (speed == v) & (s != 0) & (octave == one)
                kappa[here] = self._at(float(v), s[here], None if math.isinf(one) else 2.0**one)
        return kappa.reshape(points.shape)

    def _at(self, v: float, s: ComplexArray, highest: float | None) -> ComplexArray:
        from stickslip.kernels.lives import perturbed

        lives = lives_of(self.interface, v, highest or 0.0)
        q = np.ascontiguousarray(s / v, dtype=np.complex128)
        lost, work, breaks, yields = perturbed(lives, q, highest is None)
        rest, delay = held(lives)[0], self.interface.delay
        missing = np.asarray(delay.absence(s))
        back = 1.0 - missing
        births = q * back * breaks / (missing + back * q * (rest - lost))
        attached = births * (rest - lost) - breaks
        found = lost + births * work - yields - self.interface.sliding_force * attached
        return np.asarray(found / (rest + v * delay.moment(1)))

    def exact(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)``; `velocity` and `s` broadcast."""
        with np.errstate(over="ignore", invalid="ignore"):
            kappa = self.stiffness(velocity, s)
        if not np.all(np.isfinite(kappa)):
            furthest = float(np.min(np.asarray(s, dtype=complex).real))
            raise InputError(
                f"s = {furthest:g}: too far left of the imaginary axis, exp(-s x/v) overflows; stay nearer 0"
            )
        return kappa

    @cached_property
    def _std(self) -> float:
        """Standard deviation of the stretchings at which contacts break, about."""
        std = self.interface.threshold_distribution.standard_deviation()
        temperature = self.interface.temperature
        blur = math.pi / math.sqrt(6.0) * temperature.width if isinstance(temperature, Bell) else 0.0
        return max(math.hypot(std, blur), 1e-3 * self.interface.threshold_distribution.moment(1))

    @cached_property
    def _fastest(self) -> float:
        """Wave number beyond which nothing is left of the memory of a life."""
        return max(60.0 / self._std, 400.0 / self.interface.threshold_distribution.moment(1))

    def frequencies(self, velocity: float) -> Array:
        """Angular frequencies that follow every turn of kappa."""
        distribution, delay = self.interface.threshold_distribution, self.interface.delay
        mean = distribution.moment(1)
        reach = float(distribution.inverse_survival(np.array(1e-3))) + velocity * delay.longest
        top = max(12.0 / self._std, 60.0 / mean)
        step = max(0.2 / reach, top / 8000.0)
        y = np.concatenate(
            [
                np.geomspace(1e-4 / reach, step, 60, endpoint=False),
                np.arange(step, top, step),
                np.geomspace(top, 1e3 * top, 90),
            ]
        )
        return np.asarray(velocity * y)

    def beside_axis(self, velocity: float, s: ComplexArray) -> ComplexArray:
        """``kappa(s)``, the same as `stiffness`."""
        return self.stiffness(velocity, s)

    def beyond(self, body: Impedance, omega: Array) -> Array:
        """Frequencies of a rig that `frequencies` may lack: there are some above those of the contacts."""
        more = super().beyond(body, omega)
        fastest = float(np.max(np.abs(natural_frequencies(body)), initial=0.0))
        if fastest > 0.3 * omega[-1]:
            more = np.union1d(more, np.geomspace(omega[-1], 10.0 * fastest + omega[-1], 120)[1:])
        return more

    def quickest(self, velocity: float) -> float:
        """Decay rate beyond which no mode is looked for."""
        length = held(lives_of(self.interface, velocity))[0] + velocity * self.interface.delay.moment(1)
        return _LIVES * velocity / length


@lru_cache(maxsize=256)
def activated_response(interface: Interface) -> ActivatedResponse:
    """Return the response of contacts with temperature, or with thresholds that grow by a fixed rule.

    Raises
    ------
    InputError
        If contacts never re-attach.
    """
    if not math.isfinite(interface.delay.moment(1)):
        raise InputError(
            "Interface.delay: contacts never re-attach, so there is no smooth sliding to be stable or not; "
            "give a finite delay"
        )
    return ActivatedResponse(interface=interface)
