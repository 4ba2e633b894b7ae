"""Statistics of a series of slips: numbers without a unit, of peaks and troughs in
their order.

Slow drifts of a bench are taken out first: a cubic in the number of the slip. Raw
correlations would be those of the drift. Nothing here depends on time, as drives are
rarely as steady as they should be.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from stickslip.measure.trace import Array

_DEGREE = 3
_BLOCK = 10
_RESAMPLES = 400


class _Slips(NamedTuple):
    """Series of slips along the last axis, detrended; forces over the mean peak,
    quantiles over the mean drop.
    """

    P: Array
    T: Array
    mean: Array
    drops: Array
    reloads: Array
    quantiles: Array


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
"""Statistics that are fitted, each with the scale on which its scatter is even: the
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
"""Statistics that are not fitted, only compared: the test of the fit."""

FITTED = tuple(_FITTED)
HELD_OUT = tuple(_HELD_OUT)
NAMES = FITTED + HELD_OUT


def detrended(values: Array) -> Array:
    """Take a cubic in the number of the slip out of the last axis; means become 0."""
    count = values.shape[-1]
    basis, _ = np.linalg.qr(
        np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), _DEGREE)
    )
    return np.asarray(values - (values @ basis) @ basis.T, dtype=float)


def statistics(peaks: Array, troughs: Array) -> Array:
    """The statistics `NAMES` of series of slips, along a new last axis.

    Forces before and after each slip, along the last axis, are in any unit.
    """
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
    """Statistics of block-bootstrap samples of a detrended series, first axis:
    memory from slip to slip stays.
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
    """The fitted statistics on scales on which their scatter is even: logarithms,
    and Fisher's z of correlations.
    """
    return np.stack(
        [scale(found[..., i]) for i, (_, scale) in enumerate(_FITTED.values())],
        axis=-1,
    )
