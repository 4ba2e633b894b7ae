"""Maps of the stability of smooth sliding over two parameters, and their boundaries followed by continuation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.io import datasets as store
from stickslip.model.parameters import STIFFNESS, VELOCITY, Parameter, check_range, parameter_named
from stickslip.model.rig import Rig
from stickslip.stability.critical import neutral_along, residual_and_slopes, search
from stickslip.stability.impedances import impedance
from stickslip.stability.modes import respond, rightmost_root

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]
Window = tuple[tuple[float, float], tuple[float, float]]

LINES = 25
"""Lines across the window on which starts are looked for, where a line costs next to nothing."""
FEW_LINES = 7
"""The same where each point on a line has a response of its own."""


def boundary(
    rig: Rig,
    *,
    over: tuple[Parameter | str, Parameter | str] = (STIFFNESS, VELOCITY),
    between: Window,
) -> xarray.Dataset:
    """Follow every neutral curve of smooth sliding in a window of two parameters.

    Pseudo-arclength continuation of ``Z(i omega) + kappa(i omega) = 0`` in the logarithms of both parameters and
    of omega: folds and re-entrant branches are nothing special, closed curves close. Starts are the crossings
    on lines across the window in both directions, its edges among them; a closed curve that slips between two
    lines is missed.

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
        Along ``point``: the two parameters, ``frequency`` (angular, of the neutral mode), ``curve`` (which curve
        the point is on; points of a curve follow each other) and ``other_unstable`` (growing modes beside the
        neutral one: 0 on the edge of stability). No points where there is no boundary; the window searched is
        in ``attrs``.

    Raises
    ------
    InputError
        If a range is empty, both parameters are the same, or there is no steady sliding in the window.
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    parameters, window = _window(over, between)
    natural = rig.natural
    window = window / np.array([[rig.unit(parameter.unit)] for parameter in parameters])
    curves: list[_Curve] = []
    for start in _starts(parameters, natural, window):
        if not any(_lies_on(parameters, natural, curve, start) for curve in curves):
            curve = _follow(parameters, natural, np.log(window), start)
            if curve is not None:
                curves.append(curve)
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
    grids = [np.atleast_1d(np.asarray(value, dtype=float)) for value in values]
    for parameter, grid in zip((first, second), grids, strict=True):
        for value in (np.min(grid), np.max(grid)):
            number(f"values of {parameter.name}", float(value), above=0, hint=parameter.unit)
    grids = [grid / rig.unit(parameter.unit) for parameter, grid in zip((first, second), grids, strict=True)]
    natural = rig.natural
    if second is STIFFNESS or first is VELOCITY:
        counts = _counts(second, first, natural, grids[1], grids[0]).T
    else:
        counts = _counts(first, second, natural, grids[0], grids[1])
    roots = _roots_on_grid((first, second), natural, grids, counts) if growth else None
    return rig.in_its_units(_map_dataset((first, second), natural, grids, counts, roots))


# ---------------------------------------------------------------- maps


def _counts(inner: Parameter, outer: Parameter, rig: Rig, a: Array, b: Array) -> NDArray[np.int64]:
    """Number of growing modes at each ``(a, b)``."""
    counts = np.empty((a.size, b.size), dtype=np.int64)
    if _is_free(inner, rig):
        softest = float(np.min(a))
        columns = neutral_along(outer, inner.set(rig, softest), b.tolist(), softest=softest)
        for j, neutral in enumerate(columns):
            counts[:, j] = (neutral.extra > a[:, None] - softest) @ neutral.modes
        return counts
    for i, value in enumerate(a.tolist()):
        counts[i] = [neutral.unstable() for neutral in neutral_along(outer, inner.set(rig, value), b.tolist())]
    return counts


def _is_free(parameter: Parameter, rig: Rig) -> bool:
    """Whether the parameter adds the same to ``Z`` at every frequency: one set of neutral frequencies for all."""
    return parameter is STIFFNESS and hasattr(rig.slider, "stiffness")


