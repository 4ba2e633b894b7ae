"""Response of contacts to a step of the velocity: a small step from their linear
response, a finite step by cohorts.
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

# for a step that is fitted: errs by .1 % of its range, laws by several
ROUGH = MasterEquation(rtol=1e-3)
_FINEST = 2e-3  # step of the wave numbers, at least: a grid of ten thousand
_CLOSEST = 3e-4  # and of those that follow a delay: a grid of a hundred thousand
# of the response, by a spline of fourth order before it knows a middle: an error of
# 1e-4 with it
_MISSED = 1.6e-3


def small_step(
    interface: Interface,
    velocity: float,
    slip: Array,
    *,
    stiffness: float = math.inf,
    coarse: float = 1.0,
) -> Array:
    """Force over ``ln`` of the ratio after a small step of the velocity of a load
    point: ``kappa`` behind a spring.

    The inverse transform of ``kappa(q)/q^2``: the sine transform of ``Im kappa/y^2``,
    its factor linear between frequencies. It is per contact, in ``f_s``, over the
    displacement `slip` of the load point, above 0, in ``x_s``. The spring has a
    `stiffness` per contact; a rigid slider an infinite one. A grid of frequencies that
    is not `coarse` gives an error of 1e-4.
    """
    instance("small_step: interface", interface, Interface, "an Interface")
    v = number("small_step: velocity", velocity, above=0, hint="in x_s per time")
    x = np.atleast_1d(numbers("small_step: slip", slip, above=0))[:, None]
    y, kappa = _answer(hashable(interface), v, coarse)
    factor = (kappa / (1.0 + kappa / stiffness)).imag / y
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
    """Wave numbers that follow every turn of the response, and ``kappa`` there."""
    response = respond(interface)
    thresholds = interface.threshold_distribution
    mean = thresholds.moment(1)
    # Contacts that are nearly alike break together, life after life: a resonance of
    # this width, from its first on.
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
    # its table has no more
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

    # At first as far apart as no resonance is passed over, and a fourth of its period;
    # halved where a spline misses.
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
    """Force over the displacement of the load point after a step of its velocity, from
    steady sliding.

    The result of `velocity_step` as two arrays: displacement of the load point from the
    step on, in ``x_s``, and force per contact, in ``f_s``, minus that before the step.
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
    """Stiffness of the contacts that are attached in steady sliding, per contact: what
    a sudden step finds.

    Contacts live alike with a delay and without one, so the force that they carry falls
    with the fraction attached.
    """
    if velocity * interface.delay.moment(1) == 0:
        return 1.0
    bare = replace(interface, sliding_force=0.0)
    return kinetic_friction(bare, velocity) / kinetic_friction(
        replace(bare, delay=Delay(0.0)), velocity
    )
