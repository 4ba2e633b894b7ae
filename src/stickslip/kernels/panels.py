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

from ._jit import bare, inlined
from .drive import NOWHERE, Quadratic, Stop, drive_at, holds
from .groups import BIRTH, MASS, REACH, WHOLE, Reading, divide, divide_passed, force_at, gather, kink_at, merged
from .oscillator import Slider
from .rules import (
    COLLOCATION,
    GAUSS,
    INCREASE,
    INTEGRAL,
    LAST,
    MONOMIAL,
    NODE,
    PART,
    SLOPES,
    WEIGHT,
    P,
    Q,
)
from .survival import Table, value_at, values_at

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Delays(NamedTuple):
    """Times until a broken contact re-attaches; none: it never does.

    Attributes
    ----------
    time, weight : ndarray, shape (n,)
        Given times, 0 for at once, and the fraction of what breaks that comes back after each.
    spread : Table
        Survival of the times of the rest that comes back, the fraction `share`; a part of the motion that is longer
        than `grain` has to be cut.
    mean : float
    arrest : bool
        What is detached re-attaches when the slider next stops.
    memoryless : bool
        The paper's approximation, Eq. (10): contacts re-attach at once, and the fraction of them that is attached
        follows the breaking rate of the moment. It has no memory of what broke when, and oscillates in its own,
        spurious way; it is exact for the mean force of steady sliding.
    """

    time: Array
    weight: Array
    spread: Table
    share: float
    grain: float
    mean: float
    arrest: bool
    memoryless: bool


class Accuracy(NamedTuple):
    """Largest error of a step, and how far the slider may go while all that is attached re-attaches in a step."""

    tolerance: float
    width: float


class _Case(NamedTuple):
    """All that stays the same in a call."""

    table: Table
    delays: Delays
    slider: Slider
    drive: Quadratic
    accuracy: Accuracy


class State(NamedTuple):
    """All that the next step needs. Arrays have room to spare; `used` says how much is filled.

    Attributes
    ----------
    scalar : ndarray, shape (16,)
        The quantities `TIME` ... `SLOPE`.
    groups : ndarray, shape (4, room, Q)
        See `stickslip.kernels.groups`.
    panels : ndarray, shape (room, 3 + P + Q)
        Of each step: its start and length, the mass broken up to each of its nodes, and the mass that breaks in it by
        nodes of Gauss.
    cursor : ndarray of int, shape (n_delays,)
        Panel of the time one delay ago.
    front : ndarray of int, shape (n_delays,)
        First of the rough moments of which not all has re-attached yet.
    extremes : ndarray
        Places where the slider has turned and that it has not passed since.
    rough : ndarray
        Ring of moments at which what breaks has no smooth rate.
    used : ndarray of int, shape (7,)
        Numbers of groups, panels, extremes, rough moments; steps tried, sweeps over the contacts, steps rejected.
    """

    scalar: Array
    groups: Array
    panels: Array
    cursor: IntArray
    front: IntArray
    extremes: Array
    rough: Array
    used: IntArray


class _Work(NamedTuple):
    """Room to calculate in: rows of values at the nodes, and the polynomials through them."""

    nodes: Array
    curves: Array
    matrix: Array
    start: Array
    reading: Reading


# Columns of the samples, which are also the first scalars. Energies: work of the drive, dissipated by
# damping, lost in breaks, stored in contacts.
COLUMNS = 10
TIME, POSITION, VELOCITY, DRIVE_FORCE, CONTACT_FORCE, ATTACHED, WORK, DAMPED, LOST, STORED = range(COLUMNS)
# Further scalars: mass broken and re-attached so far, mass outside and in groups, the step to try next, and the slope
# of the contact force.
SCALARS = 16
BROKEN, BORN, MASS_OUT, MASS_IN, NEXT_STEP, SLOPE = range(COLUMNS, SCALARS)

GROUPS, PANELS, EXTREMES, ROUGH, STEPS, SWEEPS, REJECTED = range(7)

# Why `advance` came back.
FINISHED, STOPPED, PAUSED, NO_ROOM = range(4)

# Rows of values at the nodes: way of the slider and its velocity; force, attached, slope of the force; broken,
# re-attached; energy of the contacts; what re-attaches of what broke before; work, damped, lost; attached of what was
# so at the start; broken of what was not.
_X, _V, _F, _A, _S, _BROKEN, _BORN, _STORED, _KNOWN, _WORK, _DAMPED, _LOST, _OLD, _YOUNG = range(14)
_ROWS = 14

