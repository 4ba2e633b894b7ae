"""Reading of tables of numbers in texts that instruments write: first the layout is
detected from the head and a sample of the rows, then columns are read.
"""

from __future__ import annotations

import csv
import io
import math
import re
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
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
FEWEST_READINGS = 16  # fewest rows of a trace, and of a part of it
_LONGEST_LINE = 65_536  # most characters that are examined in a line
_SAMPLE = 400  # number of lines from which the columns are detected
_HEAD = 1000  # a table must start within this number of lines
_EXAMINED = 50  # number of rows, and of cells in each, from which a layout is chosen
_TALLEST_CELL = 8  # most lines of a heading in quotation marks
_LONGEST_NUMBER = 60  # most characters of a cell that may hold a number

_CONTROLS = bytes([*range(9), *range(13, 32), 127])
_ROW = re.compile(r"\s*(?![#%!]|//)\S")  # a line that is neither blank nor a comment
# the end of a line that precedes a blank line or a comment
_NO_ROW = re.compile(rb"\n[^\S\n]*(?=\n|[#%!]|//)")
_NUMBER = re.compile(
    r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)\s*([^\W\d_%°](?:[^,;\s]|\s(?![-+.\d])){0,11}|[%°])?"
)
_BLANKS, _BEFORE_NUMBERS = " ", "  "
"""Separators of columns other than one character: any blanks, or only the blanks before
a number, for cells that contain a number and a unit.
"""
_FORTRAN = str.maketrans("dD", "ee")  # 1.5D+01 means 15
_COMMAS = str.maketrans(".,", ",.")
_NONE = {"nan", "na", "n/a", "null", "none", "-", "--", "---", ""}
_NO_VALUE = _NONE | {"inf", "-inf", "+inf"}
"""Texts of cells without a value; those of `_NONE` mean that there was no reading."""
_NO_READING = re.compile(r"\D*|.*#.*")  # OL, overload, #DIV/0!, 1.#QNAN
# marks in numbers with a decimal point: 1'234.5, 1,234.5, but 1,234 may be 1.234
_BETWEEN_THOUSANDS = re.compile(
    r"(?<=\d)(?:['\u2019\u00a0\u202f](?=\d{3}(?!\d))|,(?=(?:\d{3},)*\d{3}\.\d))"
)
_THOUSANDS_OR_LESS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}|[^,]*")

# a key and its value
_STATEMENT = re.compile(r'[\s#%/!"]*([^:=\t;,"]+)["\s:=\t;,]+(.+)')
Numbered = list[tuple[int, str]]
"""Lines with their numbers, counted from 0."""


class Table(NamedTuple):
    """A table: its headings, the indices of its columns of numbers, the line number of
    each row, and the sampling interval in s if the file gives it.

    `read` returns columns by their indices, with NaN for a cell without a value, and
    infinity for a cell that cannot be read; `line` returns the text of a line; `notes`
    list the parts of the file that were left out.
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
        return ", ".join(shown[:12]) + (" ..." if len(shown) > 12 else "")


def read_cell(cell: str, comma: bool = False) -> tuple[float | None, str]:
    """Return number and unit of a cell, where a time of day is a number of seconds;
    None and an empty unit if the cell holds no finite number.
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
    first = unit.split()[0] if unit else ""
    known = not first or unit_named(first) or unit_size(first)
    return (value, unit) if known and math.isfinite(value) else (None, "")


