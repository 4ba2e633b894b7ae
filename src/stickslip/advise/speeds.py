"""At which speeds a rig slides smoothly, and at which it does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

from stickslip.advise.linear import is_dear, stability_along
from stickslip.advise.runs import (
    OSCILLATES,
    PRECISION,
    Budget,
    Spent,
    at_speed,
    contacts_of,
    cost_of,
    judge,
)
from stickslip.errors import InputError
from stickslip.measure import Regime
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig

RANGE, DEAR_RANGE = 100.0, 10.0
"""Speeds are looked at within this factor of those of the drive."""
_APART = 3.0
"""Speeds on the grid lie within this factor of each other."""
BY_THEORY = {True: "stable", False: "unstable", None: "unknown"}
STABLE = {kind: stable for stable, kind in BY_THEORY.items()}
"""What linear theory says, in words, and back."""
MOTIONS = {
    **{kind: kind for kind in ("smooth sliding", "stick-slip", "sustained oscillation")},
    "unstable": "linearly unstable",
    "stable": "linearly stable",
    "unknown": "not known",
}
"""What each kind of motion is called in a sentence."""
_DEAREST = 0.3
"""Seconds that a run at another speed may take: slow drives of light sliders are told by theory alone."""


@dataclass(frozen=True, kw_only=True)
class Band:
    """A range of speeds with one kind of motion, in the rig's own units.

    Attributes
    ----------
    kind : {"smooth sliding", "stick-slip", "sustained oscillation", "stable", "unstable", "unknown"}
        From a start at rest; "stable" or "unstable" where linear theory says that of smooth sliding, and what comes of
        a start at rest was not simulated or could not be judged; "unknown" where the theory cannot tell either.
    bistable : bool
        Whether smooth sliding, once reached, is stable as well (linear, so without the noise of contacts).
    low, high : float
    low_found, high_found : bool
        Whether the motion changes at that end; False where it was seen that far, and not looked for beyond.
    """

    kind: str
    bistable: bool
    low: float
    high: float
    low_found: bool = True
    high_found: bool = True

    @property
    def single(self) -> bool:
        """Whether its motion was seen at one speed only, about which no end was looked for."""
        return not (self.low_found or self.high_found) and self.high < (1.0 + 3.0 * PRECISION) * self.low

    @property
    def motion(self) -> str:
        """Its motion in words."""
        return MOTIONS[self.kind] + (" from rest only" if self.bistable else "")


def bands_by_theory(parameter: Parameter, setting: Rig, low: float, high: float) -> tuple[Band, ...]:
    """Ranges of a parameter in which smooth sliding is stable or not (linear)."""
    along = stability_along(parameter, setting, low, high)
    return tuple(Band(kind=BY_THEORY[part.stable], bistable=False, low=part.low, high=part.high) for part in along)


def range_of_speeds(setting: Rig) -> tuple[float, float]:
    """Speeds that an answer is about: far on either side of those that the drive goes through."""
    through = [abs(v) for piece in setting.drive.pieces for v in (piece.start, piece.end) if v != 0]
    through += [*setting.operation.speeds, *(setting.operation.between or ())]
    widest = DEAR_RANGE if is_dear(setting.interface) else RANGE
    return min(through) / widest, max(through) * widest


def check_speed(rig: Rig) -> None:
    """Raise `InputError` if a rig does not go forwards."""
    if rig.velocity <= 0:
        backwards = f"{rig.velocity:g} {rig.unit_name('x_s/time')}"
        raise InputError(f"drive: the speed is {backwards}: a prediction needs a speed above 0")


class Survey:
    """Runs from rest at speeds over the whole range: a grid first, then by halving where two neighbours differ.

    What was not simulated, or could not be judged, is called neither smooth nor stick-slip.
    """

    def __init__(self, setting: Rig, linear: tuple[Band, ...], here: Regime) -> None:
        self._setting, self._method, self._linear = setting, contacts_of(setting), linear
        self._known: dict[float, str] = {setting.velocity: here.kind}

    def look(self, budget: Budget, report: Callable[[float], None]) -> None:
        """Simulate where the rig works, on the grid, and then closer to where motion changes, with what there is."""
        own = self._setting.velocity
        operation = self._setting.operation
        grid = [speed for i in range(len(self._linear)) for speed in self._grid(i)]
        near = [speed for speed in grid if not math.isclose(speed, own, rel_tol=PRECISION)]
        near.sort(key=lambda speed: abs(math.log(speed / own)))
        places = [*operation.speeds, *(operation.between or ()), *near]
        for i, speed in enumerate(places):
            report(0.7 * i / len(places))
            self._known.setdefault(speed, "")  # not known yet
            self._try(speed, budget)
        report(0.7)
        while (pair := self._widest_change()) is not None:
            if not self._try(math.sqrt(pair[0] * pair[1]), budget):
                break
        report(1.0)

    def know(self, speed: float, kind: str) -> None:
        """Take the motion at a speed from who has simulated it before."""
        self._known[speed] = kind

    def bands(self) -> tuple[Band, ...]:
        """The motion at each speed, as far as it was seen."""
        return tuple(joined([part for band in self._linear for part in self._parts(band)]))

    def _grid(self, i: int) -> list[float]:
        """Speeds in a range, evenly by their logarithm; next to a limit of stability, just on its stable side."""
        band = self._linear[i]
        low, high = band.low, band.high
        if band.kind == "stable":
            nearest = min(1.0 + 2.0 * PRECISION, (high / low) ** 0.25)
            low = low * nearest if i > 0 else low
            high = high / nearest if i + 1 < len(self._linear) else high
            count = max(math.ceil(math.log(high / low) / math.log(_APART)), 1)
            return [low, *(low * (high / low) ** (k / count) for k in range(1, count)), high]  # ends to the last digit
        count = max(math.ceil(math.log(high / low) / math.log(_APART)), 1)
        return [low * (high / low) ** ((k + 0.5) / count) for k in range(count)]

    def _try(self, speed: float, budget: Budget) -> bool:
        """Simulate at a speed, if that has not been done; whether it is not too dear."""
        if self._known.get(speed):
            return True
        there = at_speed(self._setting, speed)
        if cost_of(replace(there, method=self._method)) > _DEAREST:
            return False
        try:
            seen = judge(there, self._method, budget).kind
        except Spent:
            return False
        except InputError:
            seen = "undecided"
        self._known[speed] = seen
        return True

    def _seen(self, band: Band) -> list[tuple[float, str]]:
        """Speeds tried in a range, rising, with the motion there; what theory says where that is not known.

        A run that seems smooth where smooth sliding is unstable has not grown yet, or is hidden by noise.
        """
        told = OSCILLATES if band.kind == "unstable" else (*OSCILLATES, "smooth sliding")
        inside = sorted(speed for speed in self._known if band.low <= speed <= band.high)
        seen = [(v, kind if (kind := self._known[v]) in told else band.kind) for v in inside]
        if band.kind == "stable":
            return seen
        # One speed left out between two with the same oscillation tells nothing against it.
        sides = zip([(0.0, ""), *seen], seen, [*seen[1:], (0.0, "?")], strict=False)
        return [each for one, each, two in sides if not (each[1] == band.kind and one[1] == two[1] != band.kind)]

    def _widest_change(self) -> tuple[float, float] | None:
        """Neighbours with different motion that are furthest apart; None where all changes are found."""
        found: list[tuple[float, float, float]] = []
        for band in self._linear:
            for (left, one), (right, two) in pairwise(self._seen(band)):
                if one != two and band.kind not in (one, two) and math.log(right / left) > 2.0 * PRECISION:
                    found.append((right / left, left, right))
        return max(found)[1:] if found else None

    def _parts(self, band: Band) -> list[Band]:
        """A range cut where the motion changes; where the place of a change is not known, that part is open.

        What was seen at a speed is told of no others than those next to it.
        """
        seen = self._seen(band)
        if not seen:
            return [band]
        parts, begin, found = list[Band](), band.low, True
        for (left, one), (right, two) in pairwise(seen):
            if one == two:
                continue
            first = last = math.sqrt(left * right)
            oscillates = one in OSCILLATES and two in OSCILLATES  # one passes into the other little by little
            near = math.log(right / left) <= (4.0 if oscillates else 2.0) * PRECISION
            if not near:
                first = right / (1.0 + PRECISION) if one == band.kind else left * (1.0 + PRECISION)
                last = first if two == band.kind else right / (1.0 + PRECISION)
            parts += [_part(band, one, (begin, first), (found, near)), _part(band, band.kind, (first, last))]
            begin, found = last, near
        return [*parts, _part(band, seen[-1][1], (begin, band.high), (found, True))]


def _part(band: Band, kind: str, ends: tuple[float, float], found: tuple[bool, bool] = (True, True)) -> Band:
    bistable = band.kind == "stable" and kind in OSCILLATES
    found = (True, True) if kind == band.kind else found
    return Band(kind=kind, bistable=bistable, low=ends[0], high=ends[1], low_found=found[0], high_found=found[1])


def joined(bands: list[Band]) -> list[Band]:
    """Neighbours of one kind as one."""
    found: list[Band] = []
    for band in bands:
        if band.high <= band.low:
            continue
        if found and (found[-1].kind, found[-1].bistable) == (band.kind, band.bistable):
            found[-1] = replace(found[-1], high=band.high, high_found=band.high_found)
        else:
            found.append(band)
    return found
