"""Blocks on contacts, joined by springs: leapfrog with every break and re-attachment located inside its step.

A step kicks all blocks by the forces on them, then lets them drift. What happens to a block's contacts while it drifts
is found in order of time: the next break where it passes the nearest breaking position, the next re-attachment at its
time. An event that changes the force by ``dF`` a fraction ``theta`` into a step of length ``h`` is made up for by an
impulse ``dF (1/2 - theta) h``, which keeps the scheme second order whatever the number of events. A block in whose
reach nothing happens costs two comparisons, however many contacts it has.

Per block, N contacts; births and thresholds of all, three tournaments (`tournament`) over them, for breaks ahead and
behind and for re-attachments, and three running sums. The contacts that are detached slide together, one elastic and
plastic element a block: stretched as an attached contact would be, up to the force ``f_d``. What it dissipates counts
as broken, as does what a contact loses when it attaches.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .drive import NOWHERE, Quadratic, Stop, drive_at, holds
from .network import Network, Pull, energies, stretch
from .tournament import enter, play, smallest, tournaments, winner

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]

# Why `advance` returned.
REACHED_END, CONDITION_HELD, THRESHOLDS_USED_UP, DELAYS_USED_UP, BUDGET_SPENT = range(5)

SCALARS = 9
"""Numbers that a sample begins with, summed over blocks: spring force, work of drive and push, kinetic energy, energies
of the driving springs, of the springs between blocks and of the contacts, and what was lost to damping, in dashpots and
in contacts."""
FIELDS = 5
"""Then come numbers of all blocks: displacement, velocity, friction force, attached fraction, breaks per contact."""


class Draws(NamedTuple):
    """Random numbers of each block in the order of use, shape (n, any); the delay of all, or NaN to take the drawn."""

    thresholds: Floats
    delays: Floats
    fixed_delay: float


class Sampling(NamedTuple):
    """Rising times at which to sample, shape (k,), and the samples, shape (k, ``SCALARS + FIELDS n``)."""

    times: Floats
    samples: Floats


class Piece(NamedTuple):
    """A piece of the drive up to `end`, or to a condition seen at a sample, in steps of at most `longest`."""

    drive: Quadratic
    end: float
    stop: Stop
    longest: float


class Blocks(NamedTuple):
    """What each block has, shape (n,): motion, running sums over its contacts, what is next, and what has been."""

    X: Floats
    V: Floats  # half a step behind the displacement, but at rest between pieces
    V_now: Floats  # at the time of the displacement
    held: Floats  # attached fraction
    births: Floats  # sum of birth positions over N
    squares: Floats  # sum of their squares over N
    anchor: Floats  # where the element of the detached contacts has no force
    ahead: Floats  # nearest breaking positions
    behind: Floats
    next_attach: Floats
    impulse: Floats
    first_break: Floats
    first_force: Floats
    half_detached: Floats
    breaks: Counts
    attached: Counts
    next_threshold: Counts
    next_delay: Counts


class State(NamedTuple):
    """All that the next step needs."""

    blocks: Blocks
    birth: Floats  # shape (n, N)
    threshold: Floats  # shape (n, N); 0 marks a detached contact
    tree_ahead: Floats
    tree_behind: Floats
    tree_attach: Floats
    scalar: Floats
    counts: Counts
    rows: Floats  # shape (2, width): the last two moments between which a sample may lie
    Z: Floats  # shape (2, n): work space of the dashpots


TIME, STEP, DRIVE_FORCE, WORK, DAMPED, VISCOUS, BROKEN, LAST_DAMPED, LAST_VISCOUS, DT, ROW_TIME = range(11)
SAMPLE, BLOCK, EVENTS, HAS_ROW = range(4)


def make_state(
    birth: Floats, threshold: Floats, waiting: Floats, X: Floats, V: Floats, sliding: float, anchored: Floats
) -> State:
    """Return the state of n blocks.

    Parameters
    ----------
    birth, threshold : ndarray, shape (n, N)
        Where each contact has no stretching, and its threshold; 0 for a detached one.
    waiting : ndarray, shape (n, N)
        Times at which detached contacts re-attach, infinite for those that do not.
    X, V : ndarray, shape (n,)
        Displacements and velocities at time 0.
    sliding : float
        Force of a detached contact while it slides.
    anchored : ndarray, shape (n,)
        Stretching of the element of the detached contacts.
    """
    n, N = birth.shape
    attached = threshold > 0
    blocks = Blocks(
        X=X.astype(float),
        V=V.astype(float),
        V_now=V.astype(float),
        held=attached.sum(axis=1) / N,
        births=np.empty(n),
        squares=np.empty(n),
        anchor=X - np.clip(anchored, -sliding, sliding),
        ahead=np.empty(n),
        behind=np.empty(n),
        next_attach=np.empty(n),
        impulse=np.zeros(n),
        first_break=np.full(n, np.nan),
        first_force=np.full(n, np.nan),
        half_detached=np.full(n, np.nan),
        breaks=np.zeros(n, np.int64),
        attached=attached.sum(axis=1),
        next_threshold=np.zeros(n, np.int64),
        next_delay=np.zeros(n, np.int64),
    )
    state = State(
        blocks,
        birth,
        threshold,
        tournaments(n, N),
        tournaments(n, N),
        tournaments(n, N),
        np.zeros(11),
        np.zeros(4, np.int64),
        np.zeros((2, SCALARS + FIELDS * n)),
        np.zeros((2, n)),
    )
    state.tree_ahead[:, N:] = np.where(attached, birth + threshold, np.inf)
    state.tree_behind[:, N:] = np.where(attached, threshold - birth, np.inf)
    state.tree_attach[:, N:] = waiting
    for tree, nearest in (
        (state.tree_ahead, blocks.ahead),
        (state.tree_behind, blocks.behind),
        (state.tree_attach, blocks.next_attach),
    ):
        play(tree)
        nearest[:] = tree[:, 1]
    for j in range(n):
        _sum_again(state, j)
    state.counts[BLOCK] = -1
    return state


@inlined
def _sum_again(state: State, j: int) -> None:
    """Sum the birth positions of a block afresh: rounding cannot pile up."""
    N = state.birth.shape[1]
    total, squares = 0.0, 0.0
    for i in range(N):
        if state.threshold[j, i] > 0.0:
            total += state.birth[j, i]
            squares += state.birth[j, i] * state.birth[j, i]
    state.blocks.births[j] = total / N
    state.blocks.squares[j] = squares / N


@inlined
def _element(blocks: Blocks, j: int, X: float, sliding: float) -> float:
    """Force of a detached contact with the block at `X`."""
    return min(max(X - blocks.anchor[j], -sliding), sliding)


@inlined
def slide(state: State, j: int, X: float, sliding: float) -> float:
    """Take the detached contacts of a block along to `X`; the force of each."""
    blocks = state.blocks
    e = X - blocks.anchor[j]
    force = min(max(e, -sliding), sliding)
    slip = e - force
    blocks.anchor[j] += slip
    state.scalar[BROKEN] += (1.0 - blocks.held[j]) * force * slip
    return force


@inlined
def add_break(state: State, j: int, slot: int, time: float, force: float, delay: float) -> float:
    """A contact breaks and from now on slides with `force`; what the block's friction force gains."""
    blocks, N = state.blocks, state.birth.shape[1]
    b, threshold = state.birth[j, slot], state.threshold[j, slot]
    blocks.births[j] -= b / N
    blocks.squares[j] -= b * b / N
    blocks.attached[j] -= 1
    blocks.held[j] = blocks.attached[j] / N
    blocks.breaks[j] += 1
    if blocks.breaks[j] == 1:
        blocks.first_break[j] = time
        blocks.first_force[j] = state.scalar[DRIVE_FORCE]
    if blocks.half_detached[j] != blocks.half_detached[j] and 2 * blocks.attached[j] <= N:
        blocks.half_detached[j] = time
    state.scalar[BROKEN] += 0.5 * (threshold * threshold - force * force) / N
    state.threshold[j, slot] = 0.0
    enter(state.tree_ahead[j], slot, np.inf)
    enter(state.tree_behind[j], slot, np.inf)
    enter(state.tree_attach[j], slot, time + delay)
    if blocks.breaks[j] % (8 * N) == 0:
        _sum_again(state, j)
    return (force - threshold) / N


