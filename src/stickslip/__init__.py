"""Friction of interfaces made of many contacts: stick-slip or smooth sliding, and what decides between them.

The public names load what they need on first use.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

# `simulate` shares its name with its module. Imported first, the function keeps the name for good.
from stickslip.simulate import Contacts, MasterEquation, PaperClosure, Record, Relaxed, Sliding, repeat, simulate

if TYPE_CHECKING:
    from stickslip.cycles import (
        bistable_band,
        cycle_branch,
        lasting,
        lasting_delay,
        lasting_velocities,
        lasts,
    )
    from stickslip.drive import Drive, ForceAbove, ForceBelow, Travel, hold, ramp
    from stickslip.errors import InputError, UndecidedError
    from stickslip.measure import (
        drops,
        read_trace,
        regime,
        transitions,
    )
    from stickslip.model import (
        Delay,
        ExponentialGrowth,
        Interface,
        Langevin,
        LogarithmicGrowth,
        RandomDelay,
        Slider,
    )
    from stickslip.rigid import (
        Renewal,
        critical_stiffness,
        effective_stiffness,
        slide,
        static_friction,
    )
    from stickslip.stability import (
        boundary,
        critical,
        critical_damping,
        critical_delay,
        critical_mass,
        critical_spread,
        critical_spring,
        critical_velocities,
        dynamic_stiffness,
        growth_rate,
        stability_map,
        unstable_modes,
    )
    from stickslip.store import load, save
    from stickslip.theory import (
        closure_friction,
        effective_potential,
        kinetic_friction,
    )
    from stickslip.thresholds import (
        Empirical,
        Exponential,
        Gamma,
        Gaussian,
        LogNormal,
        SteadyState,
        Uniform,
        Weibull,
    )
    from stickslip.units import Scales

__version__ = version("stickslip")

_HOMES = {
    "cycles": (
        "bistable_band",
        "cycle_branch",
        "lasting",
        "lasting_delay",
        "lasting_velocities",
        "lasts",
    ),
    "drive": ("Drive", "ForceAbove", "ForceBelow", "Travel", "hold", "ramp"),
    "errors": ("InputError", "UndecidedError"),
    "measure": (
        "drops",
        "read_trace",
        "regime",
        "transitions",
    ),
    "model": ("Delay", "ExponentialGrowth", "Interface", "Langevin", "LogarithmicGrowth", "RandomDelay", "Slider"),
    "rigid": (
        "Renewal",
        "critical_stiffness",
        "effective_stiffness",
        "slide",
        "static_friction",
    ),
    "stability": (
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
    ),
    "store": ("load", "save"),
    "theory": (
        "closure_friction",
        "effective_potential",
        "kinetic_friction",
    ),
    "thresholds": (
        "Empirical",
        "Exponential",
        "Gamma",
        "Gaussian",
        "LogNormal",
        "SteadyState",
        "Uniform",
        "Weibull",
    ),
    "units": ("Scales",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Contacts",
    "Delay",
    "Drive",
    "Empirical",
    "Exponential",
    "ExponentialGrowth",
    "ForceAbove",
    "ForceBelow",
    "Gamma",
    "Gaussian",
    "InputError",
    "Interface",
    "Langevin",
    "LogNormal",
    "LogarithmicGrowth",
    "MasterEquation",
    "PaperClosure",
    "RandomDelay",
    "Record",
    "Relaxed",
    "Renewal",
    "Scales",
    "Slider",
    "Sliding",
    "SteadyState",
    "Travel",
    "UndecidedError",
    "Uniform",
    "Weibull",
    "bistable_band",
    "boundary",
    "closure_friction",
    "critical",
    "critical_damping",
    "critical_delay",
    "critical_mass",
    "critical_spread",
    "critical_spring",
    "critical_stiffness",
    "critical_velocities",
    "cycle_branch",
    "drops",
    "dynamic_stiffness",
    "effective_potential",
    "effective_stiffness",
    "growth_rate",
    "hold",
    "kinetic_friction",
    "lasting",
    "lasting_delay",
    "lasting_velocities",
    "lasts",
    "load",
    "ramp",
    "read_trace",
    "regime",
    "repeat",
    "save",
    "simulate",
    "slide",
    "stability_map",
    "static_friction",
    "sweep",
    "transitions",
    "unstable_modes",
]


def __getattr__(name: str) -> object:
    if name == "sweep":  # a room that is its own public function
        return import_module("stickslip.sweep")
    if name not in _HOME_OF:
        raise AttributeError(f"module 'stickslip' has no attribute {name!r}")
    value = getattr(import_module(f"stickslip.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
