"""The regime of motion under a constant drive."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from stickslip import words
from stickslip.answers import Answer
from stickslip.errors import InputError, number
from stickslip.measure.arrays import CONSTANT_DRIVE, FEWEST_READINGS, Trace, in_words, slope, without_line
from stickslip.measure.bench import about_the_sensor, find_strokes, is_mirrored
from stickslip.measure.evidence import ENOUGH, ERRORS, SMALL, STEADY, TINY, Criterion, Evidence, gather
from stickslip.measure.periods import FEWEST_CYCLES
from stickslip.measure.slips import FEWEST_IN_A_DROP, Slips, fast_ones, find_slips, is_white, mean_and_std
from stickslip.simulation import Recording
from stickslip.words import prefixed

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["TINY", "Kind", "Regime", "regime", "regime_of"]

Kind = Literal["smooth sliding", "stick-slip", "sustained oscillation", "undecided"]

LATE_PART = 0.4  # the last part of a run, in which its regime is judged
LONG_TRANSIENT = 50  # cycles: 40 to 100 x_s, in the model
DRIFTS = 0.5  # a straight line through the force that takes more of its range than this is no noise about a mean
MOST_STROKES = 0.75  # part of the strokes that must agree
STUCK, STICKS = 0.05, 0.1  # a slider slower than this many times the drive sticks; part of the time for which it must
_DEEPEST = 3  # how often a part of a record is parted again


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A part of a record in one regime, from `begin` to `end` in its unit of time."""

    kind: Kind
    begin: float
    end: float


