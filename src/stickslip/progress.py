"""How far a long computation has come: a function that is called with the fraction done, or a bar."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from stickslip.errors import InputError, shown

Progress = Callable[[float], None]
"""Called with the fraction of the work that is done."""


@contextmanager
def bar(title: str, *, always: bool = False) -> Iterator[Progress]:
    """Show a progress bar on a terminal or, if asked `always`, in a notebook as well; nothing in a pipe."""
    if not (always or sys.stderr.isatty()):
        yield lambda _share: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), transient=True) as shown_bar:
        task = shown_bar.add_task(escape(title), total=1.0)
        yield lambda share: shown_bar.update(task, completed=share)


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
