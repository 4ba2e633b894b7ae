"""The master equation, Eqs. (1)-(4), under the motion of a slider, Eq. (11), or a prescribed one: error-controlled.

A step of time is a panel, on which position, force, and what breaks and attaches are polynomials through its nodes. The
slider is a damped oscillator under a force that depends on where it is (`groups`): equations are met at the nodes of
Radau, by Newton's method, at any stiffness of spring and contacts. What attaches in a step becomes a group of
nodes of Gauss; what breaks re-attaches after a delay, of given times, or spread by a distribution whose survival is a
table, too. So the order is that of the polynomials, five, wherever the motion is smooth. It is not where the slider
turns, where it passes a place at which it has turned before, and where what broke at such a moment re-attaches: steps
end there.

A step is as long as the tolerance allows: it is tried again, shorter, if the last coefficients of its polynomials do
not fall far enough, or if what attaches in it is spread too far for the nodes of Gauss.

Natural units: stretchings in ``x_s``, forces and stiffnesses per contact in ``f_s`` and ``k``, any unit of time.
"""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined, jit
from .births import forget, mark_rough, next_front
from .drive import NOWHERE, Quadratic, Stop, drive_at, holds
from .groups import BIRTH, GROUP_ROWS, MASS, REACH, WHOLE, Reading, divide, divide_passed, kink_at, merged
from .lots import CHANCES, attach_all, deviate, joined, settle
from .oscillator import Slider, is_rigid
from .panel_state import (
    AT_ATTACHED,
    AT_BORN,
    AT_BROKEN,
    AT_DAMPED,
    AT_FORCE,
    AT_LOST,
    AT_OLD,
    AT_SLOPE,
    AT_STORED,
    AT_V,
    AT_WORK,
    AT_X,
    ATTACHED,
    BORN,
    BROKEN,
    COLUMNS,
    CONTACT_FORCE,
    DAMPED,
    DIRECTION,
    DRIVE_FORCE,
    ELEMENT,
    EVENT,
    EXTREMES,
    FINISHED,
    GROUPS,
    HOPELESS,
    LOST,
    MASS_IN,
    MASS_OUT,
    NEXT_STEP,
    NO_ROOM,
    PANELS,
    PAUSED,
    POSITION,
    REJECTED,
    ROWS,
    SCALARS,
    SHORTER,
    SLOPE,
    SPARE,
    STOPPED,
    STORED,
    TIME,
    UNCOUNTED,
    UNSOLVED,
    UNSTRETCHED,
    VELOCITY,
    WORK,
    Accuracy,
    Case,
    Delays,
    Lot,
    Newborn,
    State,
    Work,
)
from .panel_step import element_at, heading, only_lose, try_step
from .rules import INCREASE, INTEGRAL, MONOMIAL, NODE, PART, P, Q
from .survival import Table

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

# What ends a step: nothing but its length; or the slider turns, it passes the last place where it turned, or detached
# contacts begin to slide. `FAILS` if even the smallest one has no solution.
SMOOTH, TURNS, PASSES, SLIDES, FAILS = range(5)


@bare
def _curve(work: Work, row: int) -> None:
    """Coefficients of the polynomial through a row of nodes."""
    for a in range(P + 1):
        c = 0.0
        for b in range(P + 1):
            c += MONOMIAL[a, b] * work.nodes[row, b]
        work.curves[row, a] = c


@inlined
def _along(work: Work, row: int, u: float) -> float:
    """Value at ``0 <= u <= 1`` of the polynomial through a row, of which `_curve` has been called."""
    total = work.curves[row, P]
    for a in range(P - 1, -1, -1):
        total = total * u + work.curves[row, a]
    return float(total)


@bare
def _crossing(work: Work, row: int, level: float, sign: float) -> float:
    """First place, in (0, 1], where a row crosses a level, in the direction of `sign`; 2 if nowhere."""
    for k in range(1, P + 1):
        if (work.nodes[row, k] - level) * sign > 0.0:
            _curve(work, row)
            a, b = NODE[k - 1], NODE[k]
            for _ in range(50):
                u = 0.5 * (a + b)
                if (_along(work, row, u) - level) * sign > 0.0:
                    b = u
                else:
                    a = u
            return float(b)
    return 2.0


