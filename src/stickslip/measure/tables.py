"""A table of numbers as instruments write them: text, a spreadsheet, or a TDMS file.

How a table is laid out is found once, from its head and a sample of its rows; its columns are then read as asked for.
"""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
import math
import re
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, shortened
from stickslip.io import files
from stickslip.measure.arrays import Array
from stickslip.measure.headings import Heading, ratio, simple, unit_named, units_in, with_coefficients
from stickslip.model.quantities import unit_size

if TYPE_CHECKING:
    import pandas as pd

LARGEST_FILE = 100_000_000  # bytes
LONGEST_LINE = 65_536  # characters
MOST_COLUMNS = 1000
_SAMPLE = 400  # lines looked at to find out how a table is laid out
_HEAD = 1000  # lines among which a table must start
_LONGEST_NUMBER = 60  # characters of a cell that may hold a number

_OTHER_FILES = {
    b"\x89HDF": "NetCDF or HDF5 file, not a table in text; open it as a run",
    b"CDF": "NetCDF or HDF5 file, not a table in text; open it as a run",
    b"\xd0\xcf\x11\xe0": "spreadsheet of the old kind (.xls); save it as .xlsx, or as CSV",
}
_CONTROLS = bytes([*range(9), *range(13, 32), 127])
_COMMENT = re.compile(r"\s*(#|%|//|!)+\s*")
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)\s*([^\W\d_%°][^,;\t]{0,11}|[%°])?")
_FORTRAN = str.maketrans("dD", "ee")  # 1.5D+01 is 15
_COMMAS = str.maketrans(".,", ",.")
_REMARKS = {"", "comment", "comments", "remark", "remarks", "note", "notes", "kommentar", "bemerkung"}
"""Names of a last column that the rows leave out: LabVIEW's are ``X_Value``, ``Force`` and ``Comment``."""
_NO_VALUE = {"nan", "inf", "-inf", "+inf", "na", "n/a", "null", "none", "-", "--", "---", ""}

Columns = tuple[dict[int, Array], NDArray[np.int64]]


class Table(NamedTuple):
    """A table whose layout is known: its headings, its columns of numbers, and the step in s where the file says so.

    `read` returns columns as numbers, NaN where a cell holds none, and the line of each row; `line` the text of one.
    """

    place: str
    headings: list[Heading]
    numeric: list[int]
    read: Callable[[Iterable[int]], Columns]
    line: Callable[[int], str]
    step: float | None = None

    def listed(self) -> str:
        """The columns of numbers, for a message."""
        shown = [f"{i + 1}" + (f" '{self.headings[i]}'" if self.headings[i].name else "") for i in self.numeric[:12]]
        return ", ".join(shown) + (" ..." if len(self.numeric) > 12 else "")


def read_table(place: str, delimiter: str | None, decimal: str | None) -> Table:
    """Find out how a file is laid out; `InputError` if it is no table."""
    raw = files.read(place, "force trace", largest=LARGEST_FILE)
    for start, what in _OTHER_FILES.items():
        if raw.startswith(start):
            raise InputError(f"{place}: is a {what}")
    if raw.startswith(b"TDSm"):
        return _of_tdms(place)
    if raw.startswith(b"PK\x03\x04"):
        raw, delimiter, decimal = _of_spreadsheet(place, raw), "\t", "."
    return _of_text(place, _Lines(place, _as_utf8(place, raw)), delimiter, decimal)


# ---------------------------------------------------------------------------------------------------------------------
# Cells
# ---------------------------------------------------------------------------------------------------------------------


def read_cell(cell: str, comma: bool = False) -> tuple[float | None, str]:
    """Number and unit of a cell; no number, and no unit, where it holds none that is finite."""
    cell = cell.strip().strip('"').replace("\N{MINUS SIGN}", "-")
    match = _NUMBER.fullmatch(cell.translate(_COMMAS) if comma else cell) if len(cell) <= _LONGEST_NUMBER else None
    value = float(match[1].translate(_FORTRAN)) if match else math.nan
    return (value, (match[2] or "").strip()) if match and math.isfinite(value) else (None, "")


def _split(line: str, mark: str | None) -> list[str]:
    """The cells of a line; None for blanks."""
    return line.split() if mark is None else next(csv.reader([line], delimiter=mark, skipinitialspace=True), [""])


def _is_number(cell: str, comma: bool) -> bool | None:
    """Whether a cell holds a number; None where it says that it has none."""
    return None if cell.strip().lower() in _NO_VALUE else read_cell(cell, comma)[0] is not None


def _most(values: Sequence[Any]) -> Any:
    """The value that most have."""
    return Counter(values).most_common(1)[0][0]


