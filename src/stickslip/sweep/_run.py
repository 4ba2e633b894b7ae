"""Run many cases over named axes: hand out, gather, write down."""

from __future__ import annotations

import inspect
import json
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, whole
from stickslip.sweep import _store
from stickslip.sweep._content import AxisValue, code_parts, digest, encode
from stickslip.sweep._pools import Pool, Processes, Threads, open_pool
from stickslip.sweep._worker import (
    CannotLoadError,
    Case,
    Job,
    Measure,
    OtherVersionError,
    Outcome,
    package_version,
)

if TYPE_CHECKING:
    import xarray as xr

SECONDS = 1.0
"""Aim for the duration of a batch: long beside the cost of handing it out, short beside one's patience."""

LARGEST_BATCH = 1000

LANDING, LATEST = 0.02, 30.0
"""Fraction of the time that goes into writing, at most: results that come faster are written together, but not later than
so many seconds after those before."""


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a sweep is.

    Parameters
    ----------
    total : int
        Cases of the whole sweep.
    finished : int
        Cases with a result or an error by now, those of earlier starts included.
    failed : int
        Those among them that ended with an error.
    found : int
        Cases that earlier starts had finished: rate and time left follow from ``finished - found``.
    """

    total: int
    finished: int
    failed: int
    found: int


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A case that raised: the values of its axes, and its error."""

    parameters: Mapping[str, AxisValue]
    error: str

    def __str__(self) -> str:
        where = ", ".join(f"{name} = {value!r}" for name, value in self.parameters.items())
        return f"{where}: {self.error}"


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What became of a sweep; as text, its last line."""

    total: int
    done: int
    failed: int
    missing: int

    def __str__(self) -> str:
        line = f"{self.done} of {self.total} cases done"
        if self.failed:
            line += f", {self.failed} failed"
        if self.missing:
            line += f", {self.missing} not run yet"
        return line


def sweep(
    case: Case,
    axes: Mapping[str, ArrayLike | xr.DataArray],
    measure: Measure,
    *,
    executor: Threads | Processes | Executor | None = None,
    store: str | PathLike[str] | None = None,
    seed: int = 0,
    batch: int | None = None,
    progress: Callable[[Progress], object] | None = None,
    attributes: Mapping[str, Mapping[str, Any]] | None = None,
    fingerprint: object = None,
    notes: Mapping[str, str] | None = None,
    retry_failed: bool = False,
) -> xr.Dataset:
    """Run a case at every combination of the values of some axes.

    The results are the same, bit for bit, for any number of workers, any executor and any batch.

    Parameters
    ----------
    case : callable
        Called with one keyword for each axis, ``case(stiffness=2.0, velocity=0.1)``; what it returns goes to
        `measure`. If it has a parameter ``seed`` that is no axis, it is handed a seed of its own, an int made
        from `seed` and the values of the axes. An axis that the case ignores makes replicas.
    axes : mapping of name to values
        Numbers, texts or booleans, each value once; an `xarray.DataArray` brings its attributes along.
    measure : callable
        Called with the result of `case`, in the worker; returns a mapping of names to numbers, texts or small
        arrays, the same names and shapes in every case. An `xarray.DataArray` brings dimensions, coordinates
        and attributes along. Numbers are kept as float64 or complex128.
    executor : Threads, Processes or concurrent.futures.Executor, optional
        Where cases run; by default threads, one per core. For dask: ``client.get_executor()``.
    store : path, optional
        Directory (zarr v3) where results land as they finish; a second start with the same arguments runs
        what is missing. By default results are kept in memory.
    seed : int
        Seed of the sweep, at least 0.
    batch : int, optional
        Cases that a worker takes at a time; by default as many as take about a second, at most 1000. It also
        cuts a new store into chunks.
    progress : callable, optional
        Called with a `Progress` at the start and whenever results have landed.
    attributes : mapping, optional
        Attributes (``units``, ``long_name``) by name of axis or measured variable.
    fingerprint : object, optional
        Anything else that results depend on (the text of a configuration file, the version of another
        package).
    notes : mapping of str to str, optional
        Texts to keep with the results, as attributes of the Dataset; what a case is does not depend on them.
    retry_failed : bool
        Whether cases that failed in an earlier start are run again.

    Returns
    -------
    xarray.Dataset
        One variable for each measured name, with the axes as dimensions (read from the store on use);
        ``error``, the error of each case that failed, else empty; ``case_key``, 0 where a case has not run.
        See `summary` and `failures`.

    Raises
    ------
    InputError
        If an argument cannot be used; if the store holds another sweep, is of another version, is being
        written by another process, or cannot be written (what was written is kept); if the workers cannot
        load the functions.
    """
    grid = _grid(axes, attributes or {}, batch)
    asks_seed = check_case(case, list(grid.axes))
    check_measure("measure", measure)
    seed = whole("seed", seed, at_least=0)
    job = Job(case=case, measure=measure, seed=seed if asks_seed else None)
    identity = _identity(job, grid, seed, fingerprint)
    attrs = dict(notes or {}) | {_store.PROVENANCE: _provenance(job, grid, seed, identity)}
    with ExitStack() as stack:
        if store is None:
            sink: _store.Sink = _store.Memory(grid, attrs)
        else:
            path = Path(store)
            if path.exists() and not retry_failed:
                complete = _read_complete(path, grid, identity)
                if complete is not None:  # nothing to write: a store on a read-only disk will do
                    _report(complete, progress)
                    return complete
            stack.enter_context(_store.locked(path))
            sink = _open_sink(path, grid, identity, attrs)
        _Run(sink, job, identity, batch, retry_failed, progress).run(executor)
        return sink.dataset()


def open_sweep(store: str | PathLike[str]) -> xr.Dataset:
    """Open the results of a sweep, finished or not, as `sweep` returns them.

    Raises
    ------
    InputError
        If there is no store of a sweep, or it is of another version.
    """
    path = Path(store)
    _store.read_group(path)
    return _store.open_dataset(path)


def summary(dataset: xr.Dataset) -> Summary:
    """Count what became of the cases of a sweep."""
    keys, errors = _bookkeeping(dataset)
    run, failed = int(np.count_nonzero(keys)), int(np.count_nonzero(errors != ""))
    return Summary(total=keys.size, done=run - failed, failed=failed, missing=keys.size - run)


def failures(dataset: xr.Dataset) -> list[Failure]:
    """List the cases that raised, with their parameters and errors."""
    _, errors = _bookkeeping(dataset)
    dims = [str(dim) for dim in dataset[_store.ERROR].dims]
    found = []
    for index in np.argwhere(errors != ""):
        parameters = {dim: dataset[dim].values[i] for dim, i in zip(dims, index, strict=True)}
        plain = {dim: value.item() if isinstance(value, np.generic) else value for dim, value in parameters.items()}
        found.append(Failure(parameters=plain, error=str(errors[tuple(index)])))
    return found


# ---------------------------------------------------------------- the run


class _Run:
    """One start of a sweep: what is still to do, what is running, what has landed."""

    def __init__(
        self,
        sink: _store.Sink,
        job: Job,
        identity: Mapping[str, str],
        batch: int | None,
        retry_failed: bool,
        progress: Callable[[Progress], object] | None,
    ) -> None:
        self._sink, self._grid, self._job = sink, sink.grid, job
        self._keys = self._grid.keys(identity)
        self._batch = batch
        self._progress = progress
        everywhere = tuple(slice(None) for _ in self._grid.shape)
        finished = sink.read(_store.KEY, everywhere).ravel() == self._keys
        failed = (sink.read(_store.ERROR, everywhere).ravel() != "") & finished
        if retry_failed:
            finished, failed = finished & ~failed, np.zeros_like(failed)
        self._finished, self._failed = int(finished.sum()), int(failed.sum())
        self._found = self._finished
        self._todo = deque(int(cell) for cell in np.flatnonzero(~finished))
        self._suspects: deque[int] = deque()  # in flight each time when workers died: run alone, to know the culprit
        self._crashes: Counter[int] = Counter()
        self._running: dict[Future[tuple[list[Outcome], float]], list[int]] = {}
        self._per_case: float | None = None  # seconds, as last seen
        self._ready: dict[int, Outcome] = {}  # results that are not written yet
        self._land_at = 0.0

    def run(self, executor: Threads | Processes | Executor | None) -> None:
        """Run all that is missing."""
        self._tell()
        if not self._todo:
            return
        with open_pool(executor, self._job) as pool:
            try:
                while self._todo or self._suspects or self._running:
                    whole_pool = self._fill(pool)
                    rest = max(0.0, self._land_at - time.monotonic()) if self._ready else None
                    done, _ = wait(self._running, rest, FIRST_COMPLETED)
                    if not self._gather(done) or not whole_pool:
                        self._replace(pool)
                    if time.monotonic() >= self._land_at:
                        self._land()
                self._land()
            except BaseException:
                for future in self._running:
                    future.cancel()
                with suppress(InputError):
                    self._land()
                raise

    def _fill(self, pool: Pool) -> bool:
        """Keep two batches per worker on the way; false if the pool is broken."""
        workers = pool.workers
        try:
            while self._todo and len(self._running) < 2 * workers:
                self._submit(pool, self._next_batch(workers))
            if self._suspects and not self._running and not self._todo:
                self._submit(pool, [self._suspects.popleft()])
        except BrokenExecutor:
            return False
        except RuntimeError as error:  # it was shut down
            raise InputError(f"executor: takes no more cases ({error}); {self._kept()}") from error
        return True

    def _submit(self, pool: Pool, cells: list[int]) -> None:
        seconds = SECONDS if self._batch is None else float("inf")
        try:
            future = pool.submit([self._grid.values(cell) for cell in cells], seconds)
        except BaseException:
            self._todo.extendleft(reversed(cells))
            raise
        self._running[future] = cells

    def _next_batch(self, workers: int) -> list[int]:
        """Take cells of one block, as many as take about a second, fewer towards the end."""
        if self._batch is not None:
            size = self._batch
        elif self._per_case is None:
            size = 1
        else:
            of_a_second = SECONDS / max(self._per_case, 1e-9)
            shared = max(len(self._todo) / (2 * workers), 0.1 * of_a_second)  # all workers end nearly together
            size = int(min(LARGEST_BATCH, of_a_second, shared))
        cells = [self._todo.popleft()]
        block = self._grid.block_cells(self._grid.block(cells[0]))
        while self._todo and len(cells) < size and self._todo[0] in block:
            cells.append(self._todo.popleft())
        return cells

    def _gather(self, done: set[Future[tuple[list[Outcome], float]]]) -> bool:
        """Write down what has finished; false if the pool has lost a worker."""
        alive = True
        for future in done:
            cells = self._running.pop(future)
            try:
                outcomes, seconds = future.result()
            except BrokenExecutor:
                alive = False
                self._lost(cells)
            except (CancelledError, CannotLoadError) as error:
                raise InputError(self._trouble(error)) from error
            except Exception as error:
                if type(error).__name__ != "KilledWorker":  # of dask, after several workers died of this batch
                    raise InputError(self._trouble(error)) from error
                if len(cells) == 1:
                    self._ready[cells[0]] = died()
                else:
                    self._suspects.extend(cells)
            else:
                self._ready.update(zip(cells, outcomes, strict=False))
                self._todo.extendleft(reversed(cells[len(outcomes) :]))
                self._per_case = seconds / len(outcomes)
        return alive

    def _replace(self, pool: Pool) -> None:
        """Build the pool anew and give the cases that were in flight another chance."""
        done, _ = wait(self._running)  # a broken pool ends all its futures, some of them well
        self._gather(done)
        if not pool.replaceable:
            raise InputError(
                f"executor = {pool.given!r}: has lost a worker and cannot be built anew from here; "
                f"{self._kept()}, or use Processes(n), whose lost workers are replaced"
            )
        pool.rebuild()

    def _lost(self, cells: list[int]) -> None:
        """Put back the cells of a batch that was in flight when a worker died."""
        self._crashes.update(cells)
        if len(cells) == 1 and self._crashes[cells[0]] > 2:
            self._ready[cells[0]] = died()
            return
        self._suspects.extend(cell for cell in cells if self._crashes[cell] >= 2)
        self._todo.extendleft(reversed([cell for cell in cells if self._crashes[cell] < 2]))

    def _land(self) -> None:
        """Write down the results that are ready; the next time not before this one's cost is small beside it."""
        if not self._ready:
            return
        begin = time.monotonic()
        results, self._ready = self._ready, {}
        if not self._sink.template:
            first = next((o for _, o in sorted(results.items()) if not isinstance(o, str)), None)
            if first is not None:
                self._sink.create(_store.describe(first, self._grid))
        for cell, complaint in _store.mismatches(self._sink.template, results):
            results[cell] = f"ValueError: {complaint}"
        _store.land(self._sink, self._keys, results)
        self._finished += len(results)
        self._failed += sum(isinstance(outcome, str) for outcome in results.values())
        now = time.monotonic()
        self._land_at = now + min((now - begin) / LANDING, LATEST)
        self._tell()

    def _tell(self) -> None:
        if self._progress is not None:
            self._progress(
                Progress(total=self._grid.size, finished=self._finished, failed=self._failed, found=self._found)
            )

    def _kept(self) -> str:
        if isinstance(self._sink, _store.Store):
            kept = f"{self._finished} of {self._grid.size} cases are kept"
            return f"{kept} in {str(self._sink.path)!r}: start again"
        return "nothing is kept without a store"

    def _trouble(self, error: BaseException) -> str:
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
        if isinstance(error, CannotLoadError):
            return (
                f"case, measure: the workers cannot load them ({error}); define them in a module that the "
                f"workers can import, or use Threads(n); {self._kept()}"
            )
        if isinstance(error, OtherVersionError):
            return f"executor: {error}; {self._kept()}"
        return f"executor: dropped a batch of cases ({reason}); {self._kept()}"


