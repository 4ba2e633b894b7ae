"""Velocity steps, cut out of a run or a trace, and healing after holds."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np
import pandas as pd
import xarray as xr
from scipy.integrate import cumulative_trapezoid

from stickslip.answers import Answer
from stickslip.arrays import Range, units_of
from stickslip.errors import InputError, dataset, instance, number, pair, whole
from stickslip.io.headings import ratio
from stickslip.measure.trace import ERRORS, Array, dataset_of
from stickslip.rate_state.fitting import Estimate
from stickslip.rate_state.pieces import SteadyPiece, find_pieces

_FRICTIONS = ("mu", "spring_force", "friction_force", "friction")
"""Variables that may hold the friction, in the order in which they are tried."""
_PLACES = (
    "measured_displacement",
    "measured_velocity",
    "drive_velocity",
    "velocity",
    "displacement",
)
"""Variables that may hold the motion of the load point, in the order in which they are
tried. The velocities come before `displacement`, which in a run is that of the slider.
"""
_FEWEST = 30  # samples after a step


@dataclass(frozen=True, kw_only=True)
class Step:
    """A velocity step, in the form in which it is fitted: friction over the
    displacement of the load point since the step.
    """

    displacement: Array  #: mean of each bin, rising
    friction: Array  #: mean of each bin
    std: Array | float = 0.0  #: standard deviation of the displacements in each bin
    before: float  #: velocity of the load point before the step
    after: float  #: velocity after the step
    #: time of the step, at which lines through the displacement cross, or a given time
    at: float = 0.0
    at_error: float = 0.0  #: error of the crossing; 0 for a given time
    #: whether the displacement was measured; else it is the velocities times the time
    measured: bool = True
    length_unit: str = ""  #: unit of the data; empty if it has none
    time_unit: str = ""
    friction_unit: str = ""

    @property
    def ratio(self) -> float:
        """Ratio of the velocities."""
        return self.after / self.before

    @property
    def stretch(self) -> float:
        """Factor on the displacement before the given time, if the step came earlier:
        without a measured displacement, the load point then moved at the later speed.
        """
        return 1.0 if self.measured else self.ratio

    @property
    def near(self) -> float:
        """Displacement from the given time within which the step is searched: as far
        as there are data before it, but at most half of those after it.
        """
        end = float(self.displacement.max())
        return float(
            np.clip(-self.displacement.min() * self.stretch, 1e-9 * end, 0.5 * end)
        )

    def since(self, late: float, displacement: Array | None = None) -> Array:
        """Return the displacement since the step, if the step came a displacement
        `late` after the given time.
        """
        x = self.displacement if displacement is None else displacement
        return np.where(x < 0, self.stretch, 1.0) * x - late

    def level(self) -> float:
        """Return the friction before the given time."""
        before = self.friction[self.displacement <= 0]
        return float(np.median(before) if before.size else self.friction[0])


class Record(NamedTuple):
    """Friction of a run or a trace over time and, if it has a displacement, the pieces
    of constant speed of that.
    """

    time: Array
    friction: Array
    place: Array | None  #: displacement of the load point, without its noise
    pieces: list[SteadyPiece]
    names: tuple[str | None, str, str]  #: variables of displacement, time, friction
    units: tuple[str, str, str]  #: their units; empty without one

    @classmethod
    def of(cls, data: xr.Dataset) -> Self:
        """Return friction and displacement of a Dataset; `InputError` if it holds no
        friction.
        """
        dataset("data", data, "a Dataset, as read_trace() returns it")
        if "time" in data.coords and data["time"].dtype.kind in "mM":
            data = dataset_of(data)  # dates become seconds
        there = [one for one in data if data[one].dims == ("time",)]
        name = next((one for one in _FRICTIONS if one in there), None)
        if name is None or "time" not in data.coords:
            raise InputError(
                "data: holds no friction over time; it must have one of "
                f"{', '.join(_FRICTIONS)}"
            )
        along = next((one for one in _PLACES if one in there), None)
        rows = pd.DataFrame(
            {one: data[one].values.astype(float) for one in (name, along) if one},
            index=data["time"].values.astype(float),
        )
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(rows) < _FEWEST:
            raise InputError(
                f"data: {len(rows)} samples; there must be at least {_FEWEST}"
            )
        time = rows.index.to_numpy()
        if np.any(np.diff(time) < 0):
            raise InputError("data: its times do not rise; sort it by time")
        names = (along, "time", name)
        length, clock, unit = (units_of(data[one] if one else None) for one in names)
        place = None
        pieces = list[SteadyPiece]()
        if along is not None:
            place = rows[along].to_numpy()
            if "velocity" in along:
                speed_unit = "rev/min" if ratio(length, "rpm") == 1.0 else length
                length, _, per = speed_unit.partition("/")
                # the times may have another unit than that in the velocity
                scale = ratio(clock, per) or 1.0
                place = scale * cumulative_trapezoid(place, time, initial=0)
            pieces, place = find_pieces(time, place)
            if "velocity" in along:  # steps come anywhere between two readings
                pieces = [one._replace(begin_error=0.0) for one in pieces]
        units = (length, clock, unit.removeprefix("1"))
        return cls(
            time,
            rows[name].to_numpy(),
            place,
            pieces,
            names,
            units,
        )

    def steps(self) -> list[tuple[SteadyPiece, SteadyPiece]]:
        """Return the pieces before and after each velocity step."""
        return [pair for pair in pairwise(self.pieces) if pair[0].steps_to(pair[1])]

    def cut(
        self,
        before: SteadyPiece,
        after: SteadyPiece,
        span: Range | None = None,
        bins: int = 800,
    ) -> Step:
        """Return the step between two pieces, in bins of displacement."""
        at = after.begin
        speeds = [abs(float(one.velocity)) for one in (before, after)]
        if self.place is None:
            x = np.where(self.time < at, *speeds) * (self.time - at)
            back = 0.1 * float(x.max())
        else:
            x = (self.place - after.place) * math.copysign(1.0, after.velocity)
            # the first half of the time before may still show an earlier step
            back = 0.5 * speeds[0] * (before.end - before.begin)
        back, forth = span or (back, float(x.max()))
        inside = (x >= -back) & (x <= forth)
        inside &= (self.time >= before.begin) & (self.time <= after.end)
        # leave out readings that may lie on either side of the step
        inside &= np.abs(self.time - at) >= ERRORS * after.begin_error
        rows = pd.DataFrame(
            {
                "x": x[inside],
                "friction": self.friction[inside],
            }
        )
        if (later := int((rows.x > 0).sum())) < _FEWEST:
            raise InputError(
                f"at = {at:g}: {later} samples after the step; there must be at least "
                f"{_FEWEST}"
            )
        width = float(np.ptp(rows.x)) / min(bins, len(rows))
        # bins end at the step, so that none holds readings of both sides
        bins_of = rows.groupby(np.floor(rows.x / width))
        held = bins_of.mean()
        length, clock, unit = self.units
        return Step(
            displacement=held.x.values,
            friction=held.friction.values,
            std=bins_of.x.std(ddof=0).values,
            before=speeds[0],
            after=speeds[1],
            at=at,
            at_error=after.begin_error,
            measured=self.place is not None,
            length_unit=length,
            time_unit=clock,
            friction_unit=unit,
        )


def velocity_step_in(
    data: xr.Dataset,
    *,
    at: float | None,
    before: float | None = None,
    after: float | None = None,
    span: Range | None = None,
    bins: int = 800,
) -> Step:
    """Cut a velocity step out of a run or a measured trace, in bins of displacement.

    Parameters
    ----------
    data : Dataset
        A run, or a trace as `read_trace` returns it, with ``mu``, ``spring_force``,
        ``friction_force`` or ``friction`` along ``time``. The displacement of the load
        point is ``measured_displacement`` or ``displacement`` (in a run, that is the
        slider's, and is not used), else the velocities times the time.
    at : float
        Time of the step, in the unit of time of the data. If the displacement shows
        steps, the nearest of them is cut out, and its time and position are those at
        which lines through both sides cross.
    before, after : float, optional
        Velocities of the load point, in displacement per time of the data; by default
        those of its displacement.
    span : (float, float), optional
        Displacements before and after the step, up to the next steps at most. By
        default all after it, and half of that before it or, without a displacement, a
        tenth of that after it.
    bins : int
        Largest number of bins of equal displacement over which the data are averaged.

    Raises
    ------
    InputError
        If there is no such variable, or fewer than 30 samples after the step, or the
        displacement shows another step.

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
    record = Record.of(data)
    whole("bins", bins, at_least=_FEWEST, at_most=100_000)
    pieces = step_near(record, at, before, after)
    return record.cut(*pieces, checked_span(span), bins)


def checked_span(span: Range | None) -> Range | None:
    """Return the displacements before and after a step, checked; None if none are
    given.
    """
    if span is None:
        return None
    before, after = pair("span", span, "displacements before and after each step")
    return number("span[0]", before, at_least=0), number("span[1]", after, above=0)


def step_near(
    record: Record,
    at: float | None,
    before: float | None = None,
    after: float | None = None,
) -> tuple[SteadyPiece, SteadyPiece]:
    """Return the pieces before and after the step nearest to a time: those of the
    displacement or, if that shows no step, with the velocities given.
    """
    first, last = record.time[[0, -1]].tolist()
    at = number(
        "at",
        at,
        at_least=first,
        at_most=last,
        hint="time of the step",
    )
    given = [
        None
        if value is None
        else Estimate(number(name, value, above=0, hint=f"velocity {name} the step"))
        for name, value in (("before", before), ("after", after))
    ]
    if before is not None and before == after:
        raise InputError(
            f"after = {after:g}: equals the velocity before the step; give another one"
        )
    if steps := record.steps():
        early, late = min(steps, key=lambda pair: abs(pair[1].begin - at))
        if before and after:
            rises = abs(late.velocity) > abs(early.velocity)
            if rises != (after > before):
                raise InputError(
                    f"before = {before:g}, after = {after:g}: swapped? At "
                    f"{late.begin:.6g} the velocity of the displacement steps from "
                    f"{abs(early.velocity):.4g} to {abs(late.velocity):.4g}"
                )
        return early._replace(velocity=given[0] or early.velocity), late._replace(
            velocity=given[1] or late.velocity
        )
    if given[0] is None or given[1] is None:
        raise InputError(
            "before, after: must both be given (--from, --to), since no displacement "
            "shows a step"
        )
    place = 0.0
    if record.place is not None:
        place = float(np.interp(at, record.time, record.place))
    early = SteadyPiece(first, at, given[0], place)
    return early, SteadyPiece(at, last, given[1], place)


@dataclass(frozen=True, kw_only=True, repr=False)
class Healing(Answer):
    """Peaks after holds and their growth, in the units of the run."""

    hold: tuple[float, ...]  #: hold times, rising
    #: for each hold, as `slide_hold_slide` returns them
    relaxation: tuple[float, ...]
    peak: tuple[float, ...]
    slip_to_peak: tuple[float, ...]
    #: growth of the peak per decade of hold time, from each hold to the next
    per_decade: tuple[float, ...]
    by_rate_and_state: float  #: growth by rate and state for long holds: ``b ln 10``
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
            f"rate and state predicts {expected} per decade of hold time; give two "
            "holds to compare"
        )
        if self.per_decade:
            last = self.per_decade[-1]
            end = (
                f"healing over the last two holds: {last:.4g} {F} per decade of hold "
                "time, "
                f"{last / self.by_rate_and_state:.2f} times what rate and state "
                f"predicts ({expected})"
            )
        return "\n".join([*lines, end])


def healing(run: xr.Dataset, b: float) -> Healing:
    """Return the growth of the peaks of a `slide_hold_slide` run with the hold time, of
    which all must differ.

    The result also has the growth by rate and state with the evolution effect `b`, in
    the unit of force of the run.
    """
    instance(
        "healing: run", run, xr.Dataset, "a Dataset, as slide_hold_slide() returns it"
    )
    if "slip_to_peak" not in run:
        raise InputError("healing: run: has no holds; give one of slide_hold_slide()")
    effect = number("b", b, above=0, hint="evolution effect")
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
        by_rate_and_state=effect * math.log(10.0),
        time_unit=units_of(run["hold"]),
        force_unit=units_of(run["peak"]),
        length_unit=units_of(run["slip_to_peak"]),
    )
