"""Solver against solver: contacts, cohorts, the renewal convolution, and linear theory,
where all must agree.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import xarray as xr

from stickslip import (
    Contacts,
    Delay,
    FromSliding,
    Gaussian,
    Interface,
    Langevin,
    MasterEquation,
    Output,
    RandomDelay,
    constant,
    growth_rate,
    kinetic_friction,
    ramp,
    regime,
    rigid_slide,
    simulate,
)
from stickslip.model import Rig
from stickslip.paper import Claim, Measured
from stickslip.paper.cases import FIG4, FIG7, FIG8, PERIOD, V1, V1_FREQUENCY
from stickslip.paper.figure import at_most, near
from stickslip.stability import critical
from stickslip.theory import driving_force
from verification import phase_diagram
from verification.study import Study, finding, held_friction

_NARROW = Interface(
    thresholds=Gaussian(mean=1.0, std=0.1), initial=Gaussian(mean=0.0, std=0.05)
)


def _rigid() -> tuple[Claim, ...]:
    delays = (
        Delay(0.0),
        Delay(0.3),
        RandomDelay(mean=0.2, std=0.12, negative="redraw"),
    )
    N = 10_000
    seeds = 8
    distance = 4.0
    velocity = 0.7
    between = []
    scaled = []
    for delay in delays:
        interface = replace(_NARROW, delay=delay)
        cohorts = rigid_slide(
            interface, distance, velocity=velocity, method=MasterEquation(rtol=1e-6)
        )
        X = cohorts["displacement"].to_numpy()
        renewal = rigid_slide(interface, distance, velocity=velocity)
        exact = np.interp(X, renewal["displacement"], renewal["friction_force"])
        between.append(
            at_most(
                f"cohorts less renewal, {delay}",
                float(np.abs(cohorts["friction_force"] - exact).max()),
                1e-4,
                "f_s",
            )
        )
        runs = [
            rigid_slide(
                interface, distance, velocity=velocity, method=Contacts(N, seed=s)
            )["friction_force"]
            for s in range(seeds)
        ]
        rms = math.sqrt(N * np.mean([(run.to_numpy() - exact) ** 2 for run in runs]))
        # A contact's force lies between 0 and about 1.3: its standard deviation is at
        # most half of that.
        scaled.append(
            at_most(
                f"rms of contacts about it times sqrt(N), {delay}", rms, 0.65, "f_s"
            )
        )
    return (
        finding(
            "Rigid motion: cohorts and renewal convolution solve the same Eqs. (1)-(4)",
            *between,
            evidence=f"{distance:g} x_s at velocity {velocity:g}, an rtol of 1e-6",
        ),
        finding(
            (
                "Rigid motion: contacts scatter about the master equation by the "
                "standard "
                "deviation of a contact's force"
            ),
            *scaled,
            evidence=f"{seeds} runs of {N:,} contacts for each delay",
        ),
    )


def _cycle(run: xr.Dataset) -> tuple[float, float, float]:
    late = run.sel(time=slice(60.0, None))
    seen = regime(late)
    force = late["spring_force"]
    return float(force.max() - force.min()), seen.period, float(late["velocity"].max())


def _stick_slip() -> tuple[Claim, ...]:
    interface = replace(FIG4.interface, delay=Delay(0.2))
    slider = replace(FIG4.slider, stiffness=2.0)
    drive = constant(1.0, 100.0)
    output = Output(interval=0.002)
    cohorts = simulate(
        Rig(interface, slider, drive), method=MasterEquation(rtol=1e-6), output=output
    )
    contacts = simulate(
        Rig(interface, slider, drive), method=Contacts(200_000, seed=5), output=output
    )
    oscillation, period, fastest = _cycle(cohorts)
    oscillation_n, period_n, fastest_n = _cycle(contacts)
    return (
        finding(
            "Fig. 4c: the cycle of 200,000 contacts is that of the master equation",
            near(
                "peak-to-peak force, contacts over cohorts",
                oscillation_n / oscillation,
                1.0,
                0.02,
            ),
            near("period, contacts over cohorts", period_n / period, 1.0, 0.005),
            near(
                "largest velocity, contacts over cohorts",
                fastest_n / fastest,
                1.0,
                0.03,
            ),
            near("peak-to-peak force of the cohorts", oscillation, 0.77, 0.02, "f_s"),
            near("period of the cohorts", period, PERIOD, 0.010, "time"),
            evidence="K 2, tau .2, eta 200, v 1; the last 40 of 100 time units",
        ),
    )


def _energy() -> tuple[Claim, ...]:
    interface = replace(FIG4.interface, delay=Delay(0.1))
    drives = {
        "constant": constant(1.0, 20.0),
        "up and down": ramp(0.1, 3.0, 10.0).then(ramp(3.0, 0.1, 10.0)),
        "there and back": constant(1.0, 5.0)
        .then(constant(-1.0, 10.0))
        .then(constant(1.0, 5.0)),
    }
    imbalances = []
    counts = []
    for name, drive in drives.items():
        run = simulate(
            Rig(interface, FIG4.slider, drive), method=Contacts(10_000, seed=3)
        )
        stored = run["kinetic_energy"] + run["spring_energy"] + run["contact_energy"]
        lost = run["damped_energy"] + run["broken_energy"]
        imbalance = float(np.abs(run["work"] - (stored - stored[0]) - lost).max())
        imbalances.append(
            at_most(
                f"imbalance of energy over the work done, {name}",
                imbalance / float(run["work"].max()),
                1e-9,
            )
        )
        held = run["attached"].to_numpy() * 10_000
        counts.append(
            at_most(
                f"attached contacts are whole, {name}",
                float(np.abs(held - held.round()).max()),
                1e-6,
            )
        )
    return (
        finding(
            "The contacts engine balances energy to rounding",
            *imbalances,
            *counts,
            evidence="10,000 contacts, three drives",
        ),
    )


def _linear() -> tuple[Claim, ...]:
    """Check that a small perturbation of the cohorts grows, or decays, at the rate of
    linear theory.
    """
    slider = FIG7.slider
    interface = replace(FIG7.interface, delay=Delay(0.1))
    v1 = critical(
        Rig(interface, slider, constant(1.0)), "velocity", between=(1.0, 1.9)
    )[0]
    rates = []
    turns = []
    speeds = (1.2, 1.3, 1.5, 1.6)
    for velocity in speeds:
        drive = constant(velocity, 24.0)
        run = simulate(
            Rig(interface, slider, drive),
            method=MasterEquation(rtol=1e-8),
            start=FromSliding(perturbation=1e-3),
            output=Output(interval=0.004),
        )
        rate, turn = _fitted_mode(
            run["time"].to_numpy(),
            run["spring_force"].to_numpy() - driving_force(interface, slider, velocity),
        )
        mode = growth_rate(Rig(interface, slider, constant(velocity)))
        rates.append(
            near(
                f"growth rate at v = {velocity:g}, less theory",
                rate - mode.real,
                0.0,
                2e-3,
                "1/time",
            )
        )
        turns.append(
            near(
                f"frequency at v = {velocity:g}, less theory",
                turn - abs(mode.imag),
                0.0,
                5e-3,
                "1/time",
            )
        )
    return (
        finding(
            (
                "Small perturbations of smooth sliding grow or decay at the rate of "
                "linear "
                "theory"
            ),
            near("v1 of Fig. 7a", v1.value, V1, 1e-6, "x_s/time"),
            near("its frequency", v1.frequency, V1_FREQUENCY, 1e-6, "1/time"),
            *rates,
            *turns,
            evidence=(
                "rtol 1e-8, velocity perturbed by a thousandth; the slowest mode "
                "fitted after t = 8"
            ),
        ),
    )


def _fitted_mode(t: np.ndarray, force: np.ndarray) -> tuple[float, float]:
    """Return the rate and the frequency of one oscillating mode, by least squares on
    the rest of the transient.
    """
    from scipy.optimize import least_squares

    late = t > 8.0
    t, force = t[late] - 8.0, force[late] - force[late].mean()
    force = force / np.abs(force).max()
    power = np.abs(np.fft.rfft(force * np.hanning(t.size), 16 * t.size))
    turn = 2 * math.pi * np.fft.rfftfreq(16 * t.size, t[1] - t[0])[power.argmax()]

    def rest(p: np.ndarray) -> np.ndarray:
        oscillation = np.exp(p[0] * t)[:, None] * np.column_stack(
            [np.cos(p[1] * t), np.sin(p[1] * t)]
        )
        basis = np.column_stack([oscillation, np.ones_like(t)])
        return np.asarray(basis @ np.linalg.lstsq(basis, force, rcond=None)[0] - force)

    found = least_squares(rest, [0.0, turn], x_scale=[0.1, 0.1])
    return float(found.x[0]), float(found.x[1])


def _ageing() -> tuple[Claim, ...]:
    settled = {0.1: 0.4677, 0.5: 0.3756, 1.0: 0.1243}
    measured: list[Measured] = []
    contacts: list[Measured] = []
    kinetic: list[Measured] = []
    rates = (1.0, 1.5)
    for rate in rates:
        for u, exact in settled.items():
            interface = replace(FIG8.interface, ageing=Langevin(rate=rate))
            velocity = u * rate**2
            steady = float(kinetic_friction(interface, velocity))
            name = f"F at u = {u:g}, beta = {rate:g}"
            measured.append(
                near(f"{name}, kinetic equation", steady, exact, 3e-3 * exact, "f_s")
            )
            output = Output(interval=0.02 / velocity)
            for found, method, within in (
                (contacts, Contacts(20_000, seed=7), 1e-2),
                (kinetic, MasterEquation(), 3e-3),
            ):
                force = held_friction(
                    interface, velocity, method, distance=12.0, after=4.0, output=output
                )
                found.append(
                    near(
                        f"{name}, {type(method).__name__}",
                        force,
                        exact,
                        within * exact,
                        "f_s",
                    )
                )
    return (
        finding(
            (
                "Ageing thresholds: the steady friction of the kinetic equation "
                "depends on "
                "u = v/beta^2 alone"
            ),
            *measured,
            evidence="stationary kinetic equation",
        ),
        finding(
            (
                "Ageing thresholds: contacts, and the kinetic equation in time, slide "
                "with "
                "that friction"
            ),
            *contacts,
            *kinetic,
            evidence="held to the drive by a stiff spring, 8 x_s, 20,000 contacts",
        ),
    )


_GROUP = "Solver against solver"
STUDIES = (
    Study(name="rigid", group=_GROUP, title="Rigid motion", run=_rigid),
    Study(name="cycle", group=_GROUP, title="Stick-slip cycle", run=_stick_slip),
    Study(name="energy", group=_GROUP, title="Balance of energy", run=_energy),
    Study(
        name="linear",
        group=_GROUP,
        title="Linear stability against small perturbations",
        run=_linear,
    ),
    Study(
        name="phase-diagram",
        group=_GROUP,
        title="Regimes simulated and computed",
        run=phase_diagram.regimes,
    ),
    Study(
        name="ageing",
        group=_GROUP,
        title="Ageing thresholds in steady sliding",
        run=_ageing,
    ),
)
