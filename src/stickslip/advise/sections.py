"""Every sentence that a prediction says: its headline, the numbers behind it,
margins, and what was tried.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

from stickslip.advise.budget import OSCILLATES
from stickslip.advise.findings import SEEN, Findings, WaveFindings, frequency_unit
from stickslip.advise.mitigations import Mitigation, has
from stickslip.advise.survey import MOTIONS, Band
from stickslip.elastic.precursors import distance_to_the_first_break
from stickslip.errors import InputError
from stickslip.model.newborn import half_distance
from stickslip.model.parameters import DELAY, Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.words import engineering, number, percent


class Section(NamedTuple):
    """Sentences of one topic, or rows of a table whose first is its head."""

    name: str
    title: str
    note: str  #: what stands behind the title in its line
    rows: Sequence[str] | Sequence[tuple[str, ...]]


_QUIET = ("smooth sliding", "stable", "unknown")
_BISTABLE = "from this start, although smooth sliding, once reached, is linearly stable"


def quantity(rig: Rig, value: float, unit: str, digits: int = 4) -> str:
    """A value in the rig's own units, with its prefix."""
    return rig.in_units(value / rig.unit(unit), unit, digits)


def amount(rig: Rig, parameter: str, value: float, digits: int = 4) -> str:
    """Return a parameter's value in words, in the rig's own units; a standard
    deviation as a fraction of the mean.
    """
    return (
        number(value, 3)
        if parameter == "std"
        else quantity(rig, value, parameter_named(parameter).unit, digits)
    )


def _speed(rig: Rig, value: float) -> str:
    return quantity(rig, value, "velocity", 3)


def _span(
    found: Findings | WaveFindings,
    low: float,
    high: float,
    low_found: bool = True,
    high_found: bool = True,
) -> str:
    """Two speeds; an end that is no limit, such as one of the search, says so."""
    begin, end = found.speeds_searched
    first = _speed(found.rig, low)
    last = _speed(found.rig, high)
    if not (low_found and low > begin):
        first += " (or less)"
    elif first.partition(" ")[2] == last.partition(" ")[2]:
        first = first.partition(" ")[0]
    return f"from {first} to {last}" + (
        "" if high_found and high < end else " (or more)"
    )


def _mode(rig: Rig, growth: float, frequency: float | None, digits: int) -> str:
    """Rate and frequency of a mode."""
    rate = (
        f"{number(growth)} {rig.unit_name('1/time').replace('1/time', 'per time unit')}"
    )
    return rate + (
        f" at {engineering(frequency, frequency_unit(rig), digits)}"
        if frequency
        else ", non-oscillatory"
    )


class Motion(NamedTuple):
    """A motion: its kind, what follows that in its line, and what else there is to
    say of it.
    """

    kind: str
    rest: str = ""
    more: str = ""

    @property
    def line(self) -> str:
        """The kind and what follows it."""
        return self.kind + self.rest


def headline(found: Findings) -> str:
    """What the rig does at its own speed, in a line, and when it oscillates along a
    drive that starts smoothly.
    """
    line = first_motion(found).line
    if not found.has_verdict or _later_oscillation(found):
        return line
    return _at_own_speed(found, line)


def first_motion(found: Findings) -> Motion:
    """The motion that an answer begins with: at the rig's own speed, or that of a drive
    that starts smoothly.
    """
    motion = _motion(found)
    later = _later_oscillation(found)
    if later is None:
        return motion
    begin = quantity(found.rig, later.low, "time", 3)
    rest = f" from {begin} on; {_at_own_speed(found, motion.line)}"
    return Motion(later.kind, rest, motion.more)


def _at_own_speed(found: Findings, line: str) -> str:
    return f"at {quantity(found.rig, found.rig.velocity, 'velocity')}: {line}"


def _later_oscillation(found: Findings) -> Band | None:
    """The oscillation that begins along a drive, where the rig starts without one."""
    if not found.has_verdict or found.regime.kind in OSCILLATES:
        return None
    bands = (
        band for kind in OSCILLATES for band in found.along_drive if band.kind == kind
    )
    return next(bands, None)


