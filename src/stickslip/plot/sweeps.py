"""Pictures of a sweep."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis, YAxis
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.plot.style import (
    BLACK,
    BLUE,
    COLUMN,
    GREY,
    ORANGE,
    PAGE,
    VERMILLION,
    YELLOW,
    Array,
    dress,
    house_style,
    letter,
    new_figure,
)

REGIMES: dict[str, tuple[str, str, str]] = {
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
        ``band_<axis>...``, what theory says goes on top, see `stickslip.sweep.theory.with_theory`. Axes are in the
        order of the file: the first goes to the right. Where there are several seeds, a cell has the regime of all of
        them.

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
    return _phase_diagram(data, axes) if len(axes) == 2 else _amplitude_along(data, axes[0] if axes else "seed")


def _kinds(data: xr.Dataset) -> xr.DataArray:
    """What became of each case, in words."""
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
        for kind, (colour, _, hatch) in REGIMES.items():
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
        axis_of_parameter(ax.xaxis, data[across])
        axis_of_parameter(ax.yaxis, data[up])
        ax.set(xlim=cells[0][[0, -1]], ylim=cells[1][[0, -1]])
    order = [kind for kind in REGIMES if kind in legend] + [name for name in legend if name not in REGIMES]
    legend_below(figure, [legend[name] for name in order])
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


def _amplitude_along(data: xr.Dataset, axis: str) -> Figure:
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
    for kind, (colour, mark, _) in REGIMES.items():
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
    axis_of_parameter(ax.xaxis, data[axis])
    dress(ax.yaxis, oscillation)
    ax.set_ylim(bottom=0)
    found = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    legend_below(figure, [handle for name, handle in found.items() if name])
    return figure


def _refined_picture(data: xr.Dataset) -> Figure:
    across, up = (str(name)[:-3] for name in data.data_vars if str(name).endswith("_at") and name != "start_at")
    figure, panels = _panels_of_starts(data)
    legend: dict[str, Any] = {}
    for ax, start in panels:
        mine = data.isel(run=data["start"].to_numpy() == start, crossing=data["start_at"].to_numpy() == start)
        label = _kinds(mine).to_numpy()
        for kind, (colour, mark, _) in REGIMES.items():
            here = label == kind
            if here.any():
                style: Any = {"color": colour, "marker": mark, "linestyle": "none", "markeredgecolor": BLACK}
                x, y = mine[across].to_numpy()[here], mine[up].to_numpy()[here]
                (legend[kind],) = ax.plot(x, y, **style, markersize=4, markeredgewidth=0.4, label=kind)
        bars: Any = {"color": VERMILLION, "linestyle": "none", "marker": ".", "markersize": 4, "elinewidth": 1.0}
        bars |= {"xerr": mine[f"{across}_error"], "yerr": mine[f"{up}_error"], "label": "where the regime changes"}
        drawn = ax.errorbar(mine[f"{across}_at"], mine[f"{up}_at"], **bars)
        legend |= {"crossing": drawn} | _draw_theory(ax, data, across, up)
        axis_of_parameter(ax.xaxis, data[across])
        axis_of_parameter(ax.yaxis, data[up])
        ax.label_outer()
    legend_below(figure, list(legend.values()))
    return figure


def axis_of_parameter(axis: Axis, variable: xr.DataArray) -> None:
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


def legend_below(figure: Figure, handles: list[Any]) -> None:
    """Put the legend below all axes, where it hides no data."""
    columns = len(handles) if len(handles) <= 4 else -(-len(handles) // 2)
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.4)
