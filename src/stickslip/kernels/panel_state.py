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
    """Times until a broken contact re-attaches; none: it never does."""

    time: Floats  # shape (n,): given times, 0 for at once
    # shape (n,): the fraction of what breaks that re-attaches after each
    weight: Floats
    continuous: SurvivalTable  # survival of the times of the rest that re-attaches
    fraction: float  # of that rest
    grain: float  # a part of the motion that is longer has to be cut
    mean: float
    arrest: bool  # what is detached re-attaches when the slider next stops
    memoryless: bool  # the paper's approximation, Eq. (10): see `panel_step._hold`


class Newborn(NamedTuple):
    """Stretchings along the motion with which contacts attach, and the fraction of
    them.

    `tried` is 1 if all that is no stronger than they are stretched has broken, or 0 if
    all are as strong at first.
    """

    stretching: Floats
    fraction: Floats
    tried: float


@inlined
def newborns(breaking: Breaking, newborn: Newborn, i: int) -> float:
    """Mass of newborns of all strengths, over that of those that hold where they
    attach, at one of the stretchings.
    """
    return 1.0 / max(
        value_at(breaking.thresholds, newborn.tried * abs(newborn.stretching[i])), 1e-13
    )


class Accuracy(NamedTuple):
    """Bounds on a step: its error, the way of the slider, and what breaks."""

    tolerance: float  # largest error
    # how far the slider may go while all that is attached re-attaches in a step
    width: float
    rough: float = 0.0  # error of what re-attaches that need not be resolved
    broken: float = math.inf  # largest fraction of all contacts that breaks in a step


class FiniteNumber(NamedTuple):
    """Number of contacts, of which each node holds some."""

    contacts: float
    rng: np.random.Generator  # draws how many break and re-attach
    # distance of contacts that may count as if they had attached at one place
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
    finite: FiniteNumber | None = None  # its generator goes on


MOTION = record(
    "position velocity contact_force attached stored work damped lost drive_force time",
    "broken reattached mass_out mass_in next_step slope element direction",
)
"""What changes from step to step.

A sample holds the first line: where the slider is, the forces on it, the attached
fraction; the energies stored in contacts, put in by the drive, dissipated by damping
and lost in breaks. Then come the mass broken and re-attached so far, that outside of
cohorts and in them, the step to try next, the slope of the contact force, the
stretching of the element that stands for detached contacts, and the direction of the
last motion.
"""

COUNTS = record(
    counts="cohorts panels extremes rough steps sweeps rejected sampled left"
)
"""Numbers in use: cohorts, panels, extremes, rough moments; steps tried, sweeps over
the contacts, steps rejected; and, of a call, the samples that are filled, and the steps
that are left.
"""

AT_NODE = record(
    "x v force attached stored work damped lost",
    "slope broken reattached known old young ahead back",
)
"""What is known at a node of a step.

What is sampled: displacement of the slider and its velocity; contact force and attached
fraction; energies as in `MOTION`. Then the slope of the force; broken and re-attached
mass; what re-attaches of what broke before; attached of what was so at the start;
broken of what was not; what the force changes by with the clocks, see `force_at`.
"""
SAMPLED_ROWS = 8

FLUCTUATION = record(
    "time velocity acceleration loss_rate force fraction detached energy frequency2"
)
"""What breaks in a step beyond the mean.

When; how fast the slider goes from there, how that changes, and the force that breaks
take per time on average; the force and the fraction of contacts that go, and of these
the fraction that does not re-attach at once; the energy; and the squared frequency of
the slider.
"""


class PanelsState(NamedTuple):
    """State of the slider and of the cohorts.

    Arrays have room to spare; `used` says how much is filled.

    A panel is a step: its start and length, the mass broken up to each of its nodes,
    and the mass that breaks in it by nodes of Gauss. Where contacts are counted, how
    many wait follows: for each of the given delays, and by nodes.
    """

    motion: Record  # record of MOTION
    cohorts: Record  # shape (room, Q), of COHORT_NODE
    panels: Floats  # shape (room, WAITING + n_delays + Q), in order of time
    # places where the slider has turned and that it has not passed since
    extremes: Floats
    rough: Floats  # ring of moments at which what breaks has no smooth rate
    used: Record  # record of COUNTS


class Work(NamedTuple):
    """Buffers of the calculation."""

    # AT_NODE, shape (P + 2,): start and nodes; then the start before it is changed
    nodes: Record
    values: Floats  # shape (P + 2, fields): the same numbers as a matrix
    curves: Record  # of the polynomials through them, by name
    coefficients: Floats  # the same as a matrix
    before: Record  # MOTION, shape (1,): motion at the start of a step
    matrix: Floats  # shape (2 P + 1, P): room, a system, and its right side
    reading: Reading
    fluctuation: Record  # record of FLUCTUATION


FIRST = P + 1  # row of the nodes behind the last
WAITING = 3 + P + Q  # first of the columns of panels that count contacts

SPARE = 16  # cohorts for which there must be room before a step
NOT_CONVERGED = math.inf  # error of a step that Newton's method did not solve
SHORTER = 0.9 * 100.0 ** (-1 / P)
"""Length of the next attempt after such a step, as a fraction of it: that after an
error of 100 tolerances.
"""
MOST_SWEEPS = 12  # sweeps of Newton's method before a step is cut
NEGLIGIBLE = 1e-2  # mass, in tolerances, that need not be resolved
EVENT = 0.1  # error, in tolerances, of a kink that no step need end at


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
    """Put a slider at 0 on contacts, shape (n, Q): stretchings and weights at nodes of
    Gauss; the rest is detached.

    A contact at ``x_0`` has a threshold beyond ``|x_0|``; `lives` are clocks, reaches
    and ages, of shape (n, Q), if they have begun before. `rate` is the mass that broke
    per unit time before the start: for smooth sliding ``v / (<x_s> + v <tau_d>)``, with
    the attached fraction ``<x_s> / (<x_s> + v <tau_d>)``. `element` is the force that
    each detached contact carries.
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
    # Before the start, at a constant rate.
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
