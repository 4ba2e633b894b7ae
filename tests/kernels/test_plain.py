"""With the compiler off the kernels are plain Python, the readable reference: the same
numbers except for rounding.

`python test_plain.py` prints the results of small cases that together run every kernel.
"""

import json
import math
import os
import subprocess
import sys
from functools import partial

import numpy as np
import pytest

import stickslip as ss
from stickslip.kernels.langevin import Langevin, Life
from stickslip.kernels.langevin_response import excursions, life_transforms
from stickslip.kernels.langevin_steady import pull_newborns, steady_moments

TENTH = ss.Gaussian(mean=1.0, std=0.1)
SLIDER = ss.Slider(stiffness=2.0, mass=1e-3, damping=30.0)
LIGHT = ss.Slider(stiffness=2.0, mass=1e-4, damping=0.0)
THERE_AND_BACK = ss.constant(1.0, 1.6).then(ss.ramp(-1.0, 0.0, 1.0))
BACK = ss.constant(0.5, 0.5).then(ss.constant(-0.5, 0.2))
UNTIL = ss.constant(1.0, 5.0).until(ss.model.Travel(1.0))
UNTIL = UNTIL.then(ss.ramp(1.0, 0.1, 2.0)).until(ss.model.ForceBelow(0.4))
DELAYS = {
    "no delay": ss.Delay(0.0),
    "delay": ss.Delay(0.2),
    "never back": ss.Delay(math.inf),
    "random": ss.RandomDelay(mean=0.2, std=0.12),
}
SNAPSHOTS = ss.Output(interval=0.25, snapshots=(0.5, 1.0), bins=5)


def run(
    interface,
    method,
    slider=SLIDER,
    drive=THERE_AND_BACK,
    output=ss.Output(interval=0.1),
    **options,
):
    rig = ss.Rig(interface, slider, drive)
    made = ss.simulate(rig, method=method, output=output, **options)
    return {str(name): made[name].to_numpy().tolist() for name in made.data_vars}


def rigid(interface, method):
    force = ss.rigid_slide(interface, 2.0, method=method)["friction_force"]
    return force.to_numpy()[::20].tolist()


def element_forces():
    interface = ss.Interface(
        thresholds=TENTH,
        delay=DELAYS["random"],
        sliding_force=0.1,
        newborn=ss.Gaussian(mean=0.1, std=0.1),
    )
    element = ss.Element(interface, ss.Contacts(40, seed=1))
    return [element.step(0.5, x, v) for x, v in ((1.0, 4.0), (1.6, 0.0), (1.0, 2.0))]


