"""A finite number of contacts on panels: how many contacts of each node break and
re-attach in a step is drawn.

The contacts of a Gauss node attached at one place. Of ``n`` contacts that have held up
to a stretching ``r`` a binomial number breaks on the way to ``r'``, each with the
probability ``1 - J_c(r')/J_c(r)``. Where contacts attach in a step, and how long they
wait, are binomial draws too. So the counts have the distribution of independent
contacts, at a cost that depends on the number of nodes only.

A step is solved for the mean of the possible outcomes, given the counts at its start;
its length follows from that mean, so that no outcome is ever rejected. Then the counts
are drawn. The deviation of the number of breaks from its mean is assigned to one random
moment in the step, and the slider responds to it for the rest of the step: force,
velocity and position then have the variances and correlations that they have if every
break has a moment of its own.
"""

import copy
import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .cohorts import COHORT_NODE
from .drive import drive_at
from .effective_stretching import (
    NEVER,
    Breaking,
    carried,
    reach_at,
    survival,
    survivals,
)
from .oscillator import is_rigid, response
from .panel_state import WAITING, Case, Delays, FiniteNumber, PanelsState, Work
from .panel_step import element_at
from .quadrature import GAUSS, INCREASE, NODE, PART, WEIGHT, P, Q, dot, value
from .reattachment import in_panel
from .records import Floats, Record, blank
from .survival import GONE, drawn, value_at, values_at


class CountedLife(NamedTuple):
    """Where contacts attached and when, their clock and their reach."""

    b: float
    clock: float
    reach: float
    since: float


_COARSE = 0.02  # largest error of merging two cohorts, in units of the tolerance


@bare
def deviation(
    work: Work,
    case: Case,
    t: float,
    row: Record,
    force: float,
    velocity: float,
) -> None:
    """Add to a row of mean values the deviation that has grown by a time, given the
    mean force and velocity.
    """
    extra = work.fluctuation
    h = t - extra.time
    if h < 0.0 or (extra.force == 0.0 and extra.fraction == 0.0):
        return
    D = extra.fraction
    L = extra.energy
    distance = extra.velocity * h
    x = 0.0
    slider = case.slider
    if not is_rigid(slider):
        K = slider.stiffness
        M = slider.mass
        eta = slider.damping
        _, r, r1, r2, r3 = response(h, eta, extra.frequency2)
        a = extra.force / M
        b = D * extra.velocity / M
        v = a * r + b * r1
        x = a * r1 + b * r2
        area = a * r2 + b * r3
        row.position += x
        row.velocity += v
        row.work -= K * drive_at(case.drive, t - 0.5 * h)[1] * area
        squares = 2.0 * (velocity * x - extra.acceleration * area)
        if eta > 0.0:  # energy lost by the free oscillation, and work of the forces
            free = 0.5 * (v * v + extra.frequency2 * x * x)
            squares += max(a * x + b * (h * x - area) - free, 0.0) / eta
        row.damped += M * eta * squares
        row.lost += extra.loss_rate * area
    row.lost += L
    stiffness = (
        max(extra.frequency2 * slider.mass - slider.stiffness, 0.0) if x != 0.0 else 0.0
    )
    row.contact_force += stiffness * x - extra.force - D * distance
    far = distance + x
    row.stored += (
        force * x
        + 0.5 * (stiffness + D) * x * x
        - L
        - extra.force * far
        - 0.5 * D * far * far
    )
    row.attached -= extra.detached


@bare
def deviate(
    row: Record,
    t: float,
    end: Record,
    work: Work,
    case: Case,
) -> None:
    """Add the deviation from the mean to a sample, without counting energy as lost
    before it is.
    """
    part = work.nodes[P].lost
    start = work.before[0]
    part = min(max((row.lost - start.lost) / part, 0.0), 1.0) if part != 0.0 else 0.0
    deviation(work, case, t, row, row.contact_force, row.velocity)
    row.attached = min(max(row.attached, 0.0), 1.0)
    total = row.stored + row.lost
    row.lost = min(start.lost + part * (end.lost - start.lost), total)
    row.stored = total - row.lost


