"""At which speeds a rig slides smoothly, and at which it does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

from stickslip.advise.judging import PRECISION, Budget, Spent, at_speed, contacts_of, cost_of, judge
from stickslip.advise.linear import stable_ranges
from stickslip.errors import InputError
from stickslip.measure import Regime
from stickslip.model.parameters import VELOCITY
from stickslip.model.rig import Rig

RANGE, AGED_RANGE = 100.0, 10.0
"""Speeds are looked at within this factor of those of the drive."""
_INSIDE = 5
"""Speeds simulated where smooth sliding is unstable, and over the whole range where it is stable everywhere."""
_DEAREST = 0.3
"""Seconds that a run at another speed may take: slow drives of light sliders are told by theory alone."""


@dataclass(frozen=True, kw_only=True)
class Band:
    """A range of speeds with one kind of motion, in the rig's own units.

    Attributes
    ----------
    kind : {"smooth sliding", "stick-slip", "sustained oscillation", "unstable"}
        From a start at rest; "unstable" where smooth sliding is unstable by theory and nothing was simulated.
    bistable : bool
        Whether smooth sliding, once reached, is stable as well (linear).
    low, high : float
    """

    kind: str
    bistable: bool
    low: float
    high: float


def bands_by_theory(setting: Rig, low: float, high: float) -> tuple[Band, ...]:
    """Ranges of speed in which smooth sliding is stable or not (linear)."""
    constant_speed = at_speed(setting, low)
    stable = stable_ranges(VELOCITY, constant_speed, low, high)
    ends = sorted({low, high, *(end for pair in stable for end in pair)})
    return tuple(Band(kind=_kind_of(a, b, stable), bistable=False, low=a, high=b) for a, b in pairwise(ends) if b > a)


def _kind_of(low: float, high: float, stable: list[tuple[float, float]]) -> str:
    middle = math.sqrt(low * high)
    return "smooth sliding" if any(a < middle < b for a, b in stable) else "unstable"


def bands_by_runs(
    setting: Rig, linear: tuple[Band, ...], here: Regime, budget: Budget, report: Callable[[float], None]
) -> tuple[Band, ...]:
    """Tell the motion where smooth sliding is unstable, and how far it persists from rest where that is stable."""
    method, operation = contacts_of(setting), setting.operation
    known: dict[float, str] = {setting.velocity: here.kind}

    def kind(speed: float) -> str:
        if speed not in known:
            there = at_speed(setting, speed)
            if cost_of(replace(there, method=method)) > _DEAREST:
                return "unknown"
            try:
                known[speed] = judge(there, method, budget).kind
            except (Spent, InputError):
                return "unknown"
        return known[speed]

    for speed in (*operation.speeds, *(operation.between or ())):
        kind(speed)  # where the rig works comes first, while there is time
    found: list[Band] = []
    for i, band in enumerate(linear):
        report(i / len(linear))
        if band.kind == "unstable":
            found += _inside(band, kind, known)
        else:
            below = i > 0 and linear[i - 1].kind == "unstable"
            above = i + 1 < len(linear) and linear[i + 1].kind == "unstable"
            found += _beside(band, kind, known, below, above)
    return tuple(_joined(found))


def _inside(band: Band, kind: Callable[[float], str], known: dict[float, str]) -> list[Band]:
    """Kinds of motion where smooth sliding is unstable, by runs on a grid; where two differ, by halving."""
    places = [band.low * (band.high / band.low) ** ((k + 0.5) / _INSIDE) for k in range(_INSIDE)]
    places = sorted({*places, *(speed for speed in known if band.low < speed < band.high)}, reverse=True)
    kinds = [(speed, _oscillation(kind(speed))) for speed in places][::-1]
    ends = [band.low]
    for (left, one), (right, two) in pairwise(kinds):
        if one == two:
            ends.append(right)
            continue
        while "unstable" not in (one, two) and math.log(right / left) > 2 * PRECISION:
            middle = math.sqrt(left * right)
            seen = _oscillation(kind(middle))
            if seen == "unstable":
                break
            left, right = (middle, right) if seen == one else (left, middle)
        ends.append(math.sqrt(left * right))
    ends.append(band.high)
    return [
        replace(band, kind=what, low=low, high=high)
        for (_, what), low, high in zip(kinds, ends, ends[1:], strict=False)
    ]


def _oscillation(kind: str) -> str:
    """Of a run where smooth sliding is unstable: one that seems smooth has not grown yet, or is hidden by noise."""
    return kind if kind in ("stick-slip", "sustained oscillation") else "unstable"


def _beside(band: Band, kind: Callable[[float], str], known: dict[float, str], below: bool, above: bool) -> list[Band]:
    """How far an oscillation from rest persists into a range of speeds where smooth sliding is stable."""
    seeds = sorted(speed for speed in known if band.low < speed < band.high and _persists(known[speed]))
    if not below and not above and not seeds:  # an oscillation without a boundary of smooth sliding beside it
        grid = [band.low * (band.high / band.low) ** (k / (_INSIDE - 1)) for k in range(_INSIDE)]
        seeds = sorted(speed for speed in grid if _persists(kind(speed)))
    low, high = band.low, band.high
    ends: list[tuple[float, float]] = []
    for begin, way in ([(low, 1)] if below else []) + ([(high, -1)] if above else []):
        ends.append((begin, _where_it_decays(begin, high if way > 0 else low, kind)))
    for speed in seeds:
        if not any(min(pair) <= speed <= max(pair) for pair in ends):
            ends.append((_where_it_decays(speed, low, kind), _where_it_decays(speed, high, kind)))
    bistable = [Band(kind="", bistable=True, low=min(pair), high=max(pair)) for pair in ends if pair[0] != pair[1]]
    found, at = [], low
    for part in sorted(bistable, key=lambda each: each.low):
        inside = [what for speed, what in known.items() if part.low <= speed <= part.high and _persists(what)]
        if part.low > at:
            found.append(replace(band, low=at, high=part.low))
        found.append(
            replace(part, kind=max(inside, key=inside.count) if inside else "stick-slip", low=max(at, part.low))
        )
        at = part.high
    if at < high:
        found.append(replace(band, low=at, high=high))
    return found


def _persists(kind: str) -> bool:
    return kind in ("stick-slip", "sustained oscillation")


def _where_it_decays(begin: float, end: float, kind: Callable[[float], str]) -> float:
    """From where an oscillation persists towards where it may not: the last value at which it was seen to."""
    way = math.log(end / begin)
    step, at, alive = 2.0 * PRECISION, 0.0, 0.0
    while at != way:
        at = at + math.copysign(step, way) if abs(at) + step < abs(way) else way
        if not _persists(kind(begin * math.exp(at))):
            break
        alive = at
        step *= 2.0
    else:
        return end
    while abs(at - alive) > PRECISION:
        middle = 0.5 * (alive + at)
        if _persists(kind(begin * math.exp(middle))):
            alive = middle
        else:
            at = middle
    return begin * math.exp(alive) if alive else begin


def _joined(bands: list[Band]) -> list[Band]:
    """Neighbours of one kind as one."""
    found: list[Band] = []
    for band in bands:
        if band.high <= band.low:
            continue
        if found and (found[-1].kind, found[-1].bistable) == (band.kind, band.bistable):
            found[-1] = replace(found[-1], high=band.high)
        else:
            found.append(band)
    return found
