"""Every distribution against quadrature of its own density, and what a distribution must be whatever its form.

The distributions are those of ``conftest.py``, by the fixtures ``distribution`` (thresholds) and ``any_distribution``
(those below zero, too).
"""

import math
import pickle
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from stickslip.errors import InputError
from stickslip.model import distributions as thresholds
from stickslip.model.distributions import (
    Distribution,
    Empirical,
    Exponential,
    Gamma,
    Gaussian,
    LogNormal,
    SteadyState,
    Uniform,
    Weibull,
    excess,
)
from stickslip.model.quadrature import _fine_nodes, table_of

# A test may register one of its own.
SHIPPED = {kind for kind in thresholds.DISTRIBUTIONS.values() if kind.__module__.startswith("stickslip.")}

_NODE, _WEIGHT = np.polynomial.legendre.leggauss(16)


def quadrature(
    distribution: Distribution, above: float = -math.inf, per_octave: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights for the mean of a smooth function over values above a bound.

    Gauss-Legendre on panels between the jumps, ever smaller towards each jump so that a power law there does no harm.
    """
    low, high = distribution.support
    # Moments and transforms feel more of a tail than the probability does.
    tail = distribution.thresholds if isinstance(distribution, SteadyState) else distribution
    if isinstance(tail, Gaussian):
        low, high = (
            max(low if tail is not distribution else tail.lower, tail.mean - 38 * tail.std),
            tail.mean + 38 * tail.std,
        )
    else:
        high = max(high, float(tail.inverse_survival(1e-60)))
    inner = {knot for knot in kinks(distribution) if low < knot < high}
    if low < above < high:
        inner.add(above)
    edges = [np.array([high, high])]
    for a, b in pairwise(sorted({low, high} | inner)):
        if b > above:
            graded = (b - a) * 2.0 ** (-np.arange(1, 140 * per_octave) / per_octave)
            edges.append(np.unique(np.concatenate([[a, b], a + graded, np.linspace(a, b, 257 * per_octave)])))
    x, weight = [], []
    for part in edges:
        half = 0.5 * np.diff(part)[:, None]
        x.append((part[:-1, None] + half * (1 + _NODE)).ravel())
        weight.append((half * _WEIGHT).ravel())
    nodes = np.concatenate(x)
    return nodes, np.concatenate(weight) * distribution.density(nodes)


def kinks(distribution: Distribution) -> tuple[float, ...]:
    """Where the density or its slope jumps."""
    return distribution.knots + (kinks(distribution.thresholds) if isinstance(distribution, SteadyState) else ())


def levels(distribution: Distribution) -> np.ndarray:
    """Stretchings from well below to well above the values of the distribution, its quantiles among them."""
    low, high = distribution.support
    quantiles = distribution.inverse_survival(np.array([1 - 1e-6, 0.99, 0.9, 0.7, 0.5, 0.3, 0.1, 1e-2, 1e-5, 1e-9]))
    return np.concatenate([[low - 1.0], quantiles, [high + 1.0], list(distribution.knots)])


def largest_rate(distribution: Distribution) -> float:
    """How far left of zero the transform exists: up to this decay rate of the tail."""
    match distribution:
        case Exponential():
            return 1 / distribution.mean
        case Gamma():
            return 1 / distribution.scale
        case LogNormal():
            return 0.0
        case Weibull():
            return 0.0 if distribution.shape < 1 else math.inf
        case SteadyState():
            return largest_rate(distribution.thresholds)
        case _:
            return math.inf


# ------------------------------------------------------------------------------------------------ the list of
# distributions


def test_the_list_of_distributions_holds_every_kind(distributions):
    assert {type(distribution) for distribution in distributions.values()} == SHIPPED


def test_the_list_in_the_module_holds_every_record():
    records = {
        kind
        for kind in vars(thresholds).values()
        if isinstance(kind, type) and kind is not Distribution and Distribution in kind.__mro__
    }
    assert records == SHIPPED


def test_distributions_of_thresholds_are_positive(distribution):
    assert distribution.positive() == distribution or distribution.survival(0.0) > 1 - 1e-15


# ------------------------------------------------------------------------------------------------ against quadrature


@pytest.mark.parametrize("order", range(4))
def test_partial_moments(any_distribution, order):
    for x in levels(any_distribution):
        node, weight = quadrature(any_distribution, above=float(x))
        expected = float(np.sum(weight * node**order)) if node.size else 0.0
        scale = float(np.sum(np.abs(quadrature(any_distribution)[0]) ** order * quadrature(any_distribution)[1]))
        assert any_distribution.partial_moment(x, order) == pytest.approx(expected, rel=1e-11, abs=1e-13 * scale), x


@pytest.mark.parametrize("order", range(4))
def test_moments(any_distribution, order):
    node, weight = quadrature(any_distribution)
    assert any_distribution.moment(order) == pytest.approx(np.sum(weight * node**order), rel=1e-12, abs=1e-14)


def test_standard_deviation(any_distribution):
    node, weight = quadrature(any_distribution)
    mean = np.sum(weight * node)
    assert any_distribution.standard_deviation() == pytest.approx(
        math.sqrt(np.sum(weight * (node - mean) ** 2)), rel=1e-10
    )


@pytest.mark.eq(3)
def test_survival_is_the_integral_of_the_density(any_distribution):
    for x in levels(any_distribution):
        expected = np.sum(quadrature(any_distribution, above=float(x))[1]) if x < any_distribution.support[1] else 0.0
        assert any_distribution.survival(x) == pytest.approx(expected, rel=1e-11, abs=1e-15), x


@pytest.mark.eq(3)
def test_hazard_is_density_over_survival_and_the_slope_of_the_logarithm(any_distribution):
    x = any_distribution.inverse_survival(np.linspace(0.95, 0.05, 19))
    np.testing.assert_allclose(
        any_distribution.hazard(x) * any_distribution.survival(x), any_distribution.density(x), rtol=1e-14
    )
    h = 1e-5 * any_distribution.standard_deviation()
    smooth = np.array([all(abs(v - knot) > 2 * h for knot in kinks(any_distribution)) for v in x])
    slope = -(np.log(any_distribution.survival(x + h)) - np.log(any_distribution.survival(x - h))) / (2 * h)
    # Second order in h (1e-10 of the third derivative), and rounding of the logarithms over h (1e-11).
    np.testing.assert_allclose(slope[smooth], any_distribution.hazard(x)[smooth], rtol=1e-6, atol=1e-8)


@pytest.mark.eq(3)
def test_hazard_is_infinite_where_nothing_survives(any_distribution):
    far = 1e12
    assert any_distribution.survival(far) == 0
    assert any_distribution.hazard(far) == math.inf


@pytest.mark.parametrize("order", [0, 1])
def test_laplace(any_distribution, order):
    node, weight = quadrature(any_distribution, per_octave=20)
    limit = largest_rate(any_distribution)
    reach = 1.0 / any_distribution.standard_deviation()
    wanted = np.array([0.0, 1e-9, 1e-3j, 0.4 + 0.1j, 3.0, 5.0 + 2.0j, -1e-3, 2j, 8 + 30j, 40j], dtype=complex)
    wanted = np.concatenate([wanted, reach * np.array([0.5, 1j, 3j, -0.5, -0.5 + 2j, -3.0 + 1j])])
    wanted = wanted[wanted.real > -0.6 * limit] if limit > 0 else wanted[wanted.real >= 0]
    for q in wanted:
        exact = np.sum(weight * node**order * np.exp(-q * node))
        # Rounding: what cancels is as large as the transform at the real part.
        scale = np.sum(weight * np.abs(node) ** order * np.exp(-q.real * node))
        assert abs(any_distribution.laplace(q, order) - exact) <= 1e-11 * scale, q


def test_laplace_of_order_one_is_minus_the_slope(any_distribution):
    q, h = 0.7 + 1.3j, 1e-5
    slope = (any_distribution.laplace(q + h) - any_distribution.laplace(q - h)) / (2 * h)
    assert -slope == pytest.approx(complex(any_distribution.laplace(q, 1)), abs=1e-8)


def test_laplace_takes_large_arguments_without_overflow(distribution):
    distribution = distribution.positive()
    q = np.array([1e3, 1e5, 1e5 + 1e5j, 700j])
    values = distribution.laplace(q)
    assert np.all(np.isfinite(values))
    assert np.all(np.abs(values) <= distribution.laplace(q.real).real * (1 + 1e-9) + 1e-15)


@pytest.mark.parametrize(
    "closed",
    [
        Gaussian(mean=1, std=0.1),
        Gaussian(mean=1, std=0.1, lower=0),
        Uniform(low=0, high=1),
        Empirical(edges=(0, 1), weights=(1,)),
    ],
)
def test_laplace_of_higher_order_is_refused_where_it_is_not_defined(closed):
    with pytest.raises(InputError, match=r"laplace\(order=2\): only orders 0 and 1"):
        closed.laplace(1.0, 2)


def test_inverse_survival_round_trip(any_distribution):
    p = np.concatenate([np.geomspace(1e-12, 0.4, 60), 1 - np.geomspace(0.5, 1e-9, 60)])
    x = any_distribution.inverse_survival(p)
    # An ulp of x shifts p by the density times that ulp.
    slack = 4e-16 * np.abs(x) * np.where(np.isfinite(any_distribution.density(x)), any_distribution.density(x), 0) * 8
    assert np.all(np.abs(any_distribution.survival(x) - p) <= 1e-13 * p + 3e-16 + slack)
    assert np.all(np.diff(any_distribution.inverse_survival(np.sort(p))) <= 0)


@pytest.mark.parametrize("order", range(4))
def test_excess(any_distribution, order):
    for x in any_distribution.inverse_survival(np.array([0.999, 0.6, 0.2, 0.01])):
        node, weight = quadrature(any_distribution, above=float(x))
        expected = np.sum(weight * (node - x) ** order) / math.factorial(order)
        # The closed form subtracts terms of the size of x**order.
        assert excess(any_distribution, x, order) == pytest.approx(
            expected, rel=1e-10, abs=1e-13 * (1 + abs(x)) ** order
        )


# ------------------------------------------------------------------------------------------------ sampling


def largest_gap(distribution: Distribution, values: np.ndarray) -> float:
    """Largest distance between the fraction of values beyond x and the survival function (Kolmogorov's)."""
    beyond = distribution.survival(np.sort(values))
    n = values.size
    ranks = np.arange(n)
    return float(max(np.max(np.abs(1 - ranks / n - beyond)), np.max(np.abs(1 - (ranks + 1) / n - beyond))))


def allowed_gap(n: int) -> float:
    """Dvoretzky, Kiefer, Wolfowitz, Massart: exceeded once in 1e9 seeds."""
    return math.sqrt(math.log(2e9) / (2 * n))


def test_samples_follow_the_distribution(any_distribution):
    n = 20_000
    values = any_distribution.sample(np.random.default_rng(1), n)
    assert values.shape == (n,)
    assert values.dtype == np.float64
    assert largest_gap(any_distribution, values) < allowed_gap(n)
    node, weight = quadrature(any_distribution)
    mean = np.sum(weight * node)
    variance, fourth = (np.sum(weight * (node - mean) ** p) for p in (2, 4))
    assert abs(values.mean() - mean) < 6 * math.sqrt(variance / n)
    assert abs(values.var() - variance) < 6 * math.sqrt((fourth - variance**2) / n)


def test_distributions_drawn_are_positive(distribution):
    assert distribution.sample(np.random.default_rng(2), 100_000).min() > 0


def test_the_same_generator_gives_the_same_values(any_distribution):
    first, second = (any_distribution.sample(np.random.default_rng(3), 50) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert any_distribution.sample(np.random.default_rng(3), 0).shape == (0,)


@pytest.mark.parametrize("beyond", [0.9, 0.3, 1e-4, 1e-9])
def test_samples_beyond_a_bound_follow_the_distribution_there(any_distribution, beyond):
    n = 5_000
    bound = float(any_distribution.inverse_survival(beyond))
    values = any_distribution.sample_beyond(np.random.default_rng(4), np.full(n, bound))
    assert values.min() >= bound
    # J(x)/J(bound) is uniform: compare it with the uniform distribution.
    share = any_distribution.survival(values) / any_distribution.survival(bound)
    assert largest_gap(Uniform(low=0.0, high=1.0), share) < allowed_gap(n)


def test_samples_beyond_bounds_of_any_shape(any_distribution):
    bounds = any_distribution.inverse_survival(np.array([[0.9, 0.5, 0.2], [0.7, 0.1, 0.01]]))
    values = any_distribution.sample_beyond(np.random.default_rng(5), bounds)
    assert values.shape == bounds.shape
    assert np.all(values >= bounds)


# ------------------------------------------------------------------------------------------------ shapes and values


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,)])
def test_answers_have_the_shape_of_the_question(any_distribution, shape):
    x, p = np.full(shape, 0.5), np.full(shape, 0.3)
    assert any_distribution.density(x).shape == shape
    assert any_distribution.survival(x).shape == shape
    assert any_distribution.hazard(x).shape == shape
    assert any_distribution.partial_moment(x, 2).shape == shape
    assert any_distribution.inverse_survival(p).shape == shape
    assert excess(any_distribution, x, 2).shape == shape
    if shape != (0,):
        assert any_distribution.laplace(x).shape == shape
        assert any_distribution.laplace(x, 1).shape == shape