@inlined
def add_attachment(state: State, j: int, slot: int, X: float, threshold: float, force: float) -> float:
    """A contact that slid with `force` attaches, unstretched; what the block's friction force gains."""
    blocks, N = state.blocks, state.birth.shape[1]
    state.birth[j, slot], state.threshold[j, slot] = X, threshold
    blocks.births[j] += X / N
    blocks.squares[j] += X * X / N
    blocks.attached[j] += 1
    blocks.held[j] = blocks.attached[j] / N
    state.scalar[BROKEN] += 0.5 * force * force / N
    enter(state.tree_ahead[j], slot, X + threshold)
    enter(state.tree_behind[j], slot, threshold - X)
    enter(state.tree_attach[j], slot, np.inf)
    return -force / N


@inlined
def _drift(state: State, j: int, h: float, inverse_mass: float, sliding: float, draws: Draws) -> int:
    """Let a block drift through all events of its contacts in a step; BUDGET_SPENT when all has gone well."""
    blocks = state.blocks
    X, V, t = blocks.X[j], blocks.V[j], state.scalar[TIME]
    why = BUDGET_SPENT
    while True:
        until_break = np.inf
        if V > 0.0:
            until_break = max((smallest(state.tree_ahead[j]) - X) / V, 0.0)
        elif V < 0.0:
            until_break = max((smallest(state.tree_behind[j]) + X) / -V, 0.0)
        until_attach = max(smallest(state.tree_attach[j]) - t, 0.0)
        at = min(until_break, until_attach)
        if not at <= h:
            break
        x = X + V * at
        if until_attach <= until_break:
            if blocks.next_threshold[j] == draws.thresholds.shape[1]:
                why = THRESHOLDS_USED_UP
                break
            threshold = draws.thresholds[j, blocks.next_threshold[j]]
            blocks.next_threshold[j] += 1
            force = slide(state, j, x, sliding)
            gain = add_attachment(state, j, winner(state.tree_attach[j]), x, threshold, force)
        else:
            delay = draws.fixed_delay
            if delay != delay:
                if blocks.next_delay[j] == draws.delays.shape[1]:
                    why = DELAYS_USED_UP
                    break
                delay = draws.delays[j, blocks.next_delay[j]]
                blocks.next_delay[j] += 1
            force = slide(state, j, x, sliding)
            if V > 0.0:
                gain = add_break(state, j, winner(state.tree_ahead[j]), t + at, force, delay)
            else:
                gain = -add_break(state, j, winner(state.tree_behind[j]), t + at, -force, delay)
        blocks.impulse[j] -= gain * (0.5 * h - at) * inverse_mass
        state.counts[EVENTS] += 1
    blocks.ahead[j] = smallest(state.tree_ahead[j])
    blocks.behind[j] = smallest(state.tree_behind[j])
    blocks.next_attach[j] = smallest(state.tree_attach[j])
    if why == BUDGET_SPENT:
        blocks.X[j] = X + h * V
        blocks.V[j] = V + blocks.impulse[j]
        blocks.impulse[j] = 0.0
    return why


