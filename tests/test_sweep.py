"""Sweeps: the same results wherever they run, whatever is killed; refusals in one line; boundaries with few runs."""

import errno
import functools
import importlib
import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
import warnings
from collections import Counter
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr

from stickslip.errors import InputError
from stickslip.sweep import (
    Processes,
    Progress,
    Span,
    Threads,
    failures,
    open_sweep,
    refine,
    summary,
    sweep,
)
from stickslip.sweep import _run as run_module
from stickslip.sweep import _store as store_module
from stickslip.sweep import _worker as worker_module
from stickslip.sweep._content import cell_seed, code_parts, encode

pytest.importorskip("zarr", reason="the store of a sweep needs zarr: pip install stickslip[sweep]")

AXES = {"stiffness": [1.0, 2.0, 3.0], "velocity": np.linspace(0.1, 1.0, 7), "start": ["from rest", "smooth"]}


def case(stiffness, velocity, start, seed):
    draws = np.random.default_rng(seed).random(3)
    return {"sum": stiffness + velocity + len(start) + draws[0], "draws": draws}


def measure(run):
    draws = xr.DataArray(run["draws"], dims="draw", coords={"draw": [1, 2, 3]}, attrs={"units": "f_s"})
    return {"sum": run["sum"], "draws": draws, "regime": "smooth" if run["sum"] > 6 else "stick-slip"}


def product(a, b):
    if a == 2 and b == 1:
        raise ValueError("two and one do not go together")
    return {"product": a * b}


def itself(result):
    return result


# Cases for other processes live in a module that these can import; each run leaves a line in a file.
MODULE = """
import os, signal, time
import numpy as np

def logged(a, b, seed, log=None, pause=0.01):
    with open(os.environ["SWEEP_LOG"], "a") as file:
        file.write(f"{a} {b} {os.getpid()}\\n")
    time.sleep(float(os.environ.get("SWEEP_PAUSE", "0.01")))
    return a + np.random.default_rng(seed).random() * b

def deadly(a, b):
    if a == 3 and b == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return a * b

def value(result):
    return {"value": result, "label": "high" if result > 5 else "low"}
"""
LOGGED_AXES = {"a": range(12), "b": [0.0, 1.0, 2.0, 3.0, 4.0]}


@pytest.fixture
def cases(tmp_path, monkeypatch):
    (tmp_path / "sweep_cases.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("SWEEP_LOG", str(tmp_path / "runs.log"))
    monkeypatch.setattr("stickslip.sweep._run.LANDING", float("inf"))  # write at once: tests kill at given counts
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *filter(None, sys.path)]))
    sys.modules.pop("sweep_cases", None)
    module = importlib.import_module("sweep_cases")
    yield module
    sys.modules.pop("sweep_cases", None)


def runs(tmp_path):
    """How often each case was run."""
    log = tmp_path / "runs.log"
    lines = log.read_text().splitlines() if log.exists() else []
    return Counter((int(a), float(b)) for a, b, _ in (line.split() for line in lines))


def finished(store):
    """Cases that count as finished in a store."""
    keys = open_sweep(store)["case_key"].values
    return {(a, LOGGED_AXES["b"][j]) for a, j in np.argwhere(keys != 0).tolist()}


