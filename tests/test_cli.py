"""The command line: the user's path, and one line with code 2 for unusable input."""

import errno
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
import xarray as xr
from benches import WARM

import stickslip as ss
from stickslip import cli

SMALL = """
name = "small"
units = "natural"
[slider]
stiffness = 2.0
mass = 1e-4
damping = 200.0
[interface]
thresholds = { distribution = "gaussian", std = 0.1 }
delay = 0.2
[drive]
velocity = 1.0
distance = 40.0
[simulation]
contacts = 500
"""

INTERFACE = ss.Interface(thresholds=ss.Gaussian(1.0, 0.1), delay=ss.Delay(0.2))


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
    """Run a command that must refuse its input; return the one line it prints."""
    assert run(*arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.strip().splitlines()
    assert line.startswith("stickslip: ")
    return line


@pytest.mark.takes(4)  # runs seven commands
def test_a_run_is_written_made_again_measured_and_drawn(rig, tmp_path, capsys):
    one = tmp_path / "one.nc"
    two = tmp_path / "two.nc"
    picture = tmp_path / "run.png"
    assert run("simulate", rig, "-o", one, "--plot", picture, "--json") == 0
    simulated = json.loads(capsys.readouterr().out)
    assert (tmp_path / "run.png").stat().st_size > 10_000
    assert run("rerun", one, "-o", two) == 0
    assert ss.load(one).identical(ss.load(two))
    with pytest.raises(ss.InputError, match="name it one"):
        ss.save(ss.load(one), tmp_path / "one.csv")
    capsys.readouterr()
    assert run("measure", one, "--json", "--events", tmp_path / "slips.csv") == 0
    measured = json.loads(capsys.readouterr().out)
    assert measured["regime"] == simulated["regime"]
    rows = (tmp_path / "slips.csv").read_text().splitlines()
    assert len(rows) == 1 + measured["statistics"]["count"]
    for kind in ("overview", "phase", "energy"):
        assert run("plot", one, tmp_path / f"{kind}.svg", "--kind", kind) == 0
        assert "<svg" in (tmp_path / f"{kind}.svg").read_text()


def test_a_rig_without_a_mechanism_is_not_judged(rig, capsys):
    rig.write_text(SMALL.replace("delay = 0.2\n", ""))
    assert run("predict", rig) == 0
    words = " ".join(capsys.readouterr().out.split())
    verdict = "CANNOT BE JUDGED nothing says how contacts strengthen with rest"
    assert words.startswith(f"small, at 1 x_s/time {verdict}")
    stable = "it would be, at this speed, linearly stable"
    assert f"with a delay of re-attachment {stable}" in words


def test_paper_makes_a_figure_with_its_claims(tmp_path, capsys):
    folder = tmp_path / "new" / "folder"
    check = "paper", "fig2", "--check", "--quick", "--json", "-o", folder
    assert run(*check, "--format", "pdf", "--format", "svg") == 0
    found = json.loads(capsys.readouterr().out)
    (figure,) = found["figures"]
    assert (found["ok"], figure["ok"], bool(figure["caption"])) == (True, True, True)
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["fig2.nc", "fig2.pdf", "fig2.svg"]
    begins = [Path(name).read_bytes()[:4] for name in figure["pictures"]]
    assert begins == [b"%PDF", b"<?xm"]
    (tmp_path / "fig11.png").mkdir()
    assert "fig11.png: is a directory" in refused(
        capsys, "paper", "all", "-o", tmp_path
    )
    assert sorted(os.listdir(tmp_path)) == ["fig11.png", "new"]


@pytest.fixture
def unusable(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("empty.csv").touch()
    Path("binary.csv").write_bytes(bytes(range(256)) * 10)
    Path("half.toml").write_text("slider = ")
    Path("warm.toml").write_text(WARM)
    Path("latin.toml").write_bytes("# µ".encode("latin-1"))
    Path("link.csv").symlink_to("gone.csv")
    ss.save(xr.Dataset({"spring_force": ("time", [1.0])}, {"time": [0.0]}), "run.nc")
    Path("damaged.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + b"nonsense" * 100)


UNREAD = "none.toml", "binary.csv", "half.toml", "trace.csv"
UNMEASURED = "none.csv", "empty.csv", "damaged.nc"
BAD_COUNTS = "1_0", "0x10", "²", "9" * 5_000
HOLDS = "--from '3 um/s' --to '9 um/s' --holds '1 s'"
IS_NO_OPTION = "a value that begins with '-' is written --NAME=VALUE"


@pytest.mark.parametrize(
    ("command", "words"),
    [
        *((f"predict {file}", file) for file in UNREAD),
        ("predict rig.toml --plot no/where.png", "no/where.png"),
        *((f"predict rig.toml {strange}", strange) for strange in ("--jsn", "extra")),
        ("predict", "rig"),
        ("prdict rig.toml", "prdict"),
        ("rerun trace.csv", "trace.csv"),
        ("simulate rig.toml -o no/where.nc", "no/where.nc"),
        ("plot trace.csv picture.xyz", ".png"),
        ("plot none.nc out.png", "none.nc"),
        *((f"measure {file}", file) for file in UNMEASURED),
        ("measure trace.csv --events no/where.csv", "no/where.csv"),
        ("predict rig.toml --smooth '1 m/s' 2", "smooth[0] = '1 m/s': must be a plain"),
        ("measure trace.csv --force load", "load"),
        ("measure trace.csv --force " + "9" * 5_000, "no such column"),
        ("measure trace.csv --force '3 mN'", "force = '3 mN': no such column"),
        ("fit trace.csv --holds none.csv", "stickslip: none.csv: no such file"),
        ("measure trace.csv --after 1e9", "after = 1e+09 s: fewer than 16 samples"),
        ("measure trace.csv --step fast", "fast"),
        ("measure trace.csv --step 0,25", "write '0.25': decimal point"),
        ("measure trace.csv --step '4 kg'", "not in a unit of 's'"),
        ("measure trace.csv --minimum-drop 0x10", "cannot be read as"),
        ("measure trace.csv --load '-20 N'", IS_NO_OPTION),
        *((f"measure trace.csv --contacts={n}", "--contacts") for n in (-3, 0, 3.5)),
        ("measure trace.csv --scale 0", "--scale = '0': must be the force of one unit"),
        ("measure trace.csv --velocity 0.0008", "a value needs its unit"),
        ("measure trace.csv --to 0", "--to 0: fewer than 16 samples lie before it"),
        ("measure link.csv", "it is a link to gone.csv, which is not there"),
        *((f"measure run.nc {o}", "a table") for o in ("--force 2", "--flip")),
        *((f"plot trace.csv a.png {o}", "a sweep") for o in ("--at a=1", "--bistable")),
        ("plot trace.csv a.png --kind phase --beside trace.csv", "excludes --beside"),
        ("predict rig.toml --fast --thorough", "excludes --thorough"),
        ("predict latin.toml", "line 1 is not in UTF-8"),
        ("predict rig.toml --set drive.speed=1", "did you mean 'velocity'?"),
        ("predict rig.toml --set velocity=1", "did you mean drive.velocity?"),
        ("predict", "--rig requires an argument; a value that"),
        ("simulate rig.toml -o run.csv", "a run is written as .nc"),
        ("export rig.toml --to statespace --poles 5.5", "must be a whole number"),
        ("sweep --status --store s --plot a.png", "--plot: is not drawn with --status"),
        ("surface h --pressure 1", "--material: is missing: glass or pmma"),
        ("surface h --pressure 1 --material pmma --young 7GPa", "--young: follows"),
        ("map rig.toml --over leaf,mass", "Slider has no leaf to vary; choose stiff"),
        *((f"map rig.toml --over mass{s}", " parameters") for s in ("", ",mass")),
        ("map rig.toml --over stiffness,colour", "'colour'"),
        ("map rig.toml --points 1", "points"),
        ("map rig.toml --points 10.5", "whole number"),
        *((f"map rig.toml --points {n}", "must be a number") for n in BAD_COUNTS),
        ("rsf warm.toml --holds 100", "'100': has no unit; write it as in '10 s'"),
        ("rsf warm.toml --plot holds.svg", "--plot holds.svg: needs --holds"),
        ("rsf warm.toml --area '1 cm^2'", "--area 1 cm^2: needs --export"),
        ("rsf warm.toml --export qdyn", "--export qdyn: needs --load"),
        ("rsf rig.toml", "; add [interface.activation]"),
        ("rsf rig.toml --velocity '1 um/s'", "is not in a unit of '1'"),
        *((f"rsf trace.csv{given}", "--step-at") for given in ("", " --from 3um/s")),
        ("rsf trace.csv --step-at 9", "must both be given (--from, --to)"),
        (f"rsf trace.csv --step-at '9 s' {HOLDS}", "--holds: is for a rig"),
        ("fit trace.csv", "samples from slip to slip"),
        ("fit trace.csv -o fitted.toml", "--stiffness"),
        ("paper fig99", "fig99"),
        ("paper fig1 -o rig.toml", "rig.toml"),
        ("paper fig1 --format gif", "gif"),
    ],
    ids=lambda value: ascii(value[:60]),
)
@pytest.mark.usefixtures("rig", "sawtooth", "unusable")
def test_what_cannot_be_used_is_refused_in_one_line(command, words, capsys):
    line = refused(capsys, *shlex.split(command))
    assert words in line
    assert len(line) < 420


READERS = "measure", "fit", "rerun", "predict"
READERS += "sweep --store s", "surface --pressure 1"


@pytest.mark.parametrize("command", READERS)
def test_a_file_that_may_not_be_read_is_named_with_a_remedy(
    command, capsys, monkeypatch, sawtooth
):
    def closed(call, file, *given, **options):
        if str(file) == str(sawtooth):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(file))
        return call(file, *given, **options)

    material = ["--material", "pmma"] if "surface" in command else []
    for calls in ({"builtins.open": open, "io.open": open}, {"os.stat": os.stat}):
        with monkeypatch.context() as patch:
            for name, call in calls.items():
                patch.setattr(name, partial(closed, call))
            code = run(*command.split(), sawtooth, *material)
        line = capsys.readouterr().err
        assert code == 2
        assert f"{sawtooth}: cannot be " in line
        assert "(Permission denied); ask its owner, or make it" in line


def test_output_that_is_not_written_is_told_in_a_line(tmp_path, capsys, monkeypatch):
    with monkeypatch.context() as patch, open("/dev/full", "w") as full:
        patch.setattr(sys, "stdout", full)
        assert run("new") == 2
    assert "standard output: cannot be written (No sp" in capsys.readouterr().err
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", None)
        assert run("new") == 0
        sys.stdout.close()
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    os.rmdir(tmp_path / "gone")
    monkeypatch.setattr(cli, "app", lambda *_, **__: os.getcwd())
    assert "change to another (cd)" in refused(capsys)


def test_what_can_be_refused_is_before_the_run(rig, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("stickslip.simulate", lambda *_, **__: pytest.fail("it ran"))
    assert ".png" in refused(capsys, "simulate", rig, "--plot", tmp_path / "run.gif")
    assert ".html" in refused(capsys, "report", rig, "-o", tmp_path / "report.pdf")
    odd = ss.Rig(INTERFACE, lambda s: s, ss.constant(1.0))
    monkeypatch.setattr("stickslip.io.settings.read_rig", lambda _: odd)
    assert "cannot be written into a rig file" in refused(capsys, "simulate", rig)


BOTH = "given for two outputs"


@pytest.mark.parametrize(
    ("command", "kept", "words"),
    [
        ("simulate rig.toml -o rig.toml", "rig.toml", "is the file to be read"),
        ("simulate rig.toml -o link.toml", "rig.toml", "is the file to be read"),
        ("simulate rig.toml -o kept.nc", "kept.nc", "is read-only"),
        ("simulate rig.toml -o pipe", "pipe", "is a named pipe"),
        ("simulate rig.toml -o a.png --plot a.png", "rig.toml", BOTH),
        ("measure trace.csv --events /dev/null", "/dev/null", "is a device"),
        ("measure trace.csv --events a.csv --curve a.csv", "rig.toml", BOTH),
        ("plot trace.csv kept.png", "kept.png", "is read-only"),
        ("predict rig.toml --plot kept.png", "kept.png", "is read-only"),
        ("sweep rig.toml --store new --plot kept.png", "kept.png", "is read-only"),
        ("paper fig1", "fig1.nc", "is read-only"),
    ],
)
@pytest.mark.usefixtures("rig", "sawtooth")
def test_an_output_replaces_only_a_file_that_may_be_replaced(
    tmp_path, capsys, monkeypatch, command, kept, words
):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    os.symlink("rig.toml", "link.toml")
    for name in ("kept.nc", "kept.png", "fig1.nc"):
        Path(name).touch(mode=0o444)
    before = sorted(os.listdir()), os.stat(kept)
    assert words in refused(capsys, *command.split())
    assert (sorted(os.listdir()), os.stat(kept)) == before


def heed_interrupts():
    """A shell starts background jobs with Ctrl-C ignored, and their children inherit
    that.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


HANGS_UP = pytest.param(signal.SIGHUP, marks=pytest.mark.slow)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, HANGS_UP])
def test_an_interrupt_leaves_nothing_half_written_and_says_so(tmp_path, number):
    file = tmp_path / "big.toml"
    file.write_text(SMALL.replace("distance = 40.0", "distance = 1e6"))
    target = tmp_path / "run.nc"
    command = [sys.executable, "-m", "stickslip", "simulate", str(file), "-o"]
    how = {"stderr": subprocess.PIPE, "text": True, "preexec_fn": heed_interrupts}
    process = subprocess.Popen([*command, str(target)], **how)
    assert " on one core: " in process.stderr.readline()
    time.sleep(1)  # well into the run
    process.send_signal(number)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert told == "stickslip: interrupted; no half-written file was left behind\n"
    assert os.listdir(tmp_path) == ["big.toml"]


def test_a_command_of_nohup_outlives_its_terminal():
    code = (
        "import os, signal\nfrom stickslip import cli\n"
        "cli.app = lambda *_, **__: os.kill(os.getpid(), signal.SIGHUP)\n"
        "print('code', cli.main([]))\n"
    )
    for prepare, expected in (("SIG_IGN", "code 0"), ("SIG_DFL", "code 130")):
        before = f"import signal; signal.signal(signal.SIGHUP, signal.{prepare})\n"
        command = [sys.executable, "-c", before + code]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stdout.strip() == expected


def test_quantities_of_a_trace_are_in_si_units(tmp_path, capsys):
    """A number without a unit is in s or N, whatever the unit of the file."""
    file = tmp_path / "ms.csv"
    rows = [f"{10 * i},{2 + i % 100 / 100:.2f},{1 + i // 1000}" for i in range(4000)]
    file.write_text("\n".join(["time (ms),force (mN),velocity (mm/s)", *rows, ""]))
    for after in ("10", "10 s", "10000 ms"):
        options = "--after", after, "--minimum-drop", "0.5 mN", "--json"
        assert run("measure", file, *options) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["regime"]["window"][0] == 1e4
        assert found["statistics"]["count"] == 29
        assert found["speeds"]["velocity"] == pytest.approx([2.0, 3.0, 4.0])
    bare = tmp_path / "forces.csv"
    bare.write_text("force\n" + "".join(f"{i % 20}\n" for i in range(400)))
    for step in ("10 ms", "0.01"):
        assert run("measure", bare, "--step", step) == 0
    one, other = capsys.readouterr().out.split("evaluated")[1:]
    assert one.splitlines()[0] == other.splitlines()[0]
    assert "not in a unit of 's'" in refused(capsys, "measure", file, "--after", "10 N")


def in_a_process(*arguments, reader="cat", **environment):
    """Return exit code, output and errors of a command run in another process."""
    shell = f'"$0" -m stickslip "$@" | {reader}; exit "${{PIPESTATUS[0]}}"'
    command = ["bash", "-c", shell, sys.executable, *arguments]
    how = {"env": os.environ | environment, "capture_output": True, "check": False}
    done = subprocess.run(command, **how)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.takes(6)  # starts interpreters
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp437"])
def test_letters_that_a_terminal_lacks_are_replaced(encoding):
    script = (
        "from stickslip import cli, console\n"
        "console.replace_missing_letters()\n"
        "cli._answer('\\u00b1 6 \\u00b5m \\u2265 \\u03c3', {}, False)\n"
    )
    environment = os.environ | {"PYTHONIOENCODING": encoding}
    how = {"env": environment, "capture_output": True, "check": False}
    done = subprocess.run([sys.executable, "-c", script], **how)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b" 6 " in done.stdout


@pytest.mark.takes(6)
@pytest.mark.parametrize("arguments", [["--help"], ["new"], ["new", "wiper"]])
def test_a_reader_that_goes_away_ends_a_command_quietly(arguments):
    for reader in ("true", "head -c 1 > /dev/null"):
        code, _, errors = in_a_process(*arguments, reader=reader)
        assert (code, errors) == (0, b"")
