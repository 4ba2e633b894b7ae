"""The driver: follows any engine along any drive, with samples, snapshots, conditions
and progress.
"""

from dataclasses import astuple, dataclass, replace

import numpy as np

from stickslip.errors import InputError
from stickslip.kernels.drive import (
    FORCE_ABOVE,
    FORCE_BELOW,
    NO_LOAD,
    TRAVEL,
    Stop,
)
from stickslip.model.drive import (
    Condition,
    Drive,
    ForceAbove,
    ForceBelow,
    Travel,
)
from stickslip.progress import Progress, heard, unheard
from stickslip.simulation.engines import Engine, Leg, Stretchings
from stickslip.simulation.engines.base import MOTION, Array, advances

_INSTANT = 1e-10  # fraction of a run: a shorter ramp counts as a jump


@dataclass(frozen=True)
class Track:
    """Recorded track of an engine: samples, the drive at their times, and snapshots
    with their times.
    """

    columns: tuple[str, ...]
    times: Array
    rows: Array
    drive_velocity: Array
    drive_position: Array
    snapshots: tuple[tuple[float, Stretchings], ...]
    end: float  # position of the drive at the end

    def __getitem__(self, name: str) -> Array:
        """Samples of one of the engine's columns."""
        return self.rows[:, self.columns.index(name)]


def follow(
    engine: Engine,
    drive: Drive,
    position: float,
    times: Array,
    looks: tuple[float, ...] = (),
    progress: Progress | None = None,
    before: Track | None = None,
    load: Array = NO_LOAD,
) -> Track:
    """Follow a drive piece by piece from time 0, or from the end of the track `before`.

    A condition may end a piece early. The `load` is given at times of the whole run. A
    sample at the joint of two pieces belongs to the earlier one. Raises `InputError`
    with the time at which the numbers of the run stop being finite.
    """
    report = heard(progress)
    total = drive.duration
    first = engine.here()[0]
    parts = (
        []
        if before is None
        else [(before.times, before.rows, before.drive_velocity, before.drive_position)]
    )
    snapshots = [] if before is None else [*before.snapshots]
    filled = 0
    for piece in drive.parts:
        begin, X = engine.here()
        if piece.duration < _INSTANT * total:
            # closed forms would lose the motion in the rounding of the acceleration
            middle = 0.5 * (piece.start + piece.end)
            piece = replace(piece, start=middle, end=middle)
        leg = Leg.along(piece, begin, position)
        motion = leg.drive
        last = np.searchsorted(times, leg.end * (1 + 1e-12), side="right")
        leg = leg._replace(
            times=times[filled:last],
            stop=_stop(piece.until, X),
            looks=looks[len(snapshots) :],
            load=load,
        )
        rows, seen = follow_leg(
            engine,
            leg,
            lambda t: report(min((t - first) / total, 1.0)),
        )
        at = leg.times[: len(rows)]
        parts.append(
            (
                at,
                rows,
                motion.velocity + motion.acceleration * (at - begin),
                leg.drive_position(at),
            )
        )
        snapshots += zip(leg.looks, seen, strict=False)
        filled += len(rows)
        position = float(leg.drive_position(np.asarray(engine.here()[0])))
    report(1.0)
    times, rows, velocity, place = (
        np.concatenate(part) for part in zip(*parts, strict=True)
    )
    return Track(
        engine.columns,
        times,
        rows,
        velocity,
        place,
        tuple(snapshots),
        position,
    )


def load_points(drive: Drive) -> Array:
    """Return times and loads of a drive, shape (n, 2)."""
    return np.array([*map(astuple, drive.load)]).reshape(-1, 2)


def follow_leg(
    engine: Engine,
    leg: Leg,
    report: Progress = unheard,
) -> tuple[Array, list[Stretchings]]:
    """Follow a leg to its end; return a row for each sample passed, and the stretchings
    at its `looks`.

    Raises `RuntimeError` if the engine makes no progress.
    """
    parts = list[Array]()
    seen = list[Stretchings]()
    filled = 0
    for passed in advances(engine, leg):
        _check_finite(engine, leg, leg.times[filled:], passed.rows)
        parts.append(passed.rows)
        filled = filled + len(passed.rows)
        seen += passed.looks
        report(engine.here()[0])
    return np.concatenate(parts), seen


def _check_finite(
    engine: Engine,
    leg: Leg,
    times: Array,
    rows: Array,
) -> None:
    lost = np.flatnonzero(~np.isfinite(rows[:, : len(MOTION)]).all(axis=1))
    if lost.size or not np.isfinite(engine.here()).all():
        since = (
            times[lost[0]]
            if lost.size
            else (times[len(rows) - 1] if len(rows) else leg.drive.start)
        )
        raise InputError(
            f"from t = {since:g} on the numbers of the run are not finite: the rig has "
            "scales too far apart "
            f"({engine.slider}, drive of velocity {leg.drive.velocity:g})"
        )


def _stop(until: Condition | None, X: float) -> Stop:
    """Convert a condition to the form of the kernels, for a piece that begins with the
    slider at `X`.
    """
    if until is None:
        return Stop()
    kinds = {Travel: TRAVEL, ForceAbove: FORCE_ABOVE, ForceBelow: FORCE_BELOW}
    (value,) = astuple(until)
    return Stop(kinds[type(until)], value, X)
