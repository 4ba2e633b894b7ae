"""Parameters of the figures of the paper."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from stickslip.model import Delay, Gaussian, Interface, Langevin, Rig, Slider, constant


@dataclass(frozen=True, kw_only=True)
class PaperCase:
    """Parameters of one figure of the paper."""

    interface: Interface
    slider: Slider
    velocity: float
    contacts: int

    @property
    def rig(self) -> Rig:
        """The slider on the interface, pulled at the velocity."""
        return Rig(self.interface, self.slider, constant(self.velocity))


CRITICAL_STIFFNESS, CRITICAL_STIFFNESS_NEVER = 2.989, 3.548
"""``K*/N`` of the interface of Figs. 4 to 7 by Eq. (8): contacts re-attach at once, or never."""
PERIOD = 1.487
"""Of stick-slip in Fig. 4, ``K = 2 k``, delay .2."""
V1, V1_FREQUENCY = 1.388221, 7.265139
"""Fig. 7a: where smooth sliding loses stability, and the angular frequency of its mode there."""


def _case(slider: Slider, contacts: int, **mechanisms: Any) -> PaperCase:
    thresholds, initial = Gaussian(mean=1.0, std=0.1), Gaussian(mean=0.0, std=0.01)
    interface = Interface(thresholds=thresholds, initial=initial, **mechanisms)
    return PaperCase(interface=interface, slider=slider, velocity=1.0, contacts=contacts)


def _slider(stiffness: float, ratio: float) -> Slider:
    """A slider whose damping is a ratio of its Omega."""
    return Slider(stiffness=stiffness, mass=1e-4, damping=ratio * math.sqrt(stiffness / 1e-4))


_DAMPED = Slider(stiffness=2.0, mass=1e-4, damping=200.0)

FIG1 = FIG2 = FIG3 = _case(_DAMPED, 1_000)
FIG4 = _case(_DAMPED, 10_000, delay=Delay(0.2))
FIG5 = _case(_DAMPED, 10_000, delay=Delay(math.inf))
FIG6 = _case(_slider(2.0, 0.3), 10_000, delay=Delay(0.2))
FIG7 = _case(_slider(2.0, 0.3), 10_000, delay=Delay(0.1))
FIG8 = FIG9 = FIG10 = _case(_slider(1.0, 0.1), 2_000, ageing=Langevin(rate=1.5))
FIG11 = _case(_slider(1.0, 0.1), 2_000, ageing=Langevin(rate=1.0))
