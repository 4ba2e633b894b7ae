"""Steady sliding of contacts that break by temperature, or whose thresholds grow by a fixed rule.

With ``M_j`` the mean of the integral of ``x**j`` times the survival over a life and ``f_d`` the force of detached
contacts, ``F = (M_1 + f_d v <tau>)/(M_0 + v <tau>)``. A perturbation ``eps exp(s t)`` of the
slider changes the hazard of a contact by its rate's slope along its life, and moves the moment at which it meets its
threshold. With ``q = s/v``, ``S`` the survival and ``r`` the rate per length,

    U(x) = Int_0^x r_x(x') exp(-q (x - x')) dx',  Rc = Int_0^x r_x dx'
    L = <Int (U - exp(-q x) Rc) S dx> + <(1 - exp(-q x_c)) S(x_c)/(1 - f'/v)>,   Y the same with x before it
    B = q E L/(1 - E (1 - q S^))
    kappa = [M_0 - S^ + B W - Y - f_d (B S^ - L)]/(M_0 + v <tau>)

per contact, in units of ``k``, with ``S^, W`` the transforms of the survival and of ``x`` times it, ``E(s) =
<exp(-s tau)>``. Without temperature and growth it is the response of
`stickslip.sliding.unaged`.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from stickslip.errors import InputError
from stickslip.model import Bell, Interface
from stickslip.sliding.lives import gauss_nodes, growth_of, hazard_of, lives_of, panel_edges
from stickslip.sliding.response import (
    STEP,
    Array,
    ComplexArray,
    Parts,
    Precision,
    Response,
    Sliding,
    check_delay,
    speed_by_speed,
    whole_axis,
)

if TYPE_CHECKING:
    from stickslip.kernels.lives import Lives


class _Lives(NamedTuple):
    """Lives of each kind of contacts: mean way and work, their slopes in ln v, and how much of the force is theirs."""

    way: Array
    work: Array
    longer: Array
    more: Array
    weight: Array


class _OverLives(Sliding):
    """Steady sliding of which the force is the mean work over the mean way, detached contacts included."""

    @abstractmethod
    def _lives(self, velocity: float) -> _Lives:
        """Return the lives of contacts at a speed."""

    def _mean(self, velocity: float) -> tuple[float, float]:
        """Force, and its slope in ln v."""
        away = velocity * self.interface.delay.moment(1) if velocity > 0 else 0.0
        if math.isinf(away):
            return self.interface.sliding_force, 0.0
        lives, pulled = self._lives(velocity), self.interface.sliding_force * away
        length = lives.way + away
        if np.any(length <= 0):
            return 0.0, 0.0  # contacts break as soon as they attach
        force = (lives.work + pulled) / length
        slope = (lives.more + pulled - force * (lives.longer + away)) / length
        return float(lives.weight @ force), float(lives.weight @ slope)

    def force(self, velocity: Array) -> Array:
        """Force per contact."""
        return np.array([self._mean(v)[0] for v in velocity.tolist()])

    def slope(self, velocity: Array) -> Array:
        """Slope of the force in ln v."""
        return np.array([self._mean(v)[1] for v in velocity.tolist()])


class ByLives(_OverLives):
    """Steady sliding of contacts with temperature, or whose thresholds grow by a fixed rule."""

    def __post_init__(self) -> None:
        grows = "of thresholds that grow" if self.interface.temperature is None else "with temperature"
        self.interface.allow(("temperature", "sliding_force"), f"smooth sliding {grows}")

    @property
    def slow_limit(self) -> str | None:
        """Why there is no limit of slow sliding."""
        return super().slow_limit if self.interface.ageing else "at a temperature no slow limit is left"

    def _lives(self, velocity: float) -> _Lives:
        lives = lives_of(self.interface, velocity)
        longer = lives.weight @ lives.slope + lives.cap_slope.sum()
        more = (lives.weight * lives.x) @ lives.slope + lives.cap_x @ lives.cap_slope
        return _Lives(*np.array([[*mean_life_and_work(lives), longer, more, 1.0]]).T)

    def response(self) -> ActivatedResponse:
        """Return the linear response."""
        check_delay(self.interface.delay)
        return ActivatedResponse(interface=self.interface)


class OfAreas(_OverLives):
    """Steady sliding of contacts of different areas: a mean of the work over one of the length, or of their ratio."""

    def __post_init__(self) -> None:
        self.interface.allow(("temperature", "areas", "sliding_force"), "smooth sliding of areas")
        if self.interface.ageing is not None:
            raise InputError(
                f"Interface.areas = {self.interface.areas!r}: smooth sliding is not known together with ageing = "
                f"{self.interface.ageing}; simulate with Contacts",
                "Interface.areas",
            )

    @property
    def slow_limit(self) -> str | None:
        """Why there is no limit of slow sliding, if so."""
        if self.interface.temperature is not None:
            return "at a temperature no slow limit is left"
        return None if math.isfinite(self.interface.delay.moment(1)) else "the delay is infinite"

    def _lives(self, velocity: float) -> _Lives:
        from stickslip.kernels import lives as kernel

        areas, hazard = self.interface.threshold_distribution, hazard_of(self.interface.temperature)
        low, high = areas.support
        if areas.single:
            node, weight = np.array([areas.moment(1)]), np.ones(1)
        else:
            start = max(low, 0.0)
            places = [(start, 1e-6), *((knot, 0.05) for knot in areas.knots)]  # the root of a small area is steep
            node, weight = gauss_nodes(panel_edges(areas, start, high, places, math.inf))
            weight = weight * areas.density(node)
        stiffness = np.sqrt(node)  # and the stretching at which the contact breaks
        # Without temperature the speed does not matter to a life.
        lives = kernel.march(hazard, growth_of(None), stiffness, np.ones_like(node), velocity or 1.0, math.inf)
        whose = np.repeat(np.cumsum(lives.fresh) - 1, kernel.NODES)

        def of_each(value: Array) -> Array:
            return np.asarray(np.bincount(whose, weights=lives.weight * value, minlength=node.size), dtype=float)

        way, longer = of_each(lives.survival), of_each(lives.slope)
        work, more = (stiffness * of_each(lives.x * value) for value in (lives.survival, lives.slope))
        if self.interface.areas == "fresh":  # one kind of site, with the mean life
            return _Lives(*np.array([[weight @ value for value in (way, work, longer, more)] + [1.0]]).T)
        return _Lives(way, work, longer, more, weight)

    def response(self) -> Response:
        """Refuse: the linear response is of contacts of one stiffness."""
        self.interface.allow(self.interface.mechanisms - {"areas"}, "the linear response")
        raise AssertionError


def mean_life_and_work(lives: Lives) -> tuple[float, float]:
    """Return how far the slider goes in the mean life of a contact, and the mean integral of the stretching over it."""
    held = lives.weight * lives.survival
    return float(held.sum()), float(held @ lives.x)


@dataclass(frozen=True, kw_only=True)
class ActivatedResponse(Response):
    """The linear response of contacts with temperature or with thresholds that grow by a fixed rule."""

    interface: Interface

    # From octave to octave of the frequency the panels change.
    precision: ClassVar[Precision] = Precision(accuracy=1e-8, step=1e-4, settled=1e-9, slack=1e-6)

    def parts(self, velocity: float | Array, s: ComplexArray) -> Parts:
        """Return kappa."""
        return speed_by_speed(self._kappa, velocity, s)

    def sampled(self, velocity: float, top: float) -> tuple[Array, Parts]:
        """Return frequencies that follow every turn of kappa, and its parts there."""
        del top
        return whole_axis(self, velocity)

    def along_axis(self, velocity: float) -> tuple[Array, Parts]:
        """Sample the response. Lives, which are dear and turn more slowly than delays, are interpolated."""
        from scipy.interpolate import make_interp_spline

        slow, even, fast = self._wave_numbers(velocity)
        step = 3.0 * STEP / self._reach
        known = np.arange(0.0, even[-1] + 8.0 * step, step)
        parts = [self._transforms(velocity, 1j * y) for y in (slow, known if known.size < even.size else even, fast)]
        if known.size < even.size:  # to 1e-8, about the middle of the lives
            turn = 0.5j * self._reach
            between = make_interp_spline(known, parts[1] * np.exp(turn * known), k=9, axis=1)
            parts[1] = between(even) * np.exp(-turn * even)
        omega = velocity * np.concatenate([slow, even, fast])
        kappa = self._joined(velocity, 1j * omega, np.concatenate(parts, axis=1))
        return omega, Parts(kappa, np.ones_like(kappa))

    def _kappa(self, v: float, s: ComplexArray) -> ComplexArray:
        kappa, moves = np.zeros(s.shape, dtype=complex), s != 0
        kappa[moves] = self._joined(v, s[moves], self._transforms(v, s[moves] / v))
        return kappa

    def _transforms(self, v: float, q: ComplexArray) -> ComplexArray:
        """Transforms of a life under a perturbation, shape (4, n)."""
        from stickslip.kernels.lives import perturbed

        # Octaves of the wave number have panels of their own.
        octave = np.ceil(np.log2(np.maximum(np.abs(q), 4.0)))
        octave[(np.abs(q) > self._fastest) & (q.real > -0.1 * np.abs(q))] = math.inf
        found = np.empty((4, q.size), dtype=complex)
        for one in np.unique(octave):
            here, fast = octave == one, math.isinf(one)
            lives = lives_of(self.interface, v, 0.0 if fast else 2.0**one)
            found[:, here] = perturbed(lives, q[here], fast)
        return found

    def _joined(self, v: float, s: ComplexArray, transforms: ComplexArray) -> ComplexArray:
        """Kappa from the transforms of a life and of the delay."""
        lost, work, breaks, yields = transforms
        rest, delay = mean_life_and_work(lives_of(self.interface, v))[0], self.interface.delay
        q, missing = s / v, np.asarray(delay.absence(s))
        back = 1.0 - missing
        births = q * back * breaks / (missing + back * q * (rest - lost))
        attached = births * (rest - lost) - breaks
        found = lost + births * work - yields - self.interface.sliding_force * attached
        return np.asarray(found / (rest + v * delay.moment(1)))

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

    @cached_property
    def _reach(self) -> float:
        """Largest stretching, but for one contact in a thousand."""
        return float(self.interface.threshold_distribution.inverse_survival(np.array(1e-3)))

    def _wave_numbers(self, velocity: float) -> tuple[Array, Array, Array]:
        """Wave numbers that follow every turn of kappa: slow ones, evenly spaced ones, fast ones."""
        reach = self._reach + velocity * self.interface.delay.longest
        top = max(12.0 / self._std, 60.0 / self.interface.threshold_distribution.moment(1))
        step = max(STEP / reach, top / 8000.0)
        slow, fast = np.geomspace(1e-4 / reach, step, 60, endpoint=False), np.geomspace(top, 1e3 * top, 90)
        return slow, np.arange(step, top, step), fast

    def frequencies(self, velocity: float, top: float) -> Array:
        """Angular frequencies that follow every turn of kappa."""
        del top
        return np.asarray(velocity * np.concatenate(self._wave_numbers(velocity)))

    def cycle(self, velocity: float) -> float:
        """Mean time between two attachments of a contact."""
        rest = mean_life_and_work(lives_of(self.interface, velocity))[0]
        return rest / velocity + self.interface.delay.moment(1)
