"""How long a run would take, said before it starts: each engine says it by part, for
what it follows.

The costs are those of one core of a desktop machine, measured in CPU time of runs; how
much faster or slower this machine is, a few thousandths of a second show.

>>> from stickslip.simulation import estimate
>>> estimate(ss.example("pmma_slider")).seconds < 60
True
"""

import logging
import math
import time
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincc

from stickslip.errors import InputError
from stickslip.model import (
    Contacts,
    ElasticBody,
    FromSliding,
    Mass,
    QuasiStatic,
    Slider,
)
from stickslip.model.drive import Piece, Travel
from stickslip.model.rig import Rig
from stickslip.progress import in_time

LONGEST = 3600.0  # seconds that a run may take without being asked for
ANNOUNCED = 60.0  # seconds above which a run is announced
LARGEST = 4e9  # bytes that it may take

_RADIAN = 6e-7  # seconds a radian of the slider's oscillation takes
SAMPLES = "simulation.interval"  # the key of their work
# seconds and bytes a sample takes
_SAMPLE = (2.5e-7, 200.0)
_SAMPLE_OF_BLOCK = (2e-8, 120.0)
# bytes of a stretching in a snapshot, with its weight, and of a bin
_STRETCHING = 16.0
_BIN = 8.0
# samples of a run whose output does not say
_FEWEST = 2e3
_MOST = 5e4
_NUMBERS = 2e6  # such samples of an elastic slider, times its blocks
# Integrals that show how fast a machine is, by scalar arithmetic with branches as that
# of the kernels; the seconds of the machine of the costs; and trials, the best counts.
_INTEGRALS, _REFERENCE, _TRIALS = 2000, 1.15e-4, 20


@cache
def slowness() -> float:
    """How many times longer this machine takes for the same work than the one that
    the costs were measured on.
    """
    places = np.linspace(0.001, 0.999, _INTEGRALS)
    best = math.inf
    for _ in range(_TRIALS):
        begun = time.perf_counter()
        gammaincc(3.3, places)
        best = min(best, time.perf_counter() - begun)
    return best / _REFERENCE


class Part(NamedTuple):
    """One kind of work in a run: `what` in words, and the number of the rig that it
    grows with, to a `power`.

    `key` is that of a rig file, `value` in natural units, of a `quantity` or a pure
    number.
    """

    key: str
    value: float
    quantity: str | None
    power: float
    what: str
    seconds: float
    bytes: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Work:
    """What a run of a rig would take, by part."""

    rig: Rig
    parts: tuple[Part, ...]

    @property
    def seconds(self) -> float:
        """Time of one core of this machine."""
        return self.reference_seconds * slowness()

    @property
    def reference_seconds(self) -> float:
        """Time of one core of the machine that the costs were measured on, the same
        everywhere.
        """
        return float(sum(part.seconds for part in self.parts))

    @property
    def bytes(self) -> float:
        """Memory."""
        return float(sum(part.bytes for part in self.parts))

    @property
    def longest(self) -> Part:
        """Part that takes most of the time."""
        return max(self.parts, key=attrgetter("seconds"))

    def check(
        self,
        seconds: float = LONGEST,
        bytes: float = LARGEST,
        otherwise: str = "ask for it all the same: long=True (--long)",
    ) -> None:
        """Raise `InputError` if the work is more than this; the message names what
        to change, and `otherwise`.
        """
        for of, most, scale, amount in (
            ("seconds", seconds, slowness(), in_time(self.seconds)),
            ("bytes", bytes, 1.0, f"{self.bytes / 1e9:.2g} GB"),
        ):
            excess = getattr(self, of) / most
            if excess <= 1:
                continue
            worst = max(self.parts, key=attrgetter(of))
            over = max(getattr(worst, of) * scale / most, 1.0)
            allowed = worst.value * over ** (-1.0 / worst.power)
            given, bound = (
                f"{value:.4g}"
                if worst.quantity is None
                else self.rig.in_units(value, worst.quantity)
                for value in (worst.value, allowed)
            )
            # contacts take as much memory in a short run
            lasts = of == "seconds" or worst.key == SAMPLES
            shorter = f", or a drive {excess:.2g} times shorter" * lasts
            raise InputError(
                f"{worst.key} = {given}: {worst.what} would take about {amount}; "
                f"give at {'most' if worst.power > 0 else 'least'} "
                f"{bound}{shorter}; or {otherwise}",
                worst.key,
            )


def announce(name: str, seconds: float, what: str) -> None:
    """Log one line of work of more than a minute; by default on standard error."""
    if seconds > ANNOUNCED:
        words = f"{name}: about {in_time(seconds)} on one core: {what}"
        logging.getLogger("stickslip").warning(words)


class Course(NamedTuple):
    """What contacts and slider go through in a run; pieces of the drive that end on a
    condition are taken as a whole.

    `distance` is the way of the drive and `shaken` that of a slider that a perturbation
    has set ringing, in mean thresholds. The slider turns by so many radians, and rings
    for `rung` of them, where it sticks, as far as in `loud` ones undamped.
    """

    distance: float
    shaken: float = 0.0
    turns: float = 0.0
    rung: float = 0.0
    loud: float = 0.0


