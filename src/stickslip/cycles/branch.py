"""The cycle of stick-slip, followed along a parameter up to where its branch ends."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.cycles.edges import Edge
from stickslip.cycles.ride import METHOD, Look, Range, Ride
from stickslip.cycles.verdict import Verdict, settle
from stickslip.errors import UndecidedError, number
from stickslip.io import datasets as store
from stickslip.model import FromRest, MasterEquation, Start
from stickslip.model.parameters import VELOCITY, Parameter
from stickslip.model.rig import Rig
from stickslip.simulation import labelled

if TYPE_CHECKING:
    import xarray as xr


class Point(NamedTuple):
    """The settled cycle at one value of a parameter."""

    value: float
    verdict: Verdict
    look: Look
    ride: Ride


def cycle_branch(
    rig: Rig,
    parameter: Parameter | str = VELOCITY,
    *,
    between: tuple[float, float],
    begin: float | None = None,
    start: Start = FromRest(),
    step: float = 0.05,
    tolerance: float = 2e-3,
    method: MasterEquation = METHOD,
) -> xr.Dataset:
    """Follow the cycle of stick-slip in a parameter, both ways, up to where it decays (nonlinear).

    The motion is carried on from value to value: the parameter is varied by a step, the motion settles again. Where it
    decays the step is halved and taken back, until the end of the branch is known to the tolerance. A cycle of finite
    amplitude ends at a fold, where it meets an unstable cycle; forward runs do not go round it. Lowered slowly, the
    velocity ends at ``v1'``, and raised at ``v2`` if there is one.

    Parameters
    ----------
    rig : Rig
    parameter : Parameter or str
    between : (float, float)
        Range of the parameter, in the rig's own units, both ends above 0.
    begin : float, optional
        Value at which to look for the cycle first, from `start`; by default that of the rig, or, if no
        oscillation persists there, the first at which one does of 17 over the range.
    start : FromRest or FromSliding
    step : float
        Largest change of the parameter at once, as a fraction of it.
    tolerance : float
        Relative width of the bracket about the ends of the branch.
    method : MasterEquation

    Returns
    -------
    xarray.Dataset
        Along the parameter, rising: ``amplitude`` (peak to peak of the spring force), ``period``, ``largest_velocity``
        of the slider, ``mean_force``, and ``linearly_unstable`` (whether smooth sliding is, there). Attributes:
        ``low_end`` and ``high_end`` ("fold", "end of range", "shrinks to nothing" or "undecided"), and the brackets
        ``low_decays_at``, ``low_persists_at``, ``high_decays_at``, ``high_persists_at``.

    Raises
    ------
    UndecidedError
        If no oscillation persists at `begin`, or anywhere that was looked.

    Examples
    --------
    >>> import stickslip as ss
    >>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
    >>> rig = ss.Rig(interface, ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4), ss.constant(velocity=1.0))
    >>> branch = ss.cycles.cycle_branch(rig, "velocity", between=(0.6, 1.0), step=0.2, tolerance=0.01)
    >>> branch.low_end, branch.high_end
    ('fold', 'end of range')
    """
    span = Range.of(rig, parameter, between, start, method)
    size = rig.unit(span.parameter.unit)
    tolerance = number("tolerance", tolerance, above=0, below=1)
    if begin is not None:
        low, high = (value * size for value in (span.low, span.high))
        begin = number("begin", begin, at_least=low, at_most=high, hint=rig.unit_name(span.parameter.unit)) / size
    first = first_point(span, begin)
    down, low_end = carried(span.parameter, first, span.low, step, tolerance)
    up, high_end = carried(span.parameter, first, span.high, step, tolerance)
    branch = _dataset(span, [*reversed(down), first, *up])
    for name, edge in (("low", low_end), ("high", high_end)):
        branch.attrs |= {
            f"{name}_end": edge.kind,
            f"{name}_decays_at": edge.decays_at * size,
            f"{name}_persists_at": edge.persists_at * size,
        }
    return rig.in_its_units(branch)


def _dataset(span: Range, points: list[Point]) -> xr.Dataset:
    import xarray as xr

    along, growing = span.parameter.name, [p.verdict.linearly_unstable for p in points]
    fastest = [p.ride.rig.velocity * p.verdict.largest_velocity for p in points]
    unstable = [math.nan if one is None else float(one) for one in growing]
    arguments = {
        "rig": span.rig,
        "parameter": along,
        "between": [span.low, span.high],
        "start": span.start,
        "method": span.method,
    }
    return xr.Dataset(
        {
            "amplitude": labelled(
                "peak to peak of the spring force, per contact", along, [p.look.amplitude for p in points], "f_s"
            ),
            "period": labelled("period of the cycle", along, [p.look.period for p in points], "time"),
            "largest_velocity": labelled("largest velocity of the slider", along, fastest, "x_s/time"),
            "mean_force": labelled("mean spring force, per contact", along, [p.look.mean_force for p in points], "f_s"),
            "linearly_unstable": labelled("whether smooth sliding is unstable by linear theory", along, unstable, "1"),
        },
        coords={along: labelled(along, along, [p.value for p in points], span.parameter.unit)},
        attrs={"provenance": store.provenance("cycle_branch", arguments)},
    )


def first_point(span: Range, begin: float | None = None) -> Point:
    """Look for a cycle from the start: at a value, or at the rig's own and then over the range from its middle on.

    Raises `UndecidedError` if there is none.
    """
    low, high = span.low, span.high
    if begin is not None:
        values = [begin]
    else:
        own = span.parameter.get(span.rig)
        grid = np.geomspace(low, high, 17).tolist()
        grid[0], grid[-1] = low, high
        values = [own] if low <= own <= high else []
        values += sorted(grid, key=lambda value: abs(math.log(value / math.sqrt(low * high))))
    for value in dict.fromkeys(values):
        verdict, ride, look = settle(span.begin(value))
        if verdict.has_cycle:
            return Point(value, verdict, look, ride)
    raise UndecidedError(
        f"no cycle to follow: from {span.start} no oscillation persists at {span.parameter.name} = "
        f"{', '.join(map(span.said, values))}; the last: {verdict}"
    )


def carried(
    parameter: Parameter, first: Point, until: float, step: float, tolerance: float, *, bold: bool = False
) -> tuple[list[Point], Edge]:
    """Carry the cycle on towards a value; the points, and the end of the branch.

    A bold search, for which the points do not matter, doubles its steps as long as the cycle persists. That it decays
    after such a step is believed only once it does after a short one, too.
    """
    points: list[Point] = []
    here = first
    way = 1.0 if until > first.value else -1.0
    stride = largest = math.log1p(number("step", step, above=0, below=1))
    decays_at: float | None = None
    unstable_beyond: bool | None = None
    believed = True
    while abs(math.log(until / here.value)) > 1e-12:
        value = here.value * math.exp(way * stride)
        if way * (value - until) > -1e-12 * until:
            value = until
        far = abs(math.log(value / here.value)) > 1.001 * largest
        verdict, ride, look = settle(here.ride.turned(parameter.set(here.ride.rig, value)))
        if verdict.has_cycle:
            here = Point(value, verdict, look, ride)
            points.append(here)
            if decays_at is not None:
                stride = 0.5 * abs(math.log(decays_at / value))
            elif bold:
                stride = max(2.0 * stride, largest)
            else:
                stride = min(stride, largest)
        elif verdict.sustained is False:
            decays_at, unstable_beyond, believed = value, verdict.linearly_unstable, not far
            stride = 0.5 * abs(math.log(decays_at / here.value))
        elif far:
            stride = largest
            continue
        else:
            return points, Edge.between(value if decays_at is None else decays_at, here.value, "undecided")
        if decays_at is not None and abs(math.log(decays_at / here.value)) <= tolerance:
            if believed:
                # Where smooth sliding turns stable just as the cycle decays, the one has become the other.
                gone = here.verdict.linearly_unstable and not unstable_beyond
                return points, Edge.between(decays_at, here.value, "shrinks to nothing" if gone else "fold")
            stride, decays_at = abs(math.log(decays_at / here.value)), None
    return points, Edge.at(here.value, "end of range")
