"""Runs of a rig: an interface, a slider, a drive and a method in, a labelled Dataset out."""

from stickslip.simulation.run import (
    LABELS,
    Progress,
    check_method,
    initial_nodes,
    pull_rigidly,
    rerun,
    rig_of,
    simulate,
    slider_constants,
    survival_table,
)
from stickslip.simulation.work import Work, estimate

__all__ = [
    "LABELS",
    "Progress",
    "Work",
    "check_method",
    "estimate",
    "initial_nodes",
    "pull_rigidly",
    "rerun",
    "rig_of",
    "simulate",
    "slider_constants",
    "survival_table",
]
