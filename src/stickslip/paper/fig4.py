"""Figure 4: Spring force with and without delay.

Spring force against displacement without delay (a, with the velocity of the slider dotted), and against time on a
soft (b) and a stiff spring (c) for several delays. Each panel names the regime after the transient.

Eq. (11) with contacts that re-attach after a delay. Transients last for 40 to 100 ``x_s``, longer than the paper's
picture: the picture shows the beginning, the claims are weighed on what comes after it.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

import stickslip as ss
from stickslip import plot, theory
from stickslip.model import Method
from stickslip.paper.cases import FIG4, PERIOD
from stickslip.paper.figure import Claim, Figure, Measured, Progress, at_least, at_most, near, weighed
from stickslip.paper.kit import Picture, dataset, grid, panel, portions, power, second_axis

STIFFNESSES = (5.0, 2.0)
_SHOWN_DELAYS = (0.0, 0.09, 0.1, 0.2)
_DELAYS = (0.0, 0.085, 0.09, 0.1, 0.105, 0.2, 0.3)
_SOLVERS = ("contacts", "master equation")

_SHOWN = 20.0
_BEGIN, _END = 60.0, 120.0  # what is evaluated; early windows tell how fast a transient decays
_EARLY = (20.0, 40.0, 60.0)
_INTERVAL = 0.002
_SAMPLES = round(_SHOWN / _INTERVAL) + 1
_PERIODIC = 1e-4  # variation of the period left to a solver's steps; a thousand contacts have 40 times as much
_DECAY = "decrease of the peak to peak from x = 20-40 to 40-60"

_TRACES = ("spring_force", "velocity", "displacement")
_LATE = {  # what a `Regime` says, by its names for it
    "kind": f"regime after t = {_BEGIN:g}",
    "peak_to_peak": "peak to peak of the spring force, late, per contact [f_s]",
    "mean_force": "mean spring force, late, per contact [f_s]",
    "period": "mean period, late [time]",
    "period_variation": "coefficient of variation of the period, late [1]",
}


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    methods: dict[str, Method] = {
        "contacts": ss.Contacts(FIG4.contacts, seed=4),
        "master equation": ss.MasterEquation(rtol=1e-4 if quick else 1e-5),
    }
    counts = (1_000, 4_000) if quick else (1_000, 4_000, 16_000)
    first, second = portions(progress, len(_SOLVERS) * len(STIFFNESSES) * len(_DELAYS), len(counts))
    output = ss.Output(interval=_INTERVAL)

    def run(solver: str, stiffness: float, delay: float, progress: Progress) -> dict[str, Any]:
        drive = ss.constant(FIG4.velocity, 90.0 if quick else _END)
        rig = FIG4.rig.replace(stiffness=stiffness, delay=delay, drive=drive)
        made = ss.simulate(rig, method=methods[solver], output=output, progress=progress)
        late, force = ss.regime(made, after=_BEGIN), made["spring_force"]
        begin, later = (np.ptp(force.sel(time=slice(*pair)).to_numpy()) for pair in itertools.pairwise(_EARLY))
        found = {name: getattr(late, name) for name in _LATE}
        found |= {"peak_velocity": late.largest_velocity, "decay": begin / later}
        return found | {name: made[name].to_numpy()[:_SAMPLES] for name in _TRACES}

    def scatter(count: int, progress: Progress) -> dict[str, float]:
        rig = FIG4.rig.replace(drive=ss.constant(FIG4.velocity, 2.0 * _END))  # K = 2 k, delay .2
        made = ss.simulate(rig, method=ss.Contacts(count, seed=9), output=output, progress=progress)
        return {"scatter": ss.regime(made, after=_BEGIN).period_variation}

    seen = grid(first, run, _SOLVERS, STIFFNESSES, _DELAYS)
    shown = [_DELAYS.index(delay) for delay in _SHOWN_DELAYS]
    rigs = [[FIG4.rig.replace(stiffness=K, delay=tau) for tau in _DELAYS] for K in STIFFNESSES]
    smooth = [[theory.driving_force(rig.interface, rig.slider, FIG4.velocity) for rig in row] for row in rigs]
    of_smooth = "mean spring force in smooth sliding, closed form, per contact [f_s]"
    of_period = "coefficient of variation of the period, K = 2 k, delay .2 [1]"
    return dataset(
        {name: ("stiffness shown_delay time", seen[name][0][:, shown]) for name in _TRACES}
        | {name: ("solver stiffness delay", seen[name], words) for name, words in _LATE.items()}
        | {
            "peak_velocity": ("solver stiffness delay", seen["peak_velocity"], "largest velocity, late [v_d]"),
            "decay": ("solver stiffness delay", seen["decay"], f"{_DECAY} [1]"),
            "mean_force_smooth": ("stiffness delay", smooth, of_smooth),
            "period_scatter": ("contacts", grid(second, scatter, counts)["scatter"], of_period),
        },
        {
            "time": (_INTERVAL * np.arange(_SAMPLES),),
            "stiffness": (STIFFNESSES, "stiffness of the driving spring, per contact [k]"),
            "shown_delay": (_SHOWN_DELAYS, "delay [time]"),
            "delay": (_DELAYS, "delay [time]"),
            "solver": (_SOLVERS, "solver"),
            "contacts": (counts, "number of contacts [1]"),
        },
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
        *(m for solver in _SOLVERS for m in _long_time_numbers(data.sel(solver=solver), solver)),
        printed=soft and stiff and at_once,
        read=soft and stiff,
        reading=f"the regime is that after the transient (x > {_BEGIN:g} x_s): at K = 5 k and a delay of .2 the "
        "initial oscillation decays slowly. K > K* does not forbid oscillation: a delay of .3 sustains a small one",
        evidence=f"{data.attrs['count']} contacts and the master equation, {len(_DELAYS)} delays at each stiffness",
    )


def _long_time_numbers(data: xr.Dataset, solver: str) -> list[Measured]:
    """The settled numbers of the two stiffnesses, as a solver gives them."""
    noisy = solver == "contacts"

    def late(name: str, words: str, stiffness: float, delay: float) -> tuple[str, float]:
        value = data[name].sel(stiffness=stiffness, delay=delay)
        return f"{words}, K {stiffness:g}, delay {delay:g}, {solver}", float(value)

    def oscillation(stiffness: float, delay: float) -> tuple[str, float]:
        return late("peak_to_peak", "peak to peak F_d", stiffness, delay)

    numbers = [
        at_most(*oscillation(2.0, 0.0), 0.05, "f_s"),
        at_most(*oscillation(2.0, 0.085), 0.05, "f_s"),
        at_least(*oscillation(2.0, 0.105), 0.5, "f_s"),
        near(*oscillation(2.0, 0.2), 0.77, 0.02, "f_s"),
        near(*late("period", "period", 2.0, 0.2), PERIOD, 0.010, "time"),
        near(*late("peak_velocity", "largest velocity", 2.0, 0.2), 13.0, 0.7, "v_d"),
        at_most(*oscillation(5.0, 0.0), 0.04, "f_s"),
        at_most(*oscillation(5.0, 0.1), 0.04, "f_s"),
        at_least(*late("decay", _DECAY, 5.0, 0.2), 2.0),
        # Contacts add their noise to the largest and the smallest value.
        near(*oscillation(5.0, 0.3), 0.635, 0.03 if noisy else 0.015, "f_s"),
        near(*late("period", "period", 5.0, 0.3), 1.38, 0.01, "time"),
        at_most(*late("peak_velocity", "largest velocity", 5.0, 0.3), 3.0, "v_d"),
    ]
    for stiffness in STIFFNESSES:
        exact = float(data["mean_force_smooth"].sel(stiffness=stiffness, delay=0.0))
        found = late("mean_force", "mean F_d", stiffness, 0.0)
        numbers.append(near(*found, exact, 0.004 if noisy else 1e-4, "f_s"))
    return numbers


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
    second = _draw_without_delay(left, data.sel(stiffness=STIFFNESSES[0], shown_delay=0.0))
    left.set_ylabel(plot.label(data["spring_force"]), color=plot.BLUE)
    second.tick_params(labelright=False)
    second = _draw_without_delay(right, data.sel(stiffness=STIFFNESSES[1], shown_delay=0.0))
    second.set_ylabel(plot.label(data["velocity"], units="v_d"), color=plot.VERMILLION)
    panels = lower.subplots(len(_SHOWN_DELAYS), len(STIFFNESSES), sharex=True, sharey=True)
    for j, stiffness in enumerate(STIFFNESSES):
        for ax, delay in zip(panels[:, j], _SHOWN_DELAYS, strict=True):
            force = data["spring_force"].sel(stiffness=stiffness, shown_delay=delay)
            kind = str(data["kind"].sel(solver="contacts", stiffness=stiffness, delay=delay).item())
            ax.plot(data["time"], force, color=plot.BLUE, linewidth=0.9)
            words = rf"$\tau_\mathrm{{d}}$ = {delay:g},  {kind} at the end"
            ax.text(1.0, 1.0, words, transform=ax.transAxes, ha="right", va="bottom", fontsize=8)
            ax.set(xlim=(0, _SHOWN), ylim=(0, 0.95), xticks=[0, 5, 10, 15, 20], yticks=[0.0, 0.4, 0.8])
        plot.letter(panels[0, j], f"({'bc'[j]}) $K$ = {stiffness:g} $k$")
        plot.dress(panels[-1, j].xaxis, data["time"])
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