def test_distributions_are_values(any_distribution):
    twin = replace(any_distribution)
    assert twin == any_distribution
    assert hash(twin) == hash(any_distribution)
    assert pickle.loads(pickle.dumps(any_distribution)) == any_distribution
    assert isinstance(any_distribution, Distribution)
    with pytest.raises(AttributeError):
        any_distribution.mean = 3.0


def test_the_support_holds_all_but_a_negligible_part(any_distribution):
    low, high = any_distribution.support
    assert low < high
    assert any_distribution.survival(high) <= 1.2e-16
    assert any_distribution.survival(low) >= 1 - 2.3e-16


def test_the_support_of_a_gaussian_leaves_out_as_much_on_each_side():
    left_out = 0.5 * thresholds.NEGLIGIBLE
    low, high = Gaussian(mean=1.0, std=0.1).support
    assert special.ndtr((low - 1.0) / 0.1) / left_out == pytest.approx(1.0, rel=1e-9)
    assert special.ndtr((1.0 - high) / 0.1) / left_out == pytest.approx(1.0, rel=1e-9)
    low, high = (cut := Gaussian(mean=-0.1, std=0.1, lower=0.0)).support
    assert low == 0.0
    assert cut.survival(high) / left_out == pytest.approx(1.0, rel=1e-9)


