"""Pictures of fits: the slips of a trace, and what series of the draws make of its statistics."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.plot.style import (
    BLACK,
    BLUE,
    GREY,
    PAGE,
    SKY,
    VERMILLION,
    dress,
    envelope,
    house_style,
    legend_above,
    new_figure,
)

Fit = Any  # `stickslip.fitting.Fit`: fits stand above pictures, which take them by their attributes alone


@house_style()
def slips(data: xr.Dataset) -> Figure:
    """Draw the trace with its slips, the distribution of drops, peaks against troughs, and the loading rate.

    Parameters
    ----------
    data : Dataset
        As `Events.to_dataset` returns.
    """
    figure = new_figure(PAGE, 4.6)
    (trace, drops), (pairs, rate) = figure.subplots(2, 2)
    trace.plot(*envelope(data["time"].values, data["spring_force"].values), color=GREY, linewidth=0.6)
    trace.plot(data["peak_time"], data["peak"], ".", color=VERMILLION, markersize=3, label="before a slip")
    trace.plot(data["trough_time"], data["trough"], ".", color=BLUE, markersize=3, label="after it")
    legend_above(trace)
    dress(trace.xaxis, data["time"])
    dress(trace.yaxis, data["spring_force"])

    size = np.sort(data["drop"].values)
    drops.step(size, np.arange(1, size.size + 1) / size.size, where="post", color=BLACK)
    drops.axvline(data.attrs["smallest"], color=GREY, linestyle=(0, (4, 2)), linewidth=0.9)
    drops.set(ylim=(0, 1), ylabel="fraction of slips up to it")
    dress(drops.xaxis, data["drop"])

    pairs.plot(data["peak"], data["trough"], ".", color=BLACK, markersize=3)
    dress(pairs.xaxis, data["peak"])
    dress(pairs.yaxis, data["trough"])

    rate.plot(data["peak_time"], data["loading_rate"], ".", color=BLACK, markersize=3)
    known = data["loading_rate"].values[1:]
    third = max(known.size // 3, 1)
    when = data["peak_time"].values[1:]
    for part in (slice(0, third), slice(known.size - third, None)):
        rate.plot(when[part][[0, -1]], [np.median(known[part])] * 2, color=VERMILLION)
    rate.set_ylim(0, 2.0 * float(np.median(known)))
    dress(rate.xaxis, data["peak_time"])
    dress(rate.yaxis, data["loading_rate"])
    for ax, title in zip((trace, drops, pairs, rate), "abcd", strict=True):
        ax.set_title(f"({title})", loc="left")
    return figure


@house_style()
def fitted(found: Fit) -> Figure:
    """Draw some slips of the trace above simulated ones, the test of its statistics, and the parameters' intervals.

    Parameters
    ----------
    found : Fit
        What `stickslip.fit` returns.
    """
    figure = new_figure(PAGE, 6.6)
    grid = figure.add_gridspec(3, 2, height_ratios=(1, 1, 4))
    measured = figure.add_subplot(grid[0, :])
    simulated = figure.add_subplot(grid[1, :], sharex=measured, sharey=measured)
    test, parameters = (figure.add_subplot(grid[2, i]) for i in range(2))
    _beside(measured, simulated, found)
    low, middle, high = np.quantile(found.predicted, (0.025, 0.5, 0.975), axis=0)
    scale = np.maximum(high - low, 1e-12) / 4.0
    for row, (name, p) in enumerate(found.p_values.items()):
        at = -row - (0.6 if row >= _FITTED else 0.0)
        colour = VERMILLION if p < _LOW else BLACK
        ends = [(low[row] - middle[row]) / scale[row], (high[row] - middle[row]) / scale[row]]
        here = (found.events.statistics[row] - middle[row]) / scale[row]
        test.plot(ends, [at, at], color=SKY, linewidth=4)
        test.plot(np.clip(here, -_WIDEST, _WIDEST), at, "o", color=colour, markersize=4)
        test.annotate(name, (-_WIDEST - 0.2, at), ha="right", va="center", fontsize=7, annotation_clip=False)
        test.annotate(f"{p:.2g}", (_WIDEST + 0.2, at), va="center", fontsize=7, color=colour, annotation_clip=False)
    test.set(xlim=(-_WIDEST, _WIDEST), yticks=[], xlabel="(value - median) / (range of 95 % / 4)")
    test.set_title("trace (dot), draws (bar), p", loc="left")
    test.spines["left"].set_visible(False)

    parts = found.prior.parts(found.values)
    for row, one in enumerate(found.parameters):
        low_part, middle_part, high_part = np.quantile(parts[:, row], (0.05, 0.5, 0.95))
        parameters.plot([0, 1], [-row, -row], color="#DDDDDD", linewidth=7, solid_capstyle="butt")
        parameters.plot([low_part, high_part], [-row, -row], color=BLUE, linewidth=7, solid_capstyle="butt")
        parameters.plot(middle_part, -row, "|", color="white", markersize=7)
        parameters.annotate(
            f"{one.key.replace('_', ' ')}: {str(one).partition(', to')[0]}, {one.verdict}",
            (0, -row + 0.22),
            fontsize=7,
            annotation_clip=False,
        )
    parameters.set(xlim=(0, 1), ylim=(-len(found.parameters) + 0.4, 0.7), xticks=[], yticks=[])
    parameters.set_title("90 % intervals within the prior", loc="left")
    for side in ("left", "bottom"):
        parameters.spines[side].set_visible(False)
    return figure


def _beside(measured: Axes, simulated: Axes, found: Fit) -> None:
    """A dozen slips of the trace from its middle, and as long a part of a simulated one, to the same scales."""
    events, made = found.events, found.simulated()
    begin, lasts = events.time[events.peak_at[len(events) // 2]], _SHOWN * events.recurrence
    middle = 0.4 * float(made["time"][-1])
    for ax, t, force, colour, title in (
        (measured, events.time - begin, events.force, BLACK, "measured"),
        (
            simulated,
            made["time"].values - middle,
            made["spring_force"].values,
            BLUE,
            "simulated, the draw nearest to the medians",
        ),
    ):
        inside = (t >= 0.0) & (t <= lasts)
        ax.plot(t[inside], force[inside], color=colour, linewidth=0.8)
        ax.set_title(title, loc="left")
        ax.set_ylabel(f"force ({events.force_unit})" if events.force_unit not in ("", "1") else "force")
    measured.tick_params(labelbottom=False)
    simulated.set_xlabel(f"time ({events.time_unit})" if events.time_unit else "time")


_FITTED, _WIDEST, _LOW, _SHOWN = 9, 4.0, 0.02, 12
