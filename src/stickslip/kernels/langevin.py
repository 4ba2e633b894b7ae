"""Contacts whose thresholds age by a Langevin equation, Eqs. (13)-(17): the model, and the grids of one life.

Everything is per contact and in natural units (contact stiffness 1). A threshold follows

    df = rate^2 (mean - f) dt + rate std sqrt(2) dW,        Eqs. (13), (15), (16)

with ``rate`` the paper's beta, ``mean`` its f_s and ``std`` its delta f_s. A contact breaks when its stretching ``|x|``
first meets its threshold ``f``; it re-attaches at ``x = 0`` with the threshold ``newborn``. Its *rupture margin*
``y = f - |x|`` is what is left until it breaks.

With ``newborn = 0`` a contact attaches on its own breaking boundary. It then breaks and re-attaches infinitely often
before it leaves the boundary for good, as Brownian motion returns to zero: the rate of breaking is infinite, while
force, stretchings and thresholds are finite. All solvers here therefore count *excursions* of the margin from zero,
by its local time there, and never breaks.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import jit
from .drift_diffusion import bernoulli

Floats = NDArray[np.float64]


class Langevin(NamedTuple):
    """Ageing by Eqs. (15) and (16): beta, f_s, delta f_s, and the threshold of a newborn contact."""

    rate: float
    mean: float
    std: float
    newborn: float = 0.0


class Life(NamedTuple):
    """Lives at constant velocity, in the units of the ageing: all that they depend on.

    ``u = velocity/(rate^2 mean)``, above 0; ``delta = std/mean``, above 0; `newborn` in units of the mean threshold.
    """

    u: float
    delta: float
    newborn: float


@jit
def life_at(velocity: float, langevin: Langevin) -> Life:
    """Lives at a constant velocity."""
    time, mean = 1.0 / (langevin.rate * langevin.rate), langevin.mean
    return Life(abs(velocity) * time / mean, langevin.std / mean, langevin.newborn / mean)


@jit
def graded_nodes(end: float, cells: int, first: float) -> Floats:
    """Nodes from 0 to `end`, spacing `first` at 0 and growing as a sinh; uniform where that is finer."""
    nodes = np.linspace(0.0, end, cells + 1)
    if first < 0.999 * end / cells:
        low, high = 1e-6, 60.0
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
    """Nodes of the margin in units of the standard deviation, from the boundary to where the density is below 1e-15.

    The drift of the margin of a newborn is ``c = (1-u)/delta``, in the potential ``z^2/2 - c z``.
    """
    c = (1.0 - life.u) / life.delta
    end = c + np.sqrt((c * c if c < 0.0 else 0.0) + 72.0)
    end = max(end, life.newborn / life.delta + 8.5)
    layer = 1.0 / max(1.0, abs(c))  # the boundary layer of the drift against the noise
    return graded_nodes(end, cells, 5.0 * layer / cells)


@jit
def age_nodes(life: Life, steps: int) -> Floats:
    """Nodes of the age in units of 1/rate^2, from 0 to where survivors are fewer than exp(-30).

    Where the drift ``c(a)`` of the margin is negative, survivors decay at least as exp(-int c^2/4 da).
    """
    c, r = (1.0 - life.u) / life.delta, life.u / life.delta
    if c < 0.0:
        end = ((360.0 * r - c**3) ** (1.0 / 3.0) + c) / r
    else:
        end = c / r + (360.0 / r**2) ** (1.0 / 3.0)
    z = life.newborn / life.delta
    if z > 0.0:  # the way down to the boundary, were there no noise
        end += min(np.sqrt(2.0 * z / r), z / max(-c, 1e-9))
    return graded_nodes(end, steps, 2.0 / steps)


@jit
def margin_rates(z: Floats, c: float, up: Floats, down: Floats) -> None:
    """Rates between the nodes of the margin: drift ``c - z``, diffusion 1, out at ``z = 0``.

    Scharfetter-Gummel: positive, conservative, and the stationary Gaussian of Eq. (17) is its exact fixed point up
    to the second order of the cells. ``up[i]`` leads from node i to i+1, ``down[i]`` to i-1; node 0 absorbs.
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


@jit
def between_nodes(z: Floats, place: float) -> tuple[int, float]:
    """Node above a place, and its weight in a linear interpolation between the nodes about it."""
    i = int(np.searchsorted(z, place))
    return i, (place - z[i - 1]) / (z[i] - z[i - 1])


@jit
def fine_nodes(life: Life, cells: int) -> tuple[Floats, Floats]:
    """Nodes of margin and age that also resolve the entrance of excursions: geometric from the first cell upwards."""
    c = (1.0 - life.u) / life.delta
    coarse = margin_nodes(life, cells)
    first = coarse[1] if life.newborn > 0.0 else 1.5 / (cells * max(1.0, abs(c)))
    z = graded_nodes(coarse[-1], cells, first)
    smooth = age_nodes(life, 2 * cells)
    age = np.empty(40 * cells)
    age[0] = 0.0
    start, j, k = 0.3 * z[1] * z[1], 0, 0
    while age[k] < smooth[-1] and k + 1 < age.size:
        while smooth[j + 1] <= age[k] and j + 2 < smooth.size:
            j += 1
        age[k + 1] = min(age[k] + min(8.0 / cells * (age[k] + start), smooth[j + 1] - smooth[j]), smooth[-1])
        k += 1
    return z, age[: k + 1].copy()


@jit
def density_by_age(life: Life, z: Floats, age: Floats) -> Floats:
    """Density (mass per node) of one life, for all ages; shape (ages, nodes).

    An L-stable Runge-Kutta step of second order (SDIRK2) from a unit of mass at the newborn's margin, or at the first
    node where the newborn is on its boundary.
    """
    m = z.size - 1
    c0, r = (1.0 - life.u) / life.delta, life.u / life.delta
    gamma = 1.0 - np.sqrt(0.5)
    up, down = np.zeros(m + 1), np.zeros(m + 1)
    mass = np.zeros((age.size, m + 1))
    if life.newborn > 0.0:
        i, w = between_nodes(z, life.newborn / life.delta)
        mass[0, i - 1], mass[0, i] = 1.0 - w, w
        mass[0, 0] = 0.0
    else:
        mass[0, 1] = 1.0
    upper, slope, stage = np.zeros(m + 2), np.zeros((2, m + 1)), np.zeros(m + 2)
    for j in range(age.size - 1):
        h = age[j + 1] - age[j]
        for k in range(2):
            margin_rates(z, c0 - r * (age[j] + h * (gamma if k == 0 else 1.0)), up, down)
            # (1 - gamma h L) stage = known; slope = L stage
            for i in range(1, m + 1):
                known = mass[j, i] + (h * (1.0 - gamma) * slope[0, i] if k == 1 else 0.0)
                below = gamma * h * up[i - 1]
                pivot = 1.0 / (1.0 + gamma * h * (up[i] + down[i]) - below * upper[i - 1])
                stage[i] = (known + below * stage[i - 1]) * pivot
                upper[i] = gamma * h * (down[i + 1] if i < m else 0.0) * pivot
                slope[k, i] = -known
            for i in range(m - 1, 0, -1):
                stage[i] += upper[i] * stage[i + 1]
            for i in range(1, m + 1):
                slope[k, i] = (slope[k, i] + stage[i]) / (gamma * h)
        for i in range(1, m + 1):
            mass[j + 1, i] = stage[i]
    return mass
