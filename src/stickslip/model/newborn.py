"""Stretching and thresholds of newborn contacts, and averages over their lives."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Nodes
from stickslip.errors import InputError
from stickslip.model.distribution import Positive, nodes_between
from stickslip.model.distributions import Distribution, Gaussian
from stickslip.model.interface import Interface


def stretching_nodes(
    distribution: Distribution,
    thresholds: Distribution,
    finer: float = 1.0,
) -> Nodes:
    """Quadrature nodes of the stretchings below the largest threshold, and their
    weights of sum 1.

    Panels end at the jumps of both distributions. Sixteen nodes for every four standard
    deviations suffice for distributions without jumps; `finer` multiplies their number.
    """
    std = distribution.standard_deviation()
    if std == 0:
        return np.array([distribution.moment(1)]), np.ones(1)
    largest = thresholds.support[1]
    low = max(distribution.support[0], -largest)
    high = min(distribution.support[1], largest)
    ends = [
        low,
        *(
            knot
            for knot in sorted({*distribution.knots, *thresholds.knots})
            if low < knot < high
        ),
        high,
    ]
    width = 4.0 * min(std, max(thresholds.standard_deviation(), 1e-3 * std))
    parts = [
        np.linspace(a, b, math.ceil(finer * (b - a) / width), endpoint=False)
        for a, b in pairwise(ends)
    ]
    edges = np.append(np.concatenate(parts), high)
    x, weight = (part.ravel() for part in nodes_between(edges[:-1], edges[1:]))
    weight = weight * distribution.density(x)
    kept = (weight > 0) & (thresholds.survival(np.abs(x)) > 0)
    return x[kept], weight[kept] / weight[kept].sum()


def mean_life(interface: Interface) -> tuple[float, float]:
    """Mean displacement of the slider, and mean work of a contact, from its attachment
    to its break in steady sliding.

    They are ``<x_s - x_0>``, the mean threshold where newborns are unstretched, and
    ``<x_s^2 - x_0^2>/2``; newborns have the stretchings ``x_0`` of `Interface.newborn`,
    and thresholds beyond them.
    """
    thresholds = interface.threshold_distribution
    if interface.newborn is None:
        return thresholds.moment(1), 0.5 * thresholds.moment(2)
    x, weight = stretching_nodes(interface.newborn, thresholds)
    held = thresholds.survival(np.abs(x))
    first, second = (
        thresholds.partial_moment(np.abs(x), order) / held for order in (1, 2)
    )
    return float(weight @ (first - x)), 0.5 * float(weight @ (second - x * x))


def half_distance(interface: Interface) -> float:
    """Return the distance slid within the mean delay at the speed where the friction is
    half that of slow sliding.

    Raises `InputError` if it never falls to half.
    """
    path, work = mean_life(interface)
    force = interface.sliding_force
    slow = work / path
    if force >= 0.5 * slow:
        raise InputError(
            f"the friction never halves: it falls from {slow:.3g} to the sliding "
            f"force, {force:.3g} of the contact "
            "strength; give the delay"
        )
    return path if force == 0 else path / (1.0 - 2.0 * force / slow)


def as_unstretched(interface: Interface) -> tuple[Distribution, float]:
    """Return thresholds and sliding force of an interface with unstretched newborns
    that responds equally to perturbations of steady sliding.

    All newborn contacts must have the same stretching.
    """
    thresholds = interface.threshold_distribution
    newborn = interface.newborn
    if newborn is None:
        return thresholds, interface.sliding_force
    x = newborn.moment(1)
    # Contacts that re-attach with the force of sliding: a difference by rounding is not
    # a force.
    force = (
        0.0
        if math.isclose(interface.sliding_force, x, rel_tol=1e-12)
        else interface.sliding_force - x
    )
    if isinstance(thresholds, Gaussian) and x >= 0 and thresholds.std > 0:
        return replace(
            thresholds,
            mean=thresholds.mean - x,
            lower=max(thresholds.lower - x, 0.0),
        ), force
    return Positive(whole=thresholds, stretching=x), force


def thresholds_beyond(
    thresholds: Distribution,
    rng: np.random.Generator,
    stretching: ArrayLike,
    factor: float = 1.0,
) -> Array:
    """Draw thresholds, `factor` times those of the distribution, above the size of the
    given stretchings.

    A contact stretched beyond the largest threshold gets its own stretching as
    threshold.
    """
    reach = np.abs(np.asarray(stretching, dtype=float))
    drawn = factor * thresholds.sample_beyond(
        rng, np.minimum(reach / factor, thresholds.support[1])
    )
    return np.asarray(np.maximum(drawn, reach))


# Rounds of drawing; if one value in 1000 is acceptable, a fraction exp(-100) is left.
_REDRAWN = 100_000


def stretchings_within(
    distribution: Distribution,
    rng: np.random.Generator,
    size: int,
    largest: float,
) -> Array:
    """Draw stretchings; those beyond the largest threshold are drawn again.

    Raises `InputError` if almost no stretching lies within it.
    """
    x = distribution.sample(rng, size)
    for _ in range(_REDRAWN):
        again = np.flatnonzero(np.abs(x) >= largest)
        if not again.size:
            return x
        x[again] = distribution.sample(rng, again.size)
    raise InputError(
        f"{distribution}: next to no stretching is below {largest:g}, the largest "
        "threshold; give a distribution within that"
    )
