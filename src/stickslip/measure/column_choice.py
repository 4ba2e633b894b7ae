"""Choice of the columns of a measured table by their names, units, and numbers."""

import re
from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from stickslip import words
from stickslip.errors import InputError, instance, printable, shown
from stickslip.io.headings import (
    Heading,
    kind_of,
    ratio,
    simple,
    unit_named,
)
from stickslip.io.table_files import read_table
from stickslip.io.table_text import Table
from stickslip.measure.part_table import aligned
from stickslip.measure.trace import Array

ColumnName = str | int | None
"""A column by its name, or by its number, counted from 1; None for automatic choice."""
_VALUES = {"load": "'20 N'", "velocity": "--velocity '0.1 mm/s'"}
"""Quantities that may be given as values in place of a column."""
_EXAMPLES = {
    "time": "ms",
    "force": "mN",
    "displacement": "um",
    "load": "kN",
    "velocity": "mm/s",
}
"""A unit of each quantity."""
_MOST_SHOWN = 20  # columns listed where the user must choose one
_LONGEST_NAME = 28  # characters of a name in that list
# Largest difference between two steps of a column that rises evenly, divided by the
# median step: rounded times often change by two or four units where the step is three.
_UNEVEN = 0.5


class Column(NamedTuple):
    """A column of numbers."""

    #: argument of `stickslip.read_trace` for the column: its name or, if other columns
    #: have the same name, its number, counted from 1
    key: str
    heading: str  #: its number and its heading
    preview: str = ""  #: its range, and whether it rises evenly


class Choice(NamedTuple):
    """A chosen column with its heading."""

    place: int  # from 0
    heading: Heading

    def __str__(self) -> str:
        name, unit = self.heading
        text = f' "{name}"' if name else ""
        text += f" ({unit})" if unit else ""
        return printable(f"column {self.place + 1}{text}")


def columns(content: bytes) -> list[Column]:
    r"""Return the columns of numbers of a table, from the bytes of its file.

    Raises `InputError` if there is no table in it.

    Examples
    --------
    >>> from stickslip.measure import columns
    >>> columns(b"time [s],force [N]\n0.0,1.0\n0.1,2.0\n")[1]
    Column(key='force', heading='2: force (N)', preview='1 to 2, rises evenly')
    """
    instance("columns: content", content, bytes, "the bytes of a file")
    table = read_table(content)
    numbers = table.read(table.numeric)
    names = [simple(heading.name) for heading in table.headings]
    found = []
    for i, values in numbers.items():
        heading = table.headings[i]
        is_alone = bool(names[i]) and names.count(names[i]) == 1
        key = heading.name if is_alone else str(i + 1)
        title = f"{i + 1}: {heading}".strip(": ")
        found.append(Column(key, title, _range(values)))
    return found


def _range(values: Array) -> str:
    """Return the range of numbers in words, and whether they rise evenly."""
    known = values[np.isfinite(values)]
    if not known.size:
        return "no numbers"
    text = f"{words.number(known.min())} to {words.number(known.max())}"
    return f"{text}, rises evenly" if rises_evenly(known) else text


def choose(
    table: Table, asked: Mapping[str, ColumnName], *, timed: bool, scaled: bool
) -> tuple[dict[str, Choice], list[str]]:
    """Choose the columns that the user names, and the others by their names, units and
    numbers; return them with notes of the assumptions.

    No column of times is needed if the rows are `timed` by a given step; the force may
    be `scaled` by a given factor. Raises `InputError` if no column, or several, could
    be the force or the time; its note is a table of all columns; or if the size of its
    numbers is not clear.
    """
    chosen = {
        name: _asked_for(table, name, wanted)
        for name, wanted in asked.items()
        if wanted is not None
    }
    for one, other in combinations(chosen, 2):
        if chosen[one].place == chosen[other].place:
            raise InputError(
                f"{chosen[one]} cannot be both {one} and {other}; there are "
                f"{table.listed()}"
            )
    notes = list[str]()
    for name in ("time", "force", "displacement", "load", "velocity", "part"):
        if name in chosen or (name == "time" and timed):
            continue
        taken = [each.place for each in chosen.values()]
        free = [i for i in table.numeric if i not in taken]
        found = _by_heading(table, free, name)
        if name == "time" and len(found) != 1 and not table.step:
            found, note = _rising_evenly(table, found or _unnamed(table, free))
            notes += note
        if len(found) == 1:
            chosen[name] = Choice(found[0], table.headings[found[0]])
        elif name == "time" and table.step:
            each = words.engineering(table.step, "s")
            notes.append(f"times by the interval that the file gives, {each}")
        elif name in ("time", "force"):
            raise _question(table, name, found)
    for name, choice in chosen.items():
        is_given = kind_of(str(asked.get(name) or "").rpartition(":")[2].strip())
        why = choice.heading.unclear
        if why and not (is_given or name == "part" or (name == "force" and scaled)):
            given = f"{choice.place + 1}:{_EXAMPLES[name]}"
            raise InputError(
                f"{choice} {why}; give the unit of the numbers as they are, such as "
                f"--{name} {given} (in Python {name}={given!r})"
            )
    return chosen, notes


