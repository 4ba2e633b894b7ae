"""The text of a prediction: the motion at the rig's own speed, and sections, each a
list of sentences or a table.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

from stickslip.advise.budget import OSCILLATES, varies
from stickslip.advise.findings import (
    LARGE_NOISE,
    Findings,
    WaveFindings,
    frequency_unit,
)
from stickslip.advise.mitigations import Mitigation, has
from stickslip.advise.survey import PRECISION
from stickslip.arrays import Range
from stickslip.elastic.precursors import distance_to_the_first_break
from stickslip.errors import UndecidedError
from stickslip.measure.episodes import Episode
from stickslip.measure.fronts import blocks_in_words
from stickslip.model.newborn import half_distance
from stickslip.model.parameters import DELAY, parameter_named
from stickslip.model.rig import Rig
from stickslip.model.structure import Structure
from stickslip.stability import contact_noise
from stickslip.words import engineering, listed, number, percent


class Section(NamedTuple):
    """Sentences on one topic, or rows of a table, the first of which is its head."""

    name: str
    rows: Sequence[str] | Sequence[tuple[str, ...]]
    title: str = ""
    note: str = ""  #: text after the title, in the same line


class Motion(NamedTuple):
    """A kind of motion, and the text around it."""

    kind: str
    rest: str = ""  #: text after it, in the same line
    more: str = ""  #: a sentence of its own
    at: str = ""  #: text before it, in the same line

    @property
    def line(self) -> str:
        """The motion in one line."""
        return self.at + self.kind + self.rest


Signs = tuple[str, str, str]
"""How a change is written: an arrow, and the signs of its factor."""
ASCII = "->", "x", "/"
ARROWS = (
    "\N{RIGHTWARDS ARROW}",
    "\N{MULTIPLICATION SIGN}",
    "\N{DIVISION SIGN}",
)
_ALONG = "along its drive: "
_BY_THEORY = ", each alone, that make smooth sliding stable (linear stability)"
_SPELLS = 3  # most episodes of oscillation along a drive that are listed
_BISTABLE = "from this start, although smooth sliding, once reached, is linearly stable"
# text after a range of speeds with this kind of motion
_NOTES = {
    "stable": ", starts from rest not judged",
    "unknown": ": linear theory cannot decide, or not within its budget",
}
_LABELS = {
    "stiffness": "spring stiffness",
    "mass": "mass",
    "damping": "damping",
    "delay": "delay",
    "std": "std of thresholds",
    "ageing": "ageing time",
    "load": "contact strength",
    "friction": "friction level",
    "contact_stiffness": "contact stiffness",
    "side": "side spring",
    "leaf": "spring of each block",
    "coupling": "coupling of blocks",
}


def quantity(rig: Rig, value: float, unit: str, digits: int = 4) -> str:
    """Return a value in the rig's own units, with an SI prefix, in words."""
    return rig.in_units(value / rig.unit(unit), unit, digits)


def amount(rig: Rig, parameter: str, value: float, digits: int = 4) -> str:
    """Return a parameter's value in words, in the rig's own units; a standard
    deviation as a fraction of the mean.
    """
    if parameter == "std":
        return number(value, 3)
    return quantity(rig, value, parameter_named(parameter).unit, digits)


def _speed(rig: Rig, value: float) -> str:
    return quantity(rig, value, "velocity", 3)


def _span(
    found: Findings | WaveFindings,
    low: float,
    high: float,
    low_found: bool = True,
    high_found: bool = True,
) -> str:
    """Return a range of speeds in words, with "or less" or "or more" at an end that is
    not a limit.
    """
    begin, end = found.speeds_searched
    first, last = (_speed(found.rig, each) for each in (low, high))
    value, _, unit = first.partition(" ")
    if not (low_found and low > begin):
        first += " (or less)"
    elif last.endswith(f" {unit}"):
        first = value
    return f"from {first} to {last}" + " (or more)" * (not high_found or high >= end)


def _mode(rig: Rig, growth: float, frequency: float | None) -> str:
    """Return growth rate and frequency of a mode in words."""
    per_time = rig.unit_name("1/time").replace("1/time", "per time unit")
    waves = ", non-oscillatory"
    if frequency:
        waves = f" at {engineering(frequency, frequency_unit(rig), 3)}"
    return f"{number(growth)} {per_time}{waves}"


