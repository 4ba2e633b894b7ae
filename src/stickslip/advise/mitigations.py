"""What would stop it: the smallest changes that give smooth sliding, each judged by runs of the rig's own contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import numpy as np

from stickslip.advise.bands import PRECISION, factor_of, fastest_mode, halvings, is_dear, told_along
from stickslip.advise.runs import SEEDS, Spent, Trials, trial
from stickslip.cycles.edges import halved
from stickslip.cycles.verdict import linearly_unstable
from stickslip.errors import InputError
from stickslip.model import OnArrest, parameters
from stickslip.model.parameters import VELOCITY, Parameter
from stickslip.model.rig import Rig
from stickslip.progress import Progress

if TYPE_CHECKING:
    from stickslip.advise.answer import Prediction

_WIDEST_STD = 0.5  # of thresholds, over their mean, by convention
_CLEARANCE = 1.03  # how far past a linear boundary runs begin
_APART = 4.0  # speeds of a range at which runs are made lie within this factor of each other
# What can be changed on a machine; what only another material or surface would change.
TURNABLE = (VELOCITY, parameters.STIFFNESS, parameters.DAMPING, parameters.MASS, parameters.LOAD)
_OTHERS = (parameters.FRICTION, parameters.CONTACT_STIFFNESS, parameters.DELAY, parameters.STD, parameters.AGEING)


@dataclass(frozen=True, kw_only=True)
class Mitigation:
    """A change of one parameter that gives smooth sliding; in the rig's own units."""

    parameter: str
    value: float  #: where it stands

    #: Stick-slip decays even from a start at rest, anywhere within 5 % of this value: of as many contacts as the rig
    #: has, in 8 of 8 runs at its nearer end, so that (at 95 % confidence) it decays there in more than two of three.
    #: Where the rig works over a range of speeds, at its ends and between them, no two speeds more than a factor four
    #: apart; and by linear theory at every speed of the range.
    stops: float

    @property
    def size(self) -> float:
        """How far the parameter must be varied: the logarithm of the factor."""
        return abs(math.log(self.stops / self.value))


def mitigated(found: Prediction, trials: Trials, report: Progress, *, pairs: bool = False) -> Prediction:
    """A verdict with the smallest change of each parameter, or of two, that stops it, and what was tried in vain."""
    rig, search = found.rig, _Search(found, trials)
    choices = [each for each in (*TURNABLE, *_OTHERS) if search.can_vary(each)]
    changes, tried, pair = dict[Parameter, Mitigation](), dict[str, tuple[float, float]](), tuple[Mitigation, ...]()
    # What is most easily set first, each with a fair share of what is left; then those not through, with all of it.
    left = [*choices]
    for lap in range(2):
        for i, parameter in enumerate(waiting := [*left]):
            report(0.5 * (lap + i / len(waiting)))
            value = rig.value(parameter)
            with trials.within(1.0 if lap else 1.0 / (len(waiting) - i)):
                sides = [
                    (side, *search.along(factor_of(parameter, side), end)) for side, end in search.sides(parameter)
                ]
            stops = [value * factor**side for side, factor, _, _ in sides if factor is not None]
            low, high = sorted(value * reached**side for side, _, reached, _ in sides)
            if stops:
                changes[parameter] = min(
                    (Mitigation(parameter=parameter.name, value=value, stops=stop) for stop in stops),
                    key=lambda each: each.size,
                )
            elif low < high:
                tried[parameter.name] = low, high
            if all(wholly for *_, wholly in sides):
                left.remove(parameter)
        if pairs and not lap:
            with trials.within(0.5):
                pair = search.pair([each for each in choices if each in TURNABLE], [*changes.values()])
    mitigations = sorted(changes, key=lambda each: (each in _OTHERS, round(changes[each].size, 3)))
    return replace(
        found,
        mitigations=tuple(changes[each] for each in mitigations),
        pair=pair,
        attempts={name: ends for name, ends in tried.items() if name not in [each.name for each in changes]},
        not_searched=tuple(each.title for each in left if each not in changes),
    )


