"""Parameters of the figures of the paper."""

from __future__ import annotations

import math
from dataclasses import dataclass

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


def _relative(ratio: float, stiffness: float, mass: float) -> float:
    return ratio * math.sqrt(stiffness / mass)


CRITICAL_STIFFNESS, CRITICAL_STIFFNESS_NEVER = 2.989, 3.548
"""``K*/N`` of the interface of Figs. 4 to 7 by Eq. (8): contacts re-attach at once, or never."""
PERIOD = 1.487
"""Of stick-slip in Fig. 4, ``K = 2 k``, delay .2."""
V1, V1_FREQUENCY = 1.388221, 7.265139
"""Fig. 7a: where smooth sliding loses stability, and the angular frequency of its mode there."""

_NARROW = Gaussian(mean=0.0, std=0.01)
_TENTH = Gaussian(mean=1.0, std=0.1)

FIG1 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW),
    slider=Slider(stiffness=2.0, mass=1e-4, damping=200.0),
    velocity=1.0,
    contacts=1_000,
)
FIG2 = FIG1
FIG3 = FIG1
FIG4 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, delay=Delay(0.2)),
    slider=Slider(stiffness=2.0, mass=1e-4, damping=200.0),
    velocity=1.0,
    contacts=10_000,
)
FIG5 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, delay=Delay(math.inf)),
    slider=FIG4.slider,
    velocity=1.0,
    contacts=10_000,
)
FIG6 = PaperCase(
    interface=FIG4.interface,
    slider=Slider(stiffness=2.0, mass=1e-4, damping=_relative(0.3, 2.0, 1e-4)),
    velocity=1.0,
    contacts=10_000,
)
FIG7 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, delay=Delay(0.1)),
    slider=FIG6.slider,
    velocity=1.0,
    contacts=10_000,
)
FIG8 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, ageing=Langevin(rate=1.5)),
    slider=Slider(stiffness=1.0, mass=1e-4, damping=_relative(0.1, 1.0, 1e-4)),
    velocity=1.0,
    contacts=2_000,
)
FIG9 = FIG8
FIG10 = FIG8
FIG11 = PaperCase(
    interface=Interface(thresholds=_TENTH, initial=_NARROW, ageing=Langevin(rate=1.0)),
    slider=FIG8.slider,
    velocity=1.0,
    contacts=2_000,
)
