"""The root finder for ``Z + kappa``, for any contacts and any rig.

Growing modes are counted from the neutral frequencies. Newton's method searches roots
from the dips of its step along the imaginary axis, then along lines beside it; the
rightmost root is confirmed by the count and, where a response is known to the left of
the axis, by the argument principle on a line just left of the root.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from stickslip.errors import UndecidedError
from stickslip.model.structure import Structure
from stickslip.sliding.response import STEP, Array, ComplexArray, Parts, Response
from stickslip.stability.impedances import (
    is_plain,
    natural_frequencies,
    poles,
    resonances,
)
from stickslip.stability.neutral import Neutral, neutral_frequencies
from stickslip.stability.scan import SmoothSliding, doubtful_below, merged

# most frequencies on a line left of the axis on which the roots to its right are
# counted
_MOST_FREQUENCIES = 1 << 15
# factor on the error of a response in the extra stiffness of a neutral mode
_ROUNDINGS = 10.0
# points near a root from which Newton's method takes the value and its slope
_ABOUT = np.array([0.0, 1.0, -1.0])


@lru_cache(maxsize=256)
def _kept_neutral(sliding: SmoothSliding) -> Neutral:
    return neutral_frequencies([sliding])[0]


def _neutral(sliding: SmoothSliding) -> Neutral:
    """Return the neutral frequencies of one body, cached where possible."""
    # a body that is not a plain record may not be hashable
    known: Any = _kept_neutral if is_plain(sliding.body) else _kept_neutral.__wrapped__
    found: Neutral = known(sliding)
    return found


def count(sliding: SmoothSliding) -> int:
    """Count the roots of ``Z + kappa`` with ``Re s > 0``, from the neutral frequencies.

    Raises `UndecidedError` if a mode lies on the stability boundary to within the
    accuracy of the response.
    """
    neutral = _neutral(sliding)
    near = np.flatnonzero(np.abs(neutral.extra) < sliding.response.accuracy)
    if near.size:
        raise UndecidedError(
            f"{sliding} is on its stability boundary to within the accuracy of the "
            f"response ({sliding.response.accuracy:g} of the stiffness of the "
            f"contacts), at angular frequency {neutral.omega[near[0]]:.9g}; change a "
            "parameter slightly"
        )
    return neutral.unstable()


def rightmost(sliding: SmoothSliding) -> complex:
    """Return the root of ``Z + kappa`` with the largest real part, one of a pair.

    Raises `UndecidedError` if growing modes are missing, or the slowest decay cannot be
    computed.
    """
    neutral = _neutral(sliding)
    growing = neutral.unstable()
    response = sliding.response
    # rounding decides whether modes on the stability boundary grow
    margin = response.accuracy * (_ROUNDINGS if response.certain else 1.0)
    fewest, most = sorted(neutral.unstable(added) for added in (margin, -margin))
    scales = sliding.scales
    starts = _first_starts(sliding, neutral)
    roots = np.empty(0, dtype=complex)
    for step in _lines(response, growing, scales.leftmost):
        line = max(step / scales.pace, 0.9 * scales.leftmost)
        starts = np.concatenate([starts, _starts_from_line(sliding, line)])
        roots = _polished(sliding, starts)
        grown = with_partners(roots[roots.real > 0])
        expected = min(max(grown, fewest), most)
        if is_rightmost(sliding, roots, expected):
            return complex(roots[0])
        starts = roots
    if growing:
        raise UndecidedError(
            f"{sliding} has {growing} growing modes, not all of which were found"
        )
    raise UndecidedError(
        f"{sliding} is stable, but its slowest "
        "mode cannot be computed: modes "
        "decay as the tail of the distribution of thresholds does, or too quickly to "
        "be followed; count_unstable() "
        "says 0"
    )


def near(sliding: SmoothSliding, starts: ComplexArray) -> ComplexArray:
    """Return the roots near those of a neighbouring rig, rightmost first; without any,
    the roots near the axis.
    """
    if starts.size == 0:
        starts = np.concatenate(
            [
                _first_starts(sliding),
                _starts_from_line(sliding, 0.0),
            ]
        )
    return _polished(sliding, starts)


def _lines(response: Response, growing: int, limit: float) -> tuple[float, ...]:
    """Return the lines beside the axis along which to search, as real parts in units of
    the inverse pace of the response.
    """
    if growing:
        return (0.0, 0.3, 1.0, 3.0, 0.1)
    if not response.has_denominator:
        return (0.0,)
    return (0.0, -0.1, -0.4, -1.0, -3.0, -8.0) if limit < 0 else ()


def with_partners(roots: ComplexArray) -> int:
    """Number of roots, where a complex pair counts as 2."""
    return int(np.sum(np.where(roots.imag > 0, 2, 1)))


def _value(
    sliding: SmoothSliding,
    s: ComplexArray,
    parts: Parts | None = None,
) -> ComplexArray:
    """Return ``Z + kappa`` times the denominator of kappa, without its zero at 0; not
    finite where it overflows. The parts of kappa may be given.
    """
    response = sliding.response
    with np.errstate(all="ignore"):
        numerator, denominator = parts or response.parts(sliding.velocity, s)
        return (sliding.body(s) * denominator + numerator) / s**response.origin


def _first_starts(
    sliding: SmoothSliding, neutral: Neutral | None = None
) -> ComplexArray:
    """Return starts of Newton's method: modes of the rig alone, neutral modes, and
    changes of sign of ``Z + kappa`` on the real axis.
    """
    own = natural_frequencies(sliding.body)
    cycle, _, _, _, limit = sliding.scales
    # Far to the right kappa falls with the rate at which contacts attach.
    inert = sliding.response.inert
    soft = 0.0 if inert else 1.0 / (cycle * sliding.static_stiffness)
    top = 10 * max(1 / cycle, soft, float(np.max(np.abs(own), initial=0.0)))
    lines = [np.geomspace(1e-3 / cycle, top, 200)]
    if limit < 0:
        lines.append(
            -np.geomspace(1e-3 / cycle, min(10 / cycle, -0.99 * limit), 60)[::-1]
        )
    starts = [own]
    for s in lines:
        value = np.sign(_value(sliding, s + 0j).real)
        at = np.flatnonzero(value[1:] * value[:-1] < 0)
        starts.append(0.5 * (s[at] + s[at + 1]) + 0j)
    if neutral is not None:
        starts.append(1j * neutral.omega[np.isfinite(neutral.omega)])
    return np.concatenate(starts)


def _starts_from_line(sliding: SmoothSliding, line: float) -> ComplexArray:
    """Return starts one step of Newton's method away from points along a line: the
    roots near it, and some more.
    """
    cycle, pace, _, fastest, _ = sliding.scales
    top = 10.0 / cycle + fastest
    if sliding.response.inert and not natural_frequencies(sliding.body).size:
        top = 1e4 * top
    if pace < cycle:  # kappa does not fade
        top = max(doubtful_below(sliding, None), top)
    parts = None
    if line == 0.0:
        omega, parts = sliding.response.sampled(sliding.velocity, top)
    else:
        omega = sliding.response.frequencies(sliding.velocity, top)
    value = _value(sliding, line + 1j * omega, parts)
    with np.errstate(all="ignore"):
        step = -value / (-1j * np.gradient(value, omega))
    size = np.abs(step)
    # One start from each dip of the step along the line; roots further away have no dip
    # near them.
    dip = np.isfinite(size) & (size < 5.0 / pace)
    dip[1:-1] &= (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    return (line + 1j * omega + step)[dip]


def _polished(sliding: SmoothSliding, starts: ComplexArray) -> ComplexArray:
    """Return distinct roots to which Newton's method converges, right of the limit; one
    of each pair, rightmost first.
    """
    cycle, pace, _, _, limit = sliding.scales
    longest = 1.0 / pace
    radius = 1e-3 / cycle
    if isinstance(sliding.body, Structure):
        own = natural_frequencies(sliding.body)
        widths = np.maximum(np.abs(own.real), 1e-6 * np.abs(own))
        radius = min(radius, 1e-2 * float(np.min(widths)))
    # The slope, accurate to 1e-6, leaves an error of that fraction of a step; where
    # values are expensive, no further step is taken, nor steps far to the left.
    enough, furthest = (1e-15, -math.inf) if sliding.response.certain else (1e-5, limit)
    s = starts.astype(complex)
    last = np.full(starts.shape, np.inf)
    settled = np.zeros(s.shape, dtype=bool)
    active = np.flatnonzero(s.real > furthest)
    with np.errstate(all="ignore"):
        for _ in range(30):
            if active.size == 0:
                break
            here = s[active]
            points = np.asarray(
                here + radius * _ABOUT[:, None], dtype=np.complex128
            ).ravel()
            value, after, before = _value(sliding, points).reshape(3, -1)
            step = -2.0 * radius * value / (after - before)
            size = np.abs(step)
            # Steps that no longer shrink are rounding; a step that was large must not
            # be taken in full.
            finished = (size < 1e-10 * (np.abs(here) + longest)) & (
                size > 0.1 * last[active]
            )
            finished |= size < enough * np.abs(here)
            step = np.where(size > longest, step * longest / size, step)
            s[active] = here + step
            last[active] = size
            settled[active[finished]] = True
            active = active[
                ~finished & np.isfinite(s[active]) & (s[active].real > furthest)
            ]
        settled |= last < 1e-11 * (np.abs(s) + longest)
        s = s[settled & np.isfinite(s) & (s.real > limit)]
        # elsewhere kappa is a ratio of rounding errors
        known = sliding.response.parts(sliding.velocity, s).denominator
        return _distinct(s[np.abs(known) > sliding.response.accuracy], cycle)


def _distinct(s: ComplexArray, cycle: float) -> ComplexArray:
    """Return each root once, one of each conjugate pair, rightmost first."""
    s = np.where(s.imag < 0, np.conj(s), s)
    s = np.where(np.abs(s.imag) < 1e-9 / cycle, s.real + 0j, s)
    distinct: list[complex] = []
    for root in s[np.argsort(-s.real, kind="stable")].tolist():
        if not any(
            abs(root - other) < 1e-8 * (abs(root) + 1 / cycle) for other in distinct
        ):
            distinct.append(root)
    return np.array(distinct, dtype=complex)


def is_rightmost(
    sliding: SmoothSliding,
    roots: ComplexArray,
    growing: int,
) -> bool:
    """Whether the first root is the rightmost: all growing roots are known, or there
    are none.

    Without growing modes this follows from a count of the roots right of a line just
    left of the first root.
    """
    if roots.size == 0 or growing != with_partners(roots[roots.real > 0]):
        return False
    if growing or not sliding.response.has_denominator:
        return True
    cycle, _, _, _, limit = sliding.scales
    best = float(roots[0].real)
    after = roots.real[roots.real < best - 1e-6 / cycle]
    nearest = max(
        float(after[0]) if after.size else -math.inf,
        limit,
        best - 0.2 / cycle,
    )
    line = 0.5 * (best + nearest)
    return count_right_of(sliding, line) == with_partners(roots[roots.real > line])


def _turns(value: ComplexArray) -> Array:
    """Return the angles about zero by which each value turns to the next."""
    return np.angle(value[1:] / value[:-1])


def count_right_of(sliding: SmoothSliding, line: float) -> int | None:
    """Return the number of roots with ``Re s > line``, by the argument principle; None
    where phases cannot be followed.
    """

    def product(omega: Array) -> ComplexArray:
        s = line + 1j * omega
        with np.errstate(all="ignore"):
            return _value(sliding, s) * s**sliding.response.origin

    held = poles(sliding.body)
    followed = _followed_line(sliding, line, product)
    if followed is None:
        return None
    omega, value = followed
    along = float(np.sum(_turns(value)))
    end = line + 1j * omega[-1]
    arc = abs(end) * np.exp(1j * np.linspace(0.0, np.angle(end), 2001))
    z = sliding.body(arc)
    around = float(np.sum(_turns(z)))
    around += float(np.angle(value[-1] / z[-1]))
    zeros = (around - along) / math.pi
    if abs(zeros - round(zeros)) > 0.1:
        return None
    return (
        round(zeros)
        - (sliding.response.origin if line < 0 else 0)
        + int(np.sum(held.real > line))
    )


def _followed_line(
    sliding: SmoothSliding,
    line: float,
    product: Callable[[Array], ComplexArray],
) -> tuple[Array, ComplexArray] | None:
    """Return frequencies along a line so close that the phase of a product can be
    followed, and the product there.
    """
    own = natural_frequencies(sliding.body)
    scales = sliding.scales
    unit = 1.0 / scales.memory
    fine_top = 10 * unit
    if math.isfinite(scales.fastest):
        fine_top = max(fine_top, scales.fastest)
    top = max(
        fine_top,
        2.0
        * float(
            np.max(np.abs(np.concatenate([own, poles(sliding.body)])), initial=0.0)
        ),
    )
    near = [
        root.imag
        + max(abs(root.real - line), 1e-9 * abs(root))
        * np.sinh(np.linspace(-6, 6, 121))
        for root in own
    ]
    for _ in range(30):
        fine = np.arange(0.0, min(top, fine_top), STEP * unit)
        places = [
            fine,
            np.zeros(1),
            resonances(sliding.body),
            *near,
            np.geomspace(1e-6 * unit, top, 400),
        ]
        omega = np.unique(np.concatenate(places))
        omega = omega[(omega >= 0) & (omega <= top)]
        value = product(omega)
        if not np.all(np.isfinite(value)):
            return None
        if np.all(
            np.abs(value / sliding.body(line + 1j * omega) - 1)[omega >= 0.7 * top]
            < 0.7
        ):
            break
        top *= 2
        if top > fine_top * 2:
            fine_top *= 2
        if fine.size > _MOST_FREQUENCIES:
            return None
    for _ in range(40):
        with np.errstate(all="ignore"):
            turn = _turns(value)
        coarse = ~(np.abs(turn) < 0.7) & (np.diff(omega) > 1e-12 * top)
        if not coarse.any():
            break
        new = 0.5 * (omega[1:] + omega[:-1])[coarse]
        omega, value = merged(omega, new, value, product(new))
    return omega, value
