"""Linear stability of smooth sliding: known numbers, limits, and counts by searches that know nothing of the code."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import InputError, UndecidedError
from stickslip.io.datasets import read_provenance
from stickslip.model import Bell, Delay, Interface, Langevin, RandomDelay, Rig, Slider, constant
from stickslip.model.distributions import (
    Empirical,
    Exponential,
    Gamma,
    Gaussian,
    LogNormal,
    SteadyState,
    Uniform,
    Weibull,
)
from stickslip.model.parameters import Parameter
from stickslip.paper.cases import FIG7
from stickslip.sliding import kinetic_friction, respond
from stickslip.sliding.transforms import transforms
from stickslip.stability import (
    PARAMETERS,
    STIFFNESS,
    VELOCITY,
    Modes,
    RadiationDamping,
    boundary,
    count_unstable,
    critical,
    critical_spring,
    dynamic_stiffness,
    growth_rate,
    onset,
    stability_map,
)
from stickslip.stability.impedances import impedance, natural_frequencies, poles
from stickslip.stability.neutral import neutral_frequencies
from stickslip.stability.roots import count_right_of

INTERFACE, SLIDER = FIG7.interface, FIG7.slider
NARROW = Gaussian(mean=0.0, std=0.001)

DISTRIBUTIONS = [
    Gaussian(mean=1.0, std=0.1),
    Gaussian(mean=1.0, std=0.3),
    Gaussian(mean=1.0, std=0.01),
    Uniform(low=0.6, high=1.5),
    Exponential(mean=1.0),
    Gamma(mean=1.0, std=0.25),
    LogNormal(mean=1.0, std=0.2),
    LogNormal(mean=1.0, std=0.6),
    Weibull(scale=1.0, shape=4.0),
    Weibull(scale=1.0, shape=0.8),
    Empirical.from_samples(np.random.default_rng(0).normal(1.0, 0.15, 500)),
    SteadyState(thresholds=Gaussian(mean=1.5, std=0.2)),
]
DELAYS = [
    Delay(0.1),
    Delay(1.3),
    RandomDelay(mean=0.2, std=0.12),
    RandomDelay(mean=0.2, std=0.12, negative="redraw"),
    RandomDelay(mean=0.2, std=0.12, negative="fold"),
    RandomDelay(mean=0.2, std=0.02),
]


def case(distribution, delay):
    return Interface(thresholds=distribution, initial=NARROW, delay=delay)


# ---------------------------------------------------------------- an independent model: formulas of a plain Gaussian


def by_hand(s, *, velocity, delay, stiffness, mass, damping, std=0.1):
    """Z + kappa for a Gaussian distribution so narrow that its cut at zero does not matter, as PHYSICS prints it."""
    q = s / velocity
    transform = np.exp(-q + 0.5 * (q * std) ** 2)
    slope = (-1 + q * std**2) * transform
    h = (1 - transform) / q**2 + slope / q
    kappa = -q * h * (1 - np.exp(-s * delay))
    kappa /= (1 + velocity * delay) * (1 - np.exp(-s * delay) * transform)
    return mass * s * s + mass * damping * s + stiffness + kappa


def roots_by_hand(left, **parameters):
    """Roots with Re s > left and Im s > 0, by Newton's method from every point of a fine grid."""

    def function(s):
        return by_hand(s, **parameters)

    # Far to the right the plain Gaussian's tail below zero, absent from the model, has roots of its own.
    rate, frequency = np.meshgrid(np.arange(left, 6, 0.25), np.arange(0.1, 250, 0.25))
    s = (rate + 1j * frequency).ravel()
    with np.errstate(all="ignore"):
        for _ in range(40):
            slope = (function(s + 1e-6) - function(s - 1e-6)) / 2e-6
            step = function(s) / slope
            s = s - step
        s = s[np.isfinite(s) & (np.abs(step) < 1e-9) & (s.real > left) & (s.real < 30) & (s.imag > 1e-3)]
    distinct = []
    for root in s[np.argsort(-s.real)]:
        if not any(abs(root - other) < 1e-6 for other in distinct):
            distinct.append(root)
    return np.array(distinct)


# ---------------------------------------------------------------- numbers


def test_first_critical_velocity_of_fig_7a():
    found = critical(Rig(INTERFACE, SLIDER, constant(1.0)), "velocity", between=(0.1, 1.9))
    assert len(found) == 1
    assert found[0].value == pytest.approx(1.388221, abs=1e-6)
    assert found[0].frequency == pytest.approx(7.265139, abs=1e-6)
    assert found[0].loses_stability
    assert not found[0].regains_stability
    assert "loses stability at 1.388221" in str(found)


