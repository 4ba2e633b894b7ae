"""One step of the master equation: positions and forces that agree at its nodes, and
the error that decides whether it is too long.
"""

import math

from ._jit import bare, inlined
from .cohorts import force_at, gather
from .drive import drive_at
from .effective_stretching import (
    BACK,
    LENGTH,
    NEVER,
    PULLED,
    STEP,
    carried,
    is_fixed,
    run_clocks,
    survival,
)
from .oscillator import is_rigid
from .panel_state import (
    FIRST,
    MOST_SWEEPS,
    NEGLIGIBLE,
    NOT_CONVERGED,
    Case,
    Delays,
    PanelsState,
    Work,
    newborns,
)
from .quadrature import (
    COLLOCATION,
    GAUSS,
    INCREASE,
    LAST,
    NODE,
    PART,
    SLOPES,
    P,
    Q,
    dot,
    solve,
)
from .reattachment import all_reattachment, known_reattachment
from .records import Floats, Record


@inlined
def _unresolved(row: Floats) -> float:
    """Return the error of the polynomial through the nodes, estimated from the decay of
    its last three coefficients.
    """
    a = abs(dot(LAST[2], row))
    b = abs(dot(LAST[1], row))
    c = abs(dot(LAST[0], row))
    if b > 0.0:
        # a kink may lie where the last coefficient vanishes
        a = max(a, b * min(b / c, 1.0) if c > 0.0 else b)
    return a if a >= b else max(a * a / b, 0.03 * b)


@bare
def _observe(
    state: PanelsState,
    work: Work,
    count: int,
    case: Case,
    dt: float,
) -> None:
    """Compute the contacts at the nodes of a step from the slider's positions there."""
    nodes = work.nodes
    A0 = state.motion.mass_in
    run_clocks(work.reading.way, nodes, case.breaking, dt)
    for k in range(1, P + 1):
        y = nodes[k].x
        F, A, S, E, ahead, back = force_at(
            work.reading,
            state.cohorts,
            state.motion.position,
            count,
            case.breaking,
            y,
            k,
        )
        nodes[k].ahead = ahead
        nodes[k].back = back
        nodes[k].force = F
        nodes[k].old = A
        nodes[k].slope = S
        nodes[k].stored = E
        nodes[k].broken = A0 - A + nodes[k].young


@bare
def _newborn(
    state: PanelsState,
    work: Work,
    case: Case,
    dt: float,
) -> float:
    """Add the contacts that attach in the step, less those that break in it again, to
    what `_observe` has found; return the change of the latter since the last sweep.
    """
    nodes = work.nodes
    way = work.reading.way
    newborn = case.newborn
    all_reattachment(work, case.delays, dt)
    direction = heading(state, work)
    change = 0.0
    for k in range(1, P + 1):
        y = nodes[k].x
        F = A = E = lost = 0.0
        for j in range(Q):
            reattached = dot(INCREASE[k - 1, j], nodes.reattached)
            b = dot(PART[k - 1, j], nodes.x)
            for i in range(newborn.stretching.size):
                x = y - b + direction * newborn.stretching[i]
                m = reattached * newborn.fraction[i]
                r = newborn.tried * abs(newborn.stretching[i])
                u, r = carried(
                    way,
                    case.breaking,
                    y - x,
                    NEVER,
                    r,
                    0.0,
                    NODE[k] * GAUSS[j],
                    k,
                )
                held = survival(case.breaking, u, r)[0]
                if held < 1.0:
                    held *= m * newborns(case.breaking, newborn, i)
                    lost += m - held
                    m = held
                A += m
                F += m * x
                E += m * x * x
        nodes[k].force += F
        nodes[k].attached = nodes[k].old + A
        nodes[k].slope += A
        nodes[k].stored += 0.5 * E
        if case.sliding_force > 0.0:
            _slide(state, work, case, k, direction)
        nodes[k].broken = state.motion.mass_in - nodes[k].old + lost
        change = max(change, abs(lost - nodes[k].young))
        nodes[k].young = lost
    if case.delays.memoryless:
        _hold(work, case.delays, dt)
    return change


