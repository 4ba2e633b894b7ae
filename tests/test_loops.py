"""Every loop ends: a `while` of the package counts its turns or says why it ends."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip import cycles
from stickslip.cycles import edges
from stickslip.loops import HALVINGS, bounded
from stickslip.model.newborn import stretchings_within
from stickslip.sliding.lifetimes import panel_edges

PACKAGE = Path(ss.__file__).parent
COMPILED = PACKAGE / "kernels"
REASON = "# endless: "
"""Comment at a loop that waits for something outside."""
WHY = "# ends: "
"""Comment above a loop of a kernel that does not count but cannot stall."""


def is_bounded(loop, counters):
    """Return whether a loop tests a counter in each turn, or raises if it stalls."""
    asked = {
        call.args[0].id
        for each in (loop.test, *loop.body)
        for call in ast.walk(each)
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Name)
        and call.func.id == "next"
        and isinstance(call.args[0], ast.Name)
    }
    fails = any(
        isinstance(each, ast.Raise)
        and isinstance(each.exc, ast.Call)
        and isinstance(each.exc.func, ast.Name)
        and each.exc.func.id == "RuntimeError"
        for each in ast.walk(loop)
    )
    return fails or bool(asked & counters)


def counts(loop):
    """Return whether a loop changes its condition's variable by a whole number."""
    asked = {
        ast.unparse(each)
        for each in ast.walk(loop.test)
        if isinstance(each, ast.Name | ast.Attribute | ast.Subscript)
    }
    return any(
        isinstance(each, ast.AugAssign)
        and isinstance(each.op, ast.Add | ast.Sub)
        and isinstance(each.value, ast.Constant)
        and isinstance(each.value.value, int)
        and each.value.value > 0
        and ast.unparse(each.target) in asked
        for each in ast.walk(loop)
    )


def unbounded_in(text, compiled=False):
    """Return the lines at which loops without a bound or a reason begin."""
    tree = ast.parse(text)
    lines = text.splitlines()
    counters = {
        target.id
        for each in ast.walk(tree)
        if isinstance(each, ast.Assign)
        and isinstance(each.value, ast.Call)
        and isinstance(each.value.func, ast.Name)
        and each.value.func.id == "bounded"
        for target in each.targets
        if isinstance(target, ast.Name)
    }
    return [
        loop.lineno
        for loop in ast.walk(tree)
        if isinstance(loop, ast.While)
        and not is_bounded(loop, counters)
        and not (compiled and counts(loop))
        and not any(
            len(line.partition(WHY if compiled else REASON)[2].split()) > 2
            for line in lines[loop.lineno - 2 : loop.lineno]
        )
    ]


@pytest.mark.parametrize(
    "file",
    sorted(PACKAGE.rglob("*.py")),
    ids=lambda file: str(file.relative_to(PACKAGE)),
)
def test_each_loop_has_a_bound_or_a_reason(file):
    text = file.read_text(encoding="utf-8")
    assert unbounded_in(text, compiled=COMPILED in file.parents) == []


@pytest.mark.parametrize(
    ("loop", "found"),
    [
        ("while x > 0:\n    x = f(x)\n", [1]),
        ("while x > 0:  # endless: \n    x = f(x)\n", [1]),
        ("while x > 0:\n    next(turns)\n", [1]),
        ("turns = bounded('x', 9)\nwhile x > 0:\n    next(turns)\n", []),
        ("# endless: until the server hangs up\nwhile True:\n    f()\n", []),
        ("while x > 0:\n    if still:\n        raise RuntimeError('x')\n", []),
    ],
)
def test_a_loop_without_a_bound_is_found(loop, found):
    assert unbounded_in(loop) == found


@pytest.mark.parametrize(
    ("loop", "found"),
    [
        ("while x < end:\n    x += h\n", [1]),
        ("while True:\n    x += 1\n", [1]),
        ("while a[k] < end:\n    k += 1\n", []),
        ("while m.k < n:\n    m.k += 1\n", []),
        ("while n[K] < n[L]:\n    n[K] += 0\n", [1]),
        ("# ends: soon\nwhile x < end:\n    x += h\n", [2]),
        ("# ends: the width doubles each turn\nwhile x < end:\n    x += x\n", []),
        ("# endless: until the server hangs up\nwhile True:\n    f()\n", [2]),
        ("while x < end:\n    if x + h <= x:\n        raise RuntimeError('x')\n", []),
    ],
)
def test_a_compiled_loop_counts_or_raises_or_says_why_it_ends(loop, found):
    assert unbounded_in(loop, compiled=True) == found


def test_a_loop_that_does_not_get_on_is_a_fault_that_names_its_place():
    turns = bounded("halving", 3)
    assert [next(turns) for _ in range(3)] == [1, 2, 3]
    with pytest.raises(RuntimeError, match=r"^halving: no end after 3 turns: a fault"):
        next(turns)


def test_halving_spans_every_double():
    smallest = math.ulp(0.0)
    largest = math.ldexp(1.0, 1023)
    assert math.log2(largest) - math.log2(smallest) < HALVINGS


def test_an_edge_cannot_be_halved_below_rounding():
    with pytest.raises(RuntimeError, match=r"^halved: no end"):
        edges.halved(lambda value: value > 1.5, 1.0, 2.0, 0.0)
    found = edges.halved(lambda value: value > 1.5, 1.0, 2.0, 1e-15)
    assert found == pytest.approx((1.5, 1.5), rel=1e-14)


def test_a_cycle_that_is_never_decided_is_a_fault(monkeypatch):
    verdicts = cycles.oscillation_verdict
    monkeypatch.setattr(verdicts, "PATIENCE", 0)
    monkeypatch.setattr(verdicts, "_outcome", lambda *_: None)
    rig = ss.Rig(
        ss.Interface(thresholds=ss.Gaussian(1.0, 0.1)),
        ss.Slider(stiffness=2.0, mass=0.01, damping=10.0),
        ss.constant(1.0),
    )
    with pytest.raises(RuntimeError, match=r"^settle: no end after 3 turns"):
        cycles.is_sustained(rig)


def test_panels_that_cannot_advance_are_a_fault():
    with pytest.raises(RuntimeError, match=r"^panel_edges: no end"):
        panel_edges(ss.Gaussian(1.0, 0.1), 0.0, 2.0, [], lambda _: 0.0)


def test_stretchings_beyond_all_thresholds_are_refused(monkeypatch):
    rng = np.random.default_rng(1)
    monkeypatch.setattr("stickslip.model.newborn._REDRAWN", 20)
    with pytest.raises(ss.InputError, match="next to no stretching is below 1,"):
        stretchings_within(ss.Gaussian(mean=5.0, std=0.1), rng, 3, 1.0)
    drawn = stretchings_within(ss.Gaussian(mean=0.0, std=0.5), rng, 100, 1.0)
    assert np.abs(drawn).max() < 1.0
