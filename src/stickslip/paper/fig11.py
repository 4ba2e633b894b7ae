"""Figure 11: friction and effective stiffness of ageing contacts against the velocity.

The paper does not define ``K_eff(v)``. Here all contacts are newborn at the start, the slider is pulled rigidly at a
constant velocity, and ``K_eff`` is the steepest decrease of the force, ``max(-dF/dX)``. Lives at constant velocity are
alike, so the force follows from a renewal equation (`stickslip.kernels.langevin_steady.pull_newborns`), and N contacts
in small exact steps check it. A slope taken over a finite distance is smaller, by its square: over .065 x_s the values
are 3.21, 2.22 and .91 (at v = .1, .3, .5), which another study of the model found.
"""

from __future__ import annotations

import matplotlib.figure
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import optimize

from stickslip import plot
from stickslip.kernels.drive import Quadratic
from stickslip.kernels.langevin_contacts import Contacts as Sampled
from stickslip.kernels.langevin_contacts import advance_contacts
from stickslip.kernels.langevin_steady import pull_newborns
from stickslip.kernels.oscillator import RIGID
from stickslip.kernels.stepping import Course
from stickslip.measure import transitions
from stickslip.model import Contacts, FromSliding, Output, constant
from stickslip.model.drive import ramp
from stickslip.model.rig import Rig
from stickslip.paper.cases import FIG11
from stickslip.paper.figure import Claim, Figure, Progress, at_most, between, near, portions, variable, verdict
from stickslip.simulation import LABELS, simulate
from stickslip.stability import critical
from stickslip.theory import ageing_constants

Array = NDArray[np.float64]

_KNOWN = (0.1, 0.3, 0.5, 0.8)
_CONVERGED = (3.309, 2.260, 0.9205, 0.1122)
"""Velocities, and the slopes there, converged in the grid of gaps, of ages and of the way."""
_SMOOTHED = (3.21, 2.22, 0.91)
_WAY = 0.065
_DISTANCE, _SPACING = 1.6, 0.0025
_SLOW, _FAST, _EACH_WAY = 0.05, 1.8, 200.0
_LEVEL = 0.6
"""Peak to peak of the spring force that counts as stick-slip, in f_s."""


def _pulled(velocity: float) -> tuple[Array, Array]:
    """Force of contacts that are all newborn at ``X = 0``, on positions of a slider of constant velocity."""
    points = round(_DISTANCE / _SPACING)
    return pull_newborns(velocity, ageing_constants(FIG11.interface), _DISTANCE, points)


def _pulled_contacts(velocity: float, count: int, positions: Array) -> Array:
    """Return the same from so many contacts."""
    ageing = ageing_constants(FIG11.interface)
    contacts = Sampled(np.zeros(count), np.zeros(count), np.full(count, -np.inf))
    drive = Quadratic(0.0, 0.0, velocity, 0.0)
    course = Course(drive, RIGID, positions / velocity, 0.02 / ageing.rate**2, np.inf)
    samples = advance_contacts(np.zeros(4), contacts, course, ageing, np.zeros(1), np.random.default_rng(11))
    return np.asarray(samples[:, 3])


def _steepest(X: Array, force: Array, way: float) -> float:
    """Steepest decrease of the force, taken over a displacement."""
    span = max(round(way / (X[1] - X[0])), 2)
    return float(np.max(force[:-span] - force[span:]) / (X[span] - X[0]))


