"""Small rigs of every mechanism, method and body, which tests and pages go through.

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
STRETCHED = ss.Uniform(low=-0.1, high=0.3)

MECHANISMS: dict[str, dict[str, object]] = {
    "none": {},
    "delay": {"delay": DELAY},
    "random delay": {"delay": ss.RandomDelay(mean=0.2, std=0.12)},
    "never back": {"delay": ss.Delay(math.inf)},
    "on arrest": {"delay": ss.OnArrest()},
    "sliding force": {"delay": DELAY, "sliding_force": 0.3},
    "newborns": {"delay": DELAY, "newborn": STRETCHED},
    "track": {"delay": DELAY, "track_scatter": 0.2},
    "Bell": {"temperature": BELL},
    "Bell, delay, sliding force": {
        "temperature": BELL,
        "delay": DELAY,
        "sliding_force": 0.3,
    },
    "Bell, newborns": {"temperature": BELL, "newborn": STRETCHED},
    "Bell, on arrest": {"temperature": BELL, "delay": ss.OnArrest()},
    "Bell, track": {"temperature": BELL, "delay": DELAY, "track_scatter": 0.2},
    "barrier": {"temperature": BARRIER},
    "logarithmic growth": {"ageing": LOGARITHMIC},
    "logarithmic growth, sliding force": {
        "ageing": LOGARITHMIC,
        "delay": DELAY,
        "sliding_force": 0.3,
    },
    "logarithmic growth, newborns": {"ageing": LOGARITHMIC, "newborn": STRETCHED},
    "exponential growth, delay": {"ageing": EXPONENTIAL, "delay": DELAY},
    "Bell, logarithmic growth": {"temperature": BELL, "ageing": LOGARITHMIC},
    "barrier, exponential growth": {"temperature": BARRIER, "ageing": EXPONENTIAL},
    "Langevin": {"ageing": LANGEVIN},
    "Langevin, delay": {"ageing": LANGEVIN, "delay": DELAY},
    "Bell, Langevin": {"temperature": BELL, "ageing": LANGEVIN},
    "logarithmic growth, on arrest": {
        "ageing": LOGARITHMIC,
        "delay": ss.OnArrest(),
        "track_scatter": 0.2,
    },
    "barrier, exponential growth, newborns": {
        "temperature": BARRIER,
        "ageing": EXPONENTIAL,
        "newborn": STRETCHED,
    },
    "barrier, on arrest, sliding force": {
        "temperature": BARRIER,
        "delay": ss.OnArrest(),
        "sliding_force": 0.3,
    },
    "growth from nothing": {"ageing": ss.ExponentialGrowth(rate=2.0)},
    "areas": {"areas": "site"},
    "areas, sliding force": {"areas": "fresh", "delay": DELAY, "sliding_force": 0.3},
    "areas, logarithmic growth, newborns": {
        "areas": "site",
        "ageing": LOGARITHMIC,
        "delay": DELAY,
        "newborn": STRETCHED,
    },
    "areas, barrier": {
        "areas": "site",
        "temperature": BARRIER,
        "delay": DELAY,
        "track_scatter": 0.2,
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
