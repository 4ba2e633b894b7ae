"""Settings and values that the tests share."""

import os

import pytest
from hypothesis import settings

import stickslip as ss
from stickslip.model.distributions import Distribution

# Before anything imports matplotlib, and inherited by the commands that tests start.
os.environ["MPLBACKEND"] = "Agg"

# Same examples on every machine and every run; compiling a kernel inside an example is
# not a failure.
settings.register_profile("stickslip", derandomize=True, deadline=None)
settings.load_profile("stickslip")

# Every distribution of thresholds, narrow and wide, with and without a jump or a
# singular start. A new distribution gets its line here.
DISTRIBUTIONS: dict[str, Distribution] = {
    "gaussian": ss.Gaussian(mean=1.0, std=0.1),
    "gaussian-cut": ss.Gaussian(mean=0.4, std=0.5, lower=0.0),
    "uniform": ss.Uniform(low=0.6, high=1.4),
    "exponential": ss.Exponential(mean=0.8),
    "gamma": ss.Gamma(mean=1.0, std=0.4),
    "gamma-singular": ss.Gamma(mean=1.0, std=1.3),
    "lognormal": ss.LogNormal(mean=1.0, std=0.5),
    "weibull": ss.Weibull(scale=1.1, shape=2.5),
    "weibull-singular": ss.Weibull(scale=0.9, shape=0.8),
    "empirical": ss.Empirical(
        edges=(0.2, 0.5, 0.9, 1.0, 1.6), weights=(1.0, 0.0, 4.0, 2.0)
    ),
    "steady-gaussian": ss.model.SteadyState(thresholds=ss.Gaussian(mean=1.0, std=0.1)),
    "steady-uniform": ss.model.SteadyState(thresholds=ss.Uniform(low=0.6, high=1.4)),
}


# Distributions that reach below zero: for initial stretchings, and for thresholds once
# conditioned on positive values.
DISTRIBUTIONS_ON_BOTH_SIDES: dict[str, Distribution] = {
    "gaussian-both-sides": ss.Gaussian(mean=0.1, std=0.3),
    "gaussian-cut-below-zero": ss.Gaussian(mean=0.1, std=0.3, lower=-0.2),
    "gaussian-cut-far-up": ss.Gaussian(mean=-1.0, std=0.4, lower=0.0),
    "uniform-both-sides": ss.Uniform(low=-0.5, high=0.3),
    "empirical-both-sides": ss.Empirical(
        edges=(-1.0, -0.5, 0.25, 0.5), weights=(1.0, 2.0, 3.0)
    ),
}


@pytest.fixture(scope="session")
def distributions() -> dict[str, Distribution]:
    """Every distribution of thresholds, by name."""
    return DISTRIBUTIONS


@pytest.fixture(params=DISTRIBUTIONS.values(), ids=DISTRIBUTIONS.keys())
def distribution(request: pytest.FixtureRequest) -> Distribution:
    """Every distribution of thresholds in turn."""
    chosen: Distribution = request.param
    return chosen


@pytest.fixture(
    params=[*DISTRIBUTIONS.values(), *DISTRIBUTIONS_ON_BOTH_SIDES.values()],
    ids=[*DISTRIBUTIONS, *DISTRIBUTIONS_ON_BOTH_SIDES],
)
def any_distribution(request: pytest.FixtureRequest) -> Distribution:
    """Every distribution in turn, including those that reach below zero."""
    chosen: Distribution = request.param
    return chosen
