"""The door for TOML files: strict models in, every mistake in one line that names place, value and remedy.

Quantities in SI files are strings with a unit, ``"4 MN/m"``; a number without one is refused, because nobody can tell
what it meant. Files in natural units hold plain numbers.
"""

from __future__ import annotations

import difflib
import math
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Mapping
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, cast

from pydantic import BaseModel, BeforeValidator, ConfigDict, TypeAdapter, ValidationError, ValidationInfo

from stickslip.errors import InputError, extreme, shortened, shown
from stickslip.io import files

if TYPE_CHECKING:
    import pint

LARGEST_FILE = 1_000_000
"""Bytes beyond which a file is no description of anything."""


class Part(BaseModel):
    """A table of a file: strict, closed, frozen."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


Document = TypeVar("Document", bound=Part)


def read_toml(path: Path, kind: str, example: str) -> dict[str, Any]:
    """Read the content of a TOML file.

    Parameters
    ----------
    path : Path
    kind : str
        What the file should be, for the message: ``"rig file"``.
    example : str
        A file to look at.

    Raises
    ------
    InputError
        If the file is missing, empty, binary or no TOML.
    """
    content = files.read(path, kind, largest=LARGEST_FILE)
    if not content.strip():
        raise InputError(f"{path}: is empty; see {example} for what a {kind} holds")
    try:
        text = content.decode()
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path}: is a binary file; a {kind} is TOML text")
    return parse_toml(text, str(path), kind)


def parse_toml(text: str, place: str, kind: str) -> dict[str, Any]:
    """Read TOML text; `place` begins the message of an error, and `kind` is what the text should be."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{place}: is not valid TOML: {shortened(str(error))}") from None
    except RecursionError:
        raise InputError(f"{place}: is nested too deep; a {kind} has tables in tables, three levels at most") from None
    except ValueError:  # Python reads no integer of more than 4300 digits
        raise InputError(f"{place}: holds a whole number of thousands of digits; no {kind} needs one") from None


def validate(kind: type[Document], content: Mapping[str, Any], place: str, *, natural: bool) -> Document:
    """Check the content of a file against a model.

    Parameters
    ----------
    kind : type
        The model.
    content : mapping
        What the file holds.
    place : str
        Begins the message of an error.
    natural : bool
        Whether quantities are plain numbers in natural units.

    Raises
    ------
    InputError
        Naming every mistake: key, value, remedy.
    """
    try:
        return kind.model_validate(content, context={"natural": natural})
    except ValidationError as error:
        raise InputError(f"{place}: {_in_one_line(error, kind)}") from None


# ---------------------------------------------------------------------------------------------------------------------
# Quantities
# ---------------------------------------------------------------------------------------------------------------------


LONGEST_QUANTITY = 64
"""Characters of a quantity; longer texts are refused unread."""

_BLANKS = "[ \u00a0\u202f]*"  # typesetting puts the narrow ones between a number and its unit
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?"
_NAME = "[A-Za-zµμÅ\u212b]+"
_POWER = rf"{_NAME}(?:(?:\^|\*\*)-?[1-9]|⁻?[¹²³])?"
_PRODUCT = f"{_POWER}(?: *[*·⋅] *{_POWER})*"
_GROUP = rf"\( *{_PRODUCT} *\)"
# One "/" at most, and one factor after it unless there are parentheses: "N/m*s" would be read in two ways.
_UNIT = f"(?:{_PRODUCT}|{_GROUP})(?: */ *(?:{_POWER}|{_GROUP}))?|1? */ *(?:{_POWER}|{_GROUP})"
_QUANTITY = re.compile(f"{_BLANKS}({_NUMBER}){_BLANKS}({_UNIT})?{_BLANKS}")
_PLAIN_NUMBER = re.compile(f" *({_NUMBER}) *")
_FACTOR = re.compile(rf"({_NAME})(?:(?:\^|\*\*)(-?[1-9])|(⁻?[¹²³]))?")
_RAISED = str.maketrans("⁻¹²³", "-123")

