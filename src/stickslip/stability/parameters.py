"""Critical values: where smooth sliding loses or regains stability as one parameter is turned.

A `Parameter` reads and sets one parameter of a `Setting`; `critical` finds every crossing along it. The named
functions (`critical_velocities`, `critical_delay`, ...) are that, with a parameter chosen. All are linear: they
say where smooth sliding is unstable to the smallest disturbance, not where stick-slip, once started, dies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, UndecidedError, instance, number, sequence, shown
from stickslip.model import Delay, Interface, Langevin, RandomDelay
from stickslip.model.distributions import Empirical, Gamma, Gaussian, LogNormal, Uniform
from stickslip.stability.aged import AgedResponse
from stickslip.stability.impedances import Rig, impedance
from stickslip.stability.modes import Neutral, neutral_frequencies
from stickslip.stability.response import respond

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A rig at work: the interface, what holds the slider, and the speed of smooth sliding in ``x_s`` per time."""

    interface: Interface
    rig: Rig
    velocity: float

    def __post_init__(self) -> None:
        number("velocity", self.velocity, above=0, hint="in x_s per time")


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One positive parameter of a `Setting` that can be read and set.

    Parameters
    ----------
    name, unit : str
        What it is called, and its unit in natural units.
    get : callable
        The value in a setting.
    set : callable
        The same setting with another value.
    """

    name: str
    unit: str
    get: Callable[[Setting], float] = field(repr=False)
    set: Callable[[Setting, float], Setting] = field(repr=False)


def _of_rig(attribute: str, unit: str) -> Parameter:
    def get(setting: Setting) -> float:
        if not hasattr(setting.rig, attribute):
            raise InputError(
                f"rig = {setting.rig!r}: has no {attribute} to vary; use a Slider, or a Parameter of your own"
            )
        return float(getattr(setting.rig, attribute))

    def set_(setting: Setting, value: float) -> Setting:
        get(setting)
        rig: Any = setting.rig
        return replace(setting, rig=replace(rig, **{attribute: value}))

    return Parameter(name=attribute, unit=unit, get=get, set=set_)


def _get_delay(setting: Setting) -> float:
    delay = setting.interface.delay
    match delay:
        case Delay():
            return delay.time
        case RandomDelay():
            return delay.mean
    raise InputError(
        f"Interface.delay = {delay!r}: has no known time to vary; use Delay, RandomDelay, or a Parameter of your own"
    )


def _set_delay(setting: Setting, value: float) -> Setting:
    delay = setting.interface.delay
    match delay:
        case Delay():
            new: Delay | RandomDelay = Delay(value)
        case RandomDelay() if delay.mean > 0:
            new = replace(delay, mean=value, std=delay.std * value / delay.mean)
        case _:
            raise InputError(
                f"Interface.delay = {delay!r}: cannot be scaled; use Delay(time) or RandomDelay with a mean above 0"
            )
    return replace(setting, interface=replace(setting.interface, delay=new))


def _get_std(setting: Setting) -> float:
    distribution = setting.interface.thresholds
    match distribution:
        case Gaussian() | Gamma() | LogNormal():
            return distribution.std
        case Uniform() | Empirical():
            return distribution.standard_deviation()
    raise InputError(
        f"Interface.thresholds = {distribution!r}: has no standard deviation of its own to vary; use Gaussian, Gamma, LogNormal, Uniform "
        "or Empirical, or a Parameter of your own"
    )


def _set_std(setting: Setting, value: float) -> Setting:
    distribution = setting.interface.thresholds
    match distribution:
        case Gaussian() | Gamma() | LogNormal():
            new: Gaussian | Gamma | LogNormal | Uniform | Empirical = replace(distribution, std=value)
        case Uniform():
            middle = 0.5 * (distribution.low + distribution.high)
            new = Uniform(low=middle - math.sqrt(3) * value, high=middle + math.sqrt(3) * value)
        case Empirical():
            mean, ratio = distribution.moment(1), value / distribution.standard_deviation()
            new = replace(distribution, edges=tuple(mean + ratio * (edge - mean) for edge in distribution.edges))
        case _:
            _get_std(setting)
            raise AssertionError
    return replace(setting, interface=replace(setting.interface, thresholds=new))


def _get_ageing(setting: Setting) -> float:
    ageing = setting.interface.ageing
    if not isinstance(ageing, Langevin):
        raise InputError(
            f"Interface.ageing = {ageing}: has no time to vary; use Langevin(rate), or a Parameter of your own"
        )
    return ageing.rate**-2


def _set_ageing(setting: Setting, value: float) -> Setting:
    _get_ageing(setting)
    ageing: Any = setting.interface.ageing
    return replace(setting, interface=replace(setting.interface, ageing=replace(ageing, rate=value**-0.5)))


STIFFNESS = _of_rig("stiffness", "k")
"""Stiffness of the driving spring ``K/N``."""
MASS = _of_rig("mass", "f_s time^2/x_s")
"""Mass ``M/N``, at constant ``eta``."""
DAMPING = _of_rig("damping", "1/time")
"""``eta`` of Eq. (11)."""
VELOCITY = Parameter(
    name="velocity",
    unit="x_s/time",
    get=lambda setting: setting.velocity,
    set=lambda setting, value: replace(setting, velocity=value),
)
"""Speed of smooth sliding."""
DELAY = Parameter(name="delay", unit="time", get=_get_delay, set=_set_delay)
"""Delay time; for a `RandomDelay` its mean, the standard deviation kept in proportion."""
STD = Parameter(name="std", unit="x_s", get=_get_std, set=_set_std)
"""Standard deviation of the thresholds at constant mean: the distribution's own ``std``, else its standard deviation."""

