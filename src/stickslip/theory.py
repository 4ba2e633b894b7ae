"""Closed forms: what can be said about an interface without solving anything, each with its range of validity.

Natural units per contact (``k = f_s = x_s = 1``), time in the user's unit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, instance, number, numbers
from stickslip.lives import growth_of, has_lives, hazard_of, mean_lives
from stickslip.model import FixedGrowth, Interface, Langevin, Slider, is_own
from stickslip.model.distributions import Gaussian
from stickslip.model.newborn import mean_life

if TYPE_CHECKING:
    from stickslip.kernels.growth import Growth
    from stickslip.kernels.langevin import Langevin as Constants

Array = NDArray[np.float64]


@overload
def kinetic_friction(interface: Interface, velocity: float = 0.0) -> float: ...
@overload
def kinetic_friction(interface: Interface, velocity: Array) -> Array: ...
def kinetic_friction(interface: Interface, velocity: float | Array = 0.0) -> float | Array:
    """Return the mean friction force in smooth sliding, ``F_k = (k m2/2 + f_d v <tau>)/(m1 + v <tau>)``.

    The force of the steady state of Eqs. (1)-(4) with attached contacts counted by Eq. (10); ``m1, m2`` are
    the first two moments of the positive distribution of thresholds, ``f_d`` is the force of a detached contact. Exact
    for any distribution and any delay distribution; friction falls with velocity if ``f_d < k m2/(2 m1)``. Of newborn
    contacts stretched by ``x_0``, ``<x_s^2 - x_0^2>`` takes the place of ``m2`` and ``<x_s - x_0>`` that of ``m1``.

    Thresholds that age by `Langevin` have no such form: the stationary kinetic equation of Eqs. (13)-(17) is
    solved, to 1e-4 or better. Without delay the force depends on ``v/rate**2`` alone. For thresholds that grow by a
    fixed rule (`ExponentialGrowth`, `LogarithmicGrowth`) the lives of contacts are integrated over their strengths.
    With temperature they are integrated over the hazard of each contact, to 1e-7 or better; every contact keeps its
    own threshold for its life. Contacts of different areas, with or without temperature, are integrated over these.
    (A rate averaged over the thresholds, one law for all contacts, is another model: at a
    standard deviation of .1 its force is 34 % too low.)

    Parameters
    ----------
    interface : Interface
        The contacts; with `Langevin` ageing their thresholds must be Gaussian.
    velocity : float or ndarray
        Speed of sliding, at least 0, in ``x_s`` per time; 0 is the limit of slow sliding, or no delay. Above 0
        if thresholds age or at a temperature.

    Returns
    -------
    float or ndarray, shape of `velocity`
        Per contact, in ``f_s``.

    Raises
    ------
    InputError
        If thresholds age by `Langevin` from a distribution that is no Gaussian, or slide at 0 velocity while they age;
        if the delay is infinite at zero velocity, or with `Langevin` a delay meets newborns without strength.
    """
    instance("kinetic_friction: interface", interface, Interface, "an Interface")
    if has_lives(interface) or interface.areas is not None:
        one = "areas" if interface.areas is not None else "sliding_force"
        interface.allow(("temperature", one), f"kinetic_friction {_mechanism(interface)}")
        fixed = interface.temperature is None and interface.ageing is None
        slow = fixed and math.isfinite(interface.delay.moment(1))
        why = "ageing thresholds have no slow limit" if interface.ageing else "at a temperature no slow limit is left"
        hint = f"in x_s per time; {why}"
        speed = numbers("velocity", velocity, at_least=0 if slow else None, above=None if slow else 0, hint=hint)
        force = np.array([mean_lives(interface, v)[0] for v in speed.ravel().tolist()])
        return float(force[0]) if speed.ndim == 0 else np.asarray(force.reshape(speed.shape))
    if interface.ageing is None:
        interface.allow(("sliding_force", "newborn"), "kinetic_friction")
        attached, life = attached_fraction(interface, velocity), mean_life(interface)
        return life.work / life.path * attached + interface.sliding_force * (1.0 - attached)
    if is_own(ageing := interface.ageing):
        interface.allow((), "kinetic_friction of thresholds that age by a rule of your own")
        thresholds, delay = interface.threshold_distribution, interface.delay
        speed = numbers("velocity", velocity, above=0, hint="in x_s per time")
        own = np.array([ageing.friction(thresholds, delay, v) for v in speed.ravel().tolist()])
        return float(own[0]) if speed.ndim == 0 else np.asarray(own.reshape(speed.shape))
    from stickslip.kernels import langevin_steady

    assert isinstance(interface.ageing, Langevin)
    interface.allow(("temperature",), "kinetic_friction of thresholds that age by Langevin")
    speed = numbers("velocity", velocity, above=0, hint="in x_s per time; ageing thresholds have no slow limit")
    _check_ageing_speeds(speed, interface.ageing)
    force = langevin_steady.steady_friction(
        speed.ravel(), ageing_constants(interface), interface.delay.moment(1), hazard=hazard_of(interface.temperature)
    )
    return float(force[0]) if speed.ndim == 0 else np.asarray(force.reshape(speed.shape))


def _mechanism(interface: Interface) -> str:
    """Say what makes it a matter of lives."""
    if interface.areas is not None:
        return "of areas"
    return "of thresholds that grow" if interface.temperature is None else "with temperature"


_SLOWEST, _FASTEST = 1e-12, 1e6
"""Speeds against the rate of ageing, ``v/rate**2``, between which the stationary kinetic equation is resolved."""


def _check_ageing_speeds(speed: Array, ageing: Langevin) -> None:
    for value in (float(speed.min()), float(speed.max())):
        if not _SLOWEST <= (relative := value / ageing.rate**2) <= _FASTEST:
            raise InputError(
                f"kinetic_friction: velocity = {value:g} is {relative:.3g} times rate**2 = {ageing.rate**2:.3g} of the "
                f"ageing: must be between {_SLOWEST:g} and {_FASTEST:g} times; beyond, the force cannot be resolved"
            )


@overload
def closure_friction(interface: Interface, velocity: float) -> float: ...
@overload
def closure_friction(interface: Interface, velocity: Array) -> Array: ...
def closure_friction(interface: Interface, velocity: float | Array) -> float | Array:
    """Return the force in smooth sliding by the paper's closure, Eqs. (1)-(3) with (18): an approximation.

    One distribution of thresholds for all contacts, whatever their stretching. Against `kinetic_friction` it is 23 %
    too large at ``v = .01 rate**2`` (there it has a closed form, lives being exponential), 9 % too small at .5 and 28 %
    too small at 1 (standard deviation .1). At 1 most thresholds are next to 0, and the result depends on what is done
    with those that noise would carry below: here they stay above. Counted as broken at once they would make it 67 % too
    small.

    Parameters
    ----------
    interface : Interface
        With `Langevin` ageing, without delay.
    velocity : float or ndarray
        Speed of sliding, above 0, in ``x_s`` per time.

    Returns
    -------
    float or ndarray, shape of `velocity`
        Per contact, in ``f_s``.

    Raises
    ------
    InputError
        If thresholds do not age by `Langevin` from a Gaussian, a speed is not above 0, or there is a delay.
    """
    from stickslip.kernels import closure

    constants = ageing_constants(interface)
    if interface.delay.moment(1) > 0:
        raise InputError(f"Interface.delay = {interface.delay}: the paper's closure knows no delay; use Delay(0)")
    speed = numbers("velocity", velocity, above=0, hint="in x_s per time")
    force = closure.closure_friction(speed.ravel(), constants)
    return float(force[0]) if speed.ndim == 0 else np.asarray(force.reshape(speed.shape))


def gaussian_ageing(interface: Interface) -> tuple[Langevin, Gaussian]:
    """Return the ageing and the stationary distribution of thresholds for the kinetic equation of Eqs. (13)-(17).

    Raises
    ------
    InputError
        If thresholds do not age by `Langevin` from a Gaussian, or a delay meets newborns without strength.
    """
    instance("interface", interface, Interface, "an Interface")
    ageing, distribution = interface.ageing, interface.thresholds
    if not isinstance(ageing, Langevin):
        raise InputError(
            f"Interface.ageing = {ageing}: the kinetic equation, and with it the stability of smooth sliding, "
            "is known for ageing by Langevin(rate, newborn) only; use that, or ageing=None"
        )
    if (
        not isinstance(distribution, Gaussian)
        or distribution.lower > 0
        or distribution.mean <= 0
        or distribution.std <= 0
    ):
        raise InputError(
            f"Interface.thresholds = {distribution}: thresholds that age by Langevin have a Gaussian as their "
            "stationary distribution, Eq. (17): give Gaussian(mean, std), both above 0 and not cut off above 0"
        )
    if interface.delay.moment(1) > 0 and ageing.newborn == 0:
        raise InputError(
            f"Langevin.newborn = 0 with Interface.delay = {interface.delay}: newborns without strength break at once "
            "and without end, and a delay after each break leaves none that holds; give newborn > 0 or no delay"
        )
    if interface.temperature is not None and ageing.newborn == 0:
        raise InputError(
            "Langevin.newborn = 0 with Interface.temperature: newborns without strength break at once and without "
            "end; give newborn > 0"
        )
    return ageing, distribution


def ageing_constants(interface: Interface) -> Constants:
    """Return what the kernels know of ageing by `Langevin`; raises what `gaussian_ageing` does."""
    from stickslip.kernels.langevin import Langevin as Constants

    ageing, distribution = gaussian_ageing(interface)
    return Constants(ageing.rate, distribution.mean, distribution.std, ageing.newborn)


def growth_model(interface: Interface) -> Growth:
    """Return a fixed rule of growth as `stickslip.kernels.growth.grown` takes it.

    Raises
    ------
    InputError
        If thresholds do not grow by such a distribution.
    """
    if isinstance(interface.ageing, FixedGrowth):
        return growth_of(interface.ageing)
    raise InputError(f"Interface.ageing = {interface.ageing}: is no fixed rule of growth; use ExponentialGrowth")


def lives(growth: Growth, strength: Array, velocity: float) -> Array:
    """Return how long contacts hold in steady sliding while their thresholds grow, by bisection.

    Parameters
    ----------
    growth : Growth
        Of `growth_law`.
    strength : ndarray, shape (n,)
        To which, or from which, the thresholds grow.
    velocity : float
        Of sliding, above 0.

    Returns
    -------
    ndarray, shape (n,)
        In the unit of time; 0 where a threshold does not even begin to outgrow the stretching.
    """
    kind, first, second = growth

    def gap(age: Array) -> Array:
        # Concave in age: once closed, it stays closed.
        if kind == 0:
            young = np.exp(-first * age)
            return np.asarray(strength * (1.0 - young) + second * young - velocity * age)
        return np.asarray(strength + first * np.log1p(age / second) - velocity * age)

    low, high = np.zeros_like(strength), (strength + second) / velocity
    while np.any(holding := gap(high) > 0):
        high = np.where(holding, 2.0 * high, high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        holding = gap(middle) > 0
        low, high = np.where(holding, middle, low), np.where(holding, high, middle)
    return np.asarray(np.where(low > 1e-15 * (strength + second) / velocity, low, 0.0))


@overload
def attached_fraction(interface: Interface, velocity: float) -> float: ...
@overload
def attached_fraction(interface: Interface, velocity: Array) -> Array: ...
def attached_fraction(interface: Interface, velocity: float | Array) -> float | Array:
    """Return the mean fraction of attached contacts in smooth sliding, ``N_c/N = 1/(1 + v <tau>/<x_s>)``, Eq. (10).

    With ``<x_s - x_0>`` in place of ``<x_s>`` if newborn contacts are stretched by ``x_0``.

    The paper's ``vbar = xbar/tau_d`` with ``xbar = 1/Gamma``, which in steady sliding is the mean threshold
    stretching. There it is exact, for a random delay with the mean delay. Used inside the dynamics, as the
    paper does, it has no memory and is an approximation.

    Parameters
    ----------
    interface : Interface
        The contacts, without ageing.
    velocity : float or ndarray
        Speed of sliding, at least 0, in ``x_s`` per time.

    Returns
    -------
    float or ndarray, shape of `velocity`
        Between 0 and 1.

    Raises
    ------
    InputError
        If thresholds age, or the delay is infinite at zero velocity.
    """
    instance("attached_fraction: interface", interface, Interface, "an Interface")
    interface.allow(("sliding_force", "newborn"), "attached_fraction")
    if interface.ageing is not None:
        raise InputError(
            f"Interface.ageing = {interface.ageing}: steady sliding with ageing thresholds has no closed form; "
            "simulate it, or use ageing=None"
        )
    speed = numbers("velocity", velocity, at_least=0, hint="in x_s per time")
    mean = interface.delay.moment(1)
    if math.isinf(mean) and np.any(speed == 0):
        raise InputError(
            "velocity = 0: with an infinite delay the limit of slow sliding does not exist; give one above 0"
        )
    attached = 1.0 / (1.0 + speed * mean / mean_life(interface).path)
    return float(attached) if attached.ndim == 0 else attached


def driving_force(interface: Interface, slider: Slider, velocity: float) -> float:
    """Return the mean force in the driving spring in smooth sliding, ``M eta v + F_k(v)``: the mean of Eq. (11).

    Parameters
    ----------
    interface : Interface
        The contacts, without ageing.
    slider : Slider
        Its mass and damping count.
    velocity : float
        Speed of sliding, at least 0, in ``x_s`` per time.

    Returns
    -------
    float
        Per contact, in ``f_s``.
    """
    instance("driving_force: slider", slider, Slider, "a Slider")
    speed = number("velocity", velocity, at_least=0, hint="in x_s per time")
    return slider.mass * slider.damping * speed + kinetic_friction(interface, speed)


def critical_stiffness_estimate(interface: Interface) -> float:
    """Return the paper's rough ``K* ~ N k f_s/(Delta f_s + Delta f_0)``, Eq. (9): a hint at scaling.

    For the paper's own parameters it gives 9.1 where Eqs. (1)-(4) and (8) give 2.99. It is only meant for
    narrow distributions.

    Parameters
    ----------
    interface : Interface
        Its distributions of thresholds and of initial stretchings, by mean and standard deviation.

    Returns
    -------
    float
        Per contact, in ``k``; infinite where all contacts are equal.
    """
    distribution = interface.threshold_distribution
    width = distribution.standard_deviation() + interface.initial.standard_deviation()
    return distribution.moment(1) / width if width > 0 else math.inf


def slip_displacement(slider: Slider, velocity: float, elapsed: ArrayLike) -> Array:
    """Return how far the slider slips in a time after the elastic instability, ``v dt [1 + (Omega dt)^2/6]``, Eq. (12).

    Parameters
    ----------
    slider : Slider
        Its ``Omega = sqrt(K/M)``; with a mass.
    velocity : float
        In ``x_s`` per time. The paper prints the drive's velocity ``v_d``. That supposes that the slider
        still follows the drive at the instability; it has run ahead by then, and the result is too small by
        up to a factor 3.5. With the slider's actual velocity at the instability it holds to 10 % for ``Omega
        dt <= 1``.
    elapsed : array_like
        Time since the instability, at least 0.

    Returns
    -------
    ndarray, shape of `elapsed`
        In ``x_s``.

    Raises
    ------
    InputError
        If the slider has no mass.
    """
    instance("slip_displacement: slider", slider, Slider, "a Slider")
    number("velocity", velocity, at_least=0, hint="in x_s per time")
    number("Slider.mass", slider.mass, above=0, hint="M/N; a slip without mass takes no time")
    t = numbers("elapsed", elapsed, at_least=0, hint="time since the instability")
    return np.asarray(velocity * t * (1.0 + (slider.frequency * t) ** 2 / 6.0))


class DelayEstimate(NamedTuple):
    """The paper's two estimates of the critical delay ``tau*``, below Eq. (12), in the unit of time."""

    light: float
    """``Delta x_s/v``, for ``Omega tau* << 1`` in the paper's words: the slider only follows the drive."""
    heavy: float
    """``(6 Delta x_s M/(K v))^(1/3)``, for ``Omega tau* >> 1``: the slider is thrown forward."""
    phase: float
    """``Omega`` times the time at which Eq. (12) reaches ``Delta x_s``; small or large, it says which one is meant."""


