"""Runs and traces as plain data for a screen: axes with units, the force with its slips and regime."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from stickslip import measure
from stickslip.explorer.packing import Array, Plain, envelope, packed
from stickslip.measure import ramps

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_MOST_MARKED = 2_000  # slips; more cannot be told apart on a screen


def force_trace(data: xr.Dataset, width: int) -> Plain:
    """Force against time, thinned to the width of the screen, with regime in words, and slips if it has any."""
    seen, words = measure.regime(data), ramps.in_words(data)
    slips = measure.drops(data) if seen.kind == "stick-slip" or words else None
    times, force = axis(data["time"]), axis(data["spring_force"])
    t, f = envelope(data["time"].to_numpy() / times["factor"], data["spring_force"].to_numpy() / force["factor"], width)
    start, end, before = (
        np.empty(0) if slips is None else slips[name].to_numpy()[:_MOST_MARKED]
        for name in ("start", "end", "force_before")
    )
    return {
        "time": {**times, "values": packed(t)},
        "force": {**force, "values": packed(f)},
        "span": [float(data["time"][0]) / times["factor"], float(data["time"][-1]) / times["factor"]],
        "slips": {
            "count": 0 if slips is None else int(slips.sizes["event"]),
            "counted": "no slips" if slips is None else measure.counted(slips),
            "start": floats(start / times["factor"]),
            "end": floats(end / times["factor"]),
            "before": floats(before / force["factor"]),
        },
        "regime": {
            "kind": seen.kind if not words else "speed sweep",
            "reason": words or seen.reason,
            "evidence": str(seen).splitlines()[1:] if not words else [],
            "period": seen.period if math.isfinite(seen.period) and not words else None,
        },
        "window": [edge / times["factor"] for edge in seen.window],
    }


def axis(variable: xr.DataArray) -> Plain:
    """Name and unit of an axis; SI units get the prefix that suits the values, which `factor` divides out."""
    name = name_of(variable)
    values = variable.to_numpy()
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    if name["unit"] in ("N", "m", "s", "m/s") and largest > 0 and not 0.5 <= largest < 5e3:
        factor, prefix = next((p for p in PREFIXES if largest >= 0.5 * p[0]), PREFIXES[-1])
        return {**name, "unit": prefix + name["unit"], "factor": factor}
    return {**name, "factor": 1.0}


def name_of(variable: xr.DataArray) -> Plain:
    """Name and unit of a variable."""
    return {
        "title": str(variable.attrs.get("long_name", variable.name)),
        "unit": str(variable.attrs.get("units", "")),
    }


def floats(values: Array) -> list[float | None]:
    """Numbers as JSON has them; None for what is none."""
    return [float(value) if math.isfinite(value) else None for value in values]
