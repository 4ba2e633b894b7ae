"""The ranges of a parameter in which an oscillation persists, from the same start at
each value.
"""

import itertools
import math
from dataclasses import dataclass

from stickslip.cycles.edges import (
    TOLERANCE,
    Edge,
    Interval,
    Intervals,
    ParameterScan,
    halved,
)
from stickslip.cycles.oscillation_verdict import Verdict
from stickslip.errors import whole
from stickslip.model import FromRest, Start
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig

_MOST_POINTS = 10_000  # most runs per factor of 10, which take too long already


@dataclass(frozen=True, kw_only=True, repr=False)
class Sustained(Intervals):
    """Ranges of a parameter in which an oscillation persists, from the same start at
    each value; an empty result is also an answer.
    """

    _items = "windows"

    start: Start  #: start of every run
    #: in increasing order; windows narrower than the grid of the search may be missed
    windows: tuple[Interval, ...]
    grid: tuple[tuple[float, Verdict], ...]  #: the runs on the grid
    undecided: tuple[float, ...] = ()  #: values at which a run did not decide

    def __str__(self) -> str:
        doubt = (
            f"; undecided at {', '.join(f'{value:.4g}' for value in self.undecided)}"
            if self.undecided
            else ""
        )
        if not self.windows:
            return (
                f"no oscillation persists {self.where}, from {self.start} "
                f"({len(self.grid)} runs){doubt}"
            )
        return (
            f"{self.where}, from {self.start}, an oscillation persists "
            f"{' and '.join(map(str, self))}{doubt}"
        )


def sustained(
    rig: Rig,
    parameter: Parameter | str,
    *,
    between: tuple[float, float],
    start: Start = FromRest(),
    points: int = 8,
    tolerance: float = TOLERANCE,
) -> Sustained:
    """Find the ranges of a parameter in which an oscillation persists, from the same
    start at each value (nonlinear).

    From a narrow start the lower edge along the velocity is where stick-slip decays on
    the way down, the paper's ``v1'``, and the upper edge is where it decays on the way
    up, ``v2``; the velocities at which smooth sliding loses stability (``v1``, and
    ``v2'`` on the way down) are linear: `stickslip.stability.critical`.

    Parameters
    ----------
    rig : Rig
        The rig; its own value of the parameter does not matter.
    parameter : Parameter or str
        As in `stickslip.stability.critical`.
    between : (float, float)
        Range searched, in the rig's own units, both above 0.
    start : FromRest or FromSliding
    points : int
        Runs per factor of 10, on a logarithmic grid; edges between two of them are
        found by bisection.
    tolerance : float
        Relative width of the bracket about an edge.

    Returns
    -------
    Sustained
        In the rig's own units.

    Raises
    ------
    InputError
        If no cycle can be followed on the rig, or the parameter or the range is
        invalid.

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
    >>> (window,) = ss.sustained(
    ...     rig, "velocity", between=(0.6, 0.9), points=6, tolerance=0.01
    ... )
    >>> window.low.kind, round(window.low.value, 1)
    ('decay', 0.7)
    """
    points = whole("points", points, at_least=1, at_most=_MOST_POINTS)
    scan = ParameterScan(rig, parameter, between, start, tolerance=tolerance)
    known: dict[float, Verdict] = {}

    def persists(value: float) -> bool | None:
        if value not in known:
            known[value] = scan.settled(value).verdict
        return known[value].sustained

    values = scan.grid(math.ceil(points * math.log10(scan.high / scan.low)) + 1)
    scan.check_work(len(values))
    decided = [value for value in values if persists(value) is not None]
    edges = [Edge.of("end of range", value) for value in decided[:1] if persists(value)]
    for one, two in itertools.pairwise(decided):
        if persists(one) != persists(two):
            fails_at, holds_at = (two, one) if persists(one) else (one, two)
            edges.append(
                Edge.of("decay", *halved(persists, fails_at, holds_at, scan.tolerance))
            )
    last = decided[-1:]
    edges += [Edge.of("end of range", value) for value in last if persists(value)]
    return Sustained(
        **scan.about,
        start=start,
        windows=tuple(
            Interval(low=low, high=high)
            for low, high in zip(edges[::2], edges[1::2], strict=True)
        ),
        grid=tuple((value, known[value]) for value in values),
        undecided=tuple(
            sorted(
                value for value, verdict in known.items() if verdict.sustained is None
            )
        ),
    )
