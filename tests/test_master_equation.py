"""The master equation: its error follows its tolerance, whatever the rig."""

import math

import numpy as np
import pytest

import stickslip as ss


def rig(
    slider,
    *,
    thresholds=ss.Gaussian(mean=1.0, std=0.1),
    delay=ss.Delay(0.2),
    duration=6.0,
):
    stiffness, mass, damping = slider
    interface = ss.Interface(thresholds=thresholds, delay=delay)
    slider = ss.Slider(stiffness=stiffness, mass=mass, damping=damping)
    return ss.Rig(interface, slider, ss.constant(1.0, duration))


RIGS = {
    "soft": rig((0.5, 1e-4, 60.0)),
    "stiff": rig((20.0, 1e-6, 1000.0), duration=4.0),
    "random delay": rig((2.0, 1e-4, 42.4), delay=ss.RandomDelay(mean=0.2, std=0.12)),
    "uniform": rig((1.0, 1e-4, 60.0), thresholds=ss.Uniform(low=0.7, high=1.3)),
    "next to tau*": rig((2.0, 1e-4, 42.4), delay=ss.Delay(0.0757)),
}


def force(case, rtol):
    run = ss.simulate(
        case, method=ss.MasterEquation(rtol=rtol), output=ss.Output(interval=0.005)
    )
    return run["spring_force"].to_numpy()


@pytest.mark.parametrize("name", RIGS)
def test_the_error_is_within_a_factor_of_ten_of_the_tolerance(name):
    exact = force(RIGS[name], 1e-10)
    for rtol in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8):
        assert np.sqrt(np.mean((force(RIGS[name], rtol) - exact) ** 2)) < 10 * rtol


@pytest.mark.parametrize("ratio", [0.9, 0.97, 1.0, 1.2, 2.0])
def test_an_arrest_in_a_hold_is_seen_by_all_methods_or_refused(ratio):
    interface = ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.OnArrest()
    )
    hold = (
        ss.constant(0.85, duration=5.0)
        .then(ss.constant(0.0, duration=5.0))
        .then(ss.constant(0.85, duration=5.0))
    )
    damping = 2.0 * ratio * math.sqrt(0.36 / 1.5e-3)
    rig = ss.Rig(
        interface, ss.Slider(stiffness=0.36, mass=1.5e-3, damping=damping), hold
    )
    peaks = []
    refusals = []
    methods = [ss.Contacts(2000), ss.MasterEquation(), ss.MasterEquation(rtol=1e-6)]
    for method in (*methods, ss.Population(10_000)):
        try:
            run = ss.simulate(rig, method=method, output=ss.Output(interval=0.01))
        except ss.InputError as refusal:
            refusals.append(str(refusal))
        else:
            assert float(run.attached.sel(time=9.9, method="nearest")) > 0.99
            peaks.append(float(run.spring_force[run.time > 10.0].max()))
    assert len(peaks) == (4 if ratio == 0.9 else 1 if ratio == 0.97 else 0)
    assert all(
        "no arrest at which contacts re-attach" in refusal for refusal in refusals
    )
    assert peaks == pytest.approx([0.822] * len(peaks), abs=5 * 0.5 / math.sqrt(2000))
