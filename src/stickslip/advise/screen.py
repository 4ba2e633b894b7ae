"""The short text of an answer, in some twenty lines: verdict, strip of speeds, smallest
changes, and uncertainty.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeGuard

from stickslip.advise.doubt import WIDEST
from stickslip.advise.findings import Findings, WaveFindings
from stickslip.advise.mitigations import Mitigation
from stickslip.advise.sections import (
    ASCII,
    Motion,
    Signs,
    at_work,
    change_rows,
    changes_in_words,
    lengths,
    motion,
    motion_of_waves,
    quantity,
    slips,
)
from stickslip.model.rig import Rig

_ROWS = 5  # most changes that are shown; the details list all
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
"""Marks of the strip of speeds and their meanings, by kind of motion."""
MORE = "More: --details, --plot, report"


class Line(NamedTuple):
    """A line of an answer."""

    text: str
    title: str = ""  #: before the text; bold on a terminal
    whole: bool = False  #: whether it is never wrapped


def place(found: Findings | WaveFindings, speed: float) -> float:
    """Return the position of a speed on the logarithmic strip, from 0 to 1."""
    low, high = found.speeds_searched
    inside = min(max(speed, low), high)
    return math.log(inside / low) / math.log(high / low)


def strip(found: Findings | WaveFindings, count: int) -> list[str]:
    """Return the kind of motion, as in `MARKS`, in each cell of the strip of speeds,
    with "now" between cells at the rig's own speeds; empty if no motion is known.
    """
    if _is_in_time(found):
        return _in_time(found, count)
    if found.theory_note and {band.kind for band in found.bands} <= {"unknown"}:
        return []
    cells = ["unknown" if isinstance(found, Findings) else "stable"] * count
    # narrow bands last, so that none is hidden
    for band in sorted(found.bands, key=lambda band: band.low / band.high):
        kind = "bistable" if band.bistable else band.kind
        places = [place(found, end) for end in band.ends]
        _fill(cells, places, kind if kind in MARKS else "unknown")
    # the speeds at which the rig works, or the ends of these
    several = [speed for speed, _ in getattr(found, "at_speeds", ())]
    marked = getattr(found, "between", None) or several or [found.rig.velocity]
    for speed in sorted(marked, reverse=True):
        cells.insert(round(count * place(found, speed)), "now")
    return cells


def _fill(cells: list[str], places: Sequence[float], kind: str) -> None:
    """Set the cells between two positions, from 0 to 1, to a kind of motion; at least
    one cell.
    """
    first, last = (round(len(cells) * place) for place in places)
    first = min(first, len(cells) - 1)
    last = max(last, first + 1)
    cells[first:last] = [kind] * (last - first)


def _is_in_time(found: Findings | WaveFindings) -> TypeGuard[Findings]:
    """Whether the strip shows the time of a drive with several speeds, from its run."""
    return isinstance(found, Findings) and found.driven is not None


def _in_time(found: Findings, count: int) -> list[str]:
    """Return the kind of motion in each cell of the time of the drive."""
    last = found.along_drive[-1].high
    cells = ["smooth sliding"] * count
    for band in found.along_drive:
        if band.kind != "smooth sliding":
            _fill(cells, [time / last for time in band.ends], band.kind)
    return cells


def ends(found: Findings | WaveFindings) -> list[str]:
    """Return the ends of the strip in words: speeds, or times of a drive with several
    speeds.
    """
    if _is_in_time(found):
        end = found.along_drive[-1].high
        return [quantity(found.rig, time, "time", 3) for time in (0.0, end)]
    return ends_of_speeds(found)


def ends_of_speeds(found: Findings | WaveFindings) -> list[str]:
    """Return the lowest and the highest speed searched, in words."""
    return [quantity(found.rig, v, "velocity", 3) for v in found.speeds_searched]


def title(rig: Rig) -> str:
    """Return the name of a rig and the speeds of its drive, in order."""
    speeds = [rig.in_units(abs(each), "velocity") for each in rig.drive.velocities]
    moving = f"at {speeds[0]}" if len(set(speeds)) == 1 else " - ".join(speeds)
    return f"{rig.name}, {moving}"


def legend(kinds: Sequence[str]) -> str:
    """Return the meaning of the marks that a strip contains."""
    there = [sign for kind, sign in MARKS.items() if kind in kinds]
    words = "  ".join(f"{mark} {meaning}" for mark, meaning in there)
    return words + " (its speeds)" * (kinds.count("now") > 1)


def verdict(motion: Motion) -> str:
    """Return the kind of motion in capitals, followed by its numbers."""
    return f"{motion.kind.upper()}   {motion.rest.lstrip(',;: ')}".rstrip()


def lines_of_waves(found: WaveFindings, signs: Signs = ASCII) -> Iterator[str | Line]:
    """Yield the lines below verdict and strip, for an elastic slider."""
    more = motion_of_waves(found).more
    yield from map("  {}".format, filter(None, (*slips(found), more, *lengths(found))))
    if found.mitigations:
        yield ""
        yield Line("", "What would make smooth sliding stable, each alone, by theory")
        yield from table(found.rig, found.mitigations[:_ROWS], signs)
    elif found.attempts:
        yield ""
        yield "No single change within the ranges searched makes smooth sliding stable."
    if found.not_searched:
        left = ", ".join(found.not_searched)
        yield from textwrap.wrap(f"Left out: {left}; --thorough searches.", 80)
    yield from ("", MORE)


def lines(found: Findings, signs: Signs = ASCII) -> Iterator[str | Line]:
    """Yield the lines below verdict and strip: more on the motion, the changes, and the
    uncertainty.
    """
    sentences = [motion(found).more, *at_work(found)]
    if found.has_verdict and not strip(found, 1):
        sentences.append(found.theory_note)
    yield from map("  {}".format, filter(None, sentences))
    if changes := [*_changes(found, signs)]:
        yield from ("", *changes)
    yield ""
    if found.doubt:
        first, *rest = found.doubt.short()
        yield f"How sure?  {first}"
        yield from map("  {}".format, rest)
    yield MORE


def _changes(found: Findings, signs: Signs) -> Iterator[str | Line]:
    """Yield the table of the changes that stop an oscillation or, if sliding is smooth,
    of those that end it; the smallest first.
    """
    changes: Sequence[Mitigation] = ()
    title = "What would end it, each alone (linear stability)"
    if found.needs_mitigation:
        title = "What stops it, each alone (8 of 8 runs slide smoothly)"
        changes = found.mitigations
    elif found.smooth:
        limits = [each.nearest for each in found.margins if each.nearest]
        changes = sorted(limits, key=lambda each: each.size)
    # changes that can be made on the machine come first
    shown = sorted(changes[:_ROWS], key=lambda each: each.size)
    if shown:
        yield Line("", title)
        yield from table(found.rig, shown, signs)
    after = [*_next(found)] if found.needs_mitigation and found.complete else []
    if more := len(changes) - len(shown):
        after.insert(0, f"and {more} more: --details.")
    if after:
        yield "  " * bool(shown) + " ".join(after)


def table(
    rig: Rig, changes: Sequence[Mitigation], signs: Signs = ASCII
) -> Iterator[str]:
    """Yield a table of changes: parameter, old and new value, factor; and below each
    the other values of the file that change with it.
    """
    rows = [*change_rows(rig, changes, signs)]
    name, before, _, after, *_ = (
        max(map(len, column)) for column in zip(*rows, strict=True)
    )
    for label, now, arrow, then, size, also in rows:
        yield f"  {label:<{name}}  {now:>{before}} {arrow} {then:<{after}}  {size}"
        if also:
            yield f"    and {also}"


def _next(found: Findings) -> Iterator[str]:
    """Yield advice for when no single change suffices, or all are large."""
    changes = found.mitigations
    in_vain = not changes and bool(found.attempts or found.unreliable)
    if in_vain:
        yield "No single change within the ranges searched stops it."
    if left := len(found.not_searched):
        yield f"{left} parameter{'s' * (left > 1)} not fully searched: --thorough."
    if found.combined:
        yield f"The smallest two together: {changes_in_words(found, *found.combined)}."
    elif changes and min(each.size for each in changes) > math.log(WIDEST):
        yield "All are large: try two together with --smooth."
    elif in_vain:
        ends = found.between or [found.rig.velocity] * 2
        low, high = (quantity(found.rig, end, "velocity") for end in ends)
        yield f'Next: --smooth "{low}" "{high}" tries two together.'