@dataclass(frozen=True, kw_only=True, repr=False)
class Regime(Answer):
    """The regime of motion in a stretch of constant driving, with the evidence; it equals its own `kind`.

    Attributes
    ----------
    kind : {"smooth sliding", "stick-slip", "sustained oscillation", "undecided"}
        *Stick-slip*: slow loading and fast slips that persist; in a typical cycle the slider reaches at least
        3.5 times the velocity of the drive. Where only the force is known: drops take at most a quarter of the
        time, or, of an irregular force, it rises at its full rate for most of the time. The slips may be irregular;
        `period_variation` says how much. *Sustained oscillation*: a cycle that persists, in which the slider stays
        slower than that; the reason says whether it sticks. *Smooth sliding*: no oscillation, or noise of the
        contacts, or fluctuation without a period that is distributed as noise, or an oscillation below 2 % of the
        largest force, or one that decays and is below 10 %. *Undecided*: the evidence does not suffice, for the
        reason given, which says what would decide it, or the parts of the record differ.
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
        through their logarithms (of the standard deviation of the force in parts of the window, where it has
        neither slips nor a period); 1 is steady.
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
    table : tuple of Criterion
        The tests that kind and reason are read off: each with its statistic, its limit, where that comes from
        (theory, statistics, or a convention), and whether it was passed.
    segments : tuple of Segment
        The parts of a record that is in one regime and then in another; empty where it is in one.
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
    table: tuple[Criterion, ...] = ()
    segments: tuple[Segment, ...] = ()

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


def _judge(trace: Trace, found: Slips | None = None, depth: int = 0) -> Regime:
    """Weigh the evidence in a window, whose drops may have been found before."""
    found = find_slips(trace) if found is None else found
    seen = gather(trace, found)
    kind, reason, segments = _verdict(trace, seen, depth)
    slips = fast_ones(trace, found) if kind == "stick-slip" else found
    drop, _, drop_variation = mean_and_std(slips.drops)
    count, (period, _, variation) = slips.size, mean_and_std(np.diff(slips.times))
    if seen.periodic and kind != "smooth sliding":
        count, period, variation = seen.cycles.count, seen.cycles.period, seen.cycles.variation
    drive = None if trace.drive is None else float(trace.drive.mean())
    largest = float(trace.velocity.max()) / drive if trace.velocity is not None and drive else None
    return Regime(
        kind=kind,
        reason=reason,
        window=(float(trace.t[0]), float(trace.t[-1])),
        peak_to_peak=seen.peak_to_peak,
        mean_force=trace.sign * float(trace.force.mean()),
        static_friction=seen.friction,
        trend=seen.trend,
        trend_error=seen.trend_error,
        cycles=count,
        period=period,
        period_variation=variation,
        correlation=seen.cycles.correlation,
        drop=drop,
        drop_variation=drop_variation,
        slip_phase=slips.slip_phase(trace),
        noise=found.noise,
        drive_velocity=None if drive is None else trace.sign * drive,
        peak_velocity=seen.value("fast") if "fast" in seen.tests else largest,
        largest_velocity=largest,
        stuck=_stuck(trace),
        attached_peak_to_peak=None if trace.attached is None else float(np.ptp(trace.attached)),
        quantity=trace.quantity,
        time_unit=trace.time_unit,
        force_unit=trace.force_unit,
        table=tuple(seen.tests.values()),
        segments=segments,
    )


def _stuck(trace: Trace) -> float | None:
    """Part of the time in which the slider sticks."""
    if trace.velocity is None or trace.drive is None or not trace.drive.mean():
        return None
    return float(np.mean(np.abs(trace.velocity) < STUCK * abs(float(trace.drive.mean()))))


def _verdict(trace: Trace, seen: Evidence, depth: int) -> tuple[Kind, str, tuple[Segment, ...]]:
    """Kind, reason and parts, off the tests: the first rule that holds decides."""
    if told := _about_the_drive(trace) or _about_the_sign(trace, seen.found):
        return "undecided", told, ()
    if not seen.found.size:
        return *_without_drops(trace, seen), ()
    part, of_contacts = _part(seen.peak_to_peak, seen), "contacts" in seen.tests
    tiny = f"the force oscillates by {_part(seen.swing, seen)}, peak to peak"
    noise = f"{seen.count} cycles of {part}, peak to peak, that noise may make as well; "
    noise += _more(trace, max(ENOUGH / max(seen.count, 1), 2.0))
    if seen.fails("cycles"):
        if not seen.slips and not seen.passes("size"):
            return "smooth sliding", tiny, ()
        return "undecided", _still_loading(trace, seen) or _too_few(trace, seen), ()
    if seen.fails("contacts"):
        if seen.passes("normal") or not seen.periodic:
            return *_noise_of_contacts(trace, seen, part), ()
        if seen.fails("enough"):
            return "undecided", noise, ()
    if depth < _DEEPEST and (seen.slips or seen.periodic) and (parts := _in_parts(trace, seen, depth)):
        return parts
    if seen.passes("shrinks"):
        return *_decaying(trace, seen), ()
    manner = "periodic" if seen.periodic else "irregular"
    if seen.slips:
        growth = "; the slips still grow" if seen.passes("grows") else ""
        return "stick-slip", f"{manner} slips that persist: {_how(seen)}{growth}", ()
    if seen.passes("grows"):
        return "undecided", _growing(trace, seen, part), ()
    if not seen.passes("size"):
        return "smooth sliding", tiny, ()
    if seen.fails("resolved"):
        return "undecided", f"drops of {part} last fewer than {FEWEST_IN_A_DROP} samples: record more often", ()
    if trace.velocity is None and seen.passes("normal") and (seen.periodic or of_contacts):
        return "undecided", noise, ()
    if seen.periodic or of_contacts:
        how = f"{manner}, {part}, peak to peak; {_whether_it_sticks(trace)}: {_how(seen)}"
        return "sustained oscillation", how, ()
    if seen.passes("normal") and seen.passes("slight"):
        return "smooth sliding", f"the force fluctuates by {part}, without a period, as slow noise does", ()
    why = f"irregular oscillation of {part} that is neither slips nor noise: {_how(seen)}"
    if seen.fails("slight"):
        why = f"the force fluctuates by {part}, without a period: too much for noise, and no slips that stand out"
    or_else = ", or the velocity of the slider," if trace.velocity is None else ""
    return "undecided", f"{why}; {_more(trace, 4.0, or_else)}", ()


def _part(force: float, seen: Evidence) -> str:
    return f"{100 * force / seen.friction:.3g} % of the largest force" if seen.friction else "a force of 0"


def _more(trace: Trace, spans: float, or_else: str = "", what: str = "") -> str:
    """How much longer a record would decide, in its own length."""
    return f"about {trace.time_in_words(spans * float(np.ptp(trace.t)))} more{or_else} would tell{what}"


def _how(seen: Evidence) -> str:
    """The test that parts slips from an oscillation, in words."""
    if seen.passes("fast") or ("fast" in seen.tests and seen.passes("resolved")):
        return f"the slider reaches {seen.value('fast'):.3g} times the velocity of the drive in a typical cycle"
    if seen.passes("phase") or seen.periodic or "held" not in seen.tests:
        return f"slip phase: {100 * seen.value('phase'):.0f} % of the cycle"
    return f"the force rises at its full rate for {100 * seen.value('held'):.0f} % of the time"


def _in_parts(trace: Trace, seen: Evidence, depth: int) -> tuple[Kind, str, tuple[Segment, ...]] | None:
    """Judge a record with a pause, or with a step of its drops, part by part; None if it is of one kind, and even."""
    found, step, paused = seen.found, 0, seen.passes("paused")
    if paused:
        limits = np.concatenate([[trace.t[0]], found.times, [trace.t[-1]]])
        longest = int(np.argmax(np.diff(limits)))
        begin = float(trace.t[found.end[longest - 1]]) if longest else float(trace.t[0])
        end, usual = limits[longest + 1], (limits[longest + 1] - limits[longest]) / seen.value("paused")
        edges = [begin, float(end - usual if longest < found.size else end)]  # before the force rises again
    elif seen.passes("shrinks") and (step := _step(found)):
        edges = [float(found.times[step])]
    else:
        return None
    parts = [trace.part(*ends) for ends in itertools.pairwise([float(trace.t[0]), *edges, math.inf])]
    judged = [(i, _judge(part, depth=depth + 1)) for i, part in enumerate(parts) if part.t.size >= FEWEST_READINGS]
    segments: list[Segment] = []
    for i, each in judged:
        if each.kind == "undecided" and not each.segments and not (paused and i == 1):
            if not paused:
                return None
            continue
        for new in each.segments or (Segment(kind=each.kind, begin=each.window[0], end=each.window[1]),):
            same = bool(segments) and segments[-1].kind == new.kind
            segments.append(replace(new, begin=segments.pop().begin) if same else new)
    kinds = {segment.kind for segment in segments}
    if not kinds & {"stick-slip", "sustained oscillation"} or (len(kinds) == 1 and paused):
        return None
    if len(kinds) == 1:
        last, ratio = judged[-1][1], float(np.median(found.drops[step:]) / np.median(found.drops[:step]))
        when = trace.time_in_words(edges[0])
        return last.kind, f"{last.reason}; from t = {when} on, the drops are {ratio:.2g} times as large", ()
    told = f"slips and pauses take turns, in {len(segments)} parts: judge each by itself"
    if len(segments) <= FEWEST_CYCLES:
        names = ["nothing" if segment.kind == "undecided" else segment.kind for segment in segments]
        ends = [f" up to t = {trace.time_in_words(segment.end)}" for segment in segments[:-1]]
        told = ", then ".join(map("".join, itertools.zip_longest(names, ends, fillvalue="")))
        told += ": judge each part by itself"
    return "undecided", told, tuple(segments)


def _step(found: Slips) -> int:
    """The slip at which the drops change at once, if a step fits them better than a line, by three errors; else 0."""
    size = np.log(found.drops)
    count = np.arange(1, size.size)
    total = np.cumsum(size - size.mean())[:-1]
    gain = total**2 * size.size / (count * (size.size - count))
    gain[: FEWEST_CYCLES - 1] = gain[size.size - FEWEST_CYCLES :] = 0.0
    at = found.times - found.times.mean()
    line = float(at @ size) ** 2 / float(at @ at)
    best = int(np.argmax(gain))
    power = max(float(np.sum((size - size.mean()) ** 2)) - float(gain[best]), 0.0) / max(size.size - 2, 1)
    return best + 1 if gain[best] - line > ERRORS**2 * power else 0


def _noise_of_contacts(trace: Trace, seen: Evidence, part: str) -> tuple[Kind, str]:
    """Verdict on a fluctuation that so few contacts make as noise."""
    if seen.slips and seen.value("slight") > ERRORS * STEADY:  # of so few contacts that each slip is seen
        return "stick-slip", f"irregular slips that persist, of few contacts ({trace.contacts}): {part}"
    if seen.passes("slight"):
        what = f"no more than the noise of {trace.contacts} contacts"
        return "smooth sliding", f"the force fluctuates by {part}, without a period: {what}"
    if seen.passes("shrinks"):
        return _decaying(trace, seen)
    what = f"as expected from the noise of {trace.contacts} contacts; {_whether_it_sticks(trace)}"
    return "sustained oscillation", f"irregular, {part}, peak to peak, {what}"


def _whether_it_sticks(trace: Trace) -> str:
    stuck = _stuck(trace)
    if stuck is None:
        return "whether the slider sticks, the force alone does not tell"
    return "the slider never sticks" if stuck < STICKS else f"the slider sticks for {100 * stuck:.0f} % of the time"


def _too_few(trace: Trace, seen: Evidence) -> str:
    """What to say of fewer cycles than make a verdict."""
    count, span = seen.count, float(np.ptp(trace.t))
    each = span / max(count, 1)
    return (
        f"too short: {count} complete drop{'s' * (count != 1)} of the force in the window; a verdict needs "
        f"{FEWEST_CYCLES}: about {trace.time_in_words(max((FEWEST_CYCLES + 1) * each - span, each))} more"
    )


def _growing(trace: Trace, seen: Evidence, part: str) -> str:
    """What to say of an oscillation that grows."""
    what = "the oscillation still grows,"
    if not seen.periodic and seen.passes("normal"):
        what = f"the force fluctuates by {part}, without a period, and changes"
    return f"{what} by a factor {seen.trend:.2g} between the halves of the window; {_more(trace, 2.0)}"


def _decaying(trace: Trace, seen: Evidence) -> tuple[Kind, str]:
    """Verdict on an oscillation that shrinks."""
    left = float(np.ptp(trace.force[trace.force.size // 2 :])) / seen.friction
    name = "oscillation" if seen.periodic or seen.slips or not seen.passes("normal") else "fluctuation"
    shrinks = f"the {name} decays, by a factor {seen.trend:.2g} from one half of the window to the other"
    if not seen.slips and left < SMALL:
        return "smooth sliding", f"{shrinks}, and is down to {100 * left:.3g} % of the largest force"
    halves = math.log(SMALL / max(left, 1.1 * SMALL)) / math.log(seen.trend)
    return "undecided", f"{shrinks}; {_more(trace, 0.5 * max(halves, 1.0), what=' whether it persists')}"


def _still_loading(trace: Trace, seen: Evidence) -> str:
    """What to say of a force that a straight line makes most of, or nothing."""
    drift = slope(trace.force, trace.t) * float(np.ptp(trace.t))
    if abs(drift) <= DRIFTS * seen.peak_to_peak or abs(drift) <= 2.0 * seen.found.smallest:
        return ""
    return (
        f"the force still {'rises' if drift > 0 else 'falls'}, by {trace.force_in_words(abs(drift))} in the window, "
        f"and shows no complete slip; {_more(trace, 4.0)}"
    )


def _about_the_sign(trace: Trace, found: Slips) -> str:
    """What to say of a force that is turned, or nothing."""
    if trace.drive is not None or not is_mirrored(trace, found):
        return ""
    return (
        "the force rises in jumps and falls slowly: the sensor's sign seems to be reversed; turn it (--flip on "
        "the command line, flip=True in read_trace)"
    )


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


def _without_drops(trace: Trace, seen: Evidence) -> tuple[Kind, str]:
    """Verdict where no drop of the force stands out."""
    friction, oscillation, found = seen.friction, seen.peak_to_peak, seen.found
    if oscillation == 0.0 and trace.drive is None:
        return "undecided", "the force never changes: is the sensor connected?"
    part = _part(oscillation, seen)
    if oscillation < TINY * friction:
        return "smooth sliding", f"the force fluctuates by {part}"
    if loading := _still_loading(trace, seen):
        return "undecided", loading
    if oscillation > max(2.0 * found.smallest, SMALL * friction) and not is_white(trace, found.noise, found.cycles):
        more = _more(trace, 4.0)
        return "undecided", f"too short: the force oscillates, but shows no complete drop in the window; {more}"
    # Slips of a drop D, seen once a cycle or less, scatter by D/sqrt(12) and look like white noise.
    if float(without_line(trace.force, trace.t).std()) > SMALL / math.sqrt(12.0) * friction:
        what = "masks any oscillation, and slips: record more often"
        return "undecided", f"noise of {part} from one sample to the next {what}"
    return "smooth sliding", f"the force shows noise only, {part}"
