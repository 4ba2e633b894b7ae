"""Slips: the significant drops of a force, found in the same way for measurements and
for fits.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import median_filter

from stickslip.kernels.turning_points import pick as zigzag
from stickslip.measure.periods import Cycles, find_cycles
from stickslip.measure.sensor import white_noise
from stickslip.measure.trace import FEWEST_CYCLES, Array, Trace, slope

Peaks = NDArray[np.intp]

# a drop below this fraction of the typical drop is not a slip of its own
SMALLEST_PART_OF_DROP = 0.1
SLIP_VELOCITY = 3.5
"""Least peak velocity of a slip over the drive's: the geometric mean of 2, for a sine
that just comes to rest, and 2 pi, for a slider that is held, and slips by half a sine
in a quarter of the cycle.
"""
RINGING = 2.0
"""A rise is ringing if it is faster than the loading by more than this factor, so that
the slider's swing back makes more of it than the drive, and takes at most this many
times the time of the drop: between 1, for a swing back, and 3, for the loading of a
slider that slips for a quarter of the time.
"""
# a slip starts and ends within this fraction of its drop from its peak and trough
EDGE = 0.05
# samples of a drop that resolve its shape and velocity
FEWEST_IN_A_DROP = FEWEST_CYCLES
# noise over drop above which peaks and troughs are taken from lines through their
# neighbours
CORRECTED = 0.005
# The scatter of pure noise may exceed the estimated noise by chance by this number over
# the square root of the number of samples, relatively.
WHITE = 5.0


@dataclass(frozen=True, kw_only=True)
class Slips:
    """The drops of a force: their samples and forces, and how they were found."""

    peak: Peaks
    trough: Peaks
    start: Peaks
    end: Peaks
    times: Array  # times of the peaks
    before: Array  # force before each slip
    after: Array  # force after each slip
    fastest: Array  # largest velocity of the slider in each; NaN where it is not known
    smallest: float  # smallest drop that counts or, if none does, that would be seen
    noise: float  # of the sensor: standard deviation
    criterion: str  # in words
    cycles: Cycles
    cut: int  # number of drops that the ends of the data or a gap cut off

    @property
    def size(self) -> int:
        """Number of slips."""
        return int(self.peak.size)

    @property
    def drops(self) -> Array:
        """Drop of the force in each slip."""
        return self.before - self.after

    @property
    def waits(self) -> Array:
        """Times from each slip to the next."""
        return np.diff(self.times)

    def loading_rates(self, t: Array) -> Array:
        """Rise of the force per time from each slip to the next."""
        rises = self.before[1:] - self.after[:-1]
        return np.asarray(rises / (t[self.start[1:]] - t[self.end[:-1]]))

    def slip_phase(self, trace: Trace) -> float:
        """Return the fraction of the time from first to last peak in which the force
        drops.
        """
        if self.size < 2:
            return math.nan
        falling = trace.t[self.trough] - self.times
        return float(falling[:-1].sum() / np.ptp(self.times))

    def typical(self, values: NDArray[Any]) -> float:
        """Return the value of a typical drop, from the values of all drops: their
        median, weighted by the squares of the drops.
        """
        return weighted_median(values, self.drops**2)

    def only(self, keep: NDArray[np.bool_], **change: Any) -> Self:
        """Return a selection of the slips."""
        each: dict[str, Any] = {
            name: values[keep]
            for name, values in vars(self).items()
            if isinstance(values, np.ndarray)
        }
        return replace(self, **each, **change)


def weighted_median(values: NDArray[Any], weights: Array) -> float:
    """Return the value below which half of the weight lies; NaN without any weight."""
    if not weights.any():
        return math.nan
    half = np.quantile(values, 0.5, weights=weights, method="inverted_cdf")
    return float(half)


def _chance_drop(size: float, within: float, noise: float) -> float:
    """Return the largest drop that noise makes by chance among `size` samples, between
    two at most `within` samples apart; with a tenth to spare.
    """
    return 1.1 * noise * math.sqrt(4.0 * math.log(max(0.5 * size * within, 2.0)))


def _typical_drop(force: Array, least: float) -> tuple[int, float]:
    """Return the number of drops of at least this size, and the typical drop."""
    peaks, troughs = turning_points(force, least)
    drops = force[peaks] - force[troughs]
    return peaks.size, weighted_median(drops, drops**2)


def _smoothed(force: Array, noise: float) -> tuple[Array, float]:
    """Return the force smoothed by a running median, which keeps edges, as wide as the
    cycles allow; and the largest drop that its noise then makes by chance.
    """
    size = force.size
    chance = _chance_drop(size, size, noise)
    drops, typical = _typical_drop(force, 0.7 * chance)
    if drops < FEWEST_CYCLES or typical > 3.0 * chance:
        return force, chance
    cycle = size / drops
    width = min(int(cycle / 6.0) // 2 * 2 + 1, 15)
    if width > 1:
        force = median_filter(force, width, mode="nearest")
        noise *= math.sqrt(0.5 * math.pi / width)
    return force, _chance_drop(size / width, cycle / width, noise)


def fitted_locally(
    force: Array, width: int, degree: int, derivative: int = 0, step: float = 1.0
) -> Array:
    """Return the force, up to a constant, or its derivative, from a polynomial fitted
    to the `width` samples around each sample (Savitzky-Golay).
    """
    # slow to import, and seldom needed
    from scipy.signal import oaconvolve, savgol_coeffs

    width |= 1
    weights = savgol_coeffs(width, degree, deriv=derivative, delta=step)
    # an odd reflection continues a straight line at the ends
    rest = force - force.mean()
    padded = np.pad(rest, width // 2, "reflect", reflect_type="odd")
    return np.asarray(oaconvolve(padded, weights, "valid"))


def find_slips(trace: Trace, minimum_drop: float | None = None) -> Slips:
    """Return the drops of a trace that exceed `minimum_drop`, by default the noise and
    a tenth of the typical drop, without those cut off by an end or a gap.
    """
    force = trace.force
    size = force.size
    noise = white_noise(force)
    rest = trace.residual
    cycles = find_cycles(trace.t, rest if trace.measured else force)
    if minimum_drop is not None:
        smallest = least = minimum_drop
        criterion = "drops of at least the minimum_drop given"
    else:
        chance = _chance_drop(size, size, noise)
        if trace.measured:
            force, chance = _smoothed(force, noise)
        largest = float(np.max(np.abs(force)))
        chance = max(chance, 2.5 * trace.reading_step, 1e-7 * largest, 1e-300)
        drops, typical = _typical_drop(force, chance)
        smallest = least = max(chance, SMALLEST_PART_OF_DROP * typical)
        more = WHITE / math.sqrt(size)
        white = rest.std() <= (1.0 + more) * noise
        if not drops or (white and cycles.correlation <= 2.0 * more):
            smallest = math.inf
            least = chance
        typical_one = f"a tenth of the typical one, {chance:.2g} by noise ({noise:.2g})"
        criterion = f"drops of at least {smallest:.3g}: {typical_one}"
    # displacement of the slider against the drive, minus the travel of the drive
    back = None
    if trace.X is not None and trace.drive is not None and not trace.measured:
        gone = cumulative_trapezoid(np.abs(trace.drive), trace.t, initial=0)
        back = -trace.X - gone
    peaks, troughs = pick(trace.t, force, smallest, back=back)
    across = np.searchsorted(trace.gaps, peaks) != np.searchsorted(trace.gaps, troughs)
    whole = (peaks > 0) & (troughs < size - 1) & ~across
    peak = peaks[whole]
    trough = troughs[whole]
    start, end = _edges(
        force, peak, trough, noise if force is trace.force else 0.5 * noise
    )
    before = trace.force[peak]
    after = trace.force[trough]
    if trace.measured and peak.size and noise > CORRECTED * np.median(before - after):
        # The largest of many noisy samples lies above the true force, and the smallest
        # below it, by up to three standard deviations of the noise: their difference
        # overstates a drop. Lines through the loading before and after it do not.
        most = 3.0 * noise
        rises = np.append(0, end)[:-1] + 1, np.append(start, size - 1)[1:]
        before = np.clip(_levels(trace, start, rises[0]), before - most, before + most)
        after = np.clip(_levels(trace, end, rises[1]), after - most, after + most)
    fastest = np.full(peak.size, math.nan)
    if trace.peaks is not None:
        slips = np.column_stack([peak, trough + 1]).ravel()
        fastest = np.maximum.reduceat(trace.peaks, slips)[::2]
    found = Slips(
        peak=peak,
        trough=trough,
        start=start,
        end=end,
        times=trace.t[peak],
        before=before,
        after=after,
        fastest=fastest,
        smallest=least,
        noise=noise,
        criterion=criterion,
        cycles=cycles,
        cut=int(np.count_nonzero(~whole)),
    )
    # Corrected for noise, some drops may be too small to count. If the typical one is,
    # noise made all of them.
    reaches = found.drops >= least
    return found.only(reaches & (found.typical(found.drops) >= least))


def speeds(trace: Trace, found: Slips) -> Array:
    """Return the largest velocity of the slider in each slip over that of the drive;
    NaN where either is not known.
    """
    if trace.drive is None:
        return np.full(found.size, math.nan)
    return found.fastest / np.maximum(np.abs(trace.drive[found.peak]), 1e-300)


def fast_slips(trace: Trace, found: Slips) -> Slips:
    """Return the slips without slow drops, if their velocity is known and resolved and
    the typical drop is fast; else all of them.
    """
    speed = speeds(trace, found)
    fast = speed >= SLIP_VELOCITY
    usual = found.typical(speed)
    seen = found.typical(found.trough - found.peak) >= FEWEST_IN_A_DROP
    if fast.all() or not usual >= SLIP_VELOCITY or not seen:
        return found
    faster = f"faster than {SLIP_VELOCITY:g} times the drive"
    return found.only(fast, criterion=f"{found.criterion}, {faster}")


def turning_points(
    values: Array, drop: float, rise: float | None = None
) -> tuple[Peaks, Peaks]:
    """Return the peaks (the end of a flat one) and the troughs after them, with drops
    of at least `drop`, and rises of at least `rise`, by default `drop`.
    """
    values = np.append(values, np.inf)
    peaks, troughs = zigzag(values, drop, drop if rise is None else rise)
    ends = np.flatnonzero(values[1:] != values[:-1])
    return ends[np.searchsorted(ends, peaks)], troughs


def pick(
    t: Array,
    force: Array,
    drop: float,
    least: float | None = None,
    *,
    back: Array | None = None,
) -> tuple[Peaks, Peaks]:
    """Return peaks and troughs of the slips of a force: of the significant drops, each
    joined with the ringing that follows it.

    A rise is ringing if it is smaller than the drop before it, and if the slider's
    swing back makes more of it than the travel of the drive, by `back`, its backward
    displacement minus that travel. Without `back`, it is ringing if it is smaller than
    the drop, twice as fast as the force usually rises, takes at most twice the samples
    of the drop, as far as these resolve it, and if loading follows, which takes twice
    as long: in an oscillation that decays the first rises are the fastest, too. Ringing
    decays: a drop of twice the one before it is another slip.
    """
    peaks, troughs = turning_points(force, drop, least)
    if peaks.size < 2:
        return peaks, troughs
    begins = troughs[:-1]
    ends = peaks[1:]
    rises = force[ends] - force[begins]
    drops = force[peaks] - force[troughs]
    if back is None:
        took = t[ends] - t[begins]
        swings = rises > RINGING * weighted_median(rises / took, took) * took
        fell = np.maximum(troughs - peaks, FEWEST_IN_A_DROP)[:-1]
        swings &= ends - begins <= RINGING * fell
        loading = np.append(np.flatnonzero(~swings), took.size)
        next_one = loading[np.searchsorted(loading, np.arange(took.size))]
        swings &= np.append(took, math.inf)[next_one] >= RINGING * took
    else:
        swings = back[ends] >= back[begins]
    swings &= drops[1:] < RINGING * drops[:-1]
    joined = [[int(peaks[0]), int(troughs[0])]]
    for i, (rise, swing) in enumerate(zip(rises, swings, strict=True), 1):
        first, lowest = joined[-1]
        peak = int(peaks[i])
        trough = int(troughs[i])
        if swing and rise < force[first] - force[lowest]:  # ringing decays
            joined[-1][1] = min(lowest, trough, key=force.__getitem__)
        else:
            joined.append([peak, trough])
    whole = np.array(joined, dtype=np.intp)
    return whole[:, 0], whole[:, 1]


def _edges(
    force: Array, peaks: Peaks, troughs: Peaks, noise: float
) -> tuple[Peaks, Peaks]:
    """Return the last sample near each peak and the first near its trough, within a
    fraction of the drop or the noise.
    """
    start = peaks.copy()
    end = troughs.copy()
    for i, peak in enumerate(peaks):
        slip = force[peak : troughs[i] + 1]
        drop = slip[0] - slip[-1]
        margin = min(max(EDGE * drop, 2.5 * noise), 0.4 * drop)
        low = int(np.argmax(slip <= slip[-1] + margin))
        high = np.flatnonzero(slip[:low] >= slip[0] - margin)[-1]
        start[i] += high
        end[i] = peak + low
    return start, end


def _levels(trace: Trace, at: Peaks, other: Peaks) -> Array:
    """Return the force at samples `at`, each from a line through the first third of
    the samples, 3 to 50 of them, from there to the sample `other`.
    """
    levels = np.empty(at.size)
    for i, (here, there) in enumerate(zip(at.tolist(), other.tolist(), strict=True)):
        apart = abs(there - here) + 1
        many = min(max(apart // 3, 3), apart, 50)
        inside = here + (1 if there > here else -1) * np.arange(many)
        t = trace.t[inside] - trace.t[here]
        force = trace.force[inside]
        levels[i] = force.mean()
        if many > 2:
            levels[i] -= slope(force, t) * t.mean()
    return levels
