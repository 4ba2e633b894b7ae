"""Turn one operator or comparison at a time and see whether the tests notice: `python tools/mutants.py [COUNT [SEED]]`.

Each mutant is a copy of the package with one change, tried against the quick tests of its room. A mutant that lives
names its place; either a test is missing, or the change makes no difference (an equivalent mutant).

Once `--learn` has noted which tests run through which lines, a mutant meets those of all rooms, and no others. What is
compiled has no lines to note, nor has what runs before any test: there it stays with the room.

    python tools/mutants.py --learn       note them, in .mutants.json
    python tools/mutants.py 20 7          twenty mutants drawn with seed 7
    python tools/mutants.py --at src/stickslip/io/datasets.py:166
"""

from __future__ import annotations

import argparse
import ast
import atexit
import json
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

from coverage import CoverageData

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "stickslip"
LEARNT = ROOT / ".mutants.json"
"""Tests by the lines that they run through: of each module of the package, by line."""
LIMIT = 600
"""Seconds for the tests of one mutant; a mutant that hangs is caught."""

TESTS = {
    "advise": "test_advise",
    "advise/elastic.py": "test_elastic",
    "answers.py": "test_plain test_model",
    "cli.py": "test_cli",
    "console.py": "test_cli",
    "cycles": "test_cycles",
    "elastic": "test_elastic test_fronts",
    "errors.py": "test_errors test_arguments",
    "fitting": "test_fitting",
    "friction_law.py": "test_friction_laws",
    "io": "test_rig test_store test_extensions",
    "io/datasets.py": "test_store test_damaged",
    "io/files.py": "test_files",
    "kernels": "test_contacts test_panels test_simulate test_ageing",
    "kernels/arrest.py": "test_mechanisms",
    "kernels/between_events.py": "test_contacts test_thermal_runs",
    "kernels/births.py": "test_panels test_master_equation",
    "kernels/block": "test_elastic",
    "kernels/event": "test_contacts test_simulate test_turning_drives",
    "kernels/expansions.py": "test_contacts",
    "kernels/flight.py": "test_contacts test_simulate test_turning_drives",
    "kernels/groups.py": "test_panels test_master_equation",
    "kernels/growth.py": "test_ageing test_simulate_ageing",
    "kernels/hazard.py": "test_thermal_runs",
    "kernels/langevin": "test_ageing test_simulate_ageing",
    "kernels/leapfrog.py": "test_elastic",
    "kernels/lives.py": "test_friction_laws",
    "kernels/lots.py": "test_population",
    "kernels/network.py": "test_elastic",
    "kernels/oscillator.py": "test_contacts test_simulate test_turning_drives",
    "kernels/panel": "test_panels test_master_equation",
    "kernels/quasistatic.py": "test_elastic",
    "kernels/rate_state.py": "test_friction_laws",
    "kernels/renewal.py": "test_renewal test_rigid",
    "kernels/rules.py": "test_panels test_master_equation",
    "kernels/survival.py": "test_panels test_master_equation",
    "kernels/thermal": "test_thermal_runs",
    "kernels/tournament.py": "test_elastic",
    "kernels/velocity_step.py": "test_friction_laws test_thermal_runs",
    "lives.py": "test_friction_laws",
    "measure": "test_measure test_traces",
    "measure/fronts.py": "test_fronts test_elastic",
    "model": "test_model test_drive test_rig test_units",
    "model/activation.py": "test_friction_laws test_thermal_runs",
    "model/body.py": "test_elastic",
    "model/distribution": "test_distributions",
    "model/newborn.py": "test_mechanisms test_rig",
    "model/parameters.py": "test_model test_rig test_extensions",
    "model/quadrature.py": "test_distributions",
    "model/quantities.py": "test_quantities",
    "model/units.py": "test_units test_quantities test_rig",
    "paper": "test_paper",
    "plot": "test_plot",
    "plot/elastic.py": "test_fronts test_elastic",
    "progress.py": "test_cli test_plain",
    "rate_state": "test_friction_laws",
    "rigid.py": "test_rigid",
    "simulation": "test_simulate test_contacts test_work",
    "simulation/engines/blocks.py": "test_elastic",
    "simulation/engines/growth.py": "test_ageing test_simulate_ageing",
    "simulation/engines/langevin.py": "test_ageing test_simulate_ageing",
    "simulation/engines/panels.py": "test_panels test_master_equation",
    "simulation/engines/thermal": "test_thermal_runs",
    "simulation/steps_and_holds.py": "test_thermal_runs",
    "stability": "test_stability test_stability_aged",
    "sweep": "test_sweep test_sweep_plan",
    "theory.py": "test_theory",
}
"""Modules, packages and beginnings of names in them, and the tests of their rooms; the longest that fits counts."""

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
    fits = [
        room
        for room in TESTS
        if name == room or name.startswith((f"{room}/", f"{room}_")) or ("/" in room and name.startswith(room))
    ]
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


