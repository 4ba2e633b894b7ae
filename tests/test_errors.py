"""One error for every wrong input: what the checks let through and what they say."""

import math
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip.errors import InputError, instance, number, together, whole


@pytest.mark.parametrize("value", [2, 2.0, np.float64(2), np.float32(2), np.int64(2), Fraction(2)])
def test_number_takes_every_real_number_and_gives_a_float(value):
    result = number("place", value)
    assert type(result) is float
    assert result == 2.0


@pytest.mark.parametrize("value", ["2", None, True, 2j, [2], np.array(2.0), Decimal(2), np.True_, object()])
def test_number_takes_nothing_else(value):
    with pytest.raises(InputError, match=r"^place = .*: must be a number$"):
        number("place", value)


@pytest.mark.parametrize(
    ("value", "bounds", "message"),
    [
        (math.nan, {}, "place = nan: must be a finite number"),
        (math.inf, {}, "place = inf: must be a finite number"),
        (-math.inf, {"infinite": True, "at_least": 0}, "place = -inf: must be a number at least 0"),
        (math.nan, {"infinite": True}, "place = nan: must be a number"),
        (0, {"above": 0}, "place = 0: must be a finite number above 0"),
        (-1, {"at_least": 0}, "place = -1: must be a finite number at least 0"),
        (1, {"below": 1}, "place = 1: must be a finite number below 1"),
        (2, {"at_most": 1}, "place = 2: must be a finite number at most 1"),
        (3, {"above": 0, "at_most": 1}, "place = 3: must be a finite number above 0 and at most 1"),
        (-1, {"above": 0, "hint": "in N"}, "place = -1: must be a finite number above 0 (in N)"),
        ("1", {"above": 0, "hint": "in N"}, "place = '1': must be a number above 0 (in N)"),
        (10**400, {"above": 0}, "place = an integer of about 401 digits: must be a number above 0"),
    ],
)
def test_number_names_place_value_and_mitigation(value, bounds, message):
    with pytest.raises(InputError) as caught:
        number("place", value, **bounds)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("value", "bounds"),
    [(0, {"at_least": 0}), (1, {"at_most": 1}), (math.inf, {"infinite": True}), (1e-30, {"above": 0})],
)
def test_number_takes_what_lies_on_a_closed_bound(value, bounds):
    assert number("place", value, **bounds) == value


def test_minus_zero_becomes_zero():
    assert math.copysign(1.0, number("place", -0.0)) == 1.0


@pytest.mark.parametrize("value", [3, 3.0, np.int32(3)])
def test_whole_takes_whole_numbers(value):
    result = whole("place", value, at_least=1)
    assert type(result) is int
    assert result == 3


def test_whole_keeps_every_digit_of_a_large_seed():
    assert whole("place", 2**127 + 1, at_least=0) == 2**127 + 1


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (2.5, "place = 2.5: must be a whole number (contacts)"),
        (0, "place = 0: must be a finite number at least 1 and at most 9 (contacts)"),
        (10, "place = 10: must be a finite number at least 1 and at most 9 (contacts)"),
        (math.inf, "place = inf: must be a finite number at least 1 and at most 9 (contacts)"),
        ("3", "place = '3': must be a number at least 1 and at most 9 (contacts)"),
    ],
)
def test_whole_names_place_value_and_mitigation(value, message):
    with pytest.raises(InputError) as caught:
        whole("place", value, at_least=1, at_most=9, hint="contacts")
    assert str(caught.value) == message


def test_instance_takes_kinds_tuples_and_unions():
    instance("place", 1, int, "a number")
    instance("place", 1, (int, str), "a number")
    instance("place", 1, int | str, "a number")
    with pytest.raises(InputError, match=r"^place = \[\]: must be a number$"):
        instance("place", [], int | str, "a number")


def test_an_input_error_is_a_value_error():
    assert issubclass(InputError, ValueError)


def test_mistakes_are_told_as_far_as_a_line_reaches():
    assert together(["a: is missing", "b = 1: must be 2"]) == "a: is missing; b = 1: must be 2"
    assert together(["a" * 320, "b", "c", "d"]) == f"{'a' * 320}; b; and 2 more"
    assert together(["a" * 321, "b"]) == f"{'a' * 321}; and 1 more"
    assert together([]) == ""


def test_nothing_of_a_message_steers_the_terminal():
    said = str(InputError("a\x1b[2J\x07\x9b\u202e\u2028b = 1"))
    assert said.isprintable()
    assert said.startswith("a")


def test_a_span_of_time_is_no_number():
    for check in (number, partial(whole, at_least=0)):
        with pytest.raises(InputError, match=r"^here = .*: must be a number"):
            check("here", np.timedelta64(1, "s"))


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda rig: ss.cycle_branch(rig, "velocity", between=(0.6, 1.0), tolerance="1 m/s"), "tolerance = '1 m/s'"),
        (lambda rig: ss.bistable_range(rig, "velocity", between=(0.6, 1.0), tolerance=[0.1]), "tolerance = "),
        (lambda rig: ss.is_sustained(rig, patience=True), "patience = True"),
        (lambda rig: ss.velocity_step(rig, before=1, after=2, distance=1, stiffness=xr.DataArray([1, 2])), "stiffn"),
        (
            lambda rig: ss.stability_map(rig, over=("velocity", "load"), values=([1], [1])),
            "use one of stiffness",
        ),
    ],
)
def test_arguments_of_the_wrong_kind_are_refused_in_one_line(call, told):
    interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
    rig = ss.Rig(interface, ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4), ss.constant(velocity=1.0))
    with pytest.raises(ss.InputError, match=told):
        call(rig)


def test_a_system_without_locks_of_files_is_told_at_the_import():
    script = "import sys; sys.platform = 'win32'\ntry: import stickslip\nexcept ImportError as error: print(error)"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert "under Windows, use WSL" in told
