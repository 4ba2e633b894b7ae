"""An interface as other programs take it."""

import io
import json

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.optimize import brentq

import stickslip as ss
from stickslip.errors import InputError
from stickslip.structures import state_space

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
