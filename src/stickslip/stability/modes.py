"""Modes of smooth sliding: dynamic stiffness of the contacts, number of growing modes,
and growth rate.

Modes are roots of ``Z(s) + kappa(s) = 0``, with ``Z`` the impedance of the rig and
``kappa`` the dynamic stiffness of the contacts.
"""

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import instance, number, refused
from stickslip.model import Interface
from stickslip.model.rig import Rig
from stickslip.sliding import respond
from stickslip.sliding.response import ComplexArray
from stickslip.stability import roots
from stickslip.stability.impedances import impedance
from stickslip.stability.scan import SmoothSliding


def dynamic_stiffness(
    interface: Interface,
    velocity: float,
    s: ArrayLike,
) -> ComplexArray:
    """Force of the interface over displacement for motion ``v t + small exp(s t)``, per
    contact.

    Parameters
    ----------
    interface : Interface
        The contacts. Without delay the result is 0 at every `s`.
    velocity : float
        Speed of smooth sliding, in ``x_s`` per time.
    s : array_like of complex
        Growth rate plus ``i`` times angular frequency, in 1/time. On the imaginary axis
        and to its right any distribution is allowed; to the left `s` is limited to
        where the distribution of thresholds has a transform.

    Returns
    -------
    ndarray of complex, shape of `s`
        ``kappa(s)`` in units of ``k``; tends to ``s dF_k/dv`` for ``s -> 0``.

    Raises
    ------
    InputError
        If contacts never re-attach (no steady sliding), age by `Langevin` under thermal
        activation, or all share one threshold and one delay; if `s` lies where the
        transform does not exist or overflows.

    Notes
    -----
    Distributions without a closed transform (`LogNormal`, `Weibull`) take about ten
    microseconds a point. The relative error is about 1e-12, for distributions with very
    heavy tails down to 1e-8 at small `s`; with thresholds that age by `Langevin` 1e-6
    (1e-4 at ``v = .05 rate**2``, 2e-3 at a tenth of that), with thermal activation or
    thresholds that grow by a fixed rule 1e-7.
    """
    speed = number("velocity", velocity, above=0, hint="in x_s per time")
    try:
        points = np.asarray(s, dtype=complex)
    except (TypeError, ValueError, OverflowError):
        words = "must be a complex number, or an array of them (in 1/time)"
        raise refused("s", s, words) from None
    return respond(interface).stiffness(speed, points)


def count_unstable(rig: Rig) -> int:
    """Count the growing modes of smooth sliding: roots of ``Z(s) + kappa(s) = 0`` with
    ``Re s > 0``.

    At each frequency with ``Im(Z + kappa) = 0`` some extra spring at the interface
    makes a mode neutral. As that spring is removed modes begin to grow: their number is
    that of the frequencies that lack stiffness, less those that have too much.

    Parameters
    ----------
    rig : Rig
        Interface, slider (or any impedance) and velocity.

    Returns
    -------
    int
        Number of unstable roots, a complex pair counting 2; 0 if smooth sliding is
        stable.

    Raises
    ------
    InputError
        If there is no steady sliding, see `dynamic_stiffness`.
    UndecidedError
        If a root lies on the imaginary axis to within the accuracy of the response:
        rounding, or with thresholds that age by `Langevin` 1e-3 of the stiffness of the
        contacts.
    """
    return roots.count(smooth_sliding(rig))


def growth_rate(rig: Rig) -> complex:
    """Return the root of ``Z(s) + kappa(s) = 0`` with the largest real part: growth
    rate plus ``i`` angular frequency.

    Newton's method from starts along the whole axis finds candidates; the argument
    principle on a line just left of the best one confirms that no other root lies to
    the right of it.

    Parameters
    ----------
    rig : Rig
        Interface, slider (or any impedance) and velocity.

    Returns
    -------
    complex
        In 1/time of the rig's own units, with an imaginary part of 0 or above. A
        negative real part is the slowest decay, of the slider or of the ringing of the
        contacts.

    Raises
    ------
    InputError
        If there is no steady sliding, see `dynamic_stiffness`.
    UndecidedError
        If smooth sliding is stable but no mode decays exponentially: a distribution of
        thresholds with a heavy tail, or a rig without mass and losses on an interface
        without delay.

    Notes
    -----
    With thresholds that age by `Langevin` growing modes are confirmed by their count; a
    negative real part is that of the mode nearest to the axis among those found.
    """
    return roots.rightmost(smooth_sliding(rig)) * rig.unit("1/time")


def smooth_sliding(rig: Rig) -> SmoothSliding:
    """Response of the contacts, impedance of the body and speed of smooth sliding, in
    natural units.
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    natural = rig.natural
    speed = number("velocity", natural.velocity, above=0, hint="in x_s per time")
    return SmoothSliding(respond(natural.interface), impedance(natural.slider), speed)
