"""Change one operator or comparison at a time and check whether the tests notice:
`python tools/mutants.py [COUNT [SEED]]`.

Each mutant is a copy of the package with one change, tried with the quick tests of its
room. A mutant that survives is printed with its place; either a test is missing, or the
change makes no difference (an equivalent mutant).

After `--learn`, which records the lines that each test runs, a mutant is tried with
those tests of all rooms that run its line. For kernels no lines can be recorded: a
mutant is tried with the tests that run a line which names a caller of the kernel, and
only these callers are compiled again. Lines that run before any test are tried with the
tests of their room.

    python tools/mutants.py --learn                 record them, in .mutants
    python tools/mutants.py 20 7                    twenty mutants drawn with seed 7
    python tools/mutants.py --at src/stickslip/io/datasets.py:166
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

from callers import Callers
from coverage import CoverageData

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "stickslip"
WORKSHOP = ROOT / ".mutants"
"""Folder of the copies, of their compiled code, and of the record of `--learn`: always
the same place, because compiled code contains its path.
"""
LEARNT = WORKSHOP / "learnt.json"
"""For tests that pass: `seconds`, by test name; `lines`, by module and line, the
positions in `seconds` of the tests that run it.
"""
ENOUGH = 240
"""Seconds of tests that are run on a mutant, the fastest first."""
STUCK = 150
"""Seconds without a finished test after which a mutant hangs, and so is caught; most of
them are for compilation.
"""

CLOSEST = 4
"""Number of test files of a module, the closest ones."""

SIGNS = {
    ast.Add: "+ -",
    ast.Sub: "- +",
    ast.Mult: "* /",
    ast.Div: "/ *",
    ast.FloorDiv: "// *",
    ast.Lt: "< >=",
    ast.LtE: "<= >",
    ast.Gt: "> <=",
    ast.GtE: ">= <",
    ast.Eq: "== !=",
    ast.NotEq: "!= ==",
    ast.And: "and or",
    ast.Or: "or and",
}
"""Operators: as written, and their replacement; a comparison becomes its opposite,
because few numbers lie exactly on an edge.
"""


@dataclass(frozen=True)
class Mutant:
    """One change: the text from `begin` to `end` in its module becomes `sign`, at each
    of these places.

    `line` is its line, `statement` the lines of the statement around it.
    """

    file: Path
    line: int
    statement: range
    places: tuple[tuple[int, int], ...]
    sign: str
    words: str

    @property
    def name(self) -> str:
        """The path of the module in the package."""
        return self.file.relative_to(PACKAGE).as_posix()

    @property
    def source(self) -> str:
        """The module with the change, and of the same length if possible: numba
        compares lengths.
        """
        text = self.file.read_bytes()
        for begin, end in reversed(self.places):
            text = text[:begin] + self.sign.encode().ljust(end - begin) + text[end:]
        return text.decode().removesuffix(
            "\n" if len(text) > self.file.stat().st_size else ""
        )


@cache
def names_defined(file: Path) -> frozenset[str]:
    """Return the names defined at the top of a module."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return frozenset(
        node.name
        for node in tree.body
        if isinstance(node, (ast.FunctionDef, ast.ClassDef))
    )


