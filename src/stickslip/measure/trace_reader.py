"""Reading of measured force traces from files of instruments."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from stickslip import words
from stickslip.arrays import labelled
from stickslip.errors import InputError, one_line, refused, shortened
from stickslip.io import files
from stickslip.io.clocks import DAY, are_days, unit_since_1970
from stickslip.io.headings import WEIGHTS, Heading, kind_of, ratio, unit_named
from stickslip.io.table_files import read_table
from stickslip.io.table_text import Table, read_cell
from stickslip.measure.column_choice import Choice, ColumnName, choose, rises_evenly
from stickslip.measure.sensor import Mask, far_outside, spikes
from stickslip.measure.trace import FEWEST_READINGS, Array
from stickslip.model.quantities import read_value

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

LARGEST_FILE = 100_000_000  # bytes
# 2.5 N/V: a number, its unit and, optionally, the unit of the readings
SCALE = re.compile(
    r"\s*([-+.\d]+(?:[eE][-+\d]+)?)\s*([^/\d\s][^/]*?)\s*(?:/\s*(\S+))?\s*"
)
# number, and fraction, of rows of which the larger may be unreadable
FEW_UNREADABLE = 3
UNREADABLE_FRACTION = 0.01


def read_trace(
    path: files.FileName,
    *,
    force: ColumnName = None,
    time: ColumnName = None,
    displacement: ColumnName = None,
    load: ColumnName = None,
    velocity: ColumnName = None,
    step: float | str | None = None,
    flip: bool = False,
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
) -> xr.Dataset:
    r"""Read a measured force trace from a table: text, .xlsx (with openpyxl), .tdms
    (with npTDMS), .mat, HDF5, .npy, .npz or .wav.

    Columns of a text may be separated by tabs, semicolons, commas or blanks. There may
    be text before the table, names with units in brackets or in a line above or below,
    comments (``#``, ``%``, ``//``, ``!``), and one unit in the cells (``0.04 N``).
    In rows that cannot be read, and at spikes of a single sample, six standard
    deviations off, the force is interpolated linearly in time, and a note reports it;
    more than 3 unreadable rows, if they are more than 1 %, are an error. A blank cell,
    nan, OL, or one value far outside the others, such as -9999, means that there was no
    reading; such rows are left out if they are more than 16 in succession, or at least
    half of all.

    Where the clock restarts, another test begins: its times are shifted to follow those
    of the test before, and the tests are numbered as parts.

    Raises `InputError` if there is no such file, it holds no table of numbers, or the
    table has no such column; if the choice of the columns or a unit is not clear; if
    times do not rise; if too many rows are unreadable, or fewer than 16 are left.

    Parameters
    ----------
    path : path
        The file; at most 100 MB.
    force, time, displacement, load, velocity : str or int, optional
        Columns by name or by number, counted from 1. A unit may follow after a colon if
        the file has none: ``"3:mN"``; for the force, also the force of one reading:
        ``"3:2.5 N/V"``, ``":2.5 N/V"``. By default, columns are chosen by their names
        or units. The force may be a torque or a coefficient of friction, or the only
        other column of numbers; the time may be a column without a name that rises
        evenly. The normal load may be a quantity: ``"20 N"``.
    step : float or str, optional
        Sampling interval, if the table has no time column: in s, or ``"0.5 ms"``.
    flip : bool
        Whether to change the sign of the force, for a sensor with an offset that counts
        pull as negative.
    delimiter : str, optional
        Separator of the columns; detected by default.
    decimal : {".", ","}, optional
        Decimal sign; detected by default.

    Returns
    -------
    Dataset
        Along `time`: `spring_force` (with the unit 1 if it is a coefficient), `filled`,
        true where it was interpolated, and, where known, `measured_displacement`,
        `load` and `mu`, the force over the absolute load, `measured_velocity`, and
        `part`, the number of the test or of its step. Units are those of the file, or N
        and s if it has none. Attributes: ``source``; ``read``, the columns in words;
        ``rows``, ``flipped``, ``spikes``; and ``note``, with the interpolations and
        assumptions.

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
    column, colon, text = str(force).rpartition(":")
    scale = SCALE.fullmatch(text) if colon else None
    if scale:
        force = column or None
    raw = files.read(path, "force trace", largest=LARGEST_FILE)
    try:
        table = read_table(raw, delimiter, decimal)
        del raw  # the content, and later the table, are as large as the file
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
            "velocity": velocity,
        }
        interval = seconds or table.step or 0.0
        chosen, taken = choose(
            table, asked, timed=bool(seconds), scaled=scale is not None
        )
        if seconds:
            chosen.pop("time", None)
            taken += _other_time(table, seconds)
        values, notes = _rows(table, chosen, interval)
        notes = [*table.notes, *taken, *notes]
        del table
        heading = chosen["force"].heading
        size, force_unit = _scale(scale, heading)
        values["force"] *= size
    except InputError as error:
        # change the error itself, as a new one would not have its notes
        error.args = (one_line(f"{path}: {error}"),)
        raise
    units = {"time": "s", "load": "N"}
    units |= {name: each.heading.unit for name, each in chosen.items()}
    units |= {"force": force_unit, "part": "1"}
    if constant:
        values["load"] = np.full_like(values["force"], constant)
    data = _dataset(units, values, notes, flip=flip, is_torque=heading.is_torque)
    return data.assign_attrs(source=Path(path).name, read=_described(data, chosen))


