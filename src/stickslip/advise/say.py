"""Every sentence that a prediction says: its verdict, the numbers behind it, margins, and what was tried."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from stickslip.advise.runs import SEEDS
from stickslip.advise.speeds import MOTIONS, Band, joined
from stickslip.elastic.precursors import distance_to_the_first_break
from stickslip.model import OnArrest, Slider
from stickslip.model.parameters import parameter_named
from stickslip.model.rig import Rig
from stickslip.words import engineering, number

if TYPE_CHECKING:
    from stickslip.advise.answer import Prediction
    from stickslip.advise.elastic import ElasticPrediction, WaveAnswer

_DRAG = 0.05
"""Part of the kinetic friction from which on the drag of the damping is told (a convention)."""
TO_MEASURE = (
    "give interface.delay (pull at several speeds: where the friction has fallen to half of its slow value, the speed "
    "times the delay is the breaking displacement) or interface.ageing (hold for a while, then pull: how the static "
    "peak grows with the time of rest)"
)
"""How to measure what is missing, where there is no verdict."""


# ---------------------------------------------------------------------------------------------------------------------
# Quantities
# ---------------------------------------------------------------------------------------------------------------------


def quantity(rig: Rig, value: float, unit: str, digits: int = 4) -> str:
    """A value in the rig's own units, with its prefix."""
    return rig.in_units(value / rig.unit(unit), unit, digits)


def amount(rig: Rig, parameter: str, value: float) -> str:
    """Say a parameter's value, in the rig's own units, in words; a standard deviation as a fraction of the mean."""
    return f"{value:.3g}" if parameter == "std" else quantity(rig, value, parameter_named(parameter).unit)


def frequency_unit(rig: Rig) -> str:
    """Unit of a frequency in the rig's own units."""
    return "Hz" if rig.scales is not None else "cycles per time unit"


def rate(rig: Rig, value: float) -> str:
    """A growth rate with its unit."""
    return f"{number(value)} {rig.unit_name('1/time').replace('1/time', 'per time unit')}"


def _speed(rig: Rig, value: float) -> str:
    return quantity(rig, value, "velocity", 3)


def _span(rig: Rig, low: float, high: float, low_found: bool, high_found: bool) -> str:
    """Two speeds; an end that is no limit, such as one of the search, says so."""
    first, last = _speed(rig, low), _speed(rig, high)
    one, other = first.split(" ", 1), last.split(" ", 1)
    if low_found and one[1:] == other[1:]:
        first = one[0]
    return first + ("" if low_found else " (or less)") + f" to {last}" + ("" if high_found else " (or more)")


# ---------------------------------------------------------------------------------------------------------------------
# The verdict
# ---------------------------------------------------------------------------------------------------------------------


def verdict(found: Prediction) -> str:
    """The answer in one sentence."""
    rig, parts = found.rig, [headline(found)]
    if found.judged:
        parts += [_at_which_speeds(found), *_not_known(found)]
        others = [pair for pair in found.at_speeds if pair[0] != rig.velocity]
        parts += [f"at {_speed(rig, other)}: {kind}" for other, kind in others]
        parts += [] if found.between is None else [_over_its_range(found, *found.between)]
    return "; ".join(part for part in parts if part)


def headline(found: Prediction) -> str:
    """What the rig does at its own speed."""
    rig = found.rig
    if found.judged:
        return f"at {quantity(rig, rig.velocity, 'velocity')}: {_here(found)}"
    words = []
    for band in found.delays:
        what = MOTIONS[band.kind] + (", so stick-slip or oscillation" if band.kind == "unstable" else "")
        words.append(f"{what} from {quantity(rig, band.low, 'time')} to {quantity(rig, band.high, 'time')}")
    return (
        "cannot be judged: nothing says how contacts strengthen with rest; with a delay of re-attachment it would be, "
        f"at this speed, {', '.join(words)}"
    )


def _here(found: Prediction) -> str:
    kind, seen = found.regime.kind, found.regime
    contacts = f"{getattr(found.recording.rig.method, 'count', 'its')} contacts"
    if found.noise is not None:
        return f"smooth sliding; the force fluctuates by {100 * found.noise:.2g} % rms, noise of {contacts}"
    if kind == "undecided":
        theory = {None: "", 0: "; linearly stable"}.get(found.unstable_modes, "; smooth sliding is linearly unstable")
        return f"undecided, {seen.reason}{theory}"
    if kind == "smooth sliding" and found.unstable_modes:
        grows = "the instability grows slowly, or is hidden by the noise of"
        return f"linearly unstable, but smooth in this run: {grows} {contacts}"
    if kind == "smooth sliding":
        return str(kind)
    unit = frequency_unit(found.rig)
    frequency = "" if found.frequency is None else f", {engineering(found.frequency, unit, 3)}"
    here = (
        f"{kind}{frequency}, force ±{quantity(found.rig, found.amplitude, 'force', 3)} "
        f"({100 * found.relative_amplitude:.0f} % of static friction peak to peak)"
    )
    if found.bistable:
        return f"{here} from this start, although smooth sliding, once reached, is linearly stable: bistable"
    if found.unstable_modes == 0:
        return f"{here}; no mode grows, but {contacts} leave smooth sliding by their noise"
    return here


