"""Rate and state of a whole record: its velocity steps, each fitted, and the healing in
its holds.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
import xarray as xr
from scipy.signal import savgol_filter

from stickslip.answers import Answer, plain
from stickslip.arrays import Range
from stickslip.errors import InputError, UndecidedError
from stickslip.measure.trace import SAME_SPEED, Array, independent
from stickslip.progress import Progress, reporting
from stickslip.rate_state.experiments import Record, checked_span
from stickslip.rate_state.fitting import Estimate
from stickslip.rate_state.laws import Law, laws_named
from stickslip.rate_state.measured import LawFits, StepFit, fit_laws, nearby
from stickslip.rate_state.pieces import SteadyPiece

_WIDTHS = [4 * 2**k + 1 for k in range(40)]  # of parabolas, in readings
_FEWEST_HOLDS = 3  # fewest holds that give a slope: two always lie on a line


@dataclass(frozen=True, kw_only=True)
class Hold:
    """A hold of the load point between sliding at one velocity, and the peak of the
    friction after it.
    """

    at: float  #: time at which it begins
    hold: float  #: hold time
    relaxation: Estimate  #: friction at its end minus that of sliding before it
    peak: Estimate  #: largest friction after it minus that of sliding before it
    slip_to_peak: float  #: displacement of the load point from its end to the peak


@dataclass(frozen=True, kw_only=True, repr=False)
class RecordFit(Answer):
    """Velocity steps and holds of a record, in the units of the data.

    One law is fitted to all steps: the likelier one for the steps that both laws
    identify or, without such a step, the one that more steps identify.
    """

    record: Any  #: the `Record` that was fitted
    source: str  #: name of the file
    read: str  #: the columns or variables that were used, in words
    law: Law | None  #: the law of the steps; None if no step is identified
    steps: tuple[StepFit, ...]  #: fits of the identified steps
    #: times of the steps that are not identified, and why
    refused: tuple[tuple[float, str], ...]
    holds: tuple[Hold, ...]
    #: growth of the peak per decade of hold time; None for fewer than three holds
    healing: Estimate | None

    @property
    def mean(self) -> dict[str, Estimate]:
        """Means of a, b, a - b and D over the steps, each with the standard deviation
        between steps as its error; empty for fewer than two steps.
        """
        if len(self.steps) < 2:
            return {}
        table = pd.DataFrame([one.values for one in self.steps])
        return {
            name: Estimate(*pair)
            for name, pair in table.agg(["mean", "std"]).to_dict("list").items()
        }

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as plain values, each estimate with its error."""
        units = ("length_unit", "time_unit", "friction_unit")
        found = plain(replace(self, record=None, steps=()))
        del found["record"]
        return {
            **found,
            **dict(zip(units, self.record.units, strict=True)),
            "steps": [one.to_dict() for one in self.steps],
            "mean": plain(self.mean),
            "spread": {name: one.error for name, one in self.mean.items()},
        }

    def __str__(self) -> str:
        law = f", {self.law} law" if self.law else ""
        many = len(self.steps) + len(self.refused)
        lines = [
            f"{self.source or 'record'}: velocity steps: {many}{law}; holds: "
            f"{len(self.holds)}",
            self.read,
        ]
        length, clock, unit = self.record.units
        if self.steps:
            speed = f"{length}/{clock}".strip("/")
            heads = {"time": clock, "from": speed, "to": speed}
            heads |= {"a": unit, "b": unit, "a - b": unit, "D": length}
            rows = list[list[str]]()
            for one in self.steps:
                speeds = f"{one.step.before:.4g}", f"{one.step.after:.4g}"
                values = map(Estimate.words, one.values.values())
                rows.append([one.at.words(), *speeds, *values])
            if self.mean:
                means = map(Estimate.words, self.mean.values())
                rows.append(["mean ± spread", "", "", *means])
            lines += ["", _table(heads, rows)]
        moved = [(one.at, one.moved) for one in self.steps if one.moved]
        lines += [f"step at {at:.7g}: {how}" for at, how in (*self.refused, *moved)]
        if self.holds:
            heads = {"hold at": clock, "lasts": clock, "relaxation": unit}
            heads |= {"peak": unit, "slip to peak": length}
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
            lines += ["", _table(heads, rows), self._healing_words(unit)]
        return "\n".join(lines)

    def _healing_words(self, unit: str) -> str:
        if self.healing is None:
            return "healing: needs three holds of different times"
        words = f"healing: {self.healing.words(unit)} per decade of hold time"
        if not self.steps:
            return words
        expected = math.log(10.0) * np.mean([float(one.b) for one in self.steps])
        return f"{words}; the steps give b ln 10 = {expected:.4g} {unit}".rstrip()


