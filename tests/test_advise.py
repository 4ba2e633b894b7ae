"""Predictions are true: verdicts against the settled cases, and every mitigation against a simulation after the change."""

import math
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip import advise
from stickslip.io import rig_files as rigs
from stickslip.model.parameters import parameter_named
from stickslip.paper.cases import FIG8


def make(*, stiffness, damping_ratio=0.15, mass=1e-4, std=0.1, delay=0.1, velocity=1.0, contacts=3000, seed=1):
    """A rig in natural units, its damping given by its ratio."""
    return rigs.from_document(
        {
            "units": "natural",
            "slider": {"stiffness": stiffness, "mass": mass, "damping_ratio": damping_ratio},
            "interface": {"thresholds": {"distribution": "gaussian", "std": std}, "delay": delay},
            "drive": {"velocity": velocity, "distance": 80.0},
            "simulation": {"contacts": contacts, "seed": seed},
        }
    )


def at(rig, remedy_knob, value):
    """The rig with one parameter varied."""
    return parameter_named(remedy_knob).set(rig.natural, value)


def motion_from_rest(setting, seed):
    """The regime from rest; a run that does not decide is made longer."""
    distance = max(150.0, 15.0 / setting.slider.stiffness)
    for longer in (1.0, 2.0, 4.0):
        drive = ss.constant(setting.velocity, longer * distance / setting.velocity)
        seen = ss.regime(
            ss.simulate(ss.Rig(setting.interface, setting.slider, drive), method=ss.Contacts(10_000, seed=seed))
        )
        if seen.kind != "undecided":
            break
    return seen


@pytest.mark.eq(8)
def test_the_paper_s_rig_is_bistable_with_its_margins():
    found = advise.predict(make(stiffness=2.0))
    assert found.regime.kind == "stick-slip"
    assert found.unstable_modes == 0
    assert found.bistable
    assert found.smooth is False
    assert found.critical_stiffness == pytest.approx(2.989, abs=3e-3)
    assert found.stiffness_margin == pytest.approx(2.0 / 2.989, abs=1e-3)
    margins = {margin.parameter: margin for margin in found.margins}
    assert margins["velocity"].upper == pytest.approx(1.388221, abs=1e-6)
    assert margins["delay"].upper == pytest.approx(0.138218, abs=1e-6)
    assert margins["velocity"].lower is None


def test_a_mitigation_leaves_the_bistable_band():
    rig = make(stiffness=2.0)
    found = advise.predict(rig)
    assert found.mitigations
    # tau* = .0755 and v1' = .71 are where stick-slip decays from the narrow start.
    stops = {mitigation.parameter: mitigation.stops for mitigation in found.mitigations}
    assert stops["delay"] < 0.0755 + 0.003
    assert stops["delay"] > 0.8 * 0.0755
    assert stops["velocity"] < 0.73
    for mitigation in found.mitigations:
        assert motion_from_rest(at(rig, mitigation.parameter, mitigation.stops), seed=5).kind == "smooth sliding", (
            mitigation
        )


def test_verification_runs_the_rig_s_own_method():
    found = advise.predict(make(stiffness=2.0, contacts=2000), verify=True)
    assert all(seen.kind == "smooth sliding" for mitigation in found.mitigations for seen in mitigation.checked)
    assert all(mitigation.checked for mitigation in found.mitigations)
    assert all("checked with the rig's own method" in line for line in found.mitigation_lines())


def test_a_stable_rig_needs_no_mitigation():
    found = advise.predict(make(stiffness=5.0, delay=0.05))
    assert found.smooth
    assert not found.ill
    assert found.mitigations == ()


def test_without_delay_nothing_can_grow():
    found = advise.predict(make(stiffness=2.0, delay=0.0))
    assert found.regime.kind == "smooth sliding"
    assert found.unstable_modes == 0
    assert "neutrally stable" in found.theory_note
    assert found.margins == ()


