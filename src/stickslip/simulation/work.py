"""How long a run would take, said before it starts.

>>> import stickslip as ss
>>> from stickslip.simulation import estimate
>>> estimate(ss.example("pmma_slider")).seconds < 60
True

The costs are those of one core of a desktop machine; another may take a third or three times as long.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np

from stickslip.errors import InputError
from stickslip.model import (
    Bell,
    Contacts,
    Delay,
    ElasticBody,
    ExponentialGrowth,
    FixedGrowth,
    FromSliding,
    Langevin,
    MasterEquation,
    PaperClosure,
    Population,
    QuasiStatic,
    Slider,
)
from stickslip.model.drive import Piece, Travel
from stickslip.model.rig import Rig
from stickslip.model.units import Quantity
from stickslip.progress import in_time
from stickslip.simulation.engines.base import engine_of
from stickslip.simulation.engines.blocks import longest_step, network_of
from stickslip.simulation.engines.thermal_population import activation_width

LONGEST = 3600.0
"""Seconds that a run may take without being asked for."""
ANNOUNCED = 60.0
"""Seconds above which a run is announced."""
LARGEST = 4e9
"""Bytes that it may take."""
MOST_BLOCK_STEPS = 1e9
"""Steps of a block of an elastic slider that a run may take without telling how far it is."""

_BREAK = 2.4e-7
"""Seconds a break of a contact takes."""
_AGE = 2e-7
"""The same for a contact with ageing thresholds in one time of ageing, whether it breaks or not."""
_AGEING_BREAK = 2.6e-6
"""The same for a break of a contact whose threshold ages."""
_PANELS = 1e-4, 1.5e-5
"""Seconds the master equation takes over a mean threshold, and over a radian in which the slider rings after a slip."""
_OF_RANDOM_DELAYS, _OF_CORNERS = 5.0, 3.0
"""So many times that with random delays, and with a distribution of thresholds that has corners."""
_CLOCKED_BREAK, _CLOCKED_STEP, _THINNED_BREAK = 6e-7, 4e-7, 5e-6
"""The same for a break by thermal activation: on the shared clock, a step of that, and one by one."""
_THERMAL_COHORT = 2e-6, 1e-5
"""The same for a cohort in a step of the master equation with thermal activation: one number says what is left of it,
or thresholds are followed at nodes. Measured in CPU time of runs over 4 to 6 mean thresholds, on a loaded machine."""
_NODES = 200
"""Of the thresholds, about."""
_BROKEN = 0.006
"""Largest fraction of the contacts that breaks in such a step: see `engines.thermal_population`."""
_AGEING_COHORT = 6e-8
"""The same for a cohort of the kinetic equation in one time of ageing or mean threshold, for each of their number."""
_RADIAN = 6e-7
"""The same for a radian of the slider's oscillation."""
_FINEST_TURN = 1e-13
"""Of a run's time; shorter turns of the slider are lost in the rounding of time."""
_SAMPLE = 4e-7, 200.0
"""Seconds and bytes a sample takes."""
_SAMPLES_PER_RADIAN, _FEWEST_SAMPLES, _MOST_SAMPLES = 10.0, 2e3, 5e4
"""Samples of a run whose output does not say."""
_CONTACT = 150.0
"""Bytes of a contact."""
_BLOCK_STEP = 1.5e-8
"""Seconds a step of a block of an elastic slider takes, where nothing breaks."""
_COHORTS = 400
"""Cohorts of such a block."""
_BLOCK_CONTACT = 64.0
"""Bytes of a contact of such a block."""
_BLOCK_SAMPLE = 2e-8, 120.0
"""Seconds and bytes a sample of such a block takes."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """One kind of work in a run: `what` in words, and the number of the rig that it grows with, to a `power`.

    `key` is that of a rig file, `value` in natural units, of a `quantity` or a pure number;
    `instead` says what else to do.
    """

    key: str
    value: float
    quantity: Quantity | None
    power: float
    what: str
    seconds: float
    bytes: float = 0.0
    instead: str = ""


@dataclass(frozen=True, kw_only=True)
class Work:
    """What a run of a rig would take, by part."""

    rig: Rig
    parts: tuple[Part, ...]
    block_steps: float = 0.0

    @property
    def seconds(self) -> float:
        """Time of one core."""
        return sum(part.seconds for part in self.parts)

    @property
    def bytes(self) -> float:
        """Memory."""
        return sum(part.bytes for part in self.parts)

    def announce(self) -> None:
        """Log one line of what a run of more than a minute will take; unless told otherwise, on standard error."""
        if self.seconds > ANNOUNCED:
            worst = max(self.parts, key=lambda part: part.seconds)
            words = f"{self.rig.name}: about {in_time(self.seconds)} on one core: {worst.what}"
            logging.getLogger("stickslip").warning(words)

    def check(
        self,
        seconds: float = LONGEST,
        bytes: float = LARGEST,
        otherwise: str = "ask for it all the same: long=True (--long)",
        *,
        silent: bool = False,
    ) -> None:
        """Raise `InputError` if the work is more than this; the message names what to change, and `otherwise`.

        Runs that are `silent` about how far they are do not take more than 1e9 steps of blocks, either.
        """
        if silent and self.block_steps > MOST_BLOCK_STEPS:
            raise InputError(
                f"drive duration = {self._said_time()}: {self.block_steps:.2g} steps of blocks would take about "
                f"{in_time(self.seconds)} without a word; pass progress=..., or ask for it all the same: long=True"
            )
        if (excess := self.seconds / seconds) > 1:
            worst = max(self.parts, key=lambda part: part.seconds)
            amount, share = f"{worst.what} would take about {in_time(self.seconds)}", worst.seconds / seconds
        elif (excess := self.bytes / bytes) > 1:
            worst = max(self.parts, key=lambda part: part.bytes)
            amount, share = f"{worst.what} would take about {self.bytes / 1e9:.2g} GB", worst.bytes / bytes
        else:
            return
        allowed = worst.value * max(share, 1.0) ** (-1.0 / worst.power)
        bound = "at most" if worst.power > 0 else "at least"
        raise InputError(
            f"{worst.key} = {self._said(worst, worst.value)}: {amount}; {worst.instead}give {bound} "
            f"{self._said(worst, allowed)}, or a drive {excess:.2g} times shorter; or {otherwise}",
            worst.key,
        )

    def _said_time(self) -> str:
        return self.rig.in_units(self.rig.drive.duration, "time")

    def _said(self, part: Part, value: float) -> str:
        return f"{value:.4g}" if part.quantity is None else self.rig.in_units(value, part.quantity)


def estimate(rig: Rig) -> Work:
    """Return what a run of a rig would take; pieces of the drive that end on a condition are taken as a whole."""
    slider, duration = rig.slider, rig.drive.duration
    engine_of(rig.interface, rig.method, slider)  # says what no solver takes
    if isinstance(slider, ElasticBody):
        return _of_blocks(rig, slider)
    mean, delay = rig.interface.threshold_distribution.moment(1), rig.interface.delay.moment(1)
    distance, parts = sum(_way(piece) for piece in rig.drive.pieces) / mean, []  # ways are in mean thresholds
    turns, ringing, rung, kicked, ageing = 0.0, 0.0, 0.0, 0.0, rig.interface.ageing
    aged = 0.0  # seconds a time of ageing takes
    if isinstance(slider, Slider) and slider.mass > 0:
        frequency = math.sqrt((slider.stiffness + 1.0) / slider.mass)
        turns = frequency * duration
        # A slip leaves the slider ringing, the longer, the less it is damped.
        damping_ratio = slider.damping / (2.0 * frequency)
        rings = 1.0 / damping_ratio if damping_ratio > 0 else math.inf
        ringing = min(turns, 10.0 * rings * (1.0 + distance)) if damping_ratio < 1 else 0.0
        if isinstance(rig.start, FromSliding):
            largest = float(np.max(np.abs(rig.start.perturbation))) * abs(rig.drive.pieces[0].start)
            kicked = largest / (mean * frequency) * min(turns, rings)
        slips = 1.0 + distance * min(slider.stiffness, 1.0)
        rung = min(ringing, 10.0 * rings * slips)
        radians = _radians(rig, slider, turns, rings, distance)
        words = f"{radians:.2g} rad of the slider's oscillation"
        parts.append(Part(key="slider.mass", value=slider.mass, quantity="mass", power=-0.5, what=words,
                          seconds=_RADIAN * radians))  # fmt: skip
    path = distance + kicked + 0.01 * ringing
    lives = kicked + sum(_lives(piece, mean, delay) for piece in rig.drive.pieces)
    growing = isinstance(rig.method, MasterEquation) and isinstance(ageing, FixedGrowth)
    if rig.interface.temperature is not None or growing:
        parts.append(_thermal(rig, lives, distance + kicked, rung))
        aged = _AGE * getattr(rig.method, "count", 0)
    elif isinstance(rig.method, Contacts | QuasiStatic):
        count = rig.method.count
        each, aged = (_BREAK if ageing is None else _AGEING_BREAK), _AGE * count
        parts.append(Part(key="simulation.contacts", value=count, quantity=None, power=1.0,
                          what=f"about {count * lives:.2g} breaks of {count:.2g} contacts",
                          seconds=each * count * lives, bytes=_CONTACT * count))  # fmt: skip
    elif isinstance(rig.method, MasterEquation | PaperClosure | Population):  # of others nothing is known
        # The kinetic equation is of second order, panels are of fifth.
        method = rig.method
        finer = (method.cells / 400.0) ** 2 if isinstance(method, PaperClosure) else 1e-4 / method.rtol
        cohorts = 400.0 * math.sqrt(finer)
        if ageing is None:
            oscillating = ringing if delay > 0 else 0.0
            harder = 1.0 if isinstance(rig.interface.delay, Delay) else _OF_RANDOM_DELAYS
            corners = any(0.0 < knot < math.inf for knot in rig.interface.threshold_distribution.knots)
            harder *= _OF_CORNERS if corners else 1.0
            steps = _PANELS[0] * (distance + kicked) + _PANELS[1] * oscillating
            power, seconds = -1 / 6, harder * finer ** (1 / 6) * steps
        else:
            aged = _AGEING_COHORT * cohorts**2
            power, seconds = -1.0, aged * path
        parts.append(Part(key="simulation.rtol", value=1e-4 / finer, quantity=None, power=power,
                          what=f"a path of {path:.2g} mean thresholds", seconds=seconds))  # fmt: skip
    if isinstance(ageing, Langevin):
        # Thresholds take steps that are short against their time of ageing, at rest as in motion.
        ages = duration * ageing.rate**2
        parts.append(Part(key="interface.ageing.time", value=ageing.rate**-2, quantity="time", power=-1.0,
                          what=f"{ages:.2g} times of ageing", seconds=aged * ages))  # fmt: skip
    samples = min(max(_SAMPLES_PER_RADIAN * turns, _FEWEST_SAMPLES), _MOST_SAMPLES)
    interval = duration / samples if rig.output.interval is None else rig.output.interval
    samples = duration / interval
    parts.append(Part(key="simulation.interval", value=interval, quantity="time", power=-1.0,
                      what=f"{samples:.2g} samples", seconds=_SAMPLE[0] * samples,
                      bytes=_SAMPLE[1] * samples))  # fmt: skip
    return Work(rig=rig, parts=tuple(parts))


def _radians(rig: Rig, slider: Slider, turns: float, rings: float, distance: float) -> float:
    """Radians of the slider's oscillation that cost time: once a slider that sticks rings no more, its turns do not."""
    from_event_to_event = isinstance(rig.method, Contacts) and not isinstance(rig.interface.ageing, Langevin)
    if not from_event_to_event or turns * _FINEST_TURN > 1.0:
        return turns
    slips = 1.0 + distance * min(slider.stiffness, 1.0)
    return min(turns, 10.0 * rings * slips)


