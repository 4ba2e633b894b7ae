"""Friction against speed, from a record with a velocity or a displacement."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import labelled, units_of
from stickslip.errors import InputError
from stickslip.measure.strokes import find_strokes
from stickslip.measure.trace import FEWEST_READINGS, Array, Trace, independent, slope

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

# Speeds are rounded to ten per decade, as the preferred numbers R10 of ISO 3.
_PER_DECADE = 10
_MOST_BLOCKS = 1000
_FEWEST_BLOCKS = 3  # blocks of one speed that give a scatter
# A speed below this fraction of the highest is the noise of a sensor at rest.
LEAST_SPEED = 1e-4


def friction_at_speeds(data: xr.Dataset) -> xr.Dataset:
    """Return friction against speed, from a record whose speed changes.

    The record is cut into short blocks, which are sorted into ten speeds per decade;
    the blocks of each give its friction: the mean of the coefficient of friction where
    the load is known, of the force otherwise. The offset and the reversals of
    reciprocating strokes are left out.

    Parameters
    ----------
    data : Dataset
        As `stickslip.read_trace` returns it, with a column of the velocity or of the
        displacement.

    Returns
    -------
    Dataset
        Along ``speed``, from slow to fast: `velocity`, `friction`, `error`, the
        standard error of the mean from the scatter of the blocks and their correlation,
        and `readings`. Units are those of the record.

    Raises
    ------
    InputError
        If the record has neither velocity nor displacement, or never moves.

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
    import pandas as pd
    import xarray as xr

    trace = Trace.of(data)
    pieces = find_strokes(trace)[0] or [trace]
    size = max(FEWEST_READINGS, trace.t.size // _MOST_BLOCKS)
    tables = [_blocks(data, piece, size) for piece in pieces]
    blocks = pd.concat(tables, ignore_index=True)
    fastest = blocks["velocity"].max()
    if not fastest > 0.0:
        raise InputError("friction_at_speeds: the record never moves")
    blocks = blocks[blocks["velocity"] > LEAST_SPEED * fastest]
    bins = (_PER_DECADE * np.log10(blocks["velocity"] / fastest)).round()
    found = blocks.groupby(bins).filter(lambda alike: len(alike) >= _FEWEST_BLOCKS)
    alike = found.groupby(bins)
    table = alike.mean().assign(
        error=alike["friction"].apply(_error),
        readings=alike.size() * size,
    )
    friction = data["mu" if "mu" in data else "spring_force"]
    unit = units_of(friction)
    if "measured_velocity" in data:
        of_speed = units_of(data["measured_velocity"])
    else:
        of_speed = f"{units_of(data['measured_displacement'])}/{trace.time_unit}"
    about = {
        "velocity": (of_speed, "velocity"),
        "friction": (unit, str(friction.attrs.get("long_name", "friction"))),
        "error": (unit, "standard error"),
        "readings": ("1", "readings"),
    }
    return xr.Dataset(
        {
            key: labelled(title, "speed", table[key].astype(float), units)
            for key, (units, title) in about.items()
        },
        attrs={"source": str(data.attrs.get("source", ""))},
    )


def _blocks(data: xr.Dataset, piece: Trace, size: int) -> pd.DataFrame:
    """Return the mean speed and friction of each block of readings of a record or a
    stroke.
    """
    import pandas as pd

    within = data.sel(time=slice(piece.t[0], piece.t[-1]))
    friction = piece.force
    if "mu" in data:
        friction = friction * np.asarray(within["mu"] / within["spring_force"])
    count = friction.size // size

    def blocks(values: ArrayLike) -> Array:
        return np.asarray(values, dtype=float)[: count * size].reshape(count, size)

    if "measured_velocity" in data:
        speeds = blocks(within["measured_velocity"]).mean(axis=1)
    elif piece.displacement is not None:
        pairs = zip(blocks(piece.displacement), blocks(piece.t), strict=True)
        speeds = np.array([slope(*pair) for pair in pairs])
    else:
        raise InputError(
            "friction_at_speeds: needs a column of the velocity or of the "
            "displacement: name it (velocity= or displacement=)"
        )
    means = blocks(friction).mean(axis=1)
    return pd.DataFrame({"velocity": np.abs(speeds), "friction": means})


def _error(blocks: pd.Series[float]) -> float:
    """Return the standard error of the mean of blocks, from their scatter and
    correlation.
    """
    worth = independent((blocks - blocks.mean()).to_numpy())
    return float(blocks.std()) / math.sqrt(worth)
