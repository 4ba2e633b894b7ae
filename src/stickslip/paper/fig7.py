"""Figure 7: the velocity of the drive goes up and down; stick-slip sets in, and ends elsewhere.

With a fixed delay there are two boundaries, and both are computed: smooth sliding loses stability at ``v1`` (linear),
and the cycle of stick-slip, followed downwards, ends at its fold ``v1'`` (nonlinear). A ramp passes ``v1`` before the
oscillation has grown. With random delays stick-slip ends at high velocity too, if it lasts at all: that depends on the
standard deviation, and on what is done with negative draws.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import matplotlib.figure
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from stickslip import plot
from stickslip.cycles import bistable_range, cycle_branch, is_sustained, sustained
from stickslip.measure import transitions
from stickslip.model import Contacts, Interface, NegativeDelay, Output, RandomDelay, constant
from stickslip.model.drive import ramp
from stickslip.model.rig import Rig
from stickslip.paper.cases import FIG7, V1
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
from stickslip.simulation import simulate
from stickslip.stability import critical

Array = NDArray[np.float64]

_SLOW, _FAST = 0.1, 3.0  # of the ramp of (a)
_TOP = 8.0  # of (b): far enough for stick-slip to end
_EACH_WAY = 400.0
_INTERVAL = 0.02
_LOW = -0.35  # of the axis of force: the inertia of the slider pulls it below 0 after a slip
_SHOWN = 16.0  # time units of an inset
_MEAN = 0.2
_Case = tuple[float, NegativeDelay]
_CASES: tuple[_Case, ...] = (
    (0.06, "clip"),
    (0.08, "clip"),
    (0.12, "clip"),
    (0.12, "fold"),
    (0.12, "redraw"),
)
_SWEPT: tuple[_Case, ...] = ((0.06, "clip"), (0.12, "clip"))
# Velocities at which stick-slip persists, or does not, with random delays (PHYSICS section 6).
_ON = {0.06: (0.5, 1.0, 3.0), 0.08: (0.6, 1.0, 2.0)}
_OFF = {0.06: (0.25, 8.0), 0.08: (0.36, 4.0, 6.0)}


def _random(case: _Case) -> Interface:
    std, negative = case
    return replace(FIG7.interface, delay=RandomDelay(mean=_MEAN, std=std, negative=negative))


def _name(case: _Case) -> str:
    return f"{case[0]:g}, {case[1]}"


def _sweep(interface: Interface, top: float, method: Contacts, progress: Progress) -> xr.Dataset:
    drive = ramp(_SLOW, top, _EACH_WAY).then(ramp(top, _SLOW, _EACH_WAY))
    return simulate(
        Rig(interface, FIG7.slider, drive), method=method, output=Output(interval=_INTERVAL), progress=progress
    )


def _ranges(
    case: _Case, velocities: list[float], points: int, parts: Iterator[Progress]
) -> tuple[list[float], list[float], list[float]]:
    """Velocities between which stick-slip persists and smooth sliding is unstable; oscillation at some velocities."""
    rig = Rig(_random(case), FIG7.slider, constant(1.0))
    nowhere = [math.nan, math.nan]
    # With redrawn delays the range is narrow, .7 to .9: hence the number of points.
    windows = sustained(rig, "velocity", between=(0.2, _TOP), points=points, tolerance=0.01).windows
    persists = [windows[0].low.value, windows[-1].high.value] if windows else nowhere
    next(parts)(1.0)
    edges = critical(rig, "velocity", between=(0.05, 100.0)).edges
    unstable = [edges[0].value, edges[-1].value] if edges else nowhere
    looked = _ON.get(case[0], ()) + _OFF.get(case[0], ())
    oscillation = [is_sustained(rig.replace(velocity=v)).peak_to_peak if v in looked else math.nan for v in velocities]
    next(parts)(1.0)
    return persists, unstable, oscillation


def _data(progress: Progress, quick: bool) -> xr.Dataset:
    cases = (_CASES[0], _CASES[2]) if quick else _CASES
    seeds = (1,) if quick else (1, 2, 3)
    parts = portions(progress, len(seeds) + len(_SWEPT) + 2 + 2 * len(cases))

    count = 4_000 if quick else FIG7.contacts
    runs = [_sweep(FIG7.interface, _FAST, Contacts(count, seed=seed), next(parts)) for seed in seeds]
    found = [transitions(run) for run in runs]
    seen = {name: np.array([float(each[name]) for each in found]) for name in ("v1", "v1_down")}
    sweeps = [runs[0]] + [_sweep(_random(case), _TOP, Contacts(count, seed=1), next(parts)) for case in _SWEPT]

    (band,) = bistable_range(Rig(FIG7.interface, FIG7.slider, constant(1.0)), "velocity", between=(0.3, _FAST))
    next(parts)(1.0)
    branch = cycle_branch(
        Rig(FIG7.interface, FIG7.slider, constant(1.5)), "velocity", step=0.2 if quick else 0.05, between=(0.3, _FAST)
    )
    next(parts)(1.0)

    velocities = sorted({v for looked in (_ON, _OFF) for there in looked.values() for v in there})
    ranges = [_ranges(case, velocities, 5 if quick else 16, parts) for case in cases]
    persists, unstable, oscillation = (np.array(values) for values in zip(*ranges, strict=True))

    return xr.Dataset(
        {
            "spring_force": variable(
                ("sweep", "time"), [run["spring_force"] for run in sweeps], "spring force, per contact", "f_s"
            ),
            "drive_velocity": variable(
                ("sweep", "time"), [run["drive_velocity"] for run in sweeps], "velocity of the drive", "x_s/time"
            ),
            "v1_ramp": variable("seed", seen["v1"], "v1, on the way up a ramp", "x_s/time"),
            "v1_down_ramp": variable(
                "seed",
                seen["v1_down"],
                "v1', on the way down a ramp",
                "x_s/time",
            ),
            "v1_linear": variable((), band.high.value, "v1: smooth sliding loses stability (linear)", "x_s/time"),
            "v1_down_fold": variable((), band.low.value, "v1': stick-slip decays at its fold (nonlinear)", "x_s/time"),
            "cycle": variable(
                "v_cycle", branch["amplitude"].to_numpy(), "peak to peak of the spring force, per contact", "f_s"
            ),
            "up": variable("v_ramp", found[0]["up"].to_numpy(), "peak to peak of the spring force, per contact", "f_s"),
            "down": variable(
                "v_ramp", found[0]["down"].to_numpy(), "peak to peak of the spring force, per contact", "f_s"
            ),
            "sustained": variable(
                ("case", "end"),
                persists,
                "where stick-slip persists from a narrow start (nonlinear)",
                "x_s/time",
            ),
            "unstable": variable(("case", "end"), unstable, "where smooth sliding is unstable (linear)", "x_s/time"),
            "oscillation": variable(("case", "v"), oscillation, "peak to peak of the spring force, per contact", "f_s"),
        },
        coords={
            "time": variable("time", runs[0]["time"].to_numpy(), "time", "time"),
            "sweep": variable("sweep", ["fixed", *map(_name, _SWEPT)], "delays of the ramp"),
            "seed": variable("seed", seeds, "seed", "1"),
            "v_cycle": variable("v_cycle", branch["velocity"].to_numpy(), "velocity of the drive", "x_s/time"),
            "v_ramp": variable("v_ramp", found[0]["velocity"].to_numpy(), "velocity of the drive", "x_s/time"),
            "case": variable("case", list(map(_name, cases)), "standard deviation of the delays, negative draws"),
            "end": variable("end", ["low", "high"], "end of the range"),
            "v": variable("v", velocities, "velocity of the drive", "x_s/time"),
        },
        attrs={"count": count},
    )


def _claims(data: xr.Dataset) -> tuple[Claim, ...]:
    return _hysteresis(data), _smooth_again(data)


def _hysteresis(data: xr.Dataset) -> Claim:
    v1, v1_down = data["v1_ramp"].to_numpy(), data["v1_down_ramp"].to_numpy()
    linear, fold = float(data["v1_linear"]), float(data["v1_down_fold"])
    return Claim(
        number=10,
        statement="stick-slip that sets in at v1 when the velocity rises ends at a lower velocity v1' when it falls",
        verdict=verdict(printed=fold < linear and bool(np.all(v1_down < v1))),
        settled="reproduced",
        measured=(
            near("v1, smooth sliding loses stability (linear)", linear, V1, 1e-6, "x_s/time"),
            near("v1', stick-slip decays at its fold (nonlinear)", fold, 0.71, 0.02, "x_s/time"),
            between("v1 of the ramps, smallest", v1.min(), 1.0, 1.85, "x_s/time"),
            between("v1 of the ramps, largest", v1.max(), 1.0, 1.85, "x_s/time"),
            between("v1' of the ramps, smallest", v1_down.min(), 0.2, 0.72, "x_s/time"),
            between("v1' of the ramps, largest", v1_down.max(), 0.2, 0.72, "x_s/time"),
        ),
        evidence=f"{v1.size} ramps of {data.attrs['count']} contacts, {_EACH_WAY:g} time units each way; the cycle "
        "followed by the master equation. Ramps overshoot both boundaries: it takes time to grow, and to die",
    )


def _smooth_again(data: xr.Dataset) -> Claim:
    measured: list[Measured] = []
    lasts_within = printed = True
    for name in data["case"].to_numpy().tolist():
        std = float(name.split(",")[0])
        low, high = data["sustained"].sel(case=name).to_numpy().tolist()
        oscillation = data["oscillation"].sel(case=name)
        for v in _ON.get(std, ()):
            measured.append(
                at_least(
                    f"peak to peak F_d, standard deviation {name}, v {v:g}", float(oscillation.sel(v=v)), 0.5, "f_s"
                )
            )
        for v in _OFF.get(std, ()):
            measured.append(
                at_most(
                    f"peak to peak F_d, standard deviation {name}, v {v:g}", float(oscillation.sel(v=v)), 0.05, "f_s"
                )
            )
        if std in _ON:
            lasts_within &= high < _TOP
            continue
        printed &= high < _TOP  # with the paper's own delays; nowhere is not smooth again
        if name.endswith("redraw"):
            measured.append(
                between(f"stick-slip persists from, standard deviation {name}", low, 0.65, 0.75, "x_s/time")
            )
            measured.append(
                between(f"stick-slip persists up to, standard deviation {name}", high, 0.8, 0.95, "x_s/time")
            )
        else:
            nowhere = float(np.isnan(low))
            measured.append(at_least(f"stick-slip persists nowhere (1: so), standard deviation {name}", nowhere, 1.0))
    return Claim(
        number=12,
        statement="with random delays the motion is smooth again at high velocity",
        verdict=verdict(printed=printed and lasts_within, read=lasts_within and all(m.ok for m in measured)),
        settled="reproduced under the stated reading",
        reading="at mean .2 and standard deviations of .06 and .08. At the paper's .12 stick-slip persists from a "
        "narrow start at no velocity if negative draws are clipped to 0 or folded, and only between about .7 and .85 "
        "if they are drawn again",
        measured=tuple(measured),
        evidence=f"master equation from the relaxed start at velocities of .2 to {_TOP:g}: each run followed until its "
        "oscillation settles or decays",
    )


def _drawing(data: xr.Dataset) -> matplotlib.figure.Figure:
    figure = plot.new_figure(plot.PAGE, 7.4)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.15, 1.0, 1.0))
    top = figure.add_subplot(grid[0, :])
    _draw_sweep(top, data.sel(sweep="fixed"), rf"(a) $\tau_\mathrm{{d}}$ = {_fixed():g}", 1.75)
    _draw_marks(top, data)
    _draw_onset(top, data)
    for j, case in enumerate(_SWEPT):
        ax = figure.add_subplot(grid[1, j])
        title = rf"({'bc'[j]}) $\tau_\mathrm{{d}}$ = {_MEAN:g} ± {case[0]:g}"
        _draw_sweep(ax, data.sel(sweep=_name(case)), title, 1.05, left=j == 0, right=j == 1)
    _draw_hysteresis(figure.add_subplot(grid[2, 0]), data)
    _draw_windows(figure.add_subplot(grid[2, 1]), data)
    return figure


def _fixed() -> float:
    return FIG7.interface.delay.moment(1)


def _draw_sweep(ax: Axes, sweep: xr.Dataset, title: str, top: float, *, left: bool = True, right: bool = True) -> None:
    plot.force_trace(sweep[["spring_force"]].drop_vars("sweep"), ax, color=plot.BLUE)
    ax.lines[0].set_linewidth(0.5)
    ax.set_ylim(_LOW, top)
    ax.set_yticks([0.0, 0.4, 0.8])
    if not left:
        ax.set_ylabel("")
    second = ax.twinx()
    second.spines["right"].set_visible(True)
    second.plot(sweep["time"][::50], sweep["drive_velocity"][::50], color=plot.VERMILLION, linewidth=1.6)
    fastest = round(float(sweep["drive_velocity"].max()))
    # Zero velocity at zero force, the largest at .8 f_s.
    second.set_ylim(_LOW * fastest / 0.8, top * fastest / 0.8)
    second.set_yticks([0, fastest / 2, fastest])
    second.tick_params(axis="y", colors=plot.VERMILLION)
    if right:
        second.set_ylabel(plot.label(sweep["drive_velocity"], most=24), color=plot.VERMILLION)
    plot.letter(ax, title)


def _time_of(velocity: float, down: bool) -> float:
    since = (velocity - _SLOW) / (_FAST - _SLOW) * _EACH_WAY
    return 2 * _EACH_WAY - since if down else since


def _draw_marks(ax: Axes, data: xr.Dataset) -> None:
    """When the drive passes the two computed velocities, and when the ramp shows the change."""
    for name, symbol, down in (("v1_linear", "v_1", False), ("v1_down_fold", "v_1'", True)):
        v = float(data[name])
        at = _time_of(v, down)
        ax.axvline(at, 0, 0.58, color=plot.BLACK, linewidth=0.9, linestyle=(0, (4, 2)))
        ax.text(at, 0.88, f"${symbol}$ = {v:.3f}", ha="center", fontsize=8)


def _draw_onset(ax: Axes, data: xr.Dataset) -> None:
    at = _time_of(float(data["v1_ramp"][0]), False)
    begin = at - 0.55 * _SHOWN
    near_by = data["spring_force"].sel(sweep="fixed", time=slice(begin, begin + _SHOWN))
    inset = ax.inset_axes((0.04, 0.74, 0.36, 0.26))
    inset.plot(near_by["time"], near_by, color=plot.BLUE, linewidth=0.7)
    inset.set_yticks([])
    inset.tick_params(labelsize=7)
    inset.margins(x=0)


def _draw_hysteresis(ax: Axes, data: xr.Dataset) -> None:
    v = data["v_ramp"]
    ax.axvspan(float(data["v1_down_fold"]), float(data["v1_linear"]), color=plot.GREY, alpha=0.15, linewidth=0)
    ax.plot(v, data["up"], color=plot.ORANGE, linewidth=0.9, label="ramp up")
    ax.plot(v, data["down"], color=plot.SKY, linewidth=0.9, label="ramp down")
    ax.plot(data["v_cycle"], data["cycle"], color=plot.BLACK, label="cycle, computed")
    middle = 0.5 * (float(data["v1_down_fold"]) + float(data["v1_linear"]))
    ax.text(middle, 1.13, "both\nstable", ha="center", va="center", fontsize=8)
    ax.set(xlim=(0, _FAST), ylim=(0, 1.25))
    plot.dress(ax.xaxis, v)
    ax.set_ylabel("peak to peak of $F_d$ ($f_\\mathrm{s}$)")
    ax.legend(loc="lower right")
    plot.letter(ax, "(d) hysteresis of (a)")


def _draw_windows(ax: Axes, data: xr.Dataset) -> None:
    names = data["case"].to_numpy().tolist()
    for i, name in enumerate(names):
        low, high = data["sustained"].sel(case=name).to_numpy().tolist()
        first, last = data["unstable"].sel(case=name).to_numpy().tolist()
        y = len(names) - 1 - i
        if math.isfinite(low):
            ax.plot([low, high], [y, y], color=plot.BLUE, linewidth=6, solid_capstyle="butt")
        else:
            ax.text(0.22, y, "none", va="center", fontsize=8, color=plot.BLUE)
        if math.isfinite(first):
            ax.plot([first, last], [y - 0.22, y - 0.22], color=plot.VERMILLION, linewidth=1.6)
    ax.plot([], [], color=plot.BLUE, linewidth=6, solid_capstyle="butt", label="stick-slip persists")
    ax.plot([], [], color=plot.VERMILLION, linewidth=1.6, label="smooth sliding unstable")
    ax.set(xscale="log", xlim=(0.2, _TOP), ylim=(-0.7, len(names) - 0.3))
    ax.set_xticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_yticks(range(len(names)), names[::-1])
    plot.dress(ax.xaxis, data["v"])
    ax.legend(loc="center right", bbox_to_anchor=(1.0, 0.36), handlelength=1.2)
    ax.set_ylabel("std of the delays,\nnegative draws")
    plot.letter(ax, f"(e) random delays of mean {_MEAN:g}")


FIGURE = Figure(
    name="fig7",
    title="Velocity up and down, with a fixed delay and with random ones",
    caption="The velocity of the drive (red) goes up and down. (a) Fixed delay, with the computed limits v1 and v1'. "
    "(b), (c) Random delays; negative draws are clipped to zero. (d) Peak to peak of the force on both ramps "
    "of (a) and on the computed cycle; grey: smooth sliding and stick-slip are both stable. (e) Velocities at "
    "which stick-slip persists from a narrow start, and at which smooth sliding is unstable, by the standard "
    "deviation of the delays and by what is done with negative draws: clip to zero, fold to positive, redraw.",
    data=_data,
    drawing=_drawing,
    claims=_claims,
)
