"""The master equation, Eqs. (1)-(4), on cohorts, under the motion of a slider, Eq. (11), or a prescribed one.

A cohort is what attached in one step: contacts at the same place ``b``, of which ``m J_c(e)`` survive when their
largest stretching so far is ``e``. Nothing moves along a grid of stretchings, so there is no numerical diffusion,
and the slider may turn round at any time. What breaks goes through the delay, a mean over given delay times, and
re-attaches where the slider then is; half of that in a step at each of its ends.

Within a step the slider is a damped oscillator on the driving spring and on the contacts (`oscillator`), whose force
is taken linear in its position with the slope that the step itself turns out to have (found in two sweeps over the
cohorts): the step is exact where nothing breaks, has no stability limit, follows an elastic instability by its true
exponential, and is second order.

All controls of the step follow from one number, `cells`: the slider moves at most 1/cells in a step, at most
``5/cells`` of the contacts break or attach, and two estimates of where it ends agree to ``20/cells**2``.

Natural units: stretchings in ``x_s``, forces and stiffnesses per contact in ``f_s`` and ``k``, any unit of
time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import jit
from .drive import NOWHERE, Quadratic, Stop, drive_at, holds
from .oscillator import Load, Motion, Slider, Travel, is_rigid, slow_path, travel

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Table(NamedTuple):
    """Survival and density of the thresholds at ``x = spacing * (0, 1, 2 ...)``; made by `tabulate`."""

    survival: Array
    density: Array
    spacing: float


class Delays(NamedTuple):
    """Times until a broken contact re-attaches, and their weights; none: it never does.

    `memoryless` selects the paper's approximation, Eq. (10): contacts re-attach at once, and the fraction of
    them that is attached follows the velocity and the breaking rate of the moment. It has no memory of what
    broke when, and oscillates in its own, spurious way; it is exact for the mean force of steady sliding.
    """

    time: Array
    weight: Array
    memoryless: bool = False


class _Case(NamedTuple):
    """All that stays the same in a call: thresholds, delays, slider, drive, and the resolution."""

    table: Table
    delays: Delays
    slider: Slider
    drive: Quadratic
    cells: float


class State(NamedTuple):
    """All that the next step needs. Arrays have room to spare; `used` says how much is filled.

    Attributes
    ----------
    scalar : ndarray, shape (14,)
        The quantities `TIME` ... `NEXT_STEP`.
    cohort : ndarray, shape (6, room)
        Rows `BIRTH`, `MASS`, `REACH`, `ALIVE`, and two for the step under trial.
    broken : ndarray, shape (2, room)
        Times, and the mass broken up to them.
    cursor : ndarray of int, shape (n_delays,)
        Place in `broken` of the time one delay ago.
    used : ndarray of int, shape (2,)
        Number of cohorts and of times in use.
    """

    scalar: Array
    cohort: Array
    broken: Array
    cursor: IntArray
    used: IntArray


# Columns of the samples, which are also the first scalars. Energies: work of the drive, dissipated by
# damping, lost in breaks, stored in contacts.
COLUMNS = 10
TIME, POSITION, VELOCITY, DRIVE_FORCE, CONTACT_FORCE, ATTACHED, WORK, DAMPED, LOST, STORED = range(COLUMNS)
# Further scalars: mass in cohorts and mass outside, slope of the contact force, the step to try next.
SCALARS = 14
MASS_IN, MASS_OUT, SLOPE, NEXT_STEP = range(COLUMNS, SCALARS)

BIRTH, MASS, REACH, ALIVE, TRIAL_REACH, TRIAL_ALIVE = range(6)

# Why `advance` came back.
FINISHED, STOPPED, PAUSED, NO_ROOM = range(4)

BREAK_CAP = 5.0
"""Largest mass that breaks, or re-attaches, in a step, times `cells`: the usual steady rate is 1."""
TOLERANCE = 20.0
"""Largest disagreement on where a step ends, times ``cells**2``."""
PHASE = 0.5
"""Largest phase, in radians, that an oscillation that has not decays turns in a step."""
ONE_PLACE = 1e-3
"""Travel, times `cells`, that makes no difference to where something breaks or attaches."""
EXTINCT = 1e-12
"""A cohort of which a smaller fraction survives is dropped; its rest counts as broken."""


@jit
def survival(table: Table, x: float) -> float:
    """Fraction of newborn contacts that survive a stretching ``x >= 0``, by cubic Hermite interpolation."""
    place = x / table.spacing
    i = int(place)
    if i >= table.survival.size - 1:
        return 0.0
    u = place - i
    left, right = table.survival[i], table.survival[i + 1]
    rise = right - left
    a = -table.spacing * table.density[i] - rise
    b = rise + table.spacing * table.density[i + 1]
    return float(left + u * (rise + (1.0 - u) * ((1.0 - u) * a + u * b)))


class _Trial(NamedTuple):
    """What a step of length `dt` comes to; the cohorts' trial rows belong to it."""

    dt: float
    load: Load
    motion: Travel
    force: float
    attached: float
    mass_in: float
    broken: float
    attaching: float


