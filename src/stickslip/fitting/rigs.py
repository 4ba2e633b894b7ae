"""Rigs from a fit, and from a few readings.

A fitted rig has the fitted model: contacts that slide with a force after breaking,
re-attach with it on arrest, and whose thresholds scatter from slip to slip. Its run is
evaluated in the same way as the trace, and must have its drops and period.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from stickslip.arrays import Range
from stickslip.errors import InputError, instance, number
from stickslip.fitting.bench import Known, drawn, in_si, newtons, seconds
from stickslip.fitting.events import RESOLVED, Events, pick_events, with_unit
from stickslip.fitting.model import KEYS as PARAMETERS
from stickslip.io.rig_files import from_document, to_document
from stickslip.measure import regime
from stickslip.measure.trace import Array
from stickslip.model import Contacts, Gaussian, Output, Rig, constant
from stickslip.model.quantities import read_value
from stickslip.simulation import simulate
from stickslip.sliding.rigid_motion import friction_ratios, thresholds_of
from stickslip.words import engineering

if TYPE_CHECKING:
    from stickslip.fitting.fits import Fit


DRAWS_KEPT = 100  # number of draws that a rig file keeps
# if slips are not resolved, the mass is anywhere between this fraction of its upper
# bound and that bound
_LIGHTEST = 0.01
_TRIED = 60  # most draws that are run
_SLIPS = 60  # most slips of a run
_RUNS = 8  # runs with other contacts, as many as `advise` makes
_SETTLED = 5  # slips before these, in which a run settles
_NINETY = 1.645  # half of a 90 % interval, in standard errors
_NO_DELAY = (
    "stands for any delay longer than a slip and shorter than the time between slips; "
    "friction at several speeds "
    "(--speeds) gives it"
)
_HALVED = (
    "slide it at several speeds: the speed at which kinetic friction has halved "
    "gives the delay"
)
INITIAL = Gaussian(mean=0.0, std=0.01)
_LEAST_RATIO = 0.01
"""Least relative excess of stiffness times velocity over the loading rate that
determines the stiffness of the interface.
"""

_ASSUMED = (
    "assumed: at most what lets a slip be as short as it was recorded; weigh the slider"
)
KEYS: Mapping[str, tuple[str, str, str]] = {
    "slider.mass": ("mass", "kg", _ASSUMED),
    "slider.stiffness": ("stiffness", "N/m", ""),
    "slider.damping_ratio": ("damping_ratio", "", "damping_ratio"),
    "interface.contact_strength": (
        "contact_strength",
        "N",
        "from the mean force before a slip",
    ),
    "interface.breaking_displacement": (
        "breaking_displacement",
        "m",
        "stiffness_ratio",
    ),
    "interface.thresholds.std": ("threshold_std", "", "threshold_std"),
    "interface.sliding_force": ("sliding_friction", "N", "sliding_force"),
    "interface.newborn.mean": ("sliding_force", "", "sliding_force"),
    "interface.slip_to_slip_scatter": (
        "slip_to_slip_scatter",
        "",
        "slip_to_slip_scatter",
    ),
    "drive.velocity": ("speed", "m/s", "stiffness_ratio"),
    "interface.delay": ("delay", "s", "identified by the force at several speeds"),
}
"""Keys of a rig file that a fit determines: the quantity, its unit, and how it was
found, or the parameter that gives it.
"""


def rig_of(found: Fit, name: str) -> Rig:
    """Return the rig of the draw nearest to the medians whose own run reproduces the
    drops and the period of the trace.
    """
    known = found.known
    nearest = ""
    # raises an error without the stiffness of the spring, which gives all lengths
    found.draws("breaking_displacement")
    exact, draws = (
        _draws(found, one)
        for one in ({name: (it, 0.0) for name, (it, _) in known.items()}, known)
    )
    delays = (
        [{"interface.delay": _rounded(found.draws("delay"))}] if found.delays else []
    )
    for delay, i in itertools.product(
        (*delays, {}), order := found.from_the_centre[:_TRIED]
    ):
        fitted = {
            path: values
            for path, values in (draws | delay).items()
            if KEYS[path][0] not in known
        }
        document = _document(found, name, fitted) | {
            "simulation": {"contacts": max(round(float(found.values[i, 0])), 1)}
        }
        rig = _at(
            document,
            {path: float(values[i]) for path, values in (exact | delay).items()},
            "fitted rig",
        )
        try:
            words, agrees = compared(remade(rig, found.events, known), found.events)
        except InputError:
            words = (
                f"its own run hardly slips, the trace {_drop_in_words(found.events)}"
            )
            agrees = False
        if agrees:
            lasting = _lasting(rig, found.events)
            return replace(rig, source=f"{rig.source}; {words}; {lasting}")
        nearest = nearest or words
    raise InputError(
        f"fit: no rig is written: runs of {len(order)} draws all miss the drops or the "
        "period of the trace by more "
        f"than their errors; of the most central one, {nearest}. Check the mass, "
        "stiffness and speed, or drive slower"
    )


def _document(found: Fit, name: str, fitted: Mapping[str, Array]) -> dict[str, Any]:
    """Return the content of the file of a fitted rig, without the values of a draw: it
    has the intervals and draws of the fitted keys.
    """
    verdicts = {one.key: str(one.verdict) for one in found.parameters}
    if found.events.slip_samples >= RESOLVED:
        verdicts[_ASSUMED] = "identified by the time of a slip"
    assumed = {} if "interface.delay" in fitted else {"interface.delay": _NO_DELAY}
    entries = {}
    for path, draws in fitted.items():
        how = verdicts.get(KEYS[path][2], KEYS[path][2])
        if how.startswith("assumed"):
            assumed[path] = how.removeprefix("assumed: ")
        low, high = (
            _written(path, value, 3)
            for value in np.quantile(draws, (0.05, 0.95)).tolist()
        )
        kept = [float(f"{value:.8g}") for value in draws[:DRAWS_KEPT]]
        entries[path] = {
            "interval": f"{low} to {high}",
            "how": how,
            "draws": kept,
        }
    newborn = {"distribution": "gaussian", "std": 0.0}
    return {
        "name": name,
        "source": (
            f"fitted to {found.events.source or 'a trace'}, {len(found.events)} slips"
        ),
        "interface": {
            "thresholds": {"distribution": "gaussian"},
            "newborn": newborn,
            "delay": "on arrest",
        },
        "fitted": entries,
        "assumed": assumed,
    }


def _at(document: Mapping[str, Any], values: Mapping[str, float], place: str) -> Rig:
    """Return the rig of a document with these values of keys, in SI units."""
    full = copy.deepcopy(dict(document))
    for path, value in values.items():
        *tables, key = path.split(".")
        table = full
        for name in tables:
            table = table.setdefault(name, {})
        table[key] = _written(path, value, 8)
    return from_document(full, place)


def _own_run(rig: Rig, events: Events) -> xr.Dataset:
    """Return a rig's own run, as long as that many slips of a trace, and sampled like
    it.
    """
    lasts = (min(len(events), _SLIPS) + _SETTLED) * events.recurrence
    unit = rig.unit("time") / seconds(events)
    drive = constant(rig.natural.velocity, lasts / unit)
    output = Output(interval=events.step / unit)
    return simulate(replace(rig, drive=drive, output=output))


def _lasting(rig: Rig, events: Events) -> str:
    """Return in words in how many runs with other contacts stick-slip persists."""
    count = getattr(rig.method, "count", 1)
    runs = (
        _own_run(rig.replace(method=Contacts(count, seed=seed)), events)
        for seed in range(1, _RUNS + 1)
    )
    lasts = sum(regime(run).kind == "stick-slip" for run in runs)
    return f"lasts in {lasts} of {_RUNS} runs"


def remade(rig: Rig, events: Events, known: Known) -> Events:
    """Return the slips of a rig's own run, recorded and detected as in a trace."""
    second = seconds(events)
    run = _own_run(rig, events)
    values = run["spring_force"].values / newtons(events, known)
    values = values + events.noise * np.random.default_rng(1).standard_normal(
        values.size
    )
    if events.resolution > 0:
        values = events.resolution * np.round(values / events.resolution)
    data = xr.Dataset(
        {"spring_force": ("time", values, {"units": events.force_unit})},
        coords={
            "time": (
                "time",
                run["time"].values / second,
                {"units": events.time_unit},
            )
        },
    )
    return pick_events(
        data, minimum_drop=events.smallest, after=_SETTLED * events.recurrence
    )


