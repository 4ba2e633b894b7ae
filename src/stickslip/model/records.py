"""Records: bounds and units of their numbers, declared once with each field; tables of
records.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache, partial
from numbers import Real
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from stickslip.answers import card, table
from stickslip.errors import (
    InputError,
    instance,
    number,
    refused,
    sequence,
    shown,
    whole,
)

AnyRecord = TypeVar("AnyRecord")
Kind = TypeVar("Kind", bound=type)
Change = Callable[[float, str], float]
"""A function of a value and its natural unit that gives another value."""


class Record:
    """A frozen dataclass whose fields are checked on construction against their
    declarations.
    """

    def __post_init__(self) -> None:
        """Check the fields."""
        check(self)

    def _repr_html_(self) -> str:
        """A card for a notebook: each field that is given, with its natural unit."""
        record_type: Any = type(self)
        rows = list[tuple[str, str]]()
        for name, (_, mark) in declared(record_type).items():
            value = getattr(self, name)
            unit = getattr(mark, "unit", "1")
            words = f"{value:.4g}" if isinstance(value, float) else str(value)
            if value is not None:
                rows.append((name, words if unit == "1" else f"{words} {unit}"))
        return card(f"{record_type.__name__}, in natural units", table(rows))


@dataclass(frozen=True)
class Number:
    """Bounds and natural unit of a number of a record,
    ``Annotated[float, Number("k", above=0)]``.

    An error names `place` instead of record and field, and explains the number by
    `hint`.
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
    """A record within a record, ``Annotated[Delay, Part("a delay, such as
    Delay(0.2)")]``; `place` as in `Number`.
    """

    hint: str
    place: str = ""


@lru_cache(maxsize=256)
def declared(record: type) -> Mapping[str, tuple[Any, Number | Part | None]]:
    """Return each field of a record with its type, and the `Number` or `Part` declared
    for it or for the numbers in it; None if there is no such declaration.
    """
    hints = get_type_hints(record, include_extras=True)
    found = {}
    for field in fields(record):
        kind = hints[field.name]
        bare = kind.__origin__ if hasattr(kind, "__metadata__") else kind
        found[field.name] = bare, next(_marks(kind), None)
    return found


def _marks(kind: Any) -> Iterator[Number | Part]:
    """Yield the declarations in a type, or in the items of a tuple or a union."""
    yield from (
        mark
        for mark in getattr(kind, "__metadata__", ())
        if isinstance(mark, Number | Part)
    )
    for inner in get_args(kind):
        yield from _marks(inner)


def check(record: Any) -> None:
    """Check every number, choice and part of a record, and convert numbers to Python
    numbers.
    """
    record_type: Any = type(record)
    for name, (kind, mark) in declared(record_type).items():
        value = getattr(record, name)
        place = getattr(mark, "place", "") or f"{record_type.__name__}.{name}"
        if value is None and type(None) in get_args(kind):
            continue
        if isinstance(mark, Part):
            instance(place, value, kind, mark.hint)
        elif mark is not None:
            object.__setattr__(record, name, _numbers(kind, place, value, mark))
        else:
            object.__setattr__(record, name, _plain(kind, place, value))


_WORDS: dict[Any, str] = {
    bool: "True or False",
    str: "a text",
    Mapping: "a table of values by their names",
}
"""Kinds of fields that are neither numbers nor records, in words."""


def _plain(kind: Any, place: str, value: Any) -> Any:
    """A text, a truth value, one of several choices, a table, or a tuple, as the field
    is declared; of other kinds, whatever is given.
    """
    origin = get_origin(kind) or kind
    if choices := choices_of(kind):
        if not isinstance(value, str) or value not in choices:
            raise refused(place, value, f"must be {' or '.join(map(repr, choices))}")
    elif origin in _WORDS:
        instance(place, value, origin, _WORDS[origin])
    elif origin is tuple:
        return sequence(place, value, "a list or a tuple")
    return value


