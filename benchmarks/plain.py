"""The plain loop that the contacts engine replaces: it checks every contact in every
time step.
"""

import numpy as np
from numpy.typing import NDArray

from stickslip.kernels._jit import jit


@jit
def plain_contacts(
    rng: np.random.Generator,
    stretching: NDArray[np.float64],
    threshold: NDArray[np.float64],
    K: float,
    M: float,
    eta: float,
    tau: float,
    velocity: float,
    duration: float,
    dt: float,
) -> NDArray[np.float64]:
    """Advance N Gaussian contacts (mean 1, standard deviation .1) with a delay; return
    the spring force after each step.
    """
    N = stretching.size
    back = np.full(N, -1.0)  # time of re-attachment; negative while attached
    F_d = np.empty(round(duration / dt))
    X = 0.0
    V = 0.0
    for step in range(F_d.size):
        t = (step + 1) * dt
        dX = V * dt
        force = 0.0
        for i in range(N):
            if back[i] < 0.0:
                x = stretching[i] + dX
                if abs(x) >= threshold[i]:
                    back[i] = t + tau
                else:
                    stretching[i] = x
                    force += x
            elif t >= back[i]:
                back[i] = -1.0
                stretching[i] = 0.0
                drawn = rng.normal(1.0, 0.1)
                while drawn <= 0.0:
                    drawn = rng.normal(1.0, 0.1)
                threshold[i] = drawn
        X += dX
        V += dt * ((K * (velocity * t - X) - force / N) / M - eta * V)
        F_d[step] = K * (velocity * t - X)
    return F_d