def friction_ratio_range() -> Range:
    """Return the smallest and the largest ratio of static to kinetic friction for which
    `quick_fit` can make a rig.
    """
    return friction_ratios(INITIAL)


def compared(made: Events, events: Events) -> tuple[str, bool]:
    """Compare the slips of a rig with those of a trace: return a text, and whether mean
    drop and period agree within their 90 % intervals.
    """
    series = [(each.drops, np.diff(each.time[each.peak_at])) for each in (made, events)]
    agrees = True
    for one, other, more in zip(*series, (0.0, events.rate_error), strict=True):
        error = math.hypot(
            more,
            *(
                float(x.std()) / (float(x.mean()) * math.sqrt(x.size))
                for x in (one, other)
            ),
        )
        agrees &= abs(math.log(float(one.mean() / other.mean()))) <= _NINETY * max(
            error, 1e-9
        )
    return (
        f"its own run drops {_drop_in_words(made)}, the trace {_drop_in_words(events)}",
        agrees,
    )


def _drop_in_words(events: Events) -> str:
    drop = with_unit(float(events.drops.mean()), events.force_unit)
    return f"{drop} every {with_unit(events.recurrence, events.time_unit)}"


def _draws(found: Fit, known: Known) -> dict[str, Array]:
    """Return draws of every key except the delay, in SI units."""
    values = found.values
    events = found.events
    count = len(found)
    quantities = {
        **dict(zip(PARAMETERS, values.T, strict=True)),
        **in_si(values, found.strength, events, known),
    }
    for name in known.keys() & {"stiffness", "mass"}:
        quantities[name] = drawn(known, name, count)
    if "velocity" in known:
        quantities["speed"] = drawn(known, "velocity", count)
    # the mass whose slips take as long as the recorded ones or, if these are not
    # resolved, any smaller one
    if "mass" not in known:
        lasts = events.slip_samples * events.step * seconds(events)
        undamped = 1.0 - quantities["damping_ratio"] ** 2
        mass = quantities["stiffness"] * (lasts / math.pi) ** 2 * undamped
        if events.slip_samples < RESOLVED:
            mass *= _LIGHTEST ** np.random.default_rng(len(events)).random(count)
        quantities["mass"] = mass
    draws = {
        path: _rounded(quantities[name])
        for path, (name, *_) in KEYS.items()
        if name in quantities
    }
    draws["slider.stiffness"] = quantities["stiffness"]
    draws["interface.sliding_force"] = (
        draws["interface.contact_strength"] * draws["interface.newborn.mean"]
    )
    return draws


