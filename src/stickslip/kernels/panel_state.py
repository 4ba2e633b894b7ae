"""State and constants of the master equation on panels."""

import math
from typing import NamedTuple

import numpy as np

from ._jit import inlined
from .cohorts import COHORT_NODE, Reading
from .drive import STILL, Quadratic
from .effective_stretching import NEVER, Breaking, survivals
from .oscillator import Slider
from .quadrature import NODE, WEIGHT, P, Q
from .records import Floats, Record, blank, record
from .survival import SurvivalTable, value_at


class Delays(NamedTuple):
    """Times until a broken contact re-attaches; if there are none, it never does."""

    time: Floats  # shape (n,): fixed delays, 0 for re-attachment at once
    # shape (n,): the fraction of broken contacts that re-attaches after each of them
    weight: Floats
    continuous: SurvivalTable  # survival function of the distributed delays
    fraction: float  # the fraction of broken contacts with a distributed delay
    grain: float  # longest panel that Gauss nodes resolve for the distributed delays
    mean: float
    arrest: bool  # whether detached contacts re-attach when the slider next stops
    memoryless: bool  # the paper's approximation, Eq. (10): see `panel_step._hold`


class Newborn(NamedTuple):
    """Stretchings along the motion with which contacts attach, and the fraction of
    contacts for each.

    `tried` is 1 if newborns no stronger than their stretching have broken, or 0 if all
    have the same strength at first.
    """

    stretching: Floats
    fraction: Floats
    tried: float


@inlined
def newborns(breaking: Breaking, newborn: Newborn, i: int) -> float:
    """Return the mass of newborns of all strengths over the mass of those that hold
    where they attach, at one of the stretchings.
    """
    return 1.0 / max(
        value_at(breaking.thresholds, newborn.tried * abs(newborn.stretching[i])), 1e-13
    )


class Accuracy(NamedTuple):
    """Bounds on a step: its error, the slider's displacement, and the breaks."""

    tolerance: float  # largest error
    # largest displacement of the slider while all attached contacts re-attach in a step
    width: float
    rough: float = 0.0  # error of re-attachment that need not be resolved
    broken: float = math.inf  # largest fraction of all contacts that breaks in a step


class FiniteNumber(NamedTuple):
    """Number of contacts, of which each node holds a whole number."""

    contacts: float
    rng: np.random.Generator  # draws how many break and re-attach
    # largest distance of contacts that may count as attached at one place
    grain: float


UNSTRETCHED = Newborn(np.zeros(1), np.ones(1), 1.0)


class Case(NamedTuple):
    """Constants of the motion under one piece of the drive; a detached contact slides
    with `sliding_force`.
    """

    breaking: Breaking
    delays: Delays
    slider: Slider
    accuracy: Accuracy
    drive: Quadratic = STILL
    newborn: Newborn = UNSTRETCHED
    sliding_force: float = 0.0
    finite: FiniteNumber | None = None  # its random generator advances


MOTION = record(
    "position velocity contact_force attached stored work damped lost drive_force time",
    "broken reattached mass_out mass_in next_step slope element direction",
)
"""State of the motion, which changes from step to step.

A sample holds the fields of the first line: where the slider is, the forces on it, the
attached fraction; the energy stored in contacts, the work of the drive, and the
energies dissipated by damping and lost in breaks. Then come the mass broken and
re-attached so far, the mass outside of cohorts and in them, the step to try next, the
slope of the contact force, the stretching of the element of the detached contacts, and
the direction of the last motion.
"""

COUNTS = record(
    counts="cohorts panels extremes rough steps sweeps rejected sampled left"
)
"""Numbers in use: cohorts, panels, extremes, rough moments; steps tried, sweeps over
the contacts, steps rejected; and, in one call, the samples filled and the steps left.
"""

AT_NODE = record(
    "x v force attached stored work damped lost",
    "slope broken reattached known old young ahead back",
)
"""Values at a node of a step.

Of a sample: displacement of the slider and its velocity; contact force and attached
fraction; energies as in `MOTION`. Then the slope of the force; broken and re-attached
mass; the part of the latter that broke before the step; the mass attached that was so
at the start, and the mass broken that was not; the changes of the force with the
clocks, see `force_at`.
"""
SAMPLED_ROWS = 8

FLUCTUATION = record(
    "time velocity acceleration loss_rate force fraction detached energy frequency2"
)
"""Deviation of the breaks in a step from their mean.

When it occurs; the slider's velocity from there on, the acceleration, and the mean loss
of force by breaks per time; the force and the fraction of the contacts in excess, and
the part of that fraction that does not re-attach at once; their energy; and the squared
frequency of the slider.
"""


