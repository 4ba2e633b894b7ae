"""Figure 8: smooth sliding and stick-slip of ageing contacts, against the rate of ageing, from two starts.

Relaxed contacts (short stretchings, thresholds of the stationary distribution) and steady smooth sliding: the upper
edge of the range of stick-slip depends on the start, so both are shown, with N contacts and with the kinetic equation.
Beside them the range in which smooth sliding is linearly unstable.
"""

from __future__ import annotations

import math
from dataclasses import replace

import matplotlib.figure
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip import plot
from stickslip.measure import find_cycles
from stickslip.model import Contacts, FromRest, FromSliding, Langevin, MasterEquation, Method, Output, Start
from stickslip.model.distributions import Gaussian
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.paper.cases import FIG8
from stickslip.paper.figure import Claim, Figure, Progress, at_most, between, near, portions, variable, verdict
from stickslip.simulation import LABELS, simulate
from stickslip.stability import AGEING, critical
from stickslip.theory import ageing_constants

Array = NDArray[np.float64]

_STARTS: dict[str, Start] = {"relaxed": FromRest(), "smooth": FromSliding()}
_METHODS: dict[str, Method] = {"contacts": Contacts(FIG8.contacts, seed=8), "kinetic equation": MasterEquation()}
_QUICK = (0.7, 1.5, 2.0)
_SHOWN = (0.7, 0.9, 1.5, 2.0)
_FULL = (0.6, 0.7, 0.9, 1.0, 1.2, 1.5, 1.8, 2.0, 2.5, 4.0)
_DURATION = {"contacts": 30.0, "kinetic equation": 20.0}
_INTERVAL = 0.005
_BINS = 60
_EDGES = (0.80, 1.63)
"""Rates between which smooth sliding is unstable, as runs from it show."""


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    rates = _QUICK if quick else _FULL
    duration = dict.fromkeys(_METHODS, 12.0) if quick else _DURATION
    parts = portions(progress, len(rates) * len(_STARTS) * len(_METHODS) + 1)
    t = _INTERVAL * np.arange(round(max(duration.values()) / _INTERVAL) + 1)
    force = np.full((len(_METHODS), len(rates), len(_STARTS), t.size), np.nan)
    for i, (name, method) in enumerate(_METHODS.items()):
        for j, rate in enumerate(rates):
            interface = replace(FIG8.interface, ageing=Langevin(rate=rate))
            for k, start in enumerate(_STARTS.values()):
                run = simulate(
                    Rig(interface, FIG8.slider, constant(FIG8.velocity, duration[name])),
                    method=method,
                    output=Output(interval=_INTERVAL),
                    start=start,
                    progress=next(parts),
                )
                force[i, j, k, : run.sizes["time"]] = run["spring_force"]
    times = critical(Rig(FIG8.interface, FIG8.slider, constant(FIG8.velocity)), AGEING, between=(0.2, 3.0))
    edges = [edge.value**-0.5 for edge in times.edges]
    distribution, seen = _at_rest()
    late = np.where(t >= 0.5 * min(duration.values()), force, np.nan)
    return xr.Dataset(
        {
            "spring_force": (("solver", "rate", "start", "time"), force, LABELS["spring_force"]),
            "amplitude": variable(
                ("solver", "rate", "start"),
                np.nanmax(late, axis=-1) - np.nanmin(late, axis=-1),
                "peak to peak of $F_d$",
                "f_s",
            ),
            "unstable": variable(
                "end",
                [min(edges), max(edges)],
                "rates between which smooth sliding is unstable (linear)",
                "1/sqrt(time)",
            ),
            "P_c": variable("f", distribution, "stationary distribution of thresholds, Eq. (17)", "1/f_s"),
            "P_c_seen": variable("f", seen, "the same, of contacts aged at rest", "1/f_s"),
        },
        coords={
            "solver": variable("solver", list(_METHODS), "solver"),
            "rate": variable("rate", rates, "rate of ageing β", "1/sqrt(time)"),
            "start": variable("start", list(_STARTS), "start"),
            "time": ("time", t, LABELS["time"]),
            "end": variable("end", ["low", "high"], "end of the range"),
            "f": variable("f", _thresholds(), "threshold", "f_s"),
        },
    )


def _thresholds() -> Array:
    """Middles of the bins of thresholds."""
    width = 1.0 / _BINS
    return np.asarray(0.5 + width * (np.arange(_BINS) + 0.5))


