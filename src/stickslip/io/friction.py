"""The contacts behind two friction coefficients: what a bench measures, turned into what the model asks for."""

import math
from functools import lru_cache

import numpy as np
from scipy import optimize

from stickslip.errors import InputError
from stickslip.kernels import renewal
from stickslip.model.distributions import Distribution, Gaussian, excess
from stickslip.model.newborn import stretching_nodes

NARROWEST, WIDEST = 0.01, 1.0
"""Standard deviations among which that of the thresholds is looked for, in units of their mean."""


@lru_cache(maxsize=256)
def slow_friction(thresholds: Distribution, initial: Distribution) -> tuple[float, float]:
    """Return static and kinetic friction in slow rigid motion without delay, per contact in ``f_s``, good to 1e-4.

    The static friction is the first maximum of Eqs. (1)-(4), the kinetic one its limit after a long distance.
    """
    positive = thresholds.positive()
    mean = positive.moment(1)
    x, weight = stretching_nodes(initial, positive)
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
    solved, places = renewal.solve(contacts, distance, points), np.linspace(0.0, distance, 4 * points + 1)
    return float(renewal.observe(contacts, solved, places).force.max()), 0.5 * positive.moment(2) / mean


@lru_cache(maxsize=64)
def thresholds_of(static: float, kinetic: float, initial: Distribution) -> tuple[Gaussian, float]:
    """Return Gaussian thresholds of mean 1 whose slow friction has this ratio, and the sum of all threshold forces.

    Static and kinetic friction are forces or coefficients, and the sum is in the same unit. Raises `InputError` if no
    standard deviation gives their ratio; the message has the range that can be had.
    """

    def ratio(std: float) -> float:
        most, least = slow_friction(Gaussian(1.0, std), initial)
        return most / least

    wanted, least, most = static / kinetic, ratio(WIDEST), ratio(NARROWEST)
    if not least <= wanted <= most:
        more = "; more needs contacts that strengthen at rest: give contact_strength, thresholds and ageing"
        raise InputError(
            f"mu_s/mu_k = {wanted:.4g}: must be between {least:.3f} and {most:.3f} with Gaussian thresholds"
            + (more if wanted > most else "")
        )
    found = Gaussian(1.0, float(optimize.brentq(lambda std: ratio(std) - wanted, NARROWEST, WIDEST, xtol=1e-10)))
    return found, kinetic / slow_friction(found, initial)[1]
