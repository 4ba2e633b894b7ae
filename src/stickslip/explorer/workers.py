"""Processes that compute, one question at a time, with limits on time and memory; they
are killed if they do not stop.

The server itself never computes, so no question of one window delays another window.
Workers are forked from a process that has already loaded the kernels, so that a new one
is ready at once.

An answer is a generator of plain data from a document, without state: each part is sent
as soon as it is ready, so that the force trace does not wait for slower parts. It calls
its `Watch` regularly with the completed fraction of the work; the `Watch` raises to end
work for which nobody waits any more.
"""

import asyncio
import multiprocessing
import os
import queue
import resource
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np

from stickslip.errors import InputError, UndecidedError
from stickslip.explorer import documents, fronts, simulate, stability, traces
from stickslip.explorer.plain import Plain, Watch

ANSWERS: Mapping[str, Callable[[Plain, Watch], Iterator[Plain]]] = {
    "run": simulate.run,
    "law": simulate.law,
    "stretchings": simulate.stretchings,
    "contacts": simulate.contacts,
    "edit": simulate.edit,
    "chart": stability.chart,
    "advice": stability.advice,
    "fronts": fronts.fronts,
    "trace": traces.trace,
    "sample": traces.sample,
    "fit": traces.fit,
    "posterior": traces.posterior,
} | {form: partial(simulate.download, form) for form in ("nc", "png", "svg", "toml")}
"""The kinds of questions of a window, and the functions that answer them."""
SLOW = ("chart", "advice", "fronts", "posterior")

Reply = Callable[[Any], object]

GRACE = 1.0  # seconds in which a worker must stop by itself before it is killed
MEMORY = 3_000_000_000  # most bytes of a worker

_STOP = "stop"


class Job(NamedTuple):
    """A question, its kind, and the most seconds that it may take."""

    kind: str
    request: Plain
    seconds: float


class Crew:
    """A pool of workers, started when they are needed, of which `size` work at a time.

    Other jobs wait in the order of their arrival. A window waits with at most one
    question of a kind, so this is fair to all windows.
    """

    def __init__(self, name: str, size: int, niceness: int = 0) -> None:
        self._niceness = niceness
        self._threads = ThreadPoolExecutor(size, name)  # each waits for its worker
        self._idle: queue.LifoQueue[_Worker] = queue.LifoQueue()
        self._closed = False

    async def work(self, job: Job, reply: Reply, dropped: threading.Event) -> None:
        """Do a job; `reply` is called, in another thread, with each part of the answer,
        and finally with ``{"done": True}`` or errors.

        After `dropped` is set there is no reply, and the worker is free again within
        `GRACE`.
        """
        await asyncio.get_running_loop().run_in_executor(
            self._threads, self._work, job, reply, dropped
        )

    def _work(self, job: Job, reply: Reply, dropped: threading.Event) -> None:
        if dropped.is_set() or self._closed:
            return
        try:
            worker = self._idle.get_nowait()
        except queue.Empty:
            worker = _Worker(self._niceness)
        if worker.work(job, reply, dropped) and not self._closed:
            self._idle.put(worker)
        else:
            worker.kill()

    def close(self) -> None:
        """End all workers."""
        self._closed = True
        self._threads.shutdown(wait=False, cancel_futures=True)
        with suppress(queue.Empty):
            while True:  # endless: until no idle worker is left
                self._idle.get_nowait().kill()


class _Worker:
    """A process, and our end of the pipe to it."""

    def __init__(self, niceness: int) -> None:
        self._line, theirs = _FORKS.Pipe()
        self._process = _FORKS.Process(
            target=_serve, args=(theirs, niceness), daemon=True
        )
        self._process.start()
        theirs.close()

    def work(self, job: Job, reply: Reply, dropped: threading.Event) -> bool:
        """Do a job; return whether the worker can do another."""
        try:
            self._line.send(job)
            if self._pass_on(reply, job.seconds, dropped):
                return True
            if not dropped.is_set():
                reply(
                    errors(
                        f"given up after {job.seconds:g} s; take a shorter run, or "
                        "fewer contacts"
                    )
                )
            self._line.send(_STOP)
            return self._pass_on(_ignore, GRACE, threading.Event())
        except (EOFError, OSError):  # killed from outside, usually for its memory
            if not dropped.is_set():
                reply(
                    errors("the computation was killed, most likely for lack of memory")
                )
            return False

    def _pass_on(self, reply: Reply, seconds: float, dropped: threading.Event) -> bool:
        """Pass on each part of an answer; return whether the answer has ended, in these
        seconds and before it was dropped.
        """
        deadline = time.monotonic() + seconds
        # endless: until the deadline
        while not dropped.is_set() and time.monotonic() < deadline:
            if not self._line.poll(0.05):
                continue
            content = self._line.recv()
            if content is None:
                return True
            if not dropped.is_set():
                reply(content)
        return False

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._line.close()


_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["stickslip.explorer.warm"])


def _ignore(content: Plain) -> None:
    """Do nothing with a part of an answer for which nobody waits."""


class _StoppedError(Exception):
    """Raised when nobody waits for this work any more."""


def _serve(line: Connection, niceness: int) -> None:
    # Ctrl-C reaches all processes; the server ends this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(niceness)
    with suppress(ValueError, OSError):  # the limit is lower already
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    with suppress(EOFError, OSError):
        while True:  # endless: until the server closes the pipe
            job = line.recv()
            if job != _STOP:  # a stop that came after the answer is ignored
                _answer(line, job)
                line.send(None)


def _answer(line: Connection, job: Job) -> None:
    last_report = time.monotonic()

    def watch(fraction: float) -> None:
        nonlocal last_report
        if line.poll():
            line.recv()
            raise _StoppedError
        if time.monotonic() - last_report > 0.2:
            last_report = time.monotonic()
            line.send({"progress": fraction})

    try:
        for content in ANSWERS[job.kind](job.request, watch):
            line.send(content)
        line.send({"done": True})
    except _StoppedError:
        return
    except (InputError, UndecidedError) as error:
        line.send({"errors": documents.complaints(error)})
    except MemoryError:
        line.send(errors("not enough memory for this case; take fewer contacts"))
    # not a fault of the package: a document may hold any numbers
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        what = "cannot be computed: its parameters span too many orders of magnitude"
        line.send(errors(f"{what} ({type(error).__name__})"))
    except (EOFError, OSError):
        raise
    # the page continues in any case, and the terminal shows the traceback
    except Exception as error:
        traceback.print_exc()
        line.send(errors(f"this failed: {type(error).__name__}: {error}"))


def errors(message: str) -> Plain:
    """Return an answer that reports a mistake."""
    return {"errors": [{"key": "", "message": message}]}
