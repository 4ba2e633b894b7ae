"""Maps: sweeps over one or two parameters, and the stability map around a rig, with what theory says on top."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, SymLogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import FuncFormatter, LogLocator
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.plot import style
from stickslip.plot.style import Array, dress, house_style, label, letter, minus, new_axes, new_figure

REGIMES: dict[str, tuple[str, str, str]] = {
    "smooth sliding": ("#DDEBF3", "o", ""),
    "sustained oscillation": (style.ORANGE, "^", ""),
    "stick-slip": (style.BLUE, "s", ""),
    "undecided": ("#FFFFFF", "d", "/////////"),
    "seeds differ": ("#FFFFFF", "d", "......."),
    "failed": ("#FFFFFF", "x", "xxxxxxx"),
    "not run": ("#FFFFFF", "", ""),
}
"""Colour, mark and hatching of what a case of a sweep can be; light to dark in print without colour, too."""
_STARTS = {"from rest": "from a start at rest", "sliding": "from smooth sliding"}
_HALO = [Stroke(linewidth=3.2, foreground="white"), Normal()]
_ENTRY = 1.6
"""Inches of an entry of a legend."""
_LINE: Any = {"color": style.BLACK, "linewidth": 1.6, "path_effects": _HALO, "zorder": 1.9}
_LINE["label"] = "linear boundary, computed"
EDGE: Any = {"edgecolor": style.GREY, "linewidth": 0.5}
"""The line about a patch in a legend."""


# ---------------------------------------------------------------- sweeps


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
        across, up = (str(name)[:-3] for name in data.data_vars if str(name).endswith("_at") and name != "start_at")
        return _plane(data, _draw_runs, across, up)
    axes = [str(dim) for dim in data["regime"].dims if dim not in ("seed", "start")]
    if len(axes) > 2:
        raise InputError(f"plot: this sweep has the axes {', '.join(axes)}: a picture holds two; select the others")
    if not axes and "seed" not in data.dims:
        raise InputError("plot: this sweep has no axis to draw along")
    data = data.sortby([*axes, *(dim for dim in ("seed",) if dim in data.dims)])
    return _plane(data, _draw_cells, *axes) if len(axes) == 2 else _amplitude_along(data, axes[0] if axes else "seed")


def _kinds(data: xr.Dataset) -> xr.DataArray:
    """What became of each case, in words."""
    regime, status = _words(data["regime"]), _words(data["status"])
    return regime.where(~status.isin(["failed", "not run"]), status)


def _words(codes: xr.DataArray) -> xr.DataArray:
    words = np.array([word.replace("_", " ") for word in codes.attrs["flag_meanings"].split()], dtype=object)
    return codes.copy(data=words[codes.to_numpy() - codes.attrs["flag_values"][0]])


def _plane(data: xr.Dataset, draw: Any, across: str, up: str) -> Figure:
    """A panel for each start, in which `draw` puts the cases, with what theory says; and one legend."""
    starts: list[Any] = [None]
    if "start" in data and data["start"].ndim:
        starts = np.unique(data["start"].to_numpy().astype(str)).tolist()
    figure = new_figure(style.PAGE if len(starts) > 1 else 1.2 * style.COLUMN, 3.5)
    panels = figure.subplots(1, len(starts), sharex=True, sharey=True, squeeze=False)[0]
    patches: list[Patch] = []
    for i, (ax, start) in enumerate(zip(panels, starts, strict=True)):
        if start is not None:
            letter(ax, f"({'abc'[i]}) {_STARTS.get(start, start)}")
        found, limits = draw(ax, data, across, up, start)
        patches += found
        _draw_theory(ax, data, across, up)
        dress(ax.xaxis, data[across])
        dress(ax.yaxis, data[up])
        ax.set(**limits)
        ax.label_outer()
    legend_below(figure, patches)
    return figure


def _draw_cells(ax: Axes, data: xr.Dataset, across: str, up: str, start: Any) -> tuple[list[Patch], dict[str, Any]]:
    """Colour the cell of each case; return what the legend shows, and the limits of the axes."""
    kinds = _kinds(data)
    if "seed" in kinds.dims:
        first = kinds.isel(seed=0, drop=True)
        kinds = first.where((kinds == first).all("seed"), "seeds differ")
    here = (kinds if start is None else kinds.sel(start=start)).transpose(up, across).to_numpy()
    cells = [_cell_edges(data[name]) for name in (across, up)]
    patches = []
    for kind, (colour, _, hatch) in REGIMES.items():
        mine = here == kind
        if not mine.any() or kind == "not run":
            continue
        shown = np.ma.masked_array(np.ones(mine.shape), ~mine)
        paint: Any = {"cmap": ListedColormap([colour]), "zorder": 0.5}
        if hatch:
            ax.pcolor(*cells, shown, **paint, hatch=hatch, edgecolor=style.GREY, linewidth=0)
        else:
            ax.pcolormesh(*cells, shown, **paint, rasterized=here.size > 10_000)
        patches.append(Patch(facecolor=colour, hatch=hatch, label=kind, **EDGE))
    return patches, {"xlim": cells[0][[0, -1]], "ylim": cells[1][[0, -1]]}


def _draw_runs(ax: Axes, data: xr.Dataset, across: str, up: str, start: Any) -> tuple[list[Patch], dict[str, Any]]:
    """Mark the runs of a refinement, and where it found the regime to change."""
    mine = data.isel(run=data["start"].to_numpy() == start, crossing=data["start_at"].to_numpy() == start)
    for look, here in _marks(_kinds(mine).to_numpy()):
        ax.plot(mine[across][here], mine[up][here], **look, markersize=4, markeredgewidth=0.4)
    bars: Any = {"color": style.VERMILLION, "linestyle": "none", "marker": ".", "markersize": 4, "elinewidth": 1.0}
    bars |= {"xerr": mine[f"{across}_error"], "yerr": mine[f"{up}_error"], "label": "where the regime changes"}
    ax.errorbar(mine[f"{across}_at"], mine[f"{up}_at"], **bars)
    return [], {}


def _marks(kinds: NDArray[Any]) -> Iterator[tuple[dict[str, Any], NDArray[np.bool_]]]:
    """The mark of each kind of case that there is, and where."""
    for kind, (colour, mark, _) in REGIMES.items():
        look = {"color": colour, "marker": mark, "linestyle": "none", "markeredgecolor": style.BLACK, "label": kind}
        if mark and (here := kinds == kind).any():
            yield look, here


def _draw_theory(ax: Axes, data: xr.Dataset, across: str, up: str = "") -> None:
    """Draw the boundary of smooth sliding, and where stick-slip ends beside it."""
    if "edge_curve" in data:
        for x, y, _ in _curves(data, across, up, "edge_curve"):
            ax.plot(x, y, **_LINE)
    else:  # theory knows one of the axes only
        for name, draw in ((across, ax.axvline), (up, ax.axhline)):
            for value in data.get(f"edge_{name}", []):
                draw(float(value), **_LINE)
    for ends in zip(*(data.get(f"band_{across}_{end}", []) for end in ("low", "high")), strict=True):
        ax.axvspan(*map(float, ends), color=style.YELLOW, alpha=0.3, linewidth=0, label="both last, computed")
    if f"band_{up}_fold" in data and data.sizes["band"]:
        fold = data.sortby(f"band_{across}")
        look: Any = {"color": style.VERMILLION, "linewidth": 1.4, "linestyle": (0, (4, 1.5)), "path_effects": _HALO}
        look |= {"marker": "o", "markersize": 3, "label": "stick-slip decays (fold), computed"}
        ax.plot(fold[f"band_{across}"], fold[f"band_{up}_fold"], **look)


def _curves(data: xr.Dataset, across: str, up: str, number: str) -> Iterator[tuple[Array, Array, NDArray[np.bool_]]]:
    """The curves of a boundary, one by one, and which points are of each."""
    of, x, y = (data[name].to_numpy() for name in (number, f"edge_{across}", f"edge_{up}"))
    for curve in np.unique(of):
        yield x[of == curve], y[of == curve], of == curve


def _amplitude_along(data: xr.Dataset, axis: str) -> Figure:
    """The oscillation of the force along one parameter, and what theory says."""
    if "peak_to_peak" not in data:
        raise InputError("plot: this sweep holds no variable peak_to_peak; measure it to draw it along an axis")
    ax = new_axes(1.4 * style.COLUMN, 3.0)
    oscillation = data["peak_to_peak"].transpose(axis, ...)
    starts = [str(start) for start in data["start"].values] if "start" in oscillation.dims else [None]
    for start, dashes in zip(starts, ("-", (0, (4, 2))), strict=False):
        mine = oscillation if start is None else oscillation.sel(start=start)
        middle = mine.median("seed") if "seed" in mine.dims and axis != "seed" else mine
        name = _STARTS.get(str(start), "")
        ax.plot(data[axis], middle, color=style.GREY, linewidth=0.9, linestyle=dashes, label=name, zorder=1)
    place = data[axis].broadcast_like(oscillation).transpose(*oscillation.dims).to_numpy()
    for look, here in _marks(_kinds(data).transpose(*oscillation.dims).to_numpy()):
        if np.isfinite(values := oscillation.to_numpy()[here]).any():
            ax.plot(place[here], values, **look, markersize=4.5, markeredgewidth=0.5)
    _draw_theory(ax, data, axis)
    dress(ax.xaxis, data[axis])
    dress(ax.yaxis, oscillation)
    ax.set_ylim(bottom=0)
    figure: Figure = ax.figure  # type: ignore[assignment]
    legend_below(figure)
    return figure


# ---------------------------------------------------------------- the stability map


@house_style()
def chart(found: xr.Dataset) -> Figure:
    """Draw a stability map: growth rate as shading, the boundary with its frequency, and the rig's own point.

    Parameters
    ----------
    found : xarray.Dataset
        What `stickslip.advise.chart` returns.
    """
    across, up = map(str, found["growth_rate"].dims)
    ax = new_axes(1.6 * style.COLUMN, 4.6)
    figure: Figure = ax.figure  # type: ignore[assignment]
    _shade(ax, found, across, up)
    hertz = found["edge_frequency"].to_numpy() / (2 * np.pi)
    written: list[tuple[float, float]] = []
    for x, y, mine in _curves(found, across, up, "curve"):
        ax.plot(x, y, color=style.BLACK, lw=1.6, label="limit of smooth sliding")
        for i in _places(x, y, found[across], found[up], written):
            look: Any = {"fontsize": 7, "ha": "center", "va": "center"}
            look["bbox"] = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85}
            ax.annotate(_hertz(hertz[mine][i]), (x[i], y[i]), **look)
    if "band" in found.dims and found.sizes["band"]:
        low, high = (found[f"band_{up}_{end}"].to_numpy() for end in ("low", "high"))
        place = found[f"band_{across}"].to_numpy()
        look = {"color": style.BLUE, "lw": 3.0, "alpha": 0.7, "label": "stick-slip persists, too (bistable)"}
        ax.vlines(place, low, high, **look)
    here = float(found[f"here_{across}"]), float(found[f"here_{up}"])
    ax.plot(*here, "o", ms=8, mfc="white", mec=style.BLACK, mew=1.5, ls="none", label="this rig")
    for axis, name in ((ax.xaxis, across), (ax.yaxis, up)):
        dress(axis, found[name].assign_attrs(spacing="log"))
    ax.set_xlim(float(found[across].min()), float(found[across].max()))
    ax.set_ylim(float(found[up].min()), float(found[up].max()))
    unit = "Hz" if found["edge_frequency"].attrs.get("units") == "1/s" else "cycles per time unit"
    title = str(found.attrs.get("rig", "")).replace("$", r"\$")
    numbers = f"numbers: frequency at the limit ({unit}); growth above 0: unstable"
    ax.set_title(f"{title}\n{numbers}" if title else numbers)
    legend_below(figure)
    return figure


def _hertz(value: float) -> str:
    if math.isinf(value):
        return "no oscillation"
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def _shade(ax: Axes, found: xr.Dataset, across: str, up: str) -> None:
    """Growth rates as colours about zero, by decades, with their bar."""
    values = np.ma.masked_invalid(found["growth_rate"].transpose(up, across).to_numpy())
    largest = float(np.abs(values).max()) if values.count() else 1.0
    norm = SymLogNorm(linthresh=max(1e-2 * largest, 1e-300), vmin=-largest, vmax=largest)
    look: Any = {"cmap": "PuOr_r", "norm": norm, "shading": "gouraud", "rasterized": True}
    shade = ax.pcolormesh(found[across], found[up], values, **look)
    decades = 10.0 ** (np.floor(np.log10(largest)) - np.array([0.0, 1.0]))
    bar = ax.figure.colorbar(shade, ax=ax, ticks=[*-decades, 0.0, *decades[::-1]], pad=0.02)
    bar.set_label(label(found["growth_rate"]))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: minus(value)))
    bar.ax.yaxis.set_minor_locator(LogLocator(subs=()))


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


# ---------------------------------------------------------------- axes and legends


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


def legend_below(figure: Figure, patches: Iterable[Patch] = ()) -> None:
    """Put one legend of all axes below them, where it hides no data, in as many rows as its width asks for."""
    found: dict[Any, Any] = {patch.get_label(): patch for patch in patches}
    for ax in figure.axes:
        found |= {name: handle for handle, name in zip(*ax.get_legend_handles_labels(), strict=True)}
    handles = [found[kind] for kind in REGIMES if kind in found] + [
        found[name] for name in found if name not in REGIMES
    ]
    rows = math.ceil(len(handles) / max(figure.get_figwidth() // _ENTRY, 1))
    columns = math.ceil(len(handles) / max(rows, 1))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.4)
