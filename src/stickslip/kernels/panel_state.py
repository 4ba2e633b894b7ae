"""What the master equation on panels goes on from, and what stays the same on the way."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .drive import Quadratic
from .groups import BIRTH, GROUP_ROWS, MASS, REACH, WHOLE, Reading
from .oscillator import Slider
from .rules import NODE, WEIGHT, P, Q
from .survival import Table, values_at

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Delays(NamedTuple):
    """Times until a broken contact re-attaches; none: it never does.

    Attributes
    ----------
    time, weight : ndarray, shape (n,)
        Given times, 0 for at once, and the fraction of what breaks that re-attaches after each.
    continuous : Table
        Survival of the times of the rest that re-attaches, the fraction `fraction`; a part of the motion that is longer
        than `grain` has to be cut.
    mean : float
    arrest : bool
        What is detached re-attaches when the slider next stops.
    memoryless : bool
        The paper's approximation, Eq. (10): contacts re-attach at once, and the fraction of them that is attached
        follows the breaking rate of the moment. It has no memory of what broke when, and oscillates in its own,
        spurious way; it is exact for the mean force of steady sliding.
    """

    time: Array
    weight: Array
    continuous: Table
    fraction: float
    grain: float
    mean: float
    arrest: bool
    memoryless: bool


class Newborn(NamedTuple):
    """Stretchings along the motion with which contacts attach, the fraction of them, and that over their survival."""

    stretching: Array
    fraction: Array
    mass: Array


class Accuracy(NamedTuple):
    """How large a step may be.

    Attributes
    ----------
    tolerance : float
        Largest error.
    width : float
        How far the slider may go while all that is attached re-attaches in a step.
    rough : float
        Error of what re-attaches that need not be resolved.
    broken : float
        Largest fraction of all contacts that breaks in a step.
    """

    tolerance: float
    width: float
    rough: float = 0.0
    broken: float = math.inf


class Lot(NamedTuple):
    """Number of contacts, of which each node holds some; 0: infinitely many.

    Attributes
    ----------
    contacts : float
    rng : Generator
        Draws how many break and re-attach.
    grain : float
        Distance of contacts that may count as if they had attached at one place.
    """

    contacts: float
    rng: np.random.Generator
    grain: float


UNSTRETCHED = Newborn(np.zeros(1), np.ones(1), np.ones(1))
UNCOUNTED = Lot(0.0, np.random.default_rng(0), 0.0)


class Case(NamedTuple):
    """All that stays the same in a call."""

    table: Table
    delays: Delays
    slider: Slider
    drive: Quadratic
    accuracy: Accuracy
    newborn: Newborn
    sliding_force: float
    lot: Lot


class State(NamedTuple):
    """All that the next step needs. Arrays have room to spare; `used` says how much is filled.

    Attributes
    ----------
    scalar : ndarray, shape (18,)
        The quantities `TIME` ... `DIRECTION`.
    groups : ndarray, shape (5, room, Q)
        See `stickslip.kernels.groups`.
    panels : ndarray, shape (room, WAITING + n_delays + Q)
        Of each step: its start and length, the mass broken up to each of its nodes, and the mass that breaks in it by
        nodes of Gauss. Where contacts are counted, how many wait: for each of the given delays, and by nodes.
    cursor : ndarray of int, shape (n_delays,)
        Panel of the time one delay ago.
    front : ndarray of int, shape (n_delays,)
        First of the rough moments of which not all has re-attached yet.
    extremes : ndarray
        Places where the slider has turned and that it has not passed since.
    rough : ndarray
        Ring of moments at which what breaks has no smooth rate.
    used : ndarray of int, shape (7,)
        Numbers of groups, panels, extremes, rough moments; steps tried, sweeps over the contacts, steps rejected.
    """

    scalar: Array
    groups: Array
    panels: Array
    cursor: IntArray
    front: IntArray
    extremes: Array
    rough: Array
    used: IntArray


class Work(NamedTuple):
    """Room to calculate in: rows of values at the nodes, and the polynomials through them."""

    nodes: Array
    curves: Array
    matrix: Array
    start: Array
    reading: Reading
    chance: Array


# Columns of the samples, which are also the first scalars. Energies: work of the drive, dissipated by
# damping, lost in breaks, stored in contacts.
COLUMNS = 10
TIME, POSITION, VELOCITY, DRIVE_FORCE, CONTACT_FORCE, ATTACHED, WORK, DAMPED, LOST, STORED = range(COLUMNS)
# Further scalars: mass broken and re-attached so far, mass outside and in groups, the step to try next, the slope of
# the contact force, the stretching of the element that stands for detached contacts, and where the slider moved last.
SCALARS = 18
BROKEN, BORN, MASS_OUT, MASS_IN, NEXT_STEP, SLOPE, ELEMENT, DIRECTION = range(COLUMNS, SCALARS)

WAITING = 3 + P + Q
"""First of the columns of panels that count contacts."""

GROUPS, PANELS, EXTREMES, ROUGH, STEPS, SWEEPS, REJECTED = range(7)

# Why `advance` came back.
FINISHED, STOPPED, PAUSED, NO_ROOM, UNSOLVED = range(5)

# Rows of values at the nodes: way of the slider and its velocity; force, attached, slope of the force; broken,
# re-attached; energy of the contacts; what re-attaches of what broke before; work, damped, lost; attached of what was
# so at the start; broken of what was not.
(
    AT_X,
    AT_V,
    AT_FORCE,
    AT_ATTACHED,
    AT_SLOPE,
    AT_BROKEN,
    AT_BORN,
    AT_STORED,
    AT_KNOWN,
    AT_WORK,
    AT_DAMPED,
    AT_LOST,
    AT_OLD,
    AT_YOUNG,
) = range(14)
ROWS = 14

SPARE = 16
"""Groups for which there must be room before a step."""
HOPELESS = math.inf
"""Error of a step that Newton's method did not solve."""
SHORTER = 0.9 * 100.0 ** (-1 / P)
"""Length of the next attempt after such a step, as a fraction of it: that after an error of 100 tolerances."""
MOST_SWEEPS = 12
"""Sweeps of Newton's method before a step is cut."""
NEGLIGIBLE = 1e-2
"""Mass, in tolerances, that need not be resolved."""
EVENT = 0.1
"""Error, in tolerances, of a kink that no step need end at."""


