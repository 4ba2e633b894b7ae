"""The drive: the far end of the driving spring, moved at a velocity that is piecewise
linear in time, or a force on a mass without a spring; and the normal load meanwhile.

Drives are values: comparable, printable, joined by `Drive.then`.

>>> from stickslip import constant, ramp
>>> loop = ramp(0.1, 3.0, duration=200).then(ramp(3.0, 0.1, duration=200))
>>> loop.then(constant(0.1, duration=50)).duration
450.0
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, groupby
from typing import Annotated, Any, Self

from stickslip.answers import card, table
from stickslip.errors import InputError, instance, number, pair, refused, sequence
from stickslip.model.records import Number, Part, Record, converted

Force = Annotated[float, Number("f_s", hint="in f_s")]
Velocity = Annotated[float, Number("x_s/time", place="drive velocity")]


@dataclass(frozen=True)
class Travel(Record):
    """Condition: the slider has moved this far (either way) since the piece of the
    drive began.
    """

    distance: Annotated[float, Number("x_s", above=0, hint="in x_s")]


@dataclass(frozen=True)
class ForceAbove(Record):
    """Condition: the spring force per contact has reached this value."""

    force: Force


@dataclass(frozen=True)
class ForceBelow(Record):
    """Condition: the spring force per contact has fallen to this value."""

    force: Force


Condition = Travel | ForceAbove | ForceBelow


@dataclass(frozen=True, kw_only=True)
class Piece(Record):
    """A stretch of time in which the drive's velocity goes linearly from `start` to
    `end`.

    `until`, if given, ends the piece early, at the first sample of the run where the
    condition holds.
    """

    start: Velocity
    end: Velocity
    duration: Annotated[float, Number("time", above=0, place="drive duration")]
    until: Annotated[
        Condition | None, Part("Travel, ForceAbove or ForceBelow", place="drive until")
    ] = None

    @property
    def acceleration(self) -> float:
        """Rate of change of the drive's velocity."""
        return (self.end - self.start) / self.duration


Moment = Annotated[float, Number("time", at_least=0, place="Drive.time")]
Points = float | Iterable[tuple[float, float]]
"""A value that stays, or pairs of a time and a value."""


@dataclass(frozen=True)
class LoadPoint(Record):
    """The normal load at a time, over that at which contacts have their strength."""

    time: Moment
    load: Annotated[float, Number(above=0, place="Drive.load")]


@dataclass(frozen=True)
class ForcePoint(Record):
    """The force of the drive at a time, per contact."""

    time: Moment
    force: Force


@dataclass(frozen=True)
class Drive:
    """A sequence of pieces, made with `constant` and `ramp`, or a force, made with
    `pull`; and the normal load, which is 1 unless `under` sets it.

    Load and force are given at times from the beginning on, and linear between them.
    Two points at one time are a jump. The load is constant before its first point and
    after its last.
    """

    pieces: tuple[Piece, ...] = ()
    load: tuple[LoadPoint, ...] = ()
    force: tuple[ForcePoint, ...] = ()

    def __post_init__(self) -> None:
        _check_points("load", self.load, LoadPoint)
        _check_points("force", self.force, ForcePoint)
        if self.load and any(piece.until is not None for piece in self.pieces):
            raise InputError(
                "Drive.load: is given at times, so not available with a piece that "
                "ends on a condition; leave one out",
                "Drive.load",
            )
        if self.force:
            if self.pieces or self.force[0].time != 0 or self.duration == 0:
                raise InputError(
                    "Drive.force: must begin at 0, have a duration, and go without "
                    "velocities; make a drive with pull(0.6, duration=10)",
                    "Drive.force",
                )
            return
        instance(
            "Drive.pieces",
            self.pieces,
            tuple,
            "a tuple of pieces; make a drive with constant() or ramp()",
        )
        for i, piece in enumerate(self.pieces):
            instance(
                f"Drive.pieces[{i}]",
                piece,
                Piece,
                "a piece; make a drive with constant() or ramp()",
            )
        if not self.pieces:
            raise InputError(
                "Drive.pieces: must hold at least one piece; make one with constant() "
                "or ramp()"
            )

    def _repr_html_(self) -> str:
        """A card for a notebook: each piece, with its natural units."""
        rows = [("from (x_s/time)", "to (x_s/time)", "for (time)")] * bool(self.pieces)
        for piece in self.pieces:
            numbers = piece.start, piece.end, piece.duration
            first, last, duration = map("{:.4g}".format, numbers)
            rows.append((first, last, duration))
        rows += [(str(point), "", "") for point in (*self.force, *self.load)]
        return card("Drive, in natural units", table(rows))

    @property
    def ends(self) -> list[float]:
        """Times at which the pieces end, if no condition ends one early."""
        # in order, as a run adds them up
        ends = accumulate(piece.duration for piece in self.pieces)
        return [point.time for point in self.force] or [*ends]

    @property
    def duration(self) -> float:
        """Time the whole drive lasts if no condition ends a piece early."""
        return self.ends[-1]

    @property
    def velocity(self) -> float:
        """Velocity at the beginning; 0 of a force."""
        return self.pieces[0].start if self.pieces else 0.0

    @property
    def velocities(self) -> list[float]:
        """Velocities at the ends of the pieces, in turn; each once where it stays."""
        through = [end for piece in self.pieces for end in (piece.start, piece.end)]
        return [velocity for velocity, _ in groupby(through)]

    def then(self, other: "Drive") -> "Drive":
        """Return this drive followed by another; without points the load is 1."""
        instance("Drive.then", other, Drive, "a drive, made with constant() or ramp()")
        seam = self.duration
        load = self.load
        if load or other.load:
            load = load or (LoadPoint(0.0, 1.0),)
            after = other.load or (LoadPoint(0.0, 1.0),)
            stays = LoadPoint(seam, load[-1].load), LoadPoint(seam, after[0].load)
            load = *load, *stays, *_later(after, seam)
        return Drive(
            self.pieces + other.pieces, load, (*self.force, *_later(other.force, seam))
        )

    def under(self, load: Points) -> "Drive":
        """Return the drive under a normal load, over that at which the contacts have
        their strength: a number, or pairs of a time and a load.

        >>> braking = constant(1.0, duration=20).under([(5.0, 1.0), (10.0, 3.0)])
        >>> braking.load[-1]
        LoadPoint(time=10.0, load=3.0)
        """
        points = _pairs("Drive.load", load)
        return replace(self, load=tuple(LoadPoint(*each) for each in points))

    def until(self, condition: Condition) -> "Drive":
        """Return the drive with its last piece ended early, at the first sample
        where the condition holds.
        """
        pieces = (*self.pieces[:-1], replace(self.pieces[-1], until=condition))
        return replace(self, pieces=pieces)

    def faster(self, factor: float) -> Self:
        """Return the same path at velocities that are larger by a factor, in as much
        less time, its load, too.
        """
        return converted(
            self,
            lambda value, unit: (
                value * {"x_s/time": factor, "time": 1.0 / factor}.get(unit, 1.0)
            ),
        )