# ---------------------------------------------------------------------------------------------------------------------
# Text
# ---------------------------------------------------------------------------------------------------------------------


def _as_utf8(place: str, raw: bytes) -> bytes:
    """The text of a file in UTF-8, its lines ended by a line feed."""
    marked = raw.startswith((b"\xff\xfe", b"\xfe\xff"))
    if marked or (len(raw) > 64 and not any(raw[1:1000:2])):
        raw = raw.decode("utf-16" if marked else "utf-16-le", errors="replace").encode()
    raw = raw.removeprefix(b"\xef\xbb\xbf").rstrip(b"\x1a")  # the end of a file of DOS
    try:
        raw.isascii() or raw.decode()
    except UnicodeDecodeError:
        raw = raw.decode("latin-1").encode()  # units such as µ, written by older instruments
    if b"\r" in raw:
        raw = raw.replace(b"\r\n" if b"\n" in raw else b"\r", b"\n")
    if len(raw.translate(None, _CONTROLS)) < len(raw):
        first = min(at for byte in _CONTROLS if (at := raw.find(byte)) >= 0)
        line = raw.count(b"\n", 0, first) + 1
        raise InputError(f"{place}: line {line} holds the byte {chr(raw[first])!r}: a binary file; export it as text")
    return raw


class _Lines:
    """The lines of a text, counted from 0, which are never all held as Python's strings."""

    def __init__(self, place: str, raw: bytes) -> None:
        found = np.flatnonzero(np.frombuffer(raw, dtype=np.uint8) == 10)
        self.raw, self.ends = raw, found if raw.endswith(b"\n") else np.append(found, len(raw))
        length = np.diff(self.ends, prepend=-1)
        longest = int(length.argmax())
        if length[longest] > LONGEST_LINE:
            raise InputError(
                f"{place}: line {longest + 1} has {length[longest]:,} characters, more than {LONGEST_LINE:,}: "
                "no row of a trace; one row to a line, and the columns of time and force are enough"
            )

    def __len__(self) -> int:
        return int(self.ends.size)

    def begin(self, i: int) -> int:
        return int(self.ends[i - 1]) + 1 if i else 0

    def __getitem__(self, i: int) -> str:
        return self.raw[self.begin(i) : int(self.ends[i])].decode(errors="replace")


