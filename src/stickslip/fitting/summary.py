"""Dimensionless statistics of a series of slips, from the sequence of its peaks and
troughs.

Slow drifts of a bench, as a cubic polynomial in the number of the slip, are removed
first, as they would dominate the correlations. Times are not used, as drives are rarely
as steady as they should be.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from stickslip.errors import InputError, numbers
from stickslip.measure.trace import Array

_DEGREE = 3  # of the polynomial of the drift
_BLOCK = 10  # slips of a block of the bootstrap
_RESAMPLES = 400  # number of bootstrap samples


class _Slips(NamedTuple):
    """Detrended series of slips along the last axis; forces over the mean peak,
    quantiles over the mean drop.
    """

    P: Array  # peaks
    T: Array  # troughs
    mean: Array  # mean drop
    drops: Array
    reloads: Array  # rises from each trough to the next peak
    quantiles: Array  # of the drops: 5, 10, 90 and 95 %


def _correlation(x: Array, y: Array) -> Array:
    x = x - x.mean(axis=-1, keepdims=True)
    y = y - y.mean(axis=-1, keepdims=True)
    size = np.sqrt((x * x).sum(axis=-1) * (y * y).sum(axis=-1))
    return np.asarray((x * y).sum(axis=-1) / np.where(size > 0, size, 1.0), dtype=float)


def _skewness(x: Array) -> Array:
    x = x - x.mean(axis=-1, keepdims=True)
    std = x.std(axis=-1)
    return np.asarray(
        (x**3).mean(axis=-1) / np.where(std > 0, std, 1.0) ** 3,
        dtype=float,
    )


def _logarithm(x: Array) -> Array:
    return np.log(np.maximum(x, 1e-4))


def _fisher(x: Array) -> Array:
    return np.arctanh(np.clip(x, -0.98, 0.98))


_FITTED: dict[str, tuple[Callable[[_Slips], Array], Callable[[Array], Array]]] = {
    "drop fraction": (lambda s: s.mean, _logarithm),
    "scatter of peaks": (lambda s: s.P.std(axis=-1), _logarithm),
    "scatter of troughs": (lambda s: s.T.std(axis=-1), _logarithm),
    "CV of drops": (
        lambda s: s.drops.std(axis=-1) / s.mean,
        _logarithm,
    ),
    "corr(peak, trough)": (lambda s: _correlation(s.P, s.T), _fisher),
    "corr(trough, next peak)": (
        lambda s: _correlation(s.T[..., :-1], s.P[..., 1:]),
        _fisher,
    ),
    "corr(peak, next peak)": (
        lambda s: _correlation(s.P[..., :-1], s.P[..., 1:]),
        _fisher,
    ),
    "10 % quantile of drops": (lambda s: s.quantiles[1], np.asarray),
    "90 % quantile of drops": (lambda s: s.quantiles[2], np.asarray),
}
"""Statistics that are fitted, each with the scale on which its scatter is uniform: the
drop over the peak; standard deviations over the mean peak; correlations; quantiles over
the mean drop.
"""

_HELD_OUT: dict[str, Callable[[_Slips], Array]] = {
    "drop with the next drop": lambda s: _correlation(
        s.drops[..., :-1], s.drops[..., 1:]
    ),
    "CV of reloadings": lambda s: s.reloads.std(axis=-1) / s.mean,
    "drop with the reloading before": lambda s: _correlation(
        s.reloads, s.drops[..., 1:]
    ),
    "drop with the reloading after": lambda s: _correlation(
        s.drops[..., :-1], s.reloads
    ),
    "largest peak": lambda s: s.P.max(axis=-1),
    "smallest trough": lambda s: s.T.min(axis=-1),
    "drops below half the mean": lambda s: (s.drops < 0.5 * s.mean[..., None]).mean(
        axis=-1
    ),
    "skewness of peaks": lambda s: _skewness(s.P),
    "skewness of troughs": lambda s: _skewness(s.T),
    "5 % quantile of drops": lambda s: s.quantiles[0],
    "95 % quantile of drops": lambda s: s.quantiles[3],
}
"""Statistics that are not fitted, but compared to test the fit."""

FITTED = tuple(_FITTED)
HELD_OUT = tuple(_HELD_OUT)
NAMES = FITTED + HELD_OUT


def detrended(values: Array) -> Array:
    """Return values without their cubic trend, and without their mean, along the last
    axis.
    """
    count = values.shape[-1]
    basis, _ = np.linalg.qr(
        np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), _DEGREE)
    )
    return np.asarray(values - (values @ basis) @ basis.T, dtype=float)


def statistics(peaks: Array, troughs: Array) -> Array:
    """Return the statistics `NAMES` of series of slips, along a new last axis.

    Forces before and after each slip, along the last axis, may have any unit.
    """
    peaks = numbers("peaks", peaks)
    troughs = numbers("troughs", troughs)
    if peaks.ndim == 0 or peaks.shape != troughs.shape:
        raise InputError(
            f"peaks, troughs: shapes {peaks.shape} and {troughs.shape}: must be equal"
        )
    return unchecked_statistics(peaks, troughs)


def unchecked_statistics(peaks: Array, troughs: Array) -> Array:
    """Return `statistics` of series that may be unknown; theirs are NaN."""
    high = peaks.mean(axis=-1, keepdims=True)
    mean_drop = (peaks - troughs).mean(axis=-1, keepdims=True)
    P = detrended(peaks) / high
    T = detrended(troughs) / high
    return _statistics_of(P, T, np.squeeze(mean_drop / high, axis=-1))


def _statistics_of(P: Array, T: Array, mean: Array) -> Array:
    drops, reloads = (
        mean[..., None] + rises for rises in (P - T, P[..., 1:] - T[..., :-1])
    )
    slips = _Slips(
        P,
        T,
        mean,
        drops,
        reloads,
        np.quantile(drops, (0.05, 0.10, 0.90, 0.95), axis=-1) / mean,
    )
    of = (
        *(statistic for statistic, _ in _FITTED.values()),
        *_HELD_OUT.values(),
    )
    return np.stack([statistic(slips) for statistic in of], axis=-1)


def resampled(
    peaks: Array, troughs: Array, *, seed: int = 0, resamples: int = _RESAMPLES
) -> Array:
    """Return the statistics of block-bootstrap samples of a detrended series, along the
    first axis; blocks keep the correlation from slip to slip.
    """
    count = peaks.size
    block = min(_BLOCK, count)
    many = -(-count // block)
    begins = np.random.default_rng(seed).integers(0, count, (resamples, many, 1))
    index = ((begins + np.arange(block)) % count).reshape(resamples, -1)[:, :count]
    high = float(peaks.mean())
    P, T = (detrended(x) / high for x in (peaks, troughs))
    fraction = 1.0 - float(troughs.mean()) / high
    P = P[index]
    T = T[index]
    means = P.mean(axis=-1), T.mean(axis=-1)
    return _statistics_of(
        P - means[0][:, None],
        T - means[1][:, None],
        fraction + means[0] - means[1],
    )


def comparable(found: Array) -> Array:
    """Return the fitted statistics on scales on which their scatter is uniform:
    logarithms, and Fisher's z for correlations.
    """
    return np.stack(
        [scale(found[..., i]) for i, (_, scale) in enumerate(_FITTED.values())],
        axis=-1,
    )
