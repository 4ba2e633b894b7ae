"""Headings of the columns of a measured table: names, units, and quantities."""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple, Self

from stickslip.model.quantities import unit_size
from stickslip.words import PREFIXES

Quantity = Literal[
    "force",
    "load",
    "coefficient",
    "time",
    "displacement",
    "velocity",
    "part",
    "other",
    "",
]

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
WEIGHTS: dict[str, str] = _TABLES["weights"]
_MOST_ROWS = 3  # lines above a table that may name its columns
_MOST_WORDS = max(name.count(" ") for name in _NAMED) + 1
_LABELS = frozenset(_TABLES["labels"]["rows"].split(", "))
_TORQUES = frozenset(_TABLES["labels"]["torques"].split(", "))
_TIMES = " *·.-"  # between the units of a product: N m, N·m, ft-lb

_BRACKET = re.compile(r"(?P<name>.+?)\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]")
_TAIL = re.compile(r"(?P<name>.*?[^\W_])\s*(?:[/,_]|\s+in\b|\s)\s*(?P<unit>[^\s/,_]+)")


def unit_named(text: str) -> tuple[str, float] | None:
    """Return the kind of quantity of a unit and its size in SI units; None if the unit
    is not known.
    """
    plain = text.strip()
    # Nm is not nm, but Newton and MIN mean the same in lower case: try that last
    return (
        _simple_unit(plain)
        or _torque(plain)
        or (_simple_unit(plain.lower()) if len(plain) > 1 else None)
    )


def _simple_unit(plain: str) -> tuple[str, float] | None:
    """Return kind and size of a unit that is not a product, in the case given."""
    if plain.lower() in _UNITS:
        return _UNITS[plain.lower()]
    prefix = plain[:-1]
    if plain[-1:] in ("V", "A") and prefix in ("", *PREFIXES):
        return "signal", float(f"1e{PREFIXES[prefix][1]}") if prefix else 1.0
    found = unit_size(plain)
    if found is None or plain == "d":  # names a displacement more often than days
        return None
    for kind, si in _TABLES["si"].items():
        if unit_size(si) == (1.0, found[1]):
            return kind, found[0]
    return None


def _torque(plain: str) -> tuple[str, float] | None:
    """Return kind and size of a unit of torque: of force and length, with any separator
    between them.
    """
    for cut in range(1, len(plain)):
        pair = plain[:cut].rstrip(_TIMES), plain[cut:].lstrip(_TIMES)
        sizes = dict(found for each in pair if (found := _simple_unit(each)))
        if {*sizes} == {"force", "length"}:
            return "torque", sizes["force"] * sizes["length"]
    return None


def ratio(unit: str, of: str) -> float | None:
    """Return the size of a unit in another one; None if either is not known, or if
    their kinds differ.
    """
    one = unit_named(unit)
    other = unit_named(of)
    return one[1] / other[1] if one and other and one[0] == other[0] else None


def simple(name: str) -> str:
    """Return a name in the form in which names are compared: in lower case, with blanks
    between words.
    """
    plain = re.sub("[\N{MICRO SIGN}\N{GREEK SMALL LETTER MU}]", "mu", name).lower()
    return re.sub(r"[\s_.\-:/]+", " ", plain).strip()


def _named(name: str) -> Quantity:
    """Return the quantity of a name: that of the whole, or of the longest known name in
    it, the last of several; of "torque of the motor", the part before "of the".

    A single letter counts only if it stands alone, or after the name of an instrument:
    ``DAQ.F``.
    """
    plain = simple(name)
    if plain in _NAMED:
        return _NAMED[plain]
    last = re.split(r"[./:]", name.strip())[-1]
    if simple(last) in _NAMED:
        return _NAMED[simple(last)]
    words = plain.partition(" of the ")[0].split()
    for count in range(min(len(words), _MOST_WORDS), 0, -1):
        for first in range(len(words) - count, -1, -1):
            part = " ".join(words[first : first + count])
            if part in _NAMED and len(part) > 1:
                return _NAMED[part]
    return ""