def _lives(piece: Piece, mean: float, delay: float) -> float:
    """How often each contact breaks in a piece of the drive: it is stretched, and detached for the delay."""
    way, speed = _way(piece), 0.5 * (abs(piece.start) + abs(piece.end))
    return way / (mean + speed * delay) if math.isfinite(delay) else min(way / mean, 1.0)


def _of_blocks(rig: Rig, body: ElasticBody) -> Work:
    """What a run of an elastic slider would take."""
    duration, method = rig.drive.duration, rig.method
    mean, delay = rig.interface.threshold_distribution.moment(1), rig.interface.delay.moment(1)
    lives = max(sum(_lives(piece, mean, delay) for piece in rig.drive.pieces), 1.0)
    count, steps, stiff = getattr(method, "count", _COHORTS), 0.0, False
    if not isinstance(method, QuasiStatic):
        network = network_of(body, np.zeros(body.size), np.zeros(body.size))
        step = longest_step(network)
        stiff = step < longest_step(network._replace(lag=0.0))  # the dashpots ask for shorter steps than the springs
        steps = body.size * duration / step
    what = "cohorts" if isinstance(method, MasterEquation) else "contacts"
    each = _BREAK if not isinstance(method, QuasiStatic) else 4e-8 * body.size
    name: Quantity = "viscosity" if stiff else "mass"
    parts = [
        Part(key=f"slider.{name}", value=getattr(body, name), quantity=name, power=1.0 if stiff else -0.5,
             what=f"{steps:.2g} steps of blocks",
             seconds=steps * (_BLOCK_STEP if what == "contacts" else 3e-9 * count)),
        Part(key=f"simulation.{what}", value=count, quantity=None, power=1.0,
             what=f"about {body.size * count * lives:.2g} breaks of {body.size * count:.2g} {what}",
             seconds=each * body.size * count * lives, bytes=_BLOCK_CONTACT * body.size * count),
    ]  # fmt: skip
    if (interval := rig.output.interval) is not None:
        samples = duration / interval * body.size
        parts.append(Part(key="simulation.interval", value=interval, quantity="time", power=-1.0,
                          what=f"{samples:.2g} samples of blocks", seconds=_BLOCK_SAMPLE[0] * samples,
                          bytes=_BLOCK_SAMPLE[1] * samples))  # fmt: skip
    return Work(rig=rig, parts=tuple(parts), block_steps=steps)


