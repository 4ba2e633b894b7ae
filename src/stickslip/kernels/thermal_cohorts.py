"""The master equation of contacts that break by thermal activation in any way, on
cohorts, under a slider, Eq. (11).

A cohort is what attached in one step, at the same place and time. Each of its contacts
keeps its strength, so that what survives is an average over strengths: a strength
survives as ``exp(-H)``, with ``H`` the integral of the rate over the cohort's life,
which is followed at nodes of the strengths. Where two numbers say it all, `breaking`
does with them.

Within a step the slider moves one way and by less than a fraction of the width over
which rates change; in a hold steps grow with time. What attaches in a step does so in
its middle; what of it breaks within the step is passed on, so that no contact is lost.
"""

import copy
import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .cohort_store import (
    ALIVE,
    MASS,
    PLACE,
    Delays,
    History,
    due,
    first_history,
    has_room,
    join,
    longer,
)
from .drive import (
    FINISHED,
    NO_ROOM,
    NOWHERE,
    PAUSED,
    STILL,
    STOPPED,
    Quadratic,
    Stop,
    drive_at,
    holds,
)
from .hazard import EXPONENTIAL, LOGARITHMIC, Growth, Hazard, grown, rate
from .oscillator import (
    Load,
    Motion,
    Slider,
    Travel,
    free_amplitude,
    is_rigid,
    spring_force,
    travel,
)
from .records import Floats, Record, blank, record
from .rules import gauss

MOTION = record(
    "position velocity contact_force attached stored work damped broken time",
    "force loss slid next_step outside reattached",
)
"""What changes from step to step: what is sampled, in the order of the columns of a
run, and the time. Then the force of the attached contacts alone, what breaking takes
from the force per time, the force of a detached contact, the step to try next, the
fraction that waits, and all that has re-attached.
"""
COUNTS = record(counts="cohorts sampled left")
"""Cohorts in use; of a call, the samples that are filled, and the steps that are
left.
"""

SINCE, TRIAL_ALIVE = range(4, 6)
"""Rows of the cohorts behind those of the store: when they attached, and what a step
under trial leaves.
"""
ROWS = 6

# a cohort of which a smaller fraction survives is dropped; its rest counts as broken
EXTINCT = 1e-13
# a contact whose integrated rate is smaller is as good as whole, and with it all of
# larger strengths
UNTRIED = 1e-10
_PIECE = 0.5  # largest logarithm of the growth of an age in a panel of its quadrature

_NODE, _WEIGHT = gauss(3)


class Model(NamedTuple):
    """How contacts break."""

    hazard: Hazard
    growth: Growth
    node: Floats  # shape (n,): strengths at which the hazard is followed
    weight: Floats  # shape (n,)
    width: float  # stretching over which rates change


class Limits(NamedTuple):
    """Largest steps: of the slider in widths, of the mass that breaks, of an
    oscillation that matters in radians.
    """

    reach: float
    broken: float
    angle: float


class State(NamedTuple):
    """All that the next step needs."""

    motion: Record  # record of MOTION
    cohort: Floats  # shape (ROWS, room)
    run: Floats  # shape (room, nodes): by cohort ``H`` at the nodes
    trial: Floats  # the same at the end of a step under trial
    # shape (4, n): of a cohort in it weights and stretchings, and factors and addends
    # of its thresholds
    course: Floats
    history: History
    used: Record  # record of COUNTS
    before: Record  # MOTION, shape (1,): motion at the start of a step
    due: Floats  # shape (1,): what is to have re-attached by its end


class Case(NamedTuple):
    """All that stays the same while the drive moves by one rule; detached contacts
    slide with the force `f_d`.
    """

    model: Model
    delays: Delays
    slider: Slider
    f_d: float
    limits: Limits
    drive: Quadratic = STILL


class _Trial(NamedTuple):
    """What a step comes to."""

    dt: float
    X: float
    V: float
    work: float
    squares: float
    force: float
    mass: float
    broken: float
    attaching: float
    slid: float


