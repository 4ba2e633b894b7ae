"""Modes of smooth sliding: how many grow, how fast the fastest one does, and which spring would stop them.

Roots of ``Z(s) + kappa(s) = 0``. On the imaginary axis the interface and the rig separate: with ``kappa``
computed once, each frequency with ``Im(Z + kappa) = 0`` is neutral for exactly one extra spring at the
interface, ``-Re(Z + kappa)``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.model.rig import Rig
from stickslip.stability.aged import ACCURACY, AgedResponse
from stickslip.stability.impedances import (
    Impedance,
    Modes,
    RadiationDamping,
    SpringMassDamper,
    impedance,
    is_plain,
    natural_frequencies,
    poles,
    resonances,
)
from stickslip.stability.response import SCAN_LIMIT, STEP, Axis, Response, respond

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]


def count_unstable(rig: Rig) -> int:
    """Count the growing modes of smooth sliding: roots of ``Z(s) + kappa(s) = 0`` with ``Re s > 0``.

    The argument principle along the imaginary axis. Between two neighbouring frequencies the curve stays
    inside an ellipse about its two values, of a size that follows from the moments of the distributions; frequencies
    are added until no ellipse holds 0, so that no turn is missed (for a rig given as a function its slope is
    sampled instead).

    Parameters
    ----------
    rig : Rig
        Interface, slider (or any impedance) and velocity.

    Returns
    -------
    int
        Number of unstable roots, a complex pair counting 2; 0 if smooth sliding is stable.

    Raises
    ------
    InputError
        If there is no steady sliding, see `dynamic_stiffness`.
    UndecidedError
        If a root lies on the imaginary axis to within rounding; with thresholds that age, to within the accuracy of
        their response, 5e-4 of the stiffness of the contacts.
    """
    speed, response, z = _parts(rig)
    if isinstance(response, AgedResponse):
        return _count_aged(response, z, speed)
    if response.inert:
        return 0
    scan = _scan(response, z, speed)
    if scan.omega.size == 0:
        return 0
    start, end = _quiet_below(response, z, speed), float(scan.omega[-1])
    if start >= end:
        return 0
    omega = np.union1d(scan.omega[(scan.omega > start)], np.geomspace(start, end, 200))
    omega[0], omega[-1] = start, end
    product, denominator = _product(response, z, speed, 1j * omega)
    for _ in range(60):
        gap = np.diff(omega)
        slope = _slope_bound(response, z, speed, omega)
        sure = np.abs(product[1:]) + np.abs(product[:-1]) > slope * gap
        if sure.all():
            break
        if omega.size > SCAN_LIMIT or np.min(gap[~sure] / omega[1:][~sure]) < 1e-12:
            at = float(omega[1:][~sure][np.argmin(np.abs(product[1:][~sure]))])
            raise UndecidedError(
                f"smooth sliding at velocity {speed:g} is neutral to within rounding, at angular frequency {at:.9g}: "
                "on its stability boundary; move a parameter to one side"
            )
        new = 0.5 * (omega[1:] + omega[:-1])[~sure]
        new_product, new_denominator = _product(response, z, speed, 1j * new)
        order = np.argsort(np.concatenate([omega, new]), kind="stable")
        omega = np.concatenate([omega, new])[order]
        product = np.concatenate([product, new_product])[order]
        denominator = np.concatenate([denominator, new_denominator])[order]
    turned = float(np.sum(np.angle(product[1:] / product[:-1])))
    # Re(denominator) > 0 and Im Z >= 0 on the axis: their angles need no following.
    turned -= float(np.angle(denominator[-1]) - np.angle(denominator[0]))
    first, last = product[0] / denominator[0], product[-1] / denominator[-1]
    z_last = z(1j * omega[-1:])[0]
    angle_z = math.atan2(max(z_last.imag, 0.0), z_last.real)
    loops = (turned + np.angle(first) - angle_z - np.angle(last / z_last)) / (2 * math.pi)
    return -2 * round(float(loops))


def growth_rate(rig: Rig) -> complex:
    """Return the root of ``Z(s) + kappa(s) = 0`` with the largest real part: growth rate plus ``i`` angular frequency.

    Newton's method from starts all along the axis finds candidates; the argument principle on a line just
    left of the best one confirms that there is no other to its right.

    Parameters
    ----------
    rig : Rig
        Interface, slider (or any impedance) and velocity.

    Returns
    -------
    complex
        In 1/time of the rig's own units, with an imaginary part of 0 or above. A negative real part is the slowest decay, of the
        slider or of the contacts' own ringing.

    Raises
    ------
    InputError
        If there is no steady sliding, see `dynamic_stiffness`.
    UndecidedError
        If smooth sliding is stable but no mode decays exponentially: a distribution of thresholds with a heavy tail,
        or a rig without mass nor losses on an interface without delay.

    Notes
    -----
    With thresholds that age growing modes are confirmed by their count; a negative real part is that of the mode
    nearest to the axis among those found.
    """
    instance("growth_rate: rig", rig, Rig, "a Rig(interface, slider, drive)")
    return rightmost_root(rig.natural) * rig.unit("1/time")


def rightmost_root(rig: Rig) -> complex:
    """Return the `growth_rate` of a rig in natural units."""
    speed, response, z = _parts(rig)
    if isinstance(response, AgedResponse):
        return _rightmost_aged(response, z, speed)
    limit = -math.inf if response.inert else response.leftmost * speed
    (neutral,) = neutral_frequencies(response, z, [speed])
    growing = neutral.unstable()
    cycle = float(response.scale(speed)) / speed
    # Steps to one side of the axis, in units of the inverse memory of the response.
    steps = (0.0, 0.3, 1.0, 3.0, 0.1) if growing else (0.0, -0.1, -0.4, -1.0, -3.0, -8.0) if limit < 0 else ()
    starts = np.concatenate(
        [
            natural_frequencies(z),
            1j * neutral.omega[np.isfinite(neutral.omega)],
            _starts_on_real_axis(response, z, speed, limit),
        ]
    )
    for step in steps:
        starts = np.concatenate([starts, _starts_from_line(response, z, speed, max(step / cycle, 0.9 * limit))])
        roots = _roots_from(response, z, speed, starts, limit)
        if roots.size == 0:
            continue
        right = roots[roots.real > 0]
        if growing and growing == int(np.sum(np.where(right.imag > 0, 2, 1))):
            return complex(roots[0])
        if not growing and roots[0].real <= 0 and _is_rightmost(response, z, speed, roots, limit):
            return complex(roots[0])
        starts = roots
    if math.isfinite(limit) and growing == 0:
        raise UndecidedError(
            f"smooth sliding at velocity {speed:g} is stable, but no mode decays more slowly than the tail of the "
            f"distribution of thresholds (Re s = {limit:g}): there is no slowest mode to give; count_unstable() says 0"
        )
    raise UndecidedError(
        f"smooth sliding at velocity {speed:g}: no root of Z(s) + kappa(s) could be confirmed as the one furthest "
        f"right; {growing} of them grow"
    )


def _parts(rig: Rig) -> tuple[float, Response | AgedResponse, Impedance]:
    """Speed of smooth sliding, response of the contacts and impedance of the body, in natural units."""
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    natural = rig.natural
    speed = number("velocity", natural.velocity, above=0, hint="in x_s per time")
    return speed, respond(natural.interface), impedance(natural.slider)


# ---------------------------------------------------------------- neutral frequencies


class Neutral(NamedTuple):
    """Frequencies at which some extra spring at the interface makes a mode neutral.

    With less extra stiffness than `extra`, `modes` more modes grow (2, or -2).
    """

    omega: Array
    extra: Array
    modes: NDArray[np.int64]

    def unstable(self, added: float = 0.0) -> int:
        """Number of growing modes with a spring `added` at the interface."""
        return int(np.sum(self.modes[self.extra > added]))


NOTHING = Neutral(np.empty(0), np.empty(0), np.empty(0, dtype=np.int64))


def neutral_frequencies(
    response: Response | AgedResponse, body: Impedance, velocities: Sequence[float], *, softest: float | None = None
) -> list[Neutral]:
    """Return per velocity all zeros of ``Im(Z + kappa)`` on the axis that bear on the body, or on all stiffer ones too.

    With `softest` given the answer holds for every rig that has the same losses and masses and a total static
    stiffness of at least `softest`, else for the rig itself only.
    """
    if response.inert:
        return [NOTHING for _ in velocities]
    scans = [_scan(response, body, velocity, softest) for velocity in velocities]
    brackets = [_brackets(response, body, velocity, scan) for velocity, scan in zip(velocities, scans, strict=True)]
    # All velocities at once: a call costs the same for one frequency and for a hundred.
    counts = [left.size for left, _, _ in brackets]
    speed = np.repeat(np.asarray(velocities, dtype=float), counts)
    left, right = (np.concatenate([b[k] for b in brackets]) for k in (0, 1))
    omega = extra = left
    if left.size:
        omega = _bracketed_zeros(lambda w: _loss(response, body, speed, w), left, right)
        s = 1j * omega
        extra = -(body(s) + response.stiffness(speed, s)).real
    answers = []
    ends = np.cumsum([0, *counts])
    for k, (scan, (_, _, rising)) in enumerate(zip(scans, brackets, strict=True)):
        w, e, modes = omega[ends[k] : ends[k + 1]], extra[ends[k] : ends[k + 1]], np.where(rising, 2, -2)
        # Where a scan was cut off for |kappa| < |Z| just past half a turn, the turn is never completed.
        if softest is None and scan.omega.size and _past_half_a_turn(response, body, velocities[k], scan):
            w, e, modes = np.append(w, np.inf), np.append(e, np.inf), np.append(modes, 2)
        order = np.argsort(w)
        answers.append(Neutral(w[order], e[order], modes[order]))
    return answers


def _brackets(
    response: Response | AgedResponse, body: Impedance, velocity: float, scan: _Scan
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Intervals of frequency in which ``Im(Z + kappa)`` changes sign, and whether it rises there."""
    omega, value = scan
    negative = value < 0
    at = np.flatnonzero(negative[1:] != negative[:-1])
    left, right, rising = omega[at], omega[at + 1], negative[at]
    middle = _nearly_touching(value)
    low, high, side = omega[middle - 1], omega[middle + 1], np.sign(value[middle])
    for _ in range(6):
        if low.size == 0:
            break
        # A pair of zeros may be much closer than two frequencies of the scan: close in on the dip until it is decided.
        fine = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, 17)
        dip = _loss(response, body, velocity, fine) * side[:, None]
        row, column = np.nonzero((dip[:, 1:] < 0) != (dip[:, :-1] < 0))
        left = np.concatenate([left, fine[row, column]])
        right = np.concatenate([right, fine[row, column + 1]])
        rising = np.concatenate([rising, (dip[row, column] < 0) == (side[row] > 0)])
        lowest = np.clip(np.argmin(dip, axis=1), 1, 15)
        each = np.arange(low.size)
        before, here, after = dip[each, lowest - 1], dip[each, lowest], dip[each, lowest + 1]
        open_ = (here > 0) & (_vertex(before, here, after) < 0.5 * np.minimum(before, after))
        low, high, side = fine[each, lowest - 1][open_], fine[each, lowest + 1][open_], side[open_]
    return left, right, rising


