"""How the thresholds of contacts grow with their age."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from stickslip.model.records import Number, check
from stickslip.model.registry import registrar

AGEING_MODELS: dict[str, type] = {}
"""The models of ageing that rig files can name."""

register = registrar(AGEING_MODELS, "ageing model")
"""Class decorator: ``@register("langevin")`` gives an ageing model the name that rig files use."""


@register("langevin")
@dataclass(frozen=True, kw_only=True)
class Langevin:
    """Thresholds that age towards the interface's Gaussian as an Ornstein-Uhlenbeck process, Eqs. (13)-(16).

    ``df = beta^2 (f_0 - f) dt + beta delta f_0 sqrt(2) dW``, with ``f_0`` and ``delta`` the mean and the relative
    standard deviation of ``Interface.thresholds``.

    Parameters
    ----------
    rate : float
        ``beta``, in 1/sqrt(time): thresholds reach their stationary distribution within a time ``beta**-2``.
    newborn : float
        Threshold force of a newborn contact, in units of ``f_s``.
    """

    rate: Annotated[float, Number("1/time^(1/2)", above=0, hint="beta")]
    newborn: Annotated[float, Number(at_least=0)] = 0.0

    def __post_init__(self) -> None:
        check(self)

    @property
    def time(self) -> float:
        """Time in which thresholds reach their stationary distribution, ``rate**-2``."""
        return self.rate**-2

    def with_time(self, value: float) -> Langevin:
        """Return the ageing with another time."""
        return replace(self, rate=value**-0.5)


@register("exponential")
@dataclass(frozen=True, kw_only=True)
class ExponentialGrowth:
    """Thresholds that grow as ``f(t) = f_end - (f_end - newborn) exp(-rate t)``.

    ``f_end`` is drawn from the interface's distribution of thresholds at birth; `rate` is in 1/time, `newborn` in
    ``f_s``.
    """

    rate: Annotated[float, Number("1/time", above=0)]
    newborn: Annotated[float, Number(at_least=0)] = 0.0

    def __post_init__(self) -> None:
        check(self)


@register("logarithmic")
@dataclass(frozen=True, kw_only=True)
class LogarithmicGrowth:
    """Thresholds that grow as ``f(t) = f_0 + slope ln(1 + t/time)``, the ageing of creeping asperities.

    ``f_0`` is drawn from the interface's distribution of thresholds at birth; `slope` is in ``f_s``, `time` in time.
    """

    slope: Annotated[float, Number(at_least=0)]
    time: Annotated[float, Number("time", above=0)]

    def __post_init__(self) -> None:
        check(self)


Strengthening = Langevin | ExponentialGrowth | LogarithmicGrowth
