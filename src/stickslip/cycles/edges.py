"""Ends of what is found along a parameter, and the intervals between them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from stickslip.answers import Answer

EdgeKind = Literal["decay", "fold", "linear", "shrinks to nothing", "end of range", "undecided"]

TOLERANCE = 3e-3
"""Relative width of a bracket: runs nearer to a fold linger where the cycle has just ceased to exist."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Edge(Answer):
    """An end of an interval of a parameter.

    Attributes
    ----------
    value : float
        For an edge that runs have bracketed, the (geometric) middle of the bracket.
    kind : {"decay", "fold", "linear", "shrinks to nothing", "end of range", "undecided"}
        *Decay*: beyond it an oscillation from the start decays (nonlinear). *Fold*: the branch of the cycle ends there
        at a finite amplitude (nonlinear). *Linear*: smooth sliding loses stability there. *Shrinks to nothing*: the
        cycle does, where smooth sliding regains stability. *End of range*: the edge lies outside the range searched.
        *Undecided*: runs beyond it cannot tell.
    decays_at, persists_at : float
        The bracket: runs on either side of the edge. Both are `value` if it is not runs that tell.
    """

    value: float
    kind: EdgeKind
    decays_at: float
    persists_at: float

    @classmethod
    def at(cls, value: float, kind: EdgeKind) -> Edge:
        """Return an edge without a bracket."""
        return cls(value=value, kind=kind, decays_at=value, persists_at=value)

    @classmethod
    def between(cls, decays_at: float, persists_at: float, kind: EdgeKind = "decay") -> Edge:
        """Return an edge bracketed by runs."""
        middle = math.sqrt(decays_at * persists_at)
        return cls(value=middle, kind=kind, decays_at=decays_at, persists_at=persists_at)

    @property
    def error(self) -> float:
        """Half the width of the bracket."""
        return 0.5 * abs(self.decays_at - self.persists_at)

    def scaled(self, size: float) -> Edge:
        """Return the edge in a unit that is smaller by a factor."""
        return replace(
            self, value=self.value * size, decays_at=self.decays_at * size, persists_at=self.persists_at * size
        )

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        match self.kind:
            case "decay":
                return f"{self.value:.4g} (± {self.error:.1g})"
            case "fold":
                return f"{self.value:.5g} (stick-slip decays: fold)"
            case "linear":
                return f"{self.value:.5g} (smooth sliding loses stability: linear)"
            case "end of range":
                return f"{self.value:.4g} (end of the range searched)"
        return f"{self.value:.5g} ({self.kind})"


@dataclass(frozen=True, kw_only=True, repr=False)
class Interval(Answer):
    """An interval of a parameter, and what its ends are."""

    low: Edge
    high: Edge

    def __contains__(self, value: float) -> bool:
        return self.low.value <= value <= self.high.value

    def scaled(self, size: float) -> Interval:
        """Return the interval in a unit that is smaller by a factor."""
        return Interval(low=self.low.scaled(size), high=self.high.scaled(size))

    def __str__(self) -> str:
        return f"from {self.low} to {self.high}"


def scaled(values: tuple[float, float], size: float) -> tuple[float, float]:
    """Return a range in a unit that is smaller by a factor."""
    return values[0] * size, values[1] * size


def halved(probe: Callable[[float], bool | None], decays_at: float, persists_at: float, tolerance: float) -> Edge:
    """Halve between a value at which an oscillation decays and one at which it persists, to a relative width.

    Where a run cannot tell, and `probe` returns None, the edge is bracketed as closely as can be.
    """
    doubt: tuple[float, float] | None = None  # the end towards `decays_at`, the end towards `persists_at`
    while True:
        spans = [(decays_at, persists_at)]
        if doubt is not None:
            spans = [(decays_at, doubt[0]), (doubt[1], persists_at)]
        one, two = max(spans, key=lambda span: abs(math.log(span[0] / span[1])))
        if abs(math.log(one / two)) <= tolerance:
            return Edge.between(decays_at, persists_at)
        middle = math.sqrt(one * two)
        answer = probe(middle)
        if answer is False:
            decays_at = middle
        elif answer:
            persists_at = middle
        elif doubt is None:
            doubt = middle, middle
        else:
            doubt = (middle, doubt[1]) if one == decays_at else (doubt[0], middle)
