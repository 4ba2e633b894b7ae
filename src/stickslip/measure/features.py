"""The features of a window of a force trace, with their errors, and the tests that
decide its regime.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from scipy import fft
from scipy.ndimage import uniform_filter1d
from scipy.special import stdtrit

from stickslip.errors import InputError, UndecidedError
from stickslip.measure.kinematics import rms_velocity_deviation
from stickslip.measure.periods import JITTER, PERIODIC, Cycles, regularity
from stickslip.measure.sensor import ROUNDING
from stickslip.measure.slips import (
    FEWEST_IN_A_DROP,
    SLIP_VELOCITY,
    WHITE,
    Slips,
    fast_slips,
    find_slips,
    fitted_locally,
    speeds,
    weighted_median,
)
from stickslip.measure.strokes import LEAST_WAY
from stickslip.measure.trace import (
    CHANCE,
    ERRORS,
    FEWEST_CYCLES,
    FEWEST_READINGS,
    STEADY_DEVIATION,
    Array,
    Trace,
    mean_and_std,
    slope,
)
from stickslip.model import Interface
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.stability import contact_noise, count_unstable

# Conventions, which define the words.
# Smooth sliding: an oscillation below this fraction of the largest force ...
TINY = 0.02
# ... or below this one, if it decays, or if noise could hide it.
SMALL = 0.10
MOST = 0.5  # "most" of a time or of a force is more than this fraction of it
STEADY = 0.05  # a smaller change of the logarithm of the amplitude counts as none
# Persistence excludes a change of the logarithm of the amplitude from one half to the
# other by this much; the measured change must be less than half of it.
LASTING = math.log(2.0)
# The rise of the force before a drop is at least this fraction of the drop, and the
# drop at least this fraction of the rise.
CLIMBS = 0.5
ONE_RATE = 0.25  # largest relative scatter of a loading rate that is constant
ONE_IN_TWENTY = 0.05  # error probability of one-sided tests ...
ONE_SIDED = 1.645  # ... and their number of standard errors
# Slow waves are removed by windows of a fourth, an eighth, or a sixteenth of a record.
WAVES = (4, 8, 16)
_PART_OF_LAGS = 32  # changes over up to this fraction of a window show skewness
_BESIDE = 101  # neighbouring frequencies with which a spectral line is compared
# Theory.
# Standard deviation of the force of N independent contacts, evenly stretched: this
# times static friction over sqrt(N).
NOISE_OF_CONTACTS = 0.5
# Kurtosis of n = 3 waves of equal amplitude, 3 - 3/(2 n): noise consists of at least
# three.
NORMAL = 2.5
# coefficient of variation of the amplitude of narrow-band noise (Rayleigh)
RAYLEIGH = math.sqrt(4.0 / math.pi - 1.0)
# Cycles whose sizes scatter by less than this fraction of that are not noise; a
# convention.
EVEN = 0.5
# A slider held for the rest of each cycle slips at four times the drive on average.
SLIP_PHASE = 0.25
# A wait of this many usual waits is that of one missing drop.
MISSING = 2.0

SLIDER_VELOCITY = "largest slider velocity over the drive's"
REPEATS = "correlation of a cycle with the next"
SWING = "peak to peak over the largest force"
NOISE = "scatter over the noise of the contacts"
CHANGE = "change of the logarithm of the amplitude"
Source = Literal["theory", "statistics", "convention"]


class Feature(NamedTuple):
    """A number and its standard error."""

    value: float
    error: float = 0.0


class Loading(NamedTuple):
    """Loading of the spring before the drops of a force."""

    rate: float = math.nan
    scatter: float = math.nan  # relative, of the rate, without the sensor's noise
    gain: Feature = Feature(math.nan)  # rate times waiting time over the drop
    is_resolved: bool = False  # whether noise is so small that rates can be compared


@dataclass(frozen=True)
class Criterion:
    """One test of a regime."""

    name: str  #: of the statistic
    statistic: float  #: its value
    error: float  #: its standard error; 0 where it is not known
    limit: float  #: value with which it is compared
    source: Source  #: where the limit comes from: theory, statistics or a convention
    passed: bool  #: the answer

    def __str__(self) -> str:
        answer = "yes" if self.passed else "no"
        error = f"+- {self.error:.2g}" if self.error else ""
        return (
            f"{self.name:48} {self.statistic:10.3g} {error:10} {self.limit:10.3g}  "
            f"{self.source:10}  {answer}"
        )


@dataclass(frozen=True)
class Window:
    """Features of a window of a trace, in its units; NaN where one is not known."""

    trace: Trace
    slips: Slips

    @classmethod
    def of(cls, trace: Trace) -> Self:
        """Make the window of a trace, and find its drops."""
        return cls(trace, find_slips(trace))

    @cached_property
    def past_waves(self) -> "Window":
        """The window without a slow or a fast wave, if slips appear without it."""
        return _look_past_waves(self)

    @cached_property
    def largest(self) -> float:
        """Largest force in all of the data."""
        return abs(self.trace.largest) or 1.0

    @cached_property
    def mean(self) -> float:
        """Absolute value of the mean force."""
        return abs(float(self.trace.force.mean())) or 1e-300

    @cached_property
    def scatter(self) -> float:
        """Standard deviation of the force without its drift."""
        return float(self.trace.residual.std())

    @cached_property
    def white_noise(self) -> Feature:
        """Scatter of the force over the noise of the sensor."""
        noise = max(self.slips.noise, ROUNDING * self.largest)
        error = WHITE / ERRORS / math.sqrt(self.trace.residual.size)
        return Feature(self.scatter / noise, error)

    @property
    def is_white_noise(self) -> bool:
        """Whether the force fluctuates by no more than the noise of the sensor."""
        return self.white_noise.value <= 1.0 + ERRORS * self.white_noise.error

    @property
    def hidden(self) -> float:
        """Peak to peak of the largest sawtooth that white noise may hide, over the
        largest force.
        """
        limit = 1.0 + ERRORS * self.white_noise.error
        return math.sqrt(12.0 * (limit**2 - 1.0)) * self.slips.noise / self.largest

    @property
    def is_mostly_noise(self) -> bool:
        """Whether most of the scatter is noise of the sensor."""
        return self.slips.noise > MOST * self.scatter

    @property
    def is_narrow(self) -> bool:
        """Whether three standard deviations of the force are at most half its mean."""
        return ERRORS * self.scatter <= MOST * self.mean

    @cached_property
    def is_level(self) -> bool:
        """Whether the drift of the force is small enough for a slider that slides.

        A force that climbs by more than `SMALL` may be that of a held slider. It may
        fall by more, as a held slider never lowers the force of a constant drive.
        """
        slow = self.trace.force - self.trace.residual
        climb = np.max(slow - np.minimum.accumulate(slow))
        fall = np.max(np.maximum.accumulate(slow) - slow)
        return bool(fall <= MOST * self.largest and climb <= SMALL * self.largest)

    @cached_property
    def kurtosis(self) -> Feature:
        """Kurtosis of the force, with the error that it has for white noise."""
        fourth = float(np.mean((self.trace.residual**2) ** 2))
        value = fourth / self.scatter**4 if self.scatter else math.nan
        return Feature(value, math.sqrt(24.0 / self.trace.residual.size))

    @cached_property
    def skewness(self) -> float:
        """Mean cube of the changes of the force over a lag, in its standard errors, at
        the lag where it is lowest. Noise looks the same backwards in time; slips fall
        faster than they climb. NaN where the velocity of the slider is known, which
        decides.
        """
        if self.trace.velocity is not None:
            return math.nan
        least = 0.0
        residual = self.trace.residual
        lags = 2 ** np.arange(max(residual.size // _PART_OF_LAGS, 1).bit_length())
        for lag in lags.tolist():
            change = residual[lag:] - residual[:-lag]
            cubes = change * change * change  # much faster than a power
            parts = np.array_split(cubes, 2 * FEWEST_CYCLES)
            means = np.array([part.mean() for part in parts])
            error = means.std(ddof=1) / math.sqrt(means.size)
            if error:
                least = min(least, float(means.mean() / error))
        return least

    @property
    def hides_slips(self) -> bool:
        """Whether a force, whose noise hides how it climbs, falls faster than that."""
        return not self.loading.is_resolved and self.skewness < -ERRORS

    @cached_property
    def part(self) -> float:
        """Peak to peak of the force in the window, over the largest force."""
        return float(np.ptp(self.trace.force)) / self.largest

    @cached_property
    def swing(self) -> Feature:
        """Peak to peak over the largest force: of a level measured force without its
        drift, of a periodic one without its noise; at least a step of the record.
        """
        trace = self.trace
        force = trace.force
        if trace.measured and self.is_level:
            force = trace.without_line
        swing = float(np.ptp(force))
        if self.cycles:
            # The noise of the sensor adds to the peak to peak of a sine.
            variance = max(float(force.var()) - self.slips.noise**2, 0.0)
            swing = min(swing, 2.0 * math.sqrt(2.0 * variance))
        return Feature(
            max(swing, trace.reading_step) / self.largest,
            2.0 * self.slips.noise / self.largest,
        )

    @cached_property
    def ripple(self) -> float:
        """Peak to peak, over the largest force, of a sawtooth with the standard
        deviation of the second half of the window.
        """
        late = self.trace.force[self.trace.force.size // 2 :]
        return math.sqrt(12.0) * float(late.std()) / self.largest

    @cached_property
    def cycles(self) -> Cycles | None:
        """The cycles of a periodic force, or its drops if these are regular although
        the mean force wanders; None if there is no period.
        """
        found = self.slips
        period, _, variation = mean_and_std(found.waits)
        known = found.cycles
        if (
            found.size > FEWEST_CYCLES
            and variation < JITTER
            and mean_and_std(found.drops)[2] < 2.0 * JITTER
            and not (known.periodic and found.size <= known.count + FEWEST_CYCLES)
        ):
            return Cycles(
                period=period,
                variation=variation,
                correlation=regularity(variation),
                times=found.times,
            )
        return known if known.periodic and found.size >= FEWEST_CYCLES else None

    @cached_property
    def count(self) -> int:
        """Number of complete cycles, or of drops where there is no period."""
        return (
            self.cycles.count
            if self.cycles
            else fast_slips(self.trace, self.slips).size
        )

    @cached_property
    def correlation(self) -> float:
        """Correlation of a cycle with the next."""
        if self.cycles:
            return self.cycles.correlation
        known = self.slips.cycles
        return min(known.correlation, regularity(known.variation))

    @cached_property
    def loading(self) -> Loading:
        """Loading before the drops, measured in the middle half of each wait: its ends
        hold ringing and rounded peaks.
        """
        begins = self.slips.end[:-1]
        ends = self.slips.start[1:]
        long = ends > begins
        if np.count_nonzero(long) < FEWEST_CYCLES - 1:
            return Loading()
        begins = begins[long]
        ends = ends[long]
        quarter = (ends - begins) // 4
        first = begins + quarter
        last = ends - quarter
        middle = (first + last) // 2
        late = _means(self.trace, middle, last)
        took, rise = late - _means(self.trace, first, middle)
        rates = rise / took
        waits = self.trace.clock[ends] - self.trace.clock[begins]
        rate = weighted_median(rates, waits)
        if not rate > 0:
            return Loading(rate, math.inf, Feature(0.0))
        # without the median itself, which may have more than half of the weight
        away = np.abs(rates - rate)
        others = np.arange(rates.size) != np.argmin(away)
        scatter = 1.4826 * weighted_median(away[others], waits[others])
        # Remove the scatter that the noise of the sensor adds, unless the noise is too
        # large to know whether the rates are equal.
        noises = self.slips.noise * np.sqrt(2.0 / (last - middle + 1)) / took
        noise = weighted_median(noises, waits)
        is_resolved = noise < ONE_RATE * rate
        if is_resolved:
            scatter = max(scatter**2 - noise**2, 0.0) ** 0.5
        scatter /= rate
        gain = float(rate * waits.sum() / self.slips.drops[1:][long].sum())
        return Loading(
            rate,
            scatter,
            Feature(gain, gain * scatter / waits.size**0.5),
            is_resolved,
        )

    @cached_property
    def falling_rate(self) -> float:
        """Rate at which the force falls in a typical drop."""
        clock = self.trace.clock
        took = clock[self.slips.trough] - clock[self.slips.peak]
        return self.slips.typical(self.slips.drops / took)

    @cached_property
    def seen_velocity(self) -> float:
        """Largest velocity of the slider in a typical drop over the drive's; NaN where
        it is not known, or where the drop is too short to resolve it.
        """
        found = self.slips
        usual = found.typical(speeds(self.trace, found))
        samples = found.typical(found.trough - found.peak)
        lasts = found.typical(self.trace.t[found.trough] - found.times)
        resolved = samples >= FEWEST_IN_A_DROP and lasts >= self.trace.slope_window
        shown = usual >= SLIP_VELOCITY or resolved
        return usual if shown else math.nan

    @cached_property
    def slip_velocity(self) -> float:
        """Velocity of a slip over the drive's: the known velocity of the slider, or
        that from the rates of the force, if it climbs at a constant rate; else NaN.
        """
        if not math.isnan(self.seen_velocity):
            return self.seen_velocity
        known = self.climbs or self.trace.full_rate is not None
        return self.velocity_by_rates if known else math.nan

    @property
    def velocity_by_rates(self) -> float:
        """Velocity of a slip over the drive's from the rates of the force: 1 + falling
        rate over loading rate, which assumes a slider held between drops. Known
        stiffness and velocity give the loading rate; else it is measured.
        """
        return 1.0 + self.falling_rate / (self.trace.full_rate or self.loading.rate)

    @property
    def climbs(self) -> bool:
        """Whether the force climbs to its drops at a constant rate."""
        gain = self.loading.gain
        enough = gain.value - ONE_SIDED * gain.error > CLIMBS
        return enough and CLIMBS * gain.value < 1 and self.loading.scatter < ONE_RATE

    @property
    def slipping_parts(self) -> float:
        """Fraction of the quarters of the drops, or of the halves or thirds of few, in
        which typical drops are as fast as slips; NaN if all are judged together.
        """
        found = self.slips
        count = min(found.size // FEWEST_CYCLES, 4)
        if not self.trace.measured or count < 2:
            return math.nan
        number = np.arange(found.size) * count // found.size
        parts = (replace(self, slips=found.only(number == i)) for i in range(count))
        return sum(part.falls_fast or part.are_slips for part in parts) / count

    @property
    def slips_throughout(self) -> bool:
        """Whether typical drops are as fast as slips in each part of the window."""
        return not self.slipping_parts < 1.0

    @property
    def drops_of_cycles(self) -> int:
        """Number of drops that make most of the scatter, with a climb of at least half
        their size before or after them.
        """
        found = self.slips
        if not found.size:
            return 0
        peaks = np.append(found.before[1:], self.trace.force[found.end[-1] :].max())
        climbs = peaks - found.after
        large = found.drops > MOST * math.sqrt(12.0) * self.scatter
        return int(np.count_nonzero(large & (climbs >= CLIMBS * found.drops)))

    @property
    def shows_cycles(self) -> bool:
        """Whether a drop is that of a cycle."""
        return self.drops_of_cycles > 0

    @property
    def unevenness(self) -> float:
        """Scatter of the sizes of cycles over that of noise of a narrow band, by
        Rayleigh's distribution; NaN where there are few or none.
        """
        enough = self.cycles is not None and self.slips.size >= 2 * FEWEST_CYCLES
        return mean_and_std(self.slips.drops)[2] / RAYLEIGH if enough else math.nan

    @property
    def is_even(self) -> bool:
        """Whether cycles are more alike than those of narrow-band noise."""
        return self.unevenness < EVEN

    @property
    def falls_fast(self) -> bool:
        """Whether the force falls as much faster than it climbs as in slips, whether or
        not it climbs at a constant rate.
        """
        climbs = self.loading.gain.value > CLIMBS
        known = climbs and math.isnan(self.seen_velocity)
        return known and self.velocity_by_rates >= 1.0 / SLIP_PHASE

    @property
    def slip_limit(self) -> float:
        """Least velocity of slips over the drive's: their mean velocity where only the
        force is known, else their largest.
        """
        return 1.0 / SLIP_PHASE if math.isnan(self.seen_velocity) else SLIP_VELOCITY

    @property
    def are_slips(self) -> bool:
        """Whether the drops are as fast as slips."""
        return self.slip_velocity >= self.slip_limit

    @property
    def reversed(self) -> Self:
        """The window with its force negated and without the velocity of the slider."""
        trace = replace(self.trace, force=-self.trace.force, velocity=None)
        return type(self).of(trace)

    @property
    def is_stick_slip(self) -> bool:
        """Whether there are enough slips to call the motion stick-slip."""
        return self.are_slips and self.count >= FEWEST_CYCLES

    @cached_property
    def _amplitudes(self) -> tuple[Array, Array]:
        """Logarithms of the amplitude, and their times over the length of the window.

        The amplitude is the drop of each cycle, or the scatter in each of eight parts.
        """
        trace = self.trace
        found = self.slips
        sizes = found.drops
        times = found.times
        if not self.cycles or abs(found.size - self.cycles.count) > 1:
            forces = np.array_split(trace.force, 2 * FEWEST_CYCLES)
            sizes = np.array([part.std() for part in forces])
            ends = np.linspace(trace.t[0], trace.t[-1], sizes.size + 1)
            times = 0.5 * (ends[1:] + ends[:-1])
        return np.log(sizes[sizes > 0]), times[sizes > 0] / trace.length

    @cached_property
    def change(self) -> Feature:
        """Logarithm of the amplitude in the second half over the first, from a fitted
        line.
        """
        sizes, at = self._amplitudes
        if sizes.size < FEWEST_CYCLES:
            return Feature(math.nan)
        at = at - at.mean()
        rate = slope(sizes, at)
        rest = sizes - sizes.mean() - rate * at
        square = (rest**2).sum()
        power = square / (at**2).sum() / (sizes.size - 2)
        # Cycles that are large and small in turn determine a mean better (Bartlett).
        turn = (rest[1:] * rest[:-1]).sum() / (square or 1.0)
        turn = min(max(turn, 1.0 / sizes.size - 1.0), 0.0)
        power *= (1.0 + turn) / (1.0 - turn)
        return Feature(0.5 * rate, 0.5 * math.sqrt(power))

    def errors(self, chance: float) -> float:
        """Return the number of standard errors that the change of the amplitude exceeds
        by chance with this probability: Student's t, as few parts give their scatter
        poorly.
        """
        return float(stdtrit(max(self._amplitudes[0].size - 2, 1), 1.0 - chance))

    @cached_property
    def trend(self) -> int:
        """Direction in which the amplitude changes: 1 where it grows, -1 where it
        decays, 0 where no change is proven.
        """
        value, error = self.change
        proven = abs(value) > STEADY + self.errors(CHANCE) * error
        return int(math.copysign(1, value)) if proven else 0

    @cached_property
    def persists(self) -> bool:
        """Whether the amplitude persists.

        It changes by less than a factor of sqrt(2), a factor of 2 is excluded, and the
        last drop is not long ago. In a run without slips, sqrt(2) must be excluded, as
        its amplitude changes slowly near the end of a branch.
        """
        seen = abs(self.change.value)
        most = seen + self.errors(ONE_IN_TWENTY) * self.change.error
        may_linger = not (self.trace.measured or self.are_slips)
        excluded = most < (0.5 * LASTING if may_linger else LASTING)
        return seen < 0.5 * LASTING and excluded and not self.pause > 1.0

    @cached_property
    def pause(self) -> float:
        """Time since the last drop over the longest wait to be expected by chance."""
        waits = self.slips.waits
        if waits.size < FEWEST_CYCLES:
            return math.nan
        return float(self.trace.t[-1] - self.slips.times[-1]) / longest_wait(waits)

    @property
    def is_still(self) -> bool:
        """Whether the force neither oscillates nor slips nor grows."""
        return self.swing.value < TINY and not self.are_slips and self.trend < 1

    @cached_property
    def contact_noise(self) -> tuple[float, float]:
        """Scatter over the noise of the contacts, and the ratio up to which it counts
        as such noise.

        NaN where the noise is not known. Where the force is still, it is not computed,
        as that takes long.
        """
        trace = self.trace
        count = trace.contacts
        if not count or not self.slips.size or self.is_still:
            return math.nan, ERRORS
        rig = trace.rig
        if rig is not None and trace.drive is not None and not rig.drive.load:
            mean = np.mean(trace.drive) / rig.unit("velocity")
            speed = float(f"{mean:.12g}")  # rounded, so that the cache finds it again
            known = noise_of(rig.interface, rig.slider, speed)
            if known is not None:
                unit = rig.unit("f_s") / math.sqrt(count)
                return self.scatter / (known * unit), ERRORS
        usual = min(NOISE_OF_CONTACTS * self.largest, self.mean)
        return self.scatter / usual * math.sqrt(count), 1.0

    @property
    def is_contact_noise(self) -> bool:
        """Whether the force fluctuates by no more than the noise of its contacts."""
        value, limit = self.contact_noise
        return value < limit

    @cached_property
    def velocity_deviation(self) -> float:
        """Rms deviation of the slider's velocity from the drive's, over the drive's."""
        return rms_velocity_deviation(self.trace)

    @property
    def _tests_of_drops(self) -> tuple[Criterion, ...]:
        """The tests of drops and cycles, where the others do not decide."""
        by_rates = math.nan
        if math.isnan(self.slip_velocity) and self.loading.gain.value > CLIMBS:
            by_rates = self.velocity_by_rates
        nearer, farther = sorted((-self.trace.force.min(), self.trace.force.max()))
        sided = self.trace.measured and nearer > 0 and not self.is_stick_slip
        return (
            _test(
                "falling rate over that of any climb, plus 1",
                by_rates,
                1.0 / SLIP_PHASE,
                "theory",
                self.falls_fast,
            ),
            _test(
                "fraction of the parts of the window with drops so fast",
                self.slipping_parts if self.is_stick_slip else math.nan,
                1.0,
            ),
            _test(
                "drops that make most of the scatter, with a climb",
                self.drops_of_cycles if self.count < FEWEST_CYCLES else math.nan,
                1,
            ),
            _test(
                "scatter of cycles over that of noise of a narrow band",
                self.unevenness,
                EVEN,
                "convention",
                self.is_even,
            ),
            _test(
                "nearer over farther force, on both sides of zero",
                nearer / farther if sided else math.nan,
                LEAST_WAY,
                "convention",
            ),
        )

    @property
    def _tests_of_noise(self) -> tuple[Criterion, ...]:
        """The tests that tell noise from an oscillation."""
        narrow = ERRORS * self.scatter / self.mean
        return (
            _test(NOISE, *self.contact_noise, "theory"),
            _test("kurtosis of the force", self.kurtosis, NORMAL, "theory"),
            _test(
                "skewness of its changes, in errors",
                self.skewness,
                -ERRORS,
                passed=self.skewness >= -ERRORS,
            ),
            _test(
                "three standard deviations over the mean",
                narrow,
                MOST,
                "convention",
                self.is_narrow,
            ),
        )

    @property
    def tests(self) -> tuple[Criterion, ...]:
        """The tests that decide a regime, without those of unknown features."""
        value, error = self.change
        change = Feature(abs(value), error * self.errors(CHANCE) / ERRORS)
        gain = self.loading.gain
        climbs = gain.value - ONE_SIDED * gain.error > CLIMBS
        white = 1.0 + ERRORS * self.white_noise.error
        velocity = SLIDER_VELOCITY
        if math.isnan(self.seen_velocity):
            of_a_held = self.trace.full_rate is not None
            beside = "stiffness times velocity" if of_a_held else "loading rate"
            velocity = f"1 + falling rate over {beside}"
        rows = (
            _test("drops that stand out of the noise", self.slips.size, 1),
            _test(SWING, self.swing, TINY, "convention"),
            _test("cycles in the window", self.count, FEWEST_CYCLES),
            _test(
                "scatter over the noise of the sensor",
                self.white_noise,
                white,
                passed=self.is_white_noise,
            ),
            _test(REPEATS, self.correlation, PERIODIC, "convention"),
            _test(
                CHANGE,
                change,
                0.5 * LASTING,
                "convention",
                self.persists,
            ),
            _test(
                "wait for a next drop over the longest by chance",
                self.pause,
                1.0,
                passed=self.pause <= 1.0,
            ),
            _test(
                "second half, as a sawtooth, over the largest force",
                self.ripple,
                SMALL,
                "convention",
                self.ripple <= SMALL,
            ),
            _test(velocity, self.slip_velocity, self.slip_limit, "theory"),
            *self._tests_of_drops,
            _test(
                "loading rate times wait, over the drop",
                gain,
                CLIMBS,
                "convention",
                climbs,
            ),
            _test(
                "scatter of the loading rate over it",
                self.loading.scatter,
                ONE_RATE,
                "convention",
                self.loading.scatter < ONE_RATE,
            ),
            *self._tests_of_noise,
            _test(
                "slider velocity off the drive's (rms), over it",
                self.velocity_deviation,
                STEADY_DEVIATION,
                "convention",
            ),
        )
        return tuple(row for row in rows if not math.isnan(row.statistic))


