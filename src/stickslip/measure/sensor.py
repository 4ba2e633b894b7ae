"""Noise and resolution of a sensor, and its faults: saturation, spikes, and values that
mean "no reading".
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, median_filter, minimum_filter

from stickslip.arrays import Array
from stickslip.io.table_text import FEWEST_READINGS

ROUNDING = 1e-9  # of the largest force: what is below this is rounding
SIGMAS = 6.0  # a sample more standard deviations off than this is not noise
Mask = NDArray[np.bool_]
FEW = 0.05  # largest fraction of the samples that may be faults of the sensor
# A saturated force has at least this many peaks of at least this many equal samples. It
# is compared with at least `FEWEST_FLAT` samples just below.
FLAT_PEAKS = 3
FLAT_RUN = 3
FEWEST_FLAT = 10
FEWEST_MOVING = 3  # successive values that show a motion: a spark and its echo are two
_BESIDE = [1, 1, 0, 1, 1]  # neighbours with which a sample is compared
_FOR_NOISE = 500_000  # most samples from which the noise is estimated
_FOR_RESOLUTION = 50_000  # most samples from which the resolution is estimated


def white_noise(force: Array) -> float:
    """Return the standard deviation of the white noise of a force, from the second
    differences, without the large ones, which are those of slips.
    """
    bend = _bends(force)
    first = noise = float(np.median(bend)) / 0.6745
    for _ in range(4):
        kept = bend[bend <= 2.0 * noise]  # at least half of them
        # 0.6396: median of a half-normal distribution truncated at 2
        noise = max(float(np.median(kept)) / 0.6396, 0.5 * first)
    return noise / math.sqrt(6.0)


def _bends(force: Array) -> Array:
    """Return absolute second differences, of an even selection from a long record."""
    every = max(1, force.size // _FOR_NOISE)
    return np.abs(force[:-2:every] - 2.0 * force[1:-1:every] + force[2::every])


def resolution(force: Array) -> float:
    """Return the step of the values of a recorded force: the least between values that
    occur again, as interpolated ones do not; 0 if the values do not repeat.
    """
    force = force[:: max(1, force.size // _FOR_RESOLUTION)]
    values, counts = np.unique(force, return_counts=True)
    again = values[counts > 1]
    if again.size < 2 or values.size > force.size // 2:
        return 0.0
    steps = np.diff(again)
    return float(steps[steps > ROUNDING * np.ptp(again)].min())


def note_saturation(force: Array) -> tuple[str, ...]:
    """Note at which end of its range the force looks saturated."""
    return tuple(
        f"the {edge}s of the force are flat at {extreme:.4g}: the sensor or its "
        "amplifier seems to be saturated; drops are larger than what was recorded"
        for edge, way, extreme in (
            ("top", 1.0, force.max()),
            ("bottom", -1.0, force.min()),
        )
        if _is_flat(way * force)
    )


def far_outside(force: Array) -> Mask:
    """Return a mask of samples that are farther from all others than any of those from
    one another, such as -9999 or a spark, but not of values that vary from sample to
    sample, as in a motion.
    """
    known = np.isfinite(force)
    none = _stands_for_none(force)
    found = ~known | none
    for side in (1.0, -1.0, 1.0):
        values = side * force[~found]
        if values.size < FEWEST_READINGS:
            break
        many = int(FEW * values.size)
        values.partition(many)
        lowest = np.sort(values[: many + 1])
        gaps = np.diff(lowest)
        below = np.flatnonzero(gaps > values.max() - lowest[1:])
        if below.size:
            found |= side * force <= lowest[below[-1]]
    inside = ~found
    inner = np.flatnonzero(inside)
    if inner.size:
        # before and after the test, the bench may be unloaded
        unloaded = _unloaded(force, force[inner])
        unloaded[inner[0] : inner[-1] + 1] = False
        found &= ~unloaded
    found &= known
    moving = _moves(force, found)
    if moving.any():
        readings = force[inside | moving]
        found &= none | (force < readings.min()) | (force > readings.max())
    return found


def _moves(force: Array, outside: Mask) -> Mask:
    """Return a mask of the outside samples in which the force takes several successive
    values, as in a motion; no reading, or a spark, has one value.
    """
    edges = np.flatnonzero(np.diff(outside, prepend=False, append=False))
    runs = edges.reshape(-1, 2)
    runs = runs[runs[:, 1] - runs[:, 0] >= FEWEST_MOVING]
    found = np.zeros(force.size, dtype=bool)
    for begin, end in runs.tolist():
        found[begin:end] = np.unique(force[begin:end]).size >= FEWEST_MOVING
    return found


def _stands_for_none(force: Array) -> Mask:
    """Return a mask of the samples of one recurring value that is farther from all
    others than any of those from one another: it means "no reading", however many.
    """
    known = force[np.isfinite(force)]
    for value in (known.min(), known.max()) if known.size else ():
        others = known[known != value]
        often = FEWEST_FLAT <= known.size - others.size <= others.size
        if often and np.abs(others - value).min() > np.ptp(others) > 0.0:
            return np.asarray(force == value)
    return np.zeros(force.size, dtype=bool)


def _unloaded(force: Array, others: Array) -> Mask:
    """Return a mask of forces smaller in size than all `others`: the bench is unloaded,
    rather than the reading missing.
    """
    return np.asarray(np.abs(force) < np.abs(others).min())


def spikes(force: Array) -> Mask:
    """Return a mask of electrical spikes: samples farther from their four neighbours
    than those from one another.
    """
    found = np.zeros(force.size, dtype=bool)
    known = np.flatnonzero(np.isfinite(force))
    values = force[known]
    lowest = minimum_filter(values, footprint=_BESIDE, mode="mirror")
    highest = maximum_filter(values, footprint=_BESIDE, mode="mirror")
    beyond = np.maximum(lowest - values, values - highest)
    apart = beyond > highest - lowest
    # without leaving out the differences of slips, so that slips are no spikes
    usual = 1.4826 * np.median(_bends(values)) / math.sqrt(6.0)
    noise = max(usual, resolution(values) / math.sqrt(12.0))
    off = np.abs(values - median_filter(values, 5))
    apart &= off > SIGMAS * noise
    # At an end one cannot see whether the force returns, as after a spike: there a
    # spike must exceed the largest range of four samples, as of a slip, and must not
    # be that of an unloaded bench.
    for end, beside in ((0, 1), (-1, -2)):
        if apart[end]:
            inner = values[1:-1][~apart[1:-1]]
            steps = maximum_filter(inner, 4) - minimum_filter(inner, 4)
            is_far = abs(values[end] - values[beside]) > steps.max()
            apart[end] = is_far and not _unloaded(values[end], inner)
    # many jumps belong to the motion, not to the sensor
    if np.count_nonzero(apart) <= FEW * values.size:
        found[known[apart]] = True
    return found


def _is_flat(force: Array) -> bool:
    """Whether a force repeatedly stays at its largest value, for much longer than at
    values just below; False if too few samples are just below.
    """
    top = force.max()
    at = force == top
    edges = np.flatnonzero(np.diff(at, prepend=False, append=False))
    runs = np.diff(edges)[::2]
    if np.count_nonzero(runs >= FLAT_RUN) < FLAT_PEAKS:
        return False
    near = force[~at & (force > top - 0.2 * np.ptp(force))]
    if near.size < FEWEST_FLAT:
        return False
    _, counts = np.unique(near, return_counts=True)
    # count of the value of a typical reading: a filter makes rare values between steps
    usual = np.median(np.repeat(counts, counts))
    return bool(FEWEST_FLAT * usual <= np.count_nonzero(at) <= 0.9 * force.size)
