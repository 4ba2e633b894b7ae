"""Infinitely many contacts that break by thermal activation: `stickslip.kernels.thermal_cohorts`."""

from __future__ import annotations

import math
from functools import lru_cache
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.lives import hazard_of
from stickslip.model import (
    Barrier,
    Bell,
    ExponentialGrowth,
    Interface,
    LogarithmicGrowth,
    MasterEquation,
    Parabolic,
)
from stickslip.model.distribution import check_density
from stickslip.model.distributions import Distribution
from stickslip.model.quadrature import hashable
from stickslip.simulation.engines.base import Beginning, Leg, Stretchings, slider_constants, solves
from stickslip.simulation.engines.beginnings import initial_nodes, survival_of
from stickslip.simulation.engines.cohorts import Cohorts
from stickslip.simulation.engines.thermal import check_newborns, growth_of

if TYPE_CHECKING:
    from stickslip.kernels import thermal_cohorts as kernel
    from stickslip.kernels.survival import Table

Array = NDArray[np.float64]

_STEPS = 500
"""Steps in an advance."""
_NODES = 240
"""Nodes of thresholds, at most, where one number does not do."""


@solves(MasterEquation, type(None), ExponentialGrowth, LogarithmicGrowth, temperature=(Bell, Parabolic, Barrier))
class ThermalPopulation(Cohorts):
    """Cohorts of contacts that attached together and break by thermal activation."""

    mechanisms = frozenset({"temperature", "sliding_force"})

    def __init__(self, beginning: Beginning, method: MasterEquation) -> None:
        from stickslip.kernels import thermal_cohorts as kernel
        from stickslip.kernels.thermal_beginnings import initial_state, sliding_state

        interface = beginning.interface
        self._interface, self._f_d = interface, interface.sliding_force
        self.slider = slider_constants(beginning.slider)
        self._model = _model(interface)
        self._delays = kernel.Delays(*interface.delay.quadrature())
        mean = interface.threshold_distribution.moment(1)
        # Second order: half a width makes 1e-5 of the force.
        reach = 0.5 * min(1.0, math.sqrt(method.rtol / 1e-4))
        broken = min(1.5 * reach * self._model.width / mean, 0.006)
        self._limits = kernel.Limits(reach, broken, 0.35 * math.sqrt(reach / 0.5))
        if beginning.sliding:
            self._cap(beginning.velocity)
            step = 0.5 * reach * self._model.width
            self._state = sliding_state(self._model, self._delays, beginning.velocity, step, self._f_d)
            self._state.scalar[kernel.VELOCITY] = beginning.slider_velocity
        else:
            since = -math.inf if isinstance(interface.ageing, ExponentialGrowth) else 0.0
            nodes = initial_nodes(interface)
            self._state = initial_state(self._model, self._delays, *nodes, since, beginning.slider_velocity)

    @staticmethod
    def check(interface: Interface, method: MasterEquation) -> None:
        """Raise `InputError` for thresholds without a density, newborns without strength, and without memory."""
        check_density(interface.threshold_distribution)
        check_newborns(interface)
        if method.memoryless:
            raise InputError(
                f"MasterEquation(memoryless=True): not available with Interface.temperature = {interface.temperature}"
            )

    def _cap(self, velocity: float) -> None:
        """Look at thresholds themselves from when they may be met before contacts break."""
        hazard = self._model.hazard
        if not self._model.capped and velocity > hazard.scale * hazard.attempts / 40.0:
            self._model = self._model._replace(capped=True)

    @staticmethod
    def module() -> ModuleType:
        """Return the module of the state."""
        from stickslip.kernels import thermal_cohorts

        return thermal_cohorts

    @property
    def mass(self) -> float:
        """Fraction of contacts that is attached or waits: 1."""
        from stickslip.kernels import thermal_cohorts as kernel

        attached = self._state.cohort[kernel.ALIVE, : self._state.used[0]].sum()
        return float(attached + self._state.scalar[kernel.OUTSIDE])

    def stretchings(self) -> Stretchings:
        """Stretchings of the cohorts now."""
        from stickslip.kernels import thermal_cohorts as kernel

        cohort = self._state.cohort[:, : self._state.used[0]]
        x = self._state.scalar[kernel.POSITION] - cohort[kernel.BIRTH]
        return Stretchings(np.asarray(x), cohort[kernel.ALIVE].copy(), cells=True)

    def go_on(self, leg: Leg) -> tuple[kernel.State, Array, int]:
        """Follow a leg for some steps."""
        from stickslip.kernels import thermal_cohorts as kernel

        self._cap(self._fastest(leg))
        done = kernel.advance(
            self._state,
            self._model,
            self._delays,
            self.slider,
            self._f_d,
            leg.drive,
            until=leg.end,
            times=leg.times,
            limits=self._limits,
            stop=leg.stop,
            max_steps=_STEPS,
        )
        return done.state, done.rows, done.reason

    def _fastest(self, leg: Leg) -> float:
        """Largest velocity that the slider may come to."""
        drive = max(abs(float(leg.drive_velocity(np.asarray(t)))) for t in (self.here()[0], leg.end))
        if math.isinf(self.slider.stiffness):
            return drive
        if self.slider.mass == 0:
            return math.inf
        most = self._interface.threshold_distribution.support[1]
        return drive + most * math.sqrt((1.0 + 1.0 / self.slider.stiffness) / self.slider.mass)


