"""One step of the master equation: positions and forces that agree at its nodes, and whether it is too long."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .births import known_births, own_births
from .drive import drive_at
from .groups import force_at, gather
from .oscillator import is_rigid
from .panel_state import (
    AT_ATTACHED,
    AT_BORN,
    AT_BROKEN,
    AT_FORCE,
    AT_KNOWN,
    AT_OLD,
    AT_SLOPE,
    AT_STORED,
    AT_V,
    AT_WORK,
    AT_X,
    AT_YOUNG,
    DIRECTION,
    ELEMENT,
    GROUPS,
    HOPELESS,
    MASS_IN,
    MOST_SWEEPS,
    NEGLIGIBLE,
    POSITION,
    STEPS,
    SWEEPS,
    TIME,
    VELOCITY,
    Case,
    Delays,
    State,
    Work,
)
from .rules import COLLOCATION, INCREASE, LAST, NODE, PART, SLOPES, P, Q
from .survival import value_at

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@inlined
def _unresolved(row: Array) -> float:
    """Error of the polynomial through the nodes, from the decay of its last coefficients, each with its neighbours."""
    a = b = c = 0.0
    for k in range(P + 1):
        a += LAST[2, k] * row[k]
        b += LAST[1, k] * row[k]
        c += LAST[0, k] * row[k]
    a, b, c = abs(a), abs(b), abs(c)
    if b > 0.0:
        a = max(a, b * min(b / c, 1.0) if c > 0.0 else b)  # a kink may lie where the last one has a zero
    return a if a >= b else max(a * a / b, 0.03 * b)


@bare
def _observe(state: State, work: Work, count: int, case: Case) -> None:
    """Contacts at the nodes of a step, the slider being where the nodes say."""
    nodes, table = work.nodes, case.table
    A0 = state.scalar[MASS_IN]
    for k in range(1, P + 1):
        y = nodes[AT_X, k]
        F, A, S, E = force_at(work.reading, state.groups, state.scalar[POSITION], count, table, y)
        nodes[AT_FORCE, k], nodes[AT_OLD, k], nodes[AT_SLOPE, k], nodes[AT_STORED, k] = F, A, S, E
        nodes[AT_BROKEN, k] = A0 - A + nodes[AT_YOUNG, k]


@bare
def _newborn(state: State, work: Work, case: Case, dt: float) -> float:
    """Add what attaches in the step to what `_observe` has found, and what of it breaks at once."""
    nodes, table, newborn = work.nodes, case.table, case.newborn
    own_births(work, case.delays, dt)
    way = heading(state, work)
    change = 0.0
    for k in range(1, P + 1):
        y = nodes[AT_X, k]
        F = A = E = lost = 0.0
        for j in range(Q):
            born = b = 0.0
            for a in range(1, P + 1):
                born += INCREASE[k - 1, j, a] * nodes[AT_BORN, a]
                b += PART[k - 1, j, a] * nodes[AT_X, a]
            for i in range(newborn.stretching.size):
                x = y - b + way * newborn.stretching[i]
                m = born * newborn.fraction[i]
                reach = max(abs(x), abs(newborn.stretching[i]))
                if reach > table.bottom:
                    held = born * newborn.mass[i] * value_at(table, reach)
                    lost += m - held
                    m = held
                A += m
                F += m * x
                E += m * x * x
        nodes[AT_FORCE, k] += F
        nodes[AT_ATTACHED, k] = nodes[AT_OLD, k] + A
        nodes[AT_SLOPE, k] += A
        nodes[AT_STORED, k] += 0.5 * E
        if case.sliding_force > 0.0:
            _slide(state, work, case, k, way)
        nodes[AT_BROKEN, k] = state.scalar[MASS_IN] - nodes[AT_OLD, k] + lost
        change = max(change, abs(lost - nodes[AT_YOUNG, k]))
        nodes[AT_YOUNG, k] = lost
    if case.delays.memoryless:
        _hold(work, case.delays, dt)
    return change


@inlined
def heading(state: State, work: Work) -> float:
    """Direction in which the slider moves in a step, 1 or -1; that of its last motion if it is at rest.

    Not that of its velocity at the start: it may turn there.
    """
    way = work.nodes[AT_X, 1]
    if way == 0.0:
        way = state.scalar[VELOCITY]
    if way == 0.0:
        way = state.scalar[DIRECTION]
    return 1.0 if way > 0.0 else -1.0


@inlined
def only_lose(case: Case) -> bool:
    """Whether contacts bring no energy where they attach stretched, or slide with more force than broke them."""
    newborn = case.newborn.stretching
    return bool(newborn.size == 1 and newborn[0] == 0.0 and case.sliding_force == 0.0)


@inlined
def element_at(state: State, case: Case, y: float) -> float:
    """Force of the element that stands for the detached contacts: elastic, as contacts are, until it yields."""
    return float(max(min(state.scalar[ELEMENT] + y, case.sliding_force), -case.sliding_force))


@inlined
def _slide(state: State, work: Work, case: Case, k: int, way: float) -> None:
    """Add the force that detached contacts carry."""
    nodes = work.nodes
    e, detached = element_at(state, case, nodes[AT_X, k]), 1.0 - nodes[AT_ATTACHED, k]
    nodes[AT_SLOPE, k] -= way * e * (nodes[AT_SLOPE, k] - nodes[AT_ATTACHED, k])
    if abs(e) < case.sliding_force:
        nodes[AT_SLOPE, k] += detached
    nodes[AT_FORCE, k] += detached * e
    nodes[AT_STORED, k] += 0.5 * detached * e * e


@bare
def _hold(work: Work, delays: Delays, dt: float) -> None:
    """Leave attached only what holds by Eq. (10), at the breaking rate of the moment."""
    nodes = work.nodes
    for row in (AT_FORCE, AT_ATTACHED, AT_SLOPE, AT_STORED):
        nodes[row, 0] = work.start[row]
    for k in range(P + 1):
        rate = 0.0
        for a in range(P + 1):
            rate += SLOPES[k, a] * nodes[AT_BROKEN, a]
        held = 1.0 / (1.0 + delays.mean * max(rate / dt, 0.0))
        nodes[AT_FORCE, k] *= held
        nodes[AT_ATTACHED, k] *= held
        nodes[AT_SLOPE, k] *= held
        nodes[AT_STORED, k] *= held


@bare
def _solve(matrix: Array) -> None:
    """Gaussian elimination with pivots; the last column becomes the solution."""
    for c in range(P):
        best = c
        for r in range(c + 1, P):
            if abs(matrix[r, c]) > abs(matrix[best, c]):
                best = r
        if best != c:
            for k in range(c, P + 1):
                matrix[c, k], matrix[best, k] = matrix[best, k], matrix[c, k]
        one = 1.0 / matrix[c, c]
        for r in range(c + 1, P):
            f = matrix[r, c] * one
            if f != 0.0:
                for k in range(c + 1, P + 1):
                    matrix[r, k] -= f * matrix[c, k]
    for c in range(P - 1, -1, -1):
        total = matrix[c, P]
        for k in range(c + 1, P):
            total -= matrix[c, k] * matrix[k, P]
        matrix[c, P] = total / matrix[c, c]


@bare
def _newton(state: State, work: Work, case: Case, dt: float) -> float:
    """Move the slider at the nodes by one step of Newton's method; the largest change of place."""
    nodes, matrix, slider = work.nodes, work.matrix, case.slider
    K, M, eta = slider.stiffness, slider.mass, slider.damping
    V0 = state.scalar[VELOCITY]
    for r in range(P):
        rhs = 0.0
        for c in range(P):
            rhs += COLLOCATION[r, c] * nodes[AT_WORK, c + 1]
            total = 0.0
            for k in range(P):
                total += COLLOCATION[r, k] * (K + nodes[AT_SLOPE, k + 1]) * COLLOCATION[k, c]
            matrix[r, c] = dt * (eta * COLLOCATION[r, c] + dt / M * total)
        matrix[r, r] += 1.0
        matrix[r, P] = V0 + dt / M * rhs
    _solve(matrix)
    change = 0.0
    for r in range(P):
        nodes[AT_V, r + 1] = matrix[r, P]
    for r in range(P):
        y = 0.0
        for c in range(P):
            y += COLLOCATION[r, c] * nodes[AT_V, c + 1]
        y *= dt
        change = max(change, abs(y - nodes[AT_X, r + 1]))
        nodes[AT_X, r + 1] = y
    return change


