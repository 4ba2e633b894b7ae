"""The smallest changes of parameters that give smooth sliding, each verified by runs of
the rig's own contacts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, count, pairwise, product, takewhile
from typing import Any, NamedTuple

import numpy as np

from stickslip.advise.budget import (
    LINEAR_NOISE,
    SEEDS,
    Budget,
    BudgetExhausted,
    fluctuation,
    is_expensive,
    trial,
)
from stickslip.advise.survey import (
    PRECISION,
    Band,
    Direction,
    factor_on,
    fastest_mode,
    theory_along,
)
from stickslip.cycles.edges import halved
from stickslip.cycles.oscillation_verdict import linearly_unstable
from stickslip.errors import InputError, UndecidedError
from stickslip.model import OnArrest, parameters
from stickslip.model.parameters import VELOCITY, Parameter
from stickslip.model.rig import Rig
from stickslip.progress import Progress, part
from stickslip.stability import contact_noise

_WIDEST_STD = 0.5  # largest std of thresholds over their mean, by convention
# number of runs for two changes at once: as many as for the rest of the answer
_FOR_PAIRS = 160.0
_CLEARANCE = 1.03  # runs start at this factor beyond a linear stability boundary
# in a range of speeds, runs are made at speeds at most this factor apart
_APART = 4.0
# Parameters that can be changed on a machine. (Those of `_OTHERS` need another material
# or surface.)
MACHINE_PARAMETERS = (
    VELOCITY,
    parameters.STIFFNESS,
    parameters.DAMPING,
    parameters.MASS,
    parameters.LOAD,
)


def machine_parameters(rig: Rig) -> tuple[Parameter, ...]:
    """Return the parameters that can be changed on the machine of a rig, including the
    damping of each mode of a structure.
    """
    modes = range(1, len(getattr(rig.slider, "dampings", ())) + 1)
    return (*MACHINE_PARAMETERS, *map(parameters.damping_of_mode, modes))


_OTHERS = (
    parameters.FRICTION,
    parameters.CONTACT_STIFFNESS,
    parameters.DELAY,
    parameters.STD,
    parameters.AGEING,
)


@dataclass(frozen=True, kw_only=True)
class Mitigation:
    """A change of one parameter that gives smooth sliding; in the rig's own units."""

    parameter: str
    now: float  #: present value

    #: New value. Stick-slip decays, even from a start at rest, anywhere within 5 % of
    #: it: in 8 of 8 runs at the nearer end, so that (at 95 % confidence) it decays
    #: there in more than two of three runs. These runs have as many contacts as the
    #: rig, or as many as make no visible noise. If the rig works over a range of
    #: speeds, runs are made at speeds at most a factor of four apart, and linear theory
    #: judges every speed of the range.
    to: float

    #: rms fluctuation of the force over its mean at the new value and the rig's own
    #: speed, by the noise of its contacts: from linear theory, or from a run if the
    #: velocity fluctuates by too much for that; NaN if neither shows any
    noise: float = math.nan

    @property
    def size(self) -> float:
        """Size of the change: the logarithm of its factor."""
        return abs(math.log(self.to / self.now)) if self.now else math.inf


def _changed(rig: Rig, factor: float, direction: Direction) -> Mitigation:
    """Return the change of a parameter by a factor, up or down."""
    parameter, side = direction
    now = rig.value(parameter)
    return Mitigation(parameter=parameter.name, now=now, to=now * factor**side)


def _with_noise(rig: Rig, change: Mitigation) -> Mitigation:
    """Return a change with the noise of smooth sliding after it: by linear theory or,
    where the noise is too large for that, from one more run, if that shows noise alone.
    """
    there = rig.with_values(**{change.parameter: change.to})
    noise = change.noise
    with suppress(InputError, UndecidedError):  # the theory does not apply
        found = contact_noise(there)
        noise = found.relative_force
        if found.relative_velocity <= LINEAR_NOISE:
            return replace(change, noise=noise)
    with suppress(InputError):
        budget = Budget(math.inf)
        *_, (run, seen) = budget.until_decided(budget.record(trial(there)), 1.0)
        if seen.is_noise:
            noise = fluctuation(run, seen)
    return replace(change, noise=noise)


