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
from stickslip.model.parameters import Parameter, parameter_named
from stickslip.paper.cases import FIG7
from stickslip.sliding import kinetic_friction, respond
from stickslip.sliding.transforms import transforms
from stickslip.stability import (
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
TENTH = Gaussian(mean=1.0, std=0.1)

DISTRIBUTIONS = [
    TENTH,
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
every_distribution = pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=str)


def case(distribution=TENTH, delay=Delay(0.1)):
    return Interface(thresholds=distribution, initial=NARROW, delay=delay)


def rig(velocity=1.0, *, on=INTERFACE, body=None, **changes):
    """The rig of Fig. 7 at a velocity, on another interface or with another slider."""
    return Rig(on, replace(SLIDER, **changes) if body is None else body, constant(velocity))


# ---------------------------------------------------------------- an independent model: formulas of a plain Gaussian


def by_hand(s, *, velocity, delay=0.1, stiffness=SLIDER.stiffness, mass=SLIDER.mass, damping=SLIDER.damping, std=0.1):
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
    found = critical(rig(), "velocity", between=(0.1, 1.9))
    assert [crossing.value for crossing in found] == pytest.approx([1.388221], abs=1e-6)
    assert found[0].frequency == pytest.approx(7.265139, abs=1e-6)
    assert (found[0].unstable_below, found[0].unstable_above) == (0, 2)
    assert "loses stability at 1.388221" in str(found)
    with pytest.raises(UndecidedError, match=r"on its stability boundary .* at angular frequency 7\.26513"):
        count_unstable(rig(found[0].value))


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
    held = rig(stiffness=stiffness, damping=damping)
    delay = onset(held, "delay", between=(1e-3, 1e2))
    assert delay == pytest.approx(expected, abs=tolerance)
    frequency = critical(held, "delay", between=(0.9 * delay, 1.1 * delay))[0].frequency
    assert abs(by_hand(1j * frequency, velocity=1.0, delay=delay, stiffness=stiffness, damping=damping)) < 1e-12


@pytest.mark.parametrize(
    ("std", "stick_slip", "smooth"), [(0.06, (1.0, 3.0), (0.25, 8.0)), (0.08, (1.2, 2.0), (0.36, 4.0, 6.0))]
)
def test_windows_of_random_delays(std, stick_slip, smooth):
    # Fig. 7b: the same speeds that runs of the contacts find on either side.
    interface = case(delay=RandomDelay(mean=0.2, std=std))
    loses, regains = critical(rig(on=interface), "velocity", between=(0.1, 20)).edges
    assert (loses.loses_stability, regains.regains_stability) == (True, True)
    assert all(loses.value < v < regains.value for v in stick_slip)
    assert not any(loses.value < v < regains.value for v in smooth)


def test_wide_random_delays_leave_no_window():
    interface = case(delay=RandomDelay(mean=0.2, std=0.12))
    found = critical(rig(on=interface), "velocity", between=(0.2, 5))
    assert len(found) == 0
    assert found.searched == (0.2, 5)
    assert "stable all the way for velocity from 0.2 to 5" in str(found)


# ---------------------------------------------------------------- the dynamic stiffness


@every_distribution
@pytest.mark.parametrize("delay", DELAYS, ids=str)
def test_slow_shaking_sees_the_slope_of_kinetic_friction(distribution, delay):
    interface, v, d = case(distribution, delay), 0.7, 1e-4
    slope = (kinetic_friction(interface, v * (1 + d)) - kinetic_friction(interface, v * (1 - d))) / (2 * d * v)
    s = 1e-8 * np.array([1.0, 1j, 0.6 + 0.8j])
    assert dynamic_stiffness(interface, v, s) / s == pytest.approx(np.full(3, slope), rel=1e-6)


@pytest.mark.parametrize("distribution", [*DISTRIBUTIONS, Gaussian(mean=1.0, std=0.0)], ids=str)
def test_without_delay_smooth_sliding_is_neutral(distribution):
    held = rig(on=case(distribution, Delay(0.0)))
    assert np.all(dynamic_stiffness(held.interface, 1.0, np.array([1j, 3.0, 0.5 + 20j])) == 0)
    assert count_unstable(held) == critical_spring(held) == len(critical(held, "velocity", between=(0.1, 10))) == 0
    assert growth_rate(held).real == pytest.approx(-0.5 * SLIDER.damping, rel=1e-12)
    assert boundary(held, between=((0.1, 10.0), (0.1, 10.0))).sizes["point"] == 0


@every_distribution
def test_shape_function_is_the_integral_it_stands_for(distribution):
    # H = q Int x J_c(x) exp(-q x) dx, on both sides of the change from series to closed form
    distribution = distribution.positive()
    node, weight = np.polynomial.legendre.leggauss(20)
    # in x = y^5: distributions may rise steeply at zero
    knots = [k**0.2 for k in distribution.knots if k > 0]
    edges = np.unique(np.concatenate([np.linspace(0, distribution.support[1] ** 0.2, 300), knots]))
    y = (edges[:-1, None] + 0.5 * np.diff(edges)[:, None] * (1 + node)).ravel()
    dx = (0.5 * np.diff(edges)[:, None] * weight).ravel() * 5 * y**4
    x = y**5
    survival = distribution.survival(x)
    for q in np.array([1e-4, 0.01j, 0.1, 0.3 + 0.2j, 0.49j, 0.51j, 1.0, 2 + 3j, 12j, 40j]):
        complement, shape = transforms(distribution, np.array([q]))
        assert shape[0] == pytest.approx(q * np.sum(dx * x * survival * np.exp(-q * x)), rel=2e-7, abs=1e-13)
        assert complement[0] == pytest.approx(q * np.sum(dx * survival * np.exp(-q * x)), rel=2e-7, abs=1e-13)


def test_dynamic_stiffness_is_real_on_the_real_axis_and_symmetric_about_it():
    s = np.array([[0.4 + 2j, -0.3 + 5j], [1j, 30j]])
    kappa = dynamic_stiffness(INTERFACE, 1.0, s)
    assert dynamic_stiffness(INTERFACE, 1.0, np.conj(s)) == pytest.approx(np.conj(kappa), rel=1e-13)
    assert dynamic_stiffness(INTERFACE, 1.0, 0.7).imag == dynamic_stiffness(INTERFACE, 1.0, 0) == 0
    assert kappa == pytest.approx(by_hand(s, velocity=1.0, stiffness=0, mass=0), rel=1e-12)


@every_distribution
def test_whatever_the_delay_the_response_lies_in_one_disc(distribution):
    for delay in DELAYS:
        response = respond(case(distribution, delay))
        discs = response.discs(0.8, 16.0)
        kappa, centre = response.stiffness(0.8, 1j * discs.omega[::8]), discs.centre[::8]
        assert np.all(np.abs(kappa - centre) <= np.abs(centre) * (1 + 1e-6))


# ---------------------------------------------------------------- counts and growth rates


@pytest.mark.parametrize(
    ("velocity", "delay", "stiffness", "mass", "damping"),
    [
        (1.0, 0.1, 2.0, 1e-4, 42.4),
        (1.0, 0.2, 2.0, 1e-4, 200.0),
        (3.0, 0.1, 2.0, 1e-4, 42.4),
        (2.0, 0.3, 0.3, 1e-3, 5.0),
        (0.5, 0.6, 4.0, 1e-2, 1.0),
        (0.8, 0.1, 2.0, 0.0, 0.0),
        (2.5, 0.1, 2.0, 0.0, 0.0),
    ],
)
def test_counts_and_growth_rates_against_a_search_by_hand(velocity, delay, stiffness, mass, damping):
    body = {"stiffness": stiffness, "mass": mass, "damping": damping}
    known = roots_by_hand(-0.3, velocity=velocity, delay=delay, **body)
    held = rig(velocity, on=case(delay=Delay(delay)), **body)
    assert count_unstable(held) == 2 * np.sum(known.real > 0)
    assert growth_rate(held) == pytest.approx(known[0], rel=1e-9)


@every_distribution
@pytest.mark.parametrize("seed", range(4))
def test_two_counts_and_the_growth_rate_agree(distribution, seed):
    rng = np.random.default_rng([seed, DISTRIBUTIONS.index(distribution)])
    delay = DELAYS[rng.integers(len(DELAYS))]
    interface, v = case(distribution, delay), 10 ** rng.uniform(-1, 1.3)
    stiffness, mass = 10 ** rng.uniform(-1.5, 1), 10 ** rng.uniform(-5, 0)
    slider = Slider(stiffness=stiffness, mass=mass, damping=math.sqrt(stiffness / mass) * 10 ** rng.uniform(-2, 0.5))
    held, response, z = rig(v, on=interface, body=slider), respond(interface), impedance(slider)
    count = count_unstable(held)
    assert count_right_of(response, z, v, 1e-6 / response.cycle(v)) in (count, None)
    try:
        root = growth_rate(held)
    except UndecidedError:
        # Only a stable rig may have no slowest mode, and only with a distribution whose tail decays more slowly.
        assert count == 0
        assert math.isfinite(response.leftmost(v))
    else:
        assert (root.real > 0) == (count > 0)
        assert root.imag >= 0
        assert abs(z(np.array([root])) + dynamic_stiffness(interface, v, [root]))[0] < 1e-8 * stiffness


def test_unstable_without_oscillation():
    # A spring so soft that a growing mode does not even oscillate
    interface = case(Gaussian(mean=1.0, std=0.034), RandomDelay(mean=0.24, std=0.36, negative="redraw"))
    held = rig(0.48, on=interface, stiffness=0.032, mass=1.37e-5, damping=36.8)
    root = growth_rate(held)
    assert root.imag == 0 < root.real
    assert count_unstable(held) == 24


def test_very_close_pairs_of_neutral_frequencies_are_seen():
    # At high speed a mode is unstable only within 1e-4 of a multiple of 2 pi/tau.
    for v in (313.2, 313.45, 314.0, 400.0):
        (neutral,) = neutral_frequencies(respond(INTERFACE), [(SLIDER, v)])
        assert neutral.unstable() == count_unstable(rig(v)) == 4


# ---------------------------------------------------------------- critical values


@pytest.mark.parametrize("velocity", [0.3, 1.0, 1.4, 3.0, 30.0])
def test_critical_spring_divides_stable_from_unstable(velocity):
    spring = critical_spring(rig(velocity))
    counts = [count_unstable(rig(velocity, stiffness=factor * spring)) for factor in (1 - 1e-6, 1 + 1e-6, 3)]
    assert [count == 0 for count in counts] == [False, True, True]


@every_distribution
def test_critical_spring_with_every_distribution(distribution):
    interface = case(distribution, Delay(0.3))
    spring = critical_spring(rig(on=interface))
    springs, counts = ((0.9999 * spring, 1.0001 * spring), [2, 0]) if spring else ((1e-3,), [0])
    assert [count_unstable(rig(on=interface, stiffness=each)) for each in springs] == counts


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
    found, turned = critical(rig(3.0), parameter, between=between), parameter_named(parameter)
    assert found.edges
    for crossing in found:
        sides = [count_unstable(turned.set(rig(3.0), crossing.value * factor)) for factor in (1 - 1e-7, 1 + 1e-7)]
        assert sides == [crossing.unstable_below, crossing.unstable_above]


def test_smooth_sliding_may_be_lost_and_regained_more_than_once():
    found = critical(rig(stiffness=12.0), "velocity", between=(0.05, 1000))
    assert [c.loses_stability for c in found.edges] == [True, False, True, False]


def test_no_critical_delay_says_so_with_the_range():
    stiff = rig(on=case(Gaussian(mean=1.0, std=0.4)), stiffness=50.0, damping=200.0)
    with pytest.raises(UndecidedError, match=r"stable all the way for delay from 0.01 to 5"):
        onset(stiff, "delay", between=(0.01, 5.0))
    with pytest.raises(UndecidedError, match=r"no onset by delay.*unstable"):
        onset(rig(), "delay", between=(0.2, 0.21))


def test_the_range_that_was_searched_is_told_in_the_units_of_the_rig():
    found = critical(ss.example("brake_pad"), "velocity", between=(0.05, 0.5))
    assert found.searched == pytest.approx((0.05, 0.5))
    assert str(found).startswith("for velocity from 0.05 to 0.5 m/s, smooth sliding")


def test_without_a_range_a_factor_30_either_way_is_searched():
    assert critical(rig(), "velocity") == critical(rig(), "velocity", between=(1 / 30, 30.0))
    with pytest.raises(InputError, match=r"between: delay is 0, so give a range"):
        critical(rig().replace(delay=0.0), "delay")


def test_the_last_bit_of_a_range_is_found_before_it_is_gone():
    """Damping closes the unstable range of velocities: of 11 % of a pocket between two points nothing was told."""

    def limits(damping):
        slider = Slider(stiffness=0.3, mass=1e-3, damping=damping)
        found = critical(rig(body=slider), "velocity", between=(0.01, 1000.0)).edges
        for crossing in found:
            sides = [count_unstable(rig(crossing.value * factor, body=slider)) for factor in (1 - 1e-7, 1 + 1e-7)]
            assert sides == [crossing.unstable_below, crossing.unstable_above]
        return [crossing.value for crossing in found]

    last = 47.84743489  # where both meet
    for short in (1e-2, 1e-3, 1e-4, 1e-6):
        low, high = limits(last * (1.0 - short))
        assert math.log(high / low) == pytest.approx(4.1 * math.sqrt(short), rel=0.03)  # two roots of a parabola
        assert limits(last * (1.0 + short)) == []


# ---------------------------------------------------------------- refusals


WARM = Interface(thresholds=TENTH, ageing=Langevin(rate=1.0), temperature=Bell(width=0.01, attempts=1e6))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: dynamic_stiffness(case(delay=Delay(math.inf)), 1.0, 1j), "never re-attach"),
        (lambda: growth_rate(rig(on=case(Gaussian(mean=1.0, std=0.0)))), "share one threshold"),
        (lambda: critical_spring(rig(on=WARM)), "temperature"),
        (lambda: dynamic_stiffness(INTERFACE, 0.0, 1j), "velocity = 0"),
        (lambda: dynamic_stiffness(case(LogNormal(mean=1.0, std=0.3)), 1.0, -0.1 + 1j), "no transform"),
        (lambda: dynamic_stiffness(case(Exponential(mean=1.0)), 2.0, -2.5), "no transform"),
        (lambda: dynamic_stiffness(INTERFACE, 1.0, -1e6), "overflows"),
        (lambda: critical(rig(), "speed", between=(1, 2)), "must be one of stiffness"),
        (lambda: critical(rig(), "velocity", between=(2, 1)), r"between\[1\] = 1"),
        (lambda: critical(rig(body=lambda s: 2.0 + 0 * s), "mass", between=(1e-3, 1)), "no mass"),
        (lambda: critical(rig(on=case(Exponential(mean=1.0))), "std", between=(0.1, 1)), "no std to vary"),
        (lambda: boundary(rig(), over=("mass", "mass"), between=((1, 2), (1, 2))), "two different parameters"),
        (lambda: boundary(rig(), between=((0.1, 10.0),)), r"^between = .*: must be a range of each parameter"),
        (lambda: stability_map(rig(), values=([-1.0, 2.0], [1.0])), "values of stiffness = -1"),
        (lambda: count_unstable(rig(body=lambda s: 1e-4 * s * s)), r"Z\(0\)"),
        (lambda: count_unstable(rig(body=lambda s: 2.0 - 0.01 * s + 1e-4 * s * s)), "puts energy in"),
        (lambda: Modes(masses=(1.0, 1.0), stiffnesses=(1.0, 1.0), dampings=(1.0, 0.0)), r"Modes.dampings\[1\] = 0"),
        (lambda: Modes(masses=(1.0, 1.0), stiffnesses=(1.0,), dampings=(1.0, 1.0)), r"Modes\.stiffnesses: 1 values"),
        (lambda: Modes(masses=(1.0,), stiffnesses=(0.0,), dampings=(1.0,)), "nothing holds the slider"),
        (lambda: RadiationDamping(stiffness=1.0, radiation=-1.0), "radiation = -1"),
        (lambda: impedance(3), "body = 3"),
    ],
)
def test_what_has_no_answer_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


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
    rigs = [rig(velocity, body=body) for body in same]
    roots, springs = [growth_rate(each) for each in rigs], [critical_spring(each) for each in rigs[:2]]
    assert roots == pytest.approx([roots[0]] * len(same), rel=1e-9)
    assert springs == pytest.approx([springs[0]] * 2, rel=1e-10)
    assert len({count_unstable(each) for each in rigs}) == 1


