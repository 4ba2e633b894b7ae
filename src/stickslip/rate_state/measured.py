"""A measured velocity step: as rate and state, and as contacts."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, UndecidedError, number
from stickslip.model import Bell, Gamma, Interface, LogarithmicGrowth, MasterEquation
from stickslip.model.distribution import Distribution
from stickslip.rate_state.contacts import finite_step, small_step
from stickslip.rate_state.fitting import Estimate, WithErrors, least_squares
from stickslip.rate_state.laws import Law, RateAndState, laws_to_fit
from stickslip.rate_state.steps import Step, velocity_step_in
from stickslip.sliding import kinetic_friction

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

_COARSE = MasterEquation(rtol=1e-3)
"""What a measured step is fitted with: its noise is larger."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FittedStep(WithErrors, ABC):
    """What fits of a step have in common, in the units of the data."""

    stiffness: Estimate  #: of whatever is between load point and sliding surface, friction per displacement
    at: Estimate  #: time of the step
    level: float  #: friction before the step
    trend: float  #: its slope in displacement
    rms: float  #: of the residuals
    misfit: float  #: the same over the range of the friction
    before: float  #: velocity of the load point before the step
    after: float  #: and after it
    late: float = 0.0  #: how much displacement after the given time the step came
    stretch: float = 1.0  #: how much of `late` displacement before the given time is worth; 1 where it was measured
    length_unit: str = ""
    time_unit: str = ""
    friction_unit: str = ""

    def friction(self, displacement: ArrayLike) -> Array:
        """Friction of the fit over the displacement of the load point, 0 at the time that was given."""
        x = np.asarray(displacement, dtype=float)
        return self.level + self.trend * x + self._rise(np.where(x < 0, self.stretch, 1.0) * x - self.late)

    @abstractmethod
    def _rise(self, x: Array) -> Array:
        """Friction after the step over that before it, over the displacement since the step."""

    def _end(self) -> str:
        """Stiffness, time of the step and residuals, in words."""
        spring = "stiffness not identified"
        if self.stiffness.error < self.stiffness:
            friction = self.friction_unit or 1
            unit = f"{friction}/{self.length_unit}" if self.length_unit else self.friction_unit
            spring = f"stiffness {self.stiffness.words(unit)}"
        rms = f"rms {self.rms:.3g} ({100 * self.misfit:.2g} % of the range)"
        return f"{spring}; step at {self.at.words(self.time_unit)}; {rms}"


@dataclass(frozen=True, kw_only=True, repr=False)
class StepFit(FittedStep):
    """Rate-and-state parameters of a step. `Estimate` is a number with its standard ``error``."""

    law: Law  #: "ageing" or "slip"
    a: Estimate  #: direct effect
    b: Estimate  #: evolution effect
    distance: Estimate  #: ``D``, over which the state evolves
    a_minus_b: Estimate  #: its error is that of the difference: a and b err together

    @property
    def parameters(self) -> RateAndState:
        """The law and its parameters, to slide with."""
        return RateAndState(law=self.law, a=self.a, b=self.b, distance=self.distance)

    @property
    def critical_stiffness(self) -> float:
        """``(b - a)/D``: with a softer spring steady sliding is unstable; 0 if it never is."""
        return self.parameters.critical_stiffness()

    def _rise(self, x: Array) -> Array:
        return self.parameters.step(x, self.after / self.before, stiffness=self.stiffness)

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values, each estimate with its error."""
        return super().to_dict() | {"critical_stiffness": self.critical_stiffness}

    def __str__(self) -> str:
        unit = self.friction_unit
        return (
            f"{self.law} law: a = {self.a.words(unit)}, b = {self.b.words(unit)}, "
            f"a - b = {self.a_minus_b.words(unit)}, D = {self.distance.words(self.length_unit)}, {self._end()}"
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class ContactsFit(FittedStep):
    """A step read as contacts with Bell activation and logarithmic ageing."""

    thresholds: Distribution  #: of mean 1, in units of `breaking_displacement`
    width: Estimate  #: activation width ``A``, over the mean threshold
    ageing: Estimate  #: slope ``c``, over the mean threshold
    breaking_displacement: Estimate  #: mean ``x_s``, in the unit of displacement
    linear: bool  #: whether by the linear response alone

    @property
    def interface(self) -> Interface:
        """The interface, in natural units with ``breaking_displacement/before`` as the unit of time."""
        return _contacts(self.thresholds, self.width, self.ageing)

    def _rise(self, x: Array) -> Array:
        rise = _rise_of_contacts(self.thresholds, self.level, self.after / self.before, linear=self.linear)
        return rise(np.array([self.width, self.ageing, self.breaking_displacement, self.stiffness]), x)

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values, each estimate with its error."""
        return super().to_dict() | {"thresholds": str(self.thresholds)}

    def __str__(self) -> str:
        cv = self.thresholds.standard_deviation() / self.thresholds.moment(1)
        return (
            f"contacts, thresholds with CV {cv:.2g}: A = {self.width.words()}, c = {self.ageing.words()}, breaking "
            f"displacement {self.breaking_displacement.words(self.length_unit)}, {self._end()}"
        )


