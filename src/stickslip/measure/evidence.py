"""The tests that a regime is read off: each a statistic, its limit, and where the limit comes from."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import gammainccinv, ndtr, stdtrit

from stickslip.measure.arrays import Array, Trace, memory, slope, without_line
from stickslip.measure.periods import FEWEST_CYCLES, JITTER, PERIODIC, Cycles, find_cycles
from stickslip.measure.slips import (
    FEWEST_IN_A_DROP,
    SLIP_VELOCITY,
    Slips,
    fast_ones,
    is_white,
    kurtosis,
    mean_and_std,
    speeds,
    weighted_median,
)

# The numbers that decide, with FEWEST_CYCLES, PERIODIC and SLIP_VELOCITY: twelve.
TINY = 0.02  # an oscillation below this part of the largest force is smooth sliding ...
SMALL = 0.10  # ... and one that decays, below this
STEADY = 0.05  # change of the logarithm of the amplitude that is none
ERRORS = 3.0  # standard errors beyond which a difference is no chance ...
CHANCE = float(ndtr(-ERRORS))  # ... and how often one lies beyond them by chance
SLIP_PHASE = 0.25  # a slider that is held the rest of the time slips at four times the drive on average
MOST = 0.5  # of the time, for which a slider that is held loads the spring at its full rate, or of the range of a force
NOISE_OF_CONTACTS = 0.5  # independent contacts, evenly stretched: times static friction over the root of their number
LARGEST_NOISE = 0.5  # of the mean force, at so many errors: noise beyond it is no smooth sliding
NORMAL = 2.25  # kurtosis half way from a sine (1.5) to noise (3) ...
ENOUGH = math.ceil((3.0 / (3.0 - NORMAL)) ** 2)  # ... and cycles of narrow noise at which an error of that is as large

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
    """What the force in a window shows: its drops and cycles, how large they are, and the tests, by short names.

    `facts` holds the names of the tests that were passed, and a few more: what the force is, and what it may be.
    """

    found: Slips
    cycles: Cycles
    periodic: bool
    swing: float
    trend: float
    trend_error: float
    tests: dict[str, Criterion]
    facts: set[str]

    def value(self, name: str) -> float:
        """What a test found; not a number where it was not made."""
        return self.tests[name].statistic if name in self.tests else math.nan


class _Tests(dict[str, Criterion]):
    """The tests that were made; one of what is not known is none."""

    def make(self, key: str, name: str, value: float, limit: float, source: Source, *, most: bool = False) -> None:
        if not math.isnan(value):
            passed = bool(value <= limit if most else value >= limit)
            self[key] = Criterion(name=name, statistic=value, limit=limit, source=source, passed=passed)


def _over(value: float, other: float) -> float:
    return value / other if other else math.nan


def gather(trace: Trace, found: Slips) -> Evidence:
    """Take the numbers of a window, and make the tests."""
    force, friction, noise, tests = trace.force, abs(trace.largest), found.noise, _Tests()
    cycles, periodic = _cycles(trace, found)
    scatter = float(without_line(force, trace.t).std())
    swing = peak_to_peak = float(np.ptp(force))
    if periodic and found.size:  # of a sine with noise of a sensor on top, peak to peak is more than the sine's
        swing = min(swing, 2.0 * math.sqrt(2.0 * max(scatter**2 - noise**2, 0.0)))
    tests.make("drops", "drops that stand out of the noise", found.size, 1, "statistics")
    tests.make("size", "swing over the largest force", _over(swing, friction), TINY, "convention")
    if found.size:
        slips, trend, error = _of_drops(tests, trace, found, cycles, periodic, scatter)
    else:
        slips, trend, error = False, math.nan, math.nan
        # Slips of a drop D, seen once a cycle or less, scatter by D/sqrt(12) and look like white noise.
        tests.make(
            "masks", "scatter over the largest force", _over(scatter, friction), SMALL / math.sqrt(12.0), "convention"
        )
        least = math.nan if is_white(trace, noise, cycles) else max(2.0 * found.smallest, SMALL * friction)
        tests.make("unfinished", "range over what noise may show", _over(peak_to_peak, least), 1.0, "statistics")
    drift = abs(slope(force, trace.t)) * float(np.ptp(trace.t))
    range_ = max(peak_to_peak, 2.0 * found.smallest / MOST)
    tests.make("drifts", "range of a straight line over that of the force", _over(drift, range_), MOST, "convention")
    facts = {name for name, made in tests.items() if made.passed}
    is_noise = "contacts" in tests and "contacts" not in facts
    more = {
        "slips": slips,
        "periodic": periodic,
        "lasts": periodic or "contacts" in facts,
        "alone": trace.velocity is None,
        "chance": is_noise,
        "noise": is_noise and ("normal" in facts or not periodic),
    }
    return Evidence(
        found=found,
        cycles=cycles,
        periodic=periodic,
        swing=swing,
        trend=trend,
        trend_error=error,
        tests=tests,
        facts=facts | {name for name, holds in more.items() if holds},
    )


def _of_drops(
    tests: _Tests, trace: Trace, found: Slips, cycles: Cycles, periodic: bool, scatter: float
) -> tuple[bool, float, float]:
    """Make the tests of drops: whether they are slips, how their sizes change, and the error of that."""
    force, friction, noise, mean = trace.force, abs(trace.largest), found.noise, abs(float(trace.force.mean()))
    samples, fastest = float(np.median(found.trough - found.peak)), speeds(trace, found)
    speed = math.nan if fastest is None else weighted_median(fastest, found.drops**2)
    phase, full = found.slip_phase(trace), math.nan if trace.contacts else held(trace, noise)
    # Where the velocity is not known, or not seen, the force tells: of a periodic one, the time in drops; of an
    # irregular one, that it rises at one rate for most of the time, too.
    slips = phase <= SLIP_PHASE or (full >= MOST and not periodic)
    if speed >= SLIP_VELOCITY or (samples >= FEWEST_IN_A_DROP and not math.isnan(speed)):
        slips = speed >= SLIP_VELOCITY
    count = (fast_ones(trace, found) if slips else found).size
    if periodic or (cycles.correlation >= PERIODIC and not slips):  # a cycle may have more than one drop
        count = cycles.count if periodic else min(cycles.count, count)
    trend, error = _trend(trace, found, cycles, periodic=periodic, slips=slips)
    change = math.log(trend) if trend > 0 else 0.0
    allowed = STEADY + (0.0 if math.isnan(error) else ERRORS * error)
    relative = _over(ERRORS * scatter, mean) if mean else math.inf
    left = float(np.ptp(force[force.size // 2 :]))
    tests.make("cycles", "cycles in the window", count, FEWEST_CYCLES, "convention")
    tests.make("resolved", "samples in a drop", samples, FEWEST_IN_A_DROP, "convention")
    tests.make("shrinks", "drops shrink: logarithm of their change", change, -allowed, "statistics", most=True)
    tests.make("grows", "drops grow: logarithm of their change", change, allowed, "statistics")
    tests.make("paused", "longest pause over what chance allows", *_pause(trace, found, cycles, periodic), "statistics")
    tests.make("period", "correlation at one period", cycles.correlation, PERIODIC, "convention")
    tests.make("even", "variation of the cycles", cycles.variation, JITTER, "theory", most=True)
    tests.make("fast", "largest slider velocity over the drive's", speed, SLIP_VELOCITY, "theory")
    tests.make("phase", "part of the time in drops", phase, SLIP_PHASE, "theory", most=True)
    tests.make("held", "part of the time at the full loading rate", full, MOST, "convention")
    tests.make("contacts", "scatter over the noise of the contacts", _excess(trace, scatter), ERRORS, "theory")
    tests.make("normal", "kurtosis of the force", kurtosis(force), NORMAL, "theory")
    tests.make("enough", "cycles, to tell an oscillation from noise", count, ENOUGH, "statistics")
    tests.make("slight", "three standard deviations over the mean", relative, LARGEST_NOISE, "convention", most=True)
    tests.make("strong", "the same, of slips of single contacts", relative, ERRORS * STEADY, "statistics")
    tests.make(
        "small",
        "range of the second half over the largest force",
        _over(left, friction),
        SMALL,
        "convention",
        most=True,
    )
    return slips, trend, error


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


def _trend(trace: Trace, found: Slips, cycles: Cycles, *, periodic: bool, slips: bool) -> tuple[float, float]:
    """Amplitude in the second half of the window over the first, and the error of its logarithm.

    From the ranges of cycles, the drops of slips, or, of what is neither, the fluctuation in parts of the window.
    """
    begin, end, sizes, times = trace.t[0], trace.t[-1], found.drops, found.times
    if periodic and abs(found.size - cycles.count) > 1:
        edges = np.arange(cycles.times[0], end, cycles.period)
        parts = itertools.pairwise(np.searchsorted(trace.t, edges).tolist())
        sizes, times = np.array([np.ptp(trace.force[i : j + 1]) for i, j in parts]), edges[:-1]
    elif not periodic and (not slips or found.size < FEWEST_CYCLES):
        edges = np.linspace(begin, end, 2 * FEWEST_CYCLES + 1)
        parts = itertools.pairwise(np.searchsorted(trace.t, edges).tolist())
        sizes, times = np.array([trace.force[i:j].std() if j > i else 0.0 for i, j in parts]), edges[:-1]
    times, sizes = times[sizes > 0], np.log(sizes[sizes > 0])
    if sizes.size < FEWEST_CYCLES:
        return math.nan, math.nan
    at = (times - times.mean()) / (end - begin)
    slope = float(at @ sizes / (at @ at))
    rest = sizes - sizes.mean() - slope * at
    power = float(rest @ rest)
    # Slow wandering of the drops (few contacts, or a boundary near by) makes them worth fewer independent ones.
    alike = min(memory(rest), 0.9)
    error = math.sqrt(power / (sizes.size - 2) / float(at @ at) * (1 + alike) / (1 - alike))
    few = float(stdtrit(sizes.size - 2, 1.0 - CHANCE)) / ERRORS  # by Student: few parts tell their scatter badly
    return math.exp(0.5 * slope), 0.5 * few * error


def _excess(trace: Trace, scatter: float) -> float:
    """Fluctuation of the force over that which so many independent contacts make; not a number where unknown."""
    if not trace.contacts or not trace.largest:
        return math.nan
    # Contacts that are attached for a part `a` of the time and stretched evenly up to 1 have a mean force of a/2, and a
    # variance of a/3 - (a/2)^2. Thresholds that age are far below static friction in fast sliding.
    attached = 1.0 if trace.attached is None else max(float(trace.attached.mean()), 1e-12)
    stretched = min(NOISE_OF_CONTACTS * abs(trace.largest), abs(float(trace.force.mean())) / attached)
    noise = stretched * math.sqrt(max(4.0 * attached - 3.0 * attached**2, 0.0) / trace.contacts)
    return scatter / noise if noise > 0 else math.inf


def _pause(trace: Trace, found: Slips, cycles: Cycles, periodic: bool) -> tuple[float, float]:
    """Longest time without a slip over the typical time between two, and the largest that chance allows.

    The typical time is that before the large drops: small ones may follow these closely. Times between slips are taken
    to follow a gamma distribution: even ones at a small variation, random ones at 1. A pause is at least as long as the
    fewest cycles that are judged.
    """
    if found.size < FEWEST_CYCLES:
        return math.nan, math.nan
    waits = np.diff(np.concatenate([[trace.t[0]], found.times, [trace.t[-1]]]))
    usual = weighted_median(waits[1:-1], found.drops[1:] ** 2) if not periodic else cycles.period
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
        half = (
            max(math.ceil(0.5 * (16.0 * noise**2 / (_SLOPES * rate * step) ** 2) ** (1 / 3)), 1)
            if rate > 0
            else force.size
        )
        if 24 * half > force.size:
            return np.empty(0)
        begin = np.arange(0, total.size - 2 * half, max(1, force.size // _MANY))
        first, second = ((total[at + half] - total[at]) / half for at in (begin, begin + half))
        return np.asarray((second - first) / (half * step))

    rate = float(np.quantile(np.diff(force), 0.9)) / step
    for _ in range(20):
        if not (slope := slopes(rate)).size:
            return math.nan
        rate = float(np.quantile(slope, 0.9))
    for _ in range(20):
        near = slope[np.abs(slope - rate) < 0.25 * rate]
        rate = float(near.mean()) if near.size else rate
    return float(np.mean(slope > 0.75 * rate))