USUAL_DISTANCE = 120.0
"""Default distance of a drive at constant velocity, in ``x_s``: most transients have
decayed by then.
"""


def constant(velocity: float, duration: float | None = None) -> Drive:
    """Pull at a constant velocity (in ``x_s`` per time) for a time.

    By default until the drive has gone 120 ``x_s``. Zero velocity for a time is a
    *hold*, as in slide-hold-slide.

    >>> constant(2.0).duration
    60.0
    """
    if duration is None:
        speed = abs(number("drive velocity", velocity))
        if speed == 0:
            raise InputError("constant: velocity = 0 needs a duration")
        duration = USUAL_DISTANCE / speed
    return Drive((Piece(start=velocity, end=velocity, duration=duration),))


def ramp(start: float, end: float, duration: float) -> Drive:
    """Pull at a velocity that goes linearly from `start` to `end`."""
    return Drive((Piece(start=start, end=end, duration=duration),))


def pull(force: Points, duration: float | None = None) -> Drive:
    """Pull a `Mass` with a force per contact, in ``f_s``: a number, or pairs of a time
    and a force, such as ``[(0, 0), (30, 0.6)]``; by default until the last of them.

    >>> pull([(0.0, 0.0), (30.0, 0.6)], duration=40.0).force[-1]
    ForcePoint(time=40.0, force=0.6)
    """
    points = [ForcePoint(*each) for each in _pairs("Drive.force", force)]
    if points[0].time > 0:
        points.insert(0, replace(points[0], time=0.0))
    if duration not in (None, points[-1].time):
        points.append(replace(points[-1], time=duration))
    return Drive(force=tuple(points))


def _pairs(place: str, values: Points) -> list[tuple[float, float]]:
    hint = "a number, or pairs of a time and a value, such as [(0, 1), (5, 2)]"
    if isinstance(values, int | float):
        return [(0.0, values)]
    found = [pair(place, each, hint) for each in sequence(place, values, hint)]
    if not found:
        raise refused(place, values, f"must be {hint}")
    return found


def _later(points: tuple[Any, ...], by: float) -> Iterator[Any]:
    return (replace(point, time=by + point.time) for point in points)


def _check_points(name: str, points: tuple[Any, ...], kind: type) -> None:
    """Raise `InputError` unless these are points whose times do not fall."""
    place = f"Drive.{name}"
    last = 0.0
    for i, point in enumerate(points):
        where = f"{place}[{i}]"
        instance(where, point, kind, f"a {kind.__name__}(time, {name})")
        if point.time < last:
            raise InputError(
                f"{where}: is at {point.time:g}, before {last:g}; give times that rise",
                place,
            )
        last = point.time