def test_a_spring_that_radiates_without_a_mass_decays_at_one_rate():
    assert natural_frequencies(RadiationDamping(stiffness=2.0, radiation=0.5, mass=0.0)) == pytest.approx([-4.0])


def test_receptances_of_modes_add():
    body = Modes(masses=(1e-3, 2e-3, 5e-4), stiffnesses=(3.0, 40.0, 90.0), dampings=(2.0, 0.5, 11.0), stiffness=0.4)
    s = np.array([0.3 + 4j, 60j, -5 + 100j, 2.0])
    own = [m * s * (s + e) + k for m, k, e in zip(body.masses, body.stiffnesses, body.dampings, strict=True)]
    assert body(s) == pytest.approx(0.4 + 1 / sum(1 / each for each in own), rel=1e-12)
    assert np.abs(body(natural_frequencies(body))) == pytest.approx(np.zeros(6), abs=1e-9)
    assert np.all(np.abs(body(poles(body))) > 1e8)


def test_modes_and_a_function_of_which_nothing_is_known_beforehand():
    body, v = Modes(masses=(2e-3, 1e-3), stiffnesses=(3.0, 30.0), dampings=(1.0, 2.0)), 2.0
    known, unknown = rig(v, body=body), rig(v, body=body.__call__)
    root = growth_rate(known)
    assert abs(body(np.array([root]))[0] + dynamic_stiffness(INTERFACE, v, root)) < 1e-10
    assert growth_rate(unknown) == pytest.approx(root, rel=1e-9)
    assert count_unstable(unknown) == count_unstable(known) > 0