@inlined
def heading(state: PanelsState, work: Work) -> float:
    """Return the direction in which the slider moves in a step, 1 or -1; if it is at
    rest, that of its last motion.

    The velocity at the start does not give it: the slider may reverse there.
    """
    direction = work.nodes[1].x
    if direction == 0.0:
        direction = state.motion.velocity
    if direction == 0.0:
        direction = state.motion.direction
    return 1.0 if direction > 0.0 else -1.0


@inlined
def reach(nodes: Record) -> tuple[float, float]:
    """Return the extreme displacements of the slider in a step, behind and ahead."""
    low = high = 0.0
    for k in range(1, P + 1):
        low = min(low, nodes[k].x)
        high = max(high, nodes[k].x)
    return low, high


@inlined
def only_lose(case: Case) -> bool:
    """Return whether contacts never add energy: they neither attach stretched nor slide
    with more force than broke them.
    """
    newborn = case.newborn.stretching
    return bool(newborn.size == 1 and newborn[0] == 0.0 and case.sliding_force == 0.0)


@inlined
def element_at(state: PanelsState, case: Case, y: float) -> float:
    """Return the force of the element that represents the detached contacts: elastic,
    as contacts are, until it yields.
    """
    return float(
        max(min(state.motion.element + y, case.sliding_force), -case.sliding_force)
    )


@inlined
def _slide(
    state: PanelsState,
    work: Work,
    case: Case,
    k: int,
    direction: float,
) -> None:
    """Add the force of the detached contacts."""
    nodes = work.nodes
    e = element_at(state, case, nodes[k].x)
    detached = 1.0 - nodes[k].attached
    nodes[k].slope -= direction * e * (nodes[k].slope - nodes[k].attached)
    if abs(e) < case.sliding_force:
        nodes[k].slope += detached
    nodes[k].force += detached * e
    nodes[k].stored += 0.5 * detached * e * e


@bare
def _hold(work: Work, delays: Delays, dt: float) -> None:
    """Keep attached the fraction of the paper's approximation, Eq. (10), at the present
    breaking rate.

    Contacts re-attach at once, and the attached fraction follows the rate. The
    approximation has no memory of when contacts broke, and has a spurious oscillation
    of its own; it is exact for the mean force of steady sliding.
    """
    nodes = work.nodes
    nodes[0] = nodes[FIRST]
    for k in range(P + 1):
        held = 1.0 / (1.0 + delays.mean * max(dot(SLOPES[k], nodes.broken) / dt, 0.0))
        nodes[k].force *= held
        nodes[k].attached *= held
        nodes[k].slope *= held
        nodes[k].stored *= held


@inlined
def _slope(work: Work, k: int, c: int) -> float:
    """Return the slope of the force at node `k` in the position at node `c`."""
    nodes = work.nodes
    way = work.reading.way
    slope = (
        nodes[k].ahead * way[PULLED + k, c] + nodes[k].back * way[PULLED + BACK + k, c]
    )
    return float(slope + nodes[k].slope if k == c else slope)


@bare
def _newton(
    state: PanelsState,
    work: Work,
    case: Case,
    dt: float,
) -> float:
    """Move the slider at the nodes by one step of Newton's method; return the largest
    change of position.
    """
    nodes = work.nodes
    stiffness = work.matrix[P : 2 * P]
    V = work.matrix[2 * P]
    K = case.slider.stiffness
    M = case.slider.mass
    eta = case.slider.damping
    for r in range(P):
        V[r] = nodes[r + 1].work
        for c in range(P):
            stiffness[r, c] = _slope(work, r + 1, c + 1)
        stiffness[r, r] += K
    if M == 0.0:  # the forces are in equilibrium
        solve(stiffness, V)
        for r in range(P + 1):
            total = 0.0
            for c in range(P):
                total += SLOPES[r, c + 1] * V[c]
            nodes[r].v = total / dt
    else:
        _accelerate(state, work, M, eta, dt)
        for r in range(P):
            nodes[r + 1].v = V[r]
    change = 0.0
    for r in range(P):
        y = V[r] if M == 0.0 else dt * dot(COLLOCATION[r], V)
        change = max(change, abs(y - nodes[r + 1].x))
        nodes[r + 1].x = y
    return change if math.isfinite(nodes[P].x) else math.inf


