"""Figures 4 and 6: stick-slip of contacts that re-attach after a delay, and the
shortest delay that sustains it.
"""

import functools
import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes

import stickslip as ss
from stickslip import plot, theory
from stickslip.model import Method
from stickslip.paper.cases import FIG4, FIG6, PERIOD, slider
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
    Array,
    Picture,
    Progress,
    dataset,
    grid,
    panel,
    portions,
    power,
    second_axis,
    table,
)
from stickslip.plot import BLACK, BLUE, VERMILLION

STIFFNESSES = (5.0, 2.0)
_SHOWN_DELAYS = (0.0, 0.09, 0.1, 0.2)
_DELAYS = (0.0, 0.085, 0.09, 0.1, 0.105, 0.2, 0.3)

_SHOWN = 20.0
# begin and end of the evaluated window; earlier windows show the decay of a transient
_BEGIN = 60.0
_END = 120.0
_EARLY = (20.0, 40.0, 60.0)
# largest coefficient of variation of the period from the steps of a solver; a thousand
# contacts have 40 times as much
_PERIODIC = 1e-4

_TRACES = ["spring_force", "velocity", "displacement"]
_LATE = {  # fields of `Regime` that are stored, and the decay of the transient
    "kind": f"regime after t = {_BEGIN:g}",
    "peak_to_peak": "peak to peak of the spring force, late, per contact [f_s]",
    "mean_force": "mean spring force, late, per contact [f_s]",
    "period": "mean period, late [time]",
    "period_variation": "coefficient of variation of the period, late [1]",
    "largest_velocity": "largest velocity, late [v_d]",
    "decay": "decrease of the peak to peak from x = 20-40 to 40-60 [1]",
}


def _data_4(progress: Progress, quick: bool) -> xr.Dataset:
    methods: dict[str, Method] = {
        "contacts": ss.Contacts(FIG4.contacts, seed=4),
        "master equation": ss.MasterEquation(rtol=1e-4 if quick else 1e-5),
    }
    counts = (1_000, 4_000) if quick else (1_000, 4_000, 16_000)
    first, second = portions(
        progress, len(methods) * len(STIFFNESSES) * len(_DELAYS), len(counts)
    )
    output = ss.Output(interval=0.002)

    def run(
        solver: str, stiffness: float, delay: float, progress: Progress
    ) -> dict[Any, Any]:
        drive = ss.constant(FIG4.velocity, 90.0 if quick else _END)
        rig = FIG4.rig.replace(stiffness=stiffness, delay=delay, drive=drive)
        made = ss.simulate(
            rig, method=methods[solver], output=output, progress=progress
        )
        late = ss.regime(made, after=_BEGIN)
        force = made["spring_force"]
        begin, later = (
            np.ptp(force.sel(time=slice(*pair)).values)
            for pair in itertools.pairwise(_EARLY)
        )
        shown = made[_TRACES].sel(time=slice(0.0, _SHOWN))
        found = {name: getattr(late, name, None) for name in _LATE}
        return found | {"decay": begin / later} | dict(shown)

    def scatter(count: int, progress: Progress) -> dict[str, float]:
        # K = 2 k, delay .2, as in `FIG4`
        rig = FIG4.rig.replace(drive=ss.constant(FIG4.velocity, 2.0 * _END))
        made = ss.simulate(
            rig, method=ss.Contacts(count, seed=9), output=output, progress=progress
        )
        return {"scatter": ss.regime(made, after=_BEGIN).period_variation}

    def smooth(stiffness: float, delay: float) -> float:
        rig = FIG4.rig.replace(stiffness=stiffness, delay=delay)
        return theory.driving_force(rig.interface, rig.slider, FIG4.velocity)

    seen = grid(run, first, solver=methods, stiffness=STIFFNESSES, delay=_DELAYS)
    traces = seen[_TRACES].sel(solver="contacts", drop=True)
    smoothly = table(smooth, stiffness=STIFFNESSES, delay=_DELAYS)
    scattered = grid(scatter, second, contacts=counts)["scatter"]
    return dataset(
        dict(traces)
        | {name: (seen[name], words) for name, words in _LATE.items()}
        | {
            "velocity": (traces["velocity"], "velocity of the slider [v_d]"),
            "mean_force_smooth": (
                smoothly,
                "mean force in smooth sliding, closed form, per contact [f_s]",
            ),
            "period_scatter": (
                scattered,
                "coefficient of variation of the period, K = 2 k, delay .2 [1]",
            ),
        },
        {
            "stiffness": (
                STIFFNESSES,
                "stiffness of the driving spring, per contact [k]",
            )
        },
        count=FIG4.contacts,
    )


