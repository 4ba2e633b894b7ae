"""Rigid motion of the slider: the friction force, and how steeply it can fall.

This decides the elastic instability of a slider on a spring, Eqs. (5)-(8): a spring
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
    """Return the force on a rigid slider that moves over an interface at a constant
    velocity, as in Fig. 1 of the paper.

    Parameters
    ----------
    interface : Interface
    distance : float
        Length of the motion, in ``x_s``.
    velocity : float
        Velocity in ``x_s`` per time; matters only if broken contacts re-attach after a
        delay.
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
        If the distance or the velocity is not positive, or the method does not support
        the interface.

    Notes
    -----
    `Renewal` solves Eqs. (1)-(4) exactly as written: only contacts stretched forwards
    can break, so a contact that starts stretched backwards may have any threshold. In
    the other methods, in which the slider may reverse, that threshold exceeds
    ``|x_0|``. For initial and threshold standard deviations of .3 the first maxima
    differ by .001, for smaller ones by less than 1e-6.
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
    """Return the effective stiffness of the interface ``K_eff = -dF_c/dX``, Eq. (7),
    per contact, at displacements from the start.

    It is computed as ``Int x P Q dx`` minus the attached fraction, not as a numerical
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
    """Return the critical stiffness ``K*`` of the driving spring, Eq. (8), per contact
    in units of ``k``.

    With a softer spring, the slider jumps when the friction force falls; with a stiffer
    one, it does not.

    Parameters
    ----------
    interface : Interface
        The interface, whose delay is ignored.
    reattachment : bool
        Whether broken contacts re-attach at once, or never.

    Returns
    -------
    float
        Zero for an interface that starts in the steady state of sliding.

    Notes
    -----
    It has six correct digits for distributions without jumps, four for distributions
    with jumps and a start without standard deviation, and two or three with both jumps
    and a standard deviation.

    For the Gaussian thresholds of the paper's Fig. 4 (standard deviation .1, initial
    standard deviation .01) the values are 2.989 and, without re-attachment, 3.548. The
    paper prints 3.59, which its Eqs. (1)-(4) do not give.
    """
    return steepest_fall(interface, reattachment=reattachment)[0]


def steepest_fall(
    interface: Interface, *, reattachment: bool = True
) -> tuple[float, float]:
    """Return the largest effective stiffness and the displacement at which it occurs;
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
        # exactly 0; sums over nodes would show the jumps of the distribution
        return 0.0, 0.0
    # The first fall is the steepest, as renewal smooths later ones. The distance covers
    # the breaks of the initial contacts.
    distance = 0.1 * distribution.moment(1) + min(
        distribution.support[1] - min(bare.initial.support[0], 0.0),
        4.0 * float(distribution.inverse_survival(1e-3)),
    )
    points = _points(bare, distance)
    solution = solved(bare, distance, 1.0, points)
    X = np.linspace(0.0, distance, points + 1)
    # For a start without standard deviation, the fall may be steepest just before or
    # after a jump of the distribution: include both sides of each.
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
    # rounding of the constant force in the steady state is not a fall
    return (value if value > 1e-9 else 0.0), place


def _points(interface: Interface, distance: float) -> int:
    """Return the number of intervals of a grid that resolves the distributions to six
    digits where they are smooth, and to four at jumps.
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
    # For a start without standard deviation, a jump of the distribution makes a kink in
    # the force, near which interpolation is of first order.
    kinked = stds[1] == 0 and any(
        0 < knot < distance for knot in interface.threshold_distribution.knots
    )
    return 16 * points if kinked else points
