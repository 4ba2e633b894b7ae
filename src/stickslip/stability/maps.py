"""Maps of the stability of smooth sliding over two parameters, and their boundaries."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, UndecidedError, instance, numbers, sequence, shown
from stickslip.io import datasets as store
from stickslip.model.parameters import PARAMETERS, STIFFNESS, VELOCITY, Parameter, parameter_named
from stickslip.model.rig import Ends, Rig
from stickslip.sliding import respond
from stickslip.stability import roots
from stickslip.stability.critical import Point, crossings_between, neutral_along
from stickslip.stability.impedances import impedance
from stickslip.stability.modes import rightmost_root
from stickslip.stability.neutral import Neutral

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]
Window = tuple[Ends, Ends]

LINES = 65
"""Lines across the window in each direction, where a line costs next to nothing."""
FEW_LINES = 33
"""The same where each point on a line has a response of its own."""


def boundary(
    rig: Rig,
    *,
    over: tuple[Parameter | str, Parameter | str] = (STIFFNESS, VELOCITY),
    between: Window,
) -> xarray.Dataset:
    """Find where smooth sliding loses or regains stability in a window of two parameters.

    The contour between stable and unstable points of a grid, each of its points then polished by Newton's method along
    its line of the grid, as `critical` does: folds and re-entrant branches are nothing special, closed curves close. An
    island or a bay narrower than the grid, a 32nd of the window (over the stiffness a 64th), may be missed.

    Parameters
    ----------
    rig : Rig
        The values of the two parameters in it do not matter.
    over : (Parameter or str, Parameter or str)
        The two parameters, see `critical`.
    between : ((float, float), (float, float))
        Range of each, in the rig's own units.

    Returns
    -------
    xarray.Dataset
        Along ``point``: the two parameters, ``frequency`` (angular, of the neutral mode) and ``curve`` (which curve the
        point is on; points of a curve follow each other). No points where there is no boundary; the window searched is
        in ``attrs``.

    Raises
    ------
    InputError
        If a range is empty, both parameters are the same, or there is no steady sliding in the window.
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    parameters, window = _window(rig, over, between)
    natural = rig.natural
    lines = LINES if any(_is_free(parameter, natural) for parameter in parameters) else FEW_LINES
    grids = [np.geomspace(low, high, lines) for low, high in window]
    for grid, ends in zip(grids, window, strict=True):
        grid[[0, -1]] = ends
    curves = _contour(parameters, natural, grids)
    return rig.in_its_units(_boundary_dataset(parameters, natural, window, curves))