def _past_half_a_turn(response: Response | AgedResponse, body: Impedance, velocity: float, scan: _Scan) -> bool:
    """Whether ``Z + kappa`` is through the negative real axis at the end of the scan, while ``Z`` never gets there."""
    if scan.value[-1] >= 0:
        return False
    s = 1j * scan.omega[-1:]
    z = complex(body(s)[0])
    total = z + complex(response.stiffness(velocity, s)[0])
    return math.atan2(total.imag, total.real) - math.atan2(max(z.imag, 0.0), z.real) < -math.pi


class _Scan(NamedTuple):
    omega: Array
    value: Array


def _scan(response: Response | AgedResponse, body: Impedance, velocity: float, softest: float | None = None) -> _Scan:
    """Sample ``Im(Z + kappa) |denominator|^2`` up to where nothing can happen any more."""
    if isinstance(response, AgedResponse):
        omega = response.frequencies(velocity)
        if not is_plain(body):
            omega = np.union1d(omega, _features(body, omega, body(1j * omega)))
        return _Scan(omega, _loss(response, body, velocity, omega))
    top = _doubtful_below(response, body, velocity, softest)
    if top == 0:
        return _Scan(np.empty(0), np.empty(0))
    axis = response.axis(velocity, top)
    stop = int(np.searchsorted(velocity * axis.y, top)) + 2
    part = Axis(y=axis.y[:stop], complement=axis.complement[:stop], shape=axis.shape[:stop], centre=axis.centre[:stop])
    omega = velocity * part.y
    z = body(1j * omega)
    numerator, denominator = response.axis_parts(velocity, part)
    value = z.imag * np.abs(denominator) ** 2 + (numerator * np.conj(denominator)).imag
    if not is_plain(body):
        more = _features(body, omega, z)
        order = np.argsort(np.concatenate([omega, more]), kind="stable")
        value = np.concatenate([value, _loss(response, body, velocity, more)])[order]
        omega = np.concatenate([omega, more])[order]
    return _Scan(omega, value)


