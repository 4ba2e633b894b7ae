"""Time and memory that a run will take, estimated by each engine, by part, before the
run starts.

The costs are CPU times measured on one core of a desktop machine. The relative
speed of the present machine is measured in a few milliseconds.

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

LONGEST = 3600.0  # seconds of a run above which it is refused unless `long`
ANNOUNCED = 60.0  # seconds above which a run is announced
LARGEST = 4e9  # bytes of a run above which it is refused unless `long`

_RADIAN = 6e-7  # seconds of a radian of the slider's oscillation
SAMPLES = "simulation.interval"  # rig-file key that sets the work of samples
# seconds and bytes of a sample
_SAMPLE = (2.5e-7, 200.0)
_SAMPLE_OF_BLOCK = (2e-8, 120.0)
# bytes of a stretching with its weight in a snapshot, and of a bin
_STRETCHING = 16.0
_BIN = 8.0
# bounds of the number of samples of a run where `Output.interval` is not given
_FEWEST = 2e3
_MOST = 5e4
_NUMBERS = 2e6  # the same for an elastic slider: samples times blocks
# Integrals whose time shows the speed of a machine, by scalar arithmetic with branches
# like that of the kernels; their seconds on the machine of the costs; and the number of
# trials, of which the fastest counts.
_INTEGRALS, _REFERENCE, _TRIALS = 2000, 1.15e-4, 20


@cache
def slowness() -> float:
    """Time that this machine takes for a given work, over the time of the machine on
    which the costs were measured.
    """
    places = np.linspace(0.001, 0.999, _INTEGRALS)
    best = math.inf
    for _ in range(_TRIALS):
        begun = time.perf_counter()
        gammaincc(3.3, places)
        best = min(best, time.perf_counter() - begun)
    return best / _REFERENCE


class Part(NamedTuple):
    """One kind of work in a run: `what` in words, and the number of the rig to whose
    `power` it is proportional.

    `key` is the name of the number in rig files, `value` its value in natural units, of
    a `quantity`, or None for a pure number.
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
    """Work of a run of a rig, by part."""

    rig: Rig
    parts: tuple[Part, ...]

    @property
    def seconds(self) -> float:
        """CPU time on one core of this machine."""
        return self.reference_seconds * slowness()

    @property
    def reference_seconds(self) -> float:
        """CPU time on one core of the machine on which the costs were measured, equal
        on all machines.
        """
        return float(sum(part.seconds for part in self.parts))

    @property
    def bytes(self) -> float:
        """Memory in bytes."""
        return float(sum(part.bytes for part in self.parts))

    @property
    def longest(self) -> Part:
        """The part that takes most of the time."""
        return max(self.parts, key=attrgetter("seconds"))

    def check(
        self,
        seconds: float = LONGEST,
        bytes: float = LARGEST,
        otherwise: str = "ask for it all the same: long=True (--long)",
    ) -> None:
        """Raise `InputError` if the work exceeds these limits; the message names the
        number to change, and ends with `otherwise`.
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
            # a shorter run needs as much memory for its contacts
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
        words = f"{name or 'run'}: about {in_time(seconds)} on one core: {what}"
        logging.getLogger("stickslip").warning(words)


class Course(NamedTuple):
    """Motion of contacts and slider in a run; pieces of the drive that end on a
    condition count in full.

    `distance` is the travel of the drive and `shaken` the travel of a slider that rings
    from a perturbation, in mean thresholds. `turns` is the phase of the slider's
    oscillation in the whole run, in radians; in `rung` of them it rings where it
    sticks.
    """

    distance: float
    shaken: float = 0.0
    turns: float = 0.0
    rung: float = 0.0


def course_of(rig: Rig) -> Course:
    """Estimate the motion in a run of a rig."""
    slider = rig.slider
    duration = rig.drive.duration
    pieces = rig.drive.pieces
    mean = rig.interface.threshold_distribution.moment(1)
    distance = sum(travel_of(piece) for piece in pieces) / mean
    if not isinstance(slider, Slider | Mass) or slider.mass == 0:
        return Course(distance)
    stiffness = getattr(slider, "stiffness", 0.0)
    frequency = math.sqrt((stiffness + 1.0) / slider.mass)
    # A slip leaves the slider ringing, the longer the less it is damped.
    damping_ratio = slider.damping / (2.0 * frequency)
    turns = frequency * duration
    rings = 1.0 / damping_ratio if damping_ratio > 0 else math.inf
    shaken = 0.0
    if isinstance(rig.start, FromSliding):
        velocity = abs(rig.drive.velocity)
        largest = float(np.max(np.abs(rig.start.perturbation))) * velocity
        shaken = largest / (mean * frequency) * min(turns, rings)
    # so does a jump of the drive's velocity
    jumps = sum(a.end != b.start for a, b in pairwise(pieces))
    slips = 1.0 + jumps + distance * min(stiffness, 1.0)
    return Course(distance, shaken, turns, min(turns, 10.0 * rings * slips))


def travel_of(piece: Piece) -> float:
    """Return the largest travel of the drive in a piece; a `Travel` may end it."""
    travel = 0.5 * (abs(piece.start) + abs(piece.end)) * piece.duration
    if isinstance(piece.until, Travel):
        return min(travel, piece.until.distance)
    return travel


def shortened(piece: Piece) -> Piece:
    """Return a piece cut at the time at which its `Travel` condition may end it."""
    whole = travel_of(replace(piece, until=None))
    fraction = travel_of(piece) / whole if whole else 1.0
    return replace(piece, duration=piece.duration * fraction, until=None)


def oscillation(
    rig: Rig, radians: float, seconds: float | None = None
) -> tuple[Part, ...]:
    """Return the work of following the oscillation of a slider, by default from its
    phase in radians.
    """
    if radians == 0.0:  # the slider has no mass, or is not a `Slider`
        return ()
    what = f"{radians:.2g} rad of the slider's oscillation"
    seconds = _RADIAN * radians if seconds is None else seconds
    return (Part("slider.mass", rig.slider.mass, "mass", -0.5, what, seconds),)


def sample_interval(rig: Rig, angle: float) -> float:
    """Time between samples; by default an angle (rad) of the fastest oscillation,
    within bounds on their number.
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
    """Number of contacts that a run follows one by one."""
    method = rig.method
    if not isinstance(method, Contacts | QuasiStatic):
        return 0
    return method.count * (
        rig.slider.size if isinstance(rig.slider, ElasticBody) else 1
    )


def pieces_and_looks(rig: Rig, each: float) -> tuple[Part, ...]:
    """Return the work of the pieces of a drive and of snapshots, of `each` seconds to
    begin.
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
    """Return the work of breaks of N contacts, of `each` seconds, plus `more`
    seconds.
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
