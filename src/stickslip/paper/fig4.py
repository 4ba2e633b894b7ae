"""Figure 4: Spring force with and without delay.

Spring force against displacement without delay (a, with the velocity of the slider dotted), and against time on a
soft (b) and a stiff spring (c) for several delays. Each panel names the regime after the transient.

Transients last for 40 to 100 ``x_s``: the picture shows the beginning, the claims are weighed on what comes after it.
"""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

import stickslip as ss
from stickslip import plot, theory
from stickslip.model import Method
from stickslip.paper.cases import FIG4, PERIOD
from stickslip.paper.figure import Claim, Figure, Measured, at_least, at_most, near, weighed
from stickslip.paper.kit import Picture, Progress, dataset, grid, panel, portions, power, second_axis, table

STIFFNESSES = (5.0, 2.0)
_SHOWN_DELAYS = (0.0, 0.09, 0.1, 0.2)
_DELAYS = (0.0, 0.085, 0.09, 0.1, 0.105, 0.2, 0.3)
_SOLVERS = ("contacts", "master equation")

_SHOWN = 20.0
_BEGIN, _END = 60.0, 120.0  # what is evaluated; early windows tell how fast a transient decays
_EARLY = (20.0, 40.0, 60.0)
_PERIODIC = 1e-4  # variation of the period left to a solver's steps; a thousand contacts have 40 times as much
_DECAY = "decrease of the peak to peak from x = 20-40 to 40-60"

_TRACES = ["spring_force", "velocity", "displacement"]
_LATE = {  # what a `Regime` says, by its names for it
    "kind": f"regime after t = {_BEGIN:g}",
    "peak_to_peak": "peak to peak of the spring force, late, per contact [f_s]",
    "mean_force": "mean spring force, late, per contact [f_s]",
    "period": "mean period, late [time]",
    "period_variation": "coefficient of variation of the period, late [1]",
    "largest_velocity": "largest velocity, late [v_d]",
}


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    methods: dict[str, Method] = {
        "contacts": ss.Contacts(FIG4.contacts, seed=4),
        "master equation": ss.MasterEquation(rtol=1e-4 if quick else 1e-5),
    }
    counts = (1_000, 4_000) if quick else (1_000, 4_000, 16_000)
    first, second = portions(progress, len(_SOLVERS) * len(STIFFNESSES) * len(_DELAYS), len(counts))
    output = ss.Output(interval=0.002)

    def run(solver: str, stiffness: float, delay: float, progress: Progress) -> dict[Any, Any]:
        drive = ss.constant(FIG4.velocity, 90.0 if quick else _END)
        rig = FIG4.rig.replace(stiffness=stiffness, delay=delay, drive=drive)
        made = ss.simulate(rig, method=methods[solver], output=output, progress=progress)
        late, force = ss.regime(made, after=_BEGIN), made["spring_force"]
        begin, later = (np.ptp(force.sel(time=slice(*pair)).to_numpy()) for pair in itertools.pairwise(_EARLY))
        shown = made[_TRACES].sel(time=slice(0.0, _SHOWN))
        return {name: getattr(late, name) for name in _LATE} | {"decay": begin / later} | dict(shown)

    def scatter(count: int, progress: Progress) -> dict[str, float]:
        rig = FIG4.rig.replace(drive=ss.constant(FIG4.velocity, 2.0 * _END))  # K = 2 k, delay .2
        made = ss.simulate(rig, method=ss.Contacts(count, seed=9), output=output, progress=progress)
        return {"scatter": ss.regime(made, after=_BEGIN).period_variation}

    def smooth(stiffness: float, delay: float) -> float:
        rig = FIG4.rig.replace(stiffness=stiffness, delay=delay)
        return theory.driving_force(rig.interface, rig.slider, FIG4.velocity)

    seen = grid(run, first, solver=_SOLVERS, stiffness=STIFFNESSES, delay=_DELAYS)
    traces = seen[_TRACES].sel(solver="contacts", drop=True)
    of_smooth = "mean spring force in smooth sliding, closed form, per contact [f_s]"
    of_period = "coefficient of variation of the period, K = 2 k, delay .2 [1]"
    return dataset(
        dict(traces)
        | {name: (seen[name], words) for name, words in _LATE.items()}
        | {
            "velocity": (traces["velocity"], "velocity of the slider [v_d]"),
            "decay": (seen["decay"], f"{_DECAY} [1]"),
            "mean_force_smooth": (table(smooth, stiffness=STIFFNESSES, delay=_DELAYS), of_smooth),
            "period_scatter": (grid(scatter, second, contacts=counts)["scatter"], of_period),
        },
        {"stiffness": (STIFFNESSES, "stiffness of the driving spring, per contact [k]")},
        count=FIG4.contacts,
    )


