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


def _windows(trace: Trace, rig: Rig, level: float) -> Array:
    """How many windows of two cycles the drive has gone through.

    A cycle lasts at most as long as the drive takes to load spring and contacts by the largest change of the force in
    the run, and one free oscillation of the slider.
    """
    assert trace.drive is not None
    swing = max(float(np.ptp(trace.force)), level) / rig.unit("f_s")
    loading = swing * (1.0 + 1.0 / rig.slider.stiffness) * rig.unit("x_s")
    period = 2 * np.pi * np.sqrt(rig.slider.mass / rig.slider.stiffness) * rig.unit("time")
    rate = 0.5 * trace.drive / (loading + trace.drive * period)
    return np.asarray(cumulative_trapezoid(rate, trace.t, initial=0))


def _oscillation(run: xr.Dataset, rig: Rig | None, level: float, window: float | None) -> xr.Dataset:
    """Peak to peak of the spring force over a moving window: of two cycles, or of a drive travel that is given."""
    import xarray as xr

    trace = Trace.of(run)
    if trace.drive is None:
        raise InputError("transitions: need a run with the variable drive_velocity; a trace of the force has none")
    if np.any(trace.drive < 0):
        raise InputError(f"transitions: drive_velocity = {trace.sign * trace.drive.min():g}: the drive turns back")
    travel = cumulative_trapezoid(trace.drive, trace.t, initial=0)
    if window is not None or rig is None or not isinstance(rig.slider, Slider):
        if window is None:
            window = _usual(run, "window", "displacement", 4.0, None)
        gone, each = travel / number("window", window, above=0, hint="in the unit of X"), f" of drive travel {window:g}"
    else:
        gone, each = _windows(trace, rig, level), " of two cycles"
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
    high = np.lib.stride_tricks.sliding_window_view(np.maximum.reduceat(trace.force, begins), _PARTS).max(axis=1)
    low = np.lib.stride_tricks.sliding_window_view(np.minimum.reduceat(trace.force, begins), _PARTS).min(axis=1)
    begin = begin[: high.size]
    middle = begin + 0.5
    units = {str(name): str(variable.attrs.get("units", "")) for name, variable in run.variables.items()}
    velocity = trace.sign * np.interp(np.interp(middle, gone, trace.t), trace.t, trace.drive)
    times = {
        name: labelled(
            f"time at the {name} of the window", "travel", np.interp(begin + part, gone, trace.t), units["time"]
        )
        for name, part in (("begin", 0.0), ("middle", 0.5), ("end", 1.0))
    }
    title, place = "peak to peak of the spring force", np.interp(middle, gone, travel)
    longest = np.max(np.interp(begin + 1.0, gone, travel) - np.interp(begin, gone, travel))
    return xr.Dataset(
        {
            "peak_to_peak": labelled(title, "travel", high - low, units["spring_force"]),
            "drive_velocity": labelled("velocity of the drive", "travel", velocity, units["drive_velocity"]),
            **times,
        },
        coords={"travel": labelled("travel of the drive", "travel", place, units.get("displacement", ""))},
        attrs={"window": float(longest)},
    )


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
    rig = _rig_of(run)
    if level is None:
        level = _usual(run, "level", "spring_force", 0.4, rig)
    level = number("level", level, above=0, hint="in the unit of spring_force")
    oscillation = _oscillation(run, rig, level, window)
    t, drive = (np.asarray(run[name].values, dtype=float) for name in ("time", "drive_velocity"))
    top = _turning_time(t, drive)
    height, middle = (np.asarray(oscillation[name].values) for name in ("peak_to_peak", "middle"))
    on = _settled(height > level, _PARTS // 2)
    change = np.flatnonzero(on[1:] != on[:-1]) + 1
    starts = np.asarray(oscillation["end"].values)[change[on[change]]]
    stops = np.asarray(oscillation["begin"].values)[change[~on[change]] - 1]

    notes: list[str] = []
    # What the start leaves behind only decays, and within some tens of windows.
    grown = np.flatnonzero(height > np.minimum.accumulate(height) + level)
    transient = float(middle[min(_LONGEST_TRANSIENT * _PARTS, middle.size - 1, *grown[:1].tolist())])
    if starts.size:
        transient = min(transient, float(starts[0]))
    if on[0]:
        state = f"until v = {np.interp(stops[0], t, drive):.3g}" if stops.size else "all along"
        whose = "" if stops.size and stops[0] > transient else ": the state the run was started in"
        notes.append(f"the force oscillates above the level from the start {state}{whose}")

    found: dict[str, float] = {}
    for way, onset, ending, moves, first, last in (
        ("up", "v1", "v2", t[0] < top, -np.inf, top),
        ("down", "v2_down", "v1_down", top < t[-1], top, np.inf),
    ):
        here = starts[(starts > first) & (starts <= last)]
        there = stops[(stops > first) & (stops <= last) & ((stops > transient) | (t[0] >= top))]
        found[onset] = float(np.interp(here[0], t, drive)) if here.size else np.nan
        found[ending] = float(np.interp(there[-1], t, drive)) if there.size else np.nan
        missing = [name for name in (onset, ending) if np.isnan(found[name])]
        if missing:
            seen = on[(middle > first) & (middle <= last)]
            why = _why_unseen(way, seen, moves=bool(moves), onset=onset in missing, both=len(missing) == 2)
            notes.append(f"{' and '.join(missing).replace('_down', chr(39))} not seen: {why}")
        if here.size > 1:
            notes.append(f"stick-slip sets in {here.size} times on the way {way}: first onset and last end are given")
    speed = dict(oscillation["drive_velocity"].attrs)
    words = {"v1": "sets in on the way up", "v2": "ends on the way up"}
    words |= {"v2_down": "sets in on the way down", "v1_down": "ends on the way down"}
    return (
        oscillation.assign(
            {name: ((), found[name], speed | {"long_name": f"stick-slip {words[name]}"}) for name in words}
        )
        .merge(_hysteresis(oscillation, top), combine_attrs="override")
        .assign_attrs(level=level, window=float(oscillation.attrs["window"]), notes="; ".join(notes))
    )


def _why_unseen(way: str, seen: NDArray[np.bool_], *, moves: bool, onset: bool, both: bool) -> str:
    """Why stick-slip was not seen to set in, or to end, on one way of a ramp."""
    if not moves:
        return f"the drive never {'speeds up' if way == 'up' else 'slows down'}"
    if not seen.size:
        return f"less than a window of travel on the way {way}"
    if both and (seen.all() or not seen.any()):
        return f"{'stick-slip' if seen.all() else 'no stick-slip'} all the way {way}"
    return f"it does not {'set in' if onset else 'end'} on the way {way}"


def _rig_of(run: xr.Dataset) -> Rig | None:
    """The rig that a run was made of; None if it does not say."""
    try:
        return rig_of(run)
    except InputError:
        return None


def _usual(run: xr.Dataset, name: str, of: str, value: float, rig: Rig | None) -> float:
    """The usual level or window in the unit of the run, from what it was made of."""
    if rig is not None:
        return value * rig.unit("f_s")
    unit = str(run[of].attrs.get("units", "")) if of in run else ""
    known = unit_named(unit)
    if known and known[0] in ("force", "length"):
        raise InputError(f"transitions: {of} is in {unit}: give {name} in that unit (.4 f_s and 4 x_s are usual)")
    return value


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
