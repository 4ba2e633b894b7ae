"""From a measured force trace to the interface behind it, with honest intervals.

`fit` compares the slips of a trace with simulated ones, sampled and picked in the same
way. `quick_fit` makes a rig of a few readings by closed forms, without error bars.
"""

from stickslip.fitting.bench import Told
from stickslip.fitting.events import Events, check, pick_events
from stickslip.fitting.fits import Fit, Interval, fit
from stickslip.fitting.model import UNKNOWNS, Bench, Prior, synthetic_trace
from stickslip.fitting.rigs import quick_fit, rigs_drawn
from stickslip.fitting.summary import FITTED, HELD_OUT, statistics
from stickslip.fitting.tables import Table, table

__all__ = [
    "FITTED",
    "HELD_OUT",
    "UNKNOWNS",
    "Bench",
    "Events",
    "Fit",
    "Interval",
    "Prior",
    "Table",
    "Told",
]
__all__ += [
    "check",
    "fit",
    "pick_events",
    "quick_fit",
    "rigs_drawn",
    "statistics",
    "synthetic_trace",
    "table",
]