@pytest.mark.parametrize(
    ("stiffness", "damping", "expected", "tolerance"),
    [
        (2.0, SLIDER.damping, 0.138218, 5e-7),
        (2.0, 200.0, 0.1455, 5e-5),
        # PHYSICS prints .2696. Four digits of the same formula by hand (below) are .2695; .2696 needs eta = 205.
        (5.0, 200.0, 0.2696, 2e-4),
    ],
)
def test_linear_critical_delays(stiffness, damping, expected, tolerance):
    slider = Slider(stiffness=stiffness, mass=1e-4, damping=damping)
    delay = onset(Rig(INTERFACE, slider, constant(1.0)), "delay", between=(1e-3, 1e2))
    assert delay == pytest.approx(expected, abs=tolerance)
    frequency = critical(Rig(INTERFACE, slider, constant(1.0)), "delay", between=(0.9 * delay, 1.1 * delay))[
        0
    ].frequency
    rest = by_hand(1j * frequency, velocity=1.0, delay=delay, stiffness=stiffness, mass=1e-4, damping=damping)
    assert abs(rest) < 1e-12


def test_critical_delay_times_velocity_depends_on_mass_times_velocity_squared_only():
    products = [
        v
        * onset(
            Rig(INTERFACE, Slider(stiffness=2.0, mass=1e-4 / v**2, damping=SLIDER.damping * v), constant(v)),
            "delay",
            between=(1e-3 / v, 1e2 / v),
        )
        for v in (0.3, 1.0, 4.0)
    ]
    assert products == pytest.approx([products[1]] * 3, rel=1e-11)


@pytest.mark.parametrize(
    ("std", "stick_slip", "smooth"), [(0.06, (1.0, 3.0), (0.25, 8.0)), (0.08, (1.2, 2.0), (0.36, 4.0, 6.0))]
)
def test_windows_of_random_delays(std, stick_slip, smooth):
    # Fig. 7b: the same speeds that runs of the contacts find on either side.
    interface = case(Gaussian(mean=1.0, std=0.1), RandomDelay(mean=0.2, std=std))
    loses, regains = critical(Rig(interface, SLIDER, constant(1.0)), "velocity", between=(0.1, 20)).edges
    assert loses.loses_stability
    assert regains.regains_stability
    assert all(loses.value < v < regains.value for v in stick_slip)
    assert not any(loses.value < v < regains.value for v in smooth)


def test_wide_random_delays_leave_no_window():
    interface = case(Gaussian(mean=1.0, std=0.1), RandomDelay(mean=0.2, std=0.12))
    found = critical(Rig(interface, SLIDER, constant(1.0)), "velocity", between=(0.2, 5))
    assert len(found) == 0
    assert found.searched == (0.2, 5)
    assert "stable all the way for velocity from 0.2 to 5" in str(found)


# ---------------------------------------------------------------- the dynamic stiffness


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=str)
@pytest.mark.parametrize("delay", DELAYS, ids=str)
def test_slow_shaking_sees_the_slope_of_kinetic_friction(distribution, delay):
    interface, v, d = case(distribution, delay), 0.7, 1e-4
    slope = (kinetic_friction(interface, v * (1 + d)) - kinetic_friction(interface, v * (1 - d))) / (2 * d * v)
    s = 1e-8 * np.array([1.0, 1j, 0.6 + 0.8j])
    assert dynamic_stiffness(interface, v, s) / s == pytest.approx(np.full(3, slope), rel=1e-6)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=str)
def test_without_delay_smooth_sliding_is_neutral(distribution):
    interface = case(distribution, Delay(0.0))
    assert np.all(dynamic_stiffness(interface, 1.0, np.array([1j, 3.0, 0.5 + 20j])) == 0)
    assert count_unstable(Rig(interface, SLIDER, constant(1.0))) == 0
    assert critical_spring(Rig(interface, SLIDER, constant(1.0))) == 0
    assert len(critical(Rig(interface, SLIDER, constant(1.0)), "velocity", between=(0.1, 10))) == 0
    assert growth_rate(Rig(interface, SLIDER, constant(1.0))).real == pytest.approx(-0.5 * SLIDER.damping, rel=1e-12)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=str)
