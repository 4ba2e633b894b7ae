"""Pictures of a run or a measured trace."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.arrays import Range, units_of
from stickslip.errors import InputError, printable, whole
from stickslip.measure import Regime, counted, regime, regime_and_drops
from stickslip.measure.fronts import is_of_a_chain
from stickslip.plot import style
from stickslip.plot.elastic import elastic_overview
from stickslip.plot.palette import (
    BLACK,
    BLUE,
    COMPARED,
    DASHED,
    GREEN,
    GREY,
    ORANGE,
    PAGE,
    PURPLE,
    SKY,
    VERMILLION,
)
from stickslip.plot.style import (
    along_time,
    dress,
    envelope,
    given_or_new,
    house_style,
    legend_above,
    panel,
    variable,
)
from stickslip.words import engineering, number, prefixed

_MANY_SLIPS = 60  # more slips than this are marked by smaller dots
_STRIP = 1.1  # height of the strip of a part of a structure, in inches
_MOST_STRIPS = 6
_DRIFT = 2.0  # a drift of more than this many peak to peaks is removed from a part
_ZOOM = 6  # slips of a measured trace that are drawn enlarged
# with velocities above this many times the drive's, the axis is logarithmic
_WIDE_RANGE = 25.0


@house_style()
def force_trace(
    run: xr.Dataset,
    ax: Axes | None = None,
    *,
    events: xr.Dataset | None = None,
    color: str = BLUE,
) -> Axes:
    """Draw the spring force of a run or a measured trace against time, with marks for
    `events` that `stickslip.drops` returned.
    """
    ax, force = along_time(run, "spring_force", ax, color=color)
    if events is not None and events.sizes.get("event"):
        _mark_slips(ax, force, events)
    if "filled" in run and bool(run["filled"].any()):
        gap = force[run["filled"].values.astype(bool)]
        size = 4.0 if gap.size <= _MANY_SLIPS else 1.5
        ax.plot(
            gap["time"],
            gap,
            "x",
            color=BLACK,
            markersize=size,
            label=f"{gap.size} filled in",
        )
    # the coefficient of friction is another scale of the same line or, if the load
    # changes, a line of its own
    if "mu" in run and "load" in run:
        right = ax.twinx()
        right.spines["right"].set_visible(True)
        along_time(
            run,
            "mu",
            right,
            color=PURPLE,
            linewidth=0.7 if np.ptp(run["load"].values) else 0.0,
        )
    legend_above(ax)
    return ax


@house_style()
def velocity(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the velocities of the slider and of the drive against time.

    If the slider becomes more than 25 times as fast as the drive, the axis is
    logarithmic above the drive's velocity.
    """
    ax, speed = along_time(run, "velocity", ax, color=GREEN, label="slider")
    if "drive_velocity" in run:
        drive = variable(run, "drive_velocity")
        thinned = envelope(run["time"].values, drive.values)
        ax.plot(*thinned, label="drive", **COMPARED)
        usual = float(abs(drive).max())
        if 0.0 < _WIDE_RANGE * usual < float(abs(speed).max()):
            # labels within the linear part would overlap around 0
            ax.set_yscale("symlog", linthresh=usual)
            ax.yaxis.set_major_formatter(
                lambda value, _: "" if 0 < abs(value) < usual else style.minus(value)
            )
        dress(ax.yaxis, speed)
        legend_above(ax)
    return ax


