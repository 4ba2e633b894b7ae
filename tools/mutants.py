"""Turn one operator or comparison at a time and see whether the tests notice: `python tools/mutants.py [COUNT [SEED]]`.

Each mutant is a copy of the package with one change, tried against the quick tests of its room. A mutant that lives
names its place; either a test is missing, or the change makes no difference (an equivalent mutant).

    python tools/mutants.py 20 7          twenty mutants drawn with seed 7
    python tools/mutants.py --at src/stickslip/io/datasets.py:166
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "stickslip"
LIMIT = 600
"""Seconds for the tests of one mutant; a mutant that hangs is caught."""

TESTS = {
    "cycles.py": "test_cycles",
    "errors.py": "test_errors test_arguments",
    "io/datasets.py": "test_store test_damaged",
    "io/files.py": "test_files",
    "io": "test_rig test_store",
    "kernels/cohorts.py": "test_cohorts test_simulate",
    "kernels/between_events.py": "test_contacts test_thermal_runs",
    "kernels/event_queue.py": "test_contacts",
    "kernels/events.py": "test_contacts test_simulate test_turning_drives",
    "kernels/flight.py": "test_contacts test_simulate test_turning_drives",
    "kernels/growth.py": "test_ageing test_simulate_ageing",
    "kernels/langevin": "test_ageing test_simulate_ageing",
    "kernels/oscillator.py": "test_contacts test_simulate test_turning_drives",
    "kernels/renewal.py": "test_renewal test_rigid",
    "kernels": "test_contacts test_cohorts test_simulate test_ageing",
    "measure": "test_measure test_traces",
    "model/distributions.py": "test_distributions",
    "model/quantities.py": "test_quantities",
    "model/units.py": "test_units test_quantities test_rig",
    "model": "test_model test_drive test_rig test_units",
    "rigid.py": "test_rigid",
    "simulation": "test_simulate test_contacts test_work",
    "stability": "test_stability test_stability_aged",
    "sweep": "test_sweep test_sweep_plan",
    "theory.py": "test_theory",
}
"""Modules and packages, and the tests of their rooms; the longest name that fits counts."""

Turned = dict[type[ast.AST], type[ast.AST]]
OPERATORS: Turned = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


@dataclass(frozen=True)
class Mutant:
    """One change: the node is the `index`-th of its module that can be turned, its operator the `part`-th."""

    file: Path
    line: int
    index: int
    part: int
    words: str


def tests_of(file: Path) -> list[str]:
    """Return the tests of the room that a module belongs to; none if it has none here."""
    name = file.relative_to(PACKAGE).as_posix()
    fits = [room for room in TESTS if name == room or name.startswith((f"{room}/", f"{room}_"))]
    return [f"tests/{test}.py" for test in TESTS[max(fits, key=len)].split()] if fits else []


def nodes(tree: ast.AST) -> list[Any]:
    """Return what can be turned; sums of texts, types and docstrings aside."""
    found = []
    skipped: set[int] = set()
    for node in ast.walk(tree):
        for name in ("annotation", "returns"):  # ``int | None`` is no arithmetic
            if isinstance(inner := getattr(node, name, None), ast.AST):
                skipped.update(map(id, ast.walk(inner)))
        if id(node) not in skipped and isinstance(node, (ast.BinOp, ast.AugAssign, ast.Compare, ast.BoolOp)):
            found.append(node)
    return found


def operators(node: Any) -> list[Any]:
    """Return the operators of a node."""
    return list(node.ops) if isinstance(node, ast.Compare) else [node.op]


def mutants(file: Path) -> Iterator[Mutant]:
    """Yield every mutant of a module."""
    source = file.read_text(encoding="utf-8")
    for index, node in enumerate(nodes(ast.parse(source))):
        for part, operator in enumerate(operators(node)):
            if (other := OPERATORS.get(type(operator))) is not None:
                line = node.lineno
                words = (
                    f"{type(operator).__name__} to {other.__name__} in: {source.splitlines()[line - 1].strip()[:90]}"
                )
                yield Mutant(file, line, index, part, words)


def turned(mutant: Mutant) -> str:
    """Return the source of a module with the one change."""
    tree = ast.parse(mutant.file.read_text(encoding="utf-8"))
    node: Any = nodes(tree)[mutant.index]
    other: Any = OPERATORS[type(operators(node)[mutant.part])]()
    if isinstance(node, ast.Compare):
        node.ops[mutant.part] = other
    else:
        node.op = other
    return ast.unparse(tree)


@cache
def stands(room: tuple[str, ...]) -> bool:
    """Whether the tests of a room pass on the package as it is: else they would catch everything."""
    return not _fails(PACKAGE / "__init__.py", (PACKAGE / "__init__.py").read_text(encoding="utf-8"), room)


def is_caught(mutant: Mutant) -> bool:
    """Whether the tests of its room fail on a mutant."""
    room = tuple(tests_of(mutant.file))
    if not stands(room):
        sys.exit(f"{' '.join(room)}: fail without any mutant")
    return _fails(mutant.file, turned(mutant), room)


def _fails(file: Path, source: str, tests: tuple[str, ...]) -> bool:
    with tempfile.TemporaryDirectory(prefix="mutant-") as folder:
        copy = Path(folder) / "src" / "stickslip"
        shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("static"))
        (copy / file.relative_to(PACKAGE)).write_text(source, encoding="utf-8")
        environment = {**os.environ, "PYTHONPATH": str(copy.parent), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-m", "not slow", "-p", "no:cacheprovider"]
        command += tests
        try:
            done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, timeout=LIMIT)
        except subprocess.TimeoutExpired:
            return True
    if done.returncode not in (0, 1, 2):
        sys.exit(f"the tests could not be run:\n{done.stdout.decode()}{done.stderr.decode()}")
    return done.returncode != 0


def main() -> int:
    """Try a sample; return 1 if a mutant lives."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", nargs="?", type=int, default=20)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("--at", metavar="FILE:LINE", action="append", help="every mutant of this line instead")
    parser.add_argument("--room", action="append", help="only modules whose path in the package begins like this")
    asked = parser.parse_args()
    rooms = tuple(asked.room or [""])
    files = [file for file in sorted(PACKAGE.rglob("*.py")) if tests_of(file)]
    files = [file for file in files if file.relative_to(PACKAGE).as_posix().startswith(rooms)]
    sample = [mutant for file in files for mutant in mutants(file)]
    if asked.at:
        places = {(ROOT / place.rpartition(":")[0], int(place.rpartition(":")[2])) for place in asked.at}
        sample = [mutant for mutant in sample if (mutant.file, mutant.line) in places]
    else:
        sample = random.Random(asked.seed).sample(sample, min(asked.count, len(sample)))
    lived = 0
    for mutant in sample:
        caught = is_caught(mutant)
        lived += not caught
        print(
            "caught" if caught else "LIVED ",
            f"{mutant.file.relative_to(ROOT)}:{mutant.line}: {mutant.words}",
            flush=True,
        )
    print(f"{len(sample) - lived} of {len(sample)} mutants caught")
    return 1 if lived else 0


if __name__ == "__main__":
    sys.exit(main())
