"""The regime of motion under a constant drive."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from stickslip import words
from stickslip.answers import Answer
from stickslip.arrays import Range
from stickslip.errors import InputError, number
from stickslip.io.headings import ratio
from stickslip.loops import bounded
from stickslip.measure.features import (
    CLIMBS,
    MOST,
    NOISE,
    ONE_RATE,
    SLIP_PHASE,
    SWING,
    TINY,
    Criterion,
    Window,
)
from stickslip.measure.kinds import (
    FALLS_SLOWLY,
    LASTS,
    OPEN,
    SLIPS,
    SMOOTH,
    Kind,
    decide,
)
from stickslip.measure.part_table import end_of, part_table
from stickslip.measure.segments import parts_between_pauses, pulls, segments
from stickslip.measure.sensor import note_saturation, spikes
from stickslip.measure.slips import Slips, fast_slips
from stickslip.measure.strokes import find_strokes, join_strokes, without_path
from stickslip.measure.trace import (
    CONSTANT_DRIVE,
    ERRORS,
    FEWEST_CYCLES,
    FEWEST_READINGS,
    STUCK_TIME,
    Trace,
    dataset_of,
    mean_and_std,
)
from stickslip.words import prefixed

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from stickslip.simulation.run import Recording

__all__ = ["TINY", "Kind", "Regime", "regime"]

LATE_PART = 0.4  # fraction of a run, at its end, in which its regime is judged
MOST_LISTED = 5  # parts of different kinds that one line lists
MOST_PARTS = 0.75  # fraction of the time for which the parts of a record must agree


@dataclass(frozen=True, kw_only=True, repr=False)
class Regime(Answer):
    """The regime of motion in a stretch of constant driving, with the evidence; it
    equals its own `kind`.
    """

    #: *Stick-slip*: slow loading and fast slips that persist; in a typical cycle the
    #: slider reaches at least 3.5 times the velocity of the drive. Where only the force
    #: is known: it climbs at one rate between drops, and falls at least three times as
    #: fast. *Sustained oscillation*: a cycle that persists, slower than that; the
    #: reason says whether the slider sticks. *Smooth sliding*: no oscillation, or noise
    #: of the contacts or distributed as noise, or an oscillation below 2 % of the
    #: largest force, or one that decays and is below 10 %. *Undecided*: the evidence
    #: does not suffice; the reason names the data that would decide it.
    kind: Kind

    reason: str  #: why, in plain words
    #: start and end of the stretch that was evaluated, in the unit of `t`
    window: Range
    peak_to_peak: float  #: of the force of the driving spring in the window
    mean_force: float  #: of the driving spring in the window
    #: largest force in all of the data, with which amplitudes are compared
    static_friction: float
    #: amplitude in the second half over that in the first, from a line through the
    #: logarithms of the drops, or of the scatter in eight parts
    trend: float
    #: complete cycles in the window; of a force that is not periodic, complete drops
    cycles: int
    period: float  #: mean time of a cycle; NaN with too few cycles
    period_variation: float  #: its coefficient of variation
    last_slip: float  #: when the last slip ends; NaN without one
    drop: float  #: mean force drop
    drop_variation: float  #: its coefficient of variation
    #: fraction of the time in which the force drops: .5 for a sine, near 0 for a
    #: sawtooth
    slip_phase: float
    noise: float  #: standard deviation from sample to sample, in the unit of the force
    #: where only the force is known: rate at which it rises between drops, which is
    #: stiffness times velocity if the slider sticks
    loading_rate: float | None = None
    #: and rate at which it falls in a typical drop
    falling_rate: float | None = None
    drive_velocity: float | None = None  #: mean in the window, where it is known
    #: measured speed of the drive at the beginning and at the end of the window
    speeds: Range | None = None
    #: largest velocity of the slider over that of the drive, where they are known
    largest_velocity: float | None = None
    #: fraction of the time in which the slider is slower than a quarter of the drive
    stuck: float | None = None
    #: with a normal load: the coefficient of friction, on average in the window
    mean_mu: float | None = None
    static_mu: float | None = None  #: the largest coefficient in all of the data
    quantity: str = "force"  #: or "coefficient of friction", "torque"
    time_unit: str = ""  #: unit of the times above; empty where it is not known
    force_unit: str = ""  #: unit of the forces above
    velocity_unit: str = ""  #: unit of a measured speed
    #: remarks on the data: a saturated sensor, gaps, a drift
    notes: tuple[str, ...] = ()
    #: of a reciprocating test: half the difference of the two plateaus of its strokes
    half_width: float | None = None
    offset: float | None = None  #: of a reciprocating test: mean of the two plateaus
    #: the parts between gaps, steps of level or amplitude, and reversals, each judged
    #: by itself; empty where there are none
    segments: tuple[Regime, ...] = ()
    table: tuple[Criterion, ...] = ()  #: the tests that decide kind and reason

    @property
    def drops_are(self) -> Literal["slips", "cycles", "drops"]:
        """Name of the drops of the force: slips, or cycles of an oscillation without
        sticking, or just drops.
        """
        if self.kind == "sustained oscillation":
            return (
                "slips"
                if self.stuck is not None and self.stuck >= STUCK_TIME
                else "cycles"
            )
        return "slips" if self.kind == "stick-slip" else "drops"

    @property
    def frequency(self) -> float:
        """Cycles per second; NaN where the period or its unit is not known."""
        seconds = ratio(self.time_unit, "s")
        return 1.0 / (seconds * self.period) if seconds else math.nan

    @property
    def is_in_turn(self) -> bool:
        """Whether all parts are decided, but differ in kind."""
        kinds = {each.kind for each in self.segments}
        return self.kind == OPEN and OPEN not in kinds and bool(kinds)

    @property
    def is_noise(self) -> bool:
        """Whether the force fluctuates by no more than the noise of its contacts."""
        passed = {row.name: row.passed for row in self.table}
        swings = self.kind == SMOOTH and passed.get(SWING, False)
        return swings and not passed.get(NOISE, True)

    def __eq__(self, other: object) -> bool:
        # NaN equals NaN
        alike = isinstance(other, Regime) and repr(vars(self)) == repr(vars(other))
        return self.kind == other if isinstance(other, str) else alike

    def __hash__(self) -> int:
        return hash(self.kind)

    def __str__(self) -> str:
        lines = [self.reason if self.is_in_turn else f"{self.kind}: {self.reason}"]
        if self.half_width is not None and self.offset is not None:
            half, middle = (
                words.engineering(force, self.force_unit)
                for force in (self.half_width, self.offset)
            )
            lines.append(f"friction loop: ±{half} about an offset of {middle}")
        if self.mean_mu is not None and self.static_mu is not None:
            lines.append(
                f"coefficient of friction {words.number(self.mean_mu, 3)} on average "
                f"(kinetic), {words.number(self.static_mu, 3)} at most (static)"
            )
        lines += part_table(self.segments) if self.segments else self._evidence()
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(lines)

    def _evidence(self) -> list[str]:
        """Return lines of text with the evidence of a window without parts."""
        divisor, unit = prefixed(self.window[1], self.time_unit)
        begin, end = (time / divisor for time in self.window)
        mean, swing, noise, drop = (
            words.engineering(value, self.force_unit, digits)
            for value, digits in (
                (self.mean_force, 4),
                (self.peak_to_peak, 3),
                (self.noise, 2),
                (self.drop, 3),
            )
        )
        lines = [
            f"evaluated over t = {words.number(begin)} to "
            f"{words.engineering(end, unit)}; {self.quantity} {mean} on average, peak "
            f"to peak {swing}, noise {noise}",
        ]
        if self.cycles > 1:  # one drop, as of a relaxation, does not recur
            text = f"{self.cycles} cycles in this window, drop {drop}"
            text += _variation(self.drop_variation)
            if math.isfinite(self.period):
                period = words.engineering(self.period, self.time_unit)
                text += f", period {period}{_variation(self.period_variation)}"
            if math.isfinite(self.slip_phase):
                text += f", slip phase: {100 * self.slip_phase:.0f} % of the cycle"
            lines.append(text)
        if self.cycles >= FEWEST_CYCLES and math.isfinite(self.trend):
            lines.append(f"amplitude, second half over first half: {self.trend:.3g}")
        if self.loading_rate is not None and self.falling_rate is not None:
            lines.append(self._rates(self.loading_rate, self.falling_rate))
        if self.largest_velocity is not None:
            lines.append(
                f"largest velocity {words.number(self.largest_velocity, 3)} times the "
                "drive's"
            )
        return lines

    def _rates(self, loading: float, falling: float) -> str:
        """Return what the rates of a force alone show of the motion, in words."""
        # a slip is four times as fast as the drive: 1 + falls/(stiffness x velocity)
        most = falling / (1.0 / SLIP_PHASE - 1.0)
        rise, fall, limit = (
            words.engineering(rate, _rate_unit(self), 3)
            for rate in (loading, falling, most)
        )
        if most < loading:
            # stiffness x velocity is at least the rate of the rise
            return (
                f"between drops the force rises at {rise}, and it falls at {fall}: an "
                "oscillation, whatever stiffness and velocity"
            )
        return (
            f"between drops the force rises at {rise}: slips, if stiffness x velocity "
            f"is about that; an oscillation without sticking, if above {limit}"
        )


def _rate_unit(of: Trace | Regime) -> str:
    """Return the unit of a rate of the force."""
    return f"{of.force_unit.removesuffix('1')}/{of.time_unit}".rstrip("/")


def _variation(value: float) -> str:
    return f" (CV {value:.2g})" if math.isfinite(value) else ""


def regime(
    data: xr.Dataset | xr.DataArray | pd.Series, *, after: float | None = None
) -> Regime:
    """Return the regime of motion under a constant drive, with the evidence;
    "undecided" where that does not suffice.

    The verdict is about the window judged: an oscillation that still grows or shrinks
    there is undecided, and so is one whose amplitude may change by a factor of 2 from
    one half to the other. The parts between gaps, between steps of the level or of the
    amplitude, and the strokes of a reciprocating test are judged separately, and listed
    in order where they differ; strokes too short for that are judged together. Raises
    `InputError` if the data hold no force, or values that are not finite, or nothing
    after `after`.

    Parameters
    ----------
    data : Dataset, DataArray or Series
        A run, a measured trace, or the force alone over its times: coordinate or index,
        which may be dates.
    after : float, optional
        Judge the data after this time, in the unit of the times. By default the last
        40 % of the last stretch of constant driving, or 80 % if that holds fewer than
        five drops; of a force alone, all after the first loading.

    Examples
    --------
    >>> import pandas as pd
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> ss.regime(pd.Series(3.0 + 2.0 * (t % 1.5), index=t)) == "stick-slip"
    True
    """
    return judged(dataset_of(data), after)[1]


def regime_of_run(run: Recording) -> Regime:
    """Return the regime of the recording of an engine: the same as `regime` of its
    Dataset.
    """
    return _combine_parts(_judge_parts(_late_window(Trace.of_run(run))))


def judged(data: xr.Dataset, after: float | None) -> tuple[Trace, Regime]:
    """Return the trace of the data, or its part after a time, and its regime; the
    coefficient of friction by its absolute value.
    """
    trace = Trace.of(data)
    if trace.measured and "spikes" not in data.attrs:
        good = ~spikes(trace.force)
        force = np.interp(trace.t, trace.t[good], trace.force[good])
        largest = float(np.max(np.abs(force)))
        trace = replace(trace, force=force, largest=largest)
    if after is not None:
        end = trace.t[-1]
        begin = number("after", after, hint="a time, in the unit of t")
        trace = trace.part(begin)
        if trace.t.size < FEWEST_READINGS:
            given, last = (
                words.engineering(time, trace.time_unit, 6) for time in (begin, end)
            )
            least = f"fewer than {FEWEST_READINGS} samples lie after it"
            raise InputError(f"after = {given}: {least}; the data end at t = {last}")
    if trace.measured:
        seen = _judge_measured(trace, whole=after is None)
    else:
        window = _late_window(trace) if after is None else Window.of(trace)
        seen = _combine_parts(_judge_parts(window))
    if "mu" in data and data["mu"].dims == ("time",):
        seen = _with_friction(seen, data)
    return trace, seen


def _with_friction(seen: Regime, data: xr.Dataset) -> Regime:
    """Return the regime with coefficients of friction, those of strokes without their
    offset.
    """
    mu = data["mu"]
    if seen.offset is not None:
        mu = mu - seen.offset * mu / data["spring_force"]
    size = abs(mu)  # it changes sign with the direction
    segments = tuple(_with_mu(each, size) for each in seen.segments)
    seen = replace(_with_mu(seen, size), segments=segments, static_mu=float(size.max()))
    if seen.offset is None:
        return seen
    strokes = [each.mean_mu for each in segments if each.mean_mu is not None]
    return replace(seen, mean_mu=float(np.mean(strokes)))


def _with_mu(seen: Regime, size: xr.DataArray) -> Regime:
    """Return the regime with the mean and largest coefficient of friction in its
    window.
    """
    inside = size.sel(time=slice(*seen.window))
    return replace(seen, mean_mu=float(inside.mean()), static_mu=float(inside.max()))


def _late_window(trace: Trace) -> Window:
    """Return the last 40 % of the last stretch of constant driving, or 80 % if that
    part holds few drops.
    """
    assert trace.drive is not None
    last = trace.drive[-1]
    differs = np.flatnonzero(np.abs(trace.drive - last) > CONSTANT_DRIVE * abs(last))
    first = int(differs[-1]) + 1 if differs.size else 0
    first = max(first, int(np.searchsorted(trace.t, trace.steady_load_from)))
    if trace.t.size - first < max(FEWEST_READINGS, 0.05 * trace.t.size):
        return Window.of(trace)
    end = trace.t[-1]
    for part in (LATE_PART, 2.0 * LATE_PART):
        late = Window.of(trace.part(end - part * (end - trace.t[first])))
        is_long = late.trace.t.size >= FEWEST_READINGS
        if is_long and not 0 < late.slips.size <= FEWEST_CYCLES:
            break
    return late


def _judge_measured(trace: Trace, *, whole: bool) -> Regime:
    """Judge a measured force where the bench is loaded: each part between gaps and
    steps, and each stroke, by itself; with notes.
    """
    stretches = trace.stretches
    loaded = [pull for each in stretches for pull in pulls(each)]
    notes = [
        *note_saturation(trace.force),
        *_note_gaps(trace),
        *_note_unloaded(stretches, loaded),
    ]
    parts = list[Regime]()
    strokes = 0
    loops = list[tuple[float, float]]()
    long = [each for each in loaded if each.t.size >= FEWEST_READINGS]
    for stretch in long or [trace]:
        found, friction, offset = find_strokes(stretch)
        if not found:
            parts += (
                _judge_settled(_skip_loading(stretch))
                if whole
                else _judge_parts(Window.of(stretch))
            )
            continue
        parts += _judge_strokes(found, friction)
        strokes += len(found)
        loops.append((friction, trace.sign * offset))
    seen = _combine_parts(parts, strokes)
    if loops:
        half, middle = np.mean(loops, axis=0).tolist()
        seen = replace(seen, half_width=half, offset=middle)
    return replace(seen, notes=(*seen.notes, *notes))


def _note_gaps(trace: Trace) -> list[str]:
    """Note gaps in the readings, except those between parts of a record."""
    gaps = trace.gaps
    if trace.part_number is not None:
        gaps = gaps[np.diff(trace.part_number)[gaps] == 0.0]
    if not gaps.size:
        return []
    ends = trace.t[gaps[0] : gaps[0] + 2]
    begin, end = (words.engineering(t, trace.time_unit) for t in ends)
    many = f" and in {gaps.size - 1} more" if gaps.size > 1 else ""
    return [f"no readings in a gap from t = {begin} to {end}{many}"]


def _note_unloaded(stretches: Sequence[Trace], loaded: Sequence[Trace]) -> list[str]:
    """Note how long the bench is unloaded."""
    all_time = sum(each.length for each in stretches)
    rests = all_time - sum(each.length for each in loaded)
    if rests <= 0.0:
        return []
    time = words.engineering(rests, stretches[0].time_unit, 2)
    return [f"the bench is unloaded for {time}, which is left out"]


def _judge_strokes(strokes: Sequence[Trace], friction: float) -> list[Regime]:
    """Judge each stroke by itself, and undecided ones by all strokes together, without
    those that the record cuts off: by slips, or by noise beside the changes of friction
    along the way.
    """
    parts = [_judge_stroke(stroke) for stroke in strokes]
    if all(each.kind != OPEN for each in parts):
        return parts
    usual = np.median([stroke.length for stroke in strokes])
    whole = [stroke for stroke in strokes if stroke.length > MOST * usual]
    window = Window.of(join_strokes(whole, friction))
    together = _judge(window)
    reason = f"by all strokes together, {together.reason}"
    if together.kind not in (SLIPS, SMOOTH):
        if window.falls_fast or any(each.kind == SLIPS for each in parts):
            return parts
        level = without_path(whole)
        together = _judge(Window.of(join_strokes(level, friction)))
        reason = (
            "by all strokes together, friction changes along the way; beside that "
            f"{together.reason}"
        )
        if together.kind != SMOOTH:
            return parts
    kind = together.kind
    table = together.table
    return [
        replace(each, kind=kind, reason=reason, table=table)
        if each.kind == OPEN
        else each
        for each in parts
    ]


def _judge_stroke(stroke: Trace) -> Regime:
    """Judge a stroke, whose path may be wavy."""
    seen = _judge(Window.of(stroke))
    return replace(seen, kind=OPEN) if seen.kind == LASTS else seen


def _skip_loading(trace: Trace) -> Window:
    """Return the window after the first loading of a force."""
    first = _first_usual(trace)
    if 2 * first > trace.t.size:  # a slow drift reaches it late
        first = _first_usual(trace, 1.0 - TINY)
    late = trace.part(trace.t[first])
    rises = _drift_rate(trace.part(-math.inf, late.t[0])) > 0
    if not rises or 2 * first > trace.t.size or late.t.size < FEWEST_READINGS:
        return Window.of(trace)
    return Window.of(late)


def _first_usual(trace: Trace, fraction: float = 1.0) -> int:
    """Return the first sample that reaches a fraction of the usual force in the second
    half of a trace.
    """
    usual = np.median(trace.force[trace.force.size // 2 :])
    return int(np.argmax(trace.force >= fraction * usual))


def _judge_settled(loaded: Window) -> list[Regime]:
    """Judge a loaded force; if a part is undecided, judge what follows its transient,
    which ends in the first half of its time.
    """
    parts = _judge_parts(loaded)
    if all(part.kind != OPEN for part in parts):
        return parts
    latest = loaded.trace.t[0] + MOST * loaded.trace.length
    seen = loaded
    turns = bounded("transients", loaded.trace.t.size)
    while (settled := _skip_transient(seen, latest)) is not seen:
        next(turns)  # each begins later
        seen = settled
    later = _judge_parts(seen)
    together = _combine_parts(later)
    if seen is loaded or (together.kind == OPEN and not together.is_in_turn):
        return parts
    begin = seen.trace.t[0]
    cycles = np.count_nonzero(loaded.slips.times < begin)
    if later[0].kind == SMOOTH and cycles >= FEWEST_CYCLES:
        until = words.engineering(begin, seen.trace.time_unit, 3)
        reason = f"an oscillation decays until {until}; since then {later[0].reason}"
        later[0] = replace(later[0], reason=reason)
    return later


def _skip_transient(seen: Window, latest: float) -> Window:
    """Return the window after the first few drops, a decaying oscillation or a fall to
    a steady force, if the force then settles before the time `latest`: what follows is
    half as large. Return the same window if it does not.
    """
    trace = seen.trace
    found = seen.slips
    drops = found.drops[trace.t[found.end] <= latest]
    if not drops.size:
        if not found.cut or trace.t[0] >= latest:
            return seen
        return _settled(trace.part(latest), float(np.ptp(trace.force))) or seen
    small = drops < CLIMBS * drops[0]
    count = int(np.argmax(small)) if small.any() else drops.size
    shrinks = np.all(np.diff(drops[: count + 1]) <= ERRORS * found.noise)
    times = found.times[: drops.size]
    fade = small.any() or trace.t[-1] - times[-1] > np.ptp(times)
    if count >= FEWEST_CYCLES and not (shrinks and fade):
        return seen
    rest = trace.part(trace.t[found.end[count - 1]])
    begin = rest.t[_first_usual(rest)]
    if begin > latest:
        return seen
    return _settled(rest.part(begin), float(drops[0])) or seen


def _settled(later: Trace, size: float) -> Window | None:
    """Return the window of a later part of a trace, if its scatter is that of a
    sawtooth less than half of a size; else, or if it has too few readings, None.
    """
    if later.t.size < FEWEST_READINGS:
        return None
    window = Window.of(later)
    variance = window.trace.without_line.var() - window.slips.noise**2
    # as a sawtooth, peak to peak
    return window if 12.0 * variance < (CLIMBS * size) ** 2 else None


def _drift_rate(trace: Trace) -> float:
    """Return the slope of the line through a force; 0 unless the line makes most of its
    range.
    """
    drifts = trace.t.size > 1 and abs(trace.rise) > MOST * np.ptp(trace.force)
    return trace.rise / trace.length if drifts else 0.0


def _judge_parts(seen: Window) -> list[Regime]:
    """Judge each part between steps of level or amplitude by itself."""
    flat = seen.past_waves
    if flat is not seen and not segments(flat.trace, flat.slips):
        return [_judge(seen)]
    parts = segments(seen.trace, seen.slips)
    if not parts:
        return [_judge(seen)]
    judged_parts = [pair for part in parts for pair in _judge_part(part)]
    climbs = [
        each.loading_rate / _speed(part)
        for part, each in judged_parts
        if each.loading_rate
    ]
    return [
        _judge(Window.of(level))
        if each.kind == OPEN and (level := _as_sliding(part, climbs))
        else each
        for part, each in judged_parts
    ]


def _judge_part(part: Trace) -> list[tuple[Trace, Regime]]:
    """Return a part with its regime or, if that is undecided, its finer parts between
    pauses of its drops, each with its own regime.

    Such pauses are missed in the whole record, if the drops of other parts are larger.
    """
    window = Window.of(part)
    seen = _judge(window)
    finer = parts_between_pauses(part, window.slips) if seen.kind == OPEN else []
    return [(each, _judge(Window.of(each))) for each in finer] or [(part, seen)]


def _speed(trace: Trace) -> float:
    """Return the mean speed of the drive; 1, the same for all parts, if it was not
    measured.
    """
    speed = trace.measured_velocity
    return 1.0 if speed is None else float(np.abs(speed).mean())


def _as_sliding(part: Trace, climbs: Sequence[float]) -> Trace | None:
    """Return a part without its drift, if the slider slides in it; None if the slider
    may be held: the force rises as fast as in the loading of other parts.
    """
    rate = part.rise / part.length
    if not climbs or not 0.0 < rate < (1.0 - ONE_RATE) * min(climbs) * _speed(part):
        return None
    return replace(part, force=part.without_line)


def _combine_parts(parts: Sequence[Regime], strokes: int = 0) -> Regime:
    """Return the regime of a record from those of its parts: if they agree, that of the
    longest part of the prevalent kind, else undecided, with the parts in order.
    """
    lasts = Counter[Kind]()
    for each in parts:
        lasts[each.kind] += np.ptp(each.window)
    kind = max(lasts, key=lambda kind: (kind != OPEN, lasts[kind]))
    seen = max(parts, key=lambda each: (each.kind == kind, np.ptp(each.window)))
    # Undecided strokes do not deny the slips of most others.
    only_slips = strokes and {*lasts} == {SLIPS, OPEN}
    needed = MOST if only_slips else MOST_PARTS
    agree = lasts[kind] >= needed * lasts.total()
    window = (
        parts[0].window[0],
        parts[-1].window[1],
    )
    many = Counter(each.kind for each in parts).most_common()
    counts = ", ".join(f"{count} {kind}" for kind, count in many)
    if strokes:
        reason = f"reciprocating test, {strokes} strokes ({counts}); "
        reason += seen.reason + ("" if agree else "; judge some strokes by themselves")
        return replace(
            seen,
            kind=kind if agree else OPEN,
            reason=reason,
            window=window,
            segments=tuple(parts),
        )
    if len(parts) == 1:
        return seen
    seen = replace(seen, segments=tuple(parts))
    if agree and {*lasts} <= {kind, OPEN}:
        return seen
    runs = [[*each] for _, each in itertools.groupby(parts, key=lambda each: each.kind)]
    turns = ", ".join(f"{run[0].kind} until {_until(run)}" for run in runs[:-1])
    reason = f"{turns}, then {runs[-1][0].kind}"
    if len(runs) > MOST_LISTED:
        reason = f"{len(parts)} parts in turn ({counts}); judge some by themselves"
    return replace(seen, kind=OPEN, reason=reason, window=window)


def _until(run: Sequence[Regime]) -> str:
    """Return the end of successive parts in words, with the new speed if it changed."""
    end = _end(run[-1])
    first = run[0].speeds
    last = run[-1].speeds
    if first is None or last is None:
        return end
    change = last[1] - first[0]
    if abs(change) <= CONSTANT_DRIVE * first[0]:
        return end
    speed = words.engineering(last[1], run[-1].velocity_unit, 2)
    return f"{end} ({'up' if change > 0 else 'down'} to {speed})"


def _end(part: Regime) -> str:
    """Return the end of a part in words, to a thousandth of its length."""
    begin = part.window[0]
    end = end_of(part)
    digits = 3 + int(math.log10(max(abs(end) / (end - begin), 1.0)) + 0.8)
    return words.engineering(end, part.time_unit, digits)


def _judge(window: Window) -> Regime:
    """Classify the motion in a window."""
    trace = window.trace
    seen = window.past_waves
    kind = OPEN
    reason = _find_fault(trace, seen)
    if not reason:
        kind, reason = decide(seen)
    notes = list[str]()
    if kind != OPEN and trace.measured and (rate := _drift_rate(trace)):
        drifts = words.engineering(trace.sign * rate, _rate_unit(trace), 3)
        notes.append(f"the force drifts by {drifts}")
    slips = fast_slips(seen.trace, seen.slips) if kind == SLIPS else seen.slips
    drop, _, drop_variation = mean_and_std(slips.drops)
    count = slips.size
    period, _, variation = mean_and_std(slips.waits)
    if seen.cycles and kind != SMOOTH:
        count = seen.cycles.count
        period = seen.cycles.period
        variation = seen.cycles.variation
    slips_or_lasts = kind in (SLIPS, LASTS)
    shows_loading = trace.pace is None and slips_or_lasts and seen.loading.rate > 0
    drive = None if trace.drive is None else trace.sign * float(trace.drive.mean())
    return Regime(
        kind=kind,
        reason=reason,
        window=(float(trace.t[0]), float(trace.t[-1])),
        peak_to_peak=float(np.ptp(trace.force)),
        mean_force=trace.sign * float(trace.force.mean()),
        static_friction=abs(trace.largest),
        trend=math.exp(seen.change.value),
        cycles=count,
        period=period,
        period_variation=variation,
        last_slip=_last_slip(trace, slips) if kind == SLIPS else math.nan,
        drop=drop,
        drop_variation=drop_variation,
        slip_phase=slips.slip_phase(trace),
        noise=seen.slips.noise,
        loading_rate=seen.loading.rate if shows_loading else None,
        falling_rate=seen.falling_rate if shows_loading else None,
        drive_velocity=drive,
        speeds=trace.speeds,
        largest_velocity=trace.largest_velocity,
        stuck=trace.stuck,
        quantity=trace.quantity,
        time_unit=trace.time_unit,
        force_unit=trace.force_unit,
        velocity_unit=trace.velocity_unit,
        notes=tuple(notes),
        table=seen.tests,
    )


def _last_slip(trace: Trace, slips: Slips) -> float:
    """Return the end of the last drop whose rate is that of a slip, compared with the
    rises before and after it; swings of a slider that comes to rest are slower.
    """
    t = trace.t
    rises = slips.loading_rates(t)
    after = np.append(rises[1:], -math.inf)
    falls = slips.drops[1:] / (t[slips.end[1:]] - t[slips.start[1:]])
    fast = np.flatnonzero(falls >= (1.0 / SLIP_PHASE - 1.0) * np.maximum(rises, after))
    return float(t[slips.end[fast[-1] + 1]]) if fast.size else math.nan


def _driven_by_force(trace: Trace) -> str:
    """Describe the motion of a slider driven by a force, which has no regime."""
    assert trace.rig is not None
    assert trace.X is not None
    middle = 0.5 * (trace.t[0] + trace.t[-1])
    way = abs(trace.X[-1] - trace.X[np.searchsorted(trace.t, middle)])
    # contacts may stretch by this length without sliding
    moves = "slides" if way > trace.rig.unit("length") else "rests"
    return f"the drive is a force, which prescribes no speed; the slider {moves}"


def _find_fault(trace: Trace, seen: Window) -> str:
    """Return why a window has no regime: a fault of the sensor, or a drive that is not
    constant; empty if it may have one.
    """
    if trace.rig is not None and trace.rig.drive.force:
        return _driven_by_force(trace)
    if trace.measured:
        if not trace.reading_step and not np.any(trace.force != trace.largest):
            return "the force never changes: is the sensor connected?"
        if not seen.are_slips and seen.reversed.is_stick_slip:
            return FALLS_SLOWLY
    elif trace.drive is None or not trace.drive.any():
        return "the drive stands still"
    elif np.ptp(trace.drive) > 2.0 * CONSTANT_DRIVE * np.max(np.abs(trace.drive)):
        return (
            "the velocity of the drive changes: use transitions(), or "
            "data.sel(time=slice(from, to))"
        )
    return ""
