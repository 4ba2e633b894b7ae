"""The motion of a slider by the slope of its force: a slider that is held loads the
spring at a full, known rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.answers import Answer
from stickslip.arrays import labelled
from stickslip.errors import InputError, whole
from stickslip.io.headings import ratio
from stickslip.measure.periods import REGULAR, find_cycles
from stickslip.measure.sensor import white_noise
from stickslip.measure.slips import Slips, find_slips, fitted_locally
from stickslip.measure.trace import (
    ERRORS,
    FEWEST_CYCLES,
    RESTS,
    Array,
    Trace,
    mean_and_std,
)
from stickslip.model.quantities import read_value
from stickslip.words import engineering

if TYPE_CHECKING:
    import xarray as xr

_STEADY = 1e-3  # relative change of a rate that is none
# error of a slope, over that of the loading: its window is as long as that takes, and
# no longer
SLOPE_ERROR = 0.1
# of the time, and times the drive: a slider that sticks and slips is stuck, and off the
# drive, by more
HALF = 0.5
# of a drop: above and below these parts of it, the slider gets moving and comes to rest
_UPPER = 0.75
_LOWER = 0.25
# part of a free oscillation's fall, half a cycle, between those
_BETWEEN = (math.acos(1.0 - 2.0 * _UPPER) - math.acos(1.0 - 2.0 * _LOWER)) / math.pi


def _slope_width(step: float, noise: float, rate: float) -> int:
    """Samples over which a slope is known to a part `SLOPE_ERROR` of the loading rate,
    by least squares.
    """
    narrowest: float = (12.0 * (noise / (SLOPE_ERROR * rate * step)) ** 2) ** (1 / 3)
    return max(math.ceil(narrowest) | 1, 3)


def _slopes(force: Array, step: float, noise: float, rate: float) -> Array:
    """Return slopes by least squares over as many samples as give the loading rate to
    a tenth; none if that takes more than a twelfth of all.
    """
    width = _slope_width(step, noise, rate)
    if 12 * width > force.size:
        return np.empty(0)
    return fitted_locally(force, width, 1, 1, step)


def _full_rate(force: Array, step: float, noise: float) -> float:
    """Rate at which a force rises at its fullest, the upper mode of its slopes; NaN
    where that is not seen.
    """
    rate = math.inf
    for _ in range(20):
        before = rate
        found = _slopes(force, step, noise, rate)
        rate = np.quantile(found, 0.9) if found.size else 0.0
        if not rate > 0:
            return math.nan
        if abs(rate - before) <= _STEADY * rate:
            break
    for _ in range(20):
        near = found[np.abs(found - rate) < RESTS * rate]
        rate = float(near.mean()) if near.size else rate
    return rate


def motion(
    data: xr.Dataset,
    *,
    stiffness: float | str,
    velocity: float | str,
    contacts: int | None = None,
) -> xr.Dataset:
    """Return a measured trace with the motion of its slider, which the force of a known
    spring shows.

    With a drive at velocity ``V`` and a spring of stiffness ``K`` the slider is at
    ``X = V t - F/K`` (`displacement`, in m), its velocity ``V - (dF/dt)/K``
    (`velocity`, beside `drive_velocity`, in m/s). Slopes are read by least squares over
    as many samples as give the velocity to a tenth of the drive's, so that faster
    motion is smoothed. `regime`, `drops` and pictures then know how fast the slider
    moves, as they do of a run. Raises `InputError` if the data know the motion already,
    or the force is no force, or its noise hides the motion.

    Parameters
    ----------
    data : Dataset
        A measured trace, in units of force and time.
    stiffness, velocity : float or str
        Of all that gives way before the slider moves (the driving spring, machine and
        sensor, contacts that are held), and of the drive: in N/m and m/s, or texts with
        a unit.
    contacts : int, optional
        Their number: motion within their noise is no oscillation.

    Examples
    --------
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> trace = xr.Dataset(
    ...     {"spring_force": ("time", 3.0 + 2.0 * (t % 1.5), {"units": "N"})},
    ...     {"time": t},
    ... )
    >>> moving = ss.measure.motion(trace, stiffness="20 N/mm", velocity="0.1 mm/s")
    >>> round(float(moving["velocity"].median()), 6)  # held, most of the time
    0.0
    """
    trace = Trace.of(data)
    if trace.drive is not None or trace.velocity is not None:
        raise InputError(
            "motion: the data know the motion of the slider: leave out stiffness and "
            "velocity"
        )
    K = read_value("stiffness", stiffness, "N/m", "350 N/m")
    V = read_value("velocity", velocity, "m/s", "0.1 mm/s")
    newton, second = _units_of(trace)
    if not newton or not second:
        raise InputError(
            f"motion: spring_force is in {trace.force_unit!r} and time in "
            f"{trace.time_unit!r}: must be units of force and of time; read the force, "
            "not a coefficient"
        )
    step = trace.step
    even = trace.t[0] + step * np.arange(trace.t.size)
    rate = K * V * second / newton
    noise = white_noise(trace.force)
    slope = _slopes(
        np.interp(even, trace.t, trace.force),
        step,
        noise,
        rate,
    )
    if not slope.size:
        raise InputError(
            f"motion: noise of {noise:.3g} {trace.force_unit or 'N'} hides the loading "
            f"by {1e6 * V:.4g} um/s for a twelfth of the record; record longer, or "
            "with less noise"
        )
    travel = V * second * (trace.t - trace.t[0])
    stretch = (trace.force - trace.force[0]) * newton / K
    pace = 1.0 - np.interp(trace.t, even, slope) / rate
    moves = {
        "displacement": ("displacement of the slider", travel - stretch, "m"),
        "velocity": ("velocity of the slider", V * pace, "m/s"),
        "drive_velocity": ("velocity of the drive", np.full_like(pace, V), "m/s"),
    }
    if contacts is not None:
        count = whole("contacts", contacts, at_least=1)
        data = data.assign_attrs(contacts=count)
    window = step * _slope_width(step, noise, rate)
    return data.assign_attrs(stiffness=K, full_rate=rate, slope_window=window).assign(
        {
            name: labelled(
                title,
                "time",
                trace.sign * values,
                unit,
            )
            for name, (title, values, unit) in moves.items()
        }
    )


def _units_of(trace: Trace) -> list[float | None]:
    """The units of a force and of its times in SI units."""
    known = (trace.force_unit, "N"), (trace.time_unit, "s")
    return [ratio(unit or si, si) for unit, si in known]


def rms_velocity_deviation(trace: Trace) -> float:
    """Rms difference of the velocities of slider and drive of a bench, over that of
    the drive, less the error of slopes; NaN if unknown.
    """
    if trace.pace is None or not trace.measured:
        return math.nan
    return math.sqrt(max(float(np.mean((trace.pace - 1.0) ** 2)) - SLOPE_ERROR**2, 0.0))


def _half_cycle(trace: Trace, found: Slips) -> float:
    """Half a cycle of the free oscillation that falls as fast as typical drops do; NaN
    where samples or scatter leave more than an eighth of it open, and so a quarter of
    the mass.
    """
    halves = np.array([_fall_time(trace, found, i) for i in range(found.size)])
    halves /= _BETWEEN
    half = found.typical(halves)
    scatter = 1.4826 * found.typical(np.abs(halves - half))
    most = 0.5 * RESTS * half
    known = trace.step <= most and ERRORS * scatter <= most * math.sqrt(found.size)
    return half if known else math.nan


def _fall_time(trace: Trace, found: Slips, i: int) -> float:
    """Time that a drop spends between two levels: of straight lines from sample to
    sample, so that noise adds to it as often as it takes away.
    """
    slip = slice(found.peak[i], found.trough[i] + 1)
    height = (trace.force[slip] - found.after[i]) / found.drops[i]
    low = np.minimum(height[1:], height[:-1])
    high = np.maximum(height[1:], height[:-1])
    inside = np.clip(np.minimum(high, _UPPER) - np.maximum(low, _LOWER), 0.0, None)
    # a line that is level is within, or not
    part = inside / np.maximum(high - low, 1e-9)
    part[(low == high) & (low > _LOWER) & (high < _UPPER)] = 1.0
    return float((part * np.diff(trace.t[slip])).sum())


@dataclass(frozen=True, kw_only=True, repr=False)
class Kinematics(Answer):
    """Motion of a slider, in units of its drive and in SI units."""

    mass: float  #: the given one, in kg; NaN without
    motion: str  #: in words
    #: fraction of the time in which the slider is slower than a quarter of the drive
    stuck: float
    #: rms difference of the velocities of slider and drive, over that of the drive,
    #: less the error of slopes
    swing: float
    #: height of the autocorrelation of the velocity at one period; 0 without one
    correlation: float
    period: float  #: in s; NaN without one
    slips: int  #: number of force drops
    recurrence: float  #: mean time between them in s
    recurrence_variation: float  #: its coefficient of variation
    drop: float  #: mean drop in m (over the stiffness)
    drop_variation: float  #: its coefficient of variation
    #: full rate of the force over stiffness times velocity: 1 of a slider that sticks,
    #: .2 if never
    loading: float
    #: in kg: that this spring moves as quickly as slips or oscillation go; NaN if
    #: unresolved
    effective_mass: float
    noise: float  #: of the sensor, in m of the spring
    #: samples that were left out as faults of the sensor, in all of the record
    spikes: int
    #: remarks on stiffness and velocity
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        lines = [f"the slider {self.motion}"]
        if self.slips > 1:
            drop = engineering(self.drop, "m", 3)
            wait = engineering(self.recurrence, "s", 3)
            lines.append(
                f"{self.slips} drops, slow ones too, of {drop} on average (CV "
                f"{self.drop_variation:.2g}), every {wait} (CV "
                f"{self.recurrence_variation:.2g})"
            )
        lines.append(
            f"at its full rate the force rises at {self.loading:.2g} of stiffness "
            "times velocity (1 where it sticks)"
        )
        if math.isfinite(self.effective_mass):
            mass = engineering(1e3 * self.effective_mass, "g", 3)
            part = self.effective_mass / self.mass
            of = f", {part:.2g} of what it weighs" if math.isfinite(part) else ""
            lines.append(f"it moves as {mass} would on this spring{of}")
        noise = f"noise of the sensor: {engineering(self.noise, 'm', 2)} of the spring"
        if self.spikes:
            noise += f"; {self.spikes} spike{'s' * (self.spikes > 1)} left out"
        return "\n".join([*lines, noise, *(f"note: {note}" for note in self.notes)])


def _note_loading(loading: float) -> tuple[str, ...]:
    """Note a full rate that no slider makes which is stuck: it is slower than a quarter
    of the drive, there and back.
    """
    if not loading > 1.0 + RESTS:
        return ()
    return (
        "no slider that is held loads its spring so fast, at "
        f"{loading:.2g} of stiffness times velocity: one of them is too small",
    )


def kinematics(data: xr.Dataset, *, mass: float | str | None = None) -> Kinematics:
    """Return how a slider moves, from a trace with the motion that `motion` found, or a
    part of it; else `InputError`.

    The effective mass is compared with the `mass` of the slider, in kg, or a text with
    a unit.

    Examples
    --------
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> trace = xr.Dataset(
    ...     {"spring_force": ("time", 3.0 + 2.0 * (t % 1.5), {"units": "N"})},
    ...     {"time": t},
    ... )
    >>> seen = ss.measure.kinematics(
    ...     ss.measure.motion(trace, stiffness="20 N/mm", velocity="0.1 mm/s")
    ... )
    >>> seen.motion[:16], round(seen.stuck, 2), round(seen.loading, 2)
    ('sticks and slips', 0.99, 1.0)
    """
    trace = Trace.of(data)
    pace = trace.pace
    stuck = trace.stuck
    drive = trace.drive
    stiffness = data.attrs.get("stiffness")
    if stiffness is None or pace is None or stuck is None or drive is None:
        raise InputError(
            "kinematics: needs a trace with the motion of its slider, as motion() "
            "returns it"
        )
    swing = rms_velocity_deviation(trace)
    newton, second = (unit or 1.0 for unit in _units_of(trace))
    metre = newton / float(stiffness)
    found = find_slips(trace)
    wait, _, of_waits = mean_and_std(found.waits)
    drop, _, of_drops = mean_and_std(found.drops)
    half = _half_cycle(trace, found)
    cycles = find_cycles(trace.t, pace)
    is_regular = found.size > FEWEST_CYCLES and of_waits < REGULAR
    if stuck >= HALF and swing >= HALF:
        word = "sticks and slips"
    elif swing < RESTS:
        word = "moves evenly"
    elif cycles.periodic or is_regular:
        word = "oscillates"
    elif stuck > RESTS:
        word = "stops and goes, without a period"
    else:
        word = "moves unevenly, without stops"
    full = _full_rate(trace.force, trace.step, found.noise)
    V = float(np.median(drive))
    loading = full * metre / second / V
    period = math.nan
    if word == "oscillates":
        period = second * (cycles.period if cycles.periodic else wait)
    mass_that_moves = math.nan
    if word in ("sticks and slips", "oscillates"):
        mass_that_moves = stiffness * (second * half / math.pi) ** 2
    return Kinematics(
        mass=math.nan if mass is None else read_value("mass", mass, "kg", "75.6 g"),
        motion=f"{word}: slower than a quarter of the drive for {100.0 * stuck:.3g} % "
        f"of the time, {swing:.2g} times the drive's velocity off that (rms)",
        stuck=stuck,
        swing=swing,
        correlation=cycles.correlation,
        period=period,
        slips=found.size,
        recurrence=second * wait,
        recurrence_variation=of_waits,
        drop=drop * metre,
        drop_variation=of_drops,
        loading=loading,
        effective_mass=mass_that_moves,
        noise=found.noise * metre,
        spikes=int(data.attrs.get("spikes", 0)),
        notes=_note_loading(loading),
    )
