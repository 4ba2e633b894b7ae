"""Which sources a report is about: those that compute what the studies measure."""

from __future__ import annotations

import hashlib
from pathlib import Path

ROOT = Path(__file__).parents[1]
VERIFIED = ("kernels", "simulation", "stability", "cycles", "theory.py", "rigid.py")
"""Rooms and modules of the package; words, pictures and files may change without a new report."""


def fingerprint() -> str:
    """Return a hash of the verified sources, the same wherever they lie."""
    package = ROOT / "src" / "stickslip"
    content = hashlib.sha256()
    for name in VERIFIED:
        place = package / name
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            content.update(f"{file.relative_to(package).as_posix()}\0".encode())
            content.update(file.read_bytes() + b"\0")
    return content.hexdigest()[:16]
