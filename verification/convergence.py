"""Orders of convergence: errors are compared at halved steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from stickslip import (
    Contacts,
    Delay,
    Gaussian,
    Interface,
    Langevin,
    MasterEquation,
    Output,
    constant,
    kinetic_friction,
    rigid_slide,
    simulate,
)
from stickslip.kernels.drive import Quadratic, Stop
from stickslip.model import Renewal, Rig
from stickslip.paper import Claim
from stickslip.paper.cases import FIG4, FIG8
from stickslip.paper.figure import at_least, at_most, between, near
from stickslip.simulation import Beginning, Leg, Panels
from verification.study import Study, finding, held_friction

_SMOOTH = Interface(
    thresholds=Gaussian(mean=1.0, std=0.1), initial=Gaussian(mean=0.0, std=0.1)
)


def _slope(steps: list[int], errors: list[float]) -> float:
    """Return the power of the step with which the error falls."""
    return -float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def _renewal() -> tuple[Claim, ...]:
    distance = 4.0
    points = [128, 256, 512]
    exact = rigid_slide(_SMOOTH, distance, method=Renewal(8192))[
        "friction_force"
    ].to_numpy()
    errors = []
    for n in points:
        errors.append(
            float(
                np.abs(
                    rigid_slide(_SMOOTH, distance, method=Renewal(n))["friction_force"]
                    - exact[:: 8192 // n]
                ).max()
            )
        )
    return (
        finding(
            "The renewal convolution is of sixth order for a smooth distribution",
            between("order", _slope(points, errors), 5.0, 9.0),
            at_most("error with 512 intervals", errors[-1], 1e-7, "f_s"),
            evidence=(
                "Gaussian thresholds and start of standard deviation .1 over 4 "
                "x_s, against 8,192 intervals"
            ),
        ),
    )


def _panels() -> tuple[Claim, ...]:
    interface = replace(FIG4.interface, delay=Delay(0.2))
    tolerances = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7]
    steps = []
    errors = []
    rigid = []
    output = Output(interval=0.01)

    def force(rtol: float) -> tuple[np.ndarray, int]:
        rig = Rig(interface, FIG4.slider, constant(1.0, 3.0))
        engine = Panels(
            Beginning(interface, FIG4.slider, 1.0), MasterEquation(rtol=rtol)
        )
        while not engine.advance(
            Leg(Quadratic(0.0, 0.0, 1.0, 0.0), 3.0, np.empty(0), Stop())
        ).over:
            pass
        run = simulate(rig, method=MasterEquation(rtol=rtol), output=output)
        return run["spring_force"].to_numpy(), int(
            engine.state.used.steps - engine.state.used.rejected
        )

    exact = force(1e-9)[0]
    renewal = rigid_slide(_SMOOTH, 4.0, method=Renewal(8192))
    for rtol in tolerances:
        found, count = force(rtol)
        steps.append(count)
        errors.append(float(np.sqrt(np.mean((found - exact) ** 2))))
        run = rigid_slide(_SMOOTH, 4.0, method=MasterEquation(rtol=rtol))
        there = np.interp(
            run["displacement"], renewal["displacement"], renewal["friction_force"]
        )
        rigid.append(float(np.abs(run["friction_force"] - there).max()))
    return (
        finding(
            (
                "The master equation is of order four at least, and its error follows "
                "its "
                "tolerance"
            ),
            at_least(
                "order in the number of steps, through slips, K 2, tau .2",
                _slope(steps, errors),
                4.0,
            ),
            at_most(
                "largest error in tolerances, spring force",
                float(np.max(np.divide(errors, tolerances))),
                10.0,
            ),
            at_most(
                "largest error in tolerances, rigid",
                float(np.max(np.divide(rigid[:4], tolerances[:4]))),
                10.0,
            ),
            evidence=(
                "tolerances from 1e-3 to 1e-7 against 1e-9, and against the "
                "renewal convolution"
            ),
        ),
    )


def _contacts() -> tuple[Claim, ...]:
    counts = [400, 1_600, 6_400, 25_600]
    seeds = 24
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
                        - np.interp(
                            run["displacement"],
                            reference["displacement"],
                            reference["friction_force"],
                        )
                    )
                    ** 2
                ).mean()
            )
        scatter.append(math.sqrt(square / seeds))
    return (
        finding(
            "Contacts scatter about the master equation as N^(-1/2)",
            # Each rms of 24 runs, which have a few independent parts each, is known to
            # some 10 %: .04 in the slope.
            near("power of N", -_slope(counts, scatter), -0.5, 0.12),
            evidence=(
                f"{seeds} runs each of {', '.join(f'{N:,}' for N in counts)} "
                "contacts over 4 x_s"
            ),
        ),
    )


def _kinetic() -> tuple[Claim, ...]:
    interface = replace(FIG8.interface, ageing=Langevin(rate=1.0))
    velocity = 0.5
    exact = float(kinetic_friction(interface, velocity))
    cells = [100, 200, 400]
    errors = []
    for count in cells:
        method = MasterEquation(rtol=1e-4 * (400 / count) ** 2)
        force = held_friction(interface, velocity, method, distance=8.0, after=6.0)
        errors.append(abs(force - exact))
    return (
        finding(
            (
                "The kinetic equation of ageing thresholds in time is of second order, "
                "but "
                "for the layer at the boundary"
            ),
            between("order", _slope(cells, errors), 1.5, 2.5),
            at_most(
                "relative error with the usual tolerance", errors[-1] / exact, 1e-3
            ),
            evidence="steady force at u = .5 against the stationary kinetic equation",
        ),
    )


_GROUP = "Orders of convergence"
STUDIES = (
    Study(
        name="renewal-order", group=_GROUP, title="Renewal convolution", run=_renewal
    ),
    Study(name="cohorts-order", group=_GROUP, title="Cohorts", run=_panels),
    Study(name="contacts-order", group=_GROUP, title="Contacts", run=_contacts),
    Study(
        name="kinetic-order",
        group=_GROUP,
        title="Kinetic equation of ageing thresholds",
        run=_kinetic,
    ),
)
