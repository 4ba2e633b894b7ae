"""Rigid motion: Fig. 1, effective and critical stiffness, three equal solvers."""

import math
from dataclasses import replace

import numpy as np
import pytest
import reference

import stickslip as ss
from stickslip.model.distributions import SteadyState
from stickslip.rigid import Renewal, effective_stiffness, steepest_fall

AT_REST = ss.Gaussian(mean=0.0, std=0.0)


def gaussian(initial, thresholds, delay=0.0):
    initial = ss.Gaussian(mean=0.0, std=initial)
    thresholds = ss.Gaussian(mean=1.0, std=thresholds)
    return ss.Interface(thresholds=thresholds, initial=initial, delay=ss.Delay(delay))


def test_static_friction_is_the_largest_force_and_the_critical_stiffness_its_steepest_fall():  # noqa: E501
    stiffness = ss.critical_stiffness(gaussian(0.01, 0.1))
    assert stiffness == pytest.approx(reference.CRITICAL_STIFFNESS, abs=0.003)
    force, place = ss.static_friction(gaussian(0.01, 0.1, delay=0.5))
    assert force == pytest.approx(0.79560, abs=1e-4)
    assert place == pytest.approx(0.8435, abs=2e-3)


@pytest.mark.eq(1, 4)
def test_started_in_the_steady_state_the_force_is_constant(distribution):
    """Claim 3, and K* = 0 (claim 5)."""
    initial = SteadyState(thresholds=distribution)
    rig = ss.Interface(thresholds=distribution, initial=initial)
    run = ss.rigid_slide(rig, 5.0)
    # The start is a sum over nodes. Where the survival starts with an infinite slope no
    # polynomial fits it; where the distribution jumps, each node breaks with a kink in
    # the force and a jump in its slope.
    jumps = any(knot > 0 for knot in distribution.knots)
    slack = 2e-4 if jumps or float(distribution.density(1e-9)) > 5 else 5e-5
    friction = distribution.moment(2) / (2 * distribution.moment(1))
    np.testing.assert_allclose(run["friction_force"], friction, rtol=slack)
    assert ss.critical_stiffness(rig) == 0.0
    steepest = np.max(effective_stiffness(rig, np.linspace(0, 3, 301)))
    assert steepest <= (0.05 if jumps else 100 * slack)


@pytest.mark.eq(8)
def test_critical_stiffness_without_reattachment():
    """From a delta start: max of X P_c(X) - J_c(X), whatever the delay."""
    distribution = ss.Gaussian(mean=1.0, std=0.1)
    X = np.linspace(0.9, 1.2, 30_001)
    expected = np.max(X * distribution.density(X) - distribution.survival(X))
    rig = ss.Interface(thresholds=distribution, initial=AT_REST)
    found = ss.critical_stiffness(rig, reattachment=False)
    assert found == pytest.approx(expected, abs=1e-5)
    at_once = ss.critical_stiffness(rig)
    late = ss.critical_stiffness(replace(rig, delay=ss.Delay(0.7)))
    assert late == at_once < expected


RECTANGLES = (0.6, 1.1), (0.8, 1.2), (0.9, 1.0), (0.55, 1.0), (1.5, 1.7)


@pytest.mark.parametrize(("low", "high"), RECTANGLES)
@pytest.mark.eq(8)
def test_critical_stiffness_of_rectangular_thresholds(low, high):
    """x2/(x2-x1) - 1 from a delta start, until a contact breaks twice: x2 < 2 x1."""
    rig = ss.Interface(thresholds=ss.Uniform(low=low, high=high), initial=AT_REST)
    value, place = steepest_fall(rig)
    assert value == pytest.approx(high / (high - low) - 1, abs=1e-3)
    assert place == pytest.approx(high, abs=1e-6)


@pytest.mark.eq(8)
def test_a_second_generation_raises_the_critical_stiffness():
    """x2 > 2 x1: contacts re-attached at x1 break before X = x2 and add to the fall."""
    thresholds = ss.Uniform(low=0.4, high=1.4)
    interface = ss.Interface(thresholds=thresholds, initial=AT_REST)
    assert ss.critical_stiffness(interface) > 0.4 + 0.1


@pytest.mark.eq(7, 8)
def test_exponential_thresholds_never_let_the_force_fall():
    distribution = ss.Exponential(mean=0.8)
    rig = ss.Interface(thresholds=distribution, initial=AT_REST)
    assert ss.critical_stiffness(rig) == 0.0
    assert np.all(effective_stiffness(rig, np.linspace(0, 10, 50)) <= 1e-9)
    steady = replace(rig, initial=SteadyState(thresholds=distribution))
    force = ss.rigid_slide(steady, 5.0)["friction_force"]
    np.testing.assert_allclose(force, 0.8, rtol=1e-9)


