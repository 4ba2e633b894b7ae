"""Linear stability of smooth sliding: growth rates, critical values, maps, and the
noise of N contacts, computed without runs.

A slider that moves at a steady speed is perturbed by a small ``exp(s t)``. The rig
responds with its impedance ``Z(s)``, the interface with its dynamic stiffness
``kappa(s)`` (`dynamic_stiffness`), and smooth sliding is unstable if
``Z(s) + kappa(s) = 0`` has a root with ``Re s > 0``. Everything here is linear: it
finds where smooth sliding is unstable to the smallest perturbation. Stick-slip that has
started may persist where smooth sliding is stable; only a simulation shows that.

Natural units per contact. A rig is a `Slider` or any mechanical impedance
(`Impedance`).
"""

from stickslip.model.parameters import (
    AGEING,
    DAMPING,
    DELAY,
    MASS,
    PARAMETERS,
    STD,
    STIFFNESS,
    VELOCITY,
    Parameter,
)
from stickslip.model.structure import Modes
from stickslip.sliding import TurningVelocity, friction_slope, turning_velocities
from stickslip.stability.critical import (
    Crossing,
    Crossings,
    critical,
    critical_spring,
    onset,
)
from stickslip.stability.impedances import Impedance, RadiationDamping
from stickslip.stability.maps import boundary, stability_map
from stickslip.stability.modes import count_unstable, dynamic_stiffness, growth_rate
from stickslip.stability.noise import ContactNoise, contact_noise

__all__ = [
    "AGEING",
    "DAMPING",
    "DELAY",
    "MASS",
    "PARAMETERS",
    "STD",
    "STIFFNESS",
    "VELOCITY",
    "ContactNoise",
    "Crossing",
    "Crossings",
    "Impedance",
    "Modes",
    "Parameter",
    "RadiationDamping",
    "TurningVelocity",
    "boundary",
    "contact_noise",
    "count_unstable",
    "critical",
    "critical_spring",
    "dynamic_stiffness",
    "friction_slope",
    "growth_rate",
    "onset",
    "stability_map",
    "turning_velocities",
]
