"""The master equation of contacts that break by thermal activation, on cohorts, under the motion of a slider, Eq. (11).

A cohort is what attached in one step, at the same place and time. Each of its contacts keeps its threshold, so that
what survives is an average over thresholds of ``exp(-H)``, with ``H`` the integral of the rate over the cohort's life.

- By `Bell`, without ageing or with thresholds that grow by an addend ``g``, ``H = G exp(-x_c/A)``: one number,
  ``ln G``, says what survives, by a table of ``J(u) = Int P_c(x_c) exp(-exp((u - x_c)/A)) dx_c`` at ``u = A ln G``.
- Otherwise ``H`` is followed at nodes of the thresholds.

Within a step the slider moves one way and by less than a fraction of the width over which rates change; in a hold steps
grow with time. Half of what attaches in a step does so at each of its ends; what of the first half breaks within the
step is passed on, so that no contact is lost.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import jit
from .drive import NOWHERE, Quadratic, Stop, drive_at, holds
from .growth import EXPONENTIAL, Growth
from .hazard import Hazard, rate, threshold_at
from .oscillator import Load, Motion, Slider, free_amplitude, is_rigid, travel
from .survival import Table, value_at

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Scalars of the state; the first are those of the samples, in the order of the columns of a run, then the rest.
(
    POSITION,
    VELOCITY,
    CONTACT_FORCE,
    ATTACHED,
    STORED,
    WORK,
    DAMPED,
    BROKEN,
    TIME,
    FORCE,
    LOSS,
    SLID,
    NEXT_STEP,
    OUTSIDE,
) = range(14)
COLUMNS, SCALARS = 8, 14

# Rows of the cohorts: where and when they attached, how many did, how many are left, and how far beyond the growth of
# their thresholds they were stretched at most.
BIRTH, SINCE, MASS, ALIVE, REACH, TRIAL_ALIVE, TRIAL_REACH = range(7)
ROWS = 7

# Why `advance` came back.
FINISHED, STOPPED, PAUSED, NO_ROOM = range(4)

EXTINCT = 1e-13
"""A cohort of which a smaller fraction survives is dropped; its rest counts as broken."""
UNTRIED = 1e-10
"""A contact whose integrated rate is smaller is as good as whole, and with it all of larger thresholds."""
_PIECE = 0.5
"""Largest logarithm of the growth of an age in a panel of its quadrature."""

_NODE = (0.1127016653792583, 0.5, 0.8872983346207417)
_WEIGHT = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


class Model(NamedTuple):
    """How contacts break.

    Attributes
    ----------
    hazard : Hazard
    growth : Growth
    thresholds : Table
        Survival of thresholds.
    thermal : Table
        ``J(u)`` from `low` on, where one number is enough.
    low : float
    node, weight : ndarray, shape (n,)
        Thresholds at which the hazard is followed, and their weights; none where one number is enough.
    capped : bool
        Whether a contact may meet its threshold before it breaks; nodes always look.
    width : float
        Stretching over which rates change.
    """

    hazard: Hazard
    growth: Growth
    thresholds: Table
    thermal: Table
    low: float
    node: Array
    weight: Array
    capped: bool
    width: float


class Delays(NamedTuple):
    """Times until a broken contact re-attaches, and their weights; none: it never does."""

    time: Array
    weight: Array


class Limits(NamedTuple):
    """Largest steps: of the slider in widths, of the mass that breaks, of an oscillation that matters in radians."""

    reach: float
    broken: float
    angle: float


class State(NamedTuple):
    """All that the next step needs; `used`: cohorts and times of `broken` in use.

    ``run`` holds, by cohort, ``ln G``, or ``H`` at the nodes, and ``trial`` the same at the end of a step under trial.
    ``broken`` holds times, and the mass broken up to them; ``cursor`` where in it a delay ago is.
    """

    scalar: Array
    cohort: Array
    run: Array
    trial: Array
    broken: Array
    cursor: IntArray
    used: IntArray


class _Case(NamedTuple):
    """All that stays the same in a call."""

    model: Model
    delays: Delays
    slider: Slider
    f_d: float
    drive: Quadratic
    limits: Limits


class _Trial(NamedTuple):
    """What a step comes to."""

    dt: float
    X: float
    V: float
    work: float
    squares: float
    load: Load
    force: float
    mass: float
    broken: float
    attaching: float
    young: float
    slid: float


# ---------------------------------------------------------------------------------------------------------------------
# What survives
# ---------------------------------------------------------------------------------------------------------------------


@jit
def _thermal_survival(model: Model, u: float) -> float:
    """Fraction that survives a reading ``u`` of the clock."""
    return 1.0 if u <= model.low else value_at(model.thermal, u - model.low)


@jit
def surviving(model: Model, log_g: float, reach: float) -> float:
    """Fraction that survives by `Bell`, of contacts stretched by `reach` at most.

    ``Int J_c(max(reach, u - A ln E)) exp(-E) dE``: with ``t`` the distance beyond `reach` in widths, by panels.
    """
    A = model.hazard.scale
    d = log_g - reach / A
    if reach <= 0.0 or d > 3.7:
        return _thermal_survival(model, A * log_g)
    held = value_at(model.thresholds, reach)
    if d < -37.0:
        return held
    total = held * math.exp(-math.exp(d))
    end = max(d, 0.0) + 37.0
    begin, size = 0.0, 0.5
    while begin < end:
        for k in range(3):
            t = begin + size * _NODE[k]
            s = d - t
            total += size * _WEIGHT[k] * value_at(model.thresholds, reach + A * t) * math.exp(s - math.exp(s))
        begin += size
        size = min(1.15 * size, 4.0) if begin > d + 2.0 else 0.5
    return min(total, held)


@jit
def _integral(hazard: Hazard, growth: Growth, strength: float, age: float, dt: float, x: float, dx: float) -> float:
    """Integral of the rate over a time in which the stretching goes from `x` by `dx`, uniformly."""
    ratio = 0.0
    if growth.first == 0.0 or (growth.kind == EXPONENTIAL and growth.first * age > 40.0):
        pieces, logarithmic = 1, False
    elif growth.kind == EXPONENTIAL:
        pieces, logarithmic = 1 + int(min(2.0 * growth.first * dt, 200.0)), False
    else:
        ratio = dt / (age + growth.second)
        logarithmic = ratio > _PIECE
        pieces = 1 + int(math.log1p(ratio) / _PIECE) if logarithmic else 1
    total = 0.0
    for i in range(pieces):
        for k in range(3):
            part = (i + _NODE[k]) / pieces
            t, density = part * dt, dt
            if logarithmic:
                whole = math.log1p(ratio)
                t = (age + growth.second) * math.expm1(part * whole)
                density = (age + growth.second + t) * whole
            threshold = threshold_at(growth, strength, age + t)
            total += _WEIGHT[k] / pieces * density * rate(hazard, x + dx * t / dt, threshold)
    return total


@jit
def _log_integral(model: Model, age: float, dt: float, x: float, dx: float) -> float:
    """Logarithm of what ``G`` grows by: the integral for the threshold 0, scaled so that it does not overflow."""
    hazard, growth = model.hazard, model.growth
    A = hazard.scale
    top = max(abs(x), abs(x + dx))
    if growth.first == 0.0 and x * (x + dx) >= 0.0:
        far = abs(dx) / A
        mean = -math.expm1(-far) / far if far > 1e-8 else 1.0
        return math.log(hazard.attempts * dt * mean) + top / A
    # A threshold of `top` at rest: its rate does not overflow.
    return math.log(max(_integral(hazard, growth, top, age, dt, x, dx), 1e-300)) + top / A


@jit
def follow(state: State, model: Model, j: int, now: float, dt: float, X: float, dX: float) -> float:
    """Take a cohort along: the fraction of it that survives."""
    cohort = state.cohort
    age, x = now - cohort[SINCE, j], X - cohort[BIRTH, j]
    if model.node.size == 0:
        step = _log_integral(model, age, dt, x, dX)
        before = state.run[j, 0]
        most = max(before, step)
        state.trial[j, 0] = most + math.log1p(math.exp(-abs(before - step)))
        reach = cohort[REACH, j]
        if model.capped:
            reach = max(reach, abs(x + dX) - threshold_at(model.growth, 0.0, age + dt))
        cohort[TRIAL_REACH, j] = reach
        return surviving(model, state.trial[j, 0], reach)
    fraction, seen = 0.0, 0.0
    end = abs(x + dX)
    for k in range(model.node.size):
        run = state.run[j, k]
        if run < 40.0:
            if end >= threshold_at(model.growth, model.node[k], age + dt):
                run = math.inf
            else:
                run += _integral(model.hazard, model.growth, model.node[k], age, dt, x, dX)
                fraction += model.weight[k] * math.exp(-run)
        state.trial[j, k] = run
        seen += model.weight[k]
        if run < UNTRIED:  # stronger contacts are tried even less
            for i in range(k + 1, model.node.size):
                state.trial[j, i] = state.run[j, i]
            fraction += 1.0 - seen
            break
    cohort[TRIAL_REACH, j] = cohort[REACH, j]
    return fraction


@jit
def untouched(model: Model) -> float:
    """What a newborn's ``ln G``, or ``H``, begins with."""
    return -1e300 if model.node.size == 0 else 0.0