def wait_for(condition, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "nothing happened"
        time.sleep(0.01)


# ---------------------------------------------------------------- results


def test_axes_become_dimensions_of_one_dataset():
    result = sweep(case, AXES, measure)
    assert dict(result["sum"].sizes) == {"stiffness": 3, "velocity": 7, "start": 2}
    assert result["draws"].dims == ("stiffness", "velocity", "start", "draw")
    assert result["draws"].attrs["units"] == "f_s"
    at = {"stiffness": 2.0, "velocity": AXES["velocity"][3], "start": "from rest"}
    alone = measure(case(**at, seed=cell_seed(0, at)))
    assert float(result["sum"].sel(at)) == alone["sum"]
    assert result["regime"].sel(at).item() == alone["regime"]
    np.testing.assert_array_equal(result["draws"].sel(at), alone["draws"])
    assert str(summary(result)) == "42 of 42 cases done"
    for name in result.variables:
        assert {"units", "long_name"} <= result[name].attrs.keys()
    assert json.loads(result.attrs["provenance"])["axes"] == {"stiffness": 3, "velocity": 7, "start": 2}


def test_plain_numbers_arrays_and_complex_values(tmp_path):
    def spectrum(frequency):
        return {"response": 1 / (1 + 1j * frequency), "table": np.eye(2) * frequency, "large": frequency > 1}

    axes = {"frequency": xr.DataArray([0.5, 2.0], dims="f", attrs={"units": "1/time"})}
    notes = {"response": {"units": "x_s/f_s", "long_name": "compliance"}}
    kept = sweep(spectrum, axes, itself, store=tmp_path / "s.zarr", attributes=notes)
    xr.testing.assert_identical(kept, sweep(spectrum, axes, itself, attributes=notes))
    assert kept["response"].dtype == complex
    assert kept["response"].attrs == notes["response"]
    assert kept["frequency"].attrs["units"] == "1/time"
    assert kept["table"].dims == ("frequency", "table_0", "table_1")
    assert kept["large"].values.tolist() == [0.0, 1.0]


def test_plain_xarray_opens_the_store_without_a_word(tmp_path):
    result = sweep(case, AXES, measure, store=tmp_path / "s.zarr", batch=4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plain = xr.open_zarr(tmp_path / "s.zarr", chunks=None)
    np.testing.assert_array_equal(plain["sum"], result["sum"])
    assert plain["regime"].values.tolist() == result["regime"].values.tolist()
    assert plain["sum"].encoding["chunks"] == (1, 2, 2)  # chunk = batch


@pytest.mark.parametrize("batch", [None, 1, 5, 1000])
@pytest.mark.parametrize("executor", [Threads(1), Threads(2), Threads(5)], ids=str)
def test_any_number_of_threads_and_any_batch_give_the_same_bits(tmp_path, executor, batch):
    expected = sweep(case, AXES, measure, seed=3, executor=Threads(1))
    result = sweep(case, AXES, measure, seed=3, executor=executor, batch=batch, store=tmp_path / "s.zarr")
    xr.testing.assert_identical(result, expected)
    assert not result.equals(sweep(case, AXES, measure, seed=4))


def test_processes_and_executors_handed_in_give_the_same_bits(cases, tmp_path):
    expected = sweep(cases.logged, LOGGED_AXES, cases.value, executor=Threads(1))
    for executor in (Processes(1), Processes(2)):
        xr.testing.assert_identical(
            sweep(cases.logged, LOGGED_AXES, cases.value, executor=executor, store=tmp_path / f"{executor}.zarr"),
            expected,
        )
    with ThreadPoolExecutor(2) as handed_in:
        xr.testing.assert_identical(sweep(cases.logged, LOGGED_AXES, cases.value, executor=handed_in), expected)


def test_the_seed_depends_on_the_case_alone():
    here = {"a": 1.0, "b": "x"}
    assert cell_seed(1, here) == cell_seed(1, {"b": "x", "a": 1.0})
    seeds = {cell_seed(s, {"a": a, "b": b}) for s in range(5) for a in np.linspace(0, 1, 20).tolist() for b in "xyz"}
    assert len(seeds) == 300
    wide = sweep(case, AXES, measure)
    narrow = sweep(case, AXES | {"velocity": AXES["velocity"][2:4]}, measure)
    xr.testing.assert_equal(narrow["sum"], wide["sum"].isel(velocity=slice(2, 4)))


def test_seed_as_an_axis_is_the_users_own():
    result = sweep(lambda seed: {"given": seed}, {"seed": [5, 6]}, itself)
    assert result["given"].values.tolist() == [5, 6]


def test_progress_counts(tmp_path):
    seen: list[Progress] = []
    axes = {"a": range(4), "b": range(3)}
    sweep(product, axes, itself, store=tmp_path / "s.zarr", batch=3, progress=seen.append)
    assert (seen[0].finished, seen[0].total) == (0, 12)
    assert (seen[-1].finished, seen[-1].failed, seen[-1].found) == (12, 1, 0)
    assert [p.finished for p in seen] == sorted(p.finished for p in seen)
    seen.clear()
    sweep(product, axes, itself, store=tmp_path / "s.zarr", progress=seen.append)
    assert [(p.finished, p.failed, p.found) for p in seen] == [(12, 1, 12)]


# ---------------------------------------------------------------- errors of cases


@pytest.mark.parametrize("stored", [False, True])
def test_a_case_that_raises_is_recorded_and_the_others_go_on(tmp_path, stored):
    axes = {"a": range(4), "b": range(3)}
    result = sweep(product, axes, itself, store=tmp_path / "s.zarr" if stored else None)
    assert str(summary(result)) == "11 of 12 cases done, 1 failed"
    (failure,) = failures(result)
    assert failure.parameters == {"a": 2, "b": 1}
    assert str(failure).startswith("a = 2, b = 1: ValueError: two and one do not go together (test_sweep.py:")
    assert np.isnan(result["product"].sel(a=2, b=1))
    assert float(result["product"].sel(a=3, b=2)) == 6.0


def test_when_every_case_fails_the_errors_are_the_result(tmp_path):
    def hopeless(a):
        raise RuntimeError(f"no {a}")

    result = sweep(hopeless, {"a": [1, 2]}, itself, store=tmp_path / "s.zarr")
    assert summary(result).failed == 2
    assert [failure.parameters["a"] for failure in failures(result)] == [1, 2]


def test_failed_cases_are_run_again_on_request_only(tmp_path):
    count = Counter()
    broken = threading.Event()
    broken.set()

    def moody(a):
        count[a] += 1
        if a == 1 and broken.is_set():
            raise OSError("not today")
        return {"a2": a * a}

    kept = tmp_path / "s.zarr"
    assert summary(sweep(moody, {"a": range(3)}, itself, store=kept)).failed == 1
    broken.clear()
    assert summary(sweep(moody, {"a": range(3)}, itself, store=kept)).failed == 1
    again = sweep(moody, {"a": range(3)}, itself, store=kept, retry_failed=True)
    assert summary(again).failed == 0
    assert again["a2"].values.tolist() == [0, 1, 4]
    assert count == {0: 1, 1: 2, 2: 1}


def test_another_shape_or_name_is_an_error_of_that_case():
    def ragged(a):
        return {"x": np.zeros(a), "y": 1} if a < 4 else {"x": np.zeros(2)}

    result = sweep(ragged, {"a": [2, 3, 4]}, itself, executor=Threads(1), batch=1)
    assert [failure.parameters["a"] for failure in failures(result)] == [3, 4]
    assert "shape (3,)" in failures(result)[0].error
    assert "['x']" in failures(result)[1].error


# ---------------------------------------------------------------- a store that resumes and refuses


def test_a_second_start_runs_only_what_is_missing(cases, tmp_path):
    store, log = tmp_path / "s.zarr", tmp_path / "runs.log"
    expected = sweep(cases.logged, LOGGED_AXES, cases.value)
    log.unlink()

    class EnoughError(Exception):
        pass

    def stop(p):
        if p.finished >= 20:
            raise EnoughError

    with pytest.raises(EnoughError):
        sweep(cases.logged, LOGGED_AXES, cases.value, store=store, batch=5, progress=stop)
    before = finished(store)
    assert 20 <= len(before) < 60
    log.unlink()
    xr.testing.assert_identical(sweep(cases.logged, LOGGED_AXES, cases.value, store=store, batch=5), expected)
    assert set(runs(tmp_path)) == {(a, b) for a in range(12) for b in LOGGED_AXES["b"]} - before
    assert max(runs(tmp_path).values()) == 1


def test_a_block_that_is_partly_finished_is_completed(tmp_path, monkeypatch):
    monkeypatch.setattr("stickslip.sweep._run.SECONDS", 0.0)  # every batch ends after one case
    axes = {"a": range(6), "b": range(5)}
    small = sweep(product, axes, itself, store=tmp_path / "s.zarr", executor=Threads(2))
    xr.testing.assert_identical(small, sweep(product, axes, itself))


def test_a_changed_case_is_never_mistaken_for_an_old_one(tmp_path):
    (tmp_path / "s").mkdir()
    source = "LIMIT = 2\n\ndef inner(a):\n    return a * LIMIT\n\ndef case(a):\n    return {'y': inner(a)}\n"

    def load(text):
        path = tmp_path / "changing.py"
        path.write_text(text)
        spec = importlib.util.spec_from_file_location("changing", path)
        module = importlib.util.module_from_spec(spec)
        importlib.import_module("linecache").clearcache()
        spec.loader.exec_module(module)
        return module.case

    store = tmp_path / "s"
    sweep(load(source), {"a": [1, 2]}, itself, store=store)
    sweep(load(source), {"a": [1, 2]}, itself, store=store)
    for changed, part in [("LIMIT = 3", "code of case: inner: LIMIT"), ("LIMIT = 2\nX = 1", None)]:
        function = load(source.replace("LIMIT = 2", changed))
        if part is None:
            sweep(function, {"a": [1, 2]}, itself, store=store)
        else:
            with pytest.raises(InputError, match=part):
                sweep(function, {"a": [1, 2]}, itself, store=store)
    with pytest.raises(InputError, match="code of case: inner"):
        sweep(load(source.replace("a * LIMIT", "a + LIMIT")), {"a": [1, 2]}, itself, store=store)


@dataclass(frozen=True)
class Rig:
    mass: float

    def __call__(self, **values):
        return {"y": self.mass * sum(values.values())}


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"axes": {"x": [1.0, 2.5]}}, "axis x"),
        ({"axes": {"y": [1.0, 2.0]}}, "names of the axes"),
        ({"case": Rig(2.0)}, "code of case: its object"),
        ({"seed": 7}, "seed"),
        ({"fingerprint": "rig.toml, second version"}, "fingerprint"),
        ({"measure": lambda _: {"z": 1}}, "code of measure"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_another_sweep_is_refused_and_the_difference_named(tmp_path, change, part):
    same = {"case": Rig(1.0), "axes": {"x": [1.0, 2.0]}, "measure": itself, "store": tmp_path / "s.zarr"}
    sweep(**same)
    with pytest.raises(InputError, match=f"holds another sweep; what differs: .*{part}"):
        sweep(**(same | change))
    assert summary(sweep(**same)).done == 2


def test_the_version_of_the_package_is_part_of_the_case(tmp_path, monkeypatch):
    sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")
    monkeypatch.setattr(run_module, "package_version", lambda: "99.0")
    with pytest.raises(InputError, match="stickslip version"):
        sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")


def test_a_store_of_another_format_is_refused(tmp_path):
    sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")
    meta = tmp_path / "s.zarr" / "zarr.json"
    content = json.loads(meta.read_text())
    provenance = json.loads(content["attributes"]["provenance"]) | {"format_version": 99}
    content["attributes"]["provenance"] = json.dumps(provenance)
    meta.write_text(json.dumps(content))
    for attempt in (
        lambda: open_sweep(tmp_path / "s.zarr"),
        lambda: sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr"),
    ):
        with pytest.raises(InputError, match="has the format stickslip-sweep 99, but this is stickslip"):
            attempt()


def test_what_is_no_store_is_refused_and_left_alone(tmp_path):
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    directory = tmp_path / "photos"
    directory.mkdir()
    (directory / "cat.png").write_text("mine")
    for place in (file, directory):
        with pytest.raises(InputError, match="store = "):
            sweep(product, {"a": [1], "b": [1]}, itself, store=place)
        with pytest.raises(InputError, match="store = "):
            open_sweep(place)
    with pytest.raises(InputError, match="there is no such directory"):
        open_sweep(tmp_path / "nowhere")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt", "photos"]


def test_a_cell_counts_as_finished_only_when_its_key_is_right(tmp_path):
    axes = {"a": range(4), "b": range(3)}
    expected = sweep(product, axes, itself, store=tmp_path / "s.zarr")
    expected.load()
    group, _ = store_module.read_group(tmp_path / "s.zarr")
    keys = group["case_key"][...]
    keys[0, 0], keys[3, 1] = 0, 12345
    group["case_key"][...] = keys
    group["product"][0, 0] = group["product"][3, 1] = -1.0
    xr.testing.assert_identical(sweep(product, axes, itself, store=tmp_path / "s.zarr"), expected)


def test_missing_zarr_is_said_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(InputError, match=r"pip install stickslip\[sweep\]"):
        sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")
    assert summary(sweep(product, {"a": [1], "b": [1]}, itself)).done == 1


# ---------------------------------------------------------------- two at once


def test_two_sweeps_on_one_store_the_second_is_turned_away(cases, tmp_path):
    store = tmp_path / "s.zarr"
    other = start(tmp_path, "Threads(2)", pause="0.2")
    try:
        wait_for(lambda: len(runs(tmp_path)) > 2)
        with pytest.raises(InputError, match=rf"another sweep \(process {other.pid} on .*\) is writing it"):
            sweep(cases.logged, LOGGED_AXES, cases.value, store=store)
    finally:
        other.kill()
        other.wait()
    assert (tmp_path / "s.zarr.lock").exists()  # of a dead process: taken over
    result = sweep(cases.logged, LOGGED_AXES, cases.value, store=store)
    assert summary(result).done == 60
    assert not (tmp_path / "s.zarr.lock").exists()


def test_two_sweeps_of_one_process_on_one_store(tmp_path):
    begun, go_on = threading.Event(), threading.Event()

    def waiting(a):
        begun.set()
        go_on.wait(30)
        return {"b": a}

    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(sweep, waiting, {"a": [1, 2]}, itself, store=tmp_path / "s.zarr")
        begun.wait(30)
        try:
            with pytest.raises(InputError, match="another sweep of this process"):
                sweep(waiting, {"a": [1, 2]}, itself, store=tmp_path / "s.zarr")
        finally:
            go_on.set()
        assert summary(first.result()).done == 2


def test_a_lock_of_another_host_is_not_broken(tmp_path):
    lock = tmp_path / "s.zarr.lock"
    lock.write_text(json.dumps({"pid": 1, "host": "elsewhere"}))
    with pytest.raises(InputError, match=r"process 1 on elsewhere.*if that process is gone, remove .*s\.zarr\.lock"):
        sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")
    lock.unlink()
    assert summary(sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")).done == 1


# ---------------------------------------------------------------- disks


def test_a_disk_that_refuses_more_ends_with_a_line_and_keeps_what_was_written(tmp_path):
    # A limit on the size of files stands for the full disk: the writes fail in the kernel, half way.
    script = f"""
        import resource
        import numpy as np
        from stickslip.errors import InputError
        from stickslip.sweep import Threads, _run, sweep

        _run.LANDING = float("inf")

        def case(a):
            return {{"y": np.random.default_rng(a).random(20)}}

        def measure(result):
            return result

        def full(p):
            if p.finished >= 20:
                resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))

        try:
            sweep(case, {{"a": range(60)}}, measure, store={str(tmp_path / "s.zarr")!r}, batch=5, progress=full,
                  executor=Threads(1))
        except InputError as error:
            print(error)
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        from stickslip.sweep import open_sweep, summary
        print(summary(open_sweep({str(tmp_path / "s.zarr")!r})))
        print(summary(sweep(case, {{"a": range(60)}}, measure, store={str(tmp_path / "s.zarr")!r})))
    """
    path = tmp_path / "full.py"
    path.write_text(textwrap.dedent(script))
    result = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, timeout=120, check=False)
    assert result.returncode == 0, result.stderr
    line, kept, resumed = result.stdout.splitlines()
    assert "cannot be written (File too large); what was written is kept: free some space" in line
    assert kept == "20 of 60 cases done, 40 not run yet"
    assert resumed == "60 of 60 cases done"


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES, errno.ENOSPC])
def test_a_place_that_cannot_be_written(tmp_path, monkeypatch, number):
    def refuse(*_args, **_kwargs):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(store_module.os, "open", refuse)
    with pytest.raises(InputError, match=rf"cannot be written \({os.strerror(number)}\)"):
        sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")


