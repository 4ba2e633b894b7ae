"""The page Simulate: a run with its force, phase portrait and stretchings, its
contacts, and changes of the rig.
"""

import math
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from stickslip import io, plot, rigid, sliding
from stickslip.errors import InputError, UndecidedError, instance
from stickslip.explorer import documents
from stickslip.explorer.plain import (
    Array,
    Plain,
    Watch,
    along_path,
    axis,
    force_trace,
    in_unit,
    packed,
    width_of,
    within,
)
from stickslip.model import Delay, Rig
from stickslip.simulation import simulate

FRAMES = 1_200  # 40 s at 30 frames a second
STEP = 1e-3  # resolution of the stretchings that are sent to the page, in x_s
_EXTENSIONS = 3  # most extensions of an undecided run, each to twice the length
# the friction law is shown up to this factor above and below the speed of the drive
_LAW = 300.0
_LAW_POINTS = 61


def run(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Simulate a rig: yield its force trace, phase portrait, stretchings at the
    cursor's time and regime; then the friction forces.

    A drive that would take too long is cut short. If the regime of a run is undecided,
    it is made twice as long, up to `_EXTENSIONS` times.
    """
    asked = documents.rig_asked_for(request)
    seconds = documents.seconds_of(request)
    rig = documents.shortened(asked, seconds)
    lasts = rig.in_units(rig.drive.duration, "time")
    part = rig.drive.duration / asked.drive.duration
    whole = (
        f"the whole of it would take more than about {seconds:g} s to simulate. "
        "For that use stickslip simulate."
    )
    notes = []
    if rig is not asked:
        first = f"The run shows the first {100 * part:.2g} % of the drive, {lasts}"
        notes.append(f"{first}: {whole}")
    for step in range(_EXTENSIONS + 1):
        made = _run(rig, watch, seconds, snapshots=(_cursor_time(request, rig),))
        answer = force_trace(made, width_of(request))
        undecided = answer["regime"]["kind"] == "undecided" and step < _EXTENSIONS
        longer = documents.extended(rig, seconds) if undecided else None
        yield {
            **answer,
            "phase": _phase(made),
            "stretchings": _stretchings(made),
            "name": rig.name,
            "notes": notes,
            "going_on": longer is not None,
            "parameters": documents.values_of(rig),
        }
        if longer is None:
            break
        rig = longer
        times = f"{rig.drive.duration / asked.drive.duration:.3g} times"
        notes = [
            (
                f"The run was undecided at its end and went on by itself, {times} as "
                "long "
                "as asked for."
            )
        ]
    yield {"friction": _friction(rig)}


def law(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield the kinetic friction against speed, around the speed of the drive, with the
    speeds of its maxima and minima.
    """
    rig = documents.rig_asked_for(request)
    documents.check_decades(rig)
    documents.check_thresholds(rig)
    velocity = rig.natural.velocity
    if velocity <= 0:
        raise InputError("drive.velocity = 0: kinetic friction is that of sliding")
    # with thresholds that age each speed takes a hundred times as long
    aged = rig.interface.ageing is not None
    around, count = (30.0, 13) if aged else (_LAW, _LAW_POINTS)
    low = velocity / around
    high = velocity * around
    speeds = np.geomspace(low, high, count)
    forces = []
    for i, speed in enumerate(speeds):
        watch(i / count)
        forces.append(float(sliding.kinetic_friction(rig.interface, float(speed))))
    turning = (
        () if aged else sliding.turning_velocities(rig.interface, between=(low, high))
    )
    v = rig.unit("x_s/time")
    F = rig.unit("f_s")
    yield {
        "speed": {
            "title": "speed",
            "unit": rig.unit_name("x_s/time"),
            "values": packed(speeds * v),
            "ends": [low * v, high * v],
        },
        "force": {"title": "kinetic friction", "unit": rig.unit_name("f_s")},
        "values": packed(np.array(forces) * F),
        "here": [
            velocity * v,
            float(sliding.kinetic_friction(rig.interface, velocity)) * F,
        ],
        "turning": [
            {
                "at": [one.velocity * v, one.force * F],
                "words": f"{one.kind} at {rig.in_units(one.velocity, 'velocity')}",
            }
            for one in turning
        ],
    }


def stretchings(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield the distribution of stretchings at another time of the same run."""
    rig = documents.rig_asked_for(request)
    seconds = documents.seconds_of(request)
    made = _run(rig, watch, seconds, snapshots=(_cursor_time(request, rig),))
    yield {"stretchings": _stretchings(made)}


def contacts(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield frames of the single contacts, from the cursor on; see `plot.frames`."""
    rig = documents.rig_asked_for(request)
    documents.check_size(rig, documents.seconds_of(request))
    seen = plot.frames(rig, within(request, "cursor", 0.0, 1.0, 0.0), FRAMES, watch)
    frames = {
        name: packed(getattr(seen, name))
        for name in ("times", "force", "slider", "drive")
    }
    frames["stretching"] = packed(
        np.clip(np.rint(seen.stretching / STEP), -32_767, 32_767), "i2"
    )
    about = {
        "step": STEP,
        "shown": seen.flags.shape[1],
        "of": seen.contacts,
        "exact": seen.exact,
        "own": seen.own,
    }
    yield {"frames": {**frames, "flags": packed(seen.flags, "u1"), **about}}


def edit(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield a document with varied parameters, in other units, or with the damping in
    its other form.
    """
    del watch
    document: Any = request.get("document")
    if "turn" in request:
        instance(
            "turn", values := request["turn"], dict, "a table of parameters and values"
        )
        yield {"document": documents.with_parameters(document, values)}
    elif "units" in request:
        yield documents.in_units(document, request["units"], request.get("scales"))
    else:
        ratio = request.get("damping_ratio")
        instance("damping_ratio", ratio, bool, "true or false")
        yield {"document": documents.with_damping(document, ratio is True)}


def _run(
    rig: Rig, watch: Watch, seconds: float, snapshots: tuple[float, ...] = ()
) -> xr.Dataset:
    documents.check_size(rig, seconds)
    return simulate(
        replace(rig, output=replace(rig.output, snapshots=snapshots)), progress=watch
    )


def _phase(data: xr.Dataset) -> Plain:
    """Return the force against velocity in the last two fifths of the run, with a range
    of the axes in which small noise looks small.
    """
    late = data.isel(time=slice(int(0.6 * data.sizes["time"]), None))
    velocity = axis(late["velocity"])
    force = axis(data["spring_force"])
    v, f = along_path(
        in_unit(late["velocity"], velocity), in_unit(late["spring_force"], force)
    )
    drive = float(late["drive_velocity"][-1]) / velocity["factor"]
    largest = float(data["spring_force"].max()) / force["factor"]
    return {
        "velocity": {
            **velocity,
            "values": packed(v),
            "range": _room(v, 2 * drive),
        },
        "force": {
            **force,
            "values": packed(f),
            "range": _room(f, largest),
        },
        "drive": drive,
    }


def _room(values: Array, least: float) -> list[float]:
    """Return the range of the values, including 0 and `least`, with a margin."""
    low = min(values.min(), 0.0)
    high = max(values.max(), least)
    margin = 0.04 * (high - low or 1.0)
    return [float(low - margin), float(high + margin)]


def _stretchings(data: xr.Dataset) -> Plain:
    x = axis(data["x"])
    density = axis(data["stretching_density"])
    values = packed(in_unit(data["stretching_density"][0], density))
    return {
        "x": {**x, "values": packed(in_unit(data["x"], x))},
        "stretching_density": {**density, "title": "Q(x)", "values": values},
        "at": float(data["snapshot"][0]) / axis(data["time"])["factor"],
    }


def _friction(rig: Rig) -> Plain:
    """Return F_k at the drive's speed and F_s of slow rigid motion, in the unit of the
    force, and both with K* as text.
    """
    aged = replace(rig.interface, ageing=None)
    when = " (thresholds fully aged)" if rig.interface.ageing is not None else ""
    found: Plain = {"kinetic": None, "static": None, "words": []}
    try:
        documents.check_thresholds(rig)
    except InputError as error:
        return {**found, "words": [str(error)]}
    with suppress(InputError, UndecidedError):
        static = _static_friction(replace(aged, delay=Delay(0.0)))[0]
        found["static"] = static * rig.unit("f_s")
        found["words"].append(f"F_s = {rig.in_units(static, 'force')}{when}")
    if rig.natural.velocity > 0:
        with suppress(InputError):
            kinetic = float(
                sliding.kinetic_friction(rig.interface, rig.natural.velocity)
            )
            if math.isfinite(kinetic):
                found["kinetic"] = kinetic * rig.unit("f_s")
                found["words"].append(f"F_k = {rig.in_units(kinetic, 'force')}")
    with suppress(InputError, UndecidedError):
        critical = _critical_stiffness(aged)
        ratio = rig.slider.stiffness / critical if critical > 0 else math.inf
        softer = "softer" if ratio < 1 else "stiffer"
        found["words"].append(
            f"K* = {rig.in_units(critical, 'stiffness')}{when}, and the spring is "
            f"{softer}"
        )
    return found


_static_friction = lru_cache(maxsize=64)(rigid.static_friction)
_critical_stiffness = lru_cache(maxsize=64)(rigid.critical_stiffness)


def download(form: str, request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield a file: the rig as TOML, or the run on the page, with its duration, as
    NetCDF or as a picture.
    """
    rig = documents.rig_asked_for(request)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"run.{form}"
        if form == "toml":
            file.write_text(io.to_toml(rig), "utf-8")
        else:
            made = _run(rig, watch, documents.seconds_of(request))
            made.attrs["rig"] = io.to_toml(rig)
            if form == "nc":
                io.save(made, file)
            else:
                plot.save(plot.overview(made), file)
        yield {
            "name": rig.name,
            "file": packed(np.frombuffer(file.read_bytes(), "u1"), "u1"),
        }


def _cursor_time(request: Plain, rig: Rig) -> float:
    """Return the time of the cursor, at most just before the end, which rounding might
    exceed.
    """
    return within(request, "cursor", 0.0, 0.9999, 1.0) * rig.drive.duration