def critical_delay_estimate(interface: Interface, slider: Slider, velocity: float) -> DelayEstimate:
    """Return the paper's estimates of ``tau*``, from a slip of ``Delta x_s`` by Eq. (12) within the delay.

    Orders of magnitude only: the paper fits ``tau* = A1 + A2 M^(1/3)`` instead. For the value see the
    functions that measure or compute it.

    Parameters
    ----------
    interface : Interface
        Its standard deviation of thresholds is ``Delta x_s``.
    slider : Slider
        With a mass.
    velocity : float
        Of the drive, above 0, in ``x_s`` per time.

    Returns
    -------
    DelayEstimate
        Both limits, and where between them the rig lies.

    Raises
    ------
    InputError
        If the velocity or the mass is 0.
    """
    instance("critical_delay_estimate: interface", interface, Interface, "an Interface")
    instance("critical_delay_estimate: slider", slider, Slider, "a Slider")
    speed = number("velocity", velocity, above=0, hint="in x_s per time")
    number("Slider.mass", slider.mass, above=0, hint="M/N")
    width = interface.threshold_distribution.standard_deviation()
    # phase (1 + phase^2/6) = Omega Delta x_s/v: a cubic with one real root.
    asked = slider.frequency * width / speed
    phase = 2 * math.sqrt(2) * math.sinh(math.asinh(1.5 * asked / math.sqrt(2)) / 3)
    return DelayEstimate(
        light=width / speed,
        heavy=(6 * width * slider.mass / (slider.stiffness * speed)) ** (1 / 3),
        phase=phase,
    )


