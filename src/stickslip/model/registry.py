"""Tables of records by the name that a rig file gives them; a class of the user's own enters by one decorator."""

from collections.abc import Callable
from dataclasses import is_dataclass
from functools import partial
from typing import TypeVar

from stickslip.errors import InputError, shown

Kind = TypeVar("Kind", bound=type)


def registry(what: str) -> tuple[dict[str, type], Callable[[str], Callable[[Kind], Kind]]]:
    """Return a table of frozen dataclasses by name, and the decorator that enters one; `what` it holds, in words.

    The decorator raises `InputError` if the class is none, or if another class has the name.
    """
    table: dict[str, type] = {}
    return table, lambda name: partial(_enter, table, f"{what} {shown(name)}", name)


def _enter(table: dict[str, type], place: str, name: str, kind: Kind) -> Kind:
    if not is_dataclass(kind) or not kind.__dataclass_params__.frozen:  # type: ignore[attr-defined]
        raise InputError(f"{place}: {kind.__name__} must be a frozen dataclass")
    known = table.setdefault(name, kind)
    # The same class once more is a notebook's cell run again.
    if (known.__module__, known.__qualname__) != (kind.__module__, kind.__qualname__):
        raise InputError(f"{place}: {known.__qualname__} has this name already; choose another one")
    table[name] = kind
    return kind
