"""The results of a prediction: the records from which its sentences are made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain, pairwise
from typing import TYPE_CHECKING

from stickslip.advise.budget import OSCILLATES
from stickslip.advise.doubt import Doubt
from stickslip.advise.mitigations import Mitigation
from stickslip.advise.survey import Band, joined, scaled
from stickslip.measure import Regime
from stickslip.measure.episodes import Episode
from stickslip.measure.periods import REGULAR
from stickslip.model.parameters import PARAMETERS, UNITS_OF_A_RIG
from stickslip.model.rig import Rig
from stickslip.simulation import Recording

if TYPE_CHECKING:
    import xarray as xr

    from stickslip.elastic.modes import CriticalLength

# rms fluctuation over the mean force below which a rig should stay, by convention
LARGE_NOISE = 0.05


def frequency_unit(rig: Rig) -> str:
    """Return the unit of a frequency in the rig's own units."""
    return "Hz" if rig.scales is not None else "cycles per time unit"


@dataclass(frozen=True, kw_only=True)
class Margin:
    """The range within which a parameter can be varied, alone, before the linear
    stability of smooth sliding changes; in the rig's own units.
    """

    parameter: str
    value: float  #: present value of the parameter

    #: The nearest stability limits below and above; None if there is none within
    #: `searched`.
    lower: float | None
    upper: float | None
    searched: tuple[float, float]
    #: all ranges within `searched` in which smooth sliding is stable
    stable: tuple[tuple[float, float], ...]

    @property
    def nearest(self) -> Mitigation | None:
        """The smallest change that reaches a limit; None if no limit was found."""
        changes = [
            Mitigation(parameter=self.parameter, now=self.value, to=end)
            for end in (self.lower, self.upper)
            if end is not None
        ]
        return min(changes, key=lambda each: each.size, default=None)