def test_positive_conditions_on_positive_values(any_distribution):
    conditioned = any_distribution.positive()
    share = float(any_distribution.survival(0.0))
    x = np.linspace(1e-3, 2.0, 50)
    np.testing.assert_allclose(conditioned.density(x), any_distribution.density(x) / share, rtol=1e-12)
    assert conditioned.survival(0.0) == pytest.approx(1.0, abs=1e-15)
    assert conditioned.density(-1e-3) == 0
    assert conditioned.moment(1) == pytest.approx(float(any_distribution.partial_moment(0.0, 1)) / share, rel=1e-12)
    assert conditioned.positive() == conditioned


def test_knots_are_where_the_density_jumps(any_distribution):
    low, high = any_distribution.support

    def largest_step(count: int) -> float:
        x = np.linspace(low - 0.1, high + 0.1, count)
        clear = np.all([np.abs(x - knot) > 0.02 for knot in (*any_distribution.knots, math.inf)], axis=0)
        return float(np.max(np.abs(np.diff(any_distribution.density(x)))[clear[1:] & clear[:-1]]))

    # Between knots a step halves with the spacing; a jump would stay.
    assert largest_step(40_001) <= 0.6 * largest_step(20_001)


# ------------------------------------------------------------------------------------------------ properties


MEAN, STD = st.floats(0.2, 3.0), st.floats(0.03, 2.0)
any_distributions = st.one_of(
    st.builds(Gaussian, mean=MEAN, std=STD),
    st.builds(Gaussian, mean=MEAN, std=STD, lower=st.floats(-1.0, 0.2)),
    st.builds(lambda low, width: Uniform(low=low, high=low + width), st.floats(-1, 2), st.floats(1e-3, 3)),
    st.builds(Exponential, mean=MEAN),
    st.builds(Gamma, mean=MEAN, std=STD),
    st.builds(LogNormal, mean=MEAN, std=STD),
    st.builds(Weibull, scale=MEAN, shape=st.floats(0.5, 8)),
    st.builds(
        lambda start, steps: Empirical(
            edges=tuple((start + np.cumsum([0.0, *(width for width, _ in steps)])).tolist()),
            weights=tuple(weight for _, weight in steps),
        ),
        st.floats(-0.5, 1),
        st.lists(st.tuples(st.floats(0.01, 1), st.floats(0.01, 1)), min_size=1, max_size=6),
    ),
    st.builds(lambda mean, std: SteadyState(thresholds=Gaussian(mean=mean, std=std)), MEAN, STD),
)
places = st.lists(st.floats(-3, 12), min_size=2, max_size=12).map(sorted).map(np.array)


