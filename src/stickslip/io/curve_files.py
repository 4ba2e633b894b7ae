"""Reading a measured friction curve from a file that a rig file names: columns of
velocity, friction and, optionally, its error.
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
_MEANT = {"velocity": ["velocity"], "friction": ["coefficient", "force"]}
"""What a heading may mean, the preferred first."""


def friction_points(path: Path) -> list[list[float | str]]:
    """Return the points of a friction curve in the form of a rig file, as quantities
    with the units of the heading.

    Raises `InputError` if the file has no column of velocities, or of friction, or
    several.
    """
    raw = files.read(path, "friction curve", largest=_LARGEST)
    try:
        table = read_table(raw)
        used = [_column(table, name) for name in _MEANT]
        used += [i for i in table.numeric if _is_error(table, i)][:1]
        read = table.read(used)
        for row in np.argwhere(~np.isfinite(list(read.values())))[:1, 1].tolist():
            line = int(table.rows[row])
            raise InputError(f"line {line} = {table.line(line)!r}: must be numbers")
    except InputError as error:
        raise InputError(f"{path.name}: {error}") from None
    units = [table.headings[i].unit for i in used]
    # the error has that of friction
    units[2:] = [unit or units[1] for unit in units[2:]]
    columns = [
        [_with_unit(value, unit) for value in read[i].tolist()]
        for i, unit in zip(used, units, strict=True)
    ]
    return [list(point) for point in zip(*columns, strict=True)]


def _column(table: Table, name: str) -> int:
    """The place of the column of velocities, or of friction."""
    for meant in _MEANT[name]:
        found = [
            i
            for i in table.numeric
            if table.headings[i].quantity == meant and not _is_error(table, i)
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
    return bool(_ERROR.search(table.headings[place].name))


def _with_unit(value: float, unit: str) -> float | str:
    """A quantity as a rig file has it."""
    kind, size = unit_named(unit) or ("", 1.0)
    is_number = not unit or kind in ("number", "percentage")
    # the last digit of the file may say how well it is known
    number = float(f"{value * size if is_number else value:.15g}")
    return number if is_number else f"{number!r} {unit}"
