"""Every distribution against quadrature of its own density, and properties that every
distribution must have.

The distributions are those of ``conftest.py``, by the fixtures ``distribution``
(thresholds) and ``any_distribution`` (also those below zero).
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.special import iv

import stickslip as ss
from stickslip.model.distribution import table_of
from stickslip.model.distributions import Distribution, SteadyState, excess

_NODE, _WEIGHT = np.polynomial.legendre.leggauss(16)


def quadrature(
    distribution: Distribution, above: float = -math.inf, per_octave: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights for the mean of a smooth function over values above a
    bound.

    Gauss-Legendre on panels between the jumps, ever narrower towards each jump, so that
    a power law there does no harm.
    """
    low, high = distribution.support
    # Moments and transforms depend more on a tail than the probability does.
    steady = isinstance(distribution, SteadyState)
    tail = distribution.thresholds if steady else distribution
    least = 1e-200 if isinstance(tail, ss.Gaussian) else 1e-60
    high = max(high, float(tail.inverse_survival(least)))
    if isinstance(distribution, ss.Gaussian):
        low = max(distribution.lower, 2 * distribution.mean - high)
    inner = {knot for knot in kinks(distribution) if low < knot < high}
    if low < above < high:
        inner.add(above)
    edges = [high]
    for a, b in pairwise(sorted({low, high} | inner)):
        if b > above:
            graded = (b - a) * 2.0 ** (-np.arange(1, 140 * per_octave) / per_octave)
            edges += [a, *(a + graded), *np.linspace(a, b, 257 * per_octave)]
    edges = np.unique(np.array(edges))
    half = 0.5 * np.diff(edges)[:, None]
    nodes = edges[:-1, None] + half * (1 + _NODE)
    return nodes.ravel(), (half * _WEIGHT * distribution.density(nodes)).ravel()


def kinks(distribution: Distribution) -> tuple[float, ...]:
    """Return the values at which the density or its slope jumps."""
    steady = isinstance(distribution, SteadyState)
    return distribution.knots + (kinks(distribution.thresholds) if steady else ())


def levels(distribution: Distribution) -> np.ndarray:
    """Return stretchings from below to above all values of the distribution."""
    low, high = distribution.support
    levels = [1 - 1e-6, 0.99, 0.9, 0.7, 0.5, 0.3, 0.1, 1e-2, 1e-5, 1e-9]
    quantiles = distribution.inverse_survival(np.array(levels))
    return np.array([low - 1.0, *quantiles, high + 1.0, *distribution.knots])


@pytest.mark.parametrize("order", range(4))
def test_moments_beyond_a_bound(any_distribution, order):
    nodes, weights = quadrature(any_distribution)
    scale = float(np.sum(weights * np.abs(nodes) ** order))
    for x in levels(any_distribution):
        node, weight = quadrature(any_distribution, above=float(x))
        expected = float(np.sum(weight * node**order))
        expected = pytest.approx(expected, rel=1e-11, abs=1e-13 * scale)
        assert any_distribution.partial_moment(x, order) == expected, x
        expected = float(np.sum(weight * (node - x) ** order)) / math.factorial(order)
        # The closed form subtracts terms of the size of x**order.
        rounding = 1e-13 * (scale + abs(x)) ** max(order, 1)
        expected = pytest.approx(expected, rel=1e-10, abs=rounding)
        assert excess(any_distribution, x, order) == expected, x


