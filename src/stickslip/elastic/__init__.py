"""Theory of elastic sliders: slip fronts, precursors, and the modes of smooth sliding.

The rigid slider of a rig is replaced by a `Chain` or a `Sheet` of blocks. Theory gives
the speed of a slip front and the least prestress for it; the distance over which a
force, and with it slip precursors, extend; and the wavelengths that grow in smooth
sliding.
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