def _other_time(table: Table, step: float) -> list[str]:
    """Return a note of a column of times that contradicts the given step; raises
    `InputError` if that column has a unit.
    """
    for i in table.numeric:
        heading = table.headings[i]
        if heading.quantity != "time":
            continue
        times = table.read([i])[i]
        if not rises_evenly(times[:-1]):  # the last row may be cut off
            continue
        usual = float(np.median(np.diff(times[np.isfinite(times)])))
        size = ratio(heading.unit or "s", "s") or 1.0
        if math.isclose(usual * size, step, rel_tol=0.01):
            continue
        column = Choice(i, heading)
        if not heading.unit:
            by = f"{usual:.4g}"
            note = "is not taken for the time, as the step is given"
            return [f"{column}, which rises by {by}, {note}"]
        by = words.engineering(usual, heading.unit)
        raise InputError(
            f"step = {step:g} s: {column} rises by {by} instead; leave out the step"
        )
    return []


def _described(data: xr.Dataset, chosen: Mapping[str, Choice]) -> str:
    """Return in words which columns were read, and the sampling interval."""
    order = [name for name in ("time", *_TEXTS) if name in chosen and name != "part"]
    named = [f"{name}: {chosen[name]}" for name in order]
    usual = float(np.median(np.diff(data["time"])))
    each = words.engineering(usual, data["time"].attrs["units"])
    return "; ".join([*named, f"{data.sizes['time']} readings, one every {each}"])


def _scale(scale: re.Match[str] | None, heading: Heading) -> tuple[float, str]:
    """Return the factor and the unit of the force for a column of readings: those of a
    given scale, 2.5 N/V, or of the column. A coefficient of friction has the unit 1.
    """
    unit = heading.unit
    if scale is None and heading.quantity == "coefficient":
        kind, size = unit_named(unit) or ("number", 1.0)
        return (1.0, unit) if kind == "signal" else (size, "1")
    if scale is None:
        return 1.0, unit
    number, force_unit, given = scale.groups()
    force = read_cell(number)[0]
    of = given or unit
    readings = ratio(unit, of) if unit and unit != of else 1.0
    if force and readings and kind_of(force_unit) in ("force", "torque"):
        return force * readings, str(force_unit)
    here = f", of a column in {unit}" if unit else ""
    raise refused(
        "scale", scale[0], f"must be the force of one reading{here}: 2.5 N/V, 3 mN"
    )


def _rows(
    table: Table, chosen: Mapping[str, Choice], step: float
) -> tuple[dict[str, Array], list[str]]:
    """Return the chosen columns, with times, and notes of rows that cannot be read;
    raises `InputError` if many rows cannot be read.
    """
    read = table.read([each.place for each in chosen.values()])
    values = {name: read[each.place] for name, each in chosen.items()}
    values.setdefault("time", step * np.arange(table.rows.size, dtype=float))
    lines, notes = _without_a_last_row(table, values)
    blank = np.isfinite(values["time"]) & np.isnan(values["force"])
    count = np.count_nonzero(blank)
    # the force was recorded less often than another quantity
    if 0.5 * blank.size <= count < blank.size:
        notes.append(f"{count} of {blank.size} rows hold no force and are left out")
        lines = lines[~blank]
        values = {name: each[~blank] for name, each in values.items()}
        blank = blank[~blank]
    for each in values.values():
        each[np.isinf(each)] = np.nan
    unread = _unreadable(table, values, lines, blank)
    notes += _put_in_turn(table, values, lines)
    return values, notes + unread


