"""Reading a table of numbers as instruments write them: first its layout, from its head
and a sample of its rows, then its columns.
"""

from __future__ import annotations

import csv
import io
import math
import re
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from statistics import mode
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import InputError, refused, shortened
from stickslip.io.clocks import seconds_of, turn_of
from stickslip.io.headings import (
    Heading,
    are_units,
    count_named,
    headings_of,
    ratio,
    step_named,
    unit_named,
    with_coefficients,
)
from stickslip.model.quantities import unit_size

if TYPE_CHECKING:
    import pandas as pd

MOST_COLUMNS = 1000
FEWEST_READINGS = 16  # in a table of a trace; also in a part of one
_LONGEST_LINE = 65_536  # characters of a line that are looked at
_SAMPLE = 400  # lines looked at to find out how a table is laid out
_HEAD = 1000  # lines among which a table must start
_LOOKED_AT = 50  # rows, and cells of each, by which a layout is chosen
_TALLEST_CELL = 8  # lines of a heading in quotation marks
_LONGEST_NUMBER = 60  # characters of a cell that may hold a number

_CONTROLS = bytes([*range(9), *range(13, 32), 127])
_ROW = re.compile(r"\s*(?![#%!]|//)\S")  # a line that is neither blank nor a comment
# the end of a line that is followed by a blank line or a comment
_NO_ROW = re.compile(rb"\n[^\S\n]*(?=\n|[#%!]|//)")
_NUMBER = re.compile(
    r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)\s*([^\W\d_%°](?:[^,;\s]|\s(?![-+.\d])){0,11}|[%°])?"
)
_BLANKS, _BEFORE_NUMBERS = " ", "  "
"""Separators of columns that are not one character: any blanks, or only the blanks
before a number, if units follow the numbers.
"""
_FORTRAN = str.maketrans("dD", "ee")  # 1.5D+01 means 15
_COMMAS = str.maketrans(".,", ",.")
_NONE = {"nan", "na", "n/a", "null", "none", "-", "--", "---", ""}
_NO_VALUE = _NONE | {"inf", "-inf", "+inf"}
"""What stands for no value; the first of them for one that was not taken."""
_NO_READING = re.compile(r"\D*|.*#.*")  # OL, overload, #DIV/0!, 1.#QNAN
# of a number with decimal points: 1'234.5, 1,234.5, but 1,234 may be less than two
_BETWEEN_THOUSANDS = re.compile(
    r"(?<=\d)(?:['\u2019\u00a0\u202f](?=\d{3}(?!\d))|,(?=(?:\d{3},)*\d{3}\.\d))"
)
_THOUSANDS_OR_LESS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}|[^,]*")

# a key, and what stands behind it
_STATEMENT = re.compile(r'[\s#%/!"]*([^:=\t;,"]+)["\s:=\t;,]+(.+)')
Numbered = list[tuple[int, str]]
"""Lines with their numbers, from zero."""


class Table(NamedTuple):
    """A table: its headings, the indices of its columns of numbers, the line number of
    each row, and the sampling interval in s if the file holds it.

    `read` returns columns by their indices, with NaN for a cell without a value, and
    infinity for one that cannot be read; `line` returns the text of a line; `notes`
    name the parts of the file that were left out.
    """

    headings: list[Heading]
    numeric: list[int]
    read: Callable[[list[int]], dict[int, Array]]
    rows: NDArray[np.int64]
    line: Callable[[int], str]
    step: float | None = None
    notes: tuple[str, ...] = ()

    def listed(self) -> str:
        """Return the numbers and names of the columns, for a message."""
        shown = []
        for i, heading in enumerate(self.headings):
            named = f"{i + 1} '{heading}'" if heading.name else f"{i + 1}"
            none = "" if i in self.numeric else " (no numbers such as 1234.5)"
            shown.append(named + none)
        return ", ".join(shown[:12] or ["none"]) + (" ..." if len(shown) > 12 else "")


