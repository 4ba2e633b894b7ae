"""The arrays of a measured or simulated force trace, and statistics of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.special import ndtr

from stickslip.arrays import Array as Array
from stickslip.arrays import Range, units_of
from stickslip.errors import SMALLEST, InputError, extreme, printable, whole
from stickslip.io.table_text import FEWEST_READINGS as FEWEST_READINGS
from stickslip.measure.sensor import resolution
from stickslip.model import Rig
from stickslip.model.methods import DRAWN

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from stickslip.simulation.run import Recording

FEWEST_CYCLES = 4  # complete cycles needed to speak of a period
ERRORS = 3.0  # a difference of more standard errors than this is significant ...
CHANCE = float(ndtr(-ERRORS))  # ... and the probability of one by chance
STUCK_SPEED = 0.25  # a slider slower than this fraction of the drive velocity is stuck
# A slider that is stuck for at least this fraction of the time sticks: one that just
# comes to rest in a sinusoidal motion is stuck for arccos(3/4)/pi = .23 of it.
STUCK_TIME = 0.25
# A slider whose velocity deviates from that of the drive by less than this fraction of
# it (rms) moves steadily.
STEADY_DEVIATION = 0.25
SAME_SPEED = 0.25  # relative difference below which two speeds are taken as equal
# relative change of the drive's velocity that still counts as constant
CONSTANT_DRIVE = 0.01
# Times of a measured trace that begin this many trace lengths after zero count from an
# origin such as 1970: differences between them would lose digits.
_FAR = 10.0
_VARIABLES = {
    "t": "time",
    "force": "spring_force",
    "X": "displacement",
    "velocity": "velocity",
    "drive": "drive_velocity",
    "displacement": "measured_displacement",
    "part_number": "part",
    "measured_velocity": "measured_velocity",
}


def check_numbers(place: str, variable: xr.DataArray) -> None:
    """Raise `InputError` if a variable does not hold numbers, or holds numbers too
    large or too small to be multiplied.
    """
    if variable.dtype.kind not in "fiu":
        raise InputError(
            f"{place}: {variable.name} holds values of type {variable.dtype}, no "
            "numbers"
        )
    values = np.asarray(variable.values, dtype=float)
    largest = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))
    if refusal := extreme(largest):
        raise InputError(f"{place}: {variable.name} = {largest:g}: {refusal}")


def dataset_of(data: xr.Dataset | xr.DataArray | pd.Series) -> xr.Dataset:
    """Return the data as a Dataset with a force along time; a force alone becomes one,
    and dates become seconds.

    Times of a trace that count from long before it, such as from 1970, are shifted to
    start at its first reading. Times of a run are left alone: its drive refers to them.
    """
    import pandas as pd
    import xarray as xr

    if isinstance(data, pd.Series) and not isinstance(data.index, pd.RangeIndex):
        data = data.rename_axis("time").to_xarray()
    if (
        isinstance(data, xr.DataArray)
        and data.ndim == 1
        and {*data.dims} <= {*data.coords}
    ):
        data = data.rename({data.dims[0]: "time"}).to_dataset(name="spring_force")
    if not isinstance(data, xr.Dataset):
        raise InputError(
            "measure: data must be a Dataset, as read_trace() returns, or a force with "
            "its times"
        )
    time = data.coords.get("time", xr.DataArray(0))
    if time.ndim != 1 or time.size < 2:
        return data
    times = time.values
    attrs = time.attrs
    if time.dtype.kind in "mM":
        times = (times - times[0]) / np.timedelta64(1, "s")
        attrs = {"units": "s", "long_name": "time"}
    elif time.dtype.kind in "fiu" and "drive_velocity" not in data:
        first = float(times[0])
        length = float(times[-1]) - first
        if math.isfinite(first) and abs(first) > _FAR * length > 0.0:
            times = (times - times[0]).astype(float)
    return data.assign_coords(time=("time", times, attrs))


def _along_time(data: xr.Dataset, name: str) -> Array:
    """Return the values of a variable along time, averaged over the blocks of a slider;
    `InputError` if some are not finite.
    """
    along = data[name]
    check_numbers("measure", along)
    if "block" in along.dims:
        along = along.mean("block")
    if along.dims != ("time",):
        raise InputError(
            f"measure: {name} has shape {along.shape}: must be along time alone; "
            "select one run"
        )
    values = np.asarray(along.values, dtype=float)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        first = f"{name} = {values[bad[0]]:g} at t = {float(data['time'][bad[0]]):g}"
        raise InputError(
            f"measure: {first}: {bad.size} of {values.size} are not finite; drop or "
            "fill them first"
        )
    return values


@dataclass(frozen=True, kw_only=True)
class Trace:
    """The arrays of a Dataset; forces and motion are along the direction of the
    drive.
    """

    t: Array
    force: Array
    sign: float
    # largest force in all of the data: the static friction, if they hold a slip or the
    # first loading
    largest: float
    reading_step: float = 0.0  # of the values that a sensor records, in all of the data
    X: Array | None = None
    velocity: Array | None = None
    drive: Array | None = None
    displacement: Array | None = None
    part_number: Array | None = None
    measured_velocity: Array | None = None  # of the drive, as measured beside the force
    rig: Rig | None = None
    contacts: int | None = None  # number of contacts, where it is known
    measured: bool = False  # measured by a sensor with noise; False for a simulated run
    time_unit: str = ""
    force_unit: str = ""
    velocity_unit: str = ""
    quantity: str = "force"
    # for a known spring and drive: loading rate of a held slider, and the time over
    # which the slope of the force was taken to obtain the velocity of the slider
    full_rate: float | None = None
    slope_window: float = 0.0

    @classmethod
    def of(cls, data: xr.Dataset | xr.DataArray | pd.Series) -> Self:
        """Make a trace of a Dataset; `InputError` if it holds no force, or values that
        are not finite.
        """
        data = dataset_of(data)
        if "spring_force" not in data or "time" not in data["spring_force"].dims:
            raise InputError(
                "measure: need the variable spring_force along time; read a file with "
                "read_trace()"
            )
        arrays = {
            key: _along_time(data, name)
            for key, name in _VARIABLES.items()
            if name in data
        }
        _check_times(arrays["t"])
        force = arrays["force"]
        drive = arrays.get("drive")
        # A load cell may count pull as negative: then the sign of the force shows the
        # direction, unless the user has flipped it. A force that goes well above and
        # below zero has lost its mean, so its sign shows nothing.
        backwards = (
            not data.attrs.get("flipped")
            and np.mean(force) < 0
            and -np.min(force) > 3.0 * np.max(force)
        )
        if drive is not None:
            backwards = np.mean(drive) < 0
        sign = -1.0 if backwards else 1.0
        arrays |= _along_drive(arrays, sign)
        measured = drive is None or "stiffness" in data.attrs
        moves = arrays.get("measured_velocity")
        if moves is not None and drive is None and _is_of_the_slider(moves, force):
            mean = float(arrays.pop("measured_velocity").mean())
            arrays["velocity"] = math.copysign(1.0, mean) * moves
            arrays["drive"] = np.full(force.size, abs(mean))
        rig = None
        contacts = data.attrs.get("contacts")
        if "provenance" in data.attrs:
            # imports all engines, which no measured trace needs
            from stickslip.simulation import rig_of

            with suppress(InputError):  # not every run records its rig
                rig = rig_of(data)
        if rig is not None:
            contacts = _contacts_of(rig) or contacts
        return cls(
            **arrays,
            sign=sign,
            largest=float(np.max(np.abs(force))),
            reading_step=resolution(force) if measured else 0.0,
            rig=rig,
            contacts=None
            if contacts is None
            else whole("measure: contacts", contacts, at_least=1, hint="their number"),
            measured=measured,
            full_rate=data.attrs.get("full_rate"),
            slope_window=data.attrs.get("slope_window", 0.0),
            time_unit=printable(units_of(data["time"])),
            force_unit=printable(units_of(data["spring_force"])),
            velocity_unit=printable(units_of(data.get("measured_velocity"))),
            quantity=next(
                (
                    name
                    for name in ("coefficient of friction", "torque")
                    if name in str(data["spring_force"].attrs.get("long_name", ""))
                ),
                "force",
            ),
        )

    @classmethod
    def of_run(cls, run: Recording) -> Self:
        """Make a trace of the recording of an engine: the same as `of` makes of its
        Dataset.
        """
        series = run.series(_VARIABLES.values())
        arrays: dict[str, Any] = {
            key: series[name] for key, name in _VARIABLES.items() if name in series
        }
        _check_times(arrays["t"])
        sign = -1.0 if np.mean(arrays["drive"]) < 0 else 1.0
        arrays |= _along_drive(arrays, sign)
        return cls(
            **arrays,
            sign=sign,
            largest=float(np.max(np.abs(arrays["force"]))),
            rig=run.rig,
            contacts=_contacts_of(run.rig),
            time_unit=run.rig.unit_name("time"),
            force_unit=run.rig.unit_name("f_s"),
        )

    @cached_property
    def steady_load_from(self) -> float:
        """Time from which the normal load of a run is constant."""
        if self.rig is None or not self.rig.drive.load:
            return -math.inf
        return self.rig.drive.load[-1].time * self.rig.unit("time")

    @property
    def length(self) -> float:
        """Time from the first reading to the last."""
        return float(self.t[-1] - self.t[0])

    @property
    def step(self) -> float:
        """Mean sampling interval."""
        return self.length / (self.t.size - 1)

    @cached_property
    def rise(self) -> float:
        """Rise, over the length of the trace, of the line fitted to the force."""
        return slope(self.force, self.t) * self.length

    @property
    def without_line(self) -> Array:
        """The force less the line fitted to it, about the same mean."""
        line = slope(self.force, self.t) * (self.t - self.t.mean())
        return np.asarray(self.force - line)

    @cached_property
    def residual(self) -> Array:
        """The force without its drift."""
        return without_drift(self.force)

    @cached_property
    def clock(self) -> Array:
        """Times or, where the velocity of the drive was measured, its travel over its
        mean velocity: against that, the loading rate is constant.
        """
        if self.measured_velocity is None:
            return self.t
        speed = np.abs(self.measured_velocity)
        travel = cumulative_trapezoid(speed, self.t, initial=0)
        return self.length / travel[-1] * travel if travel[-1] > 0.0 else self.t

    @cached_property
    def peaks(self) -> Array | None:
        """Least value of the largest velocity of the slider since the reading before;
        None where it is not known.
        """
        if self.velocity is None or self.X is None or self.measured:
            return self.velocity
        # A slip between two readings is at least as fast as their mean velocity.
        mean = np.diff(self.X) / np.diff(self.t)
        return np.append(self.velocity[0], np.maximum(self.velocity[1:], mean))

    @cached_property
    def pace(self) -> Array | None:
        """Velocity of the slider over the median velocity of the drive; None where it
        is not known.
        """
        drive = self._usual_drive
        return self.velocity / drive if self.velocity is not None and drive else None

    @property
    def largest_velocity(self) -> float | None:
        """Largest velocity of the slider over the median velocity of the drive; None
        where it is not known.
        """
        drive = self._usual_drive
        if self.peaks is None or not drive:
            return None
        return float(self.peaks.max()) / drive

    @property
    def _usual_drive(self) -> float:
        """Median velocity of the drive; 0 where it is not known."""
        return 0.0 if self.drive is None else float(np.median(self.drive))

    @property
    def speeds(self) -> Range | None:
        """Speed of the drive at the beginning and at the end; None where it was not
        measured.
        """
        if self.measured_velocity is None:
            return None
        speed = np.abs(self.measured_velocity)
        first = np.median(speed[:FEWEST_READINGS])
        last = np.median(speed[-FEWEST_READINGS:])
        return float(first), float(last)

    @property
    def stuck(self) -> float | None:
        """Fraction of the time in which the slider is slower than a quarter of the
        drive; None where its velocity is not known.
        """
        return None if self.pace is None else float(np.mean(self.pace < STUCK_SPEED))

    @property
    def gaps(self) -> NDArray[np.intp]:
        """Last samples before a gap or before the next part of a record.

        A gap is a time step of more than 16 times (the fewest readings of a verdict)
        the steps on either side of it.
        """
        step = np.diff(self.t)
        ends = np.zeros(step.size, dtype=bool)
        ends[1:-1] = step[1:-1] > FEWEST_READINGS * np.maximum(step[:-2], step[2:])
        if self.part_number is not None:
            ends |= np.diff(self.part_number) != 0.0
        return np.flatnonzero(ends)

    @property
    def stretches(self) -> list[Self]:
        """Parts of the trace between gaps, and the parts of a record, in order."""
        return [
            self.part(*ends)
            for ends in pairwise([self.t[0], *self.t[self.gaps + 1], math.inf])
        ]

    def part(self, begin: float, end: float = math.inf) -> Self:
        """Return the trace between two times."""
        inside = slice(*np.searchsorted(self.t, [begin, end], side="left").tolist())
        known = {
            name: values[inside]
            for name in _VARIABLES
            if (values := getattr(self, name)) is not None
        }
        return replace(self, **known)


def _check_times(t: Array) -> None:
    """Raise `InputError` if there are too few readings, or their times do not rise."""
    if t.size < FEWEST_READINGS:
        raise InputError(
            f"measure: {t.size} samples of spring_force are too few: "
            f"{FEWEST_READINGS} is the least; record longer, or sample a run more "
            "often (simulation.interval) or for longer (drive.distance)"
        )
    if not (np.all(np.diff(t) > 0) and t[-1] - t[0] >= SMALLEST):
        raise InputError(
            f"measure: the times must be rising over {SMALLEST:g}, in another unit "
            "if need be"
        )


def _along_drive(arrays: Mapping[str, Any], sign: float) -> dict[str, Array]:
    """Return force and motion counted positive in the direction of the drive."""
    turned = {"force", "X", "velocity", "drive"} & arrays.keys()
    return {key: sign * arrays[key] for key in turned}


def _contacts_of(rig: Rig) -> int | None:
    """Return the number of contacts that a rig draws; None if its method draws none."""
    if not isinstance(rig.method, DRAWN):
        return None
    return rig.method.count * int(getattr(rig.slider, "size", 1))


def _is_of_the_slider(velocity: Array, force: Array) -> bool:
    """Whether a velocity is that of the slider rather than of the drive: then most of
    its variation is the rate at which the spring force falls.
    """
    count = (velocity.size - 1) // FEWEST_READINGS
    if count < FEWEST_READINGS:
        return False
    means = np.array(
        [
            each[: count * FEWEST_READINGS].reshape(count, -1).mean(axis=1)
            for each in (0.5 * (velocity[1:] + velocity[:-1]), np.diff(force))
        ]
    )
    if not means.std(axis=1).all():
        return False
    return bool(np.corrcoef(means)[0, 1] < -math.sqrt(0.5))


def without_drift(values: Array) -> Array:
    """Return evenly spaced samples without their linear trend and without waves of
    fewer than four cycles, which cannot be distinguished from a drift.
    """
    count = values.size
    at = np.arange(count) - 0.5 * (count - 1)  # sample number from the middle
    rest = values - values.mean()
    # the sum of the squares of `at` is count (count^2 - 1)/12
    rise = 12.0 * np.einsum("i,i->", at, rest) / (count * (count**2 - 1.0))
    work = np.multiply(rise, at)
    rest -= work
    # Remove the slowest cosines, which are orthogonal, each computed from the two
    # before (Chebyshev). A Fourier transform and its inverse would do the same, but
    # take twenty times as long where a large prime divides the length. Arrays are
    # overwritten, as allocating new ones costs more than the sums.
    wave = np.cos(np.pi / count * (at + 0.5 * count))
    twice = np.multiply(2.0, wave, out=at)
    before = np.ones(count)
    for _ in range(1, 2 * FEWEST_CYCLES):
        height = 2.0 / count * np.einsum("i,i->", rest, wave)
        rest -= np.multiply(height, wave, out=work)
        after = np.subtract(np.multiply(twice, wave, out=work), before, out=before)
        before = wave
        wave = after
    return np.asarray(rest)


def slope(values: Array, at: Array) -> float:
    """Return the least-squares slope of values.

    It uses sums, as dot products of long vectors would start the threads of BLAS.
    """
    at = at - at.mean()
    return float((at * (values - values.mean())).sum()) / float((at * at).sum())


def neighbour_correlation(residual: Array) -> float:
    """Return the correlation of neighbouring residuals, 0 to 1."""
    power = float(residual @ residual)
    return max(float(residual[1:] @ residual[:-1]) / power, 0.0) if power > 0 else 0.0


def independent(residual: Array, least: float = 1.0) -> float:
    """Return the effective number of independent residuals, at least `least`:
    ``n (1 - r)/(1 + r)`` with the correlation `r` of neighbours (Bartlett).
    """
    r = neighbour_correlation(residual)
    return max(residual.size * (1.0 - r) / (1.0 + r), least)


def mean_and_std(values: Array) -> tuple[float, float, float]:
    """Return mean, sample standard deviation and coefficient of variation of the finite
    values.
    """
    kept = values[np.isfinite(values)]
    mean = float(kept.mean()) if kept.size else math.nan
    std = float(kept.std(ddof=1)) if kept.size > 1 else math.nan
    return mean, std, std / abs(mean) if mean else math.nan
