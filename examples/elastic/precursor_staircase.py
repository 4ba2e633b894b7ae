"""
Precursors of sliding
=====================

A bar is pulled slowly at one end. Long before all of it slides, slip starts at that end
and runs some way along: the force drops a little, the contacts re-attach, and the next
precursor runs further. The length of precursors grows with the force, by one over the
sliding force of a block; the last one reaches the far end, and that force is the static
friction of the bar, well below the strength of all its contacts.

Run it with ``python examples/elastic/precursor_staircase.py precursors.png``.
"""

import sys

import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

CONTACTS = ss.Interface(
    thresholds=ss.Gaussian(mean=1.0, std=0.05),
    delay=ss.RandomDelay(mean=100.0, std=30.0),
    sliding_force=0.425,
)
BAR = ss.Chain(blocks=60, coupling=4.0, mass=4.0, damping=0.1, side=4.0)
RIG = ss.Rig(
    CONTACTS,
    BAR,
    ss.constant(2.5e-4, duration=9e5),
    method=ss.QuasiStatic(50, seed=1),
    output=ss.Output(interval=225.0),
)
"""A pull so slow that contacts re-attach before the drive has moved by a thirtieth of
their stretching.
"""


def run() -> xr.Dataset:
    """Run the first pull, up to the first slip of all blocks."""
    return ss.simulate(RIG)


def draw() -> Figure:
    """Draw force against time, precursors against force, their slip, and where contacts
    are detached.
    """
    pulled = run()
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 5.2)
        axes = figure.subplots(2, 2)
        plot.precursors(pulled, axes[0, 0])
        plot.precursor_lengths(pulled, axes[0, 1])
        plot.slip_profiles(pulled, axes[1, 0])
        plot.spacetime(pulled, "force", axes[1, 1])
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
