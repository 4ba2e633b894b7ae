"""Pictures of sweeps over one or two parameters, and of the stability map around a rig,
with results of theory.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, SymLogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from stickslip.answers import COLOURS
from stickslip.arrays import units_of
from stickslip.errors import InputError
from stickslip.plot.palette import (
    BLACK,
    BLUE,
    COLUMN,
    DASHED,
    GREY,
    PAGE,
    VERMILLION,
    YELLOW,
)
from stickslip.plot.style import Array, house_style, label, minus, new_figure, panel
from stickslip.words import number

REGIMES: dict[str, tuple[str, str, str]] = {
    "smooth sliding": (COLOURS["smooth sliding"], "o", ""),
    "sustained oscillation": (COLOURS["sustained oscillation"], "^", ""),
    "stick-slip": (COLOURS["stick-slip"], "s", ""),
    "undecided": ("#FFFFFF", "d", "/////////"),
    "seeds differ": ("#FFFFFF", "d", "......."),
    "failed": ("#FFFFFF", "x", "xxxxxxx"),
    "not run": ("#FFFFFF", "", ""),
}
"""Colour, mark and hatching of each outcome of a case of a sweep, which also differ in
black-and-white print.
"""
_STARTS = {"from rest": "from a start at rest", "sliding": "from smooth sliding"}
_HALO = [Stroke(linewidth=3.2, foreground="white"), Normal()]
_ENTRY = 1.6  # width of an entry of a legend, in inches
_LINE: Any = {
    "color": BLACK,
    "linewidth": 1.6,
    "path_effects": _HALO,
    "zorder": 1.9,
    "label": "linear boundary, computed",
}
_WHITE_BOX: Any = {
    "boxstyle": "round,pad=0.15",
    "fc": "white",
    "ec": "none",
    "alpha": 0.85,
}
EDGE: Any = {"edgecolor": GREY, "linewidth": 0.5}
"""Outline of a patch in a legend."""


@house_style()
def sweep_picture(data: xr.Dataset) -> Figure:
    """Draw a sweep: the regimes in the plane of two axes, or the oscillation of the
    force along one; with a panel for each start.

    The Dataset holds the ``regime`` of its cases, or is a refinement with the regime of
    its runs. Results of theory, ``edge_<axis>`` and ``band_<axis>...``, are drawn on
    top, see `stickslip.sweep.theory.with_theory`. The first axis is horizontal. With
    several seeds, a cell shows the regime that all of them have. Besides seed and
    start, a sweep must have one axis or two.
    """
    if "regime" not in data:
        raise InputError("plot: this sweep holds no variable regime; measure it")
    if "run" in data.dims:
        axes = [
            str(name)[:-3]
            for name in data.data_vars
            if str(name).endswith("_at") and name != "start_at"
        ]
        return _plane(data, _draw_runs, *axes)
    varied = [str(dim) for dim in data["regime"].dims if dim != "start"]
    axes = [dim for dim in varied if dim != "seed"] or varied
    if not 0 < len(axes) <= 2:
        raise InputError(
            f"plot: this sweep has {', '.join(axes) or 'no parameter'} to draw over: "
            "a picture has one axis or two; select values of the others (--at)"
        )
    data = data.sortby(varied)
    return (
        _plane(data, _draw_cells, *axes)
        if len(axes) == 2
        else _amplitude_along(data, *axes)
    )


def _kinds(data: xr.Dataset) -> xr.DataArray:
    """Return the outcomes of the cases, in words."""
    regime = _words(data["regime"])
    status = _words(data["status"])
    return regime.where(~status.isin(["failed", "not run"]), status)


def _words(codes: xr.DataArray) -> xr.DataArray:
    words = np.array(
        [word.replace("_", " ") for word in codes.attrs["flag_meanings"].split()],
        dtype=object,
    )
    return codes.copy(data=words[codes.values - codes.attrs["flag_values"][0]])


def _plane(data: xr.Dataset, draw: Any, across: str, up: str) -> Figure:
    """Draw a panel for each start, with the cases by the function `draw` and the
    results of theory; and one legend.
    """
    starts = (
        np.unique(data["start"].values.astype(str))
        if "start" in data and data["start"].ndim
        else [None]
    )
    figure = new_figure(PAGE if len(starts) > 1 else 1.2 * COLUMN, 3.5)
    panels = figure.subplots(1, len(starts), sharex=True, sharey=True, squeeze=False)[0]
    for i, (ax, start) in enumerate(zip(panels, starts, strict=True)):
        draw(ax, data, across, up, start)
        _draw_theory(ax, data, across, up)
        panel(
            ax,
            "" if start is None else f"({'abc'[i]}) {_STARTS.get(start, start)}",
            data[across],
            data[up],
        )
        ax.label_outer()
    return legend_below(figure)


def _draw_cells(
    ax: Axes, data: xr.Dataset, across: str, up: str, start: str | None
) -> None:
    kinds = _kinds(data if start is None else data.sel(start=start))
    if "seed" in kinds.dims:
        first = kinds.isel(seed=0, drop=True)
        kinds = first.where((kinds == first).all("seed"), "seeds differ")
    here = kinds.transpose(up, across).values
    cells = [_cell_edges(data[name]) for name in (across, up)]
    for kind, (colour, mark, hatch) in REGIMES.items():
        shown = np.ma.masked_array(np.ones(here.shape), here != kind)
        if mark and shown.count():
            ax.pcolor(
                *cells,
                shown,
                cmap=ListedColormap([colour]),
                hatch=hatch or None,
                edgecolor=GREY,
                linewidth=0,
                zorder=0.5,
                rasterized=here.size > 10_000,
            )
            # for the legend
            ax.fill(
                [],
                [],
                facecolor=colour,
                hatch=hatch,
                label=kind,
                **EDGE,
            )
    ax.set(xlim=cells[0][[0, -1]], ylim=cells[1][[0, -1]])


def _draw_runs(
    ax: Axes, data: xr.Dataset, across: str, up: str, start: str | None
) -> None:
    """Mark the runs of a refinement, and the points at which the regime changes."""
    mine = data.isel(
        run=data["start"].values == start,
        crossing=data["start_at"].values == start,
    )
    _draw_marks(
        ax,
        _kinds(mine),
        mine[across],
        mine[up],
        size=4,
    )
    ax.errorbar(
        mine[f"{across}_at"],
        mine[f"{up}_at"],
        xerr=mine[f"{across}_error"],
        yerr=mine[f"{up}_error"],
        label="where the regime changes",
        color=VERMILLION,
        linestyle="none",
        marker=".",
        markersize=4,
        elinewidth=1.0,
    )


def _draw_marks(
    ax: Axes, kinds: xr.DataArray, x: xr.DataArray, y: xr.DataArray, size: float
) -> None:
    kind_of, x_of, y_of = (each.values.ravel() for each in xr.broadcast(kinds, x, y))
    for kind, (colour, mark, _) in REGIMES.items():
        here = (kind_of == kind) & np.isfinite(y_of)
        if mark and here.any():
            ax.plot(
                x_of[here],
                y_of[here],
                color=colour,
                marker=mark,
                linestyle="none",
                markeredgecolor=BLACK,
                markersize=size,
                markeredgewidth=0.5,
                label=kind,
            )


def _draw_theory(ax: Axes, data: xr.Dataset, across: str, up: str = "") -> None:
    """Draw the stability boundary of smooth sliding, and where stick-slip ends."""
    if "edge_curve" in data:
        for x, y, _ in _curves(data, across, up, "edge_curve"):
            ax.plot(x, y, **_LINE)
    else:  # theory has results along one of the axes only
        for name, draw in ((across, ax.axvline), (up, ax.axhline)):
            for value in data.get(f"edge_{name}", []):
                draw(float(value), **_LINE)
    for ends in zip(
        *(data.get(f"band_{across}_{end}", []) for end in ("low", "high")), strict=True
    ):
        ax.axvspan(
            *map(float, ends),
            color=YELLOW,
            alpha=0.3,
            linewidth=0,
            label="both persist, computed",
        )
    if f"band_{up}_fold" in data and data.sizes["band"]:
        fold = data.sortby(f"band_{across}")
        ax.plot(
            fold[f"band_{across}"],
            fold[f"band_{up}_fold"],
            color=VERMILLION,
            linewidth=1.4,
            linestyle=(0, (4, 1.5)),
            path_effects=_HALO,
            marker="o",
            markersize=3,
            label="stick-slip decays (fold), computed",
        )


def _curves(
    data: xr.Dataset, across: str, up: str, counted: str
) -> Iterator[tuple[Array, Array, NDArray[np.bool_]]]:
    """Yield the curves of a boundary, each with a mask of its points."""
    of, x, y = (data[name].values for name in (counted, f"edge_{across}", f"edge_{up}"))
    for curve in np.unique(of):
        yield x[of == curve], y[of == curve], of == curve


def _amplitude_along(data: xr.Dataset, axis: str) -> Figure:
    """Draw the oscillation of the force along one parameter, and results of theory."""
    if "peak_to_peak" not in data:
        raise InputError(
            "plot: this sweep holds no variable peak_to_peak; measure it to draw it "
            "along an axis"
        )
    figure = new_figure(1.4 * COLUMN, 3.0)
    ax = figure.add_subplot()
    oscillation = data["peak_to_peak"]
    middle = (
        oscillation.median("seed")
        if "seed" in oscillation.dims and axis != "seed"
        else oscillation
    )
    middle = middle if "start" in middle.dims else middle.expand_dims(start=[""])
    for line, dashes in zip(
        middle.transpose("start", ...), ("-", DASHED), strict=False
    ):
        words = _STARTS.get(str(line["start"].item()), "")
        ax.plot(
            data[axis],
            line,
            color=GREY,
            linewidth=0.9,
            linestyle=dashes,
            zorder=1,
            label=words,
        )
    _draw_marks(
        ax,
        _kinds(data),
        data[axis],
        oscillation,
        size=4.5,
    )
    _draw_theory(ax, data, axis)
    panel(ax, "", data[axis], oscillation, ylim=(0, None))
    return legend_below(figure)


@house_style()
def chart(found: xr.Dataset, *, to: Mapping[str, float] | None = None) -> Figure:
    """Draw the stability map of `advise.chart`: the growth rate, the stability limit
    with its frequency, and the rig's own point.

    An arrow shows a change of the rig `to` new values of its parameters.
    """
    across, up = map(str, found["growth_rate"].dims)
    figure = new_figure(1.6 * COLUMN, 4.6)
    ax = figure.add_subplot()
    _shade(ax, found, across, up)
    panel(
        ax,
        "",
        *(found[name].assign_attrs(spacing="log") for name in (across, up)),
        xlim=found[across][[0, -1]],
        ylim=found[up][[0, -1]],
    )
    hertz = found["edge_frequency"].values / (2 * np.pi)
    written: list[Array] = []
    for x, y, mine in _curves(found, across, up, "curve"):
        ax.plot(x, y, color=BLACK, linewidth=1.6, label="limit of smooth sliding")
        for i in _places(ax, x, y, written):
            frequency = hertz[mine][i]
            ax.annotate(
                "no oscillation" if np.isinf(frequency) else number(frequency, 3),
                (x[i], y[i]),
                fontsize=7,
                ha="center",
                va="center",
                bbox=_WHITE_BOX,
            )
    if "band" in found.dims and found.sizes["band"]:
        ends = found[f"band_{up}_low"], found[f"band_{up}_high"]
        ax.vlines(
            found[f"band_{across}"],
            *ends,
            color=BLUE,
            linewidth=3.0,
            alpha=0.7,
            label="stick-slip persists, too (bistable)",
        )
    here = float(found[f"here_{across}"]), float(found[f"here_{up}"])
    ax.plot(
        *here,
        "o",
        ms=8,
        mfc="white",
        mec=BLACK,
        mew=1.5,
        label="this rig",
    )
    if to is not None:
        goal = to.get(across, here[0]), to.get(up, here[1])
        ax.annotate(
            "",
            goal,
            here,
            arrowprops={
                "arrowstyle": "-|>",
                "color": BLACK,
                "shrinkA": 5,
                "lw": 1.4,
            },
        )
        ax.plot(
            *goal,
            "D",
            color=VERMILLION,
            mec="white",
            ms=6,
            label="after the change (simulated)",
        )
    unit = (
        "Hz" if units_of(found["edge_frequency"]) == "1/s" else "cycles per time unit"
    )
    title = str(found.attrs.get("rig", "")).replace("$", r"\$")
    ax.set_title(
        (
            f"{title}\nnumbers: frequency at the limit ({unit}); growth above 0: "
            "unstable"
        ).lstrip()
    )
    return legend_below(figure)


def _shade(ax: Axes, found: xr.Dataset, across: str, up: str) -> None:
    """Draw growth rates as colours, logarithmic on both sides of zero, with a colour
    bar.
    """
    values = np.ma.masked_invalid(found["growth_rate"].transpose(up, across).values)
    largest = float(np.abs(values).max()) if values.count() else 1.0
    norm = SymLogNorm(
        linthresh=max(1e-2 * largest, 1e-300), vmin=-largest, vmax=largest
    )
    shade = ax.pcolormesh(
        found[across],
        found[up],
        values,
        cmap="PuOr_r",
        norm=norm,
        shading="gouraud",
        rasterized=True,
    )
    decades = 10.0 ** (np.floor(np.log10(largest)) - np.array([0.0, 1.0]))
    bar = ax.figure.colorbar(
        shade,
        ax=ax,
        ticks=[*-decades, 0.0, *decades[::-1]],
        pad=0.02,
        label=label(found["growth_rate"]),
        format=lambda value, _: minus(value),
    )
    bar.ax.yaxis.set_minor_locator(LogLocator(subs=()))


def _places(ax: Axes, x: Array, y: Array, written: list[Array]) -> Iterator[int]:
    """Yield indices of points of a curve at which to write its frequency: inside the
    axes, and apart from the other numbers.
    """
    places = ax.transAxes.inverted().transform(
        ax.transData.transform(np.column_stack([x, y]))
    )
    inside = np.flatnonzero(
        np.all((places > (0.06, 0.04)) & (places < (0.94, 0.96)), axis=1)
    )
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
    if inside.size == 0 or length[-1] < 0.2:
        return
    for part in (0.2, 0.5, 0.8) if length[-1] > 0.8 else (0.5,):
        i = int(inside[np.argmin(np.abs(length[inside] - part * length[-1]))])
        if all(np.any(np.abs(places[i] - other) > (0.15, 0.06)) for other in written):
            written.append(places[i])
            yield i


def _cell_edges(axis: xr.DataArray) -> Array:
    """Return the edges of the cells around the values of an axis."""
    values = np.asarray(axis.values, dtype=float)
    places = np.log(values) if (log := axis.attrs.get("spacing") == "log") else values
    steps = np.diff(places) if places.size > 1 else np.ones(1)
    edges = np.append(
        places - 0.5 * np.append(steps[0], steps)[: places.size],
        places[-1] + 0.5 * steps[-1],
    )
    return np.exp(edges) if log else edges


def legend_below(figure: Figure, patches: Iterable[Patch] = ()) -> Figure:
    """Draw one legend for all axes below them, where it hides no data, in as many rows
    as it needs.
    """
    found: dict[Any, Any] = dict.fromkeys(REGIMES) | {
        patch.get_label(): patch for patch in patches
    }
    for ax in figure.axes:
        found |= {
            name: handle
            for handle, name in zip(*ax.get_legend_handles_labels(), strict=True)
        }
    handles = [handle for handle in found.values() if handle is not None]
    rows = math.ceil(len(handles) / max(figure.get_figwidth() // _ENTRY, 1))
    columns = math.ceil(len(handles) / max(rows, 1))
    figure.legend(
        handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.4
    )
    return figure
