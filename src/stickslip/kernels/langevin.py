"""Contacts whose thresholds age by a Langevin equation, Eqs. (13)-(17): the model, and
the grids of one life.

Everything is per contact and in natural units (contact stiffness 1). A threshold
follows

    df = rate^2 (mean - f) dt + rate std sqrt(2) dW,        Eqs. (13), (15), (16)

with ``rate`` the paper's beta, ``mean`` its f_s and ``std`` its delta f_s. A contact
breaks when its stretching ``|x|`` first meets its threshold ``f``; it re-attaches at
``x = 0`` with the threshold ``newborn``. Its *rupture margin* ``y = f - |x|`` is the
distance that is left until it breaks.

With ``newborn = 0`` a contact attaches on its own breaking boundary. It then breaks and
re-attaches infinitely often before it leaves the boundary for good, as Brownian motion
returns to zero: the rate of breaking is infinite, while force, stretchings and
thresholds are finite. All solvers here therefore count *excursions* of the margin from
zero, by its local time there, and never breaks.
"""

from typing import NamedTuple

import numpy as np

from ._jit import jit
from .records import Floats


class Langevin(NamedTuple):
    """Ageing by Eqs. (15) and (16): beta, f_s, delta f_s, and the threshold of a
    newborn contact.
    """

    rate: float
    mean: float
    std: float
    newborn: float = 0.0


class Life(NamedTuple):
    """Everything that lives at constant velocity depend on, in the units of the ageing.

    ``u = velocity/(rate^2 mean)``, above 0; ``delta = std/mean``, above 0; `newborn` in
    units of the mean threshold.
    """

    u: float
    delta: float
    newborn: float


@jit
def life_at(velocity: float, langevin: Langevin) -> Life:
    """Return the parameters of lives at a constant velocity."""
    time = 1.0 / (langevin.rate * langevin.rate)
    mean = langevin.mean
    return Life(
        abs(velocity) * time / mean,
        langevin.std / mean,
        langevin.newborn / mean,
    )


@jit
def graded_nodes(end: float, cells: int, first: float) -> Floats:
    """Return nodes from 0 to `end`, with the spacing `first` at 0 and growing as a
    sinh; uniform nodes if these are finer.
    """
    nodes = np.linspace(0.0, end, cells + 1)
    if first < 0.999 * end / cells:
        low = 1e-6
        high = 60.0
        for _ in range(60):
            k = 0.5 * (low + high)
            if end * np.sinh(k / cells) / np.sinh(k) > first:
                low = k
            else:
                high = k
        for i in range(cells + 1):
            nodes[i] = end * np.sinh(k * i / cells) / np.sinh(k)
    return nodes


@jit
def margin_nodes(life: Life, cells: int) -> Floats:
    """Return nodes of the margin in units of the standard deviation, from the boundary
    to where the density is below 1e-15.

    The drift of the margin of a newborn is ``c = (1-u)/delta``, in the potential
    ``z^2/2 - c z``.
    """
    c = (1.0 - life.u) / life.delta
    end = c + np.sqrt((c * c if c < 0.0 else 0.0) + 72.0)
    end = max(end, life.newborn / life.delta + 8.5)
    layer = 1.0 / max(1.0, abs(c))  # thickness of the layer where drift balances noise
    return graded_nodes(end, cells, 5.0 * layer / cells)


@jit
def longest_age(life: Life) -> float:
    """Return the age, in units of 1/rate^2, beyond which survivors are fewer than
    exp(-30).

    Where the drift ``c(a)`` of the margin is negative, survivors decay at least as
    exp(-int c^2/4 da).
    """
    c = (1.0 - life.u) / life.delta
    r = life.u / life.delta
    z = life.newborn / life.delta
    end = (
        ((360.0 * r - c**3) ** (1.0 / 3.0) + c) / r
        if c < 0.0
        else c / r + (360.0 / r**2) ** (1.0 / 3.0)
    )
    # the time in which the drift alone would bring a newborn to the boundary
    return float(end + min(np.sqrt(2.0 * z / r), z / max(-c, 1e-9)))


@jit
def bernoulli(z: float) -> float:
    """Return the Bernoulli function ``z / (exp(z) - 1)``, which gives exponentially
    fitted fluxes of drift and diffusion between cells.
    """
    if abs(z) < 1e-3:
        return 1.0 - 0.5 * z + z * z / 12.0
    if z > 700.0:
        return 0.0
    return z / float(np.expm1(z))


@jit
def margin_rates(
    z: Floats,
    c: float,
    up: Floats,
    down: Floats,
) -> None:
    """Fill the rates between the nodes of the margin: drift ``c - z``, diffusion 1,
    absorption at ``z = 0``.

    Scharfetter-Gummel: positive, conservative, and the stationary Gaussian of Eq. (17)
    is its exact fixed point up to the second order of the cells. ``up[i]`` is the rate
    from node i to i+1, ``down[i]`` to i-1; node 0 absorbs.
    """
    m = z.size - 1
    for i in range(m):
        h = z[i + 1] - z[i]
        d = (c - 0.5 * (z[i] + z[i + 1])) * h
        b = bernoulli(d)
        if i > 0:
            up[i] = (b + d) / (h * 0.5 * (z[i + 1] - z[i - 1]))
        width = 0.5 * (z[i + 2] - z[i]) if i + 2 <= m else 0.5 * h
        down[i + 1] = b / (h * width)
    up[m] = 0.0
