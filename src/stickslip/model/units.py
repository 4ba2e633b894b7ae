"""The only module that knows SI units: three independent scales convert a rig to
natural units and its results back.
"""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from stickslip.errors import refused
from stickslip.model.records import Number, Record
from stickslip.words import engineering as engineering  # imported from here by others

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class Scales(Record):
    """The three scales of a rig in SI units."""

    #: sum of the mean threshold forces, ``N f_s``
    force: Annotated[float, Number(above=0, hint="in N")]
    #: mean breaking displacement of a contact, ``x_s``
    stretching: Annotated[float, Number(above=0, hint="in m")]
    time: Annotated[float, Number(above=0, hint="in s")] = 1.0  #: the unit of time

    def unit(self, name: str) -> float:
        """Size in SI units of one natural unit, such as ``"x_s/time"``, or of the unit
        of a quantity, such as ``"velocity"``.

        A force in natural units is per contact and in ``f_s``: times ``N f_s`` it is
        the force of the whole interface; stiffness, mass and energy likewise. Raises
        `InputError` if there is no such unit or quantity.
        """
        above = below = 1.0
        for scale, power in zip(
            (self.force, self.stretching, self.time),
            _POWERS[natural_unit(name)],
            strict=True,
        ):
            above = above * scale ** max(power, 0)
            below = below * scale ** max(-power, 0)
        return above / below

    def natural(self, value: float, name: str) -> float:
        """Convert a value from SI to natural units."""
        return value / self.unit(name)

    def si(self, value: float, name: str) -> float:
        """Convert a value from natural to SI units."""
        return value * self.unit(name)


_TABLE = """
1 | 0 0 0 | 1
f_s | 1 0 0 | N | force
x_s | 0 1 0 | m | length
time | 0 0 1 | s | time
x_s/time | 0 1 -1 | m/s | velocity
k | 1 -1 0 | N/m | stiffness
f_s time^2/x_s | 1 -1 2 | kg | mass
1/time | 0 0 -1 | 1/s | rate
f_s x_s | 1 1 0 | J | energy
f_s time/x_s | 1 -1 1 | N*s/m | viscosity
f_s/x_s^2 | 1 -2 0 | Pa | modulus
f_s time^2/x_s^4 | 1 -4 2 | kg/m^3 | density
1/x_s | 0 -1 0 | 1/m
k/time | 1 -1 -1 | N/(m*s)
1/(f_s time) | -1 0 -1 | 1/(N*s)
1/(x_s time) | 0 -1 -1 | 1/(m*s)
1/time^(1/2) | 0 0 -0.5 | 1/s^(1/2)
"""
"""Natural units of fields and results: exponents of force, length and time, SI unit,
and the quantity.
"""
_ROWS = [line.split(" | ") for line in _TABLE.strip().split("\n")]
_POWERS = {unit: [*map(float, powers.split())] for unit, powers, *_ in _ROWS}
# SI unit of each natural unit
UNITS = {unit: si for unit, _, si, *_ in _ROWS}
# natural unit of each quantity
QUANTITIES = {quantity: unit for unit, _, _, *named in _ROWS for quantity in named}


def natural_unit(name: object) -> str:
    """Return a natural unit, given by its own name or by the quantity that it measures.

    Raises `InputError` if no unit or quantity has that name.
    """
    unit = QUANTITIES.get(name, name) if isinstance(name, str) else ""
    if unit not in UNITS:
        known = f"{', '.join(UNITS)}, or {', '.join(QUANTITIES)}"
        raise refused("unit", name, f"must be one of {known}")
    return unit


def si_unit(name: str) -> str:
    """Return the SI unit of a natural unit or a quantity, such as ``"m/s"``; errors as
    in `natural_unit`.
    """
    return UNITS[natural_unit(name)]


def in_si(data: "xr.Dataset", scales: Scales) -> "xr.Dataset":
    """Return a result in SI units, each variable scaled and labelled by its ``units``.

    Forces, energies and stiffnesses, per contact in natural units, become those of the
    whole interface. The provenance is unchanged: it describes the run in natural units.
    """
    converted = data.copy()
    for name, variable in data.variables.items():
        units = str(variable.attrs.get("units"))
        if units in UNITS and units != "1" and variable.dtype.kind in "fiu":
            title = re.sub(
                ",? per contact",
                "",
                str(variable.attrs.get("long_name", name)),
            )
            values = variable.to_numpy() * scales.unit(units)
            converted[name] = (
                variable.dims,
                values,
                {"units": si_unit(units), "long_name": title},
            )
    return converted


def in_words(
    value: float,
    unit: str,
    scales: Scales | None,
    digits: int = 4,
) -> str:
    """Return a natural value as text: in SI units with a prefix, or in natural units if
    there are no scales.
    """
    if scales is None:
        natural = natural_unit(unit)
        return engineering(
            value,
            "" if natural == "f_s time^2/x_s" else natural,
            digits,
        )
    return engineering(scales.si(value, unit), si_unit(unit), digits)
