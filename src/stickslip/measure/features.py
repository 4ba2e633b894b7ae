"""The features of a window of a force trace: one flat record, each number with its
error, and the tests that a regime rests on.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.special import stdtrit

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
    WHITE,
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
    Array,
    Trace,
    mean_and_std,
    slope,
    without_drift,
)
from stickslip.model import Interface
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.stability import contact_noise, count_unstable

# Conventions: what the words mean.
TINY = 0.02  # an oscillation below this part of the largest force is smooth sliding ...
SMALL = 0.10  # ... and one that decays, or noise that may hide another, below this
MOST = 0.5  # of the time, or of a force
STEADY = 0.05  # change of the logarithm of the amplitude that is none
# change of the logarithm of the amplitude from half to half that what persists
# excludes; and the largest that may be seen of it
LASTING = math.log(2.0)
SEEN = 0.5 * LASTING
CLIMBS = 0.25  # part of a drop that the loading before it makes up, at least ...
ONE_RATE = 0.25  # ... and scatter of the loading rate over it, at most
ONE_SIDED = 1.645  # errors of a limit that chance passes one time in twenty ...
ONE_IN_TWENTY = 0.05  # ... which is this often
PAUSE = 2.0  # usual waits: a longer one than this, and than chance makes, is a pause
ROUNDING = 1e-9  # of the largest force: noise below that is of numbers
# Theory.
# held for the rest of the time, a slider slips at four times the drive on average
SLIP_PHASE = 0.25
# part of the time at its full rate: nearer to slips than to a sine that comes to rest
HELD = math.sqrt(RESTS * HALF)
# independent contacts, evenly stretched: times static friction over the root of their
# number
NOISE_OF_CONTACTS = 0.5
# kurtosis of three waves of a size, 3 - 3/(2 n): noise has at least as many
NORMAL = 2.5

SLIDER_VELOCITY = "largest slider velocity over the drive's"
HELD_TIME = "part of the time at the full loading rate"
REPEATS = "correlation of a cycle with the next"
SWING = "peak to peak over the largest force"
NOISE = "scatter over the noise of the contacts"
CHANGE = "change of the logarithm of the amplitude"
Source = Literal["theory", "statistics", "convention"]


class Measured(NamedTuple):
    """A number and its standard error."""

    value: float
    error: float = 0.0


UNKNOWN = Measured(math.nan)
Row = tuple[str, Measured, float, Source, bool]


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One test of a regime."""

    name: str  #: what is asked
    statistic: float  #: what was found
    error: float = 0.0  #: its standard error, where it is known
    limit: float  #: what it is compared with
    source: Source  #: where the limit comes from: theory, statistics or a convention
    passed: bool  #: the answer

    def __str__(self) -> str:
        answer = "yes" if self.passed else "no"
        error = f"+- {self.error:.2g}" if self.error else ""
        return (
            f"{self.name:48} {self.statistic:10.3g} {error:10} {self.limit:10.3g}  "
            f"{self.source:10}  {answer}"
        )