@bare
def _sum_energies(state: State, work: Work, case: Case, dt: float) -> None:
    """Energies up to each node of a step."""
    nodes, scalar, slider = work.nodes, state.scalar, case.slider
    origin, K = scalar[POSITION], slider.stiffness
    for k in range(P + 1):
        t = scalar[TIME] + NODE[k] * dt
        D, U = drive_at(case.drive, t)
        work.curves[AT_WORK, k] = (
            nodes[AT_FORCE, k] * nodes[AT_V, k] if math.isinf(K) else K * (D - origin - nodes[AT_X, k]) * U
        )
        work.curves[AT_DAMPED, k] = 0.0 if math.isinf(K) else slider.mass * slider.damping * nodes[AT_V, k] ** 2
        work.curves[AT_LOST, k] = nodes[AT_FORCE, k] * nodes[AT_V, k]
    for k in range(P + 1):
        w = d = f = 0.0
        for a in range(P + 1):
            w += INTEGRAL[k, a] * work.curves[AT_WORK, a]
            d += INTEGRAL[k, a] * work.curves[AT_DAMPED, a]
            f += INTEGRAL[k, a] * work.curves[AT_LOST, a]
        nodes[AT_WORK, k] = dt * w
        nodes[AT_DAMPED, k] = dt * d
        nodes[AT_LOST, k] = dt * f - nodes[AT_STORED, k] + nodes[AT_STORED, 0]


@bare
def _commit(state: State, work: Work, case: Case, dt: float, way: float) -> None:
    """Make groups and a panel of what a step has done to infinitely many contacts."""
    nodes, scalar, table, newborn = work.nodes, state.scalar, case.table, case.newborn
    origin, y, groups = scalar[POSITION], nodes[AT_X, P], state.groups
    low = high = 0.0
    for k in range(1, P + 1):
        low, high = min(low, nodes[AT_X, k]), max(high, nodes[AT_X, k])
    room = groups.shape[1] - newborn.stretching.size  # for what attaches
    state.used[GROUPS] = divide_passed(groups, state.used[GROUPS], origin + y, table, room)
    kept = 0
    for g in range(state.used[GROUPS]):
        alive = False
        spare = 0.25 * abs(groups[BIRTH, g, Q - 1] - groups[BIRTH, g, 0])
        for j in range(Q):
            b, m, r = groups[BIRTH, g, j], groups[MASS, g, j], groups[REACH, g, j]
            reach = max(r, origin + high - b, b - origin - low)
            if m != 0.0 and reach < table.top + spare:
                alive = True
            groups[BIRTH, kept, j], groups[MASS, kept, j], groups[REACH, kept, j] = b, m, reach
            groups[WHOLE, kept, j] = groups[WHOLE, g, j]
        if alive:
            kept += 1
    if abs(nodes[AT_BORN, P]) > 0.0:
        for i in range(newborn.stretching.size):
            x0 = newborn.stretching[i]
            for j in range(Q):
                m = b = 0.0
                for a in range(1, P + 1):
                    m += INCREASE[P - 1, j, a] * nodes[AT_BORN, a]
                    b += PART[P - 1, j, a] * nodes[AT_X, a]
                b -= way * x0
                groups[BIRTH, kept, j], groups[MASS, kept, j] = origin + b, m * newborn.mass[i]
                groups[REACH, kept, j] = max(abs(y - b), abs(x0))
                groups[WHOLE, kept, j] = 1.0
            kept += 1
    state.used[GROUPS] = kept
    n = state.used[PANELS]
    if not case.delays.memoryless and (case.delays.time.size > 0 or case.delays.fraction > 0.0):
        for j in range(Q):
            m = 0.0
            for a in range(1, P + 1):
                m += INCREASE[P - 1, j, a] * nodes[AT_BROKEN, a]
            state.panels[n, 3 + P + j] = m
        state.panels[n, 0], state.panels[n, 1] = scalar[TIME], dt
        for k in range(P + 1):
            state.panels[n, 2 + k] = scalar[BROKEN] + nodes[AT_BROKEN, k]
        state.used[PANELS] = n + 1
    if case.sliding_force > 0.0:
        scalar[ELEMENT] = element_at(state, case, y)


