"""Numbers and quantities in words, as a person would write them, with SI prefixes."""

import math
import re
from collections.abc import Iterable

PREFIXES: dict[str, tuple[str, int]] = {
    "f": ("femto", -15),
    "p": ("pico", -12),
    "n": ("nano", -9),
    "m": ("milli", -3),
    "c": ("centi", -2),
    "µ": ("micro", -6),
    "μ": ("micro", -6),
    "u": ("micro", -6),
    "d": ("deci", -1),
    "da": ("deca", 1),
    "h": ("hecto", 2),
    "k": ("kilo", 3),
    "M": ("mega", 6),
    "G": ("giga", 9),
    "T": ("tera", 12),
}
"""SI prefixes that can be read: their names and powers of ten."""
_WRITTEN = {
    0: "",
    **{power: symbol for symbol, (_, power) in PREFIXES.items() if power % 3 == 0},
}
_PREFIXED = re.compile(rf"({'|'.join(PREFIXES)}|)(N|m|s|g|J|Pa|Hz|V|A)([/*].*)?")
_PER_SECOND = {f"/{symbol}s": power for symbol, (_, power) in PREFIXES.items()}
_LARGEST = {"s": 0, "g": 3}
"""Largest power of ten of units that people write without a larger prefix: 5000 s and
5000 kg.
"""
# most digits before the decimal point of a number that is written without an exponent
_POSITIONAL = 7


def number(value: float, digits: int = 4) -> str:
    """Return a number in words, with significant digits, and from 0.0001 to ten million
    without an exponent.

    Examples
    --------
    >>> number(123.4, 2), number(20944.2), number(1e-5)
    ('120', '20940', '1e-05')
    """
    text = f"{value:.{digits}g}"
    return f"{float(text):.{max(digits, _POSITIONAL)}g}" if "e" in text else text


def listed(names: Iterable[object]) -> str:
    """Return names as a list in words: ``a, b and c``."""
    *first, last = map(str, names)
    return f"{', '.join(first)} and {last}" if first else last


def percent(fraction: float) -> str:
    """Return a fraction in per cent: whole per cents from 10 % on, two digits below.

    Examples
    --------
    >>> percent(1.463), percent(0.034), percent(0.0)
    ('146 %', '3.4 %', '0 %')
    """
    value = 100.0 * fraction
    return f"{value:.0f} %" if value >= 9.95 else f"{value:.2g} %"


def prefixed(value: float, unit: str, digits: int = 4) -> tuple[float, str]:
    """Return the unit of a value with a suitable SI prefix, and the divisor that
    converts the value to it, the divisor first.

    A unit that is not SI is returned unchanged. 999.96 N in four significant digits is
    1 kN. Rates are converted to rates per second.

    Examples
    --------
    >>> prefixed(2.094e5, "mN"), prefixed(5e-4, "N/ms"), prefixed(3.0, "x_s/time")
    ((1000.0, 'N'), (1e-06, 'mN/s'), (1.0, 'x_s/time'))
    """
    found = _PREFIXED.fullmatch(unit)
    if found is None or value == 0 or not math.isfinite(value):
        return 1.0, unit
    letter, symbol, rest = found.groups(default="")
    here = (PREFIXES[letter][1] if letter else 0) - _PER_SECOND.get(rest, 0)
    decade = math.floor(math.log10(abs(float(f"{value:.{digits}g}"))) + 1e-12) + here
    decade = 0 if symbol == "Hz" and decade == -1 else decade  # 0.7 Hz, not 700 mHz
    power = min(
        max(decade // 3 * 3, min(_WRITTEN)),
        _LARGEST.get(symbol, max(_WRITTEN)),
    )
    return 10.0 ** (power - here), _WRITTEN[power] + symbol + (
        "/s" if rest in _PER_SECOND else rest
    )


def engineering(value: float, unit: str, digits: int = 4) -> str:
    """Return a value with its unit and a suitable prefix; the unit ``"1"`` is not
    shown, and "time" is shown as time units.

    Examples
    --------
    >>> (
    ...     engineering(4e6, "N/m"),
    ...     engineering(2.094e5, "mN"),
    ...     engineering(1180, "kg/m^3"),
    ...     engineering(0.0756, "kg"),
    ... )
    ('4 MN/m', '209.4 N', '1180 kg/m^3', '75.6 g')
    """
    divisor, name = prefixed(
        value, {"1": "", "time": "time units"}.get(unit, unit), digits
    )
    return f"{number(value / divisor, digits)} {name}".rstrip()