def _spans(found: Prediction) -> list[Band]:
    """Bands whose ends were looked for: what was seen at one speed only is no range, and theory has the word."""

    def by_theory(band: Band) -> Band:
        if not band.single:
            return band
        stable = band.bistable or band.kind == "smooth sliding"
        kind = "unknown" if found.theory_note else "stable" if stable else "unstable"
        return replace(band, kind=kind, bistable=False)

    return joined([by_theory(band) for band in found.bands])


def _at_which_speeds(found: Prediction) -> str:
    """Ranges of speed with oscillation, those that only starts at rest reach, and single speeds."""
    rig, (low, high) = found.rig, found.speeds_searched
    words = []
    for band in _spans(found):
        if band.kind not in ("smooth sliding", "stable", "unknown"):
            ends = band.low_found and band.low > low, band.high_found and band.high < high
            start = " if started from rest" if band.bistable else ""
            words.append(f"{MOTIONS[band.kind]} from {_span(rig, band.low, band.high, *ends)}{start}")
    for band in found.bands:
        middle = math.sqrt(band.low * band.high)
        if band.single and not math.isclose(middle, rig.velocity, rel_tol=1e-6):
            words.append(f"{band.kind} seen at {_speed(rig, middle)} only")
    words += [found.theory_note] if found.theory_note else []
    known = [band for band in found.bands if band.kind != "unknown"]
    if not words and known:
        simulated = found.complete and all(band.kind != "stable" for band in known)
        kind = "smooth sliding" if simulated else "linearly stable"
        words.append(f"{kind} at all speeds from {_within(found, known[0].low, known[-1].high)}")
    return ", ".join(words)


def _within(found: Prediction | ElasticPrediction, low: float, high: float) -> str:
    """A range of speeds, whose ends are limits unless they are those of the search."""
    first, last = found.speeds_searched
    return _span(found.rig, low, high, low > first, high < last)


def _not_known(found: Prediction) -> Iterator[str]:
    """Where starts at rest were not judged, but for a fast answer, and where not even linear theory can tell."""

    def where(kind: str) -> str:
        spans = [band for band in _spans(found) if band.kind == kind]
        return " and ".join(f"from {_within(found, band.low, band.high)}" for band in spans)

    if found.complete and (stable := where("stable")):
        yield f"linearly stable {stable} (starts from rest not judged)"
    if not found.theory_note and (unknown := where("unknown")):
        yield f"{unknown} linear theory cannot tell"


def _over_its_range(found: Prediction, low: float, high: float) -> str:
    """The motion over the range of speeds at which the rig works, were each of them to last."""
    rig, parts = found.rig, list[tuple[float, str]]()
    for band in _spans(found):
        if band.high > low and band.low < high and (not parts or parts[-1][1] != band.motion):
            parts.append((max(low, band.low), band.motion))
    words = [f"{motion} from {_speed(rig, begin)}" for begin, motion in parts]
    if len(parts) == 1:
        words = [f"{parts[0][1]} throughout"]
    whose = "over its range" if rig.operation.between is not None else "along its drive"
    return f"{whose}, {_speed(rig, low)} to {_speed(rig, high)}: {', '.join(words) or 'undecided'}"


# ---------------------------------------------------------------------------------------------------------------------
# What it rests on
# ---------------------------------------------------------------------------------------------------------------------


def numbers(found: Prediction) -> Iterator[tuple[str, str]]:
    """Names and values, with units, of the quantities behind the verdict."""
    rig = found.rig
    aged = ", thresholds fully aged" if rig.interface.ageing is not None else ""
    aged += ", no contact broken by heat" if rig.interface.temperature is not None else ""
    yield "total contact strength N f_s", rig.in_units(1.0, "force")
    yield f"static friction F_s (slow rigid motion{aged})", quantity(rig, found.static_friction, "force")
    yield "kinetic friction F_k at this speed", quantity(rig, found.kinetic_friction, "force")
    if isinstance(rig.slider, Slider):
        drag = rig.slider.mass * rig.slider.damping * rig.natural.velocity * rig.unit("force")
        if drag > _DRAG * found.kinetic_friction:
            yield (
                "drag of the damping at this speed, M eta v",
                f"{quantity(rig, drag, 'force')}, part of the spring force",
            )
    yield "stiffness K of the driving spring", quantity(rig, rig.value("stiffness"), "stiffness")
    critical = (found.critical_stiffness, found.critical_stiffness_without_reattachment)
    with_it, without = (quantity(rig, each, "stiffness") for each in critical)
    yield f"critical stiffness K* (first pull{aged})", f"{with_it} ({without} without re-attachment)"
    weaker = "softer: elastic instability" if found.stiffness_margin < 1 else "stiffer: no elastic instability"
    yield "margin K/K*", f"{found.stiffness_margin:.3g} ({weaker})"
    state = f"unstable, {found.unstable_modes} growing modes" if found.unstable_modes else "stable"
    if found.growth_rate is not None:
        often = found.mode_frequency
        oscillation = f" at {engineering(often, frequency_unit(rig), 3)}" if often else ", non-oscillatory"
        state += f"; fastest mode: growth rate {rate(rig, found.growth_rate)}{oscillation}"
    yield "linear stability of smooth sliding", found.theory_note or state


