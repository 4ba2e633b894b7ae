"""The master equation, Eqs. (1)-(4), solved by `stickslip.kernels.panels`, for N
contacts or infinitely many.
"""

import copy
import math
import time
from functools import lru_cache
from itertools import pairwise
from typing import Self

import numpy as np

from stickslip.errors import InputError, UndecidedError
from stickslip.kernels import panel_state as kernel
from stickslip.kernels.cohorts import gauss_rule, spread_out
from stickslip.kernels.drive import PAUSED, UNSOLVED
from stickslip.kernels.effective_stretching import (
    NEVER,
    Breaking,
    is_fixed,
    sliding_lives,
    survivals,
)
from stickslip.kernels.finite_population import counted
from stickslip.kernels.lifetimes import reach
from stickslip.kernels.panel_state import (
    NEGLIGIBLE,
    UNSTRETCHED,
    Accuracy,
    Delays,
    Newborn,
)
from stickslip.kernels.panel_step import only_lose
from stickslip.kernels.panels import advance_panels
from stickslip.kernels.quadrature import GAUSS, WEIGHT, P, Q
from stickslip.kernels.survival import EMPTY, tabulate, widest
from stickslip.model import (
    Bell,
    DelayModel,
    ExponentialGrowth,
    Interface,
    LogarithmicGrowth,
    MasterEquation,
    OnArrest,
    Parabolic,
    Population,
    Slider,
    TabulatedGrowth,
)
from stickslip.model.distributions import Distribution
from stickslip.model.newborn import mean_life, stretching_nodes
from stickslip.model.records import hashable
from stickslip.model.rig import Rig
from stickslip.simulation.engines.base import (
    COLUMNS,
    Advance,
    Array,
    Beginning,
    Engine,
    Leg,
    Stretchings,
    check_newborns,
    looks_aside,
    slider_constants,
    solves,
)
from stickslip.simulation.engines.panel_trial import (
    FEWEST,
    WORTH_A_TRIAL,
    seconds_of_path,
    seconds_of_run,
    seconds_since,
)
from stickslip.simulation.engines.start import (
    breaking_of,
    end_and_knots,
    survival_of,
)
from stickslip.simulation.estimates import Course, Part

_SAFETY = 1e-4, 0.87
"""Tolerance of a step for an error of 1e-4, and the power of the error with which it
varies: errors of steps decrease a little faster than those of the run.
"""
# factor on the tolerance of a step where the survival has knots, or where cohorts are
# not cut
_AT_BENDS = 0.3
_WIDEST = 0.3, 0.1
"""Widest panel over the mean threshold, where panels are cut at all knots and where
the survival may bend inside them.
"""
# largest fraction of counted contacts that may break in a step, for an error of 1e-4
_BROKEN = 0.02
_GRAIN = 0.15
"""Distance within which contacts count as attached at one place, in standard deviations
of the thresholds.
"""
# approximate seconds of an advance (an interrupt is answered only between two), and its
# largest number of steps
_LASTS = 0.1
_MOST_STEPS = 2_000
_FINE = 2.5e-3  # resolution of the recorded stretchings, in ``x_s``


