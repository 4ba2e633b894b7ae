"""The answer in some twenty lines: verdict, strip of speeds, smallest changes, and how
sure it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from stickslip.advise.doubt import WIDEST, Doubt
from stickslip.advise.findings import Findings, WaveFindings
from stickslip.advise.mitigations import Mitigation
from stickslip.advise.sections import (
    Motion,
    amount,
    at_work,
    beside,
    changes_in_words,
    fastest_wave,
    first_motion,
    held,
    lengths,
    more_of_motion,
    quantity,
)
from stickslip.advise.survey import Band
from stickslip.model.parameters import parameter_named
from stickslip.model.rig import Rig
from stickslip.words import number, percent

_ROWS = 5  # changes that are shown; the rest stands among the details
_LABELS = {
    "velocity": "speed",
    "stiffness": "spring stiffness",
    "mass": "mass",
    "damping": "damping",
    "delay": "delay",
    "std": "std of thresholds",
    "ageing": "ageing time",
    "load": "contact strength",
    "friction": "friction level",
    "contact_stiffness": "contact stiffness",
}
MARKS = {
    "stick-slip": ("=", "stick-slip"),
    "sustained oscillation": ("~", "oscillation"),
    "unstable": ("*", "unstable by theory"),
    "bistable": ("-", "only if started from rest"),
    "stable": (":", "stable by theory"),
    "smooth sliding": (".", "smooth"),
    "unknown": ("?", "not known"),
    "now": ("|", "now"),
}
"""Marks of the strip of speeds, and what they mean, by kind of motion."""
MORE = "More: --details, --plot, report"


class Signs(NamedTuple):
    """How a change is written: an arrow, and the signs of its factor."""

    to: str
    times: str
    over: str


ASCII = Signs("->", "x", "/")
ARROWS = Signs("\N{RIGHTWARDS ARROW}", "\N{MULTIPLICATION SIGN}", "\N{DIVISION SIGN}")


class Paragraph(NamedTuple):
    """A heading, and lines beneath it."""

    title: str
    lines: Sequence[str]


def place(found: Findings | WaveFindings, speed: float) -> float:
    """Place of a speed on the strip, whose axis is logarithmic: from 0 to 1."""
    low, high = found.speeds_searched
    inside = min(max(speed, low), high)
    return math.log(inside / low) / math.log(high / low)


def strip(found: Findings | WaveFindings, count: int) -> list[str]:
    """Kinds of motion, as in `MARKS`, in so many cells of the strip of speeds, and
    "now" between them; nothing where nothing is known.
    """
    rest = "stable" if isinstance(found, WaveFindings) else "unknown"
    if found.theory_note and {band.kind for band in found.bands} <= {"unknown"}:
        return []
    cells = [rest] * count
    # the narrow ones last, so that each is seen
    for band in sorted(found.bands, key=lambda band: band.low / band.high):
        first, last = (round(count * place(found, end)) for end in band.ends)
        first = min(first, count - 1)
        last = max(last, first + 1)
        cells[first:last] = [_kind(band)] * (last - first)
    for speed in sorted(_speeds(found), reverse=True):
        cells.insert(round(count * place(found, speed)), "now")
    return cells


def _kind(band: Band) -> str:
    kind = "bistable" if band.bistable else band.kind
    return kind if kind in MARKS else "unknown"


def _speeds(found: Findings | WaveFindings) -> Iterable[float]:
    """The speeds that are marked: at which the rig works, or the ends of these."""
    if isinstance(found, WaveFindings):
        return [found.rig.velocity]
    several = [speed for speed, _ in found.at_speeds]
    return found.between or several or [found.rig.velocity]


def legend(kinds: Sequence[str]) -> str:
    """What the marks of a strip mean, of those that are there."""
    there = [sign for kind, sign in MARKS.items() if kind in kinds]
    words = "  ".join(f"{mark} {meaning}" for mark, meaning in there)
    return words + " (its speeds)" * (kinds.count("now") > 1)


def verdict(found: Findings | WaveFindings) -> str:
    """The motion in capitals, then its numbers."""
    if isinstance(found, WaveFindings):
        motion = _motion_of_waves(found)
        words = motion.rest
    else:
        motion = first_motion(found)
        words = motion.rest.lstrip(",;: ")
        if found.regime.kind == "sustained oscillation":
            part = percent(found.amplitude / found.static_friction)
            words += f" ({part} of static friction)"
    return "   ".join([motion.kind.upper(), *([words] if words else [])])


def _motion_of_waves(found: WaveFindings) -> Motion:
    """What linear theory says at the rig's own speed."""
    if found.theory_note:
        return Motion("undecided", found.theory_note)
    if not found.growing:
        return Motion("smooth sliding is linearly stable at every wavelength")
    return Motion(
        "smooth sliding is unstable",
        f"{found.growing} growing modes, fastest: {fastest_wave(found)}",
    )


def paragraphs(found: Findings | WaveFindings, signs: Signs = ASCII) -> list[Paragraph]:
    """What stands beneath verdict and strip, the first close to these."""
    if isinstance(found, WaveFindings):
        told = [f"  {line}" for line in lengths(found)]
        return [Paragraph("", told), Paragraph("", [MORE])]
    more = [*more_of_motion(found), *at_work(found)]
    if found.has_verdict and not strip(found, 1):
        more.append(found.theory_note)
    return [
        Paragraph("", [f"  {line}" for line in more]),
        _changes(found, signs),
        Paragraph("", [*how_sure(found.rig, found.doubt), MORE]),
    ]


