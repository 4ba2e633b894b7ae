"""The one door to steady sliding: which kind of contacts has which force, slope and linear response."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stickslip.errors import instance
from stickslip.model import AgeingModel, FixedGrowth, Interface, Langevin
from stickslip.model.quadrature import hashable
from stickslip.sliding.activated import ByLives, OfAreas
from stickslip.sliding.langevin import ByKineticEquation
from stickslip.sliding.response import Array, Response, Sliding
from stickslip.sliding.unaged import ClosedForm


def sliding_of(interface: Interface) -> Sliding:
    """Return what is known of steady sliding of an interface, in natural units per contact.

    Raises
    ------
    InputError
        If steady sliding is not known for such contacts.
    """
    instance("interface", interface, Interface, "an Interface")
    if interface.areas is not None:
        return OfAreas(interface=interface)
    match interface.ageing:
        case None:
            return ClosedForm(interface=interface) if interface.temperature is None else ByLives(interface=interface)
        case Langevin():
            return ByKineticEquation(interface=interface)
        case ageing if isinstance(ageing, FixedGrowth):
            return ByLives(interface=interface)
        case ageing:
            return ByItsOwnRule(interface=interface, ageing=ageing)


@dataclass(frozen=True, kw_only=True)
class ByItsOwnRule(Sliding):
    """Steady sliding of contacts that age by a model of the user's own, as that model says."""

    ageing: AgeingModel

    def __post_init__(self) -> None:
        self.interface.allow((), "smooth sliding of thresholds that age by a rule of your own")

    def force(self, velocity: Array) -> Array:
        """Force per contact."""
        thresholds, delay = self.interface.threshold_distribution, self.interface.delay
        return np.array([self.ageing.friction(thresholds, delay, v) for v in velocity.tolist()])

    def response(self) -> Response:
        """Return the linear response."""
        own: Response = self.ageing.response(self.interface.threshold_distribution, self.interface.delay)
        return own


def respond(interface: Interface) -> Response:
    """Return the linear response of an interface, one and the same for equal interfaces."""
    instance("interface", interface, Interface, "an Interface")
    return _response(hashable(interface))


@lru_cache(maxsize=256)
def _response(interface: Interface) -> Response:
    return sliding_of(interface).response()
