"""Figure 9: Velocity up and down over ageing contacts.

The velocity of the drive (red) goes up and down over ageing contacts (a); the onset of stick-slip (b) and its end on
the way up (c), enlarged; peak to peak of the force on both ramps, with the level that defines v2 and v2' (d).

The ramps start from smooth sliding. They are slow where a transition is awaited: stick-slip grows, or decays, over some
tens of ``x_s`` of travel, and at the lower end of the way down that takes long.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.ticker import MaxNLocator

import stickslip as ss
from stickslip import plot
from stickslip.paper.cases import FIG9
from stickslip.paper.figure import Claim, Progress, at_least, between, extremes, figure, weighed
from stickslip.paper.kit import Picture, dataset, panel, portions
from stickslip.paper.ramps import draw_around, draw_mark, draw_ramp, loses_stability, ramped, time_of

_LEVEL = 0.4
"""Peak to peak of the spring force that counts as stick-slip, in f_s."""
_SYMBOLS = {"v1": "v_1", "v2": "v_2", "v2_down": "v_2'", "v1_down": "v_1'"}
_BANDS = {"v1": (0.75, 1.05), "v2": (2.7, 3.3), "v2_down": (2.7, 3.3), "v1_down": (0.03, 0.09)}


def _loop() -> ss.model.Drive:
    """Up through v1 and v2, and down through both; slowly where the transitions are."""
    up = ss.ramp(0.3, 1.3, 400.0).then(ss.ramp(1.3, 4.0, 150.0))
    down = ss.ramp(4.0, 0.3, 200.0).then(ss.ramp(0.3, 0.1, 100.0)).then(ss.ramp(0.1, 0.012, 1500.0))
    return up.then(down)


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    seeds = (1,) if quick else (1, 2, 3)
    count = 1_000 if quick else FIG9.contacts
    rig = FIG9.rig.replace(drive=_loop())
    parts = portions(progress, *[1.0] * len(seeds))
    ramps = [ramped(rig, ss.Contacts(count, seed=seed), next(parts), level=_LEVEL) for seed in seeds]
    run, seen = ramps[0]
    ends = {
        name: ("seed", [float(each[name]) for _, each in ramps], f"{name} of the ramp [x_s/time]") for name in _BANDS
    }
    linear = loses_stability(FIG9.rig, 0.3, 4.0)
    return dataset(
        {
            "spring_force": ("time", run["spring_force"]),
            "drive_velocity": ("time", run["drive_velocity"]),
            **ends,
            "v1_linear": ("", linear, "v1: smooth sliding loses stability (linear) [x_s/time]"),
            "up": ("v", seen["up"], "peak to peak of $F_d$ [f_s]"),
            "down": ("v", seen["down"], "peak to peak of $F_d$ [f_s]"),
        },
        {
            "time": (run["time"],),
            "seed": (seeds, "seed [1]"),
            "v": (seen["velocity"], "velocity of the drive [x_s/time]"),
        },
        count=count,
    )


def _four_transitions(data: xr.Dataset) -> Claim:
    seen = {name: data[name].to_numpy() for name in _BANDS}
    four = all(bool(np.all(np.isfinite(values))) for values in seen.values())
    linear = between("v1, smooth sliding loses stability (linear)", data["v1_linear"], 0.75, 1.05, "x_s/time")
    ends = [
        measured
        for name, values in seen.items()
        for measured in extremes(_SYMBOLS[name].replace("_", ""), values, *_BANDS[name], "x_s/time")
    ]
    return weighed(
        15,
        "two transitions while the velocity rises, to stick-slip at v1 and to smooth sliding at v2, and "
        "two while it falls, at v2' and v1'",
        linear,
        *ends,
        at_least("v1 over v1', smallest", np.min(seen["v1"] / seen["v1_down"]), 5.0),
        printed=four and bool(np.all(seen["v1_down"] < seen["v1"])),
        evidence=f"{data.sizes['seed']} ramps of {data.attrs['count']} contacts from smooth sliding; stick-slip "
        f"where F_d varies by more than {_LEVEL:g}. v2 and v2' depend on that level, for the oscillation fades "
        "gradually; v1 and v1' do not",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    grid = picture.add_gridspec(2, 3, height_ratios=(1.2, 1.0))
    sweep = picture.add_subplot(grid[0, :])
    draw_ramp(sweep, data, r"(a) up and down, $\beta$ = 1.5", -0.6, 1.3)
    # The transitions may be close together: two lines of text, v2 and v2' to either side.
    places = {"v2": (1.14, "right"), "v2_down": (1.14, "left")}
    for name, symbol in _SYMBOLS.items():
        v = float(data[name][0])
        if np.isfinite(v):
            height, side = places.get(name, (1.0, "center"))
            at = time_of(data, v, down=name.endswith("down"))
            draw_mark(sweep, at, f"${symbol}$ = {v:.3g}", height, 0.82, side)
    for column, (name, title, span) in enumerate((("v1", "(b) at $v_1$", 24.0), ("v2", "(c) at $v_2$", 10.0))):
        ax = picture.add_subplot(grid[1, column])
        draw_around(ax, data, time_of(data, float(data[name][0])), 0.6 * span, 0.4 * span)
        ax.xaxis.set_major_locator(MaxNLocator(3, integer=True))
        panel(ax, title, data["time"], data["spring_force"])
    oscillation = picture.add_subplot(grid[1, 2])
    oscillation.plot(data["v"], data["up"], color=plot.ORANGE, label="up")
    oscillation.plot(data["v"], data["down"], color=plot.SKY, label="down")
    oscillation.axhline(_LEVEL, color=plot.GREY, linewidth=0.8, linestyle="--")
    words = "peak to peak of $F_d$ ($f_\\mathrm{s}$)"
    panel(oscillation, "(d) hysteresis", data["v"], words, "best", xlim=(0.0, 4.0), ylim=(0.0, None))


FIGURE = figure(__name__, __doc__, 5.4, _data, _drawing, _four_transitions)