@bare
def _move(state: State, work: Work, case: Case, dt: float) -> None:
    """Go to the end of a step."""
    nodes, scalar = work.nodes, state.scalar
    scalar[BROKEN] += nodes[AT_BROKEN, P]
    scalar[BORN] += nodes[AT_BORN, P]
    scalar[MASS_IN] += nodes[AT_BORN, P] - nodes[AT_BROKEN, P]
    scalar[MASS_OUT] += nodes[AT_BROKEN, P] - nodes[AT_BORN, P]
    scalar[TIME] += dt
    scalar[POSITION] += nodes[AT_X, P]
    scalar[VELOCITY] = nodes[AT_V, P]
    scalar[CONTACT_FORCE], scalar[ATTACHED] = nodes[AT_FORCE, P], nodes[AT_ATTACHED, P]
    scalar[WORK] += nodes[AT_WORK, P]
    scalar[DAMPED] += nodes[AT_DAMPED, P]
    # What the slider did to the contacts, and they do not store.
    scalar[LOST] += max(nodes[AT_LOST, P], 0.0) if only_lose(case) else nodes[AT_LOST, P]
    scalar[STORED] = nodes[AT_STORED, P]
    _spring(scalar, case)


@bare
def _spring(row: Array, case: Case) -> None:
    if is_rigid(case.slider):
        row[DRIVE_FORCE] = row[CONTACT_FORCE]
    else:
        row[DRIVE_FORCE] = case.slider.stiffness * (drive_at(case.drive, row[TIME])[0] - row[POSITION])


@bare
def _sample(row: Array, t: float, start: Array, state: State, work: Work, case: Case, dt: float) -> None:
    u = (t - start[TIME]) / dt
    row[TIME] = t
    row[POSITION] = start[POSITION] + _along(work, AT_X, u)
    row[VELOCITY] = _along(work, AT_V, u)
    row[CONTACT_FORCE] = _along(work, AT_FORCE, u)
    row[ATTACHED] = min(max(_along(work, AT_ATTACHED, u), 0.0), 1.0)  # a polynomial overshoots
    row[WORK], row[DAMPED] = start[WORK] + _along(work, AT_WORK, u), start[DAMPED] + _along(work, AT_DAMPED, u)
    row[LOST], row[STORED] = start[LOST] + _along(work, AT_LOST, u), _along(work, AT_STORED, u)
    if case.lot.contacts > 0.0:
        deviate(row, t, start, state.scalar, work, case)
    _spring(row, case)


@bare
def _first_step(state: State, case: Case) -> float:
    """A step in which next to nothing can happen that the next ones would not see."""
    if is_rigid(case.slider):
        return float(0.1 * case.accuracy.width / max(abs(state.scalar[VELOCITY]), 1e-300))
    return 0.5 / math.sqrt((case.slider.stiffness + 1.0) / case.slider.mass)


@bare
def _arrest(state: State, case: Case) -> None:
    """Let all that is detached re-attach where the slider is."""
    scalar, newborn, groups = state.scalar, case.newborn, state.groups
    out, e = scalar[MASS_OUT], scalar[ELEMENT]
    scalar[BORN] += out
    if case.lot.contacts > 0.0:
        attach_all(state, case)
        return
    force = stored = 0.0
    for i in range(newborn.stretching.size):
        x, g = scalar[DIRECTION] * newborn.stretching[i], state.used[GROUPS]
        for j in range(Q):
            groups[BIRTH, g, j], groups[MASS, g, j] = scalar[POSITION] - x, out * newborn.mass[i] / Q
            groups[REACH, g, j], groups[WHOLE, g, j] = abs(x), 0.0
        state.used[GROUPS] = g + 1
        force += newborn.fraction[i] * x
        stored += 0.5 * newborn.fraction[i] * x * x
    scalar[CONTACT_FORCE] += out * (force - e)
    scalar[STORED] += out * (stored - 0.5 * e * e)
    scalar[LOST] -= out * (stored - 0.5 * e * e)
    scalar[MASS_IN] += out
    scalar[ATTACHED] = scalar[MASS_IN]
    scalar[MASS_OUT] = 0.0


