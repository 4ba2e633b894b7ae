"""Reading a measured friction curve from a file that a rig file names: columns of
velocity, friction and, optionally, its error.
"""

import csv
import re
from pathlib import Path

from stickslip.errors import InputError
from stickslip.io import files

_LARGEST = 1_000_000  # bytes
_ERROR = "error|std|standard deviation|uncertainty|sigma"
_NAMES = {
    "velocity": rf"(?!.*({_ERROR})).*(velocity|speed|v\b)",
    "friction": rf"(?!.*({_ERROR})).*(friction|force|coefficient|cof\b|mu\b|f\b)",
    "error": f".*({_ERROR})",
}
"""Patterns of column names; a name that matches that of an error matches no other."""
_UNIT = re.compile(r"[(\[]([^)\]]*)[)\]]")


def friction_points(path: Path) -> list[list[float | str]]:
    """Return the points of a friction curve in the form of a rig file, as quantities
    with the units of the heading.

    Raises `InputError` if the file has no column of velocities, or of friction.
    """
    text = files.read(path, "friction curve", largest=_LARGEST).decode("utf-8-sig")
    lines = [line for line in text.splitlines() if line.strip() and line[0] != "#"]
    heading, *rows = csv.reader(lines) if lines else [[]]
    used = []
    for name, pattern in _NAMES.items():
        known = [i for i, cell in enumerate(heading) if re.match(pattern, cell, re.I)]
        if not known and name != "error":
            raise InputError(
                f"{path.name}: no column of {name} among {', '.join(heading)}; give a "
                "heading such as: velocity (m/s),friction coefficient,error"
            )
        used += known[:1]
    units = [found[1] if (found := _UNIT.search(heading[at])) else "" for at in used]
    # by default, the error has the unit of the friction
    units[2:] = [unit or units[1] for unit in units[2:]]
    points = []
    for i, row in enumerate(rows):
        try:
            numbers = [float(row[at]) for at in used]
        except (ValueError, IndexError):
            raise InputError(
                f"{path.name}: row {i + 1} = {','.join(row)!r}: must be numbers"
            ) from None
        points.append(
            [
                f"{number!r} {unit}" if unit not in ("", "1", "-") else number
                for number, unit in zip(numbers, units, strict=True)
            ]
        )
    return points
