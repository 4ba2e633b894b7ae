"""Friction of interfaces made of many contacts: stick-slip or smooth sliding, and what decides between them.

The public names load what they need on first use.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

# `simulate` shares its name with its module. Imported first, the function keeps the name for good.
from stickslip.simulation import Contacts, FromRest, FromSliding, MasterEquation, Output, PaperClosure, rerun, simulate

if TYPE_CHECKING:
    from stickslip.cycles import (
        bistable_band,
        cycle_branch,
        lasting,
        lasting_delay,
        lasting_velocities,
        lasts,
    )
    from stickslip.errors import InputError, UndecidedError
    from stickslip.io.datasets import load, save
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
    from stickslip.model.distributions import (
        Empirical,
        Exponential,
        Gamma,
        Gaussian,
        LogNormal,
        SteadyState,
        Uniform,
        Weibull,
    )
    from stickslip.model.drive import Drive, ForceAbove, ForceBelow, Travel, constant, ramp
    from stickslip.model.units import Scales
    from stickslip.rigid import (
        Renewal,
        critical_stiffness,
        effective_stiffness,
        rigid_slide,
        static_friction,
    )
    from stickslip.stability import (
        boundary,
        critical,
        critical_damping,
        critical_delay,
        critical_mass,
        critical_spring,
        critical_std,
        critical_velocities,
        dynamic_stiffness,
        growth_rate,
        stability_map,
        unstable_modes,
    )
    from stickslip.theory import (
        closure_friction,
        effective_potential,
        kinetic_friction,
    )

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
    "drive": ("Drive", "ForceAbove", "ForceBelow", "Travel", "constant", "ramp"),
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
        "rigid_slide",
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
    "FromRest",
    "FromSliding",
    "Gamma",
    "Gaussian",
    "InputError",
    "Interface",
    "Langevin",
    "LogNormal",
    "LogarithmicGrowth",
    "MasterEquation",
    "Output",
    "PaperClosure",
    "RandomDelay",
    "Renewal",
    "Scales",
    "Slider",
    "SteadyState",
    "Travel",
    "UndecidedError",
    "Uniform",
    "Weibull",
    "bistable_band",
    "boundary",
    "closure_friction",
    "constant",
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
    "kinetic_friction",
    "lasting",
    "lasting_delay",
    "lasting_velocities",
    "lasts",
    "load",
    "ramp",
    "read_trace",
    "regime",
    "rerun",
    "rigid_slide",
    "save",
    "simulate",
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
