"""Fronts and events of an elastic slider: where contacts broke, in which order, and how
fast the front ran.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import ndimage

from stickslip.arrays import labelled, units_of
from stickslip.errors import InputError, dataset
from stickslip.measure.trace import Array, check_numbers, slope
from stickslip.model import Chain, Rig
from stickslip.words import engineering

if TYPE_CHECKING:
    import xarray as xr

# A front has stopped where the next wait is longer than this many times the median of
# this number of waits before it.
_WAIT = 10.0
_BEFORE = 20
_WINDOW = 2  # blocks on either side of a block that give the front speed there
_FEWEST = 5  # fewest blocks that give a front speed
_FAST = 10.0  # blocks in an event are this many times faster than the drive ...
# ... or, if the drive stands still, faster than this fraction of the fastest block
_SLOWEST = 0.01
# An attached block takes part in an event if it breaks more than this fraction of its
# contacts while it is fast.
_BREAKING = 0.01
_LISTED = 5  # most fronts that are listed
_LARGE = 3  # blocks of the smallest event that is reported
# connects neighbours in time, in an array of samples and blocks
_IN_TIME = np.array([[0, 1, 0]] * 3)
_COLUMNS = {
    "first_block": ("1", "block that breaks, or slips, first"),
    "last_block": ("1", "last block that it reaches"),
    "start": ("{time}", "time at which it starts"),
    "end": ("{time}", "time at which it ends"),
    "blocks": ("1", "blocks that it passes"),
    "moment": ("{displacement}", "slip, summed over blocks"),
    "drop": ("{spring_force}", "drop of the spring force"),
    "peak_velocity": ("{velocity}", "largest velocity of a block"),
    "front_speed": ("1/{time}", "speed of the front, in blocks"),
}
"""Columns of fronts and events: unit, in terms of those of the run, and title."""

Row = tuple[float, ...]


def fronts(run: xr.Dataset) -> xr.Dataset:
    """Return where and how fast contacts first broke along an elastic slider.

    A front runs from the block that breaks first to either side. It stops where the
    next block breaks only after ten times the median wait of the twenty before; the
    blocks that break beyond are a new front. The `run` is one of a `Chain`, or one row
    of that of a `Sheet`; else `InputError`.

    Returns
    -------
    Dataset
        Along ``block``: `first_break` and `half_detached` (times), and `speed`, in
        blocks per time, from the first breaks of the block and two on either side.
        Along ``front``, in order of time: `first_block`, `last_block` (where it
        stopped, or the end), `blocks`, `start`, `end`, and its mean `front_speed` (NaN
        below five blocks).

    Examples
    --------
    >>> stiff = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.0), delay=ss.Delay(float("inf"))
    ... )
    >>> bar = ss.Chain(blocks=100, coupling=1.0, mass=1.0, damping=0.0)
    >>> rig = ss.Rig(
    ...     stiff,
    ...     bar,
    ...     ss.constant(0.0, duration=100),
    ...     method=ss.Contacts(10),
    ...     start=ss.Prestressed(stretching=0.7, push=3.0, pushed_blocks=3),
    ... )
    >>> found = ss.measure.fronts(ss.simulate(rig))
    >>> int(found.blocks[0])
    100
    """
    units = _checked(run, "fronts", "first_break")
    time = np.asarray(run["first_break"].values, dtype=float)
    speed = np.full(time.size, np.nan)
    rows = list[Row]()
    for block in range(_WINDOW, time.size - _WINDOW):
        speed[block] = _speed(time[block - _WINDOW : block + _WINDOW + 1])
    if np.isfinite(time).any():
        origin = int(np.nanargmin(time))
        rows = [*_pieces(time, origin, 1), *_pieces(time, origin, -1)]
    found = _table(
        "front", "first_block last_block blocks start end front_speed", rows, units
    )
    along = labelled(
        "speed of the front, in blocks", "block", speed, f"1/{units['time']}"
    )
    kept = (
        run[["first_break", "half_detached"]]
        .reset_coords(drop=True)
        .drop_attrs(deep=False)
    )
    return kept.assign(found | {"speed": along})


def _speed(times: Array) -> float:
    """Return the speed, in blocks per time, of a front that reaches successive blocks
    at these times.
    """
    each = abs(slope(times, np.arange(float(times.size))))
    return 1.0 / each if each != 0.0 else float("inf")


def _pieces(time: Array, origin: int, way: int) -> list[Row]:
    """Return the fronts that run from a block in one direction, 1 or -1."""
    line = time[origin::way]
    line = line[: int(np.append(np.isnan(line), True).argmax())]
    waits = np.diff(line)
    starts = [0]
    rows = list[Row]()
    for i in range(1, waits.size):
        before = np.abs(waits[max(starts[-1], i - _BEFORE) : i])
        if before.size >= _FEWEST and waits[i] > _WAIT * np.median(before):
            starts.append(i + 1)
    for start, beyond in itertools.pairwise([*starts, line.size]):
        end = beyond - 1
        count = beyond - start
        # a front of the origin alone belongs to the other direction
        if way > 0 or end > 0:
            # leave out the first fifth, in which the front accelerates
            under_way = line[start + (count - 1) // 5 : beyond]
            speed = _speed(under_way) if count >= _FEWEST else np.nan
            first = origin + way * start
            last = origin + way * end
            rows.append((first, last, count, line[start], line[end], speed))
    return rows


def events(run: xr.Dataset) -> xr.Dataset:
    """Return one row per event of an elastic slider: a slip of neighbouring blocks,
    together or one after the other.

    A block slips while it moves faster than ten times the largest drive velocity (or,
    if the drive stands still, than a hundredth of the fastest block), and its contacts
    break, or most of them are detached. It takes part in an event if it breaks at least
    half of its contacts in it, or was detached before; an event has at least one block
    that breaks. Times are those of samples: record the run often enough. It must be one
    of a `Chain` or a `Sheet`; else `InputError`.

    Returns
    -------
    Dataset
        Along ``event``, in order of time: `start`, `end`, `first_block`, `blocks`,
        `moment` (slip summed over blocks), `drop` of the spring force, `peak_velocity`
        of a block, and `front_speed`, blocks per time (NaN below five blocks; from a
        chain only).

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.05),
    ...     delay=ss.Delay(100.0),
    ...     sliding_force=0.425,
    ... )
    >>> bar = ss.Chain(blocks=40, coupling=4.0, mass=1.0, damping=0.1, side=4.0)
    >>> rig = ss.Rig(
    ...     interface,
    ...     bar,
    ...     ss.constant(2e-3, duration=2e4),
    ...     method=ss.QuasiStatic(50, seed=1),
    ... )
    >>> ss.measure.events(ss.simulate(rig)).sizes["event"] > 3
    True
    """
    import xarray as xr

    units = _checked(run, "events", "broken")
    time = np.asarray(run["time"].values, dtype=float)
    if time.size < 3:
        raise InputError(
            "events: needs a run of at least three samples; record it more often"
        )
    broken, X, V, force, attached = (
        np.asarray(run[name].values, dtype=float)
        for name in ("broken", "displacement", "velocity", "spring_force", "attached")
    )
    speed = np.abs(np.diff(X, axis=0)) / np.diff(time)[:, None]
    drive = float(np.abs(run["drive_velocity"].values).max())
    velocity = _FAST * drive if drive > 0 else _SLOWEST * float(speed.max(initial=0.0))
    # Whether a block takes part depends on the whole time in which it is fast, so that
    # the sampling does not matter.
    spells, many = ndimage.label(speed > velocity, _IN_TIME)
    breaks = np.bincount(spells.ravel(), np.diff(broken, axis=0).ravel()) > _BREAKING
    hangs = (
        np.bincount(
            spells[np.minimum(attached[1:], attached[:-1]) < 0.5], minlength=many + 1
        )
        > 0
    )
    active = (breaks | hangs)[spells] & (spells > 0)
    # Slips within one sample and one block of each other, in the same or the next row
    # of a sheet, belong to one event.
    along = int(run["along"].max()) + 1 if "along" in run.coords else run.sizes["block"]
    grid = active.reshape(time.size - 1, -1, along)
    about = np.ones((3, 3, 3), np.int64)
    labels, count = ndimage.label(ndimage.binary_dilation(grid, about), about)
    labels = np.where(active, np.asarray(labels).reshape(active.shape), 0)
    rows = list[Row]()
    for label, where in enumerate(ndimage.find_objects(labels, count), start=1):
        first = where[0].start
        last = where[0].stop
        during = slice(first, last + 1)
        mine = labels[first:last] == label
        gone = (np.diff(broken[during], axis=0) * mine).sum(axis=0) >= 0.5
        if not gone.any():
            continue
        part = np.flatnonzero(mine.any(axis=0) & (gone | (attached[first] < 0.5)))
        x = X[during, part]
        arrival = np.array([_half_time(time[during], each) for each in x.T])
        origin = int(np.argmin(arrival))
        # the side of the origin with more blocks
        side = max((arrival[origin:], arrival[origin::-1]), key=len)
        runs = grid.shape[1] == 1 and side.size >= _FEWEST and side[-1] > side[0]
        rows.append(
            (
                time[first],
                time[last],
                part[origin],
                part.size,
                (x[-1] - x[0]).sum(),
                force[first] - force[last],
                np.abs(V[during, part]).max(),
                _speed(side) if runs else np.nan,
            )
        )
    names = "start end first_block blocks moment drop peak_velocity front_speed"
    return xr.Dataset(
        _table("event", names, rows, units),
        {"event": np.arange(len(rows))},
        {"count": len(rows), "velocity": velocity},
    )


def _table(
    along: str, names: str, rows: Sequence[Row], units: Mapping[str, str]
) -> dict[str, Any]:
    """Return the labelled columns of a table, sorted by `start`; columns of blocks are
    integers.
    """
    import pandas as pd

    frame = pd.DataFrame(rows, columns=names.split()).sort_values("start")
    found = {}
    for name in frame:
        unit, title = _COLUMNS[name]
        values = frame[name].to_numpy(dtype=int if "block" in name else float)
        found[name] = labelled(title, along, values, unit.format_map(units))
    return found


def _checked(run: xr.Dataset, who: str, needed: str) -> dict[str, str]:
    """Return the units of the variables of a run; `InputError` unless it is one of an
    elastic slider.
    """
    dataset(f"{who}: run", run, "a Dataset, as simulate() returns it")
    if needed not in run or "block" not in run[needed].dims:
        raise InputError(f"{who}: needs a run of an elastic slider, a Chain or a Sheet")
    return {str(name): units_of(each) for name, each in run.variables.items()}


def _half_time(time: Array, X: Array) -> float:
    """Return the time at which a block has moved half of its distance."""
    way = X - 0.5 * (X[0] + X[-1])
    way *= np.sign(X[-1] - X[0])
    after = max(int(np.argmax(way >= 0)), 1)
    last = slice(after - 1, after + 1)
    # for a block that did not move, this is the later of the two times
    return float(np.interp(0.0, way[last], time[last]))


def pixels(field: xr.DataArray, most: tuple[int, int]) -> tuple[Array, Array, Array]:
    """Return a field of time and block on a grid of at most this many cells, and the
    edges of the cells in time and in blocks.

    A cell holds the mean of the field, or the largest speed if it is a velocity.
    """
    values = np.asarray(field.values, dtype=float)
    edges = [
        np.unique(np.linspace(0, size, count + 1).astype(int))
        for size, count in zip(values.shape, most, strict=True)
    ]
    is_velocity = field.name == "velocity"
    values = np.abs(values) if is_velocity else values
    for axis, edge in enumerate(edges):
        gather = np.maximum if is_velocity else np.add
        values = gather.reduceat(values, edge[:-1], axis=axis)
    if not is_velocity:
        values = values / np.outer(*map(np.diff, edges))
    time, block = (
        np.asarray(field[name].values, dtype=float) for name in ("time", "block")
    )
    return (
        values,
        np.append(time, time[-1])[edges[0]],
        np.append(block, block[-1] + 1)[edges[1]] - 0.5,
    )


def in_words(run: xr.Dataset) -> list[str]:
    """Return lines of text about the fronts and events of an elastic slider; none for
    other data.
    """
    if "first_break" not in run:
        return []
    from stickslip.simulation import rig_of  # imports all engines

    rig = rig_of(run)
    large = large_events(run)
    return [
        *_fronts_in_words(run, rig, large),
        _events_in_words(run, rig, large),
    ]


def _fronts_in_words(run: xr.Dataset, rig: Rig, large: xr.Dataset) -> Iterator[str]:
    """Yield a line for each front of a chain.

    Blocks that first broke in several large events are not one front: they are left
    out.
    """
    body = rig.natural.slider
    if not isinstance(body, Chain):
        return
    unit = units_of(run["time"])
    last = run.sizes["block"] - 1
    for row in rows(fronts(run), "front", most=_LISTED):
        natural = row["front_speed"] / rig.unit("1/time")
        during = (large["start"] >= row["start"]) & (large["start"] <= row["end"])
        if not np.isfinite(natural) or during.sum() > 1:
            continue
        stop = "arrested there" if 0 < row["last_block"] < last else "the end"
        speed = f"{row['front_speed']:.3g} blocks/{unit or 'time'}"
        if body.spacing is not None:
            speed = f"{rig.in_units(natural * body.spacing, 'velocity', 3)} ({speed})"
        yield (
            f"front from t = {engineering(row['start'], unit)}: blocks "
            f"{row['first_block']} to {row['last_block']}"
            f", {stop}; {speed}, {natural / body.sound_speed:.3g} of the speed of "
            "sound"
        )


def _events_in_words(run: xr.Dataset, rig: Rig, large: xr.Dataset) -> str:
    """Return the number of large events, and the first of those over some blocks and of
    those over all, in words.
    """
    from stickslip.elastic.precursors import distance_to_the_first_break

    count = large.sizes["event"]
    text = f"{count} event{'s' * (count != 1)} of at least {_LARGE} blocks"
    if count == 0:
        if (distance := distance_to_the_first_break(rig)) is not None:
            text += (
                "; the first block breaks loose when the drive has gone about "
                f"{rig.in_units(distance, 'length', 3)}"
            )
        return text
    size = run.sizes["block"]
    time = units_of(run["time"])
    force = units_of(run["spring_force"])
    is_whole = large["blocks"].values >= size
    if (some := large.isel(event=~is_whole)).sizes["event"]:
        start = engineering(float(some["start"][0]), time)
        reach = blocks_in_words(rig, int(some["reach"][0]))
        text += f"; the first partial one, at t = {start}, over {reach}"
    if (whole := large.isel(event=is_whole)).sizes["event"]:
        start = engineering(float(whole["start"][0]), time)
        drop = engineering(float(whole["drop"].max()), force, 3)
        text += f"; {whole.sizes['event']} of all {size}, the first at t = {start}"
        text += f", largest force drop {drop}"
    return text


def blocks_in_words(rig: Rig, count: int) -> str:
    """Return a number of blocks of an elastic slider in words, with their length where
    it is known.
    """
    body = rig.natural.slider
    words = f"{count} of {body.size} blocks"
    if body.spacing is None:
        return words
    return f"{words} ({rig.in_units(count * body.spacing, 'length', 3)})"


def large_events(run: xr.Dataset) -> xr.Dataset:
    """Return the events of three blocks or more, with two more columns: `reach`, the
    last block of a bar, from 1, whose contacts broke, and `force_before` the event.
    """
    found = events(run)
    found = found.isel(event=np.flatnonzero(found["blocks"].values >= _LARGE))
    before = np.interp(found["start"], run["time"], run["spring_force"])
    reach = found["blocks"]
    if is_of_a_chain(run, "broken"):
        broke = gone(on_blocks(run, "broken", "events"), found) >= 0.5
        reach = (broke * (np.arange(run.sizes["block"]) + 1)).max("block")
    return found.assign(reach=reach, force_before=("event", before))


def gone(values: xr.DataArray, events: xr.Dataset) -> xr.DataArray:
    """Return the change of the values of each block over each event."""
    return values.sel(time=events["end"], method="nearest") - values.sel(
        time=events["start"], method="nearest"
    )


def rows(table: xr.Dataset, along: str, *, most: int) -> list[dict[str, Any]]:
    """Return a dict for each row of a table; if there are more than `most`, of those
    with the most blocks.
    """
    frame = table[
        [name for name, column in table.data_vars.items() if column.dims == (along,)]
    ].to_dataframe()
    chosen: list[dict[str, Any]] = (
        frame.nlargest(most, "blocks").sort_index().to_dict("records")
    )
    return chosen


def is_of_a_chain(run: xr.Dataset, name: str = "velocity") -> bool:
    """Whether a Dataset holds this variable for the blocks of a chain, or of one row of
    a sheet, at two times or more.
    """
    across = run.coords.get("across", np.zeros(1))
    along = name in run and set(run[name].dims) == {"time", "block"}
    return along and run.sizes["time"] > 1 and bool(across.min() == across.max())


def on_blocks(run: xr.Dataset, name: str, who: str) -> xr.DataArray:
    """Return a variable along time and block; `InputError`, which begins with `who`, if
    the run does not hold it.
    """
    dataset(who, run, "a run of simulate()")
    if not is_of_a_chain(run, name):
        remedy = (
            "give a run of a Chain, or one row of that of a Sheet: "
            "run.isel(block=run.across == 0)"
        )
        raise InputError(
            f"{who}: this Dataset has no {name} of each block at two times or more; "
            f"{remedy}"
        )
    check_numbers(who, run[name])
    return run[name].transpose("time", "block")
