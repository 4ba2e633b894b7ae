"""A table of numbers as instruments write them: text, a spreadsheet, or a TDMS file."""

from __future__ import annotations

import csv
import datetime as dt
import io
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, shortened
from stickslip.measure.arrays import Array
from stickslip.measure.headings import Heading, coefficients_without_unit, is_units_row, ratio, simple, unit_named

if TYPE_CHECKING:
    import pandas as pd

LARGEST_FILE = 100_000_000  # bytes
LONGEST_LINE = 65_536  # characters
MOST_COLUMNS = 1000
_SAMPLE = 400  # lines looked at to find out how a table is laid out
_HEAD = 1000  # lines among which a table must start
_CHUNK = 250_000  # rows read at a time
_LONGEST_NUMBER = 60  # characters of a cell that may hold a number

_ONE_COMMA = re.compile(r"^\s*[-+]?\d+,\d+\s*(?:[^\W\d].*)?$", re.MULTILINE)
_OTHER_FILES = {
    b"\x89HDF": "NetCDF or HDF5 file, not a table in text; open it as a run",
    b"CDF": "NetCDF or HDF5 file, not a table in text; open it as a run",
    b"\xd0\xcf\x11\xe0": "spreadsheet of the old kind (.xls); save it as .xlsx, or as CSV",
}
_COMMENT = re.compile(r"\s*(#|%|//|!)+\s*")
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
    labels: list[str] = field(default_factory=list)

    @classmethod
    def read(cls, place: str, delimiter: str | None, decimal: str | None) -> Table:
        """Find out how a file is laid out; `InputError` if it is no table."""
        raw = _bytes(place)
        if raw.startswith(b"TDSm"):
            return _tdms(place)
        if raw.startswith(b"PK\x03\x04"):
            return _of_text(place, _Lines.of(place, _spreadsheet(place, raw)), "\t", ".")
        return _of_text(place, _Lines.of(place, _as_utf8(place, raw)), delimiter, decimal)

    def rows(self, columns: Sequence[int]) -> Rows:
        """Read some columns."""
        if isinstance(self.source, _Text):
            return self.source.rows(self, sorted(set(columns)))
        values = {i: self.source[i] for i in columns}
        lines = np.arange(1, next(iter(values.values())).size + 1, dtype=np.int64)
        return Rows(values=values, units={i: self.headings[i].unit for i in columns}, lines=lines)

    def line(self, number: int) -> str:
        """Text of a line, counted from 1."""
        return self.source.lines.text(number - 1).strip() if isinstance(self.source, _Text) else f"sample {number}"

    def listed(self) -> str:
        """The columns of numbers, for a message."""
        shown = [f"{i + 1}" + (f" '{self.headings[i]}'" if self.headings[i].name else "") for i in self.numeric[:12]]
        return ", ".join(shown) + (" ..." if len(self.numeric) > 12 else "")


# ---------------------------------------------------------------------------------------------------------------------
# Bytes and lines
# ---------------------------------------------------------------------------------------------------------------------


def _bytes(place: str) -> bytes:
    """The content of a file, or one clear line on why there is none."""
    path = Path(place)
    try:
        if path.exists() and not path.is_file():
            what = "a folder" if path.is_dir() else "no regular file"
            raise InputError(f"{place}: is {what}; name the file with the force trace")
        size = path.stat().st_size
        raw = path.read_bytes() if size <= LARGEST_FILE else b""
    except FileNotFoundError:
        raise InputError(f"{place}: no such file; check the name and the folder") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{place}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if size == 0:
        raise InputError(f"{place}: is empty; it should hold a column of forces")
    if size > LARGEST_FILE:
        raise InputError(
            f"{place}: has {size / 1e6:.0f} MB, more than {LARGEST_FILE / 1e6:.0f}; keep every n-th row, or a part"
        )
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


@dataclass(frozen=True, kw_only=True)
class _Lines:
    """A text by its lines; they are never all held as Python's strings."""

    raw: bytes
    ends: NDArray[np.int64]

    @classmethod
    def of(cls, place: str, raw: bytes) -> _Lines:
        found = np.flatnonzero(np.frombuffer(raw, dtype=np.uint8) == 10)
        ends = found if found.size and found[-1] == len(raw) - 1 else np.append(found, len(raw))
        length = np.diff(ends, prepend=-1)
        longest = int(length.argmax())
        if length[longest] > LONGEST_LINE:
            raise InputError(
                f"{place}: line {longest + 1} has {length[longest]:,} characters, more than {LONGEST_LINE:,}: "
                "no row of a trace; one row to a line, and the columns of time and force are enough"
            )
        return cls(raw=raw, ends=ends)

    def __len__(self) -> int:
        return int(self.ends.size)

    def text(self, i: int) -> str:
        begin = int(self.ends[i - 1]) + 1 if i else 0
        return self.raw[begin : int(self.ends[i])].decode(errors="replace").rstrip("\r")


