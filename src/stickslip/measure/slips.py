"""Slips: the falls of a force that stand out, and their statistics."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip.errors import InputError, number
from stickslip.measure.arrays import Array, Trace, turns

# Numbers that decide.
SMALLEST_SHARE_OF_DROP = 0.1  # a fall below this share of the typical fall is not a slip of its own
LARGEST_REBOUND = 0.8  # ringing decays: a rebound comes back by less than this share of the fall before it
RINGING_SPEED = 3.0  # a rebound faster than this many times the usual loading is ringing (force only)
FALL_SHARE_OF_SLIPS = 0.35  # falls that take more of the time than this, and have no beat, are noise
FEWEST_CYCLES = 4  # complete falls needed to speak of a beat
REGULAR_PERIOD, REGULAR_DROP = 0.15, 0.25  # relative spreads below which cycles have a beat
EDGE = 0.05  # a slip starts and ends within this share of its drop from the peak and from the trough


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Mean and sample standard deviation of a quantity over the events, in the unit of the quantity."""

    mean: float
    spread: float

    @property
    def variation(self) -> float:
        """Coefficient of variation: spread over mean."""
        return self.spread / abs(self.mean) if self.mean else math.nan

    def __str__(self) -> str:
        return f"{self.mean:.4g} ± {self.spread:.2g}"


@dataclass(frozen=True, kw_only=True)
class EventStatistics:
    """Statistics of a catalogue of slips.

    Attributes
    ----------
    count : int
        Number of slips.
    drop, force_before, force_after : Spread
        Fall of the force in a slip, and the force at its peak and at its trough; NaN without events.
    duration, recurrence : Spread
        Time a slip takes, and time from the start of one to the start of the next.
    loading_rate : Spread
        Rise of the force per time between slips.
    slip, peak_velocity : Spread or None
        Slip length and largest slider velocity; None where the data hold the force only.
    """

    count: int
    drop: Spread
    force_before: Spread
    force_after: Spread
    duration: Spread
    recurrence: Spread
    loading_rate: Spread
    slip: Spread | None = None
    peak_velocity: Spread | None = None

    def __str__(self) -> str:
        lines = [f"{self.count} events"]
        for name in (
            "drop", "force_before", "force_after", "duration", "recurrence", "loading_rate", "slip", "peak_velocity"
        ):  # fmt: skip
            value: Spread | None = getattr(self, name)
            if value is not None and math.isfinite(value.mean):
                lines.append(f"{name.replace('_', ' ')}: {value} (variation {value.variation:.2f})")
        return "\n".join(lines)


def events(data: xr.Dataset, *, minimum_drop: float | None = None) -> xr.Dataset:
    """Return one row per slip, a slip being a fall of the driving force that stands out.

    Peaks and troughs alternate such that every fall and every rise between them is at least `minimum_drop`.
    Falls that belong to the ringing after a slip are joined to it: the slider turned back before them (or,
    where only the force is known, the force came back more than 3 times faster than it usually rises) by less
    than .8 of the fall. A fall cut off by the start or the end of the data is left out and counted in the
    attribute ``cut``.

    Parameters
    ----------
    data : Dataset
        A run or a measured trace.
    minimum_drop : float, optional
        Smallest fall that counts, in the unit of `F_d`. By default the larger of (a) the fall that the noise
        from sample to sample could show by chance in so many samples, and (b) a tenth of the typical fall
        (the median, weighted by the squares of the falls). By default, too, falls without a beat that take as
        long as the rises are taken for noise of the contacts, and none is returned; the attribute
        ``criterion`` says so.

    Returns
    -------
    Dataset
        Along ``event``: `start` and `end` (the times at which the force leaves its peak and reaches its
        trough, to 5 % of the drop), `force_before`, `force_after`, `drop`, `duration`, `recurrence` (since
        the previous start; NaN for the first), and, where the data hold them, `slip` (distance between start
        and end) and `peak_velocity`. Attributes ``minimum_drop``, ``noise``, ``criterion``, ``cut``.

    Raises
    ------
    InputError
        If the data hold no force, or values that are not finite.
    """
    trace = Trace.of(data)
    if minimum_drop is None:
        found = find_slips(trace)
    else:
        smallest = number("minimum_drop", minimum_drop, above=0, hint="in the unit of F_d")
        found = _joined(trace, smallest, "falls of at least the minimum_drop given", noise=_noise(trace.force))
    return _table(data, trace, found)


