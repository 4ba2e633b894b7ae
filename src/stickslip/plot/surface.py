"""Pictures of a rough surface: its contacts, their sizes, and the estimate of an
interface.
"""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from stickslip.answers import COLOURS
from stickslip.errors import dataset
from stickslip.plot.palette import BLACK, BLUE, GREEN, GREY, PAGE, SKY, VERMILLION
from stickslip.plot.style import (
    given_or_new,
    house_style,
    interval,
    new_figure,
    number_plainly,
    panel,
)
from stickslip.words import number

_MICRO = 1e6  # micrometres in a metre


@house_style()
def surface(found: xr.Dataset, estimate: Any = None, answer: Any = None) -> Figure:
    """Draw the contacts of a map, as `stickslip.surface.contacts` returns them, and
    their diameters; below, if given, an `estimate` from them and a prediction.
    """
    dataset("found", found, "the contacts of a map")
    rows = 1 if estimate is None else 2
    figure = new_figure(PAGE, 3.0 + 1.9 * (rows - 1))
    figure.set_layout_engine("constrained", wspace=0.08)
    grid = figure.add_gridspec(rows, 2, height_ratios=[3.0, 1.6][:rows])
    surface_map(found, figure.add_subplot(grid[0, 0]))
    contact_sizes(found, figure.add_subplot(grid[0, 1]))
    if estimate is not None:
        below = grid[1, :].subgridspec(1, 2, width_ratios=[3, 2], wspace=0.1)
        _draw_ranges(figure.add_subplot(below[0]), estimate)
        _draw_verdict(figure.add_subplot(below[1]), estimate, answer)
    return figure


@house_style()
def surface_map(found: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw heights in grey, and the contacts in colour."""
    dataset("found", found, "the contacts of a map")
    ax = given_or_new(ax, 3.5, 3.0)
    height = _MICRO * found["height"].to_numpy()
    # nodes are in the middle of their pixels
    step = _MICRO * float(found["x"][1])
    ends = (
        0.0,
        step * height.shape[0],
        0.0,
        step * height.shape[1],
    )
    look: Any = {"origin": "lower", "extent": ends, "interpolation": "nearest"}
    low, high = np.percentile(height, [1, 99])
    shades = ax.imshow(
        height.T,
        cmap="gray",
        vmin=low,
        vmax=high,
        **look,
    )
    touching = np.ma.masked_equal(found["pressure"].to_numpy() > 0.0, False)
    ax.imshow(touching.T, cmap=ListedColormap([VERMILLION]), **look)
    ax.figure.colorbar(shades, ax=ax, pad=0.02, aspect=30, label="height (µm)")
    count = int(found["number"][0])
    covered = 100.0 * float(found["contact_area"][0])
    ax.set_aspect("equal")
    panel(ax, f"{count} contacts on {covered:.2g} %", "x (µm)", "y (µm)")
    return ax


@house_style()
def contact_sizes(found: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw, for each resolution, the fraction of the stiffness in contacts up to a
    diameter.
    """
    dataset("found", found, "the contacts of a map")
    ax = given_or_new(ax, 3.5, 3.0)
    resolution = found["resolution_of"].to_numpy()
    colours = (BLUE, SKY, GREY)
    for k, shortest in enumerate(found["shortest"].to_numpy()):
        area, stiffness = (
            found[name].to_numpy()[resolution == k] for name in ("area", "stiffness")
        )
        diameter = _MICRO * 2.0 * np.sqrt(area / np.pi)
        order = np.argsort(diameter)
        part = np.cumsum(stiffness[order]) / stiffness.sum()
        words = f"waves from {number(_MICRO * shortest, 2)} µm"
        ax.step(
            np.r_[diameter[order[0]], diameter[order]],
            np.r_[0.0, part],
            where="post",
            color=colours[k % len(colours)],
            label=words,
        )
    panel(
        ax,
        "sizes at three resolutions",
        "diameter of a contact (µm)",
        "fraction of the stiffness",
        "upper left",
        xscale="log",
        ylim=(0.0, 1.0),
    )
    number_plainly(ax.xaxis, decades=True)
    return ax


def _draw_ranges(ax: Axes, estimate: Any) -> None:
    """Draw the two lengths, with their ranges, on a logarithmic axis."""
    rows = (
        ("elastic", estimate.elastic, estimate.elastic_between, BLUE),
        ("renewal", estimate.renewal, estimate.renewal_between, GREEN),
    )
    for row, (_, value, between, colour) in enumerate(rows):
        ends = [_MICRO * end for end in between]
        interval(ax, row, ends, _MICRO * value, colour)
    low = _MICRO * estimate.elastic_between[0] / 2.0
    high = _MICRO * estimate.renewal_between[1] * 2.0
    panel(
        ax,
        "a map does not show which length applies",
        "breaking displacement (µm)",
        None,
        xscale="log",
        xlim=(low, high),
        ylim=(-0.6, 1.6),
    )
    number_plainly(ax.xaxis, decades=True)
    ax.set_yticks([0, 1], [name for name, *_ in rows])


def _draw_verdict(ax: Axes, estimate: Any, answer: Any) -> None:
    """Draw the standard deviation with its range and, for a prediction, the fraction of
    rigs within the ranges that oscillate.
    """
    interval(ax, 1, estimate.std_between, estimate.std["renewal"], BLACK)
    names = ["std"]
    title, words = "scatter of the thresholds", "standard deviation over the mean"
    doubt = getattr(answer, "doubt", None)
    if doubt is not None and np.isfinite(doubt.oscillates):
        known = 1.0 - doubt.undecided
        parts = {
            "stick-slip": known * doubt.oscillates,
            "smooth sliding": known * (1.0 - doubt.oscillates),
        }
        begin = 0.0
        for kind, part in parts.items():
            ax.barh(0, part, left=begin, height=0.5, color=COLOURS[kind])
            begin += part
        ax.barh(
            0, doubt.undecided, left=begin, height=0.5, color="white", edgecolor=GREY
        )
        count = f"{100 * doubt.oscillates:.0f} % of {doubt.draws} rigs oscillate"
        ax.text(0.5, -0.55, count, ha="center", va="top", fontsize=7)
        names = ["rigs", "std"]
        title, words = "and so the verdict", "std (relative); fraction of rigs"
    panel(
        ax,
        title,
        words,
        None,
        xlim=(0, 1),
        ylim=(-1.0, 1.6),
    )
    ax.set_yticks(range(2 - len(names), 2), names)
