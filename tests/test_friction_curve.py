"""Growth of thresholds: by a table, and inferred from a measured friction curve."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
import tomli_w
from scipy.interpolate import PchipInterpolator

import stickslip as ss
from stickslip.advise.budget import Budget
from stickslip.advise.doubt import Doubt
from stickslip.io.rig_files import to_toml
from stickslip.io.settings import read_rig_with
from stickslip.model import TabulatedGrowth

SPEEDS = np.geomspace(0.03, 30.0, 13)
RULE = ss.ExponentialGrowth(rate=1.0)
# the same growth given by a table
AGES = np.geomspace(0.003, 30.0, 60)
TABLE = TabulatedGrowth(tuple(AGES), tuple(-np.expm1(-AGES)))


def contacts(std=0.1, **fields):
    return ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=std), **fields)


@pytest.mark.parametrize("std", [0.0, 0.02, 0.3])
def test_a_table_of_a_rule_slides_as_the_rule(std):
    by_rule, by_table = (contacts(std, ageing=ageing) for ageing in (RULE, TABLE))
    speeds = np.array([0.1, 0.3, 0.6])
    rule = ss.kinetic_friction(by_rule, speeds)
    np.testing.assert_allclose(ss.kinetic_friction(by_table, speeds), rule, rtol=1e-3)


def test_friction_is_the_work_of_a_life_over_its_length():
    """``F = v <t^2>/(2 <t>)``, with the ages at breaking found here by a search."""
    growth = TabulatedGrowth((0.1, 0.7, 2.0, 9.0), (0.4, 0.8, 0.75, 1.0))
    interface = contacts(0.2, ageing=growth)
    s = interface.threshold_distribution.inverse_survival((np.arange(4000) + 0.5) / 4e3)
    age = np.geomspace(1e-3, 100.0, 200_001)
    at = np.log([growth.ages, growth.strengths])
    strength = np.exp(PchipInterpolator(*at)(np.clip(np.log(age), at[0, 0], at[0, -1])))
    for velocity in (0.2, 1.0, 4.0):
        life = np.interp(s, velocity * age / strength, age)
        force = velocity * np.mean(life**2) / (2.0 * np.mean(life))
        found = ss.kinetic_friction(interface, velocity)
        assert found == pytest.approx(force, rel=1e-4)


@pytest.mark.parametrize("velocity", [0.05, 0.2, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("method", [ss.Contacts(100, seed=1), ss.MasterEquation()])
def test_runs_slide_with_the_friction_of_a_table(method, velocity):
    growth = TabulatedGrowth((0.1, 0.7, 2.0, 9.0), (0.4, 0.8, 0.75, 1.0))
    interface = contacts(ageing=growth)
    stiff = ss.Slider(stiffness=50.0, mass=1e-2, damping=100.0 / velocity)
    drive = ss.constant(velocity, duration=40.0 / velocity)
    how = {"start": ss.FromSliding(), "output": ss.Output(interval=0.02 / velocity)}
    rig = ss.Rig(interface, stiff, drive, method=method, **how)
    force = ss.simulate(rig)["friction_force"][1:].to_numpy().reshape(20, -1)
    means = force.mean(axis=1)
    error = 4.0 * means.std(ddof=1) / 20**0.5 if hasattr(method, "seed") else 1e-3
    assert abs(means.mean() - ss.kinetic_friction(interface, velocity)) < error


def test_stability_of_a_table_is_that_of_the_rule():
    slider = ss.Slider(stiffness=0.3, mass=1e-2, damping=1.0)
    interfaces = (contacts(0.1, ageing=ageing) for ageing in (RULE, TABLE))
    rigs = (ss.Rig(each, slider, ss.constant(0.5)) for each in interfaces)
    by_rule, by_table = (ss.stability.growth_rate(rig) for rig in rigs)
    assert by_table == pytest.approx(by_rule, rel=0.01)


@pytest.mark.parametrize(
    ("ages", "strengths", "message"),
    [
        (1.0, (1.0,), "ages = 1.0: must be"),
        ((1.0,), (1.0,), "two ages or more that rise"),
        ((1.0, 1.0), (1.0, 2.0), "two ages or more that rise"),
        ((1.0, 2.0), (1.0,), "give one for each age"),
        ((1.0, 2.0), (1.0, 3.0), "rise as steeply as the ages between 1 and 2"),
        ((1.0, 2.0), (0.0, 1.0), r"strengths\[0\] = 0: must"),
    ],
)
def test_tables_that_cannot_be(ages, strengths, message):
    with pytest.raises(ss.InputError, match=message):
        TabulatedGrowth(ages, strengths)


def test_no_contact_that_grows_by_a_table_is_born_stretched():
    stretched = ss.Uniform(low=0.0, high=0.2)
    with pytest.raises(ss.InputError, match=r"newborn = Uniform.*not available"):
        replace(contacts(ageing=TABLE), newborn=stretched)


# ---------------------------------------------------------------- from a measured curve


def stribeck(power):
    return 0.3 + 0.2 * np.exp(-(SPEEDS**power))


@pytest.mark.parametrize("std", [0.02, 0.2, 0.5])
@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_a_curve_goes_through_its_points(power, std):
    force = stribeck(power)
    points = zip(SPEEDS, force, strict=True)
    curve = ss.friction_curve(points, thresholds=ss.Gaussian(1.0, std))
    found = ss.kinetic_friction(curve.interface, SPEEDS)
    np.testing.assert_allclose(found, force, rtol=1e-6)
    assert curve.viscosity == 0.0
    assert curve.delayed is None
    # strengths hardly fall, and between the points the friction is close
    assert np.diff(curve.interface.ageing.strengths).min() > -0.03
    between = np.sqrt(SPEEDS[1:] * SPEEDS[:-1])
    near = 0.3 + 0.2 * np.exp(-(between**power))
    friction = ss.kinetic_friction(curve.interface, between)
    np.testing.assert_allclose(friction, near, rtol=0.01)


def test_contacts_that_are_alike_grow_as_their_friction_falls():
    force = stribeck(1.0)
    points = zip(SPEEDS, force, strict=True)
    found = ss.friction_curve(points, thresholds=ss.Gaussian(1.0, 0.0))
    growth = found.interface.ageing
    np.testing.assert_allclose(growth.strengths, 2.0 * force[::-1], rtol=1e-9)
    np.testing.assert_allclose(growth.ages, (2.0 * force / SPEEDS)[::-1], rtol=1e-9)


@pytest.mark.parametrize("sliding_force", [0.0, 0.2])
def test_the_curve_of_a_delay_is_known_as_one(sliding_force):
    known = contacts(delay=ss.Delay(0.7), sliding_force=sliding_force)
    speeds = SPEEDS[::3]
    force = 2.0 * ss.kinetic_friction(known, speeds)
    found = ss.friction_curve(zip(speeds, force, strict=True))
    assert found.delayed.delay.time == pytest.approx(0.7, rel=1e-4)
    assert found.delayed.sliding_force == pytest.approx(sliding_force, abs=1e-5)
    assert found.delayed_strength == pytest.approx(2.0, rel=1e-4)
    force = found.delayed_strength * ss.kinetic_friction(found.delayed, SPEEDS)
    expected = 2.0 * ss.kinetic_friction(known, SPEEDS)
    np.testing.assert_allclose(force, expected, rtol=1e-5)
    assert "a hold or a velocity step decides" in str(found)


def test_a_rise_after_the_fall_is_a_viscous_force():
    speeds = SPEEDS[::2]
    force = stribeck(1.0)[::2] + 0.02 * speeds
    rough = force + 0.003 * np.random.default_rng(1).standard_normal(7)
    exact = ss.friction_curve(zip(speeds, force, strict=True))
    assert exact.viscosity == pytest.approx(0.02, rel=1e-3)
    np.testing.assert_allclose(exact.friction(speeds), force, rtol=1e-6)
    found = ss.friction_curve(zip(speeds, rough, [0.003] * 7, strict=True))
    # the least within a standard error of the best, which is within four of the truth
    error = 0.003 * 2.0**0.5 / (speeds[-1] - speeds[-2])
    assert found.viscosity == pytest.approx(0.02, abs=5.0 * error)
    fitted = found.friction(speeds) + found.residual
    np.testing.assert_allclose(fitted, rough, rtol=1e-12)
    assert np.sum((np.array(found.residual) / 0.003) ** 2) < 7
    assert len(found.plot().axes) == 2


def test_the_curve_of_a_rule_of_growth_is_as_stable_as_the_rule():
    known = contacts(ageing=RULE)
    speeds = np.geomspace(0.15, 0.7, 12)
    force = ss.kinetic_friction(known, speeds)
    found = ss.friction_curve(zip(speeds, force, strict=True)).interface
    slider = ss.Slider(stiffness=0.3, mass=1e-2, damping=1.0)
    rigs = [ss.Rig(each, slider, ss.constant(0.35)) for each in (found, known)]
    one, other = (ss.stability.growth_rate(rig) for rig in rigs)
    assert one == pytest.approx(other, rel=0.01)
    limits = [ss.critical(rig, "damping", between=(0.1, 1000.0)) for rig in rigs]
    one, other = (limit.edges[0].value for limit in limits)
    assert one == pytest.approx(other, rel=0.01)


RISES = [(0.1, 0.401), (0.2, 0.5), (1, 0.4), (10, 0.3)]
RISING = "rises from 0.401 to 0.5 between the velocities 0.1 and 0.2; no viscous"
STEEP = [(1, 0.901), (1.01, 0.5), (1.5, 0.49)]


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(1, 0.5)], "at two speeds or more"),
        ([(1, 0.5), (1, 0.4)], "each once"),
        ([(1, 0.5), (2,)], r"points\[1\] = \(2,\): must be one of points"),
        ([(1, 0.5), (2, -0.1)], r"forces\[1\] = -0.1"),
        (RISES, RISING),
        (STEEP, "no growth of .* gives 0.5"),
    ],
)
def test_curves_that_no_contacts_give(points, message):
    with pytest.raises(ss.InputError, match=message):
        ss.friction_curve(points)


def test_rounding_is_the_error_of_points_without_one():
    rounded = ss.friction_curve([(0.1, 0.45), (1, 0.31), (3, 0.3), (10, 0.31)])
    assert rounded.measured.errors == pytest.approx([0.005] * 4)
    # no more than by rounding
    assert rounded.viscosity == 0.0


# ------------------------------------------------------------------------- in rig files

STAGE = {
    "slider": {"mass": "3 kg", "stiffness": "1 MN/m", "damping_ratio": 0.05},
    "interface": {
        "normal_load": "100 N",
        "friction": [["0.1 mm/s", 0.3], ["1 mm/s", 0.27], ["10 mm/s", 0.205]],
        "breaking_displacement": "20 um",
        "mu_s": 0.33,
    },
    "drive": {"velocity": "1 mm/s"},
}


def stage(**interface):
    return ss.read_rig(STAGE | {"interface": STAGE["interface"] | interface})


def friction_of(rig, speed):
    velocity = rig.scales.natural(speed, "x_s/time")
    drag = rig.slider.mass * rig.slider.damping * velocity
    return rig.scales.si(ss.kinetic_friction(rig.interface, velocity), "f_s"), drag


def test_a_rig_file_takes_a_curve_of_coefficients():
    rig = stage()
    for speed, mu in ((1e-4, 0.3), (1e-3, 0.27), (1e-2, 0.205)):
        assert friction_of(rig, speed)[0] == pytest.approx(100.0 * mu, rel=1e-6)
    assert rig.interface.ageing.strengths[-1] == 1.0  # as the distribution gives
    friction = {"normal_load": "100 N", "mu_s": 0.33, "mu_k": 0.3}
    friction["breaking_displacement"] = "20 um"
    by_peak = ss.read_rig(STAGE | {"interface": friction})
    assert rig.interface.thresholds == by_peak.interface.thresholds
    assert rig.slider.damping_ratio == pytest.approx(0.05)


@pytest.mark.parametrize("own", [False, True])
def test_a_rig_of_a_curve_is_written_and_read_again(own):
    rig = stage()
    again = ss.read_rig(tomllib.loads(to_toml(rig, own=own)))
    near = {"rel": 1e-3 if own else 1e-12}
    std = rig.interface.thresholds.std
    assert again.interface.thresholds.std == pytest.approx(std, **near)
    one, other = again.interface.ageing, rig.interface.ageing
    assert one.ages == pytest.approx(other.ages, **near)
    assert one.strengths == pytest.approx(other.strengths, **near)
    assert own == ("[interface.ageing]" not in to_toml(rig, own=own))


@pytest.mark.parametrize(("marks", "encoding"), [(",.", "utf-8"), (";,", "utf-16")])
def test_forces_in_a_file_beside_it_and_a_rise(tmp_path, marks, encoding):
    """The same curve, as forces in a file; its rise becomes a damping of the slider."""
    text = "# of a bench\nspeed (mm/s),friction force (N),std (N)\n"
    text += "0.1,30,0.1\n1,27,0.1\n10,20.5,0.1\n30,21.5,0.1\n100,25,0.1\n"
    text = text.translate(str.maketrans(",.", marks))
    (tmp_path / "mu.csv").write_text(text, encoding=encoding)
    document = tomllib.loads(to_toml(stage(), own=False))
    document["interface"] = STAGE["interface"] | {"friction": "gone.csv"}
    (tmp_path / "rig.toml").write_text(tomli_w.dumps(document))
    rig = read_rig_with(tmp_path / "rig.toml", ["interface.friction=mu.csv"])
    for speed, force in ((1e-4, 30.0), (1e-2, 20.5), (0.1, 25.0)):
        friction, _ = friction_of(rig, speed)
        viscous = (rig.value("damping") - stage().value("damping")) * 3.0 * speed
        assert friction + viscous == pytest.approx(force, abs=0.4)
    assert viscous == pytest.approx(5.0, rel=0.1)


def test_friction_without_weakening():
    even = stage(friction=[["1 mm/s", 0.3], ["10 mm/s", 0.3]], mu_s=0.3)
    assert even.interface.thresholds == ss.Exponential(mean=1.0)
    assert friction_of(even, 5e-3)[0] == pytest.approx(30.0)


def test_viscosity_is_a_damping_of_its_own():
    plain, viscous = stage(), stage(viscosity="30 N*s/m")
    assert viscous.value("damping") - plain.value("damping") == pytest.approx(10.0)
    # and is subtracted from the curve
    assert friction_of(viscous, 1e-2)[0] == pytest.approx(20.2)


@pytest.mark.parametrize(
    ("interface", "message"),
    [
        ({"contact_strength": "40 N"}, "give friction or contact_strength"),
        ({"delay": "1 ms"}, "give friction or delay"),
        ({"friction": [["1 mm/s"]]}, r"friction\[0\] = .*must be a point, such as"),
        ({"friction": [["1 mm/s", 0.3]]}, "at two speeds or more"),
        ({"friction": "mu.csv"}, "only a rig file may name"),
        ({"friction": [["1 mm/s", 0.3], ["2 mm/s", "20 N"]]}, "must be all forces"),
        ({"friction": [["1 m", 0.3], ["2 mm/s", 0.2]]}, r"friction\[0\] = '1 m'"),
        ({"mu_s": 0.2}, r"mu_s: mu_s/mu_k = 0.6667: must be between"),
    ],
)
def test_curves_that_a_rig_file_cannot_have(interface, message):
    with pytest.raises(ss.InputError, match=message):
        stage(**interface)


SLOW_TO_FAST = 0.1, 0.3, 1, 3, 10, 100
DELAYED = [[f"{v} mm/s", round(0.17 + 0.13 / (1 + v / 3), 3)] for v in SLOW_TO_FAST]


def test_where_a_delay_fits_too_the_doubt_has_both_verdicts():
    thresholds = {"distribution": "gaussian", "std": 0.2}
    interface = {**STAGE["interface"], "friction": DELAYED, "thresholds": thresholds}
    del interface["mu_s"]
    rig = ss.read_rig({**STAGE, "interface": interface}).replace(velocity="4 mm/s")
    assert str(Doubt.of(rig, Budget(100.0))) == (
        "A delay of 6.668 ms gives the measured friction as well as growth: the rig "
        "oscillates with growth, and oscillates with the delay, too; a hold decides "
        "(growth: the longer, the higher the peak), or a velocity step."
    )
    # a shape that no delay gives
    steep = [[f"{v} mm/s", mu] for v, mu in ((1, 0.3), (2, 0.29), (4, 0.21), (9, 0.2))]
    assert Doubt.of(stage(friction=steep), Budget(100.0)) is None
