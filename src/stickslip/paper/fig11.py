"""Figure 11: Friction and effective stiffness of ageing contacts.

Friction on a ramp of the velocity (a); force on newborn contacts pulled at constant velocity, renewal equation and
contacts (b); its steepest decrease, the effective stiffness, against the velocity (c). Red: where it equals the
stiffness of the spring.

The paper does not define ``K_eff(v)``. Here it is the steepest decrease of the force, ``max(-dF/dX)``. The N contacts
come from sliding so fast that all are as good as newborn. A slope taken over a finite distance is smaller, by its
square: over .065 x_s it is what another study of the model found.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy import optimize

import stickslip as ss
from stickslip import plot, theory
from stickslip.paper.cases import FIG11
from stickslip.paper.figure import Claim, Figure, at_most, between, near, weighed
from stickslip.paper.kit import Picture, Progress, dataset, grid, panel, portions, shade, table
from stickslip.paper.ramps import LEVEL, V1_SCALED, V2_SCALED, ramped

_CONVERGED = {0.1: 3.309, 0.3: 2.260, 0.5: 0.9205, 0.8: 0.1122}
"""Velocities, and the slopes there, converged in the grid of gaps, of ages and of the way."""
_SMOOTHED = {0.1: 3.21, 0.3: 2.22, 0.5: 0.91}
_WAY = 0.065
_DISTANCE, _SPACING = 1.6, 0.0025
_FAST = 20.0  # of sliding in which contacts hold a thousandth of what they hold at rest
_EACH_WAY = 200.0


def _pulled(velocity: float) -> xr.DataArray:
    """Force of contacts that were all newborn where a slider of constant velocity started, against its displacement."""
    X, force = theory.newborn_pull(FIG11.interface, velocity, _DISTANCE, round(_DISTANCE / _SPACING))
    return xr.DataArray(force, {"displacement": X}, ("displacement",))


def _steepest(force: xr.DataArray, way: float) -> float:
    """Steepest decrease of the force, taken over a displacement."""
    span = max(round(way / _SPACING), 2)
    return float(np.max(force.values[:-span] - force.values[span:])) / (span * _SPACING)


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    velocities = list(_CONVERGED) if quick else np.round(np.arange(0.05, 1.21, 0.05), 2).tolist()
    count = 4_000 if quick else 100_000
    first, second = portions(progress, 1.0, 1.0)
    crossing = optimize.brentq(lambda v: _steepest(_pulled(v), 0.0) - FIG11.slider.stiffness, 0.3, 0.8, xtol=1e-5)
    curves = table(_pulled, velocity=velocities)
    coarse = curves["displacement"].values[19::20]

    def checked(v: float, _: Progress) -> dict[str, Any]:
        step: dict[str, Any] = {"before": _FAST, "after": v, "distance": _DISTANCE, "points": 64}
        run = ss.velocity_step(FIG11.interface, method=ss.Contacts(count, seed=11), **step)
        return {"F_contacts": ("X_checked", np.interp(coarse, run["displacement"], run["friction_force"]))}

    newborns = grid(checked, first, checked=_CONVERGED)["F_contacts"]
    rig = FIG11.rig.replace(drive=ss.ramp(0.05, 1.8, _EACH_WAY))
    run = ramped(rig, ss.Contacts(FIG11.contacts, seed=11), second, level=LEVEL)
    unstable = [edge.value for edge in ss.critical(FIG11.rig, "velocity", between=(0.25, 2.0)).edges[:2]]
    slopes = table(lambda v, way: _steepest(curves.sel(velocity=v), way), velocity=velocities, way=(0.0, _WAY))
    of_newborns = "force of newborn contacts, per contact [f_s]"
    return dataset(
        {
            **run,
            "friction_force": (curves, of_newborns),
            "F_contacts": (newborns, of_newborns),
            "K_eff": (slopes, "effective stiffness per contact [k]"),
            "crossing": (crossing, "velocity at which K_eff = K [x_s/time]"),
            "unstable": ("end", unstable, "where smooth sliding is unstable (linear) [x_s/time]"),
        },
        {
            "velocity": (velocities, "velocity [x_s/time]"),
            "displacement": (curves["displacement"], "displacement of the slider [x_s]"),
            "checked": (list(_CONVERGED), "velocity [x_s/time]"),
            "X_checked": (coarse, "displacement of the slider [x_s]"),
            "way": ([0.0, _WAY], "displacement over which the slope is taken [x_s]"),
            "end": ["low", "high"],
        },
        count=count,
    )


def _crossing(data: xr.Dataset) -> Claim:
    crossing, v1, v2 = (float(data[name]) for name in ("crossing", "v1", "v2"))
    low, high = data["unstable"].to_numpy().tolist()
    exact, smoothed = data["K_eff"].transpose("way", ...)
    falls, over = float(exact.diff("velocity").max()), f"K_eff over {_WAY:g} x_s at v ="
    slopes = [near(f"K_eff at v = {v:g}", exact.sel(velocity=v), k, 0.005 * k, "k") for v, k in _CONVERGED.items()]
    slopes += [near(f"{over} {v:g}", smoothed.sel(velocity=v), k, 0.01, "k") for v, k in _SMOOTHED.items()]
    renewal = data["friction_force"].sel(velocity=list(_CONVERGED)).interp(displacement=data["X_checked"]).to_numpy()
    # A contact's stretching scatters by less than .5; the solvers differ by .002.
    of_newborns = "force of newborn contacts, largest difference of N contacts from the renewal equation"
    noise = 4.0 * 0.5 / float(np.sqrt(data.attrs["count"])) + 0.002
    return weighed(
        17,
        "K_eff falls with the velocity and crosses K at the second transition, to smooth sliding",
        *slopes,
        at_most("K_eff, largest change from one velocity to the next", falls, 0.0, "k"),
        at_most(of_newborns, abs(renewal - data["F_contacts"]).max(), noise, "f_s"),
        near("velocity at which K_eff = K", crossing, 0.48, 0.01, "x_s/time"),
        between("first transition, v1 of the ramp", v1, *V1_SCALED, "x_s/time"),
        between("second transition, v2 of the ramp", v2, *V2_SCALED, "x_s/time"),
        between("smooth sliding unstable from (linear)", low, *V1_SCALED, "x_s/time"),
        # Where Fig. 8 has its lower edge: beta = .80 at v = 1.
        near("smooth sliding unstable up to (linear)", high, 0.80**-2, 0.08, "x_s/time"),
        printed=falls < 0 and abs(crossing - v2) < 0.2 * v2,
        exact=f"K_eff falls, but crosses K = {FIG11.slider.stiffness:g} at v = {crossing:.3f}, where stick-slip "
        f"begins; it ends at v = {v2:.2f}",
        evidence="renewal equation of newborn contacts pulled at constant velocity, K_eff = max(-dF/dX), checked "
        f"with {data.attrs['count']} contacts; a ramp of {_EACH_WAY:g} time units with {FIG11.contacts} contacts, "
        f"stick-slip where F_d varies by more than {LEVEL:g}; linear stability. Slopes over {_WAY:g} x_s are "
        "the smaller numbers that a numerical derivative of scattered data gives",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    friction, curves, stiffness = picture.subplot_mosaic("aa;bc").values()
    K, crossing, v2 = FIG11.slider.stiffness, float(data["crossing"]), float(data["v2"])

    friction.plot(data["drive_velocity"], data["spring_force"], color=plot.BLUE, linewidth=0.4)
    shade(friction, data["unstable"], "smooth sliding unstable", 0.92)
    friction.axvline(crossing, color=plot.VERMILLION, linewidth=0.9, linestyle="--")
    title, limits = "(a) friction on a ramp", {"xlim": (0.0, 1.5), "ylim": (-0.55, 1.02)}
    panel(friction, title, data["drive_velocity"], data["spring_force"], **limits)

    for v, colour in zip(_CONVERGED, plot.PALETTE, strict=False):
        force = data["friction_force"].sel(velocity=v)
        curves.plot(data["displacement"], force, color=colour, label=f"$v$ = {v:g}")
        curves.plot(data["X_checked"], data["F_contacts"].sel(checked=v), "o", color=colour, markersize=2)
    panel(curves, "(b) newborn contacts, pulled", data["displacement"], data["friction_force"], ylim=(0.0, 1.0))
    curves.legend(loc="upper right", ncols=2)

    stiffness.plot(data["velocity"], data["K_eff"].sel(way=0.0), "o-", color=plot.BLUE, markersize=3)
    stiffness.axhline(K, color=plot.GREY, linewidth=0.8)
    stiffness.axvline(crossing, color=plot.VERMILLION, linewidth=0.9, linestyle="--")
    stiffness.text(0.02, K + 0.06, "$K$", color=plot.GREY)
    stiffness.axvline(v2, color=plot.BLACK, linewidth=0.9, linestyle=":")
    stiffness.text(v2 - 0.02, 2.6, "$v_2$", ha="right")
    limits = {"xlim": (0.0, 1.2), "ylim": (0.0, 1.08 * float(data["K_eff"].max()))}
    panel(stiffness, "(c) steepest fall in (b)", data["velocity"], data["K_eff"], **limits)


FIGURE = Figure(__name__, __doc__, 5.2, _data, _drawing, _crossing)