def _at_rest(count: int = 100_000) -> tuple[Array, Array]:
    """Distribution of thresholds, Eq. (17), and that of contacts aged at rest for ten ``1/rate^2``."""
    from stickslip.kernels.drive import Quadratic
    from stickslip.kernels.langevin_contacts import Contacts, advance_contacts
    from stickslip.kernels.oscillator import RIGID
    from stickslip.kernels.stepping import Course

    ageing = ageing_constants(FIG8.interface)._replace(newborn=0.0)
    contacts = Contacts(np.zeros(count), np.zeros(count), np.full(count, -math.inf))
    time = 1.0 / ageing.rate**2
    course = Course(Quadratic(0.0, 0.0, 0.0, 0.0), RIGID, np.array([10.0 * time]), 0.1 * time, math.inf)
    advance_contacts(np.zeros(4), contacts, course, ageing, np.zeros(1), np.random.default_rng(13))
    counts, edges = np.histogram(contacts.threshold, _BINS, (0.5, 1.5))
    middle = 0.5 * (edges[1:] + edges[:-1])
    exact = Gaussian(mean=ageing.mean, std=ageing.std).density(middle)
    return exact, np.asarray(counts / np.diff(edges) / count)


def _claims(data: xr.Dataset) -> tuple[Claim, ...]:
    return _stationary(data), _window(data)


def _stationary(data: xr.Dataset) -> Claim:
    f, exact, seen = data["f"].to_numpy(), data["P_c"].to_numpy(), data["P_c_seen"].to_numpy()
    width = float(f[1] - f[0])
    mean = float(np.sum(f * seen) * width)
    std = math.sqrt(float(np.sum((f - mean) ** 2 * seen) * width))
    apart = float(np.max(np.abs(np.cumsum(seen - exact)) * width))
    # 1e5 contacts: standard errors of 3e-4, 2e-4 and at most 1.6e-3 (half of 1e5**-.5); Sheppard's bin width**2/12.
    measured = (
        near("mean threshold", mean, 1.0, 1.6e-3, "f_s"),
        near("standard deviation of the thresholds", std, math.sqrt(0.01 + width**2 / 12.0), 1.1e-3, "f_s"),
        at_most("largest distance of the cumulative distributions", apart, 6e-3),
    )
    return Claim(
        number=13,
        statement="the ageing model thresholds is stationary and Gaussian, Eqs. (13)-(17)",
        verdict=verdict(printed=all(m.ok for m in measured)),
        settled="reproduced",
        measured=measured,
        evidence="100000 newborn contacts without strength, ten ageing times at rest",
    )


def _window(data: xr.Dataset) -> Claim:
    oscillation = data["amplitude"]
    low, high = data["unstable"].to_numpy().tolist()
    measured = [
        near("smooth sliding unstable from beta (linear)", low, _EDGES[0], 0.03),
        near("smooth sliding unstable up to beta (linear)", high, _EDGES[1], 0.03),
    ]
    what = "peak to peak F_d at beta ="
    periods = []
    for solver in data["solver"].to_numpy().tolist():

        def seen(rate: float, start: str, name: str = solver) -> float:
            return float(oscillation.sel(solver=name, rate=rate, start=start))

        run = (
            data["spring_force"].sel(solver=solver, rate=1.5, start="relaxed").dropna("time").sel(time=slice(5.0, None))
        )
        measured += [
            at_most(f"{what} 0.7, relaxed, {solver}", seen(0.7, "relaxed"), 0.05, "f_s"),
            at_most(f"{what} 0.7, from smooth sliding, {solver}", seen(0.7, "smooth"), 0.05, "f_s"),
            between(f"{what} 1.5, relaxed, {solver}", seen(1.5, "relaxed"), 1.20, 1.28, "f_s"),
            between(f"{what} 1.5, from smooth sliding, {solver}", seen(1.5, "smooth"), 1.20, 1.28, "f_s"),
            between(f"largest F_d at beta = 1.5, {solver}", float(run.max()), 0.73, 0.77, "f_s"),
            between(f"{what} 2, relaxed, {solver}", seen(2.0, "relaxed"), 1.17, 1.26, "f_s"),
            at_most(f"{what} 2, from smooth sliding, {solver}", seen(2.0, "smooth"), 0.12, "f_s"),
        ]
        periods.append(find_cycles(run["time"].to_numpy(), run.to_numpy()).period)
        if 0.9 in data["rate"]:
            measured.append(between(f"{what} 0.9, relaxed, {solver}", seen(0.9, "relaxed"), 0.36, 0.46, "f_s"))
    measured += [
        between("period at beta = 1.5, contacts", periods[0], 1.95, 2.05, "time"),
        near("the same, kinetic equation over contacts", periods[1] / periods[0], 1.0, 0.03),
    ]
    smooth = oscillation.sel(start="smooth")
    from_smooth = bool(
        (smooth.sel(rate=1.5) > 0.6).all()
        and (smooth.sel(rate=2.0) < 0.12).all()
        and (smooth.sel(rate=0.7) < 0.12).all()
    )
    either = from_smooth and bool((oscillation.sel(rate=2.0, start="relaxed") < 0.12).all())
    return Claim(
        number=14,
        statement="stick-slip for 1 <= beta <= 1.6, smooth sliding below and above",
        verdict=verdict(printed=either, read=from_smooth),
        settled="reproduced under the stated reading",
        reading=f"from steady smooth sliding, which is unstable for beta of {low:.2f} to {high:.2f}; the oscillation "
        "grows gradually from the lower edge on, and from relaxed contacts stick-slip persists up to beta of 3 or more",
        measured=tuple(measured),
        evidence=f"{FIG8.contacts} contacts and the kinetic equation, from both starts; linear stability",
    )


