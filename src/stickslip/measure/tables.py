"""A table of numbers as instruments write them: text, a spreadsheet, or a TDMS file."""

from __future__ import annotations

import csv
import io
import math
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, shortened
from stickslip.io import files
from stickslip.measure.arrays import Array
from stickslip.measure.headings import Heading, coefficients_without_unit, is_units_row, ratio, simple, unit_named

if TYPE_CHECKING:
    import pandas as pd

LARGEST_FILE = 100_000_000  # bytes
LONGEST_LINE = 65_536  # characters
MOST_COLUMNS = 1000
_SAMPLE = 400  # lines looked at to find out how a table is laid out
_HEAD = 1000  # lines among which a table must start
_LONGEST_NUMBER = 60  # characters of a cell that may hold a number

_ONE_COMMA = re.compile(r"^\s*[-+]?\d+,\d+\s*(?:[^\W\d].*)?$", re.MULTILINE)
_OTHER_FILES = {
    b"\x89HDF": "NetCDF or HDF5 file, not a table in text; open it as a run",
    b"CDF": "NetCDF or HDF5 file, not a table in text; open it as a run",
    b"\xd0\xcf\x11\xe0": "spreadsheet of the old kind (.xls); save it as .xlsx, or as CSV",
}
_COMMENT = re.compile(r"^\s*(#|%|//|!)+\s*")
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?)\s*([^\W\d_%°][^,;\t]{0,11}|[%°])?")
_FORTRAN = str.maketrans("dD", "ee")  # 1.5D+01 is 15
_REMARKS = {"", "comment", "comments", "remark", "remarks", "note", "notes", "kommentar", "bemerkung"}
"""Names of a last column that the rows leave out: LabVIEW's are ``X_Value``, ``Force`` and ``Comment``."""
_NO_VALUE = {"nan", "inf", "-inf", "+inf", "na", "n/a", "null", "none", "-", "--", "---", ""}


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Columns that were asked for: numbers (NaN where a cell holds none), units, and the line of each row."""

    values: dict[int, Array]
    units: dict[int, str]
    lines: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table whose layout is known: its headings, its columns of numbers, and the step in s where the file says so."""

    place: str
    headings: list[Heading]
    numeric: list[int]
    source: _Text | dict[int, Array]
    step: float | None = None

    @classmethod
    def read(cls, place: str, delimiter: str | None, decimal: str | None) -> Table:
        """Find out how a file is laid out; `InputError` if it is no table."""
        raw = _bytes(place)
        if raw.startswith(b"TDSm"):
            return _tdms(place)
        if raw.startswith(b"PK\x03\x04"):
            raw, delimiter, decimal = _spreadsheet(place, raw), "\t", "."
        return _of_text(_Text.of(place, raw), delimiter, decimal)

    def rows(self, columns: Iterable[int]) -> Rows:
        """Read some columns."""
        if isinstance(self.source, _Text):
            return self.source.rows(self.headings, sorted(set(columns)))
        values = {i: self.source[i] for i in columns}
        lines = np.arange(1, next(iter(values.values())).size + 1, dtype=np.int64)
        return Rows(values=values, units={i: self.headings[i].unit for i in columns}, lines=lines)

    def line(self, number: int) -> str:
        """Text of a line, counted from 1."""
        return self.source.line(number - 1).strip() if isinstance(self.source, _Text) else f"sample {number}"

    def listed(self) -> str:
        """The columns of numbers, for a message."""
        shown = [f"{i + 1}" + (f" '{self.headings[i]}'" if self.headings[i].name else "") for i in self.numeric[:12]]
        return ", ".join(shown) + (" ..." if len(self.numeric) > 12 else "")


