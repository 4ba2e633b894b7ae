"""Find where a category changes in a plane, with far fewer runs than a grid: explore, find, polish."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.errors import InputError, number, whole
from stickslip.sweep._cases import AxisValue, Function, Values, case_key, check_name
from stickslip.sweep._dataset import axis_values, combinations, dataset_of
from stickslip.sweep._executors import Workers
from stickslip.sweep._run import Options, Progress, Runner, started

if TYPE_CHECKING:
    import xarray as xr

Point = tuple[float, float]
"""A place in the box, as fractions of the way along its two axes."""
Line = tuple[Point, Point]

EXPLORE, FIND = 0.25, 0.55
"""Fractions of the runs after which exploring ends (evenly over the box), and finding (where categories differ)."""


@dataclass(frozen=True, kw_only=True)
class Span:
    """An axis of the box that is searched.

    Parameters
    ----------
    low, high : float
        Its ends.
    log : bool
        Whether equal ratios count as equal distances.
    """

    low: float
    high: float
    log: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", number("Span.low", self.low))
        object.__setattr__(self, "high", number("Span.high", self.high, above=self.low))
        if self.log:
            number("Span.low", self.low, above=0, hint="an axis of equal ratios")

    def value(self, fraction: float) -> float:
        """Return the value at a fraction of the way from `low` (0) to `high` (1)."""
        if self.log:
            value = self.low * math.exp(fraction * math.log(self.high / self.low))
        else:
            value = self.low + (self.high - self.low) * fraction
        return min(max(value, self.low), self.high)


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """How the boundaries in a plane are searched for.

    Parameters
    ----------
    runs : int
        Runs to spend on a search at most; at least 16.
    resolution : float
        Lines across the boundary are bisected until they are this short, as a fraction of the box.
    together : int
        Runs made at a time. The result depends on it, but not on the executor or the number of workers.
    each : mapping of name to values
        Further parameters of the function; every combination of their values gets a search of its own.

    Raises
    ------
    InputError
        If a value cannot be.
    """

    runs: int = 160
    resolution: float = 1 / 40
    together: int = 8
    each: Mapping[str, Sequence[AxisValue]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        whole("refine.runs", self.runs, at_least=16)
        number("refine.resolution", self.resolution, above=0, below=1)
        whole("refine.together", self.together, at_least=1)


def refine(
    function: Function,
    box: Mapping[str, Span | tuple[float, float]],
    label: str,
    refinement: Refinement = Refinement(),
    *,
    store: str | PathLike[str] | None = None,
    executor: Workers | None = None,
    progress: Callable[[Progress], object] | None = None,
    options: Options = Options(),
) -> xr.Dataset:
    """Find the boundaries between the regions of a plane in which a function returns the same category.

    A quarter of the runs is distributed over the box, the next go where categories differ, the last bisect lines across
    the boundary. A region that all of the first quarter miss is not found. With hysteresis, search for each branch,
    with cases that start on it; see `Refinement`.

    Parameters
    ----------
    function : callable
        As for `run_cases`.
    box : mapping of two names to Span or (low, high)
        The plane.
    label : str
        Name under which the function returns the category, a text or a number, the same all over a region.
    refinement : Refinement
        How many runs, and how fine.
    store, executor, progress, options
        As for `run_cases`. A second start makes no run twice, also with more runs or in another box.

    Returns
    -------
    xarray.Dataset
        Along ``run``: the coordinates, all that the function returned, ``status`` and ``error``. Along ``crossing``: a
        point of the boundary each, ``<name>_at``, the ``<name>_error`` to either side, and the categories
        ``from_<label>`` and ``to_<label>`` there.

    Raises
    ------
    InputError
        As `run_cases`.

    Examples
    --------
    >>> from stickslip.sweep import Refinement, refine
    >>> def side(x, y):
    ...     return {"side": "above" if y > 0.3 + 0.4 * x else "below"}
    >>> found = refine(side, {"x": (0, 1), "y": (0, 1)}, "side", Refinement(runs=60))
    >>> bool((abs(found["y_at"] - 0.3 - 0.4 * found["x_at"]) < 0.03).all())
    True
    """
    spans = _spans(box)
    each = {name: axis_values(name, values, "refine.each") for name, values in refinement.each.items()}
    branches = combinations(each)
    content = {
        "box": {name: [span.low, span.high, span.log] for name, span in spans.items()},
        "each": each,
        "label": label,
        "runs": refinement.runs,
        "resolution": refinement.resolution,
        "together": refinement.together,
    }
    total = refinement.runs * len(branches)
    with started(
        function, content, [*spans, *each], total, store=store, executor=executor, progress=progress, options=options
    ) as runner:
        searches = [_Search(runner, spans, values, label, refinement) for values in branches]
        found = [(search, search.boundary()) for search in searches]
        cases = [case_key(search.values(point)) for search in searches for point in search.points]
        place = {key: i for i, key in enumerate(cases)}
        crossings = [[place[case_key(search.values(end))] for end in line] for search, lines in found for line in lines]
        runner.table.keep_head(cases=cases, crossings=crossings)
        return dataset_of(runner.table)


class _Search:
    """The runs of one search so far, with the category found at each; None where the case failed."""

    def __init__(
        self, runner: Runner, spans: Mapping[str, Span], fixed: Values, label: str, refinement: Refinement
    ) -> None:
        self.points: dict[Point, Any] = {}
        self._runner, self._spans, self._fixed, self._label, self._how = runner, spans, fixed, label, refinement

    def values(self, point: Point) -> Values:
        """Values of the parameters at a point."""
        here = {name: span.value(part) for (name, span), part in zip(self._spans.items(), point, strict=True)}
        return {**here, **self._fixed}

    def boundary(self) -> list[Line]:
        """Spread runs over the box, send some where categories differ, then bisect lines across the boundary."""
        runs = self._how.runs
        self._evaluate([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)])
        while len(self.points) < FIND * runs:
            middles = dict.fromkeys(map(_middle, self._longest_sides(exploring=len(self.points) < EXPLORE * runs)))
            count = min(self._how.together, math.ceil(FIND * runs) - len(self.points))
            self._evaluate(list(middles)[:count])
        lines = _far_apart(self._crossings(), self._how.resolution, runs - len(self.points))
        waiting = [i for i, line in enumerate(lines) if _length(line) > self._how.resolution]
        while waiting:
            batch, waiting = waiting[: self._how.together], waiting[self._how.together :]
            halves = {i: _middle(lines[i]) for i in batch}
            self._evaluate([middle for middle in dict.fromkeys(halves.values()) if middle not in self.points])
            for i, middle in halves.items():
                low, high = lines[i]
                found = self.points[middle]
                if found is None:  # no further here
                    continue
                lines[i] = (middle, high) if found == self.points[low] else (low, middle)
                if _length(lines[i]) > self._how.resolution:
                    waiting.append(i)
        return lines

    def _evaluate(self, points: Sequence[Point]) -> None:
        """Learn the category at each point."""
        cases = [self.values(point) for point in points]
        self._runner.run(cases)
        for point, values in zip(points, cases, strict=True):
            row = self._runner.table.get(case_key(values))
            if self._label not in row.get("result", {self._label: None}):
                raise InputError(
                    f"label = {self._label!r}: the function must return a text or a number under this name"
                )
            self.points[point] = row["result"][self._label] if "result" in row else None

    def _longest_sides(self, *, exploring: bool) -> list[Line]:
        """The longest side of each triangle between the runs, longest first; later, between categories first."""
        sizes = []
        for corners in _triangles(list(self.points)):
            longest = max(itertools.combinations(corners, 2), key=_length)
            found, size = {self.points[corner] for corner in corners}, _length(longest)
            # A case that failed says nothing about categories: its triangles are not looked into.
            mixed = len(found) > 1 and None not in found
            sizes.append((size if exploring or mixed else 0.1 * size**2, longest))
        return [side for _, side in sorted(sizes, reverse=True)]

    def _crossings(self) -> list[Line]:
        """Sides of triangles whose ends are in different categories."""
        triangles = _triangles([point for point, found in self.points.items() if found is not None])
        sides = sorted({side for corners in triangles for side in itertools.combinations(corners, 2)})
        return [(low, high) for low, high in sides if self.points[low] != self.points[high]]


# ---------------------------------------------------------------- parts


def _far_apart(lines: Sequence[Line], resolution: float, budget: int) -> list[Line]:
    """Choose lines far from one another, until the runs that bisecting them takes are spent."""
    middles = np.array([_middle(line) for line in lines])
    distance = np.full(len(lines), np.inf)
    chosen: list[Line] = []
    while len(chosen) < len(lines):
        i = int(np.argmax(distance))
        budget -= max(0, math.ceil(math.log2(_length(lines[i]) / resolution)))
        if budget < 0 or distance[i] <= 0:
            break
        chosen.append(lines[i])
        distance = np.minimum(distance, np.hypot(*(middles - middles[i]).T))
    return chosen


def _middle(line: Line) -> Point:
    (a, b), (c, d) = line
    return (a + c) / 2, (b + d) / 2


def _length(line: Line) -> float:
    return math.dist(*line)


def _spans(box: Mapping[str, Span | tuple[float, float]]) -> dict[str, Span]:
    if len(box) != 2:
        raise InputError(f"box = {dict(box)!r}: must name two axes")
    spans = {}
    for name, given in box.items():
        check_name("box", name)
        try:
            low, high = (0.0, 0.0) if isinstance(given, Span) else given
        except (TypeError, ValueError):
            raise InputError(f"box[{name!r}] = {given!r}: must be (low, high) or a Span") from None
        spans[name] = given if isinstance(given, Span) else Span(low=low, high=high)
    return spans


def _triangles(points: Sequence[Point]) -> list[list[Point]]:
    """The triangles between points (Delaunay), the corners of each in order; none between fewer than three."""
    from scipy.spatial import Delaunay

    found = Delaunay(points).simplices.tolist() if len(points) > 2 else []
    return [sorted(points[i] for i in corners) for corners in found]
