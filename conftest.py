"""Every code block of the pages, the README and the docstrings is a test.

- ``python`` runs; what a page defines stays known further down the page.
- ``bash`` holds commands of ours alone; each goes through the command line, in a folder
  of the page's own.
- ``text`` after either is what they print, ``...`` standing for anything, blanks not
  compared.
- ``toml`` that begins with ``# name.toml`` becomes that file, and is read as a rig.
- ``>>>`` in a docstring is a doctest, after ``import stickslip as ss``, and numpy and
  xarray as usual.

A block after ``<!-- slow -->`` is marked slow.

With ``--at-most SECONDS``, as `make unit` runs them, a quick test that takes more CPU
time fails.
"""

import atexit
import contextlib
import doctest
import functools
import io
import os
import re
import shlex
import shutil
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path

import numba.core.event
import numpy as np
import pytest
import xarray as xr
from sybil import Document, Example, Region, Sybil
from sybil.document import PythonDocStringDocument
from sybil.evaluators.doctest import DocTestEvaluator
from sybil.evaluators.python import PythonEvaluator
from sybil.integration.pytest import SybilItem
from sybil.parsers.abstract import DocTestStringParser
from sybil.parsers.myst import CodeBlockParser

import stickslip as ss

ROOT = Path(__file__).parent
BENCH = ROOT / "tests" / "data" / "guldstrand_force7.txt"  # measured by others
ROCK = ROOT / "tests" / "data" / "giacomel_basalt_step.txt"
RIGS = ROOT / "src" / "stickslip" / "examples"

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE

os.environ["MPLBACKEND"] = "Agg"
if "STICKSLIP_CACHE" not in os.environ:  # not the user's
    os.environ["STICKSLIP_CACHE"] = tempfile.mkdtemp(prefix="stickslip-cache-")
    atexit.register(shutil.rmtree, os.environ["STICKSLIP_CACHE"], ignore_errors=True)


def _begin(namespace):
    folder = Path(tempfile.mkdtemp(prefix="stickslip-docs-"))
    shutil.copy(RIGS / "pmma_slider.toml", folder)
    stage = re.search(
        r"```toml\n(# stage\.toml\n.*?)```",
        (ROOT / "docs/howto/predict.md").read_text(),
        re.DOTALL,
    )[1]
    for name in ("stage.toml", "rig.toml"):
        (folder / name).write_text(stage)
    for name in ("trace.csv", "force7.txt"):
        shutil.copy(BENCH, folder / name)
    shutil.copy(ROCK, folder / "rock.csv")
    namespace.update(_folder=folder, _printed="")


def _end(namespace):
    shutil.rmtree(namespace["_folder"], ignore_errors=True)


@contextlib.contextmanager
def _stage(example: Example):
    """In the page's folder, with what is printed kept for the block that follows."""
    example.namespace["_printed"] = None
    with (
        contextlib.chdir(example.namespace["_folder"]),
        contextlib.redirect_stdout(io.StringIO()) as printed,
    ):
        yield
    example.namespace["_printed"] = printed.getvalue()


def _catch_up(example: Example) -> None:
    """Run what stands before an example on its page and was left out, as `-m slow`
    leaves out all that is quick.
    """
    done = example.namespace.setdefault("_done", set())
    done.add(example.start)
    for earlier in example.document.examples():
        if (
            earlier.start < example.start
            and earlier.start not in done
            and not _is_slow(earlier)
        ):
            done.add(earlier.start)
            if earlier.region.evaluator is not _compare:
                earlier.evaluate()


def _is_slow(example: Example) -> bool:
    return example.document.text[: example.start].rstrip().endswith("<!-- slow -->")


def _plainly(evaluate: Callable[[Example], object]) -> Callable[[Example], None]:
    """Fail a block with one plain text: pytest stumbles over the chain of causes that
    sybil leaves.
    """

    @functools.wraps(evaluate)
    def evaluated(example: Example) -> None:
        _catch_up(example)
        try:
            evaluate(example)
        except Exception as error:
            words = "".join(traceback.format_exception(error))
        else:
            return
        pytest.fail(f"{example.path}, line {example.line}:\n{words}", pytrace=False)

    return evaluated


@_plainly
def _run_python(example: Example) -> None:
    with _stage(example):
        PythonEvaluator()(example)


@_plainly
def _run_commands(example: Example) -> None:
    from stickslip.cli import main

    with _stage(example), pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "110")
        for line in example.parsed.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words:
                assert words[0] == "stickslip", (
                    f"{line}: only commands of ours belong into a bash block"
                )
                assert main(words[1:]) == 0, line


