"""The motion of a slider from the slope of the spring force: a slider that is held
loads the spring at the full rate, stiffness times drive velocity.
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
    STEADY_DEVIATION,
    STUCK_SPEED,
    STUCK_TIME,
    Array,
    Trace,
    mean_and_std,
)
from stickslip.model.quantities import read_value
from stickslip.words import engineering

if TYPE_CHECKING:
    import xarray as xr

_STEADY = 1e-3  # relative change at which an iterated rate has converged
# Error of a slope over the loading rate: slopes are taken over as many samples as this
# needs, and no more.
SLOPE_ERROR = 0.1
# A slider that sticks and slips is stuck for at least this fraction of the time, and
# deviates (rms) from the drive velocity by at least this fraction of it.
HALF = 0.5
# The time of a drop is taken between these fractions of its height: above and below
# them, the slider gets moving and comes to rest.
_UPPER = 0.75
_LOWER = 0.25
# fraction of half a cycle that a free oscillation spends between them
_BETWEEN = (math.acos(1.0 - 2.0 * _UPPER) - math.acos(1.0 - 2.0 * _LOWER)) / math.pi


def _slope_width(step: float, noise: float, rate: float) -> int:
    """Return the number of samples over which a least-squares slope has the error
    `SLOPE_ERROR` of the loading rate.
    """
    narrowest: float = (12.0 * (noise / (SLOPE_ERROR * rate * step)) ** 2) ** (1 / 3)
    return max(math.ceil(narrowest) | 1, 3)


def _slopes(force: Array, step: float, noise: float, rate: float) -> Array:
    """Return least-squares slopes of the force with an error of a tenth of the loading
    rate; empty if that takes more than a twelfth of the samples.
    """
    width = _slope_width(step, noise, rate)
    if 12 * width > force.size:
        return np.empty(0)
    return fitted_locally(force, width, 1, 1, step)


def _full_rate(force: Array, step: float, noise: float) -> float:
    """Return the loading rate of a force, the upper mode of its slopes; NaN if it is
    not found.
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
        near = found[np.abs(found - rate) < 0.25 * rate]
        rate = float(near.mean()) if near.size else rate
    return rate


