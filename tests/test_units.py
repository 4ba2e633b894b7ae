"""SI units to natural units and back."""

import re
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

import stickslip as ss
from stickslip.errors import InputError
from stickslip.model.parameters import Parameter
from stickslip.model.quantities import read_quantity
from stickslip.model.units import QUANTITIES, UNITS, Scales, engineering, si_unit
from stickslip.progress import in_time

SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4)
SIZE = st.floats(1e-9, 1e9)
scales = st.builds(Scales, force=SIZE, stretching=SIZE, time=SIZE)

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


@given(scales, st.sampled_from(sorted(DIMENSIONS)))
def test_a_unit_follows_from_the_dimension(scales, quantity):
    assert DIMENSIONS.keys() == QUANTITIES.keys()
    force, length, time = DIMENSIONS[quantity]
    expected = scales.force**force * scales.stretching**length * scales.time**time
    assert scales.unit(quantity) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("name", ["banana", "N", "m/s", "", None, ["f_s"]])
@pytest.mark.parametrize("example", ["brake_pad", None])
def test_a_unit_that_does_not_exist(name, example):
    interface = ss.Interface(thresholds=ss.Gaussian(1.0, 0.1))
    natural = ss.Rig(interface, SLIDER, ss.constant(velocity=1.0))
    rig = ss.read_rig(example) if example else natural
    for ask in (rig.unit, rig.unit_name, partial(rig.in_units, 1.0)):
        message = r"^unit = .*: must be one of 1, f_s, x_s, .*, or force, length"
        with pytest.raises(InputError, match=message):
            ask(name)
    with pytest.raises(InputError, match=r"^unit = "):
        Parameter(name="own", unit=name, get=float, set=float)


def test_a_unit_may_be_named_by_its_quantity():
    rig = ss.read_rig("brake_pad")
    assert (rig.unit("velocity"), rig.unit_name("velocity")) == (0.02, "m/s")
    for kind, natural in QUANTITIES.items():
        assert rig.unit(kind) == rig.unit(natural)
        words = rig.in_units(1.0, kind, 15)
        read = read_quantity(words, rig.unit_name(natural), "")
        assert read == pytest.approx(rig.unit(kind))
        assert rig.natural.in_units(1.0, kind).split()[0] == "1"


SMALL = st.floats(1e-24, 1e24).map(lambda v: v * 10.0 ** (-6))


@given(SMALL, st.sampled_from([*UNITS]), st.integers(1, 15))
def test_every_natural_unit_in_words_reads_back(value, unit, digits):
    """In SI: so many digits, a unit of the grammar, an exponent only without prefix."""
    name = si_unit(unit)
    if unit in ("1", "1/time^(1/2)"):
        return
    said = engineering(value, name, digits)
    error = 0.51 * 10.0 ** (1 - digits)
    assert read_quantity(said, name, "") == pytest.approx(value, rel=error)
    if unit in ("f_s", "k", "f_s x_s", "x_s/time") and 1e-14 < value < 1e14:
        assert "e" not in said
        assert 1 <= float(said.split()[0]) < 1000


WORDS = """4e6 N/m, 4: 4 MN/m | 0.0756 kg, 4: 75.6 g | 12_000 kg, 4: 12000 kg
0.0 N, 4: 0 N | 123 N, 2: 120 N | 999.96 N, 4: 1 kN | 1180 kg/m^3, 4: 1180 kg/m^3
2.094e5 mN, 4: 209.4 N | 2e4 ms, 2: 20 s | 5000 s, 2: 5000 s | 2e-6 1/s, 4: 2e-06 1/s
11_790 Hz, 4: 11.79 kHz | 12_345 lbf, 3: 12300 lbf | 0.12 1, 4: 0.12
inf N, 4: inf N"""


@pytest.mark.parametrize("row", WORDS.replace("\n", " | ").split(" | "))
def test_values_in_words(row):
    value, unit, digits, words = re.split(", |: | ", row, maxsplit=3)
    assert engineering(float(value), unit, int(digits)) == words


TIMES = {0.5: "0.5 s", 110: "110 s", 7100: "120 min", 2e5: "2.3 days"}
TIMES[2.6e7] = "300 days"


@pytest.mark.parametrize(("seconds", "words"), TIMES.items())
def test_times_in_words(seconds, words):
    assert in_time(seconds) == words
