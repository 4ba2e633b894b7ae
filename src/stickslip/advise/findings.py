"""What is found for a rig: the records behind the sentences of an answer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
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

# root mean square of a fluctuation over the mean force, by convention, that a rig is
# asked to stay below
SEEN = 0.05


def frequency_unit(rig: Rig) -> str:
    """Unit of a frequency in the rig's own units."""
    return "Hz" if rig.scales is not None else "cycles per time unit"


@dataclass(frozen=True, kw_only=True)
class Margin:
    """How far a parameter can be varied, alone, before smooth sliding changes its
    linear stability.
    """

    parameter: str
    value: float  #: where it stands, in the rig's own units, as all that follows

    #: The nearest stability limits below and above; None if there is none within
    #: `searched`.
    lower: float | None
    upper: float | None
    searched: tuple[float, float]
    #: all ranges within that in which smooth sliding is stable
    stable: tuple[tuple[float, float], ...]

    @property
    def nearest(self) -> Mitigation | None:
        """The smallest change that reaches a limit, if one was found."""
        changes = [
            Mitigation(parameter=self.parameter, now=self.value, to=end)
            for end in (self.lower, self.upper)
            if end is not None
        ]
        return min(changes, key=lambda each: each.size, default=None)


@dataclass(frozen=True, kw_only=True, repr=False)
class Findings:
    """What is found for a rig with a rigid slider; every number in its own units."""

    rig: Rig
    recording: Recording  #: the simulated run that `regime` is of; `run` is its Dataset
    regime: Regime  #: of the run, with its evidence

    #: Largest force in slow rigid motion, and mean force of steady sliding at the rig's
    #: speed.
    static_friction: float
    kinetic_friction: float

    #: ``K*`` of Eq. (8) in both conventions. Where thresholds age, these and the static
    #: friction are those of contacts whose thresholds have fully grown and do not
    #: change during the motion; where heat breaks contacts, they are of motion that is
    #: too fast for it.
    critical_stiffness: float
    critical_stiffness_without_reattachment: float

    #: Growing modes of smooth sliding; None where the theory does not apply, for the
    #: reason in `theory_note`.
    unstable_modes: int | None

    #: Of the fastest mode; the frequency in cycles per unit of time, so in Hz for a rig
    #: in SI units.
    growth_rate: float | None
    mode_frequency: float | None
    theory_note: str
    speeds_searched: tuple[float, float]
    #: the motion at each speed from `speeds_searched[0]` to `speeds_searched[1]`,
    #: rising
    bands: tuple[Band, ...]
    margins: tuple[Margin, ...] = ()

    #: Of a stable rig, the parameter with the nearest limit among those that are set on
    #: a machine, and its value on the way there from which on the noise of the contacts
    #: makes the force fluctuate by more than 5 % rms, or the velocity by too much for
    #: linear theory, by which it is known; where the force does so now, it is the value
    #: that it has. None where that is within 5 % of the limit.
    noise_limit: tuple[str, float] | None = None

    #: Those that can be made on the machine first, in each group the smallest first.
    #: Where the rig works over a range of speeds, or at several, each is one for all of
    #: them.
    mitigations: tuple[Mitigation, ...] = ()
    #: Two changes that give smooth sliding together, each smaller than any one alone.
    combined: tuple[Mitigation, ...] = ()
    #: Parameters that give no smooth sliding, with the range searched.
    attempts: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    #: Parameters with the furthest value, and the fraction of runs there that slide
    #: smoothly: some, not all.
    unreliable: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    #: Titles of parameters whose search ended with the budget.
    not_searched: tuple[str, ...] = ()
    #: whether mitigations, and the speeds from rest, have been looked for
    complete: bool = False
    #: what it would do with other values of what the rig's file calls assumed
    doubt: Doubt | None = None

    #: Where one run decides little, of few contacts or some that wait for an arrest:
    #: how many of how many runs with other contacts oscillate on.
    lasting: tuple[int, int] | None = None

    #: Where the rig names no mechanism by which contacts strengthen: what it would do
    #: with which delay.
    delays: tuple[Band, ...] = ()

    #: Of a drive that goes through speeds: when its own run oscillates. None where
    #: there is one speed, or where that run counts as too many.
    driven: tuple[Episode, ...] | None = None

    #: Standard deviation of the spring force over its mean, where it is seen and by
    #: theory noise of the contacts.
    noise: float | None = None
    #: false where linearly stable smooth sliding is left, by theory, by the noise of
    #: its contacts
    survives_noise: bool = True

    @cached_property
    def run(self) -> xr.Dataset:
        """The simulated run that `regime` is of."""
        return self.recording.dataset()

    @property
    def has_verdict(self) -> bool:
        """Whether there is a verdict: not where nothing says how contacts strengthen
        with rest.
        """
        return not self.delays

    @property
    def stiffness(self) -> float:
        """What holds the contacts: the driving spring, or a structure at rest."""
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
        """Whether the run oscillates on."""
        return self.regime.kind in OSCILLATES

    @property
    def smooth(self) -> bool | None:
        """Whether the rig slides smoothly: stable, and seen to in the run; None if
        that is undecided.
        """
        if self.regime.kind == "undecided" or not self.has_verdict:
            return None
        return not (self.oscillates or self.unstable_modes or self._some_last)

    @property
    def bistable(self) -> bool:
        """Whether smooth sliding is stable, and stays, although the run from rest
        shows sustained stick-slip.
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
        """Whether a run with other contacts oscillates on."""
        return self.lasting is not None and self.lasting[0] > 0

    @property
    def lasts_in_some(self) -> bool:
        """Whether runs that differ in their contacts alone differ in their motion."""
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
        those its drive goes through while it moves.
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
        """Of its drive, those that do not ring down by themselves."""
        return [each for each in self.driven or () if not each.rings_down]

    @property
    def along_drive(self) -> tuple[Band, ...]:
        """What it does when along a drive that goes through speeds: in its own run,
        what rings down with the rest, or else as if each speed lasted; nothing where
        there is one speed.
        """
        if self.driven is None:
            return self._if_each_speed_lasted() if self.between else ()
        found = list[Band]()
        now = 0.0
        for episode in self.driven:
            begin = episode.begin
            end = episode.end
            # no drop here that would be more than a small oscillation
            found.append(Band(kind="smooth sliding", low=now, high=begin))
            found.append(Band(kind=episode.kind, low=begin, high=end))
            now = end
        last = self.rig.drive.duration * self.rig.unit("time")
        found.append(Band(kind="smooth sliding", low=now, high=last))
        return tuple(band for band in found if band.high > band.low)

    def _if_each_speed_lasted(self) -> tuple[Band, ...]:
        """What it does when along its drive, by `bands`.

        Where there are two motions at a speed, it goes on with what it did before; it
        starts from rest. Transients are left out.
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
        """Names of the units that numbers are in."""
        names = {
            p.name: self.rig.unit_name(p.unit) for p in (*PARAMETERS, *UNITS_OF_A_RIG)
        }
        return names | {
            "force": self.rig.unit_name("f_s"),
            "frequency": frequency_unit(self.rig),
        }