AGEING = Parameter(name="ageing", unit="time", get=_get_ageing, set=_set_ageing)
"""Time in which thresholds age: ``rate**-2`` for `Langevin`."""

PARAMETERS: tuple[Parameter, ...] = (STIFFNESS, VELOCITY, MASS, DAMPING, DELAY, STD, AGEING)


def parameter_named(parameter: Parameter | str) -> Parameter:
    """Return the parameter itself, or the one of this module with that name.

    Raises
    ------
    InputError
        If there is none.
    """
    if isinstance(parameter, Parameter):
        return parameter
    for known in PARAMETERS:
        if known.name == parameter:
            return known
    raise InputError(f"over = {parameter!r}: must be one of {', '.join(k.name for k in PARAMETERS)}, or a Parameter")


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """A value of a parameter at which a pair of modes of smooth sliding is neutral.

    Parameters
    ----------
    value : float
        Of the parameter, in its natural unit.
    frequency : float
        Angular frequency of the neutral mode, in 1/time.
    unstable_below, unstable_above : int
        Number of growing modes just below and just above the value.
    """

    value: float
    frequency: float
    unstable_below: int
    unstable_above: int

    @property
    def loses_stability(self) -> bool:
        """Whether smooth sliding is stable just below the value and unstable just above it."""
        return self.unstable_below == 0 < self.unstable_above

    @property
    def regains_stability(self) -> bool:
        """Whether smooth sliding is unstable just below the value and stable just above it."""
        return self.unstable_below > 0 == self.unstable_above


@dataclass(frozen=True, kw_only=True)
class Crossings:
    """All crossings along a parameter, rising, and the range in which they were looked for; empty is an answer too.

    Parameters
    ----------
    parameter, unit : str
        What was varied, and its natural unit.
    searched : (float, float)
        Range of the parameter.
    unstable_at_ends : (int, int)
        Number of growing modes at its two ends.
    found : tuple of Crossing
        Every crossing of any mode; `edges` are those where stability itself changes.
    """

    parameter: str
    unit: str
    searched: tuple[float, float]
    unstable_at_ends: tuple[int, int]
    found: tuple[Crossing, ...]

    def __iter__(self) -> Iterator[Crossing]:
        return iter(self.found)

    def __len__(self) -> int:
        return len(self.found)

    def __getitem__(self, index: int) -> Crossing:
        return self.found[index]

    @property
    def edges(self) -> tuple[Crossing, ...]:
        """Crossings where smooth sliding loses or regains stability."""
        return tuple(c for c in self.found if c.loses_stability or c.regains_stability)

    def __str__(self) -> str:
        low, high = self.searched
        where = f"for {self.parameter} from {low:g} to {high:g} {self.unit}"
        if not self.edges:
            state = "unstable" if self.unstable_at_ends[0] else "stable"
            return f"smooth sliding is {state} all the way {where}: no boundary there"
        words = [
            f"{'loses' if c.loses_stability else 'regains'} stability at {c.value:.7g} "
            f"(angular frequency {c.frequency:.7g})"
            for c in self.edges
        ]
        return f"{where}, smooth sliding " + ", ".join(words)


