"""
Creep groan of a brake, and what damping does to it
===================================================

A car starts slowly with its brake half released, and groans. At which speeds, and how
much does damping between the caliper and its mount help? The map is computed by linear
stability theory, without simulations: damping lowers the speed at which the groan ends,
and hardly changes the speed at which it begins.

Run it with ``python examples/practice/brake_pad.py brake_pad.png``.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import stickslip as ss
from stickslip import advise, plot

RIG = "brake_pad"


def groaning(rig: str | Path = RIG, *, damping: float = 1.0) -> tuple[float, float]:
    """Return the speeds in m/s between which smooth braking is unstable, with the
    damping of the rig times a factor.
    """
    brake = ss.read_rig(rig)
    damped = brake.with_values(damping=damping * brake.value("damping"))
    edges = ss.critical(
        damped, "velocity", between=(brake.velocity / 100, brake.velocity * 100)
    ).edges
    return edges[0].value, edges[-1].value


def draw(rig: str | Path = RIG) -> Figure:
    """Draw the stability of smooth braking over speed and damping."""
    return plot.chart(
        advise.chart(ss.read_rig(rig), ("velocity", "damping"), around=30.0, points=80)
    )


if __name__ == "__main__":
    for factor in (1.0, 3.0, 10.0):
        low, high = groaning(damping=factor)
        print(
            f"damping times {factor:g}: groans from {1e3 * low:.3g} to "
            f"{1e3 * high:.3g} mm/s"
        )
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