@dataclass(frozen=True, kw_only=True)
class Features:
    """What a window shows, in the units of its trace; NaN where it is not known."""

    span: float  # length of the window
    largest: float  # force in all of the data
    mean: float  # force, in size
    measured: bool  # on a bench, with noise
    moving: bool  # whether the velocity of the slider is known
    contacts: int | None  # their number
    noise: float  # of the sensor, from sample to sample
    drift: float  # of the force from the first to the last sample, by a line
    scatter: float  # standard deviation without drift
    white_noise: Measured  # scatter over the noise of the sensor
    part: float  # peak to peak of all that the window holds, over the largest force
    swing: Measured  # the same without drift, and that of a period without noise
    ripple: float  # second half, as a sawtooth, over the largest force
    kurtosis: Measured  # its error is that of white noise
    drops: int  # that stand out of the noise
    count: int  # complete cycles, or drops where there is no period
    cycles: Cycles | None  # of a periodic force
    correlation: float  # of a cycle with the next
    slips: Measured  # what shows that drops are slips: see `find_slip_test`
    slip_test: str  # its name, ...
    slip_limit: float  # ... its limit ...
    slip_source: Source  # ... and where that comes from
    slip_phase: float  # part of the time in drops
    loading_rate: Measured  # of the force between drops
    falling_rate: float  # of a typical drop
    climb: Measured  # loading rate times wait, over the drop
    climb_scatter: float  # of the loading rate over it, without the sensor's noise
    change: Measured  # logarithm of the amplitude, second half over first
    freedom: int  # degrees of freedom of its error
    pause: float  # from the last drop to the end, over the longest wait by chance
    contact_noise: float  # scatter over the noise of the contacts
    noise_limit: float  # of that
    velocity_deviation: float  # of the slider from the drive (rms), over the drive's
    stuck: float  # part of the time slower than a quarter of the drive
    line_period: float  # of a spectral line of a force without a period
    line: float  # its swing over the largest force

    @property
    def are_slips(self) -> bool:
        """Whether the drops are as fast as slips."""
        return self.slips.value >= self.slip_limit

    @property
    def is_mostly_noise(self) -> bool:
        """Whether most of the scatter is noise of the sensor."""
        return self.noise > MOST * self.scatter

    @property
    def is_narrow(self) -> bool:
        """Whether chance takes the force no farther than halfway to zero."""
        return ERRORS * self.scatter <= MOST * self.mean

    @property
    def is_level(self) -> bool:
        """Whether the force drifts by no more than that of a slider that slides."""
        return _is_level(self.drift, self.largest)

    @property
    def climbs(self) -> bool:
        """Whether the force climbs to its drops, at one rate where that is all that
        is known.
        """
        if self.moving:
            return True
        enough = self.climb.value - ONE_SIDED * self.climb.error > CLIMBS
        return enough and self.climb_scatter < ONE_RATE

    @property
    def steady(self) -> bool:
        """Whether no change of the amplitude is proven."""
        return _is_steady(self.change, self.freedom)

    @property
    def persists(self) -> bool:
        """Whether a change of the amplitude by a factor 2 is excluded (by its root in
        a run without slips, which may linger where a branch has just ended), less than
        its root is seen, and the last drop is not long ago.
        """
        most = LASTING if self.measured or self.are_slips else SEEN
        change = abs(self.change.value)
        errors = float(stdtrit(self.freedom, 1.0 - ONE_IN_TWENTY))
        excluded = change + errors * self.change.error < most
        return change < SEEN and excluded and not self.pause > 1.0

    @property
    def is_white_noise(self) -> bool:
        """Whether the force is noise of the sensor."""
        return self.white_noise.value <= 1.0 + ERRORS * self.white_noise.error

    @property
    def tests(self) -> tuple[Criterion, ...]:
        """The tests of a regime, but for those of what is not known."""
        rows = (*self._tests_of_cycles(), *self._tests_of_slips())
        return tuple(
            Criterion(
                name=name,
                statistic=found.value,
                error=found.error,
                limit=limit,
                source=source,
                passed=bool(passed),
            )
            for name, found, limit, source, passed in rows
            if not math.isnan(found.value)
        )

    def _tests_of_cycles(self) -> tuple[Row, ...]:
        """What is asked of drops and cycles, found, its limit, source and answer."""
        # by Student: few parts show their scatter badly
        wider = _errors_by_chance(self.freedom) / ERRORS
        change = Measured(abs(self.change.value), wider * self.change.error)
        return (
            (
                "drops that stand out of the noise",
                Measured(self.drops),
                1,
                "statistics",
                self.drops >= 1,
            ),
            (SWING, self.swing, TINY, "convention", self.swing.value >= TINY),
            (
                "cycles in the window",
                Measured(self.count),
                FEWEST_CYCLES,
                "statistics",
                self.count >= FEWEST_CYCLES,
            ),
            (
                "scatter over the noise of the sensor",
                self.white_noise,
                1.0 + ERRORS * self.white_noise.error,
                "statistics",
                self.is_white_noise,
            ),
            (
                REPEATS,
                Measured(self.correlation),
                PERIODIC,
                "convention",
                self.correlation >= PERIODIC,
            ),
            (
                CHANGE,
                change,
                SEEN,
                "convention",
                self.persists,
            ),
            (
                "wait for a next drop over the longest by chance",
                Measured(self.pause),
                1.0,
                "statistics",
                self.pause <= 1.0,
            ),
            (
                "second half, as a sawtooth, over the largest force",
                Measured(self.ripple),
                SMALL,
                "convention",
                self.ripple <= SMALL,
            ),
        )

    def _tests_of_slips(self) -> tuple[Row, ...]:
        """The same of slips and of noise."""
        climb = self.climb
        half_most = MOST * self.mean
        return (
            (
                self.slip_test,
                self.slips,
                self.slip_limit,
                self.slip_source,
                self.are_slips,
            ),
            (
                "loading rate times wait, over the drop",
                climb,
                CLIMBS,
                "convention",
                climb.value - ONE_SIDED * climb.error > CLIMBS,
            ),
            (
                "scatter of the loading rate over it",
                Measured(self.climb_scatter),
                ONE_RATE,
                "convention",
                self.climb_scatter < ONE_RATE,
            ),
            (
                NOISE,
                Measured(self.contact_noise),
                self.noise_limit,
                "theory",
                self.contact_noise >= self.noise_limit,
            ),
            (
                "kurtosis of the force",
                self.kurtosis,
                NORMAL,
                "theory",
                self.kurtosis.value >= NORMAL,
            ),
            (
                "three standard deviations over the mean",
                Measured(ERRORS * self.scatter / self.mean),
                MOST,
                "convention",
                ERRORS * self.scatter <= half_most,
            ),
            (
                "slider velocity off the drive's (rms), over it",
                Measured(self.velocity_deviation),
                RESTS,
                "convention",
                self.velocity_deviation >= RESTS,
            ),
            (
                "swing of a spectral line over the largest force",
                Measured(self.line),
                TINY,
                "statistics",
                self.line >= TINY,
            ),
        )


