"""Numbers that users have had: the same rig and seed give them again, and who changes one is told.

What a case gives is kept in tests/data/kept.json: of every array its largest value and three sums that weigh each of
its places otherwise. ``REDRAW=1`` in the environment writes what is found now: say in CHANGELOG.md why numbers change.
"""

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from plain_cases import DELAYS, LIGHT, SLIDER, TENTH, THERE_AND_BACK, small_cases

import stickslip as ss
from stickslip.fitting.summary import covariance
from stickslip.fitting.synthetic import synthetic_trace
from stickslip.simulation import check_method, estimate

KEPT = Path(__file__).parent / "data" / "kept.json"
NUMBERS = (int, float, complex, np.number)
RTOL = 1e-7
"""Far above what another processor rounds otherwise, far below what any solver is asked for."""
LESS = {
    "run: thresholds": 1e-6,
    "small: memoryless": 1e-6,
    "a step read": 1e-2,
    "rate and state": 1e-4,
    "light slider": 5e-3,
    "again at the arrest": 5e-3,
    "cycles": 5e-3,
    "followed": 1e-2,
    "population": 0.15,
}
"""Where rounding alone decides whether one step more is made, and with it, in a population, which numbers are drawn."""

# ---------------------------------------------------------------------------------------------------------------------
# What is kept
# ---------------------------------------------------------------------------------------------------------------------


def told(value: Any) -> dict[str, Any]:
    """Describe a result: words as they are, numbers by how many, the largest and three weighted sums."""
    return {path.lstrip("/"): _of_leaf(leaf) for path, leaf in _leaves(value, "")}


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, xr.Dataset):
        value = {str(name): value[name].to_numpy() for name in value.variables}
    elif is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    elif isinstance(value, (list, tuple)) and not all(isinstance(item, NUMBERS) for item in value):
        value = dict(enumerate(value))
    if not isinstance(value, Mapping):
        yield path, value
        return
    for key, item in value.items():
        yield from _leaves(item, f"{path}/{key}")


def _of_leaf(leaf: Any) -> Any:
    if leaf is None or isinstance(leaf, (str, bool)):
        return leaf
    values = np.asarray(leaf).ravel()
    if values.dtype.kind not in "biufc":
        return " ".join(map(str, values[:5]))
    values = np.concatenate([values.real, values.imag]) if values.dtype.kind == "c" else values.astype(float)
    finite = np.isfinite(values)
    numbers, places = np.where(finite, values, 0.0), np.arange(values.size)
    largest = float(np.abs(numbers).max(initial=0.0))
    numbers /= max(values.size, 1) * (largest or 1.0)
    sums = [float(np.sum(numbers * np.cos(k * places))) for k in (0.0, 1.0, 2.4)]
    return [int(finite.sum()), float(f"{largest:.9g}"), *(round(each, 9) for each in sums)]


def assert_told(now: Any, before: Any, where: str) -> None:
    """Compare two descriptions; numbers below 1e-14 of the natural unit are rounding."""
    rtol = next((less for name, less in LESS.items() if where.startswith(name)), RTOL)
    assert now.keys() == before.keys(), where
    for name, new in now.items():
        old = before[name]
        same = new == old
        if isinstance(new, list) and not same:
            same = new[0] == old[0] and math.isclose(new[1], old[1], rel_tol=rtol, abs_tol=1e-14)
            same = same and (new[1] < 1e-14 or np.allclose(new[2:], old[2:], rtol=0.0, atol=rtol))
        assert same, f"{where}, {name}: {new}, was {old}"


# ---------------------------------------------------------------------------------------------------------------------
# The cases
# ---------------------------------------------------------------------------------------------------------------------

