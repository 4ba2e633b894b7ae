"""The regime of motion under a constant drive."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import xarray as xr

from stickslip.errors import InputError, number
from stickslip.measure.arrays import CONSTANT_DRIVE, FEWEST_READINGS, Array, Trace
from stickslip.measure.slips import FEWEST_CYCLES, Slips, find_slips, has_beat, spread_of

Kind = Literal["smooth sliding", "stick-slip", "small oscillation", "undecided"]

# Numbers that decide. Each sits in a gap between the classes it parts, at N from 100 to 10 000: tests/test_measure.py.
LATE_SHARE = 0.4  # the last part of a run, in which its regime is judged
SLIP_VELOCITY = 3.5  # stick-slip: the slider peaks at this many times the drive's velocity or more ...
SLIP_SHARE = 0.25  # ... or, where only the force is known, falls take this share of the time or less
LONG_TRANSIENT = 50  # cycles: 40 to 100 x_s, in the model
STEADY = 0.05  # change of ln(drop) from the first half of the window to the second, beyond three standard errors
FEWEST_IN_A_FALL = 4  # samples, for the velocity of a slip to be seen
TINY = 0.02  # an oscillation below this share of the mean force is smooth sliding
SMALL = 0.10  # ... and one that shrinks, below this
MOST_NOISE = 0.6  # irregular fluctuation below this share of the mean force is contact noise


@dataclass(frozen=True, kw_only=True)
class Regime:
    """The regime of motion in a stretch of constant driving, with the evidence.

    Attributes
    ----------
    kind : {"smooth sliding", "stick-slip", "small oscillation", "undecided"}
        *Stick-slip*: slow loading and fast slips that last; in a typical cycle the slider reaches at least
        3.5 times the velocity of the drive (where only the force is known: the force falls for at most a
        quarter of the time). The slips may be irregular; `period_variation` says how much. *Small
        oscillation*: a sustained, regular cycle in which the slider stays slower than that. *Smooth sliding*:
        no oscillation, or noise of the contacts without a beat, or an oscillation below 2 % of the mean
        force, or one that shrinks and is below 10 %. *Undecided*: the evidence does not suffice, for the
        reason given.
    reason : str
        Why, in plain words.
    window : tuple of float
        Start and end of the stretch judged, in the unit of `t`.
    peak_to_peak, mean_force : float
        Of the driving force in the window.
    trend : float
        Ratio of the drops in the second half of the window to those in the first, from a straight line
        through their logarithms (of the spread of the force where there are too few cycles); 1 is steady.
    trend_error : float
        Standard error of ``ln(trend)``; NaN where it is not known.
    cycles : int
        Complete falls of the force in the window.
    period, period_variation : float
        Mean time from one fall to the next, and its coefficient of variation; NaN with too few cycles.
    drop, drop_variation : float
        Mean fall, and its coefficient of variation.
    fall_share : float
        Share of the time in which the force falls: .5 for a sine, near 0 for a sawtooth.
    noise : float
        Standard deviation of the noise from sample to sample, in the unit of the force.
    drive_velocity : float or None
        Mean velocity of the drive in the window; None where it is not known.
    peak_velocity : float or None
        Largest slider velocity in a typical (median) cycle, over the drive's velocity.
    largest_velocity : float or None
        Largest slider velocity in the window, over the drive's velocity.
    attached_swing : float or None
        Largest less smallest fraction of attached contacts.
    time_unit, force_unit : str
        Units of the times and the forces above; empty where the data do not say.
    """

    kind: Kind
    reason: str
    window: tuple[float, float]
    peak_to_peak: float
    mean_force: float
    trend: float
    trend_error: float
    cycles: int
    period: float
    period_variation: float
    drop: float
    drop_variation: float
    fall_share: float
    noise: float
    drive_velocity: float | None = None
    peak_velocity: float | None = None
    largest_velocity: float | None = None
    attached_swing: float | None = None
    time_unit: str = ""
    force_unit: str = ""

    def __str__(self) -> str:
        begin, end = self.window
        time = {"": "", "time": " time units"}.get(self.time_unit, f" {self.time_unit}")
        force = f" {self.force_unit}".rstrip()
        lines = [
            f"{self.kind}: {self.reason}",
            f"judged at t = {begin:.4g} to {end:.4g}{time}; force {self.mean_force:.4g}{force} on average, "
            f"peak to peak {self.peak_to_peak:.3g}{force}, noise {self.noise:.2g}{force}",
        ]
        if self.cycles:
            line = f"{self.cycles} cycles, drop {self.drop:.3g}{force} (variation {self.drop_variation:.2g})"
            if math.isfinite(self.period):
                line += (
                    f", period {self.period:.4g}{time} (variation {self.period_variation:.2g}), "
                    f"force falling {100 * self.fall_share:.0f} % of the time"
                )
            lines.append(line)
        if math.isfinite(self.trend):
            lines.append(f"second half of the window over the first: {self.trend:.3g}")
        if self.largest_velocity is not None:
            lines.append(f"largest velocity {self.largest_velocity:.3g} times the drive's")
        return "\n".join(lines)


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
        constant driving, or the last 80 % if the last 40 % hold fewer than five falls; for a trace of the
        force alone, everything after the first loading.

    Returns
    -------
    Regime
        What the kinds mean is told there.

    Raises
    ------
    InputError
        If the data hold no force, or values that are not finite, or nothing lies after `after`.
    """
    seen = _over_the_window(Trace.of(data), after)
    unit = {name: str(data[name].attrs.get("units", "")) for name in ("t", "F_d")}
    return replace(seen, time_unit=unit["t"], force_unit=unit["F_d"])