def _roots_on_grid(
    parameters: tuple[Parameter, Parameter], rig: Rig, grids: Sequence[Array], counts: NDArray[np.int64]
) -> NDArray[np.complex128]:
    """Root furthest right at each point, carried from neighbour to neighbour and checked against the count."""
    roots = np.full(counts.shape, complex(math.nan, math.nan))
    for j, b in enumerate(grids[1].tolist()):
        column = parameters[1].set(rig, b)
        known = np.empty(0, dtype=complex)
        for i, a in enumerate(grids[0].tolist()):
            here = parameters[0].set(column, a)
            response, body = respond(here.interface), impedance(here.slider)
            # Every few points the search starts afresh, for a root that overtakes from outside the ones carried along.
            starts = known[:8] if i % 16 else known[:0]
            for attempt in (starts, known[:0]):
                known = response.roots(body, here.velocity, attempt)
                growing = sum(2 if root.imag > 0 else 1 for root in known if root.real > 0)
                if growing == counts[i, j] and known.size:
                    roots[i, j] = known[0]
                    break
            else:
                try:
                    roots[i, j] = rightmost_root(here)
                except UndecidedError:
                    known = known[:0]
    return roots


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


# ---------------------------------------------------------------- starts of curves


def _two_parameters(over: tuple[Parameter | str, Parameter | str]) -> tuple[Parameter, Parameter]:
    first, second = parameter_named(over[0]), parameter_named(over[1])
    if first.name == second.name:
        raise InputError(f"over = ({first.name!r}, {second.name!r}): must be two different parameters")
    return first, second


def _window(over: tuple[Parameter | str, Parameter | str], within: Window) -> tuple[tuple[Parameter, Parameter], Array]:
    parameters = _two_parameters(over)
    ranges = [check_range(parameter, span) for parameter, span in zip(parameters, within, strict=True)]
    return parameters, np.array(ranges)


def _starts(parameters: tuple[Parameter, Parameter], rig: Rig, window: Array) -> list[Array]:
    """Points ``(log a, log b, log omega)`` where neutral curves cross lines over the window."""
    starts = []
    for k, parameter in enumerate(parameters):
        other, span = parameters[1 - k], window[1 - k]
        free, other_free = _is_free(parameter, rig), _is_free(other, rig)
        lines = np.geomspace(span[0], span[1], LINES if free else 2 if other_free else FEW_LINES).tolist()
        lines[0], lines[-1] = span
        for line, value, omega in _on_lines(parameter, other, rig, window[k], lines):
            point = np.log([value, line, omega])
            starts.append(point if k == 0 else point[[1, 0, 2]])
    return starts


def _on_lines(
    parameter: Parameter, other: Parameter, rig: Rig, span: Array, lines: list[float]
) -> list[tuple[float, float, float]]:
    """Crossings ``(line, value, omega)`` along the parameter, on lines of constant value of the other one."""
    low, high = float(span[0]), float(span[1])
    if _is_free(parameter, rig):
        along = neutral_along(other, parameter.set(rig, low), lines, softest=low)
        return [
            (line, low + extra, omega)
            for line, neutral in zip(lines, along, strict=True)
            for omega, extra in zip(neutral.omega.tolist(), neutral.extra.tolist(), strict=True)
            if 0 <= extra <= high - low
        ]
    return [
        (line, crossing.value, crossing.frequency)
        for line in lines
        for crossing in search(parameter, other.set(rig, line), low, high, density=16 if parameter is VELOCITY else 8)
        if math.isfinite(crossing.frequency)
    ]


# ---------------------------------------------------------------- continuation


def _linearised(parameters: Sequence[Parameter], rig: Rig, z: Array) -> tuple[Array, Array]:
    """Residual, shape (2,), and its Jacobian in the three logarithms, shape (2, 3)."""
    value, slopes = residual_and_slopes(parameters, rig, z[:2].tolist(), float(z[2]))
    return np.array([value.real, value.imag]), np.array(
        [[slope.real for slope in slopes], [slope.imag for slope in slopes]]
    )


def _tangent(jacobian: Array) -> Array:
    direction = np.cross(jacobian[0], jacobian[1])
    return np.asarray(direction / np.linalg.norm(direction))


