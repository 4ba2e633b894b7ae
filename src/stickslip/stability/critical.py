"""Critical values: where smooth sliding loses or regains stability as one parameter is varied.

`critical` finds every crossing along a parameter of a rig. All is linear: it says where smooth sliding is unstable to
the smallest disturbance, not where stick-slip, once started, decays.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.answers import Answer
from stickslip.errors import UndecidedError, instance, number
from stickslip.model.parameters import Parameter, parameter_named
from stickslip.model.rig import Ends, Rig
from stickslip.sliding import respond
from stickslip.sliding.response import ComplexArray
from stickslip.stability.impedances import impedance
from stickslip.stability.neutral import Neutral, neutral_frequencies

Array = NDArray[np.float64]

_SAME = 1e-9
"""Crossings that differ by no more, relatively, are one."""
_DEPTH = 6
"""How often points about a hidden pair of crossings are set eight times as close."""


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """A value of a parameter at which a pair of modes of smooth sliding is neutral.

    Parameters
    ----------
    value : float
        Of the parameter, in its natural unit.
    frequency : float
        Angular frequency of the neutral mode, in 1/time; infinite for one that does not oscillate.
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


@dataclass(frozen=True, kw_only=True, repr=False)
class Crossings(Answer):
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
    frequency_unit : str
        In which frequencies are printed.
    """

    parameter: str
    unit: str
    searched: tuple[float, float]
    unstable_at_ends: tuple[int, int]
    found: tuple[Crossing, ...]
    frequency_unit: str = "cycles per time unit"

    def __iter__(self) -> Iterator[Crossing]:
        return iter(self.found)

    def __len__(self) -> int:
        return len(self.found)

    def __getitem__(self, index: int) -> Crossing:
        return self.found[index]

    def in_units(self, rig: Rig) -> Crossings:
        """Return crossings found in natural units in those of a rig."""
        if rig.scales is None:
            return self
        size, rate = rig.unit(self.unit), rig.unit("1/time")
        low, high = self.searched
        return replace(
            self,
            unit=rig.unit_name(self.unit),
            searched=(low * size, high * size),
            found=tuple(replace(c, value=c.value * size, frequency=c.frequency * rate) for c in self.found),
            frequency_unit="Hz",
        )

    @property
    def edges(self) -> tuple[Crossing, ...]:
        """Crossings where smooth sliding loses or regains stability."""
        return tuple(c for c in self.found if c.loses_stability or c.regains_stability)

    def __str__(self) -> str:
        low, high = self.searched
        unit = "" if self.unit == "1" else f" {self.unit}"
        where = f"for {self.parameter} from {low:g} to {high:g}{unit}"
        if not self.edges:
            state = "unstable" if self.unstable_at_ends[0] else "stable"
            return f"smooth sliding is {state} all the way {where}: no boundary there"
        words = [
            f"{'loses' if c.loses_stability else 'regains'} stability at {c.value:.7g}{unit} ({self._frequency(c)})"
            for c in self.edges
        ]
        return f"{where}, smooth sliding " + ", ".join(words)

    def _frequency(self, crossing: Crossing) -> str:
        frequency = crossing.frequency / (2.0 * math.pi)
        return f"{frequency:.4g} {self.frequency_unit}" if math.isfinite(frequency) else "without oscillation"


def critical(rig: Rig, parameter: Parameter | str, *, between: Ends | None = None) -> Crossings:
    """Find every value of a parameter in a range at which a mode of smooth sliding is neutral (linear).

    The number of growing modes is counted along the range, on a logarithmic grid that is refined wherever a
    pair of crossings may hide between two points; each crossing is then polished by Newton's method in the
    value and the frequency. There may be several ranges of instability: all are found that are wider than a sixteenth
    of a decade, and most narrower ones. Along the velocity the crossings are the paper's ``v1``.

    Parameters
    ----------
    rig : Rig
        The parameter's own value in it matters only where no range is given.
    parameter : Parameter or str
        What to vary: ``"stiffness"``, ``"velocity"``, ``"mass"``, ``"damping"``, ``"delay"``, ``"std"``, ``"ageing"``,
        or a parameter of your own.
    between : (float, float), optional
        Range searched, in the rig's own units, both above 0; or texts with units, as in ``("1 mm/s", "1 m/s")``. By
        default a factor 30 either way of the rig's value.

    Returns
    -------
    Crossings
        Each with the frequency of the neutral mode and its direction, in the rig's own units; none is an answer, too,
        with the range searched.

    Raises
    ------
    InputError
        If the range is empty, or there is no steady sliding in it.

    Examples
    --------
    >>> import stickslip as ss
    >>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
    >>> rig = ss.Rig(interface, ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4264), ss.constant(velocity=1.0))
    >>> print(ss.critical(rig, "velocity", between=(0.5, 2.0)))
    for velocity from 0.5 to 2 x_s/time, smooth sliding loses stability at
    1.388221 x_s/time (1.156 cycles per time unit)
    """
    varied, natural, low, high = _range(rig, parameter, between)
    return search(varied, natural, low, high).in_units(rig)


def onset(rig: Rig, parameter: Parameter | str, *, between: Ends) -> float:
    """Return the smallest value of a parameter at which smooth sliding is unstable (linear).

    Along the delay this is the linear critical delay; not the paper's ``tau*``, which is the shortest delay with which
    stick-slip, started from a narrow distribution, persists.

    Parameters
    ----------
    rig, parameter, between
        As for `critical`; a `RandomDelay` is scaled as a whole, and its mean is what is returned.

    Returns
    -------
    float
        In the rig's own units.

    Raises
    ------
    UndecidedError
        If smooth sliding is stable all through the range, or unstable already at its lower end; the message says which.
    """
    varied, natural, low, high = _range(rig, parameter, between)
    found = search(varied, natural, low, high, first=True).in_units(rig)
    if found.unstable_at_ends[0] > 0 or not found.edges:
        raise UndecidedError(f"no onset by {varied.name}: {found}")
    return found.edges[0].value


def critical_spring(rig: Rig) -> float:
    """Return ``K_c(v)``: smooth sliding is stable on this driving spring and on all stiffer ones.

    The slider keeps its mass and damping. No search: at each frequency with ``Im(Z + kappa) = 0`` the spring
    that makes it neutral is known. For an impedance without a ``stiffness`` of its own the spring is put in addition
    at the interface, and the answer counts from its present static stiffness.

    Parameters
    ----------
    rig : Rig
        The stiffness of its spring does not matter.

    Returns
    -------
    float
        In the rig's own units; 0 if smooth sliding is stable on any spring (down to 1e-6 ``k``). Linear: stick-slip
        once started may live on stiffer ones.

    Raises
    ------
    UndecidedError
        If there is no such spring as far as one can see: a rig without damping.
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    natural = rig.natural
    speed = number("velocity", natural.velocity, above=0, hint="in x_s per time")
    z = impedance(natural.slider)
    base = float(getattr(natural.slider, "stiffness", 0.0))
    # The softer the springs considered, the longer the scan of a rig without losses: stop at the first that suffices.
    for softest in (1e-1, 1e-3, 1e-6):
        try:
            (neutral,) = neutral_frequencies(respond(natural.interface), [(z, speed)], softest=softest)
        except UndecidedError as error:
            raise UndecidedError(f"no critical spring above {softest:g} could be decided: {error}") from error
        spring = base + float(np.max(neutral.extra, initial=-math.inf))
        if spring >= softest:
            return spring * rig.unit("k")
    return max(0.0, spring) * rig.unit("k")


