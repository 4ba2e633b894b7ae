"""Headings of the columns of a measured table: names, units, and quantities."""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Self

from stickslip.model.quantities import unit_size
from stickslip.words import PREFIXES

_TABLES = tomllib.loads(Path(__file__).with_name("headings.toml").read_text("utf-8"))
_UNITS = {
    word: (kind, size)
    for kind, words in _TABLES["units"].items()
    for word, size in words.items()
}
_NAMED = {
    name: quantity
    for quantity, names in _TABLES["names"].items()
    for name in names.split(", ")
}
_LABELS: dict[str, list[str]] = _TABLES["labels"]
WEIGHTS: dict[str, str] = _TABLES["weights"]
# kind of each unit whose prefix is not clear, as its case is not, and its meanings
_UNCLEAR: dict[str, list[str]] = _TABLES["unclear"]
_MOST_ROWS = 3  # number of lines above a table in which names of columns are expected
_MOST_WORDS = max(name.count(" ") for name in _NAMED) + 1
_PRODUCT_SIGNS = " *·.-"  # signs between the units of a product: N m, N·m, ft-lb
_DECADES = {"": 0} | {prefix: power for prefix, (_, power) in PREFIXES.items()}

# brackets of all kinds, also the wide ones of East Asia, become round ones
_ROUND = str.maketrans("[{<\uff08\u3010]}>\uff09\u3011", "((((()))))")
_BRACKET = re.compile(r"\s*\(\s*(?:in\s+)?([^()]*?)\s*\)\s*")
_BEFORE_UNIT = re.compile(r"\s+in\s+|\s*[/,_.:|-]\s*|\s+")
# where a unit may begin in camel case: timeMs, forceN, forcekN
_INNER_CAPITAL = re.compile(r"(?<=[a-z])(?=[a-zµμ]?[A-Z])")
_INNER_WORD = re.compile(r"(?<=[a-z])(?=[A-Z\d])")  # LoadCell1
_POWER = r"(?:1?[eE][-+]\d+|1[eE]\d+|10(?:\^|\*\*)[-+]?\d+|10[⁻⁺]?[⁰¹²³⁴-⁹]+)"
_TENS = rf"(?:{_POWER}|10+|0\.0*1)"
# a power of ten in a name: x 1000, *1e3, /10, 1000 x, 10^3
_FACTOR = re.compile(
    rf"(?:(?<![a-zA-Z\d])x|[×*·]|(?<!\d)/)\s*{_TENS}(?![\w.])"
    rf"|(?<![\w.])(?:{_TENS}\s*(?:x(?!\w)|[×*·])|{_POWER}(?![\w.]))"
)
# a function of what was measured: ln(F), F^2, 1/F, dF/dt
_FUNCTION = re.compile(
    r"\b(?:ln|lg|log(?:10|2)?|sqrt|diff)\s*\(|[a-z]\^[-\d]|\bd\w+/dt\b|^1/(?=[a-z])",
    re.IGNORECASE,
)
# a number beside a unit: 10^3 N, x1000 N, N x 10^-3, and the range of a sensor, 500 N
_NUMBER_AND_UNIT = re.compile(
    rf"[x×*·]?\s*(?:{_TENS}|\d[\d.]*)\s*[x×*·]?\s*([^\d\s]\D*)"
    rf"|(\D+?)\s*[x×*·]\s*{_TENS}"
)
# kinds of units that give the quantity of a column with an unknown name
_SURE = {"force", "torque", "stress", "time"}


def unit_named(text: str) -> tuple[str, float] | None:
    """Return the kind of quantity of a unit and its size in SI units; None if the unit
    is not known.
    """
    plain = text.strip(" .·")
    found = _simple_unit(plain) or _torque(plain)
    if found is None and len(plain) > 1:
        # last, as Nm is no nanometre; Newton and MIN are known in lower case
        found = _simple_unit(plain.lower())
    return found


def _simple_unit(plain: str) -> tuple[str, float] | None:
    """Return kind and size of a unit that is not a product; its case matters."""
    for word in (plain, plain.lower()):
        if word in _UNITS:
            return _UNITS[word]
    if plain[-1:] in ("V", "A") and plain[:-1] in _DECADES:
        return "signal", float(f"1e{_DECADES[plain[:-1]]}")
    found = unit_size(plain)
    if found is None or plain == "d":  # more often a displacement than days
        return None
    for kind, si in _TABLES["si"].items():
        if unit_size(si) == (1.0, found[1]):
            return kind, found[0]
    return None


def _torque(plain: str) -> tuple[str, float] | None:
    """Return kind and size of a unit of torque: units of force and length, in any order
    and with any sign between them.
    """
    for cut in range(1, len(plain)):
        first = _simple_unit(plain[:cut].rstrip(_PRODUCT_SIGNS))
        second = _simple_unit(plain[cut:].lstrip(_PRODUCT_SIGNS))
        if first and second and {first[0], second[0]} == {"force", "length"}:
            return "torque", first[1] * second[1]
    return None