@solves(MasterEquation, type(None), LogarithmicGrowth, activation=(type(None), Bell))
@solves(MasterEquation, ExponentialGrowth, TabulatedGrowth)
@solves(MasterEquation, activation=(Parabolic,))
@solves(Population, type(None), LogarithmicGrowth, activation=(type(None), Bell))
@solves(Population, ExponentialGrowth, TabulatedGrowth)
@solves(Population, activation=(Parabolic,))
class Panels(Engine):
    """Cohorts of contacts that attached in the same step, as fractions of infinitely
    many contacts or counted.

    Its state includes a record of motion, and no kernel changes the state in place.
    """

    columns = COLUMNS
    angle = 0.1
    mechanisms = frozenset({"sliding_force", "newborn", "on_arrest", "activation"})
    smooth = True
    piece = 3.5e-4
    steps: int = 20
    """Number of steps in the next advance, chosen so that it takes `_LASTS` seconds."""
    _lost = -math.inf  # energy lost in breaks up to the last sample

    check = staticmethod(check_newborns)

    def __init__(
        self, beginning: Beginning, method: MasterEquation | Population
    ) -> None:
        self._method = method
        self.slider = slider_constants(beginning.slider)
        interface = beginning.interface
        count = method.count if isinstance(method, Population) else 0
        self._interface = interface
        distribution = interface.threshold_distribution
        breaking = breaking_of(interface)
        newborn = _newborn(
            hashable(distribution),
            hashable(interface.newborn),
            method.rtol,
        )
        # all newborns have the same strength at first
        if isinstance(interface.ageing, ExponentialGrowth):
            newborn = newborn._replace(tried=0.0)
        self.case = kernel.Case(
            breaking,
            _delays(hashable(interface.delay), method),
            self.slider,
            _accuracy(distribution, breaking, method.rtol, count),
            newborn=newborn,
            sliding_force=interface.sliding_force,
        )
        attached = 1.0
        rate = 0.0
        lives = None
        if beginning.sliding:
            x, fraction, lives, path = _lives_met(
                distribution,
                self.case,
                beginning.velocity,
            )
            if is_fixed(breaking):
                path = mean_life(interface)[0]
            attached = path / (path + beginning.velocity * interface.delay.moment(1))
            rate = attached * beginning.velocity / path
        else:
            x, fraction = _nodes(interface.initial, distribution, self.case.accuracy)
            # growth towards a limit has reached it
            if isinstance(interface.ageing, ExponentialGrowth | TabulatedGrowth):
                lives = np.full(x.shape, NEVER), np.abs(x), np.full(x.shape, math.inf)
        self.state = kernel.initial_state(
            breaking,
            self.case.delays,
            x,
            attached * fraction,
            lives=lives,
            velocity=beginning.slider_velocity,
            rate=rate,
            element=interface.sliding_force if beginning.sliding else 0.0,
        )
        if isinstance(method, Population):
            grain = (
                _GRAIN
                * distribution.standard_deviation()
                * min(math.sqrt(method.rtol / 1e-4), 2.0)
            )
            finite = kernel.FiniteNumber(
                float(count),
                np.random.default_rng(method.seed),
                grain,
            )
            self.case = self.case._replace(finite=finite)
            self.state = counted(self.state, self.case, finite)
        self._used = self.state.used  # before the last advance

    @staticmethod
    def cost(
        rig: Rig,
        method: MasterEquation | Population,
        course: Course,
    ) -> tuple[Part, ...]:
        """Return the work of a run, from a trial where it is long enough: no theory
        gives the number of slips.
        """
        interface = rig.interface
        newborn = _newborn(
            hashable(interface.threshold_distribution),
            hashable(interface.newborn),
            method.rtol,
        )
        # one cohort for each stretching of newborns
        seconds = seconds_of_path(interface, course) * newborn.stretching.size
        if seconds > WORTH_A_TRIAL:
            # a heavy slider may still be at rest at the end of the trial
            moved = course.distance * min(course.turns**2 / 6.0, 1.0)
            seconds = max(_tried(hashable(rig.natural)), FEWEST * moved)
        what = f"a path of {course.distance + course.shaken:.2g} mean thresholds"
        return (Part("simulation.rtol", method.rtol, None, -1 / 6, what, seconds),)

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        return float(self.state.motion.time), float(self.state.motion.position)

    def contact_force(self) -> float:
        """Return the current mean force of the contacts."""
        return float(self.state.motion.contact_force)

    @property
    def seconds(self) -> float:
        """Estimated seconds of the last advance, from its counts of steps."""
        return seconds_since(self._used, self)

    @property
    def drive_stiffness(self) -> float:
        """Derivative of the spring force by the position of the drive."""
        return self.slider.stiffness

    def pull(self, place: float, velocity: float) -> float:  # noqa: ARG002
        """Return the spring force with the drive at `place`."""
        return self.slider.stiffness * (place - self.here()[1])

    def spring_force(self, samples: Array, leg: Leg) -> tuple[Array, Array]:
        """Return the spring force at the samples of a leg, and its rate of change."""
        stretch = leg.drive_position(leg.times) - samples[:, 0]
        slope = leg.drive.velocity - samples[:, 1]
        return self.slider.stiffness * stretch, self.slider.stiffness * slope

    def advance(self, leg: Leg) -> Advance:
        """Advance by several steps."""
        before = self.copy()
        self._used = before.state.used
        case = self.case._replace(drive=leg.drive)
        begun = time.perf_counter()
        self.state, records, reason = advance_panels(
            self.state,
            case,
            leg.end,
            leg.times,
            leg.stop,
            self.steps,
        )
        took = max(time.perf_counter() - begun, 1e-9)
        # at most twice as many, as later steps may have more cohorts
        fitting = self.steps * min(_LASTS / took, 2.0)
        self.steps = int(min(max(fitting, 1.0), _MOST_STEPS))
        if reason == UNSOLVED:
            raise UndecidedError(
                f"{self._method}: no step, however short, can be solved from here on; "
                "use another rtol, or Contacts"
            )
        # the largest so far, so that it does not depend on where advances end
        if only_lose(case) and records.size:
            lost = np.append(self._lost, records.lost)
            records.lost = np.maximum.accumulate(lost)[1:]
            self._lost = float(records.lost[-1])
        # The first fields of a record of motion are the columns of a sample.
        rows = (
            np.asarray(records)
            .view(float)
            .reshape(len(records), len(records.dtype))[:, : len(COLUMNS)]
        )
        return Advance(
            rows,
            looks_aside(before, leg, self.here()[0]),
            over=reason != PAUSED,
        )

    def stretchings(self) -> Stretchings:
        """Return the current stretchings of the attached contacts; those that attached
        in one step are spread over its panel.
        """
        state = self.state
        place, mass, reach, clock = spread_out(
            state.cohorts[: state.used.cohorts], _FINE
        )
        fraction = mass * survivals(self.case.breaking, clock, reach)
        kept = fraction > 0.0
        return Stretchings(self.here()[1] - place[kept], fraction[kept], cells=True)

    def copy(self) -> Self:
        """Return an independent engine in the same state."""
        # Kernels change nothing in place but the generator of random numbers.
        other = copy.copy(self)
        if self.case.finite is not None:
            other.case = self.case._replace(finite=copy.deepcopy(self.case.finite))
        return other

    def turned(self, interface: Interface, slider: Slider) -> Self:
        """Return an engine that continues with other contacts and another slider, at
        the same forces, positions and masses.

        Detached contacts stay so for the same fraction of the new delay. Each cohort
        keeps its number of attached contacts.
        """
        turned = self.copy()
        case = self.case
        turned._interface = interface
        turned.slider = slider_constants(slider)
        turned.case = case._replace(slider=turned.slider)
        state = turned.state = copy.deepcopy(self.state)
        past = state.panels[: state.used.panels]
        if interface.delay != self._interface.delay:
            delays = _delays(hashable(interface.delay), self._method)
            ratio = _stretched(case.delays, delays)
            now = state.motion.time
            past[:, 0] = now - ratio * (now - past[:, 0])
            past[:, 1] *= ratio
            state.rough[:] = now - ratio * (now - state.rough)
            turned.case = turned.case._replace(delays=delays)
        if any(
            getattr(interface, part) != getattr(self._interface, part)
            for part in ("thresholds", "activation")
        ):
            breaking = breaking_of(interface)
            accuracy = _accuracy(
                interface.threshold_distribution,
                breaking,
                self._method.rtol,
                0,
            )
            cohorts = state.cohorts[: state.used.cohorts]
            old = survivals(case.breaking, cohorts.clock, cohorts.reach)
            new = survivals(breaking, cohorts.clock, cohorts.reach)
            held = new > 1e-12  # the other contacts break at once
            mass = cohorts.mass * old / np.where(held, new, 1.0)
            mass = np.where(held, mass, 0.0)
            cohorts.mass = mass
            lost = state.motion.mass_in - float((mass * new).sum())
            state.motion.mass_in -= lost
            state.motion.attached -= lost
            state.motion.mass_out += lost
            # they re-attach with the contacts that break in the next step
            past[:, 2 : 3 + P] -= lost
            turned.case = turned.case._replace(breaking=breaking, accuracy=accuracy)
        return turned