def _late_numbers(data: xr.Dataset) -> Iterator[Measured]:
    """Yield the settled numbers of both stiffnesses, by each solver."""
    exact = data["mean_force_smooth"].sel(delay=0.0).to_series()
    # The noise of contacts adds to the largest and the smallest value.
    for solver, noise, of_mean in (
        ("contacts", 0.03, 0.004),
        ("master equation", 0.015, 1e-4),
    ):
        for name, stiffness, delay, low, high in (
            ("peak_to_peak", 2.0, 0.0, -math.inf, 0.05),
            ("peak_to_peak", 2.0, 0.085, -math.inf, 0.05),
            ("peak_to_peak", 2.0, 0.105, 0.5, math.inf),
            ("peak_to_peak", 2.0, 0.2, 0.75, 0.79),
            ("period", 2.0, 0.2, PERIOD - 0.01, PERIOD + 0.01),
            ("largest_velocity", 2.0, 0.2, 12.3, 13.7),
            ("peak_to_peak", 5.0, 0.0, -math.inf, 0.04),
            ("peak_to_peak", 5.0, 0.1, -math.inf, 0.04),
            ("decay", 5.0, 0.2, 2.0, math.inf),
            ("peak_to_peak", 5.0, 0.3, 0.635 - noise, 0.635 + noise),
            ("period", 5.0, 0.3, 1.37, 1.39),
            ("largest_velocity", 5.0, 0.3, -math.inf, 3.0),
            *(
                ("mean_force", K, 0.0, F - of_mean, F + of_mean)
                for K, F in exact.items()
            ),
        ):
            value = data[name].sel(solver=solver, stiffness=stiffness, delay=delay)
            words = value.attrs["long_name"].partition(",")[0]
            unit = value.attrs["units"].replace("1", "")
            yield between(
                f"{words}, K {stiffness:g}, delay {delay:g}, {solver}",
                value,
                low,
                high,
                unit,
            )


def _claims_4(data: xr.Dataset) -> Iterator[Claim]:
    def all_are(kind: str, stiffness: float, *delays: float) -> bool:
        return bool(
            (data["kind"].sel(stiffness=stiffness, delay=list(delays)) == kind).all()
        )

    soft = all_are("smooth sliding", 2.0, 0.0, 0.085, 0.09) and all_are(
        "stick-slip", 2.0, 0.1, 0.105, 0.2
    )
    stiff = all_are("smooth sliding", 5.0, 0.0, 0.09, 0.1, 0.2)
    # As printed, K = 5 k is smooth from the start; but at a delay of .2 the initial
    # oscillation lasts longer than the picture.
    at_once = float(data["decay"].sel(stiffness=5.0, delay=0.2).max()) > 10.0
    yield claim_from(
        7,
        (
            "at K = 2 k delays up to .09 give smooth sliding and .1 and .2 stick-slip; "
            "at "
            "K = 5 k all are smooth"
        ),
        *_late_numbers(data),
        printed=soft and stiff and at_once,
        read=soft and stiff,
        reading=f"the regime is that after the transient (x > {_BEGIN:g} x_s): at K = "
        "5 k and a delay of .2 the "
        "initial oscillation decays slowly. K > K* does not forbid oscillation: a "
        "delay of .3 sustains a small one",
        evidence=(
            f"{data.attrs['count']} contacts and the master equation, "
            f"{len(_DELAYS)} delays at each stiffness"
        ),
    )

    exact = data["period_variation"].sel(
        solver="master equation", stiffness=2.0, delay=0.2
    )
    count = data["contacts"].values
    scatter = data["period_scatter"].values
    # The scatter over n periods has a relative error of 1/sqrt(2 n); here n is about
    # 120.
    error = float(np.sqrt(2.0) / np.sqrt(2.0 * 120.0) / np.log(count[-1] / count[0]))
    name = "coefficient of variation of the period"
    yield claim_from(
        11,
        "stick-slip is strictly periodic",
        at_most(f"{name}, master equation", exact, _PERIODIC),
        near(
            "power of N in that of N contacts",
            power(count, scatter),
            -0.5,
            3.0 * error + 0.05,
        ),
        *(
            Measured(name=f"{name}, {n} contacts", value=float(v))
            for n, v in zip(count, scatter, strict=True)
        ),
        printed=bool(scatter.max() < _PERIODIC),
        reading=(
            "for infinitely many contacts; the period of N contacts scatters as "
            "N^(-1/2)"
        ),
        evidence=f"K = 2 k, delay .2, periods after t = {_BEGIN:g}",
    )


