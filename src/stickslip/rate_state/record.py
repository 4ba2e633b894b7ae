"""Rate and state of a whole record: its velocity steps, fitted one by one, and the
healing in its holds.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr

from stickslip.answers import Answer, plain
from stickslip.errors import InputError, UndecidedError, number
from stickslip.measure.trace import RESTS, Array, memory
from stickslip.progress import Progress, reporting
from stickslip.rate_state.experiments import Record
from stickslip.rate_state.fitting import Estimate
from stickslip.rate_state.laws import LAWS, Law
from stickslip.rate_state.measured import StepFit, fit_laws, nearby
from stickslip.rate_state.pieces import Piece

_FEWEST_HOLDS = 3  # a line goes through two, whatever their peaks are


@dataclass(frozen=True, kw_only=True)
class RefusedStep:
    """A velocity step that was found and does not identify rate and state."""

    at: float  #: time
    before: float  #: velocities
    after: float
    reason: str


@dataclass(frozen=True, kw_only=True)
class Hold:
    """A rest of the load point between sliding at one velocity, and the peak of the
    friction after it.
    """

    at: float  #: time at which it begins
    hold: float  #: how long it lasts
    relaxation: Estimate  #: friction at its end less that of sliding before it
    peak: Estimate  #: the largest friction afterwards less that of sliding
    slip_to_peak: float  #: displacement of the load point from its end to the peak


@dataclass(frozen=True, kw_only=True, repr=False)
class RecordFit(Answer):
    """Velocity steps and holds of a record, in the units of the data.

    One law is fitted to all steps: the one that most identify, then the likelier.
    """

    record: Record  #: what was fitted
    source: str  #: name of the file
    read: str  #: which columns, or variables, hold what
    law: Law | None  #: None if no step is identified
    steps: tuple[StepFit, ...]
    refused: tuple[RefusedStep, ...]
    holds: tuple[Hold, ...]
    #: growth of the peak for each factor of ten in the hold; None for less than three
    healing: Estimate | None

    @property
    def mean(self) -> dict[str, Estimate]:
        """Means of a, b, a - b and D over the steps, each with its standard error by
        the spread.
        """
        count = math.sqrt(max(len(self.steps), 1))
        return {
            name: Estimate(float(np.mean(values)), self.spread[name] / count)
            for name, values in self._values().items()
        }

    @property
    def spread(self) -> dict[str, float]:
        """Standard deviations of a, b, a - b and D between the steps; NaN for fewer
        than two.
        """
        return {
            name: float(np.std(values, ddof=1)) if len(values) > 1 else math.nan
            for name, values in self._values().items()
        }

    def _values(self) -> dict[str, list[float]]:
        names = ("a", "b", "a_minus_b", "distance") if self.steps else ()
        return {
            name: [float(getattr(one, name)) for one in self.steps] for name in names
        }

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values, each estimate with its error."""
        length, clock, unit = self.record.units
        return {
            "source": self.source,
            "read": self.read,
            "length_unit": length,
            "time_unit": clock,
            "friction_unit": unit,
            "law": self.law,
            "steps": [one.to_dict() for one in self.steps],
            "refused": plain(self.refused),
            "mean": plain(self.mean),
            "spread": plain(self.spread),
            "holds": plain(self.holds),
            "healing_per_decade": plain(self.healing),
            "healing_per_decade_error": getattr(self.healing, "error", None),
        }

    def __str__(self) -> str:
        many = len(self.steps) + len(self.refused)
        law = f", {self.law} law" if self.law else ""
        lines = [
            f"{self.source or 'record'}: {_counted(many, 'velocity step')}{law}; "
            f"{_counted(len(self.holds), 'hold')}",
            self.read,
        ]
        if many:
            lines += ["", *self._step_lines()]
        if self.holds:
            lines += ["", *self._hold_lines()]
        return "\n".join(lines)

    def _step_lines(self) -> list[str]:
        length, clock, unit = self.record.units
        speed = _in_unit("", f"{length}/{clock}")
        head = [
            _in_unit("time", clock),
            f"from{speed}",
            f"to{speed}",
            *(_in_unit(name, unit) for name in ("a", "b", "a - b")),
            _in_unit("D", length),
        ]
        rows = [
            (
                float(one.at),
                [
                    one.at.words(),
                    f"{one.step.before:.4g}",
                    f"{one.step.after:.4g}",
                    *(value.words() for value, _ in one.estimates.values()),
                ],
            )
            for one in self.steps
        ]
        rows += [
            (one.at, [f"{one.at:.7g}", f"{one.before:.4g}", f"{one.after:.4g}"])
            for one in self.refused
        ]
        table = [row for _, row in sorted(rows)]
        if len(self.steps) > 1:
            means = [value.words() for value in self.mean.values()]
            spreads = [f"{value:.2g}" for value in self.spread.values()]
            table += [["mean", "", "", *means], ["spread", "", "", *spreads]]
        lines = _table([head, *table])
        lines += [f"step at {one.at:.7g}: {one.reason}" for one in self.refused]
        lines += [
            f"step at {float(one.at):.7g}: {one.moved}"
            for one in self.steps
            if one.moved
        ]
        return lines

    def _hold_lines(self) -> list[str]:
        length, clock, unit = self.record.units
        head = [
            _in_unit("hold at", clock),
            _in_unit("lasts", clock),
            *(_in_unit(name, unit) for name in ("relaxation", "peak")),
            _in_unit("slip to peak", length),
        ]
        rows = [
            [
                f"{one.at:.7g}",
                f"{one.hold:.4g}",
                one.relaxation.words(),
                one.peak.words(),
                f"{one.slip_to_peak:.3g}",
            ]
            for one in self.holds
        ]
        lines = _table([head, *rows])
        if self.healing is None:
            return [*lines, "healing: takes three holds of different times"]
        words = f"healing: {self.healing.words(unit)} per decade of hold time"
        if self.steps:
            b = self.mean["b"] * math.log(10.0)
            words += f"; the steps say b ln 10 = {b.words(unit)}"
        return [*lines, words]


