"""A finite number of contacts on panels: how many of each node break and re-attach in a step is drawn.

The contacts of a node of Gauss attached at one place. Which of them break while the slider stretches them further is
decided only when it does: of ``n`` that have held up to a stretching ``r``, a binomial number breaks on the way to
``r'``, each with the probability ``1 - J_c(r')/J_c(r)``. Where they attach, in a step, and how long they wait is
binomial, too. So the counts have the distribution of independent contacts, at a cost that depends on the number of
nodes only.

A step is solved for the mean of what may happen in it, given the counts at its start; its length follows from that
mean, so that no outcome is ever rejected. Then the counts are drawn. What more or less has broken than on average does
so at one random moment in the step, of which the slider feels the rest: force, velocity and position then have the
variances and correlations that they have if every break has a moment of its own.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .births import in_panel
from .drive import drive_at
from .groups import BIRTH, COUNT, GROUP_ROWS, MASS, REACH, WHOLE
from .oscillator import is_rigid, response
from .panel_state import (
    AT_ATTACHED,
    AT_BORN,
    AT_BROKEN,
    AT_FORCE,
    AT_LOST,
    AT_V,
    AT_X,
    ATTACHED,
    BORN,
    BROKEN,
    CONTACT_FORCE,
    DAMPED,
    DIRECTION,
    ELEMENT,
    GROUPS,
    LOST,
    MASS_IN,
    MASS_OUT,
    PANELS,
    POSITION,
    STORED,
    TIME,
    VELOCITY,
    WAITING,
    WORK,
    Case,
    Delays,
    State,
    Work,
)
from .panel_step import element_at
from .rules import GAUSS, INCREASE, MONOMIAL, NODE, PART, WEIGHT, P, Q
from .survival import Table, value_at, values_at

Array = NDArray[np.float64]

CHANCES = 9
MOMENT, SPEED, CHANGE, LOSS, FORCE, EXCESS, AWAY, ENERGY, FREQUENCY = range(CHANCES)
"""Of what breaks in a step beyond the mean: when; how fast the slider goes from there, how that changes, and the force
that breaks take per time on average; the force and the fraction of contacts that go, and of these the fraction that
does not re-attach at once; the energy; and the squared frequency of the slider."""

_GONE = 1e-13
"""Fraction of contacts so small that none of them is left."""
_COARSE = 0.02
"""Fraction of contacts, times the square of how far they are moved, in tolerances, that may be."""


@inlined
def _drawn(case: Case, count: float, held: float) -> float:
    """How many of a number break if each holds with a probability."""
    if held >= 1.0 or count == 0.0:
        return 0.0
    if held <= 0.0:
        return count
    return float(case.lot.rng.binomial(np.int64(count), 1.0 - held))


@bare
def _value(work: Work, row: int, u: float) -> float:
    """Value at ``0 <= u <= 1`` of the polynomial through a row of nodes."""
    total = 0.0
    for a in range(P, -1, -1):
        c = 0.0
        for b in range(P + 1):
            c += MONOMIAL[a, b] * work.nodes[row, b]
        total = total * u + c
    return total


@bare
def deviation(work: Work, case: Case, t: float, row: Array, force: float, velocity: float) -> None:
    """Add to a row of samples at a time what the deviation from the mean has done by then.

    `force` and `velocity` are those of the mean.
    """
    chance = work.chance
    h = t - chance[MOMENT]
    if h < 0.0 or (chance[FORCE] == 0.0 and chance[EXCESS] == 0.0):
        return
    D, L = chance[EXCESS], chance[ENERGY]
    way = chance[SPEED] * h
    x = 0.0
    slider = case.slider
    if not is_rigid(slider):
        K, M, eta = slider.stiffness, slider.mass, slider.damping
        _, r, r1, r2, r3 = response(h, eta, chance[FREQUENCY])
        a, b = chance[FORCE] / M, D * chance[SPEED] / M
        v, x, area = a * r + b * r1, a * r1 + b * r2, a * r2 + b * r3
        row[POSITION] += x
        row[VELOCITY] += v
        row[WORK] -= K * drive_at(case.drive, t - 0.5 * h)[1] * area
        squares = 2.0 * (velocity * x - chance[CHANGE] * area)
        if eta > 0.0:  # from the energy of the free oscillation, and what the forces do
            free = 0.5 * (v * v + chance[FREQUENCY] * x * x)
            squares += max(a * x + b * (h * x - area) - free, 0.0) / eta
        row[DAMPED] += M * eta * squares
        row[LOST] += chance[LOSS] * area
    row[LOST] += L
    stiffness = max(chance[FREQUENCY] * slider.mass - slider.stiffness, 0.0) if x != 0.0 else 0.0
    row[CONTACT_FORCE] += stiffness * x - chance[FORCE] - D * way
    far = way + x
    row[STORED] += force * x + 0.5 * (stiffness + D) * x * x - L - chance[FORCE] * far - 0.5 * D * far * far
    row[ATTACHED] -= chance[AWAY]


@bare
def deviate(row: Array, t: float, start: Array, end: Array, work: Work, case: Case) -> None:
    """Make a sample of the mean one of the run: with the deviation, and energy lost no sooner than it is."""
    part = work.nodes[AT_LOST, P]
    part = min(max((row[LOST] - start[LOST]) / part, 0.0), 1.0) if part != 0.0 else 0.0
    deviation(work, case, t, row, row[CONTACT_FORCE], row[VELOCITY])
    row[ATTACHED] = min(max(row[ATTACHED], 0.0), 1.0)
    total = row[STORED] + row[LOST]
    row[LOST] = min(start[LOST] + part * (end[LOST] - start[LOST]), total)
    row[STORED] = total - row[LOST]


@bare
def settle(state: State, work: Work, case: Case, dt: float, start: Array, way: float) -> None:
    """Draw what breaks and re-attaches in a step that has been solved, and taken, for the mean.

    The groups are still those of its start, of which `start` holds the scalars; the slider moved the way `way`.
    """
    groups, scalar, nodes, chance, N = state.groups, state.scalar, work.nodes, work.chance, case.lot.contacts
    table, origin = case.table, start[POSITION]
    low = high = 0.0
    for i in range(1, P + 1):
        low, high = min(low, nodes[AT_X, i]), max(high, nodes[AT_X, i])
    u = case.lot.rng.random()
    place = _value(work, AT_X, u)
    e = element_at(state, case, place) if case.sliding_force > 0.0 else 0.0
    total = excess = force = energy = 0.0
    for g in range(state.used[GROUPS]):
        for j in range(Q):
            n = groups[COUNT, g, j]
            if n == 0.0:
                continue
            b, r = groups[BIRTH, g, j], groups[REACH, g, j]
            reach = max(r, origin + high - b, b - origin - low)
            if reach > r and reach > table.bottom:
                held = min(max(N * groups[MASS, g, j] * value_at(table, reach) / n, 0.0), 1.0)
                k = _drawn(case, n, held)
                more = k - n * (1.0 - held)
                x = origin + place - b
                excess += more
                force += more * (x - e)
                energy += 0.5 * more * (x * x - e * e)
                groups[COUNT, g, j] = n - k
                total += k
            groups[REACH, g, j] = reach
    h = max((1.0 - u) * dt, 1e-300)
    chance[MOMENT], chance[FORCE] = start[TIME] + u * dt, force / N
    chance[EXCESS], chance[ENERGY] = excess / N, energy / N
    away = 1.0
    for i in range(case.delays.time.size):
        if case.delays.time[i] == 0.0:
            away -= case.delays.weight[i]
    chance[AWAY] = away * chance[EXCESS]
    chance[SPEED], chance[CHANGE] = (nodes[AT_X, P] - place) / h, (nodes[AT_V, P] - _value(work, AT_V, u)) / h
    slope = (nodes[AT_FORCE, P] - _value(work, AT_FORCE, u)) / h
    chance[LOSS] = nodes[AT_ATTACHED, P] * chance[SPEED] - slope
    if not is_rigid(case.slider):
        held = max(nodes[AT_ATTACHED, P] - chance[EXCESS], 0.0)
        chance[FREQUENCY] = (case.slider.stiffness + held) / case.slider.mass
    deviation(work, case, scalar[TIME], scalar, nodes[AT_FORCE, P], nodes[AT_V, P])
    if case.sliding_force > 0.0:
        scalar[ELEMENT] = element_at(state, case, scalar[POSITION] - origin)
    total += _go_on(state, case)
    scalar[BROKEN] = start[BROKEN]
    _keep(state, work, case, start, dt, total)
    born = _arrivals(state, case, start[TIME], scalar[TIME])
    scalar[BORN] = start[BORN] + born / N
    if born > 0.0:
        _keep(state, work, case, start, dt, _attach(state, work, case, origin, way, born))
    count_up(state, case)


@bare
def _go_on(state: State, case: Case) -> float:
    """Break what does not hold where the slider has come to lie, and leave out empty nodes; how many broke."""
    groups, table, X = state.groups, case.table, state.scalar[POSITION]
    total = 0.0
    kept = 0
    for g in range(state.used[GROUPS]):
        for j in range(Q):
            n, b, r = groups[COUNT, g, j], groups[BIRTH, g, j], groups[REACH, g, j]
            groups[COUNT, g, j] = groups[MASS, g, j] = 0.0
            if n == 0.0:
                continue
            x, J = abs(X - b), value_at(table, r)
            if x > r:
                before, J, r = J, value_at(table, x), x
                k = _drawn(case, n, J / before if before > _GONE else 0.0)
                total += k
                n -= k
            kept += _put(groups, kept, case, n, b, r)
    state.used[GROUPS] = (kept + Q - 1) // Q
    return total


@inlined
def _put(groups: Array, place: int, case: Case, n: float, b: float, r: float) -> int:
    """Put contacts that attached at `b`, and hold up to `r`, into a place among the nodes; whether there are any."""
    if n == 0.0:
        return 0
    g, j = place // Q, place % Q
    J = value_at(case.table, r)
    groups[BIRTH, g, j], groups[REACH, g, j], groups[WHOLE, g, j], groups[COUNT, g, j] = b, r, 0.0, n
    groups[MASS, g, j] = n / (case.lot.contacts * J) if J > _GONE else 0.0
    return 1


@inlined
def _joins(groups: Array, place: int, case: Case, n: float, b: float, r: float, X: float) -> bool:
    """Let contacts join those at a place among the nodes if that is as good as where they attached."""
    g, j = place // Q, place % Q
    if place < 0 or n == 0.0 or max(r, groups[REACH, g, j]) > case.table.bottom:
        return False
    total, way = n + groups[COUNT, g, j], b - groups[BIRTH, g, j]
    error = total / case.lot.contacts * way * way
    if abs(way) > case.lot.grain or error > _COARSE * case.accuracy.tolerance:
        return False
    b = groups[BIRTH, g, j] + way * n / total
    _put(groups, place, case, total, b, max(r, groups[REACH, g, j], abs(X - b)))
    return True


@bare
def _keep(state: State, work: Work, case: Case, start: Array, dt: float, more: float) -> None:
    """Let what has broken in a step, or more of it, wait for its re-attachment."""
    panels, nodes, delays, scalar = state.panels, work.nodes, case.delays, state.scalar
    scalar[BROKEN] += more / case.lot.contacts
    if more == 0.0 or delays.time.size + delays.fraction == 0.0:
        return
    n = state.used[PANELS]
    if n > 0 and panels[n - 1, 0] == start[TIME]:
        n -= 1
    else:
        state.used[PANELS] = n + 1
        panels[n, 0], panels[n, 1] = start[TIME], dt
        for i in range(WAITING, panels.shape[1]):
            panels[n, i] = 0.0
    for k in range(P + 1):
        part = nodes[AT_BROKEN, k] / nodes[AT_BROKEN, P] if nodes[AT_BROKEN, P] > 1e-15 else NODE[k]
        panels[n, 2 + k] = start[BROKEN] + min(max(part, 0.0), 1.0) * (scalar[BROKEN] - start[BROKEN])
    _wait(panels[n], case, more)


@bare
def _wait(panel: Array, case: Case, more: float) -> None:
    """Divide what broke in a panel between the delays, and what has a delay from a distribution between its nodes."""
    delays = case.delays
    left, rest = more, 1.0
    for i in range(delays.time.size):
        k = _drawn(case, left, 1.0 - delays.weight[i] / rest)
        panel[WAITING + i] += k
        left -= k
        rest = max(rest - delays.weight[i], 1e-300)
    if delays.fraction == 0.0:
        return
    k = _drawn(case, left, 1.0 - delays.fraction / rest)
    left, rest = k, 1.0
    full = panel[2 + P] - panel[2]
    for j in range(Q):
        part = 0.0
        for a in range(P + 1):
            part += INCREASE[P - 1, j, a] * (panel[2 + a] - panel[2])
        part = max(part / full, 0.0)
        k = left if j == Q - 1 else _drawn(case, left, 1.0 - part / rest)
        panel[WAITING + delays.time.size + j] += k
        left -= k
        rest = max(rest - part, 1e-300)


@bare
def _arrivals(state: State, case: Case, before: float, now: float) -> float:
    """Draw how many re-attach between two times; they wait no longer."""
    panels, delays, N = state.panels, case.delays, case.lot.contacts
    total = 0.0
    longest = delays.continuous.top if delays.fraction > 0.0 else 0.0
    for i in range(delays.time.size):
        longest = max(longest, delays.time[i])
    for p in range(state.used[PANELS] - 1, -1, -1):
        start, length = panels[p, 0], panels[p, 1]
        if start + length < before - longest:
            break
        full = panels[p, 2 + P] - panels[p, 2]
        for i in range(delays.time.size):
            n, until = panels[p, WAITING + i], now - delays.time[i]
            if n == 0.0 or until <= start:
                continue
            held = 0.0
            if until < start + length:
                gone = (in_panel(panels, p, before - delays.time[i]) - panels[p, 2]) / full
                held = (1.0 - (in_panel(panels, p, until) - panels[p, 2]) / full) / max(1.0 - gone, 1e-14)
            k = _drawn(case, n, held)
            panels[p, WAITING + i] = n - k
            total += k
        if delays.fraction == 0.0:
            continue
        for j in range(Q):
            i = WAITING + delays.time.size + j
            n, panels[p, 3 + P + j] = panels[p, i], 0.0
            if n == 0.0:
                continue
            age = now - start - GAUSS[j] * length
            left = value_at(delays.continuous, max(age, 0.0))
            first = value_at(delays.continuous, max(age - (now - before), 0.0))
            k = _drawn(case, n, left / first if first > _GONE else 0.0)
            total += k
            panels[p, i] = n - k
            if left > _GONE:
                panels[p, 3 + P + j] = (n - k) / (N * delays.fraction * left)
    return total


@bare
def _attach(state: State, work: Work, case: Case, origin: float, way: float, born: float) -> float:
    """Put what re-attaches in a step where the slider is on the way; how many have broken again by its end."""
    groups, nodes, newborn = state.groups, work.nodes, case.newborn
    X, place = state.scalar[POSITION], Q * state.used[GROUPS]
    broken = 0.0
    left, rest = born, 1.0
    for j in range(Q):
        part = b = 0.0
        for a in range(1, P + 1):
            part += INCREASE[P - 1, j, a] * nodes[AT_BORN, a]
            b += PART[P - 1, j, a] * nodes[AT_X, a]
        part = max(part / nodes[AT_BORN, P], 0.0) if nodes[AT_BORN, P] > 1e-15 else WEIGHT[j]
        here = left if j == Q - 1 else _drawn(case, left, 1.0 - part / rest)
        left -= here
        rest = max(rest - part, 1e-300)
        more, other = here, 1.0
        for i in range(newborn.stretching.size):
            n = more if i == newborn.stretching.size - 1 else _drawn(case, more, 1.0 - newborn.fraction[i] / other)
            more -= n
            other = max(other - newborn.fraction[i], 1e-300)
            at, r = origin + b - way * newborn.stretching[i], abs(newborn.stretching[i])
            x = abs(X - at)
            if x > r:
                k = _drawn(case, n, value_at(case.table, x) / value_at(case.table, r))
                broken += k
                n -= k
                r = x
            if not _joins(groups, place - 1, case, n, at, r, X):
                place += _put(groups, place, case, n, at, r)
    _fill_up(state, place)
    return broken


@bare
def _fill_up(state: State, place: int) -> None:
    """Let the groups end after some places; the rest of the last is empty."""
    state.used[GROUPS] = (place + Q - 1) // Q
    for i in range(place, Q * state.used[GROUPS]):
        for row in range(GROUP_ROWS):
            state.groups[row, i // Q, i % Q] = 0.0


@bare
def attach_all(state: State, case: Case) -> None:
    """Let all that is detached re-attach where the slider is, stretched the way it has moved last."""
    scalar, newborn, N = state.scalar, case.newborn, case.lot.contacts
    more, other, place = N * scalar[MASS_OUT] + 0.5, 1.0, Q * state.used[GROUPS]
    more = math.floor(more)
    for i in range(newborn.stretching.size):
        x = scalar[DIRECTION] * newborn.stretching[i]
        n = more if i == newborn.stretching.size - 1 else _drawn(case, more, 1.0 - newborn.fraction[i] / other)
        more -= n
        other = max(other - newborn.fraction[i], 1e-300)
        place += _put(state.groups, place, case, n, scalar[POSITION] - x, abs(x))
    _fill_up(state, place)
    count_up(state, case)


@bare
def count_up(state: State, case: Case) -> None:
    """Take force, attached fraction and energy from the counts; energy that is no longer stored is lost."""
    groups, scalar, N = state.groups, state.scalar, case.lot.contacts
    A = F = E = 0.0
    for g in range(state.used[GROUPS]):
        for j in range(Q):
            n, x = groups[COUNT, g, j], scalar[POSITION] - groups[BIRTH, g, j]
            A += n
            F += n * x
            E += n * x * x
    e = scalar[ELEMENT]
    stored = 0.5 * (E + (N - A) * e * e) / N
    scalar[CONTACT_FORCE] = (F + (N - A) * e) / N
    scalar[ATTACHED] = scalar[MASS_IN] = A / N
    scalar[MASS_OUT] = (N - A) / N
    scalar[LOST] += scalar[STORED] - stored
    scalar[STORED] = stored


def counted(state: State, table: Table, delays: Delays, count: int, rng: np.random.Generator) -> State:
    """Return a state as `initial_state` makes it with a number of contacts in place of fractions of infinitely many."""
    used, groups, panels, scalar = state.used, state.groups.copy(), state.panels.copy(), state.scalar.copy()
    n, N = used[GROUPS], float(count)
    reach = groups[REACH, :n]
    alive = values_at(table, reach.ravel()).reshape(reach.shape)
    weight = groups[MASS, :n] * np.maximum(alive, 1e-12)
    attached = round(count * float(weight.sum()))
    held = rng.multinomial(attached, (weight / weight.sum()).ravel()).reshape(weight.shape)
    groups[COUNT, :n], groups[MASS, :n], groups[WHOLE, :n] = held, held / (N * np.maximum(alive, 1e-12)), 0.0
    if attached < count:
        past, t = panels[: used[PANELS]], scalar[TIME]
        end = past[:, :1] + past[:, 1:2] + delays.time - t
        parts = np.zeros((len(past), delays.time.size + Q))
        parts[:, : delays.time.size] = delays.weight * np.clip(end, 0.0, past[:, 1:2])
        if delays.fraction > 0.0:
            age = t - past[:, :1] - GAUSS * past[:, 1:2]
            left = values_at(delays.continuous, age.ravel()).reshape(age.shape)
            parts[:, delays.time.size :] = delays.fraction * past[:, 1:2] * WEIGHT * left
        past[:, WAITING:] = rng.multinomial(count - attached, (parts / parts.sum()).ravel()).reshape(parts.shape)
        if delays.fraction > 0.0:
            waiting = past[:, WAITING + delays.time.size :]
            parted = N * delays.fraction * np.maximum(left, _GONE)
            past[:, 3 + P : WAITING] = np.where(left > _GONE, waiting / parted, 0)
    x = scalar[POSITION] - groups[BIRTH, :n]
    e = scalar[ELEMENT]
    scalar[ATTACHED] = scalar[MASS_IN] = attached / N
    scalar[MASS_OUT] = (count - attached) / N
    scalar[CONTACT_FORCE] = (float(np.sum(held * x)) + (count - attached) * e) / N
    scalar[STORED] = 0.5 * (float(np.sum(held * x * x)) + (count - attached) * e * e) / N
    return state._replace(groups=groups, panels=panels, scalar=scalar)


def joined(groups: Array, used: int, case: Case) -> Array:
    """Join nodes that lie close to each other and reach nearly as far; none of the contacts is lost."""
    birth, reach, count = (groups[row, :used].ravel() for row in (BIRTH, REACH, COUNT))
    cell = np.round(np.stack([birth, reach])[:, count > 0] / (0.3 * case.lot.grain))
    birth, reach, count = birth[count > 0], reach[count > 0], count[count > 0]
    kinds, which = np.unique(cell, axis=1, return_inverse=True)
    total = np.bincount(which.ravel(), count, kinds.shape[1])
    b, r = (np.bincount(which.ravel(), count * value, kinds.shape[1]) / total for value in (birth, reach))
    made = np.zeros((GROUP_ROWS, -(-total.size // Q) * Q))
    alive = values_at(case.table, r)
    made[BIRTH, : b.size], made[REACH, : b.size], made[COUNT, : b.size] = b, r, np.round(total)
    made[MASS, : b.size] = np.where(alive > _GONE, total / (case.lot.contacts * np.maximum(alive, _GONE)), 0.0)
    return made.reshape(GROUP_ROWS, -1, Q)
