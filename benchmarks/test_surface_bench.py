"""Pressing a rough surface on a flat one: time and memory at three sizes, with 1 to 2 %
of the area in contact.
"""

import tracemalloc

import pytest

import stickslip as ss

ARRAYS = 16  # arrays of doubles, as large as the map, that a solution may hold at once


@pytest.mark.parametrize(
    ("nodes", "role", "promised"),
    [(256, "plain", 1), (512, "cost", 16), (1024, "cost", 80)],
)
def test_press_a_surface(benchmark, nodes, role, promised):
    rough = ss.surface.self_affine(
        rq="1 um", hurst=0.8, roll_off="60 um", cut_off="8 um", nodes=nodes
    )
    given = (rough.to_numpy(), 1e-6, 2e6, ss.surface.MATERIALS["pmma"].modulus)
    tracemalloc.start()
    ss.surface.press(*given)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < ARRAYS * 8 * nodes**2
    benchmark.group = "pressing a surface"
    what = f"{nodes} x {nodes} nodes, {peak / 1e6:.0f} MB"
    benchmark.extra_info.update(role=role, what=what, promised=promised)
    p = benchmark.pedantic(ss.surface.press, args=given, rounds=2)
    assert p.mean() == pytest.approx(2e6)
