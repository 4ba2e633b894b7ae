"""An interface exported for other programs."""

import io
import json
import re
import zipfile
from dataclasses import replace

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from scipy.io import loadmat
from scipy.optimize import brentq

import stickslip as ss
from stickslip import cli
from stickslip.errors import InputError
from stickslip.structures import export, state_space

BASE = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4264)
FIG = ss.Rig(BASE, SLIDER, ss.constant(velocity=1.0))


def fastest_growth(rig, poles):
    """Real part of the rightmost mode of the slider on the fitted contacts."""
    system = state_space(rig, poles=poles)
    slider = rig.slider
    whole = np.zeros((poles + 2, poles + 2))
    whole[:poles, :poles] = system.A
    whole[:poles, poles] = system.B[:, 0]
    whole[poles, poles + 1] = 1.0
    whole[-1, :poles] = -system.C[0] / slider.mass
    whole[-1, poles] = -(slider.stiffness + system.D[0, 0]) / slider.mass
    whole[-1, -1] = -slider.damping
    return np.linalg.eigvals(whole).real.max()


HEAT = replace(BASE, activation=ss.Bell(width=0.115, attempts=5e5))
# contacts whose times of life spread over decades, so that no fit is good
WARM = FIG.replace(interface=HEAT)
FITTED = (ss.read_rig("brake_pad"), 6, 1e-3), (WARM.replace(velocity=0.03), 10, 1.0)


@pytest.mark.parametrize(("rig", "poles", "most"), FITTED)
def test_a_fit_has_stable_poles_no_static_stiffness_and_its_error(rig, poles, most):
    system = state_space(rig, poles=poles)
    assert np.all(np.linalg.eigvals(system.A).real < 0.0)
    assert abs(system.stiffness(0.0)) < 1e-10 * system.D[0, 0]
    s = 1j * np.linspace(0.001, 1.0, 1000) * system.band[1]
    natural = rig.natural
    velocity = natural.velocity
    points = s * rig.unit("time")
    kappa = ss.stability.dynamic_stiffness(natural.interface, velocity, points)
    exact = rig.unit("stiffness") * kappa
    off = np.abs(system.stiffness(s) - exact).max() / np.abs(exact).max()
    assert off <= 1.2 * system.error < most
    kept = loadmat(io.BytesIO(system.mat()))
    listed = json.loads(json.dumps(system.to_dict()))
    for name in "ABCD":
        np.testing.assert_array_equal(kept[name], listed[name])
        np.testing.assert_array_equal(kept[name], getattr(system, name))


@pytest.mark.parametrize(
    ("rig", "poles", "words"),
    [
        (FIG, 5, "poles = 5: must be even"),
        (FIG, 2, "poles = 2: must be a finite number at least 4 and at most 24"),
        (FIG.replace(delay=0.0), 6, "contacts re-attach at once, so"),
        (replace(FIG, drive=ss.constant(0.0, 1.0)), 6, "drive.velocity = 0: must be"),
    ],
)
def test_what_cannot_be_fitted_is_refused(rig, poles, words):
    with pytest.raises(InputError, match=words):
        state_space(rig, poles=poles)


LIMITS = (4, 0.1, 1e-3), (6, 0.1, 1e-4), (6, 0.2, 1e-4)


@pytest.mark.parametrize(("poles", "delay", "off"), LIMITS)
def test_the_limit_of_smooth_sliding_follows_from_the_fit(poles, delay, off):
    rig = FIG.replace(delay=delay)
    exact = ss.critical(rig, "velocity", between=(0.5, 2.0)).edges[-1].value
    ends = 0.98 * exact, 1.02 * exact

    def growth(v):
        return fastest_growth(rig.replace(velocity=v), poles)

    assert brentq(growth, *ends, xtol=1e-7) == pytest.approx(exact, abs=off)


PAD = ss.read_rig("brake_pad")
LABEL = "good for compensation and slow motion; predicts neither squeal nor hunting"


def numbers_in(text):
    """Return the numbers of the lines that are not comments."""
    lines = [line for line in text.splitlines() if line[:1] not in "/%#<v"]
    return [float(each) for each in re.findall(r"(?<![\w.])\d[\d.e+-]*", str(lines))]