@given(any_distributions, places)
@pytest.mark.eq(3)
def test_survival_falls_from_one_to_zero(some_distribution, x):
    survival = some_distribution.survival(x)
    assert np.all((survival >= 0) & (survival <= 1 + 1e-15))
    assert np.all(np.diff(survival) <= 1e-15)


@given(any_distributions, places)
@pytest.mark.eq(3)
def test_hazard_times_survival_is_the_density(some_distribution, x):
    x = x[(some_distribution.survival(x) > 1e-300) & (x != 0)]
    density = some_distribution.density(x)
    assert np.all(density >= 0)
    np.testing.assert_allclose(
        some_distribution.hazard(x) * some_distribution.survival(x), density, rtol=1e-12, atol=1e-300
    )


@given(any_distributions, st.floats(-3, 12), st.floats(-3, 12))
def test_partial_moments_bracket_one_another(some_distribution, a, b):
    """Between two stretchings the first moment lies between the bounds times the probability."""
    a, b = min(a, b), max(a, b)
    share = float(some_distribution.survival(a) - some_distribution.survival(b))
    first = float(some_distribution.partial_moment(a, 1) - some_distribution.partial_moment(b, 1))
    assert a * share - 1e-13 <= first <= b * share + 1e-13


@given(any_distributions, st.floats(0.01, 5), st.floats(-30, 30))
def test_the_transform_is_largest_on_the_real_axis(some_distribution, real, imaginary):
    bound = some_distribution.laplace(real).real
    assert abs(some_distribution.laplace(complex(real, imaginary))) <= bound * (1 + 1e-10) + 1e-12
    assert some_distribution.laplace(complex(real, -imaginary)) == pytest.approx(
        np.conj(some_distribution.laplace(complex(real, imaginary))), abs=1e-13
    )
    assert some_distribution.laplace(0.0) == pytest.approx(1.0, abs=1e-10)


