"""Linear stability of smooth sliding: known numbers, limits, and counts by searches
independent of the code.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from refusals import refused
from test_distributions import RaisedCosine

import conftest
import stickslip as ss
from stickslip.io.datasets import read_provenance
from stickslip.model.distributions import Gaussian
from stickslip.model.parameters import parameter_named
from stickslip.paper.cases import FIG7, FIG8
from stickslip.sliding import drawn, kinetic_friction, respond
from stickslip.stability import (
    AGEING,
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
from stickslip.stability.impedances import impedance
from stickslip.stability.roots import count_right_of
from stickslip.stability.scan import SmoothSliding

INTERFACE = FIG7.interface
SLIDER = FIG7.slider
NARROW = Gaussian(mean=0.0, std=0.001)
TENTH = Gaussian(mean=1.0, std=0.1)

DISTRIBUTIONS = [*conftest.DISTRIBUTIONS.values(), Gaussian(mean=1.0, std=0.01)]
DELAYS = [
    ss.Delay(0.1),
    ss.Delay(1.3),
    ss.RandomDelay(mean=0.2, std=0.12),
    ss.RandomDelay(mean=0.2, std=0.12, negative="redraw"),
    ss.RandomDelay(mean=0.2, std=0.12, negative="fold"),
    ss.RandomDelay(mean=0.2, std=0.02),
]
every_distribution = pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=str)


def case(distribution=TENTH, delay=ss.Delay(0.1)):
    return ss.Interface(thresholds=distribution, initial=NARROW, delay=delay)


def rig(velocity=1.0, *, on=INTERFACE, body=None, **changes):
    """The rig of Fig. 7 at a velocity, on any interface and slider."""
    body = replace(SLIDER, **changes) if body is None else body
    return ss.Rig(on, body, ss.constant(velocity))


# ----------------------------------- an independent model: formulas of a plain Gaussian


KNOWN = {"stiffness": SLIDER.stiffness, "mass": SLIDER.mass, "damping": SLIDER.damping}


def by_hand(s, *, velocity, delay=0.1, std=0.1, force=0.0, **changes):
    """Z + kappa for a narrow Gaussian, whose cut at 0 is negligible, as printed."""
    stiffness, mass, damping = (KNOWN | changes).values()
    q = s / velocity
    transform = np.exp(-q + 0.5 * (q * std) ** 2)
    slope = (-1 + q * std**2) * transform
    h = (1 - transform) / q**2 + slope / q
    kappa = (force * (1 - transform) - q * h) * (1 - np.exp(-s * delay))
    kappa /= (1 + velocity * delay) * (1 - np.exp(-s * delay) * transform)
    return mass * s * s + mass * damping * s + stiffness + kappa


def roots_by_hand(left, **parameters):
    """Roots with Re s > left, Im s > 0, by Newton's method from a fine grid."""

    def function(s):
        return by_hand(s, **parameters)

    # Far to the right the tail of the plain Gaussian below zero, which the model lacks,
    # has roots of its own.
    rate, frequency = np.meshgrid(np.arange(left, 6, 0.25), np.arange(0.1, 250, 0.25))
    s = (rate + 1j * frequency).ravel()
    with np.errstate(all="ignore"):
        for _ in range(40):
            slope = (function(s + 1e-6) - function(s - 1e-6)) / 2e-6
            step = function(s) / slope
            s = s - step
        found = np.isfinite(s) & (np.abs(step) < 1e-9)
        s = s[found & (s.real > left) & (s.real < 30) & (s.imag > 1e-3)]
    distinct = []
    for root in s[np.argsort(-s.real)]:
        if not any(abs(root - other) < 1e-6 for other in distinct):
            distinct.append(root)
    return np.array(distinct)


def test_first_critical_velocity_of_fig_7a():
    found = critical(rig(), "velocity", between=(0.1, 1.9))
    assert [crossing.value for crossing in found] == pytest.approx([1.388221], abs=1e-6)
    assert found[0].frequency == pytest.approx(7.265139, abs=1e-6)
    assert (found[0].unstable_below, found[0].unstable_above) == (0, 2)
    assert "loses stability at 1.388221" in str(found)
    message = r"on its stability boundary .* at angular frequency 7\.26513"
    with pytest.raises(ss.UndecidedError, match=message):
        count_unstable(rig(found[0].value))


@pytest.mark.parametrize(
    ("stiffness", "damping", "expected", "tolerance"),
    [
        (2.0, SLIDER.damping, 0.138218, 5e-7),
        (2.0, 200.0, 0.1455, 5e-5),
        # PHYSICS prints .2696. The same formula by hand (below) gives .2695; .2696
        # needs eta = 205.
        (5.0, 200.0, 0.2696, 2e-4),
    ],
)
def test_linear_critical_delays(stiffness, damping, expected, tolerance):
    body = {"stiffness": stiffness, "damping": damping}
    held = rig(**body)
    delay = onset(held, "delay", between=(1e-3, 1e2))
    assert delay == pytest.approx(expected, abs=tolerance)
    frequency = critical(held, "delay", between=(0.9 * delay, 1.1 * delay))[0].frequency
    assert abs(by_hand(1j * frequency, velocity=1.0, delay=delay, **body)) < 1e-12


