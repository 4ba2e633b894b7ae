"""One door to the solvers: conservation, exactness, the numbers of the paper's figures, repeatability, bad input."""

import json
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
import reference
import xarray as xr

from stickslip.errors import InputError
from stickslip.io import datasets as store
from stickslip.model import (
    Bell,
    Contacts,
    Delay,
    FromRest,
    FromSliding,
    Interface,
    LogarithmicGrowth,
    MasterEquation,
    Output,
    Parabolic,
    Population,
    RandomDelay,
    Rig,
    Slider,
)
from stickslip.model.distributions import Exponential, Gaussian, SteadyState
from stickslip.model.drive import ForceBelow, Travel, constant, ramp
from stickslip.simulation import LABELS, rerun, simulate
from stickslip.simulation.engines import (
    MOTION,
    Advance,
    Engine,
    Stretchings,
    base,
    slider_constants,
    solves,
)
from stickslip.simulation.engines.base import looks_aside
from stickslip.simulation.engines.steps import has_stopped

NARROW = Gaussian(mean=0.0, std=0.01)
TENTH = Gaussian(mean=1.0, std=0.1)
FIG4_SLIDER = Slider(stiffness=2.0, mass=1e-4, damping=200.0)


def interface(delay=0.2, thresholds=TENTH, initial=NARROW):
    return Interface(
        thresholds=thresholds, initial=initial, delay=Delay(delay) if isinstance(delay, (int, float)) else delay
    )


def energies(run: xr.Dataset) -> np.ndarray:
    """What the drive has paid for and where it is, per contact; constant if the balance closes."""
    parts = ("kinetic_energy", "spring_energy", "contact_energy", "damped_energy", "broken_energy")
    return sum(run[part].to_numpy() for part in parts) - run["work"].to_numpy()


def imbalance(run: xr.Dataset) -> float:
    """Largest departure of the energy balance, relative to the energy that has gone through."""
    through = max(float(np.abs(run["work"]).max()), float(run["broken_energy"][-1] + run["damped_energy"][-1]))
    total = energies(run)
    return float(np.max(np.abs(total - total[0]))) / through


@dataclass(frozen=True)
class Case:
    """A rig and what pulls it."""

    interface: Interface
    slider: Slider
    drive: object
    count: int = 1_000


FIG4 = Case(interface(), FIG4_SLIDER, constant(1.0, duration=6))
MOTIONS = {
    "stick-slip": FIG4,
    "no delay": replace(FIG4, interface=interface(0.0)),
    "never back": replace(FIG4, interface=interface(math.inf)),
    "one contact": replace(FIG4, count=1, drive=constant(1.0, duration=30)),
    "soft": replace(FIG4, slider=replace(FIG4_SLIDER, stiffness=0.01), drive=constant(1.0, duration=100)),
    "stiff": replace(FIG4, slider=replace(FIG4_SLIDER, stiffness=1e4)),
    "undamped": replace(FIG4, slider=replace(FIG4_SLIDER, damping=0.0)),
    "heavy and undamped": replace(FIG4, slider=Slider(stiffness=2.0, mass=1.0, damping=0.0), drive=constant(1.0, 40)),
    "overdamped": replace(FIG4, slider=replace(FIG4_SLIDER, damping=1e5), drive=constant(1.0, duration=20)),
    "light": replace(FIG4, slider=Slider(stiffness=2.0, mass=1e-8, damping=1e4), count=100, drive=constant(1.0, 3)),
    "slow": replace(FIG4, drive=constant(1e-3, duration=3_000), count=100),
    "fast": replace(FIG4, drive=constant(100.0, duration=1)),
    "ramp": replace(FIG4, drive=ramp(0.1, 3.0, duration=6)),
    "to and fro": replace(FIG4, drive=constant(1, 2).then(constant(-2, 2)).then(constant(0, 0.5)).then(constant(3, 1))),
    "released": replace(
        FIG4, interface=interface(initial=Gaussian(mean=0.6, std=0.05)), drive=constant(0.0, duration=2)
    ),
    "wide start": replace(FIG4, interface=interface(initial=Gaussian(mean=0.0, std=0.25))),
    "random delay": replace(FIG4, interface=interface(RandomDelay(mean=0.2, std=0.12, negative="redraw"))),
}


