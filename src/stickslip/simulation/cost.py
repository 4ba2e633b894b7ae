"""How much work a run is, by part: each engine says it for what it follows.

The costs are those of one core of a desktop machine, measured in CPU time of runs; another may take a third or three
times as long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stickslip.model import FromSliding, Slider
from stickslip.model.drive import Piece, Travel
from stickslip.model.rig import Rig

_RADIAN = 6e-7
"""Seconds a radian of the slider's oscillation takes."""
_SAMPLE = 4e-7, 200.0
"""Seconds and bytes a sample takes."""
_SAMPLES_PER_RADIAN, _FEWEST_SAMPLES, _MOST_SAMPLES = 10.0, 2e3, 5e4
"""Samples of a run whose output does not say."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """One kind of work in a run: `what` in words, and the number of the rig that it grows with, to a `power`.

    `key` is that of a rig file, `value` in natural units, of a `quantity` or a pure number;
    `instead` says what else to do.
    """

    key: str
    value: float
    quantity: str | None
    power: float
    what: str
    seconds: float
    bytes: float = 0.0
    instead: str = ""
    block_steps: float = 0.0


@dataclass(frozen=True)
class Course:
    """What contacts and slider go through in a run; pieces of the drive that end on a condition are taken as a whole.

    `distance` is the way of the drive and `shaken` that of a slider that a perturbation has set ringing, in mean
    thresholds, and `lives` how often a contact breaks. The slider turns by so many radians, rings for `rings` of them
    after each of its `slips`, and for `ringing` and `rung` in all, before it smooths out and where it sticks.
    """

    distance: float
    lives: float
    shaken: float = 0.0
    turns: float = 0.0
    rings: float = 0.0
    ringing: float = 0.0
    rung: float = 0.0


def course_of(rig: Rig) -> Course:
    """Return what a run goes through."""
    slider, duration, pieces = rig.slider, rig.drive.duration, rig.drive.pieces
    mean, delay = rig.interface.threshold_distribution.moment(1), rig.interface.delay.moment(1)
    distance = sum(_way(piece) for piece in pieces) / mean
    lives = sum(_lives(piece, mean, delay) for piece in pieces)
    if not isinstance(slider, Slider) or slider.mass == 0:
        return Course(distance, lives)
    frequency = math.sqrt((slider.stiffness + 1.0) / slider.mass)
    # A slip leaves the slider ringing, the longer, the less it is damped.
    damping_ratio = slider.damping / (2.0 * frequency)
    turns, rings = frequency * duration, 1.0 / damping_ratio if damping_ratio > 0 else math.inf
    ringing = min(turns, 10.0 * rings * (1.0 + distance)) if damping_ratio < 1 else 0.0
    shaken = 0.0
    if isinstance(rig.start, FromSliding):
        largest = float(np.max(np.abs(rig.start.perturbation))) * abs(pieces[0].start)
        shaken = largest / (mean * frequency) * min(turns, rings)
    slips = 1.0 + distance * min(slider.stiffness, 1.0)
    return Course(distance, lives + shaken, shaken, turns, rings, ringing, min(turns, 10.0 * rings * slips))


def _lives(piece: Piece, mean: float, delay: float) -> float:
    """How often each contact breaks in a piece of the drive: it is stretched, and detached for the delay."""
    way, speed = _way(piece), 0.5 * (abs(piece.start) + abs(piece.end))
    return way / (mean + speed * delay) if math.isfinite(delay) else min(way / mean, 1.0)


def _way(piece: Piece) -> float:
    """How far the drive goes in a piece, at most; a slider that has gone far enough ends it."""
    way = 0.5 * (abs(piece.start) + abs(piece.end)) * piece.duration
    return min(way, piece.until.distance) if isinstance(piece.until, Travel) else way


def oscillation(rig: Rig, radians: float) -> tuple[Part, ...]:
    """Return the work of following a slider with mass."""
    if not isinstance(rig.slider, Slider) or rig.slider.mass == 0:
        return ()
    words = f"{radians:.2g} rad of the slider's oscillation"
    return (
        Part(key="slider.mass", value=rig.slider.mass, quantity="mass", power=-0.5, what=words,
             seconds=_RADIAN * radians),
    )  # fmt: skip


def sampling(rig: Rig, turns: float) -> Part:
    """Return the work of taking samples."""
    duration, interval = rig.drive.duration, rig.output.interval
    samples = min(max(_SAMPLES_PER_RADIAN * turns, _FEWEST_SAMPLES), _MOST_SAMPLES)
    samples = samples if interval is None else duration / interval
    return Part(key="simulation.interval", value=duration / samples, quantity="time", power=-1.0,
                what=f"{samples:.2g} samples", seconds=_SAMPLE[0] * samples, bytes=_SAMPLE[1] * samples)  # fmt: skip


def breaking(count: float, lives: float, each: float, bytes: float, how: str = "", more: float = 0.0) -> Part:
    """Return the work of breaks of N contacts, `each` of so many seconds, and some `more`."""
    return Part(key="simulation.contacts", value=count, quantity=None, power=1.0,
                what=f"about {count * lives:.2g} breaks of {count:.2g} contacts{how}",
                seconds=each * count * lives + more, bytes=bytes * count)  # fmt: skip