@dataclass(frozen=True, kw_only=True)
class WaveAnswer:
    """What smooth sliding does to waves of one length; in the rig's own units."""

    name: str  #: the wave, in words

    #: In blocks, along the drive; infinite where blocks in a row move alike, NaN where
    #: a wave does not reach into it.
    wavelength: float
    stiffness: float  #: of a rigid slider with the same motion as the mode

    #: Growth rate and frequency (in cycles per time) at the rig's speed; None where
    #: nothing decays exponentially.
    growth: float | None
    frequency: float | None
    speeds: tuple[tuple[float, float], ...]  #: ranges of speed in which it grows


@dataclass(frozen=True, kw_only=True)
class Slip:
    """A slip of several blocks of a bar; in the rig's own units."""

    start: float
    blocks: int  #: up to which block, from 1, contacts broke
    drop: float  #: of the spring force


@dataclass(frozen=True, kw_only=True, repr=False)
class WaveFindings:
    """What is found for an elastic slider, by linear theory and in a run from rest;
    every number in the rig's own units.
    """

    rig: Rig
    growing: int = 0  #: modes that grow at the rig's speed, among the 64 softest
    waves: tuple[WaveAnswer, ...] = ()  #: of the five softest modes
    #: of a chain: below which stiffness modes grow, and from which length on
    critical: CriticalLength | None = None
    theory_note: str = ""  #: why the theory has nothing to say, or nothing
    speeds_searched: tuple[float, float]

    simulated: float = 0.0  #: how long a run of the bar was; 0 without one
    #: in that run the first slip of three blocks or more that is not one of all, and
    #: the first of all
    partial: Slip | None = None
    whole: Slip | None = None
    #: changes of one parameter that make smooth sliding linearly stable, the smallest
    #: first; and parameters that do not, with the range searched
    mitigations: tuple[Mitigation, ...] = ()
    attempts: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def bands(self) -> tuple[Band, ...]:
        """Ranges of speed in which any mode grows."""
        pairs = sorted(pair for wave in self.waves for pair in wave.speeds)
        return tuple(
            joined(Band(kind="unstable", low=low, high=high) for low, high in pairs)
        )

    @property
    def speeds(self) -> tuple[tuple[float, float], ...]:
        """The ends of these."""
        return tuple(band.ends for band in self.bands)

    @property
    def units(self) -> dict[str, str]:
        """Names of the units that numbers are in."""
        named = {name: self.rig.unit_name(name) for name in ("velocity", "stiffness")}
        return named | {"wavelength": "blocks"}