def course_of(rig: Rig) -> Course:
    """Return what a run goes through."""
    slider = rig.slider
    duration = rig.drive.duration
    pieces = rig.drive.pieces
    mean = rig.interface.threshold_distribution.moment(1)
    distance = sum(way_of(piece) for piece in pieces) / mean
    if not isinstance(slider, Slider | Mass) or slider.mass == 0:
        return Course(distance)
    stiffness = getattr(slider, "stiffness", 0.0)
    frequency = math.sqrt((stiffness + 1.0) / slider.mass)
    # A slip leaves the slider ringing, the longer, the less it is damped.
    damping_ratio = slider.damping / (2.0 * frequency)
    turns = frequency * duration
    rings = 1.0 / damping_ratio if damping_ratio > 0 else math.inf
    shaken = 0.0
    if isinstance(rig.start, FromSliding):
        velocity = abs(rig.drive.velocity)
        largest = float(np.max(np.abs(rig.start.perturbation))) * velocity
        shaken = largest / (mean * frequency) * min(turns, rings)
    # as does a drive that jumps to another velocity
    jumps = sum(a.end != b.start for a, b in pairwise(pieces))
    slips = 1.0 + jumps + distance * min(stiffness, 1.0)
    loud = min(turns, rings * slips)
    return Course(distance, shaken, turns, min(turns, 10.0 * rings * slips), loud)


def way_of(piece: Piece) -> float:
    """How far the drive goes in a piece, at most; a slider that has gone far enough
    ends it.
    """
    way = 0.5 * (abs(piece.start) + abs(piece.end)) * piece.duration
    return min(way, piece.until.distance) if isinstance(piece.until, Travel) else way


def shortened(piece: Piece) -> Piece:
    """Return a piece that ends where its condition may end it."""
    whole = way_of(replace(piece, until=None))
    share = way_of(piece) / whole if whole else 1.0
    return replace(piece, duration=piece.duration * share, until=None)


def oscillation(
    rig: Rig, radians: float, seconds: float | None = None
) -> tuple[Part, ...]:
    """Return the work of following a slider with mass, of so many seconds."""
    if radians == 0.0:  # of what is no slider, or has no mass
        return ()
    what = f"{radians:.2g} rad of the slider's oscillation"
    seconds = _RADIAN * radians if seconds is None else seconds
    return (Part("slider.mass", rig.slider.mass, "mass", -0.5, what, seconds),)


def sample_interval(rig: Rig, angle: float) -> float:
    """Time between samples: where nothing is said an angle (rad) of the fastest
    oscillation, within bounds on all.
    """
    slider = rig.slider
    duration = rig.drive.duration
    if rig.output.interval is not None:
        return rig.output.interval
    most = _MOST
    turns = course_of(rig).turns
    if isinstance(slider, ElasticBody):
        most = min(max(_NUMBERS / slider.size, 200.0), most)
        turns = duration * math.sqrt(
            (float(slider.pulled.mean()) + 1.0 + slider.coupling) / slider.mass
        )
    return duration / math.ceil(min(max(turns / angle, min(_FEWEST, most)), most))


def sampling(rig: Rig, angle: float) -> Part:
    """Return the work of taking samples."""
    duration = rig.drive.duration
    interval = sample_interval(rig, angle)
    samples = duration / interval
    each = _SAMPLE
    what = "samples"
    if isinstance(rig.slider, ElasticBody):
        samples = samples * rig.slider.size
        each = _SAMPLE_OF_BLOCK
        what = "samples of blocks"
    seconds, size = (one * samples for one in each)
    return Part(
        SAMPLES,
        interval,
        "time",
        -1.0,
        f"{samples:.2g} {what}",
        seconds,
        size,
    )


def contacts_of(rig: Rig) -> int:
    """Number of contacts that are followed one by one in a run."""
    method = rig.method
    if not isinstance(method, Contacts | QuasiStatic):
        return 0
    return method.count * (
        rig.slider.size if isinstance(rig.slider, ElasticBody) else 1
    )


def pieces_and_looks(rig: Rig, each: float) -> tuple[Part, ...]:
    """Return the work of the pieces of a drive and of snapshots, each of so many
    seconds to begin.
    """
    pieces = len(rig.drive.pieces)
    looks = len(rig.output.snapshots)
    contacts = contacts_of(rig)
    stretchings = _STRETCHING * contacts + _BIN * rig.output.bins
    found = []
    if pieces > 1:
        what = f"{pieces:.2g} pieces of the drive"
        found.append(Part("drive.pieces", pieces, None, 1.0, what, each * pieces))
    if looks:
        what = f"{looks:.2g} snapshots"
        seconds = each * looks
        room = stretchings * looks
        key = "simulation.snapshots"
        found.append(Part(key, looks, None, 1.0, what, seconds, room))
    return tuple(found)


def breaking(
    count: float,
    lifetimes: float,
    each: float,
    bytes: float,
    how: str = "",
    more: float = 0.0,
) -> Part:
    """Return the work of breaks of N contacts, `each` of so many seconds, and some
    `more`.
    """
    what = f"about {count * lifetimes:.2g} breaks of {count:.2g} contacts{how}"
    return Part(
        "simulation.contacts",
        count,
        None,
        1.0,
        what,
        each * count * lifetimes + more,
        bytes * count,
    )