@pytest.mark.parametrize("to", ["modelica", "simscape", "mujoco", "lugre"])
def test_a_table_has_its_friction_its_range_and_what_it_cannot_do(to):
    speeds = {} if to in ("mujoco",) else {"speeds": ("1 mm/s", "1 m/s")}
    text = export(PAD, to, **speeds)
    assert LABEL in text
    wanted = "at 20 mm/s;" if to == "mujoco" else "at 1 mm/s to 1 m/s;"
    assert wanted in text
    ends = ss.kinetic_friction(PAD.interface, np.array([0.001, 0.02, 1.0]) * 50.0)
    slow, usual, fast = PAD.unit("force") * ends
    static = PAD.unit("force") * ss.static_friction(PAD.interface)[0]
    if to == "modelica":
        table = np.reshape(numbers_in(text)[:28], (14, 2))
        assert table[0] == pytest.approx([0.0, slow], rel=1e-5)
        assert table[-1] == pytest.approx([1.0, fast], rel=1e-5)
        assert numbers_in(text)[-1] == pytest.approx(static / slow, rel=1e-5)
    elif to == "simscape":
        found = [float(n) for n in re.findall(r"= ([\d.e+-]+);", text)]
        assert found == pytest.approx([static, usual, 1e-3, 0.0], rel=1e-5)
    elif to == "mujoco":
        assert f'frictionloss="{usual:.5g}"' in text
    else:
        assert f"sigma_0 = {2400 / 20e-6:.6g} N/m" in text
        assert text.splitlines()[-1] == f"1,{fast:.6g}"


def test_the_command_writes_what_the_function_returns(tmp_path, capsys):
    file = tmp_path / "pad.mat"
    assert cli.main(["export", "brake_pad", "--to", "lugre"]) == 0
    assert capsys.readouterr().out == export(PAD, "lugre")
    line = ["export", "brake_pad", "--to", "statespace", "--poles", "4", "-o", file]
    assert cli.main([str(each) for each in line]) == 0
    assert capsys.readouterr().out == f"statespace: {file}\n"
    assert loadmat(file)["A"].shape == (4, 4)
    assert "not passive" in loadmat(file)["about"][0]


GROWTH = ss.ExponentialGrowth(rate=2.0)
AGED = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), ageing=GROWTH)
GROWING = PAD.replace(interface=AGED)
HELD = FIG.replace(drive=ss.constant(0.0, duration=1.0))