@jit
def _here(scalar: Array) -> Motion:
    """Where the slider is."""
    return Motion(scalar[TIME], scalar[POSITION], scalar[VELOCITY])


@jit
def _is_slow(here: Motion, case: _Case, load: Load) -> bool:
    """Whether the slider follows its slow path so closely that its oscillation does not matter."""
    w = (case.slider.stiffness + load.stiffness) / case.slider.mass
    if w <= 0.0:
        return False
    p0, p1, _ = slow_path(case.slider, case.drive, here, load)
    return bool(max(abs(p0), abs(here.V - p1) / math.sqrt(w)) * case.cells * case.cells < 1.0)


@jit
def _sweep(cohort: Array, count: int, table: Table, motion: Travel) -> tuple[float, float]:
    """Take all cohorts along with the slider: the mass that survives, and its force."""
    mass = force = 0.0
    for j in range(count):
        x = motion.X - cohort[BIRTH, j]
        reach = max(cohort[REACH, j], motion.high - cohort[BIRTH, j], cohort[BIRTH, j] - motion.low)
        alive = cohort[ALIVE, j]
        if reach > cohort[REACH, j]:
            fraction = survival(table, reach)
            alive = cohort[MASS, j] * fraction if fraction > EXTINCT else 0.0
        cohort[TRIAL_REACH, j] = reach
        cohort[TRIAL_ALIVE, j] = alive
        mass += alive
        force += alive * x
    return mass, force


@jit
def _attached_fraction(cohort: Array, count: int, table: Table, X: float, V: float, delays: Delays) -> float:
    """Fraction of contacts that hold at velocity `V` by Eq. (10), with the breaking rate of Eq. (2)."""
    rate = 0.0
    for j in range(count):
        reach = cohort[TRIAL_REACH, j]
        place = reach / table.spacing
        i = int(place)
        if math.copysign(X - cohort[BIRTH, j], V) >= reach and i < table.density.size - 1:
            density = table.density[i] + (place - i) * (table.density[i + 1] - table.density[i])
            rate += cohort[MASS, j] * density
    delay = 0.0
    for i in range(delays.time.size):
        delay += delays.time[i] * delays.weight[i]
    return 1.0 / (1.0 + rate * abs(V) * delay)


