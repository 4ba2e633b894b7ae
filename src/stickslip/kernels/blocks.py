"""N contacts on each block of an elastic slider: every break and re-attachment is
located inside the time step of `leapfrog`.

Events of the contacts of a block during its drift are found in order of time: the next
break is where it passes the nearest breaking position, the next re-attachment is at its
time. An event that changes the force by ``dF`` at the fraction ``theta`` of a step of
length ``h`` is compensated by an impulse ``dF (1/2 - theta) h``, which keeps the scheme
of second order for any number of events. A block without events in a step costs three
comparisons, however many contacts it has.

Each block has the birth positions and thresholds of all its contacts, and three
tournaments (`tournament`) over them, for breaks ahead, breaks behind and
re-attachments. Energy that a contact loses when it attaches counts as broken.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .drive import (
    ARRESTED,
    DELAYS_USED_UP,
    ON_THE_WAY,
    PAUSED,
    THRESHOLDS_USED_UP,
    Piece,
    Sampling,
)
from .leapfrog import BlockMotion, Network, at_rest, begin_step, end_step, slide
from .records import Counts, Floats
from .tournament import enter, smallest, tournaments, winner


class BlockDraws(NamedTuple):
    """Random numbers of each block in the order of use, shape (n, any); one delay for
    all, or NaN if delays are drawn.

    Thresholds are multiplied by `factor`, shape (n,); with `tracks`, `advance_blocks`
    returns when a block stops after a break.
    """

    thresholds: Floats
    delays: Floats
    fixed_delay: float
    factor: Floats
    tracks: bool


class BlockContacts(NamedTuple):
    """The contacts of n blocks, N each: shapes (n, N), (n, some 8/7 N) for tournaments,
    and (n,) for next events.
    """

    birth: Floats
    threshold: Floats  # 0 marks a detached contact
    tree_ahead: Floats
    tree_behind: Floats
    tree_attach: Floats
    ahead: Floats
    behind: Floats
    next_attach: Floats
    impulse: Floats  # impulse of the events in a step
    breaks: Counts
    attached: Counts
    next_threshold: Counts
    next_delay: Counts
    breaks_at_stop: Counts
    heading: Floats  # velocity in the previous step


class BlocksState(NamedTuple):
    """State of the blocks and of their contacts."""

    motion: BlockMotion
    contacts: BlockContacts


def make_state(
    birth: Floats,
    threshold: Floats,
    waiting: Floats,
    X: Floats,
    V: Floats,
    sliding: float,
    anchored: Floats,
) -> BlocksState:
    """Return the state of n blocks of N contacts; `birth`, `threshold` and `waiting`
    have shape (n, N).

    A contact without threshold is detached, and attaches at the time `waiting`; other
    arguments are as in `leapfrog.at_rest`.
    """
    n, N = birth.shape
    attached = threshold > 0
    motion = at_rest(X, V, sliding, anchored)
    keys = np.where(attached, [birth + threshold, threshold - birth], np.inf)
    ahead, behind, attach = (tournaments(numbers) for numbers in (*keys, waiting))
    breaks, thresholds, delays, stops = np.zeros((4, n), np.int64)
    first = ahead[:, 0].copy(), behind[:, 0].copy(), attach[:, 0].copy()
    counts = breaks, attached.sum(axis=1), thresholds, delays, stops
    contacts = BlockContacts(
        birth,
        threshold,
        ahead,
        behind,
        attach,
        *first,
        np.zeros(n),
        *counts,
        np.zeros(n),
    )
    state = BlocksState(motion, contacts)
    motion.blocks.held[:] = attached.sum(axis=1) / N
    for j in range(n):
        _sum_again(state, j)
    return state


@bare
def _sum_again(state: BlocksState, j: int) -> None:
    """Sum the birth positions of a block again, so that rounding cannot accumulate."""
    contacts = state.contacts
    N = state.contacts.birth.shape[1]
    total = 0.0
    squares = 0.0
    for i in range(N):
        if contacts.threshold[j, i] > 0.0:
            total += contacts.birth[j, i]
            squares += contacts.birth[j, i] * contacts.birth[j, i]
    state.motion.blocks.origins[j] = total / N
    state.motion.blocks.squares[j] = squares / N


@inlined
def look_ahead(contacts: BlockContacts, j: int) -> None:
    """Find the next events of a block."""
    contacts.ahead[j] = smallest(contacts.tree_ahead[j])
    contacts.behind[j] = smallest(contacts.tree_behind[j])
    contacts.next_attach[j] = smallest(contacts.tree_attach[j])


@inlined
def next_threshold(contacts: BlockContacts, j: int, draws: BlockDraws) -> float:
    """Threshold of the next contact that attaches on a block; NaN if none is left."""
    if contacts.next_threshold[j] == draws.thresholds.shape[1]:
        return math.nan
    contacts.next_threshold[j] += 1
    return float(draws.thresholds[j, contacts.next_threshold[j] - 1] * draws.factor[j])


@inlined
def next_delay(contacts: BlockContacts, j: int, draws: BlockDraws) -> float:
    """Delay of the next contact that breaks on a block; NaN if none is left."""
    if not math.isnan(draws.fixed_delay):
        return draws.fixed_delay
    if contacts.next_delay[j] == draws.delays.shape[1]:
        return math.nan
    contacts.next_delay[j] += 1
    return float(draws.delays[j, contacts.next_delay[j] - 1])


@inlined
def has_broken(contacts: BlockContacts, j: int) -> bool:
    """Whether contacts of a block at rest have broken since it stopped."""
    last = contacts.breaks_at_stop[j]
    contacts.breaks_at_stop[j] = contacts.breaks[j]
    return bool(contacts.breaks[j] > last)


@inlined
def break_contact(
    state: BlocksState,
    j: int,
    slot: int,
    time: float,
    force: float,
    delay: float,
) -> float:
    """Break a contact, which then slides with `force`; return the change of the
    friction force of its block.
    """
    contacts = state.contacts
    blocks = state.motion.blocks
    N = contacts.birth.shape[1]
    b = contacts.birth[j, slot]
    threshold = contacts.threshold[j, slot]
    contacts.threshold[j, slot] = 0.0
    contacts.attached[j] -= 1
    contacts.breaks[j] += 1
    blocks.origins[j] -= b / N
    blocks.squares[j] -= b * b / N
    blocks.held[j] = contacts.attached[j] / N
    blocks.broken[j] = contacts.breaks[j] / N
    if contacts.breaks[j] == 1:
        blocks.first_break[j] = time
        blocks.first_force[j] = state.motion.now.drive_force
    if (
        blocks.half_detached[j] != blocks.half_detached[j]
        and 2 * contacts.attached[j] <= N
    ):
        blocks.half_detached[j] = time
    state.motion.now.broken += 0.5 * (threshold * threshold - force * force) / N
    enter(contacts.tree_ahead[j], N, slot, np.inf)
    enter(contacts.tree_behind[j], N, slot, np.inf)
    enter(contacts.tree_attach[j], N, slot, time + delay)
    if contacts.breaks[j] % (8 * N) == 0:
        _sum_again(state, j)
    return float((force - threshold) / N)


@inlined
def attach_contact(
    state: BlocksState,
    j: int,
    X: float,
    threshold: float,
    force: float,
) -> float:
    """Attach, unstretched, a contact that slid with `force`; return the change of the
    friction force of its block.
    """
    contacts = state.contacts
    blocks = state.motion.blocks
    N = contacts.birth.shape[1]
    slot = winner(contacts.tree_attach[j], N)
    contacts.birth[j, slot] = X
    contacts.threshold[j, slot] = threshold
    contacts.attached[j] += 1
    blocks.origins[j] += X / N
    blocks.squares[j] += X * X / N
    blocks.held[j] = contacts.attached[j] / N
    state.motion.now.broken += 0.5 * force * force / N
    enter(contacts.tree_ahead[j], N, slot, X + threshold)
    enter(contacts.tree_behind[j], N, slot, threshold - X)
    enter(contacts.tree_attach[j], N, slot, np.inf)
    return float(-force / N)


@bare
def _drift(
    state: BlocksState,
    j: int,
    h: float,
    inverse_mass: float,
    sliding: float,
    draws: BlockDraws,
) -> int:
    """Drift a block through all events of its contacts in a step; return ON_THE_WAY, or
    the reason if random numbers are used up.
    """
    contacts = state.contacts
    blocks = state.motion.blocks
    X = blocks.X[j]
    V = blocks.V[j]
    t = state.motion.now.time
    why = ON_THE_WAY
    # ends: each turn is an event of the step, and uses up a draw
    while True:
        until_break = np.inf
        if V > 0.0:
            until_break = max((smallest(contacts.tree_ahead[j]) - X) / V, 0.0)
        elif V < 0.0:
            until_break = max((smallest(contacts.tree_behind[j]) + X) / -V, 0.0)
        until_attach = max(smallest(contacts.tree_attach[j]) - t, 0.0)
        at = min(until_break, until_attach)
        if not at <= h:
            break
        x = X + V * at
        if until_attach <= until_break:
            threshold = next_threshold(contacts, j, draws)
            if math.isnan(threshold):
                why = THRESHOLDS_USED_UP
                break
            gain = attach_contact(
                state,
                j,
                x,
                threshold,
                slide(state.motion, j, x, sliding),
            )
        else:
            delay = next_delay(contacts, j, draws)
            if math.isnan(delay):
                why = DELAYS_USED_UP
                break
            direction, tree = (
                (1.0, contacts.tree_ahead[j])
                if V > 0.0
                else (-1.0, contacts.tree_behind[j])
            )
            slot = winner(tree, contacts.birth.shape[1])
            force = slide(state.motion, j, x, sliding)
            gain = direction * break_contact(
                state,
                j,
                slot,
                t + at,
                direction * force,
                delay,
            )
        contacts.impulse[j] -= gain * (0.5 * h - at) * inverse_mass
        state.motion.now.spent += 8
    look_ahead(contacts, j)
    if why == ON_THE_WAY:
        blocks.X[j] = X + h * V
        blocks.V[j] = V + contacts.impulse[j]
        contacts.impulse[j] = 0.0
    return why


@bare
def advance_blocks(
    state: BlocksState,
    network: Network,
    piece: Piece,
    sampling: Sampling,
    draws: BlockDraws,
    sliding: float,
    budget: int,
) -> int:
    """Advance to the end of a piece, or until `budget` is used up by steps of blocks,
    one each, and events, eight each.
    """
    blocks = state.motion.blocks
    contacts = state.contacts
    now = state.motion.now
    n = blocks.X.size
    inverse_mass = 1.0 / network.mass
    last = now.spent + budget
    # ends: each step of all blocks is spent
    while now.spent < last:
        if now.block < 0:
            why = begin_step(state.motion, network, piece, sampling, sliding)
            if why != ON_THE_WAY:
                return why
        h = now.step
        soon = now.time + h
        for j in range(now.block, n):
            if draws.tracks:
                before = contacts.heading[j]
                contacts.heading[j] = blocks.V[j]
                if before * blocks.V[j] < 0.0 and has_broken(contacts, j):
                    now.block = j
                    return ARRESTED
            X = blocks.X[j] + h * blocks.V[j]
            if (
                contacts.ahead[j] > X
                and contacts.behind[j] > -X
                and soon < contacts.next_attach[j]
            ):
                blocks.X[j] = X
            else:
                why = _drift(state, j, h, inverse_mass, sliding, draws)
                if why != ON_THE_WAY:
                    now.block = j
                    return why
        end_step(state.motion, piece)
        now.spent += n
    return PAUSED