_SPARE = 16
"""Groups for which there must be room before a step."""
_HOPELESS = 100.0
"""Error of a step that Newton's method did not solve."""
_SWEEPS = 12
"""Sweeps of Newton's method before a step is cut."""
_NEGLIGIBLE = 1e-2
"""Mass, in tolerances, that need not be resolved."""
_EVENT = 0.1
"""Error, in tolerances, of a kink that no step need end at."""


@inlined
def _is_rigid(slider: Slider) -> bool:
    return math.isinf(slider.stiffness)


@bare
def _broken_at(state: State, i: int, t: float) -> float:
    """Mass broken up to time `t`, which is before now; the cursor of delay `i` follows."""
    panels, n = state.panels, state.used[PANELS]
    k = state.cursor[i]
    while k < n - 1 and panels[k + 1, 0] <= t:
        k += 1
    while k > 0 and panels[k, 0] > t:
        k -= 1
    state.cursor[i] = k
    return _in_panel(panels, k, t)


@inlined
def _in_panel(panels: Array, k: int, t: float) -> float:
    u = min(max((t - panels[k, 0]) / panels[k, 1], 0.0), 1.0)
    total = 0.0
    base = panels[k, 2]
    for a in range(P, 0, -1):
        c = 0.0
        for b in range(1, P + 1):
            c += MONOMIAL[a, b] * (panels[k, 2 + b] - base)
        total = (total + c) * u
    return float(base + total)


@bare
def _known_births(state: State, work: _Work, delays: Delays, dt: float) -> None:
    """What broke before this step and re-attaches up to each node of it."""
    nodes = work.nodes
    t = state.scalar[TIME]
    for k in range(P + 1):
        nodes[_KNOWN, k] = 0.0
    for i in range(delays.time.size):
        tau, weight = delays.time[i], delays.weight[i]
        if tau == 0.0:
            continue
        start = _broken_at(state, i, t - tau)
        for k in range(1, P + 1):
            at = t - tau + NODE[k] * dt
            if at >= t:
                nodes[_KNOWN, k] += weight * (state.scalar[BROKEN] - start)
            else:
                nodes[_KNOWN, k] += weight * (_broken_at(state, i, at) - start)
    if delays.share > 0.0:
        _spread_births(state, work, delays, dt)


@bare
def _spread_births(state: State, work: _Work, delays: Delays, dt: float) -> None:
    """Add what re-attaches after a delay of the continuous part."""
    panels, nodes, table = state.panels, work.nodes, delays.spread
    t = state.scalar[TIME]
    for p in range(state.used[PANELS] - 1, -1, -1):
        if panels[p, 0] + panels[p, 1] < t - table.top:
            break
        for j in range(Q):
            m = panels[p, 3 + P + j]
            if abs(m) < 1e-17:
                continue
            age = t - panels[p, 0] - GAUSS[j] * panels[p, 1]
            left = value_at(table, age)
            if left == 0.0:
                continue
            for k in range(1, P + 1):
                nodes[_KNOWN, k] += delays.share * m * (left - value_at(table, age + NODE[k] * dt))


@bare
def _own_births(work: _Work, delays: Delays, dt: float) -> None:
    """All that re-attaches up to each node: what was known, and what breaks in the step itself."""
    nodes = work.nodes
    for k in range(1, P + 1):
        nodes[_BORN, k] = nodes[_KNOWN, k]
    for i in range(delays.time.size):
        tau, weight = delays.time[i], delays.weight[i]
        if tau >= dt:
            continue
        for k in range(1, P + 1):
            if tau == 0.0:
                nodes[_BORN, k] += weight * nodes[_BROKEN, k]
                continue
            u = NODE[k] - tau / dt
            if u > 0.0:
                total = 0.0
                for a in range(P, 0, -1):
                    c = 0.0
                    for b in range(1, P + 1):
                        c += MONOMIAL[a, b] * nodes[_BROKEN, b]
                    total = (total + c) * u
                nodes[_BORN, k] += weight * total
    if delays.share > 0.0:
        for k in range(1, P + 1):
            total = 0.0
            for j in range(Q):
                m = 0.0
                for a in range(1, P + 1):
                    m += INCREASE[k - 1, j, a] * nodes[_BROKEN, a]
                total += m * (1.0 - value_at(delays.spread, NODE[k] * (1.0 - GAUSS[j]) * dt))
            nodes[_BORN, k] += delays.share * total


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
def _observe(state: State, work: _Work, count: int, case: _Case) -> None:
    """Contacts at the nodes of a step, the slider being where the nodes say."""
    nodes, table = work.nodes, case.table
    A0 = state.scalar[MASS_IN]
    for k in range(1, P + 1):
        y = nodes[_X, k]
        F, A, S, E = force_at(work.reading, state.groups, state.scalar[POSITION], count, table, y)
        nodes[_F, k], nodes[_OLD, k], nodes[_S, k], nodes[_STORED, k] = F, A, S, E
        nodes[_BROKEN, k] = A0 - A + nodes[_YOUNG, k]