class _Layout(NamedTuple):
    """The separator of the columns, and whether the decimal sign is a comma."""

    mark: str
    comma: bool

    def split(self, line: str) -> list[str]:
        """Return the cells of a line."""
        if self.mark == _BLANKS:
            return line.split()
        if self.mark == _BEFORE_NUMBERS:
            return re.split(r"\s+(?=[-+.\d])", line.strip())
        rows = csv.reader([line], delimiter=self.mark, skipinitialspace=True)
        return next(rows, [""])

    def numbers(self, cells: Iterable[str], none: float = 0.0) -> float:
        """Return the fraction of numbers among the cells with a value, or `none` if no
        cell has a value.
        """
        are_numbers = [
            read_cell(cell, self.comma)[0] is not None
            for cell in cells
            if cell.strip().lower() not in _NO_VALUE
        ]
        return sum(are_numbers) / len(are_numbers) if are_numbers else none

    def fit(self, lines: list[str]) -> tuple[bool, float]:
        """Return two measures of how well the layout fits lines: whether most lines
        have no cell with a number and another separator, and the mean over the lines
        of the fraction of numbers.
        """
        rows = [self.split(line)[:_EXAMINED] for line in lines]
        unsplit = sum(any(map(self._is_unsplit, row)) for row in rows)
        # a mean over lines, so that a line of many words has no larger weight
        return 2 * unsplit < len(rows), sum(map(self.numbers, rows)) / len(rows)

    def _is_unsplit(self, cell: str) -> bool:
        """Return whether a cell holds a number and another separator."""
        parts = re.split(r"[\t;|]", cell)
        return len(parts) > 1 and self.numbers(parts) > 0.0


class _Fit(NamedTuple):
    """The columns of a table: their layout, the indices of columns of numbers, the
    number of blank columns before the first filled one, the number of columns up to
    the last filled one, and the number of all columns.
    """

    layout: _Layout
    numeric: list[int]
    blank: int
    narrowest: int
    width: int

    def is_full(self, line: str) -> bool:
        """Return whether a line has a number in each column of numbers."""
        row = self.layout.split(line) if _ROW.match(line) else []
        cells = [row[k] for k in self.numeric if k < len(row)]
        is_whole = len(cells) == len(self.numeric) > 0
        return is_whole and self.layout.numbers(cells) == 1.0

    def cells_above(self, line: str) -> list[str]:
        """Return the names or units in a line above the table, one for each column;
        an empty list if there are too few, or a number is among them.
        """
        mark = self.layout.mark
        # remove the marks of a comment, but not a semicolon after an empty first name
        plain = line.lstrip("#%/! " if mark == ";" else "#%/!; ")
        if mark not in (_BLANKS, _BEFORE_NUMBERS):
            found = [self.layout.split(plain)]
        else:  # names may contain blanks: try other separators first
            found = [
                _Layout(each, False).split(plain) for each in ",;\t" if each in plain
            ]
            blanks = (r"\s{2,}", r"\s+(?![\[(])", r"\s+")
            found += [re.split(each, plain.strip()) for each in blanks]
            found = [cells for cells in found if len(cells) == self.width]
        for cells in found:
            # rows may lack the last column, for remarks, as in files of LabVIEW
            row = cells[: self.width] + [""] * (self.width - len(cells))
            is_text = not self.layout.numbers(row, none=1.0) or are_units(row)
            if len(cells) >= self.narrowest and is_text:
                return row
        return []


def as_utf8(raw: bytes) -> bytes:
    """Return the text of a file in UTF-8, with a line feed at the end of each line."""
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")) or raw[1:2] == b"\0":
        raw = raw.decode("utf-16", errors="replace").encode()
    raw = raw.removeprefix(b"\xef\xbb\xbf").rstrip(b"\x1a")  # DOS ends files by 1A
    try:
        raw.decode()
    except UnicodeDecodeError:
        # older instruments write µ and ° in Latin-1
        raw = raw.decode("latin-1").encode()
    raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    # a long file is copied only if that is necessary
    if not raw.endswith(b"\n"):
        raw += b"\n"
    if len(raw.translate(None, _CONTROLS)) < len(raw):
        raise InputError("is a binary file of an unknown kind: save the table as text")
    return raw


