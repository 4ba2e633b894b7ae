"""The master equation, Eqs. (1)-(4), under the motion of a slider, Eq. (11), or a
prescribed one: error-controlled.

A step of time is a panel, on which position, force, and the mass that breaks and
attaches are polynomials through its nodes. The slider is a damped oscillator under a
force that depends on its position (`cohorts`): the equations are satisfied at Radau
nodes, by Newton's method. The mass that attaches in a step becomes a cohort of Gauss
nodes; the mass that breaks re-attaches after delays, fixed or distributed. So the order
is that of the polynomials, five, wherever the motion is smooth. It is not smooth where
the slider reverses, where it passes a place at which it has reversed before, and where
mass that broke at such a moment re-attaches: steps end there. A step is rejected, and a
shorter one tried, if the last coefficients of its polynomials do not decay fast enough,
or if the places where mass attaches in it are too far apart for the Gauss nodes.

Natural units: stretchings in ``x_s``, forces and stiffnesses per contact in ``f_s`` and
``k``, any unit of time.
"""

import copy
import math
from typing import NamedTuple

import numpy as np

from . import panel_state
from ._jit import bare, jit
from .cohorts import (
    ACTIVE,
    COHORT_NODE,
    ON_WAY,
    Reading,
    divide,
    divide_passed,
    kink_at,
    merged,
)
from .drive import (
    FINISHED,
    NO_ROOM,
    NOWHERE,
    PAUSED,
    STOPPED,
    UNSOLVED,
    Stop,
    drive_at,
    holds,
)
from .effective_stretching import NEVER, Breaking, a_way, carried
from .finite_population import attach_all, deviate, joined, settle
from .oscillator import is_rigid, spring_force
from .panel_state import (
    EVENT,
    MOTION,
    NOT_CONVERGED,
    Case,
    FiniteNumber,
    PanelsState,
    Work,
    newborns,
)
from .panel_step import element_at, heading, only_lose, try_step
from .quadrature import (
    GAUSS,
    INCREASE,
    INTEGRAL,
    NODE,
    PART,
    P,
    Q,
    along,
    bisect,
    dot,
    fit,
)
from .reattachment import forget, mark_rough, next_front
from .records import Floats, Record, blank

# What ends a step: only its length; or the slider reverses, or passes the last place
# where it reversed, or detached contacts begin to slide. `FAILS` if even the smallest
# step has no solution.
SMOOTH, TURNS, PASSES, SLIDES, FAILS = range(5)


class Wanted(NamedTuple):
    """End of a call: a time or a condition; times of the samples, and rows for them."""

    until: float
    stop: Stop
    times: Floats
    rows: Record


@bare
def _crossing(
    row: Floats,
    curve: Floats,
    level: float,
    sign: float,
) -> float:
    """Return the first place, in (0, 1], where values at the nodes cross a level in the
    direction of `sign`; 2 if there is none.
    """
    for k in range(1, P + 1):
        if (row[k] - level) * sign > 0.0:
            fit(row, curve)
            return bisect(
                curve,
                level,
                sign,
                NODE[k - 1],
                NODE[k],
                50,
            )[1]
    return 2.0


@bare
def _sum_energies(
    state: PanelsState,
    work: Work,
    case: Case,
    dt: float,
) -> None:
    """Compute the energies up to each node of a step."""
    nodes = work.nodes
    motion = state.motion
    slider = case.slider
    origin = motion.position
    K = slider.stiffness
    for k in range(P + 1):
        t = motion.time + NODE[k] * dt
        D, U = drive_at(case.drive, t)
        work.curves[k].work = (
            nodes[k].force * nodes[k].v
            if math.isinf(K)
            else K * (D - origin - nodes[k].x) * U
        )
        work.curves[k].damped = (
            0.0 if math.isinf(K) else slider.mass * slider.damping * nodes[k].v ** 2
        )
        work.curves[k].lost = nodes[k].force * nodes[k].v
    for k in range(P + 1):
        nodes[k].work = dt * dot(INTEGRAL[k], work.curves.work)
        nodes[k].damped = dt * dot(INTEGRAL[k], work.curves.damped)
        nodes[k].lost = (
            dt * dot(INTEGRAL[k], work.curves.lost) - nodes[k].stored + nodes[0].stored
        )


