"""Rigid motion by convolution: closed forms, brute force, the paper, orders."""

from functools import partial

import numpy as np
import pytest

from stickslip.kernels import renewal
from stickslip.model.distributions import Exponential, Gaussian, excess

GAUSSIAN = Gaussian(mean=1.0, std=0.1)


def delta():
    return np.zeros(1), np.ones(1)


def gaussian(std, nodes=60):
    z, weight = np.polynomial.hermite_e.hermegauss(nodes)
    return std * z, weight / weight.sum()


def interface(
    distribution=GAUSSIAN, start=None, shift=(0.0,), fraction=(1.0,), signed=False
):
    distribution = distribution.positive()
    x_0, weight = start or delta()
    return renewal.RenewalContacts(
        density=distribution.density,
        excess=partial(excess, distribution),
        stretching=x_0,
        weight=weight,
        reach=np.maximum(x_0, 0.0) if signed else np.abs(x_0),
        shift=np.asarray(shift, float),
        fraction=np.asarray(fraction, float),
    )


def moved(contacts, X, points=1000, distance=None):
    distance = float(np.max(X)) if distance is None else distance
    return renewal.observe(
        contacts, renewal.solve(contacts, distance, points), np.asarray(X, float)
    )


@pytest.mark.eq(1, 2, 4)
def test_exponential_thresholds_break_at_a_constant_rate():
    X = np.linspace(0.0, 10.0, 777)
    response = moved(interface(Exponential(mean=2.0)), X)
    assert response.rate == pytest.approx(0.5, abs=1e-12)
    assert response.force == pytest.approx(2 * (1 - np.exp(-X / 2)), abs=1e-10)
    assert response.stiffness == pytest.approx(np.exp(-X / 2), abs=1e-10)
    assert np.array_equal(response.attached, np.ones_like(X))


@pytest.mark.eq(3, 4)
def test_contacts_that_never_come_back_follow_the_survival(distribution):
    X = np.linspace(0.0, 3.0, 100)
    response = moved(interface(distribution, shift=(), fraction=()), X)
    J = distribution.positive().survival(X)
    P = distribution.positive().density(X)
    assert response.attached == pytest.approx(J, abs=1e-12)
    assert response.force == pytest.approx(X * J, abs=1e-12)
    assert response.stiffness[1:] == pytest.approx((J - X * P)[1:], abs=1e-11)


@pytest.mark.eq(1, 2, 3, 4)
@pytest.mark.parametrize(
    ("shift", "fraction"),
    [((0.0,), (1.0,)), ((0.25,), (1.0,)), ((0.0, 0.1, 0.5), (0.2, 0.5, 0.3))],
)
def test_brute_force_gives_the_same(shift, fraction):
    # Steps in X by the trapezoidal rule: no transform, no product integration, no
    # cumulative unknown.
    distribution = GAUSSIAN
    h = 0.0025
    n = 1001
    X = h * np.arange(n)
    x_0, weight = gaussian(0.1, 20)
    P = distribution.positive().density(X)
    J = distribution.positive().survival(X)
    lag = np.round(np.array(shift) / h).astype(int)
    breaks, born = np.zeros(n), np.zeros(n)
    for x, w in zip(x_0, weight, strict=True):
        density = distribution.positive().density(x + X) / distribution.survival(abs(x))
        breaks += w * np.where(x + X >= abs(x), density, 0.0)
    for i in range(n):
        # P(0) is 0, and so is the mass born at X = 0
        breaks[i] += h * (P[1 : i + 1] @ born[:i][::-1])
        born[i] = sum(
            s * breaks[i - k] for s, k in zip(fraction, lag, strict=True) if k <= i
        )
    force = np.zeros(n)
    attached = np.zeros(n)
    for x, w in zip(x_0, weight, strict=True):
        left = (
            w
            * distribution.survival(np.maximum(abs(x), x + X))
            / distribution.survival(abs(x))
        )
        force += (x + X) * left
        attached += left
    force += h * np.convolve(X * J, born)[:n]
    attached += h * np.convolve(J, born)[:n] - 0.5 * h * born
    found = moved(
        interface(start=(x_0, weight), shift=shift, fraction=fraction), X, points=500
    )
    assert found.force == pytest.approx(force, abs=1e-5)
    assert found.attached == pytest.approx(attached, abs=1e-5)
    assert found.rate == pytest.approx(breaks, abs=1e-7)
    assert found.stiffness == pytest.approx(
        np.gradient(force, h, edge_order=2), abs=2e-3
    )


def test_extrapolation_makes_it_sixth_order_for_a_smooth_distribution():
    values = [
        renewal.solve(interface(start=gaussian(0.1)), 4.0, points).values
        for points in (100, 200, 1600)
    ]
    errors = [
        np.abs(v[:, :: (v.shape[1] - 1) // 100] - values[2][:, ::16]).max()
        for v in values[:2]
    ]
    assert errors[1] < errors[0] / 40
    assert errors[1] < 2e-6


def test_mass_is_conserved(distribution):
    X = np.random.default_rng(2).uniform(0.0, 5.0, 200)
    assert moved(
        interface(distribution, gaussian(0.05, 12)), X, distance=5.0
    ).attached == pytest.approx(1.0, abs=1e-12)
    delayed = moved(
        interface(distribution, gaussian(0.05, 12), (0.3,)), X, distance=5.0
    )
    assert np.all(delayed.attached > -1e-9)
    assert np.all(delayed.attached < 1 + 1e-9)
