"""A measured velocity step: as rate and state, and as contacts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.answers import Answer
from stickslip.errors import InputError, UndecidedError, number, shown, whole
from stickslip.model import Bell, Gamma, Interface, LogarithmicGrowth
from stickslip.model.distribution import Distribution
from stickslip.rate_state.contacts import finite_step, step_on_spring
from stickslip.rate_state.fitting import Fit, least_squares
from stickslip.rate_state.laws import LAWS, Law, RateAndState
from stickslip.theory import kinetic_friction

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

_FRICTIONS = ("mu", "spring_force", "friction_force", "friction")
"""Variables that may hold the friction, in the order in which they are looked for."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """A velocity step as it is fitted: friction over the displacement of the load point, 0 at the step.

    Attributes
    ----------
    displacement, friction : ndarray, shape (n,)
        In bins, rising.
    before, after : float
        Velocities of the load point.
    """

    displacement: Array
    friction: Array
    before: float
    after: float


@dataclass(frozen=True, kw_only=True, repr=False)
class StepFit(Answer):
    """Rate-and-state parameters of a step, in the units of the data.

    Attributes
    ----------
    law : {"ageing", "slip"}
    a, b, distance, stiffness : float
        The stiffness is that of whatever is between load point and sliding surface, friction per displacement.
    a_error, b_error, distance_error, stiffness_error : float
        Standard errors, larger where neighbouring residuals are alike; 0 for a stiffness that was given.
    level, trend : float
        Friction before the step, and its slope in displacement.
    rms : float
        Of the residuals.
    misfit : float
        rms over the range of the friction.
    before, after : float
        Velocities of the load point.
    """

    law: Law
    a: float
    b: float
    distance: float
    stiffness: float
    a_error: float
    b_error: float
    distance_error: float
    stiffness_error: float
    level: float
    trend: float
    rms: float
    misfit: float
    before: float
    after: float

    @property
    def parameters(self) -> RateAndState:
        """The law and its parameters, to slide with."""
        return RateAndState(law=self.law, a=self.a, b=self.b, distance=self.distance)

    @property
    def critical_stiffness(self) -> float:
        """``(b - a)/D``: with a softer spring steady sliding is unstable; 0 if it never is."""
        return self.parameters.critical_stiffness()

    def friction(self, displacement: ArrayLike) -> Array:
        """Friction of the fit over the displacement of the load point, 0 at the step."""
        x = np.asarray(displacement, dtype=float)
        return self.level + self.trend * x + _rise(self.parameters, self.stiffness, self.after / self.before, x)

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values."""
        return super().to_dict() | {"critical_stiffness": self.critical_stiffness}

    def __str__(self) -> str:
        return (
            f"{self.law} law: a = {_pm(self.a, self.a_error)}, b = {_pm(self.b, self.b_error)}, "
            f"D = {_pm(self.distance, self.distance_error)}, stiffness {_pm(self.stiffness, self.stiffness_error)}; "
            f"rms {self.rms:.3g} ({100 * self.misfit:.2g} % of the range)"
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class ContactsFit(Answer):
    """A step read as contacts with Bell activation and logarithmic ageing, in the units of the data.

    Attributes
    ----------
    thresholds : Distribution
        Of mean 1, in units of `breaking_displacement`.
    width, ageing : float
        Activation width ``A`` and slope of ageing ``c``, over the mean threshold.
    breaking_displacement : float
        Mean ``x_s``, in the unit of displacement.
    stiffness : float
        Between load point and sliding surface, friction per displacement.
    width_error, ageing_error, breaking_displacement_error, stiffness_error : float
        Standard errors.
    level, trend, rms : float
        As in `StepFit`.
    before, after : float
        Velocities of the load point.
    linear : bool
        Whether by the linear response alone.
    """

    thresholds: Distribution
    width: float
    ageing: float
    breaking_displacement: float
    stiffness: float
    width_error: float
    ageing_error: float
    breaking_displacement_error: float
    stiffness_error: float
    level: float
    trend: float
    rms: float
    before: float
    after: float
    linear: bool

    @property
    def interface(self) -> Interface:
        """The interface, in natural units with ``breaking_displacement/before`` as the unit of time."""
        return _contacts(self.thresholds, self.width, self.ageing)

    def friction(self, displacement: ArrayLike) -> Array:
        """Friction of the fit over the displacement of the load point, 0 at the step."""
        x = np.asarray(displacement, dtype=float)
        place = (self.width, self.ageing, self.breaking_displacement, self.stiffness)
        ratio = self.after / self.before
        return (
            self.level
            + self.trend * x
            + _rise_of_contacts(self.thresholds, *place, self.level, ratio, x, linear=self.linear)
        )

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values."""
        return super().to_dict() | {"thresholds": str(self.thresholds)}

    def __str__(self) -> str:
        cv = self.thresholds.standard_deviation() / self.thresholds.moment(1)
        return (
            f"contacts, thresholds with CV {cv:.2g}: A = {_pm(self.width, self.width_error)}, "
            f"c = {_pm(self.ageing, self.ageing_error)}, breaking displacement "
            f"{_pm(self.breaking_displacement, self.breaking_displacement_error)}, stiffness "
            f"{_pm(self.stiffness, self.stiffness_error)}; rms {self.rms:.3g}"
        )


def _pm(value: float, error: float) -> str:
    return f"{value:.4g} +- {error:.1g}" if error > 0 else f"{value:.4g}"


def velocity_step_in(
    data: xr.Dataset,
    *,
    at: float,
    before: float,
    after: float,
    span: tuple[float, float] | None = None,
    bins: int = 800,
) -> Step:
    """Cut a velocity step out of a run or a measured trace, in bins of displacement.

    Parameters
    ----------
    data : Dataset
        As `read_trace` or a run gives it: ``mu``, ``spring_force``, ``friction_force`` or ``friction`` along ``time``;
        with ``measured_displacement`` that is the displacement, else the velocities times the time.
    at : float
        Time of the step, in the unit of time of the data.
    before, after : float
        Velocities of the load point, in displacement per time of the data.
    span : (float, float), optional
        How much displacement before and after the step; by default all there is after it, and a tenth of that before.
    bins : int
        Into how many bins of equal displacement the data is averaged, at most.

    Raises
    ------
    InputError
        If there is no such variable, or less than 30 samples after the step.
    """
    name = next((one for one in _FRICTIONS if one in data), None)
    if name is None or "time" not in data.coords:
        raise InputError(f"data: holds no friction along a time; it must have one of {', '.join(_FRICTIONS)}")
    time, friction = data["time"].to_numpy().astype(float), data[name].to_numpy().astype(float)
    at = number("at", at, at_least=float(time[0]), at_most=float(time[-1]), hint="time of the step")
    before = number("before", before, above=0, hint="velocity before the step")
    after = number("after", after, above=0, hint="velocity after the step")
    if before == after:
        raise InputError(f"after = {after:g}: is the velocity before the step, too; give another one")
    since = time - at
    x = np.where(since < 0, before, after) * since
    if "measured_displacement" in data:
        place = data["measured_displacement"].to_numpy().astype(float)
        x = place - float(np.interp(at, time, place))
    good = np.isfinite(x) & np.isfinite(friction)
    x, friction = x[good], friction[good]
    back, forth = span or (0.1 * float(x.max()), float(x.max()))
    inside = (x >= -back) & (x <= forth)
    x, friction = x[inside], friction[inside]
    if np.count_nonzero(x > 0) < 30:
        raise InputError(f"at = {at:g}: {np.count_nonzero(x > 0)} samples after the step; there must be at least 30")
    count = min(whole("bins", bins, at_least=30, at_most=100_000), x.size)
    edges = np.linspace(float(x.min()), float(x.max()) * (1 + 1e-12), count + 1)
    place_in = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, count - 1)
    number_in = np.bincount(place_in, minlength=count)
    held = number_in > 0
    mean_x = np.bincount(place_in, weights=x, minlength=count)[held] / number_in[held]
    mean_friction = np.bincount(place_in, weights=friction, minlength=count)[held] / number_in[held]
    order = np.argsort(mean_x)
    return Step(displacement=mean_x[order], friction=mean_friction[order], before=before, after=after)


def fit_rate_and_state(
    data: xr.Dataset | Step,
    *,
    at: float | None = None,
    before: float | None = None,
    after: float | None = None,
    law: Literal["best", "ageing", "slip"] = "best",
    stiffness: float | None = None,
    span: tuple[float, float] | None = None,
    trend: bool = False,
) -> StepFit:
    """Fit rate-and-state parameters to a velocity step of a run or of a measured trace.

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
        If nothing fits.

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
    >>> fit = ss.fit_rate_and_state(trace, at=10.0, before=1.0, after=3.0)
    >>> fit.law, round(fit.distance, 1)
    ('slip', 5.0)
    """
    step = _the_step(data, at, before, after, span)
    if law not in ("best", *LAWS):
        raise InputError(f"law = {shown(law)}: must be 'best', 'ageing' or 'slip'")
    if stiffness is not None:
        stiffness = number("stiffness", stiffness, above=0, hint="friction per displacement")
    found = [_fit_law(step, one, stiffness, trend) for one in (LAWS if law == "best" else (law,))]
    return min(found, key=lambda one: one.rms)


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


def _rise(parameters: RateAndState, stiffness: float, ratio: float, x: Array) -> Array:
    """Friction after the step over that before it, at any displacements."""
    found = np.zeros_like(x)
    later = np.unique(x[x > 0])
    if later.size:
        found[x > 0] = np.interp(x[x > 0], later, parameters.step(later, ratio, stiffness=stiffness))
    return found


def _with_line(curve: Callable[[Array], Array], step: Step, trend: bool) -> Callable[[Array], Array]:
    """The curve of some values, with the level and the trend that fit best beside it."""

    def model(value: Array) -> Array:
        rise = curve(value)
        level, slope = _line(step, rise, trend)
        return np.asarray(rise + level + slope * step.displacement)

    return model


def _line(step: Step, rise: Array, trend: bool) -> Array:
    """Level and trend that fit best beside a rise."""
    left = step.friction - rise
    if not trend:
        return np.array([left.mean(), 0.0])
    slope, level = np.polyfit(step.displacement, left, 1)
    return np.array([level, slope])


def _inflation(step: Step, fit: Fit) -> float:
    """How much larger errors are than those of independent residuals, by the likeness of neighbours."""
    off = step.friction - fit.curve
    likeness = float(off[1:] @ off[:-1] / (off @ off)) if np.any(off) else 0.0
    likeness = min(max(likeness - 2.0 / math.sqrt(off.size), 0.0), 0.95)
    return math.sqrt((1.0 + likeness) / (1.0 - likeness))


def _guess(step: Step) -> tuple[float, float, float]:
    """About a, b and D."""
    x, ratio = step.displacement, math.log(step.after / step.before)
    level = float(np.median(step.friction[x <= 0])) if np.any(x <= 0) else float(step.friction[0])
    rise = (step.friction[x > 0] - level) / ratio
    after = x[x > 0]
    end = float(np.mean(rise[-max(rise.size // 5, 1) :]))
    smooth = np.convolve(rise, np.ones(5) / 5, mode="same") if rise.size > 20 else rise
    top = int(np.argmax(smooth[: max(rise.size // 2, 1)]))
    direct = max(float(smooth[top]), 0.2 * float(np.ptp(rise)))
    fallen = np.flatnonzero(smooth[top:] < end + 0.37 * (smooth[top] - end))
    distance = (
        float(after[min(top + int(fallen[0]), after.size - 1)] - after[top]) if fallen.size else 0.1 * float(after[-1])
    )
    return direct, max(direct - end, 0.1 * direct), max(distance, float(after[min(2, after.size - 1)]))


def _fit_law(step: Step, law: Law, stiffness: float | None, trend: bool) -> StepFit:
    ratio, x = step.after / step.before, step.displacement
    a, b, distance = _guess(step)

    def curve(value: Array) -> Array:
        spring = stiffness if stiffness is not None else float(value[3])
        return _rise(RateAndState(law=law, a=value[0], b=value[1], distance=value[2]), spring, ratio, x)

    reach, fine = float(x.max()), float(np.median(np.diff(x)))
    low, high = [1e-3 * a, 1e-3 * a, 0.1 * fine], [1e2 * a, 1e2 * a, 10.0 * reach]
    starts = [np.array([a * up, b * up, distance * wide]) for up, wide in ((1.0, 1.0), (1.5, 0.5), (1.2, 2.0))]
    if stiffness is None:
        low, high = [*low, 1e-3 * a / reach], [*high, 1e2 * a / fine]
        starts = [np.append(start, 2.0 * start[0] / start[2]) for start in starts]
    unknown = len(low)
    fit = least_squares(
        _with_line(curve, step, trend), step.friction, starts, np.ones(unknown, bool), np.array(low), np.array(high)
    )
    error = fit.error * _inflation(step, fit)
    level, slope = _line(step, curve(fit.value), trend).tolist()
    return StepFit(
        law=law,
        a=float(fit.value[0]),
        b=float(fit.value[1]),
        distance=float(fit.value[2]),
        stiffness=stiffness if stiffness is not None else float(fit.value[3]),
        a_error=float(error[0]),
        b_error=float(error[1]),
        distance_error=float(error[2]),
        stiffness_error=0.0 if stiffness is not None else float(error[3]),
        level=level,
        trend=slope,
        rms=fit.rms,
        misfit=fit.rms / float(np.ptp(step.friction)),
        before=step.before,
        after=step.after,
    )


# ---------------------------------------------------------------- as contacts

_ATTEMPTS, _TIME = 1e6, 1e-3
"""Attempt rate and time of ageing, in units of ``x_s`` over the velocity: the force depends on their logarithms."""


def _contacts(thresholds: Distribution, width: float, ageing: float) -> Interface:
    return Interface(
        thresholds=thresholds,
        temperature=Bell(width=width, attempts=_ATTEMPTS),
        ageing=LogarithmicGrowth(slope=ageing, time=_TIME),
    )


def _rise_of_contacts(
    thresholds: Distribution,
    width: float,
    ageing: float,
    x_s: float,
    stiffness: float,
    level: float,
    ratio: float,
    x: Array,
    *,
    linear: bool = False,
) -> Array:
    """Friction after the step over that before it; the level says how large a unit of force is."""
    interface = _contacts(thresholds, width, ageing)
    unit = level / kinetic_friction(interface, 1.0)
    spring, later = stiffness * x_s / unit, x > 0
    found = np.zeros_like(x)
    if linear:
        found[later] = math.log(ratio) * step_on_spring(interface, 1.0, x[later] / x_s, spring, coarse=3.0)
    else:
        lead, force = finite_step(interface, 1.0, ratio, float(x.max()) / x_s + 1.0, stiffness=spring, fineness=1.0)
        found[later] = np.interp(x[later] / x_s, lead, force)
    return unit * found


def fit_contacts(
    data: xr.Dataset | Step,
    *,
    at: float | None = None,
    before: float | None = None,
    after: float | None = None,
    thresholds: Distribution = Gamma(mean=1.0, std=0.75),
    span: tuple[float, float] | None = None,
    trend: bool = False,
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
    rough = _fit_law(step, "slip", None, trend)
    ratio, x = step.after / step.before, step.displacement
    level = float(np.median(step.friction[x <= 0])) if np.any(x <= 0) else float(step.friction[0])
    a = rough.a / level * 0.5
    fit: Fit | None = None
    starts = [np.array([a, 0.8 * a, wide * rough.distance, rough.stiffness]) for wide in (1.5, 3.0)]
    for rough_one in (True,) if linear else (True, False):

        def curve(value: Array, rough_one: bool = rough_one) -> Array:
            width, ageing, x_s, spring = value.tolist()
            return _rise_of_contacts(thresholds, width, ageing, x_s, spring, level, ratio, x, linear=rough_one)

        fit = least_squares(
            _with_line(curve, step, trend),
            step.friction,
            starts,
            np.ones(4, bool),
            np.array([0.1 * a, 1e-3 * a, 0.2 * rough.distance, 0.1 * rough.stiffness]),
            np.array([10.0 * a, 30.0 * a, 20.0 * rough.distance, 10.0 * rough.stiffness]),
            tolerance=1e-4,
            most=30 if rough_one else 6,
        )
        starts = [fit.value]
    if fit is None:
        raise UndecidedError("no contacts fit")
    error = fit.error * _inflation(step, fit)
    line = _line(step, curve(fit.value), trend).tolist()
    return ContactsFit(
        thresholds=thresholds,
        width=float(fit.value[0]),
        ageing=float(fit.value[1]),
        breaking_displacement=float(fit.value[2]),
        stiffness=float(fit.value[3]),
        width_error=float(error[0]),
        ageing_error=float(error[1]),
        breaking_displacement_error=float(error[2]),
        stiffness_error=float(error[3]),
        level=line[0],
        trend=line[1],
        rms=fit.rms,
        before=step.before,
        after=step.after,
        linear=linear,
    )
