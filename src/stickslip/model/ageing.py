"""How the thresholds of contacts grow with their age."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Annotated, Any, Self

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import InputError, shown
from stickslip.model.delays import DelayModel
from stickslip.model.distribution import Distribution
from stickslip.model.records import Number, Record, registry

Newborn = Annotated[float, Number(at_least=0)]

AGEING_MODELS, register = registry("ageing model")
"""The models of ageing that rig files can name; ``@register("langevin")`` gives a
class its name there.
"""


class AgeingModel(Record):
    """Growth of thresholds with the age of a contact: `Langevin`, a given growth law,
    or a model of the user's own.

    A user's model derives from this class, is registered under the name that rig files
    use, and has an engine (`stickslip.simulation.engines.base.solves`). It returns the
    force and the linear response of smooth sliding as far as they are known.
    """

    def friction(
        self,
        thresholds: Distribution,
        delay: DelayModel,
        velocity: float,
    ) -> float:
        """Return the force per contact in steady sliding at `velocity`, in ``x_s`` per
        time, for positive `thresholds`.
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

    def _unknown(self, quantity: str, method: str) -> InputError:
        kind = type(self).__name__
        return InputError(
            f"Interface.ageing = {self}: {quantity} is not known; simulate, or give "
            f"{kind} a method {method}"
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
        """Return the ageing with another ageing time."""
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
        """Time ``1/rate`` in which the missing strength falls to 1/e."""
        return 1.0 / self.rate

    def with_time(self, value: float) -> Self:
        """Return the ageing with another ageing time."""
        return replace(self, rate=1.0 / value)


@register("logarithmic")
@dataclass(frozen=True, kw_only=True)
class LogarithmicGrowth(AgeingModel):
    """Thresholds that grow as ``f(t) = f_0 + slope ln(1 + t/time)``: the ageing of
    creeping asperities.

    ``f_0`` is drawn from the interface's distribution of thresholds at birth; `slope`
    is in ``f_s``, `time` in time.
    """

    slope: Annotated[float, Number(at_least=0)]
    time: Annotated[float, Number("time", above=0)]


@register("tabulated")
@dataclass(frozen=True)
class TabulatedGrowth(AgeingModel):
    """Thresholds that grow as ``f(t) = s g(t)`` with a tabulated ``g``, such as the
    growth that explains a measured friction curve (`friction_curve`).

    ``s`` is drawn from the interface's distribution of thresholds at birth. Between two
    ages ``ln g`` is a cubic in ``ln t`` that preserves monotony (Fritsch and Carlson,
    SIAM J. Numer. Anal. 17, 238, 1980); ``g`` is constant before the first age and
    after the last. Newborn contacts must be unstretched (`Interface.newborn`).

    Parameters
    ----------
    ages : tuple of float
        At least two increasing ages, above 0, in time.
    strengths : tuple of float
        ``g`` at these ages, above 0. It grows less steeply than the age, so that a
        contact in steady sliding meets its threshold once.

    Raises
    ------
    InputError
        If the ages do not increase, their number is not that of the strengths, or the
        strengths grow as steeply as the ages.

    Examples
    --------
    >>> growth = ss.model.TabulatedGrowth(ages=(0.1, 1, 10), strengths=(0.6, 0.9, 1))
    >>> interface = ss.Interface(thresholds=ss.Gaussian(1.0, 0.1), ageing=growth)
    >>> print(f"{ss.kinetic_friction(interface, velocity=1.0):.4f}")
    0.4512
    """

    ages: Annotated[tuple[float, ...], Number("time", above=0)]
    strengths: Annotated[tuple[float, ...], Number(above=0)]

    def __post_init__(self) -> None:
        super().__post_init__()
        given = f"TabulatedGrowth.ages = {shown(self.ages)}"
        if len(self.ages) < 2 or np.any(np.diff(self.ages) <= 0.0):
            raise InputError(f"{given}: must be two ages or more that rise")
        if len(self.strengths) != len(self.ages):
            raise InputError(
                f"{given}: are {len(self.ages)}, but there are {len(self.strengths)} "
                "strengths; give one for each age"
            )
        log_age = np.log(self.ages)
        slope = _slope(self.ages, self.strengths)
        turns = slope.derivative().roots(extrapolate=False)
        places = np.append(log_age, turns[np.isfinite(turns)])
        steep = np.sort(places[slope(places) >= 1.0])
        if steep.size:
            at = max(int(np.searchsorted(log_age, steep[0])) - 1, 0)
            raise InputError(
                f"TabulatedGrowth.strengths = {shown(self.strengths)}: rise as steeply "
                f"as the ages between {self.ages[at]:g} and {self.ages[at + 1]:g}, so "
                "that a contact would meet its threshold more than once; give smaller "
                "steps"
            )

    @cached_property
    def table(self) -> Array:
        """Logarithms of ages and strengths, slopes of the latter, and the lowest
        strength at any later age, shape (4, n): `stickslip.kernels.hazard.Growth`.
        """
        x, y = np.log([self.ages, self.strengths])
        slope = _slope(self.ages, self.strengths)(x)
        lowest = np.minimum.accumulate(y[::-1])[::-1]
        return np.stack([x, y, slope, np.append(lowest[1:], lowest[-1])])


@lru_cache(maxsize=128)
def _slope(ages: tuple[float, ...], strengths: tuple[float, ...]) -> Any:
    """Slope of the logarithm of a strength against that of the age, a piecewise
    polynomial.
    """
    from scipy.interpolate import PchipInterpolator  # takes half a second to import

    return PchipInterpolator(*np.log([ages, strengths])).derivative()


FixedGrowth = ExponentialGrowth | LogarithmicGrowth | TabulatedGrowth
"""Ageing in which the whole future threshold of a contact is fixed at its birth."""
