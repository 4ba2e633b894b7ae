"""The kinetic equation of ageing contacts, Eqs. (13)-(17), N to infinity, under a
slider; see `langevin`.

The unknown is the density over (place of birth, margin). A cohort consists of the
contacts that attached while the slider moved by twice the reach of a step. For its
contacts at each margin the mass is stored, and the mean place of birth, which is all
that the force needs. Cohorts are needed only because an older contact ages by
``rate^2 (mean - margin - stretching)``; the error of that falls as the square of their
width. Margins obey the Fokker-Planck equation of Eq. (17), in the frame of the moving
boundary, with Chang-Cooper / Scharfetter-Gummel fluxes (conserving, Gaussian when at
rest) and steps of second order. Contacts that break enter the open cohort; with
``newborn = 0`` through its boundary, which reflects: contacts there attach where the
slider is. The scheme is of second order: halve step, reach and cells together.
"""

from typing import NamedTuple

import numpy as np

from ._jit import jit
from .langevin import Langevin, bernoulli
from .oscillator import Load
from .records import Counts, Floats
from .time_steps import (
    COLUMNS,
    LOSS,
    Course,
    Stroke,
    begin,
    fill,
    goes_on,
    keep,
    plan,
    settle,
)

# Further entries of the state: number of closed cohorts, how far the contacts lag
# behind the slider, rate of change of the loss and length of the last step.
COHORTS = 4
LAG = 5
RAMP = 6
LAST = 7

# Largest step of a free oscillation of the slider, in radians.
_ANGLE = 0.35


class Cohorts(NamedTuple):
    """Contacts by where they attached: first the closed cohorts, then the open one,
    then room for more.
    """

    # shape (C,), at least two more than closed cohorts: slider positions at which
    # contacts have stretching 0
    place: Floats
    # shape (C, nodes): fraction of contacts by margin; on node 0 only the open cohort
    # has any
    mass: Floats
    # shape (C, nodes): mass times how much farther than `place` these contacts attached
    # on average
    moment: Floats


class _Grid(NamedTuple):
    """Nodes of the margin, and the widths of the cells about them."""

    nodes: Floats
    width: Floats


class _Work(NamedTuple):
    """Buffers of the calculation."""

    up: Floats  # rates from node i to i+1,
    down: Floats  # and to i-1
    pivot: Floats  # one over the pivots of the elimination,
    carry: Floats  # and the factors that it carries upwards
    known: Floats  # right-hand side
    echo: Floats  # what one birth per unit time leaves at the nodes
    stage: Floats  # mass and moment in the two stages of a step
    tops: Counts  # for each cohort the last node where it may hold anything


class _Step(NamedTuple):
    """A step of all cohorts: its length, how far the slider goes, and the drift and
    diffusion of thresholds.

    ``gamma = 1 - 1/sqrt(2)`` gives SDIRK2, of second order and L-stable;
    ``gamma = 1/2`` two implicit Euler steps, of first order and positive.
    """

    dt: float
    dX: float
    square: float
    mean: float
    diffusion: float
    gamma: float


class _Births(NamedTuple):
    """The node where contacts attach (-1: nowhere), the fraction of them that attaches
    at the next one, and the rates in the two stages.
    """

    node: int
    fraction: float
    first: float
    second: float


@jit
def density_nodes(langevin: Langevin, cells: float) -> Floats:
    """Return the nodes of the margin, `cells` per standard deviation and denser near
    the boundary; the last lies beyond all thresholds.

    Contacts that attach on their boundary leave it as the square root of time, and a
    fast slider presses them against it: the first cells must be small.
    """
    end = max(langevin.mean, langevin.newborn) + 8.0 * langevin.std
    widest = langevin.std / cells
    growth = 1.0 + 1.0 / cells
    h = 0.06 * widest
    k = 0
    nodes = np.zeros(int(end / widest) + int(3.0 / np.log(growth)) + 3)
    while nodes[k] < end:
        nodes[k + 1] = nodes[k] + h
        h = min(growth * h, widest)
        k += 1
    return nodes[: k + 1].copy()


@jit
def cell_widths(nodes: Floats) -> Floats:
    """Return the widths of the cells about the nodes; the first and the last cell end
    at their node.
    """
    width = np.empty(nodes.size)
    width[0] = 0.5 * nodes[1]
    width[-1] = 0.5 * (nodes[-1] - nodes[-2])
    width[1:-1] = 0.5 * (nodes[2:] - nodes[:-2])
    return width


