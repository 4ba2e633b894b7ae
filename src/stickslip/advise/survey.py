"""Ranges of one kind of motion along a parameter, by linear theory, and along the speed
also by runs from rest.

Parameters are given here as factors on the rig's own values, so that units do not
matter.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from itertools import groupby, pairwise

import numpy as np

from stickslip.advise.budget import (
    OSCILLATES,
    SEEDS,
    Budget,
    BudgetExhausted,
    cost_of_run,
    cost_of_theory,
    is_expensive,
    trial,
    varies,
)
from stickslip.cycles.oscillation_verdict import linearly_unstable
from stickslip.errors import InputError, UndecidedError
from stickslip.loops import HALVINGS, bounded
from stickslip.model.parameters import VELOCITY, Parameter
from stickslip.model.rig import Rig
from stickslip.stability import growth_rate
from stickslip.stability.critical import search

# Relative precision of the values at which the motion changes; values on a machine are
# not set more precisely, either.
PRECISION = 0.05
# note on contacts whose linear response is 0
CANNOT_GROW = "without delay or ageing smooth sliding cannot become unstable"
# names of the kinds of motion that have a longer one
MOTIONS = {
    "unstable": "linearly unstable",
    "stable": "linearly stable",
    "unknown": "not known",
}
# points per decade at which growing modes are counted, by `is_expensive`
_PER_DECADE = {False: 16, True: 6}
# relative precision of the ends of a range in which the theory cannot decide
_NARROW = 1e-3
# a parameter, and the side to which a factor varies it: 1 up, -1 down
Direction = tuple[Parameter, int]
_Seen = tuple[float, str]  # a speed, and the motion there
_APART = 3.0  # the speeds of the first runs are at most this factor apart


@dataclass(frozen=True, kw_only=True)
class Band:
    """A range of a parameter, in a prediction the speed, with one kind of motion."""

    #: Motion from a start at rest. "stable" or "unstable" is that of smooth sliding by
    #: linear theory, where a start at rest was not simulated or not decided; "unknown"
    #: where the theory does not decide either.
    kind: str

    #: Whether smooth sliding, once reached, is stable as well (by linear theory, so
    #: without the noise of contacts).
    bistable: bool = False
    low: float
    high: float

    #: Whether the motion changes at that end; False if it was seen up to there, and not
    #: searched beyond.
    low_found: bool = True
    high_found: bool = True

    @property
    def ends(self) -> tuple[float, float]:
        """Both ends of the range."""
        return self.low, self.high

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    @property
    def motion(self) -> str:
        """The kind of motion in words."""
        return MOTIONS.get(self.kind, self.kind) + (
            " (from rest only)" if self.bistable else ""
        )


def scaled(bands: Iterable[Band], size: float) -> tuple[Band, ...]:
    """Return the bands with their ends multiplied by a factor."""
    return tuple(
        replace(band, low=band.low * size, high=band.high * size) for band in bands
    )


def joined(bands: Iterable[Band]) -> tuple[Band, ...]:
    """Return bands, in rising order, with adjacent or overlapping bands of one kind
    merged, and empty ones left out.
    """
    found: list[Band] = []
    for band in bands:
        last = found[-1] if found else None
        if (
            last
            and (last.kind, last.bistable) == (band.kind, band.bistable)
            and band.low <= last.high
        ):
            found[-1] = replace(
                last, high=max(last.high, band.high), high_found=band.high_found
            )
        elif band.low < band.high:
            found.append(band)
    return tuple(found)


def fastest_mode(rig: Rig) -> tuple[float | None, float | None]:
    """Return growth rate and frequency (in cycles) of the fastest mode, in the rig's
    own units; None if no mode grows or decays exponentially.
    """
    try:
        root = growth_rate(rig)
    except UndecidedError:
        return None, None
    return root.real, abs(root.imag) / (2.0 * math.pi)


@cache
def factor_on(*directions: Direction) -> Parameter:
    """Return one factor on several parameters as a parameter."""

    def varied(rig: Rig, factor: float) -> Rig:
        for parameter, side in directions:
            rig = parameter.set(rig, parameter.get(rig) * factor**side)
        return rig

    name = directions[0][0].name
    return Parameter(name=name, unit="1", get=lambda _rig: 1.0, set=varied)


def stability_along(
    rig: Rig, parameter: Parameter, low: float, high: float, density: int = 0
) -> tuple[Band, ...]:
    """Return the ranges of the factor on a parameter, in rising order, in which smooth
    sliding is stable, unstable, or not decided.

    Stable ranges narrower than a decade over `density`, by default 16 (6 for an
    expensive rig), may be missed.
    """
    factor = factor_on((parameter, 1))
    density = density or _PER_DECADE[is_expensive(rig)]
    try:
        found = search(factor, rig.natural, low, high, density=density, edges_only=True)
    except (InputError, UndecidedError):  # the theory does not decide at some value
        if high < (1.0 + _NARROW) * low or all(
            linearly_unstable(factor.set(rig, end)) is None for end in (low, high)
        ):
            return (Band(kind="unknown", low=low, high=high),)
        middle = math.sqrt(low * high)
        lower, upper = (
            stability_along(rig, parameter, *ends, density)
            for ends in ((low, middle), (middle, high))
        )
        return joined(lower + upper)
    begins = [(low, found.unstable_at_ends[0] > 0)]
    begins += [(edge.value, edge.unstable_above > 0) for edge in found.edges]
    ends = [*(edge.value for edge in found.edges), high]
    return tuple(
        Band(kind="unstable" if grows else "stable", low=begin, high=end)
        for (begin, grows), end in zip(begins, ends, strict=True)
    )


def theory_along(
    budget: Budget,
    rig: Rig,
    parameter: Parameter,
    low: float,
    high: float,
    density: int = 0,
) -> tuple[Band, ...]:
    """Return `stability_along` within a budget.

    It costs an evaluation at each point, as expensive as the mean of those at the ends
    and at the rig. A parameter of the slider costs one, as the response of the contacts
    stays the same.
    """
    factor = factor_on((parameter, 1))
    first, last = (factor.set(rig.natural, end) for end in (low, high))
    points = 0.0
    here = [rig]
    if (first.interface, first.velocity) != (last.interface, last.velocity):
        density = density or _PER_DECADE[is_expensive(rig)]
        points = density * math.log10(high / low)
        here += [first, last]
    cost = float(np.mean([cost_of_theory(each) for each in here]))
    # an expensive response of the rig's own contacts is paid for by the budget itself
    more = points * cost + (0.0 if is_expensive(rig) else cost - 1.0)
    given = (parameter, low, high, density)
    return budget.theory(stability_along, rig, *given, more=more)


def works_at(rig: Rig) -> list[float]:
    """Return the speeds at which a rig works, and the ends of a range of them, as
    factors on its own speed.
    """
    return [
        speed / rig.natural.velocity
        for speed in (*rig.operation.speeds, *(rig.operation.between or ()))
    ]


class Survey:
    """Runs from rest over the whole range of speeds: first on a grid, then by halving
    between neighbours with different motion.

    Speeds that were not simulated, or stayed undecided, count as neither smooth nor
    stick-slip.
    """

    def __init__(self, rig: Rig, linear: Sequence[Band], here: str) -> None:
        self._setting = replace(trial(rig), method=rig.method)
        self._linear = linear
        self._works = works_at(rig)
        places = [*self._works, *_grid(linear)]
        apart = [v for v in places if not math.isclose(v, 1.0, rel_tol=PRECISION)]
        # motion by speed; empty where it is not known yet
        self.known = dict.fromkeys(apart, "") | {1.0: here}

    def simulate(self, budget: Budget) -> None:
        """Simulate at the speeds at which the rig works, on the grid, and ever closer
        to changes of motion, until the budget ends.

        The speed with the most doubt per cost of a run comes first.
        """
        looked = set[float]()
        price = cache(lambda speed: cost_of_run(self._case(speed)))
        # speeds are `PRECISION` apart, so that a range of decades has fewer than this
        turns = bounded("Survey.simulate", HALVINGS)
        while doubt := self._doubts(looked):
            next(turns)
            speed = max(doubt, key=lambda v: doubt[v] / price(v))
            looked.add(speed)
            # the budget may still suffice for a shorter run at another speed
            with suppress(BudgetExhausted):
                self.known[speed] = self._judge(budget, speed)
        for speeds in self._contradicted():
            middle = speeds[len(speeds) // 2]
            with suppress(BudgetExhausted):
                again = budget.regime(self._case(middle, 2)).kind
                if again != self.known[middle]:
                    self.known |= dict.fromkeys(speeds, "undecided")
        self._confirm(budget)

    def _judge(self, budget: Budget, speed: float) -> str:
        """Return the motion in a run at a speed. Where one run decides little, an
        oscillation has to show in a second one, with all contacts of the rig, too.
        """
        case = self._case(speed)
        try:
            kind = str(budget.regime(case).kind)
            if kind in OSCILLATES and varies(case):
                again = budget.regime(self._case(speed, 1)).kind
                return kind if again == kind else "undecided"
        except InputError:
            return "undecided"
        return kind

    def _confirm(self, budget: Budget) -> None:
        """Repeat runs next to a change of motion with other contacts, where one run
        decides little: the motion there is undecided if these disagree.
        """
        asked = {1.0}  # the speed of the rig itself is judged elsewhere
        turns = bounded("Survey.confirm", HALVINGS)
        while ends := [
            speed
            for band in self._linear
            for change in self._changes(band)
            for speed, kind in change
            if kind != band.kind and speed not in asked and varies(self._case(speed))
        ]:
            next(turns)
            asked.add(speed := ends[0])
            cases = (self._case(speed, other) for other in range(1, SEEDS))
            with suppress(BudgetExhausted):
                agree = (self.known[speed], "undecided")
                if any(budget.regime(case).kind not in agree for case in cases):
                    self.known[speed] = "undecided"

    def _case(self, speed: float, other: int = 0) -> Rig:
        """Return the rig for a run at a multiple of its own speed; with `other` > 0,
        with differently drawn contacts, and all of them.
        """
        there = VELOCITY.set(self._setting, speed * self._setting.natural.velocity)
        return trial(there, other=other, most=math.inf) if other else trial(there)

    def _contradicted(self) -> list[list[float]]:
        """Return successive speeds with an oscillation between speeds without, or the
        other way round: with contacts drawn only once, that may be chance.
        """
        seen = [pair for band in self._linear for pair in self._seen(band)]
        decided = [pair for pair in seen if pair[1] in (*OSCILLATES, "smooth sliding")]
        rows = [
            [speed for speed, _ in row]
            for _, row in groupby(decided, key=lambda pair: pair[1] in OSCILLATES)
        ]
        # the speed of the rig itself is judged by another run
        return [row for row in rows[1:-1] if 1.0 not in row]

    def _doubts(self, looked: set[float]) -> dict[float, float]:
        """Return the doubt at each speed to try: those not yet tried, else the middles
        between neighbours with different motion, with their logarithmic distance.
        """
        untried = [v for v, kind in self.known.items() if not kind and v not in looked]
        if untried:
            return {v: math.inf if v in self._works else 1.0 for v in untried}
        widths = {
            math.sqrt(left * right): math.log(right / left)
            for band in self._linear
            for (left, one), (right, two) in self._changes(band)
            if band.kind not in (one, two)
        }
        least = 2.0 * math.log1p(PRECISION)
        return {v: w for v, w in widths.items() if v not in looked and w > least}

    def _changes(self, band: Band) -> list[tuple[_Seen, _Seen]]:
        """Return pairs of neighbouring speeds with different motion, in a range."""
        return [pair for pair in pairwise(self._seen(band)) if pair[0][1] != pair[1][1]]

    def _seen(self, band: Band) -> list[_Seen]:
        """Return the speeds tried in a range, in rising order, with the motion there,
        or that of linear theory where it is not known.

        A run that seems smooth where smooth sliding is unstable does not count: its
        oscillation has not grown yet, or is hidden by noise.
        """
        decided = (*OSCILLATES, "smooth sliding")[: 2 if band.kind == "unstable" else 3]
        inside = [v for v in sorted(self.known) if v in band]
        kinds = [
            kind if (kind := self.known[v]) in decided else band.kind for v in inside
        ]
        if band.kind == "stable":
            return [*zip(inside, kinds, strict=True)]
        # One undecided speed between two with the same oscillation is no evidence
        # against it: leave it out.
        sides = zip(["", *kinds], inside, kinds, [*kinds[1:], "?"], strict=False)
        return [
            (v, kind)
            for before, v, kind, after in sides
            if not (kind == band.kind and before == after != band.kind)
        ]

    def bands(self) -> tuple[Band, ...]:
        """Return the ranges of linear stability, divided where the motion changes.

        Where a change is not located precisely, the motion at a speed is reported only
        for its immediate neighbourhood.
        """
        parts: list[Band] = []
        for band in self._linear:
            begin = band.low
            found = True
            for (left, one), (right, _) in self._changes(band):
                first = left * (1.0 + PRECISION)
                last = right / (1.0 + PRECISION)
                if near := first >= last:
                    first = last = math.sqrt(left * right)
                parts.append(_part(band, one, begin, first, found, near))
                parts.append(replace(band, low=first, high=last))
                begin = last
                found = near
            *_, (_, kind) = [(0.0, band.kind), *self._seen(band)]
            parts.append(_part(band, kind, begin, band.high, found, True))
        return joined(parts)


def _grid(linear: Sequence[Band]) -> Iterator[float]:
    """Yield speeds in each range, evenly spaced in the logarithm, and speeds next to
    the limits of stability.
    """
    near = 1.0 + 2.0 * PRECISION
    for band in linear:
        count = max(math.ceil(math.log(band.high / band.low) / math.log(_APART)), 1)
        yield from np.geomspace(band.low, band.high, 2 * count + 1)[1::2].tolist()
    for band in linear:
        if band.kind != "unknown" and band.high > near * band.low:
            yield band.low * near
            yield band.high / near


def _part(
    band: Band, kind: str, low: float, high: float, low_found: bool, high_found: bool
) -> Band:
    """Return the part of a range of linear stability in which a motion was seen."""
    if kind == band.kind:
        return replace(band, low=low, high=high)
    bistable = band.kind == "stable" and kind in OSCILLATES
    return Band(
        kind=kind,
        bistable=bistable,
        low=low,
        high=high,
        low_found=low_found,
        high_found=high_found,
    )
