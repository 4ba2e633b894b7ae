"""Cohorts: the contacts that attached in one panel, represented at the nodes of Gauss
quadrature.

A contact that attached at ``b`` is stretched by ``X - b``; of a mass ``m`` of them
``m J_c(r)`` are attached if their largest stretching so far is ``r``. The sum over the
nodes of a cohort is the integral over its panel, to an order that depends on the
smoothness of ``J_c``. With fixed thresholds, a panel in which ``J_c`` has a kink is
integrated in parts. With growing thresholds, or thermal activation,
`effective_stretching` gives the attached fraction.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .effective_stretching import (
    CERTAIN,
    NEVER,
    Breaking,
    begin_step,
    followed,
    is_fixed,
    later,
    note,
    survival,
)
from .quadrature import GAUSS, GAUSS_MONOMIAL, WEIGHT, Q
from .records import Counts, Floats, Record, record
from .survival import SurvivalTable, value_and_slope, value_at

COHORT_NODE = record("place mass reach whole count clock since")
"""A node of a cohort, in an array of cohorts of shape (room, Q): the place where its
contacts attached, mass of newborns, largest stretching. `whole` is 1 for a cohort whose
nodes are those of Gauss on one panel; `count` is the number of attached contacts where
they are counted. `clock` and `reach`, where thresholds grow, are those of
`effective_stretching`; `since` is the time of attachment.
"""

ACTIVE = record("place mass reach")
"""A node that may break in a step: its place relative to the origin, mass and reach."""

ON_WAY = record("clock age reach gain")
"""Further fields of such a node, where contacts break by age or thermally: its clock
and age, and during the step its reach and the gain of its clock. They are apart from
`ACTIVE`, which is read most often, as smaller records are read faster.
"""


class Reading(NamedTuple):
    """Working memory for the nodes that may break in a step, filled by `gather`."""

    active: Record  # shape (n,), of ACTIVE
    on_way: Record  # shape (n,), of ON_WAY
    sums: Floats  # shape (3,): moments of the mass of all nodes that cannot break
    kinked: Counts  # number of cohorts that a knot may pass, and their indices
    way: Floats  # motion of the slider in the step, see `effective_stretching`


@bare
def _is_kinked(
    cohorts: Record,
    g: int,
    origin: float,
    breaking: Breaking,
    low: float,
    high: float,
) -> bool:
    """Whether a knot of the thresholds passes through the nodes of a cohort while the
    slider is between `low` and `high`.
    """
    a = cohorts[g, 0].place - origin
    b = cohorts[g, Q - 1].place - origin
    least = min(a, b)
    most = max(a, b)
    if most - least < 1e-9 or cohorts[g, 0].whole == 0.0:
        return False
    if low != high and _is_passed(cohorts, g, origin, breaking.thresholds, low, high):
        return True
    for j in range(Q):
        node = cohorts[g, j]
        if node.reach > abs(origin - node.place) + 1e-12:
            return False  # its reach does not change
    edge = 0.2 * (most - least)
    ahead = origin - cohorts[g, 0].place >= 0.0
    if low != high and ahead != (high > -low):
        return False  # the slider moves back towards where they attached
    for i in range(breaking.knots.size):
        knot = breaking.knots[i]
        if ahead and high - least + edge > knot > low - most - edge:
            return True
        if not ahead and most - low + edge > knot > least - high - edge:
            return True
    return False


@bare
def _is_passed(
    cohorts: Record,
    g: int,
    origin: float,
    table: SurvivalTable,
    low: float,
    high: float,
) -> bool:
    """Whether contacts of a cohort exceed their largest stretching one by one."""
    sign = 1.0 if high > -low else -1.0
    first = np.inf
    last = -np.inf
    widest = 0.0
    for j in range(Q):
        node = cohorts[g, j]
        x = origin - node.place
        widest = max(widest, node.reach)
        passed = node.reach - sign * x  # displacement until it exceeds its reach
        first = min(first, passed)
        last = max(last, passed)
    far = max(high, -low)
    return bool(
        last - first > 1e-9
        and last > 1e-12
        and first < far
        and widest + far > table.bottom
    )


_ONES = np.ones(Q)


class _Curve(NamedTuple):
    """Coefficients of the polynomial through values at the `Q` nodes of a cohort, over
    its panel from 0 to 1.
    """

    c0: float
    c1: float
    c2: float
    c3: float


@inlined
def _curve(values: Floats, per: Floats) -> _Curve:
    """Polynomial through values at the nodes of a cohort, each divided by a number."""
    c0 = c1 = c2 = c3 = 0.0
    for b in range(Q):
        value = values[b] / per[b]
        c0 += GAUSS_MONOMIAL[0, b] * value
        c1 += GAUSS_MONOMIAL[1, b] * value
        c2 += GAUSS_MONOMIAL[2, b] * value
        c3 += GAUSS_MONOMIAL[3, b] * value
    return _Curve(c0, c1, c2, c3)


@inlined
def _inside(curve: _Curve, u: float) -> float:
    """Value of the polynomial at ``0 <= u <= 1`` in the panel of a cohort."""
    return ((curve.c3 * u + curve.c2) * u + curve.c1) * u + curve.c0


_EVER = -1.0  # stands for the reach, in place of a knot


@inlined
def _beyond(
    place: _Curve,
    reach: _Curve,
    X: float,
    knot: float,
    sign: float,
    u: float,
) -> float:
    """Stretching of the contacts at a place in a panel, minus a knot or their reach."""
    x = X - _inside(place, u)
    return abs(x) - _inside(reach, u) if knot == _EVER else x * sign - knot


@bare
def _cut(cohort: Record, X: float, knot: float) -> float:
    """Place in a panel where contacts are stretched by `knot`, or to their reach;
    outside of (0, 1) if there is none.
    """
    place = _curve(cohort.place, _ONES)
    reach = _curve(cohort.reach, _ONES)
    sign = 1.0 if X - cohort[0].place >= 0.0 else -1.0
    a = 0.0
    b = 1.0
    fa = _beyond(place, reach, X, knot, sign, a)
    fb = _beyond(place, reach, X, knot, sign, b)
    if fa * fb >= 0.0 or max(abs(fa), abs(fb)) < 1e-9:
        return 2.0
    for _ in range(50):
        u = 0.5 * (a + b)
        if _beyond(place, reach, X, knot, sign, u) * fa > 0.0:
            a = u
        else:
            b = u
    return 0.5 * (a + b)


@bare
def _next_cut(
    cohort: Record,
    X: float,
    knots: Floats,
    after: float,
) -> float:
    """The first cut after a place in a panel, by a knot or at the limit of contacts
    that exceed their reach.
    """
    end = 1.0
    for i in range(-1, knots.size):
        u = _cut(cohort, X, knots[i] if i >= 0 else _EVER)
        if after + 1e-9 < u < end:
            end = u
    return end


@bare
def _in_parts(
    cohort: Record,
    origin: float,
    breaking: Breaking,
    y: float,
) -> tuple[float, float, float, float]:
    """Force, attached fraction, slope and energy of a cohort, integrated between the
    knots in it.
    """
    F = A = S = E = 0.0
    begin = 0.0
    table = breaking.thresholds
    X = origin + y
    place = _curve(cohort.place, _ONES)
    reach = _curve(cohort.reach, _ONES)
    density = _curve(cohort.mass, WEIGHT)
    # ends: each cut lies 1e-9 of the panel behind the last
    while begin < 1.0:
        end = _next_cut(cohort, X, breaking.knots, begin)
        for j in range(Q):
            u = begin + (end - begin) * GAUSS[j]
            m = (end - begin) * WEIGHT[j] * _inside(density, u)
            x = X - _inside(place, u)
            r = _inside(reach, u)
            if abs(x) > r - 1e-12:
                J, slope = value_and_slope(table, abs(x))
                S += m * (J + abs(x) * slope)
            else:
                J = value_at(table, r)
                S += m * J
            A += m * J
            F += m * J * x
            E += m * J * x * x
        begin = end
    return F, A, S, E


@bare
def gather(
    cohorts: Record,
    used: int,
    origin: float,
    reading: Reading,
    breaking: Breaking,
    low: float,
    high: float,
    t: float,
) -> int:
    """Collect the nodes that may break from a time on while the slider is between `low`
    and `high`; sum the others.
    """
    m0 = m1 = m2 = 0.0
    count = 0
    kinks = 0
    active = reading.active
    table = breaking.thresholds
    fixed = is_fixed(breaking)
    most = 0.0
    far = 0.0
    begin_step(reading.way, low, high)
    for g in range(used):
        if fixed and _is_kinked(cohorts, g, origin, breaking, low, high):
            kinks += 1
            reading.kinked[kinks] = g
            continue
        for j in range(Q):
            node = cohorts[g, j]
            m = node.mass
            if m == 0.0:
                continue
            d = node.place - origin
            r = node.reach
            age = t - node.since
            if not fixed:
                most, far = note(reading.way, breaking, d, age)
            if r >= table.top:
                continue
            whole = (
                r < table.bottom and high - d < table.bottom and d - low < table.bottom
            )
            if not fixed:
                u = node.clock
                whole = whole and far < table.bottom
                if breaking.width > 0.0:
                    if u >= breaking.blurred.top:
                        continue
                    whole = (
                        whole
                        and later(breaking.width, u, most) < breaking.blurred.bottom
                    )
                reading.on_way[count].clock = u
                reading.on_way[count].age = age
            if whole:
                m0 += m
                m1 += m * d
                m2 += m * d * d
            else:
                active[count].place = d
                active[count].mass = m
                active[count].reach = r
                count += 1
    reading.sums[0] = m0
    reading.sums[1] = m1
    reading.sums[2] = m2
    reading.kinked[0] = kinks
    return count


@bare
def force_at(
    reading: Reading,
    cohorts: Record,
    origin: float,
    count: int,
    breaking: Breaking,
    y: float,
    k: int,
) -> tuple[float, float, float, float, float, float]:
    """Force, attached fraction, slope of the force, and energy of the cohorts from
    before the step, at its node `k`, with the slider at `y` from the origin.

    Nodes must be evaluated in order. The last two numbers are the decrease of the force
    by the clocks, of contacts behind the slider and of those ahead of it.
    """
    sums = reading.sums
    active = reading.active
    table = breaking.thresholds
    F = sums[0] * y - sums[1]
    A = sums[0]
    S = sums[0]
    E = sums[0] * y * y - 2.0 * sums[1] * y + sums[2]
    if not is_fixed(breaking):
        f, a, s, e, ahead, back = _force_on_the_way(reading, count, breaking, y, k)
        return F + f, A + a, S + s, 0.5 * (E + e), ahead, back
    for i in range(count):
        x = y - active[i].place
        r = active[i].reach
        m = active[i].mass
        a = abs(x)
        if a > r:
            J, slope = value_and_slope(table, a)
            S += m * (J + a * slope)
        else:
            J = value_at(table, r)
            S += m * J
        mJ = m * J
        A += mJ
        F += mJ * x
        E += mJ * x * x
    for i in range(reading.kinked[0]):
        cohort = cohorts[reading.kinked[i + 1]]
        f, a, s, e = _in_parts(cohort, origin, breaking, y)
        F += f
        A += a
        S += s
        E += e
    return F, A, S, 0.5 * E, 0.0, 0.0


@bare
def _force_on_the_way(
    reading: Reading,
    count: int,
    breaking: Breaking,
    y: float,
    k: int,
) -> tuple[float, float, float, float, float, float]:
    """`force_at` for contacts that may break by age or thermally."""
    active = reading.active
    way = reading.way
    A = breaking.width
    force = mass = slope = energy = ahead = back = 0.0
    for i in range(count):
        d = active[i].place
        m = active[i].mass
        r = active[i].reach
        node = reading.on_way[i]
        u = node.clock
        x = y - d
        part = 0.0
        rises = False
        if k > 0:
            gain = node.gain if k > 1 else NEVER
            before = node.reach if k > 1 else r
            gain, r = followed(way, breaking, d, gain, before, node.age, 0.0, k)
            node.gain = gain
            node.reach = r
            rises = r > before
            if A > 0.0:
                u = later(A, u, gain)
                part = math.exp((gain - u) / A)
        J, by_clock, by_reach = survival(breaking, u, r)
        if breaking.squared:
            by_clock *= abs(x)
        mass += m * J
        force += m * J * x
        energy += m * J * x * x
        slope += m * (J + abs(x) * by_reach if rises else J)
        if x > 0.0:
            ahead += m * x * by_clock * part
        else:
            back -= m * x * by_clock * part
    return force, mass, slope, energy, ahead, back


@bare
def kink_at(
    cohorts: Record,
    used: int,
    breaking: Breaking,
    level: float,
) -> float:
    """Decrease of the slope of the force where the slider passes a place at which it
    has reversed.
    """
    jump = 0.0
    table = breaking.thresholds
    if not is_fixed(breaking):
        return 0.0  # the slope bends, or falls for a few contacts at a time
    for g in range(used):
        for j in range(Q):
            node = cohorts[g, j]
            r = node.reach
            is_last = abs(abs(level - node.place) - r) < 1e-9
            if table.bottom < r < table.top and is_last:
                jump -= node.mass * r * value_and_slope(table, r)[1]
    return abs(jump)


@bare
def divide(
    cohorts: Record,
    used: int,
    X: float,
    breaking: Breaking,
    room: int,
) -> int:
    """Divide the cohorts through which a knot passes, as far as there is room, when the
    slider reverses, as their reach then stays; return the number of cohorts.
    """
    count = used
    for g in range(used if is_fixed(breaking) else 0):
        if _is_kinked(cohorts, g, X, breaking, 0.0, 0.0):
            count = _divide(cohorts, g, count, X, breaking.knots, room)
    return count


@bare
def divide_passed(
    cohorts: Record,
    used: int,
    X: float,
    breaking: Breaking,
    room: int,
) -> int:
    """Divide cohorts of which only a part exceeds its largest stretching; return the
    number of cohorts.
    """
    count = used
    table = breaking.thresholds
    for g in range(used if is_fixed(breaking) else 0):
        ahead = 0
        widest = 0.0
        for j in range(Q):
            x = abs(X - cohorts[g, j].place)
            widest = max(widest, x)
            if x > cohorts[g, j].reach:
                ahead += 1
        if 0 < ahead < Q and widest >= table.bottom and cohorts[g, 0].whole != 0.0:
            count = _divide(cohorts, g, count, X, breaking.knots[:0], room)
    return count


@bare
def _divide(
    cohorts: Record,
    g: int,
    count: int,
    X: float,
    knots: Floats,
    room: int,
) -> int:
    """Divide a cohort at all cuts, and append the parts; return the cohorts' number."""
    first = begin = _next_cut(cohorts[g], X, knots, 0.0)
    while begin < 1.0 and count < room - 1:
        end = _next_cut(cohorts[g], X, knots, begin)
        _part(cohorts[g], cohorts[count], X, begin, end)
        count += 1
        begin = end
    if first < 1.0 and begin == 1.0:
        _part(cohorts[g], cohorts[count], X, 0.0, first)
        for j in range(Q):
            cohorts[g, j] = cohorts[count, j]
    return count


