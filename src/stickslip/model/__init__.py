"""What there is: interface, slider and drive, the rig they make, and how it is to be simulated.

Records only, each validated on construction. Natural units throughout: contact stiffness ``k = 1``, mean threshold
force ``f_s = 1``, hence stretchings in units of ``x_s = f_s/k``; everything per contact. Time is in any unit.
"""

from stickslip.model.activation import Barrier as Barrier
from stickslip.model.activation import Bell as Bell
from stickslip.model.activation import Parabolic as Parabolic
from stickslip.model.ageing import AgeingModel as AgeingModel
from stickslip.model.ageing import ExponentialGrowth as ExponentialGrowth
from stickslip.model.ageing import FixedGrowth as FixedGrowth
from stickslip.model.ageing import Langevin as Langevin
from stickslip.model.ageing import LogarithmicGrowth as LogarithmicGrowth
from stickslip.model.body import Chain as Chain
from stickslip.model.body import ElasticBody as ElasticBody
from stickslip.model.body import Sheet as Sheet
from stickslip.model.body import Slider as Slider
from stickslip.model.delays import Delay as Delay
from stickslip.model.delays import DelayModel as DelayModel
from stickslip.model.delays import NegativeDelay as NegativeDelay
from stickslip.model.delays import OnArrest as OnArrest
from stickslip.model.delays import RandomDelay as RandomDelay
from stickslip.model.distributions import Distribution as Distribution
from stickslip.model.distributions import Empirical as Empirical
from stickslip.model.distributions import Exponential as Exponential
from stickslip.model.distributions import Gamma as Gamma
from stickslip.model.distributions import Gaussian as Gaussian
from stickslip.model.distributions import LogNormal as LogNormal
from stickslip.model.distributions import SteadyState as SteadyState
from stickslip.model.distributions import Uniform as Uniform
from stickslip.model.distributions import Weibull as Weibull
from stickslip.model.drive import Drive as Drive
from stickslip.model.drive import ForceAbove as ForceAbove
from stickslip.model.drive import ForceBelow as ForceBelow
from stickslip.model.drive import Piece as Piece
from stickslip.model.drive import Travel as Travel
from stickslip.model.drive import constant as constant
from stickslip.model.drive import ramp as ramp
from stickslip.model.interface import Interface as Interface
from stickslip.model.methods import Contacts as Contacts
from stickslip.model.methods import FromRest as FromRest
from stickslip.model.methods import FromSliding as FromSliding
from stickslip.model.methods import MasterEquation as MasterEquation
from stickslip.model.methods import Method as Method
from stickslip.model.methods import Output as Output
from stickslip.model.methods import Population as Population
from stickslip.model.methods import Prestressed as Prestressed
from stickslip.model.methods import QuasiStatic as QuasiStatic
from stickslip.model.methods import Renewal as Renewal
from stickslip.model.methods import Start as Start
from stickslip.model.parameters import Parameter as Parameter
from stickslip.model.rig import Operation as Operation
from stickslip.model.rig import Rig as Rig
from stickslip.model.units import Scales as Scales