@pytest.mark.eq(3)
def test_hazard_is_density_over_survival_and_a_slope(any_distribution):
    """The hazard also is minus the slope of the logarithm of the survival function."""
    x = any_distribution.inverse_survival(np.linspace(0.95, 0.05, 19))
    product = any_distribution.hazard(x) * any_distribution.survival(x)
    np.testing.assert_allclose(product, any_distribution.density(x), rtol=1e-14)
    h = 1e-5 * any_distribution.standard_deviation()
    knots = np.array([*kinks(any_distribution), math.inf])
    smooth = np.all(np.abs(x[:, None] - knots) > 2 * h, axis=1)
    before, after = (np.log(any_distribution.survival(x + by)) for by in (-h, h))
    slope = (before - after) / (2 * h)
    # Second order in h (1e-10 of the third derivative), and rounding of the logarithms
    # over h (1e-11).
    hazard = any_distribution.hazard(x)[smooth]
    np.testing.assert_allclose(slope[smooth], hazard, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("order", [0, 1])
def test_laplace(any_distribution, order):
    node, weight = quadrature(any_distribution, per_octave=20)
    limit = -any_distribution.leftmost
    reach = 1.0 / any_distribution.standard_deviation()
    wanted = [0.0, 1e-9, 1e-3j, 0.4 + 0.1j, 3.0, 5.0 + 2.0j, -1e-3, 2j, 8 + 30j, 40j]
    near = reach * np.array([0.5, 1j, 3j, -0.5, -0.5 + 2j, -3.0 + 1j])
    wanted = np.append(wanted, near)
    known = wanted.real > -0.6 * limit if limit > 0 else wanted.real >= 0
    wanted = wanted[known]
    for q in wanted:
        exact = np.sum(weight * node**order * np.exp(-q * node))
        # Rounding: the terms that cancel are as large as the transform at the real
        # part.
        scale = np.sum(weight * np.abs(node) ** order * np.exp(-q.real * node))
        found = any_distribution.transform(np.array(q))[order]
        assert abs(found - exact) <= 1e-11 * scale, q


def test_laplace_takes_large_arguments_without_overflow(distribution):
    distribution = distribution.positive()
    q = np.array([1e3, 1e5, 1e5 + 1e5j, 700j])
    values = distribution.laplace(q)
    assert np.all(np.isfinite(values))
    most = distribution.laplace(q.real).real * (1 + 1e-9) + 1e-15
    assert np.all(np.abs(values) <= most)


def test_survival_falls_from_one_to_zero_and_its_inverse_leads_back(any_distribution):
    p = np.concatenate([np.geomspace(1e-12, 0.4, 60), 1 - np.geomspace(0.5, 1e-9, 60)])
    x = any_distribution.inverse_survival(p)
    # An ulp of x shifts p by the density times that ulp.
    density = any_distribution.density(x)
    slack = 8 * 4e-16 * np.abs(x) * np.where(np.isfinite(density), density, 0)
    assert np.all(np.abs(any_distribution.survival(x) - p) <= 1e-13 * p + 3e-16 + slack)
    assert np.all(np.diff(any_distribution.inverse_survival(np.sort(p))) <= 0)
    survival = any_distribution.survival(np.linspace(-3.0, 12.0, 101))
    assert np.all((survival >= 0) & (survival <= 1 + 1e-15))
    assert np.all(np.diff(survival) <= 1e-15)
    low, high = any_distribution.support
    assert (low < high, any_distribution.survival(high) <= 1.2e-16) == (True, True)
    assert any_distribution.survival(low) >= 1 - 2.3e-16


def largest_gap(distribution: Distribution, values: np.ndarray) -> float:
    """Return Kolmogorov's distance between values and the survival function."""
    beyond = distribution.survival(np.sort(values))
    n = values.size
    ranks = np.arange(n)
    off = [np.abs(1 - rank / n - beyond) for rank in (ranks, ranks + 1)]
    return float(np.max(off))


def allowed_gap(n: int) -> float:
    """Return the bound of Dvoretzky, Kiefer, Wolfowitz and Massart that is exceeded
    once in 1e9 seeds.
    """
    return math.sqrt(math.log(2e9) / (2 * n))


def test_samples_follow_the_distribution(any_distribution):
    n = 20_000
    values = any_distribution.sample(np.random.default_rng(1), n)
    assert (values.shape, values.dtype) == ((n,), np.float64)
    assert any_distribution.support[0] < 0 or values.min() > 0
    assert largest_gap(any_distribution, values) < allowed_gap(n)
    node, weight = quadrature(any_distribution)
    mean = np.sum(weight * node)
    variance, fourth = (np.sum(weight * (node - mean) ** p) for p in (2, 4))
    assert abs(values.mean() - mean) < 6 * math.sqrt(variance / n)
    assert abs(values.var() - variance) < 6 * math.sqrt((fourth - variance**2) / n)


@pytest.mark.parametrize("beyond", [0.9, 0.3, 1e-4, 1e-9])
def test_samples_beyond_a_bound_follow_the_distribution_there(any_distribution, beyond):
    n = 5_000
    bound = float(any_distribution.inverse_survival(beyond))
    values = any_distribution.sample_beyond(np.random.default_rng(4), np.full(n, bound))
    assert values.min() >= bound
    # J(x)/J(bound) is uniform: compare it with the uniform distribution.
    share = any_distribution.survival(values) / any_distribution.survival(bound)
    assert largest_gap(ss.Uniform(low=0.0, high=1.0), share) < allowed_gap(n)


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,)])
def test_answers_have_the_shape_of_the_question(any_distribution, shape):
    x = np.full(shape, 0.5)
    p = np.full(shape, 0.3)
    asked = any_distribution
    answers = [
        asked.density(x),
        asked.survival(x),
        asked.hazard(x),
        asked.partial_moment(x, 2),
        excess(asked, x, 2),
    ]
    answers += [asked.inverse_survival(p)] + [asked.laplace(x)] * (shape != (0,))
    assert [answer.shape for answer in answers] == [shape] * len(answers)


