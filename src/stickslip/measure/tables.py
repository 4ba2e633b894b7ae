"""A table of numbers as instruments write them: its layout by its head and a sample
of its rows, then its columns.
"""

import csv
import io
import math
import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from statistics import mode
from typing import Any, NamedTuple, NoReturn

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from stickslip.errors import InputError, shortened
from stickslip.measure.clocks import has_date, seconds_of
from stickslip.measure.headings import (
    Heading,
    headings_of,
    ratio,
    unit_named,
    with_coefficients,
)
from stickslip.measure.trace import Array
from stickslip.model.quantities import unit_size

MOST_COLUMNS = 1000
_LONGEST_LINE = 65_536  # characters of a line that are looked at
_SAMPLE = 400  # lines looked at to find out how a table is laid out
_HEAD = 1000  # lines among which a table must start
_LOOKED_AT = 50  # rows, and cells of each, by which a layout is chosen
_LONGEST_NUMBER = 60  # characters of a cell that may hold a number

_CONTROLS = bytes([*range(9), *range(13, 32), 127])
_ROW = re.compile(r"\s*(?![#%!]|//)\S")  # neither blank nor a comment
_NO_ROW = re.compile(rb"\n[^\S\n]*(?=\n|[#%!]|//)")  # the end of the line before one
_NUMBER = re.compile(
    r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)\s*([^\W\d_%°](?:[^,;\s]|\s(?![-+.\d])){0,11}|[%°])?"
)
_BLANKS, _BEFORE_NUMBERS = " ", "  "
"""What separates columns besides one character: blanks, or only those before a
number, where units stand behind it.
"""
_FORTRAN = str.maketrans("dD", "ee")  # 1.5D+01 is 15
_COMMAS = str.maketrans(".,", ",.")
_NO_VALUE = {
    "nan",
    "inf",
    "-inf",
    "+inf",
    "na",
    "n/a",
    "null",
    "none",
    "-",
    "--",
    "---",
    "",
}

Columns = tuple[dict[int, Array], NDArray[np.int64]]


class Table(NamedTuple):
    """A table whose layout is known: its headings, its columns of numbers, and the step
    in s where the file says so.

    `read` returns columns as numbers, NaN where a cell holds none, and the line of each
    row; `line` the text of one; `notes` say what of the file was left out.
    """

    headings: list[Heading]
    numeric: list[int]
    read: Callable[[Iterable[int]], Columns]
    line: Callable[[int], str]
    step: float | None = None
    notes: tuple[str, ...] = ()

    def listed(self) -> str:
        """The columns, for a message."""
        shown = []
        for i, heading in enumerate(self.headings):
            named = f"{i + 1} '{heading}'" if heading.name else f"{i + 1}"
            none = "" if i in self.numeric else " (no numbers such as 1234.5)"
            shown.append(named + none)
        return ", ".join(shown[:12] or ["none"]) + (" ..." if len(shown) > 12 else "")


def read_cell(cell: str, comma: bool = False) -> tuple[float | None, str]:
    """Number and unit of a cell, a time of the day as seconds; None and no unit
    where it holds no finite number.
    """
    cell = cell.strip().strip('"').replace("\N{MINUS SIGN}", "-")
    if len(cell) > _LONGEST_NUMBER:
        return None, ""
    # as it stands: 25.04.2026 has points where decimals have commas, too
    if (seconds := seconds_of(cell)) is not None:
        return seconds, "s"
    match = _NUMBER.fullmatch(cell.translate(_COMMAS) if comma else cell)
    if match is None:
        return None, ""
    value = float(match[1].translate(_FORTRAN))
    unit = (match[2] or "").strip()
    words = unit.split()
    known = not words or any(unit_named(word) or unit_size(word) for word in words)
    return (value, unit) if known and math.isfinite(value) else (None, "")


def _numbers(cells: Iterable[str], comma: bool = False, none: float = 0.0) -> float:
    """Which part of the cells holds numbers, of those that do not say that they have
    none.
    """
    told = [
        read_cell(cell, comma)[0] is not None
        for cell in cells
        if cell.strip().lower() not in _NO_VALUE
    ]
    return sum(told) / len(told) if told else none


def _split(line: str, mark: str) -> list[str]:
    if mark in (_BLANKS, _BEFORE_NUMBERS):
        return (
            line.split()
            if mark == _BLANKS
            else re.split(r"\s+(?=[-+.\d])", line.strip())
        )
    return next(csv.reader([line], delimiter=mark, skipinitialspace=True), [""])


