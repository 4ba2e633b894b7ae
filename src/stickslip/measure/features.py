"""The features of a window of a force trace, each number with its error, and the tests
that a regime rests on.
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

# Conventions: the meaning of the words.
TINY = 0.02  # an oscillation below this part of the largest force is smooth sliding ...
SMALL = 0.10  # ... and one that decays, or noise that may hide another, below this
MOST = 0.5  # of the time, or of a force
STEADY = 0.05  # change of the logarithm of the amplitude that is none
# change of the logarithm of the amplitude from half to half that persistence excludes;
# the change that is seen is at most half of it
LASTING = math.log(2.0)
# part of a drop that the loading before it makes up, at least; and the other way round
CLIMBS = 0.5
ONE_RATE = 0.25  # scatter of the loading rate over it, at most
ONE_IN_TWENTY = 0.05  # how often chance passes a limit of one side ...
ONE_SIDED = 1.645  # ... which is this number of errors off
ROUNDING = 1e-9  # of the largest force: noise below that is of numbers
WAVES = (4, 8, 16)  # parts of a record: waves slower than these are looked past
_BESIDE = 101  # frequencies about a line of a spectrum, with which it is compared
# Theory.
# independent contacts, evenly stretched: times static friction over the root of their
# number
NOISE_OF_CONTACTS = 0.5
# kurtosis of three waves of a size, 3 - 3/(2 n): noise has at least as many
NORMAL = 2.5
# coefficient of variation of the amplitudes of noise of a narrow band
RAYLEIGH = math.sqrt(4.0 / math.pi - 1.0)
# over that: cycles whose sizes scatter by less are no noise, by convention
EVEN = 0.5
# held for the rest of the time, a slider slips at four times the drive on average
SLIP_PHASE = 0.25
# usual waits: a wait so long is that of one drop that is missing
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
    """Climb of a force to its drops."""

    rate: float = math.nan
    scatter: float = math.nan  # of the rate over it, without the sensor's noise
    gain: Feature = Feature(math.nan)  # rate times wait over the drop


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
    """Features of a window of a trace, in its units; NaN where they are not known."""

    trace: Trace
    found: Slips

    @classmethod
    def of(cls, trace: Trace) -> Self:
        """A window, with its drops."""
        return cls(trace, find_slips(trace))

    @cached_property
    def past_waves(self) -> "Window":
        """The window without a slow or a fast wave, where it then slips."""
        return _look_past_waves(self)

    @cached_property
    def largest(self) -> float:
        """Largest force in all of the data."""
        return abs(self.trace.largest) or 1.0

    @cached_property
    def mean(self) -> float:
        """Mean force, in size."""
        return abs(float(self.trace.force.mean())) or 1e-300

    @cached_property
    def rest(self) -> Array:
        """The force without its drift."""
        return without_drift(self.trace.force)

    @cached_property
    def scatter(self) -> float:
        """Standard deviation of the force without its drift."""
        return float(self.rest.std())

    @cached_property
    def white_noise(self) -> Feature:
        """Scatter over the noise of the sensor."""
        noise = max(self.found.noise, ROUNDING * self.largest)
        error = WHITE / ERRORS / math.sqrt(self.rest.size)
        return Feature(self.scatter / noise, error)

    @property
    def is_white_noise(self) -> bool:
        """Whether the force is noise of the sensor."""
        return self.white_noise.value <= 1.0 + ERRORS * self.white_noise.error

    @property
    def is_mostly_noise(self) -> bool:
        """Whether most of the scatter is noise of the sensor."""
        return self.found.noise > MOST * self.scatter

    @property
    def is_narrow(self) -> bool:
        """Whether chance takes the force no farther than halfway to zero."""
        return ERRORS * self.scatter <= MOST * self.mean

    @cached_property
    def is_level(self) -> bool:
        """Whether the force drifts by no more than that of a slider that slides: one
        that climbs by more, from anywhere on, may be that of a slider that is held.
        Under a constant drive a held slider makes no force fall.
        """
        slow = self.trace.force - self.rest
        climb = np.max(slow - np.minimum.accumulate(slow))
        fall = np.max(np.maximum.accumulate(slow) - slow)
        return bool(fall <= MOST * self.largest and climb <= SMALL * self.largest)

    @cached_property
    def kurtosis(self) -> Feature:
        """Kurtosis of the force, and its error of white noise."""
        fourth = float(np.mean((self.rest**2) ** 2))
        value = fourth / self.scatter**4 if self.scatter else math.nan
        return Feature(value, math.sqrt(24.0 / self.rest.size))

    @cached_property
    def part(self) -> float:
        """Peak to peak of all that the window holds, over the largest force."""
        return float(np.ptp(self.trace.force)) / self.largest

    @cached_property
    def swing(self) -> Feature:
        """Peak to peak over the largest force: without drift on a bench, and that of a
        period without noise.
        """
        trace = self.trace
        force = trace.force
        if trace.measured and self.is_level:
            force = force - slope(force, trace.t) * trace.t
        swing = float(np.ptp(force))
        if self.cycles:
            # of a sine with noise of a sensor on top, peak to peak is more than the
            # sine's
            variance = max(float(force.var()) - self.found.noise**2, 0.0)
            swing = min(swing, 2.0 * math.sqrt(2.0 * variance))
        return Feature(
            swing / self.largest,
            2.0 * self.found.noise / self.largest,
        )

    @cached_property
    def ripple(self) -> float:
        """Second half, as a sawtooth, peak to peak over the largest force."""
        late = self.trace.force[self.trace.force.size // 2 :]
        return math.sqrt(12.0) * float(late.std()) / self.largest

    @cached_property
    def cycles(self) -> Cycles | None:
        """The cycles of a periodic force; drops that are even are cycles, too, on a
        level that wanders.
        """
        found = self.found
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
        """Complete cycles, or drops where there is no period."""
        return (
            self.cycles.count
            if self.cycles
            else fast_slips(self.trace, self.found).size
        )

    @cached_property
    def correlation(self) -> float:
        """Correlation of a cycle with the next."""
        if self.cycles:
            return self.cycles.correlation
        known = self.found.cycles
        return min(known.correlation, regularity(known.variation))

    @cached_property
    def loading(self) -> Loading:
        """Climb of the force to its drops, in the middle half of the waits: ringing and
        rounded peaks are at their ends.
        """
        begins = self.found.end[:-1]
        ends = self.found.start[1:]
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
        # less the median itself, whose weight may be more than half of that of a few
        away = np.abs(rates - rate)
        others = np.arange(rates.size) != np.argmin(away)
        scatter = 1.4826 * weighted_median(away[others], waits[others])
        # The noise of the sensor makes the rates scatter, too; where it hides whether
        # they are one, that is not known.
        noises = self.found.noise * np.sqrt(2.0 / (last - middle + 1)) / took
        noise = weighted_median(noises, waits)
        if noise < ONE_RATE * rate:
            scatter = max(scatter**2 - noise**2, 0.0) ** 0.5
        scatter /= rate
        gain = float(rate * waits.sum() / self.found.drops[1:][long].sum())
        return Loading(
            rate,
            scatter,
            Feature(gain, gain * scatter / waits.size**0.5),
        )

    @cached_property
    def falling_rate(self) -> float:
        """Rate at which the force falls in a typical drop."""
        clock = self.trace.clock
        took = clock[self.found.trough] - clock[self.found.peak]
        return self.found.typical(self.found.drops / took)

    @cached_property
    def seen_velocity(self) -> float:
        """Largest velocity of the slider in a typical drop over the drive's; NaN where
        it is not known, or the drop too short to show it.
        """
        found = self.found
        usual = found.typical(speeds(self.trace, found))
        samples = found.typical(found.trough - found.peak)
        lasts = found.typical(self.trace.t[found.trough] - found.times)
        resolved = samples >= FEWEST_IN_A_DROP and lasts >= self.trace.slope_window
        shown = usual >= SLIP_VELOCITY or resolved
        return usual if shown else math.nan

    @cached_property
    def slip_velocity(self) -> float:
        """Velocity of a slip over the drive's: as it is seen, or by the rates of the
        force, where it climbs at one rate between drops; else NaN.
        """
        if not math.isnan(self.seen_velocity):
            return self.seen_velocity
        known = self.climbs or self.trace.full_rate is not None
        return self.velocity_by_rates if known else math.nan

    @property
    def velocity_by_rates(self) -> float:
        """Velocity of a drop over the drive's by the rates of the force: 1 + falling
        over loading, if the slider is held between drops; that of a held slider where
        stiffness and velocity are known.
        """
        return 1.0 + self.falling_rate / (self.trace.full_rate or self.loading.rate)

    @property
    def climbs(self) -> bool:
        """Whether the force climbs to its drops, at one rate."""
        gain = self.loading.gain
        enough = gain.value - ONE_SIDED * gain.error > CLIMBS
        return enough and CLIMBS * gain.value < 1 and self.loading.scatter < ONE_RATE

    @property
    def slipping_parts(self) -> float:
        """Fraction of the quarters, or of the halves of few drops, in which typical
        drops are as fast as slips; NaN where the window is judged as a whole.
        """
        found = self.found
        count = min(found.size // FEWEST_CYCLES, 4)
        if not self.trace.measured or count < 2:
            return math.nan
        number = np.arange(found.size) * count // found.size
        parts = (replace(self, found=found.only(number == i)) for i in range(count))
        return sum(part.falls_fast or part.are_slips for part in parts) / count

    @property
    def slips_throughout(self) -> bool:
        """Whether typical drops are as fast as slips in each part of the window."""
        return not self.slipping_parts < 1.0

    @property
    def drops_of_cycles(self) -> int:
        """Number of drops that make most of the scatter, with a climb to each or after
        it.
        """
        found = self.found
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
        enough = self.cycles is not None and self.found.size >= 2 * FEWEST_CYCLES
        return mean_and_std(self.found.drops)[2] / RAYLEIGH if enough else math.nan

    @property
    def is_even(self) -> bool:
        """Whether cycles are more alike than those of noise of a narrow band."""
        return self.unevenness < EVEN

    @property
    def falls_fast(self) -> bool:
        """Whether the force falls as fast beside its climb as in slips, at whatever
        rates it climbs.
        """
        climbs = self.loading.gain.value > CLIMBS
        known = climbs and math.isnan(self.seen_velocity)
        return known and self.velocity_by_rates >= 1.0 / SLIP_PHASE

    @property
    def slip_limit(self) -> float:
        """Least velocity of slips: of the largest velocity, or of the mean."""
        return 1.0 / SLIP_PHASE if math.isnan(self.seen_velocity) else SLIP_VELOCITY

    @property
    def are_slips(self) -> bool:
        """Whether the drops are as fast as slips."""
        return self.slip_velocity >= self.slip_limit

    @property
    def reversed(self) -> Self:
        """The window with its force negated, and nothing known of the motion."""
        trace = replace(self.trace, force=-self.trace.force, velocity=None)
        return type(self).of(trace)

    @property
    def is_stick_slip(self) -> bool:
        """Whether there are enough slips."""
        return self.are_slips and self.count >= FEWEST_CYCLES

    @cached_property
    def _amplitudes(self) -> tuple[Array, Array]:
        """Logarithms of the drops of cycles, or of the scatter in eight parts, and
        when they are, in lengths of the window.
        """
        trace = self.trace
        found = self.found
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
        """Logarithm of the amplitude in the second half over the first, by a line."""
        sizes, at = self._amplitudes
        if sizes.size < FEWEST_CYCLES:
            return Feature(math.nan)
        at = at - at.mean()
        rate = slope(sizes, at)
        rest = sizes - sizes.mean() - rate * at
        square = (rest**2).sum()
        power = square / (at**2).sum() / (sizes.size - 2)
        # Alternating large and small cycles determine a mean better (Bartlett).
        turn = (rest[1:] * rest[:-1]).sum() / (square or 1.0)
        turn = min(max(turn, 1.0 / sizes.size - 1.0), 0.0)
        power *= (1.0 + turn) / (1.0 - turn)
        return Feature(0.5 * rate, 0.5 * math.sqrt(power))

    def errors(self, chance: float) -> float:
        """Return the number of standard errors of the change of the amplitude that
        chance exceeds this often, by Student: few parts show their scatter badly.
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
        """Whether a change of the amplitude by a factor 2 is excluded (by its root in
        a run without slips, which may linger where a branch has just ended), less than
        its root is seen, and the last drop is not long ago.
        """
        seen = abs(self.change.value)
        most = seen + self.errors(ONE_IN_TWENTY) * self.change.error
        may_linger = not (self.trace.measured or self.are_slips)
        excluded = most < (0.5 * LASTING if may_linger else LASTING)
        return seen < 0.5 * LASTING and excluded and not self.pause > 1.0

    @cached_property
    def pause(self) -> float:
        """Time since the last drop over the longest wait that chance makes."""
        waits = self.found.waits
        if waits.size < FEWEST_CYCLES:
            return math.nan
        return float(self.trace.t[-1] - self.found.times[-1]) / longest_wait(waits)

    @property
    def is_still(self) -> bool:
        """Whether the force neither oscillates nor slips nor grows."""
        return self.swing.value < TINY and not self.are_slips and self.trend < 1

    @cached_property
    def contact_noise(self) -> tuple[float, float]:
        """Scatter over the noise of the contacts, and how many times that is no more;
        NaN where it is not known, or the force is still: to ask theory takes long.
        """
        trace = self.trace
        count = trace.contacts
        if not count or not self.found.size or self.is_still:
            return math.nan, ERRORS
        rig = trace.rig
        if rig is not None and trace.drive is not None and not rig.drive.load:
            mean = np.mean(trace.drive) / rig.unit("velocity")
            speed = float(f"{mean:.12g}")  # rounded, so that it is asked once
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
        """Velocity of the slider off the drive's (rms), over that."""
        return rms_velocity_deviation(self.trace)

    @property
    def _tests_of_drops(self) -> tuple[Criterion, ...]:
        """The tests of drops and cycles where others have not told what they are."""
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
    def tests(self) -> tuple[Criterion, ...]:
        """The tests of a regime, except those of unknown features."""
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
        narrow = ERRORS * self.scatter / self.mean
        rows = (
            _test("drops that stand out of the noise", self.found.size, 1),
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
            _test(NOISE, *self.contact_noise, "theory"),
            _test("kurtosis of the force", self.kurtosis, NORMAL, "theory"),
            _test(
                "three standard deviations over the mean",
                narrow,
                MOST,
                "convention",
                self.is_narrow,
            ),
            _test(
                "slider velocity off the drive's (rms), over it",
                self.velocity_deviation,
                RESTS,
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
    """The window without a slow wave, or averaged over the period of a fast one, where
    it then slips, and would not if the force were negated; else as it is.
    """
    trace = seen.trace
    if trace.pace is not None or seen.swing.value < TINY or seen.is_stick_slip:
        return seen
    if (period := _fast_period(trace.force)) > 1:
        force = uniform_filter1d(trace.force, period, mode="nearest")
        calm = Window.of(replace(trace, force=force))
        hum = period * trace.step
        if _slips_one_way(calm) and calm.found.waits.mean() > FEWEST_CYCLES * hum:
            return calm
    for part in WAVES:
        width = trace.t.size // part
        if width < 2 * FEWEST_READINGS:
            break
        wave = fitted_locally(trace.force, width, 2)
        wave -= np.median(wave)
        shown = Window.of(replace(trace, force=trace.force - wave))
        found = shown.found
        if _slips_one_way(shown) and found.waits.mean() < width * trace.step / 2:
            level = wave[found.peak]
            found = replace(
                found,
                before=found.before + level,
                after=found.after + level,
            )
            return replace(shown, found=found)
    return seen


def _slips_one_way(seen: Window) -> bool:
    """Whether a force slips, and would not if it were negated."""
    return seen.is_stick_slip and not seen.reversed.is_stick_slip


def _fast_period(force: Array) -> int:
    """Period, in samples, of the strongest fast wave of a force, such as hum of the
    mains; 0 where none stands out by more than chance.

    Second differences leave little of a slow wave, and a short pulse of a drop, which
    has no line in a spectrum.
    """
    power = np.abs(fft.rfft(np.diff(force, 2))) ** 2
    over = power / np.maximum(uniform_filter1d(power, _BESIDE), 1e-300)
    line = max(int(np.argmax(over)), 1)
    # powers of noise are exponential
    stands_out = over[line] > math.log(power.size / CHANCE)
    return round(force.size / line) if stands_out else 0


def _means(trace: Trace, first: Array, last: Array) -> Array:
    """Mean times and forces from first to last samples."""
    values = np.array(
        [
            trace.clock - trace.clock[0],
            trace.force - trace.force[0],
        ]
    )
    sums = np.pad(values.cumsum(axis=1), ((0, 0), (1, 0)))
    return np.asarray((sums[:, last + 1] - sums[:, first]) / (last + 1 - first))


def longest_wait(waits: Array) -> float:
    """Return the longest of these waits by chance, by the tail of an exponential of
    their scatter; at least that of a missing drop.
    """
    usual = weighted_median(waits, waits)
    # the longest may be the pause that is asked for
    others = np.sort(waits)[:-1]
    scatter = min(float(others.std() / others.mean()), 1.0)
    return usual * max(MISSING, 1.0 + scatter * math.log(waits.size / ONE_IN_TWENTY))


@lru_cache(maxsize=256)
def noise_of(interface: Interface, slider: Any, velocity: float) -> float | None:
    """Standard deviation of the force of smooth sliding over ``1/sqrt(N)``: NaN if
    unstable, None if not known.
    """
    try:
        rig = Rig(interface, slider, constant(velocity))
        if count_unstable(rig):
            return math.nan
        return contact_noise(rig, contacts=1).spring_force
    except (InputError, UndecidedError):
        return None
