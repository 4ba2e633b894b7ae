"""Infinitely many contacts on each block of an elastic slider: cohorts, carried along by the steps of `leapfrog`.

A cohort is what attached to a block in about one place ``b``: contacts of which ``m J_c(e)`` survive when their largest
stretching so far is ``e``. Only those stretched further than the weakest threshold are looked up. What breaks goes
through the delay, a mean over given delay times, by a table of what each block has broken up to each step; it
re-attaches in the middle of a step's way. All of that is smooth in time, so the steps stay second order by themselves.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .blocks import BUDGET_SPENT
from .leapfrog import (
    BROKEN,
    DRIVE_FORCE,
    ON_THE_WAY,
    SPENT,
    STEP,
    TIME,
    Motion,
    Piece,
    Sampling,
    begin_step,
    element,
    end_step,
    slide,
)
from .network import Network
from .survival import Table, value_at, values_at

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]

NO_ROOM, NO_HISTORY = 6, 7
"""Why `advance` returned, besides what `blocks` knows: too many cohorts, or too many steps in a delay."""
FIRST = 1e-3
"""The first break of infinitely many contacts is that of this fraction."""

EXTINCT = 1e-12
"""A cohort of which a smaller fraction survives is dropped; its rest counts as broken."""

BIRTH, MASS, REACH, ALIVE = range(4)


class Thresholds(NamedTuple):
    """Survival of the thresholds, and the stretching up to which none breaks."""

    table: Table
    weakest: float


class Delays(NamedTuple):
    """Delays and their weights, and the rate at which contacts broke before time 0."""

    time: Floats
    weight: Floats
    past_rate: float


class Cohorts(NamedTuple):
    """Cohorts of n blocks, and what has broken on them.

    Attributes
    ----------
    cohort : ndarray, shape (n, 4, room)
        `BIRTH`, `MASS`, `REACH`, `ALIVE`.
    used : ndarray of int, shape (n, 2)
        How many there are, and how many of them are extinct.
    times, broken : ndarray, shape (kept,) and (kept, n)
        Times of the last steps, in a ring, and what had broken up to them.
    ring : ndarray of int, shape (1,)
        Steps entered.
    cursor : ndarray of int, shape (delays,)
        Step at or before the time one delay ago.
    due, attached : ndarray, shape (n,)
        What re-attaches in the step, and all that has been due.
    """

    cohort: Floats
    used: Counts
    times: Floats
    broken: Floats
    ring: Counts
    cursor: Counts
    due: Floats
    attached: Floats


class State(NamedTuple):
    """All that the next step needs."""

    motion: Motion
    cohorts: Cohorts


def smooth_sliding(table: Table, cells: float, attached: float) -> tuple[Floats, Floats]:
    """Stretchings and weights of smooth sliding, ``Q_s(x) = J_c(x)/<x_s>``, at the cohorts' own resolution."""
    x = np.arange(int(cells * table.top), -1, -1) / cells
    weight = values_at(table, x)
    weight[-1] *= 0.5
    kept = weight > EXTINCT
    return x[kept], attached * weight[kept] / weight[kept].sum()


def make_state(
    motion: Motion, births: Floats, alive: Floats, thresholds: Thresholds, delays: Delays, room: int, kept: int
) -> State:
    """Return the state of blocks with the same number of cohorts each.

    Parameters
    ----------
    motion : Motion
        Of `leapfrog.at_rest`.
    births, alive : ndarray, shape (n, cohorts)
        Places of no stretching, and fractions of all contacts.
    thresholds, delays
        Of the contacts.
    room : int
        Cohorts that a block may have, at first.
    kept : int
        Steps whose breaks are kept.
    """
    n, count = births.shape
    cohort = np.zeros((n, 4, max(room, count + 1)))
    reach = np.abs(motion.blocks.X[:, None] - births)
    held = values_at(thresholds.table, reach.ravel()).reshape(reach.shape)
    cohort[:, BIRTH, :count], cohort[:, REACH, :count] = births, reach
    cohort[:, ALIVE, :count], cohort[:, MASS, :count] = alive, alive / np.maximum(held, EXTINCT)
    motion.blocks.held[:] = alive.sum(axis=1)
    motion.blocks.births[:] = (alive * births).sum(axis=1)
    motion.blocks.squares[:] = (alive * births**2).sum(axis=1)
    used = np.zeros((n, 2), np.int64)
    used[:, 0] = count
    before = -float(np.sum(delays.weight * delays.time)) * delays.past_rate
    cohorts = Cohorts(
        cohort,
        used,
        np.zeros(kept),
        np.zeros((kept, n)),
        np.array([1]),
        np.zeros(delays.time.size, np.int64),
        np.zeros(n),
        np.full(n, before),
    )
    return State(motion, cohorts)