def critical(
    parameter: Parameter | str, interface: Interface, rig: Rig, velocity: float, *, between: tuple[float, float]
) -> Crossings:
    """Find every value of a parameter in a range at which a mode of smooth sliding is neutral.

    The number of growing modes is counted along the range, on a logarithmic grid that is refined wherever a
    pair of crossings may hide between two points; each crossing is then polished by Newton's method in the
    value and the frequency.

    Parameters
    ----------
    parameter : Parameter or str
        What to vary: `STIFFNESS`, `VELOCITY`, `MASS`, `DAMPING`, `DELAY`, `STD`, their names, or a parameter of
        your own.
    interface, rig, velocity
        The setting; the parameter's own value in it does not matter.
    between : (float, float)
        Range searched, in the parameter's natural unit, both above 0.

    Returns
    -------
    Crossings
        Possibly none, with the range searched.

    Raises
    ------
    InputError
        If the range is empty, or there is no steady sliding in it.
    """
    turned = parameter_named(parameter)
    low, high = check_range(turned, between)
    start = Setting(interface=interface, rig=rig, velocity=velocity)
    return search(turned, start, low, high)


def critical_velocities(interface: Interface, rig: Rig, between: tuple[float, float]) -> Crossings:
    """Find every speed in a range at which smooth sliding loses or regains stability (linear; ``v1`` of the paper).

    Parameters
    ----------
    interface : Interface
        The contacts.
    rig : Slider or Impedance
        What holds the slider.
    between : (float, float)
        Range of speeds, in ``x_s`` per time.

    Returns
    -------
    Crossings
        With the frequency of the neutral mode and the direction of each; none is an answer, with the range
        searched. There may be several windows of instability: all are found that are wider than a sixteenth of a
        decade, and most narrower ones.
    """
    return critical(VELOCITY, interface, rig, check_range(VELOCITY, between)[0], between=between)


def critical_spring(interface: Interface, rig: Rig, velocity: float) -> float:
    """Return ``K_c(v)``: smooth sliding is stable on this driving spring and on all stiffer ones.

    The rig keeps its mass and damping. No search: at each frequency with ``Im(Z + kappa) = 0`` the spring
    that makes it neutral is known. For a rig without a ``stiffness`` of its own the spring is put in addition
    at the interface, and the answer counts from its present static stiffness.

    Parameters
    ----------
    interface : Interface
        The contacts.
    rig : Slider or Impedance
        What holds the slider; its stiffness does not matter.
    velocity : float
        Speed of smooth sliding, in ``x_s`` per time.

    Returns
    -------
    float
        In units of ``k`` per contact; 0 if smooth sliding is stable on any spring (down to 1e-6). Linear:
        stick-slip once started may live on stiffer ones.

    Raises
    ------
    UndecidedError
        If there is no such spring as far as one can see: a rig without damping.
    """
    speed = number("velocity", velocity, above=0, hint="in x_s per time")
    z = impedance(rig)
    base = float(getattr(rig, "stiffness", 0.0))
    # The softer the springs considered, the longer the scan of a rig without losses: stop at the first that suffices.
    for softest in (1e-1, 1e-3, 1e-6):
        try:
            (neutral,) = neutral_frequencies(respond(interface), z, [speed], softest=softest)
        except UndecidedError as error:
            raise UndecidedError(f"no critical spring above {softest:g} could be decided: {error}") from error
        spring = base + float(np.max(neutral.extra, initial=-math.inf))
        if spring >= softest:
            return spring
    return max(0.0, spring)


