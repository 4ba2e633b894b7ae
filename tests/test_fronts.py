"""Elastic sliders: fronts, precursors, modes of smooth sliding, and their pictures."""

import math
from dataclasses import replace

import numpy as np
import pytest
from benches import STILL, bar, pushed, springs_between
from drawn import assert_drawn, assert_kept
from refusals import refused
from scipy.optimize import brentq

import stickslip as ss
from stickslip import cli, elastic
from stickslip.io import rig_files
from stickslip.model.units import Scales


def speed(rig, prestress, **how):
    return float(elastic.front_speed(rig, prestress=prestress, **how))


# ---------------------------------------------------------------- fronts on a lattice

STIFF = 1e12  # stiffness of contacts over the bulk's: the limit of Amontons and Coulomb
SI = Scales(force=100.0, stretching=1e-6, time=0.01)
SPREAD_BY = {"kappa": 0.01, "leaf": 0.0025, "alpha": 0.1}


@pytest.mark.parametrize("kappa", [0.25, 4.0, STIFF])
@pytest.mark.parametrize("leaf", [0.0, 0.2])
@pytest.mark.parametrize("prestress", [0.5, 0.7, 0.95])
def test_fronts_faster_than_sound_without_losses(kappa, leaf, prestress):
    """Without losses the phase is a step at each of two roots, found separately."""

    def root(held, v):
        def loss(w):
            return held + 4 * math.sin(w / (2 * v)) ** 2 - w * w

        return brentq(loss, 1e-9, math.sqrt(held + 4) + 1e-9)

    def closed(v):
        light = 1 / math.sqrt(1 - 1 / v**2)
        behind = root(leaf, v) / math.sqrt(leaf) if leaf else light
        return root(leaf + kappa, v) / math.sqrt(leaf + kappa) / behind - prestress

    found = speed(bar(kappa, leaf), prestress)
    if closed(1.0 + 1e-9) > 0:
        assert found < 1.0
    else:
        expected = brentq(closed, 1.0 + 1e-9, 20.0, xtol=1e-13)
        assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("groups", "prestress", "expected"),
    [
        ((STIFF, 0.0, 0.0, 0.1), 0.5, 1.23576),
        ((1.0, 0.0, 0.0, 0.3162), 0.5, 1.14625),
        ((STIFF, 0.0, 0.3), 0.2, 0.80000),
        ((STIFF, 0.0, 3.0), 0.3, 0.18387),
        ((0.25, 0.05, 0.3), 0.6, 0.68641),
        ((0.04, 0.01, 0.2), 0.5, 0.18355),
        ((0.0025, 0.000625, 0.05), 0.8, 0.84412),
        # With a distribution of thresholds, at M eta^2 = 1.
        (SPREAD_BY | {"std": 0.01}, 0.6, 0.50000),
        (SPREAD_BY | {"std": 0.2}, 0.6, 0.49135),
        (SPREAD_BY | {"std": 0.1}, 0.8, 0.85876),
        # just before the contacts ahead break by themselves
        (SPREAD_BY | {"std": 0.2}, 0.8, 0.83755),
        (SPREAD_BY | {"std": 0.1, "sliding": 0.425}, 0.6, 0.49862),
    ],
)
def test_published_numbers(groups, prestress, expected):
    """Speeds to five digits or more, which a chain of blocks in time reproduces."""
    rig = bar(**groups) if isinstance(groups, dict) else bar(*groups)
    assert speed(rig, prestress) == pytest.approx(expected, rel=0.0, abs=6e-6)


CONTINUUM = (0.5, 1 / 5), (0.6, 1 / 2), (0.8, 11 / 13)


@pytest.mark.parametrize(("prestress", "expected"), CONTINUUM)
def test_the_continuum_in_closed_form(prestress, expected):
    """Thresholds nearly alike; blocks of 1/16 and 1/32 of the screening length."""
    found = speed(bar(0.01, 0.0025, 0.1, std=1e-4), prestress)
    assert found == pytest.approx(expected, rel=1e-6)
    rigs = (bar(k, k / 4, math.sqrt(k)) for k in (0.00390625, 0.0009765625))
    coarse, fine = (speed(rig, prestress) for rig in rigs)
    assert fine + (fine - coarse) / 3 == pytest.approx(expected, abs=1e-4)


