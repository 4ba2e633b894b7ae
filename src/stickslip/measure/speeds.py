"""Friction against speed, out of a record with a velocity or a displacement."""

import math

import numpy as np
import xarray as xr

from stickslip.errors import InputError
from stickslip.measure.strokes import find_strokes
from stickslip.measure.trace import FEWEST_READINGS, Array, Trace, memory, slope

# Preferred numbers of the series R10 (ISO 3): speeds that lie nearer to one another
# than to the next of these count as one.
_PER_DECADE = 10
_MOST_BLOCKS = 1000
_FEWEST_BLOCKS = 3  # of one speed, for a scatter
LEAST_SPEED = 1e-4  # times the fastest: a slower one is the noise of a sensor at rest


def friction_at_speeds(data: xr.Dataset) -> xr.Dataset:
    """Return friction against speed, out of a record that goes through speeds.

    The record is cut into short blocks; those of one speed, ten to a decade, give its
    friction: the mean of the coefficient where the load is known, of the force
    otherwise. Of strokes to and fro the offset and the reversals are left out.

    Parameters
    ----------
    data : Dataset
        As `stickslip.read_trace` returns it, with a column of the velocity or of the
        displacement.

    Returns
    -------
    Dataset
        Along ``speed``, from slow to fast: `velocity`, `friction`, `error`, the
        standard error of the mean from the scatter of the blocks and their memory, and
        `readings`. Units are those of the record.

    Raises
    ------
    InputError
        If the record has neither of the two, or never moves.

    Examples
    --------
    >>> t = np.arange(0.0, 60.0, 0.01)
    >>> v = np.where(t < 30, 1.0, 10.0)
    >>> data = xr.Dataset(
    ...     {
    ...         "spring_force": ("time", 5 - np.log10(v)),
    ...         "measured_velocity": ("time", v),
    ...     },
    ...     {"time": t},
    ... )
    >>> ss.measure.friction_at_speeds(data)["friction"].values.round(3).tolist()
    [5.0, 4.0]
    """
    trace = Trace.of(data)
    pieces = find_strokes(trace)[0] or [trace]
    size = max(FEWEST_READINGS, trace.t.size // _MOST_BLOCKS)
    found = [_blocks(data, piece, size) for piece in pieces]
    velocity, level = np.concatenate(found, axis=1)
    fastest = float(velocity.max(initial=0.0))
    if not fastest > 0.0:
        raise InputError("friction_at_speeds: the record never moves")
    moves = velocity > LEAST_SPEED * fastest
    bins = np.round(_PER_DECADE * np.log10(velocity[moves] / fastest))
    alike = [np.flatnonzero(moves)[bins == each] for each in np.unique(bins)]
    rows = [
        (
            float(velocity[these].mean()),
            *_mean_and_error(level[these]),
            these.size * size,
        )
        for these in alike
        if these.size >= _FEWEST_BLOCKS
    ]
    friction = data["mu" if "mu" in data else "spring_force"].attrs
    unit = str(friction.get("units", ""))
    name = str(friction.get("long_name", "friction"))
    of_speed = next(
        str(data[key].attrs.get("units", ""))
        for key in ("measured_velocity", "measured_displacement")
        if key in data
    )
    if "measured_velocity" not in data:
        of_speed += f"/{trace.time_unit}"
    about = {
        "velocity": (of_speed, "velocity"),
        "friction": (unit, name),
        "error": (unit, "standard error"),
        "readings": ("1", "readings"),
    }
    columns = np.array(rows).reshape(-1, len(about)).T
    return xr.Dataset(
        {
            key: ("speed", values, {"units": units, "long_name": title})
            for (key, (units, title)), values in zip(
                about.items(), columns, strict=True
            )
        },
        attrs={"source": str(data.attrs.get("source", ""))},
    )


def _blocks(data: xr.Dataset, piece: Trace, size: int) -> Array:
    """Speed and friction in blocks of so many readings of a record, or a stroke."""
    within = data.sel(time=slice(piece.t[0], piece.t[-1]))
    friction = piece.force
    if "mu" in data:
        friction = friction * np.asarray(within["mu"] / within["spring_force"])
    blocks = [slice(k, k + size) for k in range(0, friction.size - size + 1, size)]
    if "measured_velocity" in data:
        values = np.asarray(within["measured_velocity"].values, dtype=float)
        speeds = [abs(float(values[block].mean())) for block in blocks]
    elif (way := piece.displacement) is not None:
        speeds = [abs(slope(way[block], piece.t[block])) for block in blocks]
    else:
        raise InputError(
            "friction_at_speeds: needs a column of the velocity or of the "
            "displacement: name it (velocity= or displacement=)"
        )
    return np.array([speeds, [float(friction[block].mean()) for block in blocks]])


def _mean_and_error(values: Array) -> tuple[float, float]:
    """The mean of blocks, and its standard error by their scatter and memory."""
    mean = float(values.mean())
    r = min(memory(values - mean), 1.0 - 2.0 / values.size)
    independent = values.size * (1.0 - r) / (1.0 + r)
    return mean, float(values.std(ddof=1)) / math.sqrt(independent)