def test_a_massless_slider_is_the_limit_of_a_light_one():
    (first, *_), (light, *_) = (
        critical(rig(mass=mass, damping=damping), "velocity", between=(0.1, 10)).edges
        for mass, damping in ((0.0, 0.0), (1e-9, 1.0))
    )
    assert abs(by_hand(1j * first.frequency, velocity=first.value, mass=0.0)) < 1e-12
    assert critical_spring(rig(first.value, mass=0.0, damping=0.0)) == pytest.approx(2.0, rel=1e-9)
    assert light.value == pytest.approx(first.value, rel=1e-6)


# ---------------------------------------------------------------- boundaries and maps


def curves(dataset):
    return [dataset.isel(point=dataset.curve == k) for k in np.unique(dataset.curve)]


def test_boundary_over_stiffness_and_velocity_against_the_pointwise_answer():
    found = boundary(rig(), between=((0.2, 10.0), (0.2, 10.0)))
    assert found.sizes["point"] > 20
    stiffness, velocity, frequency = (found[name].to_numpy() for name in ("stiffness", "velocity", "frequency"))
    assert [critical_spring(rig(v)) for v in velocity[::4]] == pytest.approx(stiffness[::4], rel=1e-9)
    assert np.abs(by_hand(1j * frequency, velocity=velocity, stiffness=stiffness)).max() < 1e-9
    assert set(found.data_vars) == {"stiffness", "velocity", "frequency", "curve"}
    assert all({"units", "long_name"} <= set(v.attrs) for v in found.data_vars.values())
    assert read_provenance(found)["arguments"]["within"] == [[0.2, 10.0], [0.2, 10.0]]