def _doubtful_below(response: Response, body: Impedance, velocity: float, softest: float | None) -> float:
    """Frequency above which the disc that holds kappa, whatever the delay, rules out neutral modes; 0 for all."""
    scale = float(response.scale(velocity))
    held = None if softest is None else softest - float(body(np.zeros(1, dtype=complex))[0].real)
    special = np.concatenate([resonances(body), np.abs(natural_frequencies(body))]) / velocity
    top = 8.0 / response.std
    while True:
        axis = response.coarse_axis(top)
        last = axis.y.size // 4
        tail, end = axis.centre[-last:], float(axis.y[-1])
        own = special[special < end]
        y = np.concatenate([axis.y, own])
        order = np.argsort(y, kind="stable")
        y = y[order]
        centre = np.concatenate([axis.centre, np.interp(own, axis.y, axis.centre)])[order]
        z = body(1j * velocity * y)
        if np.any(z.imag < -1e-9 * np.abs(z)):
            at = float(velocity * y[np.argmin(z.imag / np.abs(z))])
            raise InputError(
                f"body: Im Z(i w) < 0 at w = {at:.4g}: the rig puts energy in; "
                "give one that only takes it out (damping of 0 or above)"
            )
        clear = _clear(z, centre, scale, held)
        if clear[y > axis.y[-last]].all() and _clear_beyond(body, velocity, end, special, tail, scale, held):
            break
        top *= 2
    doubtful = np.flatnonzero(~clear)
    return float(velocity * y[min(doubtful[-1] + 2, y.size - 1)]) if doubtful.size else 0.0