def test_positive_conditions_on_positive_values(any_distribution):
    conditioned = any_distribution.positive()
    share = float(any_distribution.survival(0.0))
    x = np.linspace(1e-3, 2.0, 50)
    expected = any_distribution.density(x) / share
    np.testing.assert_allclose(conditioned.density(x), expected, rtol=1e-12)
    assert conditioned.survival(0.0) == pytest.approx(1.0, abs=1e-15)
    assert conditioned.density(-1e-3) == 0
    mean = float(any_distribution.partial_moment(0.0, 1)) / share
    assert conditioned.moment(1) == pytest.approx(mean, rel=1e-12)
    assert conditioned.positive() == conditioned


def test_knots_are_where_the_density_jumps(any_distribution):
    low, high = any_distribution.support

    def largest_step(count: int) -> float:
        x = np.linspace(low - 0.1, high + 0.1, count)
        knots = np.array([*any_distribution.knots, math.inf])
        clear = np.all(np.abs(x[:, None] - knots) > 0.02, axis=1)
        jumps = np.abs(np.diff(any_distribution.density(x)))
        return float(np.max(jumps[clear[1:] & clear[:-1]]))

    # Between knots a step halves with the spacing; a jump would stay.
    assert largest_step(40_001) <= 0.6 * largest_step(20_001)


def test_another_standard_deviation_keeps_the_mean_and_the_form(any_distribution):
    if not hasattr(any_distribution, "with_std"):
        return
    wider = any_distribution.with_std(1.7 * any_distribution.std)
    mean = any_distribution.moment(1)
    expected = pytest.approx((mean, 1.7 * any_distribution.std))
    assert (wider.moment(1), wider.std) == expected
    x = np.array(any_distribution.support)
    np.testing.assert_allclose(wider.support, mean + 1.7 * (x - mean))


def test_gaussian_laplace_in_closed_form_far_left():
    distribution = ss.Gaussian(mean=1.0, std=0.1)
    q = -30 + 5j
    expected = np.exp(-q + 0.005 * q * q)
    assert distribution.laplace(q) == pytest.approx(expected, rel=1e-14)
    # A cut ten deviations away changes nothing, on either side of where the two
    # formulas meet.
    for q in (-30 + 5j, 99 + 1j, 101 - 1j, 99 + 40j, 101 + 40j):
        plain = pytest.approx(complex(distribution.laplace(q)), rel=1e-6, abs=1e-20)
        assert replace(distribution, lower=0.0).laplace(q) == plain


def test_a_distribution_of_one_value():
    distribution = ss.Gaussian(mean=1.5, std=0.0)
    survival = distribution.survival([1.0, 1.4999, 1.5, 2.0])
    assert survival.tolist() == [1.0, 1.0, 0.0, 0.0]
    assert [distribution.moment(n) for n in range(4)] == [1.0, 1.5, 2.25, 3.375]
    assert distribution.laplace(2j) == pytest.approx(np.exp(-3j), rel=1e-15)
    rng = np.random.default_rng(0)
    for all_alike in (
        distribution.sample(rng, 2),
        distribution.sample_beyond(rng, [0.2, 1.4]),
        distribution.support,
    ):
        assert list(all_alike) == [1.5, 1.5]
    means = excess(distribution, [0.5, 1.5, 2.0], 1)
    np.testing.assert_allclose(means, [1.0, 0.0, 0.0])
    for ask in (distribution.density, distribution.hazard):
        message = "give a standard deviation above 0, or use the method"
        with pytest.raises(ss.InputError, match=rf"^Gaussian\.std = 0: .*{message}"):
            ask(1.0)


