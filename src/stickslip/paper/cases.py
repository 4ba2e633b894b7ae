"""Parameters of the figures of the paper."""

import math
from dataclasses import dataclass, replace
from typing import Any

from stickslip.model import (
    Delay,
    Gaussian,
    Interface,
    Langevin,
    Rig,
    Slider,
    SteadyState,
    constant,
)


@dataclass(frozen=True)
class PaperCase:
    """Parameters of one figure of the paper."""

    interface: Interface
    slider: Slider
    contacts: int
    velocity: float = 1.0

    @property
    def rig(self) -> Rig:
        """The slider on the interface, pulled at the velocity."""
        return Rig(self.interface, self.slider, constant(self.velocity))


CRITICAL_STIFFNESS, CRITICAL_STIFFNESS_NEVER = 2.989, 3.548
"""``K*/N`` of the interface of Figs. 4 to 7 by Eq. (8), if contacts re-attach at once
and if they never do.
"""
PERIOD = 1.487  # period of stick-slip in Fig. 4, K = 2 k, delay .2
V1, V1_FREQUENCY = 1.388221, 7.265139
"""Fig. 7a: velocity at which smooth sliding loses stability, and the angular frequency
of its neutral mode.
"""


def interface(
    initial: float | None = 0.01, threshold: float = 0.1, **mechanisms: Any
) -> Interface:
    """Return the interface with these standard deviations of initial forces (None: the
    steady state of sliding) and of thresholds.
    """
    thresholds = Gaussian(mean=1.0, std=threshold)
    start = (
        SteadyState(thresholds=thresholds)
        if initial is None
        else Gaussian(mean=0.0, std=initial)
    )
    return Interface(thresholds=thresholds, initial=start, **mechanisms)


def slider(stiffness: float, ratio: float, mass: float = 1e-4) -> Slider:
    """Return a slider whose damping `eta` is `ratio` times its Omega."""
    return Slider(
        stiffness=stiffness, mass=mass, damping=ratio * math.sqrt(stiffness / mass)
    )


_DAMPED = Slider(stiffness=2.0, mass=1e-4, damping=200.0)

FIG1 = FIG2 = FIG3 = PaperCase(interface(), _DAMPED, 1_000)
FIG4 = PaperCase(interface(delay=Delay(0.2)), _DAMPED, 10_000)
FIG5 = PaperCase(interface(delay=Delay(math.inf)), _DAMPED, 10_000)
FIG6 = PaperCase(interface(delay=Delay(0.2)), slider(2.0, 0.3), 10_000)
FIG7 = PaperCase(interface(delay=Delay(0.1)), slider(2.0, 0.3), 10_000)
FIG8 = FIG9 = FIG10 = PaperCase(
    interface(ageing=Langevin(rate=1.5)), slider(1.0, 0.1), 2_000
)
FIG11 = PaperCase(interface(ageing=Langevin(rate=1.0)), slider(1.0, 0.1), 2_000)

CASES = {
    f"fig{number}": case
    for number, case in enumerate(
        (FIG1, FIG2, FIG3, FIG4, FIG5, FIG6, FIG7, FIG8, FIG9, FIG10, FIG11), 1
    )
}
"""The cases by the names of their figures."""


def aged(case: PaperCase, rate: float) -> Rig:
    """Return the rig of a figure with another rate of ageing."""
    return case.rig.replace(
        interface=replace(case.interface, ageing=Langevin(rate=rate))
    )
