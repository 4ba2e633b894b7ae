"""Run many cases in threads, in processes or on any executor: distribute them, collect
the results, and store them.

A Dask client is one more executor: ``client.get_executor()``.
"""

import json
import math
import multiprocessing
import os
import pickle
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent import futures
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from dataclasses import dataclass
from itertools import islice, takewhile
from multiprocessing.process import BaseProcess
from typing import Annotated

from stickslip.errors import InputError, instance, whole
from stickslip.loops import bounded
from stickslip.model.records import Number, Record
from stickslip.sweep._cases import DIED, NamedStudy, run_batch
from stickslip.sweep._table import EVERY, Store

# longest time of a batch, unless a single case takes longer: long compared with the
# cost of sending it
SECONDS = 0.5
_MANY = 256  # assumed number of workers of an executor that does not give its own

MAX_CASES = 1_000_000
"""Cases beyond which a sweep is refused unless `max_cases` is higher: each takes about
1 kB of memory and of the store.
"""
CYCLES = 30.0  # least number of loading cycles in a run


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Numbers of finished and of failed cases of a sweep."""

    total: int  #: cases of the whole sweep
    #: cases with a result or an error so far, including those of earlier starts
    finished: int
    failed: int  #: cases among them that ended with an error
    #: cases that earlier starts had finished: rate and remaining time follow from
    #: ``finished - found``
    found: int


Report = Callable[[Progress], object]


@dataclass(frozen=True, kw_only=True)
class Runs(Record):
    """Length and results of each case of a sweep, as given by the table ``[run]`` of a
    file.

    A case lasts at least for a travel of the drive, for a duration, and for a number of
    loading cycles.
    """

    #: travel of the drive, in the rig's own units or as a text with a unit
    distance: float | str | None = None
    duration: float | str | None = None  #: likewise
    cycles: Annotated[float, Number(at_least=0, place="run.cycles")] = CYCLES
    #: number of times that a run that cannot be classified is repeated, each time twice
    #: as long
    extensions: Annotated[
        int, Number(at_least=0, at_most=10, place="run.extensions")
    ] = 1
    #: names of the results; see `stickslip.sweep.study.MEASURES`
    measure: Sequence[str] | None = None
    #: cases beyond which the sweep is refused
    max_cases: Annotated[int, Number(at_least=1, place="run.max_cases")] = MAX_CASES
    #: whether a case may take more than an hour, or 4 GB, by its estimate; else it
    #: fails
    long: bool = False


class Threads(ThreadPoolExecutor):
    """Run cases in threads of this process, by default one per core: best for kernels,
    which release the GIL.
    """

    def __init__(self, workers: int | None = None) -> None:
        super().__init__(_number_of_workers("Threads.workers", workers))


class Processes(ProcessPoolExecutor):
    """Run cases in spawned processes, for cases that hold the GIL; a process that dies
    is replaced.

    The function must be importable: defined at the top of a module, not a lambda. A
    script that starts processes must have its own start behind
    ``if __name__ == "__main__":``. By default there is one process per core.
    """

    def __init__(self, workers: int | None = None) -> None:
        context = multiprocessing.get_context("spawn")
        super().__init__(
            _number_of_workers("Processes.workers", workers),
            mp_context=context,
            initializer=_start_worker,
        )


OURS = Threads | Processes


def _number_of_workers(place: str, workers: int | None) -> int:
    """Return the number of workers, by default the number of cores that this process
    may use, which not every system reports.
    """
    if workers is not None:
        return whole(place, workers, at_least=1)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _start_worker() -> None:
    """Prepare a worker process: it ignores Ctrl-C and a closed terminal, which the
    parent handles, and ends with its parent.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    threading.Thread(
        target=_end_with, args=(multiprocessing.parent_process(),), daemon=True
    ).start()


def _end_with(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)  # otherwise it would wait for work forever


def _check_executor(executor: Executor, study: NamedStudy) -> None:
    """Raise `InputError` for any other object, and for a study that its processes
    cannot load.
    """
    instance(
        "executor",
        executor,
        Executor,
        "Threads(n), Processes(n) or a concurrent.futures.Executor (of a Dask "
        "client: client.get_executor())",
    )
    if not isinstance(executor, ProcessPoolExecutor):
        return
    try:
        pickle.dumps(study)
    except Exception as error:
        raise InputError(
            f"NamedStudy.run, {study.name}: cannot be sent to another process "
            f"({error}); define it at the top of "
            "a module (no lambda, no function inside a function), or use Threads(n)"
        ) from None