def has(rig: Rig, parameter: Parameter) -> bool:
    """Whether a rig has a parameter that can be varied: natural units have none that only rescales them."""
    try:
        return parameter.get(rig) > 0 and not (parameter.rescales and rig.scales is None)
    except InputError:
        return False


def reach(rig: Rig, parameter: Parameter) -> tuple[float, float]:
    """Factors on a parameter between which limits and changes are looked for."""
    if parameter is parameters.STD:
        return 1.0 / 3.0, highest(rig, parameter)
    widest = 10.0 if is_dear(rig) else 30.0
    return 1.0 / widest, 3.0 if parameter is parameters.DELAY else widest  # longer delays never help: many modes


def highest(rig: Rig, parameter: Parameter) -> float:
    """Factor up to which a parameter can be raised at all: wider thresholds are no longer such about a mean."""
    if parameter is not parameters.STD:
        return math.inf
    return max(_WIDEST_STD * rig.interface.thresholds.moment(1) / parameter.get(rig), 1.0)


def speeds_of(found: Prediction) -> list[float]:
    """Natural speeds at which the rig is to slide smoothly: its own, those at which it works, or some over a range."""
    if found.between is None:
        return list(found.rig.operation.speeds) or [found.rig.natural.velocity]
    low, high = (end / found.rig.unit("velocity") for end in found.between)
    count = math.ceil(math.log(high / low) / math.log(_APART)) + 1
    speeds: list[float] = np.geomspace(low, high, count).tolist()
    return speeds


