"""The tests that a regime is read off: each a statistic, its limit, and where the limit comes from."""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import gammainccinv, ndtr, stdtrit

from stickslip.measure.arrays import Trace, mean_and_std, slope, without_line
from stickslip.measure.periods import FEWEST_CYCLES, JITTER, Cycles, find_cycles, spectral_line
from stickslip.measure.slips import FEWEST_IN_A_DROP, SLIP_VELOCITY, Slips, fast_ones, speeds, weighted_median

ERRORS = 3.0  # standard errors beyond which a difference is no chance ...
CHANCE = float(ndtr(-ERRORS))  # ... and how often one lies beyond them by chance
TINY = 0.02  # an oscillation below this part of the largest force is smooth sliding ...
SMALL = 0.10  # ... and one that decays, below this
STEADY = 0.05  # change of the logarithm of the amplitude that is none
MOST = 0.5  # of the time, or of the range of a force
NOISE_OF_CONTACTS = 0.5  # independent contacts, evenly stretched: times static friction over the root of their number
NORMAL = 2.25  # kurtosis half way from a sine (1.5) to noise (3) ...
ENOUGH = math.ceil((3.0 / (3.0 - NORMAL)) ** 2)  # ... and cycles of narrow noise at which an error of that is as large

_SLOPES = 0.1  # relative error to which a loading rate is read
_MANY = 100_000  # slopes that are enough

Source = Literal["theory", "statistics", "convention"]

_AT_MOST = {"steady", "small", "phase", "slight"}  # tests passed at most at their limit; the others, at least


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
    """What the force in a window shows: cycles, if it has a period, how they change, and what the tests found.

    `facts` holds the names of the tests that were passed, and a few more: what the force is, and what it may be.
    """

    cycles: Cycles | None
    trend: float
    line: float  # period of a spectral line
    values: dict[str, float]
    table: tuple[Criterion, ...]
    facts: set[str]


