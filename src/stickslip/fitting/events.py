"""The slips of a measured trace, in the form that a fit needs, and the traces that a
fit refuses, with the number that decided.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from stickslip.answers import Answer
from stickslip.arrays import labelled
from stickslip.errors import InputError, dataset, instance, number
from stickslip.fitting.model import FLOOR, SLIPS
from stickslip.fitting.summary import FITTED, comparable, resampled, statistics
from stickslip.measure.sensor import note_saturation, resolution, white_noise
from stickslip.measure.slips import pick, weighted_median
from stickslip.measure.trace import Array, Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Smallest drop that counts, in standard deviations of the noise and in steps of the
# recording.
_NOISES = 6.0
_STEPS = 3.0
FEWEST = 30  # slips that a fit needs
LARGEST_DROP = 0.10  # largest `minimum_drop` of a fit, over the peak
# Most slips of a part of a trace: a fifth of those of a simulated series may be too
# small to be seen.
MOST_SLIPS = int(SLIPS / 1.25)
# On a plateau, the number of slips changes by at most the fraction `LOST` while the
# smallest drop is raised by this factor.
PLATEAU = 2.0
LOST = 0.1
_FINER = 2.0**0.25  # factor between the smallest drops that are tried
RESOLVED = 5.0  # fewest samples of a resolved slip
# Limits beyond which a trace is refused, or a note is given (`_CLEAR_SAWTOOTH`,
# `_MOST_DRIFT`); conventions.
_FEWEST_SAMPLES = 20.0  # from slip to slip
_LONGEST_GAP = 4  # missing samples
_LARGEST_NOISE = 0.03  # over the mean peak
_LEAST_SAWTOOTH = 1.5  # time of a rise over that of a drop
_CLEAR_SAWTOOTH = 4.0
_MOST_DRIFT = 0.2  # of the loading rate, relative
_STEP = 2.0  # factor by which the loading rate changes
_LOAD_CHANGE = 0.05  # of the normal load, relative
_DIFFERENT = 3.0  # standard errors between the halves of a trace
_LEAST_ERROR = 0.02  # smallest standard error in that comparison


@dataclass(frozen=True, kw_only=True, repr=False)
class Events(Answer):
    """The slips of a trace. It prints as its short text."""

    time: Array  #: times of the trace
    force: Array  #: force of the trace, positive along the drive
    peak_at: Any  #: indices of the force before each slip
    trough_at: Any  #: indices of the force after each slip
    smallest: float  #: smallest drop that counts
    noise: float  #: standard deviation, from sample to sample
    resolution: float  #: step of the recording; 0 if there is none
    doubled: int  #: number of slips of at least twice `smallest`
    gap: int = 0  #: longest run of samples that are missing or interpolated
    force_unit: str = ""  #: empty if the trace has none
    time_unit: str = ""
    source: str = ""
    #: largest change of the normal load over its mean; 0 if it is not known
    load_change: float = 0.0

    peaks: Array = field(init=False)  #: force before each slip
    troughs: Array = field(init=False)  #: force after each slip
    drops: Array = field(init=False)  #: drop of the force in each slip
    #: rise of the force per time from each trough to the peak after it
    slopes: Array = field(init=False)
    #: mean force before a slip, with which other forces are compared
    mean_peak: float = field(init=False)
    step: float = field(init=False)  #: median time from sample to sample
    recurrence: float = field(init=False)  #: mean time from slip to slip
    samples_per_period: float = field(init=False)  #: mean recurrence in samples
    #: median time of a drop in samples; below 5 it is not resolved
    slip_samples: float = field(init=False)
    #: mean time of a rise over that of a drop: 1 for a sine, 10 for stick-slip
    sawtooth: float = field(init=False)
    #: median rise of the force per time between slips
    loading_rate: float = field(init=False)
    #: median loading rate in the last third of the slips over that in the first
    drift: float = field(init=False)
    #: relative error of the loading rate: half of its drift
    rate_error: float = field(init=False)

    def __post_init__(self) -> None:
        t = self.time
        begins = self.peak_at
        ends = self.trough_at
        peaks, troughs = (self.force[at] for at in (begins, ends))
        rising = t[begins[1:]] - t[ends[:-1]]
        step = np.median(np.diff(t))
        recurrence = np.diff(t[begins]).mean()
        slopes = (peaks[1:] - troughs[:-1]) / rising
        third = max(len(slopes) // 3, 1)
        rate = float(np.median(slopes))
        first = float(np.median(slopes[:third]))
        last = float(np.median(slopes[-third:]))
        vars(self).update(
            peaks=peaks,
            troughs=troughs,
            drops=peaks - troughs,
            slopes=slopes,
            mean_peak=float(peaks.mean()),
            step=float(step),
            recurrence=float(recurrence),
            samples_per_period=float(recurrence / step),
            slip_samples=float(np.median(ends - begins)),
            sawtooth=float(rising.mean() / (t[ends] - t[begins]).mean()),
            loading_rate=rate,
            drift=last / first,
            rate_error=abs(last - first) / 2.0 / rate,
        )

    def __len__(self) -> int:
        return len(self.peak_at)

    @property
    def stretches(self) -> int:
        """Number of parts into which the slips are divided, so that each has no more
        slips than a simulated series.
        """
        return -(-len(self) // MOST_SLIPS)

    @property
    def statistics(self) -> Array:
        """Statistics of the slips, averaged over their parts, in the order of
        `fitting.summary.NAMES`.
        """
        each = len(self) // self.stretches
        series = (
            x[: each * self.stretches].reshape(-1, each)
            for x in (self.peaks, self.troughs)
        )
        return np.asarray(statistics(*series).mean(axis=0))

    def part(self, begin: int, end: int) -> Events:
        """Return the slips from number `begin` to before `end`."""
        return replace(
            self,
            peak_at=self.peak_at[begin:end],
            trough_at=self.trough_at[begin:end],
        )

    def __str__(self) -> str:
        f = self.force_unit
        t = self.time_unit
        low, high = (
            with_unit(value, f) for value in (self.smallest, PLATEAU * self.smallest)
        )
        noise, step = (
            with_unit(value, f, 2) for value in (self.noise, self.resolution)
        )
        peak, trough = (
            f"{x.mean():.4g} ± {with_unit(x.std(), f)}"
            for x in (self.peaks, self.troughs)
        )
        scatter = self.drops.std() / self.drops.mean()
        rate = with_unit(self.loading_rate, f)
        return (
            f"{len(self)} slips of at least {low} ({self.doubled} of at least {high})\n"
            f"peak {peak}, trough {trough}, drop {with_unit(self.drops.mean(), f)} (CV "
            f"{scatter:.2f}), "
            f"every {with_unit(self.recurrence, t)}\n"
            f"loading rate {rate}{f'/{t}' if t else ' per time unit'}, last third over "
            f"first {self.drift:.2f}; "
            f"noise {noise}, resolution {step}\n"
            f"{self.samples_per_period:.3g} samples from slip to slip, "
            f"{self.slip_samples:.2g} in a slip; "
            f"rises last {self.sawtooth:.3g} times as long as drops"
        )

    def to_dataset(self) -> xr.Dataset:
        """Return a Dataset of the slips, along ``slip``, and the trace, along
        ``time``.
        """
        f = self.force_unit
        t = self.time_unit
        of_slips = {
            "peak": (self.peaks, f, "force before the slip"),
            "trough": (self.troughs, f, "force after the slip"),
            "drop": (self.drops, f, "force drop"),
            "peak_time": (self.time[self.peak_at], t, "time of the slip"),
            "trough_time": (self.time[self.trough_at], t, "end of the slip"),
            "loading_rate": (
                np.append(np.nan, self.slopes),
                f"{f}/{t}" if t else f,
                "loading rate before the slip",
            ),
        }
        found = {
            name: labelled(title, "slip", x, unit)
            for name, (x, unit, title) in of_slips.items()
        }
        found["spring_force"] = labelled("force", "time", self.force, f)
        return xr.Dataset(
            found,
            {"time": labelled("time", "time", self.time, t)},
            {
                "source": self.source,
                "smallest": self.smallest,
                "noise": self.noise,
            },
        )

    def plot(self) -> Figure:
        """Draw the trace, the distribution of drops, peaks against troughs, and the
        loading rate along the run.
        """
        from stickslip import plot

        return plot.slips(self.to_dataset())


def pick_events(
    trace: xr.Dataset, *, minimum_drop: float | None = None, after: float | None = None
) -> Events:
    """Return the slips of a trace: peaks and troughs of its force, found by hysteresis.

    The trace holds `spring_force` along `time`, as `stickslip.read_trace` and
    `stickslip.simulate` return; `minimum_drop` is the smallest drop that counts,
    `after` a time before which slips are left out.

    By default, a drop must exceed six standard deviations of the noise, three steps of
    the recording, and a hundredth of the peak. If there is a larger range of smallest
    drops in which doubling it hardly changes the number of slips, the start of the
    widest such range is used. The first slip, before which the force rises from rest,
    is left out, as is one that the end cuts off. A rise much faster than the loading
    belongs to the slip before it: the slider rings.

    Examples
    --------
    >>> from stickslip.fitting import pick_events
    >>> saw = 10.0 + np.tile(np.linspace(-2.0, 2.0, 50), 40)
    >>> trace = xr.Dataset(
    ...     {"spring_force": ("time", saw)}, coords={"time": 0.1 * np.arange(saw.size)}
    ... )
    >>> found = pick_events(trace)
    >>> len(found), float(found.drops.mean()), round(found.recurrence, 3)
    (38, 4.0, 5.0)
    """
    dataset("fit: trace", trace, "a Dataset, such as read_trace() returns")
    kept = (
        trace if after is None else trace.sel(time=slice(number("after", after), None))
    )
    read = Trace.of(kept)
    force = np.ascontiguousarray(read.force)
    noise = white_noise(force)
    step = resolution(force)
    height = float(np.quantile(force, 0.9))
    if not height > 0:
        raise InputError(
            f"fit: nine tenths of the force lie below {height:.3g}: it must act in one "
            "direction, and be 0 without load"
        )

    def picked(drop: float) -> tuple[Any, Any]:
        rise = least_rise(drop, noise)
        peaks, troughs = pick(read.t, force, drop, rise)
        first = 0 if after is not None else 1  # leave out the loading from rest
        if len(troughs) and force[troughs[-1] :].max() - force[troughs[-1]] < rise:
            peaks = peaks[:-1]
            troughs = troughs[:-1]
        return peaks[first:], troughs[first:]

    def on_a_plateau(drop: float) -> bool:
        return len(picked(PLATEAU * drop)[0]) >= (1.0 - LOST) * len(picked(drop)[0]) > 0

    if minimum_drop is None:
        least = max(_NOISES * noise, _STEPS * step, FLOOR * height)
        finer = range(1 + math.floor(math.log(LARGEST_DROP * height / least, _FINER)))
        plateaus = [
            list(drops)
            for flat, drops in groupby((least * _FINER**k for k in finer), on_a_plateau)
            if flat
        ]
        smallest = max(plateaus, key=len, default=[least])[0]
    else:
        smallest = number(
            "minimum_drop", minimum_drop, above=0, hint="drop that counts as a slip"
        )
    peaks, troughs = picked(smallest)
    if len(peaks) < 2:
        raise InputError(
            f"fit: {len(peaks)} drops of at least {smallest:.3g} (noise {noise:.2g}, "
            f"resolution {step:.2g}): "
            f"at least {FEWEST} slips are needed; stick-slip shows more, or "
            "--minimum-drop is too large"
        )
    steps = np.diff(read.t[~kept["filled"].values] if "filled" in kept else read.t)
    load = (
        np.asarray(kept["load"].values, dtype=float) if "load" in kept else np.ones(1)
    )
    return Events(
        time=read.t,
        force=force,
        peak_at=peaks,
        trough_at=troughs,
        smallest=float(smallest),
        noise=noise,
        resolution=step,
        doubled=len(picked(PLATEAU * smallest)[0]),
        gap=round(float(steps.max() / np.median(steps))) - 1,
        force_unit=read.force_unit,
        time_unit=read.time_unit,
        source=str(trace.attrs.get("source", "")),
        load_change=float(np.ptp(np.quantile(load, (0.05, 0.95))) / abs(load.mean()))
        if load.mean()
        else 0.0,
    )


def least_rise(drop: float, noise: float) -> float:
    """Return the smallest rise of the force that separates two slips with drops of at
    least `drop`.
    """
    return min(drop, max(_NOISES * noise, 0.5 * drop))


def with_unit(value: float, unit: str, digits: int = 3) -> str:
    """Return a value in the unit of a trace, without another SI prefix, in words."""
    return f"{value:.{digits}g} {'' if unit == '1' else unit}".rstrip()


def check(events: Events) -> tuple[str, ...]:
    """Raise `InputError` if a fit would mislead, with the number that decided; return
    notes for the reader.
    """
    instance("check: events", events, Events, "the Events of pick_events()")
    for fault in _faults(events):
        raise InputError(f"fit: {fault}")
    notes = []
    if abs(math.log(events.drift)) > math.log1p(_MOST_DRIFT):
        notes.append(
            f"the loading rate in the last third is {events.drift:.2f} times that in "
            "the first: the drive or the rig "
            "is not steady; what is fitted depends on the order of the slips, not on "
            "time"
        )
    if events.sawtooth < _CLEAR_SAWTOOTH:
        notes.append(
            f"rises last only {events.sawtooth:.2g} times as long as drops: hardly "
            "stick-slip"
        )
    if events.slip_samples < RESOLVED:
        seen = f"samples in each: {events.slip_samples:.2g}"
        notes.append(f"slips are not resolved ({seen}): only bounds on mass and delay")
    return tuple(notes)


def _beside(value: float, limit: float, digits: int = 3) -> str:
    """Return a value with as many digits as show on which side of a limit it is."""
    return next(
        text
        for more in range(digits, 18)
        if float(text := f"{value:.{more}g}") != limit
    )


def _faults(events: Events) -> Iterator[str]:
    """Yield the reasons why a fit would mislead, the most obvious first."""
    least = with_unit(events.smallest, events.force_unit)
    count = len(events)
    noise = events.noise / events.mean_peak
    smallest = events.smallest / events.mean_peak
    yield from (
        f"{fault}; reduce its gain, and record again"
        for fault in note_saturation(events.force)
    )
    if events.gap > _LONGEST_GAP:
        yield (
            f"{events.gap} samples in a row are missing: at most {_LONGEST_GAP} are "
            "filled in; cut the trace there"
        )
    if events.load_change > _LOAD_CHANGE:
        yield (
            f"the normal load changes by {100 * events.load_change:.0f} %: must be "
            "constant; cut the trace"
        )
    if noise > _LARGEST_NOISE:
        found = _beside(100 * noise, 100 * _LARGEST_NOISE, 2)
        most = f"at most {100 * _LARGEST_NOISE:g} %"
        yield f"the noise is {found} % of the peak force: {most}; smooth it"
    if smallest > LARGEST_DROP:
        most = f"at most {100 * LARGEST_DROP:g} %; record with less noise"
        found = _beside(100 * smallest, 100 * LARGEST_DROP, 2)
        yield (
            f"drops below {least}, {found} % of the peak force, cannot be "
            f"distinguished from noise: {most}"
        )
    if events.sawtooth < _LEAST_SAWTOOTH:
        seen = (
            f"the force rises for {_beside(events.sawtooth, _LEAST_SAWTOOTH, 2)} "
            "times as long as it drops"
        )
        yield (
            f"{seen}: an oscillation or noise, not stick-slip, where it is at least "
            f"{_LEAST_SAWTOOTH:g}"
        )
    if events.samples_per_period < _FEWEST_SAMPLES:
        seen = (
            f"{_beside(events.samples_per_period, _FEWEST_SAMPLES)} samples from "
            "slip to slip"
        )
        yield (
            f"{seen}: at least {_FEWEST_SAMPLES:g} are needed; record faster, or "
            "pull slower"
        )
    if count < FEWEST:
        yield f"{count} slips: at least {FEWEST} are needed; record for longer"
    if events.doubled < (1.0 - LOST) * count:
        yield (
            f"{count} drops of at least {least}, but {events.doubled} of at least "
            "twice that: the slip count depends "
            "on the detection threshold; give the smallest drop (--minimum-drop), on a "
            "plateau of n(h)"
        )
    change, when = _largest_step(events)
    if change > _STEP:
        at = with_unit(when, events.time_unit, 4)
        yield (
            f"the loading rate changes {change:.2g} times at t = {at}, with the "
            "speed or the load; fit one part"
        )
    name, z = _halves(events)
    if z > _DIFFERENT:
        apart = (
            f"{name} by {_beside(z, _DIFFERENT, 2)} standard errors, at most "
            f"{_DIFFERENT:g}"
        )
        yield f"the halves of the trace differ: {apart}; fit one part"


def _halves(events: Events) -> tuple[str, float]:
    """Return the statistic by which the halves of a trace differ most, and by how many
    standard errors.
    """
    middle = len(events) // 2
    one, other = comparable(
        statistics(
            *(
                x[: 2 * middle].reshape(2, middle)
                for x in (events.peaks, events.troughs)
            )
        )
    )
    # twice the error of the whole trace: a factor sqrt(2) for half the slips, and
    # another for the difference
    error = 2.0 * comparable(resampled(events.peaks, events.troughs)).std(axis=0)
    z = np.abs(one - other) / np.maximum(error, _LEAST_ERROR)
    worst = int(np.argmax(z))
    return FITTED[worst], float(z[worst])


def _largest_step(events: Events) -> tuple[float, float]:
    """Return the largest ratio of the median loading rates on both sides of a drop, and
    its time. Each rise is weighted by its duration.
    """
    took = events.time[events.peak_at[1:]] - events.time[events.trough_at[:-1]]
    slopes = events.slopes
    many = max(8, slopes.size // 8)
    best = 1.0
    when = 0.0
    for i in range(many, slopes.size - many + 1):
        sides = slice(i - many, i), slice(i, i + many)
        before, behind = (weighted_median(slopes[side], took[side]) for side in sides)
        if (ratio := max(before / behind, behind / before)) > best:
            best = ratio
            when = float(events.time[events.peak_at[i]])
    return best, when
