"""What is predicted for a rig."""

from __future__ import annotations

import html
import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

from stickslip.advise import say
from stickslip.advise.bands import OSCILLATES, Band
from stickslip.advise.mitigations import Attempt, Mitigation
from stickslip.answers import Answer, plain
from stickslip.measure import Regime
from stickslip.model.parameters import PARAMETERS, UNITS_OF_A_RIG
from stickslip.model.rig import Rig
from stickslip.simulation import Recording

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True)
class Margin:
    """How far a parameter can be varied, alone, before smooth sliding changes its linear stability.

    Attributes
    ----------
    parameter : str
    value : float
        Where it stands, in the rig's own units, as all that follows.
    lower, upper : float or None
        The nearest stability limits below and above; None if there is none within `searched`.
    searched : (float, float)
    stable : tuple of (float, float)
        All ranges within that in which smooth sliding is stable.
    """

    parameter: str
    value: float
    lower: float | None
    upper: float | None
    searched: tuple[float, float]
    stable: tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True, repr=False)
class Prediction(Answer):
    """What `predict` found; every number in the rig's own units. It prints as its short text.

    Attributes
    ----------
    recording : Recording
        The simulated run that `regime` is of; `run` is its Dataset.
    regime : Regime
        Of the run, with its evidence.
    static_friction, kinetic_friction : float
        Largest force in slow rigid motion, and mean force of steady sliding at the rig's speed.
    critical_stiffness, critical_stiffness_without_reattachment : float
        ``K*`` of Eq. (8) in both conventions. Where thresholds age, these and the static friction are those of contacts
        whose thresholds have fully grown and do not change during the motion; where heat breaks contacts, they are of
        motion that is too fast for it.
    unstable_modes : int or None
        Growing modes of smooth sliding; None where the theory does not apply, for the reason in `theory_note`.
    growth_rate, mode_frequency : float or None
        Of the fastest mode; the frequency in cycles per unit of time, so in Hz for a rig in SI units.
    bands : tuple of Band
        The motion at each speed from `speeds_searched[0]` to `speeds_searched[1]`, rising.
    margins : tuple of Margin
    mitigations : tuple of Mitigation
        Those that can be turned on a machine first, in each group the smallest first.
    attempts : tuple of Attempt
        For parameters that give no smooth sliding within the range searched: how far that goes.
    not_searched : tuple of str
        Parameters whose search was given up for its cost.
    complete : bool
        Whether mitigations, and the speeds from rest, have been looked for.
    delays : tuple of Band
        Where the rig names no mechanism by which contacts strengthen: what it would do with which delay.
    noise : float or None
        Standard deviation of the spring force over its mean, where linear theory is stable and a run from sliding
        fluctuates as the run from rest does: then it is noise of the contacts, and the regime is smooth sliding,
        whatever `regime` of the run alone would say.
    stays : bool
        False where a run of the rig's own contacts leaves linearly stable smooth sliding.
    """

    rig: Rig
    recording: Recording
    regime: Regime
    static_friction: float
    kinetic_friction: float
    critical_stiffness: float
    critical_stiffness_without_reattachment: float
    unstable_modes: int | None
    growth_rate: float | None
    mode_frequency: float | None
    theory_note: str
    speeds_searched: tuple[float, float]
    bands: tuple[Band, ...]
    margins: tuple[Margin, ...] = ()
    mitigations: tuple[Mitigation, ...] = ()
    attempts: tuple[Attempt, ...] = ()
    not_searched: tuple[str, ...] = ()
    complete: bool = False
    delays: tuple[Band, ...] = ()
    noise: float | None = None
    stays: bool = True

    @cached_property
    def run(self) -> xr.Dataset:
        """The simulated run that `regime` is of."""
        return self.recording.dataset()

    @property
    def judged(self) -> bool:
        """Whether there is a verdict: not where nothing says how contacts strengthen with rest."""
        return not self.delays

    @property
    def stiffness_margin(self) -> float:
        """``K/K*``: above 1 there is no elastic instability; infinite if the force never falls."""
        return self.rig.value("stiffness") / self.critical_stiffness if self.critical_stiffness > 0 else math.inf

    @property
    def smooth(self) -> bool | None:
        """Whether the rig slides smoothly: stable, and seen to in the run; None if that is undecided."""
        if self.regime.kind == "undecided" or not self.judged:
            return None
        return self.regime.kind == "smooth sliding" and not self.unstable_modes

    @property
    def oscillates(self) -> bool:
        """Whether the run shows stick-slip or a sustained oscillation."""
        return self.regime.kind in OSCILLATES

    @property
    def bistable(self) -> bool:
        """Whether smooth sliding is stable, and stays, although the run from rest shows sustained stick-slip."""
        return self.judged and self.unstable_modes == 0 and self.oscillates and self.stays

    @property
    def ill(self) -> bool:
        """Whether there is something to mitigate."""
        return self.judged and (bool(self.unstable_modes) or self.oscillates)

    @property
    def frequency(self) -> float | None:
        """Cycles per unit of time (Hz, for a rig in SI units) of the oscillation in the run; None if it has none."""
        period = self.regime.period
        return 1.0 / period if self.oscillates and math.isfinite(period) and period > 0 else None

    @property
    def amplitude(self) -> float:
        """Half of the peak-to-peak force in the run."""
        return 0.5 * self.regime.peak_to_peak

    @property
    def relative_amplitude(self) -> float:
        """Peak-to-peak force over static friction."""
        return self.regime.peak_to_peak / self.static_friction

    @property
    def headline(self) -> str:
        """What the rig does at its own speed."""
        return say.headline(self)

    @property
    def verdict(self) -> str:
        """The answer in one sentence."""
        return say.verdict(self)

    @property
    def at_speeds(self) -> tuple[tuple[float, str], ...]:
        """Each speed at which the rig works, in its own units, and the motion there from a start at rest."""
        size, found = self.rig.unit("x_s/time"), list[tuple[float, str]]()
        for speed in (speed * size for speed in self.rig.operation.speeds):
            there = (band.motion for band in self.bands if band.low <= speed <= band.high)
            here = math.isclose(speed, self.rig.velocity)
            found.append((speed, self.regime.kind if here else next(there, "undecided")))
        return tuple(found)

    @property
    def between(self) -> tuple[float, float] | None:
        """The range of speeds at which the rig works, in its own units: as given, or those its drive goes through."""
        size = self.rig.unit("x_s/time")
        if self.rig.operation.between is not None:
            low, high = self.rig.operation.between
            return low * size, high * size
        through = sorted(abs(v) * size for piece in self.rig.drive.pieces for v in (piece.start, piece.end))
        return None if through[0] == through[-1] else (max(through[0], self.speeds_searched[0]), through[-1])

    def __str__(self) -> str:
        return say.text(self)

    def _repr_html_(self) -> str:
        told = html.escape
        rows = "".join(f"<tr><td>{told(name)}</td><td>{told(value)}</td></tr>" for name, value in say.numbers(self))
        items = "".join(f"<li>{told(line)}</li>" for line in say.advice(self))
        items = f"<ul>{items}</ul>" if items else ""
        return f"<p><b>{told(self.rig.name)}</b>: {told(self.verdict)}</p><table>{rows}</table>{items}"

    def plot(self) -> Figure:
        """Draw the answer: the motion at each speed, the force at the rig's speed, and the margins."""
        from stickslip import plot

        return plot.prediction(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers, texts and lists, as JSON takes them; what is not finite is None."""
        rig = self.rig
        units = {p.name: rig.unit_name(p.unit) for p in (*PARAMETERS, *UNITS_OF_A_RIG)}
        units |= {"force": rig.unit_name("f_s"), "frequency": say.frequency_unit(rig)}
        told = {"rig": rig.name, "verdict": self.verdict, "units": units, "velocity": rig.velocity}
        told |= {name: getattr(self, name) for name in _TOLD}
        told |= {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("rig", "recording")}
        found: dict[str, Any] = plain(told | {"assumed": {key: str(item) for key, item in rig.assumed.items()}})
        return found


_TOLD = ("at_speeds", "stiffness_margin", "smooth", "bistable", "frequency", "amplitude", "relative_amplitude")
"""Besides the fields."""
