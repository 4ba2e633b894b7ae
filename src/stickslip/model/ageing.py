"""How the thresholds of contacts grow with their age."""

from dataclasses import dataclass, replace
from typing import Annotated, Any, Self

from stickslip.errors import InputError
from stickslip.model.delays import DelayModel
from stickslip.model.distribution import Distribution
from stickslip.model.records import Number, Record, registry

Newborn = Annotated[float, Number(at_least=0)]

AGEING_MODELS, register = registry("ageing model")
"""The models of ageing that rig files can name; ``@register("langevin")`` gives a
class its name there.
"""


class AgeingModel(Record):
    """How thresholds grow with the age of a contact: `Langevin`, a rule of growth, or a
    model of the user's own.

    A model of one's own derives from this class, is registered under the name that rig
    files use, and has an engine (`stickslip.simulation.engines.base.solves`). Of smooth
    sliding it answers what it knows; the rest is refused.
    """

    def friction(
        self, thresholds: Distribution, delay: DelayModel, velocity: float
    ) -> float:
        """Return the force in steady sliding, per contact, of positive `thresholds`;
        `velocity` in ``x_s`` per time.
        """
        del thresholds, delay, velocity
        raise self._unknown(
            "the force in steady sliding", "friction(thresholds, delay, velocity)"
        )

    def response(self, thresholds: Distribution, delay: DelayModel) -> Any:
        """Return the linear response of steady sliding, a
        `stickslip.sliding.Response`.
        """
        del thresholds, delay
        raise self._unknown(
            "the stability of smooth sliding", "response(thresholds, delay)"
        )

    def _unknown(self, what: str, method: str) -> InputError:
        kind = type(self).__name__
        return InputError(
            f"Interface.ageing = {self}: {what} is not known; simulate, or give {kind} "
            f"a method {method}"
        )


@register("langevin")
@dataclass(frozen=True, kw_only=True)
class Langevin(AgeingModel):
    """Thresholds that age towards the interface's Gaussian as an Ornstein-Uhlenbeck
    process, Eqs. (13)-(16).

    ``df = beta^2 (f_0 - f) dt + beta delta f_0 sqrt(2) dW``, with ``f_0`` and ``delta``
    the mean and the relative standard deviation of ``Interface.thresholds``.

    Parameters
    ----------
    rate : float
        ``beta``, in 1/sqrt(time): thresholds reach their stationary distribution within
        a time ``beta**-2``.
    newborn : float
        Threshold force of a newborn contact, in units of ``f_s``.
    """

    rate: Annotated[float, Number("1/time^(1/2)", above=0, hint="beta")]
    newborn: Newborn = 0.0

    @property
    def time(self) -> float:
        """Time in which thresholds reach their stationary distribution,
        ``rate**-2``.
        """
        return self.rate**-2

    def with_time(self, value: float) -> Self:
        """Return the ageing with another time."""
        return replace(self, rate=value**-0.5)


@register("exponential")
@dataclass(frozen=True, kw_only=True)
class ExponentialGrowth(AgeingModel):
    """Thresholds that grow as ``f(t) = f_end - (f_end - newborn) exp(-rate t)``.

    ``f_end`` is drawn from the interface's distribution of thresholds at birth; `rate`
    is in 1/time, `newborn` in ``f_s``.
    """

    rate: Annotated[float, Number("1/time", above=0)]
    newborn: Newborn = 0.0

    @property
    def time(self) -> float:
        """Time ``1/rate`` in which what lacks to the full thresholds falls to 1/e."""
        return 1.0 / self.rate

    def with_time(self, value: float) -> Self:
        """Return the ageing with another time."""
        return replace(self, rate=1.0 / value)


@register("logarithmic")
@dataclass(frozen=True, kw_only=True)
class LogarithmicGrowth(AgeingModel):
    """Thresholds that grow as ``f(t) = f_0 + slope ln(1 + t/time)``, the ageing of
    creeping asperities.

    ``f_0`` is drawn from the interface's distribution of thresholds at birth; `slope`
    is in ``f_s``, `time` in time.
    """

    slope: Annotated[float, Number(at_least=0)]
    time: Annotated[float, Number("time", above=0)]


FixedGrowth = ExponentialGrowth | LogarithmicGrowth
"""Thresholds that are known from the birth of a contact on."""
