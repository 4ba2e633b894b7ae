"""The table of the force drops of a run or a trace, with their statistics."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from stickslip import words
from stickslip.arrays import labelled, units_of
from stickslip.errors import dataset, number, printable
from stickslip.measure.features import Window
from stickslip.measure.regimes import Regime, judged
from stickslip.measure.slips import Slips, fast_slips, find_slips
from stickslip.measure.strokes import find_strokes
from stickslip.measure.trace import Array, Trace, dataset_of, mean_and_std
from stickslip.words import prefixed

if TYPE_CHECKING:
    import xarray as xr

_DUST = 1e-9  # fraction of a mean: smaller scatter comes from rounding
# columns whose sign depends on the direction of the drive
_SIGNED = ("force_before", "force_after", "mu_before", "mu_after")


def drops(
    data: xr.Dataset, *, minimum_drop: float | None = None, after: float | None = None
) -> xr.Dataset:
    """Return one row per slip, a slip being a significant drop of the force of the
    driving spring.

    In a sustained oscillation without sticking each drop is that of a cycle, and the
    attribute ``drops_are`` says so. Every drop, and every rise between two, is at least
    `minimum_drop`. Drops of the ringing after a slip are joined to it. Drops that the
    start or the end of the data cuts off are left out and counted in the attribute
    ``cut``. In stick-slip, drops slower than 3.5 times the drive are left out, if the
    velocity is known. The strokes of a reciprocating test are evaluated separately.
    Raises what `regime` does.

    Parameters
    ----------
    data : Dataset, DataArray or Series
        As for `regime`.
    minimum_drop : float, optional
        Smallest drop that counts, in the unit of `spring_force`. By default the largest
        drop that noise from sample to sample makes by chance, or a tenth of the typical
        drop (the median, weighted by the squares of the drops) if that is larger; then
        smooth sliding has no slips, and drops before it count only if they exceed its
        peak to peak. The attribute ``criterion`` describes the choice.
    after : float, optional
        Ignore data before this time, in the unit of `t`.

    Returns
    -------
    Dataset
        Along ``event``: `start` and `end` (the force leaves its peak and reaches its
        trough, to 5 % of the drop), `force_before`, `force_after` (in a noisy trace
        from lines through the loading before and after a slip, as the extremes of noise
        overstate its drop), `drop`, `duration`, `recurrence`, `loading_rate`, and,
        where the data hold them, `slip`, `peak_velocity`, `mu_before`, `mu_after`,
        `mu_drop` and `stroke`. Attributes of each: ``mean`` and ``std`` (of a sample);
        of the table: ``count``, ``drops_are``, ``minimum_drop``, ``noise``,
        ``criterion`` and ``cut``.

    Examples
    --------
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> trace = xr.Dataset(
    ...     {"spring_force": ("time", 3.0 + 2.0 * (t % 1.5), {"units": "N"})},
    ...     {"time": t},
    ... )
    >>> found = ss.drops(trace)
    >>> found.sizes["event"], round(found["drop"].attrs["mean"], 2)
    (13, 2.98)
    """
    return regime_and_drops(data, minimum_drop=minimum_drop, after=after)[1]


def regime_and_drops(
    data: xr.Dataset, *, minimum_drop: float | None = None, after: float | None = None
) -> tuple[Regime, xr.Dataset]:
    """Return the results of `regime` and `drops`, found together."""
    import xarray as xr

    if minimum_drop is not None:
        minimum_drop = number(
            "minimum_drop", minimum_drop, above=0, hint="in the unit of spring_force"
        )
    data = dataset_of(data)
    trace, seen = judged(data, after)
    parts = (find_strokes(trace)[0] if trace.measured else []) or [trace]
    tables = [
        _table(data, part, _drops_beside(seen, part, minimum_drop)) for part in parts
    ]
    table = xr.concat(tables, "event", combine_attrs="override")
    for name in ("count", "cut"):
        table.attrs[name] = sum(each.attrs[name] for each in tables)
    table.attrs["drops_are"] = seen.drops_are
    number_of = {"long_name": "number of the slip"}
    events = np.arange(table.sizes["event"])
    table = table.assign_coords(event=("event", events, number_of))
    along = 1.0
    if len(tables) > 1:
        counts = [each.sizes["event"] for each in tables]
        strokes = np.repeat(np.arange(len(tables)), counts)
        table["stroke"] = labelled("number of the stroke", "event", strokes, "1")
        table.attrs["criterion"] = f"of the first stroke: {table.attrs['criterion']}"
        along = np.sign(table["force_before"].values)
    for key, column in table.data_vars.items():
        if key not in ("start", "end", "stroke"):
            values = column.values * (along if key in _SIGNED else 1.0)
            column.attrs["mean"], column.attrs["std"], _ = mean_and_std(values)
    return seen, table


def _drops_beside(seen: Regime, trace: Trace, minimum_drop: float | None) -> Slips:
    """Return the drops of a trace that its regime counts.

    In stick-slip these are the fast drops. In smooth sliding, they are those outside
    the window of the regime that exceed the peak to peak in it.
    """
    found = find_slips(trace, minimum_drop)
    if minimum_drop is not None:
        return found
    if seen.kind == "stick-slip":
        return fast_slips(
            trace,
            Window(trace, found).past_waves.slips,
        )
    if seen.kind != "smooth sliding":
        return found
    begin, end = seen.window
    outside = (found.times < begin) | (found.times > end)
    kept = outside & (found.drops > seen.peak_to_peak)
    if kept.any():
        return found.only(kept, criterion=f"{found.criterion}, before smooth sliding")
    return found.only(kept, cut=0, criterion=f"no slips: smooth sliding, {seen.reason}")


def _table(data: xr.Dataset, trace: Trace, found: Slips) -> xr.Dataset:
    """Return a Dataset with one row per slip, with units and titles."""
    import xarray as xr

    t = trace.t
    start = found.start
    end = found.end
    time, force, way, speed = (
        units_of(data.get(name))
        for name in ("time", "spring_force", "displacement", "velocity")
    )
    mu = "coefficient of friction"
    name = mu if force == "1" else "force"
    recurrence = np.append(math.nan, np.diff(t[start]))[: start.size]
    loading = np.full(start.size, math.nan)
    loading[1:] = found.loading_rates(t)
    # the first slip after a gap has no known slip before it
    beyond = 1 + np.flatnonzero(np.diff(np.searchsorted(trace.gaps, start)))
    recurrence[beyond] = loading[beyond] = math.nan
    before = trace.sign * found.before
    after = trace.sign * found.after
    rate = f"{force or 1}/{time}" if time else ""
    columns: list[tuple[str, Array, str, str]] = [
        ("start", t[start], time, "time at which the slip starts"),
        ("end", t[end], time, "time at which the slip ends"),
        ("force_before", before, force, f"{name} before the slip (peak)"),
        ("force_after", after, force, f"{name} after the slip (trough)"),
        ("drop", found.drops, force, f"drop of the {name} in the slip"),
        (
            "duration",
            t[end] - t[start],
            time,
            "duration of the slip",
        ),
        ("recurrence", recurrence, time, "time since the start of the slip before"),
        (
            "loading_rate",
            loading,
            rate,
            f"rise of the {name} per time since the slip before",
        ),
    ]
    if "mu" in data:  # with the load at that time
        per_force = (data["mu"] / data["spring_force"]).sel(time=t).values
        before = before * per_force[start]
        after = after * per_force[end]
        drop = trace.sign * (before - after)
        columns += [
            ("mu_before", before, "1", f"{mu} before the slip (static)"),
            ("mu_after", after, "1", f"{mu} after the slip"),
            ("mu_drop", drop, "1", f"drop of the {mu}"),
        ]
    if trace.X is not None:
        slip = trace.X[end] - trace.X[start]
        columns.append(("slip", slip, way, "distance slipped"))
    if trace.velocity is not None:
        title = "largest slider velocity in the slip"
        columns.append(("peak_velocity", found.fastest, speed, title))
    return xr.Dataset(
        {
            key: labelled(title, "event", values, unit)
            for key, values, unit, title in columns
        },
        attrs={
            "count": found.size,
            "minimum_drop": found.smallest,
            "noise": found.noise,
            "criterion": found.criterion,
            "cut": found.cut,
        },
    )


def counted(catalogue: xr.Dataset) -> str:
    """Return the number of slips, cycles or drops in a table of drops, in words."""
    dataset("catalogue", catalogue, "a table that drops() returns")
    name = str(catalogue.attrs.get("drops_are", "slips"))
    count = catalogue.sizes.get("event", 0)
    return f"{count} {name if count > 1 else name[:-1]}" if count else "no slips"


def statistics(catalogue: xr.Dataset) -> list[tuple[str, str]]:
    """Return the statistics of a table of drops as pairs of texts: the name of a
    column, and its mean and standard deviation.
    """
    dataset("catalogue", catalogue, "a table that drops() returns")
    lines = []
    for name, column in catalogue.data_vars.items():
        mean = column.attrs.get("mean", math.nan)
        std = column.attrs.get("std", math.nan)
        if not math.isfinite(mean):
            continue
        unit = printable(units_of(column))
        divisor, unit = prefixed(mean, "" if unit == "1" else unit)
        text = words.number(mean / divisor)
        if math.isfinite(std):
            std = 0.0 if std < _DUST * abs(mean) else std
            text += f" ± {words.number(std / divisor, 2)}"
        text = f"{text} {unit}".rstrip()
        if math.isfinite(std) and mean:
            text += f" (CV {std / abs(mean):.2f})"
        lines.append((str(name).replace("_", " "), text))
    return lines