def _over_the_window(trace: Trace, after: float | None) -> Regime:
    """Choose the window, and judge it."""
    if after is not None:
        begin = number("after", after, hint="a time, in the unit of t")
        if np.count_nonzero(trace.t >= begin) < FEWEST_READINGS:
            raise InputError(
                f"after = {begin:g}: fewer than {FEWEST_READINGS} samples lie after it; the data end at "
                f"t = {trace.t[-1]:g}"
            )
        return _judge(trace.part(begin))
    steady = _constant_drive(trace)
    if steady is None:
        return _judge(trace)
    if trace.drive is None:
        loaded = trace.part(_first_loading(trace))
        return _judge(loaded if loaded.t.size >= FEWEST_READINGS else trace)
    begin, end = trace.t[steady], trace.t[-1]
    late = trace.part(end - LATE_SHARE * (end - begin))
    if late.t.size < FEWEST_READINGS or find_slips(late).peak.size <= FEWEST_CYCLES:
        longer = trace.part(end - 2 * LATE_SHARE * (end - begin))
        if late.t.size < FEWEST_READINGS or 0 < find_slips(late).peak.size < find_slips(longer).peak.size:
            late = longer
    return _with_caution(_judge(late), end - begin)


def _with_caution(result: Regime, lasted: float) -> Regime:
    """Say so where an oscillation has had less time than a transient can take."""
    if result.kind not in ("stick-slip", "small oscillation") or lasted >= LONG_TRANSIENT * result.period:
        return result
    caution = (
        f"the drive had lasted {lasted / result.period:.0f} cycles; a transient can last {LONG_TRANSIENT} and more"
    )
    return replace(result, reason=f"{result.reason} ({caution})")


def _constant_drive(trace: Trace) -> int | None:
    """Index at which the last stretch of constant driving starts; None if the drive changes up to the end."""
    if trace.drive is None:
        return 0
    last = trace.drive[-1]
    differs = np.flatnonzero(np.abs(trace.drive - last) > CONSTANT_DRIVE * abs(last))
    first = int(differs[-1]) + 1 if differs.size else 0
    return first if trace.t.size - first >= max(FEWEST_READINGS, 0.05 * trace.t.size) else None


