"""Sweeps from the shell: plan files, one line for every mistake, killed sweeps."""

import json
import os
import signal
import subprocess
import sys
import time
import tomllib
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import reference
import tomli_w
import xarray as xr
from benches import with_value
from drawn import assert_drawn
from refusals import mistakes
from test_cli import heed_interrupts, refused, run

import stickslip as ss
from stickslip import plot
from stickslip.errors import InputError
from stickslip.io import rig_files as rigs
from stickslip.io.datasets import encode
from stickslip.measure import regime
from stickslip.model import Contacts, FromRest, FromSliding, MasterEquation, Population
from stickslip.sweep import Refinement, Runs, Span, open_sweep, study
from stickslip.sweep.plan import from_document, open_plan, plan_of, read_plan
from stickslip.sweep.theory import with_theory

ROOT = Path(__file__).parents[1]
BENCH = rigs.EXAMPLES / "pmma_slider.toml"

GAUSSIAN = {"distribution": "gaussian", "std": 0.1}
BY_FOURS = {"from": 0.5, "to": 8.0, "count": 3, "spacing": "log"}
HUNDREDFOLD = {"from": 0.1, "to": 10.0, "count": 2, "spacing": "log"}
COUNTS = {"from": 10, "to": 1000, "count": 5, "spacing": "log"}
NATURAL = {
    "name": "small",
    "axes": {
        "stiffness": BY_FOURS,
        "velocity": [0.3, 1.0],
        "start": ["from rest", "sliding"],
    },
    "run": {"contacts": 100, "distance": 12.0, "cycles": 0.0, "extensions": 0},
    "rig": {
        "units": "natural",
        "slider": {"stiffness": 2.0, "mass": 1e-4, "damping": 200.0},
        "interface": {"thresholds": GAUSSIAN, "delay": 0.2},
    },
}


def changed(path, value, document=NATURAL):
    return with_value(document, path, value)


@pytest.fixture
def counted(monkeypatch):
    """Count how often each rig was run."""
    count = Counter()
    real = study.simulate

    def simulate(rig, **options):
        count[rig.slider.stiffness, rig.velocity, type(rig.start)] += 1
        return real(rig, **options)

    monkeypatch.setattr(study, "simulate", simulate)
    return count


def written(tmp_path, document=NATURAL, name="sweep.toml"):
    file = tmp_path / name
    file.write_text(tomli_w.dumps(document))
    return file


# ---------------------------------------------------------------- files


def again(plan):
    """Return the plan as read back from results."""
    return plan_of(xr.Dataset(attrs={"sweep": json.dumps(encode(plan))}))


@pytest.mark.parametrize(
    ("name", "given", "values", "spacing"),
    [
        ("stiffness", BY_FOURS, [0.5, 2.0, 8.0], "log"),
        ("delay", {"from": 0.0, "to": 0.2, "count": 3}, [0.0, 0.1, 0.2], "linear"),
        ("mass", [0.1, 0.4, 1.6], [0.1, 0.4, 1.6], "log"),
        ("mass", [1.6, 0.1, 0.4], [1.6, 0.1, 0.4], "log"),
        ("mass", [1, 2, 3], [1.0, 2.0, 3.0], "linear"),
        ("mass", [0.1, 10.0], [0.1, 10.0], "linear"),
        ("mass", [0.1] * 3, [0.1] * 3, "linear"),
        ("mass", HUNDREDFOLD, [0.1, 10.0], "log"),
        ("seed", {"from": 7, "count": 3}, [7, 8, 9], "linear"),
        ("contacts", COUNTS, [10, 32, 100, 316, 1000], "log"),
        ("start", ["from rest", "sliding"], ["from rest", "sliding"], "linear"),
    ],
)
def test_an_axis_is_as_written(name, given, values, spacing):
    plan = from_document(changed("axes", {name: given, "velocity": [1.0]}))
    assert (plan.total, [*plan.axes]) == (len(values), [name, "velocity"])
    assert again(plan) == plan
    assert [*plan.axes[name]] == (values if name == "start" else pytest.approx(values))
    assert plan.attributes()[name]["spacing"] == spacing


