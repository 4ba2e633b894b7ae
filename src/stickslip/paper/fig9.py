"""Figure 9: the velocity of the drive goes up and down over ageing contacts; stick-slip begins and ends, twice.

The ramps start from smooth sliding. They are slow where a transition is awaited: stick-slip grows, or decays, over some
tens of ``x_s`` of travel, and at the lower end of the way down that takes long.
"""

from __future__ import annotations

import matplotlib.figure
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from stickslip import plot
from stickslip.measure import transitions
from stickslip.model import Contacts, FromSliding, Output, constant
from stickslip.model.drive import Drive, ramp
from stickslip.model.rig import Rig
from stickslip.paper.cases import FIG9
from stickslip.paper.figure import Claim, Figure, Progress, at_least, between, portions, variable, verdict
from stickslip.simulation import LABELS, simulate
from stickslip.stability import critical

Array = NDArray[np.float64]

_LEVEL = 0.4
"""Peak to peak of the spring force that counts as stick-slip, in f_s."""
_INTERVAL = 0.02
_NAMES = ("v1", "v2", "v2_down", "v1_down")
_SYMBOLS = {"v1": "v_1", "v2": "v_2", "v2_down": "v_2'", "v1_down": "v_1'"}
_BANDS = {"v1": (0.75, 1.05), "v2": (2.7, 3.3), "v2_down": (2.7, 3.3), "v1_down": (0.03, 0.09)}


def _loop() -> Drive:
    """Up through v1 and v2, and down through both; slowly where the transitions are."""
    up = ramp(0.3, 1.3, 400.0).then(ramp(1.3, 4.0, 150.0))
    down = ramp(4.0, 0.3, 200.0).then(ramp(0.3, 0.1, 100.0)).then(ramp(0.1, 0.012, 1500.0))
    return up.then(down)


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    seeds = (1,) if quick else (1, 2, 3)
    count = 1_000 if quick else FIG9.contacts
    runs = [
        simulate(
            Rig(FIG9.interface, FIG9.slider, _loop()),
            method=Contacts(count, seed=seed),
            output=Output(interval=_INTERVAL),
            start=FromSliding(),
            progress=part,
        )
        for seed, part in zip(seeds, portions(progress, len(seeds)), strict=True)
    ]
    found = [transitions(run, level=_LEVEL) for run in runs]
    edges = critical(Rig(FIG9.interface, FIG9.slider, constant(1.0)), "velocity", between=(0.3, 4.0))
    onset = [edge.value for edge in edges if edge.loses_stability]
    return xr.Dataset(
        {
            "spring_force": ("time", runs[0]["spring_force"].to_numpy(), LABELS["spring_force"]),
            "drive_velocity": ("time", runs[0]["drive_velocity"].to_numpy(), LABELS["drive_velocity"]),
            **{
                name: variable("seed", [float(f[name]) for f in found], f"{name} of the ramp", "x_s/time")
                for name in _NAMES
            },
            "v1_linear": variable(
                (), onset[0] if onset else np.nan, "v1: smooth sliding loses stability (linear)", "x_s/time"
            ),
            "up": variable("v", found[0]["up"].to_numpy(), "peak to peak of $F_d$", "f_s"),
            "down": variable("v", found[0]["down"].to_numpy(), "peak to peak of $F_d$", "f_s"),
        },
        coords={
            "time": ("time", runs[0]["time"].to_numpy(), LABELS["time"]),
            "seed": variable("seed", seeds, "seed", "1"),
            "v": variable("v", found[0]["velocity"].to_numpy(), "velocity of the drive", "x_s/time"),
        },
        attrs={"count": count},
    )


def _claims(data: xr.Dataset) -> tuple[Claim, ...]:
    seen = {name: data[name].to_numpy() for name in _NAMES}
    four = all(bool(np.all(np.isfinite(values))) for values in seen.values())
    measured = [
        between("v1, smooth sliding loses stability (linear)", float(data["v1_linear"]), 0.75, 1.05, "x_s/time")
    ]
    for name, values in seen.items():
        low, high = _BANDS[name]
        for which, value in (("smallest", values.min()), ("largest", values.max())):
            measured.append(between(f"{_SYMBOLS[name].replace('_', '')}, {which}", value, low, high, "x_s/time"))
    measured.append(at_least("v1 over v1', smallest", float(np.min(seen["v1"] / seen["v1_down"])), 5.0))
    return (
        Claim(
            number=15,
            statement="two transitions while the velocity rises, to stick-slip at v1 and to smooth sliding at v2, and "
            "two while it falls, at v2' and v1'",
            verdict=verdict(printed=four and bool(np.all(seen["v1_down"] < seen["v1"]))),
            settled="reproduced",
            measured=tuple(measured),
            evidence=f"{data.sizes['seed']} ramps of {data.attrs['count']} contacts from smooth sliding; stick-slip "
            f"where F_d varies by more than {_LEVEL:g}. v2 and v2' depend on that level, for the oscillation fades "
            "gradually; v1 and v1' do not",
        ),
    )


