"""Cost of a run of blocks compared with plain loops over their contacts, and its lower
bound.

A plain loop visits all N contacts of a block in every step: it compares each with its
threshold, and with the time at which it re-attaches, and sums the forces. `lean` does
nothing else, on arrays that a compiler turns into vector instructions; `plain` also
keeps the records that a run keeps (births, delays, a random number for each life). With
s seconds per step of a block, b seconds per break, r breaks per step, and a loop of p
seconds per contact and step, the ratio is N p/(s + r b): at most N p/s, however fast
breaks are. Run it with ``python benchmarks/count_blocks.py``.
"""

import time
from dataclasses import replace

import numpy as np
from numba import njit

import stickslip as ss
from stickslip.simulation import estimate
from stickslip.simulation.engines.blocks import _STEP

BLOCKS = 200
STEPS = 2_000


@njit(error_model="numpy")
def lean(X, V, birth, threshold, steps, h):
    """Move all blocks on and sum the forces of their contacts; none breaks."""
    total = 0.0
    for _ in range(steps):
        for j in range(X.size):
            X[j] += h * V[j]
            force = 0.0
            broken = 0
            for i in range(birth.shape[1]):
                x = X[j] - birth[j, i]
                force += x
                broken += abs(x) > threshold[j, i]
            total += force + broken
    return total


@njit(error_model="numpy")
def plain(X, V, birth, threshold, ready, steps, h, delay):
    """The same with the life of every contact: it breaks, waits, and re-attaches with
    another threshold.
    """
    total = 0.0
    t = 0.0
    for _ in range(steps):
        t += h
        for j in range(X.size):
            X[j] += h * V[j]
            force = 0.0
            for i in range(birth.shape[1]):
                if threshold[j, i] > 0.0:
                    x = X[j] - birth[j, i]
                    if abs(x) > threshold[j, i]:
                        threshold[j, i] = 0.0
                        ready[j, i] = t + delay
                    else:
                        force += x
                elif t >= ready[j, i]:
                    threshold[j, i] = np.random.normal(1.0, 0.1)  # noqa: NPY002, numba has no Generator of its own
                    birth[j, i] = X[j]
            total += force
    return total


def loops(count: int) -> tuple[float, float]:
    """Return the seconds per step of a block in the lean loop and in the plain one,
    with contacts attached and some breaking.
    """
    rng = np.random.default_rng(1)
    X = np.zeros(BLOCKS)
    V = np.ones(BLOCKS)
    birth = -rng.random((BLOCKS, count))
    threshold = birth + rng.normal(2.0, 0.1, birth.shape)
    spent = []
    for run, more in ((lean, ()), (plain, (np.zeros_like(birth),))):
        for steps in (1, STEPS):  # the first run compiles it
            given = [a.copy() for a in (X, V, birth, threshold, *more)]
            begin = time.process_time()
            run(*given, steps, 1e-4, *((0.2,) if more else ()))
            seconds = time.process_time() - begin
        spent.append(seconds / (STEPS * BLOCKS))
    return spent[0], spent[1]


def run_of_blocks(count: int) -> tuple[float, float, float]:
    """Return the seconds per step of a block, the seconds per break, and the breaks per
    step, in stick-slip of all blocks.
    """
    interface = ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.2)
    )
    body = ss.Chain(blocks=BLOCKS, coupling=20.0, mass=1e-4, damping=42.426, leaf=2.0)
    rig = ss.Rig(
        interface,
        body,
        ss.constant(1.0, duration=0.3),
        method=ss.Contacts(count, seed=1),
    )
    found = []
    # nothing breaks while the drive stands still
    for speed, duration in ((0.0, 0.01), (0.0, 4.0), (1.0, 4.0)):
        case = replace(
            rig,
            drive=ss.constant(speed, duration=duration),
            output=ss.Output(interval=duration),
        )
        begin = time.process_time()
        run = ss.simulate(case, long=True)
        found.append(
            (
                time.process_time() - begin,
                estimate(case).parts[0].seconds / _STEP,
                float(run["broken"][-1].sum()) * count,
            )
        )
    (first, steps_0, _), (quiet, steps_1, _), (busy, steps_2, breaks) = found
    step = (quiet - first) / (steps_1 - steps_0)
    return (
        step,
        max(busy - first - step * (steps_2 - steps_0), 0.0) / breaks,
        breaks / steps_2,
    )


if __name__ == "__main__":
    ns = 1e9
    for count in (100, 1000):
        run_of_blocks(count)
        step, each, rate = run_of_blocks(count)
        whole = step + rate * each
        for name, loop in zip(("lean", "plain"), loops(count), strict=True):
            print(
                f"N {count}: step {step * ns:.1f} ns, break {each * ns:.0f} ns, "
                f"{1e3 * rate:.1f} breaks in 1000 steps: "
                f"{whole * ns:.1f} ns; {name} loop {loop * ns:.0f} ns "
                f"({loop / count * ns:.2f} a contact): "
                f"{loop / whole:.1f} times, {loop / step:.1f} at best"
            )
