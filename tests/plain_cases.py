"""Small cases that between them go through every kernel: run compiled and as plain Python, they must agree.

`python plain_cases.py` prints all results as JSON; tests/test_plain.py runs it with the compiler on and off.
"""

import json
import math
import sys
from collections.abc import Callable
from functools import partial

import numpy as np

import stickslip as ss

TENTH = ss.Gaussian(mean=1.0, std=0.1)
SLIDER = ss.Slider(stiffness=2.0, mass=1e-3, damping=30.0)
LIGHT = ss.Slider(stiffness=2.0, mass=1e-4, damping=0.0)
THERE_AND_BACK = ss.constant(1.0, 1.6).then(ss.ramp(-1.0, 0.0, 1.0))
DELAYS = {
    "no delay": ss.Delay(0.0),
    "delay": ss.Delay(0.2),
    "never back": ss.Delay(math.inf),
    "random": ss.RandomDelay(mean=0.2, std=0.12),
}


def _run(interface, method, slider=SLIDER, drive=THERE_AND_BACK, **options):
    run = ss.simulate(ss.Rig(interface, slider, drive), method=method, output=ss.Output(interval=0.1), **options)
    return {str(name): run[name].to_numpy().tolist() for name in run.data_vars}


def _snapshots(interface, method):
    output = ss.Output(interval=0.25, snapshots=(0.5, 1.0), bins=5)
    run = ss.simulate(ss.Rig(interface, SLIDER, ss.constant(1.0, 1.5)), method=method, output=output)
    return run["stretching_density"].to_numpy().tolist()


def _until(method):
    drive = (
        ss.constant(1.0, 5.0).until(ss.model.Travel(1.0)).then(ss.ramp(1.0, 0.1, 2.0)).until(ss.model.ForceBelow(0.3))
    )
    return _run(ss.Interface(thresholds=TENTH), method, drive=drive)


def _rigid(interface, method):
    return ss.rigid_slide(interface, 2.0, method=method)["friction_force"].to_numpy()[::20].tolist()


def small_cases() -> dict[str, Callable[[], object]]:
    few, coarse = ss.Contacts(12, seed=1), ss.MasterEquation(rtol=1e-2)
    cases: dict[str, Callable[[], object]] = {}
    for name, delay in DELAYS.items():
        interface = ss.Interface(thresholds=TENTH, delay=delay)
        for method in (few, coarse):
            cases[f"{method}, {name}"] = partial(_run, interface, method)
        cases[f"renewal, {name}"] = partial(_rigid, interface, ss.model.Renewal(40))
    delayed = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.1))
    ageing = ss.Interface(thresholds=TENTH, ageing=ss.Langevin(rate=1.0))
    strong = ss.Interface(thresholds=TENTH, ageing=ss.Langevin(rate=1.0, newborn=0.2), delay=ss.Delay(0.1))
    back = ss.constant(0.5, 0.5).then(ss.constant(-0.5, 0.2))
    for method in (few, coarse):
        cases[f"{method}, undamped"] = partial(_run, delayed, method, LIGHT, ss.constant(1.0, 1.5))
        cases[f"{method}, sliding"] = partial(_run, delayed, method, start=ss.FromSliding(perturbation=0.1))
        cases[f"{method}, snapshots"] = partial(_snapshots, delayed, method)
        cases[f"{method}, until"] = partial(_until, method)
        cases[f"{method}, rigid"] = partial(_rigid, delayed, method)
        cases[f"{method}, ageing"] = partial(_run, ageing, method, drive=back)
    cases["memoryless"] = partial(_run, delayed, ss.MasterEquation(rtol=1e-2, memoryless=True))
    cases["contacts, ageing with a delay"] = partial(_run, strong, few, drive=ss.constant(0.5, 0.4))
    cases["contacts, ageing, sliding"] = partial(_run, ageing, few, drive=ss.constant(0.5, 0.4), start=ss.FromSliding())
    cases["contacts, ageing, in one place"] = partial(_run, ageing, few, drive=ss.constant(0.0, 0.4))
    cases["kinetic equation, sliding"] = partial(
        _run, ageing, coarse, drive=ss.constant(2.0, 0.2), start=ss.FromSliding()
    )
    cases["kinetic equation, a snapshot"] = partial(_snapshots, ageing, coarse)
    for growth, delay in (
        (ss.ExponentialGrowth(rate=2.0, newborn=0.1), ss.Delay(0.0)),
        (ss.LogarithmicGrowth(slope=0.1, time=0.1), ss.Delay(0.1)),
    ):
        growing = ss.Interface(thresholds=TENTH, ageing=growth, delay=delay)
        cases[f"{growth}, {delay}"] = partial(_run, growing, few, drive=THERE_AND_BACK)
        cases[f"{growth}, {delay}, sliding"] = partial(_run, growing, few, drive=back, start=ss.FromSliding())
        cases[f"{growth}, friction"] = lambda i=growing: float(ss.kinetic_friction(i, 0.5))
    return cases | _numbers()


def _numbers() -> dict[str, Callable[[], object]]:
    """Kernels of ageing contacts that give numbers, coarsely."""
    from stickslip.kernels.langevin import Langevin, Life
    from stickslip.kernels.langevin_response import excursions, life_transforms
    from stickslip.kernels.langevin_steady import pull_newborns, steady_moments

    tenth = Langevin(rate=1.0, mean=1.0, std=0.1)

    p = np.array([0.3 + 0.5j, 0.005 + 0.001j])
    return {
        "steady moments": lambda: [
            steady_moments(Life(u, 0.1, newborn), 8) for u in (0.1, 1.5) for newborn in (0.0, 0.3)
        ],
        "dynamic stiffness": lambda: [
            [value.real, value.imag]
            for newborn in (0.0, 0.3)
            for value in life_transforms(excursions(Life(3.0, 0.3, newborn)), p).ravel()
        ],
        "newborns pulled": lambda: pull_newborns(3.0, tenth, 1.0, 5)[1].tolist(),
    }


def results() -> dict[str, object]:
    """Return what every case gives."""
    return {name: make() for name, make in small_cases().items()}


if __name__ == "__main__":
    json.dump(results(), sys.stdout, default=lambda value: np.asarray(value).tolist())