@bare
def _first_event(state: State, work: Work, case: Case) -> tuple[float, int]:
    """What first ends a smooth step within the one that was tried, and at which part of it."""
    scalar, nodes, tol = state.scalar, work.nodes, case.accuracy.tolerance
    s = 1.0 if (nodes[AT_V, 0] > 0.0 or (nodes[AT_V, 0] == 0.0 and nodes[AT_X, 1] > 0.0)) else -1.0
    u = _crossing(work, AT_V, 0.0, -s)
    if u < 1.0:
        _curve(work, AT_X)
        if nodes[AT_V, 0] != 0.0 and abs(_along(work, AT_X, u)) < 1e-3 * tol:  # it has turned at the start
            s = -s
            u = _crossing(work, AT_V, 0.0, -s)
    what = SMOOTH
    if u < 1.0:
        _curve(work, AT_X)
        top = _along(work, AT_X, u)
        back = 0.0
        for k in range(1, P + 1):
            if NODE[k] > u:
                back = max(back, (top - nodes[AT_X, k]) * s)
        if back > 0.02 * tol and u > 1e-9:
            what = TURNS
        else:
            u = 2.0
    e = state.used[EXTREMES]
    if e >= 2:
        level = state.extremes[e - 2] - scalar[POSITION]
        if level * s > 0.0:
            w = _crossing(work, AT_X, level, s)
            if w < min(u, 1.0):
                beyond = (nodes[AT_X, P] - level) * s
                kink = kink_at(state.groups, state.used[GROUPS], case.table, state.extremes[e - 2])
                if kink * beyond > EVENT * tol:
                    u, what = w, PASSES
    if case.sliding_force > 0.0:
        level = s * case.sliding_force - scalar[ELEMENT]
        if level * s > 1e-9:
            w = _crossing(work, AT_X, level, s)
            if w < min(u, 1.0):
                u, what = w, SLIDES
    return u, what


@bare
def _misled(state: State, work: Work, case: Case) -> float:
    """Error of the force where newborns are stretched along the heading of a step and the slider moves against it."""
    nodes, way, stretching, born = work.nodes, heading(state, work), 0.0, 0.0
    for i in range(case.newborn.stretching.size):
        stretching += case.newborn.fraction[i] * abs(case.newborn.stretching[i])
    for k in range(1, P + 1):
        if nodes[AT_V, k] * way < 0.0:
            born += nodes[AT_BORN, k] - nodes[AT_BORN, k - 1]
    return 2.0 * stretching * born


@bare
def _step(state: State, work: Work, case: Case, most: float, smallest: float) -> tuple[float, int]:
    """Take a step as long as the error and the first event allow, at most `most`: its length, and what ends it."""
    scalar = state.scalar
    planned = scalar[NEXT_STEP]
    if math.isinf(planned):
        planned = _first_step(state, case)
    event = SMOOTH
    stretched = case.newborn.stretching.size > 1 or case.newborn.stretching[0] != 0.0
    while True:
        dt = min(planned, most)
        if event == SMOOTH and dt < most < 1.6 * dt:
            dt = 0.5 * most
        trouble = try_step(state, work, case, dt, smallest)
        if trouble > 1.0 and dt > smallest:
            state.used[REJECTED] += 1
            planned = dt * (SHORTER if trouble == HOPELESS else max(0.9 * trouble ** (-1.0 / P), 0.2))
            event = SMOOTH
            continue
        if trouble == HOPELESS:
            return dt, FAILS
        if event != SMOOTH:
            ahead = work.nodes[AT_V, P] * heading(state, work)
            if event == TURNS and stretched and ahead * dt > 1e-4 * case.accuracy.tolerance:
                event = SMOOTH  # not quite
            return dt, event
        u, event = _first_event(state, work, case)
        if event == SMOOTH and stretched and _misled(state, work, case) > case.accuracy.tolerance and dt > smallest:
            state.used[REJECTED] += 1
            planned = dt * SHORTER
            continue
        if event == SMOOTH:
            if dt == planned or trouble > 0.3:
                scalar[NEXT_STEP] = dt * min(0.9 * max(trouble, 1e-9) ** (-1.0 / P), 3.0)
            return dt, event
        planned = most = max(u * dt, smallest)


@bare
def _held(state: State, work: Work, case: Case, stop: Stop, times: Array, n: int, dt: float) -> float:
    """Length of a step up to the first sample, from the `n`-th on, at which the condition holds; else all of it."""
    scalar = state.scalar
    while n < times.size and times[n] < scalar[TIME] + dt:
        u = (times[n] - scalar[TIME]) / dt
        _curve(work, AT_X)
        _curve(work, AT_FORCE)
        X = scalar[POSITION] + _along(work, AT_X, u)
        force = _along(work, AT_FORCE, u)
        if not is_rigid(case.slider):
            force = case.slider.stiffness * (drive_at(case.drive, times[n])[0] - X)
        if holds(stop, X, force):
            return float(times[n] - scalar[TIME])
        n += 1
    return dt


