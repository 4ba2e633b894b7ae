"""What would stop it: the smallest changes that give smooth sliding, each judged by runs of the rig's own contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from stickslip.advise.bands import PRECISION, Band, by_theory, is_dear, stability_along
from stickslip.advise.runs import Budget, Spent, at_speed, contacts_of, first_smooth, judge, slides_smoothly
from stickslip.errors import InputError
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.model import FromRest, FromSliding, OnArrest, Start, parameters
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig

RANGE, DEAR_RANGE = 30.0, 10.0
"""Changes are looked for up to this factor."""
_CLEARANCE = 1.03
_CLEARANCES = (_CLEARANCE, 1.1, 1.25)
"""How far past a linear boundary runs begin; and those that test whether smooth sliding stays."""
_FOR_AN_ANSWER = 30.0
"""Seconds more, by estimate, that runs may take until a first change is found."""
WIDEST_STD = 0.5
"""Relative to the mean."""
Change = tuple[tuple[Parameter, int], ...]
"""Parameters that are varied together, by one factor, each up (+1) or down (-1)."""
Choices = tuple[tuple[Parameter, tuple[int, ...]], ...]
"""Parameters, and which ways each is turned, that which is looked at first before."""
TURNABLE: Choices = (
    (parameters.VELOCITY, (1, -1)),
    (parameters.STIFFNESS, (1, -1)),
    (parameters.DAMPING, (1, -1)),
    (parameters.MASS, (1, -1)),
    (parameters.LOAD, (-1, 1)),
)
"""What can be changed on a machine."""
OTHERS: Choices = (
    (parameters.FRICTION, (-1,)),
    (parameters.CONTACT_STIFFNESS, (1, -1)),
    (parameters.DELAY, (-1,)),
    (parameters.STD, (1,)),
    (parameters.AGEING, (-1, 1)),
)
"""What only another material or surface would change."""
_PAIRED = {"stiffness": 1, "damping": 1}
"""Ways to turn in pairs, unless runs have shown better ones."""


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
        targets = self.stops if self.stops is not None else self.keeps
        if targets is None:
            return math.inf
        return sum(abs(math.log(target / value)) for target, value in zip(targets, self.values, strict=True))


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """A change that does not give smooth sliding within the range searched: how far it was taken, and what is left.

    Attributes
    ----------
    parameter : str
    value, reached : float
        Where it stands, and the end of the range in the better direction; in the rig's own units.
    amplitude_before, amplitude : float
        Peak-to-peak force from rest, as a fraction of static friction, now and at `reached`; None where that was not
        simulated.
    kind : str
        Of the motion at `reached`: "smooth in one run" where not all of eight were; where it was not simulated, what
        linear theory says.
    """

    parameter: str
    value: float
    reached: float
    amplitude_before: float
    amplitude: float | None
    kind: str


class Search:
    """The search for changes of one rig, by factors; it stops when its budget is spent, and says what it left out."""

    def __init__(self, rig: Rig, unstable: bool, theory: Mapping[str, Sequence[Band]], budget: Budget) -> None:
        setting = rig.natural
        self.rig, self.setting = rig, at_speed(setting, setting.velocity)
        self.unstable, self.theory, self.budget = unstable, theory, budget
        self.reserve = _FOR_AN_ANSWER
        budget.left += self.reserve
        self.method = contacts_of(setting)
        self.range = DEAR_RANGE if is_dear(setting.interface) else RANGE
        self.left_out: list[str] = []

    def single(self, choices: Choices, report: Callable[[float], None]) -> list[Mitigation]:
        """The smallest change of each of some parameters; of an unstable rig also that which keeps it smooth."""
        ways = [[((p, side),) for side in sides] for p, sides in choices if self._may_vary(p)]
        stops: list[tuple[float, Change] | None] = []
        found: list[Mitigation] = []
        for i, changes in enumerate(ways):
            report(0.7 * i / len(ways))
            stops.append(_nearest((self._stop(change), change) for change in changes))
        for i, (changes, stop) in enumerate(zip(ways, stops, strict=True)):  # with what time is left
            report(0.7 + 0.3 * i / len(ways))
            near, below = ([stop[1]], stop[0] / (1.0 + PRECISION) ** 2) if stop else (changes, math.inf)
            keep = _nearest((self._keep(change, below), change) for change in near if self.unstable)
            if nearest := stop or keep:
                found.append(self._mitigation(nearest[1], stop and stop[0], keep and keep[0]))
        return found

    def pairs(self, tried: dict[str, int]) -> list[Mitigation]:
        """Two of the parameters that can be turned, each by the same factor, in the directions that did best."""
        sides = _PAIRED | tried
        choices = [(p, sides[p.name]) for p, _ in TURNABLE if p.name in sides and self._may_vary(p)]
        found = ((pair, self._stop(pair)) for pair in combinations(choices, 2))
        return [self._mitigation(pair, factor, None) for pair, factor in found if factor is not None]

    def attempts(self, before: float, static_friction: float, mitigated: set[str]) -> dict[Attempt, int]:
        """The better end of its range, and its side, for each parameter to turn that gives no smooth sliding there."""
        found: dict[Attempt, int] = {}
        for parameter, sides in TURNABLE:
            if parameter.name in mitigated or not self._may_vary(parameter):
                continue
            value, size = parameter.get(self.setting), self.rig.unit(parameter.unit)
            ends = []
            for side in sides:
                reached = value * self._furthest(((parameter, side),)) ** side
                if reached != value:
                    there = parameter.set(self.setting, reached)
                    ends.append((*self._oscillation(there, static_friction), reached, side))
            if ends:
                amplitude, kind, reached, side = min(ends, key=lambda end: (end[0], end[2]))
                attempt = Attempt(
                    parameter=parameter.name,
                    value=value * size,
                    reached=reached * size,
                    amplitude_before=before,
                    amplitude=amplitude if amplitude < math.inf else None,
                    kind=kind,
                )
                found[attempt] = side
        return found

    def _oscillation(self, there: Rig, static_friction: float) -> tuple[float, str]:
        """Peak-to-peak force from rest over static friction, and the motion; infinite, and by theory, if it is dear."""
        theory = by_theory(there)
        try:
            seen = judge(there, self.method, self.budget)
        except (Spent, InputError):
            return math.inf, theory
        kind = str(seen.kind)
        if kind == "smooth sliding":  # too little is seen where slips are fast, or smooth sliding is unstable
            fast = (seen.largest_velocity or 0.0) > SLIP_VELOCITY
            kind = "undecided" if fast or theory == "unstable" else "smooth in one run"
        return seen.peak_to_peak / static_friction, kind

    def _may_vary(self, parameter: Parameter) -> bool:
        """Whether a rig has a parameter that can be varied: natural units have none that only rescales them.

        Nor is the damping varied of contacts that re-attach on arrest: a slider that is damped enough never stops, so
        that none would attach again.
        """
        if parameter.rescales and self.rig.scales is None:
            return False
        if parameter is parameters.DAMPING and isinstance(self.setting.interface.delay, OnArrest):
            return False
        try:
            return parameter.get(self.setting) > 0
        except InputError:
            return False

    def _furthest(self, change: Change) -> float:
        """Largest factor: a distribution wider than half its mean is no longer one of thresholds about a mean."""
        furthest = self.range
        for parameter, side in change:
            value = parameter.get(self.setting)
            if (feasible := self.setting.operation.range_of(parameter.name)) is not None:
                low, high = feasible
                furthest = min(furthest, high / value if side > 0 else value / low)
            if parameter is parameters.STD and side > 0:
                furthest = min(furthest, WIDEST_STD * self.setting.interface.thresholds.moment(1) / value)
        return furthest

    def _ranges(self, change: Change) -> list[Band]:
        """Factors from 1 to the largest at which smooth sliding may be stable: where the theory does not deny it."""
        furthest = self._furthest(change)
        if furthest <= 1.0:
            return []
        ((parameter, side), *more) = change
        along = self.theory.get(parameter.name)
        if more or along is None:
            factors = stability_along(_factor(change), self.setting, 1.0, furthest)
            return [band for band in factors if band.kind != "unstable"]
        value, found = parameter.get(self.setting), list[Band]()
        for band in along[::side]:
            low, high = (band.low / value, band.high / value) if side > 0 else (value / band.high, value / band.low)
            if band.kind != "unstable" and high > 1.0 and low < furthest:
                found.append(replace(band, low=max(low, 1.0), high=min(high, furthest)))
        return found

    def _promising(self, change: Change) -> list[Band]:
        """These ranges; none for a parameter of a stable rig that does not lead away from a limit on the other side."""
        ranges = self._ranges(change)
        if len(change) > 1 or not ranges or ranges[0].kind != "stable" or ranges[0].low > 1.0:
            return ranges
        ((parameter, side),) = change
        behind = ((parameter, -side),)
        opposite = self._furthest(behind)
        if ranges[0].high < self._furthest(change) or opposite <= 1.0:
            return []
        limited = self._ranges(behind)
        return ranges if limited and limited[0].high < opposite else []

    def _stop(self, change: Change) -> float | None:
        """By which factor to vary parameters until stick-slip decays from rest."""
        try:
            for band in self._promising(change):
                if (begin := band.low * _CLEARANCE) < band.high:
                    factor = first_smooth(self._test(change, FromRest()), begin, band.high, rough=band.low)
                    if factor is not None:
                        self.budget.left -= self.reserve
                        self.reserve = 0.0
                        return factor
        except Spent:
            self.left_out.append(" and ".join(parameter.title for parameter, _ in change))
        return None

    def _keep(self, change: Change, below: float) -> float | None:
        """By which factor to vary a parameter until smooth sliding stays, once reached: just past its boundary."""
        smooth = self._test(change, FromSliding())
        try:
            for band in self._promising(change)[:1]:
                for factor in (band.low * clearance for clearance in _CLEARANCES):
                    if factor < min(band.high, below) and smooth(factor):
                        return factor
        except Spent:
            pass
        return None

    def _test(self, change: Change, start: Start) -> Callable[[float], bool]:
        """Whether the rig slides smoothly, by the factor of a change."""

        def smooth(factor: float) -> bool:
            there = _factor(change).set(self.setting, factor)
            return by_theory(there) != "unstable" and slides_smoothly(there, self.method, self.budget, start)

        return smooth

    def _mitigation(self, change: Change, stops: float | None, keeps: float | None) -> Mitigation:
        """A change in the rig's own units, from factors."""

        def values(factor: float | None) -> tuple[float, ...] | None:
            return None if factor is None else tuple(self.rig.value(p) * factor**side for p, side in change)

        return Mitigation(
            parameters=tuple(p.name for p, _ in change),
            values=tuple(self.rig.value(p) for p, _ in change),
            keeps=values(keeps),
            stops=values(stops),
        )


def _factor(change: Change) -> Parameter:
    """Several parameters varied together, as one: the factor, from where they stand."""

    def varied(rig: Rig, factor: float) -> Rig:
        for parameter, side in change:
            rig = parameter.set(rig, parameter.get(rig) * factor**side)
        return rig

    return Parameter(name=" and ".join(each.name for each, _ in change), unit="1", get=lambda _rig: 1.0, set=varied)


def _nearest(found: Iterable[tuple[float | None, Change]]) -> tuple[float, Change] | None:
    """The smallest of the factors that were found, with its change."""
    return min(((f, change) for f, change in found if f is not None), key=lambda each: each[0], default=None)
