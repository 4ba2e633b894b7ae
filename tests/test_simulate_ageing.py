"""Runs with thresholds that age: both starts, contacts against the kinetic equation, repeats, what is refused."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from stickslip.errors import InputError
from stickslip.kernels.lives import reach
from stickslip.model import (
    Bell,
    Contacts,
    Delay,
    ExponentialGrowth,
    FromRest,
    FromSliding,
    Interface,
    Langevin,
    LogarithmicGrowth,
    MasterEquation,
    Output,
    PaperClosure,
    RandomDelay,
    Rig,
    Slider,
)
from stickslip.model.distributions import Uniform
from stickslip.model.drive import ForceAbove, Travel, constant
from stickslip.paper.cases import FIG4, FIG8
from stickslip.simulation import rerun, simulate
from stickslip.sliding import kinetic_friction
from stickslip.sliding.lives import growth_of
from stickslip.theory import closure_friction

SAMPLED = Output(interval=0.004)
SOFT = Slider(stiffness=1.0, mass=1.0, damping=1.0)


def aged(rate, newborn=0.0, **changes):
    return replace(FIG8.interface, ageing=Langevin(rate=rate, newborn=newborn), **changes)


def late(run, since):
    return run["spring_force"].to_numpy()[run["time"].to_numpy() >= since]


@pytest.fixture(scope="module")
def slips():
    return {
        name: simulate(Rig(aged(1.5), FIG8.slider, constant(1.0, 10.0)), method=method, output=SAMPLED)
        for name, method in (("contacts", Contacts(2_000, seed=1)), ("density", MasterEquation(rtol=1e-4)))
    }


@pytest.mark.eq(13, 15, 16)
def test_stick_slip_of_figure_8_in_both_solvers(slips):
    for run in slips.values():
        force = late(run, 5.0)
        assert 1.20 < np.ptp(force) < 1.28
        assert 0.73 < force.max() < 0.77
    peaks = [late(run, 5.0).max() for run in slips.values()]
    assert peaks[0] == pytest.approx(peaks[1], rel=0.03)


@pytest.mark.parametrize("method", [Contacts(2_000, seed=1), MasterEquation(rtol=1e-4)])
@pytest.mark.parametrize(("rate", "low", "high"), [(0.7, 0.0, 0.05), (0.9, 0.36, 0.46)])
def test_smooth_sliding_and_small_stick_slip_of_figure_8_in_both_solvers(rate, low, high, method):
    run = simulate(Rig(aged(rate), FIG8.slider, constant(1.0, 10.0)), method=method, output=SAMPLED)
    assert low <= np.ptp(late(run, 5.0)) < high


def test_upper_range_of_figure_8_depends_on_the_start():
    method = MasterEquation(rtol=4e-4)
    relaxed = simulate(Rig(aged(2.0), FIG8.slider, constant(1.0, 8.0)), method=method, output=SAMPLED, start=FromRest())
    steady = simulate(
        Rig(aged(2.0), FIG8.slider, constant(1.0, 4.0)), method=method, output=SAMPLED, start=FromSliding()
    )
    assert 1.17 < np.ptp(late(relaxed, 4.0)) < 1.26
    assert np.ptp(late(steady, 0.0)) < 0.12


def test_variables_are_those_of_other_runs_less_the_unknown_energies(slips):
    run = slips["contacts"]
    assert set(run.data_vars) == {
        "displacement",
        "velocity",
        "spring_force",
        "friction_force",
        "attached",
        "drive_velocity",
        "kinetic_energy",
        "spring_energy",
    }
    assert all(np.isfinite(v).all() for v in run.data_vars.values())
    assert float(slips["density"]["attached"].min()) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("method", [Contacts(300, seed=4), MasterEquation(rtol=4e-3)])
def test_pieces_end_where_their_conditions_are_met(method):
    never = constant(1.0, 3.0).until(ForceAbove(99.0))
    plain = simulate(Rig(aged(1.5), SOFT, never), method=method, output=Output(interval=0.01))
    drive = constant(1.0, 3.0).until(ForceAbove(0.4)).then(constant(0.5, 2.0).until(Travel(0.1)))
    run = simulate(Rig(aged(1.5), SOFT, drive), method=method, output=Output(interval=0.01))
    seam = int(np.argmax(run["spring_force"].to_numpy() >= 0.4))
    np.testing.assert_array_equal(run["displacement"][: seam + 1], plain["displacement"][: seam + 1])
    assert np.all(run["spring_force"][:seam] < 0.4)
    np.testing.assert_array_equal(run["drive_velocity"][: seam + 1], 1.0)
    np.testing.assert_array_equal(run["drive_velocity"][seam + 1 :], 0.5)
    assert run["displacement"][-1] - run["displacement"][seam] >= 0.1
    assert run["displacement"][-2] - run["displacement"][seam] < 0.1


# ---------------------------------------------------------------- the paper's closure


@pytest.mark.eq(1, 2, 3, 18)
def test_the_closure_slides_by_its_own_friction_and_has_a_slip_of_its_own():
    heavy = Slider(stiffness=20.0, mass=1.0, damping=5.0)
    expected = closure_friction(aged(1.0), 0.5)
    assert expected == pytest.approx(0.911 * kinetic_friction(aged(1.0), 0.5), rel=2e-3)
    assert closure_friction(aged(1.0), np.array([0.01, 1.0])) == pytest.approx([0.5025, 0.0894], rel=5e-3)
    run = simulate(Rig(aged(1.0), heavy, constant(0.5, 2.0)), method=PaperClosure(cells=200), start=FromSliding())
    # First order in a step of 4/cells.
    assert float(run["friction_force"].mean()) == pytest.approx(expected, rel=0.03)
    assert float(run["attached"].min()) == pytest.approx(1.0, abs=1e-9)
    slips = simulate(Rig(aged(1.5), FIG8.slider, constant(1.0, 2.0)), method=PaperClosure(cells=200), output=SAMPLED)
    assert float(slips["spring_force"].max()) > 0.6
    xr.testing.assert_identical(rerun(slips), slips)


def test_the_closure_is_for_langevin_ageing_without_delay():
    for interface, message in (
        (FIG4.interface, "thresholds that age by Langevin"),
        (replace(FIG8.interface, ageing=ExponentialGrowth(rate=1.0)), "use Contacts"),
        (aged(1.0, newborn=0.3, delay=Delay(0.3)), "use Contacts"),
    ):
        with pytest.raises(InputError, match=message):
            simulate(Rig(interface, FIG8.slider, constant(1.0, 1.0)), method=PaperClosure())
    with pytest.raises(InputError, match="knows no delay"):
        closure_friction(aged(1.0, newborn=0.3, delay=Delay(0.3)), 1.0)


# ---------------------------------------------------------------- thresholds that grow by a fixed rule

GROWTH = [
    ExponentialGrowth(rate=2.0),
    ExponentialGrowth(rate=2.0, newborn=0.3),
    LogarithmicGrowth(slope=0.1, time=0.01),
]


@pytest.mark.parametrize("ageing", GROWTH)
@pytest.mark.parametrize("delay", [Delay(0.0), RandomDelay(mean=0.2, std=0.1)])
def test_growing_contacts_slide_with_their_steady_force_from_both_starts(ageing, delay):
    heavy = Slider(stiffness=20.0, mass=1.0, damping=5.0)
    interface = Interface(
        thresholds=Uniform(low=0.5, high=1.5), initial=Uniform(low=-0.2, high=0.2), delay=delay, ageing=ageing
    )
    expected, n = kinetic_friction(interface, 0.7), 4_000
    # The stretchings of a sample, and the strengths of the pool it is drawn from, scatter by less than .4.
    tolerance = 4 * 0.4 / np.sqrt(n)
    steady = simulate(Rig(interface, heavy, constant(0.7, 4.0)), method=Contacts(n, seed=6), start=FromSliding())
    assert float(steady["friction_force"][0]) == pytest.approx(expected, abs=tolerance)
    assert float(steady["friction_force"].mean()) == pytest.approx(expected, abs=tolerance)
    life = np.mean([reach(growth_of(ageing), strength, 0.7) for strength in np.linspace(0.5, 1.5, 2001)]) / 0.7
    assert float(steady["attached"].mean()) == pytest.approx(life / (life + delay.moment(1)), abs=0.03)
    relaxed = simulate(Rig(interface, heavy, constant(0.7, 15.0)), method=Contacts(n, seed=6))
    assert float(relaxed["friction_force"][0]) == pytest.approx(0.0, abs=tolerance)
    assert float(relaxed["friction_force"].sel(time=slice(8.0, None)).mean()) == pytest.approx(expected, abs=tolerance)


# ---------------------------------------------------------------- what cannot be followed


def test_contacts_that_break_as_soon_as_they_are_born_hold_nothing():
    interface = replace(FIG8.interface, ageing=ExponentialGrowth(rate=0.5))
    heavy = Slider(stiffness=20.0, mass=1.0, damping=5.0)
    assert kinetic_friction(interface, 3.0) == 0.0
    run = simulate(Rig(interface, heavy, constant(3.0, 0.5)), method=Contacts(200, seed=1), start=FromSliding())
    assert float(abs(run["friction_force"]).max()) < 0.05


@pytest.mark.parametrize(
    ("interface", "method", "message"),
    [
        (aged(1.0, thresholds=Uniform(low=0.5, high=1.5)), Contacts(10), "Gaussian"),
        (replace(FIG8.interface, ageing=ExponentialGrowth(rate=1.0)), MasterEquation(), "use Contacts"),
        (aged(1.0, newborn=0.3, delay=Delay(0.3)), MasterEquation(), "use Contacts"),
        (aged(1.0), MasterEquation(memoryless=True), "memoryless"),
        (aged(1.0, delay=Delay(0.3)), Contacts(500), r"newborn = 0"),
    ],
)
def test_what_has_no_solver_is_refused(interface, method, message):
    with pytest.raises(InputError, match=message):
        simulate(Rig(interface, FIG8.slider, constant(1.0, 1.0)), method=method)


# ---------------------------------------------------------------- steps


HOT = Bell(width=0.05, attempts=1e-25)  # never tried


@pytest.mark.parametrize("mass", [1e-2, 1e-3])
def test_a_temperature_that_breaks_nothing_damps_nothing(mass):
    """An undamped slider on contacts that never break by activation rings on as without temperature."""
    slider, interface = Slider(stiffness=1.0, mass=mass, damping=0.0), aged(1.5, newborn=0.5)
    std = [
        float(
            simulate(Rig(case, slider, constant(1.0, 1.0)), method=Contacts(400, seed=1))["velocity"]
            .sel(time=slice(0.5, None))
            .std()
        )
        for case in (interface, replace(interface, temperature=HOT))
    ]
    assert std[1] == pytest.approx(std[0], rel=0.05)


def test_recorded_friction_of_hot_contacts_moves_the_slider():
    """M X'' + M eta X' = K (X_lp - X) - F, over many steps."""
    slider = Slider(stiffness=2.0, mass=0.01, damping=2.0)
    run = simulate(
        Rig(aged(1.0, newborn=0.5, temperature=Bell(width=0.05, attempts=1.0)), slider, constant(1.0, 1.0)),
        method=Contacts(500, seed=2),
        output=Output(interval=2e-4),
    )
    t, v = run["time"].to_numpy(), run["velocity"].to_numpy()
    push = (run["spring_force"] - run["friction_force"] - 0.02 * run["velocity"]).to_numpy()
    gained = np.concatenate([[0.0], np.cumsum(0.5 * (push[1:] + push[:-1]) * np.diff(t))]) / 0.01
    assert np.abs(gained - (v - v[0])).max() < 0.02 * np.abs(v).max()