@bare
def _newborn(state: State, work: _Work, case: _Case, dt: float) -> float:
    """Add what attaches in the step to what `_observe` has found, and what of it breaks at once."""
    nodes, table = work.nodes, case.table
    _own_births(work, case.delays, dt)
    change = 0.0
    for k in range(1, P + 1):
        y = nodes[_X, k]
        F = A = E = lost = 0.0
        for j in range(Q):
            m = b = 0.0
            for a in range(1, P + 1):
                m += INCREASE[k - 1, j, a] * nodes[_BORN, a]
                b += PART[k - 1, j, a] * nodes[_X, a]
            x = y - b
            if abs(x) > table.bottom:
                J = value_at(table, abs(x))
                lost += m * (1.0 - J)
                m *= J
            A += m
            F += m * x
            E += m * x * x
        nodes[_F, k] += F
        nodes[_A, k] = nodes[_OLD, k] + A
        nodes[_S, k] += A
        nodes[_STORED, k] += 0.5 * E
        nodes[_BROKEN, k] = state.scalar[MASS_IN] - nodes[_OLD, k] + lost
        change = max(change, abs(lost - nodes[_YOUNG, k]))
        nodes[_YOUNG, k] = lost
    if case.delays.memoryless:
        _hold(work, case.delays, dt)
    return change


@bare
def _hold(work: _Work, delays: Delays, dt: float) -> None:
    """Leave attached only what holds by Eq. (10), at the breaking rate of the moment."""
    nodes = work.nodes
    for row in (_F, _A, _S, _STORED):
        nodes[row, 0] = work.start[row]
    for k in range(P + 1):
        rate = 0.0
        for a in range(P + 1):
            rate += SLOPES[k, a] * nodes[_BROKEN, a]
        held = 1.0 / (1.0 + delays.mean * max(rate / dt, 0.0))
        nodes[_F, k] *= held
        nodes[_A, k] *= held
        nodes[_S, k] *= held
        nodes[_STORED, k] *= held


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
def _newton(state: State, work: _Work, case: _Case, dt: float) -> float:
    """Move the slider at the nodes by one step of Newton's method; the largest change of place."""
    nodes, matrix, slider = work.nodes, work.matrix, case.slider
    K, M, eta = slider.stiffness, slider.mass, slider.damping
    V0 = state.scalar[VELOCITY]
    for r in range(P):
        rhs = 0.0
        for c in range(P):
            rhs += COLLOCATION[r, c] * nodes[_WORK, c + 1]
            total = 0.0
            for k in range(P):
                total += COLLOCATION[r, k] * (K + nodes[_S, k + 1]) * COLLOCATION[k, c]
            matrix[r, c] = dt * (eta * COLLOCATION[r, c] + dt / M * total)
        matrix[r, r] += 1.0
        matrix[r, P] = V0 + dt / M * rhs
    _solve(matrix)
    change = 0.0
    for r in range(P):
        nodes[_V, r + 1] = matrix[r, P]
    for r in range(P):
        y = 0.0
        for c in range(P):
            y += COLLOCATION[r, c] * nodes[_V, c + 1]
        y *= dt
        change = max(change, abs(y - nodes[_X, r + 1]))
        nodes[_X, r + 1] = y
    return change


@bare
def _pull(state: State, work: _Work, case: _Case, dt: float) -> None:
    """Net force at the nodes if the slider stayed at the origin, by the slope found."""
    nodes, K = work.nodes, case.slider.stiffness
    for k in range(1, P + 1):
        D = drive_at(case.drive, state.scalar[TIME] + NODE[k] * dt)[0]
        nodes[_WORK, k] = K * (D - state.scalar[POSITION]) - nodes[_F, k] + nodes[_S, k] * nodes[_X, k]


@inlined
def _gather(state: State, work: _Work, case: _Case, low: float, high: float) -> int:
    """Read the groups for ways of the slider from `low` to `high`."""
    table, origin = case.table, state.scalar[POSITION]
    return gather(state.groups, state.used[GROUPS], origin, work.reading, table, low, high)


