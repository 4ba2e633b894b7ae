"""Figure 2: Elastic instability.

A slider on a spring, quasi-statically: forces, effective potential, Eq. (5), and effective stiffness, Eq. (7). The
slider jumps where the friction force decreases more steeply than the spring can follow.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

import stickslip as ss
from stickslip import plot, theory
from stickslip.paper.cases import CRITICAL_STIFFNESS, FIG2, FIG5
from stickslip.paper.figure import Claim, Figure, at_least, at_most, near, weighed
from stickslip.paper.kit import DASHED, Picture, Progress, dataset, panel
from stickslip.rigid import effective_stiffness

STIFF = 5.0
"""Stiffness of a spring that follows the fall of the force, as in Fig. 4."""

_DISTANCE = 2.0
_ONSET = 0.01
"""Fraction of contacts that have broken where, to the eye, the force leaves the straight line."""


def first_instability(interface: ss.Interface, stiffness: float) -> tuple[float, float]:
    """Return positions of slider and drive, in ``x_s``, where first ``K_eff(X) = K``: equality in Eq. (6)."""
    X = np.linspace(0.0, _DISTANCE, 2001)
    above = np.flatnonzero(effective_stiffness(interface, X) > stiffness)
    if above.size == 0:
        raise ss.UndecidedError(f"K_eff stays below K = {stiffness:g} up to X = {_DISTANCE:g}: no elastic instability")
    around = X[above[0] - 1], X[above[0]]
    X_star = float(brentq(lambda x: effective_stiffness(interface, [x])[0] - stiffness, *around, xtol=1e-12))
    run = ss.rigid_slide(interface, X_star, method=ss.model.Renewal(2048))
    return X_star, X_star + float(run["friction_force"][-1]) / stiffness


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    interface, slider = FIG2.interface, FIG2.slider
    run = ss.rigid_slide(interface, _DISTANCE, method=ss.model.Renewal(1000 if quick else 4000))
    progress(0.5)
    X, force, rate = (run[name].to_numpy() for name in ("displacement", "friction_force", "breaking_rate"))
    X_star, drive = first_instability(interface, slider.stiffness)
    onset = np.interp(_ONSET, cumulative_trapezoid(rate, X, initial=0), X)
    begin = onset + np.interp(onset, X, force) / slider.stiffness
    drives = np.array([begin, drive, 2.0 * drive - begin])
    # The slider lands where the line of the spring meets the force again, inertia aside.
    landing = X[(X_star + 1e-3 < X) & (slider.stiffness * (drive - X) < force)][0]
    potential = [theory.effective_potential(slider, X, force, d) for d in drives]
    instability = [(X_star, drive), first_instability(FIG5.interface, slider.stiffness)]
    both = "slider and drive at the elastic instability [x_s]"
    return dataset(
        {
            "friction_force": run["friction_force"],
            "K_eff": (-run["stiffness"], "effective stiffness, per contact [k]"),
            "V_eff": (("drive", "displacement"), potential, "effective potential, per contact [f_s x_s]"),
            "point": ("which", [onset, X_star, landing], "displacement at the points of the figure [x_s]"),
            "instability": (("reattachment", "quantity"), instability, both),
            "K_critical": (ss.critical_stiffness(interface), "critical stiffness, per contact [k]"),
        },
        {
            "drive": (drives, "position of the drive [x_s]"),
            "which": ["contacts start to break", "instability", "landing"],
            "reattachment": ["at once", "never"],
            "quantity": ["slider", "drive"],
        },
        stiffness=slider.stiffness,
    )


def _unstable_from_X_star_on(data: xr.Dataset) -> Claim:
    K, K_eff, critical = float(data.attrs["stiffness"]), data["K_eff"].to_numpy(), float(data["K_critical"])
    never = data["instability"].sel(reattachment="never")
    return weighed(
        None,
        "a spring softer than K* is unstable where K_eff(X) > K, from X* on; a stiffer one never is",
        near("X*, no re-attachment", never.sel(quantity="slider"), 0.9247, 1e-4, "x_s"),
        near("v_d t*, no re-attachment", never.sel(quantity="drive"), 1.2820, 1e-4, "x_s"),
        near("largest K_eff on the curve", K_eff.max(), CRITICAL_STIFFNESS, 0.003, "k"),
        printed=bool(np.any(K_eff > K)) and not np.any(K_eff > STIFF) and STIFF > critical > K,
        evidence=f"first root of K_eff(X) = {K:g} k; K_eff(X) against {STIFF:g} k over 0 to {_DISTANCE:g} x_s",
    )


def _rests_in_a_well(data: xr.Dataset) -> Claim:
    _, unstable, landing = data["point"].to_numpy()
    X, V = data["displacement"].to_numpy(), data["V_eff"].to_numpy()
    near_peak = landing > X  # of the force
    wells = [np.count_nonzero(np.diff(np.sign(np.diff(one[near_peak]))) > 0) for one in V]
    stiffness = float(data.attrs["stiffness"]) - data["K_eff"].to_numpy()
    bend = np.max(np.abs(np.diff(V[1], 2) / (X[1] - X[0]) ** 2 - stiffness[1:-1]))
    return weighed(
        None,
        "the slider rests in a well of V_eff, which bends as K + dF_c/dX and is gone at the instability",
        near("wells of V_eff at point 1", wells[0], 1, 0),
        near("wells this side of the landing, as far after the instability", wells[-1], 0, 0),
        at_most("curvature of V_eff less K + dF_c/dX, largest", bend, 1e-3, "k"),
        at_least("landing less instability", landing - unstable, 0.1, "x_s"),
        evidence="V_eff by Eq. (5) at three positions of the drive, its second differences, and Eq. (6)",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    K, critical = float(data.attrs["stiffness"]), float(data["K_critical"])
    left, right = picture.subplots(1, 2, width_ratios=(1.3, 1.0))
    _draw_potential(left.inset_axes((0.66, 0.64, 0.34, 0.36)), data)
    data = data.sel(displacement=slice(0.0, 1.6))
    X, force, K_eff = data["displacement"], data["friction_force"], data["K_eff"]
    (begin, at, landing), drives = data["point"].to_numpy(), data["drive"].to_numpy()
    left.plot(X, force, color=plot.BLUE)
    left.text(0.33, 0.41, r"$F_\mathrm{c}(X)$", color=plot.BLUE, ha="right")
    for name, point, end, drive, colour, style, offset in (
        ("1", begin, (-0.22, 0.16), drives[0], plot.GREY, "--", (-12, 1)),
        ("2", at, (-0.16, min(0.42, drives[1] - at)), drives[1], plot.VERMILLION, "-", (6, 3)),
    ):
        line = point + np.array(end)
        left.plot(line, K * (drive - line), color=colour, linestyle=style, linewidth=1.0)
        _draw_point(left, name, (point, float(force.interp(displacement=point))), offset, colour)
    left.plot(landing, force.interp(displacement=landing), "o", mfc="white", color=plot.VERMILLION, markersize=5)
    left.text(1.09, 0.43, r"$K(v_\mathrm{d}t^* - X)$", color=plot.VERMILLION)
    panel(left, rf"(a) $K$ = {K:g} $k$", X, force, xlim=(0, 1.6), ylim=(0, 1.1))

    right.plot(X, K_eff, color=plot.BLUE)
    for value, text, colour in (
        (STIFF, rf"$K$ = {STIFF:g} $k$: stiff", plot.GREEN),
        (critical, rf"$K^*$ = {critical:.3f} $k$", plot.BLACK),
        (K, rf"$K$ = {K:g} $k$: soft", plot.VERMILLION),
    ):
        right.axhline(value, color=colour, linewidth=0.9, linestyle=DASHED)
        right.text(0.02, value + 0.08, text, color=colour, fontsize=8)
    right.fill_between(X, K, K_eff, where=K_eff > K, color=plot.VERMILLION, alpha=0.25, linewidth=0)
    _draw_point(right, "2", (at, K), (-9, 3), plot.VERMILLION)
    title = r"(b) $K_\mathrm{eff} = -\mathrm{d}F_\mathrm{c}/\mathrm{d}X$"
    panel(right, title, X, K_eff, xlim=(0, 1.6), ylim=(-1.2, 5.6))


def _draw_point(ax: Axes, name: str, at: tuple[float, float], offset: tuple[float, float], colour: str) -> None:
    ax.plot(*at, "o", color=colour, markersize=5, zorder=3)
    ax.annotate(name, at, xytext=offset, textcoords="offset points", color=colour, fontweight="bold")


def _draw_potential(ax: Axes, data: xr.Dataset) -> None:
    """The effective potential before, at and after the instability, with the slider where it rests."""
    V = data["V_eff"] - data["V_eff"].interp(displacement=float(data["point"][1]))
    near_point = V.sel(displacement=slice(0.55, 1.35))
    names, rests = ("$t < t^*$", "$t^*$", "$t > t^*$"), [*data["point"].values[:2], None]
    for i, (colour, name, at) in enumerate(zip((plot.GREY, plot.VERMILLION, plot.BLACK), names, rests, strict=True)):
        line = near_point[i] - 0.09 * i
        ax.plot(line["displacement"], line, color=colour, linewidth=1.0)
        ax.text(1.38, float(line[-1]), name, color=colour, fontsize=7, va="center")
        if at is not None:
            ax.plot(at, line.interp(displacement=at), "o", color=colour, markersize=4)
    ax.set(xticks=[0.6, 0.9, 1.2], yticks=[], xlim=(0.5, 1.72))
    ax.tick_params(labelsize=7)
    ax.set_xlabel(r"$X$ ($x_\mathrm{s}$)", fontsize=7, labelpad=1)
    ax.set_ylabel(r"$V_\mathrm{eff}$", fontsize=7, labelpad=1)


FIGURE = Figure(__name__, __doc__, 3.3, _data, _drawing, _unstable_from_X_star_on, _rests_in_a_well)
