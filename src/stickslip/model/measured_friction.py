"""A measured friction curve: friction at several speeds, with errors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Annotated, Any, Self

import numpy as np

from stickslip.errors import InputError, number, refused, sequence, shown
from stickslip.model.records import Number, Record

_POINT = "points (velocity, friction), or (velocity, friction, error)"


@dataclass(frozen=True, kw_only=True)
class MeasuredFriction(Record):
    """Friction at two or more increasing speeds, each value with its standard error."""

    velocities: Annotated[tuple[float, ...], Number("x_s/time", above=0)]
    forces: Annotated[tuple[float, ...], Number("f_s", above=0)]
    errors: Annotated[tuple[float, ...], Number("f_s", at_least=0)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.velocities) < 2 or np.any(np.diff(self.velocities) <= 0.0):
            raise InputError(
                f"friction = {shown(self.velocities)}: must be at two speeds or more, "
                "each once"
            )

    @classmethod
    def of_points(cls, points: Any, place: str = "points") -> Self:
        """Make a curve from points in any order.

        A missing error is taken as the rounding error of the forces.
        """
        rows = []
        for i, point in enumerate(sequence(place, points, _POINT)):
            row = sequence(f"{place}[{i}]", point, f"one of {_POINT}")
            if len(row) not in (2, 3):
                raise refused(f"{place}[{i}]", point, f"must be one of {_POINT}")
            numbers = (
                number(f"{place}[{i}]", value, at_least=0 if j == 2 else None)
                for j, value in enumerate(row)
            )
            rows.append([*numbers])
        rounding = rounding_error([row[1] for row in rows]) if rows else 0.0
        rows = sorted([*row, rounding][:3] for row in rows)
        velocities, forces, errors = zip(*rows, strict=True) if rows else ((), (), ())
        return cls(velocities=velocities, forces=forces, errors=errors)

    def scaled(self, factor: float) -> Self:
        """Return the curve with all forces times a factor."""
        return replace(
            self,
            forces=tuple(factor * force for force in self.forces),
            errors=tuple(factor * error for error in self.errors),
        )

    def without(self, viscosity: float) -> Self:
        """Return the curve less a viscous force, `viscosity` times the velocity."""
        each = zip(self.velocities, self.forces, strict=True)
        return replace(self, forces=tuple(f - viscosity * v for v, f in each))


def rounding_error(values: Sequence[float]) -> float:
    """Return half a unit of the last decimal place of the number with the most decimal
    places.
    """
    digits = (Decimal(repr(value)).normalize().as_tuple() for value in values)
    return float(0.5 * 10.0 ** min(int(each.exponent) for each in digits))
