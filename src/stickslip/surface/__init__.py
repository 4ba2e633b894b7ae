"""Contacts of a rough surface, from a map of heights, and the interface they make.

`read` a map, or draw one with `self_affine` or `from_drawing`; `contacts` presses it on
a flat surface; `estimate` gives their parameters, and `rig` puts these into a rig,
with the ranges that it leaves as assumptions. A map is a prior: it does not say which
length counts, nor the delay.
"""

from stickslip.surface.halfspace import press, tangential_stiffness
from stickslip.surface.maps import from_drawing, low_pass, read, self_affine
from stickslip.surface.pressing import (
    MATERIALS,
    Material,
    contacts,
    loads,
    material_named,
)
from stickslip.surface.prior import Estimate, estimate, interface, rig

__all__ = [
    "MATERIALS",
    "Estimate",
    "Material",
    "contacts",
    "estimate",
    "from_drawing",
    "interface",
    "loads",
    "low_pass",
    "material_named",
    "press",
]
__all__ += ["read", "rig", "self_affine", "tangential_stiffness"]
