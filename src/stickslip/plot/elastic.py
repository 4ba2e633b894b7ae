"""Pictures of elastic sliders: fronts in space and time, their speed, and the
precursors of sliding.
"""

import contextlib
import math
from dataclasses import replace
from typing import Literal

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from stickslip import measure
from stickslip.arrays import Array
from stickslip.elastic import Front, front_speed, front_threshold, precursor_force
from stickslip.errors import InputError
from stickslip.measure.fronts import gone, large_events, on_blocks, pixels
from stickslip.model import Chain, Delay, Gaussian, Prestressed, Rig
from stickslip.plot import style
from stickslip.plot.palette import (
    BLACK,
    BLUE,
    COLUMN,
    COMPARED,
    GREY,
    ORANGE,
    PAGE,
    VERMILLION,
)
from stickslip.plot.style import (
    along_time,
    dress,
    given_or_new,
    house_style,
    label,
    legend_above,
    panel,
)
from stickslip.simulation import rig_of

What = Literal["attached", "velocity", "force"]

_MOST_ROWS = 1200  # most pixels along the time
_APART = 0.02  # smallest distance of two numbers, as a fraction of the time of a run
_DECADES = 4.0  # decades of velocity below the largest that are shown


@house_style()
def spacetime(
    run: xr.Dataset,
    what: What = "attached",
    ax: Axes | None = None,
    *,
    upright: bool = True,
) -> Axes:
    """Draw the state of each block of an elastic slider over block number and time.

    Parameters
    ----------
    run : Dataset
        A run of a `Chain`, or one row of a `Sheet`; select a time first to see one
        event: ``run.sel(time=slice(0, 200))``.
    what : {"attached", "velocity", "force"}
        Fraction of attached contacts, relative to that of each block at the start of
        the picture; velocity of the blocks, in decades; or friction force.
    ax : Axes, optional
        Axes for the picture; by default those of a new figure.
    upright : bool
        Whether time runs upwards rather than to the right.

    Examples
    --------
    >>> stiff = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.0), delay=ss.Delay(float("inf"))
    ... )
    >>> bar = ss.Chain(blocks=100, coupling=1.0, mass=1.0, damping=0.0)
    >>> push = ss.Prestressed(stretching=0.7, push=3.0, pushed_blocks=3)
    >>> rig = ss.Rig(
    ...     stiff,
    ...     bar,
    ...     ss.constant(0.0, duration=100),
    ...     method=ss.Contacts(10),
    ...     start=push,
    ... )
    >>> ss.plot.spacetime(ss.simulate(rig)).get_xlabel()
    'block'
    """
    field = on_blocks(run, "friction_force" if what == "force" else what, "plot")
    drawn, time, block = pixels(field, (_MOST_ROWS, field.sizes["block"]))
    text = label(field, most=32)
    scale = Normalize
    cmap = "cividis"
    if what == "velocity":
        scale = LogNorm
        cmap = "inferno"
        drawn = np.maximum(drawn, (float(drawn.max()) or 1.0) / 10.0**_DECADES)
    elif what == "attached":
        text = "attached, relative to before"
        drawn = drawn / np.where(field.values[0] > 0, field.values[0], 1.0)
    norm = scale(float(drawn.min()), float(drawn.max()))
    ax = given_or_new(ax, COLUMN * 1.35, 3.2)
    place = _places(run, block)
    edges = (place, time, drawn) if upright else (time, place, drawn.T)
    mesh = ax.pcolormesh(
        *edges,
        norm=norm,
        cmap=cmap,
        shading="flat",
        rasterized=True,
    )
    ax.figure.colorbar(mesh, ax=ax, pad=0.02, label=text)
    times, blocks = (ax.yaxis, ax.xaxis) if upright else (ax.xaxis, ax.yaxis)
    dress(times, field["time"])
    dress(blocks, place)
    return ax


