"""A measured velocity step: as rate and state, and as contacts."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import InputError, UndecidedError, number
from stickslip.measure.arrays import Array, memory
from stickslip.model import Bell, Gamma, Interface, LogarithmicGrowth, MasterEquation
from stickslip.model.distribution import Distribution
from stickslip.rate_state.contacts import finite_step, small_step
from stickslip.rate_state.fitting import Estimate, WithErrors, least_squares
from stickslip.rate_state.laws import Law, RateAndState, laws_to_fit
from stickslip.rate_state.steps import Step, velocity_step_in
from stickslip.sliding import kinetic_friction

if TYPE_CHECKING:
    import xarray as xr

Rise = Callable[[Array, Array], Array]
"""What friction rises by after a step: of values that are fitted, and of the displacement since the step."""

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
        values = np.array([self.width, self.ageing, self.breaking_displacement, self.stiffness])
        return _rise_of(self.thresholds, self.level, self.after / self.before, linear=self.linear)(values, x)

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
    step = _the_step(data, at=at, before=before, after=after, span=span)
    spring = None if stiffness is None else number("stiffness", stiffness, above=0, hint="friction per displacement")

    def fits(step: Step) -> tuple[list[StepFit], list[UndecidedError]]:
        """Of all laws that fit, and why the others do not."""
        found, failed = [], []
        for one in laws_to_fit(law):
            try:
                found.append(_fit_law(step, one, spring, trend=trend))
            except UndecidedError as error:
                failed.append(error)
        return found, failed

    found, failed = fits(step)
    if found:
        return min(found, key=lambda one: one.rms)
    if fits(step.swapped())[0]:
        raise UndecidedError(
            f"{failed[0]}; a step from {step.after:g} to {step.before:g} does fit: are the velocities before and "
            "after it (--from and --to) swapped?"
        )
    raise failed[0]


def _the_step(data: xr.Dataset | Step, **how: Any) -> Step:
    return data if isinstance(data, Step) else velocity_step_in(data, **how)


# --------------------------------------------------------------------------------------------------- a curve and a line


def _fitted(
    step: Step,
    rise: Rise,
    ranges: tuple[Array, Array],
    needed: dict[str, str],
    starts: Sequence[Array],
    *,
    trend: bool,
    **how: Any,
) -> tuple[list[Estimate], Array, dict[str, Any]]:
    """Fit a curve beside a line, and when the step came: estimates, their covariance, and what `FittedStep` has.

    How late the step came is the last of the values. The first ones, without which nothing is known, are `needed`: by
    name, with their units.
    """
    low, high = np.append(ranges[0], -step.near), np.append(ranges[1], step.near)
    lines = np.vander(step.displacement, 2 if trend else 1, increasing=True)
    of_line = np.linalg.pinv(lines)

    def beside_a_line(value: Array) -> Array:
        up = rise(value[:-1], step.since(float(value[-1])))
        return up + lines @ (of_line @ (step.friction - up))

    fit = least_squares(beside_a_line, step.friction, starts, low, high, **how)
    # n samples whose neighbours correlate by r are worth n (1 - r)/(1 + r), and not less than one for each parameter.
    count, alike = step.friction.size, memory(step.friction - fit.curve)
    inflation = math.sqrt(count / max(count * (1.0 - alike) / (1.0 + alike), low.size))
    found, why = fit.estimates(inflation), ""
    late, level = found[-1], of_line @ (step.friction - rise(fit.value[:-1], step.since(found[-1])))
    if not fit.converged:
        why = "the fit did not converge; give a longer record, or less noise"
    for (name, unit), value, least, largest in zip(needed.items(), found, low, high, strict=False):
        if not value.error < value:
            why = why or f"{name} = {value.words(unit)}, an error as large as the value"
        if np.log(largest / value) < 1e-6 or np.log(value / least) < 1e-6:
            why = why or f"{name} = {value.words(unit)} is at the end of the range that was tried"
    if abs(late) > 0.999 * step.near > 1e-6 * step.displacement.max():
        why = why or (
            f"no step near the time {step.at:g} that was given; it would be at an end of what was kept before it; "
            "correct the time of the step"
        )
    if why:
        raise UndecidedError(f"not identified: {why}")
    velocity = step.before if step.measured and late > 0 else step.after
    kept = ("before", "after", "stretch", "length_unit", "time_unit", "friction_unit")
    common = {name: getattr(step, name) for name in kept} | {
        "at": Estimate(step.at + late / velocity, late.error / velocity),
        "level": float(level[0]),
        "trend": float(level[1]) if trend else 0.0,
        "rms": fit.rms,
        "misfit": fit.rms / float(np.ptp(step.friction)),
        "late": float(late),
    }
    return found, fit.covariance * inflation**2, common


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
    distance = after[min(top + fallen[0], after.size - 1)] - after[top] if fallen.size else 0.1 * after[-1]
    return direct, max(direct - end, 0.1 * direct), max(float(distance), float(after[min(2, after.size - 1)]))


def _fit_law(step: Step, law: Law, stiffness: float | None, *, trend: bool) -> StepFit:
    if not np.ptp(step.friction) > 1e-12 * np.abs(step.friction).max():  # means of bins round
        raise UndecidedError(f"the friction is {step.friction[0]:g} throughout: there is no step in it")
    count = 4 if stiffness is None else 3  # of the values that are fitted, but for when the step came

    def rise(value: Array, since: Array) -> Array:
        one = RateAndState(law=law, a=value[0], b=value[1], distance=value[2])
        return one.step(since, step.ratio, stiffness=float(value[3]) if stiffness is None else stiffness)

    def start(late: float, up: float = 1.0, wide: float = 1.0) -> Array:
        a, b, distance = _guess(step, late)
        return np.append([up * a, up * b, wide * distance, 2.0 * up * a / (wide * distance)][:count], late)

    a, reach, fine = start(0.0)[0], float(step.displacement.max()), float(np.median(np.diff(step.displacement)))
    low = np.array([1e-3 * a, 1e-3 * a, 0.1 * fine, 1e-3 * a / reach])
    high = np.array([1e2 * a, 1e2 * a, 10.0 * reach, 1e2 * a / fine])
    needed = {"a": step.friction_unit, "b": step.friction_unit, "D": step.length_unit}
    tried = [start(late) for late in np.linspace(-0.9 * step.near, 0.9 * step.near, 61)]
    starts = [start(0.0), start(0.0, 1.5, 0.5), start(0.0, 1.2, 2.0)]
    ranges = low[:count], high[:count]
    found, covariance, common = _fitted(step, rise, ranges, needed, starts, trend=trend, tried=tried)
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


def _contacts(thresholds: Distribution, width: float, ageing: float) -> Interface:
    """Attempts and time of ageing in units of ``x_s`` over the velocity: the force depends on their logarithms."""
    return Interface(
        thresholds=thresholds,
        temperature=Bell(width=width, attempts=1e6),
        ageing=LogarithmicGrowth(slope=ageing, time=1e-3),
    )


def _rise_of(thresholds: Distribution, level: float, ratio: float, *, linear: bool) -> Rise:
    """Of width, ageing, breaking displacement and stiffness; friction before the step says how large its unit is."""

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
        found[since > 0] = unit * force
        return found

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
    step = _the_step(data, at=at, before=before, after=after, span=span)
    if abs(thresholds.positive().moment(1) - 1.0) > 0.05:
        raise InputError(f"thresholds = {thresholds}: must have a mean of 1; the breaking displacement is fitted")
    rough, level = _fit_law(step, "slip", None, trend=trend), step.level()
    a, D, spring = rough.a / level * 0.5, float(rough.distance), float(rough.stiffness)
    ranges = np.array([0.1 * a, 1e-3 * a, 0.2 * D, 0.1 * spring]), np.array([10 * a, 30 * a, 20 * D, 10 * spring])
    needed = {"A": "", "c": "", "the breaking displacement": step.length_unit}
    starts = [np.array([a, 0.8 * a, wide * D, spring, rough.late]) for wide in (1.5, 3.0)]
    for by_response, most in ((True, 50),) if linear else ((True, 50), (False, 20)):
        rise = _rise_of(thresholds, level, step.ratio, linear=by_response)
        found, _, common = _fitted(step, rise, ranges, needed, starts, trend=trend, tolerance=1e-4, most=most)
        starts = [np.array(found)]
    return ContactsFit(
        thresholds=thresholds,
        width=found[0],
        ageing=found[1],
        breaking_displacement=found[2],
        stiffness=found[3],
        linear=linear,
        **common,
    )
