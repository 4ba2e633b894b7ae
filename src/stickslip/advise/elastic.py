"""Which wavelength of an elastic slider slips first, and at which speeds: the answer of linear theory, mode by mode."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from stickslip.advise import say
from stickslip.advise.bands import CANNOT_GROW, Band, fastest_mode, joined, stability_along
from stickslip.advise.speeds import range_of_speeds
from stickslip.answers import Answer, plain
from stickslip.errors import UndecidedError
from stickslip.model import Chain, ElasticBody
from stickslip.model.drive import constant
from stickslip.model.parameters import VELOCITY
from stickslip.model.rig import Rig
from stickslip.progress import Progress
from stickslip.sliding import respond
from stickslip.stability import count_unstable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip.elastic.modes import CriticalLength

_MODES = 5
"""Modes that are told of, of different stiffness, the softest first."""
_MOST = 64
"""Modes among which those that grow are counted."""


@dataclass(frozen=True, kw_only=True)
class WaveAnswer:
    """What smooth sliding does to waves of one length; in the rig's own units.

    Attributes
    ----------
    name : str
        The wave, in words.
    wavelength : float
        In blocks, along the drive; infinite where blocks in a row move alike, NaN where a wave does not reach into it.
    stiffness : float
        Of the rigid slider that the mode amounts to.
    growth, frequency : float or None
        Growth rate and frequency (in cycles per time) at the rig's speed; None where nothing decays exponentially.
    speeds : tuple of (float, float)
        Ranges of speed in which it grows.
    """

    name: str
    wavelength: float
    stiffness: float
    growth: float | None
    frequency: float | None
    speeds: tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True, repr=False)
class ElasticPrediction(Answer):
    """What `predict` found of an elastic slider, by linear theory; every number in the rig's own units.

    Attributes
    ----------
    rig : Rig
    growing : int
        Modes that grow at the rig's speed, among the 64 softest.
    waves : tuple of WaveAnswer
        Of the five softest modes.
    critical : CriticalLength or None
        Of a chain: below which stiffness modes grow, and from which length on.
    theory_note : str
        Why the theory has nothing to say, or nothing.
    speeds_searched : (float, float)
    """

    rig: Rig
    growing: int
    waves: tuple[WaveAnswer, ...]
    critical: CriticalLength | None
    theory_note: str
    speeds_searched: tuple[float, float]

    @property
    def speeds(self) -> tuple[tuple[float, float], ...]:
        """Ranges of speed in which any mode grows."""
        pairs = sorted(pair for wave in self.waves for pair in wave.speeds)
        bands = joined(Band(kind="unstable", low=low, high=high) for low, high in pairs)
        return tuple((band.low, band.high) for band in bands)

    @property
    def at_least(self) -> bool:
        """Whether more modes may grow than were looked at."""
        return self.growing == _MOST

    @property
    def verdict(self) -> str:
        """The answer in one sentence."""
        return say.verdict_on_waves(self)

    def __str__(self) -> str:
        return "\n".join([f"{self.rig.name}: {self.verdict}", *(f"- {line}" for line in say.waves(self))])

    def plot(self) -> Figure:
        """Draw at which speeds each wave grows."""
        from stickslip import plot

        return plot.waves(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers, texts and lists, as JSON takes them; what is not finite is None."""
        rig = self.rig
        units = {"velocity": rig.unit_name("x_s/time"), "stiffness": rig.unit_name("k"), "wavelength": "blocks"}
        told = {"rig": rig.name, "verdict": self.verdict, "velocity": rig.velocity, "speeds": self.speeds}
        told |= {"units": units} | {f.name: getattr(self, f.name) for f in fields(self) if f.name != "rig"}
        found: dict[str, Any] = plain(told)
        return found


def predict_waves(rig: Rig, report: Progress = lambda _share: None) -> ElasticPrediction:
    """Say which waves of an elastic slider grow at the speed of its drive, and at which speeds."""
    from stickslip.elastic.modes import critical_length, sliders_of  # some .13 s that no rigid rig needs

    setting, body = rig.natural, rig.slider
    assert isinstance(body, ElasticBody)
    low, high = range_of_speeds(rig)
    stiffness, coupling, wavelength, sliders = sliders_of(body, _MOST)
    speed, note = rig.unit("x_s/time"), ""
    sliding = [replace(setting, slider=slider, drive=constant(setting.velocity)) for slider in sliders]
    growing, waves, critical = 0, list[WaveAnswer](), None
    try:
        if respond(setting.interface).inert:
            raise UndecidedError(CANNOT_GROW)
        alike = Counter(sliders)  # modes come in pairs of one stiffness
        first = [sliders.index(slider) for slider in alike]
        growing = sum(alike[sliders[i]] for i in first if count_unstable(sliding[i]))
        for i in first[:_MODES]:
            growth, frequency = fastest_mode(replace(sliding[i], scales=rig.scales))
            bands = stability_along(VELOCITY, sliding[i], low, high)
            waves.append(
                WaveAnswer(
                    name=_name(float(wavelength[i]), float(coupling[i]), body),
                    wavelength=float(wavelength[i]),
                    stiffness=float(stiffness[i]) * rig.unit("k"),
                    growth=growth,
                    frequency=frequency,
                    speeds=tuple((band.low * speed, band.high * speed) for band in bands if band.kind == "unstable"),
                )
            )
            report(len(waves) / _MODES)
        critical = critical_length(rig) if isinstance(body, Chain) else None
    except UndecidedError as reason:
        note = str(reason)
    report(1.0)
    return ElasticPrediction(
        rig=rig,
        growing=growing,
        waves=tuple(waves),
        critical=critical,
        theory_note=note,
        speeds_searched=(low * speed, high * speed),
    )


def _name(wavelength: float, coupling: float, body: ElasticBody) -> str:
    if math.isnan(wavelength):
        return "a mode localised at the driven end"
    if isinstance(body, Chain) and body.size < wavelength < math.inf:
        # No wave is longer than what carries it.
        return "the bar nearly as a whole" if wavelength > 3.0 * body.size else "half a wave along the bar"
    if math.isfinite(wavelength):
        return f"waves of {wavelength:.3g} blocks"
    return "the uniform mode" if coupling == 0.0 else "waves across the drive"
