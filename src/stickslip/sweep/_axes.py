"""The axes of a sweep of a rig, as they are written in a file or in Python, and what becomes of them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, number, shown, together, whole
from stickslip.io.keys import quantity_of
from stickslip.model import Rig
from stickslip.model.parameters import BY_NAME
from stickslip.sweep._refine import Span
from stickslip.sweep.study import FROM_REST, FROM_SLIDING
from stickslip.words import engineering

OTHERS = {
    "contacts": "number of contacts",
    "seed": "seed of the contacts",
    "start": "start of the run",
}
"""What can be an axis besides the parameters of a rig."""
SPACINGS = ("linear", "log")
_KEYS = ("from", "to", "count", "spacing")


def known_axes() -> tuple[str, ...]:
    """Every word that can be an axis, parameters registered since then included."""
    return (*BY_NAME, *OTHERS)


@dataclass(frozen=True, kw_only=True)
class Axis:
    """An axis as it is given: its values, or its ends and how many values are between."""

    values: tuple[Any, ...]
    count: int | None = None
    ends: bool = False
    log: bool = False

    @property
    def size(self) -> int:
        """Number of values, before they are made."""
        return (self.count or 1) if self.ends else len(self.values)

    def made(self, name: str) -> NDArray[Any]:
        """All values."""
        if not self.ends:
            return np.array(self.values, dtype=object if isinstance(self.values[0], str) else None)
        if self.count is None or self.count < 2:
            raise InputError(
                f"axes.{name}: needs a count of at least 2, the number of values from one end to the other"
            )
        low, high = self.values
        values = (np.geomspace if self.log else np.linspace)(low, high, self.count)
        return np.unique(np.rint(values).astype(int)) if name == "contacts" else values


def read_axis(rig: Rig, name: str, given: Any, *, bare: bool = False) -> Axis:
    """Read an axis: a list of values, ``{from, to, count, spacing}``, or a `Span`."""
    place = f"axes.{name}"
    if isinstance(given, Span):
        given = {"from": given.low, "to": given.high, "spacing": SPACINGS[given.log]}
    if isinstance(given, Mapping):
        check_keys(given, _KEYS, place)
        return _between(rig, name, given, bare)
    listed = np.atleast_1d(given).tolist() if bare else given
    if not isinstance(listed, list):
        raise InputError(f"{place} = {shown(given)}: must be a list of values, or a table with from, to and count")
    values = tuple(read_value(rig, name, value, f"{place}.{i}", bare=bare) for i, value in enumerate(listed))
    if not values:
        raise InputError(f"{place}: holds no value")
    if len(set(values)) < len(values):
        raise InputError(f"{place}: holds a value twice; for replicas add an axis seed = {{ count = 10 }}")
    return Axis(values=values, log=_of_equal_ratios(values))


def _between(rig: Rig, name: str, given: Mapping[str, Any], bare: bool) -> Axis:
    """Read an axis that is given by its ends."""
    place = f"axes.{name}"
    count = whole(f"{place}.count", given["count"], at_least=1) if "count" in given else None
    if name == "seed" and count is not None:
        first = read_value(rig, name, given.get("from", 1), f"{place}.from", bare=bare)
        return Axis(values=tuple(range(int(first), int(first) + count)))
    for key in ("count",) if name == "seed" else ("from", "to"):
        if key not in given:
            raise InputError(f"{place}.{key}: is missing")
    spacing = chosen(f"{place}.spacing", given.get("spacing", "linear"), SPACINGS)
    low, high = (read_value(rig, name, given[key], f"{place}.{key}", bare=bare) for key in ("from", "to"))
    if isinstance(low, str) or high <= low:
        raise InputError(f"{place}: to = {high:g} must be above from = {low:g}")
    if spacing == "log" and low <= 0:
        raise InputError(f"{place}: from = {low:g} must be above 0 for spacing = 'log'")
    return Axis(values=(low, high), count=count, ends=True, log=spacing == "log")


def read_value(rig: Rig, name: str, value: Any, place: str, *, bare: bool) -> Any:
    """Read one value of an axis, in the rig's own units."""
    if name == "start":
        return chosen(place, value, (FROM_REST, FROM_SLIDING))
    if name in OTHERS:
        return whole(place, value, at_least=1 if name == "contacts" else 0, at_most=2**53 - 1)
    if BY_NAME[name].unit == "1":
        return number(place, value)
    sign = "at least 0" if BY_NAME[name].zero else "above 0"
    unit = rig.unit_name(BY_NAME[name].unit)
    try:
        example = engineering(rig.value(name), unit, 3)
    except InputError:  # the rig has none: the plan will say so
        example = f"1 {unit}"
    return read_quantity(rig, value, place, unit, example, sign, bare=bare)


def read_quantity(
    rig: Rig, value: Any, place: str, unit: str, example: str, sign: Any = "above 0", *, bare: bool = False
) -> float:
    """Read a quantity of a rig: in SI units a text, or from Python a number; in natural units a number."""
    natural = rig.scales is None or (bare and not isinstance(value, str))
    try:
        return quantity_of(value, unit, example, sign, natural=natural)
    except InputError as error:
        raise InputError(f"{place} = {shown(value)}: {error}") from None


def chosen(place: str, value: object, words: Sequence[str]) -> str:
    """Refuse what is none of some words."""
    if value not in words:
        *first, last = map(repr, words)
        raise InputError(f"{place} = {shown(value)}: must be {', '.join(first)} or {last}")
    return str(value)


def check_keys(content: object, known: Iterable[str], place: str) -> None:
    """Refuse what is no table, and all keys of a table that are unknown."""
    known = list(known)
    if not isinstance(content, Mapping):
        raise InputError(f"{place} = {shown(content)}: must be a table, as in [{place}]")
    path, mistakes = f"{place}." if place else "", []
    for key in content:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, n=1, cutoff=0.5)
            remedy = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"
            mistakes.append(f"{path}{str(key)[:60]}: unknown key; {remedy}")
    if mistakes:
        raise InputError(together(mistakes))


def _of_equal_ratios(values: Sequence[Any]) -> bool:
    """Whether a list of values suggests a logarithmic axis."""
    if len(values) < 3 or isinstance(values[0], str) or min(values) <= 0:
        return False
    steps, ratios = np.diff(np.sort(values)), np.diff(np.log(np.sort(values)))
    return bool(np.ptp(ratios) / ratios.mean() < np.ptp(steps) / steps.mean())