def test_empirical_from_samples_is_the_histogram():
    values = np.random.default_rng(7).normal(1.0, 0.1, 500)
    distribution = ss.Empirical.from_samples(values.reshape(50, 10), bins=12)
    counts, edges = np.histogram(values, bins=12)
    assert distribution.edges == tuple(edges.tolist())
    np.testing.assert_allclose(distribution.weights, counts / 500, rtol=1e-15)
    # The density is constant within a bin, so the mean is off by at most half a bin.
    assert abs(distribution.moment(1) - values.mean()) < 0.5 * (edges[1] - edges[0])
    assert len(ss.Empirical.from_samples(values).weights) > 5


@pytest.mark.eq(1)
def test_the_steady_state_is_the_fixed_point_of_the_master_equation(distribution):
    """(d/dx + P) Q_s = 0 for x > 0; at x = 0 all broken contacts re-attach."""
    steady = SteadyState(thresholds=distribution)
    x = distribution.inverse_survival(np.linspace(0.95, 0.05, 19))
    h = 1e-6 * distribution.standard_deviation()
    away = np.abs(x[:, None] - np.array([0.0, *kinks(distribution)]))
    x = x[np.all(away > 2 * h, axis=1)]
    slope = (steady.density(x + h) - steady.density(x - h)) / (2 * h)
    flux = distribution.hazard(x) * steady.density(x)
    np.testing.assert_allclose(-slope, flux, rtol=1e-5, atol=1e-7)
    node, weight = quadrature(steady)
    node = node[weight > 0]
    weight = weight[weight > 0]
    # Gamma = Int P Q dx = Q(0): as many contacts attach as break.
    born = float(steady.density(0.0))
    broken = float(np.sum(weight * distribution.hazard(node)))
    singular = not math.isfinite(float(distribution.density(1e-300)))
    assert broken == pytest.approx(born, rel=1e-4 if singular else 1e-9)
    # The mean stretching is the kinetic friction.
    friction = distribution.moment(2) / (2 * distribution.moment(1))
    assert steady.moment(1) == pytest.approx(friction, rel=1e-12)


@dataclass(frozen=True)
class Told(Distribution):
    """The values of a distribution without its closed transforms."""

    other: Distribution

    def __getattribute__(self, name):
        told = name in ("density", "partial_moment", "inverse_survival")
        return getattr(self.other, name) if told else super().__getattribute__(name)


@pytest.mark.parametrize(
    ("other", "leftmost"),
    [
        (ss.Exponential(mean=0.5), -2.0),
        (ss.LogNormal(mean=1.0, std=0.6), 0.0),
        (ss.Uniform(low=0.6, high=1.5), -math.inf),
    ],
)
def test_where_a_transform_ends_is_told_from_the_density(other, leftmost):
    assert Told(other).leftmost == pytest.approx(leftmost, rel=1e-3)


def test_a_gaussian_of_which_little_is_left_is_sampled_at_once():
    tail = ss.Gaussian(mean=0.0, std=1.0, lower=4.7)  # one value in 770,000
    values = tail.sample(np.random.default_rng(0), 10_000)
    assert values.min() > 4.7
    error = 5 * tail.standard_deviation() / 100
    assert values.mean() == pytest.approx(tail.moment(1), abs=error)


@dataclass(frozen=True)
class RaisedCosine(Distribution):
    """Smooth, but 1 + cos cancels towards its ends and loses digits."""

    half: float

    def density(self, x):
        y = (np.asarray(x, dtype=float) - 1.0) / self.half
        inside = (1.0 + np.cos(np.pi * y)) / (2.0 * self.half)
        return np.where(np.abs(y) < 1.0, inside, 0.0)

    def exact(self, q):
        s = q * self.half
        return np.exp(-q) * np.sinh(s) / s * math.pi**2 / (math.pi**2 + s * s)


