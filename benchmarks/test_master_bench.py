"""The master equation compared with the plain loop over contacts, in the same run: Fig.
4c to a given error.
"""

import time
from pathlib import Path

import numpy as np
import pytest
from plain import plain_contacts

import stickslip as ss
from stickslip.paper.cases import FIG4

CYCLES = 4.0
"""Stick-slip cycles in t = 0 .. 6."""
EXACT = np.load(Path(__file__).parents[1] / "tests" / "data" / "fig4c_reference.npy")


def plain(duration):
    rng = np.random.default_rng(1)
    slider = FIG4.slider
    stretching = rng.normal(0.0, 0.01, 10_000)
    threshold = rng.normal(1.0, 0.1, 10_000)
    delay = FIG4.interface.delay.time
    return plain_contacts(
        rng,
        stretching,
        threshold,
        slider.stiffness,
        slider.mass,
        slider.damping,
        delay,
        1.0,
        duration,
        1e-4,
    )


def master(rtol):
    rig = ss.Rig(FIG4.interface, FIG4.slider, ss.constant(1.0, 6.0))
    return ss.simulate(
        rig, method=ss.MasterEquation(rtol=rtol), output=ss.Output(interval=0.005)
    )


def test_plain_loop(benchmark):
    plain(0.01)
    benchmark.group = "Fig. 4c, four cycles"
    benchmark.extra_info.update(role="plain")
    benchmark.pedantic(plain, (6.0,), rounds=3)


@pytest.mark.parametrize(
    ("rtol", "error", "promised"), [(1e-4, 1e-4, 50), (3e-6, 1e-6, 50)]
)
def test_master_equation(benchmark, rtol, error, promised):
    master(rtol)
    benchmark.group = "Fig. 4c, four cycles"
    benchmark.extra_info.update(
        role="fast", promised=promised, what=f"master equation, error below {error:g}"
    )
    run = benchmark.pedantic(master, (rtol,), rounds=40)
    assert np.sqrt(np.mean((run["spring_force"].to_numpy() - EXACT) ** 2)) < error


def population(count):
    rig = ss.Rig(FIG4.interface, FIG4.slider, ss.constant(1.0, 6.0))
    return ss.simulate(
        rig, method=ss.Population(count, seed=1), output=ss.Output(interval=0.005)
    )


@pytest.mark.parametrize("count", [10_000, 10**8])
def test_population(benchmark, count):
    """Its cost does not depend on the number of contacts: 1e8 take less than twice as
    long as 1e4.
    """
    population(count)
    benchmark.group = "Fig. 4c, four cycles"
    benchmark.extra_info.update(
        role="fast", promised=10, what=f"population of {count:.0e}"
    )
    benchmark.pedantic(population, (count,), rounds=10)


def test_the_cost_of_a_population_does_not_depend_on_its_number():
    def seconds(count):
        times = []
        for _ in range(10):
            begin = time.process_time()
            population(count)
            times.append(time.process_time() - begin)
        return min(times)

    population(100)
    assert seconds(10**8) < 2.0 * seconds(10**4)
