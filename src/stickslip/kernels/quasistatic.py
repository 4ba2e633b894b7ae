"""A chain of blocks that is always in equilibrium: from event to event, without inertia
and without time steps.

Between two events the displacements are linear in the position of the drive; a
tridiagonal system gives them. A break or a re-attachment leaves an unbalanced force.
Then the drive stands still while this force is released uniformly, along a straight
line of the displacements, and the first contact that reaches its threshold on the way
breaks there. So a slip is an instantaneous cascade of breaks, each at its threshold;
the energy released counts as damped.

The state and the effect of a break are those of `blocks`. The element of the detached
contacts is elastic, and adds to the stiffness of its block, unless it slides in the
direction of motion.
"""

import math

from . import drive
from ._jit import bare, inlined
from .blocks import (
    BlockDraws,
    BlocksState,
    attach_contact,
    break_contact,
    has_broken,
    look_ahead,
    next_delay,
    next_threshold,
)
from .drive import NOWHERE, Piece, Sampling, drive_at, holds, turns_at
from .leapfrog import Network, element, fill_row, slide, stretch
from .records import Floats
from .tournament import smallest, winner

LET_GO, DRIVEN = range(2)
# an element this near to its sliding force slides if it is pulled that way
_ON_THE_EDGE = 1e-10


@inlined
def _solve(
    diagonal: Floats,
    coupling: float,
    right: Floats,
    Y: Floats,
    work: Floats,
) -> None:
    """Solve the tridiagonal system with ``-coupling`` beside the diagonal."""
    n = Y.size
    work[0] = -coupling / diagonal[0]
    Y[0] = right[0] / diagonal[0]
    for j in range(1, n):
        inverse = 1.0 / (diagonal[j] + coupling * work[j - 1])
        work[j] = -coupling * inverse
        Y[j] = (right[j] + coupling * Y[j - 1]) * inverse
    for j in range(n - 2, -1, -1):
        Y[j] -= work[j] * Y[j + 1]


@inlined
def _solve_ring(
    diagonal: Floats,
    coupling: float,
    right: Floats,
    Y: Floats,
    work: Floats,
) -> None:
    """Solve the system with the two corners of a ring: as a chain, with a correction of
    rank one.
    """
    n = Y.size
    first = diagonal[0]
    last = diagonal[Y.size - 1]
    diagonal[0] += coupling
    diagonal[n - 1] += coupling
    _solve(diagonal, coupling, right, Y, work[0])
    for j in range(n):
        work[1, j] = 0.0
    work[1, 0] = -coupling
    work[1, n - 1] = -coupling
    _solve(diagonal, coupling, work[1], work[2], work[0])
    diagonal[0] = first
    diagonal[n - 1] = last
    factor = (Y[0] + Y[n - 1]) / (1.0 + work[2, 0] + work[2, n - 1])
    for j in range(n):
        Y[j] -= factor * work[2, j]


@bare
def _answer(
    state: BlocksState,
    network: Network,
    sliding: float,
    right: Floats,
    direction: float,
    room: Floats,
) -> bool:
    """Find how the blocks move (``room[0]``) as forces `right` are added; return
    whether the elements that slide were determined.

    `direction` is the sign of the path.
    """
    blocks = state.motion.blocks
    n = blocks.X.size
    Y = room[0]
    diagonal = room[1]
    stuck = room[2]
    # it is a ring if the last block is a neighbour of the first
    coupling = 0.0
    closed = False
    for m in range(network.spring.shape[1]):
        coupling = max(coupling, network.spring[0, m])
        closed = closed or (
            n > 2 and network.spring[0, m] > 0.0 and network.neighbour[0, m] == n - 1
        )
    for j in range(n):
        if sliding > 0.0 and blocks.held[j] < 1.0:
            e = blocks.X[j] - blocks.anchor[j]
            stuck[j] = (
                1.0
                if abs(e) < sliding * (1.0 - _ON_THE_EDGE)
                or direction * e * right[j] < 0.0
                else 0.0
            )
        else:
            stuck[j] = 0.0
    for _ in range(64):  # which elements slide depends on the solution
        for j in range(n):
            bonds = 0.0
            for m in range(network.spring.shape[1]):
                bonds += network.spring[j, m]
            diagonal[j] = (
                network.pull[j]
                + bonds
                + blocks.held[j]
                + stuck[j] * (1.0 - blocks.held[j])
            )
        if closed:
            _solve_ring(diagonal, coupling, right, Y, room[3:6])
        else:
            _solve(diagonal, coupling, right, Y, room[3])
        changed = False
        if sliding > 0.0:
            for j in range(n):
                e = blocks.X[j] - blocks.anchor[j]
                if blocks.held[j] < 1.0 and abs(e) >= sliding * (1.0 - _ON_THE_EDGE):
                    should = 1.0 if direction * e * Y[j] < 0.0 else 0.0
                    if should != stuck[j]:
                        stuck[j] = should
                        changed = True
        if not changed:
            return True
    return False


