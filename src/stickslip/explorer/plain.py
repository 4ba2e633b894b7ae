"""Runs and traces as plain data for a screen: arrays, axes with units, and the force
with its slips and regime.
"""

import base64
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip import measure
from stickslip.arrays import Array as Array
from stickslip.arrays import units_of
from stickslip.plot import envelope
from stickslip.words import number, prefixed

Plain = dict[str, Any]
Watch = Callable[[float], None]
"""Function that is called with the completed fraction of the work; it raises if nobody
waits for the result any more.
"""

_MOST_MARKED = 2_000  # most slips that are marked; a screen does not resolve more
_ALONG_PATH = 1_200  # points of a curve in the plane


def force_trace(data: xr.Dataset, width: int) -> Plain:
    """Return the force against time, thinned to the width of the screen, with its
    regime as text, its drops, and its slips if there are any.
    """
    seen, drops = measure.regime_and_drops(data)
    words = measure.transitions_in_words(data)
    slips = drops if seen.kind == "stick-slip" or words else drops.isel(event=slice(0))
    times = axis(data["time"])
    force = axis(data["spring_force"])
    t = in_unit(data["time"], times)
    f = in_unit(data["spring_force"], force)
    t, f = envelope(t, f, 2 * width)
    start, end, before = (
        slips[name].values[:_MOST_MARKED] for name in ("start", "end", "force_before")
    )
    kind = "in parts" if seen.is_in_turn else seen.kind
    frequency = ""
    if not (words or seen.is_in_turn or seen.kind == "smooth sliding"):
        frequency = _frequency(seen)
    # the pieces have their own table
    evidence = str(replace(seen, segments=())).splitlines()
    return {
        "time": {**times, "values": packed(t)},
        "force": {**force, "values": packed(f)},
        "span": span(data, times),
        "slips": {
            "count": int(slips.sizes["event"]),
            "counted": measure.counted(slips),
            "start": floats(start / times["factor"]),
            "end": floats(end / times["factor"]),
            "before": floats(before / force["factor"]),
        },
        "read": str(data.attrs.get("read", "")),
        "parts": [
            {"cells": cells, "span": part.window if part else None}
            for part, cells in zip(
                (None, *seen.segments), measure.part_rows(seen.segments), strict=False
            )
        ],
        "statistics": [("found", measure.counted(drops)), *measure.statistics(drops)],
        "regime": {
            "kind": "speed sweep" if words else kind,
            "reason": words or seen.reason,
            "evidence": [] if words else evidence[1:],
            "frequency": frequency,
        },
    }


def _frequency(seen: measure.Regime) -> str:
    """Return the frequency of an oscillation as text; empty without a period."""
    if math.isfinite(seen.frequency):
        return f"{number(seen.frequency, 3)} Hz"
    if math.isfinite(seen.period):
        return f"{number(1.0 / seen.period, 3)} cycles per time unit"
    return ""


def within(request: Plain, key: str, low: float, high: float, usual: float) -> float:
    """Return a number of a request, limited to its bounds, or `usual` if missing."""
    value = request.get(key)
    if isinstance(value, (int, float)) and math.isfinite(value):
        return min(max(float(value), low), high)
    return usual


def width_of(request: Plain) -> int:
    """Return the width of the requesting page, in pixels."""
    return int(within(request, "width", 100, 4_000, 1_000))


def axis(variable: xr.DataArray) -> Plain:
    """Return the name and the unit of an axis; an SI unit gets the prefix that suits
    the values, and values are divided by `factor`.
    """
    name = name_of(variable)
    largest = float(np.nanmax(np.abs(variable.values), initial=0.0))
    if name["unit"] not in ("N", "m", "s", "m/s") or 0.5 <= largest < 5e3:
        return {**name, "factor": 1.0}
    factor, unit = prefixed(2.0 * largest, name["unit"])  # .5 kN rather than 500 N
    return {**name, "unit": unit.replace("u", "µ"), "factor": factor}


def in_unit(variable: xr.DataArray, along: Plain) -> Array:
    """Return values in the unit of an axis."""
    return np.asarray(variable / along["factor"])


def span(data: xr.Dataset, times: Plain) -> list[float]:
    """Return the times at which a run or a trace begins and ends."""
    return [float(time) / times["factor"] for time in data["time"][[0, -1]]]


def name_of(variable: xr.DataArray) -> Plain:
    """Return the name and the unit of a variable."""
    return {
        "title": str(variable.attrs.get("long_name", variable.name)),
        "unit": units_of(variable),
    }


def floats(values: Array) -> list[float | None]:
    """Return numbers in the form of JSON; None for NaN and infinity."""
    return [float(value) if math.isfinite(value) else None for value in values]


def packed(values: NDArray[Any], kind: str = "f4") -> Plain:
    """Return an array in the form that plotly.js reads without parsing numbers."""
    return {
        "dtype": kind,
        "bdata": base64.b64encode(values.astype(f"<{kind}").tobytes()).decode(),
    }


def along_path(x: Array, y: Array) -> tuple[Array, Array]:
    """Thin out a curve in the plane, evenly along its path, so that fast parts keep
    their points.
    """
    if x.size <= _ALONG_PATH:
        return x, y
    scales = [float(np.ptp(values)) or 1.0 for values in (x, y)]
    steps = np.hypot(np.diff(x) / scales[0], np.diff(y) / scales[1])
    path = np.append(0.0, steps.cumsum())
    kept = np.unique(
        np.searchsorted(path, np.linspace(0.0, path[-1], _ALONG_PATH)).clip(
            0, x.size - 1
        )
    )
    return x[kept], y[kept]
