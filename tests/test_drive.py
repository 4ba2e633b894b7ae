"""Drives are values: made, joined, ended early, looked at."""

from functools import reduce

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip import simulate
from stickslip.model import Contacts, Interface, Rig, Slider
from stickslip.model.distributions import Gaussian
from stickslip.model.drive import Drive, ForceBelow, Travel, constant, ramp

velocities = st.floats(-10, 10)
durations = st.floats(1e-3, 1e3)
drives = st.lists(
    st.builds(ramp, velocities, velocities, durations), min_size=1, max_size=5
)


def test_a_drive_of_constant_velocity_goes_far_enough_unless_told():
    assert constant(velocity=2.0, duration=3.0) == ramp(2.0, 2.0, duration=3.0)
    assert [constant(velocity).duration for velocity in (3.0, -0.5)] == [40.0, 240.0]


@given(drives)
def test_joined_pieces_keep_their_order(parts):
    drive = reduce(Drive.then, parts)
    assert drive.duration == pytest.approx(
        sum(part.duration for part in parts), rel=1e-14
    )
    assert drive.pieces == tuple(piece for part in parts for piece in part.pieces)


def test_a_faster_drive_goes_the_same_way():
    drive = constant(1.0, 2.0).then(ramp(1.0, -0.5, duration=3.0))
    quick = drive.faster(4.0)
    assert quick == constant(4.0, 0.5).then(ramp(4.0, -2.0, duration=0.75))
    rig = Rig(
        Interface(thresholds=Gaussian(mean=1.0, std=0.1)),
        Slider(stiffness=1.0, mass=0.1, damping=1.0),
        drive,
    )
    assert rig.replace(velocity=4.0).drive == quick


@pytest.mark.parametrize("duration", [1e-12, 1e-15, 1e-19, 1e-22])
def test_a_ramp_in_no_time_moves_no_slider(duration):
    rig = Rig(
        Interface(thresholds=Gaussian(mean=1.0, std=0.1)),
        Slider(stiffness=1.0, mass=6.87, damping=1.9),
        ramp(1.0, -1.0, duration).then(constant(0.0, 0.1)),
        method=Contacts(200, seed=3),
    )
    assert abs(simulate(rig)["displacement"]).max() < 0.1


def test_until_ends_the_last_piece_only():
    drive = constant(1, 1).then(constant(2, 2)).until(Travel(3.0))
    assert [piece.until for piece in drive.pieces] == [None, Travel(3.0)]
    assert drive.until(ForceBelow(0.5)).pieces[-1].until == ForceBelow(0.5)
    assert drive.then(constant(1, 1)).pieces[1].until == Travel(3.0)