def _range(rig: Rig, parameter: Parameter | str, between: Ends | None) -> tuple[Parameter, Rig, float, float]:
    """The parameter, the rig and the range, in natural units."""
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    varied = parameter_named(parameter)
    low, high = rig.around(varied) if between is None else rig.span(varied, between)
    return varied, rig.natural, low, high


# ---------------------------------------------------------------- the search


class Point(NamedTuple):
    """The neutral frequencies at one value of the parameter."""

    value: float
    neutral: Neutral
    unstable: int


def neutral_along(
    parameter: Parameter, rig: Rig, values: Sequence[float], *, softest: float | None = None
) -> list[Neutral]:
    """Neutral frequencies at each value of the parameter; values that share the interface are computed together."""
    there = [parameter.set(rig, value) for value in values]
    found: list[Neutral] = []
    for interface, group in groupby(there, key=lambda here: here.interface):
        rigs = [(impedance(here.slider), here.velocity) for here in group]
        found += neutral_frequencies(respond(interface), rigs, softest=softest)
    return found


def _look(parameter: Parameter, rig: Rig, values: Sequence[float]) -> list[Point]:
    along = neutral_along(parameter, rig, values)
    return [Point(value, neutral, neutral.unstable()) for value, neutral in zip(values, along, strict=True)]


