"""Where cases run: threads or processes of this machine, or any executor handed in.

A dask client is one more executor: ``client.get_executor()``.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import contextmanager
from dataclasses import dataclass

from stickslip.errors import InputError, whole
from stickslip.sweep._content import AxisValue
from stickslip.sweep._worker import Job, Outcome, nothing, run_cells, start_worker

Batch = Future[tuple[list[Outcome], float]]

_MANY = 32  # workers supposed behind an executor that does not say how many it has


@dataclass(frozen=True)
class Threads:
    """Run cases in threads of this process: best for compiled kernels, which release the GIL.

    Parameters
    ----------
    workers : int, optional
        Number of threads; by default one per core.
    """

    workers: int | None = None

    def __post_init__(self) -> None:
        _set_workers(self, "Threads.workers", self.workers)


@dataclass(frozen=True)
class Processes:
    """Run cases in spawned processes, for cases that keep the GIL; a process that dies is replaced.

    The functions must be importable: defined at the top of a module, not a lambda. A script that starts
    processes keeps its own start behind ``if __name__ == "__main__":``.

    Parameters
    ----------
    workers : int, optional
        Number of processes; by default one per core.
    """

    workers: int | None = None

    def __post_init__(self) -> None:
        _set_workers(self, "Processes.workers", self.workers)


class Pool:
    """An executor that is running, with what the sweep must know of it. Made by `open_pool`."""

    def __init__(self, given: Threads | Processes | Executor, job: Job) -> None:
        self.given = given
        self._stop = threading.Event()
        self._in_process = isinstance(given, (Threads, ThreadPoolExecutor))
        self._job = job if self._in_process else _pickled(job, given)
        self._executor = self._start()

    @property
    def workers(self) -> int:
        """How many cases run at a time, if the executor says; asked anew, since clusters grow and shrink."""
        if isinstance(self.given, (Threads, Processes)):
            return self.given.workers or 1
        count = getattr(self.given, "_max_workers", None)
        if isinstance(count, int) and count > 0:
            return count
        client = getattr(self.given, "_client", None)  # dask
        if client is not None and hasattr(client, "nthreads"):
            return max(1, int(sum(client.nthreads().values())))
        return _MANY

    @property
    def replaceable(self) -> bool:
        """Whether the pool is ours to build anew."""
        return isinstance(self.given, Processes)

    def submit(self, cells: Sequence[Mapping[str, AxisValue]], seconds: float) -> Batch:
        """Hand in a batch of cases."""
        if self._in_process:
            return self._executor.submit(run_cells, self._job, cells, seconds, self._stop.is_set)
        return self._executor.submit(run_cells, self._job, cells, seconds)

    def rebuild(self) -> None:
        """Replace a pool that has lost a worker."""
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._executor = self._start()

    def close(self, *, in_haste: bool) -> None:
        """End the pool if it is ours; in haste, running cases are given up where that is possible."""
        self._stop.set()
        if not isinstance(self.given, (Threads, Processes)):
            return
        if in_haste:
            for process in list((getattr(self._executor, "_processes", None) or {}).values()):
                process.terminate()
        self._executor.shutdown(wait=True, cancel_futures=True)

    def _start(self) -> Executor:
        match self.given:
            case Threads():
                return ThreadPoolExecutor(self.workers, thread_name_prefix="stickslip-sweep")
            case Processes():
                return self._start_processes()
            case _:
                return self.given

    def _start_processes(self) -> Executor:
        for _ in range(3):  # the worker that answers may itself be killed
            executor = ProcessPoolExecutor(
                self.workers, mp_context=multiprocessing.get_context("spawn"), initializer=start_worker
            )
            try:
                executor.submit(nothing).result()
            except BrokenExecutor:
                executor.shutdown(wait=False, cancel_futures=True)
            else:
                return executor
        raise InputError(
            "executor = Processes(...): no worker process starts; a script that starts processes keeps its "
            'own start behind `if __name__ == "__main__":`'
        )


@contextmanager
def open_pool(given: Threads | Processes | Executor | None, job: Job) -> Iterator[Pool]:
    """Start a pool and end it, also after an error.

    Raises
    ------
    InputError
        If `given` is no executor, or cannot take these functions.
    """
    if given is None:
        given = Threads()
    if not isinstance(given, (Threads, Processes, Executor)):
        hint = " (of a dask client: client.get_executor())" if hasattr(given, "get_executor") else ""
        raise InputError(
            f"executor = {given!r}: must be Threads(n), Processes(n) or a concurrent.futures.Executor{hint}"
        )
    pool = Pool(given, job)
    try:
        yield pool
    except BaseException:
        pool.close(in_haste=True)
        raise
    pool.close(in_haste=False)


def _pickled(job: Job, given: Threads | Processes | Executor) -> bytes:
    """Pickle the job: by reference for processes of this machine, else with cloudpickle if it is there."""
    if not isinstance(given, (Processes, ProcessPoolExecutor)):
        try:
            import cloudpickle  # type: ignore[import-untyped]
        except ImportError:
            pass
        else:
            return bytes(cloudpickle.dumps(job))
    for name, function in (("case", job.case), ("measure", job.measure)):
        try:
            pickle.dumps(function)
        except Exception as error:
            called = getattr(function, "__qualname__", repr(function))
            raise InputError(
                f"{name} = {called}: cannot be sent to another process ({error}); define it at the top of a "
                "module (no lambda, no function inside a function), or use Threads(n)"
            ) from None
    return pickle.dumps(job, protocol=5)


def _set_workers(record: object, place: str, value: int | None) -> None:
    count = len(os.sched_getaffinity(0)) if value is None else whole(place, value, at_least=1)
    object.__setattr__(record, "workers", count)
