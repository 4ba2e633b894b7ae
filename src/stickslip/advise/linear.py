"""Where smooth sliding is stable along a parameter: only where stability itself changes, not where modes join in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from stickslip.errors import InputError, UndecidedError
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig
from stickslip.stability import count_unstable, critical
from stickslip.stability.critical import neutral_along

_PER_DECADE = 16
_AGED_PER_DECADE = 6
"""Points at which growing modes are counted; for thresholds that age each count costs a hundred times as much."""
_NARROW = 1.01
"""A boundary is polished within a bracket of this factor."""


def together(parts: Sequence[tuple[Parameter, int]]) -> Parameter:
    """Return several parameters varied together, as one: by a factor, up (+1) or down (-1), from where they stand."""

    def varied(rig: Rig, factor: float) -> Rig:
        for parameter, side in parts:
            rig = parameter.set(rig, parameter.get(rig) * factor**side)
        return rig

    name = " and ".join(parameter.name for parameter, _ in parts)
    return Parameter(name=name, unit="1", get=lambda _rig: 1.0, set=varied)


def is_stable(setting: Rig) -> bool:
    """Whether smooth sliding is known to be stable (linear)."""
    try:
        return count_unstable(setting) == 0
    except (InputError, UndecidedError):
        return False


def stable_ranges(
    parameter: Parameter, setting: Rig, low: float, high: float, *, exact: bool = True
) -> list[tuple[float, float]]:
    """Ranges of a parameter in which smooth sliding is stable (linear), rising; cut off at the ends of the search.

    Parameters
    ----------
    parameter : Parameter
    setting : Rig
        In natural units.
    low, high : float
        Range searched. Ranges narrower than a sixteenth of a decade may be missed.
    exact : bool
        Whether to polish the limits; else they are right to 1 %, on the stable side.
    """
    density = _PER_DECADE if setting.interface.ageing is None else _AGED_PER_DECADE
    values = np.geomspace(low, high, 2 + math.ceil(density * math.log10(high / low))).tolist()
    values[0], values[-1] = low, high
    stable = _stable_at(parameter, setting, values)
    ends = [low] if stable[0] else []
    for (left, before), (right, after) in pairwise(zip(values, stable, strict=True)):
        if before != after:
            ends.append(_edge(parameter, setting, left, right, before, exact))
    ends += [high] if stable[-1] else []
    return list(zip(ends[::2], ends[1::2], strict=True))


def _stable_at(parameter: Parameter, setting: Rig, values: Sequence[float]) -> list[bool]:
    try:
        return [there.unstable() == 0 for there in neutral_along(parameter, setting, values)]
    except (InputError, UndecidedError):  # at one of them
        return [is_stable(parameter.set(setting, value)) for value in values]


def _edge(parameter: Parameter, setting: Rig, left: float, right: float, stable_left: bool, exact: bool) -> float:
    """Where stability changes between two values."""
    while right / left > _NARROW:
        middle = math.sqrt(left * right)
        if is_stable(parameter.set(setting, middle)) == stable_left:
            left = middle
        else:
            right = middle
    if not exact:
        return left if stable_left else right
    try:
        edges = critical(setting, parameter, between=(left, right)).edges
    except (InputError, UndecidedError):
        edges = ()
    return edges[0].value if edges else math.sqrt(left * right)
