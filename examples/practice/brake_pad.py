"""
Creep groan of a brake, and what damping does to it
===================================================

A car rolls off slowly, the brake half released, and groans. Over which speeds, and how much does damping between
caliper and its mount help? The map is computed from the theory of linear stability, not swept: damping lowers the speed
at which the groan ends, and does little about the one at which it begins.

Run it with ``python examples/practice/brake_pad.py brake_pad.png``.
"""

import sys
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

import stickslip as ss
from stickslip import advise, plot
from stickslip.io import rig_files as rig

RIG = rig.example("brake_pad")


def groaning(path: Path = RIG, *, damping: float = 1.0) -> tuple[float, float]:
    """Speeds in m/s between which smooth braking is unstable, with the damping of the rig times a factor."""
    brake = rig.read(path)
    slider = replace(brake.slider, damping=damping * brake.slider.damping)
    edges = ss.critical_velocities(brake.interface, slider, between=(brake.velocity / 100, brake.velocity * 100)).edges
    low, high = (brake.scales.si(edge.value, "velocity") for edge in (edges[0], edges[-1]))
    return low, high


def draw(path: Path = RIG) -> Figure:
    """Stability of smooth braking over speed and damping."""
    return plot.chart(advise.chart(rig.read(path), ("velocity", "damping"), around=30.0, points=80))


if __name__ == "__main__":
    for factor in (1.0, 3.0, 10.0):
        low, high = groaning(damping=factor)
        print(f"damping times {factor:g}: groans from {1e3 * low:.3g} to {1e3 * high:.3g} mm/s")
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
