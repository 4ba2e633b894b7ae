"""The arrays of a Dataset as the measures need them, and the turning points of a force."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import LARGEST, SMALLEST, InputError, instance, printable
from stickslip.io.datasets import read_provenance
from stickslip.model import Contacts, Population, Slider
from stickslip.simulation import Recording
from stickslip.words import engineering

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

FEWEST_READINGS = 16
CONSTANT_DRIVE = 0.01  # relative change of the drive's velocity that still counts as constant
_VARIABLES = {
    "force": "spring_force",
    "X": "displacement",
    "velocity": "velocity",
    "drive": "drive_velocity",
    "attached": "attached",
    "displacement": "measured_displacement",
}


def check_numbers(place: str, variable: xr.DataArray) -> None:
    """Raise `InputError` if a variable holds no numbers, or one that is too large to be multiplied."""
    if variable.dtype.kind not in "fiu":
        raise InputError(f"{place}: {variable.name} holds values of type {variable.dtype}, no numbers")
    values = np.asarray(variable.values, dtype=float)
    largest = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))
    if largest > LARGEST:
        raise InputError(f"{place}: {variable.name} = {largest:g}: must be at most {LARGEST:g} in size")


@dataclass(frozen=True, kw_only=True)
class Trace:
    """The arrays of a Dataset, as the functions here need them; forces and motion along the drive's direction.

    `largest` is the largest force in all of the data: the static friction, where they hold a slip or the first
    loading. `contacts` is their number in a run of so many.
    """

    t: Array
    force: Array
    X: Array | None
    velocity: Array | None
    drive: Array | None
    attached: Array | None
    sign: float
    largest: float
    contacts: int | None = None
    displacement: Array | None = None
    time_unit: str = ""
    force_unit: str = ""
    quantity: str = "force"

    @classmethod
    def of(cls, data: xr.Dataset) -> Trace:
        """Take them from a Dataset; `InputError` if it holds no force, or values that are not finite."""
        import xarray as xr

        instance("measure: data", data, xr.Dataset, "a Dataset, such as simulate() and read_trace() return")
        if "spring_force" not in data or "time" not in data["spring_force"].dims:
            raise InputError(
                "measure: need a Dataset with the variable spring_force along time; read a file with read_trace()"
            )
        check_numbers("measure", data["time"])
        t = np.asarray(data["time"].values, dtype=float)
        if t.size < FEWEST_READINGS:
            raise InputError(
                f"measure: {t.size} samples of spring_force are too few to judge; {FEWEST_READINGS} is the least"
            )
        if not (np.all(np.isfinite(t)) and np.all(np.diff(t) > 0) and t[-1] - t[0] >= SMALLEST):
            raise InputError(
                f"measure: the times must be finite and rising over {SMALLEST:g}, in another unit if need be"
            )
        arrays: dict[str, Any] = dict.fromkeys(_VARIABLES)
        for key, name in _VARIABLES.items():
            if name not in data:
                continue
            check_numbers("measure", data[name])
            along = data[name].mean("block") if "block" in data[name].dims else data[name]
            arrays[key] = values = np.asarray(along.values, dtype=float)
            if values.shape != t.shape:
                raise InputError(f"measure: {name} has shape {values.shape}: must be along time alone; select one run")
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise InputError(
                    f"measure: {name} = {values[bad[0]]:g} at t = {t[bad[0]]:g}: {bad.size} of {t.size} values are "
                    "not finite; drop or fill them first"
                )
        # A load cell may count pull as negative: then the force alone tells the direction, unless its sign was turned.
        turned = arrays["drive"] is None and bool(data.attrs.get("flipped"))
        told = str(data["spring_force"].attrs.get("long_name", ""))
        return cls._along_the_drive(
            arrays | {"t": t},
            turned,
            contacts=_contacts(data),
            time_unit=printable(str(data["time"].attrs.get("units", ""))),
            force_unit=printable(str(data["spring_force"].attrs.get("units", ""))),
            quantity="coefficient of friction" if "coefficient" in told else "force",
        )

    @classmethod
    def of_recording(cls, run: Recording) -> Trace:
        """Take them from a run, in the rig's units."""
        rig, track, slider = run.rig, run.track, run.rig.slider
        if not isinstance(slider, Slider):
            return cls.of(run.dataset())
        length, speed = rig.unit("x_s"), rig.unit("x_s/time")
        arrays = {
            "t": rig.unit("time") * track.times,
            "force": slider.stiffness * (track.drive_position - track["displacement"]) * rig.unit("f_s"),
            "X": track["displacement"] * length,
            "velocity": track["velocity"] * speed,
            "drive": track.drive_velocity * speed,
            "attached": track["attached"],
        }
        return cls._along_the_drive(
            arrays,
            contacts=rig.method.count if isinstance(rig.method, (Contacts, Population)) else None,
            time_unit=rig.unit_name("time"),
            force_unit=rig.unit_name("f_s"),
        )

    @classmethod
    def _along_the_drive(cls, arrays: dict[str, Any], turned: bool = False, **more: Any) -> Trace:
        drive, force = arrays["drive"], arrays["force"]
        # A force with its zero well within its range is without its mean: what is left does not tell the direction.
        below = np.mean(force) < 0 and -np.min(force) > 3.0 * np.max(force) if drive is None else np.mean(drive) < 0
        sign = -1.0 if below and not turned else 1.0
        along = {key: sign * arrays[key] for key in ("force", "X", "velocity", "drive") if arrays[key] is not None}
        top = float(np.max(along["force"]))  # of a force that never pulls that way, the largest in size
        largest = top if top > 0 else float(np.max(np.abs(along["force"])))
        return cls(**arrays | along, sign=sign, largest=largest, **more)

    def time_in_words(self, time: float) -> str:
        """A time with its unit."""
        return in_words(time, self.time_unit, 2)

    def force_in_words(self, force: float) -> str:
        """A force with its unit."""
        return in_words(force, self.force_unit, 3)

    @property
    def gaps(self) -> NDArray[np.intp]:
        """Samples before a gap: a step of more than 16 of those beside it, as many readings as a verdict needs."""
        step = np.diff(self.t)
        return 1 + np.flatnonzero(step[1:-1] > FEWEST_READINGS * np.maximum(step[:-2], step[2:]))

    def part(self, begin: float, end: float = math.inf) -> Trace:
        """What comes from a time on, up to another."""
        inside = slice(*np.searchsorted(self.t, [begin, end], side="left").tolist())
        known = {name: values for name in ("t", *_VARIABLES) if (values := getattr(self, name)) is not None}
        return replace(self, **{name: values[inside] for name, values in known.items()})


