"""From a fit to a rig, and from a fitted rig to a verdict with its uncertainty.

The rig holds what was fitted: contacts that slide with a force and re-attach with it on arrest, on a track that
scatters. It is run before it is written, and read as the trace was: its drops and its period are those of the trace.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip.answers import Answer
from stickslip.errors import InputError, UndecidedError, instance, whole
from stickslip.fitting.events import Events, pick_events, with_unit
from stickslip.fitting.gates import RESOLVED
from stickslip.fitting.known import Known, drawn, in_si, newtons, rate_error, read_known, seconds
from stickslip.io.rig_files import from_document, to_document
from stickslip.measure.arrays import Array
from stickslip.model import OnArrest, Output
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.simulation import simulate
from stickslip.words import engineering

if TYPE_CHECKING:
    from stickslip.fitting.fits import Fit

DRAWS_KEPT = 100
_LIGHTEST = 0.01
"""Where slips are not resolved, the mass lies anywhere between this part of its bound and the bound."""
_TRIED, _SLIPS, _SETTLED, _NINETY = 60, 60, 5, 1.645
"""Draws run, at most; slips of a run, after those in which it settles; standard errors in half a 90 % interval."""
_SPEEDS = (0.1, 0.3, 1.0, 3.0, 10.0)
_ON_ARREST = (
    "contacts re-attach on arrest, so there is no smooth sliding for linear theory; friction at several speeds (fit "
    "--speeds) would tell the delay"
)

_ASSUMED = "assumed: at most what lets a slip be as short as it was recorded; weigh the slider"
KEYS: Mapping[str, tuple[str, str]] = {
    "slider.mass": ("kg", _ASSUMED),
    "slider.stiffness": ("N/m", ""),
    "slider.damping_ratio": ("", "damping_ratio"),
    "interface.contact_strength": ("N", "from the mean force before a slip"),
    "interface.breaking_displacement": ("m", "stiffness_ratio"),
    "interface.thresholds.std": ("", "threshold_std"),
    "interface.sliding_force": ("N", "sliding_force"),
    "interface.newborn.mean": ("", "sliding_force"),
    "interface.track_scatter": ("", "track_scatter"),
    "interface.delay": ("s", "identified by the force at several speeds"),
    "drive.velocity": ("m/s", "stiffness_ratio"),
}
"""Keys of a rig file that a fit fills in: the unit of their draws, and how they were found or which parameter tells."""


def rig_of(found: Fit, *, name: str, mass: object = None, speed: object = None) -> Rig:
    """The rig behind a trace, at the draw nearest to the medians whose own run makes its drops and period."""
    more = {key: value for key, value in (("mass", mass), ("speed", speed)) if value is not None}
    known = {**found.known, **read_known(more)}
    if "stiffness" not in known:
        raise InputError(
            "fit: a rig needs the stiffness of the driving spring, without which a force trace tells no length; give "
            "it as known={'stiffness': '350 N/m'}, or --stiffness on the command line"
        )
    exact, draws = (_draws(found, one) for one in ({name: (it, 0.0) for name, (it, _) in known.items()}, known))
    order, nearest = _from_the_centre(exact)[:_TRIED].tolist(), ""
    delays = [] if found.delays is None else [{"interface.delay": _rounded(found.delays.draws)}]
    for delay in (*delays, {}):
        fitted = {path: values for path, values in (draws | delay).items() if path not in _given(known)}
        document = _document(found, name, fitted)
        for i in order:
            document["simulation"] = {"contacts": max(round(float(found.values[i, 0])), 1)}
            rig = _at(document, {path: float(values[i]) for path, values in (exact | delay).items()}, "fitted rig")
            try:
                words, agrees = compared(remade(rig, found.events, known), found.events)
            except InputError:
                words, agrees = f"its own run hardly slips, the trace {_said(found.events)}", False
            if agrees:
                return replace(rig, source=f"{rig.source}; {words}")
            nearest = nearest or words
    raise InputError(
        f"fit: no rig is written: runs of {len(order)} draws all miss the drops or the period of the trace by more "
        f"than their errors; of the most central one, {nearest}. Check the mass, stiffness and speed, or drive slower"
    )


def _given(known: Known) -> set[str]:
    """Keys whose values are not fitted, but known."""
    keys = {"stiffness": "slider.stiffness", "mass": "slider.mass", "speed": "drive.velocity"}
    return {key for name, key in keys.items() if name in known}


def _document(found: Fit, name: str, fitted: Mapping[str, Array]) -> dict[str, Any]:
    """The file of a fitted rig, but for the values of one draw: what was fitted, with its interval and draws."""
    says = {one.key: str(one.verdict) for one in found.parameters}
    if found.events.slip_samples >= RESOLVED:
        says[_ASSUMED] = "identified by the time of a slip"
    assumed, entries = {}, {}
    if "interface.delay" not in fitted:
        assumed["interface.delay"] = (
            "stands for any delay longer than a slip and shorter than the time between slips; friction at several "
            "speeds (--speeds) tells it"
        )
    for path, draws in fitted.items():
        how = says.get(KEYS[path][1], KEYS[path][1])
        if how.startswith("assumed"):
            assumed[path] = how.removeprefix("assumed: ")
        low, high = (_written(path, value, 3) for value in np.quantile(draws, (0.05, 0.95)).tolist())
        kept = [float(f"{value:.8g}") for value in draws[:DRAWS_KEPT]]
        entries[path] = {"interval": f"{low} to {high}", "how": how, "draws": kept}
    return {
        "name": name,
        "source": f"fitted to {found.events.source or 'a trace'}, {len(found.events)} slips",
        "interface": {
            "thresholds": {"distribution": "gaussian"},
            "newborn": {"distribution": "gaussian", "std": 0.0},
            "delay": "on arrest",
        },
        "fitted": entries,
        "assumed": assumed,
    }


def _at(document: Mapping[str, Any], values: Mapping[str, float], place: str) -> Rig:
    """The rig of a document, with these values of keys, in SI units."""
    full = copy.deepcopy(dict(document))
    for path, value in values.items():
        *tables, key = path.split(".")
        table = full
        for name in tables:
            table = table.setdefault(name, {})
        table[key] = _written(path, value, 8)
    return from_document(full, place)


def remade(rig: Rig, events: Events, known: Known) -> Events:
    """The slips of a rig's own run, recorded and picked as those of a trace were."""
    force, second = newtons(events, known), seconds(events)
    lasts = (min(len(events), _SLIPS) + _SETTLED) * events.recurrence
    unit = rig.unit("time") / second
    drive, output = constant(rig.natural.velocity, lasts / unit), Output(interval=events.step / unit)
    run = simulate(replace(rig, drive=drive, output=output))
    values = np.asarray(run["spring_force"].values) / force
    values = values + events.noise * np.random.default_rng(1).standard_normal(values.size)
    if events.resolution > 0:
        values = events.resolution * np.round(values / events.resolution)
    data = xr.Dataset(
        {"spring_force": ("time", values, {"units": events.force_unit})},
        coords={"time": ("time", run["time"].values / second, {"units": events.time_unit})},
    )
    return pick_events(data, smallest=events.smallest, after=_SETTLED * events.recurrence)


