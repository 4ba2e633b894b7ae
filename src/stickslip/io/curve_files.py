"""Reading of measured friction curves from files that a rig file names: columns of
velocity, friction and, optionally, the error of friction.
"""

import re
from pathlib import Path

import numpy as np

from stickslip.errors import InputError
from stickslip.io import files
from stickslip.io.headings import unit_named
from stickslip.io.table_files import read_table
from stickslip.io.table_text import Table

_LARGEST = 1_000_000  # bytes
_ERROR = re.compile("error|std|standard deviation|uncertainty|sigma", re.I)
_QUANTITIES = {"velocity": ["velocity"], "friction": ["coefficient", "force"]}
"""Quantities of either column, the preferred one first."""


def friction_points(path: Path) -> list[list[float | str]]:
    """Return the points of a friction curve in the form of a rig file, as quantities
    with the units in the headings.

    Raises `InputError` if the file has no column of velocities or of friction, or
    several, or a cell without a number.
    """
    raw = files.read(path, "friction curve", largest=_LARGEST)
    try:
        table = read_table(raw)
        used = [_column(table, name) for name in _QUANTITIES]
        used += [i for i in table.numeric if _is_error(table, i)][:1]
        read = table.read(used)
        are_numbers = np.isfinite([*read.values()]).all(axis=0)
        if not are_numbers.all():
            line = int(table.rows[np.argmin(are_numbers)])
            raise InputError(f"line {line} = {table.line(line)!r}: must be numbers")
    except InputError as error:
        raise InputError(f"{path.name}: {error}") from None
    units = [table.headings[i].unit for i in used]
    # by default, the error has the unit of friction
    units[2:] = [unit or units[1] for unit in units[2:]]
    columns = [
        [_with_unit(value, unit) for value in read[i].tolist()]
        for i, unit in zip(used, units, strict=True)
    ]
    return [list(point) for point in zip(*columns, strict=True)]


def _column(table: Table, name: str) -> int:
    """Return the index of the column of velocities, or of friction."""
    for quantity in _QUANTITIES[name]:
        found = [
            i
            for i in table.numeric
            if table.headings[i].quantity == quantity and not _is_error(table, i)
        ]
        if len(found) == 1:
            return found[0]
        if found:
            break
    raise InputError(
        f"no column of {name}, or several, among {table.listed()}; give one heading "
        "such as: velocity (m/s),friction coefficient,error"
    )


def _is_error(table: Table, place: int) -> bool:
    """Return whether a column holds errors, by its name."""
    return bool(_ERROR.search(table.headings[place].name))


def _with_unit(value: float, unit: str) -> float | str:
    """Return a quantity in the form of a rig file: a number, or a text with a unit."""
    kind, size = unit_named(unit) or ("", 1.0)
    is_number = not unit or kind in ("number", "percentage")
    # round to the digits of the file, which may show the precision
    number = float(f"{value * size if is_number else value:.15g}")
    return number if is_number else f"{number!r} {unit}"
