"""A slider and its contacts in time steps: how long a step is, where it leads, and the
samples in it.

The loop is the same for all solvers that take steps: `begin` once; then, while the
course `goes_on`, for each step `plan` predicts where the slider would go if breaking
continued as in the step before, the contacts are moved there, `settle` moves the slider
again under the force that the contacts turned out to exert (second order in the step),
and `fill` reads the samples off that motion; `keep` stores the state. Only the motion
of the contacts differs. A course that breaks off between two steps is resumed there:
neither its pauses nor its samples change the motion.
"""

from typing import NamedTuple

import numpy as np

from ._jit import jit
from .drive import NOWHERE, Quadratic, Stop, drive_at, holds
from .oscillator import (
    Load,
    Motion,
    Slider,
    free_amplitude,
    is_rigid,
    move,
    spring_force,
)
from .records import Floats

# First entries of the state of every solver: the slider, and the rate at which breaking
# reduces the force.
TIME, POSITION, VELOCITY, LOSS = range(4)

# Columns of the samples: X, V, force of the driving spring, friction force, attached
# fraction.
COLUMNS = 5


class Course(NamedTuple):
    """Course of a slider: its drive, the samples, the largest step, and the end."""

    drive: Quadratic
    slider: Slider
    # shape (m,): times of the samples, ascending, none before now; the last one ends
    # the course
    times: Floats
    longest: float  # largest step of time
    reach: float  # largest displacement of the slider in a step
    # the course ends at the first sample at which it holds; steps then end at samples
    stop: Stop = Stop()
    # when the contacts are to be recorded: the course breaks off before the step that
    # would pass this time
    look: float = np.inf
    budget: int = 2**62  # most steps; then the course breaks off


class Stroke(NamedTuple):
    """A step for the contacts: from `time` to `end`, for `dt`, the slider moves from
    `X` by `dX`, uniformly.
    """

    time: float
    end: float
    dt: float
    X: float
    dX: float


@jit
def begin(course: Course, state: Floats) -> Motion:
    """Return the slider as stored in the state; in rigid motion, where the drive is."""
    now = state[TIME]
    X = state[POSITION]
    if is_rigid(course.slider) and course.times.size > 0:
        X = drive_at(course.drive, now)[0]
    return Motion(now, X, state[VELOCITY])


@jit
def attached_now(stretching: Floats, attach: Floats, time: float) -> tuple[float, int]:
    """Return the sum of the stretchings of the contacts attached by a time, and their
    number.
    """
    total = 0.0
    count = 0
    for i in range(stretching.size):
        if attach[i] <= time:
            total += stretching[i]
            count += 1
    return total, count


@jit
def keep(state: Floats, here: Motion, loss: float) -> None:
    """Store the motion of the slider."""
    state[TIME] = here.time
    state[POSITION] = here.X
    state[VELOCITY] = here.V
    state[LOSS] = loss


@jit
def _pace(
    course: Course,
    here: Motion,
    load: Load,
    angle: float,
    until: float,
) -> float:
    """Return the length of the next step: it ends by `until`, and the slider moves no
    farther than its `reach`.

    A free oscillation large enough to matter is resolved in steps of `angle` (rad).
    """
    longest = min(course.longest, until - here.time)
    reach = course.reach
    slider = course.slider
    fast = (
        abs(drive_at(course.drive, here.time)[1])
        + abs(course.drive.acceleration) * longest
    )
    if not is_rigid(slider):
        fast = max(fast, abs(here.V))
        if free_amplitude(slider, course.drive, here, load) > 0.05 * reach:
            longest = min(
                longest,
                angle / np.sqrt((slider.stiffness + load.stiffness) / slider.mass),
            )
    longest = min(longest, reach / max(fast, 1e-300))
    if here.time + 1.0000001 * longest >= until:
        return until - here.time
    # If a short step would be left before the end, two equal steps share the rest.
    return 0.5 * (until - here.time) if here.time + 2.0 * longest > until else longest


@jit
def goes_on(
    course: Course,
    samples: Floats,
    filled: int,
    taken: int,
) -> bool:
    """Return whether samples and steps are left, and the last sample does not meet the
    condition that ends the course.
    """
    if filled == course.times.size or taken == course.budget:
        return False
    return filled == 0 or not holds(
        course.stop,
        samples[filled - 1, 0],
        samples[filled - 1, 2],
    )


@jit
def plan(
    course: Course,
    filled: int,
    here: Motion,
    load: Load,
    angle: float,
) -> tuple[Motion, Stroke]:
    """Predict where the next step ends, under the expected load; it ends where the
    slider reverses.
    """
    end = course.times[filled if course.stop.kind != NOWHERE else -1]
    dt = _pace(course, here, load, angle, end)
    guess = move(course.slider, course.drive, here, load, dt)
    shorter = dt
    if guess.V * here.V < 0.0:
        turn = dt * here.V / (here.V - guess.V)
        if 0.05 * dt < turn < 0.95 * dt:
            shorter = turn
            guess = move(course.slider, course.drive, here, load, shorter)
    if shorter < dt or dt < end - here.time:
        end = here.time + shorter
    guess = Motion(end, guess.X, guess.V)
    return guess, Stroke(
        here.time,
        end,
        shorter,
        here.X,
        guess.X - here.X,
    )


@jit
def settle(
    course: Course,
    here: Motion,
    guess: Motion,
    load: Load,
    dt: float,
) -> Motion:
    """Return the end of a step under the load that the contacts turned out to exert."""
    if is_rigid(course.slider):
        return guess
    there = move(course.slider, course.drive, here, load, dt)
    return Motion(guess.time, there.X, there.V)


@jit
def fill(
    course: Course,
    samples: Floats,
    filled: int,
    start: Motion,
    load: Load,
    end: float,
    attached: float,
) -> int:
    """Fill the samples up to the `end` of a step that began at `start`; return how many
    are filled.
    """
    while filled < course.times.size and course.times[filled] <= end:
        t = course.times[filled] - start.time
        here = move(course.slider, course.drive, start, load, t)
        force = (
            load.force
            + load.stiffness * (here.X - start.X)
            - t * (load.loss + 0.5 * load.ramp * t)
        )
        samples[filled, 0] = here.X
        samples[filled, 1] = here.V
        samples[filled, 2] = spring_force(
            course.slider,
            course.drive,
            course.times[filled],
            here.X,
            force,
        )
        samples[filled, 3] = force
        samples[filled, 4] = attached
        filled += 1
    return filled
