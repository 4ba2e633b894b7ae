"""Figure 11: the effective stiffness of ageing contacts against the velocity.

The paper does not define ``K_eff(v)``. Here all contacts are newborn at the start, the slider is pulled rigidly at a
constant velocity, and ``K_eff`` is the steepest fall of the force, ``max(-dF/dX)``, from the kinetic equation of
Eqs. (13)-(17). Beside it a run at a velocity above the crossing.
"""

from __future__ import annotations

from dataclasses import replace

import matplotlib.figure
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip import plot
from stickslip.drive import hold
from stickslip.kernels.ageing import advance_density, threshold_edges
from stickslip.model import FIG11, Langevin
from stickslip.paper.record import Claim, Figure, Progress, at_least, at_most, between, near, portions, verdict
from stickslip.simulate import MasterEquation, Record, simulate
from stickslip.theory import gaussian_ageing

Array = NDArray[np.float64]

_ABOVE = 0.8
"""A velocity above the crossing, at which the slider is watched."""


def _fall(velocity: float, cells: int) -> tuple[Array, Array]:
    """Force of contacts that are all newborn at ``X = 0``, on displacements."""
    ageing, law = gaussian_ageing(FIG11.interface)
    reach = 10.0 / cells
    edges = threshold_edges(law.mean, law.spread, ageing.newborn, cells / 50.0)
    place = np.zeros(int(4.0 / reach) + 50)
    mass = np.zeros((place.size, edges.size - 1))
    mass[0, 0] = 1.0  # in the open cohort, on the boundary
    X = np.linspace(0.0, 2.5, 126)
    samples = advance_density(
        np.array([0.0, 0.0, velocity, 0.0, 1.0, 0.0, 0.0]),
        place,
        mass,
        edges,
        np.array([[0.0, 0.0, velocity, 0.0]]),
        np.array([np.inf, 1.0, 0.0]),
        np.array([ageing.rate, law.mean, law.spread, ageing.newborn]),
        X / velocity,
        min(4.0 / cells, 0.04),
        reach,
    )
    return X, np.asarray(samples[:, 3])


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    velocities = np.array([0.1, 0.3, 0.5, 0.8]) if quick else np.array([0.05, *np.round(np.arange(0.1, 1.01, 0.05), 2)])
    cells = 400 if quick else 1000
    parts = portions(progress, 2)
    first = next(parts)
    curves = []
    for i, v in enumerate(velocities.tolist()):
        X, force = _fall(v, cells)
        curves.append(force)
        first((i + 1) / velocities.size)
    stiffness = np.array([float(np.max(-np.gradient(force, X))) for force in curves])
    run = simulate(
        replace(FIG11.interface, ageing=Langevin(rate=1.0)),
        FIG11.slider,
        hold(_ABOVE, 8.0),
        MasterEquation(cells=100 if quick else 400),
        record=Record(interval=0.005),
        progress=next(parts),
    )
    labels = {"units": "k", "long_name": "effective stiffness per contact"}
    return xr.Dataset(
        {
            "K_eff": ("velocity", stiffness, labels),
            "F_c": (
                ("velocity", "X"),
                np.array(curves),
                {"units": "f_s", "long_name": "force of newborn contacts, per contact"},
            ),
            "F_d": ("t", run["F_d"].to_numpy(), run["F_d"].attrs),
        },
        coords={
            "velocity": ("velocity", velocities, {"units": "x_s/time", "long_name": "velocity"}),
            "X": ("X", X, {"units": "x_s", "long_name": "displacement"}),
            "t": ("t", run["t"].to_numpy(), {"units": "time", "long_name": "time"}),
        },
    )


def _claims(data: xr.Dataset) -> tuple[Claim, ...]:
    v, K_eff = data["velocity"].to_numpy(), data["K_eff"].to_numpy()
    K = FIG11.slider.stiffness
    # Between two velocities K_eff falls nearly in proportion: its logarithm is interpolated.
    crossing = float(np.interp(np.log(K), np.log(K_eff[::-1]), v[::-1]))
    amplitude = float(np.ptp(data["F_d"].sel(t=slice(4.0, None)).to_numpy()))
    falls = bool(np.all(np.diff(K_eff) < 0))
    settled = {0.1: 3.21, 0.3: 2.22, 0.5: 0.91, 0.8: 0.13}
    measured = []
    for speed, known in settled.items():
        value = float(data["K_eff"].sel(velocity=speed, method="nearest"))
        measured.append(near(f"K_eff at v = {speed:g}", value, known, max(0.04 * known, 0.04), "k"))
    return (
        Claim(
            number=17,
            statement="K_eff falls with the velocity and crosses K at the second transition, to smooth sliding",
            verdict=verdict(printed=falls and amplitude < 0.6),
            settled="not reproduced",
            exact="K_eff falls, but crosses K at v = 0.48, where stick-slip begins; it ends at v = 1.05 to 1.25",
            measured=(
                *measured,
                at_most("K_eff, largest change from one velocity to the next", float(np.max(np.diff(K_eff))), 0.0, "k"),
                between("velocity at which K_eff = K", crossing, 0.45, 0.51, "x_s/time"),
                at_least(f"peak-to-peak F_d at v = {_ABOVE:g}, where K_eff < K", amplitude, 0.6, "f_s"),
            ),
            evidence="kinetic equation from newborn contacts at constant velocity, K_eff = max(-dF/dX); one run",
        ),
    )


def _drawing(data: xr.Dataset) -> matplotlib.figure.Figure:
    figure = plot.new_figure(plot.PAGE, 2.8)
    curves, stiffness = figure.subplots(1, 2)
    colours = (plot.BLUE, plot.VERMILLION, plot.GREEN, plot.ORANGE)
    for speed, colour in zip((0.1, 0.3, 0.5, 0.8), colours, strict=True):
        force = data["F_c"].sel(velocity=speed, method="nearest")
        curves.plot(data["X"], force, color=colour, label=f"$v$ = {speed:g}")
    plot.dress(curves.xaxis, data["X"])
    plot.dress(curves.yaxis, data["F_c"])
    curves.legend()
    plot.letter(curves, "(a)")
    stiffness.plot(data["velocity"], data["K_eff"], "o-", color=plot.BLUE, markersize=3)
    stiffness.axhline(FIG11.slider.stiffness, color=plot.GREY, linewidth=0.8, linestyle="--")
    plot.dress(stiffness.xaxis, data["velocity"])
    plot.dress(stiffness.yaxis, data["K_eff"])
    plot.letter(stiffness, "(b)")
    return figure


FIGURE = Figure(
    name="fig11", title="Effective stiffness of ageing contacts", data=_data, drawing=_drawing, claims=_claims
)
