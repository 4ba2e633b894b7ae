"""Slips: the drops of a force that stand out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.measure.arrays import Array, Trace, extremes, turns, without_line
from stickslip.measure.periods import FEWEST_CYCLES, Cycles, find_cycles

# Numbers that decide.
SMALLEST_PART_OF_DROP = 0.1  # a drop below this part of the typical drop is no slip of its own
SLIP_VELOCITY = 3.5  # a slip is faster than this many times the drive, where the velocity is known
LARGEST_REBOUND = 0.98  # ringing decays: a free slider comes back by exp(-pi zeta/sqrt(1 - zeta^2)) of the drop
WITHIN_A_CYCLE = 0.6  # of a period: what follows a slip later than this is no ringing of it
RINGING_SPEED = 3.0  # a rebound faster than this many times the usual loading is ringing (force only) ...
SOON = (1.5, 2.0, 0.5)  # ... or this much faster, within so many slip durations, and less than this part of the drop
SLIP_PHASE_OF_SLIPS = 0.35  # drops that take more of the time than this, and are not periodic, are noise
REGULAR_PERIOD, REGULAR_DROP = 0.15, 0.25  # coefficients of variation below which drops are regular
FEWEST_IN_A_DROP = 4  # samples, for the velocity of a slip to be seen
EDGE = 0.05  # a slip starts and ends within this part of its drop from the peak and from the trough
CONTACT_NOISE = 0.5  # standard deviation of the force of N contacts over static friction, times sqrt(N): at most that
NO_MORE_THAN_NOISE, MORE_THAN_NOISE = 2.0, 3.0  # times that: below the one noise, above the other motion; a lightly
# damped slider amplifies noise to what lies between, and it stays distributed as noise is
NORMAL = 2.4  # fourth moment over the squared variance: 3 for noise, 1.5 for a sine
WHITE = 5.0  # over the root of the samples: what a force that is noise may exceed its scatter by, by chance
LARGE_DROP = 0.2  # fast drops of this part of static friction are slips, and not noise, however few contacts there are
COHERENT = 0.97  # autocorrelation at one period that even amplified noise does not reach
CLEAR = 3.0  # drops this many times what noise may show need no smoothing
_FOR_NOISE = 500_000  # samples from which noise is read
CORRECTED = 0.005  # noise over drop above which peaks and troughs are taken from lines through their neighbours


@dataclass(frozen=True, kw_only=True)
class Slips:
    """Samples of the peak and the trough of each slip, and how they were found."""

    peak: NDArray[np.intp]
    trough: NDArray[np.intp]
    start: NDArray[np.intp]
    end: NDArray[np.intp]
    times: Array  # of the peaks
    before: Array
    after: Array
    smallest: float
    noise: float
    criterion: str
    cycles: Cycles
    cut: int = 0
    dismissed: str = ""  # why drops that were found are no slips

    @property
    def size(self) -> int:
        """Number of slips."""
        return int(self.peak.size)

    @property
    def drops(self) -> Array:
        """Drop of the force in each slip."""
        return self.before - self.after

    @property
    def regular(self) -> bool:
        """Whether the drops come at even times and are about equal, a steady growth or decay left aside."""
        if self.size < FEWEST_CYCLES or bool(np.any(self.drops <= 0)):
            return False
        at, size = self.times, np.log(self.drops)
        rest = size - np.polyval(np.polyfit(at - at[0], size, 1), at - at[0])
        return mean_and_std(np.diff(at))[2] < REGULAR_PERIOD and float(rest.std()) < REGULAR_DROP

    @property
    def periodic(self) -> bool:
        """Whether the force repeats itself, by its autocorrelation or drop by drop."""
        return self.cycles.periodic or self.regular

    def slip_phase(self, trace: Trace) -> float:
        """Time in slips over the time from the first peak to the last."""
        if self.size < 2:
            return math.nan
        slipping = trace.t[self.trough[:-1]] - trace.t[self.peak[:-1]]
        return float(slipping.sum() / (trace.t[self.peak[-1]] - trace.t[self.peak[0]]))

    def none(self, why: str) -> Slips:
        """Return a list without slips, that says why."""
        return replace(self.only(np.zeros(self.size, dtype=bool)), cut=0, dismissed=why, criterion=f"no slips: {why}")

    def only(self, keep: NDArray[np.bool_]) -> Slips:
        """Return some of the slips."""
        of_each = ("peak", "trough", "start", "end", "times", "before", "after")
        return replace(self, **{name: getattr(self, name)[keep] for name in of_each})


def mean_and_std(values: Array) -> tuple[float, float, float]:
    """Mean, sample standard deviation and coefficient of variation of the values that are known."""
    kept = values[np.isfinite(values)]
    mean = float(kept.mean()) if kept.size else math.nan
    std = float(kept.std(ddof=1)) if kept.size > 1 else math.nan
    return mean, std, std / abs(mean) if mean else math.nan


# ---------------------------------------------------------------------------------------------------------------------
# Noise
# ---------------------------------------------------------------------------------------------------------------------


def white_noise(force: Array) -> float:
    """Standard deviation of white noise on a trace, from second differences.

    Slips spoil some of them; where they are many, those beyond twice the noise are left out, again and again.
    """
    every = max(1, force.size // _FOR_NOISE)
    bend = np.abs(force[:-2:every] - 2.0 * force[1:-1:every] + force[2::every])
    first = noise = float(np.median(bend)) / 0.6745
    for _ in range(4):
        kept = bend[bend <= 2.0 * noise]
        if kept.size < 0.5 * bend.size:
            break
        noise = max(float(np.median(kept)) / 0.6396, 0.5 * first)  # 0.6396: median of a half-normal cut at 2
    return noise / math.sqrt(6.0)


def contact_noise(trace: Trace) -> float:
    """Fluctuation of the force over that which so many independent contacts make; infinite where that is not known."""
    if not trace.contacts or not trace.largest:
        return math.inf
    rest = without_line(trace.force, trace.t)
    # Contacts that are attached for a part `a` of the time and stretched evenly up to 1 have a mean force of a/2, and a
    # variance of a/3 - (a/2)^2. Thresholds that age are far below static friction in fast sliding.
    attached = 1.0 if trace.attached is None else max(float(trace.attached.mean()), 1e-12)
    stretched = min(CONTACT_NOISE * abs(trace.largest), abs(float(trace.force.mean())) / attached)
    noise = stretched * math.sqrt(max(4.0 * attached - 3.0 * attached**2, 0.0) / trace.contacts)
    return float(rest.std()) / noise if noise > 0 else math.inf


def is_normal(force: Array) -> bool:
    """Whether a force is distributed as noise is, and not as an oscillation."""
    rest = force - force.mean()
    return float(np.mean(rest**4)) >= NORMAL * float(np.mean(rest**2)) ** 2


def is_white(trace: Trace, noise: float, cycles: Cycles) -> bool:
    """Whether a force shows white noise about a line and nothing else: no more of it, no period, and normal."""
    rest, chance = without_line(trace.force, trace.t), WHITE / math.sqrt(trace.t.size)
    return float(rest.std()) <= (1.0 + chance) * noise and cycles.correlation <= 2.0 * chance and is_normal(rest)


def quantum(force: Array) -> float:
    """Step in which a trace was recorded, or 0 if its values lie on no coarse grid."""
    force = force[:: max(1, force.size // 50_000)]
    values = np.unique(force)
    if values.size < 2 or values.size > force.size // 2:
        return 0.0
    step = float(np.min(np.diff(values)))
    if values[-1] - values[0] > 1e12 * step:
        return 0.0
    count = (values - values[0]) / step
    return step if bool(np.all(np.abs(count - np.round(count)) < 0.1)) else 0.0


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def _chance_drop(size: float, within: float, noise: float) -> float:
    """Drop that noise alone may show between two of so many samples, one `within` so many of the other.

    The tenth on top is to spare.
    """
    return 1.1 * noise * math.sqrt(4.0 * math.log(max(0.5 * size * within, 2.0)))


def _smoothed(force: Array, noise: float, among: NDArray[np.intp]) -> tuple[Array, float]:
    """A force smoothed as far as its cycles allow, and the drop that its noise may show by chance.

    A running median keeps the edges of the drops; it cuts a drop by its length over that of the cycle.
    """
    chance = _chance_drop(force.size, force.size, noise)
    peaks, troughs = turns(force, 0.7 * chance, among)
    drops = force[peaks] - force[troughs]
    if drops.size < FEWEST_CYCLES or _weighted_median(drops, drops**2) > CLEAR * chance:
        return force, chance
    cycle = force.size / drops.size
    width = min(int(cycle / 6.0) // 2 * 2 + 1, 15)
    if width < 3:
        return force, _chance_drop(force.size, cycle, noise)
    from scipy.ndimage import median_filter

    left = noise * math.sqrt(0.5 * math.pi / width)
    return median_filter(force, width, mode="nearest"), _chance_drop(force.size / width, cycle / width, left)


# ---------------------------------------------------------------------------------------------------------------------
# Slips
# ---------------------------------------------------------------------------------------------------------------------


def find_slips(trace: Trace, minimum_drop: float | None = None, *, slow: bool = False) -> Slips:
    """Slips by a threshold that comes from the data: above noise, and not small beside the typical drop.

    Drops that are slow beside others are left out, unless they are asked for.
    """
    noise, cycles = white_noise(trace.force), find_cycles(trace.t, trace.force)
    if minimum_drop is not None:
        found = _joined(trace, trace.force, minimum_drop, "drops of at least the minimum_drop given", noise, cycles)
        return found.only(found.drops >= minimum_drop)
    force, chance = trace.force, _chance_drop(trace.t.size, trace.t.size, noise)
    among = extremes(force, 0.5 * chance)
    if trace.velocity is None:
        force, chance = _smoothed(force, noise, among)
        among = among if force is trace.force else extremes(force, 0.5 * chance)
    rounding = 1e-7 * float(np.max(np.abs(force)))
    by_chance = max(chance, 2.5 * quantum(trace.force), rounding, 1e-300)
    peaks, troughs = turns(force, by_chance, among)
    drops = force[peaks] - force[troughs]
    if drops.size == 0 or (trace.contacts is None and is_white(trace, noise, cycles)):
        criterion = f"no drop exceeds what the noise ({noise:.2g}) could show by chance ({by_chance:.3g})"
        return replace(_joined(trace, force, math.inf, criterion, noise, cycles, among), smallest=by_chance)
    smallest = max(by_chance, SMALLEST_PART_OF_DROP * _weighted_median(drops, drops**2))
    smoothing = "" if force is trace.force else ", smoothed"
    criterion = (
        f"drops of at least {smallest:.3g}: {SMALLEST_PART_OF_DROP:g} of the typical drop, and above "
        f"{by_chance:.2g}, which the noise ({noise:.2g}{smoothing}) could show by chance"
    )
    whole = _joined(trace, force, smallest, criterion, noise, cycles, among)
    found = whole if slow else _fast(trace, whole)
    excess = contact_noise(trace)
    amplified = excess < MORE_THAN_NOISE and is_normal(trace.force)
    noise_like = (excess <= NO_MORE_THAN_NOISE or amplified) and cycles.correlation < COHERENT
    if noise_like and not _are_jumps(trace, whole):
        return found.none(f"{found.size} {criterion}, but no more than {trace.contacts} contacts make as noise")
    phase = _typical_phase(trace, found)
    known = trace.contacts is not None and excess >= MORE_THAN_NOISE
    if phase <= SLIP_PHASE_OF_SLIPS or found.periodic or known:
        return found
    return found.none(
        f"{found.size} {criterion}, but without a period, and they take {100 * phase:.0f} % of the time: slow noise"
    )


def _are_jumps(trace: Trace, found: Slips) -> bool:
    """Whether the slider jumps by a good part of static friction: few contacts make such slips, however irregular."""
    speed = speeds(trace, found)
    if speed is None:
        return False
    weights = found.drops**2
    jump = _weighted_median(found.drops, weights) >= LARGE_DROP * abs(trace.largest)
    fast = _weighted_median(speed, weights) >= SLIP_VELOCITY
    return jump and fast and _typical_phase(trace, found) <= SLIP_PHASE_OF_SLIPS


def _typical_phase(trace: Trace, found: Slips) -> float:
    """Time of a drop over that of the drop and the rise before it: median, weighted by the squares of the drops."""
    if found.size == 0:
        return 0.0
    drop = trace.t[found.trough] - trace.t[found.peak]
    rise = trace.t[found.peak] - np.append(trace.t[0], trace.t[found.trough[:-1]])
    return _weighted_median(drop / (drop + rise), found.drops**2)


def speeds(trace: Trace, found: Slips) -> Array | None:
    """Largest velocity of the slider in each slip over that of the drive; None where either is not known."""
    if trace.velocity is None or trace.drive is None or not found.size:
        return None
    drive = np.maximum(np.abs(trace.drive[found.peak]), 1e-300)
    fastest = [trace.velocity[i : j + 1].max() for i, j in zip(found.peak, found.trough, strict=True)]
    return np.asarray(fastest, dtype=float) / drive


def _fast(trace: Trace, found: Slips) -> Slips:
    """Leave out slow drops beside fast ones: a slip is what is faster than 3.5 times the drive, where that is known."""
    speed = speeds(trace, found)
    if speed is None or float(np.median(found.trough - found.peak)) < FEWEST_IN_A_DROP:
        return found
    fast = speed >= SLIP_VELOCITY
    if fast.all() or not fast.any():
        return found
    return replace(found.only(fast), criterion=f"{found.criterion}, faster than {SLIP_VELOCITY:g} times the drive")


def _joined(
    trace: Trace,
    force: Array,
    smallest: float,
    criterion: str,
    noise: float,
    cycles: Cycles,
    among: NDArray[np.intp] | None = None,
) -> Slips:
    """Drops of at least `smallest`, those of the ringing joined to their slip, those cut off at the ends left out."""
    t = trace.t
    peaks, troughs = turns(force, smallest, among)
    usual, longest = math.inf, math.inf
    if trace.X is None and peaks:
        took = t[peaks[1:]] - t[troughs[:-1]]
        usual = _weighted_median((force[peaks[1:]] - force[troughs[:-1]]) / took, took) if took.size else math.inf
    if cycles.periodic:
        longest = WITHIN_A_CYCLE * cycles.period
    joined: list[list[int]] = []  # peak, trough, trough of the drop last joined
    for peak, trough in zip(peaks, troughs, strict=True):
        if joined:
            first, lowest, last = joined[-1]
            rebound, drop = force[peak] - force[last], force[first] - force[lowest]
            if rebound < LARGEST_REBOUND * drop and t[peak] - t[first] < longest:
                if trace.X is not None:
                    # Ringing throws the slider back; loading moves the drive on. After a slip that overshot, one rise
                    # holds both: it is ringing only if the slider gave way by more than the drive took up.
                    speed = 0.0 if trace.drive is None else abs(float(trace.drive[peak]))
                    back = trace.X[last] - trace.X[peak] >= speed * (t[peak] - t[last])
                else:
                    loaded, took = usual * (t[peak] - t[last]), t[peak] - t[last]
                    faster, soon, less = SOON
                    back = rebound > RINGING_SPEED * loaded or (
                        rebound > faster * loaded and took <= soon * (t[lowest] - t[first]) and rebound < less * drop
                    )
                if back:
                    if force[trough] < force[lowest]:
                        joined[-1][1] = trough
                    joined[-1][2] = trough
                    continue
        joined.append([peak, trough, trough])
    gaps = trace.gaps
    whole = [
        pair
        for pair in joined
        if pair[0] > 0 and pair[1] < force.size - 1 and not np.any((pair[0] <= gaps) & (gaps < pair[1]))
    ]
    peak_at = np.array([pair[0] for pair in whole], dtype=np.intp)
    trough_at = np.array([pair[1] for pair in whole], dtype=np.intp)
    start, end = _edges(force, peak_at, trough_at, noise if force is trace.force else 0.5 * noise)
    before, after = trace.force[peak_at], trace.force[trough_at]
    if trace.velocity is None and whole and noise > CORRECTED * float(np.median(before - after)):
        levels, most = _levels(trace, start, end), 3.0 * noise  # an extreme of noise lies no further off
        before, after = (np.clip(new, old - most, old + most) for new, old in zip(levels, (before, after), strict=True))
    return Slips(
        peak=peak_at,
        trough=trough_at,
        start=start,
        end=end,
        times=t[peak_at],
        before=before,
        after=after,
        smallest=smallest,
        noise=noise,
        criterion=criterion,
        cycles=cycles,
        cut=len(joined) - len(whole),
    )


def _edges(
    force: Array, peaks: NDArray[np.intp], troughs: NDArray[np.intp], noise: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Last sample near each peak and first sample near its trough, to a part of the drop, or within the noise."""
    start, end = peaks.copy(), troughs.copy()
    for i, (peak, trough) in enumerate(zip(peaks, troughs, strict=True)):
        slip = force[peak : trough + 1]
        drop = float(slip[0] - slip[-1])
        margin = min(max(EDGE * drop, 2.5 * noise), 0.4 * drop)
        end[i] = peak + int(np.argmax(slip <= slip[-1] + margin))
        start[i] = peak + int(np.flatnonzero(slip[: end[i] - peak] >= slip[0] - margin)[-1])
    return start, end


