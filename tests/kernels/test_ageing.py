"""Contacts whose thresholds age by Langevin: closed forms, solver against solver."""

from dataclasses import replace
from math import erfc, exp, sqrt

import numpy as np
import pytest
from benches import rigidly

import stickslip as ss
from stickslip.kernels.langevin import Langevin, Life
from stickslip.kernels.langevin_contacts import aged_threshold, crossing, reflected
from stickslip.kernels.langevin_response import excursions, life_transforms
from stickslip.kernels.langevin_steady import (
    life_moments,
    steady_friction,
    steady_moments,
)
from stickslip.paper.cases import FIG8
from stickslip.theory import closure_friction

STD = 0.1
ONE = Langevin(rate=1.0, mean=1.0, std=STD)
HEAVY = ss.Slider(stiffness=20.0, mass=1.0, damping=5.0)


def aged(rate, newborn=0.0, **changes):
    return replace(
        FIG8.interface, ageing=ss.Langevin(rate=rate, newborn=newborn), **changes
    )


@pytest.mark.eq(13, 15, 16)
def test_thresholds_at_rest_keep_their_distribution_and_forget_as_exp_minus_rate_squared_t():  # noqa: E501
    rng = np.random.default_rng(3)
    n = 20_000
    rate = 1.3
    lag = 0.4
    before = rng.normal(1.0, STD, n)
    f = np.array(
        [aged_threshold(each, lag, ONE._replace(rate=rate), rng) for each in before]
    )
    assert abs(f.mean() - 1.0) < 4 * STD / sqrt(n)
    assert abs(f.std() - STD) < 4 * STD / sqrt(2 * n)
    expected = exp(-(rate**2) * lag)
    correlation = np.corrcoef(before, f)[0, 1]
    assert abs(correlation - expected) < 4 * (1 - expected**2) / sqrt(n)
    assert abs(np.mean(((f - 1.0) / STD) ** 3)) < 4 * sqrt(15 / n)
    assert abs(np.mean(((f - 1.0) / STD) ** 4) - 3.0) < 4 * sqrt(96 / n)


def test_a_margin_that_is_reflected_has_the_distribution_of_a_reflected_brownian_motion():  # noqa: E501
    rng = np.random.default_rng(5)
    n = 40_000
    drift = -0.7
    noise = 0.5
    time = 1.0
    sigma = sqrt(noise * time)
    sample = np.array([reflected(0.0, drift, noise, time, rng) for _ in range(n)])

    def normal(z):
        return 0.5 * erfc(-z / sqrt(2))

    for y in (0.1, 0.3, 0.6, 1.0):
        below = normal((y - drift * time) / sigma) - exp(
            2 * drift * y / noise
        ) * normal((-y - drift * time) / sigma)
        assert abs(np.mean(sample[:, 0] <= y) - below) < 4 * sqrt(
            below * (1 - below) / n
        )
    assert sample[:, 1].min() > 0.0
    assert sample[:, 1].max() <= time


def test_the_moment_of_breaking_inside_a_step_is_that_of_a_bridge():
    rng = np.random.default_rng(8)
    n = 20_000
    start = 0.8
    end = 0.5
    variance = 1.0
    sample = np.array([crossing(start, end, variance, rng) for _ in range(n)])
    # inverse Gaussian of mean start/end and shape start^2/variance
    clock = sample / (1 - sample)
    mean = start / end
    shape = start**2 / variance
    assert abs(clock.mean() - mean) < 4 * sqrt(mean**3 / shape / n)
    assert abs(np.mean(1 / clock) - (1 / mean + 1 / shape)) < 4 * sqrt(
        (1 / (mean * shape) + 2 / shape**2) / n
    )


def test_steady_friction_has_its_tail():
    u = np.array([20.0, 50.0, 100.0])
    std = 0.02
    tail = std**2 * u / (u - 1) ** 2
    # The next order is std^2/(u-1)^2 with a factor near 5.
    assert np.all(
        np.abs(steady_friction(u, Langevin(1.0, 1.0, std)) / tail - 1)
        < 2e-4 + 12 * std**2 / (u - 1)
    )


@pytest.mark.parametrize("u", [1e-3, 0.05, 0.5, 1.0, 3.0, 20.0])
def test_steady_friction_is_accurate_to_1e_4_and_of_second_order(u):
    plain = [
        np.divide(*life_moments(Life(u, STD, 0.0), m, 4 * m)[::-1])
        for m in (100, 200, 400)
    ]
    assert (plain[0] - plain[1]) / (plain[1] - plain[2]) == pytest.approx(4.0, rel=0.1)
    best = (4 * plain[2] - plain[1]) / 3
    assert steady_friction(np.array([u]), ONE)[0] == pytest.approx(best, rel=1e-4)


@pytest.mark.parametrize("newborn", [0.0, 0.3])
@pytest.mark.parametrize("u", [0.01, 0.1, 0.44, 1.0, 1.2, 8.0])
def test_lives_from_the_volterra_equation_are_those_of_the_kinetic_equation(u, newborn):
    life = Life(u, STD, newborn)
    parts = life_transforms(excursions(life), np.zeros(1, dtype=complex))[:, 0]
    length, work = steady_moments(life, 200)
    assert parts[1].real / parts[0].real == pytest.approx(work / length, rel=1e-4)
    assert parts[0].real == pytest.approx(length, rel=1e-4)
    # at rest nothing is perturbed
    assert np.all(np.abs(parts[2:]) < 1e-9 * length)


