"""Pictures: a Dataset in, matplotlib Axes out.

Every function draws what the Dataset holds, a run of the model or a measured trace, in its own units: labels come from
``long_name`` and ``units`` of the variables. Without `ax` a function makes a figure of its own; write it with `save`:

>>> import stickslip as ss
>>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1))
>>> run = ss.simulate(interface, ss.Slider(stiffness=2.0, mass=1e-3, damping=20.0), ss.constant(1.0, duration=3))
>>> from stickslip.plot import overview, save
>>> save(overview(run), "run.png").name
'run.png'

Figures are plain `matplotlib.figure.Figure` objects, unknown to pyplot: nothing to close, no window system needed.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis, YAxis
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap, SymLogNorm
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.rcsetup import cycler
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.io import files
from stickslip.measure import drops
from stickslip.measure.arrays import check_numbers

Array = NDArray[np.float64]
Scale = Literal["linear", "log"]

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, YELLOW = "#0072B2", "#D55E00", "#CC79A7", "#F0E442"
GREY = "#7F7F7F"
PALETTE = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
"""Colours of Okabe and Ito, which colour-blind readers can tell apart; yellow is too pale for a line."""

COLUMN, PAGE = 3.5, 7.0
"""Widths of a printed column and page, in inches."""

_STYLE: Any = {
    "axes.axisbelow": True,
    "axes.labelsize": 9,
    "axes.linewidth": 0.7,
    "axes.prop_cycle": cycler(color=PALETTE),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9,
    "figure.constrained_layout.use": True,
    "figure.dpi": 120,
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.1,
    "lines.solid_capstyle": "round",
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
    "svg.hashsalt": "stickslip",
    "xtick.labelsize": 8,
    "xtick.major.width": 0.7,
    "ytick.labelsize": 8,
    "ytick.major.width": 0.7,
}

_FORMATS = ("png", "svg", "pdf")
_MOST_POINTS = 6_000  # a line of more is drawn by its envelope: the picture is the same, the file is not
_MANY_SLIPS = 60  # more are marked by smaller dots
_WIDE_RANGE = 25.0  # a velocity this many times that of the drive asks for a logarithmic axis


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in the style of the house within this context; what is set outside it stays as it is."""
    with mpl.rc_context(_STYLE):
        yield


def new_figure(width: float = COLUMN, height: float = 2.6) -> Figure:
    """Return an empty figure of a size in inches, in the style of the house."""
    with house_style():
        return Figure(figsize=(width, height), layout="constrained")


def new_axes(width: float = COLUMN, height: float = 2.6) -> Axes:
    """Return the axes of a new figure with one panel, in the style of the house."""
    with house_style():
        return new_figure(width, height).add_subplot()


# ---------------------------------------------------------------------------------------------------------------------
# Words
# ---------------------------------------------------------------------------------------------------------------------

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_TAKES_PREFIX = {"N", "m", "s", "m/s", "J", "N/m"}


def unit_text(units: str) -> str:
    """Return a unit as it is printed: ``"x_s/time"`` as "x_s per time unit" with a proper index; "" for none."""
    if units in ("", "1"):
        return ""
    if units == "time":
        return "time units"
    text = re.sub(r"/time\b", " per time unit", units)
    return re.sub(r"\b([A-Za-z]+)_([A-Za-z]+)\b|\b(k)\b", _as_symbol, text)


def _as_symbol(found: re.Match[str]) -> str:
    return f"${found[1]}_{{\\mathrm{{{found[2]}}}}}$" if found[1] else f"${found[3]}$"


def _drawable(text: str) -> str:
    """Return a text with its dollar signs as they are, if it is no formula that can be drawn."""
    try:
        MathTextParser("path").parse(text)
    except ValueError:
        return text.replace("$", r"\$")
    return text


def label(variable: xr.DataArray, *, units: str | None = None, most: int = 200) -> str:
    """Return the label of an axis: long name and unit of a variable.

    Parameters
    ----------
    variable : DataArray
    units : str, optional
        In place of its own.
    most : int
        Characters of a line; a longer label is broken into two.
    """
    name = str(variable.attrs.get("long_name", "" if variable.name is None else variable.name))
    units = str(variable.attrs.get("units", "")) if units is None else units
    name, unit = _drawable(name), _drawable(unit_text(units))
    words = [(word, len(word)) for word in name.split()]
    if unit:
        words.append((f"({unit})", len(units) + 2))
    if sum(length + 1 for _, length in words) - 1 > most and len(words) > 1:
        before = np.cumsum([length + 1 for _, length in words])
        cut = int(np.argmin(np.maximum(before[:-1], before[-1] - before[:-1]))) + 1
        return "\n".join(" ".join(word for word, _ in line) for line in (words[:cut], words[cut:]))
    return " ".join(word for word, _ in words)


