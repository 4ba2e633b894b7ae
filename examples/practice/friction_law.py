"""
Friction laws with a minimum and a maximum
==========================================

The exact kinetic friction against speed, for contacts that break by thermal
activation. With temperature alone friction rises with speed: fast contacts have less
time to break. Thresholds that grow with age raise the friction of slow sliding: it
falls with the speed down to a minimum. A delay before contacts re-attach lowers the
friction of fast sliding: it falls beyond a maximum. Where it falls, a slider on a soft
spring may stick-slip.

Run it with ``python examples/practice/friction_law.py law.png``.
"""

import sys

import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

BELL = ss.Bell(width=0.01, attempts=1e6)
THRESHOLDS = ss.Gaussian(mean=1.0, std=0.1)
CONTACTS = {
    "activation": ss.Interface(thresholds=THRESHOLDS, activation=BELL),
    "and ageing": ss.Interface(
        thresholds=THRESHOLDS,
        activation=BELL,
        ageing=ss.LogarithmicGrowth(slope=0.015, time=1e-2),
    ),
    "and a delay": ss.Interface(
        thresholds=THRESHOLDS, activation=BELL, delay=ss.Delay(1e-3)
    ),
}
BETWEEN = (1e-2, 300.0)


def turns() -> dict[str, ss.stability.TurningVelocity | None]:
    """Return the extrema of each of the laws, if it has any."""
    found = {
        name: ss.stability.turning_velocities(interface, between=BETWEEN)
        for name, interface in CONTACTS.items()
    }
    return {name: one[0] if one else None for name, one in found.items()}


def draw() -> Figure:
    """Draw the three laws, with the speeds of their extrema."""
    speed = np.geomspace(*BETWEEN, 121)
    with plot.house_style():
        figure = plot.new_figure(plot.COLUMN, 2.8)
        axes = figure.subplots()
        for (name, turn), color in zip(
            turns().items(), (plot.BLACK, plot.BLUE, plot.VERMILLION), strict=True
        ):
            axes.semilogx(
                speed,
                ss.kinetic_friction(CONTACTS[name], speed),
                color=color,
                label=name,
            )
            if turn is not None:
                print(f"temperature {name}: {turn}")
                axes.plot(turn.velocity, turn.force, "o", color=color, markersize=4)
                axes.annotate(
                    turn.kind,
                    (turn.velocity, turn.force),
                    xytext=(0, 6 if turn.kind == "minimum" else -13),
                    textcoords="offset points",
                    ha="center",
                    fontsize=8,
                    color=color,
                )
        axes.set(
            xlabel="speed ($x_s$ per time unit)",
            ylabel="kinetic friction ($f_s$ per contact)",
            xlim=BETWEEN,
        )
        plot.legend_above(axes)
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
