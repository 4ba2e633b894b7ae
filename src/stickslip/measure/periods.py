"""The period of a force: the only estimator of periods in the package."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from stickslip.errors import series
from stickslip.measure.trace import (
    FEWEST_CYCLES,
    Array,
    mean_and_std,
    without_drift,
)

PERIODIC = 0.7  # least autocorrelation at one period of a periodic force
JITTER = math.sqrt(-2.0 * math.log(PERIODIC)) / (2.0 * math.pi)
"""Coefficient of variation of the cycles of a sine that has this correlation at one
period, ``exp(-(2 pi CV)^2 / 2)``: .13.
"""
# the first peak of the autocorrelation above this fraction of the highest is that of
# one period
_HALF = 0.5
# rises closer than this fraction of a period belong to one cycle (ringing crosses the
# levels again)
_TOGETHER = 0.7


REGULAR = 0.3
"""Coefficient of variation of waits above which a motion has no frequency: the spectrum
of such a renewal process has no peak.
"""


@dataclass(frozen=True, kw_only=True)
class Cycles:
    """The cycles of a force."""

    period: float  #: mean time of a cycle; NaN if there are fewer than two rises
    variation: float  #: coefficient of variation of the times of the cycles
    #: autocorrelation of the force at one period: 1 if it repeats, near 0 for noise
    correlation: float
    #: times, in their rises, at which the cycles begin; the last one ends the last
    #: complete cycle
    times: Array

    @property
    def count(self) -> int:
        """Number of complete cycles."""
        return max(self.times.size - 1, 0)

    @property
    def periodic(self) -> bool:
        """Whether the force repeats itself in cycles of equal length."""
        return (
            self.count >= FEWEST_CYCLES
            and self.correlation >= PERIODIC
            and self.variation <= JITTER
        )


def regularity(variation: float) -> float:
    """Return the correlation at one period of a sine whose cycles vary so much."""
    return math.exp(-0.5 * (2.0 * math.pi * variation) ** 2)


def find_cycles(t: Array, force: Array) -> Cycles:
    """Return the cycles of a force: how well it repeats itself, and when each cycle
    begins.

    The autocorrelation distinguishes one period from its fractions and multiples; each
    cycle is then timed by itself, from one rise into the upper third of the range of
    the force in a typical cycle to the next.
    """
    t, force = series("find_cycles: t, force", t, force)
    lag, correlation = _autocorrelation_peak(t, force)
    starts = np.zeros(1, dtype=int)
    if correlation:
        # half a sample earlier, so that rounding does not decide between two samples
        half = 0.5 * (t[-1] - t[0]) / (t.size - 1)
        firsts = np.searchsorted(t, np.arange(t[0], t[-1] - lag, lag) - half)
        if firsts.size >= FEWEST_CYCLES and np.diff(firsts).all():
            starts = firsts
    # medians over the cycles, as one large cycle says nothing about the others
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
    """Return the rises of a force through `high` that follow a drop below `low`: the
    first samples above, and the interpolated times.
    """
    side = np.where(force > high, 1, np.where(force < low, -1, 0))
    outside = np.flatnonzero(side)
    risen = outside[1:][np.diff(side[outside]) > 0]
    passed = (force[risen] - high) / (force[risen] - force[risen - 1])
    return risen, t[risen] - passed * (t[risen] - t[risen - 1])


def _autocorrelation_peak(t: Array, force: Array) -> tuple[float, float]:
    """Return lag and height of the peak of the autocorrelation at one period; NaN and 0
    if there is none.
    """
    size = t.size
    even = np.linspace(t[0], t[-1], size)
    rest = without_drift(np.interp(even, t, force))
    lags = size // 2
    spectrum = fft.rfft(rest, fft.next_fast_len(size + lags, real=True))
    correlation = fft.irfft(spectrum.real**2 + spectrum.imag**2)[:lags]
    if not correlation.min() < 0:  # drift alone, or a constant force
        return math.nan, 0.0
    correlation /= correlation[0] * (1.0 - np.arange(lags) / size)
    inner = correlation[1:-1]
    is_peak = (inner >= correlation[:-2]) & (inner > correlation[2:]) & (inner > 0)
    peaks = 1 + np.flatnonzero(is_peak)
    peaks = peaks[peaks > np.argmax(correlation < 0)]
    if not peaks.size:
        return math.nan, 0.0
    # several periods correlate as well as one, but fractions of a period less
    high_enough = correlation[peaks] >= _HALF * correlation[peaks].max()
    first = int(peaks[np.argmax(high_enough)])
    return first * (even[1] - even[0]), float(correlation[first])
