"""Pictures of velocity steps and holds: friction over displacement, peaks over the time of rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip.plot.style import BLUE, COLUMN, GREY, PAGE, VERMILLION, dress, house_style, legend_above, new_figure

Step = Any  # `stickslip.rate_state.Step`, and fits with a method `friction`: they stand above pictures
Fit = Any


@house_style()
def velocity_step(step: Step, fits: Sequence[Fit], names: Sequence[str] = (), *, length: str = "um") -> Figure:
    """Draw a velocity step and the fits to it, and their residuals below.

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
    lower.set_ylabel("residual")
    lower.set_xlabel(f"displacement after the step ({length})")
    legend_above(upper)
    return figure


@house_style()
def peaks_after_holds(run: xr.Dataset, per_decade: float | None = None) -> Figure:
    """Draw how far the force peaks after holds, and how far it relaxes in them, over the time of the hold.

    Parameters
    ----------
    run : Dataset
        Of `slide_hold_slide`.
    per_decade : float, optional
        Growth of the peaks by rate and state, ``b ln 10``: a line through the last peak.
    """
    figure = new_figure(COLUMN, 3.6)
    upper, lower = figure.subplots(2, 1, height_ratios=[3, 2], sharex=True)
    run = run.sortby("hold")
    hold, peak = run["hold"].to_numpy(), run["peak"].to_numpy()
    upper.semilogx(hold, peak, "o-", color=BLUE, markersize=3.5, label="contacts")
    if per_decade is not None:
        line = peak[-1] + per_decade * np.log10(hold / hold[-1])
        upper.semilogx(hold, line, "--", color=VERMILLION, label="slope by rate and state")
    lower.semilogx(hold, run["relaxation"], "o-", color=BLUE, markersize=3.5)
    dress(upper.yaxis, run["peak"].assign_attrs(long_name="peak above sliding"))
    dress(lower.yaxis, run["relaxation"].assign_attrs(long_name="relaxation"))
    dress(lower.xaxis, run["hold"].assign_attrs(spacing="log"))
    legend_above(upper)
    return figure