def _motion(found: Findings) -> Motion:
    """The motion at the rig's own speed."""
    kind = str(found.regime.kind)
    modes = found.unstable_modes
    contacts = _contacts(found)
    if not found.has_verdict:
        reason = ": nothing says how contacts strengthen with rest"
        return Motion("cannot be judged", reason, _over_delays(found))
    hidden = f"the oscillation may not yet exceed the noise of {contacts}"
    more = hidden if modes else ""
    if found.noise is not None:
        noise = f"{percent(found.noise)} rms, noise of {contacts}"
        if found.noise > SEEN:
            count = getattr(found.recording.rig.method, "count", math.nan)
            enough = number(count * (found.noise / SEEN) ** 2, 2)  # its variance: 1/N
            more = f"below {percent(SEEN)} from {enough} contacts on"
        return Motion(kind, f"; the force fluctuates by {noise}", more)
    if kind == "undecided":
        rest = ""
        if modes is not None:
            stability = "unstable" if modes else "stable"
            rest = f"; smooth sliding is linearly {stability}"
        return Motion(kind, rest, found.regime.reason)
    if kind == "smooth sliding":
        if modes:
            return Motion("linearly unstable", ", but smooth in this run", more)
        return Motion(kind, "", more)
    rest = f", force ±{quantity(found.rig, found.amplitude, 'force', 3)}"
    if found.frequency is not None:
        unit = frequency_unit(found.rig)
        rest = f", {engineering(found.frequency, unit, 3)}{rest}"
    if found.bistable:
        return Motion(kind, f"{rest}; bistable", _BISTABLE)
    left = f"no mode grows, but {contacts} leave smooth sliding by their noise"
    return Motion(kind, rest, left if modes == 0 else "")


def more_of_motion(found: Findings) -> Iterator[str]:
    """What else there is to say of the motion at the rig's own speed."""
    if more := _motion(found).more:
        yield more


def _over_delays(found: Findings) -> str:
    """What a rig without a mechanism would do with a delay."""
    spans = []
    for band in found.delays:
        ends = (quantity(found.rig, end, "time") for end in band.ends)
        spans.append(f"{band.motion} from {' to '.join(ends)}")
    words = "with a delay of re-attachment it would be, at this speed, "
    return words + ", ".join(spans)


def _contacts(found: Findings) -> str:
    return f"{getattr(found.recording.rig.method, 'count', 'its')} contacts"


def speeds(found: Findings) -> Iterator[str]:
    """The motion at each speed: its ranges, and at those at which the rig works."""
    if not found.has_verdict:
        return
    where: dict[str, list[str]] = {}
    for band in found.bands:
        span = _span(found, *band.ends, band.low_found, band.high_found)
        where.setdefault(band.kind, []).append(span)
        if band.kind not in _QUIET:
            motion = MOTIONS.get(band.kind, band.kind)
            yield f"{motion} {span}{' if started from rest' * band.bistable}"
    spans = {kind: " and ".join(each) for kind, each in where.items()}
    known = [band for band in found.bands if band.kind != "unknown"]
    if found.theory_note:
        yield found.theory_note
    elif known and {*where} <= {*_QUIET}:
        seen = found.complete and "stable" not in where
        kind = "smooth sliding" if seen else "linearly stable"
        yield f"{kind} at all speeds {_span(found, known[0].low, known[-1].high)}"
    elif "smooth sliding" in where:
        yield f"smooth sliding {spans['smooth sliding']}"
    if found.complete and "stable" in where:
        yield f"linearly stable {spans['stable']} (starts from rest not judged)"
    if "unknown" in where and not found.theory_note:
        yield (
            f"{spans['unknown']} linear theory cannot tell, or not with the looks that "
            "are allowed"
        )
    yield from at_work(found)