class _Broken(NamedTuple):
    """Contacts that broke in a step: their number, and the excess of number, force and
    energy over the mean.
    """

    total: float
    excess: float
    force: float
    energy: float


@bare
def _draw_breaks(
    state: PanelsState,
    work: Work,
    case: Case,
    finite: FiniteNumber,
    place: float,
) -> _Broken:
    """Draw how many contacts of each node break in a step; the excess over the mean
    breaks with the slider at a `place`.
    """
    cohorts = state.cohorts
    N = finite.contacts
    breaking = case.breaking
    start = work.before[0]
    origin = start.position
    e = element_at(state, case, place) if case.sliding_force > 0.0 else 0.0
    total = excess = force = energy = 0.0
    for g in range(state.used.cohorts):
        for j in range(Q):
            node = cohorts[g, j]
            n = node.count
            if n == 0.0:
                continue
            b = node.place
            age = start.time - node.since
            clock, most = carried(
                work.reading.way,
                breaking,
                b - origin,
                node.clock,
                node.reach,
                age,
                0.0,
                work.nodes.size - 2,
            )
            is_tried = most > node.reach and most > breaking.thresholds.bottom
            if is_tried or breaking.width > 0.0:
                left = N * node.mass * survival(breaking, clock, most)[0]
                held = min(max(left / n, 0.0), 1.0)
                k = drawn(finite.rng, n, held)
                more = k - n * (1.0 - held)
                x = origin + place - b
                excess += more
                force += more * (x - e)
                energy += 0.5 * more * (x * x - e * e)
                node.count = n - k
                total += k
            node.reach = most
            node.clock = clock
    return _Broken(total, excess, force, energy)


@bare
def _fluctuate(
    work: Work,
    case: Case,
    N: float,
    broken: _Broken,
    u: float,
    place: float,
    dt: float,
) -> None:
    """Record the deviation from the mean that an excess of broken contacts causes after
    the fraction `u` of a step.
    """
    nodes = work.nodes
    extra = work.fluctuation
    h = max((1.0 - u) * dt, 1e-300)
    extra.time = work.before[0].time + u * dt
    extra.force = broken.force / N
    extra.fraction = broken.excess / N
    extra.energy = broken.energy / N
    away = 1.0
    for i in range(case.delays.time.size):
        if case.delays.time[i] == 0.0:
            away -= case.delays.weight[i]
    extra.detached = away * extra.fraction
    extra.velocity = (nodes[P].x - place) / h
    extra.acceleration = (nodes[P].v - value(nodes.v, work.curves.v, u)) / h
    slope = (nodes[P].force - value(nodes.force, work.curves.force, u)) / h
    extra.loss_rate = nodes[P].attached * extra.velocity - slope
    if not is_rigid(case.slider):
        held = max(nodes[P].attached - extra.fraction, 0.0)
        extra.frequency2 = (case.slider.stiffness + held) / case.slider.mass


@bare
def settle(
    state: PanelsState,
    work: Work,
    case: Case,
    finite: FiniteNumber,
    dt: float,
    direction: float,
) -> None:
    """Draw the breaks and re-attachments of a step that was solved and accepted for the
    mean.

    The cohorts are still those of its start.
    """
    motion = state.motion
    nodes = work.nodes
    N = finite.contacts
    start = work.before[0]
    u = finite.rng.random()
    place = value(nodes.x, work.curves.x, u)
    broken = _draw_breaks(state, work, case, finite, place)
    _fluctuate(work, case, N, broken, u, place, dt)
    deviation(
        work,
        case,
        motion.time,
        motion,
        nodes[P].force,
        nodes[P].v,
    )
    if case.sliding_force > 0.0:
        motion.element = element_at(state, case, motion.position - start.position)
    total = broken.total + _go_on(state, case, finite)
    motion.broken = start.broken
    _keep(state, work, case, finite, dt, total)
    reattached = _arrivals(state, case, finite, start.time, motion.time)
    motion.reattached = start.reattached + reattached / N
    if reattached > 0.0:
        again = _attach(state, work, case, finite, direction, reattached, dt)
        _keep(state, work, case, finite, dt, again)
    count_up(state, N)


