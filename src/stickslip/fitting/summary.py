"""What a series of slips is summarised by: numbers without a unit, of peaks and troughs in their order.

Slow drifts of a bench are taken out first: a cubic in the number of the slip. Raw correlations would be those of the
drift. Nothing here depends on time, as drives are rarely as steady as they should be.
"""

from __future__ import annotations

import numpy as np

from stickslip.measure.arrays import Array

FITTED = (
    "drop fraction",
    "scatter of peaks",
    "scatter of troughs",
    "CV of drops",
    "peak with its trough",
    "trough with the next peak",
    "peak with the next peak",
    "10 % quantile of drops",
    "90 % quantile of drops",
)
"""Statistics that are fitted: the drop over the peak; standard deviations over the mean peak; correlations; quantiles
over the mean drop."""

HELD_OUT = (
    "drop with the next drop",
    "CV of reloadings",
    "drop with the reloading before",
    "drop with the reloading after",
    "largest peak",
    "smallest trough",
    "drops below half the mean",
    "skewness of peaks",
    "skewness of troughs",
    "5 % quantile of drops",
    "95 % quantile of drops",
)
"""Statistics that are not fitted, only compared: the test of what was."""

NAMES = FITTED + HELD_OUT
_LOGARITHMIC = (0, 1, 2, 3)
_CORRELATIONS = (4, 5, 6)
_DEGREE = 3
_BLOCK, _RESAMPLES = 10, 400


def detrended(values: Array) -> Array:
    """Take a cubic in the number of the slip out of the last axis; means become 0."""
    count = values.shape[-1]
    basis, _ = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), _DEGREE))
    return np.asarray(values - (values @ basis) @ basis.T, dtype=float)


def statistics(peaks: Array, troughs: Array) -> Array:
    """The statistics `NAMES` of series of slips.

    Parameters
    ----------
    peaks, troughs : array
        Force before and after each slip, along the last axis; in any unit.

    Returns
    -------
    array
        The last axis is that of `NAMES`.
    """
    high = peaks.mean(axis=-1, keepdims=True)
    mean_drop = (peaks - troughs).mean(axis=-1, keepdims=True)
    P, T = detrended(peaks) / high, detrended(troughs) / high
    return _of(P, T, np.squeeze(mean_drop / high, axis=-1))


def _of(P: Array, T: Array, fraction: Array) -> Array:
    """Statistics of detrended peaks and troughs, and of the mean drop, all over the mean peak."""
    drops = fraction[..., None] + P - T
    reloads = fraction[..., None] + P[..., 1:] - T[..., :-1]
    mean = fraction
    q05, q10, q90, q95 = np.quantile(drops, (0.05, 0.10, 0.90, 0.95), axis=-1)
    found = (
        fraction,
        P.std(axis=-1),
        T.std(axis=-1),
        drops.std(axis=-1) / mean,
        _correlation(P, T),
        _correlation(T[..., :-1], P[..., 1:]),
        _correlation(P[..., :-1], P[..., 1:]),
        q10 / mean,
        q90 / mean,
        _correlation(drops[..., :-1], drops[..., 1:]),
        reloads.std(axis=-1) / mean,
        _correlation(reloads, drops[..., 1:]),
        _correlation(drops[..., :-1], reloads),
        P.max(axis=-1),
        T.min(axis=-1),
        (drops < 0.5 * mean[..., None]).mean(axis=-1),
        _skewness(P),
        _skewness(T),
        q05 / mean,
        q95 / mean,
    )
    return np.stack(found, axis=-1)


def _correlation(x: Array, y: Array) -> Array:
    x, y = x - x.mean(axis=-1, keepdims=True), y - y.mean(axis=-1, keepdims=True)
    size = np.sqrt((x * x).sum(axis=-1) * (y * y).sum(axis=-1))
    return np.asarray((x * y).sum(axis=-1) / np.where(size > 0, size, 1.0), dtype=float)


def _skewness(x: Array) -> Array:
    x = x - x.mean(axis=-1, keepdims=True)
    std = x.std(axis=-1)
    return np.asarray((x**3).mean(axis=-1) / np.where(std > 0, std, 1.0) ** 3, dtype=float)


def resampled(peaks: Array, troughs: Array, *, seed: int = 0, resamples: int = _RESAMPLES) -> Array:
    """Statistics of block-bootstrap samples of one series of slips, along the first axis.

    The blocks, of ten slips, are drawn from the detrended series, wrapped around its end, so that the memory from
    slip to slip stays.
    """
    count = peaks.size
    block = min(_BLOCK, count)
    many = -(-count // block)
    begins = np.random.default_rng(seed).integers(0, count, (resamples, many, 1))
    index = ((begins + np.arange(block)) % count).reshape(resamples, -1)[:, :count]
    high = float(peaks.mean())
    P, T = (detrended(x) / high for x in (peaks, troughs))
    fraction = 1.0 - float(troughs.mean()) / high
    P, T = P[index], T[index]
    means = P.mean(axis=-1), T.mean(axis=-1)
    return _of(P - means[0][:, None], T - means[1][:, None], fraction + means[0] - means[1])


def covariance(peaks: Array, troughs: Array, *, seed: int = 0) -> Array:
    """Covariance of the statistics `NAMES` of one series of slips, by block bootstrap."""
    return np.asarray(np.cov(resampled(peaks, troughs, seed=seed), rowvar=False), dtype=float)


def comparable(found: Array) -> Array:
    """The fitted statistics on scales on which their scatter is even: logarithms, and Fisher's z of correlations."""
    scaled = np.array(found[..., : len(FITTED)])
    for i in _LOGARITHMIC:
        scaled[..., i] = np.log(np.maximum(scaled[..., i], 1e-4))
    for i in _CORRELATIONS:
        scaled[..., i] = np.arctanh(np.clip(scaled[..., i], -0.98, 0.98))
    return scaled
