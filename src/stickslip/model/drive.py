"""The drive: the far end of the driving spring, moved at a velocity that is piecewise
linear in time.

Drives are values: comparable, printable, joined by `Drive.then`.

>>> from stickslip import constant, ramp
>>> loop = ramp(0.1, 3.0, duration=200).then(ramp(3.0, 0.1, duration=200))
>>> loop.then(constant(0.1, duration=50)).duration
450.0
"""

from dataclasses import dataclass, replace
from itertools import accumulate, groupby
from typing import Annotated, Self

from stickslip.answers import card, table
from stickslip.errors import InputError, instance, number
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


@dataclass(frozen=True)
class Drive:
    """A sequence of pieces; made with `constant` and `ramp`."""

    pieces: tuple[Piece, ...]

    def __post_init__(self) -> None:
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
        rows = [("from (x_s/time)", "to (x_s/time)", "for (time)")]
        for piece in self.pieces:
            numbers = piece.start, piece.end, piece.duration
            first, last, duration = map("{:.4g}".format, numbers)
            rows.append((first, last, duration))
        return card("Drive, in natural units", table(rows))

    @property
    def duration(self) -> float:
        """Time the whole drive lasts if no condition ends a piece early."""
        # in order, as a run adds them up
        *_, total = accumulate(piece.duration for piece in self.pieces)
        return total

    @property
    def velocities(self) -> list[float]:
        """Velocities at the ends of the pieces, in turn; each once where it stays."""
        through = [end for piece in self.pieces for end in (piece.start, piece.end)]
        return [velocity for velocity, _ in groupby(through)]

    def then(self, other: "Drive") -> "Drive":
        """Return this drive followed by another."""
        instance("Drive.then", other, Drive, "a drive, made with constant() or ramp()")
        return Drive(self.pieces + other.pieces)

    def until(self, condition: Condition) -> "Drive":
        """Return the drive with its last piece ended early, at the first sample
        where the condition holds.
        """
        return Drive((*self.pieces[:-1], replace(self.pieces[-1], until=condition)))

    def faster(self, factor: float) -> Self:
        """Return the same path at velocities that are larger by a factor, in as much
        less time.
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