def test_a_parent_that_is_a_file(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "file" / "s.zarr")


def test_a_complete_store_is_read_without_writing(tmp_path, monkeypatch):
    sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")

    def refuse(*_args, **_kwargs):
        raise AssertionError("asked for a lock")

    monkeypatch.setattr(store_module, "locked", refuse)
    assert summary(sweep(product, {"a": [1], "b": [1]}, itself, store=tmp_path / "s.zarr")).done == 1


# ---------------------------------------------------------------- kill -9

SCRIPT = """
import sys
from sweep_cases import logged, value
from stickslip.sweep import Processes, Threads, _run, sweep

if __name__ == "__main__":
    _run.LANDING = float("inf")
    sweep(logged, {axes!r}, value, store={store!r}, executor={executor}, batch=3)
"""


def start(tmp_path, executor, pause="0.03"):
    """Start a sweep in a process of its own."""
    script = tmp_path / "start.py"
    axes = {name: list(values) for name, values in LOGGED_AXES.items()}
    script.write_text(SCRIPT.format(axes=axes, store=str(tmp_path / "s.zarr"), executor=executor))
    environment = os.environ | {"SWEEP_PAUSE": pause}
    return subprocess.Popen([sys.executable, str(script)], env=environment)


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["Threads(2)", "Processes(2)"])
def test_kill_the_sweep(cases, tmp_path, executor):
    expected = sweep(cases.logged, LOGGED_AXES, cases.value)
    (tmp_path / "runs.log").unlink()
    store = tmp_path / "s.zarr"
    stored: set[tuple[int, float]] = set()
    for enough in (8, 25):
        process = start(tmp_path, executor)
        wait_for(lambda n=enough: store.exists() and len(finished(store)) >= n)
        process.kill()
        process.wait()
        workers_end(tmp_path)
        again = finished(store)
        assert stored <= again
        assert len(again) < 60
        stored = again
    before = runs(tmp_path)
    result = sweep(cases.logged, LOGGED_AXES, cases.value, store=store)
    xr.testing.assert_identical(result, expected)
    after = runs(tmp_path)
    assert all(after[cell] == before[cell] for cell in stored)  # nothing ran again that the store had
    assert all(after[cell] == before[cell] + 1 for cell in set(after) - stored)