_PREFIXED = ("m", "g", "s", "N", "Pa", "J", "bar", "time", "yr", "dyn")
"""Units that take a prefix, by their symbols; their names and plurals are known as well."""
_UNPREFIXED = (
    *("min", "h", "d", "week", "angstrom", "micron", "in", "thou", "ft", "yd", "mi", "mph", "kph"),
    *("lb", "slug", "gf", "kgf", "lbf", "kip", "erg", "atm", "psi"),
)
_UNCLEAR = {
    **dict.fromkeys(("ton", "tons"), "differs between countries; write 't' for 1000 kg"),
    **dict.fromkeys(("pound", "pounds"), "is a mass or a force; write 'lb' or 'lbf'"),
    **dict.fromkeys(("mil", "mils"), "has several meanings; write 'thou' for 1/1000 inch"),
    "kt": "may be knots or kilotonnes; write 'm/s' or 'Gg'",
    "Hz": "counts cycles, and may mean 2 pi times as much; write '1/s'",
}
"""Units that mean different things to different people."""


def read_quantity(text: str, unit: str, example: str, *, bare: bool = False) -> float:
    """Read a quantity such as ``"4 MN/m"``: one number with a decimal point, then its unit; nothing else.

    A unit is made of the names of units, ``*`` or ``·``, one ``/``, and whole exponents: ``N*s/m``, ``N s`` never;
    ``m^2``, ``m**2``, ``m²``; ``1/(m*s)``, ``s^-1``. Names may be symbols or words; SI units take prefixes.

    Parameters
    ----------
    text : str
        At most 64 characters.
    unit : str
        Unit in which the value is returned.
    example : str
        A quantity of this kind, for the message of an error.
    bare : bool
        Whether a number without a unit is taken, too, as one in `unit`: where the place itself names the unit.

    Returns
    -------
    float
        The double nearest to the exact value.

    Raises
    ------
    InputError
        If the text is anything else, or its value is no finite number of full precision; the message does not name
        the place.

    Examples
    --------
    >>> read_quantity("2 um", "m", "2 um")
    2e-06
    >>> read_quantity("1,2 kg", "kg", "75.6 g")
    Traceback (most recent call last):
    stickslip.errors.InputError: write '1.2 kg': decimal point, not comma
    """
    if len(text) > LONGEST_QUANTITY:
        raise InputError(f"is longer than {LONGEST_QUANTITY} characters; write it as in {example!r}")
    found = _QUANTITY.fullmatch(text)
    if found is None:
        remedy = _remedy(text, _QUANTITY)
        raise InputError(remedy or f"cannot be read as a quantity, one number and its unit; write it as in {example!r}")
    if found[2] is None:
        if bare:
            return _nearest(Fraction(found[1]))
        raise InputError(f"has no unit; write it as in {example!r}")
    size, dimensions = _size_of(found[2])
    wanted, kind = _size_of(unit)
    if dimensions != kind:
        raise InputError(f"is not in a unit of {unit!r}; write it as in {example!r}")
    return _nearest(Fraction(found[1]) * size / wanted)


def read_number(text: str) -> float:
    """Read a plain number with a decimal point, as it stands on a command line or in a link.

    Raises
    ------
    InputError
        If the text is anything else, or the number is not finite; the message does not name the place.
    """
    found = _PLAIN_NUMBER.fullmatch(text) if len(text) <= LONGEST_QUANTITY else None
    if found is None:
        raise InputError(_remedy(text, _PLAIN_NUMBER) or "must be a number, such as 0.5")
    return _nearest(Fraction(found[1]))


def _nearest(value: Fraction) -> float:
    try:
        result = float(value)
    except OverflowError:
        raise InputError("must be finite") from None
    if value and abs(result) < sys.float_info.min:
        raise InputError(f"is nearer to 0 than any number the computer keeps whole ({sys.float_info.min:.1e})")
    return result


@lru_cache(maxsize=256)
def _size_of(unit: str) -> tuple[Fraction, dict[str, int]]:
    """Size of a unit in pint's base units, exactly, and the exponents of these."""
    size, dimensions = Fraction(1), Counter[str]()
    above, _, below = unit.partition("/")
    for side, sign in ((above, 1), (below, -1)):
        for name, power, raised in _FACTOR.findall(side):
            exponent = sign * int(power or raised.translate(_RAISED) or 1)
            factor, parts = _named(name)
            size *= factor**exponent
            dimensions.update({base: exponent * count for base, count in parts.items()})
    return size, {base: count for base, count in dimensions.items() if count}


@lru_cache(maxsize=256)
def _named(name: str) -> tuple[Fraction, dict[str, int]]:
    """Size and dimensions of one unit; pint is shown its name and no more."""
    registry, prefixed, unprefixed = _units()
    if name in _UNCLEAR:
        raise InputError(f"the unit {name!r} {_UNCLEAR[name]}")
    # Several readings: "ft" could be a femtotonne. Without a prefix comes first.
    prefix, known, _ = min(registry.parse_unit_name(name), key=lambda way: way[0] != "", default=("", "", ""))
    if known not in (prefixed if prefix else prefixed | unprefixed):
        raise InputError(f"{name!r} is no unit known here; capitals matter, as in MN and mN")
    size, base = cast("tuple[Fraction, Any]", registry.get_root_units(prefix + known))
    return Fraction(size), {str(unit): int(power) for unit, power in base._units.items()}


