"""Motion of the slider between two events of contacts, and the sums over contacts that
give its force.

Between two events the slider is a damped oscillator of known stiffness, `flight`, and
samples are taken from its closed form. There are two limits: rigid motion, and a slider
without mass, which is in balance at every moment and jumps when a contact breaks.

Detached contacts share one stretching ``y``, which follows the slider with stiffness 1
and slides at ``+-f_d``.
"""

import math
from typing import NamedTuple

from ._jit import bare, inlined
from .drive import NOWHERE, Piece, Quadratic, Sampling, drive_at, holds
from .flight import NEAR, Flight, at, energies, take_off
from .oscillator import Slider
from .records import Floats, Record, blank, record

MOTION = record(
    (
        "time position velocity origins squares reference stiffness work damped broken "
        "sliding_force anchor looked least"
    ),
    counts="attached sample events breaks breaks_at_arrest slides slid direction "
    "keeps_behind attachments "
    "thresholds_used delays_used variates_used",
)
"""State of the slider, sums over the contacts, and numbers of samples and random
numbers used.

`origins` is the sum over the attached contacts of stiffness times birth position, from
`reference`; `squares` is the same with the square of the position, `stiffness` the sum
of the stiffness. While the detached contacts are elastic, their force is 0 with the
slider at `anchor`. `looked` is the position of the slider at a snapshot, and `least` a
lower bound on all keys in the queue of breaks behind. `breaks_at_arrest` is the number
of breaks up to the last arrest; `slides` is the sign of the motion in which the
detached contacts slide, 0 while they are elastic; `slid` is the direction in which they
have just slid, until the slider reverses (0: none); `direction` is that of the last
motion. `keeps_behind` is whether the queue of breaks behind is kept, and `attachments`
counts those since the sums were last computed.
"""


def make_motion(
    X: float = 0.0,
    velocity: float = 0.0,
    sliding_force: float = 0.0,
    slides: int = 0,
) -> Record:
    """Return an array of one record; `slides` is 1 or -1 if the detached contacts slide
    already.
    """
    motion = blank(MOTION, 1)
    motion.position = motion.anchor = motion.reference = X
    motion.velocity = velocity
    motion.sliding_force = sliding_force
    motion.slides = slides
    motion.direction = -1 if velocity < 0 else 1
    return motion


class Constants(NamedTuple):
    """Constants of a call: those of Eq. (11), the sliding force of detached contacts,
    the number of contacts.

    `near` is the time up to which the short Taylor expansion is accurate. `pull` is the
    derivative of the force by the position of the drive: K, or 1 where the drive is a
    force and K is 0.
    """

    K: float
    pull: float
    inverse_mass: float
    eta: float
    drag: float
    near: float
    f_d: float
    N: float
    part: float
    rigid: bool
    massless: bool


class FlightLeg(NamedTuple):
    """A flight from one event towards the next: its start, the forces there, and its
    motion.

    `n` is the stiffness of the attached contacts, `free` the number of detached ones if
    they carry a force.
    """

    t: float
    X: float
    n: float
    free: float
    F_d: float
    drive_v: float
    motion: Flight


@inlined
def constants(
    slider: Slider,
    f_d: float,
    N: float,
    stiffest: float,
) -> Constants:
    """Return the constants of a call; `stiffest` is the largest mean stiffness that the
    contacts can have.
    """
    rigid = math.isinf(slider.stiffness)
    massless = slider.mass == 0.0
    K = 0.0 if rigid else slider.stiffness
    inverse_mass = 0.0
    drag = 0.0
    near = math.inf
    if not (rigid or massless):
        inverse_mass = 1.0 / slider.mass
        drag = slider.damping / inverse_mass
        near = NEAR / (slider.damping + math.sqrt((K + stiffest) * inverse_mass))
    return Constants(
        K,
        K if K > 0.0 else 1.0,
        inverse_mass,
        slider.damping,
        drag,
        near,
        f_d,
        N,
        1.0 / N,
        rigid,
        massless,
    )


@inlined
def driving_force(c: Constants, D: float, X: float) -> float:
    """Force of the spring with the drive at `D`; `D` itself if the drive is a force."""
    return D if c.K == 0.0 else c.K * (D - X)


@inlined
def detached_stretching(m: Record, X: float) -> float:
    """Common stretching of the detached contacts with the slider at `X`."""
    return float(m.slides * m.sliding_force if m.slides != 0 else X - m.anchor)


@inlined
def contact_force(m: Record, N: float) -> float:
    """Friction force, per contact."""
    force = m.stiffness * (m.position - m.reference) - m.origins
    if m.sliding_force > 0.0:
        force += (N - m.attached) * detached_stretching(m, m.position)
    return float(force / N)


@inlined
def set_out(m: Record, drive: Quadratic, c: Constants) -> FlightLeg:
    """Return the flight from the present state to the next event."""
    t = m.time
    X = m.position
    D, drive_v = drive_at(drive, t)
    n = m.stiffness
    free = c.N - m.attached if c.f_d > 0.0 else 0.0
    F_d = driving_force(c, D, X)
    stiffness = n + free if m.slides == 0 else n
    if c.rigid or c.massless:
        v = drive_v if c.rigid else c.K * drive_v / (c.K + stiffness * c.part)
        return FlightLeg(
            t,
            X,
            n,
            free,
            F_d,
            drive_v,
            take_off(0.0, 0.0, math.inf, v, 0.0, 0.0, 0.0),
        )
    F_c = n * (X - m.reference) - m.origins
    if c.f_d > 0.0:
        F_c += free * detached_stretching(m, X)
    flight = take_off(
        c.eta,
        (c.K + stiffness * c.part) * c.inverse_mass,
        c.near,
        m.velocity,
        (F_d - F_c * c.part) * c.inverse_mass,
        c.pull * drive_v * c.inverse_mass,
        0.5 * c.pull * drive.acceleration * c.inverse_mass,
    )
    return FlightLeg(t, X, n, free, F_d, drive_v, flight)


