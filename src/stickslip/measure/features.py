"""The tests that a regime is read off: each a statistic, its limit, and where the
limit comes from.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
from scipy.special import stdtrit

from stickslip import words
from stickslip.errors import InputError, UndecidedError
from stickslip.measure.kinematics import HALF, loading, rms_velocity_deviation
from stickslip.measure.periods import (
    JITTER,
    PERIODIC,
    Cycles,
    find_cycles,
    regularity,
    spectral_line,
)
from stickslip.measure.slips import (
    FEWEST_IN_A_DROP,
    SLIP_VELOCITY,
    Slips,
    fast_ones,
    speeds,
    weighted_median,
)
from stickslip.measure.trace import (
    CHANCE,
    ERRORS,
    FEWEST_CYCLES,
    RESTS,
    Trace,
    mean_and_std,
    without_drift,
)
from stickslip.model import Interface
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.stability import contact_noise, count_unstable

# With those of a period and of the velocity of a slip, these are all the numbers that
# decide.
TINY = 0.02  # an oscillation below this part of the largest force is smooth sliding ...
SMALL = 0.10  # ... and one that decays, or noise that may hide another, below this
MOST = 0.5  # of the time, or of a force
STEADY = 0.05  # change of the logarithm of the amplitude that is none
# held for the rest of the time, a slider slips at four times the drive on average
SLIP_PHASE = 0.25
# part of the time at its full rate: nearer to slips than to a sine that comes to rest
HELD = math.sqrt(RESTS * HALF)
# independent contacts, evenly stretched: times static friction over the root of their
# number
NOISE_OF_CONTACTS = 0.5
# kurtosis of three waves of a size, 3 - 3/(2 n): noise has at least as many
NORMAL = 2.5

REPEATS = "correlation of a cycle with the next"
SWING = "peak to peak over the largest force"
NOISE = "scatter over the noise of the contacts"
CHANGE = "change of the logarithm of the swing"
Source = Literal["theory", "statistics", "convention"]
Row = tuple[str, float, float, Source]

# tests passed at most at their limit; the others, at least
_AT_MOST = {"steady", "small", "slight"}


@lru_cache(maxsize=256)
def noise_of(interface: Interface, slider: Any, velocity: float) -> float | None:
    """Standard deviation of the force of smooth sliding over ``1/sqrt(N)``: NaN if
    unstable, None if not known.
    """
    rig = Rig(interface, slider, constant(velocity))
    try:
        return (
            math.nan
            if count_unstable(rig)
            else contact_noise(rig, contacts=1).spring_force
        )
    except (InputError, UndecidedError):
        return None


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
        return (
            f"{self.name:45} {self.statistic:10.3g} {self.limit:10.3g}  "
            f"{self.source:10}  {answer}"
        )


@dataclass(frozen=True)
class Window:
    """A stretch of a trace and the drops in it: what they show, and the tests of it."""

    trace: Trace
    found: Slips

    @cached_property
    def cycles(self) -> Cycles | None:
        """The cycles of a periodic force; drops that are even are cycles, too, on a
        level that wanders.
        """
        found = self.found
        known = self.found.cycles
        period, _, variation = mean_and_std(np.diff(found.times))
        even = (
            found.size > FEWEST_CYCLES
            and variation < JITTER
            and mean_and_std(found.drops)[2] < 2.0 * JITTER
        )
        if even and not (known.periodic and found.size <= known.count + FEWEST_CYCLES):
            return Cycles(
                period=period,
                variation=variation,
                correlation=regularity(variation),
                times=found.times,
            )
        if not known.periodic and self.trace.measured:
            known = find_cycles(self.trace.t, without_drift(self.trace.force))
        return known if known.periodic and found.size >= FEWEST_CYCLES else None

    @cached_property
    def count(self) -> int:
        """Number of cycles, or of drops, if there is no period."""
        found = fast_ones(self.trace, self.found)
        return self.cycles.count if self.cycles and found.size else found.size

    @cached_property
    def trend(self) -> tuple[float, float]:
        """Amplitude in the second half over that in the first, and the error of its
        logarithm; NaN and 0 if unknown.
        """
        sizes = self.found.drops
        times = self.found.times
        trace = self.trace
        if not self.cycles or abs(self.found.size - self.cycles.count) > 1:
            forces, moments = (
                np.array_split(values, 2 * FEWEST_CYCLES)
                for values in (trace.force, trace.t)
            )
            sizes = np.array([part.std() for part in forces])
            times = np.array([part.mean() for part in moments])
        times = times[sizes > 0]
        sizes = np.log(sizes[sizes > 0])
        if sizes.size < FEWEST_CYCLES:
            return math.nan, 0.0
        at = (times - times.mean()) / np.ptp(trace.t)  # an origin afar loses digits
        (rate, _), covariance = np.polyfit(at, sizes, 1, cov=True)
        # by Student: few parts tell their scatter badly
        few = float(stdtrit(sizes.size - 2, 1.0 - CHANCE)) / ERRORS
        return math.exp(0.5 * rate), 0.5 * few * math.sqrt(covariance[0, 0])

    @cached_property
    def line(self) -> tuple[float, float]:
        """Period and swing of a line of the spectrum of a force that has no period;
        NaN if there is none.
        """
        return (
            (math.nan, math.nan)
            if self.cycles
            else spectral_line(self.trace.t, self.trace.force)
        )

    @cached_property
    def slips(self) -> tuple[*Row, str]:
        """What tells slips, and in words: the velocity of the slider where it is seen;
        else how long it is held.

        That is the time not in drops; where these take long, that at the full loading
        rate (less without a period).
        """
        trace = self.trace
        found = self.found
        samples = weighted_median(
            np.asarray(found.trough - found.peak, dtype=float), found.drops**2
        )
        # in a typical drop; NaN if it is not known
        fast = weighted_median(speeds(trace, found), found.drops**2)
        if fast >= SLIP_VELOCITY or (
            math.isfinite(fast) and samples >= FEWEST_IN_A_DROP
        ):
            said = (
                f"peak slider velocity {words.number(fast, 3)} times that of the drive"
            )
            return (
                "largest slider velocity over the drive's",
                fast,
                SLIP_VELOCITY,
                "theory",
                said,
            )
        phase = found.slip_phase(trace)
        said = f"slipping takes {100 * phase:.0f} % of each cycle"
        if not phase > SLIP_PHASE or trace.contacts:
            return (
                "part of the time not in drops",
                1.0 - phase,
                1.0 - SLIP_PHASE,
                "theory",
                said,
            )
        step = (trace.t[-1] - trace.t[0]) / (trace.t.size - 1)
        held = loading(trace.force, step, found.noise)[1]
        least = HALF if self.cycles else HELD
        if held >= least:
            said = (
                f"the force rises at its full rate for {100 * held:.0f} % of the time"
            )
        return (
            "part of the time at the full loading rate",
            held,
            least,
            "convention",
            said,
        )

    @cached_property
    def noise(self) -> tuple[float, float]:
        """Standard deviation of the force in smooth sliding, NaN if unstable; and
        how many times is no more.
        """
        trace = self.trace
        count = self.trace.contacts
        if not count or not self.found.size:
            return math.nan, ERRORS
        if trace.rig is not None and trace.drive is not None:
            # it is rounded
            speed = float(np.mean(trace.drive)) / trace.rig.unit("velocity")
            known = noise_of(
                trace.rig.interface, trace.rig.slider, float(f"{speed:.12g}")
            )
            if known is not None:
                return known * trace.rig.unit("f_s") / math.sqrt(count), ERRORS
        mean = abs(float(trace.force.mean())) or 1e-300
        return min(NOISE_OF_CONTACTS * (abs(trace.largest) or 1.0), mean) / math.sqrt(
            count
        ), 1.0

    @cached_property
    def tests(self) -> dict[str, Criterion]:
        """The tests by name, but for those of what is not known."""
        trace = self.trace
        found = self.found
        force = self.trace.force
        known = self.found.cycles
        largest = abs(trace.largest) or 1.0
        mean = abs(float(force.mean())) or 1e-300
        rest = without_drift(force)
        swing = float(np.ptp(force))
        late = float(force[force.size // 2 :].std())
        scatter = float(rest.std())
        # of a sine with noise of a sensor on top, peak to peak is more than the sine's
        if self.cycles and found.size:
            swing = min(
                swing,
                2.0 * math.sqrt(2.0 * max(float(force.var()) - found.noise**2, 0.0)),
            )
        repeats = (
            self.cycles.correlation
            if self.cycles
            else min(known.correlation, regularity(known.variation))
        )
        kurtosis = float(np.mean((rest**2) ** 2)) / scatter**4 if scatter else math.nan
        trend, error = self.trend
        change = abs(math.log(trend))
        steady = STEADY + ERRORS * error
        ripple = math.sqrt(12.0) * late
        # What neither swings nor slips nor changes is smooth whatever makes it: to ask
        # theory for its noise is dear.
        still = (
            swing < TINY * largest
            and not self.slips[1] >= self.slips[2]
            and not change > steady
        )
        noise, most = (math.nan, ERRORS) if still else self.noise
        # What is asked, what was found, the limit (chance allows for more where an
        # error is known), and its source.
        rows: dict[str, Row] = {
            "drops": ("drops that stand out of the noise", found.size, 1, "statistics"),
            "swing": (SWING, swing / largest, TINY, "convention"),
            "cycles": ("cycles in the window", self.count, FEWEST_CYCLES, "statistics"),
            "repeats": (REPEATS, repeats, PERIODIC, "convention"),
            "steady": (CHANGE, change, steady, "statistics"),
            # Slips of a drop D, seen once a cycle or less, scatter by D/sqrt(12) and
            # look like white noise.
            "small": (
                "second half, as a sawtooth, over the largest force",
                ripple / largest,
                SMALL,
                "convention",
            ),
            "slips": self.slips[:-1],
            "contacts": (NOISE, scatter / noise, most, "theory"),
            "normal": ("kurtosis of the force", kurtosis, NORMAL, "theory"),
            "slight": (
                "three standard deviations over the mean",
                ERRORS * scatter / mean,
                MOST,
                "convention",
            ),
            "rough": (
                "slider velocity off the drive's (rms), over it",
                rms_velocity_deviation(trace),
                HALF,
                "convention",
            ),
            "line": (
                "swing of a spectral line over the largest force",
                self.line[1] / largest,
                TINY,
                "statistics",
            ),
        }
        return {
            key: Criterion(
                name=name, statistic=value, limit=limit, source=source, passed=passed
            )
            for key, (name, value, limit, source) in rows.items()
            if not math.isnan(value)
            for passed in (bool(value <= limit if key in _AT_MOST else value >= limit),)
        }

    @cached_property
    def facts(self) -> set[str]:
        """The names of the tests that were passed, and what follows from them."""
        facts = {key for key, test in self.tests.items() if test.passed}
        steady = "steady" in facts
        known = bool(self.trace.contacts)
        # Its amplitude scatters as that of noise does, or is no more than a slider may
        # make of it.
        slight = "contacts" in self.tests and self.tests["contacts"].statistic < ERRORS
        shaken = self.trace.measured and ("normal" in facts or slight)
        more = {
            "white": self.found.noise > MOST * float(self.trace.force.std()),
            "lasts": not shaken if self.cycles else known and not self.trace.measured,
            "shrinks": not steady and self.trend[0] < 1.0,
            "grows": not steady and self.trend[0] > 1.0,
            "noise": "contacts" in self.tests and "contacts" not in facts,
            "moves": "rough" in self.tests,
            "even": "rough" in self.tests and self.tests["rough"].statistic < RESTS,
        }
        return facts | {name for name, holds in more.items() if holds}
