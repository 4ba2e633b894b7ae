"""Tools for the data and pictures of the figures: grids of cases, labelled Datasets,
and labelled panels.
"""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, SupportsFloat

import matplotlib.figure
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from stickslip.arrays import Array as Array
from stickslip.arrays import Range
from stickslip.plot import GREY, VERMILLION
from stickslip.plot import panel as panel
from stickslip.progress import Progress as Progress
from stickslip.progress import heard, part

Picture = matplotlib.figure.Figure

_WORDS = {  # for variables of several figures
    "contacts": "number of contacts [1]",
    "delay": "delay [time]",
    "initial_std": "standard deviation of initial forces [f_s]",
    "rate": "rate of ageing β [1/sqrt(time)]",
    "seed": "seed [1]",
    "threshold_std": "standard deviation of thresholds [f_s]",
    "v1_linear": "v1: smooth sliding loses stability (linear) [x_s/time]",
}


def dataset(
    variables: Mapping[Any, Any],
    coordinates: Mapping[str, Any] | None = None,
    **attributes: object,
) -> xr.Dataset:
    """Return a labelled Dataset.

    A variable is an array with its own coordinates, or ``("dimension", values)``; if it
    has no attributes, unlike those of a run, ``"words [unit]"`` follow. A coordinate is
    given by its values, or ``(values, words)``.
    """
    words = dict(_WORDS)
    given = dict(variables) | dict(coordinates or {})
    for name, values in given.items():
        if isinstance(values, tuple) and isinstance(values[-1], str):
            words[name] = values[-1]
            given[name] = values[0] if len(values) == 2 else values[:2]
    places = {name: (name, np.asarray(given.pop(name))) for name in coordinates or {}}
    data = xr.Dataset(given, places, attributes)
    for name, variable in data.variables.items():
        if name in words or not variable.attrs:
            long_name, _, unit = (
                words.get(str(name), str(name)).removesuffix("]").partition(" [")
            )
            variable.attrs = {"long_name": long_name} | (
                {"units": unit} if unit else {}
            )
    return data


def portions(progress: Progress, *lengths: float) -> Iterator[Progress]:
    """Divide a progress between successive tasks of these lengths."""
    ends = np.append(0.0, np.cumsum(lengths)) / sum(lengths)
    return (part(progress, *each) for each in itertools.pairwise(ends.tolist()))


def grid(
    run: Callable[..., Mapping[Any, Any]],
    progress: Progress | None = None,
    /,
    **axes: Iterable[Any],
) -> xr.Dataset:
    """Run every case of a grid as ``run(*case)``, or ``run(*case, progress)`` if it
    reports its progress.

    The variables of a run have the axes as first dimensions, then their own.
    """
    coordinates = {name: list(values) for name, values in axes.items()}
    cases = list(itertools.product(*coordinates.values()))
    found = []
    for case, report in zip(
        cases, portions(heard(progress), *[1.0] * len(cases)), strict=True
    ):
        found.append(xr.Dataset(dict(run(*case, *([report] if progress else [])))))
        report(1.0)
    rows = xr.concat(
        found,
        "case",
        data_vars="all",
        coords="minimal",
        compat="override",
        join="override",
    )
    shape = [len(values) for values in coordinates.values()]
    shaped = {
        name: (
            [*axes, *row.dims[1:]],
            row.values.reshape(*shape, *row.shape[1:]),
            row.attrs,
        )
        for name, row in rows.data_vars.items()
    }
    return xr.Dataset(shaped, dict(rows.coords) | coordinates)


def table(run: Callable[..., Any], /, **axes: Iterable[Any]) -> xr.DataArray:
    """Return one number, or array, for every case of a grid: ``run(*case)``."""
    return grid(lambda *case: {"value": run(*case)}, **axes)["value"]


def power(x: Any, y: Any) -> float:
    """Return the slope of log y against log x; NaN if any value is NaN."""
    spread = np.cov(np.log(x), np.log(y))
    return float(spread[0, 1] / spread[0, 0])


def shade(ax: Axes, ends: Iterable[SupportsFloat], words: str, height: float) -> None:
    """Shade a range of the horizontal axis in grey, with a label above a height."""
    low, high = map(float, ends)
    ax.axvspan(low, high, color=GREY, alpha=0.15, linewidth=0)
    ax.text(0.5 * (low + high), height, words, ha="center", va="bottom", fontsize=8)


def second_axis(
    ax: Axes,
    x: xr.DataArray,
    y: xr.DataArray,
    limits: Range,
    ticks: Sequence[float],
    **style: Any,
) -> Axes:
    """Draw a red line against a red axis on the right of a panel; return the axis."""
    right = ax.twinx()
    right.spines["right"].set_visible(True)
    right.plot(x, y, color=VERMILLION, **style)
    right.set(ylim=limits, yticks=ticks)
    right.tick_params(axis="y", colors=VERMILLION)
    return right
