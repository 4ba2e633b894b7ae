"""What the columns of a measured table are called: names, units, and which quantity
that makes them.
"""

import re
from collections.abc import Sequence
from typing import Literal, NamedTuple, Self

from stickslip.model.quantities import unit_size
from stickslip.words import PREFIXES

Quantity = Literal["force", "load", "coefficient", "time", "displacement", "other", ""]

_KINDS = {
    "force": "N",
    "time": "s",
    "length": "m",
    "stress": "Pa",
    "velocity": "m/s",
    "temperature": "K",
}
"""The SI unit of each kind of quantity."""
_WORDS: dict[str, tuple[str, float]] = {
    "sek": ("time", 1.0),
    "sekunden": ("time", 1.0),
    "minuten": ("time", 60.0),
    "stunden": ("time", 3600.0),
    **dict.fromkeys(("volt", "volts"), ("signal", 1.0)),
    **dict.fromkeys(("1", "-", "\N{EN DASH}", "\N{EM DASH}", "none"), ("number", 1.0)),
    **dict.fromkeys(("°c", "degc", "°f"), ("temperature", 1.0)),
    **dict.fromkeys(("hz", "1/s"), ("frequency", 1.0)),
    "%": ("percentage", 0.01),
    **dict.fromkeys(("deg", "°", "rad", "rpm"), ("angle", 1.0)),
}
"""What instruments write besides the units that `stickslip.model.quantities` reads."""
_NAMES: dict[Quantity, str] = {
    "time": (
        "t, time, times, elapsed, elapsed time, seconds, sec, zeit, x value, timestamp"
    ),
    "coefficient": "cof, mu, coefficient of friction, friction coefficient, friction "
    "coeff, coeff of friction, "
    "reibwert, reibungszahl, reibungskoeffizient, reibkoeffizient, coefficient de "
    "frottement",
    "load": "load, normal load, normal force, fn, f n, fz, f z, normalkraft, last, "
    "normal stress, force normale, "
    "sigma n, axial load",
    "force": "f, f d, fd, force, pull, friction, friction force, frictional force, "
    "driving force, spring force, "
    "tangential force, shear force, lateral force, shear stress, fx, f x, ft, f t, ff, "
    "f f, "
    "kraft, reibkraft, reibungskraft, tangentialkraft, zugkraft, force de frottement",
    "displacement": "x, s, displacement, displ, disp, position, pos, distance, travel, "
    "stroke, slip, extension, weg, "
    "load point displacement, slider displacement, traverse, traversenweg",
}
_NAMED: dict[str, Quantity] = {
    name: quantity for quantity, names in _NAMES.items() for name in names.split(", ")
}
_TOLD_BY_UNIT: dict[str, Quantity] = {
    "force": "force",
    "time": "time",
    "length": "displacement",
}
_FRICTION_IN: dict[str, Quantity] = {
    "number": "coefficient",
    "length": "other",
    "time": "other",
}
_UNITS_OF = {
    "time": ("time",),
    "force": ("force", "stress"),
    "load": ("force", "stress"),
    "displacement": ("length",),
}

_BRACKET = re.compile(r"(?P<name>.+?)\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]")
_TAIL = re.compile(r"(?P<name>.*?[^\W_])\s*(?:[/,_]|\s+in\b|\s)\s*(?P<unit>[^\s/,_]+)")


def unit_named(text: str) -> tuple[str, float] | None:
    """Kind of quantity and size in SI units of a unit that instruments write; None
    if it is not one of these.
    """
    plain = text.strip()
    if plain.lower() in _WORDS:
        return _WORDS[plain.lower()]
    prefix = plain[:-1]
    if plain[-1:] in ("V", "A") and (prefix in PREFIXES or not prefix):
        return "signal", float(f"1e{PREFIXES[prefix][1]}") if prefix else 1.0
    # Newton, MIN, but no "S"
    found = unit_size(plain) or (unit_size(plain.lower()) if len(plain) > 1 else None)
    if found is None or plain == "d":  # which names a displacement rather than days
        return None
    return next(
        (
            (kind, found[0])
            for kind, si in _KINDS.items()
            if unit_size(si) == (1.0, found[1])
        ),
        None,
    )


def ratio(unit: str, of: str) -> float | None:
    """Size of a unit in another of the same kind; None if they are not known, or of
    two kinds.
    """
    one = unit_named(unit)
    other = unit_named(of)
    return one[1] / other[1] if one and other and one[0] == other[0] else None


def simple(name: str) -> str:
    """A name as it is compared: in small letters, with blanks for what parts words."""
    plain = (
        name.replace("\N{MICRO SIGN}", "mu")
        .replace("\N{GREEK SMALL LETTER MU}", "mu")
        .lower()
    )
    return " ".join(re.split(r"[\s_.\-:]+", plain)).strip()


class Heading(NamedTuple):
    """Name and unit of a column as the file has them; either may be empty."""

    name: str = ""
    unit: str = ""

    @classmethod
    def read(cls, cell: str) -> Self:
        """Take the head of a column apart: ``Force (N)``, ``Force [N]``,
        ``Force / N``, ``force_N``.
        """
        cell = cell.strip(' "\t')
        if bracket := _BRACKET.fullmatch(cell):
            return cls(**bracket.groupdict())
        tail = _TAIL.fullmatch(cell)
        # F_N is the normal force, and no force in N
        if tail and _NAMED.get(simple(cell)) != "load":
            unit = unit_named(tail["unit"])
            if unit and unit[0] in _UNITS_OF.get(
                _NAMED.get(simple(tail["name"]), ""), ()
            ):
                return cls(**tail.groupdict())
        return cls(cell)

    @property
    def quantity(self) -> Quantity:
        """What the column holds, by its name and, where that says nothing, by its
        unit; empty if neither tells.
        """
        kind = (unit_named(self.unit) or ("",))[0]
        named = _NAMED.get(simple(self.name), "")
        if kind in ("temperature", "frequency", "angle", "velocity"):
            return "other"
        if named in ("force", "coefficient"):
            return _FRICTION_IN.get(
                kind, "force" if kind in _UNITS_OF["force"] else named
            )
        return named or _TOLD_BY_UNIT.get(kind, "")

    def __str__(self) -> str:
        return self.name + (f" ({self.unit})" if self.unit else "")


def headings_of(rows: Sequence[Sequence[str]], width: int) -> list[Heading]:
    """Names and units of so many columns, from lines above them; the last may hold
    the units of the names before.
    """
    names = rows[-1] if rows else [""] * width
    units = [""] * width
    cells = [cell.strip(' "[]()') for cell in names]
    filled = [cell for cell in cells if cell]
    known = [found[0] for cell in filled if (found := unit_named(cell))]
    least = 0.5 * len(filled) if len(rows) > 1 else len(filled)
    if {"force", "time", "length", "stress", "signal"} & {*known} and len(
        known
    ) >= least:
        names = rows[-2] if len(rows) > 1 else [""] * width
        units = cells
    return [
        Heading(each.name, unit or each.unit)
        for each, unit in zip(map(Heading.read, names), units, strict=True)
    ]


def with_coefficients(headings: Sequence[Heading]) -> list[Heading]:
    """Give a bare friction column the unit 1: without a unit where the others have
    theirs, it is a coefficient.
    """
    bare = (
        Heading("friction")
        if sum(bool(heading.unit) for heading in headings) >= 2
        else None
    )
    return [
        Heading(name, "1") if (simple(name), unit) == bare else Heading(name, unit)
        for name, unit in headings
    ]