def motion(found: Findings) -> Motion:
    """Return the motion of the headline: at the rig's own speed, or the oscillation
    along a drive that starts smoothly.
    """
    rig = found.rig
    if not found.has_verdict:
        reason = ": nothing says how contacts strengthen with rest"
        would = list[str]()
        for band in found.delays:
            low, high = (quantity(rig, end, "time") for end in band.ends)
            would.append(f"{band.motion} from {low} to {high}")
        with_delay = "with a delay of re-attachment it would be, at this speed, "
        return Motion("cannot be judged", reason, with_delay + ", ".join(would))
    here = _own_motion(found)
    speed = quantity(rig, rig.velocity, "velocity")
    if found.driven is not None:
        return _driven(found, f"if {speed} lasted: {here.line}")
    here = here._replace(at=f"at {speed}: ")
    if len(rig.drive.pieces) > 1:
        here = here._replace(rest=f"{here.rest}; if {speed} lasted")
    along = {band.kind: band for band in reversed(found.along_drive)}
    later = next((along[kind] for kind in OSCILLATES if kind in along), None)
    if later is None or found.oscillates:
        return here
    begin = quantity(rig, later.low, "time", 3)
    return Motion(later.kind, f" from {begin} on; {here.line}", here.more)


def _driven(found: Findings, more: str) -> Motion:
    """Return the motion along a drive with several speeds, from its own run."""
    rig = found.rig
    episodes = found.lasting_episodes
    if not episodes:
        rest = ""
        if starts := [each for each in found.driven or () if each.rings_down]:
            worst = max(starts, key=lambda each: each.worst)
            force = quantity(rig, worst.worst, "force", 3)
            when = quantity(rig, worst.worst_time, "time", 3)
            rest = f", but rings down by ±{force} from {when} on"
        return Motion("smooth sliding", rest, more, _ALONG)
    seen = {each.kind for each in episodes}
    kind, *others = (kind for kind in OSCILLATES if kind in seen)
    its = [each for each in episodes if each.kind == kind]
    worst = max(its, key=lambda each: each.worst)
    often = "irregular"
    if math.isfinite(worst.frequency):
        often = engineering(worst.frequency, frequency_unit(rig), 3)
    force = quantity(rig, worst.worst, "force", 3)
    when = quantity(rig, worst.worst_time, "time", 3)
    speed = _speed(rig, worst.worst_velocity)
    spells = _spells(rig, its)
    rest = f" {spells}, {often}, at worst ±{force} at {when} ({speed})"
    for other in others:
        its = [each for each in episodes if each.kind == other]
        rest += f"; {other} {_spells(rig, its)}"
    return Motion(kind, rest, more, _ALONG)


def _spells(rig: Rig, episodes: Sequence[Episode]) -> str:
    """Return the times of the first episodes, in words."""
    spells = list[str]()
    for each in episodes[:_SPELLS]:
        begin, end = (quantity(rig, time, "time", 3) for time in (each.begin, each.end))
        spells.append(f"{begin} to {end}")
    if left := len(episodes) - len(spells):
        spells.append(f"{left} times more")
    return listed(spells)


def _own_motion(found: Findings) -> Motion:
    """Return the motion at the rig's own speed."""
    kind = str(found.regime.kind)
    modes = found.unstable_modes
    count = getattr(found.recording.rig.method, "count", None)
    contacts = f"{count or 'its'} contacts"
    more = (
        f"the oscillation may not yet exceed the noise of {contacts}" if modes else ""
    )
    if found.noise is not None:
        if count and found.noise > LARGE_NOISE:
            # the variance of the noise is proportional to 1/N
            enough = number(count * (found.noise / LARGE_NOISE) ** 2, 2)
            more = f"below {percent(LARGE_NOISE)} from {enough} contacts on"
        rms = f"{percent(found.noise)} rms, noise of {contacts}"
        return Motion(kind, f"; the force fluctuates by {rms}", more)
    if kind == "undecided":
        theory = f"; smooth sliding is linearly {'unstable' if modes else 'stable'}"
        return Motion(kind, theory * (modes is not None), found.regime.reason)
    if kind == "smooth sliding" and modes:
        return Motion("linearly unstable", ", but smooth in this run", more)
    often = ""
    if found.lasting is not None:
        often = "{} in {} of {} runs".format(
            "lasts" if found.oscillates else "an oscillation lasts", *found.lasting
        )
    if kind == "smooth sliding":
        return Motion(kind, "", often * (found.smooth is False))
    rest = f", force ±{quantity(found.rig, found.amplitude, 'force', 3)}"
    rest = f", {_how_often(found)}{rest}" if found.cycles_per_time else rest
    if kind == "sustained oscillation":
        part = percent(found.amplitude / found.static_friction)
        rest += f" ({part} of static friction)"
    rest += f"; {often}" * bool(often)
    if found.bistable:
        return Motion(kind, f"{rest}; bistable", _BISTABLE)
    count = getattr(found.rig.method, "count", None)
    left = f"no mode grows, but {count} contacts leave smooth sliding by their noise"
    return Motion(kind, rest, left if modes == 0 else "")


