"""The contacts behind two friction coefficients: what a bench measures, turned into what the model asks for."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy import optimize

from stickslip.errors import InputError
from stickslip.kernels import renewal
from stickslip.model.distributions import Distribution, Gaussian, excess, panels

NARROWEST, WIDEST = 0.01, 1.0
"""Standard deviations among which that of the thresholds is looked for, in units of their mean."""


@lru_cache(maxsize=256)
def slow_friction(thresholds: Distribution, initial: Distribution) -> tuple[float, float]:
    """Return static and kinetic friction in slow rigid motion without delay, per contact in ``f_s``.

    The static friction is the first maximum of Eqs. (1)-(4), the kinetic one its limit after a long way. Good to 1e-4.
    """
    positive = thresholds.positive()
    mean = positive.moment(1)
    kinetic = 0.5 * positive.moment(2) / mean
    std = initial.standard_deviation()
    if std == 0:
        x, weight = np.array([initial.moment(1)]), np.ones(1)
    else:
        low, high = (float(np.clip(end, -positive.support[1], positive.support[1])) for end in initial.support)
        width = 4.0 * min(std, max(positive.standard_deviation(), 1e-3 * std))
        x, weight = panels(low, high, math.ceil((high - low) / width))
        weight = weight * initial.density(x)
        kept = (weight > 0) & (positive.survival(np.abs(x)) > 0)
        x, weight = x[kept], weight[kept] / weight[kept].sum()
    contacts = renewal.Contacts(
        positive.density,
        lambda at, order: excess(positive, at, order),
        x,
        weight,
        np.maximum(x, 0.0),
        np.zeros(1),
        np.ones(1),
    )
    distance = 2.0 * mean + float(positive.inverse_survival(1e-3))
    points = max(512, math.ceil(distance / (positive.standard_deviation() / 4.0)))
    force = renewal.observe(
        contacts, renewal.solve(contacts, distance, points), np.linspace(0.0, distance, 4 * points + 1)
    ).force
    return float(force.max()), float(kinetic)


@lru_cache(maxsize=64)
def thresholds_of(static: float, kinetic: float, initial: Distribution) -> tuple[Gaussian, float]:
    """Return Gaussian thresholds whose friction has a given ratio, and the contact strength that makes up its size.

    Parameters
    ----------
    static, kinetic : float
        Static and kinetic friction in slow sliding, both in one unit: forces, or coefficients.
    initial : Distribution
        Stretchings at the start: the wider, the lower the static friction.

    Returns
    -------
    thresholds : Gaussian
        With a mean of 1.
    strength : float
        Sum of the threshold forces of all contacts, in the same unit.

    Raises
    ------
    InputError
        If no standard deviation gives this ratio; the message has the range that can be had.
    """

    def ratio(std: float) -> float:
        ends = slow_friction(Gaussian(mean=1.0, std=std), initial)
        return ends[0] / ends[1]

    wanted, least, most = static / kinetic, ratio(WIDEST), ratio(NARROWEST)
    if not least <= wanted <= most:
        raise InputError(
            f"mu_s/mu_k = {wanted:.4g}: must be between {least:.3f} and {most:.3f}, which is what contacts of the same "
            "kind can give; a larger ratio needs contacts that strengthen at rest: give contact_strength, thresholds "
            "and ageing"
            if wanted > most
            else f"mu_s/mu_k = {wanted:.4g}: must be between {least:.3f} and {most:.3f}, which is what Gaussian "
            "thresholds can give"
        )
    std = float(optimize.brentq(lambda at: ratio(at) - wanted, NARROWEST, WIDEST, xtol=1e-10))
    thresholds = Gaussian(mean=1.0, std=std)
    return thresholds, kinetic / slow_friction(thresholds, initial)[1]
