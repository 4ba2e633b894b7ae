"""Figure 2: the elastic instability of a slider on a spring, quasi-statically.

Forces, effective potential of Eq. (5), condition of Eq. (6), and effective stiffness of Eq. (7).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import matplotlib.axes
import matplotlib.figure
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import brentq

from stickslip import plot
from stickslip.errors import UndecidedError
from stickslip.model import Delay, Interface, Slider
from stickslip.paper.cases import CRITICAL_STIFFNESS, FIG2
from stickslip.paper.figure import Claim, Figure, Progress, at_least, at_most, near, variable, verdict
from stickslip.rigid import Renewal, critical_stiffness, effective_stiffness, rigid_slide
from stickslip.simulation import LABELS
from stickslip.theory import effective_potential

Array = NDArray[np.float64]

STIFF = 5.0
"""Stiffness of a spring that follows the fall of the force, as in Fig. 4."""

_DISTANCE = 2.0
_ONSET = (
    0.01  # fraction of contacts that have broken at the point where, to the eye, the force leaves the straight line
)


@dataclass(frozen=True, kw_only=True)
class Instability:
    """Where a slider pulled quasi-statically becomes unstable: its position, and that of the drive, in ``x_s``."""

    X: float
    drive: float


def first_instability(interface: Interface, stiffness: float) -> Instability:
    """Return the first point where ``K_eff(X) = K``: equality in Eq. (6).

    Raises
    ------
    UndecidedError
        If the effective stiffness stays below that of the spring.
    """
    X = np.linspace(0.0, _DISTANCE, 2001)
    above = np.flatnonzero(effective_stiffness(interface, X) > stiffness)
    if above.size == 0:
        raise UndecidedError(f"K_eff stays below K = {stiffness:g} up to X = {_DISTANCE:g}: no elastic instability")
    i = int(above[0])

    def surplus(x: float) -> float:
        return float(effective_stiffness(interface, [x])[0]) - stiffness

    X_star = float(brentq(surplus, X[i - 1], X[i], xtol=1e-12)) if i else 0.0
    force = rigid_slide(interface, max(X_star, 1e-6), method=Renewal(2048))["friction_force"].to_numpy()[-1]
    return Instability(X=X_star, drive=X_star + float(force) / stiffness)


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    interface, slider = FIG2.interface, FIG2.slider
    run = rigid_slide(interface, _DISTANCE, method=Renewal(1000 if quick else 4000))
    progress(0.5)
    X, force = run["displacement"].to_numpy(), run["friction_force"].to_numpy()
    found = first_instability(interface, slider.stiffness)
    forever = first_instability(replace(interface, delay=Delay(math.inf)), slider.stiffness)
    onset = float(np.interp(_ONSET, _broken(X, run["breaking_rate"].to_numpy()), X))
    drives = np.array(
        [
            onset + float(np.interp(onset, X, force)) / slider.stiffness,
            found.drive,
            2.0 * found.drive - onset - float(np.interp(onset, X, force)) / slider.stiffness,
        ]
    )
    potential = np.array([effective_potential(slider, X, force, d) for d in drives])
    landing = _landing(X, force, found, slider)
    return xr.Dataset(
        {
            "friction_force": run["friction_force"],
            "K_eff": variable("displacement", -run["stiffness"].to_numpy(), "effective stiffness, per contact", "k"),
            "V_eff": variable(("drive", "displacement"), potential, "effective potential, per contact", "f_s x_s"),
            "point": variable("which", [onset, found.X, landing], "displacement at the points of the figure", "x_s"),
            "instability": variable(
                ("reattachment", "quantity"),
                [[found.X, found.drive], [forever.X, forever.drive]],
                "slider and drive at the elastic instability",
                "x_s",
            ),
            "K_critical": variable((), critical_stiffness(interface), "critical stiffness, per contact", "k"),
        },
        coords={
            "displacement": ("displacement", X, LABELS["displacement"]),
            "drive": variable("drive", drives, "position of the drive", "x_s"),
            "which": ("which", ["contacts start to break", "instability", "landing"]),
            "reattachment": variable("reattachment", ["at once", "never"], "when broken contacts re-attach"),
            "quantity": ("quantity", ["slider", "drive"]),
        },
        attrs={"stiffness": slider.stiffness},
    )


def _broken(X: Array, rate: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(X))])


def _landing(X: Array, force: Array, found: Instability, slider: Slider) -> float:
    """Where the line of the spring through the instability meets the force again, inertia aside."""
    surplus = slider.stiffness * (found.drive - X) - force
    beyond = np.flatnonzero((found.X + 1e-3 < X) & (surplus < 0))
    return float(X[beyond[0]]) if beyond.size else math.nan


def _minima(V: Array) -> int:
    """Number of wells of a potential, ends left out."""
    down = np.diff(V) < 0
    return int(np.count_nonzero(down[:-1] & ~down[1:]))


def _claims(data: xr.Dataset) -> tuple[Claim, ...]:
    K = float(data.attrs["stiffness"])
    K_eff, critical = data["K_eff"].to_numpy(), float(data["K_critical"])
    near_peak = data["displacement"].to_numpy() < float(data["point"][2])
    wells = [_minima(V[near_peak]) for V in data["V_eff"].to_numpy()]
    bend = _bend(data)
    never = data["instability"].sel(reattachment="never")
    return (
        Claim(
            number=None,
            statement="a spring softer than K* is unstable where K_eff(X) > K, from X* on; a stiffer one never is",
            verdict=verdict(printed=bool(np.any(K_eff > K)) and not np.any(K_eff > STIFF) and STIFF > critical > K),
            settled="reproduced",
            measured=(
                near("X*, no re-attachment", float(never.sel(quantity="slider")), 0.9247, 1e-4, "x_s"),
                near("v_d t*, no re-attachment", float(never.sel(quantity="drive")), 1.2820, 1e-4, "x_s"),
                near("largest K_eff on the curve", K_eff.max(), CRITICAL_STIFFNESS, 0.003, "k"),
            ),
            evidence=f"first root of K_eff(X) = {K:g} k; K_eff(X) against {STIFF:g} k over 0 to {_DISTANCE:g} x_s",
        ),
        Claim(
            number=None,
            statement="the slider rests in a well of V_eff, which bends as K + dF_c/dX and is gone at the instability",
            verdict=verdict(printed=wells[0] == 1 and wells[-1] == 0 and bend < 1e-3),
            settled="reproduced",
            measured=(
                near("wells of V_eff at point 1", wells[0], 1, 0),
                near("wells this side of the landing, as far after the instability", wells[-1], 0, 0),
                at_most("curvature of V_eff less K + dF_c/dX, largest", bend, 1e-3, "k"),
                at_least("landing less instability", float(data["point"][2] - data["point"][1]), 0.1, "x_s"),
            ),
            evidence="V_eff by Eq. (5) at three positions of the drive, its second differences, and Eq. (6)",
        ),
    )


def _bend(data: xr.Dataset) -> float:
    """Largest distance of the curvature of the potential from what the stiffness of the interface makes it."""
    X, V = data["displacement"].to_numpy(), data["V_eff"].to_numpy()[1]
    second = (V[2:] - 2.0 * V[1:-1] + V[:-2]) / (X[1] - X[0]) ** 2
    return float(np.max(np.abs(second - (float(data.attrs["stiffness"]) - data["K_eff"].to_numpy()[1:-1]))))


def _drawing(data: xr.Dataset) -> matplotlib.figure.Figure:
    K = float(data.attrs["stiffness"])
    figure = plot.new_figure(plot.PAGE, 3.3)
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    X, force = data["displacement"].to_numpy(), data["friction_force"].to_numpy()
    shown = X <= 1.6
    left.plot(X[shown], force[shown], color=plot.BLUE)
    left.text(0.33, 0.41, r"$F_\mathrm{c}(X)$", color=plot.BLUE, ha="right")
    for name, colour, style in (("1", plot.GREY, "--"), ("2", plot.VERMILLION, "-")):
        i = int(name) - 1
        drive, at = float(data["drive"][i]), float(data["point"][i])
        line = np.array([at - 0.16, min(at + 0.42, drive)]) if i else np.array([at - 0.22, at + 0.16])
        left.plot(line, K * (drive - line), color=colour, linestyle=style, linewidth=1.0)
        height = float(np.interp(at, X, force))
        left.plot(at, height, "o", color=colour, markersize=5, zorder=3)
        left.annotate(name, (at, height), xytext=(-12, 1) if i == 0 else (6, 3),
                      textcoords="offset points", color=colour, fontweight="bold")  # fmt: skip
    landing = float(data["point"][2])
    left.plot(landing, np.interp(landing, X, force), "o", markerfacecolor="white", color=plot.VERMILLION, markersize=5)
    left.text(1.09, 0.43, r"$K(v_\mathrm{d}t^* - X)$", color=plot.VERMILLION)
    plot.dress(left.xaxis, data["displacement"])
    plot.dress(left.yaxis, data["friction_force"])
    left.set(xlim=(0, 1.6), ylim=(0, 1.1))
    plot.letter(left, rf"(a) $K$ = {K:g} $k$")
    _draw_potential(left.inset_axes((0.66, 0.64, 0.34, 0.36)), data)

    right.plot(X[shown], data["K_eff"].to_numpy()[shown], color=plot.BLUE)
    for value, text, colour in (
        (STIFF, rf"$K$ = {STIFF:g} $k$: stiff", plot.GREEN),
        (float(data["K_critical"]), rf"$K^*$ = {float(data['K_critical']):.3f} $k$", plot.BLACK),
        (K, rf"$K$ = {K:g} $k$: soft", plot.VERMILLION),
    ):
        right.axhline(value, color=colour, linewidth=0.9, linestyle=(0, (4, 2)))
        right.text(0.02, value + 0.08, text, color=colour, fontsize=8)
    unstable = shown & (data["K_eff"].to_numpy() > K)
    right.fill_between(X, K, data["K_eff"], where=unstable, color=plot.VERMILLION, alpha=0.25, linewidth=0)
    right.plot(float(data["point"][1]), K, "o", color=plot.VERMILLION, markersize=5)
    right.annotate("2", (float(data["point"][1]), K), xytext=(-9, 3), textcoords="offset points",
                   color=plot.VERMILLION, fontweight="bold")  # fmt: skip
    plot.dress(right.xaxis, data["displacement"])
    plot.dress(right.yaxis, data["K_eff"])
    right.set(xlim=(0, 1.6), ylim=(-1.2, 5.6))
    plot.letter(right, r"(b) $K_\mathrm{eff} = -\mathrm{d}F_\mathrm{c}/\mathrm{d}X$")
    return figure


def _draw_potential(ax: matplotlib.axes.Axes, data: xr.Dataset) -> None:
    """The effective potential before, at and after the instability, with the slider where it rests."""
    X = data["displacement"].to_numpy()
    names = ("$t < t^*$", "$t^*$", "$t > t^*$")
    for i, (colour, name) in enumerate(zip((plot.GREY, plot.VERMILLION, plot.BLACK), names, strict=True)):
        V = data["V_eff"].to_numpy()[i]
        V = V - float(np.interp(float(data["point"][1]), X, V)) - 0.09 * i
        near_point = (X > 0.55) & (X < 1.35)
        ax.plot(X[near_point], V[near_point], color=colour, linewidth=1.0)
        ax.text(1.38, V[near_point][-1], name, color=colour, fontsize=7, va="center")
        if i < 2:
            at = float(data["point"][i])
            ax.plot(at, np.interp(at, X, V), "o", color=colour, markersize=4)
    ax.set_yticks([])
    ax.set_xticks([0.6, 0.9, 1.2])
    ax.set_xlim(0.5, 1.72)
    ax.tick_params(labelsize=7)
    ax.set_xlabel(r"$X$ ($x_\mathrm{s}$)", fontsize=7, labelpad=1)
    ax.set_ylabel(r"$V_\mathrm{eff}$", fontsize=7, labelpad=1)


FIGURE = Figure(
    name="fig2",
    title="Elastic instability",
    caption="A slider on a spring, quasi-statically: forces, effective potential (Eq. 5) and effective stiffness (Eq. "
    "7). The slider jumps where the friction force decreases more steeply than the spring can follow.",
    data=_data,
    drawing=_drawing,
    claims=_claims,
)