def search(
    parameter: Parameter,
    rig: Rig,
    low: float,
    high: float,
    *,
    first: bool = False,
    density: int = 16,
    edges_only: bool = False,
) -> Crossings:
    """Crossings from `low` to `high`, on `density` points a decade; with `first`, up to the first edge of stability.

    With `edges_only`, what happens where smooth sliding is unstable on both sides is not looked into.
    """
    count = 1 + max(density - 4, math.ceil(density * math.log10(high / low)))
    values = np.geomspace(low, high, count).tolist()
    values[0], values[-1] = low, high
    points = _look(parameter, rig, values[:1])
    found: list[Crossing] = []
    while len(points) < count:
        ahead = values[len(points) : len(points) + (6 if first else count)]
        points += _look(parameter, rig, ahead)
        found += _along(parameter, rig, points, begin=len(points) - len(ahead), edges_only=edges_only)
        if first and (points[0].unstable > 0 or found):  # what is found first, from a stable point on, is an edge
            break
    return Crossings(
        parameter=parameter.name,
        unit=parameter.unit,
        searched=(low, points[-1].value),
        unstable_at_ends=(points[0].unstable, points[-1].unstable),
        found=_distinct(found, max(_SAME, respond(rig.interface).precision.slack)),
    )


def _distinct(found: list[Crossing], apart: float) -> tuple[Crossing, ...]:
    """Each crossing once, rising: a hidden pair lies between more than three points."""
    kept: list[Crossing] = []
    for one in sorted(found, key=lambda crossing: crossing.value):
        same = kept and (kept[-1].unstable_below, kept[-1].unstable_above) == (one.unstable_below, one.unstable_above)
        if not same or one.value > kept[-1].value * (1.0 + apart):
            kept.append(one)
    return tuple(kept)


def _along(
    parameter: Parameter,
    rig: Rig,
    points: list[Point],
    depth: int = _DEPTH,
    *,
    begin: int = 1,
    edges_only: bool = False,
) -> list[Crossing]:
    """Crossings between neighbours, from the one before `begin` on, and those that hide about a point."""
    found: list[Crossing] = []
    for k in range(begin, len(points)):
        if edges_only and points[k - 1].unstable > 0 and points[k].unstable > 0:
            continue
        found += crossings_between(parameter, rig, points[k - 1], points[k])
        if k >= 2:
            found += _hidden(parameter, rig, points[k - 2], points[k - 1], points[k], depth)
    return found


def crossings_between(parameter: Parameter, rig: Rig, left: Point, right: Point) -> list[Crossing]:
    """Return the crossings between two points, by quartering until a part holds one branch that changes sign."""
    changing = [branch for branch in _matched(left, right) if (branch[1] > 0) != (branch[3] > 0)]
    if left.unstable == right.unstable and not changing:
        return []
    width = math.log(right.value / left.value)
    slack = respond(rig.interface).precision.slack
    if abs(left.unstable - right.unstable) == 2 and len(changing) <= 1:
        starts = [(e / (e - f), w, u) for w, e, u, f in changing]
        if width < 1e-3:
            starts += [(0.5, w, w) for w in _nearest(left.neutral).tolist() + _nearest(right.neutral).tolist()]
        for t, w, u in starts:
            at = polish(
                parameter,
                rig,
                math.log(left.value) + t * width,
                (1 - t) * math.log(w) + t * math.log(u),
                2 * width,
            )
            if at is not None and left.value <= at[0] * (1 + slack) and at[0] <= right.value * (1 + slack):
                return [_crossing(at, left, right)]
    if width <= 1e-12:
        nearest = np.append(left.neutral.omega[np.argsort(np.abs(left.neutral.extra))], math.inf)
        at = left.value, float(nearest[0])
        return [] if left.unstable == right.unstable else [_crossing(at, left, right)]
    return [
        c for pair in pairwise(_finer(parameter, rig, left, right, 4)) for c in crossings_between(parameter, rig, *pair)
    ]