def _without_a_last_row(
    table: Table, values: dict[str, Array]
) -> tuple[NDArray[np.int64], list[str]]:
    """Remove a last row whose time does not rise, as it is cut off or written twice;
    return the line numbers of the other rows, and a note.
    """
    times = values["time"]
    known = np.flatnonzero(np.isfinite(times))
    if known.size < 2 or times[known[-1]] > times[known[-2]]:
        return table.rows, []
    last = int(known[-1])
    for name, each in values.items():
        values[name] = each[:last]
    line = table.rows[last]
    text = shortened(table.line(line))
    note = "is left out, as its time does not come after that of the row before"
    return table.rows[:last], [f"the last row, line {line}: {text!r}, {note}"]


def _unreadable(
    table: Table, values: dict[str, Array], lines: NDArray[np.int64], blank: Mask
) -> list[str]:
    """Replace forces that mean "no reading" by NaN, and return notes of all rows that
    cannot be read.

    Raises `InputError` if many rows cannot be read, apart from those without a reading,
    or if few rows are left.
    """
    force = values["force"]
    outside = far_outside(force)
    # A logger writes the same value each time it has no reading; before and after a
    # test there may be any values.
    first, last = np.flatnonzero(~outside)[[0, -1]]
    outside_in_test = force[first:last][outside[first:last]]
    no_reading = outside | blank
    if np.unique(outside_in_test).size > 1:
        no_reading[first:last] = blank[first:last]
    force[outside] = np.nan
    bad = ~np.isfinite(values["time"] + force)
    wrong = np.count_nonzero(bad & ~no_reading)
    shown_lines = [
        f"line {line}: {shortened(table.line(line))!r}"
        for line in lines[bad][:5].tolist()
    ]
    count = np.count_nonzero(bad)
    if wrong > max(FEW_UNREADABLE, UNREADABLE_FRACTION * lines.size):
        raise InputError(
            f"{count} of {lines.size} rows cannot be read, first {shown_lines[0]}; "
            "each needs a finite number, in the unit of the others and not far outside "
            "the rest"
        )
    left = bad.size - count
    if left < FEWEST_READINGS:
        raise InputError(
            f"{left} readings are too few to judge; at least {FEWEST_READINGS} are "
            "needed"
        )
    if not count:
        return []
    if count > 5:
        shown_lines.append(f"and {count - 5} more")
    most = ""
    if count > FEWEST_READINGS:
        most = f", up to {FEWEST_READINGS} in succession"
    return [
        f"{count} of {lines.size} rows could not be read; the force there is "
        f"interpolated in time{most} ({'; '.join(shown_lines)})"
    ]


def _put_in_turn(
    table: Table, values: dict[str, Array], lines: NDArray[np.int64]
) -> list[str]:
    """Shift the times of tests, between which the clock restarts, so that the tests
    follow one another; number tests and their steps, and return notes. Raises
    `InputError` if times fall for another reason.
    """
    times = values["time"]
    known = np.flatnonzero(np.isfinite(times))
    back = known[1:][np.diff(times[known]) <= 0]
    if not back.size and "part" not in values:
        return []
    tests = [test[np.isfinite(test)] for test in np.split(times, back)]
    restarts = all(
        after[0] - before[0] < 0.5 * (before[-1] - before[0])
        for before, after in pairwise(tests)
    )
    line = lines[back[0]] if back.size else 0
    is_clock = ":" in table.line(line)
    are_tests = restarts and min(map(len, tests)) >= FEWEST_READINGS
    if back.size and (is_clock or not are_tests):
        row = f"line {line}: time {times[back[0]]:g}"
        raise _times_must_rise(row, times[known], is_clock=is_clock)
    usual = np.nanmedian(np.diff(times))
    for at in back:
        times[at:] += np.nanmax(times[:at]) + usual - times[at]
    steps = values.pop("part", np.zeros(times.size))
    changes = np.flatnonzero(np.diff(steps)) + 1
    # a number that changes after a few rows does not number steps
    if np.diff([0, *changes, times.size]).min() < FEWEST_READINGS:
        changes = changes[:0]
    edges = np.isin(np.arange(times.size), [*changes, *back])
    if edges.any():
        values["part"] = 1.0 + np.cumsum(edges, dtype=float)
    if not back.size:
        return []
    tests_joined = f"{back.size + 1} tests, joined one after another"
    return [f"the clock restarts at line {line}: {tests_joined}"]