DISTRIBUTIONS = {
    "uniform": ss.Uniform(low=0.5, high=1.5),
    "exponential": ss.Exponential(mean=1.0),
    "Weibull": ss.Weibull(scale=1.1, shape=2.5),
    "gamma": ss.Gamma(mean=1.0, std=0.3),
    "log-normal": ss.LogNormal(mean=1.0, std=0.3),
    "empirical": ss.Empirical(edges=(0.5, 0.9, 1.1, 1.6), weights=(0.2, 1.0, 0.3)),
}
BELL = ss.Bell(width=0.01, attempts=1e6)
ACTIVATIONS = {
    "Bell": BELL,
    "Bell, hot": ss.Bell(width=0.1, attempts=30.0),
    "parabolic": ss.Parabolic(temperature=0.01, attempts=1e6),
    "barrier": ss.Barrier(height=100.0, attempts=1e6),
    "Kramers": ss.Barrier(height=60.0, attempts=1e6, kramers=True),
}
GROWTHS = {
    "for ever the same": None,
    "exponential growth": ss.ExponentialGrowth(rate=2.0, newborn=0.1),
    "logarithmic growth": ss.LogarithmicGrowth(slope=0.1, time=0.1),
}
STEP = {"at": 0.0, "before": 1.0, "after": 5.0}
DELAYED = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.1))
WARM = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.3), temperature=BELL)
WARM_AGEING = ss.Interface(
    thresholds=ss.Gaussian(mean=1.0, std=0.3), temperature=BELL, ageing=ss.LogarithmicGrowth(slope=0.02, time=1e-3)
)
BAR = ss.Chain(blocks=12, coupling=4.0, mass=0.5, damping=0.3, side=4.0, viscosity=0.05)
LEAVES = replace(BAR, side=0.0, leaf=0.5)
SHEET = ss.Sheet(along=6, across=3, coupling=4.0, shear=1.5, mass=0.5, damping=0.3, leaf=0.2)


def _work(rig):
    parts = estimate(rig).parts
    return {"seconds": tuple(part.seconds for part in parts), "bytes": tuple(part.bytes for part in parts)}


def _run(interface, method, slider=SLIDER, drive=THERE_AND_BACK, interval=0.05, **options):
    output = ss.Output(interval=interval)
    rig = ss.Rig(interface, slider, drive, method=method, output=output, **options)
    return {"run": ss.simulate(rig, long=True), "estimate": _work(rig)}


def _solvers(interface, slider=SLIDER, drive=THERE_AND_BACK, solvers=None, **options):
    solvers = solvers or (ss.Contacts(60, seed=3), ss.MasterEquation(rtol=1e-3))
    return [_run(interface, method, slider, drive, **options) for method in solvers]


def _of_langevin(interface):
    s = np.concatenate([[1j * 10.0**power for power in range(-6, 7)], [0.3 + 0.5j]])
    v = (0.02, 0.5, 10.0)
    rig = ss.Rig(interface, ss.Slider(stiffness=0.3, mass=0.1, damping=0.5), ss.constant(0.5))
    stiffness = [ss.stability.dynamic_stiffness(interface, each, s) for each in v]
    return {
        "friction": ss.kinetic_friction(interface, np.array(v)),
        "stiffness": stiffness,
        "critical": ss.critical(rig, "stiffness", between=(0.05, 2.0)),
    }


def _mode(rig):
    try:
        return ss.growth_rate(rig)
    except ss.UndecidedError as why:
        return str(why)


def _theory(interface, slider=SLIDER):
    """All that is said of an interface without a run."""
    v = np.array([0.05, 1.0, 20.0])
    said = {"friction": ss.kinetic_friction(interface, v), "slope": ss.friction_slope(interface, v)}
    said["modes"] = [_mode(ss.Rig(interface, slider, ss.constant(each))) for each in (0.3, 2.0)]
    said["stiffness"] = ss.stability.dynamic_stiffness(interface, 1.0, np.array([0.3 + 0.5j, 2.0j, 0.01 + 40.0j]))
    said["turning"] = [(each.velocity, each.kind) for each in ss.turning_velocities(interface, between=(0.01, 100.0))]
    if interface.temperature is None and interface.ageing is None:
        said["K*"], said["static"] = ss.critical_stiffness(interface), ss.static_friction(interface)
        said["rigid"] = ss.rigid_slide(interface, 3.0)["friction_force"]
    return said


def _passing(interface, method, body):
    """A bar or a sheet that is pulled until it slips: the run, its fronts and its events."""
    found = _run(interface, method, body, ss.constant(0.2, 6.0), interval=0.25)
    if not isinstance(method, ss.QuasiStatic):
        found |= {"fronts": ss.fronts(found["run"]), "events": ss.events(found["run"])}
    return found


