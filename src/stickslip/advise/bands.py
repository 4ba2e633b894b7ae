"""Ranges with one kind of motion along a parameter; where smooth sliding is stable, as linear theory tells.

All along here are factors on what the rig has, so that no unit matters.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from stickslip.cycles.verdict import linearly_unstable
from stickslip.errors import InputError, UndecidedError
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig
from stickslip.stability import growth_rate
from stickslip.stability.critical import search

PRECISION = 0.05
"""Where motion changes is found to this part of the value; nor is one set more closely on a machine."""
CANNOT_GROW = "without delay or ageing smooth sliding cannot become unstable"
"""What is said of contacts whose linear response is 0."""
OSCILLATES = ("stick-slip", "sustained oscillation")
MOTIONS = {"unstable": "linearly unstable", "stable": "linearly stable", "unknown": "not known"}
"""What kinds of motion are called in a sentence, where that is another word."""
Change = tuple[tuple[Parameter, int], ...]
"""Parameters that are varied together, by one factor, each up (+1) or down (-1)."""
_PER_DECADE, _DEAR_PER_DECADE = 16, 6
"""Points at which growing modes are counted; the latter where `is_dear` says so."""
_NARROW = 1e-3
"""Where the theory cannot tell of a whole range, the ends of what it can tell are found to this part of the value."""


@dataclass(frozen=True, kw_only=True)
class Band:
    """A range of a parameter, the speed of a prediction, with one kind of motion.

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
    bistable: bool = False
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
        return MOTIONS.get(self.kind, self.kind) + (" from rest only" if self.bistable else "")


def scaled(bands: Iterable[Band], size: float) -> tuple[Band, ...]:
    """Bands in a unit that is smaller by a factor."""
    return tuple(replace(band, low=band.low * size, high=band.high * size) for band in bands)


def within(bands: Sequence[Band], low: float, high: float, side: int = 1) -> list[Band]:
    """What lies of rising bands between two values; on side -1, of their inverses."""
    if side < 0:
        bands = [replace(band, low=1.0 / band.high, high=1.0 / band.low) for band in reversed(bands)]
    return [
        replace(band, low=max(band.low, low), high=min(band.high, high))
        for band in bands
        if max(band.low, low) < min(band.high, high)
    ]


def joined(bands: Iterable[Band]) -> tuple[Band, ...]:
    """Rising bands; neighbours of one kind, or that overlap, as one."""
    found: list[Band] = []
    for band in bands:
        last = found[-1] if found else None
        if band.high <= band.low:
            continue
        if last and (last.kind, last.bistable) == (band.kind, band.bistable) and band.low <= last.high:
            found[-1] = replace(last, high=max(last.high, band.high), high_found=band.high_found)
        else:
            found.append(band)
    return tuple(found)


def is_dear(rig: Rig) -> bool:
    """Whether a look at the linear response costs a hundred times as much: contacts age, or heat breaks them."""
    return rig.interface.ageing is not None or rig.interface.temperature is not None


def by_theory(rig: Rig) -> str:
    """What linear theory says of smooth sliding: the kind of a band."""
    return {True: "unstable", False: "stable", None: "unknown"}[linearly_unstable(rig)]


def fastest_mode(rig: Rig) -> tuple[float | None, float | None]:
    """Growth rate and frequency, in cycles, in the rig's own units; None if no mode grows or decays exponentially."""
    try:
        root = growth_rate(rig)
    except UndecidedError:
        return None, None
    return root.real, abs(root.imag) / (2.0 * math.pi)


def factor_of(change: Change) -> Parameter:
    """Several parameters varied together, as one: the factor, from where they stand."""

    def varied(rig: Rig, factor: float) -> Rig:
        for parameter, side in change:
            rig = parameter.set(rig, parameter.get(rig) * factor**side)
        return rig

    return Parameter(name=" and ".join(each.name for each, _ in change), unit="1", get=lambda _rig: 1.0, set=varied)


def stability_along(rig: Rig, change: Change, low: float, high: float) -> tuple[Band, ...]:
    """Ranges of the factor of a change, rising, in which smooth sliding is stable throughout, or not.

    Stable ranges narrower than a sixteenth of a decade may be missed.
    """
    factor, density = factor_of(change), _DEAR_PER_DECADE if is_dear(rig) else _PER_DECADE
    try:
        found = search(factor, rig.natural, low, high, density=density, edges_only=True)
    except (InputError, UndecidedError):  # at some value the theory cannot tell
        if high < (1.0 + _NARROW) * low or all(by_theory(factor.set(rig, end)) == "unknown" for end in (low, high)):
            return (Band(kind="unknown", low=low, high=high),)
        middle = math.sqrt(low * high)
        return joined([*stability_along(rig, change, low, middle), *stability_along(rig, change, middle, high)])
    ends = [low, *(edge.value for edge in found.edges), high]
    growing = [found.unstable_at_ends[0], *(edge.unstable_above for edge in found.edges)]
    kinds = ["unstable" if modes else "stable" for modes in growing]
    return tuple(Band(kind=kind, low=a, high=b) for kind, (a, b) in zip(kinds, pairwise(ends), strict=True))