def motion(
    data: xr.Dataset,
    *,
    stiffness: float | str,
    velocity: float | str,
    contacts: int | None = None,
) -> xr.Dataset:
    """Return a measured trace with the motion of its slider, from the force of a known
    spring.

    With a drive at velocity ``V`` and a spring of stiffness ``K`` the slider is at
    ``X = V t - F/K`` (`displacement`, in m), its velocity ``V - (dF/dt)/K``
    (`velocity`, beside `drive_velocity`, in m/s). Slopes are fitted by least squares to
    as many samples as give the velocity to a tenth of the drive's, so that faster
    motion is smoothed. `regime`, `drops` and pictures then know how fast the slider
    moves, as for a run. Raises `InputError` if the data already hold the motion, if
    the force has no unit of force, or if its noise hides the motion.

    Parameters
    ----------
    data : Dataset
        A measured trace, in units of force and time.
    stiffness, velocity : float or str
        Stiffness of everything that yields before the slider moves (the driving spring,
        machine and sensor, contacts that hold), and velocity of the drive: in N/m and
        m/s, or texts with a unit.
    contacts : int, optional
        Number of contacts: motion within their noise is no oscillation.

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
    """Return the size in SI units of the units of a force and of its times."""
    known = (trace.force_unit, "N"), (trace.time_unit, "s")
    return [ratio(unit or si, si) for unit, si in known]


def rms_velocity_deviation(trace: Trace) -> float:
    """Return the rms deviation of the slider's velocity from the drive's, over the
    drive's, without the error of slopes; NaN for a run, or if it is not known.
    """
    if trace.pace is None or not trace.measured:
        return math.nan
    return math.sqrt(max(float(np.mean((trace.pace - 1.0) ** 2)) - SLOPE_ERROR**2, 0.0))


def _half_cycle(trace: Trace, found: Slips) -> float:
    """Return half a period of the free oscillation that falls as fast as typical drops.

    NaN where its error, by the sampling or the scatter, exceeds an eighth: that of the
    mass would exceed a quarter.
    """
    halves = np.array([_fall_time(trace, found, i) for i in range(found.size)])
    halves /= _BETWEEN
    half = found.typical(halves)
    scatter = 1.4826 * found.typical(np.abs(halves - half))
    most = half / 8
    known = trace.step <= most and ERRORS * scatter <= most * math.sqrt(found.size)
    return half if known else math.nan


def _fall_time(trace: Trace, found: Slips, i: int) -> float:
    """Return the time that a drop spends between the levels `_LOWER` and `_UPPER`.

    It sums the pieces between samples, interpolated linearly, so that noise lengthens
    it as often as it shortens it.
    """
    slip = slice(found.peak[i], found.trough[i] + 1)
    height = (trace.force[slip] - found.after[i]) / found.drops[i]
    low = np.minimum(height[1:], height[:-1])
    high = np.maximum(height[1:], height[:-1])
    inside = np.clip(np.minimum(high, _UPPER) - np.maximum(low, _LOWER), 0.0, None)
    # a level piece is inside as a whole, or outside
    part = inside / np.maximum(high - low, 1e-9)
    part[(low == high) & (low > _LOWER) & (high < _UPPER)] = 1.0
    return float((part * np.diff(trace.t[slip])).sum())


@dataclass(frozen=True, kw_only=True, repr=False)
class Kinematics(Answer):
    """Motion of a slider, in units of its drive and in SI units."""

    mass: float  #: mass of the slider as given, in kg; NaN if none was given
    motion: str  #: the motion in words
    #: fraction of the time in which the slider is slower than a quarter of the drive
    stuck: float
    #: rms deviation of the slider's velocity from the drive's, over the drive's,
    #: without the error of slopes
    swing: float
    #: height of the autocorrelation of the velocity at one period; 0 without one
    correlation: float
    period: float  #: period of the motion, in s; NaN without one
    slips: int  #: number of force drops
    recurrence: float  #: mean time between them in s
    recurrence_variation: float  #: its coefficient of variation
    drop: float  #: mean drop over the stiffness, in m
    drop_variation: float  #: its coefficient of variation
    #: measured loading rate over stiffness times velocity: 1 for a slider that sticks,
    #: about .2 for one that never does; NaN where the force never rises
    loading: float
    #: mass, in kg, that oscillates on this spring as fast as the slips or the
    #: oscillation; NaN if unresolved
    effective_mass: float
    noise: float  #: noise of the sensor over the stiffness, in m
    #: number of samples left out as faults of the sensor, in all of the record
    spikes: int
    #: remarks on stiffness and velocity
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        lines = [f"the slider {self.motion}"]
        if self.slips > 1:
            drop = engineering(self.drop, "m", 3)
            wait = engineering(self.recurrence, "s", 3)
            lines.append(
                f"{self.slips} drops, slow ones included, of {drop} on average (CV "
                f"{self.drop_variation:.2g}), every {wait} (CV "
                f"{self.recurrence_variation:.2g})"
            )
        if math.isfinite(self.loading):
            lines.append(
                f"at its full rate the force rises at {self.loading:.2g} of stiffness "
                "times velocity (1 where it sticks)"
            )
        if math.isfinite(self.effective_mass):
            mass = engineering(1e3 * self.effective_mass, "g", 3)
            part = self.effective_mass / self.mass
            of = f", {part:.2g} of its mass" if math.isfinite(part) else ""
            lines.append(f"it moves as {mass} would on this spring{of}")
        noise = f"noise of the sensor: {engineering(self.noise, 'm', 2)} of the spring"
        if self.spikes:
            noise += f"; {self.spikes} spike{'s' * (self.spikes > 1)} left out"
        return "\n".join([*lines, noise, *(f"note: {note}" for note in self.notes)])


def _note_loading(loading: float) -> tuple[str, ...]:
    """Note a loading rate too high for a stuck slider, which moves forwards or
    backwards at less than a quarter of the drive velocity.
    """
    if not loading > 1.0 + STUCK_SPEED:
        return ()
    return (
        f"the force rises at {loading:.2g} of stiffness times velocity, too fast for a "
        "held slider: one of the two is too small",
    )


def kinematics(data: xr.Dataset, *, mass: float | str | None = None) -> Kinematics:
    """Return how a slider moves, from a trace that `motion` returned, or a part of it;
    `InputError` for other data.

    The `mass` of the slider, in kg or a text with a unit, is compared with the
    effective mass.

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
        word = "sticks and slips" if found.size else "sticks, and does not slip"
    elif swing < STEADY_DEVIATION:
        word = "moves evenly"
    elif cycles.periodic or is_regular:
        word = "oscillates"
    elif stuck > STUCK_TIME:
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
        f"of the time, rms deviation from the drive's velocity {swing:.2g} of it",
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
