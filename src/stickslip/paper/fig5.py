"""Figure 5: At and after the elastic instability.

The first slip, with contacts that never re-attach, by contacts and by the master equation, and the displacement after
the instability beside Eq. (12).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

import stickslip as ss
from stickslip import plot, theory
from stickslip.model import Method
from stickslip.paper.cases import FIG5
from stickslip.paper.fig2 import first_instability
from stickslip.paper.figure import Claim, Figure, Measured, at_most, between, near, weighed
from stickslip.paper.kit import DASHED, Picture, Progress, dataset, grid, panel, portions

_TRACES = ["displacement", "velocity", "spring_force", "friction_force"]
_DAMPINGS = {"200": FIG5.slider.damping, "0.3 Omega": 0.3 * FIG5.slider.frequency, "0": 0.0}
"""Of the slider of Fig. 5, of that of Figs. 6 and 7, and none."""
_AROUND = 1.0
"""``Omega dt`` up to which Eq. (12), the first terms of a series in it, can be meant."""


def _data(progress: Progress, quick: bool) -> xr.Dataset:
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
        velocity = float(made["velocity"].interp(time=passed))
        gone = made["displacement"].interp(time=passed + elapsed).to_numpy() - X_star
        eq_12 = theory.slip_displacement(FIG5.slider, velocity, elapsed)
        return dict(made) | {"passed": passed, "slip": ("phase", gone), "slip_actual": ("phase", eq_12)}

    contacts = run(ss.Contacts(FIG5.contacts if quick else 100 * FIG5.contacts, seed=5), FIG5.slider.damping, first)
    seen = grid(slip, second, damping=_DAMPINGS)
    solvers = xr.concat([seen[_TRACES].sel(damping="200", drop=True), contacts], "solver")
    printed = theory.slip_displacement(FIG5.slider, FIG5.velocity, elapsed)
    by_slider = "displacement by Eq. (12) with the slider's velocity at the instability [x_s]"
    return dataset(
        dict(solvers)
        | {
            "velocity": (solvers["velocity"], "velocity of the slider [v_d]"),
            "slip": (seen["slip"], "displacement since the instability [x_s]"),
            "slip_printed": ("phase", printed, "displacement by Eq. (12) with the drive's velocity [x_s]"),
            "slip_actual": (seen["slip_actual"], by_slider),
            "passed": (seen["passed"], "time at which the slider passes X* [time]"),
            "X_star": (X_star, "displacement at the quasi-static instability [x_s]"),
            "t_star": (drive / FIG5.velocity, "time of the quasi-static instability [time]"),
        },
        {
            "solver": ["master equation", "contacts"],
            "damping": (list(_DAMPINGS), "damping eta, in v_d/x_s"),
            "phase": (phase, "time since the instability, times Omega [1]"),
        },
    )


def _passes(run: xr.Dataset, X: float) -> float:
    """Time at which the slider first passes a position."""
    position, t = run["displacement"].to_numpy(), run["time"].to_numpy()
    i = int(np.argmax(position > X))
    return float(np.interp(X, position[i - 1 : i + 1], t[i - 1 : i + 1]))


def _slip_by_eq_12(data: xr.Dataset) -> Claim:
    near_start = data.sel(phase=slice(0.02, _AROUND))
    errors = abs(near_start["slip"] / near_start["slip_actual"] - 1.0).max("phase").to_numpy()
    factors = (near_start["slip"] / near_start["slip_printed"]).max("phase").to_numpy()
    measured: list[Measured] = []
    for solver in data["solver"].values:
        run = data.sel(solver=solver)
        surplus = (run["spring_force"] - run["friction_force"]).max()
        measured += [
            near(f"time at which X passes .9247, {solver}", _passes(run, 0.9247), 1.309, 0.004, "time"),
            near(f"largest velocity, {solver}", run["velocity"].max(), 14.4, 0.4, "v_d"),
            near(f"largest F_d - F_c, {solver}", surplus, 0.3155, 0.003, "f_s"),
        ]
    actual, printed = "Eq. (12) with the actual velocity, Omega dt <= 1", "slip over Eq. (12) as printed, Omega dt <= 1"
    return weighed(
        8,
        "after the instability the slider moves by v_d dt [1 + (Omega dt)^2/6]",
        near("X*, quasi-static", data["X_star"], 0.9247, 1e-4, "x_s"),
        near("t*, quasi-static", data["t_star"], 1.2820, 1e-4, "time"),
        *measured,
        *(at_most(f"{actual}, eta {eta}: relative error", x, 0.1) for eta, x in zip(_DAMPINGS, errors, strict=True)),
        *(between(f"{printed}, eta {eta}, largest", x, 2.0, 3.5) for eta, x in zip(_DAMPINGS, factors, strict=True)),
        printed=bool(factors.max() <= 1.1),
        reading="with the slider's velocity when it passes X*, 2 to 3 v_d, in place of v_d, and for Omega dt <= 1; "
        f"as printed it is too small by a factor {factors.min():.2g} to {factors.max():.2g}",
        evidence="runs with dampings 200, .3 Omega and 0, from the moment when X passes X*",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
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
    after = passed + data["phase"] / FIG5.slider.frequency
    actual, printed = X_star + data["slip_actual"][0], X_star + data["slip_printed"]
    position.plot(after, actual, color=plot.BLACK, linestyle=DASHED, label="Eq. (12), actual velocity")
    words = r"Eq. (12), $v_\mathrm{d}$, as printed"
    position.plot(after, printed, color=plot.ORANGE, linestyle=":", label=words)
    position.plot(passed, X_star, "o", color=plot.GREEN, markersize=4)
    position.annotate("$X^*$", (passed, X_star), xytext=(6, -9), textcoords="offset points")
    panel(position, "(b)", t, data["displacement"], "upper left", **within, ylim=(0.5, 1.7))

    velocity.plot(t, run["velocity"], color=plot.GREEN)
    panel(velocity, "(c)", t, data["velocity"], **within)
    for ax in (forces, position, velocity):
        ax.axvline(t_star, color=plot.GREY, linewidth=0.8, linestyle="--")
    forces.text(t_star - 0.01, 0.45, "$t^*$", ha="right", color=plot.GREY)

    names = (r"$\eta$ = 200", r"$\eta$ = 0.3 $\Omega$", r"$\eta$ = 0")
    for eta, colour, name in zip(_DAMPINGS, plot.PALETTE, names, strict=False):
        one = data.sel(damping=eta, phase=slice(0.02, None))
        ratio.plot(one["phase"], one["slip"] / one["slip_actual"], color=colour, label=name)
        ratio.plot(one["phase"], one["slip"] / one["slip_printed"], color=colour, linestyle="--")
    ratio.axhspan(0.9, 1.1, color=plot.GREY, alpha=0.25, linewidth=0)
    words = "solid: with the actual velocity\n" r"dashed: with $v_\mathrm{d}$, as printed"
    ratio.text(0.08, -0.24, words, fontsize=8, va="bottom", linespacing=1.3)
    x, y = r"$\Omega\,\Delta t$ since the instability", "slip, in terms of Eq. (12)"
    panel(ratio, "(d)", x, y, xlim=(0, 6), ylim=(-0.3, 4))
    plot.legend_above(ratio)


FIGURE = Figure(__name__, __doc__, 5.4, _data, _drawing, _slip_by_eq_12)
