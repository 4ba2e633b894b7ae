"""From a measured force trace to the interface behind it, with honest intervals.

`fit` compares the slips of a trace with simulated ones, sampled and picked in the same way. `quick_fit` makes a rig of
a few readings by closed forms, without error bars. `over_draws` gives the verdict on a fitted rig with its uncertainty.
"""

from stickslip.fitting.bench import Told as Told
from stickslip.fitting.events import Events as Events
from stickslip.fitting.events import check as check
from stickslip.fitting.events import pick_events as pick_events
from stickslip.fitting.fits import Fit as Fit
from stickslip.fitting.fits import Interval as Interval
from stickslip.fitting.fits import fit as fit
from stickslip.fitting.model import UNKNOWNS as UNKNOWNS
from stickslip.fitting.model import Bench as Bench
from stickslip.fitting.model import Prior as Prior
from stickslip.fitting.model import synthetic_trace as synthetic_trace
from stickslip.fitting.rigs import Uncertain as Uncertain
from stickslip.fitting.rigs import over_draws as over_draws
from stickslip.fitting.rigs import quick_fit as quick_fit
from stickslip.fitting.summary import FITTED as FITTED
from stickslip.fitting.summary import HELD_OUT as HELD_OUT
from stickslip.fitting.summary import statistics as statistics
from stickslip.fitting.tables import Table as Table
from stickslip.fitting.tables import table as table
