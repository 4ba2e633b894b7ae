"""The slips of a measured trace as a fit needs them, with what was found on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from stickslip.answers import Answer
from stickslip.errors import InputError, instance, number
from stickslip.fitting.arrest import FLOOR
from stickslip.fitting.summary import statistics
from stickslip.measure.arrays import Array, Trace
from stickslip.measure.slips import pick, resolution, white_noise

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NOISES, _STEPS = 6.0, 3.0
"""The smallest drop is so many standard deviations of the noise, and so many steps of the recording."""
FEWEST, LARGEST_DROP = 30, 0.10
"""Slips that a fit needs, and the largest smallest drop, over the peak, that it takes."""
PLATEAU, LOST = 2.0, 0.1
"""The count of slips may change by a tenth while the smallest drop is doubled."""
_FINER = 2.0**0.25


@dataclass(frozen=True, kw_only=True, repr=False)
class Events(Answer):
    """The slips of a trace. It prints as its short text."""

    time: Array  #: of the trace that was searched
    force: Array  #: along its direction
    peak_at: Any  #: indices of the force before each slip
    trough_at: Any  #: and after it
    smallest: float  #: drops of at least this count
    noise: float  #: standard deviation, from sample to sample
    resolution: float  #: step of the recording; 0 if there is none
    counts: tuple[tuple[float, int], ...]  #: how many slips there would be for other smallest drops
    gap: int = 0  #: longest run of samples that were interpolated
    force_unit: str = ""  #: empty where the trace does not say
    time_unit: str = ""
    source: str = ""
    load_change: float = 0.0  #: largest change of the normal load over its mean; 0 where it is not known

    # ------------------------------------------------------------------------------------------------ one of each slip

    def __len__(self) -> int:
        return len(self.peak_at)

    @property
    def peaks(self) -> Array:
        """Force before each slip."""
        return np.asarray(self.force[self.peak_at])

    @property
    def troughs(self) -> Array:
        """Force after each slip."""
        return np.asarray(self.force[self.trough_at])

    @property
    def drops(self) -> Array:
        """Drop of the force in each slip."""
        return self.peaks - self.troughs

    @property
    def slopes(self) -> Array:
        """Rise of the force per time from each trough to the peak after it."""
        took = self.time[self.peak_at[1:]] - self.time[self.trough_at[:-1]]
        return np.asarray((self.peaks[1:] - self.troughs[:-1]) / took)

    # ------------------------------------------------------------------------------------------------ one of all slips

    @property
    def mean_peak(self) -> float:
        """Mean force before a slip: the scale of all others."""
        return float(self.peaks.mean())

    @property
    def step(self) -> float:
        """Median time from sample to sample."""
        return float(np.median(np.diff(self.time)))

    @property
    def recurrence(self) -> float:
        """Mean time from slip to slip."""
        return float(np.diff(self.time[self.peak_at]).mean())

    @property
    def samples_per_period(self) -> float:
        """Mean recurrence in samples."""
        return self.recurrence / self.step

    @property
    def loading_rate(self) -> float:
        """Median rise of the force per time between slips."""
        return float(np.median(self.slopes))

    @property
    def rise(self) -> float:
        """Smallest rise between two slips."""
        return least_rise(self.smallest, self.noise)

    @property
    def thirds(self) -> tuple[float, float]:
        """Median loading rate in the first and in the last third of the slips."""
        third = max(len(self.slopes) // 3, 1)
        return float(np.median(self.slopes[:third])), float(np.median(self.slopes[-third:]))

    @property
    def drift(self) -> float:
        """Median loading rate in the last third of the slips over that in the first."""
        return self.thirds[1] / self.thirds[0]

    @property
    def sawtooth(self) -> float:
        """Mean time of a rise over that of a drop: 1 for a sine, 10 for stick-slip."""
        falls = (self.time[self.trough_at] - self.time[self.peak_at]).mean()
        rises = (self.time[self.peak_at[1:]] - self.time[self.trough_at[:-1]]).mean()
        return float(rises / falls)

    @property
    def slip_samples(self) -> float:
        """Median time of a drop, in samples; below 5 the slip itself is not resolved."""
        return float(np.median(self.trough_at - self.peak_at))

    @property
    def statistics(self) -> Array:
        """The numbers that summarise the slips, in the order of `stickslip.fitting.summary.NAMES`."""
        return statistics(self.peaks, self.troughs)

    def part(self, begin: int, end: int) -> Events:
        """Some of the slips, by number."""
        return replace(self, peak_at=self.peak_at[begin:end], trough_at=self.trough_at[begin:end])

    # ------------------------------------------------------------------------------------------------------- in words

    def __str__(self) -> str:
        f, t = self.force_unit, self.time_unit
        low, high = self.smallest, PLATEAU * self.smallest
        peak, trough = (
            f"{mean:.4g} ± {with_unit(scatter, f)}"
            for mean, scatter in ((self.mean_peak, self.peaks.std()), (self.troughs.mean(), self.troughs.std()))
        )
        rate = with_unit(self.loading_rate, f) + (f"/{t}" if t else " per time unit")
        return "\n".join(
            (
                f"{len(self)} slips of at least {with_unit(low, f)} ({self.count_at(high)} of at least "
                f"{with_unit(high, f)})",
                f"peak {peak}, trough {trough}, drop {with_unit(self.drops.mean(), f)} (CV "
                f"{self.drops.std() / self.drops.mean():.2f}), every {with_unit(self.recurrence, t)}",
                f"loading rate {rate}, last third over first {self.drift:.2f}; noise {with_unit(self.noise, f, 2)}, "
                f"resolution {with_unit(self.resolution, f, 2)}",
                f"{self.samples_per_period:.3g} samples from slip to slip, {self.slip_samples:.2g} in a slip; rises "
                f"last {self.sawtooth:.3g} times as long as drops",
            )
        )

    def count_at(self, smallest: float) -> int:
        """How many slips have at least a certain drop, by the counts at hand."""
        return min(self.counts, key=lambda pair: abs(math.log(pair[0] / smallest)))[1]

    def to_dataset(self) -> xr.Dataset:
        """The slips as a Dataset along ``slip``, and the trace along ``time``."""
        f, t = self.force_unit, self.time_unit
        of_slips = {
            "peak": (self.peaks, f, "force before the slip"),
            "trough": (self.troughs, f, "force after the slip"),
            "drop": (self.drops, f, "force drop"),
            "peak_time": (self.time[self.peak_at], t, "time of the slip"),
            "trough_time": (self.time[self.trough_at], t, "end of the slip"),
            "loading_rate": (np.append(np.nan, self.slopes), f"{f}/{t}" if t else f, "loading rate before the slip"),
        }
        return xr.Dataset(
            {"spring_force": ("time", self.force, {"units": f, "long_name": "force"})}
            | {
                name: ("slip", values, {"units": unit, "long_name": title})
                for name, (values, unit, title) in of_slips.items()
            },
            coords={"time": ("time", self.time, {"units": t, "long_name": "time"})},
            attrs={"source": self.source, "smallest": self.smallest, "noise": self.noise},
        )

    def plot(self) -> Figure:
        """Draw the trace, the distribution of drops, peaks against troughs, and the loading rate along the run."""
        from stickslip import plot

        return plot.slips(self.to_dataset())


def pick_events(trace: xr.Dataset, *, smallest: float | None = None, after: float | None = None) -> Events:
    """Pick the slips of a trace: peaks and troughs by hysteresis, above noise and the steps of the recording.

    A drop counts from six standard deviations of the noise, three steps of the recording, and a hundredth of the peak
    on, or from where on the count of slips hardly changes while that is doubled. The first slip, before which the force
    rises from rest, is left out, and so is one that the end cuts off. A rise much faster than the loading belongs to
    the slip before: the slider rings.

    Parameters
    ----------
    trace : Dataset
        With `spring_force` along `time`, as `stickslip.read_trace` and `stickslip.simulate` return.
    smallest : float, optional
        Smallest drop that counts, in the unit of the force.
    after : float, optional
        Look at slips after this time only.

    Raises
    ------
    InputError
        If there are no slips.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> from stickslip.fitting import pick_events
    >>> saw = 10.0 + np.tile(np.linspace(-2.0, 2.0, 50), 40)
    >>> trace = xr.Dataset({"spring_force": ("time", saw)}, coords={"time": 0.1 * np.arange(saw.size)})
    >>> found = pick_events(trace)
    >>> len(found), float(found.drops.mean()), round(found.recurrence, 3)
    (38, 4.0, 5.0)
    """
    instance("fit: trace", trace, xr.Dataset, "a Dataset, such as read_trace() returns")
    kept = trace if after is None else trace.sel(time=slice(number("after", after), None))
    read = Trace.of(kept)
    force = np.ascontiguousarray(read.force)
    noise, step = white_noise(force), resolution(force)
    height = float(np.quantile(force, 0.9))
    if not height > 0:
        raise InputError(f"fit: nine tenths of the force lie below {height:.3g}: must pull one way, counted from 0")

    def picked(drop: float) -> tuple[Any, Any]:
        rise = least_rise(drop, noise)
        peaks, troughs = pick(read.t, force, drop, rise)
        first = 0 if after is not None else 1  # its peak follows the loading from rest
        if len(troughs) and force[troughs[-1] :].max() - force[troughs[-1]] < rise:
            peaks, troughs = peaks[:-1], troughs[:-1]
        return peaks[first:], troughs[first:]

    if smallest is None:
        smallest = max(_NOISES * noise, _STEPS * step, FLOOR * height)
        smallest = _on_a_plateau(lambda drop: len(picked(drop)[0]), smallest, LARGEST_DROP * height)
    else:
        smallest = number("smallest", smallest, above=0, hint="drop that counts as a slip")

    peaks, troughs = picked(smallest)
    if len(peaks) < 2:
        raise InputError(
            f"fit: {len(peaks)} drops of at least {smallest:.3g} (noise {noise:.2g}, resolution {step:.2g}): "
            f"at least {FEWEST} slips are needed; stick-slip shows more, or --smallest is too large"
        )
    filled = np.asarray(kept["filled"].values) if "filled" in kept else np.zeros(force.size, dtype=bool)
    runs = np.diff(np.flatnonzero(np.concatenate([[True], ~filled, [True]]))) - 1
    steps = np.diff(read.t)
    load = np.asarray(kept["load"].values, dtype=float) if "load" in kept else np.ones(1)
    return Events(
        time=read.t,
        force=force,
        peak_at=peaks,
        trough_at=troughs,
        smallest=float(smallest),
        noise=noise,
        resolution=step,
        counts=tuple((float(h), len(picked(float(h))[0])) for h in smallest * np.geomspace(0.5, 16.0, 21)),
        gap=max(int(runs.max()), round(float(steps.max() / np.median(steps))) - 1),
        force_unit=str(kept["spring_force"].attrs.get("units", "")),
        time_unit=str(kept["time"].attrs.get("units", "")),
        source=str(trace.attrs.get("source", "")),
        load_change=float(np.ptp(np.quantile(load, (0.05, 0.95))) / abs(load.mean())) if load.mean() else 0.0,
    )


def _on_a_plateau(count: Callable[[float], int], least: float, most: float) -> float:
    """The smallest drop that may be doubled at hardly any change of the count of slips; `least` if there is none."""
    drop = least
    while drop <= most:
        if count(PLATEAU * drop) >= (1.0 - LOST) * count(drop) > 0:
            return drop
        drop *= _FINER
    return least


def least_rise(drop: float, noise: float) -> float:
    """The smallest rise that parts two slips, where a drop of at least `drop` is one."""
    return min(drop, max(_NOISES * noise, 0.5 * drop))


def with_unit(value: float, unit: str, digits: int = 3) -> str:
    """A value in the unit of a trace as it is there, without another prefix."""
    return f"{value:.{digits}g} {'' if unit == '1' else unit}".rstrip()