def effective_potential(slider: Slider, position: ArrayLike, contact_force: ArrayLike, drive: float) -> Array:
    """Return ``V_eff(X) = K (v_d t - X)^2/2 + Int_0^X F_c``, Eq. (5), on a grid.

    Minus its slope is the force on the slider; the slider is stable where it bends upward, Eq. (6).

    Parameters
    ----------
    slider : Slider
        Its stiffness counts.
    position : array_like, shape (n,)
        Positions ``X`` of the slider in ``x_s``, rising, the first one 0.
    contact_force : array_like, shape (n,)
        Force ``F_c(X)`` of the contacts per contact, in ``f_s``, as rigid motion gives it.
    drive : float
        Position ``v_d t`` of the far end of the spring, in ``x_s``.

    Returns
    -------
    ndarray, shape (n,)
        Per contact, in ``f_s x_s``; the integral by the trapezoidal rule, second order in the spacing.

    Raises
    ------
    InputError
        If the two arrays do not match, or positions do not rise from 0.
    """
    instance("effective_potential: slider", slider, Slider, "a Slider")
    x, force = numbers("position", position), numbers("contact_force", contact_force)
    drive = number("drive", drive, hint="in x_s")
    if x.ndim != 1 or x.shape != force.shape or x.size < 2:
        raise InputError(f"position, contact_force: shapes {x.shape} and {force.shape}: must be equal, (n,) with n > 1")
    if x[0] != 0 or np.any(np.diff(x) <= 0):
        raise InputError("position: must start at 0 and rise from each value to the next")
    work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(x))])
    return np.asarray(0.5 * slider.stiffness * (drive - x) ** 2 + work)
