"""Figures 1, 2, 3 and 5: the force on a rigid slider, and the elastic instability of a
slider on a soft spring.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq
from scipy.signal import argrelmax, argrelmin

import stickslip as ss
from stickslip import plot, theory
from stickslip.model import Distribution, Method, Start
from stickslip.paper.cases import (
    CRITICAL_STIFFNESS,
    CRITICAL_STIFFNESS_NEVER,
    FIG1,
    FIG2,
    FIG4,
    FIG5,
    interface,
)
from stickslip.paper.figure import (
    Claim,
    Figure,
    Measured,
    at_least,
    at_most,
    between,
    claim_from,
    near,
)
from stickslip.paper.kit import (
    Picture,
    Progress,
    dataset,
    grid,
    panel,
    portions,
    power,
    table,
)
from stickslip.plot import BLACK, BLUE, DASHED, GREEN, GREY, ORANGE, PALETTE, VERMILLION
from stickslip.rigid import effective_stiffness

_FAR = 8.0
_POINTS = 1600  # number of intervals of the curves
# standard deviations of initial forces and of thresholds
_STARTS = (0.0, 0.01, 0.03, 0.1, 0.3)
_WIDTHS = (0.1, 0.3)

# distance, in x_s, at which the oscillation of the narrowest distribution below has
# fallen by exp(-2 pi^2 .1^2 60) = 7e-6
_LATE = 60.0
_DISTRIBUTIONS: dict[str, Distribution] = {
    "Gaussian, standard deviation .1": ss.Gaussian(mean=1.0, std=0.1),
    "Gaussian, standard deviation .3": ss.Gaussian(mean=1.0, std=0.3),
    "uniform": ss.Uniform(low=0.7, high=1.3),
    "exponential": ss.Exponential(mean=1.0),
    "gamma": ss.Gamma(mean=1.0, std=0.2),
    "log-normal": ss.LogNormal(mean=1.0, std=0.2),
    "Weibull": ss.Weibull(shape=4.0, scale=1.0),
}

# The pairs of standard deviations in the picture, and the first maximum and minimum of
# F_c by Eqs. (1)-(4) as printed, in which a contact that starts stretched backwards may
# have any threshold. In fact it has not broken, so its threshold lies beyond its
# stretching, and contacts keep that memory; it changes the third digit, and only if
# both standard deviations are large.
_SETTLED = {
    (0.01, 0.1): (0.79560, 0.22452),
    (0.01, 0.3): (0.64572, 0.49249),
    (0.3, 0.1): (0.54666, 0.46251),
    (0.3, 0.3): (0.56793, 0.53360),
}
_PAIRS = list(_SETTLED)


def _force(
    initial: float | None, threshold: float, method: Any = ss.model.Renewal(_POINTS)
) -> xr.DataArray:
    """Return the force at the same positions by any method; with all but `Renewal`,
    contacts keep the memory that they have not broken.
    """
    force = ss.rigid_slide(interface(initial, threshold), _FAR, method=method)[
        "friction_force"
    ]
    return force[:: (force.size - 1) // _POINTS]


def _late_deviation(name: str) -> float:
    """Return the largest relative distance of the force from the kinetic friction in
    the last x_s.
    """
    narrow = replace(FIG1.interface, thresholds=_DISTRIBUTIONS[name])
    force = ss.rigid_slide(narrow, _LATE, method=ss.model.Renewal(12_000))[
        "friction_force"
    ]
    return float(
        abs(
            force.sel(displacement=slice(_LATE - 1.0, None))
            / ss.kinetic_friction(narrow)
            - 1.0
        ).max()
    )


def _data_1(progress: Progress, quick: bool) -> xr.Dataset:
    counts = (250, 1000, 4000) if quick else (250, 1000, 4000, 16_000)
    pairs = range(len(_PAIRS))

    def contacts(
        count: int, seed: int, pair: int, _: Progress
    ) -> dict[str, xr.DataArray]:
        return {
            "force": _force(*_PAIRS[pair], ss.Contacts(count, seed=1000 * pair + seed))
        }

    remembering = table(
        lambda pair: _force(*_PAIRS[pair], ss.MasterEquation()), pair=pairs
    )
    kinetic = table(
        lambda std: ss.kinetic_friction(interface(0.01, std)), threshold_std=_WIDTHS
    )
    deviation = table(_late_deviation, distribution=_DISTRIBUTIONS)
    force = grid(
        contacts, progress, contacts=counts, seed=range(3 if quick else 6), pair=pairs
    )["force"]
    scatter = ((force - remembering) ** 2).mean("displacement") ** 0.5
    shown = force.sel(contacts=FIG1.contacts, seed=0, drop=True)
    return dataset(
        {
            "friction_force": table(_force, initial_std=_STARTS, threshold_std=_WIDTHS),
            "F_c_steady": table(lambda std: _force(None, std), threshold_std=_WIDTHS),
            "F_c_contacts": (
                shown,
                f"force of {FIG1.contacts} contacts, per contact [f_s]",
            ),
            "F_k": (kinetic, "kinetic friction, per contact [f_s]"),
            "scatter": (
                scatter,
                "rms distance of contacts from the master equation [f_s]",
            ),
            "deviation": (
                deviation,
                f"largest relative distance from F_k at X = {_LATE:g} x_s [1]",
            ),
        }
    )


def _turning_points(force: xr.DataArray) -> xr.DataArray:
    """Return the first maximum and minimum, by parabolas through three samples."""
    F = force.values
    at = np.array([argrelmax(F)[0][0], argrelmin(F)[0][0]])
    left = F[at - 1]
    y = F[at]
    right = F[at + 1]
    return xr.DataArray(
        y - (right - left) ** 2 / (8.0 * (left - 2.0 * y + right)), dims="turn"
    )


def _claims_1(data: xr.Dataset) -> Iterator[Claim]:
    count = data["contacts"]
    scatter = data["scatter"]
    scaled = scatter * np.sqrt(count)
    typical = np.exp(np.log(scatter.values).mean(axis=(1, 2)))
    yield claim_from(
        1,
        "N contacts scatter about the master equation as N^(-1/2)",
        near("power of N", power(count, typical), -0.5, 0.1),
        at_least("smallest rms distance times sqrt(N)", scaled.min(), 0.15, "f_s"),
        at_most("largest rms distance times sqrt(N)", scaled.max(), 0.55, "f_s"),
        evidence=f"rms over 0 to {_FAR:g} x_s in {scatter.size} runs of "
        f"{int(count.min())} to "
        f"{int(count.max())} contacts",
    )

    far = data["deviation"]
    narrow, wide = data["F_k"].values
    yield claim_from(
        2,
        (
            "for any distribution of thresholds but a delta function the force tends "
            "to "
            "F_k, about N f_s/2"
        ),
        at_most(
            f"largest relative distance from F_k at {_LATE:g} x_s", far.max(), 1e-4
        ),
        near("F_k, standard deviation .1", narrow, 0.505, 1e-5, "f_s"),
        near("F_k, standard deviation .3", wide, 0.54498, 1e-5, "f_s"),
        evidence=(
            f"{far.size} distributions ({', '.join(_DISTRIBUTIONS)}); F_k in "
            "closed form"
        ),
    )

    yield claim_from(
        3,
        "started in the steady state Q_s, the force does not depend on X",
        at_most(
            "largest distance from F_k",
            abs(data["F_c_steady"] - data["F_k"]).max(),
            1e-6,
            "f_s",
        ),
        evidence=f"0 to {_FAR:g} x_s; thresholds with standard deviations 0.1 and 0.3",
    )

    F = data["friction_force"]
    turns = table(
        lambda *stds: _turning_points(F.loc[stds]),
        initial_std=_STARTS,
        threshold_std=_WIDTHS,
    )
    oscillation = turns[..., 0] - turns[..., 1]
    yield claim_from(
        4,
        (
            "the first oscillation of the force is stronger the narrower the start, "
            "strongest for a delta start"
        ),
        *(
            near(
                f"first {which}, start {pair[0]:g}, thresholds {pair[1]:g}",
                value,
                right,
                2e-4,
                "f_s",
            )
            for pair, settled in _SETTLED.items()
            for which, value, right in zip(
                ("maximum", "minimum"), turns.loc[pair], settled, strict=True
            )
        ),
        printed=bool((oscillation.diff("initial_std") < 0).all()),
        evidence=(
            "first maximum less first minimum for starts of standard deviation 0, "
            ".01, .03, .1 and .3"
        ),
    )


def _drawing_1(picture: Picture, data: xr.Dataset) -> None:
    """Force on a rigid slider.

    Friction force on a rigid slider against its displacement, for three widths of the
    initial forces and two of the thresholds: the master equation (lines) and contacts
    (dots). From a narrow start the force rises, overshoots and decreases; it tends to
    the kinetic friction.
    """
    ax = picture.subplots()
    X = data["displacement"]
    f_s = plot.unit_text("f_s")
    for pair, contacts, colour in zip(
        _PAIRS, data["F_c_contacts"], PALETTE, strict=False
    ):
        name = (
            rf"$\Delta f_0$ = {pair[0]:g} {f_s},  $\Delta f_\mathrm{{s}}$ = "
            rf"{pair[1]:g} {f_s}"
        )
        ax.plot(X, data["friction_force"].loc[pair], color=colour, label=name)
        ax.plot(X, contacts, color=colour, linestyle=":", linewidth=1.0)
    ax.plot([], [], color=GREY, label="master equation")
    ax.plot([], [], color=GREY, linestyle=":", label=f"{FIG1.contacts} contacts")
    panel(ax, "", X, data["friction_force"], xlim=(0, _FAR), ylim=(0, 0.85))
    ax.legend(loc="upper right", ncols=2, columnspacing=1.6)
    _sketch(ax.inset_axes((0.47, 0.02, 0.5, 0.27)))


def _sketch(ax: Axes) -> None:
    """Draw the model: a slider pulled by a spring over contacts, each a spring that
    breaks.
    """
    ax.set(xlim=(0, 10), ylim=(0, 3.2))
    ax.axis("off")
    for *box, colour in (
        (5.0, 0.5, 9.6, 0.0, "#D9D9D9"),
        (3.4, 1.1, 5.6, 1.7, "#AADAF4"),
    ):
        ax.bar(*box, color=colour, edgecolor=BLACK, linewidth=0.7)
    # positions along a spring, and the zigzag across it
    along = np.array([0.0, 0.2, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.8, 1.0])
    aside = np.array([0.0, 0.0, 0.13, -0.13, 0.13, -0.13, 0.13, -0.13, 0.0, 0.0])
    for foot in np.arange(0.95, 5.4, 1.1):
        spring = foot + 0.4 * along + aside, 0.5 + 1.2 * along
        ax.plot(
            *spring,
            "o-",
            color=VERMILLION,
            linewidth=0.8,
            markersize=2.5,
            markevery=[0],
        )
    ax.plot(
        [*(6.2 + 2.2 * along), 9.3],
        [*(2.25 + aside), 2.25],
        ">-",
        color=BLACK,
        linewidth=0.8,
        markersize=4,
        markevery=[-1],
    )
    for x, y, words, side in (
        (3.4, 2.25, "slider,  $M$", "center"),
        (9.6, 0.25, "base", "right"),
        (6.3, 1.05, "$N$ contacts,  $k$", "left"),
        (7.3, 2.9, "$K$", "center"),
        (9.5, 2.25, r"$v_\mathrm{d}$", "left"),
    ):
        ax.text(x, y, words, ha=side, va="center", fontsize=8)


STIFF = 5.0  # spring that follows the decrease of the force, as in Fig. 4
_WAY = 2.0
# fraction of broken contacts at which the force visibly leaves the straight line
_ONSET = 0.01


def first_instability(interface: ss.Interface, stiffness: float) -> tuple[float, float]:
    """Return the first positions of slider and drive, in ``x_s``, at which
    ``K_eff(X) = K``: equality in Eq. (6).
    """
    X = np.linspace(0.0, _WAY, 2001)
    above = np.flatnonzero(effective_stiffness(interface, X) > stiffness)
    if above.size == 0:
        raise ss.UndecidedError(
            f"K_eff stays below K = {stiffness:g} up to X = {_WAY:g}: no elastic "
            "instability"
        )
    around = X[above[0] - 1], X[above[0]]
    X_star = float(
        brentq(
            lambda x: effective_stiffness(interface, [x])[0] - stiffness,
            *around,
            xtol=1e-12,
        )
    )
    run = ss.rigid_slide(interface, X_star, method=ss.model.Renewal(2048))
    return X_star, X_star + float(run["friction_force"][-1]) / stiffness


def _data_2(progress: Progress, quick: bool) -> xr.Dataset:
    interface = FIG2.interface
    slider = FIG2.slider
    run = ss.rigid_slide(
        interface, _WAY, method=ss.model.Renewal(1000 if quick else 4000)
    )
    progress(0.5)
    X, force, rate = (
        run[name].values for name in ("displacement", "friction_force", "breaking_rate")
    )
    X_star, drive = first_instability(interface, slider.stiffness)
    onset = np.interp(_ONSET, cumulative_trapezoid(rate, X, initial=0), X)
    begin = onset + np.interp(onset, X, force) / slider.stiffness
    drives = np.array([begin, drive, 2.0 * drive - begin])
    # Without inertia the slider lands where the line of the spring meets the force
    # again.
    landing = X[(X_star + 1e-3 < X) & (slider.stiffness * (drive - X) < force)][0]
    potential = [theory.effective_potential(slider, X, force, d) for d in drives]
    never = list(first_instability(FIG5.interface, slider.stiffness))
    return dataset(
        {
            "friction_force": run["friction_force"],
            "K_eff": (-run["stiffness"], "effective stiffness, per contact [k]"),
            "V_eff": (
                ("drive", "displacement"),
                potential,
                "effective potential, per contact [f_s x_s]",
            ),
            "point": (
                "which",
                [onset, X_star, landing],
                "where contacts start to break, instability, landing [x_s]",
            ),
            "never": (
                "body",
                never,
                "slider and drive at the instability, without re-attachment [x_s]",
            ),
            "K_critical": (
                ss.critical_stiffness(interface),
                "critical stiffness, per contact [k]",
            ),
        },
        {"drive": (drives, "position of the drive [x_s]")},
        stiffness=slider.stiffness,
    )


def _claims_2(data: xr.Dataset) -> Iterator[Claim]:
    K = float(data.attrs["stiffness"])
    K_eff = data["K_eff"].values
    critical = float(data["K_critical"])
    yield claim_from(
        None,
        (
            "a spring softer than K* is unstable where K_eff(X) > K, from X* on; a "
            "stiffer "
            "one never is"
        ),
        near("X*, no re-attachment", data["never"][0], 0.9247, 1e-4, "x_s"),
        near("v_d t*, no re-attachment", data["never"][1], 1.2820, 1e-4, "x_s"),
        near("largest K_eff on the curve", K_eff.max(), CRITICAL_STIFFNESS, 0.003, "k"),
        printed=bool(np.any(K_eff > K))
        and not np.any(K_eff > STIFF)
        and STIFF > critical > K,
        evidence=(
            f"first root of K_eff(X) = {K:g} k; K_eff(X) against {STIFF:g} k over "
            f"0 to {_WAY:g} x_s"
        ),
    )

    _, unstable, landing = data["point"].values
    X = data["displacement"].values
    V = data["V_eff"].values
    # near the peak of the force
    wells = np.count_nonzero(np.diff(np.sign(np.diff(V[:, landing > X]))) > 0, axis=1)
    bend = np.diff(V[1], 2) / (X[1] - X[0]) ** 2 - (K - K_eff[1:-1])
    yield claim_from(
        None,
        (
            "the slider rests in a well of V_eff, which bends as K + dF_c/dX and is "
            "gone "
            "at the instability"
        ),
        near("wells of V_eff at point 1", wells[0], 1, 0),
        near(
            "wells this side of the landing, as far after the instability",
            wells[-1],
            0,
            0,
        ),
        at_most(
            "curvature of V_eff less K + dF_c/dX, largest", abs(bend).max(), 1e-3, "k"
        ),
        at_least("landing less instability", landing - unstable, 0.1, "x_s"),
        evidence=(
            "V_eff by Eq. (5) at three positions of the drive, its second "
            "differences, and Eq. (6)"
        ),
    )


def _drawing_2(picture: Picture, data: xr.Dataset) -> None:
    """Elastic instability.

    A slider on a spring, quasi-statically: forces, effective potential, Eq. (5), and
    effective stiffness, Eq. (7). The slider jumps where the friction force decreases
    more steeply than the spring can follow.
    """
    K = float(data.attrs["stiffness"])
    critical = float(data["K_critical"])
    drives = data["drive"].values
    left, right = picture.subplots(1, 2, width_ratios=(1.3, 1.0))
    _draw_potential(left.inset_axes((0.66, 0.64, 0.34, 0.36)), data)
    data = data.sel(displacement=slice(0.0, 1.6))
    X = data["displacement"]
    force = data["friction_force"]
    K_eff = data["K_eff"]
    begin, at, landing = data["point"].values
    left.plot(X, force, color=BLUE)
    left.text(0.33, 0.41, r"$F_\mathrm{c}(X)$", color=BLUE, ha="right")
    for name, point, end, drive, colour, style, offset in (
        ("1", begin, (-0.22, 0.16), drives[0], GREY, "--", (-12, 1)),
        (
            "2",
            at,
            (-0.16, min(0.42, drives[1] - at)),
            drives[1],
            VERMILLION,
            "-",
            (6, 3),
        ),
    ):
        line = point + np.array(end)
        left.plot(
            line, K * (drive - line), color=colour, linestyle=style, linewidth=1.0
        )
        _draw_point(
            left, name, (point, float(force.interp(displacement=point))), offset, colour
        )
    left.plot(
        landing,
        force.interp(displacement=landing),
        "o",
        mfc="white",
        color=VERMILLION,
        markersize=5,
    )
    left.text(1.08, 0.49, r"$K(v_\mathrm{d}t^* - X)$", color=VERMILLION)
    panel(left, rf"(a) $K$ = {K:g} $k$", X, force, xlim=(0, 1.6), ylim=(0, 1.1))

    right.plot(X, K_eff, color=BLUE)
    for value, text, colour in (
        (STIFF, rf"$K$ = {STIFF:g} $k$: stiff", GREEN),
        (critical, rf"$K^*$ = {critical:.3f} $k$", BLACK),
        (K, rf"$K$ = {K:g} $k$: soft", VERMILLION),
    ):
        right.axhline(value, color=colour, linewidth=0.9, linestyle=DASHED)
        right.text(0.02, value + 0.08, text, color=colour, fontsize=8)
    right.fill_between(
        X, K, K_eff, where=K_eff > K, color=VERMILLION, alpha=0.25, linewidth=0
    )
    _draw_point(right, "2", (at, K), (-9, 3), VERMILLION)
    panel(
        right,
        r"(b) $K_\mathrm{eff} = -\mathrm{d}F_\mathrm{c}/\mathrm{d}X$",
        X,
        K_eff,
        xlim=(0, 1.6),
        ylim=(-1.2, 5.6),
    )


def _draw_point(
    ax: Axes,
    name: str,
    at: tuple[float, float],
    offset: tuple[float, float],
    colour: str,
) -> None:
    ax.plot(*at, "o", color=colour, markersize=5, zorder=3)
    ax.annotate(
        name,
        at,
        xytext=offset,
        textcoords="offset points",
        color=colour,
        fontweight="bold",
    )


def _draw_potential(ax: Axes, data: xr.Dataset) -> None:
    """Draw the effective potential before, at and after the instability, with the
    slider in its well.
    """
    V = data["V_eff"] - data["V_eff"].interp(displacement=float(data["point"][1]))
    before, at, _ = data["point"].values
    names = (
        (GREY, "$t < t^*$", before),
        (VERMILLION, "$t^*$", at),
        (BLACK, "$t > t^*$", np.nan),
    )
    for i, (colour, name, rests) in enumerate(names):
        line = V.sel(displacement=slice(0.55, 1.35))[i] - 0.09 * i
        ax.plot(line["displacement"], line, color=colour, linewidth=1.0)
        ax.text(1.38, float(line[-1]), name, color=colour, fontsize=7, va="center")
        ax.plot(
            rests,
            np.interp(rests, line["displacement"], line),
            "o",
            color=colour,
            markersize=4,
        )
    ax.set(xticks=[0.6, 0.9, 1.2], yticks=[], xlim=(0.5, 1.72))
    ax.tick_params(labelsize=7)
    ax.set_xlabel(r"$X$ ($x_\mathrm{s}$)", fontsize=7, labelpad=1)
    ax.set_ylabel(r"$V_\mathrm{eff}$", fontsize=7, labelpad=1)


# ``K*/N`` as the paper prints it, for standard deviations .1 of thresholds and .01 at
# the start
_PRINTED = 3.59
_PAPER = {"initial_std": 0.01, "threshold_std": 0.1}

# Cases in which stick-slip is searched: threshold standard deviation, delay, start,
# duration, and whether it is found.
_RUNS: dict[str, tuple[float, float, Start, float, bool]] = {
    "narrow thresholds, narrow start, delay .12": (
        0.1,
        0.12,
        ss.FromRest(),
        120.0,
        True,
    ),
    "narrow thresholds, steady start, delay .12": (
        0.1,
        0.12,
        ss.FromSliding(perturbation=0.05),
        120.0,
        False,
    ),
    "narrow thresholds, narrow start, delay .2": (0.1, 0.2, ss.FromRest(), 120.0, True),
    "narrow thresholds, steady start, delay .2": (
        0.1,
        0.2,
        ss.FromSliding(perturbation=0.05),
        320.0,
        True,
    ),
    "wide thresholds, narrow start, delay .2": (0.3, 0.2, ss.FromRest(), 120.0, False),
}
_EVALUATED = 60.0  # time units evaluated at the end of a run


def _data_3(progress: Progress, quick: bool) -> xr.Dataset:
    initial = [0.0, 0.01, 0.05, 0.1, 0.2, 0.3]
    fine = np.r_[0.02, 0.025, 0.03:0.095:0.01, 0.1:0.51:0.025]
    stds = fine.round(4).tolist()
    if quick:
        initial = [0.0, 0.01, 0.1, 0.3]
        stds = [0.02, 0.05, 0.1, 0.2, 0.3]
    pairs = {"initial_std": initial, "threshold_std": stds}

    def critical(how: str, initial: float, threshold: float) -> float:
        return ss.critical_stiffness(
            interface(initial, threshold), reattachment=how == "at once"
        )

    def run(name: str, progress: Progress) -> dict[str, Any]:
        std, delay, start, duration, _ = _RUNS[name]
        drive = ss.constant(FIG4.velocity, duration)
        rig = FIG4.rig.replace(
            interface=interface(threshold=std, delay=ss.Delay(delay)), drive=drive
        )
        method = ss.MasterEquation(rtol=1e-3 if quick else 1e-4)
        seen = ss.regime(
            ss.simulate(rig, method=method, start=start, progress=progress),
            after=duration - _EVALUATED,
        )
        return {"kind": seen.kind, "peak_to_peak": seen.peak_to_peak}

    steady = table(
        lambda std: ss.critical_stiffness(interface(None, std)), threshold_std=stds
    )
    estimate = table(
        lambda *pair: theory.critical_stiffness_estimate(interface(*pair)), **pairs
    )
    rigs = [FIG4.rig.replace(interface=interface(threshold=std)) for std in (0.1, 0.3)]
    delays = [ss.stability.onset(rig, "delay", between=(1e-3, 1e2)) for rig in rigs]
    stiffness = table(critical, reattachment=("at once", "never"), **pairs)
    seen = grid(run, progress, run=_RUNS)
    return dataset(
        {
            "critical_stiffness": (stiffness, "critical stiffness, per contact [k]"),
            "critical_stiffness_steady": (
                steady,
                "critical stiffness from the steady state, per contact [k]",
            ),
            "critical_stiffness_estimate": (
                estimate,
                "estimate of the critical stiffness, per contact [k]",
            ),
            "kind": seen["kind"],
            "peak_to_peak": (
                seen["peak_to_peak"],
                "peak to peak of the spring force at the end, per contact [f_s]",
            ),
            "linear_critical_delay": (
                "width",
                delays,
                "delay from which steady sliding is unstable [time]",
            ),
        },
        {
            "threshold_std": (
                stds,
                r"standard deviation of thresholds $\Delta f_\mathrm{s}$ [f_s]",
            )
        },
    )


def _claims_3(data: xr.Dataset) -> Iterator[Claim]:
    yield _claim_5(data)
    yield _claim_6(data)
    yield _claim_18(data)


def _claim_5(data: xr.Dataset) -> Claim:
    K = data["critical_stiffness"].sel(reattachment="at once")
    slope = power([0.02, 0.05], K.sel(initial_std=0.0, threshold_std=[0.02, 0.05]))
    estimate = data["critical_stiffness_estimate"].sel(_PAPER)
    settled = {
        (0.0, 0.1): 3.009,
        (0.1, 0.1): 1.828,
        (0.01, 0.2): 1.033,
        (0.01, 0.3): 0.438,
    }
    return claim_from(
        5,
        "K* decreases with the standard deviation of the thresholds and of the initial "
        "forces; it is largest "
        "for a delta start and zero from the steady state; roughly K* = N k f_s/(Df_s "
        "+ Df_0)",
        at_most(
            "largest change of K* from one Df_s to the next",
            K.diff("threshold_std").max(),
            0.0,
            "k",
        ),
        at_most(
            "largest change of K* from one Df_0 to the next",
            K.diff("initial_std").max(),
            0.0,
            "k",
        ),
        at_most(
            "K* from the steady state",
            data["critical_stiffness_steady"].max(),
            1e-6,
            "k",
        ),
        near("Eq. (9), Df_0 = .01, Df_s = .1", estimate, 9.09, 0.01, "k"),
        near("power of Df_s in K*, delta start, .02 to .05", slope, -1.0, 0.15),
        *(
            near(f"K*, Df_0 = {i:g}, Df_s = {t:g}", K.loc[i, t], value, 0.003, "k")
            for (i, t), value in settled.items()
        ),
        printed=bool(abs(estimate / K.sel(_PAPER) - 1.0) < 0.5),
        reading="Eq. (9) gives the scaling of K* for narrow distributions, K* ~ "
        "1/width, not its value, which is three "
        "times too large here; K* decreases throughout for standard deviations of "
        "initial forces up to "
        f"{float(K['initial_std'].max()):g}",
        evidence=(
            f"Eq. (8) for {K.size} pairs of standard deviations; K_eff is an "
            "integral, no numerical derivative"
        ),
    )


def _claim_6(data: xr.Dataset) -> Claim:
    at_once, never = data["critical_stiffness"].sel(_PAPER).values.tolist()
    return claim_from(
        6,
        f"K*/N = {_PRINTED} k for Df_s = .1 and Df_0 = .01",
        near("K*, contacts re-attach at once", at_once, CRITICAL_STIFFNESS, 0.003, "k"),
        near(
            "K*, contacts never re-attach", never, CRITICAL_STIFFNESS_NEVER, 0.003, "k"
        ),
        # half a unit of the last printed digit
        printed=any(abs(K - _PRINTED) <= 0.005 for K in (at_once, never)),
        exact=(
            f"{CRITICAL_STIFFNESS} k if broken contacts re-attach at once, "
            f"{CRITICAL_STIFFNESS_NEVER} k if never"
        ),
        evidence=(
            "largest K_eff by Eq. (8); the figure printed is 1 % off the nearer "
            "of the two"
        ),
    )


def _claim_18(data: xr.Dataset) -> Claim:
    narrow, wide = data["linear_critical_delay"].values
    sticks = data["kind"].to_series() == "stick-slip"
    return claim_from(
        18,
        "wide thresholds, or a start in the steady state, avoid stick-slip",
        *(
            between(
                f"peak to peak F_d, {name}",
                value,
                *((0.5, math.inf) if found else (-math.inf, 0.02)),
                "f_s",
            )
            for (name, (*_, found)), value in zip(
                _RUNS.items(), data["peak_to_peak"], strict=True
            )
        ),
        near("linear critical delay, Df_s = .1", narrow, 0.1455, 0.0002, "time"),
        between("linear critical delay, Df_s = .3", wide, 0.9, 0.96, "time"),
        printed=bool((sticks == ~sticks.index.str.contains("wide|steady")).all()),
        reading="a steady start stays smooth while the delay is below the linear "
        f"critical delay ({narrow:.4f}), "
        "where smooth sliding and stick-slip are both stable; above it any disturbance "
        "grows into stick-slip",
        evidence="runs of the master equation at K = 2 k, eta = 200, v_d = 1, "
        "evaluated over their last "
        f"{_EVALUATED:g} time units; steady starts perturbed by 5 % in velocity",
    )


def _drawing_3(picture: Picture, data: xr.Dataset) -> None:
    """Critical stiffness.

    Critical stiffness, Eq. (8), against the standard deviation of the thresholds, for
    several of the initial forces: (a) broken contacts re-attach at once, (b) they never
    do. Dotted: the estimate of Eq. (9). Cross: the value that the paper prints.
    """
    axes = picture.subplots(1, 2, sharey=True)
    std = data["threshold_std"]
    titles = (
        "(a) broken contacts re-attach at once",
        "(b) broken contacts never re-attach",
    )
    for ax, K, title, offset in zip(
        axes, data["critical_stiffness"], titles, ((7, -3), (8, 3)), strict=True
    ):
        for line in K:
            ax.plot(std, line, label=f"{float(line['initial_std']):g}")
        guess = data["critical_stiffness_estimate"].sel(initial_std=0.01)
        ax.plot(
            std,
            guess,
            color=GREY,
            linestyle=":",
            label=r"$1/(\Delta f_\mathrm{s} + 0.01)$, scaling",
        )
        exact = float(K.sel(_PAPER))
        ax.plot(
            0.1,
            exact,
            "o",
            color=PALETTE[1],
            markersize=5,
            label="exact, Figs. 4 to 7",
        )
        ax.plot(
            0.1,
            _PRINTED,
            "x",
            color=BLACK,
            markersize=6,
            label=f"{_PRINTED}, as printed",
        )
        ax.annotate(
            f"{exact:.3f}",
            (0.1, exact),
            xytext=offset,
            textcoords="offset points",
            fontsize=8,
        )
        # A tick at .5 would meet that of the neighbouring panel.
        panel(
            ax,
            title,
            std,
            K.assign_attrs(spacing="log"),
            xlim=(0, 0.5),
            xticks=[0, 0.1, 0.2, 0.3, 0.4],
        )
        ax.set_ylim(0.03, 40)
        ax.label_outer()
    handles, names = axes[0].get_legend_handles_labels()
    count = data.sizes["initial_std"]
    initial = rf"$\Delta f_0$ ({plot.unit_text('f_s')})"
    above = {"loc": "upper right", "title_fontsize": 8}
    axes[1].legend(handles[:count], names[:count], title=initial, ncols=2, **above)
    axes[0].legend(handles[count:], names[count:], **above)


_TRACES = ["displacement", "velocity", "spring_force", "friction_force"]
_DAMPINGS = {
    "200": FIG5.slider.damping,
    "0.3 Omega": 0.3 * FIG5.slider.frequency,
    "0": 0.0,
}
"""Damping of the sliders of Fig. 5 and of Figs. 6 and 7, and none."""
# largest Omega dt at which Eq. (12), the first terms of a series in it, can be valid
_AROUND = 1.0


def _data_5(progress: Progress, quick: bool) -> xr.Dataset:
    first, second = portions(progress, 1.0, 3.0)
    X_star, drive = first_instability(FIG5.interface, FIG5.slider.stiffness)
    phase = np.linspace(0.0, 6.0, 121)
    elapsed = phase / FIG5.slider.frequency

    def run(method: Method, damping: float, progress: Progress) -> xr.Dataset:
        rig = FIG5.rig.replace(damping=damping, drive=ss.constant(FIG5.velocity, 1.6))
        output = ss.Output(interval=2e-4 if quick else 5e-5)
        return ss.simulate(rig, method=method, output=output, progress=progress)[
            _TRACES
        ]

    def slip(damping: str, progress: Progress) -> dict[Any, Any]:
        made = run(
            ss.MasterEquation(rtol=1e-4 if quick else 1e-5),
            _DAMPINGS[damping],
            progress,
        )
        passed = _passes(made, X_star)
        gone = made["displacement"].interp(time=passed + elapsed).values - X_star
        velocities = float(made["velocity"].interp(time=passed)), FIG5.velocity
        eq_12 = [
            theory.slip_displacement(FIG5.slider, velocity, elapsed)
            for velocity in velocities
        ]
        return dict(made) | {
            "passed": passed,
            "slip": ("phase", gone),
            "eq_12": (("velocity_of", "phase"), eq_12),
        }

    contacts = run(
        ss.Contacts(FIG5.contacts if quick else 100 * FIG5.contacts, seed=5),
        FIG5.slider.damping,
        first,
    )
    seen = grid(slip, second, damping=_DAMPINGS)
    solvers = xr.concat(
        [seen[_TRACES].sel(damping="200", drop=True), contacts], "solver"
    )
    return dataset(
        dict(solvers)
        | {
            "velocity": (solvers["velocity"], "velocity of the slider [v_d]"),
            "slip": (seen["slip"], "displacement since the instability [x_s]"),
            "eq_12": (
                seen["eq_12"],
                "displacement by Eq. (12), the velocity that of slider or drive [x_s]",
            ),
            "passed": (seen["passed"], "time at which the slider passes X* [time]"),
            "X_star": (X_star, "displacement at the quasi-static instability [x_s]"),
            "t_star": (
                drive / FIG5.velocity,
                "time of the quasi-static instability [time]",
            ),
        },
        {
            "solver": ["master equation", "contacts"],
            "damping": (list(_DAMPINGS), "damping eta, in v_d/x_s"),
            "phase": (phase, "time since the instability, times Omega [1]"),
            "velocity_of": ["slider", "drive"],
        },
    )


def _passes(run: xr.Dataset, X: float) -> float:
    """Return the time at which the slider first passes a position."""
    return float(
        np.interp(X, np.maximum.accumulate(run["displacement"].values), run["time"])
    )


def _claims_5(data: xr.Dataset) -> Iterator[Claim]:
    start = data.sel(phase=slice(0.02, _AROUND))
    ratio = start["slip"] / start["eq_12"]
    errors = abs(ratio.sel(velocity_of="slider") - 1.0).max("phase").to_series()
    factors = ratio.sel(velocity_of="drive").max("phase").to_series()
    measured: list[Measured] = []
    for solver in data["solver"].values:
        run = data.sel(solver=solver)
        passed = _passes(run, 0.9247)
        surplus = (run["spring_force"] - run["friction_force"]).max()
        for name, value, exact, tolerance, unit in (
            ("time at which X passes .9247", passed, 1.309, 0.004, "time"),
            ("largest velocity", run["velocity"].max(), 14.4, 0.4, "v_d"),
            ("largest F_d - F_c", surplus, 0.3155, 0.003, "f_s"),
        ):
            words = f"{name}, {solver}"
            measured.append(near(words, value, exact, tolerance, unit))
    early = "Omega dt <= 1"
    yield claim_from(
        8,
        "after the instability the slider moves by v_d dt [1 + (Omega dt)^2/6]",
        near("X*, quasi-static", data["X_star"], 0.9247, 1e-4, "x_s"),
        near("t*, quasi-static", data["t_star"], 1.2820, 1e-4, "time"),
        *measured,
        *(
            at_most(f"error of Eq. (12), actual velocity, {early}, eta {eta}", x, 0.1)
            for eta, x in errors.items()
        ),
        *(
            between(f"slip over Eq. (12) as printed, {early}, eta {eta}", x, 2.0, 3.5)
            for eta, x in factors.items()
        ),
        printed=bool(factors.max() <= 1.1),
        reading="with the slider's velocity when it passes X*, 2 to 3 v_d, in place of "
        "v_d, and for Omega dt <= 1; "
        f"as printed it is too small by a factor {factors.min():.2g} to "
        f"{factors.max():.2g}",
        evidence=(
            "runs with dampings 200, .3 Omega and 0, from the moment when X passes X*"
        ),
    )


def _drawing_5(picture: Picture, data: xr.Dataset) -> None:
    """At and after the elastic instability.

    The first slip, with contacts that never re-attach, by contacts and by the master
    equation, and the displacement after the instability beside Eq. (12).
    """
    (forces, position), (velocity, ratio) = picture.subplots(2, 2)
    run = data.sel(solver="master equation", time=slice(0.9, 1.5))
    t = run["time"]
    t_star = float(data["t_star"])
    X_star = float(data["X_star"])
    passed = float(data["passed"][0])
    within = {"xlim": (0.9, 1.5)}

    surplus = run["spring_force"] - run["friction_force"]
    forces.plot(t, run["spring_force"], color=BLUE, label=r"$F_\mathrm{d}$")
    forces.plot(t, run["friction_force"], color=VERMILLION, label=r"$F_\mathrm{c}$")
    forces.plot(t, surplus, color=BLACK, label=r"$F_\mathrm{d} - F_\mathrm{c}$")
    panel(
        forces,
        "(a)",
        t,
        run["spring_force"].assign_attrs(long_name="force per contact"),
        "above",
        **within,
    )

    position.plot(t, run["displacement"], color=GREEN)
    after = passed + data["phase"] / FIG5.slider.frequency
    actual, printed = X_star + data["eq_12"][0]
    position.plot(
        after,
        actual,
        color=BLACK,
        linestyle=DASHED,
        label="Eq. (12), actual velocity",
    )
    position.plot(
        after,
        printed,
        color=ORANGE,
        linestyle=":",
        label=r"Eq. (12), $v_\mathrm{d}$, as printed",
    )
    position.plot(passed, X_star, "o", color=GREEN, markersize=4)
    position.annotate(
        "$X^*$", (passed, X_star), xytext=(6, -9), textcoords="offset points"
    )
    panel(
        position,
        "(b)",
        t,
        data["displacement"],
        "upper left",
        **within,
        ylim=(0.5, 1.7),
    )

    velocity.plot(t, run["velocity"], color=GREEN)
    panel(velocity, "(c)", t, data["velocity"], **within)
    for ax in (forces, position, velocity):
        ax.axvline(t_star, color=GREY, linewidth=0.8, linestyle="--")
    forces.text(t_star - 0.01, 0.45, "$t^*$", ha="right", color=GREY)

    names = (r"$\eta$ = 200", r"$\eta$ = 0.3 $\Omega$", r"$\eta$ = 0")
    late = data.sel(phase=slice(0.02, None))
    slips = (late["slip"] / late["eq_12"]).transpose("damping", "velocity_of", "phase")
    for (actual, printed), colour, name in zip(slips, PALETTE, names, strict=False):
        ratio.plot(late["phase"], actual, color=colour, label=name)
        ratio.plot(late["phase"], printed, color=colour, linestyle="--")
    ratio.axhspan(0.9, 1.1, color=GREY, alpha=0.25, linewidth=0)
    ratio.text(
        0.08,
        -0.24,
        "solid: with the actual velocity\n" r"dashed: with $v_\mathrm{d}$, as printed",
        fontsize=8,
        va="bottom",
        linespacing=1.3,
    )
    x = r"$\Omega\,\Delta t$ since the instability"
    y = "slip, in terms of Eq. (12)"
    panel(ratio, "(d)", x, y, "above", xlim=(0, 6), ylim=(-0.3, 4))


FIGURES = (
    Figure("fig1", 3.6, _data_1, _claims_1, _drawing_1),
    Figure("fig2", 3.3, _data_2, _claims_2, _drawing_2),
    Figure("fig3", 3.6, _data_3, _claims_3, _drawing_3),
    Figure("fig5", 5.4, _data_5, _claims_5, _drawing_5),
)
