"""
Up to which gain does a positioning axis hunt?
==============================================

A position controller with an integral term pulls on an axis as long as an error is
left, while contacts that have rested hold it: the axis slips too far, and returns in
the same way. Up to a fold of the gain, it depends on the move whether the axis hunts;
the peak-to-peak amplitude follows from one slip. The gains are raised together, so that
damping and integral time stay the same.

Run it with ``python examples/practice/hunting_axis.py hunting.png``.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot
from stickslip.structures.hunting import Hunt, with_gain

RIG = "axis"
FACTORS = np.geomspace(0.5, 4.0, 7)
"""Factors of the gain."""


def widths(axis: ss.Rig) -> list[tuple[float, float, float]]:
    """Return the gain in N/m, peak to peak after each move, and the width predicted
    from one slip, in m.
    """
    found = []
    for factor in FACTORS:
        gain = axis.slider.kp * float(factor)
        hunt = Hunt(replace(axis, slider=with_gain(axis.slider, gain)))
        slips = hunt.slip.length + hunt.slip.break_away
        for distance in hunt.moves[:3]:
            seen = hunt.move(distance).peak_to_peak
            found.append((gain * axis.unit("k"), seen, slips if hunt.possible else 0.0))
    return found


def after(axis: ss.Rig, move: float, hold: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the time in s after the start of a move in m, and the error in m."""
    speed = axis.velocity
    drive = ss.constant(speed, move / speed).then(ss.constant(0.0, hold))
    run = ss.simulate(axis.replace(drive=axis.to_natural(drive)))
    return run["time"].to_numpy(), run["displacement"].to_numpy() - move


def draw(rig: str | Path = RIG) -> Figure:
    """Draw the width of hunting against the gain, with its fold, and the error after
    two moves.
    """
    axis = ss.read_rig(rig)
    length = axis.unit("length")
    fold = Hunt(axis).fold() * axis.unit("k")
    gain, seen, slips = np.array(widths(axis)).T
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 2.9)
        left, right = figure.subplots(1, 2)
        left.plot(1e-6 * gain, 1e6 * length * seen, "o", color=plot.BLUE, label="moves")
        left.plot(
            1e-6 * gain,
            1e6 * length * slips,
            color=plot.ORANGE,
            label="by one slip",
        )
        # limit of the gain for the axis at rest: up to there it may hunt
        left.axvline(1e-6 * fold, linestyle=":", color=plot.GREY, label="fold")
        left.legend()
        left.set(xlabel="gain $K_p$ (N/µm)", ylabel="peak to peak at rest (µm)")
        for move, colour in ((20e-6, plot.BLUE), (100e-6, plot.ORANGE)):
            t, error = after(axis, move, 0.8)
            right.plot(t, 1e6 * error, color=colour, label=f"{1e6 * move:.0f} µm")
        right.set(xlabel="time (s)", ylabel="error after a move (µm)", ylim=(-60, 60))
        right.legend(title="move")
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
