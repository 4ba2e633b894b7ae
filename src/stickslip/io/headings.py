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
    "aside",
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
_TIMES_ALONE = frozenset(_TABLES["labels"]["times"].split(", "))
_TIMES = " *·.-"  # between the units of a product: N m, N·m, ft-lb

# brackets of all kinds, wide ones of East Asia too, to round ones
_ROUND = str.maketrans("[{<\uff08\u3010]}>\uff09\u3011", "((((()))))")
_BRACKET = re.compile(r"\s*\(\s*(?:in\s+)?([^()]*?)\s*\)\s*")
_BEFORE_UNIT = re.compile(r"\s+in\s+|\s*[/,_.:|-]\s*|\s+")
_SURE = {"force", "torque", "stress", "time"}  # kinds of units that need no name


def unit_named(text: str) -> tuple[str, float] | None:
    """Return the kind of quantity of a unit and its size in SI units; None if the unit
    is not known.
    """
    plain = text.strip(" .·")
    # Nm is no nanometre, but Newton and MIN mean the same in small letters
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


def _kind(unit: str) -> str:
    """Kind of quantity of a unit; empty if it is not known."""
    return (unit_named(unit) or ("",))[0]


def step_named(name: str, value: float, unit: str) -> float | None:
    """Return the sampling interval in s that a number of this name is or, as a rate,
    gives.
    """
    plain = simple(name)
    for words, si, power in (("steps", "s", 1.0), ("rates", "hz", -1.0)):
        size = ratio(unit or si, si)
        if plain in _TABLES["labels"][words].split(", ") and size and value > 0.0:
            return float((size * value) ** power)
    return None


def simple(name: str) -> str:
    """Return a name in the form in which names are compared: in lower case, with blanks
    between words.
    """
    plain = re.sub("[\N{MICRO SIGN}\N{GREEK SMALL LETTER MU}]", "mu", name).lower()
    return re.sub(r"[\s_.\-:/]+", " ", plain).strip()


def _names_in(name: str) -> list[Quantity]:
    """Return the quantities that a name may mean, the likeliest first: that of the
    whole, then of the longest known words in it, the last of equally long ones; of
    "torque of the motor" of the part before "of the".

    A single letter counts only if it stands alone, or after the name of an instrument:
    ``DAQ.F``.
    """
    parts = [simple(name), simple(re.split(r"[./:]", name.strip())[-1])]
    words = parts[0].partition(" of the ")[0].split()
    for count in range(min(len(words), _MOST_WORDS), 0, -1):
        for first in range(len(words) - count, -1, -1):
            part = " ".join(words[first : first + count])
            if len(part) > 1:
                parts.append(part)
    return [_NAMED[part] for part in parts if part in _NAMED]


class Heading(NamedTuple):
    """Name and unit of a column as the file writes them; either may be empty."""

    name: str = ""
    unit: str = ""

    @classmethod
    def read(cls, cell: str) -> Self:
        """Take the head of a column apart: ``Force (N)``, ``Force [N] raw``,
        ``Force / N``, ``force_N``, ``millis``.
        """
        cell = cell.strip(' "\t')
        brackets = [*_BRACKET.finditer(cell.translate(_ROUND))]
        known = [each for each in brackets if _kind(each[1]) not in ("", "number")]
        at_end = [each for each in brackets if each.end() == len(cell) > len(each[0])]
        if known or at_end:
            found = (known or at_end)[0]
            around = cell[: found.start()], cell[found.end() :]
            return cls(" ".join(filter(None, around)).strip(" ,:/_-"), found[1])
        if simple(cell) in _TIMES_ALONE:
            return cls(cell, cell)
        # F_N is the normal force, and no force in N; F/N is one (ISO 80000); F_T/F_N is
        # a coefficient
        whole = _NAMED.get(simple(cell))
        if whole == "coefficient" or (whole == "load" and "/" not in cell):
            return cls(cell)
        for found in _BEFORE_UNIT.finditer(cell):
            unit = cell[found.end() :].replace("_", "/")  # speed_mm_s
            heading = cls(cell[: found.start()], unit)
            if heading.name and heading._unit_fits():
                return heading
        return cls(cell)

    def _unit_fits(self) -> bool:
        """Whether the unit is one of the quantity that the name means, or needs no
        name: ``tau_MPa``.
        """
        kind = _kind(self.unit)
        named = _names_in(self.name)
        if named:
            return any(kind in _TABLES["kinds"].get(each, ()) for each in named)
        is_minimum = self.unit.lower() == "min"
        return kind in _SURE and len(self.unit) > 1 and not is_minimum

    @property
    def quantity(self) -> Quantity:
        """Quantity of the column by its name or, if that is not known, by its unit;
        empty if neither is known.
        """
        kind = _kind(self.unit)
        named = _names_in(self.name)
        if "aside" in named and kind in ("", *_TABLES["kinds"]["aside"]):
            return "aside"
        if kind in ("", "signal"):
            return named[0] if named else ""
        # of friction, as its unit says
        is_ratio = kind in ("number", "percentage")
        friction: Quantity = "coefficient" if is_ratio else "force"
        for each in named:
            meant = friction if each in ("force", "coefficient") else each
            if kind in _TABLES["kinds"].get(meant, ()):
                return meant
        by_unit: Quantity = _TABLES["without_a_name"].get(kind, "")
        return "other" if named else by_unit

    @property
    def is_named(self) -> bool:
        """Whether the name, rather than the unit alone, gives the quantity."""
        return bool(_names_in(self.name))

    @property
    def is_torque(self) -> bool:
        """Whether a column of friction holds a torque."""
        kind = _kind(self.unit)
        words = {*simple(self.name).split()}
        return kind == "torque" or (not kind and bool(words & _TORQUES))

    def __str__(self) -> str:
        return self.name + (f" ({self.unit})" if self.unit else "")


