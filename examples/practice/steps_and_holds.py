"""
Velocity steps and holds
========================

Contacts that break by thermal activation show what rate-and-state laws describe: after
a step up in velocity the friction force rises at once, and then falls over a slip
distance; after a hold it peaks, and the peak grows with the time of the hold. Contacts
whose thresholds grow with the logarithm of their age are velocity-weakening in steady
state, and heal by the slope of that growth for each factor e in time; contacts that do
not age are velocity-strengthening, and hardly heal.

Run it with ``python examples/practice/steps_and_holds.py steps.png``.
"""

import sys

import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

BELL = ss.Bell(width=0.01, attempts=1e6)
THRESHOLDS = ss.Gaussian(mean=1.0, std=0.3)
SLOPE = 0.02
CONTACTS = {
    "no ageing": ss.Interface(thresholds=THRESHOLDS, activation=BELL),
    "logarithmic ageing": ss.Interface(
        thresholds=THRESHOLDS,
        activation=BELL,
        ageing=ss.LogarithmicGrowth(slope=SLOPE, time=1e-3),
    ),
}
HOLDS = np.geomspace(1.0, 1e4, 9)


def draw() -> Figure:
    """Draw a step of the velocity from 1 to 10, and peaks after holds."""
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 3.0)
        step, heal = figure.subplots(1, 2)
        for (name, interface), color in zip(
            CONTACTS.items(), (plot.BLUE, plot.ORANGE), strict=True
        ):
            run = ss.velocity_step(interface, before=1.0, after=10.0, distance=3.0)
            step.plot(
                run.displacement,
                run.friction_force - run.friction_force[0],
                color=color,
                label=name,
            )
            holds = ss.slide_hold_slide(interface, velocity=1.0, holds=HOLDS.tolist())
            heal.semilogx(holds.hold, holds.peak, "o-", color=color, markersize=3.5)
            if interface.ageing is not None:
                line = holds.peak[-1].item() + SLOPE * np.log(HOLDS / HOLDS[-1])
                heal.semilogx(
                    HOLDS, line, ":", color="0.4", label="slope of ageing", zorder=0
                )
        step.set(
            xlabel="slip after the step ($x_s$)",
            ylabel="change of the friction force ($f_s$)",
        )
        heal.set(
            xlabel="hold (time units)",
            ylabel="peak above sliding ($f_s$)",
            ylim=(0.0, None),
        )
        step.legend()
        heal.legend()
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