def compared(made: Events, events: Events) -> tuple[str, bool]:
    """Slips that a rig makes beside those of a trace, in words; and whether mean drop and period agree within 90 %."""

    def apart(one: Array, other: Array, more: float = 0.0) -> float:
        error = math.hypot(more, *(float(x.std()) / (float(x.mean()) * math.sqrt(x.size)) for x in (one, other)))
        return abs(math.log(float(one.mean() / other.mean()))) / max(error, 1e-9)

    one, other = (np.diff(each.time[each.peak_at]) for each in (made, events))
    agrees = max(apart(made.drops, events.drops), apart(one, other, rate_error(events))) <= _NINETY
    return f"its own run drops {_said(made)}, the trace {_said(events)}", agrees


def _said(events: Events) -> str:
    drop, period = float(events.drops.mean()), events.recurrence
    return f"{with_unit(drop, events.force_unit)} every {with_unit(period, events.time_unit)}"


def _draws(found: Fit, known: Known) -> dict[str, Array]:
    """Draws of every key, in SI units."""
    values, events, count = found.values, found.events, len(found)
    told = {name: _rounded(draws) for name, draws in in_si(values, found.strength, events, known).items()}
    strength, residual, K = told["contact_strength"], _rounded(values[:, 2]), drawn(known, "stiffness", count)
    if "mass" in known:
        mass = drawn(known, "mass", count)
    else:  # what lets a slip be as short as it was recorded, or anything lighter where slips are not resolved
        mass = K * (events.slip_samples * events.step * seconds(events) / math.pi) ** 2 * (1.0 - values[:, 4] ** 2)
        if events.slip_samples < RESOLVED:
            mass = mass * _LIGHTEST ** np.random.default_rng(len(events)).random(count)
    return {
        "slider.mass": _rounded(mass),
        "slider.stiffness": K,
        "slider.damping_ratio": _rounded(values[:, 4]),
        "interface.contact_strength": strength,
        "interface.breaking_displacement": told["breaking_displacement"],
        "interface.thresholds.std": _rounded(values[:, 1]),
        "interface.sliding_force": strength * residual,
        "interface.newborn.mean": residual,
        "interface.track_scatter": _rounded(values[:, 5]),
        "drive.velocity": _rounded(drawn(known, "speed", count)) if "speed" in known else told["speed"],
    }