def _correct(
    parameters: Sequence[Parameter], rig: Rig, guess: Array, normal: Array, through: Array | None = None
) -> tuple[Array, Array] | None:
    """Newton's method within a plane across `normal`; the point and the curve's direction there."""
    anchor = guess if through is None else through
    z, last = guess.copy(), math.inf
    for _ in range(8):
        residual, jacobian = _linearised(parameters, rig, z)
        system = np.vstack([jacobian, normal])
        if not np.all(np.isfinite(system)) or abs(np.linalg.det(system)) == 0:
            return None
        step = np.linalg.solve(system, -np.append(residual, normal @ (z - anchor)))
        size = float(np.max(np.abs(step)))
        if size > 0.5:
            return None
        z = z + step
        enough = max(1e-13, respond(rig.interface).precision.settled ** 2)
        if size < 1e-12 or (size < 1e-9 and size > 0.1 * last) or size**2 < enough:
            return z, _tangent(jacobian)
        last = size
    return None


class _Curve(NamedTuple):
    """Points along a neutral curve and the curve's direction at each, shapes (n, 3)."""

    points: Array
    directions: Array


def _follow(parameters: tuple[Parameter, Parameter], rig: Rig, window: Array, start: Array) -> _Curve | None:
    """The curve through `start`, from one end in the window to the other, or all the way round."""
    begun = _correct(parameters, rig, start, np.array([0.0, 0.0, 1.0])) or _correct(
        parameters, rig, start, np.array([1.0, 0.0, 0.0])
    )
    if begun is None:
        return None
    origin, direction = begun
    ahead, closed = _one_way(parameters, rig, window, origin, direction)
    if closed:
        return _Curve(*(np.array(a) for a in zip(begun, *ahead, begun, strict=True)))
    behind, _ = _one_way(parameters, rig, window, origin, -direction)
    back = [(point, -tangent) for point, tangent in behind[::-1]]
    return _Curve(*(np.array(a) for a in zip(*back, begun, *ahead, strict=True)))


def _one_way(
    parameters: tuple[Parameter, Parameter], rig: Rig, window: Array, origin: Array, direction: Array
) -> tuple[list[tuple[Array, Array]], bool]:
    """Points and directions from the origin on, and whether the curve came back to it."""
    span = window[:, 1] - window[:, 0]
    longest = 0.05 * float(np.min(span))
    points: list[tuple[Array, Array]] = []
    z, tangent, bend, h = origin, direction, np.zeros(3), 0.25 * longest
    while len(points) < 5000:
        stepped = _correct(parameters, rig, z + h * (tangent + 0.5 * h * bend), tangent)
        if stepped is None or abs(stepped[1] @ tangent) < math.cos(0.35):
            h *= 0.5
            bend = np.zeros(3)
            if h < 1e-7 * longest:
                raise UndecidedError(
                    f"the boundary could not be followed beyond {parameters[0].name} = {math.exp(z[0]):.6g}, "
                    f"{parameters[1].name} = {math.exp(z[1]):.6g}: it turns too sharply there"
                )
            continue
        new, new_tangent = stepped[0], stepped[1] * math.copysign(1.0, stepped[1] @ tangent)
        if np.any((new[:2] < window[:, 0]) | (new[:2] > window[:, 1])) or new[2] < -40:
            edge = _at_edge(parameters, rig, window, z, new, new_tangent)
            return ([*points, edge] if edge is not None else points), False
        if len(points) > 2 and _passes(z, new, origin, direction, new_tangent):
            return points, True
        points.append((new, new_tangent))
        bend = (new_tangent - tangent) / float(np.linalg.norm(new - z))
        turn = math.acos(min(1.0, float(new_tangent @ tangent)))
        z, tangent = new, new_tangent
        h = float(np.clip(h * np.clip(0.15 / max(turn, 1e-3), 0.5, 2.0), 1e-7 * longest, longest))
    return points, False


def _passes(z: Array, new: Array, origin: Array, direction: Array, tangent: Array) -> bool:
    """Whether the step from `z` to `new` goes through the origin of the curve again, the same way."""
    chord = new - z
    t = float(np.clip((origin - z) @ chord / (chord @ chord), 0.0, 1.0))
    near = float(np.linalg.norm(z + t * chord - origin)) < 0.1 * float(np.linalg.norm(chord))
    return near and float(tangent @ direction) > 0.8


