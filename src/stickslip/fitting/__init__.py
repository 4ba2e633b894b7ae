"""From a measured force trace to the interface behind it, with honest intervals.

`fit` compares the slips of a trace with simulated ones, sampled and picked in the same way. `quick_fit` makes a rig of
a few readings by closed forms, without error bars. `over_draws` gives the verdict on a fitted rig with its uncertainty.
"""

from stickslip.fitting.bench import Told
from stickslip.fitting.events import Events, check, pick_events
from stickslip.fitting.fits import Fit, Interval, fit
from stickslip.fitting.model import UNKNOWNS, Bench, Prior, synthetic_trace
from stickslip.fitting.rigs import Uncertain, over_draws, quick_fit
from stickslip.fitting.summary import FITTED, HELD_OUT, statistics
from stickslip.fitting.tables import Table, table

__all__ = ["FITTED", "HELD_OUT", "UNKNOWNS", "Bench", "Events", "Fit", "Interval", "Prior", "Table", "Told"]
__all__ += ["Uncertain", "check", "fit", "over_draws", "pick_events", "quick_fit", "statistics", "synthetic_trace"]
__all__ += ["table"]
