"""Where cases run: threads or processes of this machine, or any executor handed in.

A Dask client is one more executor: ``client.get_executor()``.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import threading
import time
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import Self

from stickslip.errors import InputError, whole
from stickslip.sweep._cases import Job, Values, name_of, run_batch

Batch = Future[tuple[list[str], float]]

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
    """An executor that is running, with what the sweep must know of it."""

    def __init__(self, given: Workers, job: Job) -> None:
        self.given = given
        self._job = job if isinstance(given, (Threads, ThreadPoolExecutor)) else _pickled(job, given)
        self._executor = self._start()
        self._seen, self._ask_at = _MANY, 0.0

    @property
    def workers(self) -> int:
        """How many cases run at a time, if the executor says; asked anew, since clusters grow and shrink."""
        if isinstance(self.given, (Threads, Processes)):
            return self.given.workers or 1
        count = getattr(self.given, "_max_workers", None)
        if isinstance(count, int) and count > 0:
            return count
        client = getattr(self.given, "_client", None)  # Dask
        if client is not None and time.monotonic() > self._ask_at:
            with suppress(Exception):  # out of reach: the batches will say so
                self._seen = max(1, int(sum(client.nthreads().values())))
            self._ask_at = time.monotonic() + 2.0
        return self._seen

    @property
    def is_ours(self) -> bool:
        """Whether the pool was started here, and can be built anew."""
        return isinstance(self.given, (Threads, Processes))

    def submit(self, batch: Sequence[Values], seconds: float) -> Batch:
        """Hand in a batch of cases."""
        return self._executor.submit(run_batch, self._job, batch, seconds)

    def rebuild(self) -> None:
        """Replace a pool that has lost a worker."""
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._executor = self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        """End the pool if it is ours; after an error, running cases are given up where that is possible."""
        if not self.is_ours:
            return
        if error is not None:
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
            context = multiprocessing.get_context("spawn")
            executor = ProcessPoolExecutor(self.workers, mp_context=context, initializer=_start_worker)
            try:
                executor.submit(os.getpid).result()
            except BrokenExecutor:
                executor.shutdown(wait=False, cancel_futures=True)
            else:
                return executor
        raise InputError(
            "executor = Processes(...): no worker process starts; a script that starts processes keeps its "
            'own start behind `if __name__ == "__main__":`'
        )


def check_executor(given: Workers | None) -> Workers:
    """Return the executor, threads by default; refuse what is none."""
    if given is None:
        return Threads()
    if not isinstance(given, (Threads, Processes, Executor)):
        hint = " (of a Dask client: client.get_executor())" if hasattr(given, "get_executor") else ""
        raise InputError(
            f"executor = {given!r}: must be Threads(n), Processes(n) or a concurrent.futures.Executor{hint}"
        )
    return given


def _pickled(job: Job, given: Workers) -> bytes:
    """Pickle the job: by reference for processes of this machine, else with cloudpickle if it is there."""
    if not isinstance(given, (Processes, ProcessPoolExecutor)):
        try:
            import cloudpickle  # type: ignore[import-untyped]
        except ImportError:
            pass
        else:
            return bytes(cloudpickle.dumps(job))
    try:
        return pickle.dumps(job, protocol=5)
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