def test_boundary_goes_round_its_folds():
    # K_c(v) rises and falls again, so over the stiffness the curve turns back; both branches are on one curve.
    found = boundary(rig(), between=((4.0, 60.0), (0.5, 200.0)))
    first = max(curves(found), key=lambda curve: curve.sizes["point"])
    assert np.sum(np.diff(np.sign(np.diff(np.log(first.stiffness.values)))) != 0) >= 1
    for stiffness in (8.0, 20.0):
        for crossing in critical(rig(stiffness=stiffness), "velocity", between=(0.5, 200)).edges:
            there = {"stiffness": stiffness, "velocity": crossing.value, "frequency": crossing.frequency}
            away = sum(np.log(found[name] / value) ** 2 for name, value in there.items())
            assert float(away.min()) < 0.15**2


@pytest.mark.parametrize(
    ("over", "within"),
    [
        (("velocity", "delay"), ((0.3, 5.0), (0.03, 0.5))),
        (("mass", "damping"), ((1e-5, 1e-2), (10.0, 1e4))),
        (("std", "delay"), ((0.06, 0.3), (0.05, 0.4))),
    ],
)
def test_boundary_over_any_two_parameters_separates_the_counts(over, within):
    found = boundary(rig(3.0), over=over, between=within)
    first, second = (parameter_named(name) for name in over)
    assert found.sizes["point"] > 10
    for curve in curves(found):
        a, b = np.log(curve[over[0]].values), np.log(curve[over[1]].values)
        for k in range(1, curve.sizes["point"] - 1, 5):
            across = np.array([-(b[k + 1] - b[k - 1]), a[k + 1] - a[k - 1]])
            across *= 1e-5 / np.hypot(*across)
            sides = (np.exp([a[k], b[k]] + sign * across) for sign in (1, -1))
            counts = [count_unstable(second.set(first.set(rig(3.0), float(x)), float(y))) for x, y in sides]
            assert sorted(counts) == [0, 2]


