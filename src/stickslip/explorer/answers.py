"""What the page asks for: a document in, plain data out. No state.

An answer is a generator: what it yields is sent at once, so that the force trace does not wait for what takes longer.
It takes a `Watch`, which it calls now and then with the fraction of the work done, and which ends work that nobody
waits for any more by raising.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from stickslip import advise, cycles, plot, rigid, stability, theory
from stickslip.errors import InputError, UndecidedError, instance, number, shown
from stickslip.explorer import bars, documents, measured, replay
from stickslip.explorer.plain import Array, Plain, Watch, along_path, axis, floats, force_trace, name_of, packed
from stickslip.friction_law import turning_velocities
from stickslip.io import datasets as store
from stickslip.io import rig_files as rigs
from stickslip.model import Delay, Interface
from stickslip.model.rig import Rig
from stickslip.simulation import simulate
from stickslip.stability import PARAMETERS

_FARTHEST = 1e3  # from the rig's own point, for the bistable band
_EXTENSIONS = 3  # of a run that is undecided, each twice as long
_POINTS = 72  # of the map along each parameter, twice over
_AROUND_AGED, _POINTS_AGED = 5.0, 24  # each point takes a hundred times as long, and theory ends at some speeds
_LAW, _LAW_POINTS = 300.0, 61  # of the friction law: speeds about that of the drive
_COLUMNS = 9  # of the map, for the bistable band


# ---------------------------------------------------------------------------------------------------------------------
# Page 1
# ---------------------------------------------------------------------------------------------------------------------


def run(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Force trace, phase portrait, stretchings at the cursor's time and regime; then the friction forces.

    A drive that would take too long is cut short. A run whose regime is undecided is asked for again, with the next
    ``step``, if twice the time can tell: each step is a question of its own, and others have their turn between.
    """
    begun = time.perf_counter()
    asked = documents.rig_of(request.get("document"))
    seconds, step = _seconds(request), request.get("step", 0)
    rig = documents.shortened(asked, seconds)
    notes = [] if rig is asked else [_cut_note(asked, rig, seconds)]
    for _ in range(step):
        rig = documents.extended(rig, seconds) or rig
        times = f"{rig.drive.duration / asked.drive.duration:.3g} times"
        notes = [f"The run was undecided at its end and went on by itself, {times} as long as asked for."]
    made = _run(rig, watch, seconds, snapshots=(_look(request, rig),))
    watch(1.0)
    answer = force_trace(made, _width(request))
    undecided = answer["regime"]["kind"] == "undecided" and step < _EXTENSIONS and "pieces" not in _drive(request)
    goes_on = undecided and documents.extended(rig, seconds) is not None
    yield {
        **answer,
        "phase": _phase(made),
        "stretchings": _stretchings(made),
        "name": rig.name,
        "notes": notes,
        "going_on": goes_on,
        "parameters": _values(rig),
        "period": _in_hertz(answer["regime"], rig),
        "took": time.perf_counter() - begun,
    }
    if not goes_on:
        yield {"friction": _friction(rig)}


def _drive(request: Plain) -> Mapping[str, Any]:
    drive = request["document"].get("drive")
    return drive if isinstance(drive, Mapping) else {}


def _seconds(request: Plain) -> float:
    """What a run may take, as the server says; by default as on one's own machine."""
    return float(request.get("seconds", documents.LONGEST))


def _cut_note(asked: Rig, rig: Rig, seconds: float) -> str:
    part = 100 * rig.drive.duration / asked.drive.duration
    return (
        f"The run shows the first {part:.2g} % of the drive, {rig.in_units(rig.drive.duration, 'time')}: the whole of "
        f"it would take more than about {seconds:g} s to simulate. For that use stickslip simulate."
    )


def _in_hertz(regime: Plain, rig: Rig) -> str:
    """How often slips or oscillations come, in words."""
    period = regime["period"]
    if period is None or regime["kind"] == "smooth sliding":
        return ""
    often = 1.0 / period
    return f"{often:.3g} Hz" if rig.scales is not None else f"{often:.3g} per time unit"


