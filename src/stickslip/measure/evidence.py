"""The tests that a regime is read off: each a statistic, its limit, and where the limit comes from."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import gammainccinv, ndtr, stdtrit

from stickslip.measure.arrays import Trace, memory, slope, without_line
from stickslip.measure.periods import FEWEST_CYCLES, JITTER, PERIODIC, Cycles, find_cycles, spectral_line
from stickslip.measure.slips import (
    FEWEST_IN_A_DROP,
    SLIP_VELOCITY,
    Slips,
    fast_ones,
    is_white,
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

TESTS: dict[str, tuple[str, float, Source]] = {
    "drops": ("drops that stand out of the noise", 1, "statistics"),
    "size": ("swing over the largest force", TINY, "convention"),
    "cycles": ("cycles in the window", FEWEST_CYCLES, "convention"),
    "resolved": ("samples in a drop", FEWEST_IN_A_DROP, "convention"),
    "steady": ("logarithm of the change of the drops", STEADY, "statistics"),
    "small": ("range of the second half over the largest force", SMALL, "convention"),
    "paused": ("longest pause over what chance allows", FEWEST_CYCLES, "statistics"),
    "period": ("correlation at one period", PERIODIC, "convention"),
    "even": ("variation of the cycles", JITTER, "theory"),
    "fast": ("largest slider velocity over the drive's", SLIP_VELOCITY, "theory"),
    "phase": ("part of the time in drops", SLIP_PHASE, "theory"),
    "held": ("part of the time at the full loading rate", MOST, "convention"),
    "contacts": ("scatter over the noise of the contacts", ERRORS, "theory"),
    "normal": ("kurtosis of the force", NORMAL, "theory"),
    "enough": ("cycles, to tell an oscillation from noise", ENOUGH, "statistics"),
    "slight": ("three standard deviations over the mean", LARGEST_NOISE, "convention"),
    "strong": ("the same, of slips of single contacts", ERRORS * STEADY, "statistics"),
    "line": ("swing of a spectral line over the largest force", TINY, "statistics"),
    # Slips of a drop D, seen once a cycle or less, scatter by D/sqrt(12) and look like white noise.
    "masks": ("scatter over the largest force", SMALL / math.sqrt(12.0), "convention"),
    "unfinished": ("range over what noise may show", 1.0, "statistics"),
    "drifts": ("range of a straight line over that of the force", MOST, "convention"),
}
"""What is asked, the limit, and its source, by short names; chance allows for more where an error is known."""
_AT_MOST = {"steady", "small", "even", "phase", "slight"}


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


class Evidence(NamedTuple):
    """What the force in a window shows: cycles, if it has a period, how they change, and the tests, by short names.

    `facts` holds the names of the tests that were passed, and a few more: what the force is, and what it may be.
    """

    cycles: Cycles | None
    trend: float
    line: float  # period of a spectral line
    tests: dict[str, Criterion]
    facts: set[str]

    def value(self, name: str) -> float:
        """What a test found; not a number where it was not made."""
        return self.tests[name].statistic if name in self.tests else math.nan


def gather(trace: Trace, found: Slips) -> Evidence:
    """Take the numbers of a window, and make the tests; there is none of what is not known."""
    force, friction, mean = trace.force, abs(trace.largest) or 1.0, abs(float(trace.force.mean())) or 1e-300
    cycles, rest = _cycles(trace, found), without_line(force, trace.t)
    scatter, range_, drift = float(rest.std()), float(np.ptp(force)), slope(force, trace.t) * float(np.ptp(trace.t))
    facts, limits = set[str](), {name: limit for name, (_, limit, _) in TESTS.items()}
    swing, trend, line = range_, math.nan, math.nan
    if cycles and found.size:  # of a sine with noise of a sensor on top, peak to peak is more than the sine's
        swing = min(swing, 2.0 * math.sqrt(2.0 * max(scatter**2 - found.noise**2, 0.0)))
    values: dict[str, float] = {"drops": found.size, "size": swing / friction, "cycles": 0}
    values["drifts"] = abs(drift) / (max(range_, 2.0 * found.smallest / MOST) or 1.0)
    if found.size:
        values["resolved"] = samples = float(np.median(found.trough - found.peak))
        values["phase"] = phase = found.slip_phase(trace)
        values["held"] = full = math.nan if trace.contacts else held(trace, found.noise)
        # Where the velocity is not known, or not seen, the force tells: of a periodic one, the time in drops; of an
        # irregular one, that it rises at one rate for most of the time, too.
        slips = phase <= SLIP_PHASE or (full >= MOST and not cycles)
        values["fast"] = speed = weighted_median(speeds(trace, found), found.drops**2)
        if not math.isnan(speed) and (speed >= SLIP_VELOCITY or samples >= FEWEST_IN_A_DROP):
            slips = speed >= SLIP_VELOCITY
        facts |= {"slips"} if slips else set()
        count = cycles.count if cycles else (fast_ones(trace, found) if slips else found).size
        if found.cycles.correlation >= PERIODIC and not slips:  # a cycle may have more than one drop
            count = min(count, found.cycles.count)
        trend, error = _trend(trace, found, cycles, slips=slips)
        limits["steady"] += ERRORS * error
        values["paused"], limits["paused"] = _pause(trace, found, cycles)
        values |= {"cycles": count, "enough": count, "period": found.cycles.correlation}
        values["even"] = (cycles or found.cycles).variation
        values |= {"steady": abs(math.log(trend)), "small": float(np.ptp(force[force.size // 2 :])) / friction}
        values |= {"slight": ERRORS * scatter / mean, "strong": ERRORS * scatter / mean}
        values["normal"] = float(np.mean(rest**4)) / scatter**4 if scatter else math.nan
    else:
        values["masks"] = scatter / friction
        if not is_white(trace, found.noise, found.cycles):
            values["unfinished"] = range_ / max(2.0 * found.smallest, SMALL * friction)
    if trace.contacts and found.size:
        # Contacts that are attached for a part `a` of the time and stretched evenly up to 1 have a mean force of a/2,
        # and a variance of a/3 - (a/2)^2. Thresholds that age are far below static friction in fast sliding.
        attached = 1.0 if trace.attached is None else max(float(trace.attached.mean()), 1e-12)
        noise = min(NOISE_OF_CONTACTS * friction, mean / attached)
        noise *= math.sqrt(max(4.0 * attached - 3.0 * attached**2, 0.0) / trace.contacts)
        values["contacts"] = scatter / max(noise, 1e-300)
    if not (cycles or "slips" in facts):
        line, size = spectral_line(trace.t, force, CHANCE)
        values["line"] = size / friction
    tests = {
        key: Criterion(
            name=name,
            statistic=values[key],
            limit=limits[key],
            source=source,
            passed=bool(values[key] <= limits[key] if key in _AT_MOST else values[key] >= limits[key]),
        )
        for key, (name, _, source) in TESTS.items()
        if not math.isnan(values.get(key, math.nan))
    }
    facts |= {name for name, made in tests.items() if made.passed}
    chance = "contacts" in tests and "contacts" not in facts
    more = {
        "alone": trace.velocity is None,
        "periodic": cycles is not None,
        "lasts": cycles is not None or "contacts" in tests,
        "shrinks": "steady" not in facts and trend < 1.0,
        "grows": "steady" not in facts and trend > 1.0,
        "chance": chance,
        "noise": chance and ("normal" in facts or not cycles),
    }
    return Evidence(cycles, trend, line, tests, facts | {name for name, holds in more.items() if holds})


def _cycles(trace: Trace, found: Slips) -> Cycles | None:
    """The cycles of a periodic force; of one that wanders, less the line through the middles of its drops and rises.

    Drops that are even to within a sample are cycles, though only some of them make a whole number of samples.
    """
    waits = np.diff(found.times)
    period, _, variation = mean_and_std(waits)
    even = found.size >= FEWEST_CYCLES and variation < JITTER and mean_and_std(found.drops)[2] < 2.0 * JITTER
    sampled = float(np.ptp(waits)) < 1.5 * (trace.t[-1] - trace.t[0]) / (trace.t.size - 1) if even else False
    if even and (not found.cycles.periodic or (sampled and found.size > found.cycles.count + FEWEST_CYCLES)):
        return replace(found.cycles, times=found.times, period=period)
    if found.cycles.periodic:
        return found.cycles
    if found.size < FEWEST_CYCLES or trace.velocity is not None:
        return None
    turning = np.sort(np.concatenate([found.peak, found.trough]))
    at, level = (0.5 * (values[turning[1:]] + values[turning[:-1]]) for values in (trace.t, trace.force))
    inner = slice(int(turning[0]), int(turning[-1]) + 1)
    other = find_cycles(trace.t[inner], trace.force[inner] - np.interp(trace.t[inner], at, level))
    return other if other.periodic else None


def _trend(trace: Trace, found: Slips, cycles: Cycles | None, *, slips: bool) -> tuple[float, float]:
    """Amplitude in the second half of the window over the first, and the error of its logarithm; NaN and 0 if unknown.

    From the drops, where they are slips or cycles; else from the range of each cycle, or, of what is neither, the
    fluctuation in parts of the window.
    """
    begin, end, sizes, times = trace.t[0], trace.t[-1], found.drops, found.times
    if abs(found.size - cycles.count) > 1 if cycles else not slips or found.size < FEWEST_CYCLES:
        edges = np.linspace(begin, end, 2 * FEWEST_CYCLES + 1)
        if cycles:
            edges = np.arange(cycles.times[0], end, cycles.period)
        pieces = np.searchsorted(trace.t, edges).tolist()
        parts = [trace.force[i : j + 1] for i, j in itertools.pairwise(pieces)]
        sizes, times = np.array([np.ptp(part) if cycles else part.std() for part in parts]), edges[:-1]
    times, sizes = times[sizes > 0], np.log(sizes[sizes > 0])
    if sizes.size < FEWEST_CYCLES:
        return math.nan, 0.0
    at = (times - times.mean()) / (end - begin)
    change = slope(sizes, at)
    rest = without_line(sizes, at)
    # Slow wandering of the drops (few contacts, or a boundary near by) makes them worth fewer independent ones.
    alike = min(memory(rest), 0.9)
    error = math.sqrt(float(rest @ rest) / (sizes.size - 2) / float(at @ at) * (1 + alike) / (1 - alike))
    few = float(stdtrit(sizes.size - 2, 1.0 - CHANCE)) / ERRORS  # by Student: few parts tell their scatter badly
    return math.exp(0.5 * change), 0.5 * few * error


def _pause(trace: Trace, found: Slips, cycles: Cycles | None) -> tuple[float, float]:
    """Longest time without a slip over the typical time between two, and the largest that chance allows.

    The typical time is that before the large drops: small ones may follow these closely. Times between slips are taken
    to follow a gamma distribution: even ones at a small variation, random ones at 1. A pause is at least as long as the
    fewest cycles that are judged.
    """
    if found.size < FEWEST_CYCLES:
        return math.nan, math.nan
    waits = np.diff(np.concatenate([[trace.t[0]], found.times, [trace.t[-1]]]))
    usual = cycles.period if cycles else weighted_median(waits[1:-1], found.drops[1:] ** 2)
    _, _, variation = mean_and_std(waits[waits <= FEWEST_CYCLES * usual])
    shape = 1.0 / max(variation, 0.01) ** 2 if math.isfinite(variation) else 1.0
    chance = float(gammainccinv(shape, CHANCE / waits.size)) / shape
    longest = float(waits.max())
    if cycles:  # a drop that noise hides leaves no pause of the cycles
        longest = min(longest, float(np.diff([trace.t[0], *cycles.times, trace.t[-1]]).max()))
    return longest / usual, max(chance, float(FEWEST_CYCLES))


def held(trace: Trace, noise: float) -> float:
    """Part of the time in which the force rises at its full rate, within a quarter: the slider is held then.

    The rate is that of the slopes which most of the fast rises have; slopes, differences of the means of two windows
    side by side, are taken over as many samples as read it to a tenth. Not a number where the noise leaves none.
    """
    force, step = trace.force, (trace.t[-1] - trace.t[0]) / (trace.t.size - 1)
    total, slopes = np.concatenate([[0.0], np.cumsum(force - force.mean())]), np.diff(force) / step
    for _ in range(20):
        rate = float(np.quantile(slopes, 0.9))
        if not rate > 0:
            return math.nan
        half = max(math.ceil(0.5 * (16.0 * noise**2 / (_SLOPES * rate * step) ** 2) ** (1 / 3)), 1)
        if 24 * half > force.size:
            return math.nan
        begin = np.arange(0, total.size - 2 * half, max(1, force.size // _MANY))
        slopes = (total[begin + 2 * half] - 2.0 * total[begin + half] + total[begin]) / (half**2 * step)
    rate = float(np.quantile(slopes, 0.9))
    for _ in range(20):
        near = slopes[np.abs(slopes - rate) < 0.25 * rate]
        rate = float(near.mean()) if near.size else rate
    return float(np.mean(slopes > 0.75 * rate))