def run_of(case: Case, method=None, **options) -> xr.Dataset:
    return simulate(
        Rig(case.interface, case.slider, case.drive), method=method or Contacts(case.count, seed=1), **options
    )


# ------------------------------------------------------------------------------------------------ the result


def test_the_result_is_labelled():
    run = run_of(FIG4, output=Output(interval=0.01, snapshots=(1.0, 2.0), bins=50))
    energies = {"work", "kinetic_energy", "spring_energy", "contact_energy", "damped_energy", "broken_energy"}
    of_motion = {"displacement", "velocity", "spring_force", "friction_force", "attached", "drive_velocity"}
    assert set(run.data_vars) == of_motion | energies | {"stretching_density"} < set(LABELS)
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
    run = run_of(MOTIONS["ramp"])
    slider = FIG4_SLIDER
    t = run["time"].to_numpy()
    position = 0.1 * t + 0.5 * (2.9 / 6) * t**2
    np.testing.assert_allclose(run["spring_force"], slider.stiffness * (position - run["displacement"]), atol=1e-13)
    np.testing.assert_allclose(run["drive_velocity"], 0.1 + 2.9 / 6 * t, rtol=1e-14)
    np.testing.assert_allclose(run["kinetic_energy"], 0.5 * slider.mass * run["velocity"] ** 2, rtol=1e-14)
    np.testing.assert_allclose(run["spring_energy"], 0.5 * run["spring_force"] ** 2 / slider.stiffness, rtol=1e-14)
    assert run["displacement"][0] == 0
    assert run["work"][0] == run["damped_energy"][0] == run["broken_energy"][0] == 0


@pytest.mark.parametrize(("duration", "interval"), [(0.3, 0.1), (0.7, 0.1), (2.0, 0.3), (1 / 3, 1 / 300), (1e-3, 1e-4)])
def test_the_last_sample_is_the_end_if_the_interval_divides_it(duration, interval):
    run = run_of(replace(FIG4, drive=constant(1.0, duration), count=10), output=Output(interval=interval))
    count = math.floor(duration / interval + 1e-9)
    assert run.sizes["time"] == count + 1
    np.testing.assert_allclose(run["time"], interval * np.arange(count + 1), rtol=1e-15)
    assert run["time"][-1] <= duration
    assert np.all(np.isfinite(run["displacement"]))


def test_the_default_interval_resolves_the_oscillation():
    run = run_of(replace(FIG4, drive=constant(1.0, 1.0)))
    step = float(run["time"][1])
    assert step * math.sqrt(3.0 / 1e-4) <= 0.1
    assert run["time"][-1] == 1.0


# ------------------------------------------------------------------------------------------------ conservation


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.eq(11)
def test_books_balance_and_what_is_recorded_changes_no_bit(name):
    """Work of the drive = kinetic + spring + stored in contacts + damped + lost by the contacts, in every regime."""
    case = MOTIONS[name]
    # Powers of two divide exactly, so that sample times agree to the last bit.
    coarse = 2.0 ** math.floor(math.log2(case.drive.duration / 20))
    times = tuple(case.drive.duration * share for share in (0.0, 0.123, 0.5, 0.777))
    few = run_of(case, output=Output(interval=coarse))
    many = run_of(case, output=Output(interval=coarse / 256, snapshots=times))
    common = many.isel(time=slice(None, None, 256))
    np.testing.assert_array_equal(common["time"], few["time"])
    for variable in few.data_vars:
        np.testing.assert_array_equal(common[variable], few[variable], err_msg=variable)

    assert imbalance(many) < 1e-9
    assert np.all(np.diff(many["broken_energy"]) >= 0)
    assert np.all(np.diff(many["damped_energy"]) >= -1e-15 * float(many["damped_energy"][-1]))
    assert float(many["damped_energy"][-1]) > 0 or case.slider.damping == 0

    attached = many["attached"].to_numpy() * case.count
    np.testing.assert_allclose(attached, np.round(attached), atol=1e-9)
    assert 0 <= attached.min() <= attached.max() <= case.count
    if name == "no delay":
        assert np.all(attached == case.count)
    if name == "never back":
        assert np.all(np.diff(attached) <= 0)
        assert attached[-1] == 0