def _rounded(values: Array) -> Array:
    """To four digits, so that products of two are written without an error."""
    return np.array([float(f"{value:.4g}") for value in values])


def _from_the_centre(draws: Mapping[str, Array]) -> NDArray[np.int64]:
    """Numbers of the draws, those nearest to the medians first, on logarithmic scales."""
    log = np.log(np.maximum(np.column_stack(list(draws.values())), 1e-30))
    scale = np.maximum(np.subtract(*np.quantile(log, (0.75, 0.25), axis=0)), 1e-9)
    return np.asarray(np.argsort((((log - np.median(log, axis=0)) / scale) ** 2).sum(axis=1)))


def _written(path: str, value: float, digits: int) -> Any:
    unit = KEYS.get(path, ("", ""))[0]
    return engineering(value, unit, digits) if unit else float(f"{value:.{digits}g}")


# -------------------------------------------------------------------------------------- a verdict with its uncertainty


@dataclass(frozen=True, kw_only=True, repr=False)
class Uncertain(Answer):
    """How often smooth sliding is unstable, over the draws of a fitted rig (linear stability)."""

    draws: int
    speeds: tuple[float, ...]  #: in the rig's own units; the middle one is its own
    unstable: tuple[float, ...]  #: fraction of the draws for which smooth sliding is unstable at each speed
    undecided: tuple[float, ...]  #: fraction of the draws that theory does not tell
    reason: str = ""  #: why theory does not tell
    speed_unit: str = "m/s"

    @property
    def here(self) -> float:
        """Fraction of the draws for which smooth sliding is unstable at the rig's own speed."""
        return self.unstable[len(self.speeds) // 2]

    def __str__(self) -> str:
        if min(self.undecided) == 1.0:
            return f"Not judged over the draws: {self.reason}"
        pairs = zip(self.unstable, self.speeds, strict=True)
        each = ", ".join(f"{100 * part:.0f} % at {engineering(v, self.speed_unit, 2)}" for part, v in pairs)
        untold = f" (up to {100 * max(self.undecided):.0f} % not told)" if any(self.undecided) else ""
        return (
            f"Over {self.draws} draws of what was fitted, smooth sliding is linearly unstable in "
            f"{100 * self.here:.0f} % at this speed; {each}{untold}"
        )


def over_draws(rig: Rig, *, most: int = 40, progress: Callable[[float], None] | None = None) -> Uncertain:
    """Judge a fitted rig over the draws that its file holds: how often smooth sliding is unstable, at five speeds.

    Parameters
    ----------
    rig : Rig
        With fitted values.
    most : int
        Draws judged.
    progress : callable, optional

    Raises
    ------
    InputError
        If nothing of the rig was fitted.
    """
    from stickslip.stability import count_unstable

    instance("over_draws: rig", rig, Rig, "a Rig")
    most = whole("most", most, at_least=1, at_most=1000)
    columns = {path: one.draws for path, one in rig.fitted.items() if one.draws}
    if not columns:
        raise InputError(f"rig {rig.name!r}: holds no fitted values with draws; make it with stickslip fit")
    count = min(most, *(len(draws) for draws in columns.values()))
    document = to_document(rig)
    unstable, undecided, reason = np.zeros(len(_SPEEDS)), np.zeros(len(_SPEEDS)), ""
    if isinstance(rig.interface.delay, OnArrest):
        undecided, reason = undecided + count, _ON_ARREST
    for i in range(0 if reason else count):
        made = _at(document, {path: draws[i] for path, draws in columns.items()}, "a draw")
        smooth = replace(made, interface=replace(made.interface, track_scatter=0.0))  # it is that from slip to slip
        for k, factor in enumerate(_SPEEDS):
            try:
                unstable[k] += count_unstable(smooth.replace(velocity=made.velocity * factor).natural) > 0
            except (InputError, UndecidedError) as error:
                undecided[k] += 1
                reason = str(error)
        if progress is not None:
            progress((i + 1) / count)
    return Uncertain(
        draws=count,
        speeds=tuple(rig.velocity * factor for factor in _SPEEDS),
        unstable=tuple((unstable / count).tolist()),
        undecided=tuple((undecided / count).tolist()),
        reason=reason,
    )
