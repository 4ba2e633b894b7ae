"""A case of about a millisecond that releases the GIL; in a module that worker
processes can import.
"""

import time

import numba
import numpy as np


@numba.njit(nogil=True, cache=True)
def spin(steps, start):
    x = start
    for _ in range(steps):
        x = 3.9 * x * (1.0 - x)
    return x


def steps_for(seconds):
    """Return the number of steps that takes this CPU time here."""
    spin(10, 0.3)
    best = np.inf
    for _ in range(20):
        begin = time.thread_time()
        spin(100_000, 0.3)
        best = min(best, time.thread_time() - begin)
    return int(100_000 * seconds / best)


def case(i, seed, steps=100):
    begin = time.thread_time()
    x = spin(steps, 0.1 + 0.8 * (seed / 2**63))
    return {"twice": 2 * i, "x": x, "busy": time.thread_time() - begin}


def warm(start):
    """Load the compiled kernel, for long enough that every process of a pool gets a
    case.
    """
    time.sleep(0.5)
    return spin(10, start)
