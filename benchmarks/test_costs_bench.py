"""Costs of runs and answers: each interface, method and question compared with the
cheapest of its kind, in the same run.
"""

import math
import time
from dataclasses import replace
from itertools import count
from typing import Any

import pytest

import stickslip as ss
from stickslip.model import Barrier, Parabolic
from stickslip.paper.cases import FIG4, FIG7

COUNT = 2000
LONG = 60.0
SHORT = 10.0
SLIDER = ss.Slider(stiffness=5.0, mass=1e-3, damping=50.0)
PLAIN: dict[str, Any] = {
    "thresholds": ss.Gaussian(mean=1.0, std=0.1),
    "delay": ss.Delay(0.05),
}

BELL = ss.Bell(width=0.02, attempts=1e4)
PARABOLIC = Parabolic(temperature=0.02, attempts=1e4)
BARRIER = Barrier(height=50.0, attempts=1e4)
LOGARITHMIC = ss.LogarithmicGrowth(slope=0.02, time=1e-3)
EXPONENTIAL = ss.ExponentialGrowth(rate=1.0, newborn=0.3)
LANGEVIN = ss.Langevin(rate=1.0, newborn=0.1)

MECHANISMS: dict[str, tuple[dict[str, Any], float]] = {
    "of different areas": (
        {"thresholds": None, "areas": ss.model.Areas(ss.Gaussian(mean=1.0, std=0.1))},
        1.8,
    ),
    "that strengthen, logarithmically": ({"ageing": LOGARITHMIC}, 7),
    "that strengthen, exponentially": ({"ageing": EXPONENTIAL}, 40),
    "that break by heat, Bell's rate": ({"activation": BELL}, 4.5),
    "that break by heat, a parabolic barrier": ({"activation": PARABOLIC}, 10),
    "that break by heat, a power-law barrier": ({"activation": BARRIER}, 15),
    "that strengthen logarithmically, Bell's rate": (
        {"activation": BELL, "ageing": LOGARITHMIC},
        13,
    ),
    "that strengthen exponentially, a power-law barrier": (
        {"activation": BARRIER, "ageing": EXPONENTIAL},
        50,
    ),
    "whose thresholds age by Langevin": ({"ageing": LANGEVIN}, 10),
    "whose thresholds age by Langevin, Bell's rate": (
        {"ageing": LANGEVIN, "activation": BELL},
        60,
    ),
}


def sliding(
    interface: dict[str, Any], count: int = COUNT, way: float = SHORT
) -> ss.Rig:
    """A rig at unit velocity: the distance in breaking displacements is the time."""
    return ss.Rig(
        ss.Interface(**PLAIN | interface),
        SLIDER,
        ss.constant(1.0, way),
        method=ss.Contacts(count),
        start=ss.FromSliding(),
    )


def of(
    benchmark, group: str, what: str = "", promised: float = 0.0, scale: float = 1.0
) -> None:
    """Give a benchmark its place in the table; one without a promise is the reference
    of the others.
    """
    benchmark.group = group
    benchmark.extra_info.update(
        role="cost" if what else "plain", what=what, promised=promised, scale=scale
    )


def run(benchmark, rig: ss.Rig, rounds: int = 3, **settings: Any) -> None:
    """Simulate a rig, after one run that is not timed."""
    output = ss.Output(interval=0.1)
    benchmark.pedantic(
        ss.simulate,
        (rig,),
        {"output": output} | settings,
        rounds=rounds,
        warmup_rounds=1,
    )


def run_beyond(benchmark, interface: dict[str, Any], rounds: int = 3) -> None:
    """Simulate a long distance. The time of a short distance, mostly the start, is
    subtracted, and so is that distance.
    """
    output = ss.Output(interval=0.1)
    short = math.inf
    for _ in range(4):  # the first one compiles
        begin = time.process_time()
        ss.simulate(sliding(interface), output=output)
        short = min(short, time.process_time() - begin)
    benchmark.extra_info.update(start=short, scale=1.0 / (COUNT * (LONG - SHORT)))
    run(benchmark, sliding(interface, way=LONG), rounds=rounds)


# ------------------------------------------------------------ contacts, by what they do

CONTACTS = "A contact over a breaking displacement"


def test_contacts_of_fixed_thresholds(benchmark):
    of(benchmark, CONTACTS)
    run_beyond(benchmark, {}, rounds=10)