@bare
def _try_step(state: State, work: _Work, case: _Case, dt: float) -> float:
    """Solve a step without taking it; returns its error in tolerances (above 1: it is too long)."""
    nodes, scalar, slider, tol = work.nodes, state.scalar, case.slider, case.accuracy.tolerance
    table = case.table
    state.used[STEPS] += 1
    _known_births(state, work, case.delays, dt)
    rigid = _is_rigid(slider)
    nodes[_KNOWN, 0] = 0.0
    if _unresolved(nodes[_KNOWN]) > 4.0 * tol:
        resolved = True
        for i in range(case.delays.time.size):
            if 0.0 < case.delays.time[i] < dt:
                resolved = False
        if resolved:
            return _unresolved(nodes[_KNOWN]) / tol
    V0 = scalar[VELOCITY]
    if rigid:
        for k in range(1, P + 1):
            D, V = drive_at(case.drive, scalar[TIME] + NODE[k] * dt)
            nodes[_X, k], nodes[_V, k] = D - scalar[POSITION], V
    else:  # as if nothing more broke
        for k in range(1, P + 1):
            nodes[_F, k], nodes[_S, k], nodes[_X, k] = nodes[_F, 0], nodes[_S, 0], 0.0
        _pull(state, work, case, dt)
        _newton(state, work, case, dt)
    low = high = 0.0
    for k in range(1, P + 1):
        low, high = min(low, nodes[_X, k]), max(high, nodes[_X, k])
    margin = 0.3 * (high - low) + 0.01 * case.accuracy.width
    low, high = low - margin, high + margin
    count = _gather(state, work, case, low, high)
    # the start
    nodes[_X, 0], nodes[_V, 0] = 0.0, V0
    F, A, S, E = force_at(work.reading, state.groups, scalar[POSITION], count, table, 0.0)
    nodes[_F, 0], nodes[_A, 0], nodes[_S, 0], nodes[_STORED, 0] = F, A, S, E
    for row in (_F, _A, _S, _STORED):
        work.start[row] = nodes[row, 0]
    nodes[_BROKEN, 0] = nodes[_BORN, 0] = nodes[_KNOWN, 0] = 0.0
    for k in range(P + 1):
        nodes[_YOUNG, k] = 0.0
    for sweep in range(_SWEEPS):
        state.used[SWEEPS] += 1
        _observe(state, work, count, case)
        change = _newborn(state, work, case, dt)
        if not rigid:
            _pull(state, work, case, dt)
            change = max(change, _newton(state, work, case, dt) * (slider.stiffness + 1.0))
            if not change < 1e3:
                return _HOPELESS
            low1 = high1 = 0.0
            for k in range(1, P + 1):
                low1, high1 = min(low1, nodes[_X, k]), max(high1, nodes[_X, k])
            if low1 < low or high1 > high:
                margin = 0.5 * (high1 - low1)
                low, high = low1 - margin, high1 + margin
                count = _gather(state, work, case, low, high)
        if change < 0.05 * tol:
            break
        if sweep == _SWEEPS - 1:
            return _HOPELESS
    if not rigid:  # once more, at the places where the slider has come to lie
        _observe(state, work, count, case)
        _newborn(state, work, case, dt)
    error = max(_unresolved(nodes[_F]), _unresolved(nodes[_BROKEN]), _unresolved(nodes[_BORN]))
    if not rigid:
        error = max(error, (slider.stiffness + 1.0) * _unresolved(nodes[_X]))
    d, m = abs(nodes[_X, P]), abs(nodes[_BORN, P])
    trouble = error / tol
    if m > _NEGLIGIBLE * tol:
        ratio = (d / case.accuracy.width) ** (2 * Q)
        trouble = max(trouble, ratio / max(1.0, d / m))
    m = abs(nodes[_BROKEN, P])
    if case.delays.share > 0.0 and m > _NEGLIGIBLE * tol:
        d = dt / case.delays.grain
        trouble = max(trouble, d ** (2 * Q) / max(1.0, d / m))
    return float(trouble)


@bare
def _curve(work: _Work, row: int) -> None:
    """Coefficients of the polynomial through a row of nodes."""
    for a in range(P + 1):
        c = 0.0
        for b in range(P + 1):
            c += MONOMIAL[a, b] * work.nodes[row, b]
        work.curves[row, a] = c


@inlined
def _along(work: _Work, row: int, u: float) -> float:
    """Value at ``0 <= u <= 1`` of the polynomial through a row, of which `_curve` has been called."""
    total = work.curves[row, P]
    for a in range(P - 1, -1, -1):
        total = total * u + work.curves[row, a]
    return float(total)


