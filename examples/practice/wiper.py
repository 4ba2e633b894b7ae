"""
A wiper chatters where it turns round
=====================================

A wiper blade speeds up, slows down and turns round. Does it chatter in the middle of
the stroke, or at its ends? Linear stability theory gives the range of speeds in which
smooth wiping is unstable; a simulated stroke shows the chatter. It takes time to grow
and to decay, and so lags behind the speed.

Run it with ``python examples/practice/wiper.py wiper.png``.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

RIG = "wiper"


def chattering(wiper: ss.Rig) -> tuple[float, float]:
    """Return the speeds in m/s between which smooth wiping is unstable."""
    edges = ss.critical(
        wiper.replace(velocity="1 m/s"), "velocity", between=(1e-3, 1e2)
    ).edges
    return edges[0].value, edges[-1].value


def draw(rig: str | Path = RIG) -> Figure:
    """Draw one stroke of the wiper, with the speeds at which it should chatter."""
    wiper = ss.read_rig(rig)
    low, high = chattering(wiper)
    run = ss.simulate(wiper)
    time = run["time"].to_numpy()
    speed = run["drive_velocity"].to_numpy()

    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 3.6)
        above, below = figure.subplots(2, sharex=True)
        above.plot(time, speed, color=plot.GREY, label="wiper motor")
        above.axhspan(
            low, high, color=plot.ORANGE, alpha=0.2, label="smooth wiping is unstable"
        )
        above.set(ylabel="speed (m/s)", ylim=(0, None))
        plot.legend_above(above)
        below.plot(time, run["spring_force"], color=plot.BLUE)
        below.fill_between(
            time,
            0,
            1,
            np.abs(speed - 0.5 * (low + high)) < 0.5 * (high - low),
            color=plot.ORANGE,
            alpha=0.2,
            transform=below.get_xaxis_transform(),
            linewidth=0,
        )
        below.set(xlabel="time (s)", ylabel="force on the arm (N)")
    return figure


if __name__ == "__main__":
    print("chatters from {:.3g} to {:.3g} m/s".format(*chattering(ss.read_rig(RIG))))
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