def test_a_file_may_name_a_rig_file_beside_it_and_is_in_its_units(tmp_path):
    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "bench.toml").write_text(BENCH.read_text())
    asked = {"stiffness": 1e6, "mass": 0.01, "damping": 100.0}
    asked |= {"velocity": 1 / 60, "delay": 1e-3, "std": 0.2}
    written_as = ("1 MN/m", "10 g", "100 1/s", "1 m/min", "1 ms", 0.2)
    axes = {name: [value] for name, value in zip(asked, written_as, strict=True)}
    plan = read_plan(written(tmp_path, {"rig": "rigs/bench.toml", "axes": axes}))
    assert {name: value for name, (value,) in plan.axes.items()} == pytest.approx(asked)
    assert plan.study.rig.method.count == 2000  # as the rig file says
    assert plan.attributes()["velocity"]["units"] == "m/s"
    assert again(plan) == plan


def test_a_run_is_simulated_as_the_file_says_and_else_as_the_rig_is():
    bench = tomllib.loads(BENCH.read_text())
    for run_, method in (
        ({}, Contacts(2000, 1)),
        ({"contacts": 50}, Contacts(50, 1)),
        ({"method": "population"}, Population(2000, 1)),
        ({"method": "master equation", "rtol": 1e-3}, MasterEquation(rtol=1e-3)),
    ):
        document = {"rig": bench, "axes": {"velocity": ["1 mm/s"]}, "run": run_}
        plan = from_document(document)
        assert plan.study.rig.method == method
    message = r"axes\.seed: changes nothing where no contacts are drawn"
    document = changed("run", {"method": "master equation"})
    with pytest.raises(InputError, match=message):
        from_document(changed("axes.seed", [1], document))


MISTAKES = mistakes("""
axes.stifness = [1.0]
    axes.stifness | did you mean 'stiffness'
axes.stiffness = { from = 1, to = 0.5, count = 3 }
    axes.stiffness.to = 0.5 | above 1
axes.stiffness = { from = 1, to = 2, count = 3, spacing = "cubic" }
    spacing = 'cubic' | 'linear' or 'log'
axes.stiffness = ["4 MN/m"]
    axes.stiffness.0 = '4 MN/m' | plain number
axes.delay = { from = 0.0, to = 1.0, count = 3, spacing = "log" }
    axes.delay.from = 0 | above 0
axes.start = ["warm"]
    axes.start.0 = 'warm' | 'from rest' or 'sliding'
axes = 3
    axes = 3 | must be a table
rig
    rig = None | name of a rig file
rig.drive = { pieces = [{ start = 1.0, end = 2.0, duration = 1.0 }] }
    rig.drive.pieces | drive.velocity
rig.interface.thresholds = { distribution = "exponential" }
    Interface.thresholds | has no std to vary
run.method = "monte carlo"
    run.method | must be 'contacts' or 'master equation'
run.rtol = 0.0001
    run.rtol | unknown key
run.distance = "4 mm"
    run.distance = '4 mm' | plain number
measure = [["perod"]]
    'perod' | did you mean 'period'
measure = "period"
    measure = 'period' | list
refine = { runs = 3 }
    refine.runs = 3 | at least 16
refine = {}
    axes: [refine] | give from, to and spacing
""")


@pytest.mark.parametrize(("path", "value", "place", "remedy"), MISTAKES)
def test_a_mistake_names_its_place(tmp_path, capsys, path, value, place, remedy):
    document = changed(path, value)
    if path == "rig.interface.thresholds":
        document = changed("axes.std", [0.1], document)
    file = written(tmp_path, document)
    line = refused(capsys, "sweep", file, "--store", tmp_path / "s.sqlite")
    assert line.startswith("stickslip: sweep.toml: ")
    assert place in line
    assert remedy in line
    assert not (tmp_path / "s.sqlite").exists()


