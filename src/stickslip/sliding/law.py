"""The friction law of an interface: force over velocity, its slope, and the velocities
of its minima and maxima.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, overload

import numpy as np
from scipy import optimize

from stickslip.errors import InputError, instance, numbers, shown
from stickslip.model import Interface
from stickslip.sliding.response import Array
from stickslip.sliding.steady import sliding_of

# velocities per decade at which the slope is computed; two turning points closer than
# that may be missed
# missed
_PER_DECADE = 16


def at_each(law: Callable[[Array], Array], speed: Array) -> float | Array:
    """Evaluate a function of the speed in the shape of `speed`: a number for one
    speed.
    """
    found = law(speed.ravel())
    return (
        float(found[0]) if speed.ndim == 0 else np.asarray(found.reshape(speed.shape))
    )


@overload
def kinetic_friction(interface: Interface, velocity: float = 0.0) -> float: ...
@overload
def kinetic_friction(interface: Interface, velocity: Array) -> Array: ...
def kinetic_friction(
    interface: Interface, velocity: float | Array = 0.0
) -> float | Array:
    """Return the mean friction force in smooth sliding,
    ``F_k = (k m2/2 + f_d v <tau>)/(m1 + v <tau>)``.

    This is the force of the steady state of Eqs. (1)-(4) with attached contacts counted
    by Eq. (10); ``m1, m2`` are the first two moments of the positive distribution of
    thresholds, ``f_d`` is the force of a detached contact. It is exact for any
    distribution of thresholds and of delays; friction falls with velocity if
    ``f_d < k m2/(2 m1)``. For newborn contacts stretched by ``x_0``,
    ``<x_s^2 - x_0^2>`` replaces ``m2`` and ``<x_s - x_0>`` replaces ``m1``.

    For thresholds that age by `Langevin` there is no closed form: the stationary
    kinetic equation of Eqs. (13)-(17) is solved, to 1e-4 or better. Without delay the
    force depends on ``v/rate**2`` alone. For thresholds that grow by a fixed rule
    (`ExponentialGrowth`, `LogarithmicGrowth`) the lifetimes of contacts are integrated
    over their strengths. With thermal activation they are integrated over the hazard of
    each contact, to 1e-7 or better; every contact keeps its threshold for its life. For
    contacts of different areas the integral is over these as well. (A rate averaged
    over the thresholds, one law for all contacts, is another model: at a standard
    deviation of .1 its force is 34 % too low.)

    Parameters
    ----------
    interface : Interface
        The contacts; with `Langevin` ageing their thresholds must be Gaussian.
    velocity : float or ndarray
        Speed of sliding, at least 0, in ``x_s`` per time; 0 is the limit of slow
        sliding, or no delay. It must be above 0 with ageing or thermal activation.

    Returns
    -------
    float or ndarray, shape of `velocity`
        Force per contact, in ``f_s``.

    Raises
    ------
    InputError
        If thresholds age by `Langevin` from a distribution that is not Gaussian, or
        slide at 0 velocity while they age; if the delay is infinite at zero velocity;
        or if, with `Langevin`, newborns without strength have a delay.
    """
    sliding = sliding_of(interface, "kinetic_friction: ")
    slowly = (
        interface.ageing is None
        and interface.activation is None
        and math.isfinite(interface.delay.moment(1))
    )
    hint = "in x_s per time" + (
        ""
        if slowly
        else "; with ageing, a temperature or an infinite delay there is no slow limit"
    )
    least, above = (0.0, None) if slowly else (None, 0.0)
    speed = numbers("velocity", velocity, at_least=least, above=above, hint=hint)
    return at_each(sliding.force, speed)


@overload
def friction_slope(interface: Interface, velocity: float) -> float: ...
@overload
def friction_slope(interface: Interface, velocity: Array) -> Array: ...
def friction_slope(interface: Interface, velocity: float | Array) -> float | Array:
    """Return the slope of the friction force in smooth sliding over the logarithm of
    the speed, ``dF_k/dln v``.

    Above 0 the interface strengthens with velocity, below 0 it weakens: it is ``a - b``
    of rate-and-state friction. Exact, from the same integrals as `kinetic_friction`,
    with the same units and errors; with ageing by `Langevin` by finite differences, to
    1e-3. The velocity must be above 0.

    Examples
    --------
    >>> thermal = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1),
    ...     activation=ss.Bell(width=0.01, attempts=1e6),
    ... )
    >>> print(f"{ss.stability.friction_slope(thermal, 1.0):.6f}")
    0.004938
    """
    slope = sliding_of(interface, "friction_slope: ").slope
    return at_each(
        slope, numbers("velocity", velocity, above=0, hint="in x_s per time")
    )


@dataclass(frozen=True, kw_only=True)
class TurningVelocity:
    """A speed at which the friction law has a minimum, from weakening with velocity to
    strengthening, or a maximum.
    """

    velocity: float  #: in ``x_s`` per time
    force: float  #: kinetic friction there, per contact, in ``f_s``
    kind: Literal["minimum", "maximum"]

    def __str__(self) -> str:
        return f"{self.kind} of {self.force:.4g} f_s at velocity {self.velocity:.4g}"


def turning_velocities(
    interface: Interface, *, between: tuple[float, float]
) -> tuple[TurningVelocity, ...]:
    """Find the speeds at which kinetic friction has a minimum or maximum, where
    `friction_slope` changes sign.

    Ageing and thermal activation together give a minimum, as slow contacts have time to
    age. Thermal activation and a delay give a maximum, as contacts are detached for
    most of fast sliding. The speeds are returned in increasing order; there are none if
    friction only rises or only falls in the range, two speeds above 0 in ``x_s`` per
    time. Errors are those of `kinetic_friction`.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1),
    ...     activation=ss.Bell(width=0.01, attempts=1e6),
    ...     delay=ss.Delay(0.01),
    ... )
    >>> print(*ss.stability.turning_velocities(interface, between=(0.01, 100)))
    maximum of 0.4517 f_s at velocity 0.9972
    """
    instance("turning_velocities: interface", interface, Interface, "an Interface")
    ends = numbers("between", between, above=0, hint="two speeds in x_s per time")
    if ends.shape != (2,) or ends[0] >= ends[1]:
        raise InputError(
            f"between = {shown(between)}: must be two speeds that rise, such as (0.01, "
            "100)"
        )
    low, high = np.log(ends).tolist()
    places = np.linspace(
        low,
        high,
        2 + math.ceil(_PER_DECADE * (high - low) / math.log(10.0)),
    )

    def slope(place: float) -> float:
        return friction_slope(interface, math.exp(place))

    slopes = friction_slope(interface, np.exp(places))
    found = []
    for k in np.flatnonzero(slopes[1:] * slopes[:-1] < 0).tolist():
        velocity = math.exp(
            optimize.brentq(slope, places[k], places[k + 1], xtol=1e-10)
        )
        force = kinetic_friction(interface, velocity)
        found.append(
            TurningVelocity(
                velocity=velocity,
                force=force,
                kind="minimum" if slopes[k] < 0 else "maximum",
            )
        )
    return tuple(found)
