"""Where stick-slip starts and ends while the velocity of the drive changes."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.measure.arrays import CONSTANT_DRIVE, Array, Trace
from stickslip.measure.headings import unit_named
from stickslip.measure.slips import turning_points
from stickslip.model import Slider
from stickslip.simulation import labelled, rig_of
from stickslip.words import engineering

if TYPE_CHECKING:
    import xarray as xr

    from stickslip.model.rig import Rig

_PARTS = 16  # the window moves in steps of a sixteenth of it
_LONGEST_TRANSIENT = 25  # windows: 50 cycles
_WAYS = (("up", "v1", "v2"), ("down", "v2_down", "v1_down"))  # where stick-slip sets in, and where it ends


def transitions(run: xr.Dataset, *, level: float | None = None, window: float | None = None) -> xr.Dataset:
    """Return the velocities at which stick-slip starts and ends while the drive speeds up and slows down.

    Stick-slip is where the spring force oscillates by more than `level`, peak to peak, over a window of two
    cycles; it starts at the end of the first such window and ends at the start of the last one. A state
    shorter than half a window is passed over. An oscillation that is there from the very start may be the
    transient from the state the run was started in: its end counts if it has grown by `level`, or has lasted for
    25 windows.

    A ramp passes the boundary before the oscillation has grown (delayed bifurcation) and noise may set it off
    early, so the answers depend on the rate of the ramp; they are not the velocities of linear stability.

    Parameters
    ----------
    run : Dataset
        A run in which the drive speeds up, or slows down, or first speeds up and then slows down; it may also
        keep its velocity for a while.
    level : float, optional
        In the unit of `spring_force`; by default .4 ``f_s``.
    window : float, optional
        Travel of the drive, in the unit of `displacement`, that holds two cycles or more at every velocity. By
        default a window holds two cycles: each the time in which the drive loads spring and contacts by the largest
        change of the force in the run, and one free oscillation of the slider. Where the run does not say what rig
        it was made of, or the slider is elastic, the default is 4 ``x_s``. Both must be given for a run in SI units
        that does not say what rig it was made of.

    Returns
    -------
    Dataset
        `v1`, `v2`: on the way up, the first velocity at which stick-slip sets in, and the last at which it ends
        after that; `v2_down`, `v1_down` (the paper's ``v2'``, ``v1'``): on the way down, the first at which it
        sets in again, and the last at which it ends. Each is NaN where it was not seen; the attribute ``notes``
        says why. Along ``travel`` (of the drive, at the middle of the window): `peak_to_peak`, `drive_velocity`
        there, and the times `begin`, `middle` and `end` of the window. Along ``velocity``, where the drive
        goes up and then down: `up` and `down`, the peak to peak on either way, and `difference`, down less up.
        Attributes ``level``, ``window`` (travel of the drive over the longest one), ``notes``.

    Raises
    ------
    InputError
        If the run has no drive velocity, or the drive turns back, or the run is in SI units and `level` or
        `window` is not given.
    UndecidedError
        If the drive does not change, goes up and down more than once, or travels less than two windows, or
        there are too few samples in a window.
    """
    import xarray as xr

    instance("transitions: run", run, xr.Dataset, "a run of simulate()")
    trace = Trace.of(run)
    if trace.drive is None:
        raise InputError("transitions: need a run with the variable drive_velocity; a trace of the force has none")
    if np.any(trace.drive < 0):
        raise InputError(f"transitions: drive_velocity = {trace.sign * trace.drive.min():g}: the drive turns back")
    rig = _rig_of(run)
    level = number(
        "level", _usual(run, rig, "level") if level is None else level, above=0, hint="in the unit of spring_force"
    )
    oscillation = _oscillation(run, trace, rig, level, window)
    t, drive = trace.t, trace.drive
    top = _turning_time(t, drive)
    height, begin, middle, end = (np.asarray(oscillation[name]) for name in ("peak_to_peak", "begin", "middle", "end"))
    on = _settled(height > level, _PARTS // 2)
    change = np.flatnonzero(on[1:] != on[:-1]) + 1
    starts, stops = end[change[on[change]]], begin[change[~on[change]] - 1]
    notes: list[str] = []
    # What the start leaves behind only decays, and within some tens of windows.
    grown = np.flatnonzero(height > np.minimum.accumulate(height) + level)
    transient = float(middle[min(_LONGEST_TRANSIENT * _PARTS, middle.size - 1, *grown[:1].tolist())])
    transient = min(transient, *starts[:1].tolist(), np.inf)
    if on[0]:
        state = f"until v = {np.interp(stops[0], t, trace.sign * drive):.3g}" if stops.size else "all along"
        whose = "" if stops.size and stops[0] > transient else ": the state the run was started in"
        notes.append(f"the force oscillates above the level from the start {state}{whose}")
    found: dict[str, float] = {}
    for (way, onset, ending), first, last in zip(_WAYS, (-np.inf, top), (top, np.inf), strict=True):
        here = starts[(starts > first) & (starts <= last)]
        there = stops[(stops > first) & (stops <= last) & ((stops > transient) | (t[0] >= top))]
        seen = {onset: here[:1], ending: there[-1:]}
        found |= {
            name: trace.sign * float(np.interp(at[0], t, drive)) if at.size else np.nan for name, at in seen.items()
        }
        missing = [name for name, at in seen.items() if not at.size]
        if missing:
            inside = on[(middle > first) & (middle <= last)]
            moves, what = (t[0] < top, "speeds up") if way == "up" else (top < t[-1], "slows down")
            reasons = (
                (not moves, f"the drive never {what}"),
                (not inside.size, f"less than a window of travel on the way {way}"),
                (not inside.any(), f"no stick-slip all the way {way}"),
                (inside.all(), f"stick-slip all the way {way}"),
                (True, f"it does not {'set in' if onset in missing else 'end'} on the way {way}"),
            )
            why = next(reason for holds, reason in reasons if holds)
            notes.append(f"{' and '.join(missing).replace('_down', chr(39))} not seen: {why}")
        if here.size > 1:
            notes.append(f"stick-slip sets in {here.size} times on the way {way}: first onset and last end are given")
    speed = dict(oscillation["drive_velocity"].attrs)
    named = {
        name: ((), found[name], speed | {"long_name": f"stick-slip {what} on the way {way}"})
        for way, *names in _WAYS
        for name, what in zip(names, ("sets in", "ends"), strict=True)
    }
    return (
        oscillation.assign(named)
        .merge(_hysteresis(oscillation, top), combine_attrs="override")
        .assign_attrs(level=level, window=float(oscillation.attrs["window"]), notes="; ".join(notes))
    )


def _rig_of(run: xr.Dataset) -> Rig | None:
    """The rig that a run was made of; None if it does not say."""
    try:
        return rig_of(run)
    except InputError:
        return None


def _usual(run: xr.Dataset, rig: Rig | None, name: str) -> float:
    """The usual level or window in the unit of the run, from what it was made of."""
    value, scale, of = {"level": (0.4, "f_s", "spring_force"), "window": (4.0, "x_s", "displacement")}[name]
    if rig is not None:
        return value * rig.unit(scale)
    unit = str(run[of].attrs.get("units", "")) if of in run else ""
    if (known := unit_named(unit)) and known[0] in ("force", "length"):
        raise InputError(f"transitions: {of} is in {unit}: give {name} in that unit (.4 f_s and 4 x_s are usual)")
    return value


def _oscillation(run: xr.Dataset, trace: Trace, rig: Rig | None, level: float, window: float | None) -> xr.Dataset:
    """Peak to peak of the spring force over a moving window: of two cycles, or of a drive travel that is given.

    A cycle lasts at most as long as the drive takes to load spring and contacts by the largest change of the force in
    the run, and one free oscillation of the slider.
    """
    import xarray as xr

    assert trace.drive is not None
    travel = cumulative_trapezoid(trace.drive, trace.t, initial=0)
    if window is None and rig is not None and isinstance(rig.slider, Slider):
        swing = max(float(np.ptp(trace.force)), level) / rig.unit("f_s")
        loading = swing * (1.0 + 1.0 / rig.slider.stiffness) * rig.unit("x_s")
        period = 2 * np.pi * np.sqrt(rig.slider.mass / rig.slider.stiffness) * rig.unit("time")
        gone = cumulative_trapezoid(0.5 * trace.drive / (loading + trace.drive * period), trace.t, initial=0)
        each = " of two cycles"
    else:
        window = number("window", window or _usual(run, rig, "window"), above=0, hint="in the unit of X")
        gone, each = travel / window, f" of drive travel {window:g}"
    if gone[-1] < 2:
        raise UndecidedError(
            f"transitions: the drive travels {travel[-1]:.4g} in all, less than 2 windows{each}: run it longer"
        )
    few = UndecidedError(f"transitions: fewer than {_PARTS} samples in some window{each}: record more often")
    if gone[-1] * _PARTS > trace.t.size:
        raise few
    begin = np.arange(int(gone[-1] * _PARTS)) / _PARTS
    begins = np.searchsorted(gone, begin)
    if np.any(np.diff(begins) < 1):
        raise few
    high, low = (
        extreme.reduce(np.lib.stride_tricks.sliding_window_view(extreme.reduceat(trace.force, begins), _PARTS), axis=1)
        for extreme in (np.maximum, np.minimum)
    )
    begin = begin[: high.size]
    place, times = (
        np.array([np.interp(begin + part, gone, of) for part in (0.0, 0.5, 1.0)]) for of in (travel, trace.t)
    )
    units = {str(name): str(variable.attrs.get("units", "")) for name, variable in run.variables.items()}
    velocity = trace.sign * np.interp(times[1], trace.t, trace.drive)
    return xr.Dataset(
        {
            "peak_to_peak": labelled("peak to peak of the spring force", "travel", high - low, units["spring_force"]),
            "drive_velocity": labelled("velocity of the drive", "travel", velocity, units["drive_velocity"]),
        }
        | {
            name: labelled(f"time at the {name} of the window", "travel", at, units["time"])
            for name, at in zip(("begin", "middle", "end"), times, strict=True)
        },
        coords={"travel": labelled("travel of the drive", "travel", place[1], units.get("displacement", ""))},
        attrs={"window": float(np.max(place[2] - place[0]))},
    )


def in_words(run: xr.Dataset) -> str:
    """Say between which velocities a run on a ramp stick-slips; nothing for another run."""
    drive = np.abs(np.asarray(run["drive_velocity"].values, dtype=float)) if "drive_velocity" in run else np.zeros(1)
    if not np.ptp(drive) > 2.0 * CONSTANT_DRIVE * drive.max():
        return ""
    begin = "the velocity of the drive changes"
    try:
        found = transitions(run)
    except (InputError, UndecidedError) as error:
        return f"{begin}; {error}"

    def speed(name: str) -> str:
        value, unit = float(found[name]), str(found[name].attrs.get("units", ""))
        return "" if np.isnan(value) else engineering(value, "m/s", 3) if unit == "m/s" else f"{value:.3g}"

    said = []
    for way, onset, ending in (("speeding up", "v1", "v2"), ("slowing down", "v2_down", "v1_down")):
        sets_in, ends = speed(onset), speed(ending)
        if sets_in or ends:
            from_where = f"sets in at {sets_in}" if sets_in else "is there from the start"
            said.append(f"{way}, it {from_where} and {f'ends at {ends}' if ends else 'persists to the end'}")
    if said:
        return f"{begin}; stick-slip: {'; '.join(said)}"
    return f"{begin}; {found.attrs['notes']}"


def _hysteresis(oscillation: xr.Dataset, top: float) -> xr.Dataset:
    """Peak to peak on the way up and on the way down, against the velocity; nothing where the drive goes one way."""
    import xarray as xr

    middle, speed = np.asarray(oscillation["middle"].values), np.abs(np.asarray(oscillation["drive_velocity"].values))
    force = np.asarray(oscillation["peak_to_peak"].values)
    branches = [(speed[way], force[way]) for way in (middle <= top, middle > top)]
    if any(v.size < 2 for v, _ in branches):
        return xr.Dataset()
    low, high = max(float(v.min()) for v, _ in branches), min(float(v.max()) for v, _ in branches)
    if not low < high:
        return xr.Dataset()
    grid = np.linspace(low, high, 201)
    up, down = (np.interp(grid, v[order], f[order]) for v, f in branches for order in [np.argsort(v, kind="stable")])
    unit = oscillation["peak_to_peak"].attrs["units"]
    name = "peak to peak of the force, drive"
    return xr.Dataset(
        {
            "up": labelled(f"{name} speeding up", "velocity", up, unit),
            "down": labelled(f"{name} slowing down", "velocity", down, unit),
            "difference": labelled("peak to peak down less up", "velocity", down - up, unit),
        },
        coords={"velocity": ("velocity", grid, dict(oscillation["drive_velocity"].attrs))},
    )


def _turning_time(t: Array, drive: Array) -> float:
    """Time at which the drive is fastest: its start if it only slows down, its end if it only speeds up."""
    drive = np.abs(drive)
    margin = 1e-3 * float(drive.max())
    if np.ptp(drive) <= CONSTANT_DRIVE * float(drive.max()):
        raise UndecidedError(
            f"transitions: the drive keeps its velocity ({drive[-1]:.4g}); ramp it, or ask for the regime"
        )
    peaks, _ = turning_points(np.concatenate([[0.0], drive, [0.0]]), max(margin, 1e-300))
    if len(peaks) > 1:
        raise UndecidedError(
            f"transitions: the drive speeds up and slows down {len(peaks)} times; select one loop with "
            "run.sel(time=slice(from, to))"
        )
    fastest = np.flatnonzero(drive >= drive.max() - margin)
    return float(t[fastest[0]] if fastest[0] == 0 else t[fastest[-1]])


def _settled(on: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    """Pass over states shorter than so many steps, from the start onwards."""
    edges = np.concatenate([[0], np.flatnonzero(on[1:] != on[:-1]) + 1, [on.size]])
    result = on.copy()
    state = bool(on[0])
    for begin, end in itertools.pairwise(edges):
        if end - begin >= shortest or end == on.size:
            state = bool(on[begin])
        result[begin:end] = state
    return result