def test_sliding_force_strength_and_rows_enter_through_the_prestress_alone_and_units_scale():  # noqa: E501
    rig = bar(0.04, 0.01, 0.2)
    one = speed(rig, 0.6)
    assert speed(bar(0.04, 0.01, 0.2, sliding=0.425), 0.6) == one
    assert speed(bar(0.04, 0.01, 0.2, sliding=0.425, mean=1.3), 0.6) == one
    body = {"along": 60, "across": 9, "coupling": 25.0, "shear": 3.0, "mass": 25.0}
    sheet = ss.model.Sheet(**body, damping=0.2, leaf=0.25)
    alike = ss.Rig(rig.interface, sheet, STILL)
    assert speed(alike, 0.6) == pytest.approx(one, rel=1e-12)
    front = elastic.front_speed(replace(rig, scales=SI), prestress=0.6)
    assert front.speed == pytest.approx(100 * one, rel=1e-12)
    assert front.speed / front.sound_speed == pytest.approx(one, rel=1e-12)


# ------------------------------------------------------- any distribution of thresholds


def test_the_limit_of_soft_leaf_springs():
    none, soft = (bar(0.01, leaf, 0.1, std=0.1) for leaf in (0.0, 1e-8))
    assert 0 < speed(none, 0.3) == pytest.approx(speed(soft, 0.3), rel=1e-5)
    assert elastic.front_threshold(none) == 0.0


@pytest.mark.parametrize("leaf", [0.1, 0.25])
@pytest.mark.parametrize("std", [0.0, 0.05, 0.1, 0.2])
def test_threshold_from_the_mean_square_of_the_thresholds_that_are_left(std, leaf):
    """(tau - f_d)^2 = K/(1 + K) <(x_c - f_d)^2> over the thresholds above tau."""
    rig = bar(0.04, leaf * 0.04, 0.2, std=std, sliding=0.2)
    strength = rig.interface.threshold_distribution.moment(1)
    tau = 0.2 + elastic.front_threshold(rig) * (strength - 0.2)
    mean_square = 0.8**2
    if std:
        x = np.linspace(tau, 4.0, 400_001)
        weight = rig.interface.threshold_distribution.density(x)
        mean_square = np.trapezoid((x - 0.2) ** 2 * weight, x) / np.trapezoid(weight, x)
    assert (tau - 0.2) ** 2 == pytest.approx(leaf / (1 + leaf) * mean_square, rel=1e-6)


def test_no_front_below_the_threshold():
    rig = bar(0.01, 0.0025, 0.1, std=0.1)
    least = elastic.front_threshold(rig)
    assert speed(rig, 0.99 * least) == 0.0 < speed(rig, 1.001 * least) < 0.02


@pytest.mark.parametrize(
    ("rig", "prestress", "words"),
    [
        (bar(0.25, 0.05, 0.3), 0.4, "no front"),
        (bar(0.25, 0.05, 0.3), 0.45, "these blocks pin it"),
        (bar(0.25, 0.05, 0.3), 0.45, "screening length is 1.8"),
        (bar(0.04, 0.01, 0.2, delay=ss.Delay(3.0)), 0.6, "re-attach within the front"),
        (replace(bar(0.04, 0.01, 0.2, delay=ss.Delay(3)), scales=SI), 0.6, "0.03 on"),
    ],
)
def test_what_is_said_of_a_front(rig, prestress, words):
    assert words in str(elastic.front_speed(rig, prestress=prestress))


# ---------------------------------------------------------------- precursors


@pytest.mark.parametrize("tip", [0, 1, 17, 28, 29])
def test_precursor_force_from_the_balance_of_every_block(tip):
    """From the equations of all blocks: those behind the tip slide, it is about to."""
    n = 30
    sliding = 0.3
    rig = bar(1 / 3.0, sliding=sliding, blocks=n, side=4.0)
    stuck = np.arange(n) >= tip
    matrix = springs_between(rig.slider) + np.diag(np.where(stuck, 1.0, 0.0))
    unit = np.zeros(n)
    unit[0] = 1.0
    sides = unit, np.where(stuck, 0.0, -sliding)
    per_force, offset = (np.linalg.solve(matrix, side) for side in sides)
    force = (1.0 - offset[tip]) / per_force[tip]
    found = float(elastic.precursor_force(rig).sel(tip=tip))
    assert found == pytest.approx(force, rel=1e-10)