class Heading(NamedTuple):
    """Name and unit of a column as the file writes them; either may be empty."""

    name: str = ""
    unit: str = ""

    @classmethod
    def read(cls, cell: str) -> Self:
        """Split the heading of a column into name and unit: ``Force (N)``,
        ``Force [N]``, ``Force / N``, ``force_N``.
        """
        cell = cell.strip(' "\t')
        if bracket := _BRACKET.fullmatch(cell):
            return cls(**bracket.groupdict())
        tail = _TAIL.fullmatch(cell)
        # F_N is the normal force, not a force in N; F/N is a force in N (ISO 80000)
        if tail and ("/" in cell or _NAMED.get(simple(cell)) != "load"):
            unit = unit_named(tail["unit"])
            named = _named(tail["name"])
            if unit and unit[0] in _TABLES["kinds"].get(named, ()):
                return cls(**tail.groupdict())
        return cls(cell)

    @property
    def quantity(self) -> Quantity:
        """Quantity of the column by its name or, if that is not known, by its unit;
        empty if neither is known.
        """
        unit = unit_named(self.unit)
        named = _named(self.name)
        if unit is None or unit[0] == "signal":
            return named
        kind = unit[0]
        if named in ("force", "coefficient"):  # the unit decides between the two
            named = "coefficient" if kind in ("number", "percentage") else "force"
        fits = kind in _TABLES["kinds"].get(named, ())
        by_unit: Quantity = _TABLES["without_a_name"].get(kind, "")
        return named if fits else "other" if named else by_unit

    @property
    def is_named(self) -> bool:
        """Whether the name, rather than the unit alone, gives the quantity."""
        return bool(_named(self.name))

    @property
    def is_torque(self) -> bool:
        """Whether the column holds a torque, by its unit or else by its name."""
        kind = (unit_named(self.unit) or ("",))[0]
        words = {*simple(self.name).split()}
        return kind == "torque" or (not kind and bool(words & _TORQUES))

    def __str__(self) -> str:
        return self.name + (f" ({self.unit})" if self.unit else "")


def headings_of(rows: Sequence[Sequence[str]], width: int) -> list[Heading]:
    """Return names and units of `width` columns from the lines above them: the last
    line of names, and the line of units below or above it.

    Lines of dashes and labels of a line ("Unit") are ignored.
    """
    plain = [[_text_of(cell) for cell in row] for row in rows]
    plain = [row for row in plain[-_MOST_ROWS:] if any(row)]
    names = units = [""] * width
    for row in plain:
        if _are_units(row, alone=len(plain) == 1):
            units = row
        else:
            names = row
    return [*map(_joined, names, units)]


def _text_of(cell: str) -> str:
    """Return the text of a cell above a column; empty for a line of dashes and for a
    label of its row.
    """
    text = cell.strip(' "\t')
    return "" if simple(text) in _LABELS or not re.search(r"[^-=_*~\s]", text) else text


def _are_units(row: Sequence[str], *, alone: bool) -> bool:
    """Whether at least half of the cells of a line are units, or all of them if the
    line stands alone.
    """
    cells = [cell.strip("[]()") for cell in row if cell]
    kinds = [found[0] for cell in cells if (found := unit_named(cell))]
    decisive = {"force", "torque", "time", "length", "stress", "signal"} & {*kinds}
    return bool(decisive) and len(kinds) >= (1.0 if alone else 0.5) * len(cells)


def _joined(name: str, unit: str) -> Heading:
    """Return the heading of a name and its cell in the line of units, which may hold a
    second name instead.
    """
    heading = Heading.read(name)
    plain = unit.strip("[]()")
    if plain and unit_named(plain) is None and _named(plain):
        return heading._replace(name=f"{heading.name} {plain}".strip())
    return Heading(heading.name, plain or heading.unit)


def with_coefficients(headings: Sequence[Heading]) -> list[Heading]:
    """Give the unit 1 to a column "friction" without a unit, if at least two other
    columns have units: it is then a coefficient.
    """
    if sum(bool(unit) for _, unit in headings) < 2:
        return [*headings]
    return [
        Heading(name, unit or "1")
        if simple(name) == "friction"
        else Heading(name, unit)
        for name, unit in headings
    ]
