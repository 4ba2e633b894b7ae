"""Pictures of answers: what `predict` found, and the stability map around a rig."""

from __future__ import annotations

import math
import re
import textwrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from stickslip.model.parameters import parameter_named
from stickslip.plot.runs import force_trace
from stickslip.plot.style import (
    BLACK,
    BLUE,
    COLUMN,
    GREY,
    PAGE,
    VERMILLION,
    house_style,
    label,
    new_figure,
)
from stickslip.plot.sweeps import REGIMES, axis_of_parameter, legend_below

Prediction = Any  # `stickslip.advise.Prediction`: advice stands above pictures, which take it by its attributes alone

_CYCLES_SHOWN = 12
_COLOURS = {kind: REGIMES[kind][0] for kind in ("smooth sliding", "sustained oscillation", "stick-slip")}
_COLOURS |= {"unstable": "#BFBFBF", "stable": "#FFFFFF"}
_BY_THEORY = {
    "unstable": "unstable (linear, without noise)",
    "stable": "stable (linear, without noise)",
    "unknown": "not known",
}


@house_style()
def prediction(answer: Prediction) -> Figure:
    """Draw an answer: the motion at each speed, the force at the rig's speed, and how far each parameter may be varied.

    Parameters
    ----------
    answer : Prediction
        What `stickslip.predict` returns.
    """
    rows = len(answer.margins)
    heights = [0.45, 2.0, *([0.24 * rows + 0.1] if rows else [])]
    figure = new_figure(PAGE, 2.0 + sum(heights))
    axes = figure.subplots(len(heights), 1, height_ratios=heights)
    figure.suptitle(_title(answer), x=0.01, ha="left", fontsize=9)
    handles = _strip_of_speeds(axes[0], answer)
    _force_at_its_speed(axes[1], answer)
    if rows:
        handles |= _margins(axes[2], answer)
    legend_below(figure, list(handles.values()))
    return figure


def _title(answer: Prediction) -> str:
    words = re.sub(r"(?<= )u(?=m|s|N)", "µ", f"{answer.rig.name}: {getattr(answer, 'headline', answer.verdict)}")
    words = re.sub(r"(?<=\d) (?=\S)", "\N{NO-BREAK SPACE}", words)  # a number stays with its unit
    return "\n".join(textwrap.wrap(words, 105)).replace("$", r"\$")


def _strip_of_speeds(ax: Axes, answer: Prediction) -> dict[str, Any]:
    low, high = answer.speeds_searched
    handles: dict[str, Any] = {}
    edge: Any = {"edgecolor": GREY, "linewidth": 0.5}
    for band in answer.bands:
        colour, hatch = _COLOURS.get(band.kind, "#FFFFFF"), "....." if band.kind == "unknown" else None
        look: Any = {"facecolor": colour, "hatch": hatch}
        ax.axvspan(band.low, band.high, edgecolor=GREY, linewidth=0, **look)
        name = _BY_THEORY.get(band.kind, band.kind)
        handles.setdefault(band.kind, Patch(label=name, **edge, **look))
        if band.bistable:
            ax.axvspan(band.low, band.high, facecolor="none", edgecolor="white", hatch="/////", linewidth=0)
            handles.setdefault(
                "bistable",
                Patch(
                    facecolor=GREY, hatch="/////", edgecolor="white", label="... or smooth: bistable (without noise)"
                ),
            )
    ax.axvline(answer.rig.velocity, color=BLACK, linewidth=1.6)
    ax.plot([answer.rig.velocity], [1.0], "v", color=BLACK, markersize=6, clip_on=False, transform=_above(ax))
    size, operation = answer.rig.unit("x_s/time"), answer.rig.operation
    for speed in operation.speeds:
        ax.plot([speed * size] * 2, [0.0, 1.0], color=BLACK, linewidth=0.9, linestyle=(0, (3, 2)))
    if answer.between is not None:
        ax.plot(answer.between, [1.0, 1.0], color=BLACK, linewidth=3.0, solid_capstyle="butt", clip_on=False)
    speeds = xr.DataArray(
        np.array([low, high]), attrs={"long_name": "speed", "units": answer.rig.unit_name("x_s/time"), "spacing": "log"}
    )
    axis_of_parameter(ax.xaxis, speeds)
    ax.set(xlim=(low, high), ylim=(0.0, 1.0), yticks=[])
    ax.spines["left"].set_visible(False)
    also = "; dashed, its other speeds" if len(operation.speeds) > 1 else ""
    also = "; the bar is its range" if answer.between is not None else also
    ax.set_title(f"motion at each speed; the mark is this rig{also}", fontsize=8)
    return handles


def _above(ax: Axes) -> Any:
    return ax.get_xaxis_transform()


