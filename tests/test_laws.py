"""Laws that every solver obeys with every mechanism that it accepts, each stated once.

A pair is a method and an interface under a slider or a chain. The pairs follow from
what the engines declare to accept, so that a new engine, or a mechanism that an engine
newly accepts, must obey all laws at once.
"""

import math
import re
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from benches import imbalance
from mechanisms import CHAIN, MECHANISMS, METHODS, SLIDER, interface_with

import stickslip as ss
from stickslip.simulation import estimate
from stickslip.simulation.engines import engine_of


@dataclass(frozen=True)
class Pair:
    """A method and an interface that it accepts, under a slider or a chain."""

    method: object
    interface: ss.Interface
    body: object

    @property
    def one_by_one(self) -> bool:
        """Return whether contacts are followed one by one."""
        return isinstance(self.method, (ss.Contacts, ss.QuasiStatic))

    @property
    def accuracy(self) -> float:
        """Rounding for event-driven methods; else ten times the default tolerance."""
        is_rigid = self.body is SLIDER
        from_event_to_event = isinstance(self.method, ss.Contacts) and is_rigid
        return 1e-9 if from_event_to_event else 1e-3

    @property
    def draws_in_each_step(self) -> bool:
        """Whether other steps draw other numbers, of the same distribution."""
        noisy = self.one_by_one and isinstance(self.interface.ageing, ss.Langevin)
        return noisy or isinstance(self.method, ss.Population)


def _pairs() -> dict[str, Pair]:
    found = {}
    for body in (SLIDER, CHAIN):
        for mechanism, fields in MECHANISMS.items():
            interface = interface_with(fields)
            for name, method in METHODS.items():
                if isinstance(body, ss.Chain) and isinstance(method, ss.Contacts):
                    method = replace(method, count=20)
                try:
                    engine_of(interface, method, body)
                except ss.InputError:
                    continue
                label = f"{name}, {type(body).__name__}: {mechanism}"
                found[label] = Pair(method, interface, body)
    return found


NOISE = 0.65
"""Bound on the standard deviation of a contact's force: half of the threshold that one
in a thousand exceeds.
"""
STATISTICAL = (ss.Contacts, ss.Population, ss.QuasiStatic)
PAIRS = _pairs()
every_pair = pytest.mark.parametrize("name", PAIRS)
DRIVE = ss.constant(1.0, 1.6).then(ss.ramp(1.0, -1.0, 1.0))


