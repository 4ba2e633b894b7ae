"""Figure 6: the critical delay against the mass of the slider and against the velocity of the drive.

The paper's ``tau*`` is where stick-slip persists from a narrow start: nonlinear, "sustained" here. Beside it
stands the linear critical delay, at which smooth sliding itself becomes unstable. Time can be measured in ``x_s/v``:
then Eq. (11) holds the velocity only in ``M v^2``, so that (a) and (b) are one curve.
"""

from __future__ import annotations

import math
from dataclasses import replace

import matplotlib.figure
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from stickslip import plot
from stickslip.cycles import sustained_onset
from stickslip.model import Slider, constant
from stickslip.model.rig import Rig
from stickslip.paper.cases import FIG4, FIG6
from stickslip.paper.figure import (
    Claim,
    Figure,
    Measured,
    Progress,
    at_least,
    at_most,
    between,
    near,
    portions,
    variable,
    verdict,
)
from stickslip.stability import onset

Array = NDArray[np.float64]

_RATIO = 0.3  # of damping to Omega
_MASSES = (1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
_VELOCITIES = (0.1, 0.2, 0.4, 0.7, 1.0, 1.7, 3.0, 5.0, 10.0)
_RATIOS = (0.1, 0.3, 1.0, 2.0)
_FITTED = 1e-3  # largest mass in the fit
# About where tau* v is expected, to start the search: A1 + A2 (M v^2)^(1/3). The answer does not depend on it.
_EXPECTED = (0.05, 0.55)


def _slider(mass: float, ratio: float = _RATIO) -> Slider:
    stiffness = FIG6.slider.stiffness
    return Slider(stiffness=stiffness, mass=mass, damping=ratio * math.sqrt(stiffness / mass))


def _delays(slider: Slider, velocity: float, tolerance: float) -> tuple[float, float]:
    """Sustained (nonlinear) and linear critical delay."""
    guess = (_EXPECTED[0] + _EXPECTED[1] * math.cbrt(slider.mass * velocity**2)) / velocity
    interface = FIG6.interface
    sustained = sustained_onset(
        Rig(interface, slider, constant(velocity)), "delay", between=(0.7 * guess, 4 * guess), tolerance=tolerance
    )
    return sustained.value, onset(
        Rig(interface, slider, constant(velocity)), "delay", between=(1e-3 / velocity, 1e2 / velocity)
    )


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    tolerance = 5e-3 if quick else 1e-3
    masses = np.array((1e-6, FIG6.slider.mass, 1e-3) if quick else _MASSES)
    velocities = np.array((1.0, 3.0) if quick else _VELOCITIES)
    ratios = np.array((0.3, 1.0) if quick else _RATIOS)
    parts = portions(progress, masses.size + 2 * velocities.size + ratios.size + 1)

    known: dict[tuple[Slider, float], tuple[float, float]] = {}  # some are in several panels

    def delays(slider: Slider, velocity: float = 1.0) -> tuple[float, float]:
        if (slider, velocity) not in known:
            known[slider, velocity] = _delays(slider, velocity, tolerance)
        next(parts)(1.0)
        return known[slider, velocity]

    by_mass = np.array([delays(_slider(mass)) for mass in masses.tolist()])
    by_velocity = np.array([delays(FIG6.slider, v) for v in velocities.tolist()])
    same = np.array([delays(_slider(FIG6.slider.mass * v**2)) for v in velocities.tolist()])
    by_ratio = np.array([delays(_slider(FIG6.slider.mass, ratio)) for ratio in ratios.tolist()])
    fig4 = delays(replace(FIG4.slider, stiffness=FIG6.slider.stiffness))[0]

    sustained = "critical delay tau*: the shortest with which stick-slip persists from a narrow start (nonlinear)"
    linear = "linear critical delay: the shortest with which smooth sliding is unstable"

    fits = [_fit(masses, by_mass[:, 0]), _fit(FIG6.slider.mass * velocities**2, by_velocity[:, 0] * velocities)]
    return xr.Dataset(
        {
            "sustained_by_mass": variable("mass", by_mass[:, 0], sustained, "time"),
            "linear_by_mass": variable("mass", by_mass[:, 1], linear, "time"),
            "sustained_by_velocity": variable("velocity", by_velocity[:, 0], sustained, "time"),
            "linear_by_velocity": variable("velocity", by_velocity[:, 1], linear, "time"),
            "sustained_at_same_M_v2": variable(
                "velocity", same[:, 0], f"{sustained}, at velocity 1 and the mass M v^2", "time"
            ),
            "linear_at_same_M_v2": variable(
                "velocity", same[:, 1], f"{linear}, at velocity 1 and the mass M v^2", "time"
            ),
            "sustained_by_ratio": variable("ratio", by_ratio[:, 0], sustained, "time"),
            "linear_by_ratio": variable("ratio", by_ratio[:, 1], linear, "time"),
            "sustained_eta_200": variable((), fig4, f"{sustained}, eta 200", "time"),
            "fit": variable(
                ("curve", "coefficient"),
                fits,
                "A1 and A2 of tau* v = A1 + A2 (M v^2)^(1/3), least squares, M v^2 up to 1e-3",
                "x_s, x_s^(2/3) f_s^(-1/3)",
            ),
        },
        coords={
            "mass": variable("mass", masses, "mass of the slider, per contact", "f_s time^2/x_s"),
            "velocity": variable("velocity", velocities, "velocity of the drive", "x_s/time"),
            "ratio": variable("ratio", ratios, "damping over Omega", "1"),
            "curve": variable("curve", ["mass", "velocity"], "curve that is fitted"),
            "coefficient": variable("coefficient", ["A1", "A2"], "coefficient"),
        },
        attrs={"tolerance": tolerance},
    )


def _as_expected(fit: Array) -> bool:
    return bool(0.047 <= fit[0] <= 0.054 and 0.47 <= fit[1] <= 0.57)


def _fit(mass: Array, tau: Array) -> Array:
    """Coefficients A1 and A2 of ``tau = A1 + A2 M^(1/3)``."""
    kept = mass <= _FITTED * (1 + 1e-9)
    return np.asarray(np.polyfit(np.cbrt(mass[kept]), tau[kept], 1)[::-1])


def _claims(data: xr.Dataset) -> tuple[Claim, ...]:
    fit = {name: data["fit"].sel(curve=name).to_numpy() for name in ("mass", "velocity")}
    mass, tau = data["mass"].to_numpy(), data["sustained_by_mass"].to_numpy()
    kept = mass <= _FITTED * (1 + 1e-9)
    misfit = float(np.max(np.abs((fit["mass"][0] + fit["mass"][1] * np.cbrt(mass)) / tau - 1)[kept]))
    velocity = data["velocity"]
    apart = _apart(data["sustained_by_velocity"] * velocity, data["sustained_at_same_M_v2"])
    linear_apart = _apart(data["linear_by_velocity"] * velocity, data["linear_at_same_M_v2"])
    rises = float(data["sustained_by_ratio"].diff("ratio").min())
    read = all(map(_as_expected, fit.values())) and misfit < 0.03 and apart < 0.02 and rises > 0
    whichever = _as_expected(_fit(mass, data["linear_by_mass"].to_numpy()))  # of the two delays, it goes so
    linear = float(data["linear_by_mass"].sel(mass=FIG6.slider.mass, method="nearest"))
    return (
        Claim(
            number=9,
            statement="the critical delay goes as A1 + A2 M^(1/3) with the mass and as A3/v + A4 v^(-1/3) with the "
            "velocity, and grows with the damping",
            verdict=verdict(printed=read and whichever, read=read),
            settled="reproduced under the stated reading",
            reading="tau* is the shortest delay with which stick-slip persists from a narrow start, damping is a fixed "
            f"fraction of Omega, and M v^2 is at most {_FITTED:g}. Then tau* v depends on M v^2 alone: A3 = A1 and "
            "A4 = A2 M^(1/3). The linear critical delay is another thing, nearly the same for all masses; tau* does "
            "not exceed it",
            measured=(
                near("tau*, M 1e-4, v 1, eta .3 Omega", _at_paper(data), 0.0755, 0.003),
                near("tau*, eta 200", float(data["sustained_eta_200"]), 0.098, 0.002),
                between("A1 of tau*(M)", fit["mass"][0], 0.047, 0.054),
                between("A2 of tau*(M)", fit["mass"][1], 0.47, 0.57),
                between("A3 of tau*(v)", fit["velocity"][0], 0.047, 0.054),
                between("A4 of tau*(v) over M^(1/3)", fit["velocity"][1], 0.47, 0.57),
                at_most("largest relative misfit of A1 + A2 M^(1/3)", misfit, 0.03),
                at_most("largest relative difference of tau* v at equal M v^2", apart, 0.02),
                at_most("the same for the linear critical delay", linear_apart, 1e-6),
                at_least("smallest rise of tau* from one damping to the next", rises, 0.0),
                near("linear critical delay, M 1e-4, v 1", linear, 0.138218, 1e-6),
                Measured(
                    name="linear critical delay, largest over smallest of all masses",
                    value=float(data["linear_by_mass"].max() / data["linear_by_mass"].min()),
                ),
            ),
            evidence="bisection over runs of the master equation from rest, each followed until its oscillation "
            f"settles or decays; brackets to {data.attrs['tolerance']:g}",
        ),
    )


def _at_paper(data: xr.Dataset) -> float:
    return float(data["sustained_by_velocity"].sel(velocity=1.0))


def _apart(one: xr.DataArray, two: xr.DataArray) -> float:
    return float(np.abs(one / two - 1).max())


def _drawing(data: xr.Dataset) -> matplotlib.figure.Figure:
    figure = plot.new_figure(plot.PAGE, 5.4)
    panels = figure.subplots(2, 2)
    by_mass, by_velocity, collapse, by_ratio = panels.ravel()
    A1, A2 = data["fit"].sel(curve="mass").to_numpy()
    mass, velocity = data["mass"].to_numpy(), data["velocity"].to_numpy()
    M0 = FIG6.slider.mass

    def fitted(ax: Axes, x: Array, M_v2: Array, y: Array, label: str | None) -> None:
        """A line, broken where it was not fitted."""
        for kept, style in ((M_v2 <= _FITTED, "-"), (M_v2 >= _FITTED, ":")):
            ax.plot(x[kept], y[kept], style, color=plot.BLUE, linewidth=0.9, label=label if style == "-" else None)

    fine = np.geomspace(mass.min(), mass.max(), 401)
    fitted(by_mass, fine, fine, A1 + A2 * np.cbrt(fine), rf"{A1:.3f} + {A2:.2f} $M^{{1/3}}$")
    by_mass.plot(mass, data["sustained_by_mass"], "o", color=plot.BLUE, markersize=4, label=r"sustained: $\tau^*$")
    by_mass.plot(mass, data["linear_by_mass"], "s-", color=plot.VERMILLION, markersize=3, linewidth=0.9, label="linear")
    by_mass.set(xscale="log", ylim=(0, 0.2))
    by_mass.legend(loc="lower right")
    by_mass.set_xlabel(r"mass of the slider $M/N$ ($f_\mathrm{s}$ time$^2$/$x_\mathrm{s}$)")
    plot.letter(by_mass, "(a) $v_d$ = 1")

    fine = np.geomspace(velocity.min(), velocity.max(), 401)
    A4 = A2 * math.cbrt(M0)
    label = rf"{A1:.3f} $v^{{-1}}$ + {A4:.4f} $v^{{-1/3}}$"
    fitted(by_velocity, fine, M0 * fine**2, A1 / fine + A4 / np.cbrt(fine), label)
    by_velocity.plot(
        velocity, data["sustained_by_velocity"], "o", color=plot.BLUE, markersize=4, label=r"sustained: $\tau^*$"
    )
    by_velocity.plot(
        velocity, data["linear_by_velocity"], "s-", color=plot.VERMILLION, markersize=3, linewidth=0.9, label="linear"
    )
    by_velocity.set(xscale="log", yscale="log")
    by_velocity.legend(loc="lower left")
    plot.dress(by_velocity.xaxis, data["velocity"])
    plot.letter(by_velocity, "(b) $M$ = 10$^{-4}$")

    collapse.plot(np.cbrt(mass), data["sustained_by_mass"], "o", color=plot.BLUE, markersize=4, label="from (a)")
    cube = np.cbrt(M0 * velocity**2)
    scaled = data["sustained_by_velocity"] * data["velocity"]
    collapse.plot(cube, scaled, "x", color=plot.BLACK, markersize=6, label="from (b)")
    line = np.linspace(0.0, float(np.cbrt(mass.max())), 401)
    fitted(collapse, line, line**3, A1 + A2 * line, None)
    linear = data["linear_by_mass"]
    collapse.plot(np.cbrt(mass), linear, "s-", color=plot.VERMILLION, markersize=3, linewidth=0.9, label="linear")
    collapse.set(xlim=(0, line[-1] * 1.02), ylim=(0, 0.2))
    collapse.set_xlabel(r"$(M v_d^2)^{1/3}$")
    collapse.set_ylabel(r"$\tau^* v_d$ ($x_\mathrm{s}$)")
    collapse.legend(loc="lower right")
    plot.letter(collapse, "(c) one curve")

    by_ratio.plot(
        data["ratio"], data["sustained_by_ratio"], "o-", color=plot.BLUE, markersize=4, label=r"sustained: $\tau^*$"
    )
    by_ratio.plot(data["ratio"], data["linear_by_ratio"], "s-", color=plot.VERMILLION, markersize=3, label="linear")
    by_ratio.set(xscale="log", ylim=(0, 0.2))
    by_ratio.set_xlabel(r"damping $\eta/\Omega$")
    by_ratio.legend(loc="lower right")
    plot.letter(by_ratio, r"(d) $v_d$ = 1, $M$ = 10$^{-4}$")
    for ax in (by_mass, by_velocity, by_ratio):
        ax.set_ylabel("critical delay (time units)")
    return figure


FIGURE = Figure(
    name="fig6",
    title="Critical delay",
    caption="Critical delay against the mass of the slider (a), the velocity of the drive (b) and the damping (d). "
    "Circles: stick-slip persists from a narrow start (nonlinear). Squares: smooth sliding is unstable "
    "(linear). Blue lines are fits, dotted outside the range fitted; in (c) the two fits are one curve of M "
    "v^2.",
    data=_data,
    drawing=_drawing,
    claims=_claims,
)
