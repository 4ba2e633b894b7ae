"""`simulate` for all solvers: conservation, exactness, repeatability, bad input."""

import json
import math
import time

import numpy as np
import pytest
from benches import imbalance

import stickslip as ss
from stickslip.model.distributions import SteadyState
from stickslip.model.drive import Drive
from stickslip.simulation import LABELS, estimate, record

NARROW = ss.Gaussian(mean=0.0, std=0.01)
TENTH = ss.Gaussian(mean=1.0, std=0.1)
ONE = ss.Gaussian(mean=1.0, std=0.0)
FIG4_SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)


def interface(delay=0.2, thresholds=TENTH, initial=NARROW):
    delay = ss.Delay(delay) if isinstance(delay, (int, float)) else delay
    return ss.Interface(thresholds=thresholds, initial=initial, delay=delay)


DRIVE = ss.constant(1.0, duration=6)
FIG4 = ss.Rig(interface(), FIG4_SLIDER, DRIVE, method=ss.Contacts(1_000, seed=1))
FEW = FIG4.replace(method=ss.Contacts(100, seed=1))
ONE_CONTACT = {"method": ss.Contacts(1, seed=1), "drive": ss.constant(1.0, 30)}
HEAVY = {"mass": 1.0, "damping": 0.0, "drive": ss.constant(1.0, 40)}
PULLED = interface(initial=ss.Gaussian(0.6, 0.05))
WIDE = interface(initial=ss.Gaussian(mean=0.0, std=0.25))
MOTIONS = {
    "stick-slip": FIG4,
    "one contact": FIG4.replace(**ONE_CONTACT),
    "soft": FIG4.replace(stiffness=0.01, drive=ss.constant(1.0, duration=100)),
    "stiff": FIG4.replace(stiffness=1e4),
    "undamped": FIG4.replace(damping=0.0),
    "heavy and undamped": FIG4.replace(**HEAVY),
    "overdamped": FIG4.replace(damping=1e5, drive=ss.constant(1.0, duration=20)),
    "light": FEW.replace(mass=1e-8, damping=1e4, drive=ss.constant(1.0, 3)),
    "slow": FEW.replace(drive=ss.constant(1e-3, duration=3_000)),
    "fast": FIG4.replace(drive=ss.constant(100.0, duration=1)),
    "ramp": FIG4.replace(drive=ss.ramp(0.1, 3.0, duration=6)),
    "released": FIG4.replace(interface=PULLED, drive=ss.constant(0.0, duration=2)),
    "wide start": FIG4.replace(interface=WIDE),
}


def test_the_result_is_labelled():
    output = ss.Output(interval=0.01, snapshots=(1.0, 2.0), bins=50)
    run = ss.simulate(FIG4, output=output)
    energies = {f"{part}_energy" for part in ("kinetic", "spring", "contact")}
    energies |= {"work", "damped_energy", "broken_energy"}
    of_motion = {"displacement", "velocity", "spring_force", "friction_force"}
    of_motion |= {"attached", "drive_velocity"}
    found = set(run.data_vars)
    assert found == of_motion | energies | {"stretching_density"} < set(LABELS)
    for name in (*run.data_vars, *run.coords):
        assert run[name].attrs["units"]
        assert run[name].attrs["long_name"]
        assert run[name].dtype == np.float64
    assert run["spring_force"].dims == ("time",)
    assert run["stretching_density"].dims == ("snapshot", "x")
    assert run.sizes == {"time": 601, "snapshot": 2, "x": 50}
    assert list(run.attrs) == ["provenance"]
    assert json.loads(run.attrs["provenance"])["call"] == "simulate"


def test_sums_and_forces_hang_together():
    run = ss.simulate(MOTIONS["ramp"])
    slider = FIG4_SLIDER
    t = run["time"].to_numpy()
    position = 0.1 * t + 0.5 * (2.9 / 6) * t**2
    exact = {
        "spring_force": slider.stiffness * (position - run["displacement"]),
        "drive_velocity": 0.1 + 2.9 / 6 * t,
        "kinetic_energy": 0.5 * slider.mass * run["velocity"] ** 2,
        "spring_energy": 0.5 * run["spring_force"] ** 2 / slider.stiffness,
    }
    for name, expected in exact.items():
        error = (
            {"rtol": 0, "atol": 1e-13} if name == "spring_force" else {"rtol": 1e-14}
        )
        np.testing.assert_allclose(run[name], expected, **error)
    assert run["displacement"][0] == 0
    assert run["work"][0] == run["damped_energy"][0] == run["broken_energy"][0] == 0


LASTING = (0.3, 0.1), (0.7, 0.1), (2.0, 0.3), (1 / 3, 1 / 300), (1e-3, 1e-4)


