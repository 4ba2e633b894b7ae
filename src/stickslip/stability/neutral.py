"""Neutral frequencies: points on the imaginary axis at which some extra spring at the
interface would make a mode neutral.

On the axis the interface and the rig separate: with ``kappa`` computed once, each
frequency with ``Im(Z + kappa) = 0`` is neutral for exactly one extra spring,
``-Re(Z + kappa)``.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.sliding.response import Array, ComplexArray
from stickslip.stability.scan import SmoothSliding, loss, scan


class Neutral(NamedTuple):
    """Frequencies at which some extra spring at the interface makes a mode neutral.

    If the extra stiffness falls below `extra`, the number of growing modes increases by
    `modes` (2, or -2).
    """

    omega: Array
    extra: Array
    modes: NDArray[np.int64]

    def at(self, index: NDArray[Any]) -> "Neutral":
        """Return those at given indices."""
        return Neutral(*(each[index] for each in self))

    def unstable(self, added: float = 0.0) -> int:
        """Number of growing modes with a spring `added` at the interface."""
        return int(np.sum(self.modes[self.extra > added]))


NOTHING = Neutral(np.empty(0), np.empty(0), np.empty(0, dtype=np.int64))


def neutral_frequencies(
    rigs: Sequence[SmoothSliding], *, softest: float | None = None
) -> list[Neutral]:
    """Return the zeros of ``Im(Z + kappa)`` on the axis that affect the stability of
    each body at its velocity; the contacts of all are the same.

    With `softest` the result holds for every rig that has the same losses and masses
    and a total static stiffness of at least `softest`, else only for the rig itself.
    """
    response = rigs[0].response
    if response.inert:
        return [NOTHING for _ in rigs]
    scans = [scan(rig, softest) for rig in rigs]
    brackets = [_brackets(rig, *seen) for rig, seen in zip(rigs, scans, strict=True)]
    # All rigs together, as a call takes as long for a hundred frequencies as for one.
    counts = [left.size for left, _, _ in brackets]
    left = np.concatenate([each[0] for each in brackets])
    right = np.concatenate([each[1] for each in brackets])
    whose = np.repeat([id(rig.body) for rig in rigs], counts)
    speed = np.repeat([rig.velocity for rig in rigs], counts)
    bodies = {id(rig.body): rig.body for rig in rigs}

    def impedances(w: Array) -> ComplexArray:
        z = np.empty(w.shape, dtype=complex)
        for key, body in bodies.items():
            its = whose == key
            z[its] = body(1j * w[its])
        return z

    def total_loss(w: Array) -> Array:
        return loss(impedances(w), response.parts(speed, 1j * w))

    omega = _zeros(total_loss, left, right)
    total = impedances(omega) + response.stiffness(speed, 1j * omega)
    extra = -total.real
    answers = []
    end = 0
    for rig, seen, (_, _, rising) in zip(rigs, scans, brackets, strict=True):
        begin = end
        end += rising.size
        neutral = Neutral(omega[begin:end], extra[begin:end], np.where(rising, 2, -2))
        neutral = neutral.at(np.argsort(neutral.omega))
        frequency, value = seen
        if value.size and value[-1] < 0:
            beyond = _beyond(rig, frequency[-1], softest)
            neutral = Neutral(*map(np.append, neutral, beyond))
        answers.append(neutral)
    return answers


def _zeros(f: Callable[[Array], Array], left: Array, right: Array) -> Array:
    """Find zeros in brackets by the Illinois method (secants that keep a bracket); the
    end of a bracket where rounding removes the change of sign.
    """
    before = f(left)
    last = f(right)
    for _ in range(60):  # in the worst case as many as bisection takes
        step = np.divide(
            last * (right - left),
            last - before,
            out=np.zeros_like(last),
            where=before * last < 0,
        )
        if np.all(np.abs(step) <= 1e-12 * right):  # the best accuracy of kappa
            break
        here = f(right - step)
        # an end that is kept again counts with half its value
        left, before = np.where(here * last > 0, (left, 0.5 * before), (right, last))
        right = right - step
        last = here
    return right


def _brackets(
    sliding: SmoothSliding,
    omega: Array,
    value: Array,
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Intervals of frequency in which ``Im(Z + kappa)`` changes sign, and whether it
    rises there.
    """
    negative = value < 0
    at = np.flatnonzero(negative[1:] != negative[:-1])
    left = omega[at]
    right = omega[at + 1]
    rising = negative[at]
    middle = _nearly_touching(value)
    low = omega[middle - 1]
    high = omega[middle + 1]
    side = np.sign(value[middle])
    for _ in range(6):
        if low.size == 0:
            break
        # A pair of zeros may be much closer than two frequencies of the scan: refine
        # the dip until it is decided.
        fine = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, 17)
        parts = sliding.response.parts(sliding.velocity, 1j * fine)
        total = loss(sliding.body(1j * fine), parts)
        dip = total * side[:, None]
        below = dip < 0
        row, column = np.nonzero(below[:, 1:] != below[:, :-1])
        rises = below[row, column] == (side[row] > 0)
        left = np.concatenate([left, fine[row, column]])
        right = np.concatenate([right, fine[row, column + 1]])
        rising = np.concatenate([rising, rises])
        lowest = np.clip(np.argmin(dip, axis=1), 1, 15)
        each = np.arange(low.size)
        before = dip[each, lowest - 1]
        here = dip[each, lowest]
        after = dip[each, lowest + 1]
        lower_side = np.minimum(before, after)
        undecided = (here > 0) & (_vertex(before, here, after) < 0.5 * lower_side)
        low = fine[each, lowest - 1][undecided]
        high = fine[each, lowest + 1][undecided]
        side = side[undecided]
    return left, right, rising


def _beyond(
    sliding: SmoothSliding,
    end: float,
    softest: float | None,
) -> tuple[Any, Any, Any]:
    """Frequency, extra stiffness and number of the modes that cross beyond the end of
    the scan; empty arrays if there are none.
    """
    z = complex(sliding.body(np.array([1j * end]))[0])
    at_rest = complex(sliding.body(np.array([0j]))[0])
    total = z + complex(sliding.response.stiffness(sliding.velocity, 1j * end))
    # Without mass and damping half a turn remains at high frequency, which is one real
    # mode.
    if z == at_rest:
        return math.inf, -total.real, 1
    angle_of_body = math.atan2(max(z.imag, 0.0), z.real)
    turned = math.atan2(total.imag, total.real) - angle_of_body
    # For |kappa| < |Z| just past half a turn, the turn is never completed.
    if softest is None and turned < -math.pi:
        return math.inf, math.inf, 2
    return NOTHING


def _nearly_touching(value: Array) -> NDArray[np.intp]:
    """Indices of local minima of ``|value|`` at which a parabola through three points
    comes near zero.
    """
    side = np.sign(value[1:-1])
    before = value[:-2] * side
    here = np.abs(value[1:-1])
    after = value[2:] * side
    lower_side = np.minimum(before, after)
    k = np.flatnonzero((here > 0) & (here <= lower_side))
    lowest = _vertex(before[k], here[k], after[k])
    near = lowest < 0.2 * lower_side[k]
    return k[near] + 1


def _vertex(before: Array, here: Array, after: Array) -> Array:
    """Lowest value of the parabola through three equally spaced points around a
    minimum.
    """
    bend = np.maximum(before - 2 * here + after, 1e-300)
    depth = (after - before) ** 2 / (8 * bend)
    return np.asarray(here - depth)
