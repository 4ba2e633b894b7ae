"""The slider between two events of contacts, and what is summed over these on the way.

Between two events the slider is a damped oscillator of known stiffness, `flight`, and samples are read off its closed
form. There are two limits: rigid motion, and a slider without mass, which is in balance at every moment and leaps when
a contact breaks.

Detached contacts share one stretching ``y``, which follows the slider and slides at ``+-f_d``: `SLIDE` is its sign
while it slides, 0 while it is elastic about `ANCHOR`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined, jit
from .drive import NOWHERE, Quadratic, Stop, holds
from .flight import NEAR, Flight, at, energies, first_crossing, soon, take_off
from .oscillator import Slider

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]

# Why an engine came back.
REACHED_END, CONDITION_HELD, DRAWS_USED_UP, BUDGET_SPENT, LOOK, WIND, WIND_BACK = range(7)

# Floats of a motion.
# `SUM` and `SQUARES` are of the positions of birth, each times the stiffness of its contact; `BEYOND` is what all
# attached contacts together are stiffer than as many of stiffness 1.
TIME, POSITION, VELOCITY, SUM, SQUARES, REFERENCE, WORK, DAMPED, BROKEN, LOOKED, ANCHOR, BEYOND = range(12)
MOTION = 12
# Counts of a motion.
ATTACHED, SAMPLE, EVENTS, BREAKS, SLIDE = range(5)
COUNTS = 5


class Piece(NamedTuple):
    """A piece of the drive up to `end`, or to a condition seen at a sample.

    `look` is a time at which the caller wants to look at the contacts: the engine then returns before the flight that
    passes it, so that looking changes nothing.
    """

    drive: Quadratic
    end: float
    stop: Stop = Stop()
    look: float = math.inf


class Sampling(NamedTuple):
    """Rising times at which to sample, shape (n,), and the samples, shape (n, 8), filled with `COLUMNS`.

    Position, velocity, friction force, attached fraction, energy stored in contacts, and, accumulated since the
    start, work of the drive, energy lost to damping and in breaks; all per contact.
    """

    times: Floats
    samples: Floats


COLUMNS = ("displacement", "velocity", "friction_force", "attached", "stored", "work", "damped", "broken")


class Constants(NamedTuple):
    """What does not change: Eq. (11), the sliding force of detached contacts, the number of contacts.

    `near` is the time up to which the short Taylor expansion does.
    """

    K: float
    inverse_mass: float
    eta: float
    drag: float
    near: float
    f_d: float
    N: float
    part: float
    rigid: bool
    massless: bool


class Leg(NamedTuple):
    """A flight from one event towards the next: where it begins, with which forces, and its motion.

    `n` is the stiffness of the attached contacts, their number where all have stiffness 1.
    """

    t: float
    X: float
    n: float
    F_d: float
    drive_v: float
    motion: Flight


@inlined
def constants(slider: Slider, f_d: float, N: float, stiffest: float = 1.0) -> Constants:
    """Return what does not change in a call; `stiffest` is how stiff the contacts may become, over their number."""
    if math.isinf(slider.stiffness):
        return Constants(0.0, 0.0, 0.0, 0.0, math.inf, f_d, N, 1.0 / N, True, False)
    if slider.mass == 0.0:
        return Constants(slider.stiffness, 0.0, 0.0, 0.0, math.inf, f_d, N, 1.0 / N, False, True)
    inverse_mass = 1.0 / slider.mass
    drag = slider.damping / inverse_mass
    fastest = slider.damping + math.sqrt((slider.stiffness + stiffest) * inverse_mass)
    return Constants(
        slider.stiffness, inverse_mass, slider.damping, drag, NEAR / fastest, f_d, N, 1.0 / N, False, False
    )


@inlined
def detached_stretching(motion: Floats, counts: Counts, f_d: float, X: float) -> float:
    """Common stretching of the detached contacts with the slider at `X`."""
    if counts[SLIDE] != 0:
        return float(counts[SLIDE] * f_d)
    return float(X - motion[ANCHOR])


@inlined
def drive_now(drive: Quadratic, t: float) -> tuple[float, float]:
    """Position and velocity of the drive."""
    since = t - drive.start
    D = drive.position + (drive.velocity + 0.5 * drive.acceleration * since) * since
    return D, drive.velocity + drive.acceleration * since


@inlined
def attached_stiffness(motion: Floats, counts: Counts) -> float:
    """Stiffness of all attached contacts together."""
    return float(counts[ATTACHED] + motion[BEYOND])


@inlined
def set_out(motion: Floats, counts: Counts, drive: Quadratic, c: Constants) -> Leg:
    """Motion from here on, if nothing happened."""
    t, X, v = motion[TIME], motion[POSITION], motion[VELOCITY]
    D, drive_v = drive_now(drive, t)
    n = attached_stiffness(motion, counts)
    F_d = c.K * (D - X)
    if c.rigid or c.massless:
        free = c.N - n if c.f_d > 0.0 and counts[SLIDE] == 0 else 0.0
        v = drive_v if c.rigid else c.K * drive_v / (c.K + (n + free) * c.part)
        return Leg(t, X, n, F_d, drive_v, take_off(0.0, 0.0, math.inf, v, 0.0, 0.0, 0.0))
    stiffness = n
    F_c = n * (X - motion[REFERENCE]) - motion[SUM]
    if c.f_d > 0.0:
        F_c += (c.N - n) * detached_stretching(motion, counts, c.f_d, X)
        if counts[SLIDE] == 0:
            stiffness = c.N
    flight = take_off(
        c.eta,
        (c.K + stiffness * c.part) * c.inverse_mass,
        c.near,
        v,
        (F_d - F_c * c.part) * c.inverse_mass,
        c.K * drive_v * c.inverse_mass,
        0.5 * c.K * drive.acceleration * c.inverse_mass,
    )
    return Leg(t, X, n, F_d, drive_v, flight)


@inlined
def balance(motion: Floats, counts: Counts, drive: Quadratic, c: Constants) -> float:
    """Where a slider without mass is in balance."""
    n, X = attached_stiffness(motion, counts), motion[POSITION]
    D = drive_now(drive, motion[TIME])[0]
    pull = c.K * D + (n * motion[REFERENCE] + motion[SUM]) * c.part
    stiffness = c.K + n * c.part
    if c.f_d > 0.0:
        free = (c.N - n) * c.part
        if counts[SLIDE] == 0:
            pull += free * motion[ANCHOR]
            stiffness += free
        else:
            pull -= free * detached_stretching(motion, counts, c.f_d, X)
    return float(pull / stiffness)


@inlined
def is_straight(leg: Leg, h: float, y: float, u: float, to_ahead: float, to_behind: float) -> bool:
    """Whether a short flight keeps its direction and passes nothing: it goes by `y` and ends at velocity `u`."""
    flight = leg.motion
    v = flight.v
    if v == 0.0:
        return u == 0.0 and flight.c2 == 0.0
    bend = 2.0 * abs(flight.c2) + h * (3.0 * abs(flight.c3) + h * 4.0 * abs(flight.c4))
    return bool(v * u > 0.0 and h * bend < 0.4 * abs(v) and y < to_ahead and -y < to_behind)


@bare
def crossing(leg: Leg, to_ahead: float, to_behind: float, most: float, cuts: Floats) -> tuple[float, float, float, int]:
    """First passage of a position ahead (1) or behind (-1) within `most`; or 0 and the end of what was searched.

    Returns the time, the displacement and the velocity then, and which.
    """
    flight = leg.motion
    v = flight.v
    if (to_ahead <= 0.0 and v > 0.0) or (to_behind <= 0.0 and v < 0.0):
        return 0.0, 0.0, v, 1 if v > 0.0 else -1
    if v != 0.0:
        h, y, u, passed, applies = soon(flight, to_ahead if v > 0.0 else -to_behind, most)
        if applies:
            return h, y, u, passed if v > 0.0 else -passed
    h, side = first_crossing(flight, max(to_ahead, 0.0), max(to_behind, 0.0), most, cuts)
    y, u = at(flight, h)
    return h, y, u, side


@inlined
def sample(motion: Floats, counts: Counts, row: Floats, leg: Leg, part: float, a: float, c: Constants) -> None:
    """Fill a row with what the flight passes a time `part` after its beginning."""
    n = leg.n
    y, u = at(leg.motion, part)
    x = leg.X + y - motion[REFERENCE]
    row[0] = leg.X + y
    row[1] = u
    row[2] = (n * x - motion[SUM]) * c.part
    row[3] = float(counts[ATTACHED]) / c.N
    row[4] = 0.5 * (n * x * x - 2.0 * x * motion[SUM] + motion[SQUARES]) * c.part
    row[5], row[6], row[7] = motion[WORK], motion[DAMPED], motion[BROKEN]
    if c.f_d > 0.0:
        free = (c.N - n) * c.part
        slid = detached_stretching(motion, counts, c.f_d, row[0])
        row[2] += free * slid
        row[4] += 0.5 * free * slid * slid
        row[7] += free * counts[SLIDE] * c.f_d * y
    if not c.rigid:
        work, squares = energies(leg.motion, part, y, u, leg.F_d, c.K, leg.drive_v, a)
        row[5] += work
        row[6] += c.drag * squares


@inlined
def sample_until(
    motion: Floats, counts: Counts, piece: Piece, sampling: Sampling, leg: Leg, end: float, c: Constants
) -> bool:
    """Fill the samples up to `end`, or to the first at which the condition holds, and go there; whether it does."""
    drive = piece.drive
    while counts[SAMPLE] < sampling.times.size and sampling.times[counts[SAMPLE]] <= end:
        time, row = sampling.times[counts[SAMPLE]], sampling.samples[counts[SAMPLE]]
        sample(motion, counts, row, leg, time - leg.t, drive.acceleration, c)
        counts[SAMPLE] += 1
        if piece.stop.kind != NOWHERE:
            D = drive_now(drive, time)[0]
            if holds(piece.stop, row[0], c.K * (D - row[0])):
                motion[TIME], motion[POSITION], motion[VELOCITY] = time, row[0], row[1]
                motion[WORK], motion[DAMPED], motion[BROKEN] = row[5], row[6], row[7]
                return True
    return False


@inlined
def fly(
    motion: Floats, counts: Counts, leg: Leg, h: float, y: float, u: float, ends_at: float, a: float, c: Constants
) -> None:
    """Make the end of the flight the state."""
    if not c.rigid:
        work, squares = energies(leg.motion, h, y, u, leg.F_d, c.K, leg.drive_v, a)
        motion[WORK] += work
        motion[DAMPED] += c.drag * squares
    if c.f_d > 0.0:
        motion[BROKEN] += (c.N - leg.n) * c.part * counts[SLIDE] * c.f_d * y
    motion[TIME] = ends_at
    motion[VELOCITY] = u
    motion[POSITION] = leg.X + y
    counts[EVENTS] += 1


@inlined
def detached_edges(motion: Floats, counts: Counts, c: Constants) -> tuple[float, float]:
    """Positions ahead and behind where the detached contacts begin to slide; none while they do."""
    if c.f_d > 0.0 and counts[SLIDE] == 0:
        return motion[ANCHOR] + c.f_d, motion[ANCHOR] - c.f_d
    return np.inf, -np.inf


@inlined
def turned(motion: Floats, counts: Counts, c: Constants, u: float) -> None:
    """Detached contacts that slide are elastic again where the slider turns back."""
    if c.f_d > 0.0 and counts[SLIDE] != 0 and u * counts[SLIDE] < 0.0:
        motion[ANCHOR] = motion[POSITION] - counts[SLIDE] * c.f_d
        counts[SLIDE] = 0


@inlined
def count_in(motion: Floats, counts: Counts, c: Constants, k: float = 1.0) -> None:
    """Count a contact of stiffness `k` that attaches, unstretched, where the slider is."""
    y = motion[POSITION] - motion[REFERENCE]
    motion[SUM] += k * y
    motion[SQUARES] += k * y * y
    motion[BEYOND] += k - 1.0
    counts[ATTACHED] += 1
    if c.f_d > 0.0:
        slid = detached_stretching(motion, counts, c.f_d, motion[POSITION])
        motion[BROKEN] += 0.5 * slid * slid * c.part


@inlined
def count_out(motion: Floats, counts: Counts, birth: float, c: Constants, k: float = 1.0) -> None:
    """Count a contact of stiffness `k` that breaks: what it stored is lost, but for what detached contacts hold."""
    y = birth - motion[REFERENCE]
    motion[SUM] -= k * y
    motion[SQUARES] -= k * y * y
    motion[BEYOND] -= k - 1.0
    x = motion[POSITION] - birth
    lost = k * x * x
    if c.f_d > 0.0:
        slid = detached_stretching(motion, counts, c.f_d, motion[POSITION])
        lost -= slid * slid
    motion[BROKEN] += 0.5 * lost * c.part
    counts[ATTACHED] -= 1
    counts[BREAKS] += 1


@bare
def sum_again(motion: Floats, counts: Counts, contacts: NDArray[np.void], as_stiff: bool = False) -> None:
    """Sum the birth positions afresh, about the present position: rounding cannot pile up.

    `as_stiff`: contacts are as stiff as their thresholds are large, see `Interface.areas`; else of stiffness 1.
    """
    reference = motion[POSITION]
    total, squares, beyond, attached = 0.0, 0.0, 0.0, 0
    for i in range(contacts.size):
        if contacts[i]["threshold"] > 0.0:
            y = contacts[i]["birth"] - reference
            k = contacts[i]["threshold"] if as_stiff else 1.0
            total += k * y
            squares += k * y * y
            beyond += k - 1.0
            attached += 1
    motion[SUM], motion[SQUARES], motion[REFERENCE], motion[BEYOND] = total, squares, reference, beyond
    counts[ATTACHED] = attached


@inlined
def until_turning(flight: Flight, h: float) -> float:
    """Time up to `h` at which the velocity, of another sign there than at the start, is 0: by bisection."""
    low, high = 0.0, h
    for _ in range(60):
        middle = 0.5 * (low + high)
        if at(flight, middle)[1] * flight.v > 0.0:
            low = middle
        else:
            high = middle
    return high


@jit
def friction(motion: Floats, counts: Counts, f_d: float, N: float) -> float:
    """Friction force, per contact."""
    n, X = attached_stiffness(motion, counts), motion[POSITION]
    force = n * (X - motion[REFERENCE]) - motion[SUM]
    if f_d > 0.0:
        force += (N - n) * (counts[SLIDE] * f_d if counts[SLIDE] != 0 else X - motion[ANCHOR])
    return float(force / N)
