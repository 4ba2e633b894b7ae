"""Find where a category changes in a plane, with far fewer runs than a grid: explore, find, polish."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.errors import InputError, number, whole
from stickslip.sweep._cases import AxisValue, Function, case_key, check_name
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
    search = {
        "box": {name: [span.low, span.high, span.log] for name, span in spans.items()},
        "label": label,
        **vars(refinement),
        "each": each,
    }
    where: Any = {"store": store, "executor": executor, "progress": progress, "options": options}
    with started(function, [*spans, *each], refinement.runs * len(branches), {"search": search}, **where) as runner:
        searches = [_Search(runner, spans, fixed, label, refinement) for fixed in branches]
        lines = [[search.key(end) for end in line] for search in searches for line in search.boundary()]
        cases = [search.key(point) for search in searches for point in search.seen]
        place = {key: i for i, key in enumerate(cases)}
        runner.table.keep_head(cases=cases, crossings=[[place[end] for end in line] for line in lines])
        return dataset_of(runner.table)


@dataclass
class _Search:
    """A search, with the category found at each of its runs so far; None where the case failed."""

    runner: Runner
    spans: Mapping[str, Span]
    fixed: Mapping[str, AxisValue]
    label: str
    how: Refinement
    seen: dict[Point, Any] = field(default_factory=dict)

    def key(self, point: Point) -> str:
        """The case at a point."""
        here = {name: span.value(part) for (name, span), part in zip(self.spans.items(), point, strict=True)}
        return case_key({**here, **self.fixed})

    def boundary(self) -> list[Line]:
        """Spread runs over the box, send some where categories differ, then bisect lines across the boundary."""
        how, find = self.how, math.ceil(FIND * self.how.runs)
        self._look([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)])
        while len(self.seen) < find:
            sides = _longest_sides(self.seen, exploring=len(self.seen) < EXPLORE * how.runs)
            middles = list(dict.fromkeys(map(_middle, sides)))
            self._look(middles[: min(how.together, find - len(self.seen))])
        lines = _far_apart(_crossings(self.seen), how.resolution, how.runs - len(self.seen))
        waiting = [i for i, line in enumerate(lines) if math.dist(*line) > how.resolution]
        while waiting:
            batch, waiting = waiting[: how.together], waiting[how.together :]
            self._look([_middle(lines[i]) for i in batch])
            for i in batch:
                (low, high), middle = lines[i], _middle(lines[i])
                if self.seen[middle] is None:  # no further here
                    continue
                lines[i] = (middle, high) if self.seen[middle] == self.seen[low] else (low, middle)
                if math.dist(*lines[i]) > how.resolution:
                    waiting.append(i)
        return lines

    def _look(self, points: Sequence[Point]) -> None:
        """Learn the category at each point."""
        cases = {point: self.key(point) for point in points if point not in self.seen}
        self.runner.run(list(dict.fromkeys(cases.values())))
        for point, key in cases.items():
            row = json.loads(self.runner.table.rows[key])
            if self.label not in row.get("result", {self.label: None}):
                raise InputError(f"label = {self.label!r}: the function must return a text or a number under this name")
            self.seen[point] = row["result"][self.label] if "result" in row else None


# ---------------------------------------------------------------- parts


def _longest_sides(seen: Mapping[Point, Any], *, exploring: bool) -> list[Line]:
    """The longest side of each triangle between the runs, longest first; later, between categories first."""
    sizes = []
    for corners in _triangles(seen):
        longest = max(itertools.combinations(corners, 2), key=lambda side: math.dist(*side))
        found, size = {seen[corner] for corner in corners}, math.dist(*longest)
        # A case that failed says nothing about categories: its triangles are not looked into.
        mixed = len(found) > 1 and None not in found
        sizes.append((size if exploring or mixed else 0.1 * size**2, longest))
    return [side for _, side in sorted(sizes, reverse=True)]


def _crossings(seen: Mapping[Point, Any]) -> list[Line]:
    """Sides of triangles whose ends are in different categories."""
    triangles = _triangles(point for point, found in seen.items() if found is not None)
    sides = sorted({side for corners in triangles for side in itertools.combinations(corners, 2)})
    return [(low, high) for low, high in sides if seen[low] != seen[high]]


def _far_apart(lines: Sequence[Line], resolution: float, budget: int) -> list[Line]:
    """Choose lines far from one another, until the runs that bisecting them takes are spent."""
    middles = np.array([_middle(line) for line in lines])
    distance = np.full(len(lines), np.inf)
    chosen: list[Line] = []
    while len(chosen) < len(lines):
        i = int(np.argmax(distance))
        budget -= max(0, math.ceil(math.log2(math.dist(*lines[i]) / resolution)))
        if budget < 0 or distance[i] <= 0:
            break
        chosen.append(lines[i])
        distance = np.minimum(distance, np.hypot(*(middles - middles[i]).T))
    return chosen


def _middle(line: Line) -> Point:
    (a, b), (c, d) = line
    return (a + c) / 2, (b + d) / 2


def _triangles(points: Iterable[Point]) -> list[list[Point]]:
    """The triangles between points (Delaunay), the corners of each in order; none between fewer than three."""
    from scipy.spatial import Delaunay

    there = list(points)
    found = Delaunay(there).simplices.tolist() if len(there) > 2 else []
    return [sorted(there[i] for i in corners) for corners in found]


def _spans(box: Mapping[str, Span | tuple[float, float]]) -> dict[str, Span]:
    for name in box:
        check_name("box", name)
    try:
        spans = {
            name: each if isinstance(each, Span) else Span(low=each[0], high=each[1]) for name, each in box.items()
        }
    except (TypeError, IndexError):
        spans = {}
    if len(spans) != 2:
        raise InputError(f"box = {dict(box)!r}: must name two axes, each with (low, high) or a Span")
    return spans
