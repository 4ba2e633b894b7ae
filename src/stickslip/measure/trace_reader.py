"""Reading a force trace measured on a bench, as instruments write it."""

import re
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import xarray as xr

from stickslip.errors import InputError, shortened, shown
from stickslip.io import files
from stickslip.measure.headings import Heading, ratio, simple
from stickslip.measure.sensor import far_outside, spikes
from stickslip.measure.tables import Table, read_cell, read_table
from stickslip.measure.trace import FEWEST_READINGS, Array
from stickslip.model.quantities import read_value
from stickslip.simulation import labelled

LARGEST_FILE = 100_000_000  # bytes
FEW_UNREADABLE = 3  # rows, or ...
UNREADABLE_FRACTION = 0.01  # ... this fraction of them, may be unreadable


def read_trace(
    path: files.FileName,
    *,
    force: str | int | None = None,
    time: str | int | None = None,
    displacement: str | int | None = None,
    load: str | int | None = None,
    step: float | str | None = None,
    flip: bool = False,
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
) -> xr.Dataset:
    r"""Read a measured force trace from a table: text, .xlsx (with openpyxl) or .tdms
    (with npTDMS).

    Columns of a text may be separated by tabs, semicolons, commas or blanks. There may
    be text before the table, names with units in brackets or in a line below, comments
    (``#``, ``%``, ``//``, ``!``), and one unit in the cells (``0.04 N``). Where rows
    cannot be read, and at spikes of a single sample, six standard deviations off, the
    force is interpolated linearly in time, and that is reported; more than 3 unreadable
    rows, and more than 1 %, are an error, those aside that hold one value far outside
    the others, which stands for no reading: -9999.

    Raises `InputError` if there is no such file, or it is no table of numbers, or no
    such column; if the choice of the columns or a unit is not clear; if times do not
    rise; if too many rows are unreadable, or fewer than 16 are left.

    Parameters
    ----------
    path : path
        The file; at most 100 MB.
    force, time, displacement, load : str or int, optional
        Columns by name or by number, from 1. By default those whose names or units say
        so; the only column of numbers besides, or the coefficient of friction, is the
        force. The normal load may be a quantity, too: ``"20 N"``.
    step : float or str, optional
        Sampling interval, if the table has no time column: in s, or ``"0.5 ms"``.
    flip : bool
        Change the sign of the force: for a sensor that counts pull as negative, and has
        an offset.
    delimiter : str, optional
        What separates the columns; found out by default.
    decimal : {".", ","}, optional
        Decimal sign; found out by default.

    Returns
    -------
    Dataset
        Along `time`: `spring_force` (of the unit 1 if it is a coefficient), `filled`,
        true where it was interpolated, and, where known, `measured_displacement`,
        `load` and `mu`, the force over the load. Units are those of the file; N and s
        where it says nothing. Attributes ``source``, ``rows``, ``flipped``, ``spikes``
        and ``note``: what was filled in and what was assumed, in words.

    Examples
    --------
    >>> with open("bench.csv", "w") as file:
    ...     print(
    ...         "Zeit;Kraft",
    ...         "ms;mN",
    ...         *(f"{10 * i};{5 + i % 7},5" for i in range(40)),
    ...         sep="\n",
    ...         file=file,
    ...     )
    >>> trace = ss.read_trace("bench.csv")
    >>> (
    ...     trace["spring_force"].attrs["units"],
    ...     trace["time"].attrs["units"],
    ...     float(trace["spring_force"].max()),
    ... )
    ('mN', 'ms', 11.5)
    """
    if step is not None and time is not None:
        raise InputError(
            f"{path}: both step = {step} and time = {time!r} are given; leave one out"
        )
    seconds = (
        None if step is None else read_value("step", step, "s", "0.5 ms", bare=True)
    )
    raw = files.read(path, "force trace", largest=LARGEST_FILE)
    try:
        table = read_table(raw, delimiter, decimal)
        del raw  # and the table, once read: they are as large as the file
        constant = (
            read_value("load", load, "N", "20 N")
            if isinstance(load, str) and read_cell(load)[1]
            else None
        )
        asked = {
            "force": force,
            "time": time,
            "displacement": displacement,
            "load": None if constant else load,
        }
        chosen = _choose(table, asked, seconds or table.step)
        if seconds:
            chosen.pop("time", None)
        units = {"time": "s", "load": "N"}
        units |= {name: table.headings[i].unit for name, i in chosen.items()}
        if table.headings[chosen["force"]].quantity == "coefficient":
            units["force"] = "1"
        values, notes = _rows(table, chosen, seconds or table.step or 0.0)
        notes = [*table.notes, *notes]
        del table
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if constant:
        values["load"] = np.full_like(values["force"], constant)
    return _dataset(units, values, notes, flip).assign_attrs(source=Path(path).name)


