"""Orders of convergence: halve the step, see what is left."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from stickslip.paper.output import at_most, between, near

from stickslip import (
    Contacts,
    Delay,
    Gaussian,
    Interface,
    Langevin,
    MasterEquation,
    Output,
    Renewal,
    constant,
    kinetic_friction,
    rigid_slide,
    simulate,
)
from stickslip.model import FIG4, FIG8
from stickslip.paper import Claim
from verification.study import Study, finding, held_friction

_SMOOTH = Interface(thresholds=Gaussian(mean=1.0, std=0.1), initial=Gaussian(mean=0.0, std=0.1))


def _slope(steps: list[int], errors: list[float]) -> float:
    """Power of the step by which the error falls."""
    return -float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def _renewal() -> tuple[Claim, ...]:
    distance = 4.0
    points = [128, 256, 512]
    exact = rigid_slide(_SMOOTH, distance, method=Renewal(8192))["friction_force"].to_numpy()
    errors = []
    for n in points:
        errors.append(
            float(
                np.abs(rigid_slide(_SMOOTH, distance, method=Renewal(n))["friction_force"] - exact[:: 8192 // n]).max()
            )
        )
    return (
        finding(
            "The renewal convolution is of sixth order for a smooth distribution",
            between("order", _slope(points, errors), 5.0, 9.0),
            at_most("error with 512 intervals", errors[-1], 1e-7, "f_s"),
            evidence="Gaussian thresholds and start of standard deviation .1 over 4 x_s, against 8,192 intervals",
        ),
    )


def _cohorts() -> tuple[Claim, ...]:
    interface = replace(FIG4.interface, delay=Delay(0.2))
    cells, finest = [200, 400, 800], 3200
    output = Output(interval=0.01)

    def table(count: int) -> np.ndarray:
        run = simulate(interface, FIG4.slider, constant(1.0, 3.0), MasterEquation(cells=count), output=output)
        return np.stack([run[name].to_numpy() for name in ("displacement", "spring_force", "friction_force")])

    exact = table(finest)
    errors = []
    for count in cells:
        errors.append(float(np.abs(table(count) - exact).max()))
    rigid = []
    renewal = rigid_slide(_SMOOTH, 4.0, method=Renewal(4096))
    for count in cells:
        run = rigid_slide(_SMOOTH, 4.0, method=MasterEquation(cells=count))
        rigid.append(
            float(
                np.abs(
                    run["friction_force"]
                    - np.interp(run["displacement"], renewal["displacement"], renewal["friction_force"])
                ).max()
            )
        )
    return (
        finding(
            "The master equation on cohorts is of second order",
            # Against a reference only 16 times finer the last error looks smaller than it is, by a sixteenth.
            near("order through a slip, K 2, tau .2", _slope(cells, errors), 2.0, 0.4),
            near("order in rigid motion", _slope(cells, rigid), 2.0, 0.3),
            at_most("error with 800 cells in rigid motion", rigid[-1], 1e-5, "f_s"),
            evidence="200, 400 and 800 cells per x_s against 3,200, and against the renewal convolution",
        ),
    )


def _contacts() -> tuple[Claim, ...]:
    counts, seeds = [400, 1_600, 6_400, 25_600], 24
    reference = rigid_slide(_SMOOTH, 4.0)
    scatter = []
    for N in counts:
        square = 0.0
        for seed in range(seeds):
            run = rigid_slide(_SMOOTH, 4.0, method=Contacts(N, seed=seed))
            square += float(
                (
                    (
                        run["friction_force"]
                        - np.interp(run["displacement"], reference["displacement"], reference["friction_force"])
                    )
                    ** 2
                ).mean()
            )
        scatter.append(math.sqrt(square / seeds))
    return (
        finding(
            "Contacts scatter about the master equation as N^(-1/2)",
            # Each rms of 24 runs of a few independent stretches is known to some 10 %: .04 in the slope.
            near("power of N", -_slope(counts, scatter), -0.5, 0.12),
            evidence=f"{seeds} runs each of {', '.join(f'{N:,}' for N in counts)} contacts over 4 x_s",
        ),
    )


def _kinetic() -> tuple[Claim, ...]:
    interface, velocity = replace(FIG8.interface, ageing=Langevin(rate=1.0)), 0.5
    exact = float(kinetic_friction(interface, velocity))
    cells, errors = [100, 200, 400], []
    for count in cells:
        force = held_friction(interface, velocity, MasterEquation(cells=count), distance=8.0, after=6.0)
        errors.append(abs(force - exact))
    return (
        finding(
            "The kinetic equation of ageing thresholds in time is of second order, but for the layer at the boundary",
            between("order", _slope(cells, errors), 1.5, 2.5),
            at_most("relative error with 400 cells", errors[-1] / exact, 1e-3),
            evidence="steady force at u = .5 against the stationary kinetic equation",
        ),
    )


_GROUP = "Orders of convergence"
STUDIES = (
    Study(name="renewal-order", group=_GROUP, title="Renewal convolution", run=_renewal),
    Study(name="cohorts-order", group=_GROUP, title="Cohorts", run=_cohorts),
    Study(name="contacts-order", group=_GROUP, title="Contacts", run=_contacts),
    Study(name="kinetic-order", group=_GROUP, title="Kinetic equation of ageing thresholds", run=_kinetic),
)
