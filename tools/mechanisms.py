"""Small rigs of every mechanism, method and body, for tests and pages.

Nothing but the package is imported here: pages are built without the tests' packages.
"""

import math

import stickslip as ss

TENTH = ss.Gaussian(mean=1.0, std=0.1)
BELL = ss.Bell(width=0.02, attempts=1e4)
BARRIER = ss.Barrier(height=60.0, attempts=1e4)
DELAY = ss.Delay(0.2)
LANGEVIN = ss.Langevin(rate=1.5, newborn=0.3)
LOGARITHMIC = ss.LogarithmicGrowth(slope=0.05, time=0.01)
EXPONENTIAL = ss.ExponentialGrowth(rate=2.0, newborn=0.3)
TABULATED = ss.model.TabulatedGrowth((0.01, 0.1, 1.0), (0.5, 0.9, 1.0))
KEPT = ss.model.Areas(TENTH, kept=True)
STRETCHED = ss.Uniform(low=-0.1, high=0.3)

MECHANISMS: dict[str, dict[str, object]] = {
    "none": {},
    "delay": {"delay": DELAY},
    "random delay": {"delay": ss.RandomDelay(mean=0.2, std=0.12)},
    "never back": {"delay": ss.Delay(math.inf)},
    "on arrest": {"delay": ss.OnArrest()},
    "sliding force": {"delay": DELAY, "sliding_force": 0.3},
    "newborns": {"delay": DELAY, "newborn": STRETCHED},
    "track": {"delay": DELAY, "slip_to_slip_scatter": 0.2},
    "Bell": {"activation": BELL},
    "Bell, delay, sliding force": {
        "activation": BELL,
        "delay": DELAY,
        "sliding_force": 0.3,
    },
    "Bell, newborns": {"activation": BELL, "newborn": STRETCHED},
    "Bell, on arrest": {"activation": BELL, "delay": ss.OnArrest()},
    "Bell, track": {"activation": BELL, "delay": DELAY, "slip_to_slip_scatter": 0.2},
    "barrier": {"activation": BARRIER},
    "logarithmic growth": {"ageing": LOGARITHMIC},
    "logarithmic growth, sliding force": {
        "ageing": LOGARITHMIC,
        "delay": DELAY,
        "sliding_force": 0.3,
    },
    "logarithmic growth, newborns": {"ageing": LOGARITHMIC, "newborn": STRETCHED},
    "exponential growth, delay": {"ageing": EXPONENTIAL, "delay": DELAY},
    "tabulated growth, delay": {"ageing": TABULATED, "delay": DELAY},
    "Bell, logarithmic growth": {"activation": BELL, "ageing": LOGARITHMIC},
    "barrier, exponential growth": {"activation": BARRIER, "ageing": EXPONENTIAL},
    "Langevin": {"ageing": LANGEVIN},
    "Langevin, delay": {"ageing": LANGEVIN, "delay": DELAY},
    "Bell, Langevin": {"activation": BELL, "ageing": LANGEVIN},
    "logarithmic growth, on arrest": {
        "ageing": LOGARITHMIC,
        "delay": ss.OnArrest(),
        "slip_to_slip_scatter": 0.2,
    },
    "barrier, exponential growth, newborns": {
        "activation": BARRIER,
        "ageing": EXPONENTIAL,
        "newborn": STRETCHED,
    },
    "barrier, on arrest, sliding force": {
        "activation": BARRIER,
        "delay": ss.OnArrest(),
        "sliding_force": 0.3,
    },
    "growth from nothing": {"ageing": ss.ExponentialGrowth(rate=2.0)},
    "areas": {"areas": KEPT},
    "areas, sliding force": {
        "areas": ss.model.Areas(TENTH),
        "delay": DELAY,
        "sliding_force": 0.3,
    },
    "areas, logarithmic growth, newborns": {
        "areas": KEPT,
        "ageing": LOGARITHMIC,
        "delay": DELAY,
        "newborn": STRETCHED,
    },
    "areas, barrier": {
        "areas": KEPT,
        "activation": BARRIER,
        "delay": DELAY,
        "slip_to_slip_scatter": 0.2,
    },
}
METHODS = {
    "Contacts": ss.Contacts(200, seed=3),
    "MasterEquation": ss.MasterEquation(rtol=1e-4),
    "Population": ss.Population(2_000, seed=3),
    "QuasiStatic": ss.QuasiStatic(20, seed=3),
}
SLIDER = ss.Slider(stiffness=2.0, mass=1e-2, damping=15.0)
CHAIN = ss.Chain(blocks=4, coupling=5.0, mass=1e-2, damping=15.0, leaf=8.0)


def interface_with(fields: dict[str, object]) -> ss.Interface:
    """Return an interface with these fields; its contacts have thresholds `TENTH`
    unless areas are given.
    """
    contacts = {} if "areas" in fields else {"thresholds": TENTH}
    return ss.Interface(**contacts, **fields)  # type: ignore[arg-type]
