"""How much a verdict owes to what was fitted or assumed: the rig with all of it
varied, and what matters most.
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

# factor either way, by convention, within which an assumption is varied that the file
# gives no range of
WIDEST = 3.0
_DRAWS = 64  # then the error of a fraction is at most .06
_CONTACTS = Parameter(
    name="contacts",
    unit="1",
    get=lambda rig: float(getattr(rig.method, "count", 0)),
    set=lambda rig, count: replace(
        rig, method=Contacts(max(round(count), 1), seed=getattr(rig.method, "seed", 1))
    ),
)


def _friction(which: int) -> Parameter:
    """Static or kinetic friction in slow motion, the other one kept: thresholds
    follow as they do in a rig file.
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


# What of a rig its file may call assumed, by the key: the parameter that varies it, and
# whether that rises with it.
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
    """What a rig does at its own speed over the rigs that its fit and its
    assumptions allow.
    """

    #: Fraction that does not slide smoothly, by linear theory or in a run from rest, of
    #: those that either decides.
    oscillates: float
    undecided: float  #: fraction of all that neither decides
    draws: int

    #: Keys of the rig's file that were fitted or varied, each with the fractions that
    #: oscillate of the half where the value is larger, and of the other; not a number
    #: if none of a half is decided. The first matters most: there these differ by most
    #: standard errors.
    matters: tuple[tuple[str, float, float], ...]
    decides: bool = False  #: whether the first does: by more than two standard errors
    assumed: tuple[str, ...] = ()  #: those that were assumed
    ranges: bool = False  #: whether the file gives ranges of some of these
    left: tuple[str, ...] = ()  #: those of the file that cannot be varied by a number
    #: whether the runs that are allowed were spent before all was decided
    ended: bool = False
    #: what contacts with a delay do where they fit the measured friction as well
    delay: str = ""

    @classmethod
    def of(cls, rig: Rig, budget: Budget) -> Self | None:
        """Take what was fitted at its draws, and vary what a rig's file calls assumed;
        None if there is neither.

        Assumptions are varied all at once, evenly in the logarithm, within the range
        that the file gives, or a factor `WIDEST`.
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
            # some .1 s that no other rig needs
            from stickslip.fitting import rigs_drawn

            rigs = [*islice(rigs_drawn(rig), count)]
        factors = _factors(rig, assumed, count)
        oscillates = np.full(count, np.nan)
        ended = False
        for i, drawn in enumerate(rigs):
            # there may be no such rig
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
        """How many of the rigs that were drawn oscillate, and what to measure first."""
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
        """The same, and what was varied."""
        yield from self.short()
        if self.assumed:
            keys = ", ".join(key for key, *_ in self.matters if key in self.assumed)
            yield f"Varied together, what matters most first: {keys}"
        if self.left:
            yield f"Not varied, as no number of the rig does: {', '.join(self.left)}"


def _with_delay(rig: Rig, budget: Budget) -> str:
    """What the rig does with growing contacts, and with delayed ones of which the
    measured friction curve is, too; nothing where no delay fits it.
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
    """Factors on what was assumed, (keys, count), the same each time.

    A Latin hypercube: of each key, every part of its range once.
    """
    order = np.tile(np.arange(count), (len(keys), 1))
    places = (np.random.default_rng(0).permuted(order, axis=1) + 0.5) / count
    ranges = [rig.assumed[key].factors or (1.0 / WIDEST, WIDEST) for key in keys]
    low, high = np.log(ranges).reshape(-1, 2, 1).swapaxes(0, 1)
    return np.asarray(np.exp(low + (high - low) * places))


def _varied(rig: Rig, keys: Sequence[str], factors: Array) -> Rig:
    """The rig with each assumption changed by its factor."""
    for key, factor in zip(keys, factors.tolist(), strict=True):
        parameter, side = _VARIED[key]
        raised = min(factor**side, highest(rig, parameter))
        rig = parameter.set(rig, raised * parameter.get(rig))
    return rig


def _oscillates(rig: Rig, budget: Budget) -> float:
    """Whether a rig oscillates, 0 or 1, or NaN if that stays undecided.

    Linear theory comes first, and a run where smooth sliding is stable or there is
    none: stick-slip may persist from a start at rest.
    """
    if budget.theory(linearly_unstable, rig):
        return 1.0
    kind = budget.regime(trial(rig)).kind
    return math.nan if kind == "undecided" else float(kind in OSCILLATES)


def _compared(
    keys: Sequence[str], values: Array, oscillates: Array
) -> tuple[tuple[tuple[str, float, float], ...], bool]:
    """Fractions that oscillate where each value is larger, and where it is smaller,
    those first that differ by most standard errors; and whether the first differ by
    more than two.
    """
    known = np.isfinite(oscillates)
    upper = values > np.median(values, axis=1, keepdims=True)
    halves = np.stack([upper, ~upper]) & known
    # where nothing is known of a half, its fraction is not a number
    with np.errstate(divide="ignore", invalid="ignore"):
        larger, smaller = halves @ np.nan_to_num(oscillates) / halves.sum(axis=2)
        # the largest that the differences can have
        errors = np.sqrt((0.25 / halves.sum(axis=2)).sum(axis=0))
        apart = np.nan_to_num(abs(larger - smaller) / errors)
    order = np.argsort(-apart, kind="stable")
    matters = tuple((keys[i], float(larger[i]), float(smaller[i])) for i in order)
    return matters, bool(apart.max() > 2.0)
