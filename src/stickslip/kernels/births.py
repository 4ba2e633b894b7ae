"""What re-attaches in a step: of what broke a delay before, and of what breaks in it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined
from .panel_state import AT_BORN, AT_BROKEN, AT_KNOWN, BROKEN, GROUPS, PANELS, ROUGH, TIME, Delays, State, Work
from .rules import GAUSS, INCREASE, MONOMIAL, NODE, P, Q
from .survival import value_at

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
    return in_panel(panels, k, t)


@inlined
def in_panel(panels: Array, k: int, t: float) -> float:
    """Mass broken up to a time by the polynomial of a panel; before and after it, up to its ends."""
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
def known_births(state: State, work: Work, delays: Delays, dt: float) -> None:
    """What broke before this step and re-attaches up to each node of it."""
    nodes = work.nodes
    t = state.scalar[TIME]
    for k in range(P + 1):
        nodes[AT_KNOWN, k] = 0.0
    for i in range(delays.time.size):
        tau, weight = delays.time[i], delays.weight[i]
        if tau == 0.0:
            continue
        start = _broken_at(state, i, t - tau)
        for k in range(1, P + 1):
            at = t - tau + NODE[k] * dt
            if at >= t:
                nodes[AT_KNOWN, k] += weight * (state.scalar[BROKEN] - start)
            else:
                nodes[AT_KNOWN, k] += weight * (_broken_at(state, i, at) - start)
    if delays.fraction > 0.0:
        _spread_births(state, work, delays, dt)


@bare
def _spread_births(state: State, work: Work, delays: Delays, dt: float) -> None:
    """Add what re-attaches after a delay of the continuous part."""
    panels, nodes, table = state.panels, work.nodes, delays.continuous
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
                nodes[AT_KNOWN, k] += delays.fraction * m * (left - value_at(table, age + NODE[k] * dt))


@bare
def own_births(work: Work, delays: Delays, dt: float) -> None:
    """All that re-attaches up to each node: what was known, and what breaks in the step itself."""
    nodes = work.nodes
    for k in range(1, P + 1):
        nodes[AT_BORN, k] = nodes[AT_KNOWN, k]
    for i in range(delays.time.size):
        tau, weight = delays.time[i], delays.weight[i]
        if tau >= dt:
            continue
        for k in range(1, P + 1):
            if tau == 0.0:
                nodes[AT_BORN, k] += weight * nodes[AT_BROKEN, k]
                continue
            u = NODE[k] - tau / dt
            if u > 0.0:
                total = 0.0
                for a in range(P, 0, -1):
                    c = 0.0
                    for b in range(1, P + 1):
                        c += MONOMIAL[a, b] * nodes[AT_BROKEN, b]
                    total = (total + c) * u
                nodes[AT_BORN, k] += weight * total
    if delays.fraction > 0.0:
        for k in range(1, P + 1):
            total = 0.0
            for j in range(Q):
                m = 0.0
                for a in range(1, P + 1):
                    m += INCREASE[k - 1, j, a] * nodes[AT_BROKEN, a]
                total += m * (1.0 - value_at(delays.continuous, NODE[k] * (1.0 - GAUSS[j]) * dt))
            nodes[AT_BORN, k] += delays.fraction * total


@bare
def next_front(state: State, delays: Delays, t: float, smallest: float) -> float:
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
def mark_rough(state: State, t: float) -> None:
    """Remember a moment at which what breaks has no smooth rate."""
    n, size = state.used[ROUGH], state.rough.size
    if n == 0 or state.rough[(n - 1) % size] < t:
        state.rough[n % size] = t
        state.used[ROUGH] = n + 1
        for i in range(state.front.size):
            state.front[i] = max(state.front[i], n + 1 - size)


@bare
def forget(state: State, delays: Delays, spare: int) -> bool:
    """Forget panels of which all has re-attached; whether there is room now, for `spare` groups among others."""
    n = state.used[PANELS]
    if n == state.panels.shape[0]:
        first = n - 1
        t = state.scalar[TIME]
        for i in range(delays.time.size):
            k = state.cursor[i]
            while k > 0 and state.panels[k, 0] > t - delays.time[i]:
                k -= 1
            first = min(first, k)
        if delays.fraction > 0.0:
            while first > 0 and state.panels[first, 0] + state.panels[first, 1] > t - delays.continuous.top:
                first -= 1
        if first < n // 2:
            return False
        for k in range(first, n):
            for a in range(state.panels.shape[1]):
                state.panels[k - first, a] = state.panels[k, a]
        for i in range(state.cursor.size):
            state.cursor[i] = max(state.cursor[i] - first, 0)
        state.used[PANELS] = n - first
    return bool(state.used[GROUPS] + spare <= state.groups.shape[1])