@bare
def _crossing(work: _Work, row: int, level: float, sign: float) -> float:
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
def _commit(state: State, work: _Work, case: _Case, dt: float, low: float, high: float) -> None:
    nodes, scalar, slider, table = work.nodes, state.scalar, case.slider, case.table
    origin = scalar[POSITION]
    y = nodes[_X, P]
    groups = state.groups
    # energies on the way
    K = slider.stiffness
    for k in range(P + 1):
        t = scalar[TIME] + NODE[k] * dt
        D, U = drive_at(case.drive, t)
        work.curves[_WORK, k] = nodes[_F, k] * nodes[_V, k] if math.isinf(K) else K * (D - origin - nodes[_X, k]) * U
        work.curves[_DAMPED, k] = 0.0 if math.isinf(K) else slider.mass * slider.damping * nodes[_V, k] ** 2
        work.curves[_LOST, k] = nodes[_F, k] * nodes[_V, k]
    for k in range(P + 1):
        w = d = f = 0.0
        for a in range(P + 1):
            w += INTEGRAL[k, a] * work.curves[_WORK, a]
            d += INTEGRAL[k, a] * work.curves[_DAMPED, a]
            f += INTEGRAL[k, a] * work.curves[_LOST, a]
        nodes[_WORK, k] = dt * w
        nodes[_DAMPED, k] = dt * d
        nodes[_LOST, k] = dt * f - nodes[_STORED, k] + nodes[_STORED, 0]
    state.used[GROUPS] = divide_passed(groups, state.used[GROUPS], origin + y, table)
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
    if abs(nodes[_BORN, P]) > 0.0:
        for j in range(Q):
            m = b = 0.0
            for a in range(1, P + 1):
                m += INCREASE[P - 1, j, a] * nodes[_BORN, a]
                b += PART[P - 1, j, a] * nodes[_X, a]
            reach = max(abs(y - b), 0.0)
            groups[BIRTH, kept, j], groups[MASS, kept, j], groups[REACH, kept, j] = origin + b, m, reach
            groups[WHOLE, kept, j] = 1.0
        kept += 1
    state.used[GROUPS] = kept
    n = state.used[PANELS]
    if not case.delays.memoryless and (case.delays.time.size > 0 or case.delays.share > 0.0):
        for j in range(Q):
            m = 0.0
            for a in range(1, P + 1):
                m += INCREASE[P - 1, j, a] * nodes[_BROKEN, a]
            state.panels[n, 3 + P + j] = m
        state.panels[n, 0], state.panels[n, 1] = scalar[TIME], dt
        for k in range(P + 1):
            state.panels[n, 2 + k] = scalar[BROKEN] + nodes[_BROKEN, k]
        state.used[PANELS] = n + 1
    scalar[BROKEN] += nodes[_BROKEN, P]
    scalar[BORN] += nodes[_BORN, P]
    scalar[MASS_IN] += nodes[_BORN, P] - nodes[_BROKEN, P]
    scalar[MASS_OUT] += nodes[_BROKEN, P] - nodes[_BORN, P]
    scalar[TIME] += dt
    scalar[POSITION] = origin + y
    scalar[VELOCITY] = nodes[_V, P]
    scalar[CONTACT_FORCE], scalar[ATTACHED] = nodes[_F, P], nodes[_A, P]
    scalar[WORK] += nodes[_WORK, P]
    scalar[DAMPED] += nodes[_DAMPED, P]
    scalar[LOST] += max(nodes[_LOST, P], 0.0)  # what the slider did to the contacts, and they do not store
    scalar[STORED] = nodes[_STORED, P]
    _spring(scalar, case)


@bare
def _spring(row: Array, case: _Case) -> None:
    if _is_rigid(case.slider):
        row[DRIVE_FORCE] = row[CONTACT_FORCE]
    else:
        row[DRIVE_FORCE] = case.slider.stiffness * (drive_at(case.drive, row[TIME])[0] - row[POSITION])


@bare
def _sample(row: Array, t: float, start: Array, work: _Work, case: _Case, dt: float) -> None:
    u = (t - start[TIME]) / dt
    row[TIME] = t
    row[POSITION] = start[POSITION] + _along(work, _X, u)
    row[VELOCITY] = _along(work, _V, u)
    row[CONTACT_FORCE] = _along(work, _F, u)
    row[ATTACHED] = min(max(_along(work, _A, u), 0.0), 1.0)  # a polynomial overshoots
    row[WORK], row[DAMPED] = start[WORK] + _along(work, _WORK, u), start[DAMPED] + _along(work, _DAMPED, u)
    row[LOST], row[STORED] = start[LOST] + _along(work, _LOST, u), _along(work, _STORED, u)
    _spring(row, case)


