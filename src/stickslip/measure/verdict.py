"""The regime of motion under a constant drive."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from stickslip import words
from stickslip.answers import Answer
from stickslip.errors import InputError, number
from stickslip.measure.arrays import CONSTANT_DRIVE, FEWEST_READINGS, Array, Trace, in_words, slope, without_line
from stickslip.measure.bench import about_the_sensor, find_strokes, is_mirrored
from stickslip.measure.periods import FEWEST_CYCLES
from stickslip.measure.slips import (
    FEWEST_IN_A_DROP,
    MORE_THAN_NOISE,
    SLIP_VELOCITY,
    Slips,
    contact_noise,
    find_slips,
    is_normal,
    is_white,
    mean_and_std,
    speeds,
)
from stickslip.simulation import Recording
from stickslip.words import prefixed

if TYPE_CHECKING:
    import xarray as xr

Kind = Literal["smooth sliding", "stick-slip", "sustained oscillation", "undecided"]

# Numbers that decide. Each sits in a gap between the classes it parts, at N from 100 to 10 000: tests/test_measure.py.
LATE_PART = 0.4  # the last part of a run, in which its regime is judged
SLIP_PHASE = 0.25  # where only the force is known: slips take this part of the time or less
LONG_TRANSIENT = 50  # cycles: 40 to 100 x_s, in the model
STEADY = 0.05  # change of ln(drop) from the first half of the window to the second, beyond three standard errors
TINY = 0.02  # an oscillation below this part of static friction is smooth sliding
SMALL = 0.10  # ... and one that decays, below this
MOST_NOISE = 0.6  # irregular fluctuation below this part of static friction may be noise, if it is distributed so
DRIFTS = 0.5  # a straight line through the force that takes more of its range than this is no noise about a mean
MOST_STROKES = 0.75  # part of the strokes that must agree
STUCK, STICKS = 0.05, 0.1  # a slider slower than this many times the drive sticks; part of the time for which it must


@dataclass(frozen=True, kw_only=True, repr=False)
class Regime(Answer):
    """The regime of motion in a stretch of constant driving, with the evidence; it equals its own `kind`.

    Attributes
    ----------
    kind : {"smooth sliding", "stick-slip", "sustained oscillation", "undecided"}
        *Stick-slip*: slow loading and fast slips that persist; in a typical cycle the slider reaches at least
        3.5 times the velocity of the drive (where only the force is known: slips take at most a quarter of the
        time). The slips may be irregular; `period_variation` says how much. *Sustained oscillation*: a cycle
        that persists, in which the slider stays slower than that; the reason says whether it sticks. *Smooth
        sliding*: no oscillation, or noise of the contacts, or an oscillation below 2 % of the largest force, or
        one that decays and is below 10 %. *Undecided*: the evidence does not suffice, for the reason given,
        which says what would decide it.
    reason : str
        Why, in plain words.
    window : tuple of float
        Start and end of the stretch that was evaluated, in the unit of `t`.
    peak_to_peak, mean_force : float
        Of the force of the driving spring in the window.
    static_friction : float
        Largest force in all of the data: what amplitudes are compared with.
    trend : float
        Ratio of the drops in the second half of the window to those in the first, from a straight line
        through their logarithms (of the standard deviation of the force where there are too few cycles); 1 is
        steady.
    trend_error : float
        Standard error of ``ln(trend)``; NaN where it is not known.
    cycles : int
        Complete cycles in the window; of a force that is not periodic, complete drops.
    period, period_variation : float
        Mean time of a cycle, and its coefficient of variation; NaN with too few cycles.
    correlation : float
        Autocorrelation of the force at one period: 1 for what repeats, near 0 for noise.
    drop, drop_variation : float
        Mean force drop, and its coefficient of variation.
    slip_phase : float
        Fraction of the time in which the force drops: .5 for a sine, near 0 for a sawtooth.
    noise : float
        Standard deviation of the noise from sample to sample, in the unit of the force.
    drive_velocity : float or None
        Mean velocity of the drive in the window; None where it is not known.
    peak_velocity : float or None
        Largest slider velocity in a typical (median) cycle, over the drive's velocity.
    largest_velocity : float or None
        Largest slider velocity in the window, over the drive's velocity.
    stuck : float or None
        Fraction of the time in which the slider is slower than a twentieth of the drive.
    attached_peak_to_peak : float or None
        Largest less smallest fraction of attached contacts.
    mean_mu, static_mu : float or None
        With a normal load: the coefficient of friction, on average in the window and at most in all of the data.
    quantity, time_unit, force_unit : str
        What the force is ("force" or "coefficient of friction"), and the units of the times and forces above;
        empty where the data do not say.
    notes : tuple of str
        What a reader should know of the data: a saturated or mirrored sensor, strokes that go to and fro.
    """

    kind: Kind
    reason: str
    window: tuple[float, float]
    peak_to_peak: float
    mean_force: float
    static_friction: float
    trend: float
    trend_error: float
    cycles: int
    period: float
    period_variation: float
    correlation: float
    drop: float
    drop_variation: float
    slip_phase: float
    noise: float
    drive_velocity: float | None = None
    peak_velocity: float | None = None
    largest_velocity: float | None = None
    stuck: float | None = None
    attached_peak_to_peak: float | None = None
    mean_mu: float | None = None
    static_mu: float | None = None
    quantity: str = "force"
    time_unit: str = ""
    force_unit: str = ""
    notes: tuple[str, ...] = ()

    @property
    def drops_are(self) -> Literal["slips", "cycles", "drops"]:
        """What the drops of the force are: slips, or cycles of an oscillation without sticking, or just drops."""
        if self.kind == "sustained oscillation":
            return "slips" if self.stuck is not None and self.stuck >= STICKS else "cycles"
        return "slips" if self.kind == "stick-slip" else "drops"

    def __eq__(self, other: object) -> bool:
        if isinstance(other, str):
            return self.kind == other
        if not isinstance(other, Regime):
            return NotImplemented
        return repr(vars(self)) == repr(vars(other))  # NaN equals NaN

    def __hash__(self) -> int:
        return hash(self.kind)

    def __str__(self) -> str:
        begin, end = self.window
        divisor, unit = prefixed(end, self.time_unit)

        def force(value: float, digits: int) -> str:
            return in_words(value, self.force_unit, digits)

        lines = [
            f"{self.kind}: {self.reason}",
            f"evaluated over t = {words.number(begin / divisor)} to {in_words(end / divisor, unit)}; {self.quantity} "
            f"{force(self.mean_force, 4)} on average, peak to peak {force(self.peak_to_peak, 3)}, noise "
            f"{force(self.noise, 2)}",
        ]
        if self.mean_mu is not None and self.static_mu is not None:
            lines.append(
                f"coefficient of friction {words.number(self.mean_mu, 3)} on average (kinetic), "
                f"{words.number(self.static_mu, 3)} at most (static)"
            )
        if self.cycles:
            line = f"{self.cycles} cycle{'s' * (self.cycles > 1)} in this window, drop {force(self.drop, 3)}"
            line += _variation(self.drop_variation)
            if math.isfinite(self.period):
                line += f", period {in_words(self.period, self.time_unit)}{_variation(self.period_variation)}"
            if math.isfinite(self.slip_phase):
                line += f", slip phase: {100 * self.slip_phase:.0f} % of the cycle"
            lines.append(line)
        if math.isfinite(self.trend):
            lines.append(f"amplitude, second half of the window over the first: {self.trend:.3g}")
        if self.largest_velocity is not None:
            lines.append(f"largest velocity {self.largest_velocity:.3g} times the drive's")
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])


def _variation(value: float) -> str:
    return f" (CV {value:.2g})" if math.isfinite(value) else ""


def regime(data: xr.Dataset, *, after: float | None = None) -> Regime:
    """Return the regime of motion under a constant drive, with the evidence; "undecided" where that does not suffice.

    The verdict is about the window judged. Transients can last very long near a boundary between regimes: an
    oscillation that still grows or shrinks there by more than 5 to 10 % from one half of the window to the other is
    undecided.

    Parameters
    ----------
    data : Dataset
        A run or a measured trace.
    after : float, optional
        Judge what comes after this time, in the unit of `t`. By default the last 40 % of the last stretch of
        constant driving, or the last 80 % if the last 40 % hold fewer than five drops; for a trace of the
        force alone, everything after the first loading. The strokes of a test that goes to and fro are judged
        apart.

    Returns
    -------
    Regime
        What the kinds mean is told there.

    Raises
    ------
    InputError
        If the data hold no force, or values that are not finite, or nothing lies after `after`.
    """
    return with_coefficient(over_the_window(Trace.of(data), after), data)


def with_coefficient(seen: Regime, data: xr.Dataset) -> Regime:
    """Add the coefficient of friction where the data hold one; its size, as it changes sign with the direction."""
    if "mu" not in data or data["mu"].dims != ("time",):
        return seen
    size = abs(data["mu"])
    inside = size.sel(time=slice(*seen.window))
    return replace(seen, mean_mu=float(inside.mean()), static_mu=float(size.max()))


def regime_of(run: Recording) -> Regime:
    """Return the regime of a run that has not become a Dataset; the same as of the Dataset."""
    return over_the_window(Trace.of_recording(run), None)


def over_the_window(trace: Trace, after: float | None) -> Regime:
    """Choose the window, and judge it; of a test that goes to and fro, its strokes."""
    if after is not None:
        trace = since(trace, after)
    if trace.drive is None:
        trace, missing = _without_gaps(trace)
        strokes = find_strokes(trace)
        window = trace if after is not None else _loaded(trace)
        seen = _of_strokes(strokes) if strokes else _judge(window)
        drifts = () if strokes or seen.kind == "undecided" else _about_drift(window)
        return replace(seen, notes=(*seen.notes, *missing, *drifts, *about_the_sensor(trace.force)))
    if after is not None:
        return _judge(trace)
    steady = _constant_drive(trace)
    if steady is None:
        return _judge(trace)
    begin, end = trace.t[steady], trace.t[-1]
    late = trace.part(end - LATE_PART * (end - begin))
    found = find_slips(late) if late.t.size >= FEWEST_READINGS else None
    if found is None or found.size <= FEWEST_CYCLES:
        longer = trace.part(end - 2 * LATE_PART * (end - begin))
        if found is None:
            late = longer
        elif found.size and (more := find_slips(longer)).size > found.size:
            late, found = longer, more
    return _with_caution(_judge(late, found), end - begin)


def _without_gaps(trace: Trace) -> tuple[Trace, tuple[str, ...]]:
    """Return the longest stretch that was recorded without a gap, and what to say of the gaps."""
    gaps = trace.gaps
    if not gaps.size:
        return trace, ()
    edges = itertools.pairwise([0, *(gaps + 1).tolist(), trace.t.size])
    begin, end = max(
        edges,
        key=lambda edge: trace.t[edge[1] - 1] - trace.t[edge[0]] if edge[1] - edge[0] >= FEWEST_READINGS else -1.0,
    )
    first, unit = int(gaps[0]), f" {trace.time_unit}".rstrip()
    told = f"no readings from t = {words.number(trace.t[first])} to {words.number(trace.t[first + 1])}{unit}"
    more = f", and {gaps.size - 1} more gaps" if gaps.size > 1 else ""
    if end - begin < FEWEST_READINGS:
        return trace, (f"{told}{more}",)
    longest = trace.part(float(trace.t[begin]), float(np.nextafter(trace.t[end - 1], math.inf)))
    return longest, (f"{told}{more}: the longest stretch without a gap was judged",)


def _about_drift(trace: Trace) -> tuple[str, ...]:
    """Say how fast a force drifts, if a straight line makes most of its range."""
    rate = slope(trace.force, trace.t)
    if abs(rate) * (trace.t[-1] - trace.t[0]) <= DRIFTS * float(np.ptp(trace.force)):
        return ()
    unit = f"{trace.force_unit.removesuffix('1')}/{trace.time_unit}".rstrip("/")
    return (f"the force drifts by {words.number(trace.sign * rate, 3)} {unit}".rstrip(),)


def since(trace: Trace, after: float) -> Trace:
    """What comes after a time; `InputError` if that is next to nothing."""
    begin = number("after", after, hint="a time, in the unit of t")
    late = trace.part(begin)
    if late.t.size < FEWEST_READINGS:
        raise InputError(
            f"after = {begin:g}: fewer than {FEWEST_READINGS} samples lie after it; the data end at t = {trace.t[-1]:g}"
        )
    return late


def _of_strokes(strokes: list[Trace]) -> Regime:
    """Judge each stroke by itself, and sum up."""
    seen = [_judge(stroke) for stroke in strokes]
    count = Counter(each.kind for each in seen)
    decided = [kind for kind, _ in count.most_common() if kind != "undecided"]
    usual: Kind = decided[0] if decided else "undecided"
    typical = next(each for each in seen if each.kind == usual)
    told = ", ".join(f"{many} {kind}" for kind, many in count.most_common())
    reason = f"reciprocating test, {len(seen)} strokes judged separately ({told}); {typical.reason}"
    kind: Kind = typical.kind
    if count[kind] < MOST_STROKES * len(seen):
        kind, reason = "undecided", f"{reason}; judge a part of the strokes"
    whole = (strokes[0].t[0], strokes[-1].t[-1])
    return replace(typical, kind=kind, reason=reason, window=(float(whole[0]), float(whole[1])))


def _with_caution(result: Regime, elapsed: float) -> Regime:
    """Say so where an oscillation has had less time than a transient can take."""
    if result.kind not in ("stick-slip", "sustained oscillation") or not elapsed < LONG_TRANSIENT * result.period:
        return result
    caution = f"seen for {elapsed / result.period:.0f} cycles only; run longer to rule out a transient"
    return replace(result, reason=f"{result.reason} ({caution})")


def _constant_drive(trace: Trace) -> int | None:
    """Index at which the last stretch of constant driving starts; None if the drive changes up to the end."""
    if trace.drive is None:
        return 0
    last = trace.drive[-1]
    differs = np.flatnonzero(np.abs(trace.drive - last) > CONSTANT_DRIVE * abs(last))
    first = int(differs[-1]) + 1 if differs.size else 0
    return first if trace.t.size - first >= max(FEWEST_READINGS, 0.05 * trace.t.size) else None


def _loaded(trace: Trace) -> Trace:
    """What comes once the force has first reached its usual level."""
    usual = float(np.median(trace.force[trace.force.size // 2 :]))
    loaded = trace.part(float(trace.t[int(np.argmax(trace.force >= usual))]))
    return loaded if loaded.t.size >= FEWEST_READINGS else trace


def _judge(trace: Trace, found: Slips | None = None) -> Regime:
    """Weigh the evidence in a window, whose slips may have been found before."""
    t, force = trace.t, trace.force
    found = find_slips(trace) if found is None else found
    cycles = found.cycles
    drop, _, drop_variation = mean_and_std(found.drops)
    size, at = found.drops, found.times
    count, (period, _, variation) = found.size, mean_and_std(np.diff(found.times))
    if cycles.periodic and found.size:
        count, period, variation = cycles.count, cycles.period, cycles.variation
        if found.size != count:  # some cycles have several drops: their sizes tell no trend
            size, at = _of_each_cycle(force, cycles.begins, np.ptp), cycles.times[:-1]
    trend, trend_error = _trend(trace, at, size)
    drive = None if trace.drive is None else float(trace.drive.mean())
    peak_velocity = largest = stuck = None
    if trace.velocity is not None and drive:
        peak_velocity = largest = float(trace.velocity.max()) / drive
        stuck = float(np.mean(np.abs(trace.velocity) < STUCK * abs(drive)))
        fastest = speeds(trace, found)
        if cycles.periodic:
            peak_velocity = float(np.median(_of_each_cycle(trace.velocity, cycles.begins, np.max))) / drive
        elif fastest is not None:
            peak_velocity = float(np.median(fastest))
    evidence = Regime(
        kind="undecided",
        reason="",
        window=(float(t[0]), float(t[-1])),
        peak_to_peak=float(np.ptp(force)),
        mean_force=trace.sign * float(force.mean()),
        static_friction=abs(trace.largest),
        trend=trend,
        trend_error=trend_error,
        cycles=count,
        period=period,
        period_variation=variation,
        correlation=cycles.correlation,
        drop=drop,
        drop_variation=drop_variation,
        slip_phase=found.slip_phase(trace),
        noise=found.noise,
        drive_velocity=None if drive is None else trace.sign * drive,
        peak_velocity=peak_velocity,
        largest_velocity=largest,
        stuck=stuck,
        attached_peak_to_peak=None if trace.attached is None else float(np.ptp(trace.attached)),
        quantity=trace.quantity,
        time_unit=trace.time_unit,
        force_unit=trace.force_unit,
    )
    kind, reason = _verdict(trace, found, evidence)
    return replace(evidence, kind=kind, reason=reason)


def _of_each_cycle(values: Array, begins: NDArray[np.intp], measure: Callable[[Array], float]) -> Array:
    return np.array([measure(values[i : j + 1]) for i, j in itertools.pairwise(begins.tolist())], dtype=float)


def _trend(trace: Trace, times: Array, drops: Array) -> tuple[float, float]:
    """Drops in the second half of the window over those in the first, and the standard error of its logarithm."""
    span = trace.t[-1] - trace.t[0]
    if drops.size >= FEWEST_CYCLES and bool(np.all(drops > 0)):
        at = (times - times.mean()) / span
        size = np.log(drops)
        slope = float(at @ size / (at @ at))
        rest = size - size.mean() - slope * at
        power = float(rest @ rest)
        # Slow wandering of the drops (few contacts, or a boundary near by) makes them worth fewer independent ones.
        memory = min(max(float(rest[1:] @ rest[:-1]) / power, 0.0), 0.9) if power > 0 else 0.0
        error = math.sqrt(power / (drops.size - 2) / float(at @ at) * (1 + memory) / (1 - memory))
        return math.exp(0.5 * slope), 0.5 * error
    return _halves(trace), math.nan


def _halves(trace: Trace) -> float:
    """Standard deviation of the force in the second half of the window over that in the first."""
    half = trace.force.size // 2
    first, second = float(trace.force[:half].std()), float(trace.force[half:].std())
    return second / first if first > 0 else math.nan


def _verdict(trace: Trace, found: Slips, seen: Regime) -> tuple[Kind, str]:
    """Kind and reason; `seen` is the evidence."""
    objection = _about_the_drive(trace)
    if objection:
        return "undecided", objection
    if trace.drive is None and is_mirrored(trace, found):
        return "undecided", (
            "the force rises in jumps and falls slowly: the sensor's sign seems to be reversed; turn it (--flip on "
            "the command line, flip=True in read_trace)"
        )
    if found.size == 0:
        return _without_drops(trace, found, seen)
    oscillation = f"{100 * seen.peak_to_peak / seen.static_friction:.3g} % of the largest force"
    # Samples that step over a slip miss its velocity; the time that drops take is then a safer witness.
    coarse = float(np.median(found.trough - found.peak)) < FEWEST_IN_A_DROP
    if seen.peak_velocity is not None and (seen.peak_velocity >= SLIP_VELOCITY or not coarse):
        slips = seen.peak_velocity >= SLIP_VELOCITY
        how = f"the slider reaches {seen.peak_velocity:.3g} times the velocity of the drive in a typical cycle"
    else:
        slips = seen.slip_phase <= SLIP_PHASE
        how = f"slip phase: {100 * seen.slip_phase:.0f} % of the cycle"
    if seen.cycles < FEWEST_CYCLES:
        return _too_few(trace, found, seen, slips, oscillation)
    change, allowed = math.log(seen.trend), STEADY + 3.0 * seen.trend_error
    if found.periodic:  # regular cycles tell their trend at once; a large error is no leave to drift
        allowed = min(allowed, 2.0 * STEADY)
    if change < -allowed:
        return _decaying(trace, seen, slips)
    if seen.peak_to_peak >= TINY * seen.static_friction and (stopped := _stopped(trace, found)):
        return "undecided", stopped
    if slips and (found.periodic or seen.slip_phase <= SLIP_PHASE):
        manner = "periodic" if found.periodic else "irregular"
        growth = "; the slips still grow" if change > allowed else ""
        return "stick-slip", f"{manner} slips that persist: {how}{growth}"
    if change > allowed:
        span = trace.t[-1] - trace.t[0]
        return "undecided", (
            f"the oscillation still grows, by a factor {seen.trend:.2g} between the halves of the window; about "
            f"{trace.time_in_words(2.0 * span)} more would tell"
        )
    # Of a sine with noise of a sensor on top, peak to peak is more than the sine's.
    swing = 2.0 * math.sqrt(2.0 * max(float(np.var(without_line(trace.force, trace.t))) - found.noise**2, 0.0))
    if seen.peak_to_peak < TINY * seen.static_friction or (found.periodic and swing < TINY * seen.static_friction):
        size = min(swing, seen.peak_to_peak) / seen.static_friction
        return "smooth sliding", f"the force oscillates by {100 * size:.3g} % of the largest force, peak to peak"
    if coarse:
        return "undecided", f"drops of {oscillation} last fewer than {FEWEST_IN_A_DROP} samples: record more often"
    if not found.periodic and _halves(trace) < 1.0 - 3.0 * STEADY:
        return _decaying(trace, replace(seen, trend=_halves(trace)), slips)
    if found.periodic or contact_noise(trace) < math.inf:
        manner = "periodic" if found.periodic else "irregular"
        return "sustained oscillation", f"{manner}, {oscillation}, peak to peak; {_whether_it_sticks(seen)}: {how}"
    if seen.peak_to_peak < MOST_NOISE * seen.static_friction and is_normal(trace.force):
        return "smooth sliding", f"the force fluctuates by {oscillation}, without a period, as noise does"
    or_else = ", or the velocity of the slider," if seen.peak_velocity is None else ""
    return "undecided", (
        f"irregular oscillation of {oscillation} that is neither slips nor small: {how}; about "
        f"{trace.time_in_words(4.0 * (trace.t[-1] - trace.t[0]))} more{or_else} would tell"
    )


def _stopped(trace: Trace, found: Slips) -> str:
    """Say when the slips stopped, if they did: time enough has passed since the last for one, at three standard errors.

    Times between slips are taken to follow a gamma distribution: even ones at a small variation, random ones at 1.
    """
    from scipy.special import gammainccinv

    mean, _, variation = mean_and_std(np.diff(found.times))
    shape = 1.0 / max(variation, 0.01) ** 2
    last = float(trace.t[found.end[-1]])
    if not trace.t[-1] - found.times[-1] > mean * max(2.0, float(gammainccinv(shape, 0.00135)) / shape):
        return ""
    rest = trace.part(last)
    then = _judge(rest).kind if rest.t.size >= FEWEST_READINGS else "undecided"
    return (
        f"slips every {trace.time_in_words(mean)} up to t = {trace.time_in_words(last)}, then "
        f"{'none' if then == 'undecided' else then}: judge each part by itself"
    )


def _whether_it_sticks(seen: Regime) -> str:
    if seen.stuck is None:
        return "whether the slider sticks, the force alone does not tell"
    if seen.stuck < STICKS:
        return "the slider never sticks"
    return f"the slider sticks for {100 * seen.stuck:.0f} % of the time"


def _too_few(trace: Trace, found: Slips, seen: Regime, slips: bool, oscillation: str) -> tuple[Kind, str]:
    """Verdict on fewer cycles than make one."""
    if not slips and seen.peak_to_peak < TINY * seen.static_friction:
        return "smooth sliding", f"the force oscillates by {oscillation}, peak to peak"
    span = float(trace.t[-1] - trace.t[0])
    each = seen.period if math.isfinite(seen.period) else span / max(found.size, 1)
    few = f"{seen.cycles} complete drop{'s' if seen.cycles > 1 else ''} of the force"
    return "undecided", (
        f"too short: {few} in the window; a verdict needs {FEWEST_CYCLES}: about "
        f"{trace.time_in_words(max((FEWEST_CYCLES + 1) * each - span, each))} more"
    )


def _decaying(trace: Trace, seen: Regime, slips: bool) -> tuple[Kind, str]:
    """Verdict on an oscillation that shrinks."""
    second = float(np.ptp(trace.force[trace.force.size // 2 :]))
    shrinks = f"the oscillation decays, by a factor {seen.trend:.2g} from one half of the window to the other"
    part = second / seen.static_friction
    if not slips and part < SMALL:
        return "smooth sliding", f"{shrinks}, and is down to {100 * part:.3g} % of the largest force"
    halves = math.log(SMALL / max(part, 1.1 * SMALL)) / math.log(seen.trend)
    more = 0.5 * max(halves, 1.0) * float(trace.t[-1] - trace.t[0])
    return "undecided", f"{shrinks}; about {trace.time_in_words(more)} more would tell whether it persists"


def _about_the_drive(trace: Trace) -> str:
    """What forbids a verdict, or nothing."""
    if trace.drive is None:
        return ""
    low, high = float(trace.drive.min()), float(trace.drive.max())
    if high == low == 0.0:
        return "the drive stands still"
    if high - low > 2.0 * CONSTANT_DRIVE * max(abs(low), abs(high)):
        return (
            "the velocity of the drive changes along it; the regime is judged at constant velocity: use transitions(), "
            "or select a stretch with data.sel(time=slice(from, to))"
        )
    return ""


def _without_drops(trace: Trace, found: Slips, seen: Regime) -> tuple[Kind, str]:
    """Verdict where no drop of the force stands out."""
    friction, oscillation = seen.static_friction, seen.peak_to_peak
    span = float(trace.t[-1] - trace.t[0])
    if oscillation == 0.0 and trace.drive is None:
        return "undecided", "the force never changes: is the sensor connected?"
    part = f"{100 * oscillation / friction:.3g} % of the largest force" if friction else "a force of 0"
    if oscillation < TINY * friction:
        return "smooth sliding", f"the force fluctuates by {part}"
    drift = slope(trace.force, trace.t) * span
    if abs(drift) > DRIFTS * oscillation and abs(drift) > 2.0 * found.smallest:
        way = "rises" if drift > 0 else "falls"
        return "undecided", (
            f"the force still {way}, by {trace.force_in_words(abs(drift))} in the window, and shows no complete slip; "
            f"about {trace.time_in_words(4.0 * span)} more would tell"
        )
    if found.dismissed:
        relative = f"the force fluctuates by {part}, without a period"
        second = float(np.ptp(trace.force[trace.force.size // 2 :]))
        of_contacts = contact_noise(trace) < MORE_THAN_NOISE
        if not of_contacts and (oscillation > MOST_NOISE * friction or not is_normal(trace.force)):
            return "undecided", (
                f"{relative}: too much for noise, and no slips that stand out; "
                f"about {trace.time_in_words(4.0 * span)} more would tell"
            )
        if seen.trend > 3 or (seen.trend < 1 / 3 and second > SMALL * friction):
            return "undecided", (
                f"{relative}, and changes by a factor {seen.trend:.2g} between the halves of the window; about "
                f"{trace.time_in_words(2.0 * span)} more would tell"
            )
        if not of_contacts:
            return "smooth sliding", f"{relative}, as slow noise does"
        if oscillation > MOST_NOISE * friction:
            return "sustained oscillation", (
                f"irregular, {part}, peak to peak, as expected from the noise of {trace.contacts} contacts; "
                f"{_whether_it_sticks(seen)}"
            )
        return "smooth sliding", f"{relative}: no more than the noise of {trace.contacts} contacts"
    if oscillation > max(2.0 * found.smallest, SMALL * friction) and not is_white(trace, found.noise, found.cycles):
        return "undecided", (
            "too short: the force oscillates, but shows no complete drop in the window; about "
            f"{trace.time_in_words(4.0 * span)} more would tell"
        )
    # Slips of a drop D, seen once a cycle or less, scatter by D/sqrt(12) and look like white noise.
    scatter = float(without_line(trace.force, trace.t).std())
    if scatter > SMALL / math.sqrt(12.0) * friction:
        return "undecided", (
            f"noise of {part} from one sample to the next masks any oscillation, and slips: record more often"
        )
    return "smooth sliding", f"the force shows noise only, {part}"
