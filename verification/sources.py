"""Which sources a study depends on: those that compute its values."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable
from functools import cache
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
"""Rooms of the package that every study uses; changes of pictures and files need no new
report.
"""


def fingerprint(rooms: Iterable[str] = COMPUTING) -> str:
    """Return a hash of the sources in these rooms, the same in every folder.

    Syntax trees are hashed, not bytes: neither layout nor comments make a study stale.
    """
    package = ROOT / "src" / "stickslip"
    content = hashlib.sha256()
    for name in rooms:
        place = package / name
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            content.update(f"{file.relative_to(package).as_posix()}\0".encode())
            content.update(_digest(file.read_bytes()))
    return content.hexdigest()[:16]


@cache  # studies share their sources
def _digest(source: bytes) -> bytes:
    """Return a hash of the code of a file, without docstrings."""
    tree = _without_docstrings(ast.parse(source))
    return hashlib.sha256(ast.dump(tree).encode()).digest()


def _without_docstrings(tree: ast.Module) -> ast.Module:
    """Remove all docstrings of a module: they compute nothing."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            continue
        if ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:]
    return tree
