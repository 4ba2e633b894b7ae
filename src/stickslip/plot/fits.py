"""Pictures of fits: the slips of a trace, and its statistics compared with those of the
draws; velocity steps and holds.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from stickslip.plot.palette import (
    BLACK,
    BLUE,
    COLUMN,
    COMPARED,
    GREY,
    PAGE,
    SKY,
    VERMILLION,
)
from stickslip.plot.style import (
    envelope,
    house_style,
    interval,
    legend_above,
    new_figure,
    panel,
)

# `stickslip.fitting.Fit` or `stickslip.rate_state.StepFit`, which this module may not
# import, as they are in higher layers
Fit = Any
Step = Any  # `stickslip.rate_state.Step`
_WIDEST = 4.0  # range of the deviations of statistics, in standard deviations
_LOW = 0.02  # p below which a statistic is marked
_SHOWN = 12  # most slips, or steps, that are drawn


@house_style()
def slips(data: xr.Dataset) -> Figure:
    """Draw the result of `Events.to_dataset`: the trace with its slips, their drops,
    troughs against peaks, and the loading rate.
    """
    figure = new_figure(PAGE, 4.6)
    (trace, drops), (pairs, rate) = figure.subplots(2, 2)
    trace.plot(
        *envelope(data["time"].values, data["spring_force"].values),
        color=GREY,
        linewidth=0.6,
    )
    for name, colour, text in (
        ("peak", VERMILLION, "before a slip"),
        ("trough", BLUE, "after it"),
    ):
        trace.plot(
            data[f"{name}_time"],
            data[name],
            ".",
            color=colour,
            markersize=3,
            label=text,
        )
    legend_above(trace)
    drops.ecdf(data["drop"].values, color=BLACK)
    drops.axvline(data.attrs["smallest"], **COMPARED)
    drops.set(ylim=(0, 1), ylabel="fraction of slips up to it")
    pairs.plot(
        data["peak"],
        data["trough"],
        ".",
        color=BLACK,
        markersize=3,
    )
    rate.plot(
        data["peak_time"],
        data["loading_rate"],
        ".",
        color=BLACK,
        markersize=3,
    )
    known = data["loading_rate"].values[1:]
    when = data["peak_time"].values[1:]
    third = max(known.size // 3, 1)
    for part in (slice(0, third), slice(-third, None)):
        rate.plot(when[part][[0, -1]], [np.median(known[part])] * 2, color=VERMILLION)
    rate.set_ylim(0, 2.0 * float(np.median(known)))
    for ax, title, across, up in (
        (trace, "(a)", "time", "spring_force"),
        (drops, "(b)", "drop", ""),
        (pairs, "(c)", "peak", "trough"),
        (rate, "(d)", "peak_time", "loading_rate"),
    ):
        panel(ax, title, data[across], data.get(up))
    return figure


@house_style()
def fitted(found: Fit) -> Figure:
    """Draw a `fit`: slips of the trace and simulated slips, the test of the statistics,
    and the intervals of the parameters.
    """
    figure = new_figure(PAGE, 6.6)
    measured, simulated, test, parameters = figure.subplot_mosaic(
        "aa;bb;cd", height_ratios=(1, 1, 4)
    ).values()
    simulated.sharex(measured)
    simulated.sharey(measured)
    # a dozen slips from the middle of the trace, and an equally long part of a
    # simulated trace, on the same scales
    events = found.events
    made = found.simulated()
    begin = events.time[events.peak_at[len(events) // 2]]
    lasts = _SHOWN * events.recurrence
    time = made["time"].values - 0.4 * float(made["time"][-1])
    units = {"time": events.time_unit, "force": events.force_unit}
    along = [
        name if unit in ("", "1") else f"{name} ({unit})"
        for name, unit in units.items()
    ]
    closest = "simulated, the draw nearest to the medians"
    for ax, t, force, colour, title in (
        (measured, events.time - begin, events.force, BLACK, "measured"),
        (simulated, time, made["spring_force"].values, BLUE, closest),
    ):
        inside = (t >= 0.0) & (t <= lasts)
        ax.plot(t[inside], force[inside], color=colour, linewidth=0.8)
        panel(ax, title, *along)
    measured.label_outer()
    _draw_test(test, found)
    _draw_intervals(parameters, found)
    return figure


def _draw_test(ax: Axes, found: Fit) -> None:
    """Draw the statistics of the trace beside those of simulated series of the draws,
    in standard deviations of the latter.
    """
    for row, one in enumerate(found.test.reset_index().itertuples()):
        at = -row - (0.0 if one.fitted else 0.6)
        colour = VERMILLION if one.p < _LOW else BLACK
        ax.plot(
            [one.low, one.high],
            [at, at],
            color=SKY,
            linewidth=4,
        )
        ax.plot(
            np.clip(one.here, -_WIDEST, _WIDEST),
            at,
            "o",
            color=colour,
            markersize=4,
        )
        text: Any = {"va": "center", "fontsize": 7, "annotation_clip": False}
        ax.annotate(
            one.name,
            (-_WIDEST - 0.2, at),
            ha="right",
            **text,
        )
        ax.annotate(
            f"{one.p:.2g}",
            (_WIDEST + 0.2, at),
            color=colour,
            **text,
        )
    panel(
        ax,
        "trace (dot), draws (bar), p",
        "(value - median) / (range of 95 % / 4)",
        xlim=(-_WIDEST, _WIDEST),
        yticks=[],
    )
    ax.spines["left"].set_visible(False)


def _draw_intervals(ax: Axes, found: Fit) -> None:
    """Draw the interval of each parameter within its prior."""
    for row, one in enumerate(found.parameters):
        low, middle, high = one.parts
        held: Any = {"color": "#DDDDDD", "linewidth": 7, "solid_capstyle": "butt"}
        ax.plot((0, 1), [-row, -row], **held)
        interval(ax, -row, (low, high), middle, BLUE)
        text = (
            f"{one.key.replace('_', ' ')}: {str(one).partition(', to')[0]}, "
            f"{one.verdict}"
        )
        ax.annotate(
            text,
            (0, -row + 0.22),
            fontsize=7,
            annotation_clip=False,
        )
    ends = -len(found.parameters) + 0.4, 0.7
    panel(ax, "90 % intervals within the prior", xlim=(0, 1), ylim=ends)
    ax.set(xticks=[], yticks=[])
    ax.spines[["left", "bottom"]].set_visible(False)


@house_style()
def velocity_step(
    step: Step, fits: Sequence[Fit], names: Sequence[str] = (), *, length: str = "um"
) -> Figure:
    """Draw a velocity step, as `velocity_step_in` returns it, with its fits and their
    residuals.

    The legend shows the `names` of the fits; `length` is the unit of the displacement.
    """
    figure = new_figure(PAGE, 3.6)
    upper, lower = figure.subplots(2, 1, height_ratios=[3, 1], sharex=True)
    x = step.displacement
    upper.plot(x, step.friction, ".", color=GREY, markersize=2.5, label="data")
    for k, (fit, colour) in enumerate(
        zip(fits, (BLUE, VERMILLION, "black"), strict=False)
    ):
        name = names[k] if k < len(names) else f"{fit.law} law"
        curve = fit.friction(x)
        upper.plot(x, curve, color=colour, label=name)
        lower.plot(
            x,
            step.friction - curve,
            color=colour,
            linewidth=0.7,
        )
    panel(upper, "", None, "friction", "above")
    panel(lower, "", f"displacement after the step ({length})", "residual")
    return figure


@house_style()
def steps_and_holds(found: Fit) -> Figure:
    """Draw the result of `fit_record`: the record with its steps and holds marked, each
    step with its fit, and the peaks after holds against the hold times.
    """
    length, clock, unit = found.record.units
    panels = [*found.steps[: _SHOWN - 1]] + [None] * bool(found.holds)
    rows = -(-len(panels) // 3)
    figure = new_figure(PAGE, 2.2 + 1.9 * rows)
    grid = figure.add_gridspec(1 + rows, 3)
    trace = figure.add_subplot(grid[0, :])
    trace.plot(
        *envelope(found.record.time, found.record.friction),
        color=GREY,
        linewidth=0.6,
    )
    for one in found.steps:
        trace.axvline(float(one.at), color=BLUE, linewidth=0.8)
    for at, _ in found.refused:
        trace.axvline(at, color=VERMILLION, linewidth=0.8)
    for one in found.holds:
        trace.axvspan(
            one.at,
            one.at + one.hold,
            color=SKY,
            alpha=0.4,
            linewidth=0,
        )
    friction = f"friction ({unit})" if unit else "friction"
    panel(trace, "record: steps (lines), holds (bands)", f"time ({clock})", friction)
    for k, fit in enumerate(panels):
        ax = figure.add_subplot(grid[1 + k // 3, k % 3])
        if fit is None:
            _draw_healing(ax, found, f"hold ({clock})")
            continue
        step = fit.step
        x = step.displacement
        ax.plot(x, step.friction, ".", color=GREY, markersize=1.5)
        ax.plot(x, fit.friction(x), color=BLUE)
        title = f"{step.before:.3g} to {step.after:.3g} {length}/{clock}"
        panel(ax, title, f"displacement ({length})", None)
    return figure


def _draw_healing(ax: Axes, found: Fit, across: str) -> None:
    """Draw the peaks after holds with their errors, and a line through their mean with
    the slope of the healing.
    """
    hold = np.array([one.hold for one in found.holds])
    peak = np.array([float(one.peak) for one in found.holds])
    errors = [one.peak.error for one in found.holds]
    ax.errorbar(hold, peak, errors, fmt="o", color=BLACK, markersize=3)
    ax.set_xscale("log")
    if found.healing is not None:
        decades = np.log10(hold) - np.log10(hold).mean()
        ax.plot(hold, peak.mean() + float(found.healing) * decades, color=BLUE)
    panel(ax, "peak after the hold", across, None)


@house_style()
def peaks_after_holds(run: xr.Dataset, per_decade: float | None = None) -> Figure:
    """Draw the peak of the force after each hold of a `slide_hold_slide` run, and the
    relaxation in it, against the hold time.

    The growth of the peaks `per_decade` by rate and state, ``b ln 10``, is drawn as a
    line through the last peak.
    """
    figure = new_figure(COLUMN, 3.6)
    upper, lower = figure.subplots(2, 1, height_ratios=[3, 2], sharex=True)
    run = run.sortby("hold")
    hold = run["hold"].values
    peak = run["peak"].values
    upper.semilogx(hold, peak, "o-", color=BLUE, markersize=3.5, label="contacts")
    if per_decade is not None:
        line = peak[-1] + per_decade * np.log10(hold / hold[-1])
        upper.semilogx(
            hold, line, "--", color=VERMILLION, label="slope by rate and state"
        )
    lower.semilogx(hold, run["relaxation"], "o-", color=BLUE, markersize=3.5)
    panel(
        upper,
        "",
        None,
        run["peak"].assign_attrs(long_name="peak above sliding"),
        "above",
    )
    panel(
        lower,
        "",
        run["hold"].assign_attrs(spacing="log"),
        run["relaxation"].assign_attrs(long_name="relaxation"),
    )
    lower.xaxis.set_major_locator(LogLocator())  # only decades fit a narrow picture
    return figure


@house_style()
def friction_at_speeds(table: xr.Dataset) -> Figure:
    """Draw friction against speed, as `stickslip.measure.friction_at_speeds` returns
    it, with bars of twice the standard error.
    """
    figure = new_figure(COLUMN, 2.6)
    ax = figure.add_subplot()
    ax.errorbar(
        table["velocity"],
        table["friction"],
        2.0 * table["error"],
        fmt="o-",
        color=BLUE,
        markersize=3.5,
        capsize=2.0,
    )
    panel(
        ax,
        "",
        table["velocity"].assign_attrs(spacing="log"),
        table["friction"],
    )
    return figure
