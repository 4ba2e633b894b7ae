"""
Smooth sliding invades stick-slip
=================================

There are speeds at which a rigid slider may slide smoothly or stick and slip, depending
on its start. On a long elastic slider that is driven from above both motions can occur
side by side, and the boundary between them moves: smooth sliding takes over, at a
steady speed of about half of ``sqrt(k_b)`` blocks per time unit. On a short slider
stick-slip takes over.

Run it with ``python examples/elastic/side_by_side.py invasion.png``.
"""

import sys

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

CONTACTS = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
PERIOD = 1.6
"""A little longer than the period of stick-slip."""


def run(
    blocks: int, at_rest: int, duration: float, seed: int = 1, coupling: float = 20.0
) -> xr.Dataset:
    """Run a bar whose first blocks start at rest, and so in stick-slip, the others in
    smooth sliding.
    """
    bar = ss.Chain(
        blocks=blocks, coupling=coupling, mass=1e-4, damping=42.426, leaf=2.0
    )
    drive = ss.constant(1.0, duration=duration)
    rig = ss.Rig(
        CONTACTS,
        bar,
        drive,
        method=ss.Contacts(300, seed=seed),
        start=ss.FromSliding(at_rest=at_rest),
    )
    return ss.simulate(rig, output=ss.Output(interval=0.05))


def in_stick_slip(found: xr.Dataset) -> xr.DataArray:
    """Return how many blocks stick and slip: those whose friction force varies by .4 or
    more within a period.
    """
    windows = (
        found["friction_force"]
        .rolling(time=round(PERIOD / 0.05), center=True)
        .construct("lag")
        .dropna("time")
    )
    return ((windows.max("lag") - windows.min("lag")) > 0.4).sum("block")


def speed(count: xr.DataArray, blocks: int) -> float:
    """Return the blocks that smooth sliding gains per time, while the boundary is away
    from both ends.
    """
    inside = count[(count > blocks // 4) & (count < 0.82 * blocks)]
    return -float(np.polyfit(inside["time"], inside, 1)[0])


def draw() -> Figure:
    """Draw the friction force on a long bar in space and time, and the blocks in
    stick-slip on long and short bars.
    """
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 3.0)
        left, right = figure.subplots(1, 2)
        long = run(64, 58, duration=36.0)
        plot.spacetime(long, "force", left)
        for blocks, colour in ((64, plot.BLUE), (16, plot.GREEN), (8, plot.VERMILLION)):
            found = long if blocks == 64 else run(blocks, blocks // 2, duration=36.0)
            count = in_stick_slip(found)
            right.plot(
                count["time"], count / blocks, color=colour, label=f"{blocks} blocks"
            )
        right.set(
            xlabel="time (time units)",
            ylabel="part in stick-slip",
            ylim=(0, 1.05),
            xlim=(0, 36),
        )
        plot.legend_above(right, columns=3)
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
