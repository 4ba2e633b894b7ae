"""Find where a category changes in a plane, with far fewer runs than a grid: explore,
find, polish.
"""

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from scipy.spatial import Delaunay

from stickslip.errors import InputError, number
from stickslip.loops import HALVINGS, bounded
from stickslip.model.records import Number, Record
from stickslip.sweep._cases import AxisValue, case_key
from stickslip.sweep._run import Runner

# a point in the box, as fractions of both axes
Point = tuple[float, float]
Line = tuple[Point, Point]

EXPLORE, FIND, TOGETHER = 0.25, 0.55, 0.05
"""Fractions of the runs at which exploring (evenly over the box) and finding (where
categories differ) end; and the fraction that is run at a time, which affects the
result.
"""
GOLDEN = 0.5 * math.sqrt(5.0) - 0.5
"""Golden step around a circle: its multiples are well spread, so items taken in their
order are, too.
"""


@dataclass(frozen=True, kw_only=True)
class Span(Record):
    """A searched axis of the box, between its ends."""

    low: Annotated[float, Number()]
    high: Annotated[float, Number()]
    log: bool = False  #: whether distances are measured in ratios

    def __post_init__(self) -> None:
        super().__post_init__()
        number("Span.high", self.high, above=self.low)
        if self.log:
            number("Span.low", self.low, above=0, hint="an axis of equal ratios")

    def value(self, fraction: float) -> float:
        """Return the value at a fraction of the axis from `low` (0) to `high` (1)."""
        if self.log:
            return float(self.low * (self.high / self.low) ** fraction)
        return self.low + (self.high - self.low) * fraction


@dataclass(frozen=True, kw_only=True)
class Refinement(Record):
    """Settings of a search for the boundaries between regions of a plane, in each of
    which all cases have the same category.

    A quarter of the runs is spread over the plane, the next ones go where categories
    differ, and the last ones bisect lines across the boundary. A region that all of the
    first quarter miss is not found. With hysteresis, search for each branch, with cases
    that start on it: every combination of the values of the other axes is searched
    separately.

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

    #: largest number of runs of a search; at least 16
    runs: Annotated[int, Number(at_least=16, place="refine.runs")] = 160
    #: length to which lines across the boundary are bisected, as a fraction of the box
    resolution: Annotated[float, Number(above=0, place="refine.resolution")] = 1 / 40
    #: name under which a case returns its category, a text or a number
    label: str = "regime"

    def __post_init__(self) -> None:
        super().__post_init__()
        number("refine.resolution", self.resolution, below=1)


def spans_of(axes: Mapping[str, Any], refinement: Refinement | None) -> dict[str, Span]:
    """Return the axes that are searched; `InputError` if these are not two with a
    refinement, and none without.
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


def cases_of(axes: Mapping[str, Any], refinement: Refinement | None) -> int:
    """Number of cases of a sweep; with a refinement, the largest number."""
    sizes = (len(axis) for axis in axes.values() if not isinstance(axis, Span))
    return math.prod(sizes) * (refinement.runs if refinement else 1)


def search(
    runner: Runner,
    spans: Mapping[str, Span],
    each: Iterable[Mapping[str, AxisValue]],
    how: Refinement,
) -> dict[str, list[Any]]:
    """Search in a plane for each set of values of the other axes; return all cases, and
    the pairs of cases that are crossings.
    """
    cases: list[str] = []
    crossings: list[list[int]] = []
    for fixed in each:
        one = _Search(runner, spans, fixed, how)
        lines = one.boundary()
        place = {point: i for i, point in enumerate(one.seen, start=len(cases))}
        cases += map(one.key, one.seen)
        crossings += [[place[end] for end in line] for line in lines]
    return {"cases": cases, "crossings": crossings}


