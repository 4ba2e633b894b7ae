"""Estimate of the work of a run of the master equation, from a trial of its first part:
no theory gives how often a rig slips, or how long it rings.
"""

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from stickslip.errors import UndecidedError
from stickslip.kernels.effective_stretching import energy, is_fixed
from stickslip.kernels.quadrature import P, Q
from stickslip.kernels.records import Record
from stickslip.model import FromSliding, Interface
from stickslip.model.drive import Piece
from stickslip.model.rig import Rig
from stickslip.simulation.engines.base import Leg, advances
from stickslip.simulation.estimates import LONGEST, Course, shortened, travel_of

if TYPE_CHECKING:
    from stickslip.simulation.engines.panels import Panels

# approximate seconds per mean threshold, the factor where cohorts have clocks, and
# seconds of a radian of the slider's oscillation
_PATH, _CLOCKED, _RADIAN = 1.2e-3, 10.0, 5e-5
# least seconds per mean threshold, in steps as wide as the widest panel
FEWEST = 5e-5
WORTH_A_TRIAL = 0.02  # estimated seconds above which a trial is made
_STEP, _DRAW, _NODE = 1.7e-5, 1.3e-7, 7.5e-8
_AT_RISK, _HEATED, _PULLED = 5e-7, 1e-6, 9e-6
"""Seconds of a step, and of a node of counted contacts in it; then, in each sweep of
Newton's method, seconds of a node, and additional seconds where thresholds have knots
or grow, where contacts may break thermally, and where they are pulled too fast for
that.
"""
# Seconds of each further stretching of newborns at a node in a sweep, and the factor
# where thresholds have knots.
_ATTACHED, _KNOTTED = 5e-7, 3.5
_SQUARED = 1.7  # cost factor for a barrier of elastic energy: square roots
_AT_ONCE = 20  # steps between two checks of a trial
_LEAST, _SHARE, _MOST = 0.1, 0.05, 2.0
"""A trial takes _LEAST seconds, or the fraction _SHARE of the whole run if that is
more, and never more than _MOST seconds.
"""
_HOPELESS = 100.0  # excess over the limit at which a rough estimate is enough to refuse
_ROUNDS = 6.0  # lives of contacts after which a run shows its lasting behaviour
_BROKEN = 0.5  # breaks per contact at which the first slip has begun
_RINGS = 100.0  # least number of radians that are followed after the first slip
_DIES = 10.0
"""Decay times after which the steps of a ringing slider are as long as without
ringing: they grow as the 6th root of the remaining amplitude over an error of 1e-4.
"""
_SECTIONS = 8  # most sections of a drive, except the parts of ramps
_OF_RAMP = 4  # parts of a ramp
_SETTLED = 0.4  # fraction of a trial after which the first slips are past


def seconds_of_path(interface: Interface, course: Course) -> float:
    """Approximate seconds of a run without a trial."""
    clocked = bool(interface.mechanisms & {"ageing", "activation"})
    path = _PATH * (course.distance + course.shaken)
    return path * (_CLOCKED if clocked else 1.0) + _RADIAN * course.rung


def seconds_since(before: Record, engine: "Panels") -> float:
    """Seconds of the work since these counts, with the present number of cohorts."""
    used = engine.state.used
    breaking = engine.case.breaking
    counted = engine.case.finite is not None
    nodes = Q * used.cohorts
    cohorts = engine.state.cohorts[: used.cohorts]
    bottom = breaking.thresholds.bottom
    sweep = _NODE * nodes
    if breaking.width > 0.0:
        may_break = (bottom <= cohorts.reach) | (
            breaking.blurred.bottom <= cohorts.clock
        )
        # nodes at which `survival` is an integral
        excess = (cohorts.clock - energy(breaking, cohorts.reach)) / breaking.width
        pulled = (np.abs(excess + 16.0) < 20.0) & (bottom < cohorts.reach)
        heated = _HEATED * may_break.sum() + _PULLED * pulled.sum()
        sweep += heated * (_SQUARED if breaking.squared else 1.0)
    elif not is_fixed(breaking) or (breaking.knots.size and not counted):
        sweep += _AT_RISK * (bottom <= cohorts.reach).sum()
    further = engine.case.newborn.stretching.size - 1
    knotted = _KNOTTED if breaking.knots.size else 1.0
    sweep += _ATTACHED * knotted * P * Q * further
    step = _STEP + _DRAW * nodes * counted
    steps = used.steps - before.steps
    sweeps = used.sweeps - before.sweeps
    return float(steps * step + sweeps * sweep)


def seconds_of_run(engine: "Panels", position: float, rig: Rig) -> float:
    """Estimate the seconds of a run from a position of the drive, by trials of the
    first part of each of its sections, in order.

    Each trial lasts beyond the first slip and some radians of the oscillation after it,
    unless that alone takes too long.
    """
    sections = _sections(rig.drive.pieces)
    seconds = 0.0
    for pieces in sections:
        trial = _Trial(rig, pieces, engine.here()[0], len(sections))
        position = trial.follow(engine, position)
        seconds += trial.whole()
    return seconds