# ---------------------------------------------------------------- one case


def test_a_case_can_be_made_again_from_what_the_store_says(tmp_path, capsys):
    measured = ["peak_to_peak", "mean_force", "period", "largest_velocity"]
    file = written(tmp_path, changed("measure", measured))
    assert run("sweep", file, "--store", tmp_path / "s.sqlite") == 0
    assert capsys.readouterr().out.strip().splitlines()[-1] == "12 of 12 cases done"
    result = open_plan(tmp_path / "s.sqlite")
    assert {"travel", "slips"}.isdisjoint(result)  # not requested, but kept
    assert {"travel", "slips"} <= set(open_sweep(tmp_path / "s.sqlite"))
    assert len(np.unique(result["seed"])) == 12
    for start, of_start in (("from rest", FromRest()), ("sliding", FromSliding())):
        here = result.isel(stiffness=1, velocity=0).sel(start=start)
        thresholds = ss.Gaussian(mean=1.0, std=0.1)
        interface = ss.Interface(thresholds=thresholds, delay=ss.Delay(0.2))
        slider = ss.Slider(stiffness=float(here["stiffness"]), mass=1e-4, damping=200.0)
        drive = ss.constant(0.3, 12.0 / 0.3)
        rig = ss.Rig(interface, slider, drive)
        method = Contacts(100, int(here["seed"]))
        seen = regime(ss.simulate(rig, method=method, start=of_start))
        assert study.KINDS[here["regime"].item()] == seen.kind
        for name in ("peak_to_peak", "mean_force", "period"):
            np.testing.assert_equal(float(here[name]), getattr(seen, name))
        fastest = pytest.approx(0.3 * seen.largest_velocity)
        assert float(here["largest_velocity"]) == fastest


def test_a_rig_is_swept_from_python_as_from_a_file(tmp_path):
    bench = ss.read_rig(BENCH)
    run_ = {"distance": "8 um", "cycles": 0.0, "extensions": 0}
    axes = {"velocity": ["0.4 mm/s", "1 mm/s"], "contacts": [50]}
    axes["start"] = ["from rest", "sliding"]
    content = tomllib.loads(BENCH.read_text())
    expected = from_document({"rig": content, "axes": axes, "run": run_}).run()
    store = tmp_path / "s.sqlite"
    for speeds in (axes["velocity"], np.array([4e-4, 1e-3])):
        axes["velocity"] = speeds
        found = ss.sweep(bench, axes, store=store, runs=Runs(**run_))
        xr.testing.assert_equal(found, expected)
        assert found["peak_to_peak"].units == "N"
        assert " N in the window" in str(found["reason"].values)
    assert run("plot", store, tmp_path / "s.png", "--at", "contacts=50") == 0
    plane = {"velocity": Span(low=1e-4, high=5e-3, log=True)}
    plane |= {"stiffness": Span(low=2e7, high=2e9, log=True)}
    search = Refinement(runs=16, resolution=0.1)
    short = Runs(distance=4e-6, cycles=0)
    edge = ss.sweep(bench, plane, refinement=search, runs=short)
    assert edge.sizes["run"] <= 16
    assert plan_of(edge).axes == plane
    del plane["velocity"]
    for name, low in (("velocity", -1), ("contacts", 1)):
        axes = plane | {name: Span(low=low, high=9)}
        with pytest.raises(InputError, match=f"^axes.{name}"):
            ss.sweep(bench, axes, refinement=search)