# ---------------------------------------------------------------------------------------------------------------------
# A text
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Text:
    """A text by its lines, which are never all held as Python's strings; where its rows start, and how they part."""

    place: str
    raw: bytes
    ends: NDArray[np.int64]
    start: int = 0  # first line of the rows, from 0
    mark: str | None = None  # between columns; None for blanks
    comma: bool = False  # as the decimal sign
    quoted: bool = False
    width: int = 0
    labels: Sequence[str] = ()  # of columns of text that hold one unit

    @classmethod
    def of(cls, place: str, raw: bytes) -> _Text:
        """The text of a file in UTF-8, its lines ended by a line feed."""
        raw = _as_utf8(place, raw)
        found = np.flatnonzero(np.frombuffer(raw, dtype=np.uint8) == 10)
        ends = found if found.size and found[-1] == len(raw) - 1 else np.append(found, len(raw))
        length = np.diff(ends, prepend=-1)
        longest = int(length.argmax())
        if length[longest] > LONGEST_LINE:
            raise InputError(
                f"{place}: line {longest + 1} has {length[longest]:,} characters, more than {LONGEST_LINE:,}: "
                "no row of a trace; one row to a line, and the columns of time and force are enough"
            )
        return cls(place=place, raw=raw, ends=ends)

    def __len__(self) -> int:
        return int(self.ends.size)

    def line(self, i: int) -> str:
        """A line, counted from 0."""
        begin = int(self.ends[i - 1]) + 1 if i else 0
        return self.raw[begin : int(self.ends[i])].decode(errors="replace").rstrip("\r")

    def rows(self, headings: Sequence[Heading], columns: Sequence[int]) -> Rows:
        """Read some columns; blank lines and comments are left out."""
        # Where blanks part the columns, a unit in a cell is a column of its own, behind that of the number.
        labels = [*self.labels, *[""] * (self.width + 2)]
        beside = {i: i + 1 for i in columns if labels[i + 1]}
        for i in beside:
            if unit_named(labels[i + 2]):
                unit = f"{labels[i + 1]} {labels[i + 2]}"
                raise InputError(
                    f"{self.place}: column {i + 1} holds numbers in {unit!r}; write one unit without blanks"
                )
        frame = self._frame([*columns, *beside.values(), self.width])
        count = len(self) - self.start
        if len(frame) != count:
            raise InputError(
                f"{self.place}: {count} lines from line {self.start + 1} on make {len(frame)} rows: "
                "a quotation mark is not closed, or a row is cut off"
            )
        beyond = frame[self.width]
        surplus = np.isfinite(_numbers(beyond, self.comma)[0])
        if self.mark is None:
            surplus |= beyond.map(lambda cell: isinstance(cell, str) and unit_named(cell) is not None).to_numpy(bool)
        values, units = {}, {}
        for i in columns:
            values[i], cells = _numbers(frame[i], self.comma)
            if i in beside:
                cells = frame[beside[i]].astype(str)
            values[i][surplus] = math.nan
            units[i] = self._one_unit(i, values[i], cells, headings[i].unit, label=i in beside)
        keep = np.logical_or.reduce([np.isfinite(numbers) for numbers in values.values()])
        for row in np.flatnonzero(~keep).tolist():
            line = self.line(self.start + row)
            keep[row] = bool(line.strip()) and not _COMMENT.match(line)
        if not keep.all():
            values = {i: numbers[keep] for i, numbers in values.items()}
        return Rows(values=values, units=units, lines=np.flatnonzero(keep) + self.start + 1)

    def _frame(self, columns: Sequence[int]) -> pd.DataFrame:
        """Cells of the rows; a column beyond the last takes what is too much."""
        import pandas as pd

        begin = int(self.ends[self.start - 1]) + 1 if self.start else 0
        full = (self.mark or " ").join("0" * (self.width + 1)) + "\n"  # a row that has them all
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # texts among numbers are told of later
            try:
                cells = pd.read_csv(
                    io.BytesIO(full.encode() + self.raw[begin:]),
                    sep=r"\s+" if self.mark is None else self.mark,
                    decimal="," if self.comma else ".",
                    header=None,
                    names=range(self.width + 1),
                    usecols=sorted(columns),
                    skip_blank_lines=False,
                    skipinitialspace=True,
                    quoting=csv.QUOTE_MINIMAL if self.quoted else csv.QUOTE_NONE,
                    encoding_errors="replace",
                )
            except pd.errors.ParserError as error:
                reason = shortened(" ".join(str(error).split()))
                raise InputError(f"{self.place}: its rows do not have {self.width} columns ({reason})") from None
        return cells[1:]

    def _one_unit(self, column: int, values: Array, cells: pd.Series[str] | None, head: str, *, label: bool) -> str:
        """The one unit of a column of numbers; `InputError` where its cells have several, or leave it open."""
        if cells is None:
            return head
        cells = cells.where(np.isfinite(values), "")

        def refuse(unit: str, what: str) -> None:
            line = self.start + int(np.flatnonzero(cells == unit)[0]) + 1
            raise InputError(
                f"{self.place}: line {line}, {short(self.line(line - 1).strip())!r}: column {column + 1} holds "
                f"{unit!r}{what}; write one unit of one kind"
            )

        count = cells.value_counts()
        bare = int(np.isfinite(values).sum() - count.drop("", errors="ignore").sum())
        named = count.drop("", errors="ignore")
        usual = str(named.index[0]) if named.size and named.iloc[0] >= bare else ""
        for unit in named.index:
            known = unit_named(unit)
            if unit != usual and known:
                refuse(unit, f" among {usual!r}" if usual else " among numbers without a unit")
            if unit == usual and not known and "/" in unit:
                refuse(unit, "")
            if unit != usual or not (label or known):  # a cell that holds more than a number and its unit is none
                values[cells == unit] = math.nan
        if not unit_named(usual):
            return head
        if head and not ratio(usual, head):
            refuse(usual, f" below the heading {head!r}")
        return usual


