"""Tables of records by the name that a rig file gives them; a class of the user's own enters by one decorator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import is_dataclass
from typing import TypeVar

from stickslip.errors import InputError, shown

Kind = TypeVar("Kind", bound=type)


def registrar(table: dict[str, type], what: str) -> Callable[[str], Callable[[Kind], Kind]]:
    """Return the decorator that enters a class into `table` by name.

    Parameters
    ----------
    table : dict of str to type
        Names, as a rig file has them, and the frozen dataclasses they stand for.
    what : str
        What the table holds, for messages: ``"distribution"``.

    Raises
    ------
    InputError
        By the decorator: if the class is no frozen dataclass, or another class has the name.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> table = {}
    >>> @registrar(table, "shape")("round")
    ... @dataclass(frozen=True)
    ... class Round:
    ...     radius: float
    >>> table["round"](2.0)
    Round(radius=2.0)
    """

    def register(name: str) -> Callable[[Kind], Kind]:
        def enter(kind: Kind) -> Kind:
            if not is_dataclass(kind) or not kind.__dataclass_params__.frozen:  # type: ignore[attr-defined]
                raise InputError(f"{what} {shown(name)}: {kind.__name__} must be a frozen dataclass")
            known = table.get(name)
            # The same class once more is a notebook's cell run again.
            if known is not None and (known.__module__, known.__qualname__) != (kind.__module__, kind.__qualname__):
                raise InputError(
                    f"{what} {shown(name)}: {known.__qualname__} has this name already; choose another one"
                )
            table[name] = kind
            return kind

        return enter

    return register