# ---------------------------------------------------------------------------------------------------------------------
# Layout of a text
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Text:
    """Where in a text the rows stand, and how they are parted."""

    lines: _Lines
    start: int  # first line of the rows, from 0
    parting: str | None
    comma: bool
    quoted: bool
    width: int

    def rows(self, table: Table, columns: Sequence[int]) -> Rows:
        """Read some columns; blank lines and comments are left out."""
        beside = self._unit_columns(table, columns)
        wanted = sorted({*columns, *beside.values(), self.width})
        cells: dict[int, list[tuple[Array, NDArray[np.intp]]]] = {i: [] for i in columns}
        units = [""]
        for chunk in self._chunks(wanted, table.place):
            wide = _numbers(chunk[self.width], self.comma, [""])[0]
            surplus = np.isfinite(wide) | (self.parting is None and chunk[self.width].map(_is_unit).to_numpy(bool))
            for i in columns:
                values, unit = _numbers(chunk[i], self.comma, units)
                if i in beside:
                    unit = _coded(chunk[beside[i]].map(lambda cell: cell if isinstance(cell, str) else ""), units)
                values[surplus] = math.nan
                cells[i].append((values, unit))
        whole = {
            i: (np.concatenate([a for a, _ in parts])[1:], np.concatenate([b for _, b in parts])[1:])
            for i, parts in cells.items()
        }
        count, filled = len(self.lines) - self.start, whole[columns[0]][0].size
        if filled != count:
            raise InputError(
                f"{table.place}: {count} lines from line {self.start + 1} on make {filled} rows: "
                "a quotation mark is not closed, or a row is cut off"
            )
        names = {i: self._one_unit(table, i, *whole[i], units, label=i in beside) for i in columns}
        read = {i: numbers for i, (numbers, _) in whole.items()}
        empty = np.logical_and.reduce([~np.isfinite(numbers) for numbers in read.values()])
        keep = np.ones(count, dtype=bool)
        for row in np.flatnonzero(empty).tolist():
            content = self.lines.text(self.start + row)
            keep[row] = bool(content.strip()) and not _COMMENT.match(content)
        if not keep.all():
            read = {i: numbers[keep] for i, numbers in read.items()}
        return Rows(values=read, units=names, lines=np.flatnonzero(keep) + self.start + 1)

    def _unit_columns(self, table: Table, columns: Sequence[int]) -> dict[int, int]:
        """Where blanks part the columns, a unit in a cell is a column of its own, behind that of the number."""

        def label(column: int) -> str:
            return table.labels[column] if column < self.width and column not in table.numeric else ""

        beside = {i: i + 1 for i in columns if self.parting is None and label(i + 1)}
        for i in beside:
            if unit_named(label(i + 2)):
                unit = f"{label(i + 1)} {label(i + 2)}"
                raise InputError(
                    f"{table.place}: column {i + 1} holds numbers in {unit!r}; write one unit without blanks"
                )
        return beside

    def _chunks(self, columns: Sequence[int], place: str) -> Iterator[pd.DataFrame]:
        """The rows in parts; a column beyond the last takes what is too much."""
        import pandas as pd

        begin = int(self.lines.ends[self.start - 1]) + 1 if self.start else 0
        full = (self.parting or " ").join("0" * (self.width + 1)) + "\n"  # a row that has them all
        try:
            yield from pd.read_csv(
                io.BytesIO(full.encode() + self.lines.raw[begin:]),
                sep=r"\s+" if self.parting is None else self.parting,
                decimal="," if self.comma else ".",
                header=None,
                names=range(self.width + 1),
                usecols=columns,
                skip_blank_lines=False,
                skipinitialspace=True,
                quoting=csv.QUOTE_MINIMAL if self.quoted else csv.QUOTE_NONE,
                chunksize=_CHUNK,
                encoding_errors="replace",
            )
        except pd.errors.ParserError as error:
            reason = shortened(" ".join(str(error).split()))
            raise InputError(f"{place}: its rows do not have {self.width} columns ({reason})") from None

    def _one_unit(
        self, table: Table, column: int, values: Array, code: NDArray[np.intp], names: list[str], *, label: bool
    ) -> str:
        """The one unit of a column of numbers; `InputError` where its cells have several, or leave it open."""

        def refuse(unit: int, what: str) -> None:
            line = self.start + int(np.flatnonzero(code == unit)[0]) + 1
            raise InputError(
                f"{table.place}: line {line}, {short(table.line(line))!r}: column {column + 1} holds "
                f"{names[unit]!r}{what}; write one unit of one kind"
            )

        head = table.headings[column].unit
        code[~np.isfinite(values)] = 0
        count = np.bincount(code, minlength=len(names))
        bare = int(np.count_nonzero(np.isfinite(values))) - int(count[1:].sum())
        usual = int(np.argmax(count[1:])) + 1 if count[1:].any() else 0
        if bare > count[usual]:
            usual = 0
        among = f" among {names[usual]!r}" if usual else " among numbers without a unit"
        for unit in (np.flatnonzero(count[1:]) + 1).tolist():
            known = unit_named(names[unit])
            if unit != usual and known:
                refuse(unit, among)
            elif unit == usual and not known and "/" in names[unit]:
                refuse(unit, "")
            elif unit != usual or not (label or known):  # a cell that holds more than a number and its unit is none
                values[code == unit] = math.nan
        if not usual or not unit_named(names[usual]):
            return head
        if head and not ratio(names[usual], head):
            refuse(usual, f" below the heading {head!r}")
        return names[usual]


