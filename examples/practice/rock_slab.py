"""
Laboratory earthquakes: how often, how large
============================================

Two slabs of rock are sheared past each other by a press. Faster loading makes events
more frequent; does it make them smaller? The catalogue of slips of a simulated run, the
same that `stickslip measure` lists for a measured one, gives recurrence time and drop.

Run it with ``python examples/practice/rock_slab.py rock.png``.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

RIG = "rock_slab"
FACTORS = (0.1, 0.3, 1.0)
"""Loading speeds, as multiples of the rig's."""


def load(slab: ss.Rig, factor: float):
    """Return a run at another speed over the same distance, in SI units."""
    output = ss.Output(interval=2e-3)  # in s: a slip takes some milliseconds
    return ss.simulate(slab.with_values(velocity=factor * slab.velocity), output=output)


def recurrence_and_drop(run) -> tuple[float, float]:
    """Return the median time from one event to the next, in s, and the median drop of
    the force, in N, without the first events.
    """
    events = ss.drops(run).isel(event=slice(2, None))
    return float(events["start"].diff("event").median()), float(events["drop"].median())


def draw(rig: str | Path = RIG) -> Figure:
    """Draw the force against displacement of the press, at three loading speeds."""
    slab = ss.read_rig(rig)
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 4.2)
        panels = figure.subplots(len(FACTORS), sharex=True, sharey=True)
        for ax, factor, colour in zip(panels, FACTORS, plot.PALETTE, strict=False):
            run = load(slab, factor)
            wait, drop = recurrence_and_drop(run)
            speed = 1e6 * float(run["drive_velocity"][-1])
            ax.plot(
                1e-3 * speed * run["time"],
                1e-6 * run["spring_force"],
                color=colour,
                linewidth=0.8,
            )
            ax.set_title(
                f"{speed:.0f} µm/s: an event every {wait:.3g} s, drop "
                f"{1e-6 * drop:.2g} MN"
            )
        panels[1].set_ylabel("shear force (MN)")
        panels[-1].set_xlabel("displacement of the press (mm)")
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
