"""The episodes of a run with a changing drive in which it oscillates: their times,
frequencies, and amplitudes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import cumulative_trapezoid

from stickslip.loops import bounded
from stickslip.measure.periods import REGULAR
from stickslip.measure.slips import SLIP_VELOCITY, find_slips, weighted_median
from stickslip.measure.trace import FEWEST_CYCLES, Trace

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_CHANCE = 0.05  # probability that one of the waits of an episode is taken for its end
_FEWEST = 3  # drops that make an episode: two waits between them can be compared
# Drive velocities that differ by less than this fraction count as equal: an oscillation
# that decays at one velocity decays by itself. So does one that halves within `_DROPS`
# drops, whatever the drive does.
_ONE_SPEED = 0.05
_DROPS = 4


@dataclass(frozen=True, kw_only=True)
class Episode:
    """A time interval in which the force drops repeatedly, in the units of the run.

    `worst` is half of the largest drop, `worst_time` the time at which that begins, and
    `worst_velocity` the velocity of the drive then; `peak` is the largest velocity of
    the slider over that of the drive in a typical drop; `frequency` is NaN where the
    waits are irregular. An oscillation that `rings_down` decays by itself, as after a
    start.
    """

    begin: float
    end: float
    drops: int
    frequency: float
    worst: float
    worst_time: float
    worst_velocity: float
    peak: float
    rings_down: bool

    @property
    def kind(self) -> str:
        """Stick-slip if the slider is as fast as in slips, else an oscillation."""
        is_slip = self.peak >= SLIP_VELOCITY
        return "stick-slip" if is_slip else "sustained oscillation"


def episodes(
    run: xr.Dataset, minimum_drop: float = 0.0, noise: float = 0.0
) -> list[Episode]:
    """Return the episodes in which a run oscillates, in order of time.

    An episode ends where the drive stops, and at a wait that is too long by three
    measures: time, travel of the drive, and travel over the next drop. (Free
    oscillations recur after equal times, slips after equal travel, and large slips
    after more travel.) A wait is too long if it exceeds the medians of the four before
    it and of the four after it by a factor ``max(2, 1 + CV ln(n/.05))``, which one of
    `n` waits with an exponential tail and the coefficient of variation CV exceeds by
    chance in 5 % of the cases.

    Parameters
    ----------
    run : Dataset
        A run, with `spring_force`, `velocity` and `drive_velocity` along `time`.
    minimum_drop : float
        Smaller drops of the force do not count; in the unit of the force.
    noise : float
        Standard deviation of the force by the noise of the contacts. A drop of
        narrow-band normal noise exceeds `x` standard deviations with the probability
        ``exp(-x^2/8)``: drops count only if they exceed the one that the largest of
        their number reaches by chance in 5 % of the cases.
    """
    # slow to load
    import pandas as pd

    trace = Trace.of(run)
    found = find_slips(trace)
    chance = noise * math.sqrt(8.0 * math.log(max(found.size, 1) / _CHANCE))
    found = found.only(found.drops >= max(minimum_drop, chance))
    if found.size < _FEWEST:
        return []
    assert trace.drive is not None
    drive = np.abs(trace.drive)
    gone = cumulative_trapezoid(drive, trace.t, initial=0)
    stands = np.cumsum(drive == 0.0)
    first = found.start
    columns = {
        "start": trace.t[first],
        "end": trace.t[found.end],
        "drop": found.drops,
        "peak_velocity": found.fastest,
        "drive": drive[first],
    }
    table = pd.DataFrame(columns)
    waits = pd.DataFrame({"time": columns["start"], "way": gone[first]}).diff()
    waits["load"] = waits["way"] / found.drops
    # the drive moves from the start to the end of a drop: where it stops, the force
    # falls without a slip
    table["moving"] = (drive[first] > 0) & (stands[found.end] == stands[first])
    begins = np.flatnonzero(np.diff(stands[first], prepend=0) > 0)
    left = [each for each in np.split(table.index, begins) if len(each) >= _FEWEST]
    found_episodes = list[Episode]()
    # each turn takes a series of drops, and puts back its parts or nothing
    turns = bounded("episodes", 2 * len(table))
    while left:
        next(turns)
        drops = left.pop()
        part = table.loc[drops]
        inner = waits.loc[drops].copy()
        inner.iloc[0] = math.nan
        longest, pauses = _pauses(inner)
        if pauses.any():
            # judge each part anew, as the waits beside its waits are now different
            parts = np.split(drops, np.flatnonzero(pauses))
            left += [each for each in parts if len(each) >= _FEWEST]
            continue
        # a fall longer than a cycle is no drop: the force falls because the drive
        # speeds up
        part = part[part["moving"] & ~(part["end"] - part["start"] > longest)]
        if len(part) >= _FEWEST:
            found_episodes.append(_episode(part))
    return sorted(found_episodes, key=lambda episode: episode.begin)


def _pauses(waits: pd.DataFrame) -> tuple[pd.Series[float], pd.Series[bool]]:
    """Return the longest wait to be expected by chance near each drop, and whether the
    wait before the drop is a pause.
    """
    # medians of as many waits as make a period, before and after each wait
    before = waits.rolling(FEWEST_CYCLES, min_periods=1).median()
    after = waits[::-1].rolling(FEWEST_CYCLES, min_periods=1).median()[::-1].shift(-1)
    usual = before.shift(1).combine(after, np.fmax)
    ratio = waits / usual
    longest = ratio.apply(_longest)
    pauses = (ratio > longest).all(axis="columns")
    return before["time"].combine(after["time"], np.fmax) * longest["time"], pauses


def _longest(ratios: pd.Series[float]) -> float:
    """Return the largest of these ratios of waits to be expected by chance."""
    # the largest may be a pause
    others = ratios.nsmallest(ratios.count() - 1)
    low, usual, high = others.quantile([0.25, 0.5, 0.75])
    # standard deviation of normal waits from their quartiles, which pauses do not move
    scatter = (high - low) / 1.349 / usual
    return float(max(2.0, 1.0 + scatter * math.log(ratios.count() / _CHANCE)))


def _episode(part: pd.DataFrame) -> Episode:
    waits = part["start"].diff()
    is_regular = waits.std() < REGULAR * waits.mean()
    worst = part.loc[part["drop"].idxmax()]
    over_drive = part["peak_velocity"] / part["drive"]
    return Episode(
        begin=float(part["start"].iloc[0]),
        end=float(part["end"].iloc[-1]),
        drops=len(part),
        frequency=float(1.0 / waits.mean()) if is_regular else math.nan,
        worst=float(worst["drop"] / 2.0),
        worst_time=float(worst["start"]),
        worst_velocity=float(worst["drive"]),
        peak=weighted_median(over_drive.to_numpy(), part["drop"].to_numpy() ** 2),
        rings_down=_rings_down(part),
    )


def _rings_down(part: pd.DataFrame) -> bool:
    """Whether drops decay up to the last.

    At constant drive velocity, or if they are few: by half from one half of them to
    the other, or each below the one before and by a factor sqrt(2) in all. Else each
    must be half of the one three before it.
    """
    sizes = part["drop"].to_numpy()
    stays = (part["drive"] / part["drive"].iloc[0] - 1.0).abs() < _ONE_SPEED
    if sizes.size > _DROPS and not stays.all():
        later = sizes[_DROPS - 1 :]
        return bool((later < 0.5 * sizes[: later.size]).all())
    half = sizes.size // 2
    fallen = np.median(sizes[-half:]) / np.median(sizes[:half])
    each = bool((np.diff(sizes) < 0).all())
    return bool(fallen < 0.5 or (each and sizes[-1] < math.sqrt(0.5) * sizes[0]))
