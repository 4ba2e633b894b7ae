"""Units make no difference: all lengths times one factor, all times times another."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from other_units import rescaled_rig

import stickslip as ss
from stickslip.simulation import estimate

INTERFACE = ss.Interface(
    thresholds=ss.Gaussian(mean=1.0, std=0.1),
    initial=ss.Gaussian(mean=0.0, std=0.02),
    delay=ss.Delay(0.1),
)
SLIDER = ss.Slider(stiffness=0.3, mass=1e-3, damping=3.0)
DRIVE = ss.constant(2.0, 30.0)
RIG = ss.Rig(INTERFACE, SLIDER, DRIVE, method=ss.Contacts(500, seed=3))


def slow(*units):
    return pytest.param(*units, marks=pytest.mark.slow)


UNITS = pytest.mark.parametrize(
    ("length", "time"), [slow(2e-3, 1e3), (4.0, 0.25), slow(900.0, 1e-6)]
)


@UNITS
def test_theory_has_no_length_or_time_of_its_own(length, time):
    there = rescaled_rig(RIG, length, time)
    stiffness = ss.critical_stiffness(RIG.interface)
    assert ss.critical_stiffness(there.interface) == pytest.approx(stiffness, rel=1e-9)
    forces = [length * force for force in ss.static_friction(RIG.interface)]
    assert ss.static_friction(there.interface) == pytest.approx(forces, rel=1e-9)
    assert ss.stability.count_unstable(there) == ss.stability.count_unstable(RIG)
    growth = ss.stability.growth_rate(RIG)
    assert abs(ss.stability.growth_rate(there) * time - growth) < 1e-9 * abs(growth)
    sizes = {"velocity": length / time, "stiffness": 1.0, "delay": time}
    for name, size in (sizes | {"mass": time**2}).items():
        here = [edge.value * size for edge in ss.critical(RIG, name).edges]
        assert here
        found = [edge.value for edge in ss.critical(there, name).edges]
        assert found == pytest.approx(here, rel=1e-8)


@UNITS
@pytest.mark.parametrize("method", [ss.Contacts(500, seed=3), ss.MasterEquation()])
def test_runs_have_no_length_or_time_of_their_own(method, length, time):
    both = RIG, rescaled_rig(RIG, length, time)
    rigs = (replace(rig, method=method) for rig in both)
    here, there = (ss.simulate(rig) for rig in rigs)
    assert there.sizes == here.sizes
    # Contacts break one by one, exactly; the master equation may deviate by its
    # tolerance.
    exact = isinstance(method, ss.Contacts)
    first = slice(None, None if exact else 200)
    scaled = there["spring_force"].to_numpy() / length
    gap = np.abs(scaled - here["spring_force"].to_numpy())[first]
    assert gap.max() < (1e-5 if exact else 0.01)
    seen = ss.regime(there)
    known = ss.regime(here)
    assert seen.kind == known.kind == "stick-slip"
    assert seen.cycles == known.cycles
    assert seen.period == pytest.approx(time * known.period, rel=1e-3)
    assert seen.drop == pytest.approx(length * known.drop, rel=2e-3)
    assert ss.drops(there).sizes == ss.drops(here).sizes


@UNITS
@pytest.mark.parametrize(
    "mechanism",
    [
        {},
        {"sliding_force": 0.3},
        {"activation": ss.Bell(width=0.02, attempts=1e4)},
        {"ageing": ss.LogarithmicGrowth(slope=0.02, time=1e-3)},
        {"ageing": ss.model.TabulatedGrowth((0.01, 1.0), (0.7, 1.0))},
        {"ageing": ss.Langevin(rate=1.0), "delay": ss.Delay(0.0)},
    ],
)
def test_no_mechanism_has_a_length_or_time_of_its_own(mechanism, length, time):
    rig = replace(RIG, interface=replace(RIG.interface, **mechanism))
    runs = map(ss.simulate, (rig, rescaled_rig(rig, length, time)))
    here, there = (run["spring_force"].to_numpy() for run in runs)
    # rounding grows later, as contacts break
    assert np.abs(there[:300] / length - here[:300]).max() < 1e-9
    # Where contacts break by chance, rounding gives another run: four errors of a
    # difference of means, .3 % each.
    scatter = 4.0 * math.sqrt(2.0) * 3e-3 if "activation" in mechanism else 1e-3
    assert there.mean() / length == pytest.approx(here.mean(), rel=scatter)
    there = rescaled_rig(rig, length, time)
    few = (replace(each, method=ss.Contacts(500)) for each in (rig, there))
    seconds = [estimate(each).seconds for each in few]
    # steps of the master equation depend on an error in f_s
    assert seconds[1] == pytest.approx(seconds[0], rel=1e-6)
    force = ss.kinetic_friction(there.interface, there.velocity)
    expected = length * ss.kinetic_friction(rig.interface, rig.velocity)
    assert force == pytest.approx(expected, rel=1e-9)
    assert ss.stability.count_unstable(there) == ss.stability.count_unstable(rig)
    s = np.array([0.6j, 4.0j, 2.0 + 10.0j])
    kappa = [
        ss.stability.dynamic_stiffness(each.interface, each.velocity, s / by)
        for each, by in ((rig, 1), (there, time))
    ]
    np.testing.assert_allclose(kappa[1], kappa[0], rtol=1e-6)
    smooth = replace(rig, slider=replace(SLIDER, stiffness=30.0, damping=300.0))
    both = smooth, rescaled_rig(smooth, length, time)
    noise = [ss.stability.contact_noise(each).spring_force for each in both]
    assert noise[1] == pytest.approx(length * noise[0], rel=1e-6)


@UNITS
@pytest.mark.parametrize("method", [ss.Contacts(200, 1), ss.QuasiStatic(200, 1)])
def test_elastic_sliders_have_no_length_or_time_of_their_own(method, length, time):
    body = {"blocks": 6, "coupling": 2.0, "mass": 1e-2, "damping": 1.0}
    bar = ss.Chain(**body, viscosity=0.01, leaf=0.1)
    rig = replace(RIG, slider=bar, drive=ss.constant(1.0, 4.0), method=method)
    both = rig, rescaled_rig(rig, length, time)
    runs = [ss.simulate(each, long=True) for each in both]
    force = [run["spring_force"].to_numpy() for run in runs]
    assert force[1] == pytest.approx(length * force[0], rel=1e-9, abs=1e-9 * length)


@pytest.mark.parametrize(("force", "time"), [(1e-6, 1e3), (1e5, 1e-4)])
@pytest.mark.parametrize("velocity", [0.5, 2.0, 40.0])
def test_a_trace_is_read_alike_in_any_unit(velocity, force, time):
    run = ss.simulate(replace(RIG, drive=ss.constant(velocity, 60.0 / velocity)))
    rng = np.random.default_rng(7)
    noise = rng.normal(scale=1e-3, size=run.sizes["time"])
    noisy = run["spring_force"].to_numpy() + noise

    def read(force, time):
        variables = {"spring_force": ("time", force * noisy)}
        data = xr.Dataset(variables, {"time": time * run["time"].to_numpy()})
        return ss.regime(data), ss.drops(data)

    here, slips = read(1.0, 1.0)
    there, found = read(force, time)
    assert (there.kind, there.cycles) == (here.kind, here.cycles)
    assert there.period == pytest.approx(time * here.period, rel=1e-6, nan_ok=True)
    assert there.peak_to_peak == pytest.approx(force * here.peak_to_peak, rel=1e-6)
    assert there.slip_phase == pytest.approx(here.slip_phase, rel=1e-6, nan_ok=True)
    assert found.sizes == slips.sizes
    expected = force * slips["drop"].to_numpy()
    assert found["drop"].to_numpy() == pytest.approx(expected, rel=1e-6)


@pytest.fixture(scope="module")
def answer():
    return ss.predict(RIG)


@pytest.mark.takes(5)
@UNITS
def test_an_answer_has_no_length_or_time_of_its_own(answer, length, time):
    there = rescaled_rig(RIG, length, time)
    assert estimate(there).seconds == pytest.approx(estimate(RIG).seconds, rel=1e-9)
    here = answer
    found = ss.predict(there)

    def linear(answer, rig):
        limits = [(m.lower, m.parameter) for m in answer.margins]
        limits += [(m.upper, m.parameter) for m in answer.margins]
        return [
            np.nan if end is None else end / rig.value(name) for end, name in limits
        ]

    expected = pytest.approx(linear(here, RIG), rel=1e-6, nan_ok=True)
    assert linear(found, there) == expected
    sizes = {mitigation.parameter: mitigation.size for mitigation in here.mitigations}
    assert sizes
    # Rounding gives other runs of the same contacts: twice the precision of the search,
    # .05.
    changes = {each.parameter: each.size for each in found.mitigations}
    assert changes == pytest.approx(sizes, abs=0.1)
