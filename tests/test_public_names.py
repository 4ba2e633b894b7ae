"""What `import stickslip` gives, and what it leaves alone."""

import subprocess
import sys

import pytest
import reference

import stickslip as ss

HEAVY = ("numba", "xarray", "matplotlib", "pandas", "h5py", "h5netcdf", "rich", "scipy.stats")


def modules_after(code: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_importing_loads_nothing_heavy():
    assert not modules_after("import stickslip") & set(HEAVY)


def test_records_and_closed_forms_load_nothing_heavy():
    code = """
import stickslip as ss
rig = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.RandomDelay(mean=0.2, std=0.12))
ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4), ss.ramp(0.1, 3.0, duration=200), ss.Contacts(100)
ss.model.Scales(force=1, stretching=1), ss.kinetic_friction(rig, velocity=1.0)
"""
    assert not modules_after(code) & set(HEAVY)


def test_every_public_name_is_there():
    assert len(ss.__all__) == len(set(ss.__all__))
    assert ss.__all__ == sorted(ss.__all__)
    assert len(ss.__all__) <= 64  # a contract: the rest lives in its room
    for name in ss.__all__:
        assert getattr(ss, name) is not None
        assert name in dir(ss)


def test_public_things_say_what_they_are():
    for name in ss.__all__:
        assert getattr(ss, name).__doc__, name


def test_the_version_is_that_of_the_package():
    from importlib.metadata import version

    assert ss.__version__ == version("stickslip")


def test_a_name_that_does_not_exist():
    with pytest.raises(AttributeError, match="No stickslip attribute stick"):
        _ = ss.stick


def test_the_code_a_user_writes():
    """Section 5 of the design, with fewer contacts and shorter runs."""
    interface = ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=0.1), initial=ss.Gaussian(mean=0.0, std=0.01), delay=ss.Delay(0.2)
    )
    slider = ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4)
    run = ss.simulate(
        ss.Rig(interface, slider, ss.constant(velocity=1.0, duration=100)), method=ss.Contacts(1_000, seed=1)
    )
    assert ss.regime(run).kind == "stick-slip"
    events = ss.drops(run)
    assert {"start", "end", "drop", "peak_velocity"} <= set(events.variables)
    # With the delay some contacts are missing at the first maximum, .79560 without.
    assert 0.7 < float(ss.rigid_slide(interface, distance=6.0)["friction_force"].max()) < 0.79560
    assert ss.kinetic_friction(interface, velocity=1.0) == pytest.approx(1.01 / 2.4, rel=1e-12)
    assert ss.critical_stiffness(interface) == pytest.approx(reference.CRITICAL_STIFFNESS, abs=0.003)
    assert abs(complex(ss.stability.dynamic_stiffness(interface, velocity=1.0, s=2j))) > 0
    # At v = 1 and tau = .2 smooth sliding is unstable (its critical delay is .138218 at this damping).
    assert complex(ss.growth_rate(ss.Rig(interface, slider, ss.constant(1.0)))).real > 0
    assert ss.critical(ss.Rig(interface, slider, ss.constant(1.0)), "velocity", between=(0.1, 10))
    assert ss.stability.critical_spring(ss.Rig(interface, slider, ss.constant(1.0)))
    assert ss.stability.onset(ss.Rig(interface, slider, ss.constant(1.0)), "delay", between=(1e-3, 1e2))
    loop = ss.ramp(0.1, 3.0, duration=4).then(ss.ramp(3.0, 0.1, duration=4))
    assert loop.duration == 8
