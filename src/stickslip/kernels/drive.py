"""The drive, one piece at a time: the motion of the far end of the spring, and the
condition that ends a piece early.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import inlined
from .records import Floats


class Quadratic(NamedTuple):
    """Motion of the drive: ``position + velocity u + acceleration u^2/2`` at a time `u`
    after `start`.
    """

    start: float
    position: float
    velocity: float
    acceleration: float


STILL = Quadratic(0.0, 0.0, 0.0, 0.0)

# Reasons for a kernel to return: the end of the piece is reached, its condition holds,
# or the budget is used up; or, before it can go on, a snapshot is due, the slider has
# stopped, there is no room for more cohorts, or random numbers are used up. `UNSOLVED`:
# the next step has no solution. `STANDS_STILL`: an event took no time and changed
# nothing, and would do so again.
ON_THE_WAY, FINISHED, STOPPED, PAUSED, LOOK, ARRESTED, NO_ROOM = range(7)
DRAWS_USED_UP, THRESHOLDS_USED_UP, DELAYS_USED_UP, UNSOLVED, STANDS_STILL = range(7, 12)

# kinds of conditions
NOWHERE, TRAVEL, FORCE_ABOVE, FORCE_BELOW = range(4)


class Stop(NamedTuple):
    """Condition that ends a piece early, at the first sample at which it holds.

    `NOWHERE` never holds; `TRAVEL` holds if the slider is at least `value` away from
    `origin`; `FORCE_ABOVE` and `FORCE_BELOW` if the driving force is at least and at
    most `value`.
    """

    kind: int = NOWHERE
    value: float = 0.0
    origin: float = 0.0


class Piece(NamedTuple):
    """A piece of the drive up to `end`, or to a condition that holds at a sample, in
    steps of at most `longest`.

    `look` is the time of a snapshot of the contacts: the kernel returns before the
    flight or step that would pass it, so that a snapshot does not change the motion.
    """

    drive: Quadratic
    end: float
    stop: Stop = Stop()
    look: float = math.inf
    longest: float = math.inf


class Sampling(NamedTuple):
    """Increasing times of samples, shape (n,), and the samples, shape (n, columns)."""

    times: Floats
    samples: Floats


@inlined
def drive_at(drive: Quadratic, time: float) -> tuple[float, float]:
    """Position and velocity of the drive."""
    u = time - drive.start
    v = drive.velocity
    a = drive.acceleration
    return drive.position + u * (v + 0.5 * a * u), v + a * u


NO_LOAD = np.empty((0, 2))


@inlined
def load_at(load: Floats, time: float) -> float:
    """Load at a time from its points, rows of time and value: linear between them,
    constant beyond; 1 if there are none.
    """
    n = load.shape[0]
    if n == 0:
        return 1.0
    i = int(np.searchsorted(load[:, 0], time, side="right"))
    if i == 0 or i == n:
        return float(load[max(i - 1, 0), 1])
    since = (time - load[i - 1, 0]) / (load[i, 0] - load[i - 1, 0])
    return float(load[i - 1, 1] + since * (load[i, 1] - load[i - 1, 1]))


@inlined
def turns_at(drive: Quadratic, now: float) -> float:
    """Time at which the drive next reverses, after `now`; infinite if it does not.

    It is computed from the piece alone: a remaining time, the velocity over the
    acceleration, would stay above 0 by rounding at the reversal itself.
    """
    if drive.acceleration == 0.0:
        return math.inf
    turn = drive.start - drive.velocity / drive.acceleration
    return turn if turn > now else math.inf


@inlined
def holds(stop: Stop, X: float, driving_force: float) -> bool:
    """Whether the condition holds at a position of the slider and a spring force."""
    if stop.kind == TRAVEL:
        return bool(abs(X - stop.origin) >= stop.value)
    if stop.kind == FORCE_ABOVE:
        return bool(driving_force >= stop.value)
    return bool(stop.kind == FORCE_BELOW and driving_force <= stop.value)
