"""The slider between two events: an oscillator on the driving spring and on the contacts, Eq. (11), in closed form.

Everything is per contact and in natural units (contact stiffness 1), in any unit of time.
"""

from typing import NamedTuple

import numpy as np

from ._jit import jit


class Quadratic(NamedTuple):
    """Motion of the drive: ``position + velocity u + acceleration u^2/2`` a time `u` after `start`."""

    start: float
    position: float
    velocity: float
    acceleration: float


class Slider(NamedTuple):
    """Stiffness K of the driving spring, mass M and damping rate eta of Eq. (11).

    ``stiffness = inf`` is rigid motion: the slider is where the drive is, and the other two do not matter.
    """

    stiffness: float
    mass: float
    damping: float


RIGID = Slider(np.inf, 1.0, 0.0)


class Motion(NamedTuple):
    """Time, position X and velocity V of the slider, and the amplitude of its free oscillation."""

    time: float
    X: float
    V: float
    amplitude: float


class Load(NamedTuple):
    """Force of the contacts while the slider moves on: ``force + stiffness (X(t) - X) - loss t - ramp t^2/2``.

    `loss` is what breaking takes from the force per time at the start, `ramp` how fast that grows.
    """

    force: float
    stiffness: float
    loss: float
    ramp: float


@jit
def drive_at(drive: Quadratic, time: float) -> tuple[float, float]:
    """Position and velocity of the drive."""
    u = time - drive.start
    v, a = drive.velocity, drive.acceleration
    return drive.position + u * (v + 0.5 * a * u), v + a * u


@jit
def oscillate(
    X: float, V: float, k: float, mass: float, damping: float, g: tuple[float, float, float], dt: float
) -> tuple[float, float, float]:
    """Exact step of ``M X'' + M eta X' + k X = g[0] + g[1] t + g[2] t^2``.

    Returns the new X and V, and the amplitude of the free oscillation about the forced motion.
    """
    p2 = g[2] / k
    p1 = (g[1] - 2.0 * mass * damping * p2) / k
    p0 = (g[0] - mass * damping * p1 - 2.0 * mass * p2) / k
    x, v = X - p0, V - p1
    half = 0.5 * damping
    square = k / mass - half * half
    w = np.sqrt(abs(square))
    if w * dt < 1e-6:  # critically damped
        c, s = 1.0, dt
    elif square > 0.0:
        c, s = np.cos(w * dt), np.sin(w * dt) / w
    else:
        c, s = np.cosh(w * dt), np.sinh(w * dt) / w
    decay = np.exp(-half * dt)
    new_x = decay * (c * x + s * (v + half * x))
    new_v = decay * (c * v - s * (half * v + k / mass * x))
    amplitude = np.sqrt(x * x + (v + half * x) ** 2 / max(w * w, k / mass * 1e-6))
    return new_x + p0 + dt * (p1 + p2 * dt), new_v + p1 + 2.0 * p2 * dt, amplitude


@jit
def move(slider: Slider, drive: Quadratic, start: Motion, load: Load, dt: float) -> Motion:
    """Slider a time `dt` later, under the force of the contacts that `load` describes."""
    D, v = drive_at(drive, start.time)
    K, a = slider.stiffness, drive.acceleration
    if np.isinf(K):
        return Motion(start.time + dt, D + dt * (v + 0.5 * a * dt), v + a * dt, 0.0)
    pull = (K * D - load.force + load.stiffness * start.X, K * v + load.loss, 0.5 * (K * a + load.ramp))
    X, V, amplitude = oscillate(start.X, start.V, K + load.stiffness, slider.mass, slider.damping, pull, dt)
    return Motion(start.time + dt, X, V, amplitude)