def initial_state(
    table: Table,
    delays: Delays,
    stretching: Array,
    weight: Array,
    *,
    position: float = 0.0,
    velocity: float = 0.0,
    time: float = 0.0,
    rate: float = 0.0,
    element: float = 0.0,
) -> State:
    """Put a slider on its initial contacts.

    Parameters
    ----------
    table : Table
        Survival of the thresholds.
    delays : Delays
    stretching, weight : ndarray, shape (n, Q)
        Initial stretchings, any sign, at the nodes of Gauss of intervals, and the attached fraction of contacts at
        each. A contact at ``x_0`` has a threshold beyond ``|x_0|``. The rest of a sum of 1 is detached.
    position, velocity, time : float
        Of the slider, at the start.
    rate : float
        Mass that broke per unit time before the start; it re-attaches after its delay. For smooth sliding
        ``v / (<x_s> + v <tau_d>)``, with the attached fraction ``<x_s> / (<x_s> + v <tau_d>)``.
    element : float
        Force that each detached contact carries.

    Returns
    -------
    State
    """
    n, reach = len(stretching), np.abs(stretching)
    alive = np.maximum(values_at(table, reach.ravel()).reshape(reach.shape), 1e-12)
    groups = np.zeros((GROUP_ROWS, n + 128, Q))
    groups[BIRTH, :n], groups[MASS, :n], groups[REACH, :n] = position - stretching, weight / alive, reach
    groups[WHOLE, :n] = np.ptp(stretching, axis=1)[:, None] > 0.0
    attached = float(weight.sum())
    scalar = np.zeros(SCALARS)
    scalar[TIME], scalar[POSITION], scalar[VELOCITY] = time, position, velocity
    scalar[CONTACT_FORCE] = np.sum(weight * stretching) + (1.0 - attached) * element
    scalar[ATTACHED] = scalar[MASS_IN] = scalar[SLOPE] = attached
    scalar[MASS_OUT] = 1.0 - attached
    scalar[STORED] = 0.5 * (np.sum(weight * stretching**2) + (1.0 - attached) * element**2)
    scalar[ELEMENT] = element
    scalar[DIRECTION] = -1.0 if velocity < 0.0 else 1.0
    scalar[NEXT_STEP] = math.inf
    # Before the start, at a constant rate.
    memory = max([1e-3, delays.continuous.top if delays.fraction > 0.0 else 0.0, *delays.time])
    count = math.ceil(memory / delays.grain) if rate > 0.0 and delays.fraction > 0.0 else 1
    panels = np.zeros((count + 256, WAITING + delays.time.size + Q))
    step = memory / count
    panels[:count, 0] = time - memory + step * np.arange(count)
    panels[:count, 1] = step
    panels[:count, 2 : 3 + P] = rate * (panels[:count, :1] - time + step * NODE)
    panels[:count, 3 + P : WAITING] = rate * step * WEIGHT
    rough = np.full(64, time)
    zeros = np.zeros(delays.time.size, np.int64)
    used = np.array([n, count, 0, 1, 0, 0, 0], np.int64)
    return State(scalar, groups, panels, zeros, zeros.copy(), np.zeros(64), rough, used)
