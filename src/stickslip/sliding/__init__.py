"""Steady sliding of any interface: force, slope and linear response, by `sliding_of`.

`kinetic_friction`, `friction_slope` and `turning_velocities` describe the friction law;
the linear response, by `respond`, gives the stability of smooth sliding and the
rate-and-state law.
"""

from stickslip.sliding.curve import FrictionCurve, friction_curve
from stickslip.sliding.law import (
    TurningVelocity,
    friction_slope,
    kinetic_friction,
    turning_velocities,
)
from stickslip.sliding.response import Response
from stickslip.sliding.steady import respond, sliding_of

__all__ = [
    "FrictionCurve",
    "Response",
    "TurningVelocity",
    "friction_curve",
    "friction_slope",
    "kinetic_friction",
    "respond",
    "sliding_of",
]
__all__ += ["turning_velocities"]
