"""The answer for a position-controlled axis: whether it tracks steadily, whether it
hunts at rest, and what stops hunting.
"""

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from stickslip.advise.answer import as_html
from stickslip.advise.sections import Section
from stickslip.answers import Answer
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.progress import Progress, part
from stickslip.stability import count_unstable
from stickslip.structures.hunting import (
    Hunt,
    Move,
    Slip,
    Tracking,
    is_unstable,
    strengthens,
    tracking,
    with_gain,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True, repr=False)
class AxisAnswer(Answer):
    """Whether an axis tracks steadily and whether it hunts at rest.

    Numbers are in natural units; the text and `to_dict` convert them to the rig's own.
    """

    rig: Rig
    tracking: Tracking | None  #: None for an axis that only holds a position
    _hunt: Hunt = field(compare=False)  #: simulates the moves
    moves: tuple[Move, ...] = ()  #: the moves tried; empty if hunting is impossible
    #: proportional gain above which hunting ends, at the same damping ratio and
    #: integral time
    gain: float = math.nan
    complete: bool = field(default=False, compare=False)

    @property
    def slip(self) -> Slip:
        """One slip of the axis when it is pulled slowly."""
        return self._hunt.slip

    @property
    def possible(self) -> bool:
        """Whether hunting at rest is possible at all."""
        return self._hunt.possible and not self.diverges

    @property
    def diverges(self) -> str:
        """State of the contacts, broken or attached, in which the controller itself
        makes the axis unstable; empty if it is stable in both.
        """
        states = (0.0, "all contacts are broken"), (1.0, "all contacts are attached")
        axis = self._hunt.axis
        return next((word for k, word in states if is_unstable(axis, k)), "")

    @property
    def hunts(self) -> bool:
        """Whether the axis hunts after one of the moves."""
        return any(move.hunts for move in self.moves)

    @property
    def peak_to_peak(self) -> float:
        """Width of hunting: the largest of the moves tried, else estimated from one
        slip.
        """
        seen = [move.peak_to_peak for move in self.moves if move.hunts]
        return max(seen, default=self.slip.peak_to_peak)

    @property
    def headline(self) -> str:
        """The verdict in one line."""
        return f"{self._at_speed}; at rest: {self._at_rest}"

    @property
    def sections(self) -> list[Section]:
        """The text below the name of the rig."""
        lines = [line.strip() for line in str(self).splitlines()[1:]]
        return [Section("axis", lines)]

    def html(self, **page: Any) -> str:
        """Return the answer as a page with further contents `page`."""
        return as_html(self, page=page)

    def _length(self, value: float) -> str:
        return self.rig.in_units(value, "x_s", 2)

    @property
    def _at_speed(self) -> str:
        found = self.tracking
        if found is None:
            return "no speed to track at"
        speed = self.rig.in_units(abs(self.rig.natural.velocity), "x_s/time", 3)
        if found.without_integral:
            return f"not steady at {speed}, even without an integral"
        if found.limit == math.inf:
            return f"steady at {speed}, whatever Ki"
        how = "unsteady" if found.unstable else "steady"
        but = "; steady" if found.unstable else ""
        return f"{how} at {speed}{but} up to Ki = {self._integral(found.limit)}"

    def _gain_in_words(self, kp: float) -> str:
        return f"Kp = {self.rig.in_units(kp, 'k', 3)}"

    def _integral(self, value: float) -> str:
        return self.rig.in_units(value, "k/time", 3)

    @property
    def _at_rest(self) -> str:
        width = self._length(self.peak_to_peak)
        if self.diverges:
            return "unstable by its controller"
        if not self.possible:
            return "cannot hunt"
        if self.hunts:
            which = "may hunt, depending on the move,"
            if all(move.hunts for move in self.moves):
                which = "hunts after every move tried,"
            return f"{which} by {width} peak to peak"
        if self.moves:
            return f"hunts after none of {len(self.moves)} moves"
        return f"may hunt, by about {width} peak to peak"

    def __str__(self) -> str:
        axis = self._hunt.axis
        lines = [self.rig.name, f"  at speed   {self._at_speed}"]
        found = self.tracking
        if found is not None and math.isfinite(found.frequency):
            per = "Hz" if self.rig.scales else "cycles per time unit"
            rate = found.frequency * self.rig.unit("1/time")
            lines.append(f"             beyond it oscillates at {rate:.3g} {per}")
            lines.append(f"             Ki now: {self._integral(axis.ki)}")
        lines.append(f"  at rest    {self._at_rest}")
        lines += [f"             {line}" for line in self._evidence()]
        if self.hunts and math.isfinite(self.gain):
            kp = self.rig.in_units(self.gain, "k", 3)
            lines += [
                f"             to stop it, raise Kp above {kp}, Kd and Ki with it",
                "             (same damping and Kp/Ki); or hold without the integral",
            ]
            raised = with_gain(axis, self.gain)
            there = replace(self.rig.natural, slider=raised)
            if found is not None and count_unstable(there):
                lines.append("             with that Kp it is unsteady at speed")
        if axis.sample_time:
            lines.append("  roots with the hold between samples; moves with each")
        return "\n".join(lines)

    def _evidence(self) -> list[str]:
        """Return the evidence for the verdict at rest, in lines."""
        if self.diverges:
            sampled = " and its sample time" * bool(self._hunt.axis.sample_time)
            return [f"its gains{sampled} make it diverge", f"while {self.diverges}"]
        if not strengthens(self.rig.interface):
            return ["contacts do not strengthen with rest: no delay, no ageing"]
        if self._hunt.axis.ki == 0.0:
            return ["without an integral (Ki = 0) nothing pulls it off its place"]
        if not self.slip.length:
            return ["pulled slowly it slides off without a slip"]
        away, slip = map(self._length, (self.slip.break_away, self.slip.length))
        than = "further" if self.possible else "no further"
        lines = [
            f"pulled slowly, it breaks away after {away}",
            f"and slips {slip}, {than} than that",
        ]
        for hunts, word in ((True, "hunts after"), (False, "settles after")):
            moves = [m for m in self.moves if m.hunts is hunts]
            if moves:
                which = ", ".join(self._length(m.distance) for m in moves)
                lines.append(f"{word} moves of {which}")
        return lines

    def text(self, width: int = 80, **_: Any) -> str:
        """Return the answer as the command line prints it."""
        del width
        return str(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers in the rig's own units."""
        rig = self.rig
        length, time = rig.unit("x_s"), rig.unit("time")
        found = self.tracking
        limit = found.limit if found else math.nan
        answer = {
            "name": rig.name,
            "unstable_roots": found.unstable if found else None,
            "unstable_without_integral": found.without_integral if found else None,
            "ki_limit": limit * rig.unit("k/time") if math.isfinite(limit) else None,
            "ki_unit": rig.unit_name("k/time"),
            "can_hunt": self.possible,
            "diverges": bool(self.diverges),
            "hunts": self.hunts if self.moves or not self.possible else None,
            "peak_to_peak": self.peak_to_peak * length if self.possible else 0.0,
            "break_away": self.slip.break_away * length,
            "slip": self.slip.length * length,
            "length_unit": rig.unit_name("x_s"),
            "kp_to_stop": self.gain * rig.unit("k") if self.hunts else None,
            "kp_unit": rig.unit_name("k"),
        }
        moves = [
            {
                "distance": move.distance * length,
                "peak_to_peak": move.peak_to_peak * length,
                "period": move.period * time if move.hunts else None,
                "hunts": move.hunts,
            }
            for move in self.moves
        ]
        return answer | {"moves": moves}

    def plot(self) -> "Figure":
        """Draw the position after a move, if possible one that hunts, and its target;
        if it hunts, also with the gain that stops hunting.
        """
        from stickslip.plot import PAGE, style
        from stickslip.plot.palette import BLUE, GREEN
        from stickslip.simulation import simulate

        hunt = self._hunt
        order = sorted(self.moves, key=lambda move: not move.hunts)
        distance = order[0].distance if order else hunt.moves[0]
        hold = 12.0 * hunt.period if hunt.axis.ki else 100.0
        go = constant(hunt.speed, distance / hunt.speed)
        drive = go.then(constant(0.0, hold))
        moved = replace(self.rig, drive=drive, method=hunt.method)
        now = self._gain_in_words(hunt.axis.kp)
        runs = {now: simulate(moved, long=True)}
        if self.hunts and math.isfinite(self.gain):
            quiet = with_gain(hunt.axis, self.gain)
            after = replace(moved, slider=quiet)
            runs[self._gain_in_words(self.gain)] = simulate(after, long=True)
        with style.house_style():
            figure = style.new_figure(PAGE)
            ax = figure.add_subplot()
            place = distance * self.rig.unit("x_s")
            for (label, run), color in zip(runs.items(), (BLUE, GREEN), strict=False):
                style.along_time(run, "displacement", ax, label=label, color=color)
            ax.axhline(place, linestyle=":", color="gray", label="place to reach")
            style.legend_above(ax)
        return figure


def judge_axis(rig: Rig, *, fast: bool, progress: Progress) -> AxisAnswer:
    """Return the answer for an axis; with `fast`, without simulated moves."""
    moving = rig.natural.velocity != 0.0
    roots = tracking(rig) if moving else None
    progress(0.2)
    hunt = Hunt(rig)
    found = AxisAnswer(rig=rig, tracking=roots, _hunt=hunt)
    return found if fast else complete_axis(found, part(progress, 0.3, 1.0))


def complete_axis(found: AxisAnswer, progress: Progress) -> AxisAnswer:
    """Return the answer with the simulated moves, and the gain that stops hunting."""
    hunt = found._hunt
    if not found.possible:
        return replace(found, complete=True)
    moves = []
    for i, distance in enumerate(hunt.moves):
        moves.append(hunt.move(distance))
        progress(0.5 * (i + 1) / len(hunt.moves))
    gain = hunt.fold() if any(move.hunts for move in moves) else math.nan
    return replace(found, moves=tuple(moves), gain=gain, complete=True)