@bare
def _keep_panel(state: PanelsState, nodes: Record, dt: float) -> None:
    """Store the mass that broke in a step, for contacts that re-attach later."""
    motion = state.motion
    n = state.used.panels
    for j in range(Q):
        state.panels[n, 3 + P + j] = dot(INCREASE[P - 1, j], nodes.broken)
    state.panels[n, 0] = motion.time
    state.panels[n, 1] = dt
    for k in range(P + 1):
        state.panels[n, 2 + k] = motion.broken + nodes[k].broken
    state.used.panels = n + 1


@bare
def _commit(
    state: PanelsState, work: Work, case: Case, dt: float, direction: float
) -> None:
    """Update cohorts and panels after a step, for infinitely many contacts."""
    nodes = work.nodes
    motion = state.motion
    breaking = case.breaking
    newborn = case.newborn
    origin = motion.position
    y = nodes[P].x
    cohorts = state.cohorts
    way = work.reading.way
    last = nodes.size - 2
    room = len(cohorts) - newborn.stretching.size  # leave some for newborns
    state.used.cohorts = divide_passed(
        cohorts, state.used.cohorts, origin + y, breaking, room
    )
    kept = 0
    for g in range(state.used.cohorts):
        alive = False
        spare = 0.25 * abs(cohorts[g, Q - 1].place - cohorts[g, 0].place)
        for j in range(Q):
            cohorts[kept, j] = cohorts[g, j]
            node = cohorts[kept, j]
            x = node.place - origin
            age = motion.time - node.since
            u, r = carried(way, breaking, x, node.clock, node.reach, age, 0.0, last)
            node.clock = u
            node.reach = r
            if (
                node.mass != 0.0
                and r < breaking.thresholds.top + spare
                and u < breaking.blurred.top + spare
            ):
                alive = True
        if alive:
            kept += 1
    if abs(nodes[P].reattached) > 0.0:
        for i in range(newborn.stretching.size):
            x0 = newborn.stretching[i]
            fraction = newborn.fraction[i] * newborns(breaking, newborn, i)
            for j in range(Q):
                m = dot(INCREASE[P - 1, j], nodes.reattached)
                b = dot(PART[P - 1, j], nodes.x) - direction * x0
                r = newborn.tried * abs(x0)
                u, r = carried(way, breaking, b, NEVER, r, 0.0, GAUSS[j], last)
                node = cohorts[kept, j]
                node.place = origin + b
                node.mass = m * fraction
                node.reach = r
                node.clock = u
                node.whole = 1.0
                node.since = motion.time + GAUSS[j] * dt
            kept += 1
    state.used.cohorts = kept
    if not case.delays.memoryless and (
        case.delays.time.size > 0 or case.delays.fraction > 0.0
    ):
        _keep_panel(state, nodes, dt)
    if case.sliding_force > 0.0:
        motion.element = element_at(state, case, y)


@bare
def _move(
    state: PanelsState,
    work: Work,
    case: Case,
    dt: float,
) -> None:
    """Advance the motion to the end of a step."""
    nodes = work.nodes
    motion = state.motion
    motion.broken += nodes[P].broken
    motion.reattached += nodes[P].reattached
    motion.mass_in += nodes[P].reattached - nodes[P].broken
    motion.mass_out += nodes[P].broken - nodes[P].reattached
    motion.time += dt
    motion.position += nodes[P].x
    motion.velocity = nodes[P].v
    motion.contact_force = nodes[P].force
    motion.attached = nodes[P].attached
    motion.work += nodes[P].work
    motion.damped += nodes[P].damped
    # Work of the slider on the contacts that they do not store.
    motion.lost += max(nodes[P].lost, 0.0) if only_lose(case) else nodes[P].lost
    motion.stored = nodes[P].stored
    motion.drive_force = spring_force(
        case.slider,
        case.drive,
        motion.time,
        motion.position,
        motion.contact_force,
    )


@bare
def _sample(
    row: Record,
    t: float,
    end: Record,
    work: Work,
    case: Case,
    finite: FiniteNumber | None,
    dt: float,
) -> None:
    curves = work.curves
    start = work.before[0]
    u = (t - start.time) / dt
    row.time = t
    row.position = start.position + along(curves.x, u)
    row.velocity = along(curves.v, u)
    row.contact_force = along(curves.force, u)
    # the polynomial may overshoot
    row.attached = min(max(along(curves.attached, u), 0.0), 1.0)
    row.work = start.work + along(curves.work, u)
    row.damped = start.damped + along(curves.damped, u)
    row.lost = start.lost + along(curves.lost, u)
    row.stored = along(curves.stored, u)
    if finite is not None:
        deviate(row, t, end, work, case)
    row.drive_force = spring_force(
        case.slider,
        case.drive,
        row.time,
        row.position,
        row.contact_force,
    )


