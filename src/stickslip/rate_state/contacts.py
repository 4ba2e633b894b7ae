"""What contacts do after a step of the velocity: a small one from their linear response, a finite one by cohorts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, special

from stickslip.errors import UndecidedError, instance
from stickslip.model import Barrier, Bell, Delay, Interface, Langevin, LogarithmicGrowth, Parabolic
from stickslip.simulation.steps_and_holds import velocity_step
from stickslip.sliding import kinetic_friction, respond
from stickslip.sliding.lives import blurred_survival, growth_of, hazard_of, lives_of, reached_on

Array = NDArray[np.float64]

_FINEST = 2e-3
"""Step of the wave numbers, at least: a grid of ten thousand."""


def small_step(
    interface: Interface, velocity: float, slip: Array, *, stiffness: float = math.inf, coarse: float = 1.0
) -> Array:
    """Force over ``ln`` of the ratio after a small step of the velocity of a load point: ``kappa`` behind a spring.

    The inverse transform of ``kappa(q)/q^2``: the sine transform of ``Im kappa/y^2``, its factor linear between
    frequencies.

    Parameters
    ----------
    interface : Interface
    velocity : float
    slip : ndarray, shape (n,)
        Displacement of the load point, above 0, in ``x_s``.
    stiffness : float
        Of a spring between load point and slider, per contact; infinite for a rigid slider.
    coarse : float
        Coarsening of the frequency grid; 1 gives an error of 1e-4.

    Returns
    -------
    ndarray, shape (n,)
        Per contact, in ``f_s``.
    """
    response, thresholds = respond(interface), interface.threshold_distribution
    mean = thresholds.moment(1)

    def stiffness_at(wave: Array) -> Array:
        """By wave number, in units of one over the mean threshold."""
        return np.asarray(response.stiffness(velocity, 1j * wave / mean * velocity))

    if isinstance(interface.ageing, Langevin):  # its table has no more than this
        y = np.concatenate([np.geomspace(1e-3, 1.0, 60), np.geomspace(1.0, 1e3, 300)[1:]])
        kappa = stiffness_at(y)
    else:
        # Contacts that are nearly alike break together, life after life: a resonance of this width, from its first on.
        away, cv = velocity * interface.delay.longest / mean, thresholds.standard_deviation() / mean
        sharp = 2.0 * (math.pi * cv) ** 2 / (1.0 + away) ** 3
        fine = min(0.1 / max(1.0, away), max(sharp / 4.0, _FINEST))
        few, many = math.ceil(60 / coarse), math.ceil(250 / coarse)
        y = np.concatenate(
            [np.geomspace(1e-3, 1.0, few), np.arange(1.0, 30.0, coarse * fine)[1:], np.geomspace(30.0, 1e5, many)]
        )
        if isinstance(interface.temperature, Parabolic | Barrier):
            # Milliseconds each: as few as follow its turns, the memory of contacts turning by .5 rad between two.
            middle, far = y[(y >= 30.0) & (y < 100.0)], y[y >= 100.0]
            known = np.unique(np.concatenate([y[:few:3], y[few:-many:2], middle, far[::3], y[-1:]]))
            exact = stiffness_at(known)
            kappa = interpolate.CubicSpline(np.log1p(known), exact)(np.log1p(y))
        else:
            kappa = stiffness_at(y)
    y = y / mean
    if math.isfinite(stiffness):
        kappa = kappa * stiffness / (kappa + stiffness)
    factor = np.asarray(kappa).imag / y
    # Below the first frequency the factor is dF/dln v.
    y, factor = np.append(0.0, y), np.append(factor[0], factor)
    x = slip[:, None]
    inner = special.sici(y * x)[0]
    steep = np.diff(factor) / np.diff(y)
    level = factor[:-1] - steep * y[:-1]
    found = np.diff(inner, axis=1) @ level - (np.diff(np.cos(y * x), axis=1) / x) @ steep
    return np.asarray(2.0 / math.pi * found)


def finite_step(
    interface: Interface,
    before: float,
    after: float,
    slip: float,
    *,
    stiffness: float = math.inf,
    fineness: float = 0.5,
) -> tuple[Array, Array]:
    """Force over the displacement of the load point after a step of its velocity, from steady sliding.

    By cohorts, each with one number, where that is enough: `Bell` activation without delay, of thresholds that do not
    grow or do so with the logarithm of age. Else as `velocity_step` by the master equation: other barriers, delays,
    and thresholds that grow otherwise, which take seconds.

    Parameters
    ----------
    interface : Interface
    before, after : float
        Velocities, in ``x_s`` per time.
    slip : float
        How far the load point goes after the step.
    stiffness : float
        Of a spring between load point and slider, per contact; infinite for a rigid slider.
    fineness : float
        Step of the slider in activation widths, of cohorts with one number.

    Returns
    -------
    (ndarray, ndarray)
        Displacement of the load point from the step on, and force per contact minus that before the step.

    Raises
    ------
    InputError
        If the master equation cannot take the interface.
    """
    instance("finite_step: interface", interface, Interface, "an Interface")
    temperature, ageing = interface.temperature, interface.ageing
    if (
        not isinstance(temperature, Bell)
        or not isinstance(ageing, LogarithmicGrowth | None)
        or interface.delay.moment(1) > 0
        or max(before, after) > 0.05 * temperature.attempts * temperature.width  # else some reach their thresholds
    ):
        run = velocity_step(interface, before=before, after=after, distance=slip, stiffness=stiffness)
        since = run["time"].to_numpy()
        force = run["friction_force"].to_numpy()[since >= 0.0]
        return after * since[since >= 0.0], force - force[0]
    from stickslip.kernels import velocity_step as kernel

    distribution, A = interface.threshold_distribution, temperature.width
    low, high = distribution.support
    first, spacing = min(low, 0.0) - 40.0 * A, min(0.5 * A, 0.02 * distribution.standard_deviation())
    count = math.ceil((high + 4.5 * A - first) / spacing)
    table = blurred_survival(distribution, A, np.asarray(first + spacing * np.arange(count), dtype=float))
    lives = lives_of(interface, before)
    mean = distribution.moment(1)
    dX = min(max(fineness * A, 0.004 * mean), 0.04 * fineness * mean)
    place = np.arange(0.5 * dX, float(lives.x[-1]), dX)[::-1].copy()
    contacts = kernel.Contacts(hazard_of(temperature), growth_of(ageing), table, first, spacing)
    reached, steps = reached_on(interface, before, place), math.ceil(slip / dX)
    found = kernel.step(contacts, place, reached, before, after, stiffness, dX, steps)
    if not np.isfinite(found).all():
        raise UndecidedError("the velocity step of the contacts: a step of it did not converge; give another stiffness")
    return found[1], found[0] - found[0, 0]


def contact_stiffness(interface: Interface, velocity: float) -> float:
    """Stiffness of the contacts that are attached in steady sliding, per contact: what a sudden step finds.

    Contacts live alike with a delay and without one, so the force that they carry falls with the fraction attached.
    """
    if velocity * interface.delay.moment(1) == 0:
        return 1.0
    bare = replace(interface, sliding_force=0.0)
    return kinetic_friction(bare, velocity) / kinetic_friction(replace(bare, delay=Delay(0.0)), velocity)
