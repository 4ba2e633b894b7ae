"""Distributions of thresholds with closed-form answers."""

from __future__ import annotations

import numpy as np

from stickslip import (
    Exponential,
    Gamma,
    Gaussian,
    Interface,
    LogNormal,
    MasterEquation,
    Uniform,
    Weibull,
    critical_stiffness,
    kinetic_friction,
    rigid_slide,
    static_friction,
)
from stickslip.model import Renewal, SteadyState
from stickslip.model.distributions import Distribution
from stickslip.paper import Claim
from stickslip.paper.figure import at_least, at_most, near
from stickslip.rigid import effective_stiffness
from verification.study import Study, finding

_AT_REST = Gaussian(mean=0.0, std=0.0)


def _uniform() -> tuple[Claim, ...]:
    """Check that the force from a delta start is a parabola until the first contact
    breaks twice.
    """
    edges = ((0.9, 1.0), (0.8, 1.2), (0.6, 1.1), (1.5, 1.7))
    stiffness = []
    force = []
    for low, high in edges:
        interface = Interface(thresholds=Uniform(low=low, high=high), initial=_AT_REST)
        stiffness.append(
            near(
                f"K* on [{low}, {high}]",
                critical_stiffness(interface),
                high / (high - low) - 1,
                1e-3,
                "k",
            )
        )
        run = rigid_slide(
            interface, low + 0.5 * min(high - low, low), method=Renewal(4096)
        )
        X = run["displacement"].to_numpy()
        # X (1 - broken) plus the force of re-attached contacts, each Int_low^X (X - a)
        # da / width.
        past = np.maximum(X - low, 0.0) / (high - low)
        parabola = X * (1 - past) + 0.5 * past * np.maximum(X - low, 0.0)
        force.append(
            at_most(
                f"error of F on [{low}, {high}]",
                float(np.abs(run["friction_force"] - parabola).max()),
                1e-6,
                "f_s",
            )
        )
    return (
        finding(
            (
                "Rectangular thresholds on [x1, x2] from a delta start, x2 < 2 x1: K* "
                "= "
                "x2/(x2 - x1) - 1, Eq. (8)"
            ),
            *stiffness,
            evidence="renewal convolution, steepest fall of the force",
        ),
        finding(
            (
                "The force of rectangular thresholds is piecewise quadratic until a "
                "contact breaks twice"
            ),
            *force,
            evidence="renewal convolution, 4,096 intervals",
        ),
    )


def _exponential() -> tuple[Claim, ...]:
    mean = 0.8
    distribution = Exponential(mean=mean)
    rest = Interface(thresholds=distribution, initial=_AT_REST)
    X = np.linspace(0.0, 10.0, 200)
    run = rigid_slide(rest, 5.0)
    steady = rigid_slide(
        Interface(
            thresholds=distribution, initial=SteadyState(thresholds=distribution)
        ),
        5.0,
    )
    exact = mean * (1 - np.exp(-run["displacement"].to_numpy() / mean))
    cohorts = rigid_slide(rest, 5.0, method=MasterEquation(rtol=1e-6))
    other = mean * (1 - np.exp(-cohorts["displacement"].to_numpy() / mean))
    return (
        finding(
            (
                "Exponential thresholds have no memory: F = m1 (1 - exp(-X/m1)) from "
                "rest, "
                "and never falls"
            ),
            at_most(
                "error of F, renewal",
                float(np.abs(run["friction_force"] - exact).max()),
                1e-8,
                "f_s",
            ),
            at_most(
                "error of F, master equation, rtol 1e-6",
                float(np.abs(cohorts["friction_force"] - other).max()),
                2e-6,
                "f_s",
            ),
            at_most(
                "largest K_eff = -dF/dX",
                float(effective_stiffness(rest, X).max()),
                1e-9,
                "k",
            ),
            near("K*", critical_stiffness(rest), 0.0, 1e-9, "k"),
            evidence="rigid motion over 5 x_s",
        ),
        finding(
            "In the steady state of exponential thresholds the force is N k m1 at once",
            at_most(
                "largest relative deviation",
                float(np.abs(steady["friction_force"] / mean - 1).max()),
                1e-9,
            ),
            evidence="renewal convolution from SteadyState",
        ),
    )


