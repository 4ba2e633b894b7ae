"""The slider as a damped oscillator on the driving spring and on the contacts, Eq.
(11), in closed form.

While the friction force is linear in the slider's position and quadratic in time, the
slider obeys

    x'' + eta x' + w x = constant + linear t + quadratic t^2/2

and its motion has one closed form for every sign of ``w``: oscillation, creep and
instability; `flight` has a faster expansion. Everything is per contact and in natural
units (contact stiffness 1), in any unit of time.
"""

import math
from typing import NamedTuple

from ._jit import inlined, jit
from .drive import Quadratic, drive_at


class Slider(NamedTuple):
    """Stiffness K of the driving spring, mass M and damping rate eta of Eq. (11).

    ``stiffness = inf`` is rigid motion: the slider moves with the drive, and the other
    two do not matter.
    """

    stiffness: float
    mass: float
    damping: float


RIGID = Slider(math.inf, 1.0, 0.0)


class Motion(NamedTuple):
    """Time, position and velocity of the slider."""

    time: float
    X: float
    V: float


class Load(NamedTuple):
    """Force of the contacts while the slider moves on: ``force + stiffness (X(t) - X) -
    loss t - ramp t^2/2``.

    `loss` is the rate at which breaking reduces the force at the start, and `ramp` the
    growth of that rate.
    """

    force: float
    stiffness: float
    loss: float = 0.0
    ramp: float = 0.0


class Travel(NamedTuple):
    """Motion of the slider over some time: position and velocity at its end, work of
    the drive, integral of the squared velocity.
    """

    X: float
    V: float
    work: float
    squares: float


class _Equation(NamedTuple):
    """Coefficients of the equation of motion for the displacement of the slider."""

    eta: float
    w: float
    constant: float
    linear: float
    quadratic: float


Response = tuple[float, float, float, float, float]


@jit
def is_rigid(slider: Slider) -> bool:
    """Return whether the slider moves with the drive."""
    return math.isinf(slider.stiffness)


@inlined
def spring_force(
    slider: Slider,
    drive: Quadratic,
    time: float,
    X: float,
    friction: float,
) -> float:
    """Return the force of the driving spring; in rigid motion, that of the contacts."""
    return (
        friction
        if is_rigid(slider)
        else slider.stiffness * (drive_at(drive, time)[0] - X)
    )


@jit
def _equation(
    slider: Slider,
    drive: Quadratic,
    start: Motion,
    load: Load,
) -> _Equation:
    K = slider.stiffness
    M = slider.mass
    D, velocity = drive_at(drive, start.time)
    return _Equation(
        slider.damping,
        (K + load.stiffness) / M,
        (K * (D - start.X) - load.force) / M,
        (K * velocity + load.loss) / M,
        (K * drive.acceleration + load.ramp) / M,
    )


@jit
def response(t: float, eta: float, w: float) -> Response:
    """Solve ``x'' + eta x' + w x = 0`` after a unit impulse: velocity, position and its
    three repeated integrals.

    The integrals are the motion under a unit load that is constant, linear and
    quadratic (``t**2 / 2``) in time. A power series over a short time is doubled until
    the time is reached: one formula for oscillation, creep and instability (``w < 0``),
    without their special cases.
    """
    doublings = _doublings(t, eta, w)
    t *= 0.5**doublings
    found = _short_response(t, eta, w)
    for _ in range(doublings):
        found = _doubled_response(found, t, eta, w)
        t *= 2.0
    return found


@jit
def _doublings(t: float, eta: float, w: float) -> int:
    """Return how often a time must be halved for the power series to be accurate."""
    doublings = 0
    size = t * (eta + math.sqrt(abs(w)))
    # ends: the size is halved in each turn
    while size > 0.5:
        size *= 0.5
        doublings += 1
    return doublings


@jit
def _short_response(t: float, eta: float, w: float) -> Response:
    """Compute `response` by a power series, for a short time."""
    term = 1.0
    before = 0.0
    v = h = h1 = h2 = h3 = 0.0
    for n in range(1, 16):
        v += term
        part = term * t / n
        h += part
        part *= t / (n + 1)
        h1 += part
        part *= t / (n + 2)
        h2 += part
        h3 += part * t / (n + 3)
        recent = w * t * t * before / (n - 1) if n > 1 else 0.0
        term, before = -(eta * t * term + recent) / n, term
    return v, h, h1, h2, h3