def _numbers(
    kind: Any,
    place: str,
    value: object,
    mark: Number,
) -> Any:
    """Return a number within the declared bounds, a tuple of such numbers where several
    are allowed, or a matrix by its rows.
    """
    has_tuple = any(get_origin(each) is tuple for each in (kind, *get_args(kind)))
    may_be_one = get_origin(kind) is not tuple and float in get_args(kind)
    if not has_tuple or (may_be_one and isinstance(value, Real)):
        return _number(kind, place, value, mark)
    items = enumerate(sequence(place, value, mark.hint))
    row = get_args(kind)[0]
    if get_origin(row) is tuple and get_origin(kind) is tuple:  # a matrix
        return tuple(_numbers(row, f"{place}[{i}]", item, mark) for i, item in items)
    return tuple(_number(float, f"{place}[{i}]", item, mark) for i, item in items)


def _number(
    kind: Any,
    place: str,
    value: object,
    mark: Number,
) -> float:
    """Return a number within the declared bounds."""
    hint = mark.hint
    if (
        isinstance(value, str)
        and value[:1].isdigit()
        and value[-1].isalpha()
        and not hint.startswith("in ")
    ):
        hint = f"{hint or 'in natural units'}; give SI to read_rig or Rig.replace"
    if kind is int:
        return whole(
            place,
            value,
            at_least=mark.at_least or 0,
            at_most=mark.at_most,
            hint=hint,
        )
    return number(
        place,
        value,
        above=mark.above,
        at_least=mark.at_least,
        at_most=mark.at_most,
        infinite=mark.infinite,
        hint=hint,
    )


@lru_cache(maxsize=256)
def choices_of(kind: Any) -> tuple[str, ...]:
    """Return all values that a field may have, if its type lists them."""
    return next(
        (
            get_args(each)
            for each in (kind, *get_args(kind))
            if get_origin(each) is Literal
        ),
        (),
    )


def converted(record: AnyRecord, change: Change) -> AnyRecord:
    """Return a record with every number that has a unit changed, also in the records
    within it.
    """

    def changed(value: Any, unit: str) -> Any:
        if isinstance(value, tuple):
            return tuple(changed(item, unit) for item in value)
        if is_dataclass(value):
            return converted(value, change)
        return (
            change(value, unit) if isinstance(value, float) and unit != "1" else value
        )

    record_type: Any = type(record)
    changes = {
        name: changed(getattr(record, name), getattr(mark, "unit", "1"))
        for name, (_, mark) in declared(record_type).items()
    }
    return replace(record, **changes)  # type: ignore[type-var]


def hashable(record: object) -> Any:
    """Return a record, checked to be hashable so that it can be the key of a table."""
    try:
        hash(record)
    except TypeError as error:
        raise InputError(
            f"{record!r}: a distribution must be hashable; make it a frozen dataclass"
        ) from error
    return record


def registry(
    noun: str,
) -> tuple[dict[str, type], Callable[[str], Callable[[Kind], Kind]]]:
    """Return an empty table of frozen dataclasses by name, and the decorator that
    enters one; `noun` is the word for them in messages.

    The decorator raises `InputError` if the class is not a frozen dataclass, or another
    class has the name.
    """
    known: dict[str, type] = {}
    return known, lambda name: partial(_enter, known, f"{noun} {shown(name)}", name)


def _enter(
    table: dict[str, type],
    place: str,
    name: str,
    kind: Kind,
) -> Kind:
    if not is_dataclass(kind) or not kind.__dataclass_params__.frozen:  # type: ignore[attr-defined]
        raise InputError(f"{place}: {kind.__name__} must be a frozen dataclass")
    known = table.setdefault(name, kind)
    # The same class comes again where a notebook's cell is run again.
    if (known.__module__, known.__qualname__) != (kind.__module__, kind.__qualname__):
        raise InputError(
            f"{place}: {known.__qualname__} has this name already; choose another one"
        )
    table[name] = kind
    return kind
