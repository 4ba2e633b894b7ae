"""Limits of the contacts engine, by counting: events, time per event, the closed form
between events, and memory.

``python benchmarks/count_events.py`` prints a table for Fig. 4c, and the cost of a
break with and without temperature. The closed form by itself (take-off, Newton's method
to the next event, energies) is timed on short flights, each waiting for the one before
as in the engine. A random read of memory is timed in a chain through as many bytes as
the contacts take.
"""

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from test_contacts_bench import FIG4, plain
from test_costs_bench import COUNT, LONG, MECHANISMS, SHORT, sliding

import stickslip as ss
from stickslip.kernels._jit import jit
from stickslip.kernels.drive import Quadratic, Stop
from stickslip.kernels.flight import NEAR, energies, soon, take_off
from stickslip.simulation.engines import Beginning, engine_of
from stickslip.simulation.engines.base import Leg


@jit
def closed_forms(
    flights: int, K: float, M: float, eta: float, out: NDArray[np.float64]
) -> None:
    """Compute that many short flights, the velocity of each from the one before."""
    near = NEAR / (eta + math.sqrt((K + 1.0) / M))
    v = 1.0
    total = 0.0
    for i in range(flights):
        w2 = (K + 0.85 + 1e-4 * (i & 63)) / M
        flight = take_off(
            eta, w2, near, v, 0.02 * eta * v + 0.01 * (i & 7), K / M - w2 * v, 0.0
        )
        h, y, u, _, _ = soon(flight, 1e-5 * (1 + (i & 15)), 1.0)
        work, squares = energies(flight, h, y, u, 0.3, K, 1.0, 0.0)
        total += work + squares + h
        v = 1.0 + 1e-3 * (u - v)
    out[0] = total


@jit
def walk(following: NDArray[np.int64], steps: int) -> int:
    """Go from place to place; each read waits for the one before."""
    place = 0
    for _ in range(steps):
        place = following[place]
    return place


def random_read(contacts: int) -> float:
    """Return the nanoseconds of a random read in the memory of this number of contacts,
    two to a cache line.
    """
    places = 32 * contacts // 64  # cache lines
    order = np.random.default_rng(1).permutation(places)
    following = np.zeros(8 * places, np.int64)
    following[8 * order] = 8 * np.roll(order, -1)
    walk(following, 10)
    begin = time.process_time()
    walk(following, steps := min(places, 500_000))
    return 1e9 * (time.process_time() - begin) / steps


def seconds_and_events(
    count: int,
    duration: float,
    interface: ss.Interface = FIG4.interface,
    what: str = "events",
) -> tuple[float, int]:
    """Return CPU time and number of events, or breaks, of a run without samples."""
    method = ss.Contacts(count, seed=1)
    engine: Any = engine_of(interface, method)(
        Beginning(interface, FIG4.slider, 1.0), method
    )
    leg = Leg(Quadratic(0.0, 0.0, 1.0, 0.0), duration, np.array([duration]), Stop())
    begin = time.process_time()
    while not engine.advance(leg).over:
        pass
    return time.process_time() - begin, int(engine._state.motion[0][what])


def lives_and_events(mechanism: dict[str, Any]) -> tuple[float, float, float]:
    """Return lives of a contact per breaking displacement in steady sliding, events per
    life, and ns per event.
    """
    rig = sliding(mechanism)
    method = ss.Contacts(COUNT, seed=1)
    engine: Any = engine_of(rig.interface, method)(
        Beginning(rig.interface, rig.slider, 1.0, rig.start), method
    )
    m = engine._state.motion[0]
    seen = []
    for end in (SHORT, LONG):
        begin = time.process_time()
        while not engine.advance(
            Leg(Quadratic(0.0, 0.0, 1.0, 0.0), end, np.array([end]), Stop())
        ).over:
            pass
        seen.append((int(m["breaks"]), int(m["events"]), time.process_time() - begin))
    lives, events = np.subtract(seen[1], seen[0])[:2]
    taken = seen[1][2]
    return lives / (COUNT * (LONG - SHORT)), events / lives, 1e9 * taken / events


def main() -> None:
    slider = FIG4.slider
    out = np.zeros(1)
    flights = 1_000_000
    best = math.inf
    for repeat in range(6):  # the first one compiles
        begin = time.process_time()
        closed_forms(
            flights if repeat else 10,
            slider.stiffness,
            slider.mass,
            slider.damping,
            out,
        )
        best = min(best, time.process_time() - begin) if repeat else math.inf
    closed = 1e9 * best / flights
    plain(100, 0.01)
    seconds_and_events(100, 0.01)
    print(f"closed form between two events: {closed:.0f} ns")
    print(
        "contacts  events    ns/event  closed form  plain/engine  plain/closed form "
        "alone  random read"
    )
    for count, duration, rounds in (
        (10_000, 10.0, 5),
        (100_000, 10.0, 2),
        (1_000_000, 3.0, 1),
    ):
        taken, events = min(seconds_and_events(count, duration) for _ in range(rounds))
        begin = time.process_time()
        plain(count, part := max(0.3, 10_000.0 / count))
        loop = (time.process_time() - begin) * duration / part
        print(
            f"{count:<9d} {events:<9d} {1e9 * taken / events:<9.0f} "
            f"{closed * events / 1e9 / taken:<12.0%} "
            f"{loop / taken:<13.0f} {loop / (1e-9 * closed * events):<24.0f} "
            f"{random_read(count):.0f} ns"
        )
    warm = replace(FIG4.interface, activation=ss.Bell(width=0.01, attempts=1e6))
    for what in ("events", "breaks"):
        costs = []
        for interface in (FIG4.interface, warm):
            seconds_and_events(100, 0.01, interface)
            taken, count = min(
                seconds_and_events(10_000, 6.0, interface, what) for _ in range(5)
            )
            costs.append(1e9 * taken / count)
        cold, hot = costs
        print(
            f"{what[:-1]}: {cold:.0f} ns, with temperature {hot:.0f} ns, "
            f"{hot / cold:.2f} times as much"
        )
    print("lives a breaking displacement  events a life  ns/event")
    for name, (mechanism, _) in {"plain": ({}, 0.0), **MECHANISMS}.items():
        if "Langevin" not in name:
            print(
                f"{'{:<30.2f} {:<14.2f} {:<9.0f}'.format(*lives_and_events(mechanism))} {name}"  # noqa: E501
            )


if __name__ == "__main__":
    main()