def _as_utf8(raw: bytes) -> bytes:
    """The text of a file in UTF-8, its lines ended by a line feed."""
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")) or raw[1:2] == b"\0":
        raw = raw.decode("utf-16", errors="replace").encode()
    raw = raw.removeprefix(b"\xef\xbb\xbf").rstrip(b"\x1a")  # the end of a file of DOS
    try:
        raw.decode()
    except UnicodeDecodeError:
        # units such as µ, written by older instruments
        raw = raw.decode("latin-1").encode()
    raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n").removesuffix(b"\n") + b"\n"
    if len(raw.translate(None, _CONTROLS)) < len(raw):
        raise InputError("is a binary file of an unknown kind: save the table as text")
    return raw


class _Lines(NamedTuple):
    """The lines of a text, found by their number from zero."""

    raw: bytes
    begins: NDArray[np.int64]  # where each line begins, and where the text ends

    @property
    def total(self) -> int:
        return self.begins.size - 1

    def line(self, i: int) -> str:
        begin = self.begins[i]
        end = min(self.begins[i + 1] - 1, begin + _LONGEST_LINE)
        return self.raw[begin:end].decode(errors="replace")

    def head(self) -> list[tuple[int, str]]:
        """The first lines that are not blank, with their numbers."""
        first = ((i, self.line(i)) for i in range(min(self.total, _HEAD)))
        return [(i, line) for i, line in first if line.strip()]

    def rows(self, begin: int) -> list[str]:
        """A sample of rows from the line `begin` on, evenly over the text."""
        places = np.linspace(begin, self.total, _SAMPLE, endpoint=False)
        lines = (self.line(i) for i in np.unique(places.astype(int)).tolist())
        return [line for line in lines if _ROW.match(line)]


class _Rows(NamedTuple):
    """How the rows of a text are read."""

    lines: _Lines
    start: int  # the line of the first row
    mark: str
    comma: bool
    width: int
    quoted: bool
    units: dict[int, str]  # of each column of numbers, as its cells state them
    clocks: frozenset[int]  # columns that hold times of day
    undated: frozenset[int]  # those of them whose times have no date

    def text(self, row: int) -> str:
        """The text of a line, counted from one."""
        return self.lines.line(row - 1).strip()

    def read(self, asked: Iterable[int]) -> Columns:
        """Return columns of numbers, and the line (from one) of each row kept."""
        columns = [*dict.fromkeys(asked)]
        lines = self.lines
        cells = _cells(
            memoryview(lines.raw)[lines.begins[self.start] :],
            lines.total - self.start,
            [*columns, self.width],
            self.mark,
            self.comma,
            quoted=self.quoted,
        )
        begins = lines.begins[self.start : -1]
        ends = _NO_ROW.finditer(lines.raw, begins[0])
        keep = ~np.isin(begins, [end.start() + 1 for end in ends])
        surplus = cells.pop(self.width).map(self._is_surplus) == True  # noqa: E712
        values = {}
        for i in columns:
            numbers = _as_numbers(cells.pop(i), self.units[i], self.comma)
            values[i] = np.where(surplus, math.nan, numbers)[keep]
        for i in self.clocks & values.keys():
            values[i] = self._since_first(i, values[i])
        return values, np.flatnonzero(keep) + self.start + 1

    def _is_surplus(self, beyond: str) -> bool:
        """Whether a number or a unit stands in a cell beyond the last column."""
        number, _ = read_cell(str(beyond), self.comma)
        return number is not None or unit_named(str(beyond)) is not None

    def _since_first(self, column: int, times: Array) -> Array:
        """Times of day since the first; each leap backwards is a midnight."""
        if column in self.undated:
            half_a_day = 43200.0
            days = np.cumsum(np.append(False, np.diff(times) < -half_a_day))
            times = times + 86400.0 * days
        return times - times[np.isfinite(times)][:1]