@bare
def _lay(
    course: Floats, growth: Growth, age: float, dt: float, x: float, dx: float
) -> int:
    """Lay a course over a time in which the stretching goes from `x` by `dx`,
    uniformly: how many nodes it has.
    """
    # of the logarithm of the age
    pieces = 1
    span = 0.0
    if growth.kind == EXPONENTIAL and growth.first * age < 40.0:
        pieces += int(min(2.0 * growth.first * dt, 1e6))
    elif growth.kind == LOGARITHMIC and growth.first > 0.0:
        span = math.log1p(dt / (age + growth.second))
        pieces += int(span / _PIECE)
    pieces = min(pieces, course.shape[1] // 3)
    for n in range(3 * pieces):
        part = (n // 3 + _NODE[n % 3]) / pieces
        t = part * dt
        density = dt
        if span > 0.0:
            t = (age + growth.second) * math.expm1(part * span)
            density = (age + growth.second + t) * span
        course[0, n] = _WEIGHT[n % 3] / pieces * density
        course[1, n] = x + dx * t / dt
        course[2, n], course[3, n], _, _ = grown(growth, age + t)
    return int(3 * pieces)


@bare
def follow(
    state: State, model: Model, j: int, now: float, dt: float, X: float, dX: float
) -> float:
    """Take a cohort along: the fraction of it that survives."""
    age = now - state.cohort[SINCE, j]
    x = X - state.cohort[PLACE, j]
    course = state.course
    count = _lay(state.course, model.growth, age, dt, x, dX)
    factor, addend, _, _ = grown(model.growth, age + dt)
    fraction = seen = 0.0
    end = abs(x + dX)
    for k in range(model.node.size):
        run = state.run[j, k]
        strength = model.node[k]
        if run < 40.0:
            if end >= strength * factor + addend:
                run = math.inf
            else:
                for n in range(count):
                    threshold = strength * course[2, n] + course[3, n]
                    run += course[0, n] * rate(model.hazard, course[1, n], threshold)
                fraction += model.weight[k] * math.exp(-run)
        state.trial[j, k] = run
        seen += model.weight[k]
        if run < UNTRIED:  # stronger contacts are tried even less
            for i in range(k + 1, model.node.size):
                state.trial[j, i] = state.run[j, i]
            fraction += 1.0 - seen
            break
    return fraction


@bare
def _move(case: Case, motion: Record, load: Load, dt: float) -> Travel:
    """Move the slider on for a time `dt`."""
    slider = case.slider
    drive = case.drive
    X = motion.position
    V = motion.velocity
    if not is_rigid(slider) and slider.mass == 0.0:  # in balance
        D, velocity = drive_at(drive, motion.time + dt)
        K = slider.stiffness
        X1 = X + (K * (D - X) - load.force + load.loss * dt) / (K + load.stiffness)
        D0, velocity0 = drive_at(drive, motion.time)
        work = 0.5 * dt * K * ((D0 - X) * velocity0 + (D - X1) * velocity)
        return Travel(X1, (X1 - X) / dt, work, 0.0)
    return travel(slider, drive, Motion(motion.time, X, V), load, dt)


@bare
def _arrive(
    state: State, case: Case, known: float, part: float, dt: float, load: Load
) -> _Trial:
    """End of a step under this load, in which `known` re-attaches, and a part of
    what breaks in it.
    """
    motion = state.motion
    model = case.model
    cohort = state.cohort
    now = motion.time
    X = motion.position
    X1, V1, work, squares = _move(case, motion, load, dt)
    dX = X1 - X
    old = force = 0.0
    for j in range(state.used.cohorts):
        fraction = follow(state, model, j, now, dt, X, dX)
        alive = cohort[MASS, j] * fraction if fraction > EXTINCT else 0.0
        alive = min(alive, cohort[ALIVE, j])
        cohort[TRIAL_ALIVE, j] = alive
        old += alive
        force += alive * (X1 - cohort[PLACE, j])
    # What attaches is the cohort behind the last.
    j = state.used.cohorts
    middle = X + 0.5 * dX
    when = now + 0.5 * dt
    cohort[PLACE, j] = middle
    cohort[SINCE, j] = when
    state.run[j, :] = 0.0
    young = follow(state, model, j, when, 0.5 * dt, middle, 0.5 * dX)
    broken = (motion.attached - old + (1.0 - young) * known) / (
        1.0 - (1.0 - young) * part
    )
    attaching = known + part * broken
    cohort[MASS, j] = cohort[ALIVE, j] = attaching
    cohort[TRIAL_ALIVE, j] = attaching * young
    mass = old + attaching * young
    force += attaching * young * 0.5 * dX
    slid = min(max(motion.slid + dX, -case.f_d), case.f_d)
    return _Trial(dt, X1, V1, work, squares, force, mass, broken, attaching, slid)


@bare
def _load(case: Case, motion: Record, loss: float) -> Load:
    """Friction force on the way, with what breaking takes from it per time."""
    stiffness = motion.attached
    if case.f_d > 0.0 and abs(motion.slid) < case.f_d:
        stiffness = 1.0
    return Load(motion.contact_force, stiffness, loss, 0.0)


@bare
def _friction(trial: _Trial) -> float:
    return trial.force + (1.0 - trial.mass) * trial.slid


@bare
def _try_step(state: State, case: Case, dt: float) -> tuple[_Trial, Load, float]:
    """Find the end of a step without taking it, the load on the way, and how much
    too long it is (above 1).
    """
    motion = state.motion
    slider = case.slider
    width = case.model.width
    part = due(state.history, case.delays, dt, state.due)
    known = state.due[0] - motion.reattached
    load = _load(case, motion, motion.loss)
    guess = math.inf
    for _ in range(1 if is_rigid(slider) else (3 if slider.mass > 0.0 else 5)):
        trial = _arrive(state, case, known, part, dt, load)
        disagreement = abs(trial.X - guess)
        guess = trial.X
        load = _load(
            case,
            motion,
            (
                motion.contact_force
                + load.stiffness * (trial.X - motion.position)
                - _friction(trial)
            )
            / dt,
        )
        if disagreement < 1e-3 * case.limits.reach * case.limits.reach * width:
            break
    disagreement = 0.0 if is_rigid(slider) else disagreement
    trouble = abs(trial.X - motion.position) / (case.limits.reach * width)
    trouble = max(
        trouble,
        trial.broken / case.limits.broken,
        trial.attaching / (8.0 * case.limits.broken),
    )
    trouble = max(trouble, math.sqrt(disagreement / (0.02 * case.limits.reach * width)))
    return trial, load, trouble


@bare
def _longest_step(motion: Record, case: Case) -> float:
    """Resolve the oscillation of the slider on its contacts where it matters."""
    slider = case.slider
    if is_rigid(slider) or slider.mass == 0.0:
        return math.inf
    fast = (slider.stiffness + 1.0) / slider.mass
    if 0.25 * slider.damping * slider.damping >= fast:
        return math.inf
    here = Motion(motion.time, motion.position, motion.velocity)
    if (
        free_amplitude(slider, case.drive, here, _load(case, motion, motion.loss))
        < 1e-3 * case.model.width
    ):
        return math.inf
    return case.limits.angle / math.sqrt(fast)


@bare
def _commit(state: State, case: Case, trial: _Trial, load: Load) -> None:
    """Make the trial the state."""
    motion = state.motion
    cohort = state.cohort
    f_d = case.f_d
    X = motion.position
    now = motion.time
    dX = trial.X - X
    end = now + trial.dt
    before = motion.slid
    out = 1.0 - motion.attached
    middle = 0.5 * (before + trial.slid)
    lost = stored = 0.0
    kept = 0
    for j in range(state.used.cohorts + 1):
        place = cohort[PLACE, j]
        alive = cohort[TRIAL_ALIVE, j]
        mass = cohort[MASS, j]
        x = X + 0.5 * dX - place
        lost += 0.5 * (x * x - middle * middle) * (cohort[ALIVE, j] - alive)
        if alive <= 0.0:
            continue
        stored += 0.5 * (trial.X - place) ** 2 * alive
        if j == state.used.cohorts and _is_near(cohort, kept - 1, case, place, alive):
            cohort[MASS, kept - 1] += mass
            join(cohort, kept - 1, place, alive, SINCE, cohort[SINCE, j])
            continue
        cohort[PLACE, kept], cohort[SINCE, kept], cohort[MASS, kept] = (
            place,
            cohort[SINCE, j],
            mass,
        )
        cohort[ALIVE, kept] = alive
        for k in range(state.run.shape[1]):
            state.run[kept, k] = state.trial[j, k]
        kept += 1
    state.used.cohorts = kept
    slides = abs(dX - (trial.slid - before))
    lost += out * f_d * slides + 0.5 * middle * middle * trial.attaching
    motion.broken += lost
    motion.stored = stored + 0.5 * (1.0 - trial.mass) * trial.slid * trial.slid
    friction = _friction(trial)
    if is_rigid(case.slider):
        motion.work += 0.5 * (motion.contact_force + friction) * dX
    else:
        motion.work += trial.work
        motion.damped += case.slider.mass * case.slider.damping * trial.squares
    motion.time = end
    motion.position = trial.X
    motion.velocity = trial.V
    motion.contact_force = friction
    motion.force = trial.force
    motion.attached = trial.mass
    motion.loss = load.loss
    motion.slid = trial.slid
    motion.outside += trial.broken - trial.attaching
    motion.reattached += trial.attaching
    history = state.history
    kept = state.history.times.size
    n = history.entered[0]
    history.times[n % kept] = end
    history.broken[n % kept, 0] = history.broken[(n - 1) % kept, 0] + trial.broken
    history.entered[0] = n + 1


@inlined
def _is_near(cohort: Floats, j: int, case: Case, place: float, mass: float) -> bool:
    """Whether a cohort is so small, and so near to a place, that what attaches there
    may join it.
    """
    near = 0.1 * case.limits.reach * case.model.width
    small = 0.1 * case.limits.broken
    return bool(
        j >= 0
        and cohort[ALIVE, j] + mass < small
        and abs(place - cohort[PLACE, j]) < near
    )


@bare
def _sample(
    row: Record,
    t: float,
    before: Record,
    trial: _Trial,
    load: Load,
    after: Record,
    case: Case,
) -> None:
    """What a step passes at time `t`."""
    u = t - before.time
    part = u / trial.dt
    row.attached = before.attached + part * (after.attached - before.attached)
    row.broken = before.broken + part * (after.broken - before.broken)
    row.contact_force = before.contact_force + part * (
        after.contact_force - before.contact_force
    )
    row.stored = before.stored + part * (after.stored - before.stored)
    row.work = before.work + part * (after.work - before.work)
    row.damped = before.damped
    row.position = before.position
    row.velocity = before.velocity
    if u <= 0.0:
        return
    X, V, work, squares = _move(case, before, load, u)
    row.position = X
    row.velocity = V
    bend = X - before.position - part * (trial.X - before.position)
    row.contact_force += load.stiffness * bend
    row.stored += row.contact_force * bend
    if not is_rigid(case.slider):
        row.work = before.work + work
        row.damped = before.damped + case.slider.mass * case.slider.damping * squares


@bare
def _planned(
    state: State, case: Case, left: float, smallest: float
) -> tuple[_Trial, Load, float]:
    """Find a step as long as may be, at most `left`: its end, its load and its
    trouble, NaN if no step helps.
    """
    motion = state.motion
    slider = case.slider
    planned = min(motion.next_step, _longest_step(motion, case))
    while True:
        dt = (
            left
            if planned > 0.999 * left
            else (0.5 * left if planned > 0.5 * left else planned)
        )
        trial, load, trouble = _try_step(state, case, dt)
        # a step goes one way
        if (
            motion.velocity * trial.V < 0.0
            and slider.mass > 0.0
            and not is_rigid(slider)
        ):
            part = motion.velocity / (motion.velocity - trial.V)
            if 0.05 < part < 0.95:
                dt = planned = part * dt
                trial, load, trouble = _try_step(state, case, dt)
        if math.isnan(trouble) or trouble <= 1.0 or dt <= smallest:
            break
        planned = dt * max(0.9 / trouble, 0.2)
    # a step cut short by the end says little about the next one
    if dt >= planned or trouble > 0.45:
        motion.next_step = dt * min(0.9 / max(trouble, 1e-9), 2.0)
    return trial, load, trouble


@bare
def _run(
    state: State, case: Case, stop: Stop, until: float, times: Floats, rows: Record
) -> int:
    """Take steps until there is a reason to come back."""
    motion = state.motion
    used = state.used
    smallest = 1e-13 * max(1.0, abs(until))
    if is_rigid(case.slider):
        motion.velocity = drive_at(case.drive, motion.time)[1]
    while used.left > 0:
        while (
            used.sampled < times.size and times[used.sampled] <= motion.time + smallest
        ):
            rows[used.sampled] = motion
            used.sampled += 1
            X = motion.position
            time = times[used.sampled - 1]
            if holds(
                stop,
                X,
                spring_force(case.slider, case.drive, time, X, motion.contact_force),
            ):
                return STOPPED
        left = until - motion.time
        if left <= smallest:
            return FINISHED
        if used.cohorts + 2 > state.cohort.shape[1] or not has_room(state.history):
            return NO_ROOM
        if stop.kind != NOWHERE and used.sampled < times.size:
            left = min(left, times[used.sampled] - motion.time)
        trial, load, trouble = _planned(state, case, left, smallest)
        if math.isnan(trouble):  # the caller is told by where the slider is
            motion.position = math.nan
            return PAUSED
        state.before[0] = motion
        used.left -= 1
        _commit(state, case, trial, load)
        while (
            used.sampled < times.size and times[used.sampled] < motion.time - smallest
        ):
            _sample(
                rows[used.sampled],
                times[used.sampled],
                state.before[0],
                trial,
                load,
                motion,
                case,
            )
            used.sampled += 1
    return PAUSED


def advance(
    state: State,
    case: Case,
    until: float,
    times: Floats,
    stop: Stop = Stop(),
    max_steps: int = 2**62,
) -> tuple[State, Record, int]:
    """Go on from a state, which is not changed, under one piece of the drive; as
    `panels.advance`.
    """
    state = copy.deepcopy(state)
    rows = np.empty(times.size, MOTION).view(np.recarray)
    state.used.sampled = 0
    state.used.left = max_steps
    while (reason := _run(state, case, stop, until, times, rows)) == NO_ROOM:
        if state.used.cohorts + 2 > state.cohort.shape[1]:
            double = np.concatenate([state.cohort, np.zeros_like(state.cohort)], axis=1)
            run, trial = (
                np.concatenate([part, np.zeros_like(part)])
                for part in (state.run, state.trial)
            )
            state = state._replace(cohort=double, run=run, trial=trial)
        else:
            state = state._replace(history=longer(state.history))
    return state, rows[: state.used.sampled], reason


def initial_state(
    model: Model,
    delays: Delays,
    x: Floats,
    weight: Floats,
    since: float,
    velocity: float,
) -> State:
    """Put a slider at 0 on contacts of these stretchings, whose thresholds lie
    beyond them; the rest is detached.
    """
    count = x.size
    state = _empty(model, delays, 2 * count + 256, 0.0)
    cohort = state.cohort
    above = model.node > np.abs(x)[:, None]
    cohort[PLACE, :count] = -x
    cohort[SINCE, :count] = since
    cohort[ALIVE, :count] = weight
    state.run[:count] = np.where(above, 0.0, np.inf)
    cohort[MASS, :count] = weight / np.maximum(above @ model.weight, 1e-12)
    return _summed(state, count, velocity)


def sliding_state(
    model: Model,
    delays: Delays,
    velocity: float,
    limits: Limits,
    step: float,
    f_d: float,
) -> State:
    """Put a slider at 0 in steady sliding on its contacts: newborns taken along step
    by step until none is left.
    """
    mean = float((delays.time * delays.weight).sum()) if delays.time.size else math.inf
    state = _empty(model, delays, 1024, 0.0)
    distance = step

    while (
        follow(state, model, 0, 0.0, distance / velocity, 0.0, distance) < 0.97
        and distance > step / 16.0
    ):
        distance *= 0.5  # most newborns should not break before the first step is over
    x = [0.0]
    alive = [1.0]
    runs = [np.zeros(model.node.size)]
    while alive[-1] > EXTINCT:
        fraction = follow(
            state, model, 0, x[-1] / velocity, distance / velocity, x[-1], distance
        )
        state.run[0] = state.trial[0]
        x.append(x[-1] + distance)
        alive.append(min(fraction, alive[-1]))
        runs.append(state.run[0].copy())
        distance = min(1.2 * distance, step)
    place = np.array(x)
    left = np.array(alive[:-1])
    count = len(x) - 1
    part = 0.5 * np.diff(place, prepend=0.0)
    part = part[:count] + 0.5 * np.diff(place)
    cycle = float((part * left).sum()) + velocity * mean
    if step > 1.01 * limits.broken * cycle:  # so many would break in it
        return sliding_state(
            model, delays, velocity, limits, limits.broken * cycle, f_d
        )
    state = _empty(model, delays, 2 * count + 256, velocity / cycle)
    back = place[count - 1 :: -1]
    cohort = state.cohort
    cohort[PLACE, :count] = -back
    cohort[SINCE, :count] = -back / velocity
    cohort[MASS, :count] = part[::-1] / cycle
    cohort[ALIVE, :count] = (part * left)[::-1] / cycle
    state.run[:count] = runs[count - 1 :: -1]
    state.motion.slid = f_d
    return _summed(state, count, velocity)


def _empty(model: Model, delays: Delays, room: int, rate_before: float) -> State:
    """Make room for a state; contacts broke at this rate before."""
    run = np.zeros((room, model.node.size))
    history = first_history(delays, np.full(1, rate_before))
    cohort = np.zeros((ROWS, room))
    state = State(
        blank(MOTION),
        cohort,
        run,
        run.copy(),
        np.empty((4, 603)),
        history,
        blank(COUNTS),
        blank(MOTION, 1),
        np.zeros(1),
    )
    state.motion.reattached = -rate_before * float((delays.time * delays.weight).sum())
    return state


def _summed(state: State, count: int, velocity: float) -> State:
    motion = state.motion
    alive = state.cohort[ALIVE, :count]
    x = -state.cohort[PLACE, :count]
    state.used.cohorts = count
    motion.velocity = velocity
    motion.next_step = math.inf
    motion.force, motion.attached = float((alive * x).sum()), float(alive.sum())
    motion.outside = out = 1.0 - motion.attached
    motion.contact_force = motion.force + out * motion.slid
    motion.stored = 0.5 * float((alive * x * x).sum()) + 0.5 * out * motion.slid**2
    return state
