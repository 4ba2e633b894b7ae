"""At which speeds a rig slides smoothly, and at which it does not; as factors on its own speed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from stickslip.advise.bands import OSCILLATES, PRECISION, Band, is_dear, joined
from stickslip.advise.runs import Budget, Spent, at_speed, contacts_of, cost_of, judge, length_of
from stickslip.errors import InputError
from stickslip.model.rig import Rig
from stickslip.progress import Progress

RANGE, DEAR_RANGE = 100.0, 10.0
"""Speeds are looked at within this factor of those of the drive."""
_APART = 3.0
"""Speeds on the grid lie within this factor of each other."""
_DEAREST = 0.3
"""Seconds that a run as far as at the own speed may take: slow drives of light sliders are told by theory alone."""


def works_at(rig: Rig) -> list[float]:
    """The speeds at which a rig works, and the ends of a range of them."""
    speeds = [*rig.operation.speeds, *(rig.operation.between or ())]
    return [speed / rig.natural.velocity for speed in speeds]


def range_of_speeds(rig: Rig) -> tuple[float, float]:
    """Speeds that an answer is about: far on either side of those that the drive goes through.

    Raises `InputError` if the rig does not go forwards.
    """
    if rig.velocity <= 0:
        backwards = f"{rig.velocity:g} {rig.unit_name('x_s/time')}"
        raise InputError(f"drive: the speed is {backwards}: a prediction needs a speed above 0")
    ends = [abs(v) / rig.natural.velocity for piece in rig.drive.pieces for v in (piece.start, piece.end) if v != 0]
    through, widest = [*ends, *works_at(rig)], DEAR_RANGE if is_dear(rig) else RANGE
    return min(through) / widest, max(through) * widest


class Survey:
    """Runs from rest at speeds over the whole range: a grid first, then by halving where two neighbours differ.

    What was not simulated, or could not be judged, is called neither smooth nor stick-slip.
    """

    def __init__(self, rig: Rig, linear: Sequence[Band], here: str) -> None:
        self._rig, self._method, self._linear = rig, contacts_of(rig), linear
        self.known: dict[float, str] = {1.0: here}

    def look(self, budget: Budget, report: Progress) -> None:
        """Simulate where the rig works, on the grid, and then closer to where motion changes, with what there is."""
        grid = [speed for i in range(len(self._linear)) for speed in self._grid(i)]
        grid = [speed for speed in grid if not math.isclose(speed, 1.0, rel_tol=PRECISION)]
        grid.sort(key=lambda speed: abs(math.log(speed)))
        places = [*works_at(self._rig), *grid]
        for i, speed in enumerate(places):
            report(0.7 * i / len(places))
            self.known.setdefault(speed, "")  # not known yet
            self._try(speed, budget)
        while (change := self._widest_change()) is not None and self._try(change, budget):
            pass
        report(1.0)

    def _grid(self, i: int) -> list[float]:
        """Speeds in a range, evenly by their logarithm; next to a limit of stability, just on its stable side."""
        band = self._linear[i]
        low, high = band.low, band.high
        if band.kind == "stable":
            nearest = min(1.0 + 2.0 * PRECISION, (high / low) ** 0.25)
            low = low * nearest if i > 0 else low
            high = high / nearest if i + 1 < len(self._linear) else high
        count = max(math.ceil(math.log(high / low) / math.log(_APART)), 1)
        speeds: list[float] = np.geomspace(low, high, 2 * count + 1).tolist()
        return speeds[::2] if band.kind == "stable" else speeds[1::2]

    def _try(self, speed: float, budget: Budget) -> bool:
        """Simulate at a speed, if that has not been done; whether it is not too dear."""
        if self.known.get(speed):
            return True
        there = at_speed(self._rig, speed, length_of(self._rig))
        if cost_of(replace(there, method=self._method)) > _DEAREST:
            return False
        try:
            self.known[speed] = judge(there, self._method, budget).kind
        except Spent:
            return False
        except InputError:
            self.known[speed] = "undecided"
        return True

    def _seen(self, band: Band) -> list[tuple[float, str]]:
        """Speeds tried in a range, rising, with the motion there; what theory says where that is not known.

        A run that seems smooth where smooth sliding is unstable has not grown yet, or is hidden by noise.
        """
        told = OSCILLATES if band.kind == "unstable" else (*OSCILLATES, "smooth sliding")
        inside = sorted(speed for speed in self.known if band.low <= speed <= band.high)
        seen = [(v, kind if (kind := self.known[v]) in told else band.kind) for v in inside]
        if band.kind == "stable":
            return seen
        # One speed left out between two with the same oscillation tells nothing against it.
        sides = zip([(0.0, ""), *seen], seen, [*seen[1:], (0.0, "?")], strict=False)
        return [each for one, each, two in sides if not (each[1] == band.kind and one[1] == two[1] != band.kind)]

    def _widest_change(self) -> float | None:
        """Middle of the neighbours with different motion that are furthest apart; None where all changes are found."""
        changes = [
            (right / left, math.sqrt(left * right))
            for band in self._linear
            for (left, one), (right, two) in pairwise(self._seen(band))
            if one != two and band.kind not in (one, two) and math.log(right / left) > 2.0 * PRECISION
        ]
        return max(changes)[1] if changes else None

    def bands(self) -> tuple[Band, ...]:
        """Ranges of linear stability, cut where the motion changes.

        Where the place of a change is not known, what was seen at a speed is told of no others than those next to it.
        """
        parts: list[Band] = []
        for band in self._linear:
            seen, begin, found = self._seen(band) or [(band.low, band.kind)], band.low, True
            for (left, one), (right, two) in pairwise(seen):
                if one == two:
                    continue
                first = last = math.sqrt(left * right)
                oscillates = one in OSCILLATES and two in OSCILLATES  # one passes into the other little by little
                near = math.log(right / left) <= (4.0 if oscillates else 2.0) * PRECISION
                if not near:
                    first = right / (1.0 + PRECISION) if one == band.kind else left * (1.0 + PRECISION)
                    last = first if two == band.kind else right / (1.0 + PRECISION)
                parts += [_part(band, one, begin, first, found, near), _part(band, band.kind, first, last)]
                begin, found = last, near
            parts.append(_part(band, seen[-1][1], begin, band.high, found))
        return joined(parts)


def _part(band: Band, kind: str, low: float, high: float, low_found: bool = True, high_found: bool = True) -> Band:
    if kind == band.kind:
        return replace(band, low=low, high=high)
    bistable = band.kind == "stable" and kind in OSCILLATES
    return Band(kind=kind, bistable=bistable, low=low, high=high, low_found=low_found, high_found=high_found)
