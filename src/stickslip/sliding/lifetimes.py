"""Lives of contacts in steady sliding that break by thermal activation, or whose
thresholds grow by a fixed rule.

Steady sliding follows from the life of one contact, from attachment to break: the force
is its mean work over its mean length, and the linear response is the change of both by
a small perturbation. The lives are computed once for an interface and a speed;
`stickslip.sliding.activated` evaluates them.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from stickslip.arrays import Array
from stickslip.kernels import lifetimes as kernel
from stickslip.kernels.hazard import (
    BARRIER,
    BELL,
    EXPONENTIAL,
    FIXED,
    LOG_AGE,
    LOGARITHMIC,
    NONE,
    PARABOLIC,
    TABULATED,
    Growth,
    Hazard,
    growing_time,
    is_separable,
    stretching_with,
    taken_off,
)
from stickslip.kernels.lifetimes import INTEGRAL, NODE, Lifetimes, relax, rule
from stickslip.loops import bounded
from stickslip.model import (
    AgeingModel,
    Barrier,
    Bell,
    ExponentialGrowth,
    Interface,
    LogarithmicGrowth,
    Parabolic,
    TabulatedGrowth,
)
from stickslip.model.activation import ActivationModel
from stickslip.model.distribution import Distribution, nodes_between
from stickslip.model.records import hashable


def lifetimes_of(
    interface: Interface,
    velocity: float,
    highest: float = 0.0,
) -> Lifetimes:
    """Return the lives of contacts in steady sliding at a speed, for perturbations with
    wave numbers up to `highest`.
    """
    contacts = map(
        hashable,
        (interface.threshold_distribution, interface.activation, interface.ageing),
    )
    # Panel widths are powers of 2, so that few different sets are computed and cached.
    longest = 2.0 ** math.floor(math.log2(4.0 / max(highest, 4.0)))
    return _lifetimes(*contacts, float(velocity), longest)


@lru_cache(maxsize=128)
def _lifetimes(
    distribution: Distribution,
    activation: ActivationModel | None,
    ageing: AgeingModel | None,
    velocity: float,
    longest: float,
) -> Lifetimes:
    low, high = distribution.support
    inner = [knot for knot in distribution.knots if low + 1e-9 < knot < high - 1e-9]
    growth = growth_of(ageing)
    hazard = hazard_of(activation)
    # stretching over which the rate grows by a factor e
    width = hazard.width / float(taken_off(hazard, np.array(distribution.moment(1)))[0])
    one_variable = activation is None or (
        is_separable(hazard, growth)
        and distribution.standard_deviation() > 2.0 * width
        and not inner
    )
    if one_variable and not distribution.single:
        return _in_one(distribution, hazard, ageing, velocity)
    bends = []
    if isinstance(activation, Bell):
        bend = activation.width * math.log1p(
            activation.attempts * activation.width / velocity
        )
        bends = [(bend, activation.width)]
    if isinstance(ageing, ExponentialGrowth) and ageing.newborn == 0.0:
        # weaker contacts break at once, stronger ones soon
        bends.append((velocity / ageing.rate, 0.01))
    unlikely = float(distribution.inverse_survival(_UNLIKELY))

    def longest_panel(strength: float) -> float:
        """Longest panel of thresholds: waves turn over it twice as far as over one of
        a life, and the errors of eight nodes are 1e-8.
        """
        return math.inf if strength > unlikely else 2.0 * longest

    return kernel.march(
        hazard,
        growth,
        *threshold_nodes(distribution, 0.01, bends, longest_panel),
        velocity,
    )


# fraction of contacts that need not be resolved: below the errors of the table of lives
_UNLIKELY = 1e-4


def threshold_nodes(
    distribution: Distribution,
    first: float,
    places: list[tuple[float, float]],
    longest: Callable[[float], float] = lambda _: math.inf,
) -> tuple[Array, Array]:
    """Nodes of thresholds and their weights, on panels of the size `first` at the
    start, finer near some places, and nowhere longer than `longest` there.
    """
    if distribution.single:
        return np.array([distribution.moment(1)]), np.ones(1)
    start = max(distribution.support[0], 0.0)
    places = [(start, first), *((knot, 0.05) for knot in distribution.knots), *places]
    x, weight = gauss_nodes(
        panel_edges(distribution, start, distribution.support[1], places, longest)
    )
    weight = weight * distribution.density(x)
    met = weight > 1e-14 * weight.sum()
    return x[met], weight[met]


def hazard_of(activation: ActivationModel | None) -> Hazard:
    """Return the constants of thermal activation for kernels; without it, those of a
    contact that never attempts to break.
    """
    match activation:
        case Bell(width=width, attempts=attempts):
            return Hazard(BELL, attempts, width, 1.0, 1.0, 0.0)
        case Parabolic(temperature=width, attempts=attempts):
            return Hazard(PARABOLIC, attempts, width, 1.0, 1.0, 0.0)
        case Barrier(height=height, attempts=attempts, power=power, kramers=kramers):
            return Hazard(BARRIER, attempts, 1.0, height, power, float(kramers))
    return NONE


def growth_of(ageing: AgeingModel | None) -> Growth:
    """Return the constants of a growth law for kernels, also for thresholds that do not
    grow.
    """
    match ageing:
        case ExponentialGrowth(rate=rate, newborn=newborn):
            return Growth(EXPONENTIAL, rate, newborn)
        case LogarithmicGrowth(slope=slope, time=time):
            return Growth(LOGARITHMIC, slope, time)
        case TabulatedGrowth(ages=ages):
            return Growth(TABULATED, ages[-1], ages[0], ageing.table)
    return FIXED


_PANELS = 100_000  # most panels, which take 100 MB with their nodes; hundreds are usual


def panel_edges(
    distribution: Distribution,
    start: float,
    end: float,
    places: list[tuple[float, float]],
    steepest: Callable[[float], float] = lambda _: math.inf,
) -> Array:
    """Ends of panels: proportional to the width of the distribution, and finer towards
    each place, down to its scale.

    `steepest` returns the longest panel allowed at a place.
    """
    inner, middle, outer = distribution.inverse_survival(
        np.array([0.84, 0.5, 0.16])
    ).tolist()
    core = 0.25 * (outer - inner)
    fine = sorted((place, scale) for place, scale in places if start <= place <= end)
    edges = [start]
    turns = bounded("panel_edges", _PANELS)
    while edges[-1] < end:
        next(turns)
        x = edges[-1]
        step = min(max(core, 0.12 * abs(x - middle)), steepest(x), end - x)
        for place, scale in fine:
            step = min(step, 0.6 * scale + 0.5 * abs(x - place))
            if x < place < x + step:
                step = place - x
        edges.append(end if end - x - step < 1e-3 * step else x + step)
    return np.array(edges)


def gauss_nodes(edges: Array, count: int = 8) -> tuple[Array, Array]:
    """Gauss nodes and weights on panels between neighbours along the last axis."""
    x, weight = nodes_between(edges[..., :-1], edges[..., 1:], count)
    each_row = (*edges.shape[:-1], -1)
    return x.reshape(each_row), weight.reshape(each_row)


def _radau(edges: Array) -> tuple[Array, Array, Array]:
    """Widths of panels, and their Radau nodes and weights."""
    width = np.diff(edges)
    inside = np.minimum(NODE, 1.0 - 1e-12)  # a density may jump at the end of a panel
    return (
        width,
        (edges[:-1, None] + width[:, None] * inside).ravel(),
        (width[:, None] * INTEGRAL[-1]).ravel(),
    )


# slope of ageing over the activation width, up to which the decrease of the rate after
# birth is resolved
_FOLLOWED = 60.0


@lru_cache(maxsize=128)
def _in_one(
    distribution: Distribution,
    hazard: Hazard,
    ageing: AgeingModel | None,
    v: float,
) -> Lifetimes:
    """Lives of all contacts together: for a barrier that is linear or parabolic in the
    stretching, or without thermal activation.

    The hazard up to ``x`` is ``G(x) exp(-xi/A)``, so the survival for every threshold
    ``xi`` depends on ``G`` alone. With a parabolic barrier ``xi**2/2`` replaces ``xi``,
    and the temperature replaces ``A``.
    """
    growth = growth_of(ageing)
    low, high = distribution.support
    A = hazard.width
    # Even the strongest contacts break as soon as they attach: there are no lifetimes.
    if kernel.reach(growth, high, v) <= 0:
        return kernel.march(
            hazard,
            growth,
            np.empty(0),
            np.empty(0),
            v,
        )
    edges = _edges_in_one(distribution, hazard, growth, v)
    # With panels half as wide as the integrals need, polynomials also interpolate
    # between the nodes to 1e-8.
    width, x, weight = _radau(np.union1d(edges, 0.5 * (edges[1:] + edges[:-1])))
    strength, steeper, later = _met(growth, x, v)
    capped = np.maximum(strength, low)
    density = np.where(strength >= low, distribution.density(capped), 0.0)
    zero = np.zeros_like(x)
    if hazard.attempts > 0:
        reached, shape, aged, decay = _reached(hazard, growth, v, width, x)
        source, _ = taken_off(hazard, x)
        bottom, top = (
            (reached - taken_off(hazard, np.array(end))[1]) / A
            for end in (high, capped)
        )
        z, part = under_gumbel(np.maximum(bottom, -38.0), np.minimum(top, 4.0))
        xi = reached[:, None] - A * z
        xi = stretching_with(hazard, xi, capped[:, None])
        ended = np.exp(-np.exp(np.minimum(top, 4.0)))
        survival = distribution.survival(capped) * ended + np.sum(
            part * distribution.survival(xi), axis=1
        )
        broken = (
            A
            * np.sum(part * distribution.density(xi) / taken_off(hazard, xi)[0], axis=1)
            / shape
        )
        density = density * ended
        slope = (shape - aged) * broken
        push = broken / A
        drop = broken * relax(width, decay, source) / A
    else:
        survival = distribution.survival(np.maximum(strength, 0.0))
        source = np.ones_like(x)
        slope = push = drop = decay = zero
    slope = slope - np.where(strength > 0, density * later, 0.0)
    meet = density * np.where(strength > 0, steeper, 0.0)
    none = np.empty(0)
    fresh = np.arange(width.size) == 0
    return kernel.Lifetimes(
        width,
        fresh,
        x,
        weight,
        survival,
        slope,
        decay,
        source,
        push,
        drop,
        meet,
        none,
        none,
        none,
    )


def _edges_in_one(
    distribution: Distribution,
    hazard: Hazard,
    growth: Growth,
    v: float,
) -> Array:
    """Ends of panels for all contacts together, up to where the strongest have
    broken.
    """
    low, high = distribution.support
    A = hazard.width
    weakest = max(low, 0.0)
    shortest = _shortest(distribution, hazard, growth, v)
    # at a high speed all contacts break within a small part of the panels that suit
    # their strengths
    if hazard.attempts == 0:
        strengths = panel_edges(
            distribution,
            weakest,
            high,
            [(weakest, shortest), *((knot, 0.05) for knot in distribution.knots)],
        ).tolist()
        met = {0.0, *(kernel.reach(growth, strength, v) for strength in strengths)}
        # a table is smooth between its nodes only
        nodes = v * np.exp(growth.table[LOG_AGE])
        return np.array(sorted({*met, *nodes[nodes < max(met)].tolist()}))

    def follow(x: float) -> float:
        """Longest panel at a place; limited while the rate still depends on that at
        birth, as a decay must be resolved.
        """
        factor, addend, _, more = map(
            float, kernel.rule(growth, np.array([x / v]))[:, 0]
        )
        strength = (x - addend) / factor
        steep, height = map(float, taken_off(hazard, np.array(strength)))
        if height > 40.0 * A or (strength < 0.0 and growth.first > _FOLLOWED * A):
            return math.inf
        return 2.5 * A / max(abs(steep - more / v), 0.4)

    end = kernel.reach(growth, high, v)
    places = [(0.0, shortest)]
    if distribution.knots:
        # The stretching at which contacts with the threshold of the knot break, from a
        # first set of panels.
        width, x, _ = _radau(panel_edges(distribution, 0.0, end, places, follow))
        reached = _reached(hazard, growth, v, width, x)[0]
        knots = taken_off(hazard, np.array(distribution.knots))[1]
        places += [
            (float(np.interp(knot, reached, x)), A)
            for knot in knots
            if knot < reached[-1]
        ]
    places += [
        (kernel.reach(growth, knot, v), A)
        for knot in distribution.knots
        if knot > 0 or growth.first > 0.0
    ]
    edges = panel_edges(distribution, 0.0, end, places, follow)
    # Almost all contacts have broken long before the strongest meet their thresholds.
    width, x, _ = _radau(edges)
    last = np.minimum(distribution.inverse_survival(math.exp(-kernel.QUIET)), high)
    broken = np.searchsorted(
        _reached(hazard, growth, v, width, x)[0], taken_off(hazard, last)[1] + 4.0 * A
    )
    return edges[: min(int(broken) // kernel.NODES + 3, edges.size)]


def _shortest(
    distribution: Distribution,
    hazard: Hazard,
    growth: Growth,
    v: float,
) -> float:
    """Length over which the survival or the threshold of a newborn may change."""
    lengths = [0.05 * distribution.standard_deviation()]
    if hazard.attempts > 0:
        # The rate of the weakest contacts, except one in 1e8, hardly grows while it is
        # near the attempt rate.
        weakest = np.maximum(distribution.inverse_survival(1.0 - 1e-8), 0.0)
        quiet = min(float(taken_off(hazard, weakest)[1]) / hazard.width, 40.0)
        lengths += [hazard.width, v / hazard.attempts * math.exp(quiet)]
    if growth.first > 0.0:
        lengths.append(v * growing_time(growth))
    return max(min(lengths), 1e-9)


def _met(growth: Growth, x: Array, v: float) -> tuple[Array, Array, Array]:
    """Strength whose threshold is met at a stretching, its derivative by the threshold,
    and that by ln v.
    """
    age = x / v
    factor, addend, steeper, more = rule(growth, age)
    strength = (x - addend) / factor
    return strength, 1.0 / factor, age * (more + strength * steeper) / factor


def _reached(
    hazard: Hazard,
    growth: Growth,
    v: float,
    width: Array,
    x: Array,
) -> tuple[Array, Array, Array, Array]:
    """Return ``u = A ln G``; with ``rho = G'``, ``G/rho``, the same for the slope by
    age, and ``rho'/rho``.
    """
    A = hazard.width
    age = x / v
    _, addend, _, slope = rule(growth, age)
    # A decrease of the rate after birth that is too sharp to be resolved is omitted: it
    # concerns only weak contacts at their birth.
    steep, height = taken_off(hazard, x)
    decay = np.maximum(
        (steep - slope / v) / A, -np.inf if growth.first < _FOLLOWED * A else 0.0
    )
    shape = relax(width, decay, np.ones_like(x))
    aged = (
        relax(width, decay, slope * age / A) if growth.first > 0.0 else np.zeros_like(x)
    )
    reached = (
        height - addend + A * np.log(hazard.attempts / v * np.maximum(shape, 1e-300))
    )
    return reached, shape, aged, decay


def under_gumbel(low: Array, high: Array) -> tuple[Array, Array]:
    """Nodes and weights for a smooth function times ``exp(z - exp(z))`` between two
    bounds, shape (n, 64).
    """
    high = np.maximum(high, low)
    z, weight = gauss_nodes(np.stack([low, np.clip(-6.0, low, high), high], axis=1), 32)
    return z, weight * np.exp(z - np.exp(z))


def blurred_survival(
    survival: Callable[[Array], Array],
    width: float,
    u: Array,
    knots: Sequence[float],
) -> Array:
    """Survival of a newborn of any threshold at ``u = A ln G``: thresholds blurred by a
    Gumbel distribution.

    It is the mean of their survival ``J_c(u - A s)``, a function of flat arrays, over
    ``s = ln E`` with ``E`` drawn from ``exp(-E)``; it has corners where the density
    jumps, at the `knots`.
    """
    low = -38.0
    high = 3.7
    corners = np.array([knot for knot in knots if math.isfinite(knot)])
    # between these bounds the weight exp(s - exp(s)) is more than rounding
    found = np.empty(u.size)
    for part in np.array_split(np.arange(u.size), 1 + u.size // 512):
        at = u.ravel()[part, None]
        edges = np.tile(np.linspace(low, high, 24), (part.size, 1))
        edges = np.sort(
            np.concatenate([edges, np.clip((at - corners) / width, low, high)], axis=1),
            axis=1,
        )
        s, weight = gauss_nodes(edges, 16)
        weight = weight * np.exp(s - np.exp(s))
        known = survival(np.maximum(at - width * s, 0.0).ravel()).reshape(s.shape)
        found[part] = np.sum(known * weight, axis=1) / weight.sum(axis=1)
    return found.reshape(u.shape)
