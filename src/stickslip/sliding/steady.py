"""Steady sliding of any interface: force, slope and linear response by the kind of its
contacts.

The force is the mean work of a contact over the mean distance slid, both from one
attachment to the next: ``F = (M_1 + f_d v <tau>)/(M_0 + v <tau>)``, with ``M_j`` the
mean integral of ``x**j`` times the survival over a life, and ``f_d`` the force of
detached contacts. Kinds of contacts differ only in their lifetimes.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from stickslip.errors import InputError, instance
from stickslip.model import FixedGrowth, Interface, Langevin
from stickslip.model.records import hashable
from stickslip.sliding import unaged
from stickslip.sliding.response import Array, MeanLifetimes, Response

Law = Callable[[Array], Array]
"""A function of the velocity, per contact."""


class Sliding(NamedTuple):
    """Steady sliding of an interface, in natural units per contact."""

    who: str  #: name of the kind of sliding in errors
    takes: tuple[str, ...]  #: mechanisms for which it is known
    force: Law
    slope: Law  #: derivative of the force by the logarithm of the velocity
    response: Callable[[], Response]


def _by_lifetimes(
    interface: Interface, lifetimes: Callable[[Interface, float], MeanLifetimes]
) -> tuple[Law, Law]:
    """Force and slope of contacts with known mean lifetimes and their slopes."""

    def force_and_slope(velocity: float) -> tuple[float, float]:
        away = velocity * interface.delay.moment(1) if velocity > 0 else 0.0
        if math.isinf(away):
            return interface.sliding_force, 0.0
        life = lifetimes(interface, velocity)
        pulled = interface.sliding_force * away
        length = life.distance + away
        if np.any(length <= 0):
            return 0.0, 0.0  # contacts break as soon as they attach
        force = (life.work + pulled) / length
        slope = (life.more + pulled - force * (life.longer + away)) / length
        return float(life.weight @ force), float(life.weight @ slope)

    def law(velocity: Array) -> Array:
        return np.array([force_and_slope(v) for v in velocity.tolist()]).T

    return lambda v: law(v)[0], lambda v: law(v)[1]


def _by_force(force: Law) -> tuple[Law, Law]:
    """A force and its slope, by differences of fourth order with a step of 5 %."""

    def slope(velocity: Array) -> Array:
        step = 0.05
        near = [force(velocity * math.exp(step * k)) for k in (-2, -1, 1, 2)]
        return np.asarray(
            (8.0 * (near[2] - near[1]) - (near[3] - near[0])) / (12.0 * step)
        )

    return force, slope


def _kind(interface: Interface) -> Sliding:
    """Return steady sliding by the kind of contacts; kernels are imported only for
    kinds that integrate over lifetimes.
    """
    who = "smooth sliding"
    ageing = interface.ageing
    if interface.areas is not None:
        from stickslip.sliding import activated, drawn

        return Sliding(
            f"{who} of areas",
            ("areas", "activation", "sliding_force"),
            *_by_lifetimes(interface, activated.mean_lives_of_areas),
            lambda: drawn.response_of_areas(interface),
        )
    if ageing is None and interface.activation is None:
        return Sliding(
            who,
            ("sliding_force", "newborn"),
            *_by_lifetimes(interface, unaged.mean_lives),
            lambda: unaged.response(interface),
        )
    if isinstance(ageing, Langevin):
        from stickslip.sliding import langevin

        return Sliding(
            f"{who} of thresholds that age by Langevin",
            ("ageing", "activation"),
            *_by_force(lambda v: langevin.force(interface, v)),
            lambda: langevin.response(interface),
        )
    if ageing is not None and not isinstance(ageing, FixedGrowth):
        own = ageing
        contacts = (interface.threshold_distribution, interface.delay)

        def force(velocity: Array) -> Array:
            return np.array([own.friction(*contacts, v) for v in velocity.tolist()])

        return Sliding(
            f"{who} of thresholds that age by a rule of your own",
            ("ageing",),
            *_by_force(force),
            lambda: own.response(*contacts),
        )
    from stickslip.sliding import activated

    heated = interface.activation is not None
    return Sliding(
        f"{who} {'with temperature' if heated else 'of thresholds that grow'}",
        ("ageing", "activation", "sliding_force"),
        *_by_lifetimes(interface, activated.mean_lives),
        lambda: activated.ActivatedResponse(interface),
    )


def sliding_of(interface: Interface, who: str = "") -> Sliding:
    """Return force, slope and response of an interface in steady sliding; raises
    `InputError` if they are not known.
    """
    instance(f"{who}interface", interface, Interface, "an Interface")
    found = _kind(interface)
    interface.allow(found.takes, found.who)
    return found


def respond(interface: Interface) -> Response:
    """Return the linear response of an interface; equal interfaces share one object."""
    instance("interface", interface, Interface, "an Interface")
    return _response(hashable(interface))


@lru_cache(maxsize=256)
def _response(interface: Interface) -> Response:
    found = sliding_of(interface)
    if not math.isfinite(interface.delay.moment(1)):
        raise InputError(
            "Interface.delay: contacts never re-attach, so there is no smooth sliding "
            "to be stable or not; "
            "give a finite delay"
        )
    return found.response()