@bare
def _first_step(state: PanelsState, case: Case) -> float:
    """Return the length of a first step, short enough without a step before it."""
    if is_rigid(case.slider) or case.slider.mass == 0.0:
        return float(
            0.1 * case.accuracy.width / max(abs(state.motion.velocity), 1e-300)
        )
    return 0.5 / math.sqrt((case.slider.stiffness + 1.0) / case.slider.mass)


@bare
def _arrest(state: PanelsState, case: Case, finite: FiniteNumber | None) -> None:
    """Re-attach all detached contacts where the slider is."""
    motion = state.motion
    newborn = case.newborn
    cohorts = state.cohorts
    out = motion.mass_out
    e = motion.element
    motion.reattached += out
    if finite is not None:
        attach_all(state, case, finite)
        return
    force = stored = 0.0
    for i in range(newborn.stretching.size):
        x = motion.direction * newborn.stretching[i]
        g = state.used.cohorts
        fraction = newborn.fraction[i] * newborns(case.breaking, newborn, i)
        for j in range(Q):
            node = cohorts[g, j]
            node.place = motion.position - x
            node.mass = out * fraction / Q
            node.reach = newborn.tried * abs(x)
            node.clock = NEVER
            node.whole = 0.0
            node.since = motion.time
        state.used.cohorts = g + 1
        force += newborn.fraction[i] * x
        stored += 0.5 * newborn.fraction[i] * x * x
    motion.contact_force += out * (force - e)
    motion.stored += out * (stored - 0.5 * e * e)
    motion.lost -= out * (stored - 0.5 * e * e)
    motion.mass_in += out
    motion.attached = motion.mass_in
    motion.mass_out = 0.0


@bare
def _first_event(state: PanelsState, work: Work, case: Case) -> tuple[float, int]:
    """Find the first event within a solved, smooth step; return the fraction of the
    step at which it occurs, and its kind.
    """
    motion = state.motion
    nodes = work.nodes
    tol = case.accuracy.tolerance
    s = 1.0 if (nodes[0].v > 0.0 or (nodes[0].v == 0.0 and nodes[1].x > 0.0)) else -1.0
    u = _crossing(nodes.v, work.curves.v, 0.0, -s)
    if u < 1.0:
        fit(work.nodes.x, work.curves.x)
        # the slider has reversed at the start
        if nodes[0].v != 0.0 and abs(along(work.curves.x, u)) < 1e-3 * tol:
            s = -s
            u = _crossing(nodes.v, work.curves.v, 0.0, -s)
    what = SMOOTH
    if u < 1.0:
        fit(work.nodes.x, work.curves.x)
        top = along(work.curves.x, u)
        back = 0.0
        for k in range(1, P + 1):
            if NODE[k] > u:
                back = max(back, (top - nodes[k].x) * s)
        if back > 0.02 * tol and u > 1e-9:
            what = TURNS
        else:
            u = 2.0
    e = state.used.extremes
    if e >= 2:
        level = state.extremes[e - 2] - motion.position
        if level * s > 0.0:
            w = _crossing(nodes.x, work.curves.x, level, s)
            if w < min(u, 1.0):
                beyond = (nodes[P].x - level) * s
                kink = kink_at(
                    state.cohorts,
                    state.used.cohorts,
                    case.breaking,
                    state.extremes[e - 2],
                )
                if kink * beyond > EVENT * tol:
                    u = w
                    what = PASSES
    if case.sliding_force > 0.0:
        level = s * case.sliding_force - motion.element
        if level * s > 1e-9:
            w = _crossing(nodes.x, work.curves.x, level, s)
            if w < min(u, 1.0):
                u = w
                what = SLIDES
    return u, what