class _Lines(NamedTuple):
    """The lines of a text by their numbers, counted from 0."""

    raw: bytes
    begins: NDArray[np.int64]  # places of the first byte of each line, and of the end

    @property
    def total(self) -> int:
        """Number of lines."""
        return self.begins.size - 1

    def line(self, i: int) -> str:
        """Return the text of a line."""
        begin = self.begins[i]
        end = min(self.begins[i + 1] - 1, begin + _LONGEST_LINE)
        return self.raw[begin:end].decode(errors="replace")

    def head(self) -> Numbered:
        """Return the first lines that are not blank; lines of one cell in quotation
        marks are joined.
        """
        found = []
        end = 0
        for begin in range(min(self.total, _HEAD)):
            if begin < end:  # the line belongs to the cells above
                continue
            end = self._end_of_cells(begin)
            line = " ".join(map(self.line, range(begin, end)))
            if line.strip():
                found.append((begin, line))
        return found

    def _end_of_cells(self, begin: int) -> int:
        """Return the number of the line after the cells that begin in a line."""
        quotes = 0
        for i in range(begin, min(begin + _TALLEST_CELL, self.total)):
            quotes += self.line(i).count('"')
            if quotes % 2 == 0:
                return i + 1
        return begin + 1

    def sample(self, begin: int) -> list[str]:
        """Return rows among evenly spaced lines of the text, from `begin` on."""
        places = np.linspace(begin, self.total, _SAMPLE, endpoint=False)
        lines = map(self.line, np.unique(places.astype(int)).tolist())
        return [*filter(_ROW.match, lines)]


