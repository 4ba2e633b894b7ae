"""One life of a contact in steady sliding with thermal activation, ageing and delay,
and its response to a small perturbation.

A life extends over the distance ``x`` that the slider moves, 0 at attachment: the
stretching of the contact, whose age is ``x/v``. It is divided into panels of eight
Radau nodes, at which the survival and its slopes are computed; the transforms of a
perturbation ``exp(s t)``, ``q = s/v``, are sums over the nodes.
"""

from typing import NamedTuple

import numpy as np

from ._jit import inlined, jit
from .hazard import (
    TABULATED,
    Growth,
    Hazard,
    ageing_time,
    growing_time,
    grown,
    log_rate,
    longest_fold,
    steepest,
)
from .quadrature import dot, integrals, powers, radau, solve
from .records import Complexes, Floats, Mask

NODES = 8
# powers of e by which a breaking rate may grow in a panel: an error of 1e-7 between
# nodes
FOLDS = 1.0
QUIET = 20.0
"""The breaks that a contact expects, where panels begin to resolve the rate, are
``exp(-QUIET)``; so are the survivors where panels end: 2e-9.
"""

# powers of e by which the solution of a homogeneous equation may decay in a panel
_DECAYS = 4.0
# radians of a perturbation that a panel resolves
_RESOLVED = 4.0 * (1.0 + 1e-9)

NODE = radau(NODES)
# stiffly accurate collocation: a fast decay within a panel is damped, not resolved
INTEGRAL = integrals(NODE)
POWERS = powers(NODE)
# eigenvalues and -vectors of the collocation, in which it solves ``U' = source - q U``
# by eight divisions
PACE, VECTORS = np.linalg.eig(INTEGRAL.astype(complex))
INVERSE = np.linalg.inv(VECTORS)
UNIT = INVERSE.sum(axis=1)


class Lifetimes(NamedTuple):
    """Lives of contacts on panels of `NODES` nodes; per contact, averaged over the
    thresholds by the weights.

    `width` and `fresh` are per panel, shape (p,): its length, and whether a life starts
    there. Per node, shape (8 p,): the stretching `x`, the quadrature `weight`, the
    `survival` and its slope in ln v; `decay` and `source` of
    ``U' = -(q + decay) U + source``, and the weights of `U` (`push`) and of
    ``exp(-q x)`` (`drop`) in the breaks that the perturbation causes, and how many
    contacts break per length as they `meet` their thresholds, where these are averaged
    over. Else the last three are per threshold, of contacts that reach it: stretching,
    weight, and slope of that place in ln v.
    """

    width: Floats
    fresh: Mask
    x: Floats
    weight: Floats
    survival: Floats
    slope: Floats
    decay: Floats
    source: Floats
    push: Floats
    drop: Floats
    meet: Floats
    cap_x: Floats
    cap_weight: Floats
    cap_slope: Floats


@inlined
def _threshold(growth: Growth, strength: float, age: float) -> tuple[float, float]:
    """Return the threshold at an age, and its rate of growth."""
    factor, addend, faster, more = grown(growth, age)
    return strength * factor + addend, strength * faster + more


@jit
def rule(growth: Growth, ages: Floats) -> Floats:
    """Return `grown` at many ages, shape (4, n)."""
    found = np.empty((4, ages.size))
    for i in range(ages.size):
        found[0, i], found[1, i], found[2, i], found[3, i] = grown(growth, ages[i])
    return found


@jit
def reach(growth: Growth, strength: float, v: float) -> float:
    """Return the stretching at which a contact meets its threshold: the first crossing,
    by bisection; 0 if it breaks at once.
    """
    if growth.first == 0.0:
        return strength
    start, pace = _threshold(growth, strength, 0.0)
    if start <= 0.0 and pace <= v:
        return 0.0
    low = 0.0
    high = 2.0 * (strength + abs(growth.second) + abs(start))
    for _ in range(2000):
        if _threshold(growth, strength, high / v)[0] <= high:
            break
        low = high
        high *= 2.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if _threshold(growth, strength, middle / v)[0] > middle:
            low = middle
        else:
            high = middle
    return high


