"""What contacts are like at the beginning of a run: drawn one by one, or as nodes of a quadrature."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stickslip.model import Delay, DelayModel, Interface
from stickslip.model.distributions import Distribution, SteadyState
from stickslip.model.newborn import stretching_nodes, stretchings_within, thresholds_beyond
from stickslip.simulation.engines.base import Beginning, Stretchings

Array = NDArray[np.float64]


def generators(seed: int) -> list[np.random.Generator]:
    """Return three streams of random numbers: of initial stretchings, of thresholds, and of delays."""
    return [np.random.default_rng(part) for part in np.random.SeedSequence(seed).spawn(3)]


def later_generators(seed: int) -> list[np.random.Generator]:
    """Return two streams more: of newborn stretchings, and of tracks."""
    return [np.random.default_rng(part) for part in np.random.SeedSequence(seed).spawn(5)[3:]]


def first_contacts(
    beginning: Beginning, count: int, rng: np.random.Generator, factor: float = 1.0
) -> tuple[Array, Array, Array]:
    """Draw stretchings and thresholds of all contacts (detached ones last), and when the latter re-attach.

    Thresholds are `factor` times those of the distribution.
    """
    interface = beginning.interface
    if beginning.sliding and ("newborn" in interface.mechanisms or factor != 1.0):
        x, threshold = _lives_met(interface, count, rng, factor, beginning.velocity * interface.delay.moment(1))
    else:
        distribution = interface.threshold_distribution
        initial, attached = interface.initial, count
        if beginning.sliding:
            initial, attached = SteadyState(thresholds=distribution), round(count * beginning.attached)
        x = stretchings_within(initial, rng, attached, distribution)
        threshold = thresholds_beyond(distribution, rng, x, factor)
    detached = count - x.size
    pending = pending_times(interface.delay, detached, rng)
    return np.append(x, np.zeros(detached)), np.append(threshold, np.zeros(detached)), pending


def newborns(
    interface: Interface, size: int, factor: float, births: np.random.Generator, thresholds: np.random.Generator
) -> tuple[Array, Array]:
    """Draw stretchings of contacts that re-attach, along the motion (none if unstretched), and their thresholds."""
    distribution = interface.threshold_distribution
    if interface.newborn is None:
        drawn = distribution.sample(thresholds, size)
        return np.empty(0), drawn if factor == 1.0 else factor * drawn
    x = stretchings_within(interface.newborn, births, size, distribution)
    return x, thresholds_beyond(distribution, thresholds, x, factor)


def _lives_met(
    interface: Interface, count: int, rng: np.random.Generator, factor: float, gap: float
) -> tuple[Array, Array]:
    """Draw stretchings and thresholds of the attached contacts of steady sliding: long lives are met more often.

    `gap` is the mean distance between a break and the next birth.
    """
    born, threshold = newborns(interface, 4 * count + 1000, factor, rng, rng)
    born = born if born.size else np.zeros(threshold.size)
    path = threshold - born
    attached = round(count * float(path.mean() / (path.mean() + gap)))
    met = rng.choice(path.size, attached, p=path / path.sum())
    return born[met] + rng.random(attached) * path[met], threshold[met]


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
    """Quadrature nodes of the initial stretchings and their weights, see `stretching_nodes`."""
    return stretching_nodes(interface.initial, interface.threshold_distribution, finer)


def settled_nodes(beginning: Beginning) -> tuple[Array, Array]:
    """Quadrature nodes of the stretchings at the beginning: those of the interface, or of steady sliding."""
    if not beginning.sliding:
        return initial_nodes(beginning.interface)
    distribution = beginning.interface.threshold_distribution
    return initial_nodes(Interface(thresholds=distribution, initial=SteadyState(thresholds=distribution)))