def test_contacts_that_never_come_back_have_no_theory():
    rig = make(stiffness=2.0)
    found = advise.predict(replace(rig, interface=replace(rig.interface, delay=ss.Delay(math.inf))))
    assert found.unstable_modes is None
    assert found.theory_note


def test_a_prediction_needs_a_speed():
    rig = make(stiffness=2.0)
    with pytest.raises(ss.InputError, match="speed above 0"):
        advise.predict(replace(rig, drive=ss.constant(-1.0, 10.0)))


def test_the_map_holds_boundary_growth_and_the_rig_itself():
    found = advise.chart(make(stiffness=2.0), ("stiffness", "velocity"), 5.0, 20)
    assert float(found["here_stiffness"]) == 2.0
    assert (found["growth_rate"] > 0).any()
    assert (found["growth_rate"] < 0).any()
    edge = found.where(found["other_unstable"] == 0, drop=True)
    nearest = float(edge["edge_velocity"][int(np.argmin(abs(edge["edge_stiffness"].to_numpy() - 2.0)))])
    assert nearest == pytest.approx(1.388, rel=0.25)


@pytest.mark.slow
def test_ageing_rigs_have_margins_and_mitigations_that_are_true():
    rig = make(stiffness=1.0, damping_ratio=0.05)
    rig = replace(rig, interface=FIG8.interface)
    found = advise.predict(rig)
    assert found.regime.kind == "stick-slip"
    assert found.unstable_modes == 2
    margins = {margin.parameter: margin for margin in found.margins}
    # The edges of Fig. 8, as times of ageing.
    assert margins["ageing"].lower == pytest.approx(1.63**-2, rel=0.04)
    assert margins["ageing"].upper == pytest.approx(0.80**-2, rel=0.06)
    assert margins["velocity"].lower == pytest.approx(0.8687, abs=0.002)
    cures = [mitigation for mitigation in found.mitigations if mitigation.stops is not None]
    assert {"ageing", "stiffness", "std"} <= {mitigation.parameter for mitigation in cures}
    for mitigation in found.mitigations:
        if mitigation.keeps is not None:
            here = at(rig, mitigation.parameter, mitigation.keeps)
            assert ss.stability.count_unstable(here) == 0
    for mitigation in cures:
        here = at(rig, mitigation.parameter, mitigation.stops)
        drive = ss.constant(here.velocity, 60.0 / here.velocity)
        run = ss.simulate(ss.Rig(here.interface, here.slider, drive), method=ss.Contacts(2_000, seed=77))
        late = run["spring_force"].to_numpy()[run["time"].to_numpy() > 36.0 / here.velocity]
        assert np.ptp(late) < 0.25


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_mitigations_of_rigs_drawn_at_random_are_true(number):
    rng = np.random.default_rng([7, number])
    rig = make(
        stiffness=float(np.exp(rng.uniform(np.log(0.7), np.log(6.0)))),
        damping_ratio=0.5 * float(rng.uniform(0.1, 1.2)),
        mass=float(10 ** rng.uniform(-4.5, -3.0)),
        std=float(rng.uniform(0.06, 0.2)),
        delay=float(rng.uniform(0.03, 0.3)),
        velocity=float(np.exp(rng.uniform(np.log(0.4), np.log(2.5)))),
    )
    found = advise.predict(rig)
    if not found.ill:
        assert motion_from_rest(at(rig, "velocity", rig.velocity), seed=3).kind in ("smooth sliding", "undecided")
    for mitigation in found.mitigations:
        if mitigation.keeps is not None:
            kept = at(rig, mitigation.parameter, mitigation.keeps)
            assert ss.stability.count_unstable(kept) == 0
        if mitigation.stops is not None:
            seen = motion_from_rest(at(rig, mitigation.parameter, mitigation.stops), seed=number)
            assert seen.kind == "smooth sliding", (mitigation, seen)
