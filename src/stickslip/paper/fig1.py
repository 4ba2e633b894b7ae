"""Figure 1: Force on a rigid slider.

Friction force on a rigid slider against its displacement, for three widths of the initial forces and two of the
thresholds: the master equation (lines) and contacts (dots). From a narrow start the force rises, overshoots and
decreases; it tends to the kinetic friction.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.signal import argrelmax, argrelmin

import stickslip as ss
from stickslip import plot
from stickslip.model.distributions import Distribution
from stickslip.paper.cases import FIG1, interface
from stickslip.paper.figure import Claim, Figure, at_least, at_most, near, weighed
from stickslip.paper.kit import Array, Picture, Progress, dataset, grid, panel, power, table

DISTANCE = 8.0
_POINTS = 1600  # of the curves
_PAIRS = {"initial_std": (0.01, 0.3), "threshold_std": (0.1, 0.3)}

# Widths of the start, from all contacts relaxed alike to the steady state of sliding.
_STARTS = {"delta": 0.0, "0.01": 0.01, "0.03": 0.03, "0.1": 0.1, "0.3": 0.3, "steady": None}

_LATE = 60.0  # x_s, where the oscillation of the narrowest distribution below has fallen by exp(-2 pi^2 .1^2 60) = 7e-6
_DISTRIBUTIONS: dict[str, Distribution] = {
    "Gaussian, standard deviation .1": ss.Gaussian(mean=1.0, std=0.1),
    "Gaussian, standard deviation .3": ss.Gaussian(mean=1.0, std=0.3),
    "uniform": ss.Uniform(low=0.7, high=1.3),
    "exponential": ss.Exponential(mean=1.0),
    "gamma": ss.Gamma(mean=1.0, std=0.2),
    "log-normal": ss.LogNormal(mean=1.0, std=0.2),
    "Weibull": ss.Weibull(shape=4.0, scale=1.0),
}

# First maximum and first minimum of F_c, by initial and threshold standard deviation: Eqs. (1)-(4) to the letter, in
# which a contact that starts stretched backwards may have any threshold. In truth it has not broken, so that its
# threshold lies beyond its stretching, and contacts remember that; it matters in the third digit, and only if both
# standard deviations are wide.
_SETTLED = {
    (0.01, 0.1): (0.79560, 0.22452),
    (0.01, 0.3): (0.64572, 0.49249),
    (0.3, 0.1): (0.54666, 0.46251),
    (0.3, 0.3): (0.56793, 0.53360),
}


def _force(initial: float | None, threshold: float, method: Any = ss.model.Renewal(_POINTS)) -> xr.DataArray:
    """Force on the same positions by any method; by all but `Renewal` contacts remember that they have not broken."""
    force = ss.rigid_slide(interface(initial, threshold), DISTANCE, method=method)["friction_force"]
    return force[:: (force.size - 1) // _POINTS]


def _late_deviation(name: str) -> xr.DataArray:
    """Largest distance of the force from the kinetic friction within 1 x_s about half way, and at the end."""
    narrow = replace(FIG1.interface, thresholds=_DISTRIBUTIONS[name])
    run = ss.rigid_slide(narrow, _LATE, method=ss.model.Renewal(12_000))
    far = abs(run["friction_force"] / ss.kinetic_friction(narrow) - 1.0)
    ends = {"middle": 0.5 * _LATE + 0.5, "end": _LATE}
    return table(lambda where: far.sel(displacement=slice(ends[where] - 1.0, ends[where])).max(), where=ends)


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    counts = (250, 1000, 4000) if quick else (250, 1000, 4000, 16_000)
    seeds, stds = range(3 if quick else 6), _PAIRS["threshold_std"]

    def contacts(count: int, seed: int, initial: float, threshold: float, _: Progress) -> dict[str, xr.DataArray]:
        stream = 1000 * list(_SETTLED).index((initial, threshold)) + seed  # of random numbers, for every run
        return {"force": _force(initial, threshold, ss.Contacts(count, seed=stream))}

    remembering = table(lambda initial, std: _force(initial, std, ss.MasterEquation()), **_PAIRS)
    starts = table(lambda start, std: _force(_STARTS[start], std), start=_STARTS, threshold_std=stds)
    kinetic = table(lambda std: ss.kinetic_friction(interface(0.01, std)), threshold_std=stds)
    force = grid(contacts, progress, contacts=counts, seed=seeds, **_PAIRS)["force"]
    shown = force.sel(contacts=FIG1.contacts, seed=0, drop=True)
    scatter = ((force - remembering) ** 2).mean("displacement") ** 0.5
    remember = "force of contacts that remember how far they were stretched, per contact [f_s]"
    far = f"largest relative distance from the kinetic friction, half way to and at X = {_LATE:g} x_s [1]"
    return dataset(
        {
            "friction_force": table(_force, **_PAIRS),
            "F_c_contacts": (shown, f"force of {FIG1.contacts} contacts, per contact [f_s]"),
            "F_c_remembering": (remembering, remember),
            "F_c_start": (starts, "friction force by start, per contact [f_s]"),
            "F_k": (kinetic, "kinetic friction, per contact [f_s]"),
            "scatter": (scatter, "rms distance of contacts from the master equation [f_s]"),
            "deviation": (table(_late_deviation, distribution=_DISTRIBUTIONS), far),
        }
    )


def _turning_points(force: Array) -> Array:
    """First maximum and first minimum, by parabolas through three samples."""
    at = np.array([argrelmax(force)[0][0], argrelmin(force)[0][0]])
    left, y, right = force[at - 1], force[at], force[at + 1]
    return np.asarray(y - (right - left) ** 2 / (8.0 * (left - 2.0 * y + right)))


def _scatter(data: xr.Dataset) -> Claim:
    count, scatter = data["contacts"], data["scatter"]
    scaled = scatter * np.sqrt(count)
    typical = np.exp(np.log(scatter.to_numpy()).mean(axis=(1, 2, 3)))
    return weighed(
        1,
        "N contacts scatter about the master equation as N^(-1/2)",
        near("power of N", power(count, typical), -0.5, 0.1),
        at_least("smallest rms distance times sqrt(N)", scaled.min(), 0.15, "f_s"),
        at_most("largest rms distance times sqrt(N)", scaled.max(), 0.55, "f_s"),
        evidence=f"rms over 0 to {DISTANCE:g} x_s in {scatter.size} runs of {int(count.min())} to "
        f"{int(count.max())} contacts",
    )


def _limit(data: xr.Dataset) -> Claim:
    end, middle = data["deviation"].sel(where="end"), data["deviation"].sel(where="middle")
    fall = (end / middle).where(middle > 1e-6, 0.0).max()
    still_on_the_way = "end over half way, largest of all distributions that have not arrived by then"
    narrow, wide = data["F_k"].to_numpy()
    return weighed(
        2,
        "for any distribution of thresholds but a delta function the force tends to F_k, about N f_s/2",
        at_most(f"largest relative distance from F_k at {_LATE:g} x_s", end.max(), 1e-4),
        at_most(still_on_the_way, fall, 0.1),
        near("F_k, standard deviation .1", narrow, 0.505, 1e-5, "f_s"),
        near("F_k, standard deviation .3", wide, 0.54498, 1e-5, "f_s"),
        evidence=f"{end.size} distributions ({', '.join(_DISTRIBUTIONS)}); F_k in closed form",
    )


def _steady_start(data: xr.Dataset) -> Claim:
    far = abs(data["F_c_start"].sel(start="steady") - data["F_k"]).max()
    return weighed(
        3,
        "started in the steady state Q_s, the force does not depend on X",
        at_most("largest distance from F_k", far, 1e-6, "f_s"),
        evidence=f"0 to {DISTANCE:g} x_s; thresholds with standard deviations 0.1 and 0.3",
    )


def _delta_start(data: xr.Dataset) -> Claim:
    starts = data["F_c_start"].to_numpy()[:-1]  # without the steady start
    oscillations = np.array([[np.subtract(*_turning_points(force)) for force in start] for start in starts])
    measured = [
        at_least(f"oscillation from a delta start over that from .01, thresholds {t:g}", ratio, 1.0)
        for t, ratio in zip(data["threshold_std"].values, oscillations[0] / oscillations[1], strict=True)
    ]
    for (initial, threshold), settled in _SETTLED.items():
        force = data["friction_force"].sel(initial_std=initial, threshold_std=threshold).to_numpy()
        measured += [
            near(f"first {which}, start {initial:g}, thresholds {threshold:g}", value, right, 2e-4, "f_s")
            for which, value, right in zip(("maximum", "minimum"), _turning_points(force), settled, strict=True)
        ]
    wide = data["F_c_remembering"].sel(initial_std=0.3, threshold_std=0.3).to_numpy()
    measured.append(near("the same maximum where contacts remember", _turning_points(wide)[0], 0.56894, 2e-4, "f_s"))
    return weighed(
        4,
        "the first oscillation of the force is stronger the narrower the start, strongest for a delta start",
        *measured,
        printed=bool(np.all(np.diff(oscillations, axis=0) < 0)),
        evidence="first maximum less first minimum for starts of standard deviation 0, .01, .03, .1 and .3",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    ax = picture.subplots()
    X, f_s = data["displacement"], plot.unit_text("f_s")
    for (initial, threshold), colour in zip(_SETTLED, plot.PALETTE, strict=False):
        case = data.sel(initial_std=initial, threshold_std=threshold)
        name = rf"$\Delta f_0$ = {initial:g} {f_s},  $\Delta f_\mathrm{{s}}$ = {threshold:g} {f_s}"
        ax.plot(X, case["friction_force"], color=colour, label=name)
        ax.plot(X, case["F_c_contacts"], color=colour, linestyle=":", linewidth=1.0)
    ax.plot([], [], color=plot.GREY, label="master equation")
    ax.plot([], [], color=plot.GREY, linestyle=":", label=f"{FIG1.contacts} contacts")
    panel(ax, "", X, data["friction_force"], xlim=(0, DISTANCE), ylim=(0, 0.85))
    ax.legend(loc="upper right", ncols=2, columnspacing=1.6)
    _sketch(ax.inset_axes((0.47, 0.02, 0.5, 0.27)))


def _sketch(ax: Axes) -> None:
    """The model: a slider pulled by a spring over contacts, each a spring that breaks."""
    ax.set(xlim=(0, 10), ylim=(0, 3.2))
    ax.axis("off")
    base, slider = (5.0, 0.5, 9.6, 0.0, "#D9D9D9"), (3.4, 1.1, 5.6, 1.7, "#AADAF4")
    for *box, colour in (base, slider):
        ax.bar(*box, color=colour, edgecolor=plot.BLACK, linewidth=0.7)
    along = np.array([0.0, 0.2, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.8, 1.0])  # a spring, and its zigzag
    aside = np.array([0.0, 0.0, 0.13, -0.13, 0.13, -0.13, 0.13, -0.13, 0.0, 0.0])
    for foot in np.arange(0.95, 5.4, 1.1):
        ax.plot(foot + 0.4 * along + aside, 0.5 + 1.2 * along, color=plot.VERMILLION, linewidth=0.8)
        ax.plot(foot, 0.5, "o", color=plot.VERMILLION, markersize=2.5)
    ax.plot(6.2 + 2.2 * along, 2.25 + aside, color=plot.BLACK, linewidth=0.8)
    arrow = {"arrowstyle": "-|>", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0, "color": plot.BLACK}
    ax.annotate("", (9.4, 2.25), (8.4, 2.25), arrowprops=arrow)
    for x, y, words, side in (
        (3.4, 2.25, "slider,  $M$", "center"),
        (9.6, 0.25, "base", "right"),
        (6.3, 1.05, "$N$ contacts,  $k$", "left"),
        (7.3, 2.9, "$K$", "center"),
        (9.45, 2.25, r"$v_\mathrm{d}$", "left"),
    ):
        ax.text(x, y, words, ha=side, va="center", fontsize=8)


FIGURE = Figure(__name__, __doc__, 3.6, _data, _drawing, _scatter, _limit, _steady_start, _delta_start)
