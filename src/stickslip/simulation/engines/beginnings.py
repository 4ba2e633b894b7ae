"""What contacts are like at the beginning of a run: drawn one by one, or as nodes of a quadrature."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stickslip.model import Delay, DelayModel, Interface
from stickslip.model.distributions import Distribution, SteadyState, panels
from stickslip.simulation.engines.base import Beginning, Stretchings

Array = NDArray[np.float64]


def generators(seed: int) -> list[np.random.Generator]:
    """Return three streams of random numbers: of initial stretchings, of thresholds, and of delays."""
    return [np.random.default_rng(part) for part in np.random.SeedSequence(seed).spawn(3)]


def first_contacts(beginning: Beginning, count: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Draw stretchings and thresholds of all contacts (detached ones last), and when the latter re-attach."""
    distribution, delay = beginning.interface.threshold_distribution, beginning.interface.delay
    initial, attached = beginning.interface.initial, count
    if beginning.sliding:
        initial, attached = SteadyState(thresholds=distribution), round(count * beginning.attached)
    x = initial.sample(rng, attached)
    largest = distribution.support[1]
    while (again := np.flatnonzero(np.abs(x) >= largest)).size:
        x[again] = initial.sample(rng, again.size)
    threshold = distribution.sample_beyond(rng, np.abs(x))
    detached = count - attached
    pending = pending_times(delay, detached, rng)
    return np.append(x, np.zeros(detached)), np.append(threshold, np.zeros(detached)), pending


def pending_times(delay: DelayModel, detached: int, rng: np.random.Generator) -> Array:
    """Draw when contacts that are caught in the middle of a delay re-attach: long delays are met more often."""
    if isinstance(delay, Delay):
        return delay.time * rng.random(detached)
    if not detached:
        return np.empty(0)
    pool = delay.sample(rng, 4 * detached + 1000)
    return np.asarray(rng.choice(pool, detached, p=pool / pool.sum()) * rng.random(detached))


def pool_of_delays(delay: DelayModel, rng: np.random.Generator, size: int = 65_536) -> Array:
    """Draw delays for the kernels to choose from; one will do if all are the same."""
    return delay.sample(rng, 1 if isinstance(delay, Delay) else size)


def attached_now(x: Array, attach: Array, now: float) -> Stretchings:
    """Return the stretchings of the contacts that hold from the times `attach` on."""
    held = x[attach <= now]
    return Stretchings(held, np.full(held.size, 1.0 / x.size), cells=False)


def survival_table(distribution: Distribution) -> tuple[Array, Array, float]:
    """Tabulate survival and density of thresholds, and the spacing.

    For cubic interpolation, to 1e-13 for smooth distributions.
    """
    end = distribution.support[1]
    count = math.ceil(end / min(max(2e-3 * distribution.standard_deviation(), end / 2**20), end / 64))
    spacing = end / count
    x = spacing * np.arange(count + 1)
    survival = distribution.survival(x)
    survival[-1] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        density = distribution.density(x)
    if not np.isfinite(density[0]):  # distributions with a singular start
        density[0] = (survival[0] - survival[1]) / spacing
    return survival, density, spacing


def initial_nodes(interface: Interface, finer: int = 1) -> tuple[Array, Array]:
    """Quadrature nodes of the initial stretchings, between the jumps of their distribution, and their weights of sum 1.

    Sixteen nodes for every four standard deviations do for distributions without jumps, and `finer` times as many may
    be asked for.
    """
    distribution, thresholds = interface.initial, interface.threshold_distribution
    std = distribution.standard_deviation()
    if std == 0:
        return np.array([distribution.moment(1)]), np.ones(1)
    low, high = (
        max(distribution.support[0], -thresholds.support[1]),
        min(distribution.support[1], thresholds.support[1]),
    )
    edges = [low, *(knot for knot in sorted({*distribution.knots, *thresholds.knots}) if low < knot < high), high]
    width = 4.0 * min(std, max(thresholds.standard_deviation(), 1e-3 * std))
    parts = [panels(left, right, math.ceil(finer * (right - left) / width)) for left, right in pairwise(edges)]
    x, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    weight = weight * distribution.density(x)
    kept = (weight > 0) & (thresholds.survival(np.abs(x)) > 0)
    return x[kept], weight[kept] / weight[kept].sum()


def settled_nodes(beginning: Beginning) -> tuple[Array, Array]:
    """Quadrature nodes of the stretchings at the beginning: those of the interface, or of steady sliding."""
    if not beginning.sliding:
        return initial_nodes(beginning.interface)
    distribution = beginning.interface.threshold_distribution
    return initial_nodes(Interface(thresholds=distribution, initial=SteadyState(thresholds=distribution)))
