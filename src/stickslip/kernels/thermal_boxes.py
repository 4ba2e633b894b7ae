"""N contacts that break by any hazard, event by event: by thinning, exact.

While a contact's stretching stays within a box, and for a time, its rate of breaking is at most that of the box. A
break is proposed at this rate, and accepted with the probability that the true rate has of it; where the contact leaves
its box before, or the time is over, or the proposal is rejected, it gets another box: wide where it seldom breaks,
narrow where it is about to, in view of how fast the slider is. Some ten boxes do for a life. Nothing is assumed about
how the slider moves: it may turn, slip and rest.

Sides of boxes and times wait in heaps (`heap`), one entry a contact.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .between_events import (
    BUDGET_SPENT,
    CONDITION_HELD,
    COUNTS,
    DRAWS_USED_UP,
    LOOK,
    LOOKED,
    MOTION,
    POSITION,
    REACHED_END,
    SLIDE,
    TIME,
    VELOCITY,
    Constants,
    Piece,
    Sampling,
    balance,
    constants,
    count_in,
    count_out,
    crossing,
    detached_edges,
    drive_now,
    fly,
    is_straight,
    sample_until,
    set_out,
    sum_again,
    turned,
    until_turning,
)
from .flight import at
from .growth import Growth
from .hazard import Hazard, ageing_time, largest_rate, rate, steepness, threshold_at
from .heap import Heap, first, make_heap, smallest, update
from .oscillator import Slider

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]
Records = NDArray[np.void]

# `threshold` is the strength, 0 for a detached contact, or minus that of its site if it keeps it; `since` the time of
# attachment; `most` the largest rate in the box, 0 if the time of the contact is that of the end of its box.
CONTACT = np.dtype([("birth", np.float64), ("threshold", np.float64), ("since", np.float64), ("most", np.float64)])

DRAWN, VARIED, DELAYED = range(COUNTS, COUNTS + 3)

NEED = 8
"""Variates that an event may need, at most."""
_CHANCE = 0.2
"""Proposals that a contact may expect on its way through a box."""


class Model(NamedTuple):
    """How contacts break and how their thresholds grow.

    `as_stiff`: contacts are as stiff as their thresholds are large; else of stiffness 1. `own`: contacts keep their
    strengths when they re-attach; else they draw new ones. `stiffest` is how stiff they may become, over their number.
    """

    hazard: Hazard
    growth: Growth
    as_stiff: bool = False
    own: bool = False
    stiffest: float = 1.0


class Draws(NamedTuple):
    """Random numbers in the order of use: thresholds, numbers between 0 and 1, delays; as in `thermal_clock`."""

    thresholds: Floats
    variates: Floats
    delays: Floats
    fixed_delay: float


class State(NamedTuple):
    """Contacts, what they wait for, and the motion.

    ``ahead`` is keyed by the position of the slider where a contact leaves its box forwards, ``behind`` by minus that
    where it does so backwards, ``times`` by the next proposal, the end of the box, or the re-attachment.
    """

    contacts: Records
    ahead: Heap
    behind: Heap
    times: Heap
    motion: Floats
    counts: Counts
    cuts: Floats


def make_state(
    birth: Floats, threshold: Floats, since: Floats, pending: Floats, velocity: float, as_stiff: bool = False
) -> State:
    """Return the state of an interface at time 0, the slider at 0; boxes are drawn as soon as it goes on.

    Parameters
    ----------
    birth, threshold, since : ndarray, shape (N,)
        Slider position at which each contact has no stretching, its strength (0 if it is detached, or minus what it
        keeps), and when it attached.
    pending : ndarray, shape (n,)
        Times of re-attachment of the last contacts, which are detached.
    velocity : float
        Of the slider.
    as_stiff : bool
        As in `Model`.
    """
    N = birth.size
    contacts = np.zeros(N, CONTACT)
    contacts["birth"], contacts["threshold"], contacts["since"] = birth, threshold, since
    nowhere = np.full(N, np.inf)
    times = np.where(threshold > 0, 0.0, np.inf)
    if pending.size:
        times[N - pending.size :] = pending
    state = State(
        contacts=contacts,
        ahead=make_heap(nowhere),
        behind=make_heap(nowhere),
        times=make_heap(times),
        motion=np.zeros(MOTION),
        counts=np.zeros(COUNTS + 3, np.int64),
        cuts=np.zeros(16),
    )
    state.motion[VELOCITY] = velocity
    sum_again(state.motion, state.counts, contacts, as_stiff)
    return state


class _Box(NamedTuple):
    """How far a contact may be stretched, for how long, and its largest rate there; `over`: it breaks at once."""

    reach: float
    time: float
    most: float
    over: bool


@inlined
def _box(model: Model, x: float, strength: float, age: float, speed: float) -> _Box:
    """Box of a contact that is stretched by ``|x|``, with the slider at this speed."""
    x = abs(x)
    threshold = threshold_at(model.growth, strength, age)
    if x >= threshold * (1.0 - 1e-13):
        return _Box(x, 0.0, 0.0, True)
    time = ageing_time(model.growth, age)
    lowest = threshold
    if time < math.inf:
        lowest = min(threshold, threshold_at(model.growth, strength, age + time))
        while lowest <= x:  # a threshold that sinks
            time *= 0.5
            if time <= 1e-13 * (1.0 + age):
                return _Box(x, 0.0, 0.0, True)
            lowest = min(threshold, threshold_at(model.growth, strength, age + time))
    finest = 0.5 * steepness(model.hazard, x, lowest)
    width = max(0.5 * lowest, finest)
    while True:
        reach = min(x + width, lowest)
        most = largest_rate(model.hazard, reach, lowest)
        too_wide = width > finest and most * width > _CHANCE * speed
        if not too_wide:
            return _Box(reach, time, most, False)
        width = max(0.5 * width, finest)


@inlined
def _variate(state: State, draws: Draws) -> float:
    state.counts[VARIED] += 1
    return float(draws.variates[state.counts[VARIED] - 1])


@inlined
def _enclose(state: State, model: Model, slot: int, draws: Draws) -> bool:
    """Give a contact its next box; whether it breaks at once."""
    motion, contact = state.motion, state.contacts[slot]
    x, age = motion[POSITION] - contact["birth"], motion[TIME] - contact["since"]
    box = _box(model, x, contact["threshold"], age, abs(motion[VELOCITY]))
    birth = contact["birth"]
    if box.over or birth + box.reach <= motion[POSITION] or birth - box.reach >= motion[POSITION]:
        return True
    update(state.ahead, slot, birth + box.reach)
    update(state.behind, slot, box.reach - birth)
    wait = -math.log(1.0 - _variate(state, draws)) / box.most if box.most > 0.0 else np.inf
    if wait < box.time:
        state.contacts[slot]["most"] = box.most
        update(state.times, slot, motion[TIME] + wait)
    else:
        state.contacts[slot]["most"] = 0.0
        update(state.times, slot, motion[TIME] + box.time)
    return False


@inlined
def _accepted(state: State, model: Model, slot: int, draws: Draws) -> bool:
    """Whether a contact breaks at the time that was proposed."""
    motion, contact = state.motion, state.contacts[slot]
    if contact["most"] == 0.0:
        return False
    threshold = threshold_at(model.growth, contact["threshold"], motion[TIME] - contact["since"])
    true = rate(model.hazard, motion[POSITION] - contact["birth"], threshold)
    return bool(_variate(state, draws) * contact["most"] < true)


@bare
def _attach(state: State, model: Model, slot: int, draws: Draws, c: Constants) -> None:
    """A contact attaches, unstretched, where the slider is."""
    motion, counts = state.motion, state.counts
    strength = -state.contacts[slot]["threshold"] if model.own else draws.thresholds[counts[DRAWN]]
    state.contacts[slot]["birth"] = motion[POSITION]
    state.contacts[slot]["threshold"] = strength
    state.contacts[slot]["since"] = motion[TIME]
    counts[DRAWN] += 1
    count_in(motion, counts, c, strength if model.as_stiff else 1.0)
    _enclose(state, model, slot, draws)
    if counts[DRAWN] == draws.thresholds.size:
        sum_again(motion, counts, state.contacts, model.as_stiff)


@bare
def _let_go(state: State, model: Model, slot: int, draws: Draws, c: Constants) -> None:
    """Break a contact; without delay it attaches at once."""
    counts, strength = state.counts, state.contacts[slot]["threshold"]
    count_out(state.motion, counts, state.contacts[slot]["birth"], c, strength if model.as_stiff else 1.0)
    state.contacts[slot]["threshold"] = -strength if model.own else 0.0
    delay = draws.fixed_delay
    if math.isnan(delay):
        delay = draws.delays[counts[DELAYED]]
        counts[DELAYED] += 1
    if delay == 0.0:
        _attach(state, model, slot, draws, c)
        return
    update(state.ahead, slot, np.inf)
    update(state.behind, slot, np.inf)
    update(state.times, slot, state.motion[TIME] + delay)


@bare
def _see_to(state: State, model: Model, slot: int, proposed: bool, draws: Draws, c: Constants) -> None:
    """A contact leaves its box, or breaks as `proposed`."""
    if (proposed and _accepted(state, model, slot, draws)) or _enclose(state, model, slot, draws):
        _let_go(state, model, slot, draws, c)


@bare
def advance(
    state: State, slider: Slider, f_d: float, model: Model, piece: Piece, sampling: Sampling, draws: Draws, budget: int
) -> int:
    """Move the state on, event by event, until a reason to stop; parameters and reasons as in `thermal_clock`."""
    motion, counts, acceleration = state.motion, state.counts, piece.drive.acceleration
    c = constants(slider, f_d, float(state.contacts.size), model.stiffest)
    random_delay = math.isnan(draws.fixed_delay)
    to_go = budget
    while True:
        if counts[DRAWN] >= draws.thresholds.size or counts[VARIED] + NEED > draws.variates.size:
            return DRAWS_USED_UP
        if random_delay and counts[DELAYED] >= draws.delays.size:
            return DRAWS_USED_UP
        if to_go <= 0:
            return BUDGET_SPENT
        to_go -= 1
        edge, edge_back = detached_edges(motion, counts, c)
        ahead, behind = smallest(state.ahead), -smallest(state.behind)
        if c.massless:
            goal = balance(motion, counts, piece.drive, c)
            turned(motion, counts, c, goal - motion[POSITION])
            side = 1 if goal > min(ahead, edge) else (-1 if goal < max(behind, edge_back) else 0)
            if side != 0:
                motion[POSITION] = min(ahead, edge) if side > 0 else max(behind, edge_back)
                if (edge if side > 0 else -edge_back) <= (ahead if side > 0 else -behind):
                    counts[SLIDE] = side
                else:
                    slot = first(state.ahead) if side > 0 else first(state.behind)
                    _see_to(state, model, slot, False, draws, c)
                continue
            motion[POSITION] = goal
        elif f_d > 0.0 and counts[SLIDE] != 0:
            v = drive_now(piece.drive, motion[TIME])[1] if c.rigid else motion[VELOCITY]
            if v * counts[SLIDE] <= 0.0:  # elastic while it rests; if it goes on, it slides at once
                turned(motion, counts, c, -float(counts[SLIDE]))
                edge, edge_back = detached_edges(motion, counts, c)

        leg = set_out(motion, counts, piece.drive, c)
        if c.rigid or c.massless:
            motion[VELOCITY] = leg.motion.v
        due = smallest(state.times)
        limit = min(due, piece.end)
        most = h = max(limit - leg.t, 0.0)
        to_ahead, to_behind = min(ahead, edge) - leg.X, leg.X - max(behind, edge_back)
        y, u = at(leg.motion, h)
        side = 0
        if not is_straight(leg, h, y, u, to_ahead, to_behind):
            h, y, u, side = crossing(leg, to_ahead, to_behind, h, state.cuts)
        if f_d > 0.0 and counts[SLIDE] * u < 0.0 and counts[SLIDE] * leg.motion.v > 0.0:
            h, side = until_turning(leg.motion, h), 0
            y, u = at(leg.motion, h)
            u = 0.0
        ends_at = limit if side == 0 and h == most else leg.t + h

        if ends_at > piece.look and leg.t <= piece.look:
            motion[LOOKED] = leg.X + at(leg.motion, piece.look - leg.t)[0]
            return LOOK
        if sample_until(motion, counts, piece, sampling, leg, min(ends_at, piece.end), c):
            return CONDITION_HELD
        fly(motion, counts, leg, h, y, u, ends_at, acceleration, c)
        if side != 0:
            if (edge if side > 0 else -edge_back) <= (ahead if side > 0 else -behind):
                motion[POSITION] = edge if side > 0 else edge_back
                counts[SLIDE] = side
            else:
                motion[POSITION] = ahead if side > 0 else behind
                slot = first(state.ahead) if side > 0 else first(state.behind)
                _see_to(state, model, slot, False, draws, c)
        elif ends_at == due:
            slot = first(state.times)
            if state.contacts[slot]["threshold"] > 0.0:
                _see_to(state, model, slot, True, draws, c)
            else:
                _attach(state, model, slot, draws, c)
        elif ends_at >= piece.end:
            return REACHED_END


@bare
def lives(model: Model, strength: Floats, velocity: float, rng_numbers: Floats, reached: Floats) -> int:
    """Draw the stretchings at which newborn contacts break at a steady velocity.

    Parameters
    ----------
    model : Model
    strength : ndarray, shape (n,)
    velocity : float
        Above 0.
    rng_numbers : ndarray, shape (m,)
        Numbers between 0 and 1.
    reached : ndarray, shape (n,)
        Filled; the caller goes on with the rest where the numbers did not do.

    Returns
    -------
    int
        How many are filled.
    """
    used = 0
    for i in range(strength.size):
        x = 0.0
        while True:
            if used + 2 > rng_numbers.size:
                return i
            box = _box(model, x, strength[i], x / velocity, velocity)
            if box.over:
                break
            way = -math.log(1.0 - rng_numbers[used]) / box.most * velocity if box.most > 0.0 else np.inf
            used += 1
            end = min(box.reach, x + velocity * box.time)
            if x + way >= end:
                x = end
                continue
            x += way
            true = rate(model.hazard, x, threshold_at(model.growth, strength[i], x / velocity))
            used += 1
            if rng_numbers[used - 1] * box.most < true:
                break
        reached[i] = x
    return int(strength.size)