def has(rig: Rig, parameter: Parameter) -> bool:
    """Whether a rig has a parameter that can be varied; a rig in natural units has none
    that only rescales its units.
    """
    try:
        return parameter.get(rig) > 0 and not (
            parameter.rescales and rig.scales is None
        )
    except InputError:
        return False


def reach(rig: Rig, parameter: Parameter) -> tuple[float, float]:
    """Return the factors on a parameter between which limits and changes are
    searched.
    """
    if parameter is parameters.STD:
        return 1.0 / 3.0, highest(rig, parameter)
    widest = 10.0 if is_expensive(rig) else 30.0
    # longer delays never help: they make more modes grow
    return 1.0 / widest, 3.0 if parameter is parameters.DELAY else widest


def highest(rig: Rig, parameter: Parameter) -> float:
    """Return the factor up to which a parameter can be raised: the std of thresholds
    only up to a fraction of their mean.
    """
    thresholds = rig.interface.thresholds
    if parameter is not parameters.STD or thresholds is None:
        return math.inf
    return max(_WIDEST_STD * thresholds.moment(1) / parameter.get(rig), 1.0)


def speeds_of(rig: Rig, between: tuple[float, float] | None) -> list[float]:
    """Return the speeds, in natural units, at which a rig is to slide smoothly: those
    at which it works, by default its own, or some over a range in the rig's units.
    """
    if between is None:
        return [*rig.operation.speeds] or [rig.natural.velocity]
    low, high = (end / rig.unit("velocity") for end in between)
    count = math.ceil(math.log(high / low) / math.log(_APART)) + 1
    speeds: list[float] = np.geomspace(low, high, count).tolist()
    return speeds


class _Outcome(NamedTuple):
    """Result of a search along one factor."""

    factor: float = math.inf  # smallest factor with smooth sliding, if there is one
    reached: float = 1.0  # factor up to which no smooth sliding was found
    left: bool = True  # whether larger factors, or more runs, remain to be tried
    # the furthest factor, and the fraction of runs there that slide smoothly
    some: tuple[float, float] | None = None


