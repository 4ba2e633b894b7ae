"""Steps of a linear structure on an interface.

Between kicks the motion of a structure is known exactly: over a step of length `h` its
state goes to

    z' = state z + force F + drive D + velocity V + acceleration a

under a constant force ``F``, with the drive on a parabola. The force at the start of
the step predicts where the contacts go; the element returns the impulse on the way
there; the difference between the impulse and ``F h`` kicks the velocity at the end. The
displacement stays as predicted, as in Verlet's method, and the order is 2.
"""

import math
from typing import NamedTuple

from ._jit import bare, inlined
from .drive import FINISHED, LOOK, PAUSED, STOPPED, Piece, Sampling, drive_at, holds
from .element import ElementState, energy_of, force_of, step
from .quadrature import dot
from .records import Floats, Record, record

RUN = record("begin steps force sample work damped lost_before")
"""Progress of a run: the start of the leg and its steps so far, the friction force, the
next sample, and energies per contact.
"""
CONTROL = record("due integral error updates")
"""State of a controller between its updates: when the next is due, the integral part of
its force, the last error, the number of updates.
"""
# what does the work: the drive by the pulling force, the controller by it on the
# slider, or the track by the friction force
BY_DRIVE, BY_CONTROLLER, BY_TRACK = range(3)
MOVES = 8  # columns of a sample before those of the state
_SAME = 1e-9  # fraction of a step within which two times are the same


class Propagator(NamedTuple):
    """Matrices and vectors that advance the state by a step of length `h`."""

    h: float
    state: Floats
    force: Floats
    drive: Floats
    velocity: Floats
    acceleration: Floats


class Body(NamedTuple):
    """A structure: where its contacts are, ``contact z + track D``, their velocity,
    ``moving z + moving_drive D + moving_rate V``, the kick of an impulse, the force
    that pulls it, ``pull z + pull_drive D + pull_rate V``, and its energies.
    """

    contact: Floats
    moving: Floats
    moving_drive: float
    moving_rate: float
    kick: Floats
    pull: Floats
    pull_drive: float
    pull_rate: float
    track: float
    spring: float  # stiffness of the driving spring, 0 for none
    kinetic: Floats
    elastic: Floats
    lost: Floats
    works: int


class Motion(NamedTuple):
    """What changes in a run: the state, three rows of room for samples, the records."""

    z: Floats
    room: Floats
    run: Record
    memory: Record


class Controller(NamedTuple):
    """Gains of a controller that is updated at intervals and holds its force, the last
    number of the state, in between; with `sample_time` 0 there is no such controller.
    """

    kp: float
    ki: float
    kd: float
    sample_time: float
    encoder_step: float


@inlined
def _form(matrix: Floats, z: Floats) -> float:
    """Return the quadratic form of a state."""
    total = 0.0
    for i in range(z.size):
        for j in range(z.size):
            total += z[i] * matrix[i, j] * z[j]
    return total


@inlined
def _pull(
    body: Body,
    z: Floats,
    D: float,
    V: float,
) -> float:
    """Return the force that pulls the structure."""
    return dot(body.pull, z) + body.pull_drive * D + body.pull_rate * V


@inlined
def _velocity(
    body: Body,
    z: Floats,
    D: float,
    V: float,
) -> float:
    """Return the velocity of the contacts."""
    return dot(body.moving, z) + body.moving_drive * D + body.moving_rate * V


@inlined
def _update(
    controller: Controller,
    memory: Record,
    z: Floats,
    X: float,
    D: float,
) -> None:
    """Update the controller: read the position, and set the force until the next."""
    seen = X
    if controller.encoder_step > 0.0:
        seen = controller.encoder_step * math.floor(X / controller.encoder_step + 0.5)
    error = D - seen
    if memory.updates == 0.0:
        memory.error = error
    every = controller.sample_time
    memory.integral += controller.ki * every * error
    rate = (error - memory.error) / every
    z[-1] = controller.kp * error + memory.integral + controller.kd * rate
    memory.error = error
    memory.due += every
    memory.updates += 1.0


