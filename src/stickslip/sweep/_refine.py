"""Find where a regime changes in a plane, with far fewer runs than a grid: explore, find, polish."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, number, whole
from stickslip.sweep import _store
from stickslip.sweep._content import AxisValue, cell_content, cell_key, identity_digest
from stickslip.sweep._pools import Pool, Processes, Threads, open_pool
from stickslip.sweep._run import Progress, check_case, check_measure, died, identity_of_code, name_of
from stickslip.sweep._worker import CannotLoadError, Case, Job, Outcome, package_version

if TYPE_CHECKING:
    import xarray as xr

Point = tuple[float, float]
Array = NDArray[np.float64]

FORMAT = "stickslip-refine"
EXPLORE, FIND = 0.25, 0.55
"""Fractions of the runs after which exploring ends (evenly over the box), and finding (where labels differ)."""


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

    def value(self, share: float) -> float:
        """Return the value at a fraction of the way from `low` (0) to `high` (1)."""
        if self.log:
            value = self.low * math.exp(share * math.log(self.high / self.low))
        else:
            value = self.low + (self.high - self.low) * share
        return min(max(value, self.low), self.high)


@dataclass(frozen=True, kw_only=True)
class _Labelled:
    """Measure of a refinement: the label alone."""

    label: Callable[[Any], object]

    def __call__(self, result: object) -> dict[str, object]:
        return {"label": self.label(result)}


def refine(
    case: Case,
    box: Mapping[str, Span | tuple[float, float]],
    label: Callable[[Any], object],
    *,
    runs: int = 160,
    resolution: float = 1 / 40,
    executor: Threads | Processes | Executor | None = None,
    store: str | PathLike[str] | None = None,
    seed: int = 0,
    together: int = 8,
    progress: Callable[[Progress], object] | None = None,
    fingerprint: object = None,
) -> xr.Dataset:
    """Find the boundaries between the regions of a plane in which a case gets the same label.

    A quarter of the runs is spread over the box, the next go where labels differ (`adaptive.Learner2D`), the
    last bisect lines across the boundary. A region that all of the first quarter miss is not found. With
    hysteresis, call it once for each branch, with a case that starts on it.

    Parameters
    ----------
    case : callable
        As for `sweep`.
    box : mapping of two names to Span or (low, high)
        The plane.
    label : callable
        Called with the result of `case`; returns a text or a number, the same all over a region.
    runs : int
        Runs to spend at most; at least 16.
    resolution : float
        Lines across the boundary are bisected until they are this short, as a fraction of the box.
    executor, seed, progress, fingerprint
        As for `sweep`.
    store : path, optional
        File that keeps each run as it finishes; a second start with the same case makes no run twice, also
        with more runs or in another box.
    together : int
        Runs made at a time. The result depends on it, but not on the executor or the number of workers.

    Returns
    -------
    xarray.Dataset
        Along ``run``: the two coordinates, ``label`` and ``error``. Along ``crossing``: a point of the
        boundary each, ``<name>_at``, the ``<name>_error`` to either side, and the labels ``from_label`` and
        ``to_label`` there.

    Raises
    ------
    InputError
        If an argument cannot be used, or the package ``adaptive`` is missing.
    """
    spans = _spans(box)
    runs = whole("runs", runs, at_least=16)
    together = whole("together", together, at_least=1)
    resolution = number("resolution", resolution, above=0, below=1)
    seed = whole("seed", seed, at_least=0)
    asks_seed = check_case(case, list(spans))
    check_measure("label", label)
    job = Job(case=case, measure=_Labelled(label=label), seed=seed if asks_seed else None)
    identity = identity_of_code({"case": case, "label": label}, seed, fingerprint)
    with ExitStack() as stack:
        journal = None if store is None else stack.enter_context(_open_journal(Path(store), identity))
        pool = stack.enter_context(open_pool(executor, job))
        search = _Search(spans, pool, journal, identity, runs, progress)
        search.find(together)
        brackets = search.polish(together, resolution)
    return _dataset(search, brackets, _provenance(job, spans, seed, runs, resolution, together, identity))


class _Search:
    """The runs made so far, in fractions of the box."""

    def __init__(
        self,
        spans: Mapping[str, Span],
        pool: Pool,
        journal: _Journal | None,
        identity: Mapping[str, str],
        runs: int,
        progress: Callable[[Progress], object] | None,
    ) -> None:
        self.spans, self.runs = spans, runs
        self.outcomes: dict[Point, Outcome] = {}
        self._pool, self._journal, self._progress = pool, journal, progress
        self._head = identity_digest(identity)
        self._found = 0

    @property
    def left(self) -> int:
        """Runs still to spend."""
        return self.runs - len(self.outcomes)

    def values(self, point: Point) -> dict[str, AxisValue]:
        """Values of the axes at a point."""
        return {name: span.value(share) for (name, span), share in zip(self.spans.items(), point, strict=True)}

    def label(self, point: Point) -> Any:
        """Label found at a point; None if the case failed there."""
        outcome = self.outcomes[point]
        return None if isinstance(outcome, str) else outcome["label"]

    def run(self, points: Sequence[Point]) -> None:
        """Run a case at each point, unless the journal knows it."""
        keys = [cell_key(self._head, cell_content(self.values(point))) for point in points]
        known = self._journal.known if self._journal else {}
        todo = [i for i, key in enumerate(keys) if key not in known]
        fresh = dict(zip(todo, _evaluate(self._pool, [self.values(points[i]) for i in todo]), strict=True))
        for i, (point, key) in enumerate(zip(points, keys, strict=True)):
            outcome = fresh[i] if i in fresh else known[key]
            if not isinstance(outcome, str) and not isinstance(outcome["label"], (str, float)):
                outcome = f"TypeError: label returned {outcome['label']!r}: must be a text or a number"
            if self._journal is not None and i in fresh:
                self._journal.add(key, outcome)
            self._found += i not in fresh
            self.outcomes[point] = outcome
        if self._progress is not None:
            failed = sum(isinstance(outcome, str) for outcome in self.outcomes.values())
            self._progress(Progress(total=self.runs, finished=len(self.outcomes), failed=failed, found=self._found))

    def find(self, together: int) -> None:
        """Standard deviation runs over the box, then send them where labels differ."""
        learner_class = _learner_class()
        classes: dict[Any, int] = {}
        exploring = True

        def loss(triangles: Any) -> Array:
            points = triangles.tri.points[triangles.tri.simplices]
            a, b = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
            size = np.sqrt(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2)
            values = triangles.values[triangles.tri.simplices][:, :, 0]
            mixed = (np.ptp(values, axis=1) > 1e-9) & (values.min(axis=1) >= 0)
            return np.asarray(size if exploring else np.where(mixed, size, 0.1 * size**2))

        learner = learner_class(None, bounds=((0.0, 1.0), (0.0, 1.0)), loss_per_triangle=loss)
        learner.stack_size = 1
        while len(self.outcomes) < FIND * self.runs:
            exploring = len(self.outcomes) < EXPLORE * self.runs
            count = min(together, math.ceil(FIND * self.runs) - len(self.outcomes))
            points = [(float(x), float(y)) for x, y in learner.ask(count)[0]]
            self.run(points)
            for point in points:
                found = self.label(point)
                # A case that failed says nothing about regimes: its triangles are not looked into.
                learner.tell(point, -1 if found is None else classes.setdefault(found, len(classes)))

    def polish(self, together: int, resolution: float) -> list[tuple[Point, Point]]:
        """Bisect lines across the boundary, spread along it, as many as the runs left are enough for."""
        brackets = self._crossings()
        if not brackets:
            return []
        cost = [max(0, math.ceil(math.log2(_length(bracket) / resolution))) for bracket in brackets]
        chosen = _std(brackets, cost, self.left)
        open_ones = [i for i in chosen if cost[i] > 0]
        while open_ones:
            batch = open_ones[:together]
            middles = [_middle(brackets[i]) for i in batch]
            self.run([middle for middle in dict.fromkeys(middles) if middle not in self.outcomes])
            for i, middle in zip(batch, middles, strict=True):
                low, high = brackets[i]
                found = self.label(middle)
                if found is None:  # no further here
                    open_ones.remove(i)
                    continue
                brackets[i] = (middle, high) if found == self.label(low) else (low, middle)
                if _length(brackets[i]) <= resolution:
                    open_ones.remove(i)
            open_ones = [i for i in open_ones if i not in batch] + [i for i in batch if i in open_ones]
        return [brackets[i] for i in chosen]

    def _crossings(self) -> list[tuple[Point, Point]]:
        """Edges of the triangulation whose ends have different labels."""
        from scipy.spatial import Delaunay

        points = [point for point in self.outcomes if self.label(point) is not None]
        if len(points) < 3:
            return []
        edges = {
            (min(i, j), max(i, j))
            for simplex in Delaunay(np.asarray(points)).simplices.tolist()
            for i, j in ((simplex[0], simplex[1]), (simplex[1], simplex[2]), (simplex[2], simplex[0]))
        }
        crossing = [(points[i], points[j]) for i, j in sorted(edges)]
        return [(low, high) for low, high in crossing if self.label(low) != self.label(high)]


# ---------------------------------------------------------------- parts


def _evaluate(pool: Pool, cells: Sequence[Mapping[str, AxisValue]]) -> list[Outcome]:
    """Run cases, each on its own; one whose worker dies three times is recorded as failed."""
    outcomes: dict[int, Outcome] = {}
    for attempt in range(3):
        todo = [i for i in range(len(cells)) if i not in outcomes]
        # With the last chance each runs alone: then it is clear whose case it was.
        for group in [[i] for i in todo] if attempt == 2 else [todo]:
            try:
                futures = {i: pool.submit([cells[i]], math.inf) for i in group}
                for i, future in futures.items():
                    outcomes[i] = future.result()[0][0]
            except BrokenExecutor as error:
                if not pool.replaceable:
                    raise InputError(
                        f"executor = {pool.given!r}: has lost a worker and cannot be built anew from here"
                    ) from error
                pool.rebuild()
            except CannotLoadError as error:
                raise InputError(
                    f"case, label: the workers cannot load them ({error}); define them in a module that the "
                    "workers can import, or use Threads(n)"
                ) from error
            except Exception as error:
                if type(error).__name__ != "KilledWorker":  # of dask
                    raise InputError(f"executor: dropped a case ({type(error).__name__}: {error})") from error
    return [outcomes.get(i, died()) for i in range(len(cells))]


def _std(brackets: Sequence[tuple[Point, Point]], cost: Sequence[int], budget: int) -> list[int]:
    """Choose lines far from one another, until the runs are spent."""
    middles = np.array([_middle(bracket) for bracket in brackets])
    distance = np.full(len(brackets), np.inf)
    chosen: list[int] = []
    while len(chosen) < len(brackets):
        i = int(np.argmax(distance))
        if cost[i] > budget or distance[i] <= 0:
            break
        budget -= cost[i]
        chosen.append(i)
        distance = np.minimum(distance, np.hypot(*(middles - middles[i]).T))
    return chosen


def _middle(bracket: tuple[Point, Point]) -> Point:
    (a, b), (c, d) = bracket
    return (a + c) / 2, (b + d) / 2


def _length(bracket: tuple[Point, Point]) -> float:
    return math.dist(*bracket)


def _spans(box: Mapping[str, Span | tuple[float, float]]) -> dict[str, Span]:
    if len(box) != 2:
        raise InputError(f"box = {dict(box)!r}: must name two axes")
    spans = {}
    for name, given in box.items():
        _store.check_name("box", name)
        if isinstance(given, Span):
            spans[name] = given
            continue
        try:
            low, high = given
        except (TypeError, ValueError):
            raise InputError(f"box[{name!r}] = {given!r}: must be (low, high) or a Span") from None
        spans[name] = Span(low=low, high=high)
    return spans


def _learner_class() -> Any:
    try:
        from adaptive import Learner2D
    except ImportError:
        raise InputError("refine needs the adaptive package: pip install stickslip[sweep]") from None
    return Learner2D


def _dataset(search: _Search, brackets: list[tuple[Point, Point]], provenance: str) -> xr.Dataset:
    import xarray as xr

    data: dict[str, Any] = {}
    points = list(search.outcomes)
    text = any(isinstance(search.label(point), str) for point in points)
    blank: Any = "" if text else math.nan

    def labels(where: Sequence[Point]) -> NDArray[Any]:
        found = [search.label(point) for point in where]
        return np.array([blank if one is None else one for one in found], dtype=object if text else float)

    def about(name: str) -> dict[str, str]:
        return {"long_name": name, "units": "natural units"}

    for name in search.spans:
        data[name] = ("run", [search.values(point)[name] for point in points], about(name))
        low = np.array([search.values(low)[name] for low, _ in brackets], dtype=float)
        high = np.array([search.values(high)[name] for _, high in brackets], dtype=float)
        data[f"{name}_at"] = ("crossing", (low + high) / 2, about(f"{name} on the boundary"))
        data[f"{name}_error"] = (
            "crossing",
            np.abs(high - low) / 2,
            about(f"uncertainty of {name}, either side"),
        )
    errors = [outcome if isinstance(outcome, str) else "" for outcome in search.outcomes.values()]
    as_error = {"long_name": "error of the case, empty if it went well", "units": "text"}
    data["label"] = ("run", labels(points), about("label of the case"))
    data["error"] = ("run", np.array(errors, dtype=object), as_error)
    data["from_label"] = ("crossing", labels([low for low, _ in brackets]), about("label on one side"))
    data["to_label"] = ("crossing", labels([high for _, high in brackets]), about("label on the other side"))
    dataset = xr.Dataset(data, attrs={"provenance": provenance})
    return dataset.set_coords(list(search.spans))


def _provenance(
    job: Job,
    spans: Mapping[str, Span],
    seed: int,
    runs: int,
    resolution: float,
    together: int,
    identity: Mapping[str, str],
) -> str:
    label = job.measure.label if isinstance(job.measure, _Labelled) else job.measure
    record = {
        "format": FORMAT,
        "format_version": _store.VERSION,
        "stickslip": package_version(),
        "case": name_of(job.case),
        "label": name_of(label),
        "box": {name: [span.low, span.high, span.log] for name, span in spans.items()},
        "seed": seed,
        "runs": runs,
        "resolution": resolution,
        "together": together,
        "identity": dict(sorted(identity.items())),
    }
    return json.dumps(record)


class _Journal:
    """Runs kept in a file, one line each; a line cut short by a kill counts as not written."""

    def __init__(self, path: Path, identity: Mapping[str, str]) -> None:
        self._path = path
        self.known: dict[int, Outcome] = {}
        head = json.dumps({"format": FORMAT, "format_version": _store.VERSION, "identity": dict(identity)})
        with _store.writing(path):
            lines = path.read_text(encoding="utf-8").splitlines(keepends=True) if path.exists() else []
            if lines and not lines[-1].endswith("\n"):
                lines.pop()
                path.write_text("".join(lines), encoding="utf-8")
            if not lines:
                path.write_text(head + "\n", encoding="utf-8")
                return
        try:
            found = json.loads(lines[0])
            there, form = found["identity"], (found["format"], found["format_version"])
        except (ValueError, KeyError, TypeError):
            there, form = {}, ("", 0)
        if form != (FORMAT, _store.VERSION):
            raise InputError(f"store = {str(path)!r}: is not the file of a refinement; choose another")
        _store.check_identity(path, there, identity)
        for line in lines[1:]:
            key, outcome = json.loads(line)
            self.known[int(key)] = outcome

    def add(self, key: int, outcome: Outcome) -> None:
        """Write down one run."""
        with _store.writing(self._path), self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps([key, outcome]) + "\n")
        self.known[key] = outcome


@contextmanager
def _open_journal(path: Path, identity: Mapping[str, str]) -> Iterator[_Journal]:
    if path.is_dir():
        raise InputError(f"store = {str(path)!r}: is a directory; a refinement is kept in a file")
    with _store.locked(path):
        yield _Journal(path, identity)
