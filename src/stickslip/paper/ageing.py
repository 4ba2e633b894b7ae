"""Figures 8 and 11: stick-slip of ageing contacts against the rate of ageing, and their
effective stiffness.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy import optimize

import stickslip as ss
from stickslip import theory
from stickslip.model import Method, Start
from stickslip.paper.cases import FIG8, FIG11, aged
from stickslip.paper.figure import Claim, Figure, at_most, between, claim_from, near
from stickslip.paper.kit import (
    Array,
    Picture,
    Progress,
    dataset,
    grid,
    panel,
    portions,
    shade,
    table,
)
from stickslip.paper.ramps import LEVEL, V1_SCALED, V2_SCALED, ramped
from stickslip.plot import BLACK, BLUE, GREEN, GREY, PALETTE, SKY, VERMILLION

# Relaxed contacts have short stretchings and thresholds of the stationary distribution.
_STARTS: dict[str, Start] = {"relaxed": ss.FromRest(), "smooth": ss.FromSliding()}
_METHODS: dict[str, Method] = {
    "contacts": ss.Contacts(FIG8.contacts, seed=8),
    "kinetic equation": ss.MasterEquation(),
}
_SHOWN = {0.7: BLUE, 0.9: SKY, 1.5: VERMILLION, 2.0: GREEN}
# number of thresholds drawn, and of bins of their histogram
_COUNT = 100_000
_BINS = 60


def _data_8(progress: Progress, quick: bool) -> xr.Dataset:
    rates = (
        (0.7, 1.5, 2.0) if quick else (0.6, 0.7, 0.9, 1.0, 1.2, 1.5, 1.8, 2.0, 2.5, 4.0)
    )
    duration = 12.0 if quick else 30.0

    def run(solver: str, rate: float, start: str, progress: Progress) -> dict[str, Any]:
        rig = aged(FIG8, rate).replace(drive=ss.constant(FIG8.velocity, duration))
        made = ss.simulate(
            rig,
            method=_METHODS[solver],
            output=ss.Output(interval=0.005),
            start=_STARTS[start],
            progress=progress,
        )
        late = made["spring_force"].sel(time=slice(0.5 * duration, None))
        return {
            "spring_force": made["spring_force"],
            "amplitude": late.max() - late.min(),
        }

    seen = grid(run, progress, solver=_METHODS, rate=rates, start=_STARTS)
    edges = [
        edge.value**-0.5
        for edge in ss.critical(FIG8.rig, ss.stability.AGEING, between=(0.2, 3.0)).edges
    ]
    f, distribution, aged_at_rest = _at_rest()
    return dataset(
        {
            "spring_force": seen["spring_force"],
            "amplitude": (seen["amplitude"], "peak to peak of $F_d$ [f_s]"),
            "unstable": (
                "end",
                sorted(edges),
                "where smooth sliding is unstable (linear) [1/sqrt(time)]",
            ),
            "P_c": (
                "f",
                distribution,
                "stationary distribution of thresholds, Eq. (17) [1/f_s]",
            ),
            "P_c_seen": (
                "f",
                aged_at_rest,
                "the same, of contacts aged at rest [1/f_s]",
            ),
        },
        {"f": (f, "threshold [f_s]")},
    )


def _at_rest() -> tuple[Array, Array, Array]:
    """Return thresholds; their distribution, Eq. (17); and the histogram of contacts
    aged at rest by Eq. (13), in small steps.
    """
    # time step in 1/rate^2; it makes the standard deviation too large by a quarter of
    # it
    step = 0.01
    rng = np.random.default_rng(13)
    thresholds = np.zeros(_COUNT)
    stationary = FIG8.interface.threshold_distribution
    mean = stationary.moment(1)
    std = stationary.standard_deviation()
    for _ in range(round(10.0 / step)):
        thresholds += (mean - thresholds) * step + std * math.sqrt(
            2.0 * step
        ) * rng.standard_normal(_COUNT)
    seen, edges = np.histogram(thresholds, _BINS, (0.5, 1.5), density=True)
    middle = 0.5 * (edges[1:] + edges[:-1])
    return middle, stationary.density(middle), seen


# rate of ageing, start, and the band of the peak to peak there
_OSCILLATIONS = (
    (0.7, "relaxed", -math.inf, 0.05),
    (0.7, "smooth", -math.inf, 0.05),
    (0.9, "relaxed", 0.36, 0.46),
    (1.5, "relaxed", 1.20, 1.28),
    (1.5, "smooth", 1.20, 1.28),
    (2.0, "relaxed", 1.17, 1.26),
    (2.0, "smooth", -math.inf, 0.12),
)


def _claims_8(data: xr.Dataset) -> Iterator[Claim]:
    f = data["f"].values
    exact = data["P_c"].values
    seen = data["P_c_seen"].values
    width = float(f[1] - f[0])
    mean = float(np.sum(f * seen) * width)
    std = math.sqrt(float(np.sum((f - mean) ** 2 * seen) * width))
    apart = float(np.max(np.abs(np.cumsum(seen - exact)) * width))
    # With 1e5 contacts the standard errors are 3e-4, 2e-4 and at most 1.6e-3 (half of
    # 1e5**-.5); bin width**2/12 is Sheppard's correction of the variance.
    yield claim_from(
        13,
        "the ageing model thresholds is stationary and Gaussian, Eqs. (13)-(17)",
        near("mean threshold", mean, 1.0, 1.6e-3, "f_s"),
        near(
            "standard deviation of the thresholds",
            std,
            math.sqrt(0.01 + width**2 / 12.0),
            1.1e-3,
            "f_s",
        ),
        at_most("largest distance of the cumulative distributions", apart, 6e-3),
        evidence="100000 newborn contacts without strength, ten ageing times at rest",
    )

    oscillation = data["amplitude"]
    low, high = data["unstable"].values
    measured = [
        near("smooth sliding unstable from beta (linear)", low, 0.80, 0.03),
        near("smooth sliding unstable up to beta (linear)", high, 1.63, 0.03),
    ]
    periods = []
    for solver in _METHODS:
        for rate, start, least, most in _OSCILLATIONS:
            if rate in data["rate"]:
                words = f"peak to peak F_d at beta = {rate:g}, {start} start, {solver}"
                value = oscillation.sel(solver=solver, rate=rate, start=start)
                measured.append(between(words, value, least, most, "f_s"))
        run = data["spring_force"].sel(
            solver=solver, rate=1.5, start="relaxed", time=slice(5.0, None)
        )
        measured.append(
            between(
                f"largest F_d at beta = 1.5, {solver}", run.max(), 0.73, 0.77, "f_s"
            )
        )
        periods.append(ss.measure.find_cycles(run["time"].values, run.values).period)
    yield claim_from(
        14,
        "stick-slip for 1 <= beta <= 1.6, smooth sliding below and above",
        *measured,
        between("period at beta = 1.5, contacts", periods[0], 1.95, 2.05, "time"),
        near(
            "the same, kinetic equation over contacts",
            periods[1] / periods[0],
            1.0,
            0.03,
        ),
        printed=bool((oscillation.sel(rate=2.0) < 0.12).all()),  # from either start
        reading=f"from steady smooth sliding, which is unstable for beta of {low:.2f} "
        f"to {high:.2f}; the oscillation "
        "grows gradually from the lower edge on, and from relaxed contacts stick-slip "
        "persists up to beta of 3 or more",
        evidence=(
            f"{FIG8.contacts} contacts and the kinetic equation, from both "
            "starts; linear stability"
        ),
    )


def _drawing_8(picture: Picture, data: xr.Dataset) -> None:
    """Stick-slip against the rate of ageing.

    Spring force of ageing contacts at four rates of ageing, from relaxed contacts (a)
    and from smooth sliding (b); thresholds of contacts aged at rest beside Eq. (17)
    (c); peak to peak of the force against the rate of ageing (d). Grey: smooth sliding
    is linearly unstable.
    """
    axes = picture.subplot_mosaic(
        "ad;bd;cd", width_ratios=(1.25, 1.0), gridspec_kw={"hspace": 0.02}
    )
    _draw_forces([axes["a"], axes["b"]], data)
    _draw_thresholds(axes["c"], data)
    _draw_oscillation(axes["d"], data)


def _draw_forces(axes: Sequence[Axes], data: xr.Dataset) -> None:
    """Draw the spring force at several rates of ageing, the starts below each other."""
    titles = {
        "relaxed": "(a) from relaxed contacts",
        "smooth": "(b) from smooth sliding",
    }
    for row, (start, title) in enumerate(titles.items()):
        ax = axes[row]
        for rate, colour in _SHOWN.items():
            if rate in data["rate"]:
                force = data["spring_force"].sel(
                    solver="contacts", rate=rate, start=start, time=slice(0.0, 10.0)
                )
                ax.plot(
                    force["time"],
                    force,
                    color=colour,
                    linewidth=0.8,
                    label=rf"$\beta$ = {rate:g}",
                )
        panel(
            ax,
            title,
            data["time"] if row else None,
            data["spring_force"],
            xlim=(0.0, 10.0),
            ylim=(-0.6, 1.45),
            yticks=(-0.5, 0.0, 0.5, 1.0),
        )
        ax.legend(
            loc="upper right",
            ncols=4,
            handlelength=1.0,
            columnspacing=0.8,
            borderaxespad=0.0,
        )
        ax.tick_params(labelbottom=row == 1)


def _draw_thresholds(ax: Axes, data: xr.Dataset) -> None:
    """Draw the thresholds of contacts aged at rest beside those of Eq. (17)."""
    edges = np.linspace(0.5, 1.5, _BINS + 1)
    ax.stairs(
        data["P_c_seen"],
        edges,
        fill=True,
        color=SKY,
        label="contacts aged at rest",
    )
    ax.plot(data["f"], data["P_c"], color=BLACK, label="Eq. (17)")
    panel(
        ax,
        "(c) thresholds at rest",
        data["f"],
        r"density (1/$f_\mathrm{s}$)",
        "upper left",
        xlim=(0.15, 1.5),
    )


def _draw_oscillation(ax: Axes, data: xr.Dataset) -> None:
    """Draw peak to peak of the force against the rate of ageing."""
    shade(ax, data["unstable"], "smooth\nsliding\nunstable", 0.04)
    marks = (("contacts", "o", "-"), ("kinetic equation", "x", "none"))
    starts = (
        ("relaxed", VERMILLION, "from relaxed contacts"),
        ("smooth", BLUE, "from sliding"),
    )
    for start, colour, words in starts:
        for solver, mark, line in marks:
            amplitude = data["amplitude"].sel(start=start, solver=solver)
            ax.plot(
                data["rate"],
                amplitude,
                mark,
                linestyle=line,
                color=colour,
                markersize=4,
                linewidth=0.8,
            )
        ax.plot([], [], color=colour, label=words)
    for solver, mark, _ in marks:
        ax.plot([], [], mark, color=GREY, markersize=4, label=solver)
    panel(
        ax,
        "(d) oscillation of the force",
        data["rate"],
        data["amplitude"],
        "upper right",
        xlim=(0.5, None),
        ylim=(0.0, 1.6),
    )


_CONVERGED = {0.1: 3.309, 0.3: 2.260, 0.5: 0.9205, 0.8: 0.1122}
"""Steepest slopes at several velocities, converged in the grids of margins, ages and
displacement.
"""
_DISTANCE = 1.6
_SPACING = 0.0025
_FAST = 20.0  # velocity at which contacts hold a thousandth of their force at rest
_EACH_WAY = 200.0


def _pulled(velocity: float) -> xr.DataArray:
    """Return the force of contacts that are all newborn at the start of a slider of
    constant velocity, against its displacement.
    """
    X, force = theory.newborn_pull(
        FIG11.interface, velocity, _DISTANCE, round(_DISTANCE / _SPACING)
    )
    return xr.DataArray(force, {"displacement": X}, ("displacement",))


def _steepest(force: xr.DataArray) -> float:
    """Return the steepest decrease of the force: our ``K_eff(v)``, which the paper does
    not define.
    """
    F = force.values
    return float(np.max(F[:-2] - F[2:])) / (2.0 * _SPACING)


def _data_11(progress: Progress, quick: bool) -> xr.Dataset:
    velocities = (
        list(_CONVERGED) if quick else np.round(np.arange(0.05, 1.21, 0.05), 2).tolist()
    )
    count = 4_000 if quick else 100_000
    first, second = portions(progress, 1.0, 1.0)
    crossing = optimize.brentq(
        lambda v: _steepest(_pulled(v)) - FIG11.slider.stiffness, 0.3, 0.8, xtol=1e-5
    )
    curves = table(_pulled, velocity=velocities)

    def checked(v: float, _: Progress) -> dict[str, Any]:
        run = ss.velocity_step(
            FIG11.interface,
            method=ss.Contacts(count, seed=11),
            before=_FAST,
            after=v,
            distance=_DISTANCE,
            points=curves.shape[1],
        )
        force = np.interp(
            curves["displacement"], run["displacement"], run["friction_force"]
        )
        return {"F_contacts": ("displacement", force)}

    newborns = grid(checked, first, checked=_CONVERGED)["F_contacts"]
    rig = FIG11.rig.replace(drive=ss.ramp(0.05, 1.8, _EACH_WAY))
    run = ramped(rig, ss.Contacts(FIG11.contacts, seed=11), second, level=LEVEL)
    unstable = [
        edge.value
        for edge in ss.critical(FIG11.rig, "velocity", between=(0.25, 2.0)).edges[:2]
    ]
    slopes = table(lambda v: _steepest(curves.sel(velocity=v)), velocity=velocities)
    of_newborns = "force of newborn contacts, per contact [f_s]"
    return dataset(
        {
            **run,
            "friction_force": (curves, of_newborns),
            "F_contacts": (newborns, of_newborns),
            "K_eff": (slopes, "effective stiffness per contact [k]"),
            "crossing": (crossing, "velocity at which K_eff = K [x_s/time]"),
            "unstable": (
                "end",
                unstable,
                "where smooth sliding is unstable (linear) [x_s/time]",
            ),
        },
        {
            "velocity": (velocities, "velocity [x_s/time]"),
            "displacement": (
                curves["displacement"],
                "displacement of the slider [x_s]",
            ),
            "checked": (list(_CONVERGED), "velocity [x_s/time]"),
        },
        count=count,
    )


def _claims_11(data: xr.Dataset) -> Iterator[Claim]:
    crossing, v1, v2 = (float(data[name]) for name in ("crossing", "v1", "v2"))
    low, high = data["unstable"].values.tolist()
    falls = float(data["K_eff"].diff("velocity").max())
    renewal = data["friction_force"].sel(velocity=list(_CONVERGED)).values
    # The stretching of a contact scatters by less than .5; the solvers differ by .002.
    of_newborns = (
        "force of newborn contacts, largest difference of N contacts from "
        "the renewal equation"
    )
    noise = 4.0 * 0.5 / float(np.sqrt(data.attrs["count"])) + 0.002
    yield claim_from(
        17,
        (
            "K_eff falls with the velocity and crosses K at the second transition, to "
            "smooth sliding"
        ),
        *(
            near(
                f"K_eff at v = {v:g}",
                data["K_eff"].sel(velocity=v),
                slope,
                0.005 * slope,
                "k",
            )
            for v, slope in _CONVERGED.items()
        ),
        at_most("K_eff, largest change from one velocity to the next", falls, 0.0, "k"),
        at_most(of_newborns, abs(renewal - data["F_contacts"]).max(), noise, "f_s"),
        near("velocity at which K_eff = K", crossing, 0.48, 0.01, "x_s/time"),
        between("first transition, v1 of the ramp", v1, *V1_SCALED, "x_s/time"),
        between("second transition, v2 of the ramp", v2, *V2_SCALED, "x_s/time"),
        between("smooth sliding unstable from (linear)", low, *V1_SCALED, "x_s/time"),
        # the lower edge of Fig. 8, beta = .80 at v = 1, scaled to beta = 1
        near(
            "smooth sliding unstable up to (linear)", high, 0.80**-2, 0.08, "x_s/time"
        ),
        printed=falls < 0 and abs(crossing - v2) < 0.2 * v2,
        exact=f"K_eff falls, but crosses K = {FIG11.slider.stiffness:g} at v = "
        f"{crossing:.3f}, where stick-slip "
        f"begins; it ends at v = {v2:.2f}",
        evidence="renewal equation of newborn contacts pulled at constant velocity, "
        "K_eff = max(-dF/dX), checked "
        f"with {data.attrs['count']} contacts; a ramp of {_EACH_WAY:g} time units with "
        f"{FIG11.contacts} contacts, "
        f"stick-slip where F_d varies by more than {LEVEL:g}; linear stability",
    )


def _drawing_11(picture: Picture, data: xr.Dataset) -> None:
    """Friction and effective stiffness of ageing contacts.

    Friction on a ramp of the velocity (a); force on newborn contacts pulled at constant
    velocity, renewal equation and contacts (b); its steepest decrease, the effective
    stiffness, against the velocity (c). Red: where it equals the stiffness of the
    spring.
    """
    friction, curves, stiffness = picture.subplot_mosaic("aa;bc").values()
    K = FIG11.slider.stiffness
    crossing = float(data["crossing"])
    v2 = float(data["v2"])

    v = data["drive_velocity"]
    force = data["spring_force"]
    friction.plot(v, force, color=BLUE, linewidth=0.4)
    shade(friction, data["unstable"], "smooth sliding unstable", 0.92)
    friction.axvline(crossing, color=VERMILLION, linewidth=0.9, linestyle="--")
    panel(
        friction,
        "(a) friction on a ramp",
        v,
        force,
        xlim=(0.0, 1.5),
        ylim=(-0.55, 1.02),
    )

    X = data["displacement"]
    exact = data["friction_force"]
    seen = data["F_contacts"]
    for at, colour in zip(_CONVERGED, PALETTE, strict=False):
        curves.plot(X, exact.sel(velocity=at), color=colour, label=f"$v$ = {at:g}")
        curves.plot(
            X, seen.sel(checked=at), "o", color=colour, markersize=2, markevery=(19, 20)
        )
    panel(curves, "(b) newborn contacts, pulled", X, exact, ylim=(0.0, 1.0))
    curves.legend(loc="upper right", ncols=2)

    stiffness.plot(data["velocity"], data["K_eff"], "o-", color=BLUE, markersize=3)
    stiffness.axhline(K, color=GREY, linewidth=0.8)
    stiffness.axvline(crossing, color=VERMILLION, linewidth=0.9, linestyle="--")
    stiffness.text(0.02, K + 0.06, "$K$", color=GREY)
    stiffness.axvline(v2, color=BLACK, linewidth=0.9, linestyle=":")
    stiffness.text(v2 - 0.02, 2.6, "$v_2$", ha="right")
    panel(
        stiffness,
        "(c) steepest fall in (b)",
        data["velocity"],
        data["K_eff"],
        xlim=(0.0, 1.2),
        ylim=(0.0, 1.08 * float(data["K_eff"].max())),
    )


FIGURES = (
    Figure("fig8", 5.6, _data_8, _claims_8, _drawing_8),
    Figure("fig11", 5.2, _data_11, _claims_11, _drawing_11),
)
