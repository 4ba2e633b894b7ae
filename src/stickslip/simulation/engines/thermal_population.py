"""Infinitely many contacts that break by what no clock tells of:
`stickslip.kernels.thermal_cohorts`.
"""

import math

import numpy as np

from stickslip.kernels import thermal_cohorts as kernel
from stickslip.kernels.cohort_store import ALIVE, PLACE, Delays
from stickslip.kernels.hazard import BARRIER, log_rate
from stickslip.kernels.thermal_cohorts import advance
from stickslip.model import (
    Barrier,
    Bell,
    ExponentialGrowth,
    Interface,
    MasterEquation,
    Parabolic,
)
from stickslip.model.distributions import Distribution
from stickslip.model.newborn import stretching_nodes
from stickslip.model.rig import Rig
from stickslip.simulation.engines.base import (
    GROWTH,
    Array,
    Beginning,
    Cohorts,
    Stretchings,
    slider_constants,
    solves,
)
from stickslip.simulation.engines.beginnings import lifetimes_in
from stickslip.simulation.work import Course, Part
from stickslip.sliding.lifetimes import growth_of, hazard_of

_NODES = 240  # nodes of thresholds, at most, where one number does not do
# widths in a step: what grows by so many powers of e, three nodes of Gauss integrate to
# 1e-3
_FARTHEST = 4.0
# largest fraction of the contacts that breaks in a step of half a width
_BROKEN = 0.006
# seconds a cohort takes in a step, and each of its nodes that is about to break
_COHORT = 7e-7
_NODE = 3e-7
_BAND = 25.0  # that is within so many widths


@solves(MasterEquation, type(None), *GROWTH, activation=(Barrier,))
@solves(MasterEquation, *GROWTH, activation=(Parabolic,))
@solves(MasterEquation, ExponentialGrowth, activation=(Bell,))
class ThermalPopulation(Cohorts):
    """Cohorts of contacts that attached together, of which nothing simpler says what
    is left: see `Panels`.
    """

    mechanisms = frozenset({"activation", "sliding_force"})
    smooth = True
    kernel = advance
    steps = 500

    def __init__(self, beginning: Beginning, method: MasterEquation) -> None:
        interface = beginning.interface
        self._method = method
        self.slider = slider_constants(beginning.slider)
        thresholds = interface.threshold_distribution
        width = activation_width(interface)
        hazard = hazard_of(interface.activation)
        growth = growth_of(interface.ageing)
        model = kernel.Model(
            hazard, growth, *_threshold_nodes(thresholds, width), width
        )
        reach = min(0.5 * math.sqrt(method.rtol / 1e-4), _FARTHEST)  # of second order
        broken = reach * min(1.5 * width / thresholds.moment(1), 2.0 * _BROKEN)
        limits = kernel.Limits(reach, broken, 0.35 * math.sqrt(reach / 0.5))
        delays = Delays(*interface.delay.quadrature())
        self._case = kernel.Case(
            model, delays, self.slider, interface.sliding_force, limits
        )
        if beginning.sliding:
            step = 0.5 * reach * width
            self.state = kernel.sliding_state(
                model, delays, beginning.velocity, limits, step, interface.sliding_force
            )
            self.state.motion.velocity = beginning.slider_velocity
        else:
            since = (
                -math.inf if isinstance(interface.ageing, ExponentialGrowth) else 0.0
            )
            x, fraction = stretching_nodes(interface.initial, thresholds)
            self.state = kernel.initial_state(
                model, delays, x, fraction, since, beginning.slider_velocity
            )

    @staticmethod
    def cost(rig: Rig, method: MasterEquation, course: Course) -> tuple[Part, ...]:
        """Return the work of a run, by part: a few steps and cohorts on a width,
        fewer where few contacts may break.
        """
        interface = rig.interface
        mean = rig.interface.threshold_distribution.moment(1)
        width = activation_width(interface)
        lives, _ = lifetimes_in(rig, course)
        finer = max(0.5 / _FARTHEST, math.sqrt(1e-4 / method.rtol))
        way = mean * (course.distance + course.shaken)
        moving = finer * max(2.0 * way / width, lives / _BROKEN)
        # some last twice as long as most
        steps = moving + 3.0 * course.rung
        cohorts = 2.0 * moving / max(lives, 1.0)
        node = _threshold_nodes(interface.threshold_distribution, width)[0]
        breaking = node.size * min(_BAND * width / (mean + float(np.ptp(node))), 1.0)
        seconds = (_COHORT + _NODE * breaking) * steps * cohorts
        room = 16.0 * cohorts * node.size
        what = f"about {steps:.2g} steps of {cohorts:.2g} cohorts"
        return (
            Part(
                "interface.activation",
                width,
                None,
                -2.0,
                what,
                seconds,
                room,
                "use Contacts(...), or ",
            ),
        )

    def stretchings(self) -> Stretchings:
        """Stretchings of the cohorts now."""
        place, alive = self.state.cohort[[PLACE, ALIVE], : self.state.used.cohorts]
        return Stretchings(self.state.motion.position - place, alive, cells=True)


def activation_width(interface: Interface) -> float:
    """Stretching over which the rate of breaking grows by a factor of e, where
    contacts mostly break.
    """
    hazard = hazard_of(interface.activation)
    mean = interface.threshold_distribution.moment(1)
    left = (
        min(1.0, (10.0 / hazard.scale) ** (1.0 / hazard.power))
        if hazard.kind == BARRIER
        else 0.0
    )
    return float(
        1.0 / log_rate(hazard._replace(kramers=0.0), mean * (1.0 - left), mean)[1]
    )


def _threshold_nodes(distribution: Distribution, width: float) -> tuple[Array, Array]:
    """Mean thresholds of cells of a width, or of as many as there may be, and their
    weights.
    """
    low, high = (float(distribution.inverse_survival(p)) for p in (1.0 - 1e-7, 1e-7))
    count = int(min(max(math.ceil((high - low) / width), 150), _NODES))
    edges = np.linspace(low, high, count + 1)
    edges[0] = 0.0
    edges[-1] = np.inf
    weight = -np.diff(distribution.survival(edges))
    node = -np.diff(distribution.partial_moment(edges, 1)) / np.maximum(weight, 1e-300)
    kept = weight > 1e-14
    return node[kept], weight[kept] / weight[kept].sum()