def margins(found: Prediction) -> Iterator[tuple[str, str, str, str]]:
    """Parameter, value and stability limits, in words."""
    for margin in found.margins:

        def said(value: float, name: str = margin.parameter) -> str:
            return amount(found.rig, name, value)

        low, high = margin.searched
        yield (
            parameter_named(margin.parameter).title,
            said(margin.value),
            f"none down to {said(low)}" if margin.lower is None else said(margin.lower),
            f"none up to {said(high)}" if margin.upper is None else said(margin.upper),
        )


# ---------------------------------------------------------------------------------------------------------------------
# What would stop it
# ---------------------------------------------------------------------------------------------------------------------


def mitigations(found: Prediction) -> Iterator[str]:
    """Each mitigation as a sentence."""
    slider = found.rig.natural.slider
    for mitigation in found.mitigations:

        def to(values: tuple[float, ...], names: tuple[str, ...] = mitigation.parameters) -> str:
            said = " and ".join(amount(found.rig, name, value) for name, value in zip(names, values, strict=True))
            if names == ("damping",):
                said += f" (damping ratio {values[0] / found.rig.unit('1/time') / (2.0 * slider.frequency):.3g})"
            return said

        titles = " and ".join(parameter_named(name).title for name in mitigation.parameters)
        words = f"{titles}: from {to(mitigation.values)}"
        if mitigation.keeps is not None:
            words += f" to {to(mitigation.keeps)}, and smooth sliding, once reached, stays"
            words += "; on" if mitigation.stops is not None else "; from rest, no value was found at which it decays"
        if mitigation.stops is not None:
            words += f" to {to(mitigation.stops)}, and {_trouble(found)} decays even from rest"
        yield words


_CHANGES = {
    "stiffness": ("a stiffer spring", "a softer spring"),
    "velocity": ("faster", "slower"),
    "mass": ("a heavier slider", "a lighter slider"),
    "damping": ("more damping", "less damping"),
    "delay": ("slower re-attachment", "faster re-attachment"),
    "std": ("more scattered thresholds", "less scattered thresholds"),
    "ageing": ("slower ageing", "faster ageing"),
    "contact_stiffness": ("stiffer contacts", "softer contacts"),
    "normal_load": ("more load", "less load"),
}
_FRACTIONS = ((0.2, "a fifth"), (0.25, "a quarter"), (1 / 3, "a third"), (0.5, "half"), (2 / 3, "two thirds"))


def change(names: tuple[str, ...], before: tuple[float, ...], after: tuple[float, ...]) -> str:
    """A change of parameters, as one would say it: "a softer spring, by a third"."""
    parts = []
    for name, old, new in zip(names, before, after, strict=True):
        more, less = _CHANGES.get(name, (f"more {name}", f"less {name}"))
        parts.append(f"{more if new > old else less}, {_by(new / old)}")
    return " and ".join(parts)


def _by(ratio: float) -> str:
    """How far, in words."""
    if ratio >= 1.95:
        return f"{ratio:.2g} times"
    if ratio <= 1 / 2.1:
        return f"1/{1 / ratio:.2g} of it"
    change = abs(ratio - 1.0)
    nearest, words = min(_FRACTIONS, key=lambda part: abs(part[0] - change))
    return f"by {words}" if abs(nearest - change) < 0.02 else f"by {100 * change:.2g} %"


def _trouble(found: Prediction) -> str:
    if found.regime.kind == "smooth sliding":
        return "the instability"
    return "the oscillation" if found.regime.kind == "sustained oscillation" else "stick-slip"


