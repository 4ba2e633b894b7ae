"""What is predicted for a rig, and how it is put together: the verdict first, then speeds, margins and mitigations."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from stickslip import stability
from stickslip.advise import mitigations as changes
from stickslip.advise import speeds
from stickslip.advise.elastic import ElasticPrediction, predict_waves
from stickslip.advise.judging import Budget, at_speed, cost_of, cycle_of, length_of
from stickslip.advise.linear import stable_ranges
from stickslip.advise.mitigations import Attempt, Mitigation
from stickslip.advise.speeds import Band
from stickslip.answers import Answer, plain
from stickslip.errors import InputError, UndecidedError, instance
from stickslip.measure import Regime, regime
from stickslip.model import Delay, ElasticBody
from stickslip.model.drive import constant
from stickslip.model.parameters import DELAY, PARAMETERS, UNITS_OF_A_RIG, Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.model.units import Quantity, quantity
from stickslip.progress import Progress, reporting
from stickslip.rigid import critical_stiffness, static_friction
from stickslip.simulation import simulate
from stickslip.theory import kinetic_friction

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_FIRST, _ALL, _FOR_SPEEDS = 1.3, 4.6, 0.3
"""Seconds, by estimate, for the first run and for all runs; the part of what is then left that goes to other speeds."""
_AGED = 10.0
"""How much more thresholds that age may take, whose runs cost a hundred times as much."""
_FEWEST_CYCLES = 3.3
"""The first run lasts for so many, by their longest, whatever that takes; most are shorter."""
_EXTENSIONS = 2
"""How often a run that cannot be judged is made twice as long."""
_RANGE, _AGED_RANGE = 30.0, 10.0
"""Margins are looked for within this factor on either side of a parameter's value."""
_DELAYS = (0.01, 10.0)
"""Delays tried where a rig names no mechanism, in breaking displacements over the speed."""

