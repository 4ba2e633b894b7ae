"""Records of the model: interface, slider and drive, the rig that they form, and the
methods that simulate it.

Each record is validated on construction. Natural units throughout: contact stiffness
``k = 1``, mean threshold force ``f_s = 1``, hence stretchings in units of
``x_s = f_s/k``; everything per contact. Time is in any unit.
"""

from stickslip.model.activation import Barrier, Bell, Parabolic
from stickslip.model.ageing import (
    AgeingModel,
    ExponentialGrowth,
    FixedGrowth,
    Langevin,
    LogarithmicGrowth,
    TabulatedGrowth,
)
from stickslip.model.body import Chain, ElasticBody, Mass, Sheet, Slider
from stickslip.model.delays import (
    Delay,
    DelayModel,
    NegativeDelay,
    OnArrest,
    RandomDelay,
)
from stickslip.model.distributions import (
    Distribution,
    Empirical,
    Exponential,
    Gamma,
    Gaussian,
    LogNormal,
    SteadyState,
    Uniform,
    Weibull,
)
from stickslip.model.drive import (
    Drive,
    ForceAbove,
    ForceBelow,
    ForcePiece,
    LoadPoint,
    Piece,
    Travel,
    constant,
    pull,
    ramp,
)
from stickslip.model.interface import Areas, Interface
from stickslip.model.methods import (
    Contacts,
    FromRest,
    FromSliding,
    MasterEquation,
    Method,
    Output,
    Population,
    Prestressed,
    QuasiStatic,
    Renewal,
    Start,
)
from stickslip.model.parameters import Parameter
from stickslip.model.quantities import read_value
from stickslip.model.rig import Assumption, Operation, Rig
from stickslip.model.structure import (
    ControlledAxis,
    Matrices,
    Modes,
    StateSpace,
    Structure,
)
from stickslip.model.units import Scales

__all__ = [
    "AgeingModel",
    "Areas",
    "Assumption",
    "Barrier",
    "Bell",
    "Chain",
    "Contacts",
    "ControlledAxis",
    "Delay",
    "DelayModel",
    "Distribution",
    "Drive",
    "ElasticBody",
    "Empirical",
    "Exponential",
    "ExponentialGrowth",
    "FixedGrowth",
    "ForceAbove",
    "ForceBelow",
    "ForcePiece",
    "FromRest",
    "FromSliding",
    "Gamma",
    "Gaussian",
    "Interface",
    "Langevin",
    "LoadPoint",
    "LogNormal",
    "LogarithmicGrowth",
    "Mass",
    "MasterEquation",
    "Matrices",
    "Method",
    "Modes",
    "NegativeDelay",
    "OnArrest",
    "Operation",
    "Output",
    "Parabolic",
    "Parameter",
    "Piece",
    "Population",
    "Prestressed",
    "QuasiStatic",
    "RandomDelay",
    "Renewal",
    "Rig",
    "Scales",
    "Sheet",
    "Slider",
    "Start",
    "StateSpace",
    "SteadyState",
    "Structure",
    "TabulatedGrowth",
    "Travel",
    "Uniform",
    "Weibull",
    "constant",
    "pull",
    "ramp",
    "read_value",
]
