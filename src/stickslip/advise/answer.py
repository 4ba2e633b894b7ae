"""What is predicted for a rig, and how it is said."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

from stickslip.advise.mitigations import Attempt, Mitigation
from stickslip.advise.speeds import Band
from stickslip.answers import Answer, plain
from stickslip.measure import Regime
from stickslip.model.parameters import PARAMETERS, UNITS_OF_A_RIG, parameter_named
from stickslip.model.rig import Rig
from stickslip.model.units import Quantity, quantity
from stickslip.simulation import Recording

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_TITLES = {parameter.name: parameter.title for parameter in (*PARAMETERS, *UNITS_OF_A_RIG)}
_OSCILLATES = ("stick-slip", "sustained oscillation")
_KINDS = {"unstable": "linearly unstable", "stable": "linearly stable", "unknown": "not known"}
"""What bands are called in a sentence, where that is not their kind."""


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

    # ------------------------------------------------------------------------------------------------------ the answer

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
        own = self.rig.value("stiffness")
        return own / self.critical_stiffness if self.critical_stiffness > 0 else math.inf

    @property
    def smooth(self) -> bool | None:
        """Whether the rig slides smoothly: stable, and seen to in the run; None if that is undecided."""
        if self.regime.kind == "undecided" or not self.judged:
            return None
        return self.regime.kind == "smooth sliding" and not self.unstable_modes

    @property
    def bistable(self) -> bool:
        """Whether smooth sliding is stable although the run shows sustained stick-slip."""
        return self.judged and self.unstable_modes == 0 and self.regime.kind in _OSCILLATES

    @property
    def ill(self) -> bool:
        """Whether there is something to mitigate."""
        return self.judged and (bool(self.unstable_modes) or self.regime.kind in _OSCILLATES)

    @property
    def frequency(self) -> float | None:
        """Cycles per unit of time (Hz, for a rig in SI units) of the oscillation in the run; None if it has none."""
        period = self.regime.period
        if self.regime.kind in _OSCILLATES and math.isfinite(period) and period > 0:
            return 1.0 / period
        return None

    @property
    def amplitude(self) -> float:
        """Half of the peak-to-peak force in the run."""
        return 0.5 * self.regime.peak_to_peak

    @property
    def relative_amplitude(self) -> float:
        """Peak-to-peak force over static friction."""
        return self.regime.peak_to_peak / self.static_friction

    @property
    def verdict(self) -> str:
        """The answer in one sentence."""
        speed = self._said(self.rig.velocity, "velocity")
        if not self.judged:
            return f"cannot be judged: nothing says how contacts strengthen with rest; {self._by_delay()}"
        how = ""
        if self.regime.kind in _OSCILLATES:
            how = "" if self.frequency is None else f", {self._frequency(self.frequency)}"
            how += (
                f", force ±{self._said(self.amplitude, 'force', digits=3)} ({100 * self.relative_amplitude:.0f} % of "
            )
            how += "static friction peak to peak)"
        parts = [f"{self._at_which_speeds()}{how}", *self._not_known(), f"at {speed}: {self._here()}"]
        if not self.complete:  # only the run at the rig's speed has been made: the rest is linear theory
            parts = [f"at {speed}: {self._here()}{how}", self._at_which_speeds(), *self._not_known()]
        parts = [part for part in parts if part]
        others = [pair for pair in self.at_speeds if pair[0] != self.rig.velocity]
        parts += [f"at {self._speed(other)}: {kind}" for other, kind in others]
        if self.between is not None:
            parts.append(self._over_its_range(*self.between))
        return "; ".join(parts)

    @property
    def at_speeds(self) -> tuple[tuple[float, str], ...]:
        """Each speed at which the rig works, in its own units, and the motion there from a start at rest."""
        size = self.rig.unit("x_s/time")
        return tuple((speed * size, self._kind_at(speed * size)) for speed in self.rig.operation.speeds)

    def _kind_at(self, speed: float) -> str:
        if math.isclose(speed, self.rig.velocity):
            return self.regime.kind
        found = next((band for band in self.bands if band.low <= speed <= band.high), None)
        if found is None:
            return "undecided"
        return _KINDS.get(found.kind, found.kind) + (" from rest only" if found.bistable else "")

    @property
    def between(self) -> tuple[float, float] | None:
        """The range of speeds at which the rig works, in its own units: as given, or those its drive goes through."""
        size = self.rig.unit("x_s/time")
        if self.rig.operation.between is not None:
            low, high = self.rig.operation.between
            return low * size, high * size
        through = sorted(abs(v) * size for piece in self.rig.drive.pieces for v in (piece.start, piece.end))
        if through[0] == through[-1]:
            return None
        return max(through[0], self.speeds_searched[0]), through[-1]

    def _over_its_range(self, low: float, high: float) -> str:
        """The motion over the range of speeds at which the rig works, were each of them to last."""
        parts: list[tuple[float, str]] = []
        for band in self.bands:
            if band.high > low and band.low < high:
                kind = _KINDS.get(band.kind, band.kind) + (" from rest only" if band.bistable else "")
                if not parts or parts[-1][1] != kind:
                    parts.append((max(low, band.low), kind))
        words = [f"{kind} from {self._speed(begin)}" for begin, kind in parts]
        if len(parts) == 1:
            words = [f"{parts[0][1]} throughout"]
        whose = "over its range" if self.rig.operation.between is not None else "along its drive"
        return f"{whose}, {self._speed(low)} to {self._speed(high)}: {', '.join(words) or 'undecided'}"

    def _here(self) -> str:
        kind = self.regime.kind
        if self.bistable:
            return f"{kind} from this start, but smooth sliding, once reached, is linearly stable: bistable"
        if kind == "undecided":
            theory = {None: "", 0: "; linearly stable"}.get(
                self.unstable_modes, "; smooth sliding is linearly unstable"
            )
            return f"undecided, {self.regime.reason}{theory}"
        if kind == "smooth sliding" and self.unstable_modes:
            return (
                "linearly unstable, though the run is smooth: an oscillation grows slowly or is hidden by the noise of "
                "the contacts"
            )
        return str(kind)

    def _at_which_speeds(self) -> str:
        """Ranges of speed with oscillation, each with how far it also persists from rest."""
        rough = [band for band in self.bands if band.kind not in ("smooth sliding", "stable", "unknown")]
        if not rough:
            if self.theory_note:
                return self.theory_note
            known = [band for band in self.bands if band.kind != "unknown"]
            simulated = self.complete and all(band.kind != "stable" for band in known)
            kind = "smooth sliding" if simulated else "linearly stable"
            return f"{kind} at all speeds from {self._span(known[0].low, known[-1].high)}"
        regions: list[list[Band]] = []
        for band in rough:
            if regions and regions[-1][-1].high == band.low:
                regions[-1].append(band)
            else:
                regions.append([band])
        return " and ".join(self._region(region) for region in regions)

    def _not_known(self) -> Iterator[str]:
        """Where starts at rest were not judged, but for a fast answer, and where not even linear theory can tell."""
        rest = ", and starts at rest were not judged" if self.complete else ""
        if rest and (where := self._where("stable")):
            yield f"{where} smooth sliding is linearly stable{rest}"
        if where := self._where("unknown"):
            yield f"{where} linear theory cannot tell{rest}"

    def _where(self, kind: str) -> str:
        return " and ".join(f"from {self._span(band.low, band.high)}" for band in self.bands if band.kind == kind)

    def _region(self, region: list[Band]) -> str:
        core = [band for band in region if not band.bistable] or region
        begin, end = core[0].low, core[-1].high
        words = [f"{_KINDS.get(band.kind, band.kind)} from {self._span(band.low, band.high)}" for band in core]
        beyond = []
        if region[0].low < begin:
            beyond.append(f"down to {self._speed(region[0].low)}")
            beyond[-1] += " or less" if region[0].low <= self.speeds_searched[0] else ""
        if region[-1].high > end:
            beyond.append(f"up to {self._speed(region[-1].high)}")
            beyond[-1] += " or more" if region[-1].high >= self.speeds_searched[1] else ""
        rest = f" (from rest also {' and '.join(beyond)})" if beyond else ""
        return ", ".join(words) + rest + (" from rest only" if core[0].bistable else "")

    def _span(self, low: float, high: float) -> str:
        """Two speeds; the ends of the search say that they are."""
        first, last = self._speed(low), self._speed(high)
        one, other = (text.split(" ", 1) for text in (first, last))
        if len(one) == len(other) == 2 and one[1] == other[1] and low > self.speeds_searched[0]:
            first = one[0]
        return (
            first
            + (" (or less)" if low <= self.speeds_searched[0] else "")
            + f" to {last}"
            + (" (or more)" if high >= self.speeds_searched[1] else "")
        )

    def _speed(self, value: float) -> str:
        return self._said(value, "velocity", digits=3)

    def _by_delay(self) -> str:
        """What the verdict would be over a range of delays."""
        words = []
        for band in self.delays:
            what = _KINDS[band.kind] + (", so stick-slip or oscillation" if band.kind == "unstable" else "")
            words.append(f"{what} from {self._said(band.low, 'time')} to {self._said(band.high, 'time')}")
        return "with a delay of re-attachment it would be, at this speed, " + ", ".join(words)

    # ------------------------------------------------------------------------------------------------------- the parts

    def numbers(self) -> Iterator[tuple[str, str]]:
        """Names and values, with units, of the quantities behind the verdict."""
        rig = self.rig
        aged = ", thresholds fully aged" if rig.interface.ageing is not None else ""
        aged += ", no contact broken by heat" if rig.interface.temperature is not None else ""
        yield "total contact strength N f_s", rig.in_units(1.0, "force")
        yield f"static friction F_s (slow rigid motion{aged})", self._said(self.static_friction, "force")
        yield "kinetic friction F_k at this speed", self._said(self.kinetic_friction, "force")
        yield "stiffness K of the driving spring", self._said(rig.value("stiffness"), "stiffness")
        without = self._said(self.critical_stiffness_without_reattachment, "stiffness")
        yield (
            f"critical stiffness K*{aged}",
            f"{self._said(self.critical_stiffness, 'stiffness')} ({without} without re-attachment)",
        )
        weaker = "softer: elastic instability" if self.stiffness_margin < 1 else "stiffer: no elastic instability"
        yield "margin K/K*", f"{self.stiffness_margin:.3g} ({weaker})"
        if self.theory_note:
            yield "linear stability of smooth sliding", self.theory_note
            return
        state = f"unstable, {self.unstable_modes} growing modes" if self.unstable_modes else "stable"
        if self.growth_rate is not None:
            per = self.rig.unit_name("1/time").replace("1/time", "per time unit")
            oscillation = f" at {self._frequency(self.mode_frequency)}" if self.mode_frequency else ", non-oscillatory"
            state += f"; fastest mode: growth rate {self.growth_rate:.4g} {per}{oscillation}"
        yield "linear stability of smooth sliding", state

    def margin_rows(self) -> Iterator[tuple[str, str, str, str]]:
        """Parameter, value and stability limits, in words."""
        for margin in self.margins:
            low, high = (amount(self.rig, margin.parameter, value) for value in margin.searched)
            yield (
                _TITLES[margin.parameter],
                amount(self.rig, margin.parameter, margin.value),
                f"none down to {low}" if margin.lower is None else amount(self.rig, margin.parameter, margin.lower),
                f"none up to {high}" if margin.upper is None else amount(self.rig, margin.parameter, margin.upper),
            )

    def mitigation_lines(self) -> Iterator[str]:
        """Each mitigation as a sentence."""
        for mitigation in self.mitigations:

            def to(values: tuple[float, ...], names: tuple[str, ...] = mitigation.parameters) -> str:
                return " and ".join(amount(self.rig, name, value) for name, value in zip(names, values, strict=True))

            words = f"{' and '.join(_TITLES[name] for name in mitigation.parameters)}: from {to(mitigation.values)}"
            if mitigation.keeps is not None:
                words += f" to {to(mitigation.keeps)}, and smooth sliding, once reached, stays"
                words += "; on" if mitigation.stops is not None else ""
            if mitigation.stops is not None:
                words += f" to {to(mitigation.stops)}, and {self._trouble()} decays even from rest"
            elif mitigation.keeps is not None:
                words += "; from rest, no value was found at which it decays"
            yield words

    @property
    def where(self) -> str:
        """At which of several speeds changes were tried, in words; nothing for a rig that works at one."""
        several = self.between is not None or len(self.at_speeds) > 1
        return f" at {self._said(self.rig.velocity, 'velocity')}" if several else ""

    def attempt_lines(self) -> Iterator[str]:
        """How far each parameter goes that does not give smooth sliding within the range searched."""
        for each in self.attempts:
            name, now, reached = each.parameter, each.value, each.reached
            way = "up" if reached > now else "down"
            after = (
                f"{100 * each.amplitude:.0f} % of static friction peak to peak, now {100 * each.amplitude_before:.0f} %"
            )
            there = f"{way} to {amount(self.rig, name, reached)}"
            if each.kind == "smooth sliding":  # an oscillation too small to be seen
                yield f"{_TITLES[name]}: {there} smooth sliding is not stable, but what is left is slight ({after})"
                continue
            better = "better" if each.amplitude < 0.9 * each.amplitude_before else "no better"
            yield f"{_TITLES[name]}: no smooth sliding found {there}; there it is {better} ({each.kind}, {after})"

    def search_note(self) -> str:
        """What was not looked for, or nothing."""
        if not self.not_searched:
            return ""
        return f"not searched to the end, as runs of this rig take long: {', '.join(self.not_searched)}"

    def _trouble(self) -> str:
        return "the oscillation" if self.regime.kind == "sustained oscillation" else "stick-slip"

    def measure_note(self) -> str:
        """How to measure what is missing, where there is no verdict."""
        return (
            "give interface.delay (pull at several speeds: where the friction has fallen to half of its slow value, "
            "the speed times the delay is the breaking displacement) or interface.ageing (hold for a while, then pull: "
            "how the static peak grows with the time of rest)"
        )

    def __str__(self) -> str:
        lines = [f"{self.rig.name}: {self.verdict}"]
        if not self.judged:
            return "\n".join([*lines, self.measure_note()])
        advice = [f"- {line}" for line in (*self.mitigation_lines(), *self.attempt_lines())]
        if advice and self.where:
            lines.append(f"what would stop it{self.where}:")
        return "\n".join([*lines, *advice])

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in self.numbers()
        )
        lines = (*self.mitigation_lines(), *self.attempt_lines())
        items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
        items = f"<ul>{items}</ul>" if items else ""
        return f"<p><b>{html.escape(self.rig.name)}</b>: {html.escape(self.verdict)}</p><table>{rows}</table>{items}"

    def plot(self) -> Figure:
        """Draw the answer: the motion at each speed, the force at the rig's speed, and the margins."""
        from stickslip import plot

        return plot.prediction(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers, texts and lists, as JSON takes them; what is not finite is None."""
        kept = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("rig", "recording")}
        names = [
            "velocity",
            "at_speeds",
            "stiffness_margin",
            "smooth",
            "bistable",
            "frequency",
            "amplitude",
            "relative_amplitude",
        ]
        mine = {name: getattr(self if hasattr(self, name) else self.rig, name) for name in names}
        units = {p.name: self.rig.unit_name(p.unit) for p in (*PARAMETERS, *UNITS_OF_A_RIG)}
        units |= {"force": self.rig.unit_name("f_s"), "frequency": self._frequency_unit()}
        own = {"rig": self.rig.name, "verdict": self.verdict, "units": units, **mine, **kept}
        found: dict[str, Any] = plain(own | {"assumed": {key: str(item) for key, item in self.rig.assumed.items()}})
        return found

    def _said(self, value: float, kind: Quantity, digits: int = 4) -> str:
        """Return a value in the rig's units with a prefix."""
        natural = value / self.rig.unit(_NATURAL[kind])
        if digits < 4:
            natural = float(f"{natural:.{digits}g}") if self.rig.scales is None else natural
        said = self.rig.in_units(natural, kind)
        head, _, rest = said.partition(" ")
        try:
            return f"{float(f'{float(head):.{digits}g}'):g} {rest}".rstrip()
        except ValueError:
            return said

    def _frequency(self, value: float | None) -> str:
        if value is None:
            return ""
        unit = self._frequency_unit()
        if unit == "Hz" and value >= 1e3:
            return f"{value / 1e3:.3g} kHz"
        if unit == "Hz" and value < 0.1:
            return f"{value * 1e3:.3g} mHz"
        return f"{value:.3g} {unit}"

    def _frequency_unit(self) -> str:
        return "Hz" if self.rig.scales is not None else "cycles per time unit"


_NATURAL: dict[Quantity, str] = {
    "force": "f_s",
    "length": "x_s",
    "time": "time",
    "velocity": "x_s/time",
    "stiffness": "k",
}


def amount(rig: Rig, parameter: str, value: float) -> str:
    """Say a parameter's value, in the rig's own units, in words; a standard deviation as a fraction of the mean."""
    if parameter == "std":
        return f"{value:.3g}"
    known = parameter_named(parameter)
    return rig.in_units(value / rig.unit(known.unit), quantity(known.unit))