def test_shape_function_is_the_integral_it_stands_for(distribution):
    # H = q Int x J_c(x) exp(-q x) dx, on both sides of the change from series to closed form
    distribution = distribution.positive()
    node, weight = np.polynomial.legendre.leggauss(20)
    # in x = y^5: distributions may rise steeply at zero
    edges = np.unique(
        np.concatenate(
            [np.linspace(0, distribution.support[1] ** 0.2, 300), [k**0.2 for k in distribution.knots if k > 0]]
        )
    )
    y = (edges[:-1, None] + 0.5 * np.diff(edges)[:, None] * (1 + node)).ravel()
    dx = (0.5 * np.diff(edges)[:, None] * weight).ravel() * 5 * y**4
    x = y**5
    survival = distribution.survival(x)
    for q in np.array([1e-4, 0.01j, 0.1, 0.3 + 0.2j, 0.49j, 0.51j, 1.0, 2 + 3j, 12j, 40j]):
        complement, shape = transforms(distribution, np.array([q]))
        assert shape[0] == pytest.approx(q * np.sum(dx * x * survival * np.exp(-q * x)), rel=2e-7, abs=1e-13)
        assert complement[0] == pytest.approx(q * np.sum(dx * survival * np.exp(-q * x)), rel=2e-7, abs=1e-13)


@pytest.mark.parametrize(
    "distribution",
    [
        LogNormal(mean=1.0, std=0.2),
        LogNormal(mean=1.0, std=1.0),
        Weibull(scale=1.0, shape=0.7),
        Weibull(scale=1.0, shape=5.0),
    ],
    ids=str,
)
def test_transforms_on_a_turned_path(distribution):
    q = np.array([0.3, 2.0, 1j, -3j, 1 + 10j, 0.2 - 40j, 200j])
    mean, slope = distribution.transform(q)
    assert mean == pytest.approx(distribution.laplace(q), abs=1e-12)
    assert slope == pytest.approx(distribution.laplace(q, 1), abs=1e-11)


def test_dynamic_stiffness_is_real_on_the_real_axis_and_symmetric_about_it():
    s = np.array([[0.4 + 2j, -0.3 + 5j], [1j, 30j]])
    kappa = dynamic_stiffness(INTERFACE, 1.0, s)
    assert kappa.shape == s.shape
    assert dynamic_stiffness(INTERFACE, 1.0, np.conj(s)) == pytest.approx(np.conj(kappa), rel=1e-13)
    assert dynamic_stiffness(INTERFACE, 1.0, 0.7).imag == 0
    assert dynamic_stiffness(INTERFACE, 1.0, 0) == 0
    by = [by_hand(each, velocity=1.0, delay=0.1, stiffness=0, mass=0, damping=0) for each in s.ravel()]
    assert kappa.ravel() == pytest.approx(np.array(by), rel=1e-12)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=str)
def test_whatever_the_delay_the_response_lies_in_one_disc(distribution):
    for delay in DELAYS:
        response = respond(case(distribution, delay))
        discs = response.discs(0.8, 16.0)
        kappa, centre = response.stiffness(0.8, 1j * discs.omega[::8]), discs.centre[::8]
        assert np.all(np.abs(kappa - centre) <= np.abs(centre) * (1 + 1e-6))


def test_no_answer_where_there_is_no_steady_sliding():
    gaussian = Gaussian(mean=1.0, std=0.1)
    with pytest.raises(InputError, match="never re-attach"):
        dynamic_stiffness(case(gaussian, Delay(math.inf)), 1.0, 1j)
    with pytest.raises(InputError, match="share one threshold"):
        growth_rate(Rig(case(Gaussian(mean=1.0, std=0.0), Delay(0.1)), SLIDER, constant(1.0)))
    warm = Interface(thresholds=gaussian, ageing=Langevin(rate=1.0), temperature=Bell(width=0.01, attempts=1e6))
    with pytest.raises(InputError, match="temperature"):
        critical_spring(Rig(warm, SLIDER, constant(1.0)))
    with pytest.raises(InputError, match="velocity = 0"):
        dynamic_stiffness(INTERFACE, 0.0, 1j)


def test_equal_thresholds_without_delay_are_neutral_too():
    equal = case(Gaussian(mean=1.0, std=0.0), Delay(0.0))
    assert count_unstable(Rig(equal, SLIDER, constant(1.0))) == 0
    assert growth_rate(Rig(equal, SLIDER, constant(1.0))).real == pytest.approx(-0.5 * SLIDER.damping)


def test_no_answer_where_the_transform_does_not_exist():
    heavy = case(LogNormal(mean=1.0, std=0.3), Delay(0.1))
    with pytest.raises(InputError, match="no transform"):
        dynamic_stiffness(heavy, 1.0, -0.1 + 1j)
    with pytest.raises(InputError, match="no transform"):
        dynamic_stiffness(case(Exponential(mean=1.0), Delay(0.1)), 2.0, -2.5)
    with pytest.raises(InputError, match="overflows"):
        dynamic_stiffness(INTERFACE, 1.0, -1e6)


# ---------------------------------------------------------------- counts and growth rates


