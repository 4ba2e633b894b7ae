"""What the columns of a measured table are called: names, units, and which quantity
that makes them.
"""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple, Self

from stickslip.model.quantities import unit_size
from stickslip.words import PREFIXES

Quantity = Literal["force", "load", "coefficient", "time", "displacement", "other", ""]

_TABLES = tomllib.loads(Path(__file__).with_name("headings.toml").read_text("utf-8"))
_UNITS = {
    word: (kind, size)
    for kind, words in _TABLES["units"].items()
    for word, size in words.items()
}
_NAMED: dict[str, Quantity] = {
    name: quantity
    for quantity, names in _TABLES["names"].items()
    for name in names.split(", ")
}

_BRACKET = re.compile(r"(?P<name>.+?)\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]")
_TAIL = re.compile(r"(?P<name>.*?[^\W_])\s*(?:[/,_]|\s+in\b|\s)\s*(?P<unit>[^\s/,_]+)")


def unit_named(text: str) -> tuple[str, float] | None:
    """Kind of quantity and size in SI units of a unit that instruments write; None
    if it is not one of these.
    """
    plain = text.strip()
    if plain.lower() in _UNITS:
        return _UNITS[plain.lower()]
    prefix = plain[:-1]
    if plain[-1:] in ("V", "A") and prefix in ("", *PREFIXES):
        return "signal", float(f"1e{PREFIXES[prefix][1]}") if prefix else 1.0
    # Newton, MIN, but no "S"
    found = unit_size(plain) or (unit_size(plain.lower()) if len(plain) > 1 else None)
    if found is None or plain == "d":  # which names a displacement rather than days
        return None
    for kind, si in _TABLES["si"].items():
        if unit_size(si) == (1.0, found[1]):
            return kind, found[0]
    return None


def ratio(unit: str, of: str) -> float | None:
    """Size of a unit in another of the same kind; None if they are not known, or of
    two kinds.
    """
    one = unit_named(unit)
    other = unit_named(of)
    return one[1] / other[1] if one and other and one[0] == other[0] else None


def simple(name: str) -> str:
    """A name as it is compared: in small letters, with blanks for what parts words."""
    plain = (
        name.replace("\N{MICRO SIGN}", "mu")
        .replace("\N{GREEK SMALL LETTER MU}", "mu")
        .lower()
    )
    return " ".join(re.split(r"[\s_.\-:]+", plain)).strip()


class Heading(NamedTuple):
    """Name and unit of a column as the file has them; either may be empty."""

    name: str = ""
    unit: str = ""

    @classmethod
    def read(cls, cell: str) -> Self:
        """Take the head of a column apart: ``Force (N)``, ``Force [N]``,
        ``Force / N``, ``force_N``.
        """
        cell = cell.strip(' "\t')
        if bracket := _BRACKET.fullmatch(cell):
            return cls(**bracket.groupdict())
        tail = _TAIL.fullmatch(cell)
        # F_N is the normal force, and no force in N
        if tail and _NAMED.get(simple(cell)) != "load":
            unit = unit_named(tail["unit"])
            named = _NAMED.get(simple(tail["name"]), "")
            if unit and unit[0] in _TABLES["kinds"].get(named, ()):
                return cls(**tail.groupdict())
        return cls(cell)

    @property
    def quantity(self) -> Quantity:
        """What the column holds, by its name and, where that says nothing, by its
        unit; empty if neither tells.
        """
        kind = (unit_named(self.unit) or ("",))[0]
        named = _NAMED.get(simple(self.name), "")
        told: Quantity
        if kind in ("temperature", "frequency", "angle", "velocity"):
            told = "other"
        elif named in ("force", "coefficient"):
            told = _TABLES["of_friction"].get(kind, named)
        else:
            told = named or _TABLES["without_a_name"].get(kind, "")
        return told

    def __str__(self) -> str:
        return self.name + (f" ({self.unit})" if self.unit else "")


def headings_of(rows: Sequence[Sequence[str]], width: int) -> list[Heading]:
    """Names and units of so many columns, from lines above them; the last may hold
    the units of the names before.
    """
    names = rows[-1] if rows else [""] * width
    units = [""] * width
    cells = [cell.strip(' "[]()') for cell in names]
    filled = [cell for cell in cells if cell]
    known = [found[0] for cell in filled if (found := unit_named(cell))]
    least = 0.5 * len(filled) if len(rows) > 1 else len(filled)
    if {"force", "time", "length", "stress", "signal"} & {*known} and len(
        known
    ) >= least:
        names = rows[-2] if len(rows) > 1 else [""] * width
        units = cells
    return [
        Heading(each.name, unit or each.unit)
        for each, unit in zip(map(Heading.read, names), units, strict=True)
    ]


def with_coefficients(headings: Sequence[Heading]) -> list[Heading]:
    """Give a bare friction column the unit 1: without a unit where the others have
    theirs, it is a coefficient.
    """
    bare = (
        Heading("friction")
        if sum(bool(heading.unit) for heading in headings) >= 2
        else None
    )
    return [
        Heading(name, "1") if (simple(name), unit) == bare else Heading(name, unit)
        for name, unit in headings
    ]
