"""The engines: solvers behind the protocol of `base`, each registered for its
method.
"""

from stickslip.simulation.engines import blocks, contacts, langevin, panels
from stickslip.simulation.engines.base import (
    Advance,
    Beginning,
    Engine,
    Individuals,
    Leg,
    Stretchings,
)
from stickslip.simulation.engines.base import engine_of as engine_of
from stickslip.simulation.engines.base import solves as solves

__all__ = [
    "Advance",
    "Beginning",
    "Engine",
    "Individuals",
    "Leg",
    "Stretchings",
    "engine_of",
    "solves",
]
__all__ += ["blocks", "contacts", "langevin", "panels"]