def died() -> str:
    """Text of the error of a case whose worker died of it."""
    return "WorkerDied: the worker process ended while it ran this case (killed, out of memory, or a crash)"


# ---------------------------------------------------------------- before the run


def _grid(
    axes: Mapping[str, ArrayLike | xr.DataArray],
    attributes: Mapping[str, Mapping[str, Any]],
    batch: int | None,
) -> _store.Grid:
    if len(axes) == 0:
        raise InputError(f"axes = {axes!r}: must map at least one name to its values")
    if batch is not None:
        batch = whole("batch", batch, at_least=1, hint="cases a worker takes at a time")
    values = {name: _axis(name, given) for name, given in axes.items()}
    own = {name: dict(getattr(given, "attrs", {})) for name, given in axes.items()}
    shape = tuple(len(column) for column in values.values())
    return _store.Grid(
        axes=values,
        attributes={name: own.get(name, {}) | dict(attributes.get(name, {})) for name in {*own, *attributes}},
        block_shape=_store.block_shape(shape, batch),
    )


def _axis(name: str, given: object) -> NDArray[Any]:
    _store.check_name("axes", name)
    if name in (_store.ERROR, _store.KEY):
        raise InputError(f"axes: the name {name!r} is taken")
    place = f"axes[{name!r}]"
    values = np.asarray(list(given) if isinstance(given, (range, tuple, Sequence)) else given)
    if values.ndim != 1 or len(values) == 0:
        raise InputError(f"{place} = {given!r}: must be a list of values, at least one")
    if values.dtype.kind in "OT" and all(isinstance(value, str) for value in values):
        values = values.astype(str)
    if values.dtype.kind not in "buifU":
        raise InputError(
            f"{place} = {given!r}: must be numbers, texts or booleans; for records, sweep over their names "
            "and look them up in the case"
        )
    if values.dtype.kind in "buif" and np.isnan(values).any():
        raise InputError(f"{place}: must not hold NaN")
    if len(np.unique(values)) != len(values):
        raise InputError(f"{place}: holds a value twice; for replicas add an axis of their own, such as replica")
    if values.dtype.kind == "U":
        return values.astype(object)
    return values.astype({"b": np.bool_, "u": np.int64, "i": np.int64, "f": np.float64}[values.dtype.kind])


