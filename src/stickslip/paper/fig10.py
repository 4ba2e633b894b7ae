"""Figure 10: the velocities at which stick-slip begins and ends grow as the square of the rate of ageing.

Without inertia and damping that would be exact: the contacts know only ``v/beta^2``. Each ramp starts from smooth
sliding and takes the same time in units of ``beta^-2``. Beside the ramps stands the velocity at which smooth sliding
loses stability, which takes no run. Where it regains stability is another matter than ``v2``: on the way there the
oscillation fades to nothing, and ``v2`` is where it falls below a level.
"""

from __future__ import annotations

import math
from dataclasses import replace

import matplotlib.figure
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip import plot
from stickslip.measure import transitions
from stickslip.model import Contacts, FromSliding, Interface, Langevin, Output, constant
from stickslip.model.drive import ramp
from stickslip.model.rig import Rig
from stickslip.paper.cases import FIG10
from stickslip.paper.figure import Claim, Figure, Progress, between, near, portions, variable, verdict
from stickslip.simulation import simulate
from stickslip.stability import critical

Array = NDArray[np.float64]

_RATES = (0.8, 1.0, 1.25, 1.5, 2.0)
_QUICK = (0.8, 2.0)
_LEVEL = 0.6
"""Peak to peak of the spring force that counts as stick-slip, in f_s."""


def _aged(rate: float) -> Interface:
    return replace(FIG10.interface, ageing=Langevin(rate=rate))


def _ramped(rate: float, seed: int, progress: Progress, *, quick: bool) -> tuple[float, float]:
    """Velocities of onset and end on the way up, in units of ``beta^2``."""
    unit = rate**2
    time = (0.6 if quick else 1.0) / unit
    drive = ramp(0.25 * unit, 0.6 * unit, 500.0 * time).then(ramp(0.6 * unit, 1.7 * unit, 250.0 * time))
    method = Contacts(1_000 if quick else FIG10.contacts, seed=seed)
    output = Output(interval=0.02 / unit)
    run = simulate(
        Rig(_aged(rate), FIG10.slider, drive), method=method, output=output, start=FromSliding(), progress=progress
    )
    seen = transitions(run, level=_LEVEL)
    return float(seen["v1"]) / unit, float(seen["v2"]) / unit


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    rates = np.array(_QUICK if quick else _RATES)
    seeds = (1,) if quick else (1, 2)
    parts = portions(progress, rates.size * len(seeds))
    seen = np.array([[_ramped(rate, seed, next(parts), quick=quick) for seed in seeds] for rate in rates.tolist()])
    onset = np.full(rates.size, np.nan)
    for i, rate in enumerate(rates.tolist()):
        edges = critical(
            Rig(_aged(rate), FIG10.slider, constant(1.0)), "velocity", between=(0.25 * rate**2, 0.6 * rate**2)
        )
        losses = [edge.value for edge in edges if edge.loses_stability]
        onset[i] = losses[0] if losses else np.nan
    square = (rates**2)[:, None]
    return xr.Dataset(
        {
            "v1": variable(("rate", "seed"), seen[:, :, 0] * square, "v1, onset on the way up", "x_s/time"),
            "v2": variable(("rate", "seed"), seen[:, :, 1] * square, "v2, end on the way up", "x_s/time"),
            "v1_linear": variable("rate", onset, "v1: smooth sliding loses stability (linear)", "x_s/time"),
        },
        coords={
            "rate": variable("rate", rates, "rate of ageing β", "1/sqrt(time)"),
            "seed": variable("seed", seeds, "seed", "1"),
        },
    )


def _slope(rates: Array, velocity: Array) -> float:
    if not np.all(np.isfinite(velocity)):  # of a rate at which it was not seen
        return math.nan
    return float(np.polyfit(np.log(rates), np.log(velocity), 1)[0])