@pytest.mark.parametrize(
    ("std", "stick_slip", "smooth"),
    [
        (0.06, (1.0, 3.0), (0.25, 8.0)),
        (0.08, (1.2, 2.0), (0.36, 4.0, 6.0)),
        (0.12, (), (0.2, 5.0)),
    ],
)
def test_windows_of_random_delays(std, stick_slip, smooth):
    # Fig. 7b: runs of the contacts find the same speeds on either side; with wide
    # delays there is no window.
    wide = rig(on=case(delay=ss.RandomDelay(mean=0.2, std=std)))
    found = critical(wide, "velocity", between=(0.1, 20))
    ends = [True, False] if stick_slip else []
    assert [edge.loses_stability for edge in found.edges] == ends
    window = [edge.value for edge in found.edges] or [math.inf, 0.0]
    assert all(window[0] < v < window[1] for v in stick_slip)
    assert not any(window[0] < v < window[1] for v in smooth)
    assert found.searched == (0.1, 20)
    assert stick_slip or "stable for velocity from 0.1 to 20" in str(found)


# ---------------------------------------------------------------- the dynamic stiffness


@every_distribution
@pytest.mark.parametrize("delay", DELAYS, ids=str)
def test_slow_shaking_sees_the_slope_of_kinetic_friction(distribution, delay):
    interface = case(distribution, delay)
    v = 0.7
    d = 1e-4
    less, more = (kinetic_friction(interface, v * (1 + by)) for by in (-d, d))
    slope = (more - less) / (2 * d * v)
    s = 1e-8 * np.array([1.0, 1j, 0.6 + 0.8j])
    slopes = dynamic_stiffness(interface, v, s) / s
    assert slopes == pytest.approx(np.full(3, slope), rel=1e-6)


@pytest.mark.parametrize("sliding_force", [0.0, 0.5])  # which has no effect here
@pytest.mark.parametrize("distribution", [*DISTRIBUTIONS, Gaussian(1.0, 0.0)], ids=str)
def test_without_delay_smooth_sliding_is_neutral(distribution, sliding_force):
    on = replace(case(distribution, ss.Delay(0.0)), sliding_force=sliding_force)
    held = rig(on=on)
    s = np.array([1j, 3.0, 0.5 + 20j])
    assert np.all(dynamic_stiffness(held.interface, 1.0, s) == 0)
    assert count_unstable(held) == critical_spring(held) == 0
    assert not critical(held, "velocity", between=(0.1, 10))
    assert growth_rate(held).real == pytest.approx(-0.5 * SLIDER.damping, rel=1e-12)
    assert boundary(held, between=((0.1, 10.0), (0.1, 10.0))).sizes["point"] == 0


CARRIED = replace(case(), sliding_force=0.25)
MIXTURES = {str(distribution): case(distribution) for distribution in DISTRIBUTIONS}
for at in (0.0, 0.2, -0.3):
    MIXTURES[f"newborns at {at}"] = replace(CARRIED, newborn=Gaussian(at, 0.0))
MIXTURES["random delays"] = replace(CARRIED, delay=DELAYS[2])


@pytest.mark.parametrize("name", MIXTURES)
def test_dynamic_stiffness_is_that_of_lives_of_contacts_one_by_one(name):
    # Independent of transforms. In threshold = y^5: distributions may rise steeply at
    # zero.
    interface = MIXTURES[name]
    velocity = 1.5
    s = np.array([0.3 + 0.1j, 0.74j, 0.76j, 2j, 0.5 + 20j, 90j])
    distribution = interface.threshold_distribution
    node, weight = np.polynomial.legendre.leggauss(20)
    born = 0.0 if interface.newborn is None else interface.newborn.moment(1)
    # one density has a kink at .6
    knots = [k**0.2 for k in (*distribution.knots, 0.6) if k > 0]
    support = np.linspace(abs(born) ** 0.2, distribution.support[1] ** 0.2, 300)
    edges = np.unique([*support, *knots])
    half = 0.5 * np.diff(edges)[:, None]
    y = (edges[:-1, None] + half * (1 + node)).ravel()
    share = (half * weight).ravel() * 5 * y**4 * distribution.density(y**5)
    life = y**5 - born
    q = s[:, None] / velocity
    ended = np.exp(-q * life) @ share
    again = interface.delay.laplace(s)
    # The stretching over a life, and the force that a detached contact would have, both
    # weighted by exp(-q l).
    faded = np.exp(-q * life)
    held = (born * (1 - faded) / q + (1 - (1 + q * life) * faded) / q**2) @ share
    path = share @ life + velocity * interface.delay.moment(1)
    births = -(1 - again) / (path * (1 - again * ended))
    expected = births * (s / velocity * held - interface.sliding_force * (1 - ended))
    found = dynamic_stiffness(interface, velocity, s)
    assert found == pytest.approx(expected, rel=1e-9)


