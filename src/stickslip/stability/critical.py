"""Critical values: where smooth sliding loses or regains stability as one parameter is
varied.

`critical` finds every crossing along a parameter of a rig. All of this is linear: it
finds where smooth sliding is unstable to the smallest perturbation, not where
stick-slip that has started decays.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import ClassVar, Generic, NamedTuple, Self, TypeVar

import numpy as np

from stickslip.answers import Answer
from stickslip.arrays import Array
from stickslip.errors import UndecidedError, instance, number
from stickslip.loops import bounded
from stickslip.model.parameters import Parameter, parameter_named
from stickslip.model.rig import Ends, Rig
from stickslip.sliding import respond
from stickslip.sliding.response import ComplexArray
from stickslip.stability.impedances import impedance, spring_at_contact
from stickslip.stability.modes import smooth_sliding
from stickslip.stability.neutral import Neutral, neutral_frequencies
from stickslip.stability.scan import SmoothSliding
from stickslip.words import engineering

# number of times that the search for a hidden pair of crossings divides its step by 8
_DEPTH = 6
_EIGHTHS = np.arange(1, 8) / 8
Item = TypeVar("Item")


@dataclass(frozen=True, kw_only=True, repr=False)
class Along(Answer, Generic[Item]):
    """Results along a parameter, in increasing order; iterating yields the results.

    An empty result is also an answer.
    """

    _items: ClassVar[str]  # name of the field that holds the results

    parameter: str  #: name of the parameter that was varied
    unit: str  #: unit of its values
    searched: tuple[float, float]  #: range of its values that was searched

    @property
    def where(self) -> str:
        """The range searched, in words."""
        low, high = self.searched
        return (
            f"for {self.parameter} from {low:g} to {high:g} {self.unit}".removesuffix(
                " 1"
            )
        )

    def __iter__(self) -> Iterator[Item]:
        return iter(getattr(self, self._items))

    def __len__(self) -> int:
        return len(getattr(self, self._items))


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """A value of a parameter at which a pair of modes of smooth sliding is neutral."""

    value: float  #: of the parameter
    #: angular frequency of the neutral mode, in 1/time; infinite for a mode that does
    #: not oscillate
    frequency: float
    unstable_below: int  #: number of growing modes just below the value
    unstable_above: int  #: number of growing modes just above the value

    @property
    def loses_stability(self) -> bool:
        """Whether smooth sliding is stable just below the value and unstable just above
        it.
        """
        return self.unstable_below == 0 < self.unstable_above

    @property
    def regains_stability(self) -> bool:
        """Whether smooth sliding is unstable just below the value and stable just above
        it.
        """
        return self.unstable_below > 0 == self.unstable_above


@dataclass(frozen=True, kw_only=True, repr=False)
class Crossings(Along[Crossing]):
    """All crossings along a parameter, in increasing order, and the range searched; an
    empty result is also an answer.
    """

    _items = "found"

    #: number of growing modes at both ends of the range searched
    unstable_at_ends: tuple[int, int]
    #: every crossing of any mode; `edges` are those where stability itself changes
    found: tuple[Crossing, ...]
    frequency_unit: str = "cycles per time unit"  #: unit of printed frequencies

    def __getitem__(self, index: int) -> Crossing:
        return self.found[index]

    def in_units(self, rig: Rig) -> Self:
        """Convert crossings found in natural units to the units of a rig."""
        if rig.scales is None:
            return self
        size = rig.unit(self.unit)
        rate = rig.unit("1/time")
        low, high = self.searched
        return replace(
            self,
            unit=rig.unit_name(self.unit),
            searched=(low * size, high * size),
            found=tuple(
                replace(c, value=c.value * size, frequency=c.frequency * rate)
                for c in self.found
            ),
            frequency_unit="Hz",
        )

    @property
    def edges(self) -> tuple[Crossing, ...]:
        """Crossings where smooth sliding loses or regains stability."""
        return tuple(c for c in self.found if c.loses_stability or c.regains_stability)

    def __str__(self) -> str:
        if not self.edges:
            state = "unstable" if self.unstable_at_ends[0] else "stable"
            return (
                f"smooth sliding is {state} {self.where}; no stability limit in "
                "this range"
            )
        words = [
            f"{'loses' if c.loses_stability else 'regains'} stability at "
            f"{engineering(c.value, self.unit, 7)} "
            f"({self._frequency(c)})"
            for c in self.edges
        ]
        return f"{self.where}, smooth sliding " + ", ".join(words)

    def _frequency(self, crossing: Crossing) -> str:
        frequency = crossing.frequency / (2.0 * math.pi)
        return (
            f"{frequency:.4g} {self.frequency_unit}"
            if math.isfinite(frequency)
            else "without oscillation"
        )


def critical(
    rig: Rig,
    parameter: Parameter | str,
    *,
    between: Ends | None = None,
) -> Crossings:
    """Find every value of a parameter in a range at which a mode of smooth sliding is
    neutral (linear).

    The number of growing modes is counted along the range, on a logarithmic grid that
    is refined wherever a pair of crossings may hide between two points; each crossing
    is then polished by Newton's method in the value and the frequency. Of several
    ranges of instability all are found that are wider than a sixteenth of a decade, and
    most narrower ones. Along the velocity the crossings are the paper's ``v1``.

    Parameters
    ----------
    rig : Rig
        The rig; its value of the parameter matters only where no range is given.
    parameter : Parameter or str
        Parameter to vary: ``"stiffness"``, ``"velocity"``, ``"mass"``, ``"damping"``,
        ``"delay"``, ``"std"``, ``"ageing"``, or a parameter of your own.
    between : (float, float), optional
        Range searched, in the rig's own units, both above 0; or texts with units, as in
        ``("1 mm/s", "1 m/s")``. By default a factor 30 below and above the rig's value.

    Returns
    -------
    Crossings
        Each with the frequency of the neutral mode and its direction, in the rig's own
        units; it may be empty, and then still has the range searched.

    Raises
    ------
    InputError
        If the range is empty, or there is no steady sliding in it.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> rig = ss.Rig(
    ...     interface,
    ...     ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4264),
    ...     ss.constant(velocity=1.0),
    ... )
    >>> print(ss.critical(rig, "velocity", between=(0.5, 2.0)))
    for velocity from 0.5 to 2 x_s/time, smooth sliding loses stability at
    1.388221 x_s/time (1.156 cycles per time unit)
    """
    varied, natural, low, high = _range(rig, parameter, between)
    return search(varied, natural, low, high).in_units(rig)


def onset(rig: Rig, parameter: Parameter | str, *, between: Ends) -> float:
    """Return the smallest value of a parameter at which smooth sliding is unstable
    (linear).

    Along the delay this is the linear critical delay; not the paper's ``tau*``, which
    is the shortest delay with which stick-slip, started from a narrow distribution,
    persists.

    Parameters
    ----------
    rig, parameter, between
        As for `critical`; a `RandomDelay` is scaled as a whole, and its mean is
        returned.

    Returns
    -------
    float
        In the rig's own units.

    Raises
    ------
    UndecidedError
        If smooth sliding is stable in the whole range, or unstable already at its lower
        end; the message says which.
    """
    varied, natural, low, high = _range(rig, parameter, between)
    found = search(varied, natural, low, high, first=True).in_units(rig)
    if found.unstable_at_ends[0] > 0 or not found.edges:
        raise UndecidedError(f"no onset by {varied.name}: {found}")
    return found.edges[0].value


def critical_spring(rig: Rig) -> float:
    """Return ``K_c(v)``: smooth sliding is stable on this driving spring and on all
    stiffer ones.

    The slider keeps its mass and damping. There is no search: at each frequency with
    ``Im(Z + kappa) = 0`` the spring that makes it neutral is known. For an impedance
    without a ``stiffness`` field the spring is added at the interface, and the result
    counts from the present static stiffness.

    Parameters
    ----------
    rig : Rig
        The rig; the stiffness of its spring does not matter.

    Returns
    -------
    float
        In the rig's own units; 0 if smooth sliding is stable on any spring (down to
        1e-6 ``k``). Linear: stick-slip that has started may persist on stiffer springs.

    Raises
    ------
    UndecidedError
        If no such spring can be found: for a rig without damping.
    """
    sliding = smooth_sliding(rig)
    base = spring_at_contact(sliding.body) or 0.0
    # The softer the springs considered, the longer the scan of a rig without losses:
    # stop at the first scan that suffices.
    for softest in (1e-1, 1e-3, 1e-6):
        try:
            (neutral,) = neutral_frequencies([sliding], softest=softest)
        except UndecidedError as error:
            raise UndecidedError(
                f"no critical spring above {softest:g} could be decided: {error}"
            ) from error
        spring = base + float(np.max(neutral.extra, initial=-math.inf))
        if spring >= softest:
            return spring * rig.unit("k")
    return max(0.0, spring) * rig.unit("k")


def _range(
    rig: Rig,
    parameter: Parameter | str,
    between: Ends | None,
) -> tuple[Parameter, Rig, float, float]:
    """Return the parameter, the rig and the range, in natural units."""
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    varied = parameter_named(parameter)
    low, high = rig.around(varied) if between is None else rig.span(varied, between)
    return varied, rig.natural, low, high


class LinePoint(NamedTuple):
    """The neutral frequencies at one value of the parameter."""

    value: float
    neutral: Neutral

    @property
    def unstable(self) -> int:
        """Number of growing modes."""
        return self.neutral.unstable()


Branch = tuple[float, float, float, float]
"""A branch of neutral frequencies between two points: frequency and extra spring at the
first, then at the second.
"""


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
    """Find crossings from `low` to `high`, with `density` points a decade.

    With `first`, the search ends at the first edge of stability. With `edges_only`,
    ranges with instability at both ends are not searched.
    """
    count = 1 + max(density - 4, math.ceil(density * math.log10(high / low)))
    values = np.geomspace(low, high, count).tolist()
    line = Line(parameter, rig)
    points = line.look(values[:1])
    found = list[Crossing]()
    turns = bounded("critical.search", count)
    while len(points) < count:
        next(turns)
        ahead = values[len(points) : len(points) + (6 if first else count)]
        points += line.look(ahead)
        found += line.crossings(
            points,
            begin=len(points) - len(ahead),
            edges_only=edges_only,
        )
        # The first crossing after a stable point is an edge.
        if first and (points[0].unstable > 0 or found):
            break
    return Crossings(
        parameter=parameter.name,
        unit=parameter.unit,
        searched=(low, points[-1].value),
        unstable_at_ends=(points[0].unstable, points[-1].unstable),
        found=_distinct(found, line.slack),
    )


def _distinct(found: list[Crossing], apart: float) -> tuple[Crossing, ...]:
    """Return each crossing once, in increasing order, as the search of hidden pairs
    may find one twice.
    """
    kept: list[Crossing] = []
    for one in sorted(found, key=lambda crossing: crossing.value):
        same = kept and (kept[-1].unstable_below, kept[-1].unstable_above) == (
            one.unstable_below,
            one.unstable_above,
        )
        if not same or one.value > kept[-1].value * (1.0 + apart):
            kept.append(one)
    return tuple(kept)


class Line(NamedTuple):
    """A rig along a parameter."""

    parameter: Parameter
    rig: Rig

    @property
    def slack(self) -> float:
        """Relative distance within which two crossings count as one, and a crossing
        belongs to a change of the count.
        """
        return max(1e-6, respond(self.rig.interface).accuracy)

    def neutral(
        self, values: Sequence[float], *, softest: float | None = None
    ) -> list[Neutral]:
        """Return the neutral frequencies at each value; values that share the interface
        are computed together.
        """
        there = [self.parameter.set(self.rig, value) for value in values]
        found: list[Neutral] = []
        for interface, group in groupby(there, key=lambda here: here.interface):
            response = respond(interface)
            rigs = []
            for here in group:
                speed = number("velocity", here.velocity, above=0)
                rigs.append(SmoothSliding(response, impedance(here.slider), speed))
            found += neutral_frequencies(rigs, softest=softest)
        return found

    def look(self, values: Sequence[float]) -> list[LinePoint]:
        """Return the points at these values."""
        return [*map(LinePoint, values, self.neutral(values))]

    def finer(self, left: LinePoint, right: LinePoint, cuts: Array) -> list[LinePoint]:
        """Return two points, and points at given fractions of the range between."""
        return [
            left,
            *self.look((left.value * (right.value / left.value) ** cuts).tolist()),
            right,
        ]

    def crossings(
        self,
        points: list[LinePoint],
        depth: int = _DEPTH,
        *,
        begin: int = 1,
        edges_only: bool = False,
    ) -> list[Crossing]:
        """Return crossings between neighbouring points, from the one before `begin` on,
        and those that hide near a point.
        """
        found: list[Crossing] = []
        for k in range(begin, len(points)):
            if edges_only and points[k - 1].unstable > 0 and points[k].unstable > 0:
                continue
            found += self.between(points[k - 1], points[k])
            if (
                k >= 2
                and depth > 0
                and _hides(points[k - 2 : k + 1], 0.9 if depth == _DEPTH else 0.3)
            ):
                found += self.crossings(
                    self.finer(points[k - 2], points[k], _EIGHTHS), depth - 1
                )
        return found

    def between(self, left: LinePoint, right: LinePoint) -> list[Crossing]:
        """Return crossings between two points, by quartering until a part holds one
        branch that changes sign.
        """
        below = left.unstable
        above = right.unstable
        changing = [
            (w, e, u, f) for w, e, u, f in _matched(left, right) if (e > 0) != (f > 0)
        ]
        if below == above and not changing:
            return []
        width = math.log(right.value / left.value)
        place = None
        if abs(below - above) == 2 and len(changing) <= 1:
            place = self.located(left, right, changing, width)
        if place is None and width <= 1e-12:
            if below == above:
                return []
            place = left.value, _nearest(left.neutral)[0]
        if place is not None:
            value, frequency = place
            return [
                Crossing(
                    value=value,
                    frequency=frequency,
                    unstable_below=below,
                    unstable_above=above,
                )
            ]
        cuts = _EIGHTHS[1::2]
        # Without a frequency to polish, close in on the expected change of sign.
        if len(changing) == 1 and math.isinf(changing[0][0]):
            _, e, _, f = changing[0]
            cuts = np.clip(
                e / (e - f) + min(0.25, width) * np.array([-1.0, 1.0]),
                0.01,
                0.99,
            )
        return [
            found
            for pair in pairwise(self.finer(left, right, cuts))
            for found in self.between(*pair)
        ]

    def located(
        self,
        left: LinePoint,
        right: LinePoint,
        changing: list[Branch],
        width: float,
    ) -> tuple[float, float] | None:
        """Return value and frequency of the crossing between two points by Newton's
        method, from the branch that changes sign or, if the points are close, from the
        nearest branches; None if there is none.
        """
        starts = [(e / (e - f), w, u) for w, e, u, f in changing]
        if width < 1e-3:
            near = _nearest(left.neutral)[:4] + _nearest(right.neutral)[:4]
            starts += [(0.5, w, w) for w in near]
        more = 1 + self.slack
        for t, w, u in starts:
            log_omega = (1 - t) * math.log(w) + t * math.log(u)
            at = self.polish(math.log(left.value) + t * width, log_omega, 2 * width)
            if at and left.value / more <= at[0] <= right.value * more:
                return at
        return None

    def _total(self, log_value: float, log_omega: Array) -> ComplexArray:
        """Return ``Z + kappa`` on the imaginary axis at a value."""
        rig = self.parameter.set(self.rig, math.exp(log_value))
        s = 1j * np.exp(log_omega)
        kappa = respond(rig.interface).stiffness(rig.velocity, s)
        return impedance(rig.slider)(s) + kappa

    def polish(
        self,
        log_value: float,
        log_omega: float,
        furthest: float,
    ) -> tuple[float, float] | None:
        """Solve ``Z + kappa = 0`` on the axis by Newton's method in (log value, log
        omega); None if it does not converge.
        """
        x = log_value
        y = log_omega
        last = math.inf
        response = respond(self.rig.interface)
        if not math.isfinite(y):
            return None
        # step at which a difference in logarithms has the least error
        d = 1e-6 if response.certain else 1e-4
        for _ in range(12):
            f, beside = self._total(x, y + np.array([0.0, d])).tolist()
            (ahead,) = self._total(x + d, np.array([y])).tolist()
            fx = (ahead - f) / d
            fy = (beside - f) / d
            det = (fx.conjugate() * fy).imag
            if det == 0 or not math.isfinite(det):
                return None
            dx = -(f.conjugate() * fy).imag / det
            dy = -(fx.conjugate() * f).imag / det
            step = max(abs(dx), abs(dy))
            x = x + dx
            y = y + dy
            if not (step < 1.0 and abs(x - log_value) < furthest):
                return None
            if step < 0.01 * response.accuracy or (step < 1e-10 and step >= 0.5 * last):
                return math.exp(x), math.exp(y)
            last = step
        return None


def _nearest(neutral: Neutral) -> list[float]:
    """Neutral frequencies, beginning with that of the smallest extra spring, and
    infinity.
    """
    return [*neutral.omega[np.argsort(np.abs(neutral.extra))].tolist(), math.inf]


def _matched(one: LinePoint, two: LinePoint) -> list[Branch]:
    """Return the branches present at both points, each the other's nearest."""
    here, there = (n.at(np.isfinite(n.extra)) for n in (one.neutral, two.neutral))
    if here.omega.size == 0 or there.omega.size == 0:
        return []
    # In the logarithm the distance of infinity to itself is 0 after this bound.
    apart = np.abs(
        np.log(np.minimum(here.omega[:, None], 1e300) / np.minimum(there.omega, 1e300))
    )
    apart[here.modes[:, None] != there.modes] = math.inf
    k = np.arange(here.omega.size)
    m = np.argmin(apart, axis=1)
    alike = (np.argmin(apart, axis=0)[m] == k) & (
        apart[k, m] < 0.02 + 2.5 * abs(math.log(two.value / one.value))
    )
    here = here.at(k[alike])
    there = there.at(m[alike])
    columns = (here.omega, here.extra, there.omega, there.extra)
    return list(zip(*map(np.ndarray.tolist, columns), strict=True))


def _hides(points: list[LinePoint], close: float) -> bool:
    """Whether a branch comes near to changing sign about the middle of three points,
    and turns back.

    It does if the minimum of the parabola through the three points lies between them
    and below the fraction `close` of the least of them.
    """
    before, here, after = points
    if not before.unstable == here.unstable == after.unstable:
        return False
    earlier = {w: f for w, _, _, f in _matched(here, before)}
    for w, e, _, f in _matched(here, after):
        side = 1.0 if e > 0 else -1.0
        a = side * earlier.get(w, math.nan)
        b = side * e
        c = side * f
        bend = a - 2 * b + c
        least = min(a, b, c)
        if (
            least > 0
            and bend > 0
            and 2 * bend >= abs(c - a)
            and b - (c - a) ** 2 / (8 * bend) <= close * least
        ):
            return True
    return False