def fit_rate_and_state(
    data: xr.Dataset | Step,
    *,
    at: float | None = None,
    before: float | None = None,
    after: float | None = None,
    law: Literal["best", "ageing", "slip"] = "best",
    stiffness: float | None = None,
    span: tuple[float, float] | None = None,
    trend: bool = True,
) -> StepFit:
    """Fit rate-and-state parameters to a velocity step of a run or of a measured trace.

    The time of the step is fitted, too, near the one that is given: no farther off than data is kept before it.

    Parameters
    ----------
    data : Dataset or Step
        A trace with the step in it, or a `Step` cut out already.
    at, before, after, span
        As in `stickslip.rate_state.velocity_step_in`; not beside a `Step`.
    law : {"best", "ageing", "slip"}
        Which law to fit; the one with the smaller residuals by default.
    stiffness : float, optional
        Between load point and sliding surface, friction per displacement; fitted by default.
    trend : bool
        Whether friction may change linearly with displacement besides.

    Returns
    -------
    StepFit
        In the units of the data.

    Raises
    ------
    InputError
        If the data holds no such step.
    UndecidedError
        If the data does not tell the parameters: nothing fits, an error exceeds its value, a value ends at a limit of
        its range, or the fit does not converge.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> import stickslip as ss
    >>> from stickslip.rate_state import RateAndState
    >>> time = np.linspace(0.0, 60.0, 600)
    >>> true = RateAndState(law="slip", a=0.01, b=0.014, distance=5.0)
    >>> friction = 0.6 + true.slide(time, np.where(time < 10, 1.0, 3.0), stiffness=0.01)[0]
    >>> trace = xr.Dataset({"friction": ("time", friction)}, coords={"time": time})
    >>> fit = ss.rate_state.fit_rate_and_state(trace, at=10.0, before=1.0, after=3.0)
    >>> fit.law, round(fit.distance, 1)
    ('slip', 5.0)
    """
    step = _the_step(data, at, before, after, span)
    laws = laws_to_fit(law)
    if stiffness is not None:
        stiffness = number("stiffness", stiffness, above=0, hint="friction per displacement")
    found, failed = _fits(step, laws, stiffness, trend=trend)
    if not found and _fits(step.swapped(), laws, stiffness, trend=trend)[0]:
        failed[0] += (
            f"; a step from {step.after:g} to {step.before:g} does fit: "
            "are the velocities before and after it (--from and --to) swapped?"
        )
    if not found:
        raise UndecidedError(failed[0])
    return min(found, key=lambda one: one.rms)


def _fits(step: Step, laws: Sequence[Law], stiffness: float | None, *, trend: bool) -> tuple[list[StepFit], list[str]]:
    """Fit several laws: those that fit, and why the others do not."""
    found, failed = [], []
    for law in laws:
        try:
            found.append(_fit_law(step, law, stiffness, trend=trend))
        except UndecidedError as error:
            failed.append(str(error))
    return found, failed


def _the_step(
    data: xr.Dataset | Step,
    at: float | None,
    before: float | None,
    after: float | None,
    span: tuple[float, float] | None,
) -> Step:
    if isinstance(data, Step):
        return data
    if at is None or before is None or after is None:
        missing = next(name for name, value in (("at", at), ("before", before), ("after", after)) if value is None)
        raise InputError(f"{missing}: is missing; give the time of the step and the velocities before and after it")
    return velocity_step_in(data, at=at, before=before, after=after, span=span)


# --------------------------------------------------------------------------------------------------- a curve and a line


class _Curve(NamedTuple):
    """What friction rises by after a step: a function of values and displacement, and the range of each value."""

    rise: Callable[[Array, Array], Array]
    low: Array
    high: Array
    needed: dict[str, str]
    """The first values, without which nothing is known, by name, with their units."""


