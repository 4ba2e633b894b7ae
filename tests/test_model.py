"""The records of a rig: values they accept, and delays against their own samples."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy import special

import stickslip as ss
from stickslip.model import Delay, Interface, OnArrest, RandomDelay
from stickslip.model.distributions import Gaussian, Uniform

TENTH = Gaussian(mean=1.0, std=0.1)


def test_an_interface_stays_a_value_after_its_distribution_was_asked_for():
    interface = Interface(thresholds=Gaussian(mean=1.0, std=0.3))
    before = hash(interface)
    assert interface.threshold_distribution == Gaussian(mean=1.0, std=0.3, lower=0.0)
    assert hash(interface) == before
    assert interface == Interface(thresholds=Gaussian(mean=1.0, std=0.3))
    copy = pickle.loads(pickle.dumps(interface))
    assert copy.threshold_distribution == interface.threshold_distribution
    # A changed record does not keep the distribution of the one it was made from.
    varied = replace(interface, thresholds=TENTH)
    assert varied.threshold_distribution == TENTH.positive()


DELAYS = [
    Delay(0.0),
    Delay(0.2),
    *(
        RandomDelay(mean=mean, std=std, negative=negative)
        for mean, std in ((0.2, 0.12), (0.0, 0.3), (0.5, 0.08), (0.1, 1.0))
        for negative in ("clip", "redraw", "fold")
    ),
]
every_delay = pytest.mark.parametrize("delay", DELAYS, ids=str)


def normal(z):
    return math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)


def closed_mean(delay: RandomDelay) -> float:
    """Mean of a Gaussian whose negative draws are clipped, redrawn or folded."""
    z = delay.mean / delay.std
    above = delay.mean * special.ndtr(z) + delay.std * normal(z)  # mean of max(tau, 0)
    return {
        "clip": above,
        "redraw": above / special.ndtr(z),
        "fold": 2 * above - delay.mean,
    }[delay.negative]


@pytest.mark.parametrize(
    "delay", [d for d in DELAYS if isinstance(d, RandomDelay)], ids=str
)
def test_mean_of_a_random_delay_in_closed_form(delay):
    # A folded tail with less than 2e-6 of the draws is left out.
    assert delay.moment(1) == pytest.approx(
        closed_mean(delay), rel=1e-12 if delay.mean < 0.5 else 2e-6
    )


@every_delay
def test_moments_and_transforms_agree_with_quadrature(delay):
    tau, weight = delay.quadrature()
    for order in range(4):
        assert delay.moment(order) == pytest.approx(
            np.sum(weight * tau**order), rel=1e-12, abs=1e-15
        )
    for s in (0.0, 1.0, -0.5, 2j, 1 + 5j, -0.5 + 3j, 20j):
        # 96 nodes over some 16 standard deviations resolve exp(-s tau) up to |s| of
        # some 40 over the standard deviation.
        assert delay.laplace(s) == pytest.approx(
            np.sum(weight * np.exp(-s * tau)), abs=1e-11
        )
        assert delay.absence(s) == pytest.approx(1.0 - delay.laplace(s), abs=1e-14)
    assert delay.absence(1e-9) == pytest.approx(1e-9 * delay.moment(1), rel=1e-8)
    assert delay.laplace([[0, 1j]]).shape == (1, 2)


@pytest.mark.parametrize("delay", [Delay(math.inf), OnArrest()], ids=str)
def test_contacts_that_never_come_back(delay):
    assert [delay.moment(order) for order in range(3)] == [1.0, math.inf, math.inf]
    np.testing.assert_array_equal(delay.laplace([0.5, 2j]), [0, 0])
    np.testing.assert_array_equal(delay.absence([0.0, 0.5, 2j]), [1, 1, 1])
    assert [part.size for part in delay.quadrature()] == [0, 0]
    np.testing.assert_array_equal(
        delay.sample(np.random.default_rng(0), 2), [math.inf, math.inf]
    )


@every_delay
def test_samples_agree_with_moments(delay):
    n = 40_000
    tau = delay.sample(np.random.default_rng(1), n)
    assert tau.shape == (n,)
    assert tau.min() >= 0
    variance = delay.moment(2) - delay.moment(1) ** 2
    assert (
        abs(tau.mean() - delay.moment(1)) <= 6 * math.sqrt(max(variance, 0) / n) + 1e-12
    )
    for s in (3.0, 4j):
        estimate = np.mean(np.exp(-s * tau))
        exact = complex(delay.laplace(s))
        # |exp(-s tau)| <= 1, so its variance is at most 1 - |mean|^2.
        assert (
            abs(estimate - exact)
            <= 6 * math.sqrt(max(1 - abs(exact) ** 2, 0) / n) + 1e-12
        )


def test_what_a_notebook_tries_works_or_says_what_to_write():
    assert Gaussian(1.0, 0.1) == Gaussian(mean=1.0, std=0.1)
    assert Uniform(0.8, 1.2) == Uniform(low=0.8, high=1.2)
    rig = ss.example("brake_pad")
    with pytest.raises(
        AttributeError, match=r"Rig has no 'simulate'; write stickslip\.simulate\(rig\)"
    ):
        rig.simulate()
    with pytest.raises(AttributeError, match=r"Rig has no 'colour'$"):
        rig.colour()
    assert not hasattr(rig, "__wrapped__")
