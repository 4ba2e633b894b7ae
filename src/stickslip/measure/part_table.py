"""The parts of a record as a table, a line each."""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from stickslip import words
from stickslip.errors import printable
from stickslip.measure.kinds import SMOOTH

if TYPE_CHECKING:
    from stickslip.measure.regimes import Regime

MOST_LINES = 40
_Number = Callable[["Regime"], float | None]
_COLUMNS: list[tuple[str, str, _Number]] = [
    ("from", "time", lambda part: part.window[0]),
    ("to", "time", lambda part: part.window[1]),
    ("mean", "force", lambda part: part.mean_force),
    ("mu", "", lambda part: part.mean_mu),
    ("peak to peak", "force", lambda part: part.peak_to_peak),
    ("drop", "force", lambda part: part.drop if _cycles(part) else None),
    ("each", "time", lambda part: part.period if _cycles(part) else None),
    ("cycles", "", lambda part: _cycles(part)),
]


def _cycles(part: "Regime") -> int | None:
    """The cycles of a motion that has them."""
    return part.cycles if part.kind != SMOOTH and part.cycles else None


def part_table(parts: Sequence["Regime"]) -> list[str]:
    """The parts of a record as aligned lines."""
    left = len(parts) - MOST_LINES
    more = [f"and {left} more (--json has all)"] if left > 0 else []
    return [*aligned(part_rows(parts)), *more]


def part_rows(parts: Sequence["Regime"]) -> list[tuple[str, ...]]:
    """The titles of a table of the parts of a record, and its rows: when, how the
    slider moves, the force there, and its drops.
    """
    if not parts:
        return []
    shown = parts[:MOST_LINES]
    columns = [["", *(str(k + 1) for k in range(len(shown)))]]
    for title, of, number in _COLUMNS:
        values = [number(part) for part in shown]
        known = [
            abs(value) for value in values if value is not None and math.isfinite(value)
        ]
        if not known:
            continue
        told = {"time": shown[0].time_unit, "force": shown[0].force_unit, "": ""}[of]
        divisor, unit = words.prefixed(max(known), "" if told == "1" else told)
        cells = [
            words.number(value / divisor)
            if value is not None and math.isfinite(value)
            else ""
            for value in values
        ]
        columns.append([f"{title} ({unit})" if unit else title, *cells])
    columns.insert(3, ["motion", *(part.kind for part in shown)])
    return [*zip(*columns, strict=True)]


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Cells of rows below one another, as lines."""
    rows = [[printable(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
