"""Bounds of loops that search, halve or wait for an end: none goes on for ever."""

from __future__ import annotations

from collections.abc import Iterator

HALVINGS = 2100
"""Turns of a loop that halves or doubles a number: the powers of 2 of a double are
2,098. A factor of 6 % a turn goes beyond 1e50 in as many.
"""


def bounded(place: str, most: int) -> Iterator[int]:
    """Count the turns of a loop from 1 on, one for each `next`.

    Raises `RuntimeError` after the most that the loop at this place can take if it
    gets on.

    >>> from stickslip.loops import bounded
    >>> turns = bounded("halving", 64)
    >>> width = 1.0
    >>> while width > 0.1:
    ...     width = 0.5 * width
    ...     turn = next(turns)
    >>> turn
    4
    """
    yield from range(1, most + 1)
    raise RuntimeError(
        f"{place}: no end after {most} turns: a fault of this package, please report it"
    )