@pytest.mark.parametrize(
    ("velocity", "delay", "stiffness", "mass", "damping"),
    [
        (1.0, 0.1, 2.0, 1e-4, 42.4),
        (1.0, 0.2, 2.0, 1e-4, 200.0),
        (3.0, 0.1, 2.0, 1e-4, 42.4),
        (2.0, 0.3, 0.3, 1e-3, 5.0),
        (0.5, 0.6, 4.0, 1e-2, 1.0),
    ],
)
def test_counts_and_growth_rates_against_a_search_by_hand(velocity, delay, stiffness, mass, damping):
    parameters = {"velocity": velocity, "delay": delay, "stiffness": stiffness, "mass": mass, "damping": damping}
    known = roots_by_hand(-0.3, **parameters)
    interface = case(Gaussian(mean=1.0, std=0.1), Delay(delay))
    slider = Slider(stiffness=stiffness, mass=mass, damping=damping)
    assert count_unstable(Rig(interface, slider, constant(velocity))) == 2 * np.sum(known.real > 0)
    root = growth_rate(Rig(interface, slider, constant(velocity)))
    assert root == pytest.approx(known[0], rel=1e-9)
    assert abs(by_hand(root, **parameters)) < 1e-11


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=str)
@pytest.mark.parametrize("seed", range(4))
def test_two_counts_and_the_growth_rate_agree(distribution, seed):
    rng = np.random.default_rng([seed, DISTRIBUTIONS.index(distribution)])
    delay = DELAYS[rng.integers(len(DELAYS))]
    interface, v = case(distribution, delay), 10 ** rng.uniform(-1, 1.3)
    stiffness, mass = 10 ** rng.uniform(-1.5, 1), 10 ** rng.uniform(-5, 0)
    slider = Slider(stiffness=stiffness, mass=mass, damping=math.sqrt(stiffness / mass) * 10 ** rng.uniform(-2, 0.5))
    count = count_unstable(Rig(interface, slider, constant(v)))
    response, z = respond(interface), impedance(slider)
    assert count_right_of(response, z, v, 1e-6 / response.cycle(v)) in (count, None)
    try:
        root = growth_rate(Rig(interface, slider, constant(v)))
    except UndecidedError:
        # Only a stable rig may have no slowest mode, and only with a distribution whose tail decays more slowly.
        assert count == 0
        assert math.isfinite(respond(interface).leftmost(v))
    else:
        assert (root.real > 0) == (count > 0)
        assert root.imag >= 0
        rest = impedance(slider)(np.array([root])) + dynamic_stiffness(interface, v, [root])
        assert abs(rest[0]) < 1e-8 * stiffness


def test_unstable_without_oscillation():
    # A spring so soft that a growing mode does not even oscillate
    interface = case(Gaussian(mean=1.0, std=0.034), RandomDelay(mean=0.24, std=0.36, negative="redraw"))
    slider = Slider(stiffness=0.032, mass=1.37e-5, damping=36.8)
    root = growth_rate(Rig(interface, slider, constant(0.48)))
    assert root.imag == 0
    assert root.real > 0
    assert count_unstable(Rig(interface, slider, constant(0.48))) == 24


def test_undecided_on_the_boundary_itself():
    (crossing,) = critical(Rig(INTERFACE, SLIDER, constant(1.0)), "velocity", between=(1.0, 1.9))
    with pytest.raises(UndecidedError, match=r"on its stability boundary .* at angular frequency 7\.26513"):
        count_unstable(Rig(INTERFACE, SLIDER, constant(crossing.value)))


def test_very_close_pairs_of_neutral_frequencies_are_seen():
    # At high speed a mode is unstable only within 1e-4 of a multiple of 2 pi/tau.
    for v in (313.2, 313.45, 314.0, 400.0):
        (neutral,) = neutral_frequencies(respond(INTERFACE), impedance(SLIDER), [v])
        assert neutral.unstable() == count_unstable(Rig(INTERFACE, SLIDER, constant(v))) == 4


# ---------------------------------------------------------------- critical values


@pytest.mark.parametrize("velocity", [0.3, 1.0, 1.4, 3.0, 30.0])
def test_critical_spring_divides_stable_from_unstable(velocity):
    spring = critical_spring(Rig(INTERFACE, SLIDER, constant(velocity)))
    for factor, stable in ((1 - 1e-6, False), (1 + 1e-6, True), (3, True)):
        count = count_unstable(Rig(INTERFACE, replace(SLIDER, stiffness=factor * spring), constant(velocity)))
        assert (count == 0) == stable


