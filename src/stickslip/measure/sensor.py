"""Faults of the sensor of a trace: saturation, spikes, values that stand for none."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, median_filter, minimum_filter

from stickslip.measure.slips import resolution
from stickslip.measure.trace import FEWEST_READINGS, Array

SIGMAS = 6.0  # standard deviations of the noise: what lies farther off is none of it
FEW = 0.05  # largest part of the samples that may be faults of the sensor
# samples, consecutive samples and peaks that make a saturated sensor
FEWEST_FLAT = 10
FLAT_RUN = 3
FLAT_PEAKS = 3


def note_saturation(force: Array) -> tuple[str, ...]:
    """What looks like a fault of the sensor."""
    return tuple(
        f"the {edge}s of the force are flat at {force[int(np.argmax(extreme))]:.4g}: "
        "the sensor or its amplifier seems "
        "to be saturated; drops are larger than what was recorded"
        for extreme, edge in ((force, "top"), (-force, "bottom"))
        if _is_flat(extreme)
    )


def far_outside(force: Array) -> NDArray[np.bool_]:
    """Samples farther from all others than these ever are from one another: -9999,
    or a spark.
    """
    found = ~np.isfinite(force) | _stands_for_none(force)
    for side in (1.0, -1.0, 1.0):
        values = side * force[~found]
        if values.size < FEWEST_READINGS:
            break
        values.partition(many := int(FEW * values.size))
        few = np.sort(values[: many + 1])
        below = np.flatnonzero(np.diff(few) > values.max() - few[1:])
        if below.size:
            found |= side * force <= few[below[-1]]
    inner = np.flatnonzero(~found)
    known = np.isfinite(force)
    for end in (slice(inner[0]), slice(inner[-1] + 1, None)) if inner.size else ():
        # as a bench is before and after the test
        found[end] &= ~_unloaded(force[end], force[inner])
    return found & known


def _stands_for_none(force: Array) -> NDArray[np.bool_]:
    """Samples of one value that recurs farther from the others than these from one
    another: however many, they are no reading.
    """
    known = force[np.isfinite(force)]
    for value in (known.min(), known.max()) if known.size else ():
        others = known[known != value]
        often = FEWEST_FLAT <= known.size - others.size <= others.size
        if often and np.abs(others - value).min() > np.ptp(others) > 0.0:
            return np.asarray(force == value)
    return np.zeros(force.size, dtype=bool)


def _unloaded(force: Array, others: Array) -> NDArray[np.bool_]:
    """Which forces are smaller in size than all others: no load, rather than no
    reading.
    """
    return np.asarray(np.abs(force) < np.abs(others).min())


def spikes(force: Array) -> NDArray[np.bool_]:
    """Electrical spikes: samples farther from the four beside them than these, as in
    a slip, from one another.
    """
    found = np.zeros(force.size, dtype=bool)
    known = np.flatnonzero(np.isfinite(force))
    values = force[known]
    bend = float(np.median(np.abs(np.diff(values, 2))))
    least = SIGMAS * max(
        1.4826 * bend / math.sqrt(6.0), resolution(values) / math.sqrt(12.0)
    )
    lowest, highest = (
        extreme(values, footprint=[1, 1, 0, 1, 1])
        for extreme in (minimum_filter, maximum_filter)
    )
    apart = np.maximum(lowest - values, values - highest) > highest - lowest
    apart &= np.abs(values - median_filter(values, 5)) > least
    apart[[0, -1]] = False
    # At an end it is not seen whether a force comes back as a spike does: there it must
    # exceed what slips make of four.
    rest = values[~apart][1:-1]
    least = max(least, float((maximum_filter(rest, 4) - minimum_filter(rest, 4)).max()))
    for at, beside in ((0, rest[:4]), (-1, rest[-4:])):
        off = max(beside.min() - values[at], values[at] - beside.max())
        apart[at] = off > least and not _unloaded(values[at], beside)
    # where many are so, they are no faults
    if np.count_nonzero(apart) <= FEW * values.size:
        found[known[apart]] = True
    return found


def _is_flat(force: Array) -> bool:
    """Whether a force stays at its largest value again and again, much longer than
    at values just below.
    """
    top = float(force.max())
    at = force == top
    runs = np.diff(np.flatnonzero(np.diff(at, prepend=False, append=False)))[::2]
    near = force[~at & (force > top - 0.2 * (top - float(force.min())))]
    usual = (
        float(np.median(np.unique(near, return_counts=True)[1])) if near.size else 1.0
    )
    often = FEWEST_FLAT * usual <= np.count_nonzero(at) <= 0.9 * force.size
    return bool(often and np.count_nonzero(runs >= FLAT_RUN) >= FLAT_PEAKS)