def critical_delay(
    interface: Interface, rig: Rig, velocity: float, between: tuple[float, float] | None = None
) -> float:
    """Return the linear critical delay: the shortest with which smooth sliding is unstable.

    Not the paper's ``tau*``, which is the shortest delay with which stick-slip, started from a narrow
    distribution, lasts.

    Parameters
    ----------
    interface : Interface
        The contacts; a `RandomDelay` is scaled as a whole, and its mean is what is returned.
    rig : Slider or Impedance
        What holds the slider.
    velocity : float
        Speed of smooth sliding, in ``x_s`` per time.
    between : (float, float), optional
        Range searched; by default 1e-3 to 1e2 times ``<x_s>/v``.

    Returns
    -------
    float
        In the unit of time.

    Raises
    ------
    UndecidedError
        If smooth sliding is stable all through the range, or unstable already at its lower end; the message
        gives it.
    """
    instance("critical_delay: interface", interface, Interface, "an Interface")
    speed = number("velocity", velocity, above=0, hint="in x_s per time")
    return _first_loss(DELAY, interface, rig, speed, between, interface.threshold_distribution.moment(1) / speed)


def critical_mass(interface: Interface, rig: Rig, velocity: float, between: tuple[float, float]) -> Crossings:
    """Find every mass in a range at which a mode of smooth sliding is neutral, at constant ``eta``; see `critical`."""
    return critical(MASS, interface, rig, velocity, between=between)


def critical_damping(interface: Interface, rig: Rig, velocity: float, between: tuple[float, float]) -> Crossings:
    """Find every damping ``eta`` in a range at which a mode of smooth sliding is neutral; see `critical`."""
    return critical(DAMPING, interface, rig, velocity, between=between)


def critical_std(interface: Interface, rig: Rig, velocity: float, between: tuple[float, float]) -> Crossings:
    """Find every standard deviation of the thresholds in a range at which a mode of smooth sliding is neutral; see `critical`."""
    return critical(STD, interface, rig, velocity, between=between)


def _first_loss(
    parameter: Parameter,
    interface: Interface,
    rig: Rig,
    velocity: float,
    between: tuple[float, float] | None,
    unit: float,
) -> float:
    low, high = check_range(parameter, between or (1e-3 * unit, 1e2 * unit))
    answer = search(parameter, Setting(interface=interface, rig=rig, velocity=velocity), low, high, first=True)
    if answer.unstable_at_ends[0] > 0 or not answer.edges:
        raise UndecidedError(f"no critical {parameter.name}: {answer}")
    return answer.edges[0].value


# ---------------------------------------------------------------- the search


def check_range(parameter: Parameter, between: tuple[float, float]) -> tuple[float, float]:
    """Return the range of a parameter, or raise `InputError`."""
    ends = sequence("between", between, "two values, such as (0.1, 10)")
    if len(ends) != 2:
        raise InputError(f"between = {shown(between)}: must be two values, such as (0.1, 10)")
    low = number("between[0]", ends[0], above=0, hint=parameter.unit)
    return low, number("between[1]", ends[1], above=low, hint=parameter.unit)


class _Point(NamedTuple):
    """The neutral frequencies at one value of the parameter."""

    value: float
    neutral: Neutral
    unstable: int


def neutral_along(
    parameter: Parameter, setting: Setting, values: Sequence[float], *, softest: float | None = None
) -> list[Neutral]:
    """Neutral frequencies at each value of the parameter; values that share interface and rig are computed together."""
    there = [parameter.set(setting, value) for value in values]
    found: list[Neutral] = []
    for (interface, rig), group in groupby(there, key=lambda here: (here.interface, here.rig)):
        speeds = [here.velocity for here in group]
        found += neutral_frequencies(respond(interface), impedance(rig), speeds, softest=softest)
    return found


def _look(parameter: Parameter, setting: Setting, values: Sequence[float]) -> list[_Point]:
    along = neutral_along(parameter, setting, values)
    return [_Point(value, neutral, neutral.unstable()) for value, neutral in zip(values, along, strict=True)]