def _levels(trace: Trace, start: NDArray[np.intp], end: NDArray[np.intp]) -> tuple[Array, Array]:
    """Force before and after each slip, from lines through the loading beside it.

    The largest of many noisy samples lies above the force, and the smallest below it: their difference overstates a
    drop by up to three standard deviations of the noise. A line does not.
    """
    before, after = np.empty(start.size), np.empty(start.size)
    edges = [0, *end.tolist()], [*start.tolist(), trace.t.size - 1]
    for i in range(start.size):
        before[i] = _line(trace, max(edges[0][i] + 1, 0), int(start[i]), at_end=True)
        after[i] = _line(trace, int(end[i]), edges[1][i + 1], at_end=False)
    return before, after


def _line(trace: Trace, begin: int, end: int, *, at_end: bool) -> float:
    """Value of a straight line through a third of a stretch of samples, at its end or at its beginning."""
    many = min(max((end - begin + 1) // 3, 3), 50)
    begin, end = (max(begin, end - many + 1), end) if at_end else (begin, min(end, begin + many - 1))
    force = trace.force[begin : end + 1]
    if force.size < 3:
        return float(force.mean()) if force.size else float(trace.force[end if at_end else begin])
    at = trace.t[begin : end + 1] - trace.t[end if at_end else begin]
    middle = float(at.mean())
    slope = float((at - middle) @ force) / float((at - middle) @ (at - middle))
    return float(force.mean()) - slope * middle
