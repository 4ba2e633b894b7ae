"""Where cases run: threads or processes of this machine, or any executor handed in.

A Dask client is one more executor: ``client.get_executor()``.
"""

from __future__ import annotations

import importlib
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import threading
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Self

from stickslip.errors import InputError, whole
from stickslip.sweep._cases import Job, name_of, run_batch

Batch = Future[list[str]]

SECONDS = 0.5
"""Longest that a batch takes, unless one case does: long beside the cost of handing it out."""
_MANY = 32  # workers supposed behind an executor that does not say how many it has


@dataclass(frozen=True)
class _Here:
    workers: int | None = None

    def __post_init__(self) -> None:
        # Cores that this process may use; not every system tells.
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        place = f"{type(self).__name__}.workers"
        object.__setattr__(self, "workers", cores if self.workers is None else whole(place, self.workers, at_least=1))


class Threads(_Here):
    """Run cases in threads of this process: best for compiled kernels, which release the GIL.

    Parameters
    ----------
    workers : int, optional
        Number of threads; by default one per core.
    """


class Processes(_Here):
    """Run cases in spawned processes, for cases that keep the GIL; a process that dies is replaced.

    The function must be importable: defined at the top of a module, not a lambda. A script that starts processes keeps
    its own start behind ``if __name__ == "__main__":``.

    Parameters
    ----------
    workers : int, optional
        Number of processes; by default one per core.
    """


Workers = Threads | Processes | Executor


class Pool:
    """An executor that runs the cases of a job, begun with the first of them."""

    def __init__(self, given: Workers, job: Job) -> None:
        if not isinstance(given, (Threads, Processes, Executor)):
            hint = " (of a Dask client: client.get_executor())" if hasattr(given, "get_executor") else ""
            raise InputError(
                f"executor = {given!r}: must be Threads(n), Processes(n) or a concurrent.futures.Executor{hint}"
            )
        self.given = given
        self.is_ours = isinstance(given, (Threads, Processes))
        self._job = job if isinstance(given, (Threads, ThreadPoolExecutor)) else _pickled(job, given)

    @cached_property
    def _executor(self) -> Executor:
        match self.given:
            case Threads(workers=workers):
                return ThreadPoolExecutor(workers, thread_name_prefix="stickslip-sweep")
            case Processes(workers=workers):
                context = multiprocessing.get_context("spawn")
                executor = ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker)
                try:
                    executor.submit(os.getpid).result()
                except BrokenExecutor:
                    raise InputError(
                        "executor = Processes(...): no worker process starts; a script that starts processes keeps "
                        'its own start behind `if __name__ == "__main__":`'
                    ) from None
                return executor
            case _:
                return self.given

    @property
    def workers(self) -> int:
        """How many cases run at a time, if the executor says; asked anew, since clusters grow and shrink."""
        with suppress(Exception):  # a cluster out of reach: the batches will say so
            if (client := getattr(self._executor, "_client", None)) is not None:  # of Dask
                return max(1, int(sum(client.nthreads().values())))
        return getattr(self._executor, "_max_workers", None) or _MANY

    def submit(self, keys: Sequence[str]) -> Batch:
        """Hand in a batch of cases."""
        return self._executor.submit(run_batch, self._job, keys, SECONDS)

    def rebuild(self) -> None:
        """Replace an executor that has lost a worker, if it is ours."""
        self._executor.shutdown(wait=False, cancel_futures=True)
        del self._executor

    def __enter__(self) -> Self:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        """End the executor if it is ours; after an error, running cases are given up where that is possible."""
        if self.is_ours and "_executor" in vars(self):
            if error is not None:
                for process in list((getattr(self._executor, "_processes", None) or {}).values()):
                    process.terminate()
            self._executor.shutdown(wait=True, cancel_futures=True)


def _pickled(job: Job, given: Workers) -> bytes:
    """Pickle the job: by reference for processes of this machine, else with cloudpickle if it is there."""
    by = pickle
    if not isinstance(given, (Processes, ProcessPoolExecutor)):
        with suppress(ImportError):
            by = importlib.import_module("cloudpickle")
    try:
        return bytes(by.dumps(job))
    except Exception as error:
        raise InputError(
            f"function = {name_of(job.function)}: cannot be sent to another process ({error}); define it at the top of "
            "a module (no lambda, no function inside a function), or use Threads(n)"
        ) from None


def _start_worker() -> None:
    """Prepare a worker process: deaf to Ctrl-C and to a closed terminal (the parent decides), gone with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _follow(sentinel: int) -> None:
    # Without this, workers whose parent was killed wait for work for ever.
    multiprocessing.connection.wait([sentinel])
    os._exit(1)
