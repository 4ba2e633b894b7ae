"""What is predicted for a rig, and how it is said."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from stickslip.advise.mitigations import Attempt, Mitigation
from stickslip.advise.speeds import Band, joined
from stickslip.answers import Answer, plain
from stickslip.measure import Regime
from stickslip.model import Slider
from stickslip.model.parameters import PARAMETERS, UNITS_OF_A_RIG, parameter_named
from stickslip.model.rig import Rig
from stickslip.model.units import Quantity, quantity
from stickslip.simulation import Recording

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_TITLES = {parameter.name: parameter.title for parameter in (*PARAMETERS, *UNITS_OF_A_RIG)}
_OSCILLATES = ("stick-slip", "sustained oscillation")
_DRAG = 0.05
"""Part of the kinetic friction from which on the drag of the damping is told (a convention)."""
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
        """Whether smooth sliding is stable, and stays, although the run from rest shows sustained stick-slip."""
        return self.judged and self.unstable_modes == 0 and self.regime.kind in _OSCILLATES and self.stays

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
    def headline(self) -> str:
        """What the rig does at its own speed."""
        if not self.judged:
            return f"cannot be judged: nothing says how contacts strengthen with rest; {self._by_delay()}"
        return f"at {self._said(self.rig.velocity, 'velocity')}: {self._here()}"

    @property
    def verdict(self) -> str:
        """The answer in one sentence."""
        if not self.judged:
            return self.headline
        parts = [self.headline, self._at_which_speeds(), *self._not_known()]
        others = [pair for pair in self.at_speeds if pair[0] != self.rig.velocity]
        parts += [f"at {self._speed(other)}: {kind}" for other, kind in others]
        if self.between is not None:
            parts.append(self._over_its_range(*self.between))
        return "; ".join(part for part in parts if part)

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
        for band in self._spans():
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
        if self.noise is not None:
            return f"smooth sliding; the force fluctuates by {100 * self.noise:.2g} % rms, noise of {self._contacts()}"
        if kind == "undecided":
            theory = {None: "", 0: "; linearly stable"}.get(
                self.unstable_modes, "; smooth sliding is linearly unstable"
            )
            return f"undecided, {self.regime.reason}{theory}"
        if kind == "smooth sliding":
            if self.unstable_modes:
                return (
                    "linearly unstable, but smooth in this run: the instability grows slowly, or is hidden by the "
                    f"noise of {self._contacts()}"
                )
            return str(kind)
        frequency = "" if self.frequency is None else f", {self._frequency(self.frequency)}"
        here = (
            f"{kind}{frequency}, force ±{self._said(self.amplitude, 'force', digits=3)} "
            f"({100 * self.relative_amplitude:.0f} % of static friction peak to peak)"
        )
        if self.bistable:
            here += " from this start, although smooth sliding, once reached, is linearly stable: bistable"
        elif self.unstable_modes == 0:
            here += f"; no mode grows, but {self._contacts()} leave smooth sliding by their noise"
        return here

    def _contacts(self) -> str:
        return f"{getattr(self.recording.rig.method, 'count', 'its')} contacts"

    def _spans(self) -> list[Band]:
        """Bands whose ends were looked for: what was seen at one speed only is no range, and theory has the word."""

        def by_theory(band: Band) -> Band:
            if not band.single:
                return band
            stable = band.bistable or band.kind == "smooth sliding"
            kind = "unknown" if self.theory_note else "stable" if stable else "unstable"
            return replace(band, kind=kind, bistable=False)

        return joined([by_theory(band) for band in self.bands])

    def _at_which_speeds(self) -> str:
        """Ranges of speed with oscillation, those that only starts at rest reach, and single speeds."""
        spans = self._spans()
        words = [self._band(band) for band in spans if band.kind not in ("smooth sliding", "stable", "unknown")]
        for band in self.bands:
            middle = math.sqrt(band.low * band.high)
            if band.single and not math.isclose(middle, self.rig.velocity, rel_tol=1e-6):
                words.append(f"{band.kind} seen at {self._speed(middle)} only")
        if self.theory_note:
            words.append(self.theory_note)
        known = [band for band in self.bands if band.kind != "unknown"]
        if not words and known:
            simulated = self.complete and all(band.kind != "stable" for band in known)
            kind = "smooth sliding" if simulated else "linearly stable"
            words.append(f"{kind} at all speeds from {self._span(known[0].low, known[-1].high)}")
        return ", ".join(words)

    def _band(self, band: Band) -> str:
        start = " if started from rest" if band.bistable else ""
        return f"{_KINDS.get(band.kind, band.kind)} from {self._span_of(band)}{start}"

    def _not_known(self) -> Iterator[str]:
        """Where starts at rest were not judged, but for a fast answer, and where not even linear theory can tell."""
        if self.complete and (where := self._where("stable")):
            yield f"linearly stable {where} (starts from rest not judged)"
        if not self.theory_note and (where := self._where("unknown")):
            yield f"{where} linear theory cannot tell"

    def _where(self, kind: str) -> str:
        spans = [band for band in self._spans() if band.kind == kind]
        return " and ".join(f"from {self._span(band.low, band.high)}" for band in spans)

    def _span_of(self, band: Band) -> str:
        """A range of speeds; an end that was not looked for is none of the motion."""
        low, high = self.speeds_searched
        return self._span(band.low, band.high, band.low_found and band.low > low, band.high_found and band.high < high)

    def _span(self, low: float, high: float, low_found: bool | None = None, high_found: bool | None = None) -> str:
        """Two speeds; an end that is no limit, such as one of the search, says so."""
        low_found = low > self.speeds_searched[0] if low_found is None else low_found
        high_found = high < self.speeds_searched[1] if high_found is None else high_found
        first, last = self._speed(low), self._speed(high)
        one, other = (text.split(" ", 1) for text in (first, last))
        if len(one) == len(other) == 2 and one[1] == other[1] and low_found:
            first = one[0]
        return first + ("" if low_found else " (or less)") + f" to {last}" + ("" if high_found else " (or more)")

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
        if (drag := self._drag()) > _DRAG * self.kinetic_friction:
            yield "drag of the damping at this speed, M eta v", f"{self._said(drag, 'force')}, part of the spring force"
        yield "stiffness K of the driving spring", self._said(rig.value("stiffness"), "stiffness")
        without = self._said(self.critical_stiffness_without_reattachment, "stiffness")
        yield (
            f"critical stiffness K* (first pull{aged})",
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

    def _drag(self) -> float:
        slider, setting = self.rig.natural.slider, self.rig.natural
        if not isinstance(slider, Slider):
            return 0.0
        return slider.mass * slider.damping * setting.velocity * self.rig.unit("f_s")

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
                said = " and ".join(amount(self.rig, name, value) for name, value in zip(names, values, strict=True))
                return said + (
                    f" (damping ratio {self._damping_ratio(values[0]):.3g})" if names == ("damping",) else ""
                )

            words = f"{' and '.join(_TITLES[name] for name in mitigation.parameters)}: from {to(mitigation.values)}"
            if mitigation.keeps is not None:
                words += f" to {to(mitigation.keeps)}, and smooth sliding, once reached, stays"
                words += "; on" if mitigation.stops is not None else ""
            if mitigation.stops is not None:
                words += f" to {to(mitigation.stops)}, and {self._trouble()} decays even from rest"
            elif mitigation.keeps is not None:
                words += "; from rest, no value was found at which it decays"
            yield words

    def _damping_ratio(self, damping: float) -> float:
        return float(damping / self.rig.unit("1/time") / (2.0 * self.rig.natural.slider.frequency))

    @property
    def where(self) -> str:
        """At which of several speeds changes were tried, in words; nothing for a rig that works at one."""
        several = self.between is not None or len(self.at_speeds) > 1
        return f" at {self._said(self.rig.velocity, 'velocity')}" if several else ""

    def attempt_lines(self) -> Iterator[str]:
        """How far each parameter goes that does not give smooth sliding within the range searched."""
        for each in self.attempts:
            name, now, reached = each.parameter, each.value, each.reached
            there = f"{'up' if reached > now else 'down'} to {amount(self.rig, name, reached)}"
            if each.amplitude is None:
                theory = _KINDS.get(each.kind, each.kind)
                yield f"{_TITLES[name]}: {there} {theory}; not simulated there, as runs take long"
                continue
            after = (
                f"{100 * each.amplitude:.0f} % of static friction peak to peak, now {100 * each.amplitude_before:.0f} %"
            )
            if each.kind == "smooth sliding":  # an oscillation too small to be seen
                yield f"{_TITLES[name]}: {there} still unstable, but the remaining oscillation is small ({after})"
                continue
            better = "better" if each.amplitude < 0.9 * each.amplitude_before else "no better"
            yield f"{_TITLES[name]}: no smooth sliding found {there}; there it is {better} ({each.kind}, {after})"

    def search_note(self) -> str:
        """What was not looked for, or nothing."""
        if self.not_searched:
            return f"not searched to the end, as runs of this rig take long: {', '.join(self.not_searched)}"
        if not (self.complete and self.ill) or self.mitigations or self.attempts:
            return ""
        if self.theory_note:
            return "no change was tried: the search starts where linear theory says that smooth sliding is stable"
        return "no change was tried: nothing that could be turned may be varied (feasible)"

    def _trouble(self) -> str:
        if self.regime.kind == "smooth sliding":
            return "the instability"
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
        note = [self.search_note()] if self.search_note() else []
        advice = [f"- {line}" for line in (*self.mitigation_lines(), *self.attempt_lines(), *note)]
        if advice and self.where:
            lines.append(f"what would stop it{self.where}:")
        return "\n".join([*lines, *advice])

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in self.numbers()
        )
        lines = [*self.mitigation_lines(), *self.attempt_lines(), self.search_note()]
        items = "".join(f"<li>{html.escape(line)}</li>" for line in lines if line)
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
