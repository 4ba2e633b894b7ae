"""How much a verdict depends on fitted and assumed values: the motion of rigs with all
of these varied, and which value matters most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from typing import Self

import numpy as np

from stickslip.advise.budget import OSCILLATES, Budget, BudgetExhausted, trial
from stickslip.advise.mitigations import has, highest
from stickslip.answers import Answer
from stickslip.arrays import Array
from stickslip.cycles.oscillation_verdict import linearly_unstable
from stickslip.errors import InputError
from stickslip.model import Contacts, parameters
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig
from stickslip.sliding.curve import delay_of
from stickslip.sliding.rigid_motion import slow_friction, thresholds_of
from stickslip.words import number, percent

# An assumption for which the file gives no range is varied by up to this factor, up and
# down; a convention.
WIDEST = 3.0
_DRAWS = 64  # the standard error of a fraction is then at most .06
_CONTACTS = Parameter(
    name="contacts",
    unit="1",
    get=lambda rig: float(getattr(rig.method, "count", 0)),
    set=lambda rig, count: replace(
        rig, method=Contacts(max(round(count), 1), seed=getattr(rig.method, "seed", 1))
    ),
)


def _friction(which: int) -> Parameter:
    """Return the parameter of static (0) or kinetic (1) friction in slow motion, which
    keeps the other one; thresholds follow as they do in a rig file.
    """

    def both(rig: Rig) -> list[float]:
        return [*slow_friction(rig.interface.thresholds, rig.interface.initial)]

    def set_(rig: Rig, new: float) -> Rig:
        wanted = [force if at != which else new for at, force in enumerate(both(rig))]
        thresholds, strength = thresholds_of(*wanted, rig.interface.initial)
        there = replace(rig, interface=replace(rig.interface, thresholds=thresholds))
        return parameters.LOAD.set(there, strength * parameters.LOAD.get(there))

    return Parameter(
        name="friction",
        unit="f_s",
        rescales=True,
        get=lambda rig: both(rig)[which],
        set=set_,
    )


# Keys of a rig file whose values may be assumed: the parameter that varies each, and 1
# or -1 if the parameter rises or falls with the value.
_VARIED = {
    "slider.mass": (parameters.MASS, 1),
    "slider.stiffness": (parameters.STIFFNESS, 1),
    "slider.damping": (parameters.DAMPING, 1),
    "slider.damping_ratio": (parameters.DAMPING, 1),
    "interface.contact_strength": (parameters.LOAD, 1),
    "interface.normal_load": (parameters.LOAD, 1),
    "interface.mu_s": (_friction(0), 1),
    "interface.mu_k": (_friction(1), 1),
    "interface.breaking_displacement": (parameters.CONTACT_STIFFNESS, -1),
    "interface.contact_stiffness": (parameters.CONTACT_STIFFNESS, 1),
    "interface.thresholds": (parameters.STD, 1),
    "interface.thresholds.std": (parameters.STD, 1),
    "interface.delay": (parameters.DELAY, 1),
    "interface.v_half": (parameters.DELAY, -1),
    "interface.ageing.time": (parameters.AGEING, 1),
    "simulation.contacts": (_CONTACTS, 1),
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Doubt(Answer):
    """The motion of a rig at its own speed, for the values that its fit and its
    assumptions allow.
    """

    #: Fraction of the drawn rigs that do not slide smoothly, by linear theory or in a
    #: run from rest, among those for which either decides.
    oscillates: float
    undecided: float  #: fraction of the drawn rigs for which neither decides
    draws: int  #: number of rigs drawn

    #: Keys of the rig's file that were fitted or varied, each with the fraction that
    #: oscillates of the half of the rigs with the larger values, and of the other half;
    #: NaN if none of a half is decided. They are sorted by the difference of the two in
    #: standard errors: the first matters most.
    matters: tuple[tuple[str, float, float], ...]
    decides: bool = False  #: whether the first differs by over two standard errors
    assumed: tuple[str, ...] = ()  #: keys that were assumed
    ranges: bool = False  #: whether the file gives ranges for some of these
    left: tuple[str, ...] = ()  #: assumed keys of the file that cannot be varied
    #: whether the budget was exhausted before all rigs were decided
    ended: bool = False
    #: sentence on contacts with a delay that fit the measured friction as well
    delay: str = ""

    @classmethod
    def of(cls, rig: Rig, budget: Budget) -> Self | None:
        """Return the motion of rigs with the draws of the fit and with varied
        assumptions; None if a rig has neither.

        Assumptions are varied all at once, uniformly in the logarithm, within the range
        that the file gives, or within a factor `WIDEST`.
        """
        fitted = {key: one.draws for key, one in rig.fitted.items() if one.draws}
        assumed = [
            key
            for key in rig.assumed
            if key in _VARIED and key not in fitted and has(rig, _VARIED[key][0])
        ]
        keys = [*fitted, *assumed]
        delay = _with_delay(rig, budget)
        if not keys and not delay:
            return None
        if not keys:
            return cls(
                oscillates=math.nan, undecided=0.0, draws=0, matters=(), delay=delay
            )
        count = min([_DRAWS, *map(len, fitted.values())])
        rigs = [rig] * count
        if fitted:
            # takes some .1 s to import, which other rigs do not need
            from stickslip.fitting import rigs_drawn

            rigs = [*islice(rigs_drawn(rig), count)]
        factors = _factors(rig, assumed, count)
        oscillates = np.full(count, np.nan)
        ended = False
        for i, drawn in enumerate(rigs):
            # a rig with the varied values may not exist
            with suppress(InputError):
                try:
                    there = _varied(drawn.natural, assumed, factors[:, i])
                    oscillates[i] = _oscillates(there, budget)
                except BudgetExhausted:
                    ended = True
        known = np.isfinite(oscillates)
        draws = [values[:count] for values in fitted.values()]
        matters, decides = _compared(keys, np.array([*draws, *factors]), oscillates)
        own = [key for key, item in rig.assumed.items() if not item.default]
        return cls(
            oscillates=float(oscillates[known].mean()) if known.any() else math.nan,
            undecided=float(1.0 - known.mean()),
            draws=count,
            matters=matters,
            decides=decides,
            assumed=tuple(assumed),
            ranges=any(rig.assumed[key].factors for key in assumed),
            left=tuple(key for key in own if key not in keys),
            ended=ended,
            delay=delay,
        )

    def __str__(self) -> str:
        return "\n".join(self.sentences())

    def short(self) -> Iterator[str]:
        """Yield sentences on how many of the drawn rigs oscillate, and what to measure
        first.
        """
        if self.delay:
            yield self.delay
        if not self.draws:
            return
        among = f"{self.draws} draws of the fit"
        if len(self.matters) == len(self.assumed):
            ranges = " (or the range of the file)" if self.ranges else ""
            within = f"a factor {number(WIDEST)}{ranges} of what was assumed"
            among = f"{self.draws} rigs within {within}"
        known = round(self.draws * (1.0 - self.undecided))
        count = round(self.oscillates * known) if known else 0
        if known == self.draws:
            yield f"{count} of {among} oscillate."
        else:
            decided = (
                f"{known} were decided: {'all' if count == known else count} oscillate"
            )
            more = " (--thorough decides more)" if self.ended else ""
            yield f"Of {among} {decided if known else 'none could be decided'}{more}."
        if self.decides:
            key, *parts = self.matters[0]
            larger, smaller = map(percent, parts)
            name = key.rpartition(".")[2]
            yield f"Measure {name}: smaller, {smaller} oscillate; larger, {larger}."

    def sentences(self) -> Iterator[str]:
        """Yield the sentences of `short`, and those on what was varied."""
        yield from self.short()
        if self.assumed:
            keys = ", ".join(key for key, *_ in self.matters if key in self.assumed)
            yield f"Varied together, the most important first: {keys}"
        if self.left:
            yield f"Not varied, as they are not numbers: {', '.join(self.left)}"


def _with_delay(rig: Rig, budget: Budget) -> str:
    """Return a sentence on the motion of the rig with contacts that grow, and with
    contacts with a delay that give the measured friction curve, too; empty if no delay
    fits it.
    """
    measured = rig.operation.friction
    thresholds = rig.interface.thresholds
    if measured is None or thresholds is None or rig.interface.ageing is None:
        return ""
    delayed, strength = delay_of(measured, thresholds)
    if delayed is None:
        return ""
    delay = delayed.delay
    there = replace(
        rig.natural,
        interface=replace(
            rig.interface, ageing=None, delay=delay, sliding_force=delayed.sliding_force
        ),
    )
    there = parameters.LOAD.set(there, strength * parameters.LOAD.get(there))
    words = []
    for each in (rig.natural, there):
        try:
            oscillates = _oscillates(each, budget)
        except (BudgetExhausted, InputError):
            oscillates = math.nan
        words.append(_DOES.get(oscillates, "stays undecided"))
    grown, late = words
    alike = ", too" if grown == late else ""
    return (
        f"A delay of {rig.in_units(delay.moment(1), 'time')} gives the measured "
        f"friction as well as growth: the rig {grown} with growth, and {late} with the "
        f"delay{alike}; a hold decides (growth: the longer, the higher the peak), or a "
        "velocity step."
    )


_DOES = {1.0: "oscillates", 0.0: "slides smoothly"}


def _factors(rig: Rig, keys: Sequence[str], count: int) -> Array:
    """Return factors on the assumed values, of shape (keys, count), from a fixed seed.

    They are a Latin hypercube: each of `count` parts of the range of a key is drawn
    once.
    """
    order = np.tile(np.arange(count), (len(keys), 1))
    places = (np.random.default_rng(0).permuted(order, axis=1) + 0.5) / count
    ranges = [rig.assumed[key].factors or (1.0 / WIDEST, WIDEST) for key in keys]
    low, high = np.log(ranges).reshape(-1, 2, 1).swapaxes(0, 1)
    return np.asarray(np.exp(low + (high - low) * places))


def _varied(rig: Rig, keys: Sequence[str], factors: Array) -> Rig:
    """Return the rig with each assumed value multiplied by its factor."""
    for key, factor in zip(keys, factors.tolist(), strict=True):
        parameter, side = _VARIED[key]
        raised = min(factor**side, highest(rig, parameter))
        rig = parameter.set(rig, raised * parameter.get(rig))
    return rig


def _oscillates(rig: Rig, budget: Budget) -> float:
    """Return whether a rig oscillates, as 0 or 1, or NaN if that is undecided.

    Linear theory comes first. If smooth sliding is stable, or the theory does not
    apply, a run from rest decides, as stick-slip may persist from there.
    """
    if budget.theory(linearly_unstable, rig):
        return 1.0
    kind = budget.regime(trial(rig)).kind
    return math.nan if kind == "undecided" else float(kind in OSCILLATES)


def _compared(
    keys: Sequence[str], values: Array, oscillates: Array
) -> tuple[tuple[tuple[str, float, float], ...], bool]:
    """Return each key with the fractions that oscillate in the half with its larger
    values and in the other, and whether they differ significantly.

    The keys are sorted by the difference in standard errors; it is significant if the
    largest exceeds two.
    """
    known = np.isfinite(oscillates)
    upper = values > np.median(values, axis=1, keepdims=True)
    halves = np.stack([upper, ~upper]) & known
    # the fraction is NaN where no rig of a half is decided
    with np.errstate(divide="ignore", invalid="ignore"):
        larger, smaller = halves @ np.nan_to_num(oscillates) / halves.sum(axis=2)
        # standard errors of the differences, at their largest
        errors = np.sqrt((0.25 / halves.sum(axis=2)).sum(axis=0))
        apart = np.nan_to_num(abs(larger - smaller) / errors)
    order = np.argsort(-apart, kind="stable")
    matters = tuple((keys[i], float(larger[i]), float(smaller[i])) for i in order)
    return matters, bool(apart.max() > 2.0)
