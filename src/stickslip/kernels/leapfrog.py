"""Leapfrog integration of blocks, kick and drift, with dashpots, energies, samples and
pieces of the drive.

The motion of the contacts while a block drifts is computed by another kernel
(`blocks`); here the contacts of a block are three sums: the attached fraction, and the
birth positions of attached contacts, plain and squared. The detached contacts slide
together, as one elastic and plastic element per block: stretched like an attached
contact, up to the force ``f_d``. The energy that it dissipates counts as broken.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .drive import (
    FINISHED,
    LOOK,
    NOWHERE,
    ON_THE_WAY,
    STOPPED,
    Piece,
    Sampling,
    drive_at,
    holds,
)
from .records import Floats, Indices, Record, blank, record

SUMS = (
    "spring_force",
    "work",
    "kinetic_energy",
    "spring_energy",
    "bulk_energy",
    "contact_energy",
    "damped_energy",
    "viscous_energy",
    "broken_energy",
)
"""First columns of a sample, summed over blocks: `bulk_energy` is that of the springs
between blocks, `viscous_energy` the energy lost in dashpots.
"""
OF_BLOCKS = ("displacement", "velocity", "friction_force", "attached", "broken")
"""The columns after them, each for all blocks; `broken` counts breaks per contact."""
SCALARS = len(SUMS)
FIELDS = len(OF_BLOCKS)


class Network(NamedTuple):
    """Constants of ``M X'' + M eta X' = pull (D - X) + load + sum of spring (1 + lag
    d/dt) (X_l - X) - F_c``.
    """

    neighbour: Indices  # shape (n, m); a block with fewer than `m` is its own neighbour
    spring: Floats  # shape (n, m): stiffness towards each; 0 where there is none
    # shape (n,): stiffness of the spring by which the drive pulls each block
    pull: Floats
    # shape (n,): constant force: of the driving spring with drive and block at 0, plus
    # any pushing force
    load: Floats
    # shape (n,): the part of `load` that does work as the block moves: all of it but
    # the force of a driving spring
    push: Floats
    mass: float
    damping: float
    lag: float  # viscosity of a spring over its stiffness


class Blocks(NamedTuple):
    """Motion of the blocks, sums over their contacts, and records of their past, each
    of shape (n,).
    """

    X: Floats
    V: Floats  # half a step behind the displacement, except at rest between pieces
    V_now: Floats  # at the time of the displacement
    held: Floats  # attached fraction
    origins: Floats  # sum of birth positions over N
    squares: Floats  # sum of their squares over N
    anchor: Floats  # where the element of the detached contacts has no force
    broken: Floats  # breaks per contact since the start
    first_break: Floats
    first_force: Floats
    half_detached: Floats


class BlockMotion(NamedTuple):
    """All that the next step needs, except the contacts."""

    blocks: Blocks
    now: Record
    # shape (2, width): the last two moments between which a sample may lie
    rows: Floats
    Z: Floats  # shape (2, n): work space of the dashpots


NOW = record(
    (
        "time step drive_force work damped viscous broken last_damped last_viscous dt "
        "row_time"
    ),
    counts="sampled block spent has_row mode",
)
"""What changes from step to step: the time and the length of a step; the force of the
driving springs; work, energies lost by damping, dashpots and breaks; the part of these
losses that the last kick counted in advance; the regular step of a piece; the time of a
row; the number of filled samples; the next block to drift; the steps of blocks spent;
whether there is a row; and the mode of quasi-static motion.
"""


def at_rest(
    X: Floats,
    V: Floats,
    sliding: float,
    anchored: Floats,
) -> BlockMotion:
    """Return blocks between two steps, their contacts not yet summed; `anchored` is the
    stretching of their elements.
    """
    n = X.size
    anchor = X - np.clip(anchored, -sliding, sliding)
    held, origins, squares, broken = np.zeros((4, n))
    x = X.astype(float)
    v = V.astype(float)
    blocks = Blocks(
        x,
        v,
        v.copy(),
        held,
        origins,
        squares,
        anchor,
        broken,
        *np.full((3, n), np.nan),
    )
    motion = BlockMotion(
        blocks,
        blank(NOW),
        np.zeros((2, SCALARS + FIELDS * n)),
        np.zeros((2, n)),
    )
    motion.now.block = -1
    return motion


def fastest(network: Network) -> float:
    """Return a bound on the angular frequencies of the body with all its contacts
    attached (by Gershgorin's theorem).
    """
    per_block = network.pull + 2.0 * network.spring.sum(axis=1) + 1.0
    return math.sqrt(float(per_block.max()) / network.mass)


def stiffest_dashpot(network: Network) -> float:
    """Return a bound on the rates at which dashpots between blocks slow them down."""
    return 2.0 * network.lag * float(network.spring.sum(axis=1).max()) / network.mass


@inlined
def stretch(network: Network, Z: Floats, j: int) -> float:
    """Return the force of the neighbours on block `j` at displacements `Z`."""
    force = 0.0
    for m in range(network.spring.shape[1]):
        force += network.spring[j, m] * (Z[network.neighbour[j, m]] - Z[j])
    return force


@inlined
def element(
    blocks: Blocks,
    j: int,
    X: float,
    sliding: float,
) -> float:
    """Return the force of a detached contact with the block at `X`."""
    return float(min(max(X - blocks.anchor[j], -sliding), sliding))


@inlined
def slide(
    motion: BlockMotion,
    j: int,
    X: float,
    sliding: float,
) -> float:
    """Move the detached contacts of a block along to `X`; return the force of each."""
    blocks = motion.blocks
    e = X - blocks.anchor[j]
    force = min(max(e, -sliding), sliding)
    slip = e - force
    blocks.anchor[j] += slip
    motion.now.broken += (1.0 - blocks.held[j]) * force * slip
    return float(force)


@bare
def kick(
    motion: BlockMotion,
    network: Network,
    piece: Piece,
    before: float,
    after: float,
    sliding: float,
) -> None:
    """Kick all blocks by their forces over the second half of the step before and the
    first half of the one after.
    """
    blocks = motion.blocks
    now = motion.now
    n = blocks.X.size
    D, _ = drive_at(piece.drive, now.time)
    span = 0.5 * (before + after)
    brake = 0.5 * network.damping * span
    kept = (1.0 - brake) / (1.0 + brake)
    per_mass = span / ((1.0 + brake) * network.mass)
    part = before / (before + after) if span > 0.0 else 1.0
    damped = 0.0
    pulled = 0.0
    viscous = network.lag > 0.0
    Z = motion.Z[0]
    W = motion.Z[1]
    # predict the velocities now with the dashpot forces of the last step; then kick
    # with the dashpot forces at these velocities
    if viscous:
        for j in range(n):
            W[j] = blocks.X[j] + network.lag * blocks.V[j]
        for j in range(n):
            X = blocks.X[j]
            force = (
                network.pull[j] * (D - X)
                + network.load[j]
                - blocks.held[j] * X
                + blocks.origins[j]
            )
            if sliding > 0.0:
                force -= (1.0 - blocks.held[j]) * element(blocks, j, X, sliding)
            after_V = kept * blocks.V[j] + per_mass * (force + stretch(network, W, j))
            Z[j] = X + network.lag * (blocks.V[j] + part * (after_V - blocks.V[j]))
    else:
        Z = blocks.X
    for j in range(n):
        X = blocks.X[j]
        V = blocks.V[j]
        force = network.pull[j] * (D - X)
        pulled += force
        force += (
            network.load[j]
            - blocks.held[j] * X
            + blocks.origins[j]
            + stretch(network, Z, j)
        )
        if sliding > 0.0:
            force -= (1.0 - blocks.held[j]) * slide(motion, j, X, sliding)
        kicked = kept * V + per_mass * force
        blocks.V[j] = kicked
        blocks.V_now[j] = V + part * (kicked - V)
        damped += (V + kicked) * (V + kicked)
    lost = 0.25 * network.mass * network.damping * damped * span
    now.damped += lost
    now.last_damped = lost * (1.0 - part)
    if viscous:
        rubbed = 0.0
        for j in range(n):
            rubbed -= blocks.V_now[j] * (
                stretch(network, Z, j) - stretch(network, blocks.X, j)
            )
        now.viscous += rubbed * span
        now.last_viscous = rubbed * span * (1.0 - part)
    for j in range(n):
        pulled += network.load[j] - network.push[j]
    D_before, _ = drive_at(piece.drive, now.time - before)
    now.work += 0.5 * (now.drive_force + pulled) * (D - D_before)
    now.drive_force = pulled


@bare
def fill_row(
    motion: BlockMotion,
    network: Network,
    piece: Piece,
    row: Floats,
    sliding: float,
) -> None:
    """Fill a row with the present state, after the kick."""
    blocks = motion.blocks
    now = motion.now
    n = blocks.X.size
    D, _ = drive_at(piece.drive, now.time)
    pulled = pushed = kinetic = springs = bulk = stored = 0.0
    for j in range(n):
        X = blocks.X[j]
        V = blocks.V_now[j]
        held = blocks.held[j]
        first = SCALARS + j
        force = element(blocks, j, X, sliding)
        pull = network.pull[j]
        row[first] = X
        row[first + n] = V
        row[first + 3 * n] = held
        row[first + 4 * n] = blocks.broken[j]
        row[first + 2 * n] = held * X - blocks.origins[j] + (1.0 - held) * force
        stored += (
            held * X * X
            - 2.0 * X * blocks.origins[j]
            + blocks.squares[j]
            + (1.0 - held) * force * force
        )
        kinetic += V * V
        spring = pull * (D - X) + network.load[j] - network.push[j]
        pulled += spring
        if pull > 0.0:
            springs += spring * spring / pull
        for m in range(network.spring.shape[1]):
            y = blocks.X[network.neighbour[j, m]] - X
            bulk += network.spring[j, m] * y * y
        pushed += network.push[j] * X
    row[0] = pulled
    row[1] = now.work + pushed
    row[2] = 0.5 * network.mass * kinetic
    row[3] = 0.5 * springs
    row[4] = 0.25 * bulk
    row[5] = 0.5 * stored
    row[6] = now.damped - now.last_damped
    row[7] = now.viscous - now.last_viscous
    row[8] = now.broken


@bare
def _interpolate(
    motion: BlockMotion,
    row: Floats,
    fraction: float,
    span: float,
) -> None:
    """Fill a row between the last two: displacements by the cubic with their
    velocities, the rest linearly.
    """
    n = motion.blocks.X.size
    before = motion.rows[0]
    after = motion.rows[1]
    for i in range(row.size):
        row[i] = before[i] + fraction * (after[i] - before[i])
    u = fraction
    w = 1.0 - fraction
    for i in range(SCALARS, SCALARS + n):
        rise = after[i] - before[i]
        row[i] += (
            u
            * w
            * (w * (span * before[i + n] - rise) - u * (span * after[i + n] - rise))
        )


@bare
def _sample(
    motion: BlockMotion,
    network: Network,
    piece: Piece,
    sampling: Sampling,
    next_time: float,
    sliding: float,
) -> bool:
    """Fill the samples between the last two moments; return whether one of them meets
    the stop condition.
    """
    now = motion.now
    time = motion.now.time
    k = now.sampled
    if k == sampling.times.size or sampling.times[k] > max(time, next_time):
        now.has_row = 0
        return False
    fill_row(motion, network, piece, motion.rows[1], sliding)
    held = False
    while k < sampling.times.size and sampling.times[k] <= time:
        fraction = 1.0
        span = 0.0
        if now.has_row == 1 and time > now.row_time:
            span = time - now.row_time
            fraction = (sampling.times[k] - now.row_time) / span
        _interpolate(motion, sampling.samples[k], fraction, span)
        k += 1
        if piece.stop.kind != NOWHERE and holds(
            piece.stop,
            motion.blocks.X.mean(),
            motion.rows[1, 0],
        ):
            held = True
            break
    now.sampled = k
    for i in range(motion.rows.shape[1]):
        motion.rows[0, i] = motion.rows[1, i]
    now.row_time = time
    now.has_row = 1
    return held


@bare
def begin_step(
    motion: BlockMotion,
    network: Network,
    piece: Piece,
    sampling: Sampling,
    sliding: float,
) -> int:
    """Sample, kick, and set the length of the next step; or come to rest at the end, or
    where a condition is met.
    """
    now = motion.now
    before = now.step
    t = now.time
    left = piece.end - t
    if before == 0.0 and left > 0.0:  # a piece begins: equal steps
        now.dt = left / math.ceil(left / piece.longest * (1.0 - 1e-12))
    h = now.dt if left > now.dt * (1.0 + 1e-6) else left
    # with a stop condition, steps end at the samples
    if piece.stop.kind != NOWHERE:
        k = now.sampled
        while k < sampling.times.size and sampling.times[k] <= t:
            k += 1
        if k < sampling.times.size:
            h = min(h, sampling.times[k] - t)
    if t + h > piece.look:
        return LOOK
    kick(motion, network, piece, before, h, sliding)
    if _sample(motion, network, piece, sampling, t + h, sliding):
        _rest(motion)
        return STOPPED
    if left <= 0.0:
        _rest(motion)
        return FINISHED
    now.step = h
    now.block = 0
    return ON_THE_WAY


@inlined
def end_step(motion: BlockMotion, piece: Piece) -> None:
    """End a step after all blocks have drifted."""
    now = motion.now
    soon = now.time + now.step
    now.time = piece.end if piece.end - soon < 1e-6 * now.step else soon
    now.block = -1


@inlined
def _rest(motion: BlockMotion) -> None:
    """Bring the velocities to the time of the displacements."""
    for j in range(motion.blocks.X.size):
        motion.blocks.V[j] = motion.blocks.V_now[j]
    now = motion.now
    now.step = 0.0
    now.damped -= now.last_damped
    now.viscous -= now.last_viscous
    now.last_damped = now.last_viscous = 0.0