def _fitted(
    step: Step, curve: _Curve, starts: Sequence[Array], *, trend: bool, **how: Any
) -> tuple[list[Estimate], Array, dict[str, Any]]:
    """Fit a curve and when the step came: estimates, their covariance, and what `FittedStep` has."""
    low, high = np.append(curve.low, -step.near), np.append(curve.high, step.near)

    def beside_a_line(value: Array) -> tuple[Array, float, float]:
        """Friction, level and slope where the last value is how late the step came."""
        rise = curve.rise(value[:-1], step.since(float(value[-1])))
        level, slope = step.line(rise, trend=trend)
        return rise + level + slope * step.displacement, level, slope

    fit = least_squares(lambda value: beside_a_line(value)[0], step.friction, starts, low, high, **how)
    covariance = fit.covariance * _inflation(step.friction - fit.curve, low.size) ** 2
    found = [*map(Estimate, fit.value, np.sqrt(np.diag(covariance)))]
    late = found[-1]
    if not fit.converged:
        raise UndecidedError("not identified: the fit did not converge; give a longer record, or less noise")
    for (name, unit), value, least, largest in zip(curve.needed.items(), found, low, high, strict=False):
        if not value.error < value:
            raise UndecidedError(f"not identified: {name} = {value.words(unit)}, an error as large as the value")
        if np.log(largest / value) < 1e-6 or np.log(value / least) < 1e-6:
            raise UndecidedError(
                f"not identified: {name} = {value.words(unit)} is at the end of the range that was tried"
            )
    if abs(late) > 0.999 * step.near > 1e-6 * step.displacement.max():
        raise UndecidedError(
            f"not identified: no step near the time {step.at:g} that was given; it would be at an end of what was kept "
            "before it; correct the time of the step"
        )
    velocity = step.before if step.measured and late > 0 else step.after
    _, level, slope = beside_a_line(fit.value)
    common = {
        "at": Estimate(step.at + late / velocity, late.error / velocity),
        "level": level,
        "trend": slope,
        "rms": fit.rms,
        "misfit": fit.rms / float(np.ptp(step.friction)),
        "late": float(late),
    }
    kept = ("before", "after", "stretch", "length_unit", "time_unit", "friction_unit")
    return found, covariance, common | {name: getattr(step, name) for name in kept}


def _inflation(residual: Array, parameters: int) -> float:
    """How much larger errors are than those of independent residuals: Bartlett's, for noise of first order."""
    # n samples whose neighbours correlate by r are worth n (1 - r)/(1 + r), and not less than one for each parameter.
    square = float(residual @ residual)
    likeness = max(float(residual[1:] @ residual[:-1]) / square, 0.0) if square > 0 else 0.0
    worth = max(residual.size * (1.0 - likeness) / (1.0 + likeness), parameters)
    return math.sqrt(residual.size / worth)


# --------------------------------------------------------------------------------------------------- as rate and state