@jit
def _rates(
    grid: _Grid,
    mass: Floats,
    moment: Floats,
    x: float,
    step: _Step,
    first: int,
    top: int,
    work: _Work,
) -> None:
    """Fill the rates between the margins of one cohort while the slider moves on from
    `x` past its place of birth.

    The contacts at each margin are taken to have their mean stretching there,
    ``x - moment/mass``.
    """
    nodes = grid.nodes
    width = grid.width
    D = step.diffusion
    widest = nodes[-1] - nodes[-2]
    for i in range(top):
        here = mass[i + 1]
        off = moment[i + 1]
        if i >= first:
            here += mass[i]
            off += moment[i]
        start = x - off / here if here > 1e-200 else x
        a = abs(start)
        b = abs(start + step.dX)
        h = nodes[i + 1] - nodes[i]
        ageing = step.square * (step.mean - 0.5 * (nodes[i] + nodes[i + 1] + a + b))
        motion = (b - a) / step.dt
        d = (ageing - motion) * h / D
        flow = bernoulli(d)
        if i > first and h > 0.999 * widest:
            # Far from the boundary a fast slider carries the density along: central
            # differences, where they are positive, do not smear it.
            flow += (
                motion
                * motion
                / (motion * motion + ageing * ageing + 1e-300)
                * (max(1.0 - 0.5 * d, 0.0, -d) - flow)
            )
        work.up[i] = D * (flow + d) / (h * width[i])
        work.down[i + 1] = D * flow / (h * width[i + 1])
    work.down[0] = work.up[top] = 0.0


@jit
def _eliminate(
    work: _Work,
    first: int,
    top: int,
    dt: float,
) -> None:
    """Eliminate from above, for the implicit steps of `_substitute`."""
    above = 0.0
    for i in range(top, first - 1, -1):
        work.pivot[i] = 1.0 / (1.0 + dt * (work.up[i] + work.down[i]) - above)
        work.carry[i] = dt * work.up[i - 1] * work.pivot[i] if i > 0 else 0.0
        above = dt * work.down[i] * work.carry[i]


@jit
def _substitute(
    work: _Work,
    below: float,
    first: int,
    top: int,
    dt: float,
    solved: Floats,
) -> None:
    """Take an implicit step ``(1 - dt L) solved = known`` from node `first` to `top`,
    with the value `below` on the node below them.
    """
    above = 0.0
    for i in range(top, first - 1, -1):
        solved[i] = (work.known[i] + above) * work.pivot[i]
        above = dt * work.down[i] * solved[i]
    for i in range(first, top + 1):
        solved[i] += work.carry[i] * below
        below = solved[i]


@jit
def _advance_cohort(
    mass: Floats,
    moment: Floats,
    grid: _Grid,
    x: float,
    step: _Step,
    top: int,
    newborns: _Births,
    work: _Work,
) -> tuple[float, float]:
    """Advance a cohort by one step, in two implicit stages; return the rates at which
    its contacts break in the two.
    """
    known = work.known
    birth = newborns.node
    fraction = newborns.fraction
    gamma = step.gamma
    first = 0 if birth == 0 else 1  # a boundary on which contacts attach reflects
    dt = gamma * step.dt
    _rates(grid, mass, moment, x, step, first, top, work)
    _eliminate(work, first, top, dt)
    again = 0.0
    # contacts born in a stage that break within it and attach again, per birth
    if birth > 0:
        known[: top + 1] = 0.0
        known[birth] = dt * (1.0 - fraction)
        known[birth + 1] = dt * fraction
        _substitute(work, 0.0, first, top, dt, work.echo)
        again = work.down[1] * work.echo[1]
    ahead = (1.0 - gamma) / gamma
    breaking = (0.0, 0.0)
    for stage in range(2):
        m = work.stage[stage, 0]
        q = work.stage[stage, 1]
        # displacement of the slider from the reference place
        path = x + step.dX * (gamma if stage == 0 else 1.0)
        born = newborns.first if stage == 0 else newborns.second
        for i in range(first, top + 1):
            known[i] = (
                mass[i]
                if stage == 0
                else mass[i] + ahead * (work.stage[0, 0, i] - mass[i])
            )
        if birth >= 0:
            known[birth] += dt * born * (1.0 - fraction)
            known[birth + 1] += dt * born * fraction
        _substitute(work, 0.0, first, top, dt, m)
        lost = work.down[1] * m[1]
        if birth > 0:
            lost /= 1.0 - again
            born += lost
            for i in range(1, top + 1):
                m[i] += lost * work.echo[i]
        for i in range(1, top + 1):
            known[i] = (
                moment[i]
                if stage == 0
                else moment[i] + ahead * (work.stage[0, 1, i] - moment[i])
            )
        if birth > 0:
            known[birth] += dt * born * (1.0 - fraction) * path
            known[birth + 1] += dt * born * fraction * path
        _substitute(
            work,
            m[0] * path if birth == 0 else 0.0,
            1,
            top,
            dt,
            q,
        )
        breaking = (lost, lost) if stage == 0 else (breaking[0], lost)
    for i in range(first, top + 1):
        mass[i] = work.stage[1, 0, i]
        moment[i] = work.stage[1, 1, i]
        if mass[i] < 0.0:
            mass[i] = 0.0
            moment[i] = 0.0
    if birth == 0:
        moment[0] = mass[0] * (x + step.dX)
    return breaking


