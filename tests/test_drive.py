"""Drives are values: made, joined, ended early, looked at."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip.errors import InputError
from stickslip.model import Interface, Rig, Slider
from stickslip.model.distributions import Gaussian
from stickslip.model.drive import Drive, ForceAbove, ForceBelow, Piece, Travel, constant, ramp

velocities = st.floats(-10, 10)
durations = st.floats(1e-3, 1e3)
drives = st.lists(st.builds(ramp, velocities, velocities, durations), min_size=1, max_size=5)


def joined(parts):
    whole = parts[0]
    for part in parts[1:]:
        whole = whole.then(part)
    return whole


def test_a_velocity_is_linear_within_a_piece_and_constant_beyond_both_ends():
    assert constant(velocity=2.0, duration=3.0) == ramp(2.0, 2.0, duration=3.0)
    assert [constant(velocity).duration for velocity in (3.0, -0.5)] == [40.0, 240.0]  # far enough unless told
    times = np.array([[-1.0, 0.0, 1.0], [1.5, 2.0, 3.0]])
    np.testing.assert_array_equal(ramp(1.0, 4.0, duration=2.0).velocity(times), [[1.0, 1.0, 2.5], [3.25, 4.0, 4.0]])


@given(drives, st.floats(0.01, 0.99), st.data())
def test_joined_pieces_keep_their_order_and_their_velocities(parts, share, data):
    drive = joined(parts)
    assert drive.duration == pytest.approx(sum(part.duration for part in parts), rel=1e-14)
    assert drive.pieces == tuple(piece for part in parts for piece in part.pieces)
    i = data.draw(st.integers(0, len(parts) - 1))
    begin = sum(part.duration for part in parts[:i])
    piece = parts[i].pieces[0]
    expected = piece.start + share * (piece.end - piece.start)
    # One rounding of the time, seen through the acceleration.
    slack = 1e-12 + 4e-16 * (begin + piece.duration) * abs(piece.acceleration) * 4
    assert drive.velocity(begin + share * piece.duration) == pytest.approx(expected, abs=slack)


def test_a_faster_drive_goes_the_same_way():
    drive = constant(1.0, 2.0).then(ramp(1.0, -0.5, duration=3.0))
    quick, t = drive.faster(4.0), np.linspace(0.0, 5.0, 41)
    assert quick.duration == drive.duration / 4.0
    np.testing.assert_allclose(quick.velocity(t / 4.0), 4.0 * drive.velocity(t), atol=1e-12)
    rig = Rig(Interface(thresholds=Gaussian(mean=1.0, std=0.1)), Slider(stiffness=1.0, mass=0.1, damping=1.0), drive)
    assert rig.replace(velocity=4.0).drive == quick


def test_until_ends_the_last_piece_only():
    drive = constant(1, 1).then(constant(2, 2)).until(Travel(3.0))
    assert [piece.until for piece in drive.pieces] == [None, Travel(3.0)]
    assert drive.until(ForceBelow(0.5)).pieces[-1].until == ForceBelow(0.5)
    assert drive.then(constant(1, 1)).pieces[1].until == Travel(3.0)


def test_drives_are_values():
    drive = ramp(0.1, 3.0, duration=200).then(ramp(3.0, 0.1, duration=200)).until(ForceAbove(0.9))
    again = ramp(0.1, 3, 200).then(ramp(3, 0.1, 200)).until(ForceAbove(0.9))
    assert drive == again
    assert hash(drive) == hash(again)
    assert drive != again.until(ForceAbove(0.8))
    assert pickle.loads(pickle.dumps(drive)) == drive
    assert replace(drive.pieces[0], end=2.0) == Piece(start=0.1, end=2.0, duration=200.0)
    with pytest.raises(AttributeError):
        drive.pieces = ()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: constant(float("nan"), 1), r"^drive velocity = nan: must be a finite number"),
        (lambda: constant(float("inf"), 1), r"^drive velocity = inf: must be a finite number"),
        (lambda: ramp(1, "2", 1), r"^drive velocity = '2': must be a number"),
        (lambda: constant(1, 0), r"^drive duration = 0: must be a finite number above 0"),
        (lambda: constant(1, -2), r"^drive duration = -2: must be .* above 0"),
        (lambda: constant(1, float("inf")), r"^drive duration = inf: must be a finite number above 0"),
        (lambda: constant(1, "long"), r"^drive duration = 'long': must be a number above 0"),
        (lambda: constant(0), r"^constant: velocity = 0 needs a duration"),
        (lambda: constant(1, 1).until(3.0), r"^drive until = 3\.0: must be Travel, ForceAbove or ForceBelow"),
        (lambda: constant(1, 1).then(3.0), r"^Drive\.then = 3\.0: must be a drive, made with constant\(\) or ramp\(\)"),
        (lambda: Drive(()), r"^Drive\.pieces: must hold at least one piece; make one with constant\(\) or ramp\(\)"),
        (lambda: Drive([Piece(start=1, end=1, duration=1)]), r"^Drive\.pieces = \[.*: must be a tuple of pieces"),
        (lambda: Drive((1.0,)), r"^Drive\.pieces\[0\] = 1\.0: must be a piece"),
        (lambda: Travel(0), r"^Travel\.distance = 0: must be .* above 0 \(in x_s\)"),
        (lambda: Travel(-1), r"^Travel\.distance = -1: must be .* above 0"),
        (lambda: ForceAbove(float("nan")), r"^ForceAbove\.force = nan: must be a finite number \(in f_s\)"),
        (lambda: ForceBelow("low"), r"^ForceBelow\.force = 'low': must be a number \(in f_s\)"),
    ],
)
def test_bad_drives(make, message):
    with pytest.raises(InputError, match=message):
        make()
