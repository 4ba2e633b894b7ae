"""The command line: the user's path, and one line with exit code 2 for every input that cannot be used."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import stickslip as ss
from stickslip import cli

ROOT = Path(__file__).parents[1]
SHARED = Path(os.environ.get("STICKSLIP_SHARED", ROOT.parent / "shared"))
TRACE = SHARED / "data" / "guldstrand_force7.txt"

SMALL = """
name = "small"
units = "natural"
[slider]
stiffness = 2.0
mass = 1e-4
damping = 200.0
[interface]
thresholds = { law = "gaussian", spread = 0.1 }
delay = 0.2
[drive]
velocity = 1.0
distance = 40.0
[simulation]
contacts = 500
"""


@pytest.fixture
def rig(tmp_path):
    file = tmp_path / "rig.toml"
    file.write_text(SMALL)
    return file


@pytest.fixture
def sawtooth(tmp_path):
    file = tmp_path / "trace.csv"
    rows = (f"{0.1 * i:.1f},{5 + (i % 20) * 0.1:.2f}" for i in range(600))
    file.write_text("time,force\n" + "\n".join(rows))
    return file


def run(*arguments):
    return cli.main([str(argument) for argument in arguments])


def refused(capsys, *arguments):
    """Run a command that must refuse its input; return its one line."""
    assert run(*arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, captured.err
    assert "Traceback" not in captured.err
    return lines[0]


def test_simulate_writes_a_run_that_can_be_made_again(rig, tmp_path, capsys):
    one, two = tmp_path / "one.nc", tmp_path / "two.nc"
    assert run("simulate", rig, "-o", one, "--plot", tmp_path / "run.png") == 0
    assert "stick-slip" in capsys.readouterr().out
    assert run("simulate", one, "--again", "-o", two) == 0
    assert ss.load(one).identical(ss.load(two))
    assert (tmp_path / "run.png").stat().st_size > 10_000


def test_measure_tells_the_same_of_a_run(rig, tmp_path, capsys):
    file = tmp_path / "run.nc"
    run("simulate", rig, "-o", file, "--json")
    simulated = json.loads(capsys.readouterr().out)
    assert run("measure", file, "--json", "--events", tmp_path / "slips.csv") == 0
    measured = json.loads(capsys.readouterr().out)
    assert measured["regime"] == simulated["regime"]
    assert len((tmp_path / "slips.csv").read_text().splitlines()) == 1 + measured["statistics"]["count"]


@pytest.mark.skipif(not TRACE.exists(), reason="the measured trace is not here; set STICKSLIP_SHARED")
def test_measure_reads_the_bench_trace(capsys):
    assert run("measure", TRACE, "--step", 0.25, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["regime"]["kind"] == "stick-slip"
    statistics = found["statistics"]
    assert 150 <= statistics["count"] <= 190
    assert 2.6 <= statistics["drop"]["mean"] <= 3.6
    assert 5.3 <= statistics["recurrence"]["mean"] <= 6.8
    assert 0.24 <= statistics["recurrence"]["std"] / statistics["recurrence"]["mean"] <= 0.36
    assert len(found["unreadable"]) == 1


def test_predict_prints_a_verdict_and_leaves_a_picture(rig, tmp_path, capsys):
    picture = tmp_path / "predict.png"
    assert run("predict", rig, "--plot", picture) == 0
    printed = capsys.readouterr().out
    assert "small: stick-slip at 1 x_s/time" in printed
    assert "2.989 k (3.548 k without re-attachment)" in " ".join(printed.split())
    assert picture.stat().st_size > 10_000


def test_predict_for_a_machine(rig, capsys):
    assert run("predict", rig, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["regime"]["kind"] == "stick-slip"
    assert found["smooth"] is False
    assert found["critical_stiffness"] == pytest.approx(2.989, abs=0.003)
    assert found["unstable_modes"] >= 1


def test_map_draws_and_says_what_it_found(rig, tmp_path, capsys):
    picture = tmp_path / "map.png"
    assert run("map", rig, "--over", "stiffness,velocity", "--around", 5, "--points", 12, "-o", picture) == 0
    assert "unstable" in capsys.readouterr().out
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize("kind", ["overview", "phase", "energy"])
def test_plot_draws_each_kind(rig, tmp_path, kind):
    run("simulate", rig, "-o", tmp_path / "run.nc")
    assert run("plot", tmp_path / "run.nc", tmp_path / "out.svg", "--kind", kind) == 0
    assert "<svg" in (tmp_path / "out.svg").read_text()


def test_paper_makes_a_figure_with_its_claims(tmp_path, capsys):
    assert run("paper", "fig2", "--check", "--quick", "--json", "-d", tmp_path) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ok"]
    assert Path(found["picture"]).exists()
    assert Path(found["data"]).exists()


def test_unusable_files(tmp_path, rig, sawtooth, capsys):
    empty, binary, listing = tmp_path / "empty.csv", tmp_path / "binary.csv", tmp_path / "rig2.toml"
    empty.write_text("")
    binary.write_bytes(bytes(range(256)) * 10)
    listing.write_text("slider = ")
    damaged = tmp_path / "damaged.nc"
    damaged.write_bytes(b"\x89HDF\r\n\x1a\n" + b"nonsense" * 100)
    for arguments in (
        ("predict", tmp_path / "none.toml"),
        ("predict", empty),
        ("predict", binary),
        ("predict", listing),
        ("predict", tmp_path),
        ("predict", sawtooth),
        ("simulate", tmp_path / "none.toml"),
        ("simulate", sawtooth, "--again"),
        ("measure", tmp_path / "none.csv"),
        ("measure", empty, "--step", 1),
        ("measure", binary, "--step", 1),
        ("measure", damaged),
        ("measure", tmp_path),
        ("measure", sawtooth, "--force", "load"),
        ("measure", sawtooth, "--force", 7),
        ("measure", sawtooth, "--after", 1e9),
        ("measure", sawtooth, "--events", tmp_path / "no" / "where.csv"),
        ("plot", sawtooth, tmp_path / "picture.xyz"),
        ("plot", sawtooth, tmp_path),
        ("plot", tmp_path / "none.nc", tmp_path / "out.png"),
        ("simulate", rig, "-o", tmp_path / "no" / "where.nc"),
        ("simulate", rig, "-o", tmp_path),
        ("predict", rig, "--plot", tmp_path / "no" / "where.png"),
        ("map", rig, "--over", "stiffness"),
        ("map", rig, "--over", "stiffness,colour"),
        ("map", rig, "--over", "mass,mass"),
        ("map", rig, "--around", 0.5),
        ("map", rig, "--points", 1),
        ("paper", "fig99"),
        ("paper", "fig1", "-d", tmp_path / "nowhere"),
        ("measure", sawtooth, "--step", -1),
        ("predict", rig, "--jsn"),
        ("prdict", rig),
        ("predict",),
        ("predict", rig, "extra"),
        ("measure", sawtooth, "--step", "fast"),
    ):
        line = refused(capsys, *arguments)
        assert line.startswith("stickslip: "), line
        assert len(line) > 25, line


@pytest.mark.parametrize("line", ["nan", "inf", "x"])
def test_a_trace_with_too_many_rows_that_cannot_be_read(tmp_path, capsys, line):
    file = tmp_path / "trace.csv"
    file.write_text("force\n" + "\n".join(["1.0", line] * 100))
    assert "line" in refused(capsys, "measure", file, "--step", 0.1)


def test_a_run_too_short_to_judge_is_undecided(tmp_path, capsys):
    file = tmp_path / "short.toml"
    file.write_text(SMALL.replace("distance = 40.0", "distance = 0.5"))
    assert run("simulate", file, "--json") == 0
    assert json.loads(capsys.readouterr().out)["regime"]["kind"] == "undecided"


def test_a_failed_write_leaves_the_old_file(rig, tmp_path, capsys, monkeypatch):
    file = tmp_path / "run.nc"
    run("simulate", rig, "-o", file)
    before = file.read_bytes()
    capsys.readouterr()

    def full(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("xarray.Dataset.to_netcdf", full)
    assert "No space left" in refused(capsys, "simulate", rig, "-o", file)
    assert file.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig.toml", "run.nc"]


def heed_interrupts():
    """A shell's background jobs are born deaf to Ctrl-C, and hand that on."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_an_interrupt_leaves_nothing_half_written(tmp_path):
    file = tmp_path / "big.toml"
    file.write_text(SMALL.replace("distance = 40.0", "distance = 1e6"))
    target = tmp_path / "run.nc"
    process = subprocess.Popen(
        [sys.executable, "-m", "stickslip.cli", "simulate", str(file), "-o", str(target)],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_interrupts,
    )
    time.sleep(4)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert not target.exists()
    assert not list(tmp_path.glob("*.part"))


def test_help_is_quick_and_loads_no_heavy_library():
    code = (
        "import sys, resource\n"
        "from stickslip import cli\n"
        "try:\n    cli.main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numba', 'xarray', 'matplotlib', 'scipy.stats', 'pint', 'pydantic'} & set(sys.modules)\n"
        "print('heavy', sorted(heavy), resource.getrusage(resource.RUSAGE_SELF).ru_utime)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "heavy []" in done.stdout
    assert "predict" in done.stdout