@pytest.mark.parametrize("name", MECHANISMS)
def test_contacts(benchmark, name):
    mechanism, promised = MECHANISMS[name]
    of(benchmark, CONTACTS, name, promised)
    run_beyond(benchmark, mechanism)


MORE = f"A run of {COUNT} contacts"


@pytest.mark.parametrize(
    ("count", "promised"), [(10_000, 20), (100_000, 250), (1_000_000, 5000)]
)
def test_more_contacts(benchmark, count, promised):
    """In the last step memory exceeds every cache, and costs more than ten times as
    much.
    """
    of(benchmark, MORE, f"of {count:.0e}", promised)
    run(benchmark, sliding({}, count), rounds=2)


def test_two_thousand_contacts(benchmark):
    of(benchmark, MORE)
    run(benchmark, sliding({}), rounds=20)


# ---------------------------------------------------------------- the other methods

STICK_SLIP = "Stick-slip of Fig. 4c for six time units, master equation"
FIG4C = ss.Rig(FIG4.interface, FIG4.slider, ss.constant(1.0, 6.0))


def test_master_equation(benchmark):
    of(benchmark, STICK_SLIP)
    run(benchmark, FIG4C.replace(method=ss.MasterEquation(rtol=1e-4)), rounds=10)


@pytest.mark.parametrize(("rtol", "promised"), [(1e-5, 3), (1e-6, 5), (1e-7, 8)])
def test_master_equation_to_a_tolerance(benchmark, rtol, promised):
    of(benchmark, STICK_SLIP, f"rtol {rtol:.0e} beside 1e-4", promised)
    run(benchmark, FIG4C.replace(method=ss.MasterEquation(rtol=rtol)), rounds=5)


HOT = {width: ss.Bell(width=width, attempts=1e6) for width in (0.1, 0.01, 0.001)}
OTHERS: dict[str, dict[str, Any]] = {
    **{
        f"Bell's rate of width {width:g}": {"activation": bell}
        for width, bell in HOT.items()
    },
    "logarithmic growth": {"ageing": LOGARITHMIC},
    "a parabolic barrier": {"activation": Parabolic(temperature=0.01, attempts=1e6)},
    "Bell's rate of width 0.01, logarithmic growth": {
        "ageing": LOGARITHMIC,
        "activation": HOT[0.01],
    },
}


@pytest.mark.parametrize("name", OTHERS)
def test_master_equation_of_other_contacts(benchmark, name):
    interface = replace(FIG4.interface, **OTHERS[name])
    of(benchmark, STICK_SLIP, f"{name}, rtol 1e-4", 25)
    run(
        benchmark,
        FIG4C.replace(interface=interface, method=ss.MasterEquation(rtol=1e-4)),
        rounds=5,
    )


def test_population(benchmark):
    of(benchmark, STICK_SLIP, "population of 1e8 contacts", 4)
    run(benchmark, FIG4C.replace(method=ss.Population(10**8)), rounds=10)


# ---------------------------------------------------------------- answers

QUESTION = "One run of 2000 contacts, twenty time units"
RIG = ss.Rig(
    FIG7.interface, FIG7.slider, ss.constant(1.0, 20.0), method=ss.Contacts(2000)
)


def test_a_run(benchmark):
    of(benchmark, QUESTION)
    run(benchmark, RIG, rounds=10)


ANEW = count(1.0, 1e-6)
ANSWERS: dict[str, tuple[Any, float]] = {
    "critical velocities": (
        lambda: ss.critical(RIG, "velocity", between=(0.1, 10.0)),
        10,
    ),
    # At another velocity each time, because results for one are cached.
    "noise of the contacts": (
        lambda: ss.stability.contact_noise(
            RIG.replace(stiffness=10.0, velocity=next(ANEW))
        ),
        3,
    ),
    "bistable range of the velocity": (
        lambda: ss.bistable_range(RIG, "velocity", between=(0.3, 2.0)),
        250,
    ),
    "rate-and-state parameters, Bell's rate": (
        lambda: ss.rate_and_state(ss.Interface(**PLAIN | {"activation": BELL}), 1.0),
        300,
    ),
    "whether it stick-slips, to three speeds": (lambda: ss.predict(RIG), 3000),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer(benchmark, name):
    ask, promised = ANSWERS[name]
    of(benchmark, QUESTION, name, promised)
    benchmark.pedantic(ask, rounds=1, warmup_rounds=1)
