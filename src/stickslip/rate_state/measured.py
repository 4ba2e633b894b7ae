"""A measured velocity step: as rate and state, and as contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.answers import Answer
from stickslip.errors import InputError, UndecidedError, number, shown, whole
from stickslip.model import Bell, Gamma, Interface, LogarithmicGrowth
from stickslip.model.distribution import Distribution
from stickslip.rate_state.contacts import finite_step, step_on_spring
from stickslip.rate_state.fitting import Estimate, Fit, errors, least_squares
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
    at : float
        Time at which it was said to come.
    measured : bool
        Whether the displacement was measured; else it is the velocities times the time since the step.
    length_unit, time_unit, friction_unit : str
        Of the data; empty where it has none.
    """

    displacement: Array
    friction: Array
    before: float
    after: float
    at: float = 0.0
    measured: bool = True
    length_unit: str = ""
    time_unit: str = ""
    friction_unit: str = ""


@dataclass(frozen=True, kw_only=True, repr=False)
class FittedStep(Answer):
    """What fits of a step have in common, in the units of the data; `Estimate` is a number with its standard ``error``.

    Attributes
    ----------
    stiffness : Estimate
        Of whatever is between load point and sliding surface, friction per displacement.
    at : Estimate
        Time of the step.
    level, trend : float
        Friction before the step, and its slope in displacement.
    rms, misfit : float
        Of the residuals, and the same over the range of the friction.
    before, after : float
        Velocities of the load point.
    late, stretch : float
        How much displacement after the given time the step came, and how much of it, after the step, one before the
        given time is worth: 1 where displacement was measured.
    length_unit, time_unit, friction_unit : str
    """

    stiffness: Estimate
    at: Estimate
    level: float
    trend: float
    rms: float
    misfit: float
    before: float
    after: float
    late: float = 0.0
    stretch: float = 1.0
    length_unit: str = ""
    time_unit: str = ""
    friction_unit: str = ""

    def friction(self, displacement: ArrayLike) -> Array:
        """Friction of the fit over the displacement of the load point, 0 at the time that was given."""
        x = np.asarray(displacement, dtype=float)
        return self.level + self.trend * x + self._rise(np.where(x < 0, self.stretch, 1.0) * x - self.late)

    def _rise(self, x: Array) -> Array:
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values, each estimate with its error."""
        return super().to_dict() | errors(self)

    def _end(self) -> str:
        if 0 < self.stiffness.error < self.stiffness or not self.stiffness.error:
            spring = f"stiffness {self.stiffness.words(_over(self.friction_unit, self.length_unit))}"
        else:
            spring = "stiffness not identified"
        rms = f"rms {self.rms:.3g} ({100 * self.misfit:.2g} % of the range)"
        return f"{spring}; step at {self.at.words(self.time_unit)}; {rms}"


def _over(unit: str, other: str) -> str:
    return f"{unit or 1}/{other}" if other else unit


@dataclass(frozen=True, kw_only=True, repr=False)
class StepFit(FittedStep):
    """Rate-and-state parameters of a step, beside what `FittedStep` has.

    Attributes
    ----------
    law : {"ageing", "slip"}
    a, b, distance : Estimate
    a_minus_b : Estimate
        Its error is that of the difference: a and b err together.
    """

    law: Law
    a: Estimate
    b: Estimate
    distance: Estimate
    a_minus_b: Estimate

    @property
    def parameters(self) -> RateAndState:
        """The law and its parameters, to slide with."""
        return RateAndState(law=self.law, a=self.a, b=self.b, distance=self.distance)

    @property
    def critical_stiffness(self) -> float:
        """``(b - a)/D``: with a softer spring steady sliding is unstable; 0 if it never is."""
        return self.parameters.critical_stiffness()

    def _rise(self, x: Array) -> Array:
        return _rise(self.parameters, self.stiffness, self.after / self.before, x)

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
    """A step read as contacts with Bell activation and logarithmic ageing, beside what `FittedStep` has.

    Attributes
    ----------
    thresholds : Distribution
        Of mean 1, in units of `breaking_displacement`.
    width, ageing : Estimate
        Activation width ``A`` and slope of ageing ``c``, over the mean threshold.
    breaking_displacement : Estimate
        Mean ``x_s``, in the unit of displacement.
    linear : bool
        Whether by the linear response alone.
    """

    thresholds: Distribution
    width: Estimate
    ageing: Estimate
    breaking_displacement: Estimate
    linear: bool

    @property
    def interface(self) -> Interface:
        """The interface, in natural units with ``breaking_displacement/before`` as the unit of time."""
        return _contacts(self.thresholds, self.width, self.ageing)

    def _rise(self, x: Array) -> Array:
        place = (self.width, self.ageing, self.breaking_displacement, self.stiffness)
        ratio = self.after / self.before
        return _rise_of_contacts(self.thresholds, *place, self.level, ratio, x, linear=self.linear)

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values, each estimate with its error."""
        return super().to_dict() | {"thresholds": str(self.thresholds)}

    def __str__(self) -> str:
        cv = self.thresholds.standard_deviation() / self.thresholds.moment(1)
        return (
            f"contacts, thresholds with CV {cv:.2g}: A = {self.width.words()}, c = {self.ageing.words()}, breaking "
            f"displacement {self.breaking_displacement.words(self.length_unit)}, {self._end()}"
        )


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
        As `read_trace` or a run gives it: ``mu``, ``spring_force``, ``friction_force`` or ``friction`` along ``time``.
        The displacement of the load point is ``measured_displacement`` or ``displacement`` (of a run that is the
        slider's, and is not used), else the velocities times the time.
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
    names = ("measured_displacement",) if "velocity" in data else ("measured_displacement", "displacement")
    way = next((one for one in names if one in data), None)
    if way is not None:
        place = data[way].to_numpy().astype(float)
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
    units = {one: str(data[one].attrs.get("units", "")) for one in (name, "time", way) if one is not None}
    return Step(
        displacement=mean_x[order],
        friction=mean_friction[order],
        before=before,
        after=after,
        at=at,
        measured=way is not None,
        length_unit="" if way is None else units[way],
        time_unit=units["time"],
        friction_unit=units[name].removeprefix("1"),
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
    >>> fit = ss.fit_rate_and_state(trace, at=10.0, before=1.0, after=3.0)
    >>> fit.law, round(fit.distance, 1)
    ('slip', 5.0)
    """
    step = _the_step(data, at, before, after, span)
    if law not in ("best", *LAWS):
        raise InputError(f"law = {shown(law)}: must be 'best', 'ageing' or 'slip'")
    if stiffness is not None:
        stiffness = number("stiffness", stiffness, above=0, hint="friction per displacement")
    laws, found, failed = LAWS if law == "best" else (law,), [], []
    for one in laws:
        try:
            found.append(_fit_law(step, one, stiffness, trend))
        except UndecidedError as error:
            failed.append(str(error))
    if not found:
        raise UndecidedError(failed[0] + _swapped(step, laws, stiffness, trend))
    return min(found, key=lambda one: one.rms)


def _swapped(step: Step, laws: Sequence[Law], stiffness: float | None, trend: bool) -> str:
    """Ask whether the velocities were swapped, where that fits."""
    x, ratio = step.displacement, step.after / step.before
    turned = x if step.measured else np.where(x < 0, ratio, 1.0 / ratio) * x
    other = replace(step, displacement=turned, before=step.after, after=step.before)
    for law in laws:
        try:
            _fit_law(other, law, stiffness, trend)
        except UndecidedError:
            continue
        return (
            f"; a step from {step.after:g} to {step.before:g} does fit: "
            "are the velocities before and after it (--from and --to) swapped?"
        )
    return ""


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


def _line(step: Step, rise: Array, trend: bool) -> Array:
    """Level and trend that fit best beside a rise."""
    left = step.friction - rise
    if not trend:
        return np.array([left.mean(), 0.0])
    slope, level = np.polyfit(step.displacement, left, 1)
    return np.array([level, slope])


def _inflation(residual: Array, parameters: int) -> float:
    """How much larger errors are than those of independent residuals.

    Bartlett's for noise of first order: n samples whose neighbours correlate by r are worth n (1 - r)/(1 + r), and
    cannot be worth less than one for each parameter.
    """
    square = float(residual @ residual)
    likeness = max(float(residual[1:] @ residual[:-1]) / square, 0.0) if square > 0 else 0.0
    worth = max(residual.size * (1.0 - likeness) / (1.0 + likeness), parameters)
    return math.sqrt(residual.size / worth)


def _past(step: Step, late: float) -> Array:
    """Displacement since the step, if it came later than was said: by so much displacement at the velocity after it."""
    x = step.displacement
    return (x if step.measured else np.where(x < 0, _stretch(step), 1.0) * x) - late


def _stretch(step: Step) -> float:
    return 1.0 if step.measured else step.after / step.before


def _fit_curve(
    step: Step,
    curve: Callable[[Array, Array], Array],
    starts: Sequence[Array],
    lowest: Array,
    highest: Array,
    needed: dict[str, tuple[int, str]],
    trend: bool,
    *,
    tolerance: float = 1e-10,
    most: int = 200,
) -> tuple[Array, Array, dict[str, Any]]:
    """Fit the values of a curve after the step, and when that came; the last value is how late it was.

    Parameters
    ----------
    needed : dict
        Values without which nothing is known: name to index and unit.

    Returns
    -------
    (ndarray, ndarray, dict)
        Values, covariance with the inflation of the errors, and what `FittedStep` has.
    """
    low, high = np.append(lowest, -_near(step)), np.append(highest, _near(step))

    def model(value: Array) -> Array:
        rise = curve(value[:-1], _past(step, float(value[-1])))
        level, slope = _line(step, rise, trend)
        return np.asarray(rise + level + slope * step.displacement)

    logarithmic = np.append(np.ones(lowest.size, bool), False)
    fit = least_squares(model, step.friction, starts, logarithmic, low, high, tolerance, most)
    covariance = fit.covariance * _inflation(step.friction - fit.curve, low.size) ** 2
    _identified(step, fit, np.sqrt(np.diag(covariance)), low, high, needed)
    late = float(fit.value[-1])
    velocity = step.before if step.measured and late > 0 else step.after
    level, slope = _line(step, curve(fit.value[:-1], _past(step, late)), trend).tolist()
    return (
        fit.value,
        covariance,
        {
            "at": Estimate(step.at + late / velocity, math.sqrt(covariance[-1, -1]) / velocity),
            "level": level,
            "trend": slope,
            "rms": fit.rms,
            "misfit": fit.rms / float(np.ptp(step.friction)),
            "late": late,
            "stretch": _stretch(step),
            **{name: getattr(step, name) for name in ("before", "after", "length_unit", "time_unit", "friction_unit")},
        },
    )


def _near(step: Step) -> float:
    """How far off the given time the step is looked for, in displacement: as far as there is data before it."""
    return max(-float(step.displacement.min()) * _stretch(step), 1e-9 * float(step.displacement.max()))


def _identified(
    step: Step, fit: Fit, error: Array, low: Array, high: Array, needed: dict[str, tuple[int, str]]
) -> None:
    """Refuse a fit that tells nothing."""
    if not fit.converged:
        raise UndecidedError("not identified: the fit did not converge; give a longer record, or less noise")
    for name, (i, unit) in needed.items():
        value = Estimate(fit.value[i], error[i])
        if not error[i] < value:
            raise UndecidedError(f"not identified: {name} = {value.words(unit)}, an error as large as the value")
        if np.log(high[i] / value) < 1e-6 or np.log(value / low[i]) < 1e-6:
            raise UndecidedError(
                f"not identified: {name} = {value.words(unit)} is at the end of the range that was tried"
            )
    if abs(fit.value[-1]) > 0.999 * high[-1] > 1e-6 * step.displacement.max():
        raise UndecidedError(
            f"not identified: no step near the time {step.at:g} that was given; it would be at an end of what was kept "
            "before it; correct the time of the step"
        )


def _guess(step: Step, late: float = 0.0) -> tuple[float, float, float]:
    """About a, b and D."""
    x, ratio = _past(step, late), math.log(step.after / step.before)
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
    if not np.ptp(step.friction) > 1e-12 * np.abs(step.friction).max():  # means of bins round
        raise UndecidedError(f"the friction is {step.friction[0]:g} throughout: there is no step in it")
    ratio, x = step.after / step.before, step.displacement

    def curve(value: Array, past: Array) -> Array:
        spring = stiffness if stiffness is not None else float(value[3])
        return _rise(RateAndState(law=law, a=value[0], b=value[1], distance=value[2]), spring, ratio, past)

    def start(late: float, up: float = 1.0, wide: float = 1.0) -> Array:
        a, b, distance = _guess(step, late)
        spring = [] if stiffness is not None else [2.0 * up * a / (wide * distance)]
        return np.array([up * a, up * b, wide * distance, *spring, late])

    def left(one: Array) -> float:
        try:
            rise = curve(one[:-1], _past(step, float(one[-1])))
        except UndecidedError:
            return math.inf
        level, slope = _line(step, rise, trend)
        return float(np.sum((step.friction - rise - level - slope * x) ** 2))

    near = _near(step)
    best = min((start(late) for late in np.linspace(-0.9 * near, 0.9 * near, 61)), key=left)
    a, _, _ = _guess(step)
    reach, fine = float(x.max()), float(np.median(np.diff(x)))
    lowest, highest = [1e-3 * a, 1e-3 * a, 0.1 * fine], [1e2 * a, 1e2 * a, 10.0 * reach]
    if stiffness is None:
        lowest, highest = [*lowest, 1e-3 * a / reach], [*highest, 1e2 * a / fine]
    value, covariance, found = _fit_curve(
        step,
        curve,
        [start(0.0), start(0.0, 1.5, 0.5), start(0.0, 1.2, 2.0), best],
        np.array(lowest),
        np.array(highest),
        {"a": (0, step.friction_unit), "b": (1, step.friction_unit), "D": (2, step.length_unit)},
        trend,
    )
    error = np.sqrt(np.diag(covariance))
    apart = math.sqrt(max(covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1], 0.0))
    return StepFit(
        law=law,
        a=Estimate(value[0], error[0]),
        b=Estimate(value[1], error[1]),
        distance=Estimate(value[2], error[2]),
        a_minus_b=Estimate(value[0] - value[1], apart),
        stiffness=Estimate(stiffness) if stiffness is not None else Estimate(value[3], error[3]),
        **found,
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
    rough = _fit_law(step, "slip", None, trend)
    ratio, x = step.after / step.before, step.displacement
    level = float(np.median(step.friction[x <= 0])) if np.any(x <= 0) else float(step.friction[0])
    a = rough.a / level * 0.5
    starts = [np.array([a, 0.8 * a, wide * rough.distance, rough.stiffness, rough.late]) for wide in (1.5, 3.0)]

    def fitted(starts: Sequence[Array], *, linear: bool, most: int) -> tuple[Array, Array, dict[str, Any]]:
        def curve(value: Array, past: Array) -> Array:
            width, ageing, x_s, spring = value.tolist()
            return _rise_of_contacts(thresholds, width, ageing, x_s, spring, level, ratio, past, linear=linear)

        return _fit_curve(
            step,
            curve,
            starts,
            np.array([0.1 * a, 1e-3 * a, 0.2 * rough.distance, 0.1 * rough.stiffness]),
            np.array([10.0 * a, 30.0 * a, 20.0 * rough.distance, 10.0 * rough.stiffness]),
            {"A": (0, ""), "c": (1, ""), "the breaking displacement": (2, step.length_unit)},
            trend,
            tolerance=1e-4,
            most=most,
        )

    value, covariance, found = fitted(starts, linear=True, most=50)
    if not linear:
        value, covariance, found = fitted([value], linear=False, most=20)
    width, ageing, x_s, spring = map(Estimate, value[:4], np.sqrt(np.diag(covariance)))
    return ContactsFit(
        thresholds=thresholds,
        width=width,
        ageing=ageing,
        breaking_displacement=x_s,
        stiffness=spring,
        linear=linear,
        **found,
    )