@bare
def _reckon_due(state: State, delays: Delays) -> float:
    """Find what re-attaches on each block in this step; returns the fraction of what breaks in it that does so, too."""
    cohorts, scalar = state.cohorts, state.motion.scalar
    t, h = scalar[TIME], scalar[STEP]
    kept, last = cohorts.times.size, cohorts.ring[0] - 1
    n = cohorts.due.size
    fraction = 0.0
    for j in range(n):
        cohorts.due[j] = 0.0
    for k in range(delays.time.size):
        then, weight = t + h - delays.time[k], delays.weight[k]
        if then >= t:
            fraction += weight * (then - t) / h
            for j in range(n):
                cohorts.due[j] += weight * cohorts.broken[last % kept, j]
            continue
        i = cohorts.cursor[k]
        while i + 1 < last and cohorts.times[(i + 1) % kept] <= then:
            i += 1
        cohorts.cursor[k] = i
        left, right = i % kept, (i + 1) % kept
        if then < cohorts.times[left]:  # before the beginning
            for j in range(n):
                cohorts.due[j] += weight * delays.past_rate * then
        else:
            u = (then - cohorts.times[left]) / (cohorts.times[right] - cohorts.times[left])
            for j in range(n):
                cohorts.due[j] += weight * (
                    cohorts.broken[left, j] + u * (cohorts.broken[right, j] - cohorts.broken[left, j])
                )
    for j in range(n):
        all_due = cohorts.due[j]
        cohorts.due[j] = all_due - cohorts.attached[j]
        cohorts.attached[j] = all_due
    return fraction


@inlined
def _weed(cohorts: Cohorts, j: int) -> None:
    """Drop the extinct cohorts of a block."""
    kept = 0
    for i in range(cohorts.used[j, 0]):
        if cohorts.cohort[j, ALIVE, i] > 0.0:
            for row in range(4):
                cohorts.cohort[j, row, kept] = cohorts.cohort[j, row, i]
            kept += 1
    cohorts.used[j, 0] = kept
    cohorts.used[j, 1] = 0


@inlined
def _attach(cohorts: Cohorts, j: int, b: float, alive: float, reach: float, table: Table, merge: float) -> None:
    """Add what attached at `b`: to the youngest cohort if that did within `merge`, else as a new one."""
    cohort = cohorts.cohort
    i = cohorts.used[j, 0] - 1
    if i >= 0 and cohort[j, ALIVE, i] > 0.0 and abs(b - cohort[j, BIRTH, i]) <= merge:
        total = alive + cohort[j, ALIVE, i]
        part = alive / total
        b = cohort[j, BIRTH, i] + part * (b - cohort[j, BIRTH, i])
        reach = cohort[j, REACH, i] + part * (reach - cohort[j, REACH, i])
        alive = total
    else:
        i += 1
        cohorts.used[j, 0] = i + 1
    cohort[j, BIRTH, i], cohort[j, REACH, i], cohort[j, ALIVE, i] = b, reach, alive
    cohort[j, MASS, i] = alive / value_at(table, reach)