def read_cell(cell: str, comma: bool = False) -> tuple[float | None, str]:
    """Return number and unit of a cell, a time of day in seconds; None and an empty
    unit if it holds no finite number.
    """
    cell = cell.strip().strip('="').replace("\N{MINUS SIGN}", "-")
    if len(cell) > _LONGEST_NUMBER:
        return None, ""
    # try times before decimal commas are replaced: 25.04.2026 has points, too
    if (seconds := seconds_of(cell)) is not None:
        return seconds, "s"
    plain = cell.translate(_COMMAS) if comma else cell
    match = _NUMBER.fullmatch(_BETWEEN_THOUSANDS.sub("", plain))
    if match is None:
        return None, ""
    value = float(match[1].translate(_FORTRAN))
    unit = (match[2] or "").strip()
    words = unit.split()
    known = not words or any(unit_named(word) or unit_size(word) for word in words)
    return (value, unit) if known and math.isfinite(value) else (None, "")


class _Layout(NamedTuple):
    """Separator of the columns, and whether the decimal sign is a comma."""

    mark: str
    comma: bool

    def split(self, line: str) -> list[str]:
        if self.mark == _BLANKS:
            return line.split()
        if self.mark == _BEFORE_NUMBERS:
            return re.split(r"\s+(?=[-+.\d])", line.strip())
        rows = csv.reader([line], delimiter=self.mark, skipinitialspace=True)
        return next(rows, [""])

    def numbers(self, cells: Iterable[str], none: float = 0.0) -> float:
        """Return the fraction of the cells that hold numbers; cells that stand for no
        value are left out.
        """
        are_numbers = [
            read_cell(cell, self.comma)[0] is not None
            for cell in cells
            if cell.strip().lower() not in _NO_VALUE
        ]
        return sum(are_numbers) / len(are_numbers) if are_numbers else none

    def fit(self, lines: list[str]) -> tuple[bool, float]:
        """Return two measures of how well it parts lines: whether few of them hold a
        number within a cell beside another mark, and the fraction of the cells of a
        line that are numbers, on average.
        """
        rows = [self.split(line)[:_LOOKED_AT] for line in lines]
        cut = sum(any(map(self._is_cut, row)) for row in rows)
        # by lines: a line of text counts alike, however many words it has
        return 2 * cut < len(rows), sum(map(self.numbers, rows)) / len(rows)

    def _is_cut(self, cell: str) -> bool:
        """Whether a cell holds a number and another separator."""
        parts = re.split(r"[\t;|]", cell)
        return len(parts) > 1 and self.numbers(parts) > 0.0


class _Fit(NamedTuple):
    """How lines fit to the columns of a table: their layout, the columns of numbers,
    how many are always blank before the first, how many reach to the last that is not,
    and how many there are.
    """

    layout: _Layout
    numeric: list[int]
    blank: int
    narrowest: int
    width: int

    def is_full(self, line: str) -> bool:
        """Whether a line has a number in each of the columns of numbers."""
        row = self.layout.split(line) if _ROW.match(line) else []
        cells = [row[k] for k in self.numeric if k < len(row)]
        is_whole = len(cells) == len(self.numeric) > 0
        return is_whole and self.layout.numbers(cells) == 1.0

    def cells_above(self, line: str) -> list[str]:
        """The names or units in a line above the table, one to a column; none if these
        are too few, or there is a number among them.
        """
        mark = self.layout.mark
        # the marks of a comment, but no column without a name
        plain = line.lstrip("#%/! " if mark == ";" else "#%/!; ")
        if mark not in (_BLANKS, _BEFORE_NUMBERS):
            found = [self.layout.split(plain)]
        else:  # names may hold blanks: look for other marks first
            found = [
                _Layout(each, False).split(plain) for each in ",;\t" if each in plain
            ]
            blanks = (r"\s{2,}", r"\s+(?![\[(])", r"\s+")
            found += [re.split(each, plain.strip()) for each in blanks]
            found = [cells for cells in found if len(cells) == self.width]
        for cells in found:
            # rows may leave out a last one for remarks, as LabVIEW's do
            row = cells[: self.width] + [""] * (self.width - len(cells))
            is_text = not self.layout.numbers(row, none=1.0) or are_units(row)
            if len(cells) >= self.narrowest and is_text:
                return row
        return []