def read_text(
    raw: bytes, delimiter: str | None = None, decimal: str | None = None
) -> Table:
    """Return the table of the rows of numbers in a text; raises `InputError` if there
    are none.
    """
    raw = as_utf8(raw)
    octets = np.frombuffer(raw, dtype=np.uint8)
    lines = _Lines(raw, np.append(0, np.flatnonzero(octets == ord("\n")) + 1))
    head = lines.head()
    # text may stand above the rows: the first third of the lines is not sampled
    sample = lines.sample((2 * head[0][0] + lines.total) // 3) if head else []
    if not sample:
        raise InputError(
            "is empty, or holds blanks and comments only; it should hold a column of "
            "forces"
        )
    layout = find_layout(sample, delimiter, decimal)
    fit, columns = _fitted(layout, sample)
    start = _first_row(head, fit)
    above = [line for i, line in head if i < start]
    named = [row for line in above if (row := fit.cells_above(line))]
    if not decimal:
        # the first row may show that commas are decimal signs, as in 0,010
        first = layout.split(lines.line(start))
        numbers = [cell for i in fit.numeric for cell in (first[i], *columns[i])]
        _refuse_unclear_commas(fit, sample, numbers, bool(named or delimiter))
    headings = headings_of(named, fit.width)
    units = {}
    turns = {i: turn_of(columns[i][0]) for i in fit.numeric if ":" in columns[i][0]}
    for i in fit.numeric:
        units[i] = mode(read_cell(cell, layout.comma)[1] for cell in columns[i])
        if i in turns:  # the heading may contain the format hh:mm:ss instead of a unit
            headings[i] = Heading(headings[i].name or "time", "s")
        headings[i] = _with_unit_of_cells(headings[i], units[i], i)
    repeated = _repeated(lines, start, above, fit, headings)
    begins = lines.begins[start:-1]
    no_rows = [end.start() + 1 for end in _NO_ROW.finditer(raw, begins[0])]
    keep = ~np.isin(begins, [*no_rows, *lines.begins[repeated]])
    quoted = '"' in "".join(sample)
    return Table(
        with_coefficients(headings),
        fit.numeric,
        _Rows(lines, start, fit, quoted, keep, units, turns).read,
        np.flatnonzero(keep) + start + 1,
        lambda row: lines.line(row - 1).strip(),
        step_stated(above, layout.comma),
        _left_out(fit, above, repeated),
    )


def _left_out(fit: _Fit, above: list[str], repeated: list[int]) -> tuple[str, ...]:
    """Return notes of the lines above a table and in it that are left out."""
    notes = []
    if len(fit.numeric) > 1 and (others := sum(map(fit.is_full, above))):
        notes.append(f"rows of numbers above the table, left out: {others}")
    if repeated:
        notes.append(f"lines that repeat the head, left out: {len(repeated)}")
    return tuple(notes)


def _fitted(layout: _Layout, sample: list[str]) -> tuple[_Fit, list[tuple[str, ...]]]:
    """Return the columns of a sample of rows, and the cells of each."""
    cells = [layout.split(line) for line in sample]
    width = mode(map(len, cells))
    if width > MOST_COLUMNS:
        raise InputError(
            f"has {width} columns, more than {MOST_COLUMNS}; keep those of time and "
            "force"
        )
    columns = [*zip(*(row for row in cells if len(row) == width), strict=True)]
    numeric = [i for i, column in enumerate(columns) if layout.numbers(column) >= 0.5]
    filled = [i for i, column in enumerate(columns) if any(map(str.strip, column))]
    filled = filled or [0]  # all cells are blank
    return _Fit(layout, numeric, filled[0], filled[-1] + 1, width), columns


def _refuse_unclear_commas(
    fit: _Fit,
    sample: list[str],
    cells: list[str],
    separates: bool,
) -> None:
    """Refuse rows whose commas may be separators or decimal signs, unless commas are
    known to be separators, and numbers whose commas may be decimal signs or marks of
    thousands.
    """
    layout = fit.layout
    points = any("." in cell for cell in cells if ":" not in cell)
    is_known = layout.comma or separates or points
    if layout.mark == "," and fit.width > 1 and not is_known:
        raise InputError(
            f"rows such as {shortened(sample[len(sample) // 2])!r} may hold "
            f"{fit.width} columns, or fewer with decimal commas; "
            "write decimal points, or a line of names above, one for each column, as "
            "'time (s),force (N)' (in Python, or give decimal=',' or delimiter=',')"
        )
    with_comma = [cell for cell in cells if "," in cell]
    are_groups = map(_THOUSANDS_OR_LESS.fullmatch, with_comma)
    if layout.comma and with_comma and all(are_groups):
        raise InputError(
            f"cells such as {with_comma[0]!r} may hold thousands, or decimals after a "
            "comma: remove the commas of thousands, or give --decimal ',' (in Python "
            "decimal=',')"
        )


def _first_row(head: Numbered, fit: _Fit) -> int:
    """Return the number of the first line of the table: it has a number in each column
    of numbers, and no text in the blank columns before these. A few rows before a line
    of names belong to another table.
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
        f"that begins by line {head[-1][0] + 1}; the file should hold a column of "
        "forces"
    )


def _repeated(
    lines: _Lines,
    start: int,
    above: list[str],
    fit: _Fit,
    headings: list[Heading],
) -> list[int]:
    """Return the numbers of lines among the rows that begin like a line above them, as
    the head of another part of the data does; raises `InputError` if such a head gives
    another unit.
    """
    begins = {fit.layout.split(line.strip())[0].strip(' "') for line in above}
    texts = [re.escape(each.encode()) for each in begins if re.search(r"[^\W\d]", each)]
    if not texts:
        return []
    head = re.compile(rb'\n[^\S\n]*"?(?:' + b"|".join(texts) + rb")(?!\w)")
    matches = head.finditer(lines.raw, lines.begins[start])
    places = [match.start() + 1 for match in matches]
    repeated = []
    for i in np.searchsorted(lines.begins, places).tolist():
        line = lines.line(i)
        if len(fit.numeric) > 1 and fit.is_full(line):
            continue  # a row with a remark
        repeated.append(i)
        cells = fit.cells_above(line)
        others = headings_of([cells] if cells else [], fit.width)
        for known, new in zip(headings, others, strict=True):
            if known.unit and new.unit and ratio(new.unit, known.unit) != 1.0:
                raise InputError(
                    f"line {i + 1}: {shortened(line)!r} begins a table in "
                    f"{new.unit}, no longer in {known.unit}: keep one of the two"
                )
    return repeated


def _with_unit_of_cells(heading: Heading, unit: str, column: int) -> Heading:
    """Return the heading with the unit in the cells of its column, if they have one."""
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
    """Return the layout with the most numbers, among those that leave no number beside
    another separator in a cell.
    """
    if decimal not in (None, ".", ","):
        raise refused("decimal", decimal, "must be '.' or ','")
    marks = [delimiter or ""]
    if delimiter is None:
        # commas first: 10,508.2 are two numbers, unless another mark separates columns
        marks = [",", "\t", ";", "|", _BLANKS, _BEFORE_NUMBERS]
        marks = [mark for mark in marks if mark != decimal]
    elif len(delimiter) != 1 or delimiter in ".\"'\r\n" or delimiter == decimal:
        must = "must be one character, such as ';', and no decimal sign"
        raise refused("delimiter", delimiter, must)
    commas = [False, True] if decimal is None else [decimal == ","]
    some = sample[:: len(sample) // _EXAMINED + 1]
    layouts = (_Layout(mark, comma) for comma in commas for mark in marks)
    return max(layouts, key=lambda layout: layout.fit(some))


def step_stated(lines: Iterable[str], comma: bool = False) -> float | None:
    """Return the sampling interval in s that lines such as "Sampling rate: 100 Hz"
    give; None if they give no interval, or different ones.
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
    wrong = [
        text
        for text in beyond.cat.categories
        if read_cell(str(text), comma)[0] is not None or unit_named(str(text))
    ]
    return np.asarray(beyond.isin(wrong))


def _since_first(times: Array, turn: float) -> Array:
    """Return times since the first one. A time of day, which is less than `turn`, a day
    or an hour, starts again at each jump backwards.
    """
    known = np.isfinite(times)
    since = times[known]
    if since.max(initial=0.0) <= turn:
        leaps = np.diff(since, prepend=since[:1]) < -0.5 * turn
        since = since + turn * np.cumsum(leaps)
    times[known] = since - since[:1]
    return times


@dataclass(frozen=True)
class _Rows:
    """The rows of a table, whose columns are read when they are needed."""

    lines: _Lines
    start: int  # number of the first row
    fit: _Fit
    quoted: bool  # whether cells may stand in quotation marks
    keep: NDArray[np.bool_]  # which lines from `start` on are rows
    units: dict[int, str]  # that the cells of each column of numbers have
    turns: dict[int, float]  # at which the times of day of a column start again

    def read(self, places: list[int]) -> dict[int, Array]:
        """Return the numbers of some columns, with infinity for what is no number."""
        comma = self.fit.layout.comma
        cells = self._cells([*places, self.fit.width])
        surplus = _is_surplus(cells.pop(self.fit.width), comma)
        numbers = {}
        for i in places:
            values = _as_numbers(cells.pop(i), self.units[i], comma)
            values[surplus] = math.inf
            values = values[self.keep]
            turn = self.turns.get(i)
            numbers[i] = values if turn is None else _since_first(values, turn)
        return numbers

    def _cells(self, columns: list[int]) -> pd.DataFrame:
        """Return the cells of the given columns, one row for each line. The last column
        holds the rest of each line, after the columns of the table.
        """
        import pandas as pd

        lines = self.lines
        layout = self.fit.layout
        rows: Any = memoryview(lines.raw)[lines.begins[self.start] :]
        mark = layout.mark
        if mark == _BEFORE_NUMBERS:
            rows = re.sub(rb"(?<=\S)[ \t]+(?=[-+.\d])", b"\t", rows)
            mark = "\t"
        width = columns[-1]
        full = (
            mark.join("0" * (width + 1)) + "\n"
        )  # a row with all columns, dropped below
        count = lines.total - self.start
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
                quoting=csv.QUOTE_MINIMAL if self.quoted else csv.QUOTE_NONE,
                # read at once, as pandas otherwise warns of texts among the numbers
                low_memory=False,
            )[1:]
            if len(cells) == count:
                return cells
        raise InputError(
            f"{count} lines do not make {count} rows: a quotation mark is not closed, "
            "or a row is cut off"
        )


def _no_reading(texts: list[str]) -> set[str]:
    """Return the texts that mean "no reading": known ones, and others without digits if
    there are at most two, as a logger writes one, or one for each end of its range.
    """
    known = {text for text in texts if text.strip().strip('"').lower() in _NONE}
    others = {*filter(_NO_READING.fullmatch, texts)} - known
    return known | others if len(others) <= 2 else known


def _as_numbers(cells: pd.Series[Any], usual: str, comma: bool) -> Array:
    """Return the numbers of a column, with NaN for a cell without a value, and infinity
    for a cell that cannot be read, or has another unit than `usual`.
    """

    def number(cell: Any) -> Any:
        if isinstance(cell, int):  # pandas keeps integers beyond 64 bits
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