def ratio(unit: str, of: str) -> float | None:
    """Return the size of a unit in another unit; None if either is not known, or if
    their kinds differ.
    """
    one = unit_named(unit)
    other = unit_named(of)
    return one[1] / other[1] if one and other and one[0] == other[0] else None


def kind_of(unit: str) -> str:
    """Return the kind of quantity of a unit; an empty text if it is not known."""
    return (unit_named(unit) or ("",))[0]


def _kind_of_some(unit: str) -> str:
    """Return the kind of quantity of a unit whose size need not be clear."""
    return kind_of(unit) or _UNCLEAR.get(unit, ("",))[0]


def step_named(name: str, value: float, unit: str) -> float | None:
    """Return the sampling interval in s, if the name is that of an interval or a rate;
    None if it is not, or the value or its unit do not fit.
    """
    plain = simple(name)
    for labels, si, power in (("steps", "s", 1.0), ("rates", "hz", -1.0)):
        size = ratio(unit or si, si)
        if plain in _LABELS[labels] and size and value > 0.0:
            return float((size * value) ** power)
    return None


def simple(name: str) -> str:
    """Return a name in the form in which names are compared: in lower case, with single
    blanks between words.
    """
    plain = re.sub("[\N{MICRO SIGN}\N{GREEK SMALL LETTER MU}]", "mu", name).lower()
    return re.sub(r"[\s_.\-:/]+", " ", plain).strip()


def _quantities_of(name: str) -> list[str]:
    """Return the quantities that a name may mean, the most likely first.

    The whole name comes first, then the known words in it: longer phrases before
    shorter ones, and the last of equally long ones before the others. Words after
    "of the" do not count, as in "torque of the motor". A single letter counts only if
    it stands alone, or after the name of an instrument: ``DAQ.F``.
    """
    parts = [simple(name), simple(re.split(r"[./:]", name.strip())[-1])]
    words = simple(_INNER_WORD.sub(" ", name)).partition(" of the ")[0].split()
    for count in range(min(len(words), _MOST_WORDS), 0, -1):
        for first in range(len(words) - count, -1, -1):
            part = " ".join(words[first : first + count])
            if len(part) > 1:
                parts.append(part)
    return [_NAMED[part] for part in parts if part in _NAMED]


class Heading(NamedTuple):
    """Name and unit of a column, as in the file; either may be empty."""

    name: str = ""
    unit: str = ""

    @classmethod
    def read(cls, cell: str) -> Self:
        """Return name and unit in the head of a column: ``Force (N)``,
        ``Force [N] raw``, ``Force / N``, ``force_N``, ``millis``.
        """
        cell = cell.strip(' "\t')
        brackets = [*_BRACKET.finditer(cell.translate(_ROUND))]
        known = [each for each in brackets if kind_of(each[1]) not in ("", "number")]
        at_end = [each for each in brackets if each.end() == len(cell) > len(each[0])]
        if known or at_end:
            found = (known or at_end)[0]
            around = cell[: found.start()], cell[found.end() :]
            name = " ".join(filter(None, around)).strip(" ,:/_-")
            return cls(name, found[1])._of_torque()
        if simple(cell) in _LABELS["times"]:
            return cls(cell, cell)
        # F_N is the normal force, F/N a force in N (ISO 80000), F_T/F_N a coefficient
        whole = _NAMED.get(simple(cell))
        if whole == "coefficient" or (whole == "load" and "/" not in cell):
            return cls(cell)
        for found in _BEFORE_UNIT.finditer(cell):
            unit = cell[found.end() :].replace("_", "/")  # speed_mm_s
            heading = cls(cell[: found.start()], unit)._of_torque()
            if heading.name and heading._unit_fits():
                return heading
        for found in _INNER_CAPITAL.finditer(cell):  # timeMs, forceN
            unit = _in_camel_case(cell[found.end() :])
            heading = cls(cell[: found.start()], unit)
            if _quantities_of(heading.name) and heading._unit_fits():
                return heading
        return cls(cell)

    def _of_torque(self) -> Self:
        """Return the heading with N m for nm and NM, if its name is that of a torque,
        which has no unit of length.
        """
        is_length = self.unit.lower() == "nm" and kind_of(self.unit) == "length"
        return self._replace(unit="N m") if is_length and self._names_torque() else self

    def _unit_fits(self) -> bool:
        """Return whether the unit belongs to a quantity that the name means, or is
        clear without a known name.
        """
        kind = _kind_of_some(self.unit)
        named = _quantities_of(self.name)
        if named:
            return any(kind in _TABLES["kinds"].get(each, ()) for each in named)
        is_minimum = self.unit.lower() == "min"  # rather than minutes
        return kind in _SURE and len(self.unit) > 1 and not is_minimum

    @property
    def quantity(self) -> str:
        """Quantity of the column by its name or, if that is not known, by its unit: a
        key of the table of names in headings.toml, or an empty text if neither is
        known.
        """
        kind = _kind_of_some(self.unit)
        named = _quantities_of(self.name)
        if "aside" in named and kind in ("", *_TABLES["kinds"]["aside"]):
            return "aside"
        if kind in ("", "signal"):
            return named[0] if named else ""
        # the unit decides whether friction is a force or a coefficient
        is_ratio = kind in ("number", "percentage")
        friction = "coefficient" if is_ratio else "force"
        for each in named:
            meant = friction if each in ("force", "coefficient") else each
            if kind in _TABLES["kinds"].get(meant, ()):
                return meant
        by_unit: str = _TABLES["without_a_name"].get(kind, "")
        return "other" if named else by_unit

    @property
    def is_named(self) -> bool:
        """Whether the name, rather than the unit alone, gives the quantity."""
        return bool(_quantities_of(self.name))

    @property
    def is_torque(self) -> bool:
        """Whether a column of friction holds a torque."""
        if kind := kind_of(self.unit):
            return kind == "torque"
        return self._names_torque()

    def _names_torque(self) -> bool:
        """Return whether the name is that of a torque."""
        return any(word in _LABELS["torques"] for word in simple(self.name).split())

    @property
    def unclear(self) -> str:
        """What is not clear about the size of the numbers; empty if it is clear."""
        if self.unit in _UNCLEAR:
            return f"may be in {' or '.join(_UNCLEAR[self.unit][1:])}"
        beside = None if kind_of(self.unit) else _NUMBER_AND_UNIT.fullmatch(self.unit)
        if beside and _kind_of_some((beside[1] or beside[2]).strip()):
            return f"has a number beside its unit, {self.unit}"
        if found := _FACTOR.search(self.name):
            return f"may have been multiplied or divided ({found[0].strip()})"
        if _FUNCTION.search(self.name):
            return f"may be a function of what was measured ({self.name})"
        return ""

    def __str__(self) -> str:
        return self.name + (f" ({self.unit})" if self.unit else "")


