"""The engines: one solver each, all behind the protocol of `base`, each registered for its method."""

from stickslip.simulation.engines import blocks, contacts, langevin, panels, thermal_population
from stickslip.simulation.engines.base import (
    COLUMNS,
    ENGINES,
    MOTION,
    Advance,
    Beginning,
    Engine,
    Individuals,
    Leg,
    Stretchings,
    engine_of,
    slider_constants,
    solves,
)

__all__ = [
    "COLUMNS",
    "ENGINES",
    "MOTION",
    "Advance",
    "Beginning",
    "Engine",
    "Individuals",
    "Leg",
    "Stretchings",
    "blocks",
    "contacts",
    "engine_of",
    "langevin",
    "panels",
    "slider_constants",
    "solves",
    "thermal_population",
]
