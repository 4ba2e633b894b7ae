"""The tests that a regime is read off: each a statistic, its limit, and where the limit comes from."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import gammainccinv, stdtrit

from stickslip.measure.arrays import Array, Trace, without_line
from stickslip.measure.periods import FEWEST_CYCLES, JITTER, PERIODIC, Cycles, find_cycles
from stickslip.measure.slips import (
    FEWEST_IN_A_DROP,
    SLIP_VELOCITY,
    Slips,
    fast_ones,
    kurtosis,
    mean_and_std,
    speeds,
    weighted_median,
)

# The numbers that decide, with those of FEWEST_CYCLES, PERIODIC, SLIP_VELOCITY and FEWEST_IN_A_DROP: fifteen.
TINY = 0.02  # an oscillation below this part of the largest force is smooth sliding ...
SMALL = 0.10  # ... and one that decays, below this
STEADY = 0.05  # change of the logarithm of the amplitude that is none ...
HALVED = math.log(2.0)  # ... and of one that seems to shrink, the decay to be ruled out for it to persist
ERRORS = 3.0  # standard errors beyond which a difference is no chance ...
CHANCE = 0.00135  # ... and how often one lies beyond them by chance
SLIP_PHASE = 0.25  # a slider that is held the rest of the time slips at four times the drive on average
HELD = 0.5  # a slider that is held loads the spring at its full rate for most of the time ...
NEVER_HELD = 0.5 * (HELD + 0.25)  # ... and half way to that from a sine, and from noise, which do for a quarter
NOISE_OF_CONTACTS = 0.5  # independent contacts, evenly stretched: times static friction over the root of their number
NORMAL = 2.25  # kurtosis half way from a sine (1.5) to noise (3) ...
ENOUGH = 16  # ... and cycles of narrow noise for which one standard error of that, 3/sqrt(n), is no more
UNEVEN = 0.26  # variation of the size of cycles, half way from none to that of narrow noise (Rayleigh's, .52)
LARGEST_NOISE = 0.5  # of the mean force, at three standard deviations: noise beyond it is no smooth sliding

_SLOPES = 0.1  # relative error to which a loading rate is read
_MANY = 100_000  # slopes that are enough

Source = Literal["theory", "statistics", "convention"]


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One test of a regime.

    Attributes
    ----------
    name : str
        What is asked.
    statistic, limit : float
        What was found, and what it is compared with.
    source : {"theory", "statistics", "convention"}
        Where the limit comes from.
    passed : bool
        The answer.
    """

    name: str
    statistic: float
    limit: float
    source: Source
    passed: bool

    def __str__(self) -> str:
        answer = "yes" if self.passed else "no"
        return f"{self.name:45} {self.statistic:10.3g} {self.limit:10.3g}  {self.source:10}  {answer}"


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What the force in a window shows, as numbers."""

    found: Slips
    cycles: Cycles
    periodic: bool
    count: int
    speed: float
    held: float
    excess: float
    relative: float
    kurtosis: float
    sizes: float
    swing: float
    peak_to_peak: float
    friction: float
    pause: tuple[float, float]
    phase: float
    samples: float
    trend: float = math.nan
    trend_error: float = math.nan
    scatter: float = 0.0

    @property
    def slips(self) -> bool:
        """Whether the drops are slips: fast ones; where the velocity is not known or not seen, by the force.

        Of a periodic force, the part of the time in drops tells; of an irregular one, that it rises at one rate for
        most of the time tells, too.
        """
        if self.speed >= SLIP_VELOCITY or (not math.isnan(self.speed) and self.samples >= FEWEST_IN_A_DROP):
            return self.speed >= SLIP_VELOCITY
        return self.phase <= SLIP_PHASE or (self.held >= HELD and not self.periodic)

    @property
    def ln_trend(self) -> float:
        """Logarithm of the amplitude in the second half of the window over that in the first."""
        return math.log(self.trend) if self.trend > 0 else 0.0

    def table(self) -> dict[str, Criterion]:
        """The tests, by short names."""
        rows: dict[str, Criterion] = {}

        def test(key: str, name: str, value: float, limit: float, source: Source, *, most: bool = False) -> None:
            if not math.isnan(value):
                passed = value <= limit if most else value >= limit
                rows[key] = Criterion(name=name, statistic=value, limit=limit, source=source, passed=bool(passed))

        found, allowed = self.found, STEADY + (0.0 if math.isnan(self.trend_error) else ERRORS * self.trend_error)
        test("drops", "drops that stand out of the noise", found.size, 1, "statistics")
        size = self.swing / self.friction if self.friction else math.nan
        test("size", "swing over the largest force", size, TINY, "convention")
        if not found.size:
            return rows
        test("cycles", "cycles in the window", self.count, FEWEST_CYCLES, "convention")
        test("resolved", "samples in a drop", self.samples, FEWEST_IN_A_DROP, "convention")
        test("shrinks", "drops shrink: logarithm of their change", self.ln_trend, -max(allowed, self.scatter),
             "statistics", most=True)  # fmt: skip
        test("grows", "drops grow: logarithm of their change", self.ln_trend, max(allowed, self.scatter), "statistics")
        if self.ln_trend <= -STEADY:
            least = self.ln_trend - allowed
            test("persists", "least logarithm of the change of the drops", least, -HALVED, "convention")
        test("paused", "longest pause over what chance allows", self.pause[0], self.pause[1], "statistics")
        test("period", "correlation at one period", self.cycles.correlation, PERIODIC, "convention")
        test("even", "variation of the cycles", self.cycles.variation, JITTER, "theory", most=True)
        test("fast", "largest slider velocity over the drive's", self.speed, SLIP_VELOCITY, "theory")
        test("phase", "part of the time in drops", self.phase, SLIP_PHASE, "theory", most=True)
        test("held", "part of the time at the full loading rate", self.held, HELD, "convention")
        test("uneven", "part of the time at the full loading rate", self.held, NEVER_HELD, "theory", most=True)
        test("contacts", "scatter over the noise of the contacts", self.excess, ERRORS, "theory")
        test("normal", "kurtosis of the force", self.kurtosis, NORMAL, "theory")
        test("sizes", "variation of the size of the cycles", self.sizes, UNEVEN, "theory")
        test("enough", "cycles, to tell an oscillation from noise", self.count, ENOUGH, "statistics")
        test("slight", "three standard deviations over the mean", self.relative, LARGEST_NOISE, "convention", most=True)
        return rows


def gather(trace: Trace, found: Slips) -> Evidence:
    """Take the numbers of a window."""
    cycles, periodic = _cycles(trace, found)
    fastest = speeds(trace, found)
    force = trace.force
    rest = without_line(force, trace.t)
    swing, peaked = float(np.ptp(force)), kurtosis(force)
    if periodic:  # of a sine with noise of a sensor on top, peak to peak is more than the sine's
        left = max(float(np.var(rest)) - found.noise**2, 0.0)
        swing = min(swing, 2.0 * math.sqrt(2.0 * left))
        peaked = 3.0 + (peaked - 3.0) * (float(np.var(force)) / left) ** 2 if left else peaked  # cumulants add up
    seen = Evidence(
        found=found,
        cycles=cycles,
        periodic=periodic,
        count=cycles.count if periodic else found.size,
        speed=math.nan if fastest is None else weighted_median(fastest, found.drops**2),
        held=held(trace, found.noise) if found.size and not trace.contacts else math.nan,
        excess=_excess(trace, rest),
        relative=ERRORS * float(rest.std()) / abs(float(force.mean())) if force.mean() else math.inf,
        kurtosis=peaked,
        sizes=_variation_of_sizes(force, cycles) if periodic else math.nan,
        swing=swing,
        peak_to_peak=float(np.ptp(force)),
        friction=abs(trace.largest),
        pause=_pause(trace, found, cycles.period if periodic else math.nan),
        phase=found.slip_phase(trace),
        samples=float(np.median(found.trough - found.peak)) if found.size else math.nan,
    )
    if not periodic:
        seen = replace(seen, count=_count(trace, seen))
    trend, error, scatter = _trend(trace, seen)
    return replace(seen, trend=trend, trend_error=error, scatter=scatter if seen.slips and not periodic else 0.0)


def _cycles(trace: Trace, found: Slips) -> tuple[Cycles, bool]:
    """The cycles of a force; of one that wanders, less the line through the middles of its drops and rises."""
    cycles = found.cycles
    if cycles.periodic or found.size < FEWEST_CYCLES:
        return cycles, cycles.periodic
    drops = found.drops
    if mean_and_std(np.diff(found.times))[2] < JITTER and mean_and_std(drops)[2] < 2.0 * JITTER:
        return replace(cycles, begins=found.peak, times=found.times, period=float(np.diff(found.times).mean())), True
    if trace.velocity is None:
        turning = np.sort(np.concatenate([found.peak, found.trough]))
        at, level = (0.5 * (values[turning[1:]] + values[turning[:-1]]) for values in (trace.t, trace.force))
        inner = slice(int(turning[0]), int(turning[-1]) + 1)
        rest = trace.force[inner] - np.interp(trace.t[inner], at, level)
        if (other := find_cycles(trace.t[inner], rest)).periodic:
            return other, True
    return cycles, False


def _variation_of_sizes(force: Array, cycles: Cycles) -> float:
    """Coefficient of variation of the ranges of a force in its cycles."""
    begins = cycles.begins
    ranges = np.maximum.reduceat(force, begins[:-1]) - np.minimum.reduceat(force, begins[:-1])
    return mean_and_std(ranges)[2]


def _count(trace: Trace, seen: Evidence) -> int:
    """Cycles of what has no period: fast drops of slips; of a slow oscillation under small drops, its own."""
    if seen.slips:
        return fast_ones(trace, seen.found).size
    slow = seen.cycles.correlation >= PERIODIC and seen.cycles.count < FEWEST_CYCLES
    return min(seen.cycles.count, seen.found.size) if slow else seen.found.size


def _trend(trace: Trace, seen: Evidence) -> tuple[float, float, float]:
    """Amplitude in the second half of the window over the first, the error of its logarithm, and the scatter of that.

    From the drops, of cycles with several from their ranges, and of what is neither slips nor periodic from the
    fluctuation in parts of the window.
    """
    found, cycles, (begin, end) = seen.found, seen.cycles, (trace.t[0], trace.t[-1])
    sizes, times = found.drops, found.times
    repeats = seen.slips or cycles.correlation >= PERIODIC
    if seen.periodic and abs(found.size - cycles.count) > 1:
        edges = np.arange(cycles.times[0], end, cycles.period)
        parts = itertools.pairwise(np.searchsorted(trace.t, edges).tolist())
        sizes, times = np.array([np.ptp(trace.force[i : j + 1]) for i, j in parts]), edges[:-1]
    elif found.size < FEWEST_CYCLES or not repeats:
        edges = np.linspace(begin, end, 2 * FEWEST_CYCLES + 1)
        parts = itertools.pairwise(np.searchsorted(trace.t, edges).tolist())
        sizes, times = np.array([trace.force[i:j].std() if j > i else 0.0 for i, j in parts]), edges[:-1]
    times, sizes = times[sizes > 0], np.log(sizes[sizes > 0])
    if sizes.size < FEWEST_CYCLES:
        return math.nan, math.nan, 0.0
    at = (times - times.mean()) / (end - begin)
    slope = float(at @ sizes / (at @ at))
    rest = sizes - sizes.mean() - slope * at
    power = float(rest @ rest)
    # Slow wandering of the drops (few contacts, or a boundary near by) makes them worth fewer independent ones.
    memory = min(max(float(rest[1:] @ rest[:-1]) / power, 0.0), 0.9) if power > 0 else 0.0
    error = math.sqrt(power / (sizes.size - 2) / float(at @ at) * (1 + memory) / (1 - memory))
    few = float(stdtrit(sizes.size - 2, 1.0 - CHANCE)) / ERRORS  # by Student: few parts tell their scatter badly
    return math.exp(0.5 * slope), 0.5 * few * error, math.sqrt(power / sizes.size)


def _excess(trace: Trace, rest: Array) -> float:
    """Fluctuation of the force over that which so many independent contacts make; not a number where unknown."""
    if not trace.contacts or not trace.largest:
        return math.nan
    # Contacts that are attached for a part `a` of the time and stretched evenly up to 1 have a mean force of a/2, and a
    # variance of a/3 - (a/2)^2. Thresholds that age are far below static friction in fast sliding.
    attached = 1.0 if trace.attached is None else max(float(trace.attached.mean()), 1e-12)
    stretched = min(NOISE_OF_CONTACTS * abs(trace.largest), abs(float(trace.force.mean())) / attached)
    noise = stretched * math.sqrt(max(4.0 * attached - 3.0 * attached**2, 0.0) / trace.contacts)
    return float(rest.std()) / noise if noise > 0 else math.inf


def _pause(trace: Trace, found: Slips, period: float) -> tuple[float, float]:
    """Longest time without a slip over the typical time between two, and the largest that chance allows.

    The typical time is that before the large drops: small ones may follow these closely. Times between slips are taken
    to follow a gamma distribution: even ones at a small variation, random ones at 1. A pause is at least as long as the
    fewest cycles that are judged.
    """
    if found.size < FEWEST_CYCLES:
        return math.nan, math.nan
    waits = np.diff(np.concatenate([[trace.t[0]], found.times, [trace.t[-1]]]))
    usual = weighted_median(waits[1:-1], found.drops[1:] ** 2) if math.isnan(period) else period
    _, _, variation = mean_and_std(waits[waits <= FEWEST_CYCLES * usual])
    shape = 1.0 / max(variation, 0.01) ** 2 if math.isfinite(variation) else 1.0
    chance = float(gammainccinv(shape, CHANCE / waits.size)) / shape
    return float(waits.max()) / usual, max(chance, float(FEWEST_CYCLES))


def held(trace: Trace, noise: float) -> float:
    """Part of the time in which the force rises at its full rate, within a quarter: the slider is held then.

    The rate is that of the slopes which most of the fast rises have; slopes are taken over as many samples as read it
    to a tenth. Not a number where the noise leaves none.
    """
    force, step = trace.force, (trace.t[-1] - trace.t[0]) / (trace.t.size - 1)
    total = np.concatenate([[0.0], np.cumsum(force - force.mean())])

    def slopes(rate: float) -> Array:
        """Differences of the means of two windows side by side."""
        half = math.ceil(0.5 * (16.0 * noise**2 / (_SLOPES * rate * step) ** 2) ** (1 / 3)) if rate > 0 else force.size
        half = max(half, 1)
        if 24 * half > force.size:
            return np.empty(0)
        every = max(1, force.size // _MANY)
        mean = (total[half:] - total[:-half]) / half
        return np.asarray((mean[half:] - mean[:-half])[::every] / (half * step))

    rate = float(np.quantile(np.diff(force), 0.9)) / step
    for _ in range(20):
        if not (slope := slopes(rate)).size:
            return math.nan
        before, rate = rate, float(np.quantile(slope, 0.9))
        if abs(rate - before) <= 0.01 * abs(before):
            break
    for _ in range(20):
        near = slope[np.abs(slope - rate) < 0.25 * rate]
        rate = float(near.mean()) if near.size else rate
    slope = slopes(rate)
    return float(np.mean(slope > 0.75 * rate)) if slope.size else math.nan