_TITLES = {parameter.name: parameter.title for parameter in (*PARAMETERS, *UNITS_OF_A_RIG)}
_OSCILLATES = ("stick-slip", "sustained oscillation")
_KINDS = {"unstable": "linearly unstable"}
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
    """

    parameter: str
    value: float
    lower: float | None
    upper: float | None
    searched: tuple[float, float]


@dataclass(frozen=True, kw_only=True, repr=False)
class Prediction(Answer):
    """What `predict` found; every number in the rig's own units. It prints as its short text.

    Attributes
    ----------
    run : Dataset
        The simulated run that `regime` is of.
    regime : Regime
        Of the run, with its evidence.
    static_friction, kinetic_friction : float
        Largest force in slow rigid motion, and mean force of steady sliding at the rig's speed.
    critical_stiffness, critical_stiffness_without_reattachment : float
        ``K*`` of Eq. (8) in both conventions. Where thresholds age, these and the static friction are those of contacts
        whose thresholds have fully grown and do not change during the motion.
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
    run: xr.Dataset
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
        parts = [self._at_which_speeds()]
        if self.regime.kind in _OSCILLATES:
            if self.frequency is not None:
                parts[0] += f", {self._frequency(self.frequency)}"
            parts[0] += (
                f", force ±{self._said(self.amplitude, 'force', digits=3)} ({100 * self.relative_amplitude:.0f} % of "
            )
            parts[0] += "static friction peak to peak)"
        parts.append(f"at {speed}: {self._here()}")
        others = [pair for pair in self.at_speeds if pair[0] != self.rig.velocity]
        parts += [f"at {self._speed(other)}: {kind}" for other, kind in others]
        if self.rig.operation.between is not None:
            parts.append(self._over_its_range())
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

    def _over_its_range(self) -> str:
        """The motion over the range of speeds at which the rig works."""
        size = self.rig.unit("x_s/time")
        low, high = (end * size for end in self.rig.operation.between or ())
        parts: list[tuple[float, str]] = []
        for band, kind in zip(self.bands, self._told([band.kind for band in self.bands]), strict=True):
            if band.high > low and band.low < high:
                kind += " from rest only" if band.bistable else ""
                if not parts or parts[-1][1] != kind:
                    parts.append((max(low, band.low), kind))
        words = [f"{kind} from {self._speed(begin)}" for begin, kind in parts]
        if len(parts) == 1:
            words = [f"{parts[0][1]} throughout"]
        return f"over its range, {self._speed(low)} to {self._speed(high)}: {', '.join(words) or 'undecided'}"

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
        low, high = self.speeds_searched
        rough = [band for band in self.bands if band.kind != "smooth sliding"]
        if not rough:
            if self.theory_note:
                return self.theory_note
            kind = "smooth sliding" if self.complete else "linearly stable"
            return f"{kind} at all speeds from {self._span(low, high)}"
        regions: list[list[Band]] = []
        for band in rough:
            if regions and regions[-1][-1].high == band.low:
                regions[-1].append(band)
            else:
                regions.append([band])
        return " and ".join(self._region(region) for region in regions)

    def _region(self, region: list[Band]) -> str:
        core = [band for band in region if not band.bistable] or region
        begin, end = core[0].low, core[-1].high
        kinds = [band.kind for band in core]
        kinds = self._told(kinds)
        words, at = [], begin
        for i, (kind, band) in enumerate(zip(kinds, core, strict=True)):
            if i + 1 < len(kinds) and kinds[i + 1] == kind:
                continue
            words.append(f"{kind} from {self._span(at, band.high)}")
            at = band.high
        beyond = []
        if region[0].low < begin:
            beyond.append(f"down to {self._speed(region[0].low)}")
            beyond[-1] += " or less" if region[0].low <= self.speeds_searched[0] else ""
        if region[-1].high > end:
            beyond.append(f"up to {self._speed(region[-1].high)}")
            beyond[-1] += " or more" if region[-1].high >= self.speeds_searched[1] else ""
        rest = f" (from rest also {' and '.join(beyond)})" if beyond else ""
        return ", ".join(words) + rest + (" from rest only" if core[0].bistable else "")

    def _told(self, kinds: list[str]) -> list[str]:
        """Kinds of motion of neighbouring bands; what was not simulated, as runs there take long, is as beside it."""
        seen = [self.regime.kind] if self.regime.kind in _OSCILLATES else ["oscillation"]
        known = next((kind for kind in kinds if kind in _OSCILLATES), seen[0])
        told = []
        for kind in kinds:
            known = kind if kind in _OSCILLATES else known
            told.append(known if kind == "unstable" else kind)
        return told

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
            what = (
                "smooth sliding" if band.kind == "smooth sliding" else "linearly unstable, so stick-slip or oscillation"
            )
            words.append(f"{what} from {self._said(band.low, 'time')} to {self._said(band.high, 'time')}")
        return "with a delay of re-attachment it would be, at this speed, " + ", ".join(words)

    # ------------------------------------------------------------------------------------------------------- the parts

    def numbers(self) -> Iterator[tuple[str, str]]:
        """Names and values, with units, of the quantities behind the verdict."""
        rig = self.rig
        aged = ", thresholds fully aged" if rig.interface.ageing is not None else ""
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

    def attempt_lines(self) -> Iterator[str]:
        """How far each parameter goes that does not give smooth sliding within the range searched."""
        for each in self.attempts:
            name, now, reached = each.parameter, each.value, each.reached
            way = "up" if reached > now else "down"
            after = (
                f"{100 * each.amplitude:.0f} % of static friction peak to peak, now {100 * each.amplitude_before:.0f} %"
            )
            better = "better" if each.amplitude < 0.9 * each.amplitude_before else "no better"
            yield (
                f"{_TITLES[name]}: no smooth sliding found {way} to {amount(self.rig, name, reached)}; there it is "
                f"{better} ({each.kind}, {after})"
            )

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
        lines += [f"- {line}" for line in (*self.mitigation_lines(), *self.attempt_lines())]
        return "\n".join(lines)

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
        kept = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("rig", "run")}
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