@bare
def _misled(state: PanelsState, work: Work, case: Case) -> float:
    """Return the error of the force if newborns are stretched along the heading of a
    step but the slider moves against it.
    """
    nodes = work.nodes
    direction = heading(state, work)
    stretching = 0.0
    reattached = 0.0
    for i in range(case.newborn.stretching.size):
        stretching += case.newborn.fraction[i] * abs(case.newborn.stretching[i])
    for k in range(1, P + 1):
        if nodes[k].v * direction < 0.0:
            reattached += nodes[k].reattached - nodes[k - 1].reattached
    return 2.0 * stretching * reattached


@bare
def _step(
    state: PanelsState,
    work: Work,
    case: Case,
    most: float,
    smallest: float,
) -> tuple[float, int]:
    """Solve a step as long as the error and the first event allow, at most `most`;
    return its length, and what ends it.
    """
    motion = state.motion
    planned = motion.next_step
    if math.isinf(planned):
        planned = _first_step(state, case)
    event = SMOOTH
    stretched = case.newborn.stretching.size > 1 or case.newborn.stretching[0] != 0.0
    # ends: a rejected step is shortened, and the smallest one accepted
    while True:
        dt = min(planned, most)
        if event == SMOOTH and dt < most < 1.6 * dt:
            dt = 0.5 * most
        trouble = try_step(state, work, case, dt, smallest)
        if trouble > 1.0 and dt > smallest:
            state.used.rejected += 1
            planned = dt * (
                panel_state.SHORTER
                if trouble == NOT_CONVERGED
                else max(0.9 * trouble ** (-1.0 / P), 0.2)
            )
            event = SMOOTH
            continue
        if trouble == NOT_CONVERGED:
            return dt, FAILS
        if event != SMOOTH:
            ahead = work.nodes[P].v * heading(state, work)
            if (
                event == TURNS
                and stretched
                and ahead * dt > 1e-4 * case.accuracy.tolerance
            ):
                event = SMOOTH  # the slider has not quite come to rest
            return dt, event
        u, event = _first_event(state, work, case)
        if (
            event == SMOOTH
            and stretched
            and _misled(state, work, case) > case.accuracy.tolerance
            and dt > smallest
        ):
            state.used.rejected += 1
            planned = dt * panel_state.SHORTER
            continue
        if event == SMOOTH:
            if dt == planned or trouble > 0.3:
                motion.next_step = dt * min(0.9 * max(trouble, 1e-9) ** (-1.0 / P), 3.0)
            return dt, event
        planned = most = max(u * dt, smallest)


@bare
def _held(
    state: PanelsState,
    work: Work,
    case: Case,
    wanted: Wanted,
    dt: float,
) -> float:
    """Return the length of a step up to the first sample at which the condition holds;
    else all of it.
    """
    motion = state.motion
    n = state.used.sampled
    times = wanted.times
    while n < times.size and times[n] < motion.time + dt:
        u = (times[n] - motion.time) / dt
        fit(work.nodes.x, work.curves.x)
        fit(work.nodes.force, work.curves.force)
        X = motion.position + along(work.curves.x, u)
        force = along(work.curves.force, u)
        if holds(
            wanted.stop,
            X,
            spring_force(case.slider, case.drive, times[n], X, force),
        ):
            return float(times[n] - motion.time)
        n += 1
    return dt


@bare
def _turn(
    state: PanelsState,
    work: Work,
    case: Case,
    finite: FiniteNumber | None,
    dt: float,
    broke: bool,
) -> None:
    """Record a place where the slider reverses, at the end of a step in which contacts
    broke if `broke`.
    """
    motion = state.motion
    if case.breaking.knots.size > 0:
        room = len(state.cohorts) - case.newborn.stretching.size
        state.used.cohorts = divide(
            state.cohorts,
            state.used.cohorts,
            motion.position,
            case.breaking,
            room,
        )
    if case.delays.arrest:
        _arrest(state, case, finite)
    if broke:
        mark_rough(state, motion.time)
    if abs(motion.velocity) * dt < 1e-4 * case.accuracy.tolerance:
        motion.velocity = 0.0
    e = state.used.extremes
    if e == state.extremes.size:
        for i in range(e - 2):
            state.extremes[i] = state.extremes[i + 2]
        e -= 2
    state.extremes[e] = work.before[0].position + work.nodes[P].x
    state.used.extremes = e + 1