def _drawing_4(picture: Picture, data: xr.Dataset) -> None:
    """Spring force with and without delay.

    Spring force against displacement without delay (a, with the velocity of the slider
    dotted), and against time on a soft (b) and a stiff spring (c) for several delays.
    Each panel names the regime after the transient.
    """
    upper, lower = picture.subfigures(2, 1, height_ratios=(1.0, 2.0), squeeze=False)[
        :, 0
    ]
    pair = upper.subplots(1, 2, sharey=True)
    for ax, stiffness in zip(pair, STIFFNESSES, strict=True):
        run = data.sel(stiffness=stiffness, delay=0.0)
        early = run.isel(time=(run["displacement"] < 6.0).values)
        X = early["displacement"]
        ax.plot(X, early["spring_force"], color=BLUE)
        ax.tick_params(axis="y", colors=BLUE)
        title = rf"(a) $K$ = {stiffness:g} $k$,  $\tau_\mathrm{{d}}$ = 0"
        panel(ax, title, X, xlim=(0, 6), ylim=(0, 0.95))
        second = second_axis(
            ax, X, early["velocity"], (0, 12), [0, 4, 8, 12], linestyle=":"
        )
        second.tick_params(labelright=ax is pair[1])
    pair[0].set_ylabel(plot.label(data["spring_force"]), color=BLUE)
    second.set_ylabel(plot.label(data["velocity"]), color=VERMILLION)

    panels = lower.subplots(
        len(_SHOWN_DELAYS), len(STIFFNESSES), sharex=True, sharey=True
    )
    for (i, delay), (j, stiffness) in itertools.product(
        enumerate(_SHOWN_DELAYS), enumerate(STIFFNESSES)
    ):
        ax = panels[i, j]
        case = data.sel(stiffness=stiffness, delay=delay, solver="contacts")
        ax.plot(case["time"], case["spring_force"], color=BLUE, linewidth=0.9)
        words = rf"$\tau_\mathrm{{d}}$ = {delay:g},  {case['kind'].item()} at the end"
        ax.text(
            1.0, 1.0, words, transform=ax.transAxes, ha="right", va="bottom", fontsize=8
        )
        title = "" if i else f"({'bc'[j]}) $K$ = {stiffness:g} $k$"
        panel(
            ax,
            title,
            data["time"],
            xlim=(0, _SHOWN),
            ylim=(0, 0.95),
            yticks=[0.0, 0.4, 0.8],
        )
        ax.label_outer()
    lower.supylabel(plot.label(data["spring_force"]), fontsize=9)


_MASS = FIG6.slider.mass
_FITTED = 1e-3 * (1 + 1e-9)  # largest M v^2 in the fit, with an allowance for rounding
# expected tau* v at which the search starts, A1 + A2 (M v^2)^(1/3); the result does not
# depend on it
_EXPECTED = (0.05, 0.55)
_A1 = (0.047, 0.054)
_A2 = (0.47, 0.57)


@functools.cache  # several panels share cases
def _delays(
    mass: float, velocity: float, ratio: float, tolerance: float
) -> dict[str, float]:
    """Return the sustained (nonlinear) and the linear critical delay."""
    guess = (_EXPECTED[0] + _EXPECTED[1] * math.cbrt(mass * velocity**2)) / velocity
    rig = ss.Rig(
        FIG6.interface,
        slider(FIG6.slider.stiffness, ratio, mass),
        ss.constant(velocity),
    )
    linear = ss.stability.onset(rig, "delay", between=(1e-3 / velocity, 1e2 / velocity))
    (window,) = ss.sustained(
        rig,
        "delay",
        between=(0.7 * guess, min(4 * guess, 1.01 * linear)),
        tolerance=tolerance,
    )
    return {"sustained": window.low.value, "linear": linear}