def _measured(delay, slider, drive):
    """A run that slips, and what is measured of it."""
    rig = ss.Rig(ss.Interface(thresholds=TENTH, delay=ss.Delay(delay)), slider, drive)
    run = ss.simulate(rig, method=ss.Contacts(300, seed=1), output=ss.Output(interval=0.01))
    return {"regime": ss.regime(run), "drops": ss.drops(run)}


def _traces() -> Iterator[tuple[str, np.ndarray]]:
    """Forces every .1 s, that slip, oscillate, or do neither."""
    rng, t = np.random.default_rng(7), np.arange(4000)
    noise, walk = 0.02 * rng.normal(size=t.size), 0.05 * np.cumsum(rng.normal(size=t.size))
    saw, sine = (t % 200) / 200.0, np.sin(0.06 * t)
    yield "slips", 5.0 + saw + noise
    yield "one slip", 5.0 + ((t + 1000) % 3000) / 1000.0 + noise
    yield "slips that shrink", 5.0 + saw * np.exp(-t / 1000.0) + noise
    yield "slips backwards", -5.0 - saw + noise
    yield "oscillation", 5.0 + 0.3 * sine + noise
    yield "oscillation that grows", 5.0 + 0.3 * sine * np.exp(t / 1000.0) + noise
    yield "slow drift", 5.0 + t / 1000.0 + noise
    yield "slow fall", 9.0 - t / 1000.0 + noise
    yield "half a period", 5.0 + np.sin(t / 1500.0) + noise
    yield "noise", 5.0 + noise
    yield "constant", np.full(t.size, 5.0)
    yield "random walk", 20.0 + walk
    yield "in steps of .1", np.round(5.0 + saw + noise, 1)


def _read(force):
    time = ("time", 0.1 * np.arange(force.size), {"units": "s"})
    trace = xr.Dataset({"spring_force": ("time", force, {"units": "N"})}, coords={"time": time})
    return {"regime": ss.regime(trace), "drops": ss.drops(trace)}


def _stepped(interface, method):
    return ss.velocity_step(interface, before=1.0, after=5.0, distance=4.0, points=300, method=method)


def _as_rate_and_state(interface):
    run = ss.velocity_step(interface, before=1.0, after=5.0, distance=4.0, points=300)
    fits = [ss.fit_rate_and_state(run, law=law, **STEP) for law in ("ageing", "slip")]
    return [*fits, ss.rate_and_state(interface, 1.0), ss.rate_and_state(interface, 3.0, step=None, law="ageing")]


def _read_as_contacts():
    run = ss.velocity_step(WARM_AGEING, before=1.0, after=5.0, distance=4.0, points=200)
    return ss.rate_state.fit_contacts(run, linear=True, thresholds=TENTH, **STEP)


def _quick():
    known = {"static_friction": 30.0, "kinetic_friction": 25.0, "stiffness": 5e5, "speed": 1e-3, "mass": "0.1 kg"}
    rig = ss.quick_fit(**known, loading_rate=350.0, half_speed=2e-4)
    return {"rig": rig, "strength": rig.unit("f_s"), "x_s": rig.unit("x_s")}


def _held(interface, method):
    return ss.slide_hold_slide(interface, velocity=1.0, holds=(0.1, 1.0, 10.0), stiffness=20.0, method=method)