def _numbers(column: pd.Series[Any], comma: bool) -> tuple[Array, pd.Series[str] | None]:
    """The numbers of a column, NaN where a cell holds none, and their units; None where it is one of bare numbers."""
    import pandas as pd

    if column.dtype.kind in "fiu":
        values = column.to_numpy(dtype=float, copy=True)
        values[np.isinf(values)] = math.nan
        return values, None
    which, texts = pd.factorize(column.to_numpy(), use_na_sentinel=False)
    read = [read_cell(str(text), comma) for text in texts]
    values = np.array([math.nan if value is None else value for value, _ in read])[which]
    return values, pd.Series(np.array([unit for _, unit in read], dtype=object)[which], index=column.index)


def read_cell(cell: str, comma: bool) -> tuple[float | None, str]:
    """Number and unit of a cell; no number, and no unit, where it holds none that is finite."""
    cell = cell.strip().strip('"').replace("\N{MINUS SIGN}", "-")
    match = _NUMBER.fullmatch(cell.replace(",", ".") if comma else cell) if len(cell) <= _LONGEST_NUMBER else None
    value = float(match[1].translate(_FORTRAN)) if match else math.nan
    return (value, (match[2] or "").strip()) if match and math.isfinite(value) else (None, "")


def short(text: str) -> str:
    """A text cut to what a message bears."""
    text = text.strip()
    return text if len(text) <= 40 else text[:37] + "..."


# ---------------------------------------------------------------------------------------------------------------------
# Bytes
# ---------------------------------------------------------------------------------------------------------------------


def _bytes(place: str) -> bytes:
    """The content of a file, or one clear line on why there is none."""
    raw = files.read(place, "force trace", largest=LARGEST_FILE)
    if not raw:
        raise InputError(f"{place}: is empty; it should hold a column of forces")
    for start, what in _OTHER_FILES.items():
        if raw.startswith(start):
            raise InputError(f"{place}: is a {what}")
    return raw