def at_work(found: Findings) -> Iterator[str]:
    """The motion at other speeds at which the rig works, along its drive, or over its
    range of speeds.
    """
    if not found.has_verdict:
        return
    rig = found.rig
    for speed, motion in found.at_speeds:
        if speed != rig.velocity:
            yield f"at {_speed(rig, speed)}: {motion}"
    if len(found.along_drive) > 1:
        spells = (
            f"{band.motion} from {quantity(rig, band.low, 'time', 3)}"
            for band in found.along_drive
        )
        end = quantity(rig, found.along_drive[-1].high, "time", 3)
        yield f"along its drive, if each speed lasted: {', '.join(spells)}, to {end}"
    elif found.between is not None:
        low, high = found.between
        inside = (
            f"{band.motion} from {_speed(rig, max(band.low, low))}"
            for band in found.bands
            if band.low < high and band.high > low
        )
        words = ", ".join(inside) or "undecided"
        yield f"over its range, {_speed(rig, low)} to {_speed(rig, high)}: {words}"


def sections(found: Findings) -> list[Section]:
    """All sections beneath the headline of a rig with a rigid slider."""
    if found.between is None:
        at = [speed for speed, _ in found.at_speeds] or [found.rig.velocity]
        words = (quantity(found.rig, speed, "velocity") for speed in at)
        where = f"at {' and '.join(words)}"
    else:
        where = _span(found, *found.between)
    left = (
        "not searched farther with the runs that are allowed: "
        f"{', '.join(found.not_searched)}; see --thorough"
    )
    of_margins = (
        " of smooth sliding, one parameter varied at a time (linear stability, "
        "without noise)"
    )
    of_changes = f" {where}, the smallest change first; simulated"
    of_doubt = ", all that was fitted or assumed varied at once"
    evidence = str(found.regime).splitlines() if found.has_verdict else []
    doubt = list(found.doubt.sentences()) if found.doubt else []
    return [
        Section("here", "At this speed", "", [*more_of_motion(found)]),
        Section("speeds", "Speeds", "", list(speeds(found))),
        Section("regime", "", "", evidence),
        Section("numbers", "", "", list(numbers(found))),
        Section("margins", "Margins", of_margins, list(margins(found))),
        Section("noise", "Noise", "", list(noise(found))),
        Section("mitigations", "Mitigations", of_changes, list(mitigations(found))),
        Section(
            "attempts", "Tried", ", within the range searched", list(attempts(found))
        ),
        Section("not_searched", "Left out", "", [left] if found.not_searched else []),
        Section("doubt", "Doubt", of_doubt, doubt),
        *_origins(found.rig),
    ]


def _origins(rig: Rig) -> list[Section]:
    """What of a rig was assumed, and what was fitted."""
    assumed = [f"{key}: {item}" for key, item in rig.assumed.items()]
    fitted = [f"{key}: {item}" for key, item in rig.fitted.items()]
    return [
        Section("assumed", "Assumed", ", not measured", assumed),
        Section("fitted", "Fitted", " to a trace, with 90 % intervals", fitted),
    ]


def numbers(found: Findings) -> Iterator[tuple[str, str]]:
    """Names and values, with units, of the quantities behind the verdict."""
    rig = found.rig
    aged = ", thresholds fully aged" if rig.interface.ageing is not None else ""
    aged += (
        ", no contact broken by heat" if rig.interface.activation is not None else ""
    )
    without = quantity(rig, found.critical_stiffness_without_reattachment, "stiffness")
    margin = found.stiffness_margin
    state = (
        f"unstable, {found.unstable_modes} growing modes"
        if found.unstable_modes
        else "stable"
    )
    if found.growth_rate is not None:
        state += (
            "; fastest mode: growth rate "
            f"{_mode(rig, found.growth_rate, found.mode_frequency, 3)}"
        )
    critical = (
        f"{quantity(rig, found.critical_stiffness, 'stiffness')} ({without} "
        "without re-attachment)"
    )
    yield "total contact strength N f_s", rig.in_units(1.0, "force")
    yield (
        f"static friction F_s (slow rigid motion{aged})",
        quantity(rig, found.static_friction, "force"),
    )
    yield (
        "kinetic friction F_k at this speed",
        quantity(rig, found.kinetic_friction, "force"),
    )
    if found.frequency is not None:
        yield (
            "force, peak to peak",
            f"{percent(found.relative_amplitude)} of static friction",
        )
    yield (
        "stiffness K of the driving spring",
        quantity(rig, rig.value("stiffness"), "stiffness"),
    )
    yield f"critical stiffness K* (first pull{aged})", critical
    yield (
        "margin K/K*",
        (
            f"{number(margin, 3)} "
            f"({'softer: elastic' if margin < 1 else 'stiffer: no elastic'} "
            "instability)"
        ),
    )
    yield "linear stability of smooth sliding", found.theory_note or state


