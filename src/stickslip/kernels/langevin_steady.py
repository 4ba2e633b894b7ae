"""Ageing contacts at constant velocity, N to infinity: all lives have the same
statistics, so one life gives all averages.
"""

import numpy as np

from ._jit import jit
from .hazard import NONE, Hazard, log_rate, rate
from .langevin import (
    Langevin,
    Life,
    graded_nodes,
    life_at,
    longest_age,
    margin_nodes,
    margin_rates,
)
from .langevin_survival import P, interpolate, panel_edges, survive
from .quadrature import gauss
from .records import Floats

_GAUSS, _WEIGHT = gauss(8)

# the cells are this much finer than the standard deviation over the length in which the
# rate grows by a factor of e
RATIO = 0.2


@jit
def life_moments(
    life: Life,
    cells: int,
    steps: int,
    hazard: Hazard = NONE,
    mean: float = 1.0,
    time: float = 1.0,
) -> tuple[float, float]:
    """Return the moments of one life at one resolution: cells of the margin and steps
    of the age; see `steady_moments`.
    """
    u = life.u
    delta = life.delta
    z = margin_nodes(life, cells)
    age = graded_nodes(longest_age(life), steps, 2.0 / steps)
    m = z.size - 1
    c0 = (1.0 - u) / delta
    r = u / delta
    up = np.zeros(m + 1)
    down = np.zeros(m + 1)
    upper = np.zeros(m + 1)
    # remaining life and work, as functions of the margin
    left = np.zeros(m + 1)
    work = np.zeros(m + 1)
    b0 = np.zeros(m + 1)
    b1 = np.zeros(m + 1)
    out = np.zeros(m + 1)
    for j in range(steps - 1, -1, -1):
        da = age[j + 1] - age[j]
        middle = 0.5 * (age[j + 1] + age[j])
        margin_rates(z, c0 - r * middle, up, down)
        if hazard.attempts > 0.0:
            x = mean * u * middle
            for i in range(1, m + 1):
                out[i] = time * rate(hazard, x, x + mean * delta * z[i])
        # Crank-Nicolson oscillates after the abrupt start. Implicit steps damp that, at
        # the oldest ages, which hardly any contact reaches.
        implicit = 0.5 if j < steps - 8 else 1.0
        explicit = (1.0 - implicit) * da
        implicit *= da
        for i in range(1, m + 1):
            k = min(i + 1, m)
            b0[i] = (
                left[i]
                + explicit
                * (down[i] * (left[i - 1] - left[i]) + up[i] * (left[k] - left[i]))
                + da
            )
            b1[i] = (
                work[i]
                + explicit
                * (down[i] * (work[i - 1] - work[i]) + up[i] * (work[k] - work[i]))
                + da * u * middle
            )
            b0[i] -= explicit * out[i] * left[i]
            b1[i] -= explicit * out[i] * work[i]
            below = implicit * down[i]
            pivot = 1.0 / (
                1.0 + below + implicit * (up[i] + out[i]) - below * upper[i - 1]
            )
            b0[i] = (b0[i] + below * b0[i - 1]) * pivot
            b1[i] = (b1[i] + below * b1[i - 1]) * pivot
            upper[i] = implicit * up[i] * pivot
        left[m] = b0[m]
        work[m] = b1[m]
        for i in range(m - 1, 0, -1):
            left[i] = b0[i] + upper[i] * left[i + 1]
            work[i] = b1[i] + upper[i] * work[i + 1]
    if life.newborn > 0.0:
        start = life.newborn / delta
        return float(np.interp(start, z, left)), float(np.interp(start, z, work))
    # Slopes at the boundary, from W'' + c W' + g = 0 there, with g = 1 for the life and
    # 0 for the work.
    h = z[1]
    slope = 1.0 / (h * (1.0 - 0.5 * c0 * h))
    return (left[1] + 0.5 * h * h) * slope, work[1] * slope


@jit
def _resolution(life: Life, cells: int, steepest: float) -> tuple[int, int]:
    """Return the cells of the margin and the steps of the age that keep the accuracy
    the same everywhere.

    A narrow distribution makes thin layers, a newborn that must come down to its
    boundary makes a travelling pulse, a barrier adds a layer set by its `steepest`
    rate, and slow sliding takes many times 1/rate^2.
    """
    peclet = life.newborn * max(life.u - 1.0, 0.0) / life.delta**2
    more = min(
        max(1.0, 0.1 / life.delta, peclet / 60.0, RATIO * life.delta * steepest), 16.0
    )
    margins = int(cells * more)
    return margins, margins * (4 if life.u < 0.02 else 2)