@bare
def _kick(state: State, network: Network, piece: Piece, before: float, after: float, sliding: float) -> None:
    """Kick all blocks by their forces over half of the step before and half of the one after."""
    blocks, scalar = state.blocks, state.scalar
    n = blocks.X.size
    D, _ = drive_at(piece.drive, scalar[TIME])
    span = 0.5 * (before + after)
    brake = 0.5 * network.damping * span
    kept, share = (1.0 - brake) / (1.0 + brake), span / ((1.0 + brake) * network.mass)
    part = before / (before + after) if span > 0.0 else 1.0
    damped, pulled = 0.0, 0.0
    viscous = network.lag > 0.0
    Z, W = state.Z[0], state.Z[1]
    if viscous:  # the velocities now, foretold with the dashpots as they last were; then kicked by those
        for j in range(n):
            W[j] = blocks.X[j] + network.lag * blocks.V[j]
        for j in range(n):
            X = blocks.X[j]
            force = network.pull[j] * (D - X) + network.load[j] - blocks.held[j] * X + blocks.births[j]
            if sliding > 0.0:
                force -= (1.0 - blocks.held[j]) * _element(blocks, j, X, sliding)
            after_V = kept * blocks.V[j] + share * (force + stretch(network, W, j))
            Z[j] = X + network.lag * (blocks.V[j] + part * (after_V - blocks.V[j]))
    else:
        Z = blocks.X
    for j in range(n):
        X, V = blocks.X[j], blocks.V[j]
        force = network.pull[j] * (D - X)
        pulled += force
        force += network.load[j] - blocks.held[j] * X + blocks.births[j] + stretch(network, Z, j)
        if sliding > 0.0:
            force -= (1.0 - blocks.held[j]) * slide(state, j, X, sliding)
        kicked = kept * V + share * force
        blocks.V[j] = kicked
        blocks.V_now[j] = V + part * (kicked - V)
        damped += (V + kicked) * (V + kicked)
    lost = 0.25 * network.mass * network.damping * damped * span
    scalar[DAMPED] += lost
    scalar[LAST_DAMPED] = lost * (1.0 - part)
    if viscous:
        rubbed = 0.0
        for j in range(n):
            rubbed -= blocks.V_now[j] * (stretch(network, Z, j) - stretch(network, blocks.X, j))
        scalar[VISCOUS] += rubbed * span
        scalar[LAST_VISCOUS] = rubbed * span * (1.0 - part)
    for j in range(n):
        pulled += network.load[j] - network.push[j]
    D_before, _ = drive_at(piece.drive, scalar[TIME] - before)
    scalar[WORK] += 0.5 * (scalar[DRIVE_FORCE] + pulled) * (D - D_before)
    scalar[DRIVE_FORCE] = pulled


