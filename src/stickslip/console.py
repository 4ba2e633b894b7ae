"""Helpers of the command line: progress, executors, signals and output, on a terminal,
in a pipe, or in a log.
"""

from __future__ import annotations

import json as jsonlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from stickslip.errors import InputError
from stickslip.progress import bar

if TYPE_CHECKING:
    from stickslip.sweep import Progress


@contextmanager
def executor_of(
    workers: int | None, processes: bool, scheduler: str | None
) -> Iterator[Any]:
    """Yield the executor of a sweep: threads, processes, or the Dask cluster at an
    address.
    """
    from stickslip.sweep import Processes, Threads

    if scheduler is None:
        yield Processes(workers) if processes else Threads(workers)
        return
    if processes or workers is not None:
        raise InputError(
            "--scheduler: the cluster has its own workers; leave out --workers and "
            "--processes"
        )
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler needs the dask.distributed package: pip install "
            "'stickslip[sweep]'"
        ) from None
    for name in [*logging.root.manager.loggerDict]:
        if name.startswith("distributed"):
            # we report what concerns the user in a line of our own
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client: Any = Client(scheduler, timeout="10s", set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TimeoutError) as error:
        why = (
            f"--scheduler {scheduler}: cannot be reached ({error}); start one with: "
            "dask scheduler"
        )
        raise InputError(why) from None
    try:
        if not client.nthreads():
            print(
                f"no workers yet; start one with: dask worker {scheduler}",
                file=sys.stderr,
            )
        yield client.get_executor()
    finally:
        client.close(timeout=5)


@contextmanager
def working(title: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar; on the first use, explain that it stands still while the
    kernels are compiled.
    """
    from stickslip.kernels._jit import compiled_before

    if not compiled_before():
        print(
            "first use: the solvers are compiled, once; this takes about half a minute",
            file=sys.stderr,
            flush=True,
        )
    with bar(title) as report:
        yield report


@contextmanager
def progress_of(title: str) -> Iterator[Callable[[Progress], None]]:
    """Show the progress of a sweep: a bar on a terminal; elsewhere, as in the log of a
    job, a line every half minute.
    """
    with bar(title, first=0.0, every=30.0) as report:

        def report_cases(p: Progress) -> None:
            words = f"{p.finished} of {p.total} cases" + (
                f", {p.failed} failed" if p.failed else ""
            )
            report(p.finished / p.total, words, p.found / p.total)

        yield report_cases


@contextmanager
def stoppable() -> Iterator[None]:
    """Treat the signals by which a cluster ends a job, or a terminal closes, as Ctrl-C.

    An error after such a signal counts as the interrupt, too: a kernel whose
    compilation is interrupted may fail with any error.
    """
    # only the main thread may handle signals
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    stopped = threading.Event()

    def stop(_number: int, _frame: object) -> None:
        stopped.set()
        raise KeyboardInterrupt

    # an ignored signal stays ignored, as `nohup` requires
    heeded = [
        n
        for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        if signal.getsignal(n) != signal.SIG_IGN
    ]
    before = {n: signal.signal(n, stop) for n in heeded}
    try:
        yield
    except Exception:
        if stopped.is_set():
            raise KeyboardInterrupt from None
        raise
    finally:
        for n, handler in before.items():
            signal.signal(n, handler)


def open_missing_streams() -> None:
    """Discard the output to a stream that the caller has closed, as by `>&-`."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            nowhere = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
            setattr(sys, name, nowhere)


def replace_missing_letters() -> None:
    """Replace letters that the encoding of the terminal lacks, instead of failing."""
    out: Any = sys.stdout  # a caller from Python may have replaced it by any object
    if hasattr(out, "reconfigure") and out.errors == "strict":
        out.reconfigure(errors="replace")


def can_write(letters: str) -> bool:
    """Whether the terminal can show these letters."""
    try:
        letters.encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return False
    return True


def discard_output() -> None:
    """Discard the rest of the output: its reader has closed the pipe, or the disk is
    full.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    with suppress(OSError):  # a caller from Python may have replaced it by any object
        os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def print_json(value: Any) -> None:
    """Print a result for a machine to read."""
    print(jsonlib.dumps(value, indent=2))