def _rounded(values: Array) -> Array:
    """Return values rounded to four digits, so that a file can hold products of two
    exactly.
    """
    return np.array([float(f"{value:.4g}") for value in values])


def _written(path: str, value: float, digits: int) -> Any:
    unit = KEYS[path][1] if path in KEYS else ""
    return engineering(value, unit, digits) if unit else float(f"{value:.{digits}g}")


def _bench_displacement(
    strength: float,
    K: float,
    v: float,
    loading_rate: object | None,
    breaking_displacement: object | None,
) -> float:
    """Return the breaking displacement as given, or from the loading rate.

    With contacts of stiffness ``N k`` in series with the spring, the force rises at
    ``R = K v/(1 + K/(N k))``, so ``N f_s/(N k) = N f_s (K v/R - 1)/K``.
    """
    if (loading_rate is None) == (breaking_displacement is None):
        raise InputError(
            "quick_fit: give either loading_rate or breaking_displacement",
            "loading_rate",
        )
    if breaking_displacement is not None:
        return read_value("breaking_displacement", breaking_displacement, "m", "0.2 mm")
    rate = read_value("loading_rate", loading_rate, "N/s", "7 N/s")
    ratio = K * v / rate - 1.0
    if ratio < _LEAST_RATIO:
        raise InputError(
            f"loading_rate = {rate:.4g} N/s: stiffness times speed, {K * v:.4g} "
            "N/s, must be at least "
            f"{100 * _LEAST_RATIO:g} % more to show how stiff the interface is; "
            "give breaking_displacement",
            "loading_rate",
        )
    return strength * ratio / K