def test_screening_length_is_how_stuck_blocks_follow():
    """Displacements of stuck blocks pushed at one end fall by e over that length."""
    rig = bar(1 / 25.0, side=4.0)
    kept = math.exp(-1 / elastic.screening_length(rig))
    decay = 25.0 / (1.0 + 25.0 * 2.0 - 25.0 * kept)
    assert decay == pytest.approx(kept, rel=1e-12)
    soft = bar(1e-6, side=4.0)
    assert elastic.screening_length(soft) == pytest.approx(1000.0, rel=1e-6)


# -------------------------------------------------------------- modes of smooth sliding


def sliding(**chain):
    thresholds = ss.Gaussian(mean=1.0, std=0.1)
    interface = ss.Interface(thresholds=thresholds, delay=ss.Delay(0.1))
    body = ss.Chain(**{"mass": 1e-4, "damping": 42.426} | chain)
    return ss.Rig(interface, body, ss.constant(velocity=1.5))


def test_a_mode_is_a_rigid_slider_on_its_own_spring():
    rig = sliding(blocks=5, coupling=3.0, leaf=1.0)
    found = elastic.modes(rig)
    rigid = replace(rig, slider=ss.Slider(stiffness=1.0, mass=1e-4, damping=42.426))
    root = complex(ss.growth_rate(rigid))
    assert complex(found.growth[0], found.frequency[0]) == pytest.approx(
        root, rel=1e-10
    )
    growth = found.growth.values.tolist()
    assert growth == sorted(growth, reverse=True)


@pytest.mark.parametrize("ends", ["free", "periodic"])
@pytest.mark.parametrize("side", [0.0, 7.0])
def test_modes_are_the_eigenvalues_of_the_springs(ends, side):
    springs = {"coupling": 3.0, "mass": 1.0, "damping": 1.0, "leaf": 0.5}
    springs |= {"side": side, "ends": ends}
    sheet = ss.model.Sheet(along=5, across=4, shear=2.0, **springs)
    for body in (*(ss.Chain(blocks=n, **springs) for n in (1, 2, 8, 60)), sheet):
        rig = replace(sliding(blocks=1, coupling=1.0, leaf=1.0), slider=body)
        exact, shape = np.linalg.eigh(np.diag(body.pulled) + springs_between(body))
        bulk = (exact - body.pulled @ shape**2)[:11]
        found = elastic.modes(rig, count=bulk.size)
        assert found.stiffness.values == pytest.approx(exact[:11], rel=1e-9)
        assert found.coupling.values == pytest.approx(bulk, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("ends", "chain", "expected"),
    [
        ("periodic", {"leaf": 1.0}, [math.inf, 12, 12, 6, 6]),
        ("free", {"leaf": 1.0}, [math.inf, 24, 12]),
        ("free", {"side": 2.0}, [2 * 25, 2 * 25 / 3]),
    ],
)
def test_wavelengths(ends, chain, expected):
    """Uniform motion, and half a wave; pulled at one end, a quarter of a wave."""
    rig = sliding(blocks=12, coupling=2.0, ends=ends, **chain)
    found = elastic.modes(rig).wavelength.values
    assert found[: len(expected)] == pytest.approx(expected)


@pytest.mark.parametrize(("blocks", "unstable"), [(8, 1), (32, 3), (128, 11)])
@pytest.mark.parametrize("viscosity", [0.0, 0.02])
def test_the_longest_waves_grow_whatever_the_viscosity(blocks, unstable, viscosity):
    """Viscosity of the bulk does not make shorter waves grow."""
    rig = sliding(blocks=blocks, coupling=20.0, leaf=1.0, viscosity=viscosity)
    found = elastic.modes(rig, count=14)
    dry = elastic.critical_length(sliding(blocks=8, coupling=20.0, leaf=1.0))
    shortest = elastic.critical_length(rig)
    assert ((found.growth > 0) == (found.wavelength > shortest.wavelength)).all()
    assert viscosity or int((found.growth > 0).sum()) == unstable
    shortest_dry = pytest.approx(25.31, abs=5e-3)
    assert viscosity or shortest.wavelength == shortest_dry
    assert not viscosity or shortest.wavelength > dry.wavelength
    assert dry.stiffness == pytest.approx(2.226362, abs=1e-6)
    stiff = elastic.critical_length(sliding(blocks=8, coupling=20.0, leaf=3.0))
    assert "stable at every wavelength" in str(stiff)
    bar = ss.read_rig("pmma_bar")  # its blocks have a length
    longer = "waves longer than 10 mm grow; pulled at one end, unstable from 5 mm on"
    assert str(elastic.critical_length(bar)) == longer