def refusal(interface, method, body) -> str:
    try:
        engine_of(interface, method, body)
    except ss.InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("body", [SLIDER, CHAIN], ids=["Slider", "Chain"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_a_refusal_names_what_cannot_be_taken_together(mechanism, method, body):
    """The refusal does not name what the method would accept by itself."""
    fields = MECHANISMS[mechanism]
    method = METHODS[method]
    said = refusal(interface_with(fields), method, body)
    alone = {}
    for field in fields:
        interface = interface_with({field: fields[field]})
        alone[field] = refusal(interface, method, body)
    named = [field for field in fields if f"{field} = " in said]
    who, _, remedy = said.partition(": not available with ")[2].partition("; ")
    if "together with" in who:
        assert len(named) > 1
        assert not any(alone[field] for field in named)
    elif remedy:
        is_chain = body is CHAIN and not remedy.startswith("use ")
        assert who == ("a Chain" if is_chain else type(method).__name__)
        assert alone[named[0]]
    others = remedy.removeprefix("use ") if remedy.startswith("use ") else ""
    for other in set(re.findall(r"\w+", others)) - {"or"}:
        assert not refusal(interface_with(fields), METHODS[other], body)


def simulate(pair, drive=DRIVE, interval=0.05, **options) -> xr.Dataset:
    output = options.pop("output", ss.Output(interval=interval))
    options |= {"method": pair.method, "output": output}
    return ss.simulate(ss.Rig(pair.interface, pair.body, drive, **options))


def relaxed(pair) -> Pair:
    initial = ss.Gaussian(mean=0.0, std=0.0)
    return replace(pair, interface=replace(pair.interface, initial=initial))


def contacts_of(pair) -> int:
    return pair.method.count * (1 if pair.body is SLIDER else pair.body.size)


def has_steady_force(interface) -> bool:
    if math.isinf(interface.delay.moment(1)):
        return False
    try:
        ss.kinetic_friction(interface, 1.0)
    except ss.InputError:
        return False
    return True


@cache
def run_of(name) -> xr.Dataset:
    return simulate(PAIRS[name])


def apart(run, other, sign=1):
    """Largest difference of the forces of two runs."""
    names = "spring_force", "friction_force"
    return max(float(np.abs(run[name] - sign * other[name]).max()) for name in names)


# ---------------------------------------------------------------- conservation


@every_pair
@pytest.mark.eq(11)
def test_energy_is_kept(name):
    """The work of the drive equals the sum of energies, and losses never decrease."""
    pair = PAIRS[name]
    run = run_of(name)
    if "work" not in run:
        pytest.skip("this engine does not count energies")
    assert imbalance(run) < pair.accuracy
    if pair.interface.newborn is not None:  # stretched newborns add energy
        return
    for lost in ("broken_energy", "damped_energy"):
        least = -pair.accuracy * float(run[lost].max())
        assert float(run[lost].diff("time").min()) >= least


@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
def test_energy_is_kept_to_the_tolerance(rtol):
    for method in (ss.MasterEquation(rtol=rtol), ss.Population(10**9, rtol=rtol)):
        assert imbalance(simulate(Pair(method, interface_with({}), SLIDER))) < rtol


@every_pair
def test_contacts_are_counted(name):
    pair = PAIRS[name]
    attached = run_of(name)["attached"].to_numpy()
    assert -pair.accuracy <= attached.min() <= attached.max() <= 1 + 1e-12
    # other methods interpolate between their steps
    if isinstance(pair.method, ss.Contacts) and pair.body is SLIDER:
        whole = pair.method.count * attached
        np.testing.assert_allclose(whole, np.round(whole), atol=1e-9)


@every_pair
def test_snapshots_hold_the_attached_contacts_and_their_force(name):
    output = ss.Output(interval=0.1, snapshots=(0.5, 1.2), bins=400)
    run = simulate(PAIRS[name], output=output)
    width = float(run["x"][1] - run["x"][0])
    seen = run.sel(time=run["snapshot"], method="nearest")
    blocks = [dim for dim in seen["attached"].dims if dim != "snapshot"]
    held = width * run["stretching_density"].sum("x")
    pulled = width * (run["stretching_density"] * run["x"]).sum("x")
    detached = PAIRS[name].interface.sliding_force * (1 - seen["attached"])
    # A copy that looks ahead in other steps draws other numbers; a cohort stands for
    # stretchings near its own.
    noise = 0.0
    if PAIRS[name].draws_in_each_step:
        noise = 6 * NOISE / math.sqrt(contacts_of(PAIRS[name]))
    smooth = 0.0 if PAIRS[name].one_by_one and PAIRS[name].body is SLIDER else 5e-3
    attached = seen["attached"].mean(blocks)
    np.testing.assert_allclose(held, attached, rtol=0, atol=1e-9 + smooth + noise)
    # contacts of different areas are of different stiffness
    if PAIRS[name].interface.areas is None:
        friction = (seen["friction_force"] - detached).mean(blocks)
        np.testing.assert_allclose(pulled, friction, atol=width + noise)


# ---------------------------------------------------------------- the same run


@every_pair
def test_what_is_recorded_changes_nothing(name):
    fine = simulate(PAIRS[name], output=ss.Output(interval=0.025, snapshots=(0.7, 2.0)))
    pair = PAIRS[name]
    ages = isinstance(pair.interface.ageing, ss.Langevin)
    exact = isinstance(pair.method, ss.Contacts) and not ages
    same = fine.isel(time=slice(None, None, 2))
    assert apart(same, run_of(name)) <= (0.0 if exact else 1e-9)


@every_pair
def test_a_run_is_made_again_from_what_it_says(name):
    xr.testing.assert_identical(ss.rerun(run_of(name)), run_of(name))


# the quick suite takes the last of each method and body: files take most of the time
LAST = {name.partition(":")[0]: name for name in PAIRS}.values()
SLOW = {name: pytest.mark.slow for name in PAIRS if name not in LAST}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=SLOW.get(name, ())) for name in PAIRS]
)
def test_a_file_holds_a_run(name, tmp_path):
    run = run_of(name)
    xr.testing.assert_identical(ss.load(ss.save(run, tmp_path / "run.nc")), run)