# -------------------------------------------------------------- counts and growth rates


@pytest.mark.parametrize(
    ("velocity", "delay", "stiffness", "mass", "damping", "force"),
    [
        (1.0, 0.1, 2.0, 1e-4, 42.4, 0.0),
        (1.0, 0.2, 2.0, 1e-4, 200.0, 0.0),
        (3.0, 0.1, 2.0, 1e-4, 42.4, 0.2),
        (2.0, 0.3, 0.3, 1e-3, 5.0, 0.0),
        (0.5, 0.6, 4.0, 1e-2, 1.0, 0.0),
        (0.8, 0.1, 2.0, 0.0, 0.0, 0.0),
        (2.5, 0.1, 2.0, 0.0, 0.0, 0.0),
        (0.3, 0.4, 2.9, 8.6e-4, 1.66, 0.1),  # only the delay makes it grow
    ],
)
def test_counts_and_growth_rates_by_hand(
    velocity, delay, stiffness, mass, damping, force
):
    body = {"stiffness": stiffness, "mass": mass, "damping": damping}
    known = roots_by_hand(-0.3, velocity=velocity, delay=delay, force=force, **body)
    on = replace(case(delay=ss.Delay(delay)), sliding_force=force)
    held = rig(velocity, on=on, **body)
    assert count_unstable(held) == 2 * np.sum(known.real > 0)
    assert growth_rate(held) == pytest.approx(known[0], rel=1e-9)


@every_distribution
@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))]
)
def test_two_counts_and_the_growth_rate_agree(distribution, seed):
    rng = np.random.default_rng([seed, DISTRIBUTIONS.index(distribution)])
    interface = case(distribution, DELAYS[rng.integers(len(DELAYS))])
    v = 10 ** rng.uniform(-1, 1.3)
    stiffness = 10 ** rng.uniform(-1.5, 1)
    mass = 10 ** rng.uniform(-5, 0)
    damping = math.sqrt(stiffness / mass) * 10 ** rng.uniform(-2, 0.5)
    slider = ss.Slider(stiffness=stiffness, mass=mass, damping=damping)
    held = rig(v, on=interface, body=slider)
    sliding = SmoothSliding(respond(interface), impedance(slider), v)
    count = count_unstable(held)
    assert count_right_of(sliding, 1e-6 / sliding.scales.cycle) in (count, None)
    try:
        root = growth_rate(held)
    except ss.UndecidedError:
        # Only a stable rig may lack a slowest mode, and only if the tail of its
        # distribution decays more slowly than modes do.
        assert count == 0
        assert math.isfinite(sliding.scales.leftmost)
    else:
        assert (root.real > 0) == (count > 0)
        assert root.imag >= 0
        held_back = sliding.body(np.array([root]))[0]
        total = held_back + dynamic_stiffness(interface, v, [root])[0]
        assert abs(total) < 1e-8 * stiffness


# ---------------------------------------------------------------- critical values


SPRINGS = {f"velocity {v}": (INTERFACE, v) for v in (0.3, 1.0, 1.4, 3.0, 30.0)}
SPRINGS |= {str(each): (case(each, ss.Delay(0.3)), 1.0) for each in DISTRIBUTIONS}


@pytest.mark.parametrize("name", SPRINGS)
def test_the_critical_spring_divides_stable_from_unstable(name):
    interface, v = SPRINGS[name]
    spring = critical_spring(rig(v, on=interface))
    if not spring:  # soft springs are stable too
        assert count_unstable(rig(v, on=interface, stiffness=1e-3)) == 0
        return
    held = [
        rig(v, on=interface, stiffness=by * spring) for by in (1 - 1e-6, 1 + 1e-6, 3)
    ]
    assert [count_unstable(each) == 0 for each in held] == [False, True, True]


@pytest.mark.slow
def test_the_critical_spring_is_the_stiffest_at_any_frequency():
    # Light and hardly damped: sharp resonances of the lives, and turns of the delay
    # where lives are forgotten.
    growth = ss.LogarithmicGrowth(slope=0.11, time=0.28)
    grown = replace(case(Gaussian(1.0, 0.18), ss.Delay(0.41)), ageing=growth)
    held = rig(2.9, on=grown, stiffness=7.0, mass=1.6e-4, damping=2.4e-3)
    s = 1j * np.arange(0.05, 600.0, 0.05)
    total = impedance(held.slider)(s) + dynamic_stiffness(grown, 2.9, s)
    neutral = np.sign(total[1:].imag) != np.sign(total[:-1].imag)
    expected = 7.0 - np.min(total[1:].real[neutral])
    assert critical_spring(held) == pytest.approx(expected, rel=2e-3)


