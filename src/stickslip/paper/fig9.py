"""Figure 9: Velocity up and down over ageing contacts.

The velocity of the drive (red) goes up and down over ageing contacts (a); the onset of stick-slip (b) and its end on
the way up (c), enlarged; peak to peak of the force on both ramps, with the level that defines v2 and v2' (d).

The ramps are slow where a transition is awaited: stick-slip grows, or decays, over some tens of ``x_s`` of travel.
"""

from __future__ import annotations

import itertools

import numpy as np
import xarray as xr
from matplotlib.ticker import MaxNLocator

import stickslip as ss
from stickslip import plot
from stickslip.paper.cases import FIG9
from stickslip.paper.figure import Claim, Figure, at_least, between, extremes, weighed
from stickslip.paper.kit import Picture, Progress, dataset, panel, portions
from stickslip.paper.ramps import draw_around, draw_mark, draw_oscillation, draw_ramp, ramped

_LEVEL = 0.4
"""Peak to peak of the spring force that counts as stick-slip, in f_s."""
_ENDS = {"v1": (0.75, 1.05), "v2": (2.7, 3.3), "v2_down": (2.7, 3.3), "v1_down": (0.03, 0.09)}
# Up through v1 and v2, and down through both; slowly where the transitions are.
_UP = ss.ramp(0.3, 1.3, 400.0).then(ss.ramp(1.3, 4.0, 150.0))
_DOWN = ss.ramp(4.0, 0.3, 200.0).then(ss.ramp(0.3, 0.1, 100.0)).then(ss.ramp(0.1, 0.012, 1500.0))


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    seeds, count = ((1,), 1_000) if quick else ((1, 2, 3), FIG9.contacts)
    rig, parts = FIG9.rig.replace(drive=_UP.then(_DOWN)), portions(progress, *[1.0] * len(seeds))
    ramps = [ramped(rig, ss.Contacts(count, seed=seed), next(parts), level=_LEVEL) for seed in seeds]
    ends = xr.concat([run[list(_ENDS)] for run in ramps], "seed")
    linear = ss.stability.onset(FIG9.rig, "velocity", between=(0.3, 4.0))
    return dataset({**ramps[0], **ends, "v1_linear": linear}, {"seed": seeds}, count=count)


def _four_transitions(data: xr.Dataset) -> Claim:
    ends = [extremes(name.replace("_down", "'"), data[name], *band, "x_s/time") for name, band in _ENDS.items()]
    return weighed(
        15,
        "two transitions while the velocity rises, to stick-slip at v1 and to smooth sliding at v2, and "
        "two while it falls, at v2' and v1'",
        between("v1, smooth sliding loses stability (linear)", data["v1_linear"], *_ENDS["v1"], "x_s/time"),
        *itertools.chain(*ends),
        at_least("v1 over v1', smallest", (data["v1"] / data["v1_down"]).min(skipna=False), 5.0),
        printed=bool(np.isfinite(data[list(_ENDS)].to_array()).all() and (data["v1_down"] < data["v1"]).all()),
        evidence=f"{data.sizes['seed']} ramps of {data.attrs['count']} contacts from smooth sliding; stick-slip "
        f"where F_d varies by more than {_LEVEL:g}. v2 and v2' depend on that level, for the oscillation fades "
        "gradually; v1 and v1' do not",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    sweep, onset, end, oscillation = picture.subplot_mosaic("aaa;bcd", height_ratios=(1.2, 1.0)).values()
    draw_ramp(sweep, data, r"(a) up and down, $\beta$ = 1.5", -0.6, 1.3)
    # The transitions may be close together: two lines of text, v2 and v2' to either side.
    places = {"v2": (1.14, "right"), "v2_down": (1.14, "left")}
    for name in _ENDS:
        height, side = places.get(name, (1.0, "center"))
        draw_mark(sweep, data, name, height, 0.82, side)
    for ax, name, title, span in ((onset, "v1", "(b) at $v_1$", 24.0), (end, "v2", "(c) at $v_2$", 10.0)):
        draw_around(ax, data, name, 0.6 * span, 0.4 * span)
        ax.xaxis.set_major_locator(MaxNLocator(3, integer=True))
        panel(ax, title, data["time"], data["spring_force"])
    draw_oscillation(oscillation, data, "(d) hysteresis")
    oscillation.axhline(_LEVEL, color=plot.GREY, linewidth=0.8, linestyle="--")
    oscillation.legend()


FIGURE = Figure(__name__, __doc__, 5.4, _data, _drawing, _four_transitions)
