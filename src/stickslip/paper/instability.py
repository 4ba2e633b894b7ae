"""Figures 2 and 5: the elastic instability of a slider on a soft spring, and the slip that follows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

import stickslip as ss
from stickslip import plot, theory
from stickslip.model import Method
from stickslip.paper.cases import CRITICAL_STIFFNESS, FIG2, FIG5
from stickslip.paper.figure import Claim, Figure, Measured, at_least, at_most, between, near, weighed
from stickslip.paper.kit import Picture, Progress, dataset, grid, panel, portions
from stickslip.plot.style import DASHED
from stickslip.rigid import effective_stiffness

# ---------------------------------------------------------------- figure 2

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


def _data_2(progress: Progress, quick: bool) -> xr.Dataset:
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
    never = list(first_instability(FIG5.interface, slider.stiffness))
    return dataset(
        {
            "friction_force": run["friction_force"],
            "K_eff": (-run["stiffness"], "effective stiffness, per contact [k]"),
            "V_eff": (("drive", "displacement"), potential, "effective potential, per contact [f_s x_s]"),
            "point": ("which", [onset, X_star, landing], "where contacts start to break, instability, landing [x_s]"),
            "never": ("body", never, "slider and drive at the instability, without re-attachment [x_s]"),
            "K_critical": (ss.critical_stiffness(interface), "critical stiffness, per contact [k]"),
        },
        {"drive": (drives, "position of the drive [x_s]")},
        stiffness=slider.stiffness,
    )


def _claims_2(data: xr.Dataset) -> Iterator[Claim]:
    K, K_eff, critical = float(data.attrs["stiffness"]), data["K_eff"].to_numpy(), float(data["K_critical"])
    yield weighed(
        None,
        "a spring softer than K* is unstable where K_eff(X) > K, from X* on; a stiffer one never is",
        near("X*, no re-attachment", data["never"][0], 0.9247, 1e-4, "x_s"),
        near("v_d t*, no re-attachment", data["never"][1], 1.2820, 1e-4, "x_s"),
        near("largest K_eff on the curve", K_eff.max(), CRITICAL_STIFFNESS, 0.003, "k"),
        printed=bool(np.any(K_eff > K)) and not np.any(K_eff > STIFF) and STIFF > critical > K,
        evidence=f"first root of K_eff(X) = {K:g} k; K_eff(X) against {STIFF:g} k over 0 to {_DISTANCE:g} x_s",
    )

    _, unstable, landing = data["point"].to_numpy()
    X, V = data["displacement"].to_numpy(), data["V_eff"].to_numpy()
    wells = np.count_nonzero(np.diff(np.sign(np.diff(V[:, landing > X]))) > 0, axis=1)  # near the peak of the force
    bend = np.diff(V[1], 2) / (X[1] - X[0]) ** 2 - (K - K_eff[1:-1])
    yield weighed(
        None,
        "the slider rests in a well of V_eff, which bends as K + dF_c/dX and is gone at the instability",
        near("wells of V_eff at point 1", wells[0], 1, 0),
        near("wells this side of the landing, as far after the instability", wells[-1], 0, 0),
        at_most("curvature of V_eff less K + dF_c/dX, largest", abs(bend).max(), 1e-3, "k"),
        at_least("landing less instability", landing - unstable, 0.1, "x_s"),
        evidence="V_eff by Eq. (5) at three positions of the drive, its second differences, and Eq. (6)",
    )


def _drawing_2(picture: Picture, data: xr.Dataset) -> None:
    """Elastic instability.

    A slider on a spring, quasi-statically: forces, effective potential, Eq. (5), and effective stiffness, Eq. (7). The
    slider jumps where the friction force decreases more steeply than the spring can follow.
    """
    K, critical, drives = float(data.attrs["stiffness"]), float(data["K_critical"]), data["drive"].to_numpy()
    left, right = picture.subplots(1, 2, width_ratios=(1.3, 1.0))
    _draw_potential(left.inset_axes((0.66, 0.64, 0.34, 0.36)), data)
    data = data.sel(displacement=slice(0.0, 1.6))
    X, force, K_eff = data["displacement"], data["friction_force"], data["K_eff"]
    begin, at, landing = data["point"].to_numpy()
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
    left.text(1.08, 0.49, r"$K(v_\mathrm{d}t^* - X)$", color=plot.VERMILLION)
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
    before, at, _ = data["point"].values
    names = ((plot.GREY, "$t < t^*$", before), (plot.VERMILLION, "$t^*$", at), (plot.BLACK, "$t > t^*$", np.nan))
    for i, (colour, name, rests) in enumerate(names):
        line = V.sel(displacement=slice(0.55, 1.35))[i] - 0.09 * i
        ax.plot(line["displacement"], line, color=colour, linewidth=1.0)
        ax.text(1.38, float(line[-1]), name, color=colour, fontsize=7, va="center")
        ax.plot(rests, np.interp(rests, line["displacement"], line), "o", color=colour, markersize=4)
    ax.set(xticks=[0.6, 0.9, 1.2], yticks=[], xlim=(0.5, 1.72))
    ax.tick_params(labelsize=7)
    ax.set_xlabel(r"$X$ ($x_\mathrm{s}$)", fontsize=7, labelpad=1)
    ax.set_ylabel(r"$V_\mathrm{eff}$", fontsize=7, labelpad=1)


# ---------------------------------------------------------------- figure 5

_TRACES = ["displacement", "velocity", "spring_force", "friction_force"]
_DAMPINGS = {"200": FIG5.slider.damping, "0.3 Omega": 0.3 * FIG5.slider.frequency, "0": 0.0}
"""Of the slider of Fig. 5, of that of Figs. 6 and 7, and none."""
_AROUND = 1.0
"""``Omega dt`` up to which Eq. (12), the first terms of a series in it, can be meant."""


def _data_5(progress: Progress, quick: bool) -> xr.Dataset:
    first, second = portions(progress, 1.0, 3.0)
    X_star, drive = first_instability(FIG5.interface, FIG5.slider.stiffness)
    phase = np.linspace(0.0, 6.0, 121)
    elapsed = phase / FIG5.slider.frequency

    def run(method: Method, damping: float, progress: Progress) -> xr.Dataset:
        rig = FIG5.rig.replace(damping=damping, drive=ss.constant(FIG5.velocity, 1.6))
        output = ss.Output(interval=2e-4 if quick else 5e-5)
        return ss.simulate(rig, method=method, output=output, progress=progress)[_TRACES]

    def slip(damping: str, progress: Progress) -> dict[Any, Any]:
        made = run(ss.MasterEquation(rtol=1e-4 if quick else 1e-5), _DAMPINGS[damping], progress)
        passed = _passes(made, X_star)
        gone = made["displacement"].interp(time=passed + elapsed).to_numpy() - X_star
        velocities = float(made["velocity"].interp(time=passed)), FIG5.velocity
        eq_12 = [theory.slip_displacement(FIG5.slider, velocity, elapsed) for velocity in velocities]
        return dict(made) | {"passed": passed, "slip": ("phase", gone), "eq_12": (("velocity_of", "phase"), eq_12)}

    contacts = run(ss.Contacts(FIG5.contacts if quick else 100 * FIG5.contacts, seed=5), FIG5.slider.damping, first)
    seen = grid(slip, second, damping=_DAMPINGS)
    solvers = xr.concat([seen[_TRACES].sel(damping="200", drop=True), contacts], "solver")
    return dataset(
        dict(solvers)
        | {
            "velocity": (solvers["velocity"], "velocity of the slider [v_d]"),
            "slip": (seen["slip"], "displacement since the instability [x_s]"),
            "eq_12": (seen["eq_12"], "displacement by Eq. (12), the velocity that of slider or drive [x_s]"),
            "passed": (seen["passed"], "time at which the slider passes X* [time]"),
            "X_star": (X_star, "displacement at the quasi-static instability [x_s]"),
            "t_star": (drive / FIG5.velocity, "time of the quasi-static instability [time]"),
        },
        {
            "solver": ["master equation", "contacts"],
            "damping": (list(_DAMPINGS), "damping eta, in v_d/x_s"),
            "phase": (phase, "time since the instability, times Omega [1]"),
            "velocity_of": ["slider", "drive"],
        },
    )


def _passes(run: xr.Dataset, X: float) -> float:
    """Time at which the slider first passes a position."""
    return float(np.interp(X, np.maximum.accumulate(run["displacement"].to_numpy()), run["time"]))


def _claims_5(data: xr.Dataset) -> Iterator[Claim]:
    start = data.sel(phase=slice(0.02, _AROUND))
    ratio = start["slip"] / start["eq_12"]
    errors = abs(ratio.sel(velocity_of="slider") - 1.0).max("phase").to_series()
    factors = ratio.sel(velocity_of="drive").max("phase").to_series()
    measured: list[Measured] = []
    for solver in data["solver"].values:
        run = data.sel(solver=solver)
        surplus = (run["spring_force"] - run["friction_force"]).max()
        measured += [
            near(f"time at which X passes .9247, {solver}", _passes(run, 0.9247), 1.309, 0.004, "time"),
            near(f"largest velocity, {solver}", run["velocity"].max(), 14.4, 0.4, "v_d"),
            near(f"largest F_d - F_c, {solver}", surplus, 0.3155, 0.003, "f_s"),
        ]
    early = "Omega dt <= 1"
    yield weighed(
        8,
        "after the instability the slider moves by v_d dt [1 + (Omega dt)^2/6]",
        near("X*, quasi-static", data["X_star"], 0.9247, 1e-4, "x_s"),
        near("t*, quasi-static", data["t_star"], 1.2820, 1e-4, "time"),
        *measured,
        *(at_most(f"error of Eq. (12), actual velocity, {early}, eta {eta}", x, 0.1) for eta, x in errors.items()),
        *(between(f"slip over Eq. (12) as printed, {early}, eta {eta}", x, 2.0, 3.5) for eta, x in factors.items()),
        printed=bool(factors.max() <= 1.1),
        reading="with the slider's velocity when it passes X*, 2 to 3 v_d, in place of v_d, and for Omega dt <= 1; "
        f"as printed it is too small by a factor {factors.min():.2g} to {factors.max():.2g}",
        evidence="runs with dampings 200, .3 Omega and 0, from the moment when X passes X*",
    )


def _drawing_5(picture: Picture, data: xr.Dataset) -> None:
    """At and after the elastic instability.

    The first slip, with contacts that never re-attach, by contacts and by the master equation, and the displacement
    after the instability beside Eq. (12).
    """
    (forces, position), (velocity, ratio) = picture.subplots(2, 2)
    run = data.sel(solver="master equation", time=slice(0.9, 1.5))
    t, t_star, X_star = run["time"], float(data["t_star"]), float(data["X_star"])
    passed, within = float(data["passed"][0]), {"xlim": (0.9, 1.5)}

    surplus = run["spring_force"] - run["friction_force"]
    forces.plot(t, run["spring_force"], color=plot.BLUE, label=r"$F_\mathrm{d}$")
    forces.plot(t, run["friction_force"], color=plot.VERMILLION, label=r"$F_\mathrm{c}$")
    forces.plot(t, surplus, color=plot.BLACK, label=r"$F_\mathrm{d} - F_\mathrm{c}$")
    panel(forces, "(a)", t, run["spring_force"].assign_attrs(long_name="force per contact"), **within)
    plot.legend_above(forces)

    position.plot(t, run["displacement"], color=plot.GREEN)
    after, (actual, printed) = passed + data["phase"] / FIG5.slider.frequency, X_star + data["eq_12"][0]
    position.plot(after, actual, color=plot.BLACK, linestyle=DASHED, label="Eq. (12), actual velocity")
    position.plot(after, printed, color=plot.ORANGE, linestyle=":", label=r"Eq. (12), $v_\mathrm{d}$, as printed")
    position.plot(passed, X_star, "o", color=plot.GREEN, markersize=4)
    position.annotate("$X^*$", (passed, X_star), xytext=(6, -9), textcoords="offset points")
    panel(position, "(b)", t, data["displacement"], "upper left", **within, ylim=(0.5, 1.7))

    velocity.plot(t, run["velocity"], color=plot.GREEN)
    panel(velocity, "(c)", t, data["velocity"], **within)
    for ax in (forces, position, velocity):
        ax.axvline(t_star, color=plot.GREY, linewidth=0.8, linestyle="--")
    forces.text(t_star - 0.01, 0.45, "$t^*$", ha="right", color=plot.GREY)

    names = (r"$\eta$ = 200", r"$\eta$ = 0.3 $\Omega$", r"$\eta$ = 0")
    late = data.sel(phase=slice(0.02, None))
    slips = (late["slip"] / late["eq_12"]).transpose("damping", "velocity_of", "phase")
    for (actual, printed), colour, name in zip(slips, plot.PALETTE, names, strict=False):
        ratio.plot(late["phase"], actual, color=colour, label=name)
        ratio.plot(late["phase"], printed, color=colour, linestyle="--")
    ratio.axhspan(0.9, 1.1, color=plot.GREY, alpha=0.25, linewidth=0)
    words = "solid: with the actual velocity\n" r"dashed: with $v_\mathrm{d}$, as printed"
    ratio.text(0.08, -0.24, words, fontsize=8, va="bottom", linespacing=1.3)
    x, y = r"$\Omega\,\Delta t$ since the instability", "slip, in terms of Eq. (12)"
    panel(ratio, "(d)", x, y, xlim=(0, 6), ylim=(-0.3, 4))
    plot.legend_above(ratio)


FIGURES = (
    Figure("fig2", 3.3, _data_2, _claims_2, _drawing_2),
    Figure("fig5", 5.4, _data_5, _claims_5, _drawing_5),
)