def small_cases():
    few = ss.Contacts(12, seed=1)
    coarse = ss.MasterEquation(rtol=1e-2)
    sliding = {"start": ss.FromSliding()}
    at_once = ss.Interface(thresholds=TENTH)
    delayed = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.1))
    ageing = ss.Interface(thresholds=TENTH, ageing=ss.Langevin(rate=1.0))
    growth = ss.Langevin(rate=1.0, newborn=0.2)
    strong = ss.Interface(thresholds=TENTH, ageing=growth, delay=ss.Delay(0.1))
    slow = {"drive": ss.constant(0.5, 0.4)}
    short = ss.constant(1.0, 1.5)
    cases = {}
    for name, delay in DELAYS.items():
        interface = ss.Interface(thresholds=TENTH, delay=delay)
        for method in (few, coarse):
            cases[f"{method}, {name}"] = partial(run, interface, method)
        cases[f"renewal, {name}"] = partial(rigid, interface, ss.model.Renewal(40))
    for method in (few, coarse):
        moving = ss.FromSliding(perturbation=0.1)
        seen = {"drive": short, "output": SNAPSHOTS}
        cases |= {
            f"{method}, undamped": partial(run, delayed, method, LIGHT, short),
            f"{method}, sliding": partial(run, delayed, method, start=moving),
            f"{method}, snapshots": partial(run, delayed, method, **seen),
            f"{method}, until": partial(run, at_once, method, drive=UNTIL),
            f"{method}, rigid": partial(rigid, delayed, method),
            f"{method}, ageing": partial(run, ageing, method, drive=BACK),
        }
    ramp = [(0.5, 1.0), (1.2, 2.0)]
    rise = ss.model.pull(0.0, 3.0, duration=1.0)
    loaded = THERE_AND_BACK.under(ramp)
    free = ss.model.Mass(mass=0.1, damping=0.0)
    damped = ss.model.Mass(mass=0.1, damping=1.0)
    memoryless = ss.MasterEquation(rtol=1e-2, memoryless=True)
    fast = ss.constant(2.0, 0.2)
    cases |= {
        "contacts, a load that changes": partial(run, delayed, few, drive=loaded),
        "contacts, a force, 0.0": partial(run, delayed, few, free, rise),
        "contacts, a force, 1.0": partial(run, delayed, few, damped, rise),
        "memoryless": partial(run, delayed, memoryless),
        "contacts, ageing with a delay": partial(run, strong, few, **slow),
        "contacts, ageing, sliding": partial(run, ageing, few, **slow, **sliding),
        "contacts, ageing, in one place": partial(
            run, ageing, few, drive=ss.constant(0.0, 0.4)
        ),
        "kinetic equation, sliding": partial(
            run, ageing, coarse, drive=fast, **sliding
        ),
        "kinetic equation, a snapshot": partial(run, ageing, coarse, **seen),
    }
    for growth, delay in (
        (ss.ExponentialGrowth(rate=2.0, newborn=0.1), ss.Delay(0.0)),
        (ss.LogarithmicGrowth(slope=0.1, time=0.1), ss.Delay(0.1)),
        (ss.model.TabulatedGrowth((0.1, 0.3, 1.0), (0.5, 1.0, 0.9)), ss.Delay(0.0)),
    ):
        growing = ss.Interface(thresholds=TENTH, ageing=growth, delay=delay)
        cases[f"{growth}, {delay}"] = partial(run, growing, few)
        cases[f"{growth}, {delay}, sliding"] = partial(
            run, growing, few, drive=BACK, **sliding
        )
        cases[f"{growth}, friction"] = partial(ss.kinetic_friction, growing, 0.5)
    return cases | {
        "element": element_forces,
        "steady moments": lambda: [
            steady_moments(Life(u, 0.1, newborn), 8)
            for u in (0.1, 1.5)
            for newborn in (0.0, 0.3)
        ],
        "dynamic stiffness": lambda: [
            [value.real, value.imag]
            for newborn in (0.0, 0.3)
            for value in life_transforms(
                excursions(Life(3.0, 0.3, newborn)),
                np.array([0.3 + 0.5j, 0.005 + 0.001j]),
            ).ravel()
        ],
        "newborns pulled": lambda: pull_newborns(
            3.0, Langevin(rate=1.0, mean=1.0, std=0.1), 1.0, 5
        )[1].tolist(),
    }


def results():
    """Return the results of every case, ready for JSON."""
    return {name: make() for name, make in small_cases().items()}


@pytest.fixture(scope="module")
def compiled_and_plain():
    off = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    how = {"env": off, "capture_output": True, "text": True, "check": True}
    plain = subprocess.run([sys.executable, __file__], **how)
    return results(), json.loads(plain.stdout)


def leaves(value, path=""):
    """Return the arrays of numbers in nested results, by their path."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, f"{path}/{key}")
    else:
        yield path, np.asarray(value, dtype=float)


@pytest.mark.slow
def test_plain_python_gives_the_same_numbers(compiled_and_plain):
    compiled, plain = (dict(leaves(result)) for result in compiled_and_plain)
    assert compiled.keys() == plain.keys()
    for name, values in compiled.items():
        error = {"rtol": 1e-7, "atol": 1e-9, "err_msg": name}
        np.testing.assert_allclose(plain[name], values, **error)


@pytest.mark.slow
def test_the_cases_hold_breaks_and_slips(compiled_and_plain):
    made = compiled_and_plain[0]
    contacts = (made[name] for name in made if "Contacts(" in name)
    runs = [each for each in contacts if "broken_energy" in each]
    assert len(runs) >= 4
    assert all(made["broken_energy"][-1] > 0 for made in runs)


if __name__ == "__main__":
    json.dump(results(), sys.stdout, default=lambda value: np.asarray(value).tolist())