def _by_heading(table: Table, free: list[int], name: str) -> list[int]:
    """Return the columns whose headings name a quantity or, if no heading does, have
    its unit. The force may also be a coefficient of friction, the only column left, or
    a load that is likely the pulling force.
    """
    for quantity in ("force", "coefficient") if name == "force" else (name,):
        found = [i for i in free if table.headings[i].quantity == quantity]
        if found:
            return [i for i in found if table.headings[i].is_named] or found
    if name != "force":
        return []
    if len(free) == 1 and table.headings[free[0]].quantity in ("load", ""):
        return free
    pulled = [i for i in free if _may_be_pull(table.headings[i])]
    others = table.read(_unnamed(table, free)).values()
    return pulled if all(map(_counts_rows, others)) else []


def _may_be_pull(heading: Heading) -> bool:
    """Return whether a load may be the pulling force, as testing machines call it."""
    words = {*simple(heading.name).split()}
    across = {"normal", "vertical", "nominal", "applied", "axial"}
    return heading.quantity == "load" and "load" in words and not words & across


def _unnamed(table: Table, free: list[int]) -> list[int]:
    """Return the columns whose headings give no quantity."""
    return [i for i in free if not table.headings[i].quantity]


def _rising_evenly(table: Table, candidates: list[int]) -> tuple[list[int], list[str]]:
    """Return the columns that rise evenly, as a time does, with notes. Of columns that
    rise together, return the first one, or none if it only counts the rows.
    """
    numbers = table.read(candidates) if candidates else {}
    even = [i for i in candidates if rises_evenly(numbers[i])]
    if not even:
        return [], []
    first = numbers[even[0]]
    since = [_seconds_since_first(numbers[i], table.headings[i].unit) for i in even]
    steps = np.diff(since[0][np.isfinite(since[0])])
    most = _UNEVEN * float(np.median(steps))
    if any(np.any(np.abs(each - since[0]) > most) for each in since):
        return even, []
    if _counts_rows(first):
        return [], []
    choice = Choice(even[0], table.headings[even[0]])
    return even[:1], [f"{choice} rises evenly and is taken for the time"]


def _counts_rows(values: Array) -> bool:
    """Return whether numbers rise by 1 in each row."""
    return bool(np.all(np.diff(values[np.isfinite(values)]) == 1.0))


def _seconds_since_first(times: Array, unit: str) -> Array:
    """Return times since the first one, in s if their unit is known."""
    is_known = np.isfinite(times)
    known = np.where(is_known, times, np.nan)
    first = times[is_known][0]
    return np.asarray((known - first) * (ratio(unit, "s") or 1.0))


def rises_evenly(values: Array) -> bool:
    """Return whether numbers rise by equal steps, within the rounding of a file."""
    steps = np.diff(values[np.isfinite(values)])
    if not steps.size or np.any(steps <= 0.0):
        return False
    return bool(np.ptp(steps) <= _UNEVEN * np.median(steps))


def _asked_for(table: Table, name: str, wanted: str | int) -> Choice:
    """Return the column that the user gives by its name or number, optionally with its
    unit after a colon: ``3:mN``.
    """
    text = str(wanted)
    before, _, unit = text.rpartition(":")
    for key, given in ((text, ""), (before, unit.strip())):
        if given and unit_named(given) is None:
            continue
        names = {simple(key), simple(Heading.read(key).name)} - {""}
        known = [simple(heading.name) for heading in table.headings]
        found = [i for i, name in enumerate(known) if name in names]
        if not found and re.fullmatch(r"\s*[0-9]{1,6}\s*", key):
            found = [int(key) - 1]
        if len(found) == 1 and found[0] in table.numeric:
            heading = table.headings[found[0]]
            return Choice(found[0], heading._replace(unit=given or heading.unit))
    value = _VALUES.get(name)
    is_number = re.fullmatch(r"[-+.\d]+", text.strip())
    hint = f"; a value needs its unit, as in {value}" if value and is_number else ""
    raise InputError(
        f"{name} = {shown(wanted)}: no such column of numbers, or several of this "
        f"name; counted from 1, there are {table.listed()}{hint}"
    )


def _question(table: Table, name: str, found: list[int]) -> InputError:
    """Return an error that asks for the column of a quantity; its note is a table of
    all columns.
    """
    first, *others = [f"--{name} {i + 1}" for i in found] or [f"--{name}"]
    options = " or ".join([first, *others[:1]])
    step = ", or give the step (--step, or step=)" if name == "time" else ""
    error = InputError(
        f"which column is the {name}? Name it ({options} on the command line, "
        f"{name}= in Python){step}; there are {table.listed()}"
    )
    error.add_note(_preview(table))
    return error


def _preview(table: Table) -> str:
    """Return a table of all columns of numbers: number, heading, first values, and
    range.
    """
    rows = [("column", "heading", "first values", "range")]
    for i, values in table.read(table.numeric[:_MOST_SHOWN]).items():
        name = str(table.headings[i])[:_LONGEST_NAME]
        first = ", ".join(map(words.number, values[np.isfinite(values)][:3].tolist()))
        rows.append((str(i + 1), name, first, _range(values)))
    left = len(table.numeric) - _MOST_SHOWN
    more = [f"and {left} more columns"] if left > 0 else []
    return "\n".join([*aligned(rows), *more])