@bare
def _pull(state: State, work: Work, case: Case, dt: float) -> None:
    """Net force at the nodes if the slider stayed at the origin, by the slope found."""
    nodes, K = work.nodes, case.slider.stiffness
    for k in range(1, P + 1):
        D = drive_at(case.drive, state.scalar[TIME] + NODE[k] * dt)[0]
        nodes[AT_WORK, k] = K * (D - state.scalar[POSITION]) - nodes[AT_FORCE, k] + nodes[AT_SLOPE, k] * nodes[AT_X, k]


@inlined
def _gather(state: State, work: Work, case: Case, low: float, high: float) -> int:
    """Read the groups for ways of the slider from `low` to `high`."""
    table, origin = case.table, state.scalar[POSITION]
    return gather(state.groups, state.used[GROUPS], origin, work.reading, table, low, high)


@bare
def _begin(state: State, work: Work, case: Case, dt: float) -> None:
    """Put the slider at the nodes to where it went if nothing more broke; a rigid one to where it is driven."""
    nodes, scalar = work.nodes, state.scalar
    for k in range(1, P + 1):
        if is_rigid(case.slider):
            D, V = drive_at(case.drive, scalar[TIME] + NODE[k] * dt)
            nodes[AT_X, k], nodes[AT_V, k] = D - scalar[POSITION], V
        else:
            nodes[AT_FORCE, k], nodes[AT_SLOPE, k], nodes[AT_X, k] = nodes[AT_FORCE, 0], nodes[AT_SLOPE, 0], 0.0
    if not is_rigid(case.slider):
        _pull(state, work, case, dt)
        _newton(state, work, case, dt)


