"""The contacts that explain a measured friction curve.

A contact whose threshold grows with its age as ``s g(t)`` breaks at the age at which
``v t = s g(t)``, so that friction in steady sliding is ``F(v) = v <t^2>/(2 <t>)`` per
contact. For identical contacts this is ``v t/2``, and the curve gives the growth
directly: ``t = 2F/v`` and ``g = 2F``; ``t`` falls with ``v`` wherever friction does.
For contacts that scatter, the strengths ``g`` at these ages are found by least squares.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.answers import Answer
from stickslip.arrays import Array
from stickslip.errors import InputError, instance
from stickslip.model import Delay, Gaussian, Interface, TabulatedGrowth
from stickslip.model.distribution import Distribution
from stickslip.model.measured_friction import MeasuredFriction
from stickslip.model.records import hashable
from stickslip.sliding.law import kinetic_friction
from stickslip.words import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_EXACT = 1e-9  # relative error of the friction at the points
_CLOSE = 1e-2  # relative misfit beyond four errors that no experiment resolves
_STEEPEST = 0.1  # smallest ``1 - d ln g/d ln t`` that is considered
_MOST_STEPS = 50  # about ten are usual
_HALVINGS = 30  # most halvings of a step
_SMALLEST = 1e-6  # of the friction: smaller errors are errors of arithmetic


@dataclass(frozen=True, kw_only=True, repr=False)
class FrictionCurve(Answer):
    """The contacts that give a measured friction curve, in natural units per contact.

    A curve alone does not distinguish growth from a delay where both fit. The two
    differ in other motion: in a hold (contacts that grow are stronger after a longer
    one) or in a velocity step.
    """

    measured: MeasuredFriction
    #: contacts whose thresholds grow with age, fitted to the points
    interface: Interface
    #: force per velocity of a rise that contacts cannot give: a damping of the slider
    viscosity: float
    residual: tuple[float, ...]  #: measured friction less that of `interface`
    #: contacts with a delay, ``f_d + (F_0 - f_d)/(1 + v/v_half)``, if these fit within
    #: the errors
    delayed: Interface | None
    #: factor on `kinetic_friction` of `delayed` that gives the force: their strength
    delayed_strength: float

    def friction(self, velocity: Array) -> Array:
        """Return the friction of `interface` plus the viscous force at a velocity."""
        return _friction(self.interface, self.viscosity, velocity)

    def __str__(self) -> str:
        measured = self.measured
        low, high = measured.velocities[0], measured.velocities[-1]
        worst = max(map(abs, self.residual))
        lines = [
            f"Friction at {len(measured.forces)} speeds from {number(low)} to "
            f"{number(high)} x_s per time: thresholds that grow with age, within "
            f"{number(worst)} f_s"
        ]
        if self.viscosity > 0.0:
            lines.append(f"  viscous force     {number(self.viscosity)} per velocity")
        if self.delayed is not None:
            lines.append(
                f"  a delay fits too  {number(self.delayed.delay.moment(1))}, contacts "
                f"of {number(self.delayed_strength)} f_s, detached of "
                f"{number(self.delayed_strength * self.delayed.sliding_force)} f_s: a "
                "hold or a velocity step decides"
            )
        return "\n".join(lines)

    def plot(self) -> "Figure":
        """Draw points, fitted law and residual."""
        import matplotlib.style
        from matplotlib.figure import Figure

        measured = self.measured
        v = np.geomspace(measured.velocities[0], measured.velocities[-1], 200)
        # the style is found by name, as plotting is a layer above
        with matplotlib.style.context("stickslip.plot.house"):
            figure = Figure(figsize=(3.5, 3.2), layout="constrained")
            law, rest = figure.subplots(2, sharex=True, height_ratios=(3, 1))
            law.plot(v, self.friction(v), label="thresholds that grow")
            if self.delayed is not None:
                other = self.delayed_strength * kinetic_friction(self.delayed, v)
                law.plot(v, other + self.viscosity * v, "--", label="delay")
            bars: Any = {"yerr": measured.errors, "fmt": "o", "markersize": 3}
            law.errorbar(measured.velocities, measured.forces, **bars, label="measured")
            law.legend()
            law.set(xscale="log", ylabel=r"friction ($f_s$)")
            rest.errorbar(measured.velocities, self.residual, **bars)
            rest.axhline(0.0, linewidth=0.5)
            rest.set(xlabel=r"velocity ($x_s$ per time)", ylabel="residual")
        return figure


def friction_curve(
    points: Sequence[Sequence[float]], *, thresholds: Distribution | None = None
) -> FrictionCurve:
    """Return the contacts that give a measured friction curve in steady sliding.

    Friction that falls with velocity is explained by contacts whose thresholds grow
    with age, `stickslip.model.TabulatedGrowth`; a later rise by a viscous force on the
    slider, the smallest that leaves no rise.

    Parameters
    ----------
    points : sequence
        Points ``(velocity, friction)`` or ``(velocity, friction, error)`` in any order,
        the velocity in ``x_s`` per time, friction and its standard error per contact in
        ``f_s``. A missing error is that of rounding to the last digit of any friction.
        (A rig file takes them in SI units: ``interface.friction``.)
    thresholds : Distribution, optional
        Distribution of ``s``, by default a Gaussian of mean 1 and standard deviation
        0.1; the static peak after a hold shows its width.

    Returns
    -------
    FrictionCurve
        Its interface has a `kinetic_friction` at the points equal to the measured
        friction less the viscous force.

    Raises
    ------
    InputError
        If friction rises by more than its errors where no viscous force explains it, or
        if no growth of these thresholds gives the curve; the message has the residual.

    Notes
    -----
    The friction of contacts that grow is ``v <t^2>/(2 <t>)``, with ``t`` the age at
    which they break. A delay that is drawn for each life matters only by its mean, and
    gives one curve, ``f_d + (F_0 - f_d)/(1 + v/v_half)``.

    Examples
    --------
    >>> curve = ss.friction_curve([(0.1, 0.48), (1, 0.37), (10, 0.3)])
    >>> print(f"{ss.kinetic_friction(curve.interface, 1.0):.6f}")
    0.370000
    """
    thresholds = Gaussian(1.0, 0.1) if thresholds is None else thresholds
    instance("friction_curve: thresholds", thresholds, Distribution, "a distribution")
    measured = MeasuredFriction.of_points(points, "friction_curve: points")
    return curve_of(measured, hashable(thresholds))


@lru_cache(maxsize=64)
def curve_of(measured: MeasuredFriction, thresholds: Distribution) -> FrictionCurve:
    """Return the contacts that explain a measured curve; equal curves share one
    result.
    """
    v, force, error = np.array([measured.velocities, measured.forces, measured.errors])
    error = np.maximum(error, 1e-9 * force)
    viscosity = _viscosity(v, force, error)
    fall = _falling(force - viscosity * v, error)
    interface = Interface(
        thresholds=thresholds, ageing=_growth(v, fall, error, thresholds)
    )
    residual = force - _friction(interface, viscosity, v)
    delayed, strength = delay_of(measured.without(viscosity), thresholds)
    return FrictionCurve(
        measured=measured,
        interface=interface,
        viscosity=viscosity,
        residual=tuple(residual.tolist()),
        delayed=delayed,
        delayed_strength=strength,
    )


def _friction(interface: Interface, viscosity: float, velocity: Array) -> Array:
    return np.asarray(kinetic_friction(interface, velocity) + viscosity * velocity)


def _falling(force: Array, error: Array) -> Array:
    """Friction nearest to the measured one that does not rise with velocity."""
    from scipy.optimize import isotonic_regression

    found = isotonic_regression(force, weights=error**-2.0, increasing=False)
    return np.asarray(found.x)


def _viscosity(v: Array, force: Array, error: Array) -> float:
    """Smallest viscous force per velocity without which friction rises by no more than
    its errors.

    That is where chi squared equals the number of points, or exceeds its minimum by 1.
    """
    from scipy import optimize

    def misfit(viscosity: float) -> float:
        left = force - viscosity * v
        return float(np.sum(((left - _falling(left, error)) / error) ** 2))

    if misfit(0.0) <= v.size:
        return 0.0
    # Friction less the viscous force must stay above 0. The misfit is the distance to a
    # convex cone, and so convex in the viscosity.
    most = float(np.min(force / v)) * (1.0 - 1e-9)
    best = float(
        optimize.minimize_scalar(
            misfit,
            bounds=(0.0, most),
            method="bounded",
            options={"xatol": 1e-9 * most},
        ).x
    )
    enough = min(float(v.size), misfit(best) + 1.0)
    if misfit(best) > v.size:
        left = force - best * v
        off = left - _falling(left, error)
        at = int(np.argmax(np.diff(force) / np.hypot(error[1:], error[:-1])))
        raise InputError(
            f"friction_curve: friction rises from {force[at]:.4g} to "
            f"{force[at + 1]:.4g} between the velocities {v[at]:.4g} and "
            f"{v[at + 1]:.4g}; no viscous force makes that, by "
            f"{np.abs(off).max():.2g}; leave the point out, or give errors as third "
            "numbers"
        )
    return float(optimize.brentq(lambda c: misfit(c) - enough, 0.0, best, rtol=1e-12))


def _growth(
    v: Array,
    force: Array,
    error: Array,
    thresholds: Distribution,
) -> TabulatedGrowth:
    """Growth of thresholds that gives friction at increasing velocities, by least
    squares.
    """
    from stickslip.sliding.lifetimes import threshold_nodes  # numba, which takes 1 s

    positive = Interface(thresholds=thresholds).threshold_distribution
    m1, m2, m3 = (positive.moment(order) for order in (1, 2, 3))
    nodes = threshold_nodes(positive, 0.01, [])
    # reversed, as the slowest point has the oldest contacts
    strength = np.log(2.0 * force * m1 / m2)[::-1]
    # More strength of weak contacts lowers friction: on average friction depends on the
    # growth about this age.
    age = strength + np.log(m1 / m2 * (2.0 * m3 / m2 - m2 / m1) / v)[::-1]
    age, strength, whole = _nodes(age, strength, positive.standard_deviation() / m1)

    def moved(start: Array, step: Array) -> tuple[TabulatedGrowth, Array]:
        """Growth with strengths one step below `start`, and these strengths; the step
        is halved where the growth would be too steep.
        """
        for _ in range(_HALVINGS):
            with suppress(InputError):
                there = start - step
                strengths = np.exp(whole @ there).tolist()
                return TabulatedGrowth(ages, tuple(strengths)), there
            step = 0.5 * step
        return found, start

    ages = tuple(np.exp(age).tolist())
    oldest = np.full_like(strength, strength[-1])
    found, strength = moved(oldest, oldest - strength)
    for _ in range(_MOST_STEPS):
        contacts = Interface(thresholds=thresholds, ageing=found)
        off = np.log(kinetic_friction(contacts, v) / force)
        slopes = _slopes(found, nodes, v) @ whole * (force / error)[:, None]
        step = np.linalg.lstsq(slopes, off * force / error)[0]
        if min(np.abs(off).max(), np.abs(step).max()) <= _EXACT:
            break
        found, strength = moved(strength, step / max(1.0, np.abs(step).max()))
    worst = np.abs(off) - 4.0 * error / force
    at = int(np.argmax(worst))
    if worst[at] > _CLOSE:
        raise InputError(
            f"friction_curve: no growth of {thresholds} gives {force[at]:.4g} at "
            f"velocity {v[at]:.4g}, by {100.0 * abs(off[at]):.2g} %; give thresholds "
            "of a smaller standard deviation, or more points where friction falls "
            "steeply"
        )
    return found


def _nodes(age: Array, strength: Array, scatter: float) -> tuple[Array, Array, Array]:
    """Ages of a table, strengths at some of them, and the matrix that gives all
    strengths from these, linear in the logarithms that all three are in.

    Contacts whose strengths scatter by a fraction break at ages that scatter by that
    fraction over ``1 - d ln g/d ln t``: ages of the table are at least as far apart.
    The growth between the first two is extrapolated by two standard deviations.
    """
    rise = np.diff(strength) / np.diff(age)
    apart = scatter / np.maximum(1.0 - np.append(rise, rise[-1]), _STEEPEST)
    kept = [0]
    for i in range(1, age.size - 1):
        behind = age[i] - age[kept[-1]]
        if behind >= apart[kept[-1]] and age[-1] - age[i] >= apart[i]:
            kept.append(i)
    kept.append(age.size - 1)
    age, strength = age[kept], strength[kept]
    whole = np.eye(age.size)
    if scatter > 0.0:
        before = 2.0 * apart[0] / (age[1] - age[0])
        first = (1.0 + before) * whole[0] - before * whole[1]
        whole = np.stack([first, *whole])
        age = np.append(age[0] - 2.0 * apart[0], age)
    return age, strength, whole


def _slopes(growth: TabulatedGrowth, nodes: tuple[Array, Array], v: Array) -> Array:
    """Derivatives of the logarithm of friction at each velocity by those of the
    strengths of a table, as if these were joined by straight lines, shape (n, m).

    A threshold that is larger by a fraction at the age of the break is met at a
    stretching that is larger by that fraction over ``1 - s g'/v``.
    """
    from stickslip.kernels.lifetimes import reach
    from stickslip.kernels.lifetimes import rule as grown_at
    from stickslip.sliding.lifetimes import growth_of

    strength, weight = nodes
    rule = growth_of(growth)
    found = np.empty((v.size, len(growth.ages)))
    for row, velocity in zip(found, v.tolist(), strict=True):
        x = np.array([reach(rule, s, velocity) for s in strength.tolist()])
        _, _, faster, _ = grown_at(rule, x / velocity)
        longer = weight * x / (1.0 - strength * faster / velocity)
        more = longer * (2.0 * x / (weight @ x**2) - 1.0 / (weight @ x))
        age = np.log(x / velocity)
        for j, unit in enumerate(np.eye(len(growth.ages))):
            row[j] = more @ np.interp(age, np.log(growth.ages), unit)
    return found


def delay_of(
    measured: MeasuredFriction, thresholds: Distribution
) -> tuple[Interface | None, float]:
    """Contacts with a delay that give a curve within its errors, if there are any, and
    their strength.
    """
    from scipy.optimize import minimize_scalar, nnls

    v, force, error = np.array([measured.velocities, measured.forces, measured.errors])
    error = np.maximum(error, _SMALLEST * force)

    def parts(log_half: float) -> tuple[Array, Array]:
        """Force of detached contacts, excess of slow friction over it; and residual."""
        shape = 1.0 / (1.0 + v / np.exp(log_half))
        columns = np.stack([np.ones_like(v), shape], axis=1) / error[:, None]
        both, _ = nnls(columns, force / error)
        return both, columns @ both - force / error

    def misfit(log_half: float) -> float:
        return float(np.sum(parts(log_half)[1] ** 2))

    # The misfit may have several minima: search between both neighbours of the lowest.
    places = np.linspace(np.log(v[0]) - 5.0, np.log(v[-1]) + 5.0, 100)
    least = int(np.argmin([misfit(place) for place in places]))
    ends = places[max(least - 1, 0)], places[min(least + 1, places.size - 1)]
    log_half = minimize_scalar(
        misfit,
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-12},
    ).x
    (sliding, above), residual = parts(float(log_half))
    if above <= 0.0 or residual @ residual > v.size:
        return None, 1.0
    positive = Interface(thresholds=thresholds).threshold_distribution
    m1, m2 = positive.moment(1), positive.moment(2)
    strength = float((sliding + above) * 2.0 * m1 / m2)
    delayed = Interface(
        thresholds=thresholds,
        delay=Delay(m1 / float(np.exp(log_half))),
        sliding_force=float(sliding) / strength,
    )
    return delayed, strength