def test_a_run_lasts_as_long_as_the_file_asks():
    least = {"contacts": 20, "distance": 5.0, "cycles": 0.0, "extensions": 0}
    base = changed("run", least)
    for key, value, travel in (
        ("duration", 100.0, 30.0),
        ("cycles", 20.0, 20 * 1.5),
        ("distance", 8.0, 8.0),
    ):
        case = from_document(changed(f"run.{key}", value, base)).study
        found = case(seed=1, stiffness=2.0, velocity=0.3)["travel"]
        assert found == pytest.approx(travel)
    short = changed("run.distance", 0.5, base)
    assert from_document(short).study(seed=1, velocity=0.3)["regime"] == "undecided"
    longer = from_document(changed("run.extensions", 3, short)).study
    assert longer(seed=1, velocity=0.3)["travel"] > 0.5
    # estimated at 10^12 years, but the contacts never move
    creeping = changed("run.long", True, changed("axes", {"velocity": [1e-25]}, short))
    refused = from_document(changed("run.long", False, creeping)).run()
    assert "years; give at least" in refused["error"].item()
    assert "allow it by long = true in [run]" in refused["error"].item()
    assert from_document(creeping).run()["error"].item() == ""


def test_the_master_equation_needs_no_seed_and_feels_the_smooth_start():
    run_ = {"method": "master equation", "rtol": 1e-3, "distance": 20.0, "cycles": 0.0}
    case = from_document(changed("run", run_)).study
    found = [
        case(stiffness=k, velocity=v, start="sliding")
        for k, v in ((0.5, 1.0), (8.0, 0.3))
    ]
    assert [one["regime"] for one in found] == ["stick-slip", "smooth sliding"]
    assert "seed" not in found[0]


# ---------------------------------------------------------------- the command


@pytest.mark.slow
def test_a_second_start_runs_nothing_and_says_the_same(tmp_path, capsys, counted):
    """For a grid and for a refinement: each is kept, drawn and continued."""
    span = {"from": 0.5, "to": 8.0, "spacing": "log"}
    plane = {"stiffness": span, "velocity": span | {"from": 0.1, "to": 1.0}}
    plane["start"] = ["from rest", "sliding"]
    refined = changed("refine", {"runs": 24}, changed("axes", plane))
    for document, most in ((NATURAL, 12), (refined, 48)):
        file = written(tmp_path, document)
        store = tmp_path / f"{most}.sqlite"
        assert read_plan(file).total == most
        options = "--store", store, "--workers", 2, "--json", "--plot"
        again = ("sweep", file, *options, tmp_path / "a.png")
        assert run(*again) == 0
        first = json.loads(capsys.readouterr().out)
        assert (first["done"], first["failed"]) == (first["total"], 0)
        assert sum(first["regimes"].values()) == first["total"] <= most
        assert first["crossings"] is None if most == 12 else first["crossings"] >= 2
        counted.clear()
        assert run(*again) == 0
        assert json.loads(capsys.readouterr().out) == first
        assert not counted
        assert run("plot", store, tmp_path / "b.png") == 0
        assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
        capsys.readouterr()
        status = "sweep", "--status", "--store", store
        assert run(*status) == run(*status, "--json") == 0
        line, _, told = capsys.readouterr().out.partition("\n")
        assert line == f"{first['total']} of {first['total']} cases done"
        keys = "total", "done", "failed", "missing"
        assert json.loads(told)["summary"] == {key: first[key] for key in keys}


