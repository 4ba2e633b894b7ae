"""Survival of contacts that attached together, by two numbers that never decrease: a
reach and a clock.

A contact of strength ``s`` has broken once its `reach`, the largest
``(|x| - addend)/factor`` of its life, exceeds ``s``; for thresholds that do not grow it
is the largest stretching. With `Bell` it breaks earlier, at the rate
``a exp((|x| - s)/A)``: its survival is ``exp(-exp((u - s)/A))``, where its `clock`
``u = A ln(a G)`` holds the integral ``G`` of ``exp(|x|/A)`` over its life, which does
not depend on the strength. So the surviving fraction of newborns is a function of both;
it depends on ``u`` alone unless contacts are pulled too fast for thermal breaks.

If thresholds also grow logarithmically, ``G`` is the integral of ``exp((|x| - g)/A)``,
with ``g`` their growth. With `Parabolic` the energies ``x^2/2`` and ``s^2/2`` replace
``x`` and ``s``, and the temperature replaces ``A``.

In a step the position of the slider is a polynomial. For all contacts behind the slider
``G`` grows by an integral that they share except for a factor, and for those ahead of
it by another integral. If thresholds grow, the shared integral is a function of age,
smooth in the growth during the step; with `Parabolic` it is a function of the place of
attachment.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .hazard import Growth, grown
from .quadrature import MONOMIAL, NODE, P, along, bisect, dot, fit, gauss
from .records import Floats, Record
from .survival import SurvivalTable, value_and_slope, value_at

NEVER = -1e9  # the clock of a contact that has made no attempt to break
CERTAIN = 3.7  # ``exp(-exp(CERTAIN))`` is below rounding
_SURE = 37.0  # ``exp(-_SURE)`` is below rounding
# most panels of an interval of a clock; tens are usual, as panels grow where they
# matter little
_MOST_PANELS = 100_000
_NO_END = (
    "effective_stretching: no end of steps: a fault of this package, please report it"
)

_THREE, _OF_THREE = gauss(3)
_EIGHT, _OF_EIGHT = gauss(8)


class Breaking(NamedTuple):
    """Constants of breaking: at thresholds, which may grow, and thermally before."""

    thresholds: SurvivalTable  # survival of strengths, by the reach
    knots: Floats  # places where its slope jumps, if cohorts are cut there
    blurred: SurvivalTable  # survival with thermal activation, by the clock
    # activation width, or the temperature if `squared`; 0 without thermal activation
    width: float
    attempts: float
    growth: Growth
    squared: bool = False  # the barrier falls with the square of the stretching


X = 0
CURVE = 1
STEP = 2
MOMENTS = 3
PULLED = 4
BACK = P + 1
SHARED = 4 + 2 * BACK
FITS = 4 + 4 * BACK
"""Rows of the array for the motion of the slider in a step, each of P + 1 numbers or
more: `X`, its places at start and nodes; `CURVE`, coefficients of the polynomial
through them; `STEP`, properties of the step; `MOMENTS`, working memory. Rows from
`PULLED` are, for each node, the weights of the slider's places at all nodes in the gain
of clocks up to it, for contacts behind the slider; `BACK` rows further on, for those
ahead. Rows from `SHARED` are the gains from the previous node: one number, or the
coefficients of Chebyshev polynomials; rows from `FITS` are these polynomials at their
nodes.
"""
LENGTH, LOW, HIGH, LOWEST, HIGHEST, YOUNGEST = range(6)
"""Properties of a step: its length in time; the lowest and highest positions that the
slider may reach; the range of places of attachment, and the age of the youngest
contact.
"""

# number of ages at which gains are tabulated: least number; number per activation width
# of growth while the age grows by a factor e; largest number
_FEWEST_AGES = 12
_AGES = 2.0
_MOST_AGES = 60
_PLACES = 24  # number of places at which they are tabulated with `squared`


def a_way(breaking: Breaking) -> Floats:
    """Return working memory for the motion of the slider in a step."""
    many = _PLACES
    if breaking.width == 0.0 or not (breaking.squared or breaking.growth.first > 0.0):
        return np.zeros((FITS, P + 1))
    if not breaking.squared:
        many = min(
            _FEWEST_AGES + math.ceil(_AGES * breaking.growth.first / breaking.width),
            _MOST_AGES,
        )
    way = np.zeros((FITS + many, many))
    way[FITS:] = np.cos(np.pi / many * np.outer(np.arange(many), np.arange(many) + 0.5))
    return way


@inlined
def is_fixed(breaking: Breaking) -> bool:
    """Whether contacts break only at thresholds, and these do not grow."""
    return bool(breaking.width == 0.0 and breaking.growth.first == 0.0)


@inlined
def _is_tabulated(breaking: Breaking) -> bool:
    """Whether gains of clocks in a step depend on age or on the place of attachment."""
    return bool(
        breaking.width > 0.0 and (breaking.growth.first > 0.0 or breaking.squared)
    )


@inlined
def energy(breaking: Breaking, x: float) -> float:
    """Argument of a clock for a stretching or strength: itself, or half its square."""
    return 0.5 * x * x if breaking.squared else x


@inlined
def reach_at(growth: Growth, x: float, age: float) -> float:
    """Strength of a contact of this age that reaches its threshold at a stretching
    ``x >= 0``.
    """
    if growth.first == 0.0:
        return x
    factor, addend, _, _ = grown(growth, age)
    return float((x - addend) / factor) if x > addend or factor > 0.0 else 0.0


@inlined
def begin_step(way: Floats, low: float, high: float) -> None:
    """Record the range of the slider in a step, before contacts are added by `note`."""
    step = way[STEP]
    step[LOW] = low
    step[HIGH] = high
    step[LOWEST] = np.inf
    step[HIGHEST] = -np.inf
    step[YOUNGEST] = np.inf


@inlined
def note(
    way: Floats,
    breaking: Breaking,
    b: float,
    age: float,
) -> tuple[float, float]:
    """Record contacts at a place `b`, with an age at the start of a step; return the
    largest gain of their clock in it, and their largest reach.
    """
    step = way[STEP]
    step[LOWEST], step[HIGHEST], step[YOUNGEST] = (
        min(step[LOWEST], b),
        max(step[HIGHEST], b),
        min(step[YOUNGEST], age),
    )
    r = reach_at(breaking.growth, max(step[HIGH] - b, b - step[LOW]), age)
    tries = step[LENGTH] * breaking.attempts
    return energy(breaking, r) + (
        breaking.width * math.log(tries) if tries > 0.0 else 0.0
    ), r


@inlined
def later(width: float, u: float, w: float) -> float:
    """Clock after two gains."""
    return max(u, w) + width * math.log1p(math.exp(-abs(u - w) / width))


@bare
def survival(breaking: Breaking, u: float, r: float) -> tuple[float, float, float]:
    """Fraction that survives a clock and a reach, and its derivatives by both."""
    if breaking.width == 0.0:
        held, by_reach = value_and_slope(breaking.thresholds, max(r, 0.0))
        return held, 0.0, by_reach
    d = (u - energy(breaking, r)) / breaking.width
    if r <= breaking.thresholds.bottom or d > CERTAIN:
        held, by_clock = value_and_slope(breaking.blurred, u)
        return held, by_clock, 0.0
    held, by_reach = value_and_slope(breaking.thresholds, r)
    if d < -_SURE:
        return held, 0.0, by_reach
    here = math.exp(-math.exp(d))
    return (
        _beyond(breaking, d, r, held),
        (1.0 - here) * value_and_slope(breaking.blurred, u)[1],
        here * by_reach,
    )


@bare
def _beyond(
    breaking: Breaking,
    d: float,
    r: float,
    held: float,
) -> float:
    """Fraction that survives where strengths below `r` matter, by panels.

    It is ``Int J_c(max(r, u - A ln E)) exp(-E) dE``.
    """
    total = held * math.exp(-math.exp(d))
    begin = 0.0
    size = 0.5
    end = max(d, 0.0) + _SURE
    # ends: each panel is at least half an e-fold wide
    while begin < end:
        for k in range(_THREE.size):
            t = begin + size * _THREE[k]
            s = d - t
            more = breaking.width * t
            strength = math.sqrt(r * r + 2.0 * more) if breaking.squared else r + more
            left = value_at(breaking.thresholds, strength)
            total += size * _OF_THREE[k] * left * math.exp(s - math.exp(s))
        begin += size
        size = min(1.15 * size, 4.0) if begin > d + 2.0 else 0.5
    return min(total, held)


@bare
def _fill(
    breaking: Breaking,
    u: Floats,
    r: Floats,
    values: Floats,
) -> None:
    for i in range(u.size):
        values[i] = survival(breaking, u[i], r[i])[0]


def survivals(breaking: Breaking, u: Floats, r: Floats) -> Floats:
    """Surviving fractions for arrays of any shape."""
    values = np.empty(u.size)
    _fill(breaking, u.ravel(), r.ravel(), values)
    return values.reshape(u.shape)


class _Piece(NamedTuple):
    """A part of a step, from 0 to 1 in time, or in the logarithm of the age if
    thresholds grow.
    """

    begin: float  # begin of the part, as a fraction of the step
    span: float  # length of the part, or of the logarithm
    ratio: float  # length of the step over the age at the begin; 0 without growth
    tilt: float  # change of the exponent by growth over the part
    b: float  # place of attachment
    factor: float  # factor of the exponent
    squared: bool


@inlined
def _place(piece: _Piece, s: float) -> float:
    """Fraction of the step at a point of the piece."""
    return float(
        piece.begin
        + (
            piece.span * s
            if piece.ratio == 0.0
            else math.expm1(piece.span * s) / piece.ratio
        )
    )


@inlined
def _exponent(way: Floats, piece: _Piece, s: float) -> float:
    x = along(way[CURVE], _place(piece, s)) - piece.b
    return float(piece.factor * (0.5 * x * x if piece.squared else x) + piece.tilt * s)


@inlined
def _piece_of(
    way: Floats,
    breaking: Breaking,
    begin: float,
    end: float,
    b: float,
    sign: float,
    age: float,
) -> tuple[_Piece, float]:
    """Return the part of a step in the variable in which growth is a linear tilt, and
    the growth of the thresholds up to its begin, for `_gain`.
    """
    A = breaking.width
    ratio = 0.0
    span = end - begin
    tilt = 0.0
    grown_by = 0.0
    if breaking.growth.first > 0.0 and age < math.inf:
        slope = breaking.growth.first / A
        time = breaking.growth.second
        young = max(age + begin * way[STEP, LENGTH], 0.0)
        ratio = way[STEP, LENGTH] / (time + young)
        span = math.log1p(ratio * span)
        tilt = (1.0 - slope) * span
        grown_by = slope * math.log1p(young / time)
    factor = (1.0 if breaking.squared else sign) / A
    return _Piece(begin, span, ratio, tilt, b, factor, breaking.squared), grown_by


@bare
def _gain(
    way: Floats,
    moments: Floats,
    breaking: Breaking,
    begin: float,
    end: float,
    b: float,
    sign: float,
    age: float,
) -> float:
    """Gain of a clock in a part of a step in which the slider is on one side of a place
    `b`, for contacts of an `age` at the start of the step.

    It is ``A ln a Int exp((sign (x - b) - g)/A)``, by panels from the end where the
    exponent is largest; panels are longer where they matter less, and end where they no
    longer matter. The error of a panel is below ``1e-10`` of the integral. `moments`
    are filled with the first moments of the fraction of the step under the integrand.
    """
    A = breaking.width
    many = moments.size
    piece, grown_by = _piece_of(way, breaking, begin, end, b, sign, age)
    for i in range(many):
        moments[i] = 0.0
    first = _exponent(way, piece, 0.0)
    last = _exponent(way, piece, 1.0)
    step, s, top, far = (
        (1.0, 0.0, first, last) if first > last else (-1.0, 1.0, last, first)
    )
    here = top
    left = 1.0
    size = 1.0
    for _ in range(_MOST_PANELS):
        if left <= 1e-14:
            break
        size = min(size, left)
        there = _exponent(way, piece, s + size * step)
        if abs(there - here) > 4.0 + 0.5 * (top - max(here, there)) and size > 1e-9:
            size *= 0.5
            continue
        if there > top:  # the exponent has a maximum within the part
            for i in range(many):
                moments[i] *= math.exp(max(top - there, -700.0))
            top = there
        for k in range(_EIGHT.size):
            at = s + size * step * _EIGHT[k]
            power = (
                size
                * _OF_EIGHT[k]
                * math.exp(min(_exponent(way, piece, at) - top, 40.0))
            )
            part = _place(piece, at)
            for i in range(many):
                moments[i] += power
                power *= part
        s = s + size * step
        here = there
        left = left - size
        if max(here, far) < top - _SURE:
            break
        size *= 2.0
    else:
        raise RuntimeError(_NO_END)
    total = max(moments[0], 1e-300)  # guards a motion that no step will accept
    for i in range(many):
        moments[i] /= total
    span = piece.span / piece.ratio if piece.ratio > 0.0 else piece.span
    time = way[STEP, LENGTH] * span
    return float(
        A * (top - grown_by + math.log(max(breaking.attempts * time * total, 1e-300)))
    )


@bare
def run_clocks(
    way: Floats,
    nodes: Record,
    breaking: Breaking,
    dt: float,
) -> None:
    """Record the positions of the slider at the nodes of a step, and the gains of
    clocks up to them.
    """
    for k in range(P + 1):
        way[X, k] = nodes[k].x
    way[STEP, LENGTH] = dt
    if breaking.width == 0.0:
        return
    fit(way[X, : P + 1], way[CURVE])
    # for contacts that do not grow any more
    moments = way[MOMENTS, : P + 1]
    old = math.inf
    for side in range(2):
        sign = 1.0 - 2.0 * side
        total = NEVER
        at = -sign if breaking.squared else 0.0  # as for contacts about to break
        for k in range(1, P + 1):
            gain = _gain(
                way,
                moments,
                breaking,
                NODE[k - 1],
                NODE[k],
                at,
                sign,
                old,
            )
            row = side * BACK + k
            total = later(breaking.width, total, gain)
            part = math.exp((gain - total) / breaking.width)
            way[SHARED + row, 0] = gain
            for i in range(P + 1):
                more = 0.0
                for a in range(P + 1):
                    more += MONOMIAL[a, i] * moments[a]
                way[PULLED + row, i] = (1.0 - part) * way[
                    PULLED + row - 1, i
                ] + part * more
    if _is_tabulated(breaking):
        _tabulate(way, breaking)


@inlined
def _limits(way: Floats, breaking: Breaking, side: int) -> tuple[float, float]:
    """Limits of the variable of the tabulated gains, for contacts behind the slider
    (side 0) or ahead of it (side 1).

    The variable is the place of attachment, or ``ln(1 + dt/(t_0 + age))``.
    """
    step = way[STEP]
    if breaking.squared:
        return (step[LOWEST], step[LOW]) if side == 0 else (step[HIGH], step[HIGHEST])
    return 0.0, math.log1p(step[LENGTH] / (breaking.growth.second + step[YOUNGEST]))


@bare
def _tabulate(way: Floats, breaking: Breaking) -> None:
    """Tabulate the gains of clocks from node to node, without the growth of the
    thresholds.
    """
    step = way[STEP]
    growth = breaking.growth
    many = way.shape[1]
    scratch = way[MOMENTS, :1]
    for side in range(2):
        row = SHARED + side * BACK
        sign = 1.0 - 2.0 * side
        begin, end = _limits(way, breaking, side)
        there = step[LOWEST] <= step[LOW] if side == 0 else step[HIGHEST] >= step[HIGH]
        for k in range(1, P + 1 if there else 1):
            for i in range(many):
                at = begin + 0.5 * (end - begin) * (1.0 + way[FITS + 1, i])
                age = math.inf
                grown_by = 0.0
                if not breaking.squared:
                    age = step[LENGTH] / math.expm1(at) - growth.second
                    at = 0.0
                    grown_by = growth.first * math.log1p(age / growth.second)
                way[row, i] = (
                    _gain(
                        way,
                        scratch,
                        breaking,
                        NODE[k - 1],
                        NODE[k],
                        at,
                        sign,
                        age,
                    )
                    + grown_by
                )
            for j in range(many):
                way[row + k, j] = (
                    (1.0 if j == 0 else 2.0) / many * dot(way[FITS + j], way[row])
                )


@inlined
def _shared(
    way: Floats,
    breaking: Breaking,
    side: int,
    k: int,
    b: float,
    age: float,
) -> float:
    """Gain of the clock from one node to the next, for contacts at a place `b` with an
    age at the start of the step.
    """
    growth = breaking.growth
    row = way[SHARED + side * BACK + k]
    at = b
    less = (1.0 - 2.0 * side) * b
    if not _is_tabulated(breaking):
        return float(row[0] - less)
    begin, end = _limits(way, breaking, side)
    if breaking.squared:
        less = 0.0
    else:
        at = math.log1p(way[STEP, LENGTH] / (growth.second + age))
        less += growth.first * math.log1p(age / growth.second)
    t = 2.0 * (2.0 * (at - begin) / max(end - begin, 1e-300) - 1.0)
    one = 0.0
    two = 0.0
    for j in range(row.size - 1, 0, -1):
        one, two = row[j] + t * one - two, one
    return float(row[0] + 0.5 * t * one - two - less)


@bare
def _gain_of_interval(
    way: Floats,
    breaking: Breaking,
    b: float,
    begin: float,
    k: int,
    age: float,
) -> float:
    """Gain of the clock of contacts at a place `b` up to a node, from the previous node
    or from a later `begin`.
    """
    a = NODE[k - 1]
    x0 = way[X, k - 1] - b
    x1 = way[X, k] - b
    scratch = way[MOMENTS, :1]
    if begin > a:
        a = begin
        x0 = along(way[CURVE], begin) - b
    if x0 * x1 < 0.0 and min(abs(x0), abs(x1)) > 1e-14 and not breaking.squared:
        sign = 1.0 if x1 > 0.0 else -1.0
        low, _ = bisect(way[CURVE], b, sign, a, NODE[k], 40)
        before = (
            _gain(way, scratch, breaking, a, low, b, -sign, age) if low > a else NEVER
        )
        return later(
            breaking.width,
            before,
            _gain(way, scratch, breaking, low, NODE[k], b, sign, age),
        )
    sign = 1.0 if x0 + x1 >= 0.0 else -1.0
    crosses = way[STEP, LOW] < b < way[STEP, HIGH]
    if begin > NODE[k - 1] or (_is_tabulated(breaking) and (crosses or age < 0.0)):
        return _gain(way, scratch, breaking, a, NODE[k], b, sign, age)
    return _shared(way, breaking, 0 if sign > 0.0 else 1, k, b, age)


@inlined
def followed(
    way: Floats,
    breaking: Breaking,
    b: float,
    u: float,
    r: float,
    age: float,
    begin: float,
    k: int,
) -> tuple[float, float]:
    """Return the clock and the reach at a node of a step, for contacts at a place `b`
    that had `u` and `r` at the previous node, or at `begin`.

    `age` is that at the start of the step, negative if they attached in it.
    """
    r = max(
        r,
        reach_at(
            breaking.growth,
            abs(way[X, k] - b),
            age + NODE[k] * way[STEP, LENGTH],
        ),
    )
    if breaking.width > 0.0:
        u = later(breaking.width, u, _gain_of_interval(way, breaking, b, begin, k, age))
    return u, r


@bare
def carried(
    way: Floats,
    breaking: Breaking,
    b: float,
    u: float,
    r: float,
    age: float,
    begin: float,
    k: int,
) -> tuple[float, float]:
    """Return the clock and the reach at a node of a step, for contacts at a place `b`
    that had `u`, `r` and `age` at the fraction `begin` of it.
    """
    age -= begin * way[STEP, LENGTH]
    for i in range(1, k + 1):
        if NODE[i] > begin:
            u, r = followed(way, breaking, b, u, r, age, begin, i)
    return u, r


@bare
def _fill_sliding(
    breaking: Breaking,
    way: Floats,
    begin: float,
    begun: float,
    x: Floats,
    velocity: float,
    u: Floats,
    r: Floats,
) -> None:
    for i in range(x.size):
        for k in range(P + 1):
            way[X, k] = NODE[k] * (x[i] - begin)
        fit(way[X, : P + 1], way[CURVE])
        way[STEP, LENGTH] = age = (x[i] - begin) / velocity
        u[i] = NEVER
        r[i] = max(begun, reach_at(breaking.growth, abs(x[i]), age))
        turn = min(max(-begin / (x[i] - begin), 0.0), 1.0)
        if breaking.width > 0.0 and turn > 0.0:
            u[i] = _gain(
                way,
                way[MOMENTS, :1],
                breaking,
                0.0,
                turn,
                -begin,
                -1.0,
                0.0,
            )
        if breaking.width > 0.0 and turn < 1.0:
            u[i] = later(
                breaking.width,
                u[i],
                _gain(
                    way,
                    way[MOMENTS, :1],
                    breaking,
                    turn,
                    1.0,
                    -begin,
                    1.0,
                    0.0,
                ),
            )


def sliding_lives(
    breaking: Breaking,
    begin: float,
    begun: float,
    x: Floats,
    velocity: float,
) -> tuple[Floats, Floats, Floats]:
    """Clocks, reaches and ages of contacts that steady sliding has stretched from
    `begin` to each of the increasing `x`.
    """
    u = np.empty(x.size)
    r = np.empty(x.size)
    _fill_sliding(
        breaking,
        a_way(breaking),
        begin,
        begun,
        x.ravel(),
        velocity,
        u,
        r,
    )
    return (
        u.reshape(x.shape),
        np.maximum.accumulate(r).reshape(x.shape),
        (x - begin) / velocity,
    )