@bare
def _first(
    state: BlocksState,
    sliding: float,
    direction: float,
    most: float,
    room: Floats,
) -> tuple[float, int, int]:
    """Return the distance along ``direction * room[0]`` to the first event, up to
    `most`; its block; 1 if it is a break.
    """
    blocks = state.motion.blocks
    Y = room[0]
    stuck = room[2]
    nearest = most
    block = -1
    kind = 0
    for j in range(blocks.X.size):
        y = direction * Y[j]
        if y > 0.0:
            if state.contacts.ahead[j] - blocks.X[j] < nearest * y:
                nearest = max((state.contacts.ahead[j] - blocks.X[j]) / y, 0.0)
                block = j
                kind = 1
        elif y < 0.0 and state.contacts.behind[j] + blocks.X[j] < -nearest * y:
            nearest = max((state.contacts.behind[j] + blocks.X[j]) / -y, 0.0)
            block = j
            kind = 1
        if stuck[j] > 0.0 and y != 0.0:
            left = sliding - math.copysign(1.0, y) * (blocks.X[j] - blocks.anchor[j])
            if left < nearest * abs(y):
                nearest = max(left / abs(y), 0.0)
                block = j
                kind = 0
    return nearest, block, kind


@bare
def _go(
    state: BlocksState,
    network: Network,
    sliding: float,
    amount: float,
    time: float,
    piece: Piece,
    room: Floats,
) -> None:
    """Move all blocks along ``room[0]``, and the drive to its position at `time`."""
    blocks = state.motion.blocks
    now = state.motion.now
    before, _ = drive_at(piece.drive, now.time)
    D, _ = drive_at(piece.drive, time)
    force = 0.0
    for j in range(blocks.X.size):
        blocks.X[j] += amount * room[0, j]
        if sliding > 0.0:
            slide(state.motion, j, blocks.X[j], sliding)
        force += network.pull[j] * (D - blocks.X[j]) + network.load[j] - network.push[j]
    now.work += 0.5 * (now.drive_force + force) * (D - before)
    now.drive_force = force
    now.time = time


@inlined
def _follow(
    state: BlocksState,
    network: Network,
    sliding: float,
    time: float,
    piece: Piece,
    room: Floats,
) -> None:
    """Move the blocks with the drive to a time."""
    now = state.motion.now.time
    direction = drive_at(piece.drive, time)[0] - drive_at(piece.drive, now)[0]
    _go(state, network, sliding, direction, max(time, now), piece, room)


@inlined
def _time_of(piece: Piece, now: float, distance: float) -> float:
    """Return when the drive will have moved by a signed distance."""
    _, v = drive_at(piece.drive, now)
    root = math.sqrt(max(v * v + 2.0 * piece.drive.acceleration * distance, 0.0))
    return now + 2.0 * distance / (v + math.copysign(root, distance))


@bare
def _break_there(
    state: BlocksState,
    j: int,
    direction: float,
    sliding: float,
    draws: BlockDraws,
) -> int:
    """Break all contacts of a block that are at their thresholds for this direction of
    motion.
    """
    blocks = state.motion.blocks
    X = blocks.X[j] = (
        state.contacts.ahead[j] if direction > 0.0 else -state.contacts.behind[j]
    )
    tree = (
        state.contacts.tree_ahead[j]
        if direction > 0.0
        else state.contacts.tree_behind[j]
    )
    why = drive.ON_THE_WAY
    # ends: each turn breaks a contact that the block has passed
    while smallest(tree) <= direction * X:
        delay = next_delay(state.contacts, j, draws)
        if math.isnan(delay):
            why = drive.DELAYS_USED_UP
            break
        force = slide(state.motion, j, X, sliding)
        break_contact(
            state,
            j,
            winner(tree, state.contacts.birth.shape[1]),
            state.motion.now.time,
            direction * force,
            delay,
        )
        state.motion.now.mode = LET_GO
    look_ahead(state.contacts, j)
    return why


@bare
def _attach_due(state: BlocksState, sliding: float, draws: BlockDraws) -> int:
    """Attach the contacts that are due."""
    blocks = state.motion.blocks
    now = state.motion.now.time
    for j in range(blocks.X.size):
        # ends: each turn attaches one of the waiting contacts
        while state.contacts.next_attach[j] <= now:
            threshold = next_threshold(state.contacts, j, draws)
            if math.isnan(threshold):
                state.motion.now.block = j
                return drive.THRESHOLDS_USED_UP
            force = slide(state.motion, j, blocks.X[j], sliding)
            attach_contact(state, j, blocks.X[j], threshold, force)
            look_ahead(state.contacts, j)
            state.motion.now.mode = LET_GO
    return drive.ON_THE_WAY