class Runner:
    """Runs the cases that the store lacks, in one start of a sweep."""

    def __init__(
        self,
        table: Store,
        study: NamedStudy,
        executor: Executor,
        total: int,
        progress: Report | None,
    ) -> None:
        _check_executor(executor, study)
        self.table = table
        self._study = study
        self._executor = executor
        self._total = total
        self._progress = progress
        self._count = Counter(finished=0, failed=0, found=0)
        self._todo: deque[str] = deque()
        self._running: dict[Future[list[str]], list[str]] = {}
        self._lost: set[str] = set()  # cases whose worker has died
        # cases in the next batch: twice the number that the last one finished in time
        self._size = 1

    def run(self, keys: Sequence[str]) -> None:
        """Run the given cases, all different, that the store lacks; after an error,
        abandon the running ones.
        """
        there = [self.table.has_failed(key) for key in keys if key in self.table.rows]
        self._count.update(finished=len(there), failed=sum(there), found=len(there))
        self._todo.extend(key for key in keys if key not in self.table.rows)
        self._report()
        if not self._todo:
            return
        try:
            # endless: a case may take any time
            while self._todo or self._running:
                try:
                    self._fill()
                except RuntimeError as error:
                    self._renew(error)
                self._gather(EVERY)
                if self.table.commit(if_due=True):
                    self._report()
        finally:
            for future in self._running:
                future.cancel()
            self.table.commit()
            if self._running and isinstance(self._executor, OURS):
                processes = getattr(self._executor, "_processes", None) or {}
                for process in [*processes.values()]:
                    process.terminate()
                futures.wait(self._running)
        self._report()

    def _renew(self, error: RuntimeError) -> None:
        """Replace our own executor after a worker has died; raise an error for another
        executor, or after a shutdown.
        """
        executor = self._executor
        if not (isinstance(executor, OURS) and isinstance(error, BrokenExecutor)):
            raise self._refusal(f"takes no more cases ({error})") from error
        futures.wait(self._running)  # a broken pool ends all, some with results
        executor.shutdown(wait=False, cancel_futures=True)
        self._executor = type(executor)(getattr(executor, "_max_workers", None))
        try:
            self._executor.submit(os.getpid).result()
        except BrokenExecutor:
            raise InputError(
                "executor = Processes(...): no worker process starts; a script that "
                "starts processes keeps its own "
                'start behind `if __name__ == "__main__":`'
            ) from None

    def _fill(self) -> None:
        """Submit batches, two per worker; a case whose worker died is run alone, to
        find the culprit.
        """
        most = 2 * getattr(self._executor, "_max_workers", _MANY)
        turns = bounded("Runner: handing out", len(self._todo))
        while self._todo and len(self._running) < most:
            next(turns)
            size = min(self._size, math.ceil(len(self._todo) / most))
            first = islice(self._todo, size)
            batch = [*takewhile(lambda key: key not in self._lost, first)]
            if not batch and self._running:
                break
            batch = batch or [self._todo[0]]
            future = self._executor.submit(run_batch, self._study, batch, SECONDS)
            self._running[future] = batch
            for _ in batch:
                self._todo.popleft()

    def _gather(self, seconds: float) -> None:
        """Collect the results of batches that finish within a time."""
        ended = futures.wait(self._running, seconds, futures.FIRST_COMPLETED).done
        for future in ended:
            keys = self._running.pop(future)
            try:
                rows = future.result()
            except Exception as error:
                # KilledWorker is Dask's, after several workers died on this batch
                died = isinstance(error, BrokenExecutor)
                if not (died or type(error).__name__ == "KilledWorker"):
                    raise self._refusal(
                        f"dropped a batch of cases ({error})"
                    ) from error
                self._put_back(keys)
                continue
            for key, row in zip(keys, rows, strict=False):
                self._enter(key, row)
            self._todo.extendleft(reversed(keys[len(rows) :]))
            self._size = 2 * len(rows)

    def _enter(self, key: str, row: str) -> None:
        self.table.add(key, row)
        self._count.update(finished=1, failed=self.table.has_failed(key))

    def _put_back(self, keys: list[str]) -> None:
        """Put the cases of a batch whose worker died last; a case that ran alone, as it
        was lost before, is the culprit.
        """
        if keys[0] in self._lost:
            self._enter(keys[0], json.dumps(DIED))
            return
        self._lost.update(keys)
        self._todo.extend(keys)

    def _report(self) -> None:
        if self._progress is not None:
            self._progress(Progress(total=self._total, **self._count))

    def _refusal(self, words: str) -> InputError:
        kept = (
            f"{self._count['finished']} of {self._total} cases are kept in "
            f"{str(self.table.path)!r}: start again"
        )
        return InputError(
            f"executor: {words}; "
            f"{kept if self.table.path else 'nothing is kept without a store'}"
        )
