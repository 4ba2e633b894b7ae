"""Quantities in text: one number and a unit, ``"4 MN/m"``, by one strict grammar, with
exact sizes of units.

A general library of units would take a third of a second to load, and accepts texts
that may mean something else: it reads ``mPas`` as millipascals.
"""

import re
import sys
from collections import Counter
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache

from stickslip.errors import InputError, number, refused
from stickslip.words import PREFIXES

LONGEST_QUANTITY = 64  # characters of a quantity; longer texts are refused unread

# typesetting uses no-break and narrow spaces between a number and its unit
_BLANKS = "[ \u00a0\u202f]*"
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?"
_NAME = "[A-Za-zµμÅ\u212b]+"
_POWER = rf"{_NAME}(?:(?:\^|\*\*)-?[1-9]|⁻?[¹²³])?"
_PRODUCT = f"{_POWER}(?: *[*·⋅] *{_POWER})*"
_GROUP = rf"\( *{_PRODUCT} *\)"
# One "/" at most, and one factor after it unless there are parentheses: "N/m*s" could
# be read in two ways.
_UNIT = (
    f"(?:{_PRODUCT}|{_GROUP})(?: */ *(?:{_POWER}|{_GROUP}))?|1? */ "
    f"*(?:{_POWER}|{_GROUP})"
)
_QUANTITY = re.compile(f"{_BLANKS}({_NUMBER}){_BLANKS}({_UNIT})?{_BLANKS}")
_FACTOR = re.compile(rf"({_NAME})(?:(?:\^|\*\*)(-?[1-9])|(⁻?[¹²³]))?")
_RAISED = str.maketrans("⁻¹²³", "-123")

_STANDARD_GRAVITY = Fraction("9.80665")
_POUND = Fraction("0.45359237")
_FOOT = Fraction("0.3048")
_YEAR = Fraction("365.25") * 86400
_LENGTH = {"m": 1}
_MASS = {"kg": 1}
_TIME = {"s": 1}
_FORCE = {"kg": 1, "m": 1, "s": -2}
_PRESSURE = {"kg": 1, "m": -1, "s": -2}
_ENERGY = {"kg": 1, "m": 2, "s": -2}
_UNITS: tuple[tuple[str, str, Fraction | int, dict[str, int]], ...] = (
    ("m", "meter metre", 1, _LENGTH),
    ("g", "gram gramme", Fraction(1, 1000), _MASS),
    ("s sec secs", "second", 1, _TIME),
    ("N", "newton", 1, _FORCE),
    ("Pa", "pascal", 1, _PRESSURE),
    ("J", "joule", 1, _ENERGY),
    ("bar", "", 10**5, _PRESSURE),
    ("t", "tonne", 1000, _MASS),
    ("yr yrs", "year", _YEAR, _TIME),
    ("dyn", "dyne", Fraction(1, 10**5), _FORCE),
    ("K", "kelvin", 1, {"K": 1}),
    ("min mins", "minute", 60, _TIME),
    ("h hr hrs", "hour", 3600, _TIME),
    ("d", "day", 86400, _TIME),
    ("Å \u212b", "angstrom", Fraction(1, 10**10), _LENGTH),
    ("µ μ", "micron", Fraction(1, 10**6), _LENGTH),
    ("in inches", "inch", _FOOT / 12, _LENGTH),
    ("ft feet", "foot", _FOOT, _LENGTH),
    ("lb lbs", "", _POUND, _MASS),
    ("gf", "", _STANDARD_GRAVITY / 1000, _FORCE),
    ("kgf kp", "kilopond", _STANDARD_GRAVITY, _FORCE),
    ("lbf", "", _POUND * _STANDARD_GRAVITY, _FORCE),
    ("psi", "", _POUND * _STANDARD_GRAVITY / (_FOOT / 12) ** 2, _PRESSURE),
)
"""Units: symbols, names (which also have a plural), size in SI base units, and their
exponents.
"""
_PREFIXED = 10  # number of units in the table, from the first on, that take a prefix
_UNCLEAR = {
    **dict.fromkeys(
        ("ton", "tons"), "differs between countries; write 't' for 1000 kg"
    ),
    **dict.fromkeys(("pound", "pounds"), "is a mass or a force; write 'lb' or 'lbf'"),
    **dict.fromkeys(("mil", "mils"), "has several meanings; write it in 'um'"),
    "kt": "may be knots or kilotonnes; write 'm/s' or 'Gg'",
    "Hz": "counts cycles, and may mean 2 pi times as much; write '1/s'",
}
"""Units that mean different things to different people."""