def fit_record(
    data: xr.Dataset,
    *,
    law: Literal["best", "ageing", "slip"] = "best",
    stiffness: float | None = None,
    span: tuple[float, float] | None = None,
    trend: bool = True,
    progress: bool | Progress | None = None,
) -> RecordFit:
    """Find the velocity steps and the holds of a record in its displacement or
    velocity, and fit each.

    Parameters
    ----------
    data : Dataset
        As `read_trace` returns it, with the displacement or the velocity of the load
        point.
    law : {"best", "ageing", "slip"}
        Which law to fit to all steps.
    stiffness, span, trend
        As in `fit_rate_and_state`.
    progress : bool or callable, optional
        A bar, or a function of the fraction that is done.

    Raises
    ------
    InputError
        If the data holds no friction, no displacement, or neither step nor hold.

    Examples
    --------
    >>> from stickslip.rate_state import RateAndState, fit_record
    >>> time = np.arange(0.0, 300.0, 0.2)
    >>> pull = np.where((time > 100) & (time < 200), 10.0, 3.0)
    >>> rock = RateAndState(law="ageing", a=0.008, b=0.011, distance=12.0)
    >>> place = np.append(0.0, np.cumsum(0.2 * pull[:-1]))
    >>> friction = 0.6 + rock.slide(time, pull, stiffness=0.01)[0]
    >>> trace = xr.Dataset(
    ...     {"mu": ("time", friction), "measured_displacement": ("time", place)},
    ...     coords={"time": time},
    ... )
    >>> found = fit_record(trace)
    >>> found.law, [round(step.distance, 1) for step in found.steps]
    ('ageing', [12.0, 12.0])
    """
    record = Record.of(data)
    if record.place is None:
        raise InputError(
            "no displacement and no velocity shows steps: name its column "
            "(displacement=, --displacement), or give the time of one step and both "
            "velocities (at=, before= and after=; --step-at, --from and --to)"
        )
    spring = stiffness and number("stiffness", stiffness, above=0)
    pieces = record.pieces
    steps = record.steps()
    holds = [
        _hold(record, *three)
        for three in zip(pieces, pieces[1:], pieces[2:], strict=False)
        if _is_hold(*three)
    ]
    if not steps and not holds:
        speeds = ", then ".join(f"{one.velocity:.4g}" for one in pieces)
        raise InputError(
            f"{record.names[0]} shows no velocity step and no hold: its velocity is "
            f"{speeds}; give the time of a step and both velocities (at=, before= and "
            "after=; --step-at, --from and --to)"
        )
    laws = LAWS if law == "best" else (law,)
    fits: dict[Law, list[StepFit | UndecidedError]] = {one: [] for one in laws}
    with reporting(progress, "fit_record") as report:
        for k, pair in enumerate(steps):
            try:
                step = record.cut(*pair, span) if span else nearby(record, *pair)
            except InputError as error:  # too short a piece
                for one in laws:
                    fits[one].append(UndecidedError(str(error)))
                continue
            for j, one in enumerate(laws):
                report((k + j / len(laws)) / len(steps))
                fits[one] += fit_laws(step, (one,), spring, trend=trend).values()
    best = min(laws, key=lambda one: _unlikely(fits[one]))
    refused = []
    for (before, after), fit in zip(steps, fits[best], strict=True):
        if not isinstance(fit, StepFit):
            speeds_of = [abs(float(one.velocity)) for one in (before, after)]
            refused.append(
                RefusedStep(
                    at=after.begin,
                    before=speeds_of[0],
                    after=speeds_of[1],
                    reason=str(fit),
                )
            )
    identified = tuple(fit for fit in fits[best] if isinstance(fit, StepFit))
    return RecordFit(
        record=record,
        source=str(data.attrs.get("source", "")),
        read=str(data.attrs.get("read") or record.described()),
        law=best if identified else None,
        steps=identified,
        refused=tuple(refused),
        holds=tuple(holds),
        healing=_healing(holds),
    )