def check_case(case: object, axes: Sequence[str]) -> bool:
    """Refuse a case that does not take the axes; say whether it takes a seed."""
    if not callable(case):
        raise InputError(f"case = {case!r}: must be a function of the axes")
    try:
        parameters = inspect.signature(case).parameters.values()
    except (TypeError, ValueError):
        return False
    named = {p.name: p for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)}
    anything = any(p.kind is p.VAR_KEYWORD for p in parameters)
    called = getattr(case, "__qualname__", repr(case))
    for name in axes:
        if name not in named and not anything:
            raise InputError(f"axes: {called} has no parameter {name!r}; it takes {', '.join(named) or 'none'}")
    for name, parameter in named.items():
        if name not in axes and name != "seed" and parameter.default is parameter.empty:
            raise InputError(
                f"case = {called}: its parameter {name!r} is no axis and has no default; add an axis or bind "
                "it with functools.partial"
            )
    return "seed" in named and "seed" not in axes and not _bound(case, "seed")


def check_measure(place: str, measure: object) -> None:
    """Refuse what cannot be called."""
    if not callable(measure):
        raise InputError(f"{place} = {measure!r}: must be a function of what `case` returns")


def _bound(case: object, name: str) -> bool:
    return name in (getattr(case, "keywords", None) or {})


