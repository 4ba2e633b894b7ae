"""Numbers that users have obtained: the same rig and seed must give them again.

The laws of tests/test_laws.py check that a run is right; this file records which of all
right runs it is. Each test keeps a table in tests/data/drawn, a line for each case.
"""

import ast
import importlib
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from drawn import KEPT, assert_kept
from mechanisms import BARRIER, CHAIN, DELAY, MECHANISMS, SLIDER, TENTH, interface_with
from test_laws import DRIVE, PAIRS, run_of

import stickslip as ss

ROUNDING = 1e-7
"""Tolerances far above differences of rounding between processors, far below the
accuracy asked of any solver.
"""
RTOL = {"MasterEquation": 1e-5, "Population": 0.15}
"""Tolerances where rounding decides whether one more step is made, and thus, in a
population, which numbers are drawn.
"""
DELAYED = ss.Interface(thresholds=TENTH, delay=DELAY)
KINDS = {mechanism: interface_with(fields) for mechanism, fields in MECHANISMS.items()}
MORE = {
    "parabolic": {"activation": ss.model.Parabolic(temperature=0.01, attempts=1e6)},
    "Kramers": {"activation": replace(BARRIER, kramers=True)},
    "wide at the beginning": {"initial": ss.Uniform(low=-0.6, high=0.7)},
}
KINDS |= {name: ss.Interface(thresholds=TENTH, **more) for name, more in MORE.items()}


def row(name: str, numbers: Mapping[str, object]) -> str:
    """Write the numbers of a case into a line."""
    said = ", ".join(f"{key} {_said(value)}" for key, value in numbers.items())
    return f"{name}: {said}\n"


def _said(value: object) -> str:
    if isinstance(value, str):
        return value
    return " ".join(f"{each:.9g}" for each in np.atleast_1d(value))


def table(rows: Mapping[str, Mapping[str, object]]) -> str:
    """Write each case into its line."""
    return "".join(row(name, numbers) for name, numbers in rows.items())


def of_run(run: xr.Dataset) -> dict[str, object]:
    """Return the end of a run, and its forces on the way."""
    return {
        "ends at": float(run["displacement"].isel(time=-1).mean()),
        "largest force": float(run["spring_force"].max()),
        "mean friction": float(run["friction_force"].mean()),
        "mean attached": float(run["attached"].mean()),
    }


def _more_runs(method: str) -> dict[str, xr.Dataset]:
    """Runs with other bodies, starts and drives than in the laws."""
    if method not in ("Contacts", "MasterEquation"):
        return {}
    few = ss.Contacts(15, seed=2)
    solver = few if method == "Contacts" else ss.MasterEquation(rtol=1e-2)
    waiting = ss.ramp(0.0, 1.0, 1.0).until(ss.model.ForceAbove(0.2))
    waiting = waiting.then(ss.constant(0.5, 1.0))
    leaves = replace(CHAIN, side=0.5, viscosity=0.05)
    springs = {"coupling": 5.0, "shear": 2.0, "leaf": 8.0}
    sheet = ss.model.Sheet(along=4, across=2, mass=1e-2, damping=15.0, **springs)
    rest = ss.FromRest()
    sliding = ss.FromSliding(perturbation=0.1)
    ring = replace(CHAIN, ends="periodic")
    push = ss.Prestressed(stretching=0.6, push=2.0)
    half = ss.FromSliding(at_rest=2)
    cases = {
        name: (KINDS[name], SLIDER, DRIVE, rest)
        for name in ("wide at the beginning", "parabolic", "Kramers")
    }
    cases |= {
        "from sliding": (DELAYED, SLIDER, DRIVE, sliding),
        "until a force": (DELAYED, SLIDER, waiting, rest),
        "a ring": (DELAYED, ring, DRIVE, sliding),
        "side and leaf springs": (DELAYED, leaves, DRIVE, rest),
        "a bar until a force": (DELAYED, CHAIN, waiting, rest),
        "a push": (DELAYED, CHAIN, ss.constant(0.0, 2.0), push),
        "half at rest": (DELAYED, CHAIN, ss.constant(0.5, 1.0), half),
        "a sheet": (DELAYED, sheet, DRIVE, rest),
    }
    output = ss.Output(interval=0.05)
    found = {}
    for name, (interface, body, drive, start) in cases.items():
        rig = ss.Rig(interface, body, drive, method=solver, start=start, output=output)
        try:
            found[name] = ss.simulate(rig)
        except ss.InputError:
            continue
    return found


