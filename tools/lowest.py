"""Print the lowest versions that pyproject.toml allows, as a constraints file for pip.

    python tools/lowest.py > lowest.txt
    pip install -c lowest.txt -e '.[sweep,explorer,traces]'

`make lowest` runs the tests in an environment of these versions, so that the lower
bounds are true.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

PROJECT = Path(__file__).resolve().parent.parent / "pyproject.toml"
EXTRAS = ("sweep", "explorer", "traces")
"""Extras that users install; development tools may be newer."""


def requirements(
    project: dict[str, Any], extras: Iterable[str] = EXTRAS
) -> Iterator[Requirement]:
    """Yield the requirements of the project and of its extras."""
    optional = project["optional-dependencies"]
    for text in [
        *project["dependencies"],
        *(text for extra in extras for text in optional[extra]),
    ]:
        yield Requirement(text)


def lowest(requirement: Requirement) -> str:
    """Return a requirement pinned to the lowest version that it allows."""
    bounds = [
        bound.version for bound in requirement.specifier if bound.operator == ">="
    ]
    if len(bounds) != 1:
        sys.exit(f"{requirement}: must have one lower bound, as in name>=1.2")
    return f"{requirement.name}=={bounds[0]}"


if __name__ == "__main__":
    for needed in requirements(
        tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    ):
        print(lowest(needed))
