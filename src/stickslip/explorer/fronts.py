"""Runs of an elastic slider for the page Fronts: its force, the motion along the bar,
and an enlarged view of each event.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from stickslip import io, measure
from stickslip.errors import InputError
from stickslip.explorer import documents
from stickslip.explorer.plain import Array, Plain, Watch, axis, in_unit, packed, span
from stickslip.measure import on_blocks, pixels, rows
from stickslip.model import Chain, Contacts, Output
from stickslip.plot import envelope
from stickslip.simulation import simulate

_PATIENCE = 4.0  # longest run, over that of the page Simulate
_MOST_VALUES = 4_000_000  # most values, of all blocks at all times
_PER_BLOCK = 3.0  # samples in the time that sound needs to pass a block
# pixels in time of the whole run, and of an event
_ROWS = 600
_CLOSE = 240
_EVENTS = 12  # number of events with an enlarged view
_FEWEST = 3  # blocks of the smallest event that is listed
_DECADES = 3.0  # decades of velocity shown below the largest


def fronts(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Run a bar; yield its force, its pictures in space and time, and its events with
    extent and speed.
    """
    rig = documents.any_rig_of(request.get("chain"))
    body = rig.slider
    if not isinstance(body, Chain):
        raise InputError(
            "chain: this rig has no bar of blocks; give [chain] in place of [slider]",
            "chain",
        )
    documents.check_count("chain.blocks", "blocks", body.blocks)
    if body.blocks < _FEWEST:
        raise InputError(
            f"chain.blocks = {body.blocks}: must be at least {_FEWEST} for a front to "
            "run"
        )
    if isinstance(rig.method, Contacts):
        documents.check_count(
            "simulation.contacts", "contacts", rig.method.count * body.blocks
        )
    documents.check_decades(rig)
    documents.check_work(rig, _PATIENCE * documents.seconds_of(request))
    duration = rig.drive.duration
    samples = min(_PER_BLOCK * body.sound_speed * duration, _MOST_VALUES / body.blocks)
    run = simulate(
        replace(rig, output=Output(interval=duration / max(samples, 100.0))),
        progress=watch,
    )
    watch(1.0)
    fewest = max(_FEWEST, body.blocks / 10)
    events, along = (
        [row for row in rows(table, name, most=_ROWS) if row["blocks"] >= fewest]
        for table, name in (
            (measure.events(run), "event"),
            (measure.fronts(run), "front"),
        )
    )
    # A bar that does not come to rest again has a front but no event.
    events = events or [{**front, "drop": 0.0} for front in along]
    longest = sorted(
        sorted(events, key=lambda event: -event["blocks"])[:_EVENTS],
        key=lambda event: event["start"],
    )
    sound = rig.natural.slider.sound_speed * rig.unit("1/time")
    fastest = float(np.abs(run["velocity"].values).max()) or 1.0
    times = axis(run["time"])
    force = axis(run["spring_force"])
    yield {
        "name": rig.name,
        "time": times,
        "force": force,
        "speed": {
            "fastest": fastest,
            "decades": _DECADES,
            "unit": run["velocity"].attrs["units"],
        },
        "blocks": body.blocks,
        "whole": _view(run, fastest, times, force, _ROWS),
        "events": [
            {
                "start": event["start"] / times["factor"],
                "drop": event["drop"] / force["factor"],
                "blocks": event["blocks"],
                "from": event["first_block"] + 1,
                "speed": event["front_speed"] / sound
                if math.isfinite(event["front_speed"])
                else None,
                "view": _view(
                    _closer(run, event, sound), fastest, times, force, _CLOSE
                ),
            }
            for event in longest
        ],
        "left_out": len(events) - len(longest),
        "toml": io.to_toml(rig),
    }


def _closer(run: xr.Dataset, event: dict[str, Any], sound: float) -> xr.Dataset:
    """Return the run during an event, from a little before to a little after it, with
    at least four samples.
    """
    lasts = max(event["end"] - event["start"], event["blocks"] / sound)
    first, last = np.searchsorted(
        run["time"], event["start"] + lasts * np.array([-0.3, 1.6])
    ).tolist()
    return run.isel(time=slice(first, max(last, first + 4)))


def _view(
    part: xr.Dataset, fastest: float, times: Plain, force: Plain, most: int
) -> Plain:
    """Return force, velocity of the blocks and attached fraction in a part of a run, in
    the units of the given axes of time and force.
    """
    t, F = envelope(
        in_unit(part["time"], times), in_unit(part["spring_force"], force), 2 * most
    )
    velocity, attached = (
        pixels(on_blocks(part, name, "fronts"), (most, documents.MOST["blocks"]))[0]
        for name in ("velocity", "attached")
    )
    with np.errstate(divide="ignore"):
        shade = 1.0 + np.log10(velocity / fastest) / _DECADES
    return {
        "span": span(part, times),
        "t": packed(t),
        "F": packed(F),
        "rows": velocity.shape[0],
        "velocity": _bytes(shade),
        "attached": _bytes(attached / max(float(attached.max()), 1e-12)),
    }


def _bytes(part: Array) -> Plain:
    """Encode fractions from 0 to 1 at each time in each block as bytes, one line for
    each block.
    """
    bytes_ = np.rint(255.0 * np.clip(np.nan_to_num(part.T, neginf=0.0), 0.0, 1.0))
    return {**packed(bytes_, "u1"), "shape": "{}, {}".format(*bytes_.shape)}
