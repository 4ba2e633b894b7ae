"""Which sources a study is about: those that compute what it measures."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]
COMPUTING = (
    "model",
    "kernels",
    "sliding",
    "rigid.py",
    "theory.py",
    "simulation",
    "stability",
    "cycles",
    "measure",
)
"""What every study goes through, of the package; pictures and files may change
without a new report.
"""


def fingerprint(rooms: Iterable[str] = COMPUTING) -> str:
    """Return a hash of the sources in these rooms, the same wherever they lie."""
    package = ROOT / "src" / "stickslip"
    content = hashlib.sha256()
    for name in rooms:
        place = package / name
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            content.update(f"{file.relative_to(package).as_posix()}\0".encode())
            content.update(file.read_bytes() + b"\0")
    return content.hexdigest()[:16]