@bare
def _go_on(state: PanelsState, case: Case, finite: FiniteNumber) -> float:
    """Break contacts that do not hold at the new position of the slider, and remove
    empty nodes; return how many broke.
    """
    cohorts = state.cohorts
    breaking = case.breaking
    X = state.motion.position
    total = 0.0
    kept = 0
    for g in range(state.used.cohorts):
        for j in range(Q):
            node = cohorts[g, j]
            n = node.count
            b = node.place
            r = node.reach
            u = node.clock
            since = node.since
            node.count = node.mass = 0.0
            if n == 0.0:
                continue
            x = reach_at(breaking.growth, abs(X - b), state.motion.time - since)
            if x > r:
                k = drawn(finite.rng, n, _held(case, u, r, u, x))
                r = x
                total += k
                n -= k
            kept += _put(
                cohorts,
                kept,
                case,
                finite,
                n,
                CountedLife(b, u, r, since),
            )
    state.used.cohorts = (kept + Q - 1) // Q
    return total


@bare
def _held(
    case: Case,
    u: float,
    r: float,
    clock: float,
    most: float,
) -> float:
    """Return which fraction of the contacts that survived to clock `u` and reach `r`
    survives up to a new clock and reach.
    """
    before = survival(case.breaking, u, r)[0]
    return survival(case.breaking, clock, most)[0] / before if before > GONE else 0.0