@every_pair
def test_progress_rises_to_one(name):
    pair = PAIRS[name]
    seen = []
    rig = ss.Rig(pair.interface, pair.body, DRIVE, method=pair.method)
    ss.simulate(rig, progress=seen.append)
    assert seen == sorted(seen)
    assert 0 <= seen[0] <= seen[-1] == 1


@every_pair
def test_a_seam_between_equal_pieces_is_no_event(name):
    if PAIRS[name].draws_in_each_step:
        pytest.skip("other steps draw other numbers")
    cut = ss.constant(1.0, 0.9).then(ss.constant(1.0, 0.7))
    cut = cut.then(ss.ramp(1.0, -1.0, 1.0))
    moved = PAIRS[name].accuracy
    if PAIRS[name].one_by_one and PAIRS[name].body is CHAIN:
        # a contact may break before or after a sample
        moved += 1 / PAIRS[name].method.count
    assert apart(simulate(PAIRS[name], drive=cut), run_of(name)) < moved


@every_pair
def test_a_piece_ends_at_the_first_sample_where_its_condition_holds(name):
    force = 0.5 * float(run_of(name)["spring_force"].sel(time=slice(0.0, 1.6)).max())
    pulled = ss.constant(1.0, 1.6).until(ss.model.ForceAbove(force))
    back = ss.constant(-1.0, 3.0).until(ss.model.Travel(0.2))
    run = simulate(PAIRS[name], drive=pulled.then(back), interval=0.02)
    seam = int(np.flatnonzero(run["drive_velocity"] > 0)[-1])
    F = run["spring_force"].to_numpy()
    assert F[seam] >= force > F[:seam].max()
    blocks = {*run["displacement"].dims} - {"time"}
    X = run["displacement"].mean(blocks).to_numpy()
    far = np.abs(X[seam:] - X[seam])
    assert far[-1] >= 0.2 > far[:-1].max()


@every_pair
def test_backwards_is_the_mirror_image(name):
    pair = relaxed(PAIRS[name])
    back = simulate(pair, drive=ss.constant(-1.0, 1.6).then(ss.ramp(-1.0, 1.0, 1.0)))
    # Contacts with Bell's rate ahead of the slider share a clock, those behind have
    # another: other numbers of the same distribution.
    other_numbers = isinstance(pair.interface.activation, ss.Bell) and pair.one_by_one
    # Whether counted contacts that attach stretched are tried in the first step depends
    # on rounding.
    if isinstance(pair.method, ss.Population) and pair.interface.newborn is not None:
        ages = pair.interface.ageing is not None
        other_numbers = pair.interface.activation is not None or ages
    # Rounding may add a sweep to a step of the master equation: a thousandth of its
    # tolerance.
    by_tolerance = isinstance(pair.method, ss.MasterEquation)
    exact = 1e-3 * pair.method.rtol if by_tolerance else 1e-8
    most = 6 * NOISE / math.sqrt(pair.method.count) if other_numbers else exact
    assert apart(simulate(pair), back, sign=-1) < most


