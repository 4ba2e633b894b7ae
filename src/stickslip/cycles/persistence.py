"""Where an oscillation persists along a parameter, afresh from the same start at each value."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from stickslip.answers import Answer
from stickslip.cycles.edges import TOLERANCE, Edge, Interval, halved, scaled
from stickslip.cycles.ride import METHOD, Range
from stickslip.cycles.verdict import Verdict, settle
from stickslip.errors import number
from stickslip.model import FromRest, MasterEquation, Start
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig


@dataclass(frozen=True, kw_only=True, repr=False)
class Sustained(Answer):
    """Where an oscillation persists along a parameter, afresh from the same start at each value; nowhere is an answer.

    Attributes
    ----------
    parameter, unit : str
    searched : (float, float)
    start : FromRest or FromSliding
    windows : tuple of Interval
        Rising. Windows narrower than the grid of the search may be missed.
    grid : tuple of (float, Verdict)
        The runs of the grid.
    undecided : tuple of float
        Values at which a run could not tell.
    """

    parameter: str
    unit: str
    searched: tuple[float, float]
    start: Start
    windows: tuple[Interval, ...]
    grid: tuple[tuple[float, Verdict], ...]
    undecided: tuple[float, ...] = ()

    def in_units(self, rig: Rig) -> Sustained:
        """Return what was found in natural units in those of a rig."""
        size = rig.unit(self.unit)
        return replace(
            self,
            unit=rig.unit_name(self.unit),
            searched=scaled(self.searched, size),
            windows=tuple(window.scaled(size) for window in self.windows),
            grid=tuple((value * size, verdict.in_units(rig)) for value, verdict in self.grid),
            undecided=tuple(value * size for value in self.undecided),
        )

    def __iter__(self) -> Iterator[Interval]:
        return iter(self.windows)

    def __len__(self) -> int:
        return len(self.windows)

    def __str__(self) -> str:
        low, high = self.searched
        where = f"for {self.parameter} from {low:g} to {high:g} {self.unit}, from {self.start}"
        doubt = f"; undecided at {', '.join(f'{value:.4g}' for value in self.undecided)}" if self.undecided else ""
        if not self.windows:
            return f"no oscillation persists {where} ({len(self.grid)} runs){doubt}"
        return f"{where}, an oscillation persists {' and '.join(map(str, self.windows))}{doubt}"


def sustained(
    rig: Rig,
    parameter: Parameter | str,
    *,
    between: tuple[float, float],
    start: Start = FromRest(),
    points: int = 8,
    tolerance: float = TOLERANCE,
    method: MasterEquation = METHOD,
) -> Sustained:
    """Find where an oscillation persists along a parameter, afresh from the same start at each value (nonlinear).

    From a narrow start the lower edge along the velocity is where stick-slip decays on the way down, the paper's
    ``v1'``, and the upper edge where it decays on the way up, ``v2``; the velocities at which smooth sliding loses
    stability (``v1``, and ``v2'`` on the way down) are linear: `stickslip.stability.critical`.

    Parameters
    ----------
    rig : Rig
        The parameter's own value in it does not matter.
    parameter : Parameter or str
        As in `stickslip.stability.critical`.
    between : (float, float)
        Range searched, in the rig's own units, both above 0.
    start : FromRest or FromSliding
    points : int
        Runs per factor of 10, on a logarithmic grid; edges between two of them are found by halving.
    tolerance : float
        Relative width of the bracket about an edge.
    method : MasterEquation

    Returns
    -------
    Sustained
        In the rig's own units.

    Raises
    ------
    InputError
        If no cycle can be followed on the rig, or the parameter or the range is none.

    Examples
    --------
    >>> import stickslip as ss
    >>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
    >>> rig = ss.Rig(interface, ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4), ss.constant(velocity=1.0))
    >>> (window,) = ss.sustained(rig, "velocity", between=(0.6, 0.9), points=6, tolerance=0.01)
    >>> window.low.kind, round(window.low.value, 1)
    ('decay', 0.7)
    """
    span = Range.of(rig, parameter, between, start, method)
    tolerance = number("tolerance", tolerance, above=0, below=1)
    known: dict[float, Verdict] = {}

    def persists(value: float) -> bool | None:
        if value not in known:
            known[value] = settle(span.begin(value))[0]
        return known[value].sustained

    count = max(2, math.ceil(points * math.log10(span.high / span.low)) + 1)
    values = np.geomspace(span.low, span.high, count).tolist()
    values[0], values[-1] = span.low, span.high
    told = [(value, persists(value)) for value in values]
    windows = _windows(persists, told, tolerance)
    found = Sustained(
        parameter=span.parameter.name,
        unit=span.parameter.unit,
        searched=(span.low, span.high),
        start=start,
        windows=windows,
        grid=tuple((value, known[value]) for value in values),
        undecided=tuple(sorted(value for value, verdict in known.items() if verdict.sustained is None)),
    )
    return found.in_units(rig)


def _windows(
    persists: Callable[[float], bool | None], grid: list[tuple[float, bool | None]], tolerance: float
) -> tuple[Interval, ...]:
    """Windows between the edges that lie between decided values of the grid."""
    decided = [(value, answer) for value, answer in grid if answer is not None]
    edges = []
    if decided and decided[0][1]:
        edges.append(Edge.at(decided[0][0], "end of range"))
    for (one, before), (two, after) in itertools.pairwise(decided):
        if before != after:
            decays_at, persists_at = (two, one) if before else (one, two)
            edges.append(halved(persists, decays_at, persists_at, tolerance))
    if decided and decided[-1][1]:
        edges.append(Edge.at(decided[-1][0], "end of range"))
    return tuple(Interval(low=low, high=high) for low, high in zip(edges[::2], edges[1::2], strict=True))