def dress(axis: Axis, variable: xr.DataArray) -> None:
    """Label an axis with the name and unit of a variable; SI units get the prefix that suits the values."""
    units = str(variable.attrs.get("units", ""))
    values = np.abs(np.asarray(variable.values, dtype=float))
    largest = float(np.nanmax(values, initial=0.0))
    factor, prefix = 1.0, ""
    if units in _TAKES_PREFIX and largest > 0 and not 0.5 <= largest < 5e3:
        factor, prefix = next((p for p in _PREFIXES if largest >= 0.5 * p[0]), _PREFIXES[-1])
    most = 24 if isinstance(axis, YAxis) else 200
    axis.set_label_text(label(variable, units=prefix + units, most=most))
    if factor != 1.0:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / factor:.6g}".replace("-", "\N{MINUS SIGN}")))


# ---------------------------------------------------------------------------------------------------------------------
# Pictures of a run
# ---------------------------------------------------------------------------------------------------------------------


@house_style()
def force_trace(
    run: xr.Dataset, ax: Axes | None = None, *, events: xr.Dataset | None = None, color: str = BLUE
) -> Axes:
    """Draw the spring force against time.

    Parameters
    ----------
    run : Dataset
        A run or a measured trace: `F_d` along `t`.
    ax : Axes, optional
        Where to draw; by default a new figure.
    events : Dataset, optional
        Slips to mark, from `stickslip.drops`.
    color : str

    Raises
    ------
    InputError
        If the Dataset has no such variable.
    """
    force = _variable(run, "spring_force", "time")
    ax = new_axes(PAGE, 2.2) if ax is None else ax
    time = run["time"]
    ax.plot(*_envelope(time.to_numpy(), force.to_numpy()), color=color)
    if events is not None:
        _mark_slips(ax, events)
    if "filled" in run and bool(run["filled"].any()):
        gap = run["filled"].to_numpy().astype(bool)
        text = f"{np.count_nonzero(gap)} filled in"
        ax.plot(time.to_numpy()[gap], force.to_numpy()[gap], "x", color=BLACK, markersize=4, label=text)
    dress(ax.xaxis, time)
    dress(ax.yaxis, force)
    ax.margins(x=0.01)
    if ax.get_legend_handles_labels()[0]:
        legend_above(ax)
    return ax


@house_style()
def velocity(run: xr.Dataset, ax: Axes | None = None, *, scale: Scale | None = None) -> Axes:
    """Draw the velocity of the slider, and of the drive, against time.

    Parameters
    ----------
    run : Dataset
        A run: `velocity` along `t`.
    ax : Axes, optional
    scale : {"linear", "log"}, optional
        Logarithmic from the drive's velocity on, linear below it, as the slider may move back. By default
        logarithmic where the slider gets more than 25 times as fast as the drive.
    """
    speed = _variable(run, "velocity", "time")
    ax = new_axes(PAGE, 2.2) if ax is None else ax
    ax.plot(*_envelope(run["time"].to_numpy(), speed.to_numpy()), color=GREEN, label="slider")
    usual = 0.0
    if "drive_velocity" in run:
        drive = _variable(run, "drive_velocity", "time").to_numpy()
        usual = float(np.max(np.abs(drive)))
        ax.plot(
            *_envelope(run["time"].to_numpy(), drive), color=GREY, linewidth=0.9, linestyle=(0, (4, 2)), label="drive"
        )
        legend_above(ax)
    if scale is None:
        scale = "log" if usual > 0 and float(np.max(np.abs(speed.to_numpy()))) > _WIDE_RANGE * usual else "linear"
    if scale == "log":
        linear = usual or float(np.median(np.abs(speed.to_numpy()))) or 1.0
        ax.set_yscale("symlog", linthresh=linear)

        def tick(value: float, _: int | None) -> str:
            # Decades within the linear part crowd around 0.
            return "" if 0 < abs(value) < linear else f"{value:g}".replace("-", "\N{MINUS SIGN}")

        ax.yaxis.set_major_formatter(FuncFormatter(tick))
    dress(ax.xaxis, run["time"])
    dress(ax.yaxis, speed)
    ax.margins(x=0.01)
    return ax


