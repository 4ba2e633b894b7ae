"""Ageing contacts and their stationary kinetic equation compared with the plain Euler
loop over contacts, in the same run.
"""

import time

import numpy as np
import pytest

from stickslip.kernels._jit import jit
from stickslip.kernels.drive import Quadratic
from stickslip.kernels.hazard import NONE
from stickslip.kernels.langevin import Langevin
from stickslip.kernels.langevin_contacts import advance_contacts, awake
from stickslip.kernels.langevin_steady import steady_friction
from stickslip.kernels.oscillator import Slider
from stickslip.kernels.time_steps import Course

# Fig. 8
COUNT = 2000
STD = 0.1
RATE = 1.5
STIFFNESS = 1.0
MASS = 1e-4
DAMPING = 10.0
DURATION = 20.0
WARM = 0.1


@jit
def plain_loop(rng, x, f, K, M, eta, rate, std, duration, dt):
    """Euler-Maruyama, with breaks detected at the end of a step; the spring force after
    each step at v = 1.
    """
    force = np.empty(round(duration / dt))
    X = 0.0
    V = 0.0
    F = np.mean(x)
    drift = rate * rate * dt
    perturbation = rate * std * np.sqrt(2.0 * dt)
    for step in range(force.size):
        F_d = K * (step * dt - X)
        V += dt * ((F_d - F) / M - eta * V)
        X += V * dt
        F = 0.0
        for i in range(x.size):
            x[i] += V * dt
            f[i] += drift * (1.0 - f[i]) + perturbation * rng.standard_normal()
            if abs(x[i]) >= f[i]:
                x[i] = 0.0
                f[i] = 0.0
            F += x[i]
        F /= x.size
        force[step] = F_d
    return force


def start(seed):
    rng = np.random.default_rng(seed)
    return rng, rng.normal(0.0, 0.01, COUNT), np.abs(rng.normal(1.0, STD, COUNT))


def plain(duration, dt=5e-4, seed=1):
    rng, x, f = start(seed)
    return plain_loop(rng, x, f, STIFFNESS, MASS, DAMPING, RATE, STD, duration, dt)


def fast(duration, step=0.04, reach=0.1, seed=1):
    """Our contacts, in steps with the mean force's error of the plain loop."""
    rng, x, f = start(seed)
    contacts = awake(x, f, np.full(COUNT, -np.inf), 0.0, 0.0)
    langevin = Langevin(RATE, 1.0, STD)
    times = np.arange(1, round(duration / 0.05) + 1) * 0.05
    course = Course(
        Quadratic(0.0, 0.0, 1.0, 0.0),
        Slider(STIFFNESS, MASS, DAMPING),
        times,
        step / RATE**2,
        reach,
    )
    return advance_contacts(
        np.zeros(4), contacts, course, langevin, NONE, np.zeros(1), rng
    )[:, 2]


def forty():
    return steady_friction(np.geomspace(0.01, 10.0, 40), Langevin(1.0, 1.0, STD))


def test_plain_loop(benchmark):
    plain(WARM)
    benchmark.group = "Fig. 8, rate 1.5, N = 2000, twenty time units"
    benchmark.extra_info.update(role="plain")
    benchmark.pedantic(plain, (DURATION,), rounds=3)


def test_contacts(benchmark):
    fast(WARM)
    benchmark.group = "Fig. 8, rate 1.5, N = 2000, twenty time units"
    benchmark.extra_info.update(
        role="fast",
        promised=3.5,
        what="ageing contacts, at equal error of the mean force",
    )
    benchmark.pedantic(fast, (DURATION,), rounds=5)


def test_plain_loop_beside_the_kinetic_equation(benchmark):
    plain(WARM)
    benchmark.group = "Steady friction at 40 velocities"
    benchmark.extra_info.update(role="plain")
    benchmark.pedantic(plain, (DURATION,), rounds=1)


def test_stationary_kinetic_equation(benchmark):
    forty()
    benchmark.group = "Steady friction at 40 velocities"
    benchmark.extra_info.update(
        role="fast",
        promised=1,
        what="kinetic equation at 40 velocities, beside one plain run",
    )
    assert np.all(benchmark.pedantic(forty, rounds=5) > 0.0)


@pytest.mark.slow
def test_speed_at_equal_error_of_the_mean_force():
    """Both errors are measured, against steps four and five times as short; the mean is
    over complete oscillations.
    """
    plain(WARM), fast(WARM)

    def measured(run, seeds, **settings):
        begin = time.process_time()
        forces = [run(60.0, seed=seed, **settings) for seed in seeds]
        cost = (time.process_time() - begin) / len(seeds)
        kept = [f[f.size // 5 :] for f in forces]
        means = [np.average(f, weights=np.hanning(f.size)) for f in kept]
        return np.mean(means), np.std(means) / np.sqrt(len(seeds) - 1), cost

    exact, error, _ = measured(fast, range(20, 32), step=0.01, reach=0.02)
    rows = {
        "plain, dt 5e-4": measured(plain, range(6)),
        "ours, step .04, reach .1": measured(fast, range(12)),
        "ours, step .04, reach .05": measured(fast, range(12), reach=0.05),
        "plain, dt 1.25e-4": measured(plain, range(3), dt=1.25e-4),
    }
    print(f"\nreference mean force {exact:.5f} +- {error:.5f}")
    for name, (mean, sigma, cost) in rows.items():
        print(
            f"{name:26s} {mean:.5f} +- {sigma:.5f}  {mean / exact - 1:+.2%}  "
            f"{cost:.2f} s a run"
        )
    bias = {name: abs(mean - exact) for name, (mean, _, _) in rows.items()}
    sigma = np.sqrt(error**2 + max(row[1] for row in rows.values()) ** 2)
    cost = {name: row[2] for name, row in rows.items()}
    assert bias["ours, step .04, reach .1"] <= bias["plain, dt 5e-4"] + 3 * sigma
    assert bias["ours, step .04, reach .05"] <= bias["plain, dt 1.25e-4"] + 3 * sigma
    assert cost["plain, dt 5e-4"] / cost["ours, step .04, reach .1"] >= 3.5  # 4.7
    assert cost["plain, dt 1.25e-4"] / cost["ours, step .04, reach .05"] >= 5.0  # 12
