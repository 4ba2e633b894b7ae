"""The cycle of stick-slip, followed along a parameter up to where its branch ends."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import labelled
from stickslip.cycles.edges import CyclePoint, Edge, EdgeKind, ParameterScan, halved
from stickslip.errors import UndecidedError, number
from stickslip.io import datasets as store
from stickslip.model import FromRest
from stickslip.model.parameters import VELOCITY, Parameter
from stickslip.model.rig import Rig

if TYPE_CHECKING:
    import xarray as xr

_TITLES = {
    "amplitude": ("peak to peak of the spring force", "f_s"),
    "period": ("period of the cycle", "time"),
    "largest_velocity": ("largest velocity of the slider", "velocity"),
    "mean_force": ("mean spring force", "f_s"),
    "linearly_unstable": ("whether smooth sliding is unstable by linear theory", "1"),
}
"""Titles and units of the features of a cycle at each value of the parameter."""


def cycle_branch(
    rig: Rig,
    parameter: Parameter | str = VELOCITY,
    *,
    between: tuple[float, float],
    begin: float | None = None,
    step: float = 0.05,
    tolerance: float = 2e-3,
) -> xr.Dataset:
    """Follow the cycle of stick-slip in a parameter, in both directions, up to where it
    decays (nonlinear).

    The motion is continued from value to value: the parameter is changed by a step, and
    the motion settles again. Where it decays, the step is halved and tried again, until
    the end of the branch is known to the tolerance. A cycle of finite amplitude ends at
    a fold, where it meets an unstable cycle; forward runs do not go around it. For the
    velocity the ends are ``v1'`` on the way down, and ``v2``, if there is one, on the
    way up.

    Parameters
    ----------
    rig : Rig
    parameter : Parameter or str
    between : (float, float)
        Range of the parameter, in the rig's own units, both ends above 0.
    begin : float, optional
        Value at which the cycle is first searched, from rest; by default that of the
        rig or, if no oscillation persists there, the first of 17 values over the range
        at which one does.
    step : float
        Largest change of the parameter in one step, as a fraction of its value.
    tolerance : float
        Relative width of the bracket about the ends of the branch.

    Returns
    -------
    xarray.Dataset
        Along the parameter, in increasing order: ``amplitude`` (peak to peak of the
        spring force), ``period``, ``largest_velocity`` of the slider, ``mean_force``,
        and ``linearly_unstable`` (whether smooth sliding is unstable). Attributes:
        ``low_end`` and ``high_end`` ("fold", "end of range", "shrinks to nothing" or
        "undecided"), and the brackets ``low_decays_at``, ``low_persists_at``,
        ``high_decays_at``, ``high_persists_at``.

    Raises
    ------
    UndecidedError
        If no oscillation persists at `begin`, or at any of the values tried.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> rig = ss.Rig(
    ...     interface,
    ...     ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4),
    ...     ss.constant(velocity=1.0),
    ... )
    >>> from stickslip.cycles import cycle_branch
    >>> branch = cycle_branch(
    ...     rig, "velocity", between=(0.6, 1.0), step=0.2, tolerance=0.01
    ... )
    >>> branch.low_end, branch.high_end
    ('fold', 'end of range')
    """
    import xarray as xr

    scan = ParameterScan(
        rig,
        parameter,
        between,
        FromRest(),
        tolerance=tolerance,
        step=step,
    )
    scan.check_work(scan.steps)
    along = scan.parameter.name
    if begin is not None:
        begin = number(
            "begin",
            begin,
            at_least=scan.low,
            at_most=scan.high,
            hint=scan.unit,
        )
    first = first_point(scan, begin)
    (down, low_end), (up, high_end) = (
        carried(scan, first, until) for until in (scan.low, scan.high)
    )
    points = [*reversed(down), *up[1:]]
    arguments = {
        "rig": rig.natural,
        "parameter": along,
        "between": [scan.low / scan.size, scan.high / scan.size],
    }
    attributes: dict[str, float | str] = {
        "provenance": store.provenance("cycle_branch", arguments)
    }
    for name, edge in (("low", low_end), ("high", high_end)):
        attributes[f"{name}_end"] = edge.kind
        attributes[f"{name}_decays_at"] = edge.decays_at
        attributes[f"{name}_persists_at"] = edge.persists_at
    speed = rig.unit("velocity")
    # NaN where it is unknown whether smooth sliding is unstable
    columns = np.array(
        [
            (
                p.verdict.peak_to_peak,
                p.verdict.period,
                p.verdict.largest_velocity * p.run.drive.velocity * speed,
                p.verdict.mean_force,
                p.verdict.linearly_unstable,
                p.value,
            )
            for p in points
        ],
        dtype=float,
    ).T
    titles = {**_TITLES, along: (along, scan.parameter.unit)}
    named = {
        name: labelled(title, along, values, rig.unit_name(unit))
        for (name, (title, unit)), values in zip(titles.items(), columns, strict=True)
    }
    return xr.Dataset(named, attrs=attributes)


def first_point(scan: ParameterScan, begin: float | None = None) -> CyclePoint:
    """Find a cycle from the start, at a value, or at the rig's own and then over the
    range from its middle outwards.

    Raises `UndecidedError` if there is none.
    """
    own = scan.rig.value(scan.parameter)
    middle = math.sqrt(scan.low * scan.high)
    grid = sorted(scan.grid(17), key=lambda value: abs(math.log(value / middle)))
    values = (
        [*([own] if scan.low <= own <= scan.high else []), *grid]
        if begin is None
        else [begin]
    )
    for value in values:
        point = scan.settled(value)
        if point.verdict.has_cycle:
            return point
    raise UndecidedError(
        f"no sustained oscillation found from {scan.start} at {scan.parameter.name} = "
        f"{scan.in_words(*values)}; the last: {point.verdict}"
    )


def carried(
    scan: ParameterScan,
    first: CyclePoint,
    until: float,
) -> tuple[list[CyclePoint], Edge]:
    """Continue the cycle towards a value; return the points, beginning with `first`,
    and the end of the branch.
    """
    points = [first]
    failed = first

    def persists(value: float) -> bool | None:
        nonlocal failed
        there = scan.settled(value, points[-1].run)
        if there.verdict.has_cycle:
            points.append(there)
            return True
        if there.verdict.sustained is False:
            failed = there
            return False
        return None

    away = math.log(until / first.value)
    stride = math.copysign(math.log1p(scan.step), away)
    strides = math.ceil(away / stride - 1e-12)
    values = [first.value * math.exp(k * stride) for k in range(1, strides)]
    if strides:
        values.append(until)
    for value in values:
        persistent = persists(value)
        if persistent is None:
            return points, Edge.of("undecided", value, points[-1].value)
        if not persistent:
            break
    else:
        return points, Edge.of("end of range", until)
    edge = halved(persists, value, points[-1].value, scan.tolerance)
    # If smooth sliding becomes stable where the cycle decays, the cycle has shrunk into
    # smooth sliding.
    gone = points[-1].verdict.linearly_unstable and not failed.verdict.linearly_unstable
    kind: EdgeKind = "shrinks to nothing" if gone else "fold"
    if abs(math.log(edge[0] / edge[1])) > scan.tolerance:
        kind = "undecided"
    return points, Edge.of(kind, *edge)