def margins(found: Findings) -> Iterator[tuple[str, str, str, str]]:
    """Parameter, value and stability limits, in words, beneath their heads."""
    if found.margins:
        yield "parameter", "now", "stability limit below", "stability limit above"
    for each in found.margins:
        ends = [each.value, each.lower, each.upper, *each.searched]
        value, lower, upper, low, high = (
            "" if end is None else amount(found.rig, each.parameter, end)
            for end in ends
        )
        kept = held(found.rig, each.parameter)
        title = parameter_named(each.parameter).title + (
            f", {kept.title} held" if kept else ""
        )
        yield (
            title,
            value,
            lower or f"none down to {low}",
            upper or f"none up to {high}",
        )


def noise(found: Findings) -> Iterator[str]:
    """How near to a limit the noise of the contacts allows to go."""
    if found.noise_limit is not None:
        name, value = found.noise_limit
        limits = next(each.limits for each in found.margins if each.parameter == name)
        limit = min(limits, key=lambda end: abs(math.log(end / value)))
        now, end = (amount(found.rig, name, each) for each in (value, limit))
        yield (
            f"{_contacts(found)} make the force fluctuate by {percent(SEEN)} rms at "
            f"{now}, "
            f"before the {parameter_named(name).title} reaches its limit, {end} "
            "(linear theory)"
        )


def mitigations(found: Findings) -> Iterator[str]:
    """Each mitigation as a sentence, and two that will do together."""
    kinds = [str(found.regime.kind), *(band.kind for band in found.trouble)]
    named = {"stick-slip": "stick-slip", "sustained oscillation": "the oscillation"}
    decays = f"{next((named[kind] for kind in kinds if kind in named), 'the instability')} decays even from rest"  # noqa: E501
    for each in found.mitigations:
        yield f"{changes_in_words(found, each)}, and {decays}"
    if found.combined:
        yield f"the smallest two together: {changes_in_words(found, *found.combined)}"
    if found.complete and found.needs_mitigation and not found.mitigations:
        tried = found.attempts or found.unreliable
        yield (
            "none found of a single parameter; what was tried:"
            if tried
            else "none: nothing can be varied"
        )


def changes_in_words(found: Findings, *changes: Mitigation) -> str:
    """Changes made together in words: of each parameter from what value to what, and
    what they hold.
    """
    rig = found.rig
    there = found.rig.with_values(**{each.parameter: each.to for each in changes})
    names = [each.parameter for each in changes]
    words = [
        (
            f"{parameter_named(name).title}: from {_value(rig, name)} to "
            f"{_value(there, name)}"
        )
        for name in names
    ]
    all_held = {
        kept for name in names if (kept := held(there, name)) and kept.name not in names
    }
    return " and ".join(words) + "".join(
        f", with {kept.title} held at {_value(there, kept.name)}" for kept in all_held
    )


def held(rig: Rig, name: str) -> Parameter | None:
    """The parameter that another holds, if a rig has it."""
    holds = parameter_named(name).holds
    return (
        parameter_named(holds) if holds and has(rig, parameter_named(holds)) else None
    )


def _value(rig: Rig, name: str) -> str:
    """The value of a parameter, with what a rig file may give in its place, or has
    to give anew with it.
    """
    also = ", ".join(f"{key} {value}" for key, value in beside(rig, name).items())
    return amount(rig, name, rig.value(name)) + (f" ({also})" if also else "")


