"""Run many cases: hand out, gather, write down. Grids and refinements both go this way."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import islice, takewhile
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stickslip import __version__
from stickslip.errors import InputError, whole
from stickslip.sweep._cases import DIED, Function, Job, check_function, failed, identity_of, name_of
from stickslip.sweep._executors import Batch, Pool, Threads, Workers
from stickslip.sweep._table import EVERY, Table

MAX_CASES = 1_000_000
"""Cases beyond which a sweep is refused unless more are asked for: each takes about 1 kB of memory and of the store."""
CYCLES = 30.0
"""Cycles of loading that a run lasts at least."""


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
    names: Sequence[str],
    total: int,
    head: Mapping[str, Any],
    *,
    store: str | PathLike[str] | None,
    executor: Workers | None,
    progress: Callable[[Progress], object] | None,
    options: Options,
) -> Iterator[Runner]:
    """Check what is to be run along some axes, open the table, and make ready; `head` says which cases."""
    check_size(total, options.max_cases)
    seed = options.seed if check_function(function, names) else None
    categories = {name: list(words) for name, words in options.categories.items()}
    content = {
        "about": {"stickslip": __version__, "function": name_of(function), "seed": options.seed},
        "total": total,
        "identity": {} if store is None else identity_of(function, names, options.seed, options.fingerprint),
        "attributes": {
            name: {key: _attribute(value) for key, value in given.items()} for name, given in options.attributes.items()
        },
        "categories": categories,
        "notes": dict(options.notes),
        **head,
    }
    job = Job(function=function, seed=seed, categories=categories)
    with (
        Pool(Threads() if executor is None else executor, job) as pool,
        Table(None if store is None else Path(store), content) as table,
    ):
        if options.retry_failed:
            table.forget_failed()
        yield Runner(table, pool, total, progress)


def _attribute(value: Any) -> Any:
    """Turn an attribute into what both JSON and NetCDF can hold: None and truth values become text."""
    found = np.asarray(value)
    return found.tolist() if found.dtype.kind in "uifU" else str(value)


def check_size(cases: int, max_cases: int) -> None:
    """Refuse a sweep of too many cases before it starts."""
    if cases > max_cases:
        raise InputError(
            f"axes: {cases:.4g} cases are more than max_cases = {max_cases:g}; take fewer values, or set max_cases "
            "higher (each case takes about 1 kB)"
        )


class Runner:
    """Runs cases that the table lacks; one start of a sweep."""

    def __init__(self, table: Table, pool: Pool, total: int, progress: Callable[[Progress], object] | None) -> None:
        self.table = table
        self._pool, self._total, self._progress = pool, total, progress
        self._finished = self._failed = self._found = 0
        self._todo: deque[str] = deque()
        self._running: dict[Batch, list[str]] = {}
        self._losses: Counter[str] = Counter()  # how often the worker of a case has died
        self._size = 1  # of the next batch: twice what the last one came to in its time

    def run(self, keys: Sequence[str]) -> None:
        """Run those of some cases, no two alike, that the table lacks."""
        there = [self.table.has_failed(key) for key in keys if key in self.table.rows]
        self._found += len(there)
        self._finished += len(there)
        self._failed += sum(there)
        self._todo.extend(key for key in keys if key not in self.table.rows)
        self._tell()
        if not self._todo:
            return
        try:
            while self._todo or self._running:
                self._hand_out()
                if self.table.commit(if_due=True):
                    self._tell()
        except BaseException:
            with suppress(InputError):
                self.table.commit()
            raise
        finally:
            for future in self._running:
                future.cancel()
        self.table.commit()
        self._tell()

    def _hand_out(self) -> None:
        """Hand out what there is room for, and note what has finished."""
        try:
            self._fill()
            self._gather(wait(self._running, EVERY, FIRST_COMPLETED).done)
        except BrokenExecutor:
            with suppress(BrokenExecutor):
                self._gather(wait(self._running).done)  # a broken pool ends all its futures, some of them well
            if not self._pool.is_ours:
                raise InputError(
                    f"executor = {self._pool.given!r}: has lost a worker and cannot be built anew from here; "
                    f"{self._kept()}, or use Processes(n), whose lost workers are replaced"
                ) from None
            self._pool.rebuild()
        except RuntimeError as error:  # it was shut down
            raise InputError(f"executor: takes no more cases ({error}); {self._kept()}") from error

    def _fill(self) -> None:
        """Keep two batches per worker on the way; cases that were lost twice run alone, to know the culprit."""
        most = 2 * self._pool.workers
        while self._todo and len(self._running) < most:
            size = min(self._size, math.ceil(len(self._todo) / most))
            batch = [*takewhile(lambda key: self._losses[key] < 2, islice(self._todo, size))]
            if not batch and self._running:
                break
            batch = batch or [self._todo[0]]
            self._running[self._pool.submit(batch)] = batch
            for _ in batch:
                self._todo.popleft()

    def _gather(self, done: set[Batch]) -> None:
        """Note what has finished; `BrokenExecutor` if the pool has lost a worker."""
        broken: BrokenExecutor | None = None
        for future in done:
            keys = self._running.pop(future)
            try:
                rows = future.result()
            except BrokenExecutor as error:
                broken = error
                self._lost(keys, 1)
            except InputError as error:  # a worker cannot load the function
                raise InputError(f"{error}; {self._kept()}") from error
            except Exception as error:
                if type(error).__name__ != "KilledWorker":  # of Dask, after several workers died of this batch
                    raise InputError(f"executor: dropped a batch of cases ({error!r}); {self._kept()}") from error
                self._lost(keys, 2)
            else:
                for key, row in zip(keys, rows, strict=False):
                    self._note(key, row)
                self._todo.extendleft(reversed(keys[len(rows) :]))
                self._size = 2 * len(rows)
        if broken is not None:
            raise broken

    def _note(self, key: str, row: str) -> None:
        self.table.add(key, row)
        self._finished += 1
        self._failed += self.table.has_failed(key)

    def _lost(self, keys: list[str], times: int) -> None:
        """Put back the cases of a batch whose worker died, last those that are to run alone; one lost then is named."""
        if len(keys) == 1 and self._losses[keys[0]] >= 2:
            self._note(keys[0], failed(DIED))
            return
        for key in reversed(keys):
            self._losses[key] += times
            (self._todo.append if self._losses[key] >= 2 else self._todo.appendleft)(key)

    def _tell(self) -> None:
        if self._progress is not None:
            self._progress(Progress(total=self._total, finished=self._finished, failed=self._failed, found=self._found))

    def _kept(self) -> str:
        if self.table.path is None:
            return "nothing is kept without a store"
        return f"{self._finished} of {self._total} cases are kept in {str(self.table.path)!r}: start again"
