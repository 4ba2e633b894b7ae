"""
A wiper chatters where it turns round
=====================================

A wiper blade speeds up, slows down and turns round. Does it chatter in the middle of the stroke, or at its ends? The
theory of linear stability gives the speeds between which smooth wiping cannot last; a simulated stroke shows what that
looks like. Chatter takes its time to grow and to die, so it lags behind the speed.

Run it with ``python examples/practice/wiper.py wiper.png``.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot
from stickslip.io import rig_files as rig

RIG = rig.example("wiper")


def chattering(wiper: rig.Rig) -> tuple[float, float]:
    """Speeds in m/s between which smooth wiping is unstable."""
    edges = ss.critical_velocities(wiper.interface, wiper.slider, between=(wiper.velocity / 10, 1e3)).edges
    return tuple(wiper.scales.si(edge.value, "velocity") for edge in (edges[0], edges[-1]))


def draw(path: Path = RIG) -> Figure:
    """One stroke of the wiper, with the speeds at which it should chatter."""
    wiper = rig.read(path)
    low, high = chattering(wiper)
    run = wiper.in_its_units(ss.simulate(wiper.interface, wiper.slider, wiper.drive, wiper.method))
    time, speed = run["time"].to_numpy(), run["drive_velocity"].to_numpy()

    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 3.6)
        above, below = figure.subplots(2, sharex=True)
        above.plot(time, speed, color=plot.GREY, label="wiper motor")
        above.axhspan(low, high, color=plot.ORANGE, alpha=0.2, label="smooth wiping is unstable")
        above.set(ylabel="speed (m/s)", ylim=(0, None))
        plot.legend_above(above)
        below.plot(time, run["spring_force"], color=plot.BLUE)
        below.fill_between(time, 0, 1, np.abs(speed - 0.5 * (low + high)) < 0.5 * (high - low), color=plot.ORANGE,
                           alpha=0.2, transform=below.get_xaxis_transform(), linewidth=0)  # fmt: skip
        below.set(xlabel="time (s)", ylabel="force on the arm (N)")
    return figure


if __name__ == "__main__":
    print("chatters from {:.3g} to {:.3g} m/s".format(*chattering(rig.read(RIG))))
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
