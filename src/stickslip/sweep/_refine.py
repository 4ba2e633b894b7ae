"""Find where a category changes in a plane, with far fewer runs than a grid:
explore, find, polish.
"""

import itertools
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial import Delaunay

from stickslip.errors import InputError, number, whole
from stickslip.loops import HALVINGS, bounded
from stickslip.sweep._cases import AxisValue, case_key
from stickslip.sweep._run import Runner

# a place in the box, as fractions of the way along its two axes
Point = tuple[float, float]
Line = tuple[Point, Point]

EXPLORE, FIND, TOGETHER = 0.25, 0.55, 0.05
"""Fractions of the runs after which exploring ends (evenly over the box), and finding
(where categories differ); and fraction that is run at a time, on which the result
depends.
"""
GOLDEN = 0.5 * math.sqrt(5.0) - 0.5
"""A step round a circle whose multiples lie apart from one another: items taken in
this order are spread evenly.
"""


@dataclass(frozen=True, kw_only=True)
class Span:
    """An axis of the box that is searched, between its ends."""

    low: float
    high: float
    log: bool = False  #: whether equal ratios count as equal distances

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", number("Span.low", self.low))
        object.__setattr__(self, "high", number("Span.high", self.high, above=self.low))
        if self.log:
            number("Span.low", self.low, above=0, hint="an axis of equal ratios")

    def value(self, fraction: float) -> float:
        """Return the value at a fraction of the way from `low` (0) to `high` (1)."""
        if self.log:
            return float(self.low * (self.high / self.low) ** fraction)
        return self.low + (self.high - self.low) * fraction


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """Settings of a search for the boundaries between regions of a plane, in each of
    which all cases have the same category.

    A quarter of the runs is distributed over the plane, the next go where categories
    differ, the last bisect lines across the boundary. A region that all of the first
    quarter miss is not found. With hysteresis, search for each branch, with cases that
    start on it: every combination of the values of the other axes gets a search of its
    own.

    Examples
    --------
    >>> from stickslip.sweep import NamedStudy, Refinement, Span, run_study
    >>> def side(x, y, seed):
    ...     return {"side": "above" if y > 0.3 + 0.4 * x else "below"}
    >>> study = NamedStudy(run=side, name="sides of a line", version="1")
    >>> plane = {"x": Span(low=0, high=1), "y": Span(low=0, high=1)}
    >>> found = run_study(study, plane, refinement=Refinement(runs=60, label="side"))
    >>> bool((abs(found["y_at"] - 0.3 - 0.4 * found["x_at"]) < 0.03).all())
    True
    """

    runs: int = 160  #: to spend on a search at most; at least 16
    #: lines across the boundary are bisected until they are this short; 1 is the whole
    #: box
    resolution: float = 1 / 40
    #: name under which a case returns its category, a text or a number
    label: str = "regime"

    def __post_init__(self) -> None:
        whole("refine.runs", self.runs, at_least=16)
        number("refine.resolution", self.resolution, above=0, below=1)


def spans_of(axes: Mapping[str, Any], refinement: Refinement | None) -> dict[str, Span]:
    """Axes that are searched; `InputError` if these are not two of a search, or some
    of a grid.
    """
    spans = {name: axis for name, axis in axes.items() if isinstance(axis, Span)}
    if refinement is None and spans:
        raise InputError(
            f"axes.{next(iter(spans))}.count: is missing, the number of values from "
            "one end to the other"
        )
    if refinement is not None and len(spans) != 2:
        raise InputError(
            "axes: [refine] searches the plane of two parameters: give from, to and "
            "spacing of two, without count (in "
            "Python a Span), and lists of the others"
        )
    return spans


def search(
    runner: Runner,
    spans: Mapping[str, Span],
    each: Iterable[Mapping[str, AxisValue]],
    how: Refinement,
) -> dict[str, list[Any]]:
    """Search in a plane, for each set of values of the other axes; return all cases,
    and which pairs are crossings.
    """
    searches = [_Search(runner, spans, fixed, how) for fixed in each]
    lines = [
        [search.key(end) for end in line]
        for search in searches
        for line in search.boundary()
    ]
    cases = [search.key(point) for search in searches for point in search.seen]
    place = {key: i for i, key in enumerate(cases)}
    return {
        "cases": cases,
        "crossings": [[place[end] for end in line] for line in lines],
    }


