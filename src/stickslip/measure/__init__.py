"""Measurements of a force trace: its slips, its regime, and the velocities on a ramp at
which the regime changes.

Every function takes an `xarray.Dataset` with `spring_force`, the force of the driving
spring, along `time`, in any unit: a run, or a trace read with `read_trace`. A slip is a
drop of the force, whether or not the slider is at rest before it: while its contacts
hold, a driven slider creeps at ``v K/(K + k N_c)`` between slips.
"""

from stickslip.measure.catalogue import counted, drops, regime_and_drops, statistics
from stickslip.measure.column_choice import Column, columns
from stickslip.measure.features import Criterion
from stickslip.measure.fronts import events, fronts, on_blocks, pixels, rows
from stickslip.measure.kinematics import Kinematics, kinematics, motion
from stickslip.measure.part_table import part_rows
from stickslip.measure.periods import Cycles, find_cycles
from stickslip.measure.ramps import in_words as transitions_in_words
from stickslip.measure.ramps import transitions
from stickslip.measure.regimes import Regime, regime
from stickslip.measure.speeds import friction_at_speeds
from stickslip.measure.trace_reader import read_trace

__all__ = [
    "Column",
    "Criterion",
    "Cycles",
    "Kinematics",
    "Regime",
    "columns",
    "counted",
    "drops",
    "events",
    "find_cycles",
    "friction_at_speeds",
    "fronts",
    "kinematics",
    "motion",
    "on_blocks",
    "part_rows",
    "pixels",
    "read_trace",
    "regime",
    "regime_and_drops",
    "rows",
    "statistics",
    "transitions",
    "transitions_in_words",
]