@jit
def _due(state: State, delays: Delays, dt: float) -> tuple[float, float]:
    """What has broken and re-attaches in the next `dt`, and the fraction of what breaks in it that does so, too."""
    if delays.memoryless:
        return 0.0, 1.0
    last = state.used[1] - 1
    t = state.broken[0, last]
    known = fraction = 0.0
    for i in range(delays.time.size):
        j = _place(state.broken, state.cursor[i], last, t - delays.time[i])
        state.cursor[i] = j
        before = _between(state.broken, j, t - delays.time[i])
        end = t - delays.time[i] + dt
        if end >= t:
            known += delays.weight[i] * (state.broken[1, last] - before)
            fraction += delays.weight[i] * (end - t) / dt
        else:
            j = _place(state.broken, j, last, end)
            known += delays.weight[i] * (_between(state.broken, j, end) - before)
    return known, fraction


@jit
def _place(broken: Array, j: int, last: int, t: float) -> int:
    """Index of the interval that holds time `t`, at `j` or later."""
    while j < last - 1 and broken[0, j + 1] <= t:
        j += 1
    return j


@jit
def _between(broken: Array, j: int, t: float) -> float:
    """Mass broken up to time `t` in interval `j`."""
    fraction = (t - broken[0, j]) / (broken[0, j + 1] - broken[0, j])
    return float(broken[1, j] + fraction * (broken[1, j + 1] - broken[1, j]))


@jit
def _arrive(state: State, case: _Case, due: tuple[float, float], dt: float, load: Load) -> _Trial:
    """End of a step under this load."""
    table, slider, drive, here = case.table, case.slider, case.drive, _here(state.scalar)
    scalar, X = state.scalar, here.X
    motion = travel(slider, drive, here, load, dt)
    if not is_rigid(slider) and _is_slow(here, case, load):
        # Over a long time an oscillation that does not matter would make a cubic overshoot.
        p0, p1, p2 = slow_path(slider, drive, here, load)
        turn = X + p0 - 0.25 * p1 * p1 / p2 if p1 * (p1 + 2.0 * p2 * dt) < 0.0 else X
        low, high = min(X, motion.X, turn), max(X, motion.X, turn)
        motion = Travel(motion.X, motion.V, low, high, motion.work, motion.squares)
    old, force = _sweep(state.cohort, state.used[0], table, motion)
    # Half of what attaches sits at the start of the step, and some of it may already break in it.
    known, fraction = due
    young = survival(table, max(motion.high - X, X - motion.low))
    fragile = 0.5 * (1.0 - young)
    broken = (scalar[MASS_IN] - old + fragile * known) / (1.0 - fragile * fraction)
    attaching = known + fraction * broken
    mass_in = old + 0.5 * attaching * (1.0 + young)
    force += 0.5 * attaching * young * (motion.X - X)
    held = 1.0
    if case.delays.memoryless:
        held = _attached_fraction(state.cohort, state.used[0], table, motion.X, motion.V, case.delays)
    return _Trial(dt, load, motion, held * force, held * mass_in, mass_in, broken, attaching)


@jit
def _try_step(state: State, case: _Case, dt: float) -> tuple[_Trial, float]:
    """Find the end of a step without taking it, and how much too long it is (above 1)."""
    slider, delays, cells = case.slider, case.delays, case.cells
    scalar = state.scalar
    due = _due(state, delays, dt)
    load = Load(scalar[CONTACT_FORCE], scalar[SLOPE], 0.0, 0.0)
    trial = _arrive(state, case, due, dt, load)
    disagreement = 0.0
    if not is_rigid(slider):
        change, distance = trial.force - scalar[CONTACT_FORCE], trial.motion.X - scalar[POSITION]
        turned = trial.motion.high - trial.motion.low > abs(distance)
        if distance != 0.0 and not turned and not delays.memoryless:
            slope, loss = change / distance, 0.0
        else:  # the force is no function of X: what breaks acts as a load that grows in time
            slope = scalar[MASS_IN]
            loss = (slope * distance - change) / dt
        guess = trial.motion
        load = Load(scalar[CONTACT_FORCE], slope, loss, 0.0)
        trial = _arrive(state, case, due, dt, load)
        frequency = math.sqrt((slider.stiffness + scalar[MASS_IN]) / slider.mass)
        disagreement = max(abs(trial.motion.X - guess.X), abs(trial.motion.V - guess.V) / frequency)
    path = max(trial.motion.high - scalar[POSITION], scalar[POSITION] - trial.motion.low)
    # What breaks or attaches almost in one place need not be resolved: thresholds that are all the same cannot be.
    mass = min(max(trial.broken, trial.attaching) / BREAK_CAP, path / ONE_PLACE)
    return trial, cells * max(path, mass, math.sqrt(disagreement / TOLERANCE))