@pytest.mark.parametrize(
    ("rig", "to", "more", "words"),
    [
        (PAD, "simulink", {}, "to = 'simulink': must be one of statespace, modelica"),
        (FIG, "modelica", {}, "needs SI units, and the rig is in natural units; give"),
        (GROWING, "modelica", {}, "ageing = .*: not available with static_friction"),
        (HELD, "statespace", {}, "drive.velocity = 0: "),
        (PAD, "mujoco", {"speeds": (1.0, 2.0)}, "speeds: are for modelica, simscape"),
        (PAD, "lugre", {"speeds": ("1 N", "2 m/s")}, r"speeds\[0\] = '1 N': "),
        (PAD, "lugre", {"poles": 6}, "poles: are for statespace, not for lugre"),
        (PAD, "statespace", {"path": "x.txt"}, "goes to a .mat or .json"),
        (PAD, "fmu", {}, "path: is missing; an FMU is a file"),
        (GROWING, "fmu", {"path": "x.fmu"}, "ageing = .*: not available with an FMU"),
        (PAD, "statespace", {"path": "no/x.mat"}, "there is no directory"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_a_line(rig, to, more, words):
    with pytest.raises(InputError, match=words) as error:
        export(rig, to, **more)
    assert "\n" not in str(error.value)


class Unit:
    """A functional mock-up unit as another simulator runs it."""

    def __init__(self, file, folder):
        described = fmpy.read_model_description(file)
        fmpy.extract(file, str(folder))
        name = described.coSimulation.modelIdentifier
        where = {"unzipDirectory": str(folder), "modelIdentifier": name}
        self.fmu = FMU2Slave(guid=described.guid, **where)
        self.start(0.0)
        self.time = 0.0

    def start(self, displacement):
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.setReal([0], [displacement])
        self.fmu.exitInitializationMode()

    def step(self, dt, start, end):
        """Force, stiffness and impulse of a step."""
        self.fmu.setReal([0, 1], [start, (end - start) / dt])
        self.fmu.doStep(self.time, dt)
        self.time += dt
        return self.fmu.getReal([2, 3, 4])


@pytest.fixture(scope="module")
def pad_file(tmp_path_factory):
    file = str(tmp_path_factory.mktemp("fmu") / "pad.fmu")
    assert cli.main(["export", "brake_pad", "--to", "fmu", "-o", file]) == 0
    return file


@pytest.mark.takes(4)  # gcc
def test_a_unit_is_valid_and_brakes_like_the_rig(pad_file, tmp_path):
    assert validate_fmu(pad_file) == []
    entries = zipfile.ZipFile(pad_file).infolist()
    assert all(entry.external_attr >> 16 & 0o444 for entry in entries)
    unit = Unit(pad_file, tmp_path)
    natural_drag = PAD.unit("rate") * PAD.slider.damping * PAD.value("mass")
    mass, stiffness = PAD.value("mass"), PAD.value("stiffness")
    dt = 1e-5
    x = v = pull = friction = 0.0
    pulls = []
    for i in range(1, 20_001):
        before = x
        x += dt * v + 0.5 * dt**2 * (pull - natural_drag * v - friction) / mass
        friction, _, impulse = unit.step(dt, before, x)
        last, pull = pull, stiffness * (PAD.velocity * i * dt - x)
        v += (0.5 * dt * (last + pull) - dt * natural_drag * v - impulse) / mass
        pulls.append(pull)
    spring = ss.simulate(PAD)["spring_force"]
    wanted = float(spring.where(spring["time"] > 0.05, drop=True).mean())
    assert np.mean(pulls[5000:]) == pytest.approx(wanted, rel=0.01)


def test_a_unit_goes_back_to_the_bit(pad_file, tmp_path):
    unit = Unit(pad_file, tmp_path / "one")
    other = Unit(pad_file, tmp_path / "other")
    way = 25e-6
    for i in range(20):
        unit.step(1e-3, i * way, (i + 1) * way)
    kept = unit.fmu.serializeFMUstate(unit.fmu.getFMUstate())
    other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(kept))
    ways = [(i * way, (i + 1) * way) for i in range(20, 40)]
    ends = [[u.step(1e-3, *ends) for ends in ways] for u in (unit, other)]
    assert ends[0] == ends[1]
    unit.fmu.setFMUstate(unit.fmu.deSerializeFMUstate(kept))
    assert [unit.step(1e-3, i * way, (i + 1) * way) for i in range(20, 40)] == ends[0]


TENTH = ss.Gaussian(mean=1.0, std=0.1)
STRETCHED = {"newborn": ss.Gaussian(mean=0.2, std=0.3), "sliding_force": 0.3}
CLIPPED = ss.RandomDelay(mean=0.1, std=0.1, negative="clip")
LIKE_ELEMENTS = {
    "delays": {"thresholds": ss.Weibull(scale=1.0, shape=1.5), "delay": CLIPPED},
    "arrests": {"delay": ss.OnArrest(), "slip_to_slip_scatter": 0.2},
    "newborn": {"thresholds": ss.Exponential(mean=1.0), **STRETCHED},
    "areas": {"areas": ss.model.Areas(TENTH), "thresholds": None},
}


@pytest.mark.takes(4)  # gcc
@pytest.mark.parametrize("kind", LIKE_ELEMENTS)
def test_a_unit_is_the_element_in_c(kind, tmp_path):
    fields = {"thresholds": TENTH, "delay": ss.Delay(0.1)} | LIKE_ELEMENTS[kind]
    interface = ss.Interface(**fields)
    rig = PAD.replace(interface=interface, method=ss.Contacts(70, seed=3))
    file = tmp_path / "unit.fmu"
    export(rig, "fmu", file)
    unit = Unit(str(file), tmp_path / "unit")
    element = ss.Element(rig, rig.method)
    x = 0.0
    for i, way in enumerate([1.7, 0.4, -0.9, 0.3, 0.0, 2.5] * 3):
        end = x + way * rig.unit("length")
        dt = (0.1 + 0.01 * i) * rig.unit("time")
        force, impulse, stiffness = element.step(dt, end)
        wanted = force, stiffness, impulse
        assert unit.step(dt, x, end) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
        x = end


def test_without_a_compiler_there_is_one_line(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    line = ["export", "brake_pad", "--to", "fmu", "-o", str(tmp_path / "pad.fmu")]
    assert cli.main(line) == 2
    assert capsys.readouterr().err.startswith("stickslip: gcc: is not installed, and")
    assert not list(tmp_path.iterdir())