def _places(run: xr.Dataset, block: Array) -> xr.DataArray:
    """Return the positions of blocks along a slider, as lengths if that of a block is
    known.
    """
    found = xr.DataArray(block, attrs={"long_name": "block"})
    with contextlib.suppress(InputError):  # the Dataset does not hold its rig
        rig = rig_of(run)
        if (spacing := rig.natural.slider.spacing) is not None:
            look = {
                "long_name": "place along the bar",
                "units": rig.unit_name("length"),
            }
            found = ((found + 0.5) * spacing * rig.unit("length")).assign_attrs(look)
    return found


@house_style()
def elastic_overview(run: xr.Dataset) -> Figure:
    """Draw a run of a `Chain`, or a row of a `Sheet`: the spring force with its events,
    and the velocity of all blocks, over time.
    """
    figure = style.new_figure(PAGE, 4.8)
    upper, lower = figure.subplots(2, 1, sharex=True)
    precursors(run, upper)
    spacetime(run, "velocity", lower, upright=False)
    upper.set_xlabel("")
    upper.set_xlim(*lower.get_xlim())
    return figure


@house_style()
def fronts(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the speed at which contacts first broke along a `Chain` in a run, with the
    speed of sound.
    """
    found = measure.fronts(run)
    speed = found["speed"].where(found["speed"] > 0)
    ax = given_or_new(ax)
    ax.semilogy(
        speed["block"],
        speed,
        ".",
        color=BLUE,
        markersize=3,
        label="first breaks",
    )
    _dress_speed(ax, rig_of(run))
    low, high = ax.get_ylim()
    if high < 10.0 * low:
        decades = math.floor(math.log10(low)), math.ceil(math.log10(high))
        ax.set_ylim(*(10.0**decade for decade in decades))
    for i, end in enumerate(found["last_block"].values[:-1]):
        ax.axvline(end, color=VERMILLION, linewidth=0.8, label=None if i else "arrest")
    panel(ax, "", "block", None, "above", xlim=(-0.5, run.sizes["block"] - 0.5))
    return ax


@house_style()
def front_curve(data: xr.Dataset | Rig, ax: Axes | None = None) -> Axes:
    """Draw the speed of fronts against the prestress ahead of them.

    For a run of a `Chain` from a `Prestressed` start, it draws the local speed against
    the local prestress, with the exact curve; for a rig, the curve alone.
    """
    rig = data if isinstance(data, Rig) else rig_of(data)
    ax = given_or_new(ax)
    # each block that the first front passes, except near its ends
    if isinstance(data, xr.Dataset):
        start = rig.start
        interface = rig.natural.interface
        chain = _chain(rig)
        if not isinstance(start, Prestressed):
            raise InputError(
                f"front_curve: Rig.start = {start!r}: needs a run from a Prestressed "
                "start, or a rig"
            )
        sliding = interface.sliding_force
        strength = interface.threshold_distribution.moment(1)
        stretching = np.broadcast_to(start.stretching, chain.blocks)
        local = (stretching - sliding) / (strength - sliding)
        found = measure.fronts(data)
        # without a front no block is shown
        end = max(int(found["last_block"][:1].sum()) - 10, 0)
        inside = slice(start.pushed_blocks + 11, end)
        ax.plot(
            local[inside],
            found["speed"][inside],
            ".",
            color=BLUE,
            markersize=3,
            label="along the run",
        )
    least = front_threshold(rig)
    theory = list[Front]()
    # above some prestress, contacts break without a front
    with contextlib.suppress(InputError):
        for tau in least + (0.98 - least) * np.linspace(0.0, 1.0, 41)[1:] ** 2:
            theory.append(front_speed(rig, prestress=float(tau)))
    if not theory:
        raise InputError(
            f"front_curve: Interface.thresholds = {rig.interface.thresholds}: no "
            "prestress gives a front"
        )
    moving = [(front.prestress, front.speed) for front in theory if front.speed > 0]
    ax.plot(*np.transpose(moving), color=BLACK, label=f"theory ({theory[0].blocks})")
    _dress_speed(ax, rig)
    ax.axvline(least, color=ORANGE, linewidth=0.9, label="threshold")
    ax.set(
        xlabel="prestress, from sliding force to strength", xlim=(0, 1), ylim=(0, None)
    )
    legend_above(ax, columns=2)
    return ax


@house_style()
def precursors(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the spring force of a `Chain` pulled at one end, with a dot for each
    precursor and the number of the block that it reaches.
    """
    ax, _ = along_time(run, "spring_force", ax, 2.6, color=GREY, linewidth=0.9)
    found = large_events(run).sortby("reach", ascending=False)
    whole = found["blocks"] >= run.sizes["block"]
    for kind, colour, text in (
        (~whole, BLUE, "precursor, with the block it reaches"),
        (whole, VERMILLION, "slip of all blocks"),
    ):
        if kind.any():
            ax.plot(
                found["start"][kind],
                found["force_before"][kind],
                "o",
                color=colour,
                markersize=3.5,
                label=text,
            )
    written: list[float] = []  # times of the numbers; the longest events come first
    columns = found[["start", "force_before", "reach"]].to_array()
    for x, y, reach in columns.values.T[~whole.values]:
        if all(abs(x - other) > _APART * float(run["time"][-1]) for other in written):
            ax.annotate(
                f"{reach:.0f}",
                (x, y),
                (0, 4),
                textcoords="offset points",
                ha="center",
                fontsize=7,
            )
            written.append(x)
    legend_above(ax)
    return ax


@house_style()
def precursor_lengths(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the length of each precursor against the spring force before it, with the
    exact curve.

    The run is one of a `Chain` pulled at one end; the curve is that of a first slow
    pull, with all thresholds at their mean, and without re-attachment.
    """
    found = large_events(run)
    rig = rig_of(run)
    ax = given_or_new(ax)
    ax.plot(
        found["force_before"],
        found["reach"],
        "o",
        color=BLUE,
        markersize=3.5,
        label="events of the run",
    )
    thresholds = rig.interface.threshold_distribution
    alike = replace(
        rig.interface,
        thresholds=Gaussian(mean=thresholds.moment(1), std=0.0),
        delay=Delay(float("inf")),
    )
    exact = precursor_force(replace(rig, interface=alike))
    rising = slice(0, int(exact.values.argmax()) + 1)
    ax.plot(
        exact.values[rising],
        exact["tip"].values[rising],
        color=BLACK,
        label="theory",
    )
    panel(
        ax,
        "",
        run["spring_force"],
        "blocks that slip",
        "above",
        ylim=(0, run.sizes["block"] * 1.03),
    )
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    return ax


@house_style()
def slip_profiles(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the slip of each block of a `Chain` in each event, later events brighter."""
    moved = on_blocks(run, "displacement", "plot")
    found = large_events(run)
    if found.sizes["event"] == 0:
        raise InputError(
            "slip_profiles: the run holds no event of 3 blocks or more; run "
            "it for longer"
        )
    ax = given_or_new(ax)
    titled = moved.attrs | {"long_name": "slip in an event"}
    slips = gone(moved, found).assign_attrs(titled)
    colours = mpl.colormaps["cividis"](np.linspace(0.0, 0.9, slips.sizes["event"]))
    for slip, colour in zip(slips, colours, strict=True):
        ax.plot(moved["block"], slip, color=colour, linewidth=0.9)
    panel(
        ax,
        "",
        "block",
        slips,
        xlim=(0, run.sizes["block"] - 1),
        ylim=(0, None),
    )
    return ax


def _dress_speed(ax: Axes, rig: Rig) -> None:
    """Label an axis of front speeds, and mark the speed of sound."""
    sound = _chain(rig).sound_speed * rig.unit("1/time")
    ax.axhline(sound, label="sound", **COMPARED)
    unit = "time unit" if rig.scales is None else "s"
    ax.set_ylabel(f"front speed (blocks per {unit})")


def _chain(rig: Rig) -> Chain:
    body = rig.natural.slider
    if not isinstance(body, Chain):
        raise InputError(f"plot: Rig.slider = {body!r}: this picture is of a Chain")
    return body