def event_statistics(catalogue: xr.Dataset) -> EventStatistics:
    """Return the statistics of a catalogue made by `events`."""
    if "drop" not in catalogue or "recurrence" not in catalogue:
        raise InputError("event_statistics: this Dataset is no catalogue of events; make one with events(data)")

    def spread(name: str) -> Spread:
        return spread_of(np.asarray(catalogue[name].values, dtype=float))

    start, end, before, after = (
        np.asarray(catalogue[name].values, dtype=float) for name in ("start", "end", "force_before", "force_after")
    )
    return EventStatistics(
        count=int(catalogue.sizes["event"]),
        drop=spread("drop"),
        force_before=spread("force_before"),
        force_after=spread("force_after"),
        duration=spread("duration"),
        recurrence=spread("recurrence"),
        loading_rate=spread_of((before[1:] - after[:-1]) / (start[1:] - end[:-1])),
        slip=spread("slip") if "slip" in catalogue else None,
        peak_velocity=spread("peak_velocity") if "peak_velocity" in catalogue else None,
    )


@dataclass(frozen=True, kw_only=True)
class Slips:
    """Indices of the peak and the trough of each slip, and how they were found."""

    peak: NDArray[np.intp]
    trough: NDArray[np.intp]
    smallest: float
    noise: float
    criterion: str
    cut: int = 0
    dismissed: int = 0  # falls taken for noise of the contacts

    def drops(self, trace: Trace) -> Array:
        """Fall of the force in each slip."""
        return np.asarray(trace.force[self.peak] - trace.force[self.trough])

    def fall_share(self, trace: Trace) -> float:
        """Time in falls over the time from the first peak to the last."""
        if self.peak.size < 2:
            return math.nan
        fall = trace.t[self.trough[:-1]] - trace.t[self.peak[:-1]]
        return float(fall.sum() / (trace.t[self.peak[-1]] - trace.t[self.peak[0]]))


def _noise(force: Array) -> float:
    """Standard deviation of white noise on a smooth trace, from second differences; slips do not disturb it."""
    bend = np.abs(np.diff(force, 2))
    return float(np.median(bend) / 0.6745 / math.sqrt(6.0))


