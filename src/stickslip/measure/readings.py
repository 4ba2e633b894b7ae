"""Reading a force trace measured on a bench, as instruments write it."""

from __future__ import annotations

import difflib
import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from stickslip.errors import InputError, number, shortened, shown
from stickslip.measure.arrays import FEWEST_READINGS, Array
from stickslip.measure.bench import far_outside, spikes
from stickslip.measure.headings import Heading, Quantity, ratio, simple, unit_named
from stickslip.measure.tables import Table, read_cell, read_table

if TYPE_CHECKING:
    import xarray as xr

FEW_UNREADABLE = 3  # rows, or ...
UNREADABLE_FRACTION = 0.01  # ... this fraction of them, may be unreadable


def read_trace(
    path: str | os.PathLike[str],
    *,
    force: str | int | None = None,
    time: str | int | None = None,
    displacement: str | int | None = None,
    load: str | int | None = None,
    step: float | None = None,
    flip: bool = False,
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
) -> xr.Dataset:
    r"""Read a measured force trace from a table: text, .xlsx (with openpyxl) or .tdms (with npTDMS).

    Columns of a text may be separated by tabs, semicolons, commas or blanks. There may be text before the table, a
    line of names with units in brackets or a line of units below it, comments (``#``, ``%``, ``//``, ``!``), and
    one unit in the cells (``0.04 N``). Rows that cannot be read are reported, and the force
    there is interpolated linearly in time, so that the gap stays a gap in time; more than 3 of them, and more
    than 1 % of the rows, are an error. Spikes of a single sample, six standard deviations off, are interpolated, too.

    Parameters
    ----------
    path : path
        The file; at most 100 MB.
    force, time, displacement, load : str or int, optional
        Columns by name or by number, from 1. By default the columns whose names or units say so; the only
        column of numbers besides is the force. A column of the coefficient of friction will do for a force. The
        normal load may be a quantity, too: ``"20 N"``.
    step : float, optional
        Time from one row to the next, in s, where the file has no column of times.
    flip : bool
        Change the sign of the force: for a sensor that counts pull as negative, and has an offset.
    delimiter : str, optional
        What separates the columns; found out by default.
    decimal : {".", ","}, optional
        Decimal sign; found out by default.

    Returns
    -------
    Dataset
        `spring_force` along `time`, and `filled`, true where the force was interpolated; `measured_displacement`,
        `load` and, with a load, `mu`, the force over the load, where the file has them. Units are those of the file; N
        and s where it says nothing. A coefficient of friction read as `spring_force` has the unit 1. Attributes
        ``source``, ``rows``, ``flipped``,
        ``note`` (what was filled in and what was assumed, in words) and ``unreadable`` (JSON: a list of line
        numbers and texts).

    Raises
    ------
    InputError
        If there is no such file, or it is no table of numbers, or no such column; if the choice of the
        columns or a unit is not clear; if times do not rise; if too many rows are unreadable, or fewer than 16
        are left.

    Examples
    --------
    >>> import stickslip as ss
    >>> with open("bench.csv", "w") as file:
    ...     print("Zeit;Kraft", "ms;mN", *(f"{10 * i};{5 + i % 7},5" for i in range(40)), sep="\n", file=file)
    >>> trace = ss.read_trace("bench.csv")
    >>> trace["spring_force"].attrs["units"], trace["time"].attrs["units"], float(trace["spring_force"].max())
    ('mN', 'ms', 11.5)
    """
    place = str(path)
    if step is not None:
        step = number("step", step, at_least=1e-12, at_most=1e12, hint="s from one row to the next")
        if time is not None:
            raise InputError(f"{place}: both step = {step:g} and time = {time!r} are given; leave one out")
    table = read_table(place, delimiter, decimal)
    constant = _quantity(load)
    asked = {"force": force, "time": time, "displacement": displacement, "load": None if constant else load}
    chosen = _choose(table, asked, step)
    headings = {name: table.headings[i] for name, i in chosen.items()}
    values, unreadable = _rows(table, chosen, step or table.step or 0.0)
    del table  # a text as large as the file
    return _dataset(place, headings, values, unreadable, constant, flip)