def _clear_beyond(
    body: Impedance, velocity: float, end: float, special: Array, tail: ComplexArray, scale: float, held: float | None
) -> bool:
    """Whether it stays so beyond the table: the response only shrinks there, but the rig may have features."""
    worst = float(np.max(np.abs(tail)))
    deficit = float(np.max(np.abs(tail) * (1 - 1e-14) - tail.imag))
    if is_plain(body) and body(np.array([1j * velocity * end]))[0].imag * scale >= deficit:
        return True
    z = body(1j * velocity * np.sort(np.concatenate([end * np.geomspace(1, 1e6, 200), special[special >= end]])))
    # A disc as large as any in the tail, and as far below the upper axis
    disc = complex(math.sqrt(max(deficit * (2 * worst - deficit), 0.0)), worst - deficit)
    return bool(_clear(z, np.full(z.shape, disc), scale, held).all())


def _clear(z: ComplexArray, centre: ComplexArray, scale: float, held: float | None) -> NDArray[np.bool_]:
    """Whether no delay distribution could make the mode at each frequency neutral (with `held`: nor on any stiffer spring)."""
    radius = np.abs(centre)
    lossy = z.imag * scale >= radius - centre.imag - 1e-14 * radius
    real = z.real + (held or 0.0)
    distance = np.abs(z) if held is None else np.where(real > 0, np.hypot(real, z.imag), np.abs(z.imag))
    strong = distance * scale > 2 * (1 + 1e-9) * radius
    # Between two frequencies on either side of a resonance |Z| may be small.
    turning = real[1:] * real[:-1] <= 0
    strong[1:] &= ~turning
    strong[:-1] &= ~turning
    return np.asarray(lossy | strong)


def _features(body: Impedance, omega: Array, z: ComplexArray) -> Array:
    """Frequencies to add to a scan where the impedance turns quickly."""
    known = resonances(body)
    added = known[(known > omega[0]) & (known < omega[-1])]
    for _ in range(40):
        grid = np.union1d(omega, added)
        z = body(1j * grid)
        turn = np.abs(np.angle(z[1:] * np.conj(z[:-1])))
        coarse = (turn > 0.3) & (np.diff(grid) > 1e-9 * grid[1:])
        if not coarse.any() or grid.size > SCAN_LIMIT:
            break
        added = np.union1d(added, 0.5 * (grid[1:] + grid[:-1])[coarse])
    return np.setdiff1d(added, omega)


def _loss(response: Response | AgedResponse, body: Impedance, velocity: float | Array, omega: Array) -> Array:
    """``Im(Z + kappa) |denominator|^2``: the same zeros as ``Im(Z + kappa)``, without its sharp peaks."""
    s = 1j * omega
    if isinstance(response, AgedResponse):
        return np.asarray((body(s) + response.stiffness(velocity, s)).imag)
    numerator, denominator = response.parts(velocity, s)
    return np.asarray(body(s).imag * np.abs(denominator) ** 2 + (numerator * np.conj(denominator)).imag)


