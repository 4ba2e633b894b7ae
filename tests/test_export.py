"""An interface as other programs take it."""

import io
import json
import re

import numpy as np
import pytest
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


def test_a_fit_has_stable_poles_no_static_stiffness_and_its_error():
    rig = ss.read_rig("brake_pad")
    system = state_space(rig)
    assert np.all(np.linalg.eigvals(system.A).real < 0.0)
    assert abs(system.stiffness(0.0)) < 1e-12 * system.D[0, 0]
    s = 1j * np.linspace(0.01, 1.0, 50) * system.band[1]
    natural = rig.natural
    exact = rig.unit("stiffness") * ss.stability.dynamic_stiffness(
        natural.interface, natural.velocity, s * rig.unit("time")
    )
    off = np.abs(system.stiffness(s) - exact).max() / np.abs(exact).max()
    assert off <= 1.2 * system.error < 1e-3
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
    ],
)
def test_what_cannot_be_fitted_is_refused(rig, poles, words):
    with pytest.raises(InputError, match=words):
        state_space(rig, poles=poles)


@pytest.mark.parametrize(
    ("poles", "delay", "off"),
    [(4, 0.1, 1e-3), (6, 0.1, 1e-4), (8, 0.1, 2e-5), (6, 0.2, 1e-4)],
)
def test_the_limit_of_smooth_sliding_follows_from_the_fit(poles, delay, off):
    rig = FIG.replace(delay=delay)
    exact = ss.critical(rig, "velocity", between=(0.5, 2.0)).edges[-1].value
    ends = 0.98 * exact, 1.02 * exact
    found = brentq(
        lambda v: fastest_growth(rig.replace(velocity=v), poles), *ends, xtol=1e-7
    )
    assert found == pytest.approx(exact, abs=off)


PAD = ss.read_rig("brake_pad")
LABEL = "good for compensation and slow motion; predicts neither squeal nor hunting"


def numbers_in(text):
    """Numbers of the lines that are no notes."""
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


GROWING = PAD.replace(
    interface=ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=0.1),
        ageing=ss.ExponentialGrowth(rate=2.0),
    )
)


@pytest.mark.parametrize(
    ("rig", "to", "more", "words"),
    [
        (PAD, "simulink", {}, "to = 'simulink': must be one of statespace, modelica"),
        (FIG, "modelica", {}, "takes SI units, and the rig is in natural units; give"),
        (GROWING, "modelica", {}, "ageing = .*: not available with static_friction"),
        (PAD, "mujoco", {"speeds": (1.0, 2.0)}, "speeds: are for modelica, simscape"),
        (PAD, "lugre", {"speeds": ("1 N", "2 m/s")}, r"speeds\[0\] = '1 N': "),
        (PAD, "lugre", {"poles": 6}, "poles: are for statespace, not for lugre"),
        (PAD, "statespace", {"path": "x.txt"}, "goes to a .mat or a .json file"),
        (PAD, "statespace", {"path": "no/x.mat"}, "there is no directory"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_a_line(rig, to, more, words):
    with pytest.raises(InputError, match=words) as error:
        export(rig, to, **more)
    assert "\n" not in str(error.value)
