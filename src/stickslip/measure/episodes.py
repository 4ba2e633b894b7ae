"""When a run oscillates whose drive goes through speeds: from which time to which, how
often, how strongly, and where most.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
import xarray as xr

from stickslip.arrays import Array
from stickslip.measure.catalogue import drops
from stickslip.measure.periods import REGULAR
from stickslip.measure.slips import SLIP_VELOCITY

_CHANCE = 0.05  # probability that one of the waits of an episode is taken for its end
_FEWEST = 3  # drops that make an episode: two waits between them can be compared


@dataclass(frozen=True, kw_only=True)
class Episode:
    """A time in which the force drops again and again; numbers in the units of the run.

    `worst` is half of the largest drop, `worst_time` when it begins, `worst_velocity`
    the velocity of the drive there; `peak` the largest velocity of the slider in a drop
    over that of the drive, on average; `frequency` is NaN where the waits are
    irregular.
    """

    begin: float
    end: float
    drops: int
    frequency: float
    worst: float
    worst_time: float
    worst_velocity: float
    peak: float

    @property
    def kind(self) -> str:
        """Stick-slip, or the oscillation of a slider that stays with its drive."""
        is_slip = self.peak >= SLIP_VELOCITY
        return "stick-slip" if is_slip else "sustained oscillation"


def episodes(run: xr.Dataset, minimum_drop: float = 0.0) -> list[Episode]:
    """Return when a run oscillates, in the order of time.

    An episode ends with a wait longer than usual: than the median by a factor of
    ``max(2, 1 + CV ln(n/.05))``, which one of `n` waits of the coefficient of variation
    CV exceeds by chance in 5 % of the cases, if they have an exponential tail.

    Parameters
    ----------
    run : Dataset
        A run, with `spring_force`, `velocity` and `drive_velocity` along `time`.
    minimum_drop : float
        Smaller drops of the force do not count; in the unit of the force.
    """
    found = drops(run)
    size = found["drop"].to_numpy()
    counts = size >= minimum_drop
    begin = found["start"].to_numpy()[counts]
    end = found["end"].to_numpy()[counts]
    fastest = found["peak_velocity"].to_numpy()[counts]
    speeds = np.abs(run["drive_velocity"].to_numpy())
    drive = np.interp(begin, run["time"].to_numpy(), speeds)
    return [
        _episode(begin[part], end[part], size[counts][part], drive[part], fastest[part])
        for part in _parts(begin)
        if part.stop - part.start >= _FEWEST
    ]


def _parts(times: Array) -> list[slice]:
    """Drops with no wait between them that is longer than usual."""
    waits = np.diff(times)
    if not waits.size:
        return []
    low, usual, high = np.quantile(waits, [0.25, 0.5, 0.75])
    # the standard deviation of normal waits, which a pause does not widen
    scatter = (high - low) / 1.349 / usual
    longest = usual * max(2.0, 1.0 + scatter * math.log(waits.size / _CHANCE))
    cuts = np.flatnonzero(waits > longest) + 1
    bounds = [0, *cuts.tolist(), times.size]
    return [slice(first, last) for first, last in itertools.pairwise(bounds)]


def _episode(
    begin: Array, end: Array, size: Array, drive: Array, fastest: Array
) -> Episode:
    waits = np.diff(begin)
    is_regular = np.std(waits, ddof=1) < REGULAR * np.mean(waits)
    largest = int(np.argmax(size))
    with np.errstate(divide="ignore"):
        over_drive = fastest / drive  # infinite where the drive stands
    return Episode(
        begin=float(begin[0]),
        end=float(end[-1]),
        drops=begin.size,
        frequency=float(1.0 / np.mean(waits)) if is_regular else math.nan,
        worst=float(size[largest] / 2.0),
        worst_time=float(begin[largest]),
        worst_velocity=float(drive[largest]),
        peak=float(np.median(over_drive)),
    )
