"""Linear stability of smooth sliding: growth rates, critical values, maps and boundaries, computed and not swept.

A slider that moves at a steady speed is perturbed a little, ``exp(s t)``. The rig answers with its impedance
``Z(s)``, the interface with its dynamic stiffness ``kappa(s)`` (`dynamic_stiffness`), and smooth sliding is
unstable if ``Z(s) + kappa(s) = 0`` has a root with ``Re s > 0``. Everything here is linear: it says where
smooth sliding is unstable to the smallest disturbance. Stick-slip once started may live on where smooth
sliding is stable; that is for simulation to say.

Natural units per contact. A rig is a `Slider` or any mechanical impedance (`Impedance`).
"""

from stickslip.stability.impedances import Impedance, Modes, RadiationDamping, Rig, SpringMassDamper
from stickslip.stability.maps import boundary, stability_map
from stickslip.stability.modes import growth_rate, unstable_modes
from stickslip.stability.parameters import (
    AGEING,
    DAMPING,
    DELAY,
    MASS,
    PARAMETERS,
    STD,
    STIFFNESS,
    VELOCITY,
    Crossing,
    Crossings,
    Parameter,
    Setting,
    critical,
    critical_damping,
    critical_delay,
    critical_mass,
    critical_spring,
    critical_std,
    critical_velocities,
)
from stickslip.stability.response import dynamic_stiffness

__all__ = [
    "AGEING",
    "DAMPING",
    "DELAY",
    "KNOBS",
    "MASS",
    "SPREAD",
    "STIFFNESS",
    "VELOCITY",
    "Crossing",
    "Crossings",
    "Impedance",
    "Knob",
    "Modes",
    "RadiationDamping",
    "Rig",
    "Setting",
    "SpringMassDamper",
    "boundary",
    "critical",
    "critical_damping",
    "critical_delay",
    "critical_mass",
    "critical_spread",
    "critical_spring",
    "critical_velocities",
    "dynamic_stiffness",
    "growth_rate",
    "stability_map",
    "unstable_modes",
]
