"""Numbers and quantities in words: as a person would write them, with one table of SI prefixes."""

from __future__ import annotations

import math
import re

PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
"""SI prefixes by their power of ten."""
_POWERS = {letter: power for power, letter in PREFIXES.items()} | {"µ": -6, "μ": -6, "c": -2}  # as they are read
_PREFIXED = re.compile(rf"([{''.join(_POWERS)}]?)(N|m|s|g|J|Pa|Hz|V|A)([/*].*)?")
_LARGEST = {"s": 0, "g": 3}
"""Largest power of ten of the units that people give no larger prefix: 5000 s, 5000 kg."""
_POSITIONAL = 7
"""Digits before the decimal point up to which a number is written without an exponent."""


def number(value: float, digits: int = 4) -> str:
    """A number of so many significant digits, without an exponent from 0.0001 to ten millions.

    Examples
    --------
    >>> number(123.4, 2), number(20944.2), number(1e-5)
    ('120', '20940', '1e-05')
    """
    text = f"{value:.{digits}g}"
    return f"{float(text):.{max(digits, _POSITIONAL)}g}" if "e" in text else text


def prefixed(value: float, unit: str, digits: int = 4) -> tuple[float, str]:
    """The prefix that suits a value: what to divide it by, and the unit with that prefix.

    Parameters
    ----------
    value : float
        In `unit`; of several values in one unit, the one that decides.
    unit : str
        An SI unit, with a prefix or without (``"mN"``, ``"N/m"``); any other unit stays as it is.
    digits : int
        Significant digits that will be written; 999.96 N in four of them is 1 kN.

    Examples
    --------
    >>> prefixed(2.094e5, "mN"), prefixed(3.0, "x_s/time")
    ((1000.0, 'N'), (1.0, 'x_s/time'))
    """
    found = _PREFIXED.fullmatch(unit)
    if found is None or value == 0 or not math.isfinite(value):
        return 1.0, unit
    letter, symbol, rest = found.groups(default="")
    here = _POWERS[letter]
    decade = math.floor(math.log10(abs(float(f"{value:.{digits}g}"))) + 1e-12) + here
    power = min(max(decade // 3 * 3, min(PREFIXES)), _LARGEST.get(symbol, max(PREFIXES)))
    return 10.0 ** (power - here), PREFIXES[power] + symbol + rest


def engineering(value: float, unit: str, digits: int = 4) -> str:
    """A value with its unit in so many digits and with the prefix that suits it; no unit for ``"1"`` or ``""``.

    Examples
    --------
    >>> engineering(4e6, "N/m"), engineering(2.094e5, "mN"), engineering(1180, "kg/m^3"), engineering(0.0756, "kg")
    ('4 MN/m', '209.4 N', '1180 kg/m^3', '75.6 g')
    """
    divisor, name = prefixed(value, "" if unit == "1" else unit, digits)
    return f"{number(value / divisor, digits)} {name}".rstrip()
