"""A velocity step of contacts that break by Bell activation, by cohorts: one number each, no delay, no mass."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import inlined, jit
from .growth import Growth
from .hazard import Hazard
from .thermal_cohorts import gained_evenly

Floats = NDArray[np.float64]

_TRIES = 60
"""Lengths that a step is tried with; four are enough as a rule."""


class Contacts(NamedTuple):
    """How contacts break: `Bell` activation, `FIXED` or `LOGARITHMIC` growth."""

    hazard: Hazard
    growth: Growth
    survival: Floats  # of newborns, over ``u = A ln G`` from `first` on in steps of `spacing`
    first: float
    spacing: float


@inlined
def _survival(contacts: Contacts, u: float) -> float:
    """Survival over ``u = A ln G``, by the cubic through four points."""
    table, place = contacts.survival, (u - contacts.first) / contacts.spacing
    if place <= 1.0:
        return 1.0
    k = int(place)
    if k >= table.size - 2:
        return 0.0
    t = place - k
    return float(
        -t * (t - 1.0) * (t - 2.0) / 6.0 * table[k - 1]
        + (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0 * table[k]
        - (t + 1.0) * t * (t - 2.0) / 2.0 * table[k + 1]
        + (t + 1.0) * t * (t - 1.0) / 6.0 * table[k + 2]
    )


@jit
def step(
    contacts: Contacts,
    stretching: Floats,
    reached: Floats,
    before: float,
    after: float,
    stiffness: float,
    dX: float,
    steps: int,
) -> Floats:
    """Force, load point and time after a step of the velocity of the load point, shape (3, steps + 1).

    From steady sliding: contacts at the step were born at an even rate: stretching, and ``A ln G``. NaN from where no
    balance was found.
    """
    m, rigid, A = stretching.size, np.isinf(stiffness), contacts.hazard.scale
    hazard, growth = contacts.hazard, contacts.growth
    birth, G, age, share = np.empty(m + steps), np.empty(m + steps), np.empty(m + steps), np.empty(m + steps)
    G_new = np.empty(m + steps)
    birth[:m], G[:m], share[:m], age[:m] = -stretching, reached, 1.0, stretching / before
    found = np.zeros((3, steps + 1))
    force, count, oldest = 0.0, 0.0, 0
    for i in range(m):
        held = share[i] * _survival(contacts, G[i])
        force += held * stretching[i]
        count += held
    share[:m] /= count  # contacts there are one each
    force /= count
    start, dt = force, dX / after
    found[0, 0] = force
    n = m
    for k in range(steps):
        X, lead, time = k * dX, found[1, k], found[2, k]
        tried, wrong_before, balanced = 0.0, 0.0, rigid
        for attempt in range(1 if rigid else _TRIES):
            held, work = 0.0, 0.0
            for i in range(oldest, n):
                x = X - birth[i]
                gain = A * gained_evenly(hazard, growth, age[i], dt, x, dX)
                high, low = max(gain, G[i]), min(gain, G[i])
                G_new[i] = high + A * np.log1p(np.exp((low - high) / A))
                left = share[i] * _survival(contacts, G_new[i])
                held += left
                work += left * (x + dX)
            young = A * gained_evenly(hazard, growth, 0.0, 0.5 * dt, 0.0, 0.5 * dX)
            work += (1.0 - held) * 0.5 * dX
            if rigid:
                break
            # Spring: the load point has gone on by `after dt` meanwhile.
            wrong = start + stiffness * (lead + after * dt - X - dX) - work
            if abs(wrong) < 1e-10 or (attempt > 0 and abs(dt - tried) < 1e-13 * dt):
                balanced = True
                break
            slope = stiffness * after if attempt == 0 else (wrong - wrong_before) / (dt - tried)
            tried, wrong_before = dt, wrong
            dt = min(max(dt - wrong / slope, 0.2 * dt), 5.0 * dt)
        if not balanced:
            found[:, k + 1 :] = np.nan
            break
        for i in range(oldest, n):
            G[i] = G_new[i]
            age[i] += dt
        while oldest < n and _survival(contacts, G[oldest]) == 0.0 and birth[oldest] <= birth[n - 1]:
            oldest += 1
        birth[n], G[n], age[n] = X + 0.5 * dX, young, 0.5 * dt
        share[n] = (1.0 - held) / _survival(contacts, young)
        n += 1
        found[0, k + 1], found[1, k + 1], found[2, k + 1] = work, lead + after * dt, time + dt
    return found
