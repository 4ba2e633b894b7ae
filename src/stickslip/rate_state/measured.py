"""Fits of a measured velocity step: of rate and state, and of contacts."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any, Literal, TypeVar

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stickslip.answers import Answer
from stickslip.arrays import Range
from stickslip.errors import InputError, UndecidedError, instance, number, refused
from stickslip.loops import HALVINGS, bounded
from stickslip.measure.trace import Array, independent
from stickslip.model import Bell, Gamma, Interface, LogarithmicGrowth
from stickslip.model.distribution import Distribution
from stickslip.rate_state.contacts import ROUGH, finite_step, small_step
from stickslip.rate_state.experiments import Record, Step, checked_span, step_near
from stickslip.rate_state.fitting import Estimate, least_squares
from stickslip.rate_state.laws import Law, RateAndState, laws_named
from stickslip.rate_state.pieces import SteadyPiece
from stickslip.sliding import kinetic_friction

# displacement after which the state has forgotten a step, in D: exp(-20) of it is left
_REACH = 20.0


@dataclass(frozen=True, kw_only=True, repr=False)
class FittedStep(Answer, ABC):
    """The fields that all fits of a step have, in the units of the data."""

    step: Step  #: the step that was fitted
    #: stiffness between load point and sliding surface, friction per displacement
    stiffness: Estimate
    late: float = 0.0  #: displacement from the given time to the step
    at: Estimate = Estimate(0.0)  #: time of the step
    level: float = 0.0  #: friction before the step
    trend: float = 0.0  #: slope of a linear trend in displacement
    rms: float = 0.0  #: rms of the residuals
    misfit: float = 0.0  #: rms over the range of the friction

    def friction(self, displacement: ArrayLike) -> Array:
        """Return the friction of the fit over the displacement of the load point since
        the given time.
        """
        x = np.asarray(displacement, dtype=float)
        return self.level + self.trend * x + self._rise(self.step.since(self.late, x))

    @abstractmethod
    def _rise(self, since: Array) -> Array: ...

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as plain values, each estimate with its error; of the step,
        only its velocities and units.
        """
        found = super().to_dict()
        step = found.pop("step")
        return found | {
            name: step[name]
            for name in ("before", "after", "length_unit", "time_unit", "friction_unit")
        }

    def _rest_in_words(self) -> str:
        """Return stiffness, time of the step and residuals, in words."""
        spring = "not identified"
        length = self.step.length_unit
        friction = self.step.friction_unit
        if self.stiffness.error < self.stiffness:
            spring = self.stiffness.words(
                f"{friction or 1}/{length}" if length else friction
            )
        return (
            f"stiffness {spring}; step at {self.at.words(self.step.time_unit)}; rms "
            f"{self.rms:.3g} ({100 * self.misfit:.2g} % of the range)"
        )


AnyFit = TypeVar("AnyFit", bound=FittedStep)


@dataclass(frozen=True, kw_only=True, repr=False)
class StepFit(FittedStep):
    """Rate-and-state parameters of a step.

    `Estimate` is a number with its standard ``error``.
    """

    law: Law  #: "ageing" or "slip"
    a: Estimate  #: direct effect
    b: Estimate  #: evolution effect
    distance: Estimate  #: ``D``, over which the state evolves
    #: ``a - b``; its error takes the covariance of a and b into account
    a_minus_b: Estimate = Estimate(0.0)
    with_trend: bool = True  #: whether a linear trend was also fitted
    #: a, b, a - b and D of a fit without the trend, or with one if this has none; None
    #: if that fit does not identify them
    other: tuple[float, float, float, float] | None = None

    @property
    def parameters(self) -> RateAndState:
        """The law with its parameters."""
        return RateAndState(law=self.law, a=self.a, b=self.b, distance=self.distance)

    @property
    def values(self) -> dict[str, Estimate]:
        """a, b, a - b and D."""
        return {
            "a": self.a,
            "b": self.b,
            "a - b": self.a_minus_b,
            "D": self.distance,
        }

    @property
    def moved(self) -> str:
        """Parameters that change by more than their error without the linear trend, or
        with one, in words; empty if none does.
        """
        how = f"with{'out' * self.with_trend} a linear trend"
        if self.other is None:
            return f"not identified {how}"
        far = [
            f"{name} = {value:.4g}, {abs(value - found) / found.error:.2g} errors off"
            for (name, found), value in zip(
                self.values.items(), self.other, strict=True
            )
            if abs(value - found) > found.error
        ]
        return f"{how}: {'; '.join(far)}" if far else ""

    def _rise(self, since: Array) -> Array:
        return self.parameters.step(since, self.step.ratio, stiffness=self.stiffness)

    def __str__(self) -> str:
        moved = f"\n{self.moved}" if self.moved else ""
        unit = self.step.friction_unit
        return (
            f"{self.law} law: a = {self.a.words(unit)}, b = {self.b.words(unit)}, "
            f"a - b = {self.a_minus_b.words(unit)}, "
            f"D = {self.distance.words(self.step.length_unit)}, "
            f"{self._rest_in_words()}{moved}"
        )