@jit
def _doubled_response(
    found: Response,
    t: float,
    eta: float,
    w: float,
) -> Response:
    """Return `response` at twice the time `t` at which it was `found`."""
    v, h, h1, h2, h3 = found
    g = v + eta * h  # position after starting at rest from 1
    h3 += g * h3 + h * h2 + 0.5 * t * t * h1 + t * h2
    h2 += g * h2 + h * h1 + t * h1
    h1 += g * h1 + h * h
    return v * v - w * h * h, g * h + h * v, h1, h2, h3


@jit
def move(
    slider: Slider,
    drive: Quadratic,
    start: Motion,
    load: Load,
    dt: float,
) -> Motion:
    """Return the motion a time `dt` later, under the friction force of `load`."""
    if is_rigid(slider):
        X, V = drive_at(drive, start.time + dt)
        return Motion(start.time + dt, X, V)
    _, w, constant, linear, quadratic = _equation(slider, drive, start, load)
    v, h, h1, h2, h3 = response(dt, slider.damping, w)
    X = start.X + start.V * h + constant * h1 + linear * h2 + quadratic * h3
    return Motion(
        start.time + dt,
        X,
        start.V * v + constant * h + linear * h1 + quadratic * h2,
    )


@jit
def travel(
    slider: Slider,
    drive: Quadratic,
    start: Motion,
    load: Load,
    dt: float,
) -> Travel:
    """Move the slider as `move` does, and integrate work and squared velocity.

    The closed form is computed by doubling a short time, and the motion is known after
    each doubling. So the integrals are accurate even if a step is long compared with
    the relaxation of the slider: each interval is short compared with what has not yet
    decayed.
    """
    if is_rigid(slider):
        return Travel(*drive_at(drive, start.time + dt), 0.0, 0.0)
    D, velocity = drive_at(drive, start.time)
    V = start.V
    acceleration = drive.acceleration
    length = D - start.X
    eta, w, constant, linear, quadratic = _equation(slider, drive, start, load)
    doublings = _doublings(dt, eta, w)
    t = dt * 0.5**doublings
    found = _short_response(t, eta, w)
    begin = y = work = squares = 0.0
    u = velocity
    v = V
    for i in range(doublings + 1):
        if i > 0:
            found = _doubled_response(found, t, eta, w)
            begin = t
            t *= 2.0
        part = t - begin
        y1 = (
            V * found[1]
            + constant * found[2]
            + linear * found[3]
            + quadratic * found[4]
        )
        v1 = (
            V * found[0]
            + constant * found[1]
            + linear * found[2]
            + quadratic * found[3]
        )
        u1 = velocity + t * acceleration
        # Fourth-order quadratures from the values and slopes at both ends.
        mean = (y1 - y) / part
        pulled = length + begin * (velocity + 0.5 * begin * acceleration) - y
        pulled1 = length + t * (velocity + 0.5 * t * acceleration) - y1
        rate = (u - v) * u + pulled * acceleration
        rate1 = (u1 - v1) * u1 + pulled1 * acceleration
        work += (
            slider.stiffness
            * part
            * (0.5 * (pulled * u + pulled1 * u1) + part / 12.0 * (rate - rate1))
        )
        squares += part * (
            (2.0 * (v * v + v1 * v1) - v * v1) / 15.0
            + mean * (1.2 * mean - 0.2 * (v + v1))
        )
        y = y1
        u = u1
        v = v1
    return Travel(start.X + y, v, work, squares)


@jit
def free_amplitude(
    slider: Slider,
    drive: Quadratic,
    start: Motion,
    load: Load,
) -> float:
    """Return the amplitude of the free oscillation, or of the creep, about the parabola
    that a damped slider approaches.

    Spring and contacts together must have a positive stiffness.
    """
    eta, w, constant, linear, quadratic = _equation(slider, drive, start, load)
    p2 = 0.5 * quadratic / w
    p1 = (linear - 2.0 * eta * p2) / w
    p0 = (constant - eta * p1 - 2.0 * p2) / w
    rate = start.V - p1 - 0.5 * eta * p0
    return math.sqrt(p0 * p0 + rate * rate / max(abs(w - 0.25 * eta * eta), 1e-6 * w))