def _force_at_its_speed(ax: Axes, answer: Prediction) -> None:
    run = answer.run
    period = answer.regime.period
    if math.isfinite(period) and period > 0:
        end = float(run["time"][-1])
        run = run.sel(time=slice(max(float(run["time"][0]), end - _CYCLES_SHOWN * period), None))
    force_trace(run, ax)
    ax.axhline(answer.static_friction, color=GREY, linewidth=0.9, linestyle=(0, (4, 2)))
    ax.annotate(
        "static friction",
        (1.0, answer.static_friction),
        xycoords=("axes fraction", "data"),
        xytext=(0, 2),
        textcoords="offset points",
        ha="right",
        fontsize=8,
        color=GREY,
    )
    ax.set_title("force at its speed", fontsize=8)


def _margins(ax: Axes, answer: Prediction) -> dict[str, Any]:
    """A bar for each parameter, as a factor on its value: where smooth sliding is stable, and what would stop it."""
    names = {margin.parameter: k for k, margin in enumerate(answer.margins)}
    labels = [str(row[0]) for row in answer.margin_rows()]
    for mitigation in answer.mitigations:
        if len(mitigation.parameters) == 1 and mitigation.parameters[0] not in names:
            names[mitigation.parameters[0]] = len(names)
            labels.append(parameter_named(mitigation.parameters[0]).title)
    here = _COLOURS["unstable"] if answer.unstable_modes else _COLOURS["smooth sliding"]
    there = _COLOURS["smooth sliding"] if answer.unstable_modes else _COLOURS["unstable"]
    widest = 1.0
    for margin, k in zip(answer.margins, names.values(), strict=False):
        low, high = (end / margin.value for end in margin.searched)
        widest = max(widest, high, 1.0 / low)
        lower = low if margin.lower is None else margin.lower / margin.value
        upper = high if margin.upper is None else margin.upper / margin.value
        for a, b, colour in ((low, lower, there), (lower, upper, here), (upper, high, there)):
            if b > a:
                ax.barh(k, b - a, left=a, height=0.62, color=colour, linewidth=0)
        for edge in (margin.lower, margin.upper):
            if edge is not None:
                ax.plot([edge / margin.value] * 2, [k - 0.31, k + 0.31], color=BLACK, linewidth=1.4)
    unstable: Any = {"facecolor": _COLOURS["unstable"], "edgecolor": GREY, "linewidth": 0.5}
    handles: dict[str, Any] = {"unstable": Patch(label=_BY_THEORY["unstable"], **unstable)}
    for mitigation in answer.mitigations:
        if mitigation.stops is None or len(mitigation.parameters) > 1:
            continue
        at = mitigation.stops[0] / mitigation.values[0]
        (handles["stops"],) = ax.plot(
            at,
            names[mitigation.parameters[0]],
            "D",
            color=VERMILLION,
            markersize=5,
            markeredgecolor="white",
            linestyle="none",
            clip_on=False,
            label="mitigation (simulated)",
        )
    ax.axvline(1.0, color=BLACK, linewidth=0.8)
    ax.set(xscale="log", xlim=(1 / widest, widest), yticks=list(names.values()))
    ax.set_yticklabels(labels)
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"× {v:.3g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.invert_yaxis()
    ax.tick_params(axis="y", length=0)
    ax.set_title("smooth sliding, each parameter varied alone: by this factor", fontsize=8)
    return handles