def _errors_by_chance(freedom: int) -> float:
    """Standard errors that chance exceeds as seldom as three of a normal
    distribution, by Student.
    """
    return float(stdtrit(freedom, 1.0 - CHANCE))


def _is_steady(change: Measured, freedom: int) -> bool:
    """Whether no change of an amplitude is proven."""
    limit = STEADY + _errors_by_chance(freedom) * change.error
    return not abs(change.value) > limit


def find_features(trace: Trace, found: Slips) -> Features:
    """Measure a window of a trace, whose drops have been found."""
    force = trace.force
    largest = abs(trace.largest) or 1.0
    rest = without_drift(force)
    scatter = float(rest.std())
    cycles = periodic_cycles(trace, found)
    slips = find_slip_test(trace, found, cycles)
    change, freedom = find_change(trace, found, cycles)
    drift = slope(force, trace.t) * float(np.ptp(trace.t))
    swing = _swing(trace, found, cycles, drift)
    kurtosis = float(np.mean((rest**2) ** 2)) / scatter**4 if scatter else math.nan
    climb, climb_scatter, rate = _climb(trace, found)
    line_period, line = (
        (math.nan, math.nan) if cycles else spectral_line(trace.t, force)
    )
    # What neither swings nor slips nor changes is smooth whatever makes it: to ask
    # theory for its noise takes long.
    changes = not _is_steady(change, freedom)
    still = swing < TINY * largest and not slips[0].value >= slips[2] and not changes
    contact_noise_, limit = (
        (math.nan, ERRORS) if still else _contact_noise(trace, found)
    )
    known = found.cycles
    repeats = min(known.correlation, regularity(known.variation))
    fast = fast_ones(trace, found)
    return Features(
        span=float(np.ptp(trace.t)),
        largest=largest,
        mean=abs(float(force.mean())) or 1e-300,
        measured=trace.measured or trace.drive is None,
        moving=trace.pace is not None,
        contacts=trace.contacts,
        noise=found.noise,
        drift=drift,
        scatter=scatter,
        white_noise=_white_noise(scatter, found.noise, largest, force.size),
        part=float(np.ptp(force)) / largest,
        swing=Measured(swing / largest, 2.0 * found.noise / largest),
        ripple=math.sqrt(12.0) * float(force[force.size // 2 :].std()) / largest,
        kurtosis=Measured(kurtosis, math.sqrt(24.0 / force.size)),
        drops=found.size,
        count=cycles.count if cycles and fast.size else fast.size,
        cycles=cycles,
        correlation=cycles.correlation if cycles else repeats,
        slips=slips[0],
        slip_test=slips[1],
        slip_limit=slips[2],
        slip_source=slips[3],
        slip_phase=found.slip_phase(trace),
        loading_rate=rate,
        falling_rate=_falling_rate(trace, found),
        climb=climb,
        climb_scatter=climb_scatter,
        change=change,
        freedom=freedom,
        pause=_pause(trace, found),
        contact_noise=scatter / contact_noise_,
        noise_limit=limit,
        velocity_deviation=rms_velocity_deviation(trace),
        stuck=math.nan if trace.stuck is None else trace.stuck,
        line_period=line_period,
        line=line / largest,
    )


def _white_noise(scatter: float, noise: float, largest: float, size: int) -> Measured:
    """Scatter of a force over its noise from sample to sample; unknown where that is
    one of rounding.
    """
    if not noise > ROUNDING * largest:
        return UNKNOWN
    return Measured(scatter / noise, WHITE / ERRORS / math.sqrt(size))


def _is_level(drift: float, largest: float) -> bool:
    """Whether a force drifts by no more than that of a slider that slides: one that
    climbs by more may be that of a slider that is held. Under a constant drive a held
    slider makes no force fall.
    """
    return -MOST * largest <= drift <= SMALL * largest


def _swing(trace: Trace, found: Slips, cycles: Cycles | None, drift: float) -> float:
    """Peak to peak of a force, without its drift on a bench, and of a periodic one
    without the noise of the sensor.
    """
    force = trace.force
    if trace.measured and _is_level(drift, abs(trace.largest)):
        along = (trace.t - trace.t[0]) / float(np.ptp(trace.t)) - 0.5
        force = force - drift * along
    swing = float(np.ptp(force))
    if not (cycles and found.size):
        return swing
    # of a sine with noise of a sensor on top, peak to peak is more than the sine's
    variance = max(float(force.var()) - found.noise**2, 0.0)
    return min(swing, 2.0 * math.sqrt(2.0 * variance))


def periodic_cycles(trace: Trace, found: Slips) -> Cycles | None:
    """The cycles of a periodic force; drops that are even are cycles, too, on a
    level that wanders.
    """
    known = found.cycles
    period, _, variation = mean_and_std(np.diff(found.times))
    regular = (
        found.size > FEWEST_CYCLES
        and variation < JITTER
        and mean_and_std(found.drops)[2] < 2.0 * JITTER
    )
    if regular and not (known.periodic and found.size <= known.count + FEWEST_CYCLES):
        return Cycles(
            period=period,
            variation=variation,
            correlation=regularity(variation),
            times=found.times,
        )
    if not known.periodic and trace.measured:
        known = find_cycles(trace.t, without_drift(trace.force))
    return known if known.periodic and found.size >= FEWEST_CYCLES else None


def find_change(
    trace: Trace, found: Slips, cycles: Cycles | None
) -> tuple[Measured, int]:
    """Logarithm of the amplitude in the second half over the first, by a line through
    the drops of cycles, or the scatter in eight parts.

    Through sizes over their mean, not their logarithms, which small drops dominate.
    """
    sizes, times = found.drops, found.times
    if not cycles or abs(found.size - cycles.count) > 1:
        forces, moments = (
            np.array_split(values, 2 * FEWEST_CYCLES)
            for values in (trace.force, trace.t)
        )
        sizes = np.array([part.std() for part in forces])
        times = np.array([part.mean() for part in moments])
    times, sizes = times[sizes > 0], np.log(sizes[sizes > 0])
    if sizes.size < FEWEST_CYCLES:
        return UNKNOWN, 1
    at = (times - times.mean()) / float(np.ptp(trace.t))
    rate = slope(sizes, at)
    rest = sizes - sizes.mean() - rate * at
    power = float((rest**2).sum()) / float((at**2).sum()) / (sizes.size - 2)
    # Cycles that are large and small in turn tell a mean better than others do
    # (Bartlett).
    turn = min(
        float((rest[1:] * rest[:-1]).sum()) / (float((rest**2).sum()) or 1.0), 0.0
    )
    turn = max(turn, 1.0 / sizes.size - 1.0)
    power *= (1.0 + turn) / (1.0 - turn)
    return Measured(0.5 * rate, 0.5 * math.sqrt(power)), sizes.size - 2


def _pause(trace: Trace, found: Slips) -> float:
    """Time since the last drop over the longest wait that chance makes."""
    waits = np.diff(found.times)
    if waits.size < FEWEST_CYCLES:
        return math.nan
    return float(trace.t[-1] - found.times[-1]) / longest_wait(waits)


def longest_wait(waits: Array) -> float:
    """Longest of so many waits by chance, by the tail of an exponential of their
    scatter; at least two usual ones.
    """
    usual = weighted_median(waits, waits)
    # the longest may be the pause that is asked for
    others = np.sort(waits)[:-1]
    scatter = min(float(others.std() / others.mean()), 1.0)
    return usual * max(PAUSE, 1.0 + scatter * math.log(waits.size / ONE_IN_TWENTY))


def find_slip_test(
    trace: Trace, found: Slips, cycles: Cycles | None
) -> tuple[Measured, str, float, Source]:
    """What shows slips: the velocity of the slider where it is seen; else how long it
    is held. The number, its name, limit and source.

    That is the time not in drops; where these take long, that at the full loading
    rate (less without a period).
    """
    samples = weighted_median(
        np.asarray(found.trough - found.peak, dtype=float), found.drops**2
    )
    # in a typical drop; NaN if it is not known
    each = speeds(trace, found)
    fast = weighted_median(each, found.drops**2)
    resolved = math.isfinite(fast) and samples >= FEWEST_IN_A_DROP
    if fast >= SLIP_VELOCITY or resolved:
        off = weighted_median(np.abs(each - fast), np.ones(each.size))
        error = 1.4826 * off / math.sqrt(max(found.size, 1))
        return Measured(fast, error), SLIDER_VELOCITY, SLIP_VELOCITY, "theory"
    phase = found.slip_phase(trace)
    if not phase > SLIP_PHASE or trace.contacts:
        name = "part of the time not in drops"
        return Measured(1.0 - phase), name, 1.0 - SLIP_PHASE, "theory"
    step = (trace.t[-1] - trace.t[0]) / (trace.t.size - 1)
    held = loading(trace.force, step, found.noise)[1]
    return Measured(held), HELD_TIME, HALF if cycles else HELD, "convention"


def _climb(trace: Trace, found: Slips) -> tuple[Measured, float, Measured]:
    """How the force climbs to its drops: loading rate times wait over the drop;
    scatter of the rate from climb to climb over it; the rate.

    The slope of a climb is that from the second to the third quarter of a wait, by
    means, as ringing and rounded peaks are at its ends.
    """
    begins, ends = found.end[:-1], found.start[1:]
    long = ends > begins
    begins, ends, drops = begins[long], ends[long], found.drops[1:][long]
    if begins.size < FEWEST_CYCLES - 1:
        return UNKNOWN, math.nan, UNKNOWN
    waits = trace.t[ends] - trace.t[begins]
    quarter = (ends - begins) // 4
    sums, at = (
        np.append(0.0, np.cumsum(values - values[0]))
        for values in (trace.force, trace.t)
    )

    def mean(total: Array, first: Array, last: Array) -> Array:
        """Means from first to last samples."""
        return np.asarray((total[last + 1] - total[first]) / (last + 1 - first))

    # of short waits, from the first to the last sample
    short = quarter < 1
    middle = (begins + ends) // 2
    early = np.where(short, begins, begins + quarter), np.where(short, begins, middle)
    late = np.where(short, ends, middle), np.where(short, ends, ends - quarter)
    rise = mean(sums, *late) - mean(sums, *early)
    took = mean(at, *late) - mean(at, *early)
    rates = rise / took
    rate = weighted_median(rates, waits)
    if not rate > 0:
        return Measured(0.0), math.inf, Measured(rate)
    scatter = 1.4826 * weighted_median(np.abs(rates - rate), waits)
    # the noise of the sensor makes the rates scatter, too
    each = found.noise * np.sqrt(2.0 / np.maximum(late[1] + 1 - late[0], 1)) / took
    scatter = math.sqrt(max(scatter**2 - weighted_median(each, waits) ** 2, 0.0))
    gain = rate * float(waits.sum()) / float(drops.sum())
    spread = scatter / rate
    root = math.sqrt(begins.size)
    return (
        Measured(gain, gain * spread / root),
        spread,
        Measured(rate, scatter / root),
    )


def _falling_rate(trace: Trace, found: Slips) -> float:
    """Rate at which the force falls in a typical drop."""
    took = trace.t[found.end] - trace.t[found.start]
    rates = found.drops / np.where(took > 0, took, np.inf)
    return weighted_median(rates, found.drops**2)


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


def _contact_noise(trace: Trace, found: Slips) -> tuple[float, float]:
    """Standard deviation of the force in smooth sliding, NaN if unstable; and how
    many times is no more.
    """
    count = trace.contacts
    if not count or not found.size:
        return math.nan, ERRORS
    if trace.rig is not None and trace.drive is not None:
        # it is rounded
        speed = float(np.mean(trace.drive)) / trace.rig.unit("velocity")
        known = noise_of(trace.rig.interface, trace.rig.slider, float(f"{speed:.12g}"))
        if known is not None:
            return known * trace.rig.unit("f_s") / math.sqrt(count), ERRORS
    mean = abs(float(trace.force.mean())) or 1e-300
    largest = NOISE_OF_CONTACTS * (abs(trace.largest) or 1.0)
    return min(largest, mean) / math.sqrt(count), 1.0