# ---------------------------------------------------------------------------------------------------------------------
# A step
# ---------------------------------------------------------------------------------------------------------------------


@jit
def _due(state: State, delays: Delays, dt: float) -> tuple[float, float]:
    """What has broken and re-attaches in the next `dt`, and the fraction of what breaks in it that does so, too."""
    last, broken = state.used[1] - 1, state.broken
    now = broken[0, last]
    known = fraction = 0.0
    for i in range(delays.time.size):
        begin = now - delays.time[i]
        j = state.cursor[i]
        while j < last - 1 and broken[0, j + 1] <= begin:
            j += 1
        state.cursor[i] = j
        before = _between(broken, j, begin)
        end = begin + dt
        if end >= now:
            known += delays.weight[i] * (broken[1, last] - before)
            fraction += delays.weight[i] * (end - now) / dt
        else:
            while j < last - 1 and broken[0, j + 1] <= end:
                j += 1
            known += delays.weight[i] * (_between(broken, j, end) - before)
    return known, fraction


@jit
def _between(broken: Array, j: int, t: float) -> float:
    part = (t - broken[0, j]) / (broken[0, j + 1] - broken[0, j])
    return float(broken[1, j] + part * (broken[1, j + 1] - broken[1, j]))


@jit
def _move(case: _Case, scalar: Array, load: Load, dt: float) -> tuple[float, float, float, float]:
    """Position and velocity of the slider a time `dt` later, work of the drive, integral of the squared velocity."""
    slider, drive = case.slider, case.drive
    X, V = scalar[POSITION], scalar[VELOCITY]
    if not is_rigid(slider) and slider.mass == 0.0:  # in balance
        D, velocity = drive_at(drive, scalar[TIME] + dt)
        K = slider.stiffness
        X1 = X + (K * (D - X) - load.force + load.loss * dt) / (K + load.stiffness)
        D0, velocity0 = drive_at(drive, scalar[TIME])
        work = 0.5 * dt * K * ((D0 - X) * velocity0 + (D - X1) * velocity)
        return X1, (X1 - X) / dt, work, 0.0
    moved = travel(slider, drive, Motion(scalar[TIME], X, V), load, dt)
    return moved.X, moved.V, moved.work, moved.squares


