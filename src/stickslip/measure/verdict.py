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
from stickslip.measure.arrays import CONSTANT_DRIVE, FEWEST_READINGS, Trace, in_words, slope
from stickslip.measure.bench import about_the_sensor, find_strokes, is_mirrored
from stickslip.measure.evidence import ENOUGH, ERRORS, MOST, TINY, Criterion, Evidence, gather
from stickslip.measure.periods import FEWEST_CYCLES
from stickslip.measure.slips import FEWEST_IN_A_DROP, Slips, fast_ones, find_slips, mean_and_std
from stickslip.simulation import Recording
from stickslip.words import prefixed

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["TINY", "Kind", "Regime", "regime", "regime_of"]

Kind = Literal["smooth sliding", "stick-slip", "sustained oscillation", "undecided"]

LATE_PART = 0.4  # the last part of a run, in which its regime is judged
LONG_TRANSIENT = 50  # cycles: 40 to 100 x_s, in the model
MOST_STROKES = 0.75  # part of the strokes that must agree
STUCK, STICKS = 0.05, 0.1  # a slider slower than this many times the drive sticks; part of the time for which it must

SMOOTH: Kind = "smooth sliding"
SLIPS: Kind = "stick-slip"
LASTS: Kind = "sustained oscillation"
OPEN: Kind = "undecided"

_LOADING = "the force still {moves}, by {drift} in the window, and shows no complete slip; {more}"
_HIDDEN = "a period of {line} stands out of noise of {part}, which hides whether it is slips: record more often"
_DOUBT = "{count} cycles of {part}, peak to peak, that noise may make as well; {more}"

RULES: tuple[tuple[str, Kind, str], ...] = (
    ("-cycles -slips -size", SMOOTH, "the force fluctuates by {swing}, peak to peak"),
    ("-cycles line", OPEN, _HIDDEN),
    ("-cycles drifts", OPEN, _LOADING),
    ("-drops -unfinished masks", OPEN, "noise of {part} masks any oscillation, and slips: record more often"),
    ("-drops -unfinished", SMOOTH, "the force shows noise only, {part}"),
    ("-cycles", OPEN, "too short: {count} of the {fewest} complete cycles that a verdict needs; about {missing} more"),
    ("noise slips strong", SLIPS, "irregular slips that persist, of few contacts ({contacts}): {part}"),
    ("noise slight", SMOOTH, "{ample}: no more than the noise of {contacts} contacts"),
    ("chance -noise -enough", OPEN, _DOUBT),
    ("turns", OPEN, "{parts}"),
    ("shrinks small -slips", SMOOTH, "{changes}, and is down to {left}"),
    ("shrinks", OPEN, "{changes}; {more} whether it persists"),
    ("slips", SLIPS, "{manner} slips that persist: {how}"),
    ("grows", OPEN, "{changes}; {more}"),
    ("-size", SMOOTH, "the force oscillates by {swing}, peak to peak"),
    ("-resolved", OPEN, "drops of {part} last fewer than {samples} samples: record more often"),
    ("periodic alone normal", OPEN, _DOUBT),
    ("lasts", LASTS, "{manner}, {part}, peak to peak; {sticks}: {how}"),
    ("line", OPEN, _HIDDEN),
    ("normal slight", SMOOTH, "{ample}, as slow noise does"),
    ("", OPEN, "irregular oscillation of {part} that is neither slips nor noise: {how}; {more}"),
)
"""What a window shows: facts that hold, or, with a minus, do not; then kind and reason. The first that fits decides."""


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
    cycles : int
        Complete cycles in the window; of a force that is not periodic, complete drops.
    period, period_variation : float
        Mean time of a cycle, and its coefficient of variation; NaN with too few cycles.
    drop, drop_variation : float
        Mean force drop, and its coefficient of variation.
    slip_phase : float
        Fraction of the time in which the force drops: .5 for a sine, near 0 for a sawtooth.
    noise : float
        Standard deviation of the noise from sample to sample, in the unit of the force.
    drive_velocity : float or None
        Mean velocity of the drive in the window; None where it is not known.
    largest_velocity : float or None
        Largest slider velocity in the window, over the drive's velocity.
    stuck : float or None
        Fraction of the time in which the slider is slower than a twentieth of the drive.
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
    cycles: int
    period: float
    period_variation: float
    drop: float
    drop_variation: float
    slip_phase: float
    noise: float
    drive_velocity: float | None = None
    largest_velocity: float | None = None
    stuck: float | None = None
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
    return judged(data, after)[1]


def regime_of(run: Recording) -> Regime:
    """Return the regime of a run that has not become a Dataset; the same as of the Dataset."""
    return _over_the_window(Trace.of_recording(run))