def as_utf8(raw: bytes) -> bytes:
    """The text of a file in UTF-8, its lines ended by a line feed."""
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")) or raw[1:2] == b"\0":
        raw = raw.decode("utf-16", errors="replace").encode()
    raw = raw.removeprefix(b"\xef\xbb\xbf").rstrip(b"\x1a")  # the end of a file of DOS
    try:
        raw.decode()
    except UnicodeDecodeError:
        # units such as µ, written by older instruments
        raw = raw.decode("latin-1").encode()
    raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    # without need, no copy is made of a long file
    if not raw.endswith(b"\n"):
        raw += b"\n"
    if len(raw.translate(None, _CONTROLS)) < len(raw):
        raise InputError("is a binary file of an unknown kind: save the table as text")
    return raw


class _Lines(NamedTuple):
    """The lines of a text, by their number from zero."""

    raw: bytes
    begins: NDArray[np.int64]  # where each line begins, and where the text ends

    @property
    def total(self) -> int:
        return self.begins.size - 1

    def line(self, i: int) -> str:
        begin = self.begins[i]
        end = min(self.begins[i + 1] - 1, begin + _LONGEST_LINE)
        return self.raw[begin:end].decode(errors="replace")

    def head(self) -> Numbered:
        """The first lines that are not blank; a cell in quotation marks may go over
        several.
        """
        found = []
        end = 0
        for i in range(min(self.total, _HEAD)):
            if i < end:
                continue
            end = self._end_of_cells(i)
            line = " ".join(map(self.line, range(i, end)))
            if line.strip():
                found.append((i, line))
        return found

    def _end_of_cells(self, begin: int) -> int:
        """Return the line after the last one of the cells of a line."""
        quotes = 0
        for i in range(begin, min(begin + _TALLEST_CELL, self.total)):
            quotes += self.line(i).count('"')
            if quotes % 2 == 0:
                return i + 1
        return begin + 1

    def sample(self, begin: int) -> list[str]:
        """Return rows from evenly spaced lines of the text, from `begin` on."""
        places = np.linspace(begin, self.total, _SAMPLE, endpoint=False)
        lines = map(self.line, np.unique(places.astype(int)).tolist())
        return [*filter(_ROW.match, lines)]