@jit
def _longest_step(scalar: Array, case: _Case) -> float:
    """Resolve the oscillation of the slider on its contacts, unless the slider follows its slow path closely."""
    slider = case.slider
    if is_rigid(slider):
        return math.inf
    fast = (slider.stiffness + scalar[MASS_IN]) / slider.mass
    if 0.25 * slider.damping * slider.damping >= fast:
        return math.inf
    if _is_slow(_here(scalar), case, Load(scalar[CONTACT_FORCE], scalar[SLOPE], 0.0, 0.0)):
        return math.inf
    return PHASE / math.sqrt(fast)


@jit
def _attach(state: State, table: Table, b: float, alive: float, reach: float, merge: float) -> None:
    """Add contacts that attached at `b`: to the youngest cohort if that did within `merge`, else as a new one."""
    cohort = state.cohort
    if alive <= 0.0:
        return
    j = state.used[0] - 1
    if j >= 0 and abs(b - cohort[BIRTH, j]) <= merge and abs(reach - cohort[REACH, j]) <= merge:
        total = alive + cohort[ALIVE, j]
        fraction = alive / total
        b = cohort[BIRTH, j] + fraction * (b - cohort[BIRTH, j])
        reach = cohort[REACH, j] + fraction * (reach - cohort[REACH, j])
        alive = total
    else:
        j += 1
        state.used[0] = j + 1
    cohort[BIRTH, j], cohort[MASS, j] = b, alive / survival(table, reach)
    cohort[REACH, j], cohort[ALIVE, j] = reach, alive


@jit
def _commit(state: State, case: _Case, trial: _Trial) -> None:
    """Make the trial the state."""
    table, slider, drive, cells = case.table, case.slider, case.drive, case.cells
    scalar, cohort = state.scalar, state.cohort
    motion = trial.motion
    distance = motion.X - scalar[POSITION]
    kept = 0
    lost = stored = 0.0
    for j in range(state.used[0]):
        reach, alive = cohort[TRIAL_REACH, j], cohort[TRIAL_ALIVE, j]
        middle = 0.5 * (reach + cohort[REACH, j])
        lost += 0.5 * middle * middle * (cohort[ALIVE, j] - alive)
        if alive > 0.0:
            stored += 0.5 * (motion.X - cohort[BIRTH, j]) ** 2 * alive
            cohort[BIRTH, kept], cohort[MASS, kept] = cohort[BIRTH, j], cohort[MASS, j]
            cohort[REACH, kept], cohort[ALIVE, kept] = reach, alive
            kept += 1
    state.used[0] = kept
    half = 0.5 * trial.attaching
    reach = max(motion.high - scalar[POSITION], scalar[POSITION] - motion.low)
    young = half * survival(table, reach)
    _attach(state, table, scalar[POSITION], young, reach, 0.25 / cells)
    _attach(state, table, motion.X, half, 0.0, 0.25 / cells)
    scalar[LOST] += lost + 0.125 * reach * reach * (half - young)
    scalar[STORED] = stored + 0.5 * distance * distance * young
    if is_rigid(slider):
        scalar[WORK] += 0.5 * (scalar[CONTACT_FORCE] + trial.force) * distance
    else:
        scalar[WORK] += motion.work
        scalar[DAMPED] += slider.mass * slider.damping * motion.squares
    scalar[TIME] += trial.dt
    scalar[POSITION], scalar[VELOCITY] = motion.X, motion.V
    scalar[CONTACT_FORCE], scalar[SLOPE] = trial.force, trial.load.stiffness
    scalar[ATTACHED], scalar[MASS_IN] = trial.attached, trial.mass_in
    scalar[MASS_OUT] += trial.broken - trial.attaching
    _measure_spring(scalar, slider, drive)
    n = state.used[1]
    state.broken[0, n] = scalar[TIME]
    state.broken[1, n] = state.broken[1, n - 1] + trial.broken
    state.used[1] = n + 1