def _model(interface: Interface) -> kernel.Model:
    """Return how contacts break, with its tables or nodes."""
    from stickslip.kernels import thermal_cohorts as kernel

    hazard, distribution = hazard_of(interface.temperature), interface.threshold_distribution
    thresholds = survival_of(distribution)
    width = activation_width(interface)
    low, thermal = 0.0, thresholds
    node = weight = np.empty(0)
    if isinstance(interface.temperature, Bell) and not isinstance(interface.ageing, ExponentialGrowth):
        low, thermal = _thermal_table(hashable(distribution), hazard.scale)
    else:
        node, weight = _threshold_nodes(distribution, width)
    return kernel.Model(hazard, growth_of(interface), thresholds, thermal, low, node, weight, False, width)


def activation_width(interface: Interface) -> float:
    """Stretching over which the rate of breaking grows by a factor of e, where contacts mostly break."""
    mean = interface.threshold_distribution.moment(1)
    match interface.temperature:
        case Bell(width=width):
            return width
        case Parabolic(temperature=temperature):
            return temperature / mean
        case Barrier(height=height, power=power):
            left = min(1.0, (10.0 / height) ** (1.0 / power))
            return float(mean / (height * power * left ** (power - 1.0)))
    return math.inf


@lru_cache(maxsize=64)
def _thermal_table(distribution: Distribution, width: float) -> tuple[float, Table]:
    """Tabulate ``J(u)``, from its smallest ``u`` on."""
    from stickslip.kernels.survival import tabulate
    from stickslip.lives import blurred_survival

    low, high = -38.0 * width, distribution.support[1] + 3.8 * width
    table = tabulate(
        lambda x: blurred_survival(distribution, width, x + low), high - low, np.empty(0), tolerance=1e-10, most=4096
    )
    return low, table


def _threshold_nodes(distribution: Distribution, width: float) -> tuple[Array, Array]:
    """Mean thresholds of cells of a width, or of as many as there may be, and their weights."""
    low, high = (float(distribution.inverse_survival(p)) for p in (1.0 - 1e-7, 1e-7))
    count = int(min(max(math.ceil((high - low) / width), 150), _NODES))
    edges = np.linspace(low, high, count + 1)
    edges[0], edges[-1] = 0.0, np.inf
    weight = -np.diff(distribution.survival(edges))
    node = -np.diff(distribution.partial_moment(edges, 1)) / np.maximum(weight, 1e-300)
    kept = weight > 1e-14
    return node[kept], weight[kept] / weight[kept].sum()