def attempts(found: Prediction) -> Iterator[str]:
    """How far each parameter goes that does not give smooth sliding within the range searched."""
    for each in found.attempts:
        title = parameter_named(each.parameter).title
        way = "up" if each.reached > each.value else "down"
        there = f"{way} to {amount(found.rig, each.parameter, each.reached)}"
        if each.amplitude is None:
            motion = MOTIONS.get(each.kind, each.kind)
            yield f"{title}: {there} {motion}; not simulated there, as runs take long"
            continue
        now = f"now {100 * each.amplitude_before:.0f} %"
        after = f"{100 * each.amplitude:.0f} % of static friction peak to peak, {now}"
        if each.kind == "smooth sliding":  # an oscillation too small to be seen
            yield f"{title}: {there} still unstable, but the remaining oscillation is small ({after})"
            continue
        if each.kind == "smooth in one run":
            yield f"{title}: {there} {each.kind} ({after}), but not found to be in {SEEDS} of {SEEDS}"
            continue
        better = "better" if each.amplitude < 0.9 * each.amplitude_before else "no better"
        yield f"{title}: no smooth sliding found {there}; there it is {better} ({each.kind}, {after})"


def not_searched(found: Prediction) -> Iterator[str]:
    """What was not looked for, and why."""
    if found.not_searched:
        yield f"not searched to the end, as runs of this rig take long: {', '.join(found.not_searched)}"
    elif found.complete and found.ill and not (found.mitigations or found.attempts):
        yield "no change was tried: nothing that could be turned may be varied (feasible)"
    if found.complete and found.ill and isinstance(found.rig.interface.delay, OnArrest):
        if any(mitigation.stops for mitigation in found.mitigations):
            yield "where stick-slip decays the slider never stops, so that it slides with no contact attached"
        yield "damping was not varied: enough of it keeps any slider from stopping, and contacts from re-attaching"


def where(found: Prediction) -> str:
    """At which of several speeds changes were tried, in words; nothing for a rig that works at one."""
    several = found.between is not None or len(found.at_speeds) > 1
    return f" at {quantity(found.rig, found.rig.velocity, 'velocity')}" if several else ""


def advice(found: Prediction) -> list[str]:
    """All that was found, tried and left out, a sentence each."""
    return [*mitigations(found), *attempts(found), *not_searched(found)]


def text(found: Prediction) -> str:
    """The short text that a prediction prints as."""
    lines = [f"{found.rig.name}: {verdict(found)}"]
    if not found.judged:
        return "\n".join([*lines, TO_MEASURE])
    told = [f"- {line}" for line in advice(found)]
    if told and where(found):
        lines.append(f"what would stop it{where(found)}:")
    return "\n".join([*lines, *told])


# ---------------------------------------------------------------------------------------------------------------------
# Elastic sliders
# ---------------------------------------------------------------------------------------------------------------------


def verdict_on_waves(found: ElasticPrediction) -> str:
    """The answer of linear theory in one sentence."""
    rig, (low, high) = found.rig, found.speeds_searched
    if found.theory_note:
        return f"undecided: {found.theory_note}"
    spans = " and ".join(f"from {_within(found, *pair)}" for pair in found.speeds)
    all_speeds = f"linearly stable at all speeds from {_span(rig, low, high, False, False)}"
    where = f"linearly unstable, so stick-slip or oscillation, {spans}" if spans else all_speeds
    here = "smooth sliding is linearly stable at every wavelength"
    if found.growing:
        first = max(found.waves, key=lambda wave: wave.growth if wave.growth is not None else -math.inf)
        several = found.growing > 1
        count = f"{found.growing}{' or more' if found.at_least else ''} mode{'s' * several}"
        here = f"{count} of smooth sliding grow{'s' * (not several)}, fastest: {first.name}"
    return f"{where}; at {_speed(rig, rig.velocity)}: {here}"


def waves(found: ElasticPrediction) -> Iterator[str]:
    """Each wave in words, the critical length, and where the first contacts break."""
    rig = found.rig
    yield from (_wave(found, wave) for wave in found.waves)
    if found.critical is not None:
        stiffness = quantity(rig, found.critical.stiffness, "stiffness")
        yield f"critical stiffness {stiffness} at this speed: {found.critical}"
    if (distance := distance_to_the_first_break(rig)) is not None:
        what = "slip precursors start" if rig.slider.side > 0 else "blocks break loose"
        yield f"from rest, {what} when the drive has gone about {rig.in_units(distance, 'length', 3)}"


def _wave(found: ElasticPrediction, wave: WaveAnswer) -> str:
    rig, decay = found.rig, "no exponential decay"
    if wave.growth is not None and wave.frequency is not None:
        decay = f"{'growth' if wave.growth > 0 else 'decay'} rate {rate(rig, abs(wave.growth))}"
        often = engineering(wave.frequency, frequency_unit(rig))
        decay += f" at {often}" if wave.frequency else ", non-oscillatory"
    spans = " and ".join(f"from {_within(found, *pair)}" for pair in wave.speeds)
    speeds = f"unstable {spans}" if spans else "stable at all speeds"
    return f"{wave.name} (stiffness {quantity(rig, wave.stiffness, 'stiffness')}): {decay}; {speeds}"