@cache
def names_used(file: Path) -> frozenset[str]:
    """Return every name and attribute in a file, imports included."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    found = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    found |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    found |= {node.name for node in ast.walk(tree) if isinstance(node, ast.alias)}
    return frozenset(found)


@cache
def tests_of(file: Path) -> list[str]:
    """Return the closest test files of a module: those named after it or its room, then
    those that use most of its names, then those that use most of its neighbours' names.
    """
    named = {f"test_{place}" for place in (file.stem, file.parent.name)}
    own = names_defined(file)
    neighbours = frozenset().union(*map(names_defined, file.parent.glob("*.py")))

    def closeness(test: Path) -> tuple[bool, int, int]:
        used = names_used(test)
        return test.stem in named, len(own & used), len(neighbours & used)

    tests = sorted((ROOT / "tests").rglob("test_*.py"))
    closest = sorted(tests, key=closeness, reverse=True)[:CLOSEST]
    return [test.relative_to(ROOT).as_posix() for test in closest]


def mutants(file: Path) -> Iterator[Mutant]:
    """Yield every mutant of a module, except of annotations: they are no arithmetic."""
    source = file.read_bytes()
    starts = [0, *(match.end() for match in re.finditer(rb"\n", source))]
    skipped: set[int] = set()
    statement: dict[int, range] = {}
    for node in ast.walk(ast.parse(source)):
        for name in ("annotation", "returns"):
            if isinstance(inner := getattr(node, name, None), ast.AST):
                skipped.update(map(id, ast.walk(inner)))
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            lines = range(
                node.lineno,
                body[0].lineno if body else (node.end_lineno or node.lineno) + 1,
            )
            statement.update((id(each), lines) for each in ast.walk(node))
        if id(node) in skipped:
            continue
        for operator, sides in _operations(node):
            if type(operator) not in SIGNS:
                continue
            equal = "=" if isinstance(node, ast.AugAssign) else ""
            sign, other = (sign + equal for sign in SIGNS[type(operator)].split())
            gaps = [
                (
                    starts[left.end_lineno - 1] + left.end_col_offset,
                    starts[right.lineno - 1] + right.col_offset,
                )
                for left, right in sides
            ]
            line = sides[0][0].lineno
            words = source[starts[line - 1] :].split(b"\n", 1)[0].decode().strip()[:90]
            places = tuple(_find(sign, source, *gap) for gap in gaps)
            yield Mutant(
                file,
                line,
                statement[id(node)],
                places,
                other,
                f"{sign} to {other} in: {words}",
            )


def _operations(node: Any) -> list[tuple[ast.AST, list[tuple[Any, Any]]]]:
    """Return the operators of a node, each with the nodes on its left and right
    wherever it is written.
    """
    if isinstance(node, ast.BinOp):
        return [(node.op, [(node.left, node.right)])]
    if isinstance(node, ast.AugAssign):
        return [(node.op, [(node.target, node.value)])]
    if isinstance(node, ast.BoolOp):
        return [(node.op, list(pairwise(node.values)))]
    if isinstance(node, ast.Compare):
        return [
            (op, [pair])
            for op, pair in zip(
                node.ops, pairwise([node.left, *node.comparators]), strict=True
            )
        ]
    return []


def _find(sign: str, source: bytes, begin: int, end: int) -> tuple[int, int]:
    """Return where an operator stands between two positions: outside of comments and of
    brackets there.
    """
    at = next(
        match.start(1)
        for match in re.finditer(
            rb"#[^\n]*|(%s)" % re.escape(sign.encode()), source[begin:end]
        )
        if match.group(1)
    )
    return begin + at, begin + at + len(sign)


def learn() -> None:
    """Run the quick tests of all rooms, and record which of those that pass run which
    lines.
    """
    traced = WORKSHOP / "coverage"
    asked = [
        "-n",
        str(os.cpu_count()),
        "--dist",
        "loadfile",
        "--cov",
        "--cov-context=test",
        "--cov-report=",
    ]
    asked += ["-rfE", "-vv", "--durations=0", "--durations-min=0"]  # also the fastest
    _, output = _run([*asked, "tests"], None, {"COVERAGE_FILE": str(traced)})
    seconds: dict[str, float] = defaultdict(float)
    for took, test in re.findall(
        r"^([\d.]+)s (?:setup|call) +(.+)$", output, re.MULTILINE
    ):
        seconds[test] += float(took)
    # a name may hold spaces; the error follows
    wrong = re.findall(r"^(?:FAILED|ERROR) (.+)$", output, re.MULTILINE)
    failed = {
        test
        for test in seconds
        if any(f"{line} - ".startswith(f"{test} - ") for line in wrong)
    }
    data = CoverageData(basename=str(traced))
    data.read()
    tests = sorted(seconds.keys() - failed)  # also those that call kernels only
    number = {test: place for place, test in enumerate(tests)}
    found: dict[str, dict[int, list[int]]] = {}
    for name in data.measured_files():
        met = data.contexts_by_lineno(name).items()
        each = {
            line: {number.get(context.partition("|")[0], -1) for context in through}
            for line, through in met
        }
        found[name.rpartition("/stickslip/")[2]] = {
            line: sorted(places - {-1}) for line, places in each.items()
        }
    known = {
        "seconds": {test: round(seconds[test], 3) for test in tests},
        "lines": found,
    }
    LEARNT.write_text(json.dumps(known), encoding="utf-8")
    print(
        f"{LEARNT.name}: {len(found)} modules; {len(failed)} tests fail without any "
        "mutant and are left out"
    )


@cache
def learnt() -> dict[str, Any]:
    """Return the record of `--learn`, if there is one."""
    return (
        json.loads(LEARNT.read_text(encoding="utf-8"))
        if LEARNT.exists()
        else {"lines": {}, "seconds": {}}
    )


@cache
def callers() -> Callers:
    """Return which definitions of the package use which others."""
    return Callers(PACKAGE)


def compiled_of(mutant: Mutant) -> set[tuple[str, str]]:
    """Return the kernels whose machine code contains the change; none if it is in no
    kernel.
    """
    if not mutant.name.startswith("kernels/"):
        return set()
    reached = callers().reached(callers().at(mutant.file, mutant.line))
    return {each for each in reached if each[0].startswith("stickslip.kernels.")}


def tests_for(mutant: Mutant) -> list[str]:
    """Return the tests to run on a mutant, the quick ones of its own room first."""
    room = tuple(tests_of(mutant.file))
    places = {(mutant.name, line) for line in mutant.statement}
    if kernels := compiled_of(mutant):
        places = {
            (file.relative_to(PACKAGE).as_posix(), line)
            for file, line in callers().lines(kernels)
        }
    seconds = learnt()["seconds"]
    lines = learnt()["lines"]
    names = list(seconds)
    found = {
        names[test]
        for file, line in places
        for test in lines.get(file, {}).get(str(line), [])
    }
    # its own tests call kernels directly, without running a line of the package
    if kernels or not found:
        found |= {test for test in names if test.startswith(room)}
    order = sorted(found, key=lambda test: (not test.startswith(room), seconds[test]))
    total = accumulate(seconds[test] for test in order)
    return [
        test for test, so_far in zip(order, total, strict=True) if so_far < ENOUGH
    ] or list(room)


def is_caught(mutant: Mutant) -> bool:
    """Return whether a test fails on a mutant."""
    tests = tests_for(mutant)
    if not LEARNT.exists() and not stands(tuple(tests)):
        sys.exit(f"{' '.join(tests)}: fail without any mutant")
    return _fails(mutant, tests)


@cache
def stands(tests: tuple[str, ...]) -> bool:
    """Return whether the tests pass on the unchanged package: otherwise they would
    catch everything.
    """
    return not _fails(None, list(tests))


def _fails(mutant: Mutant | None, tests: list[str]) -> bool:
    WORKSHOP.mkdir(exist_ok=True)
    asked = WORKSHOP / "tests"
    asked.write_text("\n".join(tests), encoding="utf-8")
    code, output = _run(["-x", f"@{asked}"], mutant)
    if code == 5:
        sys.exit(f"no test was run:\n{output}")
    return code != 0


def _run(
    asked: list[str], mutant: Mutant | None, more: dict[str, str] | None = None
) -> tuple[int, str]:
    """Run quick tests on a copy of the package, with a change; return the exit code and
    the output.
    """
    copy = WORKSHOP / "src" / "stickslip"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(
        PACKAGE, copy, ignore=shutil.ignore_patterns("static", "__pycache__")
    )
    places = {
        "PYTHONPATH": str(copy.parent),
        "NUMBA_CACHE_DIR": str(WORKSHOP / "compiled"),
    }
    environment = {
        **os.environ,
        **places,
        "PYTHONDONTWRITEBYTECODE": "1",
        **(more or {}),
    }
    if mutant is not None:
        before = _compiled(environment)
        changed = copy / mutant.name
        changed.write_text(mutant.source, encoding="utf-8")
        shutil.copystat(mutant.file, changed)
        if kernels := compiled_of(mutant):
            stale = [
                f"{module.rpartition('.')[2]}.{name}-*" for module, name in kernels
            ]
            shutil.copytree(
                before,
                _compiled(environment),
                ignore=shutil.ignore_patterns(*stale),
                dirs_exist_ok=True,
            )
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-m",
        "not slow and not browser",
        "-p",
        "no:cacheprovider",
        *asked,
    ]
    report = WORKSHOP / "report"
    with (
        report.open("w") as output,
        subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=output, stderr=output
        ) as run,
    ):
        while run.poll() is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                run.wait(1.0)
            if mutant is not None and time.time() - report.stat().st_mtime > STUCK:
                run.kill()
    return run.returncode, report.read_text(errors="replace")


def _compiled(environment: dict[str, str]) -> str:
    """Return the folder of the compiled code of the copy in its present state."""
    asked = [
        sys.executable,
        "-c",
        "from stickslip.kernels import _jit; print(_jit._PLACE)",
    ]
    return subprocess.run(
        asked, env=environment, check=True, capture_output=True, text=True
    ).stdout.strip()


def main() -> int:
    """Try a sample of mutants; return 1 if one survives."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("count", nargs="?", type=int, default=20)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument(
        "--at",
        metavar="FILE:LINE",
        action="append",
        help="every mutant of this line instead",
    )
    parser.add_argument(
        "--room",
        action="append",
        help="only modules whose path in the package begins like this",
    )
    parser.add_argument(
        "--learn", action="store_true", help="note which tests run through which lines"
    )
    asked = parser.parse_args()
    if asked.learn:
        learn()
        return 0
    rooms = tuple(asked.room or [""])
    files = sorted(PACKAGE.rglob("*.py"))
    files = [
        file for file in files if file.relative_to(PACKAGE).as_posix().startswith(rooms)
    ]
    sample = [mutant for file in files for mutant in mutants(file)]
    if asked.at:
        places = {
            (ROOT / place.rpartition(":")[0], int(place.rpartition(":")[2]))
            for place in asked.at
        }
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