class _Search:
    """The rig at each speed at which it is to slide smoothly, in natural units, and the runs that are allowed."""

    def __init__(self, found: Prediction, trials: Trials) -> None:
        self._own, setting, speeds = found.rig, trial(found.rig.natural), speeds_of(found)
        self._range = 1.0 if found.between is None else speeds[-1] / speeds[0]
        self._rigs = [VELOCITY.set(setting, speed) for speed in speeds]
        self._trials = trials

    def can_vary(self, parameter: Parameter) -> bool:
        """Whether to vary a parameter may help: the speed only if it is one."""
        # The damping of contacts that wait for an arrest stays: with enough of it, none would attach again.
        arrest = parameter is parameters.DAMPING and isinstance(self._own.interface.delay, OnArrest)
        return has(self._own, parameter) and not arrest and (parameter is not VELOCITY or len(self._rigs) == 1)

    def sides(self, parameter: Parameter) -> tuple[tuple[int, float], tuple[int, float]]:
        """Both ways to vary a parameter, and the factors up to which that is done, as far as they could be built."""
        value, (low, high) = parameter.get(self._rigs[0]), reach(self._rigs[0], parameter)
        least, most = self._own.operation.range_of(parameter.name) or (low * value, high * value)
        return (1, min(high, most / value)), (-1, 1.0 / max(low, least / value))

    def along(self, change: Parameter, furthest: float) -> tuple[float | None, float, bool]:
        """The smallest factor from which on stick-slip decays from rest, within `PRECISION`, if any.

        Also up to which factor there is none, and whether that is all that was to be searched. Steps double from just
        past where smooth sliding may be stable up to the end of that.
        """
        self._reached = 1.0
        try:
            for low, high in self._may_be_stable(change, furthest) if furthest > 1.0 else ():
                value = self._first(change, low, high, 1)
                if value is not None and not self._smooth(change, value, SEEDS):
                    value = self._first(change, value, high, SEEDS)
                if value is not None and value <= high / (1.0 + PRECISION):
                    return value * (1.0 + PRECISION), self._reached, True
                if value is not None and high == furthest:  # too near to the end to stand with room beyond it
                    return None, self._reached, True
        except Spent:
            return None, self._reached, False
        return None, max(furthest, 1.0), True

    def _first(self, change: Parameter, low: float, high: float, seeds: int) -> float | None:
        """The smallest factor in a range, to `PRECISION`, with so many smooth runs, if its steps meet any."""
        steps = [low * _CLEARANCE * (1.0 + PRECISION) ** (2**k - 1) for k in range(halvings(high / low) + 1)]
        for rough, step in pairwise([low, *(step for step in steps if step < high), high]):
            self._reached = rough
            if self._smooth(change, step, seeds):
                width = 1.001 * math.log1p(PRECISION)  # to which doubled steps are halved, whatever the rounding
                return halved(lambda factor: self._smooth(change, factor, seeds), rough, step, width)[1]
        return None

    def _smooth(self, change: Parameter, factor: float, seeds: int) -> bool:
        """Whether the rig slides smoothly after a change: by linear theory, at all speeds, and in runs."""
        rigs = [change.set(rig, factor) for rig in self._rigs]
        if any(self._trials.told(linearly_unstable, rig) for rig in rigs):
            return False
        bands = told_along(self._trials, rigs[0], VELOCITY, 1.0, self._range) if self._range > 1.0 else ()
        return all(band.kind != "unstable" for band in bands) and self._trials.slide_smoothly(rigs, seeds)

    def _may_be_stable(self, change: Parameter, furthest: float) -> list[tuple[float, float]]:
        """Ranges of the factor in which linear theory does not call smooth sliding unstable at any of the speeds.

        Where it is stable already, at the one speed there is, a range that ends at a limit leads the wrong way.
        """
        found = [(1.0, furthest)]
        for rig in self._rigs:
            bands = [band for band in told_along(self._trials, rig, change, 1.0, furthest) if band.kind != "unstable"]
            if len(self._rigs) == 1 and bands and bands[0].kind == "stable" and bands[0].low == 1.0:
                bands = [band for band in bands if band.low > 1.0 or band.high == furthest]
            both = [(max(low, band.low), min(high, band.high)) for low, high in found for band in bands]
            found = [(low, high) for low, high in both if low < high]
        return found

    def pair(self, choices: Sequence[Parameter], singles: Sequence[Mitigation]) -> tuple[Mitigation, ...]:
        """Two parameters that stop it by one factor on both, each the way that helps, smaller than any alone needs."""
        ways = {each: self._way(each) for each in choices}
        furthest = min((math.exp(each.size) for each in singles), default=math.inf) / (1.0 + PRECISION)
        rows = list[tuple[float, int, tuple[Parameter, Parameter], Parameter, float]]()
        for two in combinations([each for each, side in ways.items() if side], 2):
            most = min([furthest, *(dict(self.sides(each))[ways[each]] for each in two)])
            change = _together([factor_of(each, ways[each]) for each in two])
            if most > 1.0 and (ranges := self._may_be_stable(change, most)):
                rows.append((ranges[0][0], len(rows), two, change, most))
        for _, _, two, change, most in sorted(rows):
            factor, _, _ = self.along(change, min(most, furthest))
            if factor is not None:
                here = {each: self._own.value(each) for each in two}
                return tuple(
                    Mitigation(parameter=each.name, value=value, stops=value * factor ** ways[each])
                    for each, value in here.items()
                )
        return ()

    def _way(self, parameter: Parameter) -> int:
        """The way to vary a parameter in which the fastest mode at any of the speeds grows less; 0 if none does."""
        grows = [
            max(self._growth(factor_of(parameter, side).set(rig, 1.0 + PRECISION)) for rig in self._rigs)
            for side in (1, -1)
        ]
        if not all(map(math.isfinite, grows)):
            return 0
        return 1 if grows[0] < grows[1] else -1

    @staticmethod
    def _growth(rig: Rig) -> float:
        rate, _ = fastest_mode(rig)
        return math.inf if rate is None else rate / rig.velocity


def _together(changes: Sequence[Parameter]) -> Parameter:
    """Some changes by one factor, as one parameter."""

    def varied(rig: Rig, factor: float) -> Rig:
        for change in changes:
            rig = change.set(rig, factor)
        return rig

    return replace(changes[0], name="both", set=varied)
