"""The tests that a regime is read off: each a statistic, its limit, and where the limit comes from."""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.special import gammainccinv, ndtr, stdtrit

from stickslip.errors import InputError, UndecidedError
from stickslip.measure.arrays import FEWEST_READINGS, Trace, mean_and_std, slope, without_line
from stickslip.measure.kinematics import Motion, loading
from stickslip.measure.periods import FEWEST_CYCLES, JITTER, PERIODIC, Cycles, find_cycles, regularity, spectral_line
from stickslip.measure.slips import FEWEST_IN_A_DROP, SLIP_VELOCITY, Slips, fast_ones, speeds, weighted_median
from stickslip.stability import contact_noise, count_unstable

# With those of a period and of the velocity of a slip, these are all the numbers that decide.
ERRORS = 3.0  # standard errors beyond which a difference is no chance ...
CHANCE = float(ndtr(-ERRORS))  # ... and how often one lies beyond them by chance
TINY = 0.02  # an oscillation below this part of the largest force is smooth sliding ...
SMALL = 0.10  # ... and one that decays, or noise that may hide another, below this
MOST = 0.5  # of the time, or of a force
STEADY = 0.05  # change of the logarithm of the amplitude that is none
SLIP_PHASE = 0.25  # held for the rest of the time, a slider slips at four times the drive on average
NOISE_OF_CONTACTS = 0.5  # independent contacts, evenly stretched: times static friction over the root of their number
NORMAL = 2.25  # kurtosis half way from a sine (1.5) to noise (3)

SWING, NOISE = "swing over the largest force", "scatter over the noise of the contacts"
Source = Literal["theory", "statistics", "convention"]
Row = tuple[str, float, float, Source]

