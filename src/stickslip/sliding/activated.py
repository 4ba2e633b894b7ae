"""Steady sliding of contacts that break by thermal activation, or whose thresholds grow
by a fixed rule.

A perturbation ``eps exp(s t)`` of the slider changes the hazard of a contact by the
slope of its rate along its life, and shifts the time at which it meets its threshold.
With ``q = s/v``, ``S`` the survival and ``r`` the rate per length,

    U(x) = Int_0^x r_x(x') exp(-q (x - x')) dx',  Rc = Int_0^x r_x dx'
    L = <Int (U - exp(-q x) Rc) S dx> + <(1 - exp(-q x_c)) S(x_c)/(1 - f'/v)>
    Y = L with a factor x before each S
    B = q E L/(1 - E (1 - q S^))
    kappa = [M_0 - S^ + B W - Y - f_d (B S^ - L)]/(M_0 + v <tau>)

per contact, in units of ``k``, with ``S^, W`` the transforms of the survival and of
``x`` times it, ``E(s) = <exp(-s tau)>``. Without thermal activation and growth this is
the response of `stickslip.sliding.unaged`.
"""

import math
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from scipy.interpolate import CubicSpline

from stickslip.errors import InputError
from stickslip.kernels import lifetimes as kernel
from stickslip.model import Bell, Interface
from stickslip.sliding.lifetimes import (
    growth_of,
    hazard_of,
    lifetimes_of,
    threshold_nodes,
)
from stickslip.sliding.response import (
    STEP,
    Array,
    ComplexArray,
    MeanLifetimes,
    Parts,
    ResponseScales,
    Unperturbed,
    along_logarithm,
    perturbed,
    stretched,
)
from stickslip.sliding.tabulated import FEW_STEPS, TabulatedResponse

_TABLE = 1e-5  # relative error of the table
# mean life over the longest, below which few contacts outlive their attachment
_SHORT = 1e-4


def mean_lives(interface: Interface, velocity: float) -> MeanLifetimes:
    """Return the mean life of contacts that break by thermal activation, or whose
    thresholds grow by a fixed rule.
    """
    lifetimes = lifetimes_of(interface, velocity)
    survival = lifetimes.weight * lifetimes.survival
    slope = lifetimes.weight * lifetimes.slope
    work, more = (np.sum(lifetimes.x * value) for value in (survival, slope))
    longer = slope.sum() + lifetimes.cap_slope.sum()
    more = more + np.sum(lifetimes.cap_x * lifetimes.cap_slope)
    return MeanLifetimes(*np.array([[survival.sum(), work, longer, more, 1.0]]).T)


def mean_lives_of_areas(interface: Interface, velocity: float) -> MeanLifetimes:
    """Return the mean lifetimes of contacts of different areas: for each area, or for
    all together if newborns draw a new area.
    """
    hazard = hazard_of(interface.activation)
    # small areas need fine panels, as the root is steep there
    node, weight = threshold_nodes(interface.threshold_distribution, 1e-6, [])
    stiffness = np.sqrt(node)  # which is also the stretching of the break
    # Without thermal activation a life does not depend on the speed.
    lifetimes = kernel.march(
        hazard,
        growth_of(None),
        stiffness,
        np.ones_like(node),
        velocity or 1.0,
    )
    whose = np.repeat(np.cumsum(lifetimes.fresh) - 1, kernel.NODES)

    def of_each(value: Array) -> Array:
        return np.asarray(
            np.bincount(whose, weights=lifetimes.weight * value, minlength=node.size),
            dtype=float,
        )

    distance = of_each(lifetimes.survival)
    longer = of_each(lifetimes.slope)
    work, more = (
        stiffness * of_each(lifetimes.x * value)
        for value in (lifetimes.survival, lifetimes.slope)
    )
    if not interface.keeps_areas:  # one kind of contact, with the mean life
        return MeanLifetimes(
            *np.array(
                [[weight @ value for value in (distance, work, longer, more)] + [1.0]]
            ).T
        )
    return MeanLifetimes(distance, work, longer, more, weight)