@pytest.mark.parametrize(("coupling", "side", "blocks"), [(80, 40, 8), (400, 400, 21)])
def test_a_long_slider_pulled_at_one_end_is_unstable(coupling, side, blocks):
    springs = {"coupling": coupling, "side": side}
    assert elastic.critical_length(sliding(blocks=3, **springs)).blocks == blocks
    rigs = (sliding(blocks=n, **springs) for n in (blocks - 1, blocks))
    below, above = (float(elastic.modes(rig, count=1).growth[0]) for rig in rigs)
    assert below < 0 < above


def test_a_length_parts_no_waves_where_softer_ones_are_stable_again():
    rig = sliding(blocks=8, coupling=3.5, side=2.4, mass=0.1, damping=0.7)
    rig = rig.replace(velocity=0.85, delay=0.16)
    with pytest.raises(ss.UndecidedError, match="though stiffer ones grow"):
        elastic.critical_length(rig)
    assert "waves longer" not in str(ss.predict(rig))


def test_modes_in_si_units():
    rig = sliding(blocks=8, coupling=40.0, side=40.0)
    scaled = replace(rig, scales=SI)
    natural, si = (elastic.modes(each, count=2) for each in (rig, scaled))
    assert si.growth.values == pytest.approx(100 * natural.growth.values, rel=1e-12)
    stiffness = 1e8 * natural.stiffness.values
    assert si.stiffness.values == pytest.approx(stiffness, rel=1e-12)
    stiffness = 1e8 * elastic.critical_length(rig).stiffness
    assert elastic.critical_length(scaled).stiffness == pytest.approx(stiffness)


# ---------------------------------------------------------------- bad input

ALIKE = bar(0.04, 0.01, 0.2)
SPREAD = bar(0.04, 0.01, 0.2, std=0.1)
SCATTER = replace(SPREAD.interface, slip_to_slip_scatter=0.1)
SCATTERED = replace(SPREAD, interface=SCATTER)
RIGID = replace(SPREAD, slider=ss.Slider(stiffness=1.0, mass=1e-4, damping=42.0))
BAR = sliding(blocks=8, coupling=20.0, leaf=1.0)
RING = sliding(blocks=5000, coupling=1.0, side=1.0, ends="periodic")
REFUSED = (
    lambda: speed(ALIKE, 1.0),
    "prestress = 1: must be .* below 1",
    lambda: speed(SPREAD, 0.99),
    "prestress = 0.99: the contacts are past their largest",
    lambda: speed(bar(0.04, 0.01, 0.2, 0.1, std=0.1), 0.5),
    "Chain.viscosity = 2.5: fronts in a viscous bar are known",
    lambda: speed(bar(0.04, sliding=1.0), 0.5),
    "Interface.sliding_force = 1: must be below",
    lambda: speed(SCATTERED, 0.5),
    "Interface.slip_to_slip_scatter = .* not available with front_speed",
    lambda: elastic.precursor_force(ALIKE),
    "Rig.slider = .*pulled at one end only",
    lambda: elastic.precursor_force(bar(0.25, std=0.1, side=4.0)),
    "Interface.thresholds = .* needs all .* alike",
    lambda: elastic.modes(sliding(blocks=4, coupling=1.0)),
    "Rig.slider = .* nothing holds the slider",
    lambda: elastic.modes(RING),
    "Rig.slider: 5000 blocks in a network",
    lambda: ss.growth_rate(sliding(blocks=4, coupling=1.0, leaf=1.0)),
    r"Rig.slider = .* use|modes\(\)",
    lambda: ss.predict(sliding(blocks=8, coupling=20.0)),
    ".*nothing holds the slider",
    lambda: ss.predict(replace(BAR, drive=STILL)),
    ".*the speed of a prediction = 0",
    lambda: elastic.front_threshold(RIGID),
    lambda: elastic.precursor_force(RIGID),
    lambda: elastic.modes(RIGID),
    lambda: elastic.critical_length(RIGID),
    r"Rig\.slider = Slider\(.*needs an elastic slider; give a Chain",
)