@lru_cache(maxsize=1)
def _units() -> tuple[pint.UnitRegistry[Any], frozenset[str], frozenset[str]]:
    """Registry of pint, with exact sizes, and its names of the units that are taken with and without a prefix."""
    import pint

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(non_int_type=Fraction)
    prefixed, unprefixed = (
        frozenset(registry.parse_unit_name(symbol)[0][1] for symbol in symbols) for symbols in (_PREFIXED, _UNPREFIXED)
    )
    return registry, prefixed, unprefixed


_SLIPS = (
    (re.compile("[\u2212\u2010-\u2014]"), "-", "the minus sign is the '-' of the keyboard"),
    (re.compile(r"(?<=\d),(?=\d{3}(?:,\d{3})*\.)"), "", "no separators of thousands"),
    (re.compile(r"(?<=\d)\.(?=\d{3}(?:\.\d{3})*,)"), "", "no separators of thousands"),
    (re.compile(r"(?<=\d)[ \u00a0\u2009\u202f'’_](?=\d{3}(?!\d))"), "", "no blanks or marks inside a number"),
    (re.compile(r"(?<=\d),(?=\d)"), ".", "decimal point, not comma"),
    (re.compile(r"(?<=[A-Za-zµμÅ])(?<![\d. ][eE])(-?[1-9])"), r"^\1", "'^' before an exponent"),
    (re.compile(r"(?<=[A-Za-zµμÅ¹²³]) +(?=[A-Za-zµμÅ])"), "*", "'*' between units"),
)
"""Ways of writing that are plain enough to say what would be right."""


def _remedy(text: str, grammar: re.Pattern[str]) -> str:
    """Say how to write what can only have meant one thing; empty if nothing can be told."""
    if re.match(r" *[-+]?(nan|inf)", text, re.IGNORECASE):
        return "must be finite"
    if len(text) > LONGEST_QUANTITY:
        return ""
    if re.match(r" *[-+]?[1-9]\d{0,2},\d{3}(?!\d|,|\.)", text):
        ways = [text.replace(",", mark).strip() for mark in (".", "")]
        if all(map(grammar.fullmatch, ways)):
            return f"write {ways[0]!r} or {ways[1]!r}: decimal point, not comma, and no separators of thousands"
    if re.search(r"/.*[/*·⋅]", text) and "(" not in text and "**" not in text:
        return "may be read in two ways; after '/' put one unit, or parentheses, as in '3 N/(m*s)'"
    reasons = []
    for slip, right, reason in _SLIPS:
        text, count = slip.subn(right, text)
        if count:
            reasons.append(reason)
        if found := grammar.fullmatch(text):
            if grammar is _QUANTITY and found[2]:
                _size_of(found[2])  # what is said to be right must be
            return f"write {text.strip()!r}: {', '.join(dict.fromkeys(reasons))}"
    return ""


def quantity(unit: str, example: str, sign: Literal["above 0", "at least 0", ""] = "above 0") -> BeforeValidator:
    """How a quantity is read: a string with a unit in SI files, a plain number in natural ones."""

    def to_si(value: object, info: ValidationInfo) -> object:
        result = _read(value, natural=bool(info.context and info.context["natural"]))
        if not math.isfinite(result):
            raise ValueError("must be finite")
        if refusal := extreme(result):
            raise ValueError(f"{refusal} (in {unit})")
        if (sign == "above 0" and result <= 0) or (sign == "at least 0" and result < 0):
            raise ValueError(f"must be {sign}")
        return result

    def _read(value: object, natural: bool) -> float:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            if natural:
                return float(value) if abs(value) <= sys.float_info.max else math.inf
            raise ValueError(f"has no unit; write it as a string, such as {example!r}")
        if not isinstance(value, str):
            raise ValueError(f"must be a quantity, such as {example!r}")
        if natural:
            raise ValueError("must be a plain number, as the file says units = 'natural'")
        return read_quantity(value, unit, example)

    return BeforeValidator(to_si)


