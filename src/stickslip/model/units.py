"""The only place where SI units exist: three independent scales turn a rig into natural units and results back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from stickslip.errors import InputError
from stickslip.model.records import Number, check

if TYPE_CHECKING:
    import xarray as xr

Quantity = Literal[
    "force", "length", "time", "velocity", "stiffness", "mass", "rate", "energy", "viscosity", "modulus", "density"
]


@dataclass(frozen=True, kw_only=True)
class Scales:
    """The three scales of a rig in SI units.

    Parameters
    ----------
    force : float
        Sum of the mean threshold forces of all contacts ``N f_s``, in N.
    stretching : float
        Mean breaking displacement of a contact ``x_s``, in m.
    time : float
        The unit of time, in s.
    """

    force: Annotated[float, Number(above=0, hint="in N")]
    stretching: Annotated[float, Number(above=0, hint="in m")]
    time: Annotated[float, Number(above=0, hint="in s")] = 1.0

    def __post_init__(self) -> None:
        check(self)

    def unit(self, quantity: Quantity) -> float:
        """Size of one natural unit of the quantity, in SI units.

        A force in natural units is per contact and in ``f_s``: multiplied by ``N f_s`` it is the force of the whole
        interface; stiffness, mass and energy likewise.

        Raises
        ------
        InputError
            If there is no such quantity.
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
            case "viscosity":
                return self.force * self.time / self.stretching
            case "modulus":
                return self.force / self.stretching**2
            case "density":
                return self.force * self.time**2 / self.stretching**4
            case _:
                raise InputError(f"quantity = {quantity!r}: must be one of {', '.join(get_args(Quantity))}")

    def size(self, natural: str) -> float:
        """Size of a natural unit as results carry it, such as ``"x_s/time"``, in SI units; 1 for a pure number."""
        return (si_unit(natural, self) or (1.0, natural))[0]

    def si_name(self, natural: str) -> str:
        """Name of the SI unit in which a natural unit is measured: ``"m/s"``."""
        return (si_unit(natural, self) or (1.0, natural))[1]

    def natural(self, value: float, quantity: Quantity) -> float:
        """Turn a value in SI units into natural units."""
        return value / self.unit(quantity)

    def si(self, value: float, quantity: Quantity) -> float:
        """Turn a value in natural units into SI units."""
        return value * self.unit(quantity)


_SI_OF: dict[str, tuple[Quantity, int, str]] = {
    "time": ("time", 1, "s"),
    "x_s": ("length", 1, "m"),
    "x_s/time": ("velocity", 1, "m/s"),
    "f_s": ("force", 1, "N"),
    "f_s x_s": ("energy", 1, "J"),
    "1/x_s": ("length", -1, "1/m"),
    "1/time": ("rate", 1, "1/s"),
    "k": ("stiffness", 1, "N/m"),
    "f_s time^2/x_s": ("mass", 1, "kg"),
    "f_s time/x_s": ("viscosity", 1, "N s/m"),
    "f_s/x_s^2": ("modulus", 1, "Pa"),
    "f_s time^2/x_s^4": ("density", 1, "kg/m^3"),
}
"""Natural unit of a variable: its quantity, the power of it, and the SI unit."""
SI: dict[Quantity, str] = {kind: unit for kind, power, unit in _SI_OF.values() if power == 1}
"""SI unit of each quantity."""
SI_NAMES: dict[str, str] = {natural: name for natural, (_, _, name) in _SI_OF.items()}
"""SI unit of each natural unit."""


def quantity(unit: str) -> Quantity:
    """Return what a natural unit, as results carry it, measures.

    Raises
    ------
    InputError
        If no quantity is measured in it.
    """
    named = {natural: kind for natural, (kind, power, _) in _SI_OF.items() if power == 1}
    if unit not in named:
        raise InputError(f"unit = {unit!r}: must be one of {', '.join(named)}")
    return named[unit]


def si_unit(unit: str, scales: Scales) -> tuple[float, str] | None:
    """Size of a natural unit in SI units, and the name of that; None if it is not one of ours.

    Parameters
    ----------
    unit : str
        As variables carry it: ``"x_s/time"``.
    scales : Scales
    """
    known = _SI_OF.get(unit)
    if known is None:
        return None
    quantity, power, name = known
    return scales.unit(quantity) ** power, name


def in_si(data: xr.Dataset, scales: Scales) -> xr.Dataset:
    """Return a result in SI units: each variable scaled by its ``units``, and labelled anew.

    Forces, energies and stiffnesses, per contact in natural units, become those of the whole interface. The
    provenance stays as it is: it describes the run in natural units.
    """
    converted = {}
    for name in map(str, [*data.data_vars, *data.coords]):
        variable = data[name]
        known = si_unit(str(variable.attrs.get("units")), scales)
        if known is None or variable.dtype.kind not in "fiu":
            continue
        size, unit = known
        title = str(variable.attrs.get("long_name", name)).replace(", per contact", "").replace(" per contact", "")
        values = variable.to_numpy() * size
        converted[name] = (variable.dims, values, {"units": unit, "long_name": title})
    coords = {name: value for name, value in converted.items() if name in data.coords}
    return data.assign({name: v for name, v in converted.items() if name not in coords}).assign_coords(coords)


_NATURAL: dict[Quantity, str] = {
    "force": "f_s",
    "length": "x_s",
    "time": "(time)",
    "velocity": "x_s/time",
    "stiffness": "k",
    "mass": "",
    "rate": "1/time",
    "energy": "f_s x_s",
}


def engineering(value: float, unit: str, digits: int = 4) -> str:
    """Four digits (or as many as are asked for), a prefix and a unit: ``"4 MN/m"``."""
    if unit in ("1/s",) or value == 0 or not math.isfinite(value):
        return f"{value:.{digits}g} {unit}"
    if unit == "kg":
        value, unit = value * 1e3, "g"
        if value >= 1e3:
            return f"{value / 1e3:.{digits}g} kg"
    power = min(max(math.floor(math.log10(abs(value)) / 3 + 1e-12), -5), 4)
    prefix = {-5: "f", -4: "p", -3: "n", -2: "u", -1: "m", 0: "", 1: "k", 2: "M", 3: "G", 4: "T"}[power]
    return f"{value / 1000.0**power:.{digits}g} {prefix}{unit}"


def in_words(value: float, quantity: Quantity, scales: Scales | None) -> str:
    """Say a natural value in words: in SI units with a prefix, or in natural units where there are no scales."""
    if scales is None:
        return f"{value:.4g} {_NATURAL[quantity]}".rstrip()
    return engineering(scales.si(value, quantity), SI[quantity])