@pytest.mark.parametrize(
    ("parameter", "between"),
    [
        ("stiffness", (0.1, 50)),
        ("velocity", (0.1, 30)),
        ("mass", (1e-6, 10)),
        ("damping", (0.1, 1e5)),
        ("delay", (0.01, 0.5)),
        ("std", (0.05, 0.4)),
    ],
)
def test_each_parameter_changes_the_count_where_it_says_so(parameter, between):
    found = critical(Rig(INTERFACE, SLIDER, constant(3.0)), parameter, between=between)
    assert found.edges
    turned = next(known for known in PARAMETERS if known.name == parameter)
    start = Rig(INTERFACE, SLIDER, constant(3.0))
    for crossing in found:
        below, above = (
            count_unstable(here)
            for here in (turned.set(start, crossing.value * factor) for factor in (1 - 1e-7, 1 + 1e-7))
        )
        assert (below, above) == (crossing.unstable_below, crossing.unstable_above)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=str)
def test_critical_spring_with_every_distribution(distribution):
    interface = case(distribution, Delay(0.3))
    spring = critical_spring(Rig(interface, SLIDER, constant(1.0)))
    if spring == 0:
        assert count_unstable(Rig(interface, replace(SLIDER, stiffness=1e-3), constant(1.0))) == 0
    else:
        counts = [
            count_unstable(Rig(interface, replace(SLIDER, stiffness=f * spring), constant(1.0)))
            for f in (0.9999, 1.0001)
        ]
        assert counts == [2, 0]


def test_smooth_sliding_may_be_lost_and_regained_more_than_once():
    found = critical(Rig(INTERFACE, replace(SLIDER, stiffness=12.0), constant(1.0)), "velocity", between=(0.05, 1000))
    assert [c.loses_stability for c in found.edges] == [True, False, True, False]


def test_no_critical_delay_says_so_with_the_range():
    wide = case(Gaussian(mean=1.0, std=0.4), Delay(0.1))
    stiff = Slider(stiffness=50.0, mass=1e-4, damping=200.0)
    with pytest.raises(UndecidedError, match=r"stable all the way for delay from 0.01 to 5"):
        onset(Rig(wide, stiff, constant(1.0)), "delay", between=(0.01, 5.0))
    with pytest.raises(UndecidedError, match=r"no onset by delay.*unstable"):
        onset(Rig(INTERFACE, SLIDER, constant(1.0)), "delay", between=(0.2, 0.21))


def test_bad_questions():
    with pytest.raises(InputError, match="must be one of stiffness"):
        critical(Rig(INTERFACE, SLIDER, constant(1.0)), "speed", between=(1, 2))
    with pytest.raises(InputError, match=r"between\[1\] = 1"):
        critical(Rig(INTERFACE, SLIDER, constant(1.0)), "velocity", between=(2, 1))
    with pytest.raises(InputError, match="no mass"):
        critical(Rig(INTERFACE, lambda s: 2.0 + 0 * s, constant(1.0)), "mass", between=(1e-3, 1))
    with pytest.raises(InputError, match="no std to vary"):
        critical(Rig(case(Exponential(mean=1.0), Delay(0.1)), SLIDER, constant(1.0)), "std", between=(0.1, 1))
    with pytest.raises(InputError, match="two different parameters"):
        boundary(Rig(INTERFACE, SLIDER, constant(1.0)), over=("mass", "mass"), between=((1, 2), (1, 2)))
    with pytest.raises(InputError, match="values of stiffness = -1"):
        stability_map(Rig(INTERFACE, SLIDER, constant(1.0)), values=([-1.0, 2.0], [1.0]))
    with pytest.raises(InputError, match=r"Z\(0\)"):
        count_unstable(Rig(INTERFACE, lambda s: 1e-4 * s * s, constant(1.0)))
    with pytest.raises(InputError, match="puts energy in"):
        count_unstable(Rig(INTERFACE, lambda s: 2.0 - 0.01 * s + 1e-4 * s * s, constant(1.0)))


# ---------------------------------------------------------------- impedances


@pytest.mark.parametrize("velocity", [0.5, 1.4, 3.0])
def test_every_way_to_write_the_same_slider(velocity):
    k, m, eta = SLIDER.stiffness, SLIDER.mass, SLIDER.damping
    same = [
        SLIDER,
        RadiationDamping(stiffness=k, radiation=m * eta, mass=m),
        Modes(masses=(m,), stiffnesses=(k,), dampings=(eta,)),
        # two equal modes in series, each twice as heavy and stiff
        Modes(masses=(2 * m, 2 * m), stiffnesses=(2 * k, 2 * k), dampings=(eta, eta)),
        # the free body, pulled by the driving spring
        Modes(masses=(m,), stiffnesses=(0.0,), dampings=(eta,), stiffness=k),
        lambda s: k + m * eta * s + m * s * s,
    ]
    roots = [growth_rate(Rig(INTERFACE, rig, constant(velocity))) for rig in same]
    assert roots == pytest.approx([roots[0]] * len(same), rel=1e-9)
    counts = {count_unstable(Rig(INTERFACE, rig, constant(velocity))) for rig in same}
    assert len(counts) == 1
    springs = [critical_spring(Rig(INTERFACE, rig, constant(velocity))) for rig in same[:2]]
    assert springs == pytest.approx([springs[0]] * 2, rel=1e-10)