def search(
    parameter: Parameter, setting: Setting, low: float, high: float, *, first: bool = False, density: int = 16
) -> Crossings:
    """Crossings from `low` to `high`, on `density` points a decade; with `first`, up to the first edge of stability."""
    count = 1 + max(density - 4, math.ceil(density * math.log10(high / low)))
    values = np.geomspace(low, high, count).tolist()
    values[0], values[-1] = low, high
    points = _look(parameter, setting, values[:1])
    found: list[Crossing] = []
    while len(points) < count:
        ahead = values[len(points) : len(points) + (6 if first else count)]
        points += _look(parameter, setting, ahead)
        for k in range(len(points) - len(ahead), len(points)):
            found += _between(parameter, setting, points[k - 1], points[k])
            if k >= 2:
                found += _hidden(parameter, setting, points[k - 2], points[k - 1], points[k], 6)
        if first and (points[0].unstable > 0 or any(c.unstable_below * c.unstable_above == 0 for c in found)):
            break
    return Crossings(
        parameter=parameter.name,
        unit=parameter.unit,
        searched=(low, points[-1].value),
        unstable_at_ends=(points[0].unstable, points[-1].unstable),
        found=tuple(sorted(found, key=lambda crossing: crossing.value)),
    )


def _between(parameter: Parameter, setting: Setting, left: _Point, right: _Point) -> list[Crossing]:
    """Crossings between two points, by quartering until each part holds at most one branch that changes sign."""
    changing = [branch for branch in _matched(left, right) if (branch[1] > 0) != (branch[3] > 0)]
    if left.unstable == right.unstable and not changing:
        return []
    width = math.log(right.value / left.value)
    slack = 1e-12 if setting.interface.ageing is None else 1e-3  # counts come from a table, crossings do not
    if abs(left.unstable - right.unstable) == 2 and len(changing) <= 1:
        starts = [(e / (e - f), w, u) for w, e, u, f in changing]
        if width < 1e-3:
            starts += [(0.5, w, w) for w in _nearest(left.neutral).tolist() + _nearest(right.neutral).tolist()]
        for t, w, u in starts:
            at = polish(
                parameter,
                setting,
                math.log(left.value) + t * width,
                (1 - t) * math.log(w) + t * math.log(u),
                2 * width,
            )
            if at is not None and left.value <= at[0] * (1 + slack) and at[0] <= right.value * (1 + slack):
                return [_crossing(at, left, right)]
    if width <= 1e-12:
        at = left.value, float(next(iter(_nearest(left.neutral)), math.nan))
        return [] if left.unstable == right.unstable else [_crossing(at, left, right)]
    inner = (left.value * np.exp(width * np.array([0.25, 0.5, 0.75]))).tolist()
    points = [left, *_look(parameter, setting, inner), right]
    return [c for pair in pairwise(points) for c in _between(parameter, setting, *pair)]


def _crossing(at: tuple[float, float], left: _Point, right: _Point) -> Crossing:
    return Crossing(value=at[0], frequency=at[1], unstable_below=left.unstable, unstable_above=right.unstable)


def _nearest(neutral: Neutral) -> Array:
    """Finite neutral frequencies, the one that lacks least spring first."""
    order = np.argsort(np.abs(neutral.extra))
    omega = neutral.omega[order]
    return omega[np.isfinite(omega)][:4]


def _matched(one: _Point, two: _Point) -> list[tuple[float, float, float, float]]:
    """Branches present at both points, each the other's nearest: frequency and lacking spring at one, then at two."""
    furthest = 0.02 + 2.5 * abs(math.log(two.value / one.value))
    pairs = []
    for sign in (2, -2):
        here, there = (np.flatnonzero((p.neutral.modes == sign) & np.isfinite(p.neutral.omega)) for p in (one, two))
        if here.size == 0 or there.size == 0:
            continue
        apart = np.abs(np.log(one.neutral.omega[here, None] / two.neutral.omega[there]))
        nearest, back = np.argmin(apart, axis=1), np.argmin(apart, axis=0)
        for i, j in enumerate(nearest.tolist()):
            if back[j] == i and apart[i, j] < furthest:
                k, m = here[i], there[j]
                w, e = float(one.neutral.omega[k]), float(one.neutral.extra[k])
                pairs.append((w, e, float(two.neutral.omega[m]), float(two.neutral.extra[m])))
    return pairs


