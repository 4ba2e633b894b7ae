"""The rate-and-state law that best describes an interface: its a, b and D, how well
they describe the interface, and where they fail.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Self

import numpy as np

from stickslip.answers import Answer, plain
from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.measure.trace import Array
from stickslip.model import Interface, LogarithmicGrowth, Rig, Scales, Slider, constant
from stickslip.model.records import Number, converted
from stickslip.model.units import si_unit
from stickslip.rate_state.contacts import (
    ROUGH,
    contact_stiffness,
    finite_step,
    small_step,
)
from stickslip.rate_state.fitting import Estimate, LeastSquaresFit, least_squares
from stickslip.rate_state.laws import Law, RateAndState, laws_named
from stickslip.sliding import kinetic_friction, respond
from stickslip.stability.critical import critical_spring
from stickslip.words import engineering

SLIP = 6.0  # slip over which steps are fitted, in mean thresholds
_POINTS = 600  # number of values of the slip at which they are compared
# An interface is rate-and-state-like below this misfit of a small step, and these
# relative changes of the parameters over a decade of velocity.
MISFIT = 0.05
DRIFTS = {"a": 0.10, "b": 0.10, "D": 0.20}
# The direct effect is at least this fraction of the fitted a, at this wave number, in
# inverse mean thresholds.
_RESOLVED = 0.3
_FAST = 200.0
# range of a and b over the largest change of the force; its lower end stands for 0, as
# logarithms are fitted
_LEAST = 1e-7
_MOST = 1e3


@dataclass(frozen=True, kw_only=True, repr=False)
class RateAndStateFit(Answer):
    """Rate-and-state parameters of an interface, and how well they describe it.

    They are per contact and in natural units; `in_units` converts them to those of a
    rig. `Estimate` is a number with its standard ``error``, which is that of the fit of
    the step, not that of the law.
    """

    #: "ageing" or "slip": the one whose distance differs less between a step up and a
    #: step down
    law: Law
    #: direct effect; as `b` and `distance`, fitted to the step asked for or, if the
    #: interface is not rate-and-state-like, to a small step
    a: Annotated[Estimate, Number("f_s")]
    b: Annotated[Estimate, Number("f_s")]  #: evolution effect
    distance: Annotated[Estimate, Number("x_s")]  #: ``D``, over which the state evolves
    misfit: float  #: of a small step: rms residual over the range of the force
    step_misfit: float | None  #: misfit of the step asked for
    #: relative changes of a, b and D of small steps over a decade of velocity
    drift: tuple[float, ...]
    #: ``D`` of the step up over that of the step down
    asymmetry: float | None

    #: Growth of the peaks after holds per e-fold of the hold time, for long holds: the
    #: slope of ageing. None if thresholds do not grow with the logarithm of age.
    healing: Annotated[float | None, Number("f_s")]

    velocity: Annotated[float, Number("x_s/time")]  #: velocity before the step
    step: float  #: ratio of the velocities
    kinetic_friction: Annotated[float, Number("f_s")]  #: force in smooth sliding
    contact_stiffness: Annotated[float, Number("k")]  #: of the attached contacts

    #: Stiffness of the driving spring, in series with the contacts, below which smooth
    #: sliding of a massless slider is unstable by rate and state.
    critical_stiffness: Annotated[float, Number("k")]

    #: critical stiffness by the contacts themselves
    exact_critical_stiffness: Annotated[float, Number("k")]

    holds: bool  #: whether the interface is rate-and-state-like
    reason: str  #: which test fails, or what was tested
    #: scales of the rig if the numbers are in its units, N and m; None in natural units
    scales: Scales | None = None

    def in_units(self, of: Rig | Scales) -> Self:
        """Return the parameters, which are in natural units, in those of a rig, with
        the forces of all its contacts, in N.
        """
        scales = of.scales if isinstance(of, Rig) else of
        if scales is None or self.scales is not None:
            return self
        return replace(converted(self, scales.si), scales=scales)

    @property
    def parameters(self) -> RateAndState:
        """The law with its parameters."""
        return RateAndState(law=self.law, a=self.a, b=self.b, distance=self.distance)

    @property
    def healing_over_b(self) -> float | None:
        """Healing over b: 1 by rate and state, but ``2 c/(A + c)`` for contacts with
        the ageing slope ``c`` and the activation width ``A``.
        """
        return None if self.healing is None else self.healing / self.b

    @property
    def ratio(self) -> float:
        """Critical stiffness by rate and state over the exact one; NaN if sliding is
        stable on any spring by both.
        """
        exact = self.exact_critical_stiffness
        fitted = self.critical_stiffness
        if exact > 0:
            return fitted / exact
        return math.inf if fitted > 0 else math.nan

    @property
    def danger(self) -> Literal["none", "too low", "too high"]:
        """Whether the critical stiffness of rate and state is too low, which is unsafe,
        or too high.
        """
        if math.isnan(self.ratio) or abs(self.ratio - 1.0) < 0.01:
            return "none"
        return "too low" if self.ratio < 1.0 else "too high"

    def to_dict(self) -> dict[str, Any]:
        """Return all fields and derived numbers as plain values."""
        derived = {
            "healing_over_b": self.healing_over_b,
            "ratio": self.ratio,
            "danger": self.danger,
        }
        return {**super().to_dict(), **plain(derived)}

    def __str__(self) -> str:
        if not self.holds:
            return f"not rate-and-state: {self.reason}"
        force, length, spring = (
            "" if self.scales is None else si_unit(unit) for unit in ("f_s", "x_s", "k")
        )
        exact, fitted = (
            engineering(k, spring)
            for k in (self.exact_critical_stiffness, self.critical_stiffness)
        )
        side = {
            "none": "",
            "too low": "on the unsafe side",
            "too high": "on the safe side",
        }[self.danger]
        percent = (
            f"{100 * abs(1 - self.ratio):.0f} % " if math.isfinite(self.ratio) else ""
        )
        away = f" ({percent}{self.danger}, {side})" if side else ""
        lines = [
            f"rate-and-state-like: {self.reason}",
            f"{self.law} law, a = {self.a.words(force)}, b = {self.b.words(force)}, "
            f"D = {self.distance.words(length)}, a - b = "
            f"{engineering(self.a - self.b, force, 3)}",
            (
                "steady sliding is stable on any spring, by rate and state as by the "
                "contacts"
            )
            if self.exact_critical_stiffness == self.critical_stiffness == 0
            else (
                f"critical stiffness in steady sliding: {exact} exactly, {fitted} by "
                f"rate and state{away}"
            ),
        ]
        if self.healing is not None:
            lines.append(
                f"healing after long holds: {engineering(self.healing, force)} per "
                "e-fold of hold time, "
                f"{self.healing_over_b:.2f} times b"
            )
        return "\n".join(lines)


def rate_and_state(
    interface: Interface,
    velocity: float = 1.0,
    *,
    step: float = 10.0,
    law: Literal["best", "ageing", "slip"] = "best",
) -> RateAndStateFit:
    """Decide whether an interface is rate-and-state-like, and return its parameters
    with their errors.

    Small steps of the velocity, from the exact linear response, are fitted over six
    breaking displacements at this velocity and at both ends of the decade around it. An
    interface is rate-and-state-like if it has a direct effect (``a`` above 0), if the
    misfit is below 5 %, and if ``a`` and ``b`` change by less than 10 %, and ``D`` by
    less than 20 %, over the decade. Then steps by the factor asked for, up and down,
    determine the law and its parameters. The result has the critical stiffness by rate
    and state, and the exact one.

    Parameters
    ----------
    velocity : float
        Velocity of smooth sliding before the step, in ``x_s`` per time.
    step : float
        Ratio of the velocities, above 1.
    law : {"best", "ageing", "slip"}
        Which law to fit.

    Raises
    ------
    InputError
        If there is no smooth sliding, its response is not known, or friction does not
        change with the velocity.

    Examples
    --------
    >>> contacts = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.3), delay=ss.Delay(0.1)
    ... )
    >>> ss.rate_and_state(contacts).holds
    False
    """
    instance("rate_and_state: interface", interface, Interface, "an Interface")
    speed = number("velocity", velocity, above=0, hint="in x_s per time")
    step = number("step", step, above=1, hint="ratio of the velocities")
    laws = laws_named(law)
    ageing = interface.ageing
    if respond(interface).inert:
        raise InputError(
            "rate_and_state: the friction force does not change with the velocity: "
            "without temperature, ageing and "
            "delay there is nothing to fit; give one of them"
        )
    small = fit = _small(interface, speed)
    drift = [math.nan] * 3
    failing = _failing(interface, speed, small)
    if not failing:
        low, high = (
            _small(interface, v).value
            for v in (speed / math.sqrt(10.0), speed * math.sqrt(10.0))
        )
        drift = ((high - low) / small.value).tolist()
        sentence = (
            "{} changes by {:.3g} % over a decade of velocity; must be below {:g} %"
        )
        changed = zip(DRIFTS, drift, DRIFTS.values(), strict=True)
        failing = next(
            (
                sentence.format(one, 100 * now, 100 * most)
                for one, now, most in changed
                if abs(now) >= most
            ),
            "",
        )
    chosen = laws[0]
    asymmetry = None
    if not failing:
        chosen, fit, asymmetry = _of_a_step(interface, speed, step, laws, small.value)
    spring = contact_stiffness(interface, speed)
    found: dict[str, Any] = dict(
        zip(("a", "b", "distance"), fit.estimates(), strict=True)
    )
    try:
        exact = critical_spring(
            Rig(
                interface, Slider(stiffness=1.0, mass=0.0, damping=0.0), constant(speed)
            )
        )
    except UndecidedError:
        exact = math.nan
    tested = (
        "misfit {:.2g} %; over a decade a changes by {:.2g} %, b by {:.2g} %, D "
        "by {:.2g} %"
    )
    return RateAndStateFit(
        law=chosen,
        **found,
        misfit=small.misfit,
        step_misfit=None if failing else fit.misfit,
        drift=tuple(drift),
        asymmetry=asymmetry,
        healing=ageing.slope if isinstance(ageing, LogarithmicGrowth) else None,
        velocity=speed,
        step=step,
        kinetic_friction=kinetic_friction(interface, speed),
        contact_stiffness=spring,
        critical_stiffness=RateAndState(law=chosen, **found).critical_stiffness(spring),
        exact_critical_stiffness=exact,
        holds=not failing,
        reason=failing
        or tested.format(*(100.0 * part for part in (small.misfit, *drift))),
    )


def _fitted(
    model: Callable[[RateAndState], Array],
    rise: Array,
    reach: float,
    law: Law,
    near: Array | None,
) -> LeastSquaresFit:
    """Return a fit of a, b and D to the change of the force after a step, over a slip
    `reach`, started from the values `near`, if they are given.
    """
    largest = float(np.max(np.abs(rise)))
    low = np.array([_LEAST * largest, _LEAST * largest, 1e-4 * reach])
    high = np.array([_MOST * largest, _MOST * largest, 10.0 * reach])
    left = max(largest - float(rise[-1]), 0.05 * largest)
    starts = (
        [np.array([largest, left, part * reach]) for part in (0.02, 0.05, 0.15)]
        if near is None
        else [near]
    )
    return least_squares(
        lambda one: model(RateAndState(law=law, a=one[0], b=one[1], distance=one[2])),
        rise,
        starts,
        low,
        high,
    )


def _small(interface: Interface, velocity: float) -> LeastSquaresFit:
    """Return a fit to a small step, by the linear response, which is the same for both
    laws.
    """
    slip = np.linspace(
        0.0,
        SLIP * interface.threshold_distribution.moment(1),
        _POINTS + 1,
    )
    rise = np.append(0.0, small_step(interface, velocity, slip[1:]))
    spring = contact_stiffness(interface, velocity)
    return _fitted(
        lambda one: one.small_step(slip, stiffness=spring),
        rise,
        slip[-1],
        "slip",
        None,
    )


def _of_a_step(
    interface: Interface, velocity: float, step: float, laws: Sequence[Law], near: Array
) -> tuple[Law, LeastSquaresFit, float]:
    """Fit laws to a step up and a step down; return the law whose D differs less
    between them, its fit to the step up, and D up over D down.
    """
    reach = SLIP * interface.threshold_distribution.moment(1)

    def fits(before: float, after: float) -> list[LeastSquaresFit]:
        lead, force = (
            each[::3]
            for each in finite_step(interface, before, after, reach, method=ROUGH)
        )
        how = {
            "ratio": after / before,
            "stiffness": contact_stiffness(interface, before),
        }
        return [
            _fitted(
                lambda one: one.step(lead, **how),
                force,
                reach,
                law,
                near,
            )
            for law in laws
        ]

    both = zip(
        laws,
        fits(velocity, velocity * step),
        fits(velocity * step, velocity),
        strict=True,
    )
    found = [
        (
            law,
            up,
            float(up.value[2] / down.value[2]),
        )
        for law, up, down in both
    ]
    return min(found, key=lambda one: abs(math.log(one[2])))


def _failing(interface: Interface, velocity: float, fit: LeastSquaresFit) -> str:
    """Return why a small step is not rate-and-state-like; empty if it is."""
    a = fit.estimates()[0]
    spring = contact_stiffness(interface, velocity)
    wave = 1j * _FAST / interface.threshold_distribution.moment(1)
    kappa = complex(respond(interface).stiffness(velocity, wave * velocity))
    direct = (kappa * spring / (wave * (spring - kappa))).real
    if not direct > _RESOLVED * a:
        found = (
            f"a = {max(direct, 0.0):.2g} at high frequency, where the fit of a "
            f"step needs {a:.2g}"
        )
        return f"no direct effect: {found}" + (
            "" if interface.activation else "; add [interface.activation]"
        )
    if a < 2.0 * a.error:
        return f"a = {a:.2g} ± {a.error:.1g} is not resolved"
    if fit.misfit >= MISFIT:
        return (
            f"the misfit of a small step is {100 * fit.misfit:.2g} % of its range; "
            f"must be below {100 * MISFIT:g} %"
        )
    return ""
