"""How long a run would take, said before it starts.

>>> import stickslip as ss
>>> from stickslip.simulation import estimate
>>> estimate(ss.example("pmma_slider")).seconds < 60
True
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

from stickslip.errors import InputError
from stickslip.model.rig import Rig
from stickslip.progress import in_time
from stickslip.simulation.cost import Part, course_of
from stickslip.simulation.engines.base import engine_of

LONGEST = 3600.0
"""Seconds that a run may take without being asked for."""
ANNOUNCED = 60.0
"""Seconds above which a run is announced."""
LARGEST = 4e9
"""Bytes that it may take."""
MOST_BLOCK_STEPS = 1e9
"""Steps of a block of an elastic slider that a run may take without telling how far it is."""


@dataclass(frozen=True, kw_only=True)
class Work:
    """What a run of a rig would take, by part."""

    rig: Rig
    parts: tuple[Part, ...]

    @property
    def seconds(self) -> float:
        """Time of one core."""
        return sum(part.seconds for part in self.parts)

    @property
    def bytes(self) -> float:
        """Memory."""
        return sum(part.bytes for part in self.parts)

    @property
    def block_steps(self) -> float:
        """Steps of blocks of an elastic slider."""
        return sum(part.block_steps for part in self.parts)

    def announce(self) -> None:
        """Log one line of what a run of more than a minute will take; unless told otherwise, on standard error."""
        if self.seconds > ANNOUNCED:
            worst = max(self.parts, key=lambda part: part.seconds)
            words = f"{self.rig.name}: about {in_time(self.seconds)} on one core: {worst.what}"
            logging.getLogger("stickslip").warning(words)

    def check(
        self,
        seconds: float = LONGEST,
        bytes: float = LARGEST,
        otherwise: str = "ask for it all the same: long=True (--long)",
        *,
        silent: bool = False,
    ) -> None:
        """Raise `InputError` if the work is more than this; the message names what to change, and `otherwise`.

        Runs that are `silent` about how far they are do not take more than 1e9 steps of blocks, either.
        """
        if silent and self.block_steps > MOST_BLOCK_STEPS:
            raise InputError(
                f"drive duration = {self._said_time()}: {self.block_steps:.2g} steps of blocks would take about "
                f"{in_time(self.seconds)} without a word; pass progress=..., or ask for it all the same: long=True"
            )
        if (excess := self.seconds / seconds) > 1:
            worst = max(self.parts, key=lambda part: part.seconds)
            amount, share = f"{worst.what} would take about {in_time(self.seconds)}", worst.seconds / seconds
        elif (excess := self.bytes / bytes) > 1:
            worst = max(self.parts, key=lambda part: part.bytes)
            amount, share = f"{worst.what} would take about {self.bytes / 1e9:.2g} GB", worst.bytes / bytes
        else:
            return
        allowed = worst.value * max(share, 1.0) ** (-1.0 / worst.power)
        bound = "at most" if worst.power > 0 else "at least"
        raise InputError(
            f"{worst.key} = {self._said(worst, worst.value)}: {amount}; {worst.instead}give {bound} "
            f"{self._said(worst, allowed)}, or a drive {excess:.2g} times shorter; or {otherwise}",
            worst.key,
        )

    def _said_time(self) -> str:
        return self.rig.in_units(self.rig.drive.duration, "time")

    def _said(self, part: Part, value: float) -> str:
        return f"{value:.4g}" if part.quantity is None else self.rig.in_units(value, part.quantity)


def estimate(rig: Rig) -> Work:
    """Return what a run of a rig would take; `InputError` if no solver takes it."""
    engine = engine_of(rig.interface, rig.method, rig.slider)
    return Work(rig=rig, parts=engine.cost(rig, rig.method, course_of(rig)))