@inlined
def _put(
    cohorts: Record,
    place: int,
    case: Case,
    finite: FiniteNumber,
    n: float,
    life: CountedLife,
) -> int:
    """Store contacts at a place among the nodes; return 1, or 0 if there are none."""
    if n == 0.0:
        return 0
    J = survival(case.breaking, life.clock, life.reach)[0]
    node = cohorts[place // Q, place % Q]
    node.place = life.b
    node.reach = life.reach
    node.whole = 0.0
    node.count = n
    node.mass = n / (finite.contacts * J) if J > GONE else 0.0
    node.clock = life.clock
    node.since = life.since
    return 1


@inlined
def _joins(
    cohorts: Record,
    place: int,
    case: Case,
    finite: FiniteNumber,
    n: float,
    life: CountedLife,
    X: float,
) -> bool:
    """Add contacts to those at a place among the nodes if both may count as attached at
    one place; return whether they were added.
    """
    if place < 0 or n == 0.0:
        return False
    node = cohorts[place // Q, place % Q]
    u = max(life.clock, node.clock)
    r = max(life.reach, node.reach)
    if r > case.breaking.thresholds.bottom or (
        case.breaking.width > 0.0 and u > case.breaking.blurred.bottom
    ):
        return False
    total = n + node.count
    offset = life.b - node.place
    error = total / finite.contacts * offset * offset
    if abs(offset) > finite.grain or error > _COARSE * case.accuracy.tolerance:
        return False
    part = n / total
    since = node.since + part * (life.since - node.since)
    b = node.place + offset * part
    r = max(r, abs(X - b)) if case.breaking.growth.first == 0.0 else r
    _put(
        cohorts,
        place,
        case,
        finite,
        total,
        CountedLife(b, u, r, since),
    )
    return True


@bare
def _keep(
    state: PanelsState,
    work: Work,
    case: Case,
    finite: FiniteNumber,
    dt: float,
    more: float,
) -> None:
    """Enter the contacts that broke in a step into its panel, where they wait to
    re-attach.
    """
    panels = state.panels
    nodes = work.nodes
    delays = case.delays
    motion = state.motion
    start = work.before[0]
    motion.broken += more / finite.contacts
    if more == 0.0 or delays.time.size + delays.fraction == 0.0:
        return
    n = state.used.panels
    if n > 0 and panels[n - 1, 0] == start.time:
        n -= 1
    else:
        state.used.panels = n + 1
        panels[n, 0] = start.time
        panels[n, 1] = dt
        for i in range(WAITING, panels.shape[1]):
            panels[n, i] = 0.0
    for k in range(P + 1):
        part = nodes[k].broken / nodes[P].broken if nodes[P].broken > 1e-15 else NODE[k]
        panels[n, 2 + k] = start.broken + min(max(part, 0.0), 1.0) * (
            motion.broken - start.broken
        )
    _wait(panels[n], delays, finite, more)


@bare
def _wait(
    panel: Floats,
    delays: Delays,
    finite: FiniteNumber,
    more: float,
) -> None:
    """Divide the contacts that broke in a panel among the fixed delays and, for the
    distributed delays, among the panel's Gauss nodes.
    """
    left = more
    rest = 1.0
    for i in range(delays.time.size):
        k = drawn(finite.rng, left, 1.0 - delays.weight[i] / rest)
        panel[WAITING + i] += k
        left -= k
        rest = max(rest - delays.weight[i], 1e-300)
    if delays.fraction == 0.0:
        return
    k = drawn(finite.rng, left, 1.0 - delays.fraction / rest)
    left = k
    rest = 1.0
    full = panel[2 + P] - panel[2]
    for j in range(Q):
        part = 0.0
        for a in range(P + 1):
            part += INCREASE[P - 1, j, a] * (panel[2 + a] - panel[2])
        part = max(part / full, 0.0)
        k = left if j == Q - 1 else drawn(finite.rng, left, 1.0 - part / rest)
        panel[WAITING + delays.time.size + j] += k
        left -= k
        rest = max(rest - part, 1e-300)


@bare
def _arrivals(
    state: PanelsState,
    case: Case,
    finite: FiniteNumber,
    before: float,
    now: float,
) -> float:
    """Draw how many contacts re-attach between two times, and remove them from those
    that wait.
    """
    panels = state.panels
    delays = case.delays
    N = finite.contacts
    total = 0.0
    longest = delays.continuous.top if delays.fraction > 0.0 else 0.0
    for i in range(delays.time.size):
        longest = max(longest, delays.time[i])
    for p in range(state.used.panels - 1, -1, -1):
        start = panels[p, 0]
        length = panels[p, 1]
        if start + length < before - longest:
            break
        full = panels[p, 2 + P] - panels[p, 2]
        for i in range(delays.time.size):
            n = panels[p, WAITING + i]
            until = now - delays.time[i]
            if n == 0.0 or until <= start:
                continue
            held = 0.0
            if until < start + length:
                gone = (
                    in_panel(panels, p, before - delays.time[i]) - panels[p, 2]
                ) / full
                held = (1.0 - (in_panel(panels, p, until) - panels[p, 2]) / full) / max(
                    1.0 - gone, 1e-14
                )
            k = drawn(finite.rng, n, held)
            panels[p, WAITING + i] = n - k
            total += k
        if delays.fraction == 0.0:
            continue
        for j in range(Q):
            i = WAITING + delays.time.size + j
            n = panels[p, i]
            panels[p, 3 + P + j] = 0.0
            if n == 0.0:
                continue
            age = now - start - GAUSS[j] * length
            left = value_at(delays.continuous, max(age, 0.0))
            first = value_at(delays.continuous, max(age - (now - before), 0.0))
            k = drawn(finite.rng, n, left / first if first > GONE else 0.0)
            total += k
            panels[p, i] = n - k
            if left > GONE:
                panels[p, 3 + P + j] = (n - k) / (N * delays.fraction * left)
    return total


@bare
def _attach(
    state: PanelsState,
    work: Work,
    case: Case,
    finite: FiniteNumber,
    direction: float,
    reattached: float,
    dt: float,
) -> float:
    """Enter the contacts that re-attach in a step at places of the slider along its
    path; return how many have broken again by its end.
    """
    cohorts = state.cohorts
    nodes = work.nodes
    newborn = case.newborn
    X = state.motion.position
    place = Q * state.used.cohorts
    broken = 0.0
    origin = work.before[0].position
    left = reattached
    rest = 1.0
    for j in range(Q):
        part = dot(INCREASE[P - 1, j], nodes.reattached)
        b = dot(PART[P - 1, j], nodes.x)
        part = (
            max(part / nodes[P].reattached, 0.0)
            if nodes[P].reattached > 1e-15
            else WEIGHT[j]
        )
        here = left if j == Q - 1 else drawn(finite.rng, left, 1.0 - part / rest)
        left -= here
        rest = max(rest - part, 1e-300)
        more = here
        other = 1.0
        for i in range(newborn.stretching.size):
            n = (
                more
                if i == newborn.stretching.size - 1
                else drawn(finite.rng, more, 1.0 - newborn.fraction[i] / other)
            )
            more -= n
            other = max(other - newborn.fraction[i], 1e-300)
            at = b - direction * newborn.stretching[i]
            x0 = newborn.tried * abs(newborn.stretching[i])
            u, r = carried(
                work.reading.way,
                case.breaking,
                at,
                NEVER,
                x0,
                0.0,
                GAUSS[j],
                nodes.size - 2,
            )
            if r > x0 or u > NEVER:
                k = drawn(finite.rng, n, _held(case, NEVER, x0, u, r))
                broken += k
                n -= k
            life = CountedLife(
                origin + at,
                u,
                r,
                state.motion.time - (1.0 - GAUSS[j]) * dt,
            )
            if not _joins(cohorts, place - 1, case, finite, n, life, X):
                place += _put(cohorts, place, case, finite, n, life)
    _fill_up(state, place)
    return broken


@bare
def _fill_up(state: PanelsState, place: int) -> None:
    """Set the number of cohorts for a number of places, and empty the rest of the
    last.
    """
    state.used.cohorts = (place + Q - 1) // Q
    for i in range(place, Q * state.used.cohorts):
        node = state.cohorts[i // Q, i % Q]
        node.place = node.reach = node.clock = node.since = 0.0
        node.whole = node.mass = node.count = 0.0


@bare
def attach_all(state: PanelsState, case: Case, finite: FiniteNumber) -> None:
    """Re-attach all detached contacts where the slider is, stretched along its last
    motion.
    """
    motion = state.motion
    newborn = case.newborn
    N = finite.contacts
    more = N * motion.mass_out + 0.5
    other = 1.0
    place = Q * state.used.cohorts
    more = math.floor(more)
    for i in range(newborn.stretching.size):
        x = motion.direction * newborn.stretching[i]
        n = (
            more
            if i == newborn.stretching.size - 1
            else drawn(finite.rng, more, 1.0 - newborn.fraction[i] / other)
        )
        more -= n
        other = max(other - newborn.fraction[i], 1e-300)
        life = CountedLife(
            motion.position - x,
            NEVER,
            newborn.tried * abs(x),
            motion.time,
        )
        place += _put(state.cohorts, place, case, finite, n, life)
    _fill_up(state, place)
    count_up(state, N)


@bare
def count_up(state: PanelsState, N: float) -> None:
    """Sum force, attached fraction and energy from the counts; count energy that is no
    longer stored as lost.
    """
    cohorts = state.cohorts
    motion = state.motion
    A = F = E = 0.0
    for g in range(state.used.cohorts):
        for j in range(Q):
            n = cohorts[g, j].count
            x = motion.position - cohorts[g, j].place
            A += n
            F += n * x
            E += n * x * x
    e = motion.element
    stored = 0.5 * (E + (N - A) * e * e) / N
    motion.contact_force = (F + (N - A) * e) / N
    motion.attached = motion.mass_in = A / N
    motion.mass_out = (N - A) / N
    motion.lost += motion.stored - stored
    motion.stored = stored


def counted(state: PanelsState, case: Case, finite: FiniteNumber) -> PanelsState:
    """Return a state made by `initial_state` with a finite number of contacts in place
    of fractions of infinitely many.
    """
    delays = case.delays
    rng = finite.rng
    N = finite.contacts
    count = round(N)
    state = copy.deepcopy(state)
    used = state.used
    panels = state.panels
    n = used.cohorts
    cohorts = state.cohorts[:n]
    alive = survivals(case.breaking, cohorts.clock, cohorts.reach)
    weight = cohorts.mass * np.maximum(alive, 1e-12)
    attached = round(count * float(weight.sum()))
    held = rng.multinomial(attached, (weight / weight.sum()).ravel()).reshape(
        weight.shape
    )
    cohorts.count = held
    cohorts.mass = held / (N * np.maximum(alive, 1e-12))
    cohorts.whole = 0.0
    if attached < count:
        past = panels[: used.panels]
        t = state.motion.time
        end = past[:, :1] + past[:, 1:2] + delays.time - t
        parts = np.zeros((len(past), delays.time.size + Q))
        parts[:, : delays.time.size] = delays.weight * np.clip(end, 0.0, past[:, 1:2])
        if delays.fraction > 0.0:
            age = t - past[:, :1] - GAUSS * past[:, 1:2]
            left = values_at(delays.continuous, age.ravel()).reshape(age.shape)
            parts[:, delays.time.size :] = (
                delays.fraction * past[:, 1:2] * WEIGHT * left
            )
        past[:, WAITING:] = rng.multinomial(
            count - attached, (parts / parts.sum()).ravel()
        ).reshape(parts.shape)
        if delays.fraction > 0.0:
            waiting = past[:, WAITING + delays.time.size :]
            parted = N * delays.fraction * np.maximum(left, GONE)
            past[:, 3 + P : WAITING] = np.where(left > GONE, waiting / parted, 0)
    count_up(state, N)
    state.motion.lost = 0.0
    return state


def joined(
    cohorts: Record,
    used: int,
    breaking: Breaking,
    finite: FiniteNumber,
    now: float,
) -> Record:
    """Join nodes whose contacts attached close together and have nearly the same reach;
    no contact is lost.
    """
    there = cohorts[:used].ravel()
    there = there[there.count > 0]
    count = there.count
    lives = np.stack([there.place, there.reach, there.clock, there.since])
    alike = lives[:3].copy()
    alike[2] = (
        np.maximum(alike[2], breaking.blurred.low) if breaking.width > 0.0 else 0.0
    )
    cell = np.round(alike / (0.3 * finite.grain))
    if breaking.growth.first != 0.0:  # join only contacts of nearly the same age
        cell = np.append(
            cell,
            [np.round(20.0 * np.log(np.maximum(now - there.since, 1e-300)))],
            axis=0,
        )
    kinds, which = np.unique(cell, axis=1, return_inverse=True)
    total = np.bincount(which.ravel(), count, kinds.shape[1])
    b, r, u, since = (
        np.bincount(which.ravel(), count * each, kinds.shape[1]) / total
        for each in lives
    )
    made = blank(COHORT_NODE, -(-total.size // Q) * Q)
    nodes = made[: b.size]
    alive = survivals(breaking, u, r)
    nodes.place = b
    nodes.reach = r
    nodes.clock = u
    nodes.since = since
    nodes.count = np.round(total)
    nodes.mass = np.where(
        alive > GONE,
        total / (finite.contacts * np.maximum(alive, GONE)),
        0.0,
    )
    return made.reshape(-1, Q)