def test_cases_that_fail_are_recorded_and_told(tmp_path, capsys):
    document = changed("axes", {"std": [0.1, -0.1, 0.2], "velocity": [0.5, 1.0]})
    file = written(tmp_path, document)
    store = tmp_path / "s.sqlite"
    assert run("sweep", file, "--store", store, "--plot", tmp_path / "s.png") == 1
    lines = capsys.readouterr().out.strip().splitlines()
    assert lines[-1] == "4 of 6 cases done, 2 failed"
    told, _ = (line for line in lines if line.startswith("failed: "))
    assert "std = -0.1, velocity = 0.5: InputError: std = -0.1: must be" in told
    assert run("sweep", file, "--store", store, "--json") == 1  # and says so again
    failure = json.loads(capsys.readouterr().out)["failures"][1]
    assert failure["parameters"] == {"std": -0.1, "velocity": 1.0}
    nowhere = tmp_path / "no"
    before = open_sweep(store).load()
    other = written(tmp_path, changed("rig.slider.mass", 2e-4, document), "other.toml")
    differs = "holds another sweep; what differs: version of the study"
    both = "--scheduler", "tcp://a:1", "--processes"
    for arguments, words in (
        ((other, "--store", store), differs),
        (("--status", "--store", nowhere), "there is no such file"),
        (("--store", store), "give a sweep file"),
        ((file, "--store", store, *both), "leave out"),
        ((file, "--store", store, "--workers", 0), "Threads.workers = 0"),
    ):
        assert words in refused(capsys, "sweep", *arguments)
    xr.testing.assert_identical(open_sweep(store), before)  # not touched


def test_a_scheduler_that_is_not_there(tmp_path, capsys):
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    file = written(tmp_path)
    store = tmp_path / "s.sqlite"
    scheduler = "--scheduler", "nonsense://1"
    line = refused(capsys, "sweep", file, "--store", store, *scheduler)
    assert "--scheduler nonsense://1: cannot be reached" in line
    assert "dask scheduler" in line
    assert not store.exists()


# ---------------------------------------------------------------- theory on top


def test_the_boundary_on_top_is_the_computed_one():
    plan = from_document(NATURAL)
    shown = with_theory(plan.run())
    interface = plan.study.rig.interface
    for i in (0, -1):
        edge = (float(shown[f"edge_{name}"][i]) for name in ("stiffness", "velocity"))
        stiffness, velocity = edge
        slider = ss.Slider(stiffness=stiffness, mass=1e-4, damping=200.0)
        rig = ss.Rig(interface, slider, ss.constant(1.0))
        edges = ss.critical(rig, "velocity", between=(0.05, 5.0)).edges
        assert min(abs(edge.value / velocity - 1) for edge in edges) < 1e-6
    axes = {"velocity": {"from": 0.2, "to": 3.0, "count": 3}, "seed": [1]}
    edges = with_theory(from_document(changed("axes", axes)).run())["edge_velocity"]
    assert edges.values == pytest.approx([reference.V1_FIG4], rel=1e-6)


def test_where_there_is_no_theory_it_says_why():
    axes = changed("axes", {"stiffness": [1.0, 2.0], "velocity": [1.0, 2.0]})
    document = changed("rig.interface.delay", "never", axes)
    shown = with_theory(from_document(document).run())
    assert "no linear boundary: " in shown.attrs["theory"]
    with pytest.raises(InputError, match="not made from a rig"):
        plan_of(xr.Dataset())


# ---------------------------------------------------------------- pictures


def test_a_phase_diagram_shows_every_kind_of_cell():
    result = from_document(NATURAL).run()
    kinds = [0, 1, 2, 3, 0, 1]
    result["regime"][...] = np.array([kinds, kinds]).T.reshape(3, 2, 2)
    result["status"][0, 0, 0] = 2
    result["status"][2, 1, 1] = 0
    assert_drawn(plot.sweep_picture(with_theory(result)), "phase_diagram")


def test_a_sweep_along_one_axis_is_a_line():
    axes = {"velocity": [0.5, 1.0, 2.0], "start": ["from rest", "sliding"]}
    document = changed("axes", axes | {"seed": [1, 2]})
    found = with_theory(from_document(document).run())
    assert_drawn(plot.sweep_picture(found), "sweep_along_one_axis")


def test_cells_lie_where_their_values_are_in_any_order():
    axes = {"contacts": [50, 20, 10], "velocity": [3.0, 0.3, 1.0]}
    result = from_document(changed("axes", axes)).run()
    result["regime"][...] = study.KINDS.index("smooth sliding")
    result["regime"][0, 1] = study.KINDS.index("stick-slip")
    assert_drawn(plot.sweep_picture(with_theory(result)), "sweep_in_any_order")