def _thresholds_of_delay(data: xr.Dataset) -> Claim:
    def all_are(kind: str, stiffness: float, *delays: float) -> bool:
        return bool((data["kind"].sel(stiffness=stiffness, delay=list(delays)) == kind).all())

    soft = all_are("smooth sliding", 2.0, 0.0, 0.085, 0.09) and all_are("stick-slip", 2.0, 0.1, 0.105, 0.2)
    stiff = all_are("smooth sliding", 5.0, 0.0, 0.09, 0.1, 0.2)
    # As printed, K = 5 k would be smooth at once; at a delay of .2 the oscillation of the start outlasts the picture.
    at_once = float(data["decay"].sel(stiffness=5.0, delay=0.2).max()) > 10.0
    return weighed(
        7,
        "at K = 2 k delays up to .09 give smooth sliding and .1 and .2 stick-slip; at K = 5 k all are smooth",
        *itertools.chain(*(_long_time_numbers(data, solver) for solver in _SOLVERS)),
        printed=soft and stiff and at_once,
        read=soft and stiff,
        reading=f"the regime is that after the transient (x > {_BEGIN:g} x_s): at K = 5 k and a delay of .2 the "
        "initial oscillation decays slowly. K > K* does not forbid oscillation: a delay of .3 sustains a small one",
        evidence=f"{data.attrs['count']} contacts and the master equation, {len(_DELAYS)} delays at each stiffness",
    )


def _long_time_numbers(data: xr.Dataset, solver: str) -> list[Measured]:
    """The settled numbers of the two stiffnesses, as a solver gives them."""
    noisy = solver == "contacts"

    def late(name: str, words: str, stiffness: float, delay: float) -> tuple[str, xr.DataArray]:
        value = data[name].sel(solver=solver, stiffness=stiffness, delay=delay)
        return f"{words}, K {stiffness:g}, delay {delay:g}, {solver}", value

    oscillation = functools.partial(late, "peak_to_peak", "peak to peak F_d")
    mean = functools.partial(late, "mean_force", "mean F_d")
    period = functools.partial(late, "period", "period")
    fastest = functools.partial(late, "largest_velocity", "largest velocity")
    exact = data["mean_force_smooth"].sel(delay=0.0).to_numpy().tolist()
    return [
        at_most(*oscillation(2.0, 0.0), 0.05, "f_s"),
        at_most(*oscillation(2.0, 0.085), 0.05, "f_s"),
        at_least(*oscillation(2.0, 0.105), 0.5, "f_s"),
        near(*oscillation(2.0, 0.2), 0.77, 0.02, "f_s"),
        near(*period(2.0, 0.2), PERIOD, 0.010, "time"),
        near(*fastest(2.0, 0.2), 13.0, 0.7, "v_d"),
        at_most(*oscillation(5.0, 0.0), 0.04, "f_s"),
        at_most(*oscillation(5.0, 0.1), 0.04, "f_s"),
        at_least(*late("decay", _DECAY, 5.0, 0.2), 2.0),
        # Contacts add their noise to the largest and the smallest value.
        near(*oscillation(5.0, 0.3), 0.635, 0.03 if noisy else 0.015, "f_s"),
        near(*period(5.0, 0.3), 1.38, 0.01, "time"),
        at_most(*fastest(5.0, 0.3), 3.0, "v_d"),
        *(near(*mean(K, 0.0), F, 0.004 if noisy else 1e-4, "f_s") for K, F in zip(STIFFNESSES, exact, strict=True)),
    ]