def in_words(value: float, unit: str, digits: int = 4) -> str:
    """A value with its unit, of time too."""
    return engineering(value, "time units" if unit == "time" else unit, digits)


def _contacts(data: xr.Dataset) -> int | None:
    """How many contacts a run was made with, as its provenance says; None for other data."""
    try:
        rig = read_provenance(data)["arguments"]["rig"]
        slider = rig["slider"]
        count = rig["method"]["count"] * slider.get("blocks", slider.get("along", 1) * slider.get("across", 1))
    except (InputError, KeyError, TypeError):
        return None
    return count if isinstance(count, int) and count > 0 else None


def without_line(values: Array, at: Array) -> Array:
    """Values less the straight line through them. Sums, as products of long vectors would wake the threads of BLAS."""
    return np.asarray(values - values.mean() - slope(values, at) * (at - at.mean()))


def slope(values: Array, at: Array) -> float:
    """Slope of the straight line through values."""
    at = at - at.mean()
    return float((at * (values - values.mean())).sum()) / float((at * at).sum())


def memory(rest: Array) -> float:
    """How alike neighbouring residuals are, 0 to 1: n are worth n (1 - r)/(1 + r) independent ones (Bartlett)."""
    power = float(rest @ rest)
    return max(float(rest[1:] @ rest[:-1]) / power, 0.0) if power > 0 else 0.0
