"""From a fit to a rig, and from a fitted rig to a verdict with its uncertainty.

The rig holds what was fitted: contacts that slide with a force and re-attach with it. Two things are left out, and the
rig says so: re-attachment on arrest is a delay within bounds, as theory needs one, and the track has no scatter.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.answers import Answer
from stickslip.errors import InputError, UndecidedError, instance, whole
from stickslip.fitting.events import RESOLVED
from stickslip.fitting.known import Known
from stickslip.io.rig_files import from_document, to_document
from stickslip.measure.arrays import Array
from stickslip.model.rig import Rig
from stickslip.model.units import engineering

if TYPE_CHECKING:
    from stickslip.fitting.fits import Fit

DRAWS_KEPT = 100
_LIGHTEST = 0.01
"""Where slips are not resolved, the mass lies anywhere between this part of its bound and the bound."""
_SPEEDS = (0.1, 0.3, 1.0, 3.0, 10.0)

UNITS: Mapping[str, str] = {
    "slider.mass": "kg",
    "slider.stiffness": "N/m",
    "slider.damping_ratio": "",
    "interface.contact_strength": "N",
    "interface.breaking_displacement": "m",
    "interface.thresholds.std": "",
    "interface.sliding_force": "N",
    "interface.newborn.mean": "",
    "interface.delay": "s",
    "drive.velocity": "m/s",
}
"""Keys of a rig file that a fit fills in, and the units of their draws."""


def rig_of(found: Fit, *, name: str, mass: object = None, speed: object = None) -> Rig:
    """The rig behind a trace, at the draw nearest to the medians; what is not known has its interval and draws."""
    given = {**found.known.to_dict()}
    extra = Known.read({key: value for key, value in (("mass", mass), ("speed", speed)) if value is not None})
    known = Known(**(given | extra.to_dict()))
    if known.stiffness is None:
        raise InputError(
            "fit: a rig needs the stiffness of the driving spring, without which a force trace tells no length; give "
            "it as known={'stiffness': '350 N/m'}, or --stiffness on the command line"
        )
    draws = _draws(found, known)
    middle = _central(draws)
    at = {path: float(values[middle]) for path, values in draws.items()}
    held = {"slider.stiffness": known.stiffness, "slider.mass": known.mass, "drive.velocity": known.speed}
    fixed = {path for path, value in held.items() if value is not None}
    scatter = found["track_scatter"]
    document: dict[str, Any] = {
        "name": name,
        "source": (
            f"fitted to {found.events.source or 'a trace'}, {len(found.events)} slips; the scatter of the thresholds "
            f"from slip to slip, {scatter}, is left out"
        ),
        "slider": {},
        "interface": {
            "thresholds": {"distribution": "gaussian"},
            "newborn": {"distribution": "gaussian", "std": 0.0},
        },
        "drive": {},
        "simulation": {"contacts": max(round(float(found.values[middle, 0])), 1)},
        "fitted": {},
        "assumed": {},
    }
    for path, value in at.items():
        _put(document, path, _written(path, value, 8))
        if path in fixed:
            continue
        verdict = _said(found, path)
        if verdict.startswith("assumed"):
            document["assumed"][path] = verdict.removeprefix("assumed: ")
        document["fitted"][path] = {
            "interval": _interval(path, draws[path]),
            "how": verdict,
            "draws": [float(f"{value:.8g}") for value in draws[path][:DRAWS_KEPT]],
        }
    return from_document(document, "fitted rig")


def _rounded(values: Array) -> Array:
    """To four digits, so that products of two are written without an error."""
    return np.array([float(f"{value:.4g}") for value in values])


def _draws(found: Fit, known: Known) -> dict[str, Array]:
    """Draws of every key, in SI units."""
    rng = np.random.default_rng(len(found.events))
    values, count = found.values, len(found)
    strength, residual = _rounded(found.draws("contact_strength")), _rounded(values[:, 2])
    assert known.stiffness is not None
    K = np.full(count, known.stiffness[0])
    scale_time = 1.0 if found.events.time_unit == "" else _seconds(found)
    slip = found.events.slip_samples * found.events.step * scale_time
    heaviest = K * (slip / math.pi) ** 2 * (1.0 - values[:, 4] ** 2)
    if known.mass is not None:
        mass = np.full(count, known.mass[0])
    elif found.events.slip_samples >= RESOLVED:
        mass = heaviest
    else:
        mass = heaviest * _LIGHTEST ** rng.random(count)
    if found.delays is not None:
        delay = found.delays.draws
    else:
        took = found.events.time[found.events.peak_at[1:]] - found.events.time[found.events.trough_at[:-1]]
        shortest = max(float(np.quantile(took, 0.05)) * scale_time, 1.01 * slip)
        delay = slip * (shortest / slip) ** rng.random(count)
    speed = found.draws("speed") if known.speed is None else np.full(count, known.speed[0])
    return {
        "slider.mass": _rounded(mass),
        "slider.stiffness": K,
        "slider.damping_ratio": _rounded(values[:, 4]),
        "interface.contact_strength": strength,
        "interface.breaking_displacement": _rounded(found.draws("breaking_displacement")),
        "interface.thresholds.std": _rounded(values[:, 1]),
        "interface.sliding_force": strength * residual,
        "interface.newborn.mean": residual,
        "interface.delay": _rounded(delay),
        "drive.velocity": _rounded(speed),
    }


def _seconds(found: Fit) -> float:
    from stickslip.measure.headings import ratio

    size = ratio(found.events.time_unit, "s")
    if size is None:
        raise InputError(f"fit: the unit of time {found.events.time_unit!r} is not known; read the trace with step=")
    return size


def _said(found: Fit, path: str) -> str:
    """What the trace says of a key: the verdict on the parameters that it is made of."""
    verdicts = {one.key: str(one.verdict) for one in found.parameters}
    match path:
        case "slider.damping_ratio":
            return verdicts["damping_ratio"]
        case "interface.thresholds.std":
            return verdicts["threshold_std"]
        case "interface.contact_strength":
            return "from the mean force before a slip"
        case "interface.sliding_force" | "interface.newborn.mean":
            return verdicts["sliding_force"]
        case "interface.breaking_displacement" | "drive.velocity":
            return verdicts["stiffness_ratio"]
        case "interface.delay" if found.delays is not None:
            return "identified by the force at several speeds"
        case "interface.delay":
            return (
                "assumed: longer than a slip and shorter than the shortest time between slips; the force at several "
                "speeds tells it"
            )
        case _ if found.events.slip_samples >= RESOLVED:
            return "identified by the time of a slip"
        case _:
            return "assumed: at most what lets a slip be as short as it was recorded; weigh the slider"


def _central(draws: Mapping[str, Array]) -> int:
    """The draw nearest to the medians, on logarithmic scales."""
    log = np.log(np.maximum(np.column_stack(list(draws.values())), 1e-30))
    scale = np.maximum(np.subtract(*np.quantile(log, (0.75, 0.25), axis=0)), 1e-9)
    return int(np.argmin((((log - np.median(log, axis=0)) / scale) ** 2).sum(axis=1)))


def _written(path: str, value: float, digits: int = 3) -> Any:
    return engineering(value, UNITS[path], digits) if UNITS[path] else float(f"{value:.{digits}g}")


def _interval(path: str, draws: Array) -> str:
    low, high = (float(value) for value in np.quantile(draws, (0.05, 0.95)))
    return f"{_written(path, low)} to {_written(path, high)}"


def _put(document: dict[str, Any], path: str, value: Any) -> None:
    *tables, key = path.split(".")
    for table in tables:
        document = document.setdefault(table, {})
    document[key] = value


# ---------------------------------------------------------------------------------------------------------------------
# A verdict with its uncertainty
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, repr=False)
class Uncertain(Answer):
    """How often smooth sliding is unstable, over the draws of a fitted rig (linear stability). It prints as its text.

    Attributes
    ----------
    draws : int
    speeds : tuple of float
        In the rig's own units; the middle one is its own.
    unstable : tuple of float
        Fraction of the draws for which smooth sliding is unstable at each speed.
    undecided : tuple of float
        Fraction of the draws that theory does not tell.
    """

    draws: int
    speeds: tuple[float, ...]
    unstable: tuple[float, ...]
    undecided: tuple[float, ...]
    speed_unit: str = "m/s"

    @property
    def here(self) -> float:
        """Fraction of the draws for which smooth sliding is unstable at the rig's own speed."""
        return self.unstable[len(self.speeds) // 2]

    def __str__(self) -> str:
        odd = [
            f"{100 * part:.0f} % at {engineering(v, self.speed_unit, 2)}"
            for v, part in zip(self.speeds, self.unstable, strict=True)
        ]
        most = max(self.undecided)
        return (
            f"Over {self.draws} draws of what was fitted, smooth sliding is linearly unstable in "
            f"{100 * self.here:.0f} % at this speed; {', '.join(odd)}"
            + (f" (up to {100 * most:.0f} % not told)" if most > 0 else "")
        )

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers."""
        return {
            "draws": self.draws,
            "speeds": list(self.speeds),
            "unstable": list(self.unstable),
            "undecided": list(self.undecided),
        }


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
    unstable, undecided = np.zeros(len(_SPEEDS)), np.zeros(len(_SPEEDS))
    for i in range(count):
        one = copy.deepcopy(document)
        for path, draws in columns.items():
            unit = UNITS.get(path, "")
            _put(one, path, f"{draws[i]!r} {unit}" if unit else draws[i])
        made = from_document(one, "a draw")
        for k, factor in enumerate(_SPEEDS):
            try:
                unstable[k] += count_unstable(made.replace(velocity=made.velocity * factor).natural) > 0
            except (InputError, UndecidedError):
                undecided[k] += 1
        if progress is not None:
            progress((i + 1) / count)
    return Uncertain(
        draws=count,
        speeds=tuple(rig.velocity * factor for factor in _SPEEDS),
        unstable=tuple((unstable / count).tolist()),
        undecided=tuple((undecided / count).tolist()),
    )