@bare
def record(state: State, network: Network, piece: Piece, row: Floats, sliding: float) -> None:
    """Fill a row with what is now, after the kick."""
    blocks, scalar = state.blocks, state.scalar
    n, N = blocks.X.size, state.birth.shape[1]
    D, _ = drive_at(piece.drive, scalar[TIME])
    here: Pull = energies(network, blocks.X, blocks.V_now, D)
    stored = 0.0
    first = SCALARS
    for j in range(n):
        X, held = blocks.X[j], blocks.held[j]
        element = _element(blocks, j, X, sliding)
        row[first + j] = X
        row[first + n + j] = blocks.V_now[j]
        row[first + 2 * n + j] = held * X - blocks.births[j] + (1.0 - held) * element
        row[first + 3 * n + j] = held
        row[first + 4 * n + j] = blocks.breaks[j] / N
        stored += held * X * X - 2.0 * X * blocks.births[j] + blocks.squares[j] + (1.0 - held) * element * element
    row[0], row[1] = here.force, scalar[WORK] + here.pushed
    row[2], row[3], row[4], row[5] = here.kinetic, here.springs, here.bulk, 0.5 * stored
    row[6], row[7] = scalar[DAMPED] - scalar[LAST_DAMPED], scalar[VISCOUS] - scalar[LAST_VISCOUS]
    row[8] = scalar[BROKEN]


@bare
def _interpolate(state: State, row: Floats, fraction: float, span: float) -> None:
    """Fill a row between the last two: displacements by the cubic that has their velocities, the rest linearly."""
    n = state.blocks.X.size
    before, after = state.rows[0], state.rows[1]
    for i in range(row.size):
        row[i] = before[i] + fraction * (after[i] - before[i])
    u, w = fraction, 1.0 - fraction
    for i in range(SCALARS, SCALARS + n):
        rise = after[i] - before[i]
        row[i] += u * w * (w * (span * before[i + n] - rise) - u * (span * after[i + n] - rise))