@bare
def _drift(state: State, j: int, fraction: float, sliding: float, thresholds: Thresholds, merge: float) -> float:
    """Take a block and its cohorts along; what breaks."""
    blocks, cohorts, scalar = state.motion.blocks, state.cohorts, state.motion.scalar
    cohort, table, weakest = cohorts.cohort, thresholds.table, thresholds.weakest
    X, h = blocks.X[j], scalar[STEP]
    then = X + h * blocks.V[j]
    broken, lost, births, squares = 0.0, 0.0, 0.0, 0.0
    for i in range(cohorts.used[j, 0]):
        b = cohort[j, BIRTH, i]
        x = abs(then - b)
        if x <= weakest or x <= cohort[j, REACH, i] or cohort[j, ALIVE, i] == 0.0:
            continue
        before = max(cohort[j, REACH, i], abs(X - b))
        left = value_at(table, x)
        alive = cohort[j, MASS, i] * left if left > EXTINCT else 0.0
        gone = cohort[j, ALIVE, i] - alive
        cohort[j, REACH, i], cohort[j, ALIVE, i] = x, alive
        middle = 0.5 * (before + x)
        broken += gone
        lost += 0.5 * middle * middle * gone
        births += gone * b
        squares += gone * b * b
        if alive == 0.0:
            cohorts.used[j, 1] += 1
    b = X + 0.5 * (then - X)
    reach = abs(then - b)
    young = value_at(table, reach)
    attaching = cohorts.due[j] + fraction * broken
    alive = attaching * young
    held = blocks.held[j]
    after = held - broken + alive
    cohorts.attached[j] += fraction * broken
    broken += attaching - alive
    blocks.held[j] = 0.5 * (held + after)
    force = 0.5 * element(blocks, j, X, sliding)
    force += 0.5 * slide(state.motion, j, then, sliding)
    scalar[BROKEN] += lost + 0.5 * force * force * (after - held)
    blocks.held[j] = after
    blocks.births[j] += alive * b - births
    blocks.squares[j] += alive * b * b - squares
    if alive > 0.0:
        _attach(cohorts, j, b, alive, reach, table, merge)
    total = blocks.broken[j] + broken
    if total >= FIRST and blocks.broken[j] < FIRST:
        blocks.first_break[j] = scalar[TIME] + h * (FIRST - blocks.broken[j]) / broken
        blocks.first_force[j] = scalar[DRIVE_FORCE]
    if after <= 0.5 < held and blocks.half_detached[j] != blocks.half_detached[j]:
        blocks.half_detached[j] = scalar[TIME] + h * (held - 0.5) / (held - after)
    blocks.broken[j] = total
    blocks.X[j] = then
    return float(broken)


@bare
def advance(
    state: State,
    network: Network,
    piece: Piece,
    sampling: Sampling,
    thresholds: Thresholds,
    delays: Delays,
    sliding: float,
    merge: float,
    budget: int,
) -> int:
    """Go on to the end of a piece, or until `budget` steps of cohorts are spent; why it returned."""
    motion, cohorts = state.motion, state.cohorts
    n, room, kept = motion.blocks.X.size, cohorts.cohort.shape[2], cohorts.times.size
    last = motion.counts[SPENT] + budget
    while motion.counts[SPENT] < last:
        for j in range(n):
            if cohorts.used[j, 1] > 64 or cohorts.used[j, 0] == room:
                _weed(cohorts, j)
                if cohorts.used[j, 0] == room:
                    return NO_ROOM
            motion.counts[SPENT] += cohorts.used[j, 0]
        for k in range(delays.time.size):
            if cohorts.ring[0] - cohorts.cursor[k] >= kept:
                return NO_HISTORY
        why = begin_step(motion, network, piece, sampling, sliding)
        if why != ON_THE_WAY:
            return why
        fraction = _reckon_due(state, delays)
        now = cohorts.ring[0]
        for j in range(n):
            broken = _drift(state, j, fraction, sliding, thresholds, merge)
            cohorts.broken[now % kept, j] = cohorts.broken[(now - 1) % kept, j] + broken
        end_step(motion, piece)
        cohorts.times[now % kept] = motion.scalar[TIME]
        cohorts.ring[0] = now + 1
    return BUDGET_SPENT


def with_room(state: State) -> State:
    """Return the state with twice the room for cohorts."""
    cohorts = state.cohorts
    cohort = np.concatenate([cohorts.cohort, np.zeros_like(cohorts.cohort)], axis=2)
    return state._replace(cohorts=cohorts._replace(cohort=cohort))


def with_history(state: State) -> State:
    """Return the state with twice the room for steps."""
    cohorts = state.cohorts
    kept, entered = cohorts.times.size, int(cohorts.ring[0])
    steps = np.arange(max(entered - kept, 0), entered)
    times, broken = np.zeros(2 * kept), np.zeros((2 * kept, cohorts.due.size))
    times[steps % (2 * kept)] = cohorts.times[steps % kept]
    broken[steps % (2 * kept)] = cohorts.broken[steps % kept]
    return state._replace(cohorts=cohorts._replace(times=times, broken=broken))