def test_a_spring_that_radiates_without_a_mass_decays_at_one_rate():
    assert natural_frequencies(RadiationDamping(stiffness=2.0, radiation=0.5, mass=0.0)) == pytest.approx([-4.0])


def test_receptances_of_modes_add():
    rig = Modes(masses=(1e-3, 2e-3, 5e-4), stiffnesses=(3.0, 40.0, 90.0), dampings=(2.0, 0.5, 11.0), stiffness=0.4)
    s = np.array([0.3 + 4j, 60j, -5 + 100j, 2.0])
    own = [m * s * (s + e) + k for m, k, e in zip(rig.masses, rig.stiffnesses, rig.dampings, strict=True)]
    assert rig(s) == pytest.approx(0.4 + 1 / sum(1 / each for each in own), rel=1e-12)
    assert np.abs(rig(natural_frequencies(rig))) == pytest.approx(np.zeros(6), abs=1e-9)
    assert np.all(np.abs(rig(poles(rig))) > 1e8)


def test_more_modes_against_a_polynomial_by_hand():
    rig = Modes(masses=(2e-3, 1e-3), stiffnesses=(3.0, 30.0), dampings=(1.0, 2.0))
    v = 2.0
    root = growth_rate(Rig(INTERFACE, rig, constant(v)))
    assert abs(rig(np.array([root]))[0] + dynamic_stiffness(INTERFACE, v, root)) < 1e-10
    # The same rig as a function, of which nothing is known beforehand
    unknown = rig.__call__
    assert count_unstable(Rig(INTERFACE, unknown, constant(v))) == count_unstable(Rig(INTERFACE, rig, constant(v))) > 0
    assert growth_rate(Rig(INTERFACE, unknown, constant(v))) == pytest.approx(root, rel=1e-9)


def test_massless_slider():
    rig = Slider(stiffness=2.0, mass=0.0, damping=0.0)
    parameters = {"delay": 0.1, "stiffness": 2.0, "mass": 0.0, "damping": 0.0}
    (crossing, *_) = critical(Rig(INTERFACE, rig, constant(1.0)), "velocity", between=(0.1, 10)).edges
    assert abs(by_hand(1j * crossing.frequency, velocity=crossing.value, **parameters)) < 1e-12
    for v in (0.8, 2.5):
        known = roots_by_hand(-0.3, velocity=v, **parameters)
        assert count_unstable(Rig(INTERFACE, rig, constant(v))) == 2 * np.sum(known.real > 0)
        assert growth_rate(Rig(INTERFACE, rig, constant(v))) == pytest.approx(known[0], rel=1e-9)
    assert critical_spring(Rig(INTERFACE, rig, constant(crossing.value))) == pytest.approx(2.0, rel=1e-9)
    # It is the limit of a light slider.
    light = Slider(stiffness=2.0, mass=1e-9, damping=1.0)
    (limit, *_) = critical(Rig(INTERFACE, light, constant(1.0)), "velocity", between=(0.1, 10)).edges
    assert limit.value == pytest.approx(crossing.value, rel=1e-6)


def test_rigs_are_checked_at_birth():
    with pytest.raises(InputError, match=r"Modes.dampings\[1\] = 0"):
        Modes(masses=(1.0, 1.0), stiffnesses=(1.0, 1.0), dampings=(1.0, 0.0))
    with pytest.raises(InputError, match=r"Modes\.stiffnesses: 1 values"):
        Modes(masses=(1.0, 1.0), stiffnesses=(1.0,), dampings=(1.0, 1.0))
    with pytest.raises(InputError, match="nothing holds the slider"):
        Modes(masses=(1.0,), stiffnesses=(0.0,), dampings=(1.0,))
    with pytest.raises(InputError, match="radiation = -1"):
        RadiationDamping(stiffness=1.0, radiation=-1.0)
    with pytest.raises(InputError, match="body = 3"):
        impedance(3)  # type: ignore[arg-type]


# ---------------------------------------------------------------- boundaries and maps