def judged(data: xr.Dataset, after: float | None) -> tuple[Trace, Regime]:
    """The trace that data hold, or what comes after a time, and its regime; a coefficient of friction by its size."""
    trace = Trace.of(data)
    if after is not None:
        end, trace = trace.t[-1], trace.part(begin := number("after", after, hint="a time, in the unit of t"))
        if trace.t.size < FEWEST_READINGS:
            least = f"fewer than {FEWEST_READINGS} samples lie after it"
            raise InputError(f"after = {begin:g}: {least}; the data end at t = {end:g}")
    seen = _over_the_window(trace, whole=after is None)
    if "mu" in data and data["mu"].dims == ("time",):
        size = abs(data["mu"])  # it changes sign with the direction
        inside = size.sel(time=slice(*seen.window))
        seen = replace(seen, mean_mu=float(inside.mean()), static_mu=float(size.max()))
    return trace, seen


def _over_the_window(trace: Trace, *, whole: bool = True) -> Regime:
    """Choose the window in all of the data, or take what was chosen, and judge it; of a bench, with notes."""
    if trace.drive is None:
        return _of_a_bench(trace, whole=whole)
    if not whole:
        return _judge(trace)
    differs = np.flatnonzero(np.abs(trace.drive - trace.drive[-1]) > CONSTANT_DRIVE * abs(trace.drive[-1]))
    first = int(differs[-1]) + 1 if differs.size else 0
    if trace.t.size - first < max(FEWEST_READINGS, 0.05 * trace.t.size):
        return _judge(trace)
    begin, end = trace.t[first], trace.t[-1]
    late, longer = (trace.part(end - parts * LATE_PART * (end - begin)) for parts in (1, 2))
    found = find_slips(late) if late.t.size >= FEWEST_READINGS else None
    if found is None or 0 < found.size <= FEWEST_CYCLES:
        late, found = longer, find_slips(longer)
    seen = _judge(late, found)
    if seen.kind not in (SLIPS, LASTS) or not end - begin < LONG_TRANSIENT * seen.period:
        return seen
    caution = f"seen for {(end - begin) / seen.period:.0f} cycles only; run longer to rule out a transient"
    return replace(seen, reason=f"{seen.reason} ({caution})")