def _is_unit(cell: object) -> bool:
    return isinstance(cell, str) and unit_named(cell) is not None


def _numbers(column: pd.Series[Any], comma: bool, units: list[str]) -> tuple[Array, NDArray[np.intp]]:
    """The numbers of a column, NaN where a cell holds none, and for each the place of its unit among `units`."""
    import pandas as pd

    code = np.zeros(column.size, dtype=np.intp)
    if column.dtype.kind in "fiu":
        values = column.to_numpy(dtype=float, copy=True)
    else:
        which, texts = pd.factorize(column.to_numpy(), use_na_sentinel=False)
        read = [read_cell(str(text), comma) for text in texts]
        values = np.array([math.nan if value is None else value for value, _ in read])[which]
        code = _coded(pd.Series([unit for _, unit in read]), units)[which]
    values[np.isinf(values)] = math.nan
    return values, code


def _coded(texts: pd.Series[Any], units: list[str]) -> NDArray[np.intp]:
    """The place of each text among `units`, which takes the new ones."""
    units += [text for text in texts.unique() if text not in units]
    return np.asarray(texts.map({text: i for i, text in enumerate(units)}), dtype=np.intp)


def _of_text(place: str, lines: _Lines, delimiter: str | None, decimal: str | None) -> Table:
    """Find the rows of numbers in a text, and their headings."""
    head = [(i, text) for i in range(min(len(lines), _HEAD)) if (text := lines.text(i)).strip()]
    heading_end = max((k for k, (_, text) in enumerate(head) if text.startswith("***End_of_Header***")), default=-1)
    remarks = [(i, text) for i, text in head if _COMMENT.match(text)]
    content = [(i, text) for k, (i, text) in enumerate(head) if k > heading_end and not _COMMENT.match(text)]
    body = _body(lines, content)
    if not body:
        raise InputError(f"{place}: holds comments only; it should hold a column of forces")
    titles = [text for _, text in content if not re.search(r"\d", text)]
    parting, comma = _layout(place, body, titles, delimiter, decimal)
    cells = split(body, parting)
    width = Counter(len(row) for row in cells).most_common(1)[0][0]
    if width > MOST_COLUMNS:
        raise InputError(f"{place}: has {width} columns, more than {MOST_COLUMNS}; keep those of time and force")
    names = {len(row) for row in split(titles, ",")} if parting == "," and "." not in "".join(body) else set()
    if width % 2 == 0 and width // 2 in names - {1}:
        raise InputError(
            f"{place}: rows such as {short(body[-1])!r} have {width} columns below {width // 2} names: a comma cannot "
            "be both the decimal sign and what separates the columns; export with ';' or with decimal points"
        )
    numeric = [i for i in range(width) if _mostly_numbers(cells, i, comma)]
    if not numeric:
        raise InputError(
            f"{place}: line {content[0][0] + 1}, {short(content[0][1])!r}: found no column of numbers in {len(lines)} "
            "rows; it should hold a column of forces"
        )
    start = next((i for i, text in content if _is_row(split([text], parting)[0], numeric, comma)), None)
    if start is None:
        raise InputError(
            f"{place}: the numbers start only after line {head[-1][0] + 1}; leave the text before them out"
        )
    above = [(i, text) for i, text in content if i < start]
    heads = sorted(above + [(i, _COMMENT.sub("", text, count=1)) for i, text in remarks if i < start])
    labels = [_label(cells, i) for i in range(width)]
    headings = _headings([text for _, text in heads], parting, width, numeric, comma)
    for i in numeric:  # units in the cells tell the columns, too
        unit = _unit_in_cells(cells, i, comma) or (labels[i + 1] if parting is None and i + 1 < width else "")
        if not headings[i].unit and unit_named(unit):
            headings[i] = Heading(name=headings[i].name, unit=unit)
    headings = coefficients_without_unit(headings)
    step = None
    if heading_end >= 0:
        headings, step = _labview([text for _, text in head[:heading_end]], headings, numeric, parting, comma)
    source = _Text(
        lines=lines,
        start=start,
        parting=parting,
        comma=comma,
        quoted='"' in "".join(body),
        width=width,
    )
    return Table(place=place, headings=headings, numeric=numeric, source=source, step=step, labels=labels)