@bare
def _pass(state: PanelsState, work: Work, event: int) -> None:
    """Remove the last two turning points of the slider if a step has passed them."""
    motion = state.motion
    e = state.used.extremes
    if event == PASSES:
        mark_rough(state, motion.time)
        state.used.extremes = e - 2
    elif e >= 2:
        s = 1.0 if work.nodes[P].x > 0.0 else -1.0
        passed = state.extremes[e - 2]
        turn = state.extremes[e - 1]
        if (motion.position - passed) * s > 0.0 and (passed - turn) * s > 0.0:
            state.used.extremes = e - 2


@bare
def _sample_all(
    state: PanelsState,
    work: Work,
    case: Case,
    finite: FiniteNumber | None,
    wanted: Wanted,
    dt: float,
    end: float,
) -> None:
    """Fill the samples of a step up to its end."""
    motion = state.motion
    used = state.used
    start = work.before[0]
    times = wanted.times
    rows = wanted.rows
    if used.sampled < times.size and times[used.sampled] < end:
        for i in range(panel_state.SAMPLED_ROWS):
            fit(work.values[:, i], work.coefficients[:, i])
    while used.sampled < times.size and times[used.sampled] < end:
        row = rows[used.sampled]
        _sample(row, times[used.sampled], motion, work, case, finite, dt)
        if only_lose(case):
            lost = min(max(row.lost, start.lost), motion.lost)
            row.lost = (
                max(lost, rows[used.sampled - 1].lost) if used.sampled > 0 else lost
            )
        used.sampled += 1


@bare
def _sample_here(state: PanelsState, wanted: Wanted, smallest: float) -> bool:
    """Fill the samples that are due at the start of a step; return whether the stop
    condition holds there.
    """
    motion = state.motion
    used = state.used
    while (
        used.sampled < wanted.times.size
        and wanted.times[used.sampled] <= motion.time + smallest
    ):
        row = wanted.rows[used.sampled]
        wanted.rows[used.sampled] = motion
        row.attached = min(max(motion.attached, 0.0), 1.0)
        used.sampled += 1
        if holds(wanted.stop, row.position, row.drive_force):
            return True
    return False


@jit  # not `bare`: numba must return the random generator of `finite`
def _run(
    state: PanelsState,
    work: Work,
    case: Case,
    finite: FiniteNumber | None,
    wanted: Wanted,
) -> int:
    """Take steps until there is a reason to return."""
    motion = state.motion
    nodes = work.nodes
    used = state.used
    stop = wanted.stop
    until = wanted.until
    smallest = 1e-12 * max(1.0, abs(until))
    counted = finite is not None
    spare = panel_state.SPARE + case.newborn.stretching.size
    motion.drive_force = spring_force(
        case.slider,
        case.drive,
        motion.time,
        motion.position,
        motion.contact_force,
    )
    if is_rigid(case.slider):
        motion.velocity = drive_at(case.drive, motion.time)[1]
        if (
            motion.velocity == 0.0
            and case.delays.arrest
            and used.cohorts + spare <= len(state.cohorts)
        ):
            _arrest(state, case, finite)
    while used.left > 0:
        if _sample_here(state, wanted, smallest):
            return STOPPED
        most = until - motion.time
        if most <= smallest:
            return FINISHED
        full = (
            used.cohorts + spare > len(state.cohorts)
            or used.panels == state.panels.shape[0]
        )
        if full and not forget(state, case.delays, spare):
            return NO_ROOM
        most = min(
            most, next_front(state, case.delays, motion.time, smallest) - motion.time
        )
        nodes[0].force = motion.contact_force
        nodes[0].slope = motion.slope
        if counted and stop.kind != NOWHERE and used.sampled < wanted.times.size:
            # the condition is checked where all draws have been made
            most = min(most, wanted.times[used.sampled] - motion.time)
        dt, event = _step(state, work, case, most, smallest)
        work.before[0] = motion
        if stop.kind != NOWHERE and not counted and event != FAILS:
            held = _held(state, work, case, wanted, dt)
            if held < dt:
                dt = held
                event = (
                    FAILS
                    if try_step(state, work, case, held, held) == NOT_CONVERGED
                    else SMOOTH
                )
        if event == FAILS:
            return UNSOLVED
        used.left -= 1
        _take(state, work, case, finite, dt, event)
        _sample_all(state, work, case, finite, wanted, dt, motion.time - smallest)
    return PAUSED