@given(any_distributions, st.integers(0, 2**32))
def test_a_round_trip_through_probabilities(some_distribution, seed):
    p = np.sort(np.random.default_rng(seed).uniform(1e-6, 1 - 1e-6, 8))
    x = some_distribution.inverse_survival(p)
    assert np.all(np.diff(x) <= 0)
    np.testing.assert_allclose(some_distribution.survival(x), p, rtol=1e-9, atol=1e-12)


# ------------------------------------------------------------------------------------------------ one distribution at a
# time


def test_gaussian_moments_in_closed_form():
    distribution = Gaussian(mean=1.0, std=0.1)
    assert distribution.moment(2) == pytest.approx(1.01, rel=1e-15)
    assert distribution.moment(2) / (2 * distribution.moment(1)) == pytest.approx(0.505, rel=1e-15)
    # PHYSICS 2: F_k at standard deviation .3, cut at zero
    cut = Gaussian(mean=1.0, std=0.3).positive()
    assert cut.moment(2) / (2 * cut.moment(1)) == pytest.approx(0.54498, abs=5e-6)


def test_gaussian_laplace_in_closed_form_far_left():
    distribution = Gaussian(mean=1.0, std=0.1)
    q = -30 + 5j
    assert distribution.laplace(q) == pytest.approx(np.exp(-q + 0.005 * q * q), rel=1e-14)
    # A cut ten deviations away changes nothing, on either side of where the two formulas meet.
    for q in (-30 + 5j, 99 + 1j, 101 - 1j, 99 + 40j, 101 + 40j):
        assert replace(distribution, lower=0.0).laplace(q) == pytest.approx(
            complex(distribution.laplace(q)), rel=1e-6, abs=1e-20
        )


def test_a_distribution_of_one_value():
    distribution = Gaussian(mean=1.5, std=0.0)
    np.testing.assert_array_equal(distribution.survival([1.0, 1.4999, 1.5, 2.0]), [1.0, 1.0, 0.0, 0.0])
    assert [distribution.moment(n) for n in range(4)] == [1.0, 1.5, 2.25, 3.375]
    assert distribution.standard_deviation() == 0
    assert distribution.laplace(2j) == pytest.approx(np.exp(-3j), rel=1e-15)
    assert distribution.laplace(-1.0, 1) == pytest.approx(1.5 * math.exp(1.5), rel=1e-15)
    np.testing.assert_array_equal(distribution.sample(np.random.default_rng(0), 5), np.full(5, 1.5))
    np.testing.assert_array_equal(distribution.inverse_survival([0.1, 0.9]), [1.5, 1.5])
    np.testing.assert_array_equal(distribution.sample_beyond(np.random.default_rng(0), [0.2, 1.4]), [1.5, 1.5])
    assert distribution.support == (1.5, 1.5)
    assert distribution.knots == (1.5,)
    assert distribution.positive().moment(1) == 1.5
    np.testing.assert_allclose(excess(distribution, [0.5, 1.5, 2.0], 1), [1.0, 0.0, 0.0])
    for ask in (distribution.density, distribution.hazard):
        with pytest.raises(
            InputError, match=r"^Gaussian\.std = 0: .*give a standard deviation above 0, or use the method"
        ):
            ask(1.0)


def test_exponential_has_no_memory():
    distribution = Exponential(mean=0.8)
    np.testing.assert_allclose(distribution.hazard(np.linspace(0, 20, 50)), 1 / 0.8, rtol=1e-13)


def test_gamma_of_shape_one_and_weibull_of_shape_one_are_exponential():
    x = np.linspace(0.01, 5, 30)
    for distribution in (Gamma(mean=0.8, std=0.8), Weibull(scale=0.8, shape=1.0)):
        np.testing.assert_allclose(distribution.density(x), Exponential(mean=0.8).density(x), rtol=1e-12)
        np.testing.assert_allclose(distribution.survival(x), Exponential(mean=0.8).survival(x), rtol=1e-12)
        assert distribution.laplace(1 + 2j) == pytest.approx(complex(Exponential(mean=0.8).laplace(1 + 2j)), rel=1e-11)


def test_mean_and_std_are_what_they_say():
    for kind in (Gamma, LogNormal):
        distribution = kind(mean=1.3, std=0.4)
        assert distribution.moment(1) == pytest.approx(1.3, rel=1e-13)
        assert distribution.standard_deviation() == pytest.approx(0.4, rel=1e-12)