@jit
def steady_moments(
    life: Life,
    cells: int,
    hazard: Hazard = NONE,
    mean: float = 1.0,
    time: float = 1.0,
) -> tuple[float, float]:
    """Return the moments of one life of a contact in sliding at constant velocity, from
    the kinetic equation, Eqs. (13)-(17).

    With ``a`` the age in units of 1/rate^2 and ``S(a)`` the survivors, the moments are
    ``int S da`` and ``int u a S da``; their ratio is the mean stretching of attached
    contacts in units of the mean threshold. For a newborn without strength they are
    those of an excursion, per unit of its entrance measure (their slope in the margin,
    in units of the standard deviation).

    The backward (adjoint) equation is solved: the remaining life and work, as functions
    of age and margin, are smooth where the density is singular. Chang-Cooper /
    Scharfetter-Gummel rates in the margin, Crank-Nicolson in the age, and one
    Richardson extrapolation: 100 cells give 1e-5 for 1e-5 <= u <= 50 and delta >= 0.1.
    `mean` and `time` (``1/rate**2``) give the units of the hazard.
    """
    steepest = (
        mean * abs(log_rate(hazard, 0.5 * mean, mean)[2])
        if hazard.attempts > 0.0
        else 0.0
    )
    margins, steps = _resolution(life, cells, steepest)
    coarse, coarse_work = life_moments(life, margins, steps, hazard, mean, time)
    fine, fine_work = life_moments(life, 2 * margins, 2 * steps, hazard, mean, time)
    # The error of the ratio is extrapolated, not those of its parts, which share most
    # of it.
    ratio = (4.0 * fine_work / fine - coarse_work / coarse) / 3.0
    fine += (fine - coarse) / 3.0
    return fine, ratio * fine


@jit
def steady_friction(
    velocity: Floats,
    langevin: Langevin,
    delay: float = 0.0,
    cells: int = 100,
    hazard: Hazard = NONE,
) -> Floats:
    """Return the force per contact in smooth sliding at velocities other than 0, N to
    infinity, from Eqs. (13)-(17).

    Over the mean threshold it is a function of ``u = velocity/(rate^2 mean)`` alone, if
    there is no delay; it falls as ``std^2/mean u/(u-1)^2`` at large u. With
    ``newborn = 0`` and a mean `delay` no contact ever holds.
    """
    force = np.zeros(velocity.size)
    time = 1.0 / (langevin.rate * langevin.rate)
    for i in range(velocity.size):
        if delay > 0.0 and langevin.newborn <= 0.0:
            continue
        life, work = steady_moments(
            life_at(velocity[i], langevin),
            cells,
            hazard,
            langevin.mean,
            time,
        )
        force[i] = np.sign(velocity[i]) * langevin.mean * work / (life + delay / time)
    return force


@jit
def pull_newborns(
    velocity: float,
    langevin: Langevin,
    distance: float,
    points: int,
) -> tuple[Floats, Floats]:
    """Return the force while contacts that were all newborn at the start are dragged at
    constant velocity, Eqs. (7), (13)-(17).

    Lifetimes at constant velocity have one distribution, so attachments (counted by
    local time) are a renewal process: ``attachments * S = 1`` and
    ``F = attachments * (v a S)``, with the survivors S by age of the stationary
    solution and ``*`` the convolution; ``max(-dF/dX)`` is the effective stiffness of
    Fig. 11. Newborns have no strength. Returns displacements and forces.
    """
    life = life_at(velocity, Langevin(langevin.rate, langevin.mean, langevin.std, 0.0))
    u = life.u
    mean = langevin.mean
    ages = np.linspace(0.0, distance / mean / u, points + 1)
    lifetimes, works = _integrals_by_age(life, ages)
    attachments = np.zeros(points)
    force = np.zeros(points)
    for i in range(points):
        known = 0.0
        for j in range(i):
            known += attachments[j] * (lifetimes[i - j + 1] - lifetimes[i - j])
        attachments[i] = (1.0 - known) / lifetimes[1]
        for j in range(i + 1):
            force[i] += attachments[j] * (works[i - j + 1] - works[i - j])
    return ages[1:] * u * mean, force * u * mean


@jit
def _integrals_by_age(life: Life, ages: Floats) -> tuple[Floats, Floats]:
    """Return the integrals of the survivors ``S`` and of ``a S`` up to each of the
    `ages`, which begin with 0.
    """
    edges = panel_edges(life)
    survivors = survive(
        edges,
        life.u / life.delta,
        np.array([-1.0 / life.delta]),
        np.zeros(1),
    )
    lifetimes = np.zeros(ages.size)
    works = np.zeros(ages.size)
    row = np.empty(P + 1)
    k = 0
    for i in range(1, ages.size):
        lifetimes[i] = lifetimes[i - 1]
        works[i] = works[i - 1]
        here = ages[i - 1]
        end = min(ages[i], edges[-1])
        # ends: each turn goes on to the next edge, or to the end
        while here < end:
            while edges[k + 1] <= here:
                k += 1
            there = min(end, edges[k + 1])
            low = np.sqrt(here)
            high = np.sqrt(there)
            for q in range(_GAUSS.size):
                root = low + (high - low) * _GAUSS[q]
                interpolate(edges, k, root * root, row)
                left = (
                    2.0
                    * root
                    * (high - low)
                    * _WEIGHT[q]
                    * np.sum(row * survivors[k, :, 0])
                )
                lifetimes[i] += left
                works[i] += left * root * root
            here = there
    return lifetimes, works