@bare
def try_step(state: State, work: Work, case: Case, dt: float, smallest: float) -> float:
    """Solve a step without taking it; returns its error in tolerances (above 1: it is too long).

    A step of the `smallest` length is solved however rough it is, for no shorter one is tried: what re-attaches may
    jump in it. `HOPELESS` if it could not be solved.
    """
    nodes, scalar, slider, tol = work.nodes, state.scalar, case.slider, case.accuracy.tolerance
    table = case.table
    state.used[STEPS] += 1
    known_births(state, work, case.delays, dt)
    rigid = is_rigid(slider)
    nodes[AT_KNOWN, 0] = 0.0
    rough = max(tol, case.accuracy.rough)
    if dt > smallest and _unresolved(nodes[AT_KNOWN]) > 4.0 * rough:
        resolved = True
        for i in range(case.delays.time.size):
            if 0.0 < case.delays.time[i] < dt:
                resolved = False
        if resolved:
            return _unresolved(nodes[AT_KNOWN]) / rough
    V0 = scalar[VELOCITY]
    _begin(state, work, case, dt)
    low = high = 0.0
    for k in range(1, P + 1):
        low, high = min(low, nodes[AT_X, k]), max(high, nodes[AT_X, k])
    margin = 0.3 * (high - low) + 0.01 * case.accuracy.width
    low, high = low - margin, high + margin
    count = _gather(state, work, case, low, high)
    # the start
    nodes[AT_X, 0], nodes[AT_V, 0] = 0.0, V0
    F, A, S, E = force_at(work.reading, state.groups, scalar[POSITION], count, table, 0.0)
    nodes[AT_FORCE, 0], nodes[AT_ATTACHED, 0], nodes[AT_SLOPE, 0], nodes[AT_STORED, 0] = F, A, S, E
    if case.sliding_force > 0.0:
        _slide(state, work, case, 0, heading(state, work))
    for row in (AT_FORCE, AT_ATTACHED, AT_SLOPE, AT_STORED):
        work.start[row] = nodes[row, 0]
    nodes[AT_BROKEN, 0] = nodes[AT_BORN, 0] = nodes[AT_KNOWN, 0] = 0.0
    for k in range(P + 1):
        nodes[AT_YOUNG, k] = 0.0
    for sweep in range(MOST_SWEEPS):
        state.used[SWEEPS] += 1
        _observe(state, work, count, case)
        change = _newborn(state, work, case, dt)
        if not rigid:
            _pull(state, work, case, dt)
            change = max(change, _newton(state, work, case, dt) * (slider.stiffness + 1.0))
            if not change < 1e3:
                return HOPELESS
            low1 = high1 = 0.0
            for k in range(1, P + 1):
                low1, high1 = min(low1, nodes[AT_X, k]), max(high1, nodes[AT_X, k])
            if low1 < low or high1 > high:
                margin = 0.5 * (high1 - low1)
                low, high = low1 - margin, high1 + margin
                count = _gather(state, work, case, low, high)
        if change < 0.05 * tol:
            break
        if sweep == MOST_SWEEPS - 1:
            return HOPELESS
    if not rigid:  # once more, at the places where the slider has come to lie
        _observe(state, work, count, case)
        _newborn(state, work, case, dt)
    if not case.delays.memoryless:  # what broke in the last sweep re-attaches, too
        own_births(work, case.delays, dt)
        for k in range(P + 1):
            nodes[AT_ATTACHED, k] = scalar[MASS_IN] - nodes[AT_BROKEN, k] + nodes[AT_BORN, k]
    error = max(_unresolved(nodes[AT_FORCE]), _unresolved(nodes[AT_BROKEN]))
    if not rigid:
        error = max(error, (slider.stiffness + 1.0) * _unresolved(nodes[AT_X]))
    d, m = abs(nodes[AT_X, P]), abs(nodes[AT_BORN, P])
    trouble = max(error / tol, _unresolved(nodes[AT_BORN]) / rough)
    trouble = max(trouble, (abs(nodes[AT_BROKEN, P]) / case.accuracy.broken) ** P)
    if m > NEGLIGIBLE * tol:
        ratio = (d / case.accuracy.width) ** (2 * Q)
        trouble = max(trouble, ratio / max(1.0, d / m))
    m = abs(nodes[AT_BROKEN, P])
    if case.delays.fraction > 0.0 and m > NEGLIGIBLE * tol:
        d = dt / case.delays.grain
        trouble = max(trouble, d ** (2 * Q) / max(1.0, d / m))
    return float(trouble)
