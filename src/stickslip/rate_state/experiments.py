"""The two experiments as they are read: a velocity step cut out of a run or a trace,
and healing after holds.
"""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from stickslip.answers import Answer
from stickslip.errors import InputError, instance, number, whole
from stickslip.measure.trace import Array

_FRICTIONS = ("mu", "spring_force", "friction_force", "friction")
"""Variables that may hold the friction, in the order in which they are looked for."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """A velocity step as it is fitted: friction over the displacement of the load
    point, 0 at the step.
    """

    displacement: Array  #: in bins, rising
    friction: Array
    before: float  #: velocity of the load point before the step
    after: float  #: and after it
    at: float = 0.0  #: time at which it was expected
    #: whether the displacement was measured; else it is the velocities times the time
    measured: bool = True
    length_unit: str = ""  #: of the data; empty where it has none
    time_unit: str = ""
    friction_unit: str = ""

    @property
    def ratio(self) -> float:
        """Ratio of the velocities."""
        return self.after / self.before

    @property
    def stretch(self) -> float:
        """Displacement before the given time, if the step came
        earlier: it went on at another speed.
        """
        return 1.0 if self.measured else self.ratio

    @property
    def near(self) -> float:
        """How far off the given time the step is looked for: as far as there is data
        before, and half of that after.
        """
        end = float(self.displacement.max())
        return float(
            np.clip(-self.displacement.min() * self.stretch, 1e-9 * end, 0.5 * end)
        )

    def since(self, late: float, displacement: Array | None = None) -> Array:
        """Displacement since the step, if that came later by some displacement than
        was given.
        """
        x = self.displacement if displacement is None else displacement
        return np.where(x < 0, self.stretch, 1.0) * x - late

    def level(self, late: float = 0.0) -> float:
        """Friction before the step, if that came later by some displacement."""
        before = self.friction[self.since(late) <= 0]
        return float(np.median(before) if before.size else self.friction[0])


def velocity_step_in(
    data: xr.Dataset,
    *,
    at: float | None,
    before: float | None,
    after: float | None,
    span: tuple[float, float] | None = None,
    bins: int = 800,
) -> Step:
    """Cut a velocity step out of a run or a measured trace, in bins of displacement.

    Parameters
    ----------
    data : Dataset
        As `read_trace` or a run gives it: ``mu``, ``spring_force``, ``friction_force``
        or ``friction`` along ``time``. The displacement of the load point is
        ``measured_displacement`` or ``displacement`` (of a run that is the slider's,
        and is not used), else the velocities times the time.
    at : float
        Time of the step, in the unit of time of the data.
    before, after : float
        Velocities of the load point, in displacement per time of the data.
    span : (float, float), optional
        How much displacement before and after the step; by default all there is after
        it, and a tenth of that before.
    bins : int
        Into how many bins of equal displacement the data is averaged, at most.

    Raises
    ------
    InputError
        If there is no such variable, or less than 30 samples after the step.

    Examples
    --------
    >>> from stickslip.rate_state import velocity_step_in
    >>> time = np.linspace(-5.0, 20.0, 251)
    >>> trace = xr.Dataset(
    ...     {"friction": ("time", 0.6 + 0.01 * (time > 0))}, coords={"time": time}
    ... )
    >>> step = velocity_step_in(trace, at=0.0, before=1.0, after=3.0)
    >>> float(step.displacement.max()), step.measured
    (60.0, False)
    """
    instance(
        "velocity_step_in: data",
        data,
        xr.Dataset,
        "a Dataset, as read_trace() returns it",
    )
    name = next((one for one in _FRICTIONS if one in data), None)
    if name is None or "time" not in data.coords:
        raise InputError(
            "data: holds no friction along a time; it must have one of "
            f"{', '.join(_FRICTIONS)}"
        )
    time = data["time"].values.astype(float)
    at = number(
        "at",
        at,
        at_least=float(time[0]),
        at_most=float(time[-1]),
        hint="time of the step",
    )
    before = number("before", before, above=0, hint="velocity before the step")
    after = number("after", after, above=0, hint="velocity after the step")
    if before == after:
        raise InputError(
            f"after = {after:g}: equals the velocity before the step; give another one"
        )
    names = (
        ("measured_displacement",)
        if "velocity" in data
        else ("measured_displacement", "displacement")
    )
    along = next((one for one in names if one in data), None)
    if along is None:
        x = np.where(time < at, before, after) * (time - at)
    else:
        place = data[along].values.astype(float)
        x = place - float(np.interp(at, time, place))
    rows = pd.DataFrame({"x": x, "friction": data[name].values.astype(float)})
    rows = rows[np.isfinite(rows).all(axis=1)]
    back, forth = span or (0.1 * float(rows.x.max()), float(rows.x.max()))
    rows = rows[rows.x.between(-back, forth)]
    if (later := int((rows.x > 0).sum())) < 30:
        raise InputError(
            f"at = {at:g}: {later} samples after the step; there must be at least 30"
        )
    count = min(whole("bins", bins, at_least=30, at_most=100_000), len(rows))
    held = rows.groupby(pd.cut(rows.x, count, right=False, labels=False)).mean()
    length, clock, unit = (
        str(data[one].attrs.get("units", "")) if one else ""
        for one in (along, "time", name)
    )
    return Step(
        displacement=held.x.values,
        friction=held.friction.values,
        before=before,
        after=after,
        at=at,
        measured=along is not None,
        length_unit=length,
        time_unit=clock,
        friction_unit=unit.removeprefix("1"),
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Healing(Answer):
    """Peaks after holds and their growth, in the units of the run."""

    hold: tuple[float, ...]  #: times of rest, rising
    #: as `slide_hold_slide` gives them, one for each hold
    relaxation: tuple[float, ...]
    peak: tuple[float, ...]
    slip_to_peak: tuple[float, ...]
    #: growth of the peak for each factor of ten in the hold, from one hold to the next
    per_decade: tuple[float, ...]
    by_rate_and_state: float  #: by rate and state, for long holds: ``b ln 10``
    time_unit: str
    force_unit: str
    length_unit: str

    def __str__(self) -> str:
        F = self.force_unit
        t = self.time_unit
        x = self.length_unit
        columns = (
            self.hold,
            self.relaxation,
            self.peak,
            self.slip_to_peak,
            (math.nan, *self.per_decade),
        )
        rows = [
            ("hold", "relaxation", "peak", "slip to peak", "per decade"),
            (t, F, F, x, F),
            *(
                [f"{value:.4g}".replace("nan", "") for value in row]
                for row in zip(*columns, strict=True)
            ),
        ]
        lines = ["".join(f"{cell:>14}" for cell in row) for row in rows]
        expected = f"b ln 10 = {self.by_rate_and_state:.4g} {F}"
        end = (
            f"rate and state says {expected} per decade of hold time; give two holds "
            "to compare"
        )
        if self.per_decade:
            last = self.per_decade[-1]
            end = (
                f"healing over the last two holds: {last:.4g} {F} per decade of hold "
                "time, "
                f"{last / self.by_rate_and_state:.2f} times what rate and state says "
                f"({expected})"
            )
        return "\n".join([*lines, end])


def healing(run: xr.Dataset, b: float) -> Healing:
    """Return how much the peaks of a `slide_hold_slide` run grow with the time of the
    hold, all of which differ.

    Beside it stands the growth by rate and state with the evolution effect `b`, in the
    unit of force of the run.
    """
    instance(
        "healing: run", run, xr.Dataset, "a Dataset, as slide_hold_slide() returns it"
    )
    run = run.sortby("hold")
    if np.any(np.diff(run["hold"]) <= 0):
        raise InputError("holds: two are the same; give each once")
    return Healing(
        **{
            name: tuple(run[name].values.tolist())
            for name in ("hold", "relaxation", "peak", "slip_to_peak")
        },
        per_decade=tuple(
            (np.diff(run["peak"]) / np.diff(np.log10(run["hold"]))).tolist()
        ),
        by_rate_and_state=b * math.log(10.0),
        time_unit=run["hold"].attrs["units"],
        force_unit=run["peak"].attrs["units"],
        length_unit=run["slip_to_peak"].attrs["units"],
    )
