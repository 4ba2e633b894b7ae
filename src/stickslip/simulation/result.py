"""The Dataset of a run: names, units and descriptions of its variables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Labelled, labelled, labels
from stickslip.kernels.leapfrog import OF_BLOCKS, SUMS
from stickslip.model import ElasticBody, Mass, Sheet, Slider
from stickslip.model.structure import Structure
from stickslip.simulation.driver import Track
from stickslip.simulation.engines import Stretchings
from stickslip.simulation.engines.base import Array

if TYPE_CHECKING:
    import xarray as xr

STATE = "state "
"""Prefix of the columns of an engine that hold the state of a structure."""

LABELS: Mapping[str, Mapping[str, str]] = labels(
    """
time | time | time
displacement | x_s | displacement of the slider
velocity | x_s/time | velocity of the slider
spring_force | f_s | spring force per contact
friction_force | f_s | friction force, per contact
attached | 1 | fraction of attached contacts
load | 1 | normal load, over that at which contacts have their strength
drive_velocity | x_s/time | velocity of the drive
work | f_s x_s | work of the drive, per contact
kinetic_energy | f_s x_s | kinetic energy of the slider, per contact
spring_energy | f_s x_s | energy of the driving spring, per contact
contact_energy | f_s x_s | energy stored in contacts, per contact
damped_energy | f_s x_s | energy dissipated by damping, per contact
broken_energy | f_s x_s | energy lost by the contacts, per contact
breaking_rate | 1/x_s | breaks per contact and x_s
stiffness | k | stiffness dF_c/dX, per contact
stretching_density | 1/x_s | density of stretchings, per contact
bulk_energy | f_s x_s | energy of the springs between blocks, per contact of a block
viscous_energy | f_s x_s | energy dissipated between blocks, per contact of a block
broken | 1 | breaks since the start, per contact
pulling_force | f_s | force of the driving spring of a block, per contact
preload | f_s | force on a block by its springs, with block and drive at 0, per contact
first_break | time | time of the first break
first_break_force | f_s | spring force at the first break
half_detached | time | first time at which half of the contacts are detached
relaxation | f_s | force at the end of the hold less that of sliding, per contact
peak | f_s | largest force after the hold less that of sliding, per contact
slip_to_peak | x_s | displacement from the end of the hold to the peak
sliding_force | f_s | friction force of sliding, per contact
hold | time | time of rest
block | 1 | block
pulled | 1 | block that the drive pulls
x | x_s | stretching
snapshot | time | time of the snapshot
parts | x_s | displacement by each part
state | 1 | state of the structure, in natural units
"""
)
"""Units and names of every variable of a run."""


def with_label(name: str, dims: str | tuple[str, ...], values: ArrayLike) -> Labelled:
    """Return a variable of a run with its units and long name from `LABELS`."""
    return dims, np.asarray(values), dict(LABELS[name])


def dataset_of(
    track: Track,
    slider: Slider | Mass | ElasticBody | Structure,
    bins: int,
    provenance: str,
    marks: Mapping[str, Array] | None = None,
) -> xr.Dataset:
    """Return the Dataset of a run in natural units; `bins` is the number of bins of a
    snapshot, `marks` are variables on the blocks.
    """
    import xarray as xr

    variables: dict[str, Labelled] = {}
    coordinates = {"time": with_label("time", "time", track.times)}
    if isinstance(slider, ElasticBody):
        values = {name: track.rows[:, i] for i, name in enumerate(SUMS)}
        values["drive_velocity"] = track.drive_velocity
        variables = _of_blocks(track, slider, marks or {})
        if "pulling_force" in variables:
            values["spring_force"] = variables["pulling_force"][1].sum(axis=1)
        coordinates |= _places(slider)
    else:
        values = series_of(track, slider)
    variables |= {
        name: with_label(name, "time", values[name])
        for name in LABELS
        if name in values
    }
    if isinstance(slider, Structure):
        states = [name for name in track.columns if name.startswith(STATE)]
        state = np.stack([values[n] for n in states], 1)
        variables["state"] = with_label("state", ("time", "coordinate"), state)
        name, rows = slider.parts
        if name:
            found = with_label("parts", ("time", "mode"), state @ rows.T)
            found[2]["long_name"] = f"displacement by each {name}"
            variables["parts"] = found
    if track.snapshots:
        times, seen = zip(*track.snapshots, strict=True)
        low = min(float(one.stretching.min(initial=0.0)) for one in seen)
        high = max(float(one.stretching.max(initial=0.0)) for one in seen)
        edges = np.linspace(low, max(high, low + 1e-12) * (1 + 1e-12), bins + 1)
        densities = [_density(one, edges) for one in seen]
        variables["stretching_density"] = with_label(
            "stretching_density", ("snapshot", "x"), densities
        )
        coordinates["snapshot"] = with_label("snapshot", "snapshot", times)
        coordinates["x"] = with_label("x", "x", 0.5 * (edges[1:] + edges[:-1]))
    return xr.Dataset(variables, coordinates, {"provenance": provenance})


def series_of(track: Track, slider: Slider | Mass | Structure) -> dict[str, Array]:
    """Return the time series of a run of a rigid slider or a structure, in natural
    units.

    Without a spring the "position" of the drive is its force.
    """
    found = {name: track[name] for name in track.columns}
    if isinstance(slider, Structure):
        return found | {"drive_velocity": track.drive_velocity}
    kinetic_energy = 0.5 * slider.mass * track["velocity"] ** 2
    if isinstance(slider, Mass):
        force = track.drive_position
        return found | {"spring_force": force, "kinetic_energy": kinetic_energy}
    spring_force = slider.stiffness * (track.drive_position - track["displacement"])
    return found | {
        "drive_velocity": track.drive_velocity,
        "spring_force": spring_force,
        "kinetic_energy": kinetic_energy,
        "spring_energy": 0.5 * spring_force**2 / slider.stiffness,
    }


def _of_blocks(
    track: Track, body: ElasticBody, marks: Mapping[str, Array]
) -> dict[str, Labelled]:
    """Return the variables of each block of an elastic slider."""
    fields = track.rows[:, len(SUMS) :].reshape(
        len(track.rows), len(OF_BLOCKS), body.size
    )
    found = {
        name: with_label(name, ("time", "block"), fields[:, i])
        for i, name in enumerate(OF_BLOCKS)
    }
    found |= {name: with_label(name, "block", values) for name, values in marks.items()}
    pulled = np.flatnonzero(body.pulled)
    if pulled.size:
        stretched = track.drive_position[:, None] - found["displacement"][1][:, pulled]
        force = body.pulled[pulled] * stretched + marks["preload"][pulled]
        found["pulling_force"] = with_label("pulling_force", ("time", "pulled"), force)
    for name, per_block in (
        ("displacement", "displacement of a block"),
        ("velocity", "velocity of a block"),
        ("friction_force", "friction force of a block, per contact"),
        ("attached", "fraction of attached contacts of a block"),
    ):
        found[name][2]["long_name"] = per_block
    return found


def _places(body: ElasticBody) -> dict[str, Labelled]:
    """Return the coordinates of the blocks; those of a sheet include row and column."""
    number = np.arange(body.size)
    found = {"block": with_label("block", "block", number)}
    if body.pulled.any():
        found["pulled"] = with_label("pulled", "pulled", np.flatnonzero(body.pulled))
    if isinstance(body, Sheet):
        found["along"] = labelled(
            "place along the drive", "block", number % body.along, "1"
        )
        found["across"] = labelled("row", "block", number // body.along, "1")
    return found


def _density(seen: Stretchings, edges: Array) -> Array:
    """Fraction of contacts per unit stretching in each bin."""
    if not seen.cells:
        counts, _ = np.histogram(seen.stretching, edges, weights=seen.fraction)
        return np.asarray(counts / np.diff(edges))
    if seen.stretching.size == 0:  # no contact is attached
        return np.zeros(edges.size - 1)
    order = np.argsort(seen.stretching)
    x = seen.stretching[order]
    total = np.cumsum(seen.fraction[order])
    between = np.append(0.5 * (x[1:] + x[:-1]), x[-1])
    below = np.interp(edges, np.append(x[0], between), np.append(0.0, total))
    return np.asarray(np.diff(below) / np.diff(edges))
