"""Infinitely many contacts on each block of an elastic slider: cohorts, carried along by the steps of `leapfrog`.

A cohort is what attached to a block in about one place ``b``: contacts of which ``m J_c(e)`` survive when their largest
stretching so far is ``e``. Only those stretched further than the weakest threshold are looked up. What breaks goes
through the delay, a mean over given delay times, by a table of what each block has broken up to each step; it
re-attaches in the middle of a step's way. All of that is smooth in time, so the steps stay second order by themselves.
"""

from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .cohort_store import ALIVE, MASS, PLACE, REACH, Delays, History, due, first_history, has_room, join
from .drive import NO_HISTORY, NO_ROOM, ON_THE_WAY, PAUSED, Piece, Sampling
from .leapfrog import Motion, Network, begin_step, element, end_step, slide
from .records import Counts, Floats
from .survival import Table, value_at, values_at

FIRST = 1e-3  # the first break of infinitely many contacts is that of this fraction

EXTINCT = 1e-12  # a cohort of which a smaller fraction survives is dropped; its rest counts as broken


class Case(NamedTuple):
    """Survival of the thresholds, delays, force of detached contacts that slide, and how near contacts join cohorts."""

    table: Table
    delays: Delays
    sliding: float
    merge: float


class Cohorts(NamedTuple):
    """Cohorts of n blocks, and what has broken on them."""

    cohort: Floats  # shape (n, 4, room): `PLACE`, `MASS`, `REACH`, `ALIVE`
    used: Counts  # shape (n, 2): how many there are, and how many of them are extinct
    history: History
    due: Floats  # shape (n,): what re-attaches in the step
    attached: Floats  # shape (n,): all that has been due


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


def make_state(motion: Motion, place: Floats, alive: Floats, case: Case, rate: float, room: int, kept: int) -> State:
    """Return the state of blocks with the same number of cohorts each, `place` and `alive` of shape (n, cohorts).

    Contacts broke at a `rate` before time 0; at first there is `room` for so many cohorts and `kept` steps of breaks.
    """
    n, count = place.shape
    cohort = np.zeros((n, 4, max(room, count + 1)))
    reach = np.abs(motion.blocks.X[:, None] - place)
    held = values_at(case.table, reach.ravel()).reshape(reach.shape)
    cohort[:, PLACE, :count], cohort[:, REACH, :count] = place, reach
    cohort[:, ALIVE, :count], cohort[:, MASS, :count] = alive, alive / np.maximum(held, EXTINCT)
    motion.blocks.held[:] = alive.sum(axis=1)
    motion.blocks.origins[:] = (alive * place).sum(axis=1)
    motion.blocks.squares[:] = (alive * place**2).sum(axis=1)
    used = np.zeros((n, 2), np.int64)
    used[:, 0] = count
    before = -float(np.sum(case.delays.weight * case.delays.time)) * rate
    history = first_history(case.delays, rate, kept, n)
    return State(motion, Cohorts(cohort, used, history, np.zeros(n), np.full(n, before)))


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
def _attach(cohorts: Cohorts, j: int, place: float, alive: float, reach: float, table: Table, merge: float) -> None:
    """Add what attached at a place: to the youngest cohort if that did within `merge`, else as a new one."""
    cohort, i = cohorts.cohort[j], cohorts.used[j, 0] - 1
    if i >= 0 and cohort[ALIVE, i] > 0.0 and abs(place - cohort[PLACE, i]) <= merge:
        join(cohort, i, place, alive, reach)
    else:
        i += 1
        cohorts.used[j, 0] = i + 1
        cohort[PLACE, i], cohort[REACH, i], cohort[ALIVE, i] = place, reach, alive
    cohort[MASS, i] = cohort[ALIVE, i] / value_at(table, cohort[REACH, i])


@bare
def _drift(state: State, j: int, fraction: float, case: Case) -> float:
    """Take a block and its cohorts along; what breaks."""
    blocks, cohorts, now = state.motion.blocks, state.cohorts, state.motion.now
    cohort, table, weakest, sliding = cohorts.cohort, case.table, case.table.bottom, case.sliding
    X, h = blocks.X[j], now.step
    then = X + h * blocks.V[j]
    broken, lost, origins, squares = 0.0, 0.0, 0.0, 0.0
    for i in range(cohorts.used[j, 0]):
        b = cohort[j, PLACE, i]
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
        origins += gone * b
        squares += gone * b * b
        if alive == 0.0:
            cohorts.used[j, 1] += 1
    b = X + 0.5 * (then - X)
    reach = abs(then - b)
    young = value_at(table, reach)
    attaching = cohorts.due[j] - cohorts.attached[j] + fraction * broken
    alive = attaching * young
    held = blocks.held[j]
    after = held - broken + alive
    cohorts.attached[j] += attaching
    broken += attaching - alive
    blocks.held[j] = 0.5 * (held + after)
    force = 0.5 * element(blocks, j, X, sliding)
    force += 0.5 * slide(state.motion, j, then, sliding)
    now.broken += lost + 0.5 * force * force * (after - held)
    blocks.held[j] = after
    blocks.origins[j] += alive * b - origins
    blocks.squares[j] += alive * b * b - squares
    if alive > 0.0:
        _attach(cohorts, j, b, alive, reach, table, case.merge)
    total = blocks.broken[j] + broken
    if total >= FIRST and blocks.broken[j] < FIRST:
        blocks.first_break[j] = now.time + h * (FIRST - blocks.broken[j]) / broken
        blocks.first_force[j] = now.drive_force
    if after <= 0.5 < held and blocks.half_detached[j] != blocks.half_detached[j]:
        blocks.half_detached[j] = now.time + h * (held - 0.5) / (held - after)
    blocks.broken[j] = total
    blocks.X[j] = then
    return float(broken)


@bare
def advance(state: State, network: Network, piece: Piece, sampling: Sampling, case: Case, budget: int) -> int:
    """Go on to the end of a piece, or until `budget` steps of cohorts are spent; why it returned."""
    motion, cohorts, history = state.motion, state.cohorts, state.cohorts.history
    n, room, kept = motion.blocks.X.size, cohorts.cohort.shape[2], history.times.size
    last = motion.now.spent + budget
    while motion.now.spent < last:
        for j in range(n):
            if cohorts.used[j, 1] > 64 or cohorts.used[j, 0] == room:
                _weed(cohorts, j)
                if cohorts.used[j, 0] == room:
                    return NO_ROOM
            motion.now.spent += cohorts.used[j, 0]
        if not has_room(history):
            return NO_HISTORY
        why = begin_step(motion, network, piece, sampling, case.sliding)
        if why != ON_THE_WAY:
            return why
        fraction, row = due(history, case.delays, motion.now.step, cohorts.due), history.entered[0]
        for j in range(n):
            broken = _drift(state, j, fraction, case)
            history.broken[row % kept, j] = history.broken[(row - 1) % kept, j] + broken
        end_step(motion, piece)
        history.times[row % kept] = motion.now.time
        history.entered[0] = row + 1
    return PAUSED


def with_room(state: State) -> State:
    """Return the state with twice the room for cohorts."""
    cohorts = state.cohorts
    cohort = np.concatenate([cohorts.cohort, np.zeros_like(cohorts.cohort)], axis=2)
    return state._replace(cohorts=cohorts._replace(cohort=cohort))