def read_text(
    raw: bytes, delimiter: str | None = None, decimal: str | None = None
) -> Table:
    """Find the rows of numbers in a text, and their headings; `InputError` if there
    are none.
    """
    raw = _as_utf8(raw)
    octets = np.frombuffer(raw, dtype=np.uint8)
    lines = _Lines(raw, np.append(0, np.flatnonzero(octets == ord("\n")) + 1))
    labview, head = _without_header_of_labview(lines.head())
    # text may stand above, so that rows are looked for in the last third of a head
    sample = lines.rows((2 * head[0][0] + lines.total) // 3) if head else []
    if not sample:
        raise InputError(
            "is empty, or holds blanks and comments only; it should hold a column of "
            "forces"
        )
    mark, comma = _layout(sample, delimiter, decimal)
    cells = [_split(line, mark) for line in sample]
    width = mode(map(len, cells))
    if width > MOST_COLUMNS:
        raise InputError(
            f"has {width} columns, more than {MOST_COLUMNS}; keep those of time and "
            "force"
        )
    columns = [*zip(*(row for row in cells if len(row) == width), strict=True)]
    numeric = [i for i, column in enumerate(columns) if _numbers(column, comma) >= 0.5]
    start = _first_row(head, numeric, mark, comma)
    above = (
        _as_wide(line.lstrip().lstrip("#%/! "), mark, width)
        for i, line in head
        if i < start
    )
    named = [row for row in above if _numbers(row, none=1.0) < 1.0]
    points = any("." in cell for i in numeric for cell in columns[i] if ":" not in cell)
    if mark == "," and not (comma or named or delimiter or decimal or points):
        _refuse_two_readings(sample, width)
    headings = headings_of(named, width)
    step = _labview([line for _, line in labview], headings, numeric, mark, comma)
    units = {i: mode(read_cell(cell, comma)[1] for cell in columns[i]) for i in numeric}
    clocks = [i for i in numeric if ":" in columns[i][0]]
    for i in clocks:  # whose heading may hold their form, hh:mm:ss
        headings[i] = Heading(headings[i].name or "time", "s")
    for i, unit in units.items():
        headings[i] = _with_unit_of_cells(headings[i], unit, i)
    rows = _Rows(
        lines=lines,
        start=start,
        mark=mark,
        comma=comma,
        width=width,
        quoted='"' in "".join(sample),
        units=units,
        clocks=frozenset(clocks),
        undated=frozenset(i for i in clocks if not has_date(columns[i][0].strip(' "'))),
    )
    return Table(with_coefficients(headings), numeric, rows.read, rows.text, step)


_Numbered = list[tuple[int, str]]


def _without_header_of_labview(head: _Numbered) -> tuple[_Numbered, _Numbered]:
    """Part the header of a LabVIEW file, empty where there is none, from the rest."""
    ends = [
        k for k, (_, line) in enumerate(head) if line.startswith("***End_of_Header***")
    ]
    if not ends:
        return [], head
    return head[: ends[-1]], head[ends[-1] + 1 :]


def _first_row(head: _Numbered, numeric: list[int], mark: str, comma: bool) -> int:
    """Return the number of the first line that has a number in each column of them."""
    for i, line in head:
        if not numeric or not _ROW.match(line):
            continue
        row = _split(line, mark)
        if len(row) <= numeric[-1]:
            continue
        if _numbers([row[k] for k in numeric], comma) == 1.0:
            return i
    wanted = (
        f"no column of numbers that begins by line {head[-1][0] + 1}; it "
        "should hold a column of forces"
    )
    raise InputError(
        f"line {head[0][0] + 1}, {shortened(head[0][1])!r}: found {wanted}"
    )


def _refuse_two_readings(sample: list[str], width: int) -> NoReturn:
    """Refuse rows whose commas may part columns or be decimal signs."""
    ways = (
        f"{width} columns, or fewer with decimal commas; write decimal points, or "
        "a line of names above, one to a column, as 'time (s),force (N)' (in "
        "Python say decimal=',' or delimiter=',', too)"
    )
    raise InputError(
        f"rows such as {shortened(sample[len(sample) // 2])!r} may hold {ways}"
    )


def _with_unit_of_cells(heading: Heading, unit: str, column: int) -> Heading:
    """Return the heading with the unit that stands in the cells of its column."""
    if not unit:
        return heading
    known = ratio(unit, heading.unit) if heading.unit else unit_named(unit)
    if not known:
        below = f" below the heading {heading.unit!r}" if heading.unit else ""
        raise InputError(
            f"column {column + 1} holds numbers in {unit!r}{below}; write one known "
            "unit, without blanks"
        )
    return heading._replace(unit=unit)


def _layout(
    sample: list[str], delimiter: str | None, decimal: str | None
) -> tuple[str, bool]:
    """What separates the columns, and whether the decimal sign is a comma: that by
    which most cells are numbers, and no number is left within a cell.
    """
    if decimal not in (None, ".", ","):
        raise InputError(f"decimal = {decimal!r}: must be '.' or ','")
    if delimiter is not None and (
        len(delimiter) != 1 or delimiter in ".\"'\r\n" or delimiter == decimal
    ):
        raise InputError(
            f"delimiter = {delimiter!r}: must be one character, such as ';', and no "
            "decimal sign"
        )
    marks = (
        [delimiter]
        if delimiter
        else [
            "\t",
            ";",
            "|",
            *(() if decimal == "," else ","),
            _BLANKS,
            _BEFORE_NUMBERS,
        ]
    )
    ways = [
        (mark, comma)
        for comma in (False, True)
        for mark in marks
        if decimal in (None, ".,"[comma])
    ]
    some = sample[:: len(sample) // _LOOKED_AT + 1]

    def fit(way: tuple[str, bool]) -> tuple[bool, float]:
        mark, comma = way
        rows = [_split(line, mark)[:_LOOKED_AT] for line in some]
        cut = sum(any(_holds_number(cell, comma) for cell in row) for row in rows)
        cells = (cell for row in rows for cell in row)
        return 2 * cut < len(rows), _numbers(cells, comma)

    return max(ways, key=fit)


def _holds_number(cell: str, comma: bool) -> bool:
    """Whether a number stands within a cell beside another mark between columns."""
    parts = re.split(r"[\t;|]", cell)
    return len(parts) > 1 and any(
        read_cell(part, comma)[0] is not None for part in parts
    )


def _as_wide(line: str, mark: str, width: int) -> list[str]:
    """The cells of a line above the table, one to a column; none if they are too
    few.
    """
    if mark not in (_BLANKS, _BEFORE_NUMBERS):
        # rows may leave out a last one for remarks, as LabVIEW's do
        found = [_split(line, mark)[:width]]
    else:  # names may hold blanks: look for other marks first
        found = [_split(line, other) for other in ",;\t" if other in line]
        found += [
            re.split(blanks, line.strip())
            for blanks in (r"\s{2,}", r"\s+(?![\[(])", r"\s+")
        ]
    return next((cells for cells in found if len(cells) == width), [])


def _labview(
    head: list[str], headings: list[Heading], numeric: list[int], mark: str, comma: bool
) -> float | None:
    """Time step from the head of a LabVIEW measurement file, which completes the
    headings, too.
    """
    told = {
        cells[0]: cells[1:]
        for line in head
        if (cells := _split(line, "\t" if mark.isspace() else mark))
    }
    if told.get("X_Columns", [])[:1] == ["One"] and not headings[numeric[0]].name:
        headings[numeric[0]] = Heading("X_Value")
    forces = [i for i in numeric if headings[i].quantity != "time"]
    for i, unit in zip(forces, told.get("Y_Unit_Label", []), strict=False):
        headings[i] = Heading(headings[i].name, headings[i].unit or unit.strip())
    return read_cell("".join(told.get("Delta_X", [])[:1]), comma)[0] or None


def _cells(
    rows: Any, count: int, columns: list[int], mark: str, comma: bool, *, quoted: bool
) -> pd.DataFrame:
    """The cells of columns, a row to each of so many lines; the last column takes
    what is too much in a row.
    """
    if mark == _BEFORE_NUMBERS:
        rows = re.sub(rb"(?<=\S)[ \t]+(?=[-+.\d])", b"\t", rows)
        mark = "\t"
    width = columns[-1]
    full = mark.join("0" * (width + 1)) + "\n"  # a row that has them all
    with suppress(pd.errors.ParserError):
        cells = pd.read_csv(
            io.BytesIO(b"".join([full.encode(), rows])),
            sep=r"\s+" if mark == _BLANKS else mark,
            decimal="," if comma else ".",
            header=None,
            names=range(width + 1),
            usecols=sorted(columns),
            dtype={width: "category"},
            skip_blank_lines=False,
            skipinitialspace=True,
            quoting=csv.QUOTE_MINIMAL if quoted else csv.QUOTE_NONE,
            encoding_errors="replace",
            # else pandas warns of texts among numbers, which are reported later
            low_memory=False,
        )[1:]
        if len(cells) == count:
            return cells
    raise InputError(
        f"{count} lines are not as many rows: a quotation mark is not closed, or a row "
        "is cut off"
    )


def _as_numbers(cells: "pd.Series[Any]", usual: str, comma: bool) -> Array:
    """The numbers of a column, NaN where a cell holds none, or one in another unit
    than usual.
    """

    def number(cell: Any) -> Any:
        if not isinstance(cell, str):  # of some parts pandas makes numbers
            return cell
        value, unit = read_cell(cell, comma)
        return value if unit in ("", usual) else None

    if cells.dtype.kind not in "fiu":
        cells = cells.map({cell: number(cell) for cell in cells.unique()})
    numbers = np.array(cells, dtype=float)
    numbers[np.isinf(numbers)] = np.nan
    return numbers
