"""Figure 3: Critical stiffness.

Critical stiffness, Eq. (8), against the standard deviation of the thresholds, for several of the initial forces: (a)
broken contacts re-attach at once, (b) they never do. Dotted: the estimate of Eq. (9). Cross: the value that the paper
prints.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

import stickslip as ss
from stickslip import plot, theory
from stickslip.model import Start
from stickslip.paper.cases import CRITICAL_STIFFNESS, CRITICAL_STIFFNESS_NEVER, FIG4, interface
from stickslip.paper.figure import Claim, Figure, Progress, at_least, at_most, between, near, weighed
from stickslip.paper.kit import Picture, dataset, grid, panel, portions

_PRINTED = 3.59
"""``K*/N`` as the paper prints it, for standard deviations .1 of thresholds and .01 at the start."""
_PAPER = {"initial_std": 0.01, "threshold_std": 0.1}

# Where stick-slip is looked for: threshold standard deviation, delay, start, and how long.
_RUNS: dict[str, tuple[float, float, Start, float]] = {
    "narrow thresholds, narrow start, delay .12": (0.1, 0.12, ss.FromRest(), 120.0),
    "narrow thresholds, steady start, delay .12": (0.1, 0.12, ss.FromSliding(perturbation=0.05), 120.0),
    "narrow thresholds, narrow start, delay .2": (0.1, 0.2, ss.FromRest(), 120.0),
    "narrow thresholds, steady start, delay .2": (0.1, 0.2, ss.FromSliding(perturbation=0.05), 320.0),
    "wide thresholds, narrow start, delay .2": (0.3, 0.2, ss.FromRest(), 120.0),
}
_EVALUATED = 60.0  # the last so many time units


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    stds = [0.02, 0.025, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, *np.arange(0.1, 0.51, 0.025).round(4).tolist()]
    stds = [0.02, 0.05, 0.1, 0.2, 0.3] if quick else stds
    initials = (0.0, 0.01, 0.1, 0.3) if quick else (0.0, 0.01, 0.05, 0.1, 0.2, 0.3)
    reattachment = ["at once", "never"]
    first, second = portions(progress, len(stds), len(_RUNS))

    def stiffness(how: str, initial: float, threshold: float, _: Progress) -> dict[str, float]:
        return {"K": ss.critical_stiffness(interface(initial, threshold), reattachment=how == "at once")}

    def run(name: str, progress: Progress) -> dict[str, Any]:
        std, delay, start, duration = _RUNS[name]
        drive = ss.constant(FIG4.velocity, duration)
        rig = FIG4.rig.replace(interface=interface(threshold=std, delay=ss.Delay(delay)), drive=drive)
        method = ss.MasterEquation(rtol=1e-3 if quick else 1e-4)
        seen = ss.regime(ss.simulate(rig, method=method, start=start, progress=progress), after=duration - _EVALUATED)
        return {"kind": seen.kind, "peak_to_peak": seen.peak_to_peak}

    estimate = [[theory.critical_stiffness_estimate(interface(i, std)) for std in stds] for i in initials]
    steady = [ss.critical_stiffness(interface(None, std)) for std in stds]
    rigs = [FIG4.rig.replace(interface=interface(threshold=std)) for std in (0.1, 0.3)]
    delays = [ss.stability.onset(rig, "delay", between=(1e-3, 1e2)) for rig in rigs]
    K = grid(first, stiffness, reattachment, initials, stds)["K"]
    seen = grid(second, run, list(_RUNS))
    pairs = "initial_std threshold_std"
    stiffness_words = "critical stiffness, per contact [k]"
    from_steady_state = "critical stiffness from the steady state, per contact [k]"
    oscillation = "peak to peak of the spring force at the end, per contact [f_s]"
    return dataset(
        {
            "critical_stiffness": (f"reattachment {pairs}", K, stiffness_words),
            "critical_stiffness_steady": ("threshold_std", steady, from_steady_state),
            "critical_stiffness_estimate": (pairs, estimate, f"estimate of the {stiffness_words}"),
            "kind": ("run", seen["kind"], "regime at the end"),
            "peak_to_peak": ("run", seen["peak_to_peak"], oscillation),
            "linear_critical_delay": ("std", delays, "delay from which steady sliding is unstable [time]"),
        },
        {
            "reattachment": (reattachment, "when broken contacts re-attach"),
            "initial_std": (initials, "standard deviation of initial forces [f_s]"),
            "threshold_std": (stds, r"standard deviation of thresholds $\Delta f_\mathrm{s}$ [f_s]"),
            "run": (list(_RUNS), "run at K = 2 k, eta = 200, v_d = 1"),
            "std": ([0.1, 0.3], "standard deviation of thresholds [f_s]"),
        },
    )


def _decreases(data: xr.Dataset) -> Claim:
    K = data["critical_stiffness"].sel(reattachment="at once")
    with_thresholds = float(K.diff("threshold_std").max())
    with_start = float(K.diff("initial_std").max())
    steady, widest = float(data["critical_stiffness_steady"].max()), float(K["initial_std"].max())
    narrow = K.sel(initial_std=0.0)
    slope = math.log(float(narrow[0]) / float(narrow.sel(threshold_std=0.05))) / math.log(0.02 / 0.05)
    estimate = float(data["critical_stiffness_estimate"].sel(_PAPER))
    settled = [(0.0, 0.1, 3.009), (0.1, 0.1, 1.828), (0.01, 0.2, 1.033), (0.01, 0.3, 0.438)]
    neighbours = "largest change of K* between neighbouring standard deviations of"
    return weighed(
        5,
        "K* decreases with the standard deviation of the thresholds and of the initial forces; it is largest "
        "for a delta start and zero from the steady state; roughly K* = N k f_s/(Df_s + Df_0)",
        at_most(f"{neighbours} thresholds", with_thresholds, 0.0, "k"),
        at_most(f"{neighbours} the start", with_start, 0.0, "k"),
        at_most("K* from the steady state", steady, 1e-6, "k"),
        near("Eq. (9), Df_0 = .01, Df_s = .1", estimate, 9.09, 0.01, "k"),
        near("power of Df_s in K*, delta start, .02 to .05", slope, -1.0, 0.15),
        *(
            near(f"K*, Df_0 = {i:g}, Df_s = {t:g}", K.sel(initial_std=i, threshold_std=t), value, 0.003, "k")
            for i, t, value in settled
        ),
        printed=abs(estimate / float(K.sel(_PAPER)) - 1.0) < 0.5,
        reading="Eq. (9) gives the scaling of K* for narrow distributions, K* ~ 1/width, not its value, which is three "
        f"times too large here; K* decreases throughout for standard deviations of initial forces up to {widest:g}",
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
    kind = dict(zip(_RUNS, data["kind"].to_numpy().tolist(), strict=True))
    reference, steady_short, narrow_long, steady_long, wide = _RUNS
    smooth = (steady_short, wide)
    avoided = all(kind[run] == "smooth sliding" for run in smooth)
    avoided &= kind[reference] == kind[narrow_long] == "stick-slip"
    linear = data["linear_critical_delay"].to_numpy()
    return weighed(
        18,
        "wide thresholds, or a start in the steady state, avoid stick-slip",
        *(
            at_most(f"peak to peak F_d, {run}", value, 0.02, "f_s")
            if run in smooth
            else at_least(f"peak to peak F_d, {run}", value, 0.5, "f_s")
            for run, value in zip(_RUNS, data["peak_to_peak"], strict=True)
        ),
        near("linear critical delay, Df_s = .1", linear[0], 0.1455, 0.0002, "time"),
        between("linear critical delay, Df_s = .3", linear[1], 0.9, 0.96, "time"),
        printed=avoided and kind[steady_long] == "smooth sliding",
        read=avoided,
        reading=f"a steady start stays smooth while the delay is below the linear critical delay ({linear[0]:.4f}), "
        "where smooth sliding and stick-slip are both stable; above it any disturbance grows into stick-slip",
        evidence="runs of the master equation at K = 2 k, eta = 200, v_d = 1, evaluated over their last "
        f"{_EVALUATED:g} time units; steady starts perturbed by 5 % in velocity",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    axes = picture.subplots(1, 2, sharey=True)
    std = data["threshold_std"]
    titles = ("(a) broken contacts re-attach at once", "(b) broken contacts never re-attach")
    for ax, how, title, offset in zip(axes, ("at once", "never"), titles, ((7, -3), (8, 3)), strict=True):
        stiffness = data["critical_stiffness"].sel(reattachment=how)
        for K, colour in zip(stiffness, plot.PALETTE, strict=False):
            ax.plot(std, K, color=colour, label=f"{float(K['initial_std']):g}")
        guess = data["critical_stiffness_estimate"].sel(initial_std=0.01)
        ax.plot(std, guess, color=plot.GREY, linestyle=":", label=r"$1/(\Delta f_\mathrm{s} + 0.01)$, scaling")
        exact = float(stiffness.sel(_PAPER))
        ax.plot(0.1, exact, "o", color=plot.PALETTE[1], markersize=5, label="exact, Figs. 4 to 7")
        ax.plot(0.1, _PRINTED, "x", color=plot.BLACK, markersize=6, label=f"{_PRINTED}, as printed")
        ax.annotate(f"{exact:.3f}", (0.1, exact), xytext=offset, textcoords="offset points", fontsize=8)
        panel(ax, title, std, yscale="log", xlim=(0, 0.5), ylim=(0.03, 40))
        ax.set_xticks([0, 0.1, 0.2, 0.3, 0.4])  # at .5 the ticks of neighbouring panels would meet
    plot.dress(axes[0].yaxis, data["critical_stiffness"])
    axes[0].set_yticks([0.1, 1, 10], ["0.1", "1", "10"])
    handles, names = axes[0].get_legend_handles_labels()
    count, initial = data.sizes["initial_std"], rf"$\Delta f_0$ ({plot.unit_text('f_s')})"
    above = {"loc": "upper right", "title_fontsize": 8}
    axes[1].legend(handles[:count], names[:count], title=initial, ncols=2, **above)
    axes[0].legend(handles[count:], names[count:], **above)


FIGURE = Figure(__name__, __doc__, 3.6, _data, _drawing, _decreases, _printed, _avoided)