def test_weibull_moments_in_closed_form():
    distribution = Weibull(scale=1.1, shape=2.5)
    assert distribution.moment(3) == pytest.approx(1.1**3 * special.gamma(1 + 3 / 2.5), rel=1e-13)


def test_empirical_from_samples_is_the_histogram():
    values = np.random.default_rng(7).normal(1.0, 0.1, 500)
    distribution = Empirical.from_samples(values, bins=12)
    counts, edges = np.histogram(values, bins=12)
    assert distribution.edges == tuple(edges.tolist())
    np.testing.assert_allclose(distribution.weights, counts / 500, rtol=1e-15)
    assert distribution.support == (values.min(), values.max())
    # The density is constant within a bin, so the mean is off by at most half a bin.
    assert abs(distribution.moment(1) - values.mean()) < 0.5 * (edges[1] - edges[0])
    assert Empirical.from_samples(values.reshape(50, 10), bins=12) == distribution
    assert len(Empirical.from_samples(values).weights) > 5


def test_a_histogram_is_stretched_about_its_mean():
    histogram = Empirical(edges=(0.5, 0.9, 1.1, 1.6), weights=(0.2, 1.0, 0.3))
    wider = histogram.with_std(1.7 * histogram.own_std)
    assert (wider.moment(1), wider.own_std) == pytest.approx((histogram.moment(1), 1.7 * histogram.own_std))
    assert wider.weights == histogram.weights


def test_empirical_weights_are_normalised():
    distribution = Empirical(edges=[0, 1, 3], weights=[2, 6])
    assert distribution == Empirical(edges=(0.0, 1.0, 3.0), weights=(0.25, 0.75))
    assert distribution.density(0.5) == 0.25
    assert distribution.density(2.0) == 0.375


def test_an_empirical_distribution_of_many_samples_comes_near_the_distribution_they_come_from():
    distribution = Gaussian(mean=1.0, std=0.1)
    values = distribution.sample(np.random.default_rng(8), 40_000)
    histogram = Empirical.from_samples(values)
    x = np.linspace(0.6, 1.4, 200)
    # DKW for the samples; within a bin the straight line departs by at most the bin's share.
    assert (
        np.max(np.abs(histogram.survival(x) - distribution.survival(x)))
        < allowed_gap(40_000) + max(histogram.weights) / 4
    )


@pytest.mark.eq(1)
def test_the_steady_state_is_the_fixed_point_of_the_master_equation(distribution):
    """(d/dx + P) Q_s = 0 for x > 0: what is carried on is what has not broken; at x = 0 all that breaks comes in."""
    steady = SteadyState(thresholds=distribution)
    x = distribution.inverse_survival(np.linspace(0.95, 0.05, 19))
    h = 1e-6 * distribution.standard_deviation()
    x = np.array([v for v in x if v > 2 * h and all(abs(v - knot) > 2 * h for knot in kinks(distribution))])
    slope = (steady.density(x + h) - steady.density(x - h)) / (2 * h)
    flux = distribution.hazard(x) * steady.density(x)
    np.testing.assert_allclose(-slope, flux, rtol=1e-5, atol=1e-7)
    node, weight = quadrature(steady)
    node, weight = node[weight > 0], weight[weight > 0]
    # Gamma = Int P Q dx = Q(0): as many are born as break.
    born, broken = float(steady.density(0.0)), float(np.sum(weight * distribution.hazard(node)))
    singular = not math.isfinite(float(distribution.density(1e-300)))
    assert broken == pytest.approx(born, rel=1e-4 if singular else 1e-9)


def test_the_mean_stretching_of_the_steady_state_is_the_kinetic_friction(distribution):
    assert SteadyState(thresholds=distribution).moment(1) == pytest.approx(
        distribution.moment(2) / (2 * distribution.moment(1)), rel=1e-12
    )


def test_the_steady_state_of_equal_thresholds_is_a_rectangle():
    steady = SteadyState(thresholds=Gaussian(mean=1.2, std=0.0))
    np.testing.assert_allclose(steady.density([-0.1, 0.0, 0.6, 1.19, 1.21]), [0, 1 / 1.2, 1 / 1.2, 1 / 1.2, 0])
    assert steady.moment(1) == pytest.approx(0.6)


def test_the_steady_state_conditions_its_thresholds():
    distribution = Gaussian(mean=0.2, std=0.5)
    assert SteadyState(thresholds=distribution) == SteadyState(thresholds=distribution.positive())


# ------------------------------------------------------------------------------------------------ a distribution of
# one's own


@dataclass(frozen=True)
class Told(Distribution):
    """What another distribution tells, without what it knows of its transform."""

    other: Distribution

    def density(self, x):
        return self.other.density(x)

    def partial_moment(self, x, order):
        return self.other.partial_moment(x, order)

    def inverse_survival(self, probability):
        return self.other.inverse_survival(probability)


