"""Sweeps: the same results wherever they run and whatever is killed; refusals in one
line; boundaries with few runs.
"""

import importlib
import itertools
import json
import os
import re
import sqlite3
import subprocess
import sys
import textwrap
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from refusals import refused

import stickslip as ss
from stickslip.errors import InputError
from stickslip.sweep import Span, _cases, _run, _table, open_sweep, status_of, summary
from stickslip.sweep._cases import case_key, case_seed

AXES = {
    "stiffness": [1.0, 2.0, 3.0],
    "velocity": np.linspace(0.1, 1.0, 7),
    "start": ["from rest", "sliding"],
}


def case(stiffness, velocity, start, seed):
    total = stiffness + velocity + len(start) + np.random.default_rng(seed).random()
    return {"sum": total, "regime": "smooth" if total > 10 else "stick-slip"}


def product(a, b, seed):  # noqa: ARG001
    return {"product": a * b}


def named(run, name="some study", version="1", **more):
    return ss.sweep.NamedStudy(run=run, name=name, version=version, **more)


def run_cases(function, axes, **how):
    """Results of a function, or of a study, over some axes."""
    study = function if isinstance(function, ss.sweep.NamedStudy) else named(function)
    return ss.sweep.run_study(study, axes, **how)


ONE = {"a": [1], "b": [1]}


# Cases for other processes are in a module that these can import; each run leaves a
# line in a file.
MODULE = """
import os, signal, time
import numpy as np

def logged(a, b, seed):
    with open(os.environ["SWEEP_LOG"], "a") as file:
        file.write(f"{a} {b}\\n")
    time.sleep(0.01)
    value = a + np.random.default_rng(seed).random() * b
    return {"value": value, "label": "high" if value > 5 else "low"}

def deadly(a, b, seed):
    if a == 3 and b == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"value": a * b}
"""
LOGGED_AXES = {"a": range(12), "b": [0.0, 1.0, 2.0, 3.0, 4.0]}


def at_once(monkeypatch):
    """Write every result as it comes, in small batches: tests stop at given counts."""
    monkeypatch.setattr(_table, "EVERY", 0.0)
    monkeypatch.setattr(_run, "SECONDS", 0.0)