def _sections(pieces: tuple[Piece, ...]) -> list[list[Piece]]:
    """Cut a drive into sections for trials: single pieces if they are few, and ramps
    into parts, as the first part of a ramp does not represent the others.
    """
    count = min(len(pieces), _SECTIONS)
    ends = [len(pieces) * i // count for i in range(count + 1)]
    if len(pieces) > _SECTIONS:
        return [[*map(shortened, pieces[a:b])] for a, b in pairwise(ends)]
    return [[part] for piece in pieces for part in _parts(shortened(piece))]


def _parts(piece: Piece) -> list[Piece]:
    """Cut a ramp into parts."""
    count = 1 if piece.start == piece.end else _OF_RAMP
    speeds = np.linspace(piece.start, piece.end, count + 1)
    return [
        Piece(start=float(start), end=float(end), duration=piece.duration / count)
        for start, end in pairwise(speeds)
    ]


class _Trial:
    """Trial of a section, one of `some`: its times since its begin, the seconds spent
    up to each, and the time of the first slip.
    """

    def __init__(
        self,
        rig: Rig,
        pieces: list[Piece],
        begin: float,
        some: int,
    ) -> None:
        slider = rig.slider
        mean = rig.interface.threshold_distribution.moment(1)
        self.begin = begin
        self.some = some
        self.pieces = pieces
        self.end = sum(piece.duration for piece in pieces)
        self.times = [0.0]
        self.spent = [0.0]
        self.slip = math.inf
        self.slides = isinstance(rig.start, FromSliding)
        velocity = sum(map(travel_of, pieces)) / self.end
        life = mean / velocity if velocity else math.inf
        # time in which the drive loads a contact to its threshold through the spring
        self.cycle: float = life * (1.0 + 1.0 / slider.stiffness)
        self.shown = min(self.cycle + _ROUNDS * life, _SETTLED * self.end)
        self.rings: float = _DIES / slider.damping if slider.damping else math.inf
        # contacts oscillate with the slider once they have re-attached
        radian = math.sqrt(slider.mass / (slider.stiffness + 1.0))
        delay = rig.interface.delay.moment(1)
        self.least = _RINGS * radian + (delay if math.isfinite(delay) else 0.0)

    def follow(self, engine: "Panels", position: float) -> float:
        """Follow the pieces until the rest can be estimated; return the position of the
        drive then.
        """
        for piece in self.pieces:
            leg = Leg.along(piece, engine.here()[0], position)
            try:
                is_enough = self._follow_leg(engine, leg)
            except UndecidedError:  # the run itself will end there as well
                is_enough = True
            position = float(leg.drive_position(np.asarray(engine.here()[0])))
            if is_enough:
                break
        return position

    def _follow_leg(self, engine: "Panels", leg: Leg) -> bool:
        """Follow a leg; return whether the rest can be estimated."""
        engine.steps = _AT_ONCE
        for _ in advances(engine, leg):
            self.times.append(engine.here()[0] - self.begin)
            self.spent.append(self.spent[-1] + engine.seconds)
            if engine.state.motion.broken > _BROKEN:
                self.slip = min(self.slip, self.times[-1])
            if self.is_enough():
                return True
            engine.steps = _AT_ONCE
        return False

    @property
    def ring(self) -> float:
        """Time for which the slider rings after a slip."""
        return min(self.rings, self.cycle, max(self.end - self.slip, 0.0))

    def is_enough(self) -> bool:
        """Whether the rest can be estimated, or the trial has become too long."""
        seconds = self.some * self.spent[-1]
        now = self.times[-1]
        rung = now - self.slip
        whole = self.some * self.whole()
        hopeless = seconds > _LEAST and whole > _HOPELESS * LONGEST
        if seconds > _MOST or hopeless:
            return True
        if rung < min(self.least, self.ring) and now < self.end:
            return False
        # an oscillation may grow out of smooth sliding, which costs little until then
        little = _LEAST if self.slides else 0.0
        if now >= self.shown and rung >= self.ring and seconds > little:
            return True
        return seconds > max(_LEAST, _SHARE * whole)

    def whole(self) -> float:
        """Estimate the seconds of the whole run from a cycle or the recent rate."""
        now = self.times[-1]
        rung = now - self.slip
        if 0.0 < rung < self.ring:
            return self._of_cycles(self.ring, rung)
        late = int(np.searchsorted(self.times, _SETTLED * now, side="right")) - 1
        past = now - self.times[late]
        rate = (self.spent[-1] - self.spent[late]) / (past or math.inf)
        return self.spent[-1] + rate * (self.end - now)

    def _of_cycles(self, ring: float, rung: float) -> float:
        """Estimate the seconds of cycles that each ring for the time `ring`, when the
        first has rung for the time `rung`.

        Each step leaves a cohort, so the work per unit time grows until cohorts are
        joined, and is constant then: the power of time is taken between the two.
        """
        halfway = self.slip + 0.5 * rung
        first, half = np.interp([self.slip, halfway], self.times, self.spent)
        known = self.spent[-1] - first
        grows = math.log2(known / max(half - first, 1e-300))
        power = min(max(0.5 * (1.0 + grows), 1.0), 1.5)
        each = known * (ring / rung) ** power + first * (1.0 - ring / self.cycle)
        cycles = max((self.end - self.slip) / self.cycle, 1.0)
        # ringing that lasts into the next cycle is part of every cycle but the first
        later = 1.0 + min(self.rings / self.cycle, 1.0)
        return float(first + (1.0 + (cycles - 1.0) * later) * each)