def _nearly_touching(value: Array) -> NDArray[np.intp]:
    """Indices of local minima of ``|value|`` where a parabola through three points comes near zero."""
    side = np.sign(value[1:-1])
    before, here, after = value[:-2] * side, np.abs(value[1:-1]), value[2:] * side
    k = np.flatnonzero((here > 0) & (here <= before) & (here <= after))
    near = _vertex(before[k], here[k], after[k]) < 0.2 * np.minimum(before[k], after[k])
    return np.asarray(k[near] + 1)


def _vertex(before: Array, here: Array, after: Array) -> Array:
    """Lowest value of the parabola through three equally spaced points around a minimum."""
    bend = before - 2 * here + after
    return np.asarray(here - (after - before) ** 2 / (8 * np.maximum(bend, 1e-300)))


def _bracketed_zeros(function: Callable[[Array], Array], left: Array, right: Array) -> Array:
    """Chandrupatla's method on many brackets at once: bisection that jumps by inverse quadratic interpolation."""
    b, a = left.copy(), right.copy()
    fb, fa = function(b), function(a)
    c, fc = a.copy(), fa.copy()
    t = np.full(a.shape, 0.5)
    best = np.where(np.abs(fa) < np.abs(fb), a, b)
    for _ in range(60):
        x = a + t * (b - a)
        fx = function(x)
        same = np.sign(fx) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        width = np.abs(b - a)
        tolerance = 2e-15 * np.abs(best)
        if np.all((width <= 2 * tolerance) | (fa == 0)):
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            quadratic = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi)
            guess = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
            least = tolerance / np.maximum(width, 1e-300)
        t = np.clip(
            np.where(quadratic & np.isfinite(guess), guess, 0.5),
            np.minimum(least, 0.5),
            np.maximum(1 - least, 0.5),
        )
    return np.asarray(best)


# ---------------------------------------------------------------- the argument principle