def _as_utf8(place: str, raw: bytes) -> bytes:
    """The text of a file in UTF-8, its lines ended by a line feed."""
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            raw = raw.decode("utf-16").encode()
        except UnicodeDecodeError:
            raise InputError(f"{place}: starts as UTF-16 text but is none; export it again as text") from None
    elif len(raw) > 64 and not any(raw[1:1000:2]):  # UTF-16 without its mark
        raw = raw.decode("utf-16-le", errors="replace").encode()
    raw = raw.removeprefix(b"\xef\xbb\xbf")
    if raw.rstrip().endswith(b"\x1a"):  # the end of a file of DOS
        raw = raw.rstrip().rstrip(b"\x1a")
    try:
        raw.decode()
    except UnicodeDecodeError:
        raw = raw.decode("latin-1").encode()  # units such as µ, written by older instruments
    if strange := re.search(rb"[\x00-\x08\x0e-\x1f\x7f]", raw):
        line = raw.count(b"\n", 0, strange.start()) + 1
        raise InputError(
            f"{place}: line {line} holds the byte {strange.group().decode()!r}: a binary file; export it as text"
        )
    if not raw.strip():
        raise InputError(f"{place}: holds blanks only; it should hold a column of forces")
    return raw


# ---------------------------------------------------------------------------------------------------------------------
# Layout of a text
# ---------------------------------------------------------------------------------------------------------------------


def _of_text(text: _Text, delimiter: str | None, decimal: str | None) -> Table:
    """Find the rows of numbers in a text, and their headings."""
    place = text.place
    head = [(i, line) for i in range(min(len(text), _HEAD)) if (line := text.line(i)).strip()]
    ends = [k for k, (_, line) in enumerate(head) if line.startswith("***End_of_Header***")]
    labview, head = (head[: ends[-1]], head[ends[-1] + 1 :]) if ends else ([], head)
    content = [(i, line) for i, line in head if not _COMMENT.match(line)]
    sample = _sample(text, content)
    if not sample:
        raise InputError(f"{place}: holds comments only; it should hold a column of forces")
    titles = [line for _, line in content if not re.search(r"\d", line)]
    mark, comma = _layout(place, sample, titles, delimiter, decimal)
    cells = split(sample, mark)
    width = _most([len(row) for row in cells])
    if width > MOST_COLUMNS:
        raise InputError(f"{place}: has {width} columns, more than {MOST_COLUMNS}; keep those of time and force")
    names = {len(row) for row in split(titles, ",")} if mark == "," and "." not in "".join(sample) else set()
    if width % 2 == 0 and width // 2 in names - {1}:
        raise InputError(
            f"{place}: rows such as {short(sample[-1])!r} have {width} columns below {width // 2} names: a comma "
            "cannot be both the decimal sign and what separates the columns; export with ';' or with decimal points"
        )
    columns = [[row[i] for row in cells if i < len(row)] for i in range(width)]
    numeric = [i for i, column in enumerate(columns) if _mostly_numbers(column, comma)]
    if not numeric:
        raise InputError(
            f"{place}: line {content[0][0] + 1}, {short(content[0][1])!r}: found no column of numbers in {len(text)} "
            "rows; it should hold a column of forces"
        )
    start = next((i for i, line in content if _is_row(split([line], mark)[0], numeric, comma)), None)
    if start is None:
        raise InputError(
            f"{place}: the numbers start only after line {head[-1][0] + 1}; leave the text before them out"
        )
    labels = ["" if i in numeric else _label(column) for i, column in enumerate(columns)]
    headings = _headings([_COMMENT.sub("", line) for i, line in head if i < start], mark, width, numeric, comma)
    for i in numeric:  # units in the cells tell the columns, too
        unit = _most([read_cell(cell, comma)[1] for cell in columns[i]])
        unit = unit or (labels[i + 1] if mark is None and i + 1 < width else "")
        if not headings[i].unit and unit_named(unit):
            headings[i] = Heading(name=headings[i].name, unit=unit)
    headings, step = _labview([line for _, line in labview], coefficients_without_unit(headings), numeric, mark, comma)
    source = replace(
        text, start=start, mark=mark, comma=comma, quoted='"' in "".join(sample), width=width,
        labels=labels if mark is None else (),
    )  # fmt: skip
    return Table(place=place, headings=headings, numeric=numeric, source=source, step=step)


