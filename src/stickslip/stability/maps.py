"""Maps of the stability of smooth sliding over two parameters, and their boundaries."""

from __future__ import annotations

import math
from dataclasses import is_dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.arrays import Array, Labelled, labelled
from stickslip.errors import (
    InputError,
    UndecidedError,
    instance,
    numbers,
    pair,
)
from stickslip.io import datasets as store
from stickslip.model.parameters import STIFFNESS, VELOCITY, Parameter, parameter_named
from stickslip.model.rig import Ends, Rig
from stickslip.progress import Progress, heard, part
from stickslip.stability import roots
from stickslip.stability.critical import Line, LinePoint
from stickslip.stability.impedances import spring_at_contact
from stickslip.stability.modes import growth_rate, smooth_sliding
from stickslip.stability.neutral import Neutral

if TYPE_CHECKING:
    import xarray as xr

Window = tuple[Ends, Ends]
Over = tuple[Parameter | str, Parameter | str]

_AROUND = np.geomspace(0.1, 10.0, 41)  # values of a map, over the rig's own
# lines across the window in each direction, where the points of a line share a response
LINES = 65
FEW_LINES = 33  # where each point of a line needs its own response


def boundary(
    rig: Rig,
    *,
    over: Over = (STIFFNESS, VELOCITY),
    between: Window,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Find where smooth sliding loses or regains stability in a window of two
    parameters.

    A contour is drawn between stable and unstable points of a grid, and each of its
    points is polished by Newton's method along its line of the grid, as in `critical`:
    folds and re-entrant branches need no special treatment, and closed curves close. An
    island or a bay narrower than the grid, a 32nd of the window (over the stiffness a
    64th), may be missed.

    Parameters
    ----------
    rig : Rig
        The rig; its values of the two parameters do not matter.
    over : (Parameter or str, Parameter or str)
        The two parameters, see `critical`.
    between : ((float, float), (float, float))
        Range of each, in the rig's own units.
    progress : callable, optional
        Called with the completed fraction.

    Returns
    -------
    xarray.Dataset
        Along ``point``: the two parameters, ``frequency`` (angular, of the neutral
        mode; infinite where it does not oscillate) and ``curve`` (the number of the
        curve that the point is on; points of a curve follow each other). It has no
        points where there is no boundary; the window searched is in ``attrs``.

    Raises
    ------
    InputError
        If a range is empty, both parameters are the same, or there is no steady sliding
        in the window.
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    report = heard(progress)
    parameters = _two_parameters(over)
    ranges = pair("between", between, "a range of each parameter")
    window = [
        rig.span(parameter, ends)
        for parameter, ends in zip(parameters, ranges, strict=True)
    ]
    lines = (
        LINES
        if any(_is_free(parameter, rig) for parameter in parameters)
        else FEW_LINES
    )
    grids = [np.geomspace(low, high, lines) for low, high in window]
    grid = _MapGrid(parameters, rig.natural, grids)
    curves = grid.contour(report)
    points = np.concatenate([np.empty((0, 3)), *curves]).T
    which = np.repeat(np.arange(len(curves)), [len(curve) for curve in curves])
    columns = {
        p.name: labelled(p.name, "point", points[k], p.unit)
        for k, p in enumerate(parameters)
    }
    title = "angular frequency of the neutral mode"
    columns["frequency"] = labelled(title, "point", points[2], "1/time")
    columns["curve"] = labelled("number of the curve", "point", which, "1")
    return rig.in_its_units(
        grid.dataset("boundary", columns, within=[list(ends) for ends in window])
    )


def stability_map(
    rig: Rig,
    *,
    over: Over = (STIFFNESS, VELOCITY),
    values: tuple[ArrayLike, ArrayLike] | None = None,
    growth: bool = False,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Count the growing modes of smooth sliding on a grid of two parameters.

    Over the stiffness of a rig nothing is computed twice: for each value of the other
    parameter the springs that make a mode neutral are computed, and a column of the map
    follows from them.

    Parameters
    ----------
    rig : Rig
        The rig; its own values of the two parameters are used without `values` only.
    over : (Parameter or str, Parameter or str)
        The two parameters, see `critical`.
    values : (array_like, array_like), optional
        Values of each parameter, all above 0, in the rig's own units. By default 41
        from a tenth to ten times the rig's own.
    growth : bool
        Whether to return the growth rate and frequency of the fastest mode as well,
        which takes some milliseconds a point.
    progress : callable, optional
        Called with the completed fraction.

    Returns
    -------
    xarray.Dataset
        ``unstable_modes`` over the two parameters; with `growth`, ``growth_rate`` and
        ``frequency`` of the rightmost root (NaN where no mode decays exponentially).

    Raises
    ------
    InputError
        If a value is not above 0, both parameters are the same, or there is no steady
        sliding.

    Examples
    --------
    >>> rig = ss.example("brake_pad")
    >>> found = ss.stability_map(rig, over=("velocity", "stiffness"))
    >>> found["velocity"].values[[0, 20, 40]].round(4)  # m/s, about the rig's own
    array([0.002, 0.02 , 0.2  ])
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    report = heard(progress)
    parameters = _two_parameters(over)
    if values is None:
        first, second = (rig.value(each) * _AROUND for each in parameters)
        values = first, second
    given = zip(
        parameters,
        pair("values", values, "values of each parameter"),
        strict=True,
    )
    grids = [
        np.atleast_1d(
            numbers(
                f"values of {parameter.name}",
                value,
                above=0,
                hint=rig.unit_name(parameter.unit),
            )
        )
        / rig.unit(parameter.unit)
        for parameter, value in given
    ]
    grid = _MapGrid(parameters, rig.natural, grids)
    points = grid.neutral(part(report, 0.0, 0.5 if growth else 1.0))
    counts = np.array(
        [[neutral.unstable() for neutral in row] for row in points],
        dtype=np.int64,
    )
    columns = {
        p.name: labelled(p.name, p.name, grids[k], p.unit)
        for k, p in enumerate(parameters)
    }
    names = tuple(columns)
    title = "growing modes of smooth sliding"
    columns["unstable_modes"] = labelled(title, names, counts, "1")
    if growth:
        fastest = grid.fastest(counts, part(report, 0.5, 1.0))
        for name, title, value in (
            ("growth_rate", "growth rate of the fastest mode", fastest.real),
            ("frequency", "its angular frequency", fastest.imag),
        ):
            columns[name] = labelled(title, names, value, "1/time")
    plain = [each.tolist() for each in grids]
    return rig.in_its_units(
        grid.dataset("stability_map", columns, values=plain, growth=growth)
    )


def _two_parameters(
    over: Over,
) -> tuple[Parameter, Parameter]:
    first, second = (
        parameter_named(each, "over") for each in pair("over", over, "two parameters")
    )
    if first.name == second.name:
        raise InputError(
            f"over = ({first.name!r}, {second.name!r}): must be two different "
            "parameters"
        )
    return first, second


def _is_free(parameter: Parameter, rig: Rig) -> bool:
    """Whether the parameter adds the same to ``Z`` at every frequency, so that one set
    of neutral frequencies serves all its values.
    """
    return parameter is STIFFNESS and spring_at_contact(rig.slider) is not None


class _MapGrid(NamedTuple):
    """Points over two parameters of a rig, in natural units."""

    parameters: tuple[Parameter, Parameter]
    rig: Rig
    values: list[Array]

    def neutral(self, report: Progress) -> list[list[Neutral]]:
        """Return the neutral frequencies at each point, by the first parameter and then
        by the second.
        """
        # where the units change, so does the spring
        rescaled = any(parameter.rescales for parameter in self.parameters)
        frees = [not rescaled and _is_free(each, self.rig) for each in self.parameters]
        free = frees.index(True) if any(frees) else None
        # Points along the velocity share a response.
        outer = free if free is not None else int(self.parameters[0] is VELOCITY)
        rows = self.values[outer].tolist()
        line = self.values[1 - outer].tolist()
        if free is None:
            found = []
            for value in rows:
                found.append(self.line(1 - outer, value).neutral(line))
                report(len(found) / len(rows))
        else:  # a stiffer spring reduces each extra spring by its difference
            softest = min(rows)
            known = self.line(1 - outer, softest).neutral(line, softest=softest)
            found = [
                [
                    neutral._replace(extra=neutral.extra - (k - softest))
                    for neutral in known
                ]
                for k in rows
            ]
        return found if outer == 0 else [list(row) for row in zip(*found, strict=True)]

    def line(self, k: int, value: float) -> Line:
        """Return the rig along parameter `k`, with the other parameter at a value; one
        that changes the units of the rig is set last.
        """
        mine = self.parameters[k]
        other = self.parameters[1 - k]
        if not other.rescales:
            return Line(mine, other.set(self.rig, value))
        return Line(
            replace(mine, set=lambda rig, here: other.set(mine.set(rig, here), value)),
            self.rig,
        )

    def fastest(
        self, counts: NDArray[np.int64], report: Progress
    ) -> NDArray[np.complex128]:
        """Return the rightmost root at each point, followed from neighbour to neighbour
        and checked against the count.
        """
        found = np.full(counts.shape, complex(math.nan, math.nan))
        for j, b in enumerate(self.values[1].tolist()):
            column = self.line(0, b)
            known = np.empty(0, dtype=complex)
            for i, a in enumerate(self.values[0].tolist()):
                here = column.parameter.set(column.rig, a)
                sliding = smooth_sliding(here)
                # Every few points the search starts anew, in case another root
                # overtakes those that are followed.
                for starts in (known[:8] if i % 16 else known[:0], known[:0]):
                    known = roots.near(sliding, starts)
                    if roots.is_rightmost(sliding, known, int(counts[i, j])):
                        found[i, j] = known[0]
                        break
                else:
                    try:
                        found[i, j] = growth_rate(here)
                    except UndecidedError:
                        known = known[:0]
            report((j + 1) / self.values[1].size)
        return found

    def contour(self, report: Progress) -> list[Array]:
        """Return curves between stable and unstable points: both parameters and the
        frequency, shape (n, 3) each.
        """
        import contourpy

        points = self.neutral(part(report, 0.0, 0.5))
        signs = [
            [1.0 if neutral.unstable() > 0 else -1.0 for neutral in row]
            for row in points
        ]
        contours = contourpy.contour_generator(z=signs)
        lines = [np.asarray(line).tolist() for line in contours.lines(0.0)]
        total = sum(map(len, lines))
        done = 0
        curves = []
        for line in lines:
            curve = []
            # Each point of the contour is halfway between a stable and an unstable
            # point of the grid.
            for j, i in line:
                point = self.on_side(points, i, j)
                if point is not None:
                    curve.append(point)
                done += 1
                report(0.5 + 0.5 * done / total)
            if curve:
                curves.append(np.array(curve))
        return curves

    def on_side(
        self,
        points: list[list[Neutral]],
        i: float,
        j: float,
    ) -> tuple[float, float, float] | None:
        """Return the boundary on the side of a cell whose middle is ``(i, j)``, and the
        frequency there.
        """
        ends = (math.floor(i), math.floor(j)), (math.ceil(i), math.ceil(j))
        k = 0 if ends[1][0] > ends[0][0] else 1
        other = float(self.values[1 - k][ends[0][1 - k]])
        left, right = (
            LinePoint(float(self.values[k][end[k]]), points[end[0]][end[1]])
            for end in ends
        )
        for crossing in self.line(k, other).between(left, right):
            if crossing.loses_stability or crossing.regains_stability:
                place = (crossing.value, other) if k == 0 else (other, crossing.value)
                return *place, crossing.frequency
        return None

    def dataset(
        self, call: str, columns: dict[str, Labelled], **more: object
    ) -> xr.Dataset:
        """Return columns with their provenance; a slider that is a function is recorded
        by its name only.
        """
        import xarray as xr

        rig = self.rig
        made = {
            "interface": rig.interface,
            "slider": rig.slider if is_dataclass(rig.slider) else repr(rig.slider),
            "drive": rig.drive,
            "over": [parameter.name for parameter in self.parameters],
            **more,
        }
        return xr.Dataset(columns, attrs={"provenance": store.provenance(call, made)})