def test_seeds_differ_beyond_the_digits_of_a_float():
    case = replace(FIG4, count=50, drive=constant(1.0, 1.5))
    first, other = (run_of(case, Contacts(50, seed=2**60 + i)) for i in (0, 1))
    assert not np.array_equal(first["displacement"], other["displacement"])


# ------------------------------------------------------------------------------------------------ exact answers


@pytest.mark.parametrize("count", [1, 17])
def test_equal_contacts_break_together(count):
    """All thresholds 1, all born at 0, none comes back: the force is X up to X = 1 and 0 beyond."""
    same = Interface(thresholds=Gaussian(mean=1, std=0), initial=Gaussian(mean=0, std=0), delay=Delay(math.inf))
    run = simulate(Rig(same, FIG4_SLIDER, constant(1.0, 3.0)), method=Contacts(count))
    X, F = run["displacement"].to_numpy(), run["friction_force"].to_numpy()
    np.testing.assert_allclose(F, np.where(X < 1, X, 0.0), atol=1e-14)
    np.testing.assert_array_equal(run["attached"], np.where(X < 1, 1.0, 0.0))
    assert run["broken_energy"][-1] == pytest.approx(0.5, rel=1e-15)
    # Afterwards it follows the drive at the distance that drags against the damping.
    assert float(run["spring_force"][-1]) == pytest.approx(1e-4 * 200 * 1.0, rel=1e-9)


# ------------------------------------------------------------------------------------------------ the drive


# ------------------------------------------------------------------------------------------------ snapshots


@pytest.mark.parametrize(
    "temperature", [None, Bell(width=0.01, attempts=1e6), Parabolic(temperature=0.01, attempts=1e6)], ids=str
)
def test_snapshots_of_few_contacts_are_of_their_moment(temperature):
    """Of six contacts, each that breaks or attaches between the moment and the look would show."""
    interface = Interface(thresholds=Gaussian(mean=1.0, std=0.3), temperature=temperature, delay=Delay(0.3))
    times = tuple((0.1 * np.arange(3, 40)).tolist())
    output = Output(interval=0.1, snapshots=times, bins=400)
    run = simulate(Rig(interface, FIG4.slider, constant(1.0, 4.0)), method=Contacts(6, seed=2), output=output)
    width, seen = float(run["x"][1] - run["x"][0]), run.sel(time=run["snapshot"], method="nearest")
    assert len(np.unique(seen["attached"])) > 3
    np.testing.assert_allclose(run["stretching_density"].sum("x") * width, seen["attached"])
    mean = (run["stretching_density"] * run["x"]).sum("x") * width
    np.testing.assert_allclose(mean, seen["friction_force"], atol=0.5001 * width)  # each in the middle of its bin


@pytest.mark.parametrize("method", [Contacts(100), MasterEquation(rtol=1e-3)], ids=["contacts", "cohorts"])
def test_a_snapshot_at_the_end_of_the_drive_is_taken(method):
    run = run_of(
        replace(FIG4, drive=constant(1.0, 1.0)), method, output=Output(interval=0.1, snapshots=(0.5, 1.0, 1.0))
    )
    assert run["snapshot"].values.tolist() == [0.5, 1.0, 1.0]
    held = run["stretching_density"].sum("x") * (run["x"][1] - run["x"][0])
    np.testing.assert_allclose(held[1:], float(run["attached"][-1]), atol=1e-3)