def _sample(text: _Text, content: list[tuple[int, str]]) -> list[str]:
    """Some lines from all over the file but its beginning, where text may stand."""
    if len(text) <= _HEAD:
        return [line for _, line in content[len(content) // 3 :]]
    lines = [text.line(i) for i in np.linspace(len(text) // 3, len(text) - 1, _SAMPLE).astype(int).tolist()]
    return [line for line in lines if line.strip() and not _COMMENT.match(line)]


def _most(values: Sequence[Any]) -> Any:
    """The value that most have."""
    return Counter(values).most_common(1)[0][0]


def _layout(
    place: str, sample: list[str], titles: list[str], delimiter: str | None, decimal: str | None
) -> tuple[str | None, bool]:
    """What separates the columns (None for blanks), and whether the decimal sign is a comma; `titles` hold no digit."""
    if decimal not in (None, ".", ","):
        raise InputError(f"decimal = {decimal!r}: must be '.' or ','")
    if delimiter is not None:
        if len(delimiter) != 1 or delimiter in ".\"'\r\n" or delimiter == decimal:
            raise InputError(f"delimiter = {delimiter!r}: must be one character, such as ';', and no decimal sign")
        mark = None if delimiter == " " else delimiter
        return mark, decimal == "," or (decimal is None and _decimal_commas(split(sample, mark)))

    def consistent(mark: str | None) -> bool:
        width, count = Counter(len(row) for row in split(sample, mark)).most_common(1)[0]
        return width > 1 and count >= 0.8 * len(sample)

    joined = "\n".join(sample)
    mark = next((mark for mark in "\t;|" if consistent(mark)), None)
    if mark is None and decimal != "," and consistent(","):
        points = decimal == "." or "." in joined or ", " in joined
        named = any(len(cells) == 2 for cells in split(titles, ","))  # "time,force" tells two columns
        if not points and not named and len(re.findall(_ONE_COMMA, joined)) >= 0.8 * len(sample):
            raise InputError(
                f"{place}: rows such as {short(sample[-1])!r} may hold two columns or one decimal comma; say "
                "decimal=',' or delimiter=','"
            )
        mark = "," if points or not consistent(None) else None
    return mark, decimal == "," or (decimal is None and _decimal_commas(split(sample, mark)))


def _decimal_commas(cells: list[list[str]]) -> bool:
    joined = "\n".join(cell for row in cells for cell in row)
    return bool(re.search(r"\d,\d", joined)) and not re.search(r"\d\.\d", joined)


def split(contents: Sequence[str], mark: str | None) -> list[list[str]]:
    """Part lines into cells."""
    if mark is None:
        return [content.split() for content in contents]
    if '"' in "".join(contents[:50]):
        return [next(csv.reader([content], delimiter=mark, skipinitialspace=True), [""]) for content in contents]
    return [content.rstrip("\r\n").split(mark) for content in contents]


def _holds_none(cell: str) -> bool:
    return cell.strip().lower() in _NO_VALUE


def _mostly_numbers(column: list[str], comma: bool) -> bool:
    """Whether most cells of a column hold numbers, cells that say "no value" left aside."""
    filled = [cell for cell in column if not _holds_none(cell)]
    count = sum(read_cell(cell, comma)[0] is not None for cell in filled)
    return count > 0 and (count >= 0.5 * len(filled) or count >= len(filled) - 3)


def _is_row(row: list[str], numeric: list[int], comma: bool) -> bool:
    """Whether a line is a row of the table: numbers in its columns of numbers."""
    cells = [row[i] if i < len(row) else "no number" for i in numeric]
    found = [read_cell(cell, comma)[0] is not None for cell in cells]
    return any(found) and all(number or _holds_none(cell) for number, cell in zip(found, cells, strict=True))


def _label(column: list[str]) -> str:
    """The unit that most cells of a column of text hold, if they are units, or all the same."""
    text, count = Counter(column).most_common(1)[0]
    return text if unit_named(text) or count >= 0.9 * len(column) else ""


# ---------------------------------------------------------------------------------------------------------------------
# Headings
# ---------------------------------------------------------------------------------------------------------------------


def _headings(heads: list[str], mark: str | None, width: int, numeric: list[int], comma: bool) -> list[Heading]:
    """Names and units of the columns, from the lines just above the table that have as many cells."""
    rows = [cells for line in heads if (cells := _as_wide(line, mark, width, numeric))]
    told = [cells for cells in rows if not all(_holds_none(c) or read_cell(c, comma)[0] is not None for c in cells)]
    units = [""] * width
    if told and is_units_row(told[-1], below_names=len(rows) > 1):
        units = [cell.strip().strip('"').strip("[]() ") for cell in told.pop()]
    found = map(Heading.read, told[-1] if told else [""] * width)
    return [Heading(name=each.name, unit=unit or each.unit) for each, unit in zip(found, units, strict=True)]


def _as_wide(line: str, mark: str | None, width: int, numeric: list[int]) -> list[str] | None:
    """The cells of a line above the table, one to a column; None if they are not as many."""
    found: list[list[str]] = []
    if mark is None:  # names may hold blanks: look for other marks first
        found += [cells for other in ",;\t" if other in line for cells in split([line], other)]
        found.append(re.split(r"\s+(?![\[(])", line.strip()))
    found += split([line], mark)
    if mark is None and len(numeric) == 1:
        found.append([line.strip()])
    for cells in found:
        if len(cells) == width + 1 and simple(cells[-1]) in _REMARKS:
            cells = cells[:-1]
        if len(cells) == width or (mark is None and len(cells) == len(numeric)):
            columns = range(width) if len(cells) == width else numeric
            wide = [""] * width
            for i, cell in zip(columns, cells, strict=True):
                wide[i] = cell
            return wide
    return None


def _labview(
    head: list[str], headings: list[Heading], numeric: list[int], mark: str | None, comma: bool
) -> tuple[list[Heading], float | None]:
    """Units and time step from the head of a LabVIEW measurement file."""
    told, found = {cells[0]: cells[1:] for cells in split(head, mark or "\t")}, list(headings)
    if told.get("X_Columns", [])[:1] == ["One"] and not found[numeric[0]].name:
        found[numeric[0]] = Heading(name="X_Value")
    forces = [i for i in numeric if found[i].quantity != "time"]
    for i, unit in zip(forces, told.get("Y_Unit_Label", []), strict=False):
        found[i] = Heading(name=found[i].name, unit=found[i].unit or unit.strip())
    return found, read_cell("".join(told.get("Delta_X", [])[:1]), comma)[0] or None


# ---------------------------------------------------------------------------------------------------------------------
# Files that are no text
# ---------------------------------------------------------------------------------------------------------------------


def _spreadsheet(place: str, raw: bytes) -> bytes:
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

    def numbers(sheet: pd.DataFrame) -> int:
        return int(sheet.map(lambda cell: isinstance(cell, (int, float)) and cell == cell).to_numpy().sum())

    sheet = max(sheets.values(), key=numbers)
    if not numbers(sheet):
        raise InputError(f"{place}: no sheet holds a number; it should hold a column of forces")
    plain = sheet.replace(r"[\t\r\n\"]", " ", regex=True)
    text: str = plain.to_csv(sep="\t", header=False, index=False, quoting=csv.QUOTE_NONE)
    return text.encode()


def _tdms(place: str) -> Table:
    """The channels of a TDMS file."""
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
        read, of_channel = Heading.read(channel.name), channel.properties
        unit = str(of_channel.get("unit_string", "") or of_channel.get("NI_UnitDescription", ""))
        headings.append(Heading(name=read.name, unit=unit or read.unit))
    steps = {float(step) for channel in found if (step := channel.properties.get("wf_increment"))}
    values = {i: np.asarray(channel[:], dtype=float) for i, channel in enumerate(found)}
    return Table(
        place=place,
        headings=coefficients_without_unit(headings),
        numeric=list(values),
        source=values,
        step=steps.pop() if len(steps) == 1 else None,
    )