@bare
def _sample(state: State, network: Network, piece: Piece, sampling: Sampling, next_time: float, sliding: float) -> int:
    """Fill the samples that lie between the last two moments; which one of them holds the condition, or -1."""
    counts, now = state.counts, state.scalar[TIME]
    k, n = counts[SAMPLE], state.blocks.X.size
    if k == sampling.times.size or sampling.times[k] > max(now, next_time):
        counts[HAS_ROW] = 0
        return -1
    record(state, network, piece, state.rows[1], sliding)
    found = -1
    while k < sampling.times.size and sampling.times[k] <= now:
        fraction, span = 1.0, 0.0
        if counts[HAS_ROW] == 1:
            span = now - state.scalar[ROW_TIME]
            fraction = (sampling.times[k] - state.scalar[ROW_TIME]) / span
        _interpolate(state, sampling.samples[k], fraction, span)
        k += 1
        if piece.stop.kind != NOWHERE:
            mean = 0.0
            for j in range(n):
                mean += state.blocks.X[j]
            if holds(piece.stop, mean / n, state.rows[1, 0]):
                found = k - 1
                break
    counts[SAMPLE] = k
    for i in range(state.rows.shape[1]):
        state.rows[0, i] = state.rows[1, i]
    state.scalar[ROW_TIME] = now
    counts[HAS_ROW] = 1
    return found


@bare
def advance(
    state: State, network: Network, piece: Piece, sampling: Sampling, draws: Draws, sliding: float, budget: int
) -> int:
    """Go on to the end of a piece, or until `budget` steps of blocks and events are spent; why it returned."""
    blocks, scalar, counts = state.blocks, state.scalar, state.counts
    n = blocks.X.size
    inverse_mass = 1.0 / network.mass
    spent = counts[EVENTS]
    while True:
        if counts[BLOCK] < 0:
            before = scalar[STEP]
            t = scalar[TIME]
            left = piece.end - t
            if before == 0.0 and left > 0.0:  # a piece begins: equal steps
                scalar[DT] = left / math.ceil(left / piece.longest * (1.0 - 1e-12))
            h = scalar[DT] if left > scalar[DT] * (1.0 + 1e-6) else left
            if piece.stop.kind != NOWHERE:  # where a condition is looked for, steps end at the samples
                k = counts[SAMPLE]
                while k < sampling.times.size and sampling.times[k] <= t:
                    k += 1
                if k < sampling.times.size:
                    h = min(h, sampling.times[k] - t)
            _kick(state, network, piece, before, h, sliding)
            if _sample(state, network, piece, sampling, t + h, sliding) >= 0:
                _rest(state)
                return CONDITION_HELD
            if left <= 0.0:
                _rest(state)
                return REACHED_END
            scalar[STEP] = h
            counts[BLOCK] = 0
        h = scalar[STEP]
        soon = scalar[TIME] + h
        j = counts[BLOCK]
        while j < n:
            X = blocks.X[j] + h * blocks.V[j]
            if X < blocks.ahead[j] and -X < blocks.behind[j] and soon < blocks.next_attach[j]:
                blocks.X[j] = X
            else:
                why = _drift(state, j, h, inverse_mass, sliding, draws)
                if why != BUDGET_SPENT:
                    counts[BLOCK] = j
                    return why
            j += 1
        counts[BLOCK] = -1
        scalar[TIME] = piece.end if piece.end - soon < 1e-6 * h else soon
        counts[EVENTS] += n // 8 + 1
        if counts[EVENTS] - spent > budget:
            return BUDGET_SPENT


@inlined
def _rest(state: State) -> None:
    """Bring the velocities to the time of the displacements."""
    for j in range(state.blocks.X.size):
        state.blocks.V[j] = state.blocks.V_now[j]
    scalar = state.scalar
    scalar[STEP] = 0.0
    scalar[DAMPED] -= scalar[LAST_DAMPED]
    scalar[VISCOUS] -= scalar[LAST_VISCOUS]
    scalar[LAST_DAMPED] = scalar[LAST_VISCOUS] = 0.0
