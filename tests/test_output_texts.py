"""The output of commands: words exactly, and numbers to two in a thousand.

A changed sentence fails a test. Kept in tests/data/drawn; ``REDRAW=1`` in the
environment writes what is printed now. Read it before you commit it.
"""

import shutil

import pytest
from benches import WARM
from drawn import assert_kept

import stickslip as ss
from stickslip import cli

SMALL = """
name = "small"
[slider]
stiffness = "5 kN/m"
mass = "10 g"
damping_ratio = 0.4
[interface]
contact_strength = "10 N"
breaking_displacement = "1 mm"
thresholds = { distribution = "gaussian", std = 0.1 }
delay = "2 ms"
[drive]
velocity = "100 mm/s"
distance = "25 mm"
[simulation]
contacts = 300
"""
BAR = """
name = "bar"
[chain]
blocks = 20
spacing = "5 mm"
width = "5 mm"
height = "50 mm"
youngs_modulus = "3 GPa"
shear_modulus = "1.1 GPa"
density = "1180 kg/m^3"
side = "4 MN/m"
damping = "1000 1/s"
[interface]
contact_strength = "768 N"
sliding_force = "326.4 N"
breaking_displacement = "1.17 um"
thresholds = { distribution = "gaussian", std = 0.1 }
delay = "1 ms"
[drive]
velocity = "1 mm/s"
distance = "0.1 mm"
[simulation]
contacts = 10
"""
STUDY = """
name = "A small study"
rig = "small.toml"
[axes]
stiffness = ["5 kN/m", "20 kN/m", "80 kN/m"]
velocity = ["30 mm/s", "300 mm/s"]
[run]
contacts = 200
seed = 1
distance = "20 mm"
"""
EXAMPLES = ("brake_pad", "pmma_slider", "rock_slab")
"""A slider, a bar and warm contacts; on other processors slips of the wiper and the
teaching bench differ.
"""
STEP = ("--step-at", "11676.28 s", "--from", "3 um/s", "--to", "10 um/s")
EXPORT = ("--load", "2 kN", "--area", "1 cm^2")
TO_EXPORT = "rsf", "warm.toml", "--law", "slip", "--export"
MAP = "map", "small.toml", "--points"
BRIEF = ("--fast",)
CASES = {
    **{f"predict {each}": ("predict", each, *BRIEF, "--details") for each in EXAMPLES},
    **{f"predict {each}, short": ("predict", each, *BRIEF) for each in EXAMPLES},
    "predict small": ("predict", "small.toml", "--details"),
    "predict small, short": ("predict", "small.toml"),
    "predict small as JSON": ("predict", "small.toml", "--fast", "--json"),
    "simulate small": ("simulate", "small.toml", "-o", "run.nc"),
    "simulate bar": ("simulate", "bar.toml", "-o", "run.nc"),
    "measure a run": ("measure", "small.nc"),
    "measure a bar": ("measure", "bar.nc"),
    "measure a trace": ("measure", "force.txt", "--step", "250 ms"),
    "rerun": ("rerun", "small.nc"),
    "rsf warm": ("rsf", "warm.toml", "--load", "2 kN"),
    "rsf warm as JSON": ("rsf", "warm.toml", "--load", "2 kN", "--json"),
    "rsf, holds": ("rsf", "warm.toml", "--holds", "1 s, 10 s, 100 s"),
    "rsf to qdyn": (*TO_EXPORT, "qdyn", *EXPORT),
    "rsf to rsfmodel": (*TO_EXPORT, "rsfmodel", *EXPORT),
    "rsf of a step": ("rsf", "basalt.txt", *STEP),
    "map small": ("map", "small.toml", "--points", "8", "-o", "map.png"),
    "map small, bistable": (*MAP, "4", "--bistable", "-o", "map.png"),
    "sweep": ("sweep", "study.toml", "--store", "cases.sqlite"),
}


@pytest.fixture(scope="module")
def bench(tmp_path_factory, request):
    """A folder with rigs, runs, and traces."""
    folder = tmp_path_factory.mktemp("bench")
    texts = {"small": SMALL, "warm": WARM, "bar": BAR, "study": STUDY}
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text)
    for name in ("small", "bar"):
        run = ss.simulate(ss.read_rig(folder / f"{name}.toml"))
        ss.save(run, folder / f"{name}.nc")
    data = request.config.rootpath / "tests" / "data"
    shutil.copy(data / "guldstrand_force7.txt", folder / "force.txt")
    shutil.copy(data / "giacomel_basalt_step.txt", folder / "basalt.txt")
    return folder


# searches for mitigations, and cycles at many points
DEAR = ("predict small", "predict small, short", "map small, bistable")
MARKS = dict.fromkeys(DEAR, pytest.mark.slow)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=MARKS.get(name, ())) for name in CASES]
)
def test_commands_say_what_they_said(name, bench, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(shutil.copytree(bench, tmp_path / "bench"))
    monkeypatch.setenv("COLUMNS", "100")
    assert cli.main(CASES[name]) == 0
    kept = name.replace(",", "").replace(" ", "_")
    assert_kept(capsys.readouterr().out, f"told_{kept}")