@dataclass(frozen=True, kw_only=True, repr=False)
class Findings:
    """The results for a rig with a rigid slider; every number in its own units."""

    rig: Rig
    recording: Recording  #: the simulated run; `run` is its Dataset
    regime: Regime  #: regime of the run, with its evidence

    #: Largest force in slow rigid motion, and mean force of steady sliding at the rig's
    #: speed.
    static_friction: float
    kinetic_friction: float

    #: ``K*`` of Eq. (8) in both conventions. If thresholds age, these and the static
    #: friction hold for contacts whose thresholds have fully grown and do not change
    #: during the motion; if heat breaks contacts, they hold for motion too fast for
    #: that.
    critical_stiffness: float
    critical_stiffness_without_reattachment: float

    #: Number of growing modes of smooth sliding; None where the theory does not apply,
    #: for the reason in `theory_note`.
    unstable_modes: int | None

    #: Growth rate and frequency of the fastest mode, the latter in cycles per unit of
    #: time, so in Hz for a rig in SI units.
    growth_rate: float | None
    mode_frequency: float | None
    theory_note: str
    speeds_searched: tuple[float, float]
    #: the motion at each speed from `speeds_searched[0]` to `speeds_searched[1]`, in
    #: rising order
    bands: tuple[Band, ...]
    margins: tuple[Margin, ...] = ()

    #: For a stable rig: the machine parameter with the nearest stability limit, and its
    #: value on the way to the limit beyond which, by linear theory, the noise of the
    #: contacts makes the force fluctuate by more than 5 % rms, or the velocity by more
    #: than the theory allows. It is the present value if that is exceeded now; None if
    #: it is within 5 % of the limit.
    noise_limit: tuple[str, float] | None = None

    #: Changes that give smooth sliding: those that can be made on the machine first, in
    #: each group the smallest first. If the rig works at several speeds, or over a
    #: range, each change holds for all of them.
    mitigations: tuple[Mitigation, ...] = ()
    #: Two changes that give smooth sliding together, each smaller than any one alone.
    combined: tuple[Mitigation, ...] = ()
    #: Parameters that give no smooth sliding, with the range searched.
    attempts: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    #: Parameters at whose furthest value some runs, but not all, slide smoothly: that
    #: value, and the fraction of runs.
    unreliable: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    #: Titles of parameters whose search ended with the budget.
    not_searched: tuple[str, ...] = ()
    #: whether mitigations, and the motion from rest at other speeds, were searched
    complete: bool = False
    #: the motion with other values of the assumptions in the rig's file
    doubt: Doubt | None = None

    #: Where one run decides little (few contacts, or contacts that re-attach at an
    #: arrest): number of runs with other contacts whose oscillation persists, and
    #: number of these runs.
    lasting: tuple[int, int] | None = None

    #: For a rig without a mechanism by which contacts strengthen: the motion that it
    #: would have, over the delay.
    delays: tuple[Band, ...] = ()

    #: For a drive with several speeds: the episodes in which its own run oscillates.
    #: None for one speed, or if that run exceeds the budget.
    driven: tuple[Episode, ...] | None = None

    #: Standard deviation of the spring force over its mean, if it is visible and is, by
    #: theory, noise of the contacts.
    noise: float | None = None
    #: false if, by theory, the noise of the contacts ends linearly stable smooth
    #: sliding
    survives_noise: bool = True

    @cached_property
    def run(self) -> xr.Dataset:
        """The simulated run, whose regime is `regime`."""
        return self.recording.dataset()

    @property
    def has_verdict(self) -> bool:
        """Whether there is a verdict: it needs a mechanism by which contacts strengthen
        at rest.
        """
        return not self.delays

    @property
    def stiffness(self) -> float:
        """Stiffness of the driving spring, or of a structure at the contacts."""
        slider = self.rig.natural.slider
        return float(getattr(slider, "slowest", slider).stiffness * self.rig.unit("k"))

    @property
    def stiffness_margin(self) -> float:
        """``K/K*``: above 1 there is no elastic instability; infinite if the force
        never falls.
        """
        return (
            self.stiffness / self.critical_stiffness
            if self.critical_stiffness > 0
            else math.inf
        )

    @property
    def oscillates(self) -> bool:
        """Whether the run shows stick-slip or a sustained oscillation."""
        return self.regime.kind in OSCILLATES

    @property
    def smooth(self) -> bool | None:
        """Whether the rig slides smoothly, by linear theory and in the run; None if
        that is undecided.
        """
        if self.regime.kind == "undecided" or not self.has_verdict:
            return None
        return not (self.oscillates or self.unstable_modes or self._some_last)

    @property
    def bistable(self) -> bool:
        """Whether smooth sliding is stable, and survives noise, although the run from
        rest oscillates.
        """
        stays = self.unstable_modes == 0 and self.survives_noise
        return self.oscillates and self.has_verdict and stays

    @property
    def needs_mitigation(self) -> bool:
        """Whether there is something to mitigate, at any of the speeds at which the
        rig works.
        """
        return self.has_verdict and bool(
            self.unstable_modes or self.oscillates or self._some_last or self.trouble
        )

    @property
    def _some_last(self) -> bool:
        """Whether the oscillation persists in a run with other contacts."""
        return self.lasting is not None and self.lasting[0] > 0

    @property
    def lasts_in_some(self) -> bool:
        """Whether runs that differ only in their contacts differ in their motion."""
        count, most = self.lasting or (0, 0)
        return count != most * self.oscillates

    @property
    def trouble(self) -> tuple[Band, ...]:
        """Ranges of speed with an oscillation among those at which the rig works."""
        single = [(speed, speed) for speed, _ in self.at_speeds]
        ends = [self.between] if self.between else single
        return tuple(
            band
            for band in self.bands
            if band.kind in (*OSCILLATES, "unstable")
            and any(band.low <= high and low <= band.high for low, high in ends)
        )

    @property
    def frequency(self) -> float | None:
        """Cycles per unit of time (Hz, for a rig in SI units) of the oscillation in
        the run; None if it has none, or is irregular.
        """
        is_regular = self.regime.period_variation < REGULAR
        return self.cycles_per_time if is_regular else None

    @property
    def cycles_per_time(self) -> float | None:
        """Cycles or slips per unit of time, regular or not; None without any."""
        period = self.regime.period
        repeats = self.oscillates and 0 < period < math.inf
        return 1.0 / period if repeats else None

    @property
    def frequency_error(self) -> float | None:
        """Standard error of `frequency`, from the scatter of the periods."""
        if self.frequency is None:
            return None
        seen = self.regime
        return self.frequency * seen.period_variation / math.sqrt(max(seen.cycles, 1))

    @property
    def amplitude(self) -> float:
        """Half of the peak-to-peak force in the run."""
        return 0.5 * self.regime.peak_to_peak

    @property
    def relative_amplitude(self) -> float:
        """Peak-to-peak force over static friction."""
        return self.regime.peak_to_peak / self.static_friction

    @property
    def at_speeds(self) -> tuple[tuple[float, str], ...]:
        """Each speed at which the rig works, in its own units, and the motion there
        from a start at rest.
        """
        found = list[tuple[float, str]]()
        for natural in self.rig.operation.speeds:
            speed = natural * self.rig.unit("velocity")
            motions = [band.motion for band in self.bands if speed in band]
            # the first is that of the drive
            kind = [*motions, "undecided"][0] if found else str(self.regime.kind)
            found.append((speed, kind))
        return tuple(found)

    @property
    def between(self) -> tuple[float, float] | None:
        """The range of speeds at which the rig works, in its own units: as given, or
        that of its drive while it moves; None for one speed.
        """
        through = [
            abs(velocity)
            for piece in self.rig.drive.pieces
            for velocity in (piece.start, piece.end)
            if piece.start or piece.end
        ]
        ends = self.rig.operation.between or through
        low, high = (end(ends) * self.rig.unit("velocity") for end in (min, max))
        return None if low == high else (max(low, self.speeds_searched[0]), high)

    @property
    def lasting_episodes(self) -> list[Episode]:
        """Episodes of its drive that do not ring down by themselves."""
        return [each for each in self.driven or () if not each.rings_down]

    @property
    def along_drive(self) -> tuple[Band, ...]:
        """The motion over the time of a drive with several speeds; empty for one speed.

        It is that of its own run, with the episodes that ring down, or, without that
        run, the motion as if each speed lasted.
        """
        if self.driven is None:
            return self._if_each_speed_lasted() if self.between else ()
        found = list[Band]()
        now = 0.0
        for episode in self.driven:
            begin = episode.begin
            end = episode.end
            # between episodes no drop exceeds a small oscillation
            found.append(Band(kind="smooth sliding", low=now, high=begin))
            found.append(Band(kind=episode.kind, low=begin, high=end))
            now = end
        last = self.rig.drive.duration * self.rig.unit("time")
        found.append(Band(kind="smooth sliding", low=now, high=last))
        return tuple(band for band in found if band.high > band.low)

    def _if_each_speed_lasted(self) -> tuple[Band, ...]:
        """Return the motion over the time of the drive, as if each speed lasted.

        At a bistable speed the motion before continues; the rig starts from rest.
        Transients are ignored.
        """
        found: list[Band] = []
        begin = 0.0
        unit = self.rig.unit("velocity")
        edges = {end / unit for band in self.bands for end in band.ends}
        for piece in self.rig.drive.pieces:
            start = piece.start
            rate = piece.acceleration
            reached = [*edges, *(-edge for edge in edges)] if rate else []
            times = [(edge - start) / rate for edge in reached]
            cuts = sorted(time for time in times if 0.0 < time < piece.duration)
            for first, last in pairwise([0.0, *cuts, piece.duration]):
                speed = abs(start + 0.5 * rate * (first + last)) * unit
                here = next((band for band in self.bands if speed in band), None)
                kind = here.kind if here else "unknown"
                before = found[-1].kind if found else ""
                if here and here.bistable and before in ("smooth sliding", "stable"):
                    kind = before
                found.append(Band(kind=kind, low=begin + first, high=begin + last))
            begin += piece.duration
        return scaled(joined(found), self.rig.unit("time"))

    @property
    def units(self) -> dict[str, str]:
        """Names of the units of the numbers."""
        names = {
            p.name: self.rig.unit_name(p.unit) for p in (*PARAMETERS, *UNITS_OF_A_RIG)
        }
        return names | {
            "force": self.rig.unit_name("f_s"),
            "frequency": frequency_unit(self.rig),
        }


