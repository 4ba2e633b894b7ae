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