@pytest.mark.parametrize(("duration", "interval"), LASTING)
def test_the_last_sample_is_the_end_if_the_interval_divides_it(duration, interval):
    rig = FEW.replace(drive=ss.constant(1.0, duration))
    run = ss.simulate(rig, output=ss.Output(interval=interval))
    count = math.floor(duration / interval + 1e-9)
    assert run.sizes["time"] == count + 1
    np.testing.assert_allclose(run["time"], interval * np.arange(count + 1), rtol=1e-15)
    assert run["time"][-1] <= duration
    assert np.all(np.isfinite(run["displacement"]))


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.eq(11)
def test_books_balance_and_what_is_recorded_changes_no_bit(name):
    """Work of the drive = kinetic + spring + contacts + damped + broken."""
    rig = MOTIONS[name]
    # Powers of two divide exactly: sample times agree to the last bit.
    coarse = 2.0 ** math.floor(math.log2(rig.drive.duration / 20))
    times = tuple(rig.drive.duration * share for share in (0.0, 0.123, 0.5, 0.777))
    few = ss.simulate(rig, output=ss.Output(interval=coarse))
    many = ss.simulate(rig, output=ss.Output(interval=coarse / 256, snapshots=times))
    common = many.isel(time=slice(None, None, 256))
    np.testing.assert_array_equal(common["time"], few["time"])
    for variable in few.data_vars:
        np.testing.assert_array_equal(common[variable], few[variable], err_msg=variable)

    assert imbalance(many) < 1e-9
    assert np.all(np.diff(many["broken_energy"]) >= 0)
    least = -1e-15 * float(many["damped_energy"][-1])
    assert np.all(np.diff(many["damped_energy"]) >= least)
    assert float(many["damped_energy"][-1]) > 0 or rig.slider.damping == 0


@pytest.mark.parametrize("count", [1, 17])
def test_equal_contacts_break_together(count):
    """All thresholds 1, all attached at 0, none re-attaches: the force is X up to 1."""
    initial = ss.Gaussian(mean=0, std=0)
    same = ss.Interface(thresholds=ONE, initial=initial, delay=ss.Delay(math.inf))
    rig = ss.Rig(same, FIG4_SLIDER, ss.constant(1.0, 3.0))
    run = ss.simulate(rig, method=ss.Contacts(count))
    X = run["displacement"].to_numpy()
    F = run["friction_force"].to_numpy()
    np.testing.assert_allclose(F, np.where(X < 1, X, 0.0), atol=1e-14)
    np.testing.assert_array_equal(run["attached"], np.where(X < 1, 1.0, 0.0))
    assert run["broken_energy"][-1] == pytest.approx(0.5, rel=1e-15)
    # Afterwards it lags behind the drive by the damping force over the stiffness.
    assert float(run["spring_force"][-1]) == pytest.approx(1e-4 * 200 * 1.0, rel=1e-9)


METHODS = ss.Contacts(40_000, seed=7), ss.MasterEquation()


@pytest.mark.parametrize("method", METHODS, ids=["contacts", "cohorts"])
@pytest.mark.eq(1, 4)
def test_in_smooth_sliding_stretchings_follow_the_steady_distribution(method):
    rig = FIG4.replace(interface=interface(0.05), stiffness=5.0)
    rig = rig.replace(drive=ss.constant(1.0, 2.0), method=method)
    output = ss.Output(interval=0.01, snapshots=(1.0, 2.0), bins=40)
    run = ss.simulate(rig, output=output, start=ss.FromSliding())
    attached = 1 / 1.05
    half = 0.5 * (run["x"][1] - run["x"][0])
    edges = np.append(run["x"] - half, run["x"][-1] + half)
    distribution = SteadyState(thresholds=TENTH)
    expected = attached * -np.diff(distribution.survival(edges))
    got = run["stretching_density"].to_numpy() * np.diff(edges)
    # Counts in a bin scatter binomially; the master equation has no scatter.
    slack = attached * distribution.density(0.0) / 400
    if isinstance(method, ss.Contacts):
        slack = 6 * np.sqrt(expected / method.count)
    assert np.all(np.abs(got - expected) <= slack + 1e-4)


def test_a_run_that_goes_on_is_the_run_that_its_provenance_makes():
    few = ss.Contacts(200, seed=3)
    first = record(FIG4.replace(drive=ss.constant(1.0, 2.0), method=few))
    run = first.longer(5.0).dataset()
    assert float(run.time[-1]) == pytest.approx(5.0, abs=float(run.time[1]))
    assert run.time[1] == first.dataset().time[1]
    assert ss.rerun(run).identical(run)
    assert first.longer(5.0).dataset().identical(run)  # the first run is unchanged


@pytest.mark.takes(3)
@pytest.mark.parametrize(
    "changes",
    [
        {"method": ss.Contacts(200_000), "drive": ss.constant(1.0, 3.0)},
        {"drive": Drive(ss.constant(1.0, 0.01).pieces * 400)},
        {"damping": 1e5, "method": ss.Contacts(5_000), "drive": ss.constant(1.0, 60.0)},
    ],
    ids=["many contacts", "many pieces", "a slider that creeps"],
)
def test_how_much_more_time_a_run_takes_is_told(changes):
    """On any machine: CPU time over that of a usual run."""

    def told_and_taken(rig):
        taken = []
        for _ in range(2):
            begun = time.process_time()
            record(rig)
            taken.append(time.process_time() - begun)
        return estimate(rig).seconds, min(taken)

    usual = FIG4.replace(method=ss.Contacts(10_000), drive=ss.constant(1.0, 20.0))
    ratios = np.divide(told_and_taken(FIG4.replace(**changes)), told_and_taken(usual))
    told, taken = ratios
    assert told / 3.0 < taken < 3.0 * told