@bare
def _turn(state: State, work: Work, case: Case, start: Array, dt: float, room: int, broke: bool) -> None:
    """Note a place where the slider turns, at the end of a step in which contacts `broke`."""
    scalar = state.scalar
    if case.table.knots.size > 0:
        state.used[GROUPS] = divide(state.groups, state.used[GROUPS], scalar[POSITION], case.table, room)
    if case.delays.arrest:
        _arrest(state, case)
    if broke:
        mark_rough(state, scalar[TIME])
    if abs(scalar[VELOCITY]) * dt < 1e-4 * case.accuracy.tolerance:
        scalar[VELOCITY] = 0.0
    e = state.used[EXTREMES]
    if e == state.extremes.size:
        for i in range(e - 2):
            state.extremes[i] = state.extremes[i + 2]
        e -= 2
    state.extremes[e] = start[POSITION] + work.nodes[AT_X, P]
    state.used[EXTREMES] = e + 1


@bare
def _pass(state: State, work: Work, event: int) -> None:
    """Forget the last two places where the slider turned, if a step has passed them: at its end, or without notice."""
    scalar, e = state.scalar, state.used[EXTREMES]
    if event == PASSES:
        mark_rough(state, scalar[TIME])
        state.used[EXTREMES] = e - 2
    elif e >= 2:
        s = 1.0 if work.nodes[AT_X, P] > 0.0 else -1.0
        passed, turn = state.extremes[e - 2], state.extremes[e - 1]
        if (scalar[POSITION] - passed) * s > 0.0 and (passed - turn) * s > 0.0:
            state.used[EXTREMES] = e - 2


@bare
def _sample_all(
    rows: Array, times: Array, filled: int, start: Array, state: State, work: Work, case: Case, dt: float, end: float
) -> int:
    """Sample a step up to its end, and return how many samples there are now."""
    scalar = state.scalar
    if filled < times.size and times[filled] < end:
        for row in range(AT_OLD):
            _curve(work, row)
    while filled < times.size and times[filled] < end:
        _sample(rows[filled], times[filled], start, state, work, case, dt)
        if only_lose(case):
            lost = min(max(rows[filled, LOST], start[LOST]), scalar[LOST])
            rows[filled, LOST] = max(lost, rows[filled - 1, LOST]) if filled > 0 else lost
        filled += 1
    return filled


