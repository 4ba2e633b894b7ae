"""How much a verdict owes to what was fitted or assumed: the rig with all of it
varied, and what matters most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Self

import numpy as np

from stickslip.advise.budget import OSCILLATES, Budget, BudgetExhausted, trial
from stickslip.advise.mitigations import has, highest
from stickslip.answers import Answer
from stickslip.cycles.verdict import linearly_unstable
from stickslip.errors import InputError
from stickslip.model import Contacts, parameters
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig
from stickslip.sliding.rigid_motion import slow_friction, thresholds_of

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
    **{
        f"slider.{each.name}": (each, 1)
        for each in (parameters.MASS, parameters.STIFFNESS, parameters.DAMPING)
    },
    "slider.damping_ratio": (parameters.DAMPING, 1),
    **dict.fromkeys(
        ("interface.contact_strength", "interface.normal_load"), (parameters.LOAD, 1)
    ),
    "interface.mu_s": (_friction(0), 1),
    "interface.mu_k": (_friction(1), 1),
    "interface.breaking_displacement": (parameters.CONTACT_STIFFNESS, -1),
    "interface.contact_stiffness": (parameters.CONTACT_STIFFNESS, 1),
    **dict.fromkeys(
        ("interface.thresholds", "interface.thresholds.std"), (parameters.STD, 1)
    ),
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
    #: those of which either tells.
    oscillates: float
    undecided: float  #: fraction of all of which neither tells
    draws: int

    #: Keys of the rig's file that were fitted or varied, each with the fractions that
    #: oscillate of the half where the value is larger, and of the other; not a number
    #: if none of a half is told. The first matters most: there these differ by most
    #: standard errors.
    matters: tuple[tuple[str, float, float], ...]
    decides: bool = False  #: whether the first does: by more than two standard errors
    assumed: tuple[str, ...] = ()  #: those that were assumed
    left: tuple[str, ...] = ()  #: those of the file that cannot be varied by a number
    #: whether the runs that are allowed were spent before all was told
    ended: bool = False

    @classmethod
    def of(cls, rig: Rig, budget: Budget) -> Self | None:
        """Take what was fitted at its draws, and vary what a rig's file calls assumed;
        None if there is neither.

        Assumptions are varied all at once, evenly in the logarithm, within the range
        that the file gives, or a factor `WIDEST`. Linear theory tells first, and runs
        where smooth sliding is stable or there is none: stick-slip may persist from a
        start at rest.
        """
        fitted = {key: one.draws for key, one in rig.fitted.items() if one.draws}
        varied = {
            k: _VARIED[k]
            for k in rig.assumed
            if k in _VARIED and k not in fitted and has(rig, _VARIED[k][0])
        }
        if not (fitted or varied):
            return None
        count = min([_DRAWS, *map(len, fitted.values())])
        rigs = [rig] * count
        if fitted:
            # some .1 s that no other rig needs
            from stickslip.fitting import rigs_drawn

            rigs = [*islice(rigs_drawn(rig), count)]
        # A Latin hypercube, the same each time: of each parameter every 64th of its
        # range once.
        ranks = np.random.default_rng(0).permuted(
            np.tile(np.arange(count), (len(varied), 1)), axis=1
        )
        ends = (
            np.log(rig.assumed[key].factors or (1.0 / WIDEST, WIDEST)) for key in varied
        )
        factors = [
            np.exp(low + (high - low) * (at + 0.5) / count)
            for (low, high), at in zip(ends, ranks, strict=True)
        ]
        found = np.full(count, np.nan)
        ended = False
        for i, drawn in enumerate(rigs):
            there = drawn.natural
            try:
                for (parameter, side), factor in zip(
                    varied.values(), factors, strict=True
                ):
                    raised = min(float(factor[i]) ** side, highest(there, parameter))
                    there = parameter.set(there, raised * parameter.get(there))
                grows = bool(budget.theory(linearly_unstable, there))
                kind = "" if grows else budget.regime(trial(there)).kind
                found[i] = (
                    math.nan if kind == "undecided" else grows or kind in OSCILLATES
                )
            except (InputError, BudgetExhausted) as why:
                ended |= isinstance(why, BudgetExhausted)
        told = np.isfinite(found)
        values = np.array([*(draws[:count] for draws in fitted.values()), *factors])
        upper = values > np.median(values, axis=1, keepdims=True)
        halves = np.stack([upper, ~upper]) & told
        keys = [*fitted, *varied]
        # where nothing is told, it is not a number
        with np.errstate(divide="ignore", invalid="ignore"):
            part = np.nansum(found) / told.sum()
            parts = halves @ np.nan_to_num(found) / halves.sum(axis=2)
            # the largest that the differences can have
            errors = np.sqrt((0.25 / halves.sum(axis=2)).sum(axis=0))
            apart = np.nan_to_num(abs(parts[0] - parts[1]) / errors)
        return cls(
            oscillates=float(part),
            undecided=float(1.0 - told.mean()),
            draws=count,
            matters=tuple(
                (keys[i], float(parts[0, i]), float(parts[1, i]))
                for i in np.argsort(-apart, kind="stable")
            ),
            decides=bool(apart.max() > 2.0),
            assumed=tuple(varied),
            left=tuple(
                k
                for k, one in rig.assumed.items()
                if not one.default and k not in fitted and k not in varied
            ),
            ended=ended,
        )

    def __str__(self) -> str:
        return "\n".join(self.sentences())

    def sentences(self) -> Iterator[str]:
        """The fraction that oscillates, what matters most, and what was varied."""
        told = 1.0 - self.undecided
        part = f"{100 * self.oscillates:.0f} %"
        of = (
            f"the {self.draws} draws of the fit"
            if len(self.matters) > len(self.assumed)
            else "what was not measured"
        )
        if self.undecided:
            least = self.oscillates * told if told else 0.0
            of += (
                f": in {part} of the {100 * told:.0f} % that could be told"
                if told
                else ": none could be told"
            )
            of += " with the runs that are allowed; see --thorough" * self.ended
            part = f"{100 * least:.0f} to {100 * (least + self.undecided):.0f} %"
        yield f"oscillates at this speed in {part} of {of}"
        if self.decides:
            key, *parts = self.matters[0]
            sides = sorted(zip(parts, ("larger", "smaller"), strict=True), reverse=True)
            where = ", ".join(
                f"in {100 * part:.0f} % where it is {side}" for part, side in sides
            )
            yield f"measuring {key} would decide most: oscillates {where}"
        if self.assumed:
            keys = ", ".join(key for key, *_ in self.matters if key in self.assumed)
            yield (
                f"{self.draws} rigs, each of {keys} within the range of the file, or "
                f"a factor {WIDEST:g} of its value"
            )
        if self.left:
            yield (
                "left as the file has it, as no parameter of the rig varies it: "
                f"{', '.join(self.left)}"
            )