@pytest.mark.parametrize(
    ("other", "leftmost"),
    [(Exponential(mean=0.5), -2.0), (LogNormal(mean=1.0, std=0.6), 0.0), (Uniform(low=0.6, high=1.5), -math.inf)],
)
def test_where_a_transform_ends_is_told_from_the_density(other, leftmost):
    assert Told(other).leftmost == pytest.approx(leftmost, rel=1e-3)


@dataclass(frozen=True)
class Step:
    """A density that jumps where no knot tells."""

    unit: float
    knots = ()

    def density(self, x):
        x = np.asarray(x) / self.unit
        return np.where((x >= 1.1) & (x <= 1.3), 5.0, 0.0) / self.unit


@pytest.mark.parametrize("unit", [2.0**30, 2.0**-30])
def test_panels_close_in_on_a_jump_in_every_unit(unit):
    table, other = table_of(Step(1.0)), table_of(Step(unit))
    assert table.total == pytest.approx(1.0, abs=1e-14)
    ends = table.edges[[0, -1]]
    np.testing.assert_allclose(ends, [1.1, 1.3], rtol=3e-15)
    np.testing.assert_array_equal(other.edges / unit, table.edges)
    np.testing.assert_array_equal(other.survival, table.survival)


@pytest.mark.parametrize("least", [50.0, 200.0])
def test_what_has_decayed_takes_no_nodes(least):
    below_zero = Uniform(low=-2.0, high=2.0)
    x, _ = _fine_nodes(below_zero, 1.0, least)
    assert x.min() < -1.99
    widest = np.diff(table_of(below_zero).edges).max()
    assert 40.0 / least < x.max() + 2.0 < 100.0 / least + widest  # exp(-40) of what there is at the lower end


@pytest.mark.parametrize("q", [5j, 20j, 3.0 + 10j])
def test_the_transform_of_a_wide_log_normal(q):
    wide = LogNormal(mean=1.0, std=1.0)
    z, step = np.linspace(-9.0, 9.0, 2_000_001), 9e-6  # trapezia: the integrand vanishes at both ends
    bell = np.exp(-0.5 * z * z - q * np.exp(wide.log_mean + wide.log_std * z)) / math.sqrt(2.0 * math.pi)
    assert complex(wide.laplace(q)) == pytest.approx(complex(bell.sum() * step), rel=1e-12)


@dataclass(frozen=True)
class Triangle(Distribution):
    """Density 2x on [0, 1]: a distribution with the five methods that a new distribution must give."""

    def density(self, x):
        x = np.asarray(x, dtype=float)
        return np.where((x >= 0) & (x <= 1), 2 * x, 0.0)

    def partial_moment(self, x, order):
        x = np.clip(np.asarray(x, dtype=float), 0, 1)
        return 2 * (1 - x ** (order + 2)) / (order + 2)

    def inverse_survival(self, probability):
        return np.sqrt(1 - np.asarray(probability, dtype=float))

    def laplace(self, q, order=0):
        q = np.asarray(q, dtype=complex)
        node, weight = np.polynomial.legendre.leggauss(64)
        x = 0.5 * (1 + node)
        return np.sum(weight * x ** (1 + order) * np.exp(-q[..., None] * x), axis=-1)

    def positive(self):
        return self


def test_the_rest_of_a_new_distribution_follows():
    distribution = Triangle()
    assert isinstance(distribution, Distribution)
    assert distribution.moment(1) == pytest.approx(2 / 3)
    assert distribution.standard_deviation() == pytest.approx(math.sqrt(1 / 18))
    assert distribution.survival(0.5) == pytest.approx(0.75)
    assert distribution.hazard(0.5) == pytest.approx(1 / 0.75)
    assert distribution.knots == ()
    assert distribution.support == pytest.approx((0, 1), abs=2e-8)
    values = distribution.sample(np.random.default_rng(9), 20_000)
    assert largest_gap(distribution, values) < allowed_gap(20_000)
    assert distribution.sample_beyond(np.random.default_rng(9), [0.5, 0.9]).min() >= 0.5
    assert excess(distribution, 0.0, 1) == pytest.approx(2 / 3)
    assert SteadyState(thresholds=distribution).moment(1) == pytest.approx(0.5 / (2 * 2 / 3))


