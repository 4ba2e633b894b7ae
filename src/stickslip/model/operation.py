"""How a rig is used: the speeds it works at, and what of it could be built otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from stickslip.errors import InputError, number
from stickslip.model.records import Number, Record

Speeds = tuple[Annotated[float, Number("x_s/time", above=0, hint="speeds, such as (0.5, 2.0)")], ...]


@dataclass(frozen=True, kw_only=True)
class Operation(Record):
    """How a rig is used; it changes no run, only what is asked of it.

    Parameters
    ----------
    speeds : tuple of float
        Speeds at which it works, that of its drive first.
    between : (float, float), optional
        In place of single speeds, a range of them.
    feasible : tuple of (str, float, float)
        Names of parameters, and the range of each that could be built or set.

    Raises
    ------
    InputError
        If a speed is not above 0, or a range is none.
    """

    speeds: Speeds = ()
    between: Speeds | None = None
    feasible: tuple[tuple[str, float, float], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        ranges = {f"feasible[{name}]": ends for name, *ends in self.feasible}
        for name, ends in (ranges | {"between": self.between or (1.0, 2.0)}).items():
            low, high = (number(f"Operation.{name}[{i}]", end, above=0) for i, end in enumerate(ends))
            if high < low or (high == low and name == "between"):
                raise InputError(f"Operation.{name} = ({low:g}, {high:g}): must rise", f"Operation.{name}")

    def range_of(self, parameter: str) -> tuple[float, float] | None:
        """Return the range of a parameter that could be built; None if nothing is said of it."""
        return next(((low, high) for name, low, high in self.feasible if name == parameter), None)
