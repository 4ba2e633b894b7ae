"""Elastic sliders in theory: slip fronts, precursors, and the modes of smooth sliding.

A `Chain` or a `Sheet` of blocks in the place of the rigid slider of a rig. How fast a
front of slip runs, and from which prestress on; how far a force reaches, and slip
precursors with it; which wavelengths of smooth sliding grow.
"""

from stickslip.elastic.front_speed import Front, front_speed, front_threshold
from stickslip.elastic.modes import CriticalLength, critical_length, modes
from stickslip.elastic.precursors import precursor_force, screening_length

__all__ = [
    "CriticalLength",
    "Front",
    "critical_length",
    "front_speed",
    "front_threshold",
    "modes",
    "precursor_force",
    "screening_length",
]