def _guess(step: Step, late: float = 0.0) -> tuple[float, float, float]:
    """About a, b and D: the largest rise, what is left of it, and where it has fallen to 1/e."""
    x = step.since(late)
    after, rise = x[x > 0], (step.friction[x > 0] - step.level(late)) / math.log(step.ratio)
    end = float(np.mean(rise[-max(rise.size // 5, 1) :]))
    smooth = np.convolve(rise, np.ones(5) / 5, mode="same") if rise.size > 20 else rise
    top = int(np.argmax(smooth[: max(rise.size // 2, 1)]))
    direct = max(float(smooth[top]), 0.2 * float(np.ptp(rise)))
    fallen = np.flatnonzero(smooth[top:] < end + 0.37 * (smooth[top] - end))
    distance = (
        float(after[min(top + int(fallen[0]), after.size - 1)] - after[top]) if fallen.size else 0.1 * float(after[-1])
    )
    return direct, max(direct - end, 0.1 * direct), max(distance, float(after[min(2, after.size - 1)]))


def _fit_law(step: Step, law: Law, stiffness: float | None, *, trend: bool) -> StepFit:
    if not np.ptp(step.friction) > 1e-12 * np.abs(step.friction).max():  # means of bins round
        raise UndecidedError(f"the friction is {step.friction[0]:g} throughout: there is no step in it")
    known, x = stiffness is not None, step.displacement

    def rise(value: Array, since: Array) -> Array:
        spring = stiffness if stiffness is not None else float(value[3])
        one = RateAndState(law=law, a=value[0], b=value[1], distance=value[2])
        return one.step(since, step.ratio, stiffness=spring)

    def start(late: float, up: float = 1.0, wide: float = 1.0) -> Array:
        a, b, distance = _guess(step, late)
        return np.array([up * a, up * b, wide * distance, *([] if known else [2.0 * up * a / (wide * distance)]), late])

    (a, _, _), reach, fine = _guess(step), float(x.max()), float(np.median(np.diff(x)))
    low = np.array([1e-3 * a, 1e-3 * a, 0.1 * fine, 1e-3 * a / reach])
    high = np.array([1e2 * a, 1e2 * a, 10.0 * reach, 1e2 * a / fine])
    count, unit = 3 if known else 4, step.friction_unit
    curve = _Curve(rise, low[:count], high[:count], {"a": unit, "b": unit, "D": step.length_unit})

    tried = [start(late) for late in np.linspace(-0.9 * step.near, 0.9 * step.near, 61)]
    starts = [start(0.0), start(0.0, 1.5, 0.5), start(0.0, 1.2, 2.0)]
    found, covariance, common = _fitted(step, curve, starts, trend=trend, tried=tried)
    apart = math.sqrt(max(covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1], 0.0))
    return StepFit(
        law=law,
        a=found[0],
        b=found[1],
        distance=found[2],
        a_minus_b=Estimate(found[0] - found[1], apart),
        stiffness=found[3] if stiffness is None else Estimate(stiffness),
        **common,
    )


# --------------------------------------------------------------------------------------------------------- as contacts

_ATTEMPTS, _TIME = 1e6, 1e-3
"""Attempt rate and time of ageing, in units of ``x_s`` over the velocity: the force depends on their logarithms."""


def _contacts(thresholds: Distribution, width: float, ageing: float) -> Interface:
    return Interface(
        thresholds=thresholds,
        temperature=Bell(width=width, attempts=_ATTEMPTS),
        ageing=LogarithmicGrowth(slope=ageing, time=_TIME),
    )


def _rise_of_contacts(
    thresholds: Distribution, level: float, ratio: float, *, linear: bool
) -> Callable[[Array, Array], Array]:
    """Friction after a step over that before it, by width, ageing, breaking displacement and stiffness.

    The level before it says how large a unit of force is.
    """

    def rise(value: Array, since: Array) -> Array:
        width, ageing, x_s, stiffness = value.tolist()
        interface = _contacts(thresholds, width, ageing)
        unit = level / kinetic_friction(interface, 1.0)
        x, spring, found = since[since > 0] / x_s, stiffness * x_s / unit, np.zeros_like(since)
        if linear:
            force = math.log(ratio) * small_step(interface, 1.0, x, stiffness=spring, coarse=3.0)
        else:
            reach = float(since.max()) / x_s + 1.0
            force = np.interp(x, *finite_step(interface, 1.0, ratio, reach, stiffness=spring, method=_COARSE))
        found[since > 0] = force
        return unit * found

    return rise


def fit_contacts(
    data: xr.Dataset | Step,
    *,
    at: float | None = None,
    before: float | None = None,
    after: float | None = None,
    thresholds: Distribution = Gamma(mean=1.0, std=0.75),
    span: tuple[float, float] | None = None,
    trend: bool = True,
    linear: bool = False,
) -> ContactsFit:
    """Read a velocity step as contacts: activation width, ageing and breaking displacement, for given thresholds.

    The contacts have Bell activation and logarithmic ageing, on a spring of unknown stiffness. A first fit by their
    linear response is the start of one by cohorts, exact for a step of any size. Fits for several distributions of
    thresholds, side by side, tell their scatter: the one with the smallest residuals.

    Parameters
    ----------
    data, at, before, after, span, trend
        As in `fit_rate_and_state`.
    thresholds : Distribution
        Of mean 1.
    linear : bool
        Only fit the linear response, which takes seconds in place of a minute: for steps by a factor of a few.

    Returns
    -------
    ContactsFit

    Raises
    ------
    InputError
        If the data holds no such step, or the mean of the thresholds is not 1.
    """
    step = _the_step(data, at, before, after, span)
    if abs(thresholds.positive().moment(1) - 1.0) > 0.05:
        raise InputError(f"thresholds = {thresholds}: must have a mean of 1; the breaking displacement is fitted")
    rough = _fit_law(step, "slip", None, trend=trend)
    a, D, spring = rough.a / step.level() * 0.5, float(rough.distance), float(rough.stiffness)
    low, high = np.array([0.1 * a, 1e-3 * a, 0.2 * D, 0.1 * spring]), np.array([10 * a, 30 * a, 20 * D, 10 * spring])

    needed = {"A": "", "c": "", "the breaking displacement": step.length_unit}

    def fitted(starts: Sequence[Array], most: int, *, linear: bool) -> tuple[list[Estimate], Array, dict[str, Any]]:
        rise = _rise_of_contacts(thresholds, step.level(), step.ratio, linear=linear)
        return _fitted(step, _Curve(rise, low, high, needed), starts, trend=trend, tolerance=1e-4, most=most)

    starts = [np.array([a, 0.8 * a, wide * D, spring, rough.late]) for wide in (1.5, 3.0)]
    found, _, common = fitted(starts, 50, linear=True)
    if not linear:
        found, _, common = fitted([np.array(found)], 20, linear=False)
    return ContactsFit(
        thresholds=thresholds,
        width=found[0],
        ageing=found[1],
        breaking_displacement=found[2],
        stiffness=found[3],
        linear=linear,
        **common,
    )