def _strictly_periodic(data: xr.Dataset) -> Claim:
    exact = float(data["period_variation"].sel(solver="master equation", stiffness=2.0, delay=0.2))
    count, scatter = data["contacts"].to_numpy(), data["period_scatter"].to_numpy()
    # A scatter over n periods is known to 1/sqrt(2 n); here n is about 120.
    error = float(np.sqrt(2.0) / np.sqrt(2.0 * 120.0) / np.log(count[-1] / count[0]))
    return weighed(
        11,
        "stick-slip is strictly periodic",
        at_most("coefficient of variation of the period, master equation", exact, _PERIODIC),
        near("power of N in that of N contacts", power(count, scatter), -0.5, 3.0 * error + 0.05),
        *(
            Measured(name=f"coefficient of variation of the period, {n} contacts", value=float(v))
            for n, v in zip(count, scatter, strict=True)
        ),
        printed=bool(scatter.max() < _PERIODIC),
        reading="for infinitely many contacts; the period of N contacts scatters as N^(-1/2)",
        evidence=f"K = 2 k, delay .2, periods after t = {_BEGIN:g}",
    )


def _drawing(picture: Picture, data: xr.Dataset) -> None:
    upper, lower = picture.subfigures(2, 1, height_ratios=(1.0, 2.0), squeeze=False)[:, 0]
    left, right = upper.subplots(1, 2, sharey=True)
    _draw_without_delay(left, data.sel(stiffness=STIFFNESSES[0], delay=0.0)).tick_params(labelright=False)
    left.set_ylabel(plot.label(data["spring_force"]), color=plot.BLUE)
    second = _draw_without_delay(right, data.sel(stiffness=STIFFNESSES[1], delay=0.0))
    second.set_ylabel(plot.label(data["velocity"]), color=plot.VERMILLION)
    panels = lower.subplots(len(_SHOWN_DELAYS), len(STIFFNESSES), sharex=True, sharey=True)
    for (i, delay), (j, stiffness) in itertools.product(enumerate(_SHOWN_DELAYS), enumerate(STIFFNESSES)):
        ax, case = panels[i, j], data.sel(stiffness=stiffness, delay=delay, solver="contacts")
        ax.plot(case["time"], case["spring_force"], color=plot.BLUE, linewidth=0.9)
        words = rf"$\tau_\mathrm{{d}}$ = {delay:g},  {case['kind'].item()} at the end"
        ax.text(1.0, 1.0, words, transform=ax.transAxes, ha="right", va="bottom", fontsize=8)
        title = "" if i else f"({'bc'[j]}) $K$ = {stiffness:g} $k$"
        panel(ax, title, data["time"], xlim=(0, _SHOWN), ylim=(0, 0.95), yticks=[0.0, 0.4, 0.8])
        ax.label_outer()
    lower.supylabel(plot.label(data["spring_force"]), fontsize=9)


def _draw_without_delay(ax: Axes, run: xr.Dataset) -> Axes:
    """Force and, on a second axis, velocity against displacement."""
    early = run.isel(time=(run["displacement"] < 6.0).to_numpy())
    ax.plot(early["displacement"], early["spring_force"], color=plot.BLUE)
    second = second_axis(ax, early["displacement"], early["velocity"], (0, 12), [0, 4, 8, 12], linestyle=":")
    ax.tick_params(axis="y", colors=plot.BLUE)
    title = rf"(a) $K$ = {float(run['stiffness']):g} $k$,  $\tau_\mathrm{{d}}$ = 0"
    panel(ax, title, run["displacement"], xlim=(0, 6), ylim=(0, 0.95))
    return second


FIGURE = Figure(__name__, __doc__, 7.2, _data, _drawing, _thresholds_of_delay, _strictly_periodic)
