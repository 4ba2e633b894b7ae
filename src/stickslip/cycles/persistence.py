"""Where an oscillation persists along a parameter, afresh from the same start at each value."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from stickslip.answers import Answer
from stickslip.cycles.branch import Point
from stickslip.cycles.edges import Edge, Interval, halved, scaled
from stickslip.cycles.fold import FINEST, held_fold
from stickslip.cycles.ride import METHOD, Range
from stickslip.cycles.verdict import Verdict, settle
from stickslip.errors import UndecidedError, number
from stickslip.model import FromRest, MasterEquation, Start
from stickslip.model.parameters import DELAY, Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.stability import critical


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
        doubt = _doubt(f"{value:.4g}" for value in self.undecided)
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
    tolerance: float = FINEST,
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
        Relative width of the bracket about an edge. Down to .3 % the fold of the cycle is looked for first, and
        the bracket lies about it if the start still leads to the cycle there.
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
    probe = _Probe(span)
    count = max(2, math.ceil(points * math.log10(span.high / span.low)) + 1)
    values = np.geomspace(span.low, span.high, count).tolist()
    values[0], values[-1] = span.low, span.high
    grid = tuple((value, probe(value)) for value in values)
    found = Sustained(
        parameter=span.parameter.name,
        unit=span.parameter.unit,
        searched=(span.low, span.high),
        start=start,
        windows=_windows(probe, [(value, verdict.sustained) for value, verdict in grid], tolerance),
        grid=grid,
        undecided=probe.undecided,
    )
    return found.in_units(rig)


def _windows(probe: _Probe, grid: list[tuple[float, bool | None]], tolerance: float) -> tuple[Interval, ...]:
    """Windows between the edges that lie between decided values of the grid."""
    decided = [(value, bool(persists)) for value, persists in grid if persists is not None]
    if not decided:
        return ()
    edges = []
    if decided[0][1]:
        edges.append(Edge.at(decided[0][0], "end of range"))
    for (one, before), (two, after) in itertools.pairwise(decided):
        if before != after:
            decays_at, persists_at = (two, one) if before else (one, two)
            edges.append(_edge(probe, decays_at, persists_at, tolerance))
    if decided[-1][1]:
        edges.append(Edge.at(decided[-1][0], "end of range"))
    return tuple(Interval(low=low, high=high) for low, high in zip(edges[::2], edges[1::2], strict=True))


def _edge(probe: _Probe, decays_at: float, persists_at: float, tolerance: float) -> Edge:
    """Where the oscillation ends: at the fold of its cycle if the start still leads to it there, else by halving."""
    fold = probe.fold(decays_at, persists_at, tolerance)
    if fold is not None:
        if probe.persists(fold.persists_at):
            return Edge.between(fold.decays_at, fold.persists_at)
        if probe.persists(fold.persists_at) is False:
            decays_at = fold.persists_at
    return halved(probe.persists, decays_at, persists_at, tolerance)


@dataclass(frozen=True, kw_only=True, repr=False)
class SustainedOnset(Answer):
    """The smallest value of a parameter with which an oscillation is sustained from a start (nonlinear).

    Attributes
    ----------
    parameter : str
    edge : Edge
        The value and its bracket, in the rig's own units.
    start : FromRest or FromSliding
    linear : float or None
        The linear onset beside it: where smooth sliding itself becomes unstable; None if it does not in the
        range.
    searched : (float, float)
    verdict : Verdict
        Of the run on that side of the edge where the oscillation persists.
    """

    parameter: str
    edge: Edge
    start: Start
    linear: float | None
    searched: tuple[float, float]
    verdict: Verdict

    @property
    def value(self) -> float:
        """The value, in the middle of its bracket."""
        return self.edge.value

    def in_units(self, rig: Rig) -> SustainedOnset:
        """Return what was found in natural units in those of a rig."""
        size = rig.unit(parameter_named(self.parameter).unit)
        return replace(
            self,
            edge=self.edge.scaled(size),
            linear=None if self.linear is None else self.linear * size,
            searched=scaled(self.searched, size),
            verdict=self.verdict.in_units(rig),
        )

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        linear = "none in the range" if self.linear is None else f"{self.linear:.6g}"
        return (
            f"{self.parameter} {self.value:.4g} (nonlinear: from {self.start} an oscillation decays at "
            f"{self.edge.decays_at:.4g} and persists at {self.edge.persists_at:.4g}); linear onset: {linear}"
        )


def sustained_onset(
    rig: Rig,
    parameter: Parameter | str = DELAY,
    *,
    between: tuple[float, float],
    start: Start = FromRest(),
    tolerance: float = 2e-3,
    method: MasterEquation = METHOD,
) -> SustainedOnset:
    """Return the smallest value of a parameter with which stick-slip is sustained from a given start (nonlinear).

    Along the delay this is the paper's critical delay ``tau*``. Not the linear one of `stickslip.stability.onset`, at
    which smooth sliding itself becomes unstable; that is given beside it. Values are tried upwards in steps of 1.4,
    then the edge is halved.

    Parameters
    ----------
    rig : Rig
        A `RandomDelay` is scaled as a whole, and the answer is its mean; the present value does not matter otherwise.
    parameter : Parameter or str
    between : (float, float)
        Range searched, in the rig's own units.
    start : FromRest or FromSliding
        The paper's is `FromRest`, with a narrow distribution of initial stretchings.
    tolerance : float
        Relative width of the bracket.
    method : MasterEquation

    Returns
    -------
    SustainedOnset
        In the rig's own units.

    Raises
    ------
    UndecidedError
        If no oscillation persists in the range, or one persists at its lower end already, or the runs cannot tell; the
        message gives the range and the evidence.

    Examples
    --------
    >>> import stickslip as ss
    >>> from stickslip.cycles import sustained_onset
    >>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), initial=ss.Gaussian(mean=0.0, std=0.01))
    >>> rig = ss.Rig(interface, ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4), ss.constant(velocity=1.0))
    >>> onset = sustained_onset(rig, "delay", between=(0.06, 0.2), tolerance=0.01)
    >>> round(onset.value, 3), round(onset.linear, 3)
    (0.076, 0.138)
    """
    span = Range.of(rig, parameter, between, start, method)
    tolerance = number("tolerance", tolerance, above=0, below=1)
    crossings = critical(span.rig, span.parameter, between=(span.low, span.high))
    linear = next((c.value for c in crossings.edges if c.loses_stability), None)
    if linear is not None:
        span = replace(span, high=min(span.high, 1.01 * linear))
    probe = _Probe(span)
    edge = _edge(probe, *_bracket(probe), tolerance)
    found = SustainedOnset(
        parameter=span.parameter.name,
        edge=edge,
        start=start,
        linear=linear,
        searched=(span.low, span.high),
        verdict=probe(edge.persists_at),
    )
    return found.in_units(rig)


def _bracket(probe: _Probe) -> tuple[float, float]:
    """Go up from the low end: where the oscillation still decays, and the first value at which it persists."""
    span, decays_at = probe.span, None
    value, verdict = span.low, probe(span.low)
    while not verdict.sustained:
        if verdict.sustained is False:
            decays_at = value
        if value >= span.high:
            raise UndecidedError(
                f"no sustained onset: from {span.start} no oscillation persists for {span} (at the last: {verdict})"
                f"{_doubt(map(span.said, probe.undecided))}"
            )
        value = min(1.4 * value, span.high)
        verdict = probe(value)
    if decays_at is None:
        raise UndecidedError(
            f"no sustained onset: at {span.said(value)}, the low end of the range searched (to "
            f"{span.said(span.high)}), an oscillation persists ({verdict}); lower it"
        )
    return decays_at, value


def _doubt(undecided: Iterable[str]) -> str:
    said = ", ".join(undecided)
    return f"; undecided at {said}" if said else ""


class _Probe:
    """Runs along a parameter, each afresh from the start, remembered."""

    def __init__(self, span: Range) -> None:
        self.span = span
        self._known: dict[float, Point] = {}

    def _at(self, value: float) -> Point:
        if value not in self._known:
            verdict, ride, look = settle(self.span.begin(value))
            self._known[value] = Point(value, verdict, look, ride)
        return self._known[value]

    def __call__(self, value: float) -> Verdict:
        return self._at(value).verdict

    def persists(self, value: float) -> bool | None:
        """Whether an oscillation does."""
        return self(value).sustained

    def fold(self, decays_at: float, persists_at: float, tolerance: float) -> Edge | None:
        """Fold of the cycle that persists at one value, on the way to another; None if there is none."""
        point = self._at(persists_at)
        return held_fold(self.span.parameter, point.ride, persists_at, point.look.period, decays_at, tolerance)

    @property
    def undecided(self) -> tuple[float, ...]:
        """Values at which a run could not tell, rising."""
        return tuple(sorted(value for value, point in self._known.items() if point.verdict.sustained is None))
