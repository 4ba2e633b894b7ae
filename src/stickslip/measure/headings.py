"""What the columns of a measured table are called: names, units, and which quantity that makes them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from stickslip.model.quantities import unit_size
from stickslip.words import PREFIXES

Quantity = Literal["force", "load", "coefficient", "time", "displacement", "other", ""]

_KINDS: dict[str, dict[str, int]] = {
    "force": {"kg": 1, "m": 1, "s": -2},
    "time": {"s": 1},
    "length": {"m": 1},
    "stress": {"kg": 1, "m": -1, "s": -2},
    "velocity": {"m": 1, "s": -1},
    "temperature": {"K": 1},
}
_WORDS: dict[str, tuple[str, float]] = {
    **dict.fromkeys(("sek", "sekunden"), ("time", 1.0)),
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
_NAMES: dict[Quantity, set[str]] = {
    "time": {"t", "time", "times", "elapsed", "elapsed time", "seconds", "sec", "zeit", "x value", "timestamp"},
    "coefficient": {
        *("cof", "mu", "coefficient of friction", "friction coefficient", "friction coeff", "coeff of friction"),
        *("reibwert", "reibungszahl", "reibungskoeffizient", "reibkoeffizient", "coefficient de frottement"),
    },
    "load": {
        *("load", "normal load", "normal force", "fn", "f n", "fz", "f z", "normalkraft", "last", "normal stress"),
        *("force normale", "sigma n", "axial load"),
    },
    "force": {
        *("f", "f d", "fd", "force", "pull", "friction", "friction force", "frictional force", "driving force"),
        *("spring force", "tangential force", "shear force", "lateral force", "shear stress", "fx", "f x", "ft", "f t"),
        *("kraft", "reibkraft", "reibungskraft", "tangentialkraft", "zugkraft", "force de frottement", "ff", "f f"),
    },
    "displacement": {
        *("x", "s", "displacement", "displ", "disp", "position", "pos", "distance", "travel", "stroke", "slip"),
        *("extension", "weg", "load point displacement", "slider displacement", "traverse", "traversenweg"),
    },
}
_BRACKET = re.compile(r"\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")
_TAIL = re.compile(r"(?P<name>.*?[^\W_])\s*(?:[/,_]|\s+in\b|\s)\s*(?P<unit>[^\s/,_]+)")


def unit_named(text: str) -> tuple[str, float] | None:
    """Kind of quantity and size in SI units of a unit that instruments write; None if it is not one of these."""
    plain = text.strip()
    if plain.lower() in _WORDS:
        return _WORDS[plain.lower()]
    prefix = plain[:-1]
    if plain[-1:] in ("V", "A") and (prefix in PREFIXES or not prefix):
        return "signal", float(f"1e{PREFIXES[prefix][1]}") if prefix else 1.0
    found = unit_size(plain) or (unit_size(plain.lower()) if len(plain) > 1 else None)  # Newton, MIN, but no "S"
    if found is None or plain == "d":  # which names a displacement rather than days
        return None
    return next(((kind, found[0]) for kind, parts in _KINDS.items() if parts == found[1]), None)


def ratio(unit: str, of: str) -> float | None:
    """Size of a unit in another of the same kind; None if they are not known, or of two kinds."""
    one, other = unit_named(unit), unit_named(of)
    return one[1] / other[1] if one and other and one[0] == other[0] else None


def simple(name: str) -> str:
    """A name as it is compared: in small letters, with blanks for what parts words."""
    plain = name.replace("\N{MICRO SIGN}", "mu").replace("\N{GREEK SMALL LETTER MU}", "mu").lower()
    return " ".join(re.split(r"[\s_.\-:]+", plain)).strip()


@dataclass(frozen=True, kw_only=True)
class Heading:
    """Name and unit of a column as the file has them; either may be empty."""

    name: str = ""
    unit: str = ""

    @classmethod
    def read(cls, cell: str) -> Heading:
        """Take the head of a column apart: ``Force (N)``, ``Force [N]``, ``Force / N``, ``force_N``."""
        cell = cell.strip().strip('"').strip()
        bracket = _BRACKET.search(cell)
        if bracket and bracket.start():
            return cls(name=cell[: bracket.start()].strip(), unit=bracket[1])
        tail = _TAIL.fullmatch(cell)
        if tail and _named(cell) != "load":  # F_N is the normal force, and no force in N
            kind, unit = _named(tail["name"]), unit_named(tail["unit"])
            fits = {"time": {"time"}, "force": {"force", "stress"}, "load": {"force", "stress"}}
            if unit and unit[0] in fits.get(kind, {"length"} if kind == "displacement" else set()):
                return cls(name=tail["name"].strip(), unit=tail["unit"])
        return cls(name=cell)

    @property
    def quantity(self) -> Quantity:
        """What the column holds, by its name and, where that says nothing, by its unit; empty if neither tells."""
        known = unit_named(self.unit) if self.unit else None
        kind = known[0] if known else ""
        named = _named(self.name)
        if kind in ("temperature", "frequency", "angle", "velocity"):
            return "other"
        if named == "force" and kind == "number":
            return "coefficient"
        if named == "force" and kind in ("length", "time"):
            return "other"
        if not named:
            return {"force": "force", "time": "time", "length": "displacement"}.get(kind, "")  # type: ignore[return-value]
        return named

    def __str__(self) -> str:
        return self.name + (f" ({self.unit})" if self.unit else "")


def _named(name: str) -> Quantity:
    return next((kind for kind, names in _NAMES.items() if simple(name) in names), "")


def is_units_row(cells: Sequence[str], *, below_names: bool) -> bool:
    """Whether the cells of a line are units: all known, or, below a line of names, most of them."""
    filled = [cell.strip().strip('"').strip("[]() ") for cell in cells if cell.strip()]
    known = [unit_named(cell) for cell in filled]
    if not any(unit and unit[0] in ("force", "time", "length", "stress", "signal") for unit in known):
        return False
    count = sum(unit is not None for unit in known)
    return count == len(filled) or (below_names and count >= 0.5 * len(filled) and max(map(len, filled)) <= 12)


def coefficients_without_unit(headings: Sequence[Heading]) -> list[Heading]:
    """Name the unit of a bare friction column: without one where the others have theirs, it is a coefficient."""
    carry = sum(bool(heading.unit) for heading in headings)
    found = []
    for heading in headings:
        bare = simple(heading.name) == "friction" and not heading.unit
        found.append(Heading(name=heading.name, unit="1") if bare and carry >= 2 else heading)
    return found