def _identity(job: Job, grid: _store.Grid, seed: int, fingerprint: object) -> dict[str, str]:
    """What must be equal for a finished case to be the same case, part by part."""
    parts = {"names of the axes": ", ".join(grid.axes)}
    for name, values in grid.axes.items():
        parts[f"axis {name}"] = digest(encode(values.tolist()))
    return parts | identity_of_code({"case": job.case, "measure": job.measure}, seed, fingerprint)


def identity_of_code(functions: Mapping[str, Callable[..., object]], seed: int, fingerprint: object) -> dict[str, str]:
    """Digest what decides the result of a case besides the values of its axes, part by part."""
    parts = {
        "stickslip version": package_version(),
        "seed": str(seed),
        "fingerprint": digest(encode(fingerprint, "fingerprint")),
    }
    for role, function in functions.items():
        for part, value in code_parts(function).items():
            parts[part.replace("code", f"code of {role}", 1)] = value
    return parts


def _provenance(job: Job, grid: _store.Grid, seed: int, identity: Mapping[str, str]) -> str:
    record = {
        "format": _store.FORMAT,
        "format_version": _store.VERSION,
        "stickslip": package_version(),
        "case": name_of(job.case),
        "measure": name_of(job.measure),
        "seed": seed,
        "axes": dict(zip(grid.axes, grid.shape, strict=True)),
        "identity": dict(sorted(identity.items())),
    }
    return json.dumps(record)