def _hidden(
    parameter: Parameter, setting: Setting, before: _Point, here: _Point, after: _Point, depth: int
) -> list[Crossing]:
    """Pairs of crossings about a point where a branch comes near to changing sign and turns back."""
    if not before.unstable == here.unstable == after.unstable or depth == 0:
        return []
    earlier = {w: f for w, _, _, f in _matched(here, before)}
    later = {w: f for w, _, _, f in _matched(here, after)}
    for w, e in zip(here.neutral.omega.tolist(), here.neutral.extra.tolist(), strict=True):
        if w not in earlier or w not in later:
            continue
        side = 1.0 if e > 0 else -1.0
        a, b, c = side * earlier[w], side * e, side * later[w]
        bend = a - 2 * b + c
        if not (0 < b <= min(a, c) and bend > 0) or b - (c - a) ** 2 / (8 * bend) > 0.3 * b:
            continue
        fine = np.geomspace(before.value, after.value, 9)[1:-1].tolist()
        points = [before, *_look(parameter, setting, fine), after]
        if any(p.unstable != here.unstable for p in points):
            return [c for pair in pairwise(points) for c in _between(parameter, setting, *pair)]
        return [
            c
            for triple in zip(points, points[1:], points[2:], strict=False)
            for c in _hidden(parameter, setting, *triple, depth - 1)
        ]
    return []


def residual_and_slopes(
    parameters: Sequence[Parameter], setting: Setting, logs: Sequence[float], log_omega: float
) -> tuple[complex, list[complex]]:
    """Return ``Z + kappa`` at ``s = i omega`` and its slopes in the logarithm of each parameter and of omega."""
    # The response of ageing contacts is computed on grids that vary with the setting.
    d, here = 1e-6 if setting.interface.ageing is None else 1e-3, setting
    for parameter, log in zip(parameters, logs, strict=True):
        here = parameter.set(here, math.exp(log))
    # The point itself, omega turned both ways, then each parameter varied both ways.
    there = [here, here, here]
    for parameter, log in zip(parameters, logs, strict=True):
        there += [parameter.set(here, math.exp(log + d)), parameter.set(here, math.exp(log - d))]
    s = 1j * math.exp(log_omega) * np.array([1.0, math.exp(d), math.exp(-d), *[1.0] * (2 * len(parameters))])
    speed = np.array([each.velocity for each in there])
    values = np.empty(s.shape, dtype=complex)
    for rig in dict.fromkeys(each.rig for each in there):
        own = np.array([each.rig == rig for each in there])
        values[own] = impedance(rig)(s[own])
    for interface in dict.fromkeys(each.interface for each in there):
        own = np.array([each.interface == interface for each in there])
        response = respond(interface)
        kappa = response.exact if isinstance(response, AgedResponse) else response.stiffness
        values[own] += kappa(speed[own], s[own])
    slopes = ((values[1::2] - values[2::2]) / (2 * d)).tolist()
    return complex(values[0]), [*slopes[1:], slopes[0]]


def polish(
    parameter: Parameter, setting: Setting, log_value: float, log_omega: float, furthest: float = math.inf
) -> tuple[float, float] | None:
    """Newton's method in (log value, log omega) for ``Z + kappa = 0`` at ``i omega``; None if it does not settle."""
    x, y, last = log_value, log_omega, math.inf
    aged = setting.interface.ageing is not None
    for _ in range(12):
        f, (fx, fy) = residual_and_slopes([parameter], setting, [x], y)
        det = (fx.conjugate() * fy).imag
        if det == 0 or not math.isfinite(det):
            return None
        dx, dy = -(f.conjugate() * fy).imag / det, -(fx.conjugate() * f).imag / det
        step = max(abs(dx), abs(dy))
        x, y = x + dx, y + dy
        if not (step < 1.0 and abs(x - log_value) < furthest):
            return None
        if step < 1e-14 or (step < 1e-10 and step >= 0.5 * last) or (step < 1e-5 and aged):
            return math.exp(x), math.exp(y)
        last = step
    return None