LawFits = dict[Law, StepFit | UndecidedError]
"""The fit of each law to a step, or why its parameters are not identified."""


@dataclass(frozen=True, kw_only=True, repr=False)
class ContactsFit(FittedStep):
    """Parameters of contacts with Bell activation and logarithmic ageing, fitted to a
    step.
    """

    thresholds: Distribution  #: with mean 1, in units of `breaking_displacement`
    width: Estimate  #: activation width ``A``, over the mean threshold
    ageing: Estimate  #: slope ``c`` of ageing, over the mean threshold
    breaking_displacement: Estimate  #: mean ``x_s``, in the unit of displacement
    linear: bool  #: whether only the linear response was fitted

    @property
    def interface(self) -> Interface:
        """The interface, in natural units with ``breaking_displacement/before`` as the
        unit of time.

        The attempts and the time of ageing are not fitted, as the force depends only on
        their logarithms.
        """
        return Interface(
            thresholds=self.thresholds,
            activation=Bell(width=self.width, attempts=1e6),
            ageing=LogarithmicGrowth(slope=self.ageing, time=1e-3),
        )

    def _rise(self, since: Array) -> Array:
        """Return the change of the friction, by linear response or by cohorts.

        The friction before the step defines the unit of force.
        """
        interface = self.interface
        x_s = self.breaking_displacement
        ratio = self.step.ratio
        unit = self.step.level() / kinetic_friction(interface, 1.0)
        found = np.zeros_like(since)
        x = since[since > 0] / x_s
        spring = self.stiffness * x_s / unit
        if self.linear:
            of_ratio = small_step(interface, 1.0, x, stiffness=spring, coarse=3.0)
            force = math.log(ratio) * of_ratio
        else:
            reach = float(since.max()) / x_s + 1.0
            run = finite_step(
                interface, 1.0, ratio, reach, stiffness=spring, method=ROUGH
            )
            force = np.interp(x, *run)
        found[since > 0] = unit * force
        return found

    def __str__(self) -> str:
        cv = self.thresholds.standard_deviation() / self.thresholds.moment(1)
        length = self.breaking_displacement.words(self.step.length_unit)
        return (
            f"contacts, thresholds with CV {cv:.2g}: A = {self.width.words()}, "
            f"c = {self.ageing.words()}, breaking displacement = {length}, "
            f"{self._rest_in_words()}"
        )


def _fitted(
    kind: type[AnyFit],
    step: Step,
    given: Mapping[str, Any],
    ranges: Mapping[str, Range],
    starts: Sequence[Mapping[str, float]],
    *,
    trend: bool,
    **how: Any,
) -> tuple[AnyFit, Array]:
    """Fit a record of a `kind`, plus a line, to a step; return it with the covariance
    of the fitted values.

    Fields of the record are `given`, or fitted within their `ranges`, from each of
    `starts`.
    """
    low, high = np.array([*ranges.values()]).T
    lines = np.vander(step.displacement, 2 if trend else 1, increasing=True)
    of_line = np.linalg.pinv(lines)

    def above(value: Array) -> Array:
        fields: dict[str, Any] = dict(zip(ranges, value.tolist(), strict=True))
        like_it = kind(step=step, **given, **fields)
        # friction that curves within a bin has another mean than in its middle
        ends = step.displacement + np.array([[-1.0], [1.0]]) * step.std
        since = step.since(like_it.late, ends.ravel())
        return np.asarray(like_it._rise(since).reshape(2, -1).mean(axis=0))

    def beside_a_line(value: Array) -> Array:
        up = above(value)
        return up + lines @ (of_line @ (step.friction - up))

    fit = least_squares(
        beside_a_line,
        step.friction,
        [np.array([start[name] for name in ranges]) for start in starts],
        low,
        high,
        **how,
    )
    # at least one independent residual for each parameter
    worth = independent(step.friction - fit.curve, least=low.size)
    inflation = math.sqrt(step.friction.size / worth)
    values = dict(zip(ranges, fit.estimates(inflation), strict=True))
    if not fit.converged:
        raise _unidentified(
            "the fit did not converge; give a longer record, or less noise"
        )
    for name, (least, largest) in ranges.items():
        value = values[name]
        if name in ("stiffness", "late"):
            continue
        found_as = f"{name} = {value.words()}"
        if not value.error < value:
            raise _unidentified(f"{found_as}, an error as large as the value")
        if not least * (1 + 1e-6) < value < largest * (1 - 1e-6):
            raise _unidentified(f"{found_as} is at an end of its range")
    late = values.pop("late", Estimate(0.0))
    if abs(late) > 0.999 * step.near > 1e-6 * step.displacement.max():
        raise _unidentified(
            f"no step near the given time {step.at:g}, within the data kept; correct "
            "the time"
        )
    beside = of_line @ (step.friction - above(fit.value))
    line = dict(zip(("level", "trend"), beside.tolist(), strict=False))
    velocity = step.before if step.measured and late > 0 else step.after
    error = math.hypot(step.at_error, late.error / velocity)
    at = Estimate(step.at + float(late) / velocity, error)
    record = kind(
        step=step,
        late=float(late),
        at=at,
        rms=fit.rms,
        misfit=fit.misfit,
        **line,
        **given,
        **values,
    )
    return record, fit.covariance * inflation**2