def read_quantity(
    text: str,
    unit: str,
    example: str,
    *,
    bare: bool = False,
) -> float:
    """Read a quantity such as ``"4 MN/m"``, one number with a decimal point and its
    unit, as a number in `unit`.

    A unit consists of names of units, ``*`` or ``·``, at most one ``/``, and integer
    exponents: ``N*s/m``, never ``N s``; ``m^2``, ``m**2``, ``m²``; ``1/(m*s)``,
    ``s^-1``. With `bare` a number without a unit is accepted as well. The value is the
    double nearest to the exact one. Errors show `example`, and do not name the place.

    >>> read_quantity("2 um", "m", "2 um")
    2e-06
    >>> read_quantity("1,2 kg", "kg", "75.6 g")
    Traceback (most recent call last):
    stickslip.errors.InputError: write '1.2 kg': decimal point, not comma
    """
    as_in = f"write it as in {example!r}"
    if len(text) > LONGEST_QUANTITY:
        raise InputError(f"is longer than {LONGEST_QUANTITY} characters; {as_in}")
    found = _QUANTITY.fullmatch(text)
    if found is None:
        general = (
            "cannot be read as a quantity, one number with a decimal point and "
            f"its unit; {as_in}"
        )
        raise InputError(_remedy(text) or general)
    if found[2] is None:
        if bare:
            return _nearest(Fraction(found[1]))
        raise InputError(f"has no unit; {as_in}")
    size, dimensions = _size_of(found[2])
    wanted, kind = _size_of(unit)
    if dimensions == _size_of(f"kg {unit}")[1]:
        raise InputError(
            f"is {unit!r} times a mass; divide it by the mass, and {as_in}"
        )
    if dimensions != kind:
        raise InputError(f"is not in a unit of {unit!r}; {as_in}")
    return _nearest(Fraction(found[1]) * size / wanted)


def read_number(text: str) -> float:
    """Read a plain number with a decimal point, as on a command line; errors do not
    name the place.
    """
    found = _QUANTITY.fullmatch(text) if len(text) <= LONGEST_QUANTITY else None
    if found is None or found[2]:
        raise InputError(
            (_remedy(text) if found is None else "") or "must be a number, such as 0.5"
        )
    return _nearest(Fraction(found[1]))


def read_value(
    place: str,
    value: object,
    unit: str,
    example: str,
    *,
    bare: bool = False,
    above: float | None = 0,
    at_least: float | None = None,
) -> float:
    """Return a value, above 0 by default, that is given as a number in `unit` or as a
    text with a unit; errors name the place.
    """
    if isinstance(value, str):
        try:
            value = read_quantity(value, unit, example, bare=bare)
        except InputError as error:
            raise refused(place, value, str(error)) from None
    return number(
        place,
        value,
        above=above,
        at_least=at_least,
        hint="" if unit == "1" else f"in {unit}",
    )


def _nearest(value: Fraction) -> float:
    try:
        result = float(value)
    except OverflowError:
        raise InputError("must be finite") from None
    if value and abs(result) < sys.float_info.min:
        raise InputError(
            f"is too small for double precision ({sys.float_info.min:.1e})"
        )
    return result


Size = tuple[Fraction, dict[str, int]]
"""Size of a unit in SI base units, exactly, and the exponents of these."""


