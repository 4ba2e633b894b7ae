"""Exponentially fitted fluxes of drift and diffusion between cells (Scharfetter and Gummel; Chang and Cooper)."""

import numpy as np

from ._jit import jit


@jit
def bernoulli(z: float) -> float:
    """Bernoulli function ``z / (exp(z) - 1)``."""
    if abs(z) < 1e-3:
        return 1.0 - 0.5 * z + z * z / 12.0
    if z > 700.0:
        return 0.0
    return z / float(np.expm1(z))


@jit
def bernoulli_slope(z: float) -> float:
    """Derivative of the Bernoulli function."""
    if abs(z) < 1e-2:
        return -0.5 + z / 6.0 - z**3 / 180.0
    if z > 300.0:
        return 0.0
    if z < -300.0:
        return -1.0
    e = float(np.expm1(z))
    return (e - z * (e + 1.0)) / (e * e)