@pytest.fixture
def cases(tmp_path, monkeypatch):
    (tmp_path / "sweep_cases.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("SWEEP_LOG", str(tmp_path / "runs.log"))
    at_once(monkeypatch)
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    monkeypatch.setenv("PYTHONPATH", path)
    sys.modules.pop("sweep_cases", None)
    module = importlib.import_module("sweep_cases")
    yield module
    sys.modules.pop("sweep_cases", None)


def runs(tmp_path):
    """How often each case was run."""
    lines = (tmp_path / "runs.log").read_text().splitlines()
    return Counter((int(a), float(b)) for a, b in map(str.split, lines))


# ---------------------------------------------------------------- results


def test_axes_become_dimensions_of_one_dataset():
    """A value is that of its case run alone, with a seed that nothing else changes."""
    wide = run_cases(case, AXES)
    assert dict(wide["sum"].sizes) == {"stiffness": 3, "velocity": 7, "start": 2}
    at = {"stiffness": 2.0, "velocity": AXES["velocity"][3].item(), "start": "sliding"}
    alone = case(**at, seed=case_seed(0, case_key(at)))
    assert {name: wide[name].sel(at).item() for name in alone} == alone
    assert str(summary(wide)) == "42 of 42 cases done"
    for name in wide.variables:
        assert {"units", "long_name"} <= wide[name].attrs.keys()
    sizes = {"stiffness": 3, "velocity": 7, "start": 2}
    assert json.loads(wide.attrs["provenance"])["axes"] == sizes
    fewer = dict(reversed(AXES.items())) | {"velocity": AXES["velocity"][2:4]}
    narrow = run_cases(case, fewer)["sum"].transpose(*AXES)
    xr.testing.assert_equal(narrow, wide["sum"].isel(velocity=slice(2, 4)))
    places = itertools.product(np.linspace(0, 1, 20).tolist(), "xyz")
    keys = [case_key({"a": a, "b": b}) for a, b in places]
    assert len({case_seed(seed, key) for seed in range(5) for key in keys}) == 300
    # as an axis the seed is the user's
    given = run_cases(lambda seed: {"given": seed}, {"seed": [5, 6]})
    assert given["given"].values.tolist() == [5, 6]


def test_numbers_texts_and_nothing_come_back_as_they_were(tmp_path):
    def odd(x, flag, seed):  # noqa: ARG001
        return {
            "large": x > 1,
            "sometimes": None if x < 1 else np.float32(0.1),
            "minus zero": [-0.0, np.inf, np.nan][round(x)],
            "words": f"at {x}, \u2212\ud83d",
            "kind": "soft" if x < 1 else "hard",
        }

    axes = {"x": np.array([0.5, 2.0]), "flag": [True, False]}
    units = {"units": "x_s/f_s", "long_name": "compliance"}
    attributes = {"large": units | {"odd": {3}}, "x": {"units": "1/time"}}
    categories = {"kind": ["soft", "hard", "never seen"]}
    study = named(odd, attributes=attributes, categories=categories)
    kept = ss.sweep.run_study(study, axes, store=tmp_path / "s.sqlite")
    xr.testing.assert_identical(kept, ss.sweep.run_study(study, axes))
    xr.testing.assert_identical(kept, open_sweep(tmp_path / "s.sqlite"))
    kept = kept.isel(flag=0)
    assert kept["large"].attrs == units | {"odd": "{3}"}
    assert (kept["x"].units, kept["kind"].dtype) == ("1/time", np.int8)
    assert kept["kind"].attrs["flag_values"].tolist() == [-1, 0, 1, 2]
    assert kept["kind"].attrs["flag_meanings"] == "no_result soft hard never_seen"
    assert np.signbit(kept["minus zero"].values[0])
    assert kept["sometimes"].values[1] == np.float32(0.1)
    assert np.isnan(kept["sometimes"].values[0])
    assert kept["large"].values.tolist() == [0.0, 1.0]
    assert kept["words"].values.tolist() == [
        f"at {x}, \u2212\ud83d" for x in (0.5, 2.0)
    ]
    assert kept["kind"].values.tolist() == [0, 1]


@pytest.mark.slow
def test_threads_processes_and_executors_handed_in_give_the_same_bits(cases, tmp_path):
    expected = run_cases(cases.logged, LOGGED_AXES, executor=ss.sweep.Threads(1))
    executors = [ss.sweep.Threads(count) for count in (2, 5)]
    executors += [ss.sweep.Processes(2), ThreadPoolExecutor(2)]
    for i, executor in enumerate(executors):
        where = {"executor": executor, "store": tmp_path / f"{i}.sqlite"}
        found = run_cases(cases.logged, LOGGED_AXES, **where)
        xr.testing.assert_identical(found, expected)
    assert not expected.equals(run_cases(named(cases.logged, seed=4), LOGGED_AXES))


# ------------------------------------------------------- errors of cases, and the store


# a function's state is kept outside of it: objects that it holds are part of the case
COUNT = Counter()
BROKEN = threading.Event()
BEGUN = threading.Event()
GO_ON = threading.Event()


def moody(a, b, seed):  # noqa: ARG001
    COUNT[a, b] += 1
    if (a, b) == (2, 1) and BROKEN.is_set():
        raise OSError("not today")
    return {"product": a * b}


def test_a_case_that_raises_is_recorded_and_run_again_on_request_only(tmp_path):
    COUNT.clear()
    BROKEN.set()
    seen: list[ss.sweep.Progress] = []

    def result(**options):
        seen.clear()
        where = {"store": tmp_path / "s.sqlite", "progress": seen.append}
        axes = {"a": range(4), "b": range(3)}
        return run_cases(moody, axes, **options, **where)

    found = result()
    assert str(summary(found)) == "11 of 12 cases done, 1 failed"
    (failure,) = ss.sweep.failures(found)
    assert str(failure).startswith("a = 2, b = 1: OSError: not today (test_sweep.py:")
    assert np.isnan(found["product"].sel(a=2, b=1))
    begun = ss.sweep.Progress(total=12, finished=0, failed=0, found=0)
    assert (seen[0], seen[-1]) == (begun, replace(begun, finished=12, failed=1))
    BROKEN.clear()
    assert summary(result()).failed == 1
    assert seen == [ss.sweep.Progress(total=12, finished=12, failed=1, found=12)]
    assert summary(result(retry_failed=True)).failed == 0
    assert COUNT[2, 1] == sum(COUNT.values()) - 11 == 2


def test_what_a_case_must_not_return_is_its_error():
    wrong = [
        ({"y": np.zeros(2)}, "must be a number, a text or None"),
        ({"z/": 1}, "'z/' is taken, or cannot be a name"),
        ({"a": -1.0}, "'a' is taken"),
        ({"error": 1}, "'error' is taken, or"),
        ({"large": 10**400}, "OverflowError"),
        ({"kind": "odd"}, "'odd': must be one of even"),
        (3, "some study returned 3: must be a mapping"),
        ({}, "returned {}: must be"),
    ]
    study = named(lambda a, seed: wrong[a][0], categories={"kind": ["even"]})  # noqa: ARG005
    result = ss.sweep.run_study(study, {"a": range(len(wrong))})
    for failure, (_, words) in zip(ss.sweep.failures(result), wrong, strict=True):
        assert words in failure.error


@contextmanager
def changing(store):
    """Change a store while the sweep does not look."""
    with closing(sqlite3.connect(store)) as connection, connection:
        yield connection


class EnoughError(Exception):
    pass


def stop_after(count):
    def stop(p):
        if p.finished >= count:
            raise EnoughError

    return stop


def test_a_second_start_runs_only_what_is_missing(cases, tmp_path):
    """Also with other values on the axes; a reader sees how far the sweep is."""
    store = tmp_path / "s.sqlite"
    log = tmp_path / "runs.log"
    lines = []
    expected = run_cases(cases.logged, LOGGED_AXES)
    log.unlink()

    given = {"function": cases.logged, "axes": dict(LOGGED_AXES), "store": store}

    def look_and_stop(p):
        if p.finished:
            lines.append(str(status_of(store)))
            assert summary(open_sweep(store)).done == p.finished
        stop_after(20)(p)

    with pytest.raises(EnoughError):
        run_cases(**given, progress=look_and_stop)
    running = f"running as process {os.getpid()} on .*"
    assert re.match(rf"\d+ of 60 cases done, \d+ not run yet; {running}", lines[-1])
    done = np.argwhere(open_sweep(store)["status"].values != 0).tolist()
    before = {(a, LOGGED_AXES["b"][j]) for a, j in done}
    assert 20 <= len(before) < 60
    left = (
        f"{len(before)} of 60 cases done, {60 - len(before)} not run yet; not running"
    )
    assert str(status_of(store)).startswith(left)
    log.unlink()
    xr.testing.assert_identical(run_cases(**given), expected)
    every = {(a, b) for a in range(12) for b in LOGGED_AXES["b"]}
    assert set(runs(tmp_path)) == every - before
    wide = {"b": [1.0, 0.0, 9.0], "a": [1, 30]}
    given["axes"] = wide
    found = run_cases(**given)
    assert sum(runs(tmp_path).values()) == 60 - len(before) + 4
    assert max(runs(tmp_path).values()) == 1
    xr.testing.assert_identical(found, open_sweep(store))
    expected = run_cases(cases.logged, wide).drop_attrs()
    xr.testing.assert_identical(found.drop_attrs(), expected)
    # rows were deleted: the sweep is not done, and computes them again
    with changing(store) as connection:
        connection.execute("DELETE FROM cases WHERE key LIKE '%9%'")
    assert summary(open_sweep(store)).missing == status_of(store).summary.missing == 2
    xr.testing.assert_identical(run_cases(**given), found)


def closing_over(k):
    def f(x, seed):  # noqa: ARG001
        return {"y": k * x}

    return f


def test_a_study_is_its_name_and_version_and_nothing_is_guessed(tmp_path):
    """Finished cases belong to the name and version, whatever the function."""
    same = {"axes": {"x": [1.0, 2.0]}, "store": tmp_path / "s.sqlite"}

    def found(k, **other):
        study = named(closing_over(k), **({"name": "beam"} | other))
        return ss.sweep.run_study(study, **same)["y"].values.tolist()

    assert found(2) == [2.0, 4.0]
    assert found(3) == [2.0, 4.0]
    before = same["store"].read_bytes()
    for change, part in (
        ({"version": "1.0"}, "version of the study"),
        ({"name": "Beam"}, "study"),
        ({"version": "2", "name": "bar"}, "study, version of the study"),
    ):
        with pytest.raises(InputError, match=f"what differs: {part}. Choose"):
            found(3, **change)
    assert same["store"].read_bytes() == before


@pytest.mark.parametrize("given", ["", " ", 2, None])
@pytest.mark.parametrize("field", ["name", "version"])
def test_a_study_needs_a_name_and_a_version(field, given):
    with pytest.raises(InputError, match=rf"^NamedStudy\.{field} = .*[^\n]$"):
        named(product, **{field: given})


def test_names_seed_and_version_are_part_of_the_case(tmp_path, monkeypatch):
    store = tmp_path / "s.sqlite"
    same = {"function": named(product), "axes": ONE, "store": store}
    run_cases(**same)
    others = {"function": lambda **values: {"n": len(values)}, "axes": {"x": [1]}}
    seeded = {"function": named(product, seed=7)}
    for change, part in ((others, "names of the axes"), (seeded, "seed")):
        with pytest.raises(InputError, match=f"what differs: {part}"):
            run_cases(**(same | change))
    monkeypatch.setattr(_cases, "__version__", "99.0")
    with pytest.raises(InputError, match="what differs: stickslip version"):
        run_cases(**same)


def contents(folder):
    return {
        path.name: path.is_file() and path.read_bytes() for path in folder.iterdir()
    }


def test_what_is_no_store_is_refused_and_left_alone(tmp_path):
    """Nothing of a damaged store is trusted either."""
    notes = "mine, and long enough to be looked at as a database might be " * 20
    (tmp_path / "notes.txt").write_text(notes)
    (tmp_path / "photos").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for damage in (
        "UPDATE cases SET row = replace(row, '6.0', '7.0')",
        "DELETE FROM cases WHERE key = ''",
    ):
        run_cases(product, {"a": [3], "b": [2]}, store=tmp_path / damage[:6])
        with changing(tmp_path / damage[:6]) as connection:
            connection.execute(damage)
    with changing(tmp_path / "other.sqlite") as connection:
        connection.execute("CREATE TABLE mine (x)")
    before = contents(tmp_path)
    refusals = dict.fromkeys(
        ["notes.txt", "other.sqlite"], "is not the store of a sweep"
    )
    refusals |= dict.fromkeys(["photos", "pipe"], "is no regular file")
    refusals |= dict.fromkeys(["UPDATE", "DELETE"], "is damaged")
    for name, words in (refusals | {"x" * 300: "File name too long"}).items():
        with pytest.raises(InputError, match=words):
            run_cases(product, {"a": [3], "b": [2]}, store=tmp_path / name)
        with pytest.raises(InputError, match=words):
            open_sweep(tmp_path / name)
    with pytest.raises(InputError, match="there is no such file"):
        open_sweep(tmp_path / "nowhere")
    assert contents(tmp_path) == before


def test_two_sweeps_of_one_process_on_one_store(tmp_path):
    def waiting(a, seed):  # noqa: ARG001
        BEGUN.set()
        GO_ON.wait(30)
        return {"b": a}

    store = tmp_path / "s.sqlite"
    link = tmp_path / "link.sqlite"
    link.symlink_to(store)
    given = {"axes": {"a": [1, 2]}, "store": store}
    through_link = given | {"store": link}
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(run_cases, waiting, **given)
        BEGUN.wait(30)
        for again in (given, through_link):
            message = f"another sweep .process {os.getpid()} on .* is writing it"
            with pytest.raises(InputError, match=message):
                run_cases(waiting, **again)
        GO_ON.set()
        assert summary(first.result()).done == 2


def ran(script, directory):
    """Return the output of a script run in a process of its own."""
    path = directory / "script.py"
    path.write_text(textwrap.dedent(script))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    options = {"capture_output": True, "text": True, "timeout": 120, "check": False}
    return subprocess.run([sys.executable, str(path)], env=environment, **options)


def test_a_disk_that_refuses_more_ends_with_a_line_and_keeps_what_was_written(tmp_path):
    # A limit on file sizes replaces a full disk: writes fail in the operating system,
    # half way.
    script = f"""
        import resource
        from stickslip.errors import InputError
        from stickslip.sweep import NamedStudy, Threads, _run, _table, open_sweep, run_study, summary

        _table.EVERY = _run.SECONDS = 0.0
        given = {{"axes": {{"a": range(60)}}, "store": {str(tmp_path / "s.sqlite")!r}}}

        def case(a, seed):
            return {{"y": 200 * str(a)}}

        study = NamedStudy(run=case, name="long texts", version="1")

        def full(p):
            if p.finished >= 20:
                resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))

        try:
            run_study(study, **given, progress=full, executor=Threads(1))
        except InputError as error:
            print(error)
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        print(summary(open_sweep(given["store"])))
        print(summary(run_study(study, **given)))
    """  # noqa: E501
    line, kept, resumed = ran(script, tmp_path).stdout.splitlines()
    full = "(disk I/O error); what was written is kept: free some space"
    assert f"cannot be written {full}" in line
    assert re.match(r"2[01] of 60 cases done, (40|39) not run yet", kept)
    assert resumed == "60 of 60 cases done"


@pytest.mark.slow
def test_a_case_that_kills_its_worker_is_found_and_recorded(cases, tmp_path):
    axes = {"a": range(6), "b": range(4)}
    where = {"executor": ss.sweep.Processes(2), "store": tmp_path / "s.sqlite"}
    result = run_cases(cases.deadly, axes, **where)
    assert str(summary(result)) == "23 of 24 cases done, 1 failed"
    assert ss.sweep.failures(result)[0].parameters == {"a": 3, "b": 2}
    assert ss.sweep.failures(result)[0].error.startswith("WorkerDied: ")


@pytest.mark.slow
def test_a_script_without_a_guard_gets_the_mitigation(tmp_path):
    script = """
        from stickslip.sweep import NamedStudy, Processes, run_study

        def case(a, seed):
            return {"b": a}

        study = NamedStudy(run=case, name="copies", version="1")
        run_study(study, {"a": [1, 2]}, executor=Processes(1))
    """
    assert 'behind `if __name__ == "__main__":`' in ran(script, tmp_path).stderr


# ---------------------------------------------------------------- refinement


def parabola(x, y, seed):  # noqa: ARG001
    return {"side": "above" if y > 0.25 + 0.5 * x * x else "below", "height": y}


UNIT = {"x": Span(low=0, high=1), "y": Span(low=0, high=1)}


def refine(function, plane, **how):
    """Search where the side changes."""
    names = {"store", "executor", "progress"} & how.keys()
    options = {name: how.pop(name) for name in names}
    refinement = ss.sweep.Refinement(**{"label": "side", **how})
    return run_cases(function, plane, refinement=refinement, **options)


def test_refinement_finds_a_boundary_as_sharply_as_a_grid_of_ten_times_the_runs():
    found = refine(parabola, UNIT, runs=160)
    assert 150 < found.sizes["run"] <= 160
    t = np.linspace(0, 1, 2001)
    away = found["x_at"].values[:, None] - t
    above = found["y_at"].values[:, None] - 0.25 - 0.5 * t * t
    off = np.hypot(away, above)
    # half of the requested resolution, the cells of a grid of 40 x 40
    assert off.min(axis=1).max() <= 1 / 80
    assert off.min(axis=0).max() < 0.06  # and no part of the curve is missing
    error = np.hypot(found["x_error"], found["y_error"]).values
    assert (off.min(axis=1) <= error + 1e-12).all()
    # other results of the function are there
    np.testing.assert_array_equal(found["height"], found["y"])


def test_refinement_is_the_same_for_any_number_of_workers():
    """The search ignores cases that fail."""

    def patchy(x, y, seed):
        if x > 0.8:
            raise ValueError("no")
        return parabola(x, y, seed)

    study = named(patchy, categories={"side": ["below", "above"]})
    plane = {"x": Span(low=0, high=1), "y": Span(low=0.01, high=1.0, log=True)}
    one = refine(study, plane, executor=ss.sweep.Threads(1), runs=80)
    more = refine(study, plane, executor=ss.sweep.Threads(3), runs=80)
    xr.testing.assert_identical(one, more)
    assert (one["error"].values[one["x"].values > 0.8] != "").all()
    assert ss.sweep.failures(one)[0].parameters.keys() == {"x", "y"}
    assert one.sizes["crossing"] > 3
    assert np.abs(one["y_at"] - 0.25 - 0.5 * one["x_at"] ** 2).max() < 0.03
    assert set(one["from_side"].values) | set(one["to_side"].values) == {0, 1}
    meanings = [one[name].attrs["flag_meanings"] for name in ("from_side", "side")]
    assert meanings == ["no_result below above"] * 2


def branches(x, y, branch, seed):
    COUNT[x, y, branch] += 1
    if branch == "up":
        return parabola(x, y, seed)
    return {"side": "above" if x > 0.5 else "below", "height": y}


def test_refinement_goes_on_from_its_store_the_way_a_grid_does(tmp_path, monkeypatch):
    at_once(monkeypatch)
    store = tmp_path / "s.sqlite"
    plane = UNIT | {"branch": ["up", "down"]}
    expected = refine(branches, plane, runs=40)
    COUNT.clear()
    with pytest.raises(EnoughError):
        refine(branches, plane, runs=40, store=store, progress=stop_after(55))
    part = open_sweep(store)
    assert 55 <= part.sizes["run"] < expected.sizes["run"] <= 80
    assert status_of(store).summary.missing == 80 - part.sizes["run"]
    found = refine(branches, plane, runs=40, store=store)
    xr.testing.assert_identical(found, expected)
    xr.testing.assert_identical(open_sweep(store), expected)
    count = found.sizes["run"]
    assert str(status_of(store)) == f"{count} of {count} cases done"
    assert max(COUNT.values()) == 1
    with changing(store) as connection:
        connection.execute("DELETE FROM cases WHERE key LIKE '%up%'")
    assert status_of(store).summary.missing > 30
    xr.testing.assert_identical(refine(branches, plane, runs=40, store=store), expected)
    with pytest.raises(InputError, match="holds another sweep; what differs: seed"):
        refine(named(branches, seed=1), plane, runs=40, store=store)


# ---------------------------------------------------------------- what is refused


def closed():
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    return pool


REFUSED = (
    lambda: run_cases(product, {}),
    "must map at least one name",
    lambda: run_cases(product, {"a": [], "b": [1]}),
    lambda: run_cases(product, {"a": [1, 1], "b": [1]}),
    lambda: run_cases(product, {"a": [1, "x"], "b": [1]}),
    lambda: run_cases(product, {"a": [2**53 + 1, 1.5], "b": [1]}),
    lambda: run_cases(product, {"a": [1.0, float("nan")], "b": [1]}),
    lambda: run_cases(product, {"a": [[1], [2]], "b": [1]}),
    r"axes\['a'\] = .*: must be a list of numbers, texts or truth values, each once",
    lambda: run_cases(product, {"a": [1], "b/c": [1]}),
    "cannot be a name",
    lambda: run_cases(product, {"a": [1], "error": [1]}),
    "is taken",
    lambda: run_cases(product, dict.fromkeys("ab", range(2000))),
    r"4e\+06 cases are more than max_cases = 1e\+06; take fewer values, or set",
    lambda: ss.sweep.Threads(0),
    r"Threads\.workers = 0: must be",
    lambda: run_cases(product, ONE, executor=closed()),
    "takes no more cases",
    lambda: run_cases(closing_over(2), {"x": [1]}, executor=ss.sweep.Processes(1)),
    r"NamedStudy\.run, some study: cannot be sent .* process .*use Threads",
    lambda: summary(xr.Dataset()),
    "must be the result of a sweep",
    lambda: refine(parabola, UNIT | {"x": [1]}),
    "plane of two parameters",
    lambda: run_cases(parabola, UNIT),
    r"axes\.x\.count: is missing",
    lambda: Span(low=1, high=0),
    r"Span\.high = 0: must be",
    lambda: Span(low=0, high=1, log=True),
    r"Span\.low = 0: must be",
    lambda: ss.sweep.Refinement(runs=3),
    "runs = 3: must be",
    lambda: refine(parabola, UNIT, runs=16, label="colour"),
    "label = 'colour': is not one of the names",
)


@refused(*REFUSED)
def test_what_cannot_be_run_is_refused(tmp_path, monkeypatch, call, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        call()