@bare
def _out_of_balance(
    state: BlocksState,
    network: Network,
    piece: Piece,
    sliding: float,
    right: Floats,
) -> None:
    """Compute the unbalanced forces on the blocks."""
    blocks = state.motion.blocks
    D, _ = drive_at(piece.drive, state.motion.now.time)
    for j in range(blocks.X.size):
        X = blocks.X[j]
        held = blocks.held[j]
        force = (
            network.pull[j] * (D - X) + network.load[j] - held * X + blocks.origins[j]
        )
        right[j] = (
            force
            - (1.0 - held) * element(blocks, j, X, sliding)
            + stretch(network, blocks.X, j)
        )


@bare
def _let_go(
    state: BlocksState,
    network: Network,
    piece: Piece,
    sliding: float,
    draws: BlockDraws,
    room: Floats,
) -> int:
    """Release the unbalanced force up to the first event, and handle that event."""
    blocks = state.motion.blocks
    now = state.motion.now
    right = room[6]
    _out_of_balance(state, network, piece, sliding, right)
    if not _answer(state, network, sliding, right, 1.0, room):
        return drive.UNSOLVED
    part, j, is_break = _first(state, sliding, 1.0, 1.0, room)
    power = 0.0
    for i in range(blocks.X.size):
        power += right[i] * room[0, i]
    now.damped += power * part * (1.0 - 0.5 * part)
    _go(state, network, sliding, part, now.time, piece, room)
    if j < 0:
        now.mode = DRIVEN
    elif is_break == 1:
        now.block = j
        return _break_there(
            state,
            j,
            math.copysign(1.0, room[0, j]),
            sliding,
            draws,
        )
    return drive.ON_THE_WAY


@bare
def advance_quasistatic(
    state: BlocksState,
    network: Network,
    piece: Piece,
    sampling: Sampling,
    draws: BlockDraws,
    sliding: float,
    budget: int,
    room: Floats,
) -> int:
    """Advance to the end of a piece, or until `budget` events times blocks are spent;
    return the reason to stop.

    The state is that of `blocks.make_state`; `room` has shape (7, n).
    """
    blocks = state.motion.blocks
    now = state.motion.now
    n = blocks.X.size
    spent = now.spent
    # ends: each event adds to what is spent
    while now.spent - spent <= budget:
        now.spent += n
        why = _attach_due(state, sliding, draws)
        if why != drive.ON_THE_WAY:
            return why
        if now.mode == LET_GO:
            why = _let_go(state, network, piece, sliding, draws, room)
            if why != drive.ON_THE_WAY:
                return why
            continue
        for j in range(n if draws.tracks else 0):
            if has_broken(state.contacts, j):
                now.block = j
                return drive.ARRESTED
        # Until the drive reverses, or the next re-attachment.
        time = now.time
        D, _ = drive_at(piece.drive, time)
        until = min(piece.end, turns_at(piece.drive, time))
        for j in range(n):
            until = min(until, state.contacts.next_attach[j])
        D_until, _ = drive_at(piece.drive, until)
        direction = math.copysign(1.0, D_until - D)
        if not _answer(state, network, sliding, network.pull, direction, room):
            return drive.UNSOLVED
        distance, j, is_break = _first(
            state, sliding, direction, abs(D_until - D), room
        )
        if j < 0 and until <= time < piece.end:
            return drive.STANDS_STILL
        event = until if j < 0 else time
        if j >= 0 and distance > 0.0:
            event = min(_time_of(piece, time, direction * distance), until)
        if event > piece.look:
            return drive.LOOK
        while (
            now.sampled < sampling.times.size and sampling.times[now.sampled] <= event
        ):
            k = now.sampled
            _follow(state, network, sliding, sampling.times[k], piece, room)
            for i in range(n):
                blocks.V_now[i] = (
                    drive_at(piece.drive, sampling.times[k])[1] * room[0, i]
                )
            fill_row(state.motion, network, piece, sampling.samples[k], sliding)
            now.sampled += 1
            if piece.stop.kind != NOWHERE and holds(
                piece.stop, blocks.X.mean(), sampling.samples[k, 0]
            ):
                return drive.STOPPED
        _follow(state, network, sliding, event, piece, room)
        if j >= 0:
            if is_break == 1:
                now.block = j
                why = _break_there(
                    state, j, math.copysign(1.0, direction * room[0, j]), sliding, draws
                )
                if why != drive.ON_THE_WAY:
                    return why
        elif event >= piece.end:
            return drive.FINISHED
    return drive.PAUSED