@house_style()
def attached(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the fraction of attached contacts against time."""
    fraction = _variable(run, "attached", "time")
    ax = new_axes(PAGE, 2.2) if ax is None else ax
    ax.plot(*_envelope(run["time"].to_numpy(), fraction.to_numpy()), color=PURPLE)
    dress(ax.xaxis, run["time"])
    dress(ax.yaxis, fraction)
    ax.set_ylim(min(0.0, float(fraction.min())), 1.03)
    ax.margins(x=0.01)
    return ax


@house_style()
def phase_portrait(run: xr.Dataset, ax: Axes | None = None, *, after: float | None = None) -> Axes:
    """Draw the spring force against the velocity of the slider: a point for smooth sliding, a loop for stick-slip.

    Parameters
    ----------
    run : Dataset
        A run: `F_d` and `velocity` along `t`.
    ax : Axes, optional
    after : float, optional
        Draw what comes after this time, in the unit of `t`: the cycle without the transient.
    """
    _variable(run, "spring_force", "time")
    _variable(run, "velocity", "time")
    ax = new_axes() if ax is None else ax
    if after is not None:
        run = run.sel(time=slice(after, None))
        if run.sizes["time"] < 2:
            raise InputError(f"phase_portrait: after = {after:g}: the data hold no motion after that time")
    ax.plot(
        run["velocity"],
        run["spring_force"],
        color=BLUE,
        linewidth=0.8,
        rasterized=run.sizes["time"] > 10 * _MOST_POINTS,
    )
    dress(ax.xaxis, run["velocity"])
    dress(ax.yaxis, run["spring_force"])
    return ax


@house_style()
def stretchings(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the snapshots of the distribution of stretchings ``Q(x)`` that a run recorded."""
    if "stretching_density" not in run or set(run["stretching_density"].dims) != {"snapshot", "x"}:
        raise InputError("plot: this run holds no snapshots; record them with Output(snapshots=(1.0, 2.0))")
    for name in ("stretching_density", "snapshot", "x"):
        check_numbers("plot", run[name])
    ax = new_axes() if ax is None else ax
    count = run.sizes["snapshot"]
    colours = mpl.colormaps["cividis"](np.linspace(0.0, 0.9, count)) if count > len(PALETTE) else PALETTE
    time = unit_text(str(run["snapshot"].attrs.get("units", "")))
    time = "" if time == "time units" else f" {time}"
    for one, colour in zip(run["stretching_density"].transpose("snapshot", "x"), colours, strict=False):
        ax.plot(run["x"], one, color=colour, label=f"t = {float(one['snapshot']):.4g}{time}", drawstyle="steps-mid")
    dress(ax.xaxis, run["x"])
    dress(ax.yaxis, run["stretching_density"])
    ax.set_ylim(bottom=0)
    legend_above(ax, columns=min(count, 3))
    return ax


@house_style()
def rigid_curve(curve: xr.Dataset, ax: Axes | None = None, *, color: str = BLUE) -> Axes:
    """Draw the friction force against the displacement of a rigid slider, from `stickslip.slide`."""
    force = _variable(curve, "friction_force", "displacement")
    ax = new_axes() if ax is None else ax
    ax.plot(*_envelope(curve["displacement"].to_numpy(), force.to_numpy()), color=color)
    dress(ax.xaxis, curve["displacement"])
    dress(ax.yaxis, force)
    ax.margins(x=0.01)
    ax.set_ylim(bottom=min(0.0, float(force.min())))
    return ax


_ENERGIES = {
    "broken_energy": ("lost in breaks", VERMILLION),
    "damped_energy": ("lost to damping", ORANGE),
    "contact_energy": ("in contacts", SKY),
    "spring_energy": ("in the spring", GREEN),
    "kinetic_energy": ("kinetic", PURPLE),
}


@house_style()
def energy(run: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw where the work of the drive has gone: the parts stacked, and the work, which they add up to, on top."""
    parts = {name: _variable(run, name, "time") for name in _ENERGIES}
    work = _variable(run, "work", "time")
    ax = new_axes(PAGE, 2.6) if ax is None else ax
    t = run["time"].to_numpy()
    # An envelope would not stack; the last of each group of samples will do.
    kept = np.unique(np.append(np.arange(0, t.size, max(1, t.size // _MOST_POINTS)), t.size - 1))
    stack = [part.to_numpy()[kept] for part in parts.values()]
    names, colours = zip(*_ENERGIES.values(), strict=True)
    ax.stackplot(t[kept], *stack, labels=names, colors=colours, alpha=0.75, linewidth=0)
    start = sum(float(part[0]) for part in parts.values())
    ax.plot(t[kept], work.to_numpy()[kept] + start, color=BLACK, linestyle=(0, (4, 2)), label="work of the drive")
    dress(ax.xaxis, run["time"])
    units = str(work.attrs.get("units", ""))
    per_contact = ", per contact" if "per contact" in str(work.attrs.get("long_name", "")) else ""
    dress(ax.yaxis, (work + start).assign_attrs(units=units, long_name=f"energy{per_contact}"))
    ax.margins(x=0)
    legend_above(ax, columns=3)
    return ax


@house_style()
def overview(run: xr.Dataset, *, events: xr.Dataset | None = None) -> Figure:
    """Draw a run at a glance: force with its slips marked, velocities, attached fraction; whatever of these there is.

    Parameters
    ----------
    run : Dataset
        A run or a measured trace.
    events : Dataset, optional
        Slips to mark; by default those that `stickslip.drops` finds.

    Raises
    ------
    InputError
        If the Dataset has no spring force, or too little of it to look for slips.
    """
    _variable(run, "spring_force", "time")
    events = drops(run) if events is None else events
    panels = [name for name in ("velocity", "attached") if name in run]
    figure = new_figure(PAGE, 2.2 + 1.7 * len(panels))
    axes = figure.subplots(1 + len(panels), 1, sharex=True, squeeze=False)[:, 0]
    force_trace(run, axes[0], events=events)
    for name, ax in zip(panels, axes[1:], strict=True):
        (velocity if name == "velocity" else attached)(run, ax)
    for ax in axes[:-1]:
        ax.set_xlabel("")
    figure.align_ylabels(axes)
    return figure


# ---------------------------------------------------------------------------------------------------------------------
# Parts
# ---------------------------------------------------------------------------------------------------------------------


def legend_above(ax: Axes, *, columns: int = 4) -> None:
    """Put the legend above the axes on the right, where it hides no data."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2, ncols=columns, columnspacing=1.4)


def letter(ax: Axes, text: str) -> None:
    """Put the letter of a panel, and a short title if there is one, above it on the left: ``"(a) no delay"``."""
    ax.set_title(text, loc="left")


def _mark_slips(ax: Axes, events: xr.Dataset) -> None:
    """Shade the slips and put a dot on the peak before each."""
    count = events.sizes.get("event", 0)
    if count == 0:
        return
    start, end = events["start"].to_numpy(), events["end"].to_numpy()
    spans = [[(a, 0), (a, 1), (b, 1), (b, 0)] for a, b in zip(start, end, strict=True)]
    shade = PolyCollection(
        spans, transform=ax.get_xaxis_transform(), facecolor=ORANGE, alpha=0.3, linewidth=0, zorder=0.5
    )
    ax.add_collection(shade, autolim=False)
    text = "1 slip" if count == 1 else f"{count} slips"
    size = 3.5 if count <= _MANY_SLIPS else 2.0
    ax.plot(start, events["force_before"], "o", color=VERMILLION, markersize=size, markeredgewidth=0, label=text)


def _variable(data: xr.Dataset, name: str, along: str) -> xr.DataArray:
    """Take a variable along one dimension, or complain."""
    if name not in data:
        there = ", ".join(map(str, data.data_vars)) or "none"
        raise InputError(f"plot: this Dataset has no variable {name}; it has: {there}")
    if data[name].dims != (along,):
        raise InputError(f"plot: {name} has the dimensions {data[name].dims}: must be along {along} alone; select one")
    if data.sizes[along] == 0:
        raise InputError(f"plot: {name} is empty")
    check_numbers("plot", data[name])
    check_numbers("plot", data[along])
    return data[name]


def _envelope(x: Array, y: Array) -> tuple[Array, Array]:
    """Thin out a long line: smallest and largest value of each group of samples, in their order."""
    group = y.size // (_MOST_POINTS // 2)
    if group < 3 or not np.all(np.isfinite(y)):
        return x, y
    whole = y.size // group * group
    blocks = y[:whole].reshape(-1, group)
    first = np.arange(0, whole, group)
    ends = np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)], axis=1)
    kept = np.unique(np.concatenate([[0], np.sort(ends, axis=1).ravel(), np.arange(whole, y.size), [y.size - 1]]))
    return x[kept], y[kept]