BORN = replace(case(), sliding_force=0.3, newborn=Gaussian(mean=0.1, std=0.0))


@pytest.mark.parametrize(
    ("held", "parameter", "between"),
    [
        (rig(3.0), "stiffness", (0.1, 50)),
        (rig(3.0), "velocity", (0.1, 30)),
        (rig(3.0), "mass", (1e-6, 10)),
        (rig(3.0), "damping", (0.1, 1e5)),
        (rig(3.0), "delay", (0.01, 0.5)),
        (rig(3.0), "std", (0.05, 0.4)),
        # stability is lost and regained more than once
        (rig(stiffness=12.0), "velocity", (0.05, 1000)),
        (rig(1.5, on=BORN), "stiffness", (0.1, 20)),
    ],
    ids=str,
)
def test_each_parameter_changes_the_count_where_it_says_so(held, parameter, between):
    found = critical(held, parameter, between=between)
    turned = parameter_named(parameter)
    assert found.edges
    for crossing in found:
        near = (crossing.value * factor for factor in (1 - 1e-7, 1 + 1e-7))
        sides = [count_unstable(turned.set(held, value)) for value in near]
        assert sides == [crossing.unstable_below, crossing.unstable_above]
        assert abs(sides[1] - sides[0]) == 2


def test_no_critical_delay_says_so_with_the_range():
    stiff = rig(on=case(Gaussian(mean=1.0, std=0.4)), stiffness=50.0, damping=200.0)
    with pytest.raises(ss.UndecidedError, match=r"stable for delay from 0.01 to 5"):
        onset(stiff, "delay", between=(0.01, 5.0))
    with pytest.raises(ss.UndecidedError, match=r"no onset by delay.*unstable"):
        onset(rig(), "delay", between=(0.2, 0.21))


def test_the_range_that_is_searched_is_told_in_the_units_of_the_rig():
    found = critical(ss.example("brake_pad"), "velocity", between=(0.05, 0.5))
    assert found.searched == pytest.approx((0.05, 0.5))
    assert str(found).startswith("for velocity from 0.05 to 0.5 m/s, smooth sliding")
    # Without a range, a factor of 30 in either direction is searched.
    everywhere = critical(rig(), "velocity", between=(1 / 30, 30.0))
    assert critical(rig(), "velocity") == everywhere
    with pytest.raises(ss.InputError, match=r"between: delay is 0, so give a range"):
        critical(rig().replace(delay=0.0), "delay")


def test_the_last_bit_of_a_range_is_found_before_it_is_gone():
    """Damping closes the unstable range of velocities; its last part is found."""

    def limits(damping):
        body = ss.Slider(stiffness=0.3, mass=1e-3, damping=damping)
        found = critical(rig(body=body), "velocity", between=(0.01, 1000.0))
        return [crossing.value for crossing in found.edges]

    last = 47.84743489  # where both ends meet
    for short in (1e-2, 1e-3, 1e-4, 1e-6):
        low, high = limits(last * (1.0 - short))
        # two roots of a parabola
        assert math.log(high / low) == pytest.approx(4.1 * math.sqrt(short), rel=0.03)
        assert limits(last * (1.0 + short)) == []


@pytest.mark.parametrize("thresholds", [ss.Uniform(0.6, 1.4), Gaussian(1.0, 0.3)])
def test_cold_contacts_answer_as_without_temperature_however_fast(thresholds):
    bare = case(thresholds)
    s = 1j * np.array([1.0, 30.0, 300.0])
    hardly = ss.model.Parabolic(temperature=0.001, attempts=1e-9)
    cold = dynamic_stiffness(replace(bare, activation=hardly), 1.0, s)
    assert cold == pytest.approx(dynamic_stiffness(bare, 1.0, s), abs=1e-8)


@pytest.mark.parametrize("thresholds", [ss.LogNormal(1.0, 0.3), TENTH])
def test_growing_contacts_answer_as_without_temperature(thresholds):
    """Contact by contact, as one variable does: the weakest break as they attach."""
    bare = replace(case(thresholds), ageing=ss.ExponentialGrowth(rate=1.0))
    s = 1j * np.array([0.1, 1.0, 10.0])
    cold = replace(bare, activation=ss.Bell(width=0.05, attempts=1e-9))
    wanted = dynamic_stiffness(bare, 1.0, s)
    assert dynamic_stiffness(cold, 1.0, s) == pytest.approx(wanted, rel=1e-7)


def test_a_long_scan_of_an_undamped_rig_is_as_exact_as_a_short_one():
    weak = case(ss.Weibull(1.0, 1.5))
    body = ss.Slider(stiffness=2.0, mass=1e-4, damping=0.0)
    # as every wave number by itself gives it, in 20 s
    spring = critical_spring(rig(1.5, on=weak, body=body))
    assert spring == pytest.approx(482041.34859292756, rel=1e-9)