@jit
def _measure_spring(scalar: Array, slider: Slider, drive: Quadratic) -> None:
    """Spring force: that of the spring, or what it takes to move the slider rigidly (its inertia left out)."""
    scalar[DRIVE_FORCE] = scalar[CONTACT_FORCE]
    if not is_rigid(slider):
        scalar[DRIVE_FORCE] = slider.stiffness * (drive_at(drive, scalar[TIME])[0] - scalar[POSITION])


@jit
def _sample(row: Array, t: float, before: Array, trial: _Trial, after: Array, slider: Slider, drive: Quadratic) -> None:
    """What a step passes at time `t`: the motion and its energies in closed form, the rest linear between its ends."""
    u = t - before[TIME]
    fraction = u / trial.dt
    for i in range(COLUMNS):
        row[i] = before[i] + fraction * (after[i] - before[i])
    row[TIME] = t
    motion = travel(slider, drive, _here(before), trial.load, u)
    row[POSITION], row[VELOCITY] = motion.X, motion.V
    # The force and what is stored bend with the position; what the two sweeps left over is spread evenly.
    bend = motion.X - before[POSITION] - fraction * (trial.motion.X - before[POSITION])
    row[CONTACT_FORCE] += trial.load.stiffness * bend
    row[STORED] += row[CONTACT_FORCE] * bend
    if not is_rigid(slider):
        row[WORK] = before[WORK] + motion.work
        row[DAMPED] = before[DAMPED] + slider.mass * slider.damping * motion.squares
    _measure_spring(row, slider, drive)


@jit
def _make_room(state: State) -> bool:
    """Whether there is room for another step; if need be after forgetting what has re-attached."""
    count = state.used[1]
    if count == state.broken.shape[1]:
        first = count - 2
        for i in range(state.cursor.size):
            first = min(first, state.cursor[i])
        if first < count // 2:
            return False  # so that the moves do not add up
        base = state.broken[1, first]  # small numbers keep their digits
        for j in range(first, count):
            state.broken[0, j - first] = state.broken[0, j]
            state.broken[1, j - first] = state.broken[1, j] - base
        for i in range(state.cursor.size):
            state.cursor[i] -= first
        state.used[1] = count - first
    return bool(state.used[0] + 2 <= state.cohort.shape[1])


