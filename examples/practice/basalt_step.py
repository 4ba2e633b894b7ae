"""
A velocity step on basalt, as rate and state and as contacts
============================================================

Friction of basalt gouge in the laboratory, in a velocity step of the load point from 3
to 10 µm/s (Giacomel and others, MIT licence). The slip law fits it with a, b and D.
Contacts with temperature and ageing fit it equally well, with the same number of
parameters, if the distribution of their thresholds is broad: with a narrow one the
force would oscillate after the step, and the measured force does not.

Run it with ``python examples/practice/basalt_step.py step.png``.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot
from stickslip.rate_state import (
    ContactsFit,
    Step,
    StepFit,
    fit_contacts,
    velocity_step_in,
)

DATA = Path(ss.__file__).parents[2] / "tests" / "data" / "giacomel_basalt_step.txt"
BROAD = ss.Gamma(mean=1.0, std=0.85)
NARROW = ss.Gaussian(mean=1.0, std=0.3)


def step() -> Step:
    """Return the step, from 5 µm before to 120 µm after it, in 200 bins."""
    trace = ss.read_trace(DATA)
    return velocity_step_in(
        trace, at=11676.28, before=3.0, after=10.0, span=(5.0, 120.0), bins=200
    )


def fits(measured: Step) -> tuple[StepFit, ContactsFit, ContactsFit]:
    """Fit rate and state, and contacts with broad and with narrow thresholds, all with
    a linear trend.
    """
    broad, narrow = (
        fit_contacts(measured, thresholds=one, trend=True, linear=True)
        for one in (BROAD, NARROW)
    )
    return ss.rate_state.fit_rate_and_state(measured, trend=True), broad, narrow


def draw() -> Figure:
    """Print the fits and draw them."""
    measured = step()
    found = fits(measured)
    print(*found, sep="\n")
    return plot.velocity_step(
        measured,
        found,
        (f"{found[0].law} law", "contacts, broad", "contacts, narrow"),
        length="µm",
    )


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
