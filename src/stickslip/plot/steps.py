"""Pictures of velocity steps: friction over displacement, and the fits to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from stickslip.plot.style import BLUE, GREY, PAGE, VERMILLION, house_style, legend_above, new_figure

Step = Any  # `stickslip.rate_state.Step`, and fits with a method `friction`: they stand above pictures
Fit = Any


@house_style()
def velocity_step(step: Step, fits: Sequence[Fit], names: Sequence[str] = (), *, length: str = "um") -> Figure:
    """Draw a velocity step and the fits to it, and below what they leave.

    Parameters
    ----------
    step : Step
        What `stickslip.rate_state.velocity_step_in` cuts out.
    fits : sequence of StepFit or ContactsFit
    names : sequence of str
        Of the fits, for the legend.
    length : str
        Unit of the displacement.
    """
    figure = new_figure(PAGE, 3.6)
    upper, lower = figure.subplots(2, 1, height_ratios=[3, 1], sharex=True)
    x = np.asarray(step.displacement)
    upper.plot(x, step.friction, ".", color=GREY, markersize=2.5, label="data")
    for k, (fit, colour) in enumerate(zip(fits, (BLUE, VERMILLION, "black"), strict=False)):
        name = names[k] if k < len(names) else f"{fit.law} law"
        curve = fit.friction(x)
        upper.plot(x, curve, color=colour, label=name)
        lower.plot(x, step.friction - curve, color=colour, linewidth=0.7)
    upper.set_ylabel("friction")
    lower.set_ylabel("left over")
    lower.set_xlabel(f"displacement after the step ({length})")
    legend_above(upper)
    return figure