@jit
def _panel(
    hazard: Hazard,
    growth: Growth,
    strength: float,
    v: float,
    here: float,
    end: float,
    broken: float,
) -> float:
    """Return the longest panel that resolves the breaking rate of a contact stretched
    by `here`, which meets its threshold at `end`.
    """
    c, pace = _threshold(growth, strength, here / v)
    exponent, steep, hard = log_rate(hazard, here, c)
    h = min(0.25 * end, end - here)
    if not hazard.attempts > 0.0:
        return h
    fine = FOLDS / (abs(steep) + abs(hard) * abs(pace) / v)
    if growth.first != 0.0:
        fine = min(fine, 0.5 * (here + v * growing_time(growth)))
    if growth.kind == TABULATED:  # smooth between its nodes only
        fine = min(fine, v * ageing_time(growth, here / v))
    fine = min(fine, longest_fold(hazard, FOLDS, here, end, c))
    most = steepest(hazard, end, min(c, strength)) + abs(hard) * max(-pace, 0.0) / v
    quiet = -(np.log(hazard.attempts * end / v) + QUIET)
    h = min(h, max(fine, (quiet - exponent) / most if quiet > exponent else 0.0))
    lifetime = v / hazard.attempts * np.exp(-min(exponent, 0.0))
    return float(min(h, (1.5 + 0.15 * broken) * lifetime))


@inlined
def _fill_rates(
    hazard: Hazard,
    growth: Growth,
    strength: float,
    v: float,
    here: float,
    h: float,
    x: Floats,
    rate: Floats,
    along: Floats,
    older: Floats,
) -> None:
    """Fill in the nodes of a panel on the path of a contact, the breaking rate per
    distance there, and its slopes in the stretching and in ln v.
    """
    for j in range(NODES):
        x[j] = here + h * NODE[j]
        rate[j] = along[j] = older[j] = 0.0
        if hazard.attempts > 0.0:
            c, pace = _threshold(growth, strength, x[j] / v)
            exponent, steep, hard = log_rate(hazard, x[j], c)
            rate[j] = hazard.attempts / v * np.exp(min(exponent, 0.0))
            along[j] = rate[j] * steep
            older[j] = -rate[j] * hard * pace * x[j] / v


@inlined
def _cap(
    growth: Growth,
    strength: float,
    v: float,
    end: float,
    held: float,
) -> tuple[float, float, float]:
    """Return the stretching at which contacts meet their threshold, how many of those
    `held` up to there break then, and the slope of the stretching in ln v.
    """
    _, pace = _threshold(growth, strength, end / v)
    return end, held / (1.0 - pace / v), -held * pace * end / v / (1.0 - pace / v)


@jit
def _with_room(table: Floats, used: int, room: int) -> Floats:
    """Return a table with room for more columns."""
    larger = np.empty((len(table), room))
    larger[:, :used] = table[:, :used]
    return larger


@inlined
def _up_to_the_end(h: float, here: float, end: float) -> float:
    """Return the width of a panel, extended to the end if that is near."""
    if end - here - h < 1e-3 * h:
        h = end - here
    if here + h <= here:
        raise RuntimeError(
            "lifetimes: a panel has no width: a fault of this package, please report it"
        )
    return h


