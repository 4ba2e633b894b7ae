"""What would stop it: the smallest changes that give smooth sliding, each judged by runs of the rig's own contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from stickslip.advise.linear import Part, is_dear, is_stable, stability_along, together
from stickslip.advise.runs import (
    PRECISION,
    Budget,
    Spent,
    at_speed,
    contacts_of,
    first_smooth,
    judge,
    slides_smoothly,
)
from stickslip.advise.speeds import BY_THEORY
from stickslip.errors import InputError
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.model import FromRest, FromSliding, OnArrest
from stickslip.model.parameters import (
    AGEING,
    CONTACT_STIFFNESS,
    DAMPING,
    DELAY,
    FRICTION,
    LOAD,
    MASS,
    STD,
    STIFFNESS,
    VELOCITY,
    Parameter,
)
from stickslip.model.rig import Rig

RANGE, DEAR_RANGE = 30.0, 10.0
"""Changes are looked for up to this factor."""
_SLIGHT = 0.05
"""Peak to peak over static friction up to which an oscillation is slight (a convention)."""
_CLEARANCE = 1.03
_CLEARANCES = (_CLEARANCE, 1.1, 1.25)
"""How far past a linear boundary runs begin; and those that test whether smooth sliding stays."""
Parts = tuple[tuple[Parameter, int], ...]
"""Parameters varied together, each up (+1) or down (-1)."""
Choices = tuple[tuple[Parameter, tuple[int, ...]], ...]
"""Parameters, and which ways each is turned."""
TURNABLE: Choices = (
    (VELOCITY, (1, -1)),
    (STIFFNESS, (1, -1)),
    (DAMPING, (1, -1)),
    (MASS, (1, -1)),
    (LOAD, (-1, 1)),
)
"""What can be changed on a machine, and which way is looked at first."""
OTHERS: Choices = (
    (FRICTION, (-1,)),
    (CONTACT_STIFFNESS, (1, -1)),
    (DELAY, (-1,)),
    (STD, (1,)),
    (AGEING, (-1, 1)),
)
"""What only another material or surface would change."""
WIDEST_STD = 0.5
"""Relative to the mean."""
NATURAL_SIDES = {"stiffness": 1, "damping": 1}
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
        Of the motion at `reached`: "smooth sliding" only of an unstable rig whose oscillation is slight, and "smooth in
        one run" where not all of eight were; where it was not simulated, what linear theory says.
    """

    parameter: str
    value: float
    reached: float
    amplitude_before: float
    amplitude: float | None
    kind: str