def law(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Kinetic friction against speed about that of the drive, and the speeds at which it turns."""
    rig = documents.rig_of(request.get("document"))
    documents.check_decades(rig)
    documents.check_thresholds(rig)
    velocity = rig.natural.velocity
    if velocity <= 0:
        raise InputError("drive.velocity = 0: kinetic friction is that of sliding")
    (low, high), count = (velocity / _LAW, velocity * _LAW), _LAW_POINTS
    if rig.interface.ageing is not None:  # each speed takes a hundred times as long
        (low, high), count = (velocity / 30.0, velocity * 30.0), 13
    speeds, forces = np.geomspace(low, high, count), []
    for i, speed in enumerate(speeds):
        watch(i / count)
        forces.append(float(theory.kinetic_friction(rig.interface, float(speed))))
    turning = () if rig.interface.ageing is not None else turning_velocities(rig.interface, between=(low, high))
    v, F = rig.unit("x_s/time"), rig.unit("f_s")
    unit = "x_s/time" if rig.scales is None else "m/s"
    yield {
        "speed": {"title": "speed", "unit": unit, "values": packed(speeds * v), "ends": [low * v, high * v]},
        "force": {"title": "kinetic friction", "unit": "f_s" if rig.scales is None else "N"},
        "values": packed(np.array(forces) * F),
        "here": [velocity * v, float(theory.kinetic_friction(rig.interface, velocity)) * F],
        "turning": [
            {
                "at": [one.velocity * v, one.force * F],
                "words": f"{one.kind} at {rig.in_units(one.velocity, 'velocity')}",
            }
            for one in turning
        ],
    }


def stretchings(request: Plain, watch: Watch) -> Iterator[Plain]:
    """The distribution of stretchings at another time of the same run."""
    rig = documents.rig_of(request.get("document"))
    rig = documents.of_duration(rig, request.get("duration"))
    yield {"stretchings": _stretchings(_run(rig, watch, _seconds(request), snapshots=(_look(request, rig),)))}


def contacts(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Frames of the contacts one by one, from the cursor on; see `replay`."""
    rig = documents.of_duration(documents.rig_of(request.get("document")), request.get("duration"))
    documents.check_size(rig, _seconds(request))
    share = request.get("cursor")
    at = float(share) if isinstance(share, (int, float)) and math.isfinite(share) else 0.0
    yield {"frames": next(replay.frames(rig, min(max(at, 0.0), 1.0), watch))}


def edit(request: Plain, watch: Watch) -> Iterator[Plain]:
    """A document with parameters varied, in other units, or with the damping given in the other way."""
    del watch
    document: Any = request.get("document")
    if "turn" in request:
        instance("turn", values := request["turn"], dict, "a table of parameters and values")
        yield {"document": documents.turned(document, values)}
    elif "units" in request:
        yield documents.in_units(document, request["units"], request.get("scales"))
    else:
        ratio = request.get("damping_ratio")
        instance("damping_ratio", ratio, bool, "true or false")
        yield {"document": documents.with_damping(document, ratio is True)}


def _values(rig: Rig) -> dict[str, float]:
    """Where each parameter of the map stands, in the unit of its axis."""
    if rig.natural.velocity <= 0:
        return {}
    setting = rig.natural
    found = {}
    for parameter in PARAMETERS:
        with suppress(InputError):  # the rig has no such parameter
            value = parameter.get(setting)
            if math.isfinite(value):
                found[parameter.name] = value * _unit(rig, parameter.name)
    return found


def _unit(rig: Rig, parameter: str) -> float:
    """Size of a parameter's natural unit on the axes of the map."""
    return 1.0 if rig.scales is None else rig.scales.unit(documents.QUANTITIES[parameter])


def _run(rig: Rig, watch: Watch, seconds: float, snapshots: tuple[float, ...] = ()) -> xr.Dataset:
    documents.check_size(rig, seconds)
    return simulate(replace(rig, output=replace(rig.output, snapshots=snapshots)), progress=watch)


def _phase(data: xr.Dataset) -> Plain:
    """Force against velocity in the last two fifths of the run, and the range that shows noise as small as it is."""
    late = data.isel(time=slice(int(0.6 * data.sizes["time"]), None))
    velocity, force = axis(late["velocity"]), axis(data["spring_force"])
    v, f = along_path(
        late["velocity"].to_numpy() / velocity["factor"], late["spring_force"].to_numpy() / force["factor"]
    )
    drive = float(late["drive_velocity"][-1]) / velocity["factor"]
    largest = float(data["spring_force"].max()) / force["factor"]
    return {
        "velocity": {**velocity, "values": packed(v), "range": _room(min(v.min(), 0.0), max(v.max(), 2 * drive))},
        "force": {**force, "values": packed(f), "range": _room(min(f.min(), 0.0), max(f.max(), largest))},
        "drive": drive,
    }


def _room(low: float, high: float) -> list[float]:
    margin = 0.04 * (high - low or 1.0)
    return [float(low - margin), float(high + margin)]


def _stretchings(data: xr.Dataset) -> Plain:
    x, density = axis(data["x"]), {**axis(data["stretching_density"]), "title": "Q(x)"}
    return {
        "x": {**x, "values": packed(data["x"].to_numpy() / x["factor"])},
        "stretching_density": {
            **density,
            "values": packed(data["stretching_density"].to_numpy()[0] / density["factor"]),
        },
        "at": float(data["snapshot"][0]) / axis(data["time"])["factor"],
    }


def _friction(rig: Rig) -> Plain:
    """F_k at the drive's speed and F_s of slow rigid motion, in the unit of the force; and K*, in words."""
    aged = replace(rig.interface, ageing=None)
    when = " (thresholds fully aged)" if rig.interface.ageing is not None else ""
    found: Plain = {"kinetic": None, "static": None, "words": []}
    try:
        documents.check_thresholds(rig)
    except InputError as error:
        return {**found, "words": [str(error)]}
    unit = 1.0 if rig.scales is None else rig.scales.unit("force")
    with suppress(InputError, UndecidedError):
        static = _static_friction(replace(aged, delay=Delay(0.0)))
        found["static"] = static * unit
        found["words"].append(f"F_s = {rig.in_units(static, 'force')}{when}")
    if rig.natural.velocity > 0:
        with suppress(InputError):
            kinetic = float(theory.kinetic_friction(rig.interface, rig.natural.velocity))
            if math.isfinite(kinetic):
                found["kinetic"] = kinetic * unit
                found["words"].append(f"F_k = {rig.in_units(kinetic, 'force')}")
    with suppress(InputError, UndecidedError):
        critical = _critical_stiffness(aged)
        ratio = rig.slider.stiffness / critical if critical > 0 else math.inf
        softer = "softer" if ratio < 1 else "stiffer"
        found["words"].append(f"K* = {rig.in_units(critical, 'stiffness')}{when}, and the spring is {softer}")
    return found


@lru_cache(maxsize=64)
def _static_friction(interface: Interface) -> float:
    return rigid.static_friction(interface)[0]


@lru_cache(maxsize=64)
def _critical_stiffness(interface: Interface) -> float:
    return rigid.critical_stiffness(interface)


# ---------------------------------------------------------------------------------------------------------------------
# Pages 2 and 3
# ---------------------------------------------------------------------------------------------------------------------


def chart(request: Plain, watch: Watch) -> Iterator[Plain]:
    """The stability map over two parameters, in the rig's units."""
    rig = documents.rig_of(request.get("document"))
    documents.check_thresholds(rig)
    over = _over(request)
    around, points = (20.0, _POINTS) if rig.interface.ageing is None else (_AROUND_AGED, _POINTS_AGED)
    found = advise.chart(rig, over, request.get("around", around), points, watch)
    rate = found["growth_rate"].transpose(over[1], over[0])
    values = rate.to_numpy()
    largest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 1.0
    shade = _shade(values / largest)
    levels = np.array([-1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0])
    yield {
        "x": _map_axis(found[over[0]]),
        "y": _map_axis(found[over[1]]),
        "over": over,
        "shade": [floats(row) for row in shade],
        "rate": [[f"{value:.3g}" for value in row] for row in values],
        "rate_unit": str(rate.attrs.get("units", "")),
        "levels": {"at": floats(_shade(levels)), "text": [f"{level * largest:.2g}" for level in levels]},
        "frequency_unit": "Hz" if found["edge_frequency"].attrs.get("units") == "1/s" else "cycles per time unit",
        "curves": [
            {
                "x": floats(found[f"edge_{over[0]}"].to_numpy()[mine]),
                "y": floats(found[f"edge_{over[1]}"].to_numpy()[mine]),
                "frequency": floats(found["edge_frequency"].to_numpy()[mine] / (2 * math.pi)),
            }
            for mine in (found["curve"].to_numpy() == curve for curve in np.unique(found["curve"].to_numpy()))
        ],
        "here": [float(found[f"here_{name}"]) for name in over],
        "summary": _about(rig),
    }


def _about(rig: Rig) -> str:
    """Whether smooth sliding is stable where the rig stands, in words."""
    modes = stability.count_unstable(rig.natural)
    if not modes:
        return "Smooth sliding is stable at this point."
    return f"Smooth sliding is unstable at this point: {modes} growing mode{'s' if modes > 1 else ''}."


def _map_axis(parameter: xr.DataArray) -> Plain:
    values = parameter.to_numpy()
    return {**name_of(parameter), "values": packed(values), "ends": [float(values[0]), float(values[-1])]}


def _shade(share: Array) -> Array:
    """Growth rates, as fractions of the largest, spread out about zero."""
    return np.asarray(np.arcsinh(share / 1e-3) / np.arcsinh(1e3))


def band(request: Plain, watch: Watch) -> Iterator[Plain]:
    """The bistable band of the map, column by column."""
    rig = documents.rig_of(request.get("document"))
    documents.check_thresholds(rig)
    over = _over(request)
    across, up = (next(parameter for parameter in PARAMETERS if parameter.name == name) for name in over)
    (left, right), (low, high) = (_ends(request, key) for key in ("x", "y"))
    scale = {name: _unit(rig, name) for name in over}
    setting = rig.natural
    for parameter, key, ends in ((across, "x", (left, right)), (up, "y", (low, high))):
        here = parameter.get(setting) * scale[parameter.name]
        if not here / _FARTHEST <= ends[0] <= ends[1] <= here * _FARTHEST:
            raise InputError(f"map: {key} = {list(ends)}: must lie within a factor of {_FARTHEST:g} of {here:.4g}")
    # From the middle outwards: the rig stands there.
    places = np.geomspace(left, right, _COLUMNS)
    order = sorted(range(_COLUMNS), key=lambda i: abs(i - _COLUMNS // 2))
    for done, i in enumerate(order, start=1):
        turned = across.set(setting, places[i] / scale[across.name])
        bands: list[list[float]] = []
        note = ""
        try:
            found = cycles.bistable_range(
                turned,
                up,
                between=(low / scale[up.name], high / scale[up.name]),
                step=0.2,
                tolerance=0.02,
            )
            bands = [[b.low.value * scale[up.name], b.high.value * scale[up.name]] for b in found.bands]
        except (InputError, UndecidedError) as error:
            note = str(error)
        watch(done / _COLUMNS)
        yield {"column": float(places[i]), "bands": bands, "note": note, "columns": done, "of": _COLUMNS}


def advice(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Verdict, numbers, margins and mitigations."""
    rig = documents.shortened(documents.rig_of(request.get("document")), _seconds(request))
    documents.check_size(rig, _seconds(request))
    documents.check_thresholds(rig)
    found = advise.predict(rig, progress=watch)
    assert isinstance(found, advise.Prediction)  # elastic sliders have a page of their own
    mitigations = []
    for mitigation in found.mitigations:
        trouble = "stick-slip" if found.regime.kind == "stick-slip" else "the oscillation"
        outcomes = (
            (mitigation.stops, f"smooth: {trouble} decays even from a start at rest"),
            (mitigation.keeps, f"smooth sliding, once reached, stays; from rest {trouble} may persist"),
        )
        steps = [
            {
                "title": f"{_change(mitigation.parameters, mitigation.values, values)}: {outcome}",
                "to": ", ".join(
                    f"{advise.amount(rig, name, before)} to {advise.amount(rig, name, value)}"
                    for name, before, value in zip(mitigation.parameters, mitigation.values, values, strict=True)
                ),
                "values": dict(zip(mitigation.parameters, values, strict=True)),
            }
            for values, outcome in outcomes
            if values is not None
        ]
        mitigations.append({"parameters": list(mitigation.parameters), "steps": steps})
    yield {
        "name": rig.name,
        "verdict": found.verdict,
        "ill": found.ill,
        "evidence": str(found.regime).splitlines(),
        "numbers": [list(pair) for pair in found.numbers()],
        "margins": [list(row) for row in found.margin_rows()],
        "mitigations": mitigations,
        "attempts": list(found.attempt_lines()),
        "not_searched": found.search_note(),
        "assumed": {key: str(item) for key, item in rig.assumed.items()},
    }


_CHANGES = {
    "stiffness": ("a stiffer spring", "a softer spring"),
    "velocity": ("faster", "slower"),
    "mass": ("a heavier slider", "a lighter slider"),
    "damping": ("more damping", "less damping"),
    "delay": ("slower re-attachment", "faster re-attachment"),
    "std": ("more scattered thresholds", "less scattered thresholds"),
    "ageing": ("slower ageing", "faster ageing"),
    "contact_stiffness": ("stiffer contacts", "softer contacts"),
    "normal_load": ("more load", "less load"),
}
_FRACTIONS = ((0.2, "a fifth"), (0.25, "a quarter"), (1 / 3, "a third"), (0.5, "half"), (2 / 3, "two thirds"))


def _change(names: tuple[str, ...], before: tuple[float, ...], after: tuple[float, ...]) -> str:
    """A change of parameters, as one would say it: "a softer spring, by a third"."""
    parts = []
    for name, old, new in zip(names, before, after, strict=True):
        more, less = _CHANGES.get(name, (f"more {name}", f"less {name}"))
        parts.append(f"{more if new > old else less}, {_by(new / old)}")
    return " and ".join(parts)


def _by(ratio: float) -> str:
    """How far, in words."""
    if ratio >= 1.95:
        return f"{ratio:.2g} times"
    if ratio <= 1 / 2.1:
        return f"1/{1 / ratio:.2g} of it"
    change = abs(ratio - 1.0)
    nearest, words = min(_FRACTIONS, key=lambda part: abs(part[0] - change))
    return f"by {words}" if abs(nearest - change) < 0.02 else f"by {100 * change:.2g} %"


def _over(request: Plain) -> tuple[str, str]:
    over = request.get("over")
    known = [parameter.name for parameter in PARAMETERS]
    if not isinstance(over, list) or len(over) != 2 or over[0] == over[1] or any(name not in known for name in over):
        raise InputError(f"map: over = {shown(over)}: must be two different parameters of {', '.join(known)}")
    return (str(over[0]), str(over[1]))


def _ends(request: Plain, key: str) -> tuple[float, float]:
    """Both ends of an axis of the map."""
    ends = request.get(key)
    if not isinstance(ends, list) or len(ends) != 2:
        raise InputError(f"map: {key} = {shown(ends)}: must be the two ends of an axis")
    low = number(f"map: {key}", ends[0], above=0)
    return low, number(f"map: {key}", ends[1], above=low)


# ---------------------------------------------------------------------------------------------------------------------
# Page 4 and downloads
# ---------------------------------------------------------------------------------------------------------------------


FORMATS = {
    "nc": "application/x-netcdf",
    "png": "image/png",
    "svg": "image/svg+xml",
    "toml": "application/toml",
}


def download(document: object, form: str, duration: object, seconds: float, watch: Watch) -> Iterator[bytes]:
    """The rig as TOML; or the run on the page, of that duration, as NetCDF or as a picture."""
    rig = documents.rig_of(document)
    if form == "toml":
        yield rigs.to_toml(rig).encode()
        return
    rig = documents.of_duration(rig, duration)
    made = _run(rig, watch, seconds)
    made.attrs["rig"] = rigs.to_toml(rig)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"run.{form}"
        if form == "nc":
            store.save(made, file)
        else:
            plot.save(plot.overview(made), file)
        yield file.read_bytes()


ANSWERS: Mapping[str, Callable[..., Iterator[Any]]] = {
    "run": run,
    "law": law,
    "stretchings": stretchings,
    "contacts": contacts,
    "edit": edit,
    "chart": chart,
    "band": band,
    "advice": advice,
    "trace": measured.trace,
    "fit": measured.fit,
    "posterior": measured.posterior,
    "download": download,
    "fronts": bars.fronts,
    "sample": measured.sample,
}
"""What a worker can be asked; the last argument of each is its watch."""
QUICK, SLOW = ("run", "law", "stretchings", "contacts", "edit"), ("chart", "band", "advice", "fronts")
"""Questions of a window."""


# ---------------------------------------------------------------------------------------------------------------------
# Arrays for a screen
# ---------------------------------------------------------------------------------------------------------------------


def _look(request: Plain, rig: Rig) -> float:
    """Time of the cursor; just before the end at the latest, where rounding could take it beyond."""
    share = request.get("cursor")
    if not isinstance(share, (int, float)) or not math.isfinite(share):
        share = 1.0
    return min(max(float(share), 0.0), 0.9999) * rig.drive.duration


def _width(request: Plain) -> int:
    width = request.get("width")
    return int(min(max(width, 100), 4_000)) if isinstance(width, (int, float)) and math.isfinite(width) else 1_000