def _data_6(progress: Progress, quick: bool) -> xr.Dataset:
    tolerance = 5e-3 if quick else 1e-3
    masses = (
        (1e-6, _MASS, 1e-3)
        if quick
        else (1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
    )
    velocities = (1.0, 3.0) if quick else (0.1, 0.2, 0.4, 0.7, 1.0, 1.7, 3.0, 5.0, 10.0)
    rows = [
        *(("mass", mass, 1.0, 0.3) for mass in masses),
        *(("velocity", _MASS, v, 0.3) for v in velocities),
        *(("M v^2", _MASS * v**2, 1.0, 0.3) for v in velocities),
        *(
            ("ratio", _MASS, 1.0, ratio)
            for ratio in ((0.3, 1.0) if quick else (0.1, 0.3, 1.0, 2.0))
        ),
        ("eta 200", _MASS, 1.0, 200.0 / FIG4.slider.frequency),
    ]
    found = grid(
        lambda case, _: _delays(*rows[case][1:], tolerance),
        progress,
        case=range(len(rows)),
    )
    varied, mass, velocity, ratio = zip(*rows, strict=True)
    return dataset(
        {
            "sustained": (
                found["sustained"],
                "critical delay tau*: stick-slip persists, nonlinear [time]",
            ),
            "linear": (
                found["linear"],
                "linear critical delay: smooth sliding is unstable [time]",
            ),
            "varied": ("case", list(varied), "what is varied"),
            "mass": (
                "case",
                list(mass),
                "mass of the slider, per contact [f_s time^2/x_s]",
            ),
            "velocity": ("case", list(velocity), "velocity of the drive [x_s/time]"),
            "ratio": ("case", list(ratio), "damping over Omega [1]"),
        },
        tolerance=tolerance,
    )


def _fit(curve: pd.DataFrame, kind: str = "sustained") -> Array:
    """Fit ``tau v = A1 + A2 (M v^2)^(1/3)`` to a curve; return A1 and A2."""
    M_v2 = curve["mass"] * curve["velocity"] ** 2
    kept = M_v2 <= _FITTED
    return np.polyfit(np.cbrt(M_v2[kept]), (curve[kind] * curve["velocity"])[kept], 1)[
        ::-1
    ]


def _claims_6(data: xr.Dataset) -> Iterator[Claim]:
    curves = dict(list(data.to_dataframe().groupby("varied")))
    by_mass = curves["mass"]
    by_velocity = curves["velocity"]
    by_ratio = curves["ratio"]
    A1, A2 = _fit(by_mass)
    A3, A4 = _fit(by_velocity)
    fitted = by_mass[by_mass["mass"] <= _FITTED]
    misfit = abs((A1 + A2 * np.cbrt(fitted["mass"])) / fitted["sustained"] - 1).max()
    kinds = ["sustained", "linear"]
    at_paper = by_ratio.set_index("ratio").loc[0.3]
    linear = by_mass["linear"]
    scaled = by_velocity[kinds].mul(by_velocity["velocity"], axis=0)
    apart, linear_apart = abs(scaled.values / curves["M v^2"][kinds].values - 1).max(
        axis=0
    )
    yield claim_from(
        9,
        "the critical delay goes as A1 + A2 M^(1/3) with the mass and as A3/v + A4 "
        "v^(-1/3) with the "
        "velocity, and grows with the damping",
        near("tau*, M 1e-4, v 1, eta .3 Omega", at_paper["sustained"], 0.0755, 0.003),
        near("tau*, eta 200", curves["eta 200"]["sustained"].item(), 0.098, 0.002),
        between("A1 of tau*(M)", A1, *_A1),
        between("A2 of tau*(M)", A2, *_A2),
        between("A3 of tau*(v)", A3, *_A1),
        between("A4 of tau*(v) over M^(1/3)", A4, *_A2),
        at_most("largest relative misfit of A1 + A2 M^(1/3)", misfit, 0.03),
        at_most("largest relative difference of tau* v at equal M v^2", apart, 0.02),
        at_most("the same for the linear critical delay", linear_apart, 1e-6),
        at_least(
            "smallest rise of tau* from one damping to the next",
            by_ratio["sustained"].diff().min(),
            0.0,
        ),
        near("linear critical delay, M 1e-4, v 1", at_paper["linear"], 0.138218, 1e-6),
        Measured(
            name="linear critical delay, largest over smallest of all masses",
            value=linear.max() / linear.min(),
        ),
        # As printed, it would hold for either of the two delays.
        printed=all(
            low <= A <= high
            for A, (low, high) in zip(_fit(by_mass, "linear"), (_A1, _A2), strict=True)
        ),
        reading="tau* is the shortest delay with which stick-slip persists from a "
        "narrow start, damping is a fixed "
        f"fraction of Omega, and M v^2 is at most {_FITTED:g}. Then tau* v depends on "
        "M v^2 alone: A3 = A1 and "
        "A4 = A2 M^(1/3). The linear critical delay is another thing, nearly the same "
        "for all masses; tau* does "
        "not exceed it",
        evidence="bisection over runs of the master equation from rest, each followed "
        "until its oscillation "
        f"settles or decays; brackets to {data.attrs['tolerance']:g}",
    )


def _drawing_6(picture: Picture, data: xr.Dataset) -> None:
    """Critical delay.

    Critical delay against the mass of the slider (a), the velocity of the drive (b) and
    the damping (d). Circles: stick-slip persists from a narrow start (nonlinear).
    Squares: smooth sliding is unstable (linear). Blue lines are fits, dotted outside
    the range fitted; in (c) the two fits are one curve of M v^2.
    """
    (by_mass, by_velocity), (collapse, by_ratio) = picture.subplots(2, 2)
    curves = dict(list(data.to_dataframe().groupby("varied")))
    A1, A2 = _fit(curves["mass"])
    delay = "critical delay (time units)"

    for ax, name, label in (
        (by_mass, "mass", rf"{A1:.3f} + {A2:.2f} $M^{{1/3}}$"),
        (
            by_velocity,
            "velocity",
            rf"{A1:.3f} $v^{{-1}}$ + {A2 * math.cbrt(_MASS):.4f} $v^{{-1/3}}$",
        ),
    ):
        ends = curves[name][name]
        fine: dict[str, Any] = {"mass": _MASS, "velocity": 1.0} | {
            name: np.geomspace(ends.min(), ends.max(), 401)
        }
        M_v2 = fine["mass"] * fine["velocity"] ** 2
        _draw_fit(
            ax, fine[name], M_v2, (A1 + A2 * np.cbrt(M_v2)) / fine["velocity"], label
        )
        _draw_delays(ax, ends, curves[name])
    words = r"mass of the slider $M/N$ ($f_\mathrm{s}$ time$^2$/$x_\mathrm{s}$)"
    panel(
        by_mass,
        "(a) $v_d$ = 1",
        words,
        delay,
        "lower right",
        xscale="log",
        ylim=(0, 0.2),
    )
    title = "(b) $M$ = 10$^{-4}$"
    panel(
        by_velocity,
        title,
        data["velocity"],
        delay,
        "upper right",
        xscale="log",
        yscale="log",
    )

    at = np.cbrt(curves["mass"]["mass"])
    curve = curves["velocity"]
    line = np.linspace(0.0, at.max(), 401)
    _draw_fit(collapse, line, line**3, A1 + A2 * line, None)
    _draw_delays(collapse, at, curves["mass"], label="from (a)")
    cube = np.cbrt(curve["mass"] * curve["velocity"] ** 2)
    scaled = curve["sustained"] * curve["velocity"]
    collapse.plot(cube, scaled, "x", color=BLACK, markersize=6, label="from (b)")
    panel(
        collapse,
        "(c) one curve",
        r"$(M v_d^2)^{1/3}$",
        r"$\tau^* v_d$ ($x_\mathrm{s}$)",
        "lower right",
        xlim=(0, line[-1] * 1.02),
        ylim=(0, 0.2),
    )

    _draw_delays(by_ratio, curves["ratio"]["ratio"], curves["ratio"], "o-")
    title = r"(d) $v_d$ = 1, $M$ = 10$^{-4}$"
    words = r"damping $\eta/\Omega$"
    panel(by_ratio, title, words, delay, "lower right", xscale="log", ylim=(0, 0.2))


def _draw_delays(
    ax: Axes, x: Any, curve: Any, style: str = "o", label: str = r"sustained: $\tau^*$"
) -> None:
    ax.plot(
        x,
        curve["sustained"],
        style,
        color=BLUE,
        markersize=4,
        linewidth=0.9,
        label=label,
    )
    ax.plot(
        x,
        curve["linear"],
        "s-",
        color=VERMILLION,
        markersize=3,
        linewidth=0.9,
        label="linear",
    )


def _draw_fit(ax: Axes, x: Array, M_v2: Array, y: Array, label: str | None) -> None:
    """Draw a line, dotted outside the fitted range."""
    for kept, style in ((M_v2 <= _FITTED, "-"), (M_v2 >= _FITTED, ":")):
        ax.plot(
            x[kept],
            y[kept],
            style,
            color=BLUE,
            linewidth=0.9,
            label=label if style == "-" else None,
        )


FIGURES = (
    Figure("fig4", 7.2, _data_4, _claims_4, _drawing_4),
    Figure("fig6", 5.4, _data_6, _claims_6, _drawing_6),
)