def _drawing(data: xr.Dataset) -> matplotlib.figure.Figure:
    figure = plot.new_figure(plot.PAGE, 5.4)
    grid = figure.add_gridspec(2, 3, height_ratios=(1.2, 1.0))
    sweep = figure.add_subplot(grid[0, :])
    plot.force_trace(data[["spring_force"]], sweep, color=plot.BLUE)
    sweep.lines[0].set_linewidth(0.5)
    sweep.set_ylim(-0.6, 1.3)
    sweep.set_yticks([-0.4, 0.0, 0.4, 0.8])
    second = sweep.twinx()
    second.spines["right"].set_visible(True)
    second.plot(data["time"][::50], data["drive_velocity"][::50], color=plot.VERMILLION, linewidth=1.6)
    second.set_ylim(-0.6 * 5.0, 1.3 * 5.0)
    second.set_yticks([0, 2, 4])
    second.tick_params(axis="y", colors=plot.VERMILLION)
    second.set_ylabel(plot.label(data["drive_velocity"], most=24), color=plot.VERMILLION)
    for name in _NAMES:
        v = float(data[name][0])
        if np.isfinite(v):
            at = _time_of(data, v, down=name.endswith("down"))
            sweep.axvline(at, 0.0, 0.82, color=plot.BLACK, linewidth=0.9, linestyle=(0, (4, 2)))
            # The transitions may be close together: two lines of text, v2 and v2' to either side.
            height, side = {"v2": (1.14, "right"), "v2_down": (1.14, "left")}.get(name, (1.0, "center"))
            sweep.text(at, height, f"${_SYMBOLS[name]}$ = {v:.3g}", ha=side, fontsize=8)
    plot.letter(sweep, r"(a) up and down, $\beta$ = 1.5")
    _draw_inset(figure.add_subplot(grid[1, 0]), data, float(data["v1"][0]), "(b) at $v_1$", 24.0)
    _draw_inset(figure.add_subplot(grid[1, 1]), data, float(data["v2"][0]), "(c) at $v_2$", 10.0)
    oscillation = figure.add_subplot(grid[1, 2])
    oscillation.plot(data["v"], data["up"], color=plot.ORANGE, label="up")
    oscillation.plot(data["v"], data["down"], color=plot.SKY, label="down")
    oscillation.axhline(_LEVEL, color=plot.GREY, linewidth=0.8, linestyle="--")
    oscillation.set(xlim=(0.0, 4.0), ylim=(0.0, None))
    plot.dress(oscillation.xaxis, data["v"])
    oscillation.set_ylabel("peak to peak of $F_d$ ($f_\\mathrm{s}$)")
    oscillation.legend()
    plot.letter(oscillation, "(d) hysteresis")
    return figure


def _time_of(data: xr.Dataset, velocity: float, *, down: bool) -> float:
    t, v = data["time"].to_numpy(), data["drive_velocity"].to_numpy()
    top = int(np.argmax(v))
    if down:
        return float(np.interp(-velocity, -v[top:], t[top:]))
    return float(np.interp(velocity, v[: top + 1], t[: top + 1]))


def _draw_inset(ax: Axes, data: xr.Dataset, velocity: float, title: str, span: float) -> None:
    if np.isfinite(velocity):
        at = _time_of(data, velocity, down=False)
        near_by = data["spring_force"].sel(time=slice(at - 0.6 * span, at + 0.4 * span))
        ax.plot(near_by["time"], near_by, color=plot.BLUE, linewidth=0.8)
    ax.margins(x=0)
    ax.xaxis.set_major_locator(MaxNLocator(3, integer=True))
    plot.dress(ax.xaxis, data["time"])
    plot.dress(ax.yaxis, data["spring_force"])
    plot.letter(ax, title)


FIGURE = Figure(
    name="fig9",
    title="Velocity up and down over ageing contacts",
    caption="The velocity of the drive (red) goes up and down over ageing contacts (a); the onset of stick-slip (b) "
    "and its end on the way up (c), enlarged; peak to peak of the force on both ramps, with the level that "
    "defines v2 and v2' (d).",
    data=_data,
    drawing=_drawing,
    claims=_claims,
)
