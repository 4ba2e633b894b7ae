"""Response of contacts to a step of the velocity: to a small step by their linear
response, to a finite step by cohorts.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy import special

from stickslip.arrays import Array, ComplexArray
from stickslip.errors import InputError, instance, number, numbers
from stickslip.model import Delay, Interface, Langevin, MasterEquation
from stickslip.model.records import hashable
from stickslip.simulation.steps_and_holds import velocity_step
from stickslip.sliding import kinetic_friction, respond
from stickslip.sliding.response import splined

# for fits of a step: its error is .1 % of the range, that of the laws several per cent
ROUGH = MasterEquation(rtol=1e-3)
_FINEST = 2e-3  # smallest step of the wave numbers: a grid of ten thousand
_CLOSEST = 3e-4  # smallest step with a delay: a grid of a hundred thousand
# Change of the response at a new middle point up to which a cubic spline is not
# refined: with that point, its error, of fourth order, is 1e-4.
_MISSED = 1.6e-3


def small_step(
    interface: Interface,
    velocity: float,
    slip: Array,
    *,
    stiffness: float = math.inf,
    coarse: float = 1.0,
) -> Array:
    """Return the force after a small step of the velocity of the load point, over
    ``ln`` of the velocity ratio, from the dynamic stiffness ``kappa`` of the contacts.

    It is the inverse transform of ``kappa(q)/q^2``, computed as the sine transform of
    ``Im kappa/y^2``, with ``Im kappa/y`` linear between the grid points. The force is
    per contact, in ``f_s``, at displacements `slip` of the load point, above 0, in
    ``x_s``. The spring has a `stiffness` per contact, infinite for a rigid drive. With
    `coarse` 1 the error is 1e-4; larger values make the grid coarser.
    """
    instance("small_step: interface", interface, Interface, "an Interface")
    v = number("small_step: velocity", velocity, above=0, hint="in x_s per time")
    x = np.ravel(numbers("small_step: slip", slip, above=0))[:, None]
    spring = number("small_step: stiffness", stiffness, above=0, infinite=True)
    step = number("small_step: coarse", coarse, above=0)
    y, kappa = _answer(hashable(interface), v, step)
    factor = (kappa / (1.0 + kappa / spring)).imag / y
    # Below the first frequency the factor is dF/dln v.
    y = np.append(0.0, y)
    factor = np.append(factor[0], factor)
    inner = special.sici(y * x)[0]
    steep = np.diff(factor) / np.diff(y)
    level = factor[:-1] - steep * y[:-1]
    found = (
        np.diff(inner, axis=1) @ level - (np.diff(np.cos(y * x), axis=1) / x) @ steep
    )
    return 2.0 / math.pi * found


@lru_cache(maxsize=16)
def _answer(
    interface: Interface, velocity: float, coarse: float
) -> tuple[Array, ComplexArray]:
    """Return wave numbers that resolve the response, and ``kappa`` at these."""
    response = respond(interface)
    thresholds = interface.threshold_distribution
    mean = thresholds.moment(1)
    # Contacts with nearly equal thresholds break together again and again: their first
    # resonance has the width `sharp`.
    away = velocity * interface.delay.longest / mean
    cv = thresholds.standard_deviation() / mean
    sharp = 2.0 * (math.pi * cv) ** 2 / (1.0 + away) ** 3
    fine = coarse * min(0.1 / max(1.0, away), max(sharp / 4.0, _FINEST))
    if fine < _CLOSEST:
        raise InputError(
            f"velocity = {velocity:.4g}: contacts stay detached over {away:.3g} times "
            "the distance to a break, too far for the response to a step; give a lower "
            "velocity or a shorter delay"
        )
    few = math.ceil(60 / coarse)
    many = math.ceil(250 / coarse)
    # the table of `Langevin` ends here
    top = 1e3 if isinstance(interface.ageing, Langevin) else 1e5
    y = np.concatenate(
        [
            np.geomspace(1e-3, 1.0, few),
            np.arange(1.0, 30.0, fine)[1:],
            np.geomspace(30.0, top, many),
        ]
    )
    u = np.log1p(y)

    def factor_at(places: Array) -> ComplexArray:
        wave = np.expm1(places)
        return (response.stiffness(velocity, 1j * wave / mean * velocity) / wave)[
            None, :
        ]

    # The first grid resolves every resonance, with at least four points per period; it
    # is refined where a spline misses.
    apart = max(int(min(2.0 * sharp, 1.6 / max(1.0, away)) / fine), 1)
    return y / mean, splined(factor_at, u, apart, _MISSED)(u)[0] * y


def finite_step(
    interface: Interface,
    before: float,
    after: float,
    slip: float,
    *,
    stiffness: float = math.inf,
    method: MasterEquation = MasterEquation(),
) -> tuple[Array, Array]:
    """Return the force over the displacement of the load point after a step of its
    velocity, from steady sliding.

    The two arrays are the displacement of the load point since the step, in ``x_s``,
    and the force per contact, in ``f_s``, minus that before the step, from
    `velocity_step`.
    """
    instance("finite_step: interface", interface, Interface, "an Interface")
    run = velocity_step(
        interface,
        before=before,
        after=after,
        distance=slip,
        stiffness=stiffness,
        method=method,
    )
    since = run["time"].values
    force = run["friction_force"].values[since >= 0.0]
    return after * since[since >= 0.0], force - force[0]


def contact_stiffness(interface: Interface, velocity: float) -> float:
    """Return the stiffness of the contacts attached in steady sliding, per contact,
    which resists a sudden step.

    It is the fraction attached, computed as the ratio of the forces with the delay and
    without, as attached contacts carry the same force in both.
    """
    if velocity * interface.delay.moment(1) == 0:
        return 1.0
    bare = replace(interface, sliding_force=0.0)
    return kinetic_friction(bare, velocity) / kinetic_friction(
        replace(bare, delay=Delay(0.0)), velocity
    )