_AT_MOST = {"steady", "small", "slight"}  # tests passed at most at their limit; the others, at least


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One test of a regime."""

    name: str  #: what is asked
    statistic: float  #: what was found
    limit: float  #: what it is compared with
    source: Source  #: where the limit comes from: theory, statistics or a convention
    passed: bool  #: the answer

    def __str__(self) -> str:
        answer = "yes" if self.passed else "no"
        return f"{self.name:45} {self.statistic:10.3g} {self.limit:10.3g}  {self.source:10}  {answer}"


@dataclass(frozen=True)
class Window:
    """A stretch of a trace and the drops in it: what they show, and the tests of it."""

    trace: Trace
    found: Slips

    @cached_property
    def cycles(self) -> Cycles | None:
        """The cycles of a periodic force; of one that wanders, less the line through the middles of drops and rises.

        Drops that are even are cycles, too, where only some of them make a whole number of samples.
        """
        trace, found, known = self.trace, self.found, self.found.cycles
        period, _, variation = mean_and_std(np.diff(found.times))
        even = found.size >= FEWEST_CYCLES and variation < JITTER and mean_and_std(found.drops)[2] < 2.0 * JITTER
        if even and not (known.periodic and found.size <= known.count + FEWEST_CYCLES):
            return Cycles(period=period, variation=variation, correlation=regularity(variation), times=found.times)
        if known.periodic:
            return known
        if found.size < FEWEST_CYCLES or not trace.measured:
            return None
        turning = np.sort(np.concatenate([found.peak, found.trough]))
        at, level = (0.5 * (values[turning[1:]] + values[turning[:-1]]) for values in (trace.t, trace.force))
        inner = slice(int(turning[0]), int(turning[-1]) + 1)
        other = find_cycles(trace.t[inner], trace.force[inner] - np.interp(trace.t[inner], at, level))
        return other if other.periodic else None

    @cached_property
    def count(self) -> int:
        """Number of cycles, or of drops, if there is no period: of fast ones, where these are typical."""
        found = fast_ones(self.trace, self.found) if self.fast >= SLIP_VELOCITY else self.found
        return self.cycles.count if self.cycles and found.size else found.size

    @cached_property
    def trend(self) -> tuple[float, float]:
        """Amplitude in the second half over that in the first, and the error of its logarithm; NaN and 0 if unknown.

        From the drops, where they are cycles; else from the fluctuation in parts of the window.
        """
        sizes, times, trace = self.found.drops, self.found.times, self.trace
        if not self.cycles or abs(self.found.size - self.cycles.count) > 1:
            forces, moments = (np.array_split(values, 2 * FEWEST_CYCLES) for values in (trace.force, trace.t))
            sizes, times = np.array([part.std() for part in forces]), np.array([part.mean() for part in moments])
        times, sizes = times[sizes > 0], np.log(sizes[sizes > 0])
        if sizes.size < FEWEST_CYCLES:
            return math.nan, 0.0
        at = (times - times.mean()) / (trace.t[-1] - trace.t[0])
        rest = without_line(sizes, at)
        error = math.sqrt(float(rest @ rest) / (sizes.size - 2) / float(at @ at))
        few = float(stdtrit(sizes.size - 2, 1.0 - CHANCE)) / ERRORS  # by Student: few parts tell their scatter badly
        return math.exp(0.5 * slope(sizes, at)), 0.5 * few * error

    @cached_property
    def pause(self) -> tuple[float, float]:
        """Longest time without a drop over the usual time between two, and the largest that chance allows.

        The usual time is that before the large drops: small ones may follow these closely. Times between drops are
        taken to follow a gamma distribution: even ones at a small variation, random ones at 1. A pause is at least as
        long as the fewest cycles that are judged.
        """
        trace, found = self.trace, self.found
        if found.size < FEWEST_CYCLES:
            return math.nan, math.nan
        waits = np.diff(np.concatenate([trace.t[:1], found.times, trace.t[-1:]]))
        usual = weighted_median(waits[1:-1], found.drops[1:] ** 2)
        variation = mean_and_std(waits[waits <= FEWEST_CYCLES * usual])[2]
        shape = 1.0 / max(variation, 0.01) ** 2
        chance = float(gammainccinv(shape, CHANCE / waits.size)) / shape
        return float(waits.max()) / usual, max(chance, float(FEWEST_CYCLES))

    @property
    def parts(self) -> list[Trace]:
        """The parts with drops and those without, in turn: what follows a drop for longer than chance is one without.

        The loading before the next drop belongs to that.
        """
        found, (t, times) = self.found, (self.trace.t, self.found.times)
        waits = np.diff(np.append(times, t[-1]))
        usual = weighted_median(np.diff(times), found.drops[1:] ** 2)
        edges = [t[0]]
        for i in np.flatnonzero(waits > self.pause[1] * usual).tolist():
            edges += [t[found.end[i]], times[i + 1] - usual if i + 1 < times.size else math.inf]
        parts = [self.trace.part(*pair) for pair in pairwise([*edges, *([] if edges[-1] == math.inf else [math.inf])])]
        return [part for part in parts if part.t.size >= FEWEST_READINGS]

    @cached_property
    def line(self) -> tuple[float, float]:
        """Period and swing of a line of the spectrum of a force that has no period; NaN if there is none."""
        return (math.nan, math.nan) if self.cycles else spectral_line(self.trace.t, self.trace.force, CHANCE)

    @cached_property
    def motion(self) -> Motion | None:
        """How the slider of a bench moves, where its motion is known."""
        return Motion.of(self.trace)

    @cached_property
    def fast(self) -> float:
        """Largest velocity of the slider in a typical drop, over that of the drive; NaN if it is not known."""
        return weighted_median(speeds(self.trace, self.found), self.found.drops**2)

    @cached_property
    def slips(self) -> Row:
        """What tells slips: the velocity of the slider where it is known and seen; else how long it is held.

        Of a periodic force the time in drops tells that; of an irregular one, the time at the full loading rate, too.
        """
        trace, found = self.trace, self.found
        samples = weighted_median((found.trough - found.peak).astype(float), found.drops**2)
        if self.fast >= SLIP_VELOCITY or (math.isfinite(self.fast) and samples >= FEWEST_IN_A_DROP):
            return "largest slider velocity over the drive's", self.fast, SLIP_VELOCITY, "theory"
        phase = found.slip_phase(trace)
        if self.cycles or phase <= SLIP_PHASE or trace.contacts:
            return "part of the time not in drops", 1.0 - phase, 1.0 - SLIP_PHASE, "theory"
        step = (trace.t[-1] - trace.t[0]) / (trace.t.size - 1)
        held = loading(trace.force, step, found.noise)[1]
        return "part of the time at the full loading rate", held, MOST, "convention"

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the force that contacts make in smooth sliding; NaN if it is unstable, or not known.

        By theory where the rig is known; where only their number is, as much as evenly stretched ones make at most.
        """
        trace, count = self.trace, self.trace.contacts
        if not count or not self.found.size:
            return math.nan
        try:
            if trace.rig is not None:
                rig = trace.rig if trace.drive is None else trace.rig.replace(velocity=float(np.mean(trace.drive)))
                return math.nan if count_unstable(rig) else contact_noise(rig).spring_force
        except (InputError, UndecidedError):
            pass  # of what theory does not take
        mean = abs(float(trace.force.mean())) or 1e-300
        return min(NOISE_OF_CONTACTS * (abs(trace.largest) or 1.0), mean) / math.sqrt(count)

    @cached_property
    def tests(self) -> dict[str, Criterion]:
        """The tests by name, but for those of what is not known."""
        trace, found, force, known = self.trace, self.found, self.trace.force, self.found.cycles
        largest, mean = abs(trace.largest) or 1.0, abs(float(force.mean())) or 1e-300
        rest = without_line(force, trace.t)
        scatter, swing, late = float(rest.std()), float(np.ptp(force)), float(force[force.size // 2 :].std())
        if self.cycles and found.size:  # of a sine with noise of a sensor on top, peak to peak is more than the sine's
            swing = min(swing, 2.0 * math.sqrt(2.0 * max(scatter**2 - found.noise**2, 0.0)))
        repeats = self.cycles.correlation if self.cycles else min(known.correlation, regularity(known.variation))
        kurtosis = float(np.mean(rest**4)) / scatter**4 if scatter else math.nan
        trend, error = self.trend
        change, steady, ripple = abs(math.log(trend)), STEADY + ERRORS * error, math.sqrt(12.0) * late
        # What is asked, what was found, the limit (chance allows for more where an error is known), and its source.
        rows: dict[str, Row] = {
            "drops": ("drops that stand out of the noise", found.size, 1, "statistics"),
            "swing": (SWING, swing / largest, TINY, "convention"),
            "cycles": ("cycles in the window", self.count, FEWEST_CYCLES, "statistics"),
            "repeats": ("correlation of a cycle with the next", repeats, PERIODIC, "convention"),
            "steady": ("change of the logarithm of the swing", change, steady, "statistics"),
            # Slips of a drop D, seen once a cycle or less, scatter by D/sqrt(12) and look like white noise.
            "small": ("second half, as a sawtooth, over the largest force", ripple / largest, SMALL, "convention"),
            "pauses": ("longest pause over the usual time between drops", *self.pause, "statistics"),
            "slips": self.slips,
            "contacts": (NOISE, scatter / self.noise, ERRORS, "theory"),
            "normal": ("kurtosis of the force", kurtosis, NORMAL, "theory"),
            "slight": ("three standard deviations over the mean", ERRORS * scatter / mean, MOST, "convention"),
            "line": ("swing of a spectral line over the largest force", self.line[1] / largest, TINY, "statistics"),
        }
        return {
            key: Criterion(name=name, statistic=value, limit=limit, source=source, passed=passed)
            for key, (name, value, limit, source) in rows.items()
            if not math.isnan(value)
            for passed in (bool(value <= limit if key in _AT_MOST else value >= limit),)
        }

    @cached_property
    def facts(self) -> set[str]:
        """The names of the tests that were passed, and what follows from them."""
        facts = {key for key, test in self.tests.items() if test.passed}
        more = {
            "white": self.found.noise > MOST * float(self.trace.force.std()),
            "lasts": self.cycles is not None or bool(self.trace.contacts),
            "shrinks": "steady" not in facts and self.trend[0] < 1.0,
            "grows": "steady" not in facts and self.trend[0] > 1.0,
            "noise": "contacts" in self.tests and "contacts" not in facts,
            "stops": "pauses" in facts and ("slips" in facts or self.cycles is not None),
        }
        facts |= {self.motion.word} if self.motion else set()
        return facts | {name for name, holds in more.items() if holds}