class Search:
    """The search for changes of one rig; it stops when its budget is spent, and says what it left out."""

    def __init__(self, rig: Rig, unstable: bool, theory: Mapping[str, Sequence[Part]], budget: Budget) -> None:
        setting = rig.natural
        self.rig, self.setting = rig, at_speed(setting, setting.velocity)
        self.unstable, self.theory, self.budget = unstable, theory, budget
        self.method = contacts_of(setting)
        self.range = DEAR_RANGE if is_dear(setting.interface) else RANGE
        self.left_out: list[str] = []

    def single(self, parameters: Choices, report: Callable[[float], None]) -> list[Mitigation]:
        """The smallest change of each of some parameters; of an unstable rig also that which keeps it smooth."""
        choices = [choice for choice in parameters if self._may_vary(choice[0])]
        stops, found = list[tuple[int, float] | None](), list[Mitigation]()
        for i, (parameter, sides) in enumerate(choices):
            report(0.7 * i / len(choices))
            stops.append(_nearest({side: self._stop(((parameter, side),)) for side in sides}))
        for i, ((parameter, sides), stop) in enumerate(zip(choices, stops, strict=True)):  # with what time is left
            report(0.7 + 0.3 * i / len(choices))
            within = math.log(stop[1] / (1.0 + PRECISION) ** 2) if stop else math.inf
            near = (stop[0],) if stop else sides
            keep = _nearest({side: self._keep((parameter, side), within) for side in near if self.unstable})
            if nearest := stop or keep:
                way = ((parameter, nearest[0]),)
                found.append(self._mitigation(way, stop and stop[1], keep and keep[1]))
        return found

    def pairs(self, sides: dict[str, int]) -> list[Mitigation]:
        """Two of the parameters that can be turned, each by the same factor, in the directions given."""
        choices = [(p, sides[p.name]) for p, _ in TURNABLE if p.name in sides and self._may_vary(p)]
        return [
            self._mitigation(pair, factor, None)
            for pair in combinations(choices, 2)
            if (factor := self._stop(pair)) is not None
        ]

    def attempts(self, before: float, static_friction: float, mitigated: set[str]) -> Iterator[tuple[Attempt, int]]:
        """The better end of its range, for each parameter that can be turned and gives no smooth sliding there."""
        for parameter, sides in TURNABLE:
            if parameter.name in mitigated or not self._may_vary(parameter):
                continue
            value = parameter.get(self.setting)
            ends = [
                (*self._oscillation(parameter.set(self.setting, reached), static_friction), reached, side)
                for side in sides
                if (reached := value * self._furthest(((parameter, side),)) ** side) != value
            ]
            if not ends:
                continue
            amplitude, kind, reached, side = min(ends, key=lambda end: (end[0], end[2]))
            size = self.rig.unit(parameter.unit)
            yield (
                Attempt(
                    parameter=parameter.name,
                    value=value * size,
                    reached=reached * size,
                    amplitude_before=before,
                    amplitude=amplitude if amplitude < math.inf else None,
                    kind=kind,
                ),
                side,
            )

    def _oscillation(self, there: Rig, static_friction: float) -> tuple[float, str]:
        """Peak-to-peak force from rest over static friction, and the motion; infinite and by theory if it costs much.

        Smooth sliding is believed of a rig that the theory calls unstable only where it is slight.
        """
        stable = is_stable(there)
        try:
            seen = judge(there, self.method, self.budget)
        except (Spent, InputError):
            return math.inf, BY_THEORY[stable]
        amplitude, fast = seen.peak_to_peak / static_friction, (seen.largest_velocity or 0.0) > SLIP_VELOCITY
        if seen.kind != "smooth sliding":
            return amplitude, str(seen.kind)
        if fast or (stable is False and amplitude > _SLIGHT):
            return amplitude, "undecided"
        return amplitude, "smooth sliding" if stable is False else "smooth in one run"

    def _may_vary(self, parameter: Parameter) -> bool:
        """Whether a rig has a parameter that can be varied: natural units have none that only rescales them.

        Nor is the damping varied of contacts that re-attach on arrest: a slider that is damped enough never stops, so
        that none would attach again.
        """
        if parameter.rescales and self.rig.scales is None:
            return False
        if parameter is DAMPING and isinstance(self.setting.interface.delay, OnArrest):
            return False
        try:
            return parameter.get(self.setting) > 0
        except InputError:
            return False

    def _ranges(self, parts: Parts) -> list[Part]:
        """Factors from 1 to the largest at which smooth sliding may be stable: where the theory does not deny it."""
        furthest = self._furthest(parts)
        if furthest <= 1.0:
            return []
        if len(parts) > 1 or parts[0][0].name not in self.theory:
            along = stability_along(together(parts), self.setting, 1.0, furthest)
            return [part for part in along if part.stable is not False]
        ((parameter, side),) = parts
        value, found = parameter.get(self.setting), list[Part]()
        for low, high, stable in self.theory[parameter.name]:
            first, last = (low / value, high / value) if side > 0 else (value / high, value / low)
            if stable is not False and last > 1.0 and first < furthest:
                found.append(Part(max(first, 1.0), min(last, furthest), stable))
        return sorted(found)

    def _promising(self, parts: Parts) -> list[Part]:
        """These ranges; none for a parameter of a stable rig that does not lead away from a limit on the other side."""
        ranges = self._ranges(parts)
        if len(parts) > 1 or not ranges or not ranges[0].stable or ranges[0].low > 1.0:
            return ranges
        ((parameter, side),) = parts
        behind, opposite = ((parameter, -side),), self._furthest(((parameter, -side),))
        if ranges[0].high < self._furthest(parts) or opposite <= 1.0:
            return []
        limited = self._ranges(behind)
        return ranges if limited and limited[0].high < opposite else []

    def _stop(self, parts: Parts) -> float | None:
        """By which factor to vary parameters together until stick-slip decays from rest."""
        try:
            for low, high, _ in self._promising(parts):
                if (begin := low * _CLEARANCE) < high:
                    factor = first_smooth(self._test(parts, FromRest()), begin, high, ill=low)
                    if factor is not None:
                        return factor
        except Spent:
            self.left_out.append(" and ".join(parameter.title for parameter, _ in parts))
        return None

    def _keep(self, part: tuple[Parameter, int], within: float) -> float | None:
        """By which factor, of a logarithm below `within`, to vary a parameter until smooth sliding stays, once reached.

        Just past its boundary, or a little further.
        """
        smooth = self._test((part,), FromSliding())
        try:
            for low, high, _ in self._promising((part,))[:1]:
                for factor in (low * clearance for clearance in _CLEARANCES):
                    if factor < high and math.log(factor) < within and smooth(factor):
                        return factor
        except Spent:
            pass
        return None

    def _mitigation(self, parts: Parts, stops: float | None, keeps: float | None) -> Mitigation:
        """A change in the rig's own units, from factors."""

        def values(factor: float | None) -> tuple[float, ...] | None:
            return None if factor is None else tuple(self.rig.value(p) * factor**side for p, side in parts)

        own = tuple(self.rig.value(p) for p, _ in parts)
        return Mitigation(
            parameters=tuple(p.name for p, _ in parts), values=own, keeps=values(keeps), stops=values(stops)
        )

    def _furthest(self, parts: Parts) -> float:
        """Largest factor: a distribution wider than half its mean is no longer one of thresholds about a mean."""
        furthest = self.range
        for parameter, side in parts:
            value = parameter.get(self.setting)
            if (feasible := self.setting.operation.range_of(parameter.name)) is not None:
                low, high = feasible
                furthest = min(furthest, high / value if side > 0 else value / low)
            if parameter is STD and side > 0:
                furthest = min(furthest, WIDEST_STD * self.setting.interface.thresholds.moment(1) / value)
        return furthest

    def _test(self, parts: Parts, start: FromRest | FromSliding) -> Callable[[float], bool]:
        """Whether the rig slides smoothly, by the factor of a change."""
        path = together(parts)

        def smooth(factor: float) -> bool:
            there = path.set(self.setting, factor)
            return is_stable(there) is not False and slides_smoothly(there, self.method, self.budget, start)

        return smooth


def _nearest(factors: dict[int, float | None]) -> tuple[int, float] | None:
    """The smallest of the factors that were found, with its direction."""
    found = [(side, factor) for side, factor in factors.items() if factor is not None]
    return min(found, key=lambda pair: pair[1], default=None)
