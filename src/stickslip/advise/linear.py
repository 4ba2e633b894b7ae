"""Where smooth sliding is stable along a parameter: only where stability itself changes, not where modes join in."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from stickslip.errors import InputError, UndecidedError
from stickslip.model.interface import Interface
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig
from stickslip.stability import count_unstable, critical
from stickslip.stability.critical import Crossings, search

_PER_DECADE, _DEAR_PER_DECADE = 16, 6
"""Points at which growing modes are counted; the latter where `is_dear` says so."""
_NARROW = 0.01
"""A boundary is polished within a bracket of this part of its value."""


def together(parts: Sequence[tuple[Parameter, int]]) -> Parameter:
    """Return several parameters varied together, as one: by a factor, up (+1) or down (-1), from where they stand."""

    def varied(rig: Rig, factor: float) -> Rig:
        for parameter, side in parts:
            rig = parameter.set(rig, parameter.get(rig) * factor**side)
        return rig

    name = " and ".join(parameter.name for parameter, _ in parts)
    return Parameter(name=name, unit="1", get=lambda _rig: 1.0, set=varied)


def is_dear(interface: Interface) -> bool:
    """Whether a look at the linear response costs a hundred times as much: contacts age, or heat breaks them."""
    return interface.ageing is not None or interface.temperature is not None


def is_stable(setting: Rig) -> bool | None:
    """Whether smooth sliding is stable (linear); None where the theory cannot tell."""
    try:
        return count_unstable(setting) == 0
    except (InputError, UndecidedError):
        return None


CANNOT_GROW = "without delay or ageing smooth sliding cannot become unstable"
"""What is said of contacts whose linear response is 0."""


class Part(NamedTuple):
    """A range of a parameter in which smooth sliding is stable, or not (linear); None where the theory cannot tell."""

    low: float
    high: float
    stable: bool | None


def stability_along(parameter: Parameter, setting: Rig, low: float, high: float) -> tuple[Part, ...]:
    """Ranges of a parameter, in natural units, rising, in each of which smooth sliding is stable throughout, or not.

    Stable ranges narrower than a sixteenth of a decade may be missed, and where the theory cannot tell of the whole
    range, unstable ones.
    """
    density = _DEAR_PER_DECADE if is_dear(setting.interface) else _PER_DECADE
    try:
        return _between(search(parameter, setting, low, high, density=density, edges_only=True))
    except (InputError, UndecidedError):  # at some value the theory cannot tell
        pass
    values = np.geomspace(low, high, 2 + math.ceil(density * math.log10(high / low))).tolist()
    values[0], values[-1] = low, high
    stable = [is_stable(parameter.set(setting, value)) for value in values]
    found, begin = [], low
    for (left, before), (right, after) in pairwise(zip(values, stable, strict=True)):
        if before is not after:
            end = _edge(parameter, setting, (left, before), (right, after))
            found.append(Part(begin, end, before))
            begin = end
    return (*found, Part(begin, high, stable[-1]))


def _between(found: Crossings) -> tuple[Part, ...]:
    """The ranges between the edges of stability that were found."""
    (low, high), edges = found.searched, found.edges
    ends = [low, *(edge.value for edge in edges), high]
    stable = [found.unstable_at_ends[0] == 0, *(edge.unstable_above == 0 for edge in edges)]
    return tuple(Part(a, b, each) for (a, b), each in zip(pairwise(ends), stable, strict=True))


def bisect(holds: Callable[[float], bool], low: float, high: float, precision: float) -> tuple[float, float]:
    """Two values, this part of each other apart, between which a test begins to hold: it fails at `low`."""
    while high / low > 1.0 + precision:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return low, high


_Known = tuple[float, bool | None]


def _edge(parameter: Parameter, setting: Rig, one: _Known, other: _Known) -> float:
    """Where stability changes between two values, or what the theory can tell."""
    (left, before), (right, after) = one, other
    left, right = bisect(lambda value: is_stable(parameter.set(setting, value)) is not before, left, right, _NARROW)
    if before is None or after is None:
        return right if before is None else left
    try:
        edges = critical(setting, parameter, between=(left, right)).edges
    except (InputError, UndecidedError):
        edges = ()
    return edges[0].value if edges else math.sqrt(left * right)