def _first_loading(trace: Trace) -> float:
    """Time at which the force first reaches its usual level."""
    usual = float(np.median(trace.force[trace.force.size // 2 :]))
    return float(trace.t[int(np.argmax(trace.force >= usual))])


def _judge(trace: Trace) -> Regime:
    """Weigh the evidence in a window."""
    t, force = trace.t, trace.force
    found = find_slips(trace)
    drops = found.drops(trace)
    periods = spread_of(np.diff(t[found.peak]))
    drop = spread_of(drops)
    trend, trend_error = _trend(trace, found, drops)
    drive = None if trace.drive is None else float(trace.drive.mean())
    peak_velocity = largest = None
    if trace.velocity is not None and drive:
        largest = float(trace.velocity.max()) / drive
        peak_velocity = largest
        if found.peak.size:
            fastest = [trace.velocity[i : j + 1].max() for i, j in zip(found.peak, found.trough, strict=True)]
            peak_velocity = float(np.median(fastest)) / drive
    evidence = Regime(
        kind="undecided",
        reason="",
        window=(float(t[0]), float(t[-1])),
        peak_to_peak=float(np.ptp(force)),
        mean_force=trace.sign * float(force.mean()),
        trend=trend,
        trend_error=trend_error,
        cycles=int(found.peak.size),
        period=periods.mean,
        period_variation=periods.variation,
        drop=drop.mean,
        drop_variation=drop.variation,
        fall_share=found.fall_share(trace),
        noise=found.noise,
        drive_velocity=None if drive is None else trace.sign * drive,
        peak_velocity=peak_velocity,
        largest_velocity=largest,
        attached_swing=None if trace.attached is None else float(np.ptp(trace.attached)),
    )
    kind, reason = _verdict(trace, found, evidence)
    return replace(evidence, kind=kind, reason=reason)


def _trend(trace: Trace, found: Slips, drops: Array) -> tuple[float, float]:
    """Drops in the second half of the window over those in the first, and the standard error of its logarithm."""
    span = trace.t[-1] - trace.t[0]
    if drops.size >= FEWEST_CYCLES:
        at = trace.t[found.peak]
        at = (at - at.mean()) / span
        size = np.log(drops)
        slope = float(at @ size / (at @ at))
        rest = size - size.mean() - slope * at
        power = float(rest @ rest)
        # Slow wandering of the drops (few contacts, or a boundary near by) makes them worth fewer independent ones.
        memory = min(max(float(rest[1:] @ rest[:-1]) / power, 0.0), 0.9) if power > 0 else 0.0
        error = math.sqrt(power / (drops.size - 2) / float(at @ at) * (1 + memory) / (1 - memory))
        return math.exp(0.5 * slope), 0.5 * error
    half = trace.force.size // 2
    first, second = float(trace.force[:half].std()), float(trace.force[half:].std())
    return (second / first if first > 0 else math.nan), math.nan


def _verdict(trace: Trace, found: Slips, seen: Regime) -> tuple[Kind, str]:
    """Kind and reason; `seen` is the evidence."""
    objection = _about_the_drive(trace)
    if objection:
        return "undecided", objection
    if found.peak.size == 0:
        return _without_falls(trace, found, seen)
    mean = abs(seen.mean_force)
    # Samples that step over a slip miss its velocity; the share of the time that falls take is then a safer witness.
    coarse = float(np.median(found.trough - found.peak)) < FEWEST_IN_A_FALL
    if seen.peak_velocity is not None and (seen.peak_velocity >= SLIP_VELOCITY or not coarse):
        slips = seen.peak_velocity >= SLIP_VELOCITY
        how = f"the slider reaches {seen.peak_velocity:.3g} times the velocity of the drive in a typical cycle"
    else:
        slips = seen.fall_share <= SLIP_SHARE
        how = f"the force falls for {100 * seen.fall_share:.0f} % of the time"
    relative = f"{100 * seen.peak_to_peak / mean:.3g} % of the mean force" if mean else "of a mean force of 0"
    if found.peak.size < FEWEST_CYCLES:
        if not slips and seen.peak_to_peak < TINY * mean:
            return "smooth sliding", f"the force swings by {relative}"
        few = f"{found.peak.size} complete fall{'s' if found.peak.size > 1 else ''} of the force"
        return "undecided", f"too short: {few} in the window; a verdict needs {FEWEST_CYCLES}"
    beat = has_beat(trace, found)
    change, allowed = math.log(seen.trend), STEADY + 3.0 * seen.trend_error
    if beat:  # regular cycles tell their trend at once; a large error is no leave to drift
        allowed = min(allowed, 2.0 * STEADY)
    if change < -allowed:
        second = float(np.ptp(trace.force[trace.force.size // 2 :]))
        shrinks = f"the oscillation shrinks, by a factor {seen.trend:.2g} from one half of the window to the other"
        if not slips and second < SMALL * mean:
            return (
                "smooth sliding",
                f"{shrinks}, and is down to {100 * second / mean:.3g} % of the mean force",
            )
        return "undecided", f"{shrinks}; a longer run would tell whether it dies"
    if slips and (beat or seen.fall_share <= SLIP_SHARE):
        manner = "regular" if beat else "irregular"
        growth = "; the slips still grow" if change > allowed else ""
        return "stick-slip", f"{manner} slips that last: {how}{growth}"
    if change > allowed:
        return (
            "undecided",
            f"the oscillation still grows, by a factor {seen.trend:.2g} between the halves of the window",
        )
    if seen.peak_to_peak < TINY * mean:
        return "smooth sliding", f"the force swings by {relative}"
    if coarse:
        return "undecided", f"falls of {relative} last fewer than {FEWEST_IN_A_FALL} samples: record more often"
    if beat:
        return "small oscillation", f"a sustained regular cycle of {relative}, without fast slips: {how}"
    if seen.peak_to_peak < MOST_NOISE * mean:
        return "smooth sliding", f"the force wavers by {relative}, without a beat and without fast slips"
    return "undecided", f"irregular swings of {relative} that are neither slips nor small: {how}"


def _about_the_drive(trace: Trace) -> str:
    """What forbids a verdict, or nothing."""
    if trace.drive is None:
        return ""
    low, high = float(trace.drive.min()), float(trace.drive.max())
    if high == low == 0.0:
        return "the drive stands still"
    if high - low > 2.0 * CONSTANT_DRIVE * max(abs(low), abs(high)):
        return (
            f"the velocity of the drive goes through {low:.3g} to {high:.3g}; the regime is judged at constant "
            "velocity: use transitions(), or select a stretch with data.sel(t=slice(from, to))"
        )
    return ""


def _without_falls(trace: Trace, found: Slips, seen: Regime) -> tuple[Kind, str]:
    """Verdict where no fall of the force stands out."""
    mean, swing = abs(seen.mean_force), seen.peak_to_peak
    if swing == 0.0 and trace.drive is None:
        return "undecided", "the force never changes: is the sensor connected?"
    if swing < TINY * mean:
        return "smooth sliding", f"the force swings by {100 * swing / mean:.3g} % of its mean"
    if found.dismissed:
        relative = f"the force wavers by {100 * swing / mean:.3g} % of its mean, without a beat and without fast slips"
        if mean == 0 and swing == 0:
        return "undecided", "the force is 0 throughout"
    if swing > MOST_NOISE * mean:
            return "undecided", f"{relative}: too much for noise, and no stick-slip"
        second = float(np.ptp(trace.force[trace.force.size // 2 :]))
        if seen.trend > 3 or (seen.trend < 1 / 3 and second > SMALL * mean):
            return "undecided", f"{relative}, and changes by a factor {seen.trend:.2g} between the halves of the window"
        return "smooth sliding", f"{relative}: noise of the contacts"
    slope = np.polyfit(trace.t, trace.force, 1)[0]
    drift = float(slope * (trace.t[-1] - trace.t[0]))
    if abs(drift) > 0.5 * swing and abs(drift) > 2.0 * found.smallest:
        return (
            "undecided",
            f"the force {'rises' if drift > 0 else 'falls'} by {abs(drift):.3g} and shows no complete slip",
        )
    if swing > 2.0 * found.smallest and swing > SMALL * mean:
        return "undecided", "too short: the force swings, but shows no complete fall in the window"
    if mean == 0 and swing == 0:
        return "undecided", "the force is 0 throughout"
    if swing > MOST_NOISE * mean:
        return (
            "undecided",
            f"noise of {swing:.3g} about a mean force of {mean:.3g} hides what there is: record more often",
        )
    return (
        "smooth sliding",
        f"the force shows noise only, {100 * swing / mean:.3g} % of its mean",
    )
