"""Structures on an interface: simulation of structures, the interface as an element of
other simulators, and its export to other programs.
"""

from stickslip.structures.element import Element as Element
from stickslip.structures.element import NextEvent as NextEvent
from stickslip.structures.element import Reaction as Reaction
from stickslip.structures.element import State as State
from stickslip.structures.exports import export as export
from stickslip.structures.statespace import StateSpace as StateSpace
from stickslip.structures.statespace import state_space as state_space
