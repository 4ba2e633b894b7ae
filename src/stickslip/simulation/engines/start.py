"""Contacts at the start of a run: drawn one by one, or as nodes of a quadrature."""

import math
from functools import lru_cache

import numpy as np

from stickslip.kernels.effective_stretching import Breaking
from stickslip.kernels.survival import SurvivalTable, tabulate, values_at
from stickslip.kernels.thinning import Rule, lifetimes
from stickslip.loops import HALVINGS, bounded
from stickslip.model import (
    Bell,
    Delay,
    DelayModel,
    FixedGrowth,
    FromSliding,
    Gamma,
    Interface,
    OnArrest,
    Parabolic,
)
from stickslip.model.distributions import Distribution, SteadyState
from stickslip.model.drive import Piece
from stickslip.model.newborn import stretchings_within, thresholds_beyond
from stickslip.model.records import hashable
from stickslip.model.rig import Rig
from stickslip.simulation.engines.base import Array, Beginning
from stickslip.simulation.estimates import Course, travel_of
from stickslip.sliding.lifetimes import blurred_survival, growth_of, hazard_of

_BLURRED = 1e-10  # error of the survival with thermal activation


def generators(seed: int, count: int = 3) -> list[np.random.Generator]:
    """Return `count` streams of random numbers, the first three for initial
    stretchings, thresholds and delays.
    """
    return [
        np.random.default_rng(part)
        for part in np.random.SeedSequence(seed).spawn(count)
    ]


def first_contacts(
    beginning: Beginning,
    count: int,
    rng: np.random.Generator,
    factor: float = 1.0,
) -> tuple[Array, Array, Array]:
    """Draw stretchings and thresholds of all contacts (detached ones last), and the
    times at which the detached ones re-attach.

    Thresholds are `factor` times those of the distribution; with areas, their square
    root.
    """
    interface = beginning.interface
    if beginning.sliding and ("newborn" in interface.mechanisms or factor != 1.0):
        start, threshold = newborns(interface, 4 * count + 1000, factor, rng, rng)
        return lives_met(beginning, count, rng, start, threshold, threshold)[:3]
    initial = interface.initial
    attached = count
    if beginning.sliding:
        initial = SteadyState(thresholds=interface.threshold_distribution)
        attached = round(count * beginning.attached)
    x = stretchings_within(initial, rng, attached, _largest(interface))
    return with_detached(
        beginning,
        count,
        rng,
        x,
        _thresholds_of(interface, rng, x, factor),
    )


def track_factor(interface: Interface, rng: np.random.Generator) -> float:
    """Draw the factor that all thresholds share until the next arrest."""
    if interface.slip_to_slip_scatter == 0.0:
        return 1.0
    variance = math.log1p(interface.slip_to_slip_scatter**2)
    return math.exp(math.sqrt(variance) * rng.standard_normal() - 0.5 * variance)


def newborns(
    interface: Interface,
    size: int,
    factor: float,
    newborns: np.random.Generator,
    thresholds: np.random.Generator,
) -> tuple[Array, Array]:
    """Draw stretchings of contacts that re-attach, along the motion, and their
    thresholds.
    """
    if interface.newborn is not None:
        x = stretchings_within(interface.newborn, newborns, size, _largest(interface))
        return x, _thresholds_of(interface, thresholds, x, factor)
    drawn = factor * interface.threshold_distribution.sample(thresholds, size)
    return np.zeros(size), drawn if interface.areas is None else np.sqrt(drawn)


def _largest(interface: Interface) -> float:
    """Largest stretching of an attached contact."""
    largest = interface.threshold_distribution.support[1]
    return largest if interface.areas is None else math.sqrt(largest)


def _thresholds_of(
    interface: Interface,
    rng: np.random.Generator,
    x: Array,
    factor: float,
) -> Array:
    """Draw thresholds above the size of these stretchings."""
    if interface.areas is None:
        return thresholds_beyond(interface.threshold_distribution, rng, x, factor)
    return np.sqrt(
        thresholds_beyond(interface.threshold_distribution, rng, x * x, factor)
    )