# ---------------------------------------------------------------------------------------------------------------------
# How it is found
# ---------------------------------------------------------------------------------------------------------------------


def predict(rig: Rig, *, fast: bool = False, progress: Progress | bool | None = None) -> Prediction | ElasticPrediction:
    """Say at which speeds a rig stick-slips, what it does at its own, how safely, and what would stop it.

    Parameters
    ----------
    rig : Rig
    fast : bool
        Stop at the verdict: linear theory, and one run at the rig's speed.
    progress : bool or callable, optional
        True for a bar, or a function that is called with the fraction of the work that is done.

    Returns
    -------
    Prediction
        It prints as a short text, and has ``plot()`` and ``to_dict()``. Every number is in the rig's own units. Of a
        `Chain` or a `Sheet`, `ElasticPrediction`: what linear theory says of each wavelength.

    Raises
    ------
    InputError
        If the rig's speed is not above 0.

    Examples
    --------
    >>> import stickslip as ss
    >>> answer = ss.predict(ss.example("brake_pad"), fast=True)
    >>> answer.regime.kind, answer.unstable_modes
    ('stick-slip', 2)
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive), such as read_rig() returns")
    with reporting(progress, "predict") as report:
        if isinstance(rig.natural.slider, ElasticBody):
            return predict_waves(rig, report)
        found = _verdict(rig, lambda share: report(share if fast else 0.3 * share))
        return found if fast else complete(found, progress=lambda share: report(0.3 + 0.7 * share))


def _verdict(rig: Rig, report: Progress) -> Prediction:
    """Linear theory and one run."""
    setting = rig.natural
    if setting.velocity <= 0:
        raise InputError(f"drive: the speed is {setting.velocity:g}: a prediction needs a speed above 0")
    without = setting.interface.ageing is None and setting.interface.delay.moment(1) == 0
    modes, growth, note = _linear(setting)
    low, high = _range_of_speeds(setting)
    bands: tuple[Band, ...] = ()
    if not note:
        bands = speeds.bands_by_theory(setting, low, high)
    report(0.2)
    run, seen = _watch(rig, lambda share: report(0.2 + 0.8 * share))
    aged = replace(rig.interface, ageing=None)  # rigid motion from contacts at rest finds thresholds that have grown up
    force, stiffness, rate = rig.unit("f_s"), rig.unit("k"), rig.unit("1/time")
    speed = rig.unit("x_s/time")
    return Prediction(
        rig=rig,
        run=run,
        regime=seen,
        static_friction=static_friction(aged)[0] * force,
        kinetic_friction=float(kinetic_friction(rig.interface, setting.velocity)) * force,
        critical_stiffness=critical_stiffness(aged) * stiffness,
        critical_stiffness_without_reattachment=critical_stiffness(aged, reattachment=False) * stiffness,
        unstable_modes=modes,
        growth_rate=None if growth is None else growth.real * rate,
        mode_frequency=None if growth is None else abs(growth.imag) / (2 * math.pi) * rate,
        theory_note=note,
        speeds_searched=(low * speed, high * speed),
        bands=tuple(_scaled(band, speed) for band in bands),
        delays=_over_delays(rig) if without else (),
    )


def complete(found: Prediction, *, progress: Progress | None = None) -> Prediction:
    """Go on from a verdict to what `predict` finds without ``fast``: speeds from rest, margins, mitigations."""
    report = progress or (lambda _share: None)
    rig = found.rig
    setting = _at_its_speed(rig.natural)
    if not found.judged or found.theory_note:
        report(1.0)
        return replace(found, complete=True)
    distance = float(found.run["time"][-1]) / rig.unit("time") * setting.velocity
    spent = min(cost_of(setting, distance, rig.method), 0.7 * _ALL)
    left = (_ALL - spent) * (1.0 if rig.interface.ageing is None else _AGED)
    speed = rig.unit("x_s/time")
    bands = tuple(_scaled(band, 1.0 / speed) for band in found.bands)
    bands = speeds.bands_by_runs(
        setting, bands, found.regime, Budget(_FOR_SPEEDS * left), lambda share: report(0.3 * share)
    )
    found = replace(
        found, bands=tuple(_scaled(band, speed) for band in bands), margins=tuple(_margins(rig)), complete=True
    )
    report(0.4)
    if found.ill:
        found = _with_mitigations(
            found, setting, Budget((1.0 - _FOR_SPEEDS) * left), lambda share: report(0.4 + 0.6 * share)
        )
    report(1.0)
    return found


def _with_mitigations(found: Prediction, setting: Rig, budget: Budget, report: Progress) -> Prediction:
    """Look for changes of one parameter; of two, if none of those that can be turned suffices."""
    rig = found.rig
    search = changes.Search(setting, bool(found.unstable_modes), budget, in_si=rig.scales is not None)
    single = search.single(changes.TURNABLE, lambda share: report(0.5 * share))
    cured = {m.parameters[0] for m in single if m.stops is not None}
    turnable = [parameter.name for parameter, _ in changes.TURNABLE]
    attempts: list[Attempt] = []
    pairs: list[Mitigation] = []
    if not cured & set(turnable):
        tried = list(search.attempts(found.relative_amplitude, found.static_friction / rig.unit("f_s"), cured))
        attempts = [each for each, _ in tried]
        sides = changes.NATURAL_SIDES | {each.parameter: side for each, side in tried}
        report(0.6)
        pairs = search.pairs(sides)
    single += search.single(changes.OTHERS, lambda share: report(0.7 + 0.3 * share))

    def order(mitigation: Mitigation) -> tuple[bool, bool, float]:
        hard = any(name not in turnable for name in mitigation.parameters)
        return hard, mitigation.stops is None, mitigation.size

    helped = {parameter_named(m.parameters[0]).title for m in single if m.stops is not None}
    ranked = sorted([*single, *pairs], key=order)
    return replace(
        found,
        mitigations=tuple(changes.in_units(each, rig) for each in ranked),
        attempts=tuple(_attempt_in_units(each, rig) for each in attempts),
        not_searched=tuple(name for name in dict.fromkeys(search.left_out) if name not in helped),
    )


def _attempt_in_units(attempt: Attempt, rig: Rig) -> Attempt:
    size = rig.unit(parameter_named(attempt.parameter).unit)
    return replace(attempt, value=attempt.value * size, reached=attempt.reached * size)


def _scaled(band: Band, size: float) -> Band:
    return replace(band, low=band.low * size, high=band.high * size)


def _at_its_speed(setting: Rig) -> Rig:
    """The rig in natural units on a drive of constant speed: that of its own drive, if it is so, at the beginning."""
    return at_speed(setting, setting.velocity)


def _range_of_speeds(setting: Rig) -> tuple[float, float]:
    """Speeds that the answer is about: far on either side of those that the drive goes through."""
    through = [abs(v) for piece in setting.drive.pieces for v in (piece.start, piece.end) if v != 0]
    through += [*setting.operation.speeds, *(setting.operation.between or ())]
    widest = speeds.RANGE if setting.interface.ageing is None else speeds.AGED_RANGE
    return min(through) / widest, max(through) * widest


def _watch(rig: Rig, progress: Progress) -> tuple[xr.Dataset, Regime]:
    """Simulate the rig as its file says, shorter if that takes long; longer if it cannot be judged.

    A drive whose last stretch is not of constant speed is replaced by one of constant speed.
    """
    drive, setting = rig.drive, rig.natural
    method = rig.method
    dearer = 1.0 if rig.interface.ageing is None else _AGED
    if drive.pieces[-1].start != drive.pieces[-1].end or drive.pieces[-1].end <= 0:
        drive = constant(setting.velocity, length_of(setting) / setting.velocity)
    if len(drive.pieces) == 1:
        per_time = cost_of(setting, setting.velocity, method) - cost_of(setting, 0.0, method)
        affordable = max(_FIRST * dearer / per_time, _FEWEST_CYCLES * cycle_of(setting) / setting.velocity)
        if drive.duration > affordable:
            drive = constant(setting.velocity, min(drive.duration, affordable))
    left = _FIRST * dearer
    for attempt in range(_EXTENSIONS + 1):
        run = simulate(replace(rig, drive=drive), progress=progress, long=attempt > 0)
        seen = regime(run)
        left -= cost_of(setting, setting.velocity * drive.duration, method)
        if seen.kind != "undecided" or attempt == _EXTENSIONS or left <= 0:
            break
        drive = drive.then(constant(drive.pieces[-1].end, drive.duration))
    return run, seen


def _linear(setting: Rig) -> tuple[int | None, complex | None, str]:
    """Growing modes, the fastest of them, and a note where the theory has nothing to say."""
    interface = setting.interface
    if interface.ageing is None and interface.delay.moment(1) == 0:
        return 0, None, "contacts re-attach at once and do not age: nothing can grow at any speed"
    try:
        modes = stability.count_unstable(setting)
    except (InputError, UndecidedError) as reason:
        return None, None, str(reason)
    try:
        return modes, stability.growth_rate(setting), ""
    except UndecidedError:
        # Stable, and no mode decays more slowly than the tail of the distribution: the count stands alone.
        return modes, None, ""


def _over_delays(rig: Rig) -> tuple[Band, ...]:
    """What the verdict would be with delays between a hundredth and ten times the time to the breaking displacement."""
    setting = rig.natural
    time = setting.interface.threshold_distribution.moment(1) / setting.velocity
    low, high = (factor * time for factor in _DELAYS)
    supposed = replace(setting, interface=replace(setting.interface, delay=Delay(time)))
    stable = stable_ranges(DELAY, supposed, low, high)
    ends = sorted({low, high, *(end for pair in stable for end in pair)})
    size = rig.unit("time")
    found = []
    for a, b in pairwise(ends):
        inside = any(x < math.sqrt(a * b) < y for x, y in stable)
        found.append(Band(kind="smooth sliding" if inside else "unstable", bistable=False, low=a * size, high=b * size))
    return tuple(found)


def _margins(rig: Rig) -> Iterator[Margin]:
    """Look up and down from where each parameter stands for the nearest limit of linear stability."""
    setting = _at_its_speed(rig.natural)
    for parameter in PARAMETERS:
        try:
            value = parameter.get(setting)
        except InputError:  # the rig has no such parameter
            continue
        if value <= 0:
            continue
        low, high = _searched(parameter, value, rig)
        stable = stable_ranges(parameter, setting, low, high)
        edges = {end for pair in stable for end in pair} - {low, high}
        size = rig.unit(parameter.unit)
        lower = max((edge for edge in edges if edge < value), default=None)
        upper = min((edge for edge in edges if edge > value), default=None)
        yield Margin(
            parameter=parameter.name,
            value=value * size,
            lower=None if lower is None else lower * size,
            upper=None if upper is None else upper * size,
            searched=(low * size, high * size),
        )


def _searched(parameter: Parameter, value: float, rig: Rig) -> tuple[float, float]:
    """Range of a parameter in which its margins are looked for, in its natural unit."""
    if parameter.name == "std":  # wider than that is no longer a distribution of thresholds about its mean
        return value / 3.0, max(0.5, 1.5 * value)
    if parameter.name == "delay":  # longer delays never help, and have many modes
        return value / _RANGE, value * 3.0
    widest = _RANGE if rig.interface.ageing is None else _AGED_RANGE
    return value / widest, value * widest
