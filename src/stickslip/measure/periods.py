"""The period of a force: the one estimator that all of the package uses."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from stickslip.measure.trace import (
    FEWEST_CYCLES,
    Array,
    mean_and_std,
    without_drift,
)

PERIODIC = 0.7  # least autocorrelation at one period of a periodic force
JITTER = math.sqrt(-2.0 * math.log(PERIODIC)) / (2.0 * math.pi)
"""Variation of the cycles that leaves a sine this correlation at one period, as
``exp(-(2 pi CV)^2 / 2)``: .13.
"""
# the first peak of the autocorrelation above this part of the highest is that of one
# period
_HALF = 0.5
# of a period: rises closer than this belong to one cycle (ringing crosses the levels
# again)
_TOGETHER = 0.7


REGULAR = 0.3
"""Coefficient of variation of waits above which a motion has no frequency: the spectrum
of such a renewal process has no peak at it.
"""


@dataclass(frozen=True, kw_only=True)
class Cycles:
    """The cycles of a force."""

    period: float  #: mean time of a cycle; NaN if there are fewer than two rises
    variation: float  #: coefficient of variation of the times of the cycles
    #: autocorrelation of the force at one period: 1 if it repeats, near 0 for noise
    correlation: float
    #: when the cycles begin, in their rise; the last one ends the last complete cycle
    times: Array

    @property
    def count(self) -> int:
        """Number of complete cycles."""
        return max(self.times.size - 1, 0)

    @property
    def periodic(self) -> bool:
        """Whether the force repeats itself, in cycles of even length."""
        return (
            self.count >= FEWEST_CYCLES
            and self.correlation >= PERIODIC
            and self.variation <= JITTER
        )


def regularity(variation: float) -> float:
    """Correlation at one period that a variation of its cycles leaves to a sine."""
    return math.exp(-0.5 * (2.0 * math.pi * variation) ** 2)


def find_cycles(t: Array, force: Array) -> Cycles:
    """Return the cycles of a force: how far it repeats itself, and where each cycle
    begins.

    The autocorrelation parts one period from a part of it and from several; each cycle
    is then timed by itself, from one rise through the upper third of the range of the
    force in a typical cycle to the next.
    """
    lag, correlation = _autocorrelation_peak(t, force)
    starts = np.zeros(1, dtype=int)
    if correlation:
        # half a sample earlier, so that rounding decides about none
        half = 0.5 * (t[-1] - t[0]) / (t.size - 1)
        firsts = np.searchsorted(t, np.arange(t[0], t[-1] - lag, lag) - half)
        if firsts.size >= FEWEST_CYCLES and np.diff(firsts).all():
            starts = firsts
    # Of each cycle: one that is larger than the others says nothing.
    low = float(np.median(np.minimum.reduceat(force, starts)))
    high = float(np.median(np.maximum.reduceat(force, starts)))
    third = (high - low) / 3.0
    begins: list[float] = []
    for time in rises(t, force, low + third, high - third)[1].tolist():
        if not begins or not time - begins[-1] < _TOGETHER * lag:
            begins.append(time)
    period, _, variation = mean_and_std(np.diff(begins))
    return Cycles(
        period=period,
        variation=variation,
        correlation=correlation,
        times=np.array(begins),
    )


def rises(
    t: Array, force: Array, low: float, high: float
) -> tuple[NDArray[np.intp], Array]:
    """Rises of a force through `high`, each with a drop below `low` before it:
    samples, and times between them.
    """
    side = np.where(force > high, 1, np.where(force < low, -1, 0))
    outside = np.flatnonzero(side)
    risen = outside[1:][np.diff(side[outside]) > 0]
    passed = (force[risen] - high) / (force[risen] - force[risen - 1])
    return risen, t[risen] - passed * (t[risen] - t[risen - 1])


def _autocorrelation_peak(t: Array, force: Array) -> tuple[float, float]:
    """Lag and height of the peak of the autocorrelation that belongs to one period;
    NaN and 0 if there is none.
    """
    size = t.size
    even = np.linspace(t[0], t[-1], size)
    rest = without_drift(np.interp(even, t, force))
    lags = max(size // 2, 3)
    spectrum = fft.rfft(rest, fft.next_fast_len(size + lags, real=True))
    power = fft.irfft(spectrum.real**2 + spectrum.imag**2)[:lags]
    if not power[0] > 0 or not power.min() < 0:
        return math.nan, 0.0
    power /= power[0] * (1.0 - np.arange(lags) / size)
    inner = power[1:-1]
    tops = (inner >= power[:-2]) & (inner > power[2:]) & (inner > 0)
    at = 1 + np.flatnonzero(tops)
    at = at[at > np.argmax(power < 0)]
    if not at.size:
        return math.nan, 0.0
    first = int(at[np.argmax(power[at] >= _HALF * power[at].max())])
    return first * (even[1] - even[0]), float(power[first])
