"""
A trace, and the interface behind it
====================================

A block is pulled slowly through a spring; only the force was recorded. How strong are
its contacts, how far do they stretch before they break, and what does the trace leave
open? Here the true values are known: `synthetic_trace` records what a bench would
record, and `stickslip.fit` sees nothing else.

Run it with ``python examples/practice/measured_trace.py fit.png``. For the usual, wider
prior, with 20,000 simulations that are kept for the next trace, call
``stickslip.fit(trace, known={"stiffness": "100 N/m"})``.
"""

import sys

from matplotlib.figure import Figure

import stickslip as ss
from stickslip import fitting, plot

TRUTH = {
    "contacts": 20,
    "threshold_std": 0.25,
    "sliding_force": 0.5,
    "stiffness_ratio": 0.05,
    "damping_ratio": 0.2,
}
BENCH = fitting.Bench(strength=15.0)  # in N
PRIOR = fitting.Prior(
    contacts=(8, 50), stiffness_ratio=(0.01, 0.3), sliding_force=(0.2, 0.8)
)


def fitted(draws: int = 2000) -> fitting.Fit:
    """Return the parameters fitted to the trace, its spring being known."""
    trace = fitting.synthetic_trace(
        **TRUTH, slip_to_slip_scatter=0.1, slips=150, bench=BENCH, seed=1
    )
    return ss.fit(trace, known={"stiffness": "100 N/m"}, prior=PRIOR, draws=draws)


def draw() -> Figure:
    """Print the parameters, and draw them with their truths and the test of the
    draws.
    """
    found = fitted()
    print(found)
    figure = found.plot()
    parameters = figure.axes[1]
    parts = PRIOR.parts([*TRUTH.values(), 0.1])
    parameters.plot(
        parts,
        [-row for row in range(len(parts))],
        "o",
        color=plot.VERMILLION,
        markersize=4,
    )
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])