@jit
def _top(
    mass: Floats,
    moment: Floats,
    nodes: Floats,
    before: int,
    path: float,
) -> int:
    """Return the last node that a cohort can reach in a step; it held nothing above
    `before`.

    Negligible mass at the top is moved down.
    """
    top = before
    while top > 2 and mass[top] < 1e-17:
        mass[top - 1] += mass[top]
        moment[top - 1] += moment[top]
        mass[top] = moment[top] = 0.0
        top -= 1
    end = nodes[top] + path
    while top < nodes.size - 1 and nodes[top] < end:
        top += 1
    return top


@jit
def _close(
    cohorts: Cohorts,
    nodes: Floats,
    count: int,
    X: float,
    near: float,
    soft: float,
) -> int:
    """Close the open cohort (row `count`) and open another; return the number of closed
    cohorts.

    Contacts within about `soft` of their boundary stay open, so that the density is not
    cut where it is steep. The closed cohort is joined to one whose place is within
    `near`, if there is one.
    """
    place = cohorts.place
    mass = cohorts.mass
    moment = cohorts.moment
    m = mass[count]
    q = moment[count]
    fresh = count + 1
    total = 0.0
    off = 0.0
    path = X - place[count]
    for i in range(nodes.size):
        kept = np.exp(-((nodes[i] / soft) ** 2)) if soft > 0.0 else 0.0
        mass[fresh, i] = kept * m[i]
        moment[fresh, i] = kept * (q[i] - m[i] * path)
        m[i] -= mass[fresh, i]
        q[i] *= 1.0 - kept
        total += m[i]
        off += q[i]
    shift = off / total if total > 0.0 else 0.0
    q -= m * shift
    place[count] += shift
    place[fresh] = X
    nearest = -1
    for c in range(count):
        if nearest < 0 or abs(place[c] - place[count]) < abs(
            place[nearest] - place[count]
        ):
            nearest = c
    if nearest >= 0 and (
        abs(place[nearest] - place[count]) < near or count + 2 >= place.size
    ):
        moment[nearest] += q + m * (place[count] - place[nearest])
        mass[nearest] += m
        place[count] = place[fresh]
        mass[count] = mass[fresh]
        moment[count] = moment[fresh]
        mass[fresh] = 0.0
        moment[fresh] = 0.0
        return count
    return count + 1


@jit
def _prepare(langevin: Langevin, stroke: Stroke) -> _Step:
    """Return the numbers of a step that do not depend on the cohort."""
    square = langevin.rate**2
    diffusion = (langevin.rate * langevin.std) ** 2
    # A fast slider presses contacts against the boundary for many relaxation times of
    # the layer there: SDIRK2 would overshoot.
    fall = max(abs(stroke.dX) / stroke.dt - square * langevin.mean, 0.0)
    gamma = 0.5 if fall * fall * stroke.dt > 8.0 * diffusion else 1.0 - np.sqrt(0.5)
    return _Step(stroke.dt, stroke.dX, square, langevin.mean, diffusion, gamma)


@jit
def _birth_node(newborn: float, nodes: Floats) -> tuple[int, float]:
    """Return the node at or below the margin of a newborn contact, and the fraction of
    the way to the next one at which it lies.
    """
    if not newborn > 0.0:
        return 0, 0.0
    below = int(np.searchsorted(nodes, newborn, side="right")) - 1
    birth = min(max(below, 1), nodes.size - 2)
    fraction = (newborn - nodes[birth]) / (nodes[birth + 1] - nodes[birth])
    return birth, min(max(fraction, 0.0), 1.0)