def workers_end(tmp_path):
    """Wait until no process that ran a case is left: the workers of a killed sweep end with it."""
    log = tmp_path / "runs.log"
    pids = {int(line.split()[2]) for line in log.read_text().splitlines()} - {os.getpid()}
    wait_for(lambda: not any(os.path.exists(f"/proc/{pid}") for pid in pids), 15)


@pytest.mark.slow
def test_kill_a_worker_of_the_pool(cases, tmp_path, monkeypatch):
    expected = sweep(cases.logged, LOGGED_AXES, cases.value)
    (tmp_path / "runs.log").unlink()
    monkeypatch.setenv("SWEEP_PAUSE", "0.03")
    killed: list[int] = []
    stored_at_kill: list[int] = []

    def kill(p):
        if p.finished >= 15 * (len(killed) + 1) and len(killed) < 2:
            killed.append(int((tmp_path / "runs.log").read_text().split()[-1]))
            stored_at_kill.append(p.finished)
            os.kill(killed[-1], signal.SIGKILL)

    result = sweep(
        cases.logged,
        LOGGED_AXES,
        cases.value,
        store=tmp_path / "s.zarr",
        executor=Processes(2),
        batch=3,
        progress=kill,
    )
    assert len(killed) == 2
    xr.testing.assert_identical(result, expected)
    counts = runs(tmp_path)
    # At most two batches for each of two workers were in flight at each kill; all others ran once.
    assert sum(count > 1 for count in counts.values()) <= 2 * 4 * 3
    assert sum(count == 1 for count in counts.values()) >= 60 - 2 * 4 * 3