def _estimates():
    """Costs of runs that are not made: of every method, on contacts of every kind, for light and heavy sliders."""
    langevin = ss.Interface(thresholds=TENTH, ageing=ss.Langevin(rate=1.0))
    wide = ss.Interface(thresholds=ss.Uniform(low=1.0, high=3.0), delay=ss.Delay(0.3))
    contacts = [langevin, wide, *dict(_by_heat()).values()]
    methods = [ss.Contacts(300), ss.MasterEquation(rtol=1e-3), ss.Population(10**6), ss.PaperClosure(cells=100)]
    sliders = [LIGHT, ss.Slider(stiffness=0.1, mass=3.0, damping=0.2)]
    starts, drive = (ss.FromRest(), ss.FromSliding(perturbation=0.3)), ss.ramp(0.5, 2.0, 30.0)
    rigs = [
        ss.Rig(interface, slider, drive, method=method, start=start, output=ss.Output(interval=0.1, snapshots=(3.0,)))
        for interface in contacts
        for slider in sliders
        for method in methods
        for start in starts
    ]
    bodies = [
        ss.Rig(replace(wide, delay=ss.Delay(0.1)), body, drive, method=method, output=ss.Output(interval=0.1))
        for body in (BAR, SHEET, LEAVES)
        for method in methods[:2]
    ]
    return [_work(rig) for rig in (*rigs, *bodies) if _has_solver(rig)]


def _has_solver(rig):
    try:
        check_method(rig.interface, rig.method, rig.slider)
    except ss.InputError:
        return False
    return True


def _of_example(name):
    rig = ss.example(name)
    return {"estimate": _work(rig), "load": rig}


def _cycles(delay, slider):
    rig = ss.Rig(ss.Interface(thresholds=TENTH, delay=ss.Delay(delay)), slider, ss.constant(1.0))
    found = ss.is_sustained(rig)
    return {
        "sustained": (found.kind, (found.peak_to_peak, found.period) if found.sustained else ()),
        "critical": ss.critical(rig, "velocity", between=(0.4, 2.0)),
        "estimate": _work(replace(rig, drive=ss.constant(1.0, 9.0))),
    }


def _followed(delay, slider):
    rig = ss.Rig(ss.Interface(thresholds=TENTH, delay=ss.Delay(delay)), slider, ss.constant(1.0))
    return ss.cycle_branch(rig, "velocity", between=(0.7, 1.3), step=0.2)


def _measured_trace(**truth):
    trace = synthetic_trace(slips=60, **truth)
    return {"drops": ss.drops(trace), "regime": ss.regime(trace)}


def _fitted():
    trace = synthetic_trace(slips=80, seed=1)
    prior = ss.fitting.Prior(contacts=(8.0, 50.0), threshold_std=(0.05, 0.5), stiffness_ratio=(0.01, 0.3))
    fit = ss.fit(trace, known={"stiffness": (100.0, 5.0), "speed": 0.005}, prior=prior, draws=1500)
    found = {each.key: (each.low, each.median, each.high) for each in (*fit.parameters, *fit.quantities)}
    found["mass"] = fit.rig(name="bench").natural.slider
    return found | {"p": fit.p_values, "values": fit.values, "strength": fit.strength, "predicted": fit.predicted}


def _errors_of_a_fit():
    """What a series resampled in blocks says of its own errors; of many blocks and of less than one."""
    force = np.random.default_rng(5).uniform(0.5, 1.0, (2, 64))
    return [covariance(force[0, :count] + 0.5, force[1, :count], seed=2) for count in (7, 64)]


def _of_a_bar():
    interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.0), delay=ss.Delay(math.inf), sliding_force=0.2)
    rig = ss.Rig(interface, ss.Chain(blocks=40, coupling=9.0, mass=0.5, damping=0.3, leaf=0.2), ss.constant(0.5, 1.0))
    pulled = ss.Rig(interface, BAR, ss.constant(0.01, 1.0))
    return {
        "modes": ss.modes(replace(rig, interface=DELAYED), count=6),
        "length": ss.critical_length(replace(rig, interface=DELAYED)),
        "screening": ss.screening_length(rig),
        "threshold": ss.front_threshold(rig),
        "fronts": [ss.front_speed(rig, prestress=each) for each in (0.45, 0.5, 0.8)],
        "waves": [ss.front_speed(rig, prestress=each, blocks="continuum") for each in (0.3, 0.45, 0.5, 0.8)],
        "precursors": ss.precursor_force(pulled),
    }


def _stability_map():
    rig = ss.Rig(DELAYED, SLIDER, ss.constant(1.0))
    values = (np.geomspace(0.1, 10.0, 5), np.geomspace(0.1, 10.0, 4))
    return ss.stability_map(rig, over=("velocity", "stiffness"), values=values)


