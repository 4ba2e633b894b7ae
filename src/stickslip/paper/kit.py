"""How the figures make their data and pictures: cases of a grid, labelled Datasets, panels with their words."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import matplotlib.figure
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from stickslip import plot
from stickslip.paper.figure import Progress
from stickslip.simulation import LABELS

Array = NDArray[np.float64]
Picture = matplotlib.figure.Figure


def portions(progress: Progress, *lengths: float) -> Iterator[Progress]:
    """Divide a progress between tasks of these lengths, one after the other."""
    for done, length in zip(itertools.accumulate(lengths, initial=0.0), lengths, strict=False):

        def part(fraction: float, done: float = done, length: float = length) -> None:
            progress((done + fraction * length) / sum(lengths))

        yield part


def grid(progress: Progress, run: Callable[..., Mapping[str, Any]], *axes: Sequence[Any]) -> dict[str, NDArray[Any]]:
    """Run every case of a grid as ``run(*case, progress)``; each result stands along the axes, then along its own."""
    cases, found = list(itertools.product(*axes)), []
    for case, part in zip(cases, portions(progress, *[1.0] * len(cases)), strict=True):
        found.append(run(*case, part))
        part(1.0)
    shape = tuple(map(len, axes))
    return {name: np.reshape([each[name] for each in found], (*shape, *np.shape(found[0][name]))) for name in found[0]}


def power(x: Any, y: Any) -> float:
    """Return the slope of log y against log x; NaN if a value is."""
    spread = np.cov(np.log(x), np.log(y))
    return float(spread[0, 1] / spread[0, 0])


def dataset(
    variables: Mapping[str, tuple[Any, ...]], coordinates: Mapping[str, tuple[Any, ...]], **attributes: object
) -> xr.Dataset:
    """Return a labelled Dataset.

    A variable is given as ``("dimensions in one text", values, "words [unit]")``, a coordinate as ``(values, "words
    [unit]")``; texts have no unit, and what a run has already needs no words.
    """
    return xr.Dataset(
        {name: _labelled(name, *given) for name, given in variables.items()},
        {name: _labelled(name, name, *given) for name, given in coordinates.items()},
        attributes,
    )


def _labelled(
    name: str, dimensions: str, values: Any, words: str = ""
) -> tuple[list[str], NDArray[Any], Mapping[str, str]]:
    long_name, has_unit, unit = words.removesuffix("]").partition(" [")
    labels = {"long_name": long_name} | ({"units": unit} if has_unit else {})
    return dimensions.split(), np.asarray(values), labels if words else LABELS[name]


def panel(
    ax: Axes,
    title: str,
    x: xr.DataArray | str | None = None,
    y: xr.DataArray | str | None = None,
    legend: Any = None,
    **properties: Any,
) -> None:
    """Name a panel and its axes, by variables or by words; place the legend; set limits, ticks and scales."""
    ax.set(**properties)
    for axis, named in ((ax.xaxis, x), (ax.yaxis, y)):
        if isinstance(named, str):
            axis.set_label_text(named)
        elif named is not None:
            plot.dress(axis, named)
    if legend is not None:
        ax.legend(loc=legend)
    plot.letter(ax, title)


def second_axis(
    ax: Axes, x: xr.DataArray, y: xr.DataArray, limits: tuple[float, float], ticks: Sequence[float], **style: Any
) -> Axes:
    """Draw a red line against a red axis on the right of a panel, and return that."""
    right = ax.twinx()
    right.spines["right"].set_visible(True)
    right.plot(x, y, color=plot.VERMILLION, **style)
    right.set_ylim(limits)
    right.set_yticks(ticks)
    right.tick_params(axis="y", colors=plot.VERMILLION)
    return right