def _how_often(found: Findings) -> str:
    """Return the frequency in words, in its significant digits, or that the motion is
    irregular.
    """
    if found.frequency is not None and found.frequency_error is not None:
        error = max(found.frequency_error / found.frequency, 1e-3)
        digits = min(max(1 + math.floor(-math.log10(error)), 1), 3)
        return engineering(found.frequency, frequency_unit(found.rig), digits)
    assert found.cycles_per_time is not None
    often = number(found.cycles_per_time, 2)
    per_time = "a second" if found.rig.scales is not None else "per time unit"
    return f"irregular, some {often} {per_time}"


def speeds(found: Findings) -> Iterator[str]:
    """Yield the motion in each range of speeds, and at the speeds at which the rig
    works.
    """
    if not found.has_verdict:
        return
    if found.theory_note:
        yield found.theory_note
    for band in found.bands:
        if found.theory_note and band.kind == "unknown":
            continue
        span = _span(found, *band.ends, band.low_found, band.high_found)
        note = " if started from rest" if band.bistable else _NOTES.get(band.kind, "")
        yield f"{band.motion.removesuffix(' (from rest only)')} {span}{note}"
    yield from at_work(found)


def at_work(found: Findings) -> Iterator[str]:
    """Yield the motion at other speeds at which the rig works, and along its drive or
    over its range of speeds.
    """
    if not found.has_verdict:
        return
    rig = found.rig
    for speed, kind in found.at_speeds:
        if speed != rig.velocity:
            yield f"at {_speed(rig, speed)}: {kind}"
    unit = "velocity"
    low, end = found.between or (rig.velocity, rig.velocity)
    bands = [
        replace(band, low=max(band.low, low))
        for band in found.bands
        if band.low < end and band.high > low
    ]
    where = "over its range"
    if found.driven is not None:
        return
    if len(found.along_drive) > 1:
        unit = "time"
        bands = [*found.along_drive]
        end = bands[-1].high
        where = "along its drive"
    if found.between and bands:
        starts = (quantity(rig, band.low, unit, 3) for band in bands)
        spells = map("{0.motion} from {1}".format, bands, starts)
        last = quantity(rig, end, unit, 3)
        yield f"{where}, if each speed lasted: {', '.join(spells)}, to {last}"


def sections(found: Findings) -> list[Section]:
    """Return all sections of the answer for a rig with a rigid slider."""
    rig = found.rig
    more = motion(found).more
    of_margins = (
        " of smooth sliding, one parameter varied at a time (linear stability, "
        "without noise)"
    )
    within = f" (runs from rest; limits within {percent(PRECISION)})" * found.complete
    of_changes = ", each alone (8 of 8 runs slide smoothly, even from rest)"
    return [
        Section("here", [more] if more else [], "At this speed"),
        Section("speeds", [*speeds(found)], "Speeds", within),
        Section("regime", str(found.regime).splitlines() * found.has_verdict),
        Section("numbers", [*numbers(found)]),
        Section("margins", [*margins(found)], "Margins", of_margins),
        Section("noise", [*noise(found)], "Noise"),
        Section("mitigations", _changes(found), "Mitigations", of_changes),
        Section(
            "combined", rewritten(rig, found.combined), "The smallest two together"
        ),
        Section("attempts", [*attempts(found)], "Tried", ", within the range searched"),
        Section(
            "not_searched", found.not_searched, "Left out", "; --thorough searches"
        ),
        Section("doubt", [*found.doubt.sentences()] if found.doubt else [], "Doubt"),
        *_origins(rig),
    ]