@bare
def _part(
    whole: Record,
    part: Record,
    X: float,
    begin: float,
    end: float,
) -> None:
    """Fill the part from `begin` to `end` of a whole cohort's panel into another."""
    place = _curve(whole.place, _ONES)
    reach = _curve(whole.reach, _ONES)
    density = _curve(whole.mass, WEIGHT)
    for j in range(Q):
        u = begin + (end - begin) * GAUSS[j]
        b = _inside(place, u)
        part[j] = whole[j]
        part[j].place = b
        part[j].mass = (end - begin) * WEIGHT[j] * _inside(density, u)
        part[j].reach = max(abs(X - b), _inside(reach, u))
        part[j].whole = 1.0


def merged(
    cohorts: Record,
    used: int,
    breaking: Breaking,
    width: float,
    tolerance: float,
) -> Record:
    """Join cohorts that are close to each other and have the same reach; moments are
    kept up to order ``2 Q - 1``.

    A slider that rings for long attaches contacts in many short panels at nearly the
    same places. A joined cohort is not integrated in parts: a knot that passes through
    it costs an error of some percent of the square of its extent. With thermal
    activation the clock takes the part of the reach, and must be ahead of it. Cohorts
    with growing thresholds, or with a parabolic barrier, are not joined.
    """
    cohorts = cohorts[:used]
    b = cohorts.place
    m = cohorts.mass
    r = cohorts.reach
    table = breaking.thresholds
    met = np.zeros(used, dtype=np.bool_)
    if breaking.width > 0.0:
        is_pulled = cohorts.clock < r + CERTAIN * breaking.width
        met = np.any((r > table.bottom) & is_pulled, axis=1)
        r = cohorts.clock
        table = breaking.blurred
    # A reach that the slider gave at one place is that place minus the place of
    # attachment, or the reverse.
    ahead = r + b
    back = b - r
    free = np.all(r < table.bottom, axis=1)
    forth = ~free & (np.ptp(ahead, axis=1) < 1e-10)
    kind = np.where(
        free,
        0,
        np.where(forth, 1, np.where(np.ptp(back, axis=1) < 1e-10, 2, 3)),
    )
    level = np.where(kind == 1, ahead[:, 0], np.where(kind == 2, back[:, 0], 0.0))
    extent = (
        min(0.02 * width, (10.0 * tolerance) ** 0.5)
        if breaking.knots.size
        else 0.5 * width
    )
    cell = np.floor(b / extent)
    alone = (
        (kind == 3)
        | met
        | np.any(cell != cell[:, :1], axis=1)
        | (breaking.growth.first != 0.0)
    )
    alone |= breaking.squared
    keys = np.stack(
        [
            np.where(alone, np.arange(used), -1),
            kind,
            np.round(level, 8),
            np.where(alone, 0.0, cell[:, 0]),
        ]
    )
    _, first, which, size = np.unique(
        keys,
        axis=1,
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    made = cohorts[first]
    for i in np.flatnonzero(size > 1):
        run = which.ravel() == i
        x, weight = gauss_rule(b[run].ravel(), m[run].ravel())
        k = kind[first[i]]
        at = level[first[i]]
        reach = at - x if k == 1 else x - at if k == 2 else np.full(Q, r[run].max())
        # any reach works that their clocks are ahead of
        least = np.full(Q, cohorts.reach[run].min())
        made.place[i] = x
        made.mass[i] = weight
        made.reach[i] = least if breaking.width > 0.0 else reach
        made.whole[i] = 0.0
        made.count[i] = 0.0
        made.clock[i] = reach
    return made


def gauss_rule(x: Floats, weight: Floats, count: int = Q) -> tuple[Floats, Floats]:
    """Return nodes and weights with the moments of many masses, from the matrix of
    ``x`` in polynomials that are orthogonal on them.
    """
    total = weight.sum()
    positive = np.maximum(weight, 0.0)
    if total <= 0.0 or positive.sum() <= 0.0:
        return np.full(count, x.mean()), np.full(count, total / count)
    part = positive / positive.sum()
    centre = part @ x
    half = max(0.5 * float(np.ptp(x)), 1e-300)
    t = (x - centre) / half
    basis = np.linalg.qr(np.sqrt(part)[:, None] * np.vander(t, count, increasing=True))[
        0
    ]
    place, vector = np.linalg.eigh(basis.T @ (t[:, None] * basis))
    return centre + half * place, total * vector[0] ** 2


def spread_out(cohorts: Record, spacing: float) -> Floats:
    """Return positions, masses, reaches and clocks of all cohorts, shape (4, n); those
    of whole panels are spread over as many points as their spacing requires.
    """
    whole = cohorts.whole[:, 0] > 0.0
    rows = np.stack([cohorts.place, cohorts.mass, cohorts.reach, cohorts.clock])
    parts = [rows[:, ~whole].reshape(4, -1)]
    for place, mass, reach, clock in np.moveaxis(rows[:, whole], 1, 0):
        count = max(int(np.ptp(place) / spacing), Q)
        u = (np.arange(count) + 0.5) / count
        powers = np.vander(u, Q, increasing=True) @ GAUSS_MONOMIAL
        spread = powers @ (mass / WEIGHT)
        spread *= mass.sum() / spread.sum() if spread.sum() != 0.0 else 0.0
        parts.append(
            np.stack(
                [
                    powers @ place,
                    spread,
                    np.maximum(powers @ reach, 0.0),
                    powers @ clock,
                ]
            )
        )
    return np.concatenate(parts, axis=1)