@refused(*REFUSED)
def test_bad_input(call, message):
    with pytest.raises(ss.InputError, match=f"^{message}"):
        call()


# ---------------------------------------------------------------- pictures


@pytest.fixture(scope="module")
def passing():
    """A front that slows down as the prestress falls along a bar."""
    prestress = tuple(0.9 - 0.4 * np.arange(300) / 300)
    rig = pushed(bar(0.04, 0.01, 0.2, blocks=300), prestress, 900)
    return ss.simulate(rig, output=ss.Output(interval=3.0))


@pytest.fixture(scope="module")
def pulled():
    """Precursors in a short bar, until all its blocks have slipped a few times."""
    delay = ss.RandomDelay(mean=100.0, std=30.0)
    chain = {"blocks": 24, "mass": 4.0, "damping": 0.1, "side": 4.0}
    rig = bar(0.25, std=0.05, sliding=0.425, delay=delay, **chain)
    rig = replace(rig, drive=ss.constant(2.5e-4, duration=2.5e5))
    method = ss.QuasiStatic(50, seed=1)
    return ss.simulate(rig, method=method, output=ss.Output(interval=60.0))


def test_pictures_are_what_they_were(passing, pulled):
    for name in ("spacetime", "fronts", "front_curve"):
        assert_drawn(getattr(ss.plot, name)(passing).figure, f"front_{name}")
    for name in ("precursors", "precursor_lengths", "slip_profiles"):
        assert_drawn(getattr(ss.plot, name)(pulled).figure, name)
    assert_drawn(ss.plot.overview(pulled), "overview_of_a_chain")


def test_a_front_is_as_fast_as_theory_says_of_the_prestress_there(passing):
    """It follows the falling prestress a few blocks late, .0013 of prestress each."""
    drawn = ss.plot.front_curve(passing).get_lines()
    lines = {line.get_label(): line for line in drawn}
    tau, v = lines["along the run"].get_data()
    still = passing.assign(first_break=passing.first_break * np.nan)
    assert not ss.plot.front_curve(still).get_lines()[0].get_xdata().size
    away = (tau > 0.6) & (tau < 0.8)
    assert away.sum() > 100
    theory = np.interp(tau[away], *lines["theory (lattice)"].get_data())
    assert v[away] == pytest.approx(theory, abs=0.02)
    assert lines["threshold"].get_xdata()[0] == pytest.approx(0.447214, abs=1e-6)


def test_precursors_grow_along_the_line(pulled):
    """Until all blocks slip; re-attachment and other thresholds scatter them."""
    drawn = ss.plot.precursor_lengths(pulled).get_lines()
    lines = {line.get_label(): line for line in drawn}
    force, tip = lines["theory"].get_data()
    at, reach = lines["events of the run"].get_data()
    first = int(np.argmax(reach == 24))
    assert np.all(np.abs(np.interp(reach[:first], tip, force) - at[:first]) < 2.5)
    assert float(pulled["spring_force"].max()) == pytest.approx(force.max(), rel=0.15)


UNDRAWN = (
    lambda run: ss.plot.spacetime(run, "heat"),
    "^plot: this Dataset has no heat of each block",
    lambda run: ss.plot.slip_profiles(run.isel(time=slice(-9, None))),
    "^slip_profiles: .* no event of 3",
    lambda run: ss.plot.front_curve(run),
    r"^front_curve: Rig.start = FromRest\(\): needs a run from a Prestressed",
    lambda run: ss.plot.part(run),
    "^part: needs a run of a structure",
)


@refused(*UNDRAWN)
def test_pictures_that_cannot_be_drawn(pulled, call, message):
    with pytest.raises(ss.InputError, match=message):
        call(pulled)


def test_a_bar_whose_blocks_have_a_length_is_drawn_along_it():
    rig = ss.read_rig("pmma_bar")
    short = replace(rig, drive=ss.constant(1.0, 1.0), method=ss.Contacts(2))
    ax = ss.plot.spacetime(ss.simulate(short))
    assert ax.get_xlabel() == "place along the bar (mm)"
    assert ax.get_xlim() == pytest.approx((0.0, 0.14))


