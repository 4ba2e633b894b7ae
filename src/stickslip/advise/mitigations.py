"""What would stop it: the smallest changes that give smooth sliding, each judged by runs of the rig's own contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

from stickslip.advise.judging import Budget, Spent, contacts_of, first_smooth, judge, slides_smoothly
from stickslip.advise.linear import is_dear, is_stable, stability_along, together
from stickslip.advise.speeds import BY_THEORY
from stickslip.errors import InputError
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.model import FromRest, FromSliding
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
    parameter_named,
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
        Smooth sliding, once reached, stays: it is linearly stable, and the rig's own contacts did not leave it in two
        runs. None if that holds without a change, or is no nearer than `stops`.
    stops : tuple of float or None
        Stick-slip decays even from a start at rest, in two runs of the rig's own contacts; to within 5 % the smallest
        such change. None if none was found.
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
        Of the motion at `reached`: "smooth sliding" only of an unstable rig whose oscillation is slight; where it was
        not simulated, what linear theory says.
    """

    parameter: str
    value: float
    reached: float
    amplitude_before: float
    amplitude: float | None
    kind: str


class Search:
    """The search for changes of one rig; it stops when its budget is spent, and says what it left."""

    def __init__(self, setting: Rig, unstable: bool, budget: Budget, *, in_si: bool) -> None:
        self.in_si = in_si
        self.setting, self.unstable, self.budget = setting, unstable, budget
        self.method = contacts_of(setting)
        self.range = DEAR_RANGE if is_dear(setting.interface) else RANGE
        self.left_out: list[str] = []
        self.known: dict[tuple[tuple[str, int], ...], list[tuple[float, float]]] = {}

    def know(self, name: str, stable: list[tuple[float, float]]) -> None:
        """Take ranges of a parameter in which smooth sliding is stable from who has looked for them before."""
        parameter = parameter_named(name)
        value = parameter.get(self.setting)
        for side in (1, -1):
            factors = [(low / value, high / value) if side > 0 else (value / high, value / low) for low, high in stable]
            furthest = self._furthest(((parameter, side),))
            within = [(max(low, 1.0), min(high, furthest)) for low, high in factors if high > 1.0 and low < furthest]
            self.known[((name, side),)] = sorted(within)

    def single(self, parameters: Choices, report: Callable[[float], None]) -> list[Mitigation]:
        """The smallest change of each of some parameters."""
        choices = [(p, sides) for p, sides in parameters if self._has(p)]
        found: list[Mitigation | None] = []
        for i, (parameter, sides) in enumerate(choices):
            report(i / len(choices))
            found.append(_smallest([self._stop(((parameter, side),)) for side in sides]))
        if self.unstable:
            found = [self._kept(*choice, stops) for choice, stops in zip(choices, found, strict=True)]
        return [each for each in found if each is not None]

    def _kept(self, parameter: Parameter, sides: tuple[int, ...], stops: Mitigation | None) -> Mitigation | None:
        """Add to a change that stops it a smaller one that way that keeps it smooth; such a one alone if none stops."""
        if stops is None:
            return _smallest([self._keep((parameter, side)) for side in sides])
        side = 1 if stops.stops > stops.values else -1  # type: ignore[operator]
        keeps = self._keep((parameter, side), within=stops.size / _CLEARANCE)
        return stops if keeps is None else replace(stops, keeps=keeps.keeps)

    def pairs(self, sides: dict[str, int]) -> list[Mitigation]:
        """Two of the parameters that can be turned, each by the same factor, in the directions given."""
        choices = [(p, sides[p.name]) for p, _ in TURNABLE if p.name in sides]
        return [m for pair in combinations(choices, 2) if (m := self._stop(pair)) is not None]

    def attempts(self, before: float, static_friction: float, mitigated: set[str]) -> Iterator[tuple[Attempt, int]]:
        """The better end of its range, for each parameter that can be turned and gives no smooth sliding there."""
        for parameter, sides in TURNABLE:
            if parameter.name in mitigated or not self._has(parameter):
                continue
            value, ends = parameter.get(self.setting), []
            for side in sides:
                furthest = self._furthest(((parameter, side),))
                if furthest <= 1.0:
                    continue
                there = parameter.set(self.setting, value * furthest**side)
                try:
                    seen = judge(there, self.method, self.budget)
                except (Spent, InputError):  # theory alone
                    ends.append((math.inf, value * furthest**side, BY_THEORY[is_stable(there)], side))
                    continue
                fast = (seen.largest_velocity or 0.0) > SLIP_VELOCITY
                kind, large = str(seen.kind), seen.peak_to_peak > _SLIGHT * static_friction
                if kind == "smooth sliding" and (fast or large or is_stable(there) is not False):
                    kind = "undecided"
                ends.append((seen.peak_to_peak, value * furthest**side, kind, side))
            if ends:
                amplitude, reached, kind, side = min(ends)
                yield (
                    Attempt(
                        parameter=parameter.name,
                        value=value,
                        reached=reached,
                        amplitude_before=before,
                        amplitude=amplitude / static_friction if amplitude < math.inf else None,
                        kind=kind,
                    ),
                    side,
                )

    def _has(self, parameter: Parameter) -> bool:
        if parameter.rescales and not self.in_si:
            return False
        try:
            return parameter.get(self.setting) > 0
        except InputError:
            return False

    def _stable(self, parts: Parts) -> tuple[Parameter, list[tuple[float, float]]]:
        """The path along which parameters are varied together, and the factors at which smooth sliding is stable."""
        path, stable = together(parts), self._ranges(parts)
        if stable and stable[0][0] == 1.0 and len(parts) == 1 and not self._leads_away(parts[0], stable[0][1]):
            stable = []
        return path, stable

    def _ranges(self, parts: Parts) -> list[tuple[float, float]]:
        """Factors at which smooth sliding is stable, from 1 to the largest."""
        furthest, key = self._furthest(parts), tuple((parameter.name, side) for parameter, side in parts)
        if key not in self.known:
            path = together(parts)
            along = stability_along(path, self.setting, 1.0, furthest) if furthest > 1.0 else ()
            self.known[key] = [(part.low, part.high) for part in along if part.stable]
        return self.known[key]

    def _leads_away(self, part: tuple[Parameter, int], end: float) -> bool:
        """Whether varying a parameter of a stable rig this way leads away from a limit on the other side."""
        parameter, side = part
        furthest = self._furthest(((parameter, -side),))
        if end < self._furthest((part,)) or furthest <= 1.0:
            return False
        ranges = self._ranges(((parameter, -side),))
        return bool(ranges) and ranges[0][1] < furthest

    def _stop(self, parts: Parts) -> Mitigation | None:
        """Vary parameters together until stick-slip decays from rest."""
        path, stable = self._stable(parts)
        try:
            for low, high in stable:
                if (begin := low * _CLEARANCE) < high:
                    factor = first_smooth(*self._runs(path, FromRest()), begin, high, ill=low)
                    if factor is not None:
                        return self._mitigation(parts, stops=factor)
        except Spent:
            self.left_out.append(" and ".join(parameter.title for parameter, _ in parts))
        return None

    def _keep(self, part: tuple[Parameter, int], within: float = math.inf) -> Mitigation | None:
        """Vary a parameter until smooth sliding, once reached, stays: just past its boundary, or a little further.

        Changes of a size of `within` or more are not tried.
        """
        path, stable = self._stable((part,))
        try:
            for low, high in stable[:1]:
                for factor in (low * clearance for clearance in _CLEARANCES):
                    near = factor < high and math.log(factor) < within
                    if near and all(run(factor) for run in self._runs(path, FromSliding())):
                        return self._mitigation((part,), keeps=factor)
        except Spent:
            pass
        return None

    def _mitigation(self, parts: Parts, *, stops: float | None = None, keeps: float | None = None) -> Mitigation:
        def values(factor: float) -> tuple[float, ...]:
            return tuple(p.get(self.setting) * factor**side for p, side in parts)

        return Mitigation(
            parameters=tuple(p.name for p, _ in parts),
            values=values(1.0),
            keeps=None if keeps is None else values(keeps),
            stops=None if stops is None else values(stops),
        )

    def _furthest(self, parts: tuple[tuple[Parameter, int], ...]) -> float:
        """Largest factor: a distribution wider than half its mean is no longer one of thresholds about a mean."""
        furthest = self.range
        for parameter, side in parts:
            if (feasible := self.setting.operation.range_of(parameter.name)) is not None:
                value, (low, high) = parameter.get(self.setting), feasible
                furthest = min(furthest, high / value if side > 0 else value / low)
            if parameter is STD and side > 0:
                mean = self.setting.interface.thresholds.moment(1)
                furthest = min(furthest, WIDEST_STD * mean / parameter.get(self.setting))
        return furthest

    def _runs(
        self, path: Parameter, start: FromRest | FromSliding
    ) -> tuple[Callable[[float], bool], Callable[[float], bool]]:
        """Whether a run slides smoothly, by the factor; and whether a longer one does, of other contacts."""

        def run(other: int) -> Callable[[float], bool]:
            def smooth(factor: float) -> bool:
                there = path.set(self.setting, factor)
                return bool(is_stable(there)) and slides_smoothly(there, self.method, self.budget, start, other)

            return smooth

        return run(0), run(1)


def _smallest(found: list[Mitigation | None]) -> Mitigation | None:
    return min((each for each in found if each is not None), key=lambda m: m.size, default=None)


def in_units(mitigation: Mitigation, rig: Rig) -> Mitigation:
    """Return a mitigation found in natural units in those of a rig."""
    sizes = [rig.unit(parameter_named(name).unit) for name in mitigation.parameters]

    def scaled(values: tuple[float, ...] | None) -> tuple[float, ...] | None:
        return None if values is None else tuple(v * size for v, size in zip(values, sizes, strict=True))

    own = scaled(mitigation.values)
    assert own is not None
    return replace(mitigation, values=own, keeps=scaled(mitigation.keeps), stops=scaled(mitigation.stops))