def _of_text(place: str, lines: _Lines, delimiter: str | None, decimal: str | None) -> Table:
    """Find the rows of numbers in a text, and their headings."""
    head = [(i, line) for i in range(min(len(lines), _HEAD)) if (line := lines[i]).strip()]
    ends = [k for k, (_, line) in enumerate(head) if line.startswith("***End_of_Header***")]
    labview, head = (head[: ends[-1]], head[ends[-1] + 1 :]) if ends else ([], head)
    content = [(i, line) for i, line in head if not _COMMENT.match(line)]
    if len(lines) <= _HEAD:  # a sample from all over the file but its beginning, where text may stand
        sample = [line for _, line in content[len(content) // 3 :]]
    else:
        taken = [lines[i] for i in np.linspace(len(lines) // 3, len(lines) - 1, _SAMPLE).astype(int).tolist()]
        sample = [line for line in taken if line.strip() and not _COMMENT.match(line)]
    if not sample:
        raise InputError(f"{place}: is empty, or holds blanks and comments only; it should hold a column of forces")
    titles = [line for _, line in content if not re.search(r"\d", line)]
    mark, comma = _layout(place, sample, titles, delimiter, decimal)
    cells = [_split(line, mark) for line in sample]
    width = _most([len(row) for row in cells])
    if width > MOST_COLUMNS:
        raise InputError(f"{place}: has {width} columns, more than {MOST_COLUMNS}; keep those of time and force")
    columns = [[row[i] for row in cells if len(row) == width] for i in range(width)]
    are_numbers = [[known for cell in column if (known := _is_number(cell, comma)) is not None] for column in columns]
    numeric = [i for i, are in enumerate(are_numbers) if sum(are) >= max(min(0.5 * len(are), len(are) - 3), 1)]
    if not numeric:
        raise InputError(
            f"{place}: line {content[0][0] + 1}, {shortened(content[0][1])!r}: found no column of numbers in "
            f"{len(lines)} rows; it should hold a column of forces"
        )
    start = next((i for i, line in content if _is_row(_split(line, mark), numeric, comma)), None)
    if start is None:
        raise InputError(
            f"{place}: the numbers start only after line {head[-1][0] + 1}; leave the text before them out"
        )
    above = [_COMMENT.sub("", line, count=1) for i, line in head if i < start]
    headings = _headings(above, mark, width, numeric, comma)
    headings, step = _labview([line for _, line in labview], headings, numeric, mark, comma)
    rows = _Rows(place, lines, start, mark, comma, '"' in "".join(sample), width, {}, {})
    for i in numeric:
        rows.beside[i] = _words_beside(i, columns, numeric) if mark is None else []
        texts = [" ".join(parts) for parts in zip(columns[i], *(columns[j] for j in rows.beside[i]), strict=True)]
        rows.units[i] = unit = _most([read_cell(text, comma)[1] for text in texts])
        if not unit:
            continue
        if not unit_named(unit):
            raise InputError(
                f"{place}: column {i + 1} holds numbers in {unit!r}; write one unit, known and without blanks"
            )
        if headings[i].unit and not ratio(unit, headings[i].unit):
            raise rows.another_unit(i, start, unit, f"below the heading {headings[i].unit!r}")
        headings[i] = headings[i]._replace(unit=unit)
    headings = with_coefficients(headings)
    return Table(place, headings, numeric, rows.read, lambda number: lines[number - 1].strip(), step)


def _is_row(cells: list[str], numeric: list[int], comma: bool) -> bool:
    """Whether a line is a row of the table: numbers in its columns of numbers."""
    found = [_is_number(cell, comma) for i, cell in enumerate(cells) if i in numeric]
    return len(found) == len(numeric) and any(found) and False not in found


def _words_beside(i: int, columns: list[list[str]], numeric: list[int]) -> list[int]:
    """The columns behind one of numbers that hold its unit, where blanks separate columns."""

    def holds_unit(j: int) -> bool:
        word = _most(columns[j])
        return j not in numeric and word != "-" and bool(unit_named(word) or unit_size(word))

    return [*itertools.takewhile(holds_unit, range(i + 1, len(columns)))]


def _layout(
    place: str, sample: list[str], titles: list[str], delimiter: str | None, decimal: str | None
) -> tuple[str | None, bool]:
    """What separates the columns (None for blanks), and whether the decimal sign is a comma; `titles` hold no digit."""
    if decimal not in (None, ".", ","):
        raise InputError(f"decimal = {decimal!r}: must be '.' or ','")
    if delimiter is not None and (len(delimiter) != 1 or delimiter in ".\"'\r\n" or delimiter == decimal):
        raise InputError(f"delimiter = {delimiter!r}: must be one character, such as ';', and no decimal sign")

    def consistent(mark: str | None) -> int:
        """How many columns a mark makes of most lines; 0 if it makes one, or not as many of them."""
        widths = [len(_split(line, mark)) for line in sample]
        width: int = _most(widths)
        return width if width > 1 and widths.count(width) >= 0.8 * len(widths) else 0

    joined = "\n".join(sample)
    mark = delimiter or next((mark for mark in "\t;|" if consistent(mark)), None)
    if mark is None and decimal != "," and (width := consistent(",")):
        points = decimal == "." or "." in joined
        names = {len(_split(line, ",")) for line in titles}  # "time,force" tells two columns
        halved = f" below {width // 2} names" if width % 2 == 0 and width // 2 in names - {1} else ""
        whole = [all(read_cell(cell)[0] is not None for cell in line.split(",")) for line in sample]
        either = bool(halved) or (width % 2 == 0 and ", " not in joined and _most(whole))
        if not points and width not in names and either:
            raise InputError(
                f"{place}: rows such as {shortened(sample[len(sample) // 2])!r} may hold {width} columns{halved} or "
                f"{width // 2} with decimal commas; export with ';' or with decimal points, or say decimal=',' or "
                "delimiter=','"
            )
        mark = "," if points or ", " in joined or not consistent(None) else None
    mark = None if mark == " " else mark
    cells = "\n".join(cell for line in sample for cell in _split(line, mark))
    if decimal is None and re.search(r"\d,\d", cells) and not re.search(r"\d\.\d", cells):
        decimal = ","
    return mark, decimal == ","


# ---------------------------------------------------------------------------------------------------------------------
# Headings
# ---------------------------------------------------------------------------------------------------------------------


def _headings(above: list[str], mark: str | None, width: int, numeric: list[int], comma: bool) -> list[Heading]:
    """Names and units of the columns, from the lines just above the table that have as many cells."""
    rows = [cells for line in above if (cells := _as_wide(line, mark, width, numeric))]
    told = [cells for cells in rows if False in [_is_number(cell, comma) for cell in cells]]
    units = units_in(told[-1], below_names=len(rows) > 1) if told else []
    if units:
        told.pop()
    found = map(Heading.read, told[-1] if told else [""] * width)
    return [Heading(each.name, unit or each.unit) for each, unit in zip(found, units or [""] * width, strict=True)]


def _as_wide(line: str, mark: str | None, width: int, numeric: list[int]) -> list[str] | None:
    """The cells of a line above the table, one to a column; None if they are not as many."""
    found = [_split(line, mark)]
    if mark is None:  # names may hold blanks: look for other marks first
        found = [_split(line, other) for other in ",;\t" if other in line]
        found += [re.split(r"\s+(?![\[(])", line.strip()), line.split(), [line.strip()]]
    for cells in found:
        if len(cells) == width + 1 and simple(cells[-1]) in _REMARKS:
            cells = cells[:-1]
        if len(cells) == width:
            return cells
        if mark is None and len(cells) == len(numeric):
            named = dict(zip(numeric, cells, strict=True))
            return [named.get(i, "") for i in range(width)]
    return None


def _labview(
    head: list[str], headings: list[Heading], numeric: list[int], mark: str | None, comma: bool
) -> tuple[list[Heading], float | None]:
    """Units and time step from the head of a LabVIEW measurement file."""
    told = {cells[0]: cells[1:] for line in head if (cells := _split(line, mark or "\t"))}
    found = list(headings)
    if told.get("X_Columns", [])[:1] == ["One"] and not found[numeric[0]].name:
        found[numeric[0]] = Heading("X_Value")
    forces = [i for i in numeric if found[i].quantity != "time"]
    for i, unit in zip(forces, told.get("Y_Unit_Label", []), strict=False):
        found[i] = Heading(found[i].name, found[i].unit or unit.strip())
    return found, read_cell("".join(told.get("Delta_X", [])[:1]), comma)[0] or None


# ---------------------------------------------------------------------------------------------------------------------
# Rows
# ---------------------------------------------------------------------------------------------------------------------


class _Rows(NamedTuple):
    """Where the rows of a text start, what separates their columns (None: blanks), and the units in the cells.

    Of a column of numbers `beside` are the columns behind it that hold its unit.
    """

    place: str
    lines: _Lines
    start: int
    mark: str | None
    comma: bool
    quoted: bool
    width: int
    units: dict[int, str]
    beside: dict[int, list[int]]

    def read(self, columns: Iterable[int]) -> Columns:
        """The numbers of some columns, and the line of each row; blank lines and comments are left out."""
        parts = {i: [i, *self.beside[i]] for i in columns}
        cells = self._cells(parts.values())
        beyond = cells[self.width]
        surplus = [text for text in beyond.cat.categories if not isinstance(text, str) or self._counts(text)]
        values = {}
        for i, several in parts.items():
            texts = cells.pop(i) if several == [i] else cells[several].fillna("").agg(" ".join, axis=1)
            values[i] = self._numbers(i, texts)
            values[i][beyond.isin(surplus)] = math.nan
        keep = np.logical_or.reduce([np.isfinite(numbers) for numbers in values.values()])
        begins = np.append(self.lines.begin(self.start), self.lines.ends[self.start : -1] + 1)
        comments = np.isin(np.frombuffer(self.lines.raw, dtype=np.uint8)[begins], list(b"#%/!"))
        for row in np.flatnonzero(~keep | comments).tolist():
            line = self.lines[self.start + row]
            keep[row] = bool(line.strip()) and not _COMMENT.match(line)
        if not keep.all():
            values = {i: numbers[keep] for i, numbers in values.items()}
        return values, np.flatnonzero(keep) + self.start + 1

    def _cells(self, parts: Iterable[list[int]]) -> pd.DataFrame:
        """The cells of columns, those of several parts as text; a column beyond the last takes what is too much."""
        import pandas as pd

        kinds: dict[int, Any] = {i: str for several in parts if several[1:] for i in several}
        full = (self.mark or " ").join("0" * (self.width + 1)) + "\n"  # a row that has them all
        rows = memoryview(self.lines.raw)[self.lines.begin(self.start) :]
        count = len(self.lines) - self.start
        with warnings.catch_warnings(), contextlib.suppress(pd.errors.ParserError):
            warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # texts among numbers are told of later
            cells = pd.read_csv(
                io.BytesIO(b"".join([full.encode(), rows])),
                sep=self.mark or r"\s+",
                decimal="," if self.comma else ".",
                header=None,
                names=range(self.width + 1),
                usecols=sorted({self.width, *itertools.chain(*parts)}),
                dtype={self.width: "category"} | kinds,
                skip_blank_lines=False,
                skipinitialspace=True,
                quoting=csv.QUOTE_MINIMAL if self.quoted else csv.QUOTE_NONE,
                encoding_errors="replace",
            )[1:]
            if len(cells) == count:
                return cells
        raise InputError(
            f"{self.place}: {count} lines from line {self.start + 1} on are not as many rows of {self.width} columns: "
            "a quotation mark is not closed, or a row is cut off"
        )

    def _counts(self, text: str) -> bool:
        """Whether a cell too many is a number or a unit, so that its row cannot be read, and no remark."""
        return unit_named(text) is not None or read_cell(text, self.comma)[0] is not None

    def _numbers(self, column: int, cells: pd.Series[Any]) -> Array:
        """The numbers of a column, NaN where a cell holds none or has behind it what is no unit of the column."""
        import pandas as pd

        usual = self.units[column]

        def number(cell: str) -> float:
            value, unit = read_cell(cell, self.comma)
            if unit not in ("", usual) and unit_named(unit):
                among = f"among {usual!r}" if usual else "among numbers without a unit"
                raise self.another_unit(column, self.start + int(np.argmax(cells == cell)), unit, among)
            return math.nan if value is None or unit not in ("", usual) else value

        if cells.dtype.kind in "fiu":
            values: Array = cells.to_numpy(dtype=float, copy=True)
        else:  # of some parts pandas makes numbers
            text = np.array([isinstance(cell, str) for cell in cells])
            values = np.full(text.size, math.nan)
            values[~text] = cells[~text].to_numpy(dtype=float)
            which, texts = pd.factorize(cells[text])
            values[text] = np.array([number(cell) for cell in texts])[which]
        values[np.isinf(values)] = math.nan
        return values

    def another_unit(self, column: int, line: int, unit: str, beside: str) -> InputError:
        """What to raise for a unit that leaves open what the numbers of a column are in."""
        return InputError(
            f"{self.place}: line {line + 1}, {shortened(self.lines[line])!r}: column {column + 1} holds {unit!r} "
            f"{beside}; write one unit of one kind"
        )


# ---------------------------------------------------------------------------------------------------------------------
# Files that are no text
# ---------------------------------------------------------------------------------------------------------------------


def _of_spreadsheet(place: str, raw: bytes) -> bytes:
    """The sheet with most numbers of an .xlsx file, as text separated by tabs."""
    import pandas as pd

    try:
        sheets = pd.read_excel(io.BytesIO(raw), sheet_name=None, header=None, engine="openpyxl")
    except ImportError:
        raise InputError(
            f"{place}: is a spreadsheet; `pip install openpyxl` to read .xlsx, or export the table as CSV"
        ) from None
    except Exception as error:  # openpyxl lets errors of zip, XML and its own through
        raise InputError(f"{place}: is no spreadsheet that can be read ({error}); export the table as CSV") from None

    sheet = max(sheets.values(), key=lambda sheet: sheet.apply(pd.to_numeric, errors="coerce").count().sum())
    plain = sheet.replace(r"[\t\r\n\"]", " ", regex=True)
    text: str = plain.to_csv(sep="\t", header=False, index=False, quoting=csv.QUOTE_NONE)
    return text.encode()


def _of_tdms(place: str) -> Table:
    """The channels of numbers in a TDMS file, of those that are equally long."""
    try:
        import nptdms
    except ImportError:
        raise InputError(f"{place}: is a TDMS file; `pip install npTDMS` to read it, or export it as text") from None
    try:
        channels = [channel for group in nptdms.TdmsFile.read(place).groups() for channel in group.channels()]
        found = [channel for channel in channels if len(channel) and np.issubdtype(channel[:].dtype, np.number)]
    except Exception as error:  # npTDMS lets errors of struct and its own through
        raise InputError(f"{place}: is no TDMS file that can be read ({error}); export it as text") from None
    if not found:
        raise InputError(f"{place}: holds no channel of numbers; it should hold one of forces")
    length = _most([len(channel) for channel in found])
    found = [channel for channel in found if len(channel) == length]
    headings = []
    for channel in found:
        heading, of_channel = Heading.read(channel.name), channel.properties
        unit = str(of_channel.get("unit_string", "") or of_channel.get("NI_UnitDescription", ""))
        headings.append(Heading(heading.name, unit or heading.unit))
    steps = {float(step) for channel in found if (step := channel.properties.get("wf_increment"))}
    return Table(
        place=place,
        headings=with_coefficients(headings),
        numeric=list(range(len(found))),
        read=lambda columns: ({i: np.array(found[i][:], dtype=float) for i in columns}, np.arange(1, length + 1)),
        line="sample {}".format,
        step=steps.pop() if len(steps) == 1 else None,
    )
