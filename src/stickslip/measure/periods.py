"""The period of a force: the one estimator that all of the package uses."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from stickslip.measure.trace import (
    CHANCE,
    FEWEST_CYCLES,
    Array,
    mean_and_std,
    without_drift,
)

PERIODIC = 0.7  # least autocorrelation at one period of what is called periodic
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

# frequencies that a line is held against, and left out on either side of it
_BESIDE_A_LINE = 12
_NEXT = 2


@dataclass(frozen=True, kw_only=True)
class Cycles:
    """The cycles of a force."""

    period: float  #: mean time of a cycle; NaN if there are fewer than two rises
    variation: float  #: coefficient of variation of the times of the cycles
    #: autocorrelation of the force at one period: 1 for what repeats, near 0 for noise
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

    The autocorrelation tells one period from a part of it and from several; each cycle
    is then timed by itself, from one rise through the upper third of the range of the
    force in a typical cycle to the next.
    """
    lag, correlation = _autocorrelation_peak(t, force)
    half = 0.5 * (t[-1] - t[0]) / (t.size - 1)
    starts = (
        np.searchsorted(t, np.arange(t[0], t[-1] - lag, lag) - half)
        if correlation
        else np.zeros(0, dtype=int)
    )
    if starts.size < FEWEST_CYCLES or not np.diff(starts).all():
        starts = np.zeros(1, dtype=int)
    # Of each cycle: one that is larger than the others says nothing.
    low, high = (
        float(np.median(extreme.reduceat(force, starts)))
        for extreme in (np.minimum, np.maximum)
    )
    begins: list[float] = []
    for time in rises(t, force, (2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0)[
        1
    ].tolist():
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
    risen = outside[1:][(side[outside[1:]] > 0) & (side[outside[:-1]] < 0)]
    passed = (force[risen] - high) / (force[risen] - force[risen - 1])
    return risen, t[risen] - passed * (t[risen] - t[risen - 1])


def spectral_line(
    t: Array, force: Array, chance: float = CHANCE
) -> tuple[float, float]:
    """Period and swing, peak to peak, of the highest line of a spectrum; NaN and 0 if
    noise may show it by chance.

    A line is held against the `_BESIDE_A_LINE` frequencies beside it, two next to it
    left out: of noise of any colour that is even there, ``(1 + x/n)^-n`` of all
    ordinates exceed `x` times the mean of `n` others by chance.
    """
    size = fft.prev_fast_len(t.size, real=True)
    edge = _BESIDE_A_LINE // 2
    power = np.abs(fft.rfft(_evenly(t[:size], force[:size])))[1:] ** 2 / size**2
    if power.size <= 2 * (edge + _NEXT):
        return math.nan, 0.0
    near, wide = (
        np.convolve(power, np.ones(2 * width + 1), "valid")
        for width in (_NEXT, edge + _NEXT)
    )
    near = near[edge:-edge]
    line = power[edge + _NEXT : -edge - _NEXT]
    beside = np.maximum(wide - near, 1e-12 * power.sum() + 1e-300)  # of rounding
    best = int(np.argmax(line / beside))
    if (
        power.size * (1.0 + line[best] / beside[best]) ** -float(_BESIDE_A_LINE)
        > chance
    ):
        return math.nan, 0.0
    period = float(np.ptp(t[:size])) * size / (size - 1) / (best + edge + _NEXT + 1)
    return period, 4.0 * math.sqrt(
        max(float(near[best] - beside[best] * (2 * _NEXT + 1) / _BESIDE_A_LINE), 0.0)
    )


def _evenly(t: Array, force: Array) -> Array:
    """A force at even steps, without its drift."""
    size = t.size
    step = (t[-1] - t[0]) / (t.size - 1)
    if float(np.ptp(np.diff(t))) > 0.01 * step:
        force = np.interp(t[0] + step * np.arange(size), t, force)
    return without_drift(force)


def _autocorrelation_peak(t: Array, force: Array) -> tuple[float, float]:
    """Lag and height of the peak of the autocorrelation that belongs to one period;
    NaN and 0 if there is none.
    """
    size = t.size
    step = (t[-1] - t[0]) / (t.size - 1)
    rest = _evenly(t, force)
    lags = max(size // 2, 3)
    spectrum = fft.rfft(rest, fft.next_fast_len(size + lags, real=True))
    power = fft.irfft(spectrum.real**2 + spectrum.imag**2)[:lags]
    if not power[0] > 0:
        return math.nan, 0.0
    power /= power[0] * (1.0 - np.arange(power.size) / size)
    tops = 1 + np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]))
    tops = (
        tops[(tops > np.argmax(power < 0)) & (power[tops] > 0)]
        if power.min() < 0
        else tops[:0]
    )
    if not tops.size:
        return math.nan, 0.0
    first = int(tops[np.argmax(power[tops] >= _HALF * power[tops].max())])
    return first * step, float(power[first])
