"""A spring-slider with rate-and-state friction: the forward model of velocity steps
and holds.
"""

import numpy as np

from ._jit import jit
from .records import Floats

AGEING = 0
SLIP = 1

# Dormand and Prince, fifth order with an error estimate of fourth.
_STAGE = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [
            19372 / 6561,
            -25360 / 2187,
            64448 / 6561,
            -212 / 729,
            0.0,
            0.0,
        ],
        [
            9017 / 3168,
            -355 / 33,
            46732 / 5247,
            49 / 176,
            -5103 / 18656,
            0.0,
        ],
        [
            35 / 384,
            0.0,
            500 / 1113,
            125 / 192,
            -2187 / 6784,
            11 / 84,
        ],
    ]
)
_ERROR = np.array(
    [
        71 / 57600,
        0.0,
        -71 / 16695,
        71 / 1920,
        -17253 / 339200,
        22 / 525,
        -1 / 40,
    ]
)

# ln(v/v0) above which the slider has run away
_FASTEST = 60.0

# most steps from one time to the next: they take some 10 s
_MOST_STEPS = 10_000_000
_TOO_MANY_STEPS = (
    "more than 10,000,000 steps from one time to the next; give a softer spring, or "
    "more times in between"
)


@jit
def slide(
    law: int,
    a: float,
    b: float,
    distance: float,
    stiffness: float,
    times: Floats,
    pull: Floats,
    tolerance: float,
) -> Floats:
    """Friction of a massless slider on a spring, from steady sliding at the first
    velocity of the pull.

    ``F = a ln(v/v0) + b ln(v0 theta/D)``, with ``theta' = 1 - v theta/D`` (ageing law)
    or ``-(v theta/D) ln(v theta/D)`` (slip law), and ``F' = stiffness (pull - v)``;
    `pull` holds from each time to the next. Returns friction relative to the start,
    ``ln(v/v0)`` and ``ln(theta v0/D)``; NaN once the slider has run away. `tolerance`
    is the largest error of the logarithms in a step.
    """
    found = np.full((3, times.size), np.nan)
    slope = np.zeros((7, 2))
    here = np.zeros(2)
    there = np.zeros(2)
    v0 = pull[0]
    t = times[0]
    found[:, 0] = 0.0
    h = 1e-3 * distance / v0
    # In units of the first velocity and of D/v0.
    unit = distance / v0
    for k in range(times.size - 1):
        drive = pull[k] / v0
        if k == 0 or pull[k] != pull[k - 1]:
            h = min(h, 1e-4 * unit * a / (stiffness * distance + a))
        for turn in range(_MOST_STEPS + 1):
            if not t < times[k + 1]:
                break
            if turn == _MOST_STEPS:
                raise RuntimeError(_TOO_MANY_STEPS)
            last = h >= times[k + 1] - t
            if last:
                h = times[k + 1] - t
            for stage in range(7):
                for i in range(2):
                    there[i] = here[i]
                    for j in range(stage):
                        there[i] += h / unit * _STAGE[stage, j] * slope[j, i]
                speed = np.exp(min(there[0], 2.0 * _FASTEST))
                ratio = there[0] + there[1]
                change = np.exp(-there[1]) - speed if law == AGEING else -speed * ratio
                slope[stage, 1] = change
                slope[stage, 0] = (
                    stiffness * distance * (drive - speed) - b * change
                ) / a
            off = 0.0
            for i in range(2):
                error = 0.0
                for j in range(7):
                    error += h / unit * _ERROR[j] * slope[j, i]
                off = max(off, abs(error) / (tolerance * (1.0 + abs(there[i]))))
            if not np.isfinite(off):
                off = 1e6
            if off <= 1.0:
                t = times[k + 1] if last else t + h
                here[:] = there
                if here[0] > _FASTEST:
                    return found
            h *= min(5.0, max(0.1, 0.9 * max(off, 1e-10) ** -0.2))
            if h < 1e-14 * max(t, unit * 1e-6):
                return found
        found[0, k + 1] = a * here[0] + b * here[1]
        found[1, k + 1] = here[0]
        found[2, k + 1] = here[1]
    return found