@jit
def march(
    hazard: Hazard,
    growth: Growth,
    strengths: Floats,
    weights: Floats,
    v: float,
) -> Lifetimes:
    """Compute the lives of contacts one threshold after the other, for barriers that no
    single variable describes.
    """
    room = 1024
    panels = 0
    nodes = 0
    width = np.empty(room)
    fresh = np.empty(room, np.bool_)
    table = np.empty((6, room * NODES))
    cap = np.zeros((3, strengths.size))
    integrated = np.empty(NODES)
    aged = np.empty(NODES)
    x = np.empty(NODES)
    rate = np.empty(NODES)
    along = np.empty(NODES)
    older = np.empty(NODES)
    for i in range(strengths.size):
        xi = strengths[i]
        part = weights[i]
        end = reach(growth, xi, v)
        if end <= 0.0:
            continue
        here = broken = late = pushed = 0.0
        # ends: a panel without a width raises
        while here < end and broken < QUIET:
            h = _panel(hazard, growth, xi, v, here, end, broken)
            h = _up_to_the_end(h, here, end)
            if panels == room:
                room *= 2
                width = np.append(width, np.empty(panels))
                fresh = np.append(fresh, np.empty(panels, np.bool_))
                table = _with_room(table, nodes, room * NODES)
            _fill_rates(hazard, growth, xi, v, here, h, x, rate, along, older)
            width[panels] = h
            fresh[panels] = here == 0.0
            for j in range(NODES):
                integrated[j] = broken + h * dot(INTEGRAL[j], rate)
                aged[j] = late + h * dot(INTEGRAL[j], older)
                survival = part * np.exp(-integrated[j])
                table[0, nodes] = x[j]
                table[1, nodes] = h * INTEGRAL[NODES - 1, j]
                table[2, nodes] = survival
                table[3, nodes] = survival * (integrated[j] - aged[j])
                table[4, nodes] = along[j]
                table[5, nodes] = survival * (pushed + h * dot(INTEGRAL[j], along))
                nodes += 1
            pushed += h * dot(INTEGRAL[NODES - 1], along)
            broken = integrated[NODES - 1]
            late = aged[NODES - 1]
            panels += 1
            here = end if h == end - here else here + h
        if broken < QUIET:
            cap[:, i] = _cap(growth, xi, v, end, part * np.exp(-broken))
    table = table[:, :nodes].copy()
    zero = np.zeros(nodes)
    return Lifetimes(
        width[:panels],
        fresh[:panels],
        table[0],
        table[1],
        table[2],
        table[3],
        zero,
        table[4],
        table[2],
        table[5],
        zero,
        cap[0],
        cap[1],
        cap[2],
    )


@jit
def relax(width: Floats, decay: Floats, source: Floats) -> Floats:
    """Solve ``R' = source - decay R``, ``R(0) = 0``; return R at the nodes of the
    panels.
    """
    found = np.empty(source.size)
    matrix = np.empty((NODES, NODES))
    value = np.empty(NODES)
    start = 0.0
    for k in range(width.size):
        h = width[k]
        at = k * NODES
        for i in range(NODES):
            value[i] = start
            for j in range(NODES):
                matrix[i, j] = h * INTEGRAL[i, j] * decay[at + j]
                value[i] += h * INTEGRAL[i, j] * source[at + j]
            matrix[i, i] += 1.0
        solve(matrix, value)
        for i in range(NODES):
            found[at + i] = value[i]
        start = value[NODES - 1]
    return found


@inlined
def _gone(z: complex) -> complex:
    """Return ``1 - exp(-z)`` without cancellation."""
    if abs(z.real) + abs(z.imag) > 1e-3:  # below, this would lose more than 1e-12
        return complex(1.0 - np.exp(-z))
    return z * (1.0 - z * (0.5 - z * (1.0 / 6.0 - z / 24.0)))


@jit
def _with_caps(
    lifetimes: Lifetimes,
    q: complex,
    fast: bool,
    breaks: complex,
    yields: complex,
) -> tuple[complex, complex]:
    """Add the breaks at the ends of lives, and their stretching."""
    for k in range(lifetimes.cap_x.size):
        gone = 1.0 + 0.0j if fast else _gone(q * lifetimes.cap_x[k])
        more = lifetimes.cap_weight[k] * gone
        breaks += more
        yields += lifetimes.cap_x[k] * more
    return breaks, yields