def _test(
    name: str,
    found: float | Feature,
    limit: float,
    source: Source = "statistics",
    passed: bool | None = None,
) -> Criterion:
    """Make a test; by default it is passed where a number reaches its limit."""
    value, error = found if isinstance(found, Feature) else (found, 0.0)
    passed = value >= limit if passed is None else passed
    return Criterion(name, value, error, limit, source, passed)


def _look_past_waves(seen: Window) -> Window:
    """Return the window without a slow wave, or averaged over the period of a fast one.

    It is returned unchanged unless the result slips, and would not slip if the force
    were negated.
    """
    trace = seen.trace
    if trace.pace is not None or seen.is_white_noise or seen.is_stick_slip:
        return seen
    if seen.swing.value < TINY:
        return seen
    if (period := _fast_period(trace.force)) > 1:
        force = uniform_filter1d(trace.force, period, mode="nearest")
        smoothed = Window.of(replace(trace, force=force))
        shortest = FEWEST_CYCLES * period * trace.step
        if _slips_one_way(smoothed) and smoothed.slips.waits.mean() > shortest:
            return smoothed
    for part in WAVES:
        width = trace.t.size // part
        if width < 2 * FEWEST_READINGS:
            break
        wave = fitted_locally(trace.force, width, 2)
        wave -= np.median(wave)
        shown = Window.of(replace(trace, force=trace.force - wave))
        found = shown.slips
        if _slips_one_way(shown) and found.waits.mean() < width * trace.step / 2:
            level = wave[found.peak]
            found = replace(
                found,
                before=found.before + level,
                after=found.after + level,
            )
            return replace(shown, slips=found)
    return seen


