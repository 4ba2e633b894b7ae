"""What bounds the contacts engine, by counting: events, time an event, and the part of the closed form between events.

``python benchmarks/count_events.py`` prints a table for Fig. 4c. The closed form by itself (take-off, Newton's method
to the next event, energies) is timed on short flights, each waiting for the one before as in the engine.
"""

import math
import time

import numpy as np
from numpy.typing import NDArray
from test_contacts_bench import FIG4, plain

import stickslip as ss
from stickslip.kernels._jit import jit
from stickslip.kernels.between_events import EVENTS
from stickslip.kernels.drive import Quadratic, Stop
from stickslip.kernels.flight import NEAR, energies, soon, take_off
from stickslip.simulation.engines import Beginning
from stickslip.simulation.engines.base import Leg
from stickslip.simulation.engines.events import Events


@jit
def closed_forms(flights: int, K: float, M: float, eta: float, out: NDArray[np.float64]) -> None:
    """Fly that many short flights, the velocity of each from the one before."""
    near = NEAR / (eta + math.sqrt((K + 1.0) / M))
    v, total = 1.0, 0.0
    for i in range(flights):
        w2 = (K + 0.85 + 1e-4 * (i & 63)) / M
        flight = take_off(eta, w2, near, v, 0.02 * eta * v + 0.01 * (i & 7), K / M - w2 * v, 0.0)
        h, y, u, _, _ = soon(flight, 1e-5 * (1 + (i & 15)), 1.0)
        work, squares = energies(flight, h, y, u, 0.3, K, 1.0, 0.0)
        total += work + squares + h
        v = 1.0 + 1e-3 * (u - v)
    out[0] = total


def seconds_and_events(count: int, duration: float) -> tuple[float, int]:
    """CPU time and events of a run without samples."""
    engine = Events(Beginning(FIG4.interface, FIG4.slider, 1.0), ss.Contacts(count, seed=1))
    leg = Leg(Quadratic(0.0, 0.0, 1.0, 0.0), duration, np.array([duration]), Stop())
    begin = time.process_time()
    while not engine.advance(leg).over:
        pass
    return time.process_time() - begin, int(engine._state.counts[EVENTS])


def main() -> None:
    slider, out = FIG4.slider, np.zeros(1)
    flights = 1_000_000
    best = math.inf
    for repeat in range(6):  # the first one compiles
        begin = time.process_time()
        closed_forms(flights if repeat else 10, slider.stiffness, slider.mass, slider.damping, out)
        best = min(best, time.process_time() - begin) if repeat else math.inf
    closed = 1e9 * best / flights
    plain(100, 0.01)
    seconds_and_events(100, 0.01)
    print(f"closed form between two events: {closed:.0f} ns")
    print("contacts  events    ns/event  closed form  plain/engine  plain/closed form alone")
    for count, duration, rounds in ((10_000, 10.0, 5), (100_000, 10.0, 2), (1_000_000, 3.0, 1)):
        taken, events = min(seconds_and_events(count, duration) for _ in range(rounds))
        begin = time.process_time()
        plain(count, part := max(0.3, 10_000.0 / count))
        loop = (time.process_time() - begin) * duration / part
        print(
            f"{count:<9d} {events:<9d} {1e9 * taken / events:<9.0f} {closed * events / 1e9 / taken:<12.0%} "
            f"{loop / taken:<13.0f} {loop / (1e-9 * closed * events):.0f}"
        )


if __name__ == "__main__":
    main()