@bare
def _take(
    state: PanelsState,
    work: Work,
    case: Case,
    finite: FiniteNumber | None,
    dt: float,
    event: int,
) -> None:
    """Accept a step that has been solved, with the event at its end."""
    motion = state.motion
    nodes = work.nodes
    direction = heading(state, work)
    broke = nodes[P].broken > EVENT * case.accuracy.tolerance
    motion.slope = nodes[P].slope + nodes[P].ahead + nodes[P].back
    _sum_energies(state, work, case, dt)
    if finite is None:
        _commit(state, work, case, dt, direction)
    _move(state, work, case, dt)
    if finite is not None:
        settle(state, work, case, finite, dt, direction)
        motion.drive_force = spring_force(
            case.slider,
            case.drive,
            motion.time,
            motion.position,
            motion.contact_force,
        )
    motion.direction = direction
    if event == TURNS:
        _turn(state, work, case, finite, dt, broke)
    else:
        _pass(state, work, event)
        if (
            finite is not None
            and case.delays.arrest
            and nodes[P].v * motion.velocity < 0.0
        ):
            _arrest(state, case, finite)


def advance_panels(
    state: PanelsState,
    case: Case,
    until: float,
    times: Floats,
    stop: Stop = Stop(),
    max_steps: int = 2**62,
) -> tuple[PanelsState, Record, int]:
    """Advance a copy of the state under one piece of the drive, which ends at the time
    `until`.

    Neither the samples, at rising times, nor the pauses after `max_steps` change the
    steps. But with a finite number of contacts and a stop condition, steps end at the
    samples, and other samples give another run. Returns the state, a row for each
    sample time that was passed, and the reason: `FINISHED`, `STOPPED`, `PAUSED`, or
    `UNSOLVED` if Newton's method fails even in the smallest step.
    """
    state = copy.deepcopy(state)
    finite = case.finite
    # separate, so that functions that do not use it are compiled once
    case = case._replace(finite=None)
    times = np.asarray(times, float)
    rows = np.empty(times.size, MOTION).view(np.recarray)
    wanted = Wanted(until, stop, times, rows)
    state.used.sampled = 0
    state.used.left = max_steps
    # ends: each turn doubles the room, until memory runs out
    while (
        reason := _run(state, _room_to_work(state, case.breaking), case, finite, wanted)
    ) == NO_ROOM:
        state = _with_room(state, case, finite)
    return state, rows[: state.used.sampled], reason


def _room_to_work(state: PanelsState, breaking: Breaking) -> Work:
    room = len(state.cohorts)
    reading = Reading(
        blank(ACTIVE, Q * room),
        blank(ON_WAY, Q * room),
        np.zeros(3),
        np.zeros(room + 1, np.int64),
        a_way(breaking),
    )
    values = np.zeros((P + 2, len(panel_state.AT_NODE)))
    coefficients = np.zeros((P + 1, len(panel_state.AT_NODE)))
    nodes, curves = (
        matrix.view(panel_state.AT_NODE)[:, 0].view(np.recarray)
        for matrix in (values, coefficients)
    )
    before = blank(MOTION, 1)
    matrix = np.zeros((2 * P + 1, P))
    return Work(
        nodes,
        values,
        curves,
        coefficients,
        before,
        matrix,
        reading,
        blank(panel_state.FLUCTUATION),
    )


def _with_room(
    state: PanelsState,
    case: Case,
    finite: FiniteNumber | None,
) -> PanelsState:
    """Return the state with room for more cohorts, after joining some, and for more
    panels.
    """
    used = state.used
    room = len(state.cohorts)
    spare = panel_state.SPARE + case.newborn.stretching.size
    if used.cohorts + spare > room:
        if finite is not None:
            kept = joined(
                state.cohorts,
                used.cohorts,
                case.breaking,
                finite,
                state.motion.time,
            )
        else:
            kept = merged(
                state.cohorts,
                used.cohorts,
                case.breaking,
                case.accuracy.width,
                case.accuracy.tolerance,
            )
        used.cohorts = len(kept)
        if used.cohorts + spare >= room // 2:
            room = 2 * room + spare
        cohorts = blank(COHORT_NODE, (room, Q))
        cohorts[: used.cohorts] = kept
        state = state._replace(cohorts=cohorts)
    if used.panels == len(state.panels):
        state = state._replace(
            panels=np.concatenate([state.panels, np.zeros_like(state.panels)])
        )
    return state