def test_a_cut_through_three_axes(tmp_path, capsys):
    store = tmp_path / "s.sqlite"
    file = written(tmp_path, changed("axes.delay", [0.1, 0.2]))
    assert run("sweep", file, "--store", store) == 0
    capsys.readouterr()
    picture = tmp_path / "s.png"
    drawn = "plot", store, picture
    assert "select values of the others (--at)" in refused(capsys, *drawn)
    assert run("plot", store, picture, "--at", "delay=0.19,start=from rest") == 0
    assert "linear stability" in capsys.readouterr().out
    for at, words in (
        ("colour=3", "must be an axis and a value"),
        ("start=warm", "as in delay=0.1; it has"),
    ):
        assert words in refused(capsys, *drawn, "--at", at)


# ---------------------------------------------------------------- interrupted, killed

STIFFNESSES = NATURAL["axes"]["stiffness"] | {"count": 10}
AXES = NATURAL["axes"] | {"stiffness": STIFFNESSES, "velocity": [0.2, 0.5, 1.0]}
LONG = {"contacts": 10_000, "distance": 250.0, "extensions": 0}
SLOW = changed("run", LONG, changed("axes", AXES))


def start_command(file, store, *options):
    command = [sys.executable, "-m", "stickslip", "sweep", str(file)]
    command += ["--store", str(store), *options]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    pipes = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    pipes |= {"env": environment, "preexec_fn": heed_interrupts}
    return subprocess.Popen(command, **pipes, text=True)


def finished(store):
    """Return the number of finished cases."""
    try:
        done = np.argwhere(open_sweep(store)["status"].values != 0)
        return set(map(tuple, done.tolist()))
    except InputError:  # not begun
        return set()


