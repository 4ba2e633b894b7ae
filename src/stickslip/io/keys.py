"""Keys of a file: which values they may have, how these are read, and which keys of a
table exclude each other.
"""

import json
import math
import re
import sys
from collections.abc import Collection, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, Literal

from stickslip.errors import InputError, extreme, shown
from stickslip.model.quantities import read_quantity, unit_size
from stickslip.model.units import UNITS, si_unit

Sign = Literal["above 0", "at least 0", ""]

LONGEST_TEXT = 2_000  # most characters of a text
# A pure number lies within this many decades of 1: beyond, squares and quotients
# overflow in the distributions.
DECADES = 15


@dataclass(frozen=True)
class Key:
    """One key of a file, defined by an example as an SI file would write it.

    The type of the example is the type of the key: a mapping stands for a table, a list
    for a list of items like its first.
    """

    example: Any
    _: KW_ONLY
    # natural unit of a quantity; empty for a pure number, a text, or a list
    unit: str = ""
    # SI unit of a quantity that is not in the natural units of the rig, also in files
    # of natural units
    si: str = ""
    sign: Sign = ""
    choices: Collection[str] = ()  # all possible values, if they are known
    # other possible values: "table", "list", or words in place of a number
    also: Collection[str] = ()
    default: Any = None
    required: bool = False
    measure: str = ""  # how to measure the property, if it has a default

    @property
    def is_table(self) -> bool:
        """Whether its value is a table, or a list of tables."""
        return isinstance(
            self.example[0] if isinstance(self.example, list) else self.example,
            Mapping,
        )

    def is_left(self, value: object) -> bool:
        """Return whether a value is to be read elsewhere, as a table, or a word in
        place of a number.
        """
        types = {"table": Mapping, "list": list, "text": str}
        return (
            self.is_table
            or value in self.also
            or any(isinstance(value, types.get(each, ())) for each in self.also)
        )

    def read(self, value: object, place: str, *, natural: bool) -> Any:
        """Return the value read: a quantity in SI units, or in natural units if the
        file is in those.

        Raises `InputError` if the key cannot have this value.
        """
        if isinstance(self.example, list) and isinstance(value, list):
            one = replace(self, example=self.example[0])
            return tuple(
                one.read(item, f"{place}[{i}]", natural=natural)
                for i, item in enumerate(value)
            )
        try:
            return self._value(value, natural)
        except InputError as error:
            raise InputError(f"{place} = {shown(value)}: {error}", place) from None

    def _value(self, value: Any, natural: bool) -> Any:
        """Return the value read; errors do not name the place."""
        kind = type(self.example)
        if kind is float or ((self.unit or self.si) and kind is not list):
            unit = self.si
            if self.unit and not natural:
                unit = si_unit(self.unit)
            return self._number(value, unit)
        if self.choices:
            known = value in [*self.choices]
        else:
            too_long = isinstance(value, str) and len(value) > LONGEST_TEXT
            known = type(value) is kind and not too_long
        if not known:
            wanted = {
                str: f"text in quotes, of at most {LONGEST_TEXT} characters",
                bool: "true or false",
                int: "a whole number",
                list: f"a list, such as {toml(self.example)}",
            }[kind]
            choices = [*map(repr, self.choices)] or [wanted]
            others = [f"a {other}" for other in self.also]
            raise InputError(f"must be {' or '.join(choices + others)}")
        return value

    def _number(self, value: Any, unit: str) -> float:
        """Read a text with a unit or, if the key has none, a plain number."""
        if unit and isinstance(value, str):
            result = read_quantity(value, unit, self.example)
        elif isinstance(value, bool) or not isinstance(value, (int, float)):
            wanted = (
                f"quantity, such as {self.example!r}"
                if unit
                else "plain number"
                if self.unit
                else "number"
            )
            raise InputError(f"must be a {wanted}")
        elif unit:
            raise InputError(
                f"has no unit; write it as a string, such as {self.example!r}"
            )
        else:
            result = float(value) if abs(value) <= sys.float_info.max else math.inf
        if not math.isfinite(result):
            raise InputError("must be finite")
        if (self.sign and result < 0) or (self.sign == "above 0" and result == 0):
            raise InputError(f"must be {self.sign}")
        if refusal := extreme(result):
            raise InputError(refusal + (f" (in {unit})" if unit else ""))
        if result and not (
            self.unit or self.si or 10.0**-DECADES <= abs(result) <= 10.0**DECADES
        ):
            raise InputError(f"must be 0, or within {DECADES} decades of 1")
        return result


def natural_unit_of(example: str) -> str:
    """Return the natural unit of a quantity; empty if the text is no quantity, or has
    no natural unit.
    """
    measured = unit_size(example.partition(" ")[2])
    sizes = ((unit, unit_size(si)) for unit, si in UNITS.items())
    return next(
        (unit for unit, size in sizes if size and measured and size[1] == measured[1]),
        "",
    )


Keys = Mapping[str, Key]
"""The keys of a table, by name."""


class Either:
    """Keys of a table that exclude each other: a table has all keys of one alternative,
    which are separated by blanks, and none of another.

    If no alternative is given, but `needed`, the first is asked for.
    """

    def __init__(self, *alternatives: str, needed: bool = False) -> None:
        self.alternatives = [alternative.split() for alternative in alternatives]
        self.names = " ".join(alternatives).split()
        self.needed = needed


def toml(value: Any) -> str:
    """Return a value as TOML, in one line."""
    if isinstance(value, Mapping):
        bare = re.compile(r"[\w-]+").fullmatch
        each = (
            f"{key if bare(key) else toml(key)} = {toml(item)}"
            for key, item in value.items()
        )
        return f"{{ {', '.join(each)} }}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(toml, value))}]"
    try:
        return json.dumps(value, ensure_ascii=False, default=str)
    except ValueError:  # an integer of more digits than Python writes
        return shown(value)
