"""What the numbers of a record may be and what they are measured in, said once, where the field is declared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from stickslip.errors import InputError, instance, number, shown, whole

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


@dataclass(frozen=True)
class Part:
    """A record within a record, ``Annotated[Delay, Part("a delay, such as Delay(0.2)")]``; `place` as above."""

    hint: str
    place: str = ""


@lru_cache(maxsize=256)
def _parts(record: type) -> list[tuple[str, Any, Part]]:
    """The fields of a record that hold others, each with what it may be, as a type and in words."""
    hints = get_type_hints(record, include_extras=True)
    return [
        (field.name, get_args(hints[field.name])[0], mark)
        for field in fields(record)
        for mark in getattr(hints[field.name], "__metadata__", ())
        if isinstance(mark, Part)
    ]


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
    """Check every number, choice and part of a record on construction, and keep numbers as Python numbers.

    Raises
    ------
    InputError
        If one is out of its bounds; the message names record and field.
    """
    record_type: Any = type(record)
    for name, kind, part in _parts(record_type):
        instance(part.place or f"{record_type.__name__}.{name}", getattr(record, name), kind, part.hint)
    for name, (kind, mark) in declared(record_type).items():
        value, place = getattr(record, name), f"{type(record).__name__}.{name}"
        optional = value is None and type(None) in get_args(kind)
        if choices := _choices(kind):
            if not optional and value not in choices:
                raise InputError(f"{place} = {shown(value)}: must be {' or '.join(map(repr, choices))}", place)
        elif kind is bool and not isinstance(value, bool):
            raise InputError(f"{place} = {shown(value)}: must be True or False", place)
        if mark is None or optional or get_origin(kind) is tuple:
            continue
        place = mark.place or place
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


def _choices(kind: Any) -> tuple[str, ...]:
    """All that a field may be, if its type says so."""
    return next((get_args(each) for each in (kind, *get_args(kind)) if get_origin(each) is Literal), ())


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
