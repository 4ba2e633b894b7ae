"""What a force trace shows: its slips, its regime, and where the regime changes on a ramp.

Every function takes an `xarray.Dataset` with `spring_force`, the force of the driving spring, along `time`: a run of
the model, or a trace of a bench, read with `read_trace`. What there is besides is used. Units are those of the data.

A slip is a drop of the force. Nothing here asks whether the slider is at rest: with contacts that hold, a
driven slider creeps at ``v K/(K + k N_c)`` between slips, so rest tells nothing about the regime.
"""

from stickslip.measure.catalogue import counted, drops, regime_and_drops, statistics
from stickslip.measure.evidence import Criterion
from stickslip.measure.fronts import events, fronts
from stickslip.measure.kinematics import Kinematics, kinematics, motion
from stickslip.measure.periods import Cycles, find_cycles
from stickslip.measure.ramps import transitions
from stickslip.measure.readings import read_trace
from stickslip.measure.verdict import Regime, regime

__all__ = [
    "Criterion",
    "Cycles",
    "Kinematics",
    "Regime",
    "counted",
    "drops",
    "events",
    "find_cycles",
    "fronts",
    "kinematics",
    "motion",
]
__all__ += ["read_trace", "regime", "regime_and_drops", "statistics", "transitions"]