def _unlikely(fits: Sequence[StepFit | UndecidedError]) -> tuple[int, float]:
    """How many steps a law does not identify, and minus the logarithm of its
    likelihood for the others.
    """
    found = [fit for fit in fits if isinstance(fit, StepFit)]
    logs = (fit.step.friction.size * math.log(fit.rms) for fit in found)
    return len(fits) - len(found), sum(logs)


def _is_hold(before: Piece, rest: Piece, after: Piece) -> bool:
    """Whether a piece is a rest between sliding at the same velocity."""
    if not rest.is_rest or not before.steps_to(after):
        return False
    return abs(math.log(after.velocity / before.velocity)) < math.log1p(RESTS)


def _hold(record: Record, before: Piece, rest: Piece, after: Piece) -> Hold:
    level = _level(record, 0.5 * (before.begin + before.end), rest.begin)
    # The state changes with the logarithm of the time: little in the last tenth.
    low = _level(record, rest.end - 0.1 * (rest.end - rest.begin), rest.end)
    # The other half of the sliding is the level of the next hold.
    half = 0.5 * (after.begin + after.end)
    inside = (record.time >= rest.end) & (record.time <= half)
    when, peak = _peak(record.time[inside], record.friction[inside])
    return Hold(
        at=rest.begin,
        hold=rest.end - rest.begin,
        relaxation=Estimate(low - float(level), math.hypot(low.error, level.error)),
        peak=Estimate(peak - float(level), math.hypot(peak.error, level.error)),
        slip_to_peak=abs(after.velocity) * (when - rest.end),
    )


def _level(record: Record, begin: float, end: float) -> Estimate:
    """Mean friction between two times, with its error: of n samples whose neighbours
    are alike by r, n (1 - r)/(1 + r) are independent.
    """
    first, last = np.searchsorted(record.time, [begin, end]).tolist()
    part = record.friction[min(first, last - 1) : last]
    alike = memory(part - part.mean())
    many = max(part.size * (1.0 - alike) / (1.0 + alike), 1.0)
    return Estimate(float(part.mean()), float(part.std()) / math.sqrt(many))


def _peak(time: Array, friction: Array) -> tuple[float, Estimate]:
    """When friction is largest, and how large: the vertex of the widest parabola about
    it that leaves no more than the noise.
    """
    top = int(np.argmax(friction))
    noise = 1.4826 * float(np.median(np.abs(np.diff(friction, 2)))) / math.sqrt(6.0)
    best = (float(time[top]), Estimate(float(friction[top]), noise))
    size = 5
    while noise > 0 and size <= friction.size:
        smooth = np.convolve(friction, np.ones(size) / size, mode="valid")
        first = int(np.argmax(smooth))
        part = slice(first, first + size)
        at = np.linspace(-1.0, 1.0, size)
        shapes = np.vander(at, 3)
        inverse = np.linalg.inv(shapes.T @ shapes)
        curve = inverse @ (shapes.T @ friction[part])
        rest = friction[part] - shapes @ curve
        free = size - 3
        # Chi squared has a standard deviation of sqrt(2 free).
        if float(rest @ rest) > noise**2 * (free + math.sqrt(2.0 * free)):
            break
        vertex = np.clip(-0.5 * curve[1] / min(curve[0], -1e-300), -1.0, 1.0)
        shape = np.array([vertex**2, vertex, 1.0])
        error = noise * math.sqrt(float(shape @ inverse @ shape))
        when = float(np.interp(vertex, at, time[part]))
        best = (when, Estimate(float(shape @ curve), error))
        size += size // 4 + 1
    return best


def _healing(holds: Sequence[Hold]) -> Estimate | None:
    """Growth of the peaks for each factor of ten in the hold, by weighted least
    squares; its error by their scatter where that is larger than their errors.
    """
    decades = np.array([math.log10(one.hold) for one in holds])
    if np.unique(decades.round(2)).size < _FEWEST_HOLDS:
        return None
    peaks = np.array([float(one.peak) for one in holds])
    errors = np.array([one.peak.error for one in holds])
    weights = 1.0 / np.maximum(errors, 1e-9 * np.abs(peaks).max()) ** 2
    middle = float(weights @ decades / weights.sum())
    square = float(weights @ (decades - middle) ** 2)
    slope = float((weights * (decades - middle)) @ peaks) / square
    rest = peaks - slope * (decades - middle)
    rest -= weights @ rest / weights.sum()
    excess = max(float(weights @ rest**2) / (len(holds) - 2), 1.0)
    return Estimate(slope, math.sqrt(excess / square))


def _in_unit(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit.strip("/") else name


def _counted(count: int, name: str) -> str:
    return f"{count or 'no'} {name}{'s' * (count != 1)}"


def _table(rows: list[list[str]]) -> list[str]:
    """Lines of a table, cells to the right of their columns."""
    widths = [
        max(len(row[k]) for row in rows if k < len(row)) for k in range(len(rows[0]))
    ]
    return [
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=False))
        for row in rows
    ]