def test_the_critical_stiffness_is_the_largest_effective_one(distribution):
    rig = ss.Interface(thresholds=distribution, initial=ss.Gaussian(mean=0.0, std=0.02))
    value, place = steepest_fall(rig)
    X = np.linspace(0, min(2 * distribution.support[1], 4.0), 401)
    assert np.max(effective_stiffness(rig, X)) <= value + 1e-3
    if value > 0:
        assert effective_stiffness(rig, place)[0] == pytest.approx(value, abs=2e-3)


@pytest.mark.parametrize("velocity_delay", [0.0, 0.3])
@pytest.mark.eq(7)
def test_effective_stiffness_is_minus_the_slope(distribution, velocity_delay):
    """The effective stiffness is minus the slope of the force."""
    initial = ss.Gaussian(mean=0.05, std=0.05)
    delay = ss.Delay(velocity_delay)
    rig = ss.Interface(thresholds=distribution, initial=initial, delay=delay)
    run = ss.rigid_slide(rig, 2.0, method=Renewal(1_024))
    names = "displacement", "friction_force", "stiffness"
    X, F, slope = (run[name].to_numpy() for name in names)
    h = X[1]
    scale = max(1.0, float(np.max(np.abs(slope))))
    travelled = np.append(0.0, np.cumsum(0.5 * h * (slope[1:] + slope[:-1])))
    # Second order in h, first order at each jump of the slope.
    np.testing.assert_allclose(F - F[0], travelled, atol=2 * h * scale)
    stiffness = effective_stiffness(rig, X[1::100])
    np.testing.assert_allclose(stiffness, -slope[1::100], atol=5e-3 * scale)
    if not any(knot > 0 for knot in distribution.knots):
        differences = (F[2:] - F[:-2]) / (2 * h)
        error = np.abs(differences - slope[1:-1]) / scale
        assert np.quantile(error, 0.97) < 1e-3  # except the corner at X = v tau


METHODS = ss.MasterEquation(rtol=1e-4), ss.Contacts(4_000, seed=1)


@pytest.mark.parametrize("method", METHODS, ids=["m", "c"])
def test_other_methods_agree_with_the_renewal(distribution, method):
    """They agree for every distribution of thresholds."""
    initial = ss.Uniform(low=0.0, high=0.04)
    rig = ss.Interface(thresholds=distribution, initial=initial, delay=ss.Delay(0.2))
    exact = ss.rigid_slide(rig, 3.0, method=Renewal(3_000))
    run = ss.rigid_slide(rig, 3.0, method=method)
    # the force of one contact lies between 0 and its threshold
    if isinstance(method, ss.Contacts):
        std = np.array([math.sqrt(distribution.moment(2)), 0.5])
        slack = 6 * std / math.sqrt(4_000)
    # with a singular start of the distribution a finite fraction of newborns breaks
    # within one step of 1/400
    else:
        early = float(1 - distribution.survival(1 / 400))
        slack = np.full(2, 1e-3 + early * distribution.moment(1))
    assert np.max(np.abs(run["friction_force"] - exact["friction_force"])) < slack[0]
    assert np.max(np.abs(run["attached"] - exact["attached"])) < slack[1]


SOLVERS = Renewal(3_000), ss.MasterEquation(), ss.Contacts(3_000, seed=2)


@pytest.mark.parametrize("method", SOLVERS, ids=["r", "m", "c"])
def test_only_velocity_times_delay_counts(method):
    late, soon = (gaussian(0.05, 0.2, delay=delay) for delay in (0.4, 0.1))
    slow = ss.rigid_slide(late, 3.0, velocity=0.5, method=method)["friction_force"]
    fast = ss.rigid_slide(soon, 3.0, velocity=2.0, method=method)["friction_force"]
    np.testing.assert_allclose(slow, fast, atol=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.25])
def test_equal_thresholds_make_a_sawtooth(delay):
    """Its period is a threshold plus the displacement during the delay."""
    thresholds = ss.Gaussian(mean=1.0, std=0.0)
    same = ss.Interface(thresholds=thresholds, initial=AT_REST, delay=ss.Delay(delay))
    run = ss.rigid_slide(same, 7.4, velocity=2.0, method=ss.Contacts(9))
    phase = run["displacement"].to_numpy() % (1.0 + 2.0 * delay)
    jumps = np.array([0.0, 1.0, 1.0 + 2.0 * delay])
    away = np.all(np.abs(phase[:, None] - jumps) > 1e-6, axis=1)
    expected = np.where(phase < 1, phase, 0)[away]
    force = run["friction_force"].to_numpy()[away]
    np.testing.assert_allclose(force, expected, atol=1e-12)


@pytest.mark.slow
def test_narrow_uniform_thresholds_have_the_static_friction_of_any_as_narrow():
    half = 0.002 * math.sqrt(3.0)
    uniform = ss.Uniform(low=1.0 - half, high=1.0 + half)
    narrow = uniform, ss.Gaussian(mean=1.0, std=0.002)
    interfaces = (ss.Interface(thresholds=thresholds) for thresholds in narrow)
    uniform, gaussian = (ss.static_friction(each)[0] for each in interfaces)
    assert uniform == pytest.approx(gaussian, rel=1e-3)
