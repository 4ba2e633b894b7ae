"""What would stop it: the smallest changes that give smooth sliding, each judged by runs of the rig's own contacts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

from stickslip.advise.bands import PRECISION, Band, Change, by_theory, factor_of, is_dear, stability_along
from stickslip.advise.runs import Spent, Trials, trial
from stickslip.cycles.edges import halved
from stickslip.errors import InputError
from stickslip.model import OnArrest, parameters
from stickslip.model.parameters import Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.progress import Progress

if TYPE_CHECKING:
    from stickslip.advise.answer import Prediction

WIDEST_STD = 0.5
"""A distribution that is wider, relative to its mean, is no longer one of thresholds about a mean."""
_CLEARANCE = 1.03
"""How far past a linear boundary runs begin."""
_FOR_AN_ANSWER = 30.0
"""Seconds more, by estimate, that runs may take until a first change is found."""
_TURNABLE = (parameters.VELOCITY, parameters.STIFFNESS, parameters.DAMPING, parameters.MASS, parameters.LOAD)
"""What can be changed on a machine."""
_OTHERS = (parameters.FRICTION, parameters.CONTACT_STIFFNESS, parameters.DELAY, parameters.STD, parameters.AGEING)
"""What only another material or surface would change."""


@dataclass(frozen=True, kw_only=True)
class Mitigation:
    """A change of one parameter, or of two together, that gives smooth sliding; in the rig's own units.

    Attributes
    ----------
    parameters : tuple of str
    values : tuple of float
        Where they stand.
    stops : tuple of float
        Stick-slip decays even from a start at rest, anywhere within 5 % of this value: of as many contacts as the rig
        has, in 8 of 8 runs at its nearer end, so that (at 95 % confidence) it decays there in more than two of three.
    """

    parameters: tuple[str, ...]
    values: tuple[float, ...]
    stops: tuple[float, ...]

    @property
    def size(self) -> float:
        """How far the parameters must be varied, as the sum of the logarithms of their factors."""
        return sum(abs(math.log(target / value)) for target, value in zip(self.stops, self.values, strict=True))


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """A change that does not give smooth sliding, to the end of the range in the better direction, in the rig's units.

    There: peak-to-peak force from rest as a fraction of static friction; motion, undecided where one run was smooth.
    """

    parameter: str
    value: float
    reached: float
    amplitude: float
    kind: str


def mitigated(found: Prediction, trials: Trials, report: Progress) -> Prediction:
    """A verdict with changes of one parameter; of two, if none of those that can be turned on a machine suffices."""
    search = _Search(found, trials)
    trials.left += _FOR_AN_ANSWER
    turned = search.remedies(search.single(_TURNABLE))
    report(0.5)
    trials.left -= _FOR_AN_ANSWER if turned else 0.0
    tried = list(search.attempts({change.parameters[0] for change in turned}))
    report(0.6)
    if not turned:  # each by the same factor, in the directions that did best
        choices = [(parameter_named(each.parameter), 1 if each.reached > each.value else -1) for each in tried]
        turned = search.remedies([pair] for pair in combinations(choices, 2))
    others = search.remedies(search.single(_OTHERS))
    left_out = tuple(dict.fromkeys(search.left_out))
    return replace(found, mitigations=(*turned, *others), attempts=tuple(tried), not_searched=left_out)


def has(rig: Rig, parameter: Parameter) -> bool:
    """Whether a rig has a parameter that can be varied: natural units have none that only rescales them."""
    try:
        return parameter.get(rig) > 0 and not (parameter.rescales and rig.scales is None)
    except InputError:
        return False


def reach(rig: Rig, parameter: Parameter) -> tuple[float, float]:
    """Factors on a parameter between which limits and changes are looked for."""
    widest = 10.0 if is_dear(rig) else 30.0
    if parameter is parameters.STD:  # wider than that is no longer a distribution of thresholds about its mean
        return 1.0 / 3.0, max(WIDEST_STD * rig.interface.thresholds.moment(1) / parameter.get(rig), 1.0)
    return 1.0 / widest, 3.0 if parameter is parameters.DELAY else widest  # longer delays never help: many modes


class _Search:
    """The search for changes of one rig, by factors; it says what it left out as its trials were spent."""

    def __init__(self, found: Prediction, trials: Trials) -> None:
        self.found, self.rig, self.setting, self.trials = found, found.rig, trial(found.rig.natural), trials
        self.left_out: list[str] = []

    def single(self, choices: Iterable[Parameter]) -> Iterator[list[Change]]:
        """Each parameter that the rig has, both ways; no damping that would keep contacts from an arrest."""
        for parameter in choices:
            arrested = parameter is parameters.DAMPING and isinstance(self.rig.interface.delay, OnArrest)
            if has(self.rig, parameter) and not arrested:
                yield [((parameter, 1),), ((parameter, -1),)]

    def remedies(self, ways: Iterable[list[Change]]) -> list[Mitigation]:
        """The smallest change of each way, the smallest of all first; what costs too much is left out."""
        found: list[Mitigation] = []
        for changes in ways:
            stops: list[tuple[float, Change]] = []
            for change in changes:
                try:
                    stops += [(factor, change) for factor in self._stop(change)]
                except Spent:
                    self.left_out.append(" and ".join(parameter.title for parameter, _ in change))
            if stops:
                factor, change = min(stops, key=lambda stop: stop[0])
                names = tuple(parameter.name for parameter, _ in change)
                values, targets = self._at(change, 1.0), self._at(change, factor)
                found.append(Mitigation(parameters=names, values=values, stops=targets))
        return sorted(found, key=lambda each: round(each.size, 3))

    def attempts(self, stopping: set[str]) -> Iterator[Attempt]:
        """The better end of its range for each parameter to turn that gives no smooth sliding there."""
        friction = self.found.static_friction / self.rig.unit("f_s")
        for changes in self.single(_TURNABLE):
            ends: list[tuple[float, str, float]] = []
            ((parameter, _),) = changes[0]
            for change in changes if parameter.name not in stopping else ():
                furthest = self._furthest(change)
                try:
                    if furthest > 1.0:
                        seen = self.trials.judge(trial(factor_of(change).set(self.setting, furthest)))
                        # One run may be smooth where not all are.
                        kind = "undecided" if seen.kind == "smooth sliding" else str(seen.kind)
                        ends.append((seen.peak_to_peak / friction, kind, self._at(change, furthest)[0]))
                except (Spent, InputError):
                    self.left_out.append(parameter.title)
            if ends:
                amplitude, kind, reached = min(ends)
                value = self.rig.value(parameter)
                yield Attempt(parameter=parameter.name, value=value, reached=reached, amplitude=amplitude, kind=kind)

    def _furthest(self, change: Change) -> float:
        """Largest factor: that of the parameter that may be varied least."""
        furthest = math.inf
        for parameter, side in change:
            value, (low, high) = parameter.get(self.setting), reach(self.setting, parameter)
            feasible = self.rig.operation.range_of(parameter.name) or (low * value, high * value)
            low, high = max(low, feasible[0] / value), min(high, feasible[1] / value)
            furthest = min(furthest, high if side > 0 else 1.0 / low)
        return furthest

    def _ranges(self, change: Change) -> list[Band]:
        """Factors above 1 at which smooth sliding may be stable: where the theory does not deny it.

        Where it is stable already, a range that ends at a limit leads the wrong way.
        """
        furthest, stable = self._furthest(change), self.found.unstable_modes == 0
        bands = stability_along(self.setting, change, 1.0, furthest) if furthest > 1.0 else ()
        wrong = [band for band in bands[:1] if stable and band.high < furthest]
        return [band for band in bands if band.kind != "unstable" and band not in wrong]

    def _stop(self, change: Change) -> Iterator[float]:
        """The smallest factor from `PRECISION` below which on stick-slip decays from rest, within `PRECISION`, if any.

        Steps double from just past where smooth sliding may be stable up to the end of that.
        """

        def smooth(factor: float) -> bool:
            there = factor_of(change).set(self.setting, factor)
            return by_theory(there) != "unstable" and self.trials.slides_smoothly(there)

        for band in self._ranges(change):
            steps = [band.low * _CLEARANCE * (1.0 + PRECISION) ** (2**k - 1) for k in range(8)]
            places = [band.low, *(step for step in steps if step < band.high), band.high]
            around = next((pair for pair in pairwise(places) if smooth(pair[1])), None)
            if around is not None:
                width = 1.001 * math.log1p(PRECISION)  # to which doubled steps are halved, whatever the rounding
                factor = halved(smooth, *around, width)[1] * (1.0 + PRECISION)
                if factor <= band.high:
                    yield factor
                    return

    def _at(self, change: Change, factor: float) -> tuple[float, ...]:
        """What a factor makes of the parameters, in the rig's own units."""
        return tuple(self.rig.value(parameter) * factor**side for parameter, side in change)
