"""
One block, three springs
========================

For the classroom: a block on sandpaper is pulled by a spring and a slow motor. With a
soft spring it sticks and slips; with stiffer springs the slips get smaller and faster,
until the block slides. `stickslip.regime` returns the motion, with its evidence.

Run it with ``python examples/practice/teaching_bench.py bench.png``; in the browser,
``stickslip explore teaching_bench`` has a slider for the spring.
"""

import math
import sys
from pathlib import Path

from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

RIG = "teaching_bench"
SPRINGS = (100.0, 500.0, 10_000.0)
"""Stiffnesses of the springs in N/m."""
DURATION = 120.0
"""Duration in s: a cycle of the softest spring takes two, and a verdict a few dozen
cycles.
"""


def pull(bench: ss.Rig, stiffness: float):
    """Return the run with another spring, in SI units; the damping ratio stays the
    same.
    """
    damping = bench.value("damping") * math.sqrt(stiffness / bench.value("stiffness"))
    long = ss.constant(bench.velocity, duration=DURATION)
    stiffer = bench.with_values(stiffness=stiffness, damping=damping)
    return ss.simulate(stiffer.replace(drive=bench.to_natural(long)))


def draw(rig: str | Path = RIG) -> Figure:
    """Draw the force in each spring, with its regime."""
    bench = ss.read_rig(rig)
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 4.2)
        panels = figure.subplots(len(SPRINGS), sharex=True, sharey=True)
        for ax, stiffness, colour in zip(panels, SPRINGS, plot.PALETTE, strict=False):
            run = pull(bench, stiffness)
            late = run.sel(time=slice(20.0, 30.0))
            ax.plot(late["time"], late["spring_force"], color=colour)
            ax.set_title(f"{stiffness:g} N/m: {ss.regime(run).kind}")
        panels[1].set_ylabel("force in the spring (N)")
        panels[-1].set_xlabel("time (s)")
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