def _rows(table: Table, chosen: dict[str, int], step: float) -> tuple[dict[str, Array], dict[int, str]]:
    """The columns that were chosen, with times, and the lines that cannot be read; `InputError` if these are many."""
    columns, lines = table.read(chosen.values())
    values = {name: columns[i] for name, i in chosen.items()}
    force = values["force"]
    force[far_outside(force)] = np.nan
    times = values.setdefault("time", step * np.arange(force.size, dtype=float))
    bad = lines[~(np.isfinite(times) & np.isfinite(force))]
    if bad.size > max(FEW_UNREADABLE, UNREADABLE_FRACTION * lines.size):
        raise InputError(
            f"{table.place}: {bad.size} of {lines.size} rows cannot be read, first line {bad[0]}: "
            f"{shortened(table.line(int(bad[0])))!r}; each row needs a finite number, not far outside"
            " the rest; choose the columns, or mend the file"
        )
    if (left := lines.size - bad.size) < FEWEST_READINGS:
        raise InputError(f"{table.place}: {left} readings are too few to judge; at least {FEWEST_READINGS} are needed")
    known = np.flatnonzero(np.isfinite(times))
    back = np.flatnonzero(np.diff(times[known]) <= 0)
    if back.size:
        before, after = known[back[0] : back[0] + 2]
        raise InputError(
            f"{table.place}: line {lines[after]}: time {times[after]:g} does not come after {times[before]:g}; times "
            "must rise: sort the rows, or give the step (--step on the command line, step= in Python) instead"
        )
    return values, {line: table.line(line) for line in bad.tolist()}


def _dataset(
    place: str,
    headings: dict[str, Heading],
    values: dict[str, Array],
    unreadable: dict[int, str],
    load: tuple[float | Array, str] | None,
    flip: bool,
) -> xr.Dataset:
    """Fill the gaps, and label what was read."""
    import xarray as xr

    force, times = values["force"], values["time"]
    unit = {name: heading.unit for name, heading in headings.items()}
    readable = np.isfinite(times) & np.isfinite(force)
    spiky = spikes(force)
    force[spiky] = np.nan
    kept = np.isfinite(times)
    kept[: np.argmax(readable)] = kept[readable.size - np.argmax(readable[::-1]) :] = False
    t = times[kept]

    def filled(name: str) -> Array:
        part: Array = values[name][kept]
        known = np.isfinite(part)
        return part if known.all() else np.asarray(np.interp(t, t[known], part[known]))

    def along_time(column: object, unit: str, text: str) -> tuple[str, object, dict[str, str]]:
        return "time", column, {"units": unit, "long_name": text}

    coefficient = headings["force"].quantity == "coefficient"
    force_unit = "1" if coefficient else unit["force"] or "N"
    pull = (-1.0 if flip else 1.0) * filled("force")
    found = {
        "spring_force": along_time(pull, force_unit, "coefficient of friction" if coefficient else "force"),
        "filled": along_time((~readable | spiky)[kept], "1", "row was unreadable, or a spike; force interpolated"),
    }
    notes = _note(unreadable, force.size)
    if spiky.any():
        notes.append(f"{np.count_nonzero(spiky)} spikes of a single sample; the force there is interpolated")
    if not coefficient and not unit["force"]:
        notes.append("the file names no unit of the force: N assumed")
    if not unit.get("time", "s"):
        notes.append("the file names no unit of the time: s assumed")
    if "displacement" in values:
        way = filled("displacement")
        found["measured_displacement"] = along_time(way, unit["displacement"], "displacement, as measured")
    if load is None and "load" in values:
        load = filled("load"), unit["load"] or force_unit
    if load is not None:
        loads, load_unit = np.full(t.size, load[0]), load[1]
        found["load"] = along_time(loads, load_unit, "normal load")
        size = 1.0 if force_unit == load_unit else ratio(force_unit, load_unit)
        if size is None and not coefficient:
            notes.append(f"no coefficient of friction: the force is in {force_unit}, the load in {load_unit}")
        elif size is not None and not coefficient:
            mu = np.divide(size * pull, loads, out=np.full(t.size, np.nan), where=loads != 0)
            found["mu"] = along_time(mu, "1", "coefficient of friction")
    return xr.Dataset(
        found,
        coords={"time": along_time(t, unit.get("time") or "s", "time")},
        attrs={
            "source": Path(place).name,
            "rows": force.size,
            "flipped": int(flip),
            "note": "; ".join(notes),
            "unreadable": json.dumps([{"line": line, "text": text} for line, text in unreadable.items()]),
        },
    )


# ---------------------------------------------------------------------------------------------------------------------
# Which column is what
# ---------------------------------------------------------------------------------------------------------------------