@jit
def _relaxed(lifetimes: Lifetimes, k: int, q: complex, start: complex) -> Complexes:
    """Solve ``U' = source - (q + decay) U`` in a panel, by collocation."""
    h = lifetimes.width[k]
    at = k * NODES
    matrix = np.empty((NODES, NODES), np.complex128)
    value = np.full(NODES, start)
    for i in range(NODES):
        for j in range(NODES):
            length = h * INTEGRAL[i, j]
            matrix[i, j] = length * (lifetimes.decay[at + j] + q)
            value[i] += length * lifetimes.source[at + j]
        matrix[i, i] += 1.0
    solve(matrix, value)
    return value


class _Undecayed(NamedTuple):
    """The solution of ``U' = source - q U`` in panels, in eigenvectors of the
    collocation: what the `source` feeds into each, shape (p, 8), and what each adds to
    the breaks and to their stretching.
    """

    fed: Complexes
    breaks: Complexes
    yields: Complexes


@jit
def _undecayed(lifetimes: Lifetimes) -> _Undecayed:
    """Return what the panels' solutions without decay have in common for all `q`."""
    shape = lifetimes.width.size, NODES
    fed = np.zeros(shape, np.complex128)
    breaks = np.zeros(shape, np.complex128)
    yields = np.zeros(shape, np.complex128)
    for k in range(lifetimes.width.size):
        for n in range(NODES):
            for j in range(NODES):
                i = k * NODES + j
                caused = lifetimes.weight[i] * lifetimes.push[i] * VECTORS[j, n]
                fed[k, n] += INVERSE[n, j] * lifetimes.source[i]
                breaks[k, n] += caused
                yields[k, n] += lifetimes.x[i] * caused
            fed[k, n] *= lifetimes.width[k] * PACE[n]
    return _Undecayed(fed, breaks, yields)


@jit
def _caused(
    panels: _Undecayed, k: int, z: complex, start: complex
) -> tuple[complex, complex, complex]:
    """Return the breaks that `U` causes in a panel without decay, their stretching,
    and `U` at its end.
    """
    breaks = 0.0j
    yields = 0.0j
    end = 0.0j
    for n in range(NODES):
        u = (start * UNIT[n] + panels.fed[k, n]) / (1.0 + z * PACE[n])
        breaks += panels.breaks[k, n] * u
        yields += panels.yields[k, n] * u
        end += VECTORS[NODES - 1, n] * u
    return breaks, yields, end


@jit
def _oscillating(
    lifetimes: Lifetimes,
    k: int,
    q: complex,
    start: complex,
    left: complex,
    fades: bool,
) -> Complexes:
    """What a panel adds over which ``exp(-q x)`` turns several times: all else is a
    polynomial, and the integrals of its powers times ``exp(-q x)`` are known.

    Returns the four transforms, then `U` and ``exp(-q x)`` at the end of the panel. If
    it `fades`, as contacts break over many of its turns, ``exp(-q x)`` counts at the
    start of the panel alone.
    """
    h = lifetimes.width[k]
    z = q * h
    at = k * NODES
    turned = 0.0j if fades else np.exp(-z)
    power = np.zeros(NODES + 1, np.complex128)  # integrals of the powers
    for n in range(NODES):
        power[n] = (n * power[n - 1] - turned) / z if n else (1.0 - turned) / z
    less = np.empty(NODES)  # exp of the integral of the decay
    smooth = np.zeros(NODES + 1, np.complex128)  # coefficients of U without exp(-q x)
    weight = np.zeros(NODES, np.complex128)
    for j in range(NODES):
        decayed = 0.0
        for i in range(NODES):
            decayed += h * INTEGRAL[j, i] * lifetimes.decay[at + i]
        less[j] = np.exp(-decayed)
    for n in range(NODES - 1, -1, -1):
        fed = 0.0j
        for j in range(NODES):
            fed += h * POWERS[n, j] * lifetimes.source[at + j] / less[j]
            weight[j] += h * POWERS[n, j] * power[n]
        smooth[n] = (fed - (n + 1) * smooth[n + 1]) / z
    turning = 0.0j if left == 0.0 else start - smooth[0]
    is_slaved = abs(np.log(less[NODES - 1])) > _DECAYS
    slaved = smooth[:NODES]
    if is_slaved:  # U follows its source, so that nothing turns
        turning = 0.0j
        slaved = _relaxed(lifetimes, k, q, start)
    found = np.zeros(6, np.complex128)
    for j in range(NODES):
        i = at + j
        x = lifetimes.x[i]
        value = 0.0j
        for n in range(NODES - 1, -1, -1):
            value = value * NODE[j] + smooth[n]
        value *= less[j]
        if is_slaved:
            value = slaved[j]
        more = lifetimes.weight[i] * lifetimes.push[i] * value
        more += weight[j] * turning * less[j] * lifetimes.push[i]
        more -= weight[j] * left * lifetimes.drop[i]
        more += (lifetimes.weight[i] - left * weight[j]) * lifetimes.meet[i]
        rest = left * weight[j] * lifetimes.survival[i]
        found[0] += lifetimes.weight[i] * lifetimes.survival[i] - rest
        found[1] += rest * x
        found[2] += more
        found[3] += more * x
        found[4] = value
    found[4] += less[NODES - 1] * turning * turned
    found[5] = left * turned
    return found