def wait_for(condition, process, seconds=120.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "nothing happened"
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


def children_of(pid):
    """Return the worker processes of a command."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    found = (
        Path(f"/proc/{child}") for task in tasks for child in task.read_text().split()
    )
    workers = (each for each in found if "spawn_main" in (each / "cmdline").read_text())
    return [int(each.name) for each in workers]


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    directory = tmp_path_factory.mktemp("expected")
    plan = read_plan(written(directory, SLOW))
    return plan.run(store=directory / "expected.sqlite").load()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "options"),
    [
        (signal.SIGKILL, ["--processes"]),
        (signal.SIGINT, []),
        (signal.SIGTERM, ["--processes"]),
    ],
)
def test_stop_the_command_and_go_on(tmp_path, counted, expected, number, options):
    file = written(tmp_path, SLOW)
    store = tmp_path / "s.sqlite"
    process = start_command(file, store, "--workers", "2", *options)
    wait_for(lambda: len(finished(store)) >= 4, process)
    children = children_of(process.pid)
    process.send_signal(number)
    out, errors = process.communicate(timeout=60)
    kept = finished(store)
    assert 4 <= len(kept) < 60
    if number != signal.SIGKILL:
        *progress, line = errors.strip().splitlines()
        cases = f"{len(kept)} of 60 cases are kept in {str(store)!r}"
        assert (process.returncode, out) == (130, "")
        again = "repeat the command to continue"
        assert line == f"stickslip: interrupted; {cases}; {again}"
        assert all(" small: " in told and " of 60 cases" in told for told in progress)
    deadline = time.monotonic() + 15
    while any(os.path.exists(f"/proc/{pid}") for pid in children):
        assert time.monotonic() < deadline, "workers outlive their sweep"
        time.sleep(0.1)
    counted.clear()  # continue: the same results, with each missing case run once
    assert run("sweep", file, "--store", store) == 0
    assert sum(counted.values()) == len(counted) == 60 - len(kept)
    xr.testing.assert_identical(open_plan(store), expected)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_survives_the_loss_of_a_worker(tmp_path, expected, monkeypatch):
    """The results have the same bits as without the loss."""
    reason = "dask.distributed is not installed"
    distributed = pytest.importorskip("distributed", reason=reason)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
    file = written(tmp_path, SLOW)
    store = tmp_path / "s.sqlite"
    options = {"n_workers": 2, "threads_per_worker": 1, "host": "127.0.0.1"}
    options |= {"dashboard_address": None}
    with (
        warnings.catch_warnings(),
        distributed.LocalCluster(**options, processes=True, silence_logs=50) as cluster,
        distributed.Client(cluster) as client,
    ):
        warnings.simplefilter("ignore")
        process = start_command(file, store, "--scheduler", cluster.scheduler_address)
        wait_for(lambda: len(finished(store)) >= 4, process)
        victim = next(iter(client.run(os.getpid).values()))
        os.kill(victim, signal.SIGKILL)
        out, errors = process.communicate(timeout=120)
        assert process.returncode == 0, errors
        assert out.strip().splitlines()[-1] == "60 of 60 cases done"
        xr.testing.assert_identical(open_plan(store), expected)


def blocks_of(page, language):
    """Return the code blocks of a page; a first line may name their file."""
    text = (ROOT / "docs" / "howto" / page).read_text()
    return [block.split("```")[0] for block in text.split(f"```{language}\n")[1:]]


@pytest.mark.slow
def test_what_the_page_on_sweeps_shows_is_true(tmp_path, monkeypatch, capsys):
    (tmp_path / "pmma_slider.toml").write_text(BENCH.read_text())
    monkeypatch.chdir(tmp_path)
    for block in blocks_of("sweep.md", "toml"):
        file = tmp_path / block.splitlines()[0].removeprefix("# ")
        file.write_text(block)
        assert read_plan(file).total in (120, 160)
    short = "[run]\ncycles = 0\ndistance = '8 um'"
    file = Path("wiper_speeds.toml")
    whole = file.read_text().replace("count = 20", "count = 2")
    whole = whole.replace("[run]", short)
    file.write_text(whole.replace("contacts = 2000", "contacts = 50"))
    store = "wiper_speeds.sqlite"
    picture = "wiper_speeds.png"
    assert run("sweep", file, "--store", store, "--plot", picture) == 0
    assert run("plot", store, picture, "--at", "velocity=4e-4") == 0
    reading, in_python = blocks_of("sweep.md", "python")
    capsys.readouterr()
    exec(compile(reading, "reading", "exec"), {})
    assert '"class": "Rig"' in capsys.readouterr().out
    in_python = in_python.replace("Runs(", "Runs(distance='8 um', cycles=0, ")
    in_python = in_python.replace("Processes(2)", "None")
    exec(compile(in_python, "in_python", "exec"), {"__name__": "__main__"})
    assert "6 of 6 cases done []" in capsys.readouterr().out


def test_the_load_is_an_axis():
    rig = ss.example("pmma_slider")
    short = Runs(distance="40 um", cycles=0)
    loads = [0.5 * rig.value("load"), rig.value("load")]
    found = ss.sweep(rig, {"load": loads, "seed": [3]}, runs=short)
    name = "normal load or contact strength"
    attrs = {"units": "N", "long_name": name, "spacing": "linear"}
    assert found["load"].attrs == attrs
    for load in loads:
        axes = {"velocity": [rig.value("velocity")], "seed": [3]}
        alone = ss.sweep(rig.with_values(load=load), axes, runs=short)
        force = found["mean_force"].sel(load=load)
        np.testing.assert_allclose(force, alone["mean_force"][0], rtol=1e-12)
    for axes, words in (
        ({"load": ["3 kg"]}, r"load\.0 = '3 kg': .*'2 N'"),
        ({"velocity": [-0.1]}, r".*must be above 0"),
    ):
        with pytest.raises(InputError, match=rf"axes\.{words}"):
            ss.sweep(rig, axes, runs=short)
