"""Pictures of a prediction: the motion at each speed, the margins, and the waves of an
elastic slider.
"""

import math
import re
import textwrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from stickslip.answers import COLOURS, with_micro
from stickslip.errors import refused
from stickslip.model.parameters import parameter_named
from stickslip.plot.maps import EDGE, legend_below
from stickslip.plot.palette import BLACK, DASHED, GREY, PAGE, VERMILLION
from stickslip.plot.runs import force_trace
from stickslip.plot.style import dress, house_style, new_figure

# `stickslip.advise.Prediction`, which this module may not import, as it is in a higher
# layer
Prediction = Any

_CYCLES_SHOWN = 12
_BY_THEORY = {
    kind: f"{kind} (linear, without noise)" for kind in ("unstable", "stable")
} | {"unknown": "not known"}


@house_style()
def prediction(answer: Prediction) -> Figure:
    """Draw the result of `predict`: the motion at each speed, the force at the rig's
    own speed, and the margins of each parameter.
    """
    rows = len(answer.margins)
    moves = len(answer.along_drive) > 1
    heights = [
        0.45,
        *([0.3] if moves else []),
        2.0,
        *([0.24 * rows + 0.1] if rows else []),
    ]
    figure = new_figure(PAGE, 2.0 + sum(heights))
    axes = figure.subplots(len(heights), 1, height_ratios=heights)
    figure.suptitle(
        _title(answer.rig, answer.headline),
        x=0.01,
        ha="left",
        fontsize=9,
    )
    patches = _strip_of_speeds(axes[0], answer)
    if moves:
        patches += _strip(axes[1], answer.along_drive)
        times = {"long_name": "time", "units": answer.rig.unit_name("time")}
        dress(
            axes[1].xaxis,
            xr.DataArray([band.high for band in answer.along_drive], attrs=times),
        )
        axes[1].set_xlim(0.0, answer.along_drive[-1].high)
        by = "" if answer.driven is not None else ", as if each speed lasted"
        axes[1].set_title(f"motion along its drive{by}", fontsize=8)
    _force_at_its_speed(axes[1 + moves], answer)
    if rows:
        _margins(axes[-1], answer)
        patches.append(_patch("unstable"))
    return legend_below(figure, patches)


def _title(rig: Any, sentence: str) -> str:
    words = with_micro(f"{rig.name}: {sentence}")
    # keep each number and its unit in one line
    words = re.sub(r"(?<=\d) (?=\S)", "\N{NO-BREAK SPACE}", words)
    return "\n".join(textwrap.wrap(words, 105)).replace("$", r"\$")


def _patch(kind: str) -> Patch:
    """Return the entry of a kind of motion for the legend."""
    hatch = "....." if kind == "unknown" else None
    return Patch(
        label=_BY_THEORY.get(kind, kind),
        facecolor=_colour(kind),
        hatch=hatch,
        **EDGE,
    )


def _strip(ax: Axes, bands: Any) -> list[Patch]:
    """Draw ranges as bars coloured by their motion; return legend entries."""
    patches = []
    for band in bands:
        patch = _patch(band.kind)
        patches.append(patch)
        ax.axvspan(
            band.low,
            band.high,
            facecolor=patch.get_facecolor(),
            edgecolor=GREY,
            hatch=patch.get_hatch(),
            linewidth=0,
        )
        if band.bistable:
            look: Any = {"edgecolor": "white", "hatch": "/////"}
            ax.axvspan(band.low, band.high, facecolor="none", linewidth=0, **look)
            patches.append(
                Patch(
                    facecolor=GREY,
                    label="... or smooth: bistable (without noise)",
                    **look,
                )
            )
    ax.set(ylim=(0.0, 1.0), yticks=[])
    ax.spines["left"].set_visible(False)
    return patches


def _strip_of_speeds(ax: Axes, answer: Prediction) -> list[Patch]:
    """Draw the speeds coloured by their motion, and mark those of the rig; return
    legend entries.
    """
    patches = _strip(ax, answer.bands)
    speed = answer.rig.velocity
    upright = ax.get_xaxis_transform()
    ax.axvline(speed, color=BLACK, linewidth=1.6)
    ax.plot(
        speed, 1.0, "v", color=BLACK, markersize=6, clip_on=False, transform=upright
    )
    for speed, _ in answer.at_speeds:
        ax.plot(
            [speed] * 2,
            [0.0, 1.0],
            color=BLACK,
            linewidth=0.9,
            linestyle=(0, (3, 2)),
        )
    if answer.between is not None:
        ax.plot(
            answer.between,
            [1.0, 1.0],
            color=BLACK,
            linewidth=3.0,
            solid_capstyle="butt",
            clip_on=False,
        )
    _axis_of_speeds(ax, answer)
    others = (
        "; dashed, its other speeds" if len(answer.rig.operation.speeds) > 1 else ""
    )
    others = "; the bar is its range" if answer.between is not None else others
    ax.set_title(f"motion at each speed; the mark is this rig{others}", fontsize=8)
    return patches


