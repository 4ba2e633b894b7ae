"""What a rough surface tells of an interface: its contacts, from a map of heights.

The surface, periodic and elastic, is pressed on a flat one; ``stickslip.surface.press``
returns the pressures, `tangential_stiffness` how stiff the contacts are together.
"""

from stickslip.surface.halfspace import press, tangential_stiffness

__all__ = ["press", "tangential_stiffness"]