def name_of(function: object) -> str:
    """Name of a function, for a person."""
    function = getattr(function, "func", function)  # of functools.partial
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def _open_sink(path: Path, grid: _store.Grid, identity: Mapping[str, str], attrs: Mapping[str, str]) -> _store.Store:
    if not path.exists() or (path.is_dir() and not any(path.iterdir())):
        _store.new_store(path, grid, attrs)
    group, found = _store.read_group(path)
    _store.check_identity(path, found["identity"], identity)
    _store.sweep_up(path)
    cut = tuple(group[_store.KEY].chunks)
    return _store.Store(path, _store.Grid(axes=grid.axes, attributes=grid.attributes, block_shape=cut), group)


def _read_complete(path: Path, grid: _store.Grid, identity: Mapping[str, str]) -> xr.Dataset | None:
    """Return the results if nothing is missing."""
    if path.is_dir() and not any(path.iterdir()):
        return None
    group, found = _store.read_group(path)
    _store.check_identity(path, found["identity"], identity)
    keys = np.asarray(group[_store.KEY][...]).ravel()
    return _store.open_dataset(path) if np.array_equal(keys, grid.keys(identity)) else None


def _report(dataset: xr.Dataset, progress: Callable[[Progress], object] | None) -> None:
    if progress is not None:
        s = summary(dataset)
        progress(Progress(total=s.total, finished=s.total, failed=s.failed, found=s.total))


def _bookkeeping(dataset: xr.Dataset) -> tuple[NDArray[Any], NDArray[Any]]:
    if _store.KEY not in dataset or _store.ERROR not in dataset:
        raise InputError(f"dataset: has no variables {_store.KEY} and {_store.ERROR}; must be the result of a sweep")
    return dataset[_store.KEY].values, dataset[_store.ERROR].values