HEAT = ss.Bell(width=0.01, attempts=1e6)
WARM = ss.Interface(thresholds=TENTH, ageing=ss.Langevin(rate=1.0), activation=HEAT)
AT_ONCE = ss.Interface(thresholds=TENTH, ageing=ss.ExponentialGrowth(rate=0.2))
SHARP = ss.Interface(thresholds=Gaussian(1.0, 1e-5), ageing=ss.Langevin(rate=1.0))
NO_ANSWER = (
    lambda: dynamic_stiffness(case(delay=ss.Delay(math.inf)), 1.0, 1j),
    "never re-attach",
    lambda: growth_rate(rig(on=case(Gaussian(mean=1.0, std=0.0)))),
    "share one threshold",
    lambda: critical_spring(rig(on=WARM)),
    lambda: count_unstable(rig(on=WARM)),
    lambda: growth_rate(rig(on=WARM)),
    "thresholds that age by Langevin",
    lambda: growth_rate(rig(0.01, on=SHARP)),
    r"^Interface\.thresholds: their standard deviation is 1e-05 of the",
    lambda: onset(rig(on=SHARP), "delay", between=(1e-3, 1e2)),
    "newborn = 0",
    lambda: AGEING.get(rig()),
    "has no ageing to vary",
    lambda: dynamic_stiffness(case(ss.LogNormal(mean=1.0, std=0.3)), 1.0, -0.1 + 1j),
    "no transform",
    lambda: dynamic_stiffness(INTERFACE, 1.0, -1e6),
    "overflows",
    lambda: critical(rig(-1.0), "delay"),
    lambda: critical_spring(rig(-1.0)),
    "^velocity = -1: must be a finite number above 0",
    lambda: critical(rig(), "speed", between=(1, 2)),
    "must be one of stiffness",
    lambda: critical(rig(body=lambda s: 2.0 + 0 * s), "mass", between=(1e-3, 1)),
    "no mass",
    lambda: critical(rig(on=case(ss.Exponential(mean=1.0))), "std", between=(0.1, 1)),
    "no std to vary",
    lambda: boundary(rig(), over=("mass", "mass"), between=((1, 2), (1, 2))),
    "two different parameters",
    lambda: boundary(rig(), between=((0.1, 10.0),)),
    "^between = .*: must be a range of each parameter",
    lambda: count_unstable(rig(body=lambda s: 1e-4 * s * s)),
    r"Z\(0\)",
    lambda: count_unstable(rig(body=lambda s: 2.0 - 0.01 * s + 1e-4 * s * s)),
    "puts energy in",
    lambda: growth_rate(rig(on=AT_ONCE)),
    lambda: growth_rate(rig(0.27, on=AT_ONCE)),
    "nearly all contacts break as they attach",
    lambda: Modes(masses=(1.0, 1.0), stiffnesses=(1.0, 1.0), dampings=(1.0, 0.0)),
    r"Modes.dampings\[1\] = 0",
    lambda: Modes(masses=(1.0,), stiffnesses=(0.0,), dampings=(1.0,)),
    "Modes.stiffness: is 0: nothing holds the slider",
)


@refused(*NO_ANSWER)
def test_what_has_no_answer_is_refused(call, message):
    with pytest.raises(ss.InputError, match=message):
        call()


# ---------------------------------------------------------------- impedances


@pytest.mark.parametrize("velocity", [0.5, 1.4, 3.0])
def test_every_way_to_write_the_same_slider(velocity):
    k = SLIDER.stiffness
    m = SLIDER.mass
    eta = SLIDER.damping
    same = [
        SLIDER,
        RadiationDamping(stiffness=k, radiation=m * eta, mass=m),
        # equals two modes in series, each twice as heavy and stiff
        Modes(masses=(2 * m, 2 * m), stiffnesses=(2 * k, 2 * k), dampings=(eta, eta)),
        lambda s: k + m * eta * s + m * s * s,
    ]
    rigs = [rig(velocity, body=body) for body in same]
    roots = [growth_rate(each) for each in rigs]
    springs = [critical_spring(each) for each in rigs[:2]]
    assert roots == pytest.approx([roots[0]] * len(same), rel=1e-9)
    assert springs == pytest.approx([springs[0]] * 2, rel=1e-10)
    assert len({count_unstable(each) for each in rigs}) == 1