def lives_met(
    beginning: Beginning,
    count: int,
    rng: np.random.Generator,
    start: Array,
    threshold: Array,
    reached: Array,
) -> tuple[Array, Array, Array, Array]:
    """Draw the contacts of steady sliding from lifetimes, like `first_contacts`, and
    return also the distance that each has moved since it attached.

    A life goes from the stretching at the `start` to the one `reached`, and is chosen
    with a probability proportional to its length.
    """
    path = reached - start
    mean = float(path.mean())
    away = beginning.velocity * beginning.interface.delay.moment(1)
    attached = round(count * mean / (mean + away)) if mean > 0.0 else 0
    met = (
        rng.choice(path.size, attached, p=path / path.sum())
        if attached
        else np.empty(0, dtype=np.intp)
    )
    moved = path[met] * rng.random(attached)
    return *with_detached(
        beginning,
        count,
        rng,
        moved + start[met],
        threshold[met],
    ), np.append(moved, np.zeros(count - attached))


def with_detached(
    beginning: Beginning,
    count: int,
    rng: np.random.Generator,
    x: Array,
    threshold: Array,
) -> tuple[Array, Array, Array]:
    """Append the detached contacts, and return the times at which they re-attach."""
    none = np.zeros(count - x.size)
    return (
        np.append(x, none),
        np.append(threshold, none),
        pending_times(beginning.interface.delay, none.size, rng),
    )


def pending_times(delay: DelayModel, detached: int, rng: np.random.Generator) -> Array:
    """Draw the times of re-attachment of contacts in the middle of a delay, in which a
    long delay is proportionally more likely.
    """
    if isinstance(delay, Delay):
        return delay.time * rng.random(detached)
    if not detached:
        return np.empty(0)
    pool = delay.sample(rng, 4 * detached + 1000)
    return np.asarray(
        rng.choice(pool, detached, p=pool / pool.sum()) * rng.random(detached)
    )


def survival_of(
    distribution: Distribution,
    width: float = 0.0,
    squared: bool = False,
) -> SurvivalTable:
    """Return the survival of thresholds as a table for kernels; with a `width` that of
    newborns under thermal activation, at ``u = A ln G``.
    """
    table: SurvivalTable = _survival_of(hashable(distribution), width, squared)
    return table


@lru_cache(maxsize=128)
def _survival_of(
    distribution: Distribution,
    width: float,
    squared: bool,
) -> SurvivalTable:
    if width == 0.0:
        return tabulate(distribution.survival, *end_and_knots(distribution))
    known = survival_of(distribution)
    end = distribution.support[1]
    knots = np.array(distribution.knots)

    def survival(at: Array) -> Array:
        return values_at(known, np.sqrt(2.0 * at) if squared else at)

    def blurred(u: Array) -> Array:
        return blurred_survival(
            survival,
            width,
            u,
            tuple(0.5 * knots**2 if squared else knots),
        )

    high = (0.5 * end**2 if squared else end) + 3.8 * width
    return tabulate(
        blurred,
        high,
        np.empty(0),
        tolerance=_BLURRED,
        most=4096,
        low=-38.0 * width,
    )


def breaking_of(interface: Interface) -> Breaking:
    """Return the constants of breaking for kernels in which a clock and a reach
    determine the survival of contacts.
    """
    distribution = interface.threshold_distribution
    heat = interface.activation
    growth = growth_of(interface.ageing)
    table = survival_of(distribution)
    if isinstance(heat, (Bell, Parabolic)):
        squared = isinstance(heat, Parabolic)
        width = heat.temperature if isinstance(heat, Parabolic) else heat.width
        blurred = survival_of(distribution, width, squared)
        return Breaking(
            table,
            np.empty(0),
            blurred,
            width,
            heat.attempts,
            growth,
            squared,
        )
    knots = end_and_knots(distribution)[1] if interface.ageing is None else np.empty(0)
    return Breaking(table, knots, table, 0.0, 0.0, growth)


def end_and_knots(distribution: Distribution) -> tuple[float, Array]:
    """Stretching beyond which almost no contact survives, and the knots up to there;
    the end itself is not a knot.
    """
    top = float(distribution.inverse_survival(1e-13))
    knots = np.array(
        [knot for knot in distribution.knots if 0 < knot < top * (1 + 1e-6)]
    )
    return (1.02 * top if knots.size and knots[-1] > top * (1 - 1e-6) else top), knots


_DRAW = (6e-5, 1e-7), (1.2e-4, 3e-7), (2.4e-3, 4.2e-6)
"""Seconds to draw the contacts of a block, and of each contact: at rest; in sliding,
from lifetimes; and in sliding, as roots.
"""
_DRAWN = 256
"""Lifetimes drawn to estimate the number of breaks: to a tenth, where theory is good to
a factor of two.
"""
# Seconds of a quantile of a gamma distribution, which SciPy finds by iteration; and
# the number of its integrals in a root.
_QUANTILE, _OF_A_ROOT = 1e-6, 16.0
_STILL = 1e-9  # displacement that stands for rest, in mean thresholds