@pytest.mark.slow
def test_a_case_that_kills_its_worker_is_found_and_recorded(cases, tmp_path):
    axes = {"a": range(6), "b": range(4)}
    result = sweep(cases.deadly, axes, cases.value, executor=Processes(2), batch=4, store=tmp_path / "s.zarr")
    assert str(summary(result)) == "23 of 24 cases done, 1 failed"
    assert failures(result)[0].parameters == {"a": 3, "b": 2}
    assert failures(result)[0].error.startswith("WorkerDied: ")


def test_a_pool_handed_in_that_loses_a_worker_is_not_ours_to_rebuild(cases, tmp_path):
    import multiprocessing

    with (
        ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool,
        pytest.raises(InputError, match=r"has lost a worker .* of 24 cases are kept in .*: start again"),
    ):
        sweep(
            cases.deadly,
            {"a": range(6), "b": range(4)},
            cases.value,
            executor=pool,
            batch=4,
            store=tmp_path / "s.zarr",
        )
    assert summary(open_sweep(tmp_path / "s.zarr")).done >= 8


# ---------------------------------------------------------------- dask, on this machine only


@pytest.fixture
def dask_client(cases):  # noqa: ARG001 (workers must find its module)
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    with (
        warnings.catch_warnings(),
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
            processes=True,
            silence_logs=50,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        warnings.simplefilter("ignore")
        yield client


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_dask_gives_the_same_bits_and_loses_nothing_with_a_worker(cases, tmp_path, dask_client):
    expected = sweep(cases.logged, LOGGED_AXES, cases.value)
    (tmp_path / "runs.log").unlink()
    dask_client.run(os.environ.__setitem__, "SWEEP_PAUSE", "0.03")
    killed: list[int] = []

    def kill(p):
        if p.finished >= 15 and not killed:
            killed.append(int((tmp_path / "runs.log").read_text().split()[-1]))
            os.kill(killed[-1], signal.SIGKILL)

    result = sweep(
        cases.logged,
        LOGGED_AXES,
        cases.value,
        store=tmp_path / "s.zarr",
        executor=dask_client.get_executor(),
        batch=3,
        progress=kill,
    )
    assert killed
    xr.testing.assert_identical(result, expected)
    # Only batches that were in flight, or done and not yet fetched, ran again.
    assert sum(count > 1 for count in runs(tmp_path).values()) <= 4 * 3

    # A function that is not importable goes along by value.
    squares = sweep(lambda a: {"square": a * a}, {"a": range(5)}, itself_of(), executor=dask_client.get_executor())
    assert squares["square"].values.tolist() == [0, 1, 4, 9, 16]


def itself_of():
    return lambda result: result


# ---------------------------------------------------------------- executors


class Immediately(Executor):
    """An executor that runs everything at once, in the caller; says nothing of its workers."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def test_any_executor_will_do():
    xr.testing.assert_identical(sweep(case, AXES, measure, executor=Immediately()), sweep(case, AXES, measure))


class ElsewhereExecutor(Immediately):
    """The same, but errors come with the result, as from another machine."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def test_a_worker_of_another_version_is_turned_away(tmp_path, monkeypatch):
    here = worker_module.package_version()
    monkeypatch.setattr(worker_module, "package_version", lambda: "0.0.1")
    worker_module._load.cache_clear()  # this process is no new worker
    message = (
        rf"a worker has stickslip 0\.0\.1, but the sweep {re.escape(here)}; install the same .* 0 of 42 cases are kept"
    )
    with pytest.raises(InputError, match=message):
        sweep(case, AXES, measure, executor=ElsewhereExecutor(), store=tmp_path / "s.zarr")


def test_what_is_no_executor_is_refused():
    with pytest.raises(InputError, match=r"executor = 4: must be Threads\(n\)"):
        sweep(product, {"a": [1], "b": [1]}, itself, executor=4)
    with pytest.raises(InputError, match=r"Threads\.workers = 0: must be"):
        Threads(0)
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    with pytest.raises(InputError, match="takes no more cases"):
        sweep(product, {"a": [1], "b": [1]}, itself, executor=pool)


def test_functions_that_cannot_be_sent_are_named():
    def local(a):
        return {"a": a}

    with pytest.raises(InputError, match=r"case = .*local: cannot be sent to another process .*use Threads"):
        sweep(local, {"a": [1]}, itself, executor=Processes(1))
    with pytest.raises(InputError, match=r"measure = .*lambda"):
        sweep(json.dumps, {"obj": [1]}, lambda _: {"b": 1}, executor=Processes(1))


@pytest.mark.slow
def test_functions_that_workers_cannot_import_are_named(monkeypatch):
    # As at a prompt: the parent has the function, a fresh process does not find it.
    module = type(sys)("only_here")
    exec("def case(a):\n    return {'b': a}\n", module.__dict__)
    monkeypatch.setitem(sys.modules, "only_here", module)
    with pytest.raises(InputError, match=r"the workers cannot load them .*only_here"):
        sweep(module.case, {"a": [1]}, module.case, executor=Processes(1))


@pytest.mark.slow
def test_a_script_without_a_guard_gets_the_mitigation(tmp_path):
    script = tmp_path / "unguarded.py"
    script.write_text(
        textwrap.dedent(
            """
            from stickslip.errors import InputError
            from stickslip.sweep import Processes, sweep

            def case(a):
                return {"b": a}

            try:
                sweep(case, {"a": [1, 2]}, case, executor=Processes(1))
            except InputError as error:
                print(error)
            """
        )
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    result = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, env=environment, timeout=120, check=False
    )
    assert 'behind `if __name__ == "__main__":`' in result.stdout


# ---------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({}, "must map at least one name"),
        ({"a": [], "b": [1]}, "must be a list of values, at least one"),
        ({"a": 3.0, "b": [1]}, "must be a list of values"),
        ({"a": [1, 1], "b": [1]}, "holds a value twice; for replicas"),
        ({"a": [1.0, float("nan")], "b": [1]}, "must not hold NaN"),
        ({"a": [object()], "b": [1]}, "must be numbers, texts or booleans"),
        ({"a": [1], "c": [1]}, r"product has no parameter 'c'; it takes a, b"),
        ({"a": [1]}, "its parameter 'b' is no axis and has no default"),
        ({"a": [1], "b/c": [1]}, "cannot be a name"),
        ({"a": [1], "error": [1]}, "is taken"),
    ],
)
def test_bad_axes(axes, message):
    with pytest.raises(InputError, match=message):
        sweep(product, axes, itself)