def stability_map(
    rig: Rig,
    *,
    over: tuple[Parameter | str, Parameter | str] = (STIFFNESS, VELOCITY),
    values: tuple[ArrayLike, ArrayLike],
    growth: bool = False,
) -> xarray.Dataset:
    """Count the growing modes of smooth sliding on a grid of two parameters.

    Over the stiffness of a rig nothing is repeated: for each value of the other parameter the springs that make a
    mode neutral are computed, and each column of the map read off them.

    Parameters
    ----------
    rig : Rig
        The values of the two parameters in it do not matter.
    over : (Parameter or str, Parameter or str)
        The two parameters, see `critical`.
    values : (array_like, array_like)
        Values of each, all above 0, in the rig's own units.
    growth : bool
        Whether to give the growth rate and frequency of the fastest mode as well, which takes some
        milliseconds a point.

    Returns
    -------
    xarray.Dataset
        ``unstable_modes`` over the two parameters; with `growth`, ``growth_rate`` and ``frequency`` of the root
        furthest to the right (NaN where no mode decays exponentially).

    Raises
    ------
    InputError
        If a value is not above 0, both parameters are the same, or there is no steady sliding.
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    first, second = _two_parameters(over)
    grids = [
        np.atleast_1d(numbers(f"values of {parameter.name}", value, above=0, hint=rig.unit_name(parameter.unit)))
        for parameter, value in zip((first, second), _pair("values", values, "values of each parameter"), strict=True)
    ]
    grids = [grid / rig.unit(parameter.unit) for parameter, grid in zip((first, second), grids, strict=True)]
    natural = rig.natural
    points = _points_on_grid((first, second), natural, grids)
    counts = np.array([[neutral.unstable() for neutral in row] for row in points], dtype=np.int64)
    found = _roots_on_grid((first, second), natural, grids, counts) if growth else None
    return rig.in_its_units(_map_dataset((first, second), natural, grids, counts, found))


# ---------------------------------------------------------------- maps


def _is_free(parameter: Parameter, rig: Rig) -> bool:
    """Whether the parameter adds the same to ``Z`` at every frequency: one set of neutral frequencies for all."""
    return parameter is STIFFNESS and hasattr(rig.slider, "stiffness")


def _points_on_grid(parameters: tuple[Parameter, Parameter], rig: Rig, grids: Sequence[Array]) -> list[list[Neutral]]:
    """Neutral frequencies at each point of the grid, by the first parameter and then by the second."""
    free = next((k for k in range(2) if _is_free(parameters[k], rig)), None)
    if free is None:
        inner = 1 if parameters[0] is not VELOCITY else 0
        found = [
            neutral_along(parameters[inner], parameters[1 - inner].set(rig, value), grids[inner].tolist())
            for value in grids[1 - inner].tolist()
        ]
        return found if inner == 1 else [list(row) for row in zip(*found, strict=True)]
    # What a softer spring lacks, a stiffer one lacks by so much less.
    springs = grids[free]
    softest = float(np.min(springs))
    along = neutral_along(
        parameters[1 - free], parameters[free].set(rig, softest), grids[1 - free].tolist(), softest=softest
    )
    found = [[neutral._replace(extra=neutral.extra - (k - softest)) for neutral in along] for k in springs.tolist()]
    return found if free == 0 else [list(row) for row in zip(*found, strict=True)]


def _roots_on_grid(
    parameters: tuple[Parameter, Parameter], rig: Rig, grids: Sequence[Array], counts: NDArray[np.int64]
) -> NDArray[np.complex128]:
    """Root furthest right at each point, carried from neighbour to neighbour and checked against the count."""
    fastest = np.full(counts.shape, complex(math.nan, math.nan))
    for j, b in enumerate(grids[1].tolist()):
        column = parameters[1].set(rig, b)
        known = np.empty(0, dtype=complex)
        for i, a in enumerate(grids[0].tolist()):
            here = parameters[0].set(column, a)
            response, body = respond(here.interface), impedance(here.slider)
            # Every few points the search starts afresh, for a root that overtakes from outside the ones carried along.
            starts = known[:8] if i % 16 else known[:0]
            for attempt in (starts, known[:0]):
                known = roots.near(response, body, here.velocity, attempt)
                growing = sum(2 if root.imag > 0 else 1 for root in known if root.real > 0)
                if growing == counts[i, j] and known.size:
                    fastest[i, j] = known[0]
                    break
            else:
                try:
                    fastest[i, j] = rightmost_root(here)
                except UndecidedError:
                    known = known[:0]
    return fastest


def _map_dataset(
    parameters: tuple[Parameter, Parameter],
    rig: Rig,
    grids: Sequence[Array],
    counts: NDArray[np.int64],
    roots: NDArray[np.complex128] | None,
) -> xarray.Dataset:
    import xarray

    names = tuple(parameter.name for parameter in parameters)
    data: dict[str, tuple[tuple[str, ...], Any, dict[str, str]]] = {
        "unstable_modes": (names, counts, {"units": "1", "long_name": "growing modes of smooth sliding"}),
    }
    if roots is not None:
        rate = {"units": "1/time", "long_name": "growth rate of the fastest mode"}
        data["growth_rate"] = (names, roots.real, rate)
        data["frequency"] = (names, roots.imag, {"units": "1/time", "long_name": "its angular frequency"})
    coords = {
        parameter.name: (parameter.name, grid, {"units": parameter.unit, "long_name": parameter.name})
        for parameter, grid in zip(parameters, grids, strict=True)
    }
    values = [grid.tolist() for grid in grids]
    made = _provenance("stability_map", parameters, rig, values=values, growth=roots is not None)
    return xarray.Dataset(data, coords=coords, attrs={"provenance": made})


def _provenance(call: str, parameters: Sequence[Parameter], rig: Rig, **more: object) -> str:
    """What made the result; a rig that is a function is named, but cannot be made again from its name."""
    arguments = {
        "interface": rig.interface,
        "slider": rig.slider if is_dataclass(rig.slider) else repr(rig.slider),
        "drive": rig.drive,
        "over": [parameter.name for parameter in parameters],
        **more,
    }
    return store.provenance(call, arguments)


# ---------------------------------------------------------------- boundaries


def _pair(place: str, given: object, what: str) -> tuple[Any, ...]:
    found = sequence(place, given, what)
    if len(found) != 2:
        raise InputError(f"{place} = {shown(given)}: must be {what}", place)
    return found


def _two_parameters(over: tuple[Parameter | str, Parameter | str]) -> tuple[Parameter, Parameter]:
    first, second = (parameter_named(each, "over") for each in _pair("over", over, "two parameters"))
    for parameter in (first, second):
        if parameter.rescales:
            raise InputError(
                f"over: {parameter.name!r} cannot be an axis of a map; use one of "
                f"{', '.join(one.name for one in PARAMETERS)}"
            )
    if first.name == second.name:
        raise InputError(f"over = ({first.name!r}, {second.name!r}): must be two different parameters")
    return first, second


def _window(
    rig: Rig, over: tuple[Parameter | str, Parameter | str], within: Window
) -> tuple[tuple[Parameter, Parameter], Array]:
    parameters = _two_parameters(over)
    ranges = [rig.span(parameter, span) for parameter, span in zip(parameters, within, strict=True)]
    return parameters, np.array(ranges)


def _contour(parameters: tuple[Parameter, Parameter], rig: Rig, grids: Sequence[Array]) -> list[Array]:
    """Lines between stable and unstable points of the grid: both parameters and the frequency, shape (n, 3) each."""
    import contourpy

    points = _points_on_grid(parameters, rig, grids)
    unstable = np.array([[neutral.unstable() > 0 for neutral in row] for row in points])
    crossed: dict[tuple[float, float], tuple[float, float, float] | None] = {}
    curves = []
    for line in contourpy.contour_generator(z=np.where(unstable, 1.0, -1.0)).lines(0.0):
        curve = []
        # Each point of the contour lies half way between a stable and an unstable point of the grid.
        for j, i in np.asarray(line).tolist():
            if (i, j) not in crossed:
                crossed[i, j] = _on_side(parameters, rig, grids, points, i, j)
            curve.append(crossed[i, j])
        found = [point for point in curve if point is not None]
        if found:
            curves.append(np.array(found))
    return curves


def _on_side(
    parameters: tuple[Parameter, Parameter],
    rig: Rig,
    grids: Sequence[Array],
    points: list[list[Neutral]],
    i: float,
    j: float,
) -> tuple[float, float, float] | None:
    """The boundary itself on the side of a cell, of which ``(i, j)`` is the middle, and the frequency there."""
    at, beyond = (math.floor(i), math.floor(j)), (math.ceil(i), math.ceil(j))
    k = 0 if beyond[0] > at[0] else 1
    along, other = parameters[k], float(grids[1 - k][at[1 - k]])
    left, right = (
        Point(float(grids[k][end[k]]), neutral, neutral.unstable())
        for end in (at, beyond)
        for neutral in (points[end[0]][end[1]],)
    )
    for crossing in crossings_between(along, parameters[1 - k].set(rig, other), left, right):
        changes = crossing.loses_stability or crossing.regains_stability
        if changes and math.isfinite(crossing.frequency):
            place = (crossing.value, other) if k == 0 else (other, crossing.value)
            return *place, crossing.frequency
    return None


def _boundary_dataset(
    parameters: tuple[Parameter, Parameter], rig: Rig, window: Array, curves: list[Array]
) -> xarray.Dataset:
    import xarray

    values = np.concatenate([np.empty((0, 3)), *curves])
    which = np.repeat(np.arange(len(curves)), [len(curve) for curve in curves])
    data = {
        parameter.name: ("point", values[:, k], {"units": parameter.unit, "long_name": parameter.name})
        for k, parameter in enumerate(parameters)
    }
    data["frequency"] = (
        "point",
        values[:, 2],
        {"units": "1/time", "long_name": "angular frequency of the neutral mode"},
    )
    data["curve"] = ("point", which, {"units": "1", "long_name": "number of the curve"})
    made = _provenance("boundary", parameters, rig, within=window.tolist())
    return xarray.Dataset(data, attrs={"provenance": made})