@lru_cache(maxsize=256)
def _size_of(unit: str) -> Size:
    """Size of a unit in SI base units, exactly, and the exponents of these."""
    size = Fraction(1)
    dimensions = Counter[str]()
    above, _, below = unit.partition("/")
    for side, sign in ((above, 1), (below, -1)):
        for name, power, raised in _FACTOR.findall(side):
            exponent = sign * int(power or raised.translate(_RAISED) or 1)
            if name in _UNCLEAR:
                raise InputError(f"the unit {name!r} {_UNCLEAR[name]}")
            if name not in _unit_spellings():
                raise InputError(
                    f"unknown unit {name!r}; units are case-sensitive, as MN and mN"
                )
            factor, parts = _unit_spellings()[name]
            size *= factor**exponent
            dimensions.update({base: exponent * count for base, count in parts.items()})
    return size, {base: count for base, count in dimensions.items() if count}


@lru_cache(maxsize=256)
def unit_size(unit: str) -> tuple[float, dict[str, int]] | None:
    """Return the size of a unit in SI base units and their exponents; None if the unit
    is unknown.
    """
    with suppress(InputError):
        if re.fullmatch(_UNIT, unit):
            size, dimensions = _size_of(unit)
            return float(size), dimensions
    return None


@lru_cache(maxsize=1)
def _unit_spellings() -> dict[str, Size]:
    """Return every spelling of every unit, with its size and the exponents of the SI
    base units.
    """
    spellings: dict[str, Size] = {}
    # The units without a prefix come last and win: "ft" is not a femtotonne.
    for symbol, (name, power) in {**PREFIXES, "": ("", 0)}.items():
        for symbols, names, size, parts in _UNITS[:_PREFIXED] if symbol else _UNITS:
            words = [name + own for own in names.split()]
            for spelling in (
                *(symbol + own for own in symbols.split()),
                *words,
                *(f"{word}s" for word in words),
            ):
                spellings[spelling] = Fraction(10) ** power * size, parts
    return spellings


_SLIPS = (
    (
        re.compile("[\u2212\u2010-\u2014]"),
        "-",
        "the minus sign is the '-' of the keyboard",
    ),
    (re.compile(r"(?<=\d),(?=\d{3}(?:,\d{3})*\.)"), "", "no separators of thousands"),
    (re.compile(r"(?<=\d)\.(?=\d{3}(?:\.\d{3})*,)"), "", "no separators of thousands"),
    (
        re.compile(r"(?<=\d)[ \u00a0\u2009\u202f'’_](?=\d{3}(?!\d))"),
        "",
        "no blanks or marks inside a number",
    ),
    # not "1,200", which may have a decimal or a thousands comma
    (re.compile(r"(?<=\d),(?=\d)(?!\d{3}(?!\d))"), ".", "decimal point, not comma"),
    (
        re.compile(r"(?<=[A-Za-zµμÅ])(?<![\d. ][eE])(-?[1-9])"),
        r"^\1",
        "'^' before an exponent",
    ),
    (re.compile(r"(?<=[A-Za-zµμÅ¹²³]) +(?=[A-Za-zµμÅ])"), "*", "'*' between units"),
)
"""Slips of writing for which the right form is clear."""


def _remedy(text: str) -> str:
    """Return a suggestion of how to write a text; empty if its meaning is not clear."""
    if re.match(r" *[-+]?(nan|inf)", text, re.IGNORECASE):
        return "must be finite"
    if len(text) > LONGEST_QUANTITY:
        return ""
    if re.search(r"/.*[/*·⋅]", text) and "(" not in text and "**" not in text:
        return (
            "may be read in two ways; after '/' put one unit, or parentheses, as in "
            "'3 N/(m*s)'"
        )
    reasons = []
    for slip, right, reason in _SLIPS:
        text, count = slip.subn(right, text)
        if count:
            reasons.append(reason)
        if found := _QUANTITY.fullmatch(text):
            if found[2]:
                _size_of(found[2])  # raises where the unit is unknown or unclear
            return f"write {text.strip()!r}: {', '.join(dict.fromkeys(reasons))}"
    return ""
