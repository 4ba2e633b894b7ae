"""The only place where SI units exist: three independent scales turn a rig into natural units and results back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stickslip.errors import number

Quantity = Literal["force", "length", "time", "velocity", "stiffness", "mass", "rate", "energy"]


@dataclass(frozen=True, kw_only=True)
class Scales:
    """The three scales of a rig in SI units.

    Parameters
    ----------
    force : float
        Sum of the mean threshold forces of all contacts ``N f_s``, in N.
    stretching : float
        Mean threshold stretching of a contact ``x_s``, in m.
    time : float
        The unit of time, in s.
    """

    force: float
    stretching: float
    time: float = 1.0

    def __post_init__(self) -> None:
        for name, unit in (("force", "N"), ("stretching", "m"), ("time", "s")):
            checked = number(f"Scales.{name}", getattr(self, name), above=0, hint=f"in {unit}")
            object.__setattr__(self, name, checked)

    def unit(self, quantity: Quantity) -> float:
        """Size of one natural unit of the quantity, in SI units.

        A force in natural units is per contact and in ``f_s``: multiplied by ``N f_s`` it is the force of the whole
        interface; stiffness, mass and energy likewise.
        """
        match quantity:
            case "force":
                return self.force
            case "length":
                return self.stretching
            case "time":
                return self.time
            case "velocity":
                return self.stretching / self.time
            case "stiffness":
                return self.force / self.stretching
            case "mass":
                return self.force * self.time**2 / self.stretching
            case "rate":
                return 1.0 / self.time
            case "energy":
                return self.force * self.stretching

    def natural(self, value: float, quantity: Quantity) -> float:
        """Turn a value in SI units into natural units."""
        return value / self.unit(quantity)

    def si(self, value: float, quantity: Quantity) -> float:
        """Turn a value in natural units into SI units."""
        return value * self.unit(quantity)