@jit  # which gives the generator back; the others make no array
def _run(
    state: State,
    work: Work,
    case: Case,
    stop: Stop,
    until: float,
    times: Array,
    rows: Array,
    start: Array,
    max_steps: int,
) -> tuple[int, int, int]:
    scalar, nodes = state.scalar, work.nodes
    smallest = 1e-12 * max(1.0, abs(until))
    filled = 0
    counted = case.lot.contacts > 0.0
    spare = SPARE + case.newborn.stretching.size
    room = state.groups.shape[1] - case.newborn.stretching.size
    _spring(scalar, case)
    if is_rigid(case.slider):
        scalar[VELOCITY] = drive_at(case.drive, scalar[TIME])[1]
        if scalar[VELOCITY] == 0.0 and case.delays.arrest and state.used[GROUPS] + spare <= state.groups.shape[1]:
            _arrest(state, case)
    while max_steps > 0:
        while filled < times.size and times[filled] <= scalar[TIME] + smallest:
            for i in range(COLUMNS):
                rows[filled, i] = scalar[i]
            rows[filled, ATTACHED] = min(max(scalar[ATTACHED], 0.0), 1.0)
            filled += 1
            if holds(stop, rows[filled - 1, POSITION], rows[filled - 1, DRIVE_FORCE]):
                return STOPPED, filled, max_steps
        most = until - scalar[TIME]
        if most <= smallest:
            return FINISHED, filled, max_steps
        full = state.used[GROUPS] + spare > state.groups.shape[1] or state.used[PANELS] == state.panels.shape[0]
        if full and not forget(state, case.delays, spare):
            return NO_ROOM, filled, max_steps
        most = min(most, next_front(state, case.delays, scalar[TIME], smallest) - scalar[TIME])
        nodes[AT_FORCE, 0], nodes[AT_SLOPE, 0] = scalar[CONTACT_FORCE], scalar[SLOPE]
        if counted and stop.kind != NOWHERE and filled < times.size:
            most = min(most, times[filled] - scalar[TIME])  # the condition is looked at where all is drawn
        dt, event = _step(state, work, case, most, smallest)
        for i in range(SCALARS):
            start[i] = scalar[i]
        if stop.kind != NOWHERE and not counted and event != FAILS:
            held = _held(state, work, case, stop, times, filled, dt)
            if held < dt:
                dt, event = held, FAILS if try_step(state, work, case, held, held) == HOPELESS else SMOOTH
        if event == FAILS:
            return UNSOLVED, filled, max_steps
        max_steps -= 1
        way = heading(state, work)
        broke = nodes[AT_BROKEN, P] > EVENT * case.accuracy.tolerance
        scalar[SLOPE] = nodes[AT_SLOPE, P]
        _sum_energies(state, work, case, dt)
        if not counted:
            _commit(state, work, case, dt, way)
        _move(state, work, case, dt)
        if counted:
            settle(state, work, case, dt, start, way)
            _spring(scalar, case)
        scalar[DIRECTION] = way
        turned = counted and nodes[AT_V, P] * scalar[VELOCITY] < 0.0
        if event == TURNS:
            _turn(state, work, case, start, dt, room, broke)
        else:
            _pass(state, work, event)
            if turned and case.delays.arrest:
                _arrest(state, case)
        filled = _sample_all(rows, times, filled, start, state, work, case, dt, scalar[TIME] - smallest)
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
        its time), `PAUSED` (the number of steps was used up) or `UNSOLVED` (Newton's method fails in a step however
        short).
    """

    state: State
    rows: Array
    reason: int


def advance(
    state: State,
    table: Table,
    delays: Delays,
    slider: Slider,
    drive: Quadratic,
    *,
    until: float,
    times: Array,
    accuracy: Accuracy,
    newborn: Newborn = UNSTRETCHED,
    sliding_force: float = 0.0,
    lot: Lot = UNCOUNTED,
    stop: Stop = Stop(),
    max_steps: int = 2**62,
) -> Progress:
    """Go on from a state, under one piece of the drive.

    Neither the samples nor the pauses change the steps.

    Parameters
    ----------
    state : State
        Where to start; it is not changed.
    table, delays, slider, drive
        The survival of the thresholds, the delays, the slider and the drive.
    until : float
        Time to reach exactly: the end of the piece.
    times : ndarray
        Rising times of the samples wanted, those up to the start of this call left out, but for its very
        start.
    accuracy : Accuracy
    newborn : Newborn
        With which stretchings contacts attach.
    sliding_force : float
        Force at which a detached contact slides.
    lot : Lot
        How many contacts there are; its generator goes on. The samples of a piece with a condition then are ends of
        steps, and other samples another run.
    stop : Stop
        Condition that ends the piece at the first sample where it holds.
    max_steps : int
        Steps after which to pause, to show progress.

    Returns
    -------
    Progress
    """
    state = copy.deepcopy(state)
    times = np.asarray(times, float)
    rows = np.empty((times.size, COLUMNS))
    case = Case(table, delays, slider, drive, accuracy, newborn, sliding_force, lot)
    filled, reason, steps = 0, NO_ROOM, max_steps
    before = np.zeros(SCALARS)
    while reason == NO_ROOM:
        room = state.groups.shape[1]
        reading = Reading(np.zeros((3, Q * room)), np.zeros(3), np.zeros(room + 1, np.int64))
        nodes, curves = np.zeros((2, ROWS, P + 1))
        work = Work(nodes, curves, np.zeros((P, P + 1)), np.zeros(ROWS), reading, np.zeros(CHANCES))
        reason, more, steps = _run(state, work, case, stop, until, times[filled:], rows[filled:], before, steps)
        filled += more
        if reason == NO_ROOM:
            state = _with_room(state, case)
    return Progress(state, rows[:filled], reason)


def _with_room(state: State, case: Case) -> State:
    """The same state with room for more groups, some joined, and for more panels."""
    used, room = state.used, state.groups.shape[1]
    spare = SPARE + case.newborn.stretching.size
    if used[GROUPS] + spare > room:
        if case.lot.contacts > 0.0:
            kept = joined(state.groups, used[GROUPS], case)
        else:
            kept = merged(state.groups, used[GROUPS], case.table, case.accuracy.width)
        used[GROUPS] = kept.shape[1]
        groups = np.zeros((GROUP_ROWS, room if used[GROUPS] + spare < room // 2 else 2 * room + spare, Q))
        groups[:, : used[GROUPS]] = kept
        state = state._replace(groups=groups)
    if used[PANELS] == len(state.panels):
        state = state._replace(panels=np.concatenate([state.panels, np.zeros_like(state.panels)]))
    return state
