"""One key of a file: what may stand there, and how it is read; and rules on the keys of one table."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, Literal

from stickslip.errors import InputError, extreme, number, shown
from stickslip.model.quantities import read_quantity, unit_size
from stickslip.model.units import UNITS, si_unit

Sign = Literal["above 0", "at least 0", ""]

DECADES = 15
"""Powers of ten of a pure number: beyond, squares and quotients of doubles overflow in the distributions."""


@dataclass(frozen=True)
class Key:
    """One key of a file: its meaning for the reference page, and an example as it stands in an SI file.

    The type of the example is the type of the key: a mapping stands for a table, a list for a list of its first item.
    """

    meaning: str
    example: Any
    _: KW_ONLY
    unit: str = ""  # natural unit of a quantity; without one the value is a pure number, a text, a list
    si: str = ""  # SI unit of a quantity that no scale of the rig measures, in files of natural units, too
    sign: Sign = ""
    choices: tuple[str, ...] = ()  # all that may be written, if that is known
    words: tuple[str, ...] = ()  # what may stand there in place of a number
    or_table: bool = False
    or_list: bool = False
    default: Any = None
    required: bool = False
    otherwise: str = ""  # in words, what is taken if a key without a default is left out
    measure: str = ""  # how to measure a property of the bench that has a default
    longest: int = 2_000  # characters of a text

    @property
    def is_table(self) -> bool:
        """Whether its value is a table, or a list of tables."""
        return isinstance(self.example[0] if isinstance(self.example, list) else self.example, Mapping)

    def is_left(self, value: object) -> bool:
        """Whether a value is read elsewhere: a table, or a word in place of a number."""
        other = (Mapping,) * self.or_table + (list,) * self.or_list
        return self.is_table or value in self.words or isinstance(value, other)

    def read(self, value: object, place: str, *, natural: bool) -> Any:
        """Return the value: a quantity in SI units, or in natural ones if the file is in those.

        Raises `InputError` if it cannot be.
        """
        if isinstance(self.example, list) and isinstance(value, list):
            one = replace(self, example=self.example[0])
            return tuple(one.read(item, f"{place}[{i}]", natural=natural) for i, item in enumerate(value))
        if (self.unit or self.si) and not isinstance(self.example, list):
            try:
                unit = self.si or si_unit(self.unit)
                return quantity_of(value, unit, str(self.example), self.sign, natural=natural and not self.si)
            except InputError as error:
                raise InputError(f"{place} = {shown(value)}: {error}", place) from None
        if isinstance(self.example, float):
            return _pure(value, place, self.sign)
        if self.choices:
            fits, wrong = value in self.choices, " or ".join([*map(repr, self.choices), *["a table"] * self.or_table])
        else:
            fits = type(value) is type(self.example) and not (isinstance(value, str) and len(value) > self.longest)
            wrong = {
                str: f"text in quotes, of at most {self.longest} characters",
                bool: "true or false",
                int: "a whole number",
            }.get(type(self.example), f"a list, such as {toml(self.example)}")
        if not fits:
            raise InputError(f"{place} = {shown(value)}: must be {wrong}", place)
        return value


def quantity(meaning: str, example: str, sign: Sign = "above 0", **rest: Any) -> Key:
    """The key of a quantity that is no field of a record; the example says in which unit it is measured."""
    measured = _exponents(example.partition(" ")[2])
    unit = next(unit for unit, (*_, si) in UNITS.items() if _exponents(si) == measured)
    return Key(meaning, example, unit=unit, sign=sign, **rest)


def _exponents(unit: str) -> dict[str, int]:
    size = unit_size(unit)
    return size[1] if size else {"": 1}


def quantity_of(value: object, unit: str, example: str, sign: Sign = "above 0", *, natural: bool = False) -> float:
    """Read a quantity: text with a unit in SI files, a plain number in natural ones; errors do not name the place."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if not natural:
            raise InputError(f"has no unit; write it as a string, such as {example!r}")
        result = float(value) if abs(value) <= sys.float_info.max else math.inf
    elif not isinstance(value, str):
        raise InputError(f"must be a quantity, such as {example!r}")
    elif natural:
        raise InputError("must be a plain number, as the file says units = 'natural'")
    else:
        result = read_quantity(value, unit, example)
    if not math.isfinite(result):
        raise InputError("must be finite")
    if refusal := extreme(result):
        raise InputError(f"{refusal} (in {unit})")
    if (sign == "above 0" and result <= 0) or (sign == "at least 0" and result < 0):
        raise InputError(f"must be {sign}")
    return result


def _pure(value: object, place: str, sign: Sign) -> float:
    bounds: dict[Sign, dict[str, Any]] = {"above 0": {"above": 0}, "at least 0": {"at_least": 0}, "": {}}
    found = number(place, value, **bounds[sign])
    if found and not 10.0**-DECADES <= abs(found) <= 10.0**DECADES:
        raise InputError(f"{place} = {found:g}: must be 0, or within {DECADES} decades of 1", place)
    return found


Way = tuple[str, ...]


@dataclass(frozen=True)
class Either:
    """Keys of a table that exclude each other: one way is taken, with all of its keys."""

    ways: tuple[Way, ...]  # the first is asked for where none is given
    _: KW_ONLY
    needed: bool = True
    natural: int = 0  # which way is asked for in a file of natural units
    because: str = ""  # why not both, if that is not plain

    def given(self, content: Mapping[str, Any]) -> list[Way]:
        """The ways of which a table has some key."""
        return [way for way in self.ways if any(name in content for name in way)]

    def others(self, name: str) -> str:
        """What is given in place of a key, in words; empty if the rule does not know it."""
        if not any(name in way for way in self.ways):
            return ""
        return " or ".join(listed(f"`{each}`" for each in way) for way in self.ways if name not in way)

    @property
    def clash(self) -> str:
        """The refusal of two ways at once."""
        return f"give {' or '.join(map(listed, self.ways))}, not both{self.because and f': {self.because}'}"


def listed(names: Any) -> str:
    """Names in a row: ``a, b and c``."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else str(last)


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