@dataclass
class _Search:
    """A search, with the category found in each of its runs so far; None where the case
    failed.
    """

    runner: Runner
    spans: Mapping[str, Span]
    fixed: Mapping[str, AxisValue]
    how: Refinement
    seen: dict[Point, Any] = field(default_factory=dict)

    def key(self, point: Point) -> str:
        """Return the key of the case at a point."""
        values = map(Span.value, self.spans.values(), point)
        return case_key(
            {
                **dict(zip(self.spans, values, strict=True)),
                **self.fixed,
            }
        )

    def boundary(self) -> list[Line]:
        """Spread runs over the box, then where categories differ, then bisect lines
        across the boundary.
        """
        runs = self.how.runs
        find = math.ceil(FIND * runs)
        self._run_at([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)])
        turns = bounded("Refined.boundary: spreading", find)
        while (left := find - len(self.seen)) > 0:
            next(turns)
            middles = dict.fromkeys(map(_middle, self._sides()))
            together = min(math.ceil(TOGETHER * runs), left)
            self._run_at(itertools.islice(middles, together))
        return self._bisected(self._crossings(runs - len(self.seen)))

    def _run_at(self, points: Iterable[Point]) -> None:
        """Run the cases at these points, and store the category of each."""
        label = self.how.label
        cases = {point: self.key(point) for point in points if point not in self.seen}
        self.runner.run([*dict.fromkeys(cases.values())])
        for point, key in cases.items():
            result = self.runner.table.row(key).get("result")
            if result is not None and label not in result:
                raise InputError(
                    f"label = {label!r}: is not one of the names of the "
                    "function's results"
                )
            self.seen[point] = result and result[label]

    def _sides(self) -> list[Line]:
        """Return the longest side of each triangle between the runs, longest first;
        after exploring, those with different categories first.
        """
        exploring = len(self.seen) < EXPLORE * self.how.runs
        sizes = []
        for corners in _triangles(self.seen):
            longest = max(itertools.combinations(corners, 2), key=_length)
            found = {self.seen[corner] for corner in corners}
            size = _length(longest)
            # A failed case has no category: its triangles are not refined.
            mixed = len(found) > 1 and None not in found
            sizes.append(
                (
                    size if exploring or mixed else 0.1 * size**2,
                    longest,
                )
            )
        return [side for _, side in sorted(sizes, reverse=True)]

    def _crossings(self, budget: int) -> list[Line]:
        """Return sides of triangles whose ends have different categories, as many as
        the remaining runs can bisect.
        """
        known = [point for point, found in self.seen.items() if found is not None]
        sides = {
            side
            for corners in _triangles(known)
            for side in itertools.combinations(corners, 2)
        }
        lines = sorted(side for side in sides if len({*map(self.seen.get, side)}) > 1)
        kept = []
        for i in np.argsort(np.arange(len(lines)) * GOLDEN % 1.0):
            halvings = math.ceil(math.log2(_length(lines[i]) / self.how.resolution))
            budget -= max(0, halvings)
            if budget >= 0:
                kept.append(lines[i])
        return kept

    def _bisected(self, lines: list[Line]) -> list[Line]:
        """Bisect lines across the boundary until they are short, or their middle
        fails.
        """
        turns = bounded("Refined.boundary: bisection", HALVINGS)
        while long := [
            i
            for i, line in enumerate(lines)
            if _length(line) > self.how.resolution
            and self.seen.get(_middle(line), 0) is not None
        ]:
            next(turns)
            self._run_at(_middle(lines[i]) for i in long)
            for i in long:
                low, high = lines[i]
                middle = _middle(lines[i])
                found = self.seen[middle]
                if found is not None:  # a line with a failed middle stays as it is
                    same = found == self.seen[low]
                    lines[i] = (middle, high) if same else (low, middle)
        return lines


def _length(line: Line) -> float:
    return math.dist(*line)


def _middle(line: Line) -> Point:
    (a, b), (c, d) = line
    return (a + c) / 2, (b + d) / 2


def _triangles(points: Iterable[Point]) -> list[list[Point]]:
    """Return the triangles between points (Delaunay), the corners of each in order;
    none for fewer than three points.
    """
    listed = list(points)
    found = Delaunay(listed).simplices.tolist() if len(listed) > 2 else []
    return [sorted(listed[i] for i in corners) for corners in found]