def _finer(parameter: Parameter, rig: Rig, left: Point, right: Point, parts: int) -> list[Point]:
    """Two points with those that part the way between them evenly."""
    return [left, *_look(parameter, rig, np.geomspace(left.value, right.value, parts + 1)[1:-1].tolist()), right]


def _crossing(at: tuple[float, float], left: Point, right: Point) -> Crossing:
    return Crossing(value=at[0], frequency=at[1], unstable_below=left.unstable, unstable_above=right.unstable)


def _nearest(neutral: Neutral) -> Array:
    """Finite neutral frequencies, the one that lacks least spring first."""
    order = np.argsort(np.abs(neutral.extra))
    omega = neutral.omega[order]
    return omega[np.isfinite(omega)][:4]


def _matched(one: Point, two: Point) -> list[tuple[float, float, float, float]]:
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


def _hidden(parameter: Parameter, rig: Rig, before: Point, here: Point, after: Point, depth: int) -> list[Crossing]:
    """Pairs of crossings about a point, next to which a branch comes near to changing sign and turns back.

    Near, where the parabola through the three points comes down to a third of the least of them, between them; at
    first, where points are far apart and the parabola is rough, where it comes lower than they at all.
    """
    if not before.unstable == here.unstable == after.unstable or depth == 0:
        return []
    earlier = {w: f for w, _, _, f in _matched(here, before)}
    later = {w: f for w, _, _, f in _matched(here, after)}
    for w, e in zip(here.neutral.omega.tolist(), here.neutral.extra.tolist(), strict=True):
        if w not in earlier or w not in later:
            continue
        side = 1.0 if e > 0 else -1.0
        a, b, c = side * earlier[w], side * e, side * later[w]
        bend, least = a - 2 * b + c, min(a, b, c)
        near = least * (0.9 if depth == _DEPTH else 0.3)
        if not (least > 0 and bend > 0 and 2 * bend >= abs(c - a)) or b - (c - a) ** 2 / (8 * bend) > near:
            continue
        return _along(parameter, rig, _finer(parameter, rig, before, after, 8), depth - 1)
    return []


def _residual_and_slopes(
    parameter: Parameter, rig: Rig, log_value: float, log_omega: float
) -> tuple[complex, complex, complex]:
    """``Z + kappa`` at ``s = i omega``, and about its slopes in the logarithms of the parameter and of omega."""
    here, response = parameter.set(rig, math.exp(log_value)), respond(rig.interface)
    d, s = response.precision.step, 1j * math.exp(log_omega)
    turned = s * np.exp(np.array([d, -d]))
    along = _total(here, turned)
    varied = [_total(parameter.set(rig, math.exp(log_value + e)), np.array([s]))[0] for e in (d, -d)]
    exact = respond(here.interface).exact(here.velocity, s) + impedance(here.slider)(np.array([s]))[0]
    return complex(exact), complex(varied[0] - varied[1]) / (2 * d), complex(along[0] - along[1]) / (2 * d)


def _total(rig: Rig, s: ComplexArray) -> ComplexArray:
    """``Z + kappa`` on the axis."""
    return np.asarray(impedance(rig.slider)(s) + respond(rig.interface).stiffness(rig.velocity, s))


def polish(
    parameter: Parameter, rig: Rig, log_value: float, log_omega: float, furthest: float = math.inf
) -> tuple[float, float] | None:
    """Newton's method in (log value, log omega) for ``Z + kappa = 0`` at ``i omega``; None if it does not settle."""
    x, y, last = log_value, log_omega, math.inf
    settled = max(1e-14, respond(rig.interface).precision.settled)
    for _ in range(12):
        f, fx, fy = _residual_and_slopes(parameter, rig, x, y)
        det = (fx.conjugate() * fy).imag
        if det == 0 or not math.isfinite(det):
            return None
        dx, dy = -(f.conjugate() * fy).imag / det, -(fx.conjugate() * f).imag / det
        step = max(abs(dx), abs(dy))
        x, y = x + dx, y + dy
        if not (step < 1.0 and abs(x - log_value) < furthest):
            return None
        if step < settled or (step < 1e-10 and step >= 0.5 * last):
            return math.exp(x), math.exp(y)
        last = step
    return None