@jit
def _arrive(state: State, case: _Case, due: tuple[float, float], dt: float, load: Load) -> _Trial:
    """End of a step under this load."""
    scalar, model, cohort = state.scalar, case.model, state.cohort
    now, X = scalar[TIME], scalar[POSITION]
    X1, V1, work, squares = _move(case, scalar, load, dt)
    dX = X1 - X
    old = force = 0.0
    for j in range(state.used[0]):
        fraction = follow(state, model, j, now, dt, X, dX)
        alive = cohort[MASS, j] * fraction if fraction > EXTINCT else 0.0
        alive = min(alive, cohort[ALIVE, j])
        cohort[TRIAL_ALIVE, j] = alive
        old += alive
        force += alive * (X1 - cohort[BIRTH, j])
    # What attaches at the start of the step is the cohort behind the last.
    j = state.used[0]
    cohort[BIRTH, j], cohort[SINCE, j], cohort[REACH, j] = X, now, 0.0
    state.run[j, :] = untouched(model)
    young = follow(state, model, j, now, dt, X, dX)
    known, part = due
    fragile = 0.5 * (1.0 - young)
    broken = (scalar[ATTACHED] - old + fragile * known) / (1.0 - fragile * part)
    attaching = known + part * broken
    mass = old + 0.5 * attaching * (1.0 + young)
    force += 0.5 * attaching * young * dX
    slid = min(max(scalar[SLID] + dX, -case.f_d), case.f_d)
    return _Trial(dt, X1, V1, work, squares, load, force, mass, broken, attaching, young, slid)


