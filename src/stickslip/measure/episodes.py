"""When a run oscillates whose drive goes through speeds: from which time to which, how
often, how strongly, and where most.
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
# Drive velocities that differ by less than this fraction count as one velocity: an
# oscillation that decays there decays by itself. So does one that halves within
# `_DROPS` drops, whatever the drive does.
_ONE_SPEED = 0.05
_DROPS = 4


@dataclass(frozen=True, kw_only=True)
class Episode:
    """A time in which the force drops again and again; numbers in the units of the run.

    `worst` is half of the largest drop, `worst_time` when it begins, `worst_velocity`
    the velocity of the drive there; `peak` the largest velocity of the slider over that
    of the drive in a typical drop; `frequency` is NaN where the waits are
    irregular. What `rings_down` dies out by itself, as after a start.
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
        """Stick-slip, or the oscillation of a slider that stays with its drive."""
        is_slip = self.peak >= SLIP_VELOCITY
        return "stick-slip" if is_slip else "sustained oscillation"


def episodes(
    run: xr.Dataset, minimum_drop: float = 0.0, noise: float = 0.0
) -> list[Episode]:
    """Return when a run oscillates, in the order of time.

    An episode ends where the drive stands, and with a wait longer than those on both
    sides, in time, in the way of the drive, and in that over the next drop: free
    oscillations come with the time, slips with the way, large ones after a longer one.
    That is, than the larger median of four by a factor of ``max(2, 1 + CV ln(n/.05))``,
    which one of `n` waits of the coefficient of variation CV exceeds by chance in 5 %
    of the cases, if they have an exponential tail.

    Parameters
    ----------
    run : Dataset
        A run, with `spring_force`, `velocity` and `drive_velocity` along `time`.
    minimum_drop : float
        Smaller drops of the force do not count; in the unit of the force.
    noise : float
        Standard deviation of the force that the noise of contacts makes. Normal noise
        of a narrow band drops farther than `x` with the probability ``exp(-x^2/8)``, in
        standard deviations: no drop counts that one of their number reaches by chance
        in 5 % of the cases.
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
    # with the drive, from first to last: where it stops, the force falls by itself
    table["moving"] = (drive[first] > 0) & (stands[found.end] == stands[first])
    begins = np.flatnonzero(np.diff(stands[first], prepend=0) > 0)
    left = [each for each in np.split(table.index, begins) if len(each) >= _FEWEST]
    found_episodes = list[Episode]()
    # each turn takes a row of drops, and leaves its parts or none of it
    turns = bounded("episodes", 2 * len(table))
    while left:
        next(turns)
        drops = left.pop()
        part = table.loc[drops]
        inner = waits.loc[drops].copy()
        inner.iloc[0] = math.nan
        longest, pauses = _pauses(inner)
        if pauses.any():
            # on either side, waits have other ones beside them
            parts = np.split(drops, np.flatnonzero(pauses))
            left += [each for each in parts if len(each) >= _FEWEST]
            continue
        # where the drive speeds up, the force falls by itself for longer than a cycle
        part = part[part["moving"] & ~(part["end"] - part["start"] > longest)]
        if len(part) >= _FEWEST:
            found_episodes.append(_episode(part))
    return sorted(found_episodes, key=lambda episode: episode.begin)


def _pauses(waits: pd.DataFrame) -> tuple[pd.Series[float], pd.Series[bool]]:
    """Return the longest time of a cycle about each drop that chance makes, and whether
    the wait before it is a pause.
    """
    # four slow cycles are as many as make a period: they are none
    before = waits.rolling(FEWEST_CYCLES, min_periods=1).median()
    after = waits[::-1].rolling(FEWEST_CYCLES, min_periods=1).median()[::-1].shift(-1)
    usual = before.shift(1).combine(after, np.fmax)
    ratio = waits / usual
    longest = ratio.apply(_longest)
    pauses = (ratio > longest).all(axis="columns")
    return before["time"].combine(after["time"], np.fmax) * longest["time"], pauses


def _longest(ratios: pd.Series[float]) -> float:
    """Return the longest wait that chance makes, in time or else, over the usual."""
    # the longest may be a pause
    others = ratios.nsmallest(ratios.count() - 1)
    low, usual, high = others.quantile([0.25, 0.5, 0.75])
    # the standard deviation of normal waits, which other pauses do not widen
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
    """Whether drops fall to the last: each below the one before or on the whole by
    half, at one speed of the drive or if they are few, else by half in a few.
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
