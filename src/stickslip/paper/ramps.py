"""Ramps of the velocity of the drive: run, and drawn with the transitions between smooth sliding and stick-slip."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

import stickslip as ss
from stickslip import plot
from stickslip.model import Start
from stickslip.paper.kit import DASHED, Progress, panel, second_axis

LEVEL = 0.6
"""Peak to peak of the spring force that counts as stick-slip in Figs. 10 and 11, in f_s."""
V1_SCALED, V2_SCALED = (0.34, 0.50), (1.05, 1.25)
"""Bands of v1 and v2 over ``beta^2``."""
_FOUND = ("v1", "v2", "v2_down", "v1_down", "up", "down")
_STRONG = 0.8
"""Spring force, in f_s, that stands as high as the largest velocity."""


def ramped(
    rig: ss.Rig,
    method: ss.Contacts,
    progress: Progress,
    *,
    interval: float = 0.02,
    level: float | None = None,
    start: Start = ss.FromSliding(),
) -> xr.Dataset:
    """Return the force on a ramp, from smooth sliding if nothing else is said, and what `transitions` finds there."""
    run = ss.simulate(rig, method=method, output=ss.Output(interval=interval), start=start, progress=progress)
    found = ss.transitions(run, level=level)
    return run[["spring_force", "drive_velocity"]].assign(found[[name for name in _FOUND if name in found]])


def draw_ramp(
    ax: Axes, run: xr.Dataset, title: str, low: float, top: float, *, left: bool = True, right: bool = True
) -> None:
    """Draw the force on a ramp, and the velocity on a second axis: zero at zero force."""
    plot.force_trace(run[["spring_force"]], ax, color=plot.BLUE)
    ax.lines[0].set_linewidth(0.5)
    panel(ax, title, ylim=(low, top), yticks=[tick for tick in (-0.4, 0.0, 0.4, _STRONG) if tick > low])
    fastest = round(float(run["drive_velocity"].max()))
    limits, ticks = (low * fastest / _STRONG, top * fastest / _STRONG), [0, fastest / 2, fastest]
    second = second_axis(ax, run["time"][::50], run["drive_velocity"][::50], limits, ticks, linewidth=1.6)
    if not left:
        ax.set_ylabel("")
    if right:
        second.set_ylabel(plot.label(run["drive_velocity"], most=24), color=plot.VERMILLION)


def draw_oscillation(ax: Axes, run: xr.Dataset, title: str) -> None:
    """Draw the oscillation of the force on a ramp against the velocity, up and down."""
    ax.plot(run["velocity"], run["up"], color=plot.ORANGE, linewidth=0.9, label="ramp up")
    ax.plot(run["velocity"], run["down"], color=plot.SKY, linewidth=0.9, label="ramp down")
    panel(ax, title, run["velocity"], "peak to peak of $F_d$ ($f_\\mathrm{s}$)")
    ax.set_xlim(0.0, float(run["drive_velocity"].max()))
    ax.set_ylim(0.0)


def _passed(run: xr.Dataset, name: str) -> tuple[float, float]:
    """A velocity that is known by name, of several ramps the first's, and when the ramp passes it, up or down."""
    t, v = run["time"].to_numpy(), run["drive_velocity"].to_numpy()
    if "down" in name:
        t, v = t[::-1], v[::-1]
    velocity, rising = run[name].to_numpy().flat[0], slice(int(np.argmax(v)) + 1)
    return float(velocity), float(np.interp(velocity, v[rising], t[rising]))


def draw_mark(ax: Axes, run: xr.Dataset, name: str, height: float, line: float, side: str = "center") -> None:
    """Mark where a ramp passes a velocity by a dashed line, up to a fraction of the panel, and words above it."""
    velocity, time = _passed(run, name)
    if math.isfinite(time):
        ax.axvline(time, 0.0, line, color=plot.BLACK, linewidth=0.9, linestyle=DASHED)
        symbol = f"v_{name[1]}'" if "down" in name else f"v_{name[1]}"
        ax.text(time, height, f"${symbol}$ = {velocity:.3g}", ha=side, fontsize=8)


def draw_around(ax: Axes, run: xr.Dataset, name: str, before: float, after: float) -> None:
    """Draw the force around the time at which a ramp passes a velocity; nothing where there is none."""
    _, time = _passed(run, name)
    if math.isfinite(time):
        force = run["spring_force"].sel(time=slice(time - before, time + after))
        ax.plot(force["time"], force, color=plot.BLUE, linewidth=0.8)
    ax.margins(x=0)
