"""Growth of thresholds by a table, and the growth behind a measured friction curve."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import stickslip as ss
from stickslip.model import TabulatedGrowth

SPEEDS = np.geomspace(0.03, 30.0, 13)
RULE = ss.ExponentialGrowth(rate=1.0)
# the same growth, by a table
AGES = np.geomspace(0.003, 30.0, 60)
TABLE = TabulatedGrowth(tuple(AGES), tuple(-np.expm1(-AGES)))


def contacts(std=0.1, **fields):
    return ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=std), **fields)


@pytest.mark.parametrize("std", [0.0, 0.02, 0.3])
def test_a_table_of_a_rule_slides_as_the_rule(std):
    by_rule, by_table = (contacts(std, ageing=ageing) for ageing in (RULE, TABLE))
    speeds = np.array([0.1, 0.3, 0.6])
    np.testing.assert_allclose(
        ss.kinetic_friction(by_table, speeds),
        ss.kinetic_friction(by_rule, speeds),
        rtol=1e-3,
    )


def test_friction_is_the_work_of_a_life_over_its_length():
    """``F = v <t^2>/(2 <t>)``, with the ages from a search by hand."""
    growth = TabulatedGrowth((0.1, 0.7, 2.0, 9.0), (0.4, 0.8, 0.75, 1.0))
    interface = contacts(0.2, ageing=growth)
    s = interface.threshold_distribution.inverse_survival((np.arange(4000) + 0.5) / 4e3)
    age = np.geomspace(1e-3, 100.0, 200_001)
    at = np.log([growth.ages, growth.strengths])
    nodes = np.clip(np.log(age), at[0, 0], at[0, -1])
    strength = np.exp(PchipInterpolator(*at)(nodes))
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
    rig = ss.Rig(
        interface,
        stiff,
        ss.constant(velocity, duration=40.0 / velocity),
        method=method,
        start=ss.FromSliding(),
        output=ss.Output(interval=0.02 / velocity),
    )
    force = ss.simulate(rig)["friction_force"][1:].to_numpy().reshape(20, -1)
    means = force.mean(axis=1)
    error = 4.0 * means.std(ddof=1) / 20**0.5 if hasattr(method, "seed") else 1e-3
    assert abs(means.mean() - ss.kinetic_friction(interface, velocity)) < error


def test_stability_of_a_table_is_that_of_the_rule():
    slider = ss.Slider(stiffness=0.3, mass=1e-2, damping=1.0)
    by_rule, by_table = (
        ss.Rig(contacts(0.1, ageing=ageing), slider, ss.constant(0.5))
        for ageing in (RULE, TABLE)
    )
    assert ss.stability.growth_rate(by_table) == pytest.approx(
        ss.stability.growth_rate(by_rule), rel=0.01
    )


@pytest.mark.parametrize(
    ("ages", "strengths", "message"),
    [
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