@pytest.mark.parametrize("method", [Contacts(40_000, seed=7), MasterEquation()], ids=["contacts", "cohorts"])
@pytest.mark.eq(1, 4)
def test_in_smooth_sliding_stretchings_follow_the_steady_distribution(method):
    case = Case(interface(0.05), replace(FIG4_SLIDER, stiffness=5.0), constant(1.0, 2.0))
    run = run_of(case, method, output=Output(interval=0.01, snapshots=(1.0, 2.0), bins=40), start=FromSliding())
    attached = 1 / 1.05
    edges = np.append(run["x"] - 0.5 * (run["x"][1] - run["x"][0]), run["x"][-1] + 0.5 * (run["x"][1] - run["x"][0]))
    distribution = SteadyState(thresholds=TENTH)
    expected = attached * -np.diff(distribution.survival(edges))
    got = run["stretching_density"].to_numpy() * np.diff(edges)
    # Counts in a bin scatter as a binomial number's; the master equation has no scatter.
    n = method.count if isinstance(method, Contacts) else np.inf
    slack = 6 * np.sqrt(expected / n) if math.isfinite(n) else attached * distribution.density(0.0) / 400
    assert np.all(np.abs(got - expected) <= slack + 1e-4)


# ------------------------------------------------------------------------------------------------ the paper's figures

BOTH = pytest.mark.parametrize("method", [Contacts(10_000, seed=1), MasterEquation()], ids=["contacts", "cohorts"])


def fig4(stiffness, delay, method):
    """Fig. 4 of the paper: 100 time units from a narrow start."""
    return simulate(
        Rig(interface(delay), replace(FIG4_SLIDER, stiffness=stiffness), constant(1.0, 100.0)),
        method=method,
        output=Output(interval=0.002),
    )


def peak_to_peak(run, begin, end):
    force = run["spring_force"].sel(time=slice(begin, end))
    return float(force.max() - force.min())


def periods(run, begin, end):
    """Times between upward crossings of the middle of the force."""
    part = run.sel(time=slice(begin, end))
    F, t = part["spring_force"].to_numpy(), part["time"].to_numpy()
    middle = 0.5 * (F.max() + F.min())
    up = np.flatnonzero((F[:-1] < middle) & (F[1:] >= middle))
    return np.diff(t[up] + (middle - F[up]) / (F[up + 1] - F[up]) * (t[up + 1] - t[up]))


@BOTH
@pytest.mark.parametrize(("stiffness", "delay"), [(2.0, 0.0), (2.0, 0.085), (5.0, 0.1)])
@pytest.mark.eq(10, 11)
def test_fig4_smooth_sliding(method, stiffness, delay):
    run = fig4(stiffness, delay, method)
    assert peak_to_peak(run, 80, 100) < (0.05 if stiffness == 2.0 else 0.04)
    late = run.sel(time=slice(80, 100))
    expected = 1e-4 * 200 + 1.01 / (2 * (1 + delay))
    # Over a long time the noise of N contacts averages out further; N^(-1/2) of the force's standard deviation bounds
    # it.
    noise = 0.3 / math.sqrt(method.count) if isinstance(method, Contacts) else 2e-5
    assert float(late["spring_force"].mean()) == pytest.approx(expected, abs=noise)
    assert float(late["attached"].mean()) == pytest.approx(1 / (1 + delay), abs=noise)


@BOTH
def test_fig4_stick_slip_begins(method):
    assert peak_to_peak(fig4(2.0, 0.105, method), 80, 100) > 0.5


@BOTH
def test_fig4_stick_slip(method):
    run = fig4(2.0, 0.2, method)
    assert peak_to_peak(run, 80, 100) == pytest.approx(0.77, abs=0.02)
    times = periods(run, 70, 100)
    assert times.mean() == pytest.approx(reference.PERIOD, abs=0.010)
    assert times.std() < (0.02 if isinstance(method, Contacts) else 2e-3)  # strictly periodic
    assert float(run["velocity"].sel(time=slice(80, 100)).max()) == pytest.approx(13.0, abs=0.7)


@BOTH
def test_fig4_a_stiff_spring_decays_slowly(method):
    run = fig4(5.0, 0.2, method)
    assert peak_to_peak(run, 20, 40) > 2 * peak_to_peak(run, 40, 60)


@BOTH
def test_fig4_a_stiff_spring_and_a_long_delay(method):
    run = fig4(5.0, 0.3, method)
    assert 0.61 < peak_to_peak(run, 80, 100) < 0.66
    assert periods(run, 70, 100).mean() == pytest.approx(1.38, abs=0.01)
    assert float(run["velocity"].sel(time=slice(80, 100)).max()) < 3


