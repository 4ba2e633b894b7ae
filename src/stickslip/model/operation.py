"""How a rig is used: the speeds it works at, and what of it could be built otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from stickslip.errors import InputError, number, sequence
from stickslip.model.records import Number


@dataclass(frozen=True, kw_only=True)
class Operation:
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

    speeds: tuple[Annotated[float, Number("x_s/time", above=0)], ...] = ()
    between: tuple[Annotated[float, Number("x_s/time", above=0)], ...] | None = None
    feasible: tuple[tuple[str, float, float], ...] = ()

    def __post_init__(self) -> None:
        for i, speed in enumerate(sequence("Operation.speeds", self.speeds, "speeds, such as (0.5, 1.0)")):
            number(f"Operation.speeds[{i}]", speed, above=0)
        object.__setattr__(self, "speeds", tuple(self.speeds))
        if self.between is not None:
            low, high = sequence("Operation.between", self.between, "two speeds, such as (0.5, 2.0)")
            self._check("between", low, high)
            object.__setattr__(self, "between", (low, high))
        for name, low, high in self.feasible:
            self._check(f"feasible[{name}]", low, high, narrow=True)

    @staticmethod
    def _check(name: str, low: object, high: object, *, narrow: bool = False) -> None:
        least = number(f"Operation.{name}[0]", low, above=0)
        most = number(f"Operation.{name}[1]", high, above=0)
        if most < least or (most == least and not narrow):
            raise InputError(f"Operation.{name} = ({least:g}, {most:g}): must rise", f"Operation.{name}")

    def range_of(self, parameter: str) -> tuple[float, float] | None:
        """Return the range of a parameter that could be built; None if nothing is said of it."""
        return next(((low, high) for name, low, high in self.feasible if name == parameter), None)
