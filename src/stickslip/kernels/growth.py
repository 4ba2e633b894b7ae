"""N contacts whose thresholds grow with age in a given way, in steps of time, under a slider."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import inlined, jit
from .oscillator import Load
from .stepping import COLUMNS, LOSS, Course, Stroke, attached_now, begin, fill, goes_on, keep, plan, settle

Floats = NDArray[np.float64]

EXPONENTIAL = 0
LOGARITHMIC = 1

# Largest step of a free oscillation of the slider, in radians.
_ANGLE = 0.35


class Growth(NamedTuple):
    """How thresholds grow with age.

    `kind` `EXPONENTIAL`: from a newborn's threshold to the strength, ``f = s - (s - second) exp(-first age)``;
    `LOGARITHMIC`: from the strength, ``f = s + first ln(1 + age/second)``; any other: not at all.
    """

    kind: int
    first: float
    second: float


class Growing(NamedTuple):
    """Stretchings, strengths, and the times from which contacts hold or will hold, shape (N,).

    The age of a contact is the time since the latter.
    """

    stretching: Floats
    strength: Floats
    attach: Floats


@jit
def grown(growth: Growth, age: float) -> tuple[float, float]:
    """Factor and addend of a growing threshold: ``f(age) = strength factor + addend``."""
    if growth.kind == EXPONENTIAL:
        young = np.exp(-growth.first * age)
        return 1.0 - young, growth.second * young
    return 1.0, growth.first * np.log1p(age / growth.second) if growth.kind == LOGARITHMIC else 0.0


@inlined
def _holds(x: float, strength: float, age: float, growth: Growth) -> bool:
    """Whether a contact of this stretching and age holds."""
    factor, addend = grown(growth, age)
    return abs(x) < strength * factor + addend


@inlined
def _live(
    contacts: Growing,
    i: int,
    stroke: Stroke,
    growth: Growth,
    pool: Floats,
    delays: Floats,
    rng: np.random.Generator,
    hopeless: bool,
) -> bool:
    """Take a contact through a step, whatever breaks in it; whether it is attached at the end.

    `hopeless`: even the strongest newborn breaks as soon as it attaches.

    The velocity is constant: the margin is concave in time, so a contact breaks in the step exactly if its margin is
    below 0 at the end, at a moment found by bisection.
    """
    strength, attach = contacts.strength, contacts.attach
    v, end = stroke.dX / stroke.dt, stroke.end
    x, start, tries = contacts.stretching[i], stroke.time, 0
    unready = growth.kind == EXPONENTIAL and growth.second <= 0.0
    if attach[i] > start:
        if attach[i] >= end:
            return False
        x, start = 0.0, attach[i]
    while start < end:
        if _holds(x + v * (end - start), strength[i], end - attach[i], growth):
            x += v * (end - start)
            start = end
            break
        low, high = start, end
        # A threshold that grows from 0 more slowly than the stretching never leads it.
        at_once = x == 0.0 and attach[i] == start and unready and strength[i] * growth.first <= abs(v)
        if at_once:
            high = start
        for _ in range(0 if at_once else 40):
            middle = 0.5 * (low + high)
            if _holds(x + v * (middle - start), strength[i], middle - attach[i], growth):
                low = middle
            else:
                high = middle
        x = 0.0
        strength[i] = pool[int(rng.random() * pool.size)]
        start = high + delays[int(rng.random() * delays.size)]
        attach[i] = start
        tries += 1
        if (tries > 100 or hopeless) and attach[i] < end:  # breaks as soon as it attaches
            attach[i] = start = end
    contacts.stretching[i] = x
    return bool(start == end)


@jit
def advance_growing(
    state: Floats,
    contacts: Growing,
    course: Course,
    growth: Growth,
    pool: Floats,
    delays: Floats,
    rng: np.random.Generator,
) -> Floats:
    """Advance N contacts whose thresholds grow with age, and the slider of Eq. (11).

    Parameters
    ----------
    state : ndarray, shape (4,)
        Time, X, V, loss per time (see `stepping`); changed in place.
    contacts : Growing
        Changed in place.
    course : Course
    growth : Growth
    pool : ndarray, shape (p,)
        Strengths of newborns, one drawn at random for each.
    delays : ndarray, shape (d,)
        Delays after breaking, one drawn at random for each break; ``[0.]`` for none.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (n, 5)
        X, V, F_d, F_c, fraction of attached contacts. At the times that were reached.
    """
    n, x, attach = contacts.stretching.size, contacts.stretching, contacts.attach
    unready, strongest = growth.kind == EXPONENTIAL and growth.second <= 0.0, np.max(pool)
    here = begin(course, state)
    total, count = attached_now(x, attach, here.time)
    samples = np.empty((course.times.size, COLUMNS))
    load = Load(total / n, count / n, state[LOSS], 0.0)
    filled, taken = fill(course, samples, 0, here, load, here.time, count / n), 0
    while goes_on(course, samples, filled, taken):
        guess, stroke = plan(course, filled, here, load, _ANGLE)
        if stroke.end > course.look:
            break
        taken += 1
        hopeless = bool(unready and strongest * growth.first <= abs(stroke.dX / stroke.dt))
        total, count = 0.0, 0
        for i in range(n):
            if _live(contacts, i, stroke, growth, pool, delays, rng, hopeless):
                total += x[i]
                count += 1
        loss = (load.force + load.stiffness * stroke.dX - total / n) / stroke.dt
        load = Load(load.force, load.stiffness, loss, 0.0)
        there = settle(course, here, guess, load, stroke.dt)
        total = 0.0
        for i in range(n):
            if attach[i] <= there.time:
                x[i] += there.X - guess.X
                total += x[i]
        filled = fill(course, samples, filled, here, load, there.time, count / n)
        here, load = there, Load(total / n, count / n, loss, 0.0)
    keep(state, here, load.loss)
    return samples[:filled]
