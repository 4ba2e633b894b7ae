"""Settings and values that tests share."""

import os

import pytest
from hypothesis import settings

from stickslip.model.distributions import (
    Distribution,
    Empirical,
    Exponential,
    Gamma,
    Gaussian,
    LogNormal,
    SteadyState,
    Uniform,
    Weibull,
)

# Before anything imports matplotlib, and inherited by the commands that tests start.
os.environ["MPLBACKEND"] = "Agg"

# Same examples on every machine and every run; compiling a kernel inside an example is
# not a failure.
settings.register_profile("stickslip", derandomize=True, deadline=None)
settings.load_profile("stickslip")

# Every distribution of thresholds, narrow and wide, with and without a jump or a
# singular start. A new distribution gets its line here.
DISTRIBUTIONS: dict[str, Distribution] = {
    "gaussian": Gaussian(mean=1.0, std=0.1),
    "gaussian-cut": Gaussian(mean=0.4, std=0.5, lower=0.0),
    "uniform": Uniform(low=0.6, high=1.4),
    "exponential": Exponential(mean=0.8),
    "gamma": Gamma(mean=1.0, std=0.4),
    "gamma-singular": Gamma(mean=1.0, std=1.3),
    "lognormal": LogNormal(mean=1.0, std=0.5),
    "weibull": Weibull(scale=1.1, shape=2.5),
    "weibull-singular": Weibull(scale=0.9, shape=0.8),
    "empirical": Empirical(
        edges=(0.2, 0.5, 0.9, 1.0, 1.6), weights=(1.0, 0.0, 4.0, 2.0)
    ),
    "steady-gaussian": SteadyState(thresholds=Gaussian(mean=1.0, std=0.1)),
    "steady-uniform": SteadyState(thresholds=Uniform(low=0.6, high=1.4)),
}


# Distributions that reach below zero: for initial stretchings, and for thresholds once
# conditioned on positive values.
DISTRIBUTIONS_ON_BOTH_SIDES: dict[str, Distribution] = {
    "gaussian-both-sides": Gaussian(mean=0.1, std=0.3),
    "gaussian-cut-below-zero": Gaussian(mean=0.1, std=0.3, lower=-0.2),
    "gaussian-cut-far-up": Gaussian(mean=-1.0, std=0.4, lower=0.0),
    "uniform-both-sides": Uniform(low=-0.5, high=0.3),
    "empirical-both-sides": Empirical(
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
    """Every distribution in turn, those that reach below zero among them."""
    chosen: Distribution = request.param
    return chosen
