"""How much a verdict owes to what was fitted or assumed: the rig with all of it varied, and what matters most."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
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

WIDEST = 3.0  # factor either way, by convention, within which an assumption is varied that the file gives no range of
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
    """What a rig does at its own speed over the rigs that its fit and its assumptions allow."""

    oscillates: float  #: fraction of these that do not slide smoothly: by linear theory, or in a run from rest
    undecided: float  #: fraction of which neither tells
    draws: int

    #: Keys of the rig's file that were fitted or varied, each with how much more often the rig oscillates where the
    #: value is larger: the difference between the upper and the lower half. The first matters most.
    matters: tuple[tuple[str, float], ...]
    assumed: tuple[str, ...] = ()  #: those that were assumed

    @classmethod
    def of(cls, rig: Rig, trials: Trials) -> Self | None:
        """Take what was fitted at its draws, and vary what a rig's file calls assumed; None if there is neither.

        Assumptions are varied all at once, evenly in the logarithm, within the range that the file gives, or a factor
        `WIDEST`. Linear theory tells first, and runs where smooth sliding is stable or there is none: stick-slip may
        persist from a start at rest.
        """
        fitted = {key: one.draws for key, one in rig.fitted.items() if one.draws}
        varied = {k: _VARIED[k] for k in rig.assumed if k in _VARIED and k not in fitted and has(rig, _VARIED[k][0])}
        if not (fitted or varied):
            return None
        count = min([_DRAWS, *map(len, fitted.values())])
        rigs = [rig] * count
        if fitted:
            from stickslip.fitting import rigs_drawn  # some .1 s that no other rig needs

            rigs = [*islice(rigs_drawn(rig), count)]
        # A Latin hypercube, the same each time: of each parameter every 64th of its range once.
        ranks = np.random.default_rng(0).permuted(np.tile(np.arange(count), (len(varied), 1)), axis=1)
        ends = (np.log(rig.assumed[key].factors or (1.0 / WIDEST, WIDEST)) for key in varied)
        factors = [np.exp(low + (high - low) * (at + 0.5) / count) for (low, high), at in zip(ends, ranks, strict=True)]
        found = np.full(count, np.nan)
        for i, drawn in enumerate(rigs):
            there = drawn.natural
            with suppress(InputError, Spent):
                for (parameter, side), factor in zip(varied.values(), factors, strict=True):
                    raised = min(float(factor[i]) ** side, highest(there, parameter))
                    there = parameter.set(there, raised * parameter.get(there))
                grows = bool(trials.theory(linearly_unstable, there))
                kind = "" if grows else trials.judge(trial(there)).kind
                found[i] = math.nan if kind == "undecided" else grows or kind in OSCILLATES
        told = np.isfinite(found)
        values = np.array([*(draws[:count] for draws in fitted.values()), *factors])
        upper = values > np.median(values, axis=1, keepdims=True)
        halves = {key: (told & half, told & ~half) for key, half in zip([*fitted, *varied], upper, strict=True)}
        if not all(half.any() for each in halves.values() for half in each):
            return None
        more = {key: float(found[one].mean() - found[other].mean()) for key, (one, other) in halves.items()}
        return cls(
            oscillates=float(np.nansum(found) / count),
            undecided=float(1.0 - told.mean()),
            draws=count,
            matters=tuple(sorted(more.items(), key=lambda each: -abs(each[1]))),
            assumed=tuple(varied),
        )

    def __str__(self) -> str:
        return "\n".join(self.said())

    def said(self) -> Iterator[str]:
        """What it comes to, in sentences."""
        part, untold = f"{100 * self.oscillates:.0f} %", f"{100 * self.undecided:.0f} % not told"
        fitted = len(self.matters) > len(self.assumed)
        of = f"the {self.draws} draws of the fit" if fitted else "what was not measured"
        yield f"oscillates at this speed in {part} of {of}{f', {untold}' if self.undecided else ''}"
        key, difference = self.matters[0]
        if abs(difference) > 2.0 / math.sqrt(self.draws):  # two standard errors of a difference of halves
            sign = "larger" if difference > 0 else "smaller"
            yield f"measuring {key} would decide most: {100 * abs(difference):.0f} % more often where it is {sign}"
        if self.assumed:
            keys = ", ".join(key for key, _ in self.matters if key in self.assumed)
            yield f"{self.draws} rigs, each of {keys} within the range of the file, or a factor {WIDEST:g} of its value"