def read_text(
    raw: bytes, delimiter: str | None = None, decimal: str | None = None
) -> Table:
    """Read the rows of numbers in a text, and their headings; `InputError` if there
    are none.
    """
    raw = as_utf8(raw)
    octets = np.frombuffer(raw, dtype=np.uint8)
    lines = _Lines(raw, np.append(0, np.flatnonzero(octets == ord("\n")) + 1))
    head = lines.head()
    # there may be text above: rows are looked for in the last third of a head
    sample = lines.sample((2 * head[0][0] + lines.total) // 3) if head else []
    if not sample:
        raise InputError(
            "is empty, or holds blanks and comments only; it should hold a column of "
            "forces"
        )
    layout = find_layout(sample, delimiter, decimal)
    cells = [layout.split(line) for line in sample]
    width = mode(map(len, cells))
    if width > MOST_COLUMNS:
        raise InputError(
            f"has {width} columns, more than {MOST_COLUMNS}; keep those of time and "
            "force"
        )
    columns = [*zip(*(row for row in cells if len(row) == width), strict=True)]
    numeric = [i for i, column in enumerate(columns) if layout.numbers(column) >= 0.5]
    filled = [i for i, column in enumerate(columns) if any(map(str.strip, column))] or [
        0
    ]
    fit = _Fit(layout, numeric, filled[0], filled[-1] + 1, width)
    start = _first_row(head, fit)
    above = [line for i, line in head if i < start]
    named = [row for line in above if (row := fit.cells_above(line))]
    if not decimal:
        first = layout.split(lines.line(start))  # 0,010 has no thousands
        numbers = [cell for i in numeric for cell in (first[i], *columns[i])]
        _refuse_unclear_commas(layout, sample, numbers, bool(named or delimiter))
    headings = headings_of(named, width)
    units = {}
    clocks = {i: turn_of(columns[i][0]) for i in numeric if ":" in columns[i][0]}
    for i in numeric:
        units[i] = mode(read_cell(cell, layout.comma)[1] for cell in columns[i])
        if i in clocks:  # the heading may hold the format hh:mm:ss instead of a unit
            headings[i] = Heading(headings[i].name or "time", "s")
        headings[i] = _with_unit_of_cells(headings[i], units[i], i)
    quoted = '"' in "".join(sample)
    begins = lines.begins[start:-1]
    ends = [end.start() + 1 for end in _NO_ROW.finditer(raw, begins[0])]
    again = _repeated(lines, start, above, fit, headings)
    keep = ~np.isin(begins, [*ends, *lines.begins[again]])

    others = sum(map(fit.is_full, above)) if len(numeric) > 1 else 0
    notes = {
        f"rows of numbers above the table, left out: {others}": others,
        f"lines that repeat the head, left out: {len(again)}": len(again),
    }

    def read(places: list[int]) -> dict[int, Array]:
        cells = _cells(lines, start, [*places, width], layout, quoted=quoted)
        surplus = _is_surplus(cells.pop(width), layout.comma)
        numbers = {}
        for i in places:
            values = _as_numbers(cells.pop(i), units[i], layout.comma)
            values[surplus] = math.inf
            values = values[keep]
            numbers[i] = _since_first(values, clocks[i]) if i in clocks else values
        return numbers

    return Table(
        with_coefficients(headings),
        numeric,
        read,
        np.flatnonzero(keep) + start + 1,
        lambda row: lines.line(row - 1).strip(),
        step_stated(above, layout.comma),
        tuple(note for note, count in notes.items() if count),
    )


def _refuse_unclear_commas(
    layout: _Layout,
    sample: list[str],
    cells: list[str],
    separates: bool,
) -> None:
    """Refuse rows whose commas may separate columns or decimals, unless it is known
    that they separate columns, and those that may have decimals or thousands.
    """
    points = any("." in cell for cell in cells if ":" not in cell)
    columns = len(layout.split(sample[-1]))
    if layout.mark == "," and columns > 1 and not (layout.comma or separates or points):
        raise InputError(
            f"rows such as {shortened(sample[len(sample) // 2])!r} may hold "
            f"{columns} columns, or fewer with decimal commas; "
            "write decimal points, or a line of names above, one to a column, as 'time "
            "(s),force (N)' (in Python say decimal=',' or delimiter=',', too)"
        )
    with_comma = [cell for cell in cells if "," in cell]
    are_groups = map(_THOUSANDS_OR_LESS.fullmatch, with_comma)
    if layout.comma and with_comma and all(are_groups):
        raise InputError(
            f"cells such as {with_comma[0]!r} may hold thousands, or decimals behind a "
            "comma: write no marks between thousands, or say --decimal ',' (in Python "
            "decimal=',')"
        )


def _first_row(head: Numbered, fit: _Fit) -> int:
    """Return the number of the first line that has a number in each column of them, and
    nothing in blank ones before them; a few rows before a line of names belong to
    another table.
    """
    rows = list[int]()
    for i, line in head:
        if fit.is_full(line) and not any(fit.layout.split(line)[: fit.blank]):
            rows.append(i)
        elif rows and count_named(fit.cells_above(line)) > 1:
            rows.clear()
        if len(rows) == FEWEST_READINGS:
            break
    if rows:
        return rows[0]
    raise InputError(
        f"line {head[0][0] + 1}, {shortened(head[0][1])!r}: found no column of numbers "
        f"that begins by line {head[-1][0] + 1}; it should hold a column of forces"
    )


def _repeated(
    lines: _Lines,
    start: int,
    above: list[str],
    fit: _Fit,
    headings: list[Heading],
) -> list[int]:
    """Return the lines among the rows that begin as one above them does: the head of
    another part of the data; `InputError` if it names another unit.
    """
    begins = {fit.layout.split(line.strip())[0].strip(' "') for line in above}
    texts = [re.escape(each.encode()) for each in begins if re.search(r"[^\W\d]", each)]
    if not texts:
        return []
    head = re.compile(rb'\n[^\S\n]*"?(?:' + b"|".join(texts) + rb")(?!\w)")
    matches = head.finditer(lines.raw, lines.begins[start])
    places = [match.start() + 1 for match in matches]
    again = []
    for i in np.searchsorted(lines.begins, places).tolist():
        line = lines.line(i)
        if len(fit.numeric) > 1 and fit.is_full(line):
            continue  # a row with a remark
        again.append(i)
        cells = fit.cells_above(line)
        other = headings_of([cells], len(headings)) if cells else []
        for known, new in zip(headings, other, strict=False):
            if known.unit and new.unit and ratio(new.unit, known.unit) != 1.0:
                raise InputError(
                    f"line {i + 1}: {shortened(line)!r} begins a table in "
                    f"{new.unit}, no longer in {known.unit}: keep one of the two"
                )
    return again


def _with_unit_of_cells(heading: Heading, unit: str, column: int) -> Heading:
    """Return the heading with the unit that is written in the cells of its column."""
    if not unit:
        return heading
    if not (ratio(unit, heading.unit) if heading.unit else unit_named(unit)):
        below = f" below the heading {heading.unit!r}" if heading.unit else ""
        raise InputError(
            f"column {column + 1} holds numbers in {unit!r}{below}; write one known "
            "unit, without blanks"
        )
    return heading._replace(unit=unit)


def find_layout(
    sample: list[str], delimiter: str | None = None, decimal: str | None = None
) -> _Layout:
    """The layout by which most cells are numbers, and no number is left in a cell."""
    if decimal not in (None, ".", ","):
        raise refused("decimal", decimal, "must be '.' or ','")
    marks = [delimiter or ""]
    if delimiter is None:
        # commas first: 10,508.2 are two numbers, if nothing else parts the rows
        marks = [",", "\t", ";", "|", _BLANKS, _BEFORE_NUMBERS]
        marks = [mark for mark in marks if mark != decimal]
    elif len(delimiter) != 1 or delimiter in ".\"'\r\n" or delimiter == decimal:
        must = "must be one character, such as ';', and no decimal sign"
        raise refused("delimiter", delimiter, must)
    commas = [False, True] if decimal is None else [decimal == ","]
    some = sample[:: len(sample) // _LOOKED_AT + 1]
    layouts = (_Layout(mark, comma) for comma in commas for mark in marks)
    return max(layouts, key=lambda layout: layout.fit(some))


def step_stated(lines: Iterable[str], comma: bool = False) -> float | None:
    """Sampling interval in s that lines such as "Sampling rate: 100 Hz" state; None if
    they state none, or several.
    """
    steps = set()
    for line in lines:
        found = _STATEMENT.match(line)
        if found is None:
            continue
        key = Heading.read(found[1])
        text = re.split(r'[\t;"]' if comma else r'[\t;",]', found[2])[0]
        value, unit = read_cell(re.sub(r"[][()]", "", text), comma)
        step = step_named(key.name, value or 0.0, unit or key.unit)
        if step:
            steps.add(step)
    return steps.pop() if len(steps) == 1 else None


def _is_surplus(beyond: pd.Series[Any], comma: bool) -> NDArray[np.bool_]:
    """Return a mask of rows with a number or a unit beyond the last column, which makes
    all numbers of the row unreliable.
    """
    texts = [str(text) for text in beyond.cat.categories]
    wrong = [
        read_cell(text, comma)[0] is not None or unit_named(text) is not None
        for text in texts
    ]
    return np.isin(beyond.cat.codes, np.flatnonzero(wrong))


def _since_first(times: Array, turn: float) -> Array:
    """Return times since the first one; at each jump backwards, a time of day starts
    again after `turn`, a day or an hour.
    """
    known = np.isfinite(times)
    since = times[known]
    if since.max(initial=0.0) <= turn:
        leaps = np.diff(since, prepend=since[:1]) < -0.5 * turn
        since = since + turn * np.cumsum(leaps)
    times = times.copy()
    times[known] = since - since[:1]
    return times


def _cells(
    lines: _Lines, start: int, columns: list[int], layout: _Layout, *, quoted: bool
) -> pd.DataFrame:
    """Return the cells of some columns, one row for each line; those of the last
    column hold what follows the columns of the table.
    """
    import pandas as pd

    rows: Any = memoryview(lines.raw)[lines.begins[start] :]
    mark = layout.mark
    if mark == _BEFORE_NUMBERS:
        rows = re.sub(rb"(?<=\S)[ \t]+(?=[-+.\d])", b"\t", rows)
        mark = "\t"
    width = columns[-1]
    full = mark.join("0" * (width + 1)) + "\n"  # a row with all columns, dropped below
    count = lines.total - start
    with suppress(pd.errors.ParserError):
        cells = pd.read_csv(
            io.BytesIO(b"".join([full.encode(), rows])),
            sep=r"\s+" if mark == _BLANKS else mark,
            decimal="," if layout.comma else ".",
            header=None,
            names=range(width + 1),
            usecols=columns,
            dtype={width: "category"},
            skip_blank_lines=False,
            skipinitialspace=True,
            quoting=csv.QUOTE_MINIMAL if quoted else csv.QUOTE_NONE,
            encoding_errors="replace",
            # otherwise pandas warns of texts among numbers, which are reported later
            low_memory=False,
        )[1:]
        if len(cells) == count:
            return cells
    raise InputError(
        f"{count} lines are not as many rows: a quotation mark is not closed, or a row "
        "is cut off"
    )


def _no_reading(texts: list[str]) -> set[str]:
    """Return the texts of cells that stand for no reading: known ones, and others
    without digits, of which a logger writes one, or one for either end of its range.
    """
    known = {text for text in texts if text.strip().strip('"').lower() in _NONE}
    others = {*filter(_NO_READING.fullmatch, texts)} - known
    return known | others if len(others) <= 2 else known


def _as_numbers(cells: pd.Series[Any], usual: str, comma: bool) -> Array:
    """Return the numbers of a column: NaN for a cell without a value, infinity for one
    that cannot be read or has another unit than usual.
    """

    def number(cell: Any) -> Any:
        if isinstance(cell, int):  # pandas leaves integers beyond 64 bits as they are
            return cell if abs(cell) < sys.float_info.max else math.inf
        if not isinstance(cell, str):  # pandas has read some of the cells as numbers
            return cell
        if cell in words:
            return math.nan
        value, unit = read_cell(cell, comma)
        return math.inf if value is None or unit not in ("", usual) else value

    if cells.dtype.kind not in "fiu":
        words = _no_reading([cell for cell in cells.unique() if isinstance(cell, str)])
        cells = cells.map({cell: number(cell) for cell in cells.unique()})
    return np.array(cells, dtype=float)
