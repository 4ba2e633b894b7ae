"""The single contacts of a run, frame by frame, for films and for the explorer.

The run is repeated in steps from frame to frame, and the state of each contact is read
in each frame. Frames are closer in time where the slider moves fast, so that a film at
a constant rate slows down during slips.
"""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from stickslip.arrays import Array, Range
from stickslip.errors import InputError, number
from stickslip.model import Contacts, Drive, Slider, constant
from stickslip.model.rig import Rig
from stickslip.progress import Progress, part
from stickslip.simulation import simulate
from stickslip.simulation.driver import follow
from stickslip.simulation.engines import Advance, Beginning, Leg, engine_of

SHOWN = 40  # most contacts that are drawn
CYCLES = 5.0  # number of loading cycles that the frames span
ATTACHED = 1  # flag of a contact in a frame: it is attached
RENEWED = 2  # flag: it broke and re-attached since the frame before
# fraction of the frames that is spread evenly over the path of the slider, the rest
# over the time
_MOVING = 0.7
_SAMPLES = 20_000
_CONTACTS = 2_000  # number of contacts for a rig whose solver does not follow them


class Frames(NamedTuple):
    """Positions, forces and contacts in each frame; times and forces in the rig's
    units, displacements in ``x_s``.
    """

    times: Array
    force: Array
    slider: Array
    drive: Array
    # of shape (frames, contacts shown); 0 for a detached contact
    stretching: Array
    flags: NDArray[np.uint8]  # of the same shape
    contacts: int  # number in the interface, of which fewer may be shown
    # whether this is the run itself, rather than one with other contacts or random
    # numbers
    exact: bool
    own: bool  # whether the rig's own solver follows single contacts


def frames(rig: Rig, at: float, count: int, watch: Progress) -> Frames:
    """Return `count` frames, which start at the fraction `at` of the drive."""
    case = rig.natural
    if not isinstance(case.slider, Slider):
        raise InputError(
            "contacts: a film is of one rigid slider; of a chain, draw spacetime"
        )
    if any(piece.until is not None for piece in case.drive.pieces):
        raise InputError(
            "drive.pieces: the drawing follows only drives whose pieces end at a given "
            "time"
        )
    method = (
        case.method
        if isinstance(case.method, Contacts)
        else Contacts(_CONTACTS, seed=1)
    )
    own = method is case.method
    case = replace(case, method=method)
    begin, end = _window(case, at)
    times = _frame_times(
        case,
        begin,
        end,
        count,
        part(watch, 0.0, 0.5),
    )
    slider, drive, stretching, flags = _sampled(
        case, method, times, part(watch, 0.5, 1.0)
    )
    force = case.slider.stiffness * (drive - slider) * rig.unit("f_s")
    exact = own and case.interface.ageing is None
    return Frames(
        times * rig.unit("time"),
        force,
        slider,
        drive,
        stretching,
        flags,
        method.count,
        exact,
        own,
    )


def lasting(rig: Rig, duration: float) -> Rig:
    """Return the rig with its drive cut at a time, or, if its velocity is constant,
    extended to that time.
    """
    first = rig.drive.pieces[0]
    lasts = rig.drive.duration
    if abs(duration / lasts - 1.0) < 1e-9:
        return rig
    if duration > lasts:
        if (
            len(rig.drive.pieces) > 1
            or first.start != first.end
            or first.until is not None
        ):
            raise InputError(
                f"duration = {duration:g}: this drive ends after {lasts:g}"
            )
        return replace(rig, drive=constant(first.start, duration))
    pieces = []
    left = duration
    for piece in rig.drive.pieces:
        if left > 1e-12 * duration:
            part = min(piece.duration, left)
            pieces.append(
                replace(
                    piece, end=piece.start + piece.acceleration * part, duration=part
                )
            )
            left -= part
    return replace(rig, drive=Drive(tuple(pieces)))