BOWL_RIM = critical_spring(rig())


@dataclass(frozen=True)
class Bowl:
    """A rig that is unstable inside a circle of (log a, log b), to give the boundary a closed curve."""

    a: float = 1.0
    b: float = 1.0

    def __call__(self, s):
        spring = BOWL_RIM * math.exp(math.log(self.a) ** 2 + math.log(self.b) ** 2 - 1)
        return spring + SLIDER.mass * s * (s + SLIDER.damping)


def test_boundary_that_closes_upon_itself():
    over = tuple(
        Parameter(
            name=name,
            unit="1",
            get=lambda setting, name=name: getattr(setting.slider, name),
            set=lambda setting, value, name=name: replace(setting, slider=replace(setting.slider, **{name: value})),
        )
        for name in "ab"
    )
    window = (math.exp(-3), math.exp(3))
    (outer,) = curves(boundary(rig(body=Bowl()), over=over, between=(window, window)))
    a, b = np.log(outer.a.values), np.log(outer.b.values)
    assert np.hypot(a, b) == pytest.approx(np.ones(a.size), rel=1e-9)
    angles = np.unwrap(np.arctan2(b, a))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * math.pi, rel=1e-6)


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
    found = stability_map(rig(2.0), over=over, values=(values[0], values[1]))
    assert dict(found.unstable_modes.sizes) == dict(zip(over, (7, 8), strict=True))
    first, second = (parameter_named(name) for name in over)
    for i in range(0, 7, 2):
        for j in range(0, 8, 3):
            here = second.set(first.set(rig(2.0), values[0][i]), values[1][j])
            assert found.unstable_modes[i, j] == count_unstable(here)


def test_map_of_growth_rates():
    values = np.geomspace(0.3, 8, 6), np.geomspace(0.3, 8, 5)
    found = stability_map(rig(), over=(STIFFNESS, VELOCITY), values=values, growth=True)
    roots = [[growth_rate(rig(v, stiffness=k)) for v in values[1]] for k in values[0]]
    assert found.growth_rate.values + 1j * found.frequency.values == pytest.approx(np.array(roots), rel=1e-8)
    assert found.growth_rate.attrs["units"] == "1/time"
    assert read_provenance(found)["arguments"]["interface"]["thresholds"]["class"] == "Gaussian"