def _product(
    response: Response, body: Impedance, velocity: float, s: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """``(Z + kappa)`` times the denominator of kappa, and that denominator."""
    if response.inert:
        return body(s), np.ones_like(s)
    numerator, denominator = response.parts(velocity, s)
    return body(s) * denominator + numerator, denominator


def _quiet_below(response: Response, body: Impedance, velocity: float) -> float:
    """Frequency below which ``|kappa| < Z(0)/2`` and ``|Z - Z(0)| < Z(0)/4``: no root there."""
    m1, m2 = response.distribution.moment(1), response.distribution.moment(2)
    tau1, tau2 = response.delay.moment(1), response.delay.moment(2)
    cycle, square = m1 / velocity + tau1, m2 / velocity**2 + 2 * m1 * tau1 / velocity + tau2
    held = float(body(np.zeros(1, dtype=complex))[0].real)
    omega = min(cycle / square, held * (velocity * cycle) ** 2 / (2 * m2 * tau1))
    while abs(complex(body(np.array([1j * omega]))[0]) - held) > 0.25 * held:
        omega *= 0.5
    return omega


def _slope_bound(response: Response, body: Impedance, velocity: float, omega: Array) -> Array:
    """Bound of ``|d product / d omega|`` on each interval, from ``|E|, |P^| <= 1`` and the moments."""
    m1, m2, tau1 = response.distribution.moment(1), response.distribution.moment(2), response.delay.moment(1)
    z = body(1j * omega)
    left, right = omega[:-1], omega[1:]
    match body:
        case SpringMassDamper(mass=mass):
            drag = mass * body.damping
        case RadiationDamping(mass=mass):
            drag = body.radiation
        case _:
            middle = body(0.5j * (left + right))
            z_slope = 3 * np.maximum(np.abs(middle - z[:-1]), np.abs(z[1:] - middle)) / (0.5 * (right - left))
            z_size = 1.5 * np.maximum(np.maximum(np.abs(z[:-1]), np.abs(z[1:])), np.abs(middle))
            return np.asarray(
                z_size * (tau1 + m1 / velocity)
                + 2 * z_slope
                + (3 * m2 / velocity + 2 * m1 * tau1) / response.scale(velocity)
            )
    z_slope = np.hypot(2 * mass * right, drag)
    z_size = np.hypot(np.maximum(np.abs(z[:-1].real), np.abs(z[1:].real)), z[1:].imag)
    return np.asarray(
        z_size * (tau1 + m1 / velocity) + 2 * z_slope + (3 * m2 / velocity + 2 * m1 * tau1) / response.scale(velocity)
    )


def _is_rightmost(response: Response, body: Impedance, velocity: float, roots: ComplexArray, limit: float) -> bool:
    """Whether no root lies to the right of the first one, from a count to the right of a line just left of it."""
    cycle = float(response.scale(velocity)) / velocity
    best = float(roots[0].real)
    after = roots.real[roots.real < best - 1e-6 / cycle]
    gap = best - max(float(after[0]) if after.size else -math.inf, limit, best - 0.2 / cycle)
    line = best - 0.5 * gap
    found = int(np.sum(np.where(roots.imag > 0, 2, 1)[roots.real > line]))
    return _count_right_of(response, body, velocity, line) == found


def _count_right_of(response: Response, body: Impedance, velocity: float, line: float) -> int | None:
    """Number of roots with ``Re s > line``, by the argument principle; None where phases cannot be followed."""
    reach = response.reach(velocity) / velocity
    own = natural_frequencies(body)
    held = poles(body)
    fine_top = 10 / reach if response.inert else 8.0 * velocity / response.std
    top = max(fine_top, 2.0 * float(np.max(np.abs(np.concatenate([own, held])), initial=0.0)), 10 / reach)
    near = [root.imag + max(abs(root.real - line), 1e-9 * abs(root)) * np.sinh(np.linspace(-6, 6, 121)) for root in own]
    for _ in range(30):
        fine = np.arange(0.0, min(top, fine_top), STEP / reach)
        omega = np.union1d(
            np.concatenate([fine, np.zeros(1), resonances(body), *near]), np.geomspace(1e-6 / reach, top, 400)
        )
        omega = omega[(omega >= 0) & (omega <= top)]
        with np.errstate(all="ignore"):
            s = line + 1j * omega
            product, _ = _product(response, body, velocity, s)
            ratio = product / body(s)
        if not np.all(np.isfinite(product)):
            return None
        if np.all(np.abs(ratio[omega >= 0.7 * top] - 1) < 0.7):
            break
        top *= 2
        if top > fine_top * 2:
            fine_top *= 2
        if fine.size > 1 << 15:
            return None
    for _ in range(40):
        with np.errstate(all="ignore"):
            turn = np.angle(product[1:] / product[:-1])
        coarse = ~(np.abs(turn) < 0.7) & (np.diff(omega) > 1e-12 * top)
        if not coarse.any():
            break
        new = 0.5 * (omega[1:] + omega[:-1])[coarse]
        order = np.argsort(np.concatenate([omega, new]), kind="stable")
        product = np.concatenate([product, _product(response, body, velocity, line + 1j * new)[0]])[order]
        omega = np.concatenate([omega, new])[order]
    along = float(np.sum(np.angle(product[1:] / product[:-1])))
    end = line + 1j * omega[-1]
    arc = abs(end) * np.exp(1j * np.linspace(0.0, np.angle(end), 2001))
    z = body(arc)
    around = float(np.sum(np.angle(z[1:] / z[:-1])))
    around += float(np.angle(product[-1] / z[-1]))
    zeros = (around - along) / math.pi
    if abs(zeros - round(zeros)) > 0.1:
        return None
    brought_in = 1 if line < 0 and not response.inert else 0  # the denominator vanishes at s = 0
    return round(zeros) - brought_in + int(np.sum(held.real > line))


def _starts_from_line(response: Response, body: Impedance, velocity: float, line: float) -> ComplexArray:
    """Where Newton's method would go in one step from points along a line: the roots near it, and some more."""
    cycle = float(response.scale(velocity)) / velocity
    memory = response.reach(velocity) / velocity
    top = 10.0 / cycle
    if not response.inert:
        top += 5.0 * velocity / response.std
    elif not natural_frequencies(body).size:
        top = 1e4 * top
    omega = np.arange(0.5, min(top * memory / STEP, 6_000)) * STEP / memory
    if line == 0.0 and not response.inert:
        axis = response.axis(velocity, top)
        omega = velocity * axis.y
        numerator, denominator = response.axis_parts(velocity, axis)
        value: ComplexArray = body(1j * omega) * denominator + numerator
    else:
        with np.errstate(all="ignore"):
            value = _product(response, body, velocity, line + 1j * omega)[0]
    s = line + 1j * omega
    with np.errstate(all="ignore"):
        if not response.inert:
            value = value / s
        step = -value / (-1j * np.gradient(value, omega))
    size = np.abs(step)
    # One start from each dip of the step along the line; roots further off have no dip of their own.
    dip = np.isfinite(size) & (size < 5.0 / cycle)
    dip[1:-1] &= (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    return np.asarray((s + step)[dip])


def _starts_on_real_axis(response: Response, body: Impedance, velocity: float, limit: float) -> ComplexArray:
    """Where ``Z + kappa`` changes sign on the real axis, from the limit (or as far left as matters) on."""
    cycle = float(response.scale(velocity)) / velocity
    # Far right kappa falls as v/(s (m1 + v <tau>)).
    soft = (
        0.0 if response.inert else velocity / float(response.scale(velocity) * body(np.zeros(1, dtype=complex))[0].real)
    )
    top = 10 * max(1 / cycle, soft, float(np.max(np.abs(natural_frequencies(body)), initial=0.0)))
    right = np.geomspace(1e-3 / cycle, top, 200)
    left = -np.geomspace(1e-3 / cycle, min(10 / cycle, -0.99 * limit), 60)[::-1] if limit < 0 else np.empty(0)
    starts = []
    for s in (left, right):
        if s.size:
            with np.errstate(all="ignore"):
                value = (_product(response, body, velocity, s + 0j)[0] / s).real
            at = np.flatnonzero(value[1:] * value[:-1] < 0)
            starts.append(0.5 * (s[at] + s[at + 1]))
    return np.concatenate(starts) + 0j


def _roots_from(
    response: Response, body: Impedance, velocity: float, starts: ComplexArray, limit: float
) -> ComplexArray:
    """Distinct roots to the right of a limit reached by Newton's method; one of each pair, rightmost first."""
    cycle = float(response.scale(velocity)) / velocity
    radius = 1e-3 / cycle
    if isinstance(body, Modes):
        radius = min(radius, 1e-2 * float(np.min(np.abs(natural_frequencies(body).real))))
    with np.errstate(all="ignore"):
        s, settled = _newton(response, body, velocity, starts.astype(complex), radius, 1.0 / cycle)
    return _distinct(s[settled & np.isfinite(s) & (s.real > limit)], cycle)


def _distinct(s: ComplexArray, cycle: float) -> ComplexArray:
    """One of each root and of each conjugate pair, rightmost first."""
    s = np.where(s.imag < 0, np.conj(s), s)
    s = np.where(np.abs(s.imag) < 1e-9 / cycle, s.real + 0j, s)
    distinct: list[complex] = []
    for root in s[np.argsort(-s.real, kind="stable")].tolist():
        if not any(abs(root - other) < 1e-8 * (abs(root) + 1 / cycle) for other in distinct):
            distinct.append(root)
    return np.array(distinct, dtype=complex)


def track_roots(
    response: Response | AgedResponse, body: Impedance, velocity: float, starts: ComplexArray
) -> ComplexArray:
    """Roots reached from those of a neighbouring rig, rightmost first; a search along the axis without any."""
    if isinstance(response, AgedResponse):
        return _roots_aged(response, body, velocity)
    limit = -math.inf if response.inert else response.leftmost * velocity
    if starts.size == 0:
        starts = np.concatenate(
            [
                natural_frequencies(body),
                _starts_on_real_axis(response, body, velocity, limit),
                _starts_from_line(response, body, velocity, 0.0),
            ]
        )
    return _roots_from(response, body, velocity, starts, limit)


def _newton(
    response: Response, body: Impedance, velocity: float, s: ComplexArray, radius: float, longest: float
) -> tuple[ComplexArray, NDArray[np.bool_]]:
    """Newton's method on ``product/s`` from many starts; slopes from Cauchy's integral on a small circle."""
    corner = np.append(0.0, np.exp(1j * math.pi * np.array([0.25, 0.75, 1.25, 1.75])))[:, None]

    def reduced(points: ComplexArray) -> ComplexArray:
        value = _product(response, body, velocity, points)[0]
        return value if response.inert else value / points

    settled = np.zeros(s.shape, dtype=bool)
    active = np.arange(s.size)
    last = np.full(s.shape, np.inf)
    for _ in range(30):
        here = s[active]
        around = reduced((here + radius * corner).ravel()).reshape(5, -1)
        slope = np.mean(around[1:] * np.conj(corner[1:]), axis=0) / radius
        step = -around[0] / slope
        size = np.abs(step)
        # Steps that no longer shrink are rounding; one that was large must not be taken in full.
        finished = (size < 1e-10 * (np.abs(here) + longest)) & (size > 0.1 * last[active])
        finished |= size < 1e-15 * np.abs(here)
        step = np.where(size > longest, step * longest / size, step)
        s[active] = here + step
        last[active] = size
        settled[active[finished]] = True
        active = active[~finished & np.isfinite(s[active])]
        if active.size == 0:
            break
    settled |= last < 1e-11 * (np.abs(s) + longest)
    return s, settled


# ---------------------------------------------------------------- thresholds that age

_ROUGH = 30
"""Cells of the gap for roots that are looked for, not polished."""
_LIVES = 4.0
"""How quickly a mode may decays to be looked for, per mean life."""


def _count_aged(response: AgedResponse, body: Impedance, velocity: float) -> int:
    (neutral,) = neutral_frequencies(response, body, [velocity])
    near = np.flatnonzero(np.abs(neutral.extra) < ACCURACY)
    if near.size:
        raise UndecidedError(
            f"smooth sliding at velocity {velocity:g} is neutral to within the accuracy of the response "
            f"({ACCURACY:g} of the stiffness of the contacts), at angular frequency {neutral.omega[near[0]]:.5g}: on "
            "its stability boundary; move a parameter to one side"
        )
    return neutral.unstable()


def _rightmost_aged(response: AgedResponse, body: Impedance, velocity: float) -> complex:
    growing = _count_aged(response, body, velocity)

    def value(s: complex) -> complex:
        points = np.array([s])
        return complex((body(points) + response.exact(velocity, points))[0])

    near = _roots_aged(response, body, velocity)
    polished = [root for root in (_secant(value, s, 1e-9) for s in near[:6].tolist()) if root is not None]
    roots = _distinct(np.array(polished, dtype=complex), 1.0 / velocity)
    found = int(np.sum(np.where(roots.imag > 0, 2, 1)[roots.real > 0]))
    if found == growing and roots.size:
        return complex(roots[0])
    if growing:
        raise UndecidedError(
            f"smooth sliding at velocity {velocity:g} has {growing} growing modes, not all of which were found"
        )
    raise UndecidedError(
        f"smooth sliding at velocity {velocity:g} is stable; its modes decays too quickly to be followed from the axis"
    )


def _roots_aged(response: AgedResponse, body: Impedance, velocity: float) -> ComplexArray:
    """Roots not far from the axis, rightmost first, one of each pair: by secants from the dips along the axis."""
    omega = response.frequencies(velocity)
    own = natural_frequencies(body)
    size = np.abs(body(1j * omega) + response.stiffness(velocity, 1j * omega))
    dip = np.flatnonzero((size[1:-1] < size[:-2]) & (size[1:-1] <= size[2:])) + 1
    dip = dip[np.argsort(size[dip])][:5]

    def value(points: ComplexArray) -> ComplexArray:
        return np.asarray(body(points) + response.exact(velocity, points, cells=_ROUGH))

    real = np.geomspace(omega[0], omega[-1], 40)
    turned = np.flatnonzero(np.diff(np.sign(value(real + 0j).real)))
    starts = np.concatenate([1j * omega[dip], own[own.imag > 0], np.sqrt(real[turned] * real[turned + 1])])
    # Further left what many lives have left behind grows beyond all bounds, and the errors of the grid with it.
    left = -_LIVES / response.life(velocity)
    before, s = starts * (1 + 0.02j * (starts.imag != 0) - 0.05 * (starts.imag == 0)), starts.copy()
    f_before, f = value(before), value(s)
    settled = np.zeros(s.shape, dtype=bool)
    with np.errstate(all="ignore"):
        for _ in range(25):
            step = np.where(settled | (f == f_before), 0.0, -f * (s - before) / (f - f_before))
            step *= np.minimum(1.0, 0.3 * np.abs(s) / np.maximum(np.abs(step), 1e-300))
            before, f_before, s = s, f, s + step
            settled |= np.abs(step) < 1e-6 * np.abs(s)
            s[s.real < left] = np.nan
            busy = np.isfinite(s) & ~settled
            if not busy.any():
                break
            f = f.copy()
            f[busy] = value(s[busy])
    return _distinct(s[settled & np.isfinite(s)], 1e-3 / float(omega[0]))


def _secant(function: Callable[[complex], complex], start: complex, tolerance: float) -> complex | None:
    """Root near a start; None where the search does not settle."""
    before, s = start * (1 + 1e-3j), start
    f_before, f = function(before), function(s)
    for _ in range(20):
        if f == f_before:
            return s
        step = -f * (s - before) / (f - f_before)
        if not abs(step) < 0.3 * abs(s):
            return None
        before, f_before, s = s, f, s + step
        if abs(step) < tolerance * abs(s):
            return complex(s.real, abs(s.imag))
        f = function(s)
    return None
