"""One key of a rig file: what may stand there, and how it is read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any

from stickslip.errors import InputError, number, shown
from stickslip.io.validation import Sign, quantity_of
from stickslip.model.units import si_unit

DECADES = 15
"""Powers of ten of a pure number: beyond, squares and quotients of doubles overflow in the distributions."""


@dataclass(frozen=True)
class Key:
    """One key of a rig file.

    Parameters
    ----------
    meaning : str
        What it is, for the reference page.
    example : object
        A value as it stands in an SI file; its type is the type of the key, a mapping stands for a table.
    unit : str
        Natural unit of a quantity, ``"x_s/time"``; without one the value is a pure number, a text, a list.
    sign : str
        ``"above 0"``, ``"at least 0"`` or any.
    choices : tuple of str
        All that may be written, if that is known.
    words : tuple of str
        What may stand there in place of a number.
    or_table : bool
        Whether a table may, too.
    or_list : bool
        Whether a list may, too.
    default : object
        What is taken if the key is left out; None if nothing is.
    required : bool
        Whether it must be given.
    otherwise : str
        In words, what is taken if a key without a `default` is left out.
    measure : str
        For a property of the bench that has a default: how to measure it.
    longest : int
        Characters of a text.
    si : str
        For a quantity that no scale of the rig measures: its SI unit, in files of natural units, too.
    """

    meaning: str
    example: Any
    _: KW_ONLY
    unit: str = ""
    sign: Sign = ""
    choices: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    or_table: bool = False
    or_list: bool = False
    default: Any = None
    required: bool = False
    otherwise: str = ""
    measure: str = ""
    longest: int = 2_000
    si: str = ""

    @property
    def is_table(self) -> bool:
        """Whether its value is a table, or a list of tables."""
        return isinstance(self.example, Mapping) or (isinstance(self.example, list) and not self._of_numbers)

    @property
    def _of_numbers(self) -> bool:
        return isinstance(self.example, list) and all(isinstance(item, (int, float)) for item in self.example)

    def is_left(self, value: object) -> bool:
        """Whether a value is read elsewhere: a table, or a word in place of a number."""
        other = (Mapping,) * self.or_table + (list,) * self.or_list
        return self.is_table or value in self.words or isinstance(value, other)

    def read(self, value: object, place: str, *, natural: bool) -> Any:
        """Return the value: a quantity in SI units, or in natural ones if the file is in those.

        Raises
        ------
        InputError
            If it cannot be.
        """
        wrong = ""
        if self.si:
            try:
                return quantity_of(value, self.si, str(self.example), self.sign)
            except InputError as error:
                wrong = str(error)
        elif self.unit:
            try:
                return quantity_of(value, si_unit(self.unit), str(self.example), self.sign, natural=natural)
            except InputError as error:
                wrong = str(error)
        elif self.choices:
            if value in self.choices:
                return value
            known = [*map(repr, self.choices), *(["a table"] if self.or_table else [])]
            wrong = f"must be {' or '.join(known)}"
        elif isinstance(self.example, str):
            if isinstance(value, str) and len(value) <= self.longest:
                return value
            wrong = f"must be text in quotes, of at most {self.longest} characters"
        elif self._of_numbers:
            if isinstance(value, list):
                return tuple(_pure(item, f"{place}[{i}]", "") for i, item in enumerate(value))
            wrong = "must be a list of numbers"
        elif isinstance(self.example, bool):
            if isinstance(value, bool):
                return value
            wrong = "must be true or false"
        elif isinstance(self.example, int):
            if isinstance(value, int) and not isinstance(value, bool):
                return value
            wrong = "must be a whole number"
        else:
            return _pure(value, place, self.sign)
        raise InputError(f"{place} = {shown(value)}: {wrong}", place)


def _pure(value: object, place: str, sign: Sign) -> float:
    bounds: dict[Sign, dict[str, Any]] = {"above 0": {"above": 0}, "at least 0": {"at_least": 0}, "": {}}
    found = number(place, value, **bounds[sign])
    if found and not 10.0**-DECADES <= abs(found) <= 10.0**DECADES:
        raise InputError(f"{place} = {found:g}: must be 0, or within {DECADES} decades of 1", place)
    return found


def toml(value: Any) -> str:
    """A value as it stands in a file, in one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_bare(key)} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _bare(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key) else f'"{key}"'