def _drawing(data: xr.Dataset) -> matplotlib.figure.Figure:
    figure = plot.new_figure(plot.PAGE, 5.6)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.25, 1.0), hspace=0.02)
    colours = dict(zip(_SHOWN, (plot.BLUE, plot.SKY, plot.VERMILLION, plot.GREEN), strict=True))
    names = {"relaxed": "(a) from relaxed contacts", "smooth": "(b) from smooth sliding"}
    for row, (start, title) in enumerate(names.items()):
        ax = figure.add_subplot(grid[row, 0])
        for rate, colour in colours.items():
            if rate in data["rate"]:
                force = data["spring_force"].sel(solver="contacts", rate=rate, start=start, time=slice(0.0, 10.0))
                ax.plot(force["time"], force, color=colour, linewidth=0.8, label=rf"$\beta$ = {rate:g}")
        ax.set(ylim=(-0.6, 1.45), xlim=(0.0, 10.0), yticks=(-0.5, 0.0, 0.5, 1.0))
        plot.dress(ax.yaxis, data["spring_force"])
        plot.letter(ax, title)
        ax.legend(loc="upper right", ncols=4, handlelength=1.0, columnspacing=0.8, borderaxespad=0.0)
        ax.tick_params(labelbottom=row == 1)
    distribution = figure.add_subplot(grid[2, 0])
    ax.set_xlabel(plot.label(data["time"]))
    distribution.bar(data["f"], data["P_c_seen"], width=1.0 / _BINS, color=plot.SKY, label="contacts aged at rest")
    distribution.plot(data["f"], data["P_c"], color=plot.BLACK, label="Eq. (17)")
    plot.dress(distribution.xaxis, data["f"])
    distribution.set_ylabel(plot.label(data["P_c"].assign_attrs(long_name="density")))
    distribution.set_xlim(0.15, 1.5)
    distribution.legend(loc="upper left")
    plot.letter(distribution, "(c) thresholds at rest")

    amplitudes = figure.add_subplot(grid[:, 1])
    low, high = data["unstable"].to_numpy().tolist()
    amplitudes.axvspan(low, high, color=plot.GREY, alpha=0.15, linewidth=0)
    amplitudes.text(0.5 * (low + high), 0.04, "smooth\nsliding\nunstable", ha="center", va="bottom", fontsize=8)
    for start, colour in zip(_STARTS, (plot.VERMILLION, plot.BLUE), strict=True):
        for solver, mark in (("contacts", "o"), ("kinetic equation", "x")):
            oscillation = data["amplitude"].sel(start=start, solver=solver)
            line = "-" if solver == "contacts" else "none"
            amplitudes.plot(data["rate"], oscillation, mark, linestyle=line, color=colour, markersize=4, linewidth=0.8)
        amplitudes.plot([], [], color=colour, label=f"from {start} contacts" if start == "relaxed" else "from sliding")
    amplitudes.plot([], [], "o", color=plot.GREY, markersize=4, label="contacts")
    amplitudes.plot([], [], "x", color=plot.GREY, markersize=4, label="kinetic equation")
    amplitudes.set(ylim=(0.0, 1.6), xlim=(0.5, None))
    amplitudes.set_xlabel(plot.label(data["rate"], units="time units$^{-1/2}$"))
    plot.dress(amplitudes.yaxis, data["amplitude"])
    amplitudes.legend(loc="upper right")
    plot.letter(amplitudes, "(d) oscillation of the force")
    return figure


FIGURE = Figure(
    name="fig8",
    title="Stick-slip against the rate of ageing",
    caption="Spring force of ageing contacts at four rates of ageing, from relaxed contacts (a) and from smooth "
    "sliding (b); thresholds of contacts aged at rest beside Eq. (17) (c); peak to peak of the force against "
    "the rate of ageing (d). Grey: smooth sliding is linearly unstable.",
    data=_data,
    drawing=_drawing,
    claims=_claims,
)