@inlined
def _write(
    row: Floats,
    element: ElementState,
    run: Record,
    z: Floats,
    body: Body,
    X: float,
    drive: tuple[float, float],
) -> None:
    """Write a sample."""
    D, V = drive
    N = element.contacts.size
    row[0] = X
    row[1] = _velocity(body, z, D, V)
    row[2] = run.force
    row[3] = 1.0 - element.sums[0].free / N
    row[4] = energy_of(element)
    row[5] = run.work
    row[6] = run.damped
    row[7] = element.motion[0].lost / N - run.lost_before
    pulled = _pull(body, z, D, V)
    row[8] = pulled
    row[9] = 0.5 * _form(body.kinetic, z)
    row[10] = 0.5 * _form(body.elastic, z)
    if body.spring > 0.0:
        row[10] += 0.5 * pulled * pulled / body.spring
    for i in range(z.size):
        row[11 + i] = z[i]


@inlined
def _between(
    row: Floats,
    before: Floats,
    after: Floats,
    part: float,
    h: float,
) -> None:
    """Interpolate a sample within a step: its displacement as a cubic, the rest
    linearly.
    """
    for i in range(row.size):
        row[i] = before[i] + part * (after[i] - before[i])
    if part < 1.0 - _SAME:
        rest = 1.0 - part
        way = after[0] - before[0]
        bend = rest * (before[1] * h - way) - part * (after[1] * h - way)
        row[0] += part * rest * bend


@bare
def advance_structure(
    element: ElementState,
    moving: Motion,
    body: Body,
    way: Propagator,
    controller: Controller,
    piece: Piece,
    sampling: Sampling,
    counts: tuple[int, int],
) -> int:
    """Advance a leg of `counts[0]` steps by at most `counts[1]` of them; return the
    reason to stop.
    """
    h = way.h
    steps, most = counts
    z = moving.z
    room = moving.room
    run = moving.run[0]
    memory = moving.memory[0]
    after = room[2]
    power = _form(body.lost, z)
    for _ in range(most):
        if run.steps >= steps:
            return FINISHED
        t = run.begin + run.steps * h
        D, V = drive_at(piece.drive, t)
        X = element.motion[0].position
        if controller.sample_time > 0.0 and t >= memory.due - _SAME * h:
            _update(controller, memory, z, X, D)
            power = _form(body.lost, z)
        next_D, next_V = drive_at(piece.drive, t + h)
        i = int(run.sample)
        is_seen = i < sampling.times.size and sampling.times[i] <= t + h + _SAME * h
        if is_seen:
            _write(room[0], element, run, z, body, X, (D, V))
        v = _velocity(body, z, D, V)
        pulled = _pull(body, z, D, V)
        for k in range(z.size):
            after[k] = (
                dot(way.state[k], z)
                + way.force[k] * run.force
                + way.drive[k] * D
                + way.velocity[k] * V
                + way.acceleration[k] * piece.drive.acceleration
            )
        for k in range(z.size):
            z[k] = after[k]
        end = dot(body.contact, z) + body.track * next_D
        _, impulse, _ = step(element, h, v, end)
        for k in range(z.size):
            z[k] += body.kick[k] * (impulse - run.force * h)
        run.force = force_of(element)
        mean = 0.5 * (pulled + _pull(body, z, next_D, next_V))
        if body.works == BY_DRIVE:
            run.work += mean * (next_D - D)
        elif body.works == BY_CONTROLLER:
            run.work += mean * (end - X)
        else:
            run.work += impulse * (next_D - D) / h
        power_before = power
        power = _form(body.lost, z)
        run.damped += 0.5 * h * (power_before + power)
        run.steps += 1.0
        if not math.isfinite(end):
            return FINISHED
        if is_seen:
            _write(room[1], element, run, z, body, end, (next_D, next_V))
            while i < sampling.times.size and sampling.times[i] <= t + h + _SAME * h:
                part = min(max((sampling.times[i] - t) / h, 0.0), 1.0)
                _between(sampling.samples[i], room[0], room[1], part, h)
                row = sampling.samples[i]
                i += 1
                run.sample = i
                if holds(piece.stop, row[0], row[8]):
                    return STOPPED
        if piece.look <= t + h + _SAME * h:
            return LOOK
    return FINISHED if run.steps >= steps else PAUSED
