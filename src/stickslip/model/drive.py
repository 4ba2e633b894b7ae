"""The drive: the far end of the driving spring, moved at a velocity that is piecewise
linear in time, or a force on a mass without a spring; and the normal load over time.

Drives are values: comparable, printable, joined by `Drive.then`.

>>> from stickslip import constant, ramp
>>> loop = ramp(0.1, 3.0, duration=200).then(ramp(3.0, 0.1, duration=200))
>>> loop.then(constant(0.1, duration=50)).duration
450.0
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import accumulate, groupby, pairwise
from typing import Annotated, Self

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
Duration = Annotated[float, Number("time", above=0, place="drive duration")]
Until = Annotated[
    Condition | None, Part("Travel, ForceAbove or ForceBelow", place="drive until")
]


@dataclass(frozen=True, kw_only=True)
class Piece(Record):
    """A time interval in which the drive velocity changes linearly from `start` to
    `end`.

    `until`, if given, ends the piece early, at the first sample of the run where the
    condition holds.
    """

    start: Velocity
    end: Velocity
    duration: Duration
    until: Until = None

    @property
    def acceleration(self) -> float:
        """Rate of change of the drive's velocity."""
        return (self.end - self.start) / self.duration


@dataclass(frozen=True)
class LoadPoint(Record):
    """The normal load at a time, relative to the load at which the strength of the
    contacts is given.
    """

    time: Annotated[float, Number("time", at_least=0, place="Drive.load time")]
    load: Annotated[float, Number(above=0, place="Drive.load")]


@dataclass(frozen=True, kw_only=True)
class ForcePiece(Record):
    """A time interval in which the driving force changes linearly from `start` to
    `end`; `until` as in a `Piece`.
    """

    start: Force
    end: Force
    duration: Duration
    until: Until = None

    @property
    def rate(self) -> float:
        """Constant rate of change of the force."""
        return (self.end - self.start) / self.duration


@dataclass(frozen=True)
class Drive:
    """A sequence of pieces of given velocity, made with `constant` and `ramp`, or of
    given force, made with `pull`; and the normal load, which is 1 unless `under` sets
    it.

    The load is given at times from the start of the drive, linear between them and
    constant beyond; two points at one time are a jump.
    """

    pieces: tuple[Piece, ...] = ()
    load: tuple[LoadPoint, ...] = ()
    force: tuple[ForcePiece, ...] = ()

    def __post_init__(self) -> None:
        for name, kind in (
            ("pieces", Piece),
            ("load", LoadPoint),
            ("force", ForcePiece),
        ):
            place = f"Drive.{name}"
            hint = "{}; make a drive with constant() or ramp(), under() or pull()"
            parts = getattr(self, name)
            instance(place, parts, tuple, hint.format("a tuple of pieces"))
            for i, part in enumerate(parts):
                instance(f"{place}[{i}]", part, kind, hint.format("a piece"))
        if bool(self.pieces) == bool(self.force):
            raise InputError(
                "Drive.pieces: must hold at least one piece; make one with constant() "
                "or ramp(), or else a force with pull()"
            )
        for i, (before, after) in enumerate(pairwise(self.load)):
            if after.time < before.time:
                raise InputError(
                    f"Drive.load[{i + 1}]: is at {after.time:g}, before "
                    f"{before.time:g}; give times that rise",
                    f"Drive.load[{i + 1}]",
                )

    def _repr_html_(self) -> str:
        """A card for a notebook: each piece in natural units."""
        unit = "x_s/time" if self.pieces else "f_s"
        rows = [(f"from ({unit})", f"to ({unit})", "for (time)")]
        for piece in self.parts:
            first, last = f"{piece.start:.4g}", f"{piece.end:.4g}"
            rows.append((first, last, f"{piece.duration:.4g}"))
        rows += [(str(point), "", "") for point in self.load]
        return card("Drive, in natural units", table(rows))

    @property
    def parts(self) -> tuple[Piece | ForcePiece, ...]:
        """Its pieces, of velocity or of force."""
        return self.pieces or self.force

    @property
    def duration(self) -> float:
        """Duration of the whole drive if no condition ends a piece early."""
        # summed in this order, as a run does, so that rounding is the same
        *_, total = accumulate(piece.duration for piece in self.parts)
        return total

    @property
    def velocity(self) -> float:
        """Velocity at the beginning; 0 for a drive by a force."""
        return self.pieces[0].start if self.pieces else 0.0

    @property
    def velocities(self) -> list[float]:
        """Velocities at the ends of the pieces, in order, without repeats in a row."""
        through = [end for piece in self.pieces for end in (piece.start, piece.end)]
        return [velocity for velocity, _ in groupby(through)]

    def then(self, other: "Drive") -> "Drive":
        """Return this drive followed by another; the load stays constant until the
        other drive sets one.
        """
        instance("Drive.then", other, Drive, "a drive, made with constant() or ramp()")
        load = self.load
        if other.load:
            seam = self.duration
            last = load[-1].load if load else 1.0
            later = [replace(point, time=seam + point.time) for point in other.load]
            jump = LoadPoint(seam, last), LoadPoint(seam, other.load[0].load)
            load = *load, *jump, *later
        return Drive(self.pieces + other.pieces, load, self.force + other.force)

    def under(self, load: float | Iterable[tuple[float, float]]) -> "Drive":
        """Return the drive under a normal load, a number or pairs of a time and a load,
        relative to the load at which the strength of the contacts is given.

        >>> braking = constant(1.0, duration=20).under([(5.0, 1.0), (10.0, 3.0)])
        >>> braking.load[-1]
        LoadPoint(time=10.0, load=3.0)
        """
        hint = "a number, or pairs of a time and a load, such as [(0, 1), (5, 2)]"
        pairs = [(0.0, load)] if isinstance(load, int | float) else load
        points = [
            LoadPoint(*pair("Drive.load", each, hint))
            for each in sequence("Drive.load", pairs, hint)
        ]
        if not points:
            raise refused("Drive.load", pairs, f"must be {hint}")
        return replace(self, load=tuple(points))

    def until(self, condition: Condition) -> "Drive":
        """Return the drive with its last piece ended early, at the first sample where
        the condition holds.
        """
        name = "pieces" if self.pieces else "force"
        *before, last = self.parts
        ended = replace(last, until=condition)
        return replace(self, **{name: (*before, ended)})  # type: ignore[arg-type]

    def faster(self, factor: float) -> Self:
        """Return the same path at velocities larger by a factor, in a time shorter by
        it; the times of the load are shortened, too.
        """
        return converted(
            self,
            lambda value, unit: (
                value * {"x_s/time": factor, "time": 1.0 / factor}.get(unit, 1.0)
            ),
        )


USUAL_DISTANCE = 120.0
"""Default travel of a drive at constant velocity, in ``x_s``: most transients have
decayed by then.
"""


def constant(velocity: float, duration: float | None = None) -> Drive:
    """Pull at a constant velocity, in ``x_s`` per time.

    The default duration is that of a travel of 120 ``x_s``. Zero velocity for a given
    time is a *hold*, as in slide-hold-slide.

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
    """Pull at a velocity that changes linearly from `start` to `end`."""
    return Drive((Piece(start=start, end=end, duration=duration),))


def pull(start: float, end: float | None = None, *, duration: float) -> Drive:
    """Pull a `Mass` with a force per contact, in ``f_s``: constant, or changing
    linearly from `start` to `end`.

    >>> pull(0.0, 0.6, duration=30).then(pull(0.6, duration=10)).duration
    40.0
    """
    last = start if end is None else end
    return Drive(force=(ForcePiece(start=start, end=last, duration=duration),))