def _axis_of_speeds(ax: Axes, answer: Any) -> None:
    """Make the horizontal axis a logarithmic one of the speeds searched."""
    look = {
        "long_name": "speed",
        "units": answer.rig.unit_name("x_s/time"),
        "spacing": "log",
    }
    dress(ax.xaxis, xr.DataArray(np.array(answer.speeds_searched), attrs=look))
    ax.set_xlim(*answer.speeds_searched)


def _force_at_its_speed(ax: Axes, answer: Prediction) -> None:
    run = answer.run
    period = answer.regime.period
    if math.isfinite(period) and period > 0:
        run = run.sel(time=slice(float(run["time"][-1]) - _CYCLES_SHOWN * period, None))
    force_trace(run, ax)
    ax.axhline(answer.static_friction, color=GREY, linewidth=0.9, linestyle=DASHED)
    ax.annotate(
        "static friction",
        (1.0, answer.static_friction),
        fontsize=8,
        color=GREY,
        xycoords=("axes fraction", "data"),
        xytext=(0, 2),
        textcoords="offset points",
        ha="right",
    )
    ax.set_title("force at its speed", fontsize=8)


def _colour(kind: str) -> str:
    """Return the colour of a kind of motion; white where that is not known."""
    return COLOURS.get(kind, "#FFFFFF")


def _bars(ax: Axes, row: int, ranges: Any, kind: str) -> None:
    for low, high in ranges:
        ax.barh(
            row,
            high - low,
            left=low,
            color=_colour(kind),
            height=0.62,
            linewidth=0,
        )


def _margins(ax: Axes, answer: Prediction) -> None:
    """Draw a bar for each parameter, over the factor on its value: where smooth sliding
    is stable; and the mitigations.
    """
    stops = {each.parameter: each.to / each.now for each in answer.mitigations}
    names = list(
        dict.fromkeys(
            [
                *(margin.parameter for margin in answer.margins),
                *stops,
            ]
        )
    )
    widest = 1.0
    for k, margin in enumerate(answer.margins):
        (low, high), *stable = (
            np.array([margin.searched, *margin.stable]) / margin.value
        )
        _bars(ax, k, [(low, high)], "unstable")
        _bars(ax, k, stable, "smooth sliding")
        widest = max(widest, high, 1.0 / low)
        for edge in (margin.lower, margin.upper):
            if edge is not None:
                ax.plot(
                    [edge / margin.value] * 2,
                    [k - 0.31, k + 0.31],
                    color=BLACK,
                    linewidth=1.4,
                )
    for name, factor in stops.items():
        ax.plot(
            factor,
            names.index(name),
            "D",
            label="mitigation (simulated)",
            color=VERMILLION,
            markersize=5,
            markeredgecolor="white",
            clip_on=False,
        )
    ax.axvline(1.0, color=BLACK, linewidth=0.8)
    ax.set(xscale="log", xlim=(1 / widest, widest))
    ax.set_yticks(range(len(names)), [parameter_named(name).title for name in names])
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    ax.xaxis.set_major_formatter(lambda v, _: f"× {v:.3g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.invert_yaxis()
    ax.tick_params(axis="y", length=0)
    ax.set_title(
        "smooth sliding, each parameter varied alone: by this factor", fontsize=8
    )


@house_style()
def waves(answer: Any) -> Figure:
    """Draw the result of `predict` for a `Chain` or a `Sheet`: the speeds at which each
    wave grows.
    """
    if not hasattr(answer, "waves"):
        raise refused("waves: answer", answer, "must be what predict() returns")
    rows = max(len(answer.waves), 1)
    figure = new_figure(PAGE, 1.4 + 0.3 * rows)
    ax = figure.add_subplot()
    for row, wave in enumerate(answer.waves):
        _bars(ax, row, [answer.speeds_searched], "smooth sliding")
        _bars(ax, row, wave.unknown, "unknown")
        _bars(ax, row, wave.speeds, "unstable")
    ax.axvline(answer.rig.velocity, color=BLACK, linewidth=1.6)
    _axis_of_speeds(ax, answer)
    ax.set_ylim(rows - 0.5, -0.5)
    ax.set_yticks(range(len(answer.waves)), [wave.name for wave in answer.waves])
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)
    figure.suptitle(
        _title(answer.rig, answer.verdict),
        x=0.01,
        ha="left",
        fontsize=9,
    )
    named = {"unstable": "grows (linear)", "smooth sliding": "decays"}
    if any(wave.unknown for wave in answer.waves):
        named["unknown"] = "not known"
    return legend_below(
        figure,
        [
            Patch(facecolor=_colour(kind), label=name, **EDGE)
            for kind, name in named.items()
        ],
    )
