"""
One block, three springs
========================

For the classroom: a block on sandpaper is pulled by a spring and a slow motor. With a soft spring it sticks and
slips; with stiffer springs the slips get smaller and faster, until the block slides. `stickslip.regime` says which,
and why.

Run it with ``python examples/practice/teaching_bench.py bench.png``; in the browser, ``stickslip explore
teaching_bench`` has a slider for the spring.
"""

import sys
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot
from stickslip.io import rig_files as rig

RIG = rig.example("teaching_bench")
SPRINGS = (100.0, 500.0, 10_000.0)
"""In N/m."""


def pull(bench: rig.Rig, stiffness: float):
    """The run with another spring, in SI units; the damping stays the same fraction of the block's own oscillation."""
    share = bench.slider.damping / bench.slider.frequency
    slider = replace(bench.slider, stiffness=bench.scales.natural(stiffness, "stiffness"))
    slider = replace(slider, damping=share * slider.frequency)
    return bench.in_its_units(ss.simulate(bench.interface, slider, bench.drive, bench.method))


def draw(path: Path = RIG) -> Figure:
    """The force in each spring, and what regime it is."""
    bench = rig.read(path)
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