def quick_fit(
    *,
    static_friction: object,
    kinetic_friction: object,
    stiffness: object,
    speed: object,
    mass: object,
    loading_rate: object | None = None,
    breaking_displacement: object | None = None,
    half_speed: object | None = None,
    damping_ratio: float = 0.15,
    name: str = "quick fit",
) -> Rig:
    """Make a rig, in SI units, from readings of a bench, by closed forms.

    The ratio of static and kinetic friction gives the standard deviation of the
    thresholds, and their values the total contact strength (slow rigid motion, Eqs.
    (1)-(4)). The loading rate ``R`` between slips gives the stiffness of the interface,
    ``K v = R (1 + K/(N k))``, and so the breaking displacement; this is useful only
    with a stiff driving spring, else give the breaking displacement itself. The speed
    at which kinetic friction has halved gives the delay. Sliding contacts are assumed
    to carry no force. If measured slips are smaller than those of the rig, they do
    carry one, and the rig does not describe the bench; `fit` finds that force.

    Parameters
    ----------
    static_friction, kinetic_friction : float or str
        Largest force of a slow pull, and mean force of slow sliding: in N, or texts
        with a unit, as all further values.
    stiffness, speed, mass : float or str
        Stiffness of the driving spring, speed of the drive, mass of the slider.
    loading_rate : float or str, optional
        Rise of the force per time while the slider sticks, at this speed, in N/s.
    breaking_displacement : float or str, optional
        Breaking displacement, in place of the loading rate.
    half_speed : float or str, optional
        Speed at which kinetic friction has fallen to half; without it there is no
        delay, which the rig lists as an assumption.

    Raises
    ------
    InputError
        If the readings contradict one another.

    Examples
    --------
    >>> rig = ss.quick_fit(
    ...     static_friction="14 N",
    ...     kinetic_friction="9 N",
    ...     stiffness="8 kN/m",
    ...     speed="1 mm/s",
    ...     mass="0.4 kg",
    ...     loading_rate="7 N/s",
    ...     half_speed="20 mm/s",
    ... )
    >>> (
    ...     rig.in_units(1.0, "force"),
    ...     rig.in_units(1.0, "length"),
    ...     round(rig.interface.thresholds.std, 2),
    ... )
    ('17.8 N', '317.8 um', 0.11)
    """
    static = read_value("static_friction", static_friction, "N", "14 N")
    kinetic = read_value("kinetic_friction", kinetic_friction, "N", "9 N")
    K = read_value("stiffness", stiffness, "N/m", "8 kN/m")
    v = read_value("speed", speed, "m/s", "1 mm/s")
    m = read_value("mass", mass, "kg", "0.4 kg")
    try:
        thresholds, strength = thresholds_of(static, kinetic, INITIAL)
    except InputError as error:
        words = str(error).replace("mu_s/mu_k", "static_friction/kinetic_friction")
        raise InputError(words, "static_friction") from None
    x_s = _bench_displacement(strength, K, v, loading_rate, breaking_displacement)
    delay = 0.0
    assumed = {
        "slider.damping_ratio": "let the slider ring on its spring",
        "interface.delay": _HALVED,
    }
    if half_speed is not None:
        delay = (
            thresholds.positive().moment(1)
            * x_s
            / read_value("half_speed", half_speed, "m/s", "20 mm/s")
        )
        del assumed["interface.delay"]
    document = {
        "name": name,
        "source": (
            f"readings: static friction {engineering(static, 'N')}, kinetic "
            f"friction {engineering(kinetic, 'N')}"
        ),
        "interface": {
            "thresholds": {"distribution": "gaussian"},
            "initial": {
                "distribution": "gaussian",
                "mean": INITIAL.mean,
                "std": INITIAL.std,
            },
        },
        "simulation": {"method": "master equation"},
        "assumed": assumed,
    }
    values = {
        "slider.mass": m,
        "slider.stiffness": K,
        "slider.damping_ratio": number(
            "damping_ratio",
            damping_ratio,
            at_least=0,
            hint="of the slider on its spring",
        ),
        "interface.contact_strength": strength,
        "interface.breaking_displacement": x_s,
        "interface.thresholds.std": thresholds.std,
        "interface.delay": delay,
        "drive.velocity": v,
    }
    return _at(document, values, "quick fit")


def rigs_drawn(rig: Rig) -> Iterator[Rig]:
    """Yield the equally likely rigs of a fit: the fitted rig with each draw of its
    file.
    """
    instance("rig", rig, Rig, "the rig of a fit")
    columns = {path: one.draws for path, one in rig.fitted.items() if one.draws}
    # a changed rig has its own damping, and may have no damping ratio
    document = to_document(rig, damping_ratio="slider.damping_ratio" in columns or None)
    for values in zip(*columns.values(), strict=False):
        yield _at(document, dict(zip(columns, values, strict=True)), "a draw")
