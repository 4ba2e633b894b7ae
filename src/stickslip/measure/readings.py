"""Reading a force trace measured on a bench, as instruments write it."""

from __future__ import annotations

import difflib
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, number
from stickslip.measure.arrays import FEWEST_READINGS, Array
from stickslip.measure.bench import far_outside, spikes
from stickslip.measure.headings import Heading, ratio, simple, unit_named
from stickslip.measure.tables import Rows, Table, read_cell, short

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
    table = Table.read(place, delimiter, decimal)
    constant = _quantity(load)
    asked = {"force": force, "time": time, "displacement": displacement} | ({} if constant else {"load": load})
    chosen = _choose(table, asked, step)
    read = table.rows(chosen.values())
    return _dataset(table, read, chosen, step=step or table.step or 0.0, load=constant, flip=flip)


def _dataset(
    table: Table,
    read: Rows,
    chosen: dict[str, int],
    *,
    step: float,
    load: tuple[float | Array, str] | None,
    flip: bool,
) -> xr.Dataset:
    """Check the rows, fill the gaps, and label what was read."""
    import xarray as xr

    values = {name: read.values[i] for name, i in chosen.items()}
    units = {name: read.units[i] for name, i in chosen.items()}
    forces = values["force"]
    forces = np.where(far_outside(forces), np.nan, forces)
    times = values["time"] if "time" in chosen else step * np.arange(forces.size, dtype=float)
    readable = np.isfinite(times) & np.isfinite(forces)
    bad = np.flatnonzero(~readable)
    _check_rows(table, read, bad)
    _check_times(table.place, read, times)
    spiky = spikes(forces)
    values["force"] = np.where(spiky, np.nan, forces)
    inner = slice(np.argmax(readable), readable.size - np.argmax(readable[::-1]))
    kept = np.flatnonzero(np.isfinite(times[inner])) + inner.start
    t = times[kept]

    def filled(name: str) -> Array:
        part: Array = values[name][kept]
        known = np.isfinite(part)
        return part if known.all() else np.asarray(np.interp(t, t[known], part[known]))

    coefficient = table.headings[chosen["force"]].quantity == "coefficient"
    force_unit = "1" if coefficient else units["force"] or "N"
    force = (-1.0 if flip else 1.0) * filled("force")
    interpolated = (~readable | spiky)[kept]
    columns: dict[str, tuple[Array | NDArray[np.bool_], str, str]] = {
        "spring_force": (force, force_unit, "coefficient of friction" if coefficient else "force"),
        "filled": (interpolated, "1", "row was unreadable, or a spike; force interpolated"),
    }
    assumed = [] if coefficient or units["force"] else ["the file names no unit of the force: N assumed"]
    if not units.get("time", "s"):
        assumed.append("the file names no unit of the time: s assumed")
    if "displacement" in chosen:
        columns["measured_displacement"] = filled("displacement"), units["displacement"], "displacement, as measured"
    if "load" in chosen:
        load = filled("load"), units["load"] or force_unit
    if load is not None:
        loads, load_unit = np.full(t.size, load[0]), load[1]
        columns["load"] = loads, load_unit, "normal load"
        size = ratio(force_unit, load_unit) if force_unit != load_unit else 1.0
        if size is None and not coefficient:
            assumed.append(f"no coefficient of friction: the force is in {force_unit}, the load in {load_unit}")
        elif size is not None and not coefficient:
            mu = np.divide(size * force, loads, out=np.full(t.size, np.nan), where=loads != 0)
            columns["mu"] = mu, "1", "coefficient of friction"
    if spiky.any():
        assumed.insert(0, f"{np.count_nonzero(spiky)} spikes of a single sample; the force there is interpolated")
    unreadable = [(int(read.lines[i]), table.line(int(read.lines[i]))) for i in bad]
    return xr.Dataset(
        {key: ("time", column, {"units": unit, "long_name": text}) for key, (column, unit, text) in columns.items()},
        coords={"time": ("time", t, {"units": units.get("time") or "s", "long_name": "time"})},
        attrs={
            "source": Path(table.place).name,
            "rows": int(forces.size),
            "flipped": int(flip),
            "note": "; ".join([*_note(unreadable, forces.size), *assumed]),
            "unreadable": json.dumps([{"line": line, "text": text} for line, text in unreadable]),
        },
    )


# ---------------------------------------------------------------------------------------------------------------------
# Which column is what
# ---------------------------------------------------------------------------------------------------------------------


def _choose(table: Table, asked: dict[str, str | int | None], step: float | None) -> dict[str, int]:
    """Columns that were asked for, and those that the headings tell."""
    place = table.place
    given = {name: _column(table, name, wanted) for name, wanted in asked.items() if wanted is not None}

    def only(quantity: str) -> int | None:
        named = [i for i in table.numeric if table.headings[i].quantity == quantity and i not in given.values()]
        return named[0] if len(named) == 1 else None

    if "time" not in given and (clock := only("time")) is not None:
        given["time"] = clock
    if "force" not in given:
        given["force"] = _force_column(table, given, only("force"), only("coefficient"))
    for name in ("displacement", "load"):
        if name in asked and name not in given and (found := only(name)) is not None:
            given[name] = found
    twice = [(a, b) for a in given for b in given if a < b and given[a] == given[b]]
    if twice:
        a, b = sorted(twice[0], reverse=True)
        raise InputError(f"{place}: column {given[a] + 1} cannot be both {a} and {b}; there are {table.listed()}")
    if step is None and table.step is None and "time" not in given:
        timed = [i for i, heading in enumerate(table.headings) if heading.quantity == "time"]
        if timed and timed[0] not in table.numeric:
            raise InputError(
                f"{place}: column {timed[0] + 1} '{table.headings[timed[0]]}' holds times of day or other text, no "
                "numbers; give the seconds from one row to the next (--step on the command line, step= in Python)"
            )
        raise InputError(
            f"{place}: no column is labelled as time; give the seconds from one row to the next (--step on "
            f"the command line, step= in Python) or name the column (--time, time=); there are {table.listed()}"
        )
    if step is not None:
        given.pop("time", None)
    return given