@jit
def _load(case: _Case, scalar: Array, loss: float) -> Load:
    """Friction force on the way, with what breaking takes from it per time."""
    stiffness = scalar[ATTACHED]
    if case.f_d > 0.0 and abs(scalar[SLID]) < case.f_d:
        stiffness = 1.0
    return Load(scalar[CONTACT_FORCE], stiffness, loss, 0.0)


@jit
def _friction(trial: _Trial) -> float:
    return trial.force + (1.0 - trial.mass) * trial.slid


@jit
def _try_step(state: State, case: _Case, dt: float) -> tuple[_Trial, float]:
    """Find the end of a step without taking it, and how much too long it is (above 1)."""
    scalar, slider, width = state.scalar, case.slider, case.model.width
    due = _due(state, case.delays, dt)
    load = _load(case, scalar, scalar[LOSS])
    trial = _arrive(state, case, due, dt, load)
    disagreement = 0.0
    loss = (scalar[CONTACT_FORCE] + load.stiffness * (trial.X - scalar[POSITION]) - _friction(trial)) / dt
    if not is_rigid(slider):
        for _ in range(2 if slider.mass > 0.0 else 4):
            guess = trial.X
            trial = _arrive(state, case, due, dt, _load(case, scalar, loss))
            loss = (scalar[CONTACT_FORCE] + load.stiffness * (trial.X - scalar[POSITION]) - _friction(trial)) / dt
            disagreement = abs(trial.X - guess)
            if disagreement < 1e-3 * case.limits.reach * case.limits.reach * width:
                break
    trouble = abs(trial.X - scalar[POSITION]) / (case.limits.reach * width)
    trouble = max(trouble, trial.broken / case.limits.broken, trial.attaching / (8.0 * case.limits.broken))
    trouble = max(trouble, math.sqrt(disagreement / (0.02 * case.limits.reach * width)))
    return _under(trial, _load(case, scalar, loss)), trouble


@jit
def _under(trial: _Trial, load: Load) -> _Trial:
    """Give a trial the load that it has turned out to have."""
    return _Trial(
        trial.dt, trial.X, trial.V, trial.work, trial.squares, load, trial.force, trial.mass, trial.broken,
        trial.attaching, trial.young, trial.slid,
    )  # fmt: skip


@jit
def _longest_step(scalar: Array, case: _Case) -> float:
    """Resolve the oscillation of the slider on its contacts where it matters."""
    slider = case.slider
    if is_rigid(slider) or slider.mass == 0.0:
        return math.inf
    fast = (slider.stiffness + 1.0) / slider.mass
    if 0.25 * slider.damping * slider.damping >= fast:
        return math.inf
    here = Motion(scalar[TIME], scalar[POSITION], scalar[VELOCITY])
    if free_amplitude(slider, case.drive, here, _load(case, scalar, scalar[LOSS])) < 1e-3 * case.model.width:
        return math.inf
    return case.limits.angle / math.sqrt(fast)