@BOTH
@pytest.mark.eq(8, 11)
def test_fig5_the_elastic_instability(method):
    run = simulate(
        Rig(interface(math.inf), FIG4_SLIDER, constant(1.0, 3.0)), method=method, output=Output(interval=1 / 8192)
    )
    passes = float(np.interp(0.9247, run["displacement"], run["time"]))
    assert passes == pytest.approx(1.309, abs=0.004)
    assert float(run["velocity"].max()) == pytest.approx(14.4, abs=0.4)
    # The force that no contact holds any more: N^(-1/2) of the standard deviation of a contact's force.
    slack = 1e-3 if isinstance(method, MasterEquation) else 0.005
    assert float((run["spring_force"] - run["friction_force"]).max()) == pytest.approx(0.3155, abs=slack)


# ------------------------------------------------------------------------------------------------ again, and elsewhere


REPEATED = {
    "memoryless": (replace(FIG4, drive=constant(1.0, 1.5)), {"method": MasterEquation(rtol=1e-3, memoryless=True)}),
    "sliding": (FIG4, {"method": Contacts(300, seed=9), "start": FromSliding(perturbation=0.1)}),
    "output": (FIG4, {"method": Contacts(50), "output": Output(interval=0.07, snapshots=(2.0, 1 / 3), bins=9)}),
    "conditions": (
        replace(FIG4, drive=constant(1, 5).until(Travel(2)).then(ramp(1, 0, 2)).until(ForceBelow(0.1))),
        {"method": Contacts(100, seed=2)},
    ),
}


def test_every_distribution_balances_and_can_be_repeated(distribution, tmp_path):
    case = replace(FIG4, interface=interface(0.1, distribution), drive=constant(1, 4).then(constant(-1, 2)), count=100)
    run = run_of(case)
    assert imbalance(run) < 1e-9
    xr.testing.assert_identical(rerun(store.load(store.save(run, tmp_path / "run.nc"))), run)


def test_what_is_no_run_cannot_be_repeated():
    with pytest.raises(InputError, match="no provenance"):
        rerun(xr.Dataset())
    other = xr.Dataset(attrs={"provenance": store.provenance("sweep", {})})
    with pytest.raises(InputError, match="made by 'sweep', not by `simulate`"):
        rerun(other)


def test_progress_is_told_on_the_way():
    """100,000 contacts break and re-attach some six times each: more than a million events, half a second."""
    fractions = []
    case = replace(FIG4, count=100_000, drive=constant(1.0, 8.0))
    run_of(case, output=Output(interval=0.1), progress=fractions.append)
    assert len([fraction for fraction in fractions if 0 < fraction < 1]) >= 2


def test_what_progress_raises_comes_out():
    class StopError(Exception):
        pass

    def stop(_):
        raise StopError

    with pytest.raises(StopError):
        run_of(FIG4, progress=stop)


# ------------------------------------------------------------------------------------------------ a solver of one's own


class Follower(Engine):
    """A slider that follows the drive, with one contact that is stretched as far; from time 2 on it is lost."""

    columns = MOTION
    angle = 0.1

    def __init__(self, beginning, _):
        self.slider = slider_constants(beginning.slider)
        self.place = (0.0, 0.0)

    def here(self):
        return self.place

    def stretchings(self):
        return Stretchings(np.array([self.place[1]]), np.ones(1), cells=False)

    def advance(self, leg):
        before, times = self.copy(), np.append(leg.times[leg.times < leg.end], leg.end)
        X, V = leg.drive_position(times), leg.drive_velocity(times)
        rows = np.column_stack([np.where(times < 2.0, X, np.nan), V, X, np.ones_like(X)])[: leg.times.size]
        stopped = [i for i, row in enumerate(rows) if has_stopped(leg.stop, row[None, [0, 1, 2]])]
        end = stopped[0] if stopped else times.size - 1
        self.place = (float(times[end]), float(X[end]))
        return Advance(
            rows[: end + 1], looks_aside(before, leg, times[end]), over=bool(stopped) or times[end] == leg.end
        )


