"""The slider between two events, fast enough for the event engine, with the times at
which it reverses or crosses a position.

The equation of motion is that of `oscillator`, whose closed form by doubling would do,
but costs 300 ns, as much as five events in all. Nearly all flights are short. A Taylor
expansion, whose coefficients serve position, velocity, energies and Newton's method
alike, covers them, with six terms for the shortest; closed forms with exponentials
cover the rest. Crossings also need derivatives up to the jerk.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ._jit import bare, inlined
from .records import Floats


class Flight(NamedTuple):
    """Motion between two events, as displacement ``y(h)`` a time ``h`` after the first.

    ``y = q0 + q1 h + q2 h^2`` plus a free oscillation that starts from ``(y0, v0)``;
    ``c2 ... c6`` are the first Taylor coefficients, which suffice while ``h`` is at
    most ``near NEAREST/NEAR``.
    """

    eta: float
    w2: float  # squared angular frequency (K + n/N)/M
    inverse: float  # 1/w2
    q0: float
    q1: float
    q2: float
    y0: float
    v0: float
    v: float
    c2: float
    c3: float
    c4: float
    c5: float
    c6: float
    near: float


# Largest (eta + w) h, with w of all contacts attached, for which eight Taylor terms
# leave an error under 1e-14 of the velocity;
NEAR = 0.06
NEAREST = 0.012  # for which six terms do,
MIDDLE = 0.3  # and for which twelve do
# a free oscillation that has decayed by a factor of exp of this is below rounding
_DIED_OUT = 40.0
_LEGS = 16.0  # flights of more legs than this use the closed form

# Orders of derivatives, as numpy's integers: numba compiles a kernel once for them, but
# anew for each Python constant.
_ORDERS: Any = np.arange(3)
_PLACE, _VELOCITY, _ACCELERATION = _ORDERS


@inlined
def take_off(
    eta: float,
    w2: float,
    near: float,
    v: float,
    f0: float,
    f1: float,
    f2: float,
) -> Flight:
    """Solve ``y'' + eta y' + w2 y = f0 + f1 h + f2 h^2`` from ``y = 0, y' = v``."""
    q0 = 0.0
    q1 = v
    q2 = 0.0
    inverse = 0.0
    if w2 > 0:  # else rigid motion, or a free mass
        inverse = 1.0 / w2
        q2 = f2 * inverse
        q1 = (f1 - 2.0 * eta * q2) * inverse
        q0 = (f0 - eta * q1 - 2.0 * q2) * inverse
    # Each coefficient needs the one before: as few operations as possible lie between.
    c2 = 0.5 * (f0 - eta * v)
    c3 = (f1 * (1.0 / 6.0) - w2 * (1.0 / 6.0) * v) - eta * (1.0 / 3.0) * c2
    c4 = (f2 * (1.0 / 12.0) - w2 * (1.0 / 12.0) * c2) - eta * 0.25 * c3
    c5 = -(w2 * (1.0 / 20.0)) * c3 - eta * 0.2 * c4
    c6 = -(w2 * (1.0 / 30.0)) * c4 - eta * (1.0 / 6.0) * c5
    return Flight(
        eta,
        w2,
        inverse,
        q0,
        q1,
        q2,
        -q0,
        v - q1,
        v,
        c2,
        c3,
        c4,
        c5,
        c6,
        near,
    )


@inlined
def taylor(f: Flight, h: float) -> tuple[float, float]:
    """Return displacement and velocity by the Taylor expansion, for `h` within
    `MIDDLE`.
    """
    tail = 0.0
    slope = 0.0
    if h > f.near * (NEAREST / NEAR):
        tail, slope = _tail(f, h)
    h2 = h * h
    # Pairs of terms are independent, so that the processor computes them in parallel.
    y = (f.v + h * f.c2) + h2 * ((f.c3 + h * f.c4) + h2 * ((f.c5 + h * f.c6) + tail))
    v = (f.v + h * 2.0 * f.c2) + h2 * (
        (3.0 * f.c3 + h * 4.0 * f.c4) + h2 * ((5.0 * f.c5 + h * 6.0 * f.c6) + slope)
    )
    return h * y, v


@inlined
def _tail(f: Flight, h: float) -> tuple[float, float]:
    """Return the sums of the terms from the seventh on: of the displacement over
    ``h^5`` and of the velocity over ``h^4``.
    """
    c6 = f.c6
    c7 = -(f.w2 * (1.0 / 42.0)) * f.c5 - f.eta * (1.0 / 7.0) * c6
    c8 = -(f.w2 * (1.0 / 56.0)) * c6 - f.eta * 0.125 * c7
    tail = 0.0
    slope = 0.0
    if h > f.near:
        c9 = (-f.w2 * c7 - 8.0 * f.eta * c8) * (1.0 / 72.0)
        c10 = (-f.w2 * c8 - 9.0 * f.eta * c9) * (1.0 / 90.0)
        c11 = (-f.w2 * c9 - 10.0 * f.eta * c10) * (1.0 / 110.0)
        c12 = (-f.w2 * c10 - 11.0 * f.eta * c11) * (1.0 / 132.0)
        tail = h * (c9 + h * (c10 + h * (c11 + h * c12)))
        slope = h * (9.0 * c9 + h * (10.0 * c10 + h * (11.0 * c11 + h * 12.0 * c12)))
    return h * h * (c7 + h * (c8 + tail)), h * h * (7.0 * c7 + h * (8.0 * c8 + slope))


@inlined
def _free(f: Flight, h: float) -> tuple[float, float]:
    """Return the responses of the free oscillator at `h` to a unit displacement and to
    a unit velocity.
    """
    g = 0.5 * f.eta
    d = g * g - f.w2
    if d < 0:
        w = math.sqrt(-d)
        decay = math.exp(-g * h)
        sine = decay * math.sin(w * h) / w
        return decay * math.cos(w * h) + g * sine, sine
    b = math.sqrt(d)
    if b * h < 1e-3:
        decay = math.exp(-g * h)
        z = d * h * h
        sine = decay * h * (1.0 + z / 6.0 + z * z / 120.0)
        return decay * (1.0 + 0.5 * z + z * z / 24.0) + g * sine, sine
    fast = g + b
    slow = f.w2 / (g + b)
    e_fast = math.exp(-fast * h)
    e_slow = math.exp(-slow * h)
    return (fast * e_slow - slow * e_fast) / (2.0 * b), (e_slow - e_fast) / (2.0 * b)


@inlined
def far(f: Flight, h: float) -> tuple[float, float]:
    """Return displacement and velocity by the closed form."""
    c, s = _free(f, h)
    y = f.q0 + f.q1 * h + f.q2 * h * h + f.y0 * c + f.v0 * s
    v = f.q1 + 2.0 * f.q2 * h + f.v0 * c + 2.0 * (f.c2 - f.q2) * s
    return y, v


@inlined
def at(f: Flight, h: float) -> tuple[float, float]:
    """Return displacement and velocity a time `h` into the flight."""
    return taylor(f, h) if h <= f.near * (MIDDLE / NEAR) else far(f, h)


@bare
def derivative(f: Flight, order: int, h: float) -> tuple[float, float]:
    """Return displacement, velocity, acceleration or jerk (order 0 to 3) and the next
    derivative, by the closed form.
    """
    v = f.v0
    a = 2.0 * (f.c2 - f.q2)
    g = 0.5 * f.eta
    if f.w2 == 0.0:  # a free mass, by the expansion and the equation of motion
        y, v = taylor(f, h)
        rate = 6.0 * f.c3 + 2.0 * f.eta * f.c2
        a = 2.0 * f.c2 + rate * h - f.eta * (v - f.v)
        y -= f.q1 * h
        v -= f.q1
        j = rate - f.eta * a
        k = -f.eta * j
    elif f.w2 < 0.5 * g * g:
        # Two modes with very different rates. Derivatives of their sum would lose the
        # slow one in the rounding of the fast one.
        b = math.sqrt(g * g - f.w2)
        fast = g + b
        slow = f.w2 / (g + b)
        fast_a = 0.5 * fast * (a + slow * v) / b * math.exp(-fast * h)
        slow_a = -0.5 * slow * (a + fast * v) / b * math.exp(-slow * h)
        y = fast_a / (fast * fast) + slow_a / (slow * slow)
        v = -fast_a / fast - slow_a / slow
        a = fast_a + slow_a
        j = -fast * fast_a - slow * slow_a
        k = fast * fast * fast_a + slow * slow * slow_a
    else:
        c, s = _free(f, h)
        y = f.y0 * c + v * s
        v = v * c + a * s
        a = -f.eta * v - f.w2 * y
        j = -f.eta * a - f.w2 * v
        k = -f.eta * j - f.w2 * a
    if order == 0:
        return f.q0 + f.q1 * h + f.q2 * h * h + y, f.q1 + 2.0 * f.q2 * h + v
    if order == 1:
        return f.q1 + 2.0 * f.q2 * h + v, 2.0 * f.q2 + a
    if order == 2:
        return 2.0 * f.q2 + a, j
    return j, k


@bare
def _start(f: Flight, order: int) -> float:
    """Return a number with the sign of the velocity, acceleration or jerk (order 1 to
    3) just after the start: if that is 0, the next derivative that is not.
    """
    if order == 1 and f.v != 0.0:
        return f.v
    if order <= 2 and f.c2 != 0.0:
        return f.c2
    return f.c3 if f.c3 != 0.0 else f.c4


@bare
def _root(
    f: Flight,
    order: int,
    value: float,
    low: float,
    high: float,
) -> float:
    """Return where a derivative that is monotone from `low` to `high` takes a value, by
    Newton's method kept inside by bisection.
    """
    rising = derivative(f, order, high)[0] > derivative(f, order, low)[0]
    h = 0.5 * (low + high)
    for _ in range(200):
        miss, slope = derivative(f, order, h)
        miss -= value
        if miss == 0.0:
            return h
        if (miss > 0) == rising:
            high = h
        else:
            low = h
        following = h - miss / slope if slope != 0.0 else low
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - h) <= 4e-16 * h or following <= low or following >= high:
            return following
        h = following
    return h


@bare
def _cut(
    f: Flight,
    order: int,
    cuts: Floats,
    count: int,
) -> int:
    """Cut parts at the zeros of a derivative that is monotone on each; return the new
    number of cuts.
    """
    i = 0
    left = _start(f, order)
    while i + 1 < count:
        right = derivative(f, order, cuts[i + 1])[0]
        if left * right < 0.0:
            root = _root(f, order, 0.0, cuts[i], cuts[i + 1])
            if cuts[i] < root < cuts[i + 1]:
                for j in range(count, i + 1, -1):
                    cuts[j] = cuts[j - 1]
                cuts[i + 1] = root
                count += 1
                i += 1
        left = right
        i += 1
    return count


@bare
def heading(f: Flight) -> float:
    """Return the direction of the slider just after the start, as a number of its sign;
    0 if it stays.
    """
    return _start(f, _VELOCITY)


@bare
def _parts(
    f: Flight,
    most: float,
    lowest: int,
    cuts: Floats,
) -> int:
    """Cut a flight where derivatives down to the `lowest` vanish, the jerk first;
    return how many cuts there are.

    A zero of a derivative shows in its signs at the two ends of a part. These are right
    only while the free oscillation exceeds rounding, hence a first cut where it has
    decayed: after that, the motion is a parabola.
    """
    g2 = f.w2 - 0.25 * f.eta * f.eta
    # the decay rate of the slowest mode
    decay = 0.5 * f.eta
    if not g2 > 0.0 and f.w2 > 0.0:
        decay = f.w2 / (decay + math.sqrt(-g2))
    cuts[0] = 0.0
    cuts[1] = most
    count = 2
    if decay * most > _DIED_OUT:
        cuts[1] = _DIED_OUT / decay
        cuts[2] = most
        count = 3
    for order in range(3, lowest - 1, -1):
        count = _cut(f, order, cuts, count)
    return count


@bare
def first_turn(f: Flight, most: float, cuts: Floats) -> float:
    """Return the first time up to `most`, within the interval that `first_crossing` has
    searched, at which the slider stops; infinity if it does not.
    """
    if f.near == math.inf:  # rigid motion
        return math.inf
    count = _parts(f, most, _ACCELERATION, cuts)
    left = _start(f, _VELOCITY)
    for i in range(count - 1):
        right = derivative(f, _VELOCITY, cuts[i + 1])[0]
        if right == 0.0 and left != 0.0 and (i > 0 or f.v != 0.0):
            return float(cuts[i + 1])
        if left * right < 0.0:
            return _root(f, _VELOCITY, 0.0, cuts[i], cuts[i + 1])
        left = right
    return math.inf


@bare
def first_crossing(
    f: Flight,
    to_ahead: float,
    to_behind: float,
    most: float,
    cuts: Floats,
) -> tuple[float, int]:
    """Return the first time up to `most` at which the displacement reaches `to_ahead`
    or `-to_behind`, and which: 1 or -1.

    If it reaches neither, return the end of the interval that was searched, and 0. That
    end is `most` or, if sooner, a quarter of a period, in which the jerk, being a free
    oscillation, vanishes at most once. On each part the displacement is monotone, so
    that no crossing is missed.
    """
    distance = to_ahead if f.v > 0 else to_behind
    if f.near == math.inf:  # rigid motion
        if f.v == 0.0 or most * abs(f.v) < distance:
            return most, 0
        return distance / abs(f.v), 1 if f.v > 0 else -1
    g2 = f.w2 - 0.25 * f.eta * f.eta
    if g2 > 0.0:
        most = min(most, 0.5 * math.pi / math.sqrt(g2))
    # most often the crossing comes soon: in a short interval there are no reversals and
    # no roots to find
    if f.v != 0.0:
        most = min(most, 4.0 * distance / abs(f.v))
    for i in range(_parts(f, most, _VELOCITY, cuts) - 1):
        y = derivative(f, _PLACE, cuts[i + 1])[0]
        if y >= to_ahead:
            return _root(
                f,
                _PLACE,
                to_ahead,
                cuts[i],
                cuts[i + 1],
            ), 1
        if y <= -to_behind:
            return _root(
                f,
                _PLACE,
                -to_behind,
                cuts[i],
                cuts[i + 1],
            ), -1
    return most, 0


@bare
def out_of_reach(
    f: Flight,
    to_ahead: float,
    to_behind: float,
    most: float,
) -> float:
    """Return a time, up to `most`, in which the slider cannot reach either side,
    however it oscillates; 0 if that time is short.

    A light slider that sticks oscillates a thousand times while the spring is loaded,
    and none of these oscillations matters.
    """
    g = 0.5 * f.eta
    d = f.w2 - g * g
    if not d > 0.0 or f.q2 != 0.0:
        return 0.0
    w = math.sqrt(d)
    amplitude = math.hypot(f.y0, (f.v0 + g * f.y0) / w)
    ahead = to_ahead - f.q0 - amplitude
    behind = to_behind + f.q0 - amplitude
    if not (ahead > 0.0 and behind > 0.0):
        return 0.0
    h = (
        most
        if f.q1 == 0.0
        else min(most, (ahead if f.q1 > 0.0 else behind) / abs(f.q1))
    )
    return h if w * h > math.pi else 0.0


@inlined
def soon(
    f: Flight,
    distance: float,
    most: float,
) -> tuple[float, float, float, int, bool]:
    """Try the common case: a short flight at nearly constant velocity.

    Returns the time to travel the signed `distance`, or `most` if that is shorter; the
    displacement and the velocity then; 1 if the distance is reached and 0 if not; and
    whether the case applies: the velocity keeps at least half its value, and the flight
    lasts at most a few times as long as the Taylor expansion is valid. A flight longer
    than the expansion allows is divided into legs.
    """
    slowness = 1.0 / f.v
    h = distance * slowness
    reach = f.near * (MIDDLE / NEAR)
    longest = min(most, 2.0 * h)
    if longest > reach:
        if longest > _LEGS * reach:
            return 0.0, 0.0, 0.0, 0, False
        longest = most = reach
    if not longest * (
        2.0 * abs(f.c2) + longest * (3.0 * abs(f.c3) + longest * 4.0 * abs(f.c4))
    ) < 0.4 * abs(f.v):
        return 0.0, 0.0, 0.0, 0, False
    if most < 2.0 * h:
        y, v = taylor(f, most)
        if abs(y) < abs(distance):
            return most, y, v, 0, True
    bend = f.c2 * h * slowness
    # invert the series
    h *= 1.0 - bend + 2.0 * bend * bend - f.c3 * h * h * slowness
    v = f.v
    for _ in range(6):  # Newton's method: after this guess one turn mostly suffices
        y, v = taylor(f, h)
        step = (distance - y) / v
        h += step
        if abs(step) <= 1e-6 * h:  # the next step would be of the order of its square
            v += step * (2.0 * f.c2 + 6.0 * f.c3 * h)
            break
    return min(max(h, 0.0), most), distance, v, 1, True


@inlined
def energies(
    f: Flight,
    h: float,
    y: float,
    v: float,
    force: float,
    K: float,
    drive_v: float,
    drive_a: float,
) -> tuple[float, float]:
    """Return the work of the drive and the integral of the squared velocity over a time
    `h`, in closed form.

    `force` is the spring force at the start; without a spring `drive_v` is its rate,
    and `drive_a` 0. The free oscillation ``u`` obeys
    ``u'' + eta u' + w2 u = 0``, hence ``(u'^2 + w2 u^2)/2`` falls at the rate
    ``eta u'^2`` and the integral of ``u`` follows from the change of ``u'`` and ``u``.
    """
    if h <= f.near * (NEAREST / NEAR):
        return _short_energies(f, h, y, force, K, drive_v, drive_a)
    h2 = h * h
    u = y - (f.q0 + f.q1 * h + f.q2 * h2)
    du = v - (f.q1 + 2.0 * f.q2 * h)
    change = u - f.y0
    area = -((du - f.v0) + f.eta * change) * f.inverse
    path = f.q0 * h + 0.5 * f.q1 * h2 + f.q2 * h2 * h / 3.0 + area
    if K == 0.0:
        work = force * y + drive_v * (h * y - path)
    else:
        work = drive_v * (
            force * h + K * (0.5 * drive_v * h2 + drive_a * h2 * h / 6.0 - path)
        )
    if drive_a != 0.0:
        moment = -(h * du - change + f.eta * (h * u - area)) * f.inverse
        path_moment = (
            0.5 * f.q0 * h2 + f.q1 * h2 * h / 3.0 + 0.25 * f.q2 * h2 * h2 + moment
        )
        pull = 0.5 * force * h2 + K * (
            drive_v * h2 * h / 3.0 + 0.125 * drive_a * h2 * h2 - path_moment
        )
        work += drive_a * pull
    squares = (
        f.q1 * f.q1 * h + 2.0 * f.q1 * f.q2 * h2 + 4.0 / 3.0 * f.q2 * f.q2 * h2 * h
    )
    squares += 2.0 * f.q1 * change + 4.0 * f.q2 * (h * u - area)
    if f.eta > 0.0:
        squares += (
            0.5 * ((f.v0 - du) * (f.v0 + du) + f.w2 * (f.y0 - u) * (f.y0 + u)) / f.eta
        )
    return work, squares


@inlined
def _short_energies(
    f: Flight,
    h: float,
    y: float,
    force: float,
    K: float,
    drive_v: float,
    drive_a: float,
) -> tuple[float, float]:
    """Return the `energies` of the shortest flights by the Taylor expansion: closed
    forms would subtract large numbers.
    """
    h2 = h * h
    a = 2.0 * f.c2
    b = 3.0 * f.c3
    c = 4.0 * f.c4
    path = h2 * (
        (0.5 * f.v + h * (1.0 / 6.0) * a)
        + h2 * ((1.0 / 12.0) * b + h * (0.05 * c + h * (1.0 / 6.0) * f.c5))
    )
    if K == 0.0:
        work = force * y + drive_v * (h * y - path)
    else:
        work = drive_v * (force * h + K * (0.5 * drive_v * h2 - path))
    if drive_a != 0.0:
        moment = (
            h2
            * h
            * (
                (1.0 / 3.0) * f.v
                + h * (0.125 * a + h * ((1.0 / 15.0) * b + h * (1.0 / 24.0) * c))
            )
        )
        work += drive_a * (
            0.5 * force * h2
            + h2 * h * K * (0.5 * drive_v + 0.125 * drive_a * h)
            - K * moment
        )
    # The velocity is v + w, and the series of the integral of w^2 begins with h^3.
    squares = f.v * (2.0 * y - f.v * h)
    d = (b * c + 5.0 * a * f.c5) * (1.0 / 3.0)
    squares += (
        h2
        * h
        * (
            a * a * (1.0 / 3.0)
            + h * (0.5 * a * b + h * (0.2 * b * b + 0.4 * a * c + h * d))
        )
    )
    return work, squares
