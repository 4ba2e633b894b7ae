"""Parameters of an interface from a measured force trace, with calibrated intervals.

`fit` compares the slips of a trace with simulated slips, which are sampled and detected
in the same way. `quick_fit` makes a rig from a few readings by closed forms, without
error bars.
"""

from stickslip.fitting.bench import Constraint
from stickslip.fitting.bench import newtons as force_unit_in_newtons
from stickslip.fitting.bench import seconds as time_unit_in_seconds
from stickslip.fitting.events import Events, check, pick_events
from stickslip.fitting.fits import Fit, FittedInterval, fit
from stickslip.fitting.model import UNKNOWNS, Bench, Prior, sampled, synthetic_trace
from stickslip.fitting.rigs import compared, friction_ratio_range, quick_fit, rigs_drawn
from stickslip.fitting.series_table import (
    DRAWS,
    SeriesTable,
    draws_kept,
    seconds_per_draw,
    table,
)
from stickslip.fitting.summary import FITTED, HELD_OUT, statistics

__all__ = [
    "DRAWS",
    "FITTED",
    "HELD_OUT",
    "UNKNOWNS",
    "Bench",
    "Constraint",
    "Events",
    "Fit",
    "FittedInterval",
    "Prior",
    "SeriesTable",
    "check",
    "compared",
    "draws_kept",
    "fit",
    "force_unit_in_newtons",
    "friction_ratio_range",
    "pick_events",
    "quick_fit",
    "rigs_drawn",
    "sampled",
    "seconds_per_draw",
    "statistics",
    "synthetic_trace",
    "table",
    "time_unit_in_seconds",
]