def test_receptances_of_modes_add():
    body = Modes(
        masses=(1e-3, 2e-3, 5e-4),
        stiffnesses=(3.0, 40.0, 90.0),
        dampings=(2.0, 0.5, 11.0),
        stiffness=0.4,
    )
    s = np.array([0.3 + 4j, 60j, -5 + 100j, 2.0])
    modes = zip(body.masses, body.stiffnesses, body.dampings, strict=True)
    softness = sum(1 / (m * s * (s + e) + k) for m, k, e in modes)
    assert body(s) == pytest.approx(0.4 + 1 / softness, rel=1e-12)
    # A function with unknown poles is searched like one with known poles.
    known = rig(2.0, body=body)
    unknown = rig(2.0, body=body.__call__)
    root = growth_rate(known)
    total = body(np.array([root]))[0] + dynamic_stiffness(INTERFACE, 2.0, root)
    assert abs(total) < 1e-10
    assert growth_rate(unknown) == pytest.approx(root, rel=1e-9)
    assert count_unstable(unknown) == count_unstable(known) > 0


def test_a_massless_slider_is_the_limit_of_a_light_one():
    bodies = {"mass": 0.0, "damping": 0.0}, {"mass": 1e-9, "damping": 1.0}
    first, light = (
        critical(rig(**body), "velocity", between=(0.1, 10)).edges[0] for body in bodies
    )
    assert abs(by_hand(1j * first.frequency, velocity=first.value, mass=0.0)) < 1e-12
    spring = critical_spring(rig(first.value, **bodies[0]))
    assert spring == pytest.approx(2.0, rel=1e-9)
    assert light.value == pytest.approx(first.value, rel=1e-6)


# ---------------------------------------------------------------- boundaries and maps


BRAKE = ss.example("brake_pad")


def curves(dataset):
    return [dataset.isel(point=dataset.curve == k) for k in np.unique(dataset.curve)]


def test_boundary_over_stiffness_and_velocity_against_the_pointwise_answer():
    shares = []
    window = (0.2, 10.0), (0.2, 10.0)
    found = boundary(rig(), between=window, progress=shares.append)
    assert found.sizes["point"] > 20
    assert shares == sorted(shares)
    assert 0.5 < shares[0] < shares[-1] == pytest.approx(1.0, abs=0.05)
    names = "stiffness", "velocity", "frequency"
    stiffness, velocity, frequency = (found[name].to_numpy() for name in names)
    springs = [critical_spring(rig(v)) for v in velocity[::4]]
    assert springs == pytest.approx(stiffness[::4], rel=1e-9)
    total = by_hand(1j * frequency, velocity=velocity, stiffness=stiffness)
    assert np.abs(total).max() < 1e-9
    assert set(found.data_vars) == {*names, "curve"}
    assert all({"units", "long_name"} <= set(v.attrs) for v in found.data_vars.values())
    assert read_provenance(found)["arguments"]["within"] == [[0.2, 10.0], [0.2, 10.0]]


@pytest.mark.slow
def test_boundary_holds_the_limit_without_oscillation():
    growth = ss.ExponentialGrowth(rate=1.0, newborn=0.5)
    light = {"mass": 0, "damping": 0}
    light["on"] = replace(case(delay=ss.Delay(0)), ageing=growth)
    found = boundary(rig(**light), between=((0.05, 1.0), (0.8, 1.25)))
    still = found.isel(point=np.isinf(found.frequency.values))
    assert still.sizes["point"] > 5
    for k, v in np.transpose([still.stiffness, still.velocity])[::3].tolist():
        sides = (rig(v, stiffness=k * by, **light) for by in (1 - 1e-6, 1 + 1e-6))
        assert [count_unstable(side) for side in sides] == [1, 0]


def test_boundary_goes_round_its_folds():
    # K_c(v) rises and falls again, so over the stiffness the curve turns back; both
    # branches are on one curve.
    found = boundary(rig(), between=((4.0, 60.0), (0.5, 200.0)))
    first = max(curves(found), key=lambda curve: curve.sizes["point"])
    assert np.sum(np.diff(np.sign(np.diff(np.log(first.stiffness.values)))) != 0) >= 1
    for stiffness in (8.0, 20.0):
        held = rig(stiffness=stiffness)
        for crossing in critical(held, "velocity", between=(0.5, 200)).edges:
            away = np.log(found["stiffness"] / stiffness) ** 2
            away += np.log(found["velocity"] / crossing.value) ** 2
            away += np.log(found["frequency"] / crossing.frequency) ** 2
            assert float(away.min()) < 0.15**2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("held", "over", "within"),
    [
        (rig(3.0), ("velocity", "delay"), ((0.3, 5.0), (0.03, 0.5))),
        (rig(3.0), ("mass", "damping"), ((1e-5, 1e-2), (10.0, 1e4))),
        (rig(3.0), ("std", "delay"), ((0.06, 0.3), (0.05, 0.4))),
        # The load and the level of friction change the units in which the other
        # parameter is natural.
        (BRAKE, ("velocity", "load"), None),
        (BRAKE, ("load", "stiffness"), None),
        (BRAKE, ("friction", "velocity"), None),
    ],
)
def test_boundary_over_any_two_parameters_separates_the_counts(held, over, within):
    values = [held.value(name) for name in over]
    within = within or [(value / 20.0, value * 20.0) for value in values]
    found = boundary(held, over=over, between=within)
    assert found.sizes["point"] > 10
    for curve in curves(found):
        a, b = np.log(curve[over[0]].values), np.log(curve[over[1]].values)
        for k in range(1, curve.sizes["point"] - 1, 5):
            across = np.array([-(b[k + 1] - b[k - 1]), a[k + 1] - a[k - 1]])
            across *= 1e-5 / np.hypot(*across)
            sides = (np.exp([a[k], b[k]] + sign * across).tolist() for sign in (1, -1))
            values = (dict(zip(over, side, strict=True)) for side in sides)
            counts = [count_unstable(held.with_values(**each)) for each in values]
            assert sorted(counts) == [0, 2]


