"""Figure 8: Stick-slip against the rate of ageing.

Spring force of ageing contacts at four rates of ageing, from relaxed contacts (a) and from smooth sliding (b);
thresholds of contacts aged at rest beside Eq. (17) (c); peak to peak of the force against the rate of ageing (d).
Grey: smooth sliding is linearly unstable.

The upper edge of the range of stick-slip depends on the start: both are shown. Relaxed contacts have short stretchings,
and thresholds of the stationary distribution.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

import stickslip as ss
from stickslip import plot
from stickslip.model import Method, Start
from stickslip.paper.cases import FIG8, aged
from stickslip.paper.figure import Claim, Figure, at_most, between, near, weighed
from stickslip.paper.kit import Array, Picture, Progress, dataset, grid, panel, shade

_STARTS: dict[str, Start] = {"relaxed": ss.FromRest(), "smooth": ss.FromSliding()}
_METHODS: dict[str, Method] = {"contacts": ss.Contacts(FIG8.contacts, seed=8), "kinetic equation": ss.MasterEquation()}
_SHOWN = {0.7: plot.BLUE, 0.9: plot.SKY, 1.5: plot.VERMILLION, 2.0: plot.GREEN}
_COUNT, _BINS = 100_000, 60  # of thresholds
_EDGES = (0.80, 1.63)
"""Rates between which smooth sliding is unstable, as runs from it show."""


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    rates = (0.7, 1.5, 2.0) if quick else (0.6, 0.7, 0.9, 1.0, 1.2, 1.5, 1.8, 2.0, 2.5, 4.0)
    duration = 12.0 if quick else 30.0

    def run(solver: str, rate: float, start: str, progress: Progress) -> dict[str, Any]:
        rig, output = aged(FIG8, rate).replace(drive=ss.constant(FIG8.velocity, duration)), ss.Output(interval=0.005)
        made = ss.simulate(rig, method=_METHODS[solver], output=output, start=_STARTS[start], progress=progress)
        late = made["spring_force"].sel(time=slice(0.5 * duration, None))
        return {"spring_force": made["spring_force"], "amplitude": late.max() - late.min()}

    seen = grid(run, progress, solver=_METHODS, rate=rates, start=_STARTS)
    edges = [edge.value**-0.5 for edge in ss.critical(FIG8.rig, ss.stability.AGEING, between=(0.2, 3.0)).edges]
    f, distribution, aged_at_rest = _at_rest()
    linear = "rates between which smooth sliding is unstable (linear) [1/sqrt(time)]"
    return dataset(
        {
            "spring_force": seen["spring_force"],
            "amplitude": (seen["amplitude"], "peak to peak of $F_d$ [f_s]"),
            "unstable": ("end", sorted(edges), linear),
            "P_c": ("f", distribution, "stationary distribution of thresholds, Eq. (17) [1/f_s]"),
            "P_c_seen": ("f", aged_at_rest, "the same, of contacts aged at rest [1/f_s]"),
        },
        {"end": ["low", "high"], "f": (f, "threshold [f_s]")},
    )


def _at_rest() -> tuple[Array, Array, Array]:
    """Thresholds; their distribution, Eq. (17); and that of contacts aged at rest by Eq. (13), in small steps."""
    step = 0.01  # of time, in 1/rate^2; the standard deviation comes out too large by a quarter of it
    rng, thresholds = np.random.default_rng(13), np.zeros(_COUNT)
    stationary = FIG8.interface.threshold_distribution
    mean, std = stationary.moment(1), stationary.standard_deviation()
    for _ in range(round(10.0 / step)):
        thresholds += (mean - thresholds) * step + std * math.sqrt(2.0 * step) * rng.standard_normal(_COUNT)
    seen, edges = np.histogram(thresholds, _BINS, (0.5, 1.5), density=True)
    middle = np.asarray(0.5 * (edges[1:] + edges[:-1]))
    return middle, stationary.density(middle), seen


def _stationary(data: xr.Dataset) -> Claim:
    f, exact, seen = data["f"].to_numpy(), data["P_c"].to_numpy(), data["P_c_seen"].to_numpy()
    width = float(f[1] - f[0])
    mean = float(np.sum(f * seen) * width)
    std = math.sqrt(float(np.sum((f - mean) ** 2 * seen) * width))
    apart = float(np.max(np.abs(np.cumsum(seen - exact)) * width))
    # 1e5 contacts: standard errors of 3e-4, 2e-4 and at most 1.6e-3 (half of 1e5**-.5); Sheppard's bin width**2/12.
    return weighed(
        13,
        "the ageing model thresholds is stationary and Gaussian, Eqs. (13)-(17)",
        near("mean threshold", mean, 1.0, 1.6e-3, "f_s"),
        near("standard deviation of the thresholds", std, math.sqrt(0.01 + width**2 / 12.0), 1.1e-3, "f_s"),
        at_most("largest distance of the cumulative distributions", apart, 6e-3),
        evidence="100000 newborn contacts without strength, ten ageing times at rest",
    )


# Rate of ageing, start, and the band of the oscillation there.
_OSCILLATIONS = (
    (0.7, "relaxed", -math.inf, 0.05),
    (0.7, "smooth", -math.inf, 0.05),
    (0.9, "relaxed", 0.36, 0.46),
    (1.5, "relaxed", 1.20, 1.28),
    (1.5, "smooth", 1.20, 1.28),
    (2.0, "relaxed", 1.17, 1.26),
    (2.0, "smooth", -math.inf, 0.12),
)


def _window(data: xr.Dataset) -> Claim:
    oscillation = data["amplitude"]
    low, high = data["unstable"].to_numpy()
    measured = [
        near("smooth sliding unstable from beta (linear)", low, _EDGES[0], 0.03),
        near("smooth sliding unstable up to beta (linear)", high, _EDGES[1], 0.03),
    ]
    periods = []
    for solver in data["solver"].to_numpy().tolist():
        for rate, start, least, most in _OSCILLATIONS:
            if rate in data["rate"]:
                words = f"{'from smooth sliding' if start == 'smooth' else start}, {solver}"
                value = oscillation.sel(solver=solver, rate=rate, start=start)
                measured.append(between(f"peak to peak F_d at beta = {rate:g}, {words}", value, least, most, "f_s"))
        run = data["spring_force"].sel(solver=solver, rate=1.5, start="relaxed", time=slice(5.0, None))
        measured.append(between(f"largest F_d at beta = 1.5, {solver}", run.max(), 0.73, 0.77, "f_s"))
        periods.append(ss.measure.find_cycles(run["time"].to_numpy(), run.to_numpy()).period)
    measured += [
        between("period at beta = 1.5, contacts", periods[0], 1.95, 2.05, "time"),
        near("the same, kinetic equation over contacts", periods[1] / periods[0], 1.0, 0.03),
    ]
    return weighed(
        14,
        "stick-slip for 1 <= beta <= 1.6, smooth sliding below and above",
        *measured,
        printed=bool((oscillation.sel(rate=2.0) < 0.12).all()),  # from either start
        reading=f"from steady smooth sliding, which is unstable for beta of {low:.2f} to {high:.2f}; the oscillation "
        "grows gradually from the lower edge on, and from relaxed contacts stick-slip persists up to beta of 3 or more",
        evidence=f"{FIG8.contacts} contacts and the kinetic equation, from both starts; linear stability",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    axes = picture.subplot_mosaic("ad;bd;cd", width_ratios=(1.25, 1.0), gridspec_kw={"hspace": 0.02})
    titles = {"relaxed": "(a) from relaxed contacts", "smooth": "(b) from smooth sliding"}
    for row, (start, title) in enumerate(titles.items()):
        ax = axes["ab"[row]]
        for rate, colour in _SHOWN.items():
            if rate in data["rate"]:
                force = data["spring_force"].sel(solver="contacts", rate=rate, start=start, time=slice(0.0, 10.0))
                ax.plot(force["time"], force, color=colour, linewidth=0.8, label=rf"$\beta$ = {rate:g}")
        panel(ax, title, data["time"] if row else None, data["spring_force"], ylim=(-0.6, 1.45), xlim=(0.0, 10.0))
        ax.set_yticks((-0.5, 0.0, 0.5, 1.0))
        ax.legend(loc="upper right", ncols=4, handlelength=1.0, columnspacing=0.8, borderaxespad=0.0)
        ax.tick_params(labelbottom=row == 1)
    ax = axes["c"]
    edges = np.linspace(0.5, 1.5, _BINS + 1)
    ax.stairs(data["P_c_seen"], edges, fill=True, color=plot.SKY, label="contacts aged at rest")
    ax.plot(data["f"], data["P_c"], color=plot.BLACK, label="Eq. (17)")
    density = data["P_c"].assign_attrs(long_name="density")
    panel(ax, "(c) thresholds at rest", data["f"], density, "upper left", xlim=(0.15, 1.5))

    ax = axes["d"]
    shade(ax, data["unstable"], "smooth\nsliding\nunstable", 0.04)
    marks = (("contacts", "o", "-"), ("kinetic equation", "x", "none"))
    starts = (("relaxed", plot.VERMILLION, "from relaxed contacts"), ("smooth", plot.BLUE, "from sliding"))
    for start, colour, words in starts:
        for solver, mark, line in marks:
            amplitude = data["amplitude"].sel(start=start, solver=solver)
            ax.plot(data["rate"], amplitude, mark, linestyle=line, color=colour, markersize=4, linewidth=0.8)
        ax.plot([], [], color=colour, label=words)
    for solver, mark, _ in marks:
        ax.plot([], [], mark, color=plot.GREY, markersize=4, label=solver)
    limits = {"xlim": (0.5, None), "ylim": (0.0, 1.6)}
    panel(ax, "(d) oscillation of the force", data["rate"], data["amplitude"], "upper right", **limits)


FIGURE = Figure(__name__, __doc__, 5.6, _data, _drawing, _stationary, _window)
