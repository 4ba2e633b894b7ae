"""N contacts whose thresholds age by a Langevin equation and that break by temperature before they meet them.

The rate of breaking follows the threshold of the moment, which is noisy: a contact breaks where the integral of the
rate along its own path reaches a number drawn from ``exp(-E)``, or where it meets its threshold. Each contact takes
steps of its own within a step of the slider: far from breaking one long step, near it steps in which the logarithm of
the rate changes by no more than `FINE`. The threshold at the end of a step is exact; within it the rate goes as an
exponential, times what the noise adds to its mean.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ._jit import inlined, jit
from .hazard import Hazard, log_rate, rate
from .langevin import Langevin
from .langevin_contacts import Contacts, crossing
from .oscillator import Load
from .stepping import COLUMNS, LOSS, Course, attached_now, begin, fill, goes_on, keep, plan, settle

Floats = NDArray[np.float64]

FINE = 0.5
"""Change of the logarithm of the rate in a step near breaking, and its standard deviation."""
_SELDOM = 1e-6
"""Breaks that may be expected in a step that is not as fine."""
_ANGLE = 0.7
"""Largest step of a free oscillation of the slider, in radians."""


@inlined
def _step(hazard: Hazard, langevin: Langevin, x: float, f: float, v: float, left: float) -> float:
    """How long a contact may be followed at once, of the time that is left."""
    square = langevin.rate * langevin.rate
    noise = 2.0 * square * langevin.std * langevin.std
    h = left
    while True:
        far = abs(x) + abs(v) * h
        low = f - 4.0 * math.sqrt(noise * h) - square * max(f - langevin.mean, 0.0) * h
        if low > far and rate(hazard, far, low) * h < _SELDOM:
            return h
        _, along, hard = log_rate(hazard, abs(x), max(f, abs(x)))
        if noise * h * hard * hard <= FINE * FINE and abs(v) * h * abs(along) <= FINE:
            return h
        h *= 0.5


@inlined
def _live(
    x: float,
    f: float,
    left: float,
    v: float,
    langevin: Langevin,
    hazard: Hazard,
    delays: Floats,
    rng: np.random.Generator,
) -> tuple[float, float, float]:
    """Stretching and threshold at the end of a step of which a time `left` is left, whatever breaks in it.

    Below 0, `left` says how long after the end a contact that has broken is attached again.
    """
    mean, std, square = langevin.mean, langevin.std, langevin.rate * langevin.rate
    while left > 0.0:
        h = _step(hazard, langevin, x, f, v, left)
        decay = math.exp(-square * h)
        new_x = x + v * h
        new_f = mean + (f - mean) * decay + std * math.sqrt(1.0 - decay * decay) * rng.standard_normal()
        variance = 2.0 * std * std * math.sinh(square * h)
        margin, new_margin = max(f - abs(x), 0.0), new_f - abs(new_x)
        met = np.inf
        if new_margin <= 0.0 or rng.standard_exponential() * variance > 2.0 * margin * new_margin:
            met = h * crossing(margin, new_margin, variance, rng)
        here, _, hard = log_rate(hazard, abs(x), max(f, abs(x)))
        there = log_rate(hazard, abs(new_x), max(new_f, abs(new_x)))[0]
        pace = hazard.attempts * math.exp(here) * (1.0 + variance * hard * hard / 12.0)
        wait = rng.standard_exponential() / max(pace, 1e-300)
        rise = (there - here) / h
        if abs(rise) * h > 1e-9:
            grown = rise * wait
            wait = math.log1p(grown) / rise if grown > -1.0 else np.inf
        broken = min(met, wait)
        if broken >= h:
            x, f, left = new_x, new_f, left - h
            continue
        left -= broken + delays[int(rng.random() * delays.size)]
        x, f = 0.0, langevin.newborn
    return x, f, min(left, 0.0)


@jit
def advance_contacts(
    state: Floats,
    contacts: Contacts,
    course: Course,
    langevin: Langevin,
    hazard: Hazard,
    delays: Floats,
    rng: np.random.Generator,
) -> Floats:
    """Advance N ageing contacts at a temperature and the slider to the last of the course's times.

    Parameters
    ----------
    state, contacts, course, langevin, delays, rng
        As those of `langevin_contacts.advance_contacts`; newborns must have strength.
    hazard : Hazard
        Rate of breaking.

    Returns
    -------
    ndarray, shape (n, 5)
        The same samples.
    """
    x, threshold, attach = contacts.stretching, contacts.threshold, contacts.attach
    n = x.size
    here = begin(course, state)
    total, count = attached_now(x, attach, here.time)
    samples = np.empty((course.times.size, COLUMNS))
    load = Load(total / n, count / n, state[LOSS], 0.0)
    filled = fill(course, samples, 0, here, load, here.time, count / n)
    while goes_on(course, samples, filled):
        guess, stroke = plan(course, filled, here, load, _ANGLE)
        v = stroke.dX / stroke.dt
        lost, more = 0.0, 0
        for i in range(n):
            left = stroke.dt
            if attach[i] <= stroke.time:
                lost += x[i] + stroke.dX
                more -= 1
            else:
                left, x[i], threshold[i] = stroke.end - attach[i], 0.0, langevin.newborn
                if left <= 0.0:
                    continue
            x[i], threshold[i], left = _live(x[i], threshold[i], left, v, langevin, hazard, delays, rng)
            if left < 0.0:
                attach[i] = stroke.end - left
                continue
            attach[i] = -np.inf
            lost -= x[i]
            more += 1
        total += count * stroke.dX - lost
        count += more
        load = Load(total / n, count / n, lost / (n * stroke.dt), 0.0)
        there = settle(course, here, guess, load, stroke.dt)
        further = there.X - guess.X
        for i in range(n):
            if attach[i] <= there.time:
                x[i] += further
        total += count * further
        filled = fill(course, samples, filled, here, load, there.time, count / n)
        here, load = there, Load(total / n, count / n, load.loss, 0.0)
    keep(state, here, load.loss)
    return samples[:filled]
