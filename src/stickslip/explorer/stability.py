"""The pages Map and Stop: linear stability over two parameters, and changes that stop
stick-slip.
"""

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from stickslip import advise
from stickslip.arrays import units_of
from stickslip.errors import InputError, shown
from stickslip.explorer import documents
from stickslip.explorer.plain import Array, Plain, Watch, floats, name_of, packed

_POINTS = 72  # points of the map along each parameter, in each direction
# With ageing each point takes a hundred times as long, and theory ends at some speeds.
_AROUND_AGED = 5.0
_POINTS_AGED = 24


def chart(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield the stability map over two parameters, in the rig's units."""
    rig = documents.rig_asked_for(request)
    documents.check_thresholds(rig)
    over = request.get("over")
    known = documents.NAMES
    if (
        not isinstance(over, list)
        or len(over) != 2
        or over[0] == over[1]
        or any(name not in known for name in over)
    ):
        raise InputError(
            f"map: over = {shown(over)}: must be two different parameters of "
            f"{', '.join(known)}"
        )
    around, points = (
        (20.0, _POINTS)
        if rig.interface.ageing is None
        else (_AROUND_AGED, _POINTS_AGED)
    )
    found = advise.chart(
        rig, (over[0], over[1]), request.get("around", around), points, watch
    )
    rate = found["growth_rate"].transpose(over[1], over[0])
    values = rate.values
    largest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 1.0
    levels = np.array([-1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0])
    curve_of = found["curve"].values
    x, y = (found[f"edge_{name}"].values for name in over)
    frequency = found["edge_frequency"].values / (2 * math.pi)
    yield {
        "x": _map_axis(found[over[0]]),
        "y": _map_axis(found[over[1]]),
        "over": over,
        "shade": [floats(row) for row in _shade(values / largest)],
        "rate": [[f"{value:.3g}" for value in row] for row in values],
        "rate_unit": units_of(rate),
        "levels": {
            "at": floats(_shade(levels)),
            "text": [f"{level * largest:.2g}" for level in levels],
        },
        "frequency_unit": advise.frequency_unit(rig),
        "curves": [
            {
                "x": floats(x[curve_of == curve]),
                "y": floats(y[curve_of == curve]),
                "frequency": floats(frequency[curve_of == curve]),
            }
            for curve in np.unique(curve_of)
        ],
        "here": [float(found[f"here_{name}"]) for name in over],
        "summary": found.attrs["summary"],
    }


def _map_axis(parameter: xr.DataArray) -> Plain:
    values = parameter.values
    return {
        **name_of(parameter),
        "values": packed(values),
        "ends": [float(values[0]), float(values[-1])],
    }


def _shade(fraction: Array) -> Array:
    """Map growth rates, as fractions of the largest, to shades that are finer near
    zero.
    """
    return np.asarray(np.arcsinh(fraction / 1e-3) / np.arcsinh(1e3))


def advice(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield verdict, numbers, margins and mitigations."""
    seconds = documents.seconds_of(request)
    rig = documents.shortened(documents.rig_asked_for(request), seconds)
    documents.check_size(rig, seconds)
    documents.check_thresholds(rig)
    found = advise.predict(rig, progress=watch)
    # an elastic slider was refused above
    assert isinstance(found, advise.Prediction)
    rows = {section.name: [*section.rows] for section in found.sections}
    yield {
        "name": rig.name,
        "verdict": found.headline,
        "needs_mitigation": found.needs_mitigation,
        "evidence": [
            *rows["here"],
            *rows["speeds"],
            *str(found.regime).splitlines(),
            *rows["doubt"],
        ],
        "numbers": [list(pair) for pair in rows["numbers"]],
        "margins": [list(row) for row in rows["margins"][1:]],
        "mitigations": [
            {"title": found.changed(each), "values": {each.parameter: each.to}}
            for each in found.mitigations
        ],
        "attempts": rows["attempts"],
        "not_searched": " ".join(rows["not_searched"]),
        "assumed": {key: str(item) for key, item in rig.assumed.items()},
    }
