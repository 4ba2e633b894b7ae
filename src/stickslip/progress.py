"""How far a long computation has come: a function that is called with the fraction done, or a bar."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from stickslip.errors import InputError, shown
from stickslip.words import number

Progress = Callable[[float], None]
"""Called with the fraction of the work that is done."""

LINES_EVERY = 60.0
"""Seconds between the lines in a log."""


@contextmanager
def bar(title: str, *, always: bool = False) -> Iterator[Progress]:
    """Show a progress bar on a terminal or, if asked `always`, in a notebook as well.

    Elsewhere, as in the log of a job, a line with the time every minute.
    """
    if not (always or sys.stderr.isatty()):
        yield _lines(title)
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), transient=True) as shown_bar:
        task = shown_bar.add_task(escape(title), total=1.0)
        yield lambda share: shown_bar.update(task, completed=share)


def _lines(title: str) -> Progress:
    """Write a line now and then; none of what takes less than a minute."""
    begin = due = time.monotonic()

    def line(share: float) -> None:
        nonlocal due
        now = time.monotonic()
        if now >= due + LINES_EVERY and 0.0 < share < 1.0:
            due = now
            left = in_time((now - begin) * (1.0 - share) / share)
            words = f"{title}: {100.0 * share:.0f} %, about {left} left"
            sys.stderr.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {words}\n")
            sys.stderr.flush()

    return line


def in_time(seconds: float) -> str:
    """Say a time as a person would: ``"14 min"``."""
    for size, name in ((31_557_600.0, "years"), (86_400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size:
            return f"{number(seconds / size, 2)} {name}"
    return f"{number(seconds, 2)} s"


@contextmanager
def reporting(progress: Any, title: str) -> Iterator[Progress]:
    """Turn what a caller gave as ``progress=`` into a function: their own, a bar for True, nothing for None or False.

    Raises
    ------
    InputError
        If it is none of these.
    """
    if progress is None or progress is False:
        yield lambda _share: None
    elif progress is True:
        with bar(title, always=True) as report:
            yield report
    elif callable(progress):
        yield progress
    else:
        raise InputError(
            f"{title}: progress = {shown(progress)}: must be True, for a bar, or a function of the fraction done"
        )