@jit
def _age(
    cohorts: Cohorts,
    grid: _Grid,
    count: int,
    stroke: Stroke,
    langevin: Langevin,
    work: _Work,
) -> int:
    """Advance all cohorts by one step; contacts that break attach in the open one (row
    `count`). Return how many closed cohorts are left.
    """
    place = cohorts.place
    mass = cohorts.mass
    moment = cohorts.moment
    tops = work.tops
    nodes = grid.nodes
    step = _prepare(langevin, stroke)
    X = stroke.X
    newborn = langevin.newborn
    birth, fraction = _birth_node(newborn, nodes)
    path = 8.0 * np.sqrt(2.0 * step.diffusion * step.dt) + abs(step.dX)
    first = 0.0
    second = 0.0
    broken = 0.0
    dust = 0.0
    kept = 0
    for c in range(count):
        m = mass[c]
        q = moment[c]
        broken += np.sum(m)
        top = _top(m, q, nodes, tops[c], path)
        one, two = _advance_cohort(
            m, q, grid, X - place[c], step, top, _Births(-1, 0.0, 0.0, 0.0), work
        )
        first += one
        second += two
        left = np.sum(m)
        broken -= left
        if left < 1e-13:  # nearly empty
            dust += left
            m[:] = 0.0
            q[:] = 0.0
            continue
        place[kept] = place[c]
        tops[kept] = top
        if kept < c:
            mass[kept] = m
            moment[kept] = q
            m[:] = 0.0
            q[:] = 0.0
        kept += 1
    m = mass[count]
    q = moment[count]
    expected = np.sum(m) + broken
    top = max(_top(m, q, nodes, tops[count], path), birth + 1)
    _advance_cohort(
        m,
        q,
        grid,
        X - place[count],
        step,
        top,
        _Births(birth, fraction, first, second),
        work,
    )
    total = np.sum(m)
    if total > 0.0:  # correct for rounding, and for negative values set to 0
        m *= expected / total
        q *= expected / total
    m[birth] += dust
    q[birth] += dust * (X + step.dX - place[count])
    if kept < count:
        place[kept] = place[count]
        mass[kept] = m
        moment[kept] = q
        m[:] = 0.0
        q[:] = 0.0
    tops[kept] = top
    return kept


@jit
def _force(cohorts: Cohorts, count: int, X: float) -> tuple[float, float]:
    """Return the force of the contacts, and the sum of the mass."""
    force = 0.0
    total = 0.0
    for c in range(count + 1):
        here = np.sum(cohorts.mass[c])
        total += here
        force += (X - cohorts.place[c]) * here - np.sum(cohorts.moment[c])
    return force, total


@jit
def advance_density(
    state: Floats, cohorts: Cohorts, nodes: Floats, course: Course, langevin: Langevin
) -> Floats:
    """Advance the kinetic equation and the slider to the last of the course's times,
    Eqs. (11), (13)-(17).

    `state` and `cohorts` are changed. Returns the samples at the times that were
    reached; their last column is the sum of the mass. With
    ``(mean + 8 std)/reach + 3`` rows of cohorts only cohorts that are near are joined.
    """
    count = int(state[COHORTS])
    lag = state[LAG]
    reach = course.reach
    size = nodes.size
    grid = _Grid(nodes, cell_widths(nodes))
    tops = np.full(cohorts.place.size, size - 1)
    line = np.zeros((6, size))
    work = _Work(
        line[0],
        line[1],
        line[2],
        line[3],
        line[4],
        line[5],
        np.zeros((2, 2, size)),
        tops,
    )
    here = begin(course, state)
    F, total = _force(cohorts, count, here.X)
    samples = np.empty((course.times.size, COLUMNS))
    loss = state[LOSS]
    ramp = state[RAMP]
    last = state[LAST]
    filled = fill(course, samples, 0, here, Load(F, 1.0, 0.0, 0.0), here.time, total)
    taken = 0
    while goes_on(course, samples, filled, taken):
        guess, stroke = plan(
            course, filled, here, Load(F, 1.0, loss + 0.5 * ramp * last, ramp), _ANGLE
        )
        if stroke.end > course.look:
            break
        taken += 1
        # The contacts are moved from the slider's position guessed in the last step to
        # the one guessed now.
        dt = stroke.dt
        dX = stroke.dX
        count = _age(
            cohorts,
            grid,
            count,
            Stroke(here.time, stroke.end, dt, here.X - lag, dX + lag),
            langevin,
            work,
        )
        path = abs(guess.X - cohorts.place[count])
        if path >= 3.999 * reach or (guess.V * here.V < 0.0 and path > 0.4 * reach):
            soft = (
                2.0 * np.sqrt((langevin.rate * langevin.std) ** 2 * dt)
                if langevin.newborn <= 0.0
                else 0.0
            )
            count = _close(cohorts, nodes, count, guess.X, 2.0 * reach, soft)
            tops[count] = size - 1
        before = loss
        start = F
        F, total = _force(cohorts, count, guess.X)
        loss = (start + guess.X - here.X - F) / dt
        ramp = 2.0 * (loss - before) / (dt + last) if last > 0.0 else 0.0
        last = dt
        load = Load(start, 1.0, loss - 0.5 * ramp * dt, ramp)
        there = settle(course, here, guess, load, dt)
        lag = there.X - guess.X
        F += lag
        filled = fill(course, samples, filled, here, load, there.time, total)
        here = there
    keep(state, here, loss)
    state[COHORTS] = float(count)
    state[LAG] = lag
    state[RAMP] = ramp
    state[LAST] = last
    return samples[:filled]
