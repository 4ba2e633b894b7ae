"""The drive, one piece at a time: how its far end of the spring moves, and where a piece ends early."""

from typing import NamedTuple

from ._jit import inlined


class Quadratic(NamedTuple):
    """Motion of the drive: ``position + velocity u + acceleration u^2/2`` a time `u` after `start`."""

    start: float
    position: float
    velocity: float
    acceleration: float


STILL = Quadratic(0.0, 0.0, 0.0, 0.0)

# Why a kernel came back: the end of a piece is reached, its condition holds, its budget is spent; or, to go on, a look
# has to be taken, there is no more room for cohorts or for steps in a delay, random thresholds or delays are used up.
# `UNSOLVED`: the next step has no solution.
ON_THE_WAY, FINISHED, STOPPED, PAUSED, LOOK, NO_ROOM, NO_HISTORY, THRESHOLDS_USED_UP, DELAYS_USED_UP, UNSOLVED = range(
    10
)

# Kinds of conditions.
NOWHERE, TRAVEL, FORCE_ABOVE, FORCE_BELOW = range(4)


class Stop(NamedTuple):
    """Where a piece ends early: at the first sample at which a condition holds.

    `NOWHERE`; `TRAVEL`, the slider at least `value` away from `origin`; `FORCE_ABOVE` and `FORCE_BELOW`, the driving
    force at least and at most `value`.
    """

    kind: int = NOWHERE
    value: float = 0.0
    origin: float = 0.0


@inlined
def drive_at(drive: Quadratic, time: float) -> tuple[float, float]:
    """Position and velocity of the drive."""
    u = time - drive.start
    v, a = drive.velocity, drive.acceleration
    return drive.position + u * (v + 0.5 * a * u), v + a * u


@inlined
def holds(stop: Stop, X: float, driving_force: float) -> bool:
    """Whether the condition holds at a position of the slider and a spring force."""
    if stop.kind == TRAVEL:
        return bool(abs(X - stop.origin) >= stop.value)
    if stop.kind == FORCE_ABOVE:
        return bool(driving_force >= stop.value)
    return bool(stop.kind == FORCE_BELOW and driving_force <= stop.value)