@house_style()
def chart(found: xr.Dataset) -> Figure:
    """Draw a stability map: growth rate as shading, the boundary with its frequency, and the rig's own point.

    Parameters
    ----------
    found : xarray.Dataset
        What `stickslip.advise.chart` returns.
    """
    across, up = map(str, found["growth_rate"].dims)
    figure = new_figure(1.6 * COLUMN, 4.6)
    ax = figure.add_subplot()
    rate = found["growth_rate"].transpose(up, across)
    values = rate.to_numpy()
    largest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 1.0
    norm = SymLogNorm(linthresh=max(1e-2 * largest, 1e-300), vmin=-largest, vmax=largest)
    shade = ax.pcolormesh(
        found[across],
        found[up],
        np.ma.masked_invalid(values),
        cmap="PuOr_r",
        norm=norm,
        shading="gouraud",
        rasterized=True,
    )
    decades = 10.0 ** (np.floor(np.log10(largest)) - np.array([0.0, 1.0]))
    bar = figure.colorbar(shade, ax=ax, ticks=[*-decades, 0.0, *decades[::-1]], pad=0.02)
    bar.set_label(label(found["growth_rate"]))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}".replace("-", "\N{MINUS SIGN}")))
    bar.ax.yaxis.set_minor_locator(LogLocator(subs=()))
    handles: dict[str, Any] = {}
    number_of = found["curve"].to_numpy()
    x, y = found[f"edge_{across}"].to_numpy(), found[f"edge_{up}"].to_numpy()
    hertz = found["edge_frequency"].to_numpy() / (2 * np.pi)
    written: list[tuple[float, float]] = []
    for curve in np.unique(number_of):
        mine = number_of == curve
        (line,) = ax.plot(x[mine], y[mine], color=BLACK, lw=1.6, label="limit of smooth sliding")
        handles |= {"edge": line}
        for i in _places(x[mine], y[mine], found[across], found[up], written):
            style: Any = {"fontsize": 7, "ha": "center", "va": "center"}
            style["bbox"] = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85}
            ax.annotate(_frequency(hertz[mine][i]), (x[mine][i], y[mine][i]), **style)
    if "band" in found.dims and found.sizes["band"]:
        low, high = (found[f"band_{up}_{end}"].to_numpy() for end in ("low", "high"))
        place = found[f"band_{across}"].to_numpy()
        name = "stick-slip persists, too (bistable)"
        handles["band"] = ax.vlines(place, low, high, color=BLUE, lw=3.0, alpha=0.7, label=name)
    here = float(found[f"here_{across}"]), float(found[f"here_{up}"])
    (handles["here"],) = ax.plot(*here, "o", ms=8, mfc="white", mec=BLACK, mew=1.5, ls="none", label="this rig")
    for axis, name in ((ax.xaxis, across), (ax.yaxis, up)):
        axis_of_parameter(axis, found[name].assign_attrs(spacing="log"))
    ax.set_xlim(float(found[across].min()), float(found[across].max()))
    ax.set_ylim(float(found[up].min()), float(found[up].max()))
    unit = "Hz" if found["edge_frequency"].attrs.get("units") == "1/s" else "cycles per time unit"
    title = str(found.attrs.get("rig", "")).replace("$", r"\$")
    numbers = f"numbers: frequency at the limit ({unit}); growth above 0: unstable"
    ax.set_title(f"{title}\n{numbers}" if title else numbers)
    legend_below(figure, list(handles.values()))
    return figure


def _frequency(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def _places(x: Any, y: Any, across: xr.DataArray, up: xr.DataArray, written: list[tuple[float, float]]) -> list[int]:
    """Where along a curve its frequency is written: on the limit itself, inside the axes, and apart from each other."""
    u = np.log(x / float(across.min())) / np.log(float(across.max()) / float(across.min()))
    v = np.log(y / float(up.min())) / np.log(float(up.max()) / float(up.min()))
    fits = (u > 0.06) & (u < 0.94) & (v > 0.04) & (v < 0.96)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(u), np.diff(v)))])
    inside = np.flatnonzero(fits)
    if inside.size == 0 or length[-1] < 0.2:
        return []
    found = []
    for part in (0.2, 0.5, 0.8) if length[-1] > 0.8 else (0.5,):
        i = int(inside[np.argmin(np.abs(length[inside] - part * length[-1]))])
        if all(abs(u[i] - a) > 0.15 or abs(v[i] - b) > 0.06 for a, b in written):
            written.append((float(u[i]), float(v[i])))
            found.append(i)
    return found


@house_style()
def waves(answer: Any) -> Figure:
    """Draw at which speeds each wave on an elastic slider grows.

    Parameters
    ----------
    answer : ElasticPrediction
        What `stickslip.predict` returns of a `Chain` or a `Sheet`.
    """
    figure = new_figure(PAGE, 1.4 + 0.3 * max(len(answer.waves), 1))
    ax = figure.add_subplot()
    low, high = answer.speeds_searched
    for row, wave in enumerate(answer.waves):
        ax.barh(row, high - low, left=low, height=0.62, color=_COLOURS["smooth sliding"], linewidth=0)
        for begin, end in wave.speeds:
            ax.barh(row, end - begin, left=begin, height=0.62, color=_COLOURS["unstable"], linewidth=0)
    ax.axvline(answer.rig.velocity, color=BLACK, linewidth=1.6)
    speeds = xr.DataArray(
        np.array([low, high]), attrs={"long_name": "speed", "units": answer.rig.unit_name("x_s/time"), "spacing": "log"}
    )
    axis_of_parameter(ax.xaxis, speeds)
    ax.set(xlim=(low, high), ylim=(max(len(answer.waves), 1) - 0.5, -0.5))
    ax.set_yticks(range(len(answer.waves)), [wave.name for wave in answer.waves])
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)
    figure.suptitle(_title(answer), x=0.01, ha="left", fontsize=9)
    colours = ((_COLOURS["unstable"], "grows (linear)"), (_COLOURS["smooth sliding"], "decays"))
    legend_below(
        figure, [Patch(facecolor=colour, label=name, edgecolor=GREY, linewidth=0.5) for colour, name in colours]
    )
    return figure