@bare
def _next_front(state: State, delays: Delays, t: float, smallest: float) -> float:
    """The next time at which what broke at a rough moment re-attaches."""
    front = math.inf
    n = state.used[ROUGH]
    size = state.rough.size
    for i in range(delays.time.size):
        k = state.front[i]
        while k < n and state.rough[k % size] + delays.time[i] <= t + smallest:
            k += 1
        state.front[i] = k
        if k < n:
            front = min(front, state.rough[k % size] + delays.time[i])
    return float(front)


@bare
def _mark_rough(state: State, t: float) -> None:
    n, size = state.used[ROUGH], state.rough.size
    if n == 0 or state.rough[(n - 1) % size] < t:
        state.rough[n % size] = t
        state.used[ROUGH] = n + 1
        for i in range(state.front.size):
            state.front[i] = max(state.front[i], n + 1 - size)


@bare
def _first_step(state: State, case: _Case) -> float:
    """A step in which next to nothing can happen that the next ones would not see."""
    if _is_rigid(case.slider):
        return float(0.1 * case.accuracy.width / max(abs(state.scalar[VELOCITY]), 1e-300))
    return 0.5 / math.sqrt((case.slider.stiffness + 1.0) / case.slider.mass)


@bare
def _arrest(state: State) -> None:
    """Let all that is detached re-attach where the slider is."""
    scalar, g = state.scalar, state.used[GROUPS]
    for j in range(Q):
        state.groups[BIRTH, g, j], state.groups[MASS, g, j] = scalar[POSITION], scalar[MASS_OUT] / Q
        state.groups[REACH, g, j] = state.groups[WHOLE, g, j] = 0.0
    state.used[GROUPS] = g + 1
    scalar[BORN] += scalar[MASS_OUT]
    scalar[MASS_IN] += scalar[MASS_OUT]
    scalar[ATTACHED] = scalar[MASS_IN]
    scalar[MASS_OUT] = 0.0