class Search:
    """Search for the smallest changes that give smooth sliding at all speeds of a rig,
    or over a range.

    It holds the rig at each of these speeds, in natural units, and the result so far
    for each parameter.
    """

    def __init__(
        self, rig: Rig, between: tuple[float, float] | None, budget: Budget
    ) -> None:
        setting = trial(rig.natural)
        speeds = speeds_of(rig, between)
        self._own = rig
        self._range = 1.0 if between is None else speeds[-1] / speeds[0]
        self._rigs = [VELOCITY.set(setting, speed) for speed in speeds]
        self._budget = budget
        self._machine_parameters = machine_parameters(rig)
        # the results of varying each parameter alone, up and down
        self._known = {
            each: (_Outcome(), _Outcome())
            for each in (*self._machine_parameters, *_OTHERS)
            if self._can_vary(each)
        }

    def _can_vary(self, parameter: Parameter) -> bool:
        """Whether varying a parameter may help; the speed is varied only if there is
        just one.
        """
        if parameter is VELOCITY:
            return len(self._rigs) == 1
        # If contacts re-attach only at an arrest, the damping is not varied: with
        # enough of it, none would ever re-attach.
        arrest = isinstance(self._own.interface.delay, OnArrest)
        return has(self._own, parameter) and not (
            arrest and parameter is parameters.DAMPING
        )

    def _vary_each(
        self, group: Sequence[Parameter], seeds: int, report: Progress
    ) -> None:
        """Vary each parameter of a group that is not settled, alone, up and down."""
        known = self._known
        waiting = [
            each for each in group if any(side.left for side in known.get(each, ()))
        ]
        waiting.sort(key=lambda each: min(side.factor for side in known[each]))
        for i, parameter in enumerate(waiting):
            report(i / len(waiting))
            fraction = 0.5 / (len(waiting) - i) if seeds == 1 else 1.0
            with self._budget.limited_to(fraction):
                up = self.along((parameter, 1), seeds=seeds)
                down = self.along((parameter, -1), seeds=seeds, most=up.factor)
            known[parameter] = up, down

    def changes(self, report: Progress, *, pairs: bool = False) -> dict[str, Any]:
        """Search for the smallest change of each parameter and, with `pairs`, of two
        together; return them as fields of the answer.

        Parameters of the machine come first: with one run for each value, every
        parameter with an equal part of half the remaining budget; then with all runs,
        the smallest change first.
        """
        for step, (group, seeds) in enumerate(
            product((self._machine_parameters, _OTHERS), (1, SEEDS))
        ):
            watch = part(report, 0.25 * step, 0.25 * (step + 1))
            self._vary_each(group, seeds, watch)
        found: list[Mitigation] = []
        attempts = {}
        unreliable = {}
        missed = []
        for parameter, (up, down) in self._known.items():
            value = self._own.value(parameter)
            factor = min(up.factor, down.factor)
            if factor < math.inf:
                direction = parameter, -1 if factor == down.factor else 1
                change = _changed(self._own, factor, direction)
                found.append(_with_noise(self._own, change))
                continue
            if up.reached * down.reached > 1.0:
                attempts[parameter.name] = value / down.reached, value * up.reached
            if some := down.some or up.some:
                unreliable[parameter.name] = value * some[0], some[1]
            if up.left or down.left:
                missed.append(parameter.title)
        combined: tuple[Mitigation, ...] = ()
        if pairs:
            most = math.exp(min((each.size for each in found), default=math.inf))
            self._budget.allowed += _FOR_PAIRS
            with suppress(BudgetExhausted):
                combined = self._pair(most / (1.0 + PRECISION))
        others = [each.name for each in _OTHERS]
        found.sort(key=lambda each: (each.parameter in others, round(each.size, 3)))
        return {
            "mitigations": tuple(found),
            "combined": combined,
            "attempts": attempts,
            "unreliable": unreliable,
            "not_searched": tuple(missed),
        }

    def _furthest(self, *directions: Direction) -> float:
        """Return the factor up to which parameters are varied, within the ranges that
        the rig's file says can be built.
        """
        ends = list[float]()
        for parameter, side in directions:
            low, high = reach(self._rigs[0], parameter)
            value = parameter.get(self._own.natural)
            if built := self._own.operation.range_of(parameter.name):
                low = max(low, built[0] / value)
                high = min(high, built[1] / value)
            ends.append(high if side > 0 else 1.0 / low)
        return min(ends)

    def along(
        self, *directions: Direction, seeds: int = SEEDS, most: float = math.inf
    ) -> _Outcome:
        """Return the smallest factor on some parameters, up to `most`, beyond which
        stick-slip decays from rest, to `PRECISION`, in all of `seeds` runs.

        The factor is raised in doubling steps from just beyond the linear stability
        limit. A factor at which the first run slides smoothly but another does not is
        not counted as `reached`.
        """
        change = factor_on(*directions)
        furthest = min(most, self._furthest(*directions))
        self._reached = 1.0
        try:
            for low, high in self._may_be_stable(*directions, most=most):
                self._reached = low
                value = self._first(change, low, high, 1)
                if value <= high and not self._smooth(change, value, seeds):
                    value = self._first(change, value, high, seeds)
                if value <= high / (1.0 + PRECISION):
                    value *= 1.0 + PRECISION
                    return _Outcome(value, self._reached, left=seeds == 1)
                # too near to the end of the range to leave room beyond it
                if value <= high == furthest:
                    return _Outcome(reached=self._reached, left=False)
            if furthest > 1.0 and seeds > 1 and self._smooth(change, furthest, 1):
                rigs = self._varied(change, furthest)
                runs = [[other] for other in range(1, seeds + 1)]
                smooth = sum(self._budget.slide_smoothly(rigs, run) for run in runs)
                some = furthest ** directions[0][1], smooth / seeds
                return _Outcome(reached=self._reached, left=False, some=some)
        except BudgetExhausted:
            return _Outcome(reached=self._reached)
        return _Outcome(reached=max(furthest, 1.0), left=False)

    def _first(self, change: Parameter, low: float, high: float, seeds: int) -> float:
        """Return the smallest factor in a range, to `PRECISION`, at which all of
        `seeds` runs are smooth; infinite if none of the doubling steps is.
        """
        doubled = (_CLEARANCE * (1.0 + PRECISION) ** (2**k - 1) for k in count())
        steps = takewhile(lambda step: step < high, (low * each for each in doubled))
        for rough, step in pairwise([low, *steps, high]):
            if rough > low and not self._smooth(change, rough, 1):
                self._reached = rough
            if self._smooth(change, step, seeds):
                # slightly wider, so that rounding causes no further halving
                width = 1.001 * math.log1p(PRECISION)
                smooth = partial(self._smooth, change, seeds=seeds)
                return halved(smooth, rough, step, width)[1]
        return math.inf

    def _varied(self, change: Parameter, factor: float) -> list[Rig]:
        return [change.set(rig, factor) for rig in self._rigs]

    def _smooth(self, change: Parameter, factor: float, seeds: int) -> bool:
        """Whether the rig slides smoothly after a change: by linear theory, at all
        speeds and for slightly larger changes, and in runs.
        """
        budget = self._budget
        rigs = self._varied(change, factor)
        # at little damping, unstable ranges may be narrower than `PRECISION`
        for more in (1.0, 1.0 + 0.5 * PRECISION, 1.0 + PRECISION):
            varied = self._varied(change, factor * more)
            if any(budget.theory(linearly_unstable, rig) for rig in varied):
                return False
        if self._range > 1.0:
            bands = theory_along(budget, rigs[0], VELOCITY, 1.0, self._range)
            if any(band.kind == "unstable" for band in bands):
                return False
        return budget.slide_smoothly(rigs, range(1, seeds + 1))

    def _may_be_stable(
        self, *directions: Direction, most: float
    ) -> list[tuple[float, float]]:
        """Return the ranges of the factor in which linear theory does not find smooth
        sliding unstable at any of the speeds.

        If it is stable already, at the only speed, a range that contains the present
        value and ends at a stability limit is left out: it leads the wrong way.
        """
        furthest = self._furthest(*directions)
        end = min(most, furthest)
        found = [(1.0, end)] if end > 1.0 else []
        for rig in self._rigs if found else ():
            bands = [
                band
                for band in self._linear(rig, furthest, *directions)
                if band.kind != "unstable" and band.high > 1.0
            ]
            here = [band for band in bands if band.low <= 1.0]
            if len(self._rigs) == 1 and here and here[0].kind == "stable":
                bands = [b for b in bands if b.low > 1.0 or b.high >= furthest]
            both = (
                (max(low, band.low), min(high, band.high))
                for (low, high), band in product(found, bands)
            )
            found = [(low, high) for low, high in both if low < high]
        return found

    def _linear(
        self, rig: Rig, furthest: float, *directions: Direction
    ) -> tuple[Band, ...]:
        """Return the bands of linear stability along a factor; for one parameter, the
        same as for its margins.
        """
        (parameter, side), *more = directions
        if more:
            return theory_along(
                self._budget, rig, factor_on(*directions), 1.0, furthest
            )
        bands = theory_along(self._budget, rig, parameter, *reach(rig, parameter))
        if side > 0:
            return bands
        return tuple(
            replace(b, low=1.0 / b.high, high=1.0 / b.low) for b in reversed(bands)
        )

    def _pair(self, most: float) -> tuple[Mitigation, ...]:
        """Return changes of two machine parameters that give smooth sliding by one
        common factor below `most`, each in the direction in which the fastest mode
        grows less.
        """
        helpful = [
            direction
            for direction in product(self._machine_parameters, (1, -1))
            if direction[0] in self._known
            and self._growth(direction, 1.0 + PRECISION) < self._growth(direction, 1.0)
        ]
        begins = {}
        for both in combinations(helpful, 2):
            if ranges := self._may_be_stable(*both, most=most):
                begins[both] = ranges[0][0]
        for both in sorted(begins, key=lambda both: begins[both]):
            factor = self.along(*both, most=most).factor
            if factor < math.inf:
                return tuple(
                    _changed(self._own, factor, direction) for direction in both
                )
        return ()

    def _growth(self, direction: Direction, factor: float) -> float:
        """Return the largest growth of the fastest mode at any of the speeds, per
        travel of the drive.
        """
        rates = list[float]()
        for rig in self._varied(factor_on(direction), factor):
            rate, _ = fastest_mode(rig)
            rates.append(math.inf if rate is None else rate / rig.velocity)
        return max(rates)
