"""Turning points of a force by hysteresis: a peak counts when the force has dropped by
so much, a trough when it rose.

The same few lines pick the slips of a measured trace, of a simulated one, and thin out
the events of the simulation.
"""

from typing import NamedTuple

import numpy as np

from ._jit import jit
from .records import Counts, Floats

NOTHING = 0
PEAK = 1
TROUGH = 2


class Zigzag(NamedTuple):
    """Where the search stands: the highest value since the last trough, or the
    lowest since the last peak.
    """

    falling: bool
    high: float
    high_at: int
    low: float
    low_at: int
    found: int


START = Zigzag(False, -np.inf, 0, np.inf, 0, NOTHING)


@jit
def turn(
    state: Zigzag,
    at: int,
    value: float,
    drop: float,
    rise: float,
) -> Zigzag:
    """Add the next value of the force; `found` says whether it proves the last peak or
    the last trough.
    """
    falling, high, high_at, low, low_at, _ = state
    if falling:
        if value < low:
            low = value
            low_at = at
        if value - low >= rise:
            return Zigzag(False, value, at, low, low_at, TROUGH)
    else:
        if value > high:
            high = value
            high_at = at
        if high - value >= drop:
            return Zigzag(True, high, high_at, value, at, PEAK)
    return Zigzag(falling, high, high_at, low, low_at, NOTHING)


@jit
def pick(force: Floats, drop: float, rise: float) -> tuple[Counts, Counts]:
    """Indices of the peaks and of the troughs after them; a drop that the trace cuts
    off is left out.
    """
    peaks = np.empty(force.size // 2 + 1, np.int64)
    troughs = np.empty(force.size // 2 + 1, np.int64)
    count = 0
    state = START
    for i in range(force.size):
        state = turn(state, i, force[i], drop, rise)
        if state.found == PEAK:
            peaks[count] = state.high_at
        elif state.found == TROUGH:
            troughs[count] = state.low_at
            count += 1
    return peaks[:count], troughs[:count]


class Recording(NamedTuple):
    """How a trace was recorded and picked; forces in one unit, `slope` of the
    loading in that unit per sample.
    """

    slope: float
    noise: float
    resolution: float
    drop: float
    rise: float


@jit
def observe(
    peaks: Floats,
    troughs: Floats,
    sampling: Recording,
    rng: np.random.Generator,
    seen: Floats,
) -> int:
    """Sample a saw of these peaks and troughs, add noise, pick it; return how many
    slips were seen, of those wanted.

    Slips take no time; `seen` takes the peaks and troughs that were picked, shape (2,
    wanted).
    """
    count = 0
    wanted = seen.shape[1]
    state = START
    begin = -rng.random()  # time of the trough, in samples
    i = 0
    for n in range(1, peaks.size):
        low = troughs[n - 1]
        end = begin + (peaks[n] - low) / sampling.slope
        while i < end:
            value = low + sampling.slope * (i - begin)
            if sampling.noise > 0.0:
                value += sampling.noise * rng.normal()
            if sampling.resolution > 0.0:
                value = sampling.resolution * np.round(value / sampling.resolution)
            state = turn(state, i, value, sampling.drop, sampling.rise)
            if state.found == PEAK:
                seen[0, count] = state.high
            elif state.found == TROUGH:
                seen[1, count] = state.low
                count += 1
                if count == wanted:
                    return count
            i += 1
        begin = end
    return count