class ActivatedResponse(TabulatedResponse):
    """The linear response of contacts with thermal activation or with thresholds that
    grow by a fixed rule.
    """

    accuracy: ClassVar[float] = 1e-8

    def terms(self, velocity: float) -> float:
        waves = self.wave_numbers(0.0, FEW_STEPS)
        lifetimes = lifetimes_of(self.interface, velocity, float(np.median(waves)))
        return float(waves.size * lifetimes.x.size)

    def mean_distance(self, velocity: float) -> float:
        return float(mean_lives(self.interface, velocity).distance[0])

    def life_table(self, velocity: float) -> "CubicSpline[np.complex128]":
        return _life_table(self, velocity)

    def life_of(
        self, velocity: float, q: ComplexArray, transforms: ComplexArray
    ) -> Unperturbed:
        mean = mean_lives(self.interface, velocity)
        lost, work, *_ = transforms
        return stretched(q, lost, work, float(mean.distance[0]), float(mean.work[0]))

    def parts_of(
        self,
        velocity: float,
        q: ComplexArray,
        missing: ComplexArray,
        transforms: ComplexArray,
    ) -> Parts:
        return perturbed(
            transforms,
            q,
            missing,
            self.mean_distance(velocity),
            velocity * self.interface.delay.moment(1),
            self.interface.sliding_force,
        )

    def transforms(self, velocity: float, q: ComplexArray) -> ComplexArray:
        """Transforms of a perturbed life, in the form of `perturbed`."""
        # Each octave of wave numbers has its own panels.
        octave = np.ceil(np.log2(np.maximum(np.abs(q), 4.0)))
        octave[(np.abs(q) > self._fastest) & (q.real > -0.1 * np.abs(q))] = math.inf
        found = np.empty((4, q.size), dtype=complex)
        for one in np.unique(octave):
            here = octave == one
            is_fast = math.isinf(one)
            highest = 0.0 if is_fast else 2.0**one
            lifetimes = lifetimes_of(self.interface, velocity, highest)
            # a sum over thresholds does not resolve the fast waves that they cancel
            fast = is_fast and lifetimes.cap_x.size > 1
            found[:, here] = kernel.perturbed(lifetimes, q[here], fast)
        return found

    @property
    def _fastest(self) -> float:
        """Wave number beyond which contacts have no memory."""
        mean = self.interface.threshold_distribution.moment(1)
        return max(100.0 / self._std, 256.0 / mean)

    @cached_property
    def _std(self) -> float:
        """Approximate standard deviation of the stretchings at which contacts break."""
        std = self.interface.threshold_distribution.standard_deviation()
        heat = self.interface.activation
        blur = math.pi / math.sqrt(6.0) * heat.width if isinstance(heat, Bell) else 0.0
        return max(
            math.hypot(std, blur),
            1e-3 * self.interface.threshold_distribution.moment(1),
        )

    def wave_numbers(self, away: float, most: int) -> Array:
        thresholds = self.interface.threshold_distribution
        # the largest stretching, except for one contact in a thousand
        reach = float(thresholds.inverse_survival(np.array(1e-3))) + away
        top = max(12.0 / self._std, 60.0 / thresholds.moment(1))
        step = max(STEP / reach, top / most)
        slow = np.geomspace(1e-4 / reach, step, 60, endpoint=False)
        fast = np.geomspace(top, 1e3 * top, 90 * most // FEW_STEPS)
        return np.concatenate([slow, np.arange(step, top, step), fast])

    def scales(self, velocity: float) -> ResponseScales:
        longest = lifetimes_of(self.interface, velocity).x.max(initial=0.0)
        ageing = self.interface.ageing
        if ageing is not None and velocity * self.cycle(velocity) <= _SHORT * longest:
            raise InputError(
                f"Interface.ageing = {ageing}: at velocity {velocity:g} x_s/time "
                "nearly all contacts break as they attach, faster than any motion; "
                "give them a delay, or more strength at birth"
            )
        return super().scales(velocity)


# as many as a search along the velocity takes, for each mode of a bar
@lru_cache(maxsize=64)
def _life_table(
    response: ActivatedResponse, velocity: float
) -> "CubicSpline[np.complex128]":
    """Return the transforms of a life at a speed over the logarithm of the wave
    number.
    """

    def at(u: Array) -> ComplexArray:
        return response.transforms(velocity, 1j * np.exp(u))

    y = response.wave_numbers(0.0, FEW_STEPS)
    return along_logarithm(at, y, _TABLE, response.accuracy)[1]