@jit
def _commit(state: State, case: _Case, trial: _Trial) -> None:
    """Make the trial the state."""
    scalar, cohort, _model, f_d = state.scalar, state.cohort, case.model, case.f_d
    X, now = scalar[POSITION], scalar[TIME]
    dX, end = trial.X - X, now + trial.dt
    half = 0.5 * trial.attaching
    before, out = scalar[SLID], 1.0 - scalar[ATTACHED]
    middle = 0.5 * (before + trial.slid)
    lost = stored = 0.0
    kept, fresh = 0, False
    for j in range(state.used[0] + 1):
        alive, mass = cohort[TRIAL_ALIVE, j], cohort[MASS, j]
        if j == state.used[0]:
            if fresh:
                break
            alive, mass = half * trial.young, half
            lost += 0.5 * (0.25 * dX * dX - middle * middle) * (half - alive)
        else:
            x = X + 0.5 * dX - cohort[BIRTH, j]
            lost += 0.5 * (x * x - middle * middle) * (cohort[ALIVE, j] - alive)
            if cohort[SINCE, j] == now and cohort[BIRTH, j] == X:  # attached at the end of the step before
                fresh = True
                alive += half * trial.young
                mass += half
                lost += 0.5 * (0.25 * dX * dX - middle * middle) * half * (1.0 - trial.young)
        if alive <= 0.0:
            continue
        stored += 0.5 * (trial.X - cohort[BIRTH, j]) ** 2 * alive
        cohort[BIRTH, kept], cohort[SINCE, kept] = cohort[BIRTH, j], cohort[SINCE, j]
        cohort[MASS, kept], cohort[ALIVE, kept] = mass, alive
        cohort[REACH, kept] = cohort[TRIAL_REACH, j]
        state.run[kept, :] = state.trial[j, :]
        kept += 1
    state.used[0] = kept
    _settle(state, case, trial.X, end, half)
    slides = abs(dX - (trial.slid - before))
    lost += out * f_d * slides + 0.5 * middle * middle * trial.attaching
    scalar[BROKEN] += lost
    scalar[STORED] = stored + 0.5 * (1.0 - trial.mass) * trial.slid * trial.slid
    friction = _friction(trial)
    if is_rigid(case.slider):
        scalar[WORK] += 0.5 * (scalar[CONTACT_FORCE] + friction) * dX
    else:
        scalar[WORK] += trial.work
        scalar[DAMPED] += case.slider.mass * case.slider.damping * trial.squares
    scalar[TIME], scalar[POSITION], scalar[VELOCITY] = end, trial.X, trial.V
    scalar[CONTACT_FORCE], scalar[FORCE], scalar[ATTACHED] = friction, trial.force, trial.mass
    scalar[LOSS], scalar[SLID] = trial.load.loss, trial.slid
    scalar[OUTSIDE] += trial.broken - trial.attaching
    n = state.used[1]
    state.broken[0, n], state.broken[1, n] = end, state.broken[1, n - 1] + trial.broken
    state.used[1] = n + 1


@jit
def _settle(state: State, case: _Case, X: float, now: float, mass: float) -> None:
    """Add what attaches at the end of a step: to the youngest cohort if that is small and near, else as a new one."""
    cohort, j = state.cohort, state.used[0] - 1
    if mass <= 0.0:
        return
    near = 0.1 * case.limits.reach * case.model.width
    if j >= 0 and cohort[ALIVE, j] + mass < 0.1 * case.limits.broken and abs(X - cohort[BIRTH, j]) < near:
        part = mass / (cohort[ALIVE, j] + mass)
        cohort[BIRTH, j] += part * (X - cohort[BIRTH, j])
        cohort[SINCE, j] += part * (now - cohort[SINCE, j])
        cohort[MASS, j] += mass
        cohort[ALIVE, j] += mass
        return
    j += 1
    cohort[BIRTH, j], cohort[SINCE, j], cohort[MASS, j], cohort[ALIVE, j], cohort[REACH, j] = X, now, mass, mass, 0.0
    state.run[j, :] = untouched(case.model)
    state.used[0] = j + 1


@jit
def _make_room(state: State) -> bool:
    """Whether there is room for another step; if need be after forgetting what has re-attached."""
    count = state.used[1]
    if count == state.broken.shape[1]:
        first = count - 2
        for i in range(state.cursor.size):
            first = min(first, state.cursor[i])
        if first < count // 2:
            return False
        base = state.broken[1, first]  # small numbers keep their digits
        for j in range(first, count):
            state.broken[0, j - first] = state.broken[0, j]
            state.broken[1, j - first] = state.broken[1, j] - base
        for i in range(state.cursor.size):
            state.cursor[i] -= first
        state.used[1] = count - first
    return bool(state.used[0] + 2 <= state.cohort.shape[1])


@jit
def _sample(row: Array, t: float, before: Array, trial: _Trial, after: Array, case: _Case) -> None:
    """What a step passes at time `t`."""
    u = t - before[TIME]
    part = u / trial.dt
    for i in range(COLUMNS):
        row[i] = before[i] + part * (after[i] - before[i])
    if u <= 0.0:
        return
    X, V, work, squares = _move(case, before, trial.load, u)
    row[POSITION], row[VELOCITY] = X, V
    bend = X - before[POSITION] - part * (trial.X - before[POSITION])
    row[CONTACT_FORCE] += trial.load.stiffness * bend
    row[STORED] += row[CONTACT_FORCE] * bend
    if not is_rigid(case.slider):
        row[WORK] = before[WORK] + work
        row[DAMPED] = before[DAMPED] + case.slider.mass * case.slider.damping * squares