@house_style()
def attached(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the fraction of attached contacts against time."""
    ax, fraction = along_time(run, "attached", ax, color=PURPLE)
    ax.set_ylim(min(0.0, float(fraction.min())), 1.03)
    return ax


def _load(run: xr.Dataset, ax: Axes) -> Axes:
    """Draw the changing normal load of a run against time."""
    ax, load = along_time(run, "load", ax, color=ORANGE)
    ax.set_ylim(0.0, 1.05 * float(load.max()))
    ax.set_ylabel("normal load\n(1: usual)")
    return ax


@house_style()
def phase_portrait(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the spring force against the velocity of the slider: a point for smooth
    sliding, a loop for stick-slip.

    Select the part of a run after the transient: ``run.sel(time=slice(10, None))``.
    """
    speed = variable(run, "velocity")
    force = variable(run, "spring_force")
    ax = given_or_new(ax)
    ax.plot(
        speed,
        force,
        color=BLUE,
        linewidth=0.8,
        rasterized=speed.size > 10 * style.MOST_POINTS,
    )
    panel(ax, "", speed, force)
    return ax


@house_style()
def part(run: xr.Dataset, ax: Axes | None = None, *, number: int = 1) -> Axes:
    """Draw the displacement in one mode or coordinate of a structure against time,
    without its drift if it moves along with the drive.
    """
    if "parts" not in run:
        raise InputError("part: needs a run of a structure, which holds its parts")
    every = run["parts"]
    number = whole("part: number", number, at_least=1, at_most=every.sizes["mode"])
    one = every.isel(mode=number - 1)
    time = run["time"].values
    line = np.polynomial.Polynomial.fit(time, one.values, 1)(time)
    rest = one - line
    drifts = bool(np.ptp(line) > _DRIFT * np.ptp(rest.values))
    name = str(every.attrs["long_name"]).removeprefix("displacement by each ")
    words = f"{name} {number}" + " less drift" * drifts
    drawn = (rest if drifts else one).assign_attrs(every.attrs | {"long_name": words})
    ax, _ = along_time(
        run.assign(one=drawn),
        "one",
        ax,
        color=SKY,
        linewidth=0.8,
    )
    return ax


def _at_contacts(run: xr.Dataset, ax: Axes) -> Axes:
    """Draw the friction force against time."""
    own = run["friction_force"].assign_attrs(long_name="friction")
    return along_time(run.assign(own=own), "own", ax, color=GREY, linewidth=0.8)[0]


def _largest_parts(run: xr.Dataset) -> list[int]:
    """Return the numbers of the parts of a structure that move most, sorted."""
    if "parts" not in run:
        return []
    spread = run["parts"].std("time").to_numpy()
    return sorted((np.argsort(-spread)[:_MOST_STRIPS] + 1).tolist())


_ENERGIES = {
    "broken_energy": ("lost by the contacts", VERMILLION),
    "damped_energy": ("lost to damping", ORANGE),
    "contact_energy": ("in contacts", SKY),
    "spring_energy": ("in the spring", GREEN),
    "kinetic_energy": ("kinetic", PURPLE),
}


@house_style()
def energy(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the energies into which the work of the drive has gone, stacked, and the
    work, which is their sum, on top.
    """
    # envelopes cannot be stacked, so take one sample of each group
    thin = run.isel(
        time=slice(None, None, max(1, run.sizes["time"] // style.MOST_POINTS))
    )
    parts = [variable(thin, name) for name in _ENERGIES]
    work = variable(thin, "work")
    ax = given_or_new(ax, PAGE)
    names, colours = zip(*_ENERGIES.values(), strict=True)
    ax.stackplot(
        thin["time"], *parts, labels=names, colors=colours, alpha=0.75, linewidth=0
    )
    total = work + sum(float(part[0]) for part in parts)
    ax.plot(
        thin["time"],
        total,
        color=BLACK,
        linestyle=DASHED,
        label="work of the drive",
    )
    words = str(work.attrs.get("long_name", "")).replace("work of the drive", "energy")
    panel(
        ax,
        "",
        thin["time"],
        total.assign_attrs(work.attrs | {"long_name": words}),
    )
    ax.margins(x=0)
    legend_above(ax, columns=3)
    return ax


@house_style()
def overview(
    run: xr.Dataset, *, events: xr.Dataset | None = None, seen: Regime | None = None
) -> Figure:
    """Draw an overview of a run: its force with marked slips, velocities, attached
    fraction, changing load, and the modes or coordinates of a structure, as far as it
    has them.

    For a chain, draw the force with its events, and the velocity of every block. For a
    measured trace with stick-slip, also draw six slips enlarged, the sizes of drops,
    troughs against peaks, and drops against recurrence times.

    Parameters
    ----------
    run : Dataset
        A run or a measured trace.
    events : Dataset, optional
        Slips to mark; by default those that `stickslip.drops` finds, if the regime is
        stick-slip.
    seen : Regime, optional
        The regime, if it is known.

    Raises
    ------
    InputError
        If the Dataset has no spring force, or too few samples to find slips.
    """
    variable(run, "spring_force")
    if events is None and is_of_a_chain(run):
        return elastic_overview(run)
    if seen is None:
        seen, found = regime_and_drops(run)
        events = found if events is None and seen.kind == "stick-slip" else events
    below = {"velocity": velocity, "attached": attached}
    panels: list[Callable[[xr.Dataset, Axes], Axes]]
    panels = [draw for name, draw in below.items() if name in run]
    if "attached" in run and "load" in run:
        panels.append(_load)
    heights = [2.4, *[1.7] * len(panels)]
    if strips := [partial(part, number=number) for number in _largest_parts(run)]:
        panels += [_at_contacts, *strips]
        heights += [_STRIP] * (1 + len(strips))
    rows = 1 + len(panels)
    measured = (
        "attached" not in run
        and events is not None
        and events.sizes["event"] > 2 * _ZOOM
    )
    if measured:
        heights += [2.0, 2.4]
    figure = style.new_figure(PAGE, sum(heights))
    grid = figure.add_gridspec(len(heights), 3, height_ratios=heights)
    axes = [figure.add_subplot(grid[0, :])]
    axes += [figure.add_subplot(grid[row, :], sharex=axes[0]) for row in range(1, rows)]
    if measured and events is not None:
        begin, end = _zoomed(figure.add_subplot(grid[-2, :]), run, events)
        axes[0].axvspan(begin, end, facecolor=GREY, alpha=0.4, linewidth=0)
        _draw_drops(
            [figure.add_subplot(grid[-1, column]) for column in range(3)],
            events,
        )
    force_trace(run, axes[0], events=None if measured else events).set_title(
        _title(run, seen)
    )
    _shade_parts(axes[0], seen)
    if read := run.attrs.get("read"):
        figure.supxlabel(printable(str(read)), fontsize="xx-small", color=GREY)
    for draw, ax in zip(panels, axes[1:], strict=True):
        draw(run, ax)
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
        ax.set_xlabel("")
    figure.align_ylabels(axes)
    return figure


@house_style()
def side_by_side(left: xr.Dataset, right: xr.Dataset) -> Figure:
    """Draw the forces of two runs on one scale, titled with the regime and the speed of
    the drive.
    """
    figure = style.new_figure(PAGE, 2.3)
    axes = figure.subplots(1, 2, sharey=True)
    for ax, run in zip(axes, (left, right), strict=True):
        seen = regime(run)
        smooth = seen.kind == "smooth sliding"
        force_trace(run, ax, color=GREEN if smooth else BLUE)
        speed = seen.drive_velocity
        at = "" if speed is None else f" at {_speed(speed, run)}"
        ax.set_title(f"{seen.kind}{at}")
    axes[1].set_ylabel("")
    return figure


_SHADES = {"stick-slip": VERMILLION, "sustained oscillation": ORANGE}
_SHADES |= {"smooth sliding": GREEN, "undecided": GREY}


def _shade_parts(ax: Axes, seen: Regime) -> None:
    """Shade the parts of a record that were judged separately by their kinds."""
    named = set[str]()
    for part in seen.segments:
        label = part.kind if part.kind not in named else None
        named.add(part.kind)
        ax.axvspan(
            *part.window,
            facecolor=_SHADES[part.kind],
            alpha=0.16,
            linewidth=0,
            label=label,
        )
    if named:
        legend_above(ax)


def _zoomed(ax: Axes, run: xr.Dataset, events: xr.Dataset) -> Range:
    """Draw six slips from the middle of a trace, and return the time they span."""
    first = events.sizes["event"] // 2 - _ZOOM // 2
    some = events.isel(event=slice(first, first + _ZOOM))
    around = float(np.nanmedian(events["recurrence"]))
    begin = float(some["start"][0]) - around
    end = float(some["end"][-1]) + around
    part = run[["spring_force"]].sel(time=slice(begin, end))
    force_trace(part, ax, events=some.assign_attrs(count=_ZOOM)).set_xlim(begin, end)
    return begin, end


def _draw_drops(axes: Sequence[Axes], events: xr.Dataset) -> None:
    """Draw the sizes of drops, troughs against peaks, and drops against recurrence
    times.
    """
    drop, peak, trough, recurrence = (
        events[name].assign_attrs(long_name=title)
        for name, title in (
            ("drop", "drop"),
            ("force_before", "peak"),
            ("force_after", "trough"),
            ("recurrence", "recurrence"),
        )
    )
    size = 6.0 if events.sizes["event"] <= _MANY_SLIPS else 3.0
    axes[0].hist(drop, bins="auto", color=BLUE)
    panel(
        axes[0],
        "",
        drop,
        f"number of {events.attrs.get('drops_are', 'slips')}",
    )
    for ax, across, up in ((axes[1], peak, trough), (axes[2], recurrence, drop)):
        ax.plot(across, up, ".", color=BLUE, markersize=size)
        panel(ax, "", across, up)


def _title(run: xr.Dataset, seen: Regime) -> str:
    """Return a title: the speeds of a drive that changes, else the regime, with its
    frequency and drop.
    """
    if "drive_velocity" in run:
        low = float(run["drive_velocity"].min())
        high = float(run["drive_velocity"].max())
        if high - low > 0.02 * max(-low, high):
            return f"drive from {_speed(low, run)} to {_speed(high, run)}"
    if seen.is_in_turn:
        return seen.reason
    if seen.half_width is not None:
        return f"friction loop, ±{engineering(seen.half_width, seen.force_unit, 3)}"
    if seen.drops_are == "drops" or not math.isfinite(seen.period):
        return seen.kind
    how_often = f"period {engineering(seen.period, seen.time_unit, 3)}"
    if math.isfinite(seen.frequency):
        how_often = engineering(seen.frequency, "Hz", 3)
    drop = engineering(seen.drop, seen.force_unit, 3)
    return f"{seen.kind}, {how_often}, drop {drop}"


def _speed(value: float, run: xr.Dataset) -> str:
    # three digits, as the samples of a ramp may miss its exact end
    factor, unit = prefixed(value, units_of(run["drive_velocity"]), 3)
    return f"{number(value / factor, 3)} {style.unit_text(unit)}".strip()


def _mark_slips(ax: Axes, force: xr.DataArray, events: xr.Dataset) -> None:
    """Shade the slips, and mark the peak before each with a dot."""
    start = events["start"].values
    lasts = events["end"].values - start
    slips = events.attrs.get("drops_are", "slips") == "slips"
    ax.broken_barh(
        list(zip(start, lasts, strict=True)),
        (0, 1),
        transform=ax.get_xaxis_transform(),
        facecolor=ORANGE,
        alpha=0.3,
        linewidth=0,
        zorder=0.5,
        label="slipping" if slips else "falling",
    )
    peaks = events["force_before"].values
    if "stroke" in events:  # the forces of strokes are given without their offset
        peaks = np.interp(start, force["time"].values, force.values)
    ax.plot(
        start,
        peaks,
        "o",
        color=VERMILLION,
        label=counted(events),
        markersize=4.0 if start.size <= _MANY_SLIPS else 2.0,
        markeredgewidth=0,
    )
