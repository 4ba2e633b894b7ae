"""SI units to natural units and back."""

import pickle
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip.errors import InputError
from stickslip.model.units import Quantity, Scales

SIZE = st.floats(1e-9, 1e9)
scales = st.builds(Scales, force=SIZE, stretching=SIZE, time=SIZE)
quantities = st.sampled_from(get_args(Quantity))

# Powers of (force, stretching, time) in each quantity.
DIMENSIONS = {
    "force": (1, 0, 0),
    "length": (0, 1, 0),
    "time": (0, 0, 1),
    "velocity": (0, 1, -1),
    "stiffness": (1, -1, 0),
    "mass": (1, -1, 2),
    "rate": (0, 0, -1),
    "energy": (1, 1, 0),
    "viscosity": (1, -1, 1),
    "modulus": (1, -2, 0),
    "density": (1, -4, 2),
}


def test_every_quantity_has_a_dimension_here():
    assert set(DIMENSIONS) == set(get_args(Quantity))


@given(scales, quantities, st.floats(-1e6, 1e6))
def test_there_and_back(scales, quantity, value):
    assert scales.si(scales.natural(value, quantity), quantity) == pytest.approx(value, rel=1e-15, abs=1e-300)


@given(scales, quantities)
def test_a_unit_follows_from_the_dimension(scales, quantity):
    force, length, time = DIMENSIONS[quantity]
    expected = scales.force**force * scales.stretching**length * scales.time**time
    assert scales.unit(quantity) == pytest.approx(expected, rel=1e-14)


@given(scales, st.floats(0.1, 10.0), st.sampled_from(["force", "stretching", "time"]), quantities)
def test_scales_are_independent(scales, factor, name, quantity):
    """Changing one scale changes a unit by its power of that scale, whatever the other two are."""
    power = dict(zip(("force", "stretching", "time"), DIMENSIONS[quantity], strict=True))[name]
    values = {"force": scales.force, "stretching": scales.stretching, "time": scales.time}
    other = Scales(**(values | {name: factor * values[name]}))
    assert other.unit(quantity) == pytest.approx(factor**power * scales.unit(quantity), rel=1e-14)


@given(scales, st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_physics_does_not_depend_on_units(scales, mass, stiffness, velocity):
    """A frequency and an energy computed in SI agree with those computed in natural units."""
    m, k, v = (
        scales.natural(value, q) for value, q in ((mass, "mass"), (stiffness, "stiffness"), (velocity, "velocity"))
    )
    assert scales.si((k / m) ** 0.5, "rate") == pytest.approx((stiffness / mass) ** 0.5, rel=1e-13)
    assert scales.si(m * v * v, "energy") == pytest.approx(mass * velocity**2, rel=1e-13)


def test_a_rig_worked_out_by_hand():
    scales = Scales(force=768.0, stretching=1e-6, time=0.01)
    assert scales.natural(4e6, "stiffness") == pytest.approx(4e6 * 1e-6 / 768)
    assert scales.natural(0.4e-3, "velocity") == pytest.approx(4.0)
    assert scales.natural(0.0756, "mass") == pytest.approx(0.0756 * 1e-6 / (768 * 1e-4))


@pytest.mark.parametrize("name", ["force", "stretching", "time"])
@pytest.mark.parametrize("value", [0, -1.0, float("nan"), float("inf"), "1 N", None])
def test_bad_scales(name, value):
    with pytest.raises(InputError, match=rf"^Scales\.{name} = .*in (N|m|s)\)$"):
        Scales(**({"force": 1.0, "stretching": 1.0, "time": 1.0} | {name: value}))


def test_a_quantity_that_does_not_exist():
    with pytest.raises(InputError, match=r"quantity = 'power': must be one of force, length"):
        Scales(force=1, stretching=1).unit("power")


def test_scales_are_values():
    one = Scales(force=1, stretching=2, time=3)
    assert one == Scales(force=1.0, stretching=2.0, time=3.0)
    assert hash(one) == hash(Scales(force=1.0, stretching=2.0, time=3.0))
    assert pickle.loads(pickle.dumps(one)) == one
    with pytest.raises(AttributeError):
        one.force = 2.0
