"""N contacts under a slider whose thresholds age by a Langevin equation, sampled in
time steps; see `langevin`.

At a temperature, contacts also break before they meet their thresholds.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import inlined, jit
from .hazard import Hazard, log_rate, rate
from .langevin import Langevin
from .oscillator import Load
from .records import Floats
from .time_steps import (
    COLUMNS,
    LOSS,
    Course,
    Stroke,
    attached_now,
    begin,
    fill,
    goes_on,
    keep,
    plan,
    settle,
)

# Relaxation times of the reflected margin, noise/drift^2, after which its start is
# forgotten to exp(-FORGOTTEN/2).
FORGOTTEN = 16.0

# Most breaks of a contact, or steps of its own, in one common step. Newborns of a
# millionth of the threshold break some ten thousand times.
_MOST_TURNS = 10_000_000
_TOO_MANY_BREAKS = (
    "Contacts: a contact breaks more than 10,000,000 times in one step; give "
    "Langevin.newborn = 0 or a larger one"
)
# A contact sleeps until the slider has moved by a third of its margin, or for this
# fraction of margin^2/noise: in that time the other two thirds are four standard
# deviations of its threshold.
SLEEP = (2.0 / 3.0 / 4.0) ** 2

# Largest step of a free oscillation of the slider, in radians.
_ANGLE = 0.7

# largest change of the logarithm of the rate in a step of a contact near breaking, and
# largest standard deviation of that logarithm
FINE = 0.5
_SELDOM = 1e-6  # a step in which fewer breaks are expected may exceed `FINE`


class AgeingContacts(NamedTuple):
    """Contacts one by one; contacts far from breaking sleep and are not updated until a
    set time.
    """

    stretching: Floats  # shape (N,): less the position of the slider
    threshold: Floats
    attach: Floats  # when they attach; -inf for attached contacts
    seen: Floats  # the time at which `threshold` was computed
    until: Floats  # they are updated from this time on,
    room: Floats  # shape (N, 2): or once the slider leaves this range
    total: Floats  # shape (1,): sum of the stretchings of attached contacts


class _Step(NamedTuple):
    """Numbers of a step of length `dt` that are the same for all contacts."""

    dt: float
    v: float
    drift: float  # of a margin near the boundary
    noise: float  # noise strength of the margin, ``<dy^2>/dt``
    decay: float  # factor by which deviations of thresholds from their mean decay
    sigma: float
    # of the bridge in the clock that makes an Ornstein-Uhlenbeck process a Brownian
    # motion
    variance: float
    certain: float  # a margin below this meets 0 by the end of the step for certain
    # whether there are so many lifetimes in a step that the moment of the first break
    # does not matter
    forgotten: bool
    young: bool  # whether thresholds near the boundary are driven towards it


@jit
def _inverse_gaussian(mu: float, shape: float, rng: np.random.Generator) -> float:
    """Draw an inverse Gaussian number of given mean `mu` (may be huge) and shape, after
    Michael, Schucany and Haas.
    """
    z = rng.standard_normal()
    q = 0.5 * mu * z * z / shape
    x = mu / (1.0 + q + float(np.sqrt(q * (2.0 + q))))
    if rng.random() * (mu + x) > mu:
        return mu * mu / x
    return x


@jit
def crossing(
    start: float,
    end: float,
    variance: float,
    rng: np.random.Generator,
) -> float:
    """Draw the fraction of a step after which a Brownian bridge of the margin first
    meets zero, given that it does.

    The bridge is a Brownian motion with drift in the clock ``t/(1-t)``, whose first
    passage time is inverse Gaussian.
    """
    if start <= 0.0:
        return 0.0
    clock = _inverse_gaussian(
        start / max(abs(end), 1e-12 * start),
        start * start / variance,
        rng,
    )
    return clock / (1.0 + clock)


@inlined
def reflected(
    start: float,
    drift: float,
    noise: float,
    time: float,
    rng: np.random.Generator,
) -> tuple[float, float]:
    """Draw the margin, after a time, of a contact that re-attaches on its boundary
    whenever it meets it; return it and the contact's age.

    The margin is a Brownian motion with drift, reflected at 0: free motion minus its
    running minimum where that is below 0. It is sampled exactly, by the distribution of
    the minimum of a bridge, so that a step may contain any number of breaks. The time
    since the last visit to 0 is the time since the minimum. Its mean is returned, given
    the margin: the forces need no more, and the two passage times (before the minimum
    and after it) divide the step in proportion to their depths. The age is -1 if the
    contact has not broken.
    """
    variance = noise * time
    if variance <= 0.0:
        free = start + drift * time
        if free > 0.0:
            return free, time if start == 0.0 else -1.0
        return 0.0, 0.0
    if start == 0.0 and drift < 0.0 and drift * drift * time > FORGOTTEN * noise:
        # Stationary: the minimum of an endless past, and the first passage backwards
        # from the margin to it.
        margin = -0.5 * noise / drift * rng.standard_exponential()
        return margin, -margin / drift
    free = drift * time + np.sqrt(variance) * rng.standard_normal()
    down = 0.5 * (
        np.sqrt(free * free + 2.0 * variance * rng.standard_exponential()) - free
    )
    if down < start:
        return start + free, -1.0
    margin = max(free + down, 0.0)
    return margin, time * margin / (down + margin) if margin > 0.0 else 0.0


@inlined
def _drift(
    langevin: Langevin,
    noise: float,
    speed: float,
    time: float,
) -> float:
    """Return the constant drift of the margin that replaces
    ``rate^2 (mean - f) - speed`` near the boundary.

    The threshold ``f`` of a contact near its boundary is small, not 0. At times much
    longer than the relaxation time noise/drift^2 its effect on the force is that of
    2.25 mean margins and 2.8 mean stretchings, the first order of the stationary
    kinetic equation at large speed; after a short time it is that of the growth so far.
    """
    square = langevin.rate * langevin.rate
    drift = square * langevin.mean - speed
    if drift >= 0.0:
        margin = 0.7 * np.sqrt(noise * time)
        stretching = 0.5 * speed * time
    else:
        margin = 1.0 / (
            1.0 / (0.7 * np.sqrt(noise * time)) - 2.0 * drift / (2.25 * noise)
        )
        stretching = speed / (2.0 / time + 2.0 * drift * drift / (2.8 * noise))
    return drift - square * float(margin + stretching)


@jit
def _prepare(langevin: Langevin, stroke: Stroke) -> _Step:
    """Return the numbers of a step that do not depend on the contact."""
    mean = langevin.mean
    std = langevin.std
    dt = stroke.dt
    square = langevin.rate * langevin.rate
    v = stroke.dX / dt
    decay = np.exp(-square * dt)
    noise = 2.0 * square * std * std
    fall = abs(v) - square * mean
    sigma = std * np.sqrt(1.0 - decay * decay)
    variance = 2.0 * std * std * np.sinh(square * dt)
    forgotten = (
        langevin.newborn <= 0.0 and fall > 0.0 and fall * fall * dt > FORGOTTEN * noise
    )
    certain = fall * dt - 6.0 * np.sqrt(noise * dt) if forgotten else -1.0
    young = langevin.newborn <= 0.0 and fall > 2.0 * square * mean
    drift = _drift(langevin, noise, abs(v), dt)
    return _Step(dt, v, drift, noise, decay, sigma, variance, certain, forgotten, young)


@inlined
def aged_threshold(
    f: float,
    time: float,
    langevin: Langevin,
    rng: np.random.Generator,
) -> float:
    """Draw the threshold a `time` later, by the exact Ornstein-Uhlenbeck step."""
    e = np.exp(-langevin.rate * langevin.rate * time)
    return float(
        langevin.mean
        + (f - langevin.mean) * e
        + langevin.std * np.sqrt(1.0 - e * e) * rng.standard_normal()
    )


@inlined
def _live(
    x: float,
    f: float,
    left: float,
    step: _Step,
    langevin: Langevin,
    delays: Floats,
    rng: np.random.Generator,
) -> tuple[float, float, float]:
    """Return stretching and threshold of a contact at the end of a step of which a time
    `left` remains, after all its breaks.

    The third number is 0, or below 0 if the contact has broken: minus the time after
    the end at which it re-attaches.
    """
    mean = langevin.mean
    std = langevin.std
    newborn = langevin.newborn
    square = langevin.rate * langevin.rate
    v = step.v
    for _ in range(_MOST_TURNS):
        if not left > 0.0:
            return x, f, left
        if left == step.dt:
            e = step.decay
            sigma = step.sigma
            variance = step.variance
        else:
            e = np.exp(-square * left)
            sigma = std * np.sqrt(1.0 - e * e)
            variance = 2.0 * std * std * np.sinh(square * left)
        new_x = x + v * left
        new_f = mean + (f - mean) * e + sigma * rng.standard_normal()
        margin = max(f - abs(x), 0.0)
        new_margin = new_f - abs(new_x)
        if new_margin > 0.0:
            hidden = 2.0 * margin * new_margin / variance
            if hidden > 40.0 or rng.standard_exponential() < hidden:
                return new_x, new_f, 0.0
        if newborn > 0.0:
            left *= 1.0 - crossing(margin, new_margin, variance, rng)
            left -= delays[int(rng.random() * delays.size)]
            x = 0.0
            f = newborn
        else:
            if not step.forgotten:
                left *= 1.0 - crossing(margin, new_margin, variance, rng)
            margin, age = reflected(
                0.0,
                _drift(langevin, step.noise, abs(v), left),
                step.noise,
                left,
                rng,
            )
            x = v * age
            return x, abs(x) + margin, 0.0
    raise RuntimeError(_TOO_MANY_BREAKS)


@inlined
def _at_once(
    hazard: Hazard,
    langevin: Langevin,
    x: float,
    f: float,
    v: float,
    left: float,
) -> float:
    """Return the longest part of the remaining time in which a contact may be followed
    in one step.
    """
    square = langevin.rate * langevin.rate
    noise = 2.0 * square * langevin.std * langevin.std
    h = left
    # ends: half a step is accepted at the latest when it is 0
    while True:
        far = abs(x) + abs(v) * h
        low = f - 4.0 * math.sqrt(noise * h) - square * max(f - langevin.mean, 0.0) * h
        if low > far and rate(hazard, far, low) * h < _SELDOM:
            return h
        _, along, hard = log_rate(hazard, abs(x), max(f, abs(x)))
        coarse = noise * h * hard * hard > FINE * FINE or abs(v) * h * abs(along) > FINE
        if not coarse:
            return h
        h *= 0.5


@inlined
def _live_hot(
    x: float,
    f: float,
    left: float,
    v: float,
    langevin: Langevin,
    hazard: Hazard,
    delays: Floats,
    rng: np.random.Generator,
) -> tuple[float, float, float]:
    """Follow a contact as `_live` does, at a temperature: it breaks at a rate that
    depends on its present, noisy threshold.

    A contact breaks where the integral of the rate along its own path reaches a number
    drawn from ``exp(-E)``, or where it meets its threshold. It takes steps of its own:
    one long step far from breaking; near it, steps in which the logarithm of the rate
    changes by no more than `FINE`. The threshold at the end of each is exact; within it
    the rate is an exponential in time, times a factor for the noise of the threshold.
    """
    mean = langevin.mean
    std = langevin.std
    square = langevin.rate * langevin.rate
    for _ in range(_MOST_TURNS):
        if not left > 0.0:
            return x, f, min(left, 0.0)
        h = _at_once(hazard, langevin, x, f, v, left)
        decay = math.exp(-square * h)
        new_x = x + v * h
        new_f = (
            mean
            + (f - mean) * decay
            + std * math.sqrt(1.0 - decay * decay) * rng.standard_normal()
        )
        variance = 2.0 * std * std * math.sinh(square * h)
        margin = max(f - abs(x), 0.0)
        new_margin = new_f - abs(new_x)
        met = np.inf
        if (
            new_margin <= 0.0
            or rng.standard_exponential() * variance > 2.0 * margin * new_margin
        ):
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
            x = new_x
            f = new_f
            left = left - h
            continue
        left -= broken + delays[int(rng.random() * delays.size)]
        x = 0.0
        f = langevin.newborn
    raise RuntimeError(_TOO_MANY_BREAKS)


@inlined
def _sleep(
    contacts: AgeingContacts,
    i: int,
    until: float,
    X: float,
    third: float,
) -> None:
    """Let a contact sleep until a time, or until the slider has moved by a third of its
    margin from `X`.
    """
    contacts.until[i] = until
    contacts.room[i, 0] = X - third
    contacts.room[i, 1] = X + third


@inlined
def _falls_asleep(
    contacts: AgeingContacts,
    i: int,
    f: float,
    stroke: Stroke,
    mean: float,
    noise: float,
) -> bool:
    """Return whether a contact that was woken may sleep on with its present threshold
    `f`; if so, let it.
    """
    margin = f - abs(contacts.stretching[i] + stroke.X) - max(f - mean, 0.0)
    is_far = margin > 3.0 * abs(stroke.dX)
    if not is_far or SLEEP * margin * margin <= noise * stroke.dt:
        return False
    contacts.threshold[i] = f
    contacts.seen[i] = stroke.time
    until = stroke.time + SLEEP * margin * margin / noise
    _sleep(contacts, i, until, stroke.X, margin / 3.0)
    return True


@inlined
def _step_one(
    x: float,
    f: float,
    left: float,
    stroke: Stroke,
    step: _Step,
    langevin: Langevin,
    hazard: Hazard,
    delays: Floats,
    rng: np.random.Generator,
) -> tuple[float, float, float]:
    """Return stretching and threshold of a contact at the end of a step, by the fastest
    method that is exact for it; see `_live`.
    """
    mean = langevin.mean
    v = step.v
    noise = step.noise
    if hazard.attempts > 0.0:
        return _live_hot(x, f, left, v, langevin, hazard, delays, rng)
    margin = f - abs(x)
    if margin < step.certain:
        margin, age = reflected(0.0, step.drift, noise, stroke.dt, rng)
        x = v * age
        return x, abs(x) + margin, 0.0
    if step.young and f < 0.1 * mean and x * v >= 0.0 and left == stroke.dt:
        # Near the boundary and driven towards it, the drift is nearly constant: one
        # sample covers the whole step.
        square = langevin.rate * langevin.rate
        drift = min(step.drift, square * (mean - f) - abs(v))
        margin, age = reflected(max(margin, 0.0), drift, noise, stroke.dt, rng)
        x = v * age if age >= 0.0 else x + stroke.dX
        return x, abs(x) + margin, 0.0
    return _live(x, f, left, step, langevin, delays, rng)


@jit
def _age(
    contacts: AgeingContacts,
    stroke: Stroke,
    langevin: Langevin,
    hazard: Hazard,
    delays: Floats,
    rng: np.random.Generator,
) -> tuple[float, int]:
    """Advance all contacts by one step of the slider; stretchings are stored minus the
    position of the slider.

    Returns by how much breaking has reduced the sum of all stretchings, and how many
    more contacts are attached.
    """
    step = _prepare(langevin, stroke)
    mean = langevin.mean
    base = contacts.stretching
    threshold = contacts.threshold
    attach = contacts.attach
    now = stroke.time
    noise = step.noise
    end = now + stroke.dt
    new_X = stroke.X + stroke.dX
    lost = 0.0
    more = 0
    for i in range(base.size):
        is_within = contacts.room[i, 0] <= new_X <= contacts.room[i, 1]
        if end <= contacts.until[i] and is_within:
            continue
        if attach[i] <= now:
            left = stroke.dt
            x = base[i] + stroke.X
            f = threshold[i]
            if contacts.seen[i] < now:
                f = aged_threshold(f, now - contacts.seen[i], langevin, rng)
                if _falls_asleep(contacts, i, f, stroke, mean, noise):
                    continue
            lost += x + stroke.dX
            more -= 1
        else:
            left = end - attach[i]
            x = 0.0
            f = langevin.newborn
            if left < 0.0:
                continue
        x, f, left = _step_one(x, f, left, stroke, step, langevin, hazard, delays, rng)
        if left < 0.0:
            attach[i] = end - left
            _sleep(contacts, i, end - left, new_X, np.inf)
            continue
        lost -= x
        more += 1
        attach[i] = -np.inf
        base[i] = x - new_X
        threshold[i] = f
        contacts.seen[i] = end
        margin = f - abs(x) - max(f - mean, 0.0)
        if margin > 0.0 and hazard.attempts == 0.0:
            until = end + SLEEP * margin * margin / noise if noise > 0.0 else np.inf
            _sleep(contacts, i, until, new_X, margin / 3.0)
        else:
            contacts.until[i] = -np.inf
    return lost, more


def awake(
    stretching: Floats,
    threshold: Floats,
    attach: Floats,
    time: float,
    X: float,
) -> AgeingContacts:
    """Return contacts that are all awake, with the slider at `X`."""
    total, _ = attached_now(stretching, attach, time)
    waits = attach > time
    room = np.zeros((attach.size, 2))
    room[waits] = -np.inf, np.inf
    until = np.where(waits, attach, -np.inf)
    return AgeingContacts(
        stretching - X,
        threshold,
        attach,
        np.full(attach.size, time),
        until,
        room,
        np.array([total]),
    )


@jit
def advance_contacts(
    state: Floats,
    contacts: AgeingContacts,
    course: Course,
    langevin: Langevin,
    hazard: Hazard,
    delays: Floats,
    rng: np.random.Generator,
) -> Floats:
    """Advance N ageing contacts and the slider along a course, Eqs. (11) and (13)-(16);
    return the samples.

    Per contact and step: an exact Ornstein-Uhlenbeck step of the threshold, a
    Brownian-bridge test for breaking inside the step, the exact distribution of the
    moment of breaking, and for contacts that attach on their boundary the exact
    distribution of the margin after any number of breaks (`reflected`). With a longest
    step of ``0.04/rate^2`` the force in steady motion has converged to 2e-3, for a
    reach of 0.02 mean thresholds with a slider and inf in steady rigid motion. `state`
    (see `time_steps`) and `contacts` (at first those of `awake`) are changed; each
    break draws one of the `delays`, which are ``[0.]`` for none. With a delay, or at a
    temperature (a `hazard`), newborns must have strength.
    """
    n = contacts.stretching.size
    here = begin(course, state)
    total = contacts.total[0]
    _, count = attached_now(contacts.stretching, contacts.attach, here.time)
    samples = np.empty((course.times.size, COLUMNS))
    load = Load(total / n, count / n, state[LOSS], 0.0)
    filled = fill(course, samples, 0, here, load, here.time, count / n)
    taken = 0
    while goes_on(course, samples, filled, taken):
        guess, stroke = plan(course, filled, here, load, _ANGLE)
        if stroke.end > course.look:
            break
        taken += 1
        lost, more = _age(contacts, stroke, langevin, hazard, delays, rng)
        total += count * stroke.dX - lost
        count += more
        load = Load(load.force, load.stiffness, lost / (n * stroke.dt), 0.0)
        there = settle(course, here, guess, load, stroke.dt)
        total += count * (there.X - guess.X)
        filled = fill(course, samples, filled, here, load, there.time, count / n)
        here = there
        load = Load(total / n, count / n, load.loss, 0.0)
    keep(state, here, load.loss)
    contacts.total[0] = total
    return samples[:filled]
