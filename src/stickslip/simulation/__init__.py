"""Simulated runs of a rig: an interface, a slider, a drive and a method in, a labelled
Dataset out.

`engines` holds the solvers, one class each behind one protocol; `driver` advances any
of them along any drive; `result` makes the Dataset.
"""

from stickslip.simulation.driver import follow_leg
from stickslip.simulation.engines import Beginning, Leg
from stickslip.simulation.engines.base import engine_of as check_method
from stickslip.simulation.engines.panels import Panels
from stickslip.simulation.estimates import slowness
from stickslip.simulation.result import LABELS, with_label
from stickslip.simulation.run import (
    Recording,
    estimate,
    pull_rigidly,
    record,
    rerun,
    rig_of,
    simulate,
)
from stickslip.simulation.steps_and_holds import slide_hold_slide, velocity_step

__all__ = [
    "LABELS",
    "Beginning",
    "Leg",
    "Panels",
    "Recording",
    "check_method",
    "estimate",
    "follow_leg",
    "with_label",
]
__all__ += [
    "pull_rigidly",
    "record",
    "rerun",
    "rig_of",
    "simulate",
    "slide_hold_slide",
    "slowness",
    "velocity_step",
]