def _force_column(table: Table, given: dict[str, int], named: int | None, coefficient: int | None) -> int:
    """The column of the force: named so, or the only one that may be."""
    if named is not None:
        return named
    forces = [i for i in table.numeric if table.headings[i].quantity == "force" and i not in given.values()]
    if coefficient is not None and not forces:
        return coefficient
    rest = [i for i in table.numeric if i not in given.values()]
    if len(rest) == 1 and _may_be_force(table.headings[rest[0]]):
        return rest[0]
    texts = [i for i, heading in enumerate(table.headings) if heading.quantity == "force" and i not in table.numeric]
    if not rest and texts:
        raise InputError(
            f"{table.place}: column {texts[0] + 1} '{table.headings[texts[0]]}' holds no numbers that can be read; "
            "write 1234.5, without a mark between thousands"
        )
    if not rest and len(table.numeric) == 1 and "time" in given:
        return given.pop("time")
    raise InputError(
        f"{table.place}: which column is the force? Name it (--force on the command line, force= in Python); there "
        f"are {table.listed()}"
    )


def _may_be_force(heading: Heading) -> bool:
    unit = unit_named(heading.unit) if heading.unit else None
    plain = unit is None or unit[0] in ("force", "stress", "signal", "number", "percentage")
    return heading.quantity in ("force", "load", "coefficient", "") and plain


def _column(table: Table, what: str, wanted: str | int) -> int:
    """Index of a column given by name or number."""
    place = table.place
    if isinstance(wanted, str):
        names = [simple(heading.name) for heading in table.headings]
        plain = {simple(wanted), simple(Heading.read(wanted).name)}
        same = [i for i, name in enumerate(names) if name and name in plain]
        if len(same) > 1:
            raise InputError(f"{place}: {what} = {wanted!r}: {len(same)} columns have this name; give the number")
        if same:
            index = same[0]
        elif re.fullmatch(r"\s*[0-9]{1,6}\s*", wanted):
            return _column(table, what, int(wanted))
        else:
            near = difflib.get_close_matches(simple(wanted), [name for name in names if name], n=1, cutoff=0.5)
            hint = f"did you mean {table.headings[names.index(near[0])].name!r}? " if near else ""
            raise InputError(f"{place}: {what} = {short(wanted)!r}: no such column; {hint}there are {table.listed()}")
    else:
        index = int(wanted) - 1
        if isinstance(wanted, bool) or not 0 <= index < len(table.headings):
            raise InputError(
                f"{place}: {what} = {short(str(wanted))}: no such column; counted from 1, there are {table.listed()}"
            )
    if index not in table.numeric:
        raise InputError(
            f"{place}: {what} = {wanted!r}: holds no number in column {index + 1}; columns of numbers are "
            f"{table.listed()}"
        )
    return index


def _quantity(load: str | int | None) -> tuple[float, str] | None:
    """The load, where it is given as a quantity and not as a column."""
    if not isinstance(load, str):
        return None
    value, unit = read_cell(load, comma=False)
    if value is None or not unit:
        return None
    known = unit_named(unit)
    if known is None or known[0] not in ("force", "stress") or value <= 0:
        raise InputError(f"load = {short(load)!r}: must be a force above 0 such as '20 N', or a column")
    return value, unit


# ---------------------------------------------------------------------------------------------------------------------
# Rows
# ---------------------------------------------------------------------------------------------------------------------


def _check_rows(table: Table, read: Rows, bad: np.ndarray[tuple[int, ...], np.dtype[np.intp]]) -> None:
    if bad.size > max(FEW_UNREADABLE, UNREADABLE_FRACTION * read.lines.size):
        line = int(read.lines[bad[0]])
        raise InputError(
            f"{table.place}: {bad.size} of {read.lines.size} rows cannot be read, first line {line}: "
            f"{short(table.line(line))!r}; each row needs a finite number, not far outside"
            " the rest; choose the columns, or mend the file"
        )
    if read.lines.size - bad.size < FEWEST_READINGS:
        raise InputError(
            f"{table.place}: {read.lines.size - bad.size} readings are too few to judge; at least {FEWEST_READINGS} "
            "are needed"
        )


def _check_times(place: str, read: Rows, times: Array) -> None:
    known = np.flatnonzero(np.isfinite(times))
    back = np.flatnonzero(np.diff(times[known]) <= 0)
    if back.size:
        before, after = known[back[0] : back[0] + 2]
        raise InputError(
            f"{place}: line {read.lines[after]}: time {times[after]:g} does not come after {times[before]:g}; times "
            "must rise: sort the rows, or give the step (--step on the command line, step= in Python) instead"
        )


def _note(bad: Sequence[tuple[int, str]], rows: int) -> list[str]:
    if not bad:
        return []
    shown = "; ".join(f"line {line}: {short(text)!r}" for line, text in bad[:5])
    more = f"; and {len(bad) - 5} more" if len(bad) > 5 else ""
    return [f"{len(bad)} of {rows} rows could not be read; the force there is interpolated in time ({shown}{more})"]