@lru_cache(maxsize=256)
def _tried(rig: Rig) -> float:
    """Estimate the seconds of a run by a trial."""
    method = rig.method
    assert isinstance(method, MasterEquation | Population)
    beginning = Beginning(rig.interface, rig.slider, rig.velocity, rig.start)
    engine = Panels(beginning, method)
    position = beginning.drive_position(engine.contact_force())
    return seconds_of_run(engine, position, rig)


def _stretched(old: kernel.Delays, new: kernel.Delays) -> float:
    """Return the ratio of two distributions of delays that differ only in scale."""
    ratio = new.mean / old.mean if old.mean > 0 else math.nan
    scaled, found = (
        np.concatenate(
            [
                delays.weight,
                delays.time * by,
                [delays.fraction, delays.fraction * delays.continuous.top * by],
            ]
        )
        for delays, by in ((old, ratio), (new, 1.0))
    )
    if scaled.size == found.size and np.allclose(scaled, found, rtol=1e-6, atol=0.0):
        return ratio
    raise InputError(
        "Interface.delay: a cycle can be carried over only to a delay that is the old "
        "one scaled (the parameter DELAY does that); use is_sustained() afresh at each "
        "value"
    )


def _tolerance(rtol: float) -> float:
    return _SAFETY[0] * float((rtol / 1e-4) ** _SAFETY[1])