def _stiffness(velocity: float) -> float:
    return _steepest(*_pulled(velocity), 0.0)


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    velocities = np.array(_KNOWN) if quick else np.round(np.arange(0.05, 1.21, 0.05), 2)
    count = 4_000 if quick else 100_000
    parts = portions(progress, 2)
    first, second = next(parts), next(parts)
    curves = [_pulled(v) for v in velocities.tolist()]
    crossing = optimize.brentq(lambda v: _stiffness(v) - FIG11.slider.stiffness, 0.3, 0.8, xtol=1e-5)
    X = curves[0][0]
    coarse = slice(19, None, 20)
    checked = []
    for i, v in enumerate(_KNOWN):
        checked.append(_pulled_contacts(v, count, X[coarse]))
        first((i + 1) / len(_KNOWN))
    run = simulate(
        Rig(FIG11.interface, FIG11.slider, ramp(_SLOW, _FAST, _EACH_WAY)),
        method=Contacts(FIG11.contacts, seed=11),
        output=Output(interval=0.02),
        start=FromSliding(),
        progress=second,
    )
    seen = transitions(run, level=_LEVEL)
    linear = [
        edge.value
        for edge in critical(Rig(FIG11.interface, FIG11.slider, constant(1.0)), "velocity", between=(0.25, 2.0)).edges
    ]
    return xr.Dataset(
        {
            "spring_force": ("time", run["spring_force"].to_numpy(), LABELS["spring_force"]),
            "drive_velocity": ("time", run["drive_velocity"].to_numpy(), LABELS["drive_velocity"]),
            "friction_force": variable(
                ("velocity", "displacement"),
                [force for _, force in curves],
                "force of newborn contacts, per contact",
                "f_s",
            ),
            "F_contacts": variable(("checked", "X_checked"), checked, "force of newborn contacts, per contact", "f_s"),
            "K_eff": variable(
                "velocity", [_steepest(X, force, 0.0) for _, force in curves], "effective stiffness per contact", "k"
            ),
            "K_eff_smoothed": variable(
                "velocity",
                [_steepest(X, force, _WAY) for _, force in curves],
                f"effective stiffness per contact, over {_WAY:g} x_s",
                "k",
            ),
            "crossing": variable((), crossing, "velocity at which K_eff = K", "x_s/time"),
            "v1_ramp": variable((), float(seen["v1"]), "onset on the ramp", "x_s/time"),
            "v2_ramp": variable((), float(seen["v2"]), "end on the ramp", "x_s/time"),
            "unstable": variable("end", linear[:2], "where smooth sliding is unstable (linear)", "x_s/time"),
        },
        coords={
            "velocity": variable("velocity", velocities, "velocity", "x_s/time"),
            "displacement": variable("displacement", X, "displacement of the slider", "x_s"),
            "checked": variable("checked", _KNOWN, "velocity", "x_s/time"),
            "X_checked": variable("X_checked", X[coarse], "displacement of the slider", "x_s"),
            "time": ("time", run["time"].to_numpy(), LABELS["time"]),
            "end": variable("end", ["low", "high"], "end of the range"),
        },
        attrs={"count": count},
    )


def _claims(data: xr.Dataset) -> tuple[Claim, ...]:
    crossing, v1, v2 = (float(data[name]) for name in ("crossing", "v1_ramp", "v2_ramp"))
    low, high = data["unstable"].to_numpy().tolist()
    there = data.sel(velocity=list(_KNOWN))
    falls = float(np.max(np.diff(data["K_eff"].to_numpy())))
    exact = [
        near(f"K_eff at v = {v:g}", float(there["K_eff"].sel(velocity=v)), known, 0.005 * known, "k")
        for v, known in zip(_KNOWN, _CONVERGED, strict=True)
    ]
    smoothed = [
        near(f"K_eff over {_WAY:g} x_s at v = {v:g}", float(there["K_eff_smoothed"].sel(velocity=v)), known, 0.01, "k")
        for v, known in zip(_KNOWN, _SMOOTHED, strict=False)
    ]
    apart = float(
        abs(there["friction_force"].interp(displacement=data["X_checked"]).to_numpy() - data["F_contacts"]).max()
    )
    return (
        Claim(
            number=17,
            statement="K_eff falls with the velocity and crosses K at the second transition, to smooth sliding",
            verdict=verdict(printed=falls < 0 and abs(crossing - v2) < 0.2 * v2),
            settled="not reproduced",
            exact=f"K_eff falls, but crosses K = {FIG11.slider.stiffness:g} at v = {crossing:.3f}, where stick-slip "
            f"begins; it ends at v = {v2:.2f}",
            measured=(
                *exact,
                *smoothed,
                at_most("K_eff, largest change from one velocity to the next", falls, 0.0, "k"),
                # A contact's stretching scatters by less than .5; the solvers differ by .002.
                at_most(
                    "force of newborn contacts, largest difference of N contacts from the renewal equation",
                    apart,
                    4.0 * 0.5 / float(np.sqrt(data.attrs["count"])) + 0.002,
                    "f_s",
                ),
                near("velocity at which K_eff = K", crossing, 0.48, 0.01, "x_s/time"),
                between("first transition, v1 of the ramp", v1, 0.34, 0.50, "x_s/time"),
                between("second transition, v2 of the ramp", v2, 1.05, 1.25, "x_s/time"),
                between("smooth sliding unstable from (linear)", low, 0.34, 0.50, "x_s/time"),
                # Where Fig. 8 has its lower edge: beta = .80 at v = 1.
                near("smooth sliding unstable up to (linear)", high, 0.80**-2, 0.08, "x_s/time"),
            ),
            evidence="renewal equation of newborn contacts pulled at constant velocity, K_eff = max(-dF/dX), checked "
            f"with {data.attrs['count']} contacts; a ramp of {_EACH_WAY:g} time units with {FIG11.contacts} contacts, "
            f"stick-slip where F_d varies by more than {_LEVEL:g}; linear stability. Slopes over {_WAY:g} x_s are "
            "the smaller numbers that a numerical derivative of scattered data gives",
        ),
    )


