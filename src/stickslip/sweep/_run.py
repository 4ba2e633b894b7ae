"""Run many cases: hand out, gather, write down. Grids and refinements both go this way."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, wait
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from stickslip.errors import InputError, whole
from stickslip.sweep._cases import (
    DIED,
    CannotLoadError,
    Function,
    Job,
    Values,
    case_key,
    check_function,
    failed,
    identity_of,
    name_of,
    package_version,
)
from stickslip.sweep._executors import Batch, Pool, Workers, check_executor
from stickslip.sweep._table import Table

SECONDS = 0.5
"""Aim for the duration of a batch: long beside the cost of handing it out, short beside what a kill may cost."""
LARGEST_BATCH = 1000
MAX_CASES = 1_000_000
"""Cases beyond which a sweep is refused unless more are asked for: each takes about 1 kB of memory and of the store."""
CYCLES = 30.0
"""Cycles of loading that a run lasts at least."""
CHANCES = 3
"""Times a case may be lost with its worker, or dropped, before it is held to be the cause."""


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
class Runs:
    """What each case of a sweep is, as the table ``[run]`` of a file says.

    Parameters
    ----------
    distance, duration : float or str, optional
        A run lasts until the drive has gone this far and for this long, in the rig's own units or as texts with a unit.
    cycles : float
        And through this many cycles of loading.
    extensions : int
        How often a run that cannot be classified is made again, twice as long.
    measure : sequence of str, optional
        What is in the results; see `stickslip.sweep.study.MEASURES`.
    max_cases : int
        Cases beyond which the sweep is refused.
    """

    distance: float | str | None = None
    duration: float | str | None = None
    cycles: float = CYCLES
    extensions: int = 1
    measure: Sequence[str] | None = None
    max_cases: int = MAX_CASES


@dataclass(frozen=True, kw_only=True)
class Options:
    """What else a sweep may be told.

    Parameters
    ----------
    seed : int
        Seed of the sweep, at least 0: a function with a parameter ``seed`` that is no axis is handed a seed of its own,
        an int made from this one and the values of the axes.
    attributes : mapping
        Attributes (``units``, ``long_name``) by name of axis or measured variable.
    categories : mapping of str to list of str
        The words that a measured text can be: it becomes an integer with CF flags, -1 where there is no result.
    fingerprint : object, optional
        Anything else that results depend on: the text of a configuration file, the version of another package, code
        that the function calls. The function's own code and the version of this package are looked after.
    notes : mapping of str to str
        Texts to keep with the results, as attributes of the Dataset; what a case is does not depend on them.
    retry_failed : bool
        Whether cases that failed in an earlier start are run again.
    max_cases : int
        Cases beyond which a sweep is refused before it starts.

    Raises
    ------
    InputError
        If the seed or the number of cases is no whole number in range.
    """

    seed: int = 0
    attributes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    categories: Mapping[str, Sequence[str]] = field(default_factory=dict)
    fingerprint: object = None
    notes: Mapping[str, str] = field(default_factory=dict)
    retry_failed: bool = False
    max_cases: int = MAX_CASES

    def __post_init__(self) -> None:
        whole("seed", self.seed, at_least=0)
        whole("max_cases", self.max_cases, at_least=1)


@contextmanager
def started(
    function: Function,
    content: Mapping[str, Any],
    names: Sequence[str],
    total: int,
    *,
    store: str | PathLike[str] | None,
    executor: Workers | None,
    progress: Callable[[Progress], object] | None,
    options: Options,
) -> Iterator[Runner]:
    """Check what is to be run, open the table, and make ready to run cases; `content` is what the head adds."""
    check_size(total, options.max_cases)
    asks_seed = check_function(function, names)
    categories = {name: list(words) for name, words in options.categories.items()}
    job = Job(function=function, seed=options.seed if asks_seed else None, categories=categories)
    head = {
        "format": "stickslip-sweep",
        "stickslip": package_version(),
        "function": name_of(function),
        "seed": options.seed,
        "identity": {} if store is None else identity_of(function, names, options.seed, options.fingerprint),
        "attributes": {name: dict(given) for name, given in options.attributes.items()},
        "categories": categories,
        "notes": dict(options.notes),
        **content,
    }
    with ExitStack() as held:
        table = held.enter_context(Table(None if store is None else Path(store), head))
        if options.retry_failed:
            table.forget_failed()
        yield Runner(job, table, check_executor(executor), total, progress, held)


def check_size(cases: int, max_cases: int) -> None:
    """Refuse a sweep of too many cases before it starts."""
    if cases > max_cases:
        raise InputError(
            f"axes: {cases:.4g} cases are more than max_cases = {max_cases:g}; take fewer values, or set max_cases "
            "higher (each case takes about 1 kB)"
        )


class Runner:
    """Runs cases that the table lacks; one start of a sweep."""

    def __init__(
        self,
        job: Job,
        table: Table,
        executor: Workers,
        total: int,
        progress: Callable[[Progress], object] | None,
        held: ExitStack,
    ) -> None:
        self._job, self.table, self._executor = job, table, executor
        self._total, self._progress, self._held = total, progress, held
        self._pool: Pool | None = None
        self._finished = self._failed = self._found = 0
        self._per_case: float | None = None  # seconds, as last seen

    def run(self, cases: Sequence[Values]) -> None:
        """Run those of some cases, no two alike, that the table lacks."""
        self._cases = cases
        self._todo: deque[int] = deque()
        self._suspects: deque[int] = deque()  # lost each time when workers died: run alone, to know the culprit
        self._losses: Counter[int] = Counter()
        self._running: dict[Batch, list[int]] = {}
        for i, values in enumerate(cases):
            key = case_key(values)
            if key in self.table.keys:
                self._found += 1
                self._count(key)
            else:
                self._todo.append(i)
        if self._todo and self._pool is None:
            self.table.claim()
            self._pool = self._held.enter_context(Pool(self._executor, self._job))
        self._tell()
        if self._pool is None or not self._todo:
            return
        try:
            self._hand_out(self._pool)
        except BaseException:
            with suppress(InputError):
                self.table.commit()
            raise
        finally:
            for future in self._running:
                future.cancel()
        self.table.commit()
        self._tell()

    def _hand_out(self, pool: Pool) -> None:
        while self._todo or self._suspects or self._running:
            intact = self._fill(pool)
            due = self.table.until_commit()
            done, _ = wait(self._running, 1.0 if due is None else due, FIRST_COMPLETED)
            if not self._gather(done) or not intact:
                self._replace(pool)
            if self.table.until_commit() == 0.0:
                self.table.commit()
                self._tell()

    def _fill(self, pool: Pool) -> bool:
        """Keep two batches per worker on the way; false if the pool is broken."""
        workers = pool.workers
        try:
            while self._todo and len(self._running) < 2 * workers:
                self._submit(pool, self._next_batch(workers))
            if self._suspects and not self._running:
                self._submit(pool, [self._suspects.popleft()])
        except BrokenExecutor:
            return False
        except RuntimeError as error:  # it was shut down
            raise InputError(f"executor: takes no more cases ({error}); {self._kept()}") from error
        return True

    def _submit(self, pool: Pool, cases: list[int]) -> None:
        try:
            future = pool.submit([self._cases[i] for i in cases], SECONDS)
        except BaseException:
            self._todo.extendleft(reversed(cases))
            raise
        self._running[future] = cases

    def _next_batch(self, workers: int) -> list[int]:
        """Take as many cases as fill a batch, fewer towards the end."""
        size = 1
        if self._per_case is not None:
            full = SECONDS / max(self._per_case, 1e-9)
            shared = max(len(self._todo) / (2 * workers), 0.1 * full)  # all workers end nearly together
            size = max(1, int(min(LARGEST_BATCH, full, shared)))
        return [self._todo.popleft() for _ in range(min(size, len(self._todo)))]

    def _gather(self, done: set[Batch]) -> bool:
        """Note what has finished; false if the pool has lost a worker."""
        intact = True
        for future in done:
            cases = self._running.pop(future)
            try:
                rows, seconds = future.result()
            except BrokenExecutor:
                intact = False
                self._lost(cases)
            except (CancelledError, CannotLoadError) as error:
                raise InputError(self._trouble(error)) from error
            except Exception as error:
                # KilledWorker: of Dask, after several workers died of this batch. Others: a result lost on the way.
                if type(error).__name__ == "KilledWorker":
                    for i in cases:
                        self._losses[i] += CHANCES - (2 if len(cases) > 1 else 1)
                elif all(self._losses[i] + 1 >= CHANCES for i in cases):
                    raise InputError(self._trouble(error)) from error
                self._lost(cases)
            else:
                for i, row in zip(cases, rows, strict=False):
                    self._note(i, row)
                self._todo.extendleft(reversed(cases[len(rows) :]))
                self._per_case = seconds / len(rows)
        return intact

    def _note(self, i: int, row: str) -> None:
        key = case_key(self._cases[i])
        self.table.add(key, row)
        self._count(key)

    def _count(self, key: str) -> None:
        self._finished += 1
        self._failed += key in self.table.failed

    def _lost(self, cases: list[int]) -> None:
        """Put back the cases of a batch that was lost; those lost again and again run alone, then are named."""
        self._losses.update(cases)
        if len(cases) == 1 and self._losses[cases[0]] >= CHANCES:
            self._note(cases[0], failed(DIED))
            return
        self._suspects.extend(i for i in cases if self._losses[i] >= CHANCES - 1)
        self._todo.extendleft(reversed([i for i in cases if self._losses[i] < CHANCES - 1]))

    def _replace(self, pool: Pool) -> None:
        """Build the pool anew and give the cases that were in flight another chance."""
        done, _ = wait(self._running)  # a broken pool ends all its futures, some of them well
        self._gather(done)
        if not pool.is_ours:
            raise InputError(
                f"executor = {pool.given!r}: has lost a worker and cannot be built anew from here; "
                f"{self._kept()}, or use Processes(n), whose lost workers are replaced"
            )
        pool.rebuild()

    def _tell(self) -> None:
        if self._progress is not None:
            self._progress(Progress(total=self._total, finished=self._finished, failed=self._failed, found=self._found))

    def _kept(self) -> str:
        if self.table.path is None:
            return "nothing is kept without a store"
        return f"{self._finished} of {self._total} cases are kept in {str(self.table.path)!r}: start again"

    def _trouble(self, error: BaseException) -> str:
        if isinstance(error, CannotLoadError):
            return f"{error}; {self._kept()}"
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
        return f"executor: dropped a batch of cases ({reason}); {self._kept()}"
