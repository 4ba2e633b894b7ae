"""The paper's approximate formulas for an interface, each with its range of validity.

Natural units per contact (``k = f_s = x_s = 1``), time in the user's unit; lengths in
``x_s``.
"""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import solve_banded
from scipy.optimize import brentq
from scipy.special import exprel

from stickslip.arrays import Array
from stickslip.errors import InputError, instance, number, numbers
from stickslip.kernels.langevin import Langevin
from stickslip.kernels.langevin_steady import pull_newborns
from stickslip.model import Interface, Slider
from stickslip.model.newborn import mean_life
from stickslip.sliding import kinetic_friction
from stickslip.sliding.langevin import ageing_constants
from stickslip.sliding.law import at_each

# cells per standard deviation of the thresholds, which give forces to 1e-3 even where
# most thresholds are next to 0
_CELLS = 160


def closure_friction(interface: Interface, velocity: ArrayLike) -> float | Array:
    """Return the force in smooth sliding by the paper's closure, Eqs. (1)-(3) with
    (18), which is an approximation.

    It assumes one distribution of thresholds for all contacts, whatever their
    stretching, `Langevin` ageing, and no delay. Compared with `kinetic_friction`, at a
    standard deviation of .1, it is 23 % too large at ``v = .01 rate**2``, 9 % too small
    at .5 and 28 % too small at 1, where most thresholds are next to 0. There, noise
    would carry thresholds below 0, but here they stay above; if such contacts counted
    as broken at once, the force would be 67 % too small.
    """
    constants = ageing_constants(interface)
    if interface.delay.moment(1) > 0:
        raise InputError(
            f"Interface.delay = {interface.delay}: the paper's closure has no delay; "
            "use Delay(0)"
        )
    speed = numbers("velocity", velocity, above=0, hint="in x_s per time")
    return at_each(np.vectorize(lambda v: _closure_force(v, constants)), speed)


def _closure_force(velocity: float, ageing: Langevin) -> float:
    """Return the force per contact by Eq. (18): in the steady state ``Q = Gamma J_c``,
    with ``Gamma <x_s> = 1``.

    P_c is the distribution of a threshold that has aged for an exponentially
    distributed time of rate ``Gamma v``.
    """
    end = max(ageing.mean, ageing.newborn) + 8.0 * ageing.std
    diffusion = (ageing.rate * ageing.std) ** 2
    edges = np.linspace(0.0, end, math.ceil(end / ageing.std * _CELLS) + 1)
    width = edges[1]
    middle = 0.5 * (edges[1:] + edges[:-1])
    square = np.diff(edges**3) / (3.0 * edges[1])
    drift = ageing.rate**2 * (ageing.mean - edges[1:-1])
    # exponentially fitted differences, whose stationary state is that of Eq. (17)
    back = diffusion / (width * exprel(drift * width / diffusion))
    newborn = (
        np.searchsorted(edges, ageing.newborn, side="right") - 1
        == np.arange(middle.size)
    ).astype(float)

    def thresholds(gamma: float) -> Array:
        up, down = (flow / (width * gamma * velocity) for flow in (back + drift, back))
        stay = 1.0 + np.append(up, 0.0) + np.append(0.0, down)
        return np.asarray(
            solve_banded(
                (1, 1),
                [np.append(0.0, -down), stay, np.append(-up, 0.0)],
                newborn,
            )
        )

    gamma = brentq(
        lambda gamma: gamma * thresholds(gamma) @ middle - 1.0,
        0.1 / end,
        20.0 / width,
    )
    return float(0.5 * gamma * thresholds(gamma) @ square)


def attached_fraction(interface: Interface, velocity: ArrayLike) -> float | Array:
    """Return the mean fraction of attached contacts in smooth sliding,
    ``N_c/N = 1/(1 + v <tau>/<x_s>)``, Eq. (10).

    If newborn contacts are stretched by ``x_0``, ``<x_s - x_0>`` takes the place of
    ``<x_s>``; ageing is refused. The result is exact in steady sliding, where the
    paper's ``xbar = 1/Gamma`` is the mean threshold, and also for a random delay, with
    its mean. Within the dynamics, where the paper uses it, it has no memory and is an
    approximation.
    """
    instance("attached_fraction: interface", interface, Interface, "an Interface")
    interface.allow(("sliding_force", "newborn"), "attached_fraction")
    slowest = "at_least" if math.isfinite(interface.delay.moment(1)) else "above"
    speed = numbers("velocity", velocity, hint="in x_s per time", **{slowest: 0.0})
    path, _ = mean_life(interface)
    delay = interface.delay.moment(1)
    return at_each(lambda speeds: 1.0 / (1.0 + speeds * delay / path), speed)