def _drawing(data: xr.Dataset) -> matplotlib.figure.Figure:
    figure = plot.new_figure(plot.PAGE, 5.2)
    grid = figure.add_gridspec(2, 2)
    friction = figure.add_subplot(grid[0, :])
    curves, stiffness = figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])

    friction.plot(data["drive_velocity"], data["spring_force"], color=plot.BLUE, linewidth=0.4)
    low, high = data["unstable"].to_numpy().tolist()
    friction.axvspan(low, high, color=plot.GREY, alpha=0.15, linewidth=0)
    friction.text(0.5 * (low + high), 1.0, "smooth sliding unstable", ha="center", va="top", fontsize=8)
    friction.axvline(float(data["crossing"]), color=plot.VERMILLION, linewidth=0.9, linestyle="--")
    plot.dress(friction.xaxis, data["drive_velocity"])
    plot.dress(friction.yaxis, data["spring_force"])
    friction.set(xlim=(0.0, 1.5), ylim=(-0.55, 1.02))
    plot.letter(friction, "(a) friction on a ramp")

    for speed, colour in zip(_KNOWN, plot.PALETTE, strict=False):
        curves.plot(
            data["displacement"], data["friction_force"].sel(velocity=speed), color=colour, label=f"$v$ = {speed:g}"
        )
        curves.plot(data["X_checked"], data["F_contacts"].sel(checked=speed), "o", color=colour, markersize=2)
    plot.dress(curves.xaxis, data["displacement"])
    plot.dress(curves.yaxis, data["friction_force"])
    curves.set_ylim(0.0, 1.0)
    curves.legend(loc="upper right", ncols=2)
    plot.letter(curves, "(b) newborn contacts, pulled")

    stiffness.plot(data["velocity"], data["K_eff"], "o-", color=plot.BLUE, markersize=3)
    stiffness.axhline(FIG11.slider.stiffness, color=plot.GREY, linewidth=0.8)
    stiffness.axvline(float(data["crossing"]), color=plot.VERMILLION, linewidth=0.9, linestyle="--")
    stiffness.text(0.02, FIG11.slider.stiffness + 0.06, "$K$", color=plot.GREY)
    stiffness.axvline(float(data["v2_ramp"]), color=plot.BLACK, linewidth=0.9, linestyle=":")
    stiffness.text(float(data["v2_ramp"]) - 0.02, 2.6, "$v_2$", ha="right")
    stiffness.set(xlim=(0.0, 1.2), ylim=(0.0, 1.08 * float(data["K_eff"].max())))
    plot.dress(stiffness.xaxis, data["velocity"])
    plot.dress(stiffness.yaxis, data["K_eff"])
    plot.letter(stiffness, "(c) steepest fall in (b)")
    return figure


FIGURE = Figure(
    name="fig11",
    title="Friction and effective stiffness of ageing contacts",
    caption="Friction on a ramp of the velocity (a); force on newborn contacts pulled at constant velocity, renewal "
    "equation and contacts (b); its steepest decrease, the effective stiffness, against the velocity (c). "
    "Red: where it equals the stiffness of the spring.",
    data=_data,
    drawing=_drawing,
    claims=_claims,
)