def curves(dataset):
    return [dataset.isel(point=dataset.curve == k) for k in np.unique(dataset.curve)]


def test_boundary_over_stiffness_and_velocity_against_the_pointwise_answer():
    found = boundary(Rig(INTERFACE, SLIDER, constant(1.0)), between=((0.2, 10.0), (0.2, 10.0)))
    assert found.sizes["point"] > 20
    for k in range(0, found.sizes["point"], 4):
        here = found.isel(point=k)
        assert critical_spring(Rig(INTERFACE, SLIDER, constant(float(here.velocity)))) == pytest.approx(
            float(here.stiffness), rel=1e-9
        )
    for here in (found.isel(point=k) for k in range(found.sizes["point"])):
        rest = by_hand(
            1j * float(here.frequency),
            velocity=float(here.velocity),
            stiffness=float(here.stiffness),
            delay=0.1,
            mass=SLIDER.mass,
            damping=SLIDER.damping,
        )
        assert abs(rest) < 1e-9
    assert set(found.data_vars) == {"stiffness", "velocity", "frequency", "curve"}
    assert all({"units", "long_name"} <= set(v.attrs) for v in found.data_vars.values())


def test_boundary_goes_round_its_folds():
    # K_c(v) rises and falls again, so over the stiffness the curve turns back; both branches are on one curve.
    found = boundary(Rig(INTERFACE, SLIDER, constant(1.0)), between=((4.0, 60.0), (0.5, 200.0)))
    first = max(curves(found), key=lambda curve: curve.sizes["point"])
    turns = np.sum(np.diff(np.sign(np.diff(np.log(first.stiffness.values)))) != 0)
    assert turns >= 1
    for stiffness in (8.0, 20.0):
        rig = replace(SLIDER, stiffness=stiffness)
        for crossing in critical(Rig(INTERFACE, rig, constant(1.0)), "velocity", between=(0.5, 200)).edges:
            away = np.hypot(np.log(found.stiffness / stiffness), np.log(found.velocity / crossing.value)) + np.abs(
                np.log(found.frequency / crossing.frequency)
            )
            assert float(away.min()) < 0.15


@pytest.mark.parametrize(
    ("over", "within"),
    [
        (("velocity", "delay"), ((0.3, 5.0), (0.03, 0.5))),
        (("mass", "damping"), ((1e-5, 1e-2), (10.0, 1e4))),
        (("std", "delay"), ((0.06, 0.3), (0.05, 0.4))),
    ],
)
def test_boundary_over_any_two_parameters_separates_the_counts(over, within):
    found = boundary(Rig(INTERFACE, SLIDER, constant(3.0)), over=over, between=within)
    first, second = (next(k for k in PARAMETERS if k.name == name) for name in over)
    assert found.sizes["point"] > 10
    start = Rig(INTERFACE, SLIDER, constant(3.0))
    for curve in curves(found):
        a, b = np.log(curve[over[0]].values), np.log(curve[over[1]].values)
        for k in range(1, curve.sizes["point"] - 1, 5):
            across = np.array([-(b[k + 1] - b[k - 1]), a[k + 1] - a[k - 1]])
            across *= 1e-5 / np.hypot(*across)
            counts = []
            for sign in (1, -1):
                here = first.set(start, math.exp(a[k] + sign * across[0]))
                here = second.set(here, math.exp(b[k] + sign * across[1]))
                counts.append(count_unstable(here))
            assert sorted(counts) == [0, 2]


BOWL_RIM = critical_spring(Rig(INTERFACE, SLIDER, constant(1.0)))


@dataclass(frozen=True)
class Bowl:
    """A rig that is unstable inside a circle of (log a, log b), to give the boundary a closed curve."""

    a: float = 1.0
    b: float = 1.0

    def __call__(self, s):
        spring = BOWL_RIM * math.exp(math.log(self.a) ** 2 + math.log(self.b) ** 2 - 1)
        return spring + SLIDER.mass * s * (s + SLIDER.damping)


def test_boundary_that_closes_upon_itself():
    parameters = [
        Parameter(
            name=name,
            unit="1",
            get=lambda setting, name=name: getattr(setting.slider, name),
            set=lambda setting, value, name=name: replace(setting, slider=replace(setting.slider, **{name: value})),
        )
        for name in "ab"
    ]
    window = (math.exp(-3), math.exp(3))
    found = boundary(
        Rig(INTERFACE, Bowl(), constant(1.0)), over=(parameters[0], parameters[1]), between=(window, window)
    )
    outer = curves(found)
    assert len(outer) == 1
    radius = np.hypot(np.log(outer[0].a), np.log(outer[0].b))
    assert radius.values == pytest.approx(np.ones(radius.size), rel=1e-9)
    assert np.isclose(outer[0].a[0], outer[0].a[-1])
    angles = np.unwrap(np.arctan2(np.log(outer[0].b), np.log(outer[0].a)))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * math.pi, rel=1e-6)


