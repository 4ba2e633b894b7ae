"""The Dataset that a run becomes: names, units and what they mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.model import Slider
from stickslip.simulation.engines import Stretchings
from stickslip.simulation.follow import Track

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Labelled = tuple[str | tuple[str, ...], Array, dict[str, str]]
"""A variable as `xarray.Dataset` takes it: dimensions, values, attributes."""

LABELS: Mapping[str, Mapping[str, str]] = {
    "time": {"units": "time", "long_name": "time"},
    "displacement": {"units": "x_s", "long_name": "displacement of the slider"},
    "velocity": {"units": "x_s/time", "long_name": "velocity of the slider"},
    "spring_force": {"units": "f_s", "long_name": "spring force per contact"},
    "friction_force": {"units": "f_s", "long_name": "friction force, per contact"},
    "attached": {"units": "1", "long_name": "fraction of attached contacts"},
    "drive_velocity": {"units": "x_s/time", "long_name": "velocity of the drive"},
    "work": {"units": "f_s x_s", "long_name": "work of the drive, per contact"},
    "kinetic_energy": {"units": "f_s x_s", "long_name": "kinetic energy of the slider, per contact"},
    "spring_energy": {"units": "f_s x_s", "long_name": "energy of the driving spring, per contact"},
    "contact_energy": {"units": "f_s x_s", "long_name": "energy stored in contacts, per contact"},
    "damped_energy": {"units": "f_s x_s", "long_name": "energy dissipated by damping, per contact"},
    "broken_energy": {"units": "f_s x_s", "long_name": "energy lost by the contacts, per contact"},
    "stretching_density": {"units": "1/x_s", "long_name": "density of stretchings, per contact"},
    "x": {"units": "x_s", "long_name": "stretching"},
    "snapshot": {"units": "time", "long_name": "time of the snapshot"},
}
"""Units and names of every variable of a run."""


def labelled(name: str, dims: str | tuple[str, ...], values: ArrayLike, units: str | None = None) -> Labelled:
    """Return a variable with its units and its long name, for a Dataset.

    Parameters
    ----------
    name : str
        A name in `LABELS`, which knows the rest; with `units`, what to call the variable at length.
    dims : str or tuple of str
    values : array_like
    units : str, optional

    Returns
    -------
    tuple
        Dimensions, values and attributes, as `xarray.Dataset` takes them.

    Examples
    --------
    >>> labelled("attached", "time", [1.0, 0.9])[2]
    {'units': '1', 'long_name': 'fraction of attached contacts'}
    >>> labelled("period of the cycle", "velocity", [1.5], "time")[2]["units"]
    'time'
    """
    attributes = dict(LABELS[name]) if units is None else {"units": units, "long_name": name}
    return dims, np.asarray(values), attributes


def dataset_of(track: Track, slider: Slider, bins: int, provenance: str) -> xr.Dataset:
    """Return the Dataset of a run, in natural units.

    Parameters
    ----------
    track : Track
    slider : Slider
    bins : int
        Of a snapshot.
    provenance : str
    """
    import xarray as xr

    values = {name: track[name] for name in track.columns}
    values["drive_velocity"] = track.drive_velocity
    values["spring_force"] = slider.stiffness * (track.drive_position - values["displacement"])
    values["kinetic_energy"] = 0.5 * slider.mass * values["velocity"] ** 2
    values["spring_energy"] = 0.5 * values["spring_force"] ** 2 / slider.stiffness
    variables = {name: labelled(name, "time", values[name]) for name in LABELS if name in values}
    coordinates = {"time": labelled("time", "time", track.times)}
    if track.snapshots:
        times, seen = zip(*track.snapshots, strict=True)
        edges = _edges(seen, bins)
        densities = [_density(one, edges) for one in seen]
        variables["stretching_density"] = labelled("stretching_density", ("snapshot", "x"), densities)
        coordinates["snapshot"] = labelled("snapshot", "snapshot", times)
        coordinates["x"] = labelled("x", "x", 0.5 * (edges[1:] + edges[:-1]))
    return xr.Dataset(variables, coordinates, {"provenance": provenance})


def _edges(seen: Iterable[Stretchings], bins: int) -> Array:
    low = min(float(one.stretching.min(initial=0.0)) for one in seen)
    high = max(float(one.stretching.max(initial=0.0)) for one in seen)
    return np.linspace(low, max(high, low + 1e-12) * (1 + 1e-12), bins + 1)


def _density(seen: Stretchings, edges: Array) -> Array:
    """Fraction of contacts per unit stretching in each bin."""
    if not seen.cells:
        counts, _ = np.histogram(seen.stretching, edges, weights=seen.fraction)
        return np.asarray(counts / np.diff(edges))
    if seen.stretching.size == 0:  # nothing is attached
        return np.zeros(edges.size - 1)
    order = np.argsort(seen.stretching)
    x, total = seen.stretching[order], np.cumsum(seen.fraction[order])
    between = np.append(0.5 * (x[1:] + x[:-1]), x[-1])
    below = np.interp(edges, np.append(x[0], between), np.append(0.0, total))
    return np.asarray(np.diff(below) / np.diff(edges))