def fit_record(
    data: xr.Dataset,
    *,
    law: Literal["best", "ageing", "slip"] = "best",
    stiffness: float | None = None,
    span: Range | None = None,
    trend: bool = True,
    progress: bool | Progress | None = None,
) -> RecordFit:
    """Find the velocity steps and the holds of a record from its displacement or
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
        True for a bar, or a function of the fraction done.

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
    laws = laws_named(law)
    span = checked_span(span)
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
    fits = list[LawFits]()  # of each step
    with reporting(progress, "fit_record") as report:
        for k, pair in enumerate(steps):
            report(k / len(steps))
            try:
                step = nearby(record, *pair, span)
            except InputError as error:  # a piece is too short
                fits.append(dict.fromkeys(laws, UndecidedError(str(error))))
            else:
                fits.append(fit_laws(step, laws, stiffness, trend=trend))
    best = min(laws, key=lambda law: _unlikely(law, fits))
    chosen = [each[best] for each in fits]
    identified = tuple(fit for fit in chosen if isinstance(fit, StepFit))
    return RecordFit(
        record=record,
        source=str(data.attrs.get("source", "")),
        read=str(data.attrs.get("read", ", ".join(filter(None, record.names)))),
        law=best if identified else None,
        steps=identified,
        refused=tuple(
            (
                after.begin,
                f"{before.velocity:.4g} to {after.velocity:.4g}: {fit}",
            )
            for (before, after), fit in zip(steps, chosen, strict=True)
            if not isinstance(fit, StepFit)
        ),
        holds=tuple(holds),
        healing=_healing(holds),
    )


def _unlikely(law: Law, fits: Sequence[LawFits]) -> tuple[float, int]:
    """Return minus the logarithm of the likelihood of a law, for the steps that all
    laws identify, and the number of steps that it does not identify.
    """
    surprise = 0.0
    missing = 0
    for each in fits:
        fit = each[law]
        if not isinstance(fit, StepFit):
            missing += 1
        elif all(isinstance(other, StepFit) for other in each.values()):
            surprise += fit.step.friction.size * math.log(fit.rms)
    return surprise, missing


def _is_hold(before: SteadyPiece, rest: SteadyPiece, after: SteadyPiece) -> bool:
    """Whether a piece is a hold between sliding at the same velocity."""
    if not rest.is_rest or not before.steps_to(after):
        return False
    return abs(math.log(after.velocity / before.velocity)) < math.log1p(SAME_SPEED)


def _hold(
    record: Record, before: SteadyPiece, rest: SteadyPiece, after: SteadyPiece
) -> Hold:
    level = _level(record, 0.5 * (before.begin + before.end), rest.begin)
    # friction relaxes with the logarithm of time, so little in the last tenth
    low = _level(record, rest.end - 0.1 * (rest.end - rest.begin), rest.end)
    # the other half of the sliding gives the level of the next hold
    half = 0.5 * (after.begin + after.end)
    inside = (record.time >= rest.end) & (record.time <= half)
    when, peak = _peak(record.time[inside], record.friction[inside])
    return Hold(
        at=rest.begin,
        hold=rest.end - rest.begin,
        relaxation=Estimate(low - float(level), math.hypot(low.error, level.error)),
        peak=Estimate(peak - float(level), math.hypot(peak.error, level.error)),
        slip_to_peak=abs(float(after.velocity)) * (when - rest.end),
    )


def _level(record: Record, begin: float, end: float) -> Estimate:
    """Return the mean friction between two times, with its error."""
    first, last = np.searchsorted(record.time, [begin, end]).tolist()
    part = record.friction[min(first, last - 1) : last]
    many = independent(part - part.mean())
    # a few readings may be alike by chance
    least = _noise(record.friction) / math.sqrt(part.size)
    error = max(float(part.std()) / math.sqrt(many), least)
    return Estimate(float(part.mean()), error)


def _noise(friction: Array) -> float:
    """Return the standard deviation of white noise, from second differences."""
    return 1.4826 * float(np.median(np.abs(np.diff(friction, 2)))) / math.sqrt(6.0)


def _peak(time: Array, friction: Array) -> tuple[float, Estimate]:
    """Return the time and the value of the largest friction: the vertex of a parabola
    around it, half as wide as the widest that fits within the noise.

    What a parabola misses is of third and fourth order in its width: at half the width,
    its part in the vertex is small.
    """
    noise = _noise(friction)
    top = int(friction.argmax())
    beside = float(np.ptp(friction[max(top - 1, 0) : top + 2]))
    highest = Estimate(float(friction[top]), max(noise, 0.5 * beside))
    vertices = [(float(time[top]), highest)]
    for size in _WIDTHS:
        if size > friction.size:
            break
        smooth = savgol_filter(friction, size, 2)
        top = int(smooth.argmax())
        rest = (friction - smooth)[max(top - size // 2, 0) : top + size // 2 + 1]
        # the standard deviation of chi squared is sqrt(2 size)
        if float(rest @ rest) > noise**2 * (size + math.sqrt(2.0 * size)):
            break
        # the error in the middle of a parabola is sqrt(9/(4 m)) times the noise of its
        # m points
        error = 1.5 * noise / math.sqrt(size)
        vertices.append((float(time[top]), Estimate(float(smooth[top]), error)))
    return vertices[-2] if len(vertices) > 2 else vertices[-1]


def _healing(holds: Sequence[Hold]) -> Estimate | None:
    """Return the growth of the peaks per decade of hold time, from weighted least
    squares; its error is the larger of that from their errors and from their scatter.
    """
    decades = np.array([math.log10(one.hold) for one in holds])
    if np.unique(decades.round(2)).size < _FEWEST_HOLDS:
        return None
    peaks = [float(one.peak) for one in holds]
    weights = [1.0 / max(one.peak.error, 1e-9 * abs(one.peak)) for one in holds]
    by_errors, by_scatter = (
        np.polyfit(decades, peaks, 1, w=weights, cov=of) for of in ("unscaled", True)
    )
    (slope, _), _ = by_errors
    variances = [covariance[0, 0] for _, covariance in (by_errors, by_scatter)]
    return Estimate(slope, math.sqrt(max(variances)))


def _table(heads: dict[str, str], rows: list[list[str]]) -> str:
    """Return a text table of rows, with names and units in its first line."""
    names = [
        f" {name} ({unit})" if unit else f" {name}" for name, unit in heads.items()
    ]
    cells = " " + pd.DataFrame(rows, columns=names)
    return str(cells.to_string(index=False))