def _window(rig: Rig, at: float) -> Range:
    """Return the first and last time of the frames: some cycles, which start shortly
    before the fraction `at` of the drive.
    """
    slider = rig.slider
    duration = rig.drive.duration
    stretch = rig.interface.threshold_distribution.moment(1) * (
        1.0 + 1.0 / slider.stiffness
    )
    speed = max(
        abs(speed) for piece in rig.drive.pieces for speed in (piece.start, piece.end)
    )
    span = min(CYCLES * stretch / speed, duration) if speed > 0 else duration
    begin = min(
        max(number("cursor", at, at_least=0, at_most=1) * duration - 0.1 * span, 0.0),
        duration - span,
    )
    return begin, begin + span


def _frame_times(
    rig: Rig, begin: float, end: float, count: int, watch: Progress
) -> Array:
    """Return the times of the frames, evenly spaced in a weighted mean of the time and
    the path of the slider.
    """
    turn = math.sqrt(rig.slider.mass / (rig.slider.stiffness + 1.0))
    interval = min(max((end - begin) / _SAMPLES, 0.1 * turn), (end - begin) / 2_000)
    output = replace(rig.output, interval=interval, snapshots=())
    run = simulate(replace(lasting(rig, end), output=output), progress=watch)
    seen = run["time"].values >= begin
    t = run["time"].values[seen]
    X = run["displacement"].values[seen]
    way = np.append(0.0, np.abs(np.diff(X)).cumsum())
    clock = (1 - _MOVING) * (t - t[0]) / (t[-1] - t[0]) + _MOVING * way / (
        way[-1] or 1.0
    )
    return np.asarray(np.interp(np.linspace(0.0, clock[-1], count), clock, t))


def _sampled(
    rig: Rig, method: Contacts, times: Array, watch: Progress
) -> tuple[Array, Array, Array, NDArray[np.uint8]]:
    """Return positions of slider and drive at some times of the run, and stretchings
    and flags of its contacts.
    """
    beginning = Beginning(rig.interface, rig.slider, rig.velocity, rig.start)
    engine: Any = engine_of(rig.interface, method)(beginning, method)
    shown = np.unique(np.linspace(0, method.count - 1, SHOWN).astype(int))
    origin = beginning.drive_position(engine.contact_force())

    def sample() -> Array:
        now = engine.individuals()
        return np.concatenate(
            [
                [engine.here()[1]],
                now.stretching[shown],
                now.attached[shown],
            ]
        )

    def advance(leg: Leg) -> Advance:  # to the next sample, or to the end of the leg
        end = min([*leg.times[:1], leg.end])
        over = (
            end <= engine.here()[0]
            or engine.advance(leg._replace(end=end, times=leg.times[:0])).over
        )
        samples = [sample()] if over and leg.times.size else []
        return Advance(
            np.array(samples).reshape(-1, 1 + 2 * shown.size),
            (),
            over and not leg.times.size,
        )

    first = sample()
    slider = engine.slider
    # what `follow` needs of an engine; its samples hold the position of the slider and
    # the single contacts
    followed: Any = SimpleNamespace(
        columns=("displacement",), slider=slider, here=engine.here, advance=advance
    )
    track = follow(followed, rig.drive, origin, times, progress=watch)
    slider, stretching, attached = np.split(
        np.vstack([first, track.rows]),
        [1, 1 + shown.size],
        axis=1,
    )
    # position of the slider at which a contact attached, which changes if it breaks and
    # re-attaches
    place = pd.DataFrame(slider - stretching).where(attached > 0)
    moved = np.abs(place - place.ffill().shift().fillna(math.inf)) > 1e-9 * (
        1.0 + np.abs(slider)
    )
    flags = np.where(attached > 0, ATTACHED, 0) | np.where(moved, RENEWED, 0)
    return (
        slider[1:, 0],
        track.drive_position,
        (stretching * attached)[1:],
        flags[1:].astype(np.uint8),
    )