def _body(lines: _Lines, content: list[tuple[int, str]]) -> list[str]:
    """Some lines from all over the file but its beginning, where text may stand."""
    if len(lines) <= _HEAD:
        return [text for _, text in content[len(content) // 3 :]]
    picked = np.linspace(len(lines) // 3, len(lines) - 1, _SAMPLE).astype(int).tolist()
    found = [lines.text(i) for i in picked]
    return [text for text in found if text.strip() and not _COMMENT.match(text)]


def _layout(
    place: str, sample: list[str], titles: list[str], delimiter: str | None, decimal: str | None
) -> tuple[str | None, bool]:
    """What parts the columns (None for blanks), and whether the decimal sign is a comma; `titles` hold no digit."""
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


def _value(row: Sequence[str], column: int, comma: bool) -> float | None:
    """The number in a cell, a unit after it left out; None if there is none, or it is not finite."""
    return read_cell(row[column], comma)[0] if column < len(row) else None


def read_cell(cell: str, comma: bool) -> tuple[float | None, str]:
    """Number and unit of a cell; no number, and no unit, where it holds none that is finite."""
    cell = cell.strip().strip('"').replace("\N{MINUS SIGN}", "-")
    match = _NUMBER.fullmatch(cell.replace(",", ".") if comma else cell) if len(cell) <= _LONGEST_NUMBER else None
    value = float(match[1].translate(_FORTRAN)) if match else math.nan
    return (value, (match[2] or "").strip()) if match and math.isfinite(value) else (None, "")


def _mostly_numbers(cells: list[list[str]], column: int, comma: bool) -> bool:
    """Whether most cells of a column hold numbers, cells that say "no value" left aside."""
    filled = [row for row in cells if column < len(row) and row[column].strip().lower() not in _NO_VALUE]
    count = sum(_value(row, column, comma) is not None for row in filled)
    return count > 0 and (count >= 0.5 * len(filled) or count >= len(filled) - 3)


def _is_row(row: list[str], numeric: list[int], comma: bool) -> bool:
    """Whether a line is a row of the table: numbers in its columns of numbers."""
    found = [_value(row, i, comma) is not None for i in numeric]
    missing = [i < len(row) and row[i].strip().lower() in _NO_VALUE for i in numeric]
    return any(found) and all(a or b for a, b in zip(found, missing, strict=True))


def _unit_in_cells(cells: list[list[str]], column: int, comma: bool) -> str:
    """The unit that most cells of a column of numbers hold."""
    units = Counter(read_cell(row[column], comma)[1] for row in cells if column < len(row))
    return units.most_common(1)[0][0] if units else ""


def _label(cells: list[list[str]], column: int) -> str:
    """The unit that most cells of a column of text hold, if they are units."""
    texts = [row[column] for row in cells if column < len(row)]
    most = Counter(texts).most_common(1)
    return most[0][0] if most and (unit_named(most[0][0]) or most[0][1] >= 0.9 * len(texts)) else ""


# ---------------------------------------------------------------------------------------------------------------------
# Headings
# ---------------------------------------------------------------------------------------------------------------------


def _headings(heads: list[str], parting: str | None, width: int, numeric: list[int], comma: bool) -> list[Heading]:
    """Names and units of the columns, from the lines just above the table that have as many cells."""
    names: list[str] | None = None
    units: list[str] | None = None
    for k in range(len(heads) - 1, -1, -1):
        cells = _as_wide(heads[k], parting, width, numeric)
        if cells is None or all(c.strip().lower() in _NO_VALUE or read_cell(c, comma)[0] is not None for c in cells):
            continue
        if units is None:
            above = any(_as_wide(other, parting, width, numeric) is not None for other in heads[:k])
            if is_units_row(cells, below_names=above):
                units = [cell.strip().strip('"').strip("[]() ") for cell in cells]
                continue
        names = cells
        break
    found = [Heading.read(name) for name in names or [""] * width]
    if units is None:
        return found
    return [Heading(name=h.name, unit=unit or h.unit) for h, unit in zip(found, units, strict=True)]


def _as_wide(line: str, parting: str | None, width: int, numeric: list[int]) -> list[str] | None:
    """The cells of a line above the table, one to a column; None if they are not as many."""
    found: list[list[str]] = []
    if parting is None:  # names may hold blanks: look for other marks first
        found += [cells for mark in ",;\t" if mark in line for cells in split([line], mark)]
        found.append(re.split(r"\s+(?![\[(])", line.strip()))
    found += split([line], parting)
    if parting is None and len(numeric) == 1:
        found.append([line.strip()])
    for cells in found:
        if len(cells) == width + 1 and simple(cells[-1]) in _REMARKS:
            cells = cells[:-1]
        if len(cells) == width or (parting is None and len(cells) == len(numeric)):
            columns = range(width) if len(cells) == width else numeric
            wide = [""] * width
            for i, cell in zip(columns, cells, strict=True):
                wide[i] = cell
            return wide
    return None


def _labview(
    head: list[str], headings: list[Heading], numeric: list[int], parting: str | None, comma: bool
) -> tuple[list[Heading], float | None]:
    """Units and time step from the head of a LabVIEW measurement file."""
    step, found = None, list(headings)
    for cells in split(head, parting or "\t"):
        if cells[0] == "X_Columns" and cells[1:2] == ["One"] and not found[numeric[0]].name:
            found[numeric[0]] = Heading(name="X_Value")
        elif cells[0] == "Delta_X" and len(cells) > 1:
            step = read_cell(cells[1], comma)[0] or None
        elif cells[0] == "Y_Unit_Label":
            for i, unit in zip([i for i in numeric if found[i].quantity != "time"], cells[1:], strict=False):
                found[i] = Heading(name=found[i].name, unit=found[i].unit or unit.strip())
    return found, step


def short(text: str) -> str:
    """A text cut to what a message bears."""
    text = text.strip()
    return text if len(text) <= 40 else text[:37] + "..."


# ---------------------------------------------------------------------------------------------------------------------
# Files that are no text
# ---------------------------------------------------------------------------------------------------------------------


def _spreadsheet(place: str, raw: bytes) -> bytes:
    """The first sheet with numbers of an .xlsx file, as text separated by tabs."""
    try:
        import openpyxl
    except ImportError:
        raise InputError(
            f"{place}: is a spreadsheet; `pip install openpyxl` to read .xlsx, or export the table as CSV"
        ) from None
    try:
        book = openpyxl.load_workbook(io.BytesIO(raw), read_only=True, data_only=True)
        sheets = [list(sheet.iter_rows(values_only=True)) for sheet in book.worksheets]
    except Exception as error:  # openpyxl lets errors of zip, XML and its own through
        raise InputError(f"{place}: is no spreadsheet that can be read ({error}); export the table as CSV") from None
    numbers = [sum(isinstance(cell, (int, float)) for row in sheet for cell in row) for sheet in sheets]
    if not numbers or not max(numbers):
        raise InputError(f"{place}: no sheet holds a number; it should hold a column of forces")
    sheet = sheets[numbers.index(max(numbers))]
    return "\n".join("\t".join(_cell_as_text(cell) for cell in row) for row in sheet).encode()


def _cell_as_text(cell: object) -> str:
    if cell is None:
        return ""
    if isinstance(cell, (dt.datetime, dt.date, dt.time)):
        return cell.isoformat()
    return repr(float(cell)) if isinstance(cell, (int, float)) else re.sub(r"[\t\r\n\"]", " ", str(cell))


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
    length = Counter(len(channel) for channel in found).most_common(1)[0][0]
    found = [channel for channel in found if len(channel) == length]
    headings = []
    for channel in found:
        read = Heading.read(channel.name)
        unit = str(channel.properties.get("unit_string", "") or channel.properties.get("NI_UnitDescription", ""))
        headings.append(Heading(name=read.name, unit=unit or read.unit))
    steps = {float(step) for c in found if (step := c.properties.get("wf_increment"))}
    values = {i: np.asarray(channel[:], dtype=float) for i, channel in enumerate(found)}
    return Table(
        place=place,
        headings=coefficients_without_unit(headings),
        numeric=list(values),
        source=values,
        step=steps.pop() if len(steps) == 1 else None,
    )
