"""The stability map and its boundary compared with a count at each point of the map;
ageing contacts.
"""

import sys

import numpy as np

from stickslip.model import Rig, constant
from stickslip.paper.cases import FIG7, FIG8
from stickslip.sliding.unaged import axis_table
from stickslip.stability import (
    boundary,
    count_unstable,
    critical,
    growth_rate,
    onset,
    stability_map,
)

RIG = Rig(FIG7.interface, FIG7.slider, constant(1.0))
STIFFNESSES = np.geomspace(0.1, 10, 200)
VELOCITIES = np.geomspace(0.1, 10, 200)
WINDOW = ((0.1, 10.0), (0.1, 10.0))
AGED = Rig(FIG8.interface, FIG8.slider, constant(1.0))


def test_map_of_200_by_200(benchmark):
    found = benchmark(stability_map, RIG, values=(STIFFNESSES, VELOCITIES))
    assert found.unstable_modes.shape == (200, 200)


def test_map_of_200_by_200_with_no_table_kept(benchmark):
    def run():
        axis_table.cache_clear()
        return stability_map(RIG, values=(STIFFNESSES, VELOCITIES))

    benchmark.pedantic(run, rounds=5)


def test_plain_loop_over_a_hundredth_of_the_map(benchmark):
    def run():
        return [
            [count_unstable(RIG.replace(stiffness=k, velocity=v)) for v in v_]
            for k in STIFFNESSES[::10].tolist()
        ]

    v_ = VELOCITIES[::10].tolist()
    benchmark.pedantic(run, rounds=2)


def test_boundary(benchmark):
    found = benchmark(boundary, RIG, between=WINDOW)
    assert found.sizes["point"] > 100


def test_map_over_velocity_and_delay_50_by_50(benchmark):
    values = (np.geomspace(0.1, 10, 50), np.geomspace(0.01, 1, 50))
    benchmark.pedantic(
        stability_map,
        (RIG,),
        {"over": ("velocity", "delay"), "values": values},
        rounds=3,
    )


def test_critical_velocities(benchmark):
    benchmark(critical, RIG, "velocity", between=(0.1, 10))


def test_critical_delay(benchmark):
    benchmark(onset, RIG, "delay", between=(1e-3, 1e2))


def test_growth_rate(benchmark):
    benchmark(growth_rate, RIG.replace(velocity=1.4))


def test_unstable_modes(benchmark):
    benchmark(count_unstable, RIG.replace(velocity=1.4))


def forget():
    """Clear every cached response of ageing contacts; the kernels stay compiled."""
    critical(AGED, "stiffness", between=(0.9, 1.1))
    for name, module in sys.modules.items():
        if name.startswith(("stickslip.sliding", "stickslip.stability")):
            for kept in vars(module).values():
                if hasattr(kept, "cache_clear"):
                    kept.cache_clear()


def test_critical_velocities_of_ageing_contacts_from_nothing(benchmark):
    benchmark.pedantic(
        critical, (AGED, "velocity"), {"between": (0.1, 10)}, setup=forget, rounds=3
    )


def test_map_of_ageing_contacts_50_by_50_from_nothing(benchmark):
    values = (np.geomspace(0.1, 10, 50), np.geomspace(0.1, 10, 50))
    benchmark.pedantic(
        stability_map, (AGED,), {"values": values}, setup=forget, rounds=3
    )


def test_growth_rates_of_ageing_contacts_50_by_50_from_nothing(benchmark):
    values = (np.geomspace(0.1, 10, 50), np.geomspace(0.1, 10, 50))
    benchmark.pedantic(
        stability_map,
        (AGED,),
        {"values": values, "growth": True},
        setup=forget,
        rounds=1,
    )