def _unidentified(doubt: str) -> UndecidedError:
    return UndecidedError(f"not identified: {doubt}")


def fit_rate_and_state(
    data: xr.Dataset | Step,
    *,
    at: float | None = None,
    before: float | None = None,
    after: float | None = None,
    law: Literal["best", "ageing", "slip"] = "best",
    stiffness: float | None = None,
    span: Range | None = None,
    trend: bool = True,
) -> StepFit:
    """Fit rate-and-state parameters to a velocity step of a run or of a measured trace,
    in the units of the data.

    The time of the step is also fitted, near the given time: within the displacement
    that is kept before it.

    Parameters
    ----------
    data : Dataset or Step
        A trace with the step, or a `Step` that is already cut out.
    at, before, after, span
        As in `stickslip.rate_state.velocity_step_in`; not used with a `Step`.
    law : {"best", "ageing", "slip"}
        Which law to fit; by default the one with the smaller residuals.
    stiffness : float, optional
        Stiffness between load point and sliding surface, friction per displacement;
        fitted by default.
    trend : bool
        Whether to fit a linear trend in displacement as well.

    Raises
    ------
    InputError
        If the data holds no such step.
    UndecidedError
        If the data does not determine the parameters: nothing fits, an error exceeds
        its value, a value ends at a limit of its range, or the fit does not converge.

    Examples
    --------
    >>> from stickslip.rate_state import RateAndState
    >>> time = np.linspace(0.0, 60.0, 600)
    >>> true = RateAndState(law="slip", a=0.01, b=0.014, distance=5.0)
    >>> friction = (
    ...     0.6 + true.slide(time, np.where(time < 10, 1.0, 3.0), stiffness=0.01)[0]
    ... )
    >>> trace = xr.Dataset({"friction": ("time", friction)}, coords={"time": time})
    >>> fit = ss.rate_state.fit_rate_and_state(trace, at=10.0, before=1.0, after=3.0)
    >>> fit.law, round(fit.distance, 1)
    ('slip', 5.0)
    """
    how = partial(fit_laws, laws=laws_named(law), stiffness=stiffness, trend=trend)
    if isinstance(data, Step):
        given = {"at": at, "before": before, "after": after, "span": span}
        for name, value in given.items():
            if value is not None:
                raise refused(name, value, "must be left out where data is a Step")
        return best_law(how(data))
    record = Record.of(data)
    span = checked_span(span)
    step = nearby(record, *step_near(record, at, before, after), span)
    try:
        found = best_law(how(step))
    except UndecidedError as error:
        if step.at_error:  # the displacement shows both velocities
            raise
        other = record.cut(*step_near(record, at, after, before), span)
        if not any(isinstance(one, StepFit) for one in how(other).values()):
            raise
        raise UndecidedError(
            f"{error}; with the velocities swapped it is: --from {step.after:g} --to "
            f"{step.before:g}"
        ) from None
    if step.at_error:
        return found
    # once more, with bins that end at the time found
    step = nearby(record, *step_near(record, float(found.at), before, after), span)
    return best_law(how(step))


