"""The table of the parts of a record, one line for each."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stickslip import words
from stickslip.errors import printable
from stickslip.measure.kinds import SLIPS, SMOOTH

if TYPE_CHECKING:
    from stickslip.measure.regimes import Regime

MOST_LINES = 40
_COLUMNS = {
    "from": "time",
    "to": "time",
    "mean": "force",
    "mu": "",
    "peak to peak": "force",
    "drop": "force",
    "each": "time",
    "cycles": "",
}
"""Columns of the table and the quantity of each."""


def end_of(part: "Regime") -> float:
    """Return the end of a part, or that of the cycle after its last slip if two slips
    are missing.
    """
    end = part.window[1]
    if part.kind == SLIPS and end - part.last_slip > 2.0 * part.period:
        return part.last_slip + part.period
    return end


def _numbers(part: "Regime") -> list[float | None]:
    """Return the numbers of a part, in the order of the columns."""
    found = [
        part.window[0],
        end_of(part),
        part.mean_force,
        part.mean_mu,
        part.peak_to_peak,
    ]
    has_cycles = part.kind != SMOOTH and part.cycles > 0
    of_cycles = [part.drop, part.period, part.cycles]
    return found + (of_cycles if has_cycles else [None] * 3)


def part_table(parts: Sequence["Regime"]) -> list[str]:
    """Return the table of the parts of a record as aligned lines."""
    left = len(parts) - MOST_LINES
    more = [f"and {left} more (--json has all)"] if left > 0 else []
    return [*aligned(part_rows(parts)), *more]


def part_rows(parts: Sequence["Regime"]) -> list[tuple[str, ...]]:
    """Return the titles and the rows of the table of the parts of a record: times, kind
    of motion, force, and drops of each part.
    """
    if not parts:
        return []
    shown = parts[:MOST_LINES]
    columns = [
        [
            "",
            *(str(k + 1) for k in range(len(shown))),
        ]
    ]
    units = {"time": shown[0].time_unit, "force": shown[0].force_unit, "": ""}
    table = np.array([_numbers(part) for part in shown], dtype=float).T
    for (title, of), values in zip(_COLUMNS.items(), table, strict=True):
        known = np.abs(values[np.isfinite(values)])
        if not known.size:
            continue
        plain_unit = "" if units[of] == "1" else units[of]
        divisor, unit = words.prefixed(float(known.max()), plain_unit)
        cells = [
            words.number(value / divisor) if math.isfinite(value) else ""
            for value in values.tolist()
        ]
        columns.append(
            [
                f"{title} ({unit})" if unit else title,
                *cells,
            ]
        )
    columns.insert(3, ["motion", *(part.kind for part in shown)])
    return [*zip(*columns, strict=True)]


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines with aligned columns."""
    rows = [[printable(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