def _slips_one_way(seen: Window) -> bool:
    """Whether a force slips, and would not if it were negated."""
    return seen.is_stick_slip and not seen.reversed.is_stick_slip


def _fast_period(force: Array) -> int:
    """Return the period, in samples, of the strongest fast wave of a force, such as
    mains hum; 0 if none is significant.

    Second differences suppress slow waves, and turn a drop into a short pulse, which
    has no line in a spectrum.
    """
    power = np.abs(fft.rfft(np.diff(force, 2))) ** 2
    over = power / np.maximum(uniform_filter1d(power, _BESIDE), 1e-300)
    line = max(int(np.argmax(over)), 1)
    # the power of noise is exponentially distributed
    stands_out = over[line] > math.log(power.size / CHANCE)
    return round(force.size / line) if stands_out else 0


def _means(trace: Trace, first: Array, last: Array) -> Array:
    """Return the mean times and forces between pairs of samples."""
    ends = np.column_stack([first, last + 1]).ravel()
    # a sum may end with the last sample, which `reduceat` takes for none
    sums = [
        np.add.reduceat(np.append(values - values[0], 0.0), ends)[::2]
        for values in (trace.clock, trace.force)
    ]
    return np.asarray(sums) / (last + 1 - first)


def longest_wait(waits: Array) -> float:
    """Return the longest of these waits to be expected by chance: that of an
    exponential tail with their scatter, but at least that of one missing drop.
    """
    usual = weighted_median(waits, waits)
    # The longest wait may itself be a pause.
    others = np.sort(waits)[:-1]
    scatter = min(float(others.std() / others.mean()), 1.0)
    return usual * max(MISSING, 1.0 + scatter * math.log(waits.size / ONE_IN_TWENTY))


@lru_cache(maxsize=256)
def noise_of(interface: Interface, slider: Any, velocity: float) -> float | None:
    """Return the standard deviation of the force of smooth sliding times ``sqrt(N)``:
    NaN if sliding is unstable, None if it is not known.
    """
    try:
        rig = Rig(interface, slider, constant(velocity))
        if count_unstable(rig):
            return math.nan
        return contact_noise(rig, contacts=1).spring_force
    except (InputError, UndecidedError):
        return None
