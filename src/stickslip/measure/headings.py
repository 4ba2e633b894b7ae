"""Headings of the columns of a measured table: names, units, and the quantity that
they mean.
"""

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
    """Kind of quantity and size in SI units of a unit that instruments write; None
    if it is not one of these.
    """
    plain = text.strip()
    # Nm is no nanometre, but Newton and MIN mean the same in small letters
    return (
        _simple_unit(plain)
        or _torque(plain)
        or (_simple_unit(plain.lower()) if len(plain) > 1 else None)
    )


def _simple_unit(plain: str) -> tuple[str, float] | None:
    """A unit as it is written, and no product."""
    if plain.lower() in _UNITS:
        return _UNITS[plain.lower()]
    prefix = plain[:-1]
    if plain[-1:] in ("V", "A") and prefix in ("", *PREFIXES):
        return "signal", float(f"1e{PREFIXES[prefix][1]}") if prefix else 1.0
    found = unit_size(plain)
    if found is None or plain == "d":  # which names a displacement rather than days
        return None
    for kind, si in _TABLES["si"].items():
        if unit_size(si) == (1.0, found[1]):
            return kind, found[0]
    return None


def _torque(plain: str) -> tuple[str, float] | None:
    """Unit of a torque: a force times a length, with any separator between them."""
    for cut in range(1, len(plain)):
        pair = plain[:cut].rstrip(_TIMES), plain[cut:].lstrip(_TIMES)
        sizes = dict(found for each in pair if (found := _simple_unit(each)))
        if {*sizes} == {"force", "length"}:
            return "torque", sizes["force"] * sizes["length"]
    return None


def ratio(unit: str, of: str) -> float | None:
    """Size of a unit in another of the same kind; None if they are not known, or of
    two kinds.
    """
    one = unit_named(unit)
    other = unit_named(of)
    return one[1] / other[1] if one and other and one[0] == other[0] else None


def simple(name: str) -> str:
    """A name as it is compared: in small letters, with blanks between words."""
    plain = re.sub("[\N{MICRO SIGN}\N{GREEK SMALL LETTER MU}]", "mu", name).lower()
    return re.sub(r"[\s_.\-:/]+", " ", plain).strip()


def _named(name: str) -> Quantity:
    """Return the quantity that a name means: the whole, or the longest known one in it,
    the last of equally long ones; of "torque of the motor" the part before "of the".

    A single letter counts only where it stands alone, or behind the name of an
    instrument: ``DAQ.F``.
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
        # F_N is the normal force, and no force in N; F/N is one (ISO 80000)
        if tail and ("/" in cell or _NAMED.get(simple(cell)) != "load"):
            unit = unit_named(tail["unit"])
            named = _named(tail["name"])
            if unit and unit[0] in _TABLES["kinds"].get(named, ()):
                return cls(**tail.groupdict())
        return cls(cell)

    @property
    def quantity(self) -> Quantity:
        """Quantity of the column, by its name or, where that is none of ours, by its
        unit; empty if neither is known.
        """
        unit = unit_named(self.unit)
        named = _named(self.name)
        if unit is None or unit[0] == "signal":
            return named
        kind = unit[0]
        if named in ("force", "coefficient"):  # of friction, as its unit says
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
        """Whether a column of friction holds a torque."""
        kind = (unit_named(self.unit) or ("",))[0]
        words = {*simple(self.name).split()}
        return kind == "torque" or (not kind and bool(words & _TORQUES))

    def __str__(self) -> str:
        return self.name + (f" ({self.unit})" if self.unit else "")


def headings_of(rows: Sequence[Sequence[str]], width: int) -> list[Heading]:
    """Return names and units of `width` columns, from lines above them: the last that
    holds names, and the units in the line below it or above it.

    Lines of dashes, and the label of a line ("Unit"), are left out.
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
    """Return the text of a cell above a column; nothing, if it underlines, or labels
    its row.
    """
    text = cell.strip(' "\t')
    return "" if simple(text) in _LABELS or not re.search(r"[^-=_*~\s]", text) else text


def _are_units(row: Sequence[str], *, alone: bool) -> bool:
    """Whether at least half of the cells of a line are units, or all cells where no
    line of names is beside it.
    """
    cells = [cell.strip("[]()") for cell in row if cell]
    kinds = [found[0] for cell in cells if (found := unit_named(cell))]
    decisive = {"force", "torque", "time", "length", "stress", "signal"} & {*kinds}
    return bool(decisive) and len(kinds) >= (1.0 if alone else 0.5) * len(cells)


def _joined(name: str, unit: str) -> Heading:
    """A name and the cell in the line of units, which may be a second name."""
    heading = Heading.read(name)
    plain = unit.strip("[]()")
    if plain and unit_named(plain) is None and _named(plain):
        return heading._replace(name=f"{heading.name} {plain}".strip())
    return Heading(heading.name, plain or heading.unit)


def with_coefficients(headings: Sequence[Heading]) -> list[Heading]:
    """Give a column "friction" without a unit the unit 1: where other columns have
    units, it is a coefficient.
    """
    if sum(bool(unit) for _, unit in headings) < 2:
        return [*headings]
    return [
        Heading(name, unit or "1")
        if simple(name) == "friction"
        else Heading(name, unit)
        for name, unit in headings
    ]