def _gamma() -> tuple[Claim, ...]:
    """Check a gamma distribution of shape 2, with which attachments are an alternating
    renewal process of two exponential stages.
    """
    rate = 2.0  # shape 2, mean 1
    distribution = Gamma(mean=1.0, std=1.0 / np.sqrt(2.0))
    interface = Interface(thresholds=distribution, initial=_AT_REST)
    run = rigid_slide(interface, 6.0)
    X = run["displacement"].to_numpy()
    # renewal density of two stages of rate 2
    births = rate / 2 * (1 - np.exp(-2 * rate * X))
    # F = X J(X) + Int births(X - x) x J(x) dx, J = (1 + rate x) exp(-rate x):
    # integrated by hand.
    survival = (1 + rate * X) * np.exp(-rate * X)

    def moment(a: float) -> np.ndarray:
        """Int_0^X x (1 + rate x) exp(-a x) dx."""
        e = np.exp(-a * X)
        first = 1 / a**2 - e * (X / a + 1 / a**2)
        second = 2 / a**3 - e * (X**2 / a + 2 * X / a**2 + 2 / a**3)
        return first + rate * second

    # births(X - x) = rate/2 (1 - exp(-2 rate X) exp(2 rate x)); exp(2 rate x - rate
    # x) = exp(rate x).
    force = X * survival + rate / 2 * (
        moment(rate) - np.exp(-2 * rate * X) * moment(-rate)
    )
    return (
        finding(
            (
                "Gamma thresholds of shape 2 have a closed renewal density, and with "
                "it a "
                "closed force"
            ),
            at_most(
                "error of the breaking rate",
                float(np.abs(run["breaking_rate"] - births).max()),
                1e-7,
                "1/x_s",
            ),
            at_most(
                "error of F",
                float(np.abs(run["friction_force"] - force).max()),
                1e-7,
                "f_s",
            ),
            near(
                "F_k = m2/(2 m1)",
                float(kinetic_friction(interface)),
                0.75,
                1e-12,
                "f_s",
            ),
            evidence="renewal convolution over 6 x_s against the integral by hand",
        ),
    )


def _static_over_kinetic() -> tuple[Claim, ...]:
    distributions: dict[str, Distribution] = {
        "Gaussian .02": Gaussian(mean=1.0, std=0.02),
        "Gaussian .1": Gaussian(mean=1.0, std=0.1),
        "Gaussian .3": Gaussian(mean=1.0, std=0.3),
        "uniform [.6, 1.4]": Uniform(low=0.6, high=1.4),
        "gamma .4": Gamma(mean=1.0, std=0.4),
        "log-normal .5": LogNormal(mean=1.0, std=0.5),
        "Weibull 2.5": Weibull(scale=1.1, shape=2.5),
        "exponential": Exponential(mean=1.0),
    }
    measured = []
    for name, distribution in distributions.items():
        interface = Interface(thresholds=distribution, initial=_AT_REST)
        ratio = static_friction(interface)[0] / float(kinetic_friction(interface))
        measured += [
            at_least(f"F_s/F_k, {name}, less 1", ratio - 1.0, -1e-3),
            at_most(f"F_s/F_k, {name}", ratio, 2.0),
        ]
    narrow = Interface(thresholds=Gaussian(mean=1.0, std=0.002), initial=_AT_REST)
    limit = static_friction(narrow)[0] / float(kinetic_friction(narrow))
    return (
        finding(
            (
                "Static over kinetic friction lies between 1 (no memory) and 2 (all "
                "thresholds equal)"
            ),
            *measured,
            near("F_s/F_k, Gaussian .002", limit, 2.0, 0.02),
            evidence=(
                "largest force of slow rigid motion from a delta start, over m2/(2 m1)"
            ),
        ),
    )


_GROUP = "Closed forms"
STUDIES = (
    Study(name="uniform", group=_GROUP, title="Rectangular thresholds", run=_uniform),
    Study(
        name="exponential",
        group=_GROUP,
        title="Exponential thresholds",
        run=_exponential,
    ),
    Study(name="gamma", group=_GROUP, title="Gamma thresholds of shape 2", run=_gamma),
    Study(
        name="ratio",
        group=_GROUP,
        title="Static over kinetic friction",
        run=_static_over_kinetic,
    ),
)