def _at_every_interface() -> Iterator[tuple[str, ss.Interface]]:
    for name, thresholds in DISTRIBUTIONS.items():
        yield f"thresholds {name}", ss.Interface(thresholds=thresholds, delay=ss.Delay(0.05))
    yield "random delays", ss.Interface(thresholds=TENTH, delay=ss.RandomDelay(mean=0.2, std=0.12))
    yield "sliding force", ss.Interface(thresholds=TENTH, delay=ss.Delay(0.3), sliding_force=0.4)
    yield "newborn stretched", ss.Interface(thresholds=TENTH, newborn=ss.Gaussian(mean=0.1, std=0.0))
    yield "wide at the beginning", ss.Interface(thresholds=TENTH, initial=ss.Uniform(low=-0.6, high=0.7))


def _by_heat() -> Iterator[tuple[str, ss.Interface]]:
    for name, temperature in ACTIVATIONS.items():
        for how, growth in GROWTHS.items():
            if growth is None or name in ("Bell", "Bell, hot"):
                for delay in (0.0, 0.1):
                    delays = ss.Delay(delay)
                    yield (
                        f"{name}, {how}, delay {delay}",
                        ss.Interface(thresholds=TENTH, temperature=temperature, ageing=growth, delay=delays),
                    )


def _interfaces() -> Iterator[tuple[str, Callable[[], object]]]:
    for name, interface in _at_every_interface():
        yield f"run: {name}", partial(_solvers, interface)
        yield f"theory: {name}", partial(_theory, interface)
    for name, growth in GROWTHS.items():
        if growth is not None:
            growing = ss.Interface(thresholds=TENTH, ageing=growth, delay=ss.Delay(0.05))
            yield f"theory: {name}", partial(_theory, growing)
            yield f"run: {name}", partial(_solvers, growing, solvers=(ss.Contacts(60, seed=3),))
    for name in ("no delay", "delay", "random"):
        contacts = ss.Interface(thresholds=TENTH, delay=DELAYS[name])
        yield f"light slider: {name}", partial(_solvers, contacts, LIGHT)
        population = ss.Population(2_000, seed=5)
        yield f"population: {name}", partial(_run, contacts, population, drive=ss.constant(1.0, 2.0))
    yield "again at the arrest", partial(_solvers, ss.Interface(thresholds=TENTH, delay=ss.OnArrest()), LIGHT)


def _langevin() -> Iterator[tuple[str, Callable[[], object]]]:
    for newborn in (0.0, 0.3):
        ageing = ss.Interface(thresholds=TENTH, ageing=ss.Langevin(rate=1.0, newborn=newborn))
        delayed = replace(ageing, delay=ss.Delay(0.05 if newborn else 0.0))
        for velocity in (0.05, 0.5, 5.0, -5.0):
            contacts = partial(_run, ageing, ss.Contacts(100, seed=2), drive=ss.constant(velocity, 1.0))
            yield f"Langevin, newborn {newborn}, at {velocity}", contacts
        yield f"Langevin, newborn {newborn}, theory", partial(_of_langevin, delayed)


def _heat() -> Iterator[tuple[str, Callable[[], object]]]:
    for name, interface in _by_heat():
        slow = 10.0 if isinstance(interface.ageing, ss.ExponentialGrowth) else 1.0  # to solve
        back = ss.constant(1.0, 1.5 / slow).then(ss.ramp(1.0, -0.5, 0.5 / slow))
        yield f"run: {name}", partial(_solvers, interface, drive=back)
        begun = ss.FromSliding(perturbation=0.05)
        yield f"run, sliding: {name}", partial(_solvers, interface, LIGHT, ss.constant(1.0, 2.0 / slow), start=begun)
        if interface.delay.mean > 0 and not isinstance(interface.ageing, ss.ExponentialGrowth):
            yield f"theory: {name}", partial(_theory, interface)
    for name, interface in (("heat", WARM), ("heat and ageing", WARM_AGEING)):
        for method in (ss.Contacts(500, seed=1), ss.MasterEquation(rtol=1e-4)):
            yield f"velocity step: {name}, {method}", partial(_stepped, interface, method)
            yield f"holds: {name}, {method}", partial(_held, interface, method)
        yield f"rate and state: {name}", partial(_as_rate_and_state, interface)
    yield "a step read as contacts", _read_as_contacts


