"""What happens along an elastic slider in time, in as few numbers as a screen shows."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr

from stickslip.elastic.precursors import distance_to_the_first_break
from stickslip.errors import InputError, shown
from stickslip.measure.arrays import Array, check_numbers
from stickslip.measure.arrays import in_words as in_unit
from stickslip.measure.fronts import events, fronts
from stickslip.model import Chain
from stickslip.simulation import rig_of

Field = Literal["velocity", "attached", "force", "displacement"]

FIELDS = {"velocity": "velocity", "attached": "attached", "force": "friction_force", "displacement": "displacement"}
"""What can be mapped, and the variable of a run that holds it."""
_TOLD = 5
"""Fronts that are told of."""
_FEWEST = 3
"""Blocks of the smallest event that is."""


class FrontMap(NamedTuple):
    """A quantity of all blocks in time, averaged over pixels; of the velocity, the largest size in each.

    `time` and `block` are the edges of the pixels; block ``j`` lies from ``j - 0.5`` to ``j + 0.5``.
    """

    values: Array  # of shape (times, places)
    time: Array
    block: Array
    variable: xr.DataArray


def front_map(
    run: xr.Dataset, what: Field = "velocity", *, most: tuple[int, int] = (300, 300), who: str = "front_map"
) -> FrontMap:
    """Reduce what a run of a chain, or one row of a sheet, holds of each block to at most so many times and places."""
    if what not in FIELDS:
        raise InputError(f"{who}: what = {shown(what)}: must be one of {', '.join(FIELDS)}")
    field = on_blocks(run, FIELDS[what], who)
    values = np.asarray(field.values, dtype=float)
    time, block = (np.asarray(field[name].values, dtype=float) for name in ("time", "block"))
    edges = [
        np.unique(np.linspace(0, size, min(pieces, size) + 1).astype(int))
        for size, pieces in zip(values.shape, most, strict=True)
    ]
    if what == "velocity":
        values = np.abs(values)
    for axis, starts in enumerate(edges):
        if what == "velocity":
            values = np.maximum.reduceat(values, starts[:-1], axis=axis)
        else:
            values = np.add.reduceat(values, starts[:-1], axis=axis) / np.expand_dims(np.diff(starts), 1 - axis)
    times, blocks = np.append(time, time[-1])[edges[0]], np.append(block, block[-1] + 1)[edges[1]]
    return FrontMap(values, times, blocks - 0.5, field)


def in_words(run: xr.Dataset) -> list[str]:
    """Say the fronts and events of an elastic slider in a line each; nothing of other data."""
    if "first_break" not in run:
        return []
    rig, unit, last, said = rig_of(run), str(run["time"].attrs.get("units", "")), run.sizes["block"] - 1, []
    body = rig.natural.slider
    for row in rows(fronts(run), "front", most=_TOLD) if isinstance(body, Chain) else []:
        natural = row["front_speed"] / rig.unit("1/time")
        if np.isfinite(natural):
            stop = "arrested there" if 0 < row["last_block"] < last else "the end"
            speed = f"{row['front_speed']:.3g} blocks/{unit or 'time'}"
            if body.spacing is not None:
                speed = f"{rig.in_units(natural * body.spacing, 'velocity', 3)} ({speed})"
            said.append(
                f"front from t = {in_unit(row['start'], unit)}: blocks {row['first_block']} to {row['last_block']}, "
                f"{stop}; {speed}, {natural / body.sound_speed:.3g} of the speed of sound"
            )
    large = [row for row in rows(events(run), "event", most=run.sizes["time"]) if row["blocks"] >= _FEWEST]
    text = f"{len(large)} event{'s' * (len(large) != 1)} of at least {_FEWEST} blocks"
    if large:
        longest = max(large, key=lambda row: float(row["blocks"]))
        text += (
            f"; the longest of {longest['blocks']} of {last + 1} blocks at t = {in_unit(longest['start'], unit)}, "
            f"force drop {in_unit(longest['drop'], run['spring_force'].attrs.get('units', ''), 3)}"
        )
    elif (distance := distance_to_the_first_break(rig)) is not None:
        text += f"; the first block breaks loose when the drive has gone about {rig.in_units(distance, 'length', 3)}"
    return [*said, text]


def rows(table: xr.Dataset, along: str, *, most: int) -> list[dict[str, Any]]:
    """One dict for each row of a table, at most so many; the longest ones if there are more."""
    frame = table[[name for name, column in table.data_vars.items() if column.dims == (along,)]].to_dataframe()
    chosen: list[dict[str, Any]] = frame.nlargest(most, "blocks").sort_index().to_dict("records")
    return chosen


def is_of_a_chain(run: xr.Dataset) -> bool:
    """Whether a Dataset is a run of a chain, or of one row of a sheet."""
    across = run.coords.get("across")
    return (
        {"broken", "velocity"} <= set(run) and "block" in run.dims and (across is None or across.max() == across.min())
    )


def on_blocks(run: xr.Dataset, name: str, who: str) -> xr.DataArray:
    """Take a variable of each block along time, or complain; the message begins with `who`."""
    if name not in run or set(run[name].dims) != {"time", "block"}:
        raise InputError(f"{who}: this Dataset has no {name} of each block; give a run of a Chain")
    if run.sizes["time"] < 2:
        raise InputError(f"{who}: the run holds fewer than two samples; select a longer time")
    across = run.coords.get("across")
    if across is not None and np.unique(across).size > 1:
        raise InputError(f"{who}: a Sheet has many rows; select one: run.isel(block=run.across == 0)")
    check_numbers(who, run[name])
    return run[name].transpose("time", "block")
