"""How much a verdict owes to what was assumed: the rig with every assumption varied, and which of them matters most."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from stickslip.advise.mitigations import has, highest
from stickslip.advise.runs import OSCILLATES, Spent, Trials, trial
from stickslip.answers import Answer
from stickslip.cycles.verdict import linearly_unstable
from stickslip.errors import InputError
from stickslip.model import Contacts, parameters
from stickslip.model.parameters import Parameter
from stickslip.model.rig import Rig

WIDEST = 3.0
"""Factor either way, by convention, within which an assumption is varied of which the file gives no range."""
_DRAWS = 64  # then the error of a fraction is at most .06
_CONTACTS = Parameter(
    name="contacts",
    unit="1",
    get=lambda rig: float(getattr(rig.method, "count", 0)),
    set=lambda rig, count: replace(rig, method=Contacts(max(round(count), 1), seed=getattr(rig.method, "seed", 1))),
)
# What of a rig its file may call assumed, by the key: the parameter that varies it, and whether that rises with it.
_VARIED = {
    "slider.mass": (parameters.MASS, 1),
    "slider.stiffness": (parameters.STIFFNESS, 1),
    "slider.damping": (parameters.DAMPING, 1),
    "slider.damping_ratio": (parameters.DAMPING, 1),
    "interface.contact_strength": (parameters.LOAD, 1),
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
    """What a rig does at its own speed over the rigs that its assumptions allow."""

    oscillates: float  #: fraction of these that do not slide smoothly: by linear theory, or in a run from rest
    undecided: float  #: fraction of which neither tells
    draws: int

    #: Keys of the rig's file that were varied, each with how much more often the rig oscillates at one end of the
    #: range than at the other: the difference between the upper and the lower half. The first matters most.
    matters: tuple[tuple[str, float], ...]

    @classmethod
    def of(cls, rig: Rig, trials: Trials) -> Self | None:
        """Vary what a rig's file calls assumed, all at once, evenly in the logarithm; None if there is nothing to vary.

        Within the range that the file gives, or a factor `WIDEST`.

        Linear theory tells first, and runs where smooth sliding is stable: stick-slip may persist from a start at rest.
        """
        varied = {key: _VARIED[key] for key in rig.assumed if key in _VARIED and has(rig, _VARIED[key][0])}
        if not varied:
            return None
        low, high = np.log([rig.assumed[key].factors or (1.0 / WIDEST, WIDEST) for key in varied]).T
        # A Latin hypercube, the same each time: of each parameter every 64th of its range once.
        ranks = np.random.default_rng(0).permuted(np.tile(np.arange(_DRAWS), (len(varied), 1)), axis=1)
        places = (ranks.T + 0.5) / _DRAWS
        found = np.full(_DRAWS, np.nan)
        for i, place in enumerate(places):
            there = rig.natural
            with suppress(InputError, Spent):
                for (parameter, side), factor in zip(varied.values(), np.exp(low + (high - low) * place), strict=True):
                    raised = min(float(factor) ** side, highest(there, parameter))
                    there = parameter.set(there, raised * parameter.get(there))
                found[i] = _oscillates(there, trials)
        told = np.isfinite(found)
        halves = [found[told & (at > 0.5)] for at in places.T], [found[told & (at <= 0.5)] for at in places.T]
        if not all(half.size for half in (*halves[0], *halves[1])):
            return None
        more = [float(upper.mean() - lower.mean()) for upper, lower in zip(*halves, strict=True)]
        matters = sorted(zip(varied, more, strict=True), key=lambda each: -abs(each[1]))
        return cls(
            oscillates=float(np.nansum(found) / _DRAWS),
            undecided=float(1.0 - told.mean()),
            draws=_DRAWS,
            matters=tuple(matters),
        )

    def __str__(self) -> str:
        return "\n".join(self.said())

    def said(self) -> Iterator[str]:
        """What it comes to, in sentences."""
        part, untold = f"{100 * self.oscillates:.0f} %", f"{100 * self.undecided:.0f} % not told"
        yield f"oscillates at this speed in {part} of what was not measured{f', {untold}' if self.undecided else ''}"
        key, difference = self.matters[0]
        if abs(difference) > 2.0 / math.sqrt(self.draws):  # two standard errors of a difference of halves
            sign = "larger" if difference > 0 else "smaller"
            yield f"measuring {key} would decide most: {100 * abs(difference):.0f} % more often where it is {sign}"
        keys = ", ".join(key for key, _ in self.matters)
        yield f"{self.draws} rigs, each of {keys} within the range of the file, or a factor {WIDEST:g} of its value"


def _oscillates(rig: Rig, trials: Trials) -> float:
    """1 for a rig that does not slide smoothly, 0 for one that does; NaN if it is not told."""
    if trials.told(linearly_unstable, rig):
        return 1.0
    kind = trials.judge(trial(rig)).kind
    return math.nan if kind == "undecided" else float(kind in OSCILLATES)
