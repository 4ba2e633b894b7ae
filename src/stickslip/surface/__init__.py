"""Contacts of a rough surface, from a map of heights, and the interface they make.

`read` reads a map, `self_affine` and `from_drawing` generate a random one; `contacts`
presses it on a flat surface; `estimate` gives the parameters of the interface, and
`rig` puts these into a rig, with their ranges as assumptions. A map is only a prior: it
determines neither which length applies, nor the delay.
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
    "read",
    "rig",
    "self_affine",
    "tangential_stiffness",
]