def headings_of(rows: Sequence[Sequence[str]], width: int) -> list[Heading]:
    """Return names and units of `width` columns from the lines above them: the last
    line of names, and the line of units below or above it.

    Lines of dashes, and the label of a line ("Unit"), are left out. A line with such a
    label counts wherever it stands.
    """
    plain = [[_text_of(cell) for cell in row] for row in rows]
    labelled = [
        row for row, given in zip(plain, rows, strict=True) if _has_label(given)
    ]
    plain = [row for row in plain if any(row)]
    near = plain[-_MOST_ROWS:]
    if not any(map(count_named, near)):  # names of channels stand between, and rates
        full = [k for k, row in enumerate(plain) if count_named(row) > 1]
        near = plain[max(full[-1] - 1, 0) : full[-1] + 2] if full else near
    names = units = [""] * width
    for row in [*labelled, *near]:
        if are_units(row, alone=len(plain) == 1):
            units = row
        else:
            names = row
    return [*map(_joined, names, units)]


def count_named(row: Sequence[str]) -> int:
    """Number of cells in a line that name a quantity."""
    return sum(bool(Heading.read(cell).quantity) for cell in row)


def _has_label(row: Sequence[str]) -> bool:
    """Whether a line begins with a word for what it holds, such as "Unit"."""
    return simple(row[0].strip(' "\t')) in _LABELS


def _text_of(cell: str) -> str:
    """Return the text of a cell above a column; empty for a line of dashes and for a
    label of its row.
    """
    text = cell.strip(' "\t')
    is_line = re.match(r"\*\*\*|[-=_*~\s]*$", text)  # or the end of LabVIEW's head
    return "" if is_line or simple(text) in _LABELS else text


def are_units(row: Sequence[str], *, alone: bool = False) -> bool:
    """Whether at least half of the cells of a line are units, or all cells where no
    line of names is beside it.
    """
    cells = [cell.strip('[]()" ') for cell in row if cell]
    kinds = [found[0] for cell in cells if (found := unit_named(cell))]
    are_quantities = not {*kinds} <= {"number", "percentage"}
    needed = len(cells) if alone else 0.5 * len(cells)
    return are_quantities and len(kinds) >= needed


def _joined(name: str, unit: str) -> Heading:
    """Return the heading of a name and its cell in the line of units, which may hold a
    second name instead.
    """
    heading = Heading.read(name)
    plain = unit.strip("[]()")
    if plain and unit_named(plain) is None and _names_in(plain):
        return heading._replace(name=f"{heading.name} {plain}".strip())
    return Heading(heading.name, plain or heading.unit)


def with_coefficients(headings: Sequence[Heading]) -> list[Heading]:
    """Give the unit 1 to a column "friction" without a unit, if at least two other
    columns have units: it is then a coefficient.
    """
    have_units = sum(bool(unit) for _, unit in headings) >= 2
    return [
        Heading(
            name, unit or "1" if have_units and simple(name) == "friction" else unit
        )
        for name, unit in headings
    ]
