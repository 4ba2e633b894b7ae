"""Figure 10: Critical velocities against the rate of ageing.

Velocities at which stick-slip begins and ends on a ramp, against the rate of ageing, with fits to its square, and the
linear stability limit of smooth sliding.

Without inertia and damping that would be exact: the contacts know only ``v/beta^2``. Each ramp takes the same time in
units of ``beta^-2``. Where smooth sliding regains stability is another matter than ``v2``, at which the oscillation
falls below a level.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

import stickslip as ss
from stickslip import plot
from stickslip.paper.cases import FIG10, aged
from stickslip.paper.figure import Claim, Figure, between, extremes, near, weighed
from stickslip.paper.kit import Picture, Progress, dataset, grid, panel, power, table
from stickslip.paper.ramps import LEVEL, V1_SCALED, V2_SCALED, ramped


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    rates = (0.8, 2.0) if quick else (0.8, 1.0, 1.25, 1.5, 2.0)

    def ends(rate: float, seed: int, progress: Progress) -> xr.Dataset:
        unit = rate**2
        time = (0.6 if quick else 1.0) / unit
        drive = ss.ramp(0.25 * unit, 0.6 * unit, 500.0 * time).then(ss.ramp(0.6 * unit, 1.7 * unit, 250.0 * time))
        method = ss.Contacts(FIG10.contacts, seed=seed)
        run = ramped(aged(FIG10, rate).replace(drive=drive), method, progress, interval=0.02 / unit, level=LEVEL)
        return run[["v1", "v2"]]

    def linear(rate: float) -> float:
        return ss.stability.onset(aged(FIG10, rate), "velocity", between=(0.25 * rate**2, 0.6 * rate**2))

    seen = grid(ends, progress, rate=rates, seed=(1, 2))  # of one ramp v2 scatters by .02 beta^2
    return dataset(dict(seen) | {"v1_linear": table(linear, rate=rates)})


def _squares(data: xr.Dataset) -> Claim:
    rates, square = data["rate"], data["rate"] ** 2
    ramps = f"mean of {data.sizes['seed']} ramps"
    measured = []
    for name, band in (("v1", V1_SCALED), ("v2", V2_SCALED)):
        velocity = data[name].mean("seed", skipna=False)
        measured += [
            *extremes(f"{name}/beta^2, {ramps}", velocity / square, *band),
            between(f"slope of log {name} against log beta", power(rates, velocity), 1.9, 2.15),
        ]
    linear = data["v1_linear"]
    measured += [
        *extremes("v1/beta^2, smooth sliding loses stability (linear)", linear / square, *V1_SCALED),
        near("slope of log v1 (linear) against log beta", power(rates, linear), 2.0, 0.02),
    ]
    return weighed(
        16,
        "v1 and v2 grow as beta^2",
        *measured,
        evidence=f"ramps of {FIG10.contacts} contacts from smooth sliding at {rates.size} rates; stick-slip where "
        f"F_d varies by more than {LEVEL:g}; linear stability. The inertia of the slider, which does not scale, "
        "makes v2 grow a little faster",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    direct, scaled = picture.subplots(1, 2)
    rates = data["rate"]
    fine = np.linspace(0.6, 2.15, 100)
    for name, colour, mark in (("v1", plot.BLUE, "o"), ("v2", plot.VERMILLION, "s")):
        values, each = data[name].mean("seed"), (data[name] / data["rate"] ** 2).transpose("rate", "seed")
        factor = float(each.mean("seed").mean())
        direct.plot(rates, values, mark, color=colour, markersize=5, label=f"$v_{name[1]}$")
        direct.plot(fine, factor * fine**2, color=colour, linewidth=0.9)
        scaled.plot(rates, each, mark, color=colour, markersize=4)
        scaled.axhline(factor, color=colour, linewidth=0.9)
    direct.plot([], [], color=plot.GREY, linewidth=0.9, label=r"$\propto \beta^2$")
    linear = data["v1_linear"]
    direct.plot(rates, linear, "x", color=plot.BLACK, markersize=5, label="smooth sliding loses stability (linear)")
    scaled.plot(rates, linear / rates**2, "x", color=plot.BLACK, markersize=5)
    velocity = plot.label(data["v1"].assign_attrs(long_name="velocity of the drive"))
    panel(direct, "(a)", data["rate"], velocity, "upper left", xlim=(0.6, 2.15), ylim=(0.0, None))
    words = r"$v/\beta^2$ ($x_\mathrm{s}$)"
    panel(scaled, r"(b) in units of $\beta^2$", data["rate"], words, xlim=(0.6, 2.15), ylim=(0.0, 1.5))


FIGURE = Figure(__name__, __doc__, 3.0, _data, _drawing, _squares)