@inlined
def balance(m: Record, drive: Quadratic, c: Constants) -> float:
    """Position at which a slider without mass is in balance."""
    pull = (
        c.K * drive_at(drive, m.time)[0]
        + (m.stiffness * m.reference + m.origins) * c.part
    )
    stiffness = c.K + m.stiffness * c.part
    if c.f_d > 0.0:
        free = (c.N - m.attached) * c.part
        if m.slides == 0:
            pull += free * m.anchor
            stiffness += free
        else:
            pull -= free * m.slides * c.f_d
    return float(pull / stiffness)


@inlined
def sample(
    m: Record,
    row: Floats,
    leg: FlightLeg,
    part: float,
    a: float,
    c: Constants,
) -> None:
    """Fill a row with the state at a time `part` after the beginning of the flight.

    These are position, velocity, friction force, attached fraction, energy stored in
    contacts, and, accumulated from the start of the run, work of the drive, energy lost
    by damping and in breaks; all per contact.
    """
    n = leg.n
    y, u = at(leg.motion, part)
    x = leg.X + y - m.reference
    row[0] = leg.X + y
    row[1] = u
    row[2] = (n * x - m.origins) * c.part
    row[3] = m.attached / c.N
    row[4] = 0.5 * (n * x * x - 2.0 * x * m.origins + m.squares) * c.part
    row[5] = m.work
    row[6] = m.damped
    row[7] = m.broken
    if c.f_d > 0.0:
        free = leg.free * c.part
        slid = detached_stretching(m, row[0])
        row[2] += free * slid
        row[4] += 0.5 * free * slid * slid
        row[7] += free * m.slides * c.f_d * y
    if not c.rigid:
        work, squares = energies(
            leg.motion,
            part,
            y,
            u,
            leg.F_d,
            c.K,
            leg.drive_v,
            a,
        )
        row[5] += work
        row[6] += c.drag * squares


@inlined
def sample_until(
    m: Record,
    piece: Piece,
    sampling: Sampling,
    leg: FlightLeg,
    end: float,
    c: Constants,
) -> bool:
    """Fill the samples up to `end`, or to the first at which the condition holds, and
    move the state there; return whether it holds.
    """
    drive = piece.drive
    while m.sample < sampling.times.size and sampling.times[m.sample] <= end:
        time = sampling.times[m.sample]
        row = sampling.samples[m.sample]
        sample(m, row, leg, time - leg.t, drive.acceleration, c)
        m.sample += 1
        if piece.stop.kind != NOWHERE:
            D = drive_at(drive, time)[0]
            if holds(piece.stop, row[0], driving_force(c, D, row[0])):
                m.time = time
                m.position = row[0]
                m.velocity = row[1]
                m.work = row[5]
                m.damped = row[6]
                m.broken = row[7]
                return True
    return False


@inlined
def fly(
    m: Record,
    leg: FlightLeg,
    h: float,
    y: float,
    u: float,
    a: float,
    c: Constants,
) -> None:
    """Move the state, except its time, to the end of the flight."""
    if not c.rigid:
        work, squares = energies(
            leg.motion,
            h,
            y,
            u,
            leg.F_d,
            c.K,
            leg.drive_v,
            a,
        )
        m.work += work
        m.damped += c.drag * squares
    if c.f_d > 0.0:
        m.broken += leg.free * c.part * m.slides * c.f_d * y
    m.velocity = u
    m.position = leg.X + y
    m.events += 1
    if u != 0.0:
        m.direction = 1 if u > 0.0 else -1


@inlined
def detached_energy(m: Record, c: Constants) -> float:
    """Energy of one detached contact, over the number of contacts."""
    if c.f_d == 0.0:
        return 0.0
    return 0.5 * c.part * detached_stretching(m, m.position) ** 2


@inlined
def count_in(
    m: Record,
    birth: float,
    k: float,
    c: Constants,
) -> None:
    """Add a contact of stiffness `k` that attaches: it gives up the energy with which
    it slid, and may be stretched.
    """
    x = m.position - birth
    m.broken += detached_energy(m, c) - 0.5 * k * x * x * c.part
    y = birth - m.reference
    m.origins += k * y
    m.squares += k * y * y
    m.stiffness += k
    m.attached += 1


@inlined
def count_out(
    m: Record,
    birth: float,
    k: float,
    c: Constants,
) -> None:
    """Remove a contact of stiffness `k` that breaks: its energy is lost, except that of
    a detached contact.
    """
    x = m.position - birth
    m.broken += 0.5 * k * x * x * c.part - detached_energy(m, c)
    y = birth - m.reference
    m.origins -= k * y
    m.squares -= k * y * y
    m.stiffness -= k
    m.attached -= 1
    m.breaks += 1


@bare
def leap(m: Record, to: float, c: Constants) -> None:
    """Move a slider without mass to a position in zero time."""
    if m.slides != 0:
        m.broken += (c.N - m.attached) * c.part * m.slides * c.f_d * (to - m.position)
    m.direction = 1 if to >= m.position else -1
    m.position = to