@dataclass
class _Search:
    """A search, with the category found at each of its runs so far; None where the
    case failed.
    """

    runner: Runner
    spans: Mapping[str, Span]
    fixed: Mapping[str, AxisValue]
    how: Refinement
    seen: dict[Point, Any] = field(default_factory=dict)

    def key(self, point: Point) -> str:
        """Return the key of the case at a point."""
        here = {
            name: span.value(part)
            for (name, span), part in zip(self.spans.items(), point, strict=True)
        }
        return case_key({**here, **self.fixed})

    def boundary(self) -> list[Line]:
        """Spread runs over the box, send some where categories differ, then bisect
        lines across the boundary.
        """
        seen = self.seen
        how = self.how
        find = math.ceil(FIND * self.how.runs)
        self._run_at([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)])
        turns = bounded("Refined.boundary: spreading", find)
        while len(seen) < find:
            next(turns)
            middles = [
                *dict.fromkeys(
                    map(_middle, self._sides(exploring=len(seen) < EXPLORE * how.runs))
                )
            ]
            self._run_at(
                middles[: min(math.ceil(TOGETHER * how.runs), find - len(seen))]
            )
        lines = self._crossings(how.runs - len(seen))
        turns = bounded("Refined.boundary: bisection", HALVINGS)
        while long := [
            i
            for i, line in enumerate(lines)
            if math.dist(*line) > how.resolution
            and seen.get(_middle(line), 0) is not None
        ]:
            next(turns)
            self._run_at([_middle(lines[i]) for i in long])
            for i in long:
                low, high = lines[i]
                middle = _middle(lines[i])
                if seen[middle] is not None:  # else no further here
                    lines[i] = (
                        (middle, high) if seen[middle] == seen[low] else (low, middle)
                    )
        return lines

    def _run_at(self, points: Sequence[Point]) -> None:
        """Run the cases at these points, and keep the category of each."""
        cases = {point: self.key(point) for point in points if point not in self.seen}
        self.runner.run(list(dict.fromkeys(cases.values())))
        for point, key in cases.items():
            row = json.loads(self.runner.table.rows[key])
            if self.how.label not in row.get("result", self.how.label):
                raise InputError(
                    f"label = {self.how.label!r}: is none of the names under which the "
                    "function returns"
                )
            self.seen[point] = (
                row["result"][self.how.label] if "result" in row else None
            )

    def _sides(self, *, exploring: bool) -> list[Line]:
        """Return the longest side of each triangle between the runs, longest first;
        later, between categories first.
        """
        sizes = []
        for corners in _triangles(self.seen):
            longest = max(
                itertools.combinations(corners, 2), key=lambda side: math.dist(*side)
            )
            found = {self.seen[corner] for corner in corners}
            size = math.dist(*longest)
            # A case that failed says nothing about categories: its triangles are not
            # looked into.
            mixed = len(found) > 1 and None not in found
            sizes.append((size if exploring or mixed else 0.1 * size**2, longest))
        return [side for _, side in sorted(sizes, reverse=True)]

    def _crossings(self, budget: int) -> list[Line]:
        """Return sides of triangles whose ends are in different categories, as many
        as the budget of runs can bisect.
        """
        triangles = _triangles(
            point for point, found in self.seen.items() if found is not None
        )
        sides = sorted(
            {
                side
                for corners in triangles
                for side in itertools.combinations(corners, 2)
            }
        )
        lines = [
            (low, high) for low, high in sides if self.seen[low] != self.seen[high]
        ]
        lines = [lines[i] for i in np.argsort(np.arange(len(lines)) * GOLDEN % 1.0)]
        runs = [
            max(0, math.ceil(math.log2(math.dist(*line) / self.how.resolution)))
            for line in lines
        ]
        return [
            line
            for line, spent in zip(lines, itertools.accumulate(runs), strict=True)
            if spent <= budget
        ]


def _middle(line: Line) -> Point:
    (a, b), (c, d) = line
    return (a + c) / 2, (b + d) / 2


def _triangles(points: Iterable[Point]) -> list[list[Point]]:
    """Return the triangles between points (Delaunay), the corners of each in order;
    none between fewer than three.
    """
    listed = list(points)
    found = Delaunay(listed).simplices.tolist() if len(listed) > 2 else []
    return [sorted(listed[i] for i in corners) for corners in found]