Mass = Annotated[float, quantity("kg", "75.6 g", "at least 0")]
Stiffness = Annotated[float, quantity("N/m", "4 MN/m")]
Rate = Annotated[float, quantity("1/s", "200 1/s", "at least 0")]
Force = Annotated[float, quantity("N", "768 N")]
Length = Annotated[float, quantity("m", "2 um")]
Time = Annotated[float, quantity("s", "2 ms")]
Lag = Annotated[float, quantity("s", "2 ms", "at least 0")]
Velocity = Annotated[float, quantity("m/s", "0.4 mm/s", "")]


# ---------------------------------------------------------------------------------------------------------------------
# Errors in the user's words
# ---------------------------------------------------------------------------------------------------------------------


_TAGS = {
    *("random", "fixed", "never", "gaussian", "uniform", "exponential", "gamma", "lognormal", "weibull", "empirical"),
    *("langevin", "logarithmic", "as list", "as table", "as range"),
}
"""Names of the alternatives of a union: no keys of a file."""


_MOST_TOLD = 320
"""Characters of mistakes after which the others are only counted."""


def _in_one_line(error: ValidationError, document: type[Part]) -> str:
    """Say what is wrong with a file, mistake after mistake as far as a line reaches."""
    told: dict[str, None] = {}
    items = error.errors(include_url=False)
    for number, item in enumerate(items):
        told[_one_mistake(item, document)] = None
        if sum(map(len, told)) > _MOST_TOLD and number + 1 < len(items):
            return f"{'; '.join(told)}; and {len(items) - number - 1} more"
    return "; ".join(told)


def _one_mistake(item: Any, document: type[Part]) -> str:
    """Say one thing that is wrong with a file: key, value and remedy."""
    path = [shortened(str(part)) for part in item["loc"] if part not in _TAGS]
    kind, value = item["type"], item["input"]
    key = ".".join(path) or "the file"
    if kind == "extra_forbidden":
        known = _keys_beside(path, document)
        near = difflib.get_close_matches(path[-1], known, n=1, cutoff=0.5)
        remedy = f"; did you mean {near[0]!r}?" if near else f"; known here: {', '.join(known)}"
        return f"{key}: unknown key{remedy}"
    if kind == "missing":
        return f"{key}: is missing"
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        return f"{key}: must name its distribution, such as {{distribution = 'gaussian', std = 0.1}}; known distributions: {_tags(item)}"
    if kind == "literal_error":
        return f"{key} = {shown(value)}: must be {item['ctx']['expected']}"
    if kind == "value_error":
        found = "" if isinstance(value, dict) else f" = {shown(value)}"
        return f"{key}{found}: {item['ctx']['error']}"
    words = {
        "float_type": "must be a number",
        "int_type": "must be a whole number",
        "string_type": "must be text in quotes",
        "list_type": "must be a list",
        "model_type": f"must be a table, as in [{key}]",
        "dict_type": f"must be a table, as in [{key}]",
        "model_attributes_type": f"must be a table, as in [{key}]",
        "greater_than_equal": f"must be at least {item.get('ctx', {}).get('ge')}",
        "less_than": f"must be below {item.get('ctx', {}).get('lt')}",
        "string_too_long": f"must be at most {item.get('ctx', {}).get('max_length')} characters long",
    }
    return f"{key} = {shown(value)}: {words.get(kind, item['msg'].lower())}"


_DISTRIBUTIONS = ("gaussian", "uniform", "exponential", "gamma", "lognormal", "weibull", "empirical")


def _tags(item: Any) -> str:
    return str(item.get("ctx", {}).get("expected_tags", ", ".join(_DISTRIBUTIONS)))


def _keys_beside(path: list[str], document: type[Part]) -> list[str]:
    """Keys that the file may hold beside the last of a path."""
    schema = _schema(document)

    def resolve(node: dict[str, Any]) -> dict[str, Any]:
        return dict(schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]) if "$ref" in node else node

    def alternatives(node: dict[str, Any]) -> list[dict[str, Any]]:
        below = node.get("anyOf") or node.get("oneOf")
        return [inner for one in below for inner in alternatives(resolve(one))] if below else [node]

    node: dict[str, Any] = schema
    for part in path[:-1]:
        following = [one["properties"][part] for one in alternatives(node) if part in one.get("properties", {})]
        if not following:
            return []
        node = resolve(following[0])
    return sorted({key for one in alternatives(node) for key in one.get("properties", {})})


@lru_cache(maxsize=4)
def _schema(document: type[Part]) -> dict[str, Any]:
    return TypeAdapter(document).json_schema()
