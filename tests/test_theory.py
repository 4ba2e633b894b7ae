"""Closed forms against quadrature and against their limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import lambertw

import stickslip as ss
from stickslip.paper.cases import FIG4, FIG7
from stickslip.theory import attached_fraction, effective_potential, slip_displacement

NARROW = ss.Gaussian(mean=0.0, std=0.01)
TENTH = ss.Gaussian(mean=1.0, std=0.1)


@pytest.mark.parametrize(("std", "expected"), [(0.1, 0.50500), (0.3, 0.54498)])
def test_kinetic_friction_falls_by_the_share_of_attached_contacts(std, expected):
    # .54498 is the truncated distribution's: the plain Gaussian gives .54500
    interface = replace(FIG4.interface, thresholds=ss.Gaussian(mean=1.0, std=std))
    v = np.geomspace(0.01, 100, 9)
    at_once = replace(interface, delay=ss.Delay(0.0))
    assert ss.kinetic_friction(at_once, 7.0) == pytest.approx(expected, abs=5e-6)
    path = interface.threshold_distribution.moment(1)
    falls = ss.kinetic_friction(interface) / (1 + 0.2 * v / path)
    assert ss.kinetic_friction(interface, v) == pytest.approx(falls, rel=1e-12)


@pytest.mark.eq(10)
def test_attached_fraction():
    # at vbar = xbar/tau_d = 5 half of the contacts are attached
    assert attached_fraction(FIG4.interface, 5.0) == pytest.approx(0.5, rel=1e-12)
    assert attached_fraction(FIG4.interface, 0.0) == 1.0
    delay = ss.RandomDelay(mean=0.2, std=0.12)
    random = replace(FIG4.interface, delay=delay)
    expected = 1 / (1 + 3.0 * delay.moment(1))
    assert attached_fraction(random, 3.0) == pytest.approx(expected, rel=1e-12)
    assert attached_fraction(NEVER, 1.0) == 0.0


KINDS = [{"thresholds": TENTH}, {"areas": ss.model.Areas(TENTH)}]
KINDS += [{"areas": ss.model.Areas(TENTH, kept=True)}]


@pytest.mark.parametrize("contacts", KINDS)
def test_contacts_that_never_come_back_slide_with_the_sliding_force(contacts):
    gone = ss.Interface(**contacts, delay=ss.Delay(math.inf), sliding_force=0.3)
    assert ss.kinetic_friction(gone, 1.0) == 0.3


@pytest.mark.eq(14, 17)
@pytest.mark.parametrize("rate", [1.0, 1.5])
def test_friction_of_ageing_thresholds_depends_on_velocity_over_rate_squared(rate):
    thresholds = FIG4.interface.thresholds
    ageing = ss.Interface(thresholds=thresholds, ageing=ss.Langevin(rate=rate))
    # Known from independent solvers of the kinetic equation, to .3 %.
    force = ss.kinetic_friction(ageing, rate**2 * np.array([0.1, 0.5, 1.0, 5.0]))
    np.testing.assert_allclose(force, [0.4677, 0.3756, 0.1243, 0.00310], rtol=3e-3)


NEVER = replace(FIG4.interface, delay=ss.Delay(math.inf))


def test_friction_of_growing_thresholds_has_the_limits_of_its_distributions():
    thresholds = FIG4.interface.thresholds
    interface = ss.Interface(thresholds=thresholds, initial=NARROW, delay=ss.Delay(0.2))
    aged = ss.kinetic_friction(interface, 0.5)
    # Growth that ends before any break, and growth that never begins.
    for ageing in (
        ss.ExponentialGrowth(rate=1e6),
        ss.LogarithmicGrowth(slope=0.0, time=1.0),
        ss.model.TabulatedGrowth((1e-9, 1e-8), (0.5, 1.0)),
    ):
        found = ss.kinetic_friction(replace(interface, ageing=ageing), 0.5)
        assert found == pytest.approx(aged, rel=1e-3)
    # Equal strengths: f(t) = t, held while v t < 1 - exp(-t).
    alike = ss.Uniform(low=1 - 1e-6, high=1 + 1e-6)
    equal = replace(interface, thresholds=alike, ageing=ss.ExponentialGrowth(rate=1.0))
    # a contact breaks when 0.5 t = 1 - exp(-t)
    life = 2.0 + float(lambertw(-2.0 * math.exp(-2.0)).real)
    expected = 0.25 * life**2 / (life + 0.2)
    assert ss.kinetic_friction(equal, 0.5) == pytest.approx(expected, rel=1e-3)


@pytest.mark.eq(11)
def test_mean_driving_force_balances_damping_and_friction():
    expected = 1e-4 * 200 + 0.505 / 1.2
    force = ss.theory.driving_force(FIG4.interface, FIG4.slider, 1.0)
    assert force == pytest.approx(expected, rel=1e-12)


@pytest.mark.eq(9)
def test_critical_stiffness_estimate():
    estimate = ss.theory.critical_stiffness_estimate(FIG4.interface)
    assert estimate == pytest.approx(1 / 0.11, rel=1e-9)
    initial = ss.Gaussian(mean=0.0, std=0.0)
    wide = ss.Interface(thresholds=ss.Uniform(low=0.5, high=1.5), initial=initial)
    estimate = ss.theory.critical_stiffness_estimate(wide)
    assert estimate == pytest.approx(math.sqrt(12), rel=1e-12)


@pytest.mark.eq(12)
def test_slip_displacement_solves_the_oscillator_to_its_order():
    # Eq. (12) is the start of v t + (v/Omega)(sinh - Omega t): a slider pushed by K
    # times its lead over the drive
    slider = FIG4.slider
    v = 2.0
    t = np.linspace(0, 0.3, 7) / slider.frequency
    exact = v / slider.frequency * np.sinh(slider.frequency * t)
    found = slip_displacement(slider, v, t)
    assert found == pytest.approx(exact, rel=0.3**4 / 120 * 1.1)
    # both readings: the drive's velocity, as printed, or the slider's; the formula is
    # linear in it
    expected = 3.5 * slip_displacement(slider, 1.0, 0.005)
    assert slip_displacement(slider, 3.5, 0.005) == pytest.approx(expected)
    with pytest.raises(ss.InputError, match="mass"):
        slip_displacement(ss.Slider(stiffness=1.0, mass=0.0, damping=0.0), 1.0, 0.1)


@pytest.mark.eq(5, 6)
def test_effective_potential_is_flat_where_forces_balance_and_bends_with_the_stiffness():  # noqa: E501
    slider = FIG7.slider
    drive = 1.3
    x = np.linspace(0, 2, 4001)
    force = 0.5 * np.sin(3 * x) ** 2
    potential = effective_potential(slider, x, force, drive)
    h = x[1]
    assert effective_potential(slider, x, force, 0.0)[0] == 0.0
    slope = (potential[2:] - potential[:-2]) / (2 * h)
    pulled = slider.stiffness * (drive - x[1:-1])
    assert -slope == pytest.approx(pulled - force[1:-1], abs=3 * h**2)
    bend = (potential[2:] - 2 * potential[1:-1] + potential[:-2]) / h**2
    expected = slider.stiffness + 1.5 * np.sin(6 * x[1:-1])
    assert bend == pytest.approx(expected, abs=20 * h**2 + 1e-8)
    for wrong in ((x + 1, force), (x, force[1:])):
        with pytest.raises(ss.InputError, match="must be of one shape"):
            effective_potential(slider, *wrong, drive)


@pytest.mark.parametrize("relative", [1.001e-12, 1e-6, 1.0, 0.999e6])
def test_in_the_range_of_speeds_the_force_of_ageing_contacts_is_one(relative):
    thresholds = ss.Gaussian(mean=1.0, std=0.1)
    ageing = ss.Interface(thresholds=thresholds, ageing=ss.Langevin(rate=2.0))
    assert 0.0 < ss.kinetic_friction(ageing, 4.0 * relative) < 0.5