def test_bad_results():
    with pytest.raises(InputError, match="returned the name 'a', which is taken"):
        sweep(lambda a: {"a": a}, {"a": [1]}, itself)
    with pytest.raises(InputError, match="returned an empty mapping"):
        sweep(lambda a: {}, {"a": [1]}, itself)  # noqa: ARG005
    wrong = sweep(lambda a: {"b": object()} if a else 3, {"a": [0, 1]}, itself)
    assert "not a mapping" in failures(wrong)[0].error
    assert "must be numbers" in failures(wrong)[1].error
    with pytest.raises(InputError, match="must be the result of a sweep"):
        summary(xr.Dataset())


def test_partial_binds_what_is_not_swept():
    bound = functools.partial(product, b=5)
    assert sweep(bound, {"a": [1, 3]}, itself)["product"].values.tolist() == [5, 15]


# ---------------------------------------------------------------- content


def test_equal_content_has_equal_encodings_and_other_content_others():
    values = [
        None, True, 1, 1.0, -0.0, 0.0, "1", b"1", (1,), [1], {1}, {1: 2}, {2: 1}, np.arange(3), np.arange(3.0),
        np.arange(4).reshape(2, 2), np.arange(4), Rig(1.0), Rig(2.0), float("inf"), 1j, len, Rig,
    ]  # fmt: skip
    encoded = [encode(value) for value in values]
    assert len(set(encoded)) == len(values)
    assert encode({"a": 1, "b": 2}) == encode({"b": 2, "a": 1})
    assert encode({"x", "y", "z"}) == encode({"z", "y", "x"})
    assert encode(np.float64(1.5)) == encode(1.5)
    with pytest.raises(InputError, match="its content cannot be read"):
        encode(threading.Lock())