@jit
def _run(
    state: State, case: _Case, stop: Stop, until: float, times: Array, rows: Array, step: float, max_steps: int
) -> tuple[int, int, int]:
    """Take steps until there is a reason to come back: it, the number of rows filled, and the steps left."""
    slider, drive = case.slider, case.drive
    scalar = state.scalar
    before = scalar.copy()
    smallest = 1e-12 * max(1.0, abs(until))
    filled = 0
    _measure_spring(scalar, slider, drive)
    if is_rigid(slider):
        scalar[VELOCITY] = drive_at(drive, scalar[TIME])[1]
    while max_steps > 0:
        while filled < times.size and times[filled] <= scalar[TIME] + smallest:
            for i in range(COLUMNS):
                rows[filled, i] = scalar[i]
            filled += 1
            if holds(stop, rows[filled - 1, POSITION], rows[filled - 1, DRIVE_FORCE]):
                return STOPPED, filled, max_steps
        left = until - scalar[TIME]
        if left <= smallest:
            return FINISHED, filled, max_steps
        if not _make_room(state):
            return NO_ROOM, filled, max_steps
        planned = step if step > 0.0 else min(scalar[NEXT_STEP], _longest_step(scalar, case))
        while True:
            dt = min(planned, left)
            trial, trouble = _try_step(state, case, dt)
            if step > 0.0 or trouble <= 1.0 or dt <= smallest:
                break
            planned = dt * max(0.9 / trouble, 0.2)
        if dt == planned or trouble > 0.45:  # a step cut short by the end says little about the next one
            scalar[NEXT_STEP] = dt * min(0.9 / max(trouble, 1e-9), 2.0)
        before[:] = scalar
        max_steps -= 1
        n = filled
        while stop.kind != NOWHERE and n < times.size and times[n] < scalar[TIME] + dt:
            _sample(rows[n], times[n], before, trial, before, slider, drive)
            if holds(stop, rows[n, POSITION], rows[n, DRIVE_FORCE]):
                trial, _ = _try_step(state, case, times[n] - scalar[TIME])
                break
            n += 1
        _commit(state, case, trial)
        while filled < times.size and times[filled] < scalar[TIME] - smallest:
            _sample(rows[filled], times[filled], before, trial, scalar, slider, drive)
            filled += 1
    return PAUSED, filled, 0


class Progress(NamedTuple):
    """What `advance` reached.

    Attributes
    ----------
    state : State
        To go on from.
    rows : ndarray, shape (n, 10)
        One row for each sample time that was passed, with columns `TIME` ... `STORED`.
    reason : int
        `FINISHED` (the time was reached), `STOPPED` (the condition holds at the last row, and the state is at
        its time) or `PAUSED` (the number of steps was used up).
    """

    state: State
    rows: Array
    reason: int


def tabulate(survival: Array, density: Array, spacing: float) -> Table:
    """Make a table of a distribution of thresholds.

    Parameters
    ----------
    survival, density : ndarray, shape (n,)
        ``J_c`` and ``P_c`` at ``x = spacing * (0, 1, ..., n - 1)``: from ``J_c(0) = 1`` to where less than `EXTINCT`
        survives. Between the points ``J_c`` is a cubic with these slopes, to an error of
        ``spacing**4 / 384 * (largest fourth derivative)``.
    spacing : float
        Distance between points.

    Returns
    -------
    Table
        With densities so limited, where they jump or diverge, that the survival never rises in between.
    """
    chord = np.concatenate([[0.0], -np.diff(survival) / spacing, [0.0]])
    chord[0], chord[-1] = chord[1], chord[-2]
    limit = 3.0 * np.minimum(chord[:-1], chord[1:])
    return Table(np.asarray(survival, float), np.clip(density, 0.0, limit), spacing)


def initial_state(
    table: Table,
    delays: Delays,
    stretching: Array,
    weight: Array,
    *,
    position: float = 0.0,
    velocity: float = 0.0,
    time: float = 0.0,
    rate: float = 0.0,
) -> State:
    """Put a slider on its initial contacts.

    Parameters
    ----------
    table : Table
        The distribution of thresholds.
    delays : Delays
        The delays.
    stretching, weight : ndarray, shape (n_nodes,)
        Initial stretchings, any sign, and the attached fraction of contacts at each. A contact at ``x_0`` has
        a threshold beyond ``|x_0|``; nodes where none survives are not allowed. The rest of a sum of 1 is
        detached.
    position, velocity, time : float
        Of the slider, at the start.
    rate : float
        Mass that broke per unit time before the start; it re-attaches after its delay. For smooth sliding
        ``v / (<x_s> + v <tau_d>)``, with the attached fraction ``<x_s> / (<x_s> + v <tau_d>)``.

    Returns
    -------
    State
    """
    stretching, weight = np.asarray(stretching, float), np.asarray(weight, float)
    reach = np.abs(stretching)
    alive = np.array([max(survival(table, x), EXTINCT) for x in reach])
    n = stretching.size
    cohort = np.zeros((6, 2 * n + 1024))
    cohort[BIRTH, :n], cohort[MASS, :n] = position - stretching, weight / alive
    cohort[REACH, :n], cohort[ALIVE, :n] = reach, weight
    attached = float(np.sum(weight))
    scalar = np.zeros(SCALARS)
    scalar[TIME], scalar[POSITION], scalar[VELOCITY] = time, position, velocity
    scalar[CONTACT_FORCE] = np.sum(weight * stretching)
    scalar[ATTACHED] = scalar[MASS_IN] = scalar[SLOPE] = attached
    scalar[MASS_OUT] = 1.0 - attached
    scalar[STORED] = 0.5 * np.sum(weight * stretching**2)
    scalar[NEXT_STEP] = math.inf
    memory = max([1.0, *delays.time])
    broken = np.zeros((2, 1024))
    broken[:, 0] = time - memory, -rate * memory
    broken[0, 1] = time
    return State(scalar, cohort, broken, np.zeros(delays.time.size, np.int64), np.array([n, 2], np.int64))


