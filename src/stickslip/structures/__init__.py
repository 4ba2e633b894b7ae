"""Structures on an interface: the interface as an element of them."""

from stickslip.structures.element import Element as Element
from stickslip.structures.element import NextEvent as NextEvent
from stickslip.structures.element import Reaction as Reaction
from stickslip.structures.element import State as State
