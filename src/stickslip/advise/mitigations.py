"""What would stop it: the smallest changes that give smooth sliding, each judged by
runs of the rig's own contacts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, product
from typing import NamedTuple

import numpy as np

from stickslip.advise.budget import (
    SEEDS,
    Budget,
    BudgetExhausted,
    is_expensive,
    trial,
)
from stickslip.advise.survey import (
    PRECISION,
    Band,
    Turn,
    factor_on,
    fastest_mode,
    halvings,
    theory_along,
)
from stickslip.cycles.edges import halved
from stickslip.cycles.oscillation_verdict import linearly_unstable
from stickslip.errors import InputError
from stickslip.model import OnArrest, parameters
from stickslip.model.parameters import VELOCITY, Parameter
from stickslip.model.rig import Rig
from stickslip.progress import Progress, part

_WIDEST_STD = 0.5  # of thresholds, over their mean, by convention
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

    @property
    def size(self) -> float:
        """How far the parameter must be varied: the logarithm of the factor."""
        return abs(math.log(self.to / self.now))


class Changes(NamedTuple):
    """Changes of a rig that give smooth sliding, and parameters without any."""

    #: Those that can be made on the machine first, in each group the smallest first.
    #: Where the rig works over a range of speeds, or at several, each is one for all of
    #: them.
    mitigations: tuple[Mitigation, ...] = ()

    #: Two changes that give smooth sliding together, each smaller than any one alone.
    combined: tuple[Mitigation, ...] = ()

    #: Parameters that give no smooth sliding, with the range searched.
    attempts: Mapping[str, tuple[float, float]] = {}

    #: Parameters with the furthest value, and the fraction of runs there that slide
    #: smoothly: some, not all.
    unreliable: Mapping[str, tuple[float, float]] = {}

    #: Titles of parameters whose search ended with the budget.
    not_searched: tuple[str, ...] = ()


def smallest_changes(
    rig: Rig,
    between: tuple[float, float] | None,
    budget: Budget,
    report: Progress,
    *,
    pairs: bool = False,
) -> Changes:
    """Search the smallest change of each parameter, or of two, for smooth sliding at
    all speeds of a rig, or over a range of them.

    What can be changed on a machine comes first: by one run at a time, each parameter
    with a fair part of half of what is left of the budget; then by all runs, the
    smallest change first.
    """
    search = _Search(rig, between, budget)
    for step, (group, seeds) in enumerate(product((TURNABLE, _OTHERS), (1, SEEDS))):
        search.vary_each(group, seeds, part(report, 0.25 * step, 0.25 * (step + 1)))
    return search.changes(pairs=pairs)


def _changes(rig: Rig, factor: float, *turns: Turn) -> tuple[Mitigation, ...]:
    """A factor on each of some parameters, up or down, as changes."""
    values = [(each.name, rig.value(each), side) for each, side in turns]
    return tuple(
        Mitigation(parameter=name, now=v, to=v * factor**side)
        for name, v, side in values
    )


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
        return list(rig.operation.speeds) or [rig.natural.velocity]
    low, high = (end / rig.unit("velocity") for end in between)
    count = math.ceil(math.log(high / low) / math.log(_APART)) + 1
    return [float(speed) for speed in np.geomspace(low, high, count)]


class _Outcome(NamedTuple):
    """Result of a search along one factor."""

    factor: float | None  # the smallest that gives smooth sliding
    reached: float  # up to which none does
    wholly: bool  # whether that is all there is to try
    # the furthest value, and the fraction of runs there that slide smoothly
    some: tuple[float, float] | None = None


@dataclass
class _Varied:
    """What is known of a parameter that is varied alone."""

    rough: float = math.inf  # the factor that one run allows
    change: Mitigation | None = None
    tried: tuple[float, float] | None = None  # values without smooth sliding
    some: tuple[float, float] | None = None  # as of an outcome, but the value
    left: bool = True  # whether some of its range is not searched


class _Search:
    """The rig at each speed at which it is to slide smoothly, in natural units, and
    what is known of each parameter.
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
        self._known = {
            each: _Varied() for each in (*TURNABLE, *_OTHERS) if self._can_vary(each)
        }

    def vary_each(
        self, group: Sequence[Parameter], seeds: int, report: Progress
    ) -> None:
        """Vary each parameter of a group alone, up and down, as far as it is left."""
        waiting = [each for each in group if each in self._known]
        waiting = [each for each in waiting if self._known[each].left]
        waiting.sort(key=lambda each: self._known[each].rough)
        for i, parameter in enumerate(waiting):
            report(i / len(waiting))
            fraction = 0.5 / (len(waiting) - i) if seeds == 1 else 1.0
            with self._budget.limited_to(fraction):
                up = self.along((parameter, 1), seeds=seeds)
                most = up.factor or math.inf
                down = self.along((parameter, -1), seeds=seeds, most=most)
            self._keep(parameter, up, down, seeds)

    def _keep(
        self, parameter: Parameter, up: _Outcome, down: _Outcome, seeds: int
    ) -> None:
        """Keep the outcome of varying a parameter by so many runs."""
        known = self._known[parameter]
        value = self._own.value(parameter)
        factor = down.factor or up.factor
        known.left = not (up.wholly and down.wholly)
        if factor:
            known.rough = factor
            known.left = known.left or seeds == 1
        if factor and seeds > 1:
            turn = parameter, -1 if down.factor else 1
            (known.change,) = _changes(self._own, factor, turn)
        elif down.reached * up.reached > 1.0:
            known.tried = value / down.reached, value * up.reached
        for outcome in (up, down):
            if outcome.some:
                end, fraction = outcome.some
                known.some = value * end, fraction

    def changes(self, *, pairs: bool) -> Changes:
        """All that was found, and with `pairs` two changes together."""
        found = [each.change for each in self._known.values() if each.change]
        others = [each.name for each in _OTHERS]
        found.sort(key=lambda each: (each.parameter in others, round(each.size, 3)))
        combined: tuple[Mitigation, ...] = ()
        if pairs:
            most = math.exp(min((each.size for each in found), default=math.inf))
            with suppress(BudgetExhausted):
                combined = self._pair(most / (1.0 + PRECISION))
        vain = {one: each for one, each in self._known.items() if not each.change}
        return Changes(
            mitigations=tuple(found),
            combined=combined,
            attempts={one.name: each.tried for one, each in vain.items() if each.tried},
            unreliable={one.name: each.some for one, each in vain.items() if each.some},
            not_searched=tuple(one.title for one, each in vain.items() if each.left),
        )

    def _can_vary(self, parameter: Parameter) -> bool:
        """Whether to vary a parameter may help: the speed only if it is one."""
        # The damping of contacts that wait for an arrest stays: with enough of it, none
        # would attach again.
        arrest = parameter is parameters.DAMPING and isinstance(
            self._own.interface.delay, OnArrest
        )
        return (
            has(self._own, parameter)
            and not arrest
            and (parameter is not VELOCITY or len(self._rigs) == 1)
        )

    def _furthest(self, *turns: Turn) -> float:
        """The factor up to which parameters are varied, as far as that could be
        built.
        """
        ends = list[float]()
        for parameter, side in turns:
            value = parameter.get(self._own.natural)
            low, high = reach(self._rigs[0], parameter)
            least, most = self._own.operation.range_of(parameter.name) or (
                low * value,
                high * value,
            )
            ends.append(
                min(high, most / value) if side > 0 else 1.0 / max(low, least / value)
            )
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
                if value is not None and not self._smooth(change, value, seeds):
                    value = (
                        self._first(change, value, high, seeds)
                        if value < high
                        else None
                    )
                if value is not None and value <= high / (1.0 + PRECISION):
                    return _Outcome(value * (1.0 + PRECISION), self._reached, True)
                # too near to the end to stand with room beyond it
                if value is not None and high == furthest:
                    return _Outcome(None, self._reached, True)
            if furthest > 1.0 and seeds > 1 and self._smooth(change, furthest, 1):
                rigs = self._varied(change, furthest)
                others = range(1, seeds + 1)
                smooth = sum(
                    self._budget.slide_smoothly(rigs, [other]) for other in others
                )
                at = furthest ** turns[0][1]
                return _Outcome(None, self._reached, True, (at, smooth / seeds))
        except BudgetExhausted:
            return _Outcome(None, self._reached, False)
        return _Outcome(None, max(furthest, 1.0), True)

    def _first(
        self, change: Parameter, low: float, high: float, seeds: int
    ) -> float | None:
        """The smallest factor in a range, to `PRECISION`, with so many smooth runs,
        if its steps meet any.
        """
        steps = [
            low * _CLEARANCE * (1.0 + PRECISION) ** (2**k - 1)
            for k in range(halvings(high / low) + 1)
        ]
        for rough, step in pairwise(
            [low, *(step for step in steps if step < high), high]
        ):
            if rough > low and not self._smooth(change, rough, 1):
                self._reached = rough
            if self._smooth(change, step, seeds):
                # to which doubled steps are halved, whatever the rounding
                width = 1.001 * math.log1p(PRECISION)
                return halved(
                    lambda factor: self._smooth(change, factor, seeds),
                    rough,
                    step,
                    width,
                )[1]
        return None

    def _varied(self, change: Parameter, factor: float) -> list[Rig]:
        return [change.set(rig, factor) for rig in self._rigs]

    def _smooth(self, change: Parameter, factor: float, seeds: int) -> bool:
        """Whether the rig slides smoothly after a change: by linear theory, at all
        speeds, and in runs.
        """
        rigs = self._varied(change, factor)
        if any(self._budget.theory(linearly_unstable, rig) for rig in rigs):
            return False
        bands = (
            theory_along(self._budget, rigs[0], VELOCITY, 1.0, self._range)
            if self._range > 1.0
            else ()
        )
        return all(
            band.kind != "unstable" for band in bands
        ) and self._budget.slide_smoothly(rigs, range(1, seeds + 1))

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
                for low, high in found
                for band in bands
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
        return (
            bands
            if side > 0
            else tuple(
                replace(b, low=1.0 / b.high, high=1.0 / b.low) for b in reversed(bands)
            )
        )

    def _pair(self, most: float) -> tuple[Mitigation, ...]:
        """Two parameters of the machine that give smooth sliding by one factor below
        `most`, each turned so that the fastest mode grows less.
        """
        turns = [(each, side) for each in TURNABLE for side in (1, -1)]
        helpful = [
            turn
            for turn in turns
            if turn[0] in self._known
            and self._growth(turn, 1.0 + PRECISION) < self._growth(turn, 1.0)
        ]
        begins = {}
        for both in combinations(helpful, 2):
            ranges = self._may_be_stable(*both, most=most)
            if ranges:
                begins[both] = ranges[0][0]
        for both in sorted(begins, key=lambda both: begins[both]):
            if factor := self.along(*both, most=most).factor:
                return _changes(self._own, factor, *both)
        return ()

    def _growth(self, turn: Turn, factor: float) -> float:
        """Growth of the fastest mode at any of the speeds, over the distance that
        the drive goes.
        """
        there = [factor_on(turn).set(rig, factor) for rig in self._rigs]
        rates = [(fastest_mode(rig)[0], rig.velocity) for rig in there]
        return max(
            math.inf if rate is None else rate / velocity for rate, velocity in rates
        )
