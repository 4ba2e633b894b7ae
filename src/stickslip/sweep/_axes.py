"""The axes of a sweep of a rig, as they are written in a file or in Python, and what becomes of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, shown, together, whole
from stickslip.io.keys import Key
from stickslip.io.tables import unknown
from stickslip.model import Rig
from stickslip.model.parameters import BY_NAME
from stickslip.sweep._dataset import array
from stickslip.sweep._refine import Span
from stickslip.sweep._run import check_size
from stickslip.sweep.study import FROM_REST, FROM_SLIDING
from stickslip.words import engineering

OTHERS = {
    "contacts": "number of contacts",
    "seed": "seed of the contacts",
    "start": "start of the run",
}
"""What can be an axis besides the parameters of a rig."""
_START = Key(FROM_SLIDING, choices=(FROM_REST, FROM_SLIDING))
_SPACING = Key("linear", choices=("linear", "log"))


class Axis(NamedTuple):
    """An axis: its values, of which an open one has the two ends alone, and whether equal ratios are equal steps."""

    values: NDArray[Any]
    log: bool
    kind: Literal["listed", "counted", "open"]


@dataclass(frozen=True, kw_only=True)
class AxisReader:
    """Reads the axes of a rig, of so many values at most; from Python, plain numbers are in SI units, too."""

    rig: Rig
    most: int
    from_python: bool

    def axis(self, name: str, given: Any) -> Axis:
        """Read a list of values, ``{from, to, count, spacing}``, or a `Span`."""
        place = f"axes.{name}"
        if isinstance(given, Span):
            given = {"from": given.low, "to": given.high, "spacing": "log" if given.log else "linear"}
        if isinstance(given, Mapping):
            return self._between(name, given, place)
        listed = np.atleast_1d(given).tolist() if self.from_python else given
        if not isinstance(listed, list) or not listed:
            raise InputError(
                f"{place} = {shown(given)}: must be a list of values, at least one, or a table with from, to and count"
            )
        values = [self._value(name, value, f"{place}.{i}") for i, value in enumerate(listed)]
        if len(set(values)) < len(values):
            raise InputError(f"{place}: holds a value twice; for replicas add an axis seed = {{ count = 10 }}")
        return Axis(array(values), _of_equal_ratios(values), "listed")

    def quantity(self, key: Key, value: Any, place: str) -> Any:
        """Read a value in the rig's own units."""
        natural = self.rig.scales is None or (self.from_python and not isinstance(value, str))
        return key.read(value, place, natural=natural)

    def _between(self, name: str, given: Mapping[str, Any], place: str) -> Axis:
        check_keys(given, ("from", "to", "count", "spacing"), place)
        for key in ("count",) if name == "seed" else ("from", "to"):
            if key not in given:
                raise InputError(f"{place}.{key}: is missing")
        count = whole(f"{place}.count", given.get("count", 2), at_least=1 if name == "seed" else 2)
        check_size(count, self.most)
        low, high = (self._value(name, given.get(key, 1), f"{place}.{key}") for key in ("from", "to"))
        if name == "seed":
            return Axis(np.arange(low, low + count), False, "counted")
        if isinstance(low, str) or high <= low:
            raise InputError(f"{place}: to = {given['to']} must be above from = {given['from']}")
        log = _SPACING.read(given.get("spacing", "linear"), f"{place}.spacing", natural=True) == "log"
        if log and low <= 0:
            raise InputError(f"{place}: from = {given['from']} must be above 0 for spacing = 'log'")
        values = (np.geomspace if log else np.linspace)(low, high, count)
        if name == "contacts":
            values = np.unique(np.rint(values).astype(int))
        return Axis(values, log, "counted" if "count" in given else "open")

    def _value(self, name: str, value: Any, place: str) -> Any:
        if name == "start":
            return _START.read(value, place, natural=True)
        if name in OTHERS:
            return whole(place, value, at_least=1 if name == "contacts" else 0, at_most=2**53 - 1)
        parameter, rig = BY_NAME[name], self.rig
        key = Key(1.0)
        if parameter.unit != "1":
            unit = rig.unit_name(parameter.unit)
            key = Key(f"1 {unit}", unit=parameter.unit, sign="at least 0" if parameter.zero else "above 0")
            with suppress(InputError):  # the rig has none: the plan will say so
                key = replace(key, example=engineering(rig.value(name), unit, 3))
        return self.quantity(key, value, place)


def check_axes(content: object) -> None:
    """Refuse what is no table of axes: parameters, those registered since then included, and `OTHERS`."""
    check_keys(content, (*BY_NAME, *OTHERS), "axes")
    if not content:
        raise InputError(f"axes: must hold at least one of {', '.join((*BY_NAME, *OTHERS))}")


def check_keys(content: object, known: Iterable[str], place: str) -> None:
    """Refuse what is no table, and all keys of a table that are unknown."""
    known = tuple(known)
    if not isinstance(content, Mapping):
        raise InputError(f"{place} = {shown(content)}: must be a table, as in [{place}]")
    path = f"{place}." if place else ""
    if strange := [str(key) for key in content if key not in known]:
        raise InputError(together(f"{path}{key[:60]}: unknown key; {unknown(key, known)}" for key in strange))


def _of_equal_ratios(values: Sequence[Any]) -> bool:
    """Whether a list of values suggests a logarithmic axis."""
    if len(values) < 3 or isinstance(values[0], str) or min(values) <= 0:
        return False
    steps, ratios = np.diff(np.sort(values)), np.diff(np.log(np.sort(values)))
    return bool(np.ptp(ratios) / ratios.mean() < np.ptp(steps) / steps.mean())