def nearby(
    record: Record, before: SteadyPiece, after: SteadyPiece, span: Range | None
) -> Step:
    """Return the step between two pieces, within a span or, by default, within the
    displacement over which the state changes: farther off, friction is rarely linear.
    """
    step = record.cut(before, after, span)
    if span:
        return step
    back = -float(step.displacement[0])
    turns = bounded("parts of a step", HALVINGS)  # each turn at least halves the step
    while True:
        next(turns)
        x = step.displacement
        try:
            forth = _REACH * float(_rough(step, "slip")[2])
        except UndecidedError:  # the change may lie within a few bins
            forth = 0.05 * float(x[-1])
        if forth > 0.5 * x[-1]:
            return step
        try:
            step = record.cut(before, after, (min(back, forth), forth))
        except InputError:  # a shorter step has too few readings
            return step


def fit_laws(
    step: Step, laws: Sequence[Law], stiffness: float | None, *, trend: bool
) -> LawFits:
    """Return the fit of each law to a step, or the error that explains why its
    parameters are not identified.
    """
    instance("trend", trend, bool, "True or False")
    spring = None
    if stiffness is not None:
        hint = "friction per displacement"
        spring = number("stiffness", stiffness, above=0, hint=hint)
    found: LawFits = {}
    for law in laws:
        try:
            found[law] = _fit_law(step, law, spring, trend=trend)
        except UndecidedError as error:
            found[law] = error
    return found


def best_law(fits: LawFits) -> StepFit:
    """Return the fit with the smallest residuals; `UndecidedError` if there is none."""
    found = [one for one in fits.values() if isinstance(one, StepFit)]
    if found:
        return min(found, key=lambda one: one.rms)
    error = next(one for one in fits.values() if isinstance(one, UndecidedError))
    raise error


def _rough(step: Step, law: Law) -> Array:
    """Return rough values of a, b, D, the displacement over which friction rises, and
    the displacement from the given time to the step.

    They are those of a rigid slider with a lag, from linear least squares on a grid.
    """
    x = step.displacement
    fine = _bin_width(step)
    size = math.log(step.ratio)
    lates = [0.0]
    if not step.at_error:
        lates += np.linspace(-0.9 * step.near, 0.9 * step.near, 20).tolist()
    best = np.array([math.inf])
    for late, D, part in product(
        lates, np.geomspace(2.0 * fine, 0.5 * x[-1], 12), (0.0, 0.1, 0.3, 1.0)
    ):
        since = np.maximum(step.since(late), 0.0)
        lag = max(part * D, 0.3 * fine)
        left = np.exp(-since / D)
        state = (
            np.log1p(np.expm1(size) * left) - size
            if law == "ageing"
            else size * (left - 1.0)
        )
        risen = -np.expm1(-since / lag)
        shapes = np.array([np.ones(x.size), x, size * risen, state * risen]).T
        (_, _, a, b), rest, rank, _ = np.linalg.lstsq(shapes, step.friction)
        if rank == 4 and a > 0 and b > 0 and rest[0] < best[0]:
            best = np.array([rest[0], a, b, D, lag, late])
    if best.size == 1:
        raise _unidentified(
            "friction does not rise with the velocity and fall back with the "
            "displacement after the step"
        )
    return best[1:]


def _fit_law(step: Step, law: Law, stiffness: float | None, *, trend: bool) -> StepFit:
    """Return the fit of a law, with a rigid machine if that fits as well, and with the
    parameters of a fit without the trend, or with one.
    """
    # the means of bins have rounding errors
    if not np.ptp(step.friction) > 1e-12 * np.abs(step.friction).max():
        raise UndecidedError(
            f"the friction is {step.friction[0]:g} throughout: there is no step in it"
        )
    a, b, D, lag, late = _rough(step, law)
    start = {"a": a, "b": b, "distance": D, "stiffness": a / lag, "late": late}
    fit = partial(_fit_from, step, law)
    found = fit(start, stiffness, trend=trend)
    start = vars(found)
    if not found.stiffness.error < found.stiffness:
        # The stiffness is not resolved. Take the stiffest one that could be, as that of
        # a rigid machine, if its fit is not significantly worse, and if its lag changes
        # a by less than the error.
        with suppress(UndecidedError):
            limit = Estimate(10.0 * _stiffest(step, a), math.inf)
            rigid = fit(start, limit, trend=trend)
            lag = a * abs(math.log(step.ratio)) / limit
            is_small = float(rigid.b) * lag < rigid.a.error * float(rigid.distance)
            worse = step.friction.size * ((rigid.rms / found.rms) ** 2 - 1.0)
            if is_small and worse < 1.0:
                found = rigid
                stiffness = limit
    with suppress(UndecidedError):
        other = fit(start, stiffness, trend=not trend)
        a, b = float(other.a), float(other.b)
        return replace(found, other=(a, b, a - b, float(other.distance)))
    return found


