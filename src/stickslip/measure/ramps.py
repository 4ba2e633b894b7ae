"""Velocities at which stick-slip starts and ends while the velocity of the drive
changes.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import median_filter

from stickslip.arrays import labelled, units_of
from stickslip.errors import InputError, UndecidedError, number
from stickslip.io.headings import unit_named
from stickslip.measure.regimes import regime
from stickslip.measure.slips import turning_points
from stickslip.measure.trace import CONSTANT_DRIVE, Array, Trace
from stickslip.model import Slider
from stickslip.words import engineering, listed

if TYPE_CHECKING:
    import xarray as xr

_PARTS = 16  # the window moves in steps of a sixteenth of its length
_LONGEST_TRANSIENT = 25  # windows of two cycles: 50 cycles
_WAYS = (
    ("up", "speeding up", "v1", "v2"),
    ("down", "slowing down", "v2_down", "v1_down"),
)
"""For each direction of the ramp: the names of the velocities at which stick-slip sets
in and at which it ends.
"""
_LEVEL = 0.4  # default level of stick-slip, in f_s
_WINDOW = 4.0  # length of a window in x_s, where the cycle is not known
_MOST_STROKES = 8  # strokes that are listed
_OF = {
    "peak_to_peak": "spring_force",
    "drive_velocity": "velocity",
    "travel": "displacement",
}
"""Variables of the run that have the units of these columns; the other columns are
times.
"""


def transitions(run: xr.Dataset, *, level: float | None = None) -> xr.Dataset:
    """Return the velocities at which stick-slip starts and ends while the drive speeds
    up and slows down.

    Stick-slip is defined by a spring force that oscillates by more than `level` (in its
    unit, by default .4 ``f_s``), peak to peak, over a window of two cycles; it starts
    at the end of the first such window and ends at the start of the last one. A state
    shorter than half a window is ignored. An oscillation that is present from the start
    may be a transient: it counts if it has grown by `level`, or has lasted for 25
    windows. A cycle is the time in which the drive loads spring and contacts by the
    largest change of the force in the run, plus one free oscillation of the slider; for
    an elastic or unknown rig, a window is 4 ``x_s`` of travel.

    A ramp passes the boundary before the oscillation has grown (delayed bifurcation)
    and noise may start it early, so the results depend on the rate of the ramp; they
    are not the velocities of linear stability.

    The drive speeds up, or slows down, or first speeds up and then slows down; it may
    keep its velocity for a while. Raises `InputError` if it turns back or is not known,
    or the run is in SI units and does not hold its rig; `UndecidedError` if the drive
    does not change, speeds up and slows down more than once, or travels less than two
    windows, or there are too few samples in a window.

    Returns
    -------
    Dataset
        `v1`, `v2`: on the way up, the first velocity at which stick-slip sets in, and
        the last at which it ends after that; `v2_down`, `v1_down` (the paper's ``v2'``,
        ``v1'``): the same on the way down. Each is NaN where it was not seen; the
        attribute ``notes`` explains why. Along ``travel`` of the drive, at the middle
        of each window: `peak_to_peak`, `drive_velocity`, and its times `begin`,
        `middle` and `end`. Along ``velocity``, where the drive speeds up and then slows
        down: `up` and `down`, the peak to peak in either direction. Attributes:
        ``level``, ``window``.
    """
    trace = Trace.of(run)
    if trace.drive is None or np.any(trace.drive < 0):
        raise InputError(
            "transitions: needs a run with a drive_velocity, in which the drive never "
            "turns back"
        )
    if trace.rig is None and unit_named(trace.force_unit):
        raise InputError(
            f"transitions: spring_force is in {trace.force_unit}, and f_s is not "
            "known: the run does not hold its rig"
        )
    usual = _LEVEL * (trace.rig.unit("f_s") if trace.rig else 1.0)
    level = (
        usual
        if level is None
        else number("level", level, above=0, hint="in the unit of spring_force")
    )
    top = _turning_time(trace.t, trace.drive)
    seen = _oscillation(run, trace, level)
    height, begin, middle, end = (
        seen[name].values for name in ("peak_to_peak", "begin", "middle", "end")
    )
    # the median removes states that are shorter than half a window
    on = median_filter(
        (height > level).astype(np.int8), _PARTS + 1, mode="nearest"
    ).astype(bool)
    # A transient of the start only decays, within some tens of windows.
    grown = np.flatnonzero(height > np.minimum.accumulate(height) + level)
    notes = ["the force oscillates above the level from the start"] if on[0] else []
    if (ends := int(np.argmin(on))) <= min([*grown[:1], _LONGEST_TRANSIENT * _PARTS]):
        on[:ends] = False
    change = np.flatnonzero(on[1:] != on[:-1]) + 1
    starts = end[change[on[change]]]
    stops = begin[change[~on[change]] - 1]
    for (way, _, onset, ending), first, last in zip(
        _WAYS, (-np.inf, top), (top, np.inf), strict=True
    ):
        here, there = (
            times[(times > first) & (times <= last)] for times in (starts, stops)
        )
        unseen = []
        for name, what, at in (
            (onset, "sets in", here[:1]),
            (ending, "ends", there[-1:]),
        ):
            velocity = np.nan
            if at.size:
                velocity = trace.sign * np.interp(at[0], trace.t, trace.drive)
            else:
                unseen.append(name.replace("_down", "'"))
            title = f"stick-slip {what} on the way {way}"
            unit = units_of(seen["drive_velocity"])
            seen[name] = labelled(title, (), velocity, unit)
        if unseen:
            inside = on[(middle > first) & (middle <= last)]
            count = f"{np.count_nonzero(inside)} of {inside.size} windows"
            notes.append(
                f"{' and '.join(unseen)} not seen: stick-slip in {count} on the way "
                f"{way}"
            )
        if here.size > 1:
            notes.append(
                f"stick-slip sets in {here.size} times on the way {way}: first onset "
                "and last end are given"
            )
    return seen.assign(_both_ways(seen, top)).assign_attrs(
        level=level, notes="; ".join(notes)
    )


def _oscillation(run: xr.Dataset, trace: Trace, level: float) -> xr.Dataset:
    """Return the peak to peak of the spring force over a moving window of two cycles,
    or of 4 x_s of travel where the cycle is not known.
    """
    import xarray as xr

    assert trace.drive is not None
    rig = trace.rig
    travel = cumulative_trapezoid(trace.drive, trace.t, initial=0)
    width = _WINDOW * (rig.unit("x_s") if rig else 1.0) * np.ones_like(travel)
    if rig and isinstance(rig.slider, Slider):
        swing = max(np.ptp(trace.force), level) / rig.unit("f_s")
        loading = swing * (1.0 + 1.0 / rig.slider.stiffness) * rig.unit("x_s")
        period = (
            2
            * np.pi
            * np.sqrt(rig.slider.mass / rig.slider.stiffness)
            * rig.unit("time")
        )
        width = 2.0 * (loading + trace.drive * period)
    gone = cumulative_trapezoid(trace.drive / width, trace.t, initial=0)
    unit = units_of(run.get("displacement"))
    windows = f"windows of drive travel {engineering(width.max(), unit)}"
    if gone[-1] < 2:
        raise UndecidedError(
            f"transitions: the drive travels {engineering(travel[-1], unit)}, less "
            f"than 2 {windows}: run it longer"
        )
    begin = np.arange(min(int(gone[-1] * _PARTS), trace.t.size)) / _PARTS
    begins = np.searchsorted(gone, begin)
    if begin.size == trace.t.size or np.any(np.diff(begins) < 1):
        raise UndecidedError(
            f"transitions: fewer than {_PARTS} samples in some {windows}: record more "
            "often"
        )
    highest = np.maximum.reduceat(trace.force, begins)
    lowest = np.minimum.reduceat(trace.force, begins)
    high = sliding_window_view(highest, _PARTS).max(axis=1)
    low = sliding_window_view(lowest, _PARTS).min(axis=1)
    begin = begin[: high.size]
    place, times = (
        [np.interp(begin + part, gone, of) for part in (0.0, 0.5, 1.0)]
        for of in (travel, trace.t)
    )
    drive = trace.sign * np.interp(times[1], trace.t, trace.drive)
    columns = {
        "peak_to_peak": ("peak to peak of the spring force", high - low),
        "drive_velocity": ("velocity of the drive", drive),
        "begin": ("start of the window", times[0]),
        "middle": ("middle of the window", times[1]),
        "end": ("end of the window", times[2]),
        "travel": ("travel of the drive", place[1]),
    }
    found = {
        name: labelled(text, "travel", values, units_of(run.get(_OF.get(name, "time"))))
        for name, (text, values) in columns.items()
    }
    return xr.Dataset(found, attrs={"window": float(np.max(place[2] - place[0]))})


def _turning_time(t: Array, drive: Array) -> float:
    """Return the time at which the drive is fastest: the start if it only slows down,
    the end if it only speeds up.
    """
    top = drive.max()
    loops = len(turning_points(np.pad(drive, 1), 1e-3 * top)[0])
    if loops > 1 or np.ptp(drive) <= CONSTANT_DRIVE * top:
        seen = (
            f"speeds up and slows down {loops} times"
            if loops > 1
            else "keeps its velocity"
        )
        raise UndecidedError(
            f"transitions: the drive {seen}; ramp it, or select one loop: "
            "run.sel(time=slice(a, b))"
        )
    fastest = t[drive >= (1.0 - 1e-3) * top]
    return float(fastest[0] if fastest[0] == t[0] else fastest[-1])


def _both_ways(seen: xr.Dataset, top: float) -> xr.Dataset:
    """Return the peak to peak of the force against the velocity, on the way up and on
    the way down; empty if the drive only speeds up or only slows down.
    """
    import pandas as pd
    import xarray as xr

    speed = np.abs(seen["drive_velocity"].values)
    force = seen["peak_to_peak"]
    up = seen["middle"].values <= top
    curves = [
        pd.Series(force.values[way], speed[way]).sort_index(kind="stable")
        for way in (up, ~up)
    ]
    low = np.max([each.index.min() for each in curves])
    high = np.min([each.index.max() for each in curves])
    if not low < high:
        return xr.Dataset()
    grid = np.linspace(low, high, 201)
    found = {
        name: labelled(
            f"peak to peak of the force, drive {how}",
            "velocity",
            np.interp(grid, each.index, each),
            units_of(force),
        )
        for (name, how, *_), each in zip(_WAYS, curves, strict=True)
    }
    return xr.Dataset(
        found,
        {"velocity": ("velocity", grid, dict(seen["drive_velocity"].attrs))},
    )


def in_words(run: xr.Dataset) -> str:
    """Return in words between which velocities a run on a ramp stick-slips, and the
    motion in each stroke of a drive that turns back; empty for another run.
    """
    drive = np.atleast_1d(np.asarray(run.get("drive_velocity", 0.0), dtype=float))
    moving = np.flatnonzero(drive)
    turns = moving[1:][np.diff(np.sign(drive[moving])) != 0]
    if not turns.size:
        words = _of_one_way(run) if _changes(drive) else ""
        return words and f"the velocity of the drive changes; {words}"
    strokes = [*pairwise([0, *turns.tolist(), drive.size])]
    lines = [f"the drive turns back: {len(strokes)} strokes, each by itself"]
    for begin, end in strokes[:_MOST_STROKES]:
        stroke = run.isel(time=slice(begin, end))
        times = stroke["time"]
        first, last = (engineering(float(times[i]), units_of(times)) for i in (0, -1))
        lines.append(f"{first} to {last}: {_of_one_way(stroke)}")
    if len(strokes) > _MOST_STROKES:
        lines.append(f"and {len(strokes) - _MOST_STROKES} more")
    return "\n".join(lines)


def _changes(drive: Array) -> bool:
    """Return whether the velocity of a drive changes."""
    speed = np.abs(drive)
    return bool(np.ptp(speed) > 2.0 * CONSTANT_DRIVE * speed.max())


def _of_one_way(run: xr.Dataset) -> str:
    """Return in words the motion in a run whose drive does not turn back."""
    try:
        if not _changes(run["drive_velocity"].values):
            return str(regime(run)).partition("\n")[0]
        found = transitions(run)
    except (InputError, UndecidedError) as error:
        return str(error).removeprefix("transitions: ")
    directions = []
    for way, how, *names in _WAYS:
        at = {
            what: found[name]
            for what, name in zip(("sets in", "ends"), names, strict=True)
            if found[name].notnull()
        }
        # as they come in time
        turns = sorted(at, key=lambda what: abs(float(at[what])), reverse=way == "down")
        events = [
            f"{what} at {engineering(float(at[what]), units_of(at[what]), 3)}"
            for what in turns
        ]
        events = ["is there from the start"] * (turns[:1] == ["ends"]) + events
        events += ["persists to the end"] * (turns[-1:] == ["sets in"])
        if events:
            directions.append(f"{how}, it {listed(events)}")
    if not directions:
        return str(found.attrs["notes"])
    return f"stick-slip: {'; '.join(directions)}"