def _times_must_rise(row: str, times: Array, *, is_clock: bool) -> InputError:
    """Return the error of a row whose time does not rise, and what to do about it."""
    if np.mean(np.diff(times) == 0) > 0.5:
        return InputError(
            f"{row} is that of the row before, as on a clock that shows whole "
            f"seconds: give the step instead (--step, or step=); {times.size} rows "
            f"take {times[-1] - times[0]:g} of its units"
        )
    remedy = "sort the rows"
    if is_clock:
        remedy = "where a clock was set back, write times with their offset from UTC"
    return InputError(
        f"{row} does not come after that of the row before; times must rise: "
        f"{remedy}, or give the step instead (--step, or step=)"
    )


_TEXTS = {
    "force": ("spring_force", "force"),
    "displacement": ("measured_displacement", "displacement, as measured"),
    "load": ("load", "normal load"),
    "mu": ("mu", "coefficient of friction"),
    "velocity": ("measured_velocity", "velocity, as measured"),
    "part": ("part", "number of the test, or of its step"),
    "filled": ("filled", "row was unreadable, or a spike; force interpolated"),
}
"""Names and titles of the variables of a trace."""


def _dataset(
    units: dict[str, str],
    values: dict[str, Array],
    notes: list[str],
    *,
    flip: bool,
    is_torque: bool,
) -> xr.Dataset:
    """Return the columns as a labelled Dataset, in which the force is interpolated at
    unreadable rows and spikes.
    """
    import pandas as pd
    import xarray as xr

    rows = pd.DataFrame(values)
    # find spikes in each part, as they are compared with its noise
    ends = np.flatnonzero(np.diff(values.get("part", np.zeros(1)))) + 1
    parts = np.split(values["force"], ends)
    spiky = np.concatenate([*map(spikes, parts)])
    if count := int(np.count_nonzero(spiky)):
        many = f"{count} spike{'s' * (count > 1)} of a single sample"
        notes.append(f"{many}; the force there is interpolated")
    rows.loc[spiky, "force"] = np.nan
    known = np.flatnonzero(np.isfinite(rows["force"] + rows["time"]))
    rows = rows[known[0] : known[-1] + 1].dropna(subset="time").set_index("time")
    missing = rows["force"].isna()
    if rows.isna().any(axis=None):
        rows = rows[~_in_a_gap(missing)]
        missing = rows["force"].isna()
        rows = rows.interpolate("index", limit_direction="both")
    rows["force"] *= -1.0 if flip else 1.0
    if not units["time"]:
        rows.index = _recognised(rows.index, units, notes)
    for name, usual in (("force", "N m" if is_torque else "N"), ("time", "s")):
        if not units[name]:
            units[name] = usual
            notes.append(f"the file names no unit of the {name}: {usual} assumed")
    units["load"] = units["load"] or units["force"]
    for name in ("force", "load"):
        if weight := WEIGHTS.get(units[name].lower()):
            notes.append(f"{units[name]} of the {name} is read as {weight}, a weight")
            units[name] = weight
    force = "torque" if is_torque else "force"
    if units["force"] == "1":
        force = "coefficient of friction"
    elif "load" in rows:
        alike = units["force"] == units["load"]
        if size := 1.0 if alike else ratio(units["force"], units["load"]):
            # some sensors count a pressing load as negative
            pressed = rows["load"].abs().replace(0.0, np.nan)
            rows["mu"] = size * rows["force"] / pressed
        else:
            notes.append(
                f"no coefficient of friction: the force is in {units['force']}, the "
                f"load in {units['load']}"
            )
    texts = {**_TEXTS, "force": ("spring_force", force)}
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


def _recognised(
    times: pd.Index[Any], units: dict[str, str], notes: list[str]
) -> pd.Index[Any]:
    """Return times without a unit, which are recognised by their size: those since 1970
    get their unit, and days become seconds.
    """
    first, last = times[[0, -1]].tolist()
    if unit := unit_since_1970(first):
        units["time"] = unit
        notes.append(f"the times are taken for {unit} since 1970")
    elif are_days(first, last):
        units["time"] = "s"
        notes.append(
            "the times are taken for days, as spreadsheets count them from 1900, and "
            "MATLAB from 0; if they are not days, write their unit into the heading, "
            "as in time (s)"
        )
        return DAY * (times - first)
    return times


def _in_a_gap(missing: pd.Series[bool]) -> NDArray[np.bool_]:
    """Return a mask of missing readings that are too many in succession to be
    interpolated.
    """
    run = (missing != missing.shift()).cumsum()
    many = missing.groupby(run).transform("size") > FEWEST_READINGS
    return np.asarray(missing & many)