def _of_a_bench(trace: Trace, *, whole: bool) -> Regime:
    """Judge a force alone: its longest stretch without a gap, once it is loaded, or its strokes; with notes."""
    notes, gaps = [], trace.gaps.tolist()
    if gaps:
        begin, end = (words.number(trace.t[i]) for i in (gaps[0], gaps[0] + 1))
        notes.append(f"no readings from t = {begin} to {end} {trace.time_unit}".rstrip())
        notes[0] += f", and {len(gaps) - 1} more gaps" * (len(gaps) > 1)
        starts = [0, *(gap + 1 for gap in gaps)]
        stretches = [trace.part(*trace.t[[i, j]]) for i, j in zip(starts, [*starts[1:], -1], strict=True)]
        longest = max(stretches, key=lambda part: float(np.ptp(part.t)))
        if longest.t.size >= FEWEST_READINGS:
            trace = longest
            notes[0] += ": the longest stretch without a gap was judged"
    if strokes := find_strokes(trace):
        seen = _of_strokes(strokes)
    else:
        usual = float(np.median(trace.force[trace.force.size // 2 :]))
        late = trace.part(float(trace.t[int(np.argmax(trace.force >= usual))]))
        window = late if whole and late.t.size >= FEWEST_READINGS else trace
        seen, rate = _judge(window), slope(window.force, window.t)
        if seen.kind != OPEN and abs(rate) * np.ptp(window.t) > MOST * np.ptp(window.force):
            unit = f"{trace.force_unit.removesuffix('1')}/{trace.time_unit}".rstrip("/")
            notes.append(f"the force drifts by {words.number(trace.sign * rate, 3)} {unit}".rstrip())
    return replace(seen, notes=(*seen.notes, *notes, *about_the_sensor(trace.force)))


def _of_strokes(strokes: list[Trace]) -> Regime:
    """Judge each stroke by itself, and sum up."""
    seen = [_judge(stroke) for stroke in strokes]
    count = Counter(each.kind for each in seen)
    usual = next((kind for kind, _ in count.most_common() if kind != OPEN), OPEN)
    typical = next(each for each in seen if each.kind == usual)
    told = ", ".join(f"{many} {kind}" for kind, many in count.most_common())
    reason = f"reciprocating test, {len(seen)} strokes judged separately ({told}); {typical.reason}"
    kind = usual
    if count[kind] < MOST_STROKES * len(seen):
        kind, reason = OPEN, f"{reason}; judge a part of the strokes"
    window = seen[0].window[0], seen[-1].window[1]
    return replace(typical, kind=kind, reason=reason, window=window)


def _judge(trace: Trace, found: Slips | None = None, *, in_parts: bool = True) -> Regime:
    """Weigh the evidence in a window, whose drops may have been found before."""
    found = find_slips(trace) if found is None else found
    seen = gather(trace, found)
    stuck, drive = None, None if trace.drive is None else float(trace.drive.mean())
    largest = float(trace.velocity.max()) / drive if trace.velocity is not None and drive else None
    if trace.velocity is not None and drive:
        stuck = float(np.mean(np.abs(trace.velocity) < STUCK * drive))
    kind, reason, segments = OPEN, _fault(trace, found), tuple[Segment, ...]()
    if not reason:
        facts, said = seen.facts, _in_words(trace, seen, stuck)
        if in_parts and "cycles" in facts and facts & {"slips", "periodic"}:
            if "paused" in facts and (segments := _around_pauses(trace, found, seen.tests["paused"])):
                facts, said["parts"] = facts | {"turns"}, _parts_in_words(trace, segments)
            elif "shrinks" in facts and (step := _step(trace, found)):
                facts, said["how"] = facts - {"shrinks"}, f"{said['how']}; {step}"
        kind, reason = next(
            (kind, reason.format_map(said))
            for conditions, kind, reason in RULES
            if all((name.lstrip("-") in facts) == (name[0] != "-") for name in conditions.split())
        )
    slips = fast_ones(trace, found) if kind == SLIPS else found
    drop, _, drop_variation = mean_and_std(slips.drops)
    count, (period, _, variation) = slips.size, mean_and_std(np.diff(slips.times))
    if seen.cycles and kind != SMOOTH:
        count, period, variation = seen.cycles.count, seen.cycles.period, seen.cycles.variation
    return Regime(
        kind=kind,
        reason=reason,
        window=(float(trace.t[0]), float(trace.t[-1])),
        peak_to_peak=float(np.ptp(trace.force)),
        mean_force=trace.sign * float(trace.force.mean()),
        static_friction=abs(trace.largest),
        trend=seen.trend,
        cycles=count,
        period=period,
        period_variation=variation,
        drop=drop,
        drop_variation=drop_variation,
        slip_phase=slips.slip_phase(trace),
        noise=found.noise,
        drive_velocity=None if drive is None else trace.sign * drive,
        largest_velocity=largest,
        stuck=stuck,
        quantity=trace.quantity,
        time_unit=trace.time_unit,
        force_unit=trace.force_unit,
        table=tuple(seen.tests.values()),
        segments=segments,
    )


def _fault(trace: Trace, found: Slips) -> str:
    """What forbids a verdict: a drive that does not move evenly, a sensor that is turned, or does not move at all."""
    if trace.drive is None:
        if is_mirrored(trace, found):
            return (
                "the force rises in jumps and falls slowly: the sensor's sign seems to be reversed; turn it (--flip on "
                "the command line, flip=True in read_trace)"
            )
        return "" if np.ptp(trace.force) else "the force never changes: is the sensor connected?"
    if not trace.drive.any():
        return "the drive stands still"
    if np.ptp(trace.drive) > 2.0 * CONSTANT_DRIVE * np.max(np.abs(trace.drive)):
        return "the velocity of the drive changes: use transitions(), or data.sel(time=slice(from, to))"
    return ""


def _in_words(trace: Trace, seen: Evidence, stuck: float | None) -> dict[str, object]:
    """What the reasons of `RULES` are filled with."""
    span, facts, count = float(np.ptp(trace.t)), seen.facts, int(seen.value("cycles"))

    def part(of: float) -> str:
        return f"{100 * of:.3g} % of the largest force"

    how = f"slip phase: {100 * seen.value('phase'):.0f} % of the cycle"
    if "fast" in facts or ("fast" in seen.tests and "resolved" in facts):
        how = f"the slider reaches {seen.value('fast'):.3g} times the velocity of the drive in a typical cycle"
    elif "held" in seen.tests and not facts & {"phase", "periodic"}:
        how = f"the force rises at its full rate for {100 * seen.value('held'):.0f} % of the time"
    if "noise" in facts:
        how += f"; as expected from the noise of {trace.contacts} contacts"
    elif {"slips", "grows"} <= facts:
        how += "; the slips still grow"
    sticks = "whether the slider sticks, the force alone does not tell"
    if stuck is not None:
        sticks = (
            f"the slider sticks for {100 * stuck:.0f} % of the time" if stuck >= STICKS else "the slider never sticks"
        )
    drift, each = slope(trace.force, trace.t) * span, span / max(count, 1)
    swing = part(float(np.ptp(trace.force)) / (abs(trace.largest) or 1.0))
    # So long that there are enough cycles, and a trend shows, or the rest of the oscillation that was begun.
    more = trace.time_in_words(max(ENOUGH / max(count, 1), 2.0) * span)
    motion = "oscillation" if facts & {"slips", "periodic"} or "normal" not in facts else "fluctuation"
    changes = "decays" if seen.trend < 1.0 else "still grows"
    return {
        "part": swing,
        "swing": part(seen.value("size")),
        "left": part(seen.value("small")),
        "ample": f"the force fluctuates by {swing}, without a period",
        "line": trace.time_in_words(seen.line),
        "count": count,
        "fewest": FEWEST_CYCLES,
        "samples": FEWEST_IN_A_DROP,
        "contacts": trace.contacts,
        "manner": "periodic" if seen.cycles else "irregular",
        "how": how,
        "sticks": sticks,
        "changes": f"the {motion} {changes}, by a factor {seen.trend:.2g} from one half of the window to the other",
        "moves": "rises" if drift > 0 else "falls",
        "drift": trace.force_in_words(abs(drift)),
        "missing": trace.time_in_words(max((FEWEST_CYCLES + 1) * each - span, each)),
        "more": f"about {more} more{', or the velocity of the slider,' * (trace.velocity is None)} would tell",
    }


def _around_pauses(trace: Trace, found: Slips, pause: Criterion) -> tuple[Segment, ...]:
    """The parts of a record with pauses among its slips, each judged by itself; none if they are of one kind."""
    limits = np.concatenate([[trace.t[0]], found.times, [trace.t[-1]]])
    waits = np.diff(limits)
    usual = float(waits.max()) / pause.statistic
    edges, pauses = [float(trace.t[0])], []
    for i in np.flatnonzero(waits >= pause.limit * usual):
        begin = float(trace.t[found.end[i - 1]]) if i else float(trace.t[0])
        end = float(limits[i + 1]) - (usual if i < found.size else 0.0)  # before the force rises again
        edges += [begin, end]
        pauses.append(begin)
    segments: list[Segment] = []
    for begin, end in itertools.pairwise([*edges, math.inf]):
        part = trace.part(begin, end)
        if part.t.size >= FEWEST_READINGS:
            each = _judge(part, in_parts=False)
            if each.kind != OPEN or begin in pauses:
                segments.append(Segment(kind=each.kind, begin=each.window[0], end=each.window[1]))
    groups = [list(group) for _, group in itertools.groupby(segments, key=lambda segment: segment.kind)]
    merged = tuple(replace(group[0], end=group[-1].end) for group in groups)
    return merged if len(merged) > 1 and {each.kind for each in merged} & {SLIPS, LASTS} else ()


def _parts_in_words(trace: Trace, segments: tuple[Segment, ...]) -> str:
    if len(segments) > FEWEST_CYCLES:
        return f"slips and pauses take turns, in {len(segments)} parts: judge each by itself"
    ends = [f" up to t = {trace.time_in_words(segment.end)}" for segment in segments[:-1]]
    told = [
        f"{'nothing' if each.kind == OPEN else each.kind}{end}" for each, end in zip(segments, [*ends, ""], strict=True)
    ]
    return f"{', then '.join(told)}: judge each part by itself"


def _step(trace: Trace, found: Slips) -> str:
    """Since when drops are smaller, if a step fits better than a line, by three errors, and both parts are alike."""
    size, at = np.log(found.drops), found.times - found.times.mean()
    if size.size < 2 * FEWEST_CYCLES:
        return ""
    count = np.arange(1, size.size)
    gain = np.cumsum(size - size.mean())[:-1] ** 2 * size.size / (count * (size.size - count))
    gain[: FEWEST_CYCLES - 1] = gain[size.size - FEWEST_CYCLES :] = 0.0
    best = int(np.argmax(gain))
    power = max(float(np.sum((size - size.mean()) ** 2)) - float(gain[best]), 0.0) / max(size.size - 2, 1)
    if gain[best] - float(at @ size) ** 2 / float(at @ at) <= ERRORS**2 * power:
        return ""
    since = float(found.times[best + 1])
    before, after = (_judge(part, in_parts=False).kind for part in (trace.part(trace.t[0], since), trace.part(since)))
    times = np.median(found.drops[best + 1 :]) / np.median(found.drops[: best + 1])
    told = f"from t = {trace.time_in_words(since)} on, the drops are {times:.2g} times as large"
    return told if before == after != OPEN else ""
