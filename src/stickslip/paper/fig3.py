"""Figure 3: Critical stiffness.

Critical stiffness, Eq. (8), against the standard deviation of the thresholds, for several of the initial forces: (a)
broken contacts re-attach at once, (b) they never do. Dotted: the estimate of Eq. (9). Cross: the value that the paper
prints.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

import stickslip as ss
from stickslip import plot, theory
from stickslip.model import Start
from stickslip.paper.cases import CRITICAL_STIFFNESS, CRITICAL_STIFFNESS_NEVER, FIG4, interface
from stickslip.paper.figure import Claim, Figure, at_least, at_most, between, near, weighed
from stickslip.paper.kit import Picture, Progress, dataset, grid, panel, power, table

_PRINTED = 3.59
"""``K*/N`` as the paper prints it, for standard deviations .1 of thresholds and .01 at the start."""
_PAPER = {"initial_std": 0.01, "threshold_std": 0.1}

# Where stick-slip is looked for: threshold standard deviation, delay, start, how long, and whether it is found.
_RUNS: dict[str, tuple[float, float, Start, float, bool]] = {
    "narrow thresholds, narrow start, delay .12": (0.1, 0.12, ss.FromRest(), 120.0, True),
    "narrow thresholds, steady start, delay .12": (0.1, 0.12, ss.FromSliding(perturbation=0.05), 120.0, False),
    "narrow thresholds, narrow start, delay .2": (0.1, 0.2, ss.FromRest(), 120.0, True),
    "narrow thresholds, steady start, delay .2": (0.1, 0.2, ss.FromSliding(perturbation=0.05), 320.0, True),
    "wide thresholds, narrow start, delay .2": (0.3, 0.2, ss.FromRest(), 120.0, False),
}
_EVALUATED = 60.0  # the last so many time units


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    stds = [0.02, 0.025, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, *np.arange(0.1, 0.51, 0.025).round(4).tolist()]
    stds = [0.02, 0.05, 0.1, 0.2, 0.3] if quick else stds
    pairs = {"initial_std": (0.0, 0.01, 0.1, 0.3) if quick else (0.0, 0.01, 0.05, 0.1, 0.2, 0.3), "threshold_std": stds}

    def critical(how: str, initial: float, threshold: float) -> float:
        return ss.critical_stiffness(interface(initial, threshold), reattachment=how == "at once")

    def critical_delay(std: float) -> float:
        rig = FIG4.rig.replace(interface=interface(threshold=std))
        return ss.stability.onset(rig, "delay", between=(1e-3, 1e2))

    def run(name: str, progress: Progress) -> dict[str, Any]:
        std, delay, start, duration, _ = _RUNS[name]
        drive = ss.constant(FIG4.velocity, duration)
        rig = FIG4.rig.replace(interface=interface(threshold=std, delay=ss.Delay(delay)), drive=drive)
        method = ss.MasterEquation(rtol=1e-3 if quick else 1e-4)
        seen = ss.regime(ss.simulate(rig, method=method, start=start, progress=progress), after=duration - _EVALUATED)
        return {"kind": seen.kind, "peak_to_peak": seen.peak_to_peak}

    steady = table(lambda std: ss.critical_stiffness(interface(None, std)), threshold_std=stds)
    estimate = table(lambda *pair: theory.critical_stiffness_estimate(interface(*pair)), **pairs)
    delays = table(critical_delay, std=(0.1, 0.3))
    stiffness = table(critical, reattachment=("at once", "never"), **pairs)
    seen = grid(run, progress, run=_RUNS)
    words = "critical stiffness, per contact [k]"
    return dataset(
        {
            "critical_stiffness": (stiffness, words),
            "critical_stiffness_steady": (steady, "critical stiffness from the steady state, per contact [k]"),
            "critical_stiffness_estimate": (estimate, f"estimate of the {words}"),
            "kind": seen["kind"],
            "peak_to_peak": (seen["peak_to_peak"], "peak to peak of the spring force at the end, per contact [f_s]"),
            "linear_critical_delay": (delays, "delay from which steady sliding is unstable [time]"),
        },
        {
            "threshold_std": (stds, r"standard deviation of thresholds $\Delta f_\mathrm{s}$ [f_s]"),
            "std": ([0.1, 0.3], "standard deviation of thresholds [f_s]"),
        },
    )


def _decreases(data: xr.Dataset) -> Claim:
    K = data["critical_stiffness"].sel(reattachment="at once")
    slope = power([0.02, 0.05], K.sel(initial_std=0.0, threshold_std=[0.02, 0.05]))
    estimate = data["critical_stiffness_estimate"].sel(_PAPER)
    settled = [(0.0, 0.1, 3.009), (0.1, 0.1, 1.828), (0.01, 0.2, 1.033), (0.01, 0.3, 0.438)]
    neighbours = "largest change of K* between neighbouring standard deviations of"
    return weighed(
        5,
        "K* decreases with the standard deviation of the thresholds and of the initial forces; it is largest "
        "for a delta start and zero from the steady state; roughly K* = N k f_s/(Df_s + Df_0)",
        at_most(f"{neighbours} thresholds", K.diff("threshold_std").max(), 0.0, "k"),
        at_most(f"{neighbours} the start", K.diff("initial_std").max(), 0.0, "k"),
        at_most("K* from the steady state", data["critical_stiffness_steady"].max(), 1e-6, "k"),
        near("Eq. (9), Df_0 = .01, Df_s = .1", estimate, 9.09, 0.01, "k"),
        near("power of Df_s in K*, delta start, .02 to .05", slope, -1.0, 0.15),
        *(
            near(f"K*, Df_0 = {i:g}, Df_s = {t:g}", K.sel(initial_std=i, threshold_std=t), value, 0.003, "k")
            for i, t, value in settled
        ),
        printed=bool(abs(estimate / K.sel(_PAPER) - 1.0) < 0.5),
        reading="Eq. (9) gives the scaling of K* for narrow distributions, K* ~ 1/width, not its value, which is three "
        "times too large here; K* decreases throughout for standard deviations of initial forces up to "
        f"{float(K['initial_std'].max()):g}",
        evidence=f"Eq. (8) for {K.size} pairs of standard deviations; K_eff is an integral, no numerical derivative",
    )


def _printed(data: xr.Dataset) -> Claim:
    at_once, never = data["critical_stiffness"].sel(_PAPER).to_numpy().tolist()
    half_a_digit = 0.005
    return weighed(
        6,
        f"K*/N = {_PRINTED} k for Df_s = .1 and Df_0 = .01",
        near("K*, contacts re-attach at once", at_once, CRITICAL_STIFFNESS, 0.003, "k"),
        near("K*, contacts never re-attach", never, CRITICAL_STIFFNESS_NEVER, 0.003, "k"),
        printed=any(abs(K - _PRINTED) <= half_a_digit for K in (at_once, never)),
        exact=f"{CRITICAL_STIFFNESS} k if broken contacts re-attach at once, {CRITICAL_STIFFNESS_NEVER} k if never",
        evidence="largest K_eff by Eq. (8); the figure printed is 1 % off the nearer of the two",
    )


def _avoided(data: xr.Dataset) -> Claim:
    narrow, wide = data["linear_critical_delay"].to_numpy()
    found = dict(zip(_RUNS, data["kind"].to_numpy() == "stick-slip", strict=True))
    measured = []
    for (name, (*_, sticks)), value in zip(_RUNS.items(), data["peak_to_peak"], strict=True):
        bounded, bound = (at_least, 0.5) if sticks else (at_most, 0.02)
        measured.append(bounded(f"peak to peak F_d, {name}", value, bound, "f_s"))
    return weighed(
        18,
        "wide thresholds, or a start in the steady state, avoid stick-slip",
        *measured,
        near("linear critical delay, Df_s = .1", narrow, 0.1455, 0.0002, "time"),
        between("linear critical delay, Df_s = .3", wide, 0.9, 0.96, "time"),
        printed=all(sticks != ("wide" in name or "steady" in name) for name, sticks in found.items()),
        reading=f"a steady start stays smooth while the delay is below the linear critical delay ({narrow:.4f}), "
        "where smooth sliding and stick-slip are both stable; above it any disturbance grows into stick-slip",
        evidence="runs of the master equation at K = 2 k, eta = 200, v_d = 1, evaluated over their last "
        f"{_EVALUATED:g} time units; steady starts perturbed by 5 % in velocity",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    axes = picture.subplots(1, 2, sharey=True)
    std = data["threshold_std"]
    titles = ("(a) broken contacts re-attach at once", "(b) broken contacts never re-attach")
    for ax, K, title, offset in zip(axes, data["critical_stiffness"], titles, ((7, -3), (8, 3)), strict=True):
        for line, colour in zip(K, plot.PALETTE, strict=False):
            ax.plot(std, line, color=colour, label=f"{float(line['initial_std']):g}")
        guess = data["critical_stiffness_estimate"].sel(initial_std=0.01)
        ax.plot(std, guess, color=plot.GREY, linestyle=":", label=r"$1/(\Delta f_\mathrm{s} + 0.01)$, scaling")
        exact = float(K.sel(_PAPER))
        ax.plot(0.1, exact, "o", color=plot.PALETTE[1], markersize=5, label="exact, Figs. 4 to 7")
        ax.plot(0.1, _PRINTED, "x", color=plot.BLACK, markersize=6, label=f"{_PRINTED}, as printed")
        ax.annotate(f"{exact:.3f}", (0.1, exact), xytext=offset, textcoords="offset points", fontsize=8)
        # At .5 the ticks of neighbouring panels would meet.
        panel(ax, title, std, K.assign_attrs(spacing="log"), xlim=(0, 0.5), xticks=[0, 0.1, 0.2, 0.3, 0.4])
        ax.set_ylim(0.03, 40)
        ax.label_outer()
    handles, names = axes[0].get_legend_handles_labels()
    count, initial = data.sizes["initial_std"], rf"$\Delta f_0$ ({plot.unit_text('f_s')})"
    above = {"loc": "upper right", "title_fontsize": 8}
    axes[1].legend(handles[:count], names[:count], title=initial, ncols=2, **above)
    axes[0].legend(handles[count:], names[count:], **above)


FIGURE = Figure(__name__, __doc__, 3.6, _data, _drawing, _decreases, _printed, _avoided)