@every_pair
def test_relaxed_contacts_under_a_drive_at_rest_stay_there(name):
    run = simulate(relaxed(PAIRS[name]), drive=ss.constant(0.0, 1.0))
    newborn = PAIRS[name].interface.newborn is not None  # newborns may pull
    assert float(np.abs(run["displacement"]).max()) <= (1e-12 if newborn else 0.0)


def test_a_run_under_a_drive_at_rest_has_no_regime():
    pair = PAIRS["Population, Slider: delay"]
    run = simulate(pair, drive=ss.constant(0.0, 3.0), interval=0.01)
    assert ss.regime(run).reason == "the drive stands still"


# ----------------------------------------------------------- closed form, other solvers


def held_stiffly(pair) -> Pair:
    """On a spring and with a damping that prevent slips."""
    spring = {"stiffness": 40.0} if pair.body is SLIDER else {"leaf": 40.0}
    return replace(pair, body=replace(pair.body, damping=60.0, **spring))


@every_pair
@pytest.mark.eq(1, 10)
def test_smooth_sliding_goes_on_with_the_steady_force(name):
    pair = PAIRS[name]
    lifetimes = 8.0
    if not has_steady_force(pair.interface):
        pytest.skip("none in closed form")
    how = {"interval": 0.02, "start": ss.FromSliding()}
    run = simulate(held_stiffly(pair), drive=ss.constant(1.0, lifetimes), **how)
    error = 1e-4
    if isinstance(pair.method, STATISTICAL):  # independent after a life
        error = 4 * NOISE / math.sqrt(contacts_of(pair) * lifetimes)
    force = ss.kinetic_friction(pair.interface, 1.0)
    assert float(run["friction_force"].mean()) == pytest.approx(force, abs=error)


@every_pair
@pytest.mark.eq(1, 2, 3, 4)
def test_contacts_scatter_about_infinitely_many(name):
    """Forwards, backwards and at rest, without slips, in which differences grow."""
    pair = PAIRS[name]
    alike = name.replace("MasterEquation", "Contacts").replace("Population", "Contacts")
    if pair.one_by_one or alike not in PAIRS:
        pytest.skip("only one method takes it")
    seeds = 4
    count = 1_000 if pair.body is SLIDER else 100
    drive = ss.constant(1.0, 1.5).then(ss.constant(-1.0, 1.5))
    drive = drive.then(ss.constant(0.0, 0.5)).then(ss.constant(2.0, 0.5))
    held = held_stiffly(PAIRS[alike])
    methods = (ss.Contacts(count, seed=seed) for seed in range(seeds))
    runs = [replace(held, method=method) for method in methods]
    mean = sum(simulate(run, drive=drive) for run in runs) / seeds
    found = simulate(held_stiffly(pair), drive=drive)
    counted = isinstance(pair.method, ss.Population) / 2_000
    error = 4 * NOISE * math.sqrt(1 / (seeds * count) + counted)
    assert float(np.abs(found["friction_force"] - mean["friction_force"]).max()) < error


POPULATIONS = [name for name in PAIRS if name.startswith("Population")]
VARIABLES = "spring_force", "friction_force", "attached", "contact_energy"


@pytest.mark.parametrize("name", POPULATIONS)
def test_very_many_counted_contacts_are_infinitely_many(name):
    pair = PAIRS[name]
    exact = run_of(name.replace("Population", "MasterEquation"))
    for count, slack in ((10**9, 3e-4), (10**6, 3e-3)):
        run = simulate(replace(pair, method=ss.Population(count, seed=1)))
        for variable in (*VARIABLES, "broken_energy"):
            away = float(np.sqrt(((run[variable] - exact[variable]) ** 2).mean()))
            assert away < slack, (variable, count)


@every_pair
def test_the_work_of_a_run_is_estimated(name):
    pair = PAIRS[name]
    rig = ss.Rig(pair.interface, pair.body, DRIVE, method=pair.method)
    assert 0.0 < estimate(rig).seconds < math.inf