def _changes(found: Findings, signs: Signs) -> Paragraph:
    """What stops it, the smallest change first; where it is smooth, what ends that."""
    title = ""
    changes: list[Mitigation] = []
    if found.needs_mitigation:
        title = "What stops it, each alone (8 of 8 runs slide smoothly)"
        changes = [*found.mitigations]
    elif found.smooth:
        title = "What would end it, each alone (linear stability)"
        changes = nearest_limits(found)
    # those that can be made on the machine are told first
    told = sorted(changes[:_ROWS], key=lambda each: each.size)
    lines = [f"  {row}" for row in rows(found.rig, told, signs)]
    after = []
    if len(changes) > len(told):
        after.append(f"and {len(changes) - len(told)} more: --details.")
    if found.needs_mitigation and found.complete:
        after += _next(found)
    if after:
        lines.append("  " * bool(told) + " ".join(after))
    return Paragraph(title if told else "", lines)


def nearest_limits(found: Findings) -> list[Mitigation]:
    """Of each margin the nearest limit, the nearest of all first."""
    limits = [
        Mitigation(parameter=margin.parameter, now=margin.value, to=limit)
        for margin in found.margins
        for limit in margin.limits
    ]
    first: dict[str, Mitigation] = {}
    for each in sorted(limits, key=lambda each: each.size):
        first.setdefault(each.parameter, each)
    return [*first.values()]


def rows(
    rig: Rig, changes: Sequence[Mitigation], signs: Signs = ASCII
) -> Iterator[str]:
    """A table of changes: parameter, from, to, factor; under it what a file has to
    give anew with it.
    """
    table = []
    for change in changes:
        factor = change.to / change.now
        sign = signs.times if factor > 1 else signs.over
        size = f"{sign} {number(max(factor, 1 / factor), 2)}"
        table.append((change, *_from_to(rig, change), size))
    _, *columns = zip(*table, strict=True) if table else ((),)
    wide = [max(map(len, column)) for column in columns]
    for change, label, now, to, size in table:
        name, before, after, _ = wide
        yield f"{label:<{name}}  {now:>{before}} {signs.to} {to:<{after}}  {size}"
        if also := ", ".join(_also(rig, change)):
            yield f"  and {also}"


def _from_to(rig: Rig, change: Mitigation) -> tuple[str, str, str]:
    """A parameter as people call it, and its value before and after."""
    name = change.parameter
    label = _LABELS.get(name, parameter_named(name).title or name)
    if name == "load" and rig.operation.normal_load:
        label = "normal load"
    if _is_ratio(rig, name):
        ratio = rig.slider.damping_ratio
        after = ratio * change.to / change.now
        return "damping ratio", number(ratio, 3), number(after, 3)
    before, after = (amount(rig, name, end, 3) for end in (change.now, change.to))
    return label, before, after


def _is_ratio(rig: Rig, name: str) -> bool:
    """Whether a parameter is told as the damping ratio."""
    return name == "damping" and rig.slider.damping_ratio > 0


def _also(rig: Rig, change: Mitigation) -> Iterator[str]:
    """What a file has to give anew with a change, in its own words."""
    name = change.parameter
    there = rig.with_values(**{name: change.to})
    kept = held(there, name)
    told = "damping" if name == "damping" else ""
    for parameter in [name, *([kept.name] if kept else [])]:
        before = beside(rig, parameter)
        for key, value in beside(there, parameter).items():
            another = key == "v_half" and "interface.v_half" not in rig.given
            if value != before.get(key) and not another and parameter != told:
                yield f"{key} {value}"


def _next(found: Findings) -> Iterator[str]:
    """What to do where no change alone will do, or each is large."""
    changes = found.mitigations
    tried = found.attempts or found.unreliable
    if not changes and tried:
        yield "No single change within the ranges searched stops it."
    if left := len(found.not_searched):
        yield f"{left} parameter{'s' * (left > 1)} not fully searched: --thorough."
    if found.combined:
        yield f"The smallest two together: {changes_in_words(found, *found.combined)}."
    elif changes and min(each.size for each in changes) > math.log(WIDEST):
        yield "All are large: try two together with --smooth."
    elif tried and not changes:
        ends = found.between or (found.rig.velocity, found.rig.velocity)
        low, high = (quantity(found.rig, end, "velocity") for end in ends)
        yield f'Next: --smooth "{low}" "{high}" tries two together.'


def how_sure(rig: Rig, doubt: Doubt | None) -> Iterator[str]:
    """How many of the rigs that the assumptions allow oscillate, and what to measure
    first; nothing where nothing was varied.
    """
    if doubt is None:
        return
    among = f"{doubt.draws} draws of the fit"
    if len(doubt.matters) <= len(doubt.assumed):
        ranges = [key for key in doubt.assumed if rig.assumed[key].factors]
        within = " (or the range of the file)" if ranges else ""
        factor = number(WIDEST)
        among = (
            f"{doubt.draws} rigs within a factor {factor}{within} of what was assumed"
        )
    known = round(doubt.draws * (1.0 - doubt.undecided))
    count = round(doubt.oscillates * known) if known else 0
    words = f"{count} of {among} oscillate."
    if known < doubt.draws:
        told = f"{known} were decided: {'all' if count == known else count} oscillate"
        words = f"Of {among} {told if known else 'none could be decided'}"
        words += " (--thorough decides more)." if doubt.ended else "."
    yield f"How sure?  {words}"
    if doubt.decides:
        key, *parts = doubt.matters[0]
        larger, smaller = map(percent, parts)
        _, _, name = key.partition(".")
        yield f"  Measure {name}: smaller, {smaller} oscillate; larger, {larger}."