def _choose(table: Table, asked: dict[str, str | int | None], step: float | None) -> dict[str, int]:
    """Columns that were asked for, and those that the headings tell."""
    place = table.place
    chosen = {name: _column(table, name, wanted) for name, wanted in asked.items() if wanted is not None}

    def named(quantity: str) -> list[int]:
        return [i for i in table.numeric if table.headings[i].quantity == quantity and i not in chosen.values()]

    if "time" not in chosen and len(clocks := named("time")) == 1:
        chosen["time"] = clocks[0]
    if "force" not in chosen:
        free = [i for i in table.numeric if i not in chosen.values()]
        only = [i for i in free if len(free) == 1 and _may_be_force(table.headings[i])]
        forces = named("force") or named("coefficient") or only
        if len(forces) != 1:
            raise _no_force(table, free)
        chosen["force"] = forces[0]
    for name in ("displacement", "load"):
        if name not in chosen and len(found := named(name)) == 1:
            chosen[name] = found[0]
    taken: dict[int, str] = {}
    for name, i in chosen.items():
        if i in taken:
            raise InputError(
                f"{place}: column {i + 1} cannot be both {name} and {taken[i]}; there are {table.listed()}"
            )
        taken[i] = name
    if step is not None:
        chosen.pop("time", None)
    elif table.step is None and "time" not in chosen:
        raise _no_time(table)
    return chosen


def _no_force(table: Table, free: list[int]) -> InputError:
    """What to raise where no column, or one of several, is the force."""
    text = "" if free else _text_named(table, "force")
    return InputError(
        f"{table.place}: {text} holds no numbers that can be read; write 1234.5, without a mark between thousands"
        if text
        else f"{table.place}: which column is the force? Name it (--force on the command line, force= in Python); "
        f"there are {table.listed()}"
    )


def _no_time(table: Table) -> InputError:
    """What to raise where no column holds times, and no step is given."""
    say = "give the seconds from one row to the next (--step on the command line, step= in Python)"
    text = _text_named(table, "time")
    return InputError(
        f"{table.place}: {text} holds times of day or other text, no numbers; {say}"
        if text
        else f"{table.place}: no column is labelled as time; {say} or name the column (--time, time=); there are "
        f"{table.listed()}"
    )


def _text_named(table: Table, quantity: Quantity) -> str:
    """The first column with this name that holds no numbers, for a message."""
    named = [i for i, heading in enumerate(table.headings) if heading.quantity == quantity and i not in table.numeric]
    return f"column {named[0] + 1} '{table.headings[named[0]]}'" if named else ""


def _may_be_force(heading: Heading) -> bool:
    kind = (unit_named(heading.unit) or ("",))[0]
    plain = kind in ("", "force", "stress", "signal", "number", "percentage")
    return plain and heading.quantity in ("force", "load", "coefficient", "")


def _column(table: Table, what: str, wanted: str | int) -> int:
    """Index of a column given by name or number."""
    names, found, hint = [simple(heading.name) for heading in table.headings], [], "counted from 1, "
    if isinstance(wanted, str):
        plain = {simple(wanted), simple(Heading.read(wanted).name)} - {""}
        found = [i for i, name in enumerate(names) if name in plain]
        near = difflib.get_close_matches(simple(wanted), filter(None, names), n=1, cutoff=0.5)
        hint = f"did you mean {table.headings[names.index(near[0])].name!r}? " if near else ""
    if not found and re.fullmatch(r"\s*[0-9]{1,6}\s*", str(wanted)) and 0 < int(wanted) <= len(names):
        found = [int(wanted) - 1]
    if len(found) == 1 and found[0] in table.numeric:
        return found[0]
    mistake = (
        f"{len(found)} columns have this name; give the number"
        if found[1:]
        else f"holds no number in column {found[0] + 1}; columns of numbers are {table.listed()}"
        if found
        else f"no such column; {hint}there are {table.listed()}"
    )
    raise InputError(f"{table.place}: {what} = {shown(wanted)}: {mistake}")


def _quantity(load: str | int | None) -> tuple[float, str] | None:
    """The load, where it is given as a quantity and not as a column."""
    value, unit = read_cell(load) if isinstance(load, str) else (None, "")
    if value is None or not unit:
        return None
    if (unit_named(unit) or ("",))[0] not in ("force", "stress") or value <= 0:
        raise InputError(f"load = {shown(load)}: must be a force above 0 such as '20 N', or a column")
    return value, unit


def _note(unreadable: dict[int, str], rows: int) -> list[str]:
    if not unreadable:
        return []
    shown = [f"line {line}: {shortened(text)!r}" for line, text in [*unreadable.items()][:5]]
    more = [f"and {len(unreadable) - 5} more"] if len(unreadable) > 5 else []
    said = "; ".join(shown + more)
    return [f"{len(unreadable)} of {rows} rows could not be read; the force there is interpolated in time ({said})"]