def test_what_the_command_line_says_of_a_run_of_a_chain(tmp_path, capsys):
    rig = pushed(bar(0.04, 0.01, 0.2, blocks=60), 0.8, 100.0)
    file = tmp_path / "rig.toml"
    kept = tmp_path / "run.nc"
    file.write_text(rig_files.to_toml(rig))
    (front,) = ss.measure.fronts(ss.simulate(rig))["front_speed"].values
    speeds = f"{front:.3g} blocks/time, {front:.3g} of the speed of sound"
    line = f"blocks 0 to 59, the end; {speeds}\n1 event of at least 3"
    for command in (
        ("simulate", file, "-o", kept),
        ("measure", kept),
        ("rerun", kept, "-o", tmp_path / "again.nc"),
    ):
        assert cli.main([str(word) for word in command]) == 0
        assert line in capsys.readouterr().out
    assert ss.load(tmp_path / "again.nc").identical(ss.load(kept))
    for kind in ("spacetime", "fronts", "precursors", "slips"):
        picture = tmp_path / f"{kind}.png"
        assert cli.main(["plot", str(kept), str(picture), "--kind", kind]) == 0


# ------------------------------------ which wavelength slips first, and at which speeds


@pytest.fixture(scope="module")
def predicted():
    """The answer for a bar of which three modes grow."""
    rig = sliding(blocks=32, coupling=20.0, leaf=1.0)
    return ss.predict(replace(rig, method=ss.Contacts(20, seed=1)))


@pytest.mark.slow
def test_a_bar_is_stable_after_each_change_and_not_much_before(predicted):
    found = {each.parameter for each in predicted.mitigations}
    varied = {"velocity", "leaf", "coupling", "damping", "mass", "delay", "std"}
    assert found | {*predicted.attempts} == varied
    for each in predicted.mitigations:
        before = each.to * (each.now / each.to) ** 0.2
        for value, stable in ((each.to, True), (before, False)):
            there = predicted.rig.with_values(**{each.parameter: value})
            assert (elastic.modes(there)["growth"].max() < 0) == stable, each


def test_a_bar_slips_first_when_and_as_far_as_its_picture_shows():
    chain = {"blocks": 12, "mass": 4.0, "damping": 0.1, "side": 4.0}
    rig = bar(0.25, std=0.05, sliding=0.425, delay=ss.Delay(2.0), **chain)
    drive = ss.constant(2e-3, duration=1e4)
    rig = replace(rig, drive=drive, method=ss.QuasiStatic(20, seed=1))
    found = ss.predict(rig)
    ax = ss.plot.precursors(ss.simulate(rig))
    shown = {line.get_label(): line for line in ax.get_lines()}
    some = shown["precursor, with the block it reaches"].get_xdata()
    whole = shown["slip of all blocks"].get_xdata()
    assert (found.partial.start, found.whole.start) == (min(some), min(whole))
    lengths = {text.get_text(): text.xy[0] for text in ax.texts}
    assert lengths[str(found.partial.blocks)] == found.partial.start
    words = " ".join(str(found).split())
    assert found.headline.endswith(", but a run from rest slips")
    first, whole = (
        rig.in_units(slip.start, "time", 3) for slip in (found.partial, found.whole)
    )
    reach = f"{found.partial.blocks} of 12 blocks"
    line = f"first precursor after {first}, {reach}; first slip of all blocks after "
    assert line + whole in words


def test_predict_tells_which_wave_grows_and_at_which_speeds(predicted):
    """At the end of a wave's range of speeds its stiffness is critical."""
    found = predicted
    rig = found.rig
    table = elastic.modes(rig)
    assert found.growing == int((table["growth"] > 0).sum()) == 3
    wavelengths = [wave.wavelength for wave in found.waves]
    assert wavelengths == table["wavelength"].values[:5].tolist()
    growth = table["growth"].values[:5].tolist()
    assert [wave.growth for wave in found.waves] == pytest.approx(growth, rel=1e-9)
    body = ss.Slider(stiffness=1.0, mass=1e-4, damping=42.426)
    for wave in found.waves:
        edges = {end for pair in wave.speeds for end in pair}
        for edge in edges - set(found.speeds_searched):
            at = replace(rig, slider=body, drive=ss.constant(edge))
            spring = ss.stability.critical_spring(at)
            assert spring == pytest.approx(wave.stiffness, rel=1e-5)
    longest, *others = found.waves
    assert all(longest.speeds[0][0] < wave.speeds[0][0] for wave in others)
    assert found.speeds == longest.speeds
    assert_drawn(found.plot(), "waves")
    assert_kept(found.text(details=True), "waves_told")