@bare
def _run(
    state: State,
    work: _Work,
    case: _Case,
    stop: Stop,
    until: float,
    times: Array,
    rows: Array,
    start: Array,
    max_steps: int,
) -> tuple[int, int, int]:
    scalar, slider, nodes = state.scalar, case.slider, work.nodes
    smallest = 1e-12 * max(1.0, abs(until))
    filled = 0
    tol = case.accuracy.tolerance
    _spring(scalar, case)
    if _is_rigid(slider):
        scalar[VELOCITY] = drive_at(case.drive, scalar[TIME])[1]
        if scalar[VELOCITY] == 0.0 and case.delays.arrest and state.used[GROUPS] < state.groups.shape[1]:
            _arrest(state)
    while max_steps > 0:
        while filled < times.size and times[filled] <= scalar[TIME] + smallest:
            for i in range(COLUMNS):
                rows[filled, i] = scalar[i]
            rows[filled, ATTACHED] = min(max(scalar[ATTACHED], 0.0), 1.0)
            filled += 1
            if holds(stop, rows[filled - 1, POSITION], rows[filled - 1, DRIVE_FORCE]):
                return STOPPED, filled, max_steps
        left = until - scalar[TIME]
        if left <= smallest:
            return FINISHED, filled, max_steps
        full = state.used[GROUPS] + _SPARE > state.groups.shape[1] or state.used[PANELS] == state.panels.shape[0]
        if full and not _forget(state, case.delays):
            return NO_ROOM, filled, max_steps
        front = _next_front(state, case.delays, scalar[TIME], smallest) - scalar[TIME]
        nodes[_F, 0], nodes[_S, 0] = scalar[CONTACT_FORCE], scalar[SLOPE]
        planned = scalar[NEXT_STEP]
        if math.isinf(planned):
            planned = _first_step(state, case)
        most = min(left, front)
        event = 0.0
        cut = False
        while True:
            dt = min(planned, most)
            if not cut and dt < most < 1.6 * dt:
                dt = 0.5 * most
            trouble = _try_step(state, work, case, dt)
            if trouble > 1.0 and dt > smallest:
                state.used[REJECTED] += 1
                planned = dt * max(0.9 * trouble ** (-1.0 / P), 0.2)
                event = 0.0
                cut = False
                continue
            if cut:
                break
            # the slider turns, or passes the last place where it turned
            s = 1.0 if (nodes[_V, 0] > 0.0 or (nodes[_V, 0] == 0.0 and nodes[_X, 1] > 0.0)) else -1.0
            u = _crossing(work, _V, 0.0, -s)
            if u < 1.0:
                _curve(work, _X)
                if abs(_along(work, _X, u)) < 1e-3 * tol:  # it has turned at the start
                    s = -s
                    u = _crossing(work, _V, 0.0, -s)
            what = 0.0
            if u < 1.0:
                _curve(work, _X)
                top = _along(work, _X, u)
                back = 0.0
                for k in range(1, P + 1):
                    if NODE[k] > u:
                        back = max(back, (top - nodes[_X, k]) * s)
                if back > 0.02 * tol and u > 1e-9:
                    what = 1.0
                else:
                    u = 2.0
            e = state.used[EXTREMES]
            if e >= 2:
                level = state.extremes[e - 2] - scalar[POSITION]
                if level * s > 0.0:
                    w = _crossing(work, _X, level, s)
                    if w < min(u, 1.0):
                        beyond = (nodes[_X, P] - level) * s
                        if (
                            kink_at(state.groups, state.used[GROUPS], case.table, state.extremes[e - 2]) * beyond
                            > _EVENT * tol
                        ):
                            u, what = w, 2.0
            if what == 0.0:
                break
            event, cut = what, True
            dt = u * dt
            if dt < smallest:
                break
            planned = most = dt
        if not cut:
            growth = min(0.9 * max(trouble, 1e-9) ** (-1.0 / P), 3.0)
            if dt == planned or trouble > 0.3:
                scalar[NEXT_STEP] = dt * growth
        for i in range(SCALARS):
            start[i] = scalar[i]
        n = filled
        max_steps -= 1
        while stop.kind != NOWHERE and n < times.size and times[n] < scalar[TIME] + dt:
            # the energies do not matter here
            u = (times[n] - scalar[TIME]) / dt
            _curve(work, _X)
            _curve(work, _F)
            X = scalar[POSITION] + _along(work, _X, u)
            force = _along(work, _F, u)
            if not _is_rigid(slider):
                force = slider.stiffness * (drive_at(case.drive, times[n])[0] - X)
            if holds(stop, X, force):
                dt = times[n] - scalar[TIME]
                _try_step(state, work, case, dt)
                event = 0.0
                break
            n += 1
        low = high = 0.0
        for k in range(1, P + 1):
            low, high = min(low, nodes[_X, k]), max(high, nodes[_X, k])
        s = 1.0 if nodes[_X, P] > 0.0 else -1.0
        broke = nodes[_BROKEN, P] > _EVENT * tol
        scalar[SLOPE] = nodes[_S, P]
        _commit(state, work, case, dt, low, high)
        e = state.used[EXTREMES]
        if event == 1.0:
            if case.table.knots.size > 0:
                state.used[GROUPS] = divide(state.groups, state.used[GROUPS], scalar[POSITION], case.table)
            if case.delays.arrest:
                _arrest(state)
            if broke:
                _mark_rough(state, scalar[TIME])
            if abs(scalar[VELOCITY]) * dt < 1e-4 * tol:
                scalar[VELOCITY] = 0.0
            if e == state.extremes.size:
                for i in range(e - 2):
                    state.extremes[i] = state.extremes[i + 2]
                e -= 2
            # what was passed without notice
            state.extremes[e] = scalar[POSITION]
            state.used[EXTREMES] = e + 1
        elif event == 2.0:
            _mark_rough(state, scalar[TIME])
            state.used[EXTREMES] = e - 2
        elif e >= 2:
            passed, turn = state.extremes[e - 2], state.extremes[e - 1]
            if (scalar[POSITION] - passed) * s > 0.0 and (passed - turn) * s > 0.0:
                state.used[EXTREMES] = e - 2
        if filled < times.size and times[filled] < scalar[TIME] - smallest:
            for row in range(_OLD):
                _curve(work, row)
        while filled < times.size and times[filled] < scalar[TIME] - smallest:
            _sample(rows[filled], times[filled], start, work, case, dt)
            lost = min(max(rows[filled, LOST], start[LOST]), scalar[LOST])
            rows[filled, LOST] = max(lost, rows[filled - 1, LOST]) if filled > 0 else lost
            filled += 1
    return PAUSED, filled, 0