def test_boundary_where_there_is_none():
    found = boundary(Rig(case(DISTRIBUTIONS[0], Delay(0.0)), SLIDER, constant(1.0)), between=((0.1, 10.0), (0.1, 10.0)))
    assert found.sizes["point"] == 0
    assert read_provenance(found)["arguments"]["within"] == [[0.1, 10.0], [0.1, 10.0]]


@pytest.mark.parametrize(
    "over", [("stiffness", "velocity"), ("velocity", "stiffness"), ("velocity", "delay"), ("mass", "damping")]
)
def test_map_is_the_count_at_each_point(over):
    ranges = {
        "stiffness": (0.1, 10),
        "velocity": (0.1, 10),
        "delay": (0.02, 0.5),
        "mass": (1e-5, 1),
        "damping": (1, 1e3),
    }
    values = [np.geomspace(*ranges[name], 7 + k) for k, name in enumerate(over)]
    found = stability_map(Rig(INTERFACE, SLIDER, constant(2.0)), over=over, values=(values[0], values[1]))
    assert found.unstable_modes.dims == over
    assert found.unstable_modes.shape == (7, 8)
    first, second = (next(k for k in PARAMETERS if k.name == name) for name in over)
    start = Rig(INTERFACE, SLIDER, constant(2.0))
    for i in range(0, 7, 2):
        for j in range(0, 8, 3):
            here = second.set(first.set(start, values[0][i]), values[1][j])
            assert found.unstable_modes[i, j] == count_unstable(here)


def test_map_of_growth_rates():
    stiffness, velocity = np.geomspace(0.3, 8, 6), np.geomspace(0.3, 8, 5)
    found = stability_map(
        Rig(INTERFACE, SLIDER, constant(1.0)), over=(STIFFNESS, VELOCITY), values=(stiffness, velocity), growth=True
    )
    for i, k in enumerate(stiffness):
        for j, v in enumerate(velocity):
            root = growth_rate(Rig(INTERFACE, replace(SLIDER, stiffness=k), constant(v)))
            assert complex(found.growth_rate[i, j], found.frequency[i, j]) == pytest.approx(root, rel=1e-8)
    assert found.growth_rate.attrs["units"] == "1/time"
    assert read_provenance(found)["arguments"]["interface"]["thresholds"]["class"] == "Gaussian"


def test_the_range_that_was_searched_is_told_in_the_units_of_the_rig():
    found = critical(ss.example("brake_pad"), "velocity", between=(0.05, 0.5))
    assert found.searched == pytest.approx((0.05, 0.5))
    assert str(found).startswith("for velocity from 0.05 to 0.5 m/s, smooth sliding")


def test_without_a_range_a_factor_30_either_way_is_searched():
    rig = ss.Rig(
        ss.Interface(thresholds=ss.Gaussian(1.0, 0.1), delay=ss.Delay(0.1)),
        ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4264),
        ss.constant(velocity=1.0),
    )
    assert ss.critical(rig, "velocity") == ss.critical(rig, "velocity", between=(1 / 30, 30.0))
    with pytest.raises(ss.InputError, match=r"between: delay is 0, so give a range"):
        ss.critical(rig.replace(delay=0.0), "delay")


def test_the_last_bit_of_a_range_is_found_before_it_is_gone():
    """Damping closes the unstable range of velocities: of 11 % of a pocket between two points nothing was told."""
    interface = ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=0.1), initial=ss.Gaussian(mean=0.0, std=0.02), delay=ss.Delay(0.1)
    )

    def limits(damping):
        rig = ss.Rig(interface, ss.Slider(stiffness=0.3, mass=1e-3, damping=damping), ss.constant(1.0))
        found = ss.critical(rig, "velocity", between=(0.01, 1000.0))
        for crossing in found.edges:
            sides = [
                ss.stability.count_unstable(rig.replace(velocity=crossing.value * f)) for f in (1 - 1e-7, 1 + 1e-7)
            ]
            assert sides == [crossing.unstable_below, crossing.unstable_above]
        return [crossing.value for crossing in found.edges]

    last = 47.84743489  # where both meet
    for short in (1e-2, 1e-3, 1e-4, 1e-6):
        low, high = limits(last * (1.0 - short))
        assert math.log(high / low) == pytest.approx(4.1 * math.sqrt(short), rel=0.03)  # two roots of a parabola
        assert limits(last * (1.0 + short)) == []