@bare
def _accelerate(
    state: PanelsState,
    work: Work,
    M: float,
    eta: float,
    dt: float,
) -> None:
    """Compute the velocities at the nodes from forces and stiffness, and store them in
    place of the forces.
    """
    matrix = work.matrix[:P]
    stiffness = work.matrix[P : 2 * P]
    V = work.matrix[2 * P]
    for r in range(P):
        for c in range(P):
            matrix[r, c] = 0.0
            for k in range(P):
                matrix[r, c] += stiffness[r, k] * COLLOCATION[k, c]
    for r in range(P):
        for c in range(P):
            total = 0.0
            for k in range(P):
                total += COLLOCATION[r, k] * matrix[k, c]
            stiffness[r, c] = dt * (eta * COLLOCATION[r, c] + dt / M * total)
        stiffness[r, r] += 1.0
    for r in range(P):
        matrix[0, r] = dot(COLLOCATION[r], V)
    for r in range(P):
        V[r] = state.motion.velocity + dt / M * matrix[0, r]
    solve(stiffness, V)


@bare
def _pull(
    state: PanelsState,
    work: Work,
    case: Case,
    dt: float,
) -> None:
    """Compute the net force at the nodes for a slider that stayed at the origin,
    linearized with the slopes found.
    """
    nodes = work.nodes
    K = case.slider.stiffness
    for k in range(1, P + 1):
        D = drive_at(case.drive, state.motion.time + NODE[k] * dt)[0]
        nodes[k].work = K * (D - state.motion.position) - nodes[k].force
        for c in range(1, P + 1):
            nodes[k].work += _slope(work, k, c) * nodes[c].x


@inlined
def _gather(
    state: PanelsState,
    work: Work,
    case: Case,
    low: float,
    high: float,
) -> int:
    """Collect the cohorts for motion of the slider between `low` and `high`."""
    motion = state.motion
    return gather(
        state.cohorts,
        state.used.cohorts,
        motion.position,
        work.reading,
        case.breaking,
        low,
        high,
        motion.time,
    )


@bare
def _begin(
    state: PanelsState,
    work: Work,
    case: Case,
    dt: float,
) -> None:
    """Guess the positions of the slider at the nodes, as if nothing more broke.

    In rigid motion they are those of the drive. A slider without mass is guessed to
    keep its velocity: while it breaks contacts it has hardly any stiffness.
    """
    nodes = work.nodes
    motion = state.motion
    for k in range(1, P + 1):
        if is_rigid(case.slider):
            D, V = drive_at(case.drive, motion.time + NODE[k] * dt)
            nodes[k].x = D - motion.position
            nodes[k].v = V
        elif case.slider.mass == 0.0:
            nodes[k].x = NODE[k] * dt * motion.velocity
            nodes[k].v = motion.velocity
        else:
            nodes[k].x = 0.0
            nodes[k].force = nodes[0].force
            nodes[k].slope = nodes[0].slope
            nodes[k].ahead = nodes[k].back = 0.0
    if case.slider.mass > 0.0 and not is_rigid(case.slider):
        _pull(state, work, case, dt)
        _newton(state, work, case, dt)


@bare
def _start(
    state: PanelsState,
    work: Work,
    case: Case,
    count: int,
    velocity: float,
) -> None:
    """Set the node at the start of a step: motion, force and energy of the contacts."""
    nodes = work.nodes
    nodes[0].x = 0.0
    nodes[0].v = velocity
    F, A, S, E, _, _ = force_at(
        work.reading,
        state.cohorts,
        state.motion.position,
        count,
        case.breaking,
        0.0,
        nodes.size - FIRST - 1,
    )
    nodes[0].force = F
    nodes[0].attached = A
    nodes[0].stored = E
    if is_fixed(case.breaking):  # otherwise the slope is that of the step before
        nodes[0].slope = S
    if case.sliding_force > 0.0:
        _slide(state, work, case, 0, heading(state, work))
    nodes[0].broken = nodes[0].reattached = nodes[0].known = 0.0
    for k in range(P + 1):
        nodes[k].young = 0.0
    nodes[FIRST] = nodes[0]