def _fit_from(
    step: Step,
    law: Law,
    start: Mapping[str, float],
    stiffness: float | None,
    *,
    trend: bool,
) -> StepFit:
    """Return the fit of a law from a start, with or without a trend."""
    a = float(start["a"])
    reach = float(step.displacement.max())
    ranges = {
        "a": (1e-3 * a, 1e2 * a),
        "b": (1e-3 * a, 1e2 * a),
        "distance": (0.1 * _bin_width(step), 10.0 * reach),
    }
    given: dict[str, Any] = {"law": law, "with_trend": trend}
    if stiffness is None:
        ranges["stiffness"] = (1e-3 * a / reach, _stiffest(step, a))
    else:
        given["stiffness"] = Estimate(stiffness, getattr(stiffness, "error", 0.0))
    if not step.at_error:
        ranges["late"] = (-step.near, step.near)
    found, covariance = _fitted(StepFit, step, given, ranges, [start], trend=trend)
    (aa, ab), (_, bb) = covariance[:2, :2].tolist()
    apart = math.sqrt(max(aa + bb - 2.0 * ab, 0.0))
    return replace(found, a_minus_b=Estimate(found.a - found.b, apart))


def _bin_width(step: Step) -> float:
    """Return the displacement from bin to bin."""
    return float(np.median(np.diff(step.displacement)))


def _stiffest(step: Step, a: float) -> float:
    """Return the largest stiffness to fit.

    A rise within less than a tenth of a bin cannot be distinguished from a sudden one,
    and would take the integrator many more steps.
    """
    return 10.0 * a / _bin_width(step)


def fit_contacts(
    step: Step,
    *,
    thresholds: Distribution = Gamma(mean=1.0, std=0.75),
    trend: bool = True,
    linear: bool = False,
) -> ContactsFit:
    """Fit contacts to a velocity step: activation width, ageing and breaking
    displacement, for given thresholds.

    The contacts have Bell activation and logarithmic ageing, on a spring of unknown
    stiffness. A first fit, by their linear response, is the start of a second one by
    cohorts, which is exact for a step of any size. Fits for several distributions of
    thresholds can be compared: the best scatter is that of the fit with the smallest
    residuals.

    Parameters
    ----------
    step : Step
        The step, as `velocity_step_in` returns it.
    thresholds : Distribution
        Thresholds, with a mean of 1.
    trend : bool
        Whether to fit a linear trend in displacement as well.
    linear : bool
        Whether to fit only the linear response, which takes half the time, and suffices
        for steps by a factor of a few.

    Raises
    ------
    InputError
        If the mean of the thresholds is not 1.
    UndecidedError
        If the data does not determine the parameters, as in `fit_rate_and_state`.
    """
    instance("fit_contacts: step", step, Step, "a Step of velocity_step_in()")
    hint = "a distribution, such as Gamma(mean=1.0, std=0.75)"
    instance("fit_contacts: thresholds", thresholds, Distribution, hint)
    instance("trend", trend, bool, "True or False")
    instance("linear", linear, bool, "True or False")
    if abs(thresholds.positive().moment(1) - 1.0) > 0.05:
        raise InputError(
            f"thresholds = {thresholds}: must have a mean of 1; the breaking "
            "displacement is fitted"
        )
    rough = _fit_law(step, "slip", None, trend=trend)
    a = rough.a / step.level() * 0.5
    D = float(rough.distance)
    spring = float(rough.stiffness)
    ranges = {
        "width": (0.1 * a, 10 * a),
        "ageing": (1e-3 * a, 30 * a),
        "breaking_displacement": (0.2 * D, 20 * D),
        "stiffness": (0.1 * spring, 10 * spring),
    }
    if not step.at_error:
        ranges["late"] = (-step.near, step.near)
    usual = {"width": a, "ageing": 0.8 * a, "stiffness": spring, "late": rough.late}
    starts = [usual | {"breaking_displacement": wide * D} for wide in (1.5, 3.0)]
    fitted = partial(
        _fitted,
        ContactsFit,
        step,
        ranges=ranges,
        trend=trend,
        # no finer than the error of the model
        tolerance=1e-4 if linear else ROUGH.rtol,
    )
    given = {"thresholds": thresholds, "linear": True}
    found, _ = fitted(given, starts=starts, most=50)
    if not linear:
        given["linear"] = False
        found, _ = fitted(given, starts=[vars(found)], most=20)
    return found
