"""What would stop it: the smallest changes that give smooth sliding, each judged by
runs of the rig's own contacts.
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
    SEEDS,
    SWAYS,
    Budget,
    BudgetExhausted,
    fluctuation,
    is_expensive,
    trial,
)
from stickslip.advise.survey import (
    PRECISION,
    Band,
    Turn,
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

_WIDEST_STD = 0.5  # of thresholds, over their mean, by convention
# runs for two changes at once, as many as for all else: who asks for them may wait
_FOR_PAIRS = 160.0
_CLEARANCE = 1.03  # how far past a linear boundary runs begin
# speeds of a range at which runs are made lie within this factor of each other
_APART = 4.0
# What can be changed on a machine; what only another material or surface would change.
TURNABLE = (
    VELOCITY,
    parameters.STIFFNESS,
    parameters.DAMPING,
    parameters.MASS,
    parameters.LOAD,
)


def turnable(rig: Rig) -> tuple[Parameter, ...]:
    """What can be changed on the machine of a rig, the damping of each mode of a
    structure among it.
    """
    modes = range(1, len(getattr(rig.slider, "dampings", ())) + 1)
    return (*TURNABLE, *map(parameters.damping_of_mode, modes))


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
    now: float  #: where it stands

    #: Stick-slip decays even from a start at rest, anywhere within 5 % of this value:
    #: of as many contacts as the rig has, or as many as show no noise, in 8 of 8 runs
    #: at its nearer end, so that (at 95 % confidence) it decays there in more than two
    #: of three. Where the rig works over a range of speeds, at its ends and between
    #: them, no two speeds more than a factor four apart; and by linear theory at every
    #: speed of the range.
    to: float

    #: root mean square of the force over its mean there, at the rig's own speed, by the
    #: noise of its contacts: by linear theory, or in a run where the velocity sways by
    #: too much for that; NaN where neither shows any
    noise: float = math.nan

    @property
    def size(self) -> float:
        """How far the parameter must be varied: the logarithm of the factor."""
        return abs(math.log(self.to / self.now)) if self.now else math.inf


def _changed(rig: Rig, factor: float, turn: Turn) -> Mitigation:
    """A factor on a parameter, up or down, as a change."""
    parameter, side = turn
    now = rig.value(parameter)
    return Mitigation(parameter=parameter.name, now=now, to=now * factor**side)


def _with_noise(rig: Rig, change: Mitigation) -> Mitigation:
    """A change with the noise that it leaves: by linear theory, or where that does not
    cover it as one run more shows.
    """
    there = rig.with_values(**{change.parameter: change.to})
    with suppress(InputError, UndecidedError):  # no theory of it
        found = contact_noise(there)
        if found.relative_velocity <= SWAYS:
            return replace(change, noise=found.relative_force)
    with suppress(InputError):
        budget = Budget(math.inf)
        *_, (run, seen) = budget.looks(budget.record(trial(there)), 1.0)
        if seen.is_noise:
            return replace(change, noise=fluctuation(run, seen))
    return change


def has(rig: Rig, parameter: Parameter) -> bool:
    """Whether a rig has a parameter that can be varied: natural units have none that
    only rescales them.
    """
    try:
        return parameter.get(rig) > 0 and not (
            parameter.rescales and rig.scales is None
        )
    except InputError:
        return False


def reach(rig: Rig, parameter: Parameter) -> tuple[float, float]:
    """Factors on a parameter between which limits and changes are looked for."""
    if parameter is parameters.STD:
        return 1.0 / 3.0, highest(rig, parameter)
    widest = 10.0 if is_expensive(rig) else 30.0
    # longer delays never help: many modes
    return 1.0 / widest, 3.0 if parameter is parameters.DELAY else widest


def highest(rig: Rig, parameter: Parameter) -> float:
    """Factor up to which a parameter can be raised at all: wider thresholds are no
    longer such about a mean.
    """
    thresholds = rig.interface.thresholds
    if parameter is not parameters.STD or thresholds is None:
        return math.inf
    return max(_WIDEST_STD * thresholds.moment(1) / parameter.get(rig), 1.0)


def speeds_of(rig: Rig, between: tuple[float, float] | None) -> list[float]:
    """Natural speeds at which a rig is to slide smoothly: its own, those at which it
    works, or some over a range in its own units.
    """
    if between is None:
        return [*rig.operation.speeds] or [rig.natural.velocity]
    low, high = (end / rig.unit("velocity") for end in between)
    count = math.ceil(math.log(high / low) / math.log(_APART)) + 1
    speeds: list[float] = np.geomspace(low, high, count).tolist()
    return speeds


class _Outcome(NamedTuple):
    """Result of a search along one factor."""

    factor: float = math.inf  # the smallest that gives smooth sliding, if any does
    reached: float = 1.0  # up to which none does
    left: bool = True  # whether there is more to try, or by more runs
    # the furthest value, and the fraction of runs there that slide smoothly
    some: tuple[float, float] | None = None


class Search:
    """The smallest changes for smooth sliding at all speeds of a rig, or over a range.

    It holds the rig at each of these speeds, in natural units, and what is known of
    each parameter.
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
        self._turnable = turnable(rig)
        # of each parameter that is varied alone, what is known up and down
        self._known = {
            each: (_Outcome(), _Outcome())
            for each in (*self._turnable, *_OTHERS)
            if self._can_vary(each)
        }

    def _can_vary(self, parameter: Parameter) -> bool:
        """Whether to vary a parameter may help: the speed only if it is one."""
        if parameter is VELOCITY:
            return len(self._rigs) == 1
        # The damping of contacts that wait for an arrest stays: with enough of it, none
        # would attach again.
        arrest = isinstance(self._own.interface.delay, OnArrest)
        return has(self._own, parameter) and not (
            arrest and parameter is parameters.DAMPING
        )

    def _vary_each(
        self, group: Sequence[Parameter], seeds: int, report: Progress
    ) -> None:
        """Vary each parameter of a group that is left, alone, up and down."""
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
        """Search the smallest change of each parameter, or with `pairs` of two; return
        them as fields of the answer.

        What can be changed on a machine comes first: by one run at a time, each
        parameter with a fair part of half of what is left of the budget; then by all
        runs, the smallest change first.
        """
        for step, (group, seeds) in enumerate(
            product((self._turnable, _OTHERS), (1, SEEDS))
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
                turn = parameter, -1 if factor == down.factor else 1
                change = _changed(self._own, factor, turn)
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

    def _furthest(self, *turns: Turn) -> float:
        """The factor up to which parameters are varied, as far as that could be
        built.
        """
        ends = list[float]()
        for parameter, side in turns:
            low, high = reach(self._rigs[0], parameter)
            value = parameter.get(self._own.natural)
            if built := self._own.operation.range_of(parameter.name):
                low = max(low, built[0] / value)
                high = min(high, built[1] / value)
            ends.append(high if side > 0 else 1.0 / low)
        return min(ends)

    def along(
        self, *turns: Turn, seeds: int = SEEDS, most: float = math.inf
    ) -> _Outcome:
        """The smallest factor on some parameters, up to `most`, from which on
        stick-slip decays from rest.

        Within `PRECISION`, in so many runs. Steps double from just past where smooth
        sliding may be stable on. A factor that the first run does not deny, but
        another, is not counted among those from which on there is none.
        """
        change = factor_on(*turns)
        furthest = min(most, self._furthest(*turns))
        self._reached = 1.0
        try:
            for low, high in self._may_be_stable(*turns, most=most):
                self._reached = low
                value = self._first(change, low, high, 1)
                if value <= high and not self._smooth(change, value, seeds):
                    value = self._first(change, value, high, seeds)
                if value <= high / (1.0 + PRECISION):
                    value *= 1.0 + PRECISION
                    return _Outcome(value, self._reached, left=seeds == 1)
                # too near to the end to stand with room beyond it
                if value <= high == furthest:
                    return _Outcome(reached=self._reached, left=False)
            if furthest > 1.0 and seeds > 1 and self._smooth(change, furthest, 1):
                rigs = self._varied(change, furthest)
                runs = [[other] for other in range(1, seeds + 1)]
                smooth = sum(self._budget.slide_smoothly(rigs, run) for run in runs)
                some = furthest ** turns[0][1], smooth / seeds
                return _Outcome(reached=self._reached, left=False, some=some)
        except BudgetExhausted:
            return _Outcome(reached=self._reached)
        return _Outcome(reached=max(furthest, 1.0), left=False)

    def _first(self, change: Parameter, low: float, high: float, seeds: int) -> float:
        """The smallest factor in a range, to `PRECISION`, with so many smooth runs;
        infinite if its steps meet none.
        """
        doubled = (_CLEARANCE * (1.0 + PRECISION) ** (2**k - 1) for k in count())
        steps = takewhile(lambda step: step < high, (low * each for each in doubled))
        for rough, step in pairwise([low, *steps, high]):
            if rough > low and not self._smooth(change, rough, 1):
                self._reached = rough
            if self._smooth(change, step, seeds):
                # to which doubled steps are halved, whatever the rounding
                width = 1.001 * math.log1p(PRECISION)
                smooth = partial(self._smooth, change, seeds=seeds)
                return halved(smooth, rough, step, width)[1]
        return math.inf

    def _varied(self, change: Parameter, factor: float) -> list[Rig]:
        return [change.set(rig, factor) for rig in self._rigs]

    def _smooth(self, change: Parameter, factor: float, seeds: int) -> bool:
        """Whether the rig slides smoothly after a change: by linear theory, at all
        speeds and with a little more of it, and in runs.
        """
        budget = self._budget
        rigs = self._varied(change, factor)
        # ranges of little damping that are unstable may be narrower than a look is wide
        for more in (1.0, 1.0 + 0.5 * PRECISION, 1.0 + PRECISION):
            varied = self._varied(change, factor * more)
            if any(budget.theory(linearly_unstable, rig) for rig in varied):
                return False
        if self._range > 1.0:
            bands = theory_along(budget, rigs[0], VELOCITY, 1.0, self._range)
            if any(band.kind == "unstable" for band in bands):
                return False
        return budget.slide_smoothly(rigs, range(1, seeds + 1))

    def _may_be_stable(self, *turns: Turn, most: float) -> list[tuple[float, float]]:
        """Ranges of the factor in which linear theory does not call smooth sliding
        unstable at any of the speeds.

        Where it is stable already, at the one speed there is, a range that ends at a
        limit leads the wrong way.
        """
        furthest = self._furthest(*turns)
        end = min(most, furthest)
        found = [(1.0, end)] if end > 1.0 else []
        for rig in self._rigs if found else ():
            bands = [
                band
                for band in self._linear(rig, furthest, *turns)
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

    def _linear(self, rig: Rig, furthest: float, *turns: Turn) -> tuple[Band, ...]:
        """What linear theory says along a factor; of one parameter, as of its
        margins.
        """
        (parameter, side), *more = turns
        if more:
            return theory_along(self._budget, rig, factor_on(*turns), 1.0, furthest)
        bands = theory_along(self._budget, rig, parameter, *reach(rig, parameter))
        if side > 0:
            return bands
        return tuple(
            replace(b, low=1.0 / b.high, high=1.0 / b.low) for b in reversed(bands)
        )

    def _pair(self, most: float) -> tuple[Mitigation, ...]:
        """Two parameters of the machine that give smooth sliding by one factor below
        `most`, each turned so that the fastest mode grows less.
        """
        helpful = [
            turn
            for turn in product(self._turnable, (1, -1))
            if turn[0] in self._known
            and self._growth(turn, 1.0 + PRECISION) < self._growth(turn, 1.0)
        ]
        begins = {}
        for both in combinations(helpful, 2):
            if ranges := self._may_be_stable(*both, most=most):
                begins[both] = ranges[0][0]
        for both in sorted(begins, key=lambda both: begins[both]):
            factor = self.along(*both, most=most).factor
            if factor < math.inf:
                return tuple(_changed(self._own, factor, turn) for turn in both)
        return ()

    def _growth(self, turn: Turn, factor: float) -> float:
        """Growth of the fastest mode at any of the speeds, over the distance that
        the drive goes.
        """
        rates = list[float]()
        for rig in self._varied(factor_on(turn), factor):
            rate, _ = fastest_mode(rig)
            rates.append(math.inf if rate is None else rate / rig.velocity)
        return max(rates)