@bare
def try_step(
    state: PanelsState,
    work: Work,
    case: Case,
    dt: float,
    smallest: float,
) -> float:
    """Solve a step without accepting it; return its error in tolerances (above 1: too
    long), or `NOT_CONVERGED`.

    A step of the `smallest` length is solved however rough the re-attachment in it is,
    even a jump: no shorter step is tried.
    """
    nodes = work.nodes
    motion = state.motion
    slider = case.slider
    tol = case.accuracy.tolerance
    state.used.steps += 1
    work.reading.way[STEP, LENGTH] = dt
    known_reattachment(state, work, case.delays, dt)
    rigid = is_rigid(slider)
    nodes[0].known = 0.0
    rough = max(tol, case.accuracy.rough)
    if dt > smallest and _unresolved(nodes.known) > 4.0 * rough:
        resolved = True
        for i in range(case.delays.time.size):
            if 0.0 < case.delays.time[i] < dt:
                resolved = False
        if resolved:
            return _unresolved(nodes.known) / rough
    V0 = motion.velocity
    _begin(state, work, case, dt)
    low, high = reach(nodes)
    margin = 0.3 * (high - low) + 0.01 * case.accuracy.width
    low = low - margin
    high = high + margin
    count = _gather(state, work, case, low, high)
    _start(state, work, case, count, V0)
    moved = math.inf
    for sweep in range(MOST_SWEEPS):
        state.used.sweeps += 1
        _observe(state, work, count, case, dt)
        change = _newborn(state, work, case, dt)
        if not rigid:
            _pull(state, work, case, dt)
            moved, before = (
                _newton(state, work, case, dt) * (slider.stiffness + 1.0),
                moved,
            )
            change = max(change, moved)
            # the iteration diverges
            if not change < 1e3 or moved > max(before, case.accuracy.width):
                return NOT_CONVERGED
            low1, high1 = reach(nodes)
            if low1 < low or high1 > high:
                margin = 0.5 * (high1 - low1)
                low = low1 - margin
                high = high1 + margin
                count = _gather(state, work, case, low, high)
        if change < 0.05 * tol:
            break
        if sweep == MOST_SWEEPS - 1:
            return NOT_CONVERGED
    if not rigid:  # once more, at the final positions of the slider
        _observe(state, work, count, case, dt)
        _newborn(state, work, case, dt)
    if not case.delays.memoryless:  # contacts broken in the last sweep re-attach too
        all_reattachment(work, case.delays, dt)
        for k in range(P + 1):
            nodes[k].attached = motion.mass_in - nodes[k].broken + nodes[k].reattached
    return _trouble(nodes, case, dt)


@bare
def _trouble(nodes: Record, case: Case, dt: float) -> float:
    """Return the larger of the error of a solved step, in tolerances, and of the
    slider's displacement over what the nodes resolve.
    """
    slider = case.slider
    tol = case.accuracy.tolerance
    rough = max(case.accuracy.tolerance, case.accuracy.rough)
    error = max(_unresolved(nodes.force), _unresolved(nodes.broken))
    if not is_rigid(slider):
        error = max(error, (slider.stiffness + 1.0) * _unresolved(nodes.x))
    d = abs(nodes[P].x)
    m = abs(nodes[P].reattached)
    trouble = max(error / tol, _unresolved(nodes.reattached) / rough)
    trouble = max(trouble, (abs(nodes[P].broken) / case.accuracy.broken) ** P)
    if m > NEGLIGIBLE * tol:
        ratio = (d / case.accuracy.width) ** (2 * Q)
        trouble = max(trouble, ratio / max(1.0, d / m))
    m = abs(nodes[P].broken)
    if case.delays.fraction > 0.0 and m > NEGLIGIBLE * tol:
        d = dt / case.delays.grain
        trouble = max(trouble, d ** (2 * Q) / max(1.0, d / m))
    return float(trouble)