# ------------------------------------------------------------------------------------------------ bad distributions


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Gaussian(mean=math.nan, std=0.1), r"^Gaussian\.mean = nan: must be a finite number"),
        (lambda: Gaussian(mean=1, std=-0.1), r"^Gaussian\.std = -0\.1: must be a finite number at least 0"),
        (lambda: Gaussian(mean=1, std=math.inf), r"^Gaussian\.std = inf: must be a finite number at least 0"),
        (lambda: Gaussian(mean="1", std=0.1), r"^Gaussian\.mean = '1': must be a number"),
        (lambda: Gaussian(mean=1, std=0.1, lower=math.nan), r"^Gaussian\.lower = nan: must be a number"),
        (lambda: Gaussian(mean=1, std=0.1, lower=2), r"^Gaussian\.lower = 2: less than one .* raise the mean \(1\)"),
        (lambda: Gaussian(mean=-1, std=0.1).positive(), r"^Gaussian\.lower = 0: less than one value in a million"),
        (lambda: Gaussian(mean=0, std=0).positive(), r"^Gaussian\.lower = 0: less than one value in a million"),
        (lambda: Uniform(low=1, high=1), r"^Uniform\.high = 1: must be a finite number above 1"),
        (lambda: Uniform(low=math.inf, high=1), r"^Uniform\.low = inf: must be a finite number"),
        (lambda: Uniform(low=-2, high=-1).positive(), r"^Uniform\.high = -1: must be above 0"),
        (lambda: Exponential(mean=0), r"^Exponential\.mean = 0: must be a finite number above 0"),
        (lambda: Gamma(mean=-1, std=1), r"^Gamma\.mean = -1: must be a finite number above 0"),
        (lambda: Gamma(mean=1, std=0), r"^Gamma\.std = 0: must be a finite number above 0"),
        (lambda: LogNormal(mean=0, std=1), r"^LogNormal\.mean = 0: must be a finite number above 0"),
        (lambda: LogNormal(mean=1, std=None), r"^LogNormal\.std = None: must be a number above 0"),
        (lambda: Weibull(scale=0, shape=2), r"^Weibull\.scale = 0: must be a finite number above 0"),
        (lambda: Weibull(scale=1, shape=0.01), r"^Weibull\.shape = 0\.01: must be a finite number at least 0\.1"),
        (lambda: Empirical(edges=(0, 1), weights=(1, 2)), r"^Empirical: 2 edges and 2 weights: must be one edge more"),
        (lambda: Empirical(edges=(0,), weights=()), r"^Empirical: 1 edges and 0 weights"),
        (lambda: Empirical(edges=(0, 1, 1), weights=(1, 2)), r"^Empirical\.edges: must rise"),
        (lambda: Empirical(edges=(0, 2, 1), weights=(1, 2)), r"^Empirical\.edges: must rise"),
        (lambda: Empirical(edges=(0, 1, 2), weights=(1, -2)), r"^Empirical\.weights\[1\] = -2: must be .* at least 0"),
        (lambda: Empirical(edges=(0, 1, 2), weights=(0, 0)), r"^Empirical\.weights: must have a positive sum"),
        (lambda: Empirical(edges=(0, math.nan), weights=(1,)), r"^Empirical\.edges\[1\] = nan: must be a finite"),
        (
            lambda: Empirical(edges=(-2, -1), weights=(1,)).positive(),
            r"^Empirical\.edges\[-1\] = -1: a distribution of thr",
        ),
        (lambda: Empirical.from_samples([]), r"^Empirical\.from_samples: is empty"),
        (lambda: Empirical.from_samples([1.0, 1.0]), r"^Empirical\.from_samples: needs at least two different"),
        (lambda: Empirical.from_samples([1.0, math.nan]), r"^Empirical\.from_samples = nan: must be a finite number"),
        (lambda: Empirical.from_samples(["a", "b"]), r"^Empirical\.from_samples = .*: must be a number or an array"),
        (lambda: Empirical.from_samples([1, 2], bins=0), r"^Empirical\.from_samples: bins = 0: must be .* at least 1"),
        (lambda: Empirical.from_samples([1, 2], bins=2.5), r"^Empirical\.from_samples: bins = 2\.5: must be a whole"),
        (lambda: SteadyState(thresholds=3.0), r"^SteadyState\.thresholds = 3\.0: must be a distribution"),
        (lambda: SteadyState(thresholds=Gaussian(mean=-1, std=0.1)), r"^Gaussian\.lower = 0: less than one"),
    ],
)
def test_bad_distributions(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("kind", sorted(SHIPPED, key=str))
def test_distributions_are_made_by_keyword_only(kind):
    with pytest.raises(TypeError):
        kind(1.0)


def test_a_density_that_ends_has_a_transform_everywhere():
    """As it is told from the density, for a distribution of one's own."""
    ended = Distribution.leftmost.fget(Uniform(0.0, 5.0))
    assert ended == -math.inf


def test_a_gaussian_of_which_little_is_left_is_sampled_at_once():
    tail = Gaussian(mean=0.0, std=1.0, lower=4.7)  # one value in 770,000
    values = tail.sample(np.random.default_rng(0), 10_000)
    assert values.min() > 4.7
    assert values.mean() == pytest.approx(tail.moment(1), abs=5 * tail.standard_deviation() / 100)
