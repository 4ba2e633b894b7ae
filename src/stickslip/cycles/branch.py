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
    >>> branch = ss.cycle_branch(rig, "velocity", between=(0.6, 1.0), step=0.2, tolerance=0.01)
    >>> branch.low_end, branch.high_end
    ('fold', 'end of range')
    """
    span = Range.of(rig, parameter, between, start, method)
    size = rig.unit(span.parameter.unit)
    first = first_point(span, None if begin is None else number("begin", begin, above=0) / size)
    down, low = carried(span.parameter, first, span.low, step, tolerance)
    up, high = carried(span.parameter, first, span.high, step, tolerance)
    branch = _dataset(span, [*reversed(down), first, *up])
    for name, edge in (("low", low), ("high", high)):
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

    Raises
    ------
    UndecidedError
        If there is none.
    """
    low, high, unit = span.low, span.high, span.parameter.unit
    if begin is not None:
        values = [number("begin", begin, at_least=low, at_most=high, hint=unit)]
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
        f"{', '.join(f'{v:.4g}' for v in values)}; the last: {verdict}"
    )


def carried(
    parameter: Parameter, first: Point, until: float, step: float, tolerance: float
) -> tuple[list[Point], Edge]:
    """Carry the cycle on towards a value; the points, and the end of the branch.

    Next to a fold a motion takes long to show whether it decays. Once the law of the fold tells where it lies, to the
    tolerance, it is the bracket; a run beyond it has decayed.
    """
    points: list[Point] = []
    here = first
    way = 1.0 if until > first.value else -1.0
    stride = largest = math.log1p(number("step", step, above=0, below=1))
    decays_at: float | None = None
    unstable_beyond: bool | None = None
    while abs(math.log(until / here.value)) > 1e-12:
        law = _fold([first, *points], way)
        value = here.value * math.exp(way * stride)
        if decays_at is None and law is not None and way * (value - law.value) > 0:
            value = law.value * math.exp(way * largest)  # well beyond the fold the cycle decays soon
        if way * (value - until) > -1e-12 * until:
            value = until
        verdict, ride, look = settle(here.ride.turned(parameter.set(here.ride.rig, value)))
        if verdict.has_cycle:
            here = Point(value, verdict, look, ride)
            points.append(here)
            if decays_at is not None:
                stride = 0.5 * abs(math.log(decays_at / value))
        elif verdict.sustained is False:
            decays_at, unstable_beyond = value, verdict.linearly_unstable
            stride = 0.5 * abs(math.log(decays_at / here.value))
        else:
            return points, Edge.between(value if decays_at is None else decays_at, here.value, "undecided")
        if decays_at is None:
            stride = min(stride, largest)
            continue
        # Where smooth sliding turns stable just as the cycle decays, the one has become the other.
        gone = here.verdict.linearly_unstable and not unstable_beyond
        if abs(math.log(decays_at / here.value)) <= tolerance:
            return points, Edge.between(decays_at, here.value, "shrinks to nothing" if gone else "fold")
        law = None if gone else _fold([first, *points], way)
        if law is not None and way * (law.value - decays_at) < 0:
            if law.error <= 0.5 * tolerance:
                apart = math.exp(way * max(law.error, 0.1 * tolerance))
                return points, Edge.between(law.value * apart, law.value / apart, "fold")
            stride = _ON * abs(math.log(law.value / here.value))
    return points, Edge.at(here.value, "end of range")


class _Fold(NamedTuple):
    """Where a fold lies by its law, and the relative error of that."""

    value: float
    error: float


def _fold(points: list[Point], way: float) -> _Fold | None:
    """Where the branch turns back: the parameter is a polynomial in the amplitude there, with an end; None if not.

    Through four points it is of third order; how far that takes the end from where the last three have it is the error.
    """
    if len(points) < 4:
        return None
    last = points[-4:]
    size, place = (
        np.array(column) for column in zip(*((p.look.amplitude, way * math.log(p.value)) for p in last), strict=True)
    )
    towards = math.copysign(1.0, size[-1] - size[-2])
    ends = []
    for count in (3, 4):
        if np.ptp(size[-count:]) == 0.0:
            return None
        law = np.polynomial.Polynomial.fit(size[-count:], place[-count:], count - 1)
        turns = [float(z.real) for z in law.deriv().roots() if abs(z.imag) < 1e-9 and towards * (z.real - size[-1]) > 0]
        if not turns:
            return None
        ends.append(float(law(min(turns, key=lambda a: abs(a - size[-1])))))
    if min(ends) < place[-1]:
        return None
    return _Fold(math.exp(way * ends[1]), abs(ends[1] - ends[0]))


_ON = 0.7
"""How much of the way to a fold is taken at once."""