class PanelsState(NamedTuple):
    """State of the slider and of the cohorts.

    Arrays have spare room; `used` records how much is filled.

    A panel is a step: its start and length, the mass broken up to each of its nodes,
    and the mass that breaks in it by Gauss nodes. If contacts are counted, the numbers
    of waiting contacts follow: one for each fixed delay, and one for each Gauss node.
    """

    motion: Record  # record of MOTION
    cohorts: Record  # shape (room, Q), of COHORT_NODE
    panels: Floats  # shape (room, WAITING + n_delays + Q), in order of time
    # places where the slider has reversed and that it has not passed since
    extremes: Floats
    rough: Floats  # ring buffer of moments at which the breaking rate is not smooth
    used: Record  # record of COUNTS


class Work(NamedTuple):
    """Buffers of the calculation."""

    # AT_NODE, shape (P + 2,): start and nodes; then a copy of the start
    nodes: Record
    values: Floats  # shape (P + 2, fields): the same numbers as a matrix
    curves: Record  # coefficients of the polynomials through them, by name
    coefficients: Floats  # the same as a matrix
    before: Record  # MOTION, shape (1,): motion at the start of a step
    matrix: Floats  # shape (2 P + 1, P): work space, a system, and its right side
    reading: Reading
    fluctuation: Record  # record of FLUCTUATION


FIRST = P + 1  # row of `nodes` with the copy of the start
WAITING = 3 + P + Q  # first of the columns of panels that count contacts

SPARE = 16  # cohorts for which there must be room before a step
NOT_CONVERGED = math.inf  # error of a step that Newton's method did not solve
SHORTER = 0.9 * 100.0 ** (-1 / P)
"""Length of the next attempt after such a step, as a fraction of it: the same as after
an error of 100 tolerances.
"""
MOST_SWEEPS = 12  # sweeps of Newton's method before a step is shortened
NEGLIGIBLE = 1e-2  # mass, in tolerances, that need not be resolved
EVENT = 0.1  # error, in tolerances, of a kink at which no step needs to end


def initial_state(
    breaking: Breaking,
    delays: Delays,
    stretching: Floats,
    weight: Floats,
    *,
    lives: tuple[Floats, Floats, Floats] | None = None,
    velocity: float = 0.0,
    rate: float = 0.0,
    element: float = 0.0,
) -> PanelsState:
    """Return a slider at 0 on contacts with stretchings and weights at Gauss nodes,
    shape (n, Q); the rest of the contacts is detached.

    A contact at ``x_0`` has a threshold beyond ``|x_0|``; `lives` are clocks, reaches
    and ages, of shape (n, Q), of contacts whose lives began before. `rate` is the mass
    that broke per unit time before the start: for smooth sliding
    ``v / (<x_s> + v <tau_d>)``, with the attached fraction
    ``<x_s> / (<x_s> + v <tau_d>)``. `element` is the force that each detached contact
    carries.
    """
    n = len(stretching)
    begun = (
        np.full(stretching.shape, NEVER),
        np.abs(stretching),
        np.zeros(stretching.shape),
    )
    clock, reach, age = begun if lives is None else lives
    alive = np.maximum(survivals(breaking, clock, reach), 1e-12)
    cohorts = blank(COHORT_NODE, (n + 128, Q))
    cohorts.place[:n] = -stretching
    cohorts.mass[:n] = weight / alive
    cohorts.reach[:n] = reach
    cohorts.clock[:n] = clock
    cohorts.since[:n] = -age
    cohorts.whole[:n] = np.ptp(stretching, axis=1)[:, None] > 0.0
    attached = float(weight.sum())
    motion = blank(MOTION)
    used = blank(COUNTS)
    motion.velocity = velocity
    motion.contact_force = np.sum(weight * stretching) + (1.0 - attached) * element
    motion.attached = motion.mass_in = motion.slope = attached
    motion.mass_out = 1.0 - attached
    motion.stored = 0.5 * (
        np.sum(weight * stretching**2) + (1.0 - attached) * element**2
    )
    motion.element = element
    motion.direction = -1.0 if velocity < 0.0 else 1.0
    motion.next_step = math.inf
    # Before the start, contacts broke at a constant rate.
    memory = max(
        [1e-3, delays.continuous.top if delays.fraction > 0.0 else 0.0, *delays.time]
    )
    count = (
        math.ceil(memory / delays.grain) if rate > 0.0 and delays.fraction > 0.0 else 1
    )
    panels = np.zeros((count + 256, WAITING + delays.time.size + Q))
    step = memory / count
    panels[:count, 0] = step * np.arange(count) - memory
    panels[:count, 1] = step
    panels[:count, 2 : 3 + P] = rate * (panels[:count, :1] + step * NODE)
    panels[:count, 3 + P : WAITING] = rate * step * WEIGHT
    rough = np.full(64, -math.inf)
    used.cohorts = n
    used.panels = count
    used.rough = 1
    rough[0] = 0.0
    return PanelsState(motion, cohorts, panels, np.zeros(64), rough, used)