def beside(rig: Rig, name: str) -> dict[str, str]:
    """What a rig file may give in place of a parameter, or has to give anew with it,
    and its value.
    """
    also = {}
    if name == "damping":
        also["damping ratio"] = number(rig.slider.damping_ratio, 3)
    if name == "delay":
        with suppress(InputError):  # the friction never halves
            speed = half_distance(rig.interface) / DELAY.get(rig)
            also["v_half"] = rig.in_units(speed, "velocity")
    if name == "load" and rig.operation.normal_load:
        also["contact strength"] = rig.in_units(1.0, "force")
    if name in ("friction", "contact_stiffness"):
        also["breaking displacement"] = rig.in_units(1.0, "length")
    if name in ("friction", "load") and (force := rig.interface.sliding_force):
        also["sliding force"] = rig.in_units(force, "force")
    return also


def attempts(found: Findings) -> Iterator[str]:
    """How far each parameter was varied without a value that reliably gives smooth
    sliding.
    """
    for name, ends in found.attempts.items():
        low, high = (amount(found.rig, name, value) for value in ends)
        yield (
            f"{parameter_named(name).title}: no value found from {low} to {high} "
            "with smooth sliding in 8 of 8 runs"
        )
    for name, (value, part) in found.unreliable.items():
        times = round(8 * part)
        furthest = amount(found.rig, name, value)
        yield (
            f"{parameter_named(name).title}: at {furthest}, the furthest, smooth "
            f"sliding in {times} of 8 runs"
        )


def _grows(found: WaveFindings, speeds: tuple[tuple[float, float], ...]) -> str:
    where = " and ".join(_span(found, *pair) for pair in speeds)
    return f"unstable {where}" if speeds else "stable at all speeds"


def headline_of_waves(found: WaveFindings) -> str:
    """What linear theory says at the rig's own speed, in a line."""
    if found.theory_note:
        return f"undecided: {found.theory_note}"
    words = "smooth sliding is linearly stable at every wavelength"
    if found.growing:
        words = (
            f"growing modes of smooth sliding: {found.growing}, fastest: "
            f"{fastest_wave(found)}"
        )
    return f"at {_speed(found.rig, found.rig.velocity)}: {words}"


def fastest_wave(found: WaveFindings) -> str:
    """Name of the wave that grows fastest."""
    fastest = max(
        found.waves,
        key=lambda wave: -math.inf if wave.growth is None else wave.growth,
    )
    return fastest.name


def sections_of_waves(found: WaveFindings) -> list[Section]:
    """Each wave in words, the critical length, and where the first contacts break."""
    rig = found.rig
    told = list[str]()
    where = "" if found.speeds else f" {_span(found, *found.speeds_searched)}"
    known = [f"linearly {_grows(found, found.speeds)}{where}"]
    for wave in found.waves:
        decay = "no exponential decay"
        if wave.growth is not None:
            rate = "growth rate" if wave.growth > 0 else "decay rate"
            decay = f"{rate} {_mode(rig, abs(wave.growth), wave.frequency, 4)}"
        stiffness = quantity(rig, wave.stiffness, "stiffness")
        told.append(
            f"{wave.name} (stiffness {stiffness}): {decay}; "
            f"{_grows(found, wave.speeds)}"
        )
    told += lengths(found)
    about = ", the softest first (linear stability)"
    return [
        Section("speeds", "Speeds", "", [] if found.theory_note else known),
        Section("waves", "By wavelength", about, told),
        *_origins(rig),
    ]


def lengths(found: WaveFindings) -> Iterator[str]:
    """The critical length of a chain, and where the first contacts break."""
    rig = found.rig
    if found.critical is not None:
        stiffness = quantity(rig, found.critical.stiffness, "stiffness")
        yield f"critical stiffness {stiffness} at this speed: {found.critical}"
    if (distance := distance_to_the_first_break(rig)) is not None:
        what = "slip precursors start" if rig.slider.side > 0 else "blocks break loose"
        yield (
            f"from rest, {what} when the drive has gone about "
            f"{rig.in_units(distance, 'length', 3)}"
        )