def _claims(data: xr.Dataset) -> tuple[Claim, ...]:
    rates = data["rate"].to_numpy()
    square = data["rate"] ** 2
    measured = []
    slopes = []
    for name, low, high in (("v1", 0.34, 0.50), ("v2", 1.05, 1.25)):
        scaled = (data[name] / square).mean("seed", skipna=False)
        smallest, largest = (float(end(skipna=False)) for end in (scaled.min, scaled.max))
        slopes.append(_slope(rates, data[name].mean("seed").to_numpy()))
        measured += [
            between(f"{name}/beta^2, smallest, mean of {data.sizes['seed']} ramps", smallest, low, high),
            between(f"{name}/beta^2, largest, mean of {data.sizes['seed']} ramps", largest, low, high),
            between(f"slope of log {name} against log beta", slopes[-1], 1.9, 2.15),
        ]
    linear = data["v1_linear"] / square
    slope = _slope(rates, data["v1_linear"].to_numpy())
    measured += [
        between("v1/beta^2, smooth sliding loses stability (linear), smallest", float(linear.min()), 0.34, 0.50),
        between("v1/beta^2, smooth sliding loses stability (linear), largest", float(linear.max()), 0.34, 0.50),
        near("slope of log v1 (linear) against log beta", slope, 2.0, 0.02),
    ]
    return (
        Claim(
            number=16,
            statement="v1 and v2 grow as beta^2",
            verdict=verdict(printed=all(1.9 <= s <= 2.15 for s in slopes)),
            settled="reproduced",
            measured=tuple(measured),
            evidence=f"ramps of {FIG10.contacts} contacts from smooth sliding at {rates.size} rates; stick-slip where "
            f"F_d varies by more than {_LEVEL:g}; linear stability. The inertia of the slider, which does not scale, "
            "makes v2 grow a little faster",
        ),
    )


def _drawing(data: xr.Dataset) -> matplotlib.figure.Figure:
    figure = plot.new_figure(plot.PAGE, 3.0)
    direct, scaled = figure.subplots(1, 2)
    rates = data["rate"].to_numpy()
    fine = np.linspace(0.6, 2.15, 100)
    named = {"v1": (plot.BLUE, "o", "$v_1$"), "v2": (plot.VERMILLION, "s", "$v_2$")}
    for name, (colour, mark, text) in named.items():
        values = data[name].mean("seed")
        factor = float((values / data["rate"] ** 2).mean())
        direct.plot(rates, values, mark, color=colour, markersize=5, label=text)
        direct.plot(fine, factor * fine**2, color=colour, linewidth=0.9)
        for ramped in data[name].transpose("seed", "rate").to_numpy():
            scaled.plot(rates, ramped / rates**2, mark, color=colour, markersize=4)
        scaled.axhline(factor, color=colour, linewidth=0.9)
    direct.plot([], [], color=plot.GREY, linewidth=0.9, label=r"$\propto \beta^2$")
    linear = data["v1_linear"]
    direct.plot(rates, linear, "x", color=plot.BLACK, markersize=5, label="smooth sliding loses stability (linear)")
    scaled.plot(rates, linear / rates**2, "x", color=plot.BLACK, markersize=5)
    plot.dress(direct.xaxis, data["rate"])
    direct.set_ylabel(plot.label(data["v1"].assign_attrs(long_name="velocity of the drive")))
    direct.set(xlim=(0.6, 2.15), ylim=(0.0, None))
    direct.legend(loc="upper left")
    plot.letter(direct, "(a)")
    plot.dress(scaled.xaxis, data["rate"])
    scaled.set_ylabel(r"$v/\beta^2$ ($x_\mathrm{s}$)")
    scaled.set(xlim=(0.6, 2.15), ylim=(0.0, 1.5))
    plot.letter(scaled, r"(b) in units of $\beta^2$")
    return figure


FIGURE = Figure(
    name="fig10",
    title="Critical velocities against the rate of ageing",
    caption="Velocities at which stick-slip begins and ends on a ramp, against the rate of ageing, with fits to its "
    "square, and the linear stability limit of smooth sliding.",
    data=_data,
    drawing=_drawing,
    claims=_claims,
)
