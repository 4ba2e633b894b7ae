"""Draws of the parameters from the statistics of a trace, by comparison with
simulations.

Approximate Bayesian computation: the simulated series nearest to the trace are kept,
and their parameters are adjusted by a local linear regression on the difference between
their statistics and those of the trace. Of the methods that were tried, this one had
intervals with the right coverage. If the trace lies at the edge of the simulations, the
regression would extrapolate, and the parameters are not adjusted.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import expit, logit

from stickslip.errors import InputError
from stickslip.fitting.series_table import Observation, SeriesTable
from stickslip.fitting.summary import comparable
from stickslip.measure.trace import Array

NEAREST = 300  # number of series that are kept
# fewest draws that agree with the known values: ten for each coefficient of the
# regression
_AGREE = 100
# percentile of the distance above which no draw is adjusted, and a note is given
EDGE = 95.0
BEYOND = 99.9  # percentile of the distance above which no fit is made
_NEIGHBOUR = 10  # the distance is that of the tenth neighbour
_COMPARED = 1000  # number of simulated series whose distances give the percentiles
_SMALL = 1e-4  # distance from the ends of a range within which logits are clipped
# draws with a smaller likelihood, whose largest value is 1, do not count
_LITTLE = 1e-3


class Sample(NamedTuple):
    """Weighted draws of the parameters, and how they were found."""

    parts: Array  #: parameters, as fractions of the ranges of the prior
    weights: Array
    #: percentile of the trace's distance from the simulations, among the distances of
    #: series drawn from the prior
    edge: float
    adjusted: bool  #: whether the draws were adjusted by a regression
    invalid: float  #: fraction of the prior without stick-slip as in the trace
    simulations: int  #: number of simulated series

    @property
    def effective(self) -> float:
        """Effective number of draws: ``1/(sum of squared weights)``."""
        return float(1.0 / (self.weights**2).sum())


def infer(
    table: SeriesTable,
    observation: Observation,
    observed: Array,
    *,
    likelihood: Callable[[Array], Array] = lambda values: np.ones(len(values)),
    nearest: int = NEAREST,
    seen: Array | None = None,
    seed: int = 0,
) -> Sample:
    """Return weighted draws of parameters that give the observed statistics;
    `InputError` if no simulation comes near them.

    The `likelihood`, a function of parameters along the last axis, is at most 1. `seen`
    are the statistics of the table with this observation, if they are known.
    """
    if seen is None:
        seen = observation.sample(table, seed=seed)[0]
    valid = np.isfinite(seen[:, 0])
    if valid.sum() < nearest:
        raise InputError(
            f"fit: {valid.sum()} of {len(table)} draws from the prior stick-slip as "
            "the trace does, with "
            f"{observation.slips} slips above the smallest drop: at least {nearest} "
            "are needed; take more draws"
        )
    parts = table.parts[valid]
    found = comparable(seen[valid])
    target = comparable(observed)
    # scale by the median scatter or, where most draws are equal (correlations near 1),
    # by the standard deviation
    scale = 1.4826 * np.median(np.abs(found - np.median(found, axis=0)), axis=0)
    scale = np.maximum(np.maximum(scale, 0.1 * found.std(axis=0)), 1e-9)
    # percentile of the distance to the tenth neighbour, among those of draws from the
    # prior
    tree = cKDTree(found / scale)
    rng = np.random.default_rng([seed, 1])
    some = rng.choice(len(found), size=min(_COMPARED, len(found)), replace=False)
    usual = np.asarray(tree.query(found[some] / scale, k=_NEIGHBOUR + 1)[0])[:, -1]
    here = float(np.asarray(tree.query(target / scale, k=_NEIGHBOUR)[0])[-1])
    edge = float(100.0 * (usual < here).mean())
    if edge > BEYOND:
        raise InputError(
            "fit: no simulation comes near this trace: it lies farther from its "
            f"nearest simulations than {edge:.4g} "
            "percent of the draws from the prior. The model knows slow stick-slip, in "
            "which contacts re-attach where "
            "the slider stops: drive slower if the force falls between its slips or "
            "their size varies widely; else "
            "something else made the trace"
        )
    weights = likelihood(table.prior.values(parts))
    if (agree := int((weights > _LITTLE).sum())) < min(nearest, _AGREE):
        raise InputError(
            f"fit: {agree} of {len(parts)} draws agree with what is known, at least "
            f"{min(nearest, _AGREE)} are needed; "
            "check the known values, give their errors as (value, error), or take more "
            "draws"
        )
    away = found - target
    distance = np.sqrt(((away / scale) ** 2).sum(axis=1))
    distance[weights <= _LITTLE] = np.inf
    kept = np.argsort(distance)[: min(nearest, agree)]
    weights = weights[kept] * (
        1.0 - (distance[kept] / (distance[kept[-1]] * (1 + 1e-9))) ** 2
    )
    return Sample(
        parts=parts[kept]
        if edge > EDGE
        else _adjusted(parts[kept], weights, away[kept]),
        weights=weights / weights.sum(),
        edge=edge,
        adjusted=edge <= EDGE,
        invalid=1.0 - float(valid.mean()),
        simulations=len(table),
    )


def _adjusted(parts: Array, weights: Array, away: Array) -> Array:
    """Return the parameters adjusted by a weighted linear regression of their logits,
    which keeps them within their ranges.
    """
    away = away / np.maximum(away.std(axis=0), 1e-9)
    design = np.column_stack([np.ones(len(away)), away])
    at = logit(np.clip(parts, _SMALL, 1.0 - _SMALL))
    ridge = np.diag(
        [
            0.0,
            *[1e-3 * float(weights.sum())] * away.shape[1],
        ]
    )
    weighted = design.T * weights
    slope = np.linalg.solve(weighted @ design + ridge, weighted @ at)
    return expit(at - away @ slope[1:])