def _quantum(force: Array) -> float:
    """Step in which a trace was recorded, or 0 if its values lie on no coarse grid."""
    force = force[:: max(1, force.size // 50_000)]
    values = np.unique(force)
    if values.size < 2 or values.size > force.size // 2:
        return 0.0
    step = float(np.min(np.diff(values)))
    count = (values - values[0]) / step
    return step if bool(np.all(np.abs(count - np.round(count)) < 0.1)) else 0.0


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def _chance_fall(force: Array, noise: float) -> float:
    """Fall that noise alone may show somewhere among so many samples, with a tenth to spare."""
    return 2.2 * math.sqrt(2.0 * math.log(force.size)) * noise


def find_slips(trace: Trace) -> Slips:
    """Slips by a threshold that comes from the data: above noise, and not small beside the typical fall."""
    force = trace.force
    noise = _noise(force)
    rounding = 1e-7 * float(np.max(np.abs(force)))
    by_chance = max(_chance_fall(force, noise), 2.5 * _quantum(force), rounding, 1e-300)
    peaks, troughs = turns(force, by_chance)
    falls = force[peaks] - force[troughs]
    if falls.size == 0:
        none = np.empty(0, dtype=np.intp)
        criterion = f"no fall exceeds what the noise ({noise:.2g}) could show by chance ({by_chance:.3g})"
        return Slips(peak=none, trough=none, smallest=by_chance, noise=noise, criterion=criterion)
    smallest = max(by_chance, SMALLEST_SHARE_OF_DROP * _weighted_median(falls, falls**2))
    criterion = (
        f"falls of at least {smallest:.3g}: {SMALLEST_SHARE_OF_DROP:g} of the typical fall, and above "
        f"{by_chance:.2g}, which the noise ({noise:.2g}) could show by chance"
    )
    found = _joined(trace, smallest, criterion, noise=noise)
    share = _typical_share(trace, found)
    if share <= FALL_SHARE_OF_SLIPS or has_beat(trace, found):
        return found
    return replace(
        found,
        peak=found.peak[:0],
        trough=found.trough[:0],
        dismissed=found.peak.size,
        criterion=f"no slips: {found.peak.size} {criterion}, but without a beat, and falling takes {100 * share:.0f} % "
        "of the time: noise of the contacts",
    )


def _typical_share(trace: Trace, found: Slips) -> float:
    """Time of a fall over that of the fall and the rise before it: median, weighted by the squares of the falls."""
    if found.peak.size == 0:
        return 0.0
    fall = trace.t[found.trough] - trace.t[found.peak]
    rise = trace.t[found.peak] - np.append(trace.t[0], trace.t[found.trough[:-1]])
    return _weighted_median(fall / (fall + rise), found.drops(trace) ** 2)


def has_beat(trace: Trace, found: Slips) -> bool:
    """Whether the falls come at even times and are about equal, a steady growth or decay left aside."""
    if found.peak.size < FEWEST_CYCLES:
        return False
    at, size = trace.t[found.peak], np.log(found.drops(trace))
    rest = size - np.polyval(np.polyfit(at - at[0], size, 1), at - at[0])  # a beat may grow or die away
    return spread_of(np.diff(at)).variation < REGULAR_PERIOD and float(rest.std()) < REGULAR_DROP


def _joined(trace: Trace, smallest: float, criterion: str, *, noise: float) -> Slips:
    """Falls of at least `smallest`, those of the ringing joined to their slip, those cut off at the ends left out."""
    t, force = trace.t, trace.force
    peaks, troughs = turns(force, smallest)
    rates = np.diff(force) / np.diff(t)
    rising = rates[rates > 0]
    usual = float(np.median(rising)) if rising.size else math.inf
    joined: list[list[int]] = []  # peak, trough, trough of the fall last joined
    for peak, trough in zip(peaks, troughs, strict=True):
        if joined:
            first, lowest, last = joined[-1]
            rebound = force[peak] - force[last]
            if rebound < LARGEST_REBOUND * (force[first] - force[lowest]):
                if trace.X is not None:
                    # Ringing throws the slider back; loading moves the drive on. After a slip that overshot, one rise
                    # holds both: it is ringing only if the slider gave way by more than the drive took up.
                    speed = 0.0 if trace.drive is None else abs(float(trace.drive[peak]))
                    back = trace.X[last] - trace.X[peak] >= speed * (t[peak] - t[last])
                else:
                    back = rebound > RINGING_SPEED * usual * (t[peak] - t[last])
                if back:
                    if force[trough] < force[lowest]:
                        joined[-1][1] = trough
                    joined[-1][2] = trough
                    continue
        joined.append([peak, trough, trough])
    whole = [pair for pair in joined if pair[0] > 0 and pair[1] < force.size - 1]
    return Slips(
        peak=np.array([pair[0] for pair in whole], dtype=np.intp),
        trough=np.array([pair[1] for pair in whole], dtype=np.intp),
        smallest=smallest,
        noise=noise,
        criterion=criterion,
        cut=len(joined) - len(whole),
    )


def spread_of(values: Array) -> Spread:
    """Mean and standard deviation of the values that are known."""
    kept = values[np.isfinite(values)]
    if kept.size == 0:
        return Spread(mean=math.nan, spread=math.nan)
    return Spread(mean=float(kept.mean()), spread=float(kept.std(ddof=1)) if kept.size > 1 else math.nan)


def _edges(trace: Trace, found: Slips) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Last sample near each peak and first sample near its trough, to a share of the drop."""
    start, end = found.peak.copy(), found.trough.copy()
    for i, (peak, trough) in enumerate(zip(found.peak, found.trough, strict=True)):
        fall = trace.force[peak : trough + 1]
        margin = EDGE * (fall[0] - fall[-1])
        end[i] = peak + int(np.argmax(fall <= fall[-1] + margin))
        start[i] = peak + int(np.flatnonzero(fall[: end[i] - peak] >= fall[0] - margin)[-1])
    return start, end


def _table(data: xr.Dataset, trace: Trace, found: Slips) -> xr.Dataset:
    start, end = _edges(trace, found)
    time_unit = str(data["t"].attrs.get("units", ""))
    force_unit = str(data["F_d"].attrs.get("units", ""))
    before, after = trace.force[found.peak], trace.force[found.trough]
    columns: dict[str, tuple[Array, str, str]] = {
        "start": (trace.t[start], time_unit, "time at which the slip starts"),
        "end": (trace.t[end], time_unit, "time at which the slip ends"),
        "force_before": (trace.sign * before, force_unit, "driving force before the slip (peak)"),
        "force_after": (trace.sign * after, force_unit, "driving force after the slip (trough)"),
        "drop": (before - after, force_unit, "fall of the driving force in the slip"),
        "duration": (trace.t[end] - trace.t[start], time_unit, "duration of the slip"),
        "recurrence": (
            np.diff(trace.t[start], prepend=math.nan) if start.size else np.empty(0),
            time_unit,
            "time since the start of the slip before",
        ),
    }
    if trace.X is not None:
        unit = str(data["X"].attrs.get("units", ""))
        columns["slip"] = (trace.X[end] - trace.X[start], unit, "distance slipped")
    if trace.velocity is not None:
        unit = str(data["velocity"].attrs.get("units", ""))
        peaks = [float(trace.velocity[i : j + 1].max()) for i, j in zip(found.peak, found.trough, strict=True)]
        columns["peak_velocity"] = (np.array(peaks, dtype=float), unit, "largest slider velocity in the slip")
    return xr.Dataset(
        {
            name: ("event", np.asarray(values), {"units": unit, "long_name": words})
            for name, (values, unit, words) in columns.items()
        },
        coords={"event": ("event", np.arange(start.size), {"long_name": "number of the slip"})},
        attrs={
            "minimum_drop": found.smallest,
            "noise": found.noise,
            "criterion": found.criterion,
            "cut": found.cut,
        },
    )
