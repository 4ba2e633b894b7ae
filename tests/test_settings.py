"""Values that the command line sets in a rig file."""

import pytest

import stickslip as ss
from stickslip.io.settings import read_rig_with


@pytest.mark.parametrize(
    ("setting", "name", "value"),
    [
        ("drive.velocity=2 mm/s", "velocity", 2e-3),
        ('drive.velocity = "2 mm/s"', "velocity", 2e-3),
        ("slider.mass=500 g", "mass", 0.5),
        # in place of the damping ratio of the file
        ("slider.damping=20 1/s", "damping", 20.0),
        ("slider.damping=900 N*s/m", "damping", 300.0),  # divided by the mass, 3 kg
        ("interface.thresholds.std=0.3", "std", 0.3),
    ],
)
def test_a_setting_is_what_the_file_would_say(setting, name, value):
    rig = read_rig_with("brake_pad", [setting])
    assert rig.value(name) == pytest.approx(value)


def test_settings_leave_all_else_and_none_leave_the_rig():
    given = ss.read_rig("brake_pad")
    assert read_rig_with("brake_pad", []) == given
    changed = read_rig_with("brake_pad", ["drive.velocity=2 mm/s"])
    # natural numbers differ, since the unit of time is the drive's
    for name in ("mass", "stiffness", "damping", "delay", "load"):
        assert changed.value(name) == pytest.approx(given.value(name))


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("drive.velocity", "must be a key of the file and its value"),
        ("=2", "must be a key of the file and its value"),
        ("name.x=1", "'name' is no table"),
        ("drive.velocity=2", "has no unit"),
        ("slider.mas=3 kg", "did you mean 'mass'"),
    ],
)
def test_a_setting_that_cannot_be_is_refused_in_one_line(setting, message):
    with pytest.raises(ss.InputError, match=message) as refused:
        read_rig_with("brake_pad", [setting])
    assert "\n" not in str(refused.value)


def test_a_missing_file_names_the_one_beside_it(tmp_path):
    (tmp_path / "axis.toml").touch()
    with pytest.raises(ss.InputError, match=r"did you mean 'axis\.toml'\?"):
        ss.read_rig(tmp_path / "axis.tml")
