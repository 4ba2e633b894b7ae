"""Rigid motion by the renewal equation: its solution for an interface, static friction,
and the thresholds that give a measured friction.

An experiment measures two friction coefficients; the model needs the thresholds of the
contacts behind them.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import optimize

from stickslip.arrays import Array
from stickslip.errors import InputError, instance
from stickslip.kernels import renewal
from stickslip.model import Exponential, Gaussian, Interface, Renewal
from stickslip.model.distribution import check_density
from stickslip.model.distributions import Distribution, excess
from stickslip.model.newborn import stretching_nodes
from stickslip.sliding.law import kinetic_friction

# standard deviations of the thresholds over their mean between which a fit searches
NARROWEST = 0.01
WIDEST = 1.0
_MOST_WORK = 5e7  # initial nodes times positions: about ten seconds


def check_renewal(interface: Interface, who: str) -> None:
    """Raise `InputError` for ageing and for thresholds without a density, which the
    renewal equation does not support.
    """
    instance(f"{who}: interface", interface, Interface, "an Interface")
    interface.allow(("sliding_force", "newborn"), who)
    check_density(interface.threshold_distribution)


def solved(
    interface: Interface,
    distance: float,
    velocity: float,
    points: int,
) -> Callable[[Array], renewal.RigidResponse]:
    """Return the solution of the renewal equation as a function of positions."""
    distribution = interface.threshold_distribution
    born = interface.newborn
    sliding_force = interface.sliding_force
    # Where the distribution of thresholds jumps, each initial node gives a jump in the
    # stiffness.
    jumps = any(0 < knot < math.inf for knot in distribution.knots)
    stretchings, weight = stretching_nodes(
        interface.initial,
        interface.threshold_distribution,
        16 if jumps else 1,
    )
    work = stretchings.size * float(points)
    if work > _MOST_WORK:
        raise InputError(
            f"{work:.1g} points are needed to resolve thresholds and initial "
            f"stretchings, more than {_MOST_WORK:.0e}: "
            "give standard deviations that differ less from each other and from the "
            "mean"
        )
    delay, part = interface.delay.quadrature()
    contacts = renewal.RenewalContacts(
        distribution.density,
        lambda x, n: excess(distribution, x, n),
        stretchings,
        weight,
        np.maximum(stretchings, 0.0),
        velocity * delay,
        part,
        *(
            (np.zeros(1), np.ones(1))
            if born is None
            else stretching_nodes(born, distribution)
        ),
    )
    re_attached = renewal.solve(contacts, distance, points)

    def at(X: Array) -> renewal.RigidResponse:
        found = renewal.observe(contacts, re_attached, X)
        if sliding_force == 0:
            return found
        # Detached contacts are stretched with the slider until they slide.
        element = np.minimum(X, sliding_force)
        detached = 1.0 - found.attached
        detaching = found.rate - renewal.re_attaching(
            contacts,
            re_attached,
            X,
            found.rate,
        )
        stiffness = (
            found.stiffness
            + element * detaching
            + np.where(sliding_force > X, detached, 0.0)
        )
        return found._replace(
            force=found.force + element * detached, stiffness=stiffness
        )

    return at


def static_friction(interface: Interface) -> tuple[float, float]:
    """Largest friction force in quasi-static motion, per contact in ``f_s``, and the
    position at which it is reached to nine digits.

    Broken contacts re-attach immediately, so the force of detached ones does not
    matter.

    Raises
    ------
    InputError
        If thresholds age, or with thermal activation: the force then depends on the
        duration of rest before, and on the speed.
    """
    check_renewal(interface, "static_friction")
    bare = Interface(
        thresholds=interface.thresholds,
        initial=interface.initial,
        newborn=interface.newborn,
    )
    distance = 4.0 * float(interface.threshold_distribution.inverse_survival(1e-3))
    points = Renewal().points
    X = np.linspace(0.0, distance, points + 1)
    force = solved(bare, distance, 1.0, points)(X).force
    # If the force only rises, rounding would decide where it is largest.
    first = int(np.argmax(force >= (1.0 - 1e-9) * force.max()))
    return float(force.max()), float(X[first])


@lru_cache(maxsize=256)
def slow_friction(
    thresholds: Distribution, initial: Distribution
) -> tuple[float, float]:
    """Return static and kinetic friction in slow rigid motion without delay, per
    contact in ``f_s``, accurate to 1e-4.

    Static friction is the first maximum of Eqs. (1)-(4), kinetic friction their limit
    after a long distance.
    """
    contacts = Interface(thresholds=thresholds, initial=initial)
    positive = contacts.threshold_distribution
    distance = 2.0 * positive.moment(1) + float(positive.inverse_survival(1e-3))
    points = max(512, math.ceil(distance / (positive.standard_deviation() / 4.0)))
    force = solved(contacts, distance, 1.0, points)(
        np.linspace(0.0, distance, 4 * points + 1)
    ).force
    return float(force.max()), kinetic_friction(contacts)


def _friction_ratio(std: float, initial: Distribution) -> float:
    most, least = slow_friction(Gaussian(1.0, std), initial)
    return most / least


@lru_cache(maxsize=64)
def friction_ratios(initial: Distribution) -> tuple[float, float]:
    """Return the least and the largest ratio of static to kinetic friction that
    Gaussian thresholds can have.
    """
    return _friction_ratio(WIDEST, initial), _friction_ratio(NARROWEST, initial)


@lru_cache(maxsize=64)
def thresholds_of(
    static: float,
    kinetic: float,
    initial: Distribution,
) -> tuple[Gaussian, float]:
    """Return Gaussian thresholds of mean 1 whose slow friction has this ratio, and the
    sum of all threshold forces.

    Static and kinetic friction are forces or coefficients, and the sum is in the same
    unit. Raises `InputError` if no standard deviation gives their ratio; the message
    has the possible range.
    """
    wanted = static / kinetic
    least, most = friction_ratios(initial)
    if not least <= wanted <= most:
        more = (
            "; more needs contacts that strengthen at rest: give contact_strength, "
            "thresholds and ageing"
        )
        raise InputError(
            (
                f"mu_s/mu_k = {wanted:.4g}: must be between {least:.3f} and {most:.3f} "
                "with Gaussian thresholds"
            )
            + (more if wanted > most else "")
        )
    std = optimize.brentq(
        lambda std: _friction_ratio(std, initial) - wanted,
        NARROWEST,
        WIDEST,
        xtol=1e-10,
    )
    found = Gaussian(1.0, float(std))
    return found, kinetic / slow_friction(found, initial)[1]


def thresholds_or_even(
    static: float,
    kinetic: float,
    initial: Distribution,
) -> tuple[Distribution, float]:
    """Return the result of `thresholds_of`; for equal frictions exponential thresholds.

    These give no peak: from the first moment on as many contacts break as attach.
    """
    if not math.isclose(static, kinetic, rel_tol=1e-9):
        return thresholds_of(static, kinetic, initial)
    even = Exponential(1.0)
    return even, kinetic / kinetic_friction(Interface(thresholds=even))
