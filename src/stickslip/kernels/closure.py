"""The paper's closure of the master equation for ageing contacts, Eqs. (1)-(3) with Eq. (18): for comparison only.

It keeps one distribution of thresholds for all contacts, whatever their stretching, and so drops the correlation
between age and stretching. `langevin_steady`, `langevin_contacts` and `langevin_density` do not.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import jit
from .langevin import Langevin, bernoulli
from .oscillator import Load
from .stepping import COLUMNS, LOSS, Course, begin, fill, goes_on, keep, plan, settle

Floats = NDArray[np.float64]

# A further entry of the state: number of cohorts.
COHORTS = 4

# Largest step of a free oscillation of the slider, in radians.
_ANGLE = 0.35


class Cohorts(NamedTuple):
    """Slider positions at which cohorts have stretching 0, and their fractions of contacts; with room for more."""

    place: Floats
    weight: Floats


class Thresholds(NamedTuple):
    """Edges of the cells of threshold, of `threshold_edges`, and the fraction of contacts in each, sum 1."""

    edges: Floats
    mass: Floats


class Rates(NamedTuple):
    """Rates of ageing between the cells of threshold: ``up[i]`` from cell i to i+1, ``down[i]`` to i-1."""

    up: Floats
    down: Floats


@jit
def threshold_edges(langevin: Langevin, cells: float) -> Floats:
    """Edges of `cells` of threshold per standard deviation, eight times as many near zero; the last lies beyond all."""
    end = max(langevin.mean, langevin.newborn) + 8.0 * langevin.std
    widest = langevin.std / cells
    width = widest if langevin.newborn > 0.0 else widest / 8.0
    edges = np.empty(int(end / widest) + 100)
    edges[0] = 0.0
    k = 0
    while edges[k] < end and k + 1 < edges.size:
        edges[k + 1] = edges[k] + width
        width = min(1.06 * width, widest)
        k += 1
    return edges[: k + 1].copy()


@jit
def _cell(edges: Floats, place: float) -> int:
    """Cell that holds a place; the first or the last for places outside."""
    return min(max(int(np.searchsorted(edges, place, side="right")) - 1, 0), edges.size - 2)


@jit
def threshold_rates(edges: Floats, langevin: Langevin) -> Rates:
    """Rates between cells of threshold, no way out at either end; stationary for the Gaussian of Eq. (17)."""
    n, square, D = edges.size - 1, langevin.rate * langevin.rate, (langevin.rate * langevin.std) ** 2
    up, down = np.zeros(n + 1), np.zeros(n + 1)
    for i in range(n - 1):
        h = 0.5 * (edges[i + 2] - edges[i])
        a = square * (langevin.mean - edges[i + 1])
        flow = D / h * bernoulli(a * h / D)
        up[i] = (flow + a) / (edges[i + 1] - edges[i])
        down[i + 1] = flow / (edges[i + 2] - edges[i + 1])
    return Rates(up, down)


@jit
def relax(mass: Floats, rates: Rates, dt: float) -> None:
    """Implicit step of thresholds that only age; `mass` is changed in place."""
    n, up, down = mass.size, rates.up, rates.down
    back = np.zeros(n + 1)
    known = 0.0
    for i in range(n):
        pivot = 1.0 + dt * (up[i] + down[i])
        if i > 0:
            pivot -= dt * up[i - 1] * back[i - 1]
            known = (mass[i] + dt * up[i - 1] * known) / pivot
        else:
            known = mass[i] / pivot
        mass[i] = known
        back[i] = dt * down[i + 1] / pivot
    for i in range(n - 2, -1, -1):
        mass[i] += back[i] * mass[i + 1]


@jit
def closure_friction(velocity: Floats, langevin: Langevin, cells: float = 20.0) -> Floats:
    """Force per contact in smooth sliding by the paper's closure, Eqs. (1)-(3) with (18). An approximation.

    Against `langevin_steady.steady_friction` the force is 23 % too large at u = .01, 9 % too small at .5 and 28 % too
    small at 1 (standard deviation .1). In the steady state ``Q = Gamma J_c``, and P_c is the distribution of a
    threshold that has aged for an exponential time of rate ``Gamma v``; Gamma follows from ``Gamma <x_s> = 1`` by
    bisection. Thresholds are kept above 0.
    """
    edges = threshold_edges(langevin, cells)
    n = edges.size - 1
    rates, mass = threshold_rates(edges, langevin), np.zeros(n)
    birth = _cell(edges, langevin.newborn)
    force = np.zeros(velocity.size)
    for k in range(velocity.size):
        low, high = np.log(0.1 / edges[n]), np.log(10.0 / (0.5 * edges[1]))
        second = 0.0
        for _ in range(60):
            gamma = np.exp(0.5 * (low + high))
            mass[:] = 0.0
            mass[birth] = 1.0
            relax(mass, rates, 1.0 / (gamma * abs(velocity[k])))
            first, second = 0.0, 0.0
            for i in range(n):
                a, b = edges[i], edges[i + 1]
                first += mass[i] * 0.5 * (a + b)
                second += mass[i] * (a * a + a * b + b * b) / 3.0
            if gamma * first > 1.0:
                high = np.log(gamma)
            else:
                low = np.log(gamma)
        force[k] = np.sign(velocity[k]) * 0.5 * np.exp(0.5 * (low + high)) * second
    return force


@jit
def _break(cohorts: Cohorts, count: int, start: float, X: float, thresholds: Thresholds) -> tuple[int, float, Floats]:
    """Take the cohorts from a slider position `start` to `X`; each loses the fraction ``1 - J_c(x + dx)/J_c(x)``.

    Returns how many cohorts are left, what has broken, and how often each cell of threshold has been met.
    """
    place, weight, edges, mass = cohorts.place, cohorts.weight, thresholds.edges, thresholds.mass
    n = edges.size - 1
    beyond, swept = np.zeros(n + 1), np.zeros(n)
    for i in range(n - 1, -1, -1):
        beyond[i] = beyond[i + 1] + mass[i]
    broken, kept = 0.0, 0
    for c in range(count):
        a, b = abs(start - place[c]), abs(X - place[c])
        if (X - place[c]) * (start - place[c]) < 0.0:
            a = 0.0
        if b > a:
            i = _cell(edges, a)
            held = beyond[i] - mass[i] * (a - edges[i]) / (edges[i + 1] - edges[i])
            fraction = weight[c] / held if held > 1e-14 else 0.0
            gone = 0.0
            while i < n and edges[i] < b:
                part = (min(b, edges[i + 1]) - max(a, edges[i])) / (edges[i + 1] - edges[i])
                swept[i] += fraction * part
                gone += fraction * part * mass[i]
                i += 1
            if held <= 1e-14 or b >= edges[n]:
                gone = weight[c]
            gone = min(gone, weight[c])
            weight[c] -= gone
            broken += gone
        if weight[c] < 1e-14:
            broken += weight[c]
            continue
        place[kept], weight[kept] = place[c], weight[c]
        kept += 1
    return kept, broken, swept


@jit
def advance_closure(
    state: Floats, cohorts: Cohorts, thresholds: Thresholds, course: Course, langevin: Langevin
) -> Floats:
    """Advance the paper's closure, Eqs. (1)-(3) with (18), and the slider. An approximation.

    Q is kept as cohorts, which break as the slider moves; the distribution of thresholds loses the same at the same
    place, ages, and what has broken re-attaches at the newborn's threshold. `state`, `cohorts` and the mass are
    changed; once the arrays are full the course breaks off. Returns the samples at the times that were reached.
    """
    place, weight, mass = cohorts.place, cohorts.weight, thresholds.mass
    rates, birth = threshold_rates(thresholds.edges, langevin), _cell(thresholds.edges, langevin.newborn)
    here, count, F = begin(course, state), int(state[COHORTS]), 0.0
    for c in range(count):
        F += weight[c] * (here.X - place[c])
    reached = here.X  # where the contacts have been moved to
    samples = np.empty((course.times.size, COLUMNS))
    load = Load(F, 1.0, state[LOSS], 0.0)
    filled, taken = fill(course, samples, 0, here, load, here.time, np.sum(weight[:count])), 0
    while count < place.size and goes_on(course, samples, filled, taken):
        guess, stroke = plan(course, filled, here, load, _ANGLE)
        if stroke.end > course.look:
            break
        taken += 1
        relax(mass, rates, stroke.dt)
        count, broken, swept = _break(cohorts, count, reached, guess.X, thresholds)
        for i in range(mass.size):  # as e^-swept: what stays is positive
            part = -mass[i] * np.expm1(-swept[i])
            mass[i] -= part
            mass[birth] += part
        # Attached all through the step: on average in its middle.
        place[count], weight[count] = 0.5 * (reached + guess.X), broken
        count += 1
        total = 0.0
        for c in range(count):
            total += weight[c] * (guess.X - place[c])
        loss = (load.force + guess.X - here.X - total) / stroke.dt
        reached, load = guess.X, Load(load.force, 1.0, loss, 0.0)
        there = settle(course, here, guess, load, stroke.dt)
        filled = fill(course, samples, filled, here, load, there.time, np.sum(weight[:count]))
        here, load = there, Load(total + (there.X - reached), 1.0, loss, 0.0)
    keep(state, here, load.loss)
    state[COHORTS] = float(count)
    return samples[:filled]
