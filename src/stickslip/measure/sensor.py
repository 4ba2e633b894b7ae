"""The noise and the resolution of a sensor, and its faults: saturation, spikes, values
that stand for none.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, median_filter, minimum_filter

from stickslip.measure.trace import FEWEST_READINGS, Array

SIGMAS = 6.0  # standard deviations: a sample farther off is no noise
Mask = NDArray[np.bool_]
FEW = 0.05  # largest part of the samples that may be faults of the sensor
# samples, consecutive samples and peaks that make a saturated sensor
FEWEST_FLAT = 10
FLAT_RUN = 3
FLAT_PEAKS = 3
_BESIDE = [1, 1, 0, 1, 1]  # samples that one is compared with
# samples from which noise, and the step of a recording, are read
_FOR_NOISE = 500_000
_FOR_RESOLUTION = 50_000


def white_noise(force: Array) -> float:
    """Standard deviation of white noise, from second differences; those that many
    slips spoil are left out.
    """
    bend = _bends(force)
    first = noise = float(np.median(bend)) / 0.6745
    for _ in range(4):
        kept = bend[bend <= 2.0 * noise]
        if kept.size < 0.5 * bend.size:
            break
        # 0.6396: median of a half-normal cut at 2
        noise = max(float(np.median(kept)) / 0.6396, 0.5 * first)
    return noise / math.sqrt(6.0)


def _bends(force: Array) -> Array:
    """Sizes of second differences, of some samples evenly over a long record."""
    every = max(1, force.size // _FOR_NOISE)
    return np.abs(force[:-2:every] - 2.0 * force[1:-1:every] + force[2::every])


def resolution(force: Array) -> float:
    """Step in which a trace was recorded, interpolated samples left aside; 0 if its
    values lie on no coarse grid.
    """
    values = np.unique(force := force[:: max(1, force.size // _FOR_RESOLUTION)])
    coarse = 1 < values.size <= force.size // 2
    return float(np.median(np.diff(values))) if coarse else 0.0


def note_saturation(force: Array) -> tuple[str, ...]:
    """Note where the force looks saturated."""
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
    """Samples farther from all others than these ever are from one another: -9999,
    or a spark.
    """
    known = np.isfinite(force)
    found = ~known | _stands_for_none(force)
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
    inner = np.flatnonzero(~found)
    if inner.size:
        # as a bench is before and after the test
        unloaded = _unloaded(force, force[inner])
        unloaded[inner[0] : inner[-1] + 1] = False
        found &= ~unloaded
    return found & known


def _stands_for_none(force: Array) -> Mask:
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


def _unloaded(force: Array, others: Array) -> Mask:
    """Mark the forces that are smaller in size than all others: no load, rather than no
    reading.
    """
    return np.asarray(np.abs(force) < np.abs(others).min())


def spikes(force: Array) -> Mask:
    """Electrical spikes: samples farther from the four beside them than these, as in
    a slip, from one another.
    """
    found = np.zeros(force.size, dtype=bool)
    known = np.flatnonzero(np.isfinite(force))
    values = force[known]
    lowest = minimum_filter(values, footprint=_BESIDE, mode="mirror")
    highest = maximum_filter(values, footprint=_BESIDE, mode="mirror")
    beyond = np.maximum(lowest - values, values - highest)
    apart = beyond > highest - lowest
    # not less those that slips spoil: these are no spikes
    usual = 1.4826 * np.median(_bends(values)) / math.sqrt(6.0)
    noise = max(usual, resolution(values) / math.sqrt(12.0))
    off = np.abs(values - median_filter(values, 5))
    apart &= off > SIGMAS * noise
    # At an end it is not seen whether a force comes back as a spike does: there it must
    # exceed the range of four samples in a slip, and be no bench without load.
    for end, beside in ((0, 1), (-1, -2)):
        if apart[end]:
            inner = values[1:-1][~apart[1:-1]]
            steps = maximum_filter(inner, 4) - minimum_filter(inner, 4)
            is_far = abs(values[end] - values[beside]) > steps.max()
            apart[end] = is_far and not _unloaded(values[end], inner)
    # jumps at many readings belong to the motion, not to the sensor
    if np.count_nonzero(apart) <= FEW * values.size:
        found[known[apart]] = True
    return found


def _is_flat(force: Array) -> bool:
    """Whether a force stays at its largest value again and again, much longer than
    at values just below.
    """
    top = force.max()
    at = force == top
    edges = np.flatnonzero(np.diff(at, prepend=False, append=False))
    runs = np.diff(edges)[::2]
    if np.count_nonzero(runs >= FLAT_RUN) < FLAT_PEAKS:
        return False
    near = force[~at & (force > top - 0.2 * np.ptp(force))]
    _, counts = np.unique(near, return_counts=True)
    usual = np.median(counts) if near.size else 1.0
    return bool(FEWEST_FLAT * usual <= np.count_nonzero(at) <= 0.9 * force.size)