def _compare(example: Example) -> None:
    printed = example.namespace["_printed"]
    if printed is None:
        pytest.skip("the block above was skipped")
    same = doctest.OutputChecker().check_output(example.parsed, printed, FLAGS)
    assert same, f"printed:\n{printed}\nthe page says:\n{example.parsed}"


@_plainly
def _write_rig(example: Example) -> None:
    from stickslip.io import rig_files as rig

    name = re.match(r"# (\w+\.toml)\n", example.parsed)
    assert name, "a toml block begins with the name of its file: # rig.toml"
    file = example.namespace["_folder"] / name[1]
    file.write_text(example.parsed)
    rig.read_rig(file)


def _run_doctest(example: Example) -> str:
    with contextlib.chdir(example.namespace["_folder"]):
        return DocTestEvaluator(FLAGS)(example)


def _doctests(document: Document) -> Iterable[Region]:
    return DocTestStringParser(_run_doctest)(document.text, document.path)


pages = Sybil(
    parsers=[
        CodeBlockParser(language="python", evaluator=_run_python),
        CodeBlockParser(language="bash", evaluator=_run_commands),
        CodeBlockParser(language="text", evaluator=_compare),
        CodeBlockParser(language="toml", evaluator=_write_rig),
    ],
    patterns=[
        "README.md",
        "docs/*.md",
        "docs/theory/*.md",
        "docs/howto/*.md",
        "docs/reference/*.md",
    ],
    excludes=[
        "docs/_build/**",
        # tests/test_sweep_plan.py runs it, with fewer and shorter runs than it shows
        "docs/howto/sweep.md",
    ],
    path=str(ROOT),
    setup=_begin,
    teardown=_end,
)
docstrings = Sybil(
    parsers=[_doctests],
    patterns=["src/stickslip/**/*.py"],
    path=str(ROOT),
    document_types={".py": PythonDocStringDocument},
    setup=lambda namespace: _begin(namespace) or namespace.update(ss=ss, np=np, xr=xr),
    teardown=_end,
)
pytest_collect_file = (pages + docstrings).pytest()


LONGEST = """
laws mechanisms measure regression stability cli turning_drives estimate fronts rigid
structures friction_laws damaged paper fitting cycles advise scaling explorer noise
output_texts
"""
"""Files of tests that a worker takes up first: it would go on alone with one that it
begins last.
"""


def pytest_collection_modifyitems(items):
    for item in items:
        if isinstance(item, SybilItem) and _is_slow(item.example):
            item.add_marker("slow")
    place = {f"test_{name}": i for i, name in enumerate(LONGEST.split())}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))


MARGIN = 2.0
"""Factor of CPU time over its limit at which a test is listed: threads that share a
core take half of it each.
"""
BLOCK = 15.0
"""CPU time that a block of a page may take, in s: as long as `stickslip predict`
searches.
"""


def pytest_addoption(parser):
    help_text = (
        "list the tests that took more than twice this CPU time, or twice what the "
        "marker `takes` allows"
    )
    parser.addoption("--at-most", type=float, metavar="SECONDS", help=help_text)


class _Compiling(numba.core.event.Listener):
    """The CPU time that went into kernels: which test compiles one is chance."""

    seconds = 0.0
    _depth = 0

    def on_start(self, _event):
        self._depth += 1
        self.seconds -= time.process_time() if self._depth == 1 else 0.0

    def on_end(self, _event):
        self._depth -= 1
        self.seconds += time.process_time() if self._depth == 0 else 0.0


compiling = _Compiling()
numba.core.event.register("numba:compile", compiling)


def _used() -> float:
    """CPU time of this process and of those it waited for, but for what compiled
    kernels, in s.
    """
    return sum(os.times()[:4]) - compiling.seconds


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    begun = _used()
    result = yield
    most = item.config.getoption("--at-most")
    took = _used() - begun
    if most is not None and not item.get_closest_marker("slow"):
        longer = item.get_closest_marker("takes")
        most = (
            longer.args[0] if longer else BLOCK if isinstance(item, SybilItem) else most
        )
        if took > MARGIN * most:
            item.user_properties.append(("cpu", f"{took:.1f} s, not {most:g}"))
    return result


def pytest_terminal_summary(terminalreporter):
    for report in [
        r
        for reports in terminalreporter.stats.values()
        for r in reports
        if getattr(r, "when", None) == "call"
    ]:
        for took in [value for name, value in report.user_properties if name == "cpu"]:
            terminalreporter.write_line(
                f"{report.nodeid} took {took} of CPU time: make it smaller, or mark it"
            )
    without = [
        r
        for r in terminalreporter.stats.get("skipped", [])
        if "no chromium" in str(r.longrepr)
    ]
    if without:
        reason = without[0].longrepr[2]
        terminalreporter.write_line(
            f"{len(without)} tests were skipped for want of a browser: {reason}"
        )
