"""The interface: what its contacts are like.

Natural units throughout: contact stiffness ``k = 1``, mean threshold force ``f_s = 1``, hence stretchings in units of
``x_s = f_s/k``; everything per contact. Time is in any unit the user likes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from stickslip.errors import InputError, instance
from stickslip.model.ageing import Strengthening
from stickslip.model.delays import Delay, DelayModel
from stickslip.model.distributions import Distribution, Gaussian


@dataclass(frozen=True, kw_only=True)
class Interface:
    """An interface made of many contacts.

    Parameters
    ----------
    thresholds : Distribution
        Distribution of the stretchings at which contacts break, ``P_c``; conditioned on positive values by the solvers.
    initial : Distribution
        Distribution of the stretchings at the start, ``Q(x; X=0)``; a contact that starts at ``x_0`` has a threshold
        beyond ``|x_0|``. `SteadyState` starts from the distribution of smooth sliding.
    delay : DelayModel
        How long a broken contact stays detached.
    ageing : Strengthening, optional
        How thresholds grow with the age of a contact; by default they do not.
    """

    thresholds: Distribution
    initial: Distribution = Gaussian(mean=0.0, std=0.01)
    delay: DelayModel = Delay(0.0)
    ageing: Strengthening | None = None

    def __post_init__(self) -> None:
        instance(
            "Interface.thresholds", self.thresholds, Distribution, "a distribution, such as Gaussian(mean=1.0, std=0.1)"
        )
        instance(
            "Interface.initial", self.initial, Distribution, "a distribution, such as Gaussian(mean=0.0, std=0.01)"
        )
        instance("Interface.delay", self.delay, DelayModel, "a delay, such as Delay(0.2)")
        instance(
            "Interface.ageing",
            self.ageing,
            Strengthening | None,
            "an ageing model, such as Langevin(rate=1.5), or None",
        )
        lost = self.initial_loss
        if lost > 1e-3:
            raise InputError(
                f"Interface.initial = {self.initial}: {100 * lost:.3g} % of the contacts would start beyond the "
                f"largest threshold ({self.threshold_distribution.support[1]:g}); narrow it or bring it nearer to 0",
                "Interface.initial",
            )

    @cached_property
    def threshold_distribution(self) -> Distribution:
        """The distribution of thresholds conditioned on positive values, as every solver uses it."""
        return self.thresholds.positive()

    @property
    def initial_loss(self) -> float:
        """Fraction of the initial distribution that lies beyond the largest threshold on either side."""
        high = self.threshold_distribution.support[1]
        beyond = self.initial.survival([high, -high])
        return float(beyond[0] + 1.0 - beyond[1])
