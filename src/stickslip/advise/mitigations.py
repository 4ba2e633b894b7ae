"""What would stop it: the smallest changes that give smooth sliding, each judged by runs of the rig's own contacts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

from stickslip.advise.bands import PRECISION, factor_of, is_dear, stability_along
from stickslip.advise.runs import Spent, Trials, trial
from stickslip.cycles.edges import halved
from stickslip.cycles.verdict import linearly_unstable
from stickslip.errors import InputError
from stickslip.model import OnArrest, parameters
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig
from stickslip.progress import Progress

if TYPE_CHECKING:
    from stickslip.advise.answer import Prediction

WIDEST_STD = 0.5  # a wider distribution, relative to its mean, is no longer one of thresholds about a mean
_CLEARANCE = 1.03  # how far past a linear boundary runs begin
# What can be changed on a machine; what only another material or surface would change.
_TURNABLE = (parameters.VELOCITY, parameters.STIFFNESS, parameters.DAMPING, parameters.MASS, parameters.LOAD)
_OTHERS = (parameters.FRICTION, parameters.CONTACT_STIFFNESS, parameters.DELAY, parameters.STD, parameters.AGEING)


@dataclass(frozen=True, kw_only=True)
class Mitigation:
    """A change of one parameter that gives smooth sliding; in the rig's own units.

    Attributes
    ----------
    parameter : str
    value : float
        Where it stands.
    stops : float
        Stick-slip decays even from a start at rest, anywhere within 5 % of this value: of as many contacts as the rig
        has, in 8 of 8 runs at its nearer end, so that (at 95 % confidence) it decays there in more than two of three.
    """

    parameter: str
    value: float
    stops: float

    @property
    def size(self) -> float:
        """How far the parameter must be varied: the logarithm of the factor."""
        return abs(math.log(self.stops / self.value))


def mitigated(found: Prediction, trials: Trials, report: Progress) -> Prediction:
    """A verdict with the smallest change of each parameter that stops it, and what was tried and left out."""
    rig, setting, choices = found.rig, trial(found.rig.natural), (*_TURNABLE, *_OTHERS)
    changes, tried, left_out = list[tuple[bool, Mitigation]](), dict[str, tuple[float, float]](), list[str]()
    for i, parameter in enumerate(choices):
        report(i / len(choices))
        # The damping of contacts that wait for an arrest stays: with enough of it, none would attach again.
        if not has(rig, parameter) or (parameter is parameters.DAMPING and isinstance(rig.interface.delay, OnArrest)):
            continue
        value, (low, high) = rig.value(parameter), _feasible(setting, parameter)
        stops: list[Mitigation] = []
        for side, furthest in ((1, high), (-1, 1.0 / low)):
            try:
                for factor in _stop(setting, parameter, side, furthest, trials):
                    stops.append(Mitigation(parameter=parameter.name, value=value, stops=value * factor**side))
            except Spent:
                left_out.append(parameter.title)
        if stops:
            changes.append((parameter in _OTHERS, min(stops, key=lambda each: each.size)))
        elif low < high and parameter.title not in left_out:
            tried[parameter.name] = low * value, high * value
    changes.sort(key=lambda each: (each[0], round(each[1].size, 3)))
    return replace(
        found,
        mitigations=tuple(change for _, change in changes),
        attempts=tried,
        not_searched=tuple(dict.fromkeys(left_out)),
    )


def has(rig: Rig, parameter: Parameter) -> bool:
    """Whether a rig has a parameter that can be varied: natural units have none that only rescales them."""
    try:
        return parameter.get(rig) > 0 and not (parameter.rescales and rig.scales is None)
    except InputError:
        return False


def reach(rig: Rig, parameter: Parameter) -> tuple[float, float]:
    """Factors on a parameter between which limits and changes are looked for."""
    widest = 10.0 if is_dear(rig) else 30.0
    if parameter is parameters.STD:
        return 1.0 / 3.0, max(WIDEST_STD * rig.interface.thresholds.moment(1) / parameter.get(rig), 1.0)
    return 1.0 / widest, 3.0 if parameter is parameters.DELAY else widest  # longer delays never help: many modes


def _feasible(rig: Rig, parameter: Parameter) -> tuple[float, float]:
    """These factors, as far as they could be built."""
    value, (low, high) = parameter.get(rig), reach(rig, parameter)
    least, most = rig.operation.range_of(parameter.name) or (low * value, high * value)
    return max(low, least / value), min(high, most / value)


def _stop(rig: Rig, parameter: Parameter, side: int, furthest: float, trials: Trials) -> Iterator[float]:
    """The smallest factor from `PRECISION` below which on stick-slip decays from rest, within `PRECISION`, if any.

    Steps double from just past where smooth sliding may be stable up to the end of that. Where it is stable already, a
    range that ends at a limit leads the wrong way.
    """
    factor = factor_of(parameter, side)

    def smooth(value: float) -> bool:
        there = factor.set(rig, value)
        return linearly_unstable(there) is not True and trials.slides_smoothly(there)

    for band in stability_along(rig, parameter, 1.0, furthest, side) if furthest > 1.0 else ():
        if band.kind == "unstable" or (band.kind == "stable" and band.low == 1.0 and band.high < furthest):
            continue
        steps = [band.low * _CLEARANCE * (1.0 + PRECISION) ** (2**k - 1) for k in range(8)]
        places = [band.low, *(step for step in steps if step < band.high), band.high]
        for rough, step in pairwise(places):
            if smooth(step):
                width = 1.001 * math.log1p(PRECISION)  # to which doubled steps are halved, whatever the rounding
                value = halved(smooth, rough, step, width)[1] * (1.0 + PRECISION)
                if value <= band.high or band.high == furthest:  # nothing is known beyond the end of the search
                    yield min(value, band.high)
                    return
                break