def drawing(rig: Rig, count: int, blocks: int = 1) -> float:
    """Seconds to draw the contacts of each block at the start of a run."""
    still = rig.start.at_rest if isinstance(rig.start, FromSliding) else blocks
    from_lives = rig.interface.mechanisms - {"sliding_force", "on_arrest"}
    sliding = _DRAW[1 if from_lives else 2]
    strength = quantile(rig.interface)
    roots = 1.0 if from_lives else _OF_A_ROOT
    kinds = (
        (still, *_DRAW[0], strength),
        (blocks - still, *sliding, roots * strength),
    )
    return sum(n * (block + (each + more) * count) for n, block, each, more in kinds)


def quantile(interface: Interface) -> float:
    """Additional seconds of a quantile of these thresholds beyond that of others."""
    return _QUANTILE if isinstance(interface.thresholds, Gamma) else 0.0


def lifetimes_in(rig: Rig, course: Course) -> tuple[float, float]:
    """Approximate numbers of breaks, and of boxes, of a contact in a run, as in steady
    sliding at the drive's velocity.
    """
    lives, boxes = np.sum(
        [_lifetimes(rig.interface, piece) for piece in rig.drive.pieces], axis=0
    )
    return lives + course.shaken, boxes


def _lifetimes(interface: Interface, piece: Piece) -> tuple[float, float]:
    """Numbers of breaks of a contact in a piece of the drive, or at rest, and of its
    boxes in `kernels.thinning`.

    For any distribution of the time `C` from one attachment to the next, the number of
    attachments in a time `T`, with the first, is between one and two times
    ``T/<min(C, T)>`` (Erickson's inequality for renewal processes).
    """
    travel = travel_of(piece)
    duration = piece.duration
    delay = interface.delay
    rule = rule_of(interface)
    arrests = isinstance(delay, OnArrest)  # each slip ends in an arrest
    if rule is None or not (
        interface.activation
        or isinstance(interface.ageing, FixedGrowth)
        or interface.areas
    ):
        mean = interface.threshold_distribution.moment(1)
        away = 0.0 if arrests else delay.moment(1) * travel / duration
        return (
            travel / (mean + away) if math.isfinite(away) else min(travel / mean, 1.0)
        ), 0.0
    velocity = max(travel, _STILL) / duration
    start, reached, boxes = drawn_lives(interface, velocity)
    life = (reached - start) / velocity
    cycle = life if arrests else life + delay.sample(np.random.default_rng(0), _DRAWN)
    held = cycle[cycle > 0.0]
    attached = duration / np.minimum(held, duration).mean() if held.size else 1.0
    lives = float(max(attached - 1.0, np.mean(life < duration)))
    return lives, lives * boxes / _DRAWN


def drawn_lives(interface: Interface, velocity: float) -> tuple[Array, Array, int]:
    """Draw lives in steady sliding from a fixed seed: the stretchings at their start
    and their end, and their total number of boxes.
    """
    rng = np.random.default_rng(0)
    rule = rule_of(interface)
    start, strength = newborns(interface, _DRAWN, 1.0, rng, rng)
    if rule is None or velocity <= 0.0:
        return start, strength, 0
    return start, *lifetimes_of(rule, start, strength, velocity, rng)


def rule_of(interface: Interface) -> Rule | None:
    """Return the rule by which contacts break, unless each has a constant threshold of
    its own.
    """
    if (
        interface.activation is None
        and interface.ageing is None
        and interface.areas is None
    ):
        return None
    return Rule(
        hazard_of(interface.activation),
        growth_of(interface.ageing),
        interface.areas is not None,
    )


def lifetimes_of(
    rule: Rule,
    start: Array,
    strength: Array,
    velocity: float,
    rng: np.random.Generator,
) -> tuple[Array, int]:
    """Draw the stretchings at which newborn contacts break in steady sliding; return
    also the total number of their boxes.
    """
    reached = np.empty(strength.size)
    done = 0
    boxes = 0
    drawn = max(16 * strength.size, 2**14)
    # each turn has draws for 16 boxes of each contact
    turns = bounded("lifetimes_of", strength.size + HALVINGS)
    while done < strength.size:
        next(turns)
        more = lifetimes(
            rule,
            start[done:],
            strength[done:],
            velocity,
            rng.random(drawn),
            reached[done:],
        )
        done = done + more[0]
        boxes = boxes + more[1]
    return reached, boxes
