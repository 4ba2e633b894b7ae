"""What there is: interface, slider and drive, the rig they make, and how it is to be simulated.

Records only, each validated on construction. Natural units throughout: contact stiffness ``k = 1``, mean threshold
force ``f_s = 1``, hence stretchings in units of ``x_s = f_s/k``; everything per contact. Time is in any unit.
"""

from stickslip.model.activation import Activation, Barrier, Bell, Parabolic
from stickslip.model.ageing import AgeingModel, ExponentialGrowth, FixedGrowth, Langevin, LogarithmicGrowth, is_own
from stickslip.model.body import Chain, ElasticBody, Sheet
from stickslip.model.delays import Delay, DelayModel, NegativeDelay, OnArrest, RandomDelay
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
from stickslip.model.drive import Drive, ForceAbove, ForceBelow, Piece, Travel, constant, ramp
from stickslip.model.interface import Interface
from stickslip.model.methods import (
    Contacts,
    FromRest,
    FromSliding,
    MasterEquation,
    Method,
    Output,
    PaperClosure,
    Population,
    Prestressed,
    QuasiStatic,
    Start,
)
from stickslip.model.operation import Operation
from stickslip.model.parameters import OF_BODIES, PARAMETERS, Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.model.slider import Slider
from stickslip.model.units import Scales

__all__ = [
    "OF_BODIES",
    "PARAMETERS",
    "Activation",
    "AgeingModel",
    "Barrier",
    "Bell",
    "Chain",
    "Contacts",
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
    "FromRest",
    "FromSliding",
    "Gamma",
    "Gaussian",
    "Interface",
    "Langevin",
    "LogNormal",
    "LogarithmicGrowth",
    "MasterEquation",
    "Method",
    "NegativeDelay",
    "OnArrest",
    "Operation",
    "Output",
    "PaperClosure",
    "Parabolic",
    "Parameter",
    "Piece",
    "Population",
    "Prestressed",
    "QuasiStatic",
    "RandomDelay",
    "Rig",
    "Scales",
    "Sheet",
    "Slider",
    "Start",
    "SteadyState",
    "Travel",
    "Uniform",
    "Weibull",
    "constant",
    "is_own",
    "parameter_named",
    "ramp",
]