def _at_edge(
    parameters: Sequence[Parameter], rig: Rig, window: Array, z: Array, new: Array, tangent: Array
) -> tuple[Array, Array] | None:
    """Where the curve leaves the window between `z` and `new`."""
    found: tuple[float, tuple[Array, Array]] | None = None
    for k in range(2):
        for edge in window[k]:
            if (z[k] - edge) * (new[k] - edge) < 0:
                t = (edge - z[k]) / (new[k] - z[k])
                guess = z + t * (new - z)
                guess[k] = edge
                landed = _correct(parameters, rig, guess, np.eye(3)[k])
                if landed is not None and (found is None or t < found[0]):
                    found = t, (landed[0], landed[1] * math.copysign(1.0, landed[1] @ tangent))
    return None if found is None else found[1]


def _lies_on(parameters: tuple[Parameter, Parameter], rig: Rig, curve: _Curve, point: Array) -> bool:
    """Whether a point of some neutral curve is on this one."""
    begin, chord = curve.points[:-1], np.diff(curve.points, axis=0)
    length = np.maximum(np.linalg.norm(chord, axis=1), 1e-300)
    t = np.clip(np.sum((point - begin) * chord, axis=1) / length**2, 0.0, 1.0)
    away = np.linalg.norm(begin + t[:, None] * chord - point, axis=1)
    k = int(np.argmin(away))
    if away[k] > 0.3 * length[k] + 1e-6:
        return False
    # Cubic Hermite interpolation settles most cases, Newton's method the others.
    u = float(t[k])
    foot = begin[k] + u * chord[k]
    foot = foot + u * (1 - u) * (
        (1 - u) * (length[k] * curve.directions[k] - chord[k]) - u * (length[k] * curve.directions[k + 1] - chord[k])
    )
    if float(np.linalg.norm(foot - point)) < 2e-3 * length[k]:
        return True
    landed = _correct(parameters, rig, foot, chord[k] / length[k], through=point)
    return landed is not None and float(np.linalg.norm(landed[0] - point)) < 1e-6


def _boundary_dataset(
    parameters: tuple[Parameter, Parameter], rig: Rig, window: Array, curves: list[_Curve]
) -> xarray.Dataset:
    import xarray

    points = np.concatenate([curve.points for curve in curves]) if curves else np.empty((0, 3))
    values = np.exp(points)
    which = np.repeat(np.arange(len(curves)), [len(curve.points) for curve in curves])
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
    data["other_unstable"] = (
        "point",
        _others(parameters, rig, values),
        {"units": "1", "long_name": "growing modes beside the neutral one"},
    )
    made = _provenance("boundary", parameters, rig, within=window.tolist())
    return xarray.Dataset(data, attrs={"provenance": made})


def _others(parameters: tuple[Parameter, Parameter], rig: Rig, values: Array) -> NDArray[np.int64]:
    """Growing modes at each point of a curve, the neutral one left out."""
    if values.shape[0] == 0:
        return np.empty(0, dtype=np.int64)
    free = next((k for k, parameter in enumerate(parameters) if _is_free(parameter, rig)), None)
    if free is not None:
        softest = float(np.min(values[:, free]))
        soft = parameters[free].set(rig, softest)
        neutrals = neutral_along(parameters[1 - free], soft, values[:, 1 - free].tolist(), softest=softest)
        added = values[:, free] - softest
    else:
        there = [parameters[1].set(parameters[0].set(rig, a), b) for a, b in values[:, :2].tolist()]
        neutrals = [n for here in there for n in neutral_along(VELOCITY, here, [here.velocity])]
        added = np.zeros(len(there))
    counts = np.empty(len(neutrals), dtype=np.int64)
    for k, (neutral, omega) in enumerate(zip(neutrals, values[:, 2], strict=True)):
        own = np.abs(neutral.omega - omega) < 1e-6 * omega
        stiffer = int(np.sum(neutral.modes[~own & (neutral.extra > added[k])]))
        # Just above the neutral spring and just below it: the neutral pair counts on one side only.
        counts[k] = min(stiffer, stiffer + int(np.sum(neutral.modes[own])))
    return counts