@cache
def workshop() -> Path:
    """Return the folder of the copies: always the same place, or what is compiled once would be compiled for each."""
    folder = Path(tempfile.mkdtemp(prefix="mutant-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def learn() -> None:
    """Run the quick tests of all rooms, and note which of those that pass run through which lines."""
    rooms = sorted({f"tests/{test}.py" for tests in TESTS.values() for test in tests.split()})
    traced = workshop() / "coverage"
    asked = ["-n", str(os.cpu_count()), "--dist", "loadfile", "--cov", "--cov-context=test", "--cov-report=", "-rfE"]
    _, told = _run([*asked, *rooms], {"COVERAGE_FILE": str(traced)}, limit=None)
    failed = {line.split()[1] for line in told.splitlines() if line.startswith(("FAILED", "ERROR"))}
    data = CoverageData(basename=str(traced))
    data.read()
    found: dict[str, dict[int, list[str]]] = {}
    for name in data.measured_files():
        met = {
            line: {each.partition("|")[0] for each in tests} for line, tests in data.contexts_by_lineno(name).items()
        }
        passed = {line: sorted(tests - failed - {""}) for line, tests in met.items()}
        found[name.rpartition("/stickslip/")[2]] = {line: tests for line, tests in passed.items() if tests}
    LEARNT.write_text(json.dumps(found), encoding="utf-8")
    print(f"{LEARNT.name}: {len(found)} modules; {len(failed)} tests fail without any mutant and are left out")


@cache
def learnt() -> dict[str, dict[str, list[str]]]:
    """Return what was learnt, if it was."""
    return json.loads(LEARNT.read_text(encoding="utf-8")) if LEARNT.exists() else {}


def is_caught(mutant: Mutant) -> bool:
    """Whether a test fails on a mutant."""
    room = tuple(tests_of(mutant.file))
    lines = learnt().get(mutant.file.relative_to(PACKAGE).as_posix(), {})
    if tests := lines.get(str(mutant.line)):
        near = sorted(tests, key=lambda test: not test.startswith(room))
        return _fails(mutant.file, turned(mutant), tuple(near))
    if not stands(room):
        sys.exit(f"{' '.join(room)}: fail without any mutant")
    return _fails(mutant.file, turned(mutant), room)


def _fails(file: Path, source: str, tests: tuple[str, ...]) -> bool:
    asked = workshop() / "tests"
    asked.write_text("\n".join(tests), encoding="utf-8")
    try:
        code, told = _run(["-x", f"@{asked}"], {}, (file, source))
    except subprocess.TimeoutExpired:
        return True
    if code == 5:
        sys.exit(f"no test was run:\n{told}")
    return code != 0


def _run(
    asked: list[str], more: dict[str, str], changed: tuple[Path, str] | None = None, limit: float | None = LIMIT
) -> tuple[int, str]:
    """Run quick tests on a copy of the package, with another source for one file; how it ends, and what it says."""
    copy = workshop() / "src" / "stickslip"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("static", "__pycache__"))
    if changed is not None:
        (copy / changed[0].relative_to(PACKAGE)).write_text(changed[1], encoding="utf-8")
    places = {"PYTHONPATH": str(copy.parent), "NUMBA_CACHE_DIR": str(workshop() / "compiled")}
    environment = {**os.environ, **places, "PYTHONDONTWRITEBYTECODE": "1", **more}
    command = [sys.executable, "-m", "pytest", "-q", "-m", "not slow", "-p", "no:cacheprovider", *asked]
    report = workshop() / "report"
    with report.open("w") as told:
        done = subprocess.run(command, cwd=ROOT, env=environment, stdout=told, stderr=told, timeout=limit)
    return done.returncode, report.read_text(errors="replace")


def main() -> int:
    """Try a sample; return 1 if a mutant lives."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", nargs="?", type=int, default=20)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("--at", metavar="FILE:LINE", action="append", help="every mutant of this line instead")
    parser.add_argument("--room", action="append", help="only modules whose path in the package begins like this")
    parser.add_argument("--learn", action="store_true", help="note which tests run through which lines")
    asked = parser.parse_args()
    if asked.learn:
        learn()
        return 0
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
