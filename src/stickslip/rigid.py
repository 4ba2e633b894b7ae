"""Rigid motion of the slider: the force it meets, and how steeply that force can fall.

The elastic instability of a slider on a spring is decided here, Eqs. (5)-(8): a spring
softer than the critical stiffness cannot follow the fall of the force.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.errors import InputError, instance, number, numbers
from stickslip.model import Contacts, Delay, Interface, MasterEquation, Renewal
from stickslip.model.distributions import SteadyState
from stickslip.simulation import pull_rigidly, with_label
from stickslip.sliding.rigid_motion import check_renewal, solved
from stickslip.sliding.rigid_motion import static_friction as static_friction

if TYPE_CHECKING:
    import xarray as xr


def rigid_slide(
    interface: Interface,
    distance: float,
    *,
    velocity: float = 1.0,
    method: Renewal | Contacts | MasterEquation = Renewal(),
) -> xr.Dataset:
    """Move a rigid slider over an interface at a constant velocity, as in Fig. 1 of the
    paper.

    Parameters
    ----------
    interface : Interface
    distance : float
        Length of the motion, in ``x_s``.
    velocity : float
        In ``x_s`` per time; matters only if broken contacts re-attach after a delay.
    method : Renewal, Contacts or MasterEquation

    Returns
    -------
    xarray.Dataset
        On positions ``X``: ``friction_force`` (force per contact in ``f_s``, Eq. (4))
        and ``attached``; with `Renewal` also ``breaking_rate`` (breaks per contact and
        ``x_s``, Eq. (2)) and ``stiffness`` (``dF_c/dX`` in ``k``).

    Raises
    ------
    InputError
        If the distance or the velocity is not positive, or the method cannot take the
        interface.

    Notes
    -----
    `Renewal` solves Eqs. (1)-(4) to the letter: only contacts stretched forwards are
    asked for their threshold, so one that starts stretched backwards may have any. The
    other methods, which let the slider turn round, know that it lies beyond ``|x_0|``.
    For initial and threshold standard deviations of .3 the first maxima differ by .001,
    for narrower ones by less than 1e-6.
    """
    import xarray as xr

    distance = number("slide: distance", distance, above=0, hint="in x_s")
    velocity = number("slide: velocity", velocity, above=0, hint="in x_s per time")
    instance("slide: interface", interface, Interface, "an Interface")
    if isinstance(method, (Contacts, MasterEquation)):
        track = pull_rigidly(
            interface,
            distance,
            velocity,
            method,
            points=math.ceil(min(1000 * distance, 1e6)),
        )
        X = velocity * track.times
        values = {name: track[name] for name in ("friction_force", "attached")}
    elif isinstance(method, Renewal):
        check_renewal(interface, "Renewal")
        X = np.linspace(0.0, distance, method.points + 1)
        found = solved(interface, distance, velocity, method.points)(X)
        values = {"friction_force": found.force, "attached": found.attached}
        values |= {"breaking_rate": found.rate, "stiffness": found.stiffness}
    else:
        raise InputError(
            f"slide: method = {method!r}: must be Renewal(), Contacts(...) or "
            "MasterEquation(...)"
        )
    place = "displacement"
    data = {name: with_label(name, place, value) for name, value in values.items()}
    return xr.Dataset(data, {place: with_label(place, place, X)})


def effective_stiffness(
    interface: Interface, X: ArrayLike, *, velocity: float = 1.0
) -> Array:
    """Effective stiffness of the interface ``K_eff = -dF_c/dX``, Eq. (7), per contact,
    at displacements from the start.

    Computed as ``Int x P Q dx`` minus the attached fraction, not as a numerical
    derivative. The velocity matters only with a delay.
    """
    check_renewal(interface, "effective_stiffness")
    X = np.atleast_1d(
        numbers("effective_stiffness: X", X, at_least=0, hint="displacements in x_s")
    )
    distance = max(float(X.max()), 1e-3)
    return -solved(interface, distance, velocity, _points(interface, distance))(
        X
    ).stiffness


def critical_stiffness(interface: Interface, *, reattachment: bool = True) -> float:
    """Critical stiffness ``K*`` of the driving spring, Eq. (8), per contact in units of
    ``k``.

    A softer spring lets the slider jump when the friction force falls; a stiffer one
    does not.

    Parameters
    ----------
    interface : Interface
        Its delay does not enter.
    reattachment : bool
        Broken contacts are re-attached at once (default), or never.

    Returns
    -------
    float
        Zero for an interface that starts in the steady state of sliding.

    Notes
    -----
    Good to six digits for distributions without jumps, to four for distributions that
    jump and a start without standard deviation, to two or three for both a standard
    deviation and jumps.

    For the Gaussian thresholds of the paper's Fig. 4 (standard deviation .1, initial
    standard deviation .01) the values are 2.989 and, without re-attachment, 3.548. The
    paper prints 3.59, which its Eqs. (1)-(4) do not give.
    """
    return steepest_fall(interface, reattachment=reattachment)[0]


def steepest_fall(
    interface: Interface, *, reattachment: bool = True
) -> tuple[float, float]:
    """Return the largest effective stiffness and the displacement where it occurs;
    see `critical_stiffness`.
    """
    check_renewal(interface, "critical_stiffness")
    instance("critical_stiffness: reattachment", reattachment, bool, "True or False")
    bare = replace(interface, delay=Delay(0.0 if reattachment else math.inf))
    distribution = bare.threshold_distribution
    if (
        reattachment
        and bare.newborn is None
        and bare.initial == SteadyState(thresholds=distribution)
    ):
        # exactly; a sum over nodes would find the jumps of the distribution in each of
        # them
        return 0.0, 0.0
    # The first fall is the steepest: renewal only smooths. Twice the largest initial
    # travel to break covers it.
    distance = 0.1 * distribution.moment(1) + min(
        distribution.support[1] - min(bare.initial.support[0], 0.0),
        4.0 * float(distribution.inverse_survival(1e-3)),
    )
    points = _points(bare, distance)
    solution = solved(bare, distance, 1.0, points)
    X = np.linspace(0.0, distance, points + 1)
    # Where the distribution jumps, the fall from a start without standard deviation is
    # steepest just before or after: look at both sides.
    alike = bare.initial.standard_deviation() == 0
    jumps = np.array(
        [knot - bare.initial.moment(1) for knot in distribution.knots if alike]
    )
    jumps = jumps[(jumps > 0) & (jumps < distance)]
    X = np.unique(
        np.concatenate(
            [
                X,
                np.nextafter(jumps, 0),
                np.nextafter(jumps, np.inf),
            ]
        )
    )
    for _ in range(4):
        K_eff = -solution(X).stiffness
        best = int(np.argmax(K_eff))
        value = float(K_eff[best])
        place = float(X[best])
        X = np.unique(
            np.append(
                np.linspace(X[max(best - 1, 0)], X[min(best + 1, X.size - 1)], 41),
                place,
            )
        )
    # Rounding of the steady state's flat force is not a fall.
    return (value if value > 1e-9 else 0.0), place


def _points(interface: Interface, distance: float) -> int:
    """Intervals of a grid that resolves the distributions to six digits where they
    are smooth, four at jumps.
    """
    stds = [
        interface.threshold_distribution.standard_deviation(),
        interface.initial.standard_deviation(),
    ]
    spacing = 1e-3
    mean = interface.threshold_distribution.moment(1)
    if max(stds) > 0:
        spacing = max(min(s for s in stds if s > 0) / (4.0 * mean), 1e-4)
    points = max(512, math.ceil(distance / (spacing * mean)))
    # From a start without standard deviation, a jump of the distribution makes a kink,
    # beside which interpolation is of first order.
    kinked = stds[1] == 0 and any(
        0 < knot < distance for knot in interface.threshold_distribution.knots
    )
    return 16 * points if kinked else points
