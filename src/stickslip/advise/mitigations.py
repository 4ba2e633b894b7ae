"""What would stop it: the smallest changes that give smooth sliding, each judged by runs of the rig's own contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

from stickslip.advise.bands import PRECISION, Band, Change, by_theory, factor_of, is_dear, stability_along, within
from stickslip.advise.runs import Budget, Spent, at_speed, contacts_of, first_smooth, judge, slides_smoothly
from stickslip.errors import InputError
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.model import FromRest, FromSliding, OnArrest, Start, parameters
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig
from stickslip.progress import Progress

if TYPE_CHECKING:
    from stickslip.advise.answer import Prediction

RANGE, DEAR_RANGE = 30.0, 10.0
"""Changes are looked for up to this factor."""
WIDEST_STD = 0.5
"""A distribution that is wider, relative to its mean, is no longer one of thresholds about a mean."""
_CLEARANCES = (1.03, 1.1, 1.25)
"""How far past a linear boundary runs begin; and those that test whether smooth sliding stays."""
_FOR_AN_ANSWER = 30.0
"""Seconds more, by estimate, that runs may take until a first change is found."""
_TURNABLE = {
    parameters.VELOCITY: (1, -1),
    parameters.STIFFNESS: (1, -1),
    parameters.DAMPING: (1, -1),
    parameters.MASS: (1, -1),
    parameters.LOAD: (-1, 1),
}
"""What can be changed on a machine, and which ways each is turned, that which is looked at first before."""
_OTHERS = {
    parameters.FRICTION: (-1,),
    parameters.CONTACT_STIFFNESS: (1, -1),
    parameters.DELAY: (-1,),
    parameters.STD: (1,),
    parameters.AGEING: (-1, 1),
}
"""What only another material or surface would change."""


@dataclass(frozen=True, kw_only=True)
class Mitigation:
    """A change of one parameter, or of two together, that gives smooth sliding; in the rig's own units.

    Attributes
    ----------
    parameters : tuple of str
    values : tuple of float
        Where they stand.
    keeps : tuple of float or None
        Smooth sliding, once reached, stays: it is linearly stable, and as many contacts as the rig has did not leave it
        in 8 runs of 8. None if that holds without a change, or is hardly nearer than `stops`.
    stops : tuple of float or None
        Stick-slip decays even from a start at rest, anywhere within 5 % of this value: of as many contacts as the rig
        has, in 8 of 8 runs at its nearer end, so that (at 95 % confidence) it decays there in more than two of three.
        None if no such change was found.
    """

    parameters: tuple[str, ...]
    values: tuple[float, ...]
    keeps: tuple[float, ...] | None
    stops: tuple[float, ...] | None

    @property
    def size(self) -> float:
        """How far the parameters must be varied, as the sum of the logarithms of their factors."""
        targets = self.stops or self.keeps or (math.inf,) * len(self.values)
        return sum(abs(math.log(target / value)) for target, value in zip(targets, self.values, strict=True))


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """A change that does not give smooth sliding within the range searched: how far it was taken, and what is left.

    Attributes
    ----------
    parameter : str
    value, reached : float
        Where it stands, and the end of the range in the better direction; in the rig's own units.
    amplitude : float
        Peak-to-peak force from rest at `reached`, as a fraction of static friction.
    kind : str
        Of the motion at `reached`: "smooth in one run, not in all" of eight, for one.
    """

    parameter: str
    value: float
    reached: float
    amplitude: float
    kind: str


def mitigated(found: Prediction, theory: Mapping[str, Sequence[Band]], budget: Budget, report: Progress) -> Prediction:
    """A verdict with changes of one parameter; of two, if none of those that can be turned on a machine suffices."""
    search = _Search(found, theory, budget)
    turned = search.single(_TURNABLE)
    report(0.5)
    stopping = {change.parameters[0] for change in turned if change.stops}
    tried = list(search.attempts(stopping))
    report(0.6)
    turned += [] if stopping else search.pairs(tried)
    others = search.single(_OTHERS)
    helped = {_title(map(parameters.parameter_named, each.parameters)) for each in (*turned, *others) if each.stops}

    def order(change: Mitigation) -> tuple[bool, float]:
        return change.stops is None, round(change.size, 3)

    return replace(
        found,
        mitigations=(*sorted(turned, key=order), *sorted(others, key=order)),
        attempts=tuple(tried),
        not_searched=tuple(title for title in dict.fromkeys(search.left_out) if title not in helped),
    )


def _title(varied: Iterable[Parameter]) -> str:
    return " and ".join(parameter.title for parameter in varied)


def has(rig: Rig, parameter: Parameter) -> bool:
    """Whether a rig has a parameter that can be varied: natural units have none that only rescales them."""
    try:
        return parameter.get(rig) > 0 and not (parameter.rescales and rig.scales is None)
    except InputError:
        return False


class _Search:
    """The search for changes of one rig, by factors; it stops when its budget is spent, and says what it left out."""

    def __init__(self, found: Prediction, theory: Mapping[str, Sequence[Band]], budget: Budget) -> None:
        self.found, self.rig, self.setting = found, found.rig, at_speed(found.rig.natural)
        self.theory, self.budget, self.reserve = theory, budget, _FOR_AN_ANSWER
        budget.left += self.reserve
        self.method = contacts_of(self.rig)
        self.left_out: list[str] = []

    def single(self, choices: Mapping[Parameter, tuple[int, ...]]) -> list[Mitigation]:
        """The smallest change of each of some parameters; of an unstable rig also that which keeps it smooth."""
        ways = [[((parameter, side),) for side in choices[parameter]] for parameter in self._varied(choices)]
        stops = [self._smallest(self._stop, changes) for changes in ways]
        found: list[Mitigation] = []
        for changes, stop in zip(ways, stops, strict=True):  # with what time is left
            near, below = ([stop[1]], stop[0] / (1.0 + PRECISION) ** 2) if stop else (changes, math.inf)
            keep = self._smallest(partial(self._keep, below), near if self.found.unstable_modes else [])
            if nearest := stop or keep:
                found.append(self._mitigation(nearest[1], stop and stop[0], keep and keep[0]))
        return found

    def pairs(self, tried: Iterable[Attempt]) -> list[Mitigation]:
        """Two of the parameters that can be turned, each by the same factor, in the directions that did best."""
        choices = [(parameters.parameter_named(p.parameter), 1 if p.reached > p.value else -1) for p in tried]
        found = (self._smallest(self._stop, [pair]) for pair in combinations(choices, 2))
        return [self._mitigation(pair, factor, None) for factor, pair in filter(None, found)]

    def attempts(self, mitigated: set[str]) -> Iterator[Attempt]:
        """The better end of its range for each parameter to turn that gives no smooth sliding there."""
        for parameter in self._varied(_TURNABLE):
            ends = []
            for side in _TURNABLE[parameter] if parameter.name not in mitigated else ():
                furthest = self._furthest(((parameter, side),))
                there = factor_of(((parameter, side),)).set(self.setting, furthest)
                try:
                    if furthest != 1.0:
                        ends.append((*self._oscillation(there), self.rig.value(parameter) * furthest**side))
                except (Spent, InputError):
                    self.left_out.append(parameter.title)
            if ends:
                amplitude, kind, reached = min(ends)
                value = self.rig.value(parameter)
                yield Attempt(parameter=parameter.name, value=value, reached=reached, amplitude=amplitude, kind=kind)

    def _oscillation(self, there: Rig) -> tuple[float, str]:
        """Peak-to-peak force from rest over static friction, and the motion."""
        seen, friction = judge(there, self.method, self.budget), self.found.static_friction / self.rig.unit("f_s")
        kind = str(seen.kind)
        if kind == "smooth sliding":  # too little is seen where slips are fast, or smooth sliding is unstable
            fast = (seen.largest_velocity or 0.0) > SLIP_VELOCITY
            kind = "undecided" if fast or by_theory(there) == "unstable" else "smooth in one run, not in all"
        return seen.peak_to_peak / friction, kind

    def _varied(self, choices: Iterable[Parameter]) -> list[Parameter]:
        """Parameters that the rig has and that may be varied.

        The damping of contacts that re-attach on arrest is not: a slider that is damped enough never stops, so that
        none would attach again.
        """
        left_out = parameters.DAMPING if isinstance(self.rig.interface.delay, OnArrest) else None
        return [parameter for parameter in choices if parameter is not left_out and has(self.rig, parameter)]

    def _furthest(self, change: Change) -> float:
        """Largest factor."""
        furthest = DEAR_RANGE if is_dear(self.rig) else RANGE
        for parameter, side in change:
            value = parameter.get(self.setting)
            low, high = self.rig.operation.range_of(parameter.name) or (value / furthest, value * furthest)
            if parameter is parameters.STD:
                high = min(high, WIDEST_STD * self.rig.interface.thresholds.moment(1))
            furthest = min(furthest, high / value if side > 0 else value / low)
        return furthest

    def _ranges(self, change: Change) -> list[Band]:
        """Factors from 1 to the largest at which smooth sliding may be stable: where the theory does not deny it."""
        furthest, ((parameter, side), *more) = self._furthest(change), change
        if furthest <= 1.0:
            return []
        found = self.theory.get(parameter.name)
        if more or found is None:
            found, side = stability_along(self.setting, change, 1.0, furthest), 1
        return [band for band in within(found, 1.0, furthest, side) if band.kind != "unstable"]

    def _promising(self, change: Change) -> list[Band]:
        """These ranges; none for a parameter of a stable rig that does not lead away from a limit on the other side."""
        ranges = self._ranges(change)
        if len(change) > 1 or not ranges or ranges[0].kind != "stable" or ranges[0].low > 1.0:
            return ranges
        ((parameter, side),) = change
        behind = ((parameter, -side),)
        limited = any(band.high < self._furthest(behind) for band in self._ranges(behind)[:1])
        return ranges if limited and ranges[0].high >= self._furthest(change) else []

    def _smallest(
        self, find: Callable[[Change], float | None], changes: Iterable[Change]
    ) -> tuple[float, Change] | None:
        """The smallest factor that is found, with its change; what costs too much is left out."""
        found: list[tuple[float, Change]] = []
        for change in changes:
            try:
                factor = find(change)
            except Spent:
                self.left_out.append(_title(parameter for parameter, _ in change))
            else:
                found += [(factor, change)] if factor is not None else []
        return min(found, key=lambda each: each[0], default=None)

    def _stop(self, change: Change) -> float | None:
        """By which factor to vary parameters until stick-slip decays from rest."""
        smooth = partial(self._is_smooth, FromRest(), change)
        for band in self._promising(change):
            begin = band.low * _CLEARANCES[0]
            if begin < band.high and (factor := first_smooth(smooth, begin, band.high, band.low)) is not None:
                self.budget.left -= self.reserve
                self.reserve = 0.0
                return factor
        return None

    def _keep(self, below: float, change: Change) -> float | None:
        """By which factor to vary a parameter until smooth sliding stays, once reached: just past its boundary."""
        for band in self._promising(change)[:1]:
            for factor in (band.low * clearance for clearance in _CLEARANCES):
                if factor < min(band.high, below) and self._is_smooth(FromSliding(), change, factor):
                    return factor
        return None

    def _is_smooth(self, start: Start, change: Change, factor: float) -> bool:
        there = factor_of(change).set(self.setting, factor)
        return by_theory(there) != "unstable" and slides_smoothly(there, self.method, self.budget, start)

    def _mitigation(self, change: Change, stops: float | None, keeps: float | None) -> Mitigation:
        """A change in the rig's own units, from factors."""

        def at(factor: float) -> tuple[float, ...]:
            return tuple(self.rig.value(parameter) * factor**side for parameter, side in change)

        return Mitigation(
            parameters=tuple(parameter.name for parameter, _ in change),
            values=at(1.0),
            keeps=at(keeps) if keeps else None,
            stops=at(stops) if stops else None,
        )