METHODS = "Contacts", "MasterEquation", "Population", "QuasiStatic"


@pytest.mark.parametrize("method", METHODS)
def test_runs_are_kept(method):
    runs = {name: run_of(name) for name in PAIRS if name.startswith(method)}
    runs |= _more_runs(method)
    rows = {name.removeprefix(f"{method}, "): of_run(run) for name, run in runs.items()}
    rtol = RTOL.get(method, ROUNDING)
    assert_kept(table(rows), f"runs_{method}", rtol=rtol, atol=1e-12)


def _growth(rig: ss.Rig) -> float | str:
    try:
        return ss.growth_rate(rig).real
    except ss.UndecidedError:
        return "undecided"


def _theory(interface: ss.Interface) -> dict[str, object]:
    rig = ss.Rig(interface, SLIDER, ss.constant(1.0))
    return {
        "friction": ss.kinetic_friction(interface, np.array([0.05, 1.0, 20.0])),
        "slope": ss.stability.friction_slope(interface, 1.0),
        "stiffness at 2i": abs(ss.stability.dynamic_stiffness(interface, 1.0, 2j)),
        "growth": _growth(rig),
    }


@pytest.mark.takes(10)  # computes the theory of all interfaces
def test_steady_sliding_is_kept():
    rows = {}
    for name, interface in KINDS.items():
        try:
            rows[name] = _theory(interface)
        except ss.InputError:
            continue
    assert_kept(table(rows), "steady_sliding", rtol=ROUNDING, atol=1e-12)


@pytest.mark.takes(10)  # and of all distributions
def test_rigid_motion_is_kept(distributions):
    rows = {}
    for name, thresholds in distributions.items():
        interface = ss.Interface(thresholds=thresholds, delay=ss.Delay(0.05))
        rows[name] = {
            "static friction": ss.static_friction(interface),
            "K*": ss.critical_stiffness(interface),
            "friction": ss.kinetic_friction(interface, 1.0),
            "force at 3": float(ss.rigid_slide(interface, 3.0)["friction_force"][-1]),
        }
    assert_kept(table(rows), "rigid_motion", rtol=ROUNDING, atol=1e-12)


def test_bars_are_kept():
    thresholds = ss.Gaussian(mean=1.0, std=0.0)
    never = ss.Interface(thresholds=thresholds, delay=ss.Delay(math.inf))
    body = {"mass": 0.5, "damping": 0.3}
    chain = ss.Chain(blocks=40, coupling=9.0, leaf=0.2, **body)
    rig = ss.Rig(replace(never, sliding_force=0.2), chain, ss.constant(0.5, 1.0))
    pulled = replace(rig, slider=ss.Chain(blocks=12, coupling=4.0, side=4.0, **body))
    smooth = replace(rig, interface=DELAYED)
    speeds = [ss.elastic.front_speed(rig, prestress=each).speed for each in (0.5, 0.8)]
    found = {
        "modes": {"growth": ss.elastic.modes(smooth, count=6)["growth"].to_numpy()},
        "lengths": {"screening": ss.elastic.screening_length(rig)},
        "front": {"threshold": ss.elastic.front_threshold(rig), "speeds": speeds},
        "precursor": {"forces": ss.elastic.precursor_force(pulled).to_numpy()[:4]},
    }
    assert_kept(table(found), "bars", rtol=ROUNDING, atol=1e-12)


