"""The friction law of an interface, force over speed: its slope, and the speeds at which it turns."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, overload

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from stickslip.errors import InputError, instance, number, numbers, sequence, shown
from stickslip.lives import has_lives, mean_lives
from stickslip.model import Delay, Interface
from stickslip.theory import attached_fraction, kinetic_friction

Array = NDArray[np.float64]

_PER_DECADE = 16
"""Speeds at which the slope is looked at; two turning points nearer than that may be missed."""


@overload
def friction_slope(interface: Interface, velocity: float) -> float: ...
@overload
def friction_slope(interface: Interface, velocity: Array) -> Array: ...
def friction_slope(interface: Interface, velocity: float | Array) -> float | Array:
    """Return how steeply the friction force in smooth sliding changes with the speed, ``dF_k/dln v``.

    Above 0 the interface strengthens with velocity, below 0 it weakens: ``a - b`` of rate and state. Exact, from the
    same integrals as `kinetic_friction`; with ageing by `Langevin` by differences of it, to 1e-3.

    Parameters
    ----------
    interface : Interface
    velocity : float or ndarray
        Speed of sliding, above 0, in ``x_s`` per time.

    Returns
    -------
    float or ndarray, shape of `velocity`
        Per contact, in ``f_s``.

    Raises
    ------
    InputError
        As `kinetic_friction`.

    Examples
    --------
    >>> import stickslip as ss
    >>> thermal = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), temperature=ss.Bell(width=0.01, attempts=1e6))
    >>> print(f"{ss.friction_slope(thermal, 1.0):.6f}")
    0.004938
    """
    instance("friction_slope: interface", interface, Interface, "an Interface")
    speed = numbers("velocity", velocity, above=0, hint="in x_s per time")
    if has_lives(interface) or interface.areas is not None:
        one = "areas" if interface.areas is not None else "sliding_force"
        interface.allow(("temperature", one), "friction_slope")
        slope = np.array([mean_lives(interface, v)[1] for v in speed.ravel().tolist()]).reshape(speed.shape)
    elif interface.ageing is None:
        attached = attached_fraction(interface, speed)
        attached_force = kinetic_friction(replace(interface, delay=Delay(0.0)), 0.0)
        slope = -(attached_force - interface.sliding_force) * attached * (1.0 - attached)
    else:
        ratio = math.exp(0.05)
        near = [np.asarray(kinetic_friction(interface, speed * ratio**k)) for k in (-2, -1, 1, 2)]
        slope = (8.0 * (near[2] - near[1]) - (near[3] - near[0])) / (12.0 * math.log(ratio))
    return float(slope) if speed.ndim == 0 else np.asarray(slope)


@dataclass(frozen=True, kw_only=True)
class TurningVelocity:
    """A speed at which the friction law turns.

    Attributes
    ----------
    velocity : float
        In ``x_s`` per time.
    force : float
        Kinetic friction there, per contact, in ``f_s``.
    kind : {"minimum", "maximum"}
        Below a minimum friction weakens with velocity, above it strengthens; a maximum is the other way round.
    """

    velocity: float
    force: float
    kind: Literal["minimum", "maximum"]

    def __str__(self) -> str:
        return f"{self.kind} of {self.force:.4g} f_s at velocity {self.velocity:.4g}"


def turning_velocities(interface: Interface, *, between: tuple[float, float]) -> tuple[TurningVelocity, ...]:
    """Find the speeds at which kinetic friction is smallest or largest: where `friction_slope` changes sign.

    Ageing and temperature make a minimum: slow contacts have time to age. Temperature and a delay make a maximum: fast
    contacts are missed while they are detached.

    Parameters
    ----------
    interface : Interface
    between : (float, float)
        Range of the speed, both above 0, in ``x_s`` per time.

    Returns
    -------
    tuple of TurningVelocity
        Rising in velocity; empty if friction only rises or only falls.

    Raises
    ------
    InputError
        If the range is empty, or as `kinetic_friction`.

    Examples
    --------
    >>> import stickslip as ss
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1),
    ...     temperature=ss.Bell(width=0.01, attempts=1e6),
    ...     delay=ss.Delay(0.01),
    ... )
    >>> print(*ss.turning_velocities(interface, between=(0.01, 100)))
    maximum of 0.4517 f_s at velocity 0.9972
    """
    instance("turning_velocities: interface", interface, Interface, "an Interface")
    ends = sequence("between", between, "two speeds, such as (0.01, 100)")
    if len(ends) != 2:
        raise InputError(f"between = {shown(between)}: must be two speeds, such as (0.01, 100)")
    low = number("between[0]", ends[0], above=0, hint="in x_s per time")
    high = number("between[1]", ends[1], above=low, hint="in x_s per time")
    places = np.linspace(math.log(low), math.log(high), 2 + math.ceil(_PER_DECADE * math.log10(high / low)))

    def slope(place: float) -> float:
        return friction_slope(interface, math.exp(place))

    slopes = friction_slope(interface, np.exp(places))
    found = []
    for k in np.flatnonzero(slopes[1:] * slopes[:-1] < 0).tolist():
        velocity = math.exp(optimize.brentq(slope, places[k], places[k + 1], xtol=1e-10))
        force = kinetic_friction(interface, velocity)
        found.append(TurningVelocity(velocity=velocity, force=force, kind="minimum" if slopes[k] < 0 else "maximum"))
    return tuple(found)
