"""The arrays of a Dataset as the measures need them, and the turning points of a force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip.errors import LARGEST, InputError, instance

Array = NDArray[np.float64]

FEWEST_READINGS = 16
CONSTANT_DRIVE = 0.01  # relative change of the drive's velocity that still counts as constant


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
    """The arrays of a Dataset, as the functions here need them; forces and motion along the drive's direction."""

    t: Array
    force: Array
    X: Array | None
    velocity: Array | None
    drive: Array | None
    attached: Array | None
    sign: float

    @classmethod
    def of(cls, data: xr.Dataset) -> Trace:
        """Take them from a Dataset; `InputError` if it holds no force, or values that are not finite."""
        instance("measure: data", data, xr.Dataset, "a Dataset, such as simulate() and read_trace() return")
        if "F_d" not in data or "t" not in data["F_d"].dims:
            raise InputError("measure: need a Dataset with the variable F_d along t; read a file with read_trace()")
        for name in ("t", "F_d", "X", "velocity", "drive_velocity", "attached"):
            if name in data:
                check_numbers("measure", data[name])
        t = np.asarray(data["t"].values, dtype=float)
        if t.size < FEWEST_READINGS:
            raise InputError(f"measure: {t.size} samples of F_d are too few to judge; {FEWEST_READINGS} is the least")
        if not np.all(np.isfinite(t)) or not np.all(np.diff(t) > 0):
            raise InputError("measure: the times t must be finite and rising")
        arrays = {
            name: np.asarray(data[name].values, dtype=float) if name in data else None
            for name in ("F_d", "X", "velocity", "drive_velocity", "attached")
        }
        for name, values in arrays.items():
            if values is None:
                continue
            if values.shape != t.shape:
                raise InputError(f"measure: {name} has shape {values.shape}: must be along t alone; select one run")
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise InputError(
                    f"measure: {name} = {values[bad[0]]:g} at t = {t[bad[0]]:g}: {bad.size} of {t.size} values are "
                    "not finite; drop or fill them first"
                )
        drive, force = arrays["drive_velocity"], arrays["F_d"]
        assert force is not None
        # A load cell may count pull as negative: then the force alone tells the direction.
        sign = -1.0 if np.mean(force if drive is None else drive) < 0 else 1.0
        return cls(
            t=t,
            force=sign * force,
            X=None if arrays["X"] is None else sign * arrays["X"],
            velocity=None if arrays["velocity"] is None else sign * arrays["velocity"],
            drive=None if drive is None else sign * drive,
            attached=arrays["attached"],
            sign=sign,
        )

    def part(self, begin: float) -> Trace:
        """What comes from a time on."""
        inside = self.t >= begin

        def cut(values: Array | None) -> Array | None:
            return None if values is None else values[inside]

        return Trace(
            t=self.t[inside],
            force=self.force[inside],
            X=cut(self.X),
            velocity=cut(self.velocity),
            drive=cut(self.drive),
            attached=cut(self.attached),
            sign=self.sign,
        )


def turns(force: Array, smallest: float) -> tuple[list[int], list[int]]:
    """Alternating peaks and troughs such that each fall and rise between them is at least `smallest`.

    Returns the falls only: index of the peak and index of the trough.
    """
    change = np.sign(np.diff(force))
    moving = np.flatnonzero(change)
    if moving.size == 0:
        return [], []
    sign = change[moving]
    where = np.concatenate([[0], moving[np.flatnonzero(sign[1:] != sign[:-1])] + 1, [moving[-1] + 1]])
    index, value = where.tolist(), force[where].tolist()
    peaks: list[int] = []
    troughs: list[int] = []
    high = low = 0
    direction = 0
    for i in range(1, len(index)):
        here = value[i]
        if direction >= 0 and here > value[high]:
            high = i
        if direction <= 0 and here < value[low]:
            low = i
        if direction >= 0 and value[high] - here >= smallest:
            peaks.append(index[high])
            direction, low = -1, i
        elif direction <= 0 and here - value[low] >= smallest:
            if direction < 0:
                troughs.append(index[low])
            direction, high = 1, i
    if len(troughs) < len(peaks):
        troughs.append(index[low])
    return peaks, troughs
