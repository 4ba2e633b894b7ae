"""Contacts on each block of an elastic slider, any number: cohorts, carried along by
the steps of `leapfrog`.

A cohort is what attached to a block in about one place ``b``: contacts of which
``m J_c(e)`` survive when their largest stretching so far is ``e``. Only those stretched
further than the weakest threshold are looked up. What breaks goes through the delay, a
mean over given delay times, by a table of what each block has broken up to each stage;
it re-attaches in the middle of a stage's way.

A stage is as many steps as take some block as far as cohorts are apart, or the longest
time given: light blocks swing through many steps meanwhile. In a stage contacts break
at the rate ``m J_c'(e)`` of its beginning for each length by which a block passes its
front, the furthest that it has been, and re-attach at the rate of the stage before; at
its end all cohorts are looked up, and what was wrong is made good. The error is of
second order in the length of the stage, as that of a step is in its own.

Of counted contacts what has broken in a stage is drawn at its end, and how long each
waits: of ``n`` that have held up to a stretching ``e`` a binomial number breaks on the
way to ``e'``, each with the probability ``1 - J_c(e')/J_c(e)``.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .cohort_store import (
    ALIVE,
    MASS,
    PLACE,
    REACH,
    Delays,
    History,
    due,
    first_history,
    has_room,
    join,
)
from .drive import NO_HISTORY, NO_ROOM, ON_THE_WAY, PAUSED, Piece, Sampling
from .leapfrog import Motion, Network, begin_step, element, end_step, slide
from .records import Counts, Floats, Records, blank, record
from .survival import Table, drawn, value_and_slope, value_at, values_at

FIRST = 1e-3  # the first break of infinitely many contacts is that of this fraction

# a cohort of which a smaller fraction survives is dropped; its rest counts as broken
EXTINCT = 1e-12


class Case(NamedTuple):
    """Survival of the thresholds, delays, force of detached contacts that slide; limits
    of a stage; counted contacts.

    Contacts that attach within `merge` are of one cohort. No stage is longer, nor lasts
    more than `longest`.
    """

    table: Table
    delays: Delays
    sliding: float
    merge: float
    longest: float
    contacts: float  # of a block; infinite: nothing is drawn
    rng: np.random.Generator


_STAGE = record("start held broken behind ahead attaching lost")
"""Of each block: position, attached fraction and breaks at the beginning of a stage,
the fronts, the rate at which contacts re-attach; and the energy lost in breaks in the
stage so far.
"""


class Cohorts(NamedTuple):
    """Cohorts of n blocks, and what has broken on them."""

    cohort: Floats  # shape (n, 4, room): `PLACE`, `MASS`, `REACH`, `ALIVE`
    used: Counts  # shape (n,): how many there are
    history: History
    due: Floats  # shape (n,): what re-attaches in the step
    attached: Floats  # shape (n,): all that has been due
    stage: Records  # shape (n,)
    # shape (n, 2, 3): breaks for each length beyond the fronts, of their origins, and
    # of the squares
    rate: Floats


class State(NamedTuple):
    """All that the next step needs."""

    motion: Motion
    cohorts: Cohorts


def smooth_sliding(
    table: Table, cells: float, attached: float
) -> tuple[Floats, Floats]:
    """Stretchings and weights of smooth sliding, ``Q_s(x) = J_c(x)/<x_s>``, at the
    cohorts' own resolution.
    """
    x = np.arange(int(cells * table.top), -1, -1) / cells
    weight = values_at(table, x)
    weight[-1] *= 0.5
    kept = weight > EXTINCT
    return x[kept], attached * weight[kept] / weight[kept].sum()


def make_state(
    motion: Motion, place: Floats, alive: Floats, case: Case, rate: float, room: int
) -> State:
    """Return the state of n blocks with the same cohorts, `alive` on each of them at a
    `place` of shape (n, cohorts).

    Contacts broke at a `rate` before time 0; at first there is `room` for so many
    cohorts.
    """
    n, count = place.shape
    delays = case.delays
    waiting = np.tile(rate * delays.weight * delays.time, (n, 1))
    rates = np.full(n, rate)
    if case.contacts < math.inf:
        parts = np.append(alive, waiting[0])
        held = (
            case.rng.multinomial(int(case.contacts), parts / parts.sum(), n)
            / case.contacts
        )
        alive = held[:, :count]
        waiting = held[:, count:]
        rates = (waiting / np.maximum(delays.time, 1e-300)).ravel()
    cohort = np.zeros((n, 4, max(room, count + 1)))
    reach = np.abs(motion.blocks.X[:, None] - place)
    held = values_at(case.table, reach.ravel()).reshape(reach.shape)
    cohort[:, PLACE, :count] = place
    cohort[:, REACH, :count] = reach
    cohort[:, ALIVE, :count] = alive
    cohort[:, MASS, :count] = alive / np.maximum(held, EXTINCT)
    motion.blocks.held[:] = alive.sum(axis=-1)
    motion.blocks.origins[:] = (alive * place).sum(axis=1)
    motion.blocks.squares[:] = (alive * place**2).sum(axis=1)
    stage = blank(_STAGE, n)
    stage.start = stage.behind = stage.ahead = motion.blocks.X
    stage.held = motion.blocks.held
    pasts = (
        np.full(n, count),
        first_history(delays, rates),
        np.zeros(n),
        -waiting.sum(axis=1),
    )
    return State(motion, Cohorts(cohort, *pasts, stage, np.zeros((n, 2, 3))))


@inlined
def _attach(
    cohorts: Cohorts,
    j: int,
    place: float,
    alive: float,
    reach: float,
    table: Table,
    merge: float,
) -> None:
    """Add what attached at a place: to the youngest cohort if that did within
    `merge`, else as a new one.
    """
    cohort = cohorts.cohort[j]
    i = cohorts.used[j] - 1
    if i >= 0 and abs(place - cohort[PLACE, i]) <= merge:
        join(cohort, i, place, alive, REACH, reach)
    else:
        i += 1
        cohorts.used[j] = i + 1
        cohort[PLACE, i] = place
        cohort[REACH, i] = reach
        cohort[ALIVE, i] = alive
    cohort[MASS, i] = cohort[ALIVE, i] / value_at(table, cohort[REACH, i])


@inlined
def _drift(state: State, j: int, case: Case) -> bool:
    """Take a block along, contacts breaking and re-attaching at the rates of the
    stage; whether it has come far.
    """
    blocks = state.motion.blocks
    now = state.motion.now
    stage = state.cohorts.stage[j]
    X = blocks.X[j]
    h = now.step
    held = blocks.held[j]
    then = X + h * blocks.V[j]
    middle = X + 0.5 * h * blocks.V[j]
    change = min(h * stage.attaching, max(1.0 - held, 0.0))  # no more than there are
    places = change * middle
    squares = change * middle * middle
    lost = 0.0
    if then > stage.ahead or then < stage.behind:
        side = 1 if then > stage.ahead else 0
        front = stage.ahead if side == 1 else stage.behind
        beyond = abs(then - front)
        x = 0.5 * (then + front)
        rate = state.cohorts.rate[j, side]
        gone = beyond * rate[0]
        change -= gone
        places -= beyond * rate[1]
        squares -= beyond * rate[2]
        lost = 0.5 * beyond * (x * x * rate[0] - 2.0 * x * rate[1] + rate[2])
        blocks.broken[j] += gone
        if side == 1:
            stage.ahead = then
        else:
            stage.behind = then
    blocks.held[j] = held + 0.5 * change
    force = 0.5 * element(blocks, j, X, case.sliding)
    force += 0.5 * slide(state.motion, j, then, case.sliding)
    now.broken += lost + 0.5 * force * force * change
    blocks.held[j] = held + change
    blocks.origins[j] += places
    blocks.squares[j] += squares
    stage.lost += lost
    blocks.X[j] = then
    return bool(abs(then - stage.start) >= case.merge)


@inlined
def _held(case: Case, attached: float, held: float) -> float:
    """What stays attached of so much if each contact holds with a probability."""
    if case.contacts == math.inf:
        return attached * held
    return (
        attached
        - drawn(case.rng, np.rint(case.contacts * attached), held) / case.contacts
    )


@bare
def _wait(cohorts: Cohorts, j: int, broken: float, span: float, case: Case) -> float:
    """Let what has broken on a block in a stage wait, so much for each delay; what
    of it re-attaches in the stage.
    """
    delays = case.delays
    history = cohorts.history
    rest = 1.0
    back = 0.0
    columns = history.broken.shape[1] // cohorts.used.size
    row = history.entered[0] % history.times.size
    for k in range(delays.time.size):
        left = _held(case, broken, max(1.0 - delays.weight[k] / rest, 0.0))
        rest = max(rest - delays.weight[k], 1e-300)
        history.broken[row, columns * j + min(k, columns - 1)] += broken - left
        back += (broken - left) * max(1.0 - delays.time[k] / span, 0.0)
        broken = left
    return back


@bare
def _settle(state: State, j: int, span: float, case: Case) -> None:
    """Look up all cohorts of a block at the end of a stage, and begin another."""
    blocks = state.motion.blocks
    cohorts = state.cohorts
    now = state.motion.now
    table = case.table
    cohort = cohorts.cohort[j]
    stage = cohorts.stage[j]
    rate = cohorts.rate[j]
    X = blocks.X[j]
    behind = stage.behind
    ahead = stage.ahead
    # A front further off than that is not passed in the next stage.
    stage.behind = behind if X - behind < case.merge else X
    stage.ahead = ahead if ahead - X < case.merge else X
    rate[:] = 0.0
    kept = 0
    broken = 0.0
    lost = 0.0
    held = 0.0
    origins = 0.0
    squares = 0.0
    for i in range(cohorts.used[j]):
        b = cohort[PLACE, i]
        mass = cohort[MASS, i]
        reach = cohort[REACH, i]
        alive = cohort[ALIVE, i]
        x = max(abs(ahead - b), abs(behind - b))
        if x > table.bottom and x >= reach:
            left, slope = value_and_slope(table, x)
            if x > reach:
                middle = 0.5 * (max(reach, abs(stage.start - b)) + x)
                mean = mass * left if left > EXTINCT else 0.0
                gone = alive - mean
                reach = x
                more = 0.0
                # what more breaks than on average, or less, does so now
                if case.contacts < math.inf:
                    more = mean - _held(case, alive, mean / alive)
                alive = mean - more
                broken += gone + more
                lost += 0.5 * (middle * middle * gone + (X - b) * (X - b) * more)
                if alive <= 0.5 / case.contacts:
                    continue
                mass = alive / left if more != 0.0 else mass
            side = 1 if stage.ahead - b >= x else 0
            if side == 1 or b - stage.behind >= x:
                rate[side, 0] -= slope * mass
                rate[side, 1] -= slope * mass * b
                rate[side, 2] -= slope * mass * b * b
        cohort[PLACE, kept] = b
        cohort[MASS, kept] = mass
        cohort[REACH, kept] = reach
        cohort[ALIVE, kept] = alive
        kept += 1
        held += alive
        origins += alive * b
        squares += alive * b * b
    cohorts.used[j] = kept
    b = 0.5 * (stage.start + X)
    reach = abs(X - b)
    attaching = (
        cohorts.due[j] - cohorts.attached[j] + _wait(cohorts, j, broken, span, case)
    )
    if case.contacts < math.inf:
        attaching = max(np.rint(case.contacts * attaching) / case.contacts, 0.0)
    alive = _held(case, attaching, value_at(table, reach))
    _wait(cohorts, j, attaching - alive, span, case)
    broken += attaching - alive
    if alive > 0.0:
        lost -= 0.5 * alive * reach * reach
        _attach(cohorts, j, b, alive, reach, table, case.merge)
    force = element(blocks, j, X, case.sliding)
    held = held + alive
    now.broken += lost - stage.lost + 0.5 * force * force * (held - blocks.held[j])
    blocks.held[j], blocks.origins[j], blocks.squares[j] = (
        held,
        origins + alive * b,
        squares + alive * b * b,
    )
    cohorts.attached[j] += attaching
    before = stage.broken
    first = FIRST if case.contacts == math.inf else 0.5 / case.contacts
    blocks.broken[j] = stage.broken = before + broken
    if before < first <= blocks.broken[j]:
        blocks.first_break[j] = now.time - span * (blocks.broken[j] - first) / broken
        blocks.first_force[j] = now.drive_force
    if held <= 0.5 < stage.held and blocks.half_detached[j] != blocks.half_detached[j]:
        blocks.half_detached[j] = now.time - span * (0.5 - held) / (stage.held - held)
    stage.start, stage.held, stage.attaching, stage.lost = X, held, alive / span, 0.0


@bare
def _end_stage(state: State, case: Case) -> int:
    """Settle all blocks; or why that cannot be done yet."""
    cohorts = state.cohorts
    history = state.cohorts.history
    now = state.motion.now
    kept = history.times.size
    row = history.entered[0]
    for count in cohorts.used:
        if count == cohorts.cohort.shape[2]:
            return NO_ROOM
    if not has_room(history):
        return NO_HISTORY
    span = now.time - history.times[(row - 1) % kept]
    due(history, case.delays, span, cohorts.due)
    for c in range(history.broken.shape[1]):
        history.broken[row % kept, c] = history.broken[(row - 1) % kept, c]
    for j in range(cohorts.due.size):
        _settle(state, j, span, case)
        now.spent += cohorts.used[j]
    history.times[row % kept] = now.time
    history.entered[0] = row + 1
    now.mode = 0
    return ON_THE_WAY


@bare
def advance(
    state: State,
    network: Network,
    piece: Piece,
    sampling: Sampling,
    case: Case,
    budget: int,
) -> int:
    """Go on to the end of a piece, or until `budget` steps of blocks and of cohorts
    are spent; why it returned.
    """
    motion = state.motion
    history = state.cohorts.history
    now = state.motion.now
    n = motion.blocks.X.size
    kept = history.times.size
    last = motion.now.spent + budget
    while now.spent < last:
        why = _end_stage(state, case) if now.mode == 1 else ON_THE_WAY
        if why == ON_THE_WAY:
            why = begin_step(motion, network, piece, sampling, case.sliding)
        if why != ON_THE_WAY:
            return why
        far = False
        for j in range(n):
            far = _drift(state, j, case) or far
        end_step(motion, piece)
        ends = history.times[(history.entered[0] - 1) % kept] + case.longest
        if far or now.time + 0.5 * now.step > ends or now.time >= piece.end:
            now.mode = 1
        now.spent += n
    return PAUSED