def _made_up_forces() -> dict[str, np.ndarray]:
    """Forces every .1 s that slip, oscillate, or do neither."""
    rng = np.random.default_rng(7)
    t = np.arange(4000)
    noise = 0.02 * rng.normal(size=t.size)
    walk = 0.05 * np.cumsum(rng.normal(size=t.size))
    saw = (t % 200) / 200.0
    sine = np.sin(0.06 * t)
    return {
        "slips": 5.0 + saw + noise,
        "one slip": 5.0 + ((t + 1000) % 3000) / 1000.0 + noise,
        "slips that shrink": 5.0 + saw * np.exp(-t / 1000.0) + noise,
        "slips backwards": -5.0 - saw + noise,
        "oscillation": 5.0 + 0.3 * sine + noise,
        "oscillation that grows": 5.0 + 0.3 * sine * np.exp(t / 1000.0) + noise,
        "slow drift": 5.0 + t / 1000.0 + noise,
        "slow fall": 9.0 - t / 1000.0 + noise,
        "half a period": 5.0 + np.sin(t / 1500.0) + noise,
        "noise": 5.0 + noise,
        "constant": np.full(t.size, 5.0),
        "random walk": 20.0 + walk,
        "in steps of .1": np.round(5.0 + saw + noise, 1),
    }


def _measured(data: xr.Dataset) -> dict[str, object]:
    drops = ss.drops(data)
    mean = float(drops["drop"].mean()) if drops.sizes["event"] else 0.0
    return {"regime": ss.regime(data).kind, "drops": drops.sizes["event"], "mean": mean}


def test_what_is_measured_is_kept():
    rows = {}
    for name, force in _made_up_forces().items():
        time = ("time", 0.1 * np.arange(force.size), {"units": "s"})
        variables = {"spring_force": ("time", force, {"units": "N"})}
        rows[name] = _measured(xr.Dataset(variables, {"time": time}))
    sliders = {
        "heavy": ss.Slider(stiffness=0.5, mass=0.05, damping=1.0),
        "light": ss.Slider(stiffness=0.2, mass=1e-4, damping=5.0),
    }
    for delay in (0.0, 0.2):
        for name, slider in sliders.items():
            interface = ss.Interface(thresholds=TENTH, delay=ss.Delay(delay))
            rig = ss.Rig(interface, slider, ss.constant(0.5, 30.0))
            output = ss.Output(interval=0.01)
            run = ss.simulate(rig, method=ss.Contacts(300, seed=1), output=output)
            rows[f"a run, delay {delay}, {name}"] = _measured(run)
    assert_kept(table(rows), "measured", rtol=ROUNDING, atol=1e-12)


# ---------------------------------------------------------------- every kept file


KEEPERS = ("assert_kept", "assert_drawn")


def _words_of(test: ast.FunctionDef, module: object) -> set[str]:
    """Texts that may form the name of a kept file, in the body of its test."""
    constants = (node for node in ast.walk(test) if isinstance(node, ast.Constant))
    words = {node.value for node in constants if isinstance(node.value, str)}
    for mark in getattr(getattr(module, test.name), "pytestmark", ()):
        if mark.name == "parametrize":
            values = (getattr(each, "values", (each,)) for each in mark.args[1])
            words |= {word for row in values for word in row if isinstance(word, str)}
    return words | {word.replace(",", "").replace(" ", "_") for word in words}


def _names_asked(file: Path) -> Iterator[str]:
    """Patterns of the names of kept files that the tests of a file use."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for test in (node for node in tree.body if isinstance(node, ast.FunctionDef)):
        calls = (node for node in ast.walk(test) if isinstance(node, ast.Call))
        asks = [
            call.args[1] for call in calls if getattr(call.func, "id", "") in KEEPERS
        ]
        if not asks:
            continue
        words = _words_of(test, importlib.import_module(file.stem))
        any_word = "|".join(map(re.escape, words))
        for name in asks:
            parts = name.values if isinstance(name, ast.JoinedStr) else [name]
            known = (isinstance(part, ast.Constant) for part in parts)
            yield "".join(
                re.escape(part.value) if is_text else f"({any_word})"
                for part, is_text in zip(parts, known, strict=True)
            )


def test_each_kept_file_is_asked_for_by_a_test():
    files = sorted(Path(__file__).parent.glob("test_*.py"))
    asked = "|".join(pattern for file in files for pattern in _names_asked(file))
    kept = sorted(KEPT.iterdir())
    orphans = [file.name for file in kept if not re.fullmatch(asked, file.stem)]
    assert orphans == []