def gather(trace: Trace, found: Slips) -> Evidence:
    """Take the numbers of a window, and make the tests; there is none of what is not known."""
    force, friction, mean = trace.force, abs(trace.largest) or 1.0, abs(float(trace.force.mean())) or 1e-300
    cycles, rest = _cycles(trace, found), without_line(force, trace.t)
    scatter, swing, typical = float(rest.std()), float(np.ptp(force)), found.drops**2
    drift = abs(slope(force, trace.t)) * float(np.ptp(trace.t)) / (max(swing, 2.0 * found.smallest / MOST) or 1.0)
    if cycles and found.size:  # of a sine with noise of a sensor on top, peak to peak is more than the sine's
        swing = min(swing, 2.0 * math.sqrt(2.0 * max(scatter**2 - found.noise**2, 0.0)))
    trend, error = _trend(trace, found, cycles)
    longest, chance = _pause(trace, found)
    line, height = (math.nan, math.nan) if cycles else spectral_line(trace.t, force, CHANCE)
    fast = weighted_median(speeds(trace, found), typical)
    count = cycles.count if cycles else (fast_ones(trace, found) if fast >= SLIP_VELOCITY else found).size
    samples = weighted_median((found.trough - found.peak).astype(float), typical)
    phase, rising = found.slip_phase(trace), math.nan if trace.contacts else held(trace, found.noise)
    kurtosis = float(np.mean(rest**4)) / scatter**4 if scatter else math.nan
    late = float(np.ptp(force[force.size // 2 :]))
    of_contacts = math.nan
    if trace.contacts and found.size:
        of_contacts = scatter * math.sqrt(trace.contacts) / min(NOISE_OF_CONTACTS * friction, mean)
    # What is asked, what was found, the limit (chance allows for more where an error is known), and its source.
    rows: dict[str, tuple[str, float, float, Source]] = {
        "drops": ("drops that stand out of the noise", found.size, 1, "statistics"),
        "size": ("swing over the largest force", swing / friction, TINY, "convention"),
        "cycles": ("cycles in the window", count, FEWEST_CYCLES, "convention"),
        "resolved": ("samples in a drop", samples, FEWEST_IN_A_DROP, "convention"),
        "steady": ("logarithm of the change of the drops", abs(math.log(trend)), STEADY + ERRORS * error, "statistics"),
        "small": ("range of the second half over the largest force", late / friction, SMALL, "convention"),
        "pauses": ("longest pause over the usual time between drops", longest, chance, "statistics"),
        "fast": ("largest slider velocity over the drive's", fast, SLIP_VELOCITY, "theory"),
        # A slider held the rest of the time slips at four times the drive on average; held, it loads the spring.
        "phase": ("part of the time in drops", phase, 0.25, "theory"),
        "held": ("part of the time at the full loading rate", rising, MOST, "convention"),
        "contacts": ("scatter over the noise of the contacts", of_contacts, ERRORS, "theory"),
        "normal": ("kurtosis of the force", kurtosis, NORMAL, "theory"),
        "enough": ("cycles, to tell an oscillation from noise", count, ENOUGH, "statistics"),
        "slight": ("three standard deviations over the mean", ERRORS * scatter / mean, MOST, "convention"),
        "strong": ("the same, of slips of single contacts", ERRORS * scatter / mean, ERRORS * STEADY, "statistics"),
        "line": ("swing of a spectral line over the largest force", height / friction, TINY, "statistics"),
        # Slips of a drop D, seen once a cycle or less, scatter by D/sqrt(12) and look like white noise.
        "masks": ("scatter over the largest force", scatter / friction, SMALL / math.sqrt(12.0), "convention"),
        "drifts": ("range of a straight line over that of the force", drift, MOST, "convention"),
    }
    tests = {
        key: Criterion(
            name=name,
            statistic=value,
            limit=limit,
            source=source,
            passed=bool(value <= limit if key in _AT_MOST else value >= limit),
        )
        for key, (name, value, limit, source) in rows.items()
        if not math.isnan(value)
    }
    facts = {key for key, test in tests.items() if test.passed}
    # Where the velocity is not known, or not seen, the force tells: of a periodic one, the time in drops; of an
    # irregular one, that it rises at one rate for most of the time, too.
    slips = "phase" in facts or ("held" in facts and not cycles)
    if "fast" in tests and facts & {"fast", "resolved"}:
        slips = "fast" in facts
    chance_only = "contacts" in tests and "contacts" not in facts
    more = {
        "slips": slips,
        "repeats": slips or cycles is not None,
        "lasts": cycles is not None or "contacts" in tests,
        "shrinks": "steady" not in facts and trend < 1.0,
        "grows": "steady" not in facts and trend > 1.0,
        "chance": chance_only,
        "noise": chance_only and ("normal" in facts or not cycles),
    }
    facts |= {name for name, holds in more.items() if holds}
    values = {key: value for key, (_, value, _, _) in rows.items()}
    return Evidence(cycles, trend, line, values, tuple(tests.values()), facts)


def _cycles(trace: Trace, found: Slips) -> Cycles | None:
    """The cycles of a periodic force; of one that wanders, less the line through the middles of its drops and rises.

    Drops that are even are cycles, too, where only some of them make a whole number of samples.
    """
    known, (period, _, variation) = found.cycles, mean_and_std(np.diff(found.times))
    even = found.size >= FEWEST_CYCLES and variation < JITTER and mean_and_std(found.drops)[2] < 2.0 * JITTER
    if even and not (known.periodic and found.size <= known.count + FEWEST_CYCLES):
        return Cycles(period=period, variation=variation, correlation=known.correlation, times=found.times)
    if known.periodic:
        return known
    if found.size < FEWEST_CYCLES or trace.velocity is not None:
        return None
    turning = np.sort(np.concatenate([found.peak, found.trough]))
    at, level = (0.5 * (values[turning[1:]] + values[turning[:-1]]) for values in (trace.t, trace.force))
    inner = slice(int(turning[0]), int(turning[-1]) + 1)
    other = find_cycles(trace.t[inner], trace.force[inner] - np.interp(trace.t[inner], at, level))
    return other if other.periodic else None


def _trend(trace: Trace, found: Slips, cycles: Cycles | None) -> tuple[float, float]:
    """Amplitude in the second half of the window over the first, and the error of its logarithm; NaN and 0 if unknown.

    From the drops, where they are cycles; else from the fluctuation in parts of the window.
    """
    sizes, times = found.drops, found.times
    if not cycles or abs(found.size - cycles.count) > 1:
        forces, moments = (np.array_split(values, 2 * FEWEST_CYCLES) for values in (trace.force, trace.t))
        sizes, times = (np.array(values) for values in ([part.std() for part in forces], [t.mean() for t in moments]))
    times, sizes = times[sizes > 0], np.log(sizes[sizes > 0])
    if sizes.size < FEWEST_CYCLES:
        return math.nan, 0.0
    at = (times - times.mean()) / (trace.t[-1] - trace.t[0])
    rest = without_line(sizes, at)
    error = math.sqrt(float(rest @ rest) / (sizes.size - 2) / float(at @ at))
    few = float(stdtrit(sizes.size - 2, 1.0 - CHANCE)) / ERRORS  # by Student: few parts tell their scatter badly
    return math.exp(0.5 * slope(sizes, at)), 0.5 * few * error


def _pause(trace: Trace, found: Slips) -> tuple[float, float]:
    """Longest time without a drop over the usual time between two, and the largest that chance allows.

    The usual time is that before the large drops: small ones may follow these closely. Times between drops are taken
    to follow a gamma distribution: even ones at a small variation, random ones at 1. A pause is at least as long as the
    fewest cycles that are judged.
    """
    if found.size < FEWEST_CYCLES:
        return math.nan, math.nan
    waits = np.diff(np.concatenate([trace.t[:1], found.times, trace.t[-1:]]))
    usual = weighted_median(waits[1:-1], found.drops[1:] ** 2)
    variation = mean_and_std(waits[waits <= FEWEST_CYCLES * usual])[2]
    shape = 1.0 / max(variation, 0.01) ** 2
    chance = float(gammainccinv(shape, CHANCE / waits.size)) / shape
    return float(waits.max()) / usual, max(chance, float(FEWEST_CYCLES))


def held(trace: Trace, noise: float) -> float:
    """Part of the time in which the force rises at its full rate, within a quarter: the slider is held then.

    The rate is the median of the rises; slopes, differences of the means of two windows side by side, are taken over
    as many samples as read it to a tenth. Not a number where the noise leaves none.
    """
    force, step, half = trace.force, (trace.t[-1] - trace.t[0]) / (trace.t.size - 1), 1
    total = np.concatenate([[0.0], np.cumsum(force - force.mean())])
    for _ in range(20):
        if 24 * half > force.size:
            return math.nan
        begin = np.arange(0, total.size - 2 * half, max(1, force.size // _MANY))
        slopes = (total[begin + 2 * half] - 2.0 * total[begin + half] + total[begin]) / (half**2 * step)
        if not (slopes > 0).any():
            return math.nan
        rate = float(np.median(slopes[slopes > 0]))
        half = max(math.ceil(0.5 * (16.0 * noise**2 / (_SLOPES * rate * step) ** 2) ** (1 / 3)), 1)
    return float(np.mean(slopes > 0.75 * rate))