def _changes(found: Findings | WaveFindings) -> list[tuple[str, ...]]:
    """Return the table of mitigations, with its head."""
    head = ("parameter", "now", "", "to", "factor", "and")
    rows = change_rows(found.rig, found.mitigations)
    return [head, *rows] if found.mitigations else []


def _origins(rig: Rig) -> list[Section]:
    """Return the sections of the assumed and of the fitted values of a rig."""
    assumed, fitted = (
        [f"{key}: {item}" for key, item in each.items()]
        for each in (rig.assumed, rig.fitted)
    )
    return [
        Section("assumed", assumed, "Assumed", ", not measured"),
        Section("fitted", fitted, "Fitted", " to a trace, with 90 % intervals"),
    ]


def numbers(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield names and values, with units, of the quantities behind the verdict."""
    rig = found.rig
    aged = ", thresholds fully aged" * (rig.interface.ageing is not None)
    aged += ", no contact broken by heat" * (rig.interface.activation is not None)
    modes = found.unstable_modes
    state = f"unstable, {modes} growing modes" if modes else "stable"
    if found.growth_rate is not None:
        fastest = _mode(rig, found.growth_rate, found.mode_frequency)
        state += f"; fastest mode: growth rate {fastest}"
    is_structure = isinstance(rig.slider, Structure)
    holds = "structure at the contacts" if is_structure else "driving spring"
    margin = found.stiffness_margin
    jump = "softer: elastic" if margin < 1 else "stiffer: no elastic"
    yield "total contact strength N f_s", rig.in_units(1.0, "force")
    if found.frequency is not None:
        part = percent(found.relative_amplitude)
        yield "force, peak to peak", f"{part} of static friction"
    for name, value, unit in (
        (
            f"static friction F_s (slow rigid motion{aged})",
            found.static_friction,
            "f_s",
        ),
        ("kinetic friction F_k at this speed", found.kinetic_friction, "f_s"),
        (f"stiffness K of the {holds}", found.stiffness, "k"),
        (f"critical stiffness K* (first pull{aged})", found.critical_stiffness, "k"),
        (
            "critical stiffness without re-attachment",
            found.critical_stiffness_without_reattachment,
            "k",
        ),
    ):
        yield name, quantity(rig, value, unit)
    yield "margin K/K*", f"{number(margin, 3)} ({jump} instability)"
    yield "linear stability of smooth sliding", found.theory_note or state


def margins(found: Findings) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a table of parameters, their values and stability limits."""
    if found.margins:
        yield "parameter", "now", "stability limit below", "stability limit above"
    for each in found.margins:
        parameter = parameter_named(each.parameter)
        title = parameter.title
        if parameter.holds and has(found.rig, kept := parameter_named(parameter.holds)):
            title += f", {kept.title} held"
        ends = [each.value, each.lower, each.upper, *each.searched]
        value, lower, upper, low, high = (
            "" if end is None else amount(found.rig, each.parameter, end)
            for end in ends
        )
        yield (
            title,
            value,
            lower or f"none down to {low}",
            upper or f"none up to {high}",
        )


def noise(found: Findings) -> Iterator[str]:
    """Yield a sentence on how near to a limit the noise of the contacts allows."""
    if found.noise_limit is None:
        return
    rig = found.rig
    name, value = found.noise_limit
    with suppress(UndecidedError):  # the value is too near to the limit for the theory
        there = contact_noise(rig.with_values(**{name: value}))
        count = getattr(rig.method, "count", "its")
        rms = percent(there.relative_force)
        at = amount(rig, name, value)
        yield (
            f"{count} contacts make the force of smooth sliding fluctuate by {rms} rms "
            f"at {at}, before the {parameter_named(name).title} reaches its limit "
            "(linear theory)"
        )


def rewritten(rig: Rig, changes: Sequence[Mitigation]) -> list[tuple[str, str, str]]:
    """Return the values of a rig file that changes made together alter: label, old and
    new value; first those of the parameters, then others that follow.
    """
    names = [each.parameter for each in changes]
    there = rig.with_values(**{each.parameter: each.to for each in changes})
    now, then = (_of_file(each, names) for each in (rig, there))
    return [
        (label, now[label], value)
        for place, (label, value) in enumerate(then.items())
        if place < len(names) or value != now[label]
    ]


def _of_file(rig: Rig, names: Sequence[str]) -> dict[str, str]:
    """Return the values, by label, that a file holds for parameters, and for others
    that may change with them.
    """
    ratio = {}
    if (damping := getattr(rig.slider, "damping_ratio", 0.0)) > 0:
        ratio = {"damping ratio": number(damping, 3)}
    strength = {"contact strength": rig.in_units(1.0, "force")}
    labelled = dict[str, str]()
    for name in names:
        label = _LABELS.get(name, parameter_named(name).title or name)
        here = {label: amount(rig, name, rig.value(name), 3)}
        if name == "damping":
            here = ratio or here
        if name == "load" and rig.operation.normal_load:
            here = {"normal load": here[label]} | strength
        labelled |= here
    labelled |= ratio
    labelled["breaking displacement"] = rig.in_units(1.0, "length")
    labelled["sliding force"] = rig.in_units(rig.interface.sliding_force, "force")
    if "interface.v_half" in rig.given and has(rig, DELAY):
        speed = half_distance(rig.interface) / DELAY.get(rig)
        labelled["v_half"] = rig.in_units(speed, "velocity")
    return labelled


def changes_in_words(found: Findings, *changes: Mitigation) -> str:
    """Return in words all values of a rig file that changes made together alter."""
    rows = rewritten(found.rig, changes)
    return ", ".join(f"{label} from {now} to {then}" for label, now, then in rows)


def change_rows(
    rig: Rig, changes: Sequence[Mitigation], signs: Signs = ASCII
) -> Iterator[tuple[str, ...]]:
    """Yield a row for each change made alone: parameter, old value, arrow, new value,
    factor, and other values of the file that change with it.
    """
    arrow, times, over = signs
    for change in changes:
        (label, now, then), *others = rewritten(rig, [change])
        sign = times if change.to > change.now else over
        size = f"{sign} {number(math.exp(change.size), 2)}" if change.now else ""
        also = ", ".join(f"{label} {value}" for label, _, value in others)
        if change.noise > LARGE_NOISE:
            noise = f"the force fluctuates by {percent(change.noise)} rms, noise"
            also = f"{also}, {noise}" if also else noise
        yield label, now, arrow, then, size, also


def attempts(found: Findings | WaveFindings) -> Iterator[str]:
    """Yield a sentence for each parameter that does not reliably give smooth sliding,
    with the range over which it was varied.
    """
    rig = found.rig
    for name, ends in found.attempts.items():
        low, high = (amount(rig, name, value) for value in ends)
        title = parameter_named(name).title
        # one run judged each value that was tried; for bars, theory did
        by_runs = not isinstance(found, WaveFindings) and varies(rig)
        always = " in every run" if by_runs else ""
        yield f"{title}: {low} to {high} does not stop it{always}"
    some = found.unreliable if isinstance(found, Findings) else {}
    for name, (value, part) in some.items():
        yield (
            f"{parameter_named(name).title}: at {amount(rig, name, value)}, the "
            f"furthest, smooth sliding in {round(8 * part)} of 8 runs"
        )


def motion_of_waves(found: WaveFindings) -> Motion:
    """Return the motion of an elastic slider at its own speed, from linear theory and
    its run.
    """
    if found.theory_note:
        return Motion("undecided", f": {found.theory_note}")
    at = f"at {_speed(found.rig, found.rig.velocity)}: "
    slipped = bool(found.partial or found.whole)
    size = found.rig.natural.slider.size
    softest = f" of the {found.looked} softest" * (found.looked < size)
    if not found.growing:
        but = ", but a run from rest slips" * slipped
        where = f" in each{softest} modes" if softest else " at every wavelength"
        return Motion("smooth sliding is linearly stable", f"{where}{but}", at=at)
    plural = "s" * (found.growing != 1)
    fastest = f", fastest: {found.fastest}" * bool(found.fastest)
    more = f"{found.growing} growing mode{plural}{softest}{fastest}"
    unstable = "smooth sliding is unstable"
    where = f" {_around(found)}".rstrip()
    if slipped:
        return Motion("stick-slip expected", f": {unstable}{where}", more, at)
    return Motion(unstable, where, more, at)


def _around(found: WaveFindings) -> str:
    """Return in words the range of speeds around the rig's own in which a mode
    grows.
    """
    if found.speeds == (found.speeds_searched,):
        low, high = (_speed(found.rig, end) for end in found.speeds_searched)
        return f"at every speed from {low} to {high}"
    speed = found.rig.velocity
    here = (ends for ends in found.speeds if ends[0] <= speed <= ends[1])
    return "".join(_span(found, *ends) for ends in here)


def slips(found: WaveFindings) -> Iterator[str]:
    """Yield a sentence on the first slips in the run of a bar from rest."""
    rig = found.rig
    first = "precursor" if rig.natural.slider.side > 0 else "slip"
    sentences = list[str]()
    for slip, name in ((found.partial, first), (found.whole, "slip of all blocks")):
        if slip is not None:
            after = quantity(rig, slip.start, "time", 3)
            sentences.append(f"first {name} after {after}")
            drop = quantity(rig, slip.drop, "force", 3)
            over = blocks_in_words(rig, slip.blocks)
            sentences[-1] += (
                f", force drop {drop}" if slip is found.whole else f", {over}"
            )
    if sentences:
        yield f"in a run from rest: {'; '.join(sentences)}"
    elif found.simulated:
        lasts = quantity(rig, found.simulated, "time", 3)
        yield f"in a run from rest of {lasts}: no slip of 3 blocks or more"


def _unstable(
    found: WaveFindings, grows: Sequence[Range], unknown: Sequence[Range]
) -> str:
    """Return in words the speeds at which waves grow, or at which that is not known."""
    parts = [_span(found, *ends) for ends in grows]
    parts += [f"not known {_span(found, *ends)}" for ends in unknown]
    return " and ".join(parts) or "nowhere"


def sections_of_waves(found: WaveFindings) -> list[Section]:
    """Return all sections of the answer for an elastic slider."""
    rig = found.rig
    unknown = [band.ends for band in found.bands if band.kind == "unknown"]
    unstable = [f"linearly unstable {_unstable(found, found.speeds, unknown)}"]
    # leave out what the headline already says
    known = len(found.speeds) == 1 and _around(found) and not unknown
    if found.theory_note or known or not found.waves:
        unstable = []
    waves = [("wave", "stiffness", "growth rate", "unstable")] if found.waves else []
    for wave in found.waves:
        rate = "no exponential decay"
        if wave.growth is not None:
            rate = _mode(rig, wave.growth, wave.frequency)
        stiffness = quantity(rig, wave.stiffness, "stiffness")
        where = _unstable(found, wave.speeds, wave.unknown)
        waves.append((wave.name, stiffness, rate, where))
    about = ", the softest first (linear stability)"
    more = motion_of_waves(found).more
    return [
        Section("here", [more] if more else [], "At this speed"),
        Section("slips", [*slips(found)], "From rest"),
        Section("speeds", unstable, "Speeds"),
        Section("waves", waves, "By wavelength", about),
        Section("lengths", [*lengths(found)], "Lengths"),
        Section("mitigations", _changes(found), "Changes", _BY_THEORY),
        Section("attempts", [*attempts(found)], "Tried", ", in doublings"),
        Section(
            "not_searched", found.not_searched, "Left out", "; --thorough searches"
        ),
        *_origins(rig),
    ]


def lengths(found: WaveFindings) -> Iterator[str]:
    """Yield sentences on the critical length of a chain, and on the travel at which its
    first block breaks loose.
    """
    rig = found.rig
    if found.critical is not None:
        stiffness = quantity(rig, found.critical.stiffness, "stiffness")
        yield f"critical stiffness {stiffness} at this speed: {found.critical}"
    if (distance := distance_to_the_first_break(rig)) is not None:
        length = rig.in_units(distance, "length", 3)
        yield (
            f"from rest, the first block breaks loose when the drive has gone about "
            f"{length}"
        )