def test_code_that_a_case_calls_is_part_of_it():
    parts = code_parts(functools.partial(case, start="from rest"))
    assert {"code", "code: bound arguments", "code: defaults"} <= parts.keys()
    assert code_parts(Rig(1.0))["code: its object"] != code_parts(Rig(2.0))["code: its object"]


def test_blocks_are_runs_of_cells():
    for shape in [(7,), (40, 40), (3, 5, 2), (1, 1), (2, 1, 9), (10000,)]:
        for cells in (None, 1, 4, 7, 10**6):
            cut = store_module.block_shape(shape, cells)
            axes = {f"a{i}": np.arange(n) for i, n in enumerate(shape)}
            grid = store_module.Grid(axes=axes, attributes={}, block_shape=cut)
            assert cells is None or np.prod(cut) <= cells
            numbers = np.arange(grid.size).reshape(shape)
            seen = 0
            while seen < grid.size:
                block = grid.block(seen)
                run = grid.block_cells(block)
                assert run[0] == seen
                assert {grid.block(run[0]), grid.block(run[-1])} == {block}
                assert numbers[grid.region(block)].ravel().tolist() == list(run)
                seen = run[-1] + 1


# ---------------------------------------------------------------- refinement


def parabola(x, y):
    return y - 0.25 - 0.5 * x * x