def _in_camel_case(unit: str) -> str:
    """Return the unit that ends a name in camel case, where the first letter of each
    word is a capital: ms in timeMs. A stress has a prefix in its own case, as none is
    measured in mPa; MN may be mN, and is returned as mn, which is not clear.
    """
    if len(unit) == 1 or kind_of(unit) == "stress":
        return unit
    small = unit[0].lower() + unit[1:]
    if kind_of(unit) not in ("force", "torque"):
        return small
    return unit if ratio(unit, small) in (1.0, None) else unit.lower()


def headings_of(rows: Sequence[Sequence[str]], width: int) -> list[Heading]:
    """Return names and units of `width` columns from the lines above them: the last
    line of names, and the line of units below or above it.

    Lines of dashes, and the label of a line ("Unit"), are ignored. Lines with such a
    label may stand anywhere above the table, others only right above it.
    """
    labelled = []
    plain = []
    for cells in rows:
        row = [_text_of(cell) for cell in cells]
        if any(row):
            plain.append(row)
        if simple(cells[0].strip(' "\t')) in _LABELS["rows"]:
            labelled.append(row)
    near = plain[-_MOST_ROWS:]
    # names of channels and sampling rates may stand below the line of names
    if not any(map(count_named, near)):
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
    """Return the number of cells in a line that name a quantity."""
    return sum(bool(Heading.read(cell).quantity) for cell in row)


def _text_of(cell: str) -> str:
    """Return the text of a cell above a column, or an empty text for a line of dashes
    and for the label of a row.
    """
    text = cell.strip(' "\t')
    # a line of dashes, or the end of a header of LabVIEW
    is_line = re.match(r"\*\*\*|[-=_*~\s]*$", text)
    return "" if is_line or simple(text) in _LABELS["rows"] else text


def are_units(row: Sequence[str], *, alone: bool = False) -> bool:
    """Return whether at least half of the cells of a line are units or, if the line
    stands alone, all of them.
    """
    cells = [cell.strip('[]()" ') for cell in row if cell]
    kinds = [*filter(None, map(kind_of, cells))]
    are_quantities = not {*kinds} <= {"number", "percentage"}
    needed = len(cells) if alone else 0.5 * len(cells)
    return are_quantities and len(kinds) >= needed


def _joined(name: str, unit: str) -> Heading:
    """Return the heading of a cell in the line of names and one in the line of units,
    which may contain a second part of the name instead.
    """
    heading = Heading.read(name)
    plain = unit.strip("[]()")
    if plain and unit_named(plain) is None and _quantities_of(plain):
        return heading._replace(name=f"{heading.name} {plain}".strip())
    return Heading(heading.name, plain or heading.unit)._of_torque()


def with_coefficients(headings: Sequence[Heading]) -> list[Heading]:
    """Return the headings, where a column "friction" without a unit has the unit 1 if
    at least two other columns have units, as it is then a coefficient.
    """
    found = [*headings]
    if sum(bool(heading.unit) for heading in headings) >= 2:
        for i, (name, unit) in enumerate(headings):
            if not unit and simple(name) == "friction":
                found[i] = Heading(name, "1")
    return found