@dataclass(frozen=True)
class Semicircle(Distribution):
    """A semicircle, whose slope is infinite at its ends."""

    half: float

    def density(self, x):
        y = (np.asarray(x, dtype=float) - 1.0) / self.half
        root = np.sqrt(np.maximum(1.0 - y * y, 0.0))
        return 2.0 / (math.pi * self.half) * root

    def exact(self, q):
        s = q * self.half
        return np.exp(-q) * 2.0 * iv(1, s) / s


@pytest.mark.parametrize("half", [0.003, 0.02, 0.1, 0.4, 0.97])
@pytest.mark.parametrize("kind", [RaisedCosine, Semicircle])
def test_a_density_of_few_digits_has_its_transform(kind, half):
    own = kind(half)
    q = np.array([1e-3, 1.0, 0.3 + 2.0j, 5.0 - 7.0j, 1e-4 + 40.0j])
    assert np.abs(own.laplace(q) - own.exact(q)).max() < 1e-12
    assert len(table_of(own).x) < 4000


@pytest.mark.parametrize("std", [0.002, 0.0137, 0.05, 0.3, 0.9])
@pytest.mark.parametrize("kind", [ss.Gamma, ss.Gaussian, ss.LogNormal])
def test_the_table_of_any_width_is_bounded_and_right(kind, std):
    wanted = kind(mean=1.0, std=std)
    told = Told(wanted)
    assert len(table_of(wanted).x) < 4000
    for order in (0, 1, 2):
        found = float(Distribution.partial_moment(told, 1.0 + 0.5 * std, order))
        exact = float(wanted.partial_moment(1.0 + 0.5 * std, order))
        assert found == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("std", [0.005, 0.0137, 0.03])
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_narrow_thresholds_of_every_kind_slide_alike(std, delay):
    """Their growth rates differ only by their skewness, by some std."""
    rates = []
    for kind in (ss.Gamma, ss.Gaussian, ss.LogNormal):
        thresholds = kind(mean=1.0, std=std)
        newborn = ss.Gaussian(mean=0.5, std=0.0)
        interface = ss.Interface(thresholds=thresholds, newborn=newborn)
        interface = replace(interface, delay=ss.Delay(delay))
        slider = ss.Slider(stiffness=1.0, mass=0.003, damping=5.0)
        rates.append(ss.growth_rate(ss.Rig(interface, slider, ss.constant(1.0))))
    assert rates == pytest.approx([rates[1]] * 3, rel=std)


@dataclass(frozen=True)
class Noisy(Distribution):
    """A Gaussian with a relative error that no panel resolves."""

    error: float

    def density(self, x):
        x = np.asarray(x, dtype=float)
        noise = np.sin(1e11 * x)
        return ss.Gaussian(mean=1.0, std=0.2).density(x) * (1.0 + self.error * noise)


def test_a_noisy_density_ends_as_one_or_in_a_refusal():
    assert Noisy(1e-7).moment(1) == pytest.approx(1.0, abs=1e-7)
    with pytest.raises(ss.InputError, match="do not resolve its density near x = "):
        Noisy(0.1).moment(1)


@pytest.mark.takes(4)  # a search along the mass
@pytest.mark.parametrize("own", [RaisedCosine(0.4), Semicircle(0.4)])
def test_a_smooth_density_is_enough_for_a_critical_mass(own):
    """Lighter sliders stick and slip, heavier ones do not."""
    newborn = ss.Gaussian(mean=0.5, std=0.0)
    interface = ss.Interface(thresholds=own, newborn=newborn, delay=ss.Delay(0.1))
    slider = ss.Slider(stiffness=1.0, mass=0.02, damping=5.0)
    rig = ss.Rig(interface, slider, ss.constant(1.0))
    (found,) = ss.critical(rig, "mass", between=(0.015, 0.03))
    lighter = ss.growth_rate(rig.replace(mass=0.98 * found.value))
    heavier = ss.growth_rate(rig.replace(mass=1.02 * found.value))
    assert heavier.real < 0.0 < lighter.real
