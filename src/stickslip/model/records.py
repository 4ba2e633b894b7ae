"""What the numbers of a record may be and what they are measured in, said once, where the field is declared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from stickslip.errors import number, whole

Record = TypeVar("Record")


@dataclass(frozen=True)
class Number:
    """Bounds and unit of a number of a record, ``Annotated[float, Number("k", above=0)]``.

    Parameters
    ----------
    unit : str
        Natural unit, such as ``"x_s/time"``; ``"1"`` for a pure number.
    above, at_least, at_most : float, optional
        Open and closed bounds.
    infinite : bool
        Whether infinity is allowed.
    hint : str
        What the number means, for the message of an error.
    place : str
        What the message begins with, in place of the names of record and field.
    """

    unit: str = "1"
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    infinite: bool = False
    hint: str = ""
    place: str = ""


@lru_cache(maxsize=256)
def declared(record: type) -> Mapping[str, tuple[Any, Number | None]]:
    """Each field of a record, with its type and what is declared of its number; None if nothing is."""
    hints = get_type_hints(record, include_extras=True)
    found: dict[str, tuple[Any, Number | None]] = {}
    for field in fields(record):
        kind = hints[field.name]
        inner = get_args(kind)[0] if get_origin(kind) is tuple else kind
        marks = [mark for mark in getattr(inner, "__metadata__", ()) if isinstance(mark, Number)]
        found[field.name] = (get_args(kind)[0] if inner is kind and marks else kind, next(iter(marks), None))
    return found


def check(record: Any) -> None:
    """Check every number of a record on construction, and keep it as a Python number.

    Raises
    ------
    InputError
        If one is out of its bounds; the message names record and field.
    """
    record_type: Any = type(record)
    for name, (kind, mark) in declared(record_type).items():
        value = getattr(record, name)
        if mark is None or get_origin(kind) is tuple or (value is None and type(None) in get_args(kind)):
            continue
        place = mark.place or f"{type(record).__name__}.{name}"
        hint = mark.hint
        if isinstance(value, str) and value[:1].isdigit() and value[-1].isalpha() and not hint.startswith("in "):
            hint = f"{hint or 'in natural units'}; give SI to read_rig or Rig.replace"
        if kind is int:
            checked: float = whole(
                place, value, at_least=int(mark.at_least or 0), at_most=_whole_or_none(mark.at_most), hint=hint
            )
        else:
            checked = number(
                place,
                value,
                above=mark.above,
                at_least=mark.at_least,
                at_most=mark.at_most,
                infinite=mark.infinite,
                hint=hint,
            )
        object.__setattr__(record, name, checked)


def _whole_or_none(bound: float | None) -> int | None:
    return None if bound is None else int(bound)


def rescaled(record: Record, factor: Callable[[str], float]) -> Record:
    """Return a record with every number that has a unit multiplied by the factor of its unit."""

    def changed(value: Any, unit: str) -> Any:
        if isinstance(value, tuple):
            return tuple(changed(item, unit) for item in value)
        if is_dataclass(value):
            return rescaled(value, factor)
        return value * factor(unit) if isinstance(value, float) and unit != "1" else value

    record_type: Any = type(record)
    changes = {
        name: changed(getattr(record, name), mark.unit if mark else "1")
        for name, (_, mark) in declared(record_type).items()
    }
    return replace(record, **changes)  # type: ignore[type-var]