RANGES = {"stiffness": (0.1, 10), "velocity": (0.1, 10), "delay": (0.02, 0.5)}
RANGES |= {"mass": (1e-5, 1), "damping": (1, 1e3)}


@pytest.mark.parametrize(
    "over",
    [
        (STIFFNESS, VELOCITY),
        ("velocity", "stiffness"),
        ("velocity", "delay"),
        ("mass", "damping"),
    ],
    ids=str,
)
def test_a_map_is_the_count_and_the_growth_rate_at_each_point(over):
    first, second = (parameter_named(name) for name in over)
    values = np.geomspace(*RANGES[first.name], 7), np.geomspace(*RANGES[second.name], 8)
    found = stability_map(rig(2.0), over=over, values=values, growth=True)
    assert dict(found.unstable_modes.sizes) == {first.name: 7, second.name: 8}
    for i in range(0, 7, 2):
        for j in range(0, 8, 3):
            here = second.set(first.set(rig(2.0), values[0][i]), values[1][j])
            there = found[{first.name: i, second.name: j}]
            assert there.unstable_modes == count_unstable(here)
            root = complex(there.growth_rate, there.frequency)
            assert root == pytest.approx(growth_rate(here), rel=1e-8)
    assert found.growth_rate.attrs["units"] == "1/time"
    thresholds = read_provenance(found)["arguments"]["interface"]["thresholds"]
    assert thresholds["class"] == "Gaussian"


# ---------------------------------------------------------------- thresholds that age


def aged(rate, velocity=1.0, interface=FIG8.interface, **changes):
    """The rig of Fig. 8 with a rate of ageing."""
    contacts = replace(interface, ageing=ss.Langevin(rate=rate))
    return ss.Rig(contacts, replace(FIG8.slider, **changes), ss.constant(velocity))


def lost_balance(rate, velocity, s, **changes):
    """``|Z + kappa|``."""
    held = aged(rate, velocity, **changes)
    kappa = complex(dynamic_stiffness(held.interface, velocity, s))
    return abs(impedance(held.slider)(s) + kappa)


def test_growth_rates_of_ageing_contacts_solve_the_equation_of_modes():
    s = growth_rate(aged(1.5))
    assert s.real > 0
    assert lost_balance(1.5, 1.0, s) < 1e-4
    assert growth_rate(aged(1.7)).real < 0
    with pytest.raises(ss.UndecidedError, match="is stable"):
        growth_rate(aged(2.0, stiffness=5.0))


def test_first_critical_velocity_lies_where_figures_9_and_10_have_it():
    (edge,) = critical(aged(1.5), "velocity", between=(0.5, 1.2))
    assert (edge.unstable_below, edge.unstable_above) == (0, 2)
    assert edge.value == pytest.approx(0.8687, abs=1e-3)
    assert lost_balance(1.5, edge.value, 1j * edge.frequency) < 1e-3
    # At a low rate of ageing smooth sliding is stable between the window of Fig. 9 and
    # one of fast oscillations.
    crossings = critical(aged(1.0), "velocity", between=(0.3, 6.0))
    assert [edge.loses_stability for edge in crossings.edges] == [True, False] * 2
    for edge in crossings:
        assert lost_balance(1.0, edge.value, 1j * edge.frequency) < 1e-3


@pytest.mark.parametrize(
    ("speed", "newborn", "delay"),
    [(0.3, 0.0, 0.0), (1.0, 0.3, 0.0), (1.0, 0.3, 0.2), (3, 0.1, 1)],
)
def test_to_fast_perturbations_most_contacts_are_springs(speed, newborn, delay):
    """Kappa is below the attached fraction by ``C (1 - i)/sqrt(omega)``, because
    contacts diffuse to their thresholds.
    """
    ageing = ss.Langevin(rate=1.0, newborn=newborn)
    contacts = replace(FIG8.interface, ageing=ageing, delay=ss.Delay(delay))
    omega = np.array([1e5, 1e6, 1e7, 1e14])
    *kappa, attached = dynamic_stiffness(contacts, speed, 1j * omega)
    short = (attached.real - np.array(kappa)) * np.sqrt(omega[:-1])
    np.testing.assert_allclose(short.real, short[0].real, rtol=0.01)
    np.testing.assert_allclose(-short[1:].imag, short[0].real, rtol=0.03)
    expected = pytest.approx(1.0, abs=1e-5)
    assert attached.real == expected if delay == 0 else attached.real < 0.9


