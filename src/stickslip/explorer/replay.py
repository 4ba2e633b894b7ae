"""The contacts of a run, one by one: what the drawing of the slider replays.

The run is made once more, in steps from frame to frame, and each contact is looked at in each frame. Frames lie closer
where the slider moves fast, so that shown at an even pace they slow down through the slips.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, number
from stickslip.explorer import documents
from stickslip.explorer.plain import Array, Plain, packed
from stickslip.kernels.drive import Quadratic, Stop
from stickslip.model import Contacts, Slider
from stickslip.model.rig import Rig
from stickslip.progress import Progress
from stickslip.simulation import simulate
from stickslip.simulation.engines import Beginning, Engine, Individuals, Leg, engine_of

FRAMES = 1_200  # 40 s, at 30 a second
SHOWN = 40  # contacts in the drawing; the run may have any number of them
CYCLES = 5.0  # cycles of loading that the frames span
STEP = 1e-3  # of the stretchings as they are sent
ATTACHED, RENEWED = 1, 2
"""Flags of a contact in a frame: it holds now; it broke and attached again since the frame before."""
_MOVING = 0.7  # part of the frames that is spread over the way of the slider, the rest over the time
_SAMPLES = 20_000
_CONTACTS = 2_000  # contacts that are drawn for a rig whose solver has none


@runtime_checkable
class _Tells(Protocol):
    """An engine that knows each of its contacts."""

    def individuals(self) -> Individuals: ...


def frames(rig: Rig, at: float, watch: Progress) -> Iterator[Plain]:
    """Frames from a fraction of the drive on; times and forces in the rig's units, displacements in ``x_s``."""
    case = rig.natural
    if any(piece.until is not None for piece in case.drive.pieces):
        raise InputError("drive.pieces: the drawing follows drives whose pieces end at a given time only")
    own = isinstance(case.method, Contacts)
    method = case.method if isinstance(case.method, Contacts) else Contacts(_CONTACTS, seed=1)
    case = replace(case, method=method)
    begin, end = _window(case, at)
    times = _frame_times(case, begin, end, lambda fraction: watch(0.5 * fraction))
    seen = _look(case, method, times, lambda fraction: watch(0.5 + 0.5 * fraction))
    yield {
        "times": packed(times * rig.unit("time")),
        "force": packed(case.slider.stiffness * (seen.drive - seen.slider) * rig.unit("f_s")),
        "slider": packed(seen.slider),
        "drive": packed(seen.drive),
        "stretching": packed(np.clip(np.rint(seen.stretching / STEP), -32_767, 32_767), "i2"),
        "flags": packed(seen.flags, "u1"),
        "step": STEP,
        "shown": seen.stretching.shape[1],
        "of": method.count,
        "exact": own and case.interface.ageing is None,
        "own": own,
        "speed": case.velocity / rig.unit("time"),
    }


def _window(rig: Rig, at: float) -> tuple[float, float]:
    """From when to when: some cycles from a little before a time on."""
    slider, duration = rig.slider, rig.drive.duration
    if not isinstance(slider, Slider):
        raise InputError("slider: the drawing needs a slider with a mass")
    stretch = rig.interface.threshold_distribution.moment(1) * (1.0 + 1.0 / slider.stiffness)
    speed = max(abs(speed) for piece in rig.drive.pieces for speed in (piece.start, piece.end))
    span = min(CYCLES * stretch / speed, duration) if speed > 0 else duration
    begin = min(max(number("cursor", at, at_least=0, at_most=1) * duration - 0.1 * span, 0.0), duration - span)
    return begin, begin + span


def _frame_times(rig: Rig, begin: float, end: float, watch: Progress) -> Array:
    """Times of the frames: even in a clock that runs with the time and with the way of the slider."""
    turn = math.sqrt(rig.slider.mass / (rig.slider.stiffness + 1.0))
    interval = min(max((end - begin) / _SAMPLES, 0.1 * turn), (end - begin) / 2_000)
    output = replace(rig.output, interval=interval, snapshots=())
    run = simulate(replace(documents.lasting(rig, end), output=output), progress=watch)
    seen = run["time"].to_numpy() >= begin
    t, X = run["time"].to_numpy()[seen], run["displacement"].to_numpy()[seen]
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(X)))])
    clock = (1 - _MOVING) * (t - t[0]) / (t[-1] - t[0]) + _MOVING * way / (way[-1] or 1.0)
    return np.asarray(np.interp(np.linspace(0.0, clock[-1], FRAMES), clock, t))


class _Seen(NamedTuple):
    """Positions of slider and drive, shape (frames,); stretchings and flags, shape (frames, contacts)."""

    slider: Array
    drive: Array
    stretching: Array
    flags: NDArray[np.uint8]


def _look(rig: Rig, method: Contacts, times: Array, watch: Progress) -> _Seen:
    """Make the run in steps from frame to frame."""
    beginning = Beginning(rig.interface, rig.slider, rig.velocity, rig.start)
    engine = engine_of(rig.interface, method)(beginning, method)
    if not isinstance(engine, _Tells):
        raise InputError("simulation.method: this solver does not know its contacts one by one")
    shown = np.unique(np.linspace(0, method.count - 1, SHOWN).astype(int))
    slider, drive = np.empty((2, times.size))
    stretching, flags = np.empty((times.size, shown.size)), np.zeros((times.size, shown.size), np.uint8)
    position, done = beginning.drive_position(engine.contact_force()), 0
    birth = engine.here()[1] - engine.individuals().stretching[shown]
    for number_of, piece in enumerate(rig.drive.pieces):
        start = engine.here()[0]
        last = number_of + 1 == len(rig.drive.pieces)
        motion = Quadratic(start, position, piece.start, piece.acceleration)
        way = Leg(motion, start + piece.duration, np.empty(0), Stop())
        while done < times.size and (last or times[done] <= way.end):
            watch(done / times.size)
            _go(engine, way._replace(end=min(times[done], way.end)), watch)
            now = engine.individuals()
            attached = now.attached[shown]
            slider[done], drive[done] = engine.here()[1], float(way.drive_position(np.asarray(engine.here()[0])))
            stretching[done] = np.where(attached, now.stretching[shown], 0.0)
            # Where the slider was when a contact attached: elsewhere now, if it broke and attached again since.
            place = slider[done] - stretching[done]
            new = attached & (np.abs(place - birth) > 1e-9 * (1.0 + abs(slider[done])))
            flags[done] = np.where(attached, ATTACHED, 0) | np.where(new, RENEWED, 0)
            birth = np.where(attached, place, birth)
            done += 1
        if done == times.size:
            break
        _go(engine, way, watch)
        position = float(way.drive_position(np.asarray(way.end)))
    return _Seen(slider, drive, stretching, flags)


def _go(engine: Engine, leg: Leg, watch: Progress) -> None:
    if leg.end > engine.here()[0]:
        while not engine.advance(leg).over:
            watch(0.5)
