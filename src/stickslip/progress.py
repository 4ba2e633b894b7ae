"""Progress of a long computation: a function that is called with the fraction done, a
bar, or lines in a log.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from stickslip.errors import InputError, refused, shown
from stickslip.words import number

Progress = Callable[[float], None]
"""Called with the fraction of the work that is done."""


def unheard(_done: float) -> None:
    """Report the progress to nobody."""


def heard(progress: Progress | None) -> Progress:
    """Return what is called with the progress: `unheard` for None; `InputError` if it
    cannot be called.
    """
    if progress is None:
        return unheard
    if not callable(progress):
        raise refused("progress", progress, "must be a function of the fraction done")
    return progress


def part(report: Progress, begin: float, end: float) -> Progress:
    """Return a function that reports the progress of a part of the work, which extends
    from one fraction of the whole to another.
    """
    return lambda done: report(begin + (end - begin) * done)


@contextmanager
def bar(
    title: str, *, always: bool = False, first: float = 60.0, every: float = 60.0
) -> Iterator[Callable[..., None]]:
    """Show a progress bar on a terminal or, with `always`, also in a notebook.

    Elsewhere, as in the log of a job, write a line with the time and the words given,
    after `first` s, and then every `every` s.
    """
    if not (always or sys.stderr.isatty()):
        yield _log_of(title, first, every)
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), transient=True) as shown_bar:
        task = shown_bar.add_task(escape(title), total=1.0)
        yield lambda done, *_: shown_bar.update(task, completed=done)


def _log_of(title: str, first: float, every: float) -> Callable[..., None]:
    begin = time.monotonic()
    due = begin + first

    def write(done: float, words: str = "", since: float = 0.0) -> None:
        """Write a line, if one is due and the work is not finished; `since` is the
        fraction that was done at the start.
        """
        nonlocal due
        now = time.monotonic()
        if now >= due and done < 1.0:
            due = now + every
            left = (
                f", about {in_time((now - begin) * (1.0 - done) / (done - since))} left"
                if done > since
                else ""
            )
            words = words or f"{100.0 * done:.0f} %"
            sys.stderr.write(
                f"{time.strftime('%Y-%m-%d %H:%M:%S')} {title}: {words}{left}\n"
            )
            sys.stderr.flush()

    return write


def in_time(seconds: float) -> str:
    """Return a time in words, in a suitable unit: ``"14 min"``."""
    for size, name in (
        (31_557_600.0, "years"),
        (86_400.0, "days"),
        (3600.0, "h"),
        (60.0, "min"),
    ):
        if seconds >= 2 * size:
            return f"{number(seconds / size, 2)} {name}"
    return f"{number(seconds, 2)} s"


@contextmanager
def reporting(progress: Any, title: str) -> Iterator[Progress]:
    """Turn the argument ``progress=`` into a function: that of the caller, a bar for
    True, or one that does nothing.
    """
    if progress is None or progress is False:
        yield unheard
    elif progress is True:
        with bar(title, always=True) as report:
            yield report
    elif callable(progress):
        yield progress
    else:
        raise InputError(
            f"{title}: progress = {shown(progress)}: must be True, for a bar, or a "
            "function of the fraction done"
        )