def _rows(
    table: Table, chosen: Mapping[str, int], step: float
) -> tuple[dict[str, Array], list[str]]:
    """The columns that were chosen, with times, and a note of rows that cannot be
    read; `InputError` if many cannot.
    """
    columns, lines = table.read(chosen.values())
    values = {name: columns[i] for name, i in chosen.items()}
    force = values["force"]
    outside = far_outside(force)
    # What a logger writes for no reading is one value, however often it comes; before
    # and after a test may be anything.
    first, last = np.flatnonzero(~outside)[[0, -1]]
    within = force[first:last][outside[first:last]]
    none = np.count_nonzero(outside) - (np.unique(within).size > 1) * within.size
    force[outside] = np.nan
    times = values.setdefault("time", step * np.arange(force.size, dtype=float))
    bad = lines[~np.isfinite(times + force)].tolist()
    told = [f"line {line}: {shortened(table.line(line))!r}" for line in bad[:5]]
    if len(bad) - none > max(FEW_UNREADABLE, UNREADABLE_FRACTION * lines.size):
        needed = (
            "each needs a finite number, in the unit of the others and not far "
            "outside the rest"
        )
        raise InputError(
            f"{len(bad)} of {lines.size} rows cannot be read, first {told[0]}; {needed}"
        )
    if (left := lines.size - len(bad)) < FEWEST_READINGS:
        raise InputError(
            f"{left} readings are too few to judge; at least {FEWEST_READINGS} are "
            "needed"
        )
    known = np.flatnonzero(np.isfinite(times))
    back = known[1:][np.diff(times[known]) <= 0]
    if back.size:
        line = lines[back[0]]
        is_clock = ":" in table.line(line)
        remedy = (
            "where a clock was set back, write times with their offset from UTC"
            if is_clock
            else "sort the rows"
        )
        raise InputError(
            f"line {line}: time {times[back[0]]:g} does not come after that of the row "
            f"before; times must rise: {remedy}, or give the step instead (--step, or "
            "step=)"
        )
    if not bad:
        return values, []
    if len(bad) > 5:
        told.append(f"and {len(bad) - 5} more")
    text = (
        "rows could not be read; the force there is interpolated in time "
        f"({'; '.join(told)})"
    )
    return values, [f"{len(bad)} of {lines.size} {text}"]


_TEXTS = {
    "force": ("spring_force", "force"),
    "displacement": ("measured_displacement", "displacement, as measured"),
    "load": ("load", "normal load"),
    "mu": ("mu", "coefficient of friction"),
    "filled": ("filled", "row was unreadable, or a spike; force interpolated"),
}
"""What is kept of a trace: the name of each variable, and its title."""


def _dataset(
    units: dict[str, str], values: dict[str, Array], notes: list[str], flip: bool
) -> xr.Dataset:
    """Fill the gaps, and label what was read."""
    rows = pd.DataFrame(values)
    spiky = spikes(values["force"])
    count = int(np.count_nonzero(spiky))
    if count:
        many = f"{count} spike{'s' * (count > 1)} of a single sample"
        notes.append(f"{many}; the force there is interpolated")
    rows.loc[spiky, "force"] = np.nan
    known = np.flatnonzero(np.isfinite(rows["force"] + rows["time"]))
    rows = rows[known[0] : known[-1] + 1].dropna(subset="time").set_index("time")
    missing = rows["force"].isna()
    rows = rows.interpolate("index", limit_direction="both")
    rows["force"] *= -1.0 if flip else 1.0
    for name, usual in (("force", "N"), ("time", "s")):
        if not units[name]:
            units[name] = usual
            notes.append(f"the file names no unit of the {name}: {usual} assumed")
    texts = dict(_TEXTS)
    units["load"] = units["load"] or units["force"]
    if units["force"] == "1":
        texts["force"] = ("spring_force", "coefficient of friction")
    elif "load" in rows:
        alike = units["force"] == units["load"]
        if size := 1.0 if alike else ratio(units["force"], units["load"]):
            rows["mu"] = size * rows["force"] / rows["load"].replace(0.0, np.nan)
        else:
            notes.append(
                f"no coefficient of friction: the force is in {units['force']}, the "
                f"load in {units['load']}"
            )
    rows["filled"] = missing
    found = {}
    for key in rows:
        name, title = texts[key]
        found[name] = labelled(title, "time", rows[key], units.get(key, "1"))
    time = labelled("time", "time", rows.index, units["time"])
    attrs = {
        "rows": values["force"].size,
        "flipped": int(flip),
        "spikes": count,
        "note": "; ".join(notes),
    }
    return xr.Dataset(found, {"time": time}, attrs)


def _choose(
    table: Table, asked: Mapping[str, str | int | None], step: float | None
) -> dict[str, int]:
    """Columns that were asked for, and those that the headings tell; the times may
    be told by a step.
    """
    chosen = {
        name: _column(table, name, wanted)
        for name, wanted in asked.items()
        if wanted is not None
    }
    for one, other in combinations(chosen, 2):
        if chosen[one] == chosen[other]:
            raise InputError(
                f"column {chosen[one] + 1} cannot be both {one} and {other}; there are "
                f"{table.listed()}"
            )
    for name in ("time", "force", "displacement", "load"):
        if name in chosen:
            continue
        free = [i for i in table.numeric if i not in chosen.values()]
        kinds: list[tuple[str, ...]] = [(name,)]
        if name == "force":
            # the only column of numbers is the force, whatever it is called
            kinds += [("coefficient",), ("load", "") if len(free) == 1 else ()]
        found: list[int] = []
        for kind in kinds:
            found = found or [i for i in free if table.headings[i].quantity in kind]
        if len(found) == 1:
            chosen[name] = found[0]
        elif name == "force" or (name == "time" and not step):
            given = f"Name it (--{name} on the command line, {name}= in Python)"
            given += ", or give the step (--step, or step=)" if name == "time" else ""
            raise InputError(
                f"which column is the {name}? {given}; there are {table.listed()}"
            )
    return chosen


def _column(table: Table, name: str, wanted: str | int) -> int:
    """Index of a column given by name or number."""
    text = str(wanted)
    names = {simple(text), simple(Heading.read(text).name)} - {""}
    found = [
        i for i, heading in enumerate(table.headings) if simple(heading.name) in names
    ]
    if not found and re.fullmatch(r"\s*[0-9]{1,6}\s*", text):
        found = [int(text) - 1]
    if len(found) != 1 or found[0] not in table.numeric:
        raise InputError(
            f"{name} = {shown(wanted)}: no such column of numbers, or several of this "
            f"name; counted from 1, there are {table.listed()}"
        )
    return found[0]
