"""Steady sliding of any interface by one door, `sliding_of`: force, slope and linear response.

`kinetic_friction`, `friction_slope` and `turning_velocities` are the friction law; the linear response `respond`
carries the stability of smooth sliding, and rate and state.
"""

from stickslip.sliding.door import respond as respond
from stickslip.sliding.door import sliding_of as sliding_of
from stickslip.sliding.law import TurningVelocity as TurningVelocity
from stickslip.sliding.law import friction_slope as friction_slope
from stickslip.sliding.law import kinetic_friction as kinetic_friction
from stickslip.sliding.law import turning_velocities as turning_velocities
from stickslip.sliding.response import Response as Response