def test_rates_of_ageing_at_the_edges_of_figure_8():
    unaged = ss.Rig(FIG8.interface, FIG8.slider, ss.constant(1.0))
    found = critical(unaged, AGEING, between=(0.2, 3.0))
    widths = sorted(edge.value**-0.5 for edge in found.edges)
    assert widths == pytest.approx([0.80, 1.63], abs=0.03)
    assert AGEING.get(aged(1.5)) == pytest.approx(1 / 2.25)


def test_a_spring_and_a_delay_of_ageing_contacts_are_critical_where_the_count_changes():
    spring = critical_spring(aged(1.5, 1.2))
    sides = (aged(1.5, 1.2, stiffness=factor * spring) for factor in (0.97, 1.03))
    assert [count_unstable(side) for side in sides] == [2, 0]
    ageing = ss.Langevin(rate=1.5, newborn=0.3)
    strong = replace(FIG8.interface, ageing=ageing, delay=ss.Delay(0.01))
    held = ss.Rig(strong, FIG8.slider, ss.constant(3.5))
    delay = onset(held, "delay", between=(1e-3 / 3.5, 1e2 / 3.5))
    sides = (held.replace(delay=factor * delay) for factor in (0.9, 1.1))
    assert [count_unstable(side) for side in sides] == [0, 2]


@pytest.mark.slow
def test_a_map_and_a_boundary_of_ageing_contacts():
    grids = np.array([0.5, 1.5]), np.array([0.8, 1.2, 2.5])
    found = stability_map(aged(1.5), values=grids, growth=True)
    assert found["unstable_modes"].to_numpy().tolist() == [[2, 2, 2], [0, 2, 2]]
    np.testing.assert_array_equal(found["growth_rate"] > 0, found["unstable_modes"] > 0)
    found = boundary(aged(1.5), between=((0.8, 1.6), (0.7, 1.4)))
    assert found.sizes["point"] > 5
    names = "velocity", "frequency", "stiffness"
    for point in range(0, found.sizes["point"], 4):
        v, omega, k = (float(found[name][point]) for name in names)
        assert lost_balance(1.5, v, 1j * omega, stiffness=k) < 1e-3


@pytest.mark.parametrize("half", [0.126, 0.2])
def test_a_mode_on_the_stability_boundary_grows_by_rounding_or_not(half):
    """At a critical mass, where rounding decides the count of growing modes."""
    with_mass = rig(on=case(RaisedCosine(half), ss.Delay(0.1)), mass=3e-3, damping=3.0)
    crossings = critical(with_mass, "mass", between=(1e-4, 1e-1))
    assert crossings.edges
    for edge in crossings.edges:
        for by in (1.0 - 1e-15, 1.0, 1.0 + 1e-15):
            root = growth_rate(with_mass.replace(mass=edge.value * by))
            assert abs(root.real) < 1e-9
            assert root.imag == pytest.approx(edge.frequency, rel=1e-9)


def test_lives_of_contacts_that_draw_are_computed_once_for_all_speeds(monkeypatch):
    """And the scan finds the same response from them."""
    waves = []
    summed = drawn._summed

    def counted(lives, q):
        waves.append(q.size)
        return summed(lives, q)

    monkeypatch.setattr(drawn, "_summed", counted)
    on = case(Gaussian(1.0, 0.02))
    response = respond(replace(on, newborn=Gaussian(0.3, 0.0171)))
    for velocity, most in ((1.0, 1e4), (0.01, 1e3), (40.0, 1e3)):
        waves.clear()
        omega, found = response.sampled(velocity, math.inf)
        assert sum(waves) < most
        kappa = (found.numerator / found.denominator)[::100]
        exact = response.stiffness(velocity, 1j * omega[::100])
        np.testing.assert_allclose(kappa, exact, rtol=1e-5)


def test_contacts_that_hardly_age_have_the_growth_rates_of_others():
    growth = ss.LogarithmicGrowth(slope=1e-7, time=1.0)
    far = case(ss.Uniform(0.3, 1.7), ss.Delay(0.01))  # quicker modes lie beside it
    for on, v, K in ((case(TENTH, ss.Delay(2.0)), 100.0, 0.2), (far, 0.4, 10.0)):
        body = ss.Slider(stiffness=K, mass=1e-3, damping=100.0 / v)
        rigs = [rig(v, on=replace(on, ageing=how), body=body) for how in (None, growth)]
        assert count_unstable(rigs[0]) == count_unstable(rigs[1])
        settled, ageing = map(growth_rate, rigs)
        assert ageing == pytest.approx(settled, rel=1e-6)
