"""Turning points of a force by hysteresis: a peak counts once the force has dropped by
a given amount, a trough once it has risen.

The same function picks the slips of a measured and of a simulated trace, and thins out
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
    """State of the search: the highest value since the last trough, or the lowest since
    the last peak.
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
    """Add the next value of the force; `found` is `PEAK` or `TROUGH` if it confirms the
    last peak or trough.
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
    """Indices of the peaks and of the troughs after them; a drop that is cut off at the
    end of the trace is omitted.
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
    """How a trace was recorded and picked; forces in one unit, `slope` of the loading
    in that unit per sample.
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
    """Sample a sawtooth with these peaks and troughs, add noise, and pick its slips;
    return the number of slips found, at most the width of `seen`.

    Slips take no time; `seen` is filled with the picked peaks and troughs, shape (2,
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