def _bodies() -> Iterator[tuple[str, Callable[[], object]]]:
    never = ss.Interface(thresholds=TENTH, delay=DELAYS["never back"], sliding_force=0.2)
    pushed, sliding = ss.Prestressed(stretching=0.6, push=2.0), ss.FromSliding(perturbation=0.1)
    for solver in (ss.Contacts(15, seed=2), ss.MasterEquation(rtol=1e-2)):
        who = type(solver).__name__
        for name in ("no delay", "delay", "random"):
            interface = ss.Interface(thresholds=TENTH, delay=DELAYS[name])
            for body, kind in ((BAR, "bar"), (SHEET, "sheet")):
                yield f"{kind}, {name}, {who}", partial(_passing, interface, solver, body)
        for name, body in (("leaf springs", LEAVES), ("a ring", replace(LEAVES, ends="periodic"))):
            yield f"{name}, turning, {who}", partial(_run, DELAYED, solver, body, THERE_AND_BACK, start=sliding)
        until = ss.constant(0.2, 6.0).until(ss.ForceAbove(0.2)).then(ss.constant(0.1, 1.0))
        yield f"a bar until a force, {who}", partial(_run, DELAYED, solver, BAR, until)
        yield f"a push, {who}", partial(_run, never, solver, LEAVES, ss.constant(0.0, 4.0), start=pushed)
    half = ss.FromSliding(at_rest=6)
    yield "a bar, half at rest", partial(_run, DELAYED, ss.Contacts(15, seed=2), BAR, ss.constant(0.5, 1.0), start=half)
    yield "bar, slowly", partial(_passing, ss.Interface(thresholds=TENTH), ss.QuasiStatic(15, seed=2), BAR)
    yield "theory of a bar", _of_a_bar


def _answers() -> Iterator[tuple[str, Callable[[], object]]]:
    fast, slow = ss.Slider(stiffness=0.5, mass=0.05, damping=1.0), ss.Slider(stiffness=0.2, mass=1e-4, damping=5.0)
    for delay in (0.0, 0.2):
        for slider in (fast, slow):
            yield f"measured: {delay}, {slider}", partial(_measured, delay, slider, ss.constant(0.5, 30.0))
            yield f"cycles: {delay}, {slider}", partial(_cycles, delay, slider)
    for name, force in _traces():
        yield f"read: {name}", partial(_read, force)
    yield "measured: a slow ramp", partial(_measured, 0.2, fast, ss.ramp(0.1, 3.0, 20.0))
    yield "followed", partial(_followed, 0.3, fast)
    for seed, truth in enumerate(({}, {"track_scatter": 0.02, "threshold_std": 0.1, "contacts": 100.0})):
        yield f"trace: {truth}", partial(_measured_trace, seed=seed, **truth)
    yield "fit", _fitted
    yield "errors of a fit", _errors_of_a_fit
    yield "quick fit", _quick
    yield "estimates", _estimates
    yield "a map of stability", _stability_map
    for example in ss.example_names():
        yield f"example: {example}", partial(_of_example, example)


SMALL = {f"small: {name}": make for name, make in small_cases().items()}
CASES = SMALL | dict(_interfaces()) | dict(_langevin()) | dict(_heat()) | dict(_bodies()) | dict(_answers())


@pytest.mark.parametrize("name", CASES)
def test_numbers_are_kept(name, tmp_path, monkeypatch):
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path))
    now = told(CASES[name]())
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    if os.environ.get("REDRAW"):
        kept = {each: now if each == name else kept[each] for each in CASES if each in {*kept, name}}
        lines = json.dumps(kept, ensure_ascii=False).replace('}, "', '},\n"').replace('], "', '],\n"')
        KEPT.write_text(f"{lines}\n", encoding="utf-8")
    assert_told(now, kept[name], name)


def test_every_number_kept_is_of_a_case():
    assert json.loads(KEPT.read_text(encoding="utf-8")).keys() == CASES.keys()