@bare
def _forget(state: State, delays: Delays) -> bool:
    """Forget panels of which all has re-attached; whether there is room now."""
    n = state.used[PANELS]
    if n == state.panels.shape[0]:
        first = n - 1
        t = state.scalar[TIME]
        for i in range(delays.time.size):
            k = state.cursor[i]
            while k > 0 and state.panels[k, 0] > t - delays.time[i]:
                k -= 1
            first = min(first, k)
        if delays.share > 0.0:
            while first > 0 and state.panels[first, 0] + state.panels[first, 1] > t - delays.spread.top:
                first -= 1
        if first < n // 2:
            return False
        for k in range(first, n):
            for a in range(state.panels.shape[1]):
                state.panels[k - first, a] = state.panels[k, a]
        for i in range(state.cursor.size):
            state.cursor[i] = max(state.cursor[i] - first, 0)
        state.used[PANELS] = n - first
    return bool(state.used[GROUPS] + _SPARE <= state.groups.shape[1])


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
        Survival of the thresholds.
    delays : Delays
    stretching, weight : ndarray, shape (n, Q)
        Initial stretchings, any sign, at the nodes of Gauss of intervals, and the attached fraction of contacts at
        each. A contact at ``x_0`` has a threshold beyond ``|x_0|``. The rest of a sum of 1 is detached.
    position, velocity, time : float
        Of the slider, at the start.
    rate : float
        Mass that broke per unit time before the start; it re-attaches after its delay. For smooth sliding
        ``v / (<x_s> + v <tau_d>)``, with the attached fraction ``<x_s> / (<x_s> + v <tau_d>)``.

    Returns
    -------
    State
    """
    n, reach = len(stretching), np.abs(stretching)
    alive = np.maximum(values_at(table, reach.ravel()).reshape(reach.shape), 1e-12)
    groups = np.zeros((4, n + 128, Q))
    groups[BIRTH, :n], groups[MASS, :n], groups[REACH, :n] = position - stretching, weight / alive, reach
    groups[WHOLE, :n] = np.ptp(stretching, axis=1)[:, None] > 0.0
    attached = float(weight.sum())
    scalar = np.zeros(SCALARS)
    scalar[TIME], scalar[POSITION], scalar[VELOCITY] = time, position, velocity
    scalar[CONTACT_FORCE] = np.sum(weight * stretching)
    scalar[ATTACHED] = scalar[MASS_IN] = scalar[SLOPE] = attached
    scalar[MASS_OUT] = 1.0 - attached
    scalar[STORED] = 0.5 * np.sum(weight * stretching**2)
    scalar[NEXT_STEP] = math.inf
    # Before the start, at a constant rate.
    memory = max([1e-3, delays.spread.top if delays.share > 0.0 else 0.0, *delays.time])
    count = math.ceil(memory / delays.grain) if rate > 0.0 and delays.share > 0.0 else 1
    panels = np.zeros((count + 256, 3 + P + Q))
    step = memory / count
    panels[:count, 0] = time - memory + step * np.arange(count)
    panels[:count, 1] = step
    panels[:count, 2 : 3 + P] = rate * (panels[:count, :1] - time + step * NODE)
    panels[:count, 3 + P :] = rate * step * WEIGHT
    rough = np.full(64, time)
    zeros = np.zeros(delays.time.size, np.int64)
    used = np.array([n, count, 0, 1, 0, 0, 0], np.int64)
    return State(scalar, groups, panels, zeros, zeros.copy(), np.zeros(64), rough, used)


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
    case = _Case(table, delays, slider, drive, accuracy)
    filled, reason, steps = 0, NO_ROOM, max_steps
    before = np.zeros(SCALARS)
    while reason == NO_ROOM:
        room = state.groups.shape[1]
        reading = Reading(np.zeros((3, Q * room)), np.zeros(3), np.zeros(room + 1, np.int64))
        nodes, curves = np.zeros((2, _ROWS, P + 1))
        work = _Work(nodes, curves, np.zeros((P, P + 1)), np.zeros(_ROWS), reading)
        reason, more, steps = _run(state, work, case, stop, until, times[filled:], rows[filled:], before, steps)
        filled += more
        if reason == NO_ROOM:
            state = _with_room(state, table, accuracy.width)
    return Progress(state, rows[:filled], reason)


def _with_room(state: State, table: Table, width: float) -> State:
    """The same state with room for more groups, some joined, and for more panels."""
    used, room = state.used, state.groups.shape[1]
    if used[GROUPS] + _SPARE > room:
        kept = merged(state.groups, used[GROUPS], table, width)
        used[GROUPS] = kept.shape[1]
        groups = np.zeros((4, room if used[GROUPS] < room // 2 else 2 * room, Q))
        groups[:, : used[GROUPS]] = kept
        state = state._replace(groups=groups)
    if used[PANELS] == len(state.panels):
        state = state._replace(panels=np.concatenate([state.panels, np.zeros_like(state.panels)]))
    return state