def driving_force(interface: Interface, slider: Slider, velocity: float) -> float:
    """Return the mean force in the driving spring in smooth sliding,
    ``M eta v + F_k(v)``: the mean of Eq. (11).
    """
    instance("driving_force: slider", slider, Slider, "a Slider")
    speed = number("velocity", velocity, at_least=0, hint="in x_s per time")
    return slider.mass * slider.damping * speed + kinetic_friction(interface, speed)


def critical_stiffness_estimate(interface: Interface) -> float:
    """Return the paper's rough ``K* ~ N k f_s/(Delta f_s + Delta f_0)``, Eq. (9), in
    ``k``, which shows how ``K*`` scales.

    It uses the standard deviations of thresholds and of initial stretchings, assumed
    small, and is infinite if both are 0. For the paper's own parameters it gives 9.1,
    while Eqs. (1)-(4) and (8) give 2.99.
    """
    name = "critical_stiffness_estimate: interface"
    instance(name, interface, Interface, "an Interface")
    distribution = interface.threshold_distribution
    width = distribution.standard_deviation() + interface.initial.standard_deviation()
    return distribution.moment(1) / width if width > 0 else math.inf


def slip_displacement(slider: Slider, velocity: float, elapsed: ArrayLike) -> Array:
    """Return the displacement of the slider in a time after the elastic instability,
    ``v dt [1 + (Omega dt)^2/6]``, Eq. (12).

    Here ``Omega = sqrt(K/M)``. As `velocity` the paper prints that of the drive,
    ``v_d``; but by then the slider is faster than the drive, and the result is too
    small by up to a factor 3.5. With the slider's actual velocity at the instability it
    holds to 10 % for ``Omega dt <= 1``.
    """
    instance("slip_displacement: slider", slider, Slider, "a Slider")
    number("velocity", velocity, at_least=0, hint="in x_s per time")
    number(
        "Slider.mass",
        slider.mass,
        above=0,
        hint="M/N; a slip without mass takes no time",
    )
    t = numbers("elapsed", elapsed, at_least=0, hint="time since the instability")
    return np.asarray(velocity * t * (1.0 + (slider.frequency * t) ** 2 / 6.0))


def effective_potential(
    slider: Slider, position: ArrayLike, contact_force: ArrayLike, drive: float
) -> Array:
    """Return ``V_eff(X) = K (v_d t - X)^2/2 + Int_0^X F_c``, Eq. (5), on a grid of
    positions ``X``, from 0 on.

    `contact_force` is the force in rigid motion at each position, `drive` the position
    ``v_d t`` of the driven end of the spring; the integral uses the trapezoidal rule,
    of second order in the spacing. The force on the slider is minus the slope of the
    potential; the slider is stable where that is convex, Eq. (6).
    """
    instance("effective_potential: slider", slider, Slider, "a Slider")
    x = numbers("position", position)
    force = numbers("contact_force", contact_force)
    drive = number("drive", drive, hint="in x_s")
    if x.ndim != 1 or x.shape != force.shape or x[0] != 0 or np.any(np.diff(x) <= 0):
        raise InputError(
            "position, contact_force: must be of one shape, (n,), and positions must "
            "rise from 0 on"
        )
    work = cumulative_trapezoid(force, x, initial=0)
    return np.asarray(0.5 * slider.stiffness * (drive - x) ** 2 + work)


def newborn_pull(
    interface: Interface, velocity: float, distance: float, points: int
) -> tuple[Array, Array]:
    """Return the force on a slider of constant velocity whose contacts are all newborn
    at its start, as in Fig. 11, from a renewal equation.

    Contacts have `Langevin` ageing, no delay, and no strength at birth. The result is
    positions, in equal steps of the distance, in ``x_s``, and the forces there, per
    contact in ``f_s``.
    """
    speed = number("velocity", velocity, above=0)
    distance = number("distance", distance, above=0)
    return pull_newborns(speed, ageing_constants(interface), distance, points)
