"""Elastic sliders, against closed forms, rigid runs and each other."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from benches import bar, imbalance, pushed
from refusals import refused
from test_output_texts import BAR

import stickslip as ss
from stickslip.io import rig_files
from stickslip.model import Sheet

TENTH = ss.Gaussian(mean=1.0, std=0.1)


# ---------------------------------------- fronts against the exact speed on the lattice


@pytest.mark.parametrize(
    ("groups", "tau"),
    [
        # stiff contacts, nearly Amontons-Coulomb
        ({"kappa": 100, "sliding": 0.425}, 0.7),
        ({"kappa": 1}, 0.9),  # soft contacts, no leaf springs: faster than sound
        ({"kappa": 1, "zeta": 0.3162}, 0.5),  # dashpots in the bulk
        # leaf springs and damping: slower than sound
        ({"kappa": 0.25, "leaf": 0.05, "alpha": 0.3}, 0.6),
        ({"kappa": 0.04, "leaf": 0.01, "alpha": 0.2, "sliding": 0.425}, 0.5),
        ({"kappa": 0.01, "leaf": 0.0025, "alpha": 0.1}, 0.6),
    ],
)
def test_front_speed(groups: dict[str, float], tau: float) -> None:
    rig = bar(**groups)
    exact = float(ss.elastic.front_speed(rig, prestress=tau))
    stretching = tau + rig.interface.sliding_force * (1.0 - tau)
    rig = pushed(rig, stretching, 420.0 / min(exact, 1.0))
    run = ss.simulate(rig, output=ss.Output(interval=5.0))
    block = np.arange(240, 380)
    speed = np.polyfit(run.first_break.values[block], block, 1)[0]
    assert speed == pytest.approx(exact, rel=2e-4)
    assert imbalance(run) < 6e-6  # of all energy, which is up to fifteen times the work
    found = ss.measure.fronts(run)
    assert found.blocks.values.tolist() == [400]
    assert float(found.speed[300]) == pytest.approx(exact, rel=1e-2)


def test_a_prestress_below_the_threshold_of_fronts_stops_the_front() -> None:
    # of the coupling: Griffith's prestress is sqrt(K/(K + kappa)) = .41
    K = 0.05
    rig = pushed(bar(0.25, K, 0.3), 0.35, 400.0)
    run = ss.simulate(rig, output=ss.Output(interval=5.0))
    assert int(ss.measure.fronts(run).last_block[0]) < 20
    assert np.isnan(run.first_break[-1])


# ------------------------------------------------------------------------------- motion


def test_stuck_blocks_oscillate_as_springs_do() -> None:
    start = ss.Prestressed(stretching=0.0, push=0.1, pushed_blocks=5)
    rig = bar(1 / 3.0, leaf=0.5 / 3.0, blocks=5, mass=2.0)
    run = ss.simulate(pushed(rig, 0.0, 20.0), start=start)
    exact = 0.1 / 1.5 * (1.0 - np.cos(math.sqrt(1.5 / 2.0) * run.time))
    assert np.abs(run.displacement[:, 2] - exact).max() < 1e-4


@pytest.mark.parametrize(
    ("springs", "grows"),
    [
        ({"coupling": 40.0, "side": 40.0}, True),
        ({"coupling": 400.0, "side": 40.0}, False),
        ({"coupling": 40.0, "leaf": 1.0}, True),
        ({"coupling": 40.0, "leaf": 8.0}, False),
    ],
)
def test_blocks_slide_smoothly_where_all_modes_decay(
    springs: dict[str, float], grows: bool
) -> None:
    """Where a mode grows, some blocks turn back."""
    chain = ss.Chain(blocks=8, mass=1e-4, damping=42.426, **springs)
    interface = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.1))
    drive = ss.constant(1.5, duration=40.0)
    rig = ss.Rig(interface, chain, drive, method=ss.Contacts(200, seed=1))
    rig = rig.replace(start=ss.FromSliding(), output=ss.Output(interval=2e-2))
    assert (float(ss.elastic.modes(rig).growth[0]) > 0) == grows
    velocity = ss.simulate(rig, long=True).velocity.sel(time=slice(20.0, None))
    # The noise of the contacts moves the blocks by .16 about the velocity of 1.5.
    assert (float(velocity.min()) < 0) == grows


def test_rows_of_a_sheet_that_move_alike_are_chains() -> None:
    rig = pushed(bar(0.25, leaf=0.05, alpha=0.1, sliding=0.3, blocks=60), 0.8, 80.0)
    body = {"along": 60, "across": 3, "coupling": 4.0, "shear": 1.5, "mass": 4.0}
    sheet = Sheet(**body, damping=0.1, leaf=0.2)
    one, three = (ss.simulate(rig.replace(slider=body)) for body in (rig.slider, sheet))
    # The wider body has a higher bound on its frequencies, hence shorter steps.
    late = three.first_break.values.reshape(3, 60) - one.first_break.values
    assert np.abs(late).max() < 0.02
    assert three.across.values.reshape(3, 60)[2, 5] == 2
    assert ss.measure.events(three).sizes["event"] == 1


# -------------------------------------------------------------- in balance all the time


def precursors(method: object) -> ss.Rig:
    rig = bar(0.25, alpha=0.1, sliding=0.425, blocks=50, mass=1.0, side=4.0)
    start = ss.Prestressed(stretching=0.0)
    rig = rig.replace(drive=ss.constant(2e-3, duration=8e4), method=method)
    return rig.replace(start=start, output=ss.Output(interval=20.0))


def test_quasi_static_forces_of_precursors_are_exact() -> None:
    rig = precursors(ss.QuasiStatic(100, seed=1))
    run = ss.simulate(rig, long=True)
    exact = ss.elastic.precursor_force(rig).values
    assert np.abs(run.first_break_force.values - exact)[:48].max() < 1e-10
    largest = float(run.first_break_force.max()) / 50
    assert largest == pytest.approx(0.4443275862, abs=1e-10)
    assert int(np.argmax(run.first_break_force.values)) == 47


@pytest.mark.slow
def test_slow_dynamics_agree_with_balance() -> None:
    methods = (ss.QuasiStatic(100, seed=1), ss.Contacts(100, seed=1))
    still, moving = (ss.simulate(precursors(method), long=True) for method in methods)
    ratio = moving.first_break_force / still.first_break_force
    assert np.abs(ratio - 1.0)[:47].max() < 7e-3
    ratio = moving.spring_force.max() / still.spring_force.max()
    assert float(ratio) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("ends", ["free", "periodic"])
def test_balance_with_re_attachment_and_a_drive_that_turns(ends) -> None:
    delay = ss.RandomDelay(mean=100.0, std=30.0, negative="redraw")
    chain = {"blocks": 30, "mass": 1.0, "side": 4.0, "ends": ends}
    rig = bar(0.25, 0.025, 0.1, std=0.05, sliding=0.425, delay=delay, **chain)
    back = ss.ramp(2e-3, -2e-3, duration=4e3).then(ss.constant(0.0, 300.0))
    drive = ss.constant(2e-3, duration=1.5e4).then(back)
    run = ss.simulate(rig.replace(drive=drive, method=ss.QuasiStatic(50, seed=1)))
    # All forces balance at the end: the springs carry the friction.
    friction = float(run.friction_force[-1].sum())
    assert float(run.spring_force[-1]) == pytest.approx(friction, abs=1e-9)
    # At rest for longer than any delay, all contacts are attached.
    assert float(run.attached[-1].min()) == 1.0


def test_detached_contacts_stick_again_when_the_drive_turns() -> None:
    """Until then they carry the sliding force, and are as stiff as attached ones."""
    drive = ss.constant(1.0, duration=1.5).then(ss.constant(-1.0, duration=0.2))
    rig = bar(1 / 3.0, std=0.2, sliding=0.4, blocks=2).replace(drive=drive, leaf=2.0)
    method = ss.QuasiStatic(100, seed=1)
    run = ss.simulate(rig, method=method, output=ss.Output(interval=0.01))
    back = run.sel(time=slice(1.5, None))
    assert 0.03 < float(back.attached.min()) <= float(back.attached.max()) < 0.1
    moved = np.diff(back.displacement, axis=0)
    assert moved == pytest.approx(-0.01 * 2.0 / 3.0, rel=1e-9)


def test_events_do_not_depend_on_how_finely_they_are_sampled() -> None:
    """Between two near samples a slipping block may break no contact."""
    chain = {"blocks": 20, "mass": 1.0, "side": 4.0, "delay": ss.Delay(5.0)}
    rig = bar(0.25, 0.025, 0.1, std=0.2, sliding=0.4, **chain)
    drive = ss.constant(5e-3, duration=1320.0)
    rig = rig.replace(drive=drive, method=ss.Contacts(50, seed=1))
    outputs = ss.Output(interval=0.5), ss.Output(interval=0.05)
    runs = (ss.simulate(rig, output=output, long=True) for output in outputs)
    some, many = (ss.measure.events(run) for run in runs)
    assert some.sizes["event"] == many.sizes["event"] == 1
    assert float(many.moment[0]) == pytest.approx(float(some.moment[0]), rel=0.05)
    assert abs(int(many.blocks[0]) - int(some.blocks[0])) <= 1
    speed = pytest.approx(float(some.front_speed[0]), rel=0.1)
    assert float(many.front_speed[0]) == speed


# ----------------------------------------------------------------- runs as all runs are


def small(**changes: object) -> ss.Rig:
    delay = ss.RandomDelay(mean=0.2, std=0.05)
    interface = ss.Interface(thresholds=TENTH, delay=delay, sliding_force=0.2)
    body = {"blocks": 6, "coupling": 20.0, "mass": 1e-4, "damping": 42.4}
    bar = ss.Chain(**body, viscosity=1e-4, leaf=2.0)
    rig = ss.Rig(interface, bar, ss.constant(1.0, duration=4.0))
    rig = rig.replace(method=ss.Contacts(50, seed=1), output=ss.Output(interval=1e-2))
    return rig.replace(**changes)


def test_draws_of_a_block_do_not_depend_on_how_many_there_are() -> None:
    chain = ss.Chain(blocks=3, coupling=1e-12, mass=1e-4, damping=42.4, leaf=2.0)
    chains = chain, replace(chain, blocks=7)
    few, many = (ss.simulate(small(slider=body)) for body in chains)
    assert (few.friction_force[0] == many.friction_force[0, :3]).all()
    assert (few.broken[-1] == many.broken[-1, :3]).all()
    assert np.abs(few.displacement - many.displacement[:, :3]).max() < 1e-8


def test_a_run_has_dimensions_units_and_sums() -> None:
    run = ss.simulate(small())
    assert run.displacement.dims == ("time", "block")
    assert run.first_break.dims == ("block",)
    assert all({"units", "long_name"} <= set(run[name].attrs) for name in run.variables)
    pulled = 2.0 * (run.time - run.displacement)  # the drive has gone 1 * time
    assert np.abs(run.spring_force - pulled.sum("block")).max() < 1e-9
    pulling = run.pulling_force.sum("pulled").values
    assert pulling == pytest.approx(run.spring_force.values, abs=1e-12)
    assert float(run.attached.max()) == 1.0


@pytest.mark.parametrize(
    ("start", "place"),
    [
        ({"pushed_blocks": 7}, "pushed_blocks = 7: must be at most 6"),
        ({"pushed_blocks": 1e30}, r"pushed_blocks = 10+\d+: must be at most 6"),
        ({"stretching": (0.1,) * 5}, "stretching: has 5 numbers for 6 blocks"),
    ],
)
def test_a_start_that_no_run_could_take_is_refused_with_the_rig(
    start: dict[str, Any], place: str
) -> None:
    prestress = ss.Prestressed(**({"stretching": 0.1} | start))
    with pytest.raises(ss.InputError, match=f"^Prestressed.{place}"):
        small().replace(start=prestress)
    document = rig_files.to_document(small())
    document["simulation"]["start"] = {"stretching": 0.1}
    written = document["simulation"]["start"]
    for key, value in start.items():
        written[key] = list(value) if isinstance(value, tuple) else int(value)
    with pytest.raises(ss.InputError, match=r"^rig: simulation\.start\."):
        ss.read_rig(document)


BODY = ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)
RIGID = ss.Rig(ss.Interface(thresholds=TENTH), BODY, ss.constant(1.0))
SHEET = Sheet(
    along=3, across=2, coupling=1.0, shear=1.0, mass=1.0, damping=0.0, leaf=1.0
)
BACKWARDS = ss.Prestressed(stretching=(0.5,) * 5 + (-1e6,))
REFUSED = (
    lambda: small(start=ss.Prestressed(stretching=2.0)),
    lambda: small(start=BACKWARDS),
    lambda: ss.predict(small(start=ss.Prestressed(stretching=1e6))),
    lambda: ss.predict(small(start=BACKWARDS)),
    "^Prestressed.stretching: .*not below the thresholds.*; give less",
    lambda: small(start=ss.FromSliding(perturbation=(0.1, 0.2))),
    "2 numbers for 6 blocks",
    lambda: small(slider=ss.Chain(blocks=6, coupling=1.0, mass=1e-4, damping=0.0)),
    "nothing pulls it",
    lambda: RIGID.replace(start=ss.Prestressed(stretching=0.5)),
    lambda: RIGID.replace(start=ss.FromSliding(perturbation=(0.1, 0.2))),
    lambda: RIGID.replace(start=ss.FromSliding(at_rest=1)),
    "is for an elastic slider",
    lambda: small(start=ss.FromSliding(at_rest=7)),
    "FromSliding.at_rest = 7: there are 6 blocks",
    lambda: small(method=ss.MasterEquation()),
    "^method = .*: is not for a Chain; use Contacts or QuasiStatic$",
    lambda: RIGID.replace(method=ss.QuasiStatic()),
    "is not for a Slider; use Contacts or",
    lambda: small(slider=SHEET, method=ss.QuasiStatic()),
    "QuasiStatic: is for a Chain",
)


@refused(*REFUSED)
def test_bad_input_is_told_in_one_line(call, message) -> None:
    with pytest.raises(ss.InputError, match=message) as caught:
        ss.simulate(call())
    assert "\n" not in str(caught.value)


# ---------------------------------------------------------------------------- rig files


PLATE = """
[sheet]
along = 8
across = 3
spacing = "2.5 mm"
width = "5 mm"
height = "10 mm"
youngs_modulus = "3 GPa"
shear_modulus = "1.1 GPa"
density = "1180 kg/m^3"
leaf = "4 MN/m"
damping = "1000 1/s"
[interface]
contact_strength = "240 N"
breaking_displacement = "1 um"
thresholds = { distribution = "gaussian", std = 0.05 }
delay = "never"
[drive]
velocity = "0 m/s"
duration = "0.2 ms"
[simulation]
contacts = 20
start = { stretching = [{ blocks = 8, stretching = 0.8 }, { blocks = 16, stretching = 0.4 }], push = "20 N" }
"""  # noqa: E501
BAR_OF_BLOCKS = {"coupling": 3e9 * 5e-3 * 50e-3 / 5e-3, "side": 4e6}
BAR_OF_BLOCKS["leaf"] = 1.1e9 * 5e-3 * 5e-3 / 50e-3
PLATE_OF_BLOCKS = {"coupling": 3e9 * 5e-3 * 10e-3 / 2.5e-3, "leaf": 4e6}
PLATE_OF_BLOCKS["shear"] = 1.1e9 * 10e-3 * 2.5e-3 / 5e-3


@pytest.mark.parametrize(
    ("text", "contacts", "springs", "volume"),
    [
        (BAR, 768.0 / 20 / 1.17e-6, BAR_OF_BLOCKS, 5e-3 * 50e-3 * 5e-3),
        (PLATE, 240.0 / 24 / 1e-6, PLATE_OF_BLOCKS, 5e-3 * 10e-3 * 2.5e-3),
    ],
    ids=["bar", "plate"],
)
def test_an_elastic_slider_in_si_units_becomes_blocks(text, contacts, springs, volume):
    """Written as a file, the blocks are read as the same slider."""
    rig = ss.read_rig(tomllib.loads(text))
    found = {name: getattr(rig.slider, name) * contacts for name in springs}
    assert found == pytest.approx(springs)
    assert rig.slider.mass * rig.unit("f_s time^2/x_s") == pytest.approx(1180 * volume)
    assert ss.read_rig(tomllib.loads(rig_files.to_toml(rig))) == rig


def test_runs_of_elastic_sliders_in_si_units() -> None:
    bar, plate = (ss.read_rig(tomllib.loads(text)) for text in (BAR, PLATE))
    assert bar.in_units(bar.slider.spacing, "length") == "5 mm"
    assert bar.interface.sliding_force == pytest.approx(0.425)
    run = ss.simulate(bar)
    assert run.spring_force.attrs["units"] == "N"
    assert 326.4 < float(run.spring_force.max()) < 768.0
    # The push is that on each block, whose contacts have 10 N together.
    stretching = (0.8,) * 8 + (0.4,) * 16
    start = ss.Prestressed(stretching=stretching, push=2.0, pushed_blocks=1)
    assert plate.start == start
    assert (plate.slider.along, plate.slider.across) == (8, 3)
    assert plate.method == ss.Contacts(20, seed=1)
    run = ss.simulate(plate)
    assert imbalance(run) < 6e-5
    assert float(run.broken[-1].max()) == 1.0


MISTAKEN = (
    lambda: BAR.replace('density = "1180 kg/m^3"', ""),
    "chain.density: is missing",
    lambda: BAR.replace("[chain]", '[slider]\nmass = "1 kg"\n[chain]'),
    "give slider or chain or sheet, not both",
    lambda: PLATE.replace("along = 8", ""),
    "sheet.along: is missing; write, for example, sheet.along = 60",
    lambda: PLATE.replace("blocks = 16", "blocks = 15"),
    "start.stretching = .*: is of 23 blocks, but there are 24; give one",
    lambda: PLATE.replace('push = "20 N"', "push = 20"),
    "simulation.start.push = 20: has no unit",
    lambda: PLATE.replace("[sheet]", "[sheets]"),
    "sheets: unknown key; did you mean 'sheet'?",
    lambda: BRAKE.replace('start = "from rest"', "start = { stretching = 0.5 }"),
    "start = {.*}: must be 'from rest' or 'sliding'; a table is for chain or sheet",
)
BRAKE = rig_files.to_toml(ss.example("brake_pad"))


@refused(*MISTAKEN)
def test_mistakes_in_a_file_are_told(call, message) -> None:
    with pytest.raises(ss.InputError, match=message) as caught:
        ss.read_rig(tomllib.loads(call()))
    assert "\n" not in str(caught.value)


DELAYS = ss.Delay(0.3), ss.RandomDelay(mean=0.3, std=0.1), ss.Delay(0.01)


@pytest.mark.parametrize("thresholds", [ss.Exponential(0.8), ss.Gaussian(1.0, 0.3)])
@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("sliding_force", [0.0, 0.3])
def test_blocks_that_move_alike_are_a_rigid_slider(thresholds, delay, sliding_force):
    """Steps of leapfrog against panels, through a reversal: no line is shared."""
    fields = {"delay": delay, "sliding_force": sliding_force}
    interface = ss.Interface(thresholds=thresholds, **fields)
    back = ss.ramp(1.0, -1.0, 1.0).then(ss.constant(-1.0, 1.0))
    drive = ss.constant(1.0, 3.0).then(back)
    output = ss.Output(interval=0.05)
    slider = ss.Slider(stiffness=0.7, mass=0.05, damping=1.0)
    blocks = ss.Chain(blocks=2, coupling=5.0, mass=0.05, damping=1.0, leaf=0.7)
    count = 2_000
    rigid = ss.Rig(interface, slider, drive, method=ss.MasterEquation(), output=output)
    of_blocks = replace(rigid, slider=blocks, method=ss.Contacts(count, seed=1))
    one, two = ss.simulate(rigid), ss.simulate(of_blocks)
    # The force of a contact has a standard deviation below .65.
    error = 4.0 * 0.65 / math.sqrt(2 * count)
    for name in ("displacement", "friction_force", "attached"):
        assert np.abs(two[name].mean("block") - one[name]).max() < error