@pytest.mark.eq(17)
@pytest.mark.parametrize(
    ("u", "error"), [(0.5, 0.001), (1.0, 0.001), (2.0, 0.01), (5.0, 0.02)]
)
def test_their_density_slides_with_it_at_second_order(u, error):
    exact = steady_friction(np.array([u]), ONE)[0]
    times = np.linspace(0.0, 1.0 / u, 50)
    tracks = (
        rigidly(aged(1.0), ss.MasterEquation(rtol=rtol), ss.constant(u, 1.0 / u), times)
        for rtol in (16e-4, 1e-4)  # the second has cells and steps a quarter as large
    )
    errors = [track["friction_force"].mean() / exact - 1 for track in tracks]
    assert abs(errors[1]) < error
    assert u > 1 or np.log(errors[0] / errors[1]) / np.log(4) > 1.6


@pytest.mark.parametrize("omega", [0.5, 2.15, 5.0])
def test_shaking_the_density_gives_the_dynamic_stiffness(omega):
    u = 1.5
    amplitude = 1e-3
    per = 32
    t = np.arange(4 * per + 1) * 2 * np.pi / omega / per
    velocity = u + amplitude * omega * np.cos(omega * t)
    drive = ss.ramp(velocity[0], velocity[1], t[1])
    for k in range(1, 4 * per):
        drive = drive.then(ss.ramp(velocity[k], velocity[k + 1], t[k + 1] - t[k]))
    force = rigidly(aged(1.0), ss.MasterEquation(), drive, t)["friction_force"][
        2 * per :
    ]
    way = np.r_[0.0, np.cumsum(0.5 * np.diff(t) * (velocity[1:] + velocity[:-1]))][
        2 * per :
    ]
    waves = np.column_stack([np.sin(omega * t), np.cos(omega * t), np.ones(t.size), t])[
        2 * per :
    ]
    pulled, shaken = (
        np.linalg.lstsq(waves, part, rcond=None)[0] for part in (force, way)
    )
    kappa = complex(ss.stability.dynamic_stiffness(aged(1.0), u, 1j * omega))
    assert abs(
        (pulled[0] + 1j * pulled[1]) / (shaken[0] + 1j * shaken[1]) - kappa
    ) < 0.002 + 0.005 * abs(kappa)


def test_fast_motion_to_and_fro_agrees_with_many_contacts():
    n = 40_000
    drive = ss.constant(10.0, 0.12).then(ss.constant(-10.0, 0.28))
    times = np.linspace(0.005, 0.4, 80)
    density, contacts = (
        rigidly(aged(1.5), method, drive, times, start=ss.FromRest())["friction_force"]
        for method in (ss.MasterEquation(rtol=2.5e-5), ss.Contacts(n, seed=14))
    )
    # A contact's stretching scatters by less than 0.5.
    assert np.all(np.abs(density - contacts) < 4 * 0.5 / sqrt(n) + 0.004)


@pytest.mark.eq(11)
def test_recorded_friction_of_hot_contacts_moves_the_slider():
    """M X'' + M eta X' = K (X_lp - X) - F, over many steps."""
    hot = aged(1.0, newborn=0.5, activation=ss.Bell(width=0.05, attempts=1.0))
    rig = ss.Rig(
        hot, ss.Slider(stiffness=2.0, mass=0.01, damping=2.0), ss.constant(1.0, 1.0)
    )
    run = ss.simulate(
        rig, method=ss.Contacts(500, seed=2), output=ss.Output(interval=2e-4)
    )
    t = run["time"].to_numpy()
    v = run["velocity"].to_numpy()
    push = (
        run["spring_force"] - run["friction_force"] - 0.02 * run["velocity"]
    ).to_numpy()
    gained = (
        np.concatenate([[0.0], np.cumsum(0.5 * (push[1:] + push[:-1]) * np.diff(t))])
        / 0.01
    )
    assert np.abs(gained - (v - v[0])).max() < 0.02 * np.abs(v).max()


def test_the_closure_at_low_speed_is_that_of_an_exponential_life():
    # <exp(-T)> and <exp(-2T)> over an exponential time: thresholds 1 - exp(-T) plus the
    # Gaussian noise.
    u = 0.01
    gamma = 1 / (1 - u)
    mean = 1 / (1 + gamma * u)
    first = 1 - mean
    second = gamma * u / (gamma * u + 2)
    square = 1 - 2 * first + second + STD**2 * (1 - second)
    force = closure_friction(aged(1.0), u)
    assert force == pytest.approx(square / (2 * mean), rel=1e-3)


@pytest.mark.eq(1, 2, 3, 18)
def test_the_friction_of_the_closure_is_not_that_of_its_contacts():
    assert closure_friction(aged(1.0), 0.5) == pytest.approx(
        0.911 * ss.kinetic_friction(aged(1.0), 0.5), rel=2e-3
    )
    assert closure_friction(aged(1.0), np.array([0.01, 1.0])) == pytest.approx(
        [0.5025, 0.0889], rel=1e-3
    )


@pytest.mark.parametrize("delay", [0.0, 0.2])
def test_growth_too_slow_for_the_slider_carries_nothing(delay):
    interface = replace(
        FIG8.interface, ageing=ss.ExponentialGrowth(rate=0.5), delay=ss.Delay(delay)
    )
    assert ss.kinetic_friction(interface, 3.0) == 0.0
    rig = ss.Rig(
        interface, HEAVY, ss.constant(3.0, 0.5), method=ss.Contacts(200, seed=1)
    )
    assert (
        float(abs(ss.simulate(rig, start=ss.FromSliding())["friction_force"]).max())
        < 0.05
    )