def _accuracy(
    distribution: Distribution,
    breaking: Breaking,
    rtol: float,
    count: int,
) -> kernel.Accuracy:
    """Return the tolerance of a step, and the widest panel on which sums over nodes
    meet it.

    With counted contacts, re-attachment is as rough as the breaks were, and the force
    fluctuates by a few breaks at a time.
    """
    tolerance = _tolerance(rtol)
    # the order of the method is lost at a knot, and again a delay later
    if breaking.knots.size or not is_fixed(breaking):
        tolerance *= _AT_BENDS
    most = _WIDEST[0 if is_fixed(breaking) else 1] * distribution.moment(1)
    local = breaking.width / (distribution.moment(1) if breaking.squared else 1.0)
    width = _width(hashable(distribution), local, is_fixed(breaking), tolerance, most)
    if not count:
        return Accuracy(tolerance, width)
    return Accuracy(
        tolerance,
        width,
        1.0 / math.sqrt(count),
        _BROKEN * math.sqrt(rtol / 1e-4),
    )


@lru_cache(maxsize=64)
def _width(
    distribution: Distribution,
    width: float,
    fixed: bool,
    tolerance: float,
    most: float,
) -> float:
    """Return the widest panel, at most `most`, on which sums over nodes meet a
    tolerance; between knots where panels are cut there.
    """
    knots = end_and_knots(distribution)[1] if fixed else np.empty(0)
    return widest(survival_of(distribution, width), knots, tolerance, most, order=1)


@lru_cache(maxsize=64)
def _delays(delay: DelayModel, method: MasterEquation | Population) -> kernel.Delays:
    """Return the distribution of delays in the form of the kernel."""
    memoryless = isinstance(method, MasterEquation) and method.memoryless
    at_once = (np.zeros(1), np.ones(1))
    (time, weight), continuous = (at_once, []) if memoryless else delay.parts()
    known = Delays(
        time,
        weight,
        EMPTY,
        fraction=0.0,
        grain=1.0,
        mean=delay.moment(1),
        arrest=isinstance(delay, OnArrest),
        memoryless=memoryless,
    )
    if not continuous:
        return known
    fraction = sum(part for part, _ in continuous)
    top = max(end_and_knots(distribution)[0] for _, distribution in continuous)

    def survival(t: Array) -> Array:
        return np.asarray(
            sum(
                part / fraction * distribution.survival(t)
                for part, distribution in continuous
            )
        )

    table = tabulate(survival, top, np.empty(0))
    grain = widest(
        table,
        np.empty(0),
        _tolerance(method.rtol),
        0.3 * known.mean,
        order=0,
    )
    return known._replace(continuous=table, fraction=fraction, grain=grain)


@lru_cache(maxsize=64)
def _newborn(
    thresholds: Distribution,
    newborn: Distribution | None,
    rtol: float,
) -> kernel.Newborn:
    """Return stretchings of contacts that attach, as few as give their force within the
    tolerance for any displacement.
    """
    if newborn is None:
        return UNSTRETCHED
    x, weight = stretching_nodes(newborn, thresholds, finer=4)
    displacement = np.linspace(0.0, 2.0 * end_and_knots(thresholds)[0], 200)[:, None]

    def survival(x: Array) -> Array:
        return np.maximum(thresholds.survival(np.abs(x)), 1e-300)

    def pulled(x: Array, weight: Array) -> Array:
        far = displacement + x
        held = thresholds.survival(np.maximum(np.abs(far), np.abs(x))) / survival(x)
        return np.asarray((held * far) @ weight)

    exact = pulled(x, weight)
    tolerance = _tolerance(rtol)
    for count in (1, 2, 3, 4, 6, 8, 12, 16, 24, 32):
        if count >= x.size:
            break
        nodes, part = gauss_rule(x, weight, count)
        if np.abs(pulled(nodes, part) - exact).max() < tolerance:
            return Newborn(nodes, part, 1.0)
    # Gauss rules do not suffice for thresholds much narrower than newborns.
    for finer in (0.25, 0.5, 1.0, 2.0):
        nodes, part = stretching_nodes(newborn, thresholds, finer)
        if nodes.size and np.abs(pulled(nodes, part) - exact).max() < tolerance:
            return Newborn(nodes, part, 1.0)
    return Newborn(x, weight, 1.0)