def side(result):
    return "above" if result > 0 else "below"


def curve():
    t = np.linspace(0, 1, 2001)
    return np.stack([t, 0.25 + 0.5 * t * t], axis=-1)


def distances(points, others):
    return np.hypot(*(points[:, None] - others[None]).transpose(2, 0, 1))


def test_refinement_finds_a_boundary_as_sharply_as_a_grid_of_ten_times_the_runs():
    pytest.importorskip("adaptive", reason="refine needs adaptive")
    found = refine(parabola, {"x": (0, 1), "y": (0, 1)}, side, runs=160)
    assert 150 < found.sizes["run"] <= 160
    points = np.stack([found["x_at"], found["y_at"]], axis=-1)
    off = distances(points, curve())

    grid = sweep(parabola, {"x": np.linspace(0, 1, 40), "y": np.linspace(0, 1, 40)}, lambda r: {"side": side(r)})
    above = grid["side"].values == "above"
    x, y = grid["x"].values, grid["y"].values
    crossings = [((x[i] + x[i + 1]) / 2, y[j]) for i, j in np.argwhere(above[1:] != above[:-1])]
    crossings += [(x[i], (y[j] + y[j + 1]) / 2) for i, j in np.argwhere(above[:, 1:] != above[:, :-1])]
    of_grid = distances(np.array(crossings), curve())

    assert off.min(axis=1).max() <= of_grid.min(axis=1).max() * 1.1
    assert off.min(axis=1).max() <= 1 / 80  # half of the resolution asked for
    assert off.min(axis=0).max() < 0.06  # and no part of it is left out
    low = np.hypot(found["x_error"], found["y_error"])
    assert (off.min(axis=1) <= low.values + 1e-12).all()


def test_refinement_is_the_same_for_any_number_of_workers():
    pytest.importorskip("adaptive", reason="refine needs adaptive")
    box = {"x": (0, 1), "y": Span(low=0.01, high=1.0, log=True)}
    one = refine(parabola, box, side, runs=60, executor=Threads(1))
    xr.testing.assert_identical(one, refine(parabola, box, side, runs=60, executor=Threads(3)))
    assert set(one["from_label"].values) | set(one["to_label"].values) == {"above", "below"}


def test_refinement_with_one_region_has_no_boundary_and_says_so_by_its_size():
    pytest.importorskip("adaptive", reason="refine needs adaptive")
    found = refine(parabola, {"x": (0, 1), "y": (0.9, 1)}, side, runs=20)
    assert found.sizes["crossing"] == 0
    assert set(found["label"].values) == {"above"}


def test_refinement_goes_round_cases_that_fail():
    pytest.importorskip("adaptive", reason="refine needs adaptive")

    def patchy(x, y):
        if x > 0.8:
            raise ValueError("no")
        return y - 0.5

    found = refine(patchy, {"x": (0, 1), "y": (0, 1)}, lambda r: int(r > 0), runs=80)
    assert (found["error"].values[found["x"].values > 0.8] != "").all()
    assert found.sizes["crossing"] > 3
    assert np.abs(found["y_at"] - 0.5).max() < 0.03


def test_refinement_goes_on_from_its_file(tmp_path):
    pytest.importorskip("adaptive", reason="refine needs adaptive")
    count = Counter()

    def counted(x, y):
        count[x, y] += 1
        return parabola(x, y)

    store = tmp_path / "runs.jsonl"
    box = {"x": (0, 1), "y": (0, 1)}
    first = refine(counted, box, side, runs=40, store=store)
    store.write_bytes(store.read_bytes()[:-9])  # killed while it wrote the last line
    again = refine(counted, box, side, runs=40, store=store)
    xr.testing.assert_identical(first, again)
    assert len(count) == first.sizes["run"] <= 40
    assert sum(count.values()) == len(count) + 1
    with pytest.raises(InputError, match="holds another sweep; what differs: seed"):
        refine(counted, box, side, runs=40, store=store, seed=1)


def test_bad_refinements():
    with pytest.raises(InputError, match="must name two axes"):
        refine(parabola, {"x": (0, 1)}, side)
    with pytest.raises(InputError, match=r"Span\.high = 0: must be"):
        refine(parabola, {"x": (1, 0), "y": (0, 1)}, side)
    with pytest.raises(InputError, match=r"Span\.low = 0: must be"):
        Span(low=0, high=1, log=True)
    with pytest.raises(InputError, match=r"runs = 3: must be"):
        refine(parabola, {"x": (0, 1), "y": (0, 1)}, side, runs=3)
