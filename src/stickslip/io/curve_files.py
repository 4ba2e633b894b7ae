"""A measured friction curve as a file beside a rig file: columns of velocity, friction
and, if it is known, its error.
"""

import csv
import re
from pathlib import Path

from stickslip.errors import InputError
from stickslip.io import files

_LARGEST = 1_000_000  # bytes
_NAMES = {
    "velocity": r"velocity|speed|v\b",
    "friction": r"friction|force|coefficient|cof\b|mu\b|f\b",
    "error": r"error|std|standard deviation|uncertainty|sigma",
}
_UNIT = re.compile(r"[(\[]([^)\]]*)[)\]]")


def friction_points(path: Path) -> list[list[float | str]]:
    """Read the points of a friction curve as a rig file has them, quantities with the
    units of the heading.

    Raises `InputError` if the file has no column of velocities, or of friction.
    """
    text = files.read(path, "friction curve", largest=_LARGEST).decode("utf-8-sig")
    lines = [line for line in text.splitlines() if line.strip() and line[0] != "#"]
    heading, *rows = csv.reader(lines) if lines else [[]]
    columns = {name: _column(heading, name) for name in _NAMES}
    for name in ("velocity", "friction"):
        if columns[name] is None:
            raise InputError(
                f"{path.name}: no column of {name} among {', '.join(heading)}; give a "
                "heading such as: velocity (m/s),friction coefficient,error"
            )
    used = [at for at in columns.values() if at is not None]
    units = [found[1] if (found := _UNIT.search(heading[at])) else "" for at in used]
    units[2:] = [
        unit or units[1] for unit in units[2:]
    ]  # the error has that of friction
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


def _column(heading: list[str], name: str) -> int | None:
    """First column whose name begins with one of the words; of errors, has one."""
    is_error = re.compile(_NAMES["error"], re.IGNORECASE)
    word = re.compile(_NAMES[name], re.IGNORECASE)
    for i, cell in enumerate(heading):
        if word.search(cell) and (name == "error" or not is_error.search(cell)):
            return i
    return None
