"""Successive slips of a slider that is driven infinitely slowly, in closed form.

This is the slow-drive limit with re-attachment on arrest. Between slips all contacts
are attached and the force rises until the first of them reaches its threshold. During a
slip the drive stands still; each broken contact slides with a constant residual
stretching, and re-attaches with it, and with a new threshold, when the slider first
stops. Between two breaks the slider is a damped oscillator on the driving spring and
the attached contacts, so that a slip is a short sequence of exact arcs without time
steps.

Natural units, everything per contact: contact stiffness 1, mean threshold 1. Neither
the mass nor the speed matters.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import jit
from .records import Counts, Floats
from .tournament import enter, smallest, winner
from .turning_points import PEAK, START, TROUGH, turn

_WARM = 5  # breaks of each contact before the first slip that counts
_STEPS = 60  # most steps of Newton's method and bisection
_TRIES = 100  # most draws of a threshold


class Arrest(NamedTuple):
    """Constants of contacts and slider: number of contacts, standard deviation of their
    thresholds, residual stretching, stiffness K/N of the driving spring.

    `damping_ratio` is that of the free slider on the driving spring;
    `slip_to_slip_scatter` is the standard deviation of the factor that all thresholds
    drawn in one slip share.
    """

    contacts: int
    std: float
    residual: float
    stiffness: float
    damping_ratio: float
    slip_to_slip_scatter: float


@jit
def _threshold(
    rng: np.random.Generator,
    std: float,
    factor: float,
    least: float,
) -> float:
    """Draw a threshold above the stretching `least` at attachment; return `least`, so
    that the contact breaks at once, if the track is too weak.
    """
    for _ in range(_TRIES):
        value: float = factor * (1.0 + std * rng.normal())
        if value > least:
            return value
    return least


@jit
def _arc(
    velocity: float,
    force: float,
    stiffness: float,
    ratio: float,
    distance: float,
) -> tuple[float, float, bool]:
    """Displacement and velocity of the slider after a distance, or at its first stop
    before that; and whether it stops.

    Time is in units of ``sqrt(M/K)``; the unbalanced force and its decrease per
    distance are in units of the stiffness K of the driving spring, whose damping ratio
    is `ratio`.
    """
    rest = force / stiffness  # displacement at which the slider would settle
    omega = math.sqrt(stiffness - ratio * ratio)
    across = (velocity - ratio * rest) / omega
    bend = ratio * across - rest * omega
    stop = math.atan2(velocity, bend) / omega
    if stop <= 0.0:
        return 0.0, 0.0, True
    oscillation = -rest * math.cos(omega * stop) + across * math.sin(omega * stop)
    furthest = rest + math.exp(-ratio * stop) * oscillation
    if furthest < distance:
        return max(furthest, 0.0), 0.0, True
    low = 0.0
    high = stop
    time = min(0.5 * stop, distance / velocity) if velocity > 0.0 else 0.5 * stop
    speed = 0.0
    for _ in range(_STEPS):
        c = math.cos(omega * time)
        s = math.sin(omega * time)
        decay = math.exp(-ratio * time)
        beyond = rest + decay * (across * s - rest * c) - distance
        speed = decay * (velocity * c - bend * s)
        if abs(beyond) <= 1e-13 * distance:
            break
        if beyond > 0.0:
            high = time
        else:
            low = time
        newer = time - beyond / speed if speed > 0.0 else -1.0
        if not low < newer < high:
            newer = 0.5 * (low + high)
        if newer == time:
            break
        time = newer
    return distance, max(speed, 0.0), False


@jit
def _attached_at_first(
    model: Arrest,
    rng: np.random.Generator,
    breaks_at: Floats,
) -> Floats:
    """Draw the positions at which contacts attached before the start, each at a random
    fraction of its threshold, and enter the positions at which they break.
    """
    count = model.contacts
    attached_at = np.empty(count)
    for i in range(count):
        threshold = _threshold(rng, model.std, 1.0, 0.0)
        attached_at[i] = -rng.random() * threshold
        enter(breaks_at, count, i, attached_at[i] + threshold)
    return attached_at


@jit
def _attach(
    model: Arrest,
    rng: np.random.Generator,
    factor: float,
    contacts: Counts,
    place: float,
    attached_at: Floats,
    breaks_at: Floats,
) -> None:
    """Attach contacts at a position, with new thresholds, and enter the positions at
    which they break.
    """
    for contact in contacts:
        attached_at[contact] = place
        threshold = _threshold(rng, model.std, factor, model.residual)
        enter(breaks_at, model.contacts, contact, place + threshold)


@jit
def _slip(
    model: Arrest,
    drive: float,
    X: float,
    total: float,
    attached_at: Floats,
    breaks_at: Floats,
    broken: Counts,
) -> tuple[float, float, int]:
    """Let the slider slip from `X` until it stops; list the broken contacts in
    `broken`.

    Returns the position at which it stops, the sum `total` over the remaining contacts,
    and the number of broken ones.
    """
    count = model.contacts
    kappa = model.stiffness
    residual = model.residual
    left = count
    loose = 0
    velocity = 0.0
    # ends: each turn breaks one of the contacts, until the slider stops
    while True:
        contact = winner(breaks_at, count)
        enter(breaks_at, count, contact, np.inf)
        broken[loose] = contact
        loose += 1
        left -= 1
        total -= attached_at[contact]
        distance = smallest(breaks_at) - X
        if distance <= 0.0:
            continue
        friction = left * X - total + residual * loose
        unbalanced = drive - X - friction / (count * kappa)
        stiffness = 1.0 + left / (count * kappa)
        travelled, velocity, stops = _arc(
            velocity,
            unbalanced,
            stiffness,
            model.damping_ratio,
            distance,
        )
        if stops:
            return X + travelled, total, loose
        X = smallest(breaks_at)


@jit
def slips(
    model: Arrest,
    floor: float,
    most: int,
    rng: np.random.Generator,
    peaks: Floats,
    troughs: Floats,
    breaks_at: Floats,
) -> int:
    """Fill in the force, per contact, before and after each slip; return the number of
    slips.

    Drops and rises smaller than the fraction `floor` of the preceding peak do not count
    as slips; at most `most` contacts break. `breaks_at` is working memory: a tournament
    of the positions of the slider at which the contacts break.
    """
    count = model.contacts
    kappa = model.stiffness
    residual = model.residual
    attached_at = _attached_at_first(model, rng, breaks_at)
    broken = np.empty(count, np.int64)
    total = attached_at.sum()
    # standard deviation of the logarithm of the factor, whose mean is 1
    track = math.sqrt(math.log1p(model.slip_to_slip_scatter**2))
    X = 0.0
    found = done = 0
    begun = False
    state = START
    while found < peaks.size and done < most:
        X = max(X, smallest(breaks_at))
        force = X - total / count
        drive = X + force / kappa
        low = floor * state.high if state.falling else floor * max(state.high, force)
        state = turn(state, 0, force, low, low)
        if state.found == TROUGH:
            if begun:
                troughs[found] = state.low
                found += 1
            begun = False

        X, total, loose = _slip(model, drive, X, total, attached_at, breaks_at, broken)
        factor = math.exp(track * (rng.normal() - 0.5 * track)) if track > 0.0 else 1.0
        _attach(
            model,
            rng,
            factor,
            broken[:loose],
            X - residual,
            attached_at,
            breaks_at,
        )
        if done // count != (done + loose) // count:
            # Sum again from time to time, so that rounding does not accumulate.
            total = attached_at.sum()
        else:
            total += loose * (X - residual)
        done += loose
        # after ringing down, with all contacts attached
        X = (kappa * drive + total / count) / (kappa + 1.0)
        force = kappa * (drive - X)
        low = floor * state.high
        state = turn(state, 0, force, low, low)
        if state.found == PEAK and done >= _WARM * count and found < peaks.size:
            peaks[found] = state.high
            begun = True
    return found