def _lives_met(
    thresholds: Distribution,
    case: kernel.Case,
    velocity: float,
) -> tuple[Array, Array, tuple[Array, Array, Array], float]:
    """Nodes and weights, of sum 1, of the stretchings in steady sliding.

    Contacts move from the stretching of a newborn to their break. Returns also the
    clocks, reaches and ages at the nodes, and the mean length of a life.
    """
    breaking = case.breaking
    newborn = case.newborn
    width = case.accuracy.width
    parts = []
    strongest = end_and_knots(thresholds)[0]
    end = max(
        reach(breaking.growth, strongest, velocity), newborn.stretching.max() + width
    )
    for begin, fraction in zip(newborn.stretching, newborn.fraction, strict=True):
        begun = newborn.tried * abs(begin)
        mass = fraction / max(float(thresholds.survival(begun)), 1e-13)
        if is_fixed(breaking):
            x, weight = _on_panels(
                {abs(begin), *_knots(thresholds)},
                begin,
                strongest,
                width,
            )
        else:
            # Thermal breaks, or breaks at a growing threshold, begin immediately: the
            # panels shrink geometrically towards the start.
            early = begin + width * 0.25 ** np.arange(1, 24)
            x, weight = _on_panels({0.0, *early}, begin, end, width)
        clock, most, age = sliding_lives(breaking, begin, begun, x, velocity)
        alive = np.maximum(survivals(breaking, clock, most), 0.0)  # except for rounding
        parts.append((x, mass * weight * alive, clock, most, age))
    x, weight, clock, most, age = (
        np.concatenate(part) for part in zip(*parts, strict=True)
    )
    path = float(weight.sum())
    # mass and force of each panel and all later ones
    beyond = np.cumsum((weight * (1.0 + x)).sum(axis=1)[::-1])[::-1]
    kept = beyond > NEGLIGIBLE * case.accuracy.tolerance * path
    return (
        x[kept],
        weight[kept] / weight[kept].sum(),
        (clock[kept], most[kept], age[kept]),
        path,
    )


def _nodes(
    initial: Distribution,
    thresholds: Distribution,
    accuracy: kernel.Accuracy,
) -> tuple[Array, Array]:
    """Initial stretchings at Gauss nodes and their weights of sum 1, both of shape
    (n, Q).

    Panels end at the jumps of both distributions.
    """
    std = initial.standard_deviation()
    if std == 0:
        return np.full((1, Q), initial.moment(1)), WEIGHT[None]
    low, high = initial.support
    end = end_and_knots(thresholds)[0]
    # On panels of this width the weights of a Gaussian meet the tolerance.
    width = min(
        std * min(1.5 * (accuracy.tolerance / 1e-5) ** (0.5 / Q), 1.0), accuracy.width
    )
    x, weight = _on_panels(
        {*initial.knots, *_knots(thresholds)},
        max(low, -end),
        min(high, end),
        width,
    )
    weight = weight * initial.density(x) * (thresholds.survival(np.abs(x)) > 1e-12)
    kept = weight.sum(axis=1) > 1e-17
    return x[kept], weight[kept] / weight[kept].sum()


def _knots(thresholds: Distribution) -> set[float]:
    """Return the stretchings of either sign at which the survival is not smooth."""
    return {0.0, *thresholds.knots, *(-knot for knot in thresholds.knots)}


def _on_panels(
    knots: set[float],
    low: float,
    high: float,
    width: float,
) -> tuple[Array, Array]:
    """Return Gauss nodes and weights on panels that end at the knots and are no wider
    than `width`; both of shape (n, Q).
    """
    edges = [low, *(knot for knot in sorted(knots) if low < knot < high), high]
    parts = [
        np.linspace(a, b, math.ceil((b - a) / width) + 1) for a, b in pairwise(edges)
    ]
    left, right = (
        np.concatenate(ends)[:, None]
        for ends in zip(*((p[:-1], p[1:]) for p in parts), strict=True)
    )
    return left + (right - left) * GAUSS, (right - left) * WEIGHT
