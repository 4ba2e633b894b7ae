"""A slider and its contacts in steps of time: how long a step, where it leads, and what
it passes.

The loop is the same for all solvers that take steps: `begin` once; then, while the
course `goes_on`, for each step `plan` says where the slider would go if breaking went
on as in the step before, the contacts are moved there, `settle` moves the slider again
under the force that they have turned out to give (second order in the step), and `fill`
reads the samples off that motion; `keep` stores the state. Only how the contacts move
differs. A course that breaks off between two steps is taken up there again: neither its
pauses nor its samples change the motion.
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

# First entries of the state of every solver: the slider, and what breaking took from
# the force per time.
TIME, POSITION, VELOCITY, LOSS = range(4)

# Columns of the samples: X, V, force of the driving spring, friction force, attached
# fraction.
COLUMNS = 5


class Course(NamedTuple):
    """Course of a slider: its drive, the samples, the largest step, and the end."""

    drive: Quadratic
    slider: Slider
    # shape (m,): when to sample, ascending, none before now; the last one ends the
    # course
    times: Floats
    longest: float  # largest step of time
    reach: float  # largest distance that the slider goes in a step
    # at the first sample where it holds the course ends; steps then end at samples
    stop: Stop = Stop()
    # time of a look at the contacts: the course breaks off before the step that would
    # pass it
    look: float = np.inf
    budget: int = 2**62  # most steps; then the course breaks off


class Stroke(NamedTuple):
    """A step as the contacts see it: from `time` to `end`, for `dt`, the slider goes
    from `X` by `dX`, uniformly.
    """

    time: float
    end: float
    dt: float
    X: float
    dX: float


@jit
def begin(course: Course, state: Floats) -> Motion:
    """Slider as the state has it; in rigid motion it is where the drive is."""
    now = state[TIME]
    X = state[POSITION]
    if is_rigid(course.slider) and course.times.size > 0:
        X = drive_at(course.drive, now)[0]
    return Motion(now, X, state[VELOCITY])


@jit
def attached_now(stretching: Floats, attach: Floats, time: float) -> tuple[float, int]:
    """Sum of the stretchings of the contacts that are attached by a time, and their
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
    """Store where the slider is."""
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
    """Length of the next step: it ends by `until`, and the slider goes no farther than
    it may.

    A free oscillation that matters is followed in steps of `angle` (rad).
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
    # A sliver of a step before the end is shared with the step before it.
    return 0.5 * (until - here.time) if here.time + 2.0 * longest > until else longest


@jit
def goes_on(
    course: Course,
    samples: Floats,
    filled: int,
    taken: int,
) -> bool:
    """Whether samples and steps are left, and the last sample does not meet the
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
    """Guess where the next step ends, under the load that is expected; it ends where
    the slider turns back.
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
    """End of a step under the load that the contacts have turned out to give."""
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
    """Fill the samples up to the `end` of a step that began at `start`; returns how
    many are filled.
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