# ---------------------------------------------------------------------------------------------------------------------
# Files
# ---------------------------------------------------------------------------------------------------------------------


def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure as PNG, SVG or PDF, by the suffix of the name; whole or not at all.

    Raises
    ------
    InputError
        If the suffix is none of these or the place cannot be written.
    """
    files.target(path)
    kind = Path(path).suffix.lower().removeprefix(".")
    if kind not in _FORMATS:
        raise InputError(f"{path}: a picture is written as {', '.join('.' + f for f in _FORMATS)}, chosen by suffix")
    # No date in the file: the same figure gives the same bytes.
    undated: Mapping[str, None] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})
    picture = io.BytesIO()
    with house_style():
        figure.savefig(picture, format=kind, metadata=dict(undated))
    return files.write(path, picture.getbuffer())


def chart(found: xr.Dataset) -> Figure:
    """Draw a stability map: growth rate as shading, the boundary with its frequency, and the rig's own point.

    Parameters
    ----------
    found : xarray.Dataset
        What `stickslip.advise.chart` returns.
    """
    across, up = map(str, found["growth_rate"].dims)
    with house_style():
        figure = new_figure(1.5 * COLUMN, 4.2)
        ax = figure.add_subplot()
        rate = found["growth_rate"].transpose(up, across)
        values = rate.to_numpy()
        largest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 1.0
        norm = SymLogNorm(linthresh=max(1e-3 * largest, 1e-300), vmin=-largest, vmax=largest)
        shade = ax.pcolormesh(found[across], found[up], values, cmap="PuOr_r", norm=norm, shading="nearest", alpha=0.85)
        decades = 10.0 ** (np.floor(np.log10(largest)) - np.array([0.0, 1.0]))
        ticks = [*-decades, 0.0, *decades[::-1]]
        figure.colorbar(shade, ax=ax, label=label(found["growth_rate"]), ticks=ticks)
        number_of = found["curve"].to_numpy()
        x, y = found[f"edge_{across}"].to_numpy(), found[f"edge_{up}"].to_numpy()
        named = False
        for curve in np.unique(number_of):
            mine = number_of == curve
            ax.plot(x[mine], y[mine], color="black", lw=1.6, label=None if named else "boundary of smooth sliding")
            named = True
            for i in np.linspace(0, mine.sum() - 1, 4).astype(int)[1:-1]:
                omega = float(found["edge_frequency"].to_numpy()[mine][i])
                box = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85}
                place_of = (x[mine][i], y[mine][i])
                ax.annotate(f"{omega / (2 * np.pi):.3g}", place_of, fontsize="small", bbox=box, ha="center")
        if "band" in found.dims and found.sizes["band"]:
            low, high = (found[f"band_{up}_{end}"].to_numpy() for end in ("low", "high"))
            place = found[f"band_{across}"].to_numpy()
            ax.vlines(place, low, high, color="#0072B2", lw=3.0, alpha=0.7, label="stick-slip persists, too (bistable)")
        here = float(found[f"here_{across}"]), float(found[f"here_{up}"])
        ax.plot(*here, "o", ms=8, mfc="white", mec="black", mew=1.5, label="this rig")
        ax.set(xscale="log", yscale="log", xlabel=label(found[across]), ylabel=label(found[up]))
        ax.set_xlim(float(found[across].min()), float(found[across].max()))
        ax.set_ylim(float(found[up].min()), float(found[up].max()))
        unit = unit_text(str(found["edge_frequency"].attrs.get("units", "")))
        ax.set_title(f"growth > 0: unstable; numbers: frequency of the neutral mode ({unit})", fontsize="small")
        ax.legend(loc="lower left", fontsize="small", frameon=True, framealpha=0.9, edgecolor="none")
    return figure


# ---------------------------------------------------------------------------------------------------------------------
# Pictures of a sweep
# ---------------------------------------------------------------------------------------------------------------------

_REGIMES: dict[str, tuple[str, str, str]] = {
    "smooth sliding": ("#DDEBF3", "o", ""),
    "sustained oscillation": (ORANGE, "^", ""),
    "stick-slip": (BLUE, "s", ""),
    "undecided": ("#FFFFFF", "d", "/////////"),
    "seeds differ": ("#FFFFFF", "d", "......."),
    "failed": ("#FFFFFF", "x", "xxxxxxx"),
    "not run": ("#FFFFFF", "", ""),
}
"""Colour, mark and hatching of what a case of a sweep can be; light to dark in print without colour, too."""
_STARTS = {"from rest": "from a start at rest", "sliding": "from smooth sliding"}
_BOUNDARY = "linear boundary, computed"
_HALO = [Stroke(linewidth=3.2, foreground="white"), Normal()]


@house_style()
def sweep_picture(data: xr.Dataset) -> Figure:
    """Draw a sweep: the regimes in a plane of two axes, or the oscillation of the force along one; starts side by side.

    Parameters
    ----------
    data : Dataset
        A sweep with its ``regime``, or a refinement with the regime of its runs; with ``edge_<axis>`` and
        ``band_<axis>...``, what theory says goes on top, see `stickslip.sweep.plan.with_theory`. Axes are in the order
        of the file: the first goes to the right. Where there are several seeds, a cell has the regime of all of them.

    Raises
    ------
    InputError
        If there are no regimes, or more than two axes beside seed and start.
    """
    if "regime" not in data:
        raise InputError("plot: this sweep holds no variable regime; measure it")
    if "run" in data.dims:
        return _refined_picture(data)
    axes = [str(dim) for dim in data["regime"].dims if dim not in ("seed", "start")]
    if len(axes) > 2:
        raise InputError(f"plot: this sweep has the axes {', '.join(axes)}: a picture holds two; select the others")
    if not axes and "seed" not in data.dims:
        raise InputError("plot: this sweep has no axis to draw along")
    data = data.sortby([*axes, *(dim for dim in ("seed",) if dim in data.dims)])
    return _phase_diagram(data, axes) if len(axes) == 2 else _swing_along(data, axes[0] if axes else "seed")


def _kinds(data: xr.Dataset) -> xr.DataArray:
    """What became of each case, in words."""
    import xarray as xr

    regime, status = data["regime"], data["status"]
    kinds = xr.full_like(regime, "not run", dtype=object)
    words = [word.replace("_", " ") for word in regime.flag_meanings.split()]
    for code, word in zip(np.asarray(regime.flag_values).tolist(), words, strict=True):
        kinds = kinds.where(regime != code, word)
    kinds = kinds.where(status != _status(data, "failed"), "failed")
    return kinds.where(status != _status(data, "not_run"), "not run")


def _status(data: xr.Dataset, word: str) -> int:
    """Code of a word in the status of a sweep."""
    flags = data["status"].attrs
    return int(np.asarray(flags["flag_values"])[flags["flag_meanings"].split().index(word)])


def _phase_diagram(data: xr.Dataset, axes: list[str]) -> Figure:
    across, up = axes
    kinds = _kinds(data)
    if "seed" in kinds.dims:
        first = kinds.isel(seed=0, drop=True)
        kinds = first.where((kinds == first).all("seed"), "seeds differ")
    figure, panels = _panels_of_starts(data)
    legend: dict[str, Any] = {}
    for ax, start in panels:
        here = (kinds if start is None else kinds.sel(start=start)).transpose(up, across).to_numpy()
        cells = [_cell_edges(data[name]) for name in axes]
        for kind, (colour, _, hatch) in _REGIMES.items():
            mine = here == kind
            if not mine.any() or kind == "not run":
                continue
            if hatch:
                ax.add_collection(_hatched(mine, cells, hatch), autolim=False)
            else:
                shown = np.where(mine, 1.0, np.nan)
                ax.pcolormesh(*cells, shown, cmap=ListedColormap([colour]), rasterized=here.size > 10_000, zorder=0.5)
            edge: Any = {"edgecolor": GREY, "linewidth": 0.5}
            legend.setdefault(kind, Patch(facecolor=colour, hatch=hatch, label=kind, **edge))
        legend |= _draw_theory(ax, data, across, up)
        _axis_of_sweep(ax.xaxis, data[across])
        _axis_of_sweep(ax.yaxis, data[up])
        ax.set(xlim=cells[0][[0, -1]], ylim=cells[1][[0, -1]])
    order = [kind for kind in _REGIMES if kind in legend] + [name for name in legend if name not in _REGIMES]
    _legend_below(figure, [legend[name] for name in order])
    return figure


def _hatched(mine: NDArray[np.bool_], cells: list[Array], hatch: str) -> PolyCollection:
    """Hatch some cells of a grid."""
    x, y = cells
    corners = [
        [(x[j], y[i]), (x[j + 1], y[i]), (x[j + 1], y[i + 1]), (x[j], y[i + 1])] for i, j in np.argwhere(mine).tolist()
    ]
    return PolyCollection(corners, facecolor="white", edgecolor=GREY, hatch=hatch, linewidth=0, zorder=0.5)


def _panels_of_starts(data: xr.Dataset) -> tuple[Figure, list[tuple[Axes, Any]]]:
    """A panel for each start, named."""
    starts: list[Any] = [None]
    if "start" in data and data["start"].ndim:
        starts = np.unique(data["start"].to_numpy().astype(str)).tolist()
    figure = new_figure(PAGE if len(starts) > 1 else 1.2 * COLUMN, 3.5)
    panels = figure.subplots(1, len(starts), sharex=True, sharey=True, squeeze=False)[0]
    for i, (ax, start) in enumerate(zip(panels, starts, strict=True)):
        if start is not None:
            letter(ax, f"({'abc'[i]}) {_STARTS.get(start, start)}")
    return figure, list(zip(panels, starts, strict=True))


def _draw_theory(ax: Axes, data: xr.Dataset, across: str, up: str) -> dict[str, Any]:
    """Draw the boundary and the lower edge of the bistable band; return their lines by name."""
    drawn: dict[str, Any] = {}
    for name, draw in ((across, ax.axvline), (up, ax.axhline)):  # theory knows one of the axes only
        if f"edge_{name}" in data and "edge_curve" not in data:
            for value in data[f"edge_{name}"].to_numpy().tolist():
                drawn["boundary"] = draw(value, color=BLACK, linewidth=1.6, path_effects=_HALO, label=_BOUNDARY)
    if "edge_curve" in data and data.sizes["point"]:
        for curve in np.unique(data["edge_curve"]):
            mine = data["edge_curve"].to_numpy() == curve
            x, y = data[f"edge_{across}"].to_numpy()[mine], data[f"edge_{up}"].to_numpy()[mine]
            (line,) = ax.plot(x, y, color=BLACK, linewidth=1.6, path_effects=_HALO, zorder=1.9, label=_BOUNDARY)
            drawn["boundary"] = line
    if f"band_{up}_fold" in data and data.sizes["band"]:
        x, fold = data[f"band_{across}"].to_numpy(), data[f"band_{up}_fold"].to_numpy()
        order = np.argsort(x)
        style: Any = {"color": VERMILLION, "linewidth": 1.4, "linestyle": (0, (4, 1.5)), "marker": "o", "markersize": 3}
        (line,) = ax.plot(
            x[order], fold[order], **style, path_effects=_HALO, label="stick-slip decays (fold), computed"
        )
        drawn["fold"] = line
    return drawn


def _swing_along(data: xr.Dataset, axis: str) -> Figure:
    if "peak_to_peak" not in data:
        raise InputError("plot: this sweep holds no variable peak_to_peak; measure it to draw it along an axis")
    figure = new_figure(1.4 * COLUMN, 3.0)
    ax = figure.add_subplot()
    oscillation, kinds = data["peak_to_peak"], _kinds(data)
    starts = [str(start) for start in data["start"].values] if "start" in oscillation.dims else [None]
    for start, dashes in zip(starts, ("-", (0, (4, 2))), strict=False):
        mine = oscillation if start is None else oscillation.sel(start=start)
        middle = mine.median("seed") if "seed" in mine.dims and axis != "seed" else mine
        name = _STARTS.get(str(start), "")
        ax.plot(data[axis], middle, color=GREY, linewidth=0.9, linestyle=dashes, label=name, zorder=1)
    for kind, (colour, mark, _) in _REGIMES.items():
        shown = oscillation.where(kinds == kind).transpose(axis, ...)
        if mark and bool(shown.notnull().any()):
            values = shown.to_numpy().reshape(shown.sizes[axis], -1)
            style: Any = {"color": colour, "marker": mark, "linestyle": "none", "markeredgecolor": BLACK}
            place = np.broadcast_to(data[axis].to_numpy()[:, None], values.shape).ravel()
            ax.plot(place, values.ravel(), **style, markersize=4.5, markeredgewidth=0.5, label=kind)
    if f"edge_{axis}" in data:
        for i, value in enumerate(data[f"edge_{axis}"].to_numpy()):
            ax.axvline(value, color=BLACK, linewidth=1.2, label=None if i else _BOUNDARY, zorder=0.5)
    if f"band_{axis}_low" in data:
        ends = (data[f"band_{axis}_{end}"].to_numpy() for end in ("low", "high"))
        for i, (low, high) in enumerate(zip(*ends, strict=True)):
            ax.axvspan(low, high, color=YELLOW, alpha=0.3, linewidth=0, label=None if i else "both last, computed")
    _axis_of_sweep(ax.xaxis, data[axis])
    dress(ax.yaxis, oscillation)
    ax.set_ylim(bottom=0)
    found = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    _legend_below(figure, [handle for name, handle in found.items() if name])
    return figure


def _refined_picture(data: xr.Dataset) -> Figure:
    across, up = (str(name)[:-3] for name in data.data_vars if str(name).endswith("_at") and name != "start_at")
    figure, panels = _panels_of_starts(data)
    legend: dict[str, Any] = {}
    for ax, start in panels:
        mine = data.isel(run=data["start"].to_numpy() == start, crossing=data["start_at"].to_numpy() == start)
        label = _kinds(mine).to_numpy()
        for kind, (colour, mark, _) in _REGIMES.items():
            here = label == kind
            if here.any():
                style: Any = {"color": colour, "marker": mark, "linestyle": "none", "markeredgecolor": BLACK}
                x, y = mine[across].to_numpy()[here], mine[up].to_numpy()[here]
                (legend[kind],) = ax.plot(x, y, **style, markersize=4, markeredgewidth=0.4, label=kind)
        bars: Any = {"color": VERMILLION, "linestyle": "none", "marker": ".", "markersize": 4, "elinewidth": 1.0}
        bars |= {"xerr": mine[f"{across}_error"], "yerr": mine[f"{up}_error"], "label": "where the regime changes"}
        drawn = ax.errorbar(mine[f"{across}_at"], mine[f"{up}_at"], **bars)
        legend |= {"crossing": drawn} | _draw_theory(ax, data, across, up)
        _axis_of_sweep(ax.xaxis, data[across])
        _axis_of_sweep(ax.yaxis, data[up])
        ax.label_outer()
    _legend_below(figure, list(legend.values()))
    return figure


def _axis_of_sweep(axis: Axis, variable: xr.DataArray) -> None:
    """Label an axis; one of equal ratios is logarithmic, with plain numbers."""
    dress(axis, variable)
    if variable.attrs.get("spacing") != "log":
        return
    written = axis.get_major_formatter()
    (axis.axes.set_yscale if isinstance(axis, YAxis) else axis.axes.set_xscale)("log")
    values = variable.to_numpy()
    wide = values.max() > 3000 * values.min()
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(written if isinstance(written, FuncFormatter) else FuncFormatter(lambda v, _: f"{v:g}"))
    axis.set_minor_formatter(NullFormatter())


def _cell_edges(axis: xr.DataArray) -> Array:
    """Edges of the cells about the values of an axis."""
    log = axis.attrs.get("spacing") == "log"
    values = np.asarray(axis.to_numpy(), dtype=float)
    places = np.log(values) if log else values
    if places.size == 1:
        edges = places + np.array([-0.5, 0.5])
    else:
        middle = 0.5 * (places[1:] + places[:-1])
        edges = np.concatenate([[2 * places[0] - middle[0]], middle, [2 * places[-1] - middle[-1]]])
    return np.asarray(np.exp(edges) if log else edges)


def _legend_below(figure: Figure, handles: list[Any]) -> None:
    columns = len(handles) if len(handles) <= 4 else -(-len(handles) // 2)
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.4)
