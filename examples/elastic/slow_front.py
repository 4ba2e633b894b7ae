"""
A slow front, driven by slow slip
=================================

A front of slip starts in a highly loaded part of the bar and runs fast, nearly at the
speed of sound, into a part that is loaded less. There it stops. Behind it contacts
re-attach one after the other, each without the force that it carried while it slid: the
bar behind creeps on, loads the tip, and a second front starts there, 27 times slower.
Without a sliding force there is no force to lose, and the front stops for good.

Run it with ``python examples/elastic/slow_front.py front.png``.
"""

import sys

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

BLOCKS = 260
SLIDING_FORCE = 0.425
BAR = ss.Chain(blocks=BLOCKS, coupling=25.0, mass=25.0, damping=0.2, leaf=0.25)
"""The unit of time is the time in which sound passes one block."""


def rig(
    sliding_force: float = SLIDING_FORCE, beyond: float = 0.44, duration: float = 3000.0
) -> ss.Rig:
    """Return a bar with a prestress of .7 for the first hundred blocks, of `beyond` for
    the others, and a push on the first three.
    """
    contacts = ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=0.0),
        delay=ss.RandomDelay(mean=720.0, std=216.0, negative="redraw"),
        sliding_force=sliding_force,
    )
    prestress = np.where(np.arange(BLOCKS) < 100, 0.7, beyond)
    start = ss.Prestressed(
        stretching=tuple(sliding_force + (1.0 - sliding_force) * prestress),
        push=3.0,
        pushed_blocks=3,
    )
    drive = ss.constant(0.0, duration=duration)
    return ss.Rig(
        contacts,
        BAR,
        drive,
        method=ss.Contacts(100, seed=1),
        start=start,
        output=ss.Output(interval=2.0),
    )


def speeds(run: xr.Dataset) -> tuple[float, float]:
    """Return the speeds of the fast front, from theory, and of the slow one."""
    time = run["first_break"].values
    arrest = int(ss.measure.fronts(run)["last_block"][0]) + 1
    fast, slow = (
        np.polyfit(time[part], np.arange(BLOCKS)[part], 1)[0]
        for part in (slice(60, 96), slice(arrest + 8, arrest + 29))
    )
    return float(fast), float(slow)


def draw() -> Figure:
    """Draw where contacts are attached, early and over the whole run, how fast blocks
    slip, and how fast the front runs.
    """
    run = ss.simulate(rig())
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 6.0)
        axes = figure.subplots(2, 2)
        plot.spacetime(run.sel(time=slice(0, 300)), "attached", axes[0, 0])
        plot.spacetime(run, "attached", axes[0, 1])
        plot.spacetime(run, "velocity", axes[1, 0])
        plot.fronts(run, axes[1, 1])
        theory = float(ss.elastic.front_speed(rig(), prestress=0.7))
        axes[1, 1].plot([10, 100], [theory, theory], color=plot.BLACK, label="theory")
        plot.legend_above(axes[1, 1], columns=2)
    return figure


if __name__ == "__main__":
    fast, slow = speeds(ss.simulate(rig()))
    print(f"fast front {fast:.4f}, slow front {slow:.4f} blocks per time unit")
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
