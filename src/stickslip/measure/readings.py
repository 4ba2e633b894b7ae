"""Reading a force trace measured on a bench, from any table in plain text."""

from __future__ import annotations

import csv
import difflib
import json
import math
import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip import files
from stickslip.errors import InputError, number, shortened, shown
from stickslip.measure.arrays import FEWEST_READINGS, Array

LARGEST_FILE = 100_000_000  # bytes
FEW_UNREADABLE = 3  # rows, or ...
UNREADABLE_SHARE = 0.01  # ... this share of them, may be unreadable
_SAMPLE = 400  # rows looked at to find out how a table is laid out

_COMMENT = re.compile(r"\s*(#|%|//|!)+\s*")
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\W\d_%°][^,;\t]{0,11}|[%°])?")
_BRACKET = re.compile(r"\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")
_NO_VALUE = {"nan", "inf", "-inf", "+inf", "na", "n/a", "null", "none", "-", "--", ""}
_FORCE_WORDS = {"f", "f_d", "fd", "force", "pull", "load", "friction", "friction force", "driving force", "kraft"}
_TIME_WORDS = {"t", "time", "times", "elapsed", "elapsed time", "seconds", "sec", "zeit"}


def read_trace(
    path: str | os.PathLike[str],
    *,
    force: str | int | None = None,
    time: str | int | None = None,
    step: float | None = None,
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
) -> xr.Dataset:
    """Read a measured force trace from a table in plain text.

    Columns may be parted by tabs, semicolons, commas or blanks; there may be a header, lines of comment
    (``#``, ``%``, ``//``, ``!``), text before the table, and units in the cells (``0.04 N``). Rows that
    cannot be read are reported and the force there is interpolated linearly in time, so that the gap stays a
    gap in time; more than 3 of them, and more than 1 % of the rows, are an error.

    Parameters
    ----------
    path : path
        The file; at most 100 MB.
    force, time : str or int, optional
        Columns by name or by number, from 1. By default the only column of numbers is the force; among
        several, those whose names say so.
    step : float, optional
        Time from one row to the next, in s, where the file has no column of times.
    delimiter : str, optional
        What parts the columns; found out by default.
    decimal : {".", ","}, optional
        Decimal sign; found out by default.

    Returns
    -------
    Dataset
        `F_d` along `t`, and `filled`, true where the force was interpolated. Attributes ``source``, ``rows``,
        ``note`` (what was filled in, in words) and ``unreadable`` (JSON: a list of line numbers and texts).

    Raises
    ------
    InputError
        If there is no such file, or it is no table of numbers, or no such column; if the choice of the
        columns is not clear; if times do not rise; if too many rows are unreadable, or fewer than 16 are
        left.
    """
    place = str(path)
    if step is not None:
        step = number("step", step, at_least=1e-12, at_most=1e12, hint="s from one row to the next")
        if time is not None:
            raise InputError(f"{place}: both step = {step:g} and time = {time!r} are given; leave one out")
    table = _Table.of(place, _text(place), delimiter, decimal)
    time_column, force_column = _columns(place, table, force=force, time=time, step=step)

    forces = table.numbers(force_column)
    if time_column is not None:
        times = table.numbers(time_column)
    else:
        assert step is not None
        times = step * np.arange(forces.size, dtype=float)
    readable = np.isfinite(times) & np.isfinite(forces)
    _check_rows(place, table, readable)
    _check_times(place, table, times)

    timed = np.isfinite(times)
    first, last = np.flatnonzero(readable)[[0, -1]]
    kept = timed & (np.arange(times.size) >= first) & (np.arange(times.size) <= last)
    t, good = times[kept], readable[kept]
    filled = np.interp(t, t[good], forces[kept][good])
    bad = [(table.lines[i], table.texts[i]) for i in np.flatnonzero(~readable)]
    force_unit = table.units[force_column] or "N"
    time_unit = "s" if time_column is None else table.units[time_column] or "s"
    return xr.Dataset(
        {
            "F_d": ("t", filled, {"units": force_unit, "long_name": "driving force"}),
            "filled": ("t", ~good, {"units": "1", "long_name": "row was unreadable; force interpolated"}),
        },
        coords={"t": ("t", t, {"units": time_unit, "long_name": "time"})},
        attrs={
            "source": Path(place).name,
            "rows": int(times.size),
            "note": _note(bad, times.size),
            "unreadable": json.dumps([{"line": line, "text": text} for line, text in bad]),
        },
    )