def stretchings(state: State) -> tuple[Array, Array]:
    """Stretchings of the attached contacts and the mass at each: the distribution ``Q(x; X)`` as it stands."""
    n = state.used[0]
    return state.scalar[POSITION] - state.cohort[BIRTH, :n], state.cohort[ALIVE, :n].copy()


def smooth_sliding(table: Table, cells: float, attached: float = 1.0) -> tuple[Array, Array]:
    """Stretchings and weights of smooth sliding, ``Q_s(x) = J_c(x)/<x_s>``, at the cohorts' own resolution."""
    x = np.arange(int(cells * table.spacing * table.survival.size), -1, -1) / cells
    weight = np.array([survival(table, value) for value in x])
    weight[-1] *= 0.5
    kept = weight > EXTINCT
    return x[kept], attached * weight[kept] / weight[kept].sum()


def advance(
    state: State,
    table: Table,
    delays: Delays,
    slider: Slider,
    drive: Quadratic,
    *,
    until: float,
    times: Array,
    cells: float,
    stop: Stop = Stop(),
    step: float = 0.0,
    max_steps: int = 2**62,
) -> Progress:
    """Go on from a state, under one piece of the drive.

    Neither the samples nor the pauses change the steps.

    Parameters
    ----------
    state : State
        Where to start; it is not changed.
    table, delays, slider, drive
        The thresholds, the delays, the slider and the drive.
    until : float
        Time to reach exactly: the end of the piece.
    times : ndarray
        Rising times of the samples wanted, those up to the start of this call left out, but for its very
        start.
    cells : float
        Cohorts per ``x_s``: the resolution, to which errors are second order.
    stop : Stop
        Condition that ends the piece at the first sample where it holds.
    step : float
        Fixed time step, for studies of convergence; 0: adaptive.
    max_steps : int
        Steps after which to pause, to show progress.

    Returns
    -------
    Progress
    """
    scalar, cohort, broken, cursor, used = state
    state = State(scalar.copy(), cohort.copy(), broken.copy(), cursor.copy(), used.copy())
    times = np.asarray(times, float)
    rows = np.empty((times.size, COLUMNS))
    case = _Case(table, delays, slider, drive, cells)
    filled, reason = 0, NO_ROOM
    steps = max_steps
    while reason == NO_ROOM:
        reason, more, steps = _run(state, case, stop, until, times[filled:], rows[filled:], step, steps)
        filled += more
        if reason == NO_ROOM:
            if state.used[0] + 2 > state.cohort.shape[1]:
                state = state._replace(cohort=_doubled(state.cohort))
            else:
                state = state._replace(broken=_doubled(state.broken))
    return Progress(state, rows[:filled], reason)


def _doubled(table: Array) -> Array:
    return np.concatenate([table, np.zeros_like(table)], axis=1)
