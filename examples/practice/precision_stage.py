"""
How stiff must the servo of a precision stage be?
=================================================

A position servo holds a stage to its course as a spring would: its gain is the
stiffness of the driving spring. If it is too soft the stage jerks, more so the slower
it moves. Linear theory gives the softest servo that keeps smooth motion stable at each
speed, and runs on both sides of it show the difference.

Run it with ``python examples/practice/precision_stage.py stage.png``.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

RIG = "precision_stage"
SPEEDS = np.geomspace(0.2e-3, 20e-3, 25)
"""Speeds in m/s."""


def softest_servo(stage: ss.Rig) -> np.ndarray:
    """Return the stiffness in N/m below which smooth motion is unstable, at each of the
    speeds; NaN where any servo is stiff enough.
    """
    found = []
    for speed in SPEEDS:
        try:
            found.append(
                ss.stability.critical_spring(stage.with_values(velocity=speed))
            )
        except ss.UndecidedError:
            found.append(np.nan)
    return np.array(found)


def error_of_tracking(stage: ss.Rig, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the time in s, and the deviation of the stage from its course, in m."""
    run = ss.simulate(stage.with_values(stiffness=stiffness))
    lag = (run["spring_force"] / stiffness).to_numpy()
    return run["time"].to_numpy(), lag - lag[lag.size // 2 :].mean()


def draw(rig: str | Path = RIG) -> Figure:
    """Draw the softest servo against speed, and the tracking error with one softer and
    one stiffer.
    """
    stage = ss.read_rig(rig)
    softest = softest_servo(stage)
    here = stage.velocity
    critical = float(np.interp(here, SPEEDS, softest))
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 2.9)
        left, right = figure.subplots(1, 2)
        left.loglog(1e3 * SPEEDS, 1e-6 * softest, color=plot.BLUE)
        left.fill_between(
            1e3 * SPEEDS,
            1e-6 * np.nanmin(softest) / 2,
            1e-6 * softest,
            color=plot.ORANGE,
            alpha=0.25,
        )
        left.set(
            xlabel="speed (mm/s)",
            ylabel="stiffness of the servo (N/µm)",
            title="smooth motion is unstable below",
        )
        for factor, colour in ((0.5, plot.VERMILLION), (1.3, plot.GREEN)):
            t, error = error_of_tracking(stage, factor * critical)
            late = t > t[-1] - 0.3
            left.plot(1e3 * here, 1e-6 * factor * critical, "o", color=colour)
            right.plot(
                t[late] - t[late][0],
                1e6 * error[late],
                color=colour,
                label=f"{1e-6 * factor * critical:.2g} N/µm",
            )
        right.set(xlabel="time (s)", ylabel="error of tracking (µm)")
        plot.legend_above(right)
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
