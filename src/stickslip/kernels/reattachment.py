"""Mass that re-attaches during a step: from breaks one delay earlier, and from breaks
within the step.
"""

import math

from ._jit import bare, inlined
from .panel_state import Delays, PanelsState, Work
from .quadrature import GAUSS, INCREASE, NODE, P, Q, between, dot
from .records import Floats
from .survival import value_at


@bare
def _panel_at(state: PanelsState, t: float) -> int:
    """Return the panel that contains a time before now; the first one if it is earlier
    than all.
    """
    low = 0
    high = state.used.panels
    # ends: half of the panels are left in each turn
    while high - low > 1:
        middle = (low + high) // 2
        if state.panels[middle, 0] <= t:
            low = middle
        else:
            high = middle
    return low


@inlined
def _broken_at(state: PanelsState, t: float) -> float:
    """Return the mass broken up to a time before now."""
    return in_panel(state.panels, _panel_at(state, t), t)


@inlined
def in_panel(panels: Floats, k: int, t: float) -> float:
    """Return the mass broken up to a time by the polynomial of a panel; outside the
    panel, its value at the nearer end.
    """
    return between(
        panels[k, 2 : 3 + P], min(max((t - panels[k, 0]) / panels[k, 1], 0.0), 1.0)
    )


@bare
def known_reattachment(
    state: PanelsState,
    work: Work,
    delays: Delays,
    dt: float,
) -> None:
    """Sum, for each node of a step, the mass that re-attaches up to it and broke before
    the step.
    """
    nodes = work.nodes
    t = state.motion.time
    for k in range(P + 1):
        nodes[k].known = 0.0
    for i in range(delays.time.size):
        tau = delays.time[i]
        weight = delays.weight[i]
        if tau == 0.0:
            continue
        start = _broken_at(state, t - tau)
        for k in range(1, P + 1):
            at = t - tau + NODE[k] * dt
            if at >= t:
                nodes[k].known += weight * (state.motion.broken - start)
            else:
                nodes[k].known += weight * (_broken_at(state, at) - start)
    if delays.fraction > 0.0:
        _add_spread_delays(state, work, delays, dt)


@bare
def _add_spread_delays(
    state: PanelsState,
    work: Work,
    delays: Delays,
    dt: float,
) -> None:
    """Add the mass that re-attaches after delays from the continuous distribution."""
    panels = state.panels
    nodes = work.nodes
    table = delays.continuous
    t = state.motion.time
    for p in range(state.used.panels - 1, -1, -1):
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
                nodes[k].known += (
                    delays.fraction * m * (left - value_at(table, age + NODE[k] * dt))
                )


@bare
def all_reattachment(work: Work, delays: Delays, dt: float) -> None:
    """Sum the mass that re-attaches up to each node: the known part, and the part that
    breaks in the step itself.
    """
    nodes = work.nodes
    for k in range(1, P + 1):
        nodes[k].reattached = nodes[k].known
    for i in range(delays.time.size):
        tau = delays.time[i]
        weight = delays.weight[i]
        if tau >= dt:
            continue
        for k in range(1, P + 1):
            if tau == 0.0:
                nodes[k].reattached += weight * nodes[k].broken
                continue
            u = NODE[k] - tau / dt
            if u > 0.0:
                nodes[k].reattached += weight * between(nodes.broken, u)
    if delays.fraction > 0.0:
        for k in range(1, P + 1):
            total = 0.0
            for j in range(Q):
                m = dot(INCREASE[k - 1, j], nodes.broken)
                total += m * (
                    1.0 - value_at(delays.continuous, NODE[k] * (1.0 - GAUSS[j]) * dt)
                )
            nodes[k].reattached += delays.fraction * total


@bare
def next_front(
    state: PanelsState,
    delays: Delays,
    t: float,
    smallest: float,
) -> float:
    """Return the next time at which mass that broke at a rough moment re-attaches."""
    front = math.inf
    for delay in delays.time:
        for moment in state.rough:
            if moment + delay > t + smallest:
                front = min(front, moment + delay)
    return front


@bare
def mark_rough(state: PanelsState, t: float) -> None:
    """Remember a moment at which the breaking rate is not smooth."""
    n = state.used.rough
    size = state.rough.size
    if n == 0 or state.rough[(n - 1) % size] < t:
        state.rough[n % size] = t
        state.used.rough = n + 1


@bare
def forget(state: PanelsState, delays: Delays, spare: int) -> bool:
    """Remove panels whose mass has all re-attached; return whether there is then room
    for one more panel and for `spare` more cohorts.
    """
    n = state.used.panels
    if n == state.panels.shape[0]:
        first = n - 1
        t = state.motion.time
        for delay in delays.time:
            first = min(first, _panel_at(state, t - delay))
        if delays.fraction > 0.0:
            while (
                first > 0
                and state.panels[first, 0] + state.panels[first, 1]
                > t - delays.continuous.top
            ):
                first -= 1
        if first < n // 2:
            return False
        for k in range(first, n):
            for a in range(state.panels.shape[1]):
                state.panels[k - first, a] = state.panels[k, a]
        state.used.panels = n - first
    return bool(state.used.cohorts + spare <= len(state.cohorts))