def _text(place: str) -> str:
    """The file as text, or one clear line on why it is none."""
    raw = files.read(place, "force trace", largest=LARGEST_FILE)
    if not raw:
        raise InputError(f"{place}: is empty; it should hold a column of forces")
    if raw.startswith((b"\x89HDF", b"CDF")):
        raise InputError(f"{place}: is a NetCDF or HDF5 file, not a table in text; open it as a run")
    if raw.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise InputError(f"{place}: is a spreadsheet or an archive; export the table as CSV")
    encoding = "utf-16" if raw.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig"
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # units such as µ, written by older instruments
    strange = re.search(r"[\x00-\x08\x0e-\x1f\x7f-\x84\x86-\x9f]", text)
    if strange:
        line = text.count("\n", 0, strange.start()) + 1
        raise InputError(f"{place}: line {line} holds the byte {strange.group()!r}: a binary file; export it as text")
    if not text.strip():
        raise InputError(f"{place}: holds blanks only; it should hold a column of forces")
    return text


@dataclass(frozen=True, kw_only=True)
class _Table:
    """The rows of a table, from the first with a number in it on."""

    cells: list[list[str]]
    lines: list[int]
    texts: list[str]
    names: list[str]
    units: list[str]
    numeric: list[int]
    comma: bool

    @classmethod
    def of(cls, place: str, text: str, delimiter: str | None, decimal: str | None) -> _Table:
        rows: list[tuple[int, str]] = []
        remarks: list[tuple[int, str]] = []
        for line, content in enumerate(text.splitlines(), start=1):
            if content.strip():
                (remarks if _COMMENT.match(content) else rows).append((line, content))
        if not rows:
            raise InputError(f"{place}: holds comments only; it should hold a column of forces")
        sample = [content for _, content in rows[:: max(1, len(rows) // _SAMPLE)]]
        parting, comma = _layout(place, sample, delimiter, decimal)
        cells = _split([content for _, content in rows], parting)

        width = Counter(len(row) for row in cells[:: max(1, len(rows) // _SAMPLE)]).most_common(1)[0][0]
        numeric = [i for i in range(width) if _mostly_numbers(cells, i, comma)]
        if not numeric:
            raise InputError(
                f"{place}: line {rows[0][0]}, {_short(rows[0][1])!r}: found no column of numbers in {len(rows)} rows; "
                "it should hold a column of forces"
            )
        start = next(i for i, row in enumerate(cells) if any(_value(row, j, comma) is not None for j in numeric))
        heads = [(line, _split([_COMMENT.sub("", content, count=1)], parting)[0]) for line, content in remarks]
        heads += [(line, row) for (line, _), row in zip(rows[:start], cells[:start], strict=True)]
        first = rows[start][0]
        names, units = _header(sorted(head for head in heads if head[0] < first), width, numeric)
        for i in numeric:
            units[i] = units[i] or _unit(cells[start:], i, comma)
        return cls(
            cells=cells[start:],
            lines=[line for line, _ in rows[start:]],
            texts=[content.strip() for _, content in rows[start:]],
            names=names,
            units=units,
            numeric=numeric,
            comma=comma,
        )

    def numbers(self, column: int) -> Array:
        """The column's numbers, NaN where a cell holds none."""
        values = (_value(row, column, self.comma) for row in self.cells)
        return np.array([math.nan if value is None else value for value in values])

    def listed(self) -> str:
        shown = [f"{i + 1}" + (f" {self.names[i]!r}" if self.names[i] else "") for i in self.numeric[:12]]
        return ", ".join(shown) + (" ..." if len(self.numeric) > 12 else "")


def _layout(place: str, sample: list[str], delimiter: str | None, decimal: str | None) -> tuple[str | None, bool]:
    """What parts the columns (None for blanks), and whether the decimal sign is a comma."""
    if decimal not in (None, ".", ","):
        raise InputError(f"decimal = {decimal!r}: must be '.' or ','")
    if delimiter is not None:
        if len(delimiter) != 1 or delimiter in ".\"'\r\n" or delimiter == decimal:
            raise InputError(f"delimiter = {delimiter!r}: must be one character, such as ';', and no decimal sign")
        parting = None if delimiter == " " else delimiter
        return parting, delimiter != "," and (decimal == "," or (decimal is None and _decimal_commas(sample)))

    def consistent(mark: str | None) -> bool:
        widths = Counter(len(row) for row in _split(sample, mark))
        width, count = widths.most_common(1)[0]
        return width > 1 and count >= 0.8 * len(sample)

    found: str | None = None
    for mark in ("\t", ";"):
        if consistent(mark):
            found = mark
            break
    else:
        joined = "\n".join(sample)
        if decimal != "," and consistent(","):
            whole = re.findall(r"^\s*[-+]?\d+,(\d+)\s*(?:[^\W\d].*)?$", joined, re.MULTILINE)
            alone = len(whole) >= 0.8 * len(sample)  # every row reads 12,34: two columns, or one with decimal commas
            if alone and decimal is None and ("." not in joined):
                if any(re.fullmatch(r"0\d+", part) for part in whole):
                    return None, True  # 0,04: no one writes a whole number with a leading zero
                raise InputError(
                    f"{place}: rows such as {_short(sample[-1])!r} may hold two columns or one decimal comma; say "
                    "decimal=',' or delimiter=','"
                )
            blanks = consistent(None) and ", " not in joined and "." not in joined and _decimal_commas(sample)
            if not blanks:
                return ",", False
    return found, decimal == "," or (decimal is None and _decimal_commas(sample))


def _decimal_commas(sample: list[str]) -> bool:
    joined = "\n".join(sample)
    return bool(re.search(r"\d,\d", joined)) and not re.search(r"\d\.\d", joined)


def _split(contents: Sequence[str], mark: str | None) -> list[list[str]]:
    if mark is None:
        return [content.split() for content in contents]
    if '"' in "".join(contents[:50]):
        return [next(csv.reader([content], delimiter=mark), [""]) for content in contents]
    return [content.rstrip(mark if mark != "," else "").split(mark) for content in contents]


def _value(row: list[str], column: int, comma: bool) -> float | None:
    """The number in a cell, a unit after it left out; None if there is none, or it is not finite."""
    if column >= len(row):
        return None
    cell = row[column].strip().replace("\N{MINUS SIGN}", "-")
    if comma:
        cell = cell.replace(",", ".")
    match = _NUMBER.fullmatch(cell)
    if match is None:
        return None
    value = float(match[1])
    return value if math.isfinite(value) else None


def _mostly_numbers(cells: list[list[str]], column: int, comma: bool) -> bool:
    """Whether most cells of a column hold numbers, cells that say "no value" left aside."""
    rows = cells[:: max(1, len(cells) // _SAMPLE)] if len(cells) > 20 else cells
    filled = [row for row in rows if column < len(row) and row[column].strip().lower() not in _NO_VALUE]
    count = sum(_value(row, column, comma) is not None for row in filled)
    return count > 0 and (count >= 0.5 * len(filled) or count >= len(filled) - 3)


def _header(heads: list[tuple[int, list[str]]], width: int, numeric: list[int]) -> tuple[list[str], list[str]]:
    """Names and units of the columns, from the last line before the table that has as many cells."""
    names, units = [""] * width, [""] * width
    for _, cells in reversed(heads):
        cells = [cell.strip().strip('"') for cell in cells]
        if len(cells) == width or (width > 1 and len(cells) == len(numeric) > 1):
            columns = range(width) if len(cells) == width else numeric
        elif width == 1 or len(numeric) == 1:
            columns, cells = numeric[:1], [" ".join(cells)]
        else:
            continue
        for i, cell in zip(columns, cells, strict=True):
            bracket = _BRACKET.search(cell)
            names[i] = cell[: bracket.start()] if bracket and bracket.start() else cell
            units[i] = bracket[1] if bracket and bracket.start() else ""
        break
    return names, units


def _unit(cells: list[list[str]], column: int, comma: bool) -> str:
    """Unit that stands in the cells of a column, if it is one of force or time."""
    for row in cells[:20]:
        if column < len(row):
            match = _NUMBER.fullmatch(row[column].strip().replace(",", ".") if comma else row[column].strip())
            if match and match[2] and match[2].strip() in {"N", "mN", "kN", "µN", "uN", "s", "ms", "gf", "kgf", "lbf"}:
                return match[2].strip()
    return ""


def _columns(
    place: str, table: _Table, *, force: str | int | None, time: str | int | None, step: float | None
) -> tuple[int | None, int]:
    """Indices of the columns of time (None where a step is given) and force."""
    chosen = None if force is None else _column(place, table, "force", force)
    clock = None if time is None else _column(place, table, "time", time)
    if clock is None:
        named = [i for i in table.numeric if table.names[i].lower() in _TIME_WORDS and i != chosen]
        clock = named[0] if len(named) == 1 else None
    if chosen is None:
        rest = [i for i in table.numeric if i != clock]
        named = [i for i in rest if table.names[i].lower() in _FORCE_WORDS]
        if len(rest) == 1 or len(named) == 1:
            chosen = rest[0] if len(rest) == 1 else named[0]
        elif not rest:
            chosen, clock = clock, None
        else:
            raise InputError(f"{place}: which column is the force? Say force=; there are {table.listed()}")
    assert chosen is not None
    if chosen == clock:
        raise InputError(f"{place}: column {chosen + 1} cannot be both time and force; there are {table.listed()}")
    if step is None and clock is None:
        raise InputError(
            f"{place}: has no column of times that is named so: give step= (s from one row to the next) or time= "
            f"(a column); there are {table.listed()}"
        )
    return (None if step is not None else clock), chosen


def _column(place: str, table: _Table, what: str, wanted: str | int) -> int:
    """Index of a column given by name or number."""
    if isinstance(wanted, str):
        simple = _BRACKET.sub("", wanted).strip().lower()
        same = [i for i, name in enumerate(table.names) if name and name.lower() == simple]
        if len(same) > 1:
            raise InputError(f"{place}: {what} = {wanted!r}: {len(same)} columns have this name; give the number")
        if same:
            index = same[0]
        elif re.fullmatch(r"[0-9]{1,9}", wanted.strip()):
            return _column(place, table, what, int(wanted))
        else:
            near = difflib.get_close_matches(
                shortened(simple), [name.lower() for name in table.names if name], n=1, cutoff=0.5
            )
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise InputError(f"{place}: {what} = {shown(wanted)}: no such column; {hint}there are {table.listed()}")
    else:
        index = int(wanted) - 1
        if isinstance(wanted, bool) or not 0 <= index < len(table.names):
            raise InputError(
                f"{place}: {what} = {shown(wanted)}: no such column; counted from 1, there are {table.listed()}"
            )
    if index not in table.numeric:
        raise InputError(
            f"{place}: {what} = {wanted!r}: line {table.lines[0]} holds no number in column {index + 1}; columns of "
            f"numbers are {table.listed()}"
        )
    return index


def _check_rows(place: str, table: _Table, readable: NDArray[np.bool_]) -> None:
    bad = np.flatnonzero(~readable)
    if bad.size > max(FEW_UNREADABLE, UNREADABLE_SHARE * readable.size):
        raise InputError(
            f"{place}: {bad.size} of {readable.size} rows cannot be read, first line {table.lines[bad[0]]}: "
            f"{_short(table.texts[bad[0]])!r}; each row needs a finite number; choose the columns, or mend the file"
        )
    if readable.sum() < FEWEST_READINGS:
        raise InputError(
            f"{place}: {int(readable.sum())} readings are too few to judge; at least {FEWEST_READINGS} are needed"
        )


def _check_times(place: str, table: _Table, times: Array) -> None:
    known = np.flatnonzero(np.isfinite(times))
    back = np.flatnonzero(np.diff(times[known]) <= 0)
    if back.size:
        before, after = known[back[0]], known[back[0] + 1]
        raise InputError(
            f"{place}: line {table.lines[after]}: time {times[after]:g} does not come after {times[before]:g}; times "
            "must rise: sort the rows, or give step= instead"
        )


def _note(bad: list[tuple[int, str]], rows: int) -> str:
    if not bad:
        return ""
    shown = "; ".join(f"line {line}: {_short(text)!r}" for line, text in bad[:5])
    more = f"; and {len(bad) - 5} more" if len(bad) > 5 else ""
    return f"{len(bad)} of {rows} rows could not be read; the force there is interpolated in time ({shown}{more})"


def _short(text: str) -> str:
    text = text.strip()
    return text if len(text) <= 40 else text[:37] + "..."