@jit
def perturbed(lifetimes: Lifetimes, q: Complexes, fast: bool = False) -> Complexes:
    """Return the transforms of a life under a perturbation, at each `q`, shape (4, n):
    ``M_0 - Sq``, ``W``, ``L``, ``Y``.

    They are what the survival loses under ``exp(-q x)``, the first moment of the rest,
    the breaks that the perturbation causes, and the stretching of these breaks. With
    `fast`, contacts break over many turns of ``exp(-q x)``, which then counts at
    ``x = 0`` alone.
    """
    found = np.zeros((4, q.size), np.complex128)
    value = np.empty(NODES, np.complex128)
    turn = np.empty(NODES, np.complex128)
    thermal = bool(np.any(lifetimes.push != 0.0))
    decays = thermal and bool(np.any(lifetimes.decay != 0.0))
    undecayed = _undecayed(lifetimes)
    for m, here in enumerate(q):
        size = abs(here)
        start = 0.0j
        left = 1.0 + 0.0j
        lost = 0.0j
        work = 0.0j
        breaks = 0.0j
        yields = 0.0j
        for k in range(lifetimes.width.size):
            h = lifetimes.width[k]
            at = k * NODES
            if lifetimes.fresh[k]:
                start = 0.0j
                left = 1.0 + 0.0j
            if size * h > _RESOLVED:
                # the turns at its end are left out with an error of a panel's order
                fades = fast and size * h > 2.0 * _RESOLVED
                turned = _oscillating(lifetimes, k, here, start, left, fades)
                found[:, m] += turned[:4]
                start = turned[4]
                left = turned[5]
                continue
            for j in range(NODES):
                turn[j] = np.exp(-here * h * NODE[j])
            if decays:
                value = _relaxed(lifetimes, k, here, start)
                start = value[NODES - 1]
            elif thermal:
                more = _caused(undecayed, k, here * h, start)
                breaks += more[0]
                yields += more[1]
                start = more[2]
            for i in range(at, at + NODES):
                x = lifetimes.x[i]
                weight = lifetimes.weight[i]
                # 1 - exp(-q x), with the exponential multiplied up over the panels
                gone = 1.0 - left * turn[i - at]
                if size * x < 1e-3:
                    gone = _gone(here * x)
                lost += weight * lifetimes.survival[i] * gone
                work += weight * lifetimes.survival[i] * x * (1.0 - gone)
                caused = lifetimes.meet[i] * gone
                if decays:
                    caused += lifetimes.push[i] * value[i - at]
                if thermal:
                    caused -= lifetimes.drop[i] * (1.0 - gone)
                breaks += weight * caused
                yields += weight * x * caused
            left *= turn[NODES - 1]
        breaks, yields = _with_caps(lifetimes, here, fast, breaks, yields)
        found[0, m] += lost
        found[1, m] += work
        found[2, m] += breaks
        found[3, m] += yields
    return found