@jit
def _held(stop: Stop, row: Array, t: float, case: _Case) -> bool:
    """Whether the condition holds at a sample."""
    spring = row[CONTACT_FORCE]
    if not is_rigid(case.slider):
        spring = case.slider.stiffness * (drive_at(case.drive, t)[0] - row[POSITION])
    return holds(stop, row[POSITION], spring)


@jit
def _run(
    state: State, case: _Case, stop: Stop, until: float, times: Array, rows: Array, max_steps: int
) -> tuple[int, int, int]:
    """Take steps until there is a reason to come back: it, the number of rows filled, and the steps left."""
    scalar = state.scalar
    before = scalar.copy()
    smallest = 1e-13 * max(1.0, abs(until))
    filled = 0
    if is_rigid(case.slider):
        scalar[VELOCITY] = drive_at(case.drive, scalar[TIME])[1]
    while max_steps > 0:
        while filled < times.size and times[filled] <= scalar[TIME] + smallest:
            rows[filled, :] = scalar[:COLUMNS]
            filled += 1
            if _held(stop, rows[filled - 1], times[filled - 1], case):
                return STOPPED, filled, max_steps
        left = until - scalar[TIME]
        if left <= smallest:
            return FINISHED, filled, max_steps
        if not _make_room(state):
            return NO_ROOM, filled, max_steps
        if stop.kind != NOWHERE and filled < times.size:
            left = min(left, times[filled] - scalar[TIME])
        planned = min(scalar[NEXT_STEP], _longest_step(scalar, case))
        while True:
            dt = left if planned > 0.999 * left else (0.5 * left if planned > 0.5 * left else planned)
            trial, trouble = _try_step(state, case, dt)
            turn = scalar[VELOCITY] * trial.V < 0.0 and case.slider.mass > 0.0 and not is_rigid(case.slider)
            if turn:  # a step goes one way
                part = scalar[VELOCITY] / (scalar[VELOCITY] - trial.V)
                if 0.05 < part < 0.95:
                    planned = part * dt
                    trial, trouble = _try_step(state, case, planned)
                    dt = planned
            if math.isnan(trouble):  # no step helps; the caller is told by where the slider is
                scalar[POSITION] = math.nan
                return PAUSED, filled, 0
            if trouble <= 1.0 or dt <= smallest:
                break
            planned = dt * max(0.9 / trouble, 0.2)
        if dt >= planned or trouble > 0.45:  # a step cut short by the end says little about the next one
            scalar[NEXT_STEP] = dt * min(0.9 / max(trouble, 1e-9), 2.0)
        before[:] = scalar
        max_steps -= 1
        _commit(state, case, trial)
        while filled < times.size and times[filled] < scalar[TIME] - smallest:
            _sample(rows[filled], times[filled], before, trial, scalar, case)
            filled += 1
    return PAUSED, filled, 0


class Progress(NamedTuple):
    """What `advance` reached: the state to go on from, the samples that were passed, and why it came back."""

    state: State
    rows: Array
    reason: int


def advance(
    state: State,
    model: Model,
    delays: Delays,
    slider: Slider,
    f_d: float,
    drive: Quadratic,
    *,
    until: float,
    times: Array,
    limits: Limits,
    stop: Stop = Stop(),
    max_steps: int = 2**62,
) -> Progress:
    """Go on from a state, which is not changed, under one piece of the drive; as `cohorts.advance`."""
    scalar, cohort, run, trial, broken, cursor, used = state
    state = State(scalar.copy(), cohort.copy(), run.copy(), trial.copy(), broken.copy(), cursor.copy(), used.copy())
    rows = np.empty((times.size, COLUMNS))
    case = _Case(model, delays, slider, f_d, drive, limits)
    filled, reason, steps = 0, NO_ROOM, max_steps
    while reason == NO_ROOM:
        reason, more, steps = _run(state, case, stop, until, times[filled:], rows[filled:], steps)
        filled += more
        if reason == NO_ROOM:
            if state.used[0] + 2 > state.cohort.shape[1]:
                double = np.concatenate([state.cohort, np.zeros_like(state.cohort)], axis=1)
                longer, tried = (np.concatenate([part, np.zeros_like(part)]) for part in (state.run, state.trial))
                state = state._replace(cohort=double, run=longer, trial=tried)
            else:
                state = state._replace(broken=np.concatenate([state.broken, np.zeros_like(state.broken)], axis=1))
    return Progress(state, rows[:filled], reason)