@pytest.fixture
def followed(monkeypatch):
    """A rig for which there is no solver, until one is registered."""
    rig = Rig(
        replace(interface(), ageing=LogarithmicGrowth(slope=0.1, time=1.0)),
        FIG4_SLIDER,
        constant(1.0, 9.0).until(Travel(0.5)).then(ramp(1.0, -1.0, 1.0)),
        method=Population(100),
        output=Output(interval=1 / 64, snapshots=(0.25, 0.75)),
    )
    with pytest.raises(InputError, match="not available with Population"):
        simulate(rig)
    monkeypatch.setattr(base, "ENGINES", dict(base.ENGINES))
    solves(Population, LogarithmicGrowth)(Follower)
    return rig


def test_a_solver_is_one_class_and_one_registration(followed):
    run = simulate(followed)
    t = run["time"].to_numpy()
    assert t[-1] == 1.5
    np.testing.assert_allclose(run["displacement"], np.where(t <= 0.5, t, 0.5 + (t - 0.5) - (t - 0.5) ** 2), atol=1e-14)
    np.testing.assert_array_equal(run["drive_velocity"], np.where(t <= 0.5, 1.0, 2.0 - 2.0 * t))
    np.testing.assert_allclose(run["spring_force"], 0.0, atol=1e-14)
    assert "work" not in run
    peaks = run["x"][run["stretching_density"].argmax("x")]
    np.testing.assert_allclose(peaks, run["displacement"].sel(time=run["snapshot"]), atol=float(np.diff(run["x"])[0]))


def test_numbers_that_are_not_finite_end_a_run_with_the_moment(followed):
    with pytest.raises(InputError, match=r"from t = 2 on the numbers of the run are not finite: .*drive of velocity 3"):
        simulate(replace(followed, drive=constant(1.0, 1.0).then(constant(3.0, 5.0))))


# ------------------------------------------------------------------------------------------------ bad input


GOOD = {
    "interface": interface(),
    "slider": FIG4_SLIDER,
    "drive": constant(1.0, 1.0),
    "method": Contacts(10),
    "output": Output(),
    "start": FromRest(),
}


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"interface": TENTH}, r"^Rig\.interface = .*: must be an Interface"),
        ({"slider": None}, r"^Rig\.slider = None: must be a Slider"),
        ({"drive": 1.0}, r"^Rig\.drive = 1\.0: must be a drive, made with constant\(\) or ramp\(\)"),
        ({"method": "contacts"}, r"^Rig\.method = 'contacts': must be Contacts\(\.\.\.\) or MasterEquation"),
        ({"output": 0.1}, r"^Rig\.output = 0\.1: must be an Output"),
        ({"start": "sliding"}, r"^Rig\.start = 'sliding': must be FromRest\(\), FromSliding\(\) or Prestressed"),
        ({"slider": replace(FIG4_SLIDER, mass=0)}, r"^Slider\.mass = 0: a simulation needs a mass above 0"),
        ({"output": Output(snapshots=(2.0,))}, r"^Output\.snapshots: 2 lies beyond the end of the drive \(1\)"),
        (
            {"start": FromSliding(), "drive": constant(0.0, 1.0)},
            r"^FromSliding: the drive starts at velocity 0: .* above 0",
        ),
        ({"start": FromSliding(), "interface": interface(math.inf)}, r"^FromSliding: contacts that never re-attach"),
        (
            {"interface": interface(thresholds=Gaussian(mean=1, std=0)), "method": MasterEquation()},
            r"^Gaussian\.std = 0: .* or use the method Contacts",
        ),
    ],
)
def test_bad_arguments(bad, message):
    with pytest.raises(InputError, match=message):
        simulate(Rig(**(GOOD | bad)))


def test_more_samples_than_a_run_can_hold_are_refused_even_if_it_may_take_long():
    with pytest.raises(InputError, match=r"^Output\.interval = 1e-09: 1e\+09 samples; choose at least 2e-08"):
        simulate(Rig(**(GOOD | {"output": Output(interval=1e-9)})), long=True)


def test_distributions_of_one_value_and_distributions_without_memory_run():
    for distribution in (Gaussian(mean=1, std=0), Exponential(mean=1.0)):
        run = run_of(replace(FIG4, interface=interface(0.1, distribution), count=50))
        assert np.all(np.isfinite(run["spring_force"]))