def test_growing_modes_beyond_the_softest_are_counted_and_shown():
    """The fastest, and those that alone grow at some speed, are not among the softest;
    what the budget does not allow is not called stable.
    """
    body = {"mass": 0.05, "damping": 0.3, "leaf": 0.05}
    rig = sliding(blocks=70, coupling=2.0, **body)
    rig = replace(rig, drive=ss.constant(2.0))
    found = ss.predict(rig, fast=True)
    table = elastic.modes(rig, count=70)
    fastest = table.isel(mode=int(table["growth"].argmax("mode")))
    (named,) = (wave for wave in found.waves if wave.name == found.fastest)
    assert (found.growing, found.complete) == (int((table["growth"] > 0).sum()), True)
    assert found.growing > 64
    assert named.wavelength == fastest["wavelength"] < 5.0
    assert named.growth == pytest.approx(float(fastest["growth"]))
    ((_, last),) = found.speeds
    assert max(end for wave in found.waves[:5] for _, end in wave.speeds) < 0.92 * last
    for factor, grows in ((0.999, True), (1.05, False)):
        there = replace(rig, drive=ss.constant(factor * last))
        assert (elastic.modes(there, count=70)["growth"].max() > 0) == grows
    viscous = replace(rig, slider=replace(rig.slider, viscosity=1e-3))
    found = ss.predict(viscous, fast=True)
    assert "; 64 growing modes of the 64 softest, fastest: wave" in found.verdict
    assert "Left out: the speeds at which other waves grow; --thorough" in str(found)
    assert {band.kind for band in found.bands} == {"unstable", "unknown"}
    assert found.bands[-1].high == found.speeds_searched[1]


def test_a_bar_of_which_no_wave_grows_says_so():
    found = ss.predict(replace(BAR, drive=ss.constant(2000.0)))
    assert found.growing == 0
    assert "smooth sliding is linearly stable at every wavelength" in found.headline
    contacts = replace(BAR.interface, delay=ss.Delay(0.0))
    at_once = ss.predict(replace(BAR, interface=contacts))
    assert at_once.verdict.startswith("undecided: without delay or ageing")
    assert at_once.plot().axes
    rigid = replace(BAR, slider=ss.Slider(stiffness=1.0, mass=1e-4, damping=42.426))
    rigid = replace(rigid, interface=sliding(blocks=1, coupling=1.0).interface)
    spring = ss.stability.critical_spring(replace(rigid, drive=ss.constant(1.5)))
    neutral = ss.predict(sliding(blocks=8, coupling=1.0, leaf=spring), fast=True)
    assert "a mode is on its stability boundary" in neutral.verdict


def test_a_bar_that_was_pulled_too_short_says_how_far_to_pull(capsys, tmp_path):
    """The first block slips where precursors of the closed form begin."""
    rig = bar(0.25, std=0.0, blocks=40, side=4.0, alpha=0.3)
    distance = 1.0 + float(elastic.precursor_force(rig).sel(tip=0)) / rig.slider.side
    rig = replace(rig, method=ss.Contacts(2))
    drives = (ss.constant(0.01, part * distance / 0.01) for part in (0.5, 1.01))
    short, beyond = (ss.simulate(replace(rig, drive=drive)) for drive in drives)
    ss.save(short, tmp_path / "short.nc")
    assert cli.main(["measure", str(tmp_path / "short.nc")]) == 0
    said = "the first block breaks loose when the drive has gone about"
    said = f"0 events of at least 3 blocks; {said}"
    assert f"{said} {distance:.3g} x_s" in capsys.readouterr().out
    assert np.flatnonzero(np.isfinite(beyond["first_break"])).tolist() == [0]
