"""Bounds of loops that search, bisect, or wait for an end: none runs for ever."""

from __future__ import annotations

from collections.abc import Iterator

HALVINGS = 2100
"""Most turns of a loop that halves or doubles a number: doubles have 2,098 powers of 2.
A factor of 1.06 per turn exceeds 1e50 in as many.
"""


def bounded(place: str, most: int) -> Iterator[int]:
    """Count the turns of a loop from 1, one for each `next`.

    Raises `RuntimeError` after `most` turns, which a loop that makes progress never
    needs; the message names its `place`.

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