def _thermal(rig: Rig, lives: float, path: float, turns: float) -> Part:
    """Return the work of contacts that break by thermal activation: in lives, mean thresholds, radians of ringing."""
    interface, mean = rig.interface, rig.interface.threshold_distribution.moment(1)
    width = activation_width(interface)
    cold = interface.temperature is None
    one_number = cold or (
        isinstance(interface.temperature, Bell) and not isinstance(interface.ageing, ExponentialGrowth)
    )
    if isinstance(rig.method, Contacts):
        count = rig.method.count
        shared = isinstance(interface.temperature, Bell) and interface.ageing is None
        breaks = _CLOCKED_BREAK if shared else _THINNED_BREAK
        return Part(key="simulation.contacts", value=count, quantity=None, power=1.0,
                    what=f"about {count * lives:.2g} breaks of {count:.2g} contacts by thermal activation",
                    seconds=breaks * count * lives + _CLOCKED_STEP * 8.0 * lives * mean / width,
                    bytes=_CONTACT * count)  # fmt: skip
    finer = max(1.0, math.sqrt(1e-4 / rig.method.rtol)) if isinstance(rig.method, MasterEquation) else 1.0
    closest = max(2.0 * finer / width, 1.0 / (_BROKEN * mean))  # steps on a unit of the way
    cohorts = float(closest * interface.threshold_distribution.support[1])
    steps = closest * mean * path + 3.0 * turns
    key, value, power = ("simulation.rtol", 1e-4 / finer**2, -1.0) if cold else ("interface.temperature", width, -2.0)
    return Part(key=key, value=value, quantity=None, power=power,
                what=f"about {steps:.2g} steps of {cohorts:.2g} cohorts", instead="use Contacts(...), or ",
                seconds=_THERMAL_COHORT[not one_number] * steps * cohorts,
                bytes=16.0 * cohorts * (1 if one_number else _NODES))  # fmt: skip


def _way(piece: Piece) -> float:
    """How far the drive goes in a piece, at most; a slider that has gone far enough ends it."""
    way = 0.5 * (abs(piece.start) + abs(piece.end)) * piece.duration
    return min(way, piece.until.distance) if isinstance(piece.until, Travel) else way