@dataclass(frozen=True, kw_only=True)
class WaveAnswer:
    """The linear stability of waves of one length; in the rig's own units."""

    name: str  #: the wave, in words

    #: Wavelength along the drive, in blocks; infinite if all blocks in a row move
    #: alike, NaN for a mode localised at one end.
    wavelength: float
    stiffness: float  #: stiffness of a rigid slider with the motion of the mode

    #: Growth rate and frequency (in cycles per time) at the rig's speed; None if no
    #: perturbation grows or decays exponentially.
    growth: float | None
    frequency: float | None
    speeds: tuple[tuple[float, float], ...]  #: ranges of speed in which it grows
    #: ranges of speed in which that is not known
    unknown: tuple[tuple[float, float], ...] = ()
    searched: bool = True  #: False if the budget ended before its speeds were searched


@dataclass(frozen=True, kw_only=True)
class Slip:
    """A slip of several blocks of a bar; in the rig's own units."""

    start: float  #: time at which it starts
    blocks: int  #: last block, from 1, whose contacts broke
    drop: float  #: drop of the spring force


@dataclass(frozen=True, kw_only=True, repr=False)
class WaveFindings:
    """The results for an elastic slider, by linear theory and in a run from rest; every
    number in the rig's own units.
    """

    rig: Rig
    looked: int = 0  #: number of modes that were looked at, the softest first
    growing: int = 0  #: number of these that grow at the rig's speed
    fastest: str = ""  #: name of the mode that grows fastest; empty if none is known
    #: the five softest modes, the fastest, and those that grow at speeds at which none
    #: of these does
    waves: tuple[WaveAnswer, ...] = ()
    #: whether no other mode grows at a speed at which these decay
    complete: bool = True
    #: for a chain: the stiffness below which modes grow, and the critical length
    critical: CriticalLength | None = None
    theory_note: str = ""  #: why the theory does not apply; empty if it does
    speeds_searched: tuple[float, float]

    simulated: float = 0.0  #: duration of the run of the bar; 0 without one
    #: in that run, the first slip of at least three blocks but not all, and the first
    #: of all blocks
    partial: Slip | None = None
    whole: Slip | None = None
    #: changes of one parameter that make smooth sliding linearly stable, the smallest
    #: first; and parameters that do not, with the range searched
    mitigations: tuple[Mitigation, ...] = ()
    attempts: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    #: what was left out as the budget ended
    not_searched: tuple[str, ...] = ()

    @property
    def bands(self) -> tuple[Band, ...]:
        """Ranges of speed in which any mode grows, or in which that is not known."""
        grows = {ends for wave in self.waves for ends in wave.speeds}
        doubtful = {ends for wave in self.waves for ends in wave.unknown}
        if not self.complete:
            doubtful.add(self.speeds_searched)
        found = []
        for low, high in pairwise(sorted({*chain(*grows, *doubtful)})):
            for kind, ranges in (("unstable", grows), ("unknown", doubtful)):
                if any(ends[0] <= low and high <= ends[1] for ends in ranges):
                    found.append(Band(kind=kind, low=low, high=high))
                    break
        return joined(found)

    @property
    def speeds(self) -> tuple[tuple[float, float], ...]:
        """The ranges of speed in which any mode grows."""
        return tuple(band.ends for band in self.bands if band.kind == "unstable")

    @property
    def units(self) -> dict[str, str]:
        """Names of the units of the numbers."""
        named = {name: self.rig.unit_name(name) for name in ("velocity", "stiffness")}
        return named | {"wavelength": "blocks"}
